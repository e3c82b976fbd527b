"""explained.toml says what was changed, from what, by which diagnosis and data, and is a mechanism file too."""

from __future__ import annotations

import tomllib
from typing import Any

import pytest

from analytic.mechanism import Mechanism
from analytic.mechanism.file import load, loads
from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.report.explained import changes, commented, explained_toml
from compare.results.diagnosis import Diagnosis, Effect, Estimate
from sample_diagnosis import as_document, sample_diagnosis

FOUND = {  # effect -> where, values, and a field that it changes
    "joint_clearance": ("B", {"radial_clearance": 2e-4}, "joint[B].clearance"),
    "coulomb_friction": ("E", {"friction_torque": 0.02}, "joint[E].friction_torque"),
    "link_length": ("follower", {"length_error": 1e-4}, "body[follower].points.B"),
    "pivot_position": ("E", {"x": 1e-4, "y": -2e-4}, "ground.points.E"),
    "external_force": ("coupler", {"x": 1.0, "y": 2.0}, "load[0].force"),
    "gravity": ("linkage", {"x": 0.0, "y": -9.7}, "gravity"),
    "speed_ripple": ("drive", {"amplitude": 1e-3, "harmonic": 3.0, "phase": 0.5}, "drive.ripple.amplitude"),
    "sensor_bias": ("coupler_x", {"bias": 1e-5}, None),
}


@pytest.fixture(scope="module")
def sample() -> Diagnosis:
    return as_document(sample_diagnosis(samples=37))


def diagnosed(sample: Diagnosis, *names: str, nominal: Mechanism | None = None, **fields: Any) -> Diagnosis:
    """The sample as if these effects had been found, each value known to a tenth."""
    mechanism = nominal or sample.mechanism
    effects, explained = [], mechanism
    for name in names:
        where, values, _ = FOUND[name]
        explained = VOCABULARY[name].on_mechanism(explained, where, values)
        parameters = {
            p: Estimate(value=v, unit="1", low=v - 0.1 * abs(v), high=v + 0.1 * abs(v)) for p, v in values.items()
        }
        effects.append(sample.effects[0].model_copy(update={"name": name, "where": where, "parameters": parameters}))
    return sample.model_copy(
        update={"mechanism": mechanism, "explained": explained, "effects": tuple(effects), **fields}
    )


def above(text: str, field: str) -> str:
    """The comment on the line above a field, which is found by its value's path."""
    marked = commented("\n".join(line for line in text.splitlines() if not line.startswith("#")), {field: "HERE"})
    bare, lines = marked.splitlines(), text.splitlines()
    line = bare[bare.index("# HERE") + 1]
    places = [k for k, each in enumerate(lines) if each == line and lines[k - 1].startswith("# ")]
    assert len(places) == 1
    return lines[places[0] - 1]


def test_the_head_says_what_was_added_by_which_diagnosis_and_data(sample: Diagnosis) -> None:
    runs = tuple(run.model_copy(update={"file": f"{run.name}.csv"}) for run in sample.runs)
    found = diagnosed(sample, "joint_clearance", "sensor_bias", runs=runs)
    head = [line.removeprefix("# ") for line in explained_toml(found).split("name = ", 1)[0].splitlines()]
    assert head[0] == "crank-rocker with what a diagnosis added to it (explained)."
    assert "mujoco 4.0.0" in head[1]
    assert f"{found.gap.before:.4g} times the noise before" in head[1]
    assert head[2] == "Data: " + ", ".join(f"{run.name} ({run.name}.csv)" for run in runs) + "."
    assert head[3] == "Added (95 % intervals in brackets):"
    assert head[4].strip() == "joint_clearance@B: radial_clearance 0.0002 [0.00018, 0.00022]"
    assert "not in this file" in head[5]
    assert head[6].strip() == "sensor_bias@coupler_x: bias 1e-05 [9e-06, 1.1e-05]"
    assert head[7:9] == ["Changed:", "    joint[B].clearance = 0.0002, was left out"]
    assert head[9] == f"Made by: {sample.command}"


@pytest.mark.parametrize("name", [name for name, (_, _, field) in FOUND.items() if field])
def test_each_changed_field_says_by_which_effect_and_what_it_was(sample: Diagnosis, name: str) -> None:
    where, values, field = FOUND[name]
    assert field is not None
    found = diagnosed(sample, name)
    said = above(explained_toml(found), field)
    assert said.startswith(f"# {name}@{where}: ")
    for p, v in values.items():
        assert f"{p} {v:.6g} [{v - 0.1 * abs(v):.6g}, {v + 0.1 * abs(v):.6g}]" in said
    before = {path: nominal for path, nominal, _ in changes(found)}[field]
    assert said.endswith("; was left out" if before == "\N{EN DASH}" else f"; was {before}")


def test_two_effects_on_one_linkage_have_a_comment_each(sample: Diagnosis) -> None:
    text = explained_toml(diagnosed(sample, "joint_clearance", "coulomb_friction", "link_length"))
    for name in ("joint_clearance", "coulomb_friction", "link_length"):
        where, _, field = FOUND[name]
        assert field is not None
        assert above(text, field).startswith(f"# {name}@{where}: ")


def test_it_is_a_mechanism_file_all_the_same(sample: Diagnosis) -> None:
    found = diagnosed(sample, *(name for name in FOUND if name != "sensor_bias"))
    assert loads(explained_toml(found)) == found.explained
    slider = load("slider-crank")
    assert loads(explained_toml(diagnosed(sample, nominal=slider))) == slider


def test_what_a_stated_value_was_is_said(sample: Diagnosis) -> None:
    nominal = sample.mechanism.with_clearances({"B": 5e-5})
    said = above(explained_toml(diagnosed(sample, "joint_clearance", nominal=nominal)), "joint[B].clearance")
    assert said.endswith("; was 5e-05")


def test_an_effect_outside_the_vocabulary_is_named_at_the_head(sample: Diagnosis) -> None:
    clearance = sample.effects[0]
    own = Effect.model_validate(clearance.model_dump() | {"name": "worn_bush"})
    text = explained_toml(sample.model_copy(update={"effects": (own,)}))
    assert "#     worn_bush@B: radial_clearance" in text
    assert above(text, "joint[B].clearance").startswith("# changed by the diagnosis; was")


def test_what_stands_in_a_name_cannot_leave_its_comment(sample: Diagnosis) -> None:
    text = explained_toml(sample.model_copy(update={"case": "a\nclearance = 1", "command": "compare \x1b[2J"}))
    assert "\x1b" not in text
    assert text.splitlines()[0].startswith("# a\\nclearance = 1")
    assert tomllib.loads(text)

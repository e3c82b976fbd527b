"""What has no name: the place where one unknown tells it, and the law that it looks like, of data by another engine."""

from __future__ import annotations

import functools
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analytic.mechanism import Mechanism, PeriodicTorque
from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.diagnose.problem import Options, Problem
from compare.diagnose.propose.proposal import proposal
from compare.diagnose.workflow import diagnose
from compare.report.diagnosis_page import diagnosis_html, diagnosis_md
from compare.report.diagnosis_terminal import terminal_lines
from compare.report.proposal_figure import figure
from compare.results.diagnosis import Diagnosis, Proposed
from diagnosis_rigs import SENSORS, experiment, four_bar, played, turn
from marks import slow
from sim_models.engine import ENGINES
from tests.evidence.scoreboard.hidden import FIRST
from tests.evidence.scoreboard.record import make_set
from tests.evidence.scoreboard.score import opened

CELLS = {"reaction_B_x": 0.02, "reaction_B_y": 0.02}
MACHINES = tuple(e.name for e in VOCABULARY.values() if e.hiding.sets == "machines")  # what has a name is not proposed
RUNS = (turn("slow", 4.0), turn("fast-reverse", -12.0), turn("fast", 10.0))


@functools.cache
def unnamed(what: str) -> Diagnosis:
    """The diagnosis of data in which the believed four-bar lacks what the real one has."""
    measured = played(experiment(*RUNS, mechanism=REAL[what][0], sensors=SENSORS | CELLS))
    measured = replace(measured, mechanism=four_bar())
    return diagnose(measured, "mujoco", others=False, workers=1, exclude=MACHINES)


def with_wave(m: Mechanism, **wave: float) -> Mechanism:
    assert m.drive is not None
    return m.replace(drive=m.drive.model_copy(update={"periodic_torque": PeriodicTorque(**wave)}))


REAL = {  # the real mechanism; where it is, the law, and the numbers in it that are known
    "drag": (four_bar().with_joint("E", drag=0.02), "E", "a w |w|", {"a": -0.02}),
    "Stribeck": (
        four_bar().with_joint("E", friction_torque=0.05, static_torque=0.15, stribeck_speed=1.5),
        "E",
        "a sign w + b exp(-(w/c)^2) sign w",
        {"a": -0.05, "b": -0.1, "c": 1.5},
    ),
    "stiffening spring": (
        four_bar().with_joint("B", cubic=0.3, rest_angle=1.2),
        "B",
        "a (q - b)^3",
        {"a": -0.3, "b": 1.2},
    ),
    "cogging": (
        with_wave(four_bar(), amplitude=0.05, harmonic=14, phase=math.pi / 2),
        "D",
        "a cos 14 theta + b sin 14 theta",
        {"a": 0.05, "b": 0.0},
    ),
}


@pytest.mark.parametrize("what", slow("Stribeck", "drag", "stiffening spring", "cogging"))
def test_a_torque_without_a_name_is_proposed_at_its_joint_with_its_law(what: str) -> None:
    _, joint, law, numbers = REAL[what]
    found = unnamed(what)
    (p,) = found.proposed
    assert (p.unknown, p.place, p.law) == ("torque", joint, law), p.says
    assert p.share > 0.9
    for letter, value in numbers.items():
        c = p.coefficients[letter]
        assert c.low is not None
        assert c.high is not None
        assert abs(c.value - value) <= 2 * (c.high - c.low) / 1.96, (letter, c)
        assert c.high - c.low < 0.1 * max(abs(n) for n in numbers.values())


@pytest.mark.slow
def test_a_proposal_is_no_name_and_no_part_of_the_verdict() -> None:
    found = unnamed("Stribeck")
    assert found.proposed
    assert found.verdict in ("partly explained", "unexplained")
    assert not found.settled
    assert [effect.name for effect in found.effects] == ["coulomb_friction"], "nor a follower without inertia"
    assert "Stribeck" not in found.statement


@pytest.mark.slow
def test_the_page_and_the_texts_show_the_law_with_its_curve() -> None:
    found = unnamed("Stribeck")
    (p,) = found.proposed
    order = np.argsort(p.curve.argument)
    assert np.all(np.diff(p.curve.argument[order]) >= 0)
    assert np.mean(((p.curve.recovered - p.curve.law) / p.curve.sigma) ** 2) == pytest.approx(1.0, abs=0.5)
    page, md, lines = diagnosis_html(found), diagnosis_md(found), terminal_lines(found)
    for text in (page, md):
        assert "Proposed, not named" in text
        assert "Stribeck friction" in text
    (said,) = [line for line in lines if line.startswith("proposed (not named): ")]
    assert "Coulomb friction in joint E" in said, "what it takes the place of, or goes beyond"
    assert "looks like Stribeck friction: a sign w + b exp(-(w/c)^2) sign w, with a = -0.05 N.m, b = -0.1 N.m" in said


def over(argument: np.ndarray, law: np.ndarray, what: str) -> Proposed:
    """A proposal that is shown over something else."""
    (p,) = unnamed("Stribeck").proposed
    values = {"argument": argument, "recovered": law, "law": law, "sigma": np.ones(law.size)}
    return p.model_copy(update={"curve": p.curve.model_copy(update={"over": what, "unit": "rad", **values})})


@pytest.mark.slow
def test_a_law_over_the_crank_angle_is_drawn_over_one_turn() -> None:
    turns = np.linspace(-6 * np.pi, 6 * np.pi, 400)
    drawn = figure(unnamed("Stribeck"), over(turns, np.sin(3 * turns), "crank angle"), "law")
    recovered, law = drawn.series
    assert 0 <= min(recovered.x) < max(recovered.x) < 360
    assert law.mark == "line"
    np.testing.assert_allclose(law.y, np.sin(np.radians(3 * np.array(law.x))), atol=1e-6)


@pytest.mark.slow
def test_a_law_of_two_things_is_drawn_as_points_and_no_line_crosses_where_there_is_no_sample() -> None:
    angle = np.concatenate([np.linspace(-2, -1, 200), np.linspace(1, 2, 200)])
    found = unnamed("Stribeck")
    _, twofold = figure(found, over(angle, np.sign(angle) * np.tile([1.0, 2.0], 200), "angle in joint E"), "law").series
    assert twofold.mark == "marker"
    _, simple = figure(found, over(angle, np.sign(angle), "angle in joint E"), "law").series
    assert (simple.mark, simple.y.count(None)) == ("line", 1)


@pytest.mark.slow
def test_the_law_goes_through_what_was_recovered_beside_what_is_named(tmp_path: Path) -> None:
    """Stribeck friction is named as friction in part, where it has no name: beside the law that has another value."""
    make_set(FIRST["outside"] + 2001, tmp_path / "data", tmp_path / "seal")
    truth = opened(tmp_path / "seal").outside
    assert truth is not None
    found = diagnose(tmp_path / "data", "mujoco", exclude=truth.excluded, others=False, workers=1)
    (p,) = found.proposed
    assert (truth.kind, truth.where) == ("Stribeck friction", "B")
    assert ("coulomb_friction", "B") in [(e.name, e.where) for e in found.effects]
    assert (p.unknown, p.place) == ("torque", "B")
    assert np.median(np.abs(p.curve.recovered - p.curve.law) / p.curve.sigma) < 1
    assert np.ptp(p.curve.law) > 20 * np.median(p.curve.sigma)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "unknown", "law"),
    [
        (FIRST["unnamed"] + 8, "length", "a sign P"),
        (FIRST["unnamed"] + 31, "lag", "a S"),
        (FIRST["unnamed"] + 42, "length", "a t"),
    ],
    ids=["loose bolt", "slipping belt", "growing link"],
)
def test_play_in_a_link_slip_of_a_belt_and_a_link_that_grows_are_proposed(
    seed: int, unknown: str, law: str, tmp_path: Path
) -> None:
    make_set(seed, tmp_path / "data", tmp_path / "seal")
    truth = opened(tmp_path / "seal").outside
    assert truth is not None
    found = diagnose(tmp_path / "data", "mujoco", others=False, workers=1)
    (p,) = found.proposed
    assert (p.unknown, p.place, p.law) == (unknown, truth.where, law), p.says
    assert found.verdict in ("partly explained", "unexplained"), found.statement
    if law != "a t":  # the true one slows down as it warms
        size = p.coefficients["a"]
        assert abs(size.value) == pytest.approx(abs(truth.size), rel=0.05)


@pytest.mark.parametrize("seed", [1, *slow(*range(2, 6))])
def test_nothing_is_proposed_of_noise(seed: int) -> None:
    measured = played(experiment(*RUNS, sensors=SENSORS | CELLS), seed=seed)
    problem = Problem.of(measured, measured.mechanism, Options("mujoco", workers=1, others=False))
    assert proposal(problem.model, problem.fitter, problem.base) is None


@pytest.mark.slow
@pytest.mark.parametrize("what", REAL)
def test_an_adopted_law_is_an_effect_that_every_engine_simulates_and_closes_the_gap(what: str) -> None:
    _, joint, _, numbers = REAL[what]
    measured = replace(
        played(experiment(*RUNS, mechanism=REAL[what][0], sensors=SENSORS | CELLS)), mechanism=four_bar()
    )
    found = diagnose(measured, "mujoco", adopt=True, workers=1, exclude=MACHINES)
    (effect,) = found.effects
    assert (effect.name, effect.where, found.verdict) == ("proposed_torque", joint, "explained"), found.statement
    for letter, value in numbers.items():
        assert effect.parameters[letter].value == pytest.approx(value, rel=0.02, abs=0.02 * abs(numbers["a"]))
    assert set(found.other_simulators) == {*ENGINES} - {"mujoco"}
    for gap in (found.gap, *found.other_simulators.values()):
        assert gap.after <= 1.1
    assert [p.adopted for p in found.proposed] == [True]
    assert "It is adopted" in diagnosis_html(found)


@pytest.mark.slow
def test_an_adopted_law_is_considered_whatever_else_is() -> None:
    measured = replace(
        played(experiment(*RUNS, mechanism=REAL["drag"][0], sensors=SENSORS | CELLS)), mechanism=four_bar()
    )
    found = diagnose(measured, "mujoco", adopt=True, workers=1, others=False, only=["gravity"])
    assert ([e.name for e in found.effects], found.verdict) == (["proposed_torque"], "explained"), found.statement
    assert "Proposed, and adopted" in diagnosis_html(found)


@pytest.mark.slow
def test_what_no_mechanism_can_say_is_not_adopted_and_the_report_says_why() -> None:
    measured = played(experiment(*RUNS, sensors=SENSORS | CELLS))
    runs = []
    for run in measured.runs:
        cell, turn = run.channels["drive_torque"], run.channels["crank_angle"].values
        beside = np.mod(turn - 2.0 + np.pi, 2 * np.pi) - np.pi
        tooth = replace(cell, values=cell.values + 0.1 * np.exp(-0.5 * (beside / 0.2) ** 2))
        runs.append(replace(run, channels={**run.channels, "drive_torque": tooth}))
    found = diagnose(replace(measured, runs=tuple(runs), mechanism=four_bar()), "mujoco", adopt=True, others=False)
    assert found.proposed
    assert all("no mechanism file can say" in p.not_adopted for p in found.proposed)
    assert any("It cannot be adopted: no mechanism file can say" in line for line in terminal_lines(found))
    assert not any(p.adopted for p in found.proposed)

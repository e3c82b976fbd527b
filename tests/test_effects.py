"""An effect is one thing in one place: words, parameters, coordinates, engines and a random size are its class's."""

from __future__ import annotations

import ast
import json
import math
from functools import cache
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from analytic.mechanism import Joint, Mechanism
from compare.cli.app import app
from compare.diagnose.effects.effect import Draw, Effect, Rig
from compare.diagnose.effects.vocabulary import VOCABULARY
from diagnosis_rigs import experiment, four_bar, turn
from sim_models.engine import ENGINES, declared
from tests.evidence.scoreboard.rigs import Experiment, ideal

ROOT = Path(__file__).parent.parent
CASES = pytest.mark.parametrize("case", ["crank-rocker", "slider-crank"])
EFFECTS = pytest.mark.parametrize("effect", VOCABULARY.values(), ids=lambda e: e.name)


@cache
def rig_of(case: str) -> tuple[Experiment, Rig]:
    """A four-bar's or a slider-crank's two runs, and what effects see of them."""
    runs = turn("slow", 4.0), turn("fast-reverse", -12.0)
    if case == "crank-rocker":
        found = experiment(*runs)
    else:
        sensors = {"crank_angle": 5e-5, "slider_x": 1e-5, "drive_torque": 1e-3}
        found = experiment(*runs, mechanism=four_bar(case, loads=()), sensors=sensors)
    return found, found.rig


def kinds_of_place(rig: Rig) -> dict[str, set[str]]:
    """Every place that there is, by kind."""
    m = rig.mechanism
    return {
        "linkage": {"linkage"},
        "drive": {"drive"},
        "body": {b.name for b in m.bodies},
        "joint": {j.name for j in m.joints},
        "ground point": set(m.ground.points),
        "signal": set(rig.signals),
        "run": set(rig.runs),
    }


@EFFECTS
def test_an_effect_has_words_of_its_own(effect: Effect) -> None:
    somewhere = effect.place not in ("linkage", "drive")
    for text in (effect.label, effect.meaning):
        assert text
        assert text.count("{}") == somewhere, "the words name the place where there are several"
    assert ("Q" in effect.called("Q")) == ("Q" in effect.says("Q")) == somewhere
    assert set(effect.special_case_of) <= set(VOCABULARY)


@CASES
@EFFECTS
def test_an_effect_is_where_its_kind_of_place_says(case: str, effect: Effect) -> None:
    _, rig = rig_of(case)
    for where in effect.places(rig):
        places = where.split("+")  # sensors of one amplifier are one place
        assert set(places) <= kinds_of_place(rig)[effect.place]
        assert len(places) == 1 or effect.name == "sensor_lag"


@CASES
@EFFECTS
def test_a_drawn_effect_grows_from_nothing_and_stays_physical(case: str, effect: Effect) -> None:
    experiment, rig = rig_of(case)
    speeds = {plan.name: abs(plan.speed) for plan in experiment.plans}
    places = [w for w in effect.places(rig) if (effect.name, w) != ("moment_of_inertia", "slider")]  # it does not turn
    for where, seed in product(places, (1, 2, 3)):
        rng = np.random.default_rng(seed)
        draw = Draw(
            rng, rng.uniform(0, 2 * math.pi), float(rng.choice([-1, 1])), speeds,
            lambda: ideal(experiment.nominal, experiment.plans[0]),
        )  # fmt: skip
        growth = effect.growth(rig, where, draw)
        assert growth.variant in effect.variants(rig, where)
        sizes = []
        for amount in (1e-6, 1e-3, 0.5, 1.0):
            values = growth.values(amount * min(growth.most, 100.0))
            x = effect.natural(rig, where, values, growth.variant)
            assert effect.values(rig, where, x, growth.variant) == pytest.approx(dict(values)), "natural inverts values"
            assert np.all(x >= effect.lowest(rig, where, growth.variant) - 1e-15)
            sizes.append(abs(float(x[0])))  # a payload's place stays while its mass grows
            assert isinstance(effect.on_mechanism(rig.mechanism, where, values), Mechanism)
        assert sizes == sorted(sizes), (where, seed)
        assert 0 < sizes[0] < 1e-2 * sizes[-1], (where, seed)


MORE = {  # what a positive value makes larger: a number of the mechanism, or of the readings, that has its direction
    "gravity.x": lambda m, r: m.gravity[0],
    "gravity.y": lambda m, r: m.gravity[1],
    "payload.along": lambda m, r: m.moving["follower"].centre.real,
    "payload.normal": lambda m, r: m.moving["follower"].centre.imag,
    "com_offset.along": lambda m, r: m.moving["follower"].centre.real,
    "com_offset.normal": lambda m, r: m.moving["follower"].centre.imag,
    "moment_of_inertia.inertia_error": lambda m, r: m.moving["follower"].moment_of_inertia,
    "link_length.length_error": lambda m, r: m.moving["follower"].length,
    "pivot_position.x": lambda m, r: m.ground.points["E"][0],
    "pivot_position.y": lambda m, r: m.ground.points["E"][1],
    "nonlinear_spring.cubic": lambda m, r: m.joint("B").cubic or 0.0,
    "external_force.x": lambda m, r: sum(load.force[0] for load in m.loads),
    "external_force.y": lambda m, r: sum(load.force[1] for load in m.loads),
    "load_torque.torque": lambda m, r: sum(load.torque for load in m.loads),
    "encoder_offset.offset": lambda m, r: r["crank_angle"][0],
    "sensor_bias.bias": lambda m, r: r["follower_angle"][0],
    "sensor_gain.gain_error": lambda m, r: r["follower_angle"][0],
    "sensor_frame.rotation": lambda m, r: -r["reaction_B_y"][0],  # a force along x is clockwise of a cell turned so
}


@pytest.mark.parametrize("parameter", MORE)
def test_a_positive_value_is_more_of_what_its_words_say(parameter: str) -> None:
    """A word for each direction is right only if values have it: held to what they do to mechanism and readings."""
    name, _, key = parameter.partition(".")
    effect, m = VOCABULARY[name], four_bar(loads=())
    where = {"body": "follower", "joint": "B", "ground point": "E", "linkage": "linkage"}.get(effect.place)
    where = where or ("crank_angle" if name == "encoder_offset" else "follower_angle")
    readings = {
        "crank_angle": np.array([1.0]), "follower_angle": np.array([1.0]),
        "reaction_B_x": np.array([10.0]), "reaction_B_y": np.array([0.0]),
    }  # fmt: skip
    sizes = []
    for value in (-1e-5, 0.0, 1e-5):
        values = {p.name: value if p.name == key else 1e-2 * (p.lowest == 0) for p in effect.parameters}
        changed = effect.on_mechanism(m, where, values), effect.on_readings(readings, "slow", where, values)
        sizes.append(MORE[parameter](*changed))
    assert sizes[0] < sizes[1] < sizes[2]


def test_a_drift_upwards_and_a_late_clock_are_positive() -> None:
    assert VOCABULARY["sensor_drift"].drift("slow", "follower_angle", "follower_angle", {"drift": 0.1}) == 0.1
    assert VOCABULARY["clock_offset"].delay("slow", "follower_angle", "slow", {"offset": 0.1}) == 0.1


def test_a_joint_has_one_spring() -> None:
    """A linear one would take the place of stiffness and rest, and leave the other's cubic term about that rest."""
    bent = four_bar().with_joint("B", stiffness=0.1, cubic=0.3, rest_angle=1.0)
    with pytest.raises(ValueError, match="B has a spring already"):
        VOCABULARY["joint_spring"].on_mechanism(bent, "B", {"stiffness": 1e-12, "rest_angle": 2e11})


def test_the_commands_agree_on_what_each_engine_simulates() -> None:
    runner = CliRunner()
    listed = json.loads(runner.invoke(app, ["effects", "--json"]).stdout)["effects"]
    assert [row["name"] for row in listed] == list(VOCABULARY)
    table = runner.invoke(app, ["simulators"]).stdout
    for name in ENGINES:
        lacks = [row["name"] for row in listed if name not in row["simulators"]]
        assert lacks == [e.name for e in VOCABULARY.values() if not e.simulated_by(declared(name))]
        row = next(line for line in table.splitlines() if line.startswith(name))
        assert all(effect in " ".join(table.split()) for effect in lacks)
        assert ("all but" in row) == bool(lacks)
    clearance = next(row for row in listed if row["name"] == "joint_clearance")
    real_contact = [name for name in ENGINES if ("contact", "driven") in declared(name).capabilities.runs]
    assert clearance["simulators"] == real_contact != list(ENGINES)


def names_compared(path: Path) -> list[str]:
    """Names of effects that a file compares something with."""
    found, text = [], path.read_text(encoding="utf-8")
    if not any(name in text for name in VOCABULARY):
        return []
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Compare):
            literals = [node.left, *node.comparators] if isinstance(node.ops[0], ast.Eq | ast.NotEq) else []
            for side in node.comparators:
                literals += side.elts if isinstance(side, ast.Tuple | ast.List | ast.Set) else []
            names = [c.value for c in literals if isinstance(c, ast.Constant) and c.value in VOCABULARY]
            found += [name for name in names if name not in Joint.model_fields]  # which is what runs are told by
    return found


@pytest.mark.parametrize("folder", ["compare", "sim_models"])
def test_nothing_but_an_effect_s_own_class_asks_for_its_name(folder: str) -> None:
    own = ROOT / "compare" / "diagnose" / "effects"
    asking = {p.relative_to(ROOT).as_posix(): names_compared(p) for p in (ROOT / folder).rglob("*.py")
              if own not in p.parents}  # fmt: skip
    assert not {path: names for path, names in asking.items() if names}


def test_a_comparison_with_a_name_would_be_found(tmp_path: Path) -> None:
    file = tmp_path / "wrong.py"
    file.write_text('a = x == "payload"\nb = x in ("gravity", "other")\nc = {"payload": 1}\n', encoding="utf-8")
    assert names_compared(file) == ["payload", "gravity"]


def test_the_list_says_which_effects_are_tried_only_where_they_are_asked_for() -> None:
    lines = CliRunner().invoke(app, ["effects"]).stdout.splitlines()
    told = {said.split()[0]: line for said, line in zip(lines[::2], lines[1::2], strict=True)}
    assert told.keys() == VOCABULARY.keys()
    for name, effect in VOCABULARY.items():
        assert told[name].endswith(f"; tried only with --only {name}") == effect.asked_for
    assert any(effect.asked_for for effect in VOCABULARY.values())

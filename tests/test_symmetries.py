"""A linkage that is mirrored, turned, moved, described in other frames, with other names or in another order is one
linkage to every command.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import linkage_crosscheck as lc
from analytic.mechanism import Load, Mechanism, PeriodicTorque
from analytic.mechanism.file import dumps, load
from analytic.mechanism.signals import Signal, named
from linkages import inverted_slider
from marks import slow
from measured_files import RunTable, write_measured
from several_linkages import sprung
from sim_models.common.units import Units
from sim_models.engine import ENGINES, declared
from symmetries import Seen

ANGLES, TIMES = np.radians(np.arange(20.0, 100.0, 15.0)), np.linspace(0.0, 0.2, 6)
Motion = Any


def rocker() -> Mechanism:
    """The crank-rocker with all that has a direction: loads, gravity, centres, laws of joints, uneven turning."""
    m = load("crank-rocker").replace(
        gravity=(1.0, -9.81),
        loads=(
            Load(body="coupler", point="B", force=(20.0, -30.0), torque=0.4),
            Load(body="follower", torque=0.5),
        ),
    )
    m = m.with_body("coupler", com=(0.05, 0.013), marker=(0.02, -0.03))
    m = m.with_joint("E", stiffness=1.5, rest_angle=0.3, friction_torque=0.05, damping=0.01)
    wave = PeriodicTorque(amplitude=0.2, harmonic=3, phase=0.4)
    return m.replace(drive=m.drive.model_copy(update={"periodic_torque": wave}))


def slider() -> Mechanism:
    """A slider-crank with gravity, a force on it and a spring from its rod to the ground."""
    m = load("slider-crank").with_joint("S", guide=None, stiffness=300.0, rest_angle=0.1, damping=4.0)
    spring = {"bodies": ("ground", "rod"), "points": ("O", "B"), "stiffness": 90.0, "length": 0.1, "damping": 2.0}
    loads = (Load(body="slider", force=(-30.0, 0.0)),)
    return m.replace(gravity=(0.0, -9.81), drive={"joint": "O", "speed": 20.0}, springs=[spring], loads=loads)


LINKAGES: dict[str, tuple[Callable[[], Mechanism], dict[str, float]]] = {
    "rocker": (rocker, {"B": 1e-4, "E": 5e-5}),
    "slider": (slider, {"B": 1e-4}),
    "block": (inverted_slider, {"A": 1e-4}),
    "five-bar": (lambda: sprung(load("five-bar")), {"P": 1e-4}),
    "3-rpr": (lambda: sprung(load("3-rpr")), {"C1": 1e-4}),
}


@cache
def linkage(name: str, loose: bool = True) -> Mechanism:
    made, gaps = LINKAGES[name]
    return made().with_clearances(gaps if loose else {})


def frames(m: Mechanism) -> dict[str, tuple[complex, float]]:
    return {body: (complex(0.02 * (i + 1), -0.03 * i), 0.3 + 0.4 * i) for i, body in enumerate(m.moving)}


WAYS: dict[str, Callable[[Mechanism], Seen]] = {
    "mirrored": lambda m: Seen(mirrored=True),
    "turned": lambda m: Seen(turn=0.7),
    "moved": lambda m: Seen(shift=0.3 - 0.2j),
    "in other frames": lambda m: Seen(frames=frames(m)),
    "with swapped joints": lambda m: Seen(swapped=True),
    "renamed": lambda m: Seen(suffix="-x"),
    "in reversed order": lambda m: Seen(reversed=True),
    "all at once": lambda m: Seen(frames(m), True, True, -2.1, 1 + 2j, True, "_9"),
}


def grid(m: Mechanism, seen: Seen | None = None) -> dict[str, Any]:
    """Crank angles, as they are seen, or times."""
    if not m.cranked:
        return {"times": TIMES}
    return {"angles": ANGLES if seen is None else np.asarray(seen.angle(m.driven, ANGLES))}


def same(m: Mechanism, found: Mapping[str, np.ndarray], expected: Mapping[str, np.ndarray], within: float) -> None:
    """Fails where a signal of a mechanism is off by more than this share of the largest of its unit, or of a radian."""
    known = named(m.bodies, m.joints, m.drives, m.sensors)
    assert set(found) == set(expected)
    largest = {"rad": 1.0}
    for name, values in expected.items():
        unit = known[name].unit
        largest[unit] = max(largest.get(unit, 0.0), 0.0 if unit == "rad" else np.nanmax(np.abs(values), initial=0.0))
    for name, values in expected.items():
        assert np.array_equal(np.isnan(found[name]), np.isnan(values)), name
        off = np.nanmax(np.abs(known[name].apart(found[name], values)), initial=0.0)
        assert off <= within * largest[known[name].unit], f"{name} is off by {off:.3g}"


every_linkage = pytest.mark.parametrize("name", LINKAGES)


@pytest.mark.long_rows("driven-3-rpr-all at once", "driven-3-rpr-mirrored")
@pytest.mark.parametrize(
    "way", ["all at once", "mirrored", *slow(*(w for w in WAYS if w not in ("all at once", "mirrored")))]
)
@every_linkage
@pytest.mark.parametrize("motion", ["driven", *slow("static")])
def test_the_analysis_is_the_same(name: str, motion: Motion, way: str) -> None:
    m = linkage(name)
    seen = WAYS[way](m)
    old = lc.analyse(m, motion=motion, **grid(m))
    new = lc.analyse(seen.of(m), motion=motion, **grid(m, seen))
    same(new.mechanism, new.signals, seen.signals(m, old.signals), 1e-9)
    assert new.flags.keys() == old.flags.keys()


@pytest.mark.parametrize("way", ["all at once", *slow(*WAYS)])
@pytest.mark.parametrize("name", ["rocker", "five-bar"])
def test_first_order_and_elastic_displacements_are_the_same(name: str, way: str) -> None:
    m = linkage(name)
    seen = WAYS[way](m)
    for question in ({"model": "first_order"}, {"motion": "static", "compliance": True}):
        old = lc.analyse(m, **question, **grid(m)).signals
        found = lc.analyse(seen.of(m), **question, **grid(m, seen))
        same(found.mechanism, found.signals, seen.signals(m, old), 1e-9)


@pytest.mark.long_rows("3-rpr-all at once0")
@pytest.mark.parametrize("way", ["all at once", *slow(*WAYS)])
@every_linkage
def test_accuracy_is_the_same(name: str, way: str) -> None:
    m = linkage(name)
    seen = WAYS[way](m)

    def asked(m: Mechanism, over: dict[str, Any]) -> Any:
        return lc.accuracy(m, samples=2, **over) if m.cranked else lc.platform_accuracy(m, **over)

    old, new = asked(m, grid(m)), asked(seen.of(m), grid(m, seen))
    for body in m.moving:
        for part in ("nominal", "equilibrium", "compliance") if m.cranked else ("nominal", "equilibrium"):
            x, y, angle = (getattr(old.outputs[f"{body}_{axis}"], part) for axis in ("x", "y", "angle"))
            moved = [getattr(new.outputs[f"{seen.name(body)}_{axis}"], part) for axis in ("x", "y", "angle")]
            np.testing.assert_allclose(moved[0] + 1j * moved[1], seen.vector(x + 1j * y), atol=1e-12, err_msg=body)
            np.testing.assert_allclose(moved[2], seen.sign * angle, atol=1e-11, err_msg=body)
        np.testing.assert_allclose(new.points[seen.name(body)].farthest, old.points[body].farthest, rtol=1e-6)


MODELS: dict[
    tuple[Any, bool], Any
] = {  # of joints; pins that strike do so a moment earlier or later in any other frame
    ("driven", False): "ideal",
    ("static", False): "ideal",
    ("driven", True): "massless-link",
    ("static", True): "contact",
}
ENGINES_SEE = [
    ("mujoco", "rocker", "driven", False),
    ("mujoco", "five-bar", "static", True),
    *slow(*(
        (engine, name, *asked)
        for e, engine in enumerate(ENGINES) for k, name in enumerate(LINKAGES) for asked, model in MODELS.items()
        if (model, asked[0]) in declared(engine).capabilities.runs and (not asked[1] or (e + k) % 2 == 0)
    )),
]  # fmt: skip


@pytest.mark.long_rows("mujoco-five-bar-static-True")
@pytest.mark.parametrize(("engine", "name", "motion", "loose"), ENGINES_SEE)
def test_the_cross_check_is_the_same_but_for_what_the_engines_steps_leave(
    engine: str, name: str, motion: Motion, loose: bool
) -> None:
    """To a fifth of the tolerance, or a twentieth of what it is off by, as a step's error depends on the coordinates
    that an engine takes.  Components of a displacement are judged one by one; their verdicts turn with the axes.
    """
    m = linkage(name, loose)
    seen = WAYS["all at once"](m)
    asked = {"joint_model": MODELS[motion, loose], "motion": motion, "revolutions": 0}
    old = lc.crosscheck(m, engine, **asked, **grid(m))
    new = lc.crosscheck(seen.of(m), engine, **asked, **grid(m, seen))
    assert [bool(result.failures) for result in (old, new)] == [False, False]
    known, now = named(m.bodies, m.joints, m.drives, m.sensors), new.mechanism
    same(now, new.runs[0].analytic, seen.signals(m, old.runs[0].analytic), 1e-9)
    moved, kinds = seen.signals(m, old.runs[0].simulated), named(now.bodies, now.joints, now.drives, now.sensors)
    judged = {each.signal: each for each in new.runs[0].discrepancies}
    for each in old.runs[0].discrepancies:
        s = known[each.signal]
        signal = Signal.of(s.kind, seen.name(s.place), s.component).name
        if s.kind != "clearance":
            assert judged[signal].verdict == each.verdict, signal
        if s.component != "angle" or s.kind != "reaction":  # whose tolerance grows where the force is small
            off = kinds[signal].apart(new.runs[0].simulated[signal], moved[signal])
            allowed = max(0.2 * judged[signal].tolerance, 0.05 * abs(judged[signal].max))
            assert np.nanmax(np.abs(off), initial=0.0) <= allowed, signal


@pytest.mark.long_rows("five-bar-in reversed order0", "five-bar-all at once0")
@pytest.mark.parametrize("way", ["in reversed order", "all at once", *slow(*WAYS)])
@pytest.mark.parametrize("name", ["rocker", "five-bar"])
def test_a_check_of_results_is_the_same_whatever_the_order_of_their_columns(
    name: str, way: str, tmp_path: Path
) -> None:
    m = linkage(name, loose=False)
    seen = WAYS[way](m)
    at = {"angles": np.radians(np.arange(20.0, 85.0, 5.0))} if m.cranked else {"times": np.linspace(0.0, 0.2, 13)}
    old = lc.simulate(m, **at)
    clock = {"time": np.linspace(0.0, 0.2, 13)} if old.time is None else {"time": old.time}
    now = seen.of(m)
    units = {n: s.unit for n, s in named(now.bodies, now.joints, now.drives, now.sensors).items()} | {"time": "s"}
    columns = {**clock, **seen.signals(m, old.signals)}
    columns = dict(reversed(columns.items())) if seen.reversed else columns
    file = tmp_path / "seen.csv"
    header = ",".join(f"{name} [{units[name]}]" for name in columns)
    np.savetxt(file, np.column_stack(list(columns.values())), "%.17g", ",", header=header, comments="")
    old.write(tmp_path / "old")
    one, other = lc.check(tmp_path / "old" / "signals.csv", m).runs[0], lc.check(file, now).runs[0]
    same(now, other.analytic, seen.signals(m, one.analytic), 1e-7)
    verdicts = {d.signal: d.verdict for d in other.discrepancies}
    known = named(m.bodies, m.joints, m.drives, m.sensors)
    for each in one.discrepancies:
        s = known[each.signal]
        assert verdicts[Signal.of(s.kind, seen.name(s.place), s.component).name] == each.verdict, each.signal


@pytest.mark.long_rows("3-rpr")
@every_linkage
def test_a_linkage_in_other_units_has_the_same_digits(name: str) -> None:
    """Of length, mass and time, by powers of two: dimensions say what each number becomes, and not a bit is lost."""
    units = Units(2.0**4, 2.0**-3, 2.0**2)
    m = linkage(name)
    other = units.mechanism(m)
    old = lc.analyse(m, **grid(m)).signals
    new = lc.analyse(other, **(grid(m) if m.cranked else {"times": TIMES / units.time})).signals
    known = named(m.bodies, m.joints, m.drives, m.sensors)
    expected = {n: values / units.size(known[n].unit) for n, values in old.items()}
    same(other, new, expected, 1e-12)


# ---------------------------------------------------------------- slow commands


@pytest.mark.slow
def test_a_cell_of_a_map_is_the_same() -> None:
    m = linkage("rocker")
    seen = WAYS["all at once"](m)
    asked = {"speeds": 6.0, "clearances": 1e-4, "joint_model": "massless-link", "revolutions": 0, "workers": 1}
    old = lc.validity(m, joints=["B"], **asked).cells[0]
    new = lc.validity(seen.of(m), joints=[seen.name("B")], **asked).cells[0]
    assert (new.verdict, new.cause, new.fails) == (old.verdict, old.cause, old.fails)
    for assumption, cost in old.cost.items():
        assert new.cost[assumption] == pytest.approx(cost, rel=0.1, abs=0.05), assumption  # at other angles of the turn


@pytest.mark.slow
def test_a_diagnosis_is_the_same(tmp_path: Path) -> None:
    """A follower 0.3 mm longer than drawn, seen as drawn and all at once otherwise."""
    m = load("crank-rocker")
    truth = m.with_body("follower", points={**m.moving["follower"].points, "B": (0.1003, 0.0)})
    time = np.linspace(0.0, 0.2, 80)
    theta = 31.41592653589793 * time
    found = []
    for where, seen in (("drawn", Seen()), ("seen", Seen(mirrored=True, turn=0.7, shift=0.1 + 0.2j, suffix="_9"))):
        scatter = np.random.default_rng(1)
        read = seen.signals(truth, lc.analyse(truth, angles=theta).signals)
        names = ["crank_angle", "follower_angle", "drive_torque"]
        now = {n: read[n if n == "drive_torque" else f"{n.split('_')[0]}{seen.suffix}_angle"] for n in names}
        columns = {
            f"{n if n == 'drive_torque' else n.split('_')[0] + seen.suffix + '_angle'}"
            f" [{'N.m' if n == 'drive_torque' else 'rad'}]": v + seen.sign * 1e-5 * scatter.normal(size=time.size)
            for n, v in now.items()
        }
        start = float(seen.angle("crank", 0.0))
        fields = {"drive_speed": seen.sign * 31.41592653589793, "drive_angle": start}
        path = write_measured(tmp_path / where, dumps(seen.of(m)), [RunTable("turn", time, columns, fields)])
        found.append(lc.diagnose(path, others=False, workers=1))
    assert found[0].verdict == found[1].verdict
    one, other = (result.effects for result in found)
    assert [(e.name, e.where) for e in other] == [(e.name, f"{e.where}_9") for e in one]
    assert one[0].parameters["length_error"].value == pytest.approx(3e-4, rel=1e-2)
    for drawn, seen_so in zip(one, other, strict=True):
        for name, parameter in drawn.parameters.items():
            assert seen_so.parameters[name].value == pytest.approx(parameter.value, rel=1e-6), name

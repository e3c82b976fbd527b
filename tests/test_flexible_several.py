"""Links that bend in linkages of several drives, at rest on their courses: Exudyn's beams, the paper's superposition,
and beam theory by hand.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import linkage_crosscheck as lc
from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import Motion, along
from analytic.kinematics.schedule import Knots, Schedule
from analytic.mechanism import Load, Mechanism
from analytic.mechanism.file import dumps, load
from analytic.paper.frame import ComplianceError
from analytic.paper.superposition import total_displacement
from asked import job_of, request_of
from commands import compare
from compare.crosscheck import crosscheck_job
from compare.faults import ArgumentError
from compare.judge.reference import reference, with_flexible_links
from compare.judge.tolerances import load_tolerances
from marks import slow
from several_linkages import SHIPPED, TIMES, third_bar, waved
from sim_models.engine import Request, SimulationError, Trace, Unsupported, engine
from sim_models.exudyn.beams import flexible
from test_flexible import Softer

PLATFORMS = ("3-rrr", "3-rpr")  # whose beams take longest
ROWS = [*(name for name in SHIPPED if name not in PLATFORMS), *slow(*PLATFORMS)]

pytestmark = pytest.mark.exudyn

STEEL = {"youngs_modulus": 2e11, "shear_modulus": 0.8e11, "section": (0.01, 0.01)}
EA, EI = 2e11 * 1e-4, 2e11 * 1e-8 / 12  # N, N.m^2
BENT = {"five-bar": (), "3-rrr": (), "3-rpr": ("platform",), "2r-arm": ("upper-arm", "forearm")}  # beside their own
PUSHED = {
    "five-bar": ("left-arm", "P"),
    "3-rrr": ("platform", "C3"),
    "3-rpr": ("platform", "C3"),
    "2r-arm": ("forearm", "T"),
}
LOOSE: Mapping[str, Mapping[str, float]] = {
    "five-bar": {"A": 1e-4, "P": 5e-5},
    "3-rrr": {"C1": 1e-4, "B2": 5e-5},
    "3-rpr": {"C1": 1e-4},
    "2r-arm": {"K": 1e-4},
}  # m
SMALL, FULL = 0.5, 50.0  # N
Signals = Mapping[str, np.ndarray]


def steel(name: str) -> Mechanism:
    """A shipped case whose bars, or platform, are of steel."""
    m = load(name)
    for body in BENT[name]:
        m = m.with_body(body, **STEEL)
    return m


def pushed(name: str, size: float) -> Mechanism:
    """The same without weight, under one force (N)."""
    body, point = PUSHED[name]
    force = Load(body=body, point=point, force=(0.6 * size, -0.8 * size))
    return steel(name).replace(gravity=(0.0, 0.0), loads=(force,))


def analysed(m: Mechanism, elastic: bool = True) -> Signals:
    """The superposition, or what clearance makes of rigid links."""
    schedule = Schedule.along(waved(m), TIMES, at_rest=True)
    side = reference(Assembly(m), schedule, "equilibrium", m.clearances)
    return (with_flexible_links(side, Assembly(m), schedule) if elastic else side).signals


def beams(m: Mechanism) -> Signals:
    model = "contact" if m.clearances else "ideal"
    return flexible(request_of(m, model, "static", time=TIMES, courses=waved(m))).signals


def places(m: Mechanism, signals: Signals) -> np.ndarray:
    """Where the bodies are (m), (bodies, N) complex."""
    return np.array([signals[f"{body.name}_x"] + 1j * signals[f"{body.name}_y"] for body in m.bodies])


def angles(m: Mechanism, signals: Signals) -> np.ndarray:
    return np.array([signals[f"{body.name}_angle"] for body in m.bodies])


def positions(m: Mechanism, signals: Signals) -> np.ndarray:
    """Where the revolute joints are (rad), (joints, N)."""
    return np.array([signals[f"position_{j.name}"] for j in m.joints if not j.prismatic])


def efforts(m: Mechanism, signals: Signals) -> np.ndarray:
    kinds = ["force" if m.joint(drive.joint).prismatic else "torque" for drive in m.drives]
    return np.array([signals[f"drive_{kind}_{drive.joint}"] for kind, drive in zip(kinds, m.drives, strict=True)])


# ---------------------------------------------------------------- without clearance


# What is left is of second order: the elastic displacement over the links' length, a fiftieth more of a slender arm
@pytest.mark.parametrize(
    ("name", "within"), [("five-bar", 1e-5), ("2r-arm", 4e-4), *slow(("3-rrr", 3e-5), ("3-rpr", 1e-5))]
)
def test_small_loads_displace_beams_as_the_matrix_says(name: str, within: float) -> None:
    m = pushed(name, SMALL)
    seen, ours, rigid = beams(m), analysed(m), analysed(m, elastic=False)
    for read in (places, angles):
        elastic = read(m, ours) - read(m, rigid)
        assert np.abs(read(m, seen) - read(m, ours)).max() < within * np.abs(elastic).max()
    turned = np.abs(positions(m, ours) - positions(m, rigid)).max()
    assert np.abs(positions(m, seen) - positions(m, ours)).max() <= within * turned + 1e-14
    assert np.abs(efforts(m, seen) - efforts(m, ours)).max() < within * np.abs(efforts(m, ours)).max()


@pytest.mark.slow
@pytest.mark.parametrize("name", SHIPPED)
def test_what_the_matrix_misses_at_full_load_is_of_second_order(name: str) -> None:
    """A hundred times the load, ten thousand times the difference: geometry, not discretisation."""
    full, small = (places(m, beams(m)) - places(m, analysed(m)) for m in (pushed(name, FULL), pushed(name, SMALL)))
    assert np.abs(full - 1e4 * small).max() < 0.03 * np.abs(full).max()


def test_drives_hold_both_joints_of_an_arm_whose_links_are_cantilevers() -> None:
    """By beam theory: the forearm bends on the elbow's section, the upper arm by the force and moment it hands on."""
    m, force = pushed("2r-arm", SMALL), SMALL * (0.6 - 0.8j)
    seen, rigid = beams(m), analysed(m, elastic=False)
    upper, fore = (np.exp(1j * rigid[f"{name}_angle"]) for name in ("upper-arm", "forearm"))
    along, across = (force * upper.conj()).real, (force * upper.conj()).imag
    moment = ((0.25 * fore).conj() * force).imag
    elbow = (0.3 * along / EA + 1j * (0.3**3 * across / 3 + 0.3**2 * moment / 2) / EI) * upper
    turned = (0.3**2 * across / 2 + 0.3 * moment) / EI
    com, rest = 0.19, 0.06  # m, of the forearm from the elbow, and beyond
    along, across = (force * fore.conj()).real, (force * fore.conj()).imag
    bent = com * along / EA + 1j * (com**3 * across / 3 + com**2 * rest * across / 2) / EI
    moved = elbow + (bent + 1j * com * turned) * fore
    ours = seen["forearm_x"] + 1j * seen["forearm_y"] - rigid["forearm_x"] - 1j * rigid["forearm_y"]
    assert np.abs(ours - moved).max() < 4e-4 * np.abs(moved).max()
    lever = seen["upper-arm_x"] * 0.0 + ((0.3 * upper + 0.25 * fore).conj() * force).imag
    assert np.abs(seen["drive_torque_O"] + lever).max() < 4e-4 * np.abs(lever).max()
    assert np.abs(seen["drive_torque_K"] + moment).max() < 4e-4 * np.abs(moment).max()


@pytest.mark.parametrize("name", ROWS)
def test_drives_stay_where_their_courses_have_them(name: str) -> None:
    m = pushed(name, FULL)
    seen = beams(m)
    for joint, at in Schedule.along(waved(m), TIMES).positions().items():
        np.testing.assert_allclose(seen[f"position_{joint}"], at, atol=1e-12)


def test_forces_balance_on_the_bent_linkage() -> None:
    """Whatever bends: the ground's reactions and the drives' torques hold weights and loads where they now are."""
    m = steel("five-bar")
    seen = beams(m)
    total = sum((seen[f"reaction_{j}_x"] + 1j * seen[f"reaction_{j}_y"] for j in "DE"), np.zeros(TIMES.size, complex))
    weight = -9.81j * sum(body.mass for body in m.bodies)
    assert np.abs(total + weight - 20j).max() < 1e-6


def legs(load_size: float, weight: float) -> Mechanism:
    """A 3-RPR whose cylinders and rods bend, one of its rods pushed from the side."""
    m = load("3-rpr").replace(
        gravity=(0.0, -weight),
        loads=(
            Load(body="platform", point="C3", force=(0.6 * load_size, -0.8 * load_size)),
            Load(body="rod1", point="com", force=(0.0, load_size)),
        ),
    )
    for i in "123":
        m = m.with_body(f"cylinder{i}", points={f"A{i}": (0.0, 0.0), f"S{i}": (0.08, 0.0)}, **STEEL)
        m = m.with_body(f"rod{i}", points={f"S{i}": (-0.1, 0.0), f"C{i}": (0.0, 0.0)}, **STEEL)
    return m


@pytest.mark.parametrize(("load_size", "weight", "within"), [(SMALL, 0.1, 3e-5), *slow((FULL, 10.0, 1e-3))])
def test_cylinders_and_rods_bend_where_their_drives_hold_the_slides(
    load_size: float, weight: float, within: float
) -> None:
    m = legs(load_size, weight)
    seen, ours, rigid = beams(m), analysed(m), analysed(m, elastic=False)
    elastic = np.abs(places(m, ours) - places(m, rigid)).max()
    assert np.abs(places(m, seen) - places(m, ours)).max() < within * elastic
    for signal in ("reaction_S1_moment", "reaction_S1_x", "reaction_C2_y"):
        assert np.abs(seen[signal] - ours[signal]).max() < within * np.abs(ours[signal]).max(), signal
    assert np.abs(efforts(m, seen) - efforts(m, ours)).max() < within * np.abs(efforts(m, ours)).max()


@pytest.mark.slow
def test_what_is_neglected_of_bending_slides_is_of_second_order() -> None:
    full, more = (places(m, beams(m)) - places(m, analysed(m)) for m in (legs(FULL, 10.0), legs(4 * FULL, 40.0)))
    assert np.abs(more - 16 * full).max() < 0.03 * np.abs(more).max()


def test_a_drive_beside_its_links_axis_holds_it_too() -> None:
    m = pushed("five-bar", SMALL)
    m = m.with_body("left-crank", points={"D": (0.0, 0.003), "A": (0.1, 0.0), "tail": (-0.03, 0.0)})
    seen, ours, rigid = beams(m), analysed(m), analysed(m, elastic=False)
    elastic = np.abs(places(m, ours) - places(m, rigid)).max()
    assert np.abs(places(m, seen) - places(m, ours)).max() < 2e-5 * elastic
    np.testing.assert_allclose(seen["position_D"], Schedule.along(waved(m), TIMES).positions()["D"], atol=1e-12)


# ---------------------------------------------------------------- springs


def at_one_time(m: Mechanism) -> tuple[Motion, Schedule]:
    """The ideal linkage in one of its poses."""
    schedule = Schedule.along(waved(m), TIMES[3:4], at_rest=True)
    return along(Assembly(m), schedule), schedule


def sprung(kind: str, stiffness: float) -> Mechanism:
    """A five-bar under a small load with a spring that is unloaded in one pose of the rigid linkage."""
    m = pushed("five-bar", SMALL)
    motion, _ = at_one_time(m)
    if kind == "joint":
        rest = float(motion.relative(m.joint("A"))[0])
        return m.with_joint("A", stiffness=stiffness, rest_angle=rest)
    bodies, points = (
        (("ground", "left-arm"), ("D", "P")) if kind == "pin" else (("left-arm", "right-crank"), ("com", "B"))
    )
    near, far = (motion.position(body, point) for body, point in zip(bodies, points, strict=True))
    length = float(abs(far - near)[0])
    return m.replace(springs=[{"bodies": bodies, "points": points, "stiffness": stiffness, "length": length}])


@pytest.mark.parametrize(
    ("kind", "stiffness"), [("joint", 100.0), ("joint", 1e4), ("pin", 1e5), ("pin", 1e7), ("com", 1e6)]
)
def test_a_spring_carries_its_share_as_links_yield(kind: str, stiffness: float) -> None:
    """Of forces too: a spring that is unloaded where the links are rigid takes load as they bend."""
    m = sprung(kind, stiffness)
    _, schedule = at_one_time(m)
    seen = flexible(Request(m, "ideal", schedule)).signals
    side = reference(Assembly(m), schedule, "equilibrium", {})
    ours, rigid = with_flexible_links(side, Assembly(m), schedule).signals, side.signals
    elastic = np.abs(places(m, ours) - places(m, rigid)).max()
    assert np.abs(places(m, seen) - places(m, ours)).max() < 3e-5 * elastic
    names = [name for name in ours if name.startswith(("reaction_", "drive_")) and name in seen]
    assert max(abs(seen[name] - ours[name])[0] for name in names) < 1e-5
    assert max(abs(rigid[name] - ours[name])[0] for name in names) > 5e-3  # N, N.m
    name = "reaction_D_magnitude"
    assert ours[name] == pytest.approx(np.hypot(seen["reaction_D_x"], seen["reaction_D_y"]), abs=1e-5)


@pytest.mark.parametrize("stiffness", [0.0, 1e3, 1e5, 1e7])
def test_a_spring_at_the_tip_of_a_cantilever_shares_its_load(stiffness: float) -> None:
    """By hand: F / (3 EI / L^3 + k), and what the wall carries."""
    m = load("2r-arm").replace(gravity=(0.0, 0.0), loads=(Load(body="forearm", point="T", force=(0.0, -SMALL)),))
    m = m.with_body("forearm", **STEEL).replace(
        assembly={"upper-arm": 0.0, "forearm": 0.0}, ground={"points": {"O": (0.0, 0.0), "up": (0.55, 0.2)}}
    )
    m = m.replace(
        springs=[{"bodies": ("ground", "forearm"), "points": ("up", "T"), "stiffness": stiffness, "length": 0.2}]
    )
    knots = np.linspace(0.0, 1.0, 5)
    schedule = Schedule.along(dict.fromkeys("OK", (knots, 0.0 * knots)), np.array([0.5]), at_rest=True)
    seen = flexible(Request(m, "ideal", schedule)).signals
    side = reference(Assembly(m), schedule, "equilibrium", {})
    ours = with_flexible_links(side, Assembly(m), schedule).signals
    carried = SMALL / (1 + stiffness * 0.25**3 / (3 * EI))
    com = 0.19
    moved = -carried * (com**2 * (3 * 0.25 - com) / 6) / EI
    for found in (seen, ours):
        assert found["forearm_y"][0] == pytest.approx(moved, rel=1e-5)
        assert found["reaction_O_y"][0] == pytest.approx(carried, rel=1e-5)
        assert found["drive_torque_K"][0] == pytest.approx(0.25 * carried, rel=1e-5)


# ---------------------------------------------------------------- with clearance


@pytest.mark.parametrize(
    ("name", "within"), [("2r-arm", 3e-4), *slow(("five-bar", 1e-4), ("3-rrr", 1e-4), ("3-rpr", 1e-5))]
)
def test_clearance_and_small_loads_add_up(name: str, within: float) -> None:
    m = pushed(name, SMALL).with_clearances(LOOSE[name])
    seen, ours = beams(m), analysed(m)
    ideal = places(m, analysed(m.with_clearances({}), elastic=False))
    moved = np.abs(places(m, ours) - ideal).max()
    assert np.abs(places(m, seen) - places(m, ours)).max() < within * moved
    alone = [places(m, analysed(m, elastic=False)), places(m, analysed(m.with_clearances({})))]
    for part in alone:  # neither alone would do
        assert np.abs(places(m, seen) - part).max() > 20 * np.abs(places(m, seen) - places(m, ours)).max()


@pytest.mark.parametrize("name", ROWS)
def test_a_total_displacement_of_several_drives_is_the_same_sum(name: str) -> None:
    m = pushed(name, SMALL).with_clearances(LOOSE[name])
    assembly = Assembly(m)
    inputs = assembly.inputs_at(Schedule.along(waved(m), TIMES).positions())
    total = total_displacement(assembly, inputs, model="equilibrium").signals()
    ours = analysed(m)
    for body in m.bodies:
        for part in ("x", "y", "angle"):
            np.testing.assert_allclose(total[f"{body.name}_{part}"], ours[f"{body.name}_{part}"], atol=1e-12)


# ---------------------------------------------------------------- cross-checks


def checked(m: Mechanism, joint_model: Any, resolve: Any = None, courses: dict[str, Knots] | None = None) -> Any:
    """A cross-check with flexible links."""
    job = job_of(
        m, ("exudyn",), load_tolerances(None), "static",
        time=TIMES, courses=courses or waved(m), joint_model=joint_model, flexible=True,
    )  # fmt: skip
    (run,) = crosscheck_job(job, resolve=resolve).runs
    return run


def outside(run: Any) -> set[str]:
    return {d.signal for d in run.discrepancies if d.verdict != "agrees"}


@pytest.mark.long_rows("five-bar-contact")
@pytest.mark.parametrize("joint_model", ["ideal", "contact"])
@pytest.mark.parametrize("name", ROWS)
def test_beams_and_superposition_agree_under_the_cases_own_loads(name: str, joint_model: str) -> None:
    m = steel(name).with_clearances(LOOSE[name])
    run = checked(m, joint_model)
    assert not outside(run)
    assert {f"{body.name}_{axis}" for body in m.bodies for axis in "xy"} <= {d.signal for d in run.discrepancies}
    np.testing.assert_array_equal(run.time, TIMES)


@pytest.mark.long_rows("five-bar-contact")
@pytest.mark.parametrize("joint_model", ["ideal", "contact"])
@pytest.mark.parametrize("name", ROWS)
def test_friction_of_joints_bends_links_on_both_sides(name: str, joint_model: str) -> None:
    m = steel(name).with_clearances(LOOSE[name])
    for joint in m.joints:
        m = m.with_joint(joint.name, friction_torque=1.0 if joint.prismatic else 0.02)
    run = checked(m, joint_model)
    assert not outside(run)
    assert not run.flags
    smooth = checked(steel(name).with_clearances(LOOSE[name]), joint_model)
    more = efforts(m, run.simulated) - efforts(m, smooth.simulated)
    assert np.abs(more).max() > 0.015  # N.m, N
    assert np.abs(more - efforts(m, run.analytic) + efforts(m, smooth.analytic)).max() < 0.01 * np.abs(more).max()


def slid(clearance: float = 0.0) -> tuple[Mechanism, dict[str, Knots]]:
    """A slider-crank moved by its slide."""
    m = load("slider-crank").replace(
        gravity=(0.0, -9.81),
        drive={"joint": "S", "speed": 0.01},
        assembly={"crank": 1.0, "rod": -0.358, "slider": 0.0},
        loads=(Load(body="crank", point="A", force=(5.0, -30.0)),),
    )
    for body in ("crank", "rod"):
        m = m.with_body(body, **STEEL)
    knots = np.linspace(0.0, 1.0, 5)
    return m.with_clearances({"A": clearance}), {"S": (knots, Assembly(m).positions["S"] + 0.01 * knots)}


@pytest.mark.parametrize("clearance", [0.0, 1e-4])
def test_a_linkage_that_a_slide_moves_bends(clearance: float) -> None:
    m, courses = slid(clearance)
    run = checked(m, "contact" if clearance else "ideal", courses=courses)
    assert not outside(run)
    assert "drive_force_S" in {d.signal for d in run.discrepancies}
    rigid = reference(Assembly(m), Schedule.along(courses, TIMES, at_rest=True), "equilibrium", m.clearances).signals
    assert np.abs(np.array(run.simulated["crank_y"]) - rigid["crank_y"]).max() > 5e-8  # m


@pytest.mark.long_rows("rigid0")
@pytest.mark.parametrize("rigid", [(), ("bar",), ("bar", "coupler")])
def test_a_linkage_that_is_held_more_often_than_it_needs_bends(rigid: tuple[str, ...]) -> None:
    m, knots = third_bar(), np.linspace(0.0, 1.0, 5)
    for body in rigid:
        m = m.with_body(body, youngs_modulus=None)
    run = checked(m, "ideal", courses={"D": (knots, 0.5 + knots)})
    assert not outside(run)
    assert {"coupler_y", "drive_torque"} <= {d.signal for d in run.discrepancies}


@pytest.mark.parametrize("name", ["five-bar", "2r-arm", *slow("3-rrr")])
def test_links_a_tenth_softer_on_one_side_are_noticed(name: str) -> None:
    found = outside(checked(steel(name), "ideal", Softer))
    assert {signal for signal in found if signal.endswith(("_x", "_y")) and not signal.startswith("reaction")}


class Weaker(Softer):
    """An engine that tells of torques and forces of drives a tenth less than there is."""

    def simulate(self, request: Request) -> Trace:
        trace = self.beams.simulate(request)
        less = {name: (0.9 if name.startswith("drive_") else 1.0) * v for name, v in trace.signals.items()}
        return replace(trace, signals=less)


@pytest.mark.parametrize("name", ROWS)
def test_drives_a_tenth_weaker_on_one_side_are_noticed(name: str) -> None:
    """Of a hanging link's torque, which is small, too."""
    m = steel(name)
    kinds = {drive.joint: "force" if m.joint(drive.joint).prismatic else "torque" for drive in m.drives}
    assert outside(checked(m, "ideal", Weaker)) == {f"drive_{kind}_{joint}" for joint, kind in kinds.items()}


def test_the_command_and_the_analysis_take_times(tmp_path: Path) -> None:
    times = ["--motion", "static", "--times", "0:0.8:0.2"]
    arguments = ["--flexible", "--simulator", "exudyn", "--clearance", "P=1e-4,A=5e-5", *times, "--out", "out"]
    done = compare("--case", "five-bar", *arguments, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "2 runs" in done.stdout
    done = compare("analyse", "--case", "five-bar", "--compliance", *times, "--out", "yields", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "yields" / "analysis.json").read_text(encoding="utf-8"))
    ours = lc.analyse("five-bar", motion="static", times=np.linspace(0, 0.8, 5), compliance=True)
    rigid = lc.analyse("five-bar", motion="static", times=np.linspace(0, 0.8, 5))
    assert found["compliance"] is ours.compliance is True
    np.testing.assert_allclose(found["signals"]["left-arm_y"], ours.signals["left-arm_y"], rtol=1e-12)
    assert 1e-5 < np.abs(ours.signals["left-arm_y"] - rigid.signals["left-arm_y"]).max() < 1e-4  # m


def test_a_crank_over_time_bends_as_it_does_over_its_angle() -> None:
    m = load("paper")
    time = np.linspace(0.1, 0.5, 5)
    courses = {"D": (np.linspace(0, 1, 5), 0.4 + np.linspace(0, 1, 5))}
    over = flexible(request_of(m, "contact", "static", time=time, courses=courses)).signals
    at = flexible(request_of(m, "contact", "static", 0.4 + time)).signals
    for name, values in at.items():
        np.testing.assert_allclose(over[name], values, atol=1e-7 * max(1.0, np.abs(values).max()), err_msg=name)


def test_a_crank_that_is_its_joints_first_body_is_held_by_the_same_torque() -> None:
    m, knots = load("paper"), np.linspace(0.0, 1.0, 5)
    turned = m.with_joint("D", bodies=tuple(reversed(m.joint("D").bodies)))
    one, other = (
        flexible(request_of(each, "ideal", "static", time=TIMES, courses={"D": (knots, sign * (0.5 + knots))})).signals
        for each, sign in ((m, 1.0), (turned, -1.0))
    )
    for name in ("drive_torque", "coupler_y", "reaction_B_x"):  # joints' springs are of 2e11 N/m
        np.testing.assert_allclose(other[name], one[name], rtol=5e-6)
    np.testing.assert_allclose(other["position_D"], -one["position_D"], atol=1e-12)
    np.testing.assert_allclose(other["reaction_D_x"], -one["reaction_D_x"], rtol=5e-6)


def test_near_a_singular_posture_it_is_said_that_superposition_leaves_much_out() -> None:
    words = "which is much near a singular posture"
    near = lc.analyse("3-rrr", motion="static", times=[0.2, 1.0], compliance=True)
    assert any(words in text and text.endswith("11.6") for text in near.warnings)
    clear = lc.analyse("3-rrr", motion="static", times=[0.2, 0.8], compliance=True)
    assert not any(words in text for text in clear.warnings)


# ---------------------------------------------------------------- what is refused


def test_what_does_not_bend_over_time_is_refused_in_words() -> None:
    with pytest.raises(ArgumentError, match="flexible links are compared at rest, not in driven motion"):
        lc.crosscheck("five-bar", "exudyn", flexible=True)
    with pytest.raises(ArgumentError, match="elastic displacement is found at rest; ask for static motion"):
        lc.analyse("five-bar", compliance=True)
    with pytest.raises(ArgumentError, match="no body of 3-rpr has a youngs_modulus"):
        lc.crosscheck("3-rpr", "exudyn", flexible=True, motion="static")
    m = load("five-bar")
    with pytest.raises(Unsupported, match=r"motions of several freedoms.* among links that bend"):
        engine("exudyn").simulate_flexible(request_of(m, "ideal", "driven", time=TIMES, courses=waved(m)))
    yields = load("3-rpr").with_joint("S1", elasticity={"translation": 1e8, "rotation": 1e5})
    with pytest.raises(Unsupported, match="leave out elasticity of joint 'S1'"):
        engine("exudyn").simulate_flexible(request_of(yields, "ideal", "static", time=TIMES, courses=waved(yields)))
    paper = load("paper").replace(springs=[{"bodies": ("crank", "follower"), "points": ("A", "E"), "stiffness": 1.0}])
    with pytest.raises(Unsupported, match="springs between points among links that bend"):
        engine("exudyn").simulate_flexible(request_of(paper, "ideal", "driven", np.array([0.5])))


def test_a_free_drive_is_refused(tmp_path: Path) -> None:
    m = load("five-bar")
    loose = m.replace(drive=(m.drives[0], m.drives[1].model_copy(update={"speed": "free"})))
    (tmp_path / "loose.toml").write_text(dumps(loose), encoding="utf-8")
    done = compare("--case", "loose.toml", "--flexible", "--motion", "static", "--simulator", "exudyn", cwd=tmp_path)
    assert done.returncode == 2
    assert "no drive of five-bar holds joint" in done.stderr


def test_links_that_cannot_bear_their_load_are_named_with_a_pose() -> None:
    m = load("five-bar")
    for body in m.bodies:
        m = m.with_body(body.name, youngs_modulus=1e4, shear_modulus=None)
    with pytest.raises(ComplianceError, match=r"means nothing at D = 120 deg; .* \(2 such poses\)"):
        lc.analyse(m, motion="static", times=[0.0, 0.1], compliance=True)
    with pytest.raises(SimulationError, match=r"no static equilibrium in the assembly mode found at 0\.03 s"):
        beams(m)

"""What contact did to blocks in their guides: counted in motions that are known beforehand, held to closed forms and to
an equation of motion in every engine.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from analytic.mechanism import Load, Mechanism
from analytic.mechanism.file import load, loads
from asked import request_of
from compare.crosscheck import crosscheck
from compare.judge.contact import contact, contact_in, ideal_peaks
from compare.judge.contact_motion import WatchedRun
from compare.report.contact_figures import contact_figures
from compare.report.words.contact import describe
from compare.results.contact import Contact
from marks import slow
from sim_models.common.contact_laws import hysteresis
from sim_models.common.guide import Guide
from sim_models.engine import Trace, Watched, declared, engine
from tests.evidence.published.flying_block import TOML

MODELS = {"mujoco": "contact", "exudyn": "contact", "dart": "spring-damper", "pybullet": "spring-damper"}
EVERY = pytest.mark.parametrize("name", ["mujoco", *slow("exudyn", "dart", "pybullet")])
STIFFNESS = 1e6  # N/m
LAWS = {
    "elastic": {"contact_law": "kelvin-voigt", "contact_damping": 0.0, "restitution": None},
    "damped": {"contact_law": "kelvin-voigt", "contact_damping": 20.0, "restitution": None},
    "flores": {"contact_law": "flores", "restitution": 0.7},
}
TORQUE = 0.3  # N.m
# J, of what the motor turns over, and of what contact takes; DART and PyBullet reckon inertia forces half a step late
MISSING = {
    "mujoco": (4e-7, 1e-4),
    "exudyn": (2e-8, 5e-6),
    "pybullet": (6e-6, 2e-3),
    "dart": (3e-5, 1e-2),
}


def driven(law: str, speed: float = 150.0, stiffness: float = STIFFNESS) -> Mechanism:
    """The slider-crank of Flores, Leine and Glocker (2010), its crank driven."""
    m = loads(TOML.replace('speed = "free"', f"speed = {speed}"))
    return m.with_joint("S", contact_stiffness=stiffness, **LAWS[law])


def watched(name: str, m: Mechanism, angle: float, step: float | None = None) -> Trace:
    """A driven run from the middle of the guide at 0 to an angle (rad), seen from 0.01 rad on."""
    pytest.importorskip(declared(name).package)
    theta = np.array([0.01, angle])
    asked = request_of(m, MODELS[name], "driven", theta, start="centred", lead_in=0.01, watched=True, step=step)
    return engine(name).simulate(asked)


def counted(trace: Trace, m: Mechanism) -> Contact:
    found = contact_in(trace, m, ideal_peaks(m))
    assert found is not None
    return found


# ------------------------------------------------------------------ statics of a block


def test_corners_share_the_force_and_moment_of_their_walls() -> None:
    rng = np.random.default_rng(3)
    guide = Guide(0.1, 0.05, 1e-3)
    height, tilt = rng.uniform(-1.2e-3, 1.2e-3, 4000), rng.uniform(-0.025, 0.025, 4000)
    depths = guide.depths(height, tilt)
    pushed = np.where(depths > 0, rng.uniform(1.0, 50.0, depths.shape), 0.0)
    assert {0, 1, 2} == set(np.count_nonzero(pushed, axis=0).tolist())  # never three
    along = np.array([z.real * np.cos(tilt) - z.imag * np.sin(tilt) for z in guide.corners])
    up = np.array([[1.0], [1.0], [-1.0], [-1.0]]) * pushed
    across, moment = up.sum(axis=0), (along * up).sum(axis=0)
    np.testing.assert_allclose(guide.across(pushed), across, atol=1e-12)
    np.testing.assert_allclose(guide.shares(across, moment, height, tilt), pushed, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(("across", "moment"), [(30.0, 0.4), (-30.0, 1.0), (5.0, -2.0), (0.0, 2.0)])
def test_the_hardest_pressed_corner_is_that_of_the_block_s_rest(across: float, moment: float) -> None:
    guide = Guide(0.1, 0.05, 1e-6)
    first, second = guide.corners_at(guide.push(across, moment))
    sides = [(-np.sign(guide.corners[k].imag), guide.corners[k].real) for k in (first, second)]
    rows = np.array([[side for side, _ in sides], [side * along for side, along in sides]])
    pushes = np.linalg.solve(rows, [across, moment])
    assert np.all(pushes >= 0)
    assert guide.hardest(np.array([across]), np.array([moment]))[0] == pytest.approx(pushes.max())


# ------------------------------------------------------------------ motions that are known


def prescribed(turns: float, height, arm, slide, samples: int = 40_001) -> tuple[Mechanism, Watched]:
    """A slider that is carried: height (m) across, tilt times half length ``arm`` (m) and way along its guide (m) over
    the phase (rad) of a crank that turns evenly; walls are springs.
    """
    m = load("slider-crank").with_clearances({"S": 1e-5}).with_joint("S", contact_stiffness=STIFFNESS)
    speed, guide = m.speed, Guide.of(m.joint("S"))
    assert speed is not None
    assert guide is not None
    time = np.linspace(0.0, turns * 2 * np.pi / speed, samples)
    phase, still = speed * time, np.zeros(samples)
    across, tilt, at = height(phase), arm(phase) * 2 / guide.length, slide(phase)
    corners = STIFFNESS * np.maximum(guide.depths(across, tilt), 0.0)
    place, angle = at + 1j * across, {"crank": phase, "rod": still, "slider": tilt}
    return m, Watched(
        time,
        {"crank": still + 0j, "rod": still + 0j, "slider": place},
        {"crank": still + 0j, "rod": still + 0j, "slider": np.gradient(place, time)},
        angle,
        {name: np.gradient(values, time) for name, values in angle.items()},
        {"S": 1j * guide.across(corners)},
        still,
        {"S": corners},
    )


def test_a_block_that_rocks_from_diagonal_to_diagonal_is_counted_as_it_does() -> None:
    """Two corners strike five times in a turn of the crank."""

    def arm(phase: np.ndarray) -> np.ndarray:
        return 1.1e-5 * np.sin(2.5 * phase)

    m, seen = prescribed(12.0, np.zeros_like, arm, np.zeros_like, 60_001)
    found = contact(m, seen, {"S": 0.5})
    joint = found.joints["S"]
    value = {name: one.value for name, one in joint.statistics.items()}
    assert value["free_share"] == pytest.approx(np.arcsin(0.999 / 1.1) / (np.pi / 2), abs=1e-3)
    assert value["impacts"] == pytest.approx(10.0, abs=0.4)  # the block begins in the middle
    assert value["peak_force"] == pytest.approx(STIFFNESS * 1e-6, rel=2e-3)
    assert joint.peak_ratio == pytest.approx(2.0, rel=2e-3)
    assert value["penetration"] == pytest.approx(1e-6, rel=2e-3)
    speed = 1.1e-5 * 2.5 * (m.speed or 0.0) * np.cos(np.arcsin(1 / 1.1))
    assert value["approach_speed"] == pytest.approx(speed, rel=2e-3)
    assert abs(value["restitution_loss"] or 0.0) < 1e-3 * STIFFNESS * 1e-12
    assert value["friction_loss"] == 0.0
    assert np.abs(joint.orbit.x).max() < 1e-14
    assert np.abs(joint.orbit.y).max() == pytest.approx(1.1e-5, rel=1e-3)
    assert found.period == 2


def test_a_pressed_block_that_slides_is_never_free_and_wears_by_its_way() -> None:
    stroke, depth = 0.02, 2e-6

    m, seen = prescribed(
        3.0, lambda phase: 0 * phase - 1e-5 - depth, np.zeros_like, lambda phase: stroke * np.sin(phase)
    )
    found = contact(m, seen, {"S": 1.0})
    value = {name: one.value for name, one in found.joints["S"].statistics.items()}
    push = STIFFNESS * depth  # of either lower corner
    assert (value["free_share"], value["impacts"]) == (0.0, 0.0)
    assert value["rms_force"] == pytest.approx(push, rel=1e-9)
    assert value["wear"] == pytest.approx(2 * push * 4 * stroke, rel=1e-4)
    np.testing.assert_allclose(found.joints["S"].section.x, -1e-5 - depth)
    assert "no block leaves its wall" in found.words


# ------------------------------------------------------------------ closed forms in engines


@EVERY
def test_a_block_that_falls_flat_strikes_with_both_corners_as_its_law_has_it(name: str) -> None:
    """It falls with its rod about a crank that hardly turns; half of speed, impulse and loss are each corner's."""
    mass, weight = 0.076 + (5.9e-4 + 0.038 * 0.153**2) / 0.306**2, (0.076 + 0.038 / 2) * 9.81
    speed, e = np.sqrt(2 * weight * 1e-3 / mass), 0.68318  # what Flores's law delivers for 0.7
    m = driven("flores", speed=1.0, stiffness=1e8)
    impacts = counted(watched(name, m, 0.018, step=1e-6), m).joints["S"].impacts
    first = slice(0, 2)
    np.testing.assert_allclose(impacts.crank_angle[first], 2e-3 / speed, rtol=2e-3)  # 1 rad/s
    np.testing.assert_allclose(impacts.approach_speed[first], speed, rtol=3e-3)
    np.testing.assert_allclose(impacts.impulse[first], (1 + e) * mass * speed / 2, rtol=1e-2)  # weight adds 3e-3
    np.testing.assert_allclose(impacts.energy[first], (1 - e**2) * mass * speed**2 / 4, rtol=3e-2)


@pytest.mark.mujoco
@pytest.mark.parametrize(("force", "torque"), slow(((0.0, -40.0), 0.5), ((-60.0, 10.0), 6.0)))
def test_a_pressed_block_s_largest_corner_force_is_the_ideal_linkage_s(
    force: tuple[float, float], torque: float
) -> None:
    """Both corners of one side, or two at opposite ends."""
    m = load("slider-crank").replace(gravity=(0.0, -9.81), loads=(Load(body="slider", force=force, torque=torque),))
    slider = m.body("slider").model_copy(update={"inertia": 2e-4})
    m = m.replace(bodies=(*m.bodies[:2], slider), drive=m.drives[0].model_copy(update={"speed": 60.0}))
    m = m.with_clearances({"S": 1e-5}).with_joint(
        "S", contact_law="kelvin-voigt", contact_stiffness=1e7, restitution=0.5
    )
    found = crosscheck(m, "mujoco", joint_model="contact", revolutions=1, angles=np.radians([0.0, 90.0, 180.0, 270.0]))
    (run,) = found.runs
    assert run.contact is not None
    assert run.contact.joints["S"].peak_ratio == pytest.approx(1.0, abs=1e-3)


# ------------------------------------------------------------------ an equation of motion


def twisted(law: str, friction: float = 0.0) -> Mechanism:
    """That slider-crank with a torque on its block, so that single corners touch."""
    m = driven(law).with_joint("S", friction=friction)
    slider = m.body("slider").model_copy(update={"inertia": 6e-5})
    return m.replace(bodies=(*m.bodies[:2], slider), loads=(Load(body="slider", torque=TORQUE),))


@cache
def reference(law: str, friction: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[tuple[float, float]]]:
    """Time (M,) s, rod and block (M, 2) rad, corners' forces (4, M) N, and touches (s, m/s), by Runge and Kutta's steps
    of 0.1 us, of a crank that is too heavy to be slowed; friction fades where corners slide more slowly than 1 mm/s.
    """
    nonsmooth = pytest.importorskip("tests.evidence.nonsmooth")
    masses, inertias = (0.038, 0.038, 0.076), (1e6, 5.9e-4, 6e-5)
    numbers = nonsmooth.Guide(0.153, 0.306, masses, inertias, 0.05, 0.025, 1e-3, 9.81, TORQUE)
    chi, step, every = 0.0 if law == "elastic" else hysteresis("flores", 0.7), 1e-7, 5
    begin, end = np.zeros(3), np.array([150.0, -75.0, 0.0])
    states, gaps = nonsmooth.compliant(numbers, 4, begin, end, step, 80_000, every, STIFFNESS, chi, friction, 1e-3)
    time = step * every * np.arange(gaps.shape[0])
    gaps = gaps[:, [3, 2, 1, 0]].T  # in the order of Guide.corners
    rates, touches = -np.gradient(gaps, time, axis=1), []
    forces = np.zeros_like(gaps)
    for force, gap, rate in zip(forces, gaps, rates, strict=True):
        begins = np.flatnonzero((gap[:-1] >= 0) & (gap[1:] < 0)) + 1
        for k, last in pairwise([*begins.tolist(), gap.size]):
            touches.append((float(time[k]), float(rate[k])))
            depth = np.maximum(-gap[k:last], 0.0)
            force[k:last] = np.maximum(STIFFNESS * depth * (1 + chi * rate[k:last] / rate[k]), 0.0)
    return time, states[:, 1:3], forces, sorted(touches)


FRICTION = [name for name, model in MODELS.items() if model == "contact"]  # whose corners can have some
TOUCHING = [(name, "elastic", 0.0) for name in MODELS]
TOUCHING += [(name, "flores", 0.2 if name in FRICTION else 0.0) for name in MODELS]


@pytest.mark.parametrize(("name", "law", "friction"), slow(*TOUCHING))
def test_corners_touch_and_are_pushed_as_an_equation_of_motion_has_it(name: str, law: str, friction: float) -> None:
    """With friction as without, MuJoCo's angles are within 8e-7 rad of it, and Exudyn's within 6e-6."""
    m, (time, turned, forces, touches) = twisted(law, friction), reference(law, friction)
    trace = watched(name, m, 150.0 * 7.5e-3, step=5e-7)
    seen = trace.watched
    assert seen is not None
    now = seen.angle["crank"] / 150.0
    for k, body in enumerate(("rod", "slider")):
        np.testing.assert_allclose(seen.angle[body], np.interp(now, time, turned[:, k]), atol=2e-5)
    largest = forces.max()
    right = np.array([np.interp(now, time, force) for force in forces])
    off = np.abs(seen.corners["S"] - right)
    assert np.sqrt(np.mean(off**2)) < 4e-3 * largest
    impacts = counted(trace, m).joints["S"].impacts
    if friction:
        np.testing.assert_allclose(np.abs(seen.rubbing["S"]), friction * seen.corners["S"], atol=1e-9 * largest)
    early = [touch for touch in touches if touch[0] < 7e-3]
    assert len(early) >= 4
    np.testing.assert_allclose(impacts.crank_angle[: len(early)] / 150.0, [at for at, _ in early], atol=2e-6)
    np.testing.assert_allclose(
        impacts.approach_speed[: len(early)], [speed for _, speed in early], rtol=1e-2, atol=1e-3
    )


BALANCED = [(name, law, mu) for name in MODELS for law in LAWS for mu in (0.0, 0.2) if not mu or name in FRICTION]
BRIEF = [("mujoco", "elastic", 0.2)]


@pytest.mark.parametrize(("name", "law", "friction"), [*BRIEF, *slow(*(row for row in BALANCED if row not in BRIEF))])
def test_energy_is_balanced_through_a_block_s_impacts(name: str, law: str, friction: float) -> None:
    """Of a block with its centre of mass off its pin; what bounces elastically takes nothing, and friction its
    coefficient of the wear.
    """
    m = driven(law).with_joint("S", friction=friction)
    slider = m.body("slider").model_copy(update={"com": (0.01, 0.005), "inertia": 6e-5})
    m = m.replace(bodies=(*m.bodies[:2], slider))
    found = counted(watched(name, m, 2.2, step=1e-6), m)
    energy, joint = found.energy, found.joints["S"]
    assert energy is not None
    assert energy.share is not None
    assert joint.impacts.crank_angle.size > 8
    assert energy.share < MISSING[name][0]
    lost, rubbed, wear = (joint.statistics[each].value or 0.0 for each in ("restitution_loss", "friction_loss", "wear"))
    assert rubbed == pytest.approx(friction * wear, rel=1e-4)
    if law == "elastic":
        brought = np.sum(joint.impacts.impulse * joint.impacts.approach_speed) / 4
        assert abs(lost) < 1e-4 * brought
    else:
        assert lost > 0.1
        assert abs(energy.missing or 0.0) < MISSING[name][1] * lost


# ------------------------------------------------------------------ what is told of it


@pytest.mark.mujoco
def test_units_of_an_engine_s_own_leave_a_corner_s_force_what_it_is() -> None:
    """The linkage a hundred times as small: reports and every step are of one size."""
    m = driven("flores", speed=1500.0, stiffness=1e9)
    bodies = []
    for body in m.bodies:
        points = {name: tuple(0.01 * x for x in at) for name, at in body.points.items()}
        inertia = 1e-4 * body.moment_of_inertia
        bodies.append(body.model_copy(update={"points": points, "inertia": inertia}))
    m = m.replace(bodies=tuple(bodies)).with_joint("S", guide=(1e-3, 5e-4), clearance=1e-5)
    theta = np.radians(np.arange(1.0, 90.0, 0.5))
    trace = engine("mujoco").simulate(
        request_of(m, "contact", "driven", theta, start="centred", lead_in=0.01, watched=True)
    )
    seen, guide = trace.watched, Guide.of(m.joint("S"))
    assert trace.settings["units"] != "length 1, mass 1, time 1"
    assert seen is not None
    assert guide is not None
    np.testing.assert_allclose(1j * guide.across(seen.corners["S"]), seen.force["S"], rtol=1e-9, atol=1e-12)
    reports = np.searchsorted(seen.time, trace.time - 1e-12)
    size = np.abs(seen.force["S"]).max()
    np.testing.assert_allclose(seen.force["S"][reports].imag, trace.signals["reaction_S_y"], atol=1e-3 * size)


@pytest.mark.slow
@pytest.mark.mujoco
def test_a_report_of_a_block_that_bounces_speaks_of_a_block() -> None:
    m = twisted("flores")
    angles = np.radians(np.arange(0.0, 360.0, 30.0))
    found = crosscheck(m, "mujoco", joint_model="contact", revolutions=1, angles=angles)
    (run,) = found.runs
    assert run.contact is not None
    assert run.contact.struck
    (table,) = describe(found).tables
    assert not [measure.meaning for measure, _ in table.rows if "pin" in measure.meaning]
    shown = {figure.name: figure for figure in contact_figures(found)}
    assert list(shown) == ["orbit_S", "contact_force_S", "regimes_S", "section_S"]
    assert not [figure.title for figure in shown.values() if "pin" in f"{figure.title} {figure.summary} {figure.note}"]
    wall = shown["orbit_S"].series[0]
    assert [abs(x) + abs(y) for x, y in zip(wall.x, wall.y, strict=True)] == pytest.approx([1.0] * 5)  # mm
    assert any(series.role == "analytic" for series in shown["contact_force_S"].series)


@pytest.mark.mujoco
def test_where_height_and_tilt_make_up_the_clearance_a_corner_is_at_its_wall() -> None:
    m = twisted("elastic")
    seen = watched("mujoco", m, 1.0, step=1e-6).watched
    assert seen is not None
    course = WatchedRun(m, seen).course(m.joint("S"))
    inside = np.abs(course.gap.real) + np.abs(course.gap.imag)
    np.testing.assert_allclose(course.reach, inside, atol=1e-2 * course.clearance)
    drift = np.gradient(course.gap, seen.time)
    np.testing.assert_allclose(course.drift, drift, atol=2e-3 * np.abs(drift).max())
    alone = replace(seen, corners={"S": np.zeros_like(seen.corners["S"])})
    assert WatchedRun(m, alone).course(m.joint("S")).size.max() == 0.0

"""Linkages of beams against matrix structural analysis, beam theory, and the superposition of clearance and
compliance.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import kinematics
from analytic.mechanism import MASS_CENTRE, Drive, Load, Mechanism
from analytic.mechanism.file import load
from analytic.paper.clearance import Model, displaced
from analytic.paper.compliance import compliance
from analytic.paper.kinetostatics import joint_law, kinetostatics
from asked import request_of
from linkages import inverted_slider
from sim_models.engine import Motion, SimulationError, Unsupported, engine
from sim_models.exudyn.beam_motion import RigidMotion
from sim_models.exudyn.beams import flexible
from sim_models.run.path import CrankPath
from tests.evidence.validation.beam_equilibrium import FlexibleLinkage, flexible_static

pytestmark = pytest.mark.exudyn

POINTS = (("crank", "A"), ("coupler", "A"), ("coupler", "com"), ("coupler", "B"), ("follower", "B"))


def with_force(size: float) -> Mechanism:
    return load("paper").replace(loads=(Load(body="coupler", force=(0.0, size)),))


def displacements(found: FlexibleLinkage) -> np.ndarray:
    return np.array([found.displacement[point] for point in POINTS])


def structural(mechanism: Mechanism, degrees: float) -> np.ndarray:
    """Displacements (m) of the points by matrix structural analysis."""
    found = compliance(kinematics(Assembly(mechanism), np.radians([degrees])))
    return np.array([found.displacement(*point)[0] for point in POINTS])


def of_clearance(mechanism: Mechanism, degrees: float, model: Model) -> np.ndarray:
    """Displacements (m) of the points by clearance alone, links rigid."""
    found = displaced(Assembly(mechanism), np.radians([degrees]), model=model, inertia=False)
    moved, ideal = found.configuration.motion, found.ideal.motion
    return np.array([(moved.position(*point) - ideal.position(*point))[0] for point in POINTS])


def apart(a: np.ndarray, b: np.ndarray) -> float:
    """Largest difference, relative to the largest displacement."""
    return float(np.abs(a - b).max() / np.abs(b).max())


@pytest.mark.parametrize("degrees", [20.0, 30.0, 60.0, 90.0, 130.0, 160.0])
def test_small_loads_displace_beams_as_the_matrix_says(degrees: float) -> None:
    m = with_force(0.5)
    assert apart(displacements(flexible_static(m, np.radians(degrees))), structural(m, degrees)) < 1e-4


def test_paper_case_at_30_degrees_is_the_independently_computed_one() -> None:
    """Computed outside this project: A, the coupler's middle and B, in mm, crank locked; linear, so at a hundredth of
    the load.
    """
    found = flexible_static(with_force(0.5), np.radians(30.0)).displacement
    for point, expected in (
        (("crank", "A"), -0.346627 + 0.599875j),
        (("coupler", "com"), -0.347060 + 1.001376j),
        (("coupler", "B"), -0.347493 + 0.602877j),
    ):
        assert abs(found[point] * 1e5 - expected) < 1e-4 * abs(expected), point


@pytest.mark.parametrize("degrees", [30.0, 60.0, 90.0, 130.0])
def test_what_the_matrix_misses_at_full_load_is_of_second_order(degrees: float) -> None:
    """A hundred times the load, ten thousand times the difference: geometry, not discretisation."""
    full, small = (
        displacements(flexible_static(m, np.radians(degrees))) - structural(m, degrees)
        for m in (with_force(50.0), with_force(0.5))
    )
    assert np.abs(full - 1e4 * small).max() < 0.03 * np.abs(full).max()


@pytest.mark.parametrize(
    ("degrees", "tolerance"),
    [(30.0, 2e-3), (45.0, 2.5e-3), (60.0, 2.5e-3), (75.0, 2e-3), (90.0, 2.5e-3), (20.0, 5e-3), (160.0, 5e-3)],
)
def test_matrix_is_good_to_a_quarter_percent_at_full_load(degrees: float, tolerance: float) -> None:
    m = load("paper")
    assert apart(displacements(flexible_static(m, np.radians(degrees))), structural(m, degrees)) < tolerance


@pytest.mark.parametrize(
    ("size", "degrees", "percent"),
    [(50.0, (30, 50, 70, 90), 0.2), (50.0, (20, 120, 160), 0.5), (0.5, (20, 30, 60, 90, 160), 0.01)],
)
def test_the_coupler_bends_where_the_load_is_as_the_matrix_says(
    size: float, degrees: tuple[int, ...], percent: float
) -> None:
    middle = POINTS.index(("coupler", "com"))
    for angle in degrees:
        beams = displacements(flexible_static(with_force(size), np.radians(angle)))[middle]
        matrix = structural(with_force(size), angle)[middle]
        assert 100 * abs(beams - matrix) / abs(matrix) < percent


def test_a_single_clamped_link_is_a_cantilever() -> None:
    m = load("pendulum").with_body("pendulum", youngs_modulus=2e11, shear_modulus=0.8e11)
    force, length, inertia = 2.0, 0.3, 0.01**4 / 12
    m = m.replace(gravity=(0.0, 0.0), loads=(Load(body="pendulum", point="tip", force=(0.0, force)),))
    found = flexible_static(m, 0.0)
    bending = force * length**3 / (3 * 2e11 * inertia)
    assert found.displacement["pendulum", "tip"].imag == pytest.approx(bending, rel=1e-6)
    assert found.force["O"] == pytest.approx(-1j * force, abs=1e-6)


def test_a_torque_bends_a_clamped_link_into_a_circle() -> None:
    m = load("pendulum").with_body("pendulum", youngs_modulus=2e11, shear_modulus=0.8e11)
    torque, length, stiffness = 5.0, 0.3, 2e11 * 0.01**4 / 12
    m = m.replace(gravity=(0.0, 0.0), loads=(Load(body="pendulum", point="tip", torque=torque),))
    turn = torque * length / stiffness
    tip = length / turn * (np.sin(turn) + 1j * (1 - np.cos(turn))) - length
    assert flexible_static(m, 0.0).displacement["pendulum", "tip"] == pytest.approx(tip, abs=1e-5 * abs(tip))


def test_reactions_and_drive_joint_without_joint_springs() -> None:
    """Rigid joints instead of Eq. 4's springs of 2e11 N/m change nothing visible; reactions balance the load."""
    m = load("paper")
    rigid = m.replace(joints=tuple(j.model_copy(update={"elasticity": None}) for j in m.joints))
    sprung, stiff = (flexible_static(x, np.radians(60.0)) for x in (m, rigid))
    np.testing.assert_allclose(displacements(stiff), displacements(sprung), rtol=1e-5)
    for found in (sprung, stiff):
        assert found.force["A"] - found.force["B"] == pytest.approx(-50j, abs=1e-3)
        assert found.force["B"] == pytest.approx(14.43 + 25j, abs=0.1)


# The superposition of Fig. 7c against clearance and compliance at once: bounds on its error, of the largest
# displacement
@pytest.mark.parametrize("degrees", [30.0, 60.0, 120.0])
@pytest.mark.parametrize(
    ("clearance", "with_equilibrium", "with_first_order"),
    [(1e-4, 5e-3, 5e-3), (1e-3, 1e-2, 1.5e-2), (1e-2, 1e-2, 6e-2)],
)
def test_superposition_of_clearance_and_compliance(
    clearance: float, with_equilibrium: float, with_first_order: float, degrees: float
) -> None:
    m = load("paper").with_clearances({"B": clearance})
    both = flexible_static(m, np.radians(degrees), "contact")
    assert abs(both.gap["B"]) == pytest.approx(clearance, abs=2e-8)
    elastic = structural(m, degrees)
    superposed = apart(elastic + of_clearance(m, degrees, "equilibrium"), displacements(both))
    assert superposed < with_equilibrium
    assert apart(elastic + of_clearance(m, degrees, "first_order"), displacements(both)) < with_first_order
    assert apart(elastic, displacements(both)) > 4 * superposed  # neither alone would do
    assert apart(of_clearance(m, degrees, "equilibrium"), displacements(both)) > 4 * superposed


def test_rigid_links_in_between_stay_rigid() -> None:
    m = load("paper").with_body("coupler", youngs_modulus=None, shear_modulus=None)
    found = flexible_static(m, np.radians(30.0)).displacement
    assert abs((found["coupler", "A"] + found["coupler", "B"]) / 2 - found["coupler", "com"]) < 1e-9
    np.testing.assert_allclose(
        displacements(flexible_static(m, np.radians(30.0))),
        structural(m, 30.0),
        atol=3e-3 * np.abs(structural(m, 30.0)).max(),
    )


# ---------------------------------------------------------------- a request answered with flexible links


def flexible_links(m: Mechanism, modulus: float, section: tuple[float, float], *rigid: str) -> Mechanism:
    """The mechanism with links of that modulus (Pa) and section (m), all but those named."""
    for body in m.bodies:
        if body.name not in rigid:
            m = m.with_body(body.name, youngs_modulus=modulus, shear_modulus=None, section=section)
    return m


def busy_crank_rocker() -> Mechanism:
    m = load("crank-rocker").replace(gravity=(0.0, -9.81), loads=(Load(body="follower", force=(10.0, -30.0)),))
    m = m.with_joint("B", friction_torque=0.05, damping=0.001).with_joint("E", stiffness=0.5, rest_angle=0.3)
    m = m.replace(joints=tuple(j.model_copy(update={"elasticity": None}) for j in m.joints))
    return m.with_body("coupler", com=(0.07, 0.012), marker=(0.055, -0.004)).with_body("follower", com=(0.05, 0.01))


def pushed_slider_crank() -> Mechanism:
    m = load("slider-crank").replace(
        drive=Drive(joint="O", speed=100.0), gravity=(0.0, -9.81), loads=(Load(body="slider", force=(-50.0, 0.0)),)
    )
    return m.with_joint("S", friction_torque=3.0, damping=2.0)


def pinned_beside() -> Mechanism:
    """The crank turns about a point beside the line through its other two."""
    m = load("crank-rocker").replace(gravity=(0.0, -9.81), loads=(Load(body="follower", force=(10.0, -30.0)),))
    x, y = m.moving["crank"].points["A"]
    assert y == 0.0
    return m.with_body("crank", points={"D": (0.0, 0.0), "A": (x, 0.003), "tail": (-0.02, 0.004)})


FLEXIBLE: dict[str, tuple[Mechanism, tuple[float, float], tuple[str, ...]]] = {
    "coms beside their links, every joint law": (busy_crank_rocker(), (0.004, 0.01), ()),
    "ternary links": (load("six-bar"), (0.01, 0.01), ()),
    "slider": (pushed_slider_crank(), (0.004, 0.01), ("slider",)),
    "a slide that bends, with a spring": (inverted_slider(), (0.004, 0.01), ()),
    "a pin beside its axis": (pinned_beside(), (0.01, 0.0005), ()),
}


def off(m: Mechanism, motion: Motion) -> dict[str, float]:
    """How far beams are from rigid links plus matrix structural analysis: in all (of forces: from rigid links), of the
    largest.
    """
    theta = np.radians(np.arange(10.0, 370.0, 40.0))
    trace = flexible(request_of(m, "ideal", motion, theta))
    rigid = kinematics(Assembly(m), theta, m.speed or 1.0)
    ideal, elastic = (
        kinetostatics(rigid, inertia=motion == "driven").signals(),
        compliance(rigid, inertia=motion == "driven"),
    )
    far: dict[str, list[float]] = {"angle": [], "place": [], "force": [], "drive_torque": []}
    for body in m.bodies:
        pivot = next((j.name for j in m.joints if set(j.bodies) == {body.name, "ground"}), "com")
        turned = trace.signals[f"{body.name}_angle"] - ideal[f"{body.name}_angle"]
        far["angle"] += [float(np.abs(turned - elastic.rotation(body.name, pivot)).max())]
        moved = sum(
            unit * (trace.signals[f"{body.name}_{axis}"] - ideal[f"{body.name}_{axis}"])
            for axis, unit in (("x", 1), ("y", 1j))
        )
        far["place"] += [float(np.abs(moved - elastic.displacement(body.name)).max())]
    for name in (n for n in ideal if n.startswith("reaction")):
        far["force"] += [float(np.abs(trace.signals[name] - ideal[name]).max())]
    far["drive_torque"] = [float(np.abs(trace.signals["drive_torque"] - ideal["drive_torque"]).max())]
    return {kind: max(values) for kind, values in far.items()}


@pytest.mark.parametrize("m", [m for m, _, _ in FLEXIBLE.values()] + [inverted_slider()], ids=lambda m: m.name)
def test_accelerations_and_joint_laws_from_poses_are_those_of_the_differentiated_loops(m: Mechanism) -> None:
    theta = np.radians(np.arange(5.0, 365.0, 20.0))
    found, exact = RigidMotion(CrankPath(Assembly(m)), theta, 7.0, 30.0), kinematics(Assembly(m), theta, 7.0, 30.0)
    for body in m.bodies:
        for ours, theirs in (
            (
                [found.inertia(k).linear[body.name] for k in range(theta.size)],
                exact.acceleration(body.name, MASS_CENTRE),
            ),
            ([found.inertia(k).angular[body.name] for k in range(theta.size)], exact.angular_acceleration(body.name)),
            (found.angular_velocity(body.name), exact.angular_velocity(body.name)),
        ):
            np.testing.assert_allclose(ours, theirs, rtol=0, atol=5e-9 * (np.abs(theirs).max() or 1.0))
    for joint in m.joints:
        for moving in (False, True):
            np.testing.assert_allclose(found.law(joint, moving), joint_law(joint, exact, moving), atol=1e-9)


def test_a_joint_that_stands_still_has_no_friction() -> None:
    """At a dead centre the slide stops, with a rate that is nothing but rounding."""
    m = pushed_slider_crank()
    motion = RigidMotion(CrankPath(Assembly(m)), np.radians([179.0, 180.0, 181.0]), 100.0)
    before, at, after = motion.law(m.joint("S"), moving=False)
    assert at == 0.0
    assert before == -after != 0.0


@pytest.mark.long_rows(
    "ternary links-static", "ternary links-driven", "a slide that bends, with a spring-driven",
    "a slide that bends, with a spring-static", "a pin beside its axis-driven",
)  # fmt: skip
@pytest.mark.parametrize("motion", ["static", "driven"])
@pytest.mark.parametrize("name", FLEXIBLE)
def test_flexible_links_show_what_the_matrix_says_in_the_first_order(name: str, motion: Motion) -> None:
    """Ten times as stiff: places and angles miss by a hundredth (what is left is of second order), forces change by a
    tenth.
    """
    m, section, rigid = FLEXIBLE[name]
    soft, stiff = (off(flexible_links(m, modulus, section, *rigid), motion) for modulus in (1e12, 1e13))
    for kind, order in (("angle", 2), ("place", 2), ("force", 1), ("drive_torque", 1)):
        assert stiff[kind] == pytest.approx(soft[kind] / 10**order, rel=0.1, abs=1e-13), kind


def test_a_rigid_link_among_flexible_ones_moves_as_they_let_it() -> None:
    m = flexible_links(busy_crank_rocker(), 2e11, (0.004, 0.01), "follower")
    theta = np.radians([20.0, 100.0, 250.0])
    turned = flexible(request_of(m, "ideal", "static", theta)).signals["follower_angle"] - kinematics(
        Assembly(m), theta
    ).angle("follower")
    elastic = compliance(kinematics(Assembly(m), theta, m.speed or 0.0)).rotation("follower", "E")
    np.testing.assert_allclose(turned, elastic, atol=5e-3 * np.abs(elastic).max())


def test_flexible_links_on_a_course_bear_its_inertia_forces() -> None:
    m = flexible_links(busy_crank_rocker(), 2e12, (0.004, 0.01))
    time = np.linspace(0, 1, 101)
    angle, report = 1 + 0.5 * np.sin(8 * np.pi * time), np.array([0.5, 0.13, 0.9])
    spline = CubicSpline(time, angle)
    trace = flexible(request_of(m, "ideal", "driven", time=report, course=(time, angle)))
    rigid = kinematics(Assembly(m), spline(report), spline(report, 1), spline(report, 2))
    turned = trace.signals["follower_angle"] - rigid.angle("follower")
    elastic = compliance(rigid, inertia=True).rotation("follower", "E")
    np.testing.assert_allclose(turned, elastic, atol=2e-3 * np.abs(elastic).max())
    np.testing.assert_allclose(trace.signals["drive_torque"], kinetostatics(rigid).drive_torque, rtol=5e-3)
    np.testing.assert_array_equal(trace.time, report)
    np.testing.assert_allclose(trace.signals["coupler_angular_velocity"], rigid.angular_velocity("coupler"))


def test_flexible_links_with_a_gap_are_displaced_by_both() -> None:
    m = load("paper").with_clearances({"B": 1e-4})
    theta = np.radians([30.0, 60.0, 120.0])
    trace = flexible(request_of(m, "contact", "static", theta))
    for k, at in enumerate(theta):
        alone = flexible_static(m, float(at), joint_model="contact")
        assert complex(trace.signals["clearance_B_x"][k], trace.signals["clearance_B_y"][k]) == pytest.approx(
            alone.gap["B"]
        )
    superposed = compliance(kinematics(Assembly(m), theta)).rotation("follower", "E")
    gapped = displaced(Assembly(m), theta, inertia=False)
    superposed += gapped.configuration.motion.angle("follower")
    np.testing.assert_allclose(trace.signals["follower_angle"], superposed, atol=2e-5)
    assert trace.free_share == {"B": 0.0}


def test_what_beams_do_not_do_is_refused_in_words() -> None:
    yielding = inverted_slider().with_joint("S", elasticity={"translation": 1e8, "rotation": 1e5})
    with pytest.raises(Unsupported, match="leave out elasticity of joint 'S'"):
        flexible_static(yielding, 0.3)
    with pytest.raises(Unsupported, match="massless-link"):
        flexible(request_of(load("paper"), "massless-link", "static", np.array([0.5])))
    with pytest.raises(Unsupported, match="free drive"):
        flexible(request_of(load("pendulum"), time=np.array([0.5])))
    with pytest.raises(Unsupported, match=r"drive\.stiffness"):
        flexible_static(load("paper").replace(drive=Drive(joint="D", speed=1.0, stiffness=100.0)), 0.5)
    with pytest.raises(Unsupported, match="section"):
        flexible_static(load("paper").with_body("crank", section=(0.0, 0.0)), 0.5)


# ---------------------------------------------------------------- several clearances


def loaded(case: str) -> Mechanism:
    """A shipped case under gravity, its follower pushed."""
    return load(case).replace(
        gravity=(0.0, -9.81), loads=(Load(body="follower", point="B", force=(20.0, -30.0), torque=1.0),)
    )


@pytest.mark.slow
@pytest.mark.parametrize("case", ["crank-rocker", "six-bar"])
@pytest.mark.parametrize("joints", ["DB", "AB", "DA", "DABE"])
def test_stiff_beams_with_several_gaps_are_where_rigid_links_are(case: str, joints: str) -> None:
    m = loaded(case).with_clearances(dict.fromkeys(joints, 1e-4))
    theta = np.radians(np.arange(7.0, 367.0, 30.0))
    bent, rigid = (
        run(request_of(m, "contact", "static", theta)).signals for run in (flexible, engine("exudyn").simulate)
    )
    for name, values in rigid.items():
        if name.endswith("_angle"):
            np.testing.assert_allclose(bent[name], values, atol=3e-4, err_msg=name)
        elif name.startswith("reaction"):
            np.testing.assert_allclose(bent[name], values, atol=3e-3 * 50, err_msg=name)


@pytest.mark.parametrize("degrees", [7.0, 307.0])
def test_a_linkage_that_has_turned_over_is_no_result(degrees: float) -> None:
    """Under a load that its soft links cannot bear, Newton's method ends with the follower on the other side."""
    m = loaded("crank-rocker").replace(loads=(Load(body="follower", point="B", force=(200.0, -300.0), torque=10.0),))
    with pytest.raises(SimulationError, match="assembly mode"):
        flexible(request_of(flexible_links(m, 3e8, (0.01, 0.01)), "ideal", "static", np.radians([degrees])))

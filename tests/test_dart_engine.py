"""DART against the analytic model, an independent ordinary differential equation, and its own known traps."""

from __future__ import annotations

import numpy as np
import pytest

from analytic.beyond_paper.released import released
from analytic.kinematics.assembly import Assembly
from analytic.mechanism import Drive
from analytic.mechanism.file import load
from asked import request_of
from engine_checks import (
    LINKAGES,
    PAPER_RANGE,
    SEVERAL,
    assert_kinetostatics,
    assert_spring_law,
    many_impacts_against_the_ode,
    one_revolution_against_the_ode,
    reaction_errors,
    run,
    vector,
)
from linkages import inverted_slider
from marks import slow
from sim_models.dart.engine import ENGINE
from sim_models.dart.world import DartWorld
from sim_models.engine import JointModel, Motion, SimulationError, Unsupported
from sim_models.run.path import CrankPath

pytestmark = pytest.mark.dart

REAL: tuple[JointModel, ...] = ("spring-damper", "contact")


# ---------------------------------------------------------------- statics


@pytest.mark.parametrize("clearance", [1e-2, 1e-3, 1e-4])
@pytest.mark.parametrize(
    ("joint_model", "degrees", "percent"),
    [("ideal", 1e-6, 1e-5), ("spring-damper", 0.001, 0.005), ("contact", 1e-5, 1e-4)],
)
def test_statics_of_the_paper_case(joint_model: JointModel, degrees: float, percent: float, clearance: float) -> None:
    m = load("paper").with_clearances({"B": clearance})
    trace = run(ENGINE, m, joint_model, "static", PAPER_RANGE)
    angle, size = reaction_errors(trace, m)
    assert angle < degrees
    assert size < percent
    if joint_model == "spring-damper":
        assert_spring_law(trace, 1e8)
    if joint_model == "contact":
        np.testing.assert_allclose(np.abs(vector(trace, "clearance_B")), clearance, rtol=1e-6)
        assert trace.free_share == {"B": 0.0}


@pytest.mark.parametrize("joint_model", REAL)
def test_clearance_in_several_joints_at_once_the_drive_joint_among_them(joint_model: JointModel) -> None:
    m = load("six-bar").with_clearances(SEVERAL)
    trace = run(ENGINE, m, joint_model, "static", np.arange(0.0, 360.0, 45.0))
    for joint in "DABECFG":
        angle, size = reaction_errors(trace, m, joint)
        assert angle < 0.005, joint
        assert size < 0.01, joint
    assert set(trace.journal) == set(SEVERAL)


def test_static_friction_and_springs_of_revolute_and_prismatic_joints() -> None:
    m = inverted_slider()
    assert_kinetostatics(run(ENGINE, m, "ideal", "static", np.arange(0.0, 360.0, 40.0)), m, 1e-6)


@pytest.mark.parametrize("joint_model", REAL)
def test_a_pin_that_nothing_presses_has_no_static_equilibrium(joint_model: JointModel) -> None:
    with pytest.raises(SimulationError, match="nothing presses the pin of joint 'B'"):
        run(ENGINE, load("crank-rocker").with_clearances({"B": 1e-4}), joint_model, "static", [40.0])


# ---------------------------------------------------------------- driven


@pytest.mark.parametrize("name", [name if name != "inverted slider in reverse" else slow(name)[0] for name in LINKAGES])
def test_ideal_driven_linkages_reproduce_kinetostatics(name: str) -> None:
    m, degrees = LINKAGES[name]
    assert_kinetostatics(run(ENGINE, m, "ideal", "driven", degrees), m, 3e-4)


@pytest.mark.parametrize(
    "clearance", [pytest.param(1e-2, marks=pytest.mark.slow), 1e-3, pytest.param(1e-4, marks=pytest.mark.slow)]
)
@pytest.mark.parametrize("joint_model", [*slow("spring-damper"), "contact"])
def test_driven_paper_case_starts_and_stays_in_the_analytic_equilibrium(
    joint_model: JointModel, clearance: float
) -> None:
    m = load("paper").with_clearances({"B": clearance})
    trace = run(ENGINE, m, joint_model, "driven", PAPER_RANGE)
    angle, size = reaction_errors(trace, m)
    assert angle < 0.02
    assert size < 0.06
    assert trace.free_share == {"B": 0.0}


@pytest.mark.slow
@pytest.mark.parametrize("joint_model", REAL)
def test_driven_six_bar_with_two_clearances(joint_model: JointModel) -> None:
    m = load("six-bar").with_clearances({"B": 1e-4, "F": 1e-4})
    trace = run(ENGINE, m, joint_model, "driven", np.arange(10.0, 360.0, 25.0))
    for joint in "DABECFG":
        angle, size = reaction_errors(trace, m, joint)
        assert angle < 0.05, joint
        assert size < 0.2, joint


def test_angles_are_passed_in_the_drives_direction_and_answered_in_the_order_of_the_question() -> None:
    m = load("paper").with_clearances({"B": 1e-3})
    m = m.replace(drive=Drive(joint="D", speed=-(m.speed or 0.0)))
    asked = [60.0, 62.0, 60.0, 61.5]
    trace = run(ENGINE, m, "contact", "driven", asked, lead_in=0.05)
    np.testing.assert_allclose(trace.signals["crank_angle"], np.radians(asked), atol=1e-9)
    np.testing.assert_allclose(trace.signals["crank_angular_velocity"], m.speed or 0.0, rtol=1e-9)
    assert trace.time is not None
    np.testing.assert_allclose(trace.time, (np.radians(asked) - np.radians(62.0)) / (m.speed or 0.0), atol=1e-9)
    angle, size = reaction_errors(trace, m)
    assert angle < 0.05
    assert size < 0.2


@pytest.mark.slow
def test_one_fast_revolution_follows_the_exact_motion() -> None:
    error, trace = one_revolution_against_the_ode(ENGINE)
    assert error < 4e-5
    assert trace.settings["contact_stiffness"] == 1e6


@pytest.mark.slow
def test_many_impacts_have_the_exact_statistics() -> None:
    for name, (simulated, exact) in many_impacts_against_the_ode(ENGINE).items():
        assert simulated == pytest.approx(exact, rel=0.05), name


# ---------------------------------------------------------------- contact and release


@pytest.mark.parametrize("restitution", [0.0, 0.5, 0.9])
def test_a_bar_dropped_in_its_bearing_rebounds_by_newtons_restitution(restitution: float) -> None:
    eps = 5e-3  # impact at sqrt(2 g eps) = 0.31 m/s, above DART's threshold
    m = (
        load("pendulum")
        .with_joint("O", clearance=eps, restitution=restitution)
        .replace(assembly={"pendulum": -np.pi / 2})
    )
    fall = np.sqrt(2 * eps / 9.81)
    time = np.linspace(1.05 * fall, fall * (1 + 2 * max(restitution, 0.2)), 200)
    trace = ENGINE.simulate(request_of(m, "contact", "driven", time=time, start="centred"))
    height = eps - trace.signals["clearance_O_y"]  # the pin falls: the bearing's centre is above it
    assert height.max() == pytest.approx(restitution**2 * eps, rel=0.01, abs=1e-5)
    assert height.min() > -1e-5
    assert trace.settings["restitution"] == {"O": restitution}


@pytest.mark.parametrize("joint_model", REAL)
def test_a_hanging_pendulum_hangs_a_clearance_lower(joint_model: JointModel) -> None:
    m = load("pendulum").with_clearances({"O": 1e-3}).replace(assembly={"pendulum": -np.pi / 2})
    trace = ENGINE.simulate(request_of(m, joint_model, "driven", time=np.array([0.0, 0.02])))
    np.testing.assert_allclose(trace.signals["clearance_O_y"], 1e-3, rtol=1e-3)
    np.testing.assert_allclose(trace.signals["reaction_O_y"], 0.2355 * 9.81, rtol=1e-3)


@pytest.mark.parametrize("start_speed", [0.0, 3.0])
def test_released_pendulum_with_friction_and_damping(start_speed: float) -> None:
    m = load("pendulum").with_joint("O", friction_torque=0.02, damping=0.001)
    time = np.linspace(0, 0.4, 21)
    trace = ENGINE.simulate(request_of(m, "ideal", "driven", time=time, start_speed=start_speed))
    expected = released(Assembly(m), time, omega=start_speed).reactions.signals()
    np.testing.assert_allclose(trace.signals["pendulum_angle"], expected["pendulum_angle"], atol=2e-4)
    np.testing.assert_allclose(
        trace.signals["pendulum_angular_velocity"], expected["pendulum_angular_velocity"], atol=1e-3
    )
    assert not trace.signals["drive_torque"].any()


# ---------------------------------------------------------------- what it refuses


@pytest.mark.parametrize(
    ("joint_model", "change", "why"),
    [
        ("massless-link", {}, "does not simulate massless-link"),
        ("contact", {"friction": 0.1}, "leave out friction = 0.1 of joint 'B'"),
    ],
)
@pytest.mark.parametrize("motion", ["static", "driven"])
def test_what_dart_does_not_do_is_refused(
    motion: Motion, joint_model: JointModel, change: dict[str, float], why: str
) -> None:
    m = load("paper").with_joint("B", clearance=1e-3, **change)
    with pytest.raises(Unsupported, match=why):
        run(ENGINE, m, joint_model, motion, [30.0])


def test_a_released_linkage_needs_times() -> None:
    with pytest.raises(Unsupported, match="needs times to report at"):
        ENGINE.simulate(request_of(load("paper").replace(drive=Drive(joint="D", speed="free")), time=np.zeros(0)))


def test_divergence_is_an_error() -> None:
    m = load("paper").with_clearances({"B": 1e-3})
    with pytest.raises(SimulationError, match="smaller step, or give it a softer"):
        run(ENGINE, m, "spring-damper", "driven", [30.0, 60.0], step=5e-4)


def test_dart_is_silent(capfd: pytest.CaptureFixture[str]) -> None:
    run(ENGINE, load("paper"), "ideal", "static", [30.0])
    assert capfd.readouterr() == ("", "")


# ---------------------------------------------------------------- traps


def moving_four_bar() -> DartWorld:
    m = load("crank-rocker")
    world = DartWorld(request_of(m, "ideal", "driven", np.array([1.0])))
    world.start(CrankPath(world.assembly).moving(1.0, world.speed), 1e-3)
    return world


def test_a_joints_wrench_belongs_to_the_positions_before_the_step() -> None:
    world = moving_four_bar()
    before = world.pose("crank").angle
    world.before_observing()
    world.step(1e-3)
    x, y = -world.roots["crank"].getWrenchToChildBodyNode()[3:5]
    after = world.pose("crank").angle
    force = world.reactions()[0]["D"]
    assert complex(x, y) * np.exp(1j * before) == pytest.approx(force, rel=1e-12)
    assert abs(complex(x, y) * np.exp(1j * after) - force) > 0.02 * abs(force)


def test_constraint_forces_of_a_second_tree_in_a_skeleton_would_be_forgotten() -> None:
    """Were that no longer so, trees need no skeletons of their own."""
    import dartpy as dart

    world, skeleton = dart.simulation.World(), dart.dynamics.Skeleton()
    spin = dart.dynamics.RevoluteJointProperties()
    spin.mAxis = [0.0, 0.0, 1.0]
    bodies = [skeleton.createRevoluteJointAndBodyNodePair(None, spin)[1] for _ in range(2)]
    world.addSkeleton(skeleton)
    world.getConstraintSolver().addConstraint(dart.constraint.BallJointConstraint(*bodies, [1.0, 0.0, 0.0]))
    bodies[0].addExtTorque([0.0, 0.0, 2.0], False)
    world.step(True)
    first, second = skeleton.getConstraintForces()
    assert first == pytest.approx(-1.0, rel=1e-6)  # the second body, as heavy, takes half of the torque
    assert second == 0.0


def test_a_driven_body_alone_in_its_skeleton_still_feels_its_pins() -> None:
    """DART leaves constraint forces out of the wrench of a skeleton that only a motor moves."""
    m, _ = LINKAGES["scotch yoke"]
    world = DartWorld(request_of(m, "ideal", "driven", np.array([1.0])))
    assert world.nodes["crank"].getSkeleton().getNumDofs() == 1
    world.start(CrankPath(world.assembly).moving(1.0, world.speed), 1e-5)
    world.before_observing()
    world.step(1e-5)
    forces = world.reactions()[0]
    crank = 0.2 * -(10.0**2) * 0.025 * np.exp(1j * world.before["crank"].angle)  # mass times acceleration of its middle
    assert forces["O"] - forces["A"] == pytest.approx(crank, rel=1e-6)


def test_worlds_put_slow_bodies_to_sleep_unless_told_not_to() -> None:
    import dartpy as dart

    assert dart.simulation.World().getDeactivationOptions().mEnabled
    assert not moving_four_bar().world.getDeactivationOptions().mEnabled


def test_a_spring_damper_has_no_friction() -> None:
    m = load("paper").with_clearances({"B": 1e-3})
    smooth, rough = (
        run(ENGINE, m.with_joint("B", friction=mu), "spring-damper", "static", [30.0, 60.0]).signals
        for mu in (0.0, 0.1)
    )
    np.testing.assert_array_equal(rough["reaction_B_x"], smooth["reaction_B_x"])


def test_contact_shapes_are_frictionless() -> None:
    import dartpy as dart

    node = dart.dynamics.Skeleton().createFreeJointAndBodyNodePair()[1].createShapeNode(dart.dynamics.SphereShape(1.0))
    node.createDynamicsAspect()
    assert node.getDynamicsAspect().getFrictionCoeff() == 1.0
    bearing = DartWorld(request_of(load("paper"), "contact", "static", np.array([1.0]))).bearings["B"]
    assert bearing.journal.getDynamicsAspect().getFrictionCoeff() == 0.0
    assert bearing.anvil.getDynamicsAspect().getFrictionCoeff() == 0.0

"""DART alone: what it refuses, its own rigid contact, and its known traps."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from analytic.kinematics.assembly import Assembly
from analytic.mechanism import Drive
from analytic.mechanism.file import load
from asked import request_of
from engine_checks import run, vector
from linkages import scotch_yoke
from marks import slow
from several_truths import close
from sim_models.dart.engine import ENGINE, DartRun
from sim_models.dart.world import DartWorld
from sim_models.engine import JointModel, Motion, Request, Unsupported
from sim_models.run.path import CrankPath
from tests.evidence.validation.rebounds import CLEARANCE, G, dropped, hanging, rebound

pytestmark = pytest.mark.dart

LOOSE = 2e-4  # m


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
        run("dart", m, joint_model, motion, [30.0])


def test_a_released_linkage_needs_times() -> None:
    with pytest.raises(Unsupported, match="needs times to report at"):
        ENGINE.simulate(request_of(load("paper").replace(drive=Drive(joint="D", speed="free")), time=np.zeros(0)))


def opened(request: Request) -> DartWorld:
    return DartWorld(request, DartRun(request).path)


def moving_four_bar() -> DartWorld:
    m = load("crank-rocker")
    world = opened(request_of(m, "ideal", "driven", np.array([1.0])))
    world.start(CrankPath(world.path.assembly).moving(1.0, world.speed), 1e-3)
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
    m = scotch_yoke()
    world = opened(request_of(m, "ideal", "driven", np.array([1.0])))
    assert world.nodes["crank"].getSkeleton().getNumDofs() == 1
    world.start(CrankPath(world.path.assembly).moving(1.0, world.speed), 1e-5)
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
        run("dart", m.with_joint("B", friction=mu), "spring-damper", "static", [30.0, 60.0]).signals
        for mu in (0.0, 0.1)
    )
    np.testing.assert_array_equal(rough["reaction_B_x"], smooth["reaction_B_x"])


def test_contact_shapes_are_frictionless() -> None:
    import dartpy as dart

    node = dart.dynamics.Skeleton().createFreeJointAndBodyNodePair()[1].createShapeNode(dart.dynamics.SphereShape(1.0))
    node.createDynamicsAspect()
    assert node.getDynamicsAspect().getFrictionCoeff() == 1.0
    bearing = opened(request_of(load("paper"), "contact", "static", np.array([1.0]))).bearings["B"]
    assert bearing.journal.getDynamicsAspect().getFrictionCoeff() == 0.0
    assert bearing.anvil.getDynamicsAspect().getFrictionCoeff() == 0.0


@pytest.mark.parametrize("asked", [0.4, 0.9, *slow(0.35, 0.5, 0.65, 0.8, 0.95)])
def test_darts_own_contact_delivers_what_is_asked(asked: float) -> None:
    """It strikes at 0.31 m/s, and rebounds at more than DART's 0.1 m/s."""
    m = hanging(None, asked, 1e7)
    assert rebound(dropped(ENGINE, m)) == pytest.approx(asked, abs=1e-3)


@pytest.mark.parametrize("asked", [0.3, *slow(0.05, 0.1, 0.2)])
def test_darts_own_contact_holds_what_would_rebound_slowly(asked: float) -> None:
    """At less than 0.1 m/s: and its settings say from which speed of impact on it rebounds."""
    time = math.sqrt(2 * CLEARANCE / G) * np.array([1.001, 1.01, 1 + asked / 2])
    asking = request_of(hanging(None, asked, 1e7), "contact", "driven", time=time, start="centred", step=8e-6)
    trace = ENGINE.simulate(asking)
    np.testing.assert_allclose(trace.signals["clearance_O_y"], CLEARANCE, rtol=1e-6)
    least = trace.settings["minimum_impact_speed"]
    assert least == {"O": pytest.approx(0.1 / asked)}
    assert trace.settings["contact_law"] == "rigid, Newton's restitution"


@pytest.mark.slow
def test_a_pin_put_back_on_its_rim_opens_no_other_loop() -> None:
    m, times = load("3-rrr").with_clearances({"C1": LOOSE}), np.linspace(0.0, 1.0, 11)  # s: held badly towards the end
    at = Assembly(m).positions
    courses = {d.joint: (times, at[d.joint] + float(d.speed) * times) for d in m.drives}
    asked = request_of(m, "contact", "driven", time=times, courses=courses)
    coarse, fine = (ENGINE.simulate(replace(asked, step=step)) for step in (2e-4, 1e-4))
    largest = max(np.abs(vector(fine, f"reaction_{joint.name}")).max() for joint in m.joints)
    for joint in m.joints:
        name = f"reaction_{joint.name}"
        close(vector(coarse, name), vector(fine, name), 5e-5 * largest, name)

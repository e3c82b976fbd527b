"""PyBullet alone: struts, what it refuses, and its known traps."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing

import numpy as np
import pytest

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import kinematics
from analytic.mechanism import Load
from analytic.mechanism.file import load
from analytic.paper.kinetostatics import kinetostatics
from asked import request_of
from engine_checks import reaction_errors, run
from marks import slow
from sim_models.common.silence import silence
from sim_models.engine import JointModel, Motion, Request, Unsupported
from sim_models.pybullet.run import BulletRun
from sim_models.pybullet.world import BulletWorld
from sim_models.run.path import CrankPath

pytestmark = pytest.mark.pybullet


@pytest.mark.slow
@pytest.mark.parametrize(("step", "count"), [(75.0, 5), *slow((15.0, 24))])
def test_four_struts_in_a_chain_are_where_the_rods_are_at_every_angle(step: float, count: int) -> None:
    """Bullet's sequential solver lets such struts grow at some of these angles, and balances other forces there."""
    m = load("crank-rocker").replace(
        gravity=(0.0, -9.81), loads=(Load(body="follower", point="B", force=(20.0, -30.0), torque=1.0),)
    )
    m = m.with_clearances({"D": 1e-4, "A": 2e-4, "B": 1e-4, "E": 1e-4})
    trace = run("pybullet", m, "contact", "static", np.arange(15.0, 375.0, step))
    assert trace.settings["read_from_rods"].endswith(f"of {count} angles")  # and so it says
    for joint in "DABE":
        angle, size = reaction_errors(trace, m, joint)
        assert angle < 0.02, joint
        assert size < 0.05, joint


def opened(request: Request) -> BulletWorld:
    return BulletWorld(request, BulletRun(request).path)


def test_a_contact_strut_holds_at_its_length_and_not_before() -> None:
    m = load("paper").with_clearances({"B": 1e-3})
    forces = []
    with silence(), closing(opened(request_of(m, "contact", "static", np.array([1.0])))) as world:
        for gap in (0.9e-3, 1e-3):
            world.place(CrankPath(world.path.assembly).poses(1.0, {"B": gap * np.exp(1j)}))
            world.step(1e-6)
            forces.append(abs(world.pin_forces["B"]))
    assert forces[1] == pytest.approx(25 / np.sin(1.0), rel=0.01)
    assert forces[0] < 0.1 * forces[1]  # what it takes to carry the strut along


@pytest.mark.parametrize(
    ("joint_model", "motion", "change", "why"),
    [
        ("massless-link", "driven", {}, "does not simulate massless-link joints in driven motion"),
        ("contact", "driven", {}, "does not simulate contact joints in driven motion"),
        ("contact", "static", {"friction": 0.1}, "leave out friction = 0.1 of joint 'B'"),
    ],
)
def test_what_pybullet_does_not_do_is_refused(
    joint_model: JointModel, motion: Motion, change: dict[str, float], why: str
) -> None:
    with pytest.raises(Unsupported, match=why):
        run("pybullet", load("paper").with_joint("B", clearance=1e-3, **change), joint_model, motion, [30.0])


def test_pybullet_lets_go_of_its_clients() -> None:
    import pybullet as p

    for _ in range(3):
        run("pybullet", load("paper").with_clearances({"B": 1e-3}), "contact", "static", [30.0])
    assert not any(p.isConnected(client) for client in range(20))


@pytest.fixture
def client() -> Iterator[int]:
    import pybullet as p

    with silence():
        number = p.connect(p.DIRECT)
    p.setTimeStep(1e-3, physicsClientId=number)
    yield number
    p.disconnect(number)


def hinged_bar(client: int) -> int:
    import pybullet as p

    body = p.createMultiBody(
        baseMass=0,
        linkMasses=[2.0],
        linkCollisionShapeIndices=[-1],
        linkVisualShapeIndices=[-1],
        linkPositions=[[0, 0, 0]],
        linkOrientations=[[0, 0, 0, 1]],
        linkInertialFramePositions=[[0.5, 0, 0]],
        linkInertialFrameOrientations=[[0, 0, 0, 1]],
        linkParentIndices=[0],
        linkJointTypes=[p.JOINT_REVOLUTE],
        linkJointAxis=[[0, 0, 1]],
        physicsClientId=client,
    )
    p.setJointMotorControl2(body, 0, p.VELOCITY_CONTROL, force=0, physicsClientId=client)
    return int(body)


def test_an_inertia_set_together_with_damping_is_dropped(client: int) -> None:
    import pybullet as p

    bar = hinged_bar(client)
    p.changeDynamics(bar, 0, localInertiaDiagonal=[3, 3, 3], linearDamping=0, physicsClientId=client)
    assert p.getDynamicsInfo(bar, 0, client)[2] != (3, 3, 3)
    p.changeDynamics(bar, 0, localInertiaDiagonal=[3, 3, 3], physicsClientId=client)
    assert p.getDynamicsInfo(bar, 0, client)[2] == (3, 3, 3)


def spin_after(client: int, bar: int, speed: float, steps: int) -> float:
    import pybullet as p

    p.changeDynamics(bar, 0, localInertiaDiagonal=[0.1, 0.1, 0.1], physicsClientId=client)
    p.resetJointState(bar, 0, 0.0, speed, client)
    for _ in range(steps):
        p.stepSimulation(client)
    return float(p.getJointState(bar, 0, client)[1])


def test_a_free_bar_loses_speed_by_the_default_damping(client: int) -> None:
    import pybullet as p

    bar = hinged_bar(client)
    assert spin_after(client, bar, 10.0, 1000) < 9.9
    p.changeDynamics(bar, 0, linearDamping=0, angularDamping=0, jointDamping=0, physicsClientId=client)
    assert spin_after(client, bar, 10.0, 1000) == pytest.approx(10.0, rel=1e-9)


def test_a_fast_bar_is_held_to_the_default_speed_limit(client: int) -> None:
    import pybullet as p

    bar = hinged_bar(client)
    p.changeDynamics(bar, 0, linearDamping=0, angularDamping=0, jointDamping=0, physicsClientId=client)
    assert spin_after(client, bar, 500.0, 5) < 200.0
    p.changeDynamics(bar, 0, maxJointVelocity=1e9, physicsClientId=client)
    assert spin_after(client, bar, 500.0, 5) == pytest.approx(500.0, rel=1e-9)


def test_a_constraints_force_belongs_to_the_positions_before_the_step() -> None:
    """A coarse step at 15 rpm tells the crank's positions at its two ends apart."""
    m, h = load("paper"), 2e-3
    with silence(), closing(opened(request_of(m, "ideal", "driven", np.array([1.0])))) as world:
        world.start(CrankPath(world.path.assembly).moving(1.0, world.speed), h)
        world.before_observing()
        before, turn = world.before["crank"].angle, world.speed * h
        world.step(h)
        found = world.reactions()[0]["B"]
    forces = [
        kinetostatics(kinematics(Assembly(m), np.array([angle]), m.speed or 0.0)).forces["B"][0]
        for angle in (before, before + turn)
    ]
    assert abs(found - forces[0]) < 0.01 * abs(found - forces[1])


def test_a_force_in_the_world_frame_takes_its_arm_from_a_step_ago(client: int) -> None:
    """Unless the link's kinematics are asked for anew: a force through the com of a turning bar then has no moment
    about it.
    """
    import pybullet as p

    def kick(refresh: bool) -> float:
        bar = hinged_bar(client)
        p.changeDynamics(bar, 0, linearDamping=0, angularDamping=0, jointDamping=0, physicsClientId=client)
        p.changeDynamics(bar, 0, localInertiaDiagonal=[0.1, 0.1, 0.1], physicsClientId=client)
        p.resetJointState(bar, 0, 0.0, 10.0, client)
        p.stepSimulation(client)
        if refresh:
            p.getLinkState(bar, 0, False, True, client)
        angle, before = p.getJointState(bar, 0, client)[:2]
        com = (0.5 * np.cos(angle), 0.5 * np.sin(angle), 0.0)
        p.applyExternalForce(
            bar, 0, (1e3 * np.cos(angle), 1e3 * np.sin(angle), 0.0), com, p.WORLD_FRAME, client
        )  # along the bar: no moment
        p.stepSimulation(client)
        gained = float(p.getJointState(bar, 0, client)[1]) - before
        p.removeBody(bar, client)
        return gained

    assert abs(kick(refresh=False)) > 1e-3
    assert abs(kick(refresh=True)) < 1e-9


@pytest.mark.parametrize("degrees", [-90.0, 90.0])
def test_the_sequential_solver_is_not_stopped_by_a_small_residual(degrees: float) -> None:
    """With a residual threshold of 1e-20 it ended 16 % short of the weight, at just these angles of a hanging bar."""
    hanging = load("pendulum").with_clearances({"O": 5e-4})
    trace = run("pybullet", hanging, "contact", "static", np.radians([degrees]))
    assert trace.signals["reaction_O_y"][0] == pytest.approx(0.2355 * 9.81, rel=1e-7)

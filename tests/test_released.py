"""A released linkage against closed forms of the pendulum, and against its own energy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ellipk

from analytic.beyond_paper.freedom import Freedom, swing
from analytic.beyond_paper.released import released
from analytic.kinematics.assembly import Assembly
from analytic.kinematics.schedule import Schedule
from analytic.mechanism import Mechanism
from analytic.mechanism.file import load
from compare.judge.reference import reference
from marks import slow


def test_a_pendulum_released_from_the_horizontal_has_the_exact_period() -> None:
    m = load("pendulum")
    body = m.bodies[0]
    about_pivot = body.moment_of_inertia + body.mass * 0.15**2
    period = 4 * np.sqrt(about_pivot / (body.mass * 9.81 * 0.15)) * ellipk(np.sin(np.pi / 4) ** 2)
    found = released(Assembly(m), np.array([0.0, period / 4, period / 2, period])).reactions
    np.testing.assert_allclose(found.motion.theta, [0.0, -np.pi / 2, -np.pi, 0.0], atol=1e-7)


def test_a_released_four_bar_keeps_its_energy() -> None:
    m = load("crank-rocker").replace(gravity=(0.0, -9.81), drive=None)
    found = released(Assembly(m), np.linspace(0.0, 1.0, 201)).reactions
    motion = found.motion
    energy = sum(
        0.5 * b.mass * np.abs(motion.velocity(b.name)) ** 2
        + 0.5 * b.moment_of_inertia * motion.angular_velocity(b.name) ** 2
        + b.mass * 9.81 * motion.position(b.name).imag
        for b in m.bodies
    )
    assert np.ptp(motion.theta) > 1.0
    assert np.ptp(energy) < 1e-8 * np.abs(energy).max()
    np.testing.assert_allclose(found.drive_torque, 0, atol=1e-9)


def test_a_viscous_pendulum_decays_as_its_small_angle_solution() -> None:
    m = load("pendulum").with_joint("O", damping=2e-3).replace(assembly={"pendulum": -np.pi / 2 + 1e-3})
    body = m.bodies[0]
    about_pivot = body.moment_of_inertia + body.mass * 0.15**2
    decay, omega0 = 2e-3 / (2 * about_pivot), np.sqrt(body.mass * 9.81 * 0.15 / about_pivot)
    omega = np.sqrt(omega0**2 - decay**2)
    time = np.linspace(0.0, 2.0, 41)
    swing = 1e-3 * np.exp(-decay * time) * (np.cos(omega * time) + decay / omega * np.sin(omega * time))
    found = released(Assembly(m), time).reactions
    np.testing.assert_allclose(found.motion.theta + np.pi / 2, swing, atol=1e-9)
    assert found.motion.theta[0] == pytest.approx(-np.pi / 2 + 1e-3)


def rubbing(friction: float) -> Mechanism:
    return load("pendulum").with_joint("O", friction_torque=friction)


def height(m: Mechanism, theta: np.ndarray) -> np.ndarray:
    """Potential energy (J) of the shipped pendulum."""
    return np.asarray(m.bodies[0].mass * 9.81 * 0.15 * np.sin(theta))


@pytest.mark.long_rows("0.02")
@pytest.mark.parametrize("friction", [0.02, 0.1, 0.2])
def test_dry_friction_takes_its_torque_times_the_angle_until_it_holds(friction: float) -> None:
    m = rubbing(friction)
    found = released(Assembly(m), np.linspace(0.0, 20.0, 4001))
    theta, still = found.reactions.motion.theta, found.held
    speed = found.reactions.motion.angular_velocity("pendulum")
    about_pivot = m.bodies[0].moment_of_inertia + m.bodies[0].mass * 0.15**2
    energy = about_pivot * speed**2 / 2 + height(m, theta)
    # The angle swept between samples: turning points lie between them, where the speed changes its sign.
    straight = np.sign(speed[1:]) == np.sign(speed[:-1])
    lost = -np.diff(energy) - friction * np.abs(np.diff(theta))
    np.testing.assert_allclose(lost[straight], 0, atol=1e-9)
    assert np.all(lost[~straight] > -1e-9)
    assert still[-1]
    assert not still[0]
    np.testing.assert_array_equal(theta[still], theta[-1])
    assert abs(m.bodies[0].mass * 9.81 * 0.15 * np.cos(theta[-1])) <= friction
    np.testing.assert_allclose(found.reactions.drive_torque, 0, atol=1e-9)


def test_what_gravity_cannot_move_stays_and_is_held() -> None:
    found = released(Assembly(rubbing(0.36)), np.linspace(0.0, 1.0, 11))
    assert found.held.all()
    np.testing.assert_array_equal(found.reactions.motion.theta, 0.0)
    np.testing.assert_allclose(found.reactions.forces["O"].imag, load("pendulum").bodies[0].mass * 9.81, rtol=1e-12)
    np.testing.assert_allclose(found.reactions.drive_torque, 0, atol=1e-15)


@pytest.mark.slow
def test_a_four_bar_that_several_joints_hold_has_no_answer_from_there_on() -> None:
    m = load("crank-rocker").replace(gravity=(0.0, -9.81), drive=None)
    for joint in ("D", "E"):
        m = m.with_joint(joint, friction_torque=0.01)
    time = np.linspace(0.0, 4.0, 401)
    held = released(Assembly(m), time).held
    assert 0 < held.sum() < held.size
    side = reference(Assembly(m), Schedule.released(m, time), "equilibrium", {})
    assert {i for i in side.flags if "D and E" in side.flags[i]} == set(np.flatnonzero(held).tolist())
    assert np.isnan(side.signals["reaction_A_x"][held]).all()


@pytest.mark.parametrize("friction", slow(0.0, 0.05, 0.2, 0.36))
def test_the_tables_of_many_linkages_swing_turn_and_stick_as_the_equation_does(friction: float) -> None:
    assembly, time = Assembly(rubbing(friction)), np.linspace(0.0, 3.0, 301)
    theta, omega, alpha = swing([Freedom.of(assembly)], np.array([[assembly.start, 0.0]]), time)
    found = released(assembly, time)
    np.testing.assert_allclose(theta[0], found.reactions.motion.theta, atol=1e-8)
    np.testing.assert_allclose(omega[0], found.reactions.motion.rates[0], atol=1e-7)
    assert np.all(alpha[0, found.held] == 0)

"""A released linkage against closed forms of the pendulum, and against its own energy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ellipk

from analytic.assembly import Assembly
from analytic.mechanism_file import load
from analytic.released import released


def test_a_pendulum_released_from_the_horizontal_has_the_exact_period() -> None:
    m = load("pendulum")
    body = m.bodies[0]
    about_pivot = body.moment_of_inertia + body.mass * 0.15**2
    period = 4 * np.sqrt(about_pivot / (body.mass * 9.81 * 0.15)) * ellipk(np.sin(np.pi / 4) ** 2)
    found = released(Assembly(m), np.array([0.0, period / 4, period / 2, period]))
    np.testing.assert_allclose(found.motion.theta, [0.0, -np.pi / 2, -np.pi, 0.0], atol=1e-7)


def test_a_released_four_bar_keeps_its_energy() -> None:
    m = load("crank-rocker").replace(gravity=(0.0, -9.81), drive=None)
    found = released(Assembly(m), np.linspace(0.0, 1.0, 201))
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
    found = released(Assembly(m), time)
    np.testing.assert_allclose(found.motion.theta + np.pi / 2, swing, atol=1e-9)
    assert found.motion.theta[0] == pytest.approx(-np.pi / 2 + 1e-3)

"""A crank that lags its motor on a springy transmission, along a course that turns back, beside its own equation."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from analytic.beyond_paper.drive import DriveTorque, Motor
from analytic.kinematics.schedule import Turning

INERTIA, DAMPING, STIFFNESS = 5e-4, 0.3, 2000.0  # kg.m^2, N.m.s/rad, N.m/rad
SWAY, PACE = 0.5, 4.0  # rad, rad/s


def sway(time: np.ndarray, order: int = 0, /) -> np.ndarray:
    return SWAY * PACE**order * np.sin(PACE * time + order * np.pi / 2)


def torque_of(friction: float, damping: float) -> DriveTorque:
    def torque(moved: Turning) -> np.ndarray:
        return INERTIA * moved.alpha + damping * moved.omega + friction * np.sign(moved.omega)

    return torque


def lags(friction: float, count: int = 600, damping: float = DAMPING) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rate of the motor and lag of the crank at even times over two periods, and by its equation of motion, whose
    friction grows to its size within 1e-4 rad/s.
    """
    time = np.linspace(0.0, 4 * np.pi / PACE, count)

    def moves(t: float, state: np.ndarray) -> list[float]:
        theta, omega = state
        resists = damping * omega + friction * np.tanh(omega / 1e-4)
        return [omega, (STIFFNESS * (float(sway(np.array(t))) - theta) - resists) / INERTIA]

    before = np.concatenate([[-4 * np.pi / PACE], time])  # what it begins with has died away
    start = [0.0, SWAY * PACE]
    run = solve_ivp(moves, before[[0, -1]], start, "LSODA", before, rtol=1e-9, atol=1e-12, max_step=1e-2)
    crank = Motor(sway).crank(time, STIFFNESS, torque_of(friction, damping), turns=False)
    return sway(time, 1), sway(time) - crank.theta, sway(time) - run.y[0, 1:]


def test_a_crank_lags_its_motor_by_its_torque() -> None:
    _, lag, own = lags(0.0)
    assert np.abs(own).max() == pytest.approx(3e-4, rel=1e-3)
    assert lag == pytest.approx(own, abs=1e-9)


@pytest.mark.parametrize(("damping", "within"), [(3.0, 1e-6), (20.0, 1e-2)])
def test_a_crank_that_creeps_after_its_motor_lags_it_too(damping: float, within: float) -> None:
    """Its spring's own time is 1.5 and 10 ms: a lag without the beginning's transient."""
    _, lag, own = lags(0.0, damping=damping)
    assert lag == pytest.approx(own, abs=within * np.abs(own).max())


@pytest.mark.parametrize("count", [600, 601, 607])
def test_a_crank_with_dry_friction_rests_where_its_motor_turns_back(count: int) -> None:
    """Friction of 2 N.m is a lag of 1 mrad either way; in between the crank stands still while the motor takes the
    spring from one to the other.  When it comes to rest is known to a sample.
    """
    rate, lag, own = lags(2.0, count)
    moves = np.abs(rate) > 0.3 * SWAY * PACE
    assert lag[moves] == pytest.approx(own[moves], abs=1e-9)
    assert lag == pytest.approx(own, abs=1e-4)

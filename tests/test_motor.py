"""A motor's motion as every engine is given it, made from a request."""

from __future__ import annotations

import numpy as np
import pytest

from analytic.kinematics.schedule import Course, Steady
from analytic.mechanism import Drive
from analytic.mechanism.file import load
from asked import request_of

ROCKER = load("crank-rocker")
ANGLES = np.array([0.5, 0.2, 0.9])


def at(speed: object) -> Drive:
    return Drive(joint="D", speed=speed, stiffness=200.0)


@pytest.mark.parametrize(("speed", "first"), [(8.0, 0.2), (-8.0, 0.9)])
def test_a_motor_at_constant_speed_passes_every_angle_after_its_lead_in(speed: float, first: float) -> None:
    request = request_of(ROCKER.replace(drive=at(speed)), crank_angle=ANGLES, lead_in=0.4)
    motor = request.motor
    assert isinstance(motor, Steady)
    assert (motor.start, motor.begin, motor.top_speed) == (first, -0.05, 8.0)
    assert motor.position(motor.begin) == pytest.approx(first - np.copysign(0.4, speed), abs=1e-15)
    times = request.schedule.time
    assert times.min() == 0
    np.testing.assert_allclose(motor.positions(times), ANGLES, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(motor.positions(times, 1), [speed] * 3)
    np.testing.assert_array_equal(motor.positions(times, 2), [0.0] * 3)


def test_a_motor_on_a_course_goes_through_its_knots_and_is_fastest_between_them() -> None:
    knots = np.array([1.0, 1.5, 2.0, 2.5, 3.0])
    cubic = np.polynomial.Polynomial([0.0, 0.0, 3.0, -1.0])(knots - 1)  # its rate 6 t - 3 t^2 is largest at t = 1
    request = request_of(ROCKER.replace(drive=at("measured")), course=(knots, cubic), time=np.array([2.5, 1.2]))
    motor = request.motor
    assert isinstance(motor, Course)
    assert (motor.begin, motor.end, motor.knot_spacing) == (1.0, 3.0, 0.5)
    np.testing.assert_array_equal(request.schedule.time, [2.5, 1.2])
    np.testing.assert_allclose(motor.positions(knots), cubic, atol=1e-14)
    assert motor.top_speed == pytest.approx(3.0, rel=1e-12)
    assert motor.peak(3) == pytest.approx(6.0, rel=1e-12)
    seen = motor.position(1.2), motor.rate(1.2), motor.acceleration(1.2)
    np.testing.assert_allclose(seen, [3 * 0.04 - 0.008, 1.2 - 0.12, 6 - 1.2], rtol=1e-12)


def test_without_a_motor_there_is_none() -> None:
    free = ROCKER.replace(drive=at("free"))
    assert request_of(ROCKER, motion="static", crank_angle=ANGLES).motor is None
    released = request_of(free, time=np.array([0.1, 0.0]))
    assert released.motor is None
    np.testing.assert_array_equal(released.schedule.time, [0.1, 0.0])


def test_only_a_drive_that_turns_the_crank_yields() -> None:
    assert [ROCKER.replace(drive=at(speed)).drive_stiffness for speed in (8.0, "measured")] == [200.0, 200.0]
    assert ROCKER.replace(drive=at("free")).drive_stiffness is None
    assert ROCKER.replace(drive=None).drive_stiffness is None
    assert ROCKER.drive_stiffness is None

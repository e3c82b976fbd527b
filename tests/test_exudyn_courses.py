"""Exudyn's motor on a course and behind a spring, against kinetostatics and an independent ordinary differential
equation.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.motion import kinematics
from analytic.kinematics.schedule import Schedule, ScheduleError
from analytic.mechanism import Drive, Load, Mechanism
from analytic.mechanism.file import load
from analytic.paper.kinetostatics import kinetostatics
from asked import request_of
from marks import slow
from sim_models.engine import JointModel, Trace, Unsupported
from sim_models.exudyn.engine import ENGINE

pytestmark = pytest.mark.exudyn

REAL: tuple[JointModel, ...] = ("massless-link", "spring-damper", "contact")
ROCKER = load("crank-rocker")
SPEED = ROCKER.speed or 0.0
LOADED = ROCKER.replace(
    gravity=(0.0, -9.81),
    loads=(Load(body="follower", force=(80.0, -80.0)), Load(body="coupler", force=(0.0, 1.0), torque=0.05)),
)
PENDULUM = load("pendulum").replace(drive=Drive(joint="O", speed="measured"))
TURN = np.linspace(0, 2 * math.pi / SPEED, 721)
SECOND = np.linspace(0, 1, 501)
SWING = 0.5 * np.sin(2 * math.pi * SECOND)

COURSES: dict[str, tuple[Mechanism, np.ndarray, np.ndarray]] = {
    "constant speed": (ROCKER, TURN, SPEED * TURN),
    "ripple": (ROCKER, TURN, SPEED * TURN + 2e-3 * np.sin(6 * SPEED * TURN + 0.3)),
    "from rest": (ROCKER, SECOND, 20 * SECOND**2),
    "backwards, then on": (LOADED, SECOND, 1 + 3 * SECOND * (SECOND - 0.6)),
    "oscillating crank": (ROCKER.replace(drive=Drive(joint="D", speed="measured")), SECOND, SWING),
    "oscillating pendulum": (PENDULUM, SECOND, SWING),
    "standing": (PENDULUM, SECOND, np.full(501, 0.4)),
    "late and coarse": (LOADED, 7.0 + SECOND[::25], 1 + SWING[::25]),
}


def follow(
    m: Mechanism, course: tuple[np.ndarray, np.ndarray], time: np.ndarray, joint_model: JointModel = "ideal"
) -> Trace:
    return ENGINE.simulate(request_of(m, joint_model, "driven", time=time, course=course))


def errors(trace: Trace, m: Mechanism, crank: tuple[np.ndarray, np.ndarray, np.ndarray]) -> dict[str, float]:
    """Largest errors of a trace by kind, against kinetostatics of a crank's angle, rate and acceleration.

    Of angles in rad, places in m, of reactions and the drive torque in parts of the largest.
    """
    expected = kinetostatics(kinematics(Assembly(m), *crank)).signals()
    force = max(float(np.abs(v).max()) for name, v in expected.items() if name.startswith("reaction"))
    scales = {
        "reaction": force,
        "drive_torque": float(np.abs(expected["drive_torque"]).max()),
        "_angle": 1.0,
        "_x": 1.0,
        "_y": 1.0,
    }
    worst = dict.fromkeys(scales, 0.0)
    for name, values in expected.items():
        kind = next((kind for kind in scales if name.startswith(kind) or name.endswith(kind)), None)
        if kind is not None and not name.startswith("clearance"):
            worst[kind] = max(worst[kind], float(np.abs(trace.signals[name] - values).max()) / scales[kind])
    return worst


@pytest.mark.slow
@pytest.mark.parametrize("times", [*slow("at the knots"), "anywhere"])
@pytest.mark.parametrize("name", COURSES)
def test_a_course_has_the_angles_inertia_forces_and_torque_of_its_spline(name: str, times: str) -> None:
    m, time, angle = COURSES[name]
    report = time if times == "at the knots" else np.random.default_rng(3).uniform(time[0], time[-1], 40)
    spline = CubicSpline(time, angle)
    trace = follow(m, (time, angle), report)
    np.testing.assert_allclose(trace.crank_angle, spline(report), rtol=0, atol=1e-7)
    np.testing.assert_array_equal(trace.time, report)
    worst = errors(trace, m, (spline(report), spline(report, 1), spline(report, 2)))
    assert max(worst["_angle"], worst["_x"], worst["_y"]) < 1e-6
    assert max(worst["reaction"], worst["drive_torque"]) < 2e-4


@pytest.mark.slow
@pytest.mark.parametrize("joint_model", ["massless-link", *slow(*(m for m in REAL if m != "massless-link"))])
def test_pins_pressed_into_small_gaps_follow_a_course_as_an_ideal_linkage_does(joint_model: JointModel) -> None:
    """The rest is what a gap of 1e-5 m of links of 0.05 m and more does; a start off the motion would sway at ten times
    that.
    """
    time = SECOND[:251]
    angle = 1 + 0.5 * np.sin(4 * math.pi * time)
    spline = CubicSpline(time, angle)
    trace = follow(LOADED.with_clearances({"B": 1e-5}), (time, angle), time, joint_model)
    worst = errors(trace, LOADED, (spline(time), spline(time, 1), spline(time, 2)))
    assert max(worst["reaction"], worst["drive_torque"]) < 8e-4
    assert worst["_angle"] < 4e-4
    assert trace.free_share["B"] == 0.0


@pytest.mark.slow
@pytest.mark.parametrize("joint_model", ["spring-damper", "contact"])
def test_impacts_on_a_course_of_constant_speed_are_those_at_constant_speed(joint_model: JointModel) -> None:
    m = ROCKER.replace(drive=Drive(joint="D", speed=62.8)).with_clearances({"B": 2e-4})
    m = m.with_joint("B", contact_stiffness=1e6, contact_damping=300.0)
    time = np.linspace(0, 0.1, 361)
    constant = ENGINE.simulate(request_of(m, joint_model, "driven", 62.8 * time, start="centred", step=1e-5))
    course = ENGINE.simulate(
        request_of(m, joint_model, "driven", time=time, course=(time, 62.8 * time), start="centred", step=1e-5)
    )
    assert 0 < constant.free_share["B"] == pytest.approx(course.free_share["B"], rel=1e-3)
    for name in ("coupler_angle", "follower_angle"):
        np.testing.assert_allclose(course.signals[name], constant.signals[name], atol=2e-6)
    peak = np.abs(constant.signals["reaction_B_x"]).max()
    np.testing.assert_allclose(course.signals["reaction_B_x"], constant.signals["reaction_B_x"], atol=2e-3 * peak)


def test_friction_turns_with_a_course_that_reverses() -> None:
    m = PENDULUM.with_joint("O", friction_torque=0.02, damping=0.003)
    moving = np.abs(np.cos(2 * math.pi * SECOND)) > 0.01
    trace = follow(m, (SECOND, SWING), SECOND)
    spline = CubicSpline(SECOND, SWING)
    expected = kinetostatics(kinematics(Assembly(m), spline(SECOND), spline(SECOND, 1), spline(SECOND, 2))).drive_torque
    np.testing.assert_allclose(
        trace.signals["drive_torque"][moving], expected[moving], atol=2e-4 * np.abs(expected).max()
    )


@pytest.mark.parametrize("joint_model", ["ideal", *REAL])
def test_a_marker_beside_the_com_is_where_places_are_read_and_loads_act(joint_model: JointModel) -> None:
    m = LOADED.with_body("coupler", com=(0.07, 0.02), marker=(0.05, -0.01)).with_body(
        "follower", com=(0.06, -0.01), marker=(0.05, 0.0)
    )
    m = m.with_clearances({"B": 1e-6}) if joint_model != "ideal" else m
    time = np.linspace(0, 0.1, 51)
    angle = 1 + 4 * time
    trace = follow(m, (time, angle), time, joint_model)
    worst = errors(trace, m, (angle, np.full(51, 4.0), np.zeros(51)))
    assert max(worst["_x"], worst["_y"]) < 5e-6
    assert max(worst["reaction"], worst["drive_torque"]) < (1e-5 if joint_model == "ideal" else 5e-4)
    static = ENGINE.simulate(request_of(m, "ideal", "static", angle))
    expected = kinetostatics(kinematics(Assembly(m), angle, 1.0), inertia=False).signals()
    for name in ("coupler_x", "coupler_y", "follower_x", "reaction_A_x", "drive_torque"):
        np.testing.assert_allclose(static.signals[name], expected[name], rtol=1e-9)


# ---------------------------------------------------------------- a motor behind a spring


class Crank:
    """The crank of an ideal linkage behind a spring as an ordinary differential equation, its coefficients from
    kinetostatics.
    """

    def __init__(self, m: Mechanism, motor: Callable[[float], float]) -> None:
        assert m.drive is not None
        assert m.drive.stiffness is not None
        theta = np.linspace(0, 2 * math.pi, 1025)
        torque = [
            kinetostatics(kinematics(Assembly(m), theta, w, a)).drive_torque
            for w, a in ((0.0, 0.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0))
        ]
        still, ahead, back, pushed = torque
        parts = np.array([still, (ahead - back) / 2, (ahead + back) / 2 - still, pushed - still]).T
        parts[-1] = parts[0]
        self.parts, self.motor, self.stiffness = CubicSpline(theta, parts, bc_type="periodic"), motor, m.drive.stiffness

    def acceleration(self, time: float, angle: float, rate: float) -> float:
        still, linear, square, inertia = self.parts(angle)
        return float((self.stiffness * (self.motor(time) - angle) - still - linear * rate - square * rate**2) / inertia)

    def run(self, start: np.ndarray, time: np.ndarray) -> np.ndarray:
        """Angle (rad), rate and acceleration at these times (s), (3, N)."""
        found = solve_ivp(
            lambda t, y: [y[1], self.acceleration(t, *y)],
            (time[0], time[-1]),
            start,
            t_eval=time,
            method="DOP853",
            rtol=1e-9,
            atol=1e-10,
        ).y
        return np.array([*found, [self.acceleration(t, *y) for t, y in zip(time, found.T, strict=True)]])

    def repeating(self, turn: float, time: np.ndarray) -> np.ndarray:
        """The motion that repeats itself, turned by ``turn`` (rad), over these times (s)."""
        start = np.array([self.motor(0.0), (self.motor(time[-1]) - self.motor(0.0)) / time[-1]])
        nudges = np.diag([1e-5, 1e-3])
        for _ in range(8):
            missed = [
                self.run(start + nudge, time[[0, -1]])[:2, -1] - start - nudge - [turn, 0]
                for nudge in (np.zeros(2), *nudges)
            ]
            start = start - np.linalg.solve(
                np.array([(m - missed[0]) / d.sum() for m, d in zip(missed[1:], nudges, strict=True)]).T, missed[0]
            )
            if np.abs(missed[0]).max() < 1e-9:
                break
        return self.run(start, time)


def sprung(m: Mechanism, stiffness: float, speed: float | str = SPEED) -> Mechanism:
    assert m.drive is not None
    return m.replace(drive=Drive(joint=m.drive.joint, speed=speed, stiffness=stiffness))


@pytest.mark.slow
@pytest.mark.parametrize("ripple", [0.0, 2e-3])
def test_a_crank_behind_a_spring_repeats_itself_as_its_differential_equation_does(ripple: float) -> None:
    m = sprung(LOADED.with_joint("B", damping=1e-4), 500.0)
    time = TURN[::4]
    motor = SPEED * time + ripple * np.sin(6 * SPEED * time + 0.3)
    request = (
        request_of(m, "ideal", "driven", motor)
        if not ripple
        else request_of(m, "ideal", "driven", time=time, course=(TURN, _rippled(TURN, ripple)))
    )
    trace = ENGINE.simulate(request)
    crank = Crank(m, lambda t: SPEED * t + ripple * math.sin(6 * SPEED * t + 0.3) if ripple else SPEED * t).repeating(
        2 * math.pi, time
    )
    assert np.abs(motor - crank[0]).max() > 1e-3
    assert np.ptp(motor - crank[0]) > 1e-3
    worst = errors(trace, m, tuple(crank))
    assert worst["_angle"] < 1e-6
    assert max(worst["reaction"], worst["drive_torque"]) < 5e-4
    np.testing.assert_allclose(
        motor - trace.signals["drive_torque"] / 500.0, trace.signals["crank_angle"], rtol=0, atol=1e-7
    )


def _rippled(time: np.ndarray, ripple: float) -> np.ndarray:
    return SPEED * time + ripple * np.sin(6 * SPEED * time + 0.3)


@pytest.mark.parametrize(
    ("m", "middle"),
    [pytest.param(LOADED, 1.0, id="crank-rocker", marks=pytest.mark.slow), pytest.param(PENDULUM, 0.0, id="pendulum")],
)
def test_an_oscillating_crank_behind_a_spring_does_not_sway(m: Mechanism, middle: float) -> None:
    m = sprung(m, 100.0, "measured")
    trace = follow(m, (SECOND, middle + SWING), SECOND)
    crank = Crank(m, lambda t: middle + 0.5 * math.sin(2 * math.pi * t)).repeating(0.0, SECOND)
    worst = errors(trace, m, tuple(crank))
    assert worst["_angle"] < 1e-6
    assert max(worst["reaction"], worst["drive_torque"]) < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("joint_model", ["ideal", "massless-link"])
def test_requested_angles_are_the_motors_where_the_crank_cannot_turn_fully(joint_model: JointModel) -> None:
    m = sprung(load("paper").with_clearances({"B": 1e-5}), 500.0, -(load("paper").speed or 0.0))
    asked = np.radians([120.0, 40.0, 80.0])
    trace = ENGINE.simulate(request_of(m, joint_model, "driven", asked))
    np.testing.assert_array_equal(trace.crank_angle, asked)
    np.testing.assert_allclose(trace.time, (np.radians(120) - asked) / abs(m.speed or 0.0), atol=1e-12)
    grid = np.radians(np.arange(20, 140.5, 0.5))
    lag = np.zeros(grid.size)
    for _ in range(6):  # crank = motor - torque / stiffness, over the motor's angle
        angle = CubicSpline(grid, grid - lag)
        motion = kinematics(
            Assembly(m), angle(grid), angle(grid, 1) * (m.speed or 0.0), angle(grid, 2) * (m.speed or 0.0) ** 2
        )
        lag = kinetostatics(motion).drive_torque / 500.0
    expected = np.interp(asked, grid, grid - lag)
    np.testing.assert_allclose(
        trace.signals["crank_angle"], expected, rtol=0, atol=2e-6 if joint_model == "ideal" else 1e-5
    )


# ---------------------------------------------------------------- refusals


def test_what_is_no_course_is_refused_in_words() -> None:
    with pytest.raises(ScheduleError, match="give times and a course"):
        Schedule.at_angles(PENDULUM, np.array([0.1]))
    with pytest.raises(Unsupported, match="not free"):
        ENGINE.simulate(request_of(load("pendulum"), time=SECOND, course=(SECOND, SWING)))
    with pytest.raises(Unsupported, match="outside the course"):
        follow(PENDULUM, (SECOND, SWING), np.array([0.5, 1.1]))
    with pytest.raises(AssemblyError):
        follow(load("paper"), (SECOND, 1.0 - 2 * SECOND), SECOND)

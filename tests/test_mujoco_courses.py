"""MuJoCo with a motor that follows a course, or yields, or both: against rigid-body kinetostatics and the crank's own
equation of motion.
"""

from __future__ import annotations

import csv
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import Gap, kinematics
from analytic.kinematics.schedule import Schedule, ScheduleError
from analytic.mechanism import Load, Mechanism
from analytic.mechanism.file import load
from analytic.paper.kinetostatics import Reactions, kinetostatics
from asked import request_of
from marks import slow
from sim_models.engine import JOINT_MODELS, JointModel, Motion, Trace, Unsupported
from sim_models.mujoco.engine import ENGINE

pytestmark = pytest.mark.mujoco

CLEARANCE_MODELS: tuple[JointModel, ...] = JOINT_MODELS[1:]
SPEED = 10 * np.pi  # rad/s
TURN = np.linspace(0.0, 2 * np.pi / SPEED, 721)  # s
SECOND = np.linspace(0.0, 1.0, 501)  # s
Course = tuple[np.ndarray, np.ndarray]


def driven_at(mechanism: Mechanism, speed: float | str, stiffness: float | None = None) -> Mechanism:
    assert mechanism.drive is not None
    return mechanism.replace(drive=mechanism.drive.model_copy(update={"speed": speed, "stiffness": stiffness}))


CRANK_ROCKER = driven_at(load("crank-rocker"), "measured").replace(gravity=(0.0, -9.81))
PENDULUM = driven_at(load("pendulum"), "measured")
PAPER = driven_at(load("paper"), "measured")
SWING = 0.5 * np.sin(2 * np.pi * SECOND)
RIPPLE = SPEED * TURN + 2e-3 * np.sin(6 * SPEED * TURN + 0.3)
COURSES: dict[str, tuple[Mechanism, Course]] = {
    "constant": (CRANK_ROCKER, (TURN, SPEED * TURN)),
    "backwards": (CRANK_ROCKER, (TURN, -SPEED * TURN)),
    "ripple": (CRANK_ROCKER, (TURN, RIPPLE)),
    "from-rest": (CRANK_ROCKER, (SECOND, 20.0 * SECOND**2)),
    "swing": (CRANK_ROCKER, (SECOND, SWING)),
    "begins-at-a-turning-point": (CRANK_ROCKER, (SECOND / 10, 0.5 * np.cos(2 * np.pi * SECOND))),
    "pendulum": (PENDULUM, (SECOND, SWING)),
    "standing": (CRANK_ROCKER, (SECOND, np.full(SECOND.size, 0.5))),
    "few-knots": (CRANK_ROCKER, (SECOND[::50], SWING[::50])),
    "late-clock": (CRANK_ROCKER, (SECOND + 5.0, SWING)),
    "slider": (
        driven_at(load("slider-crank"), "measured").with_joint("S", damping=1.5),
        (SECOND, 6 * SECOND + SWING / 10),
    ),
    "friction": (
        CRANK_ROCKER.with_joint("E", friction_torque=0.02).with_joint("B", damping=0.002),
        (SECOND, 1.5 * SECOND**2),
    ),
}


def follow(mechanism: Mechanism, course: Course, time: np.ndarray, model: JointModel = "ideal") -> Trace:
    return ENGINE.simulate(request_of(mechanism, model, "driven", time=time, course=course))


def anywhere(course: Course, count: int = 60, seed: int = 1) -> np.ndarray:
    """Instants (s) of a course in no order, both ends among them."""
    inside = np.random.default_rng(seed).uniform(course[0][0], course[0][-1], count)
    return np.concatenate([inside, course[0][[-1, 0]]])


def rigid(mechanism: Mechanism, course: Course, time: np.ndarray) -> Reactions:
    spline = CubicSpline(*course)
    return kinetostatics(kinematics(Assembly(mechanism), spline(time), spline(time, 1), spline(time, 2)))


def error(seen: Mapping[str, np.ndarray], truth: Mapping[str, np.ndarray], prefix: str) -> float:
    """Largest error of the signals with this prefix, of the largest value among them."""
    names = [n for n in truth if n.startswith(prefix) and not n.endswith("_moment")]
    return float(max(np.abs(seen[n] - truth[n]).max() for n in names) / max(np.abs(truth[n]).max() for n in names))


def angle_error(seen: Mapping[str, np.ndarray], truth: Mapping[str, np.ndarray]) -> float:
    return max(float(np.abs(seen[n] - truth[n]).max()) for n in truth if n.endswith("_angle"))


@pytest.mark.parametrize("name", COURSES)
def test_a_course_is_followed_with_the_forces_of_its_acceleration(name: str) -> None:
    mechanism, course = COURSES[name]
    time = anywhere(course)
    trace, truth, spline = (
        follow(mechanism, course, time),
        rigid(mechanism, course, time).signals(),
        CubicSpline(*course),
    )
    np.testing.assert_allclose(trace.crank_angle, spline(time), rtol=0, atol=1e-11)
    np.testing.assert_allclose(
        trace.signals[f"{mechanism.driven}_angular_velocity"], spline(time, 1), rtol=0, atol=1e-10
    )
    np.testing.assert_array_equal(trace.time, time)
    assert angle_error(trace.signals, truth) < 1e-7
    assert error(trace.signals, truth, "reaction") < 2e-4
    assert error(trace.signals, truth, "drive_torque") < 5e-4
    for body in mechanism.moving:
        scale = np.abs(spline(SECOND * course[0][-1], 1)).max() + 1e-3
        np.testing.assert_allclose(
            trace.signals[f"{body}_angular_velocity"], truth[f"{body}_angular_velocity"], atol=1e-5 * scale
        )
        np.testing.assert_allclose(trace.signals[f"{body}_x"], truth[f"{body}_x"], atol=1e-8)


@pytest.mark.parametrize("model", ["ideal", *slow(*CLEARANCE_MODELS)])
def test_a_course_of_constant_speed_is_the_same_as_the_speed(model: JointModel) -> None:
    theta = np.radians(np.arange(20.0, 161.0, 5.0))
    mechanism = load("paper").with_clearances({"B": 1e-3})
    speed = mechanism.speed
    assert speed is not None
    ends = np.linspace(theta[0], theta[-1], 50)
    along = follow(
        mechanism,
        ((ends - theta[0]) / speed, ends),
        np.minimum((theta - theta[0]) / speed, (ends[-1] - theta[0]) / speed),
        model,
    )
    steadily = ENGINE.simulate(request_of(mechanism, model, "driven", theta))
    assert angle_error(along.signals, steadily.signals) < 1e-6
    for prefix in ("reaction", "drive_torque"):
        assert error(along.signals, steadily.signals, prefix) < 1e-4


def on_the_rim(
    mechanism: Mechanism, joint: str, course: Course, size: float, stiffness: float
) -> tuple[np.ndarray, Reactions]:
    """Times, and the linkage with one pin always pressed: gap along its own reaction, with the gap's own rates and
    accelerations.
    """
    time, spline = np.linspace(course[0][0], course[0][-1], 251), CubicSpline(*course)
    found, gap = rigid(mechanism, course, time), np.zeros(time.size, complex)
    for _ in range(8):
        force = found.forces[joint]
        change, gap = gap, (size + np.abs(force) / stiffness) * force / np.abs(force)
        moving = Gap(gap, *(CubicSpline(time, gap)(time, order) for order in (1, 2)))
        found = kinetostatics(
            kinematics(Assembly(mechanism), spline(time), spline(time, 1), spline(time, 2), {joint: moving})
        )
    assert np.abs(gap - change).max() < 1e-6 * size
    return time, found


@pytest.mark.parametrize("model", CLEARANCE_MODELS)
@pytest.mark.parametrize("case", [*slow("paper"), "loaded-crank-rocker"])
def test_loose_pins_begin_pressed_and_stay_so(case: str, model: JointModel) -> None:
    mechanism, start = PAPER, 1.2
    if case != "paper":
        mechanism, start = CRANK_ROCKER.replace(loads=(Load(body="follower", force=(40.0, 0.0)),)), 0.0
    course = SECOND, start + SWING
    size, time = 2e-4, np.sort(anywhere(course))
    trace = follow(mechanism.with_clearances({"B": size}), course, time, model)
    grid, truth = on_the_rim(mechanism, "B", course, size, trace.settings.get("contact_stiffness", np.inf))
    right = {name: CubicSpline(grid, values)(time) for name, values in truth.signals().items()}
    np.testing.assert_allclose(trace.crank_angle, CubicSpline(*course)(time), rtol=0, atol=1e-11)
    assert trace.settings["start"] == "equilibrium"
    assert trace.free_share["B"] == 0
    assert angle_error(trace.signals, right) < 5e-6
    assert error(trace.signals, right, "reaction") < 5e-4  # from the first instant on, so nothing rattles
    assert error(trace.signals, right, "drive_torque") < 5e-4
    assert error(trace.signals, right, "clearance") < 1e-3


@pytest.mark.parametrize("model", ["spring-damper", *slow("contact")])
def test_reports_may_be_unevenly_spaced(model: JointModel) -> None:
    mechanism = load("paper").with_clearances({"B": 1e-3})
    even = np.radians(np.arange(20.0, 161.0, 10.0))
    uneven = np.sort(np.concatenate([even, even[:-1] + np.radians(0.0007), even[3:-1] + np.radians(7.3)]))
    seen, right = (ENGINE.simulate(request_of(mechanism, model, "driven", theta)).signals for theta in (uneven, even))
    pick = np.searchsorted(uneven, even)
    for name in ("reaction_B_x", "reaction_B_y", "drive_torque"):
        np.testing.assert_allclose(seen[name][pick], right[name], atol=1e-4 * np.abs(right[name]).max())
    np.testing.assert_allclose(seen["follower_angular_velocity"][pick], right["follower_angular_velocity"], rtol=1e-4)


@dataclass(frozen=True)
class Crank:
    """A crank on a spring as one degree of freedom: inertia(theta) alpha + rest(theta, omega) = stiffness (motor -
    theta).
    """

    stiffness: float
    inertia: CubicSpline
    weight: CubicSpline  # rest at zero speed
    centripetal: CubicSpline  # and its part by the square of the speed

    @classmethod
    def of(cls, mechanism: Mechanism, stiffness: float) -> Crank:
        """From the drive torque of the rigid linkage, which is linear in the crank's acceleration and in its speed
        squared.
        """
        theta = np.linspace(-2 * np.pi, 4 * np.pi, 4321)
        at_rest, turning, accelerated = (
            kinetostatics(kinematics(Assembly(mechanism), theta, omega, alpha)).drive_torque
            for omega, alpha in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))
        )
        return cls(
            stiffness, *(CubicSpline(theta, values) for values in (accelerated - at_rest, at_rest, turning - at_rest))
        )

    def moves(self, motor: CubicSpline, time: np.ndarray, theta: float, omega: float) -> np.ndarray:
        """The crank's angle (rad) at these times (s), from its state at the first of them."""

        def rates(t: float, y: np.ndarray) -> list[float]:
            rest = self.weight(y[0]) + self.centripetal(y[0]) * y[1] ** 2
            return [y[1], float((self.stiffness * (motor(t) - y[0]) - rest) / self.inertia(y[0]))]

        found = solve_ivp(rates, (time[0], time[-1]), [theta, omega], "DOP853", t_eval=time, rtol=1e-10, atol=1e-12)
        assert found.success, found.message
        return np.asarray(found.y[0])


@pytest.mark.parametrize("course", ["speed", "ripple"])
@pytest.mark.parametrize("stiffness", [*slow(50.0), 200.0, *slow(2000.0)])
def test_a_crank_on_a_spring_moves_as_its_equation_says_and_repeats_itself(stiffness: float, course: str) -> None:
    nominal = CRANK_ROCKER
    angle = RIPPLE if course == "ripple" else SPEED * TURN
    if course == "ripple":
        trace = follow(driven_at(nominal, "measured", stiffness), (TURN, angle), TURN[::6])
    else:
        trace = ENGINE.simulate(request_of(driven_at(nominal, SPEED, stiffness), crank_angle=angle[::6]))
    crank, omega = trace.signals["crank_angle"], trace.signals["crank_angular_velocity"]
    moved = Crank.of(nominal, stiffness).moves(CubicSpline(TURN, angle), TURN[::6], float(crank[0]), float(omega[0]))
    lag = angle[::6] - crank
    assert np.abs(crank - moved).max() < 1e-6
    np.testing.assert_allclose(lag, trace.signals["drive_torque"] / stiffness, rtol=0, atol=1e-10)
    assert np.abs(lag).max() > 1e-4
    np.testing.assert_allclose(
        lag[-1], lag[0], rtol=0, atol=2e-7
    )  # a crank that swayed beside its steady motion would not be back
    assert omega[-1] == pytest.approx(omega[0], abs=1e-5 * SPEED)


@pytest.mark.parametrize("stiffness", [50.0, 2000.0])
def test_a_crank_on_a_spring_lags_a_swinging_motor_without_swaying(stiffness: float) -> None:
    mechanism, time = CRANK_ROCKER, SECOND[::5]
    trace = follow(driven_at(mechanism, "measured", stiffness), (SECOND, SWING), time)
    crank = CubicSpline(SECOND, SWING)(SECOND)
    for _ in range(4):  # the crank where the torque of its own motion lets it be
        moving = CubicSpline(SECOND, crank)
        crank = (
            SWING
            - kinetostatics(kinematics(Assembly(mechanism), crank, moving(SECOND, 1), moving(SECOND, 2))).drive_torque
            / stiffness
        )
    lag = SWING - crank
    assert stiffness * np.abs(lag).max() > 0.05
    assert np.abs(trace.signals["crank_angle"] - crank[::5]).max() < 1e-6
    assert np.abs(trace.signals["drive_torque"] - stiffness * lag[::5]).max() < 1e-3 * stiffness * np.abs(lag).max()


def test_a_wound_up_spring_does_not_pass_for_a_motion_that_repeats_itself() -> None:
    mechanism = driven_at(CRANK_ROCKER, SPEED, 200.0).with_joint("D", stiffness=0.1)
    trace = ENGINE.simulate(request_of(mechanism, crank_angle=SPEED * TURN[::6]))
    assert trace.settings["start"] == "equilibrium"
    wound = -0.1 * (trace.signals["crank_angle"][-1] - trace.signals["crank_angle"][0])
    assert trace.signals["drive_torque"][-1] - trace.signals["drive_torque"][0] == pytest.approx(-wound, rel=0.02)


@pytest.mark.parametrize("motion", ["driven", "static"])
@pytest.mark.parametrize("model", ["ideal", "contact"])
def test_a_marker_is_not_the_centre_of_mass(model: JointModel, motion: Motion) -> None:
    coupler = load("crank-rocker").body("coupler")
    beside = (0.03, 0.02)
    plain = load("crank-rocker").replace(gravity=(0.0, -9.81)).with_joint("B", clearance=2e-4)
    named = plain.with_body("coupler", points={**coupler.points, "P": beside}, com=(0.07, -0.01), inertia=1.2e-4)
    marked = plain.with_body("coupler", marker=beside, com=(0.07, -0.01), inertia=1.2e-4)
    push = Load(body="coupler", force=(30.0, 50.0))
    theta = np.radians(np.arange(0.0, 91.0, 15.0))
    at_point = ENGINE.simulate(
        request_of(named.replace(loads=(push.model_copy(update={"point": "P"}),)), model, motion, theta)
    ).signals
    at_marker = ENGINE.simulate(request_of(marked.replace(loads=(push,)), model, motion, theta)).signals
    for name in set(at_point) - {"coupler_x", "coupler_y"}:
        np.testing.assert_allclose(at_marker[name], at_point[name], atol=1e-9, err_msg=name)
    turned = np.exp(1j * at_point["coupler_angle"]) * (complex(*beside) - complex(0.07, -0.01))
    np.testing.assert_allclose(at_marker["coupler_x"], at_point["coupler_x"] + turned.real, atol=1e-12)
    np.testing.assert_allclose(at_marker["coupler_y"], at_point["coupler_y"] + turned.imag, atol=1e-12)


@pytest.mark.parametrize("model", slow("ideal", "contact"))
def test_an_exported_course_runs_in_mujoco_alone(model: JointModel, tmp_path: Path) -> None:
    mechanism = CRANK_ROCKER.replace(loads=(Load(body="follower", force=(40.0, 0.0)),)).with_body(
        "follower", marker=(0.07, 0.01)
    )
    mechanism = driven_at(mechanism, "measured", 200.0) if model == "ideal" else mechanism.with_clearances({"B": 2e-4})
    time = np.sort(np.random.default_rng(3).uniform(0.0, 0.3, 10))
    ENGINE.export(request_of(mechanism, model, "driven", time=time, course=(SECOND, SWING)), tmp_path)
    subprocess.run([sys.executable, "run.py"], cwd=tmp_path, check=True, capture_output=True)
    expected, found = (
        list(csv.DictReader((tmp_path / name).read_text(encoding="utf-8").splitlines()))
        for name in ("expected.csv", "signals.csv")
    )
    assert len(found) == time.size
    for right, seen in zip(expected, found, strict=True):
        for name, value in right.items():
            assert float(seen[name]) == pytest.approx(float(value), rel=1e-7, abs=1e-7), name


def test_a_course_needs_a_motor_that_can_follow_it() -> None:
    request = {"time": SECOND, "course": (SECOND, SWING)}
    with pytest.raises(Unsupported, match="only a drive that is not free follows a course"):
        ENGINE.simulate(request_of(load("pendulum"), **request))
    with pytest.raises(Unsupported, match="leave out lead_in = 1 rad"):
        ENGINE.simulate(request_of(CRANK_ROCKER, lead_in=1.0, **request))
    with pytest.raises(ScheduleError, match="give times and a course"):
        Schedule.at_angles(CRANK_ROCKER, SWING)
    with pytest.raises(Unsupported, match="outside the course"):
        follow(CRANK_ROCKER, (SECOND, SWING), SECOND + 0.1)


def test_reports_a_billionth_of_a_second_apart_are_followed() -> None:
    """The cubic between two such instants is rounding, and its slope was larger than MuJoCo takes for a control."""
    mechanism, course = COURSES["ripple"]
    time = np.sort(np.concatenate([TURN[10:-10:40], TURN[10:-10:40] + 1e-9]))
    trace = ENGINE.simulate(request_of(mechanism, time=time, course=course))
    apart = np.abs(np.diff(trace.signals["drive_torque"].reshape(-1, 2), axis=1))
    assert apart.max() < 1e-4 * np.abs(trace.signals["drive_torque"]).max()

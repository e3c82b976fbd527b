"""DART and PyBullet with a motor that turns unevenly, or on a spring, and with reports at any time: against the
analytic model.
"""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import kinematics
from analytic.mechanism import Drive, Load, Mechanism
from analytic.mechanism.file import load
from analytic.paper.clearance import displaced
from analytic.paper.kinetostatics import kinetostatics
from asked import request_of
from engine_checks import vector
from linkages import inverted_slider
from marks import slow
from sim_models.engine import Engine, JointModel, SimulationError, Trace, Unsupported

PACKAGES = {"dart": "dartpy", "pybullet": "pybullet"}
MODELS: list[tuple[str, JointModel]] = [("dart", "spring-damper"), ("dart", "contact"), ("pybullet", "spring-damper")]
MEASURED = Drive(joint="D", speed="measured")
GRAVITY = (0.0, -9.81)
ROCKER = load("crank-rocker")
TURN = np.linspace(0.0, 0.2, 181)  # s, a revolution of the crank-rocker's crank
EVEN = 10 * np.pi * TURN


def engine(name: str) -> Engine:
    found: Engine = importlib.import_module(f"sim_models.{name}.engine").ENGINE
    return found


@pytest.fixture(params=PACKAGES)
def leapfrog(request: pytest.FixtureRequest) -> Engine:
    return engine(request.param)


def expected(m: Mechanism, course: tuple[np.ndarray, np.ndarray], time: np.ndarray) -> dict[str, np.ndarray]:
    """Signals of the ideal linkage on a course, at times (s)."""
    spline = CubicSpline(*course)
    return kinetostatics(kinematics(Assembly(m), spline(time), spline(time, 1), spline(time, 2))).signals()


def assert_agrees(trace: Trace, truth: dict[str, np.ndarray], relative: float, angle: float = 1e-7) -> None:
    """Positions (m) and angles (rad) to ``angle``; forces, torques and rates to ``relative`` of the largest of their
    kind.
    """
    force = max(
        np.abs(values).max()
        for name, values in truth.items()
        if name.startswith("reaction") and name[-2:] in ("_x", "_y")
    )
    for name, values in truth.items():
        if name.startswith("reaction") and name[-2:] in ("_x", "_y"):
            allowed = relative * force
        elif name.startswith(("reaction", "drive")) or name.endswith("velocity"):
            allowed = relative * max(float(np.abs(values).max()), 0.1)
        else:
            allowed = angle
        np.testing.assert_allclose(trace.signals[name], values, rtol=0, atol=allowed, err_msg=name)


# ---------------------------------------------------------------- ideal joints


@pytest.mark.parametrize(
    "angles",
    [
        pytest.param(EVEN, id="constant speed", marks=pytest.mark.slow),
        pytest.param(-EVEN, id="in reverse", marks=pytest.mark.slow),
        pytest.param(EVEN + 2e-3 * np.sin(6 * EVEN), id="ripple"),
        pytest.param(EVEN - np.sin(EVEN), id="from rest", marks=pytest.mark.slow),
        pytest.param(0.5 * np.sin(EVEN), id="oscillation", marks=pytest.mark.slow),
    ],
)
def test_a_course_gives_the_forces_of_its_own_acceleration(leapfrog: Engine, angles: np.ndarray) -> None:
    m = ROCKER.replace(drive=MEASURED, gravity=GRAVITY)
    trace = leapfrog.simulate(request_of(m, course=(TURN, angles), time=TURN))
    assert_agrees(trace, expected(m, (TURN, angles), TURN), 1e-4)
    np.testing.assert_allclose(trace.signals["crank_angle"], angles, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(trace.crank_angle, trace.signals["crank_angle"])


def test_a_pendulum_on_a_motor_swings_as_told(leapfrog: Engine) -> None:
    m = load("pendulum").replace(drive=Drive(joint="O", speed="measured"))
    time = np.linspace(0.0, 1.0, 101)
    course = (time, Assembly(m).start + 0.5 * np.sin(2 * np.pi * time))
    assert_agrees(leapfrog.simulate(request_of(m, course=course, time=time)), expected(m, course, time), 5e-5)


def test_a_course_may_stand_still(leapfrog: Engine) -> None:
    m = ROCKER.replace(gravity=GRAVITY)
    course = (TURN, np.full(TURN.size, 0.7))
    assert_agrees(
        leapfrog.simulate(request_of(m, course=course, time=TURN[::20])), expected(m, course, TURN[::20]), 1e-7
    )


@pytest.mark.parametrize("leapfrog", slow("dart", "pybullet"), indirect=True)
def test_joint_laws_and_slides_on_a_course(leapfrog: Engine) -> None:
    m = inverted_slider()
    assert m.speed is not None
    time = np.linspace(0.0, 2 * np.pi / abs(m.speed), 121)
    command = m.speed * time
    course = (time, Assembly(m).start + command + 2e-3 * np.sin(6 * command))
    motion = kinematics(Assembly(m), course[1], m.speed)
    rubbing = [motion.travel("S")[1], motion.angular_velocity(m.joint("C").bodies[1])]
    time = time[
        np.all([np.abs(rate) > 0.02 * np.abs(rate).max() for rate in rubbing], axis=0)
    ]  # at a reversal friction has no direction
    assert_agrees(leapfrog.simulate(request_of(m, course=course, time=time)), expected(m, course, time), 5e-4)


@pytest.mark.slow
def test_reports_at_any_time_in_any_order(leapfrog: Engine) -> None:
    course = (TURN, EVEN + 2e-3 * np.sin(6 * EVEN))
    time = np.random.default_rng(3).uniform(0.07, 0.2, 30)
    time = np.append(time, [time[4], 0.2])
    trace = leapfrog.simulate(request_of(ROCKER, course=course, time=time))
    assert trace.time is not None
    np.testing.assert_array_equal(trace.time, time)
    assert_agrees(trace, expected(ROCKER, course, time), 1e-4)


def test_unequal_angles_and_times_change_no_force(leapfrog: Engine) -> None:
    """Steps of changing size would: an engine closes loops by the drift of the step before."""
    angles = np.sort(np.random.default_rng(5).uniform(0.0, 2.0, 25))
    trace = leapfrog.simulate(request_of(ROCKER, crank_angle=angles))
    assert_agrees(trace, kinetostatics(kinematics(Assembly(ROCKER), angles, ROCKER.speed or 0.0)).signals(), 1e-4)
    free = ROCKER.replace(drive=Drive(joint="D", speed="free"), gravity=GRAVITY)
    time = np.linspace(0.0, 0.05, 51)
    chosen = np.array([0, 3, 4, 11, 28, 29, 50])
    moved = time[chosen] + np.array([0.0, 1e-4, -2e-4, 3e-4, 0.0, 1e-4, 0.0])
    every, some = (leapfrog.simulate(request_of(free, time=t, start_speed=10.0)) for t in (time, moved))
    for name in ("reaction_B_x", "reaction_D_y", "follower_angular_velocity"):
        smooth = CubicSpline(time, every.signals[name])(moved)
        np.testing.assert_allclose(
            some.signals[name], smooth, rtol=0, atol=5e-4 * np.abs(every.signals[name]).max(), err_msg=name
        )


# ---------------------------------------------------------------- clearance


@pytest.mark.slow
@pytest.mark.parametrize(("name", "joint_model"), MODELS)
@pytest.mark.parametrize(
    "shape", [lambda t: 3 * t**2, lambda t: 0.3 * np.cos(2 * np.pi * t)], ids=["from rest", "from its end"]
)
def test_pins_start_pressed_and_stay_so_on_a_course(
    name: str, joint_model: JointModel, shape: Callable[[np.ndarray], np.ndarray]
) -> None:
    m = load("paper").with_clearances({"B": 1e-3}).replace(drive=MEASURED)
    time = np.linspace(0.0, 0.2, 41)
    course = (time, 1.0 + shape(time))
    trace = engine(name).simulate(request_of(m, joint_model, course=course, time=time))
    spline = CubicSpline(*course)
    found = displaced(Assembly(m), spline(time), spline(time, 1), alpha=spline(time, 2))
    assert not found.flags
    truth = found.signals()
    exact = truth["reaction_B_x"] + 1j * truth["reaction_B_y"]
    np.testing.assert_allclose(vector(trace, "reaction_B"), exact, rtol=0, atol=1e-4 * np.abs(exact).max())
    np.testing.assert_allclose(
        trace.signals["drive_torque"], truth["drive_torque"], rtol=0, atol=1e-4 * np.abs(truth["drive_torque"]).max()
    )
    assert trace.free_share == {"B": 0.0}


# ---------------------------------------------------------------- a motor on a spring


def on_spring(m: Mechanism, stiffness: float) -> Mechanism:
    assert m.drive is not None
    return m.replace(drive=m.drive.model_copy(update={"stiffness": stiffness}))


def crank_on_spring(
    m: Mechanism, stiffness: float, motor: CubicSpline, time: np.ndarray, start: list[float]
) -> np.ndarray:
    """Angle (rad) of an ideal linkage's crank behind a motor, by its equation of motion: inertia times acceleration,
    and the rest.
    """
    assembly = Assembly(m)

    def rates(t: float, state: np.ndarray) -> list[float]:
        theta, omega = state
        needs = [
            float(kinetostatics(kinematics(assembly, np.array([theta]), omega, alpha)).drive_torque[0])
            for alpha in (0.0, 1.0)
        ]
        return [omega, (stiffness * (float(motor(t)) - theta) - needs[0]) / (needs[1] - needs[0])]

    return np.asarray(solve_ivp(rates, (time[0], time[-1]), start, t_eval=time, rtol=1e-9, atol=1e-12).y[0])


@pytest.mark.slow
@pytest.mark.parametrize("leapfrog", ["dart", *slow("pybullet")], indirect=True)
def test_a_crank_on_a_spring_moves_by_its_equation_of_motion(leapfrog: Engine) -> None:
    time, stiffness = TURN[:16], 2000.0
    motor = CubicSpline(TURN, EVEN + 2e-3 * np.sin(6 * EVEN))
    trace = leapfrog.simulate(request_of(on_spring(ROCKER, stiffness), course=(TURN, motor(TURN)), time=time))
    crank = trace.signals["crank_angle"]
    exact = crank_on_spring(ROCKER, stiffness, motor, time, [crank[0], trace.signals["crank_angular_velocity"][0]])
    assert np.abs(motor(time) - crank).max() > 1e-4
    np.testing.assert_allclose(crank, exact, rtol=0, atol=3e-8)
    np.testing.assert_allclose(trace.signals["drive_torque"], stiffness * (motor(time) - crank), rtol=0, atol=1e-10)


@pytest.mark.parametrize("stiffness", slow(2000.0, 1e5))
def test_a_crank_on_a_spring_starts_in_steady_motion(leapfrog: Engine, stiffness: float) -> None:
    """What it does in a revolution it does in the next: it has no oscillation of its own."""
    angles = np.concatenate([np.linspace(0.0, 0.5, 51), 2 * np.pi + np.linspace(0.0, 0.5, 51)])
    trace = leapfrog.simulate(request_of(on_spring(ROCKER, stiffness), crank_angle=angles))
    np.testing.assert_array_equal(trace.crank_angle, angles)
    torque = trace.signals["drive_torque"]
    np.testing.assert_allclose(
        stiffness * (angles - trace.signals["crank_angle"]), torque, rtol=0, atol=stiffness * 1e-9
    )
    first, second = torque[:51], torque[51:]
    np.testing.assert_allclose(first, second, rtol=0, atol=3e-4 * np.abs(torque).max())
    assert np.abs(np.diff(first, 2)).max() < 2e-3 * np.abs(torque).max()


@pytest.mark.parametrize(("name", "joint_model"), MODELS)
def test_a_motor_on_a_spring_and_a_pin_with_clearance(name: str, joint_model: JointModel) -> None:
    m = load("paper").with_clearances({"B": 1e-3})
    assert m.speed is not None
    angles = np.radians(np.linspace(50.0, 60.0, 31))
    trace = engine(name).simulate(request_of(on_spring(m, 2000.0), joint_model, crank_angle=angles))
    crank = trace.signals["crank_angle"]
    speed = np.gradient(crank, angles) * m.speed
    found = displaced(Assembly(m), crank, speed).signals()
    np.testing.assert_allclose(
        trace.signals["drive_torque"], found["drive_torque"], rtol=0, atol=3e-4 * np.abs(found["drive_torque"]).max()
    )
    np.testing.assert_allclose(trace.signals["follower_angle"], found["follower_angle"], rtol=0, atol=2e-5)


def test_at_rest_a_crank_lags_its_motor_too(leapfrog: Engine) -> None:
    m, angles = load("paper"), np.radians([40.0, 90.0, 140.0])
    trace = leapfrog.simulate(request_of(on_spring(m, 500.0), motion="static", crank_angle=angles))
    crank = trace.signals["crank_angle"]
    torque = kinetostatics(kinematics(Assembly(m), crank, 1.0), inertia=False).drive_torque
    np.testing.assert_allclose(crank, angles - torque / 500.0, rtol=0, atol=1e-8)
    np.testing.assert_allclose(trace.signals["drive_torque"], torque, rtol=1e-5, atol=1e-7)


def test_a_motor_near_resonance_is_refused(leapfrog: Engine) -> None:
    with pytest.raises(SimulationError, match=r"no steady motion of the crank on a drive\.stiffness of 20 N\.m/rad"):
        leapfrog.simulate(request_of(on_spring(ROCKER, 20.0), crank_angle=np.array([0.0, 1.0])))


# ---------------------------------------------------------------- markers


@pytest.mark.parametrize("motion", [*slow("driven"), "static"])
def test_signals_and_loads_are_at_the_marker_and_mass_is_not(leapfrog: Engine, motion: str) -> None:
    m = ROCKER.replace(gravity=GRAVITY, loads=(Load(body="coupler", point="com", force=(30.0, 20.0)),))
    for body, com, marker in (
        ("crank", (0.06, 0.01), (0.02, -0.03)),
        ("coupler", (0.15, 0.02), (0.3, 0.05)),
        ("follower", (0.1, -0.02), (0.2, 0.0)),
    ):
        m = m.with_body(body, com=com, marker=marker)
    angles = np.linspace(0.0, 6.0, 13)
    driven = motion == "driven"
    truth = kinetostatics(kinematics(Assembly(m), angles, m.speed or 0.0), inertia=driven).signals()
    if not driven:
        truth = {name: values for name, values in truth.items() if not name.endswith("velocity")}
    assert_agrees(
        leapfrog.simulate(request_of(m, motion="driven" if driven else "static", crank_angle=angles)), truth, 1e-4
    )


# ---------------------------------------------------------------- what is refused


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"mechanism": ROCKER.replace(drive=Drive(joint="D", speed="free"))}, "leave the course out of a released run"),
        ({"lead_in": 0.1}, r"leave out lead_in = 0\.1 rad"),
        ({"time": np.array([0.1, 0.3])}, "reports are wanted outside the course"),
    ],
)
def test_what_makes_no_course_is_refused(leapfrog: Engine, change: dict[str, object], why: str) -> None:
    given: dict[str, object] = {"mechanism": ROCKER.replace(drive=MEASURED), "course": (TURN, EVEN), "time": TURN}
    with pytest.raises(Unsupported, match=why):
        leapfrog.simulate(request_of(**(given | change)))

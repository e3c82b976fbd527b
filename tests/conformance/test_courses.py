"""Every engine's motor on a course, behind a spring, or both: against rigid-body kinetostatics and the equation of
motion of the crank; markers beside centres of mass; and what makes no course.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.motion import Gap, kinematics
from analytic.mechanism import Drive, Load, Mechanism
from analytic.mechanism.file import load
from analytic.paper.clearance import displaced
from analytic.paper.kinetostatics import Reactions, kinetostatics
from asked import request_of
from engine_checks import (
    LOOSE,
    Signals,
    assert_signals,
    at_speed,
    declared_runs,
    ideal_signals,
    is_force,
    off,
    run,
    vector,
)
from linkages import inverted_slider
from marks import slow, slow_but
from sim_models.engine import ENGINES, MOTIONS, Cause, JointModel, Motion, SimulationError, Unsupported, engine

SPEED = 10 * np.pi  # rad/s
TURN = np.linspace(0.0, 2 * np.pi / SPEED, 721)  # s
SECOND = np.linspace(0.0, 1.0, 501)  # s
SWING = 0.5 * np.sin(2 * np.pi * SECOND)
RIPPLE = SPEED * TURN + 2e-3 * np.sin(6 * SPEED * TURN + 0.3)
Course = tuple[np.ndarray, np.ndarray]

ROCKER = at_speed(load("crank-rocker"), "measured").replace(gravity=(0.0, -9.81))
LOADED = ROCKER.replace(
    loads=(Load(body="follower", force=(80.0, -80.0)), Load(body="coupler", force=(0.0, 1.0), torque=0.05))
)
PENDULUM = at_speed(load("pendulum"), "measured")
SLIDER = at_speed(load("slider-crank"), "measured").with_joint("S", damping=1.5)
RUBBED = ROCKER.with_joint("E", friction_torque=0.02).with_joint("B", damping=0.002)
LAWS = at_speed(inverted_slider(), "measured")
COURSES: dict[str, tuple[Mechanism, Course]] = {
    "backwards": (ROCKER, (TURN, -SPEED * TURN)),
    "ripple": (ROCKER, (TURN, RIPPLE)),
    "from rest": (ROCKER, (SECOND, 20.0 * SECOND**2)),
    "swing": (ROCKER, (SECOND, SWING)),
    "back, then on": (LOADED, (SECOND, 1 + 3 * SECOND * (SECOND - 0.6))),
    "begins at a turning point": (ROCKER, (SECOND / 10, 0.5 * np.cos(2 * np.pi * SECOND))),
    "pendulum": (PENDULUM, (SECOND, SWING)),
    "pendulum that rubs": (PENDULUM.with_joint("O", friction_torque=0.02, damping=0.003), (SECOND, SWING)),
    "standing": (ROCKER, (SECOND, np.full(SECOND.size, 0.5))),
    "late, with few knots": (LOADED, (SECOND[::25] + 7.0, 1 + SWING[::25])),
    "slider": (SLIDER, (SECOND, 6 * SECOND + SWING / 10)),
    "friction": (RUBBED, (SECOND, 1.5 * SECOND**2)),
    "every law of a joint": (LAWS, (TURN, Assembly(LAWS).start - 20.0 * TURN + 2e-3 * np.sin(120.0 * TURN))),
}
# Angle of the crank (rad), other angles and places (rad, m), forces, torques and rates (of the largest of their kind).
WITHIN = {
    "mujoco": (1e-11, 1e-7, 2e-4),
    "exudyn": (1e-7, 1e-6, 2e-4),
    "pybullet": (1e-11, 1e-7, 3e-4),
    "dart": (1e-11, 1e-7, 3e-4),
}


def rigid(m: Mechanism, course: Course, time: np.ndarray, gaps: dict[str, Gap] | None = None) -> Reactions:
    spline = CubicSpline(*course)
    return kinetostatics(kinematics(Assembly(m), spline(time), spline(time, 1), spline(time, 2), gaps))


def anywhere(m: Mechanism, course: Course, until: float) -> np.ndarray:
    """Instants (s) of the first part of a course in no order, its beginning among them; those apart at which friction
    is just about to turn round.
    """
    begin, end = course[0][[0, -1]]
    time = begin + until * (end - begin) * np.random.default_rng(3).uniform(0.0, 1.0, 40)
    time = np.concatenate([time, [begin + until * (end - begin), begin]])
    spline = CubicSpline(*course)
    motion = kinematics(Assembly(m), spline(time), spline(time, 1))
    clear = np.ones(time.size, bool)
    for joint in m.joints:
        if joint.friction_torque:
            slip = np.abs(motion.slip(joint))
            clear &= slip > 0.02 * slip.max()
    return time[clear]


EARLY, LATER = 0.15, 0.6  # of a course, in the short part of the suite and in the long one
SHORT = [("mujoco", case, EARLY) for case in COURSES if case not in ("backwards", "standing")]
SHORT += [("exudyn", case, EARLY) for case in ("pendulum", "pendulum that rubs", "late, with few knots", "ripple")]
SHORT += [("pybullet", case, EARLY) for case in ("pendulum", "ripple")]
SHORT += [("dart", case, EARLY) for case in ("standing", "ripple", "pendulum")]
EVERY = [(name, case, LATER) for name in ENGINES for case in COURSES]


@pytest.mark.long_rows(
    "pybullet-ripple-0.15", "mujoco-late, with few knots-0.15", "exudyn-ripple-0.15", "mujoco-friction-0.15",
    "mujoco-slider-0.15", "mujoco-every law of a joint-0.15", "dart-ripple-0.15", "exudyn-late, with few knots-0.15",
    "mujoco-from rest-0.15", "mujoco-back, then on-0.15", "exudyn-pendulum-0.15", "mujoco-ripple-0.15",
    "mujoco-pendulum-0.15",
)  # fmt: skip
@pytest.mark.parametrize(("name", "case", "until"), [*SHORT, *slow(*EVERY)])
def test_a_course_is_followed_with_the_forces_of_its_acceleration(name: str, case: str, until: float) -> None:
    m, course = COURSES[case]
    time, spline = anywhere(m, course, until), CubicSpline(*course)
    trace = engine(name).simulate(request_of(m, "ideal", "driven", time=time, course=course))
    crank, places, forces = WITHIN[name]
    np.testing.assert_allclose(trace.crank_angle, spline(time), rtol=0, atol=crank)
    np.testing.assert_array_equal(trace.crank_angle, trace.signals[f"{m.driven}_angle"])
    np.testing.assert_array_equal(trace.time, time)
    soft = 20.0 if m is LOADED and name == "mujoco" else 1.0  # rows of MuJoCo's give by what presses them
    assert_signals(trace, rigid(m, course, time).signals(), forces, soft * places)


CONSTANT = declared_runs("driven", feature="course")


@pytest.mark.parametrize(("name", "model"), slow_but([("mujoco", "ideal")], CONSTANT))
def test_a_course_of_constant_speed_is_the_same_as_the_speed(name: str, model: JointModel) -> None:
    theta = np.arange(40.0, 81.0, 5.0)
    m = load("paper").with_clearances({"B": 1e-3})
    ends = np.radians(np.linspace(40.0, 80.0, 50))
    time = np.radians(theta - 40.0) / float(m.speed or 0.0)
    course = ((ends - ends[0]) / float(m.speed or 0.0), ends)
    along = engine(name).simulate(request_of(m, model, "driven", time=np.minimum(time, course[0][-1]), course=course))
    steadily = run(name, m, model, "driven", theta)
    angles = [f"{body}_angle" for body in m.moving]
    assert max(np.abs(along.signals[n] - steadily.signals[n]).max() for n in angles) < 1e-6
    for kind in (is_force, lambda n: n == "drive_torque"):
        assert off(along.signals, steadily.signals, kind) < (2e-4 if model == "ideal" or name == "mujoco" else 1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "model"), [("exudyn", "spring-damper"), ("exudyn", "contact"), ("mujoco", "contact")])
def test_impacts_on_a_course_of_constant_speed_are_those_at_constant_speed(name: str, model: JointModel) -> None:
    m = at_speed(load("crank-rocker"), 62.8).with_joint(
        "B", clearance=2e-4, contact_stiffness=1e6, contact_damping=300.0
    )
    time = np.linspace(0, 0.1, 361)
    asked = {"start": "centred", "step": 1e-5}
    constant = engine(name).simulate(request_of(m, model, "driven", 62.8 * time, **asked))
    course = engine(name).simulate(request_of(m, model, "driven", time=time, course=(time, 62.8 * time), **asked))
    assert 0 < constant.free_share["B"] == pytest.approx(course.free_share["B"], rel=1e-2)
    for signal in ("coupler_angle", "follower_angle"):
        np.testing.assert_allclose(course.signals[signal], constant.signals[signal], atol=2e-6)
    peak = np.abs(constant.signals["reaction_B_x"]).max()
    np.testing.assert_allclose(course.signals["reaction_B_x"], constant.signals["reaction_B_x"], atol=2e-3 * peak)


# ---------------------------------------------------------------- pins that stay pressed


def on_the_rim(m: Mechanism, course: Course, time: np.ndarray, size: float, stiffness: float) -> Signals:
    """Signals at times (N,) s with the pin B always pressed: gap along its own reaction, with the gap's own rates and
    accelerations.
    """
    fine = np.linspace(course[0][0], course[0][-1], 251)
    found, gap = rigid(m, course, fine), np.zeros(fine.size, complex)
    for _ in range(8):
        force = found.forces["B"]
        before, gap = gap, (size + np.abs(force) / stiffness) * force / np.abs(force)
        moving = Gap(gap, *(CubicSpline(fine, gap)(fine, order) for order in (1, 2)))
        found = rigid(m, course, fine, {"B": moving})
    assert np.abs(gap - before).max() < 1e-6 * size
    return {name: CubicSpline(fine, values)(time) for name, values in found.signals().items()}


PINS = declared_runs("driven", LOOSE, "course")
PRESSED = [(*row, case) for row in PINS for case in ("paper", "crank-rocker", "from rest")]


@pytest.mark.long_rows("mujoco-spring-damper-crank-rocker", "mujoco-massless-link-crank-rocker")
@pytest.mark.parametrize(
    ("name", "model", "case"), slow_but([(*row, "crank-rocker") for row in PINS if row[0] == "mujoco"], PRESSED)
)
def test_loose_pins_begin_pressed_and_stay_so(name: str, model: JointModel, case: str) -> None:
    """From the first instant on, so nothing rattles; gaps are known less well than the forces that they point along."""
    pulled = ROCKER.replace(loads=(Load(body="follower", force=(40.0, 0.0)),))
    paper = at_speed(load("paper"), "measured").with_clearances({})
    m, course = {
        "paper": (paper, (SECOND, 1.2 + SWING)),
        "crank-rocker": (pulled, (SECOND, SWING)),
        "from rest": (paper, (SECOND[:251], 1.0 + 3 * SECOND[:251] ** 2)),
    }[case]
    size, time = 2e-4, np.linspace(0.0, 0.2, 21)
    trace = engine(name).simulate(request_of(m.with_clearances({"B": size}), model, "driven", time=time, course=course))
    right = on_the_rim(m, course, time, size, float(str(trace.settings.get("contact_stiffness", np.inf))))
    np.testing.assert_allclose(trace.crank_angle, CubicSpline(*course)(time), rtol=0, atol=WITHIN[name][0])
    assert trace.free_share == {"B": 0.0}
    if name == "mujoco":
        assert trace.settings["start"] == "equilibrium"
    assert max(np.abs(trace.signals[f"{b}_angle"] - right[f"{b}_angle"]).max() for b in m.moving) < 5e-6
    assert off(trace.signals, right, is_force) < 5e-4
    assert off(trace.signals, right, lambda n: n == "drive_torque") < 5e-4
    assert off(trace.signals, right, lambda n: n.startswith("clearance_B_") and n[-1] in "xy") < 1e-3


# ---------------------------------------------------------------- a motor behind a spring


def sprung(m: Mechanism, stiffness: float, speed: float | str = SPEED) -> Mechanism:
    return at_speed(m, speed, stiffness=stiffness)


class Crank:
    """The crank of an ideal linkage behind a spring as one degree of freedom, inertia(theta) alpha = stiffness (motor -
    theta) - rest(theta, omega), its coefficients from the drive torque of the rigid linkage: at rest, linear and square
    in the speed, linear in the acceleration.
    """

    def __init__(self, m: Mechanism, motor: Callable[[float], float]) -> None:
        assert m.drive is not None
        assert m.drive.stiffness is not None
        theta = np.linspace(0, 2 * np.pi, 1025)
        still, ahead, back, pushed = (
            kinetostatics(kinematics(Assembly(m), theta, w, a)).drive_torque
            for w, a in ((0.0, 0.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0))
        )
        parts = np.array([still, (ahead - back) / 2, (ahead + back) / 2 - still, pushed - still]).T
        parts[-1] = parts[0]
        self.parts, self.motor, self.stiffness = CubicSpline(theta, parts, bc_type="periodic"), motor, m.drive.stiffness

    def run(self, start: tuple[float, float], time: np.ndarray) -> np.ndarray:
        """Angle (rad), rate and acceleration at these times (s), (3, N), from its state at the first of them."""

        def acceleration(t: float, angle: float, rate: float) -> float:
            still, linear, square, inertia = self.parts(angle)
            held = self.stiffness * (self.motor(t) - angle)
            return float((held - still - linear * rate - square * rate**2) / inertia)

        ends = (time[0], time[-1])
        found = solve_ivp(
            lambda t, y: [y[1], acceleration(t, *y)], ends, start, "DOP853", time, rtol=1e-10, atol=1e-12
        ).y
        return np.array([*found, [acceleration(t, *y) for t, y in zip(time, found.T, strict=True)]])


SOFTEST = {"mujoco": 50.0, "exudyn": 500.0, "pybullet": 500.0, "dart": 500.0}  # N.m/rad: below, starts sway by more
REPEATING = [
    (name, stiffness, ripple)
    for name in ENGINES
    for stiffness in (50.0, 200.0, 500.0, 2000.0)
    if stiffness >= SOFTEST[name]
    for ripple in (0.0, 2e-3)
    if ripple or stiffness == SOFTEST[name]  # one motor without, the hardest to start
]


@pytest.mark.parametrize(("name", "stiffness", "ripple"), slow_but([("mujoco", 200.0, 2e-3)], REPEATING))
def test_a_crank_on_a_spring_moves_as_its_equation_says_and_repeats_itself(
    name: str, stiffness: float, ripple: float
) -> None:
    """A crank that swayed beside its steady motion would not be back after a turn."""
    m, time = sprung(ROCKER.with_joint("B", damping=1e-4), stiffness), TURN[::16]
    motor = SPEED * TURN + ripple * np.sin(6 * SPEED * TURN + 0.3)
    asked = request_of(m, "ideal", "driven", SPEED * time)
    if ripple:
        asked = request_of(
            at_speed(m, "measured", stiffness=stiffness), "ideal", "driven", time=time, course=(TURN, motor)
        )
    trace, spline = engine(name).simulate(asked), CubicSpline(TURN, motor)
    angle, spin = trace.signals["crank_angle"], trace.signals["crank_angular_velocity"]
    crank = Crank(m, lambda t: float(spline(t))).run((angle[0], spin[0]), time)
    lag = motor[::16] - angle
    assert np.abs(lag).max() > 1e-4
    np.testing.assert_allclose(lag, trace.signals["drive_torque"] / stiffness, rtol=0, atol=1e-7)
    right = kinetostatics(kinematics(Assembly(m), *crank)).signals()
    assert max(np.abs(trace.signals[f"{b}_angle"] - right[f"{b}_angle"]).max() for b in m.moving) < 1e-6
    assert off(trace.signals, right, is_force) < 5e-4
    assert off(trace.signals, right, lambda n: n == "drive_torque") < 5e-4
    np.testing.assert_allclose(lag[-1], lag[0], rtol=0, atol=2e-7)
    assert spin[-1] == pytest.approx(spin[0], abs=1e-5 * SPEED)


SWINGS = [
    (name, case, stiffness)
    for name in ENGINES
    for case in ("crank-rocker", "pendulum")
    for stiffness in (100.0, 2000.0)
]
SOON = [("mujoco", "crank-rocker", 2000.0), ("exudyn", "pendulum", 100.0)]


@pytest.mark.long_rows("exudyn-pendulum-100.0")
@pytest.mark.parametrize(("name", "case", "stiffness"), slow_but(SOON, SWINGS))
def test_a_crank_on_a_spring_lags_a_swinging_motor_without_swaying(name: str, case: str, stiffness: float) -> None:
    """The crank is where the torque of its own motion lets it be."""
    linkage, middle = {"crank-rocker": (LOADED, 1.0), "pendulum": (PENDULUM, 0.0)}[case]
    m, time = sprung(linkage, stiffness, "measured"), np.arange(64) / 64  # s, of a period of 1 s
    trace = engine(name).simulate(request_of(m, "ideal", "driven", time=time, course=(SECOND, middle + SWING)))
    motor, waves = 0.5 * np.sin(2 * np.pi * time), 2j * np.pi * np.arange(11)  # harmonics that are heard
    swing = motor
    for _ in range(60):
        spectrum = np.fft.rfft(swing)[:11]
        parts = [np.fft.irfft(waves**order * spectrum, 64) for order in range(3)]
        right = kinetostatics(kinematics(Assembly(m), middle + parts[0], *parts[1:]))
        before, swing = swing, motor - right.drive_torque / stiffness
    assert np.abs(swing - before).max() < 1e-8
    signals = right.signals()
    assert max(np.abs(trace.signals[f"{b}_angle"] - signals[f"{b}_angle"]).max() for b in m.moving) < 3e-6
    assert off(trace.signals, signals, is_force) < 1e-3
    assert off(trace.signals, signals, lambda n: n == "drive_torque") < 1e-3


BEHIND = declared_runs("driven", LOOSE, "drive_compliance")


@pytest.mark.long_rows("dart-contact")
@pytest.mark.parametrize(("name", "model"), slow_but([("mujoco", "massless-link"), ("dart", "contact")], BEHIND))
def test_a_motor_on_a_spring_and_a_pin_with_clearance(name: str, model: JointModel) -> None:
    m = load("paper").with_clearances({"B": 1e-3})
    angles = np.linspace(50.0, 60.0, 31)
    trace = run(name, sprung(m, 2000.0, float(m.speed or 0.0)), model, "driven", angles)
    crank = trace.signals["crank_angle"]
    right = displaced(Assembly(m), crank, np.gradient(crank, np.radians(angles)) * (m.speed or 0.0)).signals()
    peak = np.abs(right["drive_torque"]).max()
    near = 1e-2 if name == "exudyn" else 3e-4  # its crank sways: see the course without clearance, where it does not
    np.testing.assert_allclose(trace.signals["drive_torque"], right["drive_torque"], rtol=0, atol=near * peak)
    np.testing.assert_allclose(trace.signals["follower_angle"], right["follower_angle"], rtol=0, atol=2e-5)


@pytest.mark.parametrize(("name", "model"), slow(("mujoco", "ideal"), ("exudyn", "ideal"), ("exudyn", "massless-link")))
def test_requested_angles_are_the_motors_where_the_crank_cannot_turn_fully(name: str, model: JointModel) -> None:
    speed = -float(load("paper").speed or 0.0)
    m = sprung(load("paper").with_clearances({"B": 1e-5}), 500.0, speed)
    asked = np.array([120.0, 40.0, 80.0])
    trace = run(name, m, model, "driven", asked)
    np.testing.assert_array_equal(trace.crank_angle, np.radians(asked))
    np.testing.assert_allclose(trace.time, np.radians(120.0 - asked) / abs(speed), atol=1e-12)
    grid = np.radians(np.arange(20, 140.5, 0.5))
    lag = np.zeros(grid.size)
    for _ in range(6):  # crank = motor - torque / stiffness, over the motor's angle
        angle = CubicSpline(grid, grid - lag)
        lag = kinetostatics(
            kinematics(Assembly(m), *(angle(grid, order) * speed**order for order in range(3)))
        ).drive_torque / 500.0  # fmt: skip
    expected = np.interp(np.radians(asked), grid, grid - lag)
    np.testing.assert_allclose(trace.signals["crank_angle"], expected, rtol=0, atol=2e-6 if model == "ideal" else 1e-5)


@pytest.mark.long_rows("pybullet")
@pytest.mark.parametrize("name", ["pybullet", "dart"])
def test_a_motor_near_resonance_is_refused(name: str) -> None:
    """Engines that step by leapfrog find no steady motion there to start in."""
    with pytest.raises(
        SimulationError, match=r"no steady motion of the crank on a drive\.stiffness of 20 N\.m/rad"
    ) as no:
        run(name, sprung(load("crank-rocker"), 20.0), "ideal", "driven", [0.0, 57.0])
    assert no.value.cause is Cause.RESONANCE


# ---------------------------------------------------------------- markers

MARKED = [(name, model, motion) for motion in MOTIONS for name, model in declared_runs(motion)]


@pytest.mark.long_rows("pybullet-ideal-driven", "mujoco-contact-static", "dart-ideal-driven", "mujoco-ideal-driven")
@pytest.mark.parametrize(
    ("name", "model", "motion"),
    slow_but([r for r in MARKED if r[1] == "ideal"] + [("mujoco", "contact", "static")], MARKED),
)
def test_signals_and_loads_are_at_the_marker_and_mass_is_not(name: str, model: JointModel, motion: Motion) -> None:
    m = LOADED.replace(loads=(LOADED.loads[0], Load(body="coupler", point="com", force=(3.0, 20.0), torque=0.05)))
    for body, com, marker in (
        ("crank", (0.03, 0.01), (0.02, -0.03)),
        ("coupler", (0.07, 0.02), (0.05, -0.01)),
        ("follower", (0.06, -0.01), (0.05, 0.0)),
    ):
        m = m.with_body(body, com=com, marker=marker)
    degrees = np.arange(10.0, 91.0, 20.0)
    m = at_speed(m, 4.0)
    # A rod gives, by more than 1e-6 m allows.
    gaps = {"ideal": {}, "massless-link": {"B": 1e-5}}.get(model, {"B": 1e-6})
    trace = run(name, m.with_clearances(gaps), model, motion, degrees)
    truth = ideal_signals(m, np.radians(degrees), motion)
    if model == "ideal":
        assert_signals(trace, truth, 1e-4, 2e-6)
        return
    assert off(trace.signals, truth, is_force) < 5e-4
    for body in m.moving:
        assert np.abs(vector(trace, body) - vector(truth, body)).max() < 5e-6 + 2 * max(gaps.values())


# ---------------------------------------------------------------- what is refused


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"mechanism": ROCKER.replace(drive=Drive(joint="D", speed="free"))}, "leave the course out of a st|not free"),
        ({"lead_in": 0.1}, r"leave out lead_in = 0\.1 rad"),
        ({"time": np.array([0.1, 0.3])}, "reports are wanted outside the course"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("name", ENGINES)
def test_what_makes_no_course_is_refused(name: str, change: dict[str, object], why: str) -> None:
    given: dict[str, object] = {"mechanism": ROCKER, "course": (TURN, SPEED * TURN), "time": TURN}
    with pytest.raises(Unsupported, match=why):
        engine(name).simulate(request_of(**(given | change)))


@pytest.mark.parametrize("name", ENGINES)
def test_a_course_through_a_change_point_is_the_requests_fault(name: str) -> None:
    course = (SECOND, 1.0 - 2 * SECOND)
    with pytest.raises(AssemblyError):
        engine(name).simulate(request_of(at_speed(load("paper"), "measured"), time=SECOND, course=course))

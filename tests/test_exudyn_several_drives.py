"""Exudyn with several drives, with freedoms that nothing drives, and with springs between points: against a referee in
maximal coordinates, Newton's and Lagrange's equations written here, and the balance of energy.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.mechanism import Drive, Load, Mechanism, Spring
from analytic.mechanism.file import load
from marks import slow
from maximal import Maximal, Posed
from several_linkages import CASES, KNOTS, SHIPPED, TIMES, Knots, referee, splines, sprung, third_bar, waved
from sim_models.engine import JOINT_MODELS, Cause, JointModel, Motion, Request, SimulationError, Trace, Unsupported
from sim_models.exudyn.engine import ENGINE

pytestmark = pytest.mark.exudyn

CLEARANCE_MODELS: tuple[JointModel, ...] = JOINT_MODELS[1:]
G = 9.81  # m/s^2
ARM = load("2r-arm")
FIVE_BAR = load("five-bar")
PENDULUM = ARM.replace(drives=(), assembly={"upper-arm": 0.2, "forearm": -0.6})
HANGING = ARM.replace(
    drives=(Drive(joint="O", speed=2.0), Drive(joint="K", speed="free")),
    assembly={"upper-arm": -1.2, "forearm": -1.0},
)
DRIVEN_ARM = {"O": (KNOTS, -1.2 + 2.0 * KNOTS)}


def run(m: Mechanism, courses: Knots, times: np.ndarray, model: JointModel = "ideal", **fields: object) -> Trace:
    return ENGINE.simulate(Request(m, model, "driven", time=times, courses=courses, **fields))


def vector(trace: Trace, name: str) -> np.ndarray:
    return np.asarray(trace.signals[f"{name}_x"] + 1j * trace.signals[f"{name}_y"])


def close(seen: np.ndarray, right: np.ndarray, within: float) -> None:
    np.testing.assert_allclose(seen, right, rtol=0, atol=within)


def agrees(
    m: Mechanism, trace: Trace, judge: Maximal, posed: list[Posed], within: float = 1e-6, places: float = 1e-6
) -> None:
    """Places (rad, or lengths), rates and all that is determined of forces, to shares of the largest one."""
    size = max(body.length for body in m.bodies)
    largest = max(abs(p.forces[j.name]) for p in posed for j in m.joints)
    top = max(1.0, *(np.abs(p.rates).max() for p in posed))
    for body in m.bodies:
        k = judge.index[body.name]
        at = np.array([judge.point(p.q, body.name, "com") for p in posed])
        rates, bends = (np.array([getattr(p, what)[k : k + 3] for p in posed]) for what in ("rates", "accelerations"))
        close(trace.signals[f"{body.name}_angle"], np.array([p.q[k + 2] for p in posed]), places)
        close(vector(trace, body.name), at, places * size)
        close(trace.signals[f"{body.name}_angular_velocity"], rates[:, 2], 3 * places * top)
        close(trace.rates[body.name].velocity, rates[:, 0] + 1j * rates[:, 1], 3 * places * size * top)
        inertia = body.mass * trace.rates[body.name].acceleration
        close(inertia, body.mass * (bends[:, 0] + 1j * bends[:, 1]), within * largest)
    for name in {j.name for j in m.joints} - posed[0].undetermined:
        close(vector(trace, f"reaction_{name}"), np.array([p.forces[name] for p in posed]), within * largest)
    for name in posed[0].moments:
        seen = trace.signals[f"reaction_{name}_moment"]
        close(seen, np.array([p.moments[name] for p in posed]), within * largest * size)
    most = max((abs(x) for p in posed for x in p.motors.values()), default=0.0)
    for name in posed[0].motors:
        kind = "force" if m.joint(name).prismatic else "torque"
        signal = f"drive_{kind}_{name}" if len(posed[0].motors) > 1 or kind == "force" else "drive_torque"
        close(trace.signals[signal], np.array([p.motors[name] for p in posed]), 3 * within * most)


# ---------------------------------------------------------------- ideal joints along courses


@pytest.mark.parametrize("name", [*SHIPPED, "parallelogram", *slow(*(n for n in CASES if "springs" in n))])
def test_every_drive_follows_its_course_with_the_forces_of_the_referee(name: str) -> None:
    m = CASES[name].with_clearances({})
    courses = waved(m)
    trace = run(m, courses, TIMES)
    agrees(m, trace, *referee(m, courses, TIMES))
    close(trace.crank_angle, splines(courses)[m.drives[0].joint](TIMES), 1e-7)


@pytest.mark.parametrize(
    ("case", "joints"), [("2r-arm", ("O", "K")), ("3-rpr", ("S1", "A2")), *slow(("five-bar", ("D", "A")))]
)
def test_it_does_not_matter_which_body_of_a_joint_is_its_first(case: str, joints: tuple[str, ...]) -> None:
    m = load(case)
    m = m.replace(
        joints=tuple(j.model_copy(update={"bodies": j.bodies[::-1]}) if j.name in joints else j for j in m.joints)
    )
    trace = run(m, waved(m), TIMES)
    agrees(m, trace, *referee(m, waved(m), TIMES))


@pytest.mark.parametrize("backwards", [False, True])
def test_a_gantry_is_pushed_as_newton_says(backwards: bool) -> None:
    """A carriage on a slope of the ground, a head across it: each motor carries all that is beyond, along its slide."""
    along = np.exp(0.3j)
    names = {"X": ("ground", "carriage"), "Y": ("carriage", "head")}
    joints = [
        {
            "name": name, "type": "prismatic", "bodies": bodies[::-1] if backwards else bodies,
            "axis": {"X": (along.real, along.imag), "Y": (0.0, 1.0)}[name],
            "angle": 0.3 if name == "X" else 0.0,
        }
        for name, bodies in names.items()
    ]  # fmt: skip
    if backwards:  # axes and angles are the other bodies' then
        joints[0] |= {"axis": (1.0, 0.0), "angle": -0.3}
    bodies = [
        {"name": "carriage", "points": {"X": (0.0, 0.0), "Y": (0.1, 0.0)}, "mass": 2.0, "inertia": 0.01},
        {"name": "head", "points": {"Y": (0.0, 0.0), "tool": (0.0, 0.1)}, "mass": 0.7, "inertia": 0.001},
    ]
    m = Mechanism.model_validate(
        {
            "name": "gantry", "gravity": (0.0, -G), "ground": {"points": {"X": (0.0, 0.0)}}, "body": bodies,
            "joint": joints, "drive": [{"joint": "X", "speed": 0.1}, {"joint": "Y", "speed": 0.1}],
            "load": [{"body": "head", "point": "tool", "force": (3.0, -4.0)}],
            "assembly": {"carriage": 0.3, "head": 0.3},
        }
    )  # fmt: skip
    courses = {"X": (KNOTS, 0.2 * np.sin(5 * KNOTS)), "Y": (KNOTS, 0.3 - 0.3 * np.cos(4 * KNOTS))}
    trace = run(m, courses, TIMES)
    x, y = (f(TIMES, 2) for f in splines(courses).values())
    x, y = (-x, -y) if backwards else (x, y)  # a joint's position is of its second body on its first
    head = 0.7 * (x * along + y * 1j * along + 1j * G) - (3.0 - 4.0j)
    both = head + 2.0 * (x * along + 1j * G)
    for name, force, axis in (("X", both, along), ("Y", head, 1j * along)):
        sign = -1.0 if backwards else 1.0
        close(vector(trace, f"reaction_{name}"), sign * force, 1e-6 * np.abs(both).max())
        close(trace.signals[f"drive_force_{name}"], sign * np.real(np.conj(axis) * force), 1e-6 * np.abs(both).max())


def test_what_motors_give_is_what_the_linkage_gains_in_energy_and_loses_in_dampers() -> None:
    m = CASES["3-rpr with springs"]
    times = np.linspace(0.0, 0.2, 101)
    trace, motors = run(m, waved(m), times), splines(waved(m))
    power = sum(trace.signals[f"drive_force_{n}"] * f(times, 1) for n, f in motors.items())
    lost, held = np.zeros(times.size), energy(m, trace)
    for joint in m.joints:
        where = trace.signals[f"position_{joint.name}"]
        lost += joint.damping * CubicSpline(times, where)(times, 1) ** 2
        held = held + joint.stiffness * where**2 / 2
    apart = np.exp(1j * trace.signals["platform_angle"]) * m.body("platform").point("C3")
    rod = vector(trace, "platform") + apart - m.ground.point("A1")
    moving = trace.rates["platform"].velocity + 1j * trace.signals["platform_angular_velocity"] * apart
    lost += m.springs[0].damping * (np.real(np.conj(rod) * moving) / np.abs(rod)) ** 2
    held = held + m.springs[0].stiffness * (np.abs(rod) - m.springs[0].length) ** 2 / 2
    gained = CubicSpline(times, power - lost).antiderivative()(times)
    close(held - held[0], gained - gained[0], 2e-6 * np.abs(power).max() * times[-1])


def energy(m: Mechanism, trace: Trace) -> np.ndarray:
    """Energy (J) of motion, weights and dead loads."""
    total = resting(m, trace)
    for b in m.bodies:
        total += b.mass * np.abs(trace.rates[b.name].velocity) ** 2 / 2
        total += b.moment_of_inertia * trace.signals[f"{b.name}_angular_velocity"] ** 2 / 2
    return total


def resting(m: Mechanism, trace: Trace) -> np.ndarray:
    """That of weights and dead loads."""
    total = np.zeros(trace.crank_angle.size)
    for b in m.bodies:
        turn = np.exp(1j * trace.signals[f"{b.name}_angle"])
        com = vector(trace, b.name) + (b.centre - b.point("com")) * turn
        total -= b.mass * np.real(np.conj(complex(*m.gravity)) * com)
    for push in m.loads:
        body = m.moving[push.body]
        turn = np.exp(1j * trace.signals[f"{push.body}_angle"])
        at = vector(trace, push.body) + (body.point(push.point) - body.point("com")) * turn
        total -= np.real(np.conj(complex(*push.force)) * at)
    return total


def test_courses_may_begin_late_and_have_knots_of_their_own() -> None:
    at = Assembly(ARM).positions
    first, second = np.linspace(7.0, 7.6, 31), np.linspace(7.013, 7.6, 47)
    courses = {
        "O": (first, at["O"] + 0.4 * np.sin(3 * (first - 7))),
        "K": (second, at["K"] - 0.5 * np.sin(4 * second)),
    }
    times = np.array([7.4, 7.02, 7.58, 7.4])
    trace, motors, judge = run(ARM, courses, times), splines(courses), Maximal(ARM, ("O", "K"))
    np.testing.assert_array_equal(trace.time, times)
    home = judge.home(at)
    posed = [
        judge.driven_at(home, {n: (float(f(t)), float(f(t, 1)), float(f(t, 2))) for n, f in motors.items()})
        for t in times
    ]
    agrees(ARM, trace, judge, posed)


def test_a_crank_on_a_course_is_the_same_by_either_way() -> None:
    """Where the fastest body, not the crank, says how long a step is."""
    m = load("paper").with_clearances({})
    m = m.replace(drives=(Drive(joint="D", speed="measured"),))
    angle = np.radians(30.0) + 1.5 * KNOTS + 4.0 * KNOTS**2
    one = ENGINE.simulate(Request(m, "ideal", "driven", time=TIMES[:5], course=(KNOTS, angle)))
    other = run(m, {"D": (KNOTS, angle)}, TIMES[:5])
    assert set(one.signals) == set(other.signals)
    for name, values in one.signals.items():
        close(other.signals[name], values, 2e-6 * max(1.0, np.abs(values).max()))


# ---------------------------------------------------------------- what nothing drives


def double_pendulum(m: Mechanism, times: np.ndarray, driven: Callable[[float], float] | None = None) -> np.ndarray:
    """Angles (2, N) rad of the arm let go at rest by Lagrange's equations; the upper one where ``driven`` says."""
    upper, lower = m.bodies
    reach, first, second = 0.3, abs(upper.centre), abs(lower.centre)
    inertia = np.array(
        [upper.moment_of_inertia + upper.mass * first**2 + lower.mass * reach**2,
         lower.moment_of_inertia + lower.mass * second**2]
    )  # fmt: skip
    coupled = lower.mass * reach * second
    weight = G * np.array([upper.mass * first + lower.mass * reach, lower.mass * second])

    def accelerations(a: float, b: float, u: float, v: float) -> np.ndarray:
        c, s = coupled * np.cos(a - b), coupled * np.sin(a - b)
        force = np.array([-s * v**2 - weight[0] * np.cos(a), s * u**2 - weight[1] * np.cos(b)])
        if driven is not None:
            return np.array([0.0, force[1] / inertia[1]])
        return np.asarray(np.linalg.solve([[inertia[0], c], [c, inertia[1]]], force))

    rate = (driven(1.0) - driven(0.0)) if driven is not None else 0.0
    start = [m.assembly["upper-arm"], m.assembly["forearm"], rate, rate]  # the elbow at rest
    found = solve_ivp(
        lambda t, y: [y[2], y[3], *accelerations(*y)],
        (0.0, float(times[-1])), start, "DOP853", times, rtol=1e-11, atol=1e-12,
    )  # fmt: skip
    return np.asarray(found.y[:2])


def test_a_double_pendulum_swings_as_lagrange_says_and_keeps_its_energy() -> None:
    times = np.linspace(0.0, 0.6, 13)
    trace, right = run(PENDULUM, {}, times), double_pendulum(PENDULUM, times)
    for name, angle in zip(("upper-arm", "forearm"), right, strict=True):
        close(trace.signals[f"{name}_angle"], angle, 2e-6)
    assert np.ptp(energy(PENDULUM, trace)) < 5e-6
    assert not [name for name in trace.signals if name.startswith("drive")]
    np.testing.assert_array_equal(trace.crank_angle, trace.signals["upper-arm_angle"])


def test_a_forearm_hangs_freely_on_a_driven_arm() -> None:
    times = np.linspace(0.0, 0.6, 13)
    trace = run(HANGING, DRIVEN_ARM, times)
    right = double_pendulum(HANGING, times, lambda t: -1.2 + 2.0 * t)
    close(trace.signals["upper-arm_angle"], right[0], 1e-10)
    close(trace.signals["forearm_angle"], right[1], 1e-6)
    gained = CubicSpline(times, 2.0 * trace.signals["drive_torque"]).antiderivative()(times)
    assert energy(HANGING, trace)[-1] - energy(HANGING, trace)[0] == pytest.approx(float(gained[-1]), rel=1e-3)


def test_loops_with_one_drive_too_few_move_as_the_referee_says() -> None:
    m = FIVE_BAR.replace(drives=(Drive(joint="D", speed=2.0), Drive(joint="E", speed="free")))
    at, times = Assembly(m).positions, np.linspace(0.0, 0.04, 5)
    course = {"D": (KNOTS, at["D"] + 2.0 * KNOTS)}
    trace, motor = run(m, course, times), CubicSpline(*course["D"])
    held = Maximal(m, ("D", "E"))
    start = held.driven_at(held.home(at), {"D": (at["D"], 2.0, 0.0), "E": (at["E"], 0.0, 0.0)})
    judge = Maximal(m, ("D",))
    posed = judge.released(start.q, start.rates, times, {"D": lambda t, order: float(motor(t, order))})
    agrees(m, trace, judge, posed, 3e-6)


def test_a_motion_through_a_posture_that_holds_itself_twice_is_refused() -> None:
    """Let go, the five-bar's cranks fall outwards alike, until all bars lie in one line; with a push aside they miss
    it.
    """
    m, times = FIVE_BAR.replace(drives=()), np.linspace(0.0, 0.07, 8)
    with pytest.raises(SimulationError, match="stretched out") as failure:
        run(m, {}, times)
    assert failure.value.cause is Cause.DIVERGED
    m = m.replace(loads=(Load(body="left-arm", point="P", force=(7.0, -20.0)),))
    trace, judge = run(m, {}, times), Maximal(m, ())
    posed = judge.released(judge.home({}), np.zeros(12), times, {})
    agrees(m, trace, judge, posed, 1e-4, 1e-5)


# ---------------------------------------------------------------- clearance

PINS = {
    "five-bar": ("P",),
    "five-bar, two pins": ("A", "P"),
    "five-bar, driven": ("D",),
    "3-rrr": ("C1", "B2"),
    "3-rpr": ("C1",),
    "2r-arm": ("K",),
    "2r-arm, both": ("O", "K"),
}


@pytest.mark.parametrize(
    ("case", "model"),
    [
        ("five-bar", "contact"), ("five-bar, driven", "spring-damper"), ("2r-arm, both", "massless-link"),
        *slow(*((case, model) for case in PINS for model in CLEARANCE_MODELS)),
    ],
)  # fmt: skip
def test_pins_pressed_into_small_gaps_follow_courses_as_an_ideal_linkage_does(case: str, model: JointModel) -> None:
    """The rest is what gaps of 1e-5 m, and what a contact gives, do to links of 0.1 m and more; a pin that began off
    its motion would sway by ten times that.
    """
    m, loose = load(case.split(",")[0]), PINS[case]
    courses, times = waved(m), np.linspace(0.0, 0.1, 9)
    trace = run(m.with_clearances(dict.fromkeys(loose, 1e-5)), courses, times, model)
    assert trace.free_share == dict.fromkeys(loose, 0.0)
    _, posed = referee(m, courses, times)
    largest = max(abs(p.forces[j.name]) for p in posed for j in m.joints)
    for joint in m.joints:
        close(vector(trace, f"reaction_{joint.name}"), np.array([p.forces[joint.name] for p in posed]), 8e-4 * largest)
    for name in loose:
        force, gap = vector(trace, f"reaction_{name}"), vector(trace, f"clearance_{name}")
        assert np.abs(np.angle(gap / force)).max() < 1e-6
        assert np.abs(gap).min() > 0.999e-5


@pytest.mark.parametrize("model", CLEARANCE_MODELS)
def test_pins_of_what_moves_freely_begin_pressed(model: JointModel) -> None:
    times = np.linspace(0.0, 0.3, 7)
    ideal = run(HANGING, DRIVEN_ARM, times)
    loose = run(HANGING.with_clearances({"K": 5e-5}), DRIVEN_ARM, times, model)
    assert loose.free_share == {"K": 0.0}
    close(loose.signals["forearm_angle"], ideal.signals["forearm_angle"], 1e-3)
    force, gap = vector(ideal, "reaction_K"), vector(loose, "clearance_K")
    assert abs(np.angle(gap[0] / force[0])) < 1e-6
    close(vector(loose, "reaction_K"), force, 2e-3 * np.abs(force).max())


class Rattling(Maximal):
    """The five-bar with its pin P out of the rows: a journal in a bearing that pushes with max(0, K d + C d')."""

    def __init__(self, m: Mechanism) -> None:
        super().__init__(m.replace(joints=tuple(j for j in m.joints if j.name != "P")), ("D", "E"))
        self.pin = m.joint("P")

    def contact(self, q: np.ndarray, rates: np.ndarray) -> tuple[complex, complex]:
        """Gap (m) of the pin, first less second, and the force (N) on the second body."""
        gap = self.point(q, "left-arm", "P") - self.point(q, "right-arm", "P")
        rate = self.velocity(q, rates, "left-arm", "P") - self.velocity(q, rates, "right-arm", "P")
        depth = abs(gap) - self.pin.clearance
        if depth <= 0:
            return gap, 0j
        along = gap / abs(gap)
        push = (self.pin.contact_stiffness or 0.0) * depth
        push += (self.pin.contact_damping or 0.0) * (np.conj(along) * rate).real
        return gap, max(0.0, push) * along

    def forces(self, q: np.ndarray, rates: np.ndarray) -> np.ndarray:
        out, (_, force) = super().forces(q, rates), self.contact(q, rates)
        for body, push in (("right-arm", force), ("left-arm", -force)):
            k, arm = self.index[body], self.arm(q, body, "P")
            out[k : k + 3] += push.real, push.imag, (np.conj(arm) * push).imag
        return out


def test_a_pin_that_starts_centred_falls_and_bounces_as_its_equation_says() -> None:
    m = FIVE_BAR.with_joint("P", clearance=1e-4, contact_stiffness=1e6, contact_damping=60.0)
    courses, times = waved(m), np.linspace(0.0, 3e-3, 16)
    trace = run(m, courses, times, "spring-damper", start="centred", step=2e-6)
    ideal, motors = Maximal(m, ("D", "E")), splines(courses)
    at = {n: (float(f(0)), float(f(0, 1)), float(f(0, 2))) for n, f in motors.items()}
    start = ideal.driven_at(ideal.home({n: x for n, (x, *_) in at.items()}), at)
    judge = Rattling(m)
    posed = judge.released(
        start.q, start.rates, times, {n: lambda t, k, f=f: float(f(t, k)) for n, f in motors.items()}
    )
    gap, force = np.array([judge.contact(p.q, p.rates) for p in posed]).T
    assert 0 < np.count_nonzero(force) < force.size
    close(vector(trace, "clearance_P"), gap, 3e-7)  # a step in which contact begins or ends is of the first order
    close(vector(trace, "reaction_P"), force, 5e-3 * np.abs(force).max())


@pytest.mark.slow
@pytest.mark.parametrize("model", ["massless-link", "contact"])
def test_loops_that_hold_too_much_are_started_centred(model: JointModel) -> None:
    m = third_bar().with_clearances({"f2": 1e-3})
    courses = waved(m)
    with pytest.raises(SimulationError, match="start it centred") as failure:
        run(m, courses, TIMES, model)
    assert failure.value.cause is Cause.NO_START
    trace, ideal = run(m, courses, TIMES, "contact", start="centred"), run(m, courses, TIMES)
    torque = ideal.signals["drive_torque"]
    close(trace.signals["drive_torque"], torque, 0.02 * np.abs(torque).max())


# ---------------------------------------------------------------- loops that hold themselves twice, behind a crank


@pytest.mark.parametrize("motion", ["driven", "static"])
def test_a_third_bar_leaves_the_torque_of_a_crank_as_the_energy_says(motion: Motion) -> None:
    """The bars go round in circles alike: coupler and third bar without turning, at a constant speed without power."""
    m = third_bar().with_clearances({})
    theta = np.radians([30.0, 45.0, 60.0])
    trace = ENGINE.simulate(Request(m, "ideal", motion, theta))
    fine = np.radians(np.linspace(29.0, 61.0, 257))
    held = resting(m, ENGINE.simulate(Request(m, "ideal", "static", fine)))
    slope = CubicSpline(fine, held)(theta, 1)
    close(trace.signals["drive_torque"], slope, 2e-6 * np.abs(slope).max())


# ---------------------------------------------------------------- springs between points


def on_a_spring(m: Mechanism, **law: float) -> Mechanism:
    spring = Spring(bodies=("ground", "coupler"), points=("E", "com"), stiffness=60.0, length=0.1, **law)
    return m.replace(springs=(spring,))


@pytest.mark.parametrize("model", JOINT_MODELS)
def test_at_rest_a_spring_holds_by_its_stretch_and_its_damper_does_nothing(model: JointModel) -> None:
    """The torque that holds the crank is the slope of the energy over its angle, pins on their rims or not."""
    m = on_a_spring(load("paper"), damping=40.0).with_clearances({} if model == "ideal" else {"B": 1e-4})
    theta = np.radians(np.linspace(30.0, 60.0, 61))
    trace = ENGINE.simulate(Request(m, model, "static", theta))
    spring, ground = m.springs[0], m.ground.point("E")
    far = np.abs(vector(trace, "coupler") - ground)
    held = resting(m, trace) + spring.stiffness * (far - spring.length) ** 2 / 2
    slope = CubicSpline(theta, held)(theta, 1)[5:-5]
    give = 1e-4 if model == "ideal" else 2e-3  # a contact stores some of it
    close(trace.signals["drive_torque"][5:-5], slope, give * np.abs(slope).max())


@pytest.mark.parametrize("model", ["ideal", "massless-link", *slow("spring-damper", "contact")])
def test_a_crank_that_turns_against_a_spring_and_its_damper_gives_what_they_take(model: JointModel) -> None:
    bare = load("paper").with_clearances({} if model == "ideal" else {"B": 1e-5})
    theta = np.radians(np.linspace(30.0, 45.0, 16))
    with_it, without = (
        ENGINE.simulate(Request(m, model, "driven", theta)) for m in (on_a_spring(bare, damping=40.0), bare)
    )
    spring = on_a_spring(bare, damping=40.0).springs[0]
    apart = vector(with_it, "coupler") - bare.ground.point("E")
    coupler, body = with_it.rates["coupler"], bare.moving["coupler"]
    arm = (body.point("com") - body.centre) * np.exp(1j * with_it.signals["coupler_angle"])
    moving = coupler.velocity + 1j * with_it.signals["coupler_angular_velocity"] * arm
    stretching = np.real(np.conj(apart / np.abs(apart)) * moving)
    pull = spring.stiffness * (np.abs(apart) - spring.length) + spring.damping * stretching
    taken = pull * stretching / float(bare.speed or 1.0)
    extra = with_it.signals["drive_torque"] - without.signals["drive_torque"]
    assert np.abs(spring.damping * stretching).max() > 1.0
    close(extra, taken, (2e-6 if model == "ideal" else 2e-3) * np.abs(taken).max())


def test_a_pendulum_on_a_spring_swings_as_its_equation_says() -> None:
    pendulum = load("pendulum")
    assert pendulum.drive is not None
    rod = pendulum.bodies[0]
    m = pendulum.replace(
        drive=pendulum.drive.model_copy(update={"speed": "free"}),
        ground=pendulum.ground.model_copy(update={"points": {**pendulum.ground.points, "W": (0.3, 0.2)}}),
        springs=(Spring(bodies=(rod.name, "ground"), points=("tip", "W"), stiffness=40.0, length=0.15, damping=0.5),),
    )
    times, spring = np.linspace(0.0, 0.6, 13), m.springs[0]
    trace = ENGINE.simulate(Request(m, "ideal", "driven", time=times))
    arm, centre, wall = rod.point("tip"), rod.centre, m.ground.point("W")  # its pin is the origin of both
    inertia = rod.moment_of_inertia + rod.mass * abs(centre) ** 2

    def flow(t: float, y: np.ndarray) -> list[float]:
        turn = np.exp(1j * y[0])
        apart, rate = wall - arm * turn, -1j * y[1] * arm * turn
        along = apart / abs(apart)
        pull = spring.stiffness * (abs(apart) - spring.length) + spring.damping * (np.conj(along) * rate).real
        torque = (np.conj(arm * turn) * pull * along + np.conj(centre * turn) * rod.mass * complex(*m.gravity)).imag
        return [y[1], float(torque / inertia)]

    start = [trace.signals[f"{rod.name}_angle"][0], 0.0]
    found = solve_ivp(flow, (0.0, 0.6), start, "DOP853", times, rtol=1e-11, atol=1e-12)
    assert np.ptp(found.y[0]) > 0.05
    close(trace.signals[f"{rod.name}_angle"], found.y[0], 1e-6)


@pytest.mark.parametrize("motion", ["driven", "static"])
def test_a_spring_between_two_moving_bodies_pulls_each_as_the_other(motion: Motion) -> None:
    """From the crank's pin A to the follower's pin E on the ground: it loads the pins D and E, and nothing else."""
    bare = load("paper").with_clearances({})
    spring = Spring(bodies=("crank", "follower"), points=("A", "E"), stiffness=300.0, length=0.2, damping=30.0)
    theta = np.radians(np.linspace(30.0, 60.0, 5))
    found, without = (
        ENGINE.simulate(Request(m, "ideal", motion, theta)) for m in (bare.replace(springs=(spring,)), bare)
    )
    crank = bare.moving["crank"]
    reach = (crank.point("A") - crank.point("D")) * np.exp(1j * theta)
    speed = float(bare.speed or 0.0) if motion == "driven" else 0.0
    apart, rate = bare.ground.point("E") - bare.ground.point("D") - reach, -1j * speed * reach
    pull = (300.0 * (np.abs(apart) - 0.2) + 30.0 * np.real(np.conj(apart) * rate) / np.abs(apart)) * apart
    pull = pull / np.abs(apart)
    extra = {n: vector(found, f"reaction_{n}") - vector(without, f"reaction_{n}") for n in ("D", "A", "B", "E")}
    sign = {name: 1.0 if bare.joint(name).bodies[0] == "ground" else -1.0 for name in ("D", "E")}
    most = np.abs(pull).max()
    close(sign["D"] * extra["D"], -pull, 1e-6 * most)
    close(sign["E"] * extra["E"], pull, 1e-6 * most)
    close(extra["A"], np.zeros(5), 1e-6 * most)
    close(extra["B"], np.zeros(5), 1e-6 * most)
    torque = found.signals["drive_torque"] - without.signals["drive_torque"]
    close(torque, -np.imag(np.conj(reach) * pull), 1e-6 * most)


def test_pins_begin_pressed_against_springs_and_their_dampers() -> None:
    m = sprung(ARM)
    courses, times = waved(m), np.linspace(0.0, 0.1, 5)
    trace = run(m.with_clearances({"K": 1e-5}), courses, times, "contact")
    _, posed = referee(m, courses, times)
    close(vector(trace, "reaction_K"), np.array([p.forces["K"] for p in posed]), 8e-4 * abs(posed[0].forces["K"]))
    assert trace.free_share == {"K": 0.0}


# ---------------------------------------------------------------- refusals


def test_what_cannot_be_followed_is_refused_in_words() -> None:
    courses = waved(load("3-rpr"))
    with pytest.raises(Unsupported, match="give each drive its course"):
        run(load("3-rpr"), {"S1": courses["S1"]}, TIMES)
    with pytest.raises(AssemblyError):
        run(load("3-rpr"), courses | {"S1": (KNOTS, courses["S1"][1] + 3.0 * KNOTS)}, TIMES)
    soft = load("paper").replace(drives=(Drive(joint="D", speed="measured", stiffness=500.0),))
    with pytest.raises(Unsupported, match="rigidly"):
        run(soft, {"D": (KNOTS, np.radians(30.0) + KNOTS)}, TIMES)

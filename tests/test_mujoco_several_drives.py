"""MuJoCo with several drives, with freedoms that nothing drives, and with springs between points: against a referee in
maximal coordinates, against equations of motion written here, and against the balance of energy.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import pytest
from numpy.polynomial import Chebyshev
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.motion import Gap, kinematics
from analytic.mechanism import MASS_CENTRE, Body, Drive, Load, Mechanism, Spring
from analytic.mechanism.file import load
from analytic.paper.kinetostatics import Reactions, kinetostatics
from marks import slow
from maximal import Maximal, Posed
from several_linkages import CASES, KNOTS, TIMES, Knots, referee, splines, third_bar, waved
from sim_models.engine import JOINT_MODELS, Cause, JointModel, Motion, Request, SimulationError, Trace, Unsupported
from sim_models.mujoco.engine import ENGINE

pytestmark = pytest.mark.mujoco

CLEARANCE_MODELS: tuple[JointModel, ...] = JOINT_MODELS[1:]
G = 9.81  # m/s^2
ARM = load("2r-arm")
FIVE_BAR = load("five-bar")
LOOSE = 2e-4  # m
LATER = ("3-rrr with springs", "five-bar with springs")  # for the long suite


def run(m: Mechanism, courses: Knots, times: np.ndarray, model: JointModel = "ideal", **fields: object) -> Trace:
    return ENGINE.simulate(Request(m, model, "driven", time=times, courses=courses, **fields))


def turned_round(m: Mechanism, *names: str) -> Mechanism:
    """The mechanism with these joints' bodies the other way round, and rods driven the other way along."""
    return m.replace(
        joints=tuple(j.model_copy(update={"bodies": j.bodies[::-1]}) if j.name in names else j for j in m.joints)
    )


def vector(trace: Trace, name: str) -> np.ndarray:
    return np.asarray(trace.signals[f"{name}_x"] + 1j * trace.signals[f"{name}_y"])


def close(seen: np.ndarray, right: np.ndarray, within: float) -> None:
    np.testing.assert_allclose(seen, right, rtol=0, atol=within)


def agrees(m: Mechanism, trace: Trace, judge: Maximal, posed: list[Posed], within: float = 1e-5) -> None:
    """Poses to 1e-6 rad (or lengths), rates to 1e-5, all forces that are determined to a share of the largest one."""
    size = max(body.length for body in m.bodies)
    largest = max(abs(p.forces[j.name]) for p in posed for j in m.joints)
    for body in m.bodies:
        k = judge.index[body.name]
        at = np.array([judge.point(p.q, body.name, "com") for p in posed])
        rates, bends = (np.array([getattr(p, what)[k : k + 3] for p in posed]) for what in ("rates", "accelerations"))
        top = max(1.0, *(np.abs(p.rates).max() for p in posed))
        close(trace.signals[f"{body.name}_angle"], np.array([p.q[k + 2] for p in posed]), 1e-6)
        close(vector(trace, body.name), at, 1e-6 * size)
        close(trace.signals[f"{body.name}_angular_velocity"], rates[:, 2], 1e-5 * top)
        close(trace.rates[body.name].velocity, rates[:, 0] + 1j * rates[:, 1], 1e-5 * size * top)
        close(
            body.mass * trace.rates[body.name].acceleration,
            body.mass * (bends[:, 0] + 1j * bends[:, 1]),
            within * largest,
        )
    known = {j.name for j in m.joints} - posed[0].undetermined
    for name in known:
        close(vector(trace, f"reaction_{name}"), np.array([p.forces[name] for p in posed]), within * largest)
    for name in posed[0].moments:
        seen = trace.signals[f"reaction_{name}_moment"]
        close(seen, np.array([p.moments[name] for p in posed]), within * largest * size)
    most = max((abs(x) for p in posed for x in p.motors.values()), default=0.0)
    for name in posed[0].motors:
        kind = "force" if m.joint(name).prismatic else "torque"
        signal = f"drive_{kind}_{name}" if len(posed[0].motors) > 1 or kind == "force" else "drive_torque"
        close(trace.signals[signal], np.array([p.motors[name] for p in posed]), within * most)


# ---------------------------------------------------------------- ideal joints along courses


@pytest.mark.parametrize("name", [n for n in CASES if n not in LATER] + slow(*LATER))
def test_every_drive_follows_its_course_with_the_forces_of_the_referee(name: str) -> None:
    m = CASES[name].with_clearances({})
    courses = waved(m)
    trace = run(m, courses, TIMES)
    agrees(m, trace, *referee(m, courses, TIMES))
    first = m.drives[0].joint
    close(trace.crank_angle, splines(courses)[first](TIMES), 1e-10)


@pytest.mark.parametrize(
    ("case", "joints"), [("five-bar", ("D", "A")), ("2r-arm", ("O", "K")), ("3-rpr", ("S1", "A2"))]
)
def test_it_does_not_matter_which_body_of_a_joint_is_its_first(case: str, joints: tuple[str, ...]) -> None:
    m = turned_round(load(case), *joints)
    trace = run(m, waved(m), TIMES)
    agrees(m, trace, *referee(m, waved(m), TIMES))


def test_what_motors_give_is_what_the_linkage_gains_in_energy_and_loses_in_dampers() -> None:
    m = CASES["3-rpr with springs"]
    times = np.linspace(0.0, 0.3, 151)
    trace, motors = run(m, waved(m), times), splines(waved(m))
    power = sum(trace.signals[f"drive_force_{n}"] * f(times, 1) for n, f in motors.items())
    lost, spin = np.zeros(times.size), {b.name: trace.signals[f"{b.name}_angular_velocity"] for b in m.bodies}
    for joint in m.joints:
        rate = CubicSpline(times, trace.signals[f"position_{joint.name}"])(times, 1)
        lost += joint.damping * rate**2
    apart = np.exp(1j * trace.signals["platform_angle"]) * m.body("platform").point("C3")
    rod = vector(trace, "platform") + apart - m.ground.point("A1")
    moving = trace.rates["platform"].velocity + 1j * spin["platform"] * apart
    stretched = np.real(np.conj(rod) * moving) / np.abs(rod)
    lost += m.springs[0].damping * stretched**2
    held = energy(m, trace) + m.springs[0].stiffness * (np.abs(rod) - m.springs[0].length) ** 2 / 2
    for joint in m.joints:
        held = held + joint.stiffness * trace.signals[f"position_{joint.name}"] ** 2 / 2
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

    def at(body: Body, point: str) -> np.ndarray:
        arm = body.point(point) - body.point("com")
        return np.asarray(vector(trace, body.name) + arm * np.exp(1j * trace.signals[f"{body.name}_angle"]))

    for body in m.bodies:
        total -= body.mass * np.real(np.conj(complex(*m.gravity)) * at(body, MASS_CENTRE))
    for load_ in m.loads:
        total -= np.real(np.conj(complex(*load_.force)) * at(m.moving[load_.body], load_.point))
        total -= load_.torque * trace.signals[f"{load_.body}_angle"]
    return total


@pytest.mark.parametrize("clock", [0.0, 5.0])
def test_reports_come_in_the_order_asked_for_at_the_times_of_the_courses_clock(clock: float) -> None:
    courses = {name: (knots + clock, at) for name, (knots, at) in waved(FIVE_BAR).items()}
    times = np.array([0.31, 0.0, 0.6, 0.005, 0.31])
    trace = run(FIVE_BAR, courses, times + clock)
    np.testing.assert_array_equal(trace.time, times + clock)
    for name, f in splines(waved(FIVE_BAR)).items():
        close(trace.signals[f"position_{name}"], f(times), 1e-9)
    assert trace.signals["drive_torque_D"][0] == pytest.approx(trace.signals["drive_torque_D"][4], rel=1e-5)


def test_a_linkage_a_thousand_times_smaller_and_a_million_times_lighter_runs_as_well() -> None:
    def shrunk(points: Mapping[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
        return {name: (x / 1e3, y / 1e3) for name, (x, y) in points.items()}

    small = FIVE_BAR.replace(
        ground=FIVE_BAR.ground.model_copy(update={"points": shrunk(FIVE_BAR.ground.points)}),
        bodies=tuple(
            b.model_copy(update={"points": shrunk(b.points), "mass": b.mass / 1e6, "section": (1e-5, 1e-5)})
            for b in FIVE_BAR.bodies
        ),
        loads=(Load(body="left-arm", point="P", force=(0.0, -2e-5)),),
    )
    soon = TIMES / 20  # its gravity is as fast as that of a linkage that is thirty times slower
    trace = run(small, waved(small), soon)
    agrees(small, trace, *referee(small, waved(small), soon))


def test_courses_that_cannot_be_followed_are_the_requests_fault() -> None:
    m, courses = load("3-rrr"), waved(load("3-rrr"))
    knots, at = courses["A1"]
    with pytest.raises(AssemblyError, match=r"A1 = .*(cannot be reached|change point)|change point at A1"):
        run(m, {**courses, "A1": (knots, at + 6 * knots)}, TIMES)


def test_a_drive_that_yields_is_refused() -> None:
    crank = load("crank-rocker")
    assert crank.drive is not None
    m = crank.replace(drive=crank.drive.model_copy(update={"stiffness": 50.0}))
    with pytest.raises(Unsupported, match="stiffness"):
        run(m, waved(m), TIMES)


# ---------------------------------------------------------------- nothing drives all of it


def double_pendulum(m: Mechanism, times: np.ndarray, forced: Callable[[float], float] | None = None) -> np.ndarray:
    """Angles (2, N) of the two links by Lagrange's equations, from the assembly at rest; ``forced`` is the first link's
    angle where a motor has it, of constant speed.
    """
    upper, fore = m.bodies
    l1, a1, a2 = (abs(x) for x in (upper.point("K"), upper.centre, fore.centre))

    def accelerations(p: float, q: float, dp: float, dq: float) -> tuple[float, float]:
        c, s, m2 = np.cos(p - q), np.sin(p - q), fore.mass
        matrix = np.array(
            [
                [upper.moment_of_inertia + upper.mass * a1**2 + m2 * l1**2, m2 * l1 * a2 * c],
                [m2 * l1 * a2 * c, fore.moment_of_inertia + m2 * a2**2],
            ]
        )
        right = np.array(
            [
                -m2 * l1 * a2 * s * dq**2 - (upper.mass * a1 + m2 * l1) * G * np.cos(p),
                m2 * l1 * a2 * s * dp**2 - m2 * a2 * G * np.cos(q),
            ]
        )
        if forced is not None:
            return 0.0, float(right[1] / matrix[1, 1])
        found = np.linalg.solve(matrix, right)
        return float(found[0]), float(found[1])

    start = [m.assembly["upper-arm"], m.assembly["forearm"], 0.0, 0.0]
    if forced is not None:
        speed = forced(1.0) - forced(0.0)
        start[2:] = [speed, speed]  # the elbow at rest
    found = solve_ivp(
        lambda t, y: [y[2], y[3], *accelerations(*y)],
        (0.0, float(times[-1])), start, "DOP853", times, rtol=1e-11, atol=1e-12,
    )  # fmt: skip
    return np.asarray(found.y[:2])


def test_a_double_pendulum_swings_as_lagrange_says_and_keeps_its_energy() -> None:
    m = ARM.replace(drives=(), assembly={"upper-arm": 0.2, "forearm": -0.6})
    times = np.linspace(0.0, 1.0, 21)
    trace, right = run(m, {}, times), double_pendulum(m, times)
    for name, angle in zip(("upper-arm", "forearm"), right, strict=True):
        close(trace.signals[f"{name}_angle"], angle, 1e-6)
    assert np.ptp(energy(m, trace)) < 1e-8
    assert not [name for name in trace.signals if name.startswith("drive")]
    np.testing.assert_array_equal(trace.crank_angle, trace.signals["upper-arm_angle"])


def test_a_forearm_hangs_freely_on_a_driven_arm() -> None:
    m = ARM.replace(
        drives=(Drive(joint="O", speed=2.0), Drive(joint="K", speed="free")),
        assembly={"upper-arm": -1.2, "forearm": -1.0},
    )
    times = np.linspace(0.0, 0.6, 13)
    trace = run(m, {"O": (KNOTS, -1.2 + 2.0 * KNOTS)}, times)
    right = double_pendulum(m, times, lambda t: -1.2 + 2.0 * t)
    close(trace.signals["upper-arm_angle"], right[0], 1e-10)
    close(trace.signals["forearm_angle"], right[1], 1e-6)
    gained = CubicSpline(times, 2.0 * trace.signals["drive_torque"]).antiderivative()(times)
    assert energy(m, trace)[-1] - energy(m, trace)[0] == pytest.approx(float(gained[-1]), rel=1e-3)


def test_loops_with_one_drive_too_few_move_as_the_referee_says() -> None:
    m = FIVE_BAR.replace(drives=(Drive(joint="D", speed=2.0), Drive(joint="E", speed="free")))
    at, times = Assembly(m).positions, np.linspace(0.0, 0.04, 5)
    course = {"D": (KNOTS, at["D"] + 2.0 * KNOTS)}
    trace, motor = run(m, course, times), CubicSpline(*course["D"])
    held = Maximal(m, ("D", "E"))
    start = held.driven_at(held.home(at), {"D": (at["D"], 2.0, 0.0), "E": (at["E"], 0.0, 0.0)})
    judge = Maximal(m, ("D",))
    posed = judge.released(start.q, start.rates, times, {"D": lambda t, order: float(motor(t, order))})
    agrees(m, trace, judge, posed, 3e-5)


# ---------------------------------------------------------------- clearance


def on_the_rims(
    m: Mechanism, loose: Mapping[str, float], courses: Knots, stiffness: float, times: np.ndarray
) -> Reactions:
    """The linkage at times (N,) s with its pins always pressed: gaps along their own reactions, moving as these do.

    Gaps are polynomials in time; without them, rates of rates of samples would be rounding.
    """
    assembly, motors = Assembly(m.with_clearances({})), splines(courses)
    some = 0.15 - 0.15 * np.cos(np.pi * np.arange(41) / 40)  # s

    def moved(at: np.ndarray, gaps: Mapping[str, Chebyshev]) -> Reactions:
        inputs = (assembly.inputs_at({n: f(at, order) for n, f in motors.items()}) for order in range(3))
        moving = {n: Gap(g(at), g.deriv(1)(at), g.deriv(2)(at)) for n, g in gaps.items()}
        return kinetostatics(kinematics(assembly, *inputs, moving))

    gaps: dict[str, Chebyshev] = {}
    for _ in range(8):
        forces, before = moved(some, gaps).forces, gaps
        pressed = {
            n: (size + np.abs(forces[n]) / stiffness) * np.exp(1j * np.angle(forces[n])) for n, size in loose.items()
        }
        gaps = {n: Chebyshev.fit(some, at, 12) for n, at in pressed.items()}
    assert max(np.abs(gaps[n](some) - before[n](some)).max() for n in loose) < 1e-6 * LOOSE
    assert max(np.abs(gaps[n](some) - pressed[n]).max() for n in loose) < 1e-3 * LOOSE
    return moved(times, gaps)


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
        ("2r-arm", "contact"),
        *slow(*((case, model) for case in PINS for model in CLEARANCE_MODELS)),
    ],
)  # fmt: skip
def test_loose_pins_begin_pressed_and_stay_so(case: str, model: JointModel) -> None:
    m, loose = load(case.split(",")[0]), dict.fromkeys(PINS[case], LOOSE)
    courses, at = waved(m), np.linspace(0.0, 0.28, 9)
    trace = run(m.with_clearances(loose), courses, at, model)
    assert trace.settings["start"] == "equilibrium"
    assert trace.free_share == dict.fromkeys(loose, 0.0)
    truth = on_the_rims(m, loose, courses, float(trace.settings.get("contact_stiffness", np.inf)), at)
    right = truth.signals()
    largest = max(np.abs(force).max() for force in truth.forces.values())
    most = max(np.abs(values).max() for name, values in right.items() if name.startswith("drive"))
    for name, values in right.items():
        if name.endswith("_angle"):
            close(trace.signals[name], values, 5e-6)
        elif name.startswith("reaction") and not name.endswith("moment"):
            close(trace.signals[name], values, 5e-4 * largest)
        elif name.startswith("drive"):
            close(trace.signals[name], values, 5e-4 * most)
        elif name.startswith("clearance") and name[:-2].removeprefix("clearance_") in loose:
            close(trace.signals[name], values, 2e-3 * LOOSE)


class Rattling(Maximal):
    """The five-bar with its pin P out of the rows: a journal in a bearing that pushes with max(0, K d + C d')."""

    def __init__(self, m: Mechanism, clearance: float, stiffness: float, damping: float) -> None:
        super().__init__(m.replace(joints=tuple(j for j in m.joints if j.name != "P")), ("D", "E"))
        self.law = clearance, stiffness, damping

    def contact(self, q: np.ndarray, rates: np.ndarray) -> tuple[complex, complex]:
        """Gap (m) of the pin, first less second, and the force (N) on the second body."""
        clearance, stiffness, damping = self.law
        gap = self.point(q, "left-arm", "P") - self.point(q, "right-arm", "P")
        rate = self.velocity(q, rates, "left-arm", "P") - self.velocity(q, rates, "right-arm", "P")
        depth = abs(gap) - clearance
        if depth <= 0:
            return gap, 0j
        along = gap / abs(gap)
        return gap, max(0.0, stiffness * depth + damping * (np.conj(along) * rate).real) * along

    def forces(self, q: np.ndarray, rates: np.ndarray) -> np.ndarray:
        out, (_, force) = super().forces(q, rates), self.contact(q, rates)
        for body, push in (("right-arm", force), ("left-arm", -force)):
            k, arm = self.index[body], self.arm(q, body, "P")
            out[k : k + 3] += push.real, push.imag, (np.conj(arm) * push).imag
        return out


@pytest.mark.parametrize("model", ["spring-damper", *slow("contact")])
def test_a_pin_that_starts_centred_falls_and_bounces_as_its_equation_says(model: JointModel) -> None:
    m = FIVE_BAR.with_joint("P", clearance=1e-4, contact_stiffness=1e6, contact_damping=60.0)
    courses, times = waved(m), np.linspace(0.0, 6e-3, 31)
    trace = run(m, courses, times, model, start="centred", step=2e-6)
    ideal, motors = Maximal(m, ("D", "E")), splines(courses)
    at = {n: (float(f(0)), float(f(0, 1)), float(f(0, 2))) for n, f in motors.items()}
    start = ideal.driven_at(ideal.home({n: x for n, (x, *_) in at.items()}), at)
    judge = Rattling(m, 1e-4, 1e6, 60.0)
    posed = judge.released(
        start.q, start.rates, times, {n: lambda t, k, f=f: float(f(t, k)) for n, f in motors.items()}
    )
    gap, force = np.array([judge.contact(p.q, p.rates) for p in posed]).T
    assert 0 < np.count_nonzero(force) < force.size
    close(vector(trace, "clearance_P"), gap, 3e-7)  # a step in which contact begins or ends is of the first order
    close(vector(trace, "reaction_P"), force, 5e-3 * np.abs(force).max())
    close(trace.signals["drive_torque_D"], np.array([p.motors["D"] for p in posed]), 5e-3 * np.abs(force).max() * 0.1)


@pytest.mark.parametrize("model", ["spring-damper", "contact"])
def test_pins_of_what_moves_freely_begin_pressed(model: JointModel) -> None:
    m = ARM.replace(
        drives=(Drive(joint="O", speed=2.0), Drive(joint="K", speed="free")),
        assembly={"upper-arm": -1.2, "forearm": -1.0},
    )
    times, course = np.linspace(0.0, 0.3, 7), {"O": (KNOTS, -1.2 + 2.0 * KNOTS)}
    ideal, loose = run(m, course, times), run(m.with_clearances({"K": 5e-5}), course, times, model)
    assert loose.free_share == {"K": 0.0}
    close(loose.signals["forearm_angle"], ideal.signals["forearm_angle"], 2e-3)
    force, gap = vector(ideal, "reaction_K")[0], vector(loose, "clearance_K")[0]
    assert abs(np.angle(gap / force)) < 1e-6


def test_loops_that_hold_too_much_are_started_centred() -> None:
    m = third_bar().with_clearances({"f2": 1e-3})
    courses = waved(m)
    with pytest.raises(SimulationError, match="start it centred") as failure:
        run(m, courses, TIMES, "contact")
    assert failure.value.cause is Cause.NO_START
    trace = run(m, courses, TIMES, "contact", start="centred")
    ideal = run(m, courses, TIMES)
    close(
        trace.signals["drive_torque"], ideal.signals["drive_torque"], 0.02 * np.abs(ideal.signals["drive_torque"]).max()
    )


# ---------------------------------------------------------------- springs between points


def on_a_spring(m: Mechanism, **law: float) -> Mechanism:
    spring = Spring(bodies=("ground", "coupler"), points=("E", "com"), stiffness=60.0, length=0.1, **law)
    return m.replace(springs=(spring,))


@pytest.mark.parametrize("model", ["ideal", "contact", *slow("massless-link", "spring-damper")])
def test_at_rest_a_spring_holds_by_its_stretch_and_its_damper_does_nothing(model: JointModel) -> None:
    """The torque that holds the crank is the slope of the energy over its angle, pins on their rims or not."""
    m = on_a_spring(load("paper"), damping=40.0).with_clearances({} if model == "ideal" else {"B": 1e-4})
    theta = np.radians(np.linspace(30.0, 60.0, 121))
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
    theta = np.radians(np.linspace(30.0, 60.0, 61))
    with_it, without = (
        ENGINE.simulate(Request(m, model, "driven", theta)) for m in (on_a_spring(bare, damping=40.0), bare)
    )
    spring = on_a_spring(bare, damping=40.0).springs[0]
    apart = vector(with_it, "coupler") - bare.ground.point("E")
    coupler, body = with_it.rates["coupler"], bare.moving["coupler"]
    arm = (body.point("com") - body.centre) * np.exp(1j * with_it.signals["coupler_angle"])
    moving = coupler.velocity + 1j * with_it.signals["coupler_angular_velocity"] * arm
    along = apart / np.abs(apart)
    pull = spring.stiffness * (np.abs(apart) - spring.length) + spring.damping * np.real(np.conj(along) * moving)
    taken = pull * np.real(np.conj(along) * moving) / float(bare.speed or 1.0)
    extra = with_it.signals["drive_torque"] - without.signals["drive_torque"]
    assert np.abs(spring.damping * np.real(np.conj(along) * moving)).max() > 1.0
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
    times, spring = np.linspace(0.0, 1.0, 21), m.springs[0]
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
    found = solve_ivp(flow, (0.0, 1.0), start, "DOP853", times, rtol=1e-11, atol=1e-12)
    assert np.ptp(found.y[0]) > 0.05
    close(trace.signals[f"{rod.name}_angle"], found.y[0], 1e-7)


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
    pull = 300.0 * (np.abs(apart) - 0.2) + 30.0 * np.real(np.conj(apart) * rate) / np.abs(apart)
    extra = {n: vector(found, f"reaction_{n}") - vector(without, f"reaction_{n}") for n in ("D", "A", "B", "E")}
    sign = {name: 1.0 if bare.joint(name).bodies[0] == "ground" else -1.0 for name in ("D", "E")}
    most = np.abs(pull).max()
    close(sign["D"] * extra["D"], -pull * apart / np.abs(apart), 1e-6 * most)
    close(sign["E"] * extra["E"], pull * apart / np.abs(apart), 1e-6 * most)
    close(extra["A"], np.zeros(5), 1e-6 * most)
    close(extra["B"], np.zeros(5), 1e-6 * most)
    torque = found.signals["drive_torque"] - without.signals["drive_torque"]
    close(torque, -np.imag(np.conj(reach) * pull * apart / np.abs(apart)), 1e-6 * most)

"""What the engines' tests of several drives, free freedoms and springs between points hold them to, beside the referee
in maximal coordinates: equations of motion written here, the energy, and pins that stay on their rims.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.polynomial import Chebyshev
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import Gap, kinematics
from analytic.mechanism import MASS_CENTRE, Drive, Mechanism, Spring
from analytic.mechanism.file import load
from analytic.paper.kinetostatics import Reactions, kinetostatics
from engine_checks import vector
from maximal import Maximal, Posed
from several_linkages import Knots, splines
from sim_models.engine import Trace

G = 9.81  # m/s^2
ARM = load("2r-arm")
SWINGING = ARM.replace(drives=(), assembly={"upper-arm": 0.2, "forearm": -0.6})
HANGING = ARM.replace(  # its shoulder turns by a motor, and its elbow is free
    drives=(Drive(joint="O", speed=2.0), Drive(joint="K", speed="free")),
    assembly={"upper-arm": -1.2, "forearm": -1.0},
)


def close(seen: np.ndarray, right: np.ndarray, within: float, what: str = "") -> None:
    np.testing.assert_allclose(seen, right, rtol=0, atol=within, err_msg=what)


def turned_round(m: Mechanism, *names: str) -> Mechanism:
    """The mechanism with these joints' bodies the other way round, and rods driven the other way along."""
    return m.replace(
        joints=tuple(j.model_copy(update={"bodies": j.bodies[::-1]}) if j.name in names else j for j in m.joints)
    )


def agrees(
    m: Mechanism, trace: Trace, judge: Maximal, posed: list[Posed],
    *, within: float, motors: float, places: float = 1e-6, rates: float,
) -> None:  # fmt: skip
    """Angles to ``places`` rad, places to that share of the longest body, ``rates`` likewise of the fastest; what is
    determined of forces ``within`` a share of the largest one, what ``motors`` do to one of their largest.
    """
    size = max(body.length for body in m.bodies)
    largest = max(abs(p.forces[j.name]) for p in posed for j in m.joints)
    top = max(1.0, *(np.abs(p.rates).max() for p in posed))
    for body in m.bodies:
        k = judge.index[body.name]
        at = np.array([judge.point(p.q, body.name, "com") for p in posed])
        speeds, bends = (np.array([getattr(p, what)[k : k + 3] for p in posed]) for what in ("rates", "accelerations"))
        close(trace.signals[f"{body.name}_angle"], np.array([p.q[k + 2] for p in posed]), places)
        close(vector(trace, body.name), at, places * size)
        close(trace.signals[f"{body.name}_angular_velocity"], speeds[:, 2], rates * top)
        close(trace.rates[body.name].velocity, speeds[:, 0] + 1j * speeds[:, 1], rates * size * top)
        inertia = body.mass * trace.rates[body.name].acceleration
        close(inertia, body.mass * (bends[:, 0] + 1j * bends[:, 1]), within * largest)
    forces_agree(m, trace.signals, posed, within=within, motors=motors)


def forces_agree(
    m: Mechanism, signals: Mapping[str, np.ndarray], posed: list[Posed], *, within: float, motors: float
) -> None:
    """What is determined of forces and moments ``within`` a share of the largest force, what ``motors`` do likewise."""
    size = max(body.length for body in m.bodies)
    largest = max(abs(p.forces[j.name]) for p in posed for j in m.joints)
    for name in {j.name for j in m.joints} - posed[0].undetermined:
        close(vector(signals, f"reaction_{name}"), np.array([p.forces[name] for p in posed]), within * largest, name)
    for name in posed[0].moments:
        seen = signals[f"reaction_{name}_moment"]
        close(seen, np.array([p.moments[name] for p in posed]), within * largest * size, name)
    most = max((abs(x) for p in posed for x in p.motors.values()), default=0.0)
    for name in posed[0].motors:
        kind = "force" if m.joint(name).prismatic else "torque"
        signal = f"drive_{kind}_{name}" if len(posed[0].motors) > 1 or kind == "force" else "drive_torque"
        close(signals[signal], np.array([p.motors[name] for p in posed]), motors * most, name)


# ---------------------------------------------------------------- energy


def place(m: Mechanism, trace: Trace, body: str, point: str) -> np.ndarray:
    """Where a body's point is (N,), complex, m."""
    if body == "ground":
        return np.full(trace.crank_angle.size, m.ground.point(point))
    own, turn = m.moving[body], np.exp(1j * trace.signals[f"{body}_angle"])
    return np.asarray(vector(trace, body) + (own.point(point) - own.point("com")) * turn)


def resting(m: Mechanism, trace: Trace) -> np.ndarray:
    """Energy (N,) J of weights and dead loads."""
    total = np.zeros(trace.crank_angle.size)
    for body in m.bodies:
        weight = body.mass * np.conj(complex(*m.gravity))
        total -= np.real(weight * place(m, trace, body.name, MASS_CENTRE))
    for dead in m.loads:
        total -= np.real(np.conj(complex(*dead.force)) * place(m, trace, dead.body, dead.point))
        total -= dead.torque * trace.signals[f"{dead.body}_angle"]
    return total


def stretched(m: Mechanism, trace: Trace) -> np.ndarray:
    """Energy (N,) J of springs between points."""
    total = np.zeros(trace.crank_angle.size)
    for spring in m.springs:
        near, far = (place(m, trace, *end) for end in spring.ends)
        total += spring.stiffness * (np.abs(far - near) - spring.length) ** 2 / 2
    return total


def energy(m: Mechanism, trace: Trace) -> np.ndarray:
    """Energy (N,) J of motion, weights, dead loads and springs between points."""
    total = resting(m, trace) + stretched(m, trace)
    for body in m.bodies:
        total += body.mass * np.abs(trace.rates[body.name].velocity) ** 2 / 2
        total += body.moment_of_inertia * trace.signals[f"{body.name}_angular_velocity"] ** 2 / 2
    return total


def gains_what_motors_give(m: Mechanism, trace: Trace, courses: Knots, times: np.ndarray) -> None:
    """3-rpr with springs: power of its motors, less that of dampers, is the growth of its energy."""
    power = sum(trace.signals[f"drive_force_{n}"] * f(times, 1) for n, f in splines(courses).items())
    lost, held = np.zeros(times.size), energy(m, trace)
    for joint in m.joints:
        where = trace.signals[f"position_{joint.name}"]
        lost += joint.damping * CubicSpline(times, where)(times, 1) ** 2
        held = held + joint.stiffness * where**2 / 2
    apart = np.exp(1j * trace.signals["platform_angle"]) * m.body("platform").point("C3")
    rod = vector(trace, "platform") + apart - m.ground.point("A1")
    moving = trace.rates["platform"].velocity + 1j * trace.signals["platform_angular_velocity"] * apart
    lost += m.springs[0].damping * (np.real(np.conj(rod) * moving) / np.abs(rod)) ** 2
    gained = CubicSpline(times, power - lost).antiderivative()(times)
    close(held - held[0], gained - gained[0], 2e-6 * np.abs(power).max() * times[-1])


# ---------------------------------------------------------------- equations of motion


def double_pendulum(m: Mechanism, times: np.ndarray, speed: float | None = None) -> np.ndarray:
    """Angles (2, N) rad of an arm's two links by Lagrange's equations, from the assembly at rest, or with the elbow at
    rest where a motor turns the first at a constant ``speed`` (rad/s).
    """
    upper, fore = m.bodies
    l1, a1, a2 = (abs(x) for x in (upper.point("K"), upper.centre, fore.centre))

    def flow(t: float, y: np.ndarray) -> list[float]:
        p, q, dp, dq = y
        c, s, m2 = np.cos(p - q), np.sin(p - q), fore.mass
        first = upper.moment_of_inertia + upper.mass * a1**2 + m2 * l1**2
        matrix = np.array([[first, m2 * l1 * a2 * c], [m2 * l1 * a2 * c, fore.moment_of_inertia + m2 * a2**2]])
        right = -m2 * l1 * a2 * s * np.array([dq**2, -(dp**2)])
        right -= G * np.array([(upper.mass * a1 + m2 * l1) * np.cos(p), m2 * a2 * np.cos(q)])
        if speed is not None:
            return [dp, dq, 0.0, float(right[1] / matrix[1, 1])]
        return [dp, dq, *np.linalg.solve(matrix, right)]

    start = [m.assembly["upper-arm"], m.assembly["forearm"], speed or 0.0, speed or 0.0]
    found = solve_ivp(flow, (0.0, float(times[-1])), start, "DOP853", times, rtol=1e-11, atol=1e-12)
    return np.asarray(found.y[:2])


def pendulum_on_a_spring() -> Mechanism:
    """The shipped pendulum, let go, with a spring and damper from its tip to the ground."""
    m = load("pendulum")
    spring = Spring(bodies=(m.bodies[0].name, "ground"), points=("tip", "W"), stiffness=40.0, length=0.15, damping=0.5)
    return m.replace(
        drives=(Drive(joint="O", speed="free"),),
        ground=m.ground.model_copy(update={"points": {**m.ground.points, "W": (0.3, 0.2)}}),
        springs=(spring,),
    )


def swung_on_its_spring(m: Mechanism, times: np.ndarray) -> np.ndarray:
    """Angle (N,) rad of that pendulum by its equation of motion, from the assembly at rest."""
    rod, spring = m.bodies[0], m.springs[0]
    arm, centre, wall = rod.point("tip"), rod.centre, m.ground.point("W")  # its pin is the origin of both frames
    inertia = rod.moment_of_inertia + rod.mass * abs(centre) ** 2

    def flow(t: float, y: np.ndarray) -> list[float]:
        turn = np.exp(1j * y[0])
        apart, rate = wall - arm * turn, -1j * y[1] * arm * turn
        along = apart / abs(apart)
        pull = spring.stiffness * (abs(apart) - spring.length) + spring.damping * (np.conj(along) * rate).real
        torque = (np.conj(arm * turn) * pull * along + np.conj(centre * turn) * rod.mass * complex(*m.gravity)).imag
        return [y[1], float(torque / inertia)]

    start = [Assembly(m).start, 0.0]
    found = solve_ivp(flow, (0.0, float(times[-1])), start, "DOP853", times, rtol=1e-11, atol=1e-12)
    assert np.ptp(found.y[0]) > 0.05
    return np.asarray(found.y[0])


# ---------------------------------------------------------------- pins with clearance


def on_the_rims(
    m: Mechanism, courses: Knots, stiffness: Mapping[str, float], times: np.ndarray, until: float
) -> Reactions:
    """The linkage at times (N,) s with its pins always pressed: gaps along their own reactions, by clearance and force
    over ``stiffness`` (N/m), and moving as these do.

    Gaps are polynomials in time, up to ``until`` (s); without them, rates of rates of samples would be rounding.
    """
    assembly, motors = Assembly(m.with_clearances({})), splines(courses)
    some = until / 2 * (1 - np.cos(np.pi * np.arange(41) / 40))  # s

    def moved(at: np.ndarray, gaps: Mapping[str, Chebyshev]) -> Reactions:
        inputs = (assembly.inputs_at({n: f(at, order) for n, f in motors.items()}) for order in range(3))
        moving = {n: Gap(g(at), g.deriv(1)(at), g.deriv(2)(at)) for n, g in gaps.items()}
        return kinetostatics(kinematics(assembly, *inputs, moving))

    gaps: dict[str, Chebyshev] = {}
    for _ in range(8):
        forces, before = moved(some, gaps).forces, gaps
        pressed = {
            n: (c + np.abs(forces[n]) / stiffness[n]) * np.exp(1j * np.angle(forces[n]))
            for n, c in m.clearances.items()
        }
        gaps = {n: Chebyshev.fit(some, at, 12) for n, at in pressed.items()}
    for n, c in m.clearances.items():
        assert np.abs(gaps[n](some) - before[n](some)).max() < 1e-6 * c
        assert np.abs(gaps[n](some) - pressed[n]).max() < 1e-3 * c
    return moved(times, gaps)


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


def rattled(m: Mechanism, courses: Knots, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[Posed]]:
    """The five-bar whose pin P begins in the middle of its bearing: gap (N,) m, force (N,) N and all else."""
    ideal, motors, judge = Maximal(m, ("D", "E")), splines(courses), Rattling(m)
    at = {n: (float(f(0)), float(f(0, 1)), float(f(0, 2))) for n, f in motors.items()}
    start = ideal.driven_at(ideal.home({n: x for n, (x, *_) in at.items()}), at)
    posed = judge.released(
        start.q, start.rates, times, {n: lambda t, k, f=f: float(f(t, k)) for n, f in motors.items()}
    )
    gap, force = np.array([judge.contact(p.q, p.rates) for p in posed]).T
    assert 0 < np.count_nonzero(force) < force.size
    return gap, force, posed

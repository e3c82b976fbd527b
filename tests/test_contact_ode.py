"""The referee for momentum exchange, refereed: closed forms of one impact and of a bouncing journal, balances
through an impact, and the same linkages in maximal coordinates by another method.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import simpson, solve_ivp
from scipy.optimize import brentq

from analytic.mechanism import Mechanism
from analytic.mechanism.file import load
from analytic.mechanism.parts import ContactLaw
from marks import slow
from sim_models.common.contact_laws import NamedLaw, named_law
from tests.evidence import contact_ode as ode
from tests.evidence.contact_ode import ContactMotion, Loop, centred, kinetic, loop_of, pressed, simulate

# Factor chi by its author's formula, and the restitution delivered for .9, .7, .5 and .3 by chi (1 + e) =
# ln[(1 + chi)/(1 - chi e)]: Hunt and Crossley 1975, Lankarani and Nikravesh 1990, Flores et al. 2011, Gonthier et al.
# 2004 (the same table as in test_published_contact_laws, there by integration).
CHI: dict[ContactLaw, Callable[[float], float]] = {
    "hunt-crossley": lambda e: 3 * (1 - e) / 2,
    "lankarani-nikravesh": lambda e: 3 * (1 - e * e) / 4,
    "flores": lambda e: 8 * (1 - e) / (5 * e),
    "gonthier": lambda e: (1 - e * e) / e,
}
DELIVERED: dict[ContactLaw, tuple[float, ...]] = {
    "hunt-crossley": (0.90902, 0.76800, 0.66296, 0.58129),
    "lankarani-nikravesh": (0.91318, 0.79597, 0.72524, 0.68422),
    "flores": (0.89392, 0.68318, 0.47044, 0.25621),
    "gonthier": (0.87644, 0.66958, 0.48774, 0.30422),
}
NOMINAL = (0.9, 0.7, 0.5, 0.3)
LAWS: tuple[ContactLaw, ...] = ("kelvin-voigt", *CHI)


def rattling(case: str, law: ContactLaw, friction: float = 0.0, restitution: float = 0.8) -> Mechanism:
    """6000 rpm, 0.5 mm in B, gravity and a load on the first body."""
    stiffness = {"crank-rocker": 1e7, "slider-crank": 1e8}[case]
    m = load(case).with_joint(
        "B", clearance=5e-4, contact_stiffness=stiffness, restitution=restitution, contact_law=law, friction=friction
    )
    loads = [{"body": m.bodies[1].name, "point": "com", "force": (3.0, -8.0), "torque": 0.2}]
    loads.append({"body": m.bodies[0].name, "point": "A", "force": (0.0, 5.0)})
    return m.replace(gravity=(0.5, -9.81), loads=loads, drive=m.drive.model_copy(update={"speed": 200 * np.pi}))


# ---------------------------------------------------------------- one body: closed forms


def delivered(chi: float) -> float:
    """Restitution of F = K d (1 + chi d'/v0), by bracketing; 1 without damping."""
    if chi == 0:
        return 1.0
    return brentq(lambda e: chi * (1 + e) - math.log((1 + chi) / (1 - chi * e)), 1e-6, min(1.0, (1 - 1e-12) / chi))


def voigt(stiffness: float, damping: float, mass: float) -> tuple[float, float]:
    """Restitution, and deepest point over touching speed (s), of max(0, K d + C d') without a load, underdamped."""
    w = math.sqrt(stiffness / mass)
    ratio = damping / (2 * math.sqrt(stiffness * mass))
    own = w * math.sqrt(1 - ratio**2)

    def depth(t: float) -> float:
        return math.exp(-ratio * w * t) * math.sin(own * t) / own

    def rate(t: float) -> float:
        return math.exp(-ratio * w * t) * (math.cos(own * t) - ratio * w / own * math.sin(own * t))

    turned = brentq(rate, 0.0, math.pi / own)
    left = brentq(lambda t: stiffness * depth(t) + damping * rate(t), turned, math.pi / own)
    return -rate(left), depth(turned)


def bouncing(law: NamedLaw, push: float = 1e-6) -> tuple[ContactMotion, float]:
    """A slider (0.14 kg) whose bearing a constant force throws against a pin that stands still, from the middle."""
    m = load("slider-crank").with_joint("B", clearance=5e-4, contact_law=law.name)
    m = m.with_body("rod", inertia=1e15).replace(
        drive=m.drive.model_copy(update={"speed": 1e-9}),
        loads=[{"body": "slider", "point": "com", "force": (-push, 0.0)}],
    )
    loop = loop_of(m, 0.0, law)
    fall = math.sqrt(2 * loop.clearance * loop.mass2 / push)
    start = centred(m, loop)._replace(first_rate=0.0, second_rate=0.0)
    return simulate(m, loop, start, 12 * fall * loop.speed, step=fall / 200, most=6), push / loop.mass2


def closed_law(name: ContactLaw, e: float) -> tuple[NamedLaw, float, float]:
    """A law that is asked for e on 1e9 N/m, the restitution that it delivers to 0.14 kg, and deepest point over v0."""
    stiffness, mass = 1e9, 0.14
    if name == "kelvin-voigt":
        damping = 2 * (1 - e) * math.sqrt(stiffness * mass)
        return NamedLaw(name, stiffness, damping, 0.0, 0.0, e), *voigt(stiffness, damping, mass)
    chi = CHI[name](e)
    deepest = math.sqrt(2 * mass / stiffness * (1 / chi - math.log(1 + chi) / chi**2))
    return NamedLaw(name, stiffness, 0.0, chi, 0.0, e), delivered(chi), deepest


@pytest.mark.parametrize("name", CHI)
def test_the_laws_have_their_authors_factors_and_deliver_what_is_published(name: ContactLaw) -> None:
    for asked, published in zip(NOMINAL, DELIVERED[name], strict=True):
        m = rattling("crank-rocker", name, restitution=asked)
        law = named_law(m, m.joint("B"), "driven")
        assert law is not None
        assert law.hysteresis == pytest.approx(CHI[name](asked), rel=1e-14)
        assert law.damping == 0
        assert delivered(CHI[name](asked)) == pytest.approx(published, abs=6e-6)


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("asked", [0.9, 0.6])
def test_a_journal_bounces_by_the_closed_form(name: ContactLaw, asked: float) -> None:
    """Speeds fall by e, heights by e^2, flights last 2 v/a; the force's own work in the wall is next to none."""
    law, e, deepest = closed_law(name, asked)
    motion, pull = bouncing(law)
    touches = motion.impacts
    v0, speeds = math.sqrt(2 * pull * motion.loop.clearance), touches.approach
    assert touches.time[0] == pytest.approx(v0 / pull, rel=1e-8)
    np.testing.assert_allclose(speeds, v0 * e ** np.arange(len(speeds)), rtol=3e-4)
    np.testing.assert_allclose(touches.time[1:] - touches.left[:-1], 2 * speeds[1:] / pull, rtol=1e-6)
    np.testing.assert_allclose(touches.deepest, deepest * speeds, rtol=3e-4)
    np.testing.assert_allclose(touches.impulse[:5], 0.14 * (1 + e) * speeds[:5], rtol=3e-4)
    np.testing.assert_allclose(touches.lost[:5], 0.07 * (1 - e * e) * speeds[:5] ** 2, rtol=6e-4)
    for begin, end, speed in zip(touches.left[:4], touches.time[1:5], speeds[1:5], strict=True):
        flight = (motion.watched.time > begin) & (motion.watched.time < end)
        height = motion.loop.clearance - np.abs(motion.gap[flight]).min()
        assert height == pytest.approx(speed**2 / (2 * pull), rel=2e-3)  # between samples


# ---------------------------------------------------------------- balances through an impact


@pytest.mark.long_rows("slider-crank-kelvin-voigt")
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("case", ["crank-rocker", "slider-crank"])
def test_energy_balances_through_every_impact(case: str, law: ContactLaw) -> None:
    m = rattling(case, law, friction=0.1)
    loop = loop_of(m)
    touches = simulate(m, loop, centred(m, loop), 10 * np.pi).impacts
    whole = np.isfinite(touches.left)
    assert whole.sum() > 3
    gain = touches.after - touches.before
    kept = kinetic(loop, touches.left, touches.after) - kinetic(loop, touches.time, touches.before)
    residual = kept - gain[:, ode.MOTOR] - gain[:, ode.OTHERS] + touches.lost
    turned = np.abs(kept) + np.abs(gain[:, ode.MOTOR]) + touches.lost
    assert np.abs(residual / turned)[whole].max() < 1e-6
    assert (touches.lost[whole] > 0).all()


@pytest.mark.parametrize(("case", "theta"), [("crank-rocker", 2.0), ("slider-crank", 0.0)])
def test_momentum_balances_through_an_impact(case: str, theta: float) -> None:
    """From what is watched alone: the force's impulse on either body against the jump of what it moves."""
    m = rattling(case, "flores", friction=0.1).replace(loads=(), gravity=(0.0, 0.0))
    loop, who = loop_of(m, theta), ode.names_of(m)  # from there slip keeps its direction through the first impact
    motion = simulate(m, loop, centred(m, loop), 2 * np.pi, step=ode.contact_step(loop, 1 / 2000), most=2)
    ends = motion.impacts.time[0] - 1e-6, motion.impacts.left[0] + 1e-6
    one = slice(*np.searchsorted(motion.watched.time, ends))
    seen, time, force = motion.watched, motion.watched.time[one], motion.watched.force["B"][one]
    assert force[0] == force[-1] == 0
    assert motion.impacts.rubbed[0] > 0
    first, second, turn = (
        seen.angle[who.first][one],
        seen.angle[who.second][one],
        seen.angular_velocity[who.second][one],
    )
    pin2 = m.body(who.second).point("B") - m.body(who.second).centre
    met = (
        seen.place[who.second][one] + pin2 * np.exp(1j * second) + loop.rim * motion.gap[one] / np.abs(motion.gap[one])
    )
    # the second body: momentum along its slide, or moment of momentum about its pivot
    if loop.slides:
        speed = seen.velocity[who.second].real[one]
        assert m.body(who.second).mass * (speed[-1] - speed[0]) == pytest.approx(simpson(force.real, time), rel=1e-6)
    else:
        moment = _cross(met - loop.pivot, force)
        assert loop.inertia2 * (turn[-1] - turn[0]) == pytest.approx(simpson(moment, time), rel=1e-6)
    # the first: moment of momentum about the crank pin, which moves, so that its momentum is carried across
    place, velocity = seen.place[who.first][one], seen.velocity[who.first][one]
    knee = loop.hub + loop.arm * np.exp(1j * motion.crank[one])
    momentum = m.body(who.first).mass * velocity
    spin = m.body(who.first).moment_of_inertia * seen.angular_velocity[who.first][one]
    about = spin + _cross(place - knee, momentum)
    carried = -_cross(1j * loop.speed * (knee - loop.hub), momentum) - _cross(met - knee, force)
    assert about[-1] - about[0] == pytest.approx(simpson(carried, time), rel=1e-6)
    np.testing.assert_allclose(place - knee, loop.com1 * np.exp(1j * first), atol=1e-15)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return (a.conjugate() * b).imag


# ---------------------------------------------------------------- the same linkage otherwise


class Multipliers:
    """The two bodies beside the crank by x, y, angle each, held by four rows with multipliers; the motor's torque is
    what the crank pin's row leaves to it.
    """

    def __init__(self, m: Mechanism, loop: Loop) -> None:
        self.m, self.who, self.loop = m, ode.names_of(m), loop
        self.bodies = [m.body(self.who.first), m.body(self.who.second)]
        self.mass = np.array([v for b in self.bodies for v in (b.mass, b.mass, b.moment_of_inertia)])
        law = named_law(m, m.joint("B"), "driven")
        assert law is not None
        self.law, self.friction, self.touched, self.pushing = law, m.joint("B").friction, law.slowest, False

    def arm(self, k: int, name: str, angle: float) -> complex:
        """From a body's centre of mass to a point of it."""
        return (self.bodies[k].point(name) - self.bodies[k].centre) * np.exp(1j * angle)

    def contact(self, q: np.ndarray, v: np.ndarray) -> tuple[float, float, complex, complex]:
        """Depth and its rate, force on the second body, and where it acts."""
        pins = [complex(*q[3 * k : 3 * k + 2]) + self.arm(k, "B", q[3 * k + 2]) for k in (0, 1)]
        gap = pins[0] - pins[1]
        n, loop = gap / abs(gap), self.loop
        met = pins[1] + n * loop.rim if loop.bearing > 0 else pins[0] - n * loop.rim
        speed = [self.at(q, v, k, pins[k]) for k in (0, 1)]
        rate = ((speed[0] - speed[1]) * n.conjugate()).real
        slip = ((self.at(q, v, 0, met) - self.at(q, v, 1, met)) * n.conjugate()).imag
        depth = abs(gap) - loop.clearance
        size = self.law.size(depth, rate, self.touched) if self.pushing else 0.0
        return depth, rate, size * (1 + 1j * self.friction * np.sign(slip)) * n, met

    @staticmethod
    def at(q: np.ndarray, v: np.ndarray, k: int, place: complex) -> complex:
        """Velocity of a body where something is."""
        return complex(*v[3 * k : 3 * k + 2]) + 1j * v[3 * k + 2] * (place - complex(*q[3 * k : 3 * k + 2]))

    def rates(self, t: float, y: np.ndarray) -> np.ndarray:
        return np.concatenate([y[6:], self.solved(t, y)[0]])

    def solved(self, t: float, y: np.ndarray) -> tuple[np.ndarray, float]:
        """Accelerations (6,) and the motor's torque (N.m)."""
        q, v, m, loop = y[:6], y[6:], self.m, self.loop
        crank = loop.arm * np.exp(1j * (loop.theta + loop.speed * t))
        hung = next(j.name for j in m.joints if set(j.bodies) == {self.who.crank, self.who.first})
        base = next(j for j in m.joints if set(j.bodies) == {"ground", self.who.second})
        rows, right = np.zeros((4, 6)), np.zeros(4)
        for row, k, name, moved in ((0, 0, hung, -(loop.speed**2) * crank), (2, 1, base.name, 0j)):
            arm = self.arm(k, name, q[3 * k + 2])
            rows[row, [3 * k, 3 * k + 2]] = 1, -arm.imag
            rows[row + 1, [3 * k + 1, 3 * k + 2]] = 1, arm.real
            swing = moved + v[3 * k + 2] ** 2 * arm
            right[row : row + 2] = swing.real, swing.imag
        if base.prismatic:  # along x here: its height and its angle are held
            rows[2], right[2] = (0, 0, 0, 0, 0, 1), 0.0
        _, _, force, met = self.contact(q, v)
        push = np.zeros(6)
        for k, body in enumerate(self.bodies):
            acting = [(force if k else -force, met - complex(*q[3 * k : 3 * k + 2]))]
            acting += [(complex(*w.force), self.arm(k, w.point, q[3 * k + 2])) for w in m.loads if w.body == body.name]
            acting.append((body.mass * complex(*m.gravity), 0j))
            push[3 * k : 3 * k + 2] = sum(f.real for f, _ in acting), sum(f.imag for f, _ in acting)
            push[3 * k + 2] = sum((a.conjugate() * f).imag for f, a in acting)
            push[3 * k + 2] += sum(load.torque for load in m.loads if load.body == body.name)
        kkt = np.block([[np.diag(self.mass), rows.T], [rows, np.zeros((4, 4))]])
        found = np.linalg.solve(kkt, np.concatenate([push, right]))
        hold = complex(-found[6], -found[7])  # of the crank on the first body
        turned = (crank.conjugate() * hold).imag
        body = m.body(self.who.crank)
        hub = next(j.name for j in m.joints if set(j.bodies) == {"ground", self.who.crank})
        for load_at, pull in [("mass centre", body.mass * complex(*m.gravity))] + [
            (w.point, complex(*w.force)) for w in m.loads if w.body == body.name
        ]:
            arm = (body.centre if load_at == "mass centre" else body.point(load_at)) - body.point(hub)
            turned -= ((arm * crank / loop.arm).conjugate() * pull).imag
        return found[:6], turned

    def run(self, start: ode.State, turn: float, touches: int) -> tuple[np.ndarray, np.ndarray, list[float]]:
        """States (M, 12) at times of touching and leaving, these times, and the motor's torque at each."""
        y = self.spread(start)
        t, end = 0.0, turn / abs(self.loop.speed)
        times, states, torques = [], [], []

        def wall(_: float, y: np.ndarray) -> float:
            return self.contact(y[:6], y[6:])[0]

        wall.terminal = True
        while len(times) < 2 * touches:
            wall.direction = -1 if self.pushing else 1
            found = solve_ivp(
                self.rates, (t, end), y, "DOP853", events=wall, rtol=1e-11, atol=1e-13,
                max_step=1e-5,
                first_step=1e-9,
            )  # fmt: skip
            assert found.status == 1, "no more touches"
            t, y = found.t_events[0][0], found.y_events[0][0]
            times.append(t)
            states.append(y)
            torques.append(self.solved(t, y)[1])
            if not self.pushing:
                self.touched = max(self.contact(y[:6], y[6:])[1], self.law.slowest)
            self.pushing = not self.pushing
        return np.array(states), np.array(times), torques

    def spread(self, start: ode.State) -> np.ndarray:
        """A start in these coordinates."""
        loop = self.loop
        c1, arm = loop.com1 * np.exp(1j * start.first), loop.arm * np.exp(1j * loop.theta)
        place, speed = loop.hub + arm + c1, 1j * loop.speed * arm + 1j * start.first_rate * c1
        y = [place.real, place.imag, start.first]
        v = [speed.real, speed.imag, start.first_rate]
        if loop.slides:
            place, speed = loop.pivot + loop.com2 + loop.axis * start.second, loop.axis * start.second_rate
            return np.array([*y, place.real, place.imag, 0.0, *v, speed.real, speed.imag, 0.0])
        c2 = loop.com2 * np.exp(1j * start.second)
        place, speed = loop.pivot + c2, 1j * start.second_rate * c2
        return np.array([*y, place.real, place.imag, start.second, *v, speed.real, speed.imag, start.second_rate])


@pytest.mark.long_rows("0.1-flores-slider-crank", "0.1-flores-crank-rocker", "0.0-flores-slider-crank")
@pytest.mark.parametrize("case", ["crank-rocker", "slider-crank"])
@pytest.mark.parametrize("law", ["flores", *slow("kelvin-voigt", "hunt-crossley", "lankarani-nikravesh", "gonthier")])
@pytest.mark.parametrize("friction", [0.0, 0.1])
def test_several_impacts_agree_with_multipliers_and_dop853(case: str, law: ContactLaw, friction: float) -> None:
    m, touches = rattling(case, law, friction), 2 if friction else 3  # later slip sticks, which a sign does not
    loop = loop_of(m, 1.0)
    start = centred(m, loop, 1e-5 + 2e-5j)
    mine = simulate(m, loop, start, 40 * np.pi, most=touches).impacts
    assert np.isfinite(mine.left).all()
    other = Multipliers(m, loop)
    states, times, _ = other.run(start, 40 * np.pi, touches)
    np.testing.assert_allclose(mine.time, times[::2], rtol=1e-7)
    np.testing.assert_allclose(mine.left, times[1::2], rtol=1e-7)
    for row, found in ((0, mine.before), (1, mine.after)):
        expected = states[row::2]
        np.testing.assert_allclose(found[:, ode.FIRST], expected[:, 2], atol=1e-7)
        np.testing.assert_allclose(found[:, ode.FIRST_RATE], expected[:, 8], atol=1e-3)
        along = (3, 9) if loop.slides else (5, 11)
        np.testing.assert_allclose(
            found[:, ode.SECOND] + loop.pivot.real * loop.slides, expected[:, along[0]], atol=1e-7
        )
        np.testing.assert_allclose(found[:, ode.SECOND_RATE], expected[:, along[1]], atol=1e-3)


def test_steps_are_of_fifth_order_through_impacts() -> None:
    """Halved twice, with the ends of all that happens located: errors fall 32-fold, here at least 20-fold."""
    m = rattling("crank-rocker", "flores", 0.1)
    loop = loop_of(m, 1.0)
    step, errors = ode.contact_step(loop, 1 / 6), []
    turn = 2.5e-3 * loop.speed  # three impacts
    ends = [
        simulate(m, loop, centred(m, loop, 1e-5 + 2e-5j), turn, step=step / k, fine=8.0 * k).states[-1, :4]
        for k in (1, 2, 4, 16)
    ]
    errors = [np.abs(end - ends[-1])[2:].max() for end in ends[:-1]]
    assert errors[0] > 20 * errors[1] > 400 * errors[2], errors


@pytest.mark.parametrize("case", ["crank-rocker", "slider-crank"])
def test_friction_is_coulombs_in_what_is_watched(case: str) -> None:
    """Where the pin slips, friction is mu N against it; where it does not, at most that: both happen."""
    m = rattling(case, "kelvin-voigt", 0.1)
    loop = loop_of(m)
    motion = simulate(m, loop, centred(m, loop), 20 * np.pi)
    seen, who = motion.watched, ode.names_of(m)
    speeds = []
    n = motion.gap[1:] / np.abs(motion.gap[1:])
    at = {}
    for name in (who.first, who.second):
        arm = m.body(name).point("B") - m.body(name).centre
        at[name] = seen.place[name][1:] + arm * np.exp(1j * seen.angle[name][1:])
    met = at[who.second] + n * loop.rim
    for name in (who.first, who.second):
        speeds.append(seen.velocity[name][1:] + 1j * seen.angular_velocity[name][1:] * (met - seen.place[name][1:]))
    slip = ((speeds[0] - speeds[1]) * n.conjugate()).imag
    force = seen.force["B"][1:] * n.conjugate()
    assert (force.real >= 0).all()
    held = (force.real > 0) & (np.abs(slip) < 1e-6)
    slipping = (force.real > 0) & ~held
    assert held.sum() > 50
    assert slipping.sum() > 50
    np.testing.assert_allclose(force.imag[slipping], (0.1 * force.real * np.sign(slip))[slipping], rtol=1e-9)
    assert (np.abs(force.imag) <= 0.1 * force.real * (1 + 1e-9))[held].all()
    assert np.abs(np.abs(motion.gap[1:]) - np.abs(at[who.first] - at[who.second])).max() < 1e-15


def test_a_joint_that_names_its_bodies_the_other_way_is_the_same_linkage() -> None:
    """Force and gap turn round; which body has the bearing matters to friction alone."""
    m = rattling("crank-rocker", "gonthier")
    turned = m.with_joint("B", bodies=("follower", "coupler"))
    one, other = (simulate(x, loop_of(x), centred(x, loop_of(x)), 2 * np.pi) for x in (m, turned))
    np.testing.assert_allclose(one.watched.force["B"], -other.watched.force["B"], atol=1e-5)
    np.testing.assert_allclose(one.gap, -other.gap, atol=1e-12)
    rubbing = [x.with_joint("B", friction=0.1) for x in (m, turned)]
    ends = [simulate(x, loop_of(x), centred(x, loop_of(x)), 2 * np.pi).states[-1, :4] for x in rubbing]
    assert np.abs(ends[0] - ends[1]).max() > 1e-4


@pytest.mark.parametrize("case", ["crank-rocker", "slider-crank", "paper"])
def test_a_pin_that_starts_pressed_stays_so_at_a_tenth_of_the_speed(case: str) -> None:
    """And then its force is near the ideal linkage's reaction, whose size and place the start takes."""
    m = load(case)
    m = m.with_joint("B", clearance=1e-4, contact_stiffness=1e7, restitution=0.3, contact_law="flores")
    m = m.replace(drive=m.drive.model_copy(update={"speed": 5.0 if case != "paper" else m.speed}), gravity=(0.0, -9.81))
    loop = loop_of(m, 0.6)
    motion = simulate(m, loop, pressed(m, loop), 0.02 if case == "paper" else 0.5)
    assert (np.abs(motion.gap) > loop.clearance).all()
    for k in (0, len(motion.crank) // 2):
        ideal = ode.ideal_reaction(m, loop._replace(theta=float(motion.crank[k])))
        assert abs(motion.watched.force["B"][k] - ideal) < 0.02 * abs(ideal)


@pytest.mark.slow
def test_starts_that_differ_by_a_nanometre_part_where_pins_bounce() -> None:
    """Not everywhere: with damping enough, the crank-rocker's pin falls into a motion that each revolution repeats."""
    m = rattling("slider-crank", "flores", restitution=0.9)
    loop = loop_of(m)
    a, b = (simulate(m, loop, centred(m, loop, nudge), 40 * np.pi) for nudge in (0j, 1e-9 + 0j))
    np.testing.assert_allclose(a.impacts.time[:2], b.impacts.time[:2], rtol=1e-4)
    assert np.abs(a.gap - b.gap).max() > 1e-4
    m = rattling("crank-rocker", "flores")
    loop = loop_of(m)
    a, b = (simulate(m, loop, centred(m, loop, nudge), 40 * np.pi) for nudge in (0j, 1e-9 + 0j))
    assert np.abs(a.gap - b.gap)[-1000:].max() < 1e-12

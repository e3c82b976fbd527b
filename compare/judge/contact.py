"""What contact did in a watched run, joint by joint and over its revolutions, and whether that has converged."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import kinematics
from analytic.kinematics.reach import usual_angles
from analytic.mechanism import Mechanism
from analytic.paper.kinetostatics import kinetostatics
from compare.judge.contact_motion import ContactHistory, JointPlay, WatchedRun, dot, integral, taken
from compare.judge.statistics import needed, statistic
from compare.report.words.contact import Steadiness, steadiness
from compare.results.contact import (
    Balance,
    Contact,
    Impacts,
    JointContact,
    Orbit,
    Profile,
    Section,
    Statistic,
    StatisticName,
)
from sim_models.common.contact_laws import contact_parameters
from sim_models.common.free_share import free_share
from sim_models.common.guide import Guide
from sim_models.engine import Trace, Watched

TURN_BINS = 72  # of a turn
HIGH = 0.9  # quantile of the revolutions' peaks
KNOWN_TO = 0.1  # of a figure: half the width of its interval, where it has converged
LEAST_SHARE = 0.005  # of the time: half the width of a share's interval, at least
WANTED: tuple[StatisticName, ...] = ("free_share", "rms_force", "peak_force", "restitution_loss")
REPEATS_TO = 1e-2  # of the clearance, and of the pin's largest speed: how near it comes back to where it was
FAINT_LOSS = 0.1  # of the energy that impacts bring along: a smaller loss need not be known any better
LONGEST_PERIOD = 8  # revolutions
ORBIT_POINTS = 1500


@dataclass(frozen=True)
class Blow:
    """One impact: instants [begin, end), and the speed (m/s) at which the wall was reached."""

    begin: int
    end: int
    speed: float


def contact_in(trace: Trace, mechanism: Mechanism, ideal: Mapping[str, float]) -> Contact | None:
    """What contact did in a run of a mechanism, if it was watched; see :func:`contact`."""
    if trace.watched is None or not trace.clearance:
        return None
    margins = trace.settings.get("contact_margin")
    by_joint = {name: float(m) for name, m in margins.items()} if isinstance(margins, Mapping) else {}
    yields = "contact_stiffness" in trace.settings
    return contact(mechanism.with_clearances(dict(trace.clearance)), trace.watched, ideal, by_joint, yields)


def contact(
    m: Mechanism,
    watched: Watched,
    ideal: Mapping[str, float],
    margins: Mapping[str, float] | None = None,
    yields: bool = True,
) -> Contact:
    """What contact did at every step of a run, in the joints of a mechanism that have clearance.

    ``ideal`` (N) are the ideal linkage's largest reactions by joint, ``margins`` (m) how far before its wall a pin or
    corner begins to be pushed; ``yields`` says whether walls are springs, which give back what they have stored.
    """
    run = WatchedRun(m, watched)
    courses = {
        name: run.course(
            m.joint(name),
            (margins or {}).get(name, 0.0),
            contact_parameters(m, m.joint(name), "driven").stiffness if yields else 0.0,
        )
        for name in m.clearances
    }
    marks = revolutions(run.turned)
    joints = {name: joint_contact(run, one, marks, ideal.get(name, math.nan)) for name, one in courses.items()}
    whole = marks.size - 1
    periods = [_period(joint.section, courses[name]) for name, joint in joints.items()]
    parts = {"block" if m.joint(name).prismatic else "pin" for name in joints}
    steady = _steadiness(joints, whole, float(run.turned[-1]) / math.tau)
    return Contact(
        revolutions=steady.turns,
        converged=steady.converged,
        period=None if None in periods else math.lcm(*(each for each in periods if each)),
        words=steadiness(steady, sorted(parts)),
        energy=balance(run, courses, marks),
        joints=joints,
    )


def ideal_peaks(mechanism: Mechanism) -> dict[str, float]:
    """The largest reaction (N) by joint of the ideal linkage in motion, at its usual crank angles, without friction
    that grows with it; of a block with clearance, the largest force that this and its moment put on one of its corners.
    """
    assembly = Assembly(mechanism.ideal())
    angles, speed = usual_angles(assembly), mechanism.speed or 1.0
    time = np.sort(np.abs(angles - angles[0]) / abs(speed))[:: 1 if speed > 0 else -1]  # of the first turn
    motion = kinematics(assembly, angles, speed, time=time)
    reactions = kinetostatics(motion, rubs=False)
    forces = {name: np.abs(force) for name, force in reactions.forces.items()}
    for joint in (mechanism.joint(name) for name in mechanism.loose_guides):
        guide = Guide.of(joint)
        assert guide is not None  # of all that have clearance
        across = dot(1j * joint.direction * np.exp(1j * motion.angle(joint.bodies[0])), reactions.forces[joint.name])
        forces[joint.name] = guide.hardest(across, reactions.moments[joint.name])
    return {name: float(force.max()) for name, force in forces.items()}


def revolutions(turned: np.ndarray) -> np.ndarray:
    """The instants at which whole revolutions begin and end, of a crank that has turned (M,) rad; of a run without one,
    its first and last.
    """
    whole = int(turned[-1] / math.tau + 1e-6)
    if not whole:
        return np.array([0, turned.size - 1])
    return np.minimum(np.searchsorted(turned, math.tau * np.arange(whole + 1) - 1e-9), turned.size - 1)


def blows(touch: ContactHistory) -> Iterator[Blow]:
    """The impacts of a pin or corner: it was off its wall, and is at it.  One ends when it is no longer pushed, or
    begins to press anew.
    """
    state = np.where(touch.touching, 1, np.where(touch.free, -1, 0))
    known = np.flatnonzero(state)
    begins = [int(k) for j, k in pairwise(known.tolist()) if state[j] < 0 < state[k]]
    distance = touch.reach
    for begin, until in pairwise([*begins, distance.size]):
        pushed, rate = touch.push[begin:until] > 0, touch.rate[begin:until]
        ended = np.flatnonzero((pushed[:-1] & ~pushed[1:]) | ((rate[:-1] <= 0) & (rate[1:] > 0) & pushed[1:]))
        end = begin + int(ended[0]) + 2 if ended.size else until
        before = max(begin - 1, 0)
        rise = distance[begin] - distance[before]
        part = float(np.clip((touch.wall - distance[before]) / rise, 0.0, 1.0)) if rise > 0 else 0.0
        gained = (touch.rate[before] - touch.rate[max(before - 1, 0)]) * part
        yield Blow(begin, min(end, until), float(touch.rate[before] + gained))


@dataclass(frozen=True)
class Done:
    """What a contact has done until each of (M,) instants: energy (J) that its normal force has taken, less what the
    wall stores, and that friction has; normal force times way slid (N.m); and its impacts, each with its impulse (N.s)
    and energy (J).
    """

    absorbed: np.ndarray
    rubbed: np.ndarray
    worn: np.ndarray
    impacts: tuple[tuple[Blow, float, float], ...]

    @classmethod
    def by(cls, touch: ContactHistory, time: np.ndarray) -> Done:
        """By a contact at these times (M,) s."""
        normal = np.maximum(touch.push, 0.0)
        impulse, absorbed = integral(normal, time), integral(touch.push * touch.rate, time) - touch.stored
        ends = [(blow, max(blow.begin - 1, 0), blow.end - 1) for blow in blows(touch)]
        return cls(
            absorbed,
            integral(-touch.rub * touch.slip, time),
            integral(normal * np.abs(touch.slip), time),
            tuple((b, impulse[last] - impulse[first], absorbed[last] - absorbed[first]) for b, first, last in ends),
        )


def joint_contact(run: WatchedRun, course: JointPlay, marks: np.ndarray, ideal: float) -> JointContact:
    """Contact of one joint: its figures by revolution between the ``marks``, and all its impacts."""
    time, spans = run.time, list(pairwise(marks.tolist()))
    done = [Done.by(touch, time) for touch in course.contacts]
    struck = sorted((each for one in done for each in one.impacts), key=lambda each: each[0].begin)
    angle = run.watched.angle[run.m.driven]
    impulses, energies = (np.array([each[k] for each in struck]) for k in (1, 2))
    begins, speeds = np.array([b.begin for b, *_ in struck], int), np.array([b.speed for b, *_ in struck])
    size, depth, reach = course.size, np.max([touch.depth for touch in course.contacts], axis=0), course.reach
    squared = integral(size**2, time)
    absorbed, rubbed, worn = (
        np.sum([getattr(one, name) for one in done], axis=0) for name in ("absorbed", "rubbed", "worn")
    )

    def within(values: np.ndarray, first: int, last: int) -> np.ndarray:
        return values[(begins >= first) & (begins < last)]

    by: dict[StatisticName, list[float]] = {}
    for first, last in spans:
        here, lasts = slice(first, last + 1), float(time[last] - time[first])
        row: dict[StatisticName, float] = {
            "free_share": free_share(reach[here], course.wall, time[here]),
            "impacts": float(within(begins, first, last).size),
            "impulse": float(within(impulses, first, last).sum()),
            "approach_speed": float(within(speeds, first, last).max(initial=0.0)),
            "rms_force": math.sqrt(max(float(squared[last] - squared[first]), 0.0) / lasts),
            "peak_force": float(size[here].max()),
            "restitution_loss": float(absorbed[last] - absorbed[first]),
            "friction_loss": float(rubbed[last] - rubbed[first]),
            "wear": float(worn[last] - worn[first]),
            "penetration": float(depth[here].max()),
        }
        for name, value in row.items():
            by.setdefault(name, []).append(value)
    statistics: dict[StatisticName, Statistic] = {name: statistic(np.array(values)) for name, values in by.items()}
    statistics["high_peak"] = statistic(np.array(by["peak_force"]), HIGH)
    at = marks[:-1]
    return JointContact(
        statistics=statistics,
        peak_ratio=float(size.max()) / ideal if ideal > 0 else None,
        first_impact=float(angle[begins[0]]) if begins.size else None,
        impacts=Impacts(crank_angle=angle[begins], approach_speed=speeds, impulse=impulses, energy=energies),
        profile=_profile(angle, time, size, course.free, begins, float(run.turned[-1]) / math.tau),
        orbit=_orbit(course, size, angle, time, slice(spans[-1][0], spans[-1][1] + 1)),
        section=Section(
            x=course.gap.real[at],
            y=course.gap.imag[at],
            velocity_x=course.drift.real[at],
            velocity_y=course.drift.imag[at],
        ),
    )


def balance(run: WatchedRun, courses: Mapping[str, JointPlay], marks: np.ndarray) -> Balance | None:
    """The energy of a run's whole revolutions; None where what its joints take is not known."""
    if run.joints is None:
        return None
    here = slice(int(marks[0]), int(marks[-1]) + 1)
    time = run.time[here]

    def over(power: np.ndarray) -> float:
        return float(integral(power[here], time)[-1])

    given, contacts, joints = over(run.motor + run.applied), over(taken(courses)), over(run.joints)
    kept = float(run.kinetic[here][-1] - run.kinetic[here][0])
    return Balance(
        put_in=given,
        lost_in_contact=contacts,
        lost_in_joints=joints,
        kept=kept,
        missing=given - contacts - joints - kept,
        turned_over=over(np.abs(run.motor)),
    )


def more_revolutions(contact: Contact) -> float:
    """How many revolutions a run should have for its statistics to converge; no more than it has where they have."""
    if contact.converged:
        return contact.revolutions
    times = max(needed(*pair) for joint in contact.joints.values() for pair in _wanted(joint))
    return contact.revolutions * min(max(times, 2.0), 8.0)


def _wanted(joint: JointContact) -> Iterator[tuple[Statistic, float]]:
    """Each figure that has to converge, and how narrow half of its interval is to be."""
    for name in WANTED:
        figure = joint.statistics[name]
        size = abs(figure.value or 0.0)
        if name == "restitution_loss":  # small beside what the impacts bring along, it says nothing
            size = max(size, FAINT_LOSS * _brought(joint))
        yield figure, max(KNOWN_TO * size, LEAST_SHARE if name == "free_share" else 0.0)


def _brought(joint: JointContact) -> float:
    """Energy (J) that the impacts of a revolution bring along, or thereabouts."""
    impulse, speed = (joint.statistics[name].value or 0.0 for name in ("impulse", "approach_speed"))
    return impulse * speed / 2


def _steadiness(joints: Mapping[str, JointContact], whole: int, turns: float) -> Steadiness:
    """Whether the statistics of a run would change no more, and which of them is known worst."""
    free = any((joint.statistics["free_share"].value or 0.0) > 0 for joint in joints.values())
    if not free and not any(joint.impacts.crank_angle.size for joint in joints.values()):
        return Steadiness(True, turns, touching=True)
    if turns < 1 - 1e-6:
        return Steadiness(False, turns)
    wide = [
        (name, key, figure)
        for name, joint in joints.items()
        for key, (figure, wanted) in zip(WANTED, _wanted(joint), strict=True)
        if figure.half_width is None or figure.half_width > wanted
    ]
    if not wide:
        return Steadiness(True, turns, whole, within=KNOWN_TO)
    name, key, figure = max(wide, key=lambda one: (one[2].half_width or math.inf) / (abs(one[2].value or 0.0) or 1.0))
    if figure.half_width is None:
        return Steadiness(False, turns, whole)
    return Steadiness(
        False, turns, whole, (name, key), figure.half_width / abs(figure.value) if figure.value else math.inf
    )


def _orbit(course: JointPlay, size: np.ndarray, angle: np.ndarray, time: np.ndarray, here: slice) -> Orbit:
    """The path of a pin or block in some instants, thinned; where it is pushed hardest is kept."""
    x, force = course.gap[here], size[here]
    pieces = np.array_split(np.arange(x.size), min(ORBIT_POINTS // 2, x.size))
    kept = np.unique([k for piece in pieces for k in (int(piece[0]), int(piece[np.argmax(force[piece])]))])
    return Orbit(
        x=x.real[kept], y=x.imag[kept], force=force[kept], crank_angle=angle[here][kept], time=time[here][kept]
    )


def _profile(
    angle: np.ndarray, time: np.ndarray, size: np.ndarray, free: np.ndarray, begins: np.ndarray, turns: float
) -> Profile:
    """Contact over the crank angle, all revolutions together; every instant counts by the time around it."""
    which = np.minimum((np.mod(angle, math.tau) / math.tau * TURN_BINS).astype(int), TURN_BINS - 1)
    lasts = np.gradient(time) if time.size > 1 else np.ones(1)
    total = np.bincount(which, lasts, TURN_BINS)
    lasted = np.where(total > 0, total, np.nan)
    low, high = np.full(TURN_BINS, np.nan), np.full(TURN_BINS, np.nan)
    order = np.lexsort((size, which))
    edges = np.searchsorted(which[order], np.arange(TURN_BINS + 1))
    for k, (first, last) in enumerate(pairwise(edges.tolist())):
        if last > first:
            here = order[first:last]
            share = np.cumsum(lasts[here]) / lasts[here].sum()
            low[k], high[k] = size[here][np.searchsorted(share, (0.05, 0.95)).clip(max=here.size - 1)]
    return Profile(
        crank_angle=(np.arange(TURN_BINS) + 0.5) * math.tau / TURN_BINS,
        free_share=np.bincount(which, lasts * free, TURN_BINS) / lasted,
        impacts=np.bincount(which[begins], minlength=TURN_BINS) / max(turns, 1.0),
        mean_force=np.bincount(which, lasts * size, TURN_BINS) / lasted,
        low_force=low,
        high_force=high,
    )


def _period(section: Section, course: JointPlay) -> int | None:
    """After how many revolutions a pin or block is back where it was, as fast, throughout the second half of a run;
    None: not in a few, or too little of the run is left to tell.
    """
    fastest = float(np.abs(course.drift).max()) or 1.0
    state = (section.x + 1j * section.y) / course.clearance, (section.velocity_x + 1j * section.velocity_y) / fastest
    halves = [values[values.size // 2 :] for values in state]
    for period in range(1, LONGEST_PERIOD + 1):
        if halves[0].size < 2 * period + 1:
            return None
        if all(np.all(np.abs(half[period:] - half[:-period]) < REPEATS_TO) for half in halves):
            return period
    return None

"""What the sensors of a rig read if the mechanism has a set of effects, by the analytic model.

The analytic model is fast enough (a millisecond a run) to try everything; that it says what the chosen simulator says
is checked on every run of every diagnosis (:mod:`compare.diagnose.simulate`).
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, permutations
from typing import TypeVar

import numpy as np

from analytic.beyond_paper.backlash import Slack
from analytic.beyond_paper.drive import Motor
from analytic.beyond_paper.freedom import Freedom, swings
from analytic.kinematics.assembly import Assembly, AssemblyError, Walk
from analytic.kinematics.motion import kinematics
from analytic.kinematics.reach import turns_fully
from analytic.kinematics.schedule import Steady, Turning
from analytic.kinematics.structure import StructureError
from analytic.mechanism import Mechanism
from analytic.mechanism.sensing import read_again, with_sensors
from analytic.paper.clearance import Displaced, displaced
from analytic.paper.compliance import compliance
from analytic.paper.frame import ComplianceError
from analytic.paper.kinetostatics import Reactions, kinetostatics, poses
from analytic.paper.superposition import superposed
from compare.diagnose.data.recording import Measured, MeasuredRun
from compare.diagnose.effects.effect import LANDING, Effect, Parameter, Readings, Rig, Values, landing_in
from compare.diagnose.residuals import bridged
from compare.judge.signals import with_derived

TABLES = 100  # linkages whose freedom is kept
ALTERED = 300  # mechanisms that are kept
CACHED = 400  # courses that are kept
DELAYS = 20  # of free runs, of which is kept what samples say of a motion so long ago
NEIGHBOURS = 6  # samples that tell of a motion between two of them
BYTES = 24_000_000  # of the signals that are kept of driven runs, and of free ones
AT_ONCE = 100_000  # samples of free runs, whose signals are found together
ANYWHERE = Turning(np.array([0.3, 1.7, 3.2, 4.9]), np.ones(4), np.zeros(4))  # readings by which motors are told apart
STIFF = 1e-3  # of the shortest link: bearings that give less are told by their first order
PARTS = ("theta", "omega", "alpha")  # of a motion
TURNS = 300  # that a free motion may make beyond twice what its encoder has read: one that makes more has run away
SLOW = 0.2  # of a run's mean rate, below which a crank says little of the time


@dataclass(frozen=True)
class Motors:
    """The motors of several drives, or of one between moving bodies, told together."""

    each: tuple[Motor, ...]

    def at(self, time: np.ndarray) -> Turning:
        """Their motion at times (N,) s, (k, N)."""
        moved = [motor.at(time) for motor in self.each]
        return Turning(*(np.stack([getattr(turning, part) for turning in moved]) for part in PARTS))


def commanded(run: MeasuredRun, mechanism: Mechanism) -> Motor:
    """The motor of a run at a constant speed, uneven by its drive's ripple."""
    drive = mechanism.drive
    return Motor(Steady(run.angle or 0.0, run.speed or 0.0), drive.ripple if drive else None)


class StartOfRun(Effect):
    """The states that a free run starts from: not an effect, but unknowns of every fit.

    A variant says in how many pieces the run goes; natural are angle and rate at the first sample of each.
    """

    name = "start"
    parameters = (Parameter("angle", "rad", "angle"), Parameter("rate", "rad/s", "rate"))
    sensor = True

    @staticmethod
    def pieces(variant: float) -> int:
        """In how many pieces a run goes."""
        return max(int(variant), 1)

    def places(self, rig: Rig) -> Sequence[str]:
        return [run for run in rig.runs if run not in rig.driven]

    def blames(self, parameter: str) -> bool:
        return False

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-5, 1e-5 * rig.speed) * self.pieces(variant)

    def lowest(self, rig: Rig, where: str, variant: float = 0.0) -> np.ndarray:
        return np.full(2 * self.pieces(variant), -math.inf)

    def values(self, rig: Rig, where: str, x: np.ndarray, variant: float = 0.0) -> dict[str, float]:
        names = [f"{p.name}@{k}" if k else p.name for k in range(x.size // 2) for p in self.parameters]
        return dict(zip(names, x.tolist(), strict=True))


def pieces(size: int, count: int) -> list[slice]:
    """The samples of a run of this size in so many pieces, as even as can be."""
    ends = np.linspace(0, size, count + 1).round().astype(int).tolist()
    return [slice(begin, end) for begin, end in pairwise(ends)]


@dataclass(frozen=True)
class Term:
    """An effect at a place, and which of its variants."""

    effect: Effect
    where: str
    variant: float = 0.0

    @property
    def key(self) -> tuple[str, str]:
        """Name and place."""
        return self.effect.name, self.where

    @property
    def label(self) -> str:
        """name@place, as on the command line."""
        return f"{self.effect.name}@{self.where}"

    def extends(self, simple: Term) -> bool:
        """Whether this is a richer form of another at the same place."""
        return self.where == simple.where and self.effect.extends(simple.effect)


Hypothesis = Sequence[tuple[Term, Values]]
Signals = Mapping[str, np.ndarray]
State = tuple[float, float]  # angle (rad) and rate (rad/s)
Push = tuple[float, float, float]  # what a motor's torque is times what is recorded, and more than that, so late (s)
Effects = tuple[tuple[object, ...], Push]  # of a linkage, and of the sensor of what pushes it
Driven = tuple[int, float, bytes, float, tuple[object, ...]]  # of a driven run: which, how late, motor, jitter, effects
Swing = tuple[str, Effects, tuple[State, ...]]  # of a free run: its name, its effects, its starts
Piece = tuple[str, Effects, tuple[int, int], State]  # the same of a piece, from which sample to which
Key = TypeVar("Key")


class Kept(OrderedDict[Key, Signals | None]):
    """Signals that were found last, as many as BYTES hold; None where there are none."""

    def __init__(self) -> None:
        super().__init__()
        self.bytes = 0

    def keep(self, found: Mapping[Key, Signals | None]) -> None:
        """Keep these, the last of all."""
        for key, signals in found.items():
            if key not in self:
                self.bytes += _bytes(signals)
                self[key] = signals
            self.move_to_end(key)
        while self.bytes > BYTES:
            self.bytes -= _bytes(self.popitem(last=False)[1])


def _bytes(signals: Signals | None) -> int:
    return sum(values.nbytes for values in (signals or {}).values())


class Impossible(ValueError):
    """A hypothesis that no linkage fulfils: it cannot be assembled, or a value is not physical."""


class Model:
    """Predicts the readings of every run of a measurement under hypotheses.

    ``mechanism`` is the nominal one.  Signals with clearance in a joint are those of the pins following their reactions
    (``equilibrium``), a straight line of what clearance changes where that has no answer; NaN where it never has one.
    """

    def __init__(
        self, measured: Measured, rig: Rig, mechanism: Mechanism, courses: Mapping[str, Motor | Motors]
    ) -> None:
        self.measured, self.rig, self.mechanism = measured, rig, mechanism
        self.courses = courses
        self.rates = any(channel.signal.on_request for run in measured.runs for channel in run.channels.values())
        self._altered: dict[object, Mechanism] = {}
        self._tables: dict[object, tuple[Assembly, Freedom] | None] = {}
        self._turned: dict[object, Turning] = {}
        self._followed: dict[object, Walk] = {}
        self._earlier: dict[tuple[str, float], tuple[np.ndarray, np.ndarray]] = {}
        self._kept: Kept[Driven] = Kept()
        self._swung: Kept[Swing] = Kept()

    def altered(self, run: MeasuredRun, hypothesis: Hypothesis) -> Mechanism:
        """The mechanism of a run with the effects of a hypothesis.  Raises Impossible.

        What is common to many hypotheses, their first effects, is made once: to check a mechanism takes long.
        """
        key: tuple[object, ...] = (run.loads,)
        if len(self._altered) > ALTERED:
            self._altered.clear()
        if key not in self._altered:
            self._altered[key] = self.mechanism if run.loads is None else self.mechanism.replace(loads=run.loads)
        mechanism = self._altered[key]
        for term, values in hypothesis:
            key = (*key, term.key, term.variant, *term.effect.in_run(values, run.name).values())
            if key not in self._altered:
                self._altered[key] = altered(mechanism, [(term, values)], run.name)
            mechanism = self._altered[key]
        return mechanism

    def __call__(self, hypotheses: Sequence[Hypothesis]) -> list[list[dict[str, np.ndarray]] | None]:
        """For each hypothesis the readings of every run, (N,) by signal; None where it is impossible.

        Beside them is at which samples a crank lands in the gap of its drive, where it has one (``landing_in``).
        """
        moved = {run.name: self.released(run, hypotheses) for run in self.measured.runs if run.drive == "free"}
        return [self._under(h, {run: each[i] for run, each in moved.items()}) for i, h in enumerate(hypotheses)]

    def _under(self, hypothesis: Hypothesis, moved: Mapping[str, Signals | None]) -> list[dict[str, np.ndarray]] | None:
        """The readings of every run; ``moved`` are the motions of the free ones by run."""
        heard_by = [heard(hypothesis, run) for run in self.measured.runs]
        asked = [(r, age) for r, echoes in enumerate(heard_by) for age in ages(echoes)]
        driven = [(r, age) for r, age in asked if self.measured.runs[r].drive != "free"]
        try:
            seen = dict(zip(driven, self._seen(hypothesis, driven), strict=True))
        except (Impossible, AssemblyError, StructureError, ComplianceError):
            return None
        for r, age in asked:
            run = self.measured.runs[r]
            if run.drive == "free":
                motion = moved[run.name]
                if motion is None:
                    return None
                wanted = [signal for signal, each in heard_by[r].items() if any(a == age for _, a in each)]
                seen[r, age] = self._aged(run, {signal: motion[signal] for signal in wanted}, age)
        readings = [
            sensed(hypothesis, run, {s: mixed(each, {a: seen[r, a] for _, a in each}, s) for s, each in echoes.items()})
            for r, (run, echoes) in enumerate(zip(self.measured.runs, heard_by, strict=True))
        ]
        for r, echoes in enumerate(heard_by):
            for signal, each in echoes.items():
                landings = [seen[r, age][LANDING] for _, age in each if LANDING in seen[r, age]]
                readings[r] |= {landing_in(signal): np.any(landings, axis=0)} if landings else {}
        return readings

    # ---------------------------------------------------------------- driven runs

    def _seen(self, hypothesis: Hypothesis, asked: Sequence[tuple[int, float]]) -> list[Mapping[str, np.ndarray]]:
        """All signals, before any sensor, of driven runs (by their place among all) some seconds before their
        samples.
        """
        runs = [self.measured.runs[r] for r, _ in asked]
        told = {
            r: (misread(run, hypothesis, self.rig), jitter_of(run, hypothesis), within(hypothesis, run.name))
            for r, run in dict(zip((r for r, _ in asked), runs, strict=True)).items()
        }
        keys = [(r, age, *told[r]) for r, age in asked]
        found = {key: kept for key in keys if (kept := self._kept.get(key)) is not None}
        new = [(key, run) for key, run in zip(keys, runs, strict=True) if key not in found]
        for loads, effects in dict.fromkeys((run.loads, key[-1]) for key, run in new):
            alike = [(key, run) for key, run in new if run.loads == loads and key[-1] == effects]
            mechanism = self.altered(alike[0][1], hypothesis)
            motions = [(run, run.time - age, jitter) for (_, age, _, jitter, _), run in alike]
            found |= zip((key for key, _ in alike), self._moved(mechanism, motions, hypothesis), strict=True)
        self._kept.keep(found)
        return [found[key] for key in keys]

    def signals(self, run: MeasuredRun, hypothesis: Hypothesis, time: np.ndarray) -> Mapping[str, np.ndarray]:
        """All signals of a driven run at times (N,) s of its command, before any sensor.  Raises Impossible or
        AssemblyError.
        """
        return self._moved(self.altered(run, hypothesis), [(run, time, 0.0)], hypothesis)[0]

    def _moved(
        self,
        mechanism: Mechanism,
        motions: Sequence[tuple[MeasuredRun, np.ndarray, float]],
        hypothesis: Hypothesis,
    ) -> list[dict[str, np.ndarray]]:
        """All signals of one mechanism in several runs, at times (N,) s that jitter by so much (s), motor and encoder
        apart, and the crank behind its motor, as a hypothesis says.
        """
        assembly = Assembly(mechanism)
        drive = mechanism.drives[0] if mechanism.cranked and mechanism.drives else None
        stiffness = drive.stiffness if drive else None  # whatever the file's own drive.speed

        def torque(turning: Turning) -> np.ndarray:
            return _balanced(assembly, turning).drive_torque

        half_gap = drive.half_gap if drive else 0.0
        turns = bool(stiffness or half_gap) and turns_fully(assembly)
        seen: list[np.ndarray] = []
        clocks: list[np.ndarray] = []
        cranks: list[Turning] = []
        landings: dict[int, np.ndarray] = {}
        for run, told, jitter in motions:
            motor = self.motor(run, mechanism)
            time = told
            if jitter and isinstance(motor, Motor):
                time = told - run.time + read_at(run, self.rig.encoder, motor, jitter)
            clocks.append(time)
            shaft = self._course(run, time) if run.drive == "measured" else motor.at(time)
            crank = shaft
            if half_gap and isinstance(motor, Motor):
                slack = Slack.behind(motor, time, stiffness, torque, turns, half_gap)
                crank, landings[len(cranks)] = slack.at(time), slack.landing(time)
            elif stiffness is not None and isinstance(motor, Motor):
                crank = motor.crank(time, stiffness, torque, turns)
            # what the encoder reads is what says of the jitter: it is no reading beside it
            read = self._course(run, told) if jitter else shaft
            seen.append(turned_by(run, read, hypothesis, self.rig).theta)
            turned = turned_by(run, crank, hypothesis, self.rig)
            for lag in (term.effect.behind(turned, values) for term, values in hypothesis):
                if lag is not None:
                    turned = Turning(turned.theta - lag.theta, turned.omega - lag.omega, turned.alpha - lag.alpha)
            cranks.append(as_inputs(assembly, turned) if mechanism.several else turned)
        sizes = [crank.theta.shape[-1] for crank in cranks]
        if mechanism.several or (mechanism.displaced and not mechanism.cranked):  # goes on from sample to sample
            nears = [self._near(run, time) for run, time, _ in motions]
            each = zip(cranks, nears, clocks, strict=True)
            found = [derived(assembly, crank, near, time=time, rates=self.rates) for crank, near, time in each]
        else:
            crank, clock = _joined(cranks), np.concatenate(clocks)
            found = _parted(derived(assembly, crank, sizes=sizes, time=clock, rates=self.rates), sizes)
        for k, landing in landings.items():
            found[k][LANDING] = landing
        return [
            signals | dict(zip(self.rig.encoders, np.atleast_2d(read), strict=True))
            for signals, read in zip(found, seen, strict=True)
        ]

    def _near(self, run: MeasuredRun, time: np.ndarray) -> Walk | None:
        """Where the nominal linkage is that several drives move at times (N,) s: kept, as to follow it from sample to
        sample takes longer than all else, and what effects make of it is near.  Raises AssemblyError.
        """
        key = (run.name, time.tobytes())
        if not self.mechanism.several:
            return None
        if key not in self._followed:
            if len(self._followed) > CACHED:
                self._followed.clear()
            assembly = Assembly(self.mechanism)
            self._followed[key] = assembly.follow(as_inputs(assembly, self._course(run, time)).theta)
        return self._followed[key]

    def _course(self, run: MeasuredRun, time: np.ndarray) -> Turning:
        """What a run that follows its encoder makes of the motor at times (N,) s; kept, as it takes longer than the
        linkage.
        """
        key = (run.name, time.tobytes())
        if key not in self._turned:
            if len(self._turned) > CACHED:
                self._turned.clear()
            self._turned[key] = self.courses[run.name].at(time)
        return self._turned[key]

    def motor(self, run: MeasuredRun, mechanism: Mechanism) -> Motor | Motors:
        """The motor of a driven run, or its several."""
        if run.drive == "measured":
            return self.courses[run.name]
        return commanded(run, mechanism)

    # ---------------------------------------------------------------- free runs

    def released(self, run: MeasuredRun, hypotheses: Sequence[Hypothesis]) -> list[Signals | None]:
        """What the sensors and the encoder of a free run would see (N,) under each hypothesis, its joints ideal; None
        where it has no motion.  Each of its pieces goes from its own start.
        """
        keys = [(run.name, (within(h, run.name), pushed(run, h)), tuple(self.starts(run, h))) for h in hypotheses]
        new = {key: h for key, h in zip(keys, hypotheses, strict=True) if key not in self._swung}
        found: dict[Swing, Signals | None] = dict.fromkeys(new)
        found |= {key: self._swung[key] for key in keys if key in self._swung}
        linkages = {key[1]: self._freedom(run, h, key[1][0]) for key, h in new.items()}
        able = {key: linkage[1] for key in new if (linkage := linkages[key[1]]) is not None}
        motions = self._swings(run, able)
        most = max(1, AT_ONCE // run.time.size)
        for effects, linkage in linkages.items():
            every = [key for key in motions if key[1] == effects]
            for same in (every[k : k + most] for k in range(0, len(every), most)):
                assert linkage is not None
                seen = self._seen_of(run, linkage[0], np.concatenate([motions[key] for key in same], axis=1))
                found |= zip(same, _parted(seen, [run.time.size] * len(same)), strict=True)
        self._swung.keep(found)
        return [found[key] for key in keys]

    def moving(self, run: MeasuredRun, hypotheses: Sequence[Hypothesis]) -> list[tuple[np.ndarray, np.ndarray] | None]:
        """Angle, rate and acceleration (3, N) of the driven body of a free run and the inertia (N,) kg.m^2 that it
        moves, under each hypothesis; None where it has no motion.
        """
        keys = [(run.name, (within(h, run.name), pushed(run, h)), tuple(self.starts(run, h))) for h in hypotheses]
        each = [self._freedom(run, h, key[1][0]) for key, h in zip(keys, hypotheses, strict=True)]
        moved = self._swings(run, {key: one[1] for key, one in zip(keys, each, strict=True) if one is not None})
        return [
            None if one is None or key not in moved else (moved[key], one[1].inertia(moved[key][0]))
            for key, one in zip(keys, each, strict=True)
        ]

    def _aged(self, run: MeasuredRun, signals: Signals, delay: float) -> Signals:
        """Signals (N,) of a free run some seconds ago."""
        if delay == 0:
            return signals
        if (run.name, delay) not in self._earlier:
            if len(self._earlier) > DELAYS:
                self._earlier.clear()
            self._earlier[run.name, delay] = earlier(run.time, delay)
        which, weights = self._earlier[run.name, delay]
        return {name: np.einsum("kn,kn->n", values[which], weights) for name, values in signals.items()}

    def _seen_of(self, run: MeasuredRun, assembly: Assembly, moved: np.ndarray) -> dict[str, np.ndarray]:
        """The signals (N,) that sensors and the encoder of a free run see of a motion (3, N)."""
        motion, wanted = kinematics(assembly, *moved), dict.fromkeys([*run.channels, self.rig.encoder])
        signals = {one.name: values for one, values in poses(motion)}
        if not wanted.keys() <= signals.keys():
            signals = with_derived(_signals(assembly.mechanism, kinetostatics(motion), self.rates), assembly.mechanism)
        return {name: np.array(signals[name], float) for name in wanted}

    def _swings(self, run: MeasuredRun, freedoms: Mapping[Swing, Freedom]) -> dict[Swing, np.ndarray]:
        """Angle, rate and acceleration (3, N) of a free run in each of its ways, but where it runs away; pieces that
        several have are integrated once.
        """
        parts = {key: _pieces(run, key) for key in freedoms}
        owner = {piece: key for key, each in parts.items() for piece in each}
        if not owner:
            return {}
        times = [run.time[begin:end] - run.time[begin] for _, _, (begin, end), _ in owner]
        start = np.array([state for *_, state in owner])
        pushes = None
        if run.push is not None:
            whole = {effects: push_of(run, *effects[1]) for effects in {piece[1] for piece in owner}}
            pushes = [whole[effects][begin:end] for _, effects, (begin, end), _ in owner]
        each = dict(zip(owner, swings([freedoms[key] for key in owner.values()], start, times, pushes), strict=True))
        joined = {key: np.concatenate([each[piece] for piece in of], axis=1) for key, of in parts.items()}
        encoder = run.channels.get(self.rig.encoder)
        most = np.inf if encoder is None else 2 * math.pi * TURNS + 2 * np.ptp(bridged(encoder.values))
        return {key: moved for key, moved in joined.items() if np.isfinite(moved).all() and np.ptp(moved[0]) <= most}

    def _freedom(self, run: MeasuredRun, hypothesis: Hypothesis, effects: object) -> tuple[Assembly, Freedom] | None:
        """The linkage of a free run and how it moves; None where it cannot be.  ``effects`` tell it from others."""
        if len(self._tables) > TABLES:
            self._tables.clear()
        if (key := (run.loads, effects)) not in self._tables:
            try:
                m = self.altered(run, hypothesis)
                assembly = Assembly(m.ideal() if m.displaced else m)
                self._tables[key] = assembly, Freedom.of(assembly)
            except (Impossible, AssemblyError, StructureError):
                self._tables[key] = None
        return self._tables[key]

    def starts(self, run: MeasuredRun, hypothesis: Hypothesis) -> list[tuple[float, float]]:
        """Angle (rad) and rate (rad/s) of the driven body that each piece of a free run starts from."""
        for term, values in hypothesis:
            if isinstance(term.effect, StartOfRun) and term.where == run.name:
                each = list(values.values())
                return list(zip(each[::2], each[1::2], strict=True))
        raise LookupError(f"run {run.name!r} has no start")


def within(hypothesis: Hypothesis, run: str) -> tuple[object, ...]:
    """What tells the mechanism of a hypothesis in a run from all others."""
    inside = [(t, t.effect.in_run(v, run)) for t, v in hypothesis if not t.effect.sensor or t.effect.mounts]
    return tuple((t.key, t.variant, tuple(v.values())) for t, v in inside)


def pushed(run: MeasuredRun, hypothesis: Hypothesis) -> Push:
    """How the torque (or force) that pushes a free run follows from what is recorded of it: the factor, what is added
    (N.m), and by how much (s) the record is late.
    """
    if run.push is None:
        return 1.0, 0.0, 0.0
    name, late = run.push.signal.name, 0.0
    read: Readings = {name: np.array([0.0, 1.0])}
    for term, values in hypothesis:
        if term.effect.sensor and name in term.where.split("+"):
            read = term.effect.on_readings(read, run.name, term.where, values)
            late += term.effect.delay(run.name, name, term.where, values)
    bias, whole = read[name].tolist()
    return 1 / (whole - bias), -bias / (whole - bias), late


def push_of(run: MeasuredRun, factor: float, more: float, late: float) -> np.ndarray:
    """The torque (N,) N.m that pushes a run, at its samples."""
    assert run.push is not None
    known = np.isfinite(run.push.values)
    return factor * np.interp(run.time + late, run.time[known], run.push.values[known]) + more


def _pieces(run: MeasuredRun, key: Swing) -> list[Piece]:
    """What tells each piece of a free run from all others."""
    each = zip(pieces(run.time.size, len(key[2])), key[2], strict=True)
    return [(*key[:2], (piece.start, piece.stop), start) for piece, start in each]


# ---------------------------------------------------------------- sensors

# a first-order filter, the integral of exp(-s) y(t - tau s) over s, by Gauss and Laguerre: exact for motions that are
# polynomials of fifth degree over some tau
FILTER = tuple(zip(*(part.tolist() for part in np.polynomial.laguerre.laggauss(3)), strict=True))
Echoes = Sequence[tuple[float, float]]


def heard(hypothesis: Hypothesis, run: MeasuredRun) -> dict[str, Echoes]:
    """By signal the shares and ages (s) of the motion that its sensor reads at a time: one, or three behind a
    filter.
    """
    found: dict[str, Echoes] = {}
    for signal in run.channels:
        echoes: Echoes = [(1.0, sum(t.effect.delay(run.name, signal, t.where, v) for t, v in hypothesis))]
        for constant in (t.effect.lag(run.name, signal, t.where, v) for t, v in hypothesis):
            if constant:
                echoes = [(share * w, age + constant * s) for share, age in echoes for s, w in FILTER]
        found[signal] = echoes
    return found


def ages(heard_by: Mapping[str, Echoes]) -> list[float]:
    """Every age (s) of a motion that any sensor reads, in order."""
    return sorted({age for each in heard_by.values() for _, age in each})


def mixed(echoes: Echoes, seen: Mapping[float, Mapping[str, np.ndarray]], signal: str) -> np.ndarray:
    """A signal (N,) as its sensor reads it, of what there was to see by age."""
    if len(echoes) == 1:
        return seen[echoes[0][1]][signal]
    return np.asarray(sum(share * seen[age][signal] for share, age in echoes))


def sensed(hypothesis: Hypothesis, run: MeasuredRun, seen: Readings) -> dict[str, np.ndarray]:
    """The readings (N,) by signal of sensors that see this."""
    for term, values in hypothesis:
        seen = term.effect.on_readings(seen, run.name, term.where, values)
        rates = {s: rate for s in seen if (rate := term.effect.drift(run.name, s, term.where, values))}
        if rates:
            seen = {**seen, **{s: seen[s] + rate * (run.time - run.time[0]) for s, rate in rates.items()}}
    return dict(seen)


def turned_by(run: MeasuredRun, read: Turning, hypothesis: Hypothesis, rig: Rig) -> Turning:
    """How a motor turns whose encoder reads this (N,), or several (k, N); of a run that follows none it is what was
    given.  Raises Impossible for an encoder that errs so much that it does not tell one angle from another.
    """
    several = rig.mechanism.several
    for term, values in hypothesis if run.drive == "measured" else ():
        try:
            if not several:
                read = term.effect.motor(run.name, read, values)
            elif term.effect.misreads:
                read = _one_turned(read, rig.encoders.index(term.where), term, run.name, values)
        except ValueError as error:
            raise Impossible(f"{term.label}: {error}") from None
    return read


def _one_turned(read: Turning, k: int, term: Term, run: str, values: Values) -> Turning:
    """How several motors turn, the encoder of the k-th of which misreads."""
    one = term.effect.motor(run, Turning(*(getattr(read, part)[k] for part in PARTS)), values)
    return Turning(*(np.insert(np.delete(getattr(read, p), k, 0), k, getattr(one, p), 0) for p in PARTS))


def as_inputs(assembly: Assembly, moved: Turning) -> Turning:
    """The motion of several motors (k, N) as that of the linkage's inputs."""
    joints = [joint.name for joint in assembly.mechanism.motors]
    return Turning(*(assembly.inputs_at(dict(zip(joints, getattr(moved, part), strict=True))) for part in PARTS))


def misread(run: MeasuredRun, hypothesis: Hypothesis, rig: Rig) -> bytes:
    """What tells one motor from another that the same encoder's readings are followed by."""
    if run.drive != "measured":
        return b""
    each = Turning(*(np.tile(getattr(ANYWHERE, part), (len(rig.encoders), 1)) for part in PARTS))
    return turned_by(run, each if rig.mechanism.several else ANYWHERE, hypothesis, rig).theta.tobytes()


def jitter_of(run: MeasuredRun, hypothesis: Hypothesis) -> float:
    """How far (s, rms) the time stamps of a run that follows its encoder are off."""
    return sum(t.effect.jitter(run.name, v) for t, v in hypothesis) if run.drive == "measured" else 0.0


def read_at(run: MeasuredRun, encoder: str, course: Motor | None, jitter: float) -> np.ndarray:
    """When (N,) s, on the motor's clock, each line of a run was read whose time stamps jitter by so much (s, rms).

    Of what the encoder's readings are off the smooth course through them, jitter explains the share that it has of
    their square: the best linear estimate.  Where the crank hardly moves, they say nothing of the time.
    """
    if not jitter or course is None or encoder not in run.channels:
        return run.time
    seen = course.at(run.time)
    off = np.nan_to_num(run.channels[encoder].signal.apart(run.channels[encoder].values, seen.theta))
    late = off * seen.omega / (seen.omega**2 + SLOW**2 * np.mean(seen.omega**2))
    return run.time + jitter**2 / max(float(np.mean(late**2)), 1e-300) * late


def altered(mechanism: Mechanism, hypothesis: Hypothesis, run: str | None = None) -> Mechanism:
    """A mechanism with the effects of a hypothesis, as they are in a run (None: the mean of all).  Raises Impossible
    where the result is none.
    """
    for term, values in hypothesis:
        try:
            mechanism = term.effect.on_mechanism(mechanism, term.where, term.effect.in_run(values, run))
        except ValueError as error:  # pydantic's is one
            raise Impossible(f"{term.label}: {error}") from None
    return mechanism


def _balanced(assembly: Assembly, turning: Turning) -> Reactions:
    """What a drive that yields carries: of joints without clearance, soft bearings to first order."""
    if assembly.mechanism.soft_bearings:
        theta, omega, alpha = turning.theta, turning.omega, turning.alpha
        return displaced(assembly, theta, omega, alpha=alpha, model="first_order", clearances={}).configuration
    return kinetostatics(kinematics(assembly, turning.theta, turning.omega, turning.alpha))


def _joined(cranks: Sequence[Turning]) -> Turning:
    """Motions of the crank one after the other."""
    return Turning(*(np.concatenate([getattr(c, part) for c in cranks]) for part in ("theta", "omega", "alpha")))


def _parted(signals: Mapping[str, np.ndarray], sizes: Sequence[int]) -> list[dict[str, np.ndarray]]:
    """Signals (sum of sizes,) cut into runs again."""
    ends = np.cumsum([0, *sizes]).tolist()
    return [{s: v[begin:end] for s, v in signals.items()} for begin, end in pairwise(ends)]


def derived(
    assembly: Assembly,
    crank: Turning,
    near: Walk | None = None,
    sizes: Sequence[int] = (),
    time: np.ndarray | None = None,
    *,
    rates: bool = False,
) -> dict[str, np.ndarray]:
    """Every signal with this motion of the crank, or of several inputs ``near`` what is known: pins on their bearings'
    walls or in soft ones, links with a modulus bent.  ``sizes`` are the numbers of samples of several runs,
    ``time`` (N,) s that of loads over it; with ``rates`` signals on request are among them.
    """
    mechanism = assembly.mechanism
    if mechanism.displaced:
        found = _displaced(assembly, crank, near, sizes, time)
        ideal, signals = found.ideal, _over_gaps(mechanism, found, sizes, rates)
    else:
        ideal = kinetostatics(kinematics(assembly, crank.theta, crank.omega, crank.alpha, path=near, time=time))
        signals = _signals(mechanism, ideal, rates)
    if mechanism.bends:
        signals = read_again(mechanism, superposed(signals, compliance(ideal.motion, inertia=True)))
    return with_derived(signals, mechanism)


def _signals(m: Mechanism, answer: Displaced | Reactions, rates: bool) -> dict[str, np.ndarray]:
    return with_sensors(m, answer.signals() | answer.rates()) if rates else answer.signals()


def _displaced(
    assembly: Assembly, crank: Turning, near: Walk | None, sizes: Sequence[int], time: np.ndarray | None
) -> Displaced:
    """The linkage with its pins where they come to rest; soft bearings that hardly give, to first order with the
    reactions of the linkage that they displace: what that leaves out is as small as the square of what they give.
    """
    if not assembly.mechanism.clearances:
        found = displaced(assembly, crank.theta, crank.omega, alpha=crank.alpha, model="first_order", time=time)
        shortest = min(body.length for body in assembly.mechanism.bodies if body.length)
        if max(float(np.abs(gap).max()) for gap in found.gaps.values()) < STIFF * shortest:
            return replace(found, reactions=found.configuration)
    return displaced(assembly, crank.theta, crank.omega, alpha=crank.alpha, near=near, motions=sizes, time=time)


def _over_gaps(m: Mechanism, found: Displaced, sizes: Sequence[int], rates: bool) -> dict[str, np.ndarray]:
    """Every signal (N,); where pins have no place of rest, what clearance changes is on a straight line between
    neighbours of the same run, as the signal itself is not.  NaN in runs where they never have one.
    """
    signals = _signals(m, found, rates)
    if not found.flags:
        return signals
    ideal, lost = _signals(m, found.ideal, rates), np.zeros(found.ideal.motion.theta.size, bool)
    lost[list(found.flags)] = True
    runs = np.split(np.arange(lost.size), np.cumsum(sizes)[:-1])
    pairs = [(run[~lost[run]], run[lost[run]]) for run in runs if 0 < lost[run].sum() < run.size]
    for name, values in signals.items():
        before = ideal.get(name, np.zeros(lost.size))
        for known, at in pairs:
            values[at] = before[at] + np.interp(at, known, values[known] - before[known])
    return signals


def earlier(time: np.ndarray, delay: float) -> tuple[np.ndarray, np.ndarray]:
    """Which samples (k, N) of those at times (N,) s, and as how much each counts (k, N), tell of a motion some seconds
    before each: Lagrange's polynomials through six neighbours.  Before the first sample the first holds.
    """
    at = np.clip(time - delay, time[0], time[-1])
    count = min(NEIGHBOURS, time.size)
    which = np.clip(np.searchsorted(time, at) - count // 2, 0, time.size - count) + np.arange(count)[:, None]
    nodes, weights = time[which], np.ones(which.shape)
    for k, m in permutations(range(count), 2):
        weights[k] *= (at - nodes[m]) / (nodes[k] - nodes[m])
    return which, weights

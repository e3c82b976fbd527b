"""The explanation of a rig that rattles: the joint in which clearance spreads the engine's readings as measured."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from analytic.mechanism import Mechanism
from analytic.mechanism.one_line import count
from compare.diagnose.data.recording import MeasuredRun
from compare.diagnose.effects.effect import Values
from compare.diagnose.effects.joints import JointClearance
from compare.diagnose.engines import Engines
from compare.diagnose.explanation import Attempt, Explanation, Named
from compare.diagnose.fit import Fit
from compare.diagnose.intervals import Interval
from compare.diagnose.predict import Hypothesis, Model, Term
from compare.diagnose.problem import Problem
from compare.diagnose.rattle.contact import SILENT, Found, asked
from compare.diagnose.rattle.law import TRIALS_ALIKE, TRIALS_APART, Law, Simulate, jackknifed
from compare.diagnose.rattle.statistics import ALIKE, Key, Readings, Statistics
from compare.diagnose.rattle.trial import Trials, Tried, least, reaching, wanted
from compare.diagnose.rattle.turns import FEWEST, Turns, rattles
from compare.judge.statistics import NORMAL_95
from compare.results.diagnosis import DiagnosisVerdict
from sim_models.common.contact_laws import default_stiffness
from sim_models.engine import engine

PAYS = 0.25  # of the logarithm of the distance, that clearance must take away to be named
SEEN = 0.3  # of it: positions, or forces, that are farther from the nominal rig's than that must come nearer
NOWHERE = "A contact law is asked for, and no joint's clearance does as the rig does: none was looked for."
LAW = 0.05  # of a clearance: what contact laws other than the engine's may make of it, one standard deviation
LITTLE = 1e-3  # of the shortest link: a clearance to first order
BOUNCES = (0.6, 0.85)  # restitutions that are tried beside that of the usual damping, 0.3
RUBS = 0.1  # coefficient of friction that is tried beside none, where the law of contact is asked for
LARGEST_CLEARANCE = 0.06  # of the shortest link: no clearance is tried beyond


@dataclass(frozen=True)
class Struck(JointClearance):
    """Clearance whose pin strikes a wall that gives: where the mechanism says nothing of the contact, it has the
    default stiffness, and with that one law in every engine (left out, MuJoCo's own is hard, and bounces otherwise).
    That stiffness is for a crank that turns at ``speed`` (rad/s).  A ``restitution`` is what impacts give back of their
    speed, in place of what that law's usual damping does; ``friction`` a coefficient in the contact.
    """

    speed: float
    restitution: float | None = None
    friction: float | None = None

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        joint = mechanism.joint(where)
        said = (joint.contact_stiffness, joint.contact_damping, joint.radial_stiffness, joint.contact_law)
        if all(each is None for each in said):
            drive = mechanism.drive and mechanism.drive.model_copy(update={"speed": self.speed})
            stiffness = default_stiffness(mechanism.replace(drive=drive), "driven")
            mechanism = mechanism.with_joint(where, contact_stiffness=stiffness)
        if self.restitution is not None:
            mechanism = mechanism.with_joint(where, restitution=self.restitution)
        mechanism = super().on_mechanism(mechanism, where, values)
        return mechanism if self.friction is None else mechanism.with_joint(where, friction=self.friction)


def rattling(problem: Problem) -> Explanation | None:
    """What statistics say of a rig whose pins strike: None where nothing rattles, or no clearance in the engine does as
    the rig does.
    """
    turns = _turns(problem)
    struck = Struck(problem.rig.speed)
    able = struck.simulated_by(engine(problem.simulator))
    known = [t for t in problem.terms if isinstance(t.effect, JointClearance) and t.key not in problem.ruled_out]
    terms = [Term(struck, t.where) for t in known if able]
    laws = asked(problem.terms, problem.ruled_out)
    # friction that is not known, where it is looked for, must not make another joint of the one that rubs
    rubs = {law.where for law in laws if not problem.mechanism.joint(law.where).friction}
    terms += [Term(replace(struck, friction=RUBS), t.where) for t in terms if t.where in rubs]
    sensors = {run.name: _sensors(problem, run) for run in problem.measured.runs if run.name in turns}
    if not (terms or laws) or not turns or not rattles(problem.measured, turns, sensors):
        problem.notes += [SILENT] if laws else []
        return None
    if not terms:
        return _law_alone(problem, turns, sensors, laws[0])
    statistics = Statistics(problem.measured, problem.analytic(problem.base), turns, sensors)
    found = _Judged.of(problem, statistics, terms)
    if found is None or not found.pays():
        problem.notes += [NOWHERE] if laws else []
        return None
    return found.with_law(laws) if laws else found.explanation()


def note_unjudged(problem: Problem) -> None:
    """Note that a rig rattles whose model has clearance: there no sample can be judged."""
    loose, turns = list(problem.mechanism.clearances), _turns(problem)
    sensors = {run.name: _sensors(problem, run) for run in problem.measured.runs if run.name in turns}
    if loose and turns and rattles(problem.measured, turns, sensors):
        problem.notes.append(
            f"The rig rattles, and the model has clearance in {' and '.join(loose)}: what its pins do there cannot be"
            f" judged sample by sample. Ask for contact_law@{loose[0]} alone (only), which compares statistics."
        )


def _turns(problem: Problem) -> dict[str, Turns]:
    """The revolutions of runs that have enough of them."""
    m = problem.mechanism
    runs = [run for run in problem.measured.runs if run.drive != "free"] if m.cranked and not m.several else []
    each = {run.name: Turns.enough(problem.crank_angle(run)) for run in runs}
    return {name: turns for name, turns in each.items() if turns is not None}


def _sensors(problem: Problem, run: MeasuredRun) -> list[str]:
    return [
        s for s, c in run.channels.items() if s not in problem.rig.encoders and np.isfinite(c.values).sum() > FEWEST
    ]


# ---------------------------------------------------------------- in the engine


def _cut(problem: Problem, rows: Mapping[str, np.ndarray]) -> Model:
    """The nominal model of some samples, by run, of the runs that are judged."""
    runs = [
        replace(run, time=run.time[at], channels={s: c.at(at) for s, c in run.channels.items()})
        for run in problem.measured.runs
        if (at := rows.get(run.name)) is not None
    ]
    return Model(replace(problem.measured, runs=tuple(runs)), problem.rig, problem.mechanism, problem.model.courses)


@dataclass(frozen=True)
class Bench:
    """Clearance in the chosen engine, in the runs that are judged."""

    problem: Problem
    turns: Mapping[str, Turns]

    def __call__(self, term: Term, size: float, first: int | None) -> Readings | None:
        """Readings (N,) by signal of each run, NaN beyond its ``first`` revolutions and nothing of runs that are not
        judged; None where the engine has no answer.
        """
        self.problem.tell(f"clearance of {1e3 * size:.3g} mm in {term.where} simulated in {self.problem.simulator}")
        return self.simulated(_with(term, size), first)

    def simulated(self, hypothesis: Hypothesis, first: int | None) -> Readings | None:
        """The same of any hypothesis."""
        rows = {
            name: np.flatnonzero((each.turn >= 0) & (each.turn < (first or each.count)))
            for name, each in self.turns.items()
        }
        engines = Engines(_cut(self.problem, rows), self.problem.simulator, 1)
        found = engines.simulate(hypothesis, (self.problem.simulator,))[self.problem.simulator].readings
        if found is None:
            return None
        judged = dict(zip([run.name for run in self.problem.measured.runs if run.name in rows], found, strict=True))
        return [
            {s: _among(values, rows[run.name], run.time.size) for s, values in judged.get(run.name, {}).items()}
            for run in self.problem.measured.runs
        ]

    def striking(self, clearance: Term | None, law: Term) -> Simulate:
        """Laws of contact in a joint, with a clearance that is tried there, or the mechanism's own."""

        def simulate(tried: Law, size: float) -> Readings | None:
            self.problem.tell(f"a law of contact in {law.where} simulated in {self.problem.simulator}")
            own = [] if clearance is None else _with(clearance, size)
            return self.simulated([*own, (law, tried._asdict())], None)

        return simulate


def _with(term: Term, size: float) -> Hypothesis:
    return [(term, {term.effect.parameters[0].name: size})]


def _natural(problem: Problem, term: Term, size: float) -> np.ndarray:
    """Natural coordinates of a clearance (m)."""
    return term.effect.natural(problem.rig, term.where, dict(_with(term, size)[0][1]))


def _among(values: np.ndarray, rows: np.ndarray, size: int) -> np.ndarray:
    """Values at some rows of (size,), NaN elsewhere."""
    found = np.full(size, math.nan)
    found[rows] = values
    return found


def _shortest(problem: Problem) -> float:
    """The shortest link (m)."""
    return min(body.length for body in problem.mechanism.bodies if body.length)


def bouncing(problem: Problem) -> Callable[[Term], Sequence[Term]]:
    """The same clearance with other restitutions, where the mechanism does not say what impacts give back."""

    def others(term: Term) -> Sequence[Term]:
        joint = problem.mechanism.joint(term.where)
        known = joint.restitution is not None or joint.contact_damping is not None
        assert isinstance(term.effect, Struck)
        return () if known else [Term(replace(term.effect, restitution=e), term.where) for e in BOUNCES]

    return others


def sizes(problem: Problem, statistics: Statistics, terms: Sequence[Term]) -> dict[Term, float | None]:
    """The clearance (m) in each joint that displaces as far as is measured in the middle, by the analytic model; None
    where no position is measured or it has no answer.
    """
    runs = {run.name: run for run in problem.measured.runs if run.name in statistics.turns}
    middles = {name: each.middles() for name, each in statistics.turns.items()}
    rows = {name: np.unique(at) for name, at in middles.items()}
    keys = statistics.places
    sigma = {key: runs[key[0]].channels[key[1]].noise for key in keys}
    medians = {key: statistics.measured.whole[key][:, 2] for key in keys}
    little = LITTLE * _shortest(problem)
    base, *moved = _cut(problem, rows)([[], *(_with(term, little) for term in terms)])
    found: dict[Term, float | None] = dict.fromkeys(terms)
    for term, after in zip(terms, moved, strict=True):
        if not keys or base is None or after is None:
            continue
        change = {
            (name, s): (after[r][s] - base[r][s])[np.searchsorted(rows[name], middles[name])]
            for r, name in enumerate(runs)
            for run, s in keys
            if run == name
        }
        found[term] = little * min(max(wanted(medians, change, sigma), 1e-2), LARGEST_CLEARANCE / LITTLE)
    return found


# ---------------------------------------------------------------- the judgement


@dataclass(frozen=True)
class _Judged:
    """What was tried: each joint's trials, the best first, beside the nominal mechanism in the same engine."""

    problem: Problem
    statistics: Statistics
    nominal: Tried
    trials: Sequence[Sequence[Tried]]

    @classmethod
    def of(cls, problem: Problem, statistics: Statistics, terms: Sequence[Term]) -> _Judged | None:
        before = problem.simulated(problem.base).readings
        if before is None:
            return None
        nominal = Tried(terms[0], 0.0, statistics.distances(statistics.spread(before)))
        if nominal.misfit() < PAYS:
            return None

        def largest(term: Term) -> float:
            room = problem.fitter.bounds(term)[1][0] - _natural(problem, term, 0.0)[0]
            return float(min(LARGEST_CLEARANCE * _shortest(problem), room))

        bench = Bench(problem, statistics.turns)
        trials = Trials(statistics, bench, _shortest(problem), largest, problem.options.late, bouncing(problem))
        found = trials.searched(sizes(problem, statistics, terms), nominal.misfit())
        joints = {tried[0].term.where: tried for tried in reversed(found)}  # each with the law that does best there
        return cls(problem, statistics, nominal, [t for t in found if joints[t[0].term.where] is t]) if found else None

    @property
    def best(self) -> Tried:
        """Of all trials."""
        return self.trials[0][0]

    def pays(self) -> bool:
        """Whether clearance takes enough of the distance away, whichever revolutions are left out, and of positions and
        of forces both where both are away.
        """
        groups = range(len(self.best.apart))
        if any(self.nominal.misfit(None, g) - self.best.misfit(None, g) < PAYS for g in groups):
            return False
        return all(
            self.nominal.misfit(keys) - self.best.misfit(keys) > PAYS / 2
            for keys in self._kinds()
            if self.nominal.misfit(keys) > SEEN
        )

    def _kinds(self) -> list[list[Key]]:
        """Sensors of positions, and of forces and torques; those that there are."""
        places = self.statistics.places
        return [keys for keys in (places, [key for key in self.statistics.floor if key not in places]) if keys]

    def tied(self) -> list[Sequence[Tried]]:
        """Other joints that do as well."""
        found = []
        for trials in self.trials[1:]:
            behind = [trials[0].misfit(None, g) - self.best.misfit(None, g) for g in range(len(self.best.apart))]
            if behind[0] < max(TRIALS_ALIKE, TRIALS_APART * jackknifed(behind[1:])):
                found.append(trials)
        return found

    def size(self, trials: Sequence[Tried], keys: Sequence[Key] | None = None, group: int = 0) -> float:
        """The clearance (m) with which positions reach as far as the measured ones; where none is measured, that with
        the least misfit.
        """
        known = [key for key in self.statistics.places if keys is None or key in keys]
        if known:
            return reaching(trials, known, group)
        return least(trials, lambda each: each.misfit(keys, group))

    def interval(self, trials: Sequence[Tried]) -> Interval:
        """That clearance with its 95 % interval: by what leaving revolutions out changes, and by the contact law."""
        value = self.size(trials)
        groups = [math.log(self.size(trials, None, 1 + g)) for g in range(self.statistics.groups)]
        wide = math.exp(NORMAL_95 * math.hypot(jackknifed(groups), LAW))
        return Interval(value, value / wide, value * wide, "m")

    def held_out(self, trials: Sequence[Tried]) -> tuple[float, float]:
        """Distances before and after on data that the size was not found with: each run in turn where there are three
        or more, else each group of revolutions.
        """
        floor, runs = self.statistics.floor, list(self.statistics.turns)
        sizes, judged = [], []
        for out in runs if len(runs) >= 3 else ():
            sizes.append(self.size(trials, [key for key in floor if key[0] != out]))
            judged.append([key for key in floor if key[0] == out])
        if not sizes:
            sizes = [self.size(trials, None, 1 + group) for group in range(self.statistics.groups)]
            judged = [list(floor)] * len(sizes)
        near = [nearest(trials, size) for size in sizes]
        before, after = (
            math.exp(float(np.mean([each.misfit(keys) for each, keys in zip(tried, judged, strict=True)])))
            for tried in ([self.nominal] * len(near), near)
        )
        return before, after

    def explanation(self) -> Explanation:
        """The joint that does best with its clearance, what ties with it, and the statistics by which it is judged."""
        p, trials = self.problem, self.trials[0]
        fit = self._fit(self.best.term, self.size(trials))
        rivals = [(other[0].term, self._fit(other[0].term, self.size(other))) for other in self.tied()]
        gap, share = self._closed(self.best)
        named = Named(
            self.best.term,
            {self.best.term.effect.parameters[0].name: self.interval(trials)},
            fit_gain(p.base, fit),
            gap,
            self.held_out(trials),
            tuple(rivals),
            share,
        )
        verdict = _verdict(named, bool(rivals))
        p.notes.append(self.told())
        tied = {term for term, _ in rivals}
        others = [each[0] for each in self.trials[1:] if each[0].term not in tied]
        return Explanation(
            p.base, fit, (named,), verdict, np.ones(p.data.size), False, tuple(self._attempt(o) for o in others),
            self.statistics,
        )  # fmt: skip

    def with_law(self, laws: Sequence[Term]) -> Explanation:
        """The same with the law of contact at that joint, and its clearance as that law wants it."""
        plain, best, trials = self.explanation(), self.best, self.trials[0]
        # what impacts give back is the law's to say, also where clearance was tried with several answers
        usual = next(
            (t for t in trials if isinstance(t.term.effect, Struck) and t.term.effect.restitution is None), best
        )
        law = next((t for t in laws if t.where == best.term.where), None)
        if law is None:
            self.problem.notes.append(
                f"{laws[0].label} is asked for, and the clearance that was found is in joint {best.term.where}: no law"
                " was looked for."
            )
            return plain
        struck = Term(Struck(self.problem.rig.speed), law.where)
        simulate = Bench(self.problem, self.statistics.turns).striking(struck, law)
        found = Found.of(
            law, self.problem.rig, self.statistics, simulate, self.size(trials), True, self.problem.options.late
        )
        if not _told(self.problem, found, usual):
            return plain
        assert found is not None
        known = self.interval(trials)  # by how far positions reach; what the law moves it by comes on top
        wide = math.exp(math.hypot(math.log(known.high / known.value), math.log(found.size / known.value)))
        size = {struck.effect.parameters[0].name: Interval(found.size, found.size / wide, found.size * wide, "m")}
        fit = _lawful(self._fit(struck, found.size), found)
        gap, share = self._closed(usual)
        clearance = replace(plain.named[0], term=struck, parameters=size, gap=gap, share=share)
        named = clearance, _named_law(self.nominal, usual, found)
        return replace(plain, fit=fit, named=named, verdict=_verdict(named[1], bool(clearance.ties)))

    def _closed(self, tried: Tried) -> tuple[tuple[float, float], float]:
        """The gap before and after, and the share of its square beyond two recordings' own that goes."""
        before, after = math.exp(self.nominal.misfit()), math.exp(tried.misfit())
        return (before, after), _share(before, after, before)

    def _attempt(self, other: Tried) -> Attempt:
        name = other.term.effect.parameters[0].name
        gap, share = self._closed(other)
        times = gap[1] / math.exp(self.best.misfit())
        where, value = self.best.term.where, {name: Interval(other.size, -math.inf, math.inf, "m")}
        why = f"in {self.problem.simulator} its statistics are {times:.2g} times as far off as those of joint {where}"
        return Attempt(other.term, value, share, gap, why)

    def _fit(self, term: Term, size: float) -> Fit:
        """A clearance as the analytic model has it, which no sample is fitted to."""
        p = self.problem
        x = _natural(p, term, size)
        start = dict(zip(p.base.terms, p.base.x, strict=True)) | {term: x}
        return p.fitter.at([*p.base.terms, term], start) or unmoved(p.base, term, x)

    def _spikes(self) -> str:
        """What becomes of readings that were left out as spikes."""
        judged = self.statistics.floor
        spikes = [
            int(np.isfinite(channel.spikes).sum())
            for run in self.problem.measured.runs
            for signal, channel in run.channels.items()
            if channel.spikes is not None and (run.name, signal) in judged
        ]
        return (
            f"{count(sum(spikes), 'reading')} that look like isolated spikes are impacts, and count." if spikes else ""
        )

    def told(self) -> str:
        """By what kind of evidence clearance is named, in sentences."""
        s, simulator = self.statistics, self.problem.simulator
        effect = self.best.term.effect
        back = effect.restitution if isinstance(effect, Struck) else None
        bounces = "" if back is None else f"Impacts that give back {back:g} of their speed did best. "
        return (
            f"The rig rattles: in {count(s.revolutions, 'revolution')} of {count(len(s.turns), 'run')} several sensors"
            " are thrown off at the same instants, in each revolution otherwise, as where pins leave their bearings and"
            f" strike. No sample can be foretold then. Clearance was tried joint by joint in {simulator}, and judged by"
            " how readings are spread in each part of a revolution (quantiles over all revolutions). A gap of 1 is how"
            f" far two recordings of one rig are apart in that. {bounces}{self._spikes()}"
        ).rstrip()


def nearest(trials: Sequence[Tried], size: float) -> Tried:
    """The trial whose clearance is nearest to a size (m)."""
    return min(trials, key=lambda each: abs(math.log(each.size / size)))


def unmoved(base: Fit, term: Term, x: np.ndarray) -> Fit:
    """The nominal fit with a term to which the analytic model has no answer."""
    still = np.zeros((base.residual.size, x.size))
    bound = np.concatenate([base.bound, np.zeros(x.size, bool)])
    return Fit((*base.terms, term), (*base.x, x), base.residual, np.hstack([base.jacobian, still]), bound)


def fit_gain(base: Fit, fit: Fit) -> float:
    """What chi^2 loses sample by sample, at least nothing."""
    return max(base.chi2 - fit.chi2, 0.0)


def _share(before: float, after: float, nominal: float) -> float:
    """The share of the nominal gap's square, beyond two recordings' own, that goes from one gap to another."""
    return float(np.clip((before**2 - after**2) / max(nominal**2 - 1, 1e-12), 0.0, 1.0))


def _verdict(last: Named, rivals: bool) -> DiagnosisVerdict:
    """What is said where this is the last effect to be named."""
    closed = last.gap[1] <= ALIKE and last.held_out[1] < last.held_out[0]
    return "partly explained" if not closed else "ambiguous" if rivals else "explained"


# ---------------------------------------------------------------- the law of contact


def _law_alone(
    problem: Problem, turns: Mapping[str, Turns], sensors: Mapping[str, Sequence[str]], law: Term
) -> Explanation | None:
    """The law of contact in a joint of the mechanism that has clearance; None where it tells nothing."""
    before, ideal = problem.simulated(problem.base).readings, problem.mechanism.ideal()
    # with clearance the analytic model foretells no sample in which a pin is off its wall
    foretold = Model(problem.measured, problem.rig, ideal, problem.model.courses)([problem.base.values(problem.rig)])[0]
    if before is None or foretold is None:
        return None
    statistics = Statistics(problem.measured, foretold, turns, sensors)
    own = Tried(law, problem.mechanism.joint(law.where).clearance, statistics.distances(statistics.spread(before)))
    simulate = Bench(problem, statistics.turns).striking(None, law)
    found = Found.of(law, problem.rig, statistics, simulate, own.size, False, problem.options.late)
    if not _told(problem, found, own):
        return None
    assert found is not None
    named = _named_law(own, own, found)
    fit = _lawful(problem.base, found)
    weights = np.ones(problem.data.size)
    return Explanation(problem.base, fit, (named,), _verdict(named, False), weights, False, (), statistics)


def _told(problem: Problem, found: Found | None, before: Tried) -> bool:
    """Whether the data tell a law, which is noted either way."""
    if problem.options.late():
        tried = count(0 if found is None else len(found.search.trials), "law")
        problem.notes.append(
            f"The time was over after {tried} of contact: nothing is said of it. Give a larger budget."
        )
        return False
    if found is None:
        problem.notes.append(f"No law of contact could be tried: {problem.simulator} has no answer to any.")
        return False
    problem.notes.append(found.told(problem.simulator))
    gain = found.gains(before.misfit(), [before.misfit(None, 1 + g) for g in range(found.search.statistics.groups)])
    if gain < PAYS:
        problem.notes.append("None of them is named: the best comes hardly nearer than what is known already.")
        return False
    if len(found.untold()) == len(found.intervals()):
        problem.notes.append("None of them is named: the statistics answer to none of its parameters.")
        return False
    return True


def _named_law(nominal: Tried, before: Tried, found: Found) -> Named:
    """The law as it is named, beside what was there before it."""
    gap = math.exp(before.misfit()), math.exp(found.search.answer.misfit())
    share = _share(*gap, math.exp(nominal.misfit()))
    return Named(found.term, found.intervals(), 0.0, gap, found.held_out(before.apart[0]), (), share)


def _lawful(fit: Fit, found: Found) -> Fit:
    """A fit with the law, to which the analytic model has no answer."""
    return unmoved(fit, found.term, found.natural)

"""The problem of a diagnosis: one nominal mechanism, its data, model and engines, and the steps in their order."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from analytic.mechanism import Mechanism
from compare.diagnose import prepare, slips
from compare.diagnose.colour import colours
from compare.diagnose.data.recording import Measured, MeasuredError, MeasuredRun
from compare.diagnose.effects.effect import Effect, Rig
from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.diagnose.engines import Engines
from compare.diagnose.explanation import Attempt, Explanation, has_structure
from compare.diagnose.fit import Fit, Fitter
from compare.diagnose.locate import Stretch, locate, rms_difference, spread
from compare.diagnose.noise import CLOSED, lasting, rms
from compare.diagnose.posterior.infer import Inference, Posterior, seen
from compare.diagnose.predict import SLOW, Model, Term, altered
from compare.diagnose.rattle.contact import lawless
from compare.diagnose.rattle.statistics import ALIKE
from compare.diagnose.released import first_fit
from compare.diagnose.residuals import Data
from compare.diagnose.sensitivities import Sensitivity, candidates, sensitivities
from compare.diagnose.simulate import Simulated
from compare.diagnose.verdict import explained
from compare.progress import Progress
from compare.quantities import amount
from compare.report.words.measured import NOISE
from sim_models.engine import SimulationError, SimulatorMissing, engine, engine_names

EQUIVALENT = 0.1  # of the noise: an engine this near the analytic model is the same
BEGINNING = 0.06  # of free runs, from which the nominal mechanism's starts are taken
SHOWS = 0.2  # of the noise (rms), from which on links that bend are seen
FAR = 2.0  # times the gap of the analytic model: an engine with a larger one moves in another way altogether
LATE = 1.5  # of its noise: an encoder that scatters more has lines that are not read when their stamps say
OVERSTATED = 0.9  # of the noise: a smaller gap says that the noise is less than stated
RECOLOURED = 2  # times that the colours of noise are estimated anew
REMEMBERED = 3  # simulations of all runs that are kept beside the last
REFITS = 2  # to the engine's own difference from the analytic model
Noise = Mapping[tuple[str, str], float]  # 1-sigma, SI, by run and signal


def silent(what: str, done: int, total: int | None) -> None:
    """Progress that nobody watches."""


@dataclass(frozen=True)
class Options:
    """What an engineer asks of a diagnosis.

    ``simulator`` is the chosen engine; ``only`` and ``exclude`` are ``effect`` or ``effect@where``; ``own`` are effects
    beside the vocabulary; with ``others`` every installed engine simulates too, in as many processes as ``workers``.
    It ends ``budget`` seconds after it ``began`` (None: when it is done), with the best so far.  ``astray`` are effects
    that were found before, with which the engine moves in another way than the analytic model: they are ruled out.
    """

    simulator: str
    only: Sequence[str] = ()
    exclude: Sequence[str] = ()
    own: Sequence[Effect] = ()
    others: bool = True
    workers: int | None = None
    progress: Progress = silent
    budget: float | None = None
    began: float = field(default_factory=time.monotonic)
    astray: tuple[Attempt, ...] = ()

    def late(self) -> bool:
        """Whether the budget is spent."""
        return self.budget is not None and time.monotonic() - self.began > self.budget

    @property
    def vocabulary(self) -> Mapping[str, Effect]:
        """All effects that are considered, by name."""
        return VOCABULARY | {e.name: e for e in self.own}

    def engines(self) -> tuple[tuple[str, ...], dict[str, str]]:
        """The engines that simulate, the chosen one first, and why others do not.  Raises Unsupported or
        SimulatorMissing for the chosen one.
        """
        engine(self.simulator)
        names: tuple[str, ...] = (self.simulator,)
        skipped: dict[str, str] = {}
        for name in engine_names() if self.others else ():
            if name != self.simulator:
                try:
                    engine(name)
                    names = (*names, name)
                except SimulatorMissing as error:
                    skipped[name] = str(error)
        return names, skipped


@dataclass(frozen=True)
class Verified:
    """An explanation with what the engines say of it, by engine: the chosen one first.

    ``agreement`` is the largest rms difference of a sensor between an engine and the analytic model, in noise;
    ``agreement_before`` the same of the chosen engine on the nominal mechanism.
    """

    explanation: Explanation
    explained: Mechanism
    before: Mapping[str, Simulated]
    after: Mapping[str, Simulated]
    agreement: Mapping[str, float]
    agreement_before: float
    stretches: Sequence[Stretch]


@dataclass
class Problem:
    """Everything that a diagnosis works on.

    ``terms`` are all effects at their places, ``ruled_out`` says why some are not considered; ``base`` is the nominal
    mechanism as a fit (of the starts of free runs); ``notes`` are sentences for the report.
    """

    measured: Measured
    rig: Rig
    mechanism: Mechanism
    model: Model
    data: Data
    fitter: Fitter
    terms: list[Term]
    ruled_out: dict[tuple[str, str], str]
    options: Options
    engines: tuple[str, ...]
    skipped: dict[str, str]
    base: Fit
    engine_runs: Engines
    notes: list[str] = field(default_factory=list)
    nominal: Callable[[], dict[str, Simulated]] = dict  # what the other engines say of the nominal mechanism
    inference: Posterior | None = None
    complete: bool = True  # whether the search ended by itself, not by its budget
    remembered: list[tuple[list[tuple[Term, dict[str, float]]], Simulated]] = field(default_factory=list)

    @classmethod
    def of(cls, measured: Measured, mechanism: Mechanism, options: Options) -> Problem:
        """Prepare: the rig, the noise floor, the nominal model and what each engine says of it."""
        engines, skipped = options.engines()
        measured = prepare.thinned(measured)
        slips.refuse(measured, mechanism)
        courses, measured = prepare.followed(measured)
        noise = {(run.name, s): c.noise for run in measured.runs for s, c in run.channels.items()}
        rig, model = prepare.nominal(measured, mechanism, courses)
        measured, rig, model = prepare.sorted_out(measured, rig, model)
        noise = {key: size for key, size in noise.items() if key in measured.sensors}
        data = Data(measured, noise, prepare.shared(measured, noise, model))
        fitter = Fitter(model, data, rig, prepare.bounds(rig, measured.tolerance))
        every = candidates(rig, options.vocabulary, (*options.only, *options.exclude))
        prepare.check_prior(measured, every)
        terms, ruled_out = prepare.considered(
            every,
            measured.tolerance,
            fitter.bounds,
            options.only,
            options.exclude,
        )
        ruled_out |= lawless(terms, ruled_out, mechanism, options.simulator, options.only)
        ruled_out |= {attempt.term.key: attempt.failed for attempt in options.astray}
        workers = options.workers or min(2, os.cpu_count() or 1)
        problem = cls(
            measured, rig, mechanism, model, data, fitter, terms, ruled_out, options, engines, skipped,
            begun(model, fitter), Engines(model, options.simulator, workers),
        )  # fmt: skip
        slips.told(slips.free(problem.measured.runs, problem.analytic(problem.base)), problem.measured.runs)
        problem.note_limits()
        problem.raise_noise_floor(noise)
        problem.nominal = problem.engine_runs.begin(problem.base.values(rig), engines[1:])
        return problem

    @property
    def simulator(self) -> str:
        """The chosen engine."""
        return self.options.simulator

    @property
    def signatures(self) -> Mapping[Term, Sensitivity]:
        """How these data's residual answers to each effect that they can see."""
        if self.inference is None:
            return self._signatures
        data = self.judged
        return {t: seen(data, s) for t, s in self.inference.surveyed.signatures.items()}

    @cached_property
    def _signatures(self) -> Mapping[Term, Sensitivity]:
        """The same about the nominal model, where no posterior was asked for."""
        return sensitivities(self.fitter, self.base, self.sought)

    @property
    def judged(self) -> Data:
        """The data by which a gap is closed: errors that careful work leaves on every rig belong to their noise."""
        return self.data if self.inference is None else self.data.beside(self.inference.errors)

    @property
    def noise_floor(self) -> float:
        """What noise and errors that careful work leaves on every rig make of a gap (rms), over the noise."""
        errors = 0.0 if self.inference is None else float(np.sum(self.inference.errors**2))
        return math.sqrt(1 + errors / self.data.size)

    @property
    def sought(self) -> list[Term]:
        """The terms that are looked for sample by sample."""
        return [t for t in self.terms if t.key not in self.ruled_out and not t.effect.asked_for]

    def note_limits(self) -> None:
        """Note what is not modelled in these runs, and what was said beforehand."""
        self.notes += [
            f"As {self.measured.source} says, {name} is {factor:g} times as likely as usual."
            for name, factor in self.measured.prior.items()
        ]
        if self.mechanism.displaced or any(t.effect.needs & {"contact", "soft_bearing"} for t in self.terms):
            self.notes += [
                f"In run {run.name}, which is free, joints are taken without clearance and bearings as rigid."
                for run in self.measured.runs
                if run.drive == "free"
            ]

    def shows_bending(self, bending: Mechanism) -> bool:
        """Whether these data would show the difference that bending links make to the nominal linkage."""
        if self.base.terms:
            return False
        found = Model(self.measured, self.rig, bending, self.model.courses)([[]])[0]
        difference = np.zeros(1) if found is None else self.data.residual(found) - self.base.residual
        return found is not None and max(rms(difference[p.place]) for p in self.data.parts) > SHOWS

    @property
    def evidence(self) -> float:
        """Log of how probable the data are with what explains them, up to a constant, where samples count alike."""
        return -self.base.chi2 / 2 if self.inference is None else self.inference.evidence

    def raise_noise_floor(self, noise: Noise) -> None:
        """Simulate the nominal mechanism and let the noise floor take in what the engine and the analytic model differ
        by, and what the encoder leaves open of when lines were read.  Raises SimulationError where the engine cannot.
        """
        chosen = self.simulated(self.base)
        if chosen.readings is None:
            raise SimulationError(
                f"{self.simulator} cannot simulate the nominal mechanism in these runs: {chosen.skipped}"
            )
        errors = self.line_errors()
        floor = {key: math.hypot(each, errors.get(key, 0.0)) for key, each in noise.items()}
        for run, simulated, predicted in zip(
            self.measured.runs, chosen.readings, self.analytic(self.base), strict=True
        ):
            for name, channel in run.channels.items():
                key, unit = (run.name, name), channel.signal.unit
                difference = rms_difference(channel.signal, simulated[name], predicted[name])
                floor[key] = math.hypot(floor[key], difference)
                if difference > 0.5 * noise[key]:
                    self.notes.append(
                        f"In run {run.name}, {name} differs between {self.simulator} and the analytic model by"
                        f" {amount(difference, unit)} (rms), noise {amount(noise[key], unit)}; the noise floor is"
                        f" raised to {amount(floor[key], unit)}."
                    )
        raised = Data(self.measured, floor)
        self.data = Data(self.measured, floor, self.data.shared * (self.data.sigma / raised.sigma)[:, None])
        self.fitter = self.fitter.on(self.data)
        self.base = self.fitter.again(self.base) or self.base

    def line_errors(self) -> dict[tuple[str, str], float]:
        """By run and signal, what readings are off (rms, SI) where only the encoder says when their line was read: in
        runs that follow it, and whose encoder scatters by more than its noise.
        """
        found: dict[tuple[str, str], float] = {}
        if len(self.rig.encoders) > 1:
            return found  # two encoders that scatter tell two times
        for run, predicted in zip(self.measured.runs, self.analytic(self.base), strict=True):
            encoder, course = run.channels.get(self.rig.encoder), self.model.courses.get(run.name)
            if encoder is None or course is None or not encoder.noise_given:
                continue
            turning, unit = course.at(run.time), encoder.signal.unit
            scatter = rms(np.nan_to_num(encoder.signal.apart(encoder.values, turning.theta)))
            turns = np.abs(turning.omega) > SLOW * np.abs(turning.omega).mean()
            if scatter < LATE * encoder.noise or not turns.any():
                continue
            self.notes.append(
                f"In run {run.name} the encoder is {amount(scatter, unit)} (rms) off the smooth course through its"
                f" readings, and its noise is {amount(encoder.noise, unit)}: lines seem not to be read when their"
                " stamps say. The noise floor takes in what the encoder's own noise then leaves open."
            )
            for name in run.channels:
                slope = np.gradient(predicted[name], run.time)[turns] / turning.omega[turns]
                found[run.name, name] = encoder.noise * rms(slope)
        return found

    # ---------------------------------------------------------------- the explanation

    @property
    def overstated(self) -> bool:
        """Whether the data are nearer to the nominal model than their noise allows."""
        residual = self.base.residual
        return rms(residual) < OVERSTATED and self.largest_rms(residual) <= CLOSED

    def explanation(self) -> Explanation:
        """What the data say sample by sample, by the posterior over sets of effects.  Where the chosen engine differs
        from the analytic model, that difference is taken off the data, and they are judged again.
        """
        if self.overstated:
            self.complete = not self.options.late()
            return self.quiet()
        begun = self.begin_search(self.data)
        if not self.base.terms:  # noise first: what no effect explains tells of it, or what the best set nearby leaves
            if self.coloured(begun.left):
                begun = self.begin_search(self.data, begun)
            else:
                begun = self.recoloured(begun.search(far=False), far=False)
        searched = self.recoloured(self.searched(begun), far=True)
        found = self.concluded(searched, np.zeros(self.data.size))
        self.note_colours()
        self.inference = found
        self.complete = not self.options.late()
        return explained(found, self.base, self.options.late)

    def concluded(self, searched: Inference, shift: np.ndarray, again: int = REFITS) -> Posterior:
        """The posterior of what was searched for, in data less what the chosen engine differs by; ``shift`` (size,) was
        taken off before.  Where another set is the best in the end, so many times ``again``.
        """
        found: Posterior | None = None
        for _ in range(REFITS):
            fit = (found or searched).judged
            difference = None if self.options.late() else self.difference(fit)
            if difference is None or self.largest_rms(difference - shift) < EQUIVALENT:
                break
            closed = not shift.any() and closes(searched.judge.data, fit)
            if not shift.any():
                self.note_difference(self.largest_rms(difference), closed)
            if closed:
                found = searched.posterior().shifted(difference)
            else:
                found, searched = None, self.search_again(self.data.shifted(difference), searched)
            shift = difference
        best = searched.best.keys
        found = found or searched.posterior()
        done = searched.best.keys == best or not again
        return found if done else self.concluded(searched, shift, again - 1)

    def begin_search(self, data: Data, before: Inference | None = None) -> Inference:
        """The way to the posterior of these data, with what is known from others."""
        fitter = self.fitter.on(data)
        base = fitter.again(self.base) or self.base
        return Inference(fitter, base, self.sought, self.options.late, before, self.tell)

    def search_again(self, data: Data, before: Inference, far: bool = True) -> Inference:
        """The likeliest sets of effects in these data, from the best of others."""
        return self.begin_search(data, before).search([before.best.fit], far)

    def searched(self, begun: Inference) -> Inference:
        """The likeliest sets of effects, from the best so far, if there is one; of free runs in pieces first."""
        if not self.base.terms:
            return begun.search([begun.best.fit] if begun.weighed else [])
        starts = dict(zip(self.base.terms, self.base.x, strict=True))
        first = first_fit(begun.plain, starts, self.sought, self.options.late)
        return begun.search([] if first is None else [first])

    def recoloured(self, searched: Inference, far: bool) -> Inference:
        """What was searched for, in noise of the colours that its best set leaves, until they stay."""
        for _ in range(RECOLOURED):
            left = self.data.coloured({}).residual(self.analytic(searched.judged))
            if self.options.late() or not self.coloured(left):
                break
            searched = self.search_again(self.data, searched, far)
        return searched

    def tell(self, said: str) -> None:
        """Say what the search is at."""
        self.options.progress(f"search: {said}", 1, 4)

    def note_difference(self, size: float, closed: bool) -> None:
        """Note by how much (noise, rms) the chosen engine differs from the analytic model, and what was done about it:
        where the effects close the gap, what more the difference asks for is the engine's, not the rig's.
        """
        self.notes.append(
            f"With these effects {self.simulator} differs from the analytic model by up to {size:.2g} of a sensor's"
            f" noise (rms). That difference was taken off the data, and {'they were fitted' if closed else 'sought'}"
            " again."
        )

    def coloured(self, left: np.ndarray) -> bool:
        """Whether what is left (size,) of the data, over white noise, is noise of unknown colours; then they are known
        from now on.
        """
        plain = self.data.coloured({})
        if rms(left) <= CLOSED and not has_structure(plain, left):
            return False
        found = colours(plain, left)
        if found == self.data.colours:
            return False
        self.data = plain.coloured(found)
        self.fitter = self.fitter.on(self.data)
        self.base = self.fitter.again(self.base) or self.base
        return True

    def note_colours(self) -> None:
        """Note which sensors' noise is not white."""
        for signal, colour in self.data.colours.items():
            parts = ["wanders slowly"] if colour.keeps else []
            parts += [f"hums at {frequency:g} Hz" for frequency in colour.hum]
            unit = self.measured.signals[signal].unit
            runs = [run for run in self.measured.runs if signal in run.channels]
            size = colour.total * max(self.data.noise[run.name, signal] for run in runs)
            stated = max(run.channels[signal].noise for run in runs)
            given = all(run.channels[signal].noise_given for run in runs)
            ratio, of = (size / stated, "what is stated") if given else (colour.total, "its scatter")
            self.notes.append(
                f"{NOISE} {signal} {' and '.join(parts) or 'is larger than stated'}, {amount(size, unit)} (rms) in"
                f" all, {ratio:.2g} times {of}. It does not come back with the crank's angle: it is taken as noise of"
                " that kind, not as a fault of the rig, and the gap counts what is new in each of its samples."
            )

    def quiet(self) -> Explanation:
        """The explanation of data that are nearer to the nominal model than their noise allows: nothing is named."""
        self.notes.append(
            f"Measurement and simulation differ by {rms(self.base.residual):.2g} of the noise only: the noise is"
            " overstated. Nothing is named by what is smaller than that; give a smaller noise, or none, to look closer."
        )
        structured = has_structure(self.data, self.base.residual)
        return Explanation(self.base, self.base, (), "no gap", np.ones(self.data.size), structured)

    def difference(self, fit: Fit) -> np.ndarray | None:
        """Residual (size,) of the analytic model less that of the chosen engine, with the effects of a fit; None where
        the engine fails, or moves in another way altogether.
        """
        found = self.simulated(fit) if fit.named() else None
        if found is None or found.readings is None:
            return None
        simulated, pins = self.data.residual(found.readings), in_contact(fit)
        apart = self.data.residual(self.analytic(fit)) - simulated
        astray = rms(simulated) > FAR * rms(fit.residual) or (pins and rms(simulated) > rms(self.base.residual))
        if astray and rms(apart) > rms(simulated) / FAR:
            self.notes.append(
                f"With these effects {self.simulator} is {rms(simulated):.3g} times the noise off the data, the"
                f" analytic model {rms(fit.residual):.3g}. The two move in different ways"
                f"{', as they do when pins leave their bearings or bounce' if pins else ''}: nothing was fitted"
                f" to {self.simulator}."
            )
            return None
        nominal = self.simulated(self.base).readings
        if nominal is None:
            return apart
        before = self.data.residual(self.analytic(self.base)) - self.data.residual(nominal)
        return lasting(apart, before, [part.place for part in self.data.parts])

    # ---------------------------------------------------------------- simulation in full

    def astray(self, explanation: Explanation) -> Attempt | None:
        """The effect of an explanation with which, beside the nominal mechanism alone, the chosen engine differs most
        from the analytic model, where that is why its gap grows; None where it does not, or nothing else is looked for.
        """
        before, after = self.gaps(explanation)
        if self.options.late() or not before < after < math.inf or self.bounces(explanation, after):
            return None
        apart, worst = max(
            ((self.alone_apart(explanation.fit, n.term), n) for n in explanation.named),
            key=lambda pair: pair[0],
        )
        if not apart > after / FAR or all(t.key == worst.term.key for t in self.sought):
            return None
        why = (
            f"with it alone {self.simulator} is {apart:.3g} times the noise off the analytic model, and with all"
            f" that was found the gap grows: {before:.3g} before, {after:.3g} after"
        )
        return Attempt(worst.term, worst.parameters, worst.share, worst.gap, why)

    def alone_apart(self, fit: Fit, term: Term) -> float:
        """How far the chosen engine is from the analytic model (noise, rms) with one effect of a fit alone, as large as
        it is there; 0 of a sensor's fault, and where either has no answer.
        """
        x = dict(zip(fit.terms, fit.x, strict=True))
        alone = None if term.effect.sensor else self.fitter.at([*self.base.terms, term], x)
        apart = 0.0 if alone is None else self.agreement(self.simulated(alone), alone)
        return apart if math.isfinite(apart) else 0.0

    def gaps(self, explanation: Explanation) -> tuple[float, float]:
        """The gap of the chosen engine before and after an explanation, infinite where it has no answer."""
        said = [self.simulated(self.begin(explanation)), self.simulated(explanation.fit)]
        before, after = (math.inf if (r := s.readings) is None else self.gap(explanation, r) for s in said)
        return before, after

    def begin(self, explanation: Explanation) -> Fit:
        """What an explanation begins with: free runs without a gap are released from where all of the data say."""
        return self.base if explanation.named else explanation.fit

    def bounces(self, explanation: Explanation, after: float) -> bool:
        """Whether it is contact in the chosen engine that makes its gap, not what was named."""
        fit = explanation.fit
        return in_contact(fit) and self.agreement(self.simulated(fit), fit) > after / FAR

    def verified(self, explanation: Explanation) -> Verified:
        """The explanation simulated in full by every engine, beside the nominal mechanism."""
        self.options.progress("simulation", 3, 4)
        explanation = replace(explanation, attempts=(*self.options.astray, *explanation.attempts))
        begin, fit, gaps = self.begin(explanation), explanation.fit, self.gaps(explanation)
        chosen = {"before": self.simulated(begin), "after": self.simulated(fit)}
        if explanation.named and gaps[0] < gaps[1] < math.inf:
            if self.bounces(explanation, gaps[1]):
                bounced = f"its pins bounce or leave their bearings, and its gap would be {gaps[1]:.3g}"
                chosen["after"] = replace(chosen["after"], readings=None, skipped=bounced)
            else:
                explanation, fit, chosen["after"] = self.withdrawn(explanation, *gaps), begin, chosen["before"]
        hypothesis = fit.values(self.rig)
        readings = chosen["after"].readings
        enough = CLOSED if explanation.statistics is None else ALIKE
        closed = readings is not None and self.gap(explanation, readings, self.judged) <= enough
        if explanation.verdict in ("explained", "ambiguous") and not closed:
            explanation = replace(explanation, verdict="partly explained")
        if self.engines[1:]:
            self.options.progress(f"{explanation.verdict} by {self.simulator}, asking the others", 3, 4)
        known = begin.values(self.rig) == self.base.values(self.rig)
        nominal = self.nominal() if known else self.engine_runs.simulate(begin.values(self.rig), self.engines[1:])
        others = nominal if begin is fit else self.engine_runs.simulate(hypothesis, self.engines[1:])
        before = {self.simulator: chosen["before"]} | nominal
        after = {self.simulator: chosen["after"]} | others
        explained = altered(self.measured.mechanism, [h for h in hypothesis if not h[0].effect.sensor])
        agreement = {name: self.agreement(s, explanation.fit) for name, s in after.items()}
        stretches = self.located(begin, before)
        self.options.progress("done", 4, 4)
        return Verified(
            explanation, explained, before, after, agreement, self.agreement(before[self.simulator], begin), stretches
        )

    def gap(
        self, explanation: Explanation, readings: Sequence[Mapping[str, np.ndarray]], data: Data | None = None
    ) -> float:
        """How far readings are from the measured ones: sample by sample over the noise (rms), or where the rig rattles
        in their statistics.
        """
        by = explanation.statistics
        return rms((data or self.data).residual(readings)) if by is None else by.gap(readings)

    def withdrawn(self, explanation: Explanation, before: float, after: float) -> Explanation:
        """An explanation whose effects make the simulated gap larger: nothing is named, and what was tried is told."""
        what = "it" if len(explanation.named) == 1 else "all that was found"
        grows = f"the gap grows with {what}: {before:.3g} before, {after:.3g} after"
        why = f"simulated in full by {self.simulator}, {grows}"
        tried = [Attempt(n.term, n.parameters, n.share, (before, after), why) for n in explanation.named]
        return replace(
            explanation, fit=self.base, named=(), verdict="unexplained", attempts=(*tried, *explanation.attempts)
        )

    def located(self, begin: Fit, before: Mapping[str, Simulated]) -> list[Stretch]:
        """Where the data leave the nominal mechanism by more than the engines differ among themselves."""
        angles = {run.name: self.crank_angle(run) for run in self.measured.runs}
        between = spread(self.measured, {name: s.readings for name, s in before.items() if s.readings is not None})
        self.notes += [
            f"In run {run}, {signal} differs between {pair} by {amount(size, self.measured.signals[signal].unit)} (rms)"
            " on the nominal mechanism; deviations are listed only beyond that."
            for (run, signal), (size, pair) in between.items()
            if size > self.data.noise[run, signal]
        ]
        plain = self.data.coloured({})
        sizes = {key: size for key, (size, _) in between.items()}
        return locate(plain, plain.residual(self.analytic(begin)), angles, sizes, self.data.colours)

    def simulated(self, fit: Fit) -> Simulated:
        """Every run by the chosen engine under a fit's hypothesis; the last few are remembered."""
        hypothesis = fit.values(self.rig)
        for known, said in self.remembered:
            if known == hypothesis:
                return said
        said = self.engine_runs.simulate(hypothesis, (self.simulator,))[self.simulator]
        self.remembered = [*self.remembered[-REMEMBERED:], (hypothesis, said)]
        return said

    def analytic(self, fit: Fit) -> list[dict[str, np.ndarray]]:
        """Readings by the analytic model.  Raises SimulationError where it has none."""
        found = self.model([fit.values(self.rig)])[0]
        if found is None:
            raise SimulationError("the analytic model cannot make these runs")
        return found

    def agreement(self, said: Simulated, fit: Fit) -> float:
        """Largest rms difference of a sensor between an engine and the analytic model, in noise; NaN without
        readings.
        """
        if said.readings is None:
            return math.nan
        predicted = self.data.residual(self.analytic(fit))
        return self.largest_rms(self.data.residual(said.readings) - predicted)

    def largest_rms(self, residual: np.ndarray) -> float:
        """The largest root mean square of a sensor's part of a residual (size,)."""
        return max((rms(residual[p.place]) for p in self.data.parts), default=0.0)

    def crank_angle(self, run: MeasuredRun) -> np.ndarray:
        """The motor's commanded angle (N,) rad, of several the first one's; in a free run the driven body's."""
        if run.drive == "free":
            found = self.model.released(run, [self.base.values(self.rig)])[0]
            assert found is not None
            return found[self.rig.encoder]
        return np.atleast_2d(self.model.motor(run, self.mechanism).at(run.time).theta)[0]


def closes(data: Data, fit: Fit) -> bool:
    """Whether a fit leaves no more than noise."""
    return rms(fit.residual) <= CLOSED and not has_structure(data, fit.residual)


def in_contact(fit: Fit) -> bool:
    """Whether a fit has an effect that engines simulate by contact."""
    return any("contact" in fit.terms[i].effect.needs for i in fit.named())


def begun(model: Model, fitter: Fitter) -> Fit:
    """The nominal mechanism as a fit of the starts of free runs, first to their first part.  Raises MeasuredError where
    it cannot make the runs.
    """
    early = fitter.data.until(BEGINNING)
    starts = prepare.starts(model.measured)
    first = Model(early.measured, fitter.rig, model.mechanism, model.courses)
    begun = Fitter(first, early, fitter.rig, fitter.bounds).fit(list(starts), starts)
    base = begun and fitter.again(begun)
    if base is None:
        raise MeasuredError(
            f"{model.measured.source}: the nominal mechanism cannot make these runs; check drive_angle, start and"
            " assembly"
        )
    return base

"""The problem on which one nominal mechanism is diagnosed: its data, model and engines, and the steps in their order."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from analytic.mechanism import Mechanism
from compare.diagnose import prepare
from compare.diagnose.data.recording import Measured, MeasuredError, Run
from compare.diagnose.data.units import unit_of
from compare.diagnose.effects.effect import Effect, Rig
from compare.diagnose.engines import Engines
from compare.diagnose.explain import CLOSED, Explanation, explain, has_structure, pruned
from compare.diagnose.fit import Data, Fit, Fitter
from compare.diagnose.locate import Stretch, apart, locate, spread
from compare.diagnose.noise import rms
from compare.diagnose.predict import Model, Term, altered
from compare.diagnose.search import Search, costs
from compare.diagnose.sensitivities import candidates, sensitivities
from compare.diagnose.simulate import Simulated
from compare.quantities import amount
from sim_models.engine import ENGINES, SimulationError, SimulatorMissing, engine

EQUIVALENT = 0.1  # of the noise: an engine this near the analytic model is the same
HORIZONS = (0.06, 0.12, 0.25, 0.5)  # shares of free runs that are explained one after the other
SHOWS = 0.2  # of the noise (rms), from which on links that bend are seen
FAR = 2.0  # times the analytic gap: an engine farther off moves otherwise, not a little differently
REFITS = 2  # with the engine's own difference to the analytic model taken along
Progress = Callable[[str, int, int | None], None]


@dataclass(frozen=True)
class Confirmed:
    """An explanation with what the engines say of it, by engine: the chosen one first."""

    explanation: Explanation
    explained: Mechanism
    before: Mapping[str, Simulated]
    after: Mapping[str, Simulated]
    agreement: Mapping[
        str, float
    ]  # largest rms difference of a sensor between an engine and the analytic model, in noise
    agreement_before: float  # the same of the chosen engine on the nominal mechanism
    stretches: Sequence[Stretch]


@dataclass
class Problem:
    """Everything that a diagnosis works on."""

    measured: Measured
    rig: Rig
    mechanism: Mechanism
    model: Model
    data: Data
    fitter: Fitter
    terms: list[Term]
    ruled_out: dict[tuple[str, str], str]
    simulator: str
    engines: tuple[str, ...]
    skipped: dict[str, str]
    progress: Progress
    notes: list[str]
    base: Fit
    engine_runs: Engines
    nominal: Callable[[], dict[str, Simulated]] = dict  # what the other engines say of the nominal mechanism
    search: Search | None = None
    remembered: tuple[list[tuple[Term, dict[str, float]]], Simulated] | None = None

    @classmethod
    def of(
        cls,
        measured: Measured,
        mechanism: Mechanism,
        simulator: str,
        vocabulary: Mapping[str, Effect],
        only: Sequence[str],
        exclude: Sequence[str],
        others: bool,
        workers: int | None,
        progress: Progress,
    ) -> Problem:
        """Prepare: the rig, the noise floor, the nominal model and what each engine says of it."""
        engine(simulator)
        engines: tuple[str, ...] = (simulator,)
        skipped: dict[str, str] = {}
        for name in ENGINES if others else ():
            if name != simulator:
                try:
                    engine(name)
                    engines = (*engines, name)
                except SimulatorMissing as error:
                    skipped[name] = str(error)
        measured = prepare.thinned(measured)
        notes: list[str] = []
        courses, measured = prepare.followed(measured)
        noise = {(run.name, s): c.noise for run in measured.runs for s, c in run.channels.items()}
        rig, model = prepare.nominal(measured, mechanism, courses)
        measured = prepare.unturned(measured, model, prepare.starts(measured))
        model = Model(measured, rig, mechanism, courses)
        data = Data(measured, noise, rig.encoder, prepare.shared(measured, noise, model))
        terms = candidates(rig, vocabulary)
        bounds = prepare.bounds(rig, measured.tolerance)
        allowed = prepare.allowed(terms, measured.tolerance, bounds)
        room = {t.key for t in allowed}
        ruled_out = {t.key: "the tolerance leaves it no room" for t in terms if t.key not in room} | prepare.ruled_out(
            terms, only, exclude
        )
        terms = [t for t in terms if t in allowed or t.key in ruled_out]  # without the variants that are too far
        fitter = Fitter(model, data, rig, bounds)
        starts = prepare.starts(measured)
        early = data.until(HORIZONS[0])
        begun = Fitter(Model(early.measured, rig, mechanism, courses), early, rig, bounds).fit(list(starts), starts)
        base = begun and fitter.at(begun.terms, dict(zip(begun.terms, begun.x, strict=True)))
        if base is None:
            raise MeasuredError(
                f"{measured.source}: the nominal mechanism cannot make these runs; check drive_angle, start and"
                " assembly"
            )
        problem = cls(
            measured, rig, mechanism, model, data, fitter, terms, ruled_out, simulator, engines, skipped,
            progress, notes, base, Engines(model, simulator, workers or min(2, os.cpu_count() or 1)),
        )  # fmt: skip
        _refuse_slips(problem)
        problem.notes += [
            f"Run {run.name} starts from rest and is simulated in steady motion: leave its start-up out of the file, or"
            " it will look like a fault."
            for run in measured.runs
            if run.from_rest
        ]
        if mechanism.clearances or any("contact" in t.effect.needs for t in terms):
            problem.notes += [
                f"In run {run.name}, which is free, joints are taken without clearance."
                for run in measured.runs
                if run.drive == "free"
            ]
        problem.widen(noise)
        problem.nominal = problem.engine_runs.begin(problem.base.values(rig), engines[1:])
        return problem

    def sees(self, bending: Mechanism) -> bool:
        """Whether these data would show the difference that bending links make to the nominal linkage."""
        if self.base.terms:
            return False
        found = Model(self.measured, self.rig, bending, self.model.courses)([[]])[0]
        difference = np.zeros(1) if found is None else self.data.residual(found) - self.base.residual
        return found is not None and max(rms(difference[p.place]) for p in self.data.parts) > SHOWS

    def price(self, explanation: Explanation) -> float:
        """chi^2 that an explanation leaves, and what its effects cost."""
        assert self.search is not None
        return explanation.fit.chi2 + self.search.price(explanation.fit)

    def widen(self, noise: Mapping[tuple[str, str], float]) -> None:
        """Simulate the nominal mechanism and let the noise floor be no lower than what the engine and the analytic
        model differ by.
        """
        chosen = self.simulated(self.base)
        if chosen.readings is None:
            raise SimulationError(
                f"{self.simulator} cannot simulate the nominal mechanism in these runs: {chosen.skipped}"
            )
        analytic = self.analytic(self.base)
        floor = dict(noise)
        for run, said, reckoned in zip(self.measured.runs, chosen.readings, analytic, strict=True):
            for signal in run.channels:
                spread_here = apart(said[signal], reckoned[signal], signal)
                floor[run.name, signal] = math.hypot(noise[run.name, signal], spread_here)
                if spread_here > 0.5 * noise[run.name, signal]:
                    unit = unit_of(signal)
                    self.notes.append(
                        f"In run {run.name}, {signal} differs between {self.simulator} and the analytic model by"
                        f" {amount(spread_here, unit)} (rms), noise {amount(noise[run.name, signal], unit)}; the noise"
                        f" floor is raised to {amount(floor[run.name, signal], unit)}."
                    )
        raised = Data(self.measured, floor, self.rig.encoder)
        self.data = Data(
            self.measured, floor, self.rig.encoder, self.data.shared * (self.data.sigma / raised.sigma)[:, None]
        )
        self.fitter = Fitter(self.model, self.data, self.rig, self.fitter.bounds)
        self.base = self.fitter.at(self.base.terms, dict(zip(self.base.terms, self.base.x, strict=True))) or self.base

    def settled(self) -> Explanation:
        """The explanation; with the chosen engine's own difference to the analytic model taken along, where it
        has one.
        """
        self.progress("search", 1, 4)
        data, fit, shift = self.data, self.found(self.data), np.zeros(self.data.size)
        for _ in range(REFITS):
            said = self.simulated(fit) if fit.named() else None
            if said is None or said.readings is None:
                break
            simulated = self.data.residual(said.readings)
            if rms(simulated) > FAR * rms(fit.residual):
                clearance = any("contact" in fit.terms[i].effect.needs for i in fit.named())
                self.notes.append(
                    f"With these effects {self.simulator} is {rms(simulated):.3g} times the noise off the data, the"
                    f" analytic model {rms(fit.residual):.3g}. It moves otherwise, not a little"
                    f" differently{' (pins that leave their bearings or bounce do that)' if clearance else ''}, so that"
                    " nothing was fitted to it."
                )
                break
            difference = self.data.residual(self.analytic(fit)) - simulated
            change = max((rms((difference - shift)[p.place]) for p in self.data.parts), default=0.0)
            if change < EQUIVALENT:
                break
            self.progress(f"search with {self.simulator}'s difference", 2, 4)
            closed = not shift.any() and rms(fit.residual) <= CLOSED and not has_structure(self.data, fit.residual)
            if not shift.any():
                self.notes.append(
                    f"With these effects {self.simulator} differs from the analytic model by up to {change:.2g} of a"
                    f" sensor's noise (rms); {'they were fitted again' if closed else 'the search was repeated'} with"
                    " that difference taken along."
                )
            shift, data = difference, self.data.shifted(difference)
            # where these effects close the gap already, what else the engine's difference may want is the engine's and
            # not the rig's
            fit = self.found(data, [fit], again=closed)
        assert self.search is not None
        return explain(self.search, fit)

    def found(self, data: Data, first: Sequence[Fit] = (), again: bool = False) -> Fit:
        """The best set of effects in these data, by the analytic model; or the first one ``again``, fitted to these
        data.
        """
        wanted = [t for t in self.terms if t.key not in self.ruled_out]
        cost = costs(wanted, self.rig, data.size)
        free = bool(self.base.terms)
        for share in (
            HORIZONS if free and not first else ()
        ):  # a free motion answers linearly only for a while: learn to walk first
            search = self.prepared(data.until(share), cost, wanted, free)
            first = search.leaders(search.best(first))
        self.search = self.prepared(data, cost, wanted, free)
        if again:
            begun = [self.search.fitter.fit(f.terms, dict(zip(f.terms, f.x, strict=True))) for f in first]
            return pruned(self.search, next((f for f in begun if f is not None), self.search.base))[0]
        return pruned(self.search, self.search.best(first))[0]

    def prepared(self, data: Data, cost: Mapping[Term, float], wanted: Sequence[Term], free: bool) -> Search:
        """A search in these data, with sensitivities about the nominal model or, in free runs, about the fit it begins
        with.
        """
        model = (
            self.model
            if data.measured is self.measured
            else Model(data.measured, self.rig, self.mechanism, self.model.courses)
        )
        fitter = Fitter(model, data, self.rig, self.fitter.bounds)
        start = dict(zip(self.base.terms, self.base.x, strict=True))
        base = fitter.at(self.base.terms, start) or self.base
        if self.search is not None and not free:
            found = dict(
                self.search.sensitivities
            )  # differences of residuals, which a shift of the data does not touch
        else:
            found = {} if free else sensitivities(fitter, base, wanted)
        return Search(fitter, base, found, cost, nonlinear=free)

    # ---------------------------------------------------------------- simulation in full

    def confirmed(self, explanation: Explanation) -> Confirmed:
        """The explanation simulated in full by every engine, beside the nominal mechanism."""
        self.progress("simulation", 3, 4)
        fit = explanation.fit
        hypothesis = fit.values(self.rig)
        begin = (
            self.base if explanation.named else fit
        )  # free runs without a gap are released from where all of the data say
        known = begin.values(self.rig) == self.base.values(self.rig)
        nominal = self.nominal() if known else self.engine_runs.simulate(begin.values(self.rig), self.engines[1:])
        before = {self.simulator: self.simulated(begin)} | nominal
        others = nominal if begin is fit else self.engine_runs.simulate(hypothesis, self.engines[1:])
        after = {self.simulator: self.simulated(fit)} | others
        said = after[self.simulator].readings
        if explanation.verdict in ("explained", "ambiguous") and (
            said is None or rms(self.data.residual(said)) > CLOSED
        ):
            explanation = replace(explanation, verdict="partly explained")
        explained = altered(self.measured.mechanism, [h for h in hypothesis if not h[0].effect.sensor])
        agreement = {name: self.agreement(s, explanation.fit) for name, s in after.items()}
        angles = {run.name: self.crank_angle(run) for run in self.measured.runs}
        between = spread(self.measured, {name: s.readings for name, s in before.items() if s.readings is not None})
        stretches = locate(self.data, begin.residual, angles, {key: size for key, (size, _) in between.items()})
        self.notes += [
            f"In run {run}, {signal} differs between {pair} by {amount(size, unit_of(signal))} (rms) on the nominal"
            " mechanism; deviations are listed only beyond that."
            for (run, signal), (size, pair) in between.items()
            if size > self.data.noise[run, signal]
        ]
        self.progress("done", 4, 4)
        return Confirmed(
            explanation, explained, before, after, agreement, self.agreement(before[self.simulator], begin), stretches
        )

    def simulated(self, fit: Fit) -> Simulated:
        """Every run by the chosen engine under a fit's hypothesis; the last one asked for is remembered."""
        hypothesis = fit.values(self.rig)
        if self.remembered is None or self.remembered[0] != hypothesis:
            self.remembered = hypothesis, self.engine_runs.simulate(hypothesis, (self.simulator,))[self.simulator]
        return self.remembered[1]

    def analytic(self, fit: Fit) -> list[dict[str, np.ndarray]]:
        """Readings by the analytic model."""
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
        reckoned = self.data.residual(self.analytic(fit))
        simulated = self.data.residual(said.readings)
        return max((rms((simulated - reckoned)[p.place]) for p in self.data.parts), default=0.0)

    def crank_angle(self, run: Run) -> np.ndarray:
        """The motor's commanded angle (N,) rad; in a free run the driven body's."""
        if run.drive == "free":
            found = self.model.released(run, [self.base.values(self.rig)])[0]
            assert found is not None
            return found.motion.theta
        return self.model.motor(run, self.mechanism).at(run.time).theta


def _refuse_slips(problem: Problem) -> None:
    """Refuse columns that are plainly another sensor's, or in another unit than they say."""
    from compare.diagnose.data.quality import suspicious_swaps, suspicious_units

    for run, predicted in zip(problem.measured.runs, problem.analytic(problem.base), strict=True):
        slips = [*suspicious_swaps(run, predicted), *suspicious_units(run, predicted)]
        if slips:
            raise MeasuredError(f"{run.file}: {slips[0].text}")

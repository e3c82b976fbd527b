"""How large a hidden effect is: ways in which it grows from nothing, and its signature in sigmas, alone and beside its
best rival.

A signature is the difference that an effect makes to all readings, each over its noise, by the analytic model.  What is
left of it after the best single rival (any other effect, anywhere, physically possible, but for its own richer form)
has been fitted to it, with the other true effects free to move, says whether anyone could name it: ``distinct``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from analytic.beyond_paper.drive import Motor
from compare.diagnose.effects.each_run import repeats
from compare.diagnose.effects.effect import Draw, Effect, Growth, Readings, Rig, Values
from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.diagnose.fit import Fit, Fitter
from compare.diagnose.predict import Model, Motors, Term
from compare.diagnose.residuals import Data
from compare.diagnose.sensitivities import candidates, sensitivities
from tests.evidence.results.scoreboard import TrueEffect
from tests.evidence.scoreboard.rigs import Experiment, Rejected, ideal

SMALLEST, LARGEST = 6.0, 60.0  # sigmas of a signature: a decade, from just above the noise
RIVALS = 8  # fitted in full, at most


@dataclass(frozen=True)
class Planted:
    """A true effect.  ``total`` sigmas of signature, and what the best rival leaves of it: ``linear`` projected out
    without regard to what is physical, ``distinct`` fitted in full.
    """

    name: str
    where: str
    values: Values
    total: float = 0.0
    linear: float = 0.0
    distinct: float = 0.0
    rival: str | None = None

    def sealed(self) -> TrueEffect:
        """The effect as the seal tells it."""
        return TrueEffect(
            name=self.name,
            where=self.where,
            parameters=dict(self.values),
            total=self.total,
            linear=self.linear,
            distinct=self.distinct,
            rival=self.rival,
        )


@dataclass(frozen=True)
class Drawn:
    """An effect at a place, and a random way for it to grow from nothing."""

    term: Term
    growth: Growth


def drawn(effect: Effect, where: str, experiment: Experiment, rig: Rig, rng: np.random.Generator) -> Drawn:
    """A random way for an effect to grow."""
    turn, sign = rng.uniform(0, 2 * math.pi), float(rng.choice([-1, 1]))
    speeds = {plan.name: abs(plan.speed) for plan in experiment.plans}
    growth = effect.growth(
        rig, where, Draw(rng, turn, sign, speeds, lambda: ideal(experiment.nominal, experiment.plans[0]))
    )
    return Drawn(Term(effect, where, growth.variant), growth)


# ---------------------------------------------------------------- in sigmas


class Sizer:
    """Sizes of effects in an experiment."""

    def __init__(self, experiment: Experiment) -> None:
        self.experiment, self.rig = experiment, experiment.rig

    def model(self, truth: Sequence[tuple[Term, Values]]) -> Model:
        """The analytic model of the experiment; a run that follows its encoders follows them with their offsets."""
        courses: dict[str, Motor | Motors] = {}
        for plan in self.experiment.plans:
            readings: Readings = self.experiment.encoded(plan, plan.time)
            for term, values in truth:
                if term.effect.misreads:
                    readings = term.effect.on_readings(readings, plan.name, term.where, values)
            each = tuple(Motor(CubicSpline(plan.time, readings[encoder])) for encoder in self.rig.encoders)
            courses[plan.name] = Motors(each) if self.rig.mechanism.several else each[0]
        return Model(self.experiment.measured(), self.rig, self.experiment.nominal, courses)

    def data(self, truth: Sequence[tuple[Term, Values]]) -> tuple[Model, Data]:
        """The model, and what noiseless sensors would read.  Raises Rejected where the truth is not possible."""
        model = self.model(truth)
        readings = model([truth])[0]
        if readings is None or not all(np.isfinite(v).all() for run in readings for v in run.values()):
            raise Rejected("the truth is not possible everywhere")
        measured = self.experiment.measured(readings)
        noise = {(run.name, s): c.noise for run in measured.runs for s, c in run.channels.items()}
        return model, Data(measured, noise)

    def total(self, truth: Sequence[tuple[Term, Values]], i: int) -> float:
        """Sigmas by which the readings change without the i-th effect."""
        model, data = self.data(truth)
        found = model([[t for k, t in enumerate(truth) if k != i]])[0]
        if found is None:
            raise Rejected("the mechanism is not possible without one of its effects")
        return float(np.linalg.norm(data.residual(found)))

    def grown(self, drawn: Drawn, target: float) -> Values:
        """Values whose signature, alone, is about the target, or as large as is physical.  Raises Rejected where it
        hardly shows.
        """
        term, growth = drawn.term, drawn.growth
        if term.effect.acts_by_itself(term.variant):
            return growth.values(0.0)  # a quarter turn has no size
        amount = min(1e-3 * growth.most, 1.0)
        seen = 0.0
        for _ in range(4):
            seen = self.total([(term, growth.values(amount))], 0)
            if abs(seen / target - 1) < 0.02 or (seen < target and amount == growth.most):
                break
            if seen < 1e-9:
                raise Rejected(f"{term.label} does not show")
            amount = min(max(amount * target / seen, growth.least), growth.most)
        if seen < SMALLEST * 0.9:
            raise Rejected(f"{term.label} hardly shows: {seen:.2g} sigma at most")
        return growth.values(amount)

    def judged(self, truth: Sequence[tuple[Term, Values]]) -> list[Planted]:
        """The true effects with their sizes.  Raises Rejected where one hides behind the others."""
        model, data = self.data(truth)
        fitter = Fitter(model, data, self.rig, self.bounds)
        terms, true = every_rival(self.rig), {t.key for t, _ in truth}
        out = []
        for i, (term, values) in enumerate(truth):
            others = [pair for k, pair in enumerate(truth) if k != i]
            base = self.without(fitter, others)
            rivals = [t for t in terms if t.key not in true and not t.extends(term)]
            linear, rival, distinct = self.rivalled(fitter, base, rivals)
            out.append(
                Planted(
                    term.effect.name,
                    term.where,
                    dict(values),
                    float(np.linalg.norm(base.residual)),
                    linear,
                    distinct,
                    rival,
                )
            )
        return out

    def together(self, truth: Sequence[tuple[Term, Values]]) -> float:
        """Sigmas of all effects together that the best single one leaves: of one that describes them all, few."""
        model, data = self.data(truth)
        fitter = Fitter(model, data, self.rig, self.bounds)
        return self.rivalled(fitter, self.without(fitter, []), every_rival(self.rig))[2]

    def bounds(self, term: Term) -> tuple[np.ndarray, np.ndarray]:
        """Physical bounds of natural coordinates."""
        low = term.effect.lowest(self.rig, term.where, term.variant)
        return low, np.full(low.size, math.inf)

    def without(self, fitter: Fitter, others: Sequence[tuple[Term, Values]]) -> Fit:
        """The other true effects at their true values as a fit; its residual is the signature of the missing one."""
        terms = tuple(t for t, _ in others)
        x = [t.effect.natural(self.rig, t.where, v, t.variant) for t, v in others]
        points = [x]
        scales = [np.asarray(t.effect.scales(self.rig, t.where, t.variant), float) for t in terms]
        for k, scale in enumerate(scales):
            points += [[xi + step if j == k else xi for j, xi in enumerate(x)] for step in np.diag(scale)]
        found = fitter.residuals(terms, points)
        base = found[0]
        if base is None:
            raise Rejected("the mechanism is not possible without one of its effects")
        steps = np.concatenate(scales) if scales else np.zeros(0)
        columns = [np.zeros(base.size) if r is None else (r - base) / h for r, h in zip(found[1:], steps, strict=True)]
        jacobian = np.column_stack(columns) if columns else np.zeros((base.size, 0))
        if columns and left(base, jacobian) < SMALLEST * 0.9:
            raise Rejected("an effect hides behind the others")
        return Fit(terms, tuple(x), base, jacobian, np.zeros(steps.size, bool))

    def rivalled(self, fitter: Fitter, base: Fit, rivals: Sequence[Term]) -> tuple[float, str | None, float]:
        """Sigmas of the base's residual that the best rival leaves, projected; that rival, and what it leaves when
        fitted.
        """
        found = sensitivities(fitter, base, rivals)
        order = []
        for term, sign in found.items():
            columns = np.column_stack([base.jacobian, sign.columns])
            coefficients = solve(columns, base.residual + sign.offset)
            rest = base.residual + sign.offset + columns @ coefficients
            order.append((float(np.linalg.norm(rest)), term.label, term.variant, term, coefficients))
        order.sort(key=lambda o: o[:3])
        best, rival = float(np.linalg.norm(base.residual)), None
        for lowest, label, _, term, coefficients in order[:RIVALS]:
            if lowest >= best:
                break
            k = base.jacobian.shape[1]
            start = dict(zip(base.terms, base.x, strict=True))
            start[term] = found[term].start(self.rig, coefficients[k:])
            fit = fitter.fit([*base.terms, term], start)
            if fit is not None and math.sqrt(fit.chi2) < best:
                best, rival = math.sqrt(fit.chi2), label
        return (order[0][0] if order else best), rival, best


def solve(columns: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """Coefficients (k,) of columns (N, k) that take most of the residual away: residual + columns @ coefficients is
    least.
    """
    norm = np.linalg.norm(columns, axis=0)
    norm[norm == 0] = 1.0
    scaled = columns / norm
    return np.asarray(-np.linalg.solve(scaled.T @ scaled + 1e-10 * np.eye(norm.size), scaled.T @ residual) / norm)


def left(residual: np.ndarray, columns: np.ndarray) -> float:
    """Norm of a residual (N,) after columns (N, k) have taken away what they can."""
    return float(np.linalg.norm(residual + columns @ solve(columns, residual)))


def every_rival(rig: Rig, vocabulary: Mapping[str, Effect] = VOCABULARY) -> list[Term]:
    """Every effect at every place; of the rig's, those of one value."""
    return [t for t in candidates(rig, vocabulary) if not repeats(t.effect, t.variant)]

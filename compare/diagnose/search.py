"""The best sets of effects: screened as a linear problem, fitted in full, and screened again about the best fit."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from compare.diagnose.effects.effect import Rig
from compare.diagnose.effects.sensors import in_each_run
from compare.diagnose.fit import Fit, Fitter
from compare.diagnose.noise import CLOSED, rms, sample_weights
from compare.diagnose.predict import Term
from compare.diagnose.sensitivities import Columns, Screen, Sensitivity, sensitivities

CHANCE = 1e-3  # probability that noise alone names anything at all
MOST = 4  # effects of the rig at once
FAULTS = 16  # of sensors, beside them
FITTED = 9  # sets of each size that are fitted in full
DEEP = 2  # the same, of sets with more than MOST
ROUNDS = 8
# of chi^2: sets that the screen puts farther behind its best are not fitted, unless they are among the first few
MARGIN = 60.0
ANEW = 4.0  # of chi^2, that each value of a fault that is another in each run must bring beside a parameter's share
FIRST = 5
STRAYED = 0.5  # of the noise (rms), by which a linear forecast may miss a fit
LEADERS = 5  # of the best sets of a part of the data are tried on more of it


def a_parameter(samples: int) -> float:
    """Decrease of chi^2 of so many samples that a further parameter must bring."""
    return max(8.0, math.log(max(samples, 2)))


def costs(terms: Sequence[Term], rig: Rig, samples: int) -> dict[Term, float]:
    """Decrease of chi^2 that each term must bring: chance over the whole vocabulary, and a further parameter's share
    each; where each run has its own value, all are further ones, and dearer: they can stand for much.
    """
    places = len({t.key for t in terms}) or 1
    further = a_parameter(samples)
    alternatives = {key: sum(t.key == key for t in terms) for key in {t.key for t in terms}}
    found = {}
    for t in terms:
        n = len(t.effect.scales(rig, t.where, t.variant))
        more = n * (further + ANEW) if in_each_run(t.effect, t.variant) else (n - 1) * further
        found[t] = float(chi2.isf(CHANCE / (places * alternatives[t.key]), 1)) + more
    return found


@dataclass
class Search:
    """Fits sets of effects, best first; ``always`` are terms that every set has (starts of free runs)."""

    fitter: Fitter
    base: Fit
    sensitivities: Mapping[Term, Sensitivity]
    cost: Mapping[Term, float]
    nonlinear: bool = False  # sensitivities hold only near the fit they were taken about (free runs)
    surveyed: Fit | None = None
    columns: Columns | None = None
    screened: tuple[Fit, Mapping[Term, Sensitivity], Screen] | None = None
    judged: tuple[Fit, object] | None = None  # the last fit whose effects were judged, and the judgement
    rivals: bool = False  # whether a fit that leaves no gap is looked beside too, for what explains it as well
    late: Callable[[], bool] = lambda: False  # whether the time for it is over: what is best so far is taken then
    tell: Callable[[int], None] = lambda sets: None  # after so many sets of effects

    @property
    def rig(self) -> Rig:
        """The rig."""
        return self.fitter.rig

    def price(self, fit: Fit) -> float:
        """Decrease of chi^2 that the terms of a fit must bring."""
        return sum(self.cost[fit.terms[i]] for i in fit.named())

    def beats(self, new: Fit | None, old: Fit) -> bool:
        """Whether a fit is better than another, its price taken off; samples are weighted by the residual of the better
        of the two.
        """
        if new is None or new is old:
            return False
        better = new if new.chi2 < old.chi2 else old
        weights = sample_weights(self.fitter.data, better.residual)
        return float(weights @ (old.residual**2 - new.residual**2)) > self.price(new) - self.price(old) + 1e-6

    def best(self, first: Sequence[Fit] = ()) -> Fit:
        """The set of effects, maybe empty, with the smallest sum of chi^2 and price.  ``first`` are fits to other data
        that are tried first.
        """
        best = self.base
        for fit in first:
            begun = self.fitter.fit(fit.terms, dict(zip(fit.terms, fit.x, strict=True)))
            best = begun if begun is not None and self.beats(begun, best) else best
        for _ in range(ROUNDS):
            before = best
            best = self.leapt(self.climb(self.screen(best), best))
            if set(best.terms) == set(before.terms) or self.late():
                break
        return self.fitter.settled(best) if best is not self.base else best

    def leaders(self, best: Fit) -> list[Fit]:
        """The best fits so far, best first."""
        weights = sample_weights(self.fitter.data, best.residual)
        others = sorted(
            (float(weights @ f.residual**2) + self.price(f), k)
            for k, f in enumerate(self.fitter.done())
            if f is not best
        )
        return [best, *(self.fitter.done()[k] for _, k in others[: LEADERS - 1])]

    def climb(self, screen: Screen, best: Fit) -> Fit:
        """Fit the screen's best sets of each size until one more effect does not pay.  About a better fit than the
        screen's own a new one knows better which.
        """
        behind, about = 0, best
        for level in screen.best_sets(MOST, FAULTS, self.cost):
            improved = False
            for k, (net, chosen) in enumerate(level[: FITTED if len(level[0][1]) <= MOST else DEEP]):
                if (self.late() and best is not self.base) or (k >= FIRST and net <= level[0][0] - MARGIN):
                    break
                fit = self.fitted(screen, chosen)
                self.tell(len(self.fitter.done()))
                if fit is not None and self.beats(fit, best):
                    best, improved = fit, True
            behind = 0 if improved or len(level[0][1]) <= len(best.named()) else behind + 1
            if behind == (2 if best is about else 1) or self.late():
                break
        return best

    def leapt(self, best: Fit) -> Fit:
        """The best fit, or one by an effect that leaps, alone: a screen says little of what its impacts do."""
        if best is self.base and rms(self.base.residual) <= CLOSED:
            return best
        screen = self.screen(best)
        for k, term in enumerate(screen.terms):
            if term.effect.leaps and term not in best.terms and not self.late():
                fit = self.fitted(screen, [k])
                best = fit if fit is not None and self.beats(fit, best) else best
        return best

    def fitted(self, screen: Screen, chosen: Sequence[int]) -> Fit | None:
        """A set of the screen, fitted in full."""
        start = self.base_start() | screen.starts(chosen)
        terms = [screen.terms[i] for i in chosen]
        return self.fitter.fit(
            [*self.base.terms, *terms], start, self.base_start() | self.none_of(terms), *self.second_start(start)
        )

    def second_start(self, start: Mapping[Term, np.ndarray]) -> list[dict[Term, np.ndarray]]:
        """Another start for effects whose coordinates do not answer linearly."""
        other = {t: x for t in start if (x := t.effect.other_start(self.rig, t.where, start[t])) is not None}
        return [dict(start) | other] if other else []

    def base_start(self) -> dict[Term, np.ndarray]:
        """Coordinates of what every set has."""
        return dict(zip(self.base.terms, self.base.x, strict=True))

    def screen(self, about: Fit) -> Screen:
        """The linear problem about a fit: its terms by their derivatives there, all others by their sensitivities; the
        last one is kept.
        """
        closed = rms(about.residual) <= CLOSED and not self.rivals
        if about is not self.surveyed and (self.nonlinear or (not closed and self.strayed(about))):
            found = sensitivities(self.fitter, about, list(self.cost))
            own = {about.terms[i]: about.jacobian[:, about.columns(i)] for i in about.named()}
            still = np.zeros(about.residual.size)
            self.sensitivities = found | {t: Sensitivity(t, still, columns, fitted=True) for t, columns in own.items()}
            self.surveyed = about
        if self.screened is not None and self.screened[0] is about and self.screened[1] is self.sensitivities:
            return self.screened[2]
        residual = about.residual.copy()
        named: dict[Term, Sensitivity] = {}
        for i in about.named():
            term, columns = about.terms[i], about.jacobian[:, about.columns(i)]
            residual -= columns @ about.x[i]
            named[term] = Sensitivity(term, np.zeros(residual.size), columns, fitted=True)
        always = [about.jacobian[:, about.columns(i)] for i in range(len(about.terms)) if i not in about.named()]
        if always:
            basis = np.linalg.qr(np.concatenate(always, axis=1))[0]
            residual -= basis @ (basis.T @ residual)
            side = Columns.of(self.rig, {**self.sensitivities, **named}, basis)
        else:
            side = self.side().replaced(self.rig, named)
        screen = Screen(self.rig, residual, side)
        self.screened = about, self.sensitivities, screen
        return screen

    def side(self) -> Columns:
        """The sensitivities side by side, where no set has more than its own terms."""
        if self.columns is None or self.columns.sensitivities is not self.sensitivities:
            self.columns = Columns.of(self.rig, self.sensitivities, np.zeros((self.base.residual.size, 0)))
        return self.columns

    def strayed(self, about: Fit) -> bool:
        """Whether a fit is so far from where the sensitivities were taken that these mislead."""
        since = self.surveyed or self.base
        before = dict(zip(since.terms, since.x, strict=True))
        moved = since.residual.copy()
        for i, (term, x) in enumerate(zip(about.terms, about.x, strict=True)):
            moved += about.jacobian[:, about.columns(i)] @ (x - before.get(term, np.zeros(x.size)))
            if term not in before and term in self.sensitivities:
                moved += self.sensitivities[term].offset
        for i, (term, x) in enumerate(zip(since.terms, since.x, strict=True)):
            if term not in about.terms:
                moved -= since.jacobian[:, since.columns(i)] @ x
        return rms(moved - about.residual) > STRAYED

    def with_terms(self, about: Fit, screen: Screen, terms: Sequence[Term]) -> Fit | None:
        """A set of terms fitted from the screen's optimum, or from the fit it is about for terms that both have."""
        chosen = sorted(screen.terms.index(t) for t in terms)
        start = self.base_start() | (screen.starts(chosen) if chosen else {})
        known = {t: x for t, x in zip(about.terms, about.x, strict=True) if t in start}
        still = start | self.none_of(terms) | known
        return self.fitter.fit([*self.base.terms, *terms], start, start | known, still, *self.second_start(start))

    def none_of(self, terms: Sequence[Term]) -> dict[Term, np.ndarray]:
        """Coordinates at which these effects do nothing."""
        return {t: np.zeros(len(t.effect.scales(self.rig, t.where, t.variant))) for t in terms}


def without(fit: Fit, i: int) -> list[Term]:
    """The effects of a fit but one."""
    return [fit.terms[k] for k in fit.named() if k != i]

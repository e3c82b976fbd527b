"""Proposals: the place whose one unknown tells what is left of the disagreement, and the law that it looks like."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from compare.diagnose.fit import Fit, Fitter
from compare.diagnose.left_out import folds
from compare.diagnose.noise import sample_weights
from compare.diagnose.predict import Model, Term
from compare.diagnose.propose.laws import candidates
from compare.diagnose.propose.places import RELATIVES, Place, Recovered, recovered
from compare.diagnose.propose.regression import MOST_LAWS, Regression, Told
from compare.diagnose.propose.scene import Scene
from compare.results.diagnosis import Unknown

LOOKED = 8  # places whose laws are sought
PLACES_ALIKE = 16.0  # of weighted chi^2: two places that are closer are not told apart
LEAST_SHARE = 0.1  # of what is left of the squared gap beyond the noise: a smaller share is not proposed
FREELY = 2.0  # of chi^2, that each number costs of an unknown without a law (Akaike)
NOISIER = 1.5  # times what an unknown leaves: laws that leave more do not say how noisy the data are
EQUAL = 2.0  # of weighted chi^2: two places that are closer are the same to these data
USUAL: tuple[Unknown, ...] = ("torque", "lag", "length", "give", "error", "bend")  # the usual first
NEARLY = 0.5  # of what the unknown tells: a law that tells less of it is not said


@dataclass(frozen=True)
class Proposal:
    """A place and what was recovered there; ``law`` tells it or the most of it, or has no terms.

    ``share`` is that of the squared gap beyond the noise which the law takes away on data left out, or without a law
    the unknown by itself; ``told`` is how much of the unknown's share the law has; ``cost`` is the weighted chi^2 that
    is left with what the numbers cost; ``weights`` (size,) are those of the samples; ``ties`` are places that do as
    well; ``replaced`` are named effects in whose place it stands.
    """

    scene: Scene = field(repr=False)
    place: Place
    found: Recovered
    law: Told
    regression: Regression = field(repr=False)
    weights: np.ndarray = field(repr=False)
    told: float
    cost: float
    share: float = 0.0
    ties: tuple[Proposal, ...] = ()
    replaced: tuple[Term, ...] = ()

    @property
    def blames_a_sensor(self) -> bool:
        """Whether a sensor is said to err with the motion: the linkage is likelier to do so."""
        return self.place.unknown == "error" and all(c.law.over not in ("reading", "time") for c in self.law.laws)

    @property
    def rank(self) -> int:
        """How unusual such an unknown is, where nothing else tells two apart."""
        return USUAL.index(self.place.unknown)

    @property
    def left(self) -> float:
        """chi^2 that the law leaves, or without one the unknown by itself."""
        return self.law.chi2 if self.law.laws else self.found.chi2

    @property
    def price(self) -> float:
        """What its numbers cost, those of what is named beside it included."""
        return self._numbers(len(self.law.laws) > 0)

    def dear(self, nearest: float) -> float:
        """What is left, over the chi^2 a sample that the nearest leaves, and what its numbers cost: by its law, or with
        an unknown of its own at every sample, whichever is less.
        """
        freely = self.found.chi2 / nearest + self._numbers(False)
        return min(freely, self.law.chi2 / nearest + self._numbers(True)) if self.law.laws else freely

    def _numbers(self, by_law: bool) -> float:
        size, beside = self.regression.residual.size, self.regression.free.shape[1]
        own = sum(len(c.terms) + len(c.shape) for c in self.law.laws) * math.log(size)
        return (own if by_law else FREELY * (size - self.found.free)) + beside * math.log(size)

    def share_of(self, beside: Proposal) -> float:
        """Of what another's scene leaves without an unknown, beyond the noise, what this takes away."""
        nothing = beside.regression.told(())
        if not self.law.laws and self.told:
            return 0.0  # neither a law nor an unknown of its own pays
        if not self.law.laws:
            return 1 - max(self.found.chi2 - self.found.free, 0.0) / max(nothing.chi2 - nothing.left.size, 1e-300)
        before = beside.regression.held_out(nothing, self.weights)
        after = self.regression.held_out(self.law, self.weights)
        return (before - after) / max(before - float(self.weights.sum()), 1e-300)


def proposal(model: Model, fitter: Fitter, fit: Fit) -> Proposal | None:
    """The best place beside a fit, with its law and with the places that do as well; None where nothing is worth it.

    What is named may be what the unknown made look like something else: so the place is sought beside all that is
    named, beside none of it, beside the faults of sensors alone, and without what is named there and of its kind.
    """
    named = tuple(fit.terms[i] for i in fit.named())
    beside = _beside(model, fitter, fit, ())
    if beside is None:
        return None
    kin = RELATIVES[beside.place.unknown]
    inside = tuple(t for t in named if t.where == beside.place.where and t.effect.name in kin)
    rig = tuple(t for t in named if not t.effect.sensor)
    found = [_beside(model, fitter, fit, out) for out in dict.fromkeys([rig, named]) if out and out != inside]
    whole = _beside(model, fitter, fit, inside, MOST_LAWS + len(inside)) if inside else None
    tried = [p for p in (beside, whole, *found) if p is not None]
    nearest = max(min(min(p.left, p.found.chi2) for p in tried) / fitter.data.size, 1.0)
    for best in sorted(tried, key=lambda p: (p.dear(nearest), -len(p.replaced))):
        share = best.share_of(beside)  # little, where a law that tells a part stands in place of what tells more
        if share > LEAST_SHARE:
            return replace(_likelier(best), share=share)
    return None


def simpler(model: Model, fitter: Fitter, fit: Fit) -> Proposal | None:
    """A place and a law that do with fewer numbers what all that is named does together; None where there is none."""
    named = tuple(fit.terms[i] for i in fit.named())
    found = _beside(model, fitter, fit, named)
    if found is None or not found.law.laws:
        return None
    worth = fit.chi2 + fit.jacobian.shape[1] * math.log(fitter.data.size)
    return _likelier(found) if found.price + found.left < worth else None


def _beside(model: Model, fitter: Fitter, fit: Fit, out: tuple[Term, ...], most: int = MOST_LAWS) -> Proposal | None:
    """The best place beside a fit without some of what is named, told by so many laws at most."""
    rest = {t: x for t, x in zip(fit.terms, fit.x, strict=True) if t not in out}
    kept = fitter.at(list(rest), rest) if out else fit
    scene = None if kept is None else Scene.of(model, fitter, kept)
    found = None if scene is None else _best(scene, list(scene.places()), most)
    return None if found is None else replace(found, replaced=out)


def _likelier(found: Proposal) -> Proposal:
    """The same with the likelier place first, where two do as well: rather the linkage than a sensor that errs with its
    motion, rather a crank behind its encoder than one that is bent.
    """
    rivals = [p for p in found.ties if p.cost < found.cost + (PLACES_ALIKE if found.blames_a_sensor else EQUAL)]
    better = [p for p in rivals if p.rank < found.rank and not p.blames_a_sensor]
    if not better:
        return found
    first = min(better, key=lambda p: p.rank)
    rest = (replace(found, ties=()), *(p for p in found.ties if p is not first))
    return replace(first, ties=rest, replaced=found.replaced)


def _best(scene: Scene, where: Sequence[Place], most: int) -> Proposal | None:
    """The best of some places, told by so many laws at most, with those that do as well; None where there is none."""
    data, masks = scene.data, tuple(folds(scene.data))
    seen = ((place, recovered(data, place, scene.residual)) for place in where)
    tried = []
    for place, found in sorted(seen, key=lambda each: each[1].noise)[:LOOKED]:
        regression = Regression(data, scene.whole, scene.state(place), place, scene.free, masks)
        tried.append((place, found, regression, regression.best(candidates(place.unknown, regression.state), most)))
    if not tried:
        return None
    closest = min((law for *_, law in tried), key=lambda law: law.chi2)
    judged = [found.noise for _, found, *_ in tried if found.free > data.size - found.free]
    nearest = max(min([closest.chi2 / data.size, *judged]), 1.0)
    told = closest.chi2 <= NOISIER * nearest * data.size
    weights = sample_weights(data, closest.left) if told else np.full(data.size, 1 / nearest)
    best, *others = sorted((_judged(scene, *each, weights, nearest) for each in tried), key=lambda p: p.cost)
    return replace(best, ties=tuple(p for p in others if p.cost < best.cost + PLACES_ALIKE))


def _judged(
    scene: Scene,
    place: Place,
    found: Recovered,
    regression: Regression,
    law: Told,
    weights: np.ndarray,
    nearest: float,
) -> Proposal:
    """What a place is worth, with its law or with an unknown of its own at every sample, whichever costs less."""
    numbers = regression.residual.size - found.free
    freely, cost = found.chi2 / nearest + FREELY * numbers, regression.cost(law, weights, 2)
    by_law = Proposal(scene, place, found, law, regression, weights, 1.0, cost)
    by_law = replace(by_law, share=by_law.share_of(by_law))
    if freely >= cost or found.free < numbers:
        return by_law
    by_itself = replace(by_law, law=regression.told(()), told=0.0, cost=freely)
    by_itself = replace(by_itself, share=by_itself.share_of(by_itself))
    told = by_law.share / max(by_itself.share, 1e-300)
    return by_itself if told < NEARLY else replace(by_law, told=told, cost=freely)

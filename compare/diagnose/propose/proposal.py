"""Proposals: the place whose one unknown tells what is left of the disagreement, and the law that it looks like."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from compare.diagnose.admission import folds
from compare.diagnose.fit import Fit, Fitter
from compare.diagnose.noise import sample_weights
from compare.diagnose.predict import Model, Term
from compare.diagnose.propose.laws import candidates
from compare.diagnose.propose.places import RELATIVES, Place, Recovered, places, recovered
from compare.diagnose.propose.regression import MOST, Regression, Told
from compare.diagnose.propose.scene import Scene

LOOKED = 8  # places whose laws are sought
TIE = 16.0  # of weighted chi^2: two places that are closer are not told apart
LEAST = 0.1  # of what is left of the squared gap beyond the noise: a smaller share is not proposed
FREELY = 2.0  # of chi^2, that each number costs of an unknown without a law (Akaike)
NOISIER = 1.5  # times what an unknown leaves: laws that leave more do not say how noisy the data are
WORSE = 0.1  # of chi^2, by which a whole law may leave more than what is named and the law beside it
NEARLY = 0.5  # of what the unknown tells: a law that tells less of it is not said


@dataclass(frozen=True)
class Proposal:
    """A place and what was recovered there; ``law`` tells it or the most of it, or has no terms.

    ``share`` is that of the squared gap beyond the noise which the law takes away on data left out, or without a law
    the unknown by itself; ``told`` is how much of the unknown's share the law has; ``cost`` is the weighted chi^2 that
    is left with what the numbers cost; ``weights`` (size,) are those of the samples; ``ties`` are places that do as
    well; ``replaced`` are named effects that are in the law.
    """

    scene: Scene = field(repr=False)
    place: Place
    found: Recovered
    law: Told
    regression: Regression = field(repr=False)
    weights: np.ndarray = field(repr=False)
    share: float
    told: float
    cost: float
    ties: tuple[Proposal, ...] = ()
    replaced: tuple[Term, ...] = ()

    @property
    def blames_a_sensor(self) -> bool:
        """Whether a sensor is said to err with the motion: the linkage is likelier to do so."""
        return self.place.unknown == "error" and all(c.law.over not in ("reading", "time") for c in self.law.laws)


def proposal(model: Model, fitter: Fitter, fit: Fit) -> Proposal | None:
    """The best place beside a fit, with its law and with the places that do as well; None where nothing is worth it."""
    scene = Scene.of(model, fitter, fit)
    if scene is None:
        return None
    found = _best(scene, list(places(scene)))
    if found is None or found.share <= LEAST:
        return None
    rivals = [p for p in found.ties if not p.blames_a_sensor and p.place.unknown != "lag"]
    if found.blames_a_sensor and rivals:
        found = replace(rivals[0], ties=(replace(found, ties=()), *(p for p in found.ties if p is not rivals[0])))
    return _whole(model, fitter, fit, found)


def _whole(model: Model, fitter: Fitter, fit: Fit, found: Proposal) -> Proposal:
    """A proposal with the whole law of its place: what is named there of the same kind is part of it."""
    inside = [t for t in fit.terms if t.where == found.place.where and t.effect.name in RELATIVES[found.place.unknown]]
    if not inside or not found.law.laws:
        return found
    rest = {t: x for t, x in zip(fit.terms, fit.x, strict=True) if t not in inside}
    without = fitter.at(list(rest), rest)
    scene = None if without is None else Scene.of(model, fitter, without)
    same = [] if scene is None else [p for p in places(scene) if p.key == found.place.key]
    whole = _best(scene, same, MOST + len(inside)) if scene is not None else None
    if whole is None or whole.law.chi2 > found.law.chi2 * (1 + WORSE):
        return found
    return replace(whole, share=found.share, ties=found.ties, replaced=tuple(inside))


def _best(scene: Scene, where: Sequence[Place], most: int = MOST) -> Proposal | None:
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
    return replace(best, ties=tuple(p for p in others if p.cost < best.cost + TIE))


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
    nothing, size = regression.told(()), regression.residual.size
    before = regression.held_out(nothing, weights)
    by_law = (before - regression.held_out(law, weights)) / max(before - float(weights.sum()), 1e-300)
    by_itself = 1 - max(found.chi2 - found.free, 0.0) / max(nothing.chi2 - size, 1e-300)
    numbers = size - found.free
    freely = found.chi2 / nearest + FREELY * numbers
    cost = regression.cost(law, weights, 2)
    if freely >= cost or found.free < numbers:
        return Proposal(scene, place, found, law, regression, weights, by_law, 1.0, cost)
    told = by_law / max(by_itself, 1e-300)
    if told < NEARLY:
        return Proposal(scene, place, found, nothing, regression, weights, by_itself, 0.0, freely)
    return Proposal(scene, place, found, law, regression, weights, by_law, told, freely)

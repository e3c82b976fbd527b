"""A proposal as the document has it: its law in letters, its numbers with their intervals, and the curve of it."""

from __future__ import annotations

from collections.abc import Mapping
from string import ascii_lowercase

import numpy as np

from compare.diagnose.propose.laws import Argument, Candidate
from compare.diagnose.propose.parting import would_separate
from compare.diagnose.propose.places import RELATIVES, recovered
from compare.diagnose.propose.proposal import Proposal
from compare.diagnose.propose.regression import Told, solved
from compare.judge.statistics import NORMAL_95
from compare.report.words.proposals import says
from compare.results.diagnosis import Curve, Estimate, Proposed, SamePlace

POINTS = 400  # of a curve
STEP = 1e-4  # of a shape's own step, for its slope
OVER: Mapping[Argument, tuple[str, str]] = {
    "theta": ("crank angle", "rad"),
    "time": ("time", "s"),
    "torque": ("drive torque", "N.m"),
    "angle": ("angle in joint {}", "rad"),
    "rate": ("angular velocity in joint {}", "rad/s"),
    "force": ("reaction at {}", "N"),
    "pull": ("pull in the {}", "N"),
    "carried": ("size of the drive torque, summed over the run", "N.m.s"),
    "reading": ("what the sensor for {} should read", ""),
}
PER = {  # as one writes it
    ("N.m", "rad/s"): "N.m.s/rad",
    ("N.m", "rad2/s2"): "N.m.s2/rad2",
    ("N.m", "rad"): "N.m/rad",
    ("N.m", "rad3"): "N.m/rad3",
    ("N.m", "N"): "m",
    ("m", "N"): "m/N",
    ("rad", "N.m"): "rad/(N.m)",
    ("N.m", "s"): "N.m/s",
    ("m", "s"): "m/s",
    ("rad", "s"): "rad/s",
}


def as_proposed(p: Proposal) -> Proposed:
    """The document's proposal."""
    coefficients, law = _coefficients(p), in_letters(p.law)
    like = RELATIVES[p.place.unknown]
    related = all(t.where == p.place.where and t.effect.name in like for t in p.replaced)
    return Proposed(
        place=p.place.where,
        unknown=p.place.unknown,
        unit=p.place.unit,
        law=law,
        coefficients=coefficients,
        share=p.share,
        says=says(p, law, coefficients, related),
        curve=_curve(p),
        ties=tuple(SamePlace(place=t.place.where, unknown=t.place.unknown, law=in_letters(t.law)) for t in p.ties),
        would_separate=would_separate(p, p.ties[0]) if p.ties else "",
        replaces=tuple(term.label for term in p.replaced),
    )


def in_letters(law: Told) -> str | None:
    """``a sign w + b exp(-(w/c)^2) sign w``; None of a law without terms."""
    letters = iter(ascii_lowercase)
    said = []
    for one in law.laws:
        own = [next(letters) for _ in one.law.terms]
        shapes = [next(letters) for _ in one.shape]
        said += [_product(a, term.format(*shapes)) for a, term in zip(own, one.law.terms, strict=True)]
    return " + ".join(said) or None


def _product(factor: str, term: str) -> str:
    return factor if term == "1" else f"{factor} {term}"


def _coefficients(p: Proposal) -> dict[str, Estimate]:
    """Value and 95 % interval of every number of the law, by letter, in the order of the letters."""
    root = np.sqrt(p.weights)[:, None]
    columns, values, at = [p.regression.free], [], 0
    for one in p.law.laws:
        n = len(one.law.terms)
        own = p.law.coefficients[at : at + n]
        at += n
        columns += [p.regression.columns(one), _slopes(p, one, own)]
        values += [*own.tolist(), *one.shape]
    if not values:
        return {}
    _, covariance = solved(root * np.column_stack(columns), np.zeros(p.weights.size))
    half = NORMAL_95 * np.sqrt(np.diag(covariance))[p.regression.free.shape[1] :]
    return {
        letter: Estimate(value=value, unit=unit, low=value - h, high=value + h)
        for letter, value, unit, h in zip(ascii_lowercase, values, units(p), half.tolist(), strict=False)
    }


def units(p: Proposal) -> list[str]:
    """SI unit of every number of the law, in the order of the letters: of each part its coefficients, then its
    shapes.
    """
    found: list[str] = []
    for one in p.law.laws:
        n = len(one.law.terms)
        found += [_per(p.place.unit, unit, p.place.unit) for unit in one.law.units[:n]]
        found += [p.place.unit if unit == "y" else unit for unit in one.law.units[n:]]
    return found


def _per(unit: str, of: str, reading: str) -> str:
    """The unit of a coefficient."""
    of = reading if of == "y" else of
    return unit if of == "1" else "1" if of == unit else PER.get((unit, of), f"{unit}/({of})")


def _slopes(p: Proposal, one: Candidate, own: np.ndarray) -> np.ndarray:
    """How the residual answers to the shapes of a law, (size, shapes)."""
    steps = STEP * np.array(one.law.steps(p.regression.state)[: len(one.shape)])
    here = p.regression.columns(one) @ own
    found = []
    for k, step in enumerate(steps):
        moved = tuple(x + step * (i == k) for i, x in enumerate(one.shape))
        found.append((p.regression.columns(Candidate(one.law, moved)) @ own - here) / step)
    return np.column_stack(found) if found else np.zeros((here.size, 0))


def _curve(p: Proposal) -> Curve:
    """What was recovered at each sample of a run once, over what the law's largest term is of.

    Beside a law what is named has other values than without one: what is shown is the law, and at each sample what of
    the unknown it leaves; where noise has a colour, what of that is new in the sample.
    """
    state, data = p.regression.state, p.regression.data
    contributions = [(float(np.ptp(part)), one.law.over, part) for one, part in zip(p.law.laws, _parts(p), strict=True)]
    said = sum((part for *_, part in contributions), np.zeros(state.theta.size))
    found = recovered(data, p.place, p.law.left) if contributions else p.found
    rows = []
    for r, (values, sigma) in enumerate(zip(found.values, found.sigma, strict=True)):
        parts = [part for part in data.parts if part.run == r]
        if not parts:
            continue
        longest = max(parts, key=lambda part: part.used.size)
        rows.append((np.arange(longest.place.start, longest.place.stop), values[longest.used], sigma[longest.used]))
    samples, left, sigma = (np.concatenate(column) for column in zip(*rows, strict=True))
    law = said[samples]
    over = max(contributions, key=lambda c: c[0])[1] if contributions else "theta"
    argument = getattr(state, over)[samples]
    order = np.argsort(argument, kind="stable")
    order = order[np.linspace(0, order.size - 1, min(POINTS, order.size)).astype(int)]
    label, unit = OVER[over]
    return Curve(
        over=label.format(p.place.where),
        unit=unit or p.place.unit,
        argument=argument[order],
        recovered=(law + left)[order],
        sigma=sigma[order],
        law=law[order],
    )


def _parts(p: Proposal) -> list[np.ndarray]:
    """What each law of a proposal says at every sample (size,), in the unknown's unit."""
    found, at = [], 0
    for one in p.law.laws:
        n = len(one.law.terms)
        found.append(one.columns(p.regression.state) @ p.law.coefficients[at : at + n])
        at += n
    return found

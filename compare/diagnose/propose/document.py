"""A proposal as the document has it: its law in letters, its numbers with their intervals, and the curve of it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from string import ascii_lowercase

import numpy as np

from compare.diagnose.propose.laws import Argument, Candidate
from compare.diagnose.propose.parting import would_separate
from compare.diagnose.propose.places import RELATIVES, recovered
from compare.diagnose.propose.proposal import Proposal
from compare.diagnose.propose.regression import Told, solved
from compare.quantities import amount
from compare.results.diagnosis import Curve, Parameter, Proposed, SamePlace
from compare.results.sentences import capital, enumerated

POINTS = 400  # of a curve
WHOLE = 0.99  # of an unknown: a law that tells as much tells all of it
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
LETTERS: Mapping[str, str] = {  # of the dictionary's laws, by what a term has in it
    r"\bw\b": "w is the angular velocity in joint {}, of the {second} less the {first}",
    r"\bq\b": "q is the angle in joint {}, of the {second} less the {first}",
    r"\|F\|": "|F| is the reaction at {}",
    r"\bP\b": "P is the pull in the {}",
    r"\bS\b": "S is the size of the drive torque summed over the run, in the sense of its turning",
    r"\bT\b": "T is the drive torque",
    r"\btheta\b": "theta is the crank angle",
    r"\by\b": "y is what the sensor for {} should read",
    r"\bt\b": "t is the time",
    r"\bgap\(": "gap(x, h) is zero as far as h to both sides of x = 0, and as long as x is beyond that",
    r"\bbump\(": "bump(x, s) is exp(-(x/s)^2/2)",
}
SAID = {
    "torque": "a torque acts in joint {} on the {second} (and back on the {first})",
    "give": "the bearing of joint {} gives along its reaction",
    "length": "the length of the {} changes",
    "bend": "the end of the {} lies beside its axis",
    "lag": "the crank is behind its encoder",
    "error": "the sensor for {} has an error",
}


def as_proposed(p: Proposal) -> Proposed:
    """The document's proposal."""
    coefficients = _coefficients(p)
    return Proposed(
        place=p.place.where,
        unknown=p.place.unknown,
        unit=p.place.unit,
        law=in_letters(p.law),
        coefficients=coefficients,
        share=p.share,
        says=_sentence(p, coefficients),
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


def _coefficients(p: Proposal) -> dict[str, Parameter]:
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
    half = 1.96 * np.sqrt(np.diag(covariance))[p.regression.free.shape[1] :]
    return {
        letter: Parameter(value=value, unit=unit, low=value - h, high=value + h)
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


def _sentence(p: Proposal, coefficients: Mapping[str, Parameter]) -> str:
    """``A torque acts in joint E, and it looks like this: ...``."""
    what, law = SAID[p.place.unknown].format(p.place.where, **_bodies(p)), in_letters(p.law)
    if p.place.unit == "N":
        what = what.replace("a torque acts in", "a force acts along")
    named = enumerated([t.effect.called(t.where) for t in p.replaced])
    if law is None:
        return f"{f'In place of {named}: ' if named else ''}{what if named else capital(what)}; no known law tells it."
    numbers = ", ".join(f"{name} = {amount(c.value, c.unit)}" for name, c in coefficients.items())
    names = enumerated(list(dict.fromkeys(one.law.name for one in p.law.laws)))
    most = "" if p.told > WHOLE else f" That tells {100 * p.told:.0f} % of it."
    looks = f"looks like {names}: {law}, with {numbers}{_legend(p, law)}.{most}"
    if named and all(t.where == p.place.where and t.effect.name in RELATIVES[p.place.unknown] for t in p.replaced):
        on = " on the {second} (and back on the {first})".format(**_bodies(p)) if p.place.unknown == "torque" else ""
        return f"More than {named}: what acts there{on} {looks}"
    return f"In place of {named}: {what}, and it {looks}" if named else f"{capital(what)}, and it {looks}"


def _bodies(p: Proposal) -> dict[str, str]:
    """The two bodies of a joint: its torque acts on the ``second``, whose angle and rate count less the ``first``'s."""
    joints = {j.name: j.bodies for j in p.scene.rig.mechanism.joints}
    return dict(zip(("first", "second"), joints.get(p.place.where, ("", "")), strict=True))


def _legend(p: Proposal, law: str) -> str:
    """``; w is the angular velocity in joint E``: what the letters of a law mean."""
    meant = [means.format(p.place.where, **_bodies(p)) for letter, means in LETTERS.items() if re.search(letter, law)]
    return f"; {enumerated(meant)}" if meant else ""


__all__ = ["as_proposed", "in_letters"]

"""Measured data before any diagnosis, in words: what each run is, and what would show in them."""

from __future__ import annotations

import math

import numpy as np

from analytic.mechanism.one_line import count
from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.quantities import amount, number, quantities, shown
from compare.results.plan import Plan
from compare.results.preview import Preview, RunPreview, Visible

RIVALS_LISTED = 4  # effects that look alike, by name; the others are counted
DRIVES = {
    "speed": "at a commanded speed",
    "measured": "follows its encoder",
    "free": "let go",
    "torque": "moved by what its motor gives",
}


def spoken(result: Preview | Plan, signal: str) -> str:
    """A signal as one says it."""
    what = quantities(result.mechanism).get(signal)
    return signal if what is None else what.label


def called(result: Preview | Plan, name: str, where: str) -> str:
    """An effect at its place."""
    effect = VOCABULARY[name]
    return effect.called(spoken(result, where) if effect.place == "signal" else where)


def facts(result: Preview, run: RunPreview) -> str:
    """A run in a sentence: samples, rate, span, gaps."""
    if result.mechanism.sliding:
        unit, factor = shown("m")
        span = f"the slide goes from {number(factor * run.crank_from, 4)} to {number(factor * run.crank_to, 4)} {unit}"
    elif not result.mechanism.cranked:
        span = ", ".join(
            f"{spoken(result, e)} {reach(run.signals[e].measured, shown(run.signals[e].unit)[1])}"
            f" {shown(run.signals[e].unit)[0]}"
            for e in encoders(result)
            if e in run.signals
        )
    else:
        turned = math.degrees(run.crank_to - run.crank_from)
        span = (
            f"the crank goes from {number(math.degrees(run.crank_from), 4)} to {number(math.degrees(run.crank_to), 4)}°"
            f" ({count(number(turned / 360, 3), 'turn')})"
        )
    longest = f", the longest gap {amount(run.longest_gap, 's')}" if run.longest_gap else ", no gaps"
    role = ", kept back for validation" if run.role == "validation" else ""
    return f"{run.file}: {count(run.samples, 'sample')}, one every {amount(run.step, 's')}{longest}; {span}{role}."


def visible(result: Preview, one: Visible) -> tuple[str, str, str]:
    """An effect, the size from which it shows, and what looks like it."""
    if one.size is None:
        size = "a size that the model does not tell"
    else:
        size = f"{one.parameter.replace('_', ' ')} {'up to' if one.at_most else 'from'} {amount(one.size, one.unit)}"
        size += "" if one.at_most else " on"
    names = [called(result, each.name, each.where) for each in one.like[:RIVALS_LISTED]]
    more = len(one.like) - RIVALS_LISTED
    like = ", ".join(names) + (f" and {more} more" if more > 0 else "")
    return called(result, one.name, one.where), size, like or "nothing else"


def encoders(result: Preview) -> list[str]:
    """Names of the signals that say where the linkage is."""
    return [encoder.name for encoder in result.mechanism.encoders]


def reach(values: np.ndarray, factor: float) -> str:
    """From the least to the largest of some values (N,), times a factor."""
    here = values[np.isfinite(values)] * factor
    return f"{number(here.min(), 4)} to {number(here.max(), 4)}" if here.size else "absent"


def tally(result: Preview) -> str:
    """How much would show in the runs."""
    alike = sum(bool(one.like) for one in result.visible)
    return (
        f"{count(len(result.visible), 'effect')} would show in these runs, {alike} of them not apart from another;"
        f" {len(result.invisible)} would not show at all: the page lists them"
    )

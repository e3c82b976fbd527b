"""A hidden set, shown: what is hidden in it, and what a diagnosis said of it."""

from __future__ import annotations

import html
from collections.abc import Iterator
from typing import TYPE_CHECKING

from rich.console import Console

from tests.evidence.results.scoreboard import HiddenSet, Scored, Truth

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def files(result: Truth | HiddenSet) -> dict[str, str]:
    """Nothing beside the JSON file."""
    return {}


def print_table(result: Truth | HiddenSet, console: Console) -> None:
    """Print what is hidden, and beneath it what was said."""
    for line in lines(result):
        console.print(line, soft_wrap=True, highlight=False)


def summary_html(result: Truth | HiddenSet) -> str:
    """The same as a table of one column."""
    rows = "".join(f"<tr><td>{html.escape(line)}</td></tr>" for line in lines(result))
    return f"<table>{rows}</table>"


def plot(result: Truth | HiddenSet, figure: Figure) -> None:
    """One set has no picture.  Raises TypeError."""
    raise TypeError(f"{type(result).__name__} is a list of effects and has no picture; print it")


def lines(result: Truth | HiddenSet) -> Iterator[str]:
    """What is hidden and, where there is a diagnosis, what it said."""
    truth = result if isinstance(result, Truth) else result.truth
    yield f"seed {truth.seed}: {truth.case}, recorded by {truth.source.name}, diagnosed by {truth.simulator}"
    yield from _hidden(truth)
    if isinstance(result, HiddenSet):
        yield from _said(result.scored)


def _hidden(truth: Truth) -> Iterator[str]:
    for e in truth.effects:
        values = ", ".join(f"{name} {value:.6g}" for name, value in e.parameters.items())
        beside = f"{e.distinct:.3g} beside {e.rival}" if e.rival else "no rival"
        yield f"hidden: {e.key}: {values} ({e.total:.3g} sigma, {beside})"
    if truth.slight:
        keys = ", ".join(f.key for f in truth.slight)
        yield f"slightly off, together {truth.together:.3g} sigma: {keys}"
    for f in truth.faults:
        values = ", ".join(f"{name} {value:.6g}" for name, value in f.parameters.items())
        yield f"sensors: {f.key}{f': {values}' if values else ''}"
    if truth.free:
        yield f"its pin is off the wall for {100 * truth.free:.3g} % of the time"
    other = truth.outside
    if other is not None:
        size = f"{other.size:.6g} {other.unit} ({other.left:.3g} sigma)"
        yield f"hidden: {other.kind}@{other.where}, outside the vocabulary: {size}"
        if other.excluded:
            yield f"diagnosed without {', '.join(other.excluded)}"
    elif not truth.effects:
        yield "hidden: nothing beside that" if truth.slight or truth.faults else "hidden: nothing"


def _said(scored: Scored) -> Iterator[str]:
    for effect in scored.named:
        ties = f" (or {', '.join(effect.ambiguous_with)})" if effect.ambiguous_with else ""
        small = f" (or together {', '.join(effect.small_errors)})" if effect.small_errors else ""
        yield f"named: {effect.effect}{ties}{small}"
    for p in scored.parameters:
        yield f"    {p.parameter}: {p.found:.6g}, true {p.true:.6g}{'' if p.covered else ', outside the 95 % interval'}"
    if scored.proposed:
        yield f"proposed: {' or '.join(scored.proposed)}"
    if scored.right_place is not None:
        yield f"the right place is {'' if scored.right_place else 'not '}proposed"
    if scored.false_rig:
        yield f"not in the set: {', '.join(scored.false_rig)}"
    yield f"{'good' if scored.good else 'not good'}: {scored.outcome}; {scored.why or scored.verdict}"

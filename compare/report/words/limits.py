"""What a linkage makes of the limits that were set to its numbers, in words."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Protocol

from analytic.mechanism.one_line import count
from compare.quantities import plain, shown
from compare.report.peaks import Of, over, place
from compare.results.analysis import Analysis, Limit

DIGITS = 5


class Limited(Of, Protocol):
    """What may have limits."""

    @property
    def limits(self) -> Mapping[str, Limit]: ...


def facts(result: Limited) -> dict[str, str]:
    """Each limit as a page says it."""
    return {
        f"Limit of {name}": f"{limit.verdict}: {said.removeprefix(f'{name} is ')}"
        for name, limit, said in limits(result)
    }


def limits(result: Limited) -> list[tuple[str, Limit, str]]:
    """Each limit by its name, with what there is to say of it in a sentence; those that hold at the end."""
    ordered = sorted(result.limits.items(), key=lambda item: item[1].verdict == "holds")
    x = over(result)
    at = {name: "" if each.at is None else f"{plain(place(result, each.at), 4)} {x.unit}" for name, each in ordered}
    of = count(len(x.values), "sample")
    alone = f", at {of} alone" if isinstance(result, Analysis) and not result.extremes else ""
    return [(name, limit, sentence(name, limit, at[name], of) + alone) for name, limit in ordered]


def sentence(name: str, limit: Limit, at: str, of: str = "") -> str:
    """What there is to say of a limit, whose value is ``at`` a place, ``of`` so many samples."""
    return f"{name} {_said(limit, f' at {at}' * bool(at), of)}"


def _said(limit: Limit, at: str, of: str) -> str:
    unit, factor = shown(limit.unit)
    unit = f" {unit.replace('·', '.')}" * bool(unit)
    of_size = limit.largest is not None and limit.least == -limit.largest
    end = abs(limit.bound) if of_size else limit.bound
    bound = f"its limit of {plain(factor * end, DIGITS)}{unit}"
    if limit.over is not None:
        low, high = (plain(math.degrees(end), 4) for end in limit.over)
        at = f" between {low} and {high} deg"
    ideal = " without clearance" * limit.without_clearance
    value = "" if limit.value is None else f"is {plain(factor * limit.value, DIGITS)}{unit}{ideal}{at}, "
    if limit.verdict == "unknown":
        missing = f"at {limit.missing} of {of}" if of else f"at {count(limit.missing, 'sample')}"
        where = missing if limit.missing else "between samples"
        return f"{value}{'and ' if value else ''}has no answer {where}: {bound} is not known to hold"
    if limit.verdict == "holds" and not (limit.least is None or limit.largest is None or of_size):
        return f"{value}within {plain(factor * limit.least, DIGITS)} to {plain(factor * limit.largest, DIGITS)}{unit}"
    if limit.verdict == "holds":
        return f"{value}{'no less than' if limit.largest is None else 'within'} {bound}"
    return f"{value}{'more' if of_size or (limit.value or 0.0) > limit.bound else 'less'} than {bound}"

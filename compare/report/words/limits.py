"""What a linkage makes of the limits that were set to its numbers, in words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from analytic.mechanism.one_line import count
from compare.quantities import plain, shown
from compare.report.peaks import Of, over, place
from compare.results.analysis import Limit

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
    return [(name, limit, f"{name} {_said(result, limit)}") for name, limit in ordered]


def _said(result: Limited, limit: Limit) -> str:
    unit, factor = shown(limit.unit)
    unit = unit.replace("·", ".")
    of_size = limit.largest is not None and limit.least == -limit.largest
    end = abs(limit.bound) if of_size else limit.bound
    bound = f"its limit of {plain(factor * end, DIGITS)} {unit}"
    at = "" if limit.at is None else f" at {plain(place(result, limit.at), 4)} {over(result).unit}"
    value = "" if limit.value is None else f"is {plain(factor * limit.value, DIGITS)} {unit}{at}, "
    if limit.verdict == "unknown":
        missing = f"{limit.missing} of {count(len(over(result).values), 'sample')}"
        return f"{value}{'and ' if value else ''}has no answer at {missing}: {bound} is not known to hold"
    if limit.verdict == "holds" and not (limit.least is None or limit.largest is None or of_size):
        return f"{value}within {plain(factor * limit.least, DIGITS)} to {plain(factor * limit.largest, DIGITS)} {unit}"
    if limit.verdict == "holds":
        return f"{value}within {bound}"
    return f"{value}{'more' if of_size or (limit.value or 0.0) > limit.bound else 'less'} than {bound}"

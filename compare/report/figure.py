"""A figure of a report as data; :mod:`compare.report.svg` draws it for a file, ``chart.js`` for the page."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from compare.quantities import number

Numbers = tuple[float | None, ...]
ALL = -1  # the level of a series that is in each panel
Mark = Literal["line", "dashed", "marker", "band", "link", "joint", "pivot"]


@dataclass(frozen=True)
class Axis:
    """What is along an axis, in which unit."""

    label: str
    unit: str

    @property
    def title(self) -> str:
        """Label and unit as an axis prints them."""
        return f"{self.label} ({self.unit})" if self.unit else self.label


@dataclass(frozen=True)
class Series:
    """Points in the axes' units, None where there is none.  ``role`` picks the colour, ``mark`` how it is drawn: a
    ``band`` goes along its upper edge and back along its lower one.

    ``level`` tells several simulators of one joint model apart.  A series that does not ``scale`` has no say in the
    range of the axes; one without a ``name`` is not in the legend.
    """

    name: str
    x: Numbers
    y: Numbers
    role: str
    mark: Mark = "line"
    level: int = 0
    labels: tuple[str, ...] = ()
    scale: bool = True


@dataclass(frozen=True)
class Figure:
    """One figure: ``name`` is its file's stem, ``summary`` its text alternative, a ``plane`` has equal scales in x and
    y.  With ``panels`` (their titles) it is small multiples at one scale: the series of level k are in panel k, those
    of ALL in each.
    """

    name: str
    title: str
    summary: str
    x: Axis
    y: Axis
    series: tuple[Series, ...]
    kind: Literal["curves", "plane"] = "curves"
    note: str = ""
    panels: tuple[str, ...] = ()

    def panel(self, k: int) -> list[Series]:
        """What is drawn in a panel."""
        return [replace(s, level=0) for s in self.series if s.level in (k, ALL)]

    @property
    def roles(self) -> list[Series]:
        """One series of each colour of the panels, named by what the colour means in all of them."""
        return list(
            {
                s.role: replace(s, level=0, name=s.name if s.level == ALL else s.role) for s in self.series if s.name
            }.values()
        )


def scaled(values: Iterable[float | None] | np.ndarray, factor: float = 1.0, digits: int = 7) -> Numbers:
    """Values in a reader's unit, to the digits that a figure can show; None where there is no number."""
    return tuple(None if v is None or not math.isfinite(v) else float(f"{factor * v:.{digits}g}") for v in values)


def extreme(values: Numbers) -> str:
    """The largest size of some values, as a summary says it."""
    return number(max((abs(v) for v in values if v is not None), default=None))

"""The linkage in motion as every page has it: what ``mover.js`` plays, and what its section is filled with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from markupsafe import Markup

from analytic.mechanism import Mechanism
from compare.report.figure import Numbers, scaled
from compare.report.linkage import PRINTED_ANGLE, Poses, parts
from compare.report.summary import Abscissa


@dataclass(frozen=True)
class Side:
    """One configuration that is drawn: which box shows it, its name in the legend, its colour and its poses."""

    which: str
    name: str
    role: str
    poses: Poses | None


@dataclass(frozen=True)
class Column:
    """A column of the values at a position: its head, what is said before its value, and to how many digits."""

    head: str
    says: str
    digits: int


@dataclass(frozen=True)
class Read:
    """What is read at each sample: a number in each column, in a unit."""

    label: str
    unit: str
    values: Sequence[Numbers]


@dataclass(frozen=True)
class Moving:
    """A run as ``mover.js`` moves through it: poses (m, rad), reactions and loads (N) by joint, displacements (mm) of
    the pins that have clearance (m) by joint and side.
    """

    over: Abscissa
    opens: int
    factor: int
    clearance: Mapping[str, float]
    flags: Mapping[str, str]
    ideal: Poses | None
    sides: Sequence[Side]
    columns: Sequence[Column]
    readout: Sequence[Read]
    gaps: Mapping[str, Sequence[Sequence[Numbers]]]
    forces: Mapping[str, Mapping[str, object]] = field(default_factory=dict)
    loads: Sequence[Mapping[str, object]] = ()
    largest: float = 1.0

    def data(self) -> dict[str, object]:
        """The same as the page's script reads it."""
        of_parts = {name: [vars(one) for one in getattr(self, name)] for name in ("sides", "columns", "readout")}
        over = self.over
        x = {"label": over.label, "unit": over.unit, "x": scaled(over.values), "round": over.around}
        return {name: value for name, value in vars(self).items() if name != "over"} | of_parts | x


@dataclass(frozen=True)
class Mover:
    """What the section of a page is filled with: runs by title, the one that is shown first, the boxes that show and
    hide (label by name), a note, and the drawing for who runs no script.
    """

    mechanism: Mechanism
    runs: Mapping[str, Moving]
    boxes: Mapping[str, str]
    still: Markup
    note: str = ""
    first: int = 0

    @property
    def titles(self) -> list[str]:
        """Of the runs."""
        return list(self.runs)

    @property
    def loose(self) -> bool:
        """Whether any run has gaps that can be drawn larger."""
        return any(run.clearance for run in self.runs.values())

    @property
    def reads(self) -> bool:
        """Whether any run has numbers beside the drawing."""
        return any(run.readout for run in self.runs.values())

    @property
    def heads(self) -> list[str]:
        """Of the columns of values."""
        return [column.head for column in next(iter(self.runs.values())).columns]

    def data(self) -> dict[str, object]:
        """What the page's script reads."""
        return {"parts": parts(self.mechanism), "runs": [run.data() for run in self.runs.values()]}


def opens(over: Abscissa) -> int:
    """The sample at which a page opens."""
    return 0 if over.of_time else int(np.argmin(np.abs(np.radians(over.values) - PRINTED_ANGLE)))


def gap(signals: Mapping[str, np.ndarray], joint: str) -> list[Numbers]:
    """Displacement (mm) of a journal in its bearing, x and y."""
    return [scaled(signals[f"clearance_{joint}_{axis}"], 1e3) for axis in "xy"]

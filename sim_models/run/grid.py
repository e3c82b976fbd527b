"""Equal steps of a run, and the reports between them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from sim_models.common.start import substeps

ON_GRID = 1e-6  # of a step: a report no farther from one is at it


@dataclass(frozen=True)
class StepGrid:
    """Equal steps from ``begin`` (s), and how reports between them follow from those around: a cubic through four.

    A step that changes spoils what an engine, which closes loops by the drift of the step before, makes of
    accelerations.
    """

    begin: float  # s
    step: float  # s
    nodes: np.ndarray  # (N, 4) steps whose beginnings a report is made of
    weights: np.ndarray  # (N, 4)
    lead: int = 0  # steps before the first report
    beyond: int = 0  # steps after the last that a report needs

    @classmethod
    def of(cls, times: np.ndarray, begin: float, step: float) -> StepGrid:
        """Steps of a size (s) from ``begin`` (s) through reports at times (N,) s, none of them before."""
        place = (times - begin) / step
        close = np.abs(place - np.rint(place)) < ON_GRID
        place = np.where(close, np.rint(place), place)
        nodes = np.maximum(np.floor(place).astype(int) - 1, 0)[:, None] + np.arange(4)
        nodes = np.where(close[:, None], np.rint(place).astype(int)[:, None], nodes)
        return cls(begin, step, nodes, np.where(close[:, None], np.eye(4)[0], _lagrange(place - nodes[:, 0])))

    @classmethod
    def fitted(cls, times: np.ndarray, begin: float, longest: float, early: bool, beyond: float = 0.0) -> StepGrid:
        """Steps no longer than ``longest`` (s) for reports at times (N,) s, none before ``begin`` (s), that go on
        ``beyond`` them (s).

        Steps that may begin up to one of them ``early`` have one at the first report, and at all that are equally far
        apart.
        """
        stops = np.unique(times)
        _, step = substeps(float(np.median(np.diff(stops))) if stops.size > 1 else longest, longest)
        lead = max(0, int(np.ceil((stops[0] - begin) / step - ON_GRID)))
        grid = cls.of(times, float(stops[0]) - lead * step if early else begin, step)
        return replace(grid, lead=lead, beyond=int(np.ceil(beyond / step - ON_GRID)))

    @cached_property
    def reported(self) -> int:
        """The last step that a report needs."""
        return int(self.nodes.max())

    @property
    def last(self) -> int:
        """The last step."""
        return self.reported + self.beyond

    @cached_property
    def wanted(self) -> list[int]:
        """The steps that reports need, in order."""
        return [int(k) for k in np.unique(self.nodes)]

    def columns(self, rows: Mapping[int, Mapping[str, float]]) -> dict[str, np.ndarray]:
        """Signals (N,) at the reports, from those at the steps."""
        names = list(rows[int(self.nodes[0, 0])])
        table = np.array([[rows[k][name] for name in names] for k in self.wanted])
        around = table[np.searchsorted(self.wanted, self.nodes)]
        return dict(zip(names, np.einsum("nk,nkc->cn", self.weights, around), strict=True))


def _lagrange(x: np.ndarray) -> np.ndarray:
    """(N, 4) weights of values at 0, 1, 2 and 3 in the cubic through them, at x (N,)."""
    return np.column_stack(
        [
            (1 - x) * (2 - x) * (3 - x) / 6,
            x * (2 - x) * (3 - x) / 2,
            x * (x - 1) * (3 - x) / 2,
            x * (x - 1) * (x - 2) / 6,
        ]
    )

"""prediction.json: runs that were not measured, as the explained model of a diagnosis foretells them, with 95 %."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field, FiniteFloat

from analytic.mechanism.one_line import count
from compare.results.band import Band, Context
from compare.results.diagnosis import DiagnosisVerdict
from compare.results.document import Document, Grid, Mechanism, Number, Part, Row, Text, rows_of


class PredictedRun(Part):
    """A run (N samples)."""

    name: Text
    speed: Annotated[Number, Field(description="rad/s, as commanded; null where the run follows a course, or is free.")]
    time: Annotated[Grid, Field(min_length=1, description="s")]
    crank_angle: Annotated[Grid, Field(min_length=1, description="rad; the motor's, of several the first one's.")]
    signals: Annotated[Mapping[str, Band], Field(min_length=1)]


class Prediction(Document):
    """What the explained model of a diagnosis says of runs that were not measured.  SI units and radians."""

    file: ClassVar[str] = "prediction.json"
    remedy: ClassVar[str] = "give the prediction.json of compare predict"

    case: Annotated[str, Field(description="Name of the mechanism.")]
    command: str = ""
    versions: Mapping[str, str]
    diagnosis: Annotated[DiagnosisVerdict, Field(description="The verdict that the model comes from.")]
    effects: Annotated[tuple[str, ...], Field(description="What the model has been given, name@where.")]
    speeds: Annotated[tuple[FiniteFloat, ...], Field(description="Of the runs that it was fitted to (rad/s).")]
    runs: Annotated[tuple[PredictedRun, ...], Field(min_length=1)]
    context: Annotated[Context | None, Field(description="What it is wanted for, and whether it is enough.")] = None
    explained: Mechanism
    notes: Annotated[tuple[str, ...], Field(description="What was assumed, and where the data say little.")]

    def rows(self) -> list[Row]:
        """A row for each sample of each run: each signal's middle and band."""
        rows: list[Row] = []
        for run in self.runs:
            columns: dict[str, np.ndarray] = {"time": run.time, "crank_angle": run.crank_angle}
            for name, band in run.signals.items():
                columns |= {name: band.value, f"{name}_low": band.low, f"{name}_high": band.high}
            rows += rows_of(columns, run=run.name)
        return rows

    def units(self) -> Mapping[str, str]:
        """SI unit of each column."""
        found = {"time": "s", "crank_angle": "rad"}
        for run in self.runs:
            for name, band in run.signals.items():
                found |= dict.fromkeys((name, f"{name}_low", f"{name}_high"), band.unit)
        return found

    @property
    def drawable(self) -> Collection[str]:
        """The signals of the first run, which :meth:`plot` draws by name."""
        return self.runs[0].signals.keys()

    def __repr__(self) -> str:
        return f"Prediction({self.case}: {count(len(self.runs), 'run')}, {', '.join(self.runs[0].signals)})"

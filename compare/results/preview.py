"""data.json: measured data as they are, before any diagnosis."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from analytic.mechanism.one_line import count
from compare.results.diagnosis import EffectPlace, RecordingFault
from compare.results.document import Amount, Document, Grid, Mechanism, Number, Part, Row, Series, Text, rows_of


class SensorPreview(Part):
    """One sensor in one run."""

    unit: str
    noise: Annotated[float, Field(gt=0, description="One sigma, in the unit.")]
    noise_given: Annotated[bool, Field(description="Whether measured.toml gave it; else it is estimated.")]
    samples: Annotated[int, Field(ge=0, description="That there are, faulty ones left out.")]
    gap: Annotated[Amount, Field(description="Root mean square of measured minus nominal, over the noise.")]
    measured: Series
    nominal: Annotated[Series, Field(description="What the nominal analytic model says, at the same samples.")]


class RunPreview(Part):
    """One run: how it was driven, how it was sampled, what of the crank's turn it covers."""

    name: Text
    file: Text
    drive: Literal["speed", "measured", "free", "torque"]
    role: Literal["fit", "validation"]
    samples: Annotated[int, Field(ge=0)]
    step: Annotated[float, Field(gt=0, description="Median time (s) between samples.")]
    longest_gap: Annotated[float, Field(ge=0, description="s; 0 where there is none.")]
    crank_from: Annotated[float, Field(description="rad; of a slide m; of several drives the first one's position")]
    crank_to: Annotated[float, Field(description="rad")]
    time: Annotated[Grid, Field(description="s")]
    crank_angle: Annotated[Series, Field(description="rad, of the nominal model")]
    signals: Mapping[str, SensorPreview]


class Visible(Part):
    """An effect that these runs would show if it were there."""

    name: Text
    where: Text
    parameter: Text
    unit: str
    size: Annotated[Number, Field(description="The smallest that four sigmas of all samples together would show.")]
    at_most: Annotated[bool, Field(description="Whether what is smaller than the size shows, as with a stiffness.")]
    like: Annotated[
        tuple[EffectPlace, ...], Field(description="Effects that would look the same in these runs, or nearly so.")
    ]


class Preview(Document):
    """Measured data with the nominal model behind them, and what they could tell.  SI units and radians."""

    file: ClassVar[str] = "data.json"
    remedy: ClassVar[str] = "give the data.json of compare diagnose --check"
    opens: ClassVar[str] = "data.html"
    opened: ClassVar[str] = "page"

    case: Annotated[str, Field(description="Name of the mechanism.")]
    command: str = ""
    mechanism: Mechanism
    runs: tuple[RunPreview, ...]
    faults: Annotated[tuple[RecordingFault, ...], Field(description="What was wrong with the data and was handled.")]
    visible: tuple[Visible, ...]
    invisible: Annotated[
        tuple[EffectPlace, ...], Field(description="Effects that no sample would show, however large they are.")
    ]

    def rows(self) -> list[Row]:
        """A row for each sample of each run: every sensor beside what the nominal model says."""
        rows: list[Row] = []
        for run in self.runs:
            columns = {"time": run.time, "crank_angle": run.crank_angle}
            for name, sensor in run.signals.items():
                columns |= {f"measured_{name}": sensor.measured, f"nominal_{name}": sensor.nominal}
            rows += rows_of(columns, run=run.name)
        return rows

    def units(self) -> Mapping[str, str]:
        """SI unit of each column."""
        units = {name: sensor.unit for run in self.runs for name, sensor in run.signals.items()}
        sides = {f"{side}_{name}": unit for name, unit in units.items() for side in ("measured", "nominal")}
        return {"time": "s", "crank_angle": self.mechanism.encoders[0].unit} | sides

    def __repr__(self) -> str:
        samples = count(sum(run.samples for run in self.runs), "sample")
        return f"Preview({self.case}: {count(len(self.runs), 'run')}, {samples}, {count(len(self.faults), 'fault')})"

"""residuals.json: what a diagnosis leaves of one signal, by run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar

from pydantic import Field, FiniteFloat

from analytic.mechanism.one_line import count
from compare.results.crosscheck import Simulator
from compare.results.diagnosis import DiagnosisVerdict, Unit
from compare.results.document import Amount, Document, Grid, Number, Part, Row, Series, Text, rows_of


class Residual(Part):
    """Measured minus simulated (N); angles modulo a turn."""

    rms: Annotated[Amount, Field(description="Root mean square, SI; null where nothing was measured.")]
    largest: Annotated[Number, Field(description="With its sign, SI.")]
    crank_angle: Annotated[Number, Field(description="Where it is the largest (rad).")]
    time: Annotated[Number, Field(description="When it is the largest (s).")]
    gap: Annotated[Amount, Field(description="Root mean square over noise, as the diagnosis has it.")]
    values: Annotated[Series, Field(min_length=1, description="SI, a value for each sample.")]

    def __repr__(self) -> str:
        return f"Residual(rms {self.rms}, gap {self.gap}, {count(self.values.size, 'sample')})"


class Residuals(Part):
    """The residuals of one recording (N samples), without and with the effects that the diagnosis names."""

    name: Annotated[str, Field(description="Of the recording.")]
    over_time: Annotated[bool, Field(description="Whether the crank does not turn as commanded.")]
    time: Annotated[Grid, Field(min_length=1, description="s")]
    crank_angle: Annotated[Grid, Field(min_length=1, description="rad")]
    noise: Annotated[FiniteFloat, Field(gt=0, description="1 sigma, SI")]
    noise_given: Annotated[bool, Field(description="false: estimated from the data")]
    before: Annotated[Residual, Field(description="Against the nominal mechanism.")]
    after: Annotated[Residual, Field(description="Against the explained mechanism.")]

    def __repr__(self) -> str:
        return f"Residuals({self.name}: gap {self.before.gap} before, {self.after.gap} after)"


class SignalResiduals(Document):
    """Measured minus simulated of one signal in every run of a diagnosis that has it, before and after."""

    file: ClassVar[str] = "residuals.json"
    remedy: ClassVar[str] = "give what compare show --json --signal prints of a diagnosis.json"

    case: Annotated[str, Field(description="Name of the nominal mechanism.")]
    verdict: Annotated[DiagnosisVerdict, Field(description="Of the diagnosis.")]
    simulator: Annotated[Simulator, Field(description="The engine that diagnosed.")]
    signal: Annotated[str, Field(description="Its name in files.")]
    label: Annotated[Text, Field(description="What it is, in words.")]
    unit: Unit
    runs: Annotated[tuple[Residuals, ...], Field(min_length=1)]

    def rows(self) -> list[Row]:
        """A row for each sample of each run."""
        rows: list[Row] = []
        for run in self.runs:
            sides = {"before": run.before.values, "after": run.after.values}
            rows += rows_of({"time": run.time, "crank_angle": run.crank_angle} | sides, run=run.name)
        return rows

    def units(self) -> Mapping[str, str]:
        """SI unit of each column."""
        return {"time": "s", "crank_angle": "rad", "before": self.unit, "after": self.unit}

    def __repr__(self) -> str:
        return f"SignalResiduals({self.case}, {self.signal}: {', '.join(run.name for run in self.runs)})"

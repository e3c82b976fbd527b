"""plan.json: the runs and sensors that would tell which effect a model lacks, and what they would leave open."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import Field, FiniteFloat

from analytic.mechanism import Load
from analytic.mechanism.one_line import count
from compare.results.diagnosis import EffectPlace, Unit
from compare.results.document import Document, Filled, Mechanism, Number, Part, Row, Share, Text

Positive = Annotated[FiniteFloat, Field(gt=0)]
Price = Annotated[FiniteFloat, Field(ge=0)]
Bits = Annotated[FiniteFloat, Field(description="Expected information on which effect of the rig is missing.")]


class PlannedRun(Part):
    """A run to make."""

    name: Text
    speed: Annotated[FiniteFloat, Field(description="rad/s; negative is reverse.")]
    angle: Annotated[FiniteFloat, Field(description="Commanded crank angle at time 0 (rad).")]
    duration: Annotated[Positive, Field(description="s")]
    samples: Annotated[int, Field(ge=1)]
    loading: Annotated[str, Field(description="Name of the loads; empty: those of the mechanism.")]
    loads: Annotated[tuple[Load, ...] | None, Field(description="In place of the mechanism's; null: its own.")]
    price: Price


class PlannedSensor(Part):
    """A sensor that could be used, and whether it should be."""

    signal: Text
    unit: Unit
    noise: Annotated[Positive, Field(description="One sigma, in the unit.")]
    price: Price
    used: bool


class PlanStep(Part):
    """What one more run or sensor brings, with all above it."""

    kind: Literal["run", "sensor"]
    name: Text
    price: Price
    bits: Bits
    told: Annotated[Share, Field(description="How probable the data make the effect that is missing, on average.")]


class Foretold(Part):
    """A parameter of an effect as it is assumed to be, and the 95 % interval that the data would leave it."""

    value: FiniteFloat
    unit: Unit
    low: Annotated[Number, Field(description="If the rig is as drawn otherwise; null: open.")]
    high: Number
    careful_low: Annotated[Number, Field(description="With errors that careful work leaves everywhere; null: open.")]
    careful_high: Number


class Instead(EffectPlace):
    """An effect that may be taken for another."""

    share: Annotated[Share, Field(description="How probable the data make it where the other is true, on average.")]


class PlannedEffect(EffectPlace):
    """An effect of the rig that may be missing, and how the planned data would tell it."""

    told: Annotated[Share, Field(description="How probable the data make it where it is true, of any size.")]
    told_if_usual: Annotated[Share, Field(description="The same where it is of its usual size.")]
    of_sensor: Annotated[Share, Field(description="How probable a fault of a sensor seems then, at its usual size.")]
    unseen: Annotated[Share, Field(description="How probable it seems then that nothing is missing.")]
    instead: Annotated[tuple[Instead, ...], Field(description="What it may be taken for, at its usual size.")]
    parameters: Annotated[Mapping[str, Foretold], Field(description="At its usual size.")]


class CombinedEffect(EffectPlace):
    """An effect of a combination: a parameter of it and by how much."""

    parameter: Text
    unit: Unit
    value: FiniteFloat


class Plan(Document):
    """Runs and sensors to buy, before any data exist; probabilities are those of one effect being missing."""

    file: ClassVar[str] = "plan.json"
    remedy: ClassVar[str] = "give the plan.json of compare plan"
    opens: ClassVar[str] = "plan.html"
    opened: ClassVar[str] = "page"

    case: Annotated[str, Field(description="Name of the mechanism.")]
    command: str = ""
    mechanism: Mechanism
    versions: Mapping[str, str]
    runs: Annotated[tuple[PlannedRun, ...], Field(min_length=1, description="The most useful first.")]
    sensors: Annotated[tuple[PlannedSensor, ...], Field(min_length=1)]
    steps: Annotated[tuple[PlanStep, ...], Field(min_length=1)]
    budget: Positive
    spent: Price
    possible_runs: Annotated[int, Field(ge=1, description="That were chosen from.")]
    bits: Bits
    possible_bits: Annotated[FiniteFloat, Field(description="Information if every effect were told for sure.")]
    told: Share
    told_if_usual: Share
    effects: tuple[PlannedEffect, ...]
    groups: Annotated[
        tuple[tuple[EffectPlace, ...], ...], Field(description="Effects that may be taken for each other.")
    ]
    combinations: Annotated[
        tuple[tuple[CombinedEffect, ...], ...],
        Field(description="Effects that together do nothing that all samples would show."),
    ]
    hidden: Annotated[tuple[EffectPlace, ...], Field(description="Effects that no possible run would show.")]
    careful: Annotated[FiniteFloat, Field(description="Size of errors everywhere, of those that careful work leaves.")]
    template: Annotated[str, Field(description="A measured.toml for the planned runs.")]
    taken: Annotated[tuple[str, ...], Field(description="What was taken for what nobody gave.")]
    warnings: tuple[str, ...]
    assumed: Filled = ()

    def rows(self) -> list[Row]:
        """A row for each parameter of each effect."""
        rows: list[Row] = []
        for e in self.effects:
            head: Row = {"name": e.name, "where": e.where, "told": e.told, "told_if_usual": e.told_if_usual}
            rows += [{**head, "parameter": name, **p.model_dump()} for name, p in e.parameters.items()]
        return rows

    @property
    def used(self) -> tuple[PlannedSensor, ...]:
        """The sensors to use."""
        return tuple(sensor for sensor in self.sensors if sensor.used)

    def __repr__(self) -> str:
        sensors = ", ".join(sensor.signal for sensor in self.used)
        return f"Plan({self.case}: {count(len(self.runs), 'run')} with {sensors}, {self.bits:.3g} bits)"

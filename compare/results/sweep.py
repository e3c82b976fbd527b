"""sweep.json: what an analysis, an accuracy or a cross-check comes to where fields of the mechanism are varied."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import Field, JsonValue

from analytic.mechanism.one_line import count
from compare.results.analysis import Limit
from compare.results.crosscheck import Verdict
from compare.results.document import Document, Mechanism, Number, Part, Row, Text

Asks = Literal["analyse", "accuracy", "platform_accuracy", "crosscheck"]
FieldValue = float | str
Group = Literal[
    "asked",
    "reaction",
    "drive",
    "place",
    "rms",
    "mean",
    "stroke",
    "transmission",
    "error",
    "worst_case",
    "limited",
    "yield",
    "limit",
    "share",
]


class SweptField(Part):
    """A field of the mechanism that takes several values."""

    name: Annotated[Text, Field(description="Dotted, as the mechanism's file nests it: joint.B.clearance.")]
    unit: Annotated[str, Field(description="SI; empty of a number without a unit and of a word.")]
    values: Annotated[tuple[FieldValue, ...], Field(min_length=1, description="In this unit.")]
    written_unit: Annotated[str, Field(description="The unit in which they were asked for.")]
    written: Annotated[tuple[FieldValue, ...], Field(description="The values in that unit.")]

    @property
    def head(self) -> str:
        """The field and the unit of what is written."""
        return f"{self.name} ({self.written_unit})" if self.written_unit else self.name


class SweptColumn(Part):
    """A number that every point has."""

    group: Group
    label: Text
    unit: Annotated[str, Field(description="SI; 1 of a share.")]


class Farthest(Part):
    """The comparison that uses up most of its tolerance."""

    run: Annotated[str, Field(description="Engine and joint model.")]
    signal: str
    unit: str
    max: Annotated[Number, Field(description="Simulated minus analytic.")]
    tolerance: Number
    at_crank_angle: Number


class SweptPoint(Part):
    """One combination of the fields' values."""

    at: Annotated[Mapping[str, int], Field(description="By field, which of its values.")]
    numbers: Annotated[Mapping[str, Number], Field(description="By column; null where there is no number.")] = {}
    limits: Annotated[Mapping[str, Limit], Field(description="By name, where limits were asked for.")] = {}
    verdict: Annotated[Verdict | None, Field(description="Of a cross-check.")] = None
    farthest: Farthest | None = None
    failure: Annotated[str, Field(description="Why there is no answer here.")] = ""
    engine_failed: Annotated[bool, Field(description="Whether a simulation has no result.")] = False
    remark: Annotated[str, Field(description="What part of the answer is missing, such as crank angles.")] = ""

    @property
    def whole(self) -> bool:
        """Whether nothing of its answer is missing."""
        return not (self.failure or self.remark)


class Sweep(Document):
    """One question asked of a mechanism over a grid of values of its fields.  SI units and radians."""

    file: ClassVar[str] = "sweep.json"
    remedy: ClassVar[str] = "give the sweep.json of a command with --set"
    opens: ClassVar[str] = "sweep.html"
    opened: ClassVar[str] = "page"

    case: Annotated[str, Field(description="Name of the mechanism.")]
    asks: Annotated[Asks, Field(description="What is asked at each point.")]
    mechanism: Annotated[Mechanism, Field(description="The linkage with its own values of the fields.")]
    options: Annotated[Mapping[str, JsonValue], Field(description="How it is asked, beside what is varied.")]
    fields: Annotated[tuple[SweptField, ...], Field(min_length=1)]
    columns: Annotated[Mapping[str, SweptColumn], Field(description="The numbers that points have.")]
    points: Annotated[tuple[SweptPoint, ...], Field(description="The last field varies fastest.")]
    versions: Annotated[Mapping[str, str], Field(description="Version by package.")]
    command: str = ""
    warnings: tuple[str, ...] = ()

    def values(self, point: SweptPoint, *, written: bool = False) -> dict[str, FieldValue]:
        """The fields' values of a point, in SI or as they were written."""
        return {f.name: (f.written if written else f.values)[point.at[f.name]] for f in self.fields}

    @property
    def holds(self) -> bool:
        """Whether every point has its whole answer, agrees where it is a cross-check, and is within its limits."""
        return all(point.whole and point.verdict in (None, "agrees") for point in self.points) and not self.poor

    @property
    def judges(self) -> bool:
        """Whether its points are held to limits, to a yield or to a simulation."""
        return self.asks == "crosscheck" or any(self.options.get(name) is not None for name in ("limits", "min_yield"))

    @property
    def poor(self) -> int:
        """How many points have a limit that is broken, or less than the yield that was asked for."""
        numbers = [point.numbers for point in self.points]
        return sum((each.get("yield") or 0.0) < self.least_yield or bool(each.get("broken")) for each in numbers)

    @property
    def least_yield(self) -> float:
        """The share of good linkages that was asked for; 0 where none was."""
        asked = self.options.get("min_yield")
        return asked if isinstance(asked, float) else 0.0

    def rows(self) -> list[Row]:
        """A row for each point: the fields' values, its numbers, its verdict, and what is missing."""
        rows: list[Row] = []
        judged = self.asks == "crosscheck"
        for point in self.points:
            numbers = {name: point.numbers.get(name) for name in self.columns}
            row: dict[str, float | str | None] = {**self.values(point), **numbers}
            if judged:
                row["verdict"] = point.verdict
                for name in ("signal", "run", "max", "tolerance"):
                    row[name] = None if point.farthest is None else getattr(point.farthest, name)
            rows.append(row | {"missing": point.failure or point.remark or None})
        return rows

    def units(self) -> Mapping[str, str]:
        """SI unit of each column that has one."""
        units = {field.name: field.unit for field in self.fields} | {n: c.unit for n, c in self.columns.items()}
        return {name: unit for name, unit in units.items() if unit}

    def __repr__(self) -> str:
        over = " x ".join(f"{len(field.values)} of {field.name}" for field in self.fields)
        missing = sum(not point.whole for point in self.points)
        left = f", {missing} not whole" if missing else ""
        wrong = sum(point.verdict == "disagrees" for point in self.points)
        left += f", {wrong} disagree" * bool(wrong) + f", {self.poor} outside the limits" * bool(self.poor)
        return f"Sweep({self.case}, {self.asks}: {over} = {count(len(self.points), 'point')}{left})"

"""baselines.json: which reaction forces are not where the baselines have them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from analytic.mechanism.one_line import count
from compare.results.document import Document, Number, Part, Row

Status = Literal["same", "moved", "unusable", "failed", "written", "unchanged"]


class Moved(Part):
    """A column of a run that moved: by how much where that is most of the tolerance, and where else."""

    run: Annotated[str, Field(description="Joint model and motion.")]
    signal: str
    unit: Annotated[str, Field(description="deg, N or 1")]
    by: Annotated[Number, Field(description="Now minus baseline; null where only one side has a direction.")]
    was: Annotated[Number, Field(description="What the baseline has.")]
    tolerance: Annotated[float, Field(ge=0)]
    at: Annotated[str, Field(description="Where it moved most; empty for averages over the run.")]
    count: Annotated[int, Field(ge=1, description="At how many places it moved.")]
    of: Annotated[int, Field(ge=1)]

    @property
    def sentence(self) -> str:
        """How far the column moved, in words."""
        where = f" at {self.at}; moved at {self.count} of {self.of}" if self.at else " over the run"
        unit = "" if self.unit == "1" else f" {self.unit}"
        if self.by is None or self.was is None:
            return f"{self.run}: {self.signal} has a direction on one side only{where}"
        return (
            f"{self.run}: {self.signal} moved by {self.by:+.4g}{unit} from {self.was:.6g}{unit}{where} (tolerance"
            f" {self.tolerance:.3g}{unit})"
        )


class Entry(Part):
    """The baseline of a case in an engine."""

    case: str
    simulator: str
    file: Annotated[str, Field(description="Where the baseline is stored.")]
    status: Annotated[
        Status,
        Field(
            description="same or moved where it was checked, written or unchanged where it was updated; unusable where"
            " the baseline or the case cannot be used, failed where the engine gave no answer."
        ),
    ]
    version: Annotated[str, Field(description="Of the engine here; empty if it gave no answer.")] = ""
    stored_version: Annotated[str, Field(description="Of the engine that made the baseline; empty if unknown.")] = ""
    runs: Annotated[int, Field(ge=0)] = 0
    signals: Annotated[int, Field(ge=0, description="Columns that were compared.")] = 0
    numbers: Annotated[int, Field(ge=0, description="Numbers that were compared.")] = 0
    compared: Annotated[
        Mapping[str, tuple[str, ...]], Field(description="The signals that were compared, by run.")
    ] = {}
    moved: tuple[Moved, ...] = ()
    changed: Annotated[
        str,
        Field(description="In which fields the linkage is another than the one whose forces are stored; else empty."),
    ] = ""
    look: Annotated[str, Field(description="A command that shows every number that moved, where one did.")] = ""
    accept: Annotated[str, Field(description="A command that makes what is found now the baseline.")] = ""
    why: Annotated[
        str,
        Field(description="Why it is unusable or failed, what its runs are now made with, or why a file was written."),
    ] = ""

    @model_validator(mode="after")
    def _reasoned(self) -> Entry:
        """What is wrong has its reason."""
        if self.status in ("unusable", "failed") and not self.why:
            raise ValueError(f"why is empty though the baseline is {self.status}")
        return self

    @property
    def sentences(self) -> tuple[str, ...]:
        """What moved: that the linkage is another, or made otherwise now, and each column."""
        if self.status != "moved":
            return tuple(each.sentence for each in self.moved)
        cause = f"the linkage is another: {self.changed}" if self.changed else self.why
        return (*[cause] * bool(cause), *(each.sentence for each in self.moved))

    @property
    def words(self) -> str:
        """How many columns moved, or that none did."""
        if self.status == "moved" and not self.moved:
            return "made otherwise than before, and nothing moved"
        if self.moved:
            return f"{len(self.moved)} of {count(self.signals, 'signal')} in {count(self.runs, 'run')} moved"
        return f"nothing moved ({count(self.numbers, 'number')} in {count(self.runs, 'run')})"

    def __repr__(self) -> str:
        return f"Entry({self.case}, {self.simulator}: {self.status})"


class Baselines(Document):
    """Reaction forces of every case in every engine, held to their baselines."""

    file: ClassVar[str] = "baselines.json"
    remedy: ClassVar[str] = "give what compare baseline check --json prints"
    opens: ClassVar[str] = "baselines.json"
    opened: ClassVar[str] = "numbers"

    stored: Annotated[str, Field(description="The file or folder that holds it.")]
    made_again: Annotated[str, Field(description="How much of it was made again, in words.")]
    differences: Annotated[tuple[str, ...], Field(description="What is no longer as it is stored, a sentence each.")]
    notes: Annotated[
        tuple[str, ...], Field(description="What is otherwise and no difference, such as another version of an engine.")
    ]
    left_out: Annotated[tuple[str, ...], Field(description="What could not be made again here, and why.")]
    entries: tuple[Entry, ...]

    @property
    def holds(self) -> bool:
        """Whether nothing that was made again differs."""
        return not self.differences

    def rows(self) -> list[Row]:
        """A row for each column that moved, and one for each baseline in which none did."""
        rows: list[Row] = []
        for entry in self.entries:
            head: dict[str, float | str | None] = {
                "case": entry.case,
                "simulator": entry.simulator,
                "status": entry.status,
            }
            moved = [
                {"run": m.run, "signal": m.signal, "unit": m.unit, "by": m.by, "was": m.was, "tolerance": m.tolerance}
                for m in entry.moved
            ]
            rows += [head | each for each in moved] or [head]
        return rows

    def __repr__(self) -> str:
        left = f", {len(self.left_out)} left out" if self.left_out else ""
        return f"Baselines({self.stored}: {self.made_again}; {len(self.differences)} differ{left})"

"""runs.json: earlier results in a folder, as each says of itself."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from compare.results.catalogue import Listing
from compare.results.document import Part, Row

Kind = Literal["cross-check", "diagnosis", "analysis", "accuracy", "validity", "sweep", "data", "plan"]


class EarlierRun(Part):
    """A result that a command has left."""

    file: Annotated[str, Field(description="Path of its JSON file, as it is found from here.")]
    kind: Kind
    case: Annotated[str, Field(description="Name of the mechanism.")]
    verdict: Annotated[str | None, Field(description="As in its file; null for what has none: accuracy, validity.")]
    command: Annotated[str, Field(description="The command that made it; empty if it was made from Python.")]
    date: Annotated[str, Field(description="When: its date, or when the file was last written; ISO 8601, UTC.")]

    def __repr__(self) -> str:
        return f"EarlierRun({self.file}: {self.verdict or self.kind}, {self.date})"


class Runs(Listing):
    """Earlier results in a folder, newest first."""

    file: ClassVar[str] = "runs.json"
    remedy: ClassVar[str] = "give what compare list --json prints"

    folder: str
    runs: tuple[EarlierRun, ...]
    unreadable: Annotated[tuple[str, ...], Field(description="Files that are no result, a sentence each.")] = ()

    def rows(self) -> list[Row]:
        """A row for each result."""
        return [
            {"date": r.date, "case": r.case, "kind": r.kind, "verdict": r.verdict, "command": r.command, "file": r.file}
            for r in self.runs
        ]

    def __repr__(self) -> str:
        return f"Runs({self.folder}: {len(self.runs)}, {len(self.unreadable)} unreadable)"

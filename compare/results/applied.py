"""What was written back into somebody's model file, and what it has no word for."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from analytic.mechanism.one_line import count
from compare.results.document import Document, Row


class Applied(Document):
    """A mechanism's numbers in a model file."""

    file: ClassVar[str] = "apply.json"
    remedy: ClassVar[str] = "give what compare apply --json prints"

    case: str
    source: Annotated[str, Field(description="The model file as it was.")]
    written: Annotated[tuple[str, ...], Field(description="Fields of the mechanism that are in it now, SI.")] = ()
    left: Annotated[tuple[str, ...], Field(description="Fields for which it has no word, or no place.")] = ()
    path: Annotated[str, Field(description="The model file that was written.")] = ""
    text: Annotated[str, Field(description="The model file with the numbers.")] = ""

    def rows(self) -> list[Row]:
        """A row for each field."""
        states = (("written", self.written), ("left out", self.left))
        return [{"field": each, "state": state} for state, fields in states for each in fields]

    def __repr__(self) -> str:
        return f"Applied({self.case}, to {self.source}: {count(len(self.written), 'field')}, {len(self.left)} left out)"

"""Stored evidence that was made again: what is common to what the three kinds of it find."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from compare.results.document import Document


class Stored(Document):
    """Evidence that is kept in the repository, a line for each number so that a change can be reviewed."""

    def files(self) -> dict[str, str]:
        """Text of every file, by name; the JSON file first."""
        return super().files() | {self.file: self.to_json(1) + "\n"}


class Remade(Document):
    """Stored evidence that was made again and compared."""

    presentation: ClassVar[str] = "evidence"
    opens: ClassVar[str] = ""

    stored: Annotated[str, Field(description="The file or folder that holds it.")]
    made_again: Annotated[str, Field(description="How much of it was made again, in words.")]
    differences: Annotated[tuple[str, ...], Field(description="What is no longer as it is stored, a sentence each.")]
    notes: Annotated[
        tuple[str, ...], Field(description="What is otherwise and no difference, such as another version of an engine.")
    ]
    left_out: Annotated[tuple[str, ...], Field(description="What could not be made again here, and why.")]

    @property
    def holds(self) -> bool:
        """Whether nothing that was made again differs."""
        return not self.differences

    def __repr__(self) -> str:
        left = f", {len(self.left_out)} left out" if self.left_out else ""
        return f"{type(self).__name__}({self.stored}: {self.made_again}; {len(self.differences)} differ{left})"

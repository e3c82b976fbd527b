"""Stored evidence that was made again: what is common to what the three kinds of it find."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from compare.results.document import Document


class Remade(Document):
    """Stored evidence that was made again and compared."""

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

"""Evidence that is stored in the repository, and what differs where it is made again."""

from __future__ import annotations

import importlib
from typing import Annotated, ClassVar, Self

from pydantic import Field

from compare.presentation import Presentation
from compare.results.document import Document


class Evidence(Document):
    """A document about the project itself; the module :mod:`tests.evidence.pages` of its ``presentation`` shows it."""

    presentation: ClassVar[str]

    def _shown(self) -> Presentation[Self]:
        page = importlib.import_module(f"tests.evidence.pages.{self.presentation}")
        return Presentation(page.summary_html, page.print_table, page.files, page.plot)


class Stored(Evidence):
    """Evidence that is kept in the repository, a line for each number so that a change can be reviewed."""

    indent: ClassVar[int | None] = 1


class Remade(Evidence):
    """Stored evidence that was made again and compared."""

    presentation: ClassVar[str] = "remade"
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

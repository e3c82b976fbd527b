"""What an import read: a mechanism from somebody's model file, and what of the file it leaves out or assumes."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from analytic.mechanism.file import dumps
from analytic.mechanism.one_line import count
from compare.results.document import Document, Filled, Mechanism, Row


class Imported(Document):
    """A mechanism from a model file."""

    file: ClassVar[str] = "import.json"
    remedy: ClassVar[str] = "give what compare import --json prints"

    case: str
    source: Annotated[str, Field(description="The model file.")]
    mechanism: Mechanism
    notes: Annotated[
        tuple[str, ...], Field(description="What of the file is left out, taken on or assumed, a sentence each.")
    ] = ()
    relations: Annotated[
        tuple[str, ...],
        Field(description="How signals relate to the file's coordinates, actuators and sensors, SI, an equation each."),
    ] = ()
    map: Annotated[str, Field(description="A map of a log's columns by their names in the file: TOML.")] = ""
    path: Annotated[str, Field(description="The mechanism file that was written.")] = ""
    map_path: Annotated[str, Field(description="The map that was written.")] = ""
    assumed: Filled = ()

    @property
    def text(self) -> str:
        """The mechanism file: TOML, with the notes as comments at its head."""
        said = "".join(f"# {line}\n" for line in (f"{self.case}, from the model file {self.source}", *self.notes))
        return f"{_printable(said)}{dumps(self.mechanism)}"

    def rows(self) -> list[Row]:
        """A row for each note."""
        return [{"note": note} for note in self.notes]

    def __repr__(self) -> str:
        return f"Imported({self.case}, from {self.source}: {count(len(self.notes), 'note')})"


def _printable(text: str) -> str:
    """Lines without control characters, which no TOML comment may have."""
    return "".join(c if c.isprintable() or c == "\n" else "?" for c in text)

"""What the evidence is: one frozen model for each document, from which its JSON Schema file is generated."""

from __future__ import annotations

from pathlib import Path

from compare.results import schemas
from compare.results.document import Document

FOLDER = Path(__file__).parents[1] / "schemas"


def documents() -> dict[str, type[Document]]:
    """Every document of the evidence by the name of its schema's file."""
    return schemas.documents(__name__, ("scoreboard", "validation"))

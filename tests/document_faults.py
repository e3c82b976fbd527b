"""What a document's schema has against a content."""

from __future__ import annotations

import json

import jsonschema

from compare.results.document import Document
from compare.results.schemas import FOLDER
from tests.evidence import results as evidence
from tests.evidence.results.remade import Evidence


def faults(document: type[Document], content: object) -> list[str]:
    """Each fault as a sentence."""
    folder = evidence.FOLDER if issubclass(document, Evidence) else FOLDER
    rules = json.loads((folder / document.file).read_text(encoding="utf-8"))
    return [error.message for error in jsonschema.Draft202012Validator(rules).iter_errors(content)]

"""The JSON Schema files of the documents: generated from their models, shipped with the package.

``python -m compare.results.schemas`` writes them again; a test sees that they are in step.
"""

from __future__ import annotations

import importlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from pydantic.json_schema import GenerateJsonSchema

from compare.results.document import Document

MODULES = (
    "crosscheck",
    "analysis",
    "accuracy",
    "platform",
    "validity",
    "catalogue",
    "history",
    "export",
    "applied",
    "imported",
    "diagnosis",
    "provenance",
    "residuals",
    "preview",
    "plan",
    "prediction",
    "baselines",
    "sweep",
)
FOLDER = Path(__file__).parents[1] / "schemas"


class Closed(GenerateJsonSchema):
    """Draft 2020-12, with no title on each field; a part of a document has no other fields than its own."""

    def generate(self, schema, mode="validation"):  # type: ignore[no-untyped-def]
        """The JSON Schema of a model, closed."""
        content = super().generate(schema, mode)
        _close(content)
        return content


def _close(schema: object) -> None:
    """Take the titles out and shut every object of known fields, in place."""
    if isinstance(schema, list):
        for item in schema:
            _close(item)
    if not isinstance(schema, dict):
        return
    if isinstance(schema.get("title"), str):
        del schema["title"]
    if {"properties", "patternProperties"} & set(schema) and "additionalProperties" not in schema:
        schema["additionalProperties"] = False
    for key, item in schema.items():
        if key == "properties":
            for field in item.values():
                _close(field)
        elif key not in ("default", "const", "enum", "if", "then"):
            _close(item)


def documents(package: str = "compare.results", modules: Sequence[str] = MODULES) -> dict[str, type[Document]]:
    """Every document of a package's modules by the name of its schema's file, which is that of its own but where two
    documents have the same.
    """
    every = [importlib.import_module(f"{package}.{name}") for name in modules]
    return {
        kind.described or kind.file: kind
        for module in every
        for kind in vars(module).values()
        if isinstance(kind, type) and issubclass(kind, Document) and kind.__module__ == module.__name__
        if "file" in vars(kind)
    }


def schema(document: type[Document]) -> str:
    """The JSON Schema of a document, as text of its file."""
    content = document.model_json_schema(by_alias=True, schema_generator=Closed, mode="serialization")
    content["properties"]["schema"] = {"const": 1}
    content["required"] = ["schema", *(name for name in content.get("required", []) if name != "schema")]
    head = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": f"urn:linkage-crosscheck:{(document.described or document.file).removesuffix('.json')}:1",
        "title": document.file,
    }
    return json.dumps(head | content, indent=2, ensure_ascii=False) + "\n"


def write(folder: Path, kinds: Mapping[str, type[Document]]) -> None:
    """Write the schema files of documents, by name, into a folder."""
    for name, document in kinds.items():
        (folder / name).write_text(schema(document), encoding="utf-8")


if __name__ == "__main__":
    write(FOLDER, documents())

"""A notebook as a page: executed when the site is built, its outputs below its code."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient


def executed(path: Path) -> Any:
    """The notebook with its outputs.  Raises CellExecutionError where a cell fails."""
    book = nbformat.read(path, as_version=4)
    where = {"metadata": {"path": str(path.parent)}}
    NotebookClient(book, timeout=300, resources=where, extra_arguments=["--log-level=ERROR"]).execute()
    return book


def _shown(output: Any) -> str:
    """One output of a cell as Markdown."""
    if output.output_type == "stream":
        return f"```text\n{output.text.rstrip()}\n```\n" if output.name == "stdout" else ""
    data = output.get("data", {})
    if "image/png" in data:
        return f'<img class="output" alt="figure" src="data:image/png;base64,{data["image/png"].strip()}">\n'
    if "image/svg+xml" in data:
        return f'<div class="output">{data["image/svg+xml"]}</div>\n'
    if "text/html" in data:
        one_line = re.sub(r"\s*\n\s*", " ", data["text/html"])  # Markdown ends a block of HTML at an empty line
        return f'<div class="output">{one_line}</div>\n'
    return f"```text\n{data['text/plain']}\n```\n" if "text/plain" in data else ""


def page(path: Path) -> str:
    """The notebook as Markdown, outputs included."""
    parts: list[str] = []
    for cell in executed(path).cells:
        if cell.cell_type == "markdown":
            parts.append(cell.source + "\n")
            continue
        parts.append(f"```python\n{cell.source}\n```\n")
        parts += [_shown(output) for output in cell.outputs]
    parts.insert(1, f'<p><a href="{path.name}" download>Download this page as a notebook</a></p>\n')
    return "\n".join(parts)

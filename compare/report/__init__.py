"""The report over one result: report.html, report.md, junit.xml and the figures, each written whole or not at all."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from compare.files import to_json, write_together
from compare.report.figures import figures
from compare.report.junit import junit
from compare.report.linkage import linkage_figure
from compare.report.pages import render
from compare.report.summary import summarise
from compare.report.svg import draw

__all__ = ["report_files", "write_report"]


def write_report(result: Mapping[str, Any], out: Path) -> list[Path]:
    """Write the report over a result (the content of result.json) into the folder ``out`` and return the files."""
    return write_together(out, report_files(result))


def report_files(result: Mapping[str, Any]) -> dict[str, str]:
    """The report over a result (the content of result.json): text by file name.

    A discrepancy may say why it is known as ``reason``.
    """
    result = json.loads(to_json(result))  # what result.json says: no arrays, and null for what is not finite
    summary = summarise(result)
    shown = figures(result, summary)
    linkage = linkage_figure(result, summary)
    drawings = {figure.name: draw(figure) for figure in [*([linkage] if linkage else []), *shown]}
    files = {name: f"{re.sub(r'[^A-Za-z0-9_-]', '_', name)}.svg" for name in drawings}
    html, markdown = render(result, summary, shown, linkage, drawings, files)
    texts = {"report.html": html, "report.md": markdown, "junit.xml": junit(summary)}
    return texts | {files[name]: drawing for name, drawing in drawings.items()}

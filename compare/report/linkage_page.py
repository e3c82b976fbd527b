"""What the pages of one linkage have alike: motion, errors of its outputs, what tolerances do, figures, provenance."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence

from analytic.mechanism.model import as_written
from compare.quantities import DASH, assumptions
from compare.report.figure import Figure
from compare.report.mover import Mover
from compare.report.pages import PageSection, charts, figures_context, page, warnings_context
from compare.report.peaks import error_peaks, over
from compare.report.toleranced import on_page
from compare.results.accuracy import Accuracy
from compare.results.analysis import Analysis

ERRORS = "errors.html.j2"


def linkage_page(
    result: Analysis | Accuracy,
    about: str,
    own: Mapping[str, object],
    sections: Sequence[str],
    drawn: Sequence[Figure],
    drawings: Mapping[str, str],
    moved: Mover | None,
) -> str:
    """The page (HTML, self-contained) ``about`` a linkage: what its templates need of their ``own``, and its
    ``sections`` between the linkage in motion and the tolerances, of which errors are left out where there are none.
    """
    context = figures_context(list(drawn), dict(drawings)) | warnings_context(result.warnings)
    context |= {
        "assumed": assumptions(result.assumed),
        "mechanism": json.dumps(as_written(result.mechanism), indent=2, ensure_ascii=False),
    }
    header, *numbers = numbers_of(result, own, sections, context | {"mover": moved})
    linkage, *last = (PageSection(f"{name}.html.j2", header.context) for name in ("linkage", "figures", "provenance"))
    return page(
        f"{result.case} {DASH} {about}",
        header,
        [*[linkage] * bool(moved), *numbers, *last],
        script=charts(drawn, moved and moved.data()),
        skip_to="the linkage" if moved else "the numbers",
        footer=f"All values come from {result.file} beside this page, which needs no network.",
    )


def numbers_of(
    result: Analysis | Accuracy, own: Mapping[str, object], sections: Sequence[str], context: Mapping[str, object]
) -> list[PageSection]:
    """The head of the page, its sections, and what tolerances do."""
    errors, toleranced = list(error_peaks(result)), result.tolerances and on_page(result.tolerances, over(result))
    context = {**context, "result": result, "errors": errors, "toleranced": toleranced, **own}
    shown = [each for each in sections if each != ERRORS or errors] + ["tolerances.html.j2"] * bool(toleranced)
    return [PageSection(name, context) for name in (f"{result.file.removesuffix('.json')}/header.html.j2", *shown)]

"""How each kind of result is shown.  What shows one kind is imported when the first of that kind is shown."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Never

from compare.presentation import LEFT_OVER, PRESENTATIONS, Presentation

NOT_A_PICTURE = "is a list and has no picture; use to_dataframe()"


def _accuracy() -> Presentation[Never]:
    from compare.report import accuracy as page

    return Presentation(page.summary_html, page.print_table, page.files, page.plot)


def _baselines() -> Presentation[Never]:
    from compare.report import baselines as page

    return Presentation(page.summary_html, page.print_table, page.files, no_picture=NOT_A_PICTURE)


def _crosscheck() -> Presentation[Never]:
    from compare.report import crosscheck as page
    from compare.report.terminal import print_table

    return Presentation(page.summary_html, print_table, page.files, page.plot)


def _diagnosis() -> Presentation[Never]:
    from compare.report import diagnosis as page

    return Presentation(page.summary_html, page.print_table, page.files, page.plot)


def _listing(kind: str) -> Presentation[Never]:
    from compare.report import lists

    printed: dict[str, Callable[..., None]] = {
        "Cases": lists.print_cases,
        "Simulators": lists.print_simulators,
        "Effects": lists.print_effects,
        "Runs": lists.print_runs,
    }
    return Presentation(lists.list_html, printed[kind], lists.list_files, no_picture=NOT_A_PICTURE)


def _exported() -> Presentation[Never]:
    from compare.report import lists

    none = "is a list of files and has no picture; print it"
    return Presentation(lists.exported_html, lists.print_exported, no_picture=none)


def _imported() -> Presentation[Never]:
    from compare.report import lists

    none = "is a mechanism and has no picture; cross-check it, and plot that"
    return Presentation(lists.imported_html, lists.print_imported, lists.imported_files, no_picture=none)


def _platform() -> Presentation[Never]:
    from compare.report import platform as page

    return Presentation(page.summary_html, page.print_table, page.files, page.plot)


def _measured() -> Presentation[Never]:
    from compare.report import measured as page

    return Presentation(page.summary_html, page.print_table)


def _preview() -> Presentation[Never]:
    from compare.report import preview as page

    return Presentation(page.summary_html, page.print_table, page.files, page.plot)


def _provenance() -> Presentation[Never]:
    from compare.report import provenance as page

    none = "is about one number and has no picture; plot the cross-check, or print it"
    return Presentation(page.summary_html, page.print_table, no_picture=none)


def _residuals() -> Presentation[Never]:
    from compare.report import residuals as page

    return Presentation(page.summary_html, page.print_table, page.files, page.plot)


def _side() -> Presentation[Never]:
    from compare.report import sides as page

    return Presentation(page.summary_html, page.print_table, page.files, page.plot)


def _validity() -> Presentation[Never]:
    from compare.report import validity as page

    return Presentation(page.summary_html, page.print_table, page.files, page.plot)


def _left_over(folder: Path, names: set[str]) -> set[str]:
    from compare.results.kinds import left_over

    return left_over(folder, names)


LEFT_OVER.append(_left_over)
PRESENTATIONS.update(
    {
        "Accuracy": _accuracy,
        "Analysis": _side,
        "Baselines": _baselines,
        "Cases": partial(_listing, "Cases"),
        "CrossCheck": _crosscheck,
        "Diagnosis": _diagnosis,
        "Effects": partial(_listing, "Effects"),
        "Exported": _exported,
        "Imported": _imported,
        "Measured": _measured,
        "PlatformAccuracy": _platform,
        "Preview": _preview,
        "Provenance": _provenance,
        "Runs": partial(_listing, "Runs"),
        "SignalResiduals": _residuals,
        "Simulation": _side,
        "Simulators": partial(_listing, "Simulators"),
        "Validity": _validity,
    }
)

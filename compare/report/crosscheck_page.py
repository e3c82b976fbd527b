"""The page of a cross-check for people, and the Markdown of it for pull requests."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict

from markupsafe import Markup

from compare.quantities import DASH, assumptions
from compare.report.figures import Figure
from compare.report.linkage import explorer
from compare.report.pages import Script, Section, markdown, page
from compare.report.summary import REAL, ShownRun, Summary
from compare.report.words.crosscheck import MODELS, SIGNS, WORDS, frame_and_signs, headline, motion, same_order, why
from compare.results.crosscheck import CrossCheck
from compare.results.document import as_written

OF_CONTACT = ("orbit_", "contact_force_", "regimes_", "section_")  # figures that stand in the section on contact


def render(
    result: CrossCheck,
    summary: Summary,
    figures: Sequence[Figure],
    linkage: Figure | None,
    drawings: Mapping[str, str],
    files: Mapping[str, str],
) -> tuple[str, str]:
    """The page (HTML, self-contained) and the Markdown text."""
    shared = _shared(result, summary, figures, linkage, files)
    whole = bool(summary.runs)
    context = shared | {
        "keys": summary.keys(False, result.mechanism),
        "drawings": [Markup(drawings[figure.name]) for figure in figures],
        "linkage_svg": Markup(drawings[linkage.name]) if linkage else "",
        "mechanism": json.dumps(as_written(result.mechanism), indent=2, ensure_ascii=False),
    }
    sections = {
        "differences": whole,
        "contact": whole and bool(summary.contact.runs),
        "linkage": whole,
        "figures": whole,
        "limits": whole,
        "provenance": True,
    }
    moved = {"figures": [asdict(figure) for figure in figures], "explorer": explorer(result, summary)}
    html = page(
        f"{summary.case}: {WORDS[summary.verdict]} {DASH} cross-check",
        Section("crosscheck/header.html.j2", context),
        [Section(f"crosscheck/{name}.html.j2", context) for name, there in sections.items() if there],
        script=Script(("chart.js", "explorer.js"), moved),
        skip_to="the differences" if whole else "its provenance",
        footer="All values come from result.json beside this page, which needs no network.",
    )
    return html, markdown(Section("crosscheck/report.md.j2", shared | {"keys": summary.keys(True, result.mechanism)}))


def _shared(
    result: CrossCheck,
    summary: Summary,
    figures: Sequence[Figure],
    linkage: Figure | None,
    files: Mapping[str, str],
) -> dict[str, object]:
    """What page and Markdown are both filled with."""
    runs = summary.runs
    loose = [run for run in runs if run.clearance != "none"]
    models = [MODELS.get(name, name) for name in _once(run.analytic_model for run in loose)] or ["ideal linkage"]
    return {
        "result": result,
        "summary": summary,
        "headline": headline(summary),
        "why": why(summary),
        "contact": summary.contact,
        "figures": list(figures),
        "of_contact": [figure.name for figure in figures if figure.name.startswith(OF_CONTACT)],
        "linkage": linkage,
        "files": files,
        "words": WORDS,
        "signs": SIGNS,
        "engines": _once(f"{run.simulator} {run.version}" for run in runs),
        "joint_models": _once(run.joint_model for run in runs),
        "motions": _once(motion(run, result.mechanism) for run in result.runs),
        "models": models + ["compliance of links and joints superposed"] * any(run.bends for run in runs),
        "clearance": "; ".join(_once(run.clearance for run in loose)) or "none",
        "by_engine": [
            (name, _worst_first(run for run in runs if run.simulator == name))
            for name in _once(run.simulator for run in runs)
        ],
        "first_run": _worst_first(sorted(runs, key=_shown_first))[0].index if runs else None,
        "runs_with_order": list({run.clearance: run for run in reversed(loose) if run.order}.values()),
        "same_order": same_order(runs),
        "frame_and_signs": frame_and_signs(result.mechanism),
        "spans": _once(run.span for run in runs if run.span),
        "free": any(run.free for run in runs),
        "flagged": any(run.flags for run in runs),
        "setting_names": _once(name for run in runs for name in run.settings),
        "assumed": assumptions(result.assumed),
    }


def _shown_first(run: ShownRun) -> tuple[bool, int]:
    """Runs with clearance first; of those that disagree, the one with the most real joints."""
    return run.clearance == "none", REAL.index(run.joint_model) if run.verdict == "disagrees" else 0


def _worst_first(runs: Iterable[ShownRun]) -> list[ShownRun]:
    """Runs that disagree before those that agree, otherwise in their order."""
    return sorted(runs, key=lambda run: run.verdict == "agrees")


def _once(values: Iterable[str]) -> list[str]:
    return list(dict.fromkeys(values))

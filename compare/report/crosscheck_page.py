"""The page of a cross-check for people, and the Markdown of it for pull requests."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence

from markupsafe import Markup

from analytic.mechanism.model import as_written
from compare.quantities import DASH, assumptions
from compare.report.crosscheck_motion import mover
from compare.report.figure import Figure
from compare.report.pages import PageSection, charts, figures_context, glimpse, markdown, page, warnings_context
from compare.report.summary import REAL, ShownRun, Summary
from compare.report.trust import checked
from compare.report.words import crosscheck as words
from compare.report.words.prediction import METRICS_HEADS

OF_CONTACT = ("orbit_", "contact_force_", "regimes_", "section_")  # figures that stand in the section on contact
OF_DIFFERENCES = "difference_"  # and those beside the numbers of their signals


def render(
    summary: Summary,
    figures: Sequence[Figure],
    linkage: Figure | None,
    drawings: Mapping[str, str],
    files: Mapping[str, str],
) -> tuple[str, str]:
    """The page (HTML, self-contained) and the Markdown text."""
    result, shared = summary.result, _shared(summary)
    names, still = [figure.name for figure in figures], Markup(drawings[linkage.name] if linkage else "")
    first = min(summary.runs, key=lambda shown: (_agrees(shown), *_shown_first(shown)), default=None)
    moved = mover(summary, first, still) if first else None
    of_contact, keys = [name for name in names if name.startswith(OF_CONTACT)], summary.keys()
    elsewhere = [*of_contact, *(name for name in names if name.startswith(OF_DIFFERENCES))]
    context = shared | figures_context(figures, drawings, elsewhere) | warnings_context(result.warnings)
    context |= {
        "keys": keys,
        "key_names": [quantity.signal for quantity in keys],
        "of_contact": of_contact,
        "mover": moved,
        "lost": [(joint, run.title, share) for run in result.runs for joint, share in run.free_share.items() if share],
        "mechanism": json.dumps(as_written(result.mechanism), indent=2, ensure_ascii=False),
        "dash": DASH,
    }
    sections = ["linkage.html.j2"] * bool(moved) + ["crosscheck/differences.html.j2"] * bool(moved)
    sections += ["crosscheck/contact.html.j2"] * bool(summary.contact.runs)
    sections += ["diagnosis/trust.html.j2"] * bool(shared["trusted"])
    sections += ["figures.html.j2", "crosscheck/limits.html.j2"] * bool(moved)
    html = page(
        f"{result.case}: {words.VERDICT_WORDS[summary.verdict]} {DASH} cross-check",
        PageSection("crosscheck/header.html.j2", context),
        [PageSection(name, context) for name in (*sections, "crosscheck/provenance.html.j2")],
        script=charts(figures, moved and moved.data()),
        skip_to="the linkage" if moved else "its provenance",
        footer="All values come from result.json beside this page, which needs no network.",
    )
    of_markdown: dict[str, object] = {"figures": list(figures), "linkage": linkage, "files": files}
    of_markdown["keys"] = summary.keys(all_joints=True)
    return html, markdown(PageSection("crosscheck/report.md.j2", shared | of_markdown))


def verdict_html(summary: Summary) -> str:
    """The head of the page, for a notebook: the verdict and why, what failed, was left out, and is to beware of."""
    context = _shared(summary) | {"mover": None, "warnings": summary.result.warnings}
    return glimpse(PageSection("crosscheck/header.html.j2", context))


def _shared(summary: Summary) -> dict[str, object]:
    """What page and Markdown are both filled with."""
    result, runs = summary.result, summary.runs
    loose = [shown for shown in runs if shown.run.clearance]
    models = _once(words.MODEL_WORDS[shown.run.analytic_model] for shown in loose) or ["ideal linkage"]
    bends = any(run.bends for run in result.runs)
    return {
        "result": result,
        "summary": summary,
        "words": words,
        "contact": summary.contact,
        "engines": _once(f"{run.simulator.name} {run.simulator.version}" for run in result.runs),
        "joint_models": _once(run.joint_model for run in result.runs),
        "motions": _once(words.motion(run, result.mechanism) for run in result.runs),
        "models": models + ["compliance of links and joints superposed"] * bends,
        "clearance": "; ".join(_once(shown.clearance for shown in loose)) or "none",
        "by_engine": [
            (name, sorted((shown for shown in runs if shown.run.simulator.name == name), key=_agrees))
            for name in _once(run.simulator.name for run in result.runs)
        ],
        "runs_with_order": list({shown.clearance: shown for shown in reversed(loose) if shown.order}.values()),
        "spans": _once(shown.span for shown in runs),
        "free": any(run.free_share for run in result.runs),
        "setting_names": _once(name for run in result.runs for name in run.settings),
        "assumed": assumptions(result.assumed),
        "trusted": checked(result.runs, {name: quantity.title for name, quantity in summary.signals.items()}),
        "trust_heads": ("Signal", *METRICS_HEADS[1:-1]),
        "trust_means": words.METRICS_MEAN,
    }


def _agrees(shown: ShownRun) -> bool:
    return shown.run.verdict == "agrees"


def _shown_first(shown: ShownRun) -> tuple[bool, int]:
    """Runs with clearance first; of those that disagree, the one with the most real joints."""
    run = shown.run
    return not run.clearance, REAL.index(run.joint_model) if run.verdict == "disagrees" else 0


def _once(values: Iterable[str]) -> list[str]:
    return list(dict.fromkeys(values))

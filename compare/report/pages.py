"""The page for people and the Markdown for pull requests, from one context."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict
from importlib import resources

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from analytic.mechanism import Mechanism
from compare.quantities import assumptions, number, setting
from compare.report.figures import Figure
from compare.report.linkage import explorer
from compare.report.summary import MODELS, REAL, WORDS, ShownRun, Summary, frame_and_signs, released
from compare.results.crosscheck import CrossCheck, Run
from compare.results.document import as_written

OF_CONTACT = ("orbit_", "contact_force_", "regimes_", "section_")  # figures that stand in the section on contact
SIGNS = {"agrees": "✓", "disagrees": "✗", "known": "≈", "unjudged": "?", "failed": "✗"}


def render(
    result: CrossCheck,
    summary: Summary,
    figures: Sequence[Figure],
    linkage: Figure | None,
    drawings: Mapping[str, str],
    files: Mapping[str, str],
) -> tuple[str, str]:
    """The page (HTML, self-contained) and the Markdown text."""
    runs = summary.runs
    context = {
        "result": result,
        "summary": summary,
        "figures": list(figures),
        "of_contact": [figure.name for figure in figures if figure.name.startswith(OF_CONTACT)],
        "linkage": linkage,
        "files": files,
        "words": WORDS,
        "signs": SIGNS,
        "engines": _once(f"{run.simulator} {run.version}" for run in runs),
        "joint_models": _once(run.joint_model for run in runs),
        "motions": _once(_motion(run, result.mechanism) for run in result.runs),
        "models": (
            [MODELS.get(name, name) for name in _once(run.analytic_model for run in runs if run.clearance != "none")]
            or ["ideal linkage"]
        )
        + ["compliance of links and joints superposed"] * any(run.bends for run in runs),
        "clearance": "; ".join(_once(run.clearance for run in runs if run.clearance != "none")) or "none",
        "by_engine": [
            (name, _worst_first(run for run in runs if run.simulator == name))
            for name in _once(run.simulator for run in runs)
        ],
        "first_run": _worst_first(sorted(runs, key=_shown_first))[0].index if runs else None,
        "runs_with_order": _first_per_clearance(summary),
        "same_order": _same_order(runs),
        "frame_and_signs": frame_and_signs(result.mechanism),
        "spans": list(dict.fromkeys(run.span for run in runs if run.span)),
        "free": any(run.free for run in runs),
        "flagged": any(run.flags for run in runs),
        "setting_names": _once(name for run in runs for name in run.settings),
        "assumed": assumptions(result.assumed),
    }
    page = _environment(True).get_template("report.html.j2")
    html = page.render(
        context,
        keys=summary.keys(False, result.mechanism),
        drawings=[Markup(drawings[figure.name]) for figure in figures],
        linkage_svg=Markup(drawings[linkage.name]) if linkage else "",
        css=static("report.css"),
        scripts=static("chart.js") + static("explorer.js"),
        data=script_json({"figures": [asdict(figure) for figure in figures], "explorer": explorer(result, summary)}),
        mechanism=json.dumps(as_written(result.mechanism), indent=2, ensure_ascii=False),
    )
    markdown = (
        _environment(False).get_template("report.md.j2").render(context, keys=summary.keys(True, result.mechanism))
    )
    return html, re.sub(r"\n{3,}", "\n\n", markdown)


def script_json(value: object) -> Markup:
    """JSON that may stand in a script element: nothing in it can end the element or start a comment."""
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return Markup(text)


def escape_markdown(text: str) -> str:
    """Text as a Markdown table cell or sentence shows it, markup and line breaks made harmless."""
    return re.sub(r"([\\`*_\[\]|<>&#~!$@])", r"\\\1", re.sub(r"\s+", " ", str(text)))


def code_block(text: str, language: str = "sh") -> str:
    """A code block whose fence is longer than any run of backticks in it."""
    fence = "`" * max(3, 1 + max((len(run) for run in re.findall("`+", text)), default=0))
    return f"{fence}{language}\n{text}\n{fence}"


def _environment(escaping: bool) -> Environment:
    environment = Environment(
        loader=PackageLoader("compare.report"),
        autoescape=escaping,
        undefined=StrictUndefined,
        keep_trailing_newline=True,
    )
    filters: dict[str, Callable[..., str]] = {
        "number": number,
        "signed": lambda value: number(value, 3, True),
        "setting": setting,
        "md": escape_markdown,
        "md_code": code_block,
    }
    environment.filters |= filters
    return environment


def static(name: str) -> Markup:
    """A style sheet or script of the pages."""
    return Markup(resources.files("compare.report").joinpath("static", name).read_text(encoding="utf-8"))


def _shown_first(run: ShownRun) -> tuple[bool, int]:
    """Runs with clearance first; of those that disagree, the one with the most real joints."""
    return run.clearance == "none", REAL.index(run.joint_model) if run.verdict == "disagrees" else 0


def _worst_first(runs: Iterable[ShownRun]) -> list[ShownRun]:
    """Runs that disagree before those that agree, otherwise in their order."""
    return sorted(runs, key=lambda run: run.verdict == "agrees")


def _motion(run: Run, mechanism: Mechanism) -> str:
    """How a run moved, in words."""
    if not released(run, mechanism):
        return run.motion
    if run.motion == "static":
        return "static over time"
    moved = [drive.speed for drive in mechanism.drives if drive.speed != "free"]
    if not moved:
        return "swings freely"
    if any(speed == "measured" for speed in moved) or not run.drive_position:
        return "follows a recorded course"
    return "driven over time"


def _once(values: Iterable[str]) -> list[str]:
    return list(dict.fromkeys(values))


def _same_order(runs: Iterable[ShownRun]) -> str:
    """What is said where no run has a difference between first order and equilibrium."""
    if any(run.clearance != "none" for run in runs):
        return "First order and equilibrium cannot be compared: the analytic model has no answer at any crank angle."
    return "Without clearance first order and equilibrium are the same."


def _first_per_clearance(summary: Summary) -> list[ShownRun]:
    """One run for each clearance: what first order and equilibrium differ in does not depend on who simulates."""
    first = {run.clearance: run for run in reversed(summary.runs) if run.clearance != "none" and run.order}
    return list(first.values())

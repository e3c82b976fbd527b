"""The page of a diagnosis, one file that needs no network, verdict first; and Markdown that fits a pull request."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

from markupsafe import Markup, escape

from analytic.mechanism.file import dumps
from analytic.mechanism.one_line import capital
from compare.files import NOT_XML
from compare.quantities import DASH, MINUS, assumptions, plainly
from compare.report import diagnosis_figures as figures
from compare.report.explained import changes
from compare.report.pages import PageSection, Script, glimpse, markdown, page
from compare.report.proposal_figure import figure as law_figure
from compare.report.svg import draw
from compare.report.trust import trusted
from compare.report.words import diagnosis as words
from compare.report.words import prediction, proposals
from compare.report.words.effects import (
    called,
    competing,
    headline,
    how_sure,
    of_effect,
    own_values,
    phrase,
    quantity,
    rival_words,
    spoken,
)
from compare.report.words.located import located, worst_first
from compare.report.words.measured import InUnits, in_units, off_by, off_on_both_sides, run_title, validation_sentences
from compare.results.diagnosis import DiagnosedRun, Diagnosis, Effect, EffectPlace

VERDICT_LOOKS = {
    "no gap": "agrees",
    "explained": "agrees",
    "partly explained": "known",
    "ambiguous": "known",
    "unexplained": "disagrees",
}
PLACES_ON_PAGE = 10  # located deviations that are listed before one has to ask for the rest
PLACES_IN_TEXT = 12
CANDIDATES_ON_PAGE = 12


def diagnosis_html(result: Diagnosis) -> str:
    """The page over a diagnosis."""
    panels, maps = figures.panels(result), figures.maps(result)
    candidates = sorted(result.candidates, key=lambda c: (c.status not in ("named", "tied"), -(c.sigmas or 0.0)))
    parts: dict[str, dict[str, object]] = {
        "where": {"maps": maps, "cells": _strip, "legend": _legend(), "listed": PLACES_ON_PAGE},
        "story": {},
        "residuals": _residuals(result, panels),
        "trust": {},
        "engines": {},
        "candidates": {"candidates": candidates, "listed": CANDIDATES_ON_PAGE},
        "faults": {},
        "provenance": {
            "changes": changes(result),
            "mechanism": dumps(result.mechanism),
            "explained": dumps(result.explained),
        },
    }
    shared = _shared(result)
    return page(
        f"{result.case}: {result.verdict} {DASH} diagnosis",
        PageSection("diagnosis/header.html.j2", shared),
        [PageSection(f"diagnosis/{name}.html.j2", shared | part) for name, part in parts.items()],
        styles=("diagnosis.css",),
        script=Script(("chart.js", "diagnosis.js"), _data(result, panels, maps)),
        skip_to="where they disagree",
        footer="All values come from diagnosis.json beside this page, which needs no network.",
    )


def summary_html(result: Diagnosis) -> str:
    """The head of the page, for a notebook, and its story on demand."""
    shared = _shared(result)
    head, story = (glimpse(PageSection(f"diagnosis/{name}.html.j2", shared)) for name in ("header", "story"))
    return f"{head}<details><summary>How it was found</summary>{story}</details>"


def diagnosis_md(result: Diagnosis) -> str:
    """The text of diagnosis.md."""
    tables: dict[str, object] = {
        "shares": [(capital(bar.label), words.percent(bar.share / 100)) for bar in words.waterfall(result)],
        "effects": [row for group in words.ties(result) for row in _effect_rows(result, group)],
        "off_units": [_off_row(result, sensor) for sensor in in_units(result)],
        "gaps": [_gap_row(result, run, name) for run in result.runs for name in run.signals],
        "faults": [(f.run, spoken(result, f.signal), f.kind, str(f.samples), f.text) for f in result.faults],
    }
    return markdown(PageSection("diagnosis/report.md.j2", _shared(result) | tables | {"listed": PLACES_IN_TEXT}))


def _shared(result: Diagnosis) -> dict[str, object]:
    """What page and Markdown are both filled with: the result's words, and how its signals and effects are called."""
    ties = words.ties(result)
    return {
        "result": result,
        "look": VERDICT_LOOKS[result.verdict],
        "steps": [step for step in result.steps if step.title != "Result"],
        "words": words,
        "trust_means": prediction.METRICS_MEAN,
        "trust_heads": prediction.METRICS_HEADS,
        "phrase": lambda effect: phrase(result, effect.name, effect.where),
        "named": partial(called, result),
        "spoken": partial(spoken, result),
        "located": partial(located, result),
        "headline": partial(headline, result),
        "off": partial(off_by, result),
        "own": partial(own_values, result),
        "parameters": of_effect,
        "how_sure": how_sure,
        "competing": competing(result),
        "rival": partial(rival_words, result),
        "percent": _percent,
        "ties": ties,
        "singles": [group for group in ties if len(group) == 1],
        "tied": [group for group in ties if len(group) > 1],
        "bars": words.waterfall(result),
        "sensors": in_units(result),
        "validation": validation_sentences(result),
        "trusted": trusted(result),
        "attempts": words.attempts(result),
        "proposed": [
            (proposals.sentences(result, p), proposals.numbers(p), Markup(draw(law_figure(result, p, f"law-{i}"))))
            for i, p in enumerate(result.proposed)
        ],
        "heading": proposals.heading(result),
        "places": worst_first(result),
        "settings": words.settings(result),
        "assumed": assumptions(result.assumed),
    }


def _effect_rows(result: Diagnosis, group: Sequence[EffectPlace]) -> Iterator[tuple[str, ...]]:
    """What is missing and what is tied with it, a row for each parameter."""
    for i, effect in enumerate(group):
        rivals = ", ".join(phrase(result, other.name, other.where) for other in group[1:]) or DASH
        others = rival_words(result, group, effect) if i else rivals
        kind, held_out = DASH, DASH
        if isinstance(effect, Effect):
            kind = effect.kind
            if effect.held_out_before is not None and effect.held_out_after is not None:
                held_out = f"{plainly(effect.held_out_before)} → {plainly(effect.held_out_after)}"
        for row in of_effect(effect) or [(DASH, DASH, DASH)]:
            yield phrase(result, effect.name, effect.where), kind, *row, held_out, others


def _off_row(result: Diagnosis, sensor: InUnits) -> tuple[str, ...]:
    """How far a sensor is off in its own unit."""
    before, after = (off_by(result, sensor.signal, value) for value in (sensor.before, sensor.after))
    return quantity(result, sensor.signal).title, before, after, _percent(sensor.share())


def _gap_row(result: Diagnosis, run: DiagnosedRun, name: str) -> tuple[str, ...]:
    """How far a sensor is off in a run, in its unit and in its noise."""
    channel = run.signals[name]
    return (
        run.name + " (validation)" * (run.role == "validation"),
        quantity(result, name).title,
        off_by(result, name, channel.noise) + ("" if channel.noise_given else ", estimated"),
        *off_on_both_sides(result, run, name),
        plainly(channel.gap_before),
        plainly(channel.gap_after),
    )


def _percent(share: float | None) -> str:
    return DASH if share is None else f"{plainly(100 * share, 2)} %"


def _residuals(result: Diagnosis, panels: list[figures.Panel]) -> dict[str, object]:
    """Each run with its panels and their numbers, the widest gap first."""
    worst = sorted(enumerate(panels), key=lambda item: -(item[1].gap_before or 0.0))
    return {
        "runs": [(i, run, [item for item in worst if item[1].run == i]) for i, run in enumerate(result.runs)],
        "widest": next(panel.run for _, panel in worst if result.runs[panel.run].role == "fit"),
        "band": figures.BAND,
        "run_title": run_title,
        "drawings": [
            Markup(draw(figures.overlay(panel, f"values-{i}")) + draw(figures.figure(panel, f"residual-{i}")))
            for i, panel in enumerate(panels)
        ],
    }


def _strip(over: figures.ResidualMap, strip: figures.Strip, side: str) -> Markup:
    cells = strip.before if side == "before" else strip.after
    label = escape(NOT_XML.sub("", f"{strip.title}, {side}: {figures.worst_cell(over, cells)}"))
    return Markup(figures.strip_svg(cells, str(label)))


def _legend() -> list[tuple[str, str]]:
    """Style and meaning of each colour of the map, from too low to too high."""
    edges = list(zip(figures.LEVELS, figures.LEVELS[1:], strict=False))
    low, high = [f"{MINUS}{b:g} to {MINUS}{a:g}" for a, b in edges], [f"{a:g} to {b:g}" for a, b in edges]
    low, high = [*low, f"below {MINUS}{figures.LEVELS[-1]:g}"], [*high, f"over {figures.LEVELS[-1]:g}"]
    shades = [(figures.shade_class(-k), low[k - 1]) for k in range(len(low), 0, -1)]
    shades.append((figures.shade_class(0), f"noise, below {figures.LEVELS[0]:g}"))
    return shades + [(figures.shade_class(k), text) for k, text in enumerate(high, start=1)]


def _data(result: Diagnosis, panels: list[figures.Panel], maps: list[figures.ResidualMap]) -> dict[str, object]:
    """What the scripts need: every sample once, and the cells of the maps."""
    over = {panel.run: panel for panel in panels}
    return {
        "colours": {"before": figures.BEFORE, "after": figures.AFTER},
        "band": figures.BAND,
        "runs": [
            {
                "x": over[i].over,
                "label": over[i].x.label,
                "unit": over[i].x.unit,
                "held": over[i].held_out,
                "held_out": run.held_out,
            }
            for i, run in enumerate(result.runs)
        ],
        "panels": [
            {
                "run": p.run,
                "title": p.title,
                "summary": p.summary,
                "unit": p.unit,
                "per": p.per,
                "half": 180 if p.quantity.angular else None,
                "label": p.quantity.label,
                "noise": p.noise,
                "measuredUnit": p.quantity.unit,
                "measured": p.measured,
                "before": p.before,
                "after": p.after,
            }
            for p in panels
        ],
        "maps": [
            {
                "unit": m.axis.unit,
                "label": m.axis.label,
                "low": m.low,
                "high": m.high,
                "strips": [{"title": f"{s.title}, {s.run}", "before": s.before, "after": s.after} for s in m.strips],
            }
            for m in maps
        ],
    }

"""The page of a diagnosis: one file that needs no network, verdict first."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import resources
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from compare.quantities import DASH, MINUS, assumptions
from compare.report import diagnosis_figures as figures
from compare.report import diagnosis_words as words
from compare.report import proposed
from compare.report.diagnosis_text import NOTHING_TRIED, SIGNS
from compare.report.explained import changes, without_null
from compare.report.pages import script_json
from compare.report.svg import NOT_XML, draw
from compare.results.diagnosis import DiagnosedRun, Diagnosis
from compare.results.document import as_written
from compare.results.places import located
from compare.results.sentences import (
    called,
    capital,
    in_units,
    off_by,
    phrase,
    plainly,
    small_errors,
    spoken,
    validation_sentences,
)

LOOKS = {
    "no gap": "agrees",
    "explained": "agrees",
    "partly explained": "known",
    "ambiguous": "known",
    "unexplained": "disagrees",
}
PLACES = 10  # located deviations that are listed before one has to ask for the rest
CANDIDATES = 12
STATUS = {
    "named": "named",
    "tied": "tied",
    "not needed": "not named",
    "not physical": "not physical",
    "invisible": "not visible in these data",
    "excluded": "ruled out",
}


def diagnosis_html(result: Diagnosis) -> str:
    """The page over a diagnosis."""
    nominal, explained = (as_written(mechanism) for mechanism in (result.mechanism, result.explained))
    panels, found = figures.panels(result), figures.maps(result)
    places = words.worst_first(result)
    candidates = sorted(result.candidates, key=lambda c: (c.status not in ("named", "tied"), -(c.sigmas or 0.0)))
    context = {
        "result": result,
        "look": LOOKS[result.verdict],
        "sign": SIGNS[result.verdict],
        "singles": [group for group in words.ties(result) if len(group) == 1],
        "tied": [group for group in words.ties(result) if len(group) > 1],
        "bars": words.waterfall(result),
        "sensors": in_units(result),
        "validation": validation_sentences(result),
        "attempts": words.attempts(result),
        "nothing_tried": NOTHING_TRIED,
        "proposed": [
            (
                p,
                proposed.sentences(result, p),
                proposed.numbers(p),
                Markup(draw(proposed.figure(result, p, f"law-{i}"))),
            )
            for i, p in enumerate(result.proposed)
        ],
        "proposal": proposed,
        "unsettled": words.unsettled(result),
        "words": words,
        "steps": [step for step in result.steps if step.title != "Result"],
        "maps": found,
        "cells": _strip,
        "legend": _legend(),
        "places": places,
        "listed": PLACES,
        "panels": panels,
        "runs": _runs(result, panels),
        "widest": max(
            (i for i, run in enumerate(result.runs) if run.role == "fit"),
            key=lambda i: max((p.gap_before or 0.0 for p in panels if p.run == i), default=0.0),
        ),
        "drawings": [
            Markup(draw(figures.overlay(panel, f"values-{i}")) + draw(figures.figure(panel, f"residual-{i}")))
            for i, panel in enumerate(panels)
        ],
        "candidates": candidates,
        "candidates_listed": CANDIDATES,
        "statuses": STATUS,
        "next_steps": words.next_steps(result),
        "mechanism": toml(nominal),
        "explained": toml(explained),
        "changes": changes(result),
        "settings": words.settings(result),
        "assumed": assumptions(result.assumed),
        "band": figures.BAND,
        "css": _static("report.css") + _static("diagnosis.css"),
        "scripts": _static("chart.js") + _static("diagnosis.js"),
        "data": script_json(_data(result, panels, found)),
    }
    return _environment(result).get_template("diagnosis.html.j2").render(context)


def toml(mechanism: Mapping[str, object]) -> str:
    """A mechanism as its file says it; what has no value is left out."""
    import tomli_w

    return tomli_w.dumps(without_null(mechanism))


def _runs(
    result: Diagnosis, panels: list[figures.Panel]
) -> list[tuple[int, DiagnosedRun, list[tuple[int, figures.Panel]]]]:
    """Each run with its panels and their numbers, the widest gap first."""
    numbered = list(enumerate(panels))
    worst = sorted(numbered, key=lambda item: -(item[1].gap_before or 0.0))
    return [(i, run, [item for item in worst if item[1].run == i]) for i, run in enumerate(result.runs)]


def _strip(found: figures.Map, strip: figures.Strip, side: str) -> Markup:
    cells = strip.before if side == "before" else strip.after
    label = escape(NOT_XML.sub("", f"{strip.title}, {side}: {figures.worst_cell(found, cells)}"))
    return Markup(figures.strip_svg(cells, str(label)))


def _legend() -> list[tuple[str, str]]:
    """Style and meaning of each colour of the map, from too low to too high."""
    edges = list(zip(figures.LEVELS, figures.LEVELS[1:], strict=False))
    low, high = [f"{MINUS}{b:g} to {MINUS}{a:g}" for a, b in edges], [f"{a:g} to {b:g}" for a, b in edges]
    low, high = [*low, f"below {MINUS}{figures.LEVELS[-1]:g}"], [*high, f"over {figures.LEVELS[-1]:g}"]
    shades = [(figures.shade_class(-k), low[k - 1]) for k in range(len(low), 0, -1)]
    shades.append((figures.shade_class(0), f"noise, below {figures.LEVELS[0]:g}"))
    return shades + [(figures.shade_class(k), text) for k, text in enumerate(high, start=1)]


def _data(result: Diagnosis, panels: list[figures.Panel], found: list[figures.Map]) -> dict[str, Any]:
    """What the scripts need: every sample once, and the cells of the maps."""
    over = {panel.run: panel for panel in panels}
    return {
        "colours": {"before": figures.BEFORE, "after": figures.AFTER},
        "band": figures.BAND,
        "runs": [
            (
                {
                    "x": over[i].over,
                    "label": over[i].x.label,
                    "unit": over[i].x.unit,
                    "held": over[i].held_out,
                    "held_out": run.held_out,
                }
                if i in over
                else None
            )
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
            for m in found
        ],
    }


def _environment(result: Diagnosis) -> Environment:
    environment = Environment(
        loader=PackageLoader("compare.report"), autoescape=True, undefined=StrictUndefined, keep_trailing_newline=True
    )
    environment.filters |= {
        "number": plainly,
        "percent": lambda share: DASH if share is None else f"{plainly(100 * share, 2)} %",
        "signed": lambda value: plainly(value, 3, True),
        "parameters": words.of_effect,
        "own": lambda effect: words.of_runs(result, effect),
        "small_errors": lambda effect: small_errors(result, effect),
        "headline": lambda effect: words.headline(result, effect),
        "rival": lambda group, effect: words.rival_words(result, group, effect),
        "phrase": lambda effect: phrase(result, effect.name, effect.where),
        "named": lambda key: called(result, key),
        "spoken": lambda signal: spoken(result, signal),
        "off": lambda value, signal: off_by(result, signal, value),
        "sentence": lambda place: located(result, place),
        "advice": words.advice,
        "remark": words.remark,
        "run_title": words.run_title,
        "simulated_by": words.simulated_by,
        "sigmas": lambda value: plainly(value, 2),
        "capital": capital,
    }
    return environment


def _static(name: str) -> Markup:
    return Markup(resources.files("compare.report").joinpath("static", name).read_text(encoding="utf-8"))

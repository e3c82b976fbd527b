"""The page of a linkage by itself: it moves, with its reactions, peaks, errors by joint and figures; no engine."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from markupsafe import Markup

from analytic.mechanism import Load, Mechanism
from analytic.mechanism.one_line import count
from compare.quantities import DASH, number, plain, quantities, shown
from compare.report.analysis_figures import ROLES, figures
from compare.report.figure import Figure, scaled
from compare.report.linkage import both_poses, exaggeration
from compare.report.linkage_page import ERRORS, linkage_page
from compare.report.mover import Column, Mover, Moving, Read, Side, gap, opens
from compare.report.moving_picture import moving_picture
from compare.report.peaks import (
    NOTHING,
    Acting,
    acting,
    effective,
    mean_torque,
    over,
    peaks,
    poor,
    strokes,
    transmission_angle,
    unanswered,
    unaveraged,
)
from compare.report.svg import draw
from compare.report.words import limits
from compare.results.analysis import Analysis

NOTE = (
    "An arrow is the force on the second body of its joint, the longest the largest of the motion; a red one is a load,"
    " and ends where it acts. The moving drawing is in linkage.svg, for a slide or a report."
)


def files(result: Analysis) -> dict[str, str]:
    """The page, its figures as drawings, the linkage as a drawing that moves, and every signal as a table."""
    shown_figures = figures(result)
    drawings = {figure.name: draw(figure) for figure in shown_figures}
    moving = moving_picture(result)
    texts = {"analysis.html": render(result, shown_figures, drawings, moving), "signals.csv": result.to_csv()}
    texts |= {"linkage.svg": moving} if moving else {}
    return texts | {f"{name}.svg": drawing for name, drawing in drawings.items()}


def render(result: Analysis, drawn: Sequence[Figure], drawings: dict[str, str], moving: str) -> str:
    """The page (HTML, self-contained)."""
    x, moved = over(result), _mover(result, Markup(moving)) if moving else None
    own = {
        "facts": _facts(result),
        "peaks": [each.row(x.unit) for each in peaks(result)],
        "flags": [(count(len(at), "sample"), x.at(at[0]), why) for at, why in unanswered(result)],
    }
    about = "reactions, torque and motion"
    return linkage_page(result, about, own, ("analysis/peaks.html.j2", ERRORS), drawn, drawings, moved)


def _facts(result: Analysis) -> dict[str, str]:
    """What the page is about, in a line."""
    m, x = result.mechanism, over(result)
    speed = f"{number(m.speed * 30 / np.pi, 4)} rpm ({number(m.speed, 4)} rad/s)" if m.speed else DASH
    sizes = ", ".join(f"{joint} {plain(1e3 * size)} mm" for joint, size in result.clearance.items())
    facts = {"Speed of the crank": speed} if m.speed and result.motion == "driven" else {}
    facts["Motion"] = "in motion, with inertia forces" if result.motion == "driven" else "at rest in each position"
    facts[x.label.capitalize()] = f"{plain(x.values[0], 4)} to {x.at(-1)}, {count(len(x.values), 'sample')}"
    facts["Radial clearance"] = sizes or "none"
    mean = mean_torque(result)
    if m.speed and mean is not None:
        work = mean * 2 * np.pi * np.sign(m.speed)
        facts["Mean power of the drive"] = f"{number(mean * m.speed, 4)} W, {number(work, 4)} J a turn"
    facts |= {f"RMS of {q.label}": f"{number(rms, 4)} {q.unit}" for q, rms in effective(result)}
    facts |= {f"Mean and RMS of {q.label}": why for q, why in unaveraged(result)}
    facts |= {f"Stroke of {joint}": stroke for joint, stroke in strokes(result)}
    angle = transmission_angle(result)
    if angle is not None and np.nanmin(angle) < 89.9:
        at = int(np.nanargmin(angle))
        below = f"; below 40 deg at {poor(result)}" if poor(result) else ""
        facts["Least transmission angle"] = f"{number(float(angle[at]), 3)} deg at {x.at(at)}{below}"
    return facts | limits.facts(result)


def _mover(result: Analysis, still: Markup) -> Mover:
    """The linkage in motion, with its reactions and loads; ``still`` is for who runs no script."""
    m, x = result.mechanism, over(result)
    ideal, displaced = both_poses(result)
    forces = {
        joint.name: {
            "x": scaled(result.signals[f"reaction_{joint.name}_x"]),
            "y": scaled(result.signals[f"reaction_{joint.name}_y"]),
            "role": ROLES[k % len(ROLES)],
        }
        for k, joint in enumerate(m.joints)
        if f"reaction_{joint.name}_x" in result.signals
    }
    sizes = [result.signals[f"reaction_{name}_magnitude"] for name in forces]
    loads = [{"body": each.load.body, "point": _arm(m, each.load)} | _pushes(each) for each in acting(result)]
    run = Moving(
        over=x,
        opens=opens(x),
        factor=exaggeration(m, result),
        clearance=dict(result.clearance),
        flags=dict(result.flags),
        ideal=ideal or displaced,
        sides=[Side("analytic", "with clearance" if result.clearance else "", "analytic", displaced)],
        columns=(Column("Value", "", 4),),
        readout=_readout(result),
        gaps={j: [gap(result.signals, j)] for j in result.clearance if f"clearance_{j}_x" in result.signals},
        forces=forces,
        loads=loads,
        largest=max((float(np.nanmax(size, initial=0.0)) for size in sizes), default=0.0) or 1.0,
    )
    boxes = {"forces": "reactions and loads", "paths": "paths of the joints"}
    boxes |= {"ideal": "linkage without clearance"} if result.clearance else {}
    return Mover(m, {result.case: run}, boxes, still, NOTE)


def _pushes(acts: Acting) -> dict[str, object]:
    """A force (N) by its components, a torque by its share of its largest size."""
    if acts.unit == "N":
        return {"x": scaled((acts.size * acts.way).real), "y": scaled((acts.size * acts.way).imag)}
    return {"turn": scaled(acts.size / max(np.nanmax(np.abs(acts.size)), NOTHING))}


def _arm(m: Mechanism, load: Load) -> list[float]:
    """Where (m) a force acts, from its body's marker, in the body's frame."""
    body = m.moving[load.body]
    arm = body.point(load.point) - body.point("com")
    return [arm.real, arm.imag]


def _readout(result: Analysis) -> list[Read]:
    """What the page lists at each sample: size and direction of each reaction, the drive, angles and slides."""
    known = quantities(result.mechanism)
    first = [each.quantity.signal for each in peaks(result)]
    names = [n for s in first for n in (s, s.replace("_magnitude", "_angle")) if n in result.signals]
    listed = [known[name] for name in dict.fromkeys(names)]
    return [Read(q.label, q.unit, [scaled(q.factor * _within(result.signals[q.signal], q.unit))]) for q in listed]


def _within(values: np.ndarray, unit: str) -> np.ndarray:
    """Angles (N,) rad in (-pi, pi], all else as it is."""
    return np.angle(np.exp(1j * values)) if unit == shown("rad")[0] else values

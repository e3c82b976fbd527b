"""Figures of contact: where a pin or block went and how hard it pressed, over a turn and once a revolution."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from analytic.mechanism import GROUND, Mechanism
from compare.quantities import number
from compare.report.crosscheck_figures import clearance_circle, simulators
from compare.report.figure import Axis, Figure, Numbers, Series, extreme, scaled
from compare.report.summary import REAL
from compare.report.words.contact import MEASURES
from compare.results.contact import LEAST_FORCE, JointContact, Orbit
from compare.results.crosscheck import CrossCheck, Run
from sim_models.common.guide import Guide

ENGINE_COLOURS = ("contact", "massless-link", "spring-damper", "ideal")  # the engines share a joint model here
COLOUR_QUANTILES = (0.5, 0.8, 0.95)  # of the forces of a path, at which its colours change
CRANK = Axis("crank angle θ₂", "deg")
PIN_AXES = (Axis("displacement x", "mm"), Axis("displacement y", "mm"))
GUIDE_AXES = (Axis("height across the guide", "mm"), Axis("tilt times half length", "mm"))


def contact_figures(result: CrossCheck) -> list[Figure]:
    """Four figures for each joint whose pin or block leaves its wall in a run: path by force, force, regimes, section;
    of the runs with the most real joints.
    """
    striking = [run for run in result.runs if run.contact is not None and run.contact.struck]
    joints = dict.fromkeys(name for run in striking if run.contact for name in run.contact.joints)
    return [figure for joint in joints for figure in _of(result, striking, joint)]


def _of(result: CrossCheck, striking: list[Run], joint: str) -> Iterator[Figure]:
    runs = [(run, contact) for run in striking if run.contact and (contact := run.contact.joints.get(joint))]
    runs = [(run, contact) for run, contact in runs if contact.first_impact is not None]
    if not runs:
        return
    first, contact = min(runs, key=lambda one: REAL.index(one[0].joint_model))
    runs = [(run, one) for run, one in runs if run.joint_model == first.joint_model]
    yield orbit(first, result.mechanism, joint, contact.orbit)
    yield force(result, runs, joint)
    yield regimes(result, runs, joint)
    yield section(result, runs, joint)


def part(mechanism: Mechanism, joint: str) -> str:
    """What has clearance in a joint."""
    return "block" if mechanism.joint(joint).prismatic else "pin"


def wall(mechanism: Mechanism, joint: str, clearance: float) -> tuple[tuple[Axis, Axis], Series]:
    """The plane in which a pin or block moves, and where it comes to its wall with a ``clearance`` (mm)."""
    if part(mechanism, joint) == "pin":
        return PIN_AXES, clearance_circle(clearance)
    heights, tilts = ([clearance * way for way in ways] for ways in ((1, 0, -1, 0, 1), (0, 1, 0, -1, 0)))
    return GUIDE_AXES, Series("a corner at its wall", scaled(heights), scaled(tilts), "frame")


def orbit(run: Run, mechanism: Mechanism, joint: str, path: Orbit) -> Figure:
    """The last revolution of a pin in its bearing, or a block in its guide, in colours by the force there."""
    edges, largest = bands(path.force), float(np.max(path.force, initial=0.0))
    pressed = path.force > LEAST_FORCE * largest
    level = np.where(pressed, 1 + np.digitize(path.force, edges), 0)
    level = np.maximum(level[:-1], level[1:])  # of each piece of the path
    read = MEASURES["peak_force"].fitting(largest)
    ends = [number(read.read(edge), 4) for edge in (*edges, float(f"{largest:.2g}"))]
    names = ["without force", f"below {ends[0]} {read.unit}"]
    names += [f"{a} to {b} {read.unit}" for a, b in pairwise(ends)]
    shown = [
        Series(name, *_pieces(path, level == k), "free" if k == 0 else f"force-{k}")
        for k, name in enumerate(names)
        if np.any(level == k)
    ]
    title = f"Last revolution of the {part(mechanism, joint)} in {joint}, by force"
    text = f"{title}, {run.title}, up to {number(largest)} N."
    axes, rim = wall(mechanism, joint, 1e3 * run.clearance[joint])
    return Figure(f"orbit_{joint}", title, text, *axes, (rim, *shown), "plane", f"Of {run.title}.")


def bands(force: np.ndarray) -> list[float]:
    """Forces (N), to two digits and growing, at which the colours of a path change."""
    pressed = force[force > LEAST_FORCE * np.max(force, initial=0.0)]
    if not pressed.size:
        return []
    return sorted({float(f"{value:.2g}") for value in np.quantile(pressed, COLOUR_QUANTILES)} - {0.0})


def _pieces(path: Orbit, chosen: np.ndarray) -> tuple[Numbers, Numbers]:
    """The chosen pieces (n - 1,) of a path of n points in mm, None between those that do not follow each other."""
    ends = np.concatenate([[False], chosen]) | np.concatenate([chosen, [False]])
    gone = ends & ~np.concatenate([chosen, [False]])  # the last point of a piece that ends
    order = np.flatnonzero(ends)
    xs, ys = [], []
    for k in order.tolist():
        xs.append(float(path.x[k]))
        ys.append(float(path.y[k]))
        if gone[k]:
            xs.append(math.nan)
            ys.append(math.nan)
    return scaled(xs, 1e3), scaled(ys, 1e3)


def role(result: CrossCheck, run: Run) -> str:
    """The colour of an engine."""
    return ENGINE_COLOURS[simulators(result).index(run.simulator.name) % len(ENGINE_COLOURS)]


def force(result: CrossCheck, runs: list[tuple[Run, JointContact]], joint: str) -> Figure:
    """Contact force over the crank angle: each run's mean, the band of 5 to 95 % of the time of the first, and the
    analytic reaction; of a block, the force on the corner that is pressed most.
    """
    first, profile = runs[0][0], runs[0][1].profile
    known = np.isfinite(profile.low_force) & np.isfinite(profile.high_force)
    x = np.degrees(profile.crank_angle[known])
    edge = np.concatenate([x, x[::-1]])
    high_low = np.concatenate([profile.high_force[known], profile.low_force[known][::-1]])
    name = f"5 to 95 % of the time, {first.title}"
    band = Series(name, scaled(edge), scaled(high_low), role(result, first), "band")
    means = [
        Series(f"mean, {run.title}", _degrees(one), scaled(one.profile.mean_force), role(result, run))
        for run, one in runs
    ]
    reaction = analytic_force(result.mechanism, first, joint)
    turn = np.mod(np.degrees(first.crank_angle), 360.0)
    order = np.argsort(turn)
    analytic = Series(
        f"analytic, {first.analytic_model.replace('_', ' ')}",
        scaled(turn[order]),
        () if reaction is None else scaled(reaction[order]),
        "analytic",
    )
    blocks = part(result.mechanism, joint) == "block"
    title = f"Largest contact force on a corner in {joint}" if blocks else f"Contact force in {joint}"
    said = [f"{s.name} up to {extreme(s.y)} N" for s in means]
    text = f"{title} over the crank angle, all revolutions together: {'; '.join(said)}."
    series = (band, *means, *([analytic] if analytic.y else []))
    note = "All revolutions together; the analytic side has no answer where its line is broken."
    return Figure(f"contact_force_{joint}", title, text, CRANK, Axis("force", "N"), series, note=note)


def analytic_force(mechanism: Mechanism, run: Run, joint: str) -> np.ndarray | None:
    """The analytic side's contact force (N,) N in a joint: the reaction's size, of a block what it and its moment put
    on a corner; None where it is not told.
    """
    known, loose = run.analytic, mechanism.joint(joint)
    if not loose.prismatic:
        return known.get(f"reaction_{joint}_magnitude")
    guide, first = Guide.of(loose.model_copy(update={"clearance": run.clearance[joint]})), loose.bodies[0]
    if guide is None or f"reaction_{joint}_moment" not in known:
        return None
    turned = 0.0 if first == GROUND else known[f"{first}_angle"]
    force = known[f"reaction_{joint}_x"] + 1j * known[f"reaction_{joint}_y"]
    pushed = force * np.exp(-1j * turned) / loose.direction  # along the guide, and across
    walls = known[f"reaction_{joint}_moment"]
    if run.joint_model == "contact":  # friction's moment is not theirs
        walls = walls - np.sign(pushed.real) * loose.friction * guide.height / 2 * pushed.imag
    return guide.hardest(pushed.imag, walls)


def _degrees(one: JointContact) -> Numbers:
    return scaled(np.degrees(one.profile.crank_angle))


def regimes(result: CrossCheck, runs: list[tuple[Run, JointContact]], joint: str) -> Figure:
    """When a pin or block is off its wall (lines), and when it strikes (marks), over the crank angle."""
    series = []
    for run, one in runs:
        struck = np.where(one.profile.impacts > 0, one.profile.impacts, np.nan)
        colour, free = role(result, run), scaled(one.profile.free_share, 100.0)
        series.append(Series(f"free, {run.title}", _degrees(one), free, colour))
        series.append(Series(f"impacts, {run.title}", _degrees(one), scaled(struck, 100.0), colour, "marker"))
    step = 360.0 / runs[0][1].profile.crank_angle.size
    loose = part(result.mechanism, joint)
    title = f"When the {loose} in {joint} is free, and when it strikes"
    text = f"{title}, over the crank angle: share of the time, and impacts in each {step:g} deg of 100 revolutions."
    note = f"Lines: share of the time that the {loose} is off its wall."
    note = f"{note} Marks: impacts in {step:g} deg, of 100 revolutions."
    return Figure(
        f"regimes_{joint}", title, text, CRANK, Axis("free; impacts in 100 revolutions", "%"), tuple(series), note=note
    )


def section(result: CrossCheck, runs: list[tuple[Run, JointContact]], joint: str) -> Figure:
    """Where a pin or block is once a revolution: few points where its motion repeats itself, a cloud where it is
    chaotic.
    """
    points = [
        Series(run.title, scaled(one.section.x, 1e3), scaled(one.section.y, 1e3), role(result, run), "marker")
        for run, one in runs
    ]
    at = number(math.degrees(float(runs[0][0].crank_angle[0])), 4)
    title = f"The {part(result.mechanism, joint)} in {joint} once a revolution"
    text = f"{title}, at {at} deg of the crank: {', '.join(f'{s.name} {len(s.x)} points' for s in points)}."
    note = f"At {at} deg of the crank. A motion that repeats itself has few places, a chaotic one has many."
    axes, rim = wall(result.mechanism, joint, 1e3 * runs[0][0].clearance[joint])
    return Figure(f"section_{joint}", title, text, *axes, (rim, *points), "plane", note)

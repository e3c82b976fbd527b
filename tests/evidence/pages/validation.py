"""The validation report as a page, of validation.json and nothing else."""

from __future__ import annotations

import html
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from rich.console import Console

from analytic.mechanism.one_line import count
from compare.report.crosscheck_figures import reaction_directions
from compare.report.curves import legend
from compare.report.linkage import linkage_figure
from compare.report.summary import summarise
from compare.report.svg import draw
from compare.results.crosscheck import CrossCheck
from tests.evidence.pages.striking import striking
from tests.evidence.published.after_impact import AS_THEY_STEP, KINDS, NEARBY, PUBLISHED, SICONOS
from tests.evidence.results.validation import (
    AtScale,
    Bent,
    Carried,
    Ended,
    Held,
    InEngine,
    OverWorkspace,
    Published,
    Span,
    Superposed,
    Timed,
    Validation,
    ValidationRun,
)
from tests.evidence.validation.scales import CLEARANCE, EVERY
from tests.evidence.validation.workspaces import CLEARANCE as LOOSE

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def files(result: Validation) -> dict[str, str]:
    """The page, and the figures of those cases whose cross-checks are at hand."""
    figures = {
        f"figures/{case}-{name}.svg": drawing
        for case, check in result.checks.items()
        for name, drawing in drawn(check).items()
    }
    return figures | {"README.md": page(result)}


def drawn(result: CrossCheck) -> dict[str, str]:
    """SVG drawings of a result: the linkage, and the reaction directions at its first joint with clearance."""
    summary = summarise(result)
    linkage = linkage_figure(result)
    gamma = {"gamma": draw(reaction_directions(summary, summary.joints[0]))}
    return gamma | ({"linkage": draw(linkage)} if linkage else {})


def print_table(result: Validation, console: Console) -> None:
    """Print how many runs there are."""
    console.print(count(len(result.runs), "run"), highlight=False)


def summary_html(result: Validation) -> str:
    """How many runs of each case agree in each engine."""
    engines = list(dict.fromkeys(run.simulator for run in result.runs))
    out = []
    for case in dict.fromkeys(run.case for run in result.runs):
        cells = []
        for engine in engines:
            mine = [run for run in result.runs if (run.case, run.simulator) == (case, engine)]
            cells.append(f"<td>{sum(run.verdict == 'agrees' for run in mine)} of {len(mine)}</td>")
        out.append(f"<tr><th>{html.escape(case)}</th>{''.join(cells)}</tr>")
    head = "".join(f"<th>{html.escape(engine)}</th>" for engine in engines)
    return f"<p>{html.escape(repr(result))}</p><table><tr><th>agree</th>{head}</tr>{''.join(out)}</table>"


def plot(result: Validation, figure: Figure) -> None:
    """The largest share of a tolerance of each run that was compared, by engine."""
    axis = figure.subplots()
    for engine in dict.fromkeys(run.simulator for run in result.runs):
        mine = [run for run in result.runs if run.simulator == engine and run.compared]
        axis.plot([100 * run.share for run in mine], [f"{run.case}, {run.run}" for run in mine], "o", label=engine)
    axis.set_xlabel("largest share of a tolerance (%)")
    axis.set_xscale("log")
    axis.tick_params(axis="y", labelsize="x-small")
    legend(axis)


def page(found: Validation) -> str:
    """The report as Markdown."""
    agree = sum(run.verdict == "agrees" for run in found.runs)
    cases = list(dict.fromkeys(run.case for run in found.runs))
    lines = [
        "# Validation report",
        "",
        f"{agree} of {count(len(found.runs), 'run')} {'agrees' if agree == 1 else 'agree'} with the analytic"
        " `equilibrium` within `compare/judge/tolerances.toml`. Engines: "
        + ", ".join(f"{name} {version}" for name, version in found.versions.items())
        + ". Written by `python -m tests.evidence validation update`; CI makes every run again with"
        " `python -m tests.evidence validation check`, and holds each reaction force to `reports/baselines/` with"
        " `compare baseline check`.",
        "",
        (
            "Each run has its engine's verdict and the largest share of a tolerance that any of its signals uses up."
            " Ideal joints are"
        ),
        (
            "driven; joints with clearance rest in equilibrium under load, or move with their drives where there are"
            " several"
        ),
        "(`compare/baseline/runs.py` says which clearance and load).",
    ]
    for case in cases:
        lines += ["", f"## {case}", "", *_table([run for run in found.runs if run.case == case])]
        lines += [
            "",
            f"![{case}: ideal and displaced by clearance](figures/{case}-linkage.svg)",
            f"![{case}: directions of the reaction](figures/{case}-gamma.svg)",
        ]
    lines += ["", "## At every scale", "", *_scales(found.scales)]
    lines += [
        "",
        "## How far the paper's Eq. 8 is off",
        "",
        "| clearance in B of the paper's case | direction | size |",
        "|---|--:|--:|",
    ]
    lines += [
        f"| {1000 * r.clearance:g} mm | {r.angle:.2g} deg | {100 * r.magnitude:.2g} % |" for r in found.first_order
    ]
    lines += ["", "## How far Eq. 8 is off over a workspace", "", *_workspaces(found.workspaces)]
    if found.in_engines:
        lines += ["", *_in_engines(found.in_engines)]
    for title, text in _sections(found):
        lines += ["", *title, *text]
    return "\n".join(lines) + "\n"


def _sections(found: Validation) -> Iterator[tuple[tuple[str, ...], Iterator[str]]]:
    """The parts that a report may lack: headings and text."""
    if found.superposition:
        yield ("## How good superposition is (Fig. 7c)", ""), _superposed(found.superposition)
    if found.bent:
        yield (), _bent(found.bent)
    if found.carried:
        yield ("## What files carry of linkages with several drives", ""), _carried(found.carried)
    yield from striking(found)
    if found.published:
        yield ("## Held to what others found", ""), _published(found.published)
    if found.ended:
        yield ("### The block in its guide after its first impact", ""), _ended(found.ended)
    if found.speed:
        yield ("## How fast it is", ""), _timed(found.speed)


def _workspaces(rows: Mapping[str, Sequence[OverWorkspace]]) -> Iterator[str]:
    yield (
        f"Platforms at rest over a grid of 41 x 41 places, {1000 * LOOSE:g} mm in every pin: Eq. 8 against the"
        " self-consistent equilibrium, as"
    )
    yield (
        "a share of the displacement in equilibrium. Poses count up to a condition number of the loops: towards a"
        " singular pose"
    )
    yield "displacements grow, and so does what first order leaves out. `compare accuracy --workspace` draws the maps."
    yield ""
    yield "| platform | condition up to | poses | moved by at most | by any directions | Eq. 8 off: median | worst |"
    yield "|---|--:|--:|--:|--:|--:|--:|"
    for case, mine in rows.items():
        for r in mine:
            yield (
                f"| {case} | {r.holding:g} | {r.poses} | {1000 * r.displacement:.2f} mm | {1000 * r.farthest:.2f} mm"
                f" | {100 * r.first_order:.2g} % | {100 * r.first_order_worst:.2g} % |"
            )


def _in_engines(rows: Mapping[str, Sequence[InEngine]]) -> Iterator[str]:
    yield (
        "Real contact in every pin, in each engine that has it with several drives, along a spiral from where the"
        " platform is"
    )
    yield (
        "assembled (out to 50 or 60 mm): driven slowly (6 s), and at rest in poses of it. Told is what the analytic"
        " side is off the"
    )
    yield (
        "engine, as a share of the displacement. In motion pins without friction swing for a while where a reaction"
        " passes near zero."
    )
    yield "Exudyn's contact, and at rest MuJoCo's, yields by force over its stiffness."
    yield "`python -m tests.evidence validation check` makes the first platform again."
    yield ""
    yield "| platform | engine | poses | equilibrium off: median | worst | Eq. 8 off: median | worst | flying |"
    yield "|---|---|--:|--:|--:|--:|--:|--:|"
    for case, mine in rows.items():
        for r in mine:
            shares = (r.equilibrium, r.equilibrium_worst, r.first_order, r.first_order_worst, r.flies)
            cells = " | ".join(f"{100 * share:.2g} %" for share in shares)
            yield f"| {case} | {r.simulator}, {r.motion} | {r.poses} | {cells} |"


def _published(sources: Sequence[Published]) -> Iterator[str]:
    yield "Each row is off by the largest difference of any value that it stands for from the published one, in the"
    yield "unit that is given. Without a unit that is a share; the row or the text above it says of what."
    yield "`python -m tests.evidence validation check --data DIR` makes all but the diagnosis again, where DIR has the"
    yield "files."
    yield ""
    for k, source in enumerate(sources):
        yield from ([""] if k else [])
        yield f"**{source.name}.** {source.says}"
        yield ""
        yield "| figure | published | by | off | allowed |"
        yield "|---|--:|---|--:|--:|"
        for held in source.figures:
            for apart in held.apart:
                off, allowed = (f"{value:.2g} {held.unit}".strip() for value in (apart.off, apart.allowed))
                yield f"| {held.figure} | {_size(held)} | {apart.side} | {off} | {allowed} |"


def _ended(rows: Sequence[Ended]) -> Iterator[str]:
    theirs = [row for row in rows if row.by.startswith(PUBLISHED)]
    yield "Flores, Leine and Glocker's slider-crank again, with friction 0.01, to 0.2 s: from one start, or from many"
    yield f"that differ by some {NEARBY:g} rad in each angle and by a share of some {NEARBY:g} in each rate. A cell is"
    yield "the range of where these end. Energy gained is a share of the energy at the start; nothing in the mechanism"
    yield "gives any."
    if theirs:
        touched, least, most = (f"{100 * value:.2g} %" for value in _gained(theirs))
        yield ""
        yield f"- The published runs gain {touched} before anything is touched and {least} to {most} by the end, by"
        yield "  their steps of 0.1 ms."
        yield from _beside_published(rows)
        yield "- Finer steps of that kind tend, in turns and rates, to where steps that keep energy, walls that give"
        yield "  and engines' own contact end. The published turns and rates are outside the range of all of these:"
        yield "  only steps of the published kind and size end near them."
        free = [row.free for row in rows if not row.by.startswith((PUBLISHED, SICONOS, AS_THEY_STEP))]
        if free:
            low, high = (f"{100 * value:.3g}" for value in (min(s.low for s in free), max(s.high for s in free)))
            yield f"- Free shares do not tend to one value as turns and rates do: without those steps they are {low} to"
            yield f"  {high} %."
    yield ""
    yield (
        "| by | step | starts | turns of the crank | its rate (rad/s) | the rod's (rad/s) | free share (%)"
        " | energy gained (%): before a touch | by the end |"
    )
    yield "|---|--:|--:|--:|--:|--:|--:|--:|--:|"
    for row in rows:
        spans = (row.turns, 1.0, 4), (row.crank, 1.0, 4), (row.rod, 1.0, 4), (row.free, 100.0, 3)
        cells = [_span(*each) for each in (*spans, (row.touched, 100.0, 2), (row.gained, 100.0, 2))]
        yield f"| {row.by} | {1e3 * row.step:g} ms | {row.starts} | {' | '.join(cells)} |"


def _beside_published(rows: Sequence[Ended]) -> Iterator[str]:
    """Where Siconos ends here, and where its published run of the same kind did."""
    ends = {row.by: row for row in rows}
    for kind in KINDS:
        here, there = ends.get(f"{SICONOS}, {kind}"), ends.get(f"{PUBLISHED}, {kind}")
        if here and there:
            yield f"- Siconos itself, *{kind}*, ends here at {_rates(here)};"
            yield f"  published are {_rates(there)}."


def _rates(row: Ended) -> str:
    """The rates and the share of free time at the end."""
    crank, rod, free = _span(row.crank, 1.0, 4), _span(row.rod, 1.0, 4), _span(row.free, 100.0, 3)
    return f"{crank} rad/s of the crank, {rod} rad/s of the rod and {free} % free"


def _gained(rows: Sequence[Ended]) -> tuple[float, float, float]:
    """Energy gained: the most up to the first touch, the least and the most by the end."""
    return max(r.touched.high for r in rows), min(r.gained.low for r in rows), max(r.gained.high for r in rows)


def _span(span: Span, factor: float, digits: int) -> str:
    """From and to, to so many digits and at most three decimals."""
    low, high = (f"{float(f'{round(factor * x, 3):.{digits}g}') + 0.0:g}" for x in (span.low, span.high))
    return low if low == high else f"{low} to {high}"


def _timed(rows: Sequence[Timed]) -> Iterator[str]:
    yield "In one run on the machine that wrote this report, each the best of fifteen calls;"
    yield "`python -m tests.evidence validation check` does not make them again."
    yield "More, and against what: [benchmarks](../docs/benchmarks.md)."
    yield ""
    yield "| what | measured | wanted, at most |"
    yield "|---|--:|--:|"
    for row in rows:
        measured, wanted = (
            "" if value is None else f"{value:g} {row.unit}" if row.unit else f"x {value:g}"
            for value in (row.value, row.wanted)
        )
        yield f"| {row.what} | {measured} | {wanted} |"


def _size(held: Held) -> str:
    """What was published; nothing of shares."""
    return f"{held.published:g} {held.unit}" if held.unit else ""


def _superposed(rows: Sequence[Superposed]) -> Iterator[str]:
    yield (
        "Clearance and compliance added up, against Exudyn's Euler-Bernoulli beams with a real journal in its bearing,"
        " at 50 N: largest"
    )
    yield (
        "error of a pin's or the coupler's middle's displacement over the largest displacement, with `equilibrium` /"
        " with `first_order`"
    )
    yield "(Eq. 8). Without clearance what is left is geometric nonlinearity: at 0.5 N it is a hundred times smaller."
    yield ""
    angles = [math.degrees(angle) for angle in dict.fromkeys(row.crank_angle for row in rows)]
    yield "| clearance in B | " + " | ".join(f"{angle:g} deg" for angle in angles) + " |"
    yield "|---|" + "---|" * len(angles)
    for gap in dict.fromkeys(row.clearance for row in rows):
        cells = [f"{100 * r.equilibrium:.2f} / {100 * r.first_order:.2f} %" for r in rows if r.clearance == gap]
        yield f"| {1000 * gap:g} mm | " + " | ".join(cells) + " |"


def _bent(rows: Sequence[Bent]) -> Iterator[str]:
    yield (
        "The same for platforms at rest under their own loads, at poses along a spiral, ideal or with"
        f" {1000 * LOOSE:g} mm of real contact in"
    )
    yield "every pin: what superposition is off, as a share of the displacement of the platform's centre."
    yield ""
    yield "| platform | joints | poses | moved by at most | off: median | worst |"
    yield "|---|---|--:|--:|--:|--:|"
    for r in rows:
        shares = f"{100 * r.off:.2g} % | {100 * r.off_worst:.2g} %"
        yield f"| {r.case} | {r.joints} | {r.poses} | {1000 * r.displacement:.2g} mm | {shares} |"


def _carried(rows: Sequence[Carried]) -> Iterator[str]:
    yield (
        "Each is exported; its script runs without this project, and what it writes is held to the run here (largest"
        " difference, as a"
    )
    yield (
        "share of the largest value) and, by `compare check`, to the analytic model (largest share of a tolerance)."
        " MuJoCo's file is also"
    )
    yield (
        "imported: how far its reactions and drives are off the exported linkage's, and what the file, run as `mjcf:`,"
        " uses of a tolerance."
    )
    yield "Effects that are hidden in such linkages, and found again: [scoreboard](scoreboard/README.md)."
    yield ""
    yield "| linkage | model of | run alone: off | checked | imported: off | run as mjcf |"
    yield "|---|---|--:|--:|--:|--:|"
    for r in rows:
        off = ["" if x is None else f"{x:.0e}" for x in (r.alone, r.imported)]
        of = ["" if x is None else f"{100 * x:.2g} %" for x in (r.checked, r.simulated)]
        yield f"| {r.case} | {r.simulator} | {off[0]} | {of[0]} | {off[1]} | {of[1]} |"


def _scales(rows: Sequence[AtScale]) -> Iterator[str]:
    """A table for each engine: its joint models over the scales; below it, what it said where it refused."""
    yield (
        "The crank-rocker of steel at every size, lifting its weight and a torque that presses its pins; radial"
        f" clearance in B is {CLEARANCE:g}"
    )
    yield (
        "of its coupler. Scales are the coupler's length, the crank's speed, and the coupler's mass relative to a steel"
        " bar's. A cell says, for"
    )
    yield "driven / static motion, whether the run agrees, or by a letter why it was refused."
    yield f"`python -m tests.evidence validation check` makes every {EVERY}th scale again."
    for engine in dict.fromkeys(row.simulator for row in rows):
        mine = [row for row in rows if row.simulator == engine]
        reasons = {why: chr(ord("a") + k) for k, why in enumerate(sorted({reason(row) for row in mine} - {""}))}
        models = list(dict.fromkeys(row.run.split(", ")[0] for row in mine))
        yield ""
        yield f"| {engine} | " + " | ".join(models) + " |"
        yield "|---|" + "---|" * len(models)
        for key in dict.fromkeys(row.scale for row in mine):
            said = {row.run: reasons.get(reason(row), row.verdict) for row in mine if row.scale == key}
            cells = (
                " / ".join(said.get(f"{model}, {motion}", "-") for motion in ("driven", "static")) for model in models
            )
            yield f"| {key[0]:g} m, {key[1]:g} rad/s, {key[2]:g} | " + " | ".join(cells) + " |"
        yield ""
        yield from (f"- {letter}: {why}" for why, letter in reasons.items())


def reason(row: AtScale) -> str:
    """Why a run at a scale was refused, in words of its cause; empty where it was not."""
    if row.verdict != "refused":
        return ""
    return row.cause.words if row.cause is not None else "it failed"


def _table(runs: Sequence[ValidationRun]) -> Iterator[str]:
    engines = list(dict.fromkeys(run.simulator for run in runs))
    yield "| run | " + " | ".join(engines) + " |"
    yield "|---|" + "---|" * len(engines)
    for name in dict.fromkeys(run.run for run in runs):
        cells = {run.simulator: _cell(run) for run in runs if run.run == name}
        yield f"| {name} | " + " | ".join(cells.get(engine, "not supported") for engine in engines) + " |"


def _cell(run: ValidationRun) -> str:
    return f"{run.verdict}, at most {100 * run.share:g} % ({run.closest})" if run.compared else run.verdict

"""The board, shown: its page reports/scoreboard/README.md and its figure."""

from __future__ import annotations

import html
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from statistics import fmean, median
from typing import TYPE_CHECKING, get_args

from rich.console import Console

from analytic.mechanism.one_line import count
from compare.report.curves import legend
from compare.report.figure import Axis, Figure, Series
from compare.report.svg import draw
from tests.evidence.results.scoreboard import Claim, Hidden, Kind, Scoreboard, Scored, Threshold, Value, relative_errors
from tests.evidence.scoreboard.board import wilson
from tests.evidence.scoreboard.hidden import MANY
from tests.evidence.scoreboard.rattling import BANDS
from tests.evidence.scoreboard.score import DISTINCT, NAMED, NAMELESS, RATTLING, closed

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Plotted

ORDER = ("exact", "tie", "clear", "abstained", "partly", "incomplete", "missed", "wrong", "false alarm", "failed")
MARKS = {
    "exact": "analytic",
    "tie": "massless-link",
    "short of it": "spring-damper",
    "wrong": "contact",
}  # a role of the figures' style each


def files(result: Scoreboard) -> dict[str, str]:
    """The page and its figures."""
    figures = {"sizes.svg": draw(figure(result.results))}
    if claims := [claim for r in result.results for claim in r.claims]:
        figures["reliability.svg"] = draw(reliability_figure(claims))
    return {**figures, "README.md": page(result)}


def print_table(result: Scoreboard, console: Console) -> None:
    """Print how many sets there are, and the thresholds that they miss."""
    for row in result.missed:
        console.print(f"missed: {row.what}: {row.count} of {row.of}", soft_wrap=True, highlight=False)
    other = len(result.results) - sum(result.codes.get(result.code, {}).values()) if result.codes else 0
    if other:
        console.print(f"{count(other, 'set')} as other code left them", soft_wrap=True, highlight=False)
    thresholds = f"{len(result.missed)} of {count(len(result.thresholds), 'threshold')} missed"
    console.print(f"{count(len(result.results), 'set')}, {thresholds}", soft_wrap=True, highlight=False)


def summary_html(result: Scoreboard) -> str:
    """What is asked, and how far it is met."""
    cells = ((row.what, f"{row.count} of {row.of}", "yes" if row.met else "NO") for row in result.thresholds)
    rows = "".join("<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in cells)
    head = "<tr><th>what is asked</th><th>sets</th><th>met</th></tr>"
    return f"<p>{html.escape(repr(result))}</p><table>{head}{rows}</table>"


def plot(result: Scoreboard, figure: Plotted) -> None:
    """Every set with effects: sigmas of its least distinct one's signature, and what the best rival leaves of it."""
    axis = figure.subplots()
    groups: dict[str, list[Hidden]] = {}
    for r in result.results:
        if r.truth:
            groups.setdefault(r.outcome, []).append(min(r.truth, key=lambda e: e.distinct))
    for name, found in groups.items():
        axis.plot([e.total for e in found], [e.distinct for e in found], ".", label=name)
    axis.axhline(DISTINCT, color="0.5", linestyle="--")
    axis.set_xscale("log")
    axis.set_yscale("symlog")
    axis.set_xlabel("signature of the least distinct effect (sigmas)")
    axis.set_ylabel("left after the best rival (sigmas)")
    legend(axis)


def page(board: Scoreboard) -> str:
    """The report as Markdown."""
    results = [r for r in board.results if r.kind is not None]
    effects = [r for r in results if r.kind in NAMED]
    versions = ", ".join(f"{name} {version}" for name, version in board.versions.items())
    lines = [
        "# Scoreboard of the diagnosis",
        "",
        (
            f"{count(len(board.results), 'set')} of measured data in which something, or nothing, is hidden. Each is"
            " recorded by one engine and diagnosed with"
        ),
        "another, which sees only the CSV files; the seal is opened afterwards. Written by",
        "`python -m tests.evidence scoreboard update`; one set again, with its truth:",
        f"`python -m tests.evidence scoreboard show SEED`. Versions: {versions};",
        f"code {board.code} (a hash over `analytic/`, `sim_models/`, `compare/diagnose/` and"
        " `tests/evidence/scoreboard/`;",
        "`python -m tests.evidence scoreboard check` says whether they have changed since).",
        "",
        (
            f"An effect is *distinguishable* where at least {DISTINCT:g} sigma of its signature are left after the best"
            " other effect has been"
        ),
        "fitted to it, the other true effects free to move.",
        "",
        *_made_by(board),
        *_asked(board.thresholds),
        *_reliability([claim for r in results for claim in r.claims]),
        *_outcomes("By kind of set", results, lambda r: [str(r.kind)]),
        *_outcomes(
            "By size: sigmas left after the best rival, of the least distinct effect",
            effects,
            lambda r: [_bin(_least(r))],
        ),
        *_outcomes("By effect", effects, lambda r: [e.effect.split("@")[0] for e in r.truth]),
        *_outcomes("By number of effects", effects, lambda r: [str(len(r.truth))]),
        *_outcomes("By linkage", effects, lambda r: [r.case]),
        *_outcomes("By diagnosing engine", effects, lambda r: [r.simulator]),
        *_outcomes("By engine that made the data", effects, lambda r: [r.source]),
        *_nameless([r for r in results if r.kind in NAMELESS]),
        "",
        "![Each set with effects: sigmas of its faintest signature, and what the best rival leaves](sizes.svg)",
        *_bench(results),
        *_several([r for r in results if r.kind == "several"]),
        *_rattling(results),
        *_per_engine(board.by_simulator),
        *_errors(effects),
        *_failures(board.results),
    ]
    return "\n".join(lines) + "\n"


def _made_by(board: Scoreboard) -> Iterator[str]:
    """How many sets are of which code, by kind, where not all are of the board's own."""
    if set(board.codes) <= {board.code}:
        return
    same = sum(board.codes.get(board.code, {}).values())
    yield f"**{same} of {count(len(board.results), 'set')} {'is' if same == 1 else 'are'} of this code; the others are"
    yield "as other code left them**, by kind:"
    kinds: list[Kind] = [kind for kind in get_args(Kind) if any(kind in counted for counted in board.codes.values())]
    yield from ("", f"| code | {' | '.join(kinds)} |", "|---|" + "--:|" * len(kinds))
    for code in dict.fromkeys([board.code, *board.codes]):
        counted = board.codes.get(code, {})
        mark = " (this one)" if code == board.code else ""
        yield f"| {code}{mark} | " + " | ".join(str(counted.get(kind) or "") for kind in kinds) + " |"
    yield ""


def _asked(rows: Sequence[Threshold]) -> Iterator[str]:
    yield "| what is asked | sets | share | asked | met |"
    yield "|---|--:|--:|--:|---|"
    for r in rows:
        least, most = 100 * r.least, 100 * r.most
        asked = f"at most {most:g} %" if not least else f"{least:g} to {most:g} %" if most < 100 else f"{least:g} %"
        share = f"{100 * r.count / r.of:.1f} %"
        if r.interval is not None:
            share += f" ({100 * r.interval[0]:.0f} to {100 * r.interval[1]:.0f} %)"
        yield f"| {r.what} | {r.count} of {r.of} | {share} | {asked} | {'yes' if r.met else 'NO'} |"


TENTHS = 10


def reliability(claims: Sequence[Claim]) -> list[tuple[float, int, int]]:
    """By tenths of probability that has claims: their mean, how many are right, and how many there are."""
    tenths: dict[int, list[Claim]] = {}
    for claim in claims:
        tenths.setdefault(min(int(TENTHS * claim.probability), TENTHS - 1), []).append(claim)
    return [
        (fmean(c.probability for c in each), sum(c.right for c in each), len(each))
        for _, each in sorted(tenths.items())
    ]


def _reliability(claims: Sequence[Claim]) -> Iterator[str]:
    """How often what is held to be so probable is there."""
    if not claims:
        return
    yield from ("", "## Are probabilities what they say?", "")
    yield "Every effect that is held to be there with a probability of at least 5 %, named or not, in sets whose"
    yield "effects all have names; what is slightly off, and faults of sensors that are there, are right. Intervals are"
    yield "95 % (Wilson). Sets that other code left have no claims."
    yield from ("", "| claimed, mean | claims | there | share there |", "|--:|--:|--:|--:|")
    for mean, right, of in reliability(claims):
        low, high = wilson(right, of)
        yield f"| {mean:.3f} | {of} | {right} | {right / of:.3f} ({low:.2f} to {high:.2f}) |"
    yield from ("", "![Share that is there over the probability that is claimed](reliability.svg)")


def _outcomes(title: str, results: Sequence[Scored], groups: Callable[[Scored], list[str]]) -> Iterator[str]:
    """A table of outcomes by group."""
    if not results:
        return
    columns = [o for o in ORDER if any(r.outcome == o for r in results)]
    found: dict[str, Counter[str]] = {}
    for r in results:
        for group in groups(r):
            found.setdefault(group, Counter())[r.outcome] += 1
    yield from ("", f"## {title}", "", f"| | {' | '.join(columns)} |", "|---|" + "--:|" * len(columns))
    for group in sorted(found, key=_in_order):
        yield f"| {group} | " + " | ".join(str(found[group][c] or "") for c in columns) + " |"


def _nameless(results: Sequence[Scored]) -> Iterator[str]:
    """What the vocabulary has no word for: what was said, and whether its place was proposed."""
    if not results:
        return
    columns = [o for o in ORDER if any(r.outcome == o for r in results)]
    head = [*columns, "right place", f"with {MANY} sensors"]
    yield from ("", "## What has no name", "")
    yield "Of sets that were scored with it: how often the true place is proposed or does as well as what is, among all"
    yield f"of them and where {MANY} sensors or more were read."
    yield from ("", f"| | {' | '.join(head)} |", "|---|" + "--:|" * len(head))
    for kind, thing in sorted({(str(r.kind), str(r.outside)) for r in results}):
        sets = [r for r in results if (r.kind, r.outside) == (kind, thing)]
        cells = [str(sum(r.outcome == c for r in sets) or "") for c in columns]
        for least in (1, MANY):
            placed = [bool(r.right_place) for r in sets if r.sensors >= least]
            cells.append(f"{sum(placed)} of {len(placed)}" if placed else "")
        yield f"| {kind}: {thing} | " + " | ".join(cells) + " |"


FAMILIES: Mapping[str, str] = {
    "slightly-off": "lengths 0.1 to 0.3 mm off, masses 1 %, coms 0.5 mm, friction in every joint; one or two things"
    " that matter",
    "coarse": "encoders of 1000 to 4096 counts, 5 to 25 deg of crank a sample, uneven speed, stamps that jitter",
    "coloured": "drift, 1/f noise, hum at 50 Hz, filters of 20 to 50 Hz",
    "per-run": "in each run its own zero of the encoder, tares, in some a clock; one amplifier's lag",
    "large": "what is missing changes the motion, or most of the forces",
}


def _bench(results: Sequence[Scored]) -> Iterator[str]:
    """The families of the bench: what they are, and what was scored beside the outcome."""
    found = {kind: [r for r in results if r.kind == kind] for kind in FAMILIES}
    if not any(found.values()):
        return
    yield from ("", "## Sets as unkind as a bench", "")
    yield "One set in six of each family is empty: nothing is hidden in it but what is unkind in all of them. Intervals"
    yield "above are 95 % (Wilson). *Error* is the largest of an effect's parameters, where it is named itself."
    yield from ("", "| family | sets | empty | named or tied | false effect of the rig | gap closed | median error |")
    yield "|---|--:|--:|--:|--:|--:|--:|"
    for kind, words in FAMILIES.items():
        sets = found[kind]
        full = [r for r in sets if r.truth]
        errors = sorted(r.worst_error for r in full if r.worst_error is not None)
        middle = f"{100 * errors[len(errors) // 2]:.2g} %" if errors else ""
        named, false = sum(r.named_all for r in full), sum(bool(r.false_rig) for r in sets)
        cells = (f"{kind}: {words}", len(sets), len(sets) - len(full), named, false, sum(map(closed, full)), middle)
        if sets:
            yield "| " + " | ".join(str(cell) for cell in cells) + " |"
    every = [r for sets in found.values() for r in sets]
    yield from _outcomes("Sets of the bench, by effect", every, lambda r: [e.effect.split("@")[0] for e in r.truth])
    yield from _verdicts(found)


def _verdicts(found: Mapping[str, Sequence[Scored]]) -> Iterator[str]:
    """How often each verdict was given, by family, with something to be named and without."""
    groups = {
        f"{kind}{'' if full else ', empty'}": [r.verdict for r in sets if bool(r.truth) is full]
        for kind, sets in found.items()
        for full in (True, False)
    }
    columns = sorted({verdict for verdicts in groups.values() for verdict in verdicts})
    yield from ("", "## Sets of the bench, by verdict", "")
    yield from (f"| | {' | '.join(columns)} |", "|---|" + "--:|" * len(columns))
    for name, verdicts in groups.items():
        if verdicts:
            yield f"| {name} | " + " | ".join(str(verdicts.count(c) or "") for c in columns) + " |"


def _several(sets: Sequence[Scored]) -> Iterator[str]:
    """Sets with several drives: what was named, by effect, linkage and engine, and how well its size was found."""
    if not sets:
        return
    values = [p for r in sets for p in r.parameters]
    yield from ("", "## Several drives", "")
    yield "Every drive follows its encoder, along a course of its own; one set in six is empty. Where names are exact,"
    yield f"{sum(p.covered for p in values)} of {count(len(values), 'parameter')} are in their 95 % intervals."
    yield from _outcomes("Several drives, by effect", sets, _hidden_in)
    yield from _outcomes("Several drives, by linkage", sets, lambda r: [r.case])
    yield from _outcomes("Several drives, by diagnosing engine", sets, lambda r: [r.simulator])
    yield from _outcomes("Several drives, by engine that made the data", sets, lambda r: [r.source])


def _rattling(results: Sequence[Scored]) -> Iterator[str]:
    """Rigs that rattle and that only seem to: what was named, and how well sizes were found, by how often pins fly."""
    loose, still = ([r for r in results if r.kind == kind] for kind in RATTLING)
    if not loose and not still:
        return
    yield from ("", "## Rigs that rattle", "")
    others = sum(bool(r.false_rig) and r.outcome == "clear" for r in still)
    yield "In sets that rattle one pin has clearance and is free for a share of the time. *Still* rigs have none, but"
    yield f"sensors that hum, spike or ring; of {others} of these something else of the rig than clearance is named."
    yield from _outcomes("Rigs that rattle, by joint", loose, lambda r: [f"{r.case}, {r.truth[0].effect}"])
    yield from ("", "## Rigs that rattle: sizes where the joint is named", "")
    yield from (f"| | sets | {' | '.join(SIZED)} |", "|---|--:|" + "--:|" * len(SIZED))
    for name in sorted({label for r in loose for label in _flying(r)}, key=_in_order):
        sets = [r for r in loose if name in _flying(r)]
        yield f"| {name} | {len(sets)} | {' | '.join(_sized([p for r in sets for p in r.parameters]))} |"


SIZED = ("named", "median error", "median of its size", "worst", "in the 95 % interval")


def _flying(r: Scored) -> list[str]:
    """Groups that a set which rattles is in: by who recorded it, by linkage, and by how long its pin flies."""
    low, high = next((band for band in BANDS if r.free <= band[1]), BANDS[-1])
    return [f"{100 * low:g} to {100 * high:g} % free", f"recorded by {r.source}", r.case, "sets in all"]


def _sized(found: Sequence[Value]) -> tuple[str, ...]:
    """How many sizes there are, their errors (relative), and how many are in their intervals."""
    off = [100 * error for error in relative_errors(found)]
    if not off:
        return ("0", "", "", "", "")
    size = [abs(error) for error in off]
    middle = (f"{median(off):+.2g} %", f"{median(size):.2g} %", f"{max(size):.2g} %")
    return (str(len(off)), *middle, str(sum(p.covered for p in found)))


def _hidden_in(r: Scored) -> list[str]:
    return [e.effect.split("@")[0] for e in r.truth] or ["nothing"]


def _per_engine(by_simulator: Mapping[str, Sequence[Threshold]]) -> Iterator[str]:
    yield from (
        "",
        "## What is asked, by diagnosing engine",
        "",
        "| | " + " | ".join(by_simulator) + " |",
        "|---|" + "--:|" * len(by_simulator),
    )
    for what in dict.fromkeys(row.what for rows in by_simulator.values() for row in rows):
        cells = []
        for rows in by_simulator.values():
            row = next((r for r in rows if r.what == what), None)
            cells.append("" if row is None else f"{row.count} of {row.of}{'' if row.met else ' (NO)'}")
        yield f"| {what} | " + " | ".join(cells) + " |"


def _errors(effects: Sequence[Scored]) -> Iterator[str]:
    """Median relative error and coverage, by parameter."""
    rows: dict[str, list[Value]] = {}
    for r in effects:
        for p in r.parameters:
            rows.setdefault(p.parameter.split("@")[0], []).append(p)
    if not rows:
        return
    yield from (
        "",
        "## Parameters where the name is exact",
        "",
        "| | values | median error | in the 95 % interval |",
        "|---|--:|--:|--:|",
    )
    for name, found in sorted(rows.items()):
        errors = sorted(abs(p.error) for p in found if p.error is not None)
        middle = f"{100 * errors[len(errors) // 2]:.2g} %" if errors else ""
        yield f"| {name} | {len(found)} | {middle} | {sum(p.covered for p in found)} |"


def _failures(results: Sequence[Scored]) -> Iterator[str]:
    bad = [r for r in results if not r.good or (r.outcome == "tie" and r.distinguishable and r.kind in NAMED)]
    yield from ("", "## Sets that fall short", "")
    if not bad:
        yield "None."
        return
    yield "`python -m tests.evidence scoreboard show SEED` makes and diagnoses any of them again."
    yield from (
        "",
        "| seed | outcome | verdict | truth (sigmas, left after the best rival) | named (tied with) |",
        "|--:|---|---|---|---|",
    )
    for r in bad:
        if r.kind is None:
            yield f"| {r.seed} | failed | | | {_cell(r.why)} |"
            continue
        true = "; ".join(f"{e.effect} ({e.total:.0f}, {e.distinct:.1f})" for e in r.truth) or r.outside or ""
        named = "; ".join(n.effect + (f" ({', '.join(n.ambiguous_with)})" if n.ambiguous_with else "") for n in r.named)
        proposed = f"proposed: {', '.join(r.proposed)}" if r.proposed else ""
        said = "; ".join(words for words in (named, proposed) if words)
        yield f"| {r.seed} | {r.outcome} | {r.verdict} | {true} | {_cell(said or r.why)} |"


def _cell(words: str) -> str:
    return words.replace("|", "\\|").replace("\n", " ")


def _least(r: Scored) -> float:
    return min(e.distinct for e in r.truth)


def _bin(sigmas: float) -> str:
    edges = (3.0, DISTINCT, 15.0, 30.0)
    low = max((e for e in edges if e <= sigmas), default=0.0)
    high = min((e for e in edges if e > sigmas), default=None)
    return f"{low:g} to {high:g}" if high is not None else f"{low:g} and more"


def _in_order(group: str) -> tuple[float, str]:
    """Groups that begin with a number by it, all others by name."""
    first = group.split()[0]
    return (float(first) if first.isdigit() else 0.0, group)


def figure(results: Sequence[Scored]) -> Figure:
    """Every set with effects by the size of its least distinct one."""
    groups: dict[str, list[tuple[float, float]]] = {name: [] for name in MARKS}
    for r in results:
        if r.kind in NAMED:
            e = min(r.truth, key=lambda e: e.distinct)
            name: str = r.outcome if r.outcome in groups else "short of it"
            groups[name].append((min(e.total, 120.0), min(e.distinct, 120.0)))
    series = [Series("", (0.0, 65.0), (DISTINCT, DISTINCT), "frame", "dashed")]
    for name, points in groups.items():
        if points:
            xs, ys = zip(*points, strict=True)
            series.append(Series(name, tuple(xs), tuple(ys), MARKS[name], "marker"))
    return Figure(
        "sizes",
        "Hidden effects by size, and how they were named",
        "each mark is a set; above the dashed line its effects can be told from all others",
        Axis("signature of the least distinct effect", "sigmas"),
        Axis("left after the best rival", "sigmas"),
        tuple(series),
    )


def reliability_figure(claims: Sequence[Claim]) -> Figure:
    """The share that is there over the probability that is claimed, by tenths, with 95 % intervals."""
    tenths = reliability(claims)
    means = tuple(mean for mean, _, _ in tenths)
    ends = [wilson(right, of) for _, right, of in tenths]
    band = tuple(high for _, high in ends) + tuple(low for low, _ in reversed(ends))
    return Figure(
        "reliability",
        "Probabilities that are claimed, and how often they are right",
        "on the dashed line an effect of probability p is there in a share p of all cases",
        Axis("probability that is claimed", ""),
        Axis("share that is there", ""),
        (
            Series("", (0.0, 1.0), (0.0, 1.0), "frame", "dashed"),
            Series("95 % interval", means + means[::-1], band, "tolerance", "band"),
            Series("by tenths", means, tuple(right / of for _, right, of in tenths), "analytic", "marker"),
        ),
    )

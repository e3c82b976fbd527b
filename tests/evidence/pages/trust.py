"""reports/trust.md, from trust.json."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from statistics import median
from typing import Literal, get_args

from compare.report.figure import ALL, Axis, Figure, Series
from sim_models.engine import ENGINES
from tests.evidence.results.trust import Covered, Foretold, Impacting, Stepped, Swung, Trust, Truth

KINDS = ("position", "velocity", "force")
COVERED = 0.95
TITLES = {  # and what errors are over, or in
    "position": ("Error of positions over the step, by engine", " over the largest"),
    "force": ("Error of forces over the step, by engine", " over the largest"),
    "contact": ("Error of a run with impacts over the step, by engine", " (rad)"),
}


def page(found: Trust) -> str:
    """The page."""
    versions = ", ".join(f"{name} {version}" for name, version in found.versions.items())
    steps = _steps(found.steps), _orders(found.steps), _struck(found.struck)
    parts = *steps, _coverage(found.coverage), _foretold(found.foretold), _swung(found.swung)
    return "\n".join([*(line for part in parts for line in part), f"Versions: {versions}.", ""])


def figures(found: Trust) -> dict[str, Figure]:
    """Its figures by the file that each is drawn to."""
    engines = tuple(name for name in ENGINES if any(r.simulator == name for r in found.steps))
    drawn = [
        _over_steps(kind, engines, [(r.simulator, r.joint_model, _halves(r.step), r.errors[kind]) for r in rows])
        for kind in ("position", "force")
        if (rows := [r for r in found.steps if kind in r.errors])
    ]
    if found.struck:
        struck = [(r.simulator, r.joint_model, r.steps, r.errors) for r in found.struck]
        drawn.append(_over_steps("contact", engines, struck))
    return {f"figures/{figure.name}.svg": figure for figure in drawn}


def _halves(step: float) -> tuple[float, ...]:
    return tuple(step / 2**k for k in range(4))


def _over_steps(
    what: Literal["position", "force", "contact"],
    engines: Sequence[str],
    rows: Sequence[tuple[str, str, Sequence[float], Sequence[float | None]]],
) -> Figure:
    """Errors over steps, both by their logarithms, a panel for each engine, beside straight lines of order 1 and 2."""
    lines = [
        Series(
            f"{engine} {model}",
            tuple(math.log10(h) for h in steps),
            tuple(math.log10(e) if e else None for e in errors),
            model,
            level=engines.index(engine),
        )
        for engine, model, steps, errors in rows
    ]
    middle, high = (max(v for s in lines for v in of(s) if v is not None) for of in (lambda s: s.x, lambda s: s.y))
    for order in (1, 2):
        lines.append(
            Series(
                "order 1 and 2", (middle - 1.5, middle), (high - 1.5 * order, high), "frame", "dashed", ALL, scale=False
            )
        )
    title, unit = TITLES[what]
    return Figure(
        f"trust-{what}",
        title,
        f"{len(rows)} runs in {', '.join(engines)}; both axes are logarithms, so that a method's order is its slope.",
        Axis("log₁₀ of the step", "s"),
        Axis(f"log₁₀ of the error{unit}", ""),
        tuple(lines),
        panels=tuple(engines),
    )


def _steps(rows: Sequence[Stepped]) -> Iterator[str]:
    whole, within, shortest = (sum(getattr(r, name) for r in rows) for name in ("signals", "within", "within_shortest"))
    ordered, held = sum(r.ordered for r in rows), sum(r.ordered_within for r in rows)
    by = {truth: sum(r.truth.get(truth, 0) for r in rows) for truth in get_args(Truth)}
    missed = sum(r.missed for r in rows)
    wide = [median(each) for k in (0, 1) if (each := [x for r in rows for x in r.excess[k]])]
    yield "# Numerical uncertainties and predictions, held against what is known"
    yield ""
    yield (
        "What the numbers are: [how far to trust a number](../docs/theory/trust.md). Written by `python -m"
        " tests.evidence.trust`, which says how to make each row again."
    )
    yield ""
    yield "## Numerical uncertainty against the truth"
    yield ""
    yield (
        "Driven runs of these shipped cases, as the baselines set them up, at a few samples: in steps h, h/2 and h/4,"
        f" of which 2 u_num is told, and in steps h/8 and h/16. Of {whole} signals **{within}"
        f" ({_percent(within, whole)}) are off by 2 u_num at most**; of the {ordered} with an observed order {held}"
        f" ({_percent(held, ordered)}). In the median 2 u_num is {wide[0]:.2g} times the error of a signal with an"
        f" order, and {wide[-1]:.2g} times that of one without."
    )
    yield ""
    yield (
        "The truth is the run in steps h/16, unless rounding has overtaken it. Engines find forces from differences of"
        " velocities or places over a step, so that what these are rounded to grows as 1/h or 1/h², and in the shortest"
        " steps is all that is left: the run is then farther from the one in h/8 than that is from the one in h/4, and"
        " farther from the truth than the run that is judged. There the analytic solution, which has no steps, is the"
        f" truth, if joints are ideal and the engine's constraints do not give ({by['analytic']} signals); else the run"
        f" in h/8, if it is as near to its neighbour as h is to h/2 ({by['eighth']}); where it is not, differences grow"
        " from the first step on, nothing better is known, and"
        f" steps h/16 stay ({by['doubt']} signals, among which are {whole - within - missed} of the {whole - within}"
        f" that miss). Of the {whole - by['doubt']} whose truth is known {whole - by['doubt'] - missed}"
        f" ({_percent(whole - by['doubt'] - missed, whole - by['doubt'])}) are within. Against steps h/16 alone"
        f" {shortest} ({_percent(shortest, whole)}) of all would be."
    )
    yield ""
    yield (
        "| case | engine | joint model | h (s) | within | with an order | analytic | h/8 | in doubt |"
        " within, h/16 alone |"
    )
    yield "|---|---|---|--:|--:|--:|--:|--:|--:|--:|"
    for r in rows:
        truth = " | ".join(str(r.truth.get(name, 0)) for name in ("analytic", "eighth", "doubt"))
        held_of = f"{r.within} of {r.signals} | {r.ordered_within} of {r.ordered} | {truth}"
        yield f"| {r.case} | {r.simulator} | {r.joint_model} | {r.step:.2g} | {held_of} | {r.within_shortest} |"
    yield ""


def _orders(rows: Sequence[Stepped]) -> Iterator[str]:
    yield "## Observed orders"
    yield ""
    yield (
        "The median of those observed over h, h/2 and h/4, by kind of signal; in the figures the median error of those"
        " with an order, over the largest signal of that unit, against the same truth. Where forces level out, they are"
        " at their rounding."
    )
    yield ""
    for kind in ("position", "force"):
        yield f"![{TITLES[kind][0]}](figures/trust-{kind}.svg)"
        yield ""
    yield "| engine | joint model | cases | within 2 u_num | order of positions | velocities | forces |"
    yield "|---|---|--:|--:|--:|--:|--:|"
    for engine, model in dict.fromkeys((r.simulator, r.joint_model) for r in rows):
        some = [r for r in rows if (r.simulator, r.joint_model) == (engine, model)]
        told = ([p for r in some if (p := r.orders.get(kind)) is not None] for kind in KINDS)
        orders = " | ".join(_range(each) for each in told)
        within = f"{sum(r.within for r in some)} of {sum(r.signals for r in some)}"
        yield f"| {engine} | {model} | {len(some)} | {within} | {orders} |"
    yield ""


def _range(orders: Sequence[float]) -> str:
    low, high = (f"{end(orders, default=math.nan):.2f}" for end in (min, max))
    return "-" if not orders else low if low == high else f"{low} to {high}"


def _struck(rows: Sequence[Impacting]) -> Iterator[str]:
    if not rows:
        return
    yield "## Pins that strike, against the equation of motion"
    yield ""
    yield (
        "Half a revolution of the crank-rocker at 600 rpm with 0.2 mm in B, 1e6 N/m and a restitution of 0.8, from a"
        f" centred pin, in which it touches {rows[0].touches} times: the largest error of coupler and follower (rad)"
        " against the differential equation with event location, which shares nothing with the engines. The order is"
        " the slope of the straight line through the logarithms; 2 u_num is of the longest steps, by the three longest,"
        f" and holds their error in {sum(r.errors[0] <= r.expanded for r in rows)} of {len(rows)} runs."
        " A longer run converges to nothing, as each impact makes errors grow."
    )
    yield ""
    yield f"![{TITLES['contact'][0]}](figures/trust-contact.svg)"
    yield ""
    steps = " | ".join(f"{1e6 * h:g} µs" for h in rows[0].steps)
    yield f"| engine | joint model | order | {steps} | 2 u_num |"
    yield "|---|---|--:|" + "--:|" * (len(rows[0].steps) + 1)
    for r in rows:
        errors = " | ".join(f"{e:.1e}" for e in (*r.errors, r.expanded))
        yield f"| {r.simulator} | {r.joint_model} | {r.order:.2f} | {errors} |"
    yield ""


def _foretold(rows: Sequence[Foretold]) -> Iterator[str]:
    if not rows:
        return
    yield "## Predictions of rigs that others measured"
    yield ""
    yield (
        "A run, or the rest of one, is left out, and foretold from what is fitted before: a pendulum (two swings), a"
        " robot's axis and a ball-screw axis (one recording each). *readings* is the share of what the sensors read"
        " there that lies in the 95 % band with their noise, *width* the band's median width over the largest reading,"
        " *gap* how far the named model is off in sigmas of noise. Bands are of the sensors that the run does not"
        " follow; one that is wider than the readings are large holds them and says nothing of them."
    )
    yield ""
    known = [r for r in rows if r.readings is not None and r.width is not None]
    telling = [r for r in known if (r.width or 0.0) < 1]
    held = sum((r.readings or 0.0) >= COVERED for r in telling)
    mean = sum(r.samples * (r.readings or 0.0) for r in telling) / sum(r.samples for r in telling)
    low = ", ".join(dict.fromkeys(r.case for r in telling if (r.readings or 0.0) < COVERED))
    yield (
        f"Of {len(known)} bands {len(telling)} are narrower than the readings are large; of these **{held} hold at"
        f" least 95 % of the readings**, and all of them together {100 * mean:.1f} %."
        + f" Below that are bands of {low}."
        * bool(low)
    )
    yield ""
    yield "| data | left out | named | verdict | sensor | samples | readings | width | gap |"
    yield "|---|---|---|---|---|--:|--:|--:|--:|"
    for r in rows:
        named, said = ", ".join(r.named) or "nothing", f"{r.signal} | {r.samples}"
        share, wide = (
            "-" if x is None else f"{100 * x:.1f} %" if x < 1e2 else "beyond all" for x in (r.readings, r.width)
        )
        off = "-" if r.off is None else f"{r.off:.3g}"
        yield f"| {r.case} | {r.left_out} | {named} | {r.verdict} | {said} | {share} | {wide} | {off} |"
    yield ""


def _swung(rows: Sequence[Swung]) -> Iterator[str]:
    if not rows:
        return
    yield "## Predictions of swings with a torque that has no name"
    yield ""
    yield (
        "A pendulum with a damper, a drag that grows with the square of the rate (10 to 50 % of the damper's torque at"
        " 6 rad/s) and a cable that pulls until it is taut (up to 0.3 % of the weight's torque), integrated by scipy;"
        " each seed has its own. Of its swings, 9 s from amplitudes of 0.7 to 1.5 rad, some are fitted by damping,"
        " inertia and centre of mass alone, and a further one is foretold. *readings* as above, the mean over the"
        " seeds; readings of one swing lie in its band together or not at all."
    )
    yield ""
    yield "| fitted swings | sensor | seeds | readings | under 90 % | median width | median gap |"
    yield "|--:|---|--:|--:|--:|--:|--:|"
    for fitted, signal in dict.fromkeys((r.fitted, r.signal) for r in rows):
        some = [r for r in rows if (r.fitted, r.signal) == (fitted, signal)]
        shares = [r.readings or 0.0 for r in some]
        width, off = (median([x or 0.0 for x in each]) for each in ([r.width for r in some], [r.off for r in some]))
        low = sum(share < 0.9 for share in shares)
        share = f"{100 * sum(shares) / len(shares):.1f} %"
        yield f"| {fitted} | {signal} | {len(some)} | {share} | {low} | {100 * width:.2f} % | {off:.3g} |"
    yield ""


def _coverage(rows: Sequence[Covered]) -> Iterator[str]:
    yield "## Predictions of runs outside the data"
    yield ""
    yield (
        "Hidden sets of the [scoreboard](scoreboard/README.md), each made by another engine than the one that diagnoses"
        " it. Beside its runs a further turn is made, 1.5 or 2 times as fast as the fastest, or 0.6 or 0.75 times as"
        " fast as the slowest; nothing is fitted to it. In every third set the effects that are truly there are ruled"
        " out, so that what is missing has no name left. *readings* is the share of what the sensors read that lies in"
        " the 95 % band with their noise, *true values* that of what they would read without noise in the band alone;"
        " *width* is the band's median width over one sigma of noise. A search ended after 60 s."
    )
    yield ""
    yield "| sets | number | readings | true values | sets under 90 % of readings | median width (sigmas) |"
    yield "|---|--:|--:|--:|--:|--:|"
    for name, some in (
        ("nothing is left without a name", [r for r in rows if not r.nameless]),
        ("what is missing has no name", [r for r in rows if r.nameless]),
        ("all", list(rows)),
    ):
        known = [r for r in some if r.readings is not None and r.true_values is not None and r.width is not None]
        if not known:
            continue
        total = sum(r.samples for r in known)
        readings, true = (
            sum(r.samples * share for r, share in zip(known, shares, strict=True)) / total
            for shares in ([r.readings or 0.0 for r in known], [r.true_values or 0.0 for r in known])
        )
        low = sum((r.readings or 0.0) < 0.9 for r in known)
        width = median(r.width or 0.0 for r in known)
        yield f"| {name} | {len(known)} | {100 * readings:.1f} % | {100 * true:.1f} % | {low} | {width:.2f} |"
    yield ""
    yield "| seed | case | missing | named | verdict | speed | readings | true values | width | gap of the worst |"
    yield "|--:|---|---|---|---|--:|--:|--:|--:|--:|"
    for r in rows:
        shares = " | ".join("-" if x is None else f"{100 * x:.1f} %" for x in (r.readings, r.true_values))
        missing = ", ".join(r.truth) + " (no name left)" * r.nameless
        sizes = " | ".join("-" if x is None else f"{x:.3g}" for x in (r.width, r.off))
        named = ", ".join(r.named) or "nothing"
        yield f"| {r.seed} | {r.case} | {missing} | {named} | {r.verdict} | {r.speed:.2f} | {shares} | {sizes} |"
    yield ""


def _percent(some: int, of: int) -> str:
    return f"{100 * some / of:.1f} %" if of else "none"

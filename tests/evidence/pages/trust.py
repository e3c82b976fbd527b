"""reports/trust.md, from trust.json."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from statistics import median

from tests.evidence.results.trust import Covered, Stepped, Trust

KINDS = ("position", "velocity", "force")


def page(found: Trust) -> str:
    """The page."""
    versions = ", ".join(f"{name} {version}" for name, version in found.versions.items())
    return "\n".join([*_steps(found.steps), *_coverage(found.coverage), f"Versions: {versions}.", ""])


def _steps(rows: Sequence[Stepped]) -> Iterator[str]:
    whole, within = sum(r.signals for r in rows), sum(r.within for r in rows)
    ordered, held = sum(r.ordered for r in rows), sum(r.ordered_within for r in rows)
    yield "# Numerical uncertainties and predictions, held against what is known"
    yield ""
    yield (
        "What the numbers are: [how far to trust a number](../docs/theory/trust.md). Written by `python -m"
        " tests.evidence.trust`, which says how to make each row again."
    )
    yield ""
    yield "## Numerical uncertainty against steps a sixteenth as long"
    yield ""
    yield (
        "Every driven run of these shipped cases, as the baselines set it up, in each engine, at a few samples: in"
        " steps h, h/2 and h/4, of which 2 u_num is told, and in steps h/16, which stand for the truth. Of"
        f" {whole} signals {within} ({_percent(within, whole)}) are off by 2 u_num at most; of the {ordered} with"
        f" an observed order {held} ({_percent(held, ordered)}). The others do not change, or are at the rounding of"
        " their engine, which grows as steps become shorter: there the run in steps h/16 is farther from the truth"
        " than the one that is judged, and says nothing of it."
    )
    yield ""
    yield "Orders are the median of those observed, by kind of signal."
    yield ""
    yield "| case | engine | joint model | h (s) | within | with an order | order of positions | velocities | forces |"
    yield "|---|---|---|--:|--:|--:|--:|--:|--:|"
    for r in rows:
        orders = " | ".join("-" if (p := r.orders.get(kind)) is None else f"{p:.2f}" for kind in KINDS)
        held_of = f"{r.within} of {r.signals} | {r.ordered_within} of {r.ordered}"
        yield f"| {r.case} | {r.simulator} | {r.joint_model} | {r.step:.2g} | {held_of} | {orders} |"
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

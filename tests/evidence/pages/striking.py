"""The part of the validation report's page on pins that leave their walls and strike: what they do, where, and how they
are found again.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from compare.results.contact import StatisticName
from tests.evidence.results.validation import Delivered, Diagnosed, LawFound, Mapped, Sought, Struck, Validation
from tests.evidence.validation.beside import RATTLING_WANTED, SIZE_WANTED, STEADY_WANTED
from tests.evidence.validation.laws import SIMULATOR, SOURCE
from tests.evidence.validation.rebounds import SPEED
from tests.evidence.validation.striking import ODE


def striking(found: Validation) -> Iterator[tuple[tuple[str, ...], Iterator[str]]]:
    """Headings and text of what the report has."""
    if found.struck:
        yield ("## Where pins leave their walls and strike", ""), _struck(found.struck)
    if found.delivered:
        yield ("### Restitution delivered", ""), _delivered(found.delivered)
    if found.maps:
        yield ("### Where contact is lost", ""), _mapped(found.maps)
    if found.diagnosed:
        yield ("### Clearance found again in rigs that rattle", ""), _diagnosed(found.diagnosed)
    if found.laws:
        yield ("### The law of contact found again", ""), _laws(found.laws)


FIGURES: Mapping[StatisticName, tuple[str, float, str]] = {
    "free_share": ("free share", 100.0, "%"),
    "impacts": ("impacts", 1.0, ""),
    "rms_force": ("rms force", 1.0, "N"),
    "peak_force": ("peak force", 1.0, "N"),
    "restitution_loss": ("energy lost", 1e3, "mJ"),
    "friction_loss": ("by friction", 1e3, "mJ"),
    "wear": ("force times sliding", 1.0, "N.m"),
    "penetration": ("penetration", 1e6, "um"),
}  # heading, factor to the unit


def _struck(rows: Sequence[Struck]) -> Iterator[str]:
    yield (
        "What a revolution has on average, with half of the 95 % interval: by each law of contact, in each engine's own"
        " contact where it"
    )
    yield (
        "takes the law, else as a force between pin centres, and by an ordinary differential equation of its own with"
        " event location. Bold"
    )
    yield "is what is farther from the equation's figure than both intervals leave open: by more than the root of the"
    yield "sum of the squares of the two half widths (after the ±), before rounding. Each figure is rounded to the last"
    yield "digit of its half width."
    compared = [(row, name) for row in rows if row.simulator != ODE for name in row.statistics]
    off = sum(not _agrees(rows, row, name) for row, name in compared)
    yield (
        f"Of {len(compared)} figures, {off} are bold; some {0.05 * len(compared):.0f} would be by chance, as the"
        " intervals are of 95 %. What lies farthest off was"
    )
    yield (
        "looked into ([laws of contact](../docs/theory/contact.md)): runs made again, longer or from other starts, lie"
        " nearer."
    )
    yield ""
    yield "Over ideal is the peak force over the ideal linkage's largest reaction. Force times sliding, at the rim of a"
    yield "pin of 10 mm, is what wears (Archard). Missing is the energy by which a run's balance does not close,"
    yield "as a share of what the motor turns over: the simulation's own error."
    for case, friction in dict.fromkeys((row.case, row.friction) for row in rows):
        mine = [row for row in rows if (row.case, row.friction) == (case, friction)]
        first, shown = mine[0], [n for n in FIGURES if any(n in row.statistics for row in mine)]
        yield ""
        rpm = first.speed * 30 / math.pi
        yield (
            f"**{case}**, {1e3 * first.clearance:g} mm in {first.joint}, {rpm:.5g} rpm, restitution asked for"
            f" {first.restitution:g}, {first.stiffness:.0e} N/m{f', friction {friction:g}' * bool(friction)}:"
        )
        yield ""
        heads = [_headed(n, first.peak_ratio is not None) for n in shown]
        yield f"| law | by | revolutions | {' | '.join(heads)} | missing |"
        columns = len(heads) + sum(" | " in head for head in heads)
        yield "|---|---|--:|" + "--:|" * (columns + 1)
        for row in mine:
            by = row.simulator + ("" if row.simulator == ODE else f", {row.joint_model}")
            cells = [_figure(rows, row, name) + _over_ideal(row, name) for name in shown]
            missing = "" if row.missing is None else f"{row.missing:.0e}"
            yield f"| {row.law} | {by} | {row.revolutions} | {' | '.join(cells)} | {missing} |"


def _agrees(rows: Sequence[Struck], row: Struck, name: StatisticName) -> bool:
    """Whether a figure of an engine is no farther from the equation's than their intervals leave open."""
    truth = next((each for each in rows if each.key == (*row.key[:3], ODE)), None)
    return truth is None or row.statistics[name].agrees(truth.statistics[name])


def _headed(name: StatisticName, over_ideal: bool) -> str:
    """A column's heading; behind the peak force that of its ratio, where that is known."""
    words, _, unit = FIGURES[name]
    beside = " | over ideal" if name == "peak_force" and over_ideal else ""
    return words + (f" ({unit})" if unit else "") + beside


def _over_ideal(row: Struck, name: StatisticName) -> str:
    return f" | {row.peak_ratio:.3g}" if name == "peak_force" and row.peak_ratio is not None else ""


def _figure(rows: Sequence[Struck], row: Struck, name: StatisticName) -> str:
    if name not in row.statistics:
        return ""
    found, factor = row.statistics[name], FIGURES[name][1]
    said = beside(factor * (found.value or 0.0), factor * found.half_width)
    return said if row.simulator == ODE or _agrees(rows, row, name) else f"**{said}**"


def beside(value: float, half_width: float) -> str:
    """A number and half of its interval's width: this to two digits, the number as far, without a power of ten."""
    if not 0.0 < half_width < math.inf:
        return f"{value:.3g} ± {half_width:g}"
    half_width = float(f"{half_width:.2g}")
    place = 1 - math.floor(math.log10(half_width))
    return " ± ".join(f"{round(x, place):.{max(place, 0)}f}" for x in (value, half_width))


DELIVERED = (
    "- Exudyn by `kelvin-voigt`: that force jumps where the pin meets its wall, and the rebound depends on where in",
    "  a step that is, which is the same in every fall here. Asked for 0.05, falls that meet the wall at eight places",
    "  of a step deliver 0.037 to 0.060, on average 0.050; steps of a quarter deliver 0.048 ([laws of",
    "  contact](../docs/theory/contact.md#laws-by-name)).",
    "- DART's own contact is rigid, and does not bounce where the rebound would be slower than 0.1 m/s. The bar meets",
    f"  the wall at {SPEED:.3f} m/s, so that DART delivers 0 where less than {0.1 / SPEED:.2f} is asked for.",
)


def _delivered(rows: Sequence[Delivered]) -> Iterator[str]:
    yield (
        "A bar falls with its pin on the wall of its bearing, so that all of its mass strikes: its speed after over"
        " that before, for each"
    )
    yield (
        "restitution that a law is asked for. The formula is the law's (`sim_models.common.contact_laws`); what is"
        " called restitution"
    )
    yield "is not what most laws deliver."
    yield ""
    yield from DELIVERED
    yield ""
    asked = rows[0].asked
    yield "| law | by | " + " | ".join(f"{e:g}" for e in asked) + " |"
    yield "|---|---|" + "--:|" * len(asked)
    for row in rows:
        by = row.simulator + (f", {row.joint_model}" if row.joint_model else "")
        yield f"| {row.law} | {by} | " + " | ".join("" if e is None else f"{e:.3f}" for e in row.delivered) + " |"


def _mapped(rows: Sequence[Mapped]) -> Iterator[str]:
    yield (
        "The stored maps over speed and clearance, read from their files: in how many cells a pin leaves its wall, and"
        " in how many it"
    )
    yield (
        "leaves or stays as the analytic model says, which knows how the reaction turns, on walls that give as the"
        " contact does and on rigid"
    )
    yield "ones; how far two engines differ at most in the share of the cycle without contact."
    yield ""
    yield "| map | joint | engines | contact lost | as predicted | by rigid walls | free shares off | same verdict |"
    yield "|---|---|---|--:|--:|--:|--:|--:|"
    for r in rows:
        spread = "" if r.free_share_spread is None else f"{100 * r.free_share_spread:.2g} %"
        counts = [f"{n} of {r.foretold}" for n in (r.lost, r.yielding, r.rigid)] if r.foretold else ["", "", ""]
        cells = [", ".join(r.joints), ", ".join(r.simulators), *counts, spread, f"{r.same_verdict} of {r.both}"]
        yield f"| [{r.case}]({r.folder}/validity.md) | {' | '.join(cells)} |"


def _diagnosed(rows: Sequence[Diagnosed]) -> Iterator[str]:
    yield (
        "Of the stored [scoreboard](scoreboard/README.md#rigs-that-rattle): sets of measured data in which one pin has"
        " clearance and is"
    )
    yield (
        "free for 1 to 50 % of the time, recorded by another engine or an ordinary differential equation; in which"
        " clearance is hidden that"
    )
    yield "does not rattle; and which have none, but sensors that hum, spike or ring."
    yield ""
    yield (
        "| linkage | rattling: right joint or a tie | size off in the median | not rattling: named or a tie |"
        " none: clearance named |"
    )
    yield "|---|--:|--:|--:|--:|"
    for r in rows:
        each = (r.named, r.loose), (r.steady_named, r.steady), (r.false, r.still)
        counts = [f"{n} of {of}" if of else "" for n, of in each]
        size = "" if r.size_off is None else f"{100 * r.size_off:.2g} %"
        yield f"| {r.case} | {counts[0]} | {size} | {counts[1]} | {counts[2]} |"
    wanted = f"{100 * RATTLING_WANTED:g} % | {100 * SIZE_WANTED:g} % at most | {100 * STEADY_WANTED:g} %"
    yield f"| asked | {wanted} | none |"


BOUNDS: Mapping[str, tuple[float | None, float | None]] = {
    "restitution": (0.0, 1.0),
    "stiffness": (None, None),
    "friction": (0.0, None),
}  # what an interval is of which the data tell nothing


def _laws(rows: Sequence[LawFound]) -> Iterator[str]:
    yield f"Rigs with a pin that rattles, recorded by {SOURCE} or by the equation, with noise, and diagnosed by"
    yield f"{SIMULATOR} with `--only contact_law`. Of each parameter: what it is, and what is found, with its 95 %"
    yield "interval. A number followed by *not told* is that of the best trial; the data do not tell the parameter."
    yield "Bold is an interval that does not contain the true value. `python -m tests.evidence validation check` does"
    yield "not make these diagnoses again."
    yield ""
    yield "| rig | recorded by | | restitution | stiffness (N/m) | friction |"
    yield "|---|---|---|--:|--:|--:|"
    for r in rows:
        rig = f"{r.case}, {1e3 * r.clearance:g} mm in {r.joint}, {r.revolutions} revolutions"
        yield f"| {rig} | {r.recorded} | is | {' | '.join(f'{r.parameters[name].true:g}' for name in BOUNDS)} |"
        yield f"| | | found | {' | '.join(_sought(name, r.parameters[name]) for name in BOUNDS)} |"


def _sought(name: str, p: Sought) -> str:
    """What was found, with its interval or that the data do not tell it; bold where the true value is outside."""
    if p.found is None:
        return "nothing"
    untold = (p.low, p.high) in (BOUNDS[name], (None, None))
    low, high = ("open" if x is None else f"{x:g}" for x in (p.low, p.high))
    said = f"{p.found:g} (not told)" if untold else f"{p.found:g} ({low} to {high})"
    return said if p.covered else f"**{said}**"

"""One number of a cross-check, shown: where it comes from on the analytic side and on the simulated one."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from rich.console import Console

from compare.presentation import Presentation
from compare.quantities import shown
from compare.report.tables import html_table, say
from compare.results.provenance import Analytic, Provenance, Sample, Simulated
from sim_models.engine import SettingValue

SETTING_UNITS = {"contact_stiffness": "N/m", "contact_damping": "N.s/m", "step": "s"}
INDENT = " " * 16
MADE = {"rad": "atan2(y, x)", "N": "hypot(x, y)"}  # how a direction or a size is made of its components


def print_table(result: Provenance, console: Console) -> None:
    """Print both sides in each run, and what each comes from."""
    say(console, *lines(result))


def summary_html(result: Provenance) -> str:
    """Both sides, their difference and the verdict, a row for each run."""
    heads = ("engine", "joint model", "where", "analytic", "simulated", "difference", "verdict")
    rows = [
        (
            run.simulator.name,
            run.joint_model,
            _place(result, run),
            *(_read(value, result.unit) for value in (run.analytic.value, run.simulated.value, run.difference)),
            "not judged" if run.discrepancy is None else run.discrepancy.verdict,
        )
        for run in result.runs
    ]
    return html_table(rows, heads, _head(result))


def lines(result: Provenance) -> Iterator[str]:
    """The signal, the result that it is of, and each run."""
    yield _head(result)
    yield f"{result.case}: {result.command}".rstrip(": ")
    if result.versions:
        yield "made with " + ", ".join(f"{package} {version}" for package, version in result.versions.items())
    for run in result.runs:
        yield ""
        yield f"{run.simulator.name} {run.simulator.version}, {run.joint_model} joints, {run.motion}: " + _where(
            result, run
        )
        yield from _explained(result, run)


def _head(result: Provenance) -> str:
    return f"{result.signal}: {result.label}" + (f" ({result.acts})" if result.acts else "")


def _where(result: Provenance, run: Sample) -> str:
    words = (
        f"{'time' if result.over_time else 'crank angle'} {_place(result, run)}, sample {run.index + 1} of {run.count}"
    )
    if run.exact:
        return words
    asked = f"{result.at:g} s" if result.over_time else f"{math.degrees(result.at):g} deg"
    return f"{words} (the nearest to {asked}; nothing is interpolated)"


def _place(result: Provenance, run: Sample) -> str:
    if result.over_time and run.time is not None:
        return f"{run.time:.8g} s"
    return f"{math.degrees(run.crank_angle):.8g} deg"


def _explained(result: Provenance, run: Sample) -> Iterator[str]:
    if run.flag:
        yield f"  flagged       no analytic number: {run.flag}"
        if run.simulated.value is not None:
            yield from _simulated(result, run)
        return
    yield f"  analytic      {_both(run.analytic.value, result.unit)}"
    for equation in run.analytic.equations:
        yield INDENT + equation.words + (f"; {equation.module}" if equation.module else "")
    yield from _components(run.analytic, result.unit)
    yield from _simulated(result, run)
    if run.difference is not None:
        yield f"  difference    {_both(run.difference, result.unit, '+')}, simulated minus analytic{_less(result, run)}"
    yield from _verdict(result, run)


def _simulated(result: Provenance, run: Sample) -> Iterator[str]:
    """What the engine has, and with which settings."""
    yield f"  simulated     {_both(run.simulated.value, result.unit)}"
    absent = "recorded" if run.simulator.recorded else "an engine that is not installed here"
    yield f"{INDENT}{run.simulated.module or absent}; {_settings(run)}"
    yield from _components(run.simulated, result.unit)


def _less(result: Provenance, run: Sample) -> str:
    """What is said where the two sides are whole turns apart."""
    analytic, simulated = run.analytic.value, run.simulated.value
    if result.unit != "rad" or analytic is None or simulated is None:
        return ""
    return ", less whole turns" if abs(simulated - analytic) > math.pi else ""


def _components(side: Analytic | Simulated, unit: str) -> Iterator[str]:
    """The components that a direction or a size was made of."""
    if side.components:
        each = ", ".join(f"{name} = {_plain(value)} N" for name, value in side.components.items())
        yield f"{INDENT}{MADE[unit]} of {each}"


def _settings(run: Sample) -> str:
    sizes = [f"clearance_{joint} = {1e3 * size:.6g} mm" for joint, size in run.clearance.items()]
    rest = [
        f"{name} = {_value(value)} {SETTING_UNITS.get(name, '')}".rstrip()
        for name, value in run.simulated.settings.items()
        if value is not None
    ]
    return ", ".join([*sizes, *rest]) or "no settings"


def _value(value: SettingValue) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {_value(item)}" for name, item in value.items())
    return f"{value:.6g}" if isinstance(value, int | float) else str(value)


def _verdict(result: Provenance, run: Sample) -> Iterator[str]:
    row = run.discrepancy
    if row is None:
        yield "  verdict       not judged on its own in this run"
        return
    place = "-"
    if row.at_crank_angle is not None:
        place = f"{math.degrees(row.at_crank_angle):.6g} deg"
        if result.over_time and run.worst_time is not None:
            place = f"{run.worst_time:.6g} s"
    yield f"  worst         {_both(row.max, row.unit, '+')} at {place}: the largest share of its tolerance in the run"
    yield f"  tolerance     {_both(row.tolerance, row.unit)} there"
    yield (
        f"  verdict       {row.verdict}" + (f": {row.reason}" if row.reason else "") + " (of this signal, over the run)"
    )


def _both(value: float | None, unit: str, sign: str = "") -> str:
    """A number for people, and in SI."""
    people = _read(value, unit, sign)
    return people if value is None or shown(unit)[1] == 1 else f"{people}  ({_plain(value, sign)} {unit})"


def _read(value: float | None, unit: str, sign: str = "") -> str:
    """A number for people."""
    name, factor = shown(unit)
    return "no number" if value is None else f"{factor * value:{sign}.7g} {name.replace('·', '.')}"


def _plain(value: float | None, sign: str = "") -> str:
    return "no number" if value is None else f"{value:{sign}.9g}"


NO_PICTURE = "is about one number and has no picture; plot the cross-check, or print it"
PRESENTATION = Presentation(summary_html, print_table, no_picture=NO_PICTURE)

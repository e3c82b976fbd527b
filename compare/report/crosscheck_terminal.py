"""The short table for a terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rich.console import Console
from rich.text import Text

from analytic.mechanism.one_line import count
from compare.quantities import plain
from compare.report.summary import ShownRun, Summary, summarise
from compare.report.tables import print_rows
from compare.report.trust import checked
from compare.report.words.contact import ASCII_UNITS, ContactShown, Value
from compare.report.words.crosscheck import METRICS_BRIEFLY, NUMERICAL_MEANS, VERDICT_WORDS, headline, why
from compare.results.contact import StatisticName
from compare.results.crosscheck import CrossCheck

MAIN: Mapping[StatisticName, str] = {  # what a terminal has room for, and how a column is headed
    "free_share": "free",
    "impacts": "impacts",
    "rms_force": "rms",
    "peak_force": "peak",
    "restitution_loss": "lost",
}
METRICS_COLUMNS = {  # what a terminal has room for of validation metrics, and how it is headed
    "title": "validation",
    "unit": "unit",
    "error_mean": "E mean",
    "error_rms": "E rms",
    "u_val": "u_val",
    "within": "|E| <= 2 u_val",
    "model_error": "model error",
    "area": "area",
}
LOUD = ("disagrees", "unjudged", "failed")
COLOUR = {"agrees": "green", "known": "yellow", **dict.fromkeys(LOUD, "bold red")}


def print_table(result: CrossCheck, console: Console) -> None:
    """Print each signal's worst difference, run by run, in degrees and millimetres, and the verdict; ASCII."""
    summary = summarise(result)
    keys = summary.keys()
    verified = ("2 u_num", "order") if summary.verified else ()
    rows: list[tuple[str | Text, ...]] = []
    for shown in summary.runs:
        rows.append((Text(shown.run.title, style="bold"), *[""] * (5 + len(verified)), _word(shown.run.verdict)))
        for row in (row for quantity in keys if (row := shown.row(quantity.signal))):
            numbers = (
                plain(row.maximum, 3, True),
                row.quantity.unit.replace("·", "."),
                row.at,
                plain(row.rms),
                plain(row.tolerance),
                *((plain(row.own), plain(row.order, 2)) if verified else ()),
            )
            rows.append((Text(f"  {row.quantity.label}"), *numbers, _word(row.verdict)))
    if summary.runs:
        heads = ("signal", "worst", "unit", "at", "rms", "tolerance", *verified, "verdict")
        print_rows(console, heads, rows, left=("signal", "unit", "verdict"), folded=("signal",))
    for line in _notes(summary.runs):
        console.print(line, soft_wrap=False)
    _print_metrics(summary, console)
    _print_contact(summary.contact, console)
    if result.words:
        console.print(f"between engines: {result.words}")
    for failure in summary.failures:
        console.print(f"failed: {failure}")
    for one in summary.stopped:
        console.print(f"not judged: {one}")
    said = " ".join(filter(None, (why(summary), headline(summary, plain).translate(ASCII_UNITS))))
    console.print(Text.assemble((f"{result.case}: ", "bold"), _word(summary.verdict), f". {said}"))


def _print_metrics(summary: Summary, console: Console) -> None:
    """Validation metrics of the signals of the table above, what a terminal has room for."""
    keys = {quantity.signal: quantity.label for quantity in summary.keys()}
    rows = checked(summary.result.runs, keys)
    cells = ([Text(getattr(row, name).translate(ASCII_UNITS)) for name in METRICS_COLUMNS] for row in rows)
    first, unit = (METRICS_COLUMNS[name] for name in ("title", "unit"))
    if rows:
        print_rows(console, [*METRICS_COLUMNS.values()], cells, left=(first, unit), folded=(first,))
        console.print(f"metrics: {METRICS_BRIEFLY}")


def _print_contact(contact: ContactShown, console: Console) -> None:
    """Contact in each run in a line, its main figures joint by joint where a pin strikes, and what disagrees."""
    for run in contact.runs:
        console.print(f"{run.run}: {run.sentence}")
    striking = {run.run for run in contact.runs if run.contact.struck}
    for table in contact.tables:
        rows = [k for k, run in enumerate(table.runs) if run in striking]
        columns = [(head, *table.of(name)) for name, head in MAIN.items()]
        first, units = f"contact in {table.joint}", [f"{head} {measure.unit}".strip() for head, measure, _ in columns]
        heads = (first, *(unit.translate(ASCII_UNITS) for unit in units))
        shown = [(table.runs[k], *(_within(values[k]) for *_, values in columns)) for k in rows]
        if rows:
            print_rows(console, heads, shown, left=(first,), folded=(first,))
    if contact.caution:
        console.print(contact.caution)
    for pair in contact.pairs:
        console.print(f"statistics of {pair.title}: {pair.sentence}")
        for row in pair.wrong:
            console.print(f"  {row.sentence().translate(ASCII_UNITS)}: ", _word(row.verdict), sep="")


def _within(value: Value) -> str:
    """A statistic and half the width of its interval: ``10.5 +-1.3``, ``2922 +-499``, ``0 +-0.01``."""
    if value.value is None or value.low is None or value.high is None:
        return _short(value.value, 3)
    half = (value.high - value.low) / 2
    return f"{_short(0.0 if 10 * abs(value.value) < half else value.value, 3)} +-{_short(half, 2)}"


def _short(value: float | None, digits: int) -> str:
    """A number to some digits, without a power of ten where it is large."""
    return f"{value:.0f}" if value is not None and 10**digits <= abs(value) < 1e6 else plain(value, digits)


def _word(verdict: str) -> Text:
    return Text(VERDICT_WORDS[verdict].upper() if verdict in LOUD else VERDICT_WORDS[verdict], style=COLOUR[verdict])


def _notes(runs: Sequence[ShownRun]) -> list[str]:
    """Which analytic model was compared, why a verdict is not the tolerance's, flags, and time without contact."""
    if not runs:
        return []
    models = ", ".join(dict.fromkeys(shown.run.analytic_model.replace("_", " ") for shown in runs))
    notes = [f"analytic model: {models}; differences are simulated minus analytic"]
    if any(shown.run.bends for shown in runs):
        notes.append("with the compliance of links and joints superposed; tolerances have what that neglects on top")
    if any(shown.run.numerical for shown in runs):
        notes.append(f"2 u_num: {NUMERICAL_MEANS}")
    notes += [f"compared at {span}" for span in dict.fromkeys(shown.span for shown in runs)]
    notes += [
        f"{shown.run.title}: {row.quantity.label}: {row.reason}" for shown in runs for row in shown.rows if row.reason
    ]
    for shown in runs:
        for sample, reason in list(shown.run.flags.items())[:1]:
            flagged = count(len(shown.run.flags), "position")
            notes.append(f"{shown.run.title}: {flagged} flagged, first {shown.over.at(int(sample))}: {reason}")
    notes += [
        f"{shown.run.title}: {joint} without contact {plain(100 * share, 2)} % of what is compared"
        for shown in runs
        for joint, share in shown.run.free_share.items()
        if share
    ]
    return notes

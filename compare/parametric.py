"""A question asked over and over of one mechanism whose fields take several values: one table of what each comes to."""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import cast

import numpy as np
from pydantic import BaseModel, JsonValue

from analytic.compiled.run import in_bulk
from analytic.errors import Error
from analytic.kinematics.assembly import Assembly
from analytic.kinematics.reach import turns_fully
from analytic.mechanism import Mechanism
from analytic.mechanism.dotted import Dotted, FieldError, find, with_values
from analytic.mechanism.model import as_written
from analytic.mechanism.one_line import count
from analytic.mechanism.units import UnitError, factor_to_si
from analytic.mechanism.written import BARE, NUMBER
from analytic.paper.superposition import whole_turn
from compare.accuracy import accuracy
from compare.analyse import analyse
from compare.arguments import Linkage, Values, cores, engines, linkage, with_map
from compare.crosscheck import crosscheck
from compare.faults import ArgumentError
from compare.judge.tolerances import Tolerances
from compare.limits import EFFORTS, ERROR, MEAN, RMS, ROUNDING, TRANSMISSION, WORST, between, errors
from compare.platform import platform_accuracy
from compare.progress import progress_bar
from compare.quantities import drive_signals, going, quantities
from compare.questions.accuracy import AccuracyQuestion, PlatformQuestion
from compare.questions.analyse import AnalyseQuestion
from compare.questions.crosscheck import CrosscheckQuestion
from compare.questions.question import Question, arguments, check_names
from compare.questions.sweep import SweepQuestion
from compare.results.accuracy import Accuracy
from compare.results.analysis import Analysis, Extremes, Limit
from compare.results.crosscheck import CrossCheck
from compare.results.looked_at import ByClearance
from compare.results.platform import PlatformAccuracy
from compare.results.sweep import Asks, Farthest, FieldValue, Group, Sweep, SweptColumn, SweptField, SweptPoint
from compare.strokes import STROKE
from compare.sweep import sweep as spread_out
from compare.versions import versions
from sim_models.engine import SimulationError, SimulatorMissing

MOST_POINTS = 100_000  # rows of a table: more is a mistake in a step

QUESTIONS: Mapping[Asks, tuple[type[Question], Callable[..., Analysis | Accuracy | PlatformAccuracy | CrossCheck]]] = {
    "analyse": (AnalyseQuestion, analyse),
    "accuracy": (AccuracyQuestion, accuracy),
    "platform_accuracy": (PlatformQuestion, platform_accuracy),
    "crosscheck": (CrosscheckQuestion, crosscheck),
}


class Answer(SweptPoint):
    """What a point comes to, with its columns, what was warned of, and the argument that cannot be used, if any."""

    columns: Mapping[str, SweptColumn] = {}
    argument: str = ""
    warnings: tuple[str, ...] = ()


def sweep(
    mechanism: Linkage,
    fields: Mapping[str, Values],
    asks: Asks = "analyse",
    *,
    workers: int | None = None,
    dask: str | None = None,
    progress: Callable[[str, int, int | None], None] | None = None,
    **options: object,
) -> Sweep:
    """What an analysis, an accuracy or a cross-check of a linkage comes to over a grid of values of its fields.

    ``fields`` are values by dotted name, as the mechanism's file nests it: ``{"drive.speed": "30 rpm:300 rpm:30 rpm",
    "joint.B.clearance": [1e-4, 2e-4]}``; numbers are SI, texts may have units.  A range is start, stop and step, stop
    included.  ``options`` are those of :func:`compare.analyse.analyse`, :func:`compare.accuracy.accuracy`,
    :func:`compare.platform.platform_accuracy` or :func:`compare.crosscheck.crosscheck`, whichever ``asks`` names; a
    ``clearance`` among them is the mechanism's own.
    Points are spread over ``workers`` processes (one a core), or over the workers of the ``dask`` scheduler of this
    address.  A point without an answer says why in its row, and the others stand.

    Raises MechanismError, ArgumentError for a name that is no field (with the nearest that is), ClusterError.
    """
    asked = SweepQuestion(mechanism, fields, asks, options=options, workers=workers, dask=dask, progress=progress)
    return swept(asked)


def swept(question: SweepQuestion) -> Sweep:
    """The answer of :func:`sweep`."""
    options = dict(question.options or {})
    base = linkage(question.mechanism, cast("Mapping[str, float] | None", options.pop("clearance", None)), large=True)
    of_asked, _ = QUESTIONS[question.asks]
    check_names("sweep", [each.name for each in arguments(of_asked)], options)
    asked = of_asked(base, **options)  # type: ignore[call-arg]  # what no point could use is refused at once
    if isinstance(asked, CrosscheckQuestion):
        engines(with_map(asked.simulator, asked.map))
    places = [_field(base, name) for name in question.fields]
    fields = [values_of(place, values) for place, values in zip(places, question.fields.values(), strict=True)]
    size = math.prod(len(field.values) for field in fields)
    if size > MOST_POINTS:
        raise ArgumentError("fields", f"that is {count(size, 'point')}; give at most {MOST_POINTS}")
    at = [dict(zip(question.fields, place, strict=True)) for place in product(*(range(len(f.values)) for f in fields))]
    plain = {name: _plain(value) for name, value in options.items()}
    if isinstance(asked, AccuracyQuestion) and asked.min_yield is not None:
        plain["min_yield"] = asked.min_yield
    runs = [
        {
            "asks": question.asks,
            "mechanism": as_written(base),
            "at": each,
            "values": {field.name: field.values[each[field.name]] for field in fields},
            "options": plain,
        }
        for each in at
    ]
    with progress_bar(question.progress) as progress:
        answers = [Answer(at=each) for each in at]
        workers = min(question.workers or cores(), len(runs))
        for end in spread_out(
            point,
            runs,
            workers=workers,
            dask=question.dask,
            progress=lambda done, total: progress("points", done, total),
        ):
            answers[end.index] = (
                Answer(at=at[end.index], failure=end.failure) if end.failure else Answer.model_validate(end.result)
            )
    _refuse_everywhere(answers)
    return Sweep(
        case=base.name,
        asks=question.asks,
        mechanism=base,
        options=cast("Mapping[str, JsonValue]", plain),
        fields=tuple(fields),
        columns={name: column for answer in answers for name, column in answer.columns.items()},
        points=tuple(
            SweptPoint.model_validate(answer.model_dump(include={*SweptPoint.model_fields})) for answer in answers
        ),
        versions=versions(),
        warnings=tuple(_alike(text for answer in answers for text in answer.warnings)),
    )


def _refuse_everywhere(answers: Sequence[Answer]) -> None:
    """Raises the ArgumentError that all points have alike: it is no point's own."""
    argument, why = answers[0].argument, answers[0].failure
    if argument and all((each.argument, each.failure) == (argument, why) for each in answers):
        raise ArgumentError(argument, why.removeprefix(f"{argument}: "))


def _alike(texts: Iterable[str]) -> Iterator[str]:
    """Each text once; of those that differ in their numbers the first, and how many there are."""
    kinds: dict[str, dict[str, None]] = {}
    for text in texts:
        kinds.setdefault(re.sub(r"\b\d[\d.]*(e[-+]?\d+)?\b", "", text), {})[text] = None
    for first, *others in kinds.values():
        yield f"{first} (and with {count(len(others), 'other set')} of numbers)" if others else first


# ---------------------------------------------------------------- what is varied


def _field(mechanism: Mechanism, name: str) -> Dotted:
    try:
        return find(mechanism, name)
    except FieldError as error:
        raise ArgumentError("fields", str(error)) from None


def values_of(field: Dotted, given: object) -> SweptField:
    """The values of a field as they are given.  Raises ArgumentError."""
    if isinstance(given, str):
        parts: list[object] = list(_ranged(field, given) if ":" in given else given.split(","))
    elif isinstance(given, Iterable) and not isinstance(given, Mapping):
        parts = [each.item() if isinstance(each, np.generic) else each for each in given]
    else:
        parts = [given]
    amounts = [_amount(field, part) for part in parts]
    units = {unit for value, unit in amounts if not isinstance(value, str)}
    if isinstance(given, str) and len(units - {""}) == 1:  # one unit is that of all
        amounts = [(value, unit or max(units)) for value, unit in amounts]
        units = {max(units)}
    values = tuple(_si(field, value, unit) for value, unit in amounts)
    if not values or any(isinstance(value, float) and not math.isfinite(value) for value in values):
        raise ArgumentError("fields", f"{field.name}: {given!r} cannot be used; give finite numbers")
    twice = next((value for k, value in enumerate(values) if value in values[:k]), None)
    if twice is not None:
        raise ArgumentError("fields", f"{field.name}: {twice!r} is there twice; give each value once")
    alike = len(units) == 1 and "" not in units
    return SweptField(
        name=field.name,
        unit=field.unit,
        values=values,
        written_unit=units.pop() if alike else field.unit,
        written=tuple(value for value, _ in amounts) if alike else values,
    )


def _ranged(field: Dotted, text: str) -> Iterator[str]:
    """Start, stop and what is between them, stop included, each with the unit that they share."""
    parts = [_amount(field, part) for part in text.split(":")]
    if len(parts) != 3 or any(isinstance(value, str) for value, _ in parts):
        raise ArgumentError("fields", f"{field.name}: {text!r} is no range; give start:stop:step")
    units = {unit for _, unit in parts if unit} or {""}
    if len(units) > 1:
        raise ArgumentError("fields", f"{field.name}: {text!r} has several units; give one to all three")
    start, stop, step = (float(value) for value, _ in parts)
    if not (all(map(math.isfinite, (start, stop, step))) and step > 0 and stop >= start):
        raise ArgumentError(
            "fields", f"{field.name}: {text!r} goes nowhere; give a stop above start and a step above 0"
        )
    size = (stop - start) / step
    if size > MOST_POINTS:
        raise ArgumentError("fields", f"{field.name}: {text!r} has more than {MOST_POINTS} values; give a larger step")
    unit = units.pop()
    for k in range(int(size + 1e-9) + 1):  # rounding of a step may not lose the stop
        yield f"{float(f'{start + k * step:.12g}')!r} {unit}".strip()


def _amount(field: Dotted, part: object) -> tuple[FieldValue, str]:
    """A number and the unit that it is written with, or a word without one."""
    if isinstance(part, bool) or not isinstance(part, str | int | float):
        raise ArgumentError("fields", f"{field.name}: {part!r} cannot be used; give numbers, or texts with units")
    if not isinstance(part, str):
        return float(part), ""
    written = None if BARE.fullmatch(part) else NUMBER.fullmatch(part)
    if written is not None:
        return float(written[1]), written[2]
    try:
        return float(part), ""
    except ValueError:
        if field.unit and not part.strip().isalpha():  # a word such as free is a value of a field with a unit too
            raise ArgumentError("fields", f"{field.name}: {part.strip()!r} is no number") from None
        return part.strip(), ""


def _si(field: Dotted, value: FieldValue, unit: str) -> FieldValue:
    if isinstance(value, str) or not unit:
        return value
    if not field.unit:
        raise ArgumentError("fields", f"{field.name}: {value:g} {unit} cannot be used; it is a number without a unit")
    try:
        return value * factor_to_si(unit, field.unit)
    except UnitError as error:
        raise ArgumentError("fields", f"{field.name}: {value:g} {unit} has {error}") from None


def _plain(value: object) -> object:
    """An option as plain data, so that it can go to another process."""
    if isinstance(value, BaseModel):
        return value.model_dump(mode="json", by_alias=True)
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, tuple | list):
        return [_plain(each) for each in value]
    return str(value) if isinstance(value, Path) else value


# ---------------------------------------------------------------- what it comes to


def point(run: Mapping[str, object]) -> dict[str, object]:
    """One point of a sweep: its :class:`Answer` as plain data, so that it may come from another process."""
    with warnings.catch_warnings(), in_bulk():
        warnings.simplefilter("ignore")  # they are in the result
        return _answer(run).model_dump(mode="json")


def _answer(run: Mapping[str, object]) -> Answer:
    asks, values = cast(Asks, run["asks"]), cast(Mapping[str, FieldValue], run["values"])
    at, options = cast(Mapping[str, int], run["at"]), dict(cast(Mapping[str, object], run["options"]))
    if isinstance(options.get("tolerances"), Mapping):
        options["tolerances"] = Tolerances.model_validate(options["tolerances"])
    if asks == "crosscheck":  # points share the cores, and one bar tells of them all
        options |= {"workers": 1, "progress": lambda *_: None}
    base = Mechanism.model_validate(run["mechanism"])
    asked = QUESTIONS[asks][1]
    try:
        varied = with_values(base, {find(base, name): value for name, value in values.items()})
        result = asked(varied, **options)
    except Error as error:
        why = str(error)
        while why.startswith(f"{base.name}: "):
            why = why.removeprefix(f"{base.name}: ")
        failed = isinstance(error, SimulationError | SimulatorMissing)
        argument = error.argument if isinstance(error, ArgumentError) else ""
        return Answer(at=at, failure=why, engine_failed=failed, argument=argument)
    if isinstance(result, CrossCheck):
        return _compared(at, result)
    answer = _analysed(at, result) if isinstance(result, Analysis) else _accurate(at, result)
    part = "" if options.get("angles") is not None else _part_of_turn(base, result)
    return answer.model_copy(update={"remark": "; ".join(said for said in (part, answer.remark) if said)})


def _part_of_turn(base: Mechanism, result: Analysis | Accuracy | PlatformAccuracy) -> str:
    """Between which crank angles a linkage was looked at that cannot turn round as the one that is varied does."""
    if not base.cranked or isinstance(result, PlatformAccuracy) or result.time is not None:
        return ""
    if whole_turn(result.crank_angle) or not turns_fully(Assembly(base)):
        return ""
    first, last = np.degrees(result.crank_angle[[0, -1]])
    return f"the crank does not turn round: looked at from {first:.4g} to {last:.4g} deg"


def _analysed(at: Mapping[str, int], result: Analysis) -> Answer:
    """The largest of each signal on request, of each joint's reaction and of what each drive gives, and where it is;
    the error of each output, and the share of limits that are broken or not known.
    """
    m, known, drives = result.mechanism, quantities(result.mechanism), drive_signals(result.mechanism)
    reactions = [f"reaction_{joint.name}_magnitude" for joint in m.joints]
    asked = [name for name, signal in result.kinds.items() if signal.on_request]
    units = {name: kind.unit for name, kind in result.kinds.items()}
    places, of_places = (result.crank_angle, "rad") if result.time is None else (result.time, "s")
    row = _Row()
    for name in (name for name in (*asked, *reactions, *drives) if name in result.signals):
        group: Group = "asked" if name in asked else "drive" if name in drives else "reaction"
        label, unit = known[name].label, units[name]
        peak, where = _peak(result.signals[name], places, result.extremes.get(name))
        row.add(group, name, label, unit, peak)
        row.add("place", f"{name}_at", f"place of {label}", of_places, where)
        if group != "reaction" and unit in EFFORTS and name in result.extremes:
            mean, effective = result.extremes[name].mean, result.extremes[name].rms
            mean = 0.0 if mean is not None and abs(mean) < ROUNDING * (effective or 0.0) else mean
            row.add("mean", f"{MEAN}{name}", f"mean of {label}", unit, mean)
            row.add("rms", f"{RMS}{name}", f"RMS of {label}", unit, effective)
    for what, signal in going(m).items() if m.cranked else ():
        ends = result.extremes.get(f"{STROKE}{what}")
        if ends is not None and ends.highest is not None and ends.lowest is not None:
            row.add("stroke", f"{STROKE}{what}", f"stroke of {what}", units[signal], ends.highest - ends.lowest)
    if TRANSMISSION in result.extremes:
        row.add("transmission", TRANSMISSION, "least transmission angle", "rad", result.extremes[TRANSMISSION].lowest)
    row.errors(result.errors, places)
    return row.answer(at, _unanswered(result.flags, len(result.crank_angle)), result.warnings, result.limits)


class _Row:
    """The columns of a point, and its numbers in them."""

    def __init__(self) -> None:
        self.columns: dict[str, SweptColumn] = {}
        self.numbers: dict[str, float | None] = {}

    def add(self, group: Group, name: str, label: str, unit: str, value: float | None) -> None:
        """Add a number (SI)."""
        self.columns[name] = SweptColumn(group=group, label=label, unit=unit)
        self.numbers[name] = value

    def errors(self, outputs: Mapping[str, ByClearance], places: np.ndarray | None) -> None:
        """Add the largest error of each output in equilibrium, then in the worst case, between ``places`` (N,) too
        where they are in a row.
        """
        series = errors(outputs)
        ends = {} if places is None else between(series, places)
        groups: Mapping[Group, tuple[str, str]] = {"error": (ERROR, "error of"), "worst_case": (WORST, "worst case of")}
        for group, (head, words) in groups.items():
            for output, error in outputs.items():
                name = f"{head}{output}"
                peak, _ = _peak(series[name], series[name] if places is None else places, ends.get(name))
                self.add(group, name, f"{words} {output}", error.unit, peak)

    def answer(
        self, at: Mapping[str, int], remark: str, warnings: tuple[str, ...], limits: Mapping[str, Limit] | None = None
    ) -> Answer:
        """The point, with a column of each number with a limit that is none yet, and the share of limits that are
        broken or not known.
        """
        limits = limits or {}
        for name, limit in limits.items():
            if not {name, f"{name}_magnitude", f"{ERROR}{name}"} & {*self.columns}:
                self.add("limited", name, name, limit.unit, limit.value)
        if limits:
            broken = sum(each.verdict != "holds" for each in limits.values())
            self.add("limit", "broken", "limits broken or not known", "1", broken / len(limits))
        return Answer(
            at=at, columns=self.columns, numbers=self.numbers, remark=remark, warnings=warnings, limits=limits
        )


def _accurate(at: Mapping[str, int], result: Accuracy | PlatformAccuracy) -> Answer:
    """The error of each output in equilibrium, and in the worst case."""
    row = _Row()
    if isinstance(result, PlatformAccuracy):
        row.errors(result.outputs, None)
        return row.answer(at, _unanswered(result.flags, result.holding.size, "pose"), result.warnings)
    by = result.tolerances
    if by is not None and by.within is not None:
        row.add("yield", "yield", "linkages within the limits", "1", by.within)
    row.errors(result.outputs, result.crank_angle)
    return row.answer(at, _unanswered(result.flags, len(result.crank_angle)), result.warnings, result.limits)


def _compared(at: Mapping[str, int], result: CrossCheck) -> Answer:
    """The verdict, and the comparison that uses up most of its tolerance."""
    rows = [
        (each.share or 0.0, run, each) for run in result.runs for each in run.discrepancies if each.share is not None
    ]
    judged = [row for row in rows if row[2].verdict in ("agrees", "disagrees")] or rows
    why = "; ".join(failure.why for failure in result.failures)
    remark, failure = (why, "") if result.runs else ("", why)
    answer = Answer(
        at=at,
        verdict=result.verdict,
        engine_failed=bool(why),
        remark=remark,
        failure=failure,
        warnings=result.warnings,
    )
    if not judged:
        return answer
    share, run, worst = max(judged, key=lambda row: row[0])
    column = SweptColumn(group="share", label="largest difference over its tolerance", unit="1")
    farthest = Farthest(
        run=run.title,
        signal=worst.signal,
        unit=worst.unit,
        max=worst.max,
        tolerance=worst.tolerance,
        at_crank_angle=worst.at_crank_angle,
    )
    update = {"columns": {"share": column}, "numbers": {"share": share}, "farthest": farthest}
    return answer.model_copy(update=update)


def _peak(values: np.ndarray, places: np.ndarray, ends: Extremes | None = None) -> tuple[float | None, float | None]:
    """That of values (N,) which is the largest in size, between the samples too where their ``ends`` are known, and
    which of the ``places`` (N,) it is at; None where there is none.
    """
    found = [(float(values[k]), float(places[k])) for k in np.flatnonzero(np.isfinite(values))]
    between = () if ends is None else ((ends.highest, ends.highest_at), (ends.lowest, ends.lowest_at))
    found += [(value, place) for value, place in between if value is not None and place is not None]
    return max(found, key=lambda each: abs(each[0]), default=(None, None))


def _unanswered(flags: Mapping[str, str], size: int, of: str = "crank angle") -> str:
    """How many samples have no answer, and why the first has none."""
    why = next(iter(flags.values()), "")
    return f"no answer at {len(flags)} of {count(size, of)}: {why}" if flags else ""

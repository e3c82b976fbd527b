"""A question asked over and over of one mechanism whose fields take several values: one table of what each comes to."""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
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
from compare.platform import platform_accuracy
from compare.progress import progress_bar
from compare.quantities import drive_signals, quantities
from compare.questions.accuracy import AccuracyQuestion, PlatformQuestion
from compare.questions.analyse import AnalyseQuestion
from compare.questions.crosscheck import CrosscheckQuestion
from compare.questions.question import Question, arguments, check_names
from compare.questions.sweep import SweepQuestion
from compare.results.accuracy import Accuracy
from compare.results.analysis import Analysis, Limit
from compare.results.crosscheck import CrossCheck
from compare.results.platform import PlatformAccuracy
from compare.results.sweep import Asks, Farthest, FieldValue, Group, Sweep, SweptColumn, SweptField, SweptPoint
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
    """What a point comes to, with its columns and what was warned of."""

    columns: Mapping[str, SweptColumn] = {}
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
        return Answer(at=at, failure=why, engine_failed=isinstance(error, SimulationError | SimulatorMissing))
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
    the error of each output, and the share of limits broken.
    """
    known, drives = quantities(result.mechanism), drive_signals(result.mechanism)
    reactions = [f"reaction_{joint.name}_magnitude" for joint in result.mechanism.joints]
    asked = [name for name, signal in result.kinds.items() if signal.on_request]
    columns: dict[str, SweptColumn] = {}
    numbers: dict[str, float | None] = {}
    place = "rad" if result.time is None else "s"
    for name in (name for name in (*asked, *reactions, *drives) if name in result.signals):
        group: Group = "asked" if name in asked else "drive" if name in drives else "reaction"
        columns[name] = SweptColumn(group=group, label=known[name].label, unit=result.kinds[name].unit)
        columns[f"{name}_at"] = SweptColumn(group="place", label=f"place of {known[name].label}", unit=place)
        numbers[name], numbers[f"{name}_at"] = _peak(result, name)
    for name, error in result.errors.items():
        columns[f"error_{name}"] = SweptColumn(group="error", label=f"error of {name}", unit=error.unit)
        numbers[f"error_{name}"] = _largest(error.equilibrium)
    _limits(result.limits, columns, numbers)
    remark = _unanswered(result.flags, len(result.crank_angle))
    return Answer(at=at, columns=columns, numbers=numbers, remark=remark, warnings=result.warnings)


def _limits(limits: Mapping[str, Limit], columns: dict[str, SweptColumn], numbers: dict[str, float | None]) -> None:
    """Add the share of limits broken, where there are any."""
    if limits:
        columns["broken"] = SweptColumn(group="limit", label="limits broken", unit="1")
        numbers["broken"] = sum(each.verdict != "holds" for each in limits.values()) / len(limits)


def _accurate(at: Mapping[str, int], result: Accuracy | PlatformAccuracy) -> Answer:
    """The error of each output in equilibrium, and in the worst case."""
    columns: dict[str, SweptColumn] = {}
    numbers: dict[str, float | None] = {}
    by = result.tolerances if isinstance(result, Accuracy) else None
    if by is not None and by.within is not None:
        columns["yield"] = SweptColumn(group="yield", label="linkages within the limits", unit="1")
        numbers["yield"] = by.within
    _limits(result.limits if isinstance(result, Accuracy) else {}, columns, numbers)
    groups: Mapping[Group, str] = {"error": "error of", "worst_case": "worst case of"}
    for group, words in groups.items():
        for name, output in result.outputs.items():
            columns[f"{group}_{name}"] = SweptColumn(group=group, label=f"{words} {name}", unit=output.unit)
            numbers[f"{group}_{name}"] = _largest(output.equilibrium if group == "error" else output.worst_case)
    size, of = (
        (len(result.crank_angle), "crank angle") if isinstance(result, Accuracy) else (result.holding.size, "pose")
    )
    remark = _unanswered(result.flags, size, of)
    return Answer(at=at, columns=columns, numbers=numbers, remark=remark, warnings=result.warnings)


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


def _peak(result: Analysis, name: str) -> tuple[float | None, float | None]:
    """The value of a signal that is the largest in size, between the samples too, and the crank angle (rad) or time (s)
    of it; None where there is none.
    """
    values, places = result.signals[name], result.crank_angle if result.time is None else result.time
    found = [(float(values[k]), float(places[k])) for k in np.flatnonzero(np.isfinite(values))]
    ends = result.extremes.get(name)
    between = () if ends is None else ((ends.highest, ends.highest_at), (ends.lowest, ends.lowest_at))
    found += [(value, place) for value, place in between if value is not None and place is not None]
    return max(found, key=lambda each: abs(each[0]), default=(None, None))


def _largest(values: np.ndarray) -> float | None:
    """The value that is the largest in size; None where there is none."""
    known = values[np.isfinite(values)]
    return float(known[np.argmax(np.abs(known))]) if known.size else None


def _unanswered(flags: Mapping[str, str], size: int, of: str = "crank angle") -> str:
    """How many samples have no answer, and why the first has none."""
    why = next(iter(flags.values()), "")
    return f"no answer at {len(flags)} of {count(size, of)}: {why}" if flags else ""

"""The stored validation report: made again, and what is no longer so.

Most runs rest in equilibrium and none impacts, so that they repeat: from another processor's arithmetic a share of a
tolerance comes out the same to its one digit, but for shares that are rounding and nothing else.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from operator import attrgetter
from pathlib import Path
from typing import TypeVar

from analytic.mechanism.one_line import count
from compare.arguments import Simulators
from compare.files import made_folder
from compare.results.document import Part
from tests.evidence.results.validation import (
    Apart,
    Bent,
    Carried,
    Delivered,
    Ended,
    InEngine,
    Published,
    Struck,
    Validation,
    ValidationCheck,
    ValidationRun,
)
from tests.evidence.stored import asked, other_versions, read, stale_page, store
from tests.evidence.validation.beside import with_beside
from tests.evidence.validation.runs import run_all
from tests.evidence.validation.scales import checked, scales

WHERE = Path("reports")
PAGE = "README.md"
REMEDY = "write both with python -m tests.evidence validation update"
ROUNDING = 1e-3  # a share of a tolerance below this is rounding
CLEAR = 1e-2  # from here on one signal is nearest to its tolerance, and not by chance
FACTOR = 2.0  # by which a share may change: 0.14 and 0.16 are 0.1 and 0.2 to one digit
ANALYTIC = 1e-6  # relative: what is computed without an engine
ROUNDED = 5.0  # by which a published figure may change: a processor's rounding, enlarged, made 1.6e-7 of 4.5e-8
NOTHING = 0.1  # of what is allowed: a published figure that is met so well is met
FILES = 1e-6  # of the largest value: what is carried in files may lose
CHANCE = 2.5  # half widths of 95 % intervals, in quadrature: by chance next to never
REBOUND = 2e-3  # of restitution delivered
BEAMS = 1e-5  # of the displacement: a tenth of the last digit of the page

ENDS = 5e-3  # relative: of turns and rates at the end, by a processor's rounding; of energy and free shares absolute
KEPT = {
    "published": "name",
    "ended": "key",
    "laws": "key",
}  # tables that rest on what is not everywhere, and how a row is known

P = TypeVar("P", bound=Part)


def check_validation(
    simulators: Simulators = "all", folder: str | Path = WHERE, data: Path | None = None
) -> ValidationCheck:
    """Make all runs again, and a share of those at scales, and find what is not as it is stored; ``data`` is a folder
    with what others recorded, without which their figures are not looked at.

    Raises OptionError for a stored report that cannot be read, and what :func:`compare.arguments.engines` raises.
    """
    stored = read(Validation, folder)
    names, _ = asked(simulators)
    place = Path(folder)
    found = with_beside(run_all(names, checked(), data, whole=False), place)
    made_again, left_out = looked_at(stored, found)
    return ValidationCheck(
        stored=str(place / Validation.file),
        made_again=made_again,
        differences=(*stale_page(place / PAGE, stored.files()[PAGE], REMEDY), *differences(stored, found)),
        notes=tuple(other_versions(stored.versions, found.versions, "report")),
        left_out=left_out,
    )


def update_validation(folder: str | Path = WHERE, data: Path | None = None) -> Validation:
    """Make everything in every engine that is installed, and write the report and its page; without the folder of
    ``data`` the figures that rest on it are those of the stored report.  Raises OutputError.
    """
    with made_folder(Path(folder), "--reports"):
        stored = read(Validation, folder) if (Path(folder) / Validation.file).is_file() else None
        names, _ = asked("all")
        found = run_all(names, scales(), data, whole=True)
        kept = {} if stored is None else {name: _or_stored(stored, found, name) for name in KEPT}
        found = with_beside(found.model_copy(update=kept), Path(folder))
        store(found, folder, "--reports")
    return found


def _or_stored(stored: Validation, found: Validation, name: str) -> tuple[Part, ...]:
    """Rows of a table as they were found, in the stored order where they were stored, and those that were not found."""
    key = attrgetter(KEPT[name])
    again = {key(row): row for row in getattr(found, name)}
    before = {key(row): row for row in getattr(stored, name)}
    return tuple((before | again).values())


def looked_at(stored: Validation, found: Validation) -> tuple[str, tuple[str, ...]]:
    """How much of a stored report was made again, and what was left out because an engine is missing, in words."""
    runs = Counter(run.simulator for run in stored.runs)
    absent = [name for name in runs if name not in found.versions]
    left_out = [f"{count(runs[name], 'run')} of {name}" for name in absent]
    if stored.superposition and not found.superposition:
        left_out.append("superposition, which takes exudyn")
    total = len(stored.runs)
    tables = "first_order, workspaces" + (" and superposition" if found.superposition else "")
    sized = f"{len(found.scales)} of {len(stored.scales)} at scales"
    others = f"{len(found.published)} of {len(stored.published)} published"
    done = f"{total - sum(runs[name] for name in absent)} of {total} runs, {sized}, {others}, {tables} made again"
    return done, tuple(left_out)


def differences(stored: Validation, found: Validation) -> Iterator[str]:
    """What changed between two reports, a sentence each; engines that are not installed here are left out."""
    before, after = ({run.key: run for run in report.runs} for report in (stored, found))
    for key in sorted(before.keys() | after.keys()):
        if key[2] in found.versions:
            yield from (f"{', '.join(key)}: {what}" for what in _moved(before.get(key), after.get(key)))
    yield from _at_scales(stored, found)
    yield from _table("first_order", stored.first_order, found.first_order, ("clearance",), ANALYTIC, 0.0)
    for case in sorted(stored.workspaces.keys() | found.workspaces.keys()):
        old, new = (report.workspaces.get(case, ()) for report in (stored, found))
        yield from _table(f"workspaces, {case}", old, new, ("holding",), ANALYTIC, 0.0)
    for case, rows in found.in_engines.items():
        there = {(row.simulator, row.motion): row for row in stored.in_engines.get(case, ())}
        for row in rows:
            was = there.get((row.simulator, row.motion))
            yield from (f"{case} in {row.simulator}, {row.motion}, {what}" for what in _along(was, row))
    yield from _held(stored.published, found.published)
    yield from _ends(stored.ended, found.ended)
    yield from _bends(stored.bent, found.bent)
    yield from _in_files(stored.carried, found.carried)
    yield from _strikes(stored.struck, found.struck)
    yield from _rebounds(stored.delivered, found.delivered)
    yield from _read_again("map", ("folder",), stored.maps, found.maps)
    yield from _read_again("scoreboard", ("case",), stored.diagnosed, found.diagnosed)
    if found.superposition:
        keys = ("clearance", "crank_angle")
        yield from _table("superposition", stored.superposition, found.superposition, keys, 0.0, BEAMS)


def _at_scales(stored: Validation, found: Validation) -> Iterator[str]:
    """Verdicts at the scales that were made again, where they are not as they were."""
    before, after = (
        {(*row.scale, row.simulator, row.run): row.verdict for row in report.scales} for report in (stored, found)
    )
    again = {key[:4] for key in after}
    for key in sorted(key for key in before.keys() | after.keys() if key[:4] in again):
        if before.get(key) != after.get(key):
            where = f"at {key[0]:g} m, {key[1]:g} rad/s, mass ratio {key[2]:g}, {key[3]}, {key[4]}"
            yield f"{where}: was {before.get(key, 'not there')}, is {after.get(key, 'not there')}"


def _bends(stored: Sequence[Bent], found: Sequence[Bent]) -> Iterator[str]:
    """What changed of platforms on links that bend."""
    before = {(row.case, row.joints): row for row in stored}
    for row in found:
        where = f"{row.case} on links that bend, {row.joints} joints"
        changed = _changed(before.get((row.case, row.joints)), row, ("displacement", "off", "off_worst"))
        yield from (f"{where}: {what}" for what in changed)


def _in_files(stored: Sequence[Carried], found: Sequence[Carried]) -> Iterator[str]:
    """What files lose, and shares of tolerances that are too large or not as they were."""
    before = {(row.case, row.simulator): row for row in stored}
    for row in found:
        where = f"{row.case} exported from {row.simulator}"
        for name, lost in (("alone", row.alone), ("imported", row.imported or 0.0)):
            if lost > FILES:
                yield f"{where}: {name} is off by {lost:g} of the largest value, and {FILES:g} is allowed"
        for name, share in (("checked", row.checked), ("simulated", row.simulated or 0.0)):
            if share > 1.0:
                yield f"{where}: {name} disagrees, with {share:g} of a tolerance"
        changed = _changed(before.get((row.case, row.simulator)), row, ("checked", "simulated"), ROUNDING)
        yield from (f"{where}: {what}" for what in changed)


def _strikes(stored: Sequence[Struck], found: Sequence[Struck]) -> Iterator[str]:
    """Averages that are farther from what they were than their intervals leave open, by more than chance explains."""
    before = {row.key: row for row in stored}
    for row in found:
        where = f"{row.case} by {row.law} in {row.simulator}, friction {row.friction:g}"
        if row.key not in before:
            yield f"{where}: is new"
            continue
        for name, now in row.statistics.items():
            was = before[row.key].statistics.get(name)
            if was is None:
                yield f"{where}: {name} is new"
            elif abs((now.value or 0.0) - (was.value or 0.0)) > CHANCE * math.hypot(now.half_width, was.half_width):
                yield f"{where}: {name} was {was.value:g}, is {now.value:g}"


def _rebounds(stored: Sequence[Delivered], found: Sequence[Delivered]) -> Iterator[str]:
    """Restitutions that are not delivered as they were."""
    before = {(row.law, row.simulator, row.joint_model): row for row in stored}
    for row in found:
        old = before.get((row.law, row.simulator, row.joint_model))
        where = f"{row.law} in {row.simulator}"
        if old is None:
            yield f"restitution delivered by {where}: is new"
            continue
        pairs = zip(row.asked, old.delivered, row.delivered, strict=True)
        yield from (
            f"restitution delivered by {where}, asked for {e:g}: was {was}, is {now}"
            for e, was, now in pairs
            if abs((was or 0.0) - (now or 0.0)) > REBOUND
        )


def _ends(stored: Sequence[Ended], found: Sequence[Ended]) -> Iterator[str]:
    """Ends after many impacts that are not where they were."""
    before = {row.key: row for row in stored}
    for row in found:
        where, old = f"{row.by}, {1e3 * row.step:g} ms", before.get(row.key)
        if old is None:
            yield f"{where}: is new"
            continue
        for name in ("turns", "crank", "rod", "free", "touched", "gained"):
            was, now = getattr(old, name), getattr(row, name)
            size = max(abs(was.low), abs(was.high), 1.0)
            if max(abs(was.low - now.low), abs(was.high - now.high)) > ENDS * size:
                yield f"{where}: {name} was {was.low:g} to {was.high:g}, is {now.low:g} to {now.high:g}"


def _read_again(what: str, keys: tuple[str, ...], stored: Sequence[Part], found: Sequence[Part]) -> Iterator[str]:
    """Rows that are read from other files, where any field is another one; a row is known by its keys."""
    before, after = ({tuple(getattr(row, key) for key in keys): dict(row) for row in rows} for rows in (stored, found))
    for key in sorted(before.keys() | after.keys()):
        where, was, now = f"{what} {', '.join(map(str, key))}", before.get(key), after.get(key)
        if was is None or now is None:
            yield f"{where}: is {'new' if was is None else 'no longer there'}"
        else:
            yield from (f"{where}: {name} was {was[name]}, is {now[name]}" for name in was if was[name] != now[name])


def _along(old: InEngine | None, new: InEngine) -> Iterator[str]:
    """What changed of an engine's motion of a platform."""
    names = ("equilibrium", "equilibrium_worst", "first_order", "first_order_worst")
    yield from (f"along a spiral: {what}" for what in _changed(old, new, names, ROUNDING))


def _changed(old: P | None, new: P, names: Sequence[str], least: float = 0.0) -> Iterator[str]:
    """Numbers of a row that are not as they were; what is below ``least`` is rounding."""
    if old is None:
        yield "is new"
        return
    for name in names:
        was, now = getattr(old, name) or 0.0, getattr(new, name) or 0.0
        if max(was, now) > max(FACTOR * min(was, now), least):
            yield f"{name} was {was:g}, is {now:g}"


def _held(stored: Sequence[Published], found: Sequence[Published]) -> Iterator[str]:
    """Published figures that are missed, or whose share of what is allowed is not as it was."""
    before = _figures(stored)
    for key, apart in _figures(found).items():
        where, old = ", ".join(key), before.get(key)
        if apart.off > apart.allowed:
            yield f"{where}: is off by {apart.off:g}, and {apart.allowed:g} is allowed"
        elif old is None:
            yield f"{where}: is new"
        else:
            was, now = old.off / old.allowed, apart.off / apart.allowed
            if max(was, now) > max(ROUNDED * min(was, now), NOTHING):
                yield f"{where}: was off by {old.off:g}, is off by {apart.off:g}"


def _figures(sources: Sequence[Published]) -> dict[tuple[str, str, str], Apart]:
    """Published figures by source, figure and side."""
    return {(s.name, held.figure, apart.side): apart for s in sources for held in s.figures for apart in held.apart}


def _moved(old: ValidationRun | None, new: ValidationRun | None) -> Iterator[str]:
    if old is None or new is None:
        was, now = ("not there" if run is None else run.verdict for run in (old, new))
        yield f"verdict was {was}, is {now}"
        return
    if old.verdict != new.verdict:
        yield f"verdict was {old.verdict}, is {new.verdict}"
        return
    if (old.compared, old.signals) != (new.compared, new.signals):
        was, now = (str(run.signals) if run.compared else "not there" for run in (old, new))
        yield f"signals was {was}, is {now}"
        return
    small, large = sorted((old.share, new.share))
    other = old.closest != new.closest and small >= CLEAR
    if other or large > max(FACTOR * small * (1 + 1e-9), ROUNDING):
        was, now = (f"{100 * run.share:g} % ({run.closest})" for run in (old, new))
        yield f"largest share of a tolerance was {was}, is {now}"


def _table(
    name: str, old: Sequence[Part], new: Sequence[Part], keys: tuple[str, ...], relative: float, absolute: float
) -> Iterator[str]:
    """Rows of a table of numbers that are not as they were; a row is known by its keys."""
    before, after = ({tuple(row[key] for key in keys): row for row in map(_numbers, rows)} for rows in (old, new))
    for where in sorted(before.keys() | after.keys()):
        place = f"{name}, " + ", ".join(f"{key} {value:g}" for key, value in zip(keys, where, strict=True))
        was, now = before.get(where, {}), after.get(where, {})
        if not was or not now:
            yield f"{place}: row is {'new' if now else 'no longer there'}"
        for what in was:
            if what in now and not math.isclose(was[what], now[what], rel_tol=relative, abs_tol=absolute):
                yield f"{place}: {what} was {was[what]:g}, is {now[what]:g}"


def _numbers(row: Part) -> Mapping[str, float]:
    return {name: float(value) for name, value in row}

"""The stored validation report: reading it, and what is no longer so.

Most runs rest in equilibrium and none impacts, so that they repeat: from another processor's arithmetic a share of a
tolerance comes out the same to its one digit, but for shares that are rounding and nothing else.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from analytic.mechanism.file import describe
from analytic.mechanism.reading import ReadingError, read_json
from compare.evidence.validation.page import page
from compare.faults import OptionError

ROUNDING = 1e-3  # a share of a tolerance below this is rounding
CLEAR = 1e-2  # from here on one signal is nearest to its tolerance, and not by chance
FACTOR = 2.0  # by which a share may change: 0.14 and 0.16 are 0.1 and 0.2 to one digit
ANALYTIC = 1e-6  # relative: what is computed without an engine
BEAMS = 1e-5  # of the displacement: a tenth of the last digit of the page

Report = Mapping[str, Any]
Share = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class _Run(_Part):
    case: str
    run: str
    simulator: str
    verdict: str
    signals: int = 0
    closest: str = ""
    share: Share = 0.0


class _AtScale(_Part):
    length: Share
    speed: Share
    mass_ratio: Share
    simulator: str
    run: str
    verdict: Literal["agrees", "disagrees", "refused", "unjudged"]
    why: str = ""


class _FirstOrder(_Part):
    clearance: Share
    angle: Share
    magnitude: Share


class _Superposed(_Part):
    clearance: Share
    crank_angle: float
    first_order: Share
    equilibrium: Share


class _File(_Part):
    format: Literal[1] = Field(alias="schema")
    versions: dict[str, str | None]
    runs: list[_Run] = Field(min_length=1)
    scales: list[_AtScale]
    first_order: list[_FirstOrder]
    superposition: list[_Superposed]


def read(path: Path) -> dict[str, Any]:
    """A stored report.  Raises OptionError where there is none, or it is damaged."""
    remedy = "restore it, or write it with compare validation update"
    try:
        fields = read_json(path)
    except ReadingError as error:
        raise OptionError(f"--reports: {path} {error}; {remedy}") from None
    try:
        _File.model_validate(fields)
    except ValidationError as error:
        raise OptionError(f"--reports: {path}: {describe(error, fields, _File)[0]}; {remedy}") from None
    return fields


def stale_page(path: Path, stored: Report) -> Iterator[str]:
    """Where the page is not what the stored report makes of it."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        yield f"{path}: cannot be read ({error}); write it with compare validation update"
        return
    wanted = page(stored).splitlines()
    if lines != wanted:
        k = next(
            (k for k, pair in enumerate(zip(lines, wanted, strict=False)) if pair[0] != pair[1]),
            min(len(lines), len(wanted)),
        )
        yield f"{path}: line {k + 1} is not what validation.json says; write both with compare validation update"


def looked_at(stored: Report, found: Report) -> tuple[str, str]:
    """How much of a stored report was made again, and what was left out for want of an engine, in words; the latter may
    be empty.
    """
    count = Counter(run["simulator"] for run in stored["runs"])
    absent = [name for name in count if name not in found["versions"]]
    left_out = [f"{count[name]} runs of {name}" for name in absent]
    if stored["superposition"] and not found["superposition"]:
        left_out.append("superposition, which takes exudyn")
    total = len(stored["runs"])
    tables = "first_order and superposition" if found["superposition"] else "first_order"
    sized = f"{len(found['scales'])} of {len(stored['scales'])} at scales"
    return f"{total - sum(count[name] for name in absent)} of {total} runs, {sized}, {tables} made again", "; ".join(
        left_out
    )


def other_versions(stored: Report, found: Report) -> Iterator[str]:
    """Engines that are not those of the report, a sentence each; that alone is no difference."""
    for name, version in found["versions"].items():
        if stored["versions"].get(name, version) != version:
            yield f"{name} is {version} here, and the report was made with {stored['versions'][name]}"


def differences(stored: Report, found: Report) -> Iterator[str]:
    """What changed between two reports, a sentence each; engines that are not installed here are left out."""
    before, after = (
        {(run["case"], run["run"], run["simulator"]): run for run in report["runs"]} for report in (stored, found)
    )
    for key in sorted(before.keys() | after.keys()):
        if key[2] in found["versions"]:
            yield from (f"{', '.join(key)}: {what}" for what in _moved(before.get(key, {}), after.get(key, {})))
    yield from _at_scales(stored, found)
    yield from _table("first_order", stored, found, ("clearance",), ANALYTIC, 0.0)
    if found["superposition"]:
        yield from _table("superposition", stored, found, ("clearance", "crank_angle"), 0.0, BEAMS)


def _at_scales(stored: Report, found: Report) -> Iterator[str]:
    """Verdicts at the scales that were made again, where they are not as they were."""
    before, after = (
        {(r["length"], r["speed"], r["mass_ratio"], r["simulator"], r["run"]): r["verdict"] for r in report["scales"]}
        for report in (stored, found)
    )
    again = {key[:4] for key in after}
    for key in sorted(key for key in before.keys() | after.keys() if key[:4] in again):
        if before.get(key) != after.get(key):
            where = f"at {key[0]:g} m, {key[1]:g} rad/s, mass ratio {key[2]:g}, {key[3]}, {key[4]}"
            yield f"{where}: was {before.get(key, 'not there')}, is {after.get(key, 'not there')}"


def _moved(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[str]:
    for name in ("verdict", "signals"):
        if old.get(name) != new.get(name):
            yield f"{name} was {old.get(name, 'not there')}, is {new.get(name, 'not there')}"
            return
    small, large = sorted((old.get("share", 0.0), new.get("share", 0.0)))
    other = old.get("closest") != new.get("closest") and small >= CLEAR
    if other or large > max(FACTOR * small * (1 + 1e-9), ROUNDING):
        was, now = (f"{100 * run.get('share', 0.0):g} % ({run.get('closest')})" for run in (old, new))
        yield f"largest share of a tolerance was {was}, is {now}"


def _table(
    name: str, stored: Report, found: Report, keys: tuple[str, ...], relative: float, absolute: float
) -> Iterator[str]:
    """Rows of a table that are not as they were; a row is known by its keys."""
    before, after = ({tuple(row[key] for key in keys): row for row in report[name]} for report in (stored, found))
    for where in sorted(before.keys() | after.keys()):
        place = f"{name}, " + ", ".join(f"{key} {value:g}" for key, value in zip(keys, where, strict=True))
        old, new = before.get(where, {}), after.get(where, {})
        if not old or not new:
            yield f"{place}: row is {'new' if new else 'no longer there'}"
        for what in old.keys() & new.keys():
            if not math.isclose(old[what], new[what], rel_tol=relative, abs_tol=absolute):
                yield f"{place}: {what} was {old[what]:g}, is {new[what]:g}"

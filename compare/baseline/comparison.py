"""What has moved against a baseline: whether its runs are still the case's, and each column that is not where
it was.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence

import numpy as np
from pydantic import JsonValue

from analytic.mechanism.errors import brief
from analytic.mechanism.signals import wrapped
from compare.baseline.file import PLACE_COLUMNS, UNDIRECTED, MovedLimits, StoredRun, by_itself, inline, printable
from compare.results.baselines import Moved

SAME_ROW = 1e-6  # deg, s
MOST_NAMED = 5  # fields of a linkage that has changed
WEAK_JOINT = 1e-3  # of the run's largest force: the size of a weaker joint's is held to that


def fits(stored: Sequence[StoredRun], fresh: Sequence[StoredRun]) -> str:
    """Why two sets of runs cannot be compared, or nothing."""
    if [run.name for run in stored] != [run.name for run in fresh]:
        return f"it has the runs {_listed(stored)}; the case now has {_listed(fresh)}"
    for old, new in zip(stored, fresh, strict=True):
        if bool(old.skipped) != bool(new.skipped):
            return f"run {old.name!r} " + (
                f"was skipped ({old.skipped}) and now runs" if old.skipped else f"is skipped now: {new.skipped}"
            )
        if old.columns != new.columns or old.rows.shape != new.rows.shape:
            return f"run {old.name!r} has other columns or another number of crank angles"
        if (
            old.places is not None
            and new.places is not None
            and not np.allclose(old.places, new.places, rtol=0, atol=0.5e-4 + SAME_ROW)
        ):
            return f"run {old.name!r} is at other crank angles"
    return ""


def remade(stored: Sequence[StoredRun], fresh: Sequence[StoredRun]) -> str:
    """What runs that fit are otherwise made with, of the first that is; or nothing."""
    for run, new in zip(stored, fresh, strict=True):
        was, now = (json.loads(json.dumps(each.added)) for each in (run, new))
        if was != now:
            return f"run {run.name!r} was made with {_others(was, now)}, and is now made with {_others(now, was)}"
    return ""


def changed(stored: Mapping[str, JsonValue], now: Mapping[str, JsonValue]) -> str:
    """In which fields a linkage is another than the one that is stored, in words; empty where it is the same, or none
    is stored.
    """
    names = [name for name in {**stored, **now} if stored.get(name) != now.get(name)] if stored else []
    said = [
        f"{printable(brief(name))} {_told(stored.get(name))} -> {_told(now.get(name))}" for name in names[:MOST_NAMED]
    ]
    more = len(names) - MOST_NAMED
    return ", ".join([*said, *([f"and {more} more"] if more > 0 else [])])


def _told(value: JsonValue) -> str:
    return "none" if value is None else printable(brief(inline(value)))


def _others(added: Mapping[str, JsonValue], beside: Mapping[str, JsonValue]) -> str:
    """What a run has of its own that another one has not; a clearance of a joint in millimetres."""
    said = []
    for name, value in added.items():
        other = beside.get(name, {} if name == "clearance" else None)
        if isinstance(value, dict) and isinstance(other, dict):
            sizes = ((joint, size) for joint, size in value.items() if size != other.get(joint))
            said += [f"{name} {joint} {1e3 * size:.4g} mm" for joint, size in sizes if isinstance(size, float)]
        elif value != other:
            said.append(inline({name: value}))
    return ", ".join(said) or "none of that"


def _listed(runs: Sequence[StoredRun]) -> str:
    return ", ".join(repr(run.name) for run in runs) or "none"


def moved(old: StoredRun, new: StoredRun, tolerance: MovedLimits) -> list[Moved]:
    """Every column of a run that moved; the runs must fit."""
    largest = max(
        (float(np.nanmax(old.rows[:, j])) for j, name in enumerate(old.columns) if name.endswith("_magnitude [N]")),
        default=0.0,
    )
    moves = []
    for j, column in enumerate(old.columns):
        if column in PLACE_COLUMNS:
            continue
        signal, _, unit = column.removesuffix("]").partition(" [")
        by = new.rows[:, j] - old.rows[:, j]
        if unit == "deg":
            by = (by + 180) % 360 - 180
            by[_turned_up_or_lost(old.rows[:, j], new.rows[:, j], old.rows[:, j + 1])] = np.inf
        by = wrapped(by) if unit == "rad" else by
        allowed = _allowed(signal, unit, old.rows[:, j], largest, tolerance)
        gone = np.flatnonzero(np.abs(by) > allowed)
        if gone.size:
            k = int(gone[np.argmax(np.abs(by[gone]))])
            moves.append(
                Moved(
                    run=old.name,
                    signal=signal,
                    unit=unit,
                    by=float(by[k]),
                    was=float(old.rows[k, j]),
                    tolerance=allowed,
                    at=_place(old, k),
                    count=gone.size,
                    of=by.size,
                )
            )
    return moves


def _turned_up_or_lost(old: np.ndarray, new: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Where (N,) only one side has a direction, though the stored force is not just at the limit of having one."""
    limit = UNDIRECTED * size.max()
    return (np.isnan(old) != np.isnan(new)) & (np.abs(size - limit) > 0.01 * limit)


def _allowed(signal: str, unit: str, values: np.ndarray, largest: float, tolerance: MovedLimits) -> float:
    if unit in ("deg", "rad"):
        return tolerance.angle if unit == "deg" else math.radians(tolerance.angle)
    if by_itself(f"{signal} [{unit}]"):
        return tolerance.magnitude * float(np.abs(values).max())
    if signal.endswith("_magnitude"):
        return tolerance.magnitude * max(float(values.max()), WEAK_JOINT * largest)
    return tolerance.free_share if signal.startswith("free_share_") else tolerance.rms * float(values.max())


def _place(run: StoredRun, k: int) -> str:
    if run.places is None:
        return ""
    return f"{run.places[k]:.6g} {'deg' if run.columns[0] == PLACE_COLUMNS[0] else 's'}"

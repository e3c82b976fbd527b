"""Data in memory as columns by heading: a data frame, or any mapping of headings to numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from analytic.mechanism.one_line import shown
from compare.recorded.errors import DataError
from compare.recorded.formats import ColumnsByHeading, check_lengths, check_size, in_seconds, seconds

if TYPE_CHECKING:
    import pandas

Frame: TypeAlias = "Mapping[str, ArrayLike] | pandas.DataFrame"
"""A data frame, or numbers (N,) by heading: ``signal [unit]``, as a CSV file's header has them, or a frame that
a result or measured data gave."""


@dataclass(frozen=True)
class FrameSource:
    """A frame as the reader of files takes it, and what messages call it."""

    name: str
    columns: ColumnsByHeading

    def __str__(self) -> str:
        return self.name


def is_frame(given: object) -> bool:
    """Whether something has columns by heading."""
    return hasattr(given, "keys") and hasattr(given, "__getitem__")


def frame_name(run: str) -> str:
    """What messages call the frame of a run."""
    return f"frame {run!r}"


def frame_source(run: str, frame: Frame) -> FrameSource:
    """The columns of the frame of a run; moments in time are seconds after the first.  A pandas index that has a name
    is the first column; a series is a frame of one.  Raises DataError.
    """
    name = frame_name(run)
    if not is_frame(frame):
        raise DataError(
            f"{name}: {shown(type(frame).__name__)} has no columns by heading; give a data frame, or numbers by heading"
        )
    frame = frame.to_frame() if hasattr(frame, "to_frame") else frame  # a pandas Series
    index = getattr(frame, "index", None)
    if any(each is not None for each in getattr(index, "names", ())):
        frame = frame.reset_index()  # type: ignore[union-attr]  # pandas'
    headings = list(frame.keys())
    if twice := next((each for each in headings if headings.count(each) > 1), None):
        raise DataError(f"{name}: has {shown(str(twice))} twice; give each column a name of its own")
    units = getattr(frame, "attrs", {}).get("units", {})  # of our own frames
    columns: dict[str, np.ndarray | str] = {}
    for heading in headings:
        values, unit = _values(frame[heading]), units.get(heading)
        if isinstance(values, np.ndarray) and values.dtype.kind in "mM":
            columns[in_seconds(str(heading))] = seconds(values)
        else:
            columns[f"{heading} [{unit}]" if unit else str(heading)] = values
    check_lengths(name, columns)
    rows = next((values.size for values in columns.values() if isinstance(values, np.ndarray)), 0)
    check_size(name, rows, len(columns))
    return FrameSource(name, columns)


def _values(given: ArrayLike) -> np.ndarray | str:
    """A column's numbers (N,) or moments, or why it has none."""
    try:
        values = np.asarray(given)
        if values.dtype == object and values.size and all(isinstance(each, datetime) for each in values):
            values = np.array([each - values[0] for each in values], "timedelta64[us]")
        elif values.dtype == object:  # None, or pandas.NA, beside numbers
            values = np.array([np.nan if each is None or str(each) == "<NA>" else each for each in values])
    except (TypeError, ValueError):  # rows of several lengths
        return "is no vector of real numbers"
    if values.ndim != 1 or values.dtype.kind not in "iufmM":
        return f"holds {values.dtype} and no numbers" if values.ndim == 1 else "is no vector of real numbers"
    return values if values.dtype.kind in "mM" else values.astype(float)

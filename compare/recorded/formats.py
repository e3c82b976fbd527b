"""Tables that are no text: Parquet and Feather (pyarrow), and MAT files of version 5 (scipy)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from analytic.mechanism.one_line import shown
from compare.recorded.errors import DataError
from compare.recorded.headings import BRACKETS
from compare.recorded.text import CELLS, too_long

ColumnsByHeading = Mapping[str, np.ndarray | str]
"""Numbers (N,) by heading, or why a column has none."""


def reader(path: Path) -> Callable[[Path], ColumnsByHeading] | None:
    """What reads a file of that name; None for text.  Raises DataError where there is no such file."""
    if not path.is_file():
        what = "is a folder; give the path of a file in it" if path.is_dir() else "no such file; give its path"
        raise DataError(f"{path}: {what}")
    return {".parquet": _parquet, ".feather": _feather, ".arrow": _feather, ".mat": _mat}.get(path.suffix.lower())


def _parquet(path: Path) -> ColumnsByHeading:
    pyarrow = _pyarrow(path)
    try:
        with pyarrow.parquet.ParquetFile(path) as file:
            check_size(path.name, file.metadata.num_rows, file.metadata.num_columns)
            return _arrow(file.read())
    except (pyarrow.ArrowException, OSError, ValueError) as error:
        raise unreadable(path, "a Parquet", error) from None


def _feather(path: Path) -> ColumnsByHeading:
    pyarrow = _pyarrow(path)
    try:
        table = pyarrow.feather.read_table(path, memory_map=True)
        check_size(path.name, table.num_rows, table.num_columns)
        return _arrow(table)
    except (pyarrow.ArrowException, OSError, ValueError) as error:
        raise unreadable(path, "a Feather", error) from None


def _pyarrow(path: Path) -> Any:
    try:
        import pyarrow
        import pyarrow.feather
        import pyarrow.parquet
    except ImportError:
        raise DataError(
            f"{path.name}: is read by pyarrow, which is not installed; run: pip install 'linkage-crosscheck[parquet]',"
            " or save it as CSV"
        ) from None
    return pyarrow


def _arrow(table: Any) -> ColumnsByHeading:
    """Columns of an Arrow table; moments in time are seconds after the first."""
    import pyarrow.types as kinds

    columns: dict[str, np.ndarray | str] = {}
    for name, column in zip(table.column_names, table.columns, strict=True):
        if kinds.is_timestamp(column.type) or kinds.is_duration(column.type):
            kind = "datetime64" if kinds.is_timestamp(column.type) else "timedelta64"
            columns[in_seconds(name)] = seconds(column.to_numpy().astype(f"{kind}[ns]"))
        elif kinds.is_integer(column.type) or kinds.is_floating(column.type) or kinds.is_decimal(column.type):
            columns[name] = column.cast("float64").to_numpy()
        else:
            columns[name] = f"holds {column.type} and no numbers"
    return columns


def _mat(path: Path) -> ColumnsByHeading:
    from scipy.io import loadmat, whosmat
    from scipy.io.matlab import MatReadError

    try:
        shapes = {name: shape for name, shape, _ in whosmat(path)}
        check_size(path.name, max((int(np.prod(shape)) for shape in shapes.values()), default=0), max(1, len(shapes)))
        read = loadmat(path, squeeze_me=True, struct_as_record=False)
    except (MatReadError, NotImplementedError, OSError, ValueError, TypeError, KeyError, IndexError, EOFError) as error:
        raise unreadable(path, "a MAT (version 5)", error) from None
    columns: dict[str, np.ndarray | str] = {}
    for name, value in _vectors({name: value for name, value in read.items() if not name.startswith("__")}):
        real = isinstance(value, np.ndarray) and value.ndim == 1 and value.dtype.kind in "iuf"
        columns[name] = value.astype(float) if real else "is no vector of real numbers"
    check_lengths(path.name, columns)
    return columns


def check_lengths(name: str, columns: ColumnsByHeading) -> None:
    """Raises DataError for columns of several lengths."""
    sizes = {heading: values.size for heading, values in columns.items() if isinstance(values, np.ndarray)}
    if len(set(sizes.values())) > 1:
        each = ", ".join(f"{heading} {size}" for heading, size in sizes.items())
        raise DataError(f"{name}: its vectors have several lengths ({each[:300]}); keep those of one run together")


def in_seconds(heading: str) -> str:
    """The heading of moments or durations that are seconds now, whatever unit it has."""
    return f"{BRACKETS.sub('', heading).strip()} [s]"


def seconds(moments: np.ndarray) -> np.ndarray:
    """Moments or durations (N,) as seconds (N,) after the first."""
    return np.asarray((moments - moments[:1]) / np.timedelta64(1, "s"), float)


def _vectors(fields: Mapping[str, Any]) -> list[tuple[str, Any]]:
    """The variables of a MAT file by name; of a struct its fields."""
    vectors: list[tuple[str, Any]] = []
    for name, value in fields.items():
        inside = getattr(value, "_fieldnames", None)
        vectors += [(field, getattr(value, field)) for field in inside] if inside else [(name, value)]
    return vectors


def check_size(name: str, rows: int, columns: int) -> None:
    """Raises DataError for more numbers than are read."""
    if rows * columns > CELLS:
        raise too_long(name, rows, columns)


def unreadable(path: Path, kind: str, error: Exception) -> DataError:
    """The error of a file that its reader does not take."""
    why = " ".join((str(error) or type(error).__name__).split())[:200]
    return DataError(
        f"{path.name}: cannot be read as {kind} file ({shown(why)[1:-1]}); write it anew, or save it as CSV"
    )

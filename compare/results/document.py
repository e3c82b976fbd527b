"""What every document shares: frozen fields, series of numbers as arrays, JSON without NaN, and its presentation.

A field with a default may be absent from the file; every other one is always there.  In files a number that there is
none of is null; in Python it is None where it stands alone and NaN in a series.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Collection, Mapping, Sequence, Sized
from copy import copy
from difflib import get_close_matches
from pathlib import Path
from typing import IO, TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self, overload

import numpy as np
from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetPydanticSchema,
    PlainSerializer,
    ValidationError,
    ValidatorFunctionWrapHandler,
    WithJsonSchema,
)
from pydantic_core import CoreSchema, core_schema

from analytic.errors import Error
from analytic.mechanism import Mechanism as _Mechanism
from analytic.mechanism.assumed import Assumed
from analytic.mechanism.errors import describe
from analytic.mechanism.model import as_written
from analytic.mechanism.one_line import count, own_names
from analytic.mechanism.reading import ReadingError, read_json
from analytic.writing import write_atomically, write_together
from compare.files import alone_in, check_replaceable, made_folder, to_json
from compare.presentation import LEFT_OVER, Presentation, presentation

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure
    from rich.console import Console

    from compare.ci import JUnitSuite

NUMBER_OR_NULL = {"type": ["number", "null"]}
Row = Mapping[str, float | str | None]


class DocumentError(Error, ValueError):
    """A file is not the document that it was taken for; the message names file, field and value."""


def listed(values: np.ndarray) -> list[float | None]:
    """A series (N,) as plain numbers, None where there is none."""
    return [value if math.isfinite(value) else None for value in np.asarray(values, float).tolist()]


def rows_of(columns: Mapping[str, np.ndarray], **head: str) -> list[Row]:
    """A row for each sample of some columns (N,), None where there is no number; each begins with the ``head``."""
    return [head | dict(zip(columns, row, strict=True)) for row in zip(*map(listed, columns.values()), strict=True)]


def as_dataframe(rows: Sequence[Row], called: str, units: Mapping[str, str] | None = None) -> pandas.DataFrame:
    """Rows as a data frame with the ``units`` of its columns.  Raises ImportError with the remedy of what is ``called``
    where pandas is not installed.
    """
    try:
        import pandas
    except ImportError:
        raise ImportError(f"{called} needs pandas; run: pip install 'linkage-crosscheck[pandas]'") from None
    frame = pandas.DataFrame(rows)
    known = {"crank_angle": "rad", "time": "s", **(units or {})}
    frame.attrs["units"] = {name: unit for name, unit in known.items() if name in frame}
    return frame


def no_signal(name: str, those: Collection[str]) -> KeyError:
    """What is raised where a name is no signal of those that there are: it says which was meant."""
    near = [each for each in those if each.startswith(name)] or get_close_matches(name, those, n=3)
    hint = f"did you mean {' or '.join(near)}?" if near else f"they are {', '.join(those)}"
    return KeyError(f"{name}: no such signal; {hint}")


def pictured(draw: Callable[[Figure], None], called: str) -> Figure:
    """A matplotlib figure that is drawn.  Raises ImportError with the remedy of what is ``called`` where that is not
    installed.
    """
    try:
        from compare.results.picture import Picture
    except ImportError:
        raise ImportError(f"{called} needs matplotlib; run: pip install 'linkage-crosscheck[plot]'") from None
    figure = Picture(figsize=(8, 5), layout="constrained")
    draw(figure)
    return figure


def _array(values: np.ndarray | list[float | None]) -> np.ndarray:
    array = np.array(values, float)
    if array.ndim != 1:
        raise ValueError("give a list of numbers")
    array.flags.writeable = False
    return array


def _series(values: object, read: ValidatorFunctionWrapHandler) -> np.ndarray:
    return _array(values if isinstance(values, np.ndarray) else read(values))


def _grid(values: object, read: ValidatorFunctionWrapHandler) -> np.ndarray:
    array = _series(values, read)
    if not np.all(np.isfinite(array)):
        raise ValueError("each value is a number")
    return array


def _numbers(check: Any, number: CoreSchema) -> GetPydanticSchema:
    """Arrays as they are, lists with each value checked."""
    return GetPydanticSchema(
        lambda _, __: core_schema.no_info_wrap_validator_function(check, core_schema.list_schema(number))
    )


def _finite(value: Any) -> Any:
    if isinstance(value, float | np.floating) and not math.isfinite(value):
        return None
    return float(value) if isinstance(value, np.floating) else value


_AS_LIST = PlainSerializer(listed)
_SERIES_SCHEMA = WithJsonSchema({"type": "array", "items": NUMBER_OR_NULL})
_GRID_SCHEMA = WithJsonSchema({"type": "array", "items": {"type": "number"}})
_NUMBER = core_schema.float_schema(strict=True)
_FINITE = core_schema.float_schema(strict=True, allow_inf_nan=False)
Series = Annotated[np.ndarray, _numbers(_series, core_schema.nullable_schema(_NUMBER)), _AS_LIST, _SERIES_SCHEMA]
"""(N,) numbers, NaN where there is none; null in the file."""
Grid = Annotated[np.ndarray, _numbers(_grid, _FINITE), _AS_LIST, _GRID_SCHEMA]
"""(N,) numbers, all of them finite."""
Number = Annotated[float | None, BeforeValidator(_finite)]
"""A number, or None."""
Amount = Annotated[Annotated[float, Field(ge=0)] | None, BeforeValidator(_finite)]
"""A number that is not negative, or None."""
Text = Annotated[str, Field(min_length=1)]
Share = Annotated[float, Field(ge=0, le=1)]


Mechanism = Annotated[_Mechanism, PlainSerializer(as_written), Field(description="The linkage as in its TOML file.")]
Filled = Annotated[
    tuple[Assumed, ...],
    Field(description="Every number that was left out where the linkage is described, and what stands for it (SI)."),
]


class Part(BaseModel):
    """A part of a document.  Fields of a newer version are left out when it is read."""

    model_config = ConfigDict(frozen=True, extra="ignore", populate_by_name=True, arbitrary_types_allowed=True)

    def __repr__(self) -> str:
        """One line, however much the part holds."""
        return _brief(
            f"{type(self).__name__}({', '.join(f'{name}={_brief(repr(value), 40)}' for name, value in self)})"
        )

    def __str__(self) -> str:
        return repr(self)

    def __dir__(self) -> list[str]:
        return own_names(super().__dir__())

    @staticmethod
    def _check_sizes(series: Mapping[str, Sized], size: int, of: str = "sample") -> None:
        """Raise ValueError for a series by name that has not a value for each of so many samples."""
        for name, values in series.items():
            if len(values) != size:
                raise ValueError(f"{name} has {len(values)} values for {count(size, of)}")


def _brief(text: str, length: int = 160) -> str:
    line = " ".join(text.split())
    return line if len(line) <= length else f"{line[: length - 4]} ..."


class Document(Part):
    """One result, as it stands in its JSON file and as Python has it."""

    file: ClassVar[str]
    """Name of its JSON file."""
    described: ClassVar[str] = ""
    """Name of its JSON Schema's file, where another document's has that of its own."""
    remedy: ClassVar[str]
    """What to give instead, for messages about a file that is another one."""
    opens: ClassVar[str] = ""
    """The file of its folder that a person opens first; empty for what has none."""
    indent: ClassVar[int | None] = None
    """Of the JSON file; None for one line."""
    opened: ClassVar[str] = "report"
    """What that file is."""

    format: Literal[1] = Field(default=1, alias="schema")

    def to_json(self, indent: int | None = None) -> str:
        """The content of the JSON file."""
        return to_json(self.plain(), indent)

    def plain(self) -> dict[str, object]:
        """The content of the JSON file as Python's own types; None for null."""
        return {"schema": self.format} | self.model_dump(by_alias=True, exclude_unset=True, exclude={"format"})

    @classmethod
    def read(cls, path: str | Path) -> Self:
        """The document of a JSON file.  Raises DocumentError with file, field and value."""
        try:
            fields = read_json(Path(path))
        except ReadingError as error:
            raise DocumentError(f"{path}: {error}; {cls.remedy}") from None
        if "schema" not in fields:
            raise DocumentError(f"{path}: schema is missing; {cls.remedy}")
        try:
            return cls.model_validate(fields)
        except ValidationError as error:
            raise DocumentError(f"{path}: {describe(error, fields, cls)[0]}; {cls.remedy}") from None

    def rows(self) -> Sequence[Row]:
        """The document as a table: one mapping for each row, SI units, None where there is no number."""
        raise NotImplementedError(f"{type(self).__name__} has no table")

    def units(self) -> Mapping[str, str]:
        """SI unit of each column of the rows that has one."""
        return {}

    @overload
    def to_csv(self) -> str: ...
    @overload
    def to_csv(self, path: str | Path) -> Path: ...
    def to_csv(self, path: str | Path | None = None) -> str | Path:
        """The rows as CSV text, headed ``column [unit]``; an absent number is an empty cell.

        With a ``path`` the text is written there, whole or not at all, and the path is returned.  Raises OutputError.
        """
        rows, units = self.rows(), self.units()
        columns = list(dict.fromkeys(name for row in rows for name in row))
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow([f"{name} [{units[name]}]" if name in units else name for name in columns])
        writer.writerows([["" if row.get(name) is None else row[name] for name in columns] for row in rows])
        return out.getvalue() if path is None else write_atomically(Path(path), out.getvalue())

    def to_dataframe(self) -> pandas.DataFrame:
        """The rows as a data frame, whose ``attrs["units"]`` has the SI unit of each column that has one: ``lc.check``
        and ``lc.measured`` read it.  Raises ImportError with the remedy where pandas is not installed.
        """
        return as_dataframe(self.rows(), "to_dataframe", self.units())

    @property
    def drawable(self) -> Collection[str]:
        """The signals that :meth:`plot` draws by name; none of what has no series of one."""
        return ()

    def plot(self, *signals: str) -> Figure:
        """A matplotlib figure of what matters most, or of :attr:`drawable` signals by name, which a notebook shows by
        itself at the end of a cell.

        Raises ImportError with the remedy where matplotlib is not installed, TypeError for what has no such picture,
        KeyError with the near names for what is no signal.
        """
        shown = self._shown()
        draw, draw_signals = shown.plot, shown.plot_signals
        if draw is None:
            raise TypeError(f"{type(self).__name__} {shown.no_picture}")
        if not signals:
            return pictured(lambda figure: draw(self, figure), "plot")
        if draw_signals is None:
            raise TypeError(f"{type(self).__name__} has no picture of a signal by itself; use plot() or to_dataframe()")
        for name in signals:
            if name not in self.drawable:
                raise no_signal(name, self.drawable)
        return pictured(lambda figure: draw_signals(self, figure, signals), "plot")

    def files(self) -> dict[str, str]:
        """Text of every file of the report, by name; the JSON file first."""
        return {self.file: self.to_json(self.indent) + "\n"} | self._shown().files(self)

    def write(self, folder: str | Path, overwrite: bool = False) -> Path:
        """Write the JSON file and the report into a folder, whole or not at all; the folder.

        What a document of the same type and ``command`` has left there is replaced, all of it; anything else only to
        ``overwrite``.  Raises OutputError.
        """
        texts, remedy = self.files(), "choose another folder, or give overwrite=True"
        with made_folder(Path(folder), "folder") as place, alone_in(place, option="folder"):
            if not overwrite:
                check_replaceable(place, self.file, texts, lambda _: self._is_mine(place), "folder", remedy)
            replace_result(place, texts)
        return place

    def _is_mine(self, folder: Path) -> bool:
        """Whether the file in a folder is a document of this type and of the same command (some types have none)."""
        try:
            there = self.read(folder / self.file)
        except DocumentError:
            return False
        return getattr(there, "command", None) == getattr(self, "command", None)

    def print_to(self, console: Console | None = None, *, file: IO[str] | None = None) -> None:
        """Print what matters as a table, by default where ``print`` does, or into a ``file``, as ``print(file=...)``;
        names and paths as they are, brackets and colons too.  Raises ArgumentError.
        """
        from rich.console import Console

        from compare.faults import unusable

        if not isinstance(console, Console | None):
            raise unusable("console", console, "a rich Console, or an open file as print_to(file=...)")
        literal = copy(console or Console(file=file))  # its output is the console's
        literal._markup = literal._emoji = False
        self._shown().print_table(self, literal)

    def judgements(self) -> Sequence[JUnitSuite]:
        """What it judges, as test cases of a CI; nothing of what judges nothing."""
        return self._shown().judged(self)

    def _repr_html_(self) -> str:
        return self._shown().summary_html(self)

    def _shown(self) -> Presentation[Self]:
        return presentation(self)


def replace_result(folder: Path, texts: Mapping[str, str]) -> None:
    """Write the files of a result into a folder, by name, that is held for it (:func:`compare.files.alone_in`).

    An earlier result that loses a file to them goes as a whole, as far as its JSON file tells which files are its own;
    nothing else is touched.  Raises OutputError.
    """
    write_together(folder, texts, {name for left_over in LEFT_OVER for name in left_over(folder, set(texts))})

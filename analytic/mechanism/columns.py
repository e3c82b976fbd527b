"""What the columns of somebody's file mean: which signal each is, in which unit and with which sign; and how the file
is written.

It is what ``[columns]``, ``skip_rows``, ``separator`` and ``decimal`` say in measured.toml and in a map.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Literal, TypeVar

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, field_validator, model_validator

from analytic.errors import Error
from analytic.mechanism import Load, Mechanism
from analytic.mechanism.errors import describe
from analytic.mechanism.one_line import shown
from analytic.mechanism.reading import ReadingError, read_toml
from analytic.mechanism.signals import Signal, named
from analytic.mechanism.units import between
from analytic.mechanism.written import BARE, NUMBER

SEPARATORS = {"comma": ",", "semicolon": ";", "tab": "\t", "space": " ", "bar": "|"}
Separator = Literal[",", ";", "\t", " ", "|", "comma", "semicolon", "tab", "space", "bar"]
Finite = Annotated[float, Field(gt=-1e30, lt=1e30)]


class MapError(Error, ValueError):
    """A map of columns cannot be used; the message says why: file, field, value, remedy."""


class MapPart(BaseModel):
    """A table of a map: nothing but its fields, of their own kinds."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class Conversion(MapPart):
    """How somebody's numbers are a quantity: ``sign * scale * number + offset`` in ``unit``.

    A scale may be written with its unit, which is the quantity's where none is said, and an offset in whatever unit.
    """

    unit: Annotated[str, Field(max_length=100)] | None = None
    scale: Finite = 1.0
    offset: Finite = 0.0
    sign: Literal[1, -1] = 1

    @model_validator(mode="before")
    @classmethod
    def _in_one_unit(cls, given: object) -> object:
        """The fields with scale and offset in ``unit``.  Raises ValueError."""
        out = dict(given) if isinstance(given, Mapping) else {}
        for name in ("scale", "offset"):
            text = out.get(name)
            written = NUMBER.fullmatch(text) if isinstance(text, str) and not BARE.fullmatch(text) else None
            if written is None:
                continue
            number, unit = written.groups()
            if out.get("unit") is None and name == "offset":
                raise ValueError(f'offset = {text!r} goes with a unit; add that of the column, such as unit = "{unit}"')
            out[name] = float(number) * between(unit, str(out.setdefault("unit", unit)))
        return out or given

    @field_validator("scale")
    @classmethod
    def _not_nothing(cls, scale: float) -> float:
        if scale == 0:
            raise ValueError("a scale of 0 leaves nothing of it; give the size of one step, or leave it out")
        return scale

    def of(self, number: np.ndarray) -> np.ndarray:
        """Numbers (N,) in ``unit``."""
        return np.asarray(self.sign * self.scale * number + self.offset)

    def read(self, value: np.ndarray) -> np.ndarray:
        """The numbers (N,) of values in ``unit``."""
        return np.asarray((value - self.offset) / (self.sign * self.scale))


class ColumnMeaning(Conversion):
    """What one column is: the ``signal`` (or ``time``), or a ``load``, a force or a torque over the time of its
    file, as many times as the column says.  Without a unit that of the heading holds.  x and y of a vector that the
    file has along the axes of a body have its name for their ``frame``, and are turned into the ground's.
    """

    signal: Annotated[str, Field(min_length=1, max_length=200)] | None = None
    load: Load | None = None
    frame: Annotated[str, Field(min_length=1, max_length=200)] | None = None

    @model_validator(mode="after")
    def _check(self) -> ColumnMeaning:
        if (self.signal is None) == (self.load is None):
            raise ValueError(
                'a column is either a signal or a load: give signal = "...", or load = { body = "...", ... }'
            )
        if self.load is not None and self.frame is not None:
            raise ValueError("a column's load acts in the ground's frame; leave frame out")
        if self.load is not None and self.load.over:
            raise ValueError("a column's load varies with the column over its file's time; leave over out")
        if self.load is not None and any(self.load.force) == bool(self.load.torque):
            raise ValueError("a column's load is either force = [x, y], the direction of 1 N, or torque = 1")
        return self


Meaning = Annotated[
    ColumnMeaning | Literal["ignore"],
    BeforeValidator(lambda given: {"signal": given} if isinstance(given, str) and given != "ignore" else given),
]
"""What a column is; a text alone is its signal."""


class Layout(MapPart):
    """How files are written: columns by their heading, the headings of files without a header, lines before the header
    or, without, before the numbers, separator and decimal mark.

    What is left out is found in the file.  Of columns that are ``optional`` a file may lack some, and of several that
    are one signal its first is read.
    """

    columns: Annotated[Mapping[str, Meaning], Field(default_factory=dict)]
    headings: Annotated[
        tuple[Annotated[str, Field(min_length=1, max_length=200)], ...] | None,
        BeforeValidator(lambda given: tuple(given) if isinstance(given, list) else given),
        Field(min_length=1),
    ] = None
    optional: bool = False
    skip_rows: Annotated[int, Field(ge=0, le=10_000)] | None = None
    separator: Separator | None = None
    decimal: Literal[".", ","] | None = None

    @classmethod
    def with_headings(cls, headings: Sequence[str]) -> Layout:
        """That of files without a header, whose headings are these.  Raises MapError."""
        try:
            return cls.model_validate({"headings": list(headings)})
        except ValidationError:
            given = shown(", ".join(headings))
            raise MapError(f"columns: {given} has an empty heading, or none; give each column one") from None

    @property
    def delimiter(self) -> str | None:
        """The separator as a character; None if it is to be found."""
        return None if self.separator is None else SEPARATORS.get(self.separator, self.separator)


ANY_LAYOUT = Layout.model_validate({})
M = TypeVar("M", bound=BaseModel)


def read_map(path: Path, model: type[M]) -> M:
    """A map file as this model of its fields.  Raises MapError."""
    fields: dict[str, object] = {}
    try:
        fields = read_toml(path)
        return model.model_validate(fields)
    except ValidationError as error:
        raise MapError(f"{path}: {'; '.join(describe(error, fields, model))}") from None
    except ReadingError as error:
        raise MapError(
            f'{path}: {error}; give a TOML file with [columns], such as "phi_deg" = {{ signal = "crank_angle",'
            ' unit = "deg" }'
        ) from None


def readable(mechanism: Mechanism) -> dict[str, Signal]:
    """The signals that a data file of this mechanism may hold, by name, ``time`` apart; no sensor reads a rotation."""
    signals = named(mechanism.bodies, mechanism.joints, mechanism.drives, mechanism.sensors)
    return {name: signal for name, signal in signals.items() if signal.kind != "rotation"}

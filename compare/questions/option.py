"""How an argument is typed on a command line and what it must be: written once, in the annotation of its field.

    clearance: Annotated["Metres | None", Option("Radial clearances (m) in place of the case's own.", ByJoint())] = None

An :class:`ArgumentKind` reads the word of a command line (``parse``) and proves what a function was given (``check``);
both raise ArgumentError, which names the argument.  What computes is imported only when one of them is called.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum, StrEnum
from itertools import pairwise
from numbers import Integral, Real
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Generic, TypeVar, cast

from compare.faults import EVERY_PIN, ArgumentError, unusable

if TYPE_CHECKING:
    import numpy as np

    from compare.judge.tolerances import Tolerances


W = TypeVar("W")  # what typer makes of what is typed


class LeftOut(Enum):
    """The value that a command takes for an option that is left out."""

    AS_ARGUMENT = "what the function takes for its argument"
    REFUSED = "nothing: the option must be typed"


@dataclass(frozen=True)
class ArgumentKind(Generic[W]):
    """Any text, as it is.

    A command's help calls it ``metavar``.  ``units`` are that of a word and that of the argument.
    """

    metavar: str | None = None
    units: ClassVar[tuple[str, str]] = ("", "")
    word: ClassVar[type] = str  # what typer makes of what is typed
    repeated: ClassVar[bool] = False  # whether it may be typed several times

    def parse(self, word: W, called: str) -> object:
        """The argument that a word stands for."""
        return word

    def check(self, given: object, called: str) -> object:
        """The argument as it is used."""
        return given

    def stands_for(self, argument: object) -> object:
        """The word for an argument's default, as typer wants it."""
        return argument


@dataclass(frozen=True)
class Option:
    """An argument as an option of a command, or of Python alone where it is not ``typed``.

    ``{unit}`` in the ``help`` stands for the unit of who reads it.  The option is called like the field but for its
    ``name``.  ``also`` is another flag, a short one or an earlier one; ``formerly`` is an earlier name of the argument.
    """

    help: str
    kind: ArgumentKind = ArgumentKind()
    name: str = ""
    also: str = ""
    formerly: str = ""
    positional: bool = False
    typed: bool = True
    left_out: LeftOut | None = LeftOut.AS_ARGUMENT

    @property
    def typed_help(self) -> str:
        """The help of a command."""
        return self.help.replace("{unit}", self.kind.units[0])

    @property
    def python_help(self) -> str:
        """The help of a function."""
        return self.help.replace("{unit}", self.kind.units[1])


class Switch(ArgumentKind[bool]):
    """True or False."""

    word: ClassVar[type] = bool

    def check(self, given: object, called: str) -> bool:
        import numpy as np

        if isinstance(given, bool | np.bool_):
            return bool(given)
        raise unusable(called, given, "True or False")


@dataclass(frozen=True)
class Choice(ArgumentKind[StrEnum]):
    """One of some words."""

    choices: tuple[str, ...] = ()

    @property
    def word(self) -> type[StrEnum]:  # type: ignore[override]
        """An enumeration, of which typer offers the choice."""
        return _enumeration(self.choices)

    def parse(self, word: StrEnum, called: str) -> object:
        return str(word)

    def check(self, given: object, called: str) -> object:
        if isinstance(given, str) and given in self.choices:
            return str(given)
        raise unusable(called, given, " or ".join(map(repr, self.choices)))

    def stands_for(self, argument: object) -> object:
        return None if argument is None else self.word(str(argument))


class AllOrNone(Choice):
    """True or False, or one of two words that stand for them."""

    def parse(self, word: StrEnum, called: str) -> bool:
        """Whether the first word was typed."""
        return str(word) == self.choices[0]

    def check(self, given: object, called: str) -> bool:
        return given == self.choices[0] if given in self.choices else Switch().check(given, called)

    def stands_for(self, argument: object) -> object:
        return super().stands_for(self.choices[0 if argument else 1])


class Address(ArgumentKind[str]):
    """Where a program listens."""

    def check(self, given: object, called: str) -> str:
        if isinstance(given, str):
            return given
        raise unusable(called, given, "its address, such as tcp://localhost:8786")


@dataclass(frozen=True)
class Whole(ArgumentKind[int]):
    """A whole number within bounds."""

    least: int = 0
    most: int | None = None
    word: ClassVar[type] = int

    def check(self, given: object, called: str) -> int:
        if isinstance(given, Integral) and not isinstance(given, bool):
            number = int(given)
            if self.least <= number and (self.most is None or number <= self.most):
                return number
        accepted = f"of {self.least} or more" if self.most is None else f"from {self.least} to {self.most}"
        raise unusable(called, given, f"a whole number {accepted}")


class RealNumber(ArgumentKind[float]):
    """A number, which the function proves."""

    word: ClassVar[type] = float


class Moment(RealNumber):
    """A crank angle, typed in degrees, or a time (s): the command knows which, as it has the result."""

    units: ClassVar[tuple[str, str]] = ("deg", "rad")


class Angle(ArgumentKind[str]):
    """An angle, typed in degrees or with its unit."""

    units: ClassVar[tuple[str, str]] = ("deg", "rad")

    def parse(self, word: str, called: str) -> float:
        remedy = "give degrees, or a number with its unit"
        return _amount(word, "rad", called, remedy, math.radians)


class AboveZero(ArgumentKind[str]):
    """A number above 0, in an SI ``unit`` or with its own, if it has one."""

    accepted: ClassVar[str] = "a number above 0"
    unit: ClassVar[str] = ""

    def parse(self, word: str, called: str) -> float:
        return _amount(word, self.unit, called, f"give {self.accepted}")

    def check(self, given: object, called: str) -> float:
        """More than nothing."""
        if isinstance(given, Real) and not isinstance(given, bool) and 0 < float(given) < math.inf:
            return float(given)
        raise unusable(called, given, self.accepted)


class Seconds(AboveZero):
    """A stretch of time, in seconds or with its unit."""

    accepted: ClassVar[str] = "a number of seconds above 0"
    unit: ClassVar[str] = "s"


class Part(ArgumentKind[str]):
    """A part of a whole, ``99%`` or 0.99."""

    accepted: ClassVar[str] = "more than 0% and no more than 100%, such as 99%, or 0.99"

    def parse(self, word: str, called: str) -> float:
        """The part as a number up to 1."""
        try:
            return float(word[:-1]) / 100 if word.endswith("%") else float(word)
        except ValueError:
            raise unusable(called, word, self.accepted) from None

    def check(self, given: object, called: str) -> float | None:
        """More than nothing and no more than all; None stays."""
        if given is None:
            return None
        value = self.parse(given, called) if isinstance(given, str) else given
        if isinstance(value, Real) and not isinstance(value, bool) and 0 < float(value) <= 1:
            return float(value)
        raise unusable(called, given, self.accepted)


class Listed(ArgumentKind[str]):
    """Words with commas between them, which the function proves."""

    def parse(self, word: str, called: str) -> list[str]:
        return listed_once(word, called)


@dataclass(frozen=True)
class NameList(Listed):
    """Names, with commas between them, at least so many."""

    least: int = 0

    def check(self, given: object, called: str) -> tuple[str, ...]:
        from compare.arguments import names

        return names(given, called, self.least)


class RepeatedNames(ArgumentKind[list[str]]):
    """Names, with commas between them, in an option that may be repeated."""

    repeated: ClassVar[bool] = True

    def parse(self, word: list[str], called: str) -> list[str]:
        return NameList().parse(",".join(word), called)

    def check(self, given: object, called: str) -> tuple[str, ...]:
        return NameList().check(given, called)

    def stands_for(self, argument: object) -> object:
        """None of no names, which typer cannot show."""
        return argument or None


@dataclass(frozen=True)
class ByJoint(ArgumentKind[str]):
    """Lengths by joint, ``B=1e-4,E=0.2mm``, or one for every pin, ``0.1mm``; that the linkage has these joints is for
    the function to prove.
    """

    each: str = "JOINT=metres, such as B=1e-4 or B=0.1mm, or one for every pin"
    place: ClassVar[str] = "joint"
    unit: ClassVar[str] = "m"
    every: ClassVar[str] = EVERY_PIN

    def parse(self, word: str, called: str) -> dict[str, float | str]:
        """The numbers, each joint once."""
        sizes: dict[str, float | str] = {}
        for part in word.split(","):
            name, given, value = part.partition("=")
            if not given and self.every:
                name, value = self.every, part
            if name in sizes and name == self.every:
                why = f"{word!r} gives every {self.place} several; give one, or each by name: B=0.1mm,E=0.2mm"
                raise ArgumentError(called, why)
            if name in sizes:
                raise ArgumentError(called, f"{self.place} {name} is there twice; give each {self.place} once")
            sizes[name] = self.size(value, called)
        return sizes

    def size(self, value: str, called: str) -> float | str:
        """A number."""
        return _amount(value, self.unit, called, f"give {self.each}")


class StepByJoint(ByJoint):
    """Steps by joint, rad or m: which, the function knows, and reads what is written with its unit."""

    every: ClassVar[str] = ""

    def size(self, value: str, called: str) -> float | str:
        return value if value[-1:].isalpha() else super().size(value, called)


class BySignal(ByJoint):
    """Numbers above 0 by signal, ``drive_torque=0.05``, or with their unit; that there are these signals, and such a
    unit, is for the function to prove.
    """

    place: ClassVar[str] = "signal"
    unit: ClassVar[str] = ""
    every: ClassVar[str] = ""

    def size(self, value: str, called: str) -> float | str:
        from analytic.mechanism.written import NUMBER

        return value if NUMBER.fullmatch(value) else super().size(value, called)

    def check(self, given: object, called: str) -> dict[str, float | str]:
        """The numbers by signal, or texts with their unit."""
        accepted = f"a number above 0, or a text with its unit, by signal: {self.each}"
        given = self.parse(given, called) if isinstance(given, str) else given
        if not isinstance(given, Mapping) or not given:
            raise unusable(called, given, accepted)
        for name, size in given.items():
            known = isinstance(size, Real) and not isinstance(size, bool) and 0 < float(size) < math.inf
            if not known and not isinstance(size, str):
                raise ArgumentError(called, f"{name} = {size!r} cannot be used; give {accepted}")
        return {str(name): size if isinstance(size, str) else float(size) for name, size in given.items()}


@dataclass(frozen=True)
class Limits(ArgumentKind[list[str]]):
    """Limits by name, such as the ``example``, in an option that may be repeated; that there are such names, and their
    units, is for the function to prove.
    """

    example: str = ""
    repeated: ClassVar[bool] = True

    def parse(self, word: list[str], called: str) -> dict[str, str] | None:
        """What is written for each name."""
        limits: dict[str, str] = {}
        for part in ",".join(word).split(",") if word else ():
            name, given, size = part.partition("=")
            if not (name and given and size):
                raise ArgumentError(called, f"{part!r} cannot be used; give {self.metavar}, such as {self.example}")
            if name in limits:
                raise ArgumentError(called, f"{name} is there twice; give one limit to each")
            limits[name] = size
        return limits or None

    def check(self, given: object, called: str) -> object:
        return self.parse([given], called) if isinstance(given, str) else given

    def stands_for(self, argument: object) -> object:
        """None of no limits, which typer cannot show."""
        return argument or None


@dataclass(frozen=True)
class WithUnit(ArgumentKind[str]):
    """A number, or one that is written with its unit, in an SI ``unit``."""

    unit: str = ""

    def parse(self, word: str, called: str) -> float:
        return _amount(word, self.unit, called, f"give {self.unit}, or a number with its unit")

    def check(self, given: object, called: str) -> float | None:
        """The number in SI; None stays."""
        if given is None:
            return None
        value = self.parse(given, called) if isinstance(given, str) else given
        if isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value) and value != 0:
            return float(value)
        raise unusable(called, given, f"a finite number other than 0, in {self.unit} or with its unit")


class ByBody(ArgumentKind[list[str]]):
    """Forces by body, ``coupler=0:-50``, in an option that may be repeated; that there are these bodies is for the
    function to prove.
    """

    repeated: ClassVar[bool] = True

    def parse(self, word: list[str], called: str) -> dict[str, tuple[float, float]] | None:
        forces: dict[str, tuple[float, float]] = {}
        remedy = "give BODY=X:Y in N, such as coupler=0:-50"
        for part in ",".join(word).split(",") if word else ():
            name, given, both = part.partition("=")
            x, colon, y = both.partition(":")
            if not (name and given and colon):
                raise ArgumentError(called, f"{part!r} cannot be used; {remedy}")
            if name in forces:
                raise ArgumentError(called, f"body {name} is there twice; give it one force")
            forces[name] = _amount(x, "N", called, remedy), _amount(y, "N", called, remedy)
        return forces or None

    def check(self, given: object, called: str) -> object:
        """The forces by body; None stays."""
        if given is None:
            return None
        accepted = "a force (x, y) in N by body, such as {'coupler': (0.0, -50.0)}"
        if not isinstance(given, Mapping):
            raise unusable(called, given, accepted)
        for force in given.values():
            both = list(force) if isinstance(force, list | tuple) else []
            if len(both) != 2 or not all(isinstance(f, Real) and math.isfinite(f) for f in both):
                raise unusable(called, given, accepted)
        return {str(body): (float(x), float(y)) for body, (x, y) in given.items()}

    def stands_for(self, argument: object) -> object:
        """None of no forces, which typer cannot show."""
        return argument or None


class IncreasingNumbers(ArgumentKind[str]):
    """Numbers with commas between them, each once."""

    accepted: ClassVar[str] = "finite numbers"

    def parse(self, word: str, called: str) -> list[float]:
        """The numbers, increasing, in the unit of the argument."""
        typed, unit = self.units
        remedy = f"give {self.accepted.format(typed)}, separated by commas"
        parts = [_amount(part, unit, called, remedy, self.converted) for part in listed_once(word, called)]
        for value in parts:
            if not math.isfinite(value):
                raise ArgumentError(called, f"{value:g} cannot be used; {remedy}")
        own = self.converted(1.0)
        return [value * own for value in self.increasing([value / own for value in parts], called, typed)]

    def check(self, given: object, called: str) -> tuple[float, ...]:
        return self.increasing(given, called, self.units[1])

    def increasing(self, given: object, called: str, unit: str) -> tuple[float, ...]:
        """The numbers, each once, increasing."""
        from compare.arguments import numbers

        ordered = sorted(numbers(given, called, unit).tolist())
        twice = next((value for value, after in pairwise(ordered) if value == after), None)
        if twice is not None:
            raise ArgumentError(called, f"{twice:g} is there twice; give each once")
        return tuple(ordered)

    def converted(self, typed: float) -> float:
        """A typed number in the unit of the argument."""
        return typed


class PositiveNumbers(IncreasingNumbers):
    """Numbers above zero."""

    accepted: ClassVar[str] = "{} above 0"

    def increasing(self, given: object, called: str, unit: str) -> tuple[float, ...]:
        """The numbers, increasing, above zero."""
        ordered = super().increasing(given, called, unit)
        if ordered[0] <= 0:
            raise ArgumentError(called, f"{ordered[0]:g} cannot be used; give {unit} above 0")
        return ordered


class Clearances(PositiveNumbers):
    """Clearances (m)."""

    units: ClassVar[tuple[str, str]] = ("m", "m")


class Speeds(PositiveNumbers):
    """Speeds of a crank, typed in rpm."""

    units: ClassVar[tuple[str, str]] = ("rpm", "rad/s")

    def converted(self, typed: float) -> float:
        """A speed in rad/s."""
        return typed * math.pi / 30


class Evenly(ArgumentKind[str]):
    """Numbers evenly apart, typed as a range; that they can be used is for the function to prove."""

    unit: ClassVar[str]
    example: ClassVar[str]
    most: ClassVar[int]
    wrong: ClassVar[str]  # what is said of a range that cannot be

    def read(self, given: object, called: str) -> np.ndarray:
        """The numbers (N,) as a function is given them, a range as it is typed too.  Raises ArgumentError."""
        from compare.arguments import numbers

        ranged = isinstance(given, str) and ":" in given
        return self.parse(cast(str, given), called) if ranged else numbers(given, called, self.unit)

    def parse(self, word: str, called: str) -> np.ndarray:
        """The numbers (N,) in SI, stop included.  Raises ArgumentError."""
        import numpy as np

        from analytic.mechanism.written import one_unit

        one = self.typed(1.0)
        try:
            start, stop, step = _amounts(one_unit(word.split(":")), self.unit, lambda size: size / one)
        except ValueError as error:
            why = f"{word}: give start:stop:step in {self.example}{_of_unit(error)}"
            raise ArgumentError(called, why) from None
        if not (all(map(math.isfinite, (start, stop, step))) and step > 0 and self.goes(start, stop)):
            raise ArgumentError(called, f"{word}: {self.wrong}")
        if (stop - start) / step > self.most:
            raise ArgumentError(called, f"{word}: that is more than {self.most} {called}; use a larger step")
        return np.asarray(one * (start + step * np.arange(int((stop - start) / step + 1e-9) + 1)))

    def goes(self, start: float, stop: float) -> bool:
        """Whether a range may begin and end so."""
        return stop >= start

    def typed(self, size: float) -> float:
        """A number without a unit in SI."""
        return size


class Angles(Evenly):
    """Crank angles, typed in degrees."""

    units: ClassVar[tuple[str, str]] = ("deg", 'rad; a text "20:160:5" is in deg')
    unit: ClassVar[str] = "rad"
    example: ClassVar[str] = "degrees, such as 20:160:5"
    most: ClassVar[int] = 1_000_000
    wrong: ClassVar[str] = "stop must not be below start, and step must be positive (degrees)"

    def typed(self, size: float) -> float:
        """An angle in radians."""
        return math.radians(size)


class Times(Evenly):
    """Times (s)."""

    unit: ClassVar[str] = "s"
    example: ClassVar[str] = "seconds, such as 0:1:0.02"
    most: ClassVar[int] = 100_000
    wrong: ClassVar[str] = "give a start of 0 or more, a later stop and a positive step (seconds)"

    def goes(self, start: float, stop: float) -> bool:
        return 0 <= start < stop


class Places(ArgumentKind[str]):
    """A grid of places (m)."""

    def parse(self, word: str, called: str) -> tuple[tuple[float, float, int], tuple[float, float, int]]:
        """Lowest, highest and number of the x and of the y.  Raises ArgumentError."""
        remedy = "give x0:x1:nx,y0:y1:ny in metres, such as -0.1:0.1:41,0:0.2:41"
        axes = [part.split(":") for part in word.split(",")]
        if [len(axis) for axis in axes] != [3, 3]:
            raise ArgumentError(called, f"{word}: {remedy}")
        try:
            (x0, x1), (y0, y1) = (_amounts(axis[:2], "m") for axis in axes)
            nx, ny = (int(axis[2]) for axis in axes)
        except ValueError as error:
            raise ArgumentError(called, f"{word}: {remedy}{_of_unit(error)}") from None
        if not (all(map(math.isfinite, (x0, x1, y0, y1))) and x1 > x0 and y1 > y0 and nx >= 2 and ny >= 2):
            why = f"{word}: each axis needs a higher end above its lower one, and two places or more"
            raise ArgumentError(called, why)
        return (x0, x1, nx), (y0, y1, ny)


class Source(ArgumentKind[Path]):
    """A file that is read; what the function takes in its place is for it to prove."""

    word: ClassVar[type] = Path


class File(Source):
    """A file that is read, or a folder."""

    def check(self, given: object, called: str) -> Path:
        from compare.arguments import path

        return path(given, called)


class TomlTolerances(Source):
    """A file of tolerances, which is read where it is typed, so that a fault in it names the option."""

    def parse(self, word: Path, called: str) -> Tolerances:
        from compare.judge.tolerances import load_tolerances

        return load_tolerances(word)


class Files(ArgumentKind[list[Path]]):
    """Files that are read, one or several."""

    word: ClassVar[type] = Path
    repeated: ClassVar[bool] = True


class Written(ArgumentKind[str]):
    """A file or a folder that is written; an empty text, which would be the current folder, is none."""

    def parse(self, word: str, called: str) -> Path:
        if not word.strip():
            raise ArgumentError(called, "it is empty; name a folder, or give . for the current one")
        return Path(word)

    def check(self, given: object, called: str) -> Path:
        return File().check(given, called)

    def stands_for(self, argument: object) -> str | None:
        """The text of a path."""
        return None if argument is None else str(argument)


@functools.cache
def _enumeration(choices: tuple[str, ...]) -> type[StrEnum]:
    return cast(type[StrEnum], StrEnum("Choice", {choice: choice for choice in choices}))


def listed_once(text: str, called: str) -> list[str]:
    """The items of a list separated by commas.  Raises ArgumentError where one is there twice."""
    parts = [part.strip() for part in text.split(",")]
    twice = next((part for i, part in enumerate(parts) if part in parts[:i]), None)
    if twice is not None:
        raise ArgumentError(called, f"{twice} is there twice; give each once")
    return parts


def _amounts(parts: Sequence[str], unit: str, converted: Callable[[float], float] = float) -> list[float]:
    """Numbers, each as it is or with its unit.  Raises ValueError."""
    from analytic.mechanism.written import quantity

    found = [quantity(part, unit) for part in parts]
    return [float(part) if size is None else converted(size) for part, size in zip(parts, found, strict=True)]


def _of_unit(error: ValueError) -> str:
    """What is wrong with a unit, if that is what is wrong."""
    from analytic.mechanism.units import UnitError

    return f"; it has {error}" if isinstance(error, UnitError) else ""


def _amount(text: str, unit: str, called: str, remedy: str, converted: Callable[[float], float] = float) -> float:
    """A number in this SI unit where it is written with one, else ``converted`` to it."""
    from analytic.mechanism.units import UnitError
    from analytic.mechanism.written import quantity

    try:
        found = quantity(text, unit) if unit else None
    except UnitError as error:
        raise ArgumentError(called, f"{text!r} has {error}") from None
    return converted(_number(text, called, remedy)) if found is None else found


def _number(text: str, called: str, remedy: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ArgumentError(called, f"{text!r} is not a number; {remedy}") from None

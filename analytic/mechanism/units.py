"""Units of measured columns: what each signal is, and the factor from a column's unit to SI.

pint knows the units; it is imported for the first column that is not in SI already.
"""

from __future__ import annotations

import math
import re
from functools import cache
from typing import TYPE_CHECKING, Any, Literal, Protocol

from analytic.errors import Error
from analytic.mechanism.one_line import shown

if TYPE_CHECKING:
    import pint

SiUnit = Literal["m", "m/s", "m/s^2", "rad", "rad/s", "rad/s^2", "N", "N.m", "W", "1", "s"]
QuantityKind = Literal[
    "time", "angle", "angular velocity", "angular acceleration", "length", "velocity", "acceleration", "force",
    "torque", "power", "strain",
]  # fmt: skip
SI: dict[QuantityKind, SiUnit] = {
    "time": "s",
    "angle": "rad",
    "angular velocity": "rad/s",
    "angular acceleration": "rad/s^2",
    "length": "m",
    "velocity": "m/s",
    "acceleration": "m/s^2",
    "force": "N",
    "torque": "N.m",
    "power": "W",
    "strain": "1",
}
Powers = tuple[int, int, int]  # of length, mass and time
POWERS: dict[str, Powers] = {
    "1": (0, 0, 0), "rad": (0, 0, 0), "m": (1, 0, 0), "kg": (0, 1, 0), "s": (0, 0, 1), "N": (1, 1, -2),
    "Pa": (-1, 1, -2), "W": (2, 1, -3), "J": (2, 1, -2),
}  # fmt: skip
DIMENSIONS: dict[SiUnit, QuantityKind] = {unit: kind for kind, unit in SI.items()}
# What messages offer; any other unit of the dimension that pint knows is accepted as well.
OFFERED: dict[QuantityKind, tuple[str, ...]] = {
    "time": ("s", "ms", "us", "min"),
    "angle": ("rad", "mrad", "deg", "rev"),
    "angular velocity": ("rad/s", "deg/s", "rpm"),
    "angular acceleration": ("rad/s^2", "deg/s^2"),
    "length": ("m", "mm", "um", "in"),
    "velocity": ("m/s", "mm/s", "in/s"),
    "acceleration": ("m/s^2", "mm/s^2", "g"),
    "force": ("N", "kN", "mN", "kgf", "lbf"),
    "torque": ("N.m", "N.mm", "kN.m", "lbf.in"),
    "power": ("W", "mW", "kW"),
    "strain": ("1", "um/m", "mm/m"),
}
# What is written most, so that pint need not be loaded for it (a third of a second).
COMMON: dict[tuple[str, str], float] = {
    ("mm", "m"): 1e-3,
    ("cm", "m"): 1e-2,
    ("um", "m"): 1e-6,
    ("deg", "rad"): math.pi / 180,
    ("rpm", "rad/s"): math.pi / 30,
    ("g", "kg"): 1e-3,
    ("kN", "N"): 1e3,
    ("N.mm", "N.m"): 1e-3,
    ("GPa", "Pa"): 1e9,
    ("MPa", "Pa"): 1e6,
}
WHATEVER_SI = "SI"  # of a column that is a radian or a metre, whichever its signal is
NAMESAKES: dict[tuple[str, str], float] = {("g", "m/s^2"): 9.80665}  # of accelerometers; alone, pint's g is a gram
_FACTOR = r"[A-Za-zµμ°]+(\^?-?\d)?"
_UNIT = re.compile(rf"(1|{_FACTOR})([./*·⋅ -]{_FACTOR}){{0,3}}")  # no numbers and no towers of powers reach pint


class UnitError(Error, ValueError):
    """A unit is missing, unknown or of another dimension; the message says what is accepted."""


class HasUnit(Protocol):
    """A signal, as far as its unit goes."""

    @property
    def unit(self) -> SiUnit: ...


def dimension(signal: HasUnit) -> QuantityKind:
    """What kind of quantity a signal is."""
    return DIMENSIONS[signal.unit]


@cache
def powers(unit: str) -> Powers:
    """Powers of metre, kilogram and second of an SI unit such as ``N.m.s^2/rad^2``."""
    length = mass = time = 0
    for sign, part in zip((1, -1), unit.partition("/")[::2], strict=True):
        for name, _, power in (each.partition("^") for each in part.split(".") if each):
            a, b, c = (sign * int(power or 1) * x for x in POWERS[name])
            length, mass, time = length + a, mass + b, time + c
    return length, mass, time


def factor(unit: str, kind: QuantityKind) -> float:
    """What a number in ``unit`` is multiplied by to be SI.  Raises UnitError."""
    *units, last = OFFERED[kind]
    accepted = f"{_article(kind)} {kind} is given in {', '.join(units)} or {last}"
    if not unit:
        raise UnitError(f"no unit; {accepted}")
    if unit == WHATEVER_SI:
        return 1.0
    return _factor(unit, SI[kind], accepted)


def between(unit: str, other: str) -> float:
    """What a number in ``unit`` is multiplied by to be in another unit of a signal.  Raises UnitError."""
    for kind in SI:
        try:
            return factor(unit, kind) / factor(other, kind)
        except UnitError:
            continue
    raise UnitError(f"unit {shown(unit)} does not go with {shown(other)}; give two of one kind")


def factor_to_si(unit: str, si: str) -> float:
    """What a number in ``unit`` is multiplied by to be in an SI unit.  Raises UnitError."""
    kind = next((kind for kind, each in SI.items() if each == si), None)
    offered = [si] if kind is None else OFFERED[kind]
    return _factor(unit, si, f"give it in {', '.join(offered[:-1])} or {offered[-1]}" if kind else f"give it in {si}")


def _factor(unit: str, si: str, accepted: str) -> float:
    if unit == si:
        return 1.0
    if (known := (COMMON | NAMESAKES).get((unit, si))) is not None:
        return known
    if not _UNIT.fullmatch(unit):
        raise UnitError(f"unit {shown(unit)}, which cannot be read; {accepted}")
    try:
        meant = re.sub(r"\b(lb|oz)s?\b", r"\1f", unit) if si == "N.m" else unit  # a torque in in-lb is one of forces
        powers = re.sub(r"(?<=[^\W\d_])(-?\d)", r"^\1", meant)  # kg.m2 as kg.m^2
        quantity = _in_base_units(re.sub(r"[.·⋅ ]|-(?!\d)", "*", powers))
    except (_pint().PintError, ValueError, TypeError):  # such as of nan, which is a number
        raise UnitError(f"unit {unit!r}, which is unknown; {accepted}") from None
    wanted = _in_base_units(si.replace(".", "*"))
    if (
        quantity.units != wanted.units
    ):  # base units keep radians apart from plain numbers: neither % nor Hz passes for an angle or a speed
        raise UnitError(f"unit {unit!r}, which is of another dimension; {accepted}")
    return float(quantity.magnitude / wanted.magnitude)


def _article(kind: str) -> str:
    return "an" if kind[0] in "aeiou" else "a"


def _pint() -> Any:
    import pint

    return pint


@cache
def _registry() -> pint.UnitRegistry[float]:
    registry: pint.UnitRegistry[float] = _pint().UnitRegistry()
    registry.define("newton_meter = newton * meter = Nm")  # so written on many a torque sensor
    registry.define("newton_millimeter = newton * millimeter = Nmm")
    registry.define("@alias turn = rev")
    return registry


def _in_base_units(unit: str) -> Any:
    return (1.0 * _registry().parse_units(unit)).to_base_units()

"""Names of signals, and the units in which a person reads them: degrees and millimetres, where files have radians and
metres.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from analytic.mechanism import GROUND, Mechanism
from analytic.mechanism.assumed import Assumed
from analytic.mechanism.signals import Component, SignalKind, driving, position, signals
from sim_models.engine import SettingValue

SHOWN = {"rad": ("deg", math.degrees(1.0)), "m": ("mm", 1e3), "1": ("%", 100.0)}  # SI unit -> unit that is read, factor
MINUS, TIMES, DASH, GAMMA = "\N{MINUS SIGN}", "\N{MULTIPLICATION SIGN}", "\N{EN DASH}", "\N{GREEK SMALL LETTER GAMMA}"
READ = {  # SI unit -> (least size, unit that is read from there on, factor), largest first
    "rad": ((0.05, "deg", math.degrees(1.0)), (1e-5, "mrad", 1e3), (0.0, "µrad", 1e6)),
    "rad/s": ((0.1, "rad/s", 1.0), (0.0, "mrad/s", 1e3)),
    "m": ((1e-4, "mm", 1e3), (0.0, "µm", 1e6)),
    "m/s": ((0.1, "m/s", 1.0), (0.0, "mm/s", 1e3)),
    "W": ((0.1, "W", 1.0), (0.0, "mW", 1e3)),
    "s": ((1.0, "s", 1.0), (1e-4, "ms", 1e3), (0.0, "µs", 1e6)),
    "kg": ((0.1, "kg", 1.0), (0.0, "g", 1e3)),
    "N": ((0.1, "N", 1.0), (0.0, "mN", 1e3)),
    "N.m": ((0.01, "N·m", 1.0), (0.0, "mN·m", 1e3)),
    "N.m.s/rad": ((0.01, "N·m·s/rad", 1.0), (0.0, "mN·m·s/rad", 1e3)),
    "kg.m^2": ((0.01, "kg·m²", 1.0), (0.0, "kg·mm²", 1e6)),
    "Pa": ((1e9, "GPa", 1e-9), (1e6, "MPa", 1e-6), (0.0, "Pa", 1.0)),
}
LABELS: dict[tuple[SignalKind, Component], tuple[str, str, str]] = {  # words, the paper's symbol, how its place is said
    ("reaction", "angle"): ("reaction angle", GAMMA, "at"),
    ("reaction", "magnitude"): ("reaction force", "|F|", "at"),
    ("reaction", "x"): ("reaction x", "", "at"),
    ("reaction", "y"): ("reaction y", "", "at"),
    ("reaction", "moment"): ("reaction moment", "", "at"),
    ("clearance", "x"): ("displacement x", "", "in"),
    ("clearance", "y"): ("displacement y", "", "in"),
    ("clearance", "angle"): ("tilt", "", "in"),
    ("rotation", "angle"): ("rotation", "ψ", "of"),
    ("pose", "angle"): ("angle", "", "of"),
    ("pose", "x"): ("position x", "", "of"),
    ("pose", "y"): ("position y", "", "of"),
    ("rate", "angular_velocity"): ("angular velocity", "", "of"),
    ("velocity", "x"): ("velocity x", "", "of"),
    ("velocity", "y"): ("velocity y", "", "of"),
    ("acceleration", "x"): ("acceleration x", "", "of"),
    ("acceleration", "y"): ("acceleration y", "", "of"),
    ("acceleration", "angle"): ("angular acceleration", "", "of"),
    ("position", "angle"): ("position", "", "of"),
    ("position", "travel"): ("position", "", "of"),
    ("joint_velocity", "angle"): ("velocity", "", "in"),
    ("joint_velocity", "travel"): ("velocity", "", "in"),
    ("joint_acceleration", "angle"): ("acceleration", "", "in"),
    ("joint_acceleration", "travel"): ("acceleration", "", "in"),
    ("drive", "torque"): ("drive torque", "T", "at"),
    ("drive", "force"): ("drive force", "F", "at"),
    ("power", "power"): ("drive power", "P", "at"),
    ("sensor", "travel"): ("length", "", "of"),
    ("sensor", "speed"): ("velocity", "", "of"),
    ("sensor", "acceleration"): ("specific force", "", "of"),
    ("sensor", "angular_velocity"): ("angular velocity", "", "of"),
    ("sensor", "strain"): ("strain", "ε", "of"),
    ("sensor", "force"): ("force", "", "of"),
    ("sensor", "torque"): ("torque", "", "of"),
}
SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class Quantity:
    """A signal as people read it: ``factor`` times the SI value is in ``unit``."""

    signal: str
    name: str
    symbol: str
    place: str
    unit: str
    factor: float

    @property
    def label(self) -> str:
        """Name in plain ASCII (but for the names of the mechanism's own parts): ``reaction angle at B``."""
        return f"{self.name} {self.place}".strip()

    @property
    def angular(self) -> bool:
        """Whether this is an angle, so that differences of it are modulo a turn."""
        return self.unit == "deg"

    @property
    def title(self) -> str:
        """Name with the paper's symbol, such as ``Reaction force |F| at B``."""
        words = " ".join(part for part in (self.name, self.symbol, self.place) if part)
        return words[:1].upper() + words[1:]


def shown(unit: str) -> tuple[str, float]:
    """The unit that a person reads for an SI unit, and the factor to it; units without one stay as they are."""
    return SHOWN.get(unit, (unit.replace("N.m", "N·m"), 1.0))


def apart(one: float, other: float, angular: bool) -> float:
    """One value minus another; angles (rad) modulo a turn, as they are judged: in [-pi, pi)."""
    return (one - other + math.pi) % math.tau - math.pi if angular else one - other


def quantities(mechanism: Mechanism) -> dict[str, Quantity]:
    """Every signal that a mechanism can have, in the order in which a report lists them.

    Names are looked up, not parsed: a body may be called ``reaction_B`` and a joint may have any letters.
    """
    listed = {}
    for signal in signals(mechanism.bodies, mechanism.joints, mechanism.drives, mechanism.sensors):
        words, symbol, where = LABELS[signal.kind, signal.component]
        place = f"{where} {signal.place}" if signal.place else ""
        listed[signal.name] = Quantity(signal.name, words, symbol, place, *shown(signal.unit))
    return listed


def key_signals(mechanism: Mechanism, joints: list[str], loose: bool) -> list[str]:
    """The signals that the paper is about, for these joints: gamma, |F|, the displacement, psi of the couplers and what
    the drives give.

    Where no joint is ``loose`` (has clearance) the bodies' angles take the place of displacement and rotation.
    """
    names = [f"reaction_{j}_{part}" for j in joints for part in ("angle", "magnitude")]
    names += [f"clearance_{j}_{axis}" for j in joints for axis in "xy"]
    turned = (
        [f"{b}_rotation" for b in couplers(mechanism)] if loose else [f"{body.name}_angle" for body in mechanism.bodies]
    )
    return [*names, *turned, *drive_signals(mechanism)]


def drive_signals(mechanism: Mechanism) -> list[str]:
    """Names of what the drives give: a torque, or each its torque or force."""
    return [signal.name for signal in driving(mechanism.motors)]


def going(mechanism: Mechanism) -> dict[str, str]:
    """What may go to and fro on the ground as the crank turns: each slide by its joint's name and each body, with the
    signal that says where it is.
    """
    ways = {}
    for joint in mechanism.joints:
        if GROUND in joint.bodies and mechanism.driven not in joint.bodies:
            body = next(name for name in joint.bodies if name != GROUND)
            name, signal = (joint.name, position(joint).name) if joint.prismatic else (body, f"{body}_angle")
            ways[name] = signal
    return ways


def couplers(mechanism: Mechanism) -> list[str]:
    """Bodies that no joint connects to the ground."""
    grounded = {name for joint in mechanism.joints if GROUND in joint.bodies for name in joint.bodies}
    return [body.name for body in mechanism.bodies if body.name not in grounded]


def number(value: float | None, digits: int = 3, sign: bool = False) -> str:
    """A number as it is printed in a page, powers of ten written out, and a dash where there is none."""
    if value is None:
        return DASH
    mantissa, e, exponent = plain(value, digits, sign).partition("e")
    mantissa = mantissa.replace("-", MINUS)
    return f"{mantissa}{TIMES}10{str(int(exponent)).translate(SUPERSCRIPT)}" if e else mantissa


def plainly(value: float | None, digits: int = 3, sign: bool = False) -> str:
    """A number as one writes it: ``17,400``; powers of ten only beyond a million or below a ten-thousandth."""
    if value is None or not math.isfinite(value):
        return DASH
    short = float(f"{value:.{digits}g}")
    if short and not 1e-4 <= abs(short) < 1e6:
        return number(value, digits, sign)
    decimals = max(0, digits - 1 - (math.floor(math.log10(abs(short))) if short else 0))
    text = f"{short:{'+' if sign else ''},.{decimals}f}"
    return (text.rstrip("0").rstrip(".") if "." in text else text).replace("-", MINUS)


def plain(value: float | None, digits: int = 3, sign: bool = False) -> str:
    """A number in ASCII, for terminals: ``+1.23e-05``."""
    if value is None:
        return "-"
    return f"{value:{'+' if sign else ''}.{digits}g}"


def fitting(unit: str, *values: float | None) -> tuple[str, float]:
    """The unit in which the largest of some SI values is read, and the factor to it; a unit without a choice stays."""
    size = max((abs(v) for v in values if v is not None and math.isfinite(v)), default=0.0)
    choices = READ.get(unit)
    if choices is None:
        return unit.replace(".", "·"), 1.0
    return next((name, factor) for least, name, factor in choices if size >= least)


def amount(value: float | None, unit: str, digits: int = 3, sign: bool = False) -> str:
    """An SI value in the unit that fits it: ``0.6 mrad``."""
    if value is None:
        return DASH
    name, factor = fitting(unit, value)
    return number(value * factor, digits, sign) + ("" if name == "1" else f" {name}")


def setting(value: SettingValue) -> str:
    """A setting of an engine: a number to six digits, one for each joint as ``B 0.3``."""
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {setting(one)}" for key, one in value.items())
    return DASH if value is None else plain(value, 6) if isinstance(value, float) else str(value)


def assumptions(assumed: Iterable[Assumed]) -> list[str]:
    """Numbers that were left out, a line for each field: ``body.com (the middle of the body's points): crank (100,
    0) mm``.
    """
    lines: dict[str, list[str]] = {}
    for each in assumed:
        table, name, field = re.match(r"(\w+)(?:\[(.+?)\])?\.(.+)", each.field).groups()  # type: ignore[union-attr]
        unit, factor = shown(each.unit) if each.unit in ("m", "rad") else (each.unit.removeprefix("1"), 1.0)
        values = each.value if isinstance(each.value, tuple) else (each.value,)
        numbers = ", ".join(plain(factor * value, 4) for value in values)
        size = f"{f'({numbers})' if len(values) > 1 else numbers} {unit}".strip()
        lines.setdefault(f"{table}.{field} ({each.why})", []).append(f"{name} {size}" if name else size)
    return [f"{what}: {'; '.join(sizes)}" for what, sizes in lines.items()]

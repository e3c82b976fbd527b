"""Numbers of a mechanism file as people write them: ``"60 rpm"``, ``"25 mm"``, ``"30 deg"``; bare numbers are SI."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping
from typing import Any

from analytic.mechanism.parts import INITIAL
from analytic.mechanism.units import UnitError, factor_to_si

NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([A-Za-zµμ°][\w.^/*·⋅ °-]*?)\s*")
BARE = re.compile(r"[-+\d.eE\s]+")  # a number alone, whose e is no unit
BODY = {
    "points": "m",
    "mass": "kg",
    "com": "m",
    "marker": "m",
    "section": "m",
    "inertia": "kg.m^2",
    "youngs_modulus": "Pa",
    "shear_modulus": "Pa",
}
JOINT = {
    "angle": "rad",
    "clearance": "m",
    "guide": "m",
    "pin_radius": "m",
    "contact_stiffness": "N/m",
    "contact_damping": "N.s/m",
    "friction_radius": "m",
    "radial_stiffness": "N/m",
}
REVOLUTE = {
    "friction_torque": "N.m",
    "static_torque": "N.m",
    "stribeck_speed": "rad/s",
    "damping": "N.m.s/rad",
    "drag": "N.m.s^2/rad^2",
    "stiffness": "N.m/rad",
    "cubic": "N.m/rad^3",
    "rest_angle": "rad",
}
PRISMATIC = {
    "friction": "N",
    "friction_torque": "N",
    "static_torque": "N",
    "stribeck_speed": "m/s",
    "damping": "N.s/m",
    "drag": "N.s^2/m^2",
    "stiffness": "N/m",
    "cubic": "N/m^3",
    "rest_angle": "m",
}
ELASTICITY = {"translation": "N/m", "rotation": "N.m/rad"}
SPRING = {"stiffness": "N/m", "length": "m", "damping": "N.s/m"}
STOP = {"from": "rad", "to": "rad", "stiffness": "N.m/rad", "damping": "N.m.s/rad"}
SLIDE_STOP = {"from": "m", "to": "m", "stiffness": "N/m", "damping": "N.s/m"}
WAVE = {"amplitude": "rad", "phase": "rad"}
DRIVE = {"stiffness": "N.m/rad", "half_gap": "rad"}
LOAD = {"force": "N", "torque": "N.m"}
Units = Mapping[str, str]


def in_si(fields: Mapping[str, object]) -> dict[str, object]:
    """The fields of a mechanism file with every quantity that is written with its unit as a number in SI; what is no
    quantity is left as it is.  Raises UnitError, which names the field.
    """
    out: dict[str, Any] = dict(fields)
    slides = {j.get("name") for j in _tables(out, "joint") if j.get("type") == "prismatic"}
    lengths = {f"position_{name}" for name in slides}
    lengths |= {f"{body.get('name')}_{axis}" for body in _tables(out, "body") for axis in "xy"}
    if "gravity" in out:
        out["gravity"] = _read(out["gravity"], "m/s^2", "gravity")
    if "assembly" in out:
        out["assembly"] = _read(out["assembly"], "rad", "assembly")
    if isinstance(out.get("initial"), Mapping):
        given = out["initial"]
        sliding = {INITIAL + str(name) for name in slides}
        out["initial"] = _part(given, {k: "m/s" if k in sliding else "rad/s" for k in given}, "initial")
    if isinstance(out.get("ground"), Mapping):
        out["ground"] = _part(out["ground"], {"points": "m"}, "ground")
    of_part: Mapping[str, Callable[[Mapping[str, Any]], Units]] = {
        "body": lambda _: BODY,
        "joint": lambda j: JOINT | (PRISMATIC if j.get("type") == "prismatic" else REVOLUTE),
        "drive": lambda d: DRIVE | {"speed": "m/s" if d.get("joint") in slides else "rad/s"},
        "spring": lambda _: SPRING,
        "stop": lambda stop: SLIDE_STOP if stop.get("joint") in slides else STOP,
        "load": lambda load: LOAD | dict.fromkeys(("from", "to", "table"), _over(load, lengths)),
    }
    for table, units in of_part.items():
        parts = out.get(table)
        if isinstance(parts, list):
            out[table] = [_part(p, units(p), _called(table, p)) if isinstance(p, Mapping) else p for p in parts]
        elif isinstance(parts, Mapping):
            out[table] = _part(parts, units(parts), table)
    return out


def runs_in_si(runs: object) -> object:
    """The ``[[run]]`` tables of measured data, their speeds, angles, forces and torques that are written with their
    unit as numbers in SI.  Raises UnitError, which names the field.
    """
    if not isinstance(runs, list):
        return runs
    units = {"drive_speed": "rad/s", "drive_angle": "rad"}
    out: list[object] = []
    for run in runs:
        if not isinstance(run, Mapping):
            out.append(run)
            continue
        called = _called("run", run)
        written = _part(run, units, called)
        if isinstance(run.get("load"), list):
            loads = [_part(each, LOAD, f"{called}.load") if isinstance(each, Mapping) else each for each in run["load"]]
            written["load"] = loads
        out.append(written)
    return out


def _tables(fields: Mapping[str, Any], name: str) -> list[Mapping[str, Any]]:
    given = fields.get(name)
    return [each for each in given if isinstance(each, Mapping)] if isinstance(given, list) else []


def _called(table: str, part: Mapping[str, Any]) -> str:
    name = part.get("name", part.get("joint", part.get("body")))
    return f"{table}[{name}]" if isinstance(name, str) else table


def _over(load: Mapping[str, Any], lengths: Collection[str]) -> str:
    """The unit of what a load varies over; any, where that is nothing that there is, which is then what is wrong."""
    over = load.get("over")
    return "m" if over in lengths else "rad" if isinstance(over, str) and over.endswith("angle") else ""


def _part(part: Mapping[str, Any], units: Units, called: str) -> dict[str, Any]:
    """A part of the file, its fields in SI."""
    out = dict(part)
    for name, value in part.items():
        where = f"{called}.{name}"
        if name == "elasticity" and isinstance(value, Mapping):
            out[name] = _part(value, ELASTICITY, where)
        elif name in ("ripple", "periodic_torque") and isinstance(value, Mapping):
            out[name] = _part(value, WAVE | ({"amplitude": "N.m"} if name == "periodic_torque" else {}), where)
        elif name == "table" and name in units and isinstance(value, list):
            out[name] = [_pair(pair, units[name], where) for pair in value]
        elif name in units:
            out[name] = _read(value, units[name], where)
    return out


def _pair(pair: Any, unit: str, called: str) -> Any:
    """A pair of a table, whose first is in a unit and whose second is a factor."""
    return [_read(pair[0], unit, called), *pair[1:]] if isinstance(pair, list) and pair else pair


def _read(value: Any, unit: str, called: str) -> Any:
    """A value, or those in a list or a table, in this SI unit where it is written with another one."""
    if isinstance(value, list):
        return [_read(each, unit, called) for each in value]
    if isinstance(value, Mapping):
        return {name: _read(each, unit, f"{called}.{name}") for name, each in value.items()}
    try:
        found = quantity(value, unit) if isinstance(value, str) else None
    except UnitError as error:
        raise UnitError(f"{called} = {value!r} has {error}") from None
    return value if found is None else found


def quantity(text: str, unit: str) -> float | None:
    """A number that is written with its unit, in this SI unit, or as it is where there is none; None of what is no
    number with a unit.  Raises UnitError.
    """
    written = None if BARE.fullmatch(text) else NUMBER.fullmatch(text)
    if written is None:
        return None
    return float(written[1]) * (factor_to_si(written[2], unit) if unit else 1.0)

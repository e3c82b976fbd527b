"""Numbers of a mechanism file as people write them: ``"60 rpm"``, ``"25 mm"``, ``"30 deg"``; bare numbers are SI."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from analytic.mechanism.load_table import is_frame, with_tables
from analytic.mechanism.units import SiUnit, UnitError, factor_to_si

NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*((?:1/)?[A-Za-zµμ°][\w.^/*·⋅ °-]*?)\s*")
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
ENDS = ("from", "to", "from_", "start", "end")  # of a stop, or of what a load varies over, in a file and in Python
STOP = {**dict.fromkeys(ENDS, "rad"), "stiffness": "N.m/rad", "damping": "N.m.s/rad"}
SLIDE_STOP = {**dict.fromkeys(ENDS, "m"), "stiffness": "N/m", "damping": "N.s/m"}
STOPS = {"rad/s": STOP, "m/s": SLIDE_STOP, "": dict.fromkeys(STOP, "")}  # by the unit in which their joints move
WAVE = {"amplitude": "rad", "phase": "rad"}
WAVES = ("ripple", "periodic_torque")
INITIAL = "velocity_"  # with a joint's name after it: a field of ``initial``
WHOLE = {"gravity": "m/s^2", "assembly": "rad", "ground": "m"}
DRIVE = {"stiffness": "N.m/rad", "half_gap": "rad"}
LOAD = {"force": "N", "torque": "N.m"}
SENSOR = {"point": "m", "youngs_modulus": "Pa"}
ALONE: Mapping[str, SiUnit] = {"time": "s", "crank_angle": "rad"}  # what a load may vary over whatever the linkage
Units = Mapping[str, str]
_BY_ITSELF: Mapping[str, Callable[[Mapping[str, Any]], Units]] = {  # by the part: what it is in, whatever it belongs to
    "ground": lambda _: {"points": "m"},
    "body": lambda _: BODY,
    "joint": lambda j: JOINT | (PRISMATIC if j.get("type") == "prismatic" else REVOLUTE),
    "drive": lambda _: DRIVE | {"speed": "rad/s"},
    "spring": lambda _: SPRING,
    "sensor": lambda _: SENSOR,
    "load": lambda load: LOAD | _over(ALONE.get(str(load.get("over")))),
}


def _over(unit: str | None) -> dict[str, str]:
    """What says where a load varies is in the unit of what it varies over; of nothing that there is, as it is."""
    return {} if unit is None else dict.fromkeys((*ENDS, "table"), unit)


def by_itself_in_si(kind: str, part: Mapping[str, object]) -> dict[str, object]:
    """The fields of a part in SI as far as their units do not depend on what it belongs to.  Raises UnitError, which
    names the field.
    """
    units = _BY_ITSELF.get(kind)
    out = dict(part) if units is None else part_in_si(part, units(part), "")
    if kind not in ("load", "stop"):
        return out
    unit, as_dict = ALONE.get(str(out.get("over"))), f"the {kind} as a dict in {kind}s=[...] of the mechanism"
    if isinstance(out.get("table"), str) or (unit and is_frame(out.get("table"))):
        out, *others = with_tables(out, unit, None, "")
        if others:
            raise UnitError(f"table has columns for {len(others) + 1} loads; give one, or {as_dict}")
    for name in (*ENDS, "table"):
        if is_frame(given := out.get(name)) or any(quantity(text, "") is not None for text in _texts(given)):
            of, said = "over" if kind == "load" else "joint", "" if name == "table" else f" = {given!r}"
            raise UnitError(
                f"{name}{said}: what {out.get(of)} is measured in is not known here; give numbers in SI, or {as_dict}"
            )
    return out


def _texts(given: object) -> list[str]:
    """A text, or those that begin the pairs of a table."""
    pairs = given if isinstance(given, list | tuple) else [given]
    return [x for pair in pairs if isinstance(x := pair[0] if isinstance(pair, list | tuple) and pair else pair, str)]


def in_si(fields: Mapping[str, object], folder: Path | None = None) -> dict[str, object]:
    """The fields of a mechanism file with every quantity that is written with its unit as a number in SI; what is no
    quantity is left as it is.  Tables of loads that are files in a ``folder`` are read.  Raises UnitError, which names
    the field, and ReadingError.
    """
    out: dict[str, Any] = part_in_si(fields, WHOLE, "")
    if isinstance(out.get("initial"), Mapping):
        given = out["initial"]
        out["initial"] = part_in_si(given, {name: _rate(out, name.removeprefix(INITIAL)) for name in given}, "initial")
    for table, units in _units_by_table(out).items():
        parts = out.get(table)
        if isinstance(parts, list | tuple) and not any(isinstance(part, Mapping) for part in parts):
            continue  # made already
        if table == "load" and isinstance(parts, list | tuple):
            out[table] = _loads(parts, _units_over(out).get, folder, table)
        elif isinstance(parts, list | tuple):
            out[table] = [part_in_si(p, units(p), _called(table, p)) if isinstance(p, Mapping) else p for p in parts]
        elif isinstance(parts, Mapping):
            out[table] = part_in_si(parts, units(parts), table)
    if isinstance(out.get("tolerances"), Mapping):
        out["tolerances"] = {
            name: part_in_si(given, dict.fromkeys(("sd", "limits"), _varying(out, name)), f"tolerances[{name}]")
            if isinstance(given, Mapping)
            else given
            for name, given in out["tolerances"].items()
        }
    return out


def _varying(fields: Mapping[str, Any], name: str) -> str:
    """The SI unit of what a tolerance is of, by its dotted name; empty of what is no number."""
    table, *steps = name.split(".")
    if table in WHOLE and table != "ground":
        return WHOLE[table]
    units, parts = _units_by_table(fields).get(table), _tables(fields, table)
    if units is None or not parts or not steps:
        return ""
    named = {step: p for k, p in enumerate(parts, 1) for step in (str(k), p.get("body"), p.get("joint"), p.get("name"))}
    part = named.get(steps[0])
    field = steps[0] if part is None else (*steps[1:], "")[0]
    return "m" if field == "length" else units(parts[0] if part is None else part).get(field, "")


def si_unit(fields: Mapping[str, object], place: Sequence[str | int]) -> str:
    """The SI unit of a field of a mechanism file, by the steps that lead to it; empty of one that has none."""
    table, steps = str(place[0]), list(place[1:])
    if table in WHOLE:
        return WHOLE[table]
    if table == "initial":
        return _rate(fields, str(steps[0]).removeprefix(INITIAL))
    units = _units_by_table(fields).get(table)
    if units is None:
        return ""
    part: Any = fields[table]
    of_part = units(part[steps.pop(0)] if isinstance(steps[0], int) else part)
    field, *inner = map(str, steps)
    within = _units_within(field)
    return of_part.get(field, "") if within is None else within.get(inner[0], "")


def _units_by_table(fields: Mapping[str, Any]) -> Mapping[str, Callable[[Mapping[str, Any]], Units]]:
    """By table what the fields of one of its parts are in."""
    return {
        **_BY_ITSELF,
        "drive": lambda d: DRIVE | {"speed": _rate(fields, d.get("joint"))},
        "stop": lambda stop: STOPS[_rate(fields, stop.get("joint"))],
        "load": lambda load: LOAD | _over(_units_over(fields).get(str(load.get("over")), "")),
    }


def _rate(fields: Mapping[str, Any], joint: object) -> str:
    """The unit in which a joint moves; none of one that there is not, as that is what is wrong then."""
    if joint in _slides(fields):
        return "m/s"
    return "rad/s" if any(each.get("name") == joint for each in _tables(fields, "joint")) else ""


def _slides(fields: Mapping[str, Any]) -> set[object]:
    """The names of the prismatic joints."""
    return {j.get("name") for j in _tables(fields, "joint") if j.get("type") == "prismatic"}


def _units_over(fields: Mapping[str, Any]) -> dict[str, SiUnit]:
    """The unit of each quantity that a load may vary over."""
    bodies = {body.get("name") for body in _tables(fields, "body")}
    units: dict[str, SiUnit] = {**ALONE}
    slides = _slides(fields)
    units |= {f"position_{j.get('name')}": "m" if j.get("name") in slides else "rad" for j in _tables(fields, "joint")}
    units |= {f"{body}_{axis}": "m" for body in bodies for axis in "xy"}
    return units | dict.fromkeys((f"{body}_angle" for body in bodies), "rad")


def _units_within(field: str) -> Units | None:
    """What the fields of a table within a part are in; None of a field that is no table."""
    if field == "elasticity":
        return ELASTICITY
    return WAVE | ({"amplitude": "N.m"} if field == "periodic_torque" else {}) if field in WAVES else None


def runs_in_si(
    runs: object, unit_of: Callable[[str], SiUnit | None] = lambda name: None, folder: Path | None = None
) -> object:
    """The ``[[run]]`` tables of measured data, their quantities that are written with their unit as numbers in SI, and
    tables of loads that are files in a ``folder`` read; ``unit_of`` has the unit of a signal, or of what a load may
    vary over.  Raises UnitError, which names the field, and ReadingError.
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
        written = part_in_si(run, units, called)
        for field in ("noise", "start"):
            if isinstance(given := run.get(field), Mapping):
                texts = {name: unit_of(name) or "" for name, value in given.items() if isinstance(value, str)}
                written[field] = part_in_si(given, texts, f"{called}.{field}")
        if isinstance(run.get("load"), list):
            written["load"] = _loads(run["load"], unit_of, folder, f"{called}.load")
        out.append(written)
    return out


def sensors_in_si(sensors: object) -> object:
    """The ``[[sensor]]`` tables of measured data in SI.  Raises UnitError, which names the field."""
    if not isinstance(sensors, list):
        return sensors
    return [part_in_si(s, SENSOR, _called("sensor", s)) if isinstance(s, Mapping) else s for s in sensors]


def _tables(fields: Mapping[str, Any], name: str) -> list[Mapping[str, Any]]:
    """The parts of a table, those that are made already as their fields."""
    given = fields.get(name)
    given = given if isinstance(given, list | tuple) else [given]
    return [
        each if isinstance(each, Mapping) else vars(each)
        for each in given
        if hasattr(each, "__dict__") or isinstance(each, Mapping)
    ]


def _called(table: str, part: Mapping[str, Any]) -> str:
    name = part.get("name", part.get("joint", part.get("body")))
    return f"{table}[{name}]" if isinstance(name, str) else table


def _loads(
    loads: Sequence[object], unit_of: Callable[[str], SiUnit | None], folder: Path | None, called: str
) -> list[object]:
    """Loads in SI, those with a table in a file as one for each of its columns.  What varies over nothing that there
    is may have any unit: what it varies over is then what is wrong.
    """
    out: list[object] = []
    for load in loads:
        if not isinstance(load, Mapping):
            out.append(load)
            continue
        where, over = _called(called, load), load.get("over")
        unit = unit_of(over) if isinstance(over, str) else None
        written = part_in_si(load, LOAD | _over(unit or ""), where)
        out += with_tables(written, unit, folder, where)
    return out


def part_in_si(part: Mapping[str, object], units: Units, called: str) -> dict[str, object]:
    """A part of the file, its fields in SI."""
    out = dict(part)
    for name, value in part.items():
        where = f"{called}.{name}" if called else name
        within = _units_within(name)
        if within is not None and isinstance(value, Mapping):
            out[name] = part_in_si(value, within, where)
        elif name == "table" and name in units and isinstance(value, list | tuple):
            out[name] = [_pair(pair, units[name], where) for pair in value]
        elif name in units:
            out[name] = _read(value, units[name], where)
    return out


def _pair(pair: Any, unit: str, called: str) -> Any:
    """A pair of a table, whose first is in a unit and whose second is a factor."""
    return [_read(pair[0], unit, called), *pair[1:]] if isinstance(pair, list | tuple) and pair else pair


def _read(value: Any, unit: str, called: str) -> Any:
    """A value, or those in a list or a table, in this SI unit where it is written with another one."""
    if isinstance(value, list | tuple):
        return [_read(each, unit, called) for each in value]
    if isinstance(value, Mapping):
        return {name: _read(each, unit, f"{called}.{name}") for name, each in value.items()}
    try:
        found = quantity(value, unit) if isinstance(value, str) else None
    except UnitError as error:
        raise UnitError(f"{called} = {value!r} has {error}") from None
    return value if found is None else found


def number(given: float | str, *units: str) -> float:
    """A number, or one that is written with its unit, in the first of these SI units that it may be in.  Raises
    UnitError.
    """
    if not isinstance(given, str):
        return float(given)
    faults: list[str] = []
    for unit in units:
        try:
            found = quantity(given, unit)
            return float(given) if found is None else found
        except UnitError as error:
            faults.append(str(error))
        except ValueError:
            faults.append(f"no number; give {' or '.join(units)}, or a number with its unit")
    raise UnitError(faults[0])


def one_unit(parts: Sequence[str]) -> list[str]:
    """Numbers of which all have the unit that some are written with.  Raises UnitError where these have several."""
    written = [None if BARE.fullmatch(part) else NUMBER.fullmatch(part) for part in parts]
    units = sorted({each[2] for each in written if each})
    if len(units) > 1 and not all(written):
        raise UnitError(f"several units, {' and '.join(units)}, and a number without one; give each its own")
    return [part if each or not units else f"{part} {units[0]}" for part, each in zip(parts, written, strict=True)]


def quantity(text: str, unit: str) -> float | None:
    """A number that is written with its unit, in this SI unit, or as it is where there is none; None of what is no
    number with a unit.  Raises UnitError.
    """
    written = None if BARE.fullmatch(text) else NUMBER.fullmatch(text)
    if written is None:
        return None
    return float(written[1]) * (factor_to_si(written[2], unit) if unit else 1.0)

"""What a rig can do, as a person writes it: a mechanism file alone, or a plan.toml with a ``[rig]`` beside it."""

from __future__ import annotations

import difflib
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from analytic.mechanism import Load, Mechanism
from analytic.mechanism.columns import readable
from analytic.mechanism.errors import MechanismError, describe, quoted
from analytic.mechanism.file import load, shipped_cases
from analytic.mechanism.reading import ReadingError, read_toml
from analytic.mechanism.units import UnitError
from analytic.mechanism.written import number
from compare.diagnose.data.measured_file import tolerance_in_si, tolerances
from compare.diagnose.data.recording import Measured, MeasuredError
from compare.faults import ArgumentError, OptionError
from compare.quantities import amount

SPEEDS = (0.5, 1.0, 2.0)  # times the drive's own, where no speeds are given
LONGEST = 1000.0  # turns of the crank in a run
MOST_SPEEDS = 20  # of a plan
A_TURN = 180  # samples of a turn of the crank, where no rate is given
FEWEST_SAMPLES = 12  # samples of a run
LISTED = 8  # signals that a message names
Quantity = float | str
Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False, populate_by_name=True)


def _as_tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def _with_noise(value: Any) -> Any:
    return {"noise": value} if isinstance(value, int | float | str) else value


class SensorEntry(_Part):
    """A sensor that could be used: its noise (1 sigma) and its price."""

    noise: Quantity
    price: NotNegative = 0.0


class Loading(_Part):
    """A ``[[rig.loading]]``: loads that a run may carry, and what that costs beside the run; None are the mechanism's
    own.
    """

    name: Annotated[str, Field(max_length=100, pattern=r"^[^@\s\p{Cc}]*$")] = ""
    loads: Annotated[tuple[Load, ...] | None, BeforeValidator(_as_tuple), Field(alias="load")] = None
    price: NotNegative = 0.0


class RigTable(_Part):
    """``[rig]`` as written."""

    speeds: Annotated[
        tuple[Quantity, ...] | None, BeforeValidator(_as_tuple), Field(min_length=1, max_length=MOST_SPEEDS)
    ] = None
    reverse: bool = True
    turns: Annotated[float, Field(gt=0, le=LONGEST)] = 2.0
    rate: Quantity | None = None
    samples: Annotated[int, Field(ge=FEWEST_SAMPLES, le=10**7)] | None = None
    run_price: Positive = 1.0
    budget: Positive | None = None
    as_drawn: bool = True
    sensors: Mapping[str, Annotated[SensorEntry, BeforeValidator(_with_noise)]] = Field(default_factory=dict)
    loadings: Annotated[tuple[Loading, ...], BeforeValidator(_as_tuple), Field(alias="loading", max_length=20)] = ()


class PlanFile(_Part):
    """plan.toml as written."""

    mechanism: Annotated[str, Field(min_length=1, max_length=1000)]
    tolerance: Mapping[str, NotNegative | Mapping[str, NotNegative]] = Field(default_factory=dict)
    rig: RigTable


@dataclass(frozen=True)
class Sensor:
    """A sensor that could be used: the signal that it reads, its noise (1 sigma, SI) and its price."""

    signal: str
    noise: float
    price: float = 0.0


@dataclass(frozen=True)
class Bench:
    """What a rig can do: speeds (rad/s, above 0), both directions or one, loads, sensors, prices and the budget.

    A run is so many ``turns`` of the crank, sampled at a ``rate`` (Hz), or ``samples`` times in all; where neither is
    given, A_TURN times a turn.  ``assumed`` says what nobody gave.
    """

    mechanism: Mechanism
    speeds: tuple[float, ...]
    sensors: tuple[Sensor, ...]
    loadings: tuple[Loading, ...]
    budget: float
    reverse: bool = True
    turns: float = 2.0
    rate: float | None = None
    samples: int | None = None
    run_price: float = 1.0
    tolerance: Mapping[str, float] = field(default_factory=dict)
    assumed: tuple[str, ...] = ()


def read_bench(
    given: Mechanism | Measured | str | Path,
    sensors: Mapping[str, float | str] | None,
    budget: float | None,
    default_budget: float,
) -> Bench:
    """What a mechanism, or a plan.toml, says that the rig can do, or what a recording shows that it could: its speeds,
    and its sensors with their noise; ``sensors`` and ``budget`` replace its own.

    Raises MechanismError, MeasuredError or ArgumentError.
    """
    if isinstance(given, Mechanism):
        return _checked("", given, RigTable(), {}, sensors, budget, default_budget)
    if isinstance(given, Measured):
        return _checked("", given.mechanism, _as_recorded(given), given.tolerance, sensors, budget, default_budget)
    source = str(given)
    fields: dict[str, Any] = {}
    if source not in shipped_cases() and os.path.isfile(given):
        try:
            fields = read_toml(Path(given))
        except ReadingError as error:
            raise MeasuredError(f"{source}: {error}; give a mechanism file, or a plan.toml") from None
    if "rig" not in fields:
        return _checked(source, load(given), RigTable(), {}, sensors, budget, default_budget)
    try:
        file = PlanFile.model_validate({**fields, "tolerance": tolerance_in_si(fields.get("tolerance", {}))})
    except UnitError as error:
        raise MeasuredError(f"{source}: {error}") from None
    except ValidationError as error:
        raise MeasuredError(f"{source}: {'; '.join(describe(error, fields, PlanFile))}") from None
    beside = Path(given).parent / file.mechanism
    try:
        mechanism = load(beside if beside.is_file() or file.mechanism not in shipped_cases() else file.mechanism)
    except MechanismError as error:
        raise MechanismError(f"{source}: mechanism = {quoted(file.mechanism)}: {error}") from None
    return _checked(source, mechanism, file.rig, tolerances(source, file.tolerance), sensors, budget, default_budget)


def _as_recorded(measured: Measured) -> RigTable:
    """The speeds and the sensors that a rig had."""
    noise: dict[str, float] = {}
    for run in measured.runs:
        for name, channel in run.channels.items():
            noise[name] = max(channel.noise, noise.get(name, 0.0))
    speeds = tuple(dict.fromkeys(abs(run.speed) for run in measured.runs if run.speed))
    return RigTable(
        speeds=speeds[:MOST_SPEEDS] or None, sensors={name: SensorEntry(noise=sigma) for name, sigma in noise.items()}
    )


def _checked(
    source: str,
    mechanism: Mechanism,
    rig: RigTable,
    tolerance: Mapping[str, float],
    sensors: Mapping[str, float | str] | None,
    budget: float | None,
    default_budget: float,
) -> Bench:
    """What the rig can do, proven; what nobody gave is filled in and said."""
    where, assumed = f"{source}: " if source else "", list[str]()
    if not mechanism.cranked or mechanism.several:
        raise OptionError(f"{mechanism.name} is not moved by one crank; a plan is of linkages that one crank turns")
    if rig.rate is not None and rig.samples is not None:
        raise OptionError(f"{where}rig.rate and rig.samples exclude each other; keep one")
    bench = Bench(
        mechanism,
        _speeds(where, mechanism, rig, assumed),
        _sensors(where, mechanism, rig, sensors),
        _loadings(where, mechanism, rig, assumed),
        budget or rig.budget or default_budget,
        rig.reverse,
        rig.turns,
        None if rig.rate is None else _si(f"{where}rig.rate", rig.rate, "Hz"),
        rig.samples,
        rig.run_price,
        tolerance,
    )
    if rig.budget is None and budget is None:
        assumed.append(f"budget: {default_budget:g}")
    if rig.rate is None and rig.samples is None:
        assumed.append(f"samples: {A_TURN} a turn of the crank")
    _affordable(bench)
    return replace(bench, assumed=tuple(assumed))


def _speeds(where: str, mechanism: Mechanism, rig: RigTable, assumed: list[str]) -> tuple[float, ...]:
    """Speeds (rad/s) of the crank, each once; noted where they are ``assumed``.  Raises OptionError."""
    if rig.speeds is not None:
        given = (_si(f"{where}rig.speeds", speed, "rad/s") for speed in rig.speeds)
        return tuple(sorted(dict.fromkeys(given)))
    if not mechanism.speed:
        raise OptionError(
            f"the drive of {mechanism.name} has no constant speed; give it one, or say in a plan.toml what the rig can"
            ' do: [rig] speeds = ["60 rpm"]'
        )
    assumed.append(f"speeds: half, once and twice the drive's own, {amount(abs(mechanism.speed), 'rad/s')}")
    return tuple(share * abs(mechanism.speed) for share in SPEEDS)


def _loadings(where: str, mechanism: Mechanism, rig: RigTable, assumed: list[str]) -> tuple[Loading, ...]:
    """Loads that runs may carry; noted where they are ``assumed``.  Raises OptionError."""
    for each in rig.loadings:
        try:
            mechanism.replace(loads=each.loads or ())
        except MechanismError as error:
            raise OptionError(f"{where}rig.loading {each.name!r}: {error}") from None
    others = rig.loadings
    if not others and mechanism.loads and rig.as_drawn:
        assumed.append("loads: those of the mechanism, or none")
        others = (Loading(name="no-load", loads=()),)
    found = (*((Loading(),) if rig.as_drawn or not others else ()), *others)
    names = [each.name for each in found]
    if len(set(names)) < len(names):
        raise OptionError(f"{where}two rig.loading have one name; give each its own: {', '.join(map(repr, names))}")
    return found


def _sensors(
    where: str, mechanism: Mechanism, rig: RigTable, given: Mapping[str, float | str] | None
) -> tuple[Sensor, ...]:
    """The sensors that could be used.  Raises ArgumentError or MeasuredError."""
    entries = rig.sensors if given is None else {name: SensorEntry(noise=noise) for name, noise in given.items()}
    if not entries:
        raise ArgumentError(
            "sensors",
            f"there are none; give each with its noise (1 sigma, SI), such as {mechanism.efforts[0].name}=0.05",
        )
    if given is None:
        return tuple(_sensor(f"{where}rig.sensors ", name, entry, mechanism) for name, entry in entries.items())
    try:
        return tuple(_sensor("", name, entry, mechanism) for name, entry in entries.items())
    except OptionError as error:
        raise ArgumentError("sensors", str(error)) from None


def _sensor(where: str, name: str, entry: SensorEntry, mechanism: Mechanism) -> Sensor:
    """A sensor, its noise in SI.  Raises OptionError."""
    known = readable(mechanism)
    if name in known:
        return Sensor(name, _si(f"{where}{name}", entry.noise, known[name].unit), entry.price)
    close = difflib.get_close_matches(name, known, n=1)
    remedy = f"did you mean {close[0]!r}" if close else f"its signals are {', '.join(list(known)[:LISTED])}, ..."
    raise OptionError(f"{where}{name!r} is no signal of {mechanism.name}; {remedy}")


def _si(where: str, given: Quantity, unit: str) -> float:
    """A quantity above 0, in SI: a number, or a text with its unit (``60 rpm``).  Raises OptionError."""
    try:
        value = number(given, unit)
    except UnitError as error:
        raise OptionError(f"{where} = {quoted(given)} has {error}") from None
    if not 0 < value < math.inf:
        raise OptionError(f"{where} = {quoted(given)}: give a number above 0")
    return value


def _affordable(bench: Bench) -> None:
    """Raises ArgumentError where the budget buys no run with a sensor."""
    run = bench.run_price + min(loading.price for loading in bench.loadings)
    least = run + min(sensor.price for sensor in bench.sensors)
    if bench.budget < least:
        raise ArgumentError(
            "budget", f"{bench.budget:g} buys no run: one with one sensor costs {least:g}; give that much or more"
        )

"""``[context]`` of a measured.toml: what a diagnosis is wanted for."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from analytic.mechanism import Mechanism
from analytic.mechanism.signals import Signal, named
from analytic.mechanism.units import UnitError
from analytic.mechanism.written import number
from compare.diagnose.data.recording import MeasuredError, Wanted

Text = Annotated[str, Field(max_length=1000, pattern=r"^\P{Cc}*$")]


class ContextTable(BaseModel):
    """``[context]`` as written."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    question: Text = ""
    quantity: Annotated[str, Field(min_length=1, max_length=200)]
    required: float | str
    consequence: Text = ""
    speed: float | str | None = None
    calibration: Mapping[str, float | str] = Field(default_factory=dict)


def wanted(called: str, table: ContextTable | None, mechanism: Mechanism) -> Wanted | None:
    """What is wanted of a linkage.  Raises MeasuredError."""
    if table is None:
        return None
    known = named(mechanism.bodies, mechanism.joints, mechanism.drives)
    signal = _signal(f"{called}: context.quantity", table.quantity, known)
    required = in_si(f"{called}: context.required", table.required, signal.unit)
    if required <= 0:
        raise MeasuredError(f"{called}: context.required = {table.required!r}; give an error above 0, in {signal.unit}")
    speed = None if table.speed is None else in_si(f"{called}: context.speed", table.speed, "rad/s")
    if speed == 0:
        raise MeasuredError(f"{called}: context.speed = {table.speed!r}; give a speed other than 0, or leave it out")
    shared = {}
    for name, size in table.calibration.items():
        where = f"{called}: context.calibration.{name}"
        shared[name] = in_si(where, size, _signal(where, name, known).unit)
        if shared[name] < 0:
            raise MeasuredError(f"{where} = {size!r}; give a standard uncertainty of 0 or more")
    return Wanted(signal, required, table.question, table.consequence, speed, shared)


def _signal(where: str, name: str, known: Mapping[str, Signal]) -> Signal:
    if name in known:
        return known[name]
    close = difflib.get_close_matches(name, known, n=1)
    remedy = f"did you mean {close[0]!r}" if close else f"give one such as {', '.join(list(known)[:3])}"
    raise MeasuredError(f"{where}: {name!r} is no signal of the mechanism; {remedy}")


def in_si(where: str, given: float | str, unit: str) -> float:
    """A number, or one that is written with its unit, in an SI unit.  Raises MeasuredError."""
    try:
        return number(given, unit)
    except UnitError as error:
        raise MeasuredError(f"{where} = {given!r} has {error}") from None

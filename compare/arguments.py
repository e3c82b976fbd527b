"""What the functions that a person calls take: a linkage, engines, clearances and crank angles, checked.

The command line reads its options into the same; :mod:`compare.cli.options` names them as they were typed.
"""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.structure import StructureError
from analytic.mechanism import Mechanism
from analytic.mechanism.file import MechanismError, load
from compare.faults import ArgumentError, reason
from compare.judge.grid import chosen_angles
from sim_models.engine import SimulatorMissing, engine, engine_names, offers

Linkage = Mechanism | str | Path
"""A mechanism, the name of a shipped case, or the path of a mechanism file."""
Simulators = str | Sequence[str]
"""Names of engines, one or several; ``all`` is every one that is installed."""
Metres = Mapping[str, float]
"""Radial clearance (m) by joint."""


def linkage(given: Linkage, clearance: Metres | None = None) -> Mechanism:
    """The mechanism that is meant, with these clearances in place of its own if any are given; proven to assemble.

    Raises MechanismError with what was given, or ArgumentError for a clearance that no joint can have.
    """
    mechanism = given if isinstance(given, Mechanism) else load(str(given))
    try:
        Assembly(mechanism)
    except (AssemblyError, StructureError) as error:
        raise MechanismError(f"{mechanism.name if isinstance(given, Mechanism) else given}: {error}") from None
    return mechanism if clearance is None else with_clearance(mechanism, clearance)


def with_clearance(mechanism: Mechanism, clearance: Metres, called: str = "clearance") -> Mechanism:
    """The mechanism with exactly these radial clearances (m).  Raises ArgumentError."""
    try:
        return mechanism.with_clearances(metres(clearance, mechanism, called))
    except ValueError as error:  # pydantic's is one
        raise ArgumentError(called, reason(error)) from None


def metres(given: Metres, mechanism: Mechanism, called: str) -> dict[str, float]:
    """Lengths (m) by revolute joint, checked.  Raises ArgumentError."""
    pins = [j.name for j in mechanism.joints if not j.prismatic]
    found = {}
    for name, size in given.items():
        if name not in pins:
            raise ArgumentError(
                called, f"{name!r} is not a revolute joint of {mechanism.name}; they are {', '.join(pins)}"
            )
        if not 0 <= size < math.inf:
            raise ArgumentError(called, f"{name} = {size}; give metres, 0 or more")
        found[name] = float(size)
    return found


def engines(given: Simulators) -> tuple[tuple[str, ...], list[str]]:
    """The engines that are meant, and of ``all`` those that are left out and why, a sentence each.

    Raises Unsupported for an unknown name, SimulatorMissing where none is installed.
    """
    if given != "all":
        asked = [given] if isinstance(given, str) else list(given)
        return tuple(engine(name).name for name in dict.fromkeys(asked)), []
    found, left_out = [], []
    for name in engine_names():
        try:
            found.append(engine(name).name)
        except SimulatorMissing as missing:
            left_out.append(f"left out: {missing}")
    left_out += [f"left out: {why}" for why in offers().refused.values()]
    if not found:
        raise SimulatorMissing(f"no simulator is installed; run: pip install 'linkage-crosscheck[{engine_names()[0]}]'")
    return tuple(found), left_out


def crank_angles(assembly: Assembly, given: Sequence[float] | np.ndarray | None) -> np.ndarray:
    """Crank angles (N,) rad as given, or those at which one looks at the linkage by default; it reaches all of them.

    Raises ArgumentError, or AssemblyError by default.
    """
    if given is None:
        return chosen_angles(assembly, None)
    theta = np.array(given, float).reshape(-1)
    if not theta.size or not np.all(np.isfinite(theta)):
        raise ArgumentError("angles", "give one crank angle (rad) or more, all of them finite")
    try:
        assembly.path(float(theta.min()), float(theta.max()))
    except AssemblyError as error:
        raise ArgumentError("angles", str(error)) from None
    if theta.size > 2 and np.ptp(theta) > 30 and np.allclose(theta, np.round(theta)):
        text = f"angles go from {theta.min():g} to {theta.max():g} rad; were they meant in degrees?"
        warnings.warn(text, stacklevel=3)
    return theta


def rigidly_and_evenly_driven(mechanism: Mechanism) -> Mechanism:
    """The mechanism with a drive as cross-checks have it; warns of what its own has besides."""
    drive = mechanism.drive
    for field, checks in (("stiffness", "are rigid"), ("ripple", "turn evenly")):
        if drive is not None and getattr(drive, field) is not None:
            warnings.warn(f"{mechanism.name}: cross-checks {checks}; drive.{field} is left out", stacklevel=3)
            drive = drive.model_copy(update={field: None})
    return mechanism if drive is mechanism.drive else mechanism.replace(drive=drive)


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def noted() -> Iterator[list[str]]:
    """Warnings that are given within, as sentences; each is given again when it ends."""
    told: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        yield told
    for each in caught:
        if not issubclass(each.category, RuntimeWarning):
            told.append(str(each.message))
        warnings.warn_explicit(each.message, each.category, each.filename, each.lineno)

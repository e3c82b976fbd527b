"""Signals that follow from others, and what kind each one is."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Literal

import numpy as np

from analytic.mechanism import Mechanism

Unit = Literal["rad", "N", "m", "N.m"]
Kind = Literal["angle", "magnitude", "displacement", "rotation", "torque", "position"]
UNITS: dict[Kind, Unit] = {
    "angle": "rad",
    "magnitude": "N",
    "displacement": "m",
    "rotation": "rad",
    "torque": "N.m",
    "position": "rad",
}


def with_derived(signals: Mapping[str, np.ndarray], mechanism: Mechanism) -> dict[str, np.ndarray]:
    """Signals with each reaction's direction (rad, continued along the run) and size (N) added."""
    out = {name: np.array(values, float) for name, values in signals.items()}
    for joint in mechanism.joints:
        force = out[f"reaction_{joint.name}_x"] + 1j * out[f"reaction_{joint.name}_y"]
        out[f"reaction_{joint.name}_angle"] = _continued(np.angle(force))
        out[f"reaction_{joint.name}_magnitude"] = np.abs(force)
    return out


def missing(signals: Iterable[str], mechanism: Mechanism, clearances: Iterable[str]) -> list[str]:
    """What a simulation of this mechanism must report and these signals lack."""
    wanted = [
        "drive_torque",
        *(f"{body.name}_{part}" for body in mechanism.bodies for part in ("angle", "angular_velocity", "x", "y")),
    ]
    for joint in mechanism.joints:
        wanted += [f"reaction_{joint.name}_{part}" for part in ("x", "y", *(["moment"] if joint.prismatic else []))]
    wanted += [f"clearance_{name}_{axis}" for name in clearances for axis in "xy"]
    present = set(signals)
    return [name for name in wanted if name not in present]


def _continued(angle: np.ndarray) -> np.ndarray:
    known = np.flatnonzero(np.isfinite(angle))
    out = angle.copy()
    out[known] = np.unwrap(angle[known])
    return out


def with_rotations(signals: Mapping[str, np.ndarray], ideal_angles: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Signals with each body's rotation by clearance: its angle minus the ideal linkage's (rad)."""
    return dict(signals) | {
        f"{body}_rotation": signals[f"{body}_angle"] - angle for body, angle in ideal_angles.items()
    }


def compared(mechanism: Mechanism, clearances: Iterable[str]) -> dict[str, Kind]:
    """The signals on which a run is judged, in the order of a report, and their kinds."""
    kinds: dict[str, Kind] = {}
    displaced = list(clearances)
    for joint in mechanism.joints:
        kinds[f"reaction_{joint.name}_angle"] = "angle"
        kinds[f"reaction_{joint.name}_magnitude"] = "magnitude"
        if joint.prismatic:
            kinds[f"reaction_{joint.name}_moment"] = "torque"
        if joint.name in displaced:
            kinds[f"clearance_{joint.name}_x"] = kinds[f"clearance_{joint.name}_y"] = "displacement"
    for body in mechanism.bodies:
        if displaced and body.name != mechanism.driven:
            kinds[f"{body.name}_rotation"] = "rotation"
        elif not displaced:
            kinds[f"{body.name}_angle"] = "position"
    kinds["drive_torque"] = "torque"
    return kinds

"""Which signals a run is judged on, of what kind each is to a tolerance file, and signals that follow from others."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Literal

import numpy as np

from analytic.mechanism import Mechanism
from analytic.mechanism.signals import Component, Signal, continued
from analytic.mechanism.signals import Kind as Quantity

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
_KINDS: dict[tuple[Quantity, Component], Kind] = {
    ("reaction", "angle"): "angle",
    ("reaction", "magnitude"): "magnitude",
    ("reaction", "moment"): "torque",
    ("clearance", "x"): "displacement",
    ("clearance", "y"): "displacement",
    ("rotation", "angle"): "rotation",
    ("pose", "angle"): "position",
    ("pose", "x"): "displacement",
    ("pose", "y"): "displacement",
    ("drive", "torque"): "torque",
}
DRIVE_TORQUE = Signal("drive", "", "torque")


def kind_of(signal: Signal) -> Kind:
    """The kind under which a tolerance file has a signal.  Raises KeyError for one that is never judged."""
    return _KINDS[signal.kind, signal.component]


NOTHING = 1e-12  # of a reaction's peak: no force, and no direction


def with_derived(signals: Mapping[str, np.ndarray], mechanism: Mechanism) -> dict[str, np.ndarray]:
    """Signals (N,) with each reaction's direction (rad, continued along the run) and size (N) added.

    Where there is no force, as where a pin flies, there is no direction: NaN.
    """
    out = {name: np.array(values, float) for name, values in signals.items()}
    for joint in mechanism.joints:
        x = Signal.of("reaction", joint.name, "x")
        force = out[x.name] + 1j * out[x.sibling("y").name]
        size = np.abs(force)
        acts = size > NOTHING * np.nanmax(size, initial=0.0)
        out[x.sibling("angle").name] = continued(np.where(acts, np.angle(force), np.nan))
        out[x.sibling("magnitude").name] = size
    return out


def with_rotations(signals: Mapping[str, np.ndarray], ideal_angles: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Signals (N,) with each body's rotation by clearance: its angle minus the ideal linkage's (rad)."""
    out = dict(signals)
    for body, ideal in ideal_angles.items():
        out[Signal.of("rotation", body, "angle").name] = signals[Signal.of("pose", body, "angle").name] - ideal
    return out


def compared(mechanism: Mechanism, clearances: Iterable[str]) -> tuple[Signal, ...]:
    """The signals on which a run with clearance in these joints is judged, in the order of a report.

    Bodies are judged by their rotation with clearance, by their angle without.
    """
    return tuple(_compared(mechanism, set(clearances)))


def _compared(mechanism: Mechanism, displaced: set[str]) -> Iterator[Signal]:
    for joint in mechanism.joints:
        yield Signal("reaction", joint.name, "angle")
        yield Signal("reaction", joint.name, "magnitude")
        if joint.prismatic:
            yield Signal("reaction", joint.name, "moment")
        if joint.name in displaced:
            yield Signal("clearance", joint.name, "x")
            yield Signal("clearance", joint.name, "y")
    for body in mechanism.bodies:
        if not displaced:
            yield Signal("pose", body.name, "angle")
        elif body.name != mechanism.driven:
            yield Signal("rotation", body.name, "angle")
    yield DRIVE_TORQUE

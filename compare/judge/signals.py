"""Which signals a run is judged on, of what kind each is to a tolerance file, and signals that follow from others."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Literal, TypeVar

import numpy as np

from analytic.mechanism import Mechanism
from analytic.mechanism.signals import (
    AXES,
    Component,
    Signal,
    SignalKind,
    continued,
    driving,
    moving,
    play,
    signals,
    slipping,
)

ToleranceKind = Literal[
    "angle", "magnitude", "displacement", "rotation", "torque", "force", "position", "place", "velocity", "speed",
    "acceleration", "angular_acceleration", "power", "strain",
]  # fmt: skip
_KINDS: dict[tuple[SignalKind, Component], ToleranceKind] = {
    ("reaction", "angle"): "angle",
    ("reaction", "magnitude"): "magnitude",
    ("reaction", "x"): "magnitude",
    ("reaction", "y"): "magnitude",
    ("reaction", "moment"): "torque",
    ("clearance", "x"): "displacement",
    ("clearance", "y"): "displacement",
    ("clearance", "angle"): "rotation",
    ("rotation", "angle"): "rotation",
    ("pose", "angle"): "position",
    ("pose", "x"): "place",
    ("pose", "y"): "place",
    ("rate", "angular_velocity"): "velocity",
    ("velocity", "x"): "speed",
    ("velocity", "y"): "speed",
    ("acceleration", "x"): "acceleration",
    ("acceleration", "y"): "acceleration",
    ("acceleration", "angle"): "angular_acceleration",
    ("joint_velocity", "angle"): "velocity",
    ("joint_velocity", "travel"): "speed",
    ("joint_acceleration", "angle"): "angular_acceleration",
    ("joint_acceleration", "travel"): "acceleration",
    ("power", "power"): "power",
    ("sensor", "travel"): "place",
    ("sensor", "speed"): "speed",
    ("sensor", "acceleration"): "acceleration",
    ("sensor", "angular_velocity"): "velocity",
    ("sensor", "strain"): "strain",
    ("sensor", "force"): "force",
    ("sensor", "torque"): "torque",
    ("position", "angle"): "position",
    ("position", "travel"): "place",
    ("drive", "torque"): "torque",
    ("drive", "force"): "force",
}

LINE_OF: dict[ToleranceKind, ToleranceKind] = {  # a line of tolerances.toml is of both, each in its unit
    "force": "torque", "power": "torque", "speed": "velocity", "angular_acceleration": "acceleration",
    "strain": "torque",
}  # fmt: skip
Values = TypeVar("Values")


def kind_of(signal: Signal) -> ToleranceKind:
    """The kind under which a tolerance file has a signal.  Raises KeyError for one that is never judged."""
    return _KINDS[signal.kind, signal.component]


NO_REACTION = 1e-12  # of a reaction's peak: no force, and no direction


def with_derived(signals: Mapping[str, np.ndarray], mechanism: Mechanism) -> dict[str, np.ndarray]:
    """Signals (N,) with each reaction's direction (rad, continued along the run) and size (N) added.

    Where there is no force, as where a pin flies, there is no direction: NaN.  A reaction that has not both components
    is left as it is.
    """
    derived = {name: np.array(values, float) for name, values in signals.items()}
    for joint in mechanism.joints:
        x = Signal.of("reaction", joint.name, "x")
        if x.name not in derived or x.sibling("y").name not in derived:
            continue
        force = derived[x.name] + 1j * derived[x.sibling("y").name]
        size = np.abs(force)
        acts = size > NO_REACTION * np.nanmax(size, initial=0.0)
        derived[x.sibling("angle").name] = continued(np.where(acts, np.angle(force), np.nan))
        derived[x.sibling("magnitude").name] = size
    return derived


def with_rotations(signals: Mapping[str, np.ndarray], ideal_angles: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Signals (N,) with each body's rotation by clearance: its angle minus the ideal linkage's (rad).  Where there is
    no angle, a rotation stays as it is.
    """
    rotated = dict(signals)
    for body, ideal in ideal_angles.items():
        if Signal.of("pose", body, "angle").name not in rotated:
            continue
        rotated[Signal.of("rotation", body, "angle").name] = signals[Signal.of("pose", body, "angle").name] - ideal
    return rotated


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
            yield from play(joint)
    for body in mechanism.bodies:
        if not displaced:
            yield Signal("pose", body.name, "angle")
        elif not (mechanism.cranked and body.name == mechanism.driven):
            yield Signal("rotation", body.name, "angle")
    if _slides_freely(mechanism) and not displaced:
        yield from (Signal("pose", body.name, axis) for body in mechanism.bodies for axis in AXES)
    if mechanism.cranked or mechanism.drives:
        yield from driving(mechanism.motors)


def _slides_freely(mechanism: Mechanism) -> bool:
    """Whether there are slides in what no crank moves, and a drive is free or missing: no angle tells their travel."""
    driven = mechanism.drives and all(drive.speed != "free" for drive in mechanism.drives)
    return not mechanism.cranked and not driven and any(joint.prismatic for joint in mechanism.joints)


def recorded(mechanism: Mechanism, clearances: Iterable[str], given: Iterable[str]) -> tuple[Signal, ...]:
    """The signals on which a file of results is judged that has these: those of every run, and what else it gives.

    A reaction's components are judged where the file has one of them alone; how a motor turns its crank is not, because
    the analytic side follows it.
    """
    names = set(given) - prescribed(mechanism)
    judged = [signal for signal in compared(mechanism, clearances) if signal.name in names]
    for joint in mechanism.joints:
        sides = [Signal("reaction", joint.name, axis) for axis in AXES]
        here = [side for side in sides if side.name in names]
        judged += here if len(here) == 1 else []
    for body in mechanism.bodies:
        judged += [Signal("pose", body.name, axis) for axis in AXES if f"{body.name}_{axis}" in names]
        rate = Signal("rate", body.name, "angular_velocity")
        judged += [rate] if rate.name in names else []
    judged += [signal for signal in _signals(mechanism) if signal.on_request and signal.name in names]
    return tuple(dict.fromkeys(judged))


def prescribed(mechanism: Mechanism) -> frozenset[str]:
    """Names of what a crank's motor says of it: its angle, its rate and its acceleration; of none that swings."""
    if not (mechanism.cranked and mechanism.motors):
        return frozenset()
    crank, joint = mechanism.driven, mechanism.drive_joint
    turning = [Signal("pose", crank, "angle"), Signal("rate", crank, "angular_velocity"), [*moving(crank)][-1]]
    return frozenset(signal.name for signal in (*turning, *slipping(joint)))


def only(values: Mapping[str, Values], mechanism: Mechanism, asked: Iterable[str]) -> dict[str, Values]:
    """What is known by signal, of those on request what is ``asked`` for by name."""
    idle = {signal.name for signal in _signals(mechanism) if signal.on_request} - set(asked)
    return {name: value for name, value in values.items() if name not in idle}


def _signals(mechanism: Mechanism) -> Iterator[Signal]:
    return signals(mechanism.bodies, mechanism.joints, mechanism.drives, mechanism.sensors)

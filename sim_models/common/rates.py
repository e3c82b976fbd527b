"""Rates of bodies among an engine's samples, out of them again, and the signals that they make."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from analytic.mechanism import MASS_CENTRE, Body, Joint, Mechanism
from analytic.mechanism.sensing import with_sensors
from analytic.mechanism.signals import POWER, driving, moving, slipping
from sim_models.engine import Rates, Trace

RATE_COLUMNS = ("velocity x", "velocity y", "acceleration x", "acceleration y", "angular acceleration")


def rate_columns(body: str, velocity: complex, acceleration: complex, turning: float) -> dict[str, float]:
    """A body's rates at one instant, named so that they go along with its signals."""
    values = velocity.real, velocity.imag, acceleration.real, acceleration.imag, turning
    return {f"{body}: {name}": float(value) for name, value in zip(RATE_COLUMNS, values, strict=True)}


def part_rates(columns: Mapping[str, np.ndarray]) -> tuple[dict[str, np.ndarray], dict[str, Rates]]:
    """Signals and rates of samples (N,) in which both are."""
    found: dict[str, list[np.ndarray]] = {}
    for name in columns:
        body, _, column = name.partition(": ")
        if column == RATE_COLUMNS[0]:
            found[body] = [columns[f"{body}: {each}"] for each in RATE_COLUMNS]
    rates = {body: Rates(vx + 1j * vy, ax + 1j * ay, turning) for body, (vx, vy, ax, ay, turning) in found.items()}
    return {name: values for name, values in columns.items() if ": " not in name}, rates


def with_rates(m: Mechanism, trace: Trace, asked: Iterable[str]) -> dict[str, np.ndarray]:
    """The signals (N,) of a trace, and those on request that it has rates for where any is ``asked`` for by name; what
    it says itself stays.  What sensors read follows from these (:mod:`analytic.mechanism.sensing`).
    """
    if not any(asked):
        return dict(trace.signals)
    return with_sensors(m, {**rate_signals(m, trace), **trace.signals}, still=trace.motion == "static")


def rate_signals(m: Mechanism, trace: Trace) -> dict[str, np.ndarray]:
    """Velocities and accelerations of markers and joints, and the power of the drives, by name (N,) SI, of a trace that
    has the rates of all bodies: those of the engine itself, carried from centres of mass to markers and joints as a
    rigid body carries them.  Nothing of another trace.
    """
    if any(body.name not in trace.rates or f"{body.name}_angle" not in trace.signals for body in m.bodies):
        return {}
    found: dict[str, np.ndarray] = {}
    moves = {body.name: _Moves.of(body, trace) for body in m.bodies}
    for name, body in moves.items():
        _, velocity, acceleration = body.at(m.moving[name].point("com"))
        parts = velocity.real, velocity.imag, acceleration.real, acceleration.imag, body.spin_up
        found |= zip((signal.name for signal in moving(name)), parts, strict=True)
    slips = {joint.name: _slip(m, joint, moves) for joint in m.joints}
    for joint in m.joints:
        found |= zip((signal.name for signal in slipping(joint)), slips[joint.name], strict=True)
    driven = m.motors or ([m.drive_joint] if m.cranked else [])
    signs = [m.crank_sign if m.cranked else 1.0] * len(driven)  # of a torque on the crank, which a joint may name first
    power = np.zeros(trace.crank_angle.size)
    for joint, signal, sign in zip(driven, driving(m.motors), signs, strict=bool(driven)):
        power = power + sign * trace.signals.get(signal.name, 0.0) * slips[joint.name][0]
    return found | {POWER.name: power}


@dataclass(frozen=True)
class _Moves:
    """A body at the instants of a trace, ground frame: (N,) its centre of mass, complex, and how it turns."""

    centre: complex  # m, in its own frame
    place: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    angle: np.ndarray
    spin: np.ndarray
    spin_up: np.ndarray

    @classmethod
    def of(cls, body: Body, trace: Trace) -> _Moves:
        """A body of a trace."""
        angle, rates = trace.signals[f"{body.name}_angle"], trace.rates[body.name]
        spin = trace.signals.get(f"{body.name}_angular_velocity", np.zeros(angle.shape))
        marker = trace.signals[f"{body.name}_x"] + 1j * trace.signals[f"{body.name}_y"]
        place = marker + (body.point(MASS_CENTRE) - body.point("com")) * np.exp(1j * angle)
        moves = rates.velocity, rates.acceleration, angle, spin, rates.angular_acceleration
        return cls(body.point(MASS_CENTRE), place, *moves)

    def at(self, point: complex) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Place, velocity and acceleration (N,) of a point (m) in the body's frame."""
        arm = (point - self.centre) * np.exp(1j * self.angle)
        turning = 1j * self.spin_up - self.spin**2
        return self.place + arm, self.velocity + 1j * self.spin * arm, self.acceleration + turning * arm


def _slip(m: Mechanism, joint: Joint, moves: Mapping[str, _Moves]) -> tuple[np.ndarray, np.ndarray]:
    """Rate and acceleration (N,) of a joint's position: of its second body seen from its first."""
    still = np.zeros(next(iter(moves.values())).spin.shape)
    first, second = (moves.get(name) for name in joint.bodies)
    spin, spin_up = (first.spin, first.spin_up) if first else (still, still)
    if not joint.prismatic:
        return (second.spin if second else still) - spin, (second.spin_up if second else still) - spin_up
    ends = [
        body.at(m.body(name).point(joint.name)) if body else (still + m.body(name).point(joint.name), still, still)
        for name, body in zip(joint.bodies, (first, second), strict=True)
    ]
    apart, slip, push = (far - near for near, far in zip(*ends, strict=True))
    along = np.conj(joint.direction * np.exp(1j * (first.angle if first else still)))
    seen = slip - 1j * spin * apart  # by who turns with the first body
    return np.real(along * seen), np.real(along * (push - 1j * spin_up * apart - 1j * spin * (slip + seen)))

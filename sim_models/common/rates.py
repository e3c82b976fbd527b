"""Rates of bodies among an engine's samples, out of them again, and the signals that they make."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from analytic.mechanism import GROUND, Body, Joint, Mechanism
from analytic.mechanism.sensing import with_sensors
from analytic.mechanism.signals import POWER, driving, moving, slipping
from sim_models.common.track import Track
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
    moves = {GROUND: Track.still(trace.crank_angle.size)} | {body.name: _track(body, trace) for body in m.bodies}
    for name, body in m.moving.items():
        _, velocity, acceleration = moves[name].at(body.point("com") - body.centre)
        parts = velocity.real, velocity.imag, acceleration.real, acceleration.imag, moves[name].spin_up
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


def _track(body: Body, trace: Trace) -> Track:
    """How a body's centre of mass moves at the instants of a trace, and how the body turns."""
    angle, rates = trace.signals[f"{body.name}_angle"], trace.rates[body.name]
    spin = trace.signals.get(f"{body.name}_angular_velocity", np.zeros(angle.shape))
    marker = trace.signals[f"{body.name}_x"] + 1j * trace.signals[f"{body.name}_y"]
    place = marker + (body.centre - body.point("com")) * np.exp(1j * angle)
    return Track(place, angle, rates.velocity, spin, rates.acceleration, rates.angular_acceleration)


def _slip(m: Mechanism, joint: Joint, moves: Mapping[str, Track]) -> tuple[np.ndarray, np.ndarray]:
    """Rate and acceleration (N,) of a joint's position: of its second body seen from its first."""
    first, second = (moves[name] for name in joint.bodies)
    if not joint.prismatic:
        return second.spin - first.spin, second.spin_up - first.spin_up
    points = {name: m.parts[name].point(joint.name) for name in joint.bodies}
    points = {name: at if name == GROUND else at - m.moving[name].centre for name, at in points.items()}
    apart, slip, push = (
        far - near for near, far in zip(*(moves[name].at(at) for name, at in points.items()), strict=True)
    )
    along = np.conj(joint.direction * first.turned)
    seen = slip - 1j * first.spin * apart  # by who turns with the first body
    return np.real(along * seen), np.real(along * (push - 1j * first.spin_up * apart - 1j * first.spin * (slip + seen)))

"""Cross-checks with flexible links: engines that build them of beams, and how far the paper's superposition may be off.

The analytic side is of first order in the elastic displacement d.  A link whose two ends move by d each turns by up to
2 d over its length.  That turn of the shortest link is the share of a force or a displacement that the superposition
neglects; the turn's square is what it neglects of a body's angle.  A torque is the joint's force on a lever: of one
that is small because the lever lies along the force, as of a link that hangs, it neglects that share of the force on a
lever as long as the shortest link.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from analytic.mechanism import Mechanism, Sensor
from analytic.mechanism.signals import AXES, Signal, driving
from compare.judge.discrepancy import Rule
from compare.judge.reference import Reference
from sim_models.engine import (
    Capabilities,
    Engine,
    Request,
    Scope,
    Trace,
    Unsupported,
    check_supported,
    declared,
    engine,
    engine_names,
)

OF_DISPLACEMENT = 1e-3  # of a body's displacement: what beams of few elements may be off by
OF_LENGTH = 1e-9  # of the longest body: rounding, all that there is where nothing moves


class Beams(Engine):
    """An engine whose bodies bend where they have a modulus of elasticity, at rest, where the superposition holds."""

    def __init__(self, chosen: Engine) -> None:
        self.engine, self.name, self.package = chosen, chosen.name, chosen.package
        beams = chosen.capabilities.beams
        self.capabilities = Capabilities(rigid=Scope.of(()) if beams is None else beams.at_rest())

    @classmethod
    def of(cls, name: str) -> Beams:
        """The engine of that name.  Raises Unsupported if it has no beams, and what :func:`sim_models.engine.engine`
        raises.
        """
        chosen = engine(name)
        if chosen.capabilities.beams is None:
            bending = ", ".join(each for each in engine_names() if declared(each).capabilities.beams)
            raise Unsupported(
                f"simulator {name!r} has rigid links only; links bend in {bending}, or leave flexible links out"
            )
        return cls(chosen)

    def simulate(self, request: Request) -> Trace:
        """Run one request.  Raises SimulationError, Unsupported or AssemblyError."""
        check_supported(self, request)
        return self.engine.simulate_flexible(request)


def softened(
    rules: Mapping[str, Rule], side: Reference, clearances: Mapping[str, float], mechanism: Mechanism
) -> dict[str, Rule]:
    """The rules, widened by what the superposition neglects, and rules for the bodies' positions.

    The elastic displacement is that of the linkage without clearance, so the allowance for it and for the bodies'
    rotations includes the clearances.
    """
    shortest = min(length for body in mechanism.bodies if (length := body.length) > 0)
    moved = side.elastic + sum(clearances.values())
    force, place = 2 * side.elastic / shortest, 2 * moved / shortest  # rad
    widened, sits = {}, {s.name: s.joint for s in mechanism.sensors if s.kind in ("force", "torque")}
    for name, rule in rules.items():
        if rule.kind == "angle":
            widened[name] = replace(rule, absolute=rule.absolute + force)
        elif rule.kind == "position":
            widened[name] = replace(rule, absolute=rule.absolute + place**2)
        elif rule.kind in ("torque", "force"):
            lever = shortest if rule.kind == "torque" else 1.0
            joint = sits.get(name) or rule.signal.place or mechanism.drive_joint.name
            least = force * _carried(side, joint) * lever
            widened[name] = replace(rule, absolute=max(rule.absolute, least), relative=rule.relative + force)
        elif rule.kind == "strain":
            least = force * _bending(side, next(s for s in mechanism.sensors if s.name == name), mechanism)
            widened[name] = replace(rule, absolute=max(rule.absolute, least), relative=rule.relative + force)
        elif rule.kind == "rotation":
            widened[name] = replace(rule, absolute=rule.absolute + place**2, relative=rule.relative + place)
        else:
            widened[name] = replace(rule, relative=rule.relative + force)
    rounding = OF_LENGTH * max(body.length for body in mechanism.bodies)
    of_drive = rules[driving(mechanism.motors)[0].name]
    of_place = replace(of_drive, absolute=rounding, relative=OF_DISPLACEMENT + place, clearance=moved, window=0.0)
    places = [Signal("pose", body.name, axis) for body in mechanism.bodies for axis in AXES]
    places += [rule.signal for rule in rules.values() if rule.signal.kind == "sensor" and rule.kind == "place"]
    return widened | {signal.name: replace(of_place, signal=signal) for signal in places}


def _bending(side: Reference, gauge: Sensor, mechanism: Mechanism) -> float:
    """The strain on the face of a gauge's bar that its joints' largest force gives by all its length."""
    body = mechanism.moving[gauge.body]
    force = max(_carried(side, joint.name) for joint in mechanism.joints if body.name in joint.bodies)
    height, depth = body.section
    return force * body.length * 6 / (depth * height**2 * (gauge.modulus(body) or np.inf))


def _carried(side: Reference, joint: str) -> float:
    """The largest force (N) that a joint carries; 0 where statics does not determine it."""
    name = Signal("reaction", joint, "magnitude").name
    return max(side.peaks.get(name, 0.0), float(np.nanmax(np.abs(side.signals[name]), initial=0.0)))

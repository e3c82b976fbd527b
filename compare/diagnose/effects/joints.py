"""Effects in joints and in the drive: play, friction, springs, a soft or uneven motor, as pure functions on the
mechanism.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from analytic.mechanism import Mechanism, Ripple
from compare.diagnose.effects.effect import Effect, Parameter, Reciprocal, Rig, Values

HARMONICS = range(1, 13)


class OnJoint(Effect):
    """Effects that are one field of a joint; the value is the whole field, the natural coordinate what the model lacks
    of it.
    """

    field_name: ClassVar[str]

    def places(self, rig: Rig) -> Sequence[str]:
        return _joints(rig)

    def unit(self, rig: Rig, where: str, parameter: str) -> str:
        return _unit(rig, where, super().unit(rig, where, parameter))

    def nominal(self, rig: Rig, where: str) -> float:
        """The field in the nominal mechanism."""
        return float(getattr(rig.mechanism.joint(where), self.field_name))

    def values(self, rig: Rig, where: str, x: np.ndarray, variant: float = 0.0) -> dict[str, float]:
        return {self.parameters[0].name: self.nominal(rig, where) + float(x[0])}

    def lowest(self, rig: Rig, where: str, variant: float = 0.0) -> np.ndarray:
        return np.array([-self.nominal(rig, where)])

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        return mechanism.with_joint(where, **{self.field_name: values[self.parameters[0].name]})


class JointClearance(OnJoint):
    """Play between pin and bearing."""

    name = "joint_clearance"
    slow = True
    field_name = "clearance"
    parameters = (Parameter("radial_clearance", "m", "clearance", 0.0),)

    def places(self, rig: Rig) -> Sequence[str]:
        return [j.name for j in rig.mechanism.joints if not j.prismatic]

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (2e-4 * rig.length,)


class CoulombFriction(OnJoint):
    """A constant friction torque (a force in a prismatic joint)."""

    name = "coulomb_friction"
    field_name = "friction_torque"
    parameters = (Parameter("friction_torque", "N.m", "torque", 0.0),)

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-3 * (rig.force if rig.mechanism.joint(where).prismatic else rig.torque),)


class ViscousFriction(OnJoint):
    """A damper in a joint."""

    name = "viscous_friction"
    field_name = "damping"
    parameters = (Parameter("damping", "N.m.s/rad", "damping", 0.0),)

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-3 * (rig.force / rig.length if rig.mechanism.joint(where).prismatic else rig.torque) / rig.speed,)


class JointSpring(Effect):
    """A spring in a joint: torque -k (q - rest).  Natural coordinates are k and k rest, in which it is linear."""

    name = "joint_spring"
    parameters = (Parameter("stiffness", "N.m/rad", "stiffness", 0.0), Parameter("rest_angle", "rad", "angle"))

    def unit(self, rig: Rig, where: str, parameter: str) -> str:
        return _unit(rig, where, super().unit(rig, where, parameter))

    def places(self, rig: Rig) -> Sequence[str]:
        return [j.name for j in rig.mechanism.joints if not j.stiffness]

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        if rig.mechanism.joint(where).prismatic:
            return (1e-3 * rig.force / rig.length, 1e-3 * rig.force)
        return (1e-3 * rig.torque, 1e-3 * rig.torque)

    def blames(self, parameter: str) -> bool:
        return parameter == "stiffness"

    def lowest(self, rig: Rig, where: str, variant: float = 0.0) -> np.ndarray:
        return np.array([0.0, -math.inf])

    def values(self, rig: Rig, where: str, x: np.ndarray, variant: float = 0.0) -> dict[str, float]:
        stiffness = max(float(x[0]), 1e-9 * self.scales(rig, where)[0])
        return {"stiffness": stiffness, "rest_angle": float(x[1]) / stiffness}

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        return mechanism.with_joint(where, stiffness=values["stiffness"], rest_angle=values["rest_angle"])


class DriveCompliance(Reciprocal):
    """A springy transmission: the crank lags its motor by torque over stiffness."""

    name = "drive_compliance"
    needs_engine = True
    slow = True
    parameters = (Parameter("stiffness", "N.m/rad", "stiffness", 0.0),)

    def places(self, rig: Rig) -> Sequence[str]:
        return ["drive"] if rig.driven and not (rig.mechanism.drive and rig.mechanism.drive.stiffness) else []

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-5 / rig.torque,)

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        return _with_drive(mechanism, stiffness=values["stiffness"])


class SpeedRipple(Effect):
    """A motor that turns unevenly: command plus amplitude sin(harmonic command + phase).  Natural: a cos p, a sin p."""

    name = "speed_ripple"
    parameters = (
        Parameter("amplitude", "rad", "angle", 0.0),
        Parameter("harmonic", "1", "harmonic"),
        Parameter("phase", "rad", "phase"),
    )

    def places(self, rig: Rig) -> Sequence[str]:
        uneven = rig.mechanism.drive is not None and rig.mechanism.drive.ripple is not None
        return ["drive"] if set(rig.driven) - set(rig.following) and not uneven else []

    def measured_by(self, i: int) -> Parameter:
        return self.parameters[0]

    def variants(self, rig: Rig, where: str) -> Sequence[float]:
        return [float(h) for h in HARMONICS]

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-5, 1e-5)

    def lowest(self, rig: Rig, where: str, variant: float = 0.0) -> np.ndarray:
        return np.array([-math.inf, -math.inf])

    def values(self, rig: Rig, where: str, x: np.ndarray, variant: float = 0.0) -> dict[str, float]:
        return {"amplitude": math.hypot(x[0], x[1]), "harmonic": variant, "phase": math.atan2(x[1], x[0])}

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        ripple = Ripple(amplitude=values["amplitude"], harmonic=round(values["harmonic"]), phase=values["phase"])
        return _with_drive(mechanism, ripple=ripple)


def _with_drive(mechanism: Mechanism, **fields: object) -> Mechanism:
    drive = (
        mechanism.drive.model_dump(exclude_unset=True)
        if mechanism.drive
        else {"joint": mechanism.drive_joint.name, "speed": "measured"}
    )
    return mechanism.replace(drive=drive | fields)


def _joints(rig: Rig) -> list[str]:
    return [j.name for j in rig.mechanism.joints]


def _unit(rig: Rig, where: str, revolute: str) -> str:
    """The unit of a revolute joint's parameter in a joint: a prismatic one has forces and travels for torques and
    angles.
    """
    prismatic = {"N.m": "N", "N.m.s/rad": "N.s/m", "N.m/rad": "N/m", "rad": "m"}
    return prismatic.get(revolute, revolute) if rig.mechanism.joint(where).prismatic else revolute

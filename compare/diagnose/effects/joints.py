"""Effects in joints: play, friction and springs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from analytic.mechanism import Mechanism
from compare.diagnose.effects.effect import Draw, Effect, Growth, Hiding, Parameter, Rig, Values


class OnJoint(Effect):
    """Effects that are one field of a joint; the value is the whole field, the natural coordinate what the model lacks
    of it.
    """

    place = "joint"
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

    def natural(self, rig: Rig, where: str, values: Values, variant: float = 0.0) -> np.ndarray:
        return super().natural(rig, where, values, variant) - self.nominal(rig, where)

    def lowest(self, rig: Rig, where: str, variant: float = 0.0) -> np.ndarray:
        return np.array([-self.nominal(rig, where)])

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        return mechanism.with_joint(where, **{self.field_name: values[self.parameters[0].name]})


class JointClearance(OnJoint):
    """Play between pin and bearing."""

    name = "joint_clearance"
    label = "clearance in joint {}"
    meaning = "joint {} has clearance"
    needs = frozenset({"contact"})
    hiding = Hiding(in_contact=True, exclusive=True, makers={"exudyn": 1.0, "mujoco": 1.0, "dart": 0.3})
    slow = True
    field_name = "clearance"
    parameters = (Parameter("radial_clearance", "m", "clearance", 0.0),)

    def places(self, rig: Rig) -> Sequence[str]:
        return [j.name for j in rig.mechanism.joints if not j.prismatic]

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (2e-4 * rig.length,)

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        shortest = min(b.length for b in rig.mechanism.bodies if b.length > 0)
        return Growth(lambda a: {"radial_clearance": a * shortest}, 0.01)


class CoulombFriction(OnJoint):
    """A constant friction torque (a force in a prismatic joint)."""

    name = "coulomb_friction"
    label = "Coulomb friction in joint {}"
    meaning = "joint {} has dry friction"
    needs = frozenset({"coulomb_friction"})
    field_name = "friction_torque"
    parameters = (Parameter("friction_torque", "N.m", "torque", 0.0),)
    workmanship = 20.0

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-3 * _torque(rig, where),)

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        torque = _torque(rig, where)
        return Growth(lambda a: {"friction_torque": a * torque}, 0.5)


class ViscousFriction(OnJoint):
    """A damper in a joint."""

    name = "viscous_friction"
    label = "viscous friction in joint {}"
    meaning = "joint {} has viscous friction"
    needs = frozenset({"viscous_friction"})
    field_name = "damping"
    parameters = (Parameter("damping", "N.m.s/rad", "damping", 0.0),)
    workmanship = 20.0

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-3 * (rig.force / rig.length if rig.mechanism.joint(where).prismatic else rig.torque) / rig.speed,)

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        damping = _torque(rig, where) / rig.speed / (rig.length if rig.mechanism.joint(where).prismatic else 1.0)
        return Growth(lambda a: {"damping": a * damping}, 0.5)


class JointSpring(Effect):
    """A spring in a joint: torque -k (q - rest).  Natural coordinates are k and k rest, in which it is linear."""

    name = "joint_spring"
    place = "joint"
    label = "a spring in joint {}"
    meaning = "a spring acts in joint {}"
    needs = frozenset({"joint_spring"})
    parameters = (Parameter("stiffness", "N.m/rad", "stiffness", 0.0), Parameter("rest_angle", "rad", "angle"))

    def unit(self, rig: Rig, where: str, parameter: str) -> str:
        return _unit(rig, where, super().unit(rig, where, parameter))

    def places(self, rig: Rig) -> Sequence[str]:
        return [j.name for j in rig.mechanism.joints if not j.springy]

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

    def natural(self, rig: Rig, where: str, values: Values, variant: float = 0.0) -> np.ndarray:
        return np.array([values["stiffness"], values["stiffness"] * values["rest_angle"]])

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        return mechanism.with_joint(where, stiffness=values["stiffness"], rest_angle=values["rest_angle"])

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        rest = self._rest(rig, where, draw)
        torque = _torque(rig, where)
        stiffness = torque / rig.length if rig.mechanism.joint(where).prismatic else torque
        return Growth(lambda a: {"stiffness": a * stiffness, "rest_angle": rest}, 0.5)

    @staticmethod
    def _rest(rig: Rig, where: str, draw: Draw) -> float:
        """Where a spring might rest: about the middle of its joint's travel (rad, or m)."""
        signals, joint = draw.motion(), rig.mechanism.joint(where)
        first, second = joint.bodies
        if joint.prismatic:
            travel = signals[f"{second}_x"]
            return float(draw.rng.uniform(travel.min(), travel.max()))
        angle = signals[f"{second}_angle"] - (signals[f"{first}_angle"] if first in rig.mechanism.moving else 0.0)
        return float(angle.mean() + draw.rng.uniform(-1.0, 1.0))


def _joints(rig: Rig) -> list[str]:
    return [j.name for j in rig.mechanism.joints]


def _unit(rig: Rig, where: str, revolute: str) -> str:
    """The unit of a revolute joint's parameter in a joint: a prismatic one has forces and travels for torques and
    angles.
    """
    prismatic = {"N.m": "N", "N.m.s/rad": "N.s/m", "N.m/rad": "N/m", "rad": "m"}
    return prismatic.get(revolute, revolute) if rig.mechanism.joint(where).prismatic else revolute


def _torque(rig: Rig, where: str) -> float:
    """A torque (N.m) typical of a joint of the rig, a force (N) of a prismatic one."""
    return rig.force if rig.mechanism.joint(where).prismatic else rig.torque


EFFECTS: tuple[Effect, ...] = (JointClearance(), CoulombFriction(), ViscousFriction(), JointSpring())

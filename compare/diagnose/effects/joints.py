"""Effects in joints: play and contact, friction, soft bearings and springs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from analytic.mechanism import Mechanism
from compare.diagnose.effects.each_run import EachRun
from compare.diagnose.effects.effect import Draw, Effect, Growth, Hiding, Parameter, Reciprocal, Rig, Values
from sim_models.common.contact_laws import contact_parameters, lighter_mass, restitution

SLIP_SPEEDS = (0.04, 0.12, 0.36)  # of the fastest run: Stribeck speeds that are tried at first, a factor of three apart
FASTER = 3.0  # times the fastest run: a Stribeck speed above that is no more than Coulomb friction
RESTS = (1 / 6, 1 / 2, 5 / 6)  # of a joint's travel: where a spring that is not linear is tried to rest at first


class OnJoint(EachRun):
    """Effects that are one field of a joint; the value is the whole field, the natural coordinate what the model lacks
    of it.
    """

    place = "joint"
    field_name: ClassVar[str]
    varies = False

    def places(self, rig: Rig) -> Sequence[str]:
        return _joints(rig)

    def unit(self, rig: Rig, where: str, parameter: str) -> str:
        return _unit(rig, where, super().unit(rig, where, parameter))

    def nominal(self, rig: Rig, where: str) -> float:
        return float(getattr(rig.mechanism.joint(where), self.field_name))

    def least(self, rig: Rig, where: str) -> float:
        return -self.nominal(rig, where)

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        return mechanism.with_joint(where, **{self.field_name: values[self.parameters[0].name]})


class JointClearance(OnJoint):
    """Play between pin and bearing."""

    name = "joint_clearance"
    label = "clearance in joint {}"
    meaning = "joint {} has clearance"
    needs = frozenset({"contact"})
    hiding = Hiding(in_contact=True, exclusive=True, makers={"exudyn": 1.0, "mujoco": 1.0, "dart": 0.3})
    field_name = "clearance"
    parameters = (Parameter("radial_clearance", "m", "clearance", 0.0),)

    def places(self, rig: Rig) -> Sequence[str]:
        return [] if rig.mechanism.sliding else _revolute(rig)

    def scale(self, rig: Rig, where: str) -> float:
        return 2e-4 * rig.length

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        shortest = min(b.length for b in rig.mechanism.bodies if b.length > 0)
        return Growth(lambda a: {"radial_clearance": a * shortest}, 0.01)


class ContactLaw(Effect):
    """How a pin strikes that leaves its bearing.  Natural coordinates are what the model lacks of restitution, of the
    stiffness' logarithm and of the coefficient of friction.
    """

    name = "contact_law"
    place = "joint"
    label = "another contact in joint {}"
    meaning = "the pin of joint {} strikes its bearing otherwise"
    needs = frozenset({"contact", "contact_law", "contact_friction"})
    hiding = Hiding(sets=None)
    asked_for = True
    parameters = (
        Parameter("restitution", "1", "restitution", 0.0),
        Parameter("stiffness", "N/m", "stiffness", 0.0),
        Parameter("friction", "1", "friction", 0.0),
    )

    def places(self, rig: Rig) -> Sequence[str]:
        soft = rig.mechanism.soft_bearings
        return [j for j in JointClearance().places(rig) if j not in soft]

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (0.01, 0.1, 0.01)

    def blames(self, parameter: str) -> bool:
        return False

    def usual(self, rig: Rig, where: str) -> tuple[float, float, float]:
        """Restitution, stiffness (N/m) and friction of the model, at the speed of the fastest run."""
        mechanism = rig.mechanism
        drive = mechanism.drive and mechanism.drive.model_copy(update={"speed": rig.speed})
        joint, real = mechanism.joint(where), mechanism.replace(drive=drive) if drive else mechanism
        made = contact_parameters(real, joint, "driven")
        if joint.restitution is not None:
            return joint.restitution, made.stiffness, joint.friction
        ratio = made.damping / (2 * math.sqrt(made.stiffness * lighter_mass(mechanism, joint)))
        return restitution(ratio), made.stiffness, joint.friction

    def lowest(self, rig: Rig, where: str, variant: float = 0.0) -> np.ndarray:
        back, _, friction = self.usual(rig, where)
        return np.array([-back, -math.inf, -friction])

    def values(self, rig: Rig, where: str, x: np.ndarray, variant: float = 0.0) -> dict[str, float]:
        back, stiffness, friction = self.usual(rig, where)
        return {
            "restitution": float(np.clip(back + x[0], 0.0, 1.0)),
            "stiffness": stiffness * math.exp(float(x[1])),
            "friction": friction + float(x[2]),
        }

    def natural(self, rig: Rig, where: str, values: Values, variant: float = 0.0) -> np.ndarray:
        back, stiffness, friction = self.usual(rig, where)
        hardness = math.log(values["stiffness"] / stiffness)
        return np.array([values["restitution"] - back, hardness, values["friction"] - friction])

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        return mechanism.with_joint(
            where,
            contact_stiffness=values["stiffness"],
            contact_damping=None,
            restitution=values["restitution"],
            friction=values["friction"],
        )

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        back, stiffness, friction = self.usual(rig, where)
        harder, rubs = draw.rng.uniform(-1.0, 1.0), draw.rng.uniform(0.0, 0.3)
        return Growth(
            lambda a: {
                "restitution": back + a * (0.95 - back),
                "stiffness": stiffness * math.exp(a * harder),
                "friction": friction + a * rubs,
            },
            1.0,
        )


class CoulombFriction(OnJoint):
    """A constant friction torque (a force in a prismatic joint)."""

    name = "coulomb_friction"
    label = "Coulomb friction in joint {}"
    meaning = "joint {} has dry friction"
    needs = frozenset({"coulomb_friction"})
    varies = True  # with temperature, and with how a bearing was clamped
    field_name = "friction_torque"
    parameters = (Parameter("friction_torque", "N.m", "torque", 0.0),)
    special_case_of = ("stribeck_friction",)

    def scale(self, rig: Rig, where: str) -> float:
        return 1e-3 * _torque(rig, where)

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        torque = _torque(rig, where)
        return Growth(lambda a: {"friction_torque": a * torque}, 0.5)


class StribeckFriction(Effect):
    """Dry friction that is larger in slow slip.  Natural coordinates are what the model lacks of Coulomb friction, what
    static friction is above it, and how far the Stribeck speed is from the variant's.
    """

    name = "stribeck_friction"
    place = "joint"
    label = "Stribeck friction in joint {}"
    meaning = "joint {} has dry friction that grows as it slows down"
    needs = frozenset({"coulomb_friction", "stribeck_friction"})
    sized = 2
    hiding = Hiding(sets="machines")
    parameters = (
        Parameter("friction_torque", "N.m", "torque", 0.0),
        Parameter("static_torque", "N.m", "torque", 0.0),
        Parameter("stribeck_speed", "rad/s", "speed", 0.0),
    )

    def unit(self, rig: Rig, where: str, parameter: str) -> str:
        return _unit(rig, where, super().unit(rig, where, parameter))

    def places(self, rig: Rig) -> Sequence[str]:
        return [j.name for j in rig.mechanism.joints if j.static_torque is None]

    def variants(self, rig: Rig, where: str) -> Sequence[float]:
        return [share * _speed(rig, where) for share in SLIP_SPEEDS]

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        small = 1e-3 * _torque(rig, where)
        return (small, small, 0.1 * variant)

    def probes(self, rig: Rig, where: str, variant: float = 0.0) -> np.ndarray:
        return super().probes(rig, where, variant)[:2]  # without friction the speed has no meaning

    def blames(self, parameter: str) -> bool:
        return parameter != "stribeck_speed"

    def lowest(self, rig: Rig, where: str, variant: float = 0.0) -> np.ndarray:
        return np.array([-rig.mechanism.joint(where).coulomb, 0.0, -math.inf])

    def values(self, rig: Rig, where: str, x: np.ndarray, variant: float = 0.0) -> dict[str, float]:
        friction = rig.mechanism.joint(where).coulomb + float(x[0])
        speed = np.clip(variant + x[2], 0.1 * variant, FASTER * _speed(rig, where))
        return {"friction_torque": friction, "static_torque": friction + float(x[1]), "stribeck_speed": float(speed)}

    def natural(self, rig: Rig, where: str, values: Values, variant: float = 0.0) -> np.ndarray:
        friction, static, speed = (values[p.name] for p in self.parameters)
        return np.array([friction - rig.mechanism.joint(where).coulomb, static - friction, speed - variant])

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        return mechanism.with_joint(where, **values)

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        torque, excess = _torque(rig, where), draw.rng.uniform(1.0, 3.0)
        speed = draw.rng.uniform(0.05, 0.4) * _speed(rig, where)
        return Growth(
            lambda a: {
                "friction_torque": a * torque,
                "static_torque": a * torque * (1 + excess),
                "stribeck_speed": speed,
            },
            0.25,
            SLIP_SPEEDS[1] * _speed(rig, where),
        )


class LoadFriction(OnJoint):
    """Dry friction of a loaded bearing: friction coefficient times pin radius times the reaction's size.  It takes the
    place of what a coefficient of the pin gives.
    """

    name = "load_friction"
    label = "friction of the load in joint {}"
    meaning = "joint {} has dry friction that grows with its reaction"
    needs = frozenset({"load_friction"})
    hiding = Hiding(sets="machines", makers={"mujoco": 1.0, "dart": 1.0, "pybullet": 0.25})
    field_name = "friction_radius"
    parameters = (Parameter("coefficient_radius", "m", "length", 0.0),)

    def places(self, rig: Rig) -> Sequence[str]:
        return _revolute(rig)

    def nominal(self, rig: Rig, where: str) -> float:
        return rig.mechanism.joint(where).load_coefficient

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        return mechanism.with_friction_circle(where, values["coefficient_radius"])

    def scale(self, rig: Rig, where: str) -> float:
        return 1e-4 * rig.length

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        return Growth(lambda a: {"coefficient_radius": a * rig.length}, 0.05)


class ViscousFriction(OnJoint):
    """A damper in a joint."""

    name = "viscous_friction"
    label = "viscous friction in joint {}"
    meaning = "joint {} has viscous friction"
    needs = frozenset({"viscous_friction"})
    varies = True  # with temperature, and with how a bearing was clamped
    field_name = "damping"
    parameters = (Parameter("damping", "N.m.s/rad", "damping", 0.0),)

    def scale(self, rig: Rig, where: str) -> float:
        return 1e-3 * (rig.force / rig.length if rig.mechanism.joint(where).prismatic else rig.torque) / rig.speed

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        damping = _torque(rig, where) / rig.speed / (rig.length if rig.mechanism.joint(where).prismatic else 1.0)
        return Growth(lambda a: {"damping": a * damping}, 0.5)


class Drag(OnJoint):
    """A torque against the motion that grows with the square of its speed, as of a fan or of churned oil."""

    name = "drag"
    label = "drag in joint {}"
    meaning = "a drag acts in joint {}"
    needs = frozenset({"drag"})
    hiding = Hiding(sets="machines")
    field_name = "drag"
    parameters = (Parameter("drag", "N.m.s2/rad2", "drag", 0.0),)

    def scale(self, rig: Rig, where: str) -> float:
        return 1e-3 * _torque(rig, where) / _speed(rig, where) ** 2

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        drag = _torque(rig, where) / _speed(rig, where) ** 2
        return Growth(lambda a: {"drag": a * drag}, 0.5)


class JointCompliance(Reciprocal):
    """A soft bearing: the pin gives along the reaction by its size over a stiffness."""

    name = "joint_compliance"
    place = "joint"
    label = "a soft bearing in joint {}"
    meaning = "the bearing of joint {} is soft"
    needs = frozenset({"soft_bearing"})
    hiding = Hiding(sets="machines", exclusive=True, makers={"exudyn": 1.0, "mujoco": 1.0})
    parameters = (Parameter("stiffness", "N/m", "stiffness", 0.0),)

    def places(self, rig: Rig) -> Sequence[str]:
        soft = rig.mechanism.soft_bearings
        return [j for j in _revolute(rig) if j not in soft] if rig.mechanism.cranked else []

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-6 * rig.length / rig.force,)

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        return mechanism.with_joint(where, radial_stiffness=values["stiffness"])

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        return Growth(lambda a: {"stiffness": rig.force / rig.length / a}, 0.01)


class JointSpring(Effect):
    """A spring in a joint: torque -k (q - rest).  Natural coordinates are k and k rest, in which it is linear."""

    name = "joint_spring"
    place = "joint"
    label = "a spring in joint {}"
    meaning = "a spring acts in joint {}"
    needs = frozenset({"joint_spring"})
    special_case_of = ("nonlinear_spring",)
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
        if mechanism.joint(where).cubic:
            raise ValueError(f"joint {where} has a spring already, which is not linear")
        return mechanism.with_joint(where, stiffness=values["stiffness"], rest_angle=values["rest_angle"])

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        rest = self._rest(rig, where, draw)
        torque = _torque(rig, where)
        stiffness = torque / rig.length if rig.mechanism.joint(where).prismatic else torque
        return Growth(lambda a: {"stiffness": a * stiffness, "rest_angle": rest}, 0.5)

    @staticmethod
    def _rest(rig: Rig, where: str, draw: Draw) -> float:
        """Where a spring might rest: about the middle of its joint's travel (rad, or m)."""
        if rig.mechanism.several:
            low, high = rig.travels[where]
            return float(draw.rng.uniform(low, high))
        signals, joint = draw.motion(), rig.mechanism.joint(where)
        first, second = joint.bodies
        if joint.prismatic:
            travel = signals[f"{second}_x"]
            return float(draw.rng.uniform(travel.min(), travel.max()))
        angle = signals[f"{second}_angle"] - (signals[f"{first}_angle"] if first in rig.mechanism.moving else 0.0)
        return float(angle.mean() + draw.rng.uniform(-1.0, 1.0))


class NonlinearSpring(Effect):
    """A spring that stiffens or softens: torque -k s - c s^3 of its stretch s.  Natural coordinates are k, c and how
    far it rests from the variant's angle.
    """

    name = "nonlinear_spring"
    place = "joint"
    label = "a spring in joint {} that is not linear"
    meaning = "a spring that is not linear acts in joint {}"
    needs = frozenset({"joint_spring", "nonlinear_spring"})
    sized = 2
    hiding = Hiding(sets="machines")
    parameters = (
        Parameter("stiffness", "N.m/rad", "stiffness", 0.0),
        Parameter("cubic", "N.m/rad3", "stiffness", more="of cubic stiffening", less="of cubic softening"),
        Parameter("rest_angle", "rad", "angle"),
    )

    def unit(self, rig: Rig, where: str, parameter: str) -> str:
        return _unit(rig, where, super().unit(rig, where, parameter))

    def places(self, rig: Rig) -> Sequence[str]:
        return [j.name for j in rig.mechanism.joints if not j.springy and j.name in rig.travels]

    def variants(self, rig: Rig, where: str) -> Sequence[float]:
        low, high = rig.travels[where]
        return [low + share * (high - low) for share in RESTS]

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        low, high = rig.travels[where]
        half, torque = (high - low) / 2, 1e-3 * _torque(rig, where)
        return (torque / half, torque / half**3, 0.1 * half)

    def probes(self, rig: Rig, where: str, variant: float = 0.0) -> np.ndarray:
        return super().probes(rig, where, variant)[:2]  # without a spring its rest has no meaning

    def blames(self, parameter: str) -> bool:
        return parameter != "rest_angle"

    def lowest(self, rig: Rig, where: str, variant: float = 0.0) -> np.ndarray:
        return np.array([0.0, -math.inf, -math.inf])

    def values(self, rig: Rig, where: str, x: np.ndarray, variant: float = 0.0) -> dict[str, float]:
        return {"stiffness": float(x[0]), "cubic": float(x[1]), "rest_angle": variant + float(x[2])}

    def natural(self, rig: Rig, where: str, values: Values, variant: float = 0.0) -> np.ndarray:
        return super().natural(rig, where, values) - [0.0, 0.0, variant]

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        return mechanism.with_joint(where, **values)

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        low, high = rig.travels[where]
        half, torque, share = (high - low) / 2, _torque(rig, where), draw.rng.uniform(0.0, 0.5)
        rest = low + draw.rng.uniform(0.3, 0.7) * (high - low)
        return Growth(
            lambda a: {
                "stiffness": a * share * torque / half,
                "cubic": a * torque / half**3,
                "rest_angle": rest,
            },
            0.5,
            low + half,
        )


def _joints(rig: Rig) -> list[str]:
    return [j.name for j in rig.mechanism.joints]


def _revolute(rig: Rig) -> list[str]:
    return [j.name for j in rig.mechanism.joints if not j.prismatic]


def _unit(rig: Rig, where: str, revolute: str) -> str:
    """The unit of a revolute joint's parameter in a joint: a prismatic one has forces and travels for torques and
    angles.
    """
    prismatic = {
        "N.m": "N",
        "N.m.s/rad": "N.s/m",
        "N.m.s2/rad2": "N.s2/m2",
        "N.m/rad": "N/m",
        "N.m/rad3": "N/m3",
        "rad": "m",
        "rad/s": "m/s",
    }
    return prismatic.get(revolute, revolute) if rig.mechanism.joint(where).prismatic else revolute


def _torque(rig: Rig, where: str) -> float:
    """A torque (N.m) typical of a joint of the rig, a force (N) of a prismatic one."""
    return rig.force if rig.mechanism.joint(where).prismatic else rig.torque


def _speed(rig: Rig, where: str) -> float:
    """A speed (rad/s) typical of a joint of the rig, of a prismatic one in m/s."""
    return rig.speed * (rig.length if rig.mechanism.joint(where).prismatic else 1.0)


EFFECTS: tuple[Effect, ...] = (
    JointClearance(),
    CoulombFriction(),
    ViscousFriction(),
    JointSpring(),
    StribeckFriction(),
    LoadFriction(),
    Drag(),
    JointCompliance(),
    NonlinearSpring(),
    ContactLaw(),
)

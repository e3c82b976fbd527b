"""The vocabulary's first half: what may be missing from a mechanism, as pure functions on it.

The second half, sensors and clocks, is in :mod:`compare.diagnose.sensors`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from analytic.mechanism import GROUND, Body, Load, Mechanism, Ripple
from compare.diagnose.effect import Effect, Parameter, Rig, Values

HARMONICS = range(1, 13)


def _bodies(rig: Rig) -> list[str]:
    return [b.name for b in rig.mechanism.bodies]


def _joints(rig: Rig) -> list[str]:
    return [j.name for j in rig.mechanism.joints]


def _body(mechanism: Mechanism, name: str) -> Body:
    return mechanism.moving[name]


def _pair(z: complex) -> tuple[float, float]:
    return (z.real, z.imag)


def _pinned(body: Body) -> dict[str, object]:
    """What must stay when points or masses move: com, inertia and marker as they are now."""
    return {"com": _pair(body.centre), "inertia": body.moment_of_inertia, "marker": _pair(body.point("com"))}


class Gravity(Effect):
    """Weight that the model lacks or directs wrongly; values are the whole vector."""

    name = "gravity"
    parameters = (Parameter("x", "m/s^2", "gravity"), Parameter("y", "m/s^2", "gravity"))

    def places(self, rig: Rig) -> Sequence[str]:
        return ["linkage"]

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (0.1, 0.1)

    def values(self, rig: Rig, where: str, x: np.ndarray, variant: float = 0.0) -> dict[str, float]:
        return {"x": rig.mechanism.gravity[0] + float(x[0]), "y": rig.mechanism.gravity[1] + float(x[1])}

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        return mechanism.replace(gravity=(values["x"], values["y"]))


class Payload(Effect):
    """A point mass riding on a body; marker and loads stay where the nominal com is."""

    name = "payload"
    parameters = (Parameter("mass", "kg", "mass", 0.0), Parameter("along", "m", "position"), Parameter("normal", "m", "position"))

    def places(self, rig: Rig) -> Sequence[str]:
        return _bodies(rig)

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        body = _body(rig.mechanism, where)
        size = body.length or rig.length
        return (1e-2 * body.mass, 0.3 * size, 0.3 * size)

    def probes(self, rig: Rig, where: str, variant: float = 0.0) -> np.ndarray:
        m, a, n = self.scales(rig, where)
        return np.array([[m, 0, 0], [m, a, 0], [m, -a, 0], [m, 0, n]])  # mass, both moments, and the inertia of being off centre

    def start(self, rig: Rig, where: str, coefficients: np.ndarray, variant: float = 0.0) -> np.ndarray:
        m, a, n = self.scales(rig, where)
        share = float(coefficients.sum())
        if share <= 0:  # the data want less mass, which no payload is
            return np.array([0.0, 0.0, 0.0])
        return np.array([m * share, a * (coefficients[1] - coefficients[2]) / share, n * coefficients[3] / share])

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        body = _body(mechanism, where)
        arm, m = complex(values["along"], values["normal"]), values["mass"]
        mass = body.mass + m
        centre = body.centre + m * (body.point("com") + arm - body.centre) / mass
        inertia = body.moment_of_inertia + body.mass * abs(centre - body.centre) ** 2 + m * abs(body.point("com") + arm - centre) ** 2
        return mechanism.with_body(where, **_pinned(body) | {"mass": mass, "com": _pair(centre), "inertia": inertia})


class ComOffset(Effect):
    """A centre of mass elsewhere than thought; marker and loads stay."""

    name = "com_offset"
    parameters = (Parameter("along", "m", "com"), Parameter("normal", "m", "com"))

    def places(self, rig: Rig) -> Sequence[str]:
        return _bodies(rig)

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-3 * rig.length, 1e-3 * rig.length)

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        body = _body(mechanism, where)
        return mechanism.with_body(where, **_pinned(body) | {"com": _pair(body.centre + complex(values["along"], values["normal"]))})


class MomentOfInertia(Effect):
    """A moment of inertia (about the com) that differs from the model's."""

    name = "moment_of_inertia"
    parameters = (Parameter("inertia_error", "kg.m^2", "inertia"),)
    special_case_of = ("payload",)

    def places(self, rig: Rig) -> Sequence[str]:
        return _bodies(rig)

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        body = _body(rig.mechanism, where)
        return (1e-2 * (body.moment_of_inertia or body.mass * rig.length**2),)

    def lowest(self, rig: Rig, where: str, variant: float = 0.0) -> np.ndarray:
        return np.array([-_body(rig.mechanism, where).moment_of_inertia])

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        body = _body(mechanism, where)
        return mechanism.with_body(where, inertia=body.moment_of_inertia + values["inertia_error"])


class LinkLength(Effect):
    """A link that is longer or shorter: its last named point moves along its x axis; com, marker and inertia stay."""

    name = "link_length"
    parameters = (Parameter("length_error", "m", "length"),)
    special_case_of = ("pivot_position",)

    def places(self, rig: Rig) -> Sequence[str]:
        joints = set(_joints(rig))
        return [b.name for b in rig.mechanism.bodies if len(b.points) > 1 and list(b.points)[-1] in joints]

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-5 * rig.length,)

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        body = _body(mechanism, where)
        last = list(body.points)[-1]
        x, y = body.points[last]
        return mechanism.with_body(where, **_pinned(body) | {"points": {**body.points, last: (x + values["length_error"], y)}})


class PivotPosition(Effect):
    """A ground point that sits elsewhere than thought; values are its displacement."""

    name = "pivot_position"
    parameters = (Parameter("x", "m", "length"), Parameter("y", "m", "length"))

    def places(self, rig: Rig) -> Sequence[str]:
        used = {j.name for j in rig.mechanism.joints if GROUND in j.bodies}
        return [p for p in rig.mechanism.ground.points if p in used]

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-5 * rig.length, 1e-5 * rig.length)

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        points = dict(mechanism.ground.points)
        points[where] = (points[where][0] + values["x"], points[where][1] + values["y"])
        return mechanism.replace(ground={"points": points})


class OnJoint(Effect):
    """Effects that are one field of a joint; the value is the whole field, the natural coordinate what the model lacks of it."""

    field_name: ClassVar[str]

    def places(self, rig: Rig) -> Sequence[str]:
        return _joints(rig)

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


class ExternalForce(Effect):
    """A force at a body's com, fixed in direction, beside the loads of the model."""

    name = "external_force"
    parameters = (Parameter("x", "N", "force"), Parameter("y", "N", "force"))

    def places(self, rig: Rig) -> Sequence[str]:
        return _bodies(rig)

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-3 * rig.force, 1e-3 * rig.force)

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        return mechanism.replace(loads=(*mechanism.loads, Load(body=where, force=(values["x"], values["y"]))))


class LoadTorque(Effect):
    """A constant torque on a body."""

    name = "load_torque"
    parameters = (Parameter("torque", "N.m", "torque"),)
    special_case_of = ("joint_spring",)

    def places(self, rig: Rig) -> Sequence[str]:
        return _bodies(rig)

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-3 * rig.torque,)

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        return mechanism.replace(loads=(*mechanism.loads, Load(body=where, torque=values["torque"])))


class Reciprocal(Effect):
    """Effects of a compliance whose reported value is its reciprocal, a stiffness or modulus."""

    def blames(self, parameter: str) -> bool:
        return False

    def lowest(self, rig: Rig, where: str, variant: float = 0.0) -> np.ndarray:
        return np.zeros(1)

    def values(self, rig: Rig, where: str, x: np.ndarray, variant: float = 0.0) -> dict[str, float]:
        return {self.parameters[0].name: 1.0 / max(float(x[0]), 1e-9 * self.scales(rig, where)[0])}


class LinkFlexibility(Reciprocal):
    """Links that bend, all of one modulus; they need a section."""

    name = "link_flexibility"
    needs_engine = True
    slow = True
    parameters = (Parameter("youngs_modulus", "Pa", "modulus", 0.0),)

    def places(self, rig: Rig) -> Sequence[str]:
        return ["linkage"] if any(_bends(b) for b in rig.mechanism.bodies) else []

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-11,)

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        return mechanism.replace(bodies=tuple(_flexible(b, values["youngs_modulus"]) for b in mechanism.bodies))


def _bends(body: Body) -> bool:
    return min(body.section) > 0 and body.length > 0


def _flexible(body: Body, modulus: float) -> Body:
    return Body.model_validate(body.model_dump(exclude_unset=True) | {"youngs_modulus": modulus}) if _bends(body) else body


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
    parameters = (Parameter("amplitude", "rad", "angle", 0.0), Parameter("harmonic", "1", "harmonic"), Parameter("phase", "rad", "phase"))

    def places(self, rig: Rig) -> Sequence[str]:
        return ["drive"] if set(rig.driven) - set(rig.following) else []

    def blames(self, parameter: str) -> bool:
        return parameter == "amplitude"

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
    drive = mechanism.drive.model_dump(exclude_unset=True) if mechanism.drive else {"joint": mechanism.drive_joint.name, "speed": "measured"}
    return mechanism.replace(drive=drive | fields)


MECHANISM_EFFECTS: tuple[Effect, ...] = (
    Gravity(), Payload(), ComOffset(), MomentOfInertia(), LinkLength(), PivotPosition(), JointClearance(), CoulombFriction(),
    ViscousFriction(), JointSpring(), ExternalForce(), LoadTorque(), LinkFlexibility(), DriveCompliance(), SpeedRipple(),
)  # fmt: skip

"""Effects on links, ground and loads: masses, lengths, forces and bending, as pure functions on the mechanism."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from analytic.mechanism import GROUND, Body, Load, Mechanism
from compare.diagnose.effects.effect import Effect, Parameter, Reciprocal, Rig, Values


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
    parameters = (
        Parameter("mass", "kg", "mass", 0.0),
        Parameter("along", "m", "position"),
        Parameter("normal", "m", "position"),
    )

    def places(self, rig: Rig) -> Sequence[str]:
        return _bodies(rig)

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        body = _body(rig.mechanism, where)
        size = body.length or rig.length
        return (1e-2 * body.mass, 0.3 * size, 0.3 * size)

    def probes(self, rig: Rig, where: str, variant: float = 0.0) -> np.ndarray:
        m, a, n = self.scales(rig, where)
        return np.array(
            [[m, 0, 0], [m, a, 0], [m, -a, 0], [m, 0, n]]
        )  # mass, both moments, and the inertia of being off centre

    def start(self, rig: Rig, where: str, coefficients: np.ndarray, variant: float = 0.0) -> np.ndarray:
        m, a, n = self.scales(rig, where)
        share = float(coefficients.sum())
        if share <= 0:  # the data want less mass, which no payload is
            return np.array([0.0, 0.0, 0.0])
        return np.array([m * share, a * (coefficients[1] - coefficients[2]) / share, n * coefficients[3] / share])

    def other_start(self, rig: Rig, where: str, x: np.ndarray) -> np.ndarray | None:
        return np.array([max(float(x[0]), self.scales(rig, where)[0]), 0.0, 0.0])

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        body = _body(mechanism, where)
        arm, m = complex(values["along"], values["normal"]), values["mass"]
        mass = body.mass + m
        centre = body.centre + m * (body.point("com") + arm - body.centre) / mass
        inertia = (
            body.moment_of_inertia
            + body.mass * abs(centre - body.centre) ** 2
            + m * abs(body.point("com") + arm - centre) ** 2
        )
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
        return mechanism.with_body(
            where, **_pinned(body) | {"com": _pair(body.centre + complex(values["along"], values["normal"]))}
        )


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
        joints = {j.name for j in rig.mechanism.joints}
        return [b.name for b in rig.mechanism.bodies if len(b.points) > 1 and list(b.points)[-1] in joints]

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-5 * rig.length,)

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        body = _body(mechanism, where)
        last = list(body.points)[-1]
        x, y = body.points[last]
        return mechanism.with_body(
            where, **_pinned(body) | {"points": {**body.points, last: (x + values["length_error"], y)}}
        )


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
    return (
        Body.model_validate(body.model_dump(exclude_unset=True) | {"youngs_modulus": modulus}) if _bends(body) else body
    )


def _bodies(rig: Rig) -> list[str]:
    return [b.name for b in rig.mechanism.bodies]


def _body(mechanism: Mechanism, name: str) -> Body:
    return mechanism.moving[name]


def _pair(z: complex) -> tuple[float, float]:
    return (z.real, z.imag)


def _pinned(body: Body) -> dict[str, object]:
    """What must stay when points or masses move: com, inertia and marker as they are now."""
    return {"com": _pair(body.centre), "inertia": body.moment_of_inertia, "marker": _pair(body.point("com"))}

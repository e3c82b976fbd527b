"""Effects of loads: forces and torques that the model lacks, and links that bend under them."""

from __future__ import annotations

from collections.abc import Sequence

from analytic.mechanism import Body, Load, Mechanism
from compare.diagnose.effects.bodies import bodies
from compare.diagnose.effects.effect import Draw, Effect, Growth, Hiding, Parameter, Reciprocal, Rig, Values
from sim_models.engine import Engine

STEEL = 2e11  # Pa


class ExternalForce(Effect):
    """A force at a body's com, fixed in direction, beside the loads of the model."""

    name = "external_force"
    place = "body"
    label = "an external force on the {}"
    meaning = "an unknown force acts on the {}"
    hiding = Hiding(with_beams=True)
    parameters = (
        Parameter("x", "N", "force", more="to the right", less="to the left"),
        Parameter("y", "N", "force", more="up", less="down"),
    )

    def places(self, rig: Rig) -> Sequence[str]:
        return bodies(rig)

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-3 * rig.force, 1e-3 * rig.force)

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        return mechanism.replace(loads=(*mechanism.loads, Load(body=where, force=(values["x"], values["y"]))))

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        c, s = draw.direction
        return Growth(lambda a: {"x": a * c * rig.force, "y": a * s * rig.force}, 0.5)


class LoadTorque(Effect):
    """A constant torque on a body."""

    name = "load_torque"
    place = "body"
    label = "a load torque on the {}"
    meaning = "an unknown torque acts on the {}"
    hiding = Hiding(with_beams=True)
    parameters = (Parameter("torque", "N.m", "torque", more="counter-clockwise", less="clockwise"),)
    special_case_of = ("joint_spring", "nonlinear_spring")

    def places(self, rig: Rig) -> Sequence[str]:
        return bodies(rig)

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-3 * rig.torque,)

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        return mechanism.replace(loads=(*mechanism.loads, Load(body=where, torque=values["torque"])))

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        return Growth(lambda a: {"torque": a * draw.sign * rig.torque}, 0.5)


class LinkFlexibility(Reciprocal):
    """Links that bend, all of one modulus; they need a section."""

    name = "link_flexibility"
    place = "linkage"
    label = "flexible links"
    meaning = "the links bend"
    hiding = Hiding(cases=("crank-rocker",), exclusive=True, makers={"exudyn": 1.0}, need_beams=True)
    parameters = (Parameter("youngs_modulus", "Pa", "modulus", 0.0),)

    def simulated_by(self, engine: Engine) -> bool:
        return engine.capabilities.beams is not None

    def places(self, rig: Rig) -> Sequence[str]:
        bends = any(_bends(b) for b in rig.mechanism.bodies)
        return ["linkage"] if bends and rig.mechanism.cranked else []

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-11,)

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        return mechanism.replace(bodies=tuple(_flexible(b, values["youngs_modulus"]) for b in mechanism.bodies))

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        return Growth(lambda a: {"youngs_modulus": STEEL / a}, 100.0)


def _bends(body: Body) -> bool:
    return min(body.section) > 0 and body.length > 0


def _flexible(body: Body, modulus: float) -> Body:
    return (
        Body.model_validate(body.model_dump(exclude_unset=True) | {"youngs_modulus": modulus}) if _bends(body) else body
    )


EFFECTS: tuple[Effect, ...] = (ExternalForce(), LoadTorque(), LinkFlexibility())

"""Effects on links and ground: gravity, masses and lengths."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from analytic.mechanism import GROUND, Body, Mechanism
from compare.diagnose.effects.each_run import EachRun
from compare.diagnose.effects.effect import Draw, Effect, Growth, Hiding, Parameter, Rig, Values

CENTRE = "its centre of mass along its x axis"
LIGHT = 0.1  # of its moments over a third of the body's length: a mass from which a fit finds one nearer by
LIGHTEST = 1e-3  # of a hundredth of the body's mass
HEAVY = 0.3  # of a body's mass: a payload from which a fit finds one of any mass


class Gravity(Effect):
    """Weight that the model lacks or directs wrongly; values are the whole vector."""

    name = "gravity"
    place = "linkage"
    label = "gravity"
    meaning = "gravity acts on the linkage"
    hiding = Hiding(with_beams=True)
    parameters = (
        Parameter("x", "m/s^2", "gravity", more="to the right", less="to the left"),
        Parameter("y", "m/s^2", "gravity", more="up", less="down"),
    )

    def places(self, rig: Rig) -> Sequence[str]:
        return ["linkage"]

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (0.1, 0.1)

    def values(self, rig: Rig, where: str, x: np.ndarray, variant: float = 0.0) -> dict[str, float]:
        return {"x": rig.mechanism.gravity[0] + float(x[0]), "y": rig.mechanism.gravity[1] + float(x[1])}

    def natural(self, rig: Rig, where: str, values: Values, variant: float = 0.0) -> np.ndarray:
        return super().natural(rig, where, values, variant) - rig.mechanism.gravity

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        return mechanism.replace(gravity=(values["x"], values["y"]))

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        (x, y), (c, s) = rig.mechanism.gravity, draw.direction
        return Growth(lambda a: {"x": x + a * c, "y": y + a * s}, 9.81)


class Payload(Effect):
    """A point mass riding on a body; marker and loads stay where the nominal com is."""

    name = "payload"
    place = "body"
    label = "a payload on the {}"
    meaning = "a payload rides on the {}"
    parameters = (
        Parameter("mass", "kg", "mass", 0.0),
        Parameter("along", "m", "position", more=f"ahead of {CENTRE}", less=f"behind {CENTRE}"),
        Parameter("normal", "m", "position", more="to the left of it", less="to the right of it"),
    )
    sized = 1

    def places(self, rig: Rig) -> Sequence[str]:
        return bodies(rig)

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        body = body_of(rig.mechanism, where)
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
        if share <= 0:  # the data want less mass, which no payload is, or do not show mass by itself
            share = abs(float(coefficients[1] - coefficients[2]))
        if share <= 0:
            return np.array([0.0, 0.0, 0.0])
        return np.array([m * share, a * (coefficients[1] - coefficients[2]) / share, n * coefficients[3] / share])

    def combined(self, answers: np.ndarray) -> np.ndarray:
        """By a mass, its two first moments and its second one alone."""
        even, odd = (answers[:, 1] + answers[:, 2]) / 2, (answers[:, 1] - answers[:, 2]) / 2
        return np.column_stack([answers[:, 0], odd, answers[:, 3] - even, even - answers[:, 0]])

    def amounts(self, rig: Rig, where: str, size: np.ndarray, variant: float = 0.0) -> np.ndarray:
        m, a, n = self.scales(rig, where)
        return np.asarray(size[0] / m * np.array([1.0, size[1] / a, size[2] / n, (size[1] / a) ** 2 / 2]))

    def never_negative(self, rig: Rig, where: str, low: np.ndarray, variant: float = 0.0) -> np.ndarray:
        return np.array([True, False, False, True])

    def from_amounts(self, rig: Rig, where: str, amounts: np.ndarray, variant: float = 0.0) -> np.ndarray:
        m, a, n = self.scales(rig, where)
        share = max(float(amounts[0]), *(LIGHT * np.abs(amounts[1:3])), LIGHTEST)
        return np.array([m * share, a * amounts[1] / share, n * amounts[2] / share])

    def other_start(self, rig: Rig, where: str, x: np.ndarray) -> np.ndarray | None:
        return np.array([max(float(x[0]), HEAVY * body_of(rig.mechanism, where).mass), 0.0, 0.0])

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        body = body_of(mechanism, where)
        arm, m = complex(values["along"], values["normal"]), values["mass"]
        mass = body.mass + m
        centre = body.centre + m * (body.point("com") + arm - body.centre) / mass
        inertia = (
            body.moment_of_inertia
            + body.mass * abs(centre - body.centre) ** 2
            + m * abs(body.point("com") + arm - centre) ** 2
        )
        return mechanism.with_body(where, **_pinned(body) | {"mass": mass, "com": _pair(centre), "inertia": inertia})

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        body = body_of(rig.mechanism, where)
        size = body.length or rig.length
        along, normal = draw.rng.uniform(-0.4, 0.4) * size, draw.rng.uniform(-0.2, 0.2) * size
        return Growth(lambda a: {"mass": a * body.mass, "along": along, "normal": normal}, 1.0)


class ComOffset(Effect):
    """A centre of mass elsewhere than thought; marker and loads stay."""

    name = "com_offset"
    place = "body"
    limited = True
    label = "an offset centre of mass of the {}"
    meaning = "the centre of mass of the {} is off"
    found = "the centre of mass of the {} is {}"
    parameters = (
        Parameter(
            "along", "m", "com", more="farther along its x axis than drawn", less="less far along its x axis than drawn"
        ),
        Parameter("normal", "m", "com", more="farther to its left than drawn", less="farther to its right than drawn"),
    )

    def places(self, rig: Rig) -> Sequence[str]:
        return bodies(rig)

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-3 * rig.length, 1e-3 * rig.length)

    def lowest(self, rig: Rig, where: str, variant: float = 0.0) -> np.ndarray:
        return -self.highest(rig, where)

    def highest(self, rig: Rig, where: str, variant: float = 0.0) -> np.ndarray:
        return np.full(2, body_of(rig.mechanism, where).length or rig.length)  # farther off is another body

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        body = body_of(mechanism, where)
        return mechanism.with_body(
            where, **_pinned(body) | {"com": _pair(body.centre + complex(values["along"], values["normal"]))}
        )

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        (c, s), size = draw.direction, body_of(rig.mechanism, where).length or rig.length
        return Growth(lambda a: {"along": a * c * size, "normal": a * s * size}, 0.2)


class MomentOfInertia(Effect):
    """A moment of inertia (about the com) that differs from the model's."""

    name = "moment_of_inertia"
    place = "body"
    limited = True
    label = "an error in the moment of inertia of the {}"
    meaning = "the moment of inertia of the {} is off"
    found = "the moment of inertia of the {} is {}"
    parameters = (
        Parameter("inertia_error", "kg.m^2", "inertia", more="larger than modelled", less="smaller than modelled"),
    )
    special_case_of = ("payload",)

    def places(self, rig: Rig) -> Sequence[str]:
        return bodies(rig)

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        body = body_of(rig.mechanism, where)
        return (1e-2 * (body.moment_of_inertia or body.mass * rig.length**2),)

    def lowest(self, rig: Rig, where: str, variant: float = 0.0) -> np.ndarray:
        return np.array([-body_of(rig.mechanism, where).moment_of_inertia])

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        body = body_of(mechanism, where)
        return mechanism.with_body(where, inertia=body.moment_of_inertia + values["inertia_error"])

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        body = body_of(rig.mechanism, where)
        own = body.moment_of_inertia or body.mass * (body.length or rig.length) ** 2
        return Growth(lambda a: {"inertia_error": a * draw.sign * own}, 3.0 if draw.sign > 0 else 0.8)


class BodyMass(Effect):
    """A body that is heavier or lighter throughout than the model's: its moment of inertia goes with its mass, and its
    centre of mass stays.  Of a single body that is the scale of all forces, which no motion tells, and a gain does.
    """

    name = "body_mass"
    place = "body"
    limited = True
    label = "an error in the mass of the {}"
    meaning = "the mass of the {} is off"
    found = "the {} is {}"
    hiding = Hiding(sets=None)
    parameters = (Parameter("mass_error", "kg", "mass", more="heavier than modelled", less="lighter than modelled"),)
    special_case_of = ("payload",)

    def places(self, rig: Rig) -> Sequence[str]:
        moving = rig.mechanism.bodies
        return [b.name for b in moving if b.mass] if len(moving) > 1 else []

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-2 * body_of(rig.mechanism, where).mass,)

    def lowest(self, rig: Rig, where: str, variant: float = 0.0) -> np.ndarray:
        return np.array([-body_of(rig.mechanism, where).mass])

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        body = body_of(mechanism, where)
        mass = body.mass + values["mass_error"]
        inertia = body.moment_of_inertia * mass / body.mass
        return mechanism.with_body(where, **_pinned(body) | {"mass": mass, "inertia": inertia})

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        mass = body_of(rig.mechanism, where).mass
        return Growth(lambda a: {"mass_error": a * draw.sign * mass}, 1.0 if draw.sign > 0 else 0.8)


def end_of(mechanism: Mechanism, body: Body) -> str:
    """The joint at which a link ends: the last of several, or its only one where no point is named after it; else
    empty.
    """
    joints = {j.name for j in mechanism.joints}
    *others, last = [point for point in body.points if point in joints] or [""]
    return last if others or last == "".join(list(body.points)[1:][-1:]) else ""


class LinkLength(EachRun):
    """A link that is longer or shorter: its last joint moves along its x axis; com, marker, other points and inertia
    stay.
    """

    name = "link_length"
    place = "body"
    limited = True
    label = "an error in the length of the {}"
    meaning = "the {} is longer or shorter than drawn"
    found = "the {} is {}"
    parameters = (Parameter("length_error", "m", "length", more="longer than drawn", less="shorter than drawn"),)
    special_case_of = ("pivot_position",)

    def places(self, rig: Rig) -> Sequence[str]:
        return [b.name for b in rig.mechanism.bodies if end_of(rig.mechanism, b)]

    def scale(self, rig: Rig, where: str) -> float:
        return 1e-5 * rig.length

    def least(self, rig: Rig, where: str) -> float:
        return -(body_of(rig.mechanism, where).length or rig.length) / 2  # half of it more is another link

    def highest(self, rig: Rig, where: str, variant: float = 0.0) -> np.ndarray:
        return -self.lowest(rig, where, variant)

    def sense(self, mechanism: Mechanism, where: str) -> int:
        body = body_of(mechanism, where)
        points = list(body.points)
        *others, last = (body.points[point][0] for point in points[: points.index(end_of(mechanism, body)) + 1])
        return 1 if not others or last >= sum(others) / len(others) else -1  # drawn backwards, its end moves towards it

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        body = body_of(mechanism, where)
        last = end_of(mechanism, body)
        x, y = body.points[last]
        return mechanism.with_body(
            where, **_pinned(body) | {"points": {**body.points, last: (x + values["length_error"], y)}}
        )

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        size = body_of(rig.mechanism, where).length or rig.length
        return Growth(lambda a: {"length_error": a * draw.sign * size}, 0.02)


class PivotPosition(Effect):
    """A ground point that sits elsewhere than thought; values are its displacement."""

    name = "pivot_position"
    place = "ground point"
    limited = True
    label = "a displaced ground pivot {}"
    meaning = "the ground pivot {} is not where it is thought to be"
    found = "the ground pivot {} sits {} from where it is drawn"
    parameters = (
        Parameter("x", "m", "length", more="to the right", less="to the left"),
        Parameter("y", "m", "length", more="up", less="down"),
    )

    def places(self, rig: Rig) -> Sequence[str]:
        used = {j.name for j in rig.mechanism.joints if GROUND in j.bodies}
        return [p for p in rig.mechanism.ground.points if p in used]

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-5 * rig.length, 1e-5 * rig.length)

    def lowest(self, rig: Rig, where: str, variant: float = 0.0) -> np.ndarray:
        return -self.highest(rig, where)

    def highest(self, rig: Rig, where: str, variant: float = 0.0) -> np.ndarray:
        return np.full(2, rig.length / 2)  # half of the longest link further is another rig

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        points = dict(mechanism.ground.points)
        points[where] = (points[where][0] + values["x"], points[where][1] + values["y"])
        return mechanism.replace(ground={"points": points})

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        c, s = draw.direction
        return Growth(lambda a: {"x": a * c * rig.length, "y": a * s * rig.length}, 0.02)


def bodies(rig: Rig) -> list[str]:
    """Names of the moving bodies."""
    return [b.name for b in rig.mechanism.bodies]


def body_of(mechanism: Mechanism, name: str) -> Body:
    """A moving body."""
    return mechanism.moving[name]


def _pair(z: complex) -> tuple[float, float]:
    return (z.real, z.imag)


def _pinned(body: Body) -> dict[str, object]:
    """What must stay when points or masses move: com, inertia and marker as they are now."""
    return {"com": _pair(body.centre), "inertia": body.moment_of_inertia, "marker": _pair(body.point("com"))}


EFFECTS: tuple[Effect, ...] = (
    Gravity(),
    Payload(),
    ComOffset(),
    MomentOfInertia(),
    BodyMass(),
    LinkLength(),
    PivotPosition(),
)

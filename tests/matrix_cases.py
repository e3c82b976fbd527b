"""Every field of a mechanism file, and a linkage on which it must matter: what tests/test_matrix.py asks of every
command.
"""

from __future__ import annotations

import copy
import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, get_args

from pydantic import BaseModel

from analytic.mechanism import Mechanism
from analytic.mechanism.parts import MechanismPart

FOUR_BAR = """
name = "matrix"
gravity = [0.0, -9.81]
[ground]
points = { A = [0.0, 0.0], D = [0.35, 0.02], P = [0.1, 0.4] }
[body.crank]
points = { A = [0.0, 0.0], B = [0.1, 0.0] }
mass = 0.5
com = [0.04, 0.01]
inertia = 1e-3
[body.coupler]
points = { B = [0.0, 0.0], C = [0.3, 0.0], P = [0.15, 0.06] }
mass = 0.6
com = [0.14, 0.02]
inertia = 6e-3
[body.rocker]
points = { D = [0.0, 0.0], C = [0.25, 0.0] }
mass = 0.7
com = [0.12, 0.0]
inertia = 5e-3
[joint]
A = { type = "revolute", bodies = ["ground", "crank"] }
B = { type = "revolute", bodies = ["crank", "coupler"] }
C = { type = "revolute", bodies = ["coupler", "rocker"], clearance = 1e-4 }
D = { type = "revolute", bodies = ["ground", "rocker"] }
[drive]
joint = "A"
speed = 4.0
[load.0]
body = "rocker"
point = "C"
force = [-150.0, -100.0]
torque = 2.0
[spring.0]
bodies = ["ground", "coupler"]
points = ["P", "P"]
stiffness = 200.0
length = 0.1
damping = 3.0
[assembly]
crank = 1.9
coupler = 0.504
rocker = 2.07
"""
SLIDER_CRANK = """
name = "matrix"
gravity = [0.0, -9.81]
[ground]
points = { A = [0.0, 0.0], S = [0.0, 0.02] }
[body]
crank = { points = { A = [0.0, 0.0], B = [0.1, 0.0] }, mass = 0.5, com = [0.04, 0.01], inertia = 1e-3 }
rod = { points = { B = [0.0, 0.0], C = [0.3, 0.0] }, mass = 0.6, inertia = 6e-3 }
block = { points = { S = [0.0, 0.0], C = [0.01, 0.0] }, mass = 0.7, com = [0.02, 0.01], inertia = 5e-3 }
[joint]
A = { type = "revolute", bodies = ["ground", "crank"] }
B = { type = "revolute", bodies = ["crank", "rod"] }
C = { type = "revolute", bodies = ["rod", "block"] }
S = { type = "prismatic", bodies = ["ground", "block"], axis = [1.0, 0.0], guide = [0.08, 0.04], clearance = 1e-4 }
[drive]
joint = "A"
speed = 4.0
[load.0]
body = "block"
force = [-150.0, -100.0]
[assembly]
crank = 1.9
rod = -0.25
block = 0.0
"""
TOLERANCED = (
    FOUR_BAR
    + """
[tolerances]
"body.crank.length" = { sd = 1e-5, group = "lot" }
"ground.points.D.x" = { limits = [0.3498, 0.3502], distribution = "triangular", group = "lot" }
"""
)
Edits = Mapping[str, Any]


@dataclass(frozen=True)
class Change:
    """A field that changes from ``before`` to ``after``, by the path of what is edited in ``base``; None leaves it
    out.  ``after`` may be (pattern, text) in place of that, for names that stand in many places.
    """

    after: Edits | tuple[str, str]
    before: Edits = field(default_factory=dict)
    base: str = FOUR_BAR

    def mechanisms(self, free: bool = False) -> tuple[Mechanism, Mechanism]:
        """The linkage before and after; let go where ``free``."""
        text, edits, speed = self.base, self.after, {"drive.speed": "free"} if free else {}
        if isinstance(edits, tuple):
            text, edits = re.sub(*edits, self.base), {}
        return mechanism(self.base, {**self.before, **speed}), mechanism(text, {**self.before, **edits, **speed})


def mechanism(text: str, edits: Edits) -> Mechanism:
    """The linkage of a text with parts by name, edited."""
    data = copy.deepcopy(tomllib.loads(text))
    for path, value in edits.items():
        *way, last = path.split(".")
        place = data
        for name in way:
            place = place.setdefault(name, {})
        if value is None:
            place.pop(last)
        else:
            place[last] = copy.deepcopy(value)
    for kind in ("body", "joint"):
        data[kind] = [{"name": name, **part} for name, part in data[kind].items()]
    data["sensor"] = [{"name": name, **part} for name, part in data.get("sensor", {}).items()]
    for kind in ("load", "spring", "stop"):
        data[kind] = list(data.get(kind, {}).values())
    return Mechanism(**data)


def fields(model: type[BaseModel] = Mechanism) -> set[str]:
    """Every field of every part of a mechanism file that is no part itself: ``Joint.damping``."""
    found = set()
    for name, about in model.model_fields.items():
        parts = list(_parts(about.annotation))
        found |= {field for part in parts for field in fields(part)}
        if not parts and not about.exclude:
            found.add(f"{model.__name__}.{name}")
    return found


def _parts(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, MechanismPart):
        yield annotation
    for inner in get_args(annotation):
        yield from _parts(inner)


BENDING = {
    f"body.{name}.{what}": value
    for name in ("crank", "coupler", "rocker")
    for what, value in (("section", [0.01, 0.01]), ("youngs_modulus", 2e11))
}
ROUGH = {"joint.C.friction": 0.2, "joint.C.pin_radius": 0.01}
STRIBECK = {"joint.D.friction_torque": 0.3, "joint.D.static_torque": 1.5, "joint.D.stribeck_speed": 2.0}
SPRUNG = {"joint.D.stiffness": 3.0}
YIELDING = {"joint.B.elasticity": {"translation": 1e7, "rotation": 1e4}}
RIPPLE = {"drive.ripple": {"amplitude": 0.05, "harmonic": 2, "phase": 0.0}}
COGGING = {"drive.stiffness": 2000.0, "drive.periodic_torque": {"amplitude": 0.5, "harmonic": 3, "phase": 0.0}}

STROKE = {"load.0.over": "crank_angle", "load.0.from": 0.0, "load.0.to": 6.28}
TABLED = {"load.0.over": "crank_angle", "load.0.table": [[0.0, 0.2], [6.0, 1.0]]}

LIMITED = {"stop.0.joint": "D", "stop.0.from": 2.5, "stop.0.to": 3.0, "stop.0.stiffness": 9.0, "stop.0.damping": 0.5}

CHIP = {"sensor.chip": {"kind": "accelerometer", "body": "coupler", "point": "com"}}
WIRE = {"sensor.wire": {"kind": "distance", "body": "rocker", "point": "C", "to": "ground.A"}}
GAUGE = {
    "body.rocker.section": [0.01, 0.01],
    "sensor.gauge": {"kind": "strain", "body": "rocker", "point": [0.1, 0.005], "youngs_modulus": 2e11},
}

LIGHT: Edits = {"load.0.force": [-1.5, -1.0], "load.0.torque": 0.02}  # of a linkage that is let go, and moves
CHANGES: dict[str, Change] = {
    "Mechanism.name": Change({"name": "another"}),
    "Mechanism.gravity": Change({"gravity": [3.0, -20.0]}),
    "Mechanism.assembly": Change({"assembly.coupler": -1.2, "assembly.rocker": -1.9}),
    "Mechanism.initial": Change({"initial": {"velocity_A": 6.0}}, {"drive.speed": "free", "joint.C.clearance": None}),
    "Ground.points": Change({"ground.points.D": [0.35, 0.06]}),
    "Body.name": Change((r"\brocker\b", "lever")),
    "Body.points": Change({"body.coupler.points.C": [0.31, 0.01]}),
    "Body.mass": Change({"body.coupler.mass": 1.6}),
    "Body.com": Change({"body.coupler.com": [0.2, -0.05]}),
    "Body.marker": Change(
        {"body.coupler.marker": [0.1, 0.1]}, {"load.0.body": "coupler", "load.0.point": "com", "load.0.torque": 0.0}
    ),
    "Body.section": Change(
        {"body.rocker.section": [1.5, 0.02]}, {"body.rocker.section": [0.02, 0.02], "body.rocker.inertia": None}
    ),
    "Body.inertia": Change({"body.rocker.inertia": 0.2}),
    "Body.youngs_modulus": Change({"body.coupler.youngs_modulus": 1e11}, BENDING),
    "Body.shear_modulus": Change({"body.coupler.shear_modulus": 1e9}, BENDING),
    "Joint.name": Change((r"\bC\b", "K")),
    "Joint.type": Change(
        {"joint.D.type": "prismatic", "joint.D.axis": [1.0, 0.0], "joint.D.angle": 2.07}, {"joint.C.clearance": None}
    ),
    "Joint.bodies": Change(
        {"joint.E.bodies": ["rocker", "link"], "assembly.link": 0.65, "assembly.tail": 1.5},
        {
            "joint.C.clearance": None,
            "body.coupler.points.E": [0.15, 0.1],
            "body.rocker.points.E": [0.2, -0.1],
            "ground.points.G": [0.7, 0.1],
            "body.link": {"points": {"E": [0.0, 0.0], "F": [0.5, 0.0]}, "mass": 0.3},
            "body.tail": {"points": {"G": [0.0, 0.0], "F": [0.45, 0.0]}, "mass": 0.3},
            "joint.E": {"type": "revolute", "bodies": ["coupler", "link"]},
            "joint.F": {"type": "revolute", "bodies": ["link", "tail"]},
            "joint.G": {"type": "revolute", "bodies": ["ground", "tail"]},
            "assembly.link": 0.51,
            "assembly.tail": 2.06,
        },
    ),
    "Joint.axis": Change({"joint.S.axis": [1.0, 0.2]}, {"joint.S.clearance": None}, SLIDER_CRANK),
    "Joint.angle": Change({"joint.S.angle": 0.3, "assembly.block": 0.3}, {"joint.S.clearance": None}, SLIDER_CRANK),
    "Joint.clearance": Change({"joint.C.clearance": 4e-4}),
    "Joint.fit": Change(
        {"joint.C.fit": "H11/c11"}, {"joint.C.fit": "H7/g6", "joint.C.pin_radius": 0.005, "joint.C.clearance": None}
    ),
    "Joint.guide": Change({"joint.S.guide": [0.16, 0.04]}, {"load.0.torque": 20.0}, SLIDER_CRANK),
    "Joint.pin_radius": Change({"joint.C.pin_radius": 0.03}, ROUGH),
    "Joint.friction": Change({"joint.C.friction": 0.4}, ROUGH),
    "Joint.contact_stiffness": Change({"joint.C.contact_stiffness": 3e7}, {"joint.C.contact_stiffness": 1e8}),
    "Joint.contact_damping": Change({"joint.C.contact_damping": 500.0}, {"joint.C.contact_damping": 2000.0}),
    "Joint.restitution": Change({"joint.C.restitution": 0.9}, {"joint.C.restitution": 0.3, "drive.speed": 16.0}),
    "Joint.contact_law": Change({"joint.C.contact_law": "flores"}, {"joint.C.contact_law": "hunt-crossley"}),
    "Joint.friction_torque": Change({"joint.D.friction_torque": 0.8}),
    "Joint.static_torque": Change({"joint.D.static_torque": 2.5}, STRIBECK),
    "Joint.stribeck_speed": Change({"joint.D.stribeck_speed": 0.5}, STRIBECK),
    "Joint.friction_radius": Change({"joint.D.friction_radius": 0.02}),
    "Joint.damping": Change({"joint.D.damping": 3.0}),
    "Joint.drag": Change({"joint.D.drag": 3.0}),
    "Joint.stiffness": Change({"joint.D.stiffness": 9.0}, SPRUNG),
    "Joint.cubic": Change({"joint.D.cubic": 2.0}, SPRUNG),
    "Joint.rest_angle": Change({"joint.D.rest_angle": 0.7}, SPRUNG),
    "Joint.radial_stiffness": Change({"joint.B.radial_stiffness": 2e5}, {"joint.C.clearance": None}),
    "Elasticity.translation": Change({"joint.B.elasticity.translation": 2e6}, {**BENDING, **YIELDING}),
    "Elasticity.rotation": Change({"joint.B.elasticity.rotation": 2e3}, {**BENDING, **YIELDING}),
    "Drive.joint": Change(
        {"drive.joint": "D", "drive.speed": 2.0}, {"joint.C.clearance": None, "ground.points.D": [0.35, 0.02]}
    ),
    "Drive.speed": Change({"drive.speed": 6.0}),
    "Drive.stiffness": Change({"drive.stiffness": 2000.0}),
    "Drive.half_gap": Change({"drive.half_gap": 0.02}),
    "Ripple.amplitude": Change({"drive.ripple.amplitude": 0.1}, RIPPLE),
    "Ripple.harmonic": Change({"drive.ripple.harmonic": 3}, RIPPLE),
    "Ripple.phase": Change({"drive.ripple.phase": 1.0}, RIPPLE),
    "PeriodicTorque.amplitude": Change({"drive.periodic_torque.amplitude": 2.0}, COGGING),
    "PeriodicTorque.harmonic": Change({"drive.periodic_torque.harmonic": 5}, COGGING),
    "PeriodicTorque.phase": Change({"drive.periodic_torque.phase": 1.0}, COGGING),
    "Load.body": Change({"load.0.body": "coupler"}, {"load.0.point": "com"}),
    "Load.point": Change({"load.0.point": "com"}),
    "Load.force": Change({"load.0.force": [-100.0, -150.0]}),
    "Load.torque": Change({"load.0.torque": 5.0}),
    "Load.over": Change({"load.0.over": "coupler_angle"}, TABLED),
    "Load.start": Change({"load.0.from": 3.0}, STROKE),
    "Load.end": Change({"load.0.to": 1.0}, STROKE),
    "Load.opposes": Change({"load.0.opposes": True}, LIGHT),
    "Load.table": Change({"load.0.table": [[0.0, 0.5], [6.0, 1.2]]}, TABLED),
    "Spring.bodies": Change({"spring.0.bodies": ["ground", "rocker"], "spring.0.points": ["P", "C"]}),
    "Spring.points": Change({"spring.0.points": ["D", "P"]}),
    "Spring.stiffness": Change({"spring.0.stiffness": 500.0}),
    "Spring.length": Change({"spring.0.length": 0.3}),
    "Spring.damping": Change({"spring.0.damping": 30.0}),
    "Sensor.name": Change((r"\bchip\b", "board"), base=FOUR_BAR + '[sensor.chip]\nkind = "gyro"\nbody = "coupler"\n'),
    "Sensor.kind": Change({"sensor.wire.kind": "position", "sensor.wire.to": None}, WIRE),
    "Sensor.body": Change({"sensor.chip.body": "rocker"}, CHIP),
    "Sensor.point": Change({"sensor.wire.point": "D"}, WIRE),
    "Sensor.axis": Change({"sensor.chip.axis": [0.0, 1.0]}, CHIP),
    "Sensor.to": Change({"sensor.wire.to": "ground.P"}, WIRE),
    "Sensor.frame": Change({"sensor.chip.frame": "ground"}, CHIP),
    "Sensor.youngs_modulus": Change({"sensor.gauge.youngs_modulus": 1e11}, GAUGE),
    "Tolerance.sd": Change((r"sd = 1e-5", "sd = 3e-5"), base=TOLERANCED),
    "Tolerance.limits": Change((r"0.3502", "0.3504"), base=TOLERANCED),
    "Tolerance.distribution": Change((r"triangular", "uniform"), base=TOLERANCED),
    "Tolerance.group": Change((r"1e-5, group = .lot.", '1e-5, group = "other"'), base=TOLERANCED),
    "Stop.joint": Change({"stop.0.joint": "A"}, LIMITED),
    "Stop.start": Change({"stop.0.from": 2.8}, LIMITED),
    "Stop.end": Change({"stop.0.to": 1.5}, LIMITED | {"stop.0.from": 1.0, "stop.0.to": 1.7}),
    "Stop.stiffness": Change({"stop.0.stiffness": 20.0}, LIMITED),
    "Stop.damping": Change({"stop.0.damping": 3.0}, LIMITED),
}

SLACK = {"load.0.force": None, "load.0.torque": 0.0}
LIMP = {"spring.0.stiffness": 0.0, "spring.0.damping": None}
IDLE: dict[str, Change] = {  # by what they change: fields of parts that can do nothing
    "Load.body": Change({"load.0.body": "coupler"}, SLACK),
    "Load.point": Change({"load.0.point": "D"}, SLACK),
    "Spring.bodies": Change({"spring.0.bodies": ["ground", "rocker"], "spring.0.points": ["P", "C"]}, LIMP),
    "Spring.points": Change({"spring.0.points": ["D", "P"]}, LIMP),
    "Spring.length": Change({"spring.0.length": 0.3}, {"spring.0.stiffness": 0.0}),
    "Body.inertia": Change({"body.block.inertia": 5.0}, {"joint.S.clearance": None}, SLIDER_CRANK),
    "Body.section": Change(
        {"body.block.section": [0.5, 0.5]},
        {"joint.S.clearance": None, "body.block.inertia": None, "body.block.section": [0.01, 0.01]},
        SLIDER_CRANK,
    ),
    "PeriodicTorque.amplitude": Change(
        {"drive.periodic_torque.amplitude": 2.0}, {"drive.periodic_torque": COGGING["drive.periodic_torque"]}
    ),
}

"""The fields that a mechanism file may have, table by table: unit, default and meaning of each."""

from __future__ import annotations

import ast
import inspect
import io
import json
import re
import tokenize
from collections.abc import Mapping
from functools import cache

from pydantic.fields import FieldInfo

from analytic.mechanism import model, parts
from analytic.mechanism.parts import MechanismPart
from compare.faults import ArgumentError
from compare.questions.listing import TABLES, FieldsQuestion
from compare.questions.question import answers
from compare.results.catalogue import Fields, KnownField

PARTS: Mapping[str, type[MechanismPart]] = {
    "mechanism": model.Mechanism,
    "ground": parts.Ground,
    "body": parts.Body,
    "joint": parts.Joint,
    "elasticity": parts.Elasticity,
    "drive": parts.Drive,
    "ripple": parts.Ripple,
    "periodic_torque": parts.PeriodicTorque,
    "spring": parts.Spring,
    "stop": parts.Stop,
    "load": parts.Load,
    "sensor": parts.Sensor,
    "tolerance": parts.Tolerance,
}
MEANS = {
    ("Mechanism", "name"): "what reports call the linkage",
    ("Mechanism", "gravity"): "m/s²; left out: none",
    ("Mechanism", "ground"): "the fixed link, see below",
    ("Mechanism", "body"): "`[[body]]`, one for each moving link",
    ("Mechanism", "joint"): "`[[joint]]`, one for each joint",
    ("Mechanism", "drive"): "`[drive]`, the motor, or `[[drive]]`, several; left out: none",
    ("Mechanism", "spring"): "`[[spring]]`, any number",
    ("Mechanism", "stop"): "`[[stop]]`, any number",
    ("Mechanism", "load"): "`[[load]]`, any number",
    ("Mechanism", "sensor"): "`[[sensor]]`, any number; [what each reads](../how-to/sensors.md)",
    (
        "Mechanism",
        "assembly",
    ): "rad by body: roughly the angles at which the linkage is assembled; required of the driven body and of"
    " those that pick how loops close",
    (
        "Mechanism",
        "tolerances",
    ): '`[tolerances]`, by the field that varies from one made linkage to another, in quotes: `"body.crank.mass"`;'
    " [how](../how-to/tolerances-of-parts.md)",
    (
        "Mechanism",
        "initial",
    ): "`velocity_<joint>`, rad/s (prismatic: m/s), of joints that no motor moves: how fast the second body moves"
    " relative to the first when the linkage is let go; left out: at rest",
    ("Ground", "points"): "m by joint, ground frame",
    ("Body", "name"): "also the beginning of its signals' names",
    ("Body", "points"): "m by joint, body frame",
    ("Joint", "name"): "also the name of the point in both of its bodies",
    ("Joint", "type"): '`"revolute"` or `"prismatic"`',
    ("Joint", "bodies"): "the two bodies (or `ground`); the reaction is the force of the first on the second",
    (
        "Joint",
        "guide",
    ): "m, prismatic: length along the axis and height of the block, which is the second body's, about its"
    " point; the guide's walls are on the first body, farther out by the clearance",
    ("Joint", "restitution"): "share of its speed with which a pin leaves the wall, 0 to 1",
    ("Joint", "elasticity"): "Eq. 4, see below; left out: rigid",
    ("Elasticity", "translation"): "N/m along x, y and z",
    ("Elasticity", "rotation"): "N.m/rad about x and y",
    ("Drive", "joint"): "the joint that it moves; a single drive of a revolute joint on the ground turns a crank",
    (
        "Drive",
        "speed",
    ): 'rad/s (prismatic: m/s), constant; or `"free"` (released at the assembly angles) or `"measured"` (follows data).'
    " A crank's own angular velocity, whichever body its joint names first; of any other drive that of the joint's"
    " second body relative to its first",
    ("Drive", "half_gap"): "rad, backlash: the crank's play behind the motor, and as much ahead of it",
    ("Drive", "ripple"): "unevenness of the motor, see below",
    ("Drive", "periodic_torque"): "on the driven body over its angle, see below",
    ("PeriodicTorque", "amplitude"): "N.m",
    ("PeriodicTorque", "harmonic"): "how often in a turn",
    ("Ripple", "amplitude"): "rad",
    ("Ripple", "harmonic"): "how often in a turn",
    ("Spring", "bodies"): "the two bodies (or `ground`) that it joins",
    ("Spring", "points"): 'a point of each, or `"com"`: its marker',
    (
        "Stop",
        "joint",
    ): "whose travel it limits: the second body's position relative to the first, in the turns of the assembly",
    ("Stop", "from"): "rad (prismatic: m): below it the stop pushes",
    ("Stop", "to"): "rad (prismatic: m): above it the stop pushes",
    ("Sensor", "name"): "also the name of its signal",
    (
        "Sensor",
        "kind",
    ): "`position`, `velocity`, `accelerometer`, `gyro`, `distance`, `strain`, `force` or `torque`:"
    " [what each reads](../how-to/sensors.md)",
    ("Sensor", "body"): "the moving body that it is on",
    (
        "Sensor",
        "point",
    ): 'where on the body: a point of it, `"com"` (its marker), or `[x, y]` in m, body frame; of a force or a torque'
    " the joint",
    ("Sensor", "axis"): "along which it reads, of any length, in the frame of `frame`",
    ("Sensor", "to"): 'of a distance: the other end, `"<body>.<point>"`, such as `"ground.O"`',
    (
        "Sensor",
        "frame",
    ): "`ground` or a body, in whose frame the axis is; left out: the sensor's own body, of a position the ground",
    ("Sensor", "youngs_modulus"): "Pa, of the bar that a strain gauge is on; left out: the body's",
    ("Load", "body"): "where it acts",
    ("Load", "point"): 'a point of the body, or `"com"`: its marker',
    ("Load", "force"): "N, ground frame, fixed in direction",
    ("Load", "torque"): "N.m",
    (
        "Load",
        "over",
    ): "what it varies over: `crank_angle`, `<body>_angle`, `<body>_x`, `<body>_y`, `position_<joint>` or `time`",
    (
        "Load",
        "opposes",
    ): "whether only its size is its own: the force acts against the velocity of its point, the torque against the"
    " turning of its body, at rest against the drive's motion",
    ("Load", "from"): "rad, m or s, of what it varies over: from where on it acts",
    ("Load", "to"): "rad, m or s: up to where it acts",
    (
        "Load",
        "table",
    ): "pairs of value (rad, m or s) and factor of the load, straight lines between them; or a CSV file with columns of"
    " what it varies over and of `force_x`, `force_y` or `torque`, in place of the load's own",
}  # of fields beside which the code has no comment, or hardly one


ELSEWHERE = re.compile(r"[,;:] (see below|\[[^\]]+\]\(\S+\))")  # what a page of the docs leads on to


@answers(FieldsQuestion)
def fields(question: FieldsQuestion) -> Fields:
    """What a table of a mechanism file may hold, or all of them: unit and meaning of each field, and what stands for it
    where it is left out.

    Raises ArgumentError for a table that there is not.
    """
    if question.table is not None and question.table not in PARTS:
        raise ArgumentError("table", f"no table of a mechanism file; they are {', '.join(TABLES)}")
    chosen = TABLES if question.table is None else (question.table,)
    return Fields(fields=tuple(_plain(field) for table in chosen for field in of_table(table)))


def _plain(field: KnownField) -> KnownField:
    """A field described without Markdown, and without what a page of the docs leads on to."""
    return field.model_copy(update={"means": ELSEWHERE.sub("", field.means).replace("`", "")})


def of_table(table: str) -> list[KnownField]:
    """The fields of a table, in the order of its description."""
    part = PARTS[table]
    beside = comments(part)
    return [
        KnownField(
            table=table,
            name=field.alias or name,
            default=_default(field),
            means=MEANS.get((part.__name__, field.alias or name)) or field.description or beside[name],
        )
        for name, field in part.model_fields.items()
        if not field.exclude
    ]


def _default(field: FieldInfo) -> str:
    """What stands for a field where it is left out, as JSON; ``required`` of one that may not be, nothing of one
    without.
    """
    if field.is_required():
        return "required"
    value = field.get_default(call_default_factory=True)
    return "" if value is None or value in ((), {}, "") else json.dumps(value)


@cache
def comments(model: type) -> Mapping[str, str]:
    """The comment that stands beside each field of a class, by field."""
    source = inspect.cleandoc("\n" + inspect.getsource(model))
    said = {
        token.start[0]: token.string.lstrip("# ")
        for token in tokenize.generate_tokens(io.StringIO(source).readline)
        if token.type == tokenize.COMMENT
    }
    found = {}
    (node,) = ast.parse(source).body
    assert isinstance(node, ast.ClassDef)
    for line in node.body:
        if isinstance(line, ast.AnnAssign) and isinstance(line.target, ast.Name):
            beside = [said[n] for n in range(line.lineno, (line.end_lineno or line.lineno) + 1) if n in said]
            found[line.target.id] = " ".join(beside)
    return found

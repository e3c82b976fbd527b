"""What must hold between the parts of a mechanism, and what looks like a slip of units.

Each check raises ValueError with one sentence that names the part, the field, the value and the remedy.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from analytic.mechanism.parts import GROUND, SMALLEST_NUMBER, Body, Drive, Ground, Joint, Load, Sensor, Spring, Stop
from analytic.mechanism.signals import signals
from analytic.mechanism.varying import Quantity
from analytic.mechanism.written import INITIAL

LEAST_RESTITUTION = 0.01  # of a law with hysteresis, two of which divide by it, and of any in a map
MOSTLY = 1.0  # coefficients of friction are less
ROUGHEST = 5.0  # coefficient of friction at a block's corners: a larger one was meant in N
LARGEST_PLAUSIBLE_LENGTH = 20.0  # m; a linkage larger than this was probably entered in millimetres
TAKEN = ("time", "crank_angle")  # names of columns, which no sensor has
PartsByName = Mapping[str, Body | Ground]  # the ground and the moving bodies by name


def _listed(kind: str) -> str:
    return "'time' and 'crank_angle' are" if kind == "sensor" else "'ground' is"


class MechanismWarning(UserWarning):
    """Something in a mechanism is legal but looks like a mistake."""


def check_names(bodies: Sequence[Body], joints: Sequence[Joint], sensors: Sequence[Sensor] = ()) -> None:
    """Bodies and joints have names of their own, and so have their signals and sensors."""
    named = {"body": [GROUND, *(b.name for b in bodies)], "joint": [j.name for j in joints]}
    named["sensor"] = [*TAKEN, *(s.name for s in sensors)]
    for kind, names in named.items():
        twice = [n for n in names if names.count(n) > 1]
        if twice:
            raise ValueError(
                f"{kind} {twice[0]!r} is defined twice; give each {kind} its own name ({_listed(kind)} taken)"
            )
    if any(b.name == "world" for b in bodies):
        raise ValueError("body 'world' has a name that engines give to the ground; call it something else")
    taken: dict[str, str] = {}
    for signal in signals(bodies, joints, (), sensors):
        if signal.name in taken:
            raise ValueError(
                f"signal {signal.name} would be one of {taken[signal.name]} and of {signal.owner}; give one of them"
                " another name"
            )
        taken[signal.name] = signal.owner


def check_joint(joint: Joint, parts: PartsByName) -> None:
    """A joint connects two bodies that have a point for it, and its fields suit its type and its bodies' size."""
    where = f"joint {joint.name!r}: "
    for name in joint.bodies:
        if name not in parts:
            raise ValueError(f"{where}bodies names {name!r}; the bodies are {', '.join(parts)}")
        if joint.name not in parts[name].points:
            raise ValueError(
                f"{where}body {name!r} has no point {joint.name!r}; its points are {', '.join(parts[name].points)}"
            )
    if joint.bodies[0] == joint.bodies[1]:
        raise ValueError(f"{where}bodies are both {joint.bodies[0]!r}; a joint connects two bodies")
    if joint.prismatic:
        _check_prismatic(joint, where)
    elif joint.axis is not None or joint.angle or joint.guide is not None:
        raise ValueError(f"{where}axis, angle and guide belong to a prismatic joint; leave them out of a revolute one")
    _check_stribeck(joint, where)
    _check_contact_law(joint, where)
    for body in (parts[name] for name in joint.bodies):
        if isinstance(body, Body) and len(body.points) > 1 and 0 < body.length <= joint.clearance:
            raise ValueError(
                f"{where}clearance = {joint.clearance} m is not smaller than body {body.name!r} ({body.length:g} m);"
                f' give the radial clearance in m, or with its unit, such as "{joint.clearance:g} mm"'
            )


def _check_contact_law(joint: Joint, where: str) -> None:
    """Laws with hysteresis are given a restitution, by which some of them divide."""
    law = joint.contact_law
    if law is None or law == "kelvin-voigt":
        return
    if joint.contact_damping is not None:
        raise ValueError(
            f'{where}contact_damping = {joint.contact_damping:g} belongs to contact_law "kelvin-voigt"; give {law}'
            " a restitution in its place"
        )
    if joint.restitution is not None and joint.restitution < LEAST_RESTITUTION:
        raise ValueError(
            f"{where}restitution = {joint.restitution:g} is too small for contact_law {law!r}; give at least"
            f' {LEAST_RESTITUTION:g}, or "kelvin-voigt"'
        )


def _check_stribeck(joint: Joint, where: str) -> None:
    if (joint.static_torque is None) != (joint.stribeck_speed is None):
        given, missing = ("static_torque", "stribeck_speed")[:: 1 if joint.stribeck_speed is None else -1]
        raise ValueError(f"{where}{given} is given without {missing}; Stribeck's friction needs both, or neither")
    if joint.static_torque is not None and joint.static_torque < joint.coulomb:
        raise ValueError(
            f"{where}static_torque = {joint.static_torque:g} is less than the friction of fast slip,"
            f" {joint.coulomb:g}; it is the larger one"
        )


def _check_prismatic(joint: Joint, where: str) -> None:
    if joint.axis is None or abs(complex(*joint.axis)) == 0:
        was = "missing" if joint.axis is None else list(joint.axis)
        raise ValueError(f"{where}axis is {was}; a prismatic joint needs a direction [x, y] that is not zero")
    _check_guide(joint, where)
    if joint.radial_stiffness is not None:
        raise ValueError(
            f"{where}radial_stiffness is {joint.radial_stiffness}; only a revolute joint has one, leave it out"
        )
    if joint.friction_radius:
        raise ValueError(
            f"{where}friction_radius is {joint.friction_radius:g}; only a revolute joint has a pin that its reaction"
            " rubs, leave it out"
        )
    if joint.guide is not None and joint.friction > ROUGHEST:
        raise ValueError(
            f"{where}friction = {joint.friction:g} of a block with a guide is the coefficient at its corners, at most"
            f" {ROUGHEST:g}; give friction_torque (N) for a force along the guide"
        )
    if joint.friction and joint.friction_torque and joint.guide is None:
        raise ValueError(
            f"{where}friction and friction_torque are both given; for a prismatic joint without guide both mean N,"
            " keep one"
        )


def _check_guide(joint: Joint, where: str) -> None:
    """A block with clearance has a size, and cannot turn over in its guide."""
    if joint.guide is None:
        if joint.clearance:
            raise ValueError(
                f"{where}clearance = {joint.clearance:g} m of a prismatic joint needs the size of its block; give guide"
                " = [length, height] (m)"
            )
        return
    length, height = joint.guide
    if 2 * joint.clearance >= math.hypot(length, height) - height:
        raise ValueError(
            f"{where}a block of guide = [{length:g}, {height:g}] m turns over in its guide with clearance ="
            f" {joint.clearance:g} m; give half the play, or the block's size, in m"
        )


def check_drives(drives: Sequence[Drive], joints: Sequence[Joint]) -> None:
    """Each drive moves a joint of its own; what is a crank's alone is given to a crank."""
    if not drives and not any(GROUND in j.bodies for j in joints):
        raise ValueError("no joint connects a body to the ground; add one")
    for k, drive in enumerate(drives):
        where = "drive" if len(drives) == 1 else f"drive[{drive.joint}]"
        joint = next((j for j in joints if j.name == drive.joint), None)
        if joint is None:
            names = ", ".join(j.name for j in joints)
            raise ValueError(f"{where}.joint = {drive.joint!r} is not a joint; the joints are {names}")
        if any(other.joint == drive.joint for other in drives[:k]):
            raise ValueError(f"{where}.joint = {drive.joint!r} has two drives; a joint has one, leave one of them out")
        if drive.speed == 0 and len(drives) == 1:  # one of several may be held
            unit = "m/s" if joint.prismatic else "rad/s"
            raise ValueError(
                f"{where}.speed = 0; give the speed in {unit}, or 'free' (statics are compared in static motion)"
            )
        if len(drives) > 1 or joint.prismatic or GROUND not in joint.bodies:
            _check_plain(drive, where)


def _check_plain(drive: Drive, where: str) -> None:
    """What only the drive of a crank has."""
    for field, value in (
        ("ripple", drive.ripple), ("stiffness", drive.stiffness), ("half_gap", drive.half_gap or None),
        ("periodic_torque", drive.periodic_torque),
    ):  # fmt: skip
        if value is not None:
            raise ValueError(
                f"{where}.{field} is given, and only a single drive that turns a crank on the ground has one; leave it"
                " out"
            )


def check_initial(initial: Iterable[str], joints: Sequence[Joint], motors: Sequence[Joint]) -> None:
    """Initial velocities are those of joints that no motor moves."""
    known, moved = {INITIAL + joint.name for joint in joints}, {INITIAL + joint.name for joint in motors}
    for name in initial:
        if name not in known:
            raise ValueError(f"initial.{name} is no velocity of a joint; give one of {', '.join(sorted(known))}")
        if name in moved:
            raise ValueError(
                f"initial.{name} is given, and a motor moves that joint; leave it out, or give that drive speed ="
                " 'free'"
            )


def check_loads(loads: Iterable[Load], bodies: Mapping[str, Body], quantities: Mapping[str, Quantity]) -> None:
    """Loads name moving bodies and points that exist, and vary over what there is."""
    for load in loads:
        body = bodies.get(load.body)
        if body is None:
            raise ValueError(f"load.body = {load.body!r} is not a moving body; the bodies are {', '.join(bodies)}")
        if load.point != "com" and load.point not in body.points:
            raise ValueError(
                f"load.point = {load.point!r} is not a point of {load.body!r}; use com, {', '.join(body.points)}"
            )
        if load.over and load.over not in quantities:
            raise ValueError(
                f"load.over = {load.over!r} is nothing that a load of this linkage varies over; they are"
                f" {', '.join(quantities)}"
            )
        if load.table and quantities[load.over].kind == "angle" and load.table[-1][0] - load.table[0][0] > 2 * math.pi:
            raise ValueError(f"load.table is longer than a turn of {load.over}; give what is the same in every turn")


def check_springs(springs: Iterable[Spring], parts: PartsByName, joints: Sequence[Joint]) -> None:
    """Springs join points that exist, of two different bodies, and not those that a pin holds together."""
    for spring in springs:
        for body, point in spring.ends:
            if body not in parts:
                raise ValueError(f"spring.bodies names {body!r}; the bodies are {', '.join(parts)}")
            if point != "com" and point not in parts[body].points:
                raise ValueError(
                    f"spring.points names {point!r}, no point of {body!r}; use {', '.join(parts[body].points)}"
                )
            if point == "com" and body == GROUND:
                raise ValueError("spring.points names 'com' of the ground, which has none; use one of its points")
        if spring.bodies[0] == spring.bodies[1]:
            raise ValueError(f"spring.bodies are both {spring.bodies[0]!r}; a spring joins two bodies")
        for joint in joints:
            if not joint.prismatic and {(body, joint.name) for body in joint.bodies} == set(spring.ends):
                raise ValueError(
                    f"spring.points are both at joint {joint.name!r}, where its force has no direction; give two points"
                    " that are apart"
                )


def check_stops(stops: Iterable[Stop], joints: Sequence[Joint]) -> None:
    """Stops are those of joints that exist."""
    names = [joint.name for joint in joints]
    for stop in stops:
        if stop.joint not in names:
            raise ValueError(f"stop.joint = {stop.joint!r} is not a joint; the joints are {', '.join(names)}")


def check_assembly(assembly: Iterable[str], bodies: Iterable[str], driven: str | None) -> None:
    """Assembly angles are those of moving bodies, the driven one among them, where there is a crank."""
    moving, given = list(bodies), list(assembly)
    for name in given:
        if name not in moving:
            raise ValueError(f"assembly.{name} is not a moving body; the bodies are {', '.join(moving)}")
    if driven is not None and driven not in given:
        raise ValueError(
            f"assembly.{driven} is missing; give the driven body's angle (rad) at which the linkage is assembled, and"
            " about the angles of the others there"
        )


def check_body(body: Body, joints: Iterable[Joint]) -> None:
    """A body sits in joints, and has length where it turns between them."""
    if not body.points:
        raise ValueError(f"body {body.name!r} has no points; name one after each joint that it sits in")
    seats = [j for j in joints if body.name in j.bodies]
    if not seats:
        raise ValueError(f"body {body.name!r} sits in no joint; add one or leave the body out")
    pins = [body.point(j.name) for j in seats if not j.prismatic]
    if len(pins) > 1 and all(abs(p - pins[0]) < SMALLEST_NUMBER for p in pins):
        raise ValueError(
            f"body {body.name!r} has no length: all of its revolute joints sit at {pins[0].real, pins[0].imag};"
            " move one"
        )


def doubts(
    mechanism: str,
    parts: PartsByName,
    joints: Sequence[Joint],
    assembly: Mapping[str, float],
    loads: Iterable[Load],
    load_quantities: Mapping[str, Quantity],
) -> list[str]:
    """What to ask about lengths (m) that no linkage has, about assembly angles and angles (rad) at which loads begin
    and end that are several turns, and about forces that look like coefficients; ``mechanism`` is its name.
    """
    lengths = [(f"{b.name}.points.{n}", abs(complex(*p))) for b in parts.values() for n, p in b.points.items()]
    lengths += [(f"{b.name}.section", max(b.section)) for b in parts.values() if isinstance(b, Body)]
    lengths += [(f"{j.name}.guide", max(j.guide)) for j in joints if j.guide is not None]
    name, largest = max(lengths, key=lambda item: item[1])
    asked = []
    if largest > LARGEST_PLAUSIBLE_LENGTH:
        asked.append(f"{mechanism}: {name} is {largest:g} m; lengths are in metres, was it meant in millimetres?")
    angles = [(f"assembly.{body}", angle) for body, angle in assembly.items()]
    for load in (load for load in loads if load.over and load_quantities[load.over].unit == "rad"):
        ends = [("from", load.start), ("to", load.end), *(("table", x) for x, _ in load.table[-1:])]
        angles += [(f"{end} of the load on {load.body}", x) for end, x in ends if x is not None]
    turned = next(((place, angle) for place, angle in angles if abs(angle) > 4 * math.pi), None)
    if turned is not None:
        place, angle = turned
        where = f"{mechanism}: {place} is {angle:g} rad"
        asked.append(f'{where}; angles are in radians, was it meant in degrees? Write "{angle:g} deg"')
    for joint in joints:
        if joint.prismatic and joint.guide is None and 0 < joint.friction <= MOSTLY:
            asked.append(
                f"{mechanism}: friction of joint {joint.name!r} is a force of {joint.friction:g} N, as it has no guide;"
                f" was a coefficient meant? Give its block a guide, or write friction_torque = {joint.friction:g}"
            )
    return asked


def check_sensors(
    sensors: Iterable[Sensor], parts: PartsByName, joints: Sequence[Joint], drives: Sequence[Drive]
) -> None:
    """Sensors sit at places that exist, on moving bodies, and there is something there for them to read."""
    for sensor in sensors:
        where, body = f"sensor {sensor.name!r}: ", parts.get(sensor.body)
        moving = ", ".join(name for name in parts if name != GROUND)
        if not isinstance(body, Body):
            raise ValueError(f"{where}body = {sensor.body!r} is no moving body; they are {moving}")
        if sensor.frame is not None and sensor.frame not in parts:
            raise ValueError(f"{where}frame = {sensor.frame!r} is no body; the bodies are {', '.join(parts)}")
        if isinstance(sensor.point, str):
            _check_point(f"{where}point", body, sensor.point)
        if sensor.to is not None:
            name, point = sensor.far_end
            if name not in parts or name == sensor.body:
                others = ", ".join(other for other in parts if other != sensor.body)
                raise ValueError(f"{where}to = {sensor.to!r} is no point of another body; they are {others}")
            _check_point(f"{where}to", parts[name], point)
        if sensor.kind in ("force", "torque"):
            _check_in_joint(sensor, where, joints, drives)
        if sensor.kind == "strain":
            _check_gauge(sensor, body, where)


def _check_point(where: str, body: Body | Ground, point: str) -> None:
    if point not in body.points and (point != "com" or body.name == GROUND):
        raise ValueError(f"{where} names {point!r}, no point of {body.name!r}; use {', '.join(body.points)}")


def _check_in_joint(sensor: Sensor, where: str, joints: Sequence[Joint], drives: Sequence[Drive]) -> None:
    here = {joint.name: joint for joint in joints if sensor.body in joint.bodies}
    if sensor.joint not in here:
        raise ValueError(
            f"{where}point = {sensor.joint!r} is no joint of {sensor.body!r}; its joints are {', '.join(here)}"
        )
    passes = here[sensor.joint].prismatic or sensor.joint in [drive.joint for drive in drives]
    if sensor.kind == "torque" and not passes:
        raise ValueError(
            f"{where}joint {sensor.joint!r} is a pin without a motor and passes no torque; give a driven joint or a"
            " prismatic one"
        )


def _check_gauge(sensor: Sensor, body: Body, where: str) -> None:
    for field, given, remedy in (
        ("youngs_modulus", sensor.modulus(body), "in Pa, there or to the sensor"),
        ("section", all(body.section), "= [height, depth] in m"),
    ):
        if not given:
            raise ValueError(f"{where}its strain needs the {field} of body {body.name!r}; give it {remedy}")
    spot, along = sensor.at(body), [x for x, _ in body.points.values()]
    if not min(along) < spot.real < max(along):
        raise ValueError(
            f"{where}point lies at x = {spot.real:g} m, and the bar {body.name!r} is from {min(along):g} to"
            f" {max(along):g} m along its x axis; give a place between its ends"
        )
    if abs(spot.imag) > body.section[0] / 2:
        raise ValueError(
            f"{where}point lies at y = {spot.imag:g} m, outside the section of {body.name!r}; a gauge on its face is at"
            f" {body.section[0] / 2:g} m or at {-body.section[0] / 2:g} m"
        )

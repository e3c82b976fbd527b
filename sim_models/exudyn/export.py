"""A request as files that run in Exudyn without this project: model.json, run.py, and what we got, expected.csv."""

from __future__ import annotations

import cmath
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from analytic.mechanism import MASS_CENTRE, Body, Joint
from analytic.mechanism.signals import driving
from sim_models.common.export_files import expected, head, lines, stops, varies, written
from sim_models.common.mobility import stop_step
from sim_models.common.simulate import simulate
from sim_models.engine import Engine, Request, Trace
from sim_models.exudyn.equilibria import ExudynEquilibria
from sim_models.exudyn.linkage import HALVED, ExudynLinkage
from sim_models.exudyn.motor import INSTANT, RunMotor
from sim_models.exudyn.runs import ExudynRun

CONTACT = (
    "spheresRadii", "isHollowSphere1", "contactStiffness", "contactDamping", "impactModel", "restitutionCoefficient",
    "minimumImpactVelocity", "dynamicFriction", "frictionProportionalZone",
)  # fmt: skip
PARAMETERS = {  # what closes a joint: the numbers that make it, by Exudyn's names
    "pin": (),
    "soft bearing": ("stiffness", "damping"),
    "massless link": ("distance",),
    "stiff rod": ("referenceLength", "stiffness"),
    "spring-damper": ("referenceLength", "stiffness", "damping"),
    "contact": CONTACT,
}


def write(engine: Engine, request: Request, folder: Path) -> list[Path]:
    """Run a request as its engine does, in units of the linkage's own and steps that make it plausible, and write what
    repeats it into an existing folder.  Raises what :func:`sim_models.common.simulate.simulate` does, and OSError.
    """
    model: dict[str, Any] = {}
    crank = None if request.schedule.crank is None else request.mechanism.driven

    def run(asked: Request) -> Trace:
        finished = ExudynRun(asked)
        trace = finished.trace()
        linkage, motion = (_at_rest if asked.motion == "static" else _moving)(finished)
        model.update({"redundant": linkage.model.redundant, **_parts(linkage), **motion})
        return trace

    trace = simulate(engine, request, run)  # the last that was run
    files = {
        "model.json": lines({**head(request, trace), "crank": crank, **model}),
        "expected.csv": expected(trace, request),
    }
    return written(folder, files, "exudyn_run.py")


def _moving(run: ExudynRun) -> tuple[ExudynLinkage, dict[str, Any]]:
    """The linkage of a run in time; its stages (begin and end, s, steps, 0 where it settles in one, and whether they
    start with the accelerations of the one before), after which of them it is read (0: at the start), and the run's
    time (s) when the request's begins.
    """
    first = 0.0 if run.begins else INSTANT  # a report until then is of the start
    reports = run.clock(np.sort(run.request.schedule.time))
    after = np.searchsorted([end for _, end, *_ in run.stages], reports) + 1
    plan = {
        "drive": _crank_drive(run.linkage, run.crank),
        "drives": _own_drives(run.linkage, [*(run.drives or {}).values()]),
        "halved": HALVED,
        "residual": run.linkage.residual,
        "time_0": float(run.clock(np.zeros(1))[0]),
        "stages": run.stages,
        "after_stage": np.where(reports > first, after, 0).tolist(),
    }
    return run.linkage, plan


def _at_rest(run: ExudynRun) -> tuple[ExudynLinkage, dict[str, Any]]:
    """The linkage at rest, and where its bodies are held and put, and loaded with what besides the mechanism's loads,
    to find each equilibrium.
    """
    angles, equilibria, near = run.request.schedule.crank_angle, ExudynEquilibria(run.request, run.path), []
    for place in np.sort(run.request.schedule.time).tolist() if angles is None else angles.tolist():
        at = equilibria.crank(place)
        equilibria.at(at)
        link, initial = equilibria.real, equilibria.real.exu.ConfigurationType.Initial
        near.append(
            {
                **({"time": at, "held": dict(link.model.held)} if angles is None else {"crank_angle": at}),
                "bodies": np.array(link.mbs.systemData.GetODE2Coordinates(initial)).tolist(),
                "remembered": np.array(link.mbs.systemData.GetDataCoordinates(initial)).tolist(),
                "loads": list(link.body_loads().values()),
                "heading": _heading(link),
                "slides": {
                    j.name: link.item(f"law {j.name}")["force"] for j in link.m.joints if j.prismatic and j.has_law
                },
            }
        )
    link = equilibria.real
    drive = {"offset": link.item("drive")["offset"]} if angles is not None else None
    return link, {
        "drive": drive,
        "drives": _own_drives(link),
        "residual": link.residual,
        "time_0": 0.0,
        "equilibria": near,
    }


def _parts(link: ExudynLinkage) -> dict[str, Any]:
    """Everything that becomes an item of Exudyn's, in the order in which it is added."""
    m = link.m
    return {
        "let_go": m.displaced,
        "ground": {"points": {name: _pair(m.ground.point(name)) for name in m.ground.points}},
        "bodies": {body.name: _body(link, body) for body in m.bodies},
        "loads": [
            *(
                {"body": b.name, "point": MASS_CENTRE, "force": [b.mass * g for g in m.gravity], "torque": 0.0}
                for b in m.bodies
            ),
            *(
                {
                    "body": load.body,
                    "point": load.point,
                    "force": load.force,
                    "torque": load.torque,
                    "varies": varies(m, load, link.model.fades(load)) if load.varies else None,
                }
                for load in m.loads
            ),
        ],
        "joints": {joint.name: _joint(link, joint) for joint in m.joints},
        "springs": [
            {
                "ends": spring.ends,
                "length": spring.length,
                "stiffness": spring.stiffness,
                "damping": spring.damping if link.model.motion == "driven" else 0.0,  # at rest it is a load
            }
            for spring in m.springs
        ],
        "periodic_torque": m.periodic_torque and {"body": m.driven, **m.periodic_torque.model_dump()},
    }


def _heading(link: ExudynLinkage) -> dict[str, list[float]]:
    """Velocity of each body's centre of mass and its angular velocity, in the motion that loads oppose at rest."""
    centres = {
        name: pose.velocity + 1j * pose.angular_velocity * link.m.moving[name].centre * cmath.exp(1j * pose.angle)
        for name, pose in link.model.heading.items()
    }
    return {name: [*_pair(v), link.model.heading[name].angular_velocity] for name, v in centres.items()}


def _body(link: ExudynLinkage, body: Body) -> dict[str, Any]:
    node, centre = link.item(f"Coordinates {body.name}"), body.centre
    return {
        "mass": body.mass,
        "inertia": body.moment_of_inertia,
        "start": node["initialCoordinates"].tolist(),
        "rates": node["initialVelocities"].tolist(),
        "points": {name: _pair(body.point(name) - centre) for name in (*body.points, "com", MASS_CENTRE)},
    }


def _joint(link: ExudynLinkage, joint: Joint) -> dict[str, Any]:
    how = _closed_by(link, joint)
    part: dict[str, Any] = {"bodies": joint.bodies, "closed_by": how}
    if joint.prismatic:
        part |= {"direction": cmath.phase(joint.direction), "angle": joint.angle}
    else:
        item = link.item(f"force {joint.name}")
        every: Mapping[str, object] = item
        part["item"] = f"Object{item['objectType']}"
        part["parameters"] = {name: np.asarray(every[name]).tolist() for name in PARAMETERS[how]}
        if how == "contact":
            part["remembered"] = link.mbs.GetNode(item["nodeNumber"])["initialCoordinates"].tolist()
    if joint.has_law:
        moving = link.model.motion == "driven"  # at rest, friction and damping are loads
        law = {"stiffness": joint.stiffness, "offset": joint.rest_angle, "damping": joint.damping if moving else 0.0}
        friction, falls = (joint.coulomb, joint.stribeck_speed) if moving else (0.0, None)
        creep = link.model.creep * (link.model.size if joint.prismatic else 1.0)
        part["law"] = law
        set_in = 2 * stop_step(link.m) if joint.stops else 0.0  # s
        curved = joint.cubic or joint.stops or falls or (moving and joint.drag)
        if curved or (joint.prismatic and friction):
            part["curved"] = {
                "cubic": joint.cubic,
                "drag": joint.drag if moving else 0.0,
                "friction": friction,
                "static": joint.stiction if falls else friction,
                "stribeck_speed": falls or 0.0,
                "creep": creep,
                "stops": [[*where, damping if moving else 0.0, set_in] for *where, damping in stops(joint)],
            }
        elif not joint.prismatic:
            part["law"] |= {"dynamicFrictionForce": friction, "frictionProportionalZone": creep if friction else 0.0}
    return part


def _closed_by(link: ExudynLinkage, joint: Joint) -> str:
    if joint.prismatic:
        return "slide"
    if joint.name in link.model.bearings:
        return "soft bearing"
    if joint.name not in link.model.clearance:
        return "pin"
    if link.model.joint_model == "massless-link":
        return "massless link" if link.model.motion == "driven" else "stiff rod"
    return link.model.joint_model


def _crank_drive(link: ExudynLinkage, motor: RunMotor | None) -> dict[str, Any] | None:
    """A crank's motor, or None without one: its speed (rad/s) or its course, and if a spring is behind it the shaft's
    angle (rad) and speed at the start.
    """
    if motor is None:
        return None
    moves = {"offset": float(motor.rate(0.0))} if motor.steady else {"course": _course(motor)}
    if not link.model.compliant:
        return moves
    item = link.item("drive")
    shaft = link.mbs.GetNode(link.mbs.GetMarker(item["markerNumbers"][1])["nodeNumber"])
    start = [float(shaft["initialCoordinates"][0]), float(shaft["initialVelocities"][0])]
    return {**moves, "shaft": start, "stiffness": item["stiffness"]}


def _own_drives(link: ExudynLinkage, motors: Sequence[RunMotor] = ()) -> dict[str, Any]:
    """The motors between the two bodies of a joint, by joint: how what it gives is called, and its course; none at
    rest.
    """
    joints = [link.m.joint(name) for name in link.model.drives or ()]
    named = zip(joints, driving(joints), strict=False)  # without joints there is a signal all the same
    drives: dict[str, Any] = {
        joint.name: {"signal": signal.name, "sign": link.m.crank_sign, "course": None} for joint, signal in named
    }
    for drive, motor in zip(drives.values(), motors, strict=False):
        drive["course"] = _course(motor)
    return drives


def _course(motor: RunMotor) -> dict[str, Any]:
    """Position (rad, m) over the run's time (s): from each of the times on a cubic in what has passed since, highest
    power first.
    """
    return {"times": motor.path.x.tolist(), "cubics": motor.path.c.T.tolist()}


def _pair(z: complex) -> list[float]:
    return [z.real, z.imag]

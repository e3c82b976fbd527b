"""A request as files that run in MuJoCo without this project: model.xml, start.json, run.py, and what we got,
expected.csv.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast
from xml.etree import ElementTree

import mujoco
import numpy as np

from analytic.kinematics.schedule import Course, DriveMotion
from analytic.mechanism import Joint, Mechanism
from analytic.mechanism.model import as_written
from sim_models.common.export_files import BEYOND, expected, head, lines, stops, varies, written
from sim_models.common.simulate import simulate
from sim_models.engine import Cause, Engine, Request, Trace
from sim_models.mujoco.equilibrium import MujocoEquilibria, rest
from sim_models.mujoco.mjcf import Setting
from sim_models.mujoco.model import MujocoLinkage, TreeDrive
from sim_models.mujoco.motor import SHORTEST_CUBIC_STEP
from sim_models.mujoco.runs import STATIC_STEP, MujocoRun
from sim_models.mujoco.state import contact_rows

CLOSED_BY = {"massless-link": "massless link", "spring-damper": "spring-damper", "contact": "contact"}


def write(engine: Engine, request: Request, folder: Path) -> list[Path]:
    """Run a request as its engine does, in units of the linkage's own and steps that make it plausible, and write what
    repeats it into an existing folder.  Units of time stay seconds: the model of a fast linkage of usual size is in SI,
    and others can read it.  Raises what :func:`sim_models.common.simulate.simulate` does, and OSError.
    """
    model: dict[str, str] = {}
    start: dict[str, Any] = {}

    def run(asked: Request) -> Trace:
        found = MujocoRun(asked)
        trace = found.trace()
        link, how = _equilibria(found) if asked.motion == "static" else _stages(found)
        model["text"] = text = model_text(link)
        model["beyond"] = _unwritten(asked.mechanism)
        beyond = _beyond_mjcf(link.model, mujoco.MjModel.from_xml_string(text))
        start.update({"after_compiling": beyond, **_meaning(link), "motors": _motors(found, link), **how})
        return trace

    trace = simulate(engine, request, run, seconds=True)  # the last that was run
    files = {
        "model.xml": _started(model["text"], start, model["beyond"]),
        "start.json": lines({**head(request, trace), **start}),
        "expected.csv": expected(trace, request),
    }
    return written(folder, files, "mujoco_run.py")


def model_text(link: MujocoLinkage) -> str:
    """The linkage as MJCF, with the numbers that it was given after compiling wherever MJCF has an attribute
    for them.
    """
    m = link.model
    root = ElementTree.fromstring(link.description.mjcf())
    for bar in root.iterfind("equality/tendon"):
        bar.set("polycoef", _numbers(m.eq_data[m.equality(bar.get("name")).id, :5]))
    for pin in root.iterfind("equality/connect"):
        if pin.get("name") in link.soft:
            e = m.equality(pin.get("name")).id
            pin.set("solref", _numbers(m.eq_solref[e]))
            pin.set("solimp", _numbers(m.eq_solimp[e]))
    for cord in root.iterfind("tendon/spatial[@limited]"):
        t = m.tendon(cord.get("name")).id
        cord.set("solreflimit", _numbers(m.tendon_solref_lim[t]))
        cord.set("solimplimit", _numbers(m.tendon_solimp_lim[t]))
    for form in root.iterfind("tendon/fixed"):
        form.set("springlength", _numbers(m.tendon_lengthspring[m.tendon(form.get("name")).id]))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def _unwritten(m: Mechanism) -> str:
    """Loads that vary and stops, as a mechanism file has them, and the turns in which angles count, as JSON; nothing
    where there are none.
    """
    every = as_written(m)
    varying = [
        load for load, part in zip(cast("list[object]", every.get("load", [])), m.loads, strict=True) if part.varies
    ]
    parts = {"load": varying, "stop": every.get("stop", []), "assembly": every.get("assembly", {})}
    return json.dumps({name: part for name, part in parts.items() if part}) if varying or m.stops else ""


def _started(text: str, start: Mapping[str, Any], beyond: str) -> str:
    """The model with the state in which a run begins as its keyframe, which also says how fast the motor turns, and
    with what is beyond MJCF as a text, which :mod:`sim_models.mjcf.imported` reads.
    """
    root = ElementTree.fromstring(text)
    if beyond:
        ElementTree.SubElement(ElementTree.SubElement(root, "custom"), "text", {"name": BEYOND, "data": beyond})
    if "qpos" in start:
        state = {name: _numbers(np.array(start[name])) for name in ("time", "qpos", "qvel")}
        ElementTree.SubElement(ElementTree.SubElement(root, "keyframe"), "key", {"name": "start", **state})
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def _numbers(values: np.ndarray) -> str:
    return " ".join(repr(float(v)) for v in values.flat)


def _beyond_mjcf(ours: mujoco.MjModel, compiled: mujoco.MjModel) -> dict[str, Any]:
    """Every array of our model that the MJCF alone does not compile to."""
    fields = [name for name in dir(ours) if isinstance(getattr(ours, name), np.ndarray)]
    return {
        name: getattr(ours, name).tolist()
        for name in fields
        if not np.array_equal(getattr(ours, name), getattr(compiled, name))
    }


def _meaning(link: MujocoLinkage) -> dict[str, Any]:
    """What the names in the model stand for."""
    return {
        "half_step": link.setting.stepped,
        "shortest": SHORTEST_CUBIC_STEP * link.setting.step,
        "efforts": link.efforts,
        "told_by": _told_by(link),
        "bodies": {
            b.body.name: {
                "parent": b.parent,
                "joint": b.joint.name if b.joint else None,
                "hinges": list(link.description.forms[b.body.name]),
                "fixed_angle": link.fixed_angle[b.body.name],
                "drive": _drive(link.drives.get(b.body.name)),
            }
            for b in link.description.branches
        },
        "joints": {
            j.name: {
                "bodies": j.bodies,
                "slides": j.prismatic,
                "clearance": link.radii[j.name][0] if j.name in link.radii else 0.0,
                "closed_by": _closed_by(link, j),
            }
            for j in link.mechanism.joints
        },
        "curved_laws": {
            f"law:{joint.name}": {
                "form": form.tolist(),
                "cubic": joint.cubic,
                "drag": joint.drag,
                "rest": joint.rest_angle,
                "stops": stops(joint),
                "friction": [joint.coulomb, joint.stiction, joint.stribeck_speed] if joint.stribeck_speed else None,
            }
            for joint, form in (link.passive.joints.values() if link.passive else ())
        },
        "springs": {f"spring:{i}": spring.bodies for i, spring in enumerate(link.mechanism.springs)},
        "periodic_torque": _periodic(link),
        "varying_loads": {
            f"load{i}": {"force": load.force, "torque": load.torque, **varies(link.mechanism, load, fades)}
            for i, (load, fades) in enumerate(zip(link.mechanism.loads, link.fades, strict=True))
            if load.varies
        },
        "contacts": {
            name: {
                "clearance": link.radii[name][0],
                "bearing_radius": link.radii[name][1],
                "margin": link.contacts[name].margin,
                "friction": float(rim.contact.friction[0]),
                "hard": bool(rim.law.hard),
                "soft": [rim.law.stiffness, rim.law.damping, rim.weight] if rim.second_order else None,
                "solref": rim.contact.solref.tolist(),
                "solreffriction": rim.contact.solreffriction.tolist(),
                "solimp": rim.contact.solimp.tolist(),
            }
            for name, rim in link.rims.items()
        },
    }


def _drive(drive: TreeDrive | None) -> dict[str, Any] | None:
    """What a motor between a body and its parent gives its joint: the signal, its sign, and the axis of a slide."""
    if drive is None:
        return None
    axis = drive.joint.direction if drive.joint.prismatic else 0j
    return {
        "signal": drive.signal,
        "joint": drive.joint.name,
        "sign": drive.sign,
        "slides": drive.joint.prismatic,
        "first": drive.joint.bodies[0],
        "axis": [axis.real, axis.imag],
    }


def _motors(run: MujocoRun, link: MujocoLinkage) -> list[dict[str, Any]]:
    """The coordinate of each motor, and its course: knots (s) and cubics, highest power first, from each knot on."""
    schedule = run.request.schedule
    courses: list[DriveMotion | None] = [None] * len(link.motors)
    if not schedule.at_rest:
        courses = [run.request.motor] * len(link.motors) if schedule.crank else [*schedule.courses.values()]
    return [
        {"coordinate": link.names[motor], "course": _course(course, way)}
        for motor, way, course in zip(link.motors, link.ways.tolist(), courses, strict=True)
    ]


def _course(motor: DriveMotion | None, way: float) -> dict[str, Any] | None:
    if not isinstance(motor, Course):
        return None
    return {"times": motor.knots.tolist(), "cubics": (way * motor.spline.c.T).tolist()}


def _told_by(link: MujocoLinkage) -> str | None:
    """The coordinate that says where a crank's linkage is: the motor's; of one on a course the crank's."""
    if link.setting.driven is not None:
        return None
    turns_evenly = link.description.compliant and not link.setting.follows
    return "drive:motor" if turns_evenly else link.mechanism.driven


def _periodic(link: MujocoLinkage) -> dict[str, Any] | None:
    """A torque over the angle of the driven body: that angle is ``angle`` plus ``form`` times the coordinates."""
    wave = link.mechanism.periodic_torque
    if wave is None or link.passive is None:
        return None
    return {
        **wave.model_dump(),
        "body": link.mechanism.driven,
        "angle": link.passive.angle,
        "form": link.passive.form.tolist(),
    }


def _pair(z: complex) -> list[float]:
    return [z.real, z.imag]


def _closed_by(link: MujocoLinkage, joint: Joint) -> str:
    if joint.name in link.contacts:
        return CLOSED_BY[link.setting.rows]
    if joint.name in link.soft:
        return "soft bearing"
    return "connect" if joint in link.description.closing else "tree"


def _stages(run: MujocoRun) -> tuple[MujocoLinkage, dict[str, Any]]:
    """The model of a run that steps, its start, and its steps."""
    record = run.record
    state = {"time": record.time, "qpos": record.q.tolist(), "qvel": record.v.tolist(), "qacc": record.a.tolist()}
    return record.link, {**state, "stages": record.stages}


def _equilibria(run: MujocoRun) -> tuple[MujocoLinkage, dict[str, Any]]:
    """The model of a run at rest, and each equilibrium: coordinates, and dry friction as it acts against the drive's
    direction; of several drives the time (s) as well.

    The model has no dry friction of its own, because a simulation at rest has none; what acts is handed over as forces.
    """
    angles = run.request.schedule.crank_angle
    places = np.sort(run.request.schedule.time).tolist() if angles is None else angles.tolist()
    near, pose = run.near(places[0]), run.path.poses(places[0])
    setting = Setting(run.request.joint_model, STATIC_STEP, friction=False, driven=run.path.driven)
    link = MujocoLinkage(run.mechanism, run.laws, pose, setting)
    for rim in link.rims.values():
        rim.contact.friction = np.zeros(5)
    return link, {"equilibria": [_state(near, at) | ({"time": at} if angles is None else {}) for at in places]}


def _state(near: MujocoEquilibria, theta: float) -> dict[str, Any]:
    """Coordinates of one equilibrium, and dry friction: as generalised forces, and as torque or share of the normal
    force by joint.
    """
    near.at_rest(theta)
    link, slip = near.pressed, near.slip(theta)
    still = np.zeros(link.model.nv)
    found = rest(
        link, link.data.qpos.copy(), still, still, slip
    )  # once more, from there: forces are taken from the position here
    if found is None:
        raise near.failed(
            Cause.NO_EQUILIBRIUM, "the equilibrium cannot be found a second time", theta, "use a smaller clearance"
        )
    dry = -sum((slip[joint.name] * joint.stiction * form for joint, form in link.rubbing), still)
    sliding = {name: -slip[name] * link.mechanism.joint(name).friction for name in link.rims}
    for name, row in contact_rows(link).items():
        if sliding[name]:
            dry += sliding[name] * found.force[row] * link.data.efc_J.reshape(-1, still.size)[row + 1]
    ways = {f"load{i}": load for i, load in enumerate(link.mechanism.loads) if load.opposes}
    return {
        "heading": {
            name: [*_pair(link.going(load.body, load.point)), link.spin(load.body)] for name, load in ways.items()
        },
        "qpos": found.q.tolist(),
        "dry_friction": dry.tolist(),
        "joint_friction": {j.name: -j.stiction * slip[j.name] for j in link.mechanism.joints if j.rubs},
        "sliding": {name: share for name, share in sliding.items() if share},
    }

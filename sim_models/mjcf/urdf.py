"""A URDF file as a MuJoCo model, by MuJoCo's own reader: with the loops that URDF itself has no word for.

Loops are closed as onshape-to-robot writes them: two links ``closing_<name>_1`` and ``closing_<name>_2``, each fixed to
one of the links of a pin, whose frames lie together.  Shapes are left out, so that no file is opened beside this one.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np

from analytic.mechanism.one_line import enumerated
from analytic.mechanism.reading import ReadingError, read_text
from sim_models.mjcf.errors import MjcfError

LARGEST_FILE = 2**24  # bytes
MOST_LINKS = 500
CLOSING = re.compile(r"closing_(.+)_([12])")
LEFT_OUT = ("visual", "collision", "mujoco", "gazebo", "transmission", "material", "sensor")
MOVING = ("revolute", "continuous", "prismatic")
# URDF says nothing of how it is to be simulated: steps that a loop of such a stiffness takes, and opens by micrometres
TIME_STEP = 2e-4  # s
SOLREF, SOLIMP = (4 * TIME_STEP, 1.0), (0.9999, 0.9999, 0.001, 0.5, 2.0)


def is_urdf(path: Path) -> bool:
    """Whether a file is URDF, by its name."""
    return path.suffix.lower() == ".urdf"


def spec_of(path: Path, notes: list[str]) -> mujoco.MjSpec:
    """MuJoCo's model of a URDF file before it is compiled; what is left out is added to the ``notes``.

    Raises MjcfError with the place and the next step.
    """
    robot = _robot(path)
    joints = {str(joint.get("name")): joint for joint in robot.findall("joint")}
    odd = next((name for name, joint in joints.items() if joint.get("type") not in (*MOVING, "fixed")), None)
    if odd is not None:
        kind = joints[odd].get("type")
        raise MjcfError(f"{path}: joint {odd!r} is {kind}; a planar linkage has {enumerated(MOVING)} ones")
    moving = {name: joint for name, joint in joints.items() if joint.get("type") in MOVING}
    mimics = {name: str(each.get("joint")) for name, joint in moving.items() for each in joint.findall("mimic")}
    loops = _loops(path, [str(link.get("name")) for link in robot.findall("link")])
    if mimics and not loops:
        raise MjcfError(f"{path}: {_mimicked(mimics)}, for which a mechanism file has no word; {_next_step(path)}")
    _check_masses(path, robot, moving)
    motors = dict.fromkeys(
        str(joint.get("name")) for each in robot.iter("transmission") for joint in each.iter("joint")
    )
    notes.append("shapes of the URDF file (visual, collision), and contacts with them: left out")
    notes += [f"{_mimicked(mimics)}: left out, as its loops move it"] if mimics else []
    limited = [name for name, joint in moving.items() for each in joint.findall("limit") if each.get("velocity")]
    notes += [f"limits of velocity in {enumerated(limited)}: left out"] if limited else []
    notes += [] if loops else [f"no loop is closed in it; {_next_step(path)}"]
    spec = _bare(path, robot)
    _close(spec, loops)
    for name in motors:
        if name in moving and name not in mimics:
            spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    return spec


def _bare(path: Path, robot: ElementTree.Element) -> mujoco.MjSpec:
    """MuJoCo's model of the links and joints alone.  Raises MjcfError."""
    for element in list(robot.iter()):
        for child in [each for each in element if each.tag in (*LEFT_OUT, "mimic")]:
            element.remove(child)
    try:
        spec = mujoco.MjSpec.from_string(ElementTree.tostring(robot, encoding="unicode"))
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        raise MjcfError(f"{path}: MuJoCo cannot read it ({' '.join(str(error).split())[:300]}); correct it") from None
    spec.compiler.fusestatic = 0  # what closes loops stays
    spec.option.timestep = TIME_STEP
    return spec


def _robot(path: Path) -> ElementTree.Element:
    """The robot of a file.  Raises MjcfError."""
    try:
        text = read_text(path, LARGEST_FILE)
        if "<!DOCTYPE" in text or "<!ENTITY" in text:
            raise MjcfError(f"{path}: has a <!DOCTYPE>, whose entities are not read; take it out")
        robot = ElementTree.fromstring(text)
    except ReadingError as error:
        raise MjcfError(f"{path}: {error}; give a URDF file") from None
    except ElementTree.ParseError as error:
        raise MjcfError(f"{path}: it is not XML ({error}); give a URDF file, as text") from None
    if robot.tag != "robot":
        raise MjcfError(
            f"{path}: its root is <{str(robot.tag)[:40]}>; a URDF file has <robot> there (a xacro makes one)"
        )
    if any("}" in str(element.tag) for element in robot.iter()):
        raise MjcfError(
            f"{path}: is a xacro, with macros in it; give what it makes: xacro robot.urdf.xacro > robot.urdf"
        )
    if len(robot.findall("link")) > MOST_LINKS:
        raise MjcfError(f"{path}: has {len(robot.findall('link'))} links; give the linkage alone, at most {MOST_LINKS}")
    return robot


def _loops(path: Path, links: list[str]) -> list[str]:
    """The names of the loops that pairs of links close.  Raises MjcfError for one without its partner."""
    ends: dict[str, set[str]] = {}
    for link in links:
        found = CLOSING.fullmatch(link)
        if found:
            ends.setdefault(found[1], set()).add(found[2])
    for name, of in ends.items():
        if len(of) < 2:
            has, lacks = (f"closing_{name}_{k}" for k in (*of, *({"1", "2"} - of)))
            raise MjcfError(f"{path}: has a link {has!r} and no {lacks!r}; a loop is closed by both, one in each link")
    return list(ends)


def _check_masses(path: Path, robot: ElementTree.Element, moving: Mapping[str, ElementTree.Element]) -> None:
    """Raise MjcfError for a link that moves and has no mass of its own: shapes are not asked."""
    massless = {link.get("name") for link in robot.findall("link") if link.find("inertial/mass") is None}
    children = [child.get("link") for joint in moving.values() for child in joint.findall("child")]
    bare = next((name for name in children if name in massless), None)
    if bare is not None:
        raise MjcfError(f"{path}: link {bare!r} moves and has no <inertial>; give it mass, origin and inertia")


def _close(spec: mujoco.MjSpec, loops: list[str]) -> None:
    """Close loops with a connect each, between sites where the closing links are."""
    for name in loops:
        sites = []
        for k in (1, 2):
            link = f"closing_{name}_{k}"
            spec.body(link).add_site(name=link)
            sites.append(link)
        equality = spec.add_equality(
            name=name, type=mujoco.mjtEq.mjEQ_CONNECT, objtype=mujoco.mjtObj.mjOBJ_SITE, name1=sites[0], name2=sites[1]
        )
        equality.solref, equality.solimp = np.array(SOLREF), np.array(SOLIMP)


def _mimicked(mimics: dict[str, str]) -> str:
    return enumerated([f"joint {name!r} mimics joint {of!r}" for name, of in mimics.items()])


def _next_step(path: Path) -> str:
    """What may close a loop that a URDF file has not."""
    beside = path.with_suffix(".xml")
    if beside.is_file() and "<mujoco" in beside.read_text(encoding="utf-8", errors="replace")[:LARGEST_FILE]:
        return f"if it has loops, the MJCF file beside it, {beside.name}, may have them: import that"
    return (
        "if it has loops, close each with two links closing_<name>_1 and closing_<name>_2, fixed where its pin is (as"
        " onshape-to-robot writes them), or import an MJCF file with connects"
    )

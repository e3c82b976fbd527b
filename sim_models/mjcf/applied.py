"""A mechanism's numbers written back into the MuJoCo model that it was imported from: nothing else in the file changes.

Lengths go to the ``pos`` of bodies, joints and sites, masses with their centres and inertias to ``inertial``, laws to
their joints.  The file is imported again, and what then has not the mechanism's number is said.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import NamedTemporaryFile
from xml.parsers import expat

import mujoco
import numpy as np

from analytic.mechanism import Mechanism
from analytic.mechanism.model import as_written
from analytic.mechanism.parts import Body
from sim_models.mjcf.errors import MjcfError
from sim_models.mjcf.imported import of_planar
from sim_models.mjcf.parts import PlanarPin
from sim_models.mjcf.planar import CONNECT, LOOP_CLOSED, SITE, Planar, positioned, read
from sim_models.mjcf.urdf import is_urdf
from sim_models.mjcf.xml_text import XmlText
from sim_models.mujoco.engine import no_log_file

SPREAD = ("include", "replicate", "frame", "attach")  # what has bodies in another place than their own
ORIENTED = ("quat", "axisangle", "xyaxes", "zaxis", "euler", "diaginertia", "fullinertia")  # of an inertial
SAME = 1e-9  # relative: numbers that are nearer are one
NOTHING = 1e-12  # m, kg ...: what is less is nothing
DIGITS = 15  # significant, of a number that is written
LAWS = {"damping": "damping", "friction_torque": "frictionloss", "stiffness": "stiffness"}  # of a joint, by field
Numbers = dict[str, float | str]
"""Fields of a mechanism by their dotted names."""


@dataclass(frozen=True)
class AppliedFile:
    """A model file's text with a mechanism's numbers: the fields that are ``written`` in it, each with its number
    before and after, and those ``left``, for which it has no word or place.
    """

    text: bytes
    written: dict[str, tuple[float | str | None, float | str]]
    left: dict[str, float | str]


def applied(mechanism: Mechanism, model: Path) -> AppliedFile:
    """A MuJoCo model with the numbers of a mechanism that was imported from it.  Raises MjcfError."""
    if is_urdf(model):
        raise MjcfError(f"{model}: is URDF, into which nothing is written back; give an MJCF file of the linkage")
    with no_log_file():
        planar = read(model)
        base = of_planar(planar).mechanism
        _check_same_linkage(base, mechanism, str(model))
        text = _Editor(planar, base, mechanism, model).text()
        again = _again(text, model)
    before, wanted, after = _numbers(base), _numbers(mechanism), _numbers(again)
    changed = {name: value for name, value in wanted.items() if not _same(value, before.get(name))}
    near = {name: LOOP_CLOSED * planar.size if ".points." in name else NOTHING for name in {**before, **wanted}}
    left = {name: value for name, value in changed.items() if not _same(value, after.get(name), near[name])}
    spoilt = [n for n, value in before.items() if n not in changed and not _same(value, after.get(n), near[n])]
    if spoilt:
        raise MjcfError(
            f"{model}: {', '.join(spoilt[:4])} would change with it, as the file says them together; write its inertial"
            " elements and the sites of its connects out, and try again"
        )
    written = {name: (before.get(name), value) for name, value in changed.items() if name not in left}
    return AppliedFile(text, written, left)


def _again(text: bytes, model: Path) -> Mechanism:
    """The mechanism of a changed file, read where the model lies, as it may name files beside it."""
    with NamedTemporaryFile(dir=model.parent, prefix=f".{model.stem}-", suffix=".xml") as draft:
        draft.write(text)
        draft.flush()
        try:
            return of_planar(read(Path(draft.name))).mechanism
        except MjcfError as error:
            why = str(error).removeprefix(f"{draft.name}: ")
            raise MjcfError(f"{model}: with these numbers it is no linkage that MuJoCo reads: {why}") from None


def _check_same_linkage(base: Mechanism, mechanism: Mechanism, said: str) -> None:
    """Raise MjcfError for a mechanism that has other bodies or joints than the file, by their names."""
    ours, theirs = ({j.name: j.bodies for j in m.joints} | {b: (b, b) for b in m.moving} for m in (mechanism, base))
    if ours != theirs:
        odd = next(name for name in {**ours, **theirs} if ours.get(name) != theirs.get(name))
        where = (
            "between other bodies"
            if odd in ours and odd in theirs
            else f"in {'one' if odd in ours else 'the file'} alone"
        )
        raise MjcfError(
            f"{said}: {odd!r} is {where}; apply a mechanism that was imported from this file, or explained from one"
        )


def _numbers(m: Mechanism) -> Numbers:
    """What a mechanism says of its motion, by dotted names: all but where it is assembled."""

    def leaves(name: str, value: object) -> Iterator[tuple[str, float | str]]:
        if isinstance(value, Mapping):
            for key, each in value.items():
                yield from leaves(f"{name}.{key}" if name else str(key), each)
        elif isinstance(value, list):
            named = [each.get("name") if isinstance(each, Mapping) else None for each in value]
            for k, each in enumerate(value):
                yield from leaves(f"{name}.{named[k] or ('xy'[k] if k < 2 and len(value) == 2 else k + 1)}", each)
        elif isinstance(value, bool | int | float | str):
            yield name, value

    fields = {key: value for key, value in as_written(m).items() if key not in ("name", "assembly", "initial", "drive")}
    fields["drive"] = {drive.joint: drive.model_dump(exclude_unset=True, mode="json") for drive in m.drives}
    return {name: value for name, value in leaves("", fields) if not name.endswith((".name", ".marker.x", ".marker.y"))}


def _same(one: float | str | None, other: float | str | None, near: float = NOTHING) -> bool:
    """Whether two numbers or words are one; of places MuJoCo itself takes what is near a frame for the frame."""
    if isinstance(one, str) or isinstance(other, str):
        return one == other
    return math.isclose(one or 0.0, other or 0.0, rel_tol=SAME, abs_tol=near)


class _Editor:
    def __init__(self, planar: Planar, base: Mechanism, wanted: Mechanism, path: Path) -> None:
        self.p, self.m, self.base, self.wanted = planar, planar.model, base, wanted
        self.raw = mujoco.MjSpec.from_file(str(path)).compile()  # without what actuators have, which ours counts in
        self.data = positioned(self.m, planar.pose)
        self.frames = planar.at(planar.pose)
        try:
            self.xml = XmlText(path.read_bytes())
        except expat.ExpatError as error:
            raise MjcfError(f"{path}: is no XML ({error}); correct it") from None
        spread = self.xml.named(*SPREAD)
        if spread:
            raise MjcfError(
                f"{path}: has <{self.xml.tags[spread[0]].name}>, so that its bodies are not written where they are;"
                " save the whole model from MuJoCo (mj_saveLastXML), and apply it to that"
            )
        worlds = self.xml.named("worldbody")
        self.bodies = [worlds[0] if worlds else -1] + [
            k for k in self.xml.named("body") if self.xml.lies_in(k, "worldbody")
        ]

    def text(self) -> bytes:
        """The file with the numbers."""
        moved = any(pin for pin in self.p.pins if self.shift(pin, 0) or self.shift(pin, 1))
        for pin in self.p.pins:
            if pin.joint >= 0:
                self.place(pin)
                self.laws(pin)
            elif moved and self.m.eq_type[pin.equality] == CONNECT:
                self.anchor(pin)
        for k in range(1, len(self.p.links)):
            self.inertia(k)
        return self.xml.changed()

    # ------------------------------------------------------------------ places

    def shift(self, pin: PlanarPin, end: int) -> complex:
        """How far (m, ground frame) a joint's point in its first or second link is moved."""
        name = self.p.links[pin.links[end]].name
        was, to = (m.body(name).point(pin.name) for m in (self.base, self.wanted))
        return (to - was) * cmath.exp(1j * self.frames.angles[pin.links[end]]) if abs(to - was) > NOTHING else 0j

    def world(self, z: complex) -> np.ndarray:
        """A vector (3,) of the plane in MuJoCo's world."""
        return np.asarray(z.real * self.p.plane.x + z.imag * self.p.plane.y)

    def within(self, body: int, vector: np.ndarray) -> np.ndarray:
        """A vector (3,) of the world in a body's frame."""
        return np.asarray(self.data.xmat[body].reshape(3, 3).T @ vector)

    def place(self, pin: PlanarPin) -> None:
        """Put a joint of the tree where it is to be in its parent, and in its child."""
        first, second = self.shift(pin, 0), self.shift(pin, 1)
        body = int(self.m.jnt_bodyid[pin.joint])
        if second:
            (tag,) = self.xml.children(self.bodies[body], "joint")
            self.xml.set(tag, pos=_vector(self.m.jnt_pos[pin.joint] + self.within(body, self.world(second))))
        if first or second:
            parent = int(self.m.body_parentid[body])
            to = self.m.body_pos[body] + self.within(parent, self.world(first - second))
            self.xml.set(self.bodies[body], pos=_vector(to))

    def anchor(self, pin: PlanarPin) -> None:
        """Put the two anchors of a connect where they are to be: at its sites, which it is given if it has none, as its
        second anchor would else follow from the initial pose.
        """
        m, e = self.m, pin.equality
        kinds = ("connect", "weld", "joint", "tendon", "flex", "distance")
        tag = [k for k in self.xml.named(*kinds) if self.xml.lies_in(k, "equality")][e]
        if m.eq_objtype[e] == SITE:
            for number, end in ((int(m.eq_obj1id[e]), 1), (int(m.eq_obj2id[e]), 0)):
                to = m.site_pos[number] + self.within(int(m.site_bodyid[number]), self.world(self.shift(pin, end)))
                site = next(
                    k for k in self.xml.named("site") if self.xml.tags[k].attributes.get("name") == m.site(number).name
                )
                self.xml.set(site, pos=_vector(to))
            return
        names = {}
        one = self.data.xpos[m.eq_obj1id[e]] + self.data.xmat[m.eq_obj1id[e]].reshape(3, 3) @ m.eq_data[e, :3]
        two = self.data.xpos[m.eq_obj2id[e]] + self.data.xmat[m.eq_obj2id[e]].reshape(3, 3) @ m.eq_data[e, 3:6]
        for which, body, end, at in (("site1", int(m.eq_obj1id[e]), 1, one), ("site2", int(m.eq_obj2id[e]), 0, two)):
            names[which] = f"{pin.name}:{self.p.links[pin.links[end]].name}"
            pos = self.within(body, at + self.world(self.shift(pin, end)) - self.data.xpos[body])
            self.xml.insert(self.bodies[body], f'<site name="{names[which]}" pos="{_vector(pos)}"/>')
        self.xml.set(tag, body1=None, body2=None, anchor=None, **names)

    def named(self, kind: str, name: str) -> int:
        """The element of that name."""
        return next(k for k in self.xml.named(kind) if self.xml.tags[k].attributes.get("name") == name)

    # ------------------------------------------------------------------ masses, laws

    def inertia(self, k: int) -> None:
        """Give a link its mass, centre of mass and inertia, by its root body; what else belongs to it stays."""
        link, m = self.p.links[k], self.m
        was, to = (one.body(link.name) for one in (self.base, self.wanted))
        assert isinstance(was, Body)
        assert isinstance(to, Body)
        more = to.moment_of_inertia - was.moment_of_inertia
        if _same(was.mass, to.mass) and abs(was.centre - to.centre) <= NOTHING and abs(more) <= NOTHING:
            return
        root, rest = link.root, [b for b in link.bodies if b != link.root]
        place = self.frames.place(k, to.centre)  # ground frame
        flat = {b: self.p.plane.flat(self.data.xipos[b]) for b in link.bodies}
        mass = to.mass - float(sum(m.body_mass[b] for b in rest))
        if mass <= 0:
            return  # said, as nothing is written
        centre = (to.mass * place - sum(m.body_mass[b] * flat[b] for b in rest)) / mass
        about = link.inertia + more
        for b in rest:
            about -= self.across(b) + m.body_mass[b] * abs(flat[b] - place) ** 2
        about -= mass * abs(centre - place) ** 2
        own = self.across(root)
        if about <= 0 or own <= 0:
            return
        turned = self.data.xmat[root].reshape(3, 3)
        axes = turned.T @ self.data.ximat[root].reshape(3, 3)
        tensor = axes @ np.diag(m.body_inertia[root]) @ axes.T * (about / own)
        com = m.body_ipos[root] + self.within(root, self.world(centre - flat[root]))
        full = [tensor[0, 0], tensor[1, 1], tensor[2, 2], tensor[0, 1], tensor[0, 2], tensor[1, 2]]
        written = {"pos": _vector(com), "mass": _number(mass), "fullinertia": _vector(np.array(full))}
        there = self.xml.children(self.bodies[root], "inertial")
        if there:
            self.xml.set(there[0], **dict.fromkeys(ORIENTED), **written)
        else:
            said = " ".join(f'{name}="{value}"' for name, value in written.items())
            self.xml.insert(self.bodies[root], f"<inertial {said}/>")

    def across(self, body: int) -> float:
        """A body's inertia (kg.m^2) about its centre of mass, across the plane."""
        along = self.data.ximat[body].reshape(3, 3).T @ self.p.plane.normal
        return float(along**2 @ self.m.body_inertia[body])

    def laws(self, pin: PlanarPin) -> None:
        """Give a joint of the tree its damping, dry friction and spring, beside what actuators and tendons give it."""
        m, dof = self.m, int(self.m.jnt_dofadr[pin.joint])
        was, to = (one.joint(pin.name) for one in (self.base, self.wanted))
        (tag,) = self.xml.children(self.bodies[int(m.jnt_bodyid[pin.joint])], "joint")
        own = {
            "damping": self.raw.dof_damping[dof],
            "friction_torque": self.raw.dof_frictionloss[dof],
            "stiffness": self.raw.jnt_stiffness[pin.joint],
        }
        for field, attribute in LAWS.items():
            more = getattr(to, field) - getattr(was, field)
            if abs(more) > NOTHING:
                self.xml.set(tag, **{attribute: _number(max(0.0, float(own[field]) + more))})
        if to.stiffness and not (_same(to.rest_angle, was.rest_angle) and was.stiffness):
            way = 1.0 if pin.slides else pin.turn
            at = float(self.p.pose[m.jnt_qposadr[pin.joint]])
            rest = at + way * (to.rest_angle - self.p.relative(pin, self.frames))
            degrees = not pin.slides and self.degrees()
            self.xml.set(tag, springref=_number(math.degrees(rest) if degrees else rest))

    def degrees(self) -> bool:
        """Whether angles of the file are in degrees, as they are unless it says radians."""
        said = [self.xml.tags[k].attributes.get("angle") for k in self.xml.named("compiler")]
        return "radian" not in said


def _number(value: float) -> str:
    return f"{value + 0.0:.{DIGITS}g}"


def _vector(values: np.ndarray) -> str:
    return " ".join(_number(0.0 if abs(each) < NOTHING * 1e-3 else float(each)) for each in values)

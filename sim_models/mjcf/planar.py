"""A compiled MuJoCo model as a planar linkage: rigid links, and the joints between them.

A link is all bodies that no joint separates: what has no joint belongs to its parent, what an active ``weld`` holds to
what it is welded to.  Joints are the tree's hinges and slides, first body the parent, and the active ``connect``
equalities, first body the one whose anchor is the second: so a reaction has the sign of MuJoCo's own force.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import mujoco
import numpy as np

from analytic.mechanism import GROUND
from sim_models.mjcf.compiled import compiled
from sim_models.mjcf.errors import MjcfError
from sim_models.mjcf.names import Names
from sim_models.mjcf.parts import Frames, PlanarPin, Site
from sim_models.mjcf.plane import SLIDE, Plane, body_words, joint_words, plane_of

EQ = mujoco.mjtEq
CONNECT, WELD = int(EQ.mjEQ_CONNECT), int(EQ.mjEQ_WELD)
SITE = int(mujoco.mjtObj.mjOBJ_SITE)
EQUALITY_OFF = int(mujoco.mjtDisableBit.mjDSBL_EQUALITY) | int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
AT = 1e-9  # of the linkage's size: a site that is nearer to a joint is at it
RIGID = 1e-9  # m or rad: loops that are open by less are closed, directions that open them by less do not
LEAVING = 0.02  # rad or m, from the initial pose, to see whether a linkage moves
NEWTON_STEPS = 12  # that bring its loops together there
LOOP_CLOSED = 1e-6  # of the linkage's size: a loop that is open by more is open
COUPLINGS = {
    int(EQ.mjEQ_JOINT): "joint",
    int(EQ.mjEQ_TENDON): "tendon",
    int(EQ.mjEQ_DISTANCE): "distance",
    int(EQ.mjEQ_FLEX): "flex",
}


@dataclass(frozen=True)
class PlanarLink:
    """A rigid link: its MuJoCo bodies, of which ``root`` gives it its frame.

    ``axis`` (3,) is the direction in the root's frame that is the link's x; ``centre`` (m, link frame, x + iy) the
    centre of mass and ``inertia`` (kg.m^2) the moment about it.  Mass is 0 and the rest without meaning for the ground.
    """

    name: str
    root: int
    bodies: tuple[int, ...]
    axis: np.ndarray
    mass: float = 0.0
    centre: complex = 0j
    inertia: float = 0.0


@dataclass
class Planar:
    """A file as a planar linkage.  ``pose`` (nq,) are its initial coordinates; link 0 is the ground."""

    said: str
    name: str
    model: mujoco.MjModel
    plane: Plane
    pose: np.ndarray
    links: list[PlanarLink]
    pins: list[PlanarPin]
    link_of: list[int]  # by MuJoCo body
    sites: list[Site]
    size: float  # m
    notes: list[str] = field(default_factory=list)
    whole: bool = True  # all equalities of the file are active

    def frames(self, data: mujoco.MjData) -> Frames:
        """Where the links are in a state whose positions MuJoCo has computed."""
        flat = self.plane.flat
        turned = [flat(data.xmat[k.root].reshape(3, 3) @ k.axis) for k in self.links]
        return Frames([flat(data.xpos[k.root]) for k in self.links], [cmath.phase(t) for t in turned])

    def at(self, pose: np.ndarray) -> Frames:
        """Where the links are at coordinates (nq,)."""
        return self.frames(positioned(self.model, pose))

    @cached_property
    def spin(self) -> np.ndarray:
        """Angle of each link (links, nv) as a linear form of coordinates, but for a constant."""
        m = self.model
        found = np.zeros((len(self.links), m.nv))
        known, left = {0}, [pin for pin in self.pins if pin.joint >= 0]
        while pin := next((p for p in left if known & set(p.links)), None):
            left.remove(pin)
            first, second = pin.links
            if {first, second} <= known:
                continue
            here, there, sign = (first, second, 1.0) if first in known else (second, first, -1.0)
            found[there] = found[here]
            if not pin.slides:
                found[there, m.jnt_dofadr[pin.joint]] += sign * pin.turn
            known.add(there)
        return found

    def relative(self, pin: PlanarPin, frames: Frames) -> float:
        """A joint's angle (rad, second link less first) or travel (m)."""
        first, second = pin.links
        if not pin.slides:
            return frames.angles[second] - frames.angles[first]
        way = frames.place(second, pin.points[1]) - frames.place(first, pin.points[0])
        return (way * (pin.axis * cmath.exp(1j * frames.angles[first])).conjugate()).real


def positioned(model: mujoco.MjModel, pose: np.ndarray) -> mujoco.MjData:
    """MuJoCo's data at rest at coordinates (nq,)."""
    data = mujoco.MjData(model)
    data.qpos[:] = pose
    mujoco.mj_fwdPosition(model, data)
    return data


def read(path: Path) -> Planar:
    """The planar linkage of an MJCF file.  Raises MjcfError."""
    return _Reader(path).planar()


class _Reader:
    def __init__(self, path: Path) -> None:
        self.said, self.path = str(path), path
        self.notes: list[str] = []
        self.m = compiled(path, self.notes)
        self.check_freedoms()
        data = positioned(self.m, self.m.qpos0)
        self.plane = plane_of(self.m, data, self.said)
        places = np.concatenate([data.xpos, data.xipos, data.xanchor, data.site_xpos])
        flat = np.array([self.plane.flat(place) for place in places])
        self.size = float(max(np.ptp(flat.real), np.ptp(flat.imag))) or 1.0
        self.active = self.equalities()
        self.pose, self.data = self.initial(data)
        self.names = Names(self.m)

    def planar(self) -> Planar:
        self.check_welds()
        self.link_of = self.grouped()
        links = [self.link(k) for k in range(max(self.link_of) + 1)]
        self.found = Planar(
            self.said, self.names.title(self.path.stem), self.m, self.plane, self.pose, links, [], self.link_of,
            [], self.size, self.notes, len(self.active) == self.m.neq,
        )  # fmt: skip
        self.frames = self.found.frames(self.data)
        self.found.sites[:] = (self.site(i) for i in range(self.m.nsite))
        pins = [*self.tree(), *self.loops()]
        names = self.names.of_pins(self.found.sites, pins, self.frames, AT * self.size)
        self.found.pins[:] = [self.named(pin, *named) for pin, named in zip(pins, names, strict=True)]
        if not self.found.pins:
            raise MjcfError(f"{self.said}: no joint is left between its links; give it hinges that can turn")
        return self.found

    def named(self, pin: PlanarPin, names: tuple[str, ...], points: tuple[complex, complex] | None) -> PlanarPin:
        return replace(pin, names=names, points=points or pin.points)

    # ------------------------------------------------------------------ what there is

    def check_freedoms(self) -> None:
        """Raise MjcfError for bodies with several joints, and for laws that a mechanism's joint has not."""
        m = self.m
        if not m.njnt:
            raise MjcfError(f"{self.said}: has no joint; a linkage has a hinge at least, between a body and the ground")
        for body in np.flatnonzero(m.body_jntnum > 1).tolist():
            raise MjcfError(
                f"{self.said}: {body_words(m, body)} has {m.body_jntnum[body]} joints; give each joint a body with mass"
                " of its own, as a link lies between any two"
            )
        curved = m.jnt_stiffnesspoly.any(axis=1) | ((m.jnt_plasticadr >= 0) & (m.jnt_stiffness != 0))
        for j in np.flatnonzero(curved).tolist():
            raise MjcfError(f"{self.said}: {joint_words(m, j)} has a spring that is not linear; give it a linear one")
        for t in np.flatnonzero((m.tendon_plasticadr >= 0) & (m.tendon_stiffness != 0)).tolist():
            name = repr(m.tendon(t).name) if m.tendon(t).name else f"number {t + 1}"
            raise MjcfError(
                f"{self.said}: tendon {name} has a spring that yields (springyield), for which a mechanism file has no"
                " word; take springyield out"
            )
        for dof in np.flatnonzero(m.dof_dampingpoly.any(axis=1)).tolist():
            raise MjcfError(
                f"{self.said}: {joint_words(m, int(m.dof_jntid[dof]))} has a damper that is not linear; give it a"
                " linear one"
            )

    def equalities(self) -> list[int]:
        """Numbers of the active equalities.  Raises MjcfError for couplings that a linkage has not."""
        m = self.m
        if m.opt.disableflags & EQUALITY_OFF:
            if m.neq:
                self.notes.append("its equalities are disabled (option.flag), and close no loop")
            return []
        for e in range(m.neq):
            if not m.eq_active0[e]:
                self.notes.append(f"{self.equality_words(e)} is not active, and closes no loop")
                continue
            kind = COUPLINGS.get(int(m.eq_type[e]))
            if kind is not None or m.eq_type[e] not in (CONNECT, WELD):
                raise MjcfError(
                    f"{self.said}: {self.equality_words(e)} is of the kind {kind or 'flex'}; a linkage's loops are"
                    " closed by connect and weld, take it out"
                )
        return [e for e in range(m.neq) if m.eq_active0[e]]

    def check_welds(self) -> None:
        """Raise MjcfError for welds that leave a linkage no way to move which it has without them."""
        welds = [e for e in self.active if self.m.eq_type[e] == WELD]
        others = [e for e in self.active if e not in welds]
        if not welds or self.moves(self.active) or not self.moves(others):
            return
        bodies = (" and ".join(body_words(self.m, b) for b in self.ends(e)) for e in welds)
        said = ", ".join(f"{self.equality_words(e)}, of {both}" for e, both in zip(welds, bodies, strict=True))
        raise MjcfError(
            f"{self.said}: a weld locks the linkage ({said}): without welds it moves, with them it cannot; take the"
            " weld out, or make it a connect where its bodies turn on each other"
        )

    def moves(self, closing: list[int]) -> bool:
        """Whether a linkage that these equalities close can leave its initial pose: along a direction in which they do
        not open at first, and with what brings them together again there.
        """
        _, rows = self.constraints(self.pose, closing)
        _, sizes, directions = np.linalg.svd(rows, full_matrices=True)
        for direction in directions[int(np.sum(sizes > RIGID)) :]:
            q = self.pose + LEAVING * direction
            for _ in range(NEWTON_STEPS):
                opened, rows = self.constraints(q, closing)
                if np.abs(opened).max(initial=0.0) <= RIGID:
                    return True
                more = np.vstack([rows, direction])
                q = q - np.linalg.lstsq(more, np.append(opened, 0.0), rcond=RIGID)[0]
        return False

    def constraints(self, q: np.ndarray, closing: list[int]) -> tuple[np.ndarray, np.ndarray]:
        """How far (rows,) m, rad these equalities are open at coordinates (nq,), and how that changes (rows, nv)."""
        m, d = self.m, positioned(self.m, q)
        rows = np.zeros((d.nefc, m.nv))
        if mujoco.mj_isSparse(m):
            mujoco.mju_sparse2dense(rows, d.efc_J, d.efc_J_rownnz, d.efc_J_rowadr, d.efc_J_colind)
        else:
            rows = d.efc_J.reshape(-1, m.nv)
        own = (d.efc_type == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)) & np.isin(d.efc_id, closing)
        return d.efc_pos[own], rows[own]

    def equality_words(self, e: int) -> str:
        name = self.m.equality(e).name
        return f"equality {name!r}" if name else f"the equality number {e + 1}, which has no name"

    def initial(self, data: mujoco.MjData) -> tuple[np.ndarray, mujoco.MjData]:
        """The initial pose: the model's own, or the first keyframe in which its loops are closed if only that is."""
        if self.open(data) <= LOOP_CLOSED * self.size:
            return self.m.qpos0.copy(), data
        for key in range(self.m.nkey):
            there = positioned(self.m, self.m.key_qpos[key])
            if self.open(there) <= LOOP_CLOSED * self.size:
                name = self.m.key(key).name or str(key)
                self.notes.append(f"its loops are closed in the keyframe {name!r}, which is taken for its initial pose")
                return self.m.key_qpos[key].copy(), there
        for e in self.active:
            gap = self.gap(data, e)
            if self.m.eq_type[e] == WELD and gap > LOOP_CLOSED * self.size:
                raise MjcfError(
                    f"{self.said}: {self.equality_words(e)} welds what is {gap:.3g} m or rad apart in the initial pose;"
                    " give the model a keyframe in which its loops are closed"
                )
        self.notes.append(
            f"its loops are open by up to {self.open(data):.3g} m in its initial pose, which says only about where its"
            " links are"
        )
        return self.m.qpos0.copy(), data

    def open(self, data: mujoco.MjData) -> float:
        """How far (m; rad) the loops are open in the plane."""
        return max((self.gap(data, e) for e in self.active), default=0.0)

    def gap(self, data: mujoco.MjData, e: int) -> float:
        """How far an equality is open in the plane."""
        if self.m.eq_type[e] == CONNECT:
            on, at = self.anchors(data, e)
            return abs(self.plane.flat(on - at))
        rows = (data.efc_type == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)) & (data.efc_id == e)
        return float(np.abs(data.efc_pos[rows]).max(initial=0.0))

    def anchors(self, data: mujoco.MjData, e: int) -> tuple[np.ndarray, np.ndarray]:
        """Where (3,) the two anchors of a connect are, in MuJoCo's world."""
        m = self.m
        if m.eq_objtype[e] == SITE:
            return data.site_xpos[int(m.eq_obj1id[e])], data.site_xpos[int(m.eq_obj2id[e])]
        one, other = (
            data.xpos[b] + data.xmat[b].reshape(3, 3) @ m.eq_data[e, 3 * i : 3 * i + 3]
            for i, b in enumerate(self.ends(e))
        )
        return one, other

    # ------------------------------------------------------------------ links

    def grouped(self) -> list[int]:
        """Number of the link that each body belongs to; the world's is 0."""
        m = self.m
        head = list(range(m.nbody))

        def top(b: int) -> int:
            while head[b] != b:
                b = head[b]
            return b

        for b in range(1, m.nbody):
            if not m.body_jntnum[b]:
                head[top(b)] = top(int(m.body_parentid[b]))
        for e in self.active:
            if m.eq_type[e] == WELD:
                low, high = sorted(top(b) for b in self.ends(e))
                head[high] = low
                self.notes.append(f"{self.equality_words(e)} makes one link of what it welds")
        order = {b: k for k, b in enumerate(sorted({top(b) for b in range(m.nbody)}))}
        return [order[top(b)] for b in range(m.nbody)]

    def ends(self, e: int) -> tuple[int, int]:
        """The two bodies of an equality."""
        m, ends = self.m, (int(self.m.eq_obj1id[e]), int(self.m.eq_obj2id[e]))
        if m.eq_objtype[e] == SITE:
            return int(m.site_bodyid[ends[0]]), int(m.site_bodyid[ends[1]])
        return ends

    def link(self, k: int) -> PlanarLink:
        """A link with its frame and inertia."""
        m, d, plane = self.m, self.data, self.plane
        bodies = tuple(b for b in range(m.nbody) if self.link_of[b] == k)
        root = bodies[0]
        axis = self.x_axis(d.xmat[root].reshape(3, 3))
        if not k:
            return PlanarLink(GROUND, 0, bodies, axis)
        mass = float(m.body_mass[list(bodies)].sum())
        if not mass > 0:
            raise MjcfError(f"{self.said}: {body_words(m, root)} has no mass; give it a geom with mass, or an inertial")
        flat = [plane.flat(d.xipos[b]) for b in bodies]
        com = sum(m.body_mass[b] * p for b, p in zip(bodies, flat, strict=True)) / mass
        if len(bodies) == 1:
            com = flat[0]
        inertia = 0.0
        for b, p in zip(bodies, flat, strict=True):
            along = d.ximat[b].reshape(3, 3).T @ plane.normal
            inertia += float(along**2 @ m.body_inertia[b]) + m.body_mass[b] * abs(p - com) ** 2
        turned = d.xmat[root].reshape(3, 3) @ axis
        centre = (com - plane.flat(d.xpos[root])) * plane.flat(turned).conjugate()
        return PlanarLink(self.names.body(root), root, bodies, axis, mass, centre, inertia)

    def x_axis(self, turned: np.ndarray) -> np.ndarray:
        """The axis of a body's frame that is its link's x: the one that is the ground's in the world's frame, if it
        lies in the plane, another that does, or else what now points along the ground's x.
        """
        own = int(np.argmax(np.abs(self.plane.x)))
        for k in dict.fromkeys((own, 0, 1, 2)):
            if abs(float(turned[:, k] @ self.plane.normal)) < 1e-9 and (k != own or abs(self.plane.x[own]) == 1.0):
                return np.eye(3)[k]
        return turned.T @ self.plane.x

    def site(self, i: int) -> Site:
        """A site in its link."""
        link = self.link_of[int(self.m.site_bodyid[i])]
        place = self.plane.flat(self.data.site_xpos[i])
        return Site(i, self.m.site(i).name, link, self.frames.within(link, place))

    # ------------------------------------------------------------------ joints

    def tree(self) -> Iterator[PlanarPin]:
        """The tree's hinges and slides."""
        m, d = self.m, self.data
        for j in range(m.njnt):
            body = int(m.jnt_bodyid[j])
            first, second = self.link_of[int(m.body_parentid[body])], self.link_of[body]
            if first == second:
                self.notes.append(f"{joint_words(m, j)} is held by a weld, and left out")
                continue
            place, axis = self.plane.flat(d.xanchor[j]), d.xaxis[j]
            slides = bool(m.jnt_type[j] == SLIDE)
            along = self.plane.flat(axis) if slides else 0j
            angles = self.frames.angles
            yield PlanarPin(
                names=(m.joint(j).name,),
                links=(first, second),
                points=(self.frames.within(first, place), self.frames.within(second, place)),
                joint=j,
                slides=slides,
                axis=along * cmath.exp(-1j * angles[first]),
                angle=angles[second] - angles[first] if slides else 0.0,
                turn=math.copysign(1.0, float(axis @ self.plane.normal)),
            )

    def loops(self) -> Iterator[PlanarPin]:
        """The active connects."""
        m, d = self.m, self.data
        for e in self.active:
            if m.eq_type[e] != CONNECT:
                continue
            bodies = self.ends(e)
            second, first = (self.link_of[b] for b in bodies)
            if first == second:
                self.notes.append(f"{self.equality_words(e)} connects a link with itself, and is left out")
                continue
            on, at = self.anchors(d, e)
            apart = abs(float((on - at) @ self.plane.normal))
            if apart > LOOP_CLOSED * self.size:
                self.notes.append(
                    f"{self.equality_words(e)} is open by {apart:.3g} m across the plane, which nothing can close"
                )
            flat = self.plane.flat
            points = self.frames.within(first, flat(at)), self.frames.within(second, flat(on))
            yield PlanarPin((m.equality(e).name,), (first, second), points, equality=e)

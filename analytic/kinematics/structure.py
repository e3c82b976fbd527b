"""What a planar linkage is made of: the driven body, then its Assur groups, as constant matrices.

Every point of a linkage is a constant linear form in a few *columns*, complex numbers that change with the motion:

    e_b          phasor exp(i angle) of each body b, ground included (e_ground = 1)
    s_k e_f      travel s_k of each prismatic joint times the phasor of its first body f
    g_j          gap of each revolute joint: first body's pin centre minus the second's (zero for an ideal joint)

so that ``z = form @ columns``, velocities and accelerations follow from the columns' derivatives with the same forms,
and by virtual work the reaction of a joint is the dual of its gap.  A loop closes where ``loop @ columns = 0``.

An Assur group is the smallest set of bodies that becomes rigid when it is joined to what is known already (two bodies
and three joints, a dyad, in most linkages).  Solving group after group, each of which may hold several loops, needs
no formula for the four-bar or any other linkage.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from analytic.errors import Error
from analytic.mechanism import GROUND, Joint, Mechanism
from analytic.mechanism.one_line import count, one_line

NAMED = 8  # bodies that an error names; a linkage may have hundreds


class StructureError(Error, ValueError):
    """The joints do not make a linkage that one drive determines."""


@dataclass(frozen=True)
class Coordinate:
    """An unknown of the motion: the common angle of bodies that turn together, or the travel of a prismatic joint."""

    joint: str
    bodies: tuple[int, ...]  # columns of the bodies that turn with it; empty for a travel
    column: int  # the travel's column, -1 for an angle


@dataclass(frozen=True)
class Group:
    """An Assur group: its bodies' names, unknown coordinates (indices) and the rows of its loops."""

    bodies: tuple[str, ...]
    coordinates: tuple[int, ...]
    loops: tuple[int, ...]


@dataclass(frozen=True)
class Structure:
    """Constant matrices of a linkage (m); see the module's text for their columns."""

    mechanism: Mechanism
    bodies: tuple[str, ...]  # column of each body's phasor; the ground is column 0
    slides: tuple[str, ...]
    pins: tuple[str, ...]
    origins: np.ndarray  # (bodies, columns) complex: form of each body's origin
    loops: np.ndarray  # (loops, columns) complex
    held_at: np.ndarray  # (bodies,) rad: angle of a body minus that of its coordinate
    coordinates: tuple[Coordinate, ...]  # the driven angle first
    groups: tuple[Group, ...]
    slide_body: np.ndarray  # (slides,) column of the phasor that each slide moves along
    turned_by: tuple[frozenset[int], ...]  # per slide: the bodies that its joint holds from turning, on the far side
    far_is_second: tuple[bool, ...]  # per slide: whether the far side is the joint's second body

    @property
    def n_columns(self) -> int:
        """Number of columns."""
        return self.origins.shape[1]

    def body_column(self, name: str) -> int:
        """Column of a body's phasor."""
        return self.bodies.index(name)

    def slide_column(self, joint: str) -> int:
        """Column of a prismatic joint's travel."""
        return len(self.bodies) + self.slides.index(joint)

    def gap_column(self, joint: str) -> int:
        """Column of a revolute joint's gap."""
        return len(self.bodies) + len(self.slides) + self.pins.index(joint)

    def __repr__(self) -> str:
        joints = count(len(self.mechanism.joints), "joint")
        return one_line(self, self.mechanism.name, joints, count(len(self.groups), "Assur group"))

    def form(self, body: str, point: str = "com") -> np.ndarray:
        """Form (columns,) of a named point of a body (see Body.point)."""
        column = self.body_column(body)
        form = self.origins[column].copy()
        form[column] += self.mechanism.body(body).point(point)
        return form


def structure(mechanism: Mechanism) -> Structure:
    """Decompose a linkage.  Raises StructureError where one drive does not determine it."""
    return _Builder(mechanism).build()


def reached(start: str, along: Mapping[str, set[str]]) -> set[str]:
    """All that can be reached from ``start``, itself included."""
    found, queue = {start}, [start]
    for here in queue:
        new = along[here] - found
        found |= new
        queue += new
    return found


def _names(order: tuple[str, ...], chosen: set[str]) -> str:
    names = [b for b in order if b in chosen]
    return ", ".join(names[:NAMED]) + (f" and {len(names) - NAMED} more" if len(names) > NAMED else "")


def _ends(joint: Joint, spent: Mapping[str, list[Joint]]) -> list[str]:
    """The bodies of a joint that are still to be found."""
    return [b for b in joint.bodies if b in spent]


def _spend(joint: Joint, spent: Mapping[str, list[Joint]], tried: set[str]) -> bool:
    """Spend an equation of a joint on one of its bodies, of which each takes three; False where none can take it.

    Where all have three already, one of those moves on to the body at its joint's other end, and so on.  ``tried`` gets
    the bodies that were asked.
    """
    route: dict[str, tuple[str, Joint]] = {}  # body -> the one before it, and the joint that may move from that to it
    queue = _ends(joint, spent)
    tried |= set(queue)
    for body in queue:
        if len(spent[body]) < 3:
            while body in route:
                before, moving = route[body]
                spent[before].remove(moving)
                spent[body].append(moving)
                body = before
            spent[body].append(joint)
            return True
        for moving in spent[body]:
            for other in _ends(moving, spent):
                if other not in tried:
                    tried.add(other)
                    route[other] = body, moving
                    queue.append(other)
    return False


class _Builder:
    def __init__(self, mechanism: Mechanism) -> None:
        self.m = mechanism
        self.bodies = (GROUND, *(b.name for b in mechanism.bodies))
        self.slides = tuple(j.name for j in mechanism.joints if j.prismatic)
        self.pins = tuple(j.name for j in mechanism.joints if not j.prismatic)
        n = len(self.bodies) + len(self.slides) + len(self.pins)
        self.origins = np.zeros((len(self.bodies), n), complex)
        self.held_at = np.zeros(len(self.bodies))
        self.head = {GROUND: -1}  # coordinate that turns each placed body; -1 is the ground
        self.coordinates: list[Coordinate] = []
        self.loops: list[np.ndarray] = []
        self.groups: list[Group] = []
        self.tree: dict[str, tuple[str, Joint]] = {}  # body -> its parent and the joint between
        self.unused = list(mechanism.joints)

    def build(self) -> Structure:
        self.place(self.m.driven, self.m.drive_joint)
        needs = self.needs()
        while len(self.head) < len(self.bodies):
            self.add_group(self.next_group(needs))
        return Structure(
            mechanism=self.m, bodies=self.bodies, slides=self.slides, pins=self.pins, origins=self.origins,
            loops=np.array(self.loops).reshape(len(self.loops), self.origins.shape[1]), held_at=self.held_at,
            coordinates=tuple(self.coordinates), groups=tuple(self.groups),
            slide_body=np.array([self.bodies.index(self.m.joint(k).bodies[0]) for k in self.slides], int),
            turned_by=tuple(self.beyond(self.m.joint(k)) for k in self.slides),
            far_is_second=tuple(self.far(self.m.joint(k)) == self.m.joint(k).bodies[1] for k in self.slides),
        )  # fmt: skip

    def mobility(self) -> int:
        return 3 * len(self.m.bodies) - 2 * len(self.m.joints)

    def needs(self) -> dict[str, set[str]]:
        """For each unplaced body the bodies that must be known, or found with it, for it to be found.

        Every joint has two equations, and each is spent on one of the three unknowns of a body that it joins; a body
        then needs those at the other ends of the joints that are spent on it.  Raises StructureError where an equation
        finds no unknown (the joint is one too many), or an unknown no equation.
        """
        spent: dict[str, list[Joint]] = {b: [] for b in self.bodies if b not in self.head}
        for joint in self.unused:
            for _ in range(2):
                rigid: set[str] = set()
                if not _spend(joint, spent, rigid):
                    raise StructureError(
                        f"{self.m.name}: joint {joint.name!r} closes a loop that is rigid already, through"
                        f" {_names(self.bodies, rigid) or GROUND} (mobility {self.mobility()}, one drive needs 1);"
                        " remove it"
                    )
        needs = {b: {other for joint in joints for other in _ends(joint, spent)} - {b} for b, joints in spent.items()}
        loose = {b for b in spent if any(len(spent[other]) < 3 for other in reached(b, needs))}
        if loose:
            raise StructureError(
                f"{self.m.name}: the drive at {self.m.drive_joint.name!r} does not determine"
                f" {_names(self.bodies, loose)} (mobility {self.mobility()}, one drive needs 1); hold"
                " or join what is free, or check the joints' bodies"
            )
        return needs

    def next_group(self, needs: Mapping[str, set[str]]) -> tuple[str, ...]:
        """The smallest set of unplaced bodies that need none but placed bodies and each other: 3 bodies = 2 joints."""
        waiting = {b: needs[b] - set(self.head) for b in self.bodies if b not in self.head}
        smallest = set(waiting)
        for body in waiting:
            found = reached(body, waiting)
            smallest = min(found, smallest, key=len)  # of equally small ones the first in the file
            if len(smallest) == 2:
                break
        return tuple(b for b in waiting if b in smallest)

    def joints_of(self, group: tuple[str, ...]) -> list[Joint]:
        """Joints between the group's bodies, and from them to what is placed already."""
        inside = {*group, *self.head}
        return [j for j in self.unused if set(j.bodies) <= inside and set(j.bodies) & set(group)]

    def add_group(self, group: tuple[str, ...]) -> None:
        joints = sorted(self.joints_of(group), key=lambda j: not j.prismatic)  # prismatic joints belong to the tree
        edges = self.spanning_tree(group, joints)
        first = len(self.coordinates)
        while edges:
            joint = next(j for j in edges if set(j.bodies) & set(self.head))
            edges.remove(joint)
            child = next(b for b in joint.bodies if b not in self.head)
            self.place(child, joint)
        loops = []
        for joint in self.joints_of(group):
            self.unused.remove(joint)
            loops.append(len(self.loops))
            self.loops.append(self.closure(joint))
        self.groups.append(Group(group, tuple(range(first, len(self.coordinates))), tuple(loops)))

    def spanning_tree(self, group: tuple[str, ...], joints: list[Joint]) -> list[Joint]:
        """Joints that hang the group's bodies on what is placed, every prismatic one among them."""
        part = {b: b if b in group else "" for b in (*group, *self.head)}
        tree = []
        for joint in joints:
            a, b = (part[body] for body in joint.bodies)
            if a != b:
                tree.append(joint)
                part = {body: b if p == a else p for body, p in part.items()}
            elif joint.prismatic:
                raise StructureError(
                    f"{self.m.name}: joint {joint.name!r} closes a loop of prismatic joints only; make one of them"
                    " revolute"
                )
        return tree

    def place(self, child: str, joint: Joint) -> None:
        """Hang a body on a placed one: its origin's form, its coordinate."""
        first, second = joint.bodies
        parent = second if child == first else first
        sign = 1 if parent == first else -1
        a, b = self.bodies.index(parent), self.bodies.index(child)
        form = self.origins[a].copy()
        form[a] += self.m.body(parent).point(joint.name)
        if joint.prismatic:
            column = len(self.bodies) + self.slides.index(joint.name)
            form[column] += sign * joint.direction
            self.held_at[b] = self.held_at[a] + sign * joint.angle
            head = self.head[parent]
            if head >= 0:
                turning = self.coordinates[head]
                self.coordinates[head] = Coordinate(turning.joint, (*turning.bodies, b), -1)
            self.coordinates.append(Coordinate(joint.name, (), column))
        else:
            form[len(self.bodies) + len(self.slides) + self.pins.index(joint.name)] -= sign
            head = len(self.coordinates)
            self.coordinates.append(Coordinate(joint.name, (b,), -1))
        form[b] -= self.m.body(child).point(joint.name)
        self.origins[b] = form
        self.head[child] = head
        self.tree[child] = (parent, joint)
        self.unused.remove(joint)

    def closure(self, joint: Joint) -> np.ndarray:
        """Form that vanishes where a loop closes: first pin minus second pin minus gap."""
        first, second = (self.bodies.index(b) for b in joint.bodies)
        form = self.origins[first] - self.origins[second]
        form[first] += self.m.body(joint.bodies[0]).point(joint.name)
        form[second] -= self.m.body(joint.bodies[1]).point(joint.name)
        form[len(self.bodies) + len(self.slides) + self.pins.index(joint.name)] -= 1
        return form

    def far(self, joint: Joint) -> str:
        return next(b for b in joint.bodies if b in self.tree and self.tree[b][1].name == joint.name)

    def beyond(self, joint: Joint) -> frozenset[int]:
        """Bodies that a prismatic joint carries and that turn with it."""
        carried = {self.far(joint)}
        for body, (parent, via) in self.tree.items():  # parents come before children
            if parent in carried and via.prismatic:
                carried.add(body)
        return frozenset(self.bodies.index(b) for b in carried)

"""What a planar linkage is made of: driven bodies and Assur groups, one after the other, as constant matrices.

Every point of a linkage is a constant linear form in a few *columns*, complex numbers that change with the motion:

    e_b          phasor exp(i angle) of each body b, ground included (e_ground = 1)
    s_k e_f      travel s_k of each prismatic joint times the phasor of its first body f
    g_j          gap of each revolute joint: first body's pin centre minus the second's (zero for an ideal joint)

so that ``z = form @ columns``, velocities and accelerations follow from the columns' derivatives with the same forms,
and by virtual work the reaction of a joint is the dual of its gap.  A loop closes where ``loop @ columns = 0``.

An Assur group is the smallest set of bodies that becomes rigid when it is joined to what is known already (two bodies
and three joints, a dyad, in most linkages).  Solving group after group, each of which may hold several loops, needs
no formula for the four-bar or any other linkage.

What is known is the position of each driven joint, whose equation is one more than a joint's two, and where drives
leave freedoms, the position of further joints, which then move freely (``inputs``).  A body behind a driven joint
turns with what that joint is on: its angle is a sum of coordinates.  Where joints have more equations than there are
unknowns (a parallelogram with a third bar), a group has more loops than it needs; whether they agree is a question of
lengths, which the assembly answers (:mod:`analytic.kinematics.assembly`).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from analytic.errors import Error
from analytic.mechanism import GROUND, Joint, Mechanism
from analytic.mechanism.one_line import count, one_line

MOST_BODIES_NAMED = 8  # bodies that an error names; a linkage may have hundreds


class StructureError(Error, ValueError):
    """The joints do not make a linkage that moves."""


@dataclass(frozen=True)
class BlockRest:
    """Where a block rests in its guide, beside the line through its joint's first point: its point's ``offset`` (m)
    along the axis turned by a right angle, and its ``tilt`` (rad) beyond the joint's angle; the second body relative to
    the first.
    """

    offset: float
    tilt: float


BlockRests = Mapping[str, BlockRest]
CENTRED: BlockRests = {}


@dataclass(frozen=True)
class Coordinate:
    """A variable of the motion: an angle with which bodies turn, or the travel of a prismatic joint."""

    joint: str
    bodies: tuple[int, ...]  # columns of the bodies that turn with it; empty for a travel
    column: int  # the travel's column, -1 for an angle


@dataclass(frozen=True)
class Group:
    """An Assur group: its bodies' names, unknown coordinates (indices), the rows of its loops, and the inputs (indices
    of coordinates) that act within it.
    """

    bodies: tuple[str, ...]
    coordinates: tuple[int, ...]
    loops: tuple[int, ...]
    within: tuple[int, ...] = ()

    @property
    def dyad(self) -> bool:
        """Whether the group has two unknowns and one loop, and is closed in closed form."""
        return len(self.coordinates) == 2 and len(self.loops) == 1 and not self.within

    @property
    def surplus(self) -> int:
        """How many equations its loops have beyond its unknowns."""
        return 2 * len(self.loops) - len(self.coordinates)


@dataclass(frozen=True)
class Structure:
    """Constant matrices of a linkage (m); see the module's text for their columns."""

    mechanism: Mechanism
    bodies: tuple[str, ...]  # column of each body's phasor; the ground is column 0
    slides: tuple[str, ...]
    pins: tuple[str, ...]
    origins: np.ndarray  # (bodies, columns) complex: form of each body's origin
    loops: np.ndarray  # (loops, columns) complex
    held_at: np.ndarray  # (bodies,) rad: angle of a body minus the sum of its coordinates
    coordinates: tuple[Coordinate, ...]  # a crank's angle first
    groups: tuple[Group, ...]
    inputs: tuple[int, ...]  # coordinates that are given: the drives' in the file's order, then those that move freely
    steps: tuple[Group | int, ...]  # what is found one after the other: groups, and inputs outside of them
    turned: tuple[tuple[int, ...], ...]  # per body: the coordinates whose sum turns it
    hung: tuple[int, ...]  # per body: the coordinate by which it hangs on another; -1 of the ground
    signs: np.ndarray  # (coordinates,) 1, or -1 where a revolute joint's second body is the one nearer to the ground
    one_too_many: str  # a sentence on joints that close what is rigid already, if lengths do not agree; or empty
    slide_body: np.ndarray  # (slides,) column of the phasor that each slide moves along
    turned_by: tuple[frozenset[int], ...]  # per slide: the bodies that its joint holds from turning, on the far side
    far_is_second: tuple[bool, ...]  # per slide: whether the far side is the joint's second body

    @property
    def by_crank(self) -> bool:
        """Whether one crank's angle alone tells where the linkage is."""
        return len(self.inputs) == 1 and self.mechanism.cranked

    @property
    def driven(self) -> tuple[int, ...]:
        """Which of the inputs (indices of them) a drive moves."""
        return tuple(k for k, drive in enumerate(self.mechanism.drives) if drive.speed != "free")

    @property
    def free(self) -> tuple[int, ...]:
        """Which of the inputs (indices of them) move freely."""
        return tuple(k for k in range(len(self.inputs)) if k not in self.driven)

    @property
    def free_joints(self) -> tuple[str, ...]:
        """The joints that move freely."""
        return tuple(self.coordinates[self.inputs[k]].joint for k in self.free)

    def unit(self, i: int) -> Literal["rad", "m"]:
        """Unit of a coordinate."""
        return "rad" if self.coordinates[i].bodies else "m"

    @cached_property
    def stacked(self) -> tuple[tuple[int, ...], ...]:
        """Per group: columns of its bodies that turn with a sum of coordinates."""
        columns = [tuple(self.bodies.index(b) for b in group.bodies) for group in self.groups]
        return tuple(tuple(b for b in bodies if len(self.turned[b]) > 1) for bodies in columns)

    def riding(self, bodies: Collection[int]) -> list[int]:
        """Columns of the travels along these bodies (columns)."""
        return [len(self.bodies) + k for k, body in enumerate(self.slide_body) if body in bodies]

    @cached_property
    def turning(self) -> tuple[list[int], ...]:
        """Per coordinate: columns that turn with it, its bodies' and then those of the travels along them."""
        return tuple([*c.bodies, *self.riding(c.bodies)] for c in self.coordinates)

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


def structure(mechanism: Mechanism, whole: bool = False, rests: BlockRests = CENTRED) -> Structure:
    """Decompose a linkage; ``whole`` puts all that its drives do not move alone into one group, whatever its parts.
    Blocks lie in their guides as ``rests`` says, by joint; all others are centred.

    Raises StructureError where its drives do not go together, or it cannot move.
    """
    given = [drive.joint for drive in mechanism.drives] or ([mechanism.drive_joint.name] if mechanism.cranked else [])
    free = _Builder(mechanism, given, whole, rests).left_free()
    return _Builder(mechanism, given + free, whole, rests).build()


def reached(start: str, along: Mapping[str, set[str]]) -> set[str]:
    """All that can be reached from ``start``, itself included."""
    visited, queue = {start}, [start]
    for here in queue:
        new = along[here] - visited
        visited |= new
        queue += new
    return visited


def _names(order: tuple[str, ...], chosen: set[str]) -> str:
    names = [b for b in order if b in chosen]
    return ", ".join(names[:MOST_BODIES_NAMED]) + (
        f" and {len(names) - MOST_BODIES_NAMED} more" if len(names) > MOST_BODIES_NAMED else ""
    )


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
    def __init__(self, mechanism: Mechanism, given: list[str], whole: bool, rests: BlockRests) -> None:
        self.m = mechanism
        self.given, self.whole, self.rests = given, whole, rests
        self.bodies = (GROUND, *(b.name for b in mechanism.bodies))
        self.slides = tuple(j.name for j in mechanism.joints if j.prismatic)
        self.pins = tuple(j.name for j in mechanism.joints if not j.prismatic)
        n = len(self.bodies) + len(self.slides) + len(self.pins)
        self.origins = np.zeros((len(self.bodies), n), complex)
        self.held_at = np.zeros(len(self.bodies))
        self.turned: dict[str, tuple[int, ...]] = {GROUND: ()}  # coordinates that turn each placed body
        self.hung: dict[str, int] = {}
        self.coordinates: list[Coordinate] = []
        self.signs: list[int] = []
        self.loops: list[np.ndarray] = []
        self.steps: list[Group | int] = []
        self.inputs: dict[str, int] = {}  # coordinate of each joint whose position is given
        self.tree: dict[str, tuple[str, Joint]] = {}  # body -> its parent and the joint between
        self.unused = list(mechanism.joints)
        self.one_too_many = ""

    def build(self) -> Structure:
        self.place_given()
        needs = self.needs()
        while len(self.turned) < len(self.bodies):
            self.add_group(self.next_group(needs))
            self.place_given()
        return Structure(
            mechanism=self.m, bodies=self.bodies, slides=self.slides, pins=self.pins, origins=self.origins,
            loops=np.array(self.loops).reshape(len(self.loops), self.origins.shape[1]), held_at=self.held_at,
            coordinates=tuple(self.coordinates), groups=tuple(s for s in self.steps if isinstance(s, Group)),
            inputs=tuple(self.inputs[name] for name in self.given), steps=tuple(self.steps),
            turned=tuple(self.turned[b] for b in self.bodies),
            hung=(-1, *(self.hung[b] for b in self.bodies[1:])), signs=np.array(self.signs),
            one_too_many=self.one_too_many,
            slide_body=np.array([self.bodies.index(self.m.joint(k).bodies[0]) for k in self.slides], int),
            turned_by=tuple(self.beyond(self.m.joint(k)) for k in self.slides),
            far_is_second=tuple(self.far(self.m.joint(k)) == self.m.joint(k).bodies[1] for k in self.slides),
        )  # fmt: skip

    def mobility(self) -> int:
        return 3 * len(self.m.bodies) - 2 * len(self.m.joints)

    def left_free(self) -> list[str]:
        """Joints whose positions, with those that are given, determine the linkage: those nearest to the ground."""
        spent: dict[str, list[Joint]] = {b: [] for b in self.bodies[1:]}
        for joint in self.unused:
            for _ in range(2 + (joint.name in self.given)):
                _spend(joint, spent, set())
        self.check_one_drive(spent)
        others = [j for j in self.unused if j.name not in self.given]
        nearest = sorted(others, key=lambda j: (GROUND not in j.bodies, j.prismatic))
        return [joint.name for joint in nearest if _spend(joint, spent, set())]

    def check_one_drive(self, spent: Mapping[str, list[Joint]]) -> None:
        """One drive that turns a crank determines the whole linkage: what it leaves free is a slip more often than
        meant.
        """
        needs = {b: {other for joint in joints for other in _ends(joint, spent)} - {b} for b, joints in spent.items()}
        loose = {b for b in spent if any(len(spent[other]) < 3 for other in reached(b, needs))}
        if loose and len(self.m.drives) == 1 and self.m.drives[0].speed != "free":
            raise StructureError(
                f"{self.m.name}: the drive at {self.m.drives[0].joint!r} does not determine"
                f" {_names(self.bodies, loose)} (mobility {self.mobility()}, one drive needs 1); hold"
                " or join what is free, check the joints' bodies, or give what is to swing a [[drive]] of its own with"
                " speed = 'free'"
            )

    def needs(self) -> dict[str, set[str]]:
        """For each unplaced body the bodies that must be known, or found with it, for it to be found.

        Every joint has two equations, a given one three, and each is spent on one of the three unknowns of a body that
        it joins; a body then needs those at the other ends of the joints that are spent on it.  An equation that finds
        no unknown is one too many: it is left to the lengths whether it agrees with the others.
        """
        spent: dict[str, list[Joint]] = {b: [] for b in self.bodies if b not in self.turned}
        for joint in self.unused:
            for _ in range(2 + (joint.name in self.given)):
                rigid: set[str] = set()
                if not _spend(joint, spent, rigid) and not self.one_too_many:
                    remedy = "leave a drive out" if len(self.given) > max(self.mobility(), 0) > 0 else "remove it"
                    self.one_too_many = (
                        f"{self.m.name}: joint {joint.name!r} closes a loop that is rigid already, through"
                        f" {_names(self.bodies, rigid) or GROUND} (mobility {self.mobility()},"
                        f" {_drives(len(self.given))}); {remedy}"
                    )
        return {b: {other for joint in joints for other in _ends(joint, spent)} - {b} for b, joints in spent.items()}

    def next_group(self, needs: Mapping[str, set[str]]) -> tuple[str, ...]:
        """The smallest set of unplaced bodies that need none but placed bodies and each other: 3 bodies = 2 joints."""
        waiting = {b: needs[b] - set(self.turned) for b in self.bodies if b not in self.turned}
        smallest = set(waiting)
        for body in () if self.whole else waiting:
            needed = reached(body, waiting)
            smallest = min(needed, smallest, key=len)  # of equally small ones the first in the file
            if len(smallest) == 2:
                break
        return tuple(b for b in waiting if b in smallest)

    def joints_of(self, group: tuple[str, ...]) -> list[Joint]:
        """Joints between the group's bodies, and from them to what is placed already."""
        inside = {*group, *self.turned}
        return [j for j in self.unused if set(j.bodies) <= inside and set(j.bodies) & set(group)]

    def place_given(self) -> None:
        """Place what given joints hang on placed bodies, and close what then joins placed bodies only."""
        while True:
            joint = next(
                (j for j in self.unused if j.name in self.given and len({*j.bodies} & {*self.turned}) == 1), None
            )
            if joint is None:
                break
            self.place(next(b for b in joint.bodies if b not in self.turned), joint)
            self.steps.append(self.inputs[joint.name])
        closed = [j for j in self.unused if {*j.bodies} <= {*self.turned}]
        if closed:
            self.check_ties(closed)
            self.steps.append(Group((), (), tuple(self.close(j) for j in closed)))

    def check_ties(self, joints: list[Joint]) -> None:
        for joint in joints:
            if joint.prismatic or joint.name in self.given:
                raise StructureError(
                    f"{self.m.name}: joint {joint.name!r} closes a loop of prismatic joints and drives only; make one"
                    " of them revolute, or leave a drive out"
                )

    def add_group(self, group: tuple[str, ...]) -> None:
        # prismatic and given joints belong to the tree
        order = sorted(self.joints_of(group), key=lambda j: (not j.prismatic, j.name not in self.given))
        edges = self.spanning_tree(group, order)
        first = len(self.coordinates)
        while edges:
            joint = next(j for j in edges if set(j.bodies) & set(self.turned))
            edges.remove(joint)
            child = next(b for b in joint.bodies if b not in self.turned)
            self.place(child, joint)
        joints = self.joints_of(group)
        self.check_ties(joints)
        loops = tuple(self.close(joint) for joint in joints)
        new = range(first, len(self.coordinates))
        inputs = set(self.inputs.values())
        unknown, within = tuple(i for i in new if i not in inputs), tuple(i for i in new if i in inputs)
        self.steps.append(Group(group, unknown, loops, within))

    def close(self, joint: Joint) -> int:
        """Spend a joint on a loop; its row."""
        self.unused.remove(joint)
        self.loops.append(self.closure(joint))
        return len(self.loops) - 1

    def spanning_tree(self, group: tuple[str, ...], joints: list[Joint]) -> list[Joint]:
        """Joints that hang the group's bodies on what is placed, every prismatic one among them."""
        part = {b: b if b in group else "" for b in (*group, *self.turned)}
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
        new = len(self.coordinates)
        given = joint.name in self.given
        self.hung[child] = new
        if joint.prismatic:
            column = len(self.bodies) + self.slides.index(joint.name)
            form[column] += sign * joint.direction
            rest = self.rests.get(joint.name)
            if rest is not None:
                form[self.bodies.index(first)] += sign * 1j * joint.direction * rest.offset
        else:
            form[len(self.bodies) + len(self.slides) + self.pins.index(joint.name)] -= sign
        self.turned[child] = ()
        if joint.prismatic or given:  # it turns with what it hangs on
            self.held_at[b] = self.held_at[a] + (sign * self.held(joint) if joint.prismatic else 0.0)
            self.turned[child] = self.turned[parent]
            for i in self.turned[parent]:
                turning = self.coordinates[i]
                self.coordinates[i] = Coordinate(turning.joint, (*turning.bodies, b), -1)
        if joint.prismatic:
            self.coordinates.append(Coordinate(joint.name, (), column))
        else:
            self.coordinates.append(Coordinate(joint.name, (b,), -1))
            self.turned[child] += (new,)
        self.signs.append(1 if joint.prismatic else sign)
        if given:
            self.inputs[joint.name] = new
        form[b] -= self.m.body(child).point(joint.name)
        self.origins[b] = form
        self.tree[child] = (parent, joint)
        self.unused.remove(joint)

    def held(self, joint: Joint) -> float:
        """Angle (rad) at which a prismatic joint holds its second body on its first."""
        rest = self.rests.get(joint.name)
        return joint.angle if rest is None else joint.angle + rest.tilt

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
            if parent in carried and (via.prismatic or via.name in self.given):
                carried.add(body)
        return frozenset(self.bodies.index(b) for b in carried)


def _drives(number: int) -> str:
    return "one drive needs 1" if number == 1 else f"{count(number, 'drive')} need {number}"

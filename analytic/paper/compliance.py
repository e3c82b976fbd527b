"""Compliance of links and joints by matrix structural analysis (section 2.1 of the paper, Eqs. 1-7).

A linkage with its crank held at the drive is a structure.  Links with a modulus of elasticity are built of straight
Euler-Bernoulli bars, joints are six-dof springs (Eq. 4) or exactly rigid, bodies without a modulus are exactly rigid.
What is exactly rigid is a constraint on the nodes' freedoms and is eliminated by the null space of all constraints
(never a penalty; redundant ones, as every planar linkage of rigid links has out of its plane, do no harm).  The rest is
Eq. 7, U = K^-1 W, for all crank angles at once.

A node has six freedoms in the ground frame: translations x, y, z (m), rotations about x, y, z (rad).  Loads lie in the
plane, and a beam's motions in it do not mix with those out of it, so that only x, y and the rotation about z are worked
out; a beam matrix that is given may mix them and gets all six.  The analysis is linear, about the given configuration.
Weight and inertia act at each body's com, as in Eqs. 9-10, not along the bar; a prismatic joint's guide is as stiff as
its body is at the joint's point, and does not bend between there and the slider.
The beam matrix is the right one, not Eq. 2 as printed (:mod:`analytic.paper.printed` has that).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from analytic.kinematics.motion import Motion
from analytic.kinematics.output import Output
from analytic.mechanism import GROUND, MASS_CENTRE, Body, Joint, Mechanism, Spring
from analytic.mechanism.one_line import angles, count, largest, one_line
from analytic.paper.frame import ComplianceError, ElasticBar, beam_stiffness, frame
from analytic.paper.kinetostatics import joint_law, kinetostatics, load_now, of_springs, spring_pull

STRUCTURES_AT_ONCE = 128  # crank angles solved at once: their matrices stay in the processor's cache
DEPENDENT = 1e-10  # of the largest singular value: constraints below it say nothing new
FREE_PIVOT = 1e-14  # pivot of the stiffness, scaled to a unit diagonal, below which a motion costs no energy

PLANE, SPACE = (0, 1, 5), (0, 1, 2, 3, 4, 5)  # freedoms of a node; the last is the rotation about z


@dataclass(frozen=True)
class Compliance:
    """Elastic displacements of a linkage at N crank angles, from its unloaded configuration; ground frame."""

    mechanism: Mechanism
    theta: np.ndarray  # rad (N,)
    motions: Mapping[tuple[str, str], np.ndarray]  # (N, 6) by body and point: m and rad
    energy: np.ndarray  # J (N,): strain energy of bars and springs
    positions: Mapping[str, np.ndarray]  # rad, or m, (N,) by joint: of its position, second body relative to first
    loads: Mapping[str, np.ndarray]  # N, N.m (N,) by signal: what springs that yield with the links change of them

    def __repr__(self) -> str:
        moved = largest(np.array([self.displacement(*place) for place in self.motions]), "m")
        return one_line(self, self.mechanism.name, angles(self.theta), moved)

    def motion(self, body: str, point: str = "com") -> np.ndarray:
        """Translations x, y, z (m) and rotations about x, y, z (rad) of a body's point, (N, 6); zero for the ground.

        The two points of a joint move apart by the joint's own compliance: name the body that is meant.
        """
        return np.zeros((self.theta.size, 6)) if body == GROUND else self.motions[body, point]

    def displacement(self, body: str, point: str = "com") -> np.ndarray:
        """In-plane displacement x + iy (m) of a body's point, (N,) complex."""
        motion = self.motion(body, point)
        return motion[:, 0] + 1j * motion[:, 1]

    def rotation(self, body: str, point: str = "com") -> np.ndarray:
        """Rotation (rad) about z of the material at a body's point, (N,)."""
        return self.motion(body, point)[:, 5]

    def output(self, d: Output) -> np.ndarray:
        """Elastic displacement (N,) of an output, in its unit."""
        if d.axis == "angle":
            return self.rotation(d.body, self.mechanism.angle_point(d.body))
        return d.part(self.displacement(d.body, d.point))

    def give(self, joint: str) -> np.ndarray:
        """How far the springs of a joint (Eq. 4) yield, x + iy (m): its point on the first body minus that on the
        second, (N,) complex; exactly zero for a joint without ``elasticity``.
        """
        spec = self.mechanism.joint(joint)
        if spec.elasticity is None:
            return np.zeros(self.theta.size, complex)
        first, second = spec.bodies
        return self.displacement(first, joint) - self.displacement(second, joint)


def compliance(
    motion: Motion,
    inertia: bool = False,
    *,
    beam: Callable[[ElasticBar], np.ndarray] = beam_stiffness,
) -> Compliance:
    """Elastic displacements under the forces that :func:`kinetostatics` sees too, with the crank held at the drive (Eq.
    7).

    Those are weight, loads, springs, friction and, with ``inertia``, inertia and damping.  The superposition of Fig. 7c
    wants the motion without gaps; in a motion with gaps each pin keeps its place in its bearing.

    Friction that grows with reactions grows with the rigid linkage's.
    Raises ComplianceError for a flexible body without a section, or where the loads are not carried (a change point).
    """
    structure = _Structure(motion, beam)
    load = structure.loads(inertia)
    n = motion.theta.size
    parts = [
        structure.solve(slice(i, i + STRUCTURES_AT_ONCE), load[i : i + STRUCTURES_AT_ONCE])
        for i in range(0, n, STRUCTURES_AT_ONCE)
    ]
    u, energy = (np.concatenate(part) for part in zip(*parts, strict=True))
    at = structure.positions(u)
    return Compliance(structure.mechanism, motion.theta, structure.motions(u), energy, at, structure.by_springs(u, at))


class _Structure:
    """The structure that a motion's linkage is, with the crank held, at each of N crank angles."""

    def __init__(self, motion: Motion, beam: Callable[[ElasticBar], np.ndarray]) -> None:
        self.motion = motion
        self.mechanism = motion.structure.mechanism
        self.frames = {body.name: frame(body) for body in self.mechanism.bodies}
        self.kept = PLANE if beam is beam_stiffness else SPACE
        self.held = {motion.structure.coordinates[i].joint for i in motion.structure.inputs}
        self.first: dict[str, int] = {}  # freedom of each body's first node
        self.size = 0
        for name, f in self.frames.items():
            self.first[name] = self.size
            self.size += len(self.kept) * len(f.nodes)
        self.bars = [bar for body in self.mechanism.bodies for bar in self.bars_of(body, beam)]
        self.slips = {joint.name: self.slip(joint) for joint in self.mechanism.joints}

    def bars_of(
        self, body: Body, beam: Callable[[ElasticBar], np.ndarray]
    ) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Freedoms (2 d,), direction (N,) complex and stiffness (2 d, 2 d) in its own axes of each bar; d freedoms a
        node are kept.
        """
        kept = np.array([*self.kept, *(6 + k for k in self.kept)])
        f = self.frames[body.name]
        for i, j, bar in f.bars:
            reach = f.nodes[j] - f.nodes[i]
            freedoms = np.concatenate([self.freedoms(body.name, i), self.freedoms(body.name, j)])
            yield freedoms, reach / abs(reach) * self.phasor(body.name), beam(bar)[np.ix_(kept, kept)]

    def freedoms(self, body: str, node: int) -> np.ndarray:
        """Indices (d,) of a node's freedoms."""
        return self.first[body] + len(self.kept) * node + np.arange(len(self.kept))

    def phasor(self, body: str) -> np.ndarray:
        """exp(i angle) of a body, (N,)."""
        phasor: np.ndarray = self.motion.columns[self.motion.structure.body_column(body)]
        return phasor

    def place(self, body: str, point: str) -> tuple[np.ndarray, np.ndarray]:
        """Freedoms (d,) of the node that carries a body's point, and the rigid arm (N,) complex from node to point."""
        node, arm = self.frames[body].places[point]
        return self.freedoms(body, node), arm * self.phasor(body)

    def carry(self, arm: np.ndarray) -> np.ndarray:
        """(N, d, d): motion of a point at the end of a rigid in-plane arm (N,) complex, from the motion of its node."""
        return _carry(arm)[:, np.array(self.kept)[:, None], self.kept]

    def slip(self, joint: Joint) -> np.ndarray:
        """Form (N, d, n) of a joint's relative motion: second body minus first, at the second's point, along the
        joint's axes.

        A prismatic joint's guide is a rigid arm of its first body from that body's point to the second's; x is its
        axis.
        """
        form = np.zeros((self.motion.theta.size, len(self.kept), self.size))
        for body, sign in zip(joint.bodies, (-1, 1), strict=True):
            if body != GROUND:
                freedoms, arm = self.place(body, joint.name)
                if joint.prismatic and sign < 0:
                    arm = arm + joint.direction * self.motion.columns[self.motion.structure.slide_column(joint.name)]
                form[:, :, freedoms] = sign * self.carry(arm)
        return (
            _turn(joint.direction * self.phasor(joint.bodies[0]), len(self.kept) // 3).swapaxes(1, 2) @ form
            if joint.prismatic
            else form
        )

    def springs(self, joint: Joint) -> tuple[np.ndarray, np.ndarray]:
        """Stiffness (d,) against each relative motion of a joint (k_c of Eq. 4), and which of them are tied (d,)."""
        free, elastic = _free(joint), joint.elasticity
        springs = np.zeros(6) if elastic is None else np.repeat([elastic.translation, elastic.rotation], 3)
        tied = np.full(6, elastic is None)
        springs[free], tied[free] = joint.stiffness, False
        if joint.name in self.held:  # the motor holds the crank
            motor = self.mechanism.drive_stiffness
            springs[free] += motor or 0.0
            tied[free] = motor is None
        return springs[[*self.kept]], tied[[*self.kept]]

    def stiffness(self, block: slice) -> tuple[np.ndarray, np.ndarray]:
        """K (N, n, n) of bars and springs in the ground frame (Eqs. 5, 6), and the ties (N, r, n), for which ties @ U =
        0.
        """
        k = np.zeros((self.motion.theta[block].size, self.size, self.size))
        for freedoms, direction, element in self.bars:
            turn = _turn(direction[block], len(element) // 3)
            k[:, freedoms[:, None], freedoms] += turn @ element @ turn.swapaxes(1, 2)
        ties = []
        for joint in self.mechanism.joints:
            springs, tied = self.springs(joint)
            slip = self.slips[joint.name][block]
            ties.append(slip[:, tied])
            if springs.any():
                k += slip.swapaxes(1, 2) @ (springs[:, None] * slip)
            if joint.cubic or joint.stops:
                free = slip[:, [self.kept.index(_free(joint))]]
                k += free.swapaxes(1, 2) @ (self.stiffening(joint)[block, None, None] * free)
        for spring in self.mechanism.springs:
            form = self.reach(spring)[block]
            k += form.swapaxes(1, 2) @ self.held_by(spring)[block] @ form
        return k, np.concatenate(ties, axis=1)

    def stiffening(self, joint: Joint) -> np.ndarray:
        """How much stiffer (N,) than at rest a joint's cubic spring, and what stops it, is in its place."""
        position = self.motion.relative(joint)
        return np.asarray(3 * joint.cubic * (position - joint.rest_angle) ** 2 + joint.stiffest(position))

    def reach(self, spring: Spring) -> np.ndarray:
        """Form (N, 2, n) of how a spring's second point moves against its first, x and y."""
        form = np.zeros((self.motion.theta.size, 2, self.size))
        for (body, point), sign in zip(spring.ends, (-1, 1), strict=True):
            if body != GROUND:
                freedoms, arm = self.place(body, point)
                form[:, :, freedoms] = sign * self.carry(arm)[:, :2]
        return form

    def held_by(self, spring: Spring) -> np.ndarray:
        """Stiffness (N, 2, 2) of a spring between its points: along it its own, across it by the force that turns."""
        near, far = (self.motion.position(*end) for end in spring.ends)
        apart = far - near
        along = apart / np.abs(apart)
        across = (spring_pull(self.motion, spring, moving=False) / apart).real
        out = np.zeros((apart.size, 2, 2))
        for i, u in enumerate((along.real, along.imag)):
            for j, v in enumerate((along.real, along.imag)):
                out[:, i, j] = spring.stiffness * u * v + across * ((i == j) - u * v)
        return out

    def loads(self, inertia: bool) -> np.ndarray:
        """W (N, n): forces and moments on the nodes."""
        load = np.zeros((self.motion.theta.size, self.size))

        def add(body: str, point: str, force: np.ndarray | complex, torque: np.ndarray | complex | float) -> None:
            freedoms, arm = self.place(body, point)
            load[:, freedoms[0]] += np.real(force)
            load[:, freedoms[1]] += np.imag(force)
            load[:, freedoms[-1]] += (np.conj(arm) * force).imag + np.real(torque)

        for body in self.mechanism.bodies:
            add(body.name, MASS_CENTRE, body.mass * complex(*self.mechanism.gravity), 0.0)
            if inertia:
                m = self.motion
                force = -body.mass * m.acceleration(body.name, MASS_CENTRE)
                add(body.name, MASS_CENTRE, force, -body.moment_of_inertia * m.angular_acceleration(body.name))
        for given in self.mechanism.loads:
            add(given.body, given.point, *load_now(self.motion, given))
        for spring in self.mechanism.springs:
            pull = spring_pull(self.motion, spring, inertia)
            load += (np.array([pull.real, pull.imag]).T[:, None] @ -self.reach(spring))[:, 0]
        periodic = self.mechanism.periodic_torque
        if periodic is not None:
            add(self.mechanism.driven, MASS_CENTRE, 0.0, periodic.at(self.motion.theta))
        rubbed = kinetostatics(self.motion, inertia).rubbed if self.mechanism.load_rubbed else {}
        for joint in self.mechanism.joints:
            law = joint_law(joint, self.motion, inertia) + rubbed.get(joint.name, 0.0)
            load += law[:, None] * self.slips[joint.name][:, self.kept.index(_free(joint))]
        return load

    def solve(self, block: slice, load: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Displacements (N, n) and strain energy (N,) of a block of crank angles."""
        theta = self.motion.theta[block]
        k, ties = self.stiffness(block)
        u = np.empty_like(load)
        for same, basis in _null_spaces(ties):
            inner, outer = basis.swapaxes(1, 2) @ k[same] @ basis, basis.swapaxes(1, 2) @ load[same, :, None]
            held = _is_held(inner)
            if not held.all():
                self.refuse(theta[same][~held], "nothing holds the linkage in place")
            u[same] = (basis @ np.linalg.solve(inner, outer))[..., 0]
        size = max(body.length for body in self.mechanism.bodies)
        moved = np.abs(u.reshape(theta.size, -1, len(self.kept))[..., : len(self.kept) // 3 + 1]).max(axis=(1, 2))
        if np.any(moved > size):
            self.refuse(
                theta[moved > size],
                f"its loads displace it by more than its own size ({size:g} m), where a linear analysis means nothing",
            )
        return u, 0.5 * np.sum(load * u, axis=1)

    def refuse(self, theta: np.ndarray, why: str) -> None:
        raise ComplianceError(
            f"{self.mechanism.name}: {why} at {self.where(float(theta[0]))}; keep clear of change points, or check"
            f" youngs_modulus, section, elasticity and the loads ({count(theta.size, 'such pose')})"
        )

    def where(self, theta: float) -> str:
        """A pose in words, by the first input: a crank's angle, or the position of a joint."""
        s, m = self.motion.structure, self.mechanism
        if s.by_crank:
            return f"crank angle {np.degrees(theta):.6g} deg"
        first = s.inputs[0]
        joint, at = m.joint(s.coordinates[first].joint), s.signs[first] * theta
        return f"{joint.name} = " + (f"{1e3 * at:.6g} mm" if joint.prismatic else f"{np.degrees(at):.6g} deg")

    def motions(self, u: np.ndarray) -> dict[tuple[str, str], np.ndarray]:
        """Motion (N, 6) of every point of every body."""
        result = {}
        for body, f in self.frames.items():
            for point in f.places:
                freedoms, arm = self.place(body, point)
                result[body, point] = np.zeros((len(u), 6))
                result[body, point][:, self.kept] = (self.carry(arm) @ u[:, freedoms, None])[..., 0]
        return result

    def positions(self, u: np.ndarray) -> dict[str, np.ndarray]:
        """What displacements (N, n) make of every joint's position (N,), rad or m."""
        free = {joint.name: self.kept.index(_free(joint)) for joint in self.mechanism.joints}
        return {name: np.einsum("ni,ni->n", self.slips[name][:, axis], u) for name, axis in free.items()}

    def by_springs(self, u: np.ndarray, positions: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """What springs ask more of joints and drives, N and N.m by signal, where displacements (N, n) take them."""
        m = self.mechanism
        laws = {
            j.name: -(j.stiffness + self.stiffening(j)) * positions[j.name] for j in m.joints if j.springy or j.stops
        }
        pulls = []
        for spring in m.springs:
            x, y = (self.held_by(spring) @ self.reach(spring) @ u[..., None])[..., 0].T
            pulls.append((spring, x + 1j * y))
        return of_springs(self.motion, laws, pulls).loads() if laws or pulls else {}


def _free(joint: Joint) -> int:
    """The one relative motion that a joint leaves: along its axis, or about z."""
    return 0 if joint.prismatic else 5


def _null_spaces(ties: np.ndarray) -> Iterator[tuple[np.ndarray | slice, np.ndarray]]:
    """Motions that ties (N, r, n) leave, for angles where equally many: their indices and an orthonormal basis (N or 1,
    n, m).
    """
    constant = not np.ptp(ties, axis=0).any()  # flexible links on pins: the ties do not turn with the crank
    _, singular, right = np.linalg.svd(ties[:1] if constant else ties)
    ranks = np.sum(singular > DEPENDENT * singular.max(axis=1, initial=0.0, keepdims=True), axis=1)
    for rank in np.unique(ranks):
        same = np.flatnonzero(ranks == rank)
        yield slice(None) if constant else same, right[same, rank:].swapaxes(1, 2)


def _is_held(stiffness: np.ndarray) -> np.ndarray:
    """Whether no motion is free of strain energy, (N,): the smallest pivot of K (N, m, m) scaled to a unit diagonal."""
    scale = np.sqrt(np.maximum(np.einsum("nii->ni", stiffness), np.finfo(float).tiny))
    try:
        factor = np.linalg.cholesky(stiffness / scale[:, :, None] / scale[:, None])
    except np.linalg.LinAlgError:
        return np.zeros(len(stiffness), bool)
    held: np.ndarray = np.einsum("nii->ni", factor).min(axis=1, initial=1.0) ** 2 > FREE_PIVOT
    return held


def _carry(arm: np.ndarray) -> np.ndarray:
    """(N, 6, 6): motion of a point at the end of a rigid in-plane arm (N,) complex, from the motion of its node."""
    carry = np.zeros((arm.size, 6, 6))
    carry[:, range(6), range(6)] = 1.0
    carry[:, 0, 5], carry[:, 1, 5] = -arm.imag, arm.real
    carry[:, 2, 3], carry[:, 2, 4] = arm.imag, -arm.real
    return carry


def _turn(axis: np.ndarray, triples: int) -> np.ndarray:
    """T (N, 3 triples, 3 triples) of Eqs. 5-6: components in the ground frame from those along axis (N,) complex, its
    normal and z.
    """
    turn = np.zeros((axis.size, 3 * triples, 3 * triples))
    for i in range(0, 3 * triples, 3):
        turn[:, i, i] = turn[:, i + 1, i + 1] = axis.real
        turn[:, i, i + 1], turn[:, i + 1, i] = -axis.imag, axis.imag
        turn[:, i + 2, i + 2] = 1.0
    return turn

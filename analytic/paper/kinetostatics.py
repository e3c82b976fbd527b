"""Reactions of all joints and the drive torque, for any planar linkage (Eqs. 9-14 without the four-bar).

D'Alembert's inertia forces (Eqs. 9, 10) make every instant a statics problem, which is solved by virtual work on the
structure's columns: the closing forces of each Assur group from its own coordinates, last group first, then every
reaction as the dual of its joint's gap.  For the four-bar this is Eq. 11 with its load in the right row.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from analytic.compiled import run
from analytic.kinematics.assembly import Assembly
from analytic.kinematics.closure import AssemblyError, crank_angle, posture
from analytic.kinematics.motion import (
    ANGLES_AT_ONCE,
    DEAD_CENTRE,
    Motion,
    Pieced,
    blocks,
    joined,
    self_stresses,
    solve_forces,
)
from analytic.kinematics.structure import Group, Structure
from analytic.mechanism import MASS_CENTRE, Joint, Load, Spring
from analytic.mechanism.one_line import angles, largest, one_line
from analytic.mechanism.signals import POWER, Signal, driving, moving, position, slipping
from analytic.mechanism.varying import Seen, Vectors
from analytic.paper.friction import Rubbing, friction
from analytic.paper.guide import GuidedBlock

STRESS_ROUNDING = 1e-7  # of a self-stress of 1 N: what of it reaches a joint is rounding error
STRESS_SAMPLES = 8  # of a motion, about as many, at which self-stresses are looked at


@dataclass(frozen=True)
class Reactions:
    """Kinetostatic equilibrium of a motion; arrays are (N,)."""

    motion: Motion
    forces: Mapping[str, np.ndarray]  # N, complex, ground frame: force of each joint's first body on its second
    moments: Mapping[str, np.ndarray]  # N.m of each prismatic joint on its second body, at that body's point
    drive_torque: np.ndarray  # N.m, motor on driven body; of several, the first input's torque or force
    # what the motor in each joint does: N.m, or N, of the first body on the second; NaN in ``forces`` and ``moments``
    # is what nothing but the elasticity of its parts determines, of the joints that are ``undetermined``
    drive_loads: Mapping[str, np.ndarray] = field(default_factory=dict)
    undetermined: frozenset[str] = frozenset()
    efforts: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))  # (inputs, N) N.m, N along each input
    # N.m; prismatic: N, along the guide: what each joint whose friction grows with reactions does by it on its second
    rubbed: Mapping[str, np.ndarray] = field(default_factory=dict)

    def __repr__(self) -> str:
        forces = largest(np.array(list(self.forces.values())), "N")
        torque = f"drive torque {largest(self.drive_torque, 'N.m')}"
        return one_line(self, self.motion.structure.mechanism.name, angles(self.motion.theta), forces, torque)

    def part(self, at: slice | np.ndarray) -> Reactions:
        """Reactions at some of the instants (a slice: views of its arrays; or indices, or which)."""

        def some(arrays: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
            return {name: values[at] for name, values in arrays.items()}

        return Reactions(
            self.motion.part(at),
            some(self.forces),
            some(self.moments),
            self.drive_torque[at],
            some(self.drive_loads),
            self.undetermined,
            self.efforts[:, at],
            some(self.rubbed),
        )

    def signals(self) -> dict[str, np.ndarray]:
        """Every signal of the contract that an ideal or displaced configuration has, by name (SI units)."""
        return {one.name: values for one, values in self._signals()}

    def rates(self) -> dict[str, np.ndarray]:
        """Velocities and accelerations of markers and joints, and the power of the drives, by name (SI units): what is
        on request (:attr:`analytic.mechanism.signals.Signal.on_request`).
        """
        m, mechanism = self.motion, self.motion.structure.mechanism
        found: dict[str, np.ndarray] = {}
        for body in self.motion.structure.bodies[1:]:
            velocity, acceleration = m.velocity(body), m.acceleration(body)
            parts = velocity.real, velocity.imag, acceleration.real, acceleration.imag, m.angular_acceleration(body)
            found |= zip((signal.name for signal in moving(body)), parts, strict=True)
        for joint in mechanism.joints:
            slip = m.slip(joint), m.slip_acceleration(joint)
            found |= zip((signal.name for signal in slipping(joint)), slip, strict=True)
        drives = {name: load * m.slip(mechanism.joint(name)) for name, load in self.drive_loads.items()}
        return found | {POWER.name: np.sum([*drives.values(), np.zeros(m.theta.size)], axis=0)}

    def loads(self) -> dict[str, np.ndarray]:
        """The signals of reactions and of what drives the linkage, by name (SI units)."""
        return {one.name: values for one, values in self._signals() if one.kind in ("reaction", "drive")}

    def _signals(self) -> Iterator[tuple[Signal, np.ndarray]]:
        m, s = self.motion, self.motion.structure
        yield from poses(m)
        for joint, force in self.forces.items():
            yield Signal.of("reaction", joint, "x"), force.real
            yield Signal.of("reaction", joint, "y"), force.imag
        for joint, moment in self.moments.items():
            yield Signal.of("reaction", joint, "moment"), moment
        for joint in s.pins:
            gap = m.columns[s.gap_column(joint)]
            yield Signal.of("clearance", joint, "x"), gap.real
            yield Signal.of("clearance", joint, "y"), gap.imag
        for one in s.mechanism.joints:
            yield position(one), m.relative(one)
        if s.by_crank:
            yield Signal.of("drive", "", "torque"), self.drive_torque
        elif self.drive_loads:
            joints = [s.mechanism.joint(name) for name in self.drive_loads]
            yield from zip(driving(joints), self.drive_loads.values(), strict=True)


def poses(motion: Motion) -> Iterator[tuple[Signal, np.ndarray]]:
    """Where bodies are and how fast they turn, (N,) by signal (SI units)."""
    for body in motion.structure.bodies[1:]:
        com = motion.position(body)
        yield Signal.of("pose", body, "x"), com.real
        yield Signal.of("pose", body, "y"), com.imag
        yield Signal.of("pose", body, "angle"), motion.angle(body)
        yield Signal.of("rate", body, "angular_velocity"), motion.angular_velocity(body)


def kinetostatics(
    motion: Motion,
    inertia: bool = True,
    grip: np.ndarray | None = None,
    *,
    loose: Sequence[Rubbing] = (),
    rubs: bool = True,
) -> Reactions:
    """Reactions and drive torque for gravity, loads, joint springs, friction, dampers and, with ``inertia``, motion.

    Without ``inertia`` the linkage is in static equilibrium at each angle; the motion's velocities then only give
    dry friction its direction and dampers do nothing.  ``grip`` (N,) is the share of the friction that acts: 1
    unless the linkage sticks.  A motion that compiled code has found is balanced by compiled code, every other by
    :func:`kinetostatics_by_numpy`; they differ by rounding.  ``loose`` are joints whose contacts have friction, in
    clearances that the motion may have as gaps; all others rub that have no clearance.  Unless the linkage ``rubs``,
    friction that grows with reactions is left out.
    Raises AssemblyError where that friction locks the linkage, or the force of a spring has no direction.
    """
    motion.assembly.check_springs(motion.coordinates, motion.columns)
    reactions = compiled_reactions(motion, inertia, grip) if motion.compiled else None
    if reactions is None:
        reactions = _by_numpy(motion, inertia, grip)
    if not rubs:
        return reactions
    return _rubbed(reactions, [*loose, *_tight(motion, {each.joint.name for each in loose})], grip)


def compiled_reactions(motion: Motion, inertia: bool, grip: np.ndarray | None) -> Reactions | None:
    """Reactions without friction that grows with them, by compiled code; None where that does not serve."""
    coordinates = motion.coordinates, motion.rates, motion.accelerations
    columns = motion.columns, motion.column_rates, motion.column_accelerations
    balanced = run.balanced(motion.assembly, coordinates, columns, motion.displaced, inertia, grip)
    if balanced is None:
        return None
    s, (forces, moments, drives) = motion.structure, balanced
    by_joint = dict(zip([j.name for j in s.mechanism.joints], forces, strict=True))
    return _reactions_of(motion, by_joint, dict(zip(s.slides, moments, strict=True)), drives, undetermined(motion))


def _tight(motion: Motion, loose: Collection[str]) -> list[Rubbing]:
    """Pins and blocks that rub without clearance, but for those that are ``loose``."""
    m = motion.structure.mechanism
    return [
        Rubbing(joint, GuidedBlock.of(m, joint.name, 0.0) if joint.prismatic else None)
        for joint in m.load_rubbed
        if joint.name not in loose
    ]


def _rubbed(reactions: Reactions, rubbing: Sequence[Rubbing], grip: np.ndarray | None) -> Reactions:
    """Reactions with the friction of joints that rub, from those without.  Raises AssemblyError."""
    if not rubbing:
        return reactions
    name = reactions.motion.structure.mechanism.name
    for joint in (each.joint for each in rubbing):
        if joint.name in reactions.undetermined:
            raise AssemblyError(
                f"{name}: {joint.load_law} makes friction grow with a reaction that is statically undetermined; leave"
                " it out, or a joint that is not needed"
            )
    forces, moments = dict(reactions.forces), dict(reactions.moments)
    efforts = reactions.efforts.copy()
    rubbed = {each.joint.name: np.empty(efforts.shape[1]) for each in rubbing}
    for block in blocks(reactions.motion.theta.size):
        part = reactions.part(block)
        units = [_of_a_unit(part.motion, each) for each in rubbing]
        size, locks = friction(part, units, rubbing, 1.0 if grip is None else grip[block])
        if locks.any():
            s, u, first = part.motion.structure, part.motion.coordinates, int(np.argmax(locks))
            fields = " or ".join(each.joint.load_law for each in rubbing)
            raise AssemblyError(
                f"{name}: the friction that its reactions give locks the linkage at {posture(s, u, first)}",
                crank_angle(s, u, first),
                f"make {fields} smaller, or keep clear of there",
            )
        for each, torque, unit in zip(rubbing, size, units, strict=True):
            rubbed[each.joint.name][block] = torque
            efforts[:, block] += torque * unit.efforts
            for whole, answer in ((forces, unit.forces), (moments, unit.moments)):
                for place, values in answer.items():
                    whole[place][block] += torque * values
    return replace(_reactions_of(reactions.motion, forces, moments, efforts, reactions.undetermined), rubbed=rubbed)


def _of_a_unit(motion: Motion, rubbing: Rubbing) -> Reactions:
    """Reactions to a unit of a joint's friction, N.m or N along its guide."""
    joint, (work, turning, along) = rubbing.joint, _unloaded(motion)
    if joint.prismatic:
        along[joint.name] = np.ones(motion.theta.size)
    else:
        for body, side in zip(joint.bodies, rubbing.sides, strict=True):
            turning[motion.structure.body_column(body)] += side
    return _reactions_of(motion, *_carried(motion, work, turning, along), undetermined(motion))


def kinetostatics_by_numpy(motion: Motion, inertia: bool = True, grip: np.ndarray | None = None) -> Reactions:
    """What :func:`kinetostatics` gives, by numpy alone: what the compiled code is held against."""
    return _rubbed(_by_numpy(motion, inertia, grip), _tight(motion, ()), grip)


def _by_numpy(motion: Motion, inertia: bool, grip: np.ndarray | None) -> Reactions:
    """Reactions by numpy alone, without friction that grows with them."""
    s, n = motion.structure, motion.theta.size
    order = [j.name for j in s.mechanism.joints]
    by_joint = {name: np.empty(n, complex) for name in order}, {name: np.empty(n) for name in s.slides}
    drives = np.empty((len(s.inputs), n))
    work = np.empty((s.n_columns, min(n, ANGLES_AT_ONCE)), complex)  # the same memory for every block
    loose = undetermined(motion)
    for block in blocks(n):
        share = 1.0 if grip is None else grip[block]
        *parts, drives[:, block] = _balance(motion.part(block), inertia, share, work[:, : block.stop - block.start])
        for whole, part in zip(by_joint, parts, strict=True):
            for name, values in part.items():
                whole[name][block] = values
    return _reactions_of(motion, *by_joint, drives, loose)


def pieced(assembly: Assembly, pieces: Sequence[tuple[np.ndarray, Reactions]]) -> Reactions:
    """Reactions of a motion of several assemblies of one linkage, each of which has the samples with those indices."""
    n = sum(where.size for where, _ in pieces)

    def whole(array: Callable[[Reactions], np.ndarray]) -> np.ndarray:
        return joined([(where, array(reactions)) for where, reactions in pieces], n)

    def each(arrays: Callable[[Reactions], Mapping[str, np.ndarray]]) -> dict[str, np.ndarray]:
        parts = [(where, arrays(reactions)) for where, reactions in pieces]
        return {name: joined([(where, part[name]) for where, part in parts], n) for name in parts[0][1]}

    return Reactions(
        Pieced.of(assembly, [(where, reactions.motion) for where, reactions in pieces]),
        each(lambda reactions: reactions.forces),
        each(lambda reactions: reactions.moments),
        whole(lambda reactions: reactions.drive_torque),
        each(lambda reactions: reactions.drive_loads),
        frozenset().union(*(reactions.undetermined for _, reactions in pieces)),
        whole(lambda reactions: reactions.efforts),
        each(lambda reactions: reactions.rubbed),
    )


def _reactions_of(
    motion: Motion,
    forces: dict[str, np.ndarray],
    moments: dict[str, np.ndarray],
    drives: np.ndarray,
    loose: frozenset[str],
) -> Reactions:
    """Reactions by what holds the motion in balance: NaN of joints that are ``loose``, as nothing determines them."""
    s = motion.structure
    for name in loose:
        forces[name][:] = complex(np.nan, np.nan)
        if name in moments:
            moments[name][:] = np.nan
    loads = {s.coordinates[s.inputs[k]].joint: s.signs[s.inputs[k]] * drives[k] for k in s.driven}
    return Reactions(motion, forces, moments, drives[0], loads, loose, drives)


def undetermined(motion: Motion) -> frozenset[str]:
    """Joints whose reactions statics does not determine: loops beyond those needed can press against each other.

    Each such self-stress is carried through the linkage; the joints that it reaches are those.
    """
    s, joints = motion.structure, set[str]()
    loose = [group for group in s.groups if group.surplus]
    if not loose:
        return frozenset()
    every = max(1, motion.theta.size // STRESS_SAMPLES)
    some = motion.part(slice(None, None, every))
    longest = max(body.length for body in s.mechanism.bodies) or 1.0
    for group in loose:
        for stress in self_stresses(some.jacobians[group], group):
            forces, moments, _ = _carried(some, *_unloaded(some), stress={group: stress})
            joints |= {name for name, force in forces.items() if np.abs(force).max() > STRESS_ROUNDING}
            joints |= {name for name, moment in moments.items() if np.abs(moment).max() > STRESS_ROUNDING * longest}
    return frozenset(joints)


def reactions_to(
    motion: Motion, body: str, point: str, force: complex, torque: float
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray], np.ndarray]:
    """Reactions (N,) complex by joint, moments (N,) N.m by prismatic joint, and what moves each input (inputs, N), of a
    force (N, x + iy) at a body's point and a torque (N.m) on it alone, at rest: no weight, no load, no law of a joint.
    """
    work, turning, along = _unloaded(motion)
    work += (motion.assembly.form(body, point) * np.conj(force))[:, None]
    turning[motion.structure.body_column(body)] += torque
    return _carried(motion, work, turning, along)


def _unloaded(motion: Motion) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """No loads: work on the columns (n_columns, N), torques on bodies (bodies, N), forces along slides (N,), all 0."""
    s, n = motion.structure, motion.theta.size
    return np.zeros((s.n_columns, n), complex), np.zeros((len(s.bodies), n)), dict.fromkeys(s.slides, np.zeros(n))


def of_springs(motion: Motion, laws: Mapping[str, np.ndarray], pulls: Sequence[tuple[Spring, np.ndarray]]) -> Reactions:
    """What springs alone ask of joints and drives, at rest: no weight, no load, no other law of a joint.

    ``laws`` are torques (N.m; prismatic: forces, N) (N,) on the second body of each joint that has one, ``pulls``
    forces (N, x + iy) (N,) on the first point of springs between points.
    """
    s, (work, turning, along) = motion.structure, _unloaded(motion)
    for spring, pull in pulls:
        for (body, point), sign in zip(spring.ends, (1.0, -1.0), strict=True):
            work += sign * motion.assembly.form(body, point)[:, None] * np.conj(pull)
    for name, law in laws.items():
        if name in s.slides:
            along[name] = law
            continue
        for body, sign in zip(s.mechanism.joint(name).bodies, (-1.0, 1.0), strict=True):
            turning[s.body_column(body)] += sign * law
    return _reactions_of(motion, *_carried(motion, work, turning, along), undetermined(motion))


def _balance(
    motion: Motion, inertia: bool, grip: np.ndarray | float, work: np.ndarray
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray], np.ndarray]:
    """Forces and moments of the joints, as in Reactions, and what moves each input (inputs, N); ``work`` (n_columns, N)
    complex is written over.
    """
    s = motion.structure
    _work_of_forces(motion, inertia, grip, work)
    torque = _torques(motion, inertia, grip)
    travel_force = {j.name: joint_law(j, motion, inertia, grip) for j in s.mechanism.joints if j.prismatic}
    return _carried(motion, work, torque, travel_force)


def _carried(
    motion: Motion,
    work: np.ndarray,
    torque: np.ndarray,
    travel_force: Mapping[str, np.ndarray],
    stress: Mapping[Group, np.ndarray] = MappingProxyType({}),
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray], np.ndarray]:
    """What :func:`_balance` gives under the work of forces, torques on bodies and forces along slides; ``work`` is
    written over.  ``stress`` are closing forces (loops, N) of a group beside those that it needs.
    """
    s = motion.structure
    for group in reversed(s.groups):
        generalised = np.array([_generalised(motion, i, work, torque, travel_force) for i in group.coordinates])
        generalised = generalised.reshape(len(group.coordinates), -1 if len(generalised) else work.shape[1])
        closing = solve_forces(motion.jacobians[group], generalised, s, group)
        if group in stress:
            closing = closing + stress[group]
        for row, force in zip(group.loops, closing, strict=True):
            for k in np.flatnonzero(s.loops[row]):
                work[k] += s.loops[row, k] * np.conj(force)
    forces = {name: np.conj(work[s.gap_column(name)]) for name in s.pins}
    forces |= {name: -np.conj(work[s.slide_column(name)]) * s.mechanism.joint(name).direction for name in s.slides}
    moments = {}
    for name, carried, far_is_second in zip(s.slides, s.turned_by, s.far_is_second, strict=True):
        moment = _turning_work(motion, tuple(carried), s.riding(carried), work, torque)
        moments[name] = -moment if far_is_second else moment
    return forces, moments, np.array([-_generalised(motion, i, work, torque, travel_force) for i in s.inputs])


def _work_of_forces(motion: Motion, inertia: bool, grip: np.ndarray | float, work: np.ndarray) -> None:
    """Set ``work`` (n_columns, N) to conj(force) times form, summed over all applied and inertia forces."""
    m = motion.structure.mechanism
    work[:] = 0.0

    def add(body: str, point: str, force: np.ndarray | complex) -> None:
        force = np.conj(force)
        for k, arm in enumerate(motion.assembly.form(body, point).tolist()):
            if arm:
                work[k] += arm * force

    for body in m.bodies:
        force: np.ndarray | complex = body.mass * complex(*m.gravity)
        if inertia:
            force = force - body.mass * motion.acceleration(body.name, MASS_CENTRE)
        add(body.name, MASS_CENTRE, force)
    for load in m.loads:
        force, _ = load_now(motion, load, grip)
        add(load.body, load.point, force)
    for spring in m.springs:
        (near, far), pull = spring.ends, spring_pull(motion, spring, inertia)
        add(*near, pull)
        add(*far, -pull)


def load_now(motion: Motion, load: Load, grip: np.ndarray | float = 1.0) -> tuple[Vectors, np.ndarray | float]:
    """Force (N, x + iy) and torque (N.m) of a load, (N,) or the same throughout; ``grip`` is the share of those that
    oppose the motion.
    """
    m = motion.structure.mechanism

    def time() -> np.ndarray:
        if motion.time is None:
            raise AssemblyError(
                f"{m.name}: the load on {load.body} varies over time, which equilibria at rest, and what is asked over"
                " angles alone, have not",
                remedy="give over = crank_angle, or ask for a driven or released run",
            )
        return motion.time

    force, torque = m.acting(load, Seen(motion.angle, motion.position, motion.velocity, motion.angular_velocity, time))
    return (force * grip, torque * grip) if load.opposes else (force, torque)


def spring_pull(motion: Motion, spring: Spring, moving: bool) -> np.ndarray:
    """Force (N,) N, complex, of a spring on its first point; of its damper too in a linkage that is ``moving``."""
    near, far = spring.ends
    rate = np.asarray(motion.velocity(*far) - motion.velocity(*near) if moving else 0j)
    return np.asarray(spring.pull(motion.position(*far) - motion.position(*near), rate))


def _torques(motion: Motion, inertia: bool, grip: np.ndarray | float) -> np.ndarray:
    """(bodies, N) applied and inertia torques (N.m) on each body."""
    s = motion.structure
    torque = np.zeros((len(s.bodies), motion.theta.size))
    for body in s.mechanism.bodies:
        if inertia:
            torque[s.body_column(body.name)] -= body.moment_of_inertia * motion.angular_acceleration(body.name)
    for load in s.mechanism.loads:
        torque[s.body_column(load.body)] += load_now(motion, load, grip)[1]
    periodic = s.mechanism.periodic_torque
    if periodic is not None:
        torque[s.body_column(s.mechanism.driven)] += periodic.at(motion.theta)
    for joint in s.mechanism.joints:
        if not joint.prismatic and joint.has_law:
            first, second = joint.bodies
            law = joint_law(joint, motion, inertia, grip)
            torque[s.body_column(second)] += law
            torque[s.body_column(first)] -= law
    return torque


def joint_law(joint: Joint, motion: Motion, moving: bool, grip: np.ndarray | float = 1.0) -> np.ndarray:
    """Torque (N.m; prismatic: force, N) of a joint's spring, stops and dry friction on its second body, (N,); of their
    dampers too in a linkage that is ``moving``.
    """
    position, sign = motion.relative(joint), motion.slip_sign(joint)
    if not moving:
        return joint.give(position, np.zeros(1)) - joint.stiction * grip * sign
    rate = motion.slip(joint)
    return joint.give(position, rate) - joint.dry(rate) * grip * sign


def friction_turns(motion: Motion, within: float = 0.0, rough: Collection[str] = ()) -> dict[str, np.ndarray]:
    """Where (N,) the Coulomb friction of each joint that has some, or whose block's corners do (``rough``), lacks a
    direction: its slip reverses ``within`` so many rad of crank angle, of a crank that turns evenly, or of the fastest
    input, of a slide's in lengths of the longest body; with 0, only at the reversal itself.
    """
    rubbing = [joint for joint in motion.structure.mechanism.joints if joint.rubs or joint.name in rough]
    return {j.name: _turns_back(motion, motion.slip(j), motion.slip_acceleration(j), within) for j in rubbing}


def load_turns(motion: Motion, within: float = 0.0) -> dict[str, np.ndarray]:
    """Where (N,) loads that oppose the motion lack a direction, by their body, as :func:`friction_turns`."""
    turning: dict[str, np.ndarray] = {}
    for load in (load for load in motion.structure.mechanism.loads if load.opposes):
        moved = motion.velocity(load.body, load.point), motion.acceleration(load.body, load.point)
        turned = motion.angular_velocity(load.body), motion.angular_acceleration(load.body)
        for acts, rates in ((any(load.force), moved), (load.torque, turned)):
            if acts:
                here = _turns_back(motion, *rates, within)
                turning[load.body] = turning.get(load.body, False) | here
    return turning


def _turns_back(motion: Motion, rate: np.ndarray, bend: np.ndarray, within: float) -> np.ndarray:
    """Where (N,) something's rate reverses ``within`` so many rad, given how that changes (``bend``)."""
    s, crank = motion.structure, motion.pace
    longest = max(body.length for body in s.mechanism.bodies) or 1.0
    sizes = np.array([1.0 if s.unit(i) == "rad" else longest for i in s.inputs])[:, None]
    turns = (np.abs(motion.rates[list(s.inputs)]) / sizes).max(axis=0)
    dead = np.abs(rate) * crank <= DEAD_CENTRE * crank**2
    return np.asarray(dead | (np.abs(rate) * turns <= within * np.abs(bend) if within else False))


def _turning_work(
    motion: Motion, bodies: Sequence[int], riding: Sequence[int], work: np.ndarray, torque: np.ndarray
) -> np.ndarray:
    """Work (N,) of everything on a unit turn of these columns: bodies, and the travels along them."""
    turned = sum(torque[k] for k in bodies) - sum((work[k] * motion.columns[k]).imag for k in (*bodies, *riding))
    return np.asarray(turned)


def _generalised(
    motion: Motion, i: int, work: np.ndarray, torque: np.ndarray, travel_force: Mapping[str, np.ndarray]
) -> np.ndarray:
    """Work (N,) of everything on a unit change of coordinate i."""
    s: Structure = motion.structure
    c = s.coordinates[i]
    if c.bodies:
        return _turning_work(motion, c.bodies, s.turning[i][len(c.bodies) :], work, torque)
    along = motion.columns[s.slide_body[c.column - len(s.bodies)]]
    return (work[c.column] * along).real + travel_force[c.joint]

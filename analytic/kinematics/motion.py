"""Positions, velocities and accelerations of a linkage, for all crank angles at once.

Rates come from differentiating the loop closures once and twice (exactly, not by differences); each Assur group is
solved after the ones it hangs on.  Gaps of joints with clearance enter as known vectors with rates of their own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from analytic.compiled import run
from analytic.kinematics.assembly import Assembly, CrankTable, Walk
from analytic.kinematics.closure import AssemblyError, least, partials
from analytic.kinematics.schedule import Schedule
from analytic.kinematics.structure import Group, Structure
from analytic.mechanism import Joint
from analytic.mechanism.one_line import angles, count, largest, one_line

ANGLES_AT_ONCE = 4096  # crank angles worked on at once: their temporary arrays stay in the processor's cache
DEAD_CENTRE = 1e-12  # of the crank's rate: a smaller rate of a joint (rad/s; prismatic: m/s) is rounding error
# glibc keeps freed memory for the next array, but only up to twice the largest block freed so far; the rest goes back
# to the system and returns page by page, which takes longer than the computation itself.  Freeing 16 MB once raises
# that limit; nothing is written to them.
np.empty(2**21)


@dataclass(frozen=True)
class Gap:
    """Gap of a revolute joint, first pin centre minus second (m, ground frame, x + iy), and its time derivatives; (N,)
    each.
    """

    value: np.ndarray
    rate: np.ndarray | float = 0.0
    acceleration: np.ndarray | float = 0.0

    def part(self, at: slice | np.ndarray) -> Gap:
        """The gap at some of the samples."""
        rate, acceleration = (x[at] if isinstance(x, np.ndarray) else x for x in (self.rate, self.acceleration))
        return Gap(self.value[at], rate, acceleration)

    def __repr__(self) -> str:
        return one_line(self, count(np.size(self.value), "value"), largest(self.value, "m"))


@dataclass(frozen=True)
class Motion:
    """A linkage in motion at N crank angles; arrays are (N,), vectors complex in the ground frame."""

    assembly: Assembly
    theta: np.ndarray  # rad, of the driven body; the first input (rad, m) of several
    coordinates: np.ndarray  # (n, N) angles (rad, continued) and travels (m)
    rates: np.ndarray  # (n, N) rad/s, m/s
    accelerations: np.ndarray  # (n, N)
    columns: np.ndarray  # (n_columns, N) complex, see analytic.kinematics.structure
    column_rates: np.ndarray
    column_accelerations: np.ndarray
    jacobians: Mapping[Group, np.ndarray]  # (unknowns, loops, N) derivative of each group's loops
    displaced: bool = True  # whether joints have gaps; without any the gaps' columns are zero
    time: np.ndarray | None = None  # s since the run's start; None where that is not said

    @property
    def structure(self) -> Structure:
        """The linkage's structure."""
        return self.assembly.structure

    def __repr__(self) -> str:
        return one_line(self, self.structure.mechanism.name, angles(self.theta))

    @property
    def compiled(self) -> bool:
        """Whether compiled code has worked it out."""
        return isinstance(self.jacobians, Jacobians)

    def part(self, block: slice | np.ndarray, live: int | None = None) -> Motion:
        """The motion at some of its crank angles (a slice: views of its arrays; or indices), or only its first
        ``live`` columns.
        """
        u, rates, accelerations = (x[:, block] for x in (self.coordinates, self.rates, self.accelerations))
        columns, turns, bends = (x[:live, block] for x in (self.columns, self.column_rates, self.column_accelerations))
        if self.compiled:
            jacobians: Mapping[Group, np.ndarray] = Jacobians(self.structure, columns)
        else:
            jacobians = {group: jacobian[..., block] for group, jacobian in self.jacobians.items()}
        theta, displaced, time = self.theta[block], self.displaced, None if self.time is None else self.time[block]
        return Motion(self.assembly, theta, u, rates, accelerations, columns, turns, bends, jacobians, displaced, time)

    def position(self, body: str, point: str = "com") -> np.ndarray:
        """Position (m) of a body's point."""
        return self.assembly.form(body, point) @ self.columns

    def velocity(self, body: str, point: str = "com") -> np.ndarray:
        """Velocity (m/s) of a body's point."""
        return self.assembly.form(body, point) @ self.column_rates

    def acceleration(self, body: str, point: str = "com") -> np.ndarray:
        """Acceleration (m/s^2) of a body's point."""
        return self.assembly.form(body, point) @ self.column_accelerations

    def angle(self, body: str) -> np.ndarray:
        """Angle (rad) of a body, continued from the assembly angle."""
        return self._turn(self.coordinates, body) + self.structure.held_at[self.structure.body_column(body)]

    def angular_velocity(self, body: str) -> np.ndarray:
        """Angular velocity (rad/s) of a body."""
        return self._turn(self.rates, body)

    def angular_acceleration(self, body: str) -> np.ndarray:
        """Angular acceleration (rad/s^2) of a body."""
        return self._turn(self.accelerations, body)

    def relative(self, joint: Joint) -> np.ndarray:
        """Angle of a joint's second body on its first (rad), or its travel (m)."""
        if joint.prismatic:
            return np.asarray(self.coordinates[self._slide(joint)])
        first, second = joint.bodies
        return self.angle(second) - self.angle(first)

    def play(self, joint: Joint) -> tuple[np.ndarray, np.ndarray]:
        """How far (m, x + iy) a prismatic joint's first point lies off its second, normal to the axis, and the angle
        (rad) of the guide on its first body less the block's.
        """
        first, second = joint.bodies
        normal = 1j * joint.direction * self.columns[self.structure.body_column(first)]
        apart = self.position(first, joint.name) - self.position(second, joint.name)
        return (apart * np.conj(normal)).real * normal, self.angle(first) + joint.angle - self.angle(second)

    def slip(self, joint: Joint) -> np.ndarray:
        """Rate (N,) of a joint's second body on its first: rad/s, or m/s."""
        if joint.prismatic:
            return np.asarray(self.rates[self._slide(joint)])
        first, second = joint.bodies
        return self.angular_velocity(second) - self.angular_velocity(first)

    def slip_acceleration(self, joint: Joint) -> np.ndarray:
        """Acceleration (N,) of a joint's second body on its first: rad/s^2, or m/s^2."""
        if joint.prismatic:
            return np.asarray(self.accelerations[self._slide(joint)])
        first, second = joint.bodies
        return self.angular_acceleration(second) - self.angular_acceleration(first)

    def slip_sign(self, joint: Joint) -> np.ndarray:
        """The sign (N,) of a joint's slip, against which friction acts; 0 at a dead centre of the joint."""
        rate = self.slip(joint)
        return np.asarray(np.sign(rate) * (np.abs(rate) > DEAD_CENTRE * np.abs(self.pace)))

    @property
    def pace(self) -> np.ndarray:
        """The fastest input's rate (N,), its size: rad/s, or m/s."""
        return np.abs(self.rates[list(self.structure.inputs)]).max(axis=0)

    def _slide(self, joint: Joint) -> int:
        return next(i for i, c in enumerate(self.structure.coordinates) if c.joint == joint.name and not c.bodies)

    def _turn(self, values: np.ndarray, body: str) -> np.ndarray:
        turned = self.structure.turned[self.structure.body_column(body)]
        if len(turned) == 1:
            return values[turned[0]]
        return values[list(turned)].sum(axis=0)  # zero of the ground, or a body that slides hold parallel to it


@dataclass(frozen=True)
class Pieced(Motion):
    """A motion whose samples are of several assemblies of one linkage, in which its blocks rest differently in their
    guides; ``pieces`` are each one's samples (indices) and motion.  Its own arrays are theirs, in order.
    """

    pieces: Sequence[tuple[np.ndarray, Motion]] = ()

    @classmethod
    def of(cls, assembly: Assembly, pieces: Sequence[tuple[np.ndarray, Motion]]) -> Pieced:
        """The motion that these pieces make up."""
        n = sum(where.size for where, _ in pieces)

        def whole(array: Callable[[Motion], np.ndarray]) -> np.ndarray:
            return joined([(where, array(motion)) for where, motion in pieces], n)

        coordinates = whole(lambda m: m.coordinates), whole(lambda m: m.rates), whole(lambda m: m.accelerations)
        columns = whole(lambda m: m.columns), whole(lambda m: m.column_rates), whole(lambda m: m.column_accelerations)
        jacobians = Jacobians(assembly.structure, columns[0])
        times = [(where, motion.time) for where, motion in pieces if motion.time is not None]
        time = joined(times, n) if times else None
        return cls(assembly, whole(lambda m: m.theta), *coordinates, *columns, jacobians, True, time, pieces)

    @property
    def compiled(self) -> bool:
        """Whether compiled code has found it: its pieces perhaps, their sum never."""
        return False

    def position(self, body: str, point: str = "com") -> np.ndarray:
        """Position (m) of a body's point."""
        return self._joined(lambda m: m.position(body, point))

    def velocity(self, body: str, point: str = "com") -> np.ndarray:
        """Velocity (m/s) of a body's point."""
        return self._joined(lambda m: m.velocity(body, point))

    def acceleration(self, body: str, point: str = "com") -> np.ndarray:
        """Acceleration (m/s^2) of a body's point."""
        return self._joined(lambda m: m.acceleration(body, point))

    def angle(self, body: str) -> np.ndarray:
        """Angle (rad) of a body, continued from the assembly angle."""
        return self._joined(lambda m: m.angle(body))

    def _joined(self, of: Callable[[Motion], np.ndarray]) -> np.ndarray:
        return joined([(where, of(motion)) for where, motion in self.pieces], self.theta.size)


def joined(parts: Sequence[tuple[np.ndarray, np.ndarray]], n: int) -> np.ndarray:
    """An array (..., n) of which each part (..., k) holds the samples with those indices (k,)."""
    first = parts[0][1]
    out = np.empty((*first.shape[:-1], n), first.dtype)
    for where, values in parts:
        out[..., where] = values
    return out


class Jacobians(Mapping[Group, np.ndarray]):
    """Derivatives of each group's loops (unknowns, loops, N), found from a motion's columns when they are asked for."""

    def __init__(self, s: Structure, columns: np.ndarray) -> None:
        self.s, self.columns = s, columns

    def __getitem__(self, group: Group) -> np.ndarray:
        rows = self.s.loops[list(group.loops), : len(self.columns)]
        derivatives = [partials(self.s, i, rows, self.columns) for i in group.coordinates]
        return np.array(derivatives).reshape(len(group.coordinates), len(group.loops), self.columns.shape[1])

    def __iter__(self) -> Iterator[Group]:
        return iter(self.s.groups)

    def __len__(self) -> int:
        return len(self.s.groups)


def kinematics(
    assembly: Assembly,
    theta: np.ndarray,
    omega: np.ndarray | float = 0.0,
    alpha: np.ndarray | float = 0.0,
    gaps: Mapping[str, Gap] | None = None,
    path: CrankTable | Walk | None = None,
    time: np.ndarray | None = None,
) -> Motion:
    """Motion at crank angles theta (N,) rad, angular velocity omega (rad/s) and acceleration alpha (rad/s^2), at times
    (N,) s if loads are to vary over it.

    With several inputs all three are (n_inputs, N), in the structure's order and signs
    (:meth:`analytic.kinematics.assembly.Assembly.inputs_at`), and the samples follow one another.
    Large batches, and many calls, are carried out by compiled code (:func:`analytic.compiled.run.serves`), all others
    by :func:`kinematics_by_numpy`; they differ by rounding.
    Raises AssemblyError at a change point or an angle that cannot be reached.
    """
    given = np.asarray(theta, float)
    if run.serves(assembly, given.shape[-1] if given.ndim else 1):
        inputs = given if given.ndim == 2 else given.reshape(1, -1)
        opened = {name: (gap.value, gap.rate, gap.acceleration) for name, gap in (gaps or {}).items()}
        moved = run.moved(assembly, inputs, (omega, alpha), opened, path)
        if moved is not None:
            s, ((u, rates, accelerations), (columns, turns, bends)) = assembly.structure, moved
            jacobians, theta = Jacobians(s, columns), u[s.inputs[0]]
            return Motion(
                assembly, theta, u, rates, accelerations, columns, turns, bends, jacobians, bool(opened), time
            )  # fmt: skip
    return kinematics_by_numpy(assembly, theta, omega, alpha, gaps, path, time)


def along(assembly: Assembly, schedule: Schedule) -> Motion:
    """The ideal linkage at the instants of a schedule in which nothing moves freely.  Raises AssemblyError."""
    inputs, time = assembly.inputs_along(schedule), None if schedule.at_rest else schedule.time
    return kinematics(assembly, inputs.theta, inputs.omega, inputs.alpha, path=assembly.walk(schedule), time=time)


def kinematics_by_numpy(
    assembly: Assembly,
    theta: np.ndarray,
    omega: np.ndarray | float = 0.0,
    alpha: np.ndarray | float = 0.0,
    gaps: Mapping[str, Gap] | None = None,
    path: CrankTable | Walk | None = None,
    time: np.ndarray | None = None,
) -> Motion:
    """What :func:`kinematics` gives, by numpy alone: what the compiled code is held against, and says what is wrong."""
    s = assembly.structure
    u, columns = assembly.open(theta, {name: gap.value for name, gap in (gaps or {}).items()})
    n = u.shape[1]
    near = assembly.near(u, path)
    drive = (np.broadcast_to(np.atleast_2d(x), (len(s.inputs), n)) for x in (omega, alpha))
    speed, push = drive
    rates, bends = (_gap_columns(s, gaps, order, n) for order in ("rate", "acceleration"))
    jacobians = {g: np.empty((len(g.coordinates), len(g.loops), n), complex) for g in s.groups}
    motion = Motion(
        assembly,
        u[s.inputs[0]],
        u,
        np.empty_like(u),
        np.empty_like(u),
        columns,
        rates,
        bends,
        jacobians,
        bool(gaps),
        time,
    )
    live = s.n_columns if gaps else len(s.bodies) + len(s.slides)  # without gaps their columns stay untouched
    for block in blocks(n):
        part = motion.part(block, live)
        here = near.part(block) if isinstance(near, Walk) else near
        assembly.close(part.coordinates, part.columns, here, bool(gaps))
        _set_in_motion(part, speed[:, block], push[:, block])
    return motion


def blocks(n: int) -> Iterator[slice]:
    """Slices of at most ANGLES_AT_ONCE crank angles that make up n."""
    return (slice(i, min(i + ANGLES_AT_ONCE, n)) for i in range(0, n, ANGLES_AT_ONCE))


def _set_in_motion(motion: Motion, omega: np.ndarray, alpha: np.ndarray) -> None:
    """Fill in the rates and accelerations (and the loops' Jacobians) of a motion whose positions are known, gaps'
    included.
    """
    s, columns, rates, spin = motion.structure, motion.columns, motion.column_rates, motion.rates
    for group, jacobian in motion.jacobians.items():
        for k, i in enumerate(group.coordinates):
            jacobian[k] = partials(s, i, s.loops[list(group.loops)], columns)
    _differentiate(motion, omega, spin, rates)
    centripetal = motion.column_accelerations
    for b, turned in enumerate(s.turned):
        if not turned:
            continue
        turns = spin[turned[0]] if len(turned) == 1 else spin[list(turned)].sum(axis=0)
        riding = s.riding((b,))
        for k in (b, *riding):
            centripetal[k] -= turns**2 * columns[k]
        for k in riding:  # Coriolis: twice the spin times the sliding
            centripetal[k] += 2j * turns * (rates[k] - 1j * turns * columns[k])
    _differentiate(motion, alpha, motion.accelerations, centripetal)


def _gap_columns(s: Structure, gaps: Mapping[str, Gap] | None, order: str, n: int) -> np.ndarray:
    columns = np.zeros((s.n_columns, n), complex)
    for name, gap in (gaps or {}).items():
        columns[s.gap_column(name)] = getattr(gap, order)
    return columns


def _differentiate(motion: Motion, driven: np.ndarray, result: np.ndarray, out: np.ndarray) -> None:
    """Solve the differentiated loop closures for the coordinates' derivatives (n, N) and the columns' (n_columns, N),
    in place.

    ``out`` holds what is known of the columns' derivatives already.
    """
    s = motion.structure
    for i, value in zip(s.inputs, driven, strict=True):
        result[i] = value
        _spread(motion, i, value, out)
    for group, jacobian in motion.jacobians.items():
        solved = solve_loops(jacobian, s.loops[list(group.loops), : len(out)] @ out, s, group)
        for i, value in zip(group.coordinates, solved, strict=True):
            result[i] = value
            _spread(motion, i, value, out)


def _spread(motion: Motion, i: int, value: np.ndarray, out: np.ndarray) -> None:
    """Add to ``out`` what a rate of coordinate i does to the columns."""
    s, columns, c = motion.structure, motion.columns, motion.structure.coordinates[i]
    if c.bodies:
        for k in s.turning[i]:
            out[k] += 1j * value * columns[k]
    else:
        out[c.column] += value * columns[s.slide_body[c.column - len(s.bodies)]]


def solve_loops(jacobian: np.ndarray, right: np.ndarray, s: Structure, group: Group) -> np.ndarray:
    """Unknown rates x (unknowns, N) with ``sum_i jacobian[i] x_i + right = 0`` for each loop (loops, N), complex."""
    if not len(jacobian):
        return np.zeros((0, right.shape[1]))
    if jacobian.shape[:2] == (2, 1):
        a, b, r = jacobian[0, 0], jacobian[1, 0], right[0]
        c = cross(a, b)
        if not np.all(c):
            raise _singular(s, group)
        return np.array([cross(b, r) / c, cross(r, a) / c])
    matrix = np.concatenate([jacobian.real, jacobian.imag], axis=1).transpose(2, 1, 0)
    try:
        return -least(matrix, np.concatenate([right.real, right.imag]).T).T
    except np.linalg.LinAlgError:
        raise _singular(s, group) from None


def solve_forces(jacobian: np.ndarray, work: np.ndarray, s: Structure, group: Group) -> np.ndarray:
    """Closing forces (loops, N), complex, whose work with the generalised forces ``work`` (unknowns, N) vanishes; the
    smallest, where loops are more than needed.
    """
    if jacobian.shape[:2] == (2, 1):
        a, b = jacobian[0, 0], jacobian[1, 0]
        return (1j * (work[0] * b - work[1] * a) / cross(a, b))[None]
    n = len(group.loops)
    if not len(jacobian):
        return np.zeros((n, work.shape[1]), complex)
    matrix = np.concatenate([jacobian.real, jacobian.imag], axis=1).transpose(2, 0, 1)
    if group.surplus:
        q, r = np.linalg.qr(matrix.swapaxes(1, 2))
        solved = -(q @ np.linalg.solve(r.swapaxes(1, 2), work.T[..., None]))[..., 0].T
    else:
        solved = -np.linalg.solve(matrix, work.T[..., None])[..., 0].T
    return solved[:n] + 1j * solved[n:]


def self_stresses(jacobian: np.ndarray, group: Group) -> np.ndarray:
    """Closing forces (surplus, loops, N), complex, that do no work on the group's own coordinates: what nothing
    determines of them.
    """
    n = len(group.loops)
    matrix = np.concatenate([jacobian.real, jacobian.imag], axis=1).transpose(2, 1, 0)  # (N, 2 loops, unknowns)
    q, _ = np.linalg.qr(matrix, mode="complete")
    idle = q[:, :, len(jacobian) :].transpose(2, 1, 0)
    return np.asarray(idle[:, :n] + 1j * idle[:, n:])


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """z component of the cross product of two planar vectors x + iy."""
    return a.real * b.imag - a.imag * b.real


def _singular(s: Structure, group: Group) -> AssemblyError:
    return AssemblyError(
        f"{s.mechanism.name}: {' and '.join(group.bodies)} are at a change point; keep the crank angles clear of it"
    )

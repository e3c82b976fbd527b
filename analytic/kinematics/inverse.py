"""The inverse problem: where must the inputs be for a platform to be where it is wanted?

All coordinates are sought together, so that the loops close and the platform is where it is wanted: Newton's method,
from the assembly on and from one wanted pose to the next: the assembly's angles pick the working mode.  Where the
derivative of all that is singular the platform cannot move as wanted whatever its drives do (a singularity of the first
kind: a leg stretched or folded); where the loops' own by the coordinates that are no inputs is, its drives do not hold
it (of the second kind), which is the assembly's change point.

At a singular pose of the first kind two working modes meet, and a path through it, which touches the end of what is
reached and turns back, does not say in which of them it goes on.  Such a pose is refused wherever it is on the path:
that it lies between two wanted poses shows in how little the platform moves beside it (:func:`passes_zero`).  A pose of
the second kind is where a group's derivative loses its orientation: the path goes on there, and its drives turn back or
stand still.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from analytic.kinematics.assembly import CHANGE_POINT, PATH_STEP, STRIDES, Assembly, AssemblyError, Followed, locks
from analytic.kinematics.closure import AGREE, partials, regularity
from analytic.kinematics.motion import Motion
from analytic.kinematics.structure import Group

PASSES = 30
SETTLED = 1e-13  # of the platform's size, or rad
SINGULAR = 1e-6  # of the platform's size per rad: a pose that is settled is this near to one at which it cannot move
WITHIN = "keep the path within reach"
CLEAR = "keep the path clear of it, or give a course of the drives instead"


@dataclass(frozen=True)
class Coordinate:
    """What is wanted of a platform: x or y (m, ground frame) of a point of it, or its angle (rad)."""

    body: str
    axis: Literal["x", "y", "angle"]
    point: str = "com"

    @property
    def name(self) -> str:
        """``platform_x`` as in the signals, ``left-arm.P_x`` of another point."""
        return f"{self.body if self.point == 'com' else f'{self.body}.{self.point}'}_{self.axis}"

    def value(self, motion: Motion) -> np.ndarray:
        """It (N,) in a motion."""
        if self.axis == "angle":
            return motion.angle(self.body)
        place = motion.position(self.body, self.point)
        return place.real if self.axis == "x" else place.imag


def inverse(
    assembly: Assembly, wanted: Sequence[Coordinate], poses: np.ndarray, time: np.ndarray | None = None
) -> Followed:
    """Coordinates (n, N) at which the ``wanted``, as many as the linkage has inputs, are at ``poses`` (n_inputs, N),
    which are instants of one motion, at ``time`` (N,) s or evenly apart.

    Raises AssemblyError with the pose where it cannot be reached, or is singular.
    """
    return _Inverse(assembly, wanted).followed(np.asarray(poses, float), time)


def passes_zero(time: np.ndarray, sizes: np.ndarray) -> tuple[int, float] | None:
    """Between which samples (the earlier one's index) a quantity passes through zero, and where between them (0 to 1),
    of which only the ``sizes`` (N,) are known; None where it does not.

    Its square is smooth, whether it passes zero or turns back before.  Polynomials through the six samples about an
    interval say what it is in the middle of that either way, and what its square is: the one that agrees is right.
    """
    for k in range(time.size - 1):
        first = min(max(k - 2, 0), max(time.size - 6, 0))
        near, at = sizes[first : first + 6], (time[first : first + 6] - time[k]) / (time[k + 1] - time[k])
        weights = np.linalg.solve(np.vander(at).T, np.vander([0.5], at.size)[0])
        back, on, square = (weights @ x for x in (near, near * np.where(at > 0.5, -1.0, 1.0), near**2))
        if abs(on**2 - square) < abs(back**2 - square):
            return k, float(sizes[k] / (sizes[k] + sizes[k + 1]))
    return None


class Posed:
    """A linkage's loops and the ``wanted`` coordinates of its platform, as functions of all of its coordinates."""

    def __init__(self, assembly: Assembly, wanted: Sequence[Coordinate]) -> None:
        self.s, self.assembly, self.wanted = assembly.structure, assembly, tuple(wanted)
        self.size = max(body.length for body in assembly.mechanism.bodies) or 1.0

    def pose(self, columns: np.ndarray, u: np.ndarray) -> np.ndarray:
        """The wanted coordinates (wanted, N) at columns and coordinates."""
        out = []
        for w in self.wanted:
            b = self.s.body_column(w.body)
            if w.axis == "angle":
                out.append(u[list(self.s.turned[b])].sum(axis=0) + self.s.held_at[b])
            else:
                z = self.assembly.form(w.body, w.point) @ columns
                out.append(z.real if w.axis == "x" else z.imag)
        return np.array(out)

    def slopes(self, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of the loops (N, 2 loops, n) and of the pose (N, wanted, n) by all coordinates."""
        s, n = self.s, columns.shape[1]
        loops = np.stack([partials(s, i, s.loops, columns) for i in range(len(s.coordinates))], axis=-1)
        pose = np.zeros((n, len(self.wanted), len(s.coordinates)))
        for row, w in enumerate(self.wanted):
            if w.axis == "angle":
                pose[:, row, list(s.turned[s.body_column(w.body)])] = 1.0
                continue
            form = self.assembly.form(w.body, w.point)[None]
            for i in range(len(s.coordinates)):
                moved = partials(s, i, form, columns)[0]
                pose[:, row, i] = moved.real if w.axis == "x" else moved.imag
        return np.concatenate([loops.real, loops.imag]).transpose(1, 0, 2), pose

    def rows(self, group: Group) -> list[int]:
        """Where a group's loops are among the derivatives of all of them."""
        return [*group.loops, *(len(self.s.loops) + k for k in group.loops)]

    def own(self, group: Group, loops: np.ndarray) -> np.ndarray:
        """Derivatives (N, 2 loops, unknowns) of a group's loops by its own coordinates, of those of all."""
        return loops[:, self.rows(group)][:, :, list(group.coordinates)]


class _Inverse(Posed):
    """Walks a platform from pose to pose; ``near`` (n, 1) are the coordinates where it is, ``loops`` (1, 2 loops, n)
    the loops' derivatives there.
    """

    def __init__(self, assembly: Assembly, wanted: Sequence[Coordinate]) -> None:
        super().__init__(assembly, wanted)
        s = self.s
        if len(wanted) != len(s.inputs):
            raise AssemblyError(
                f"{assembly.mechanism.name}: {len(wanted)} wanted coordinates ({', '.join(w.name for w in wanted)}) and"
                f" {len(s.inputs)} inputs ({', '.join(assembly.positions)}); give as many as there are inputs"
            )
        self.near = assembly.follow(assembly.inputs[:, None]).coordinates
        columns = assembly.columns(self.near)
        self.at, self.loops = self.pose(columns, self.near)[:, 0], self.slopes(columns)[0]
        self.unit = np.array([1.0 if w.axis == "angle" else self.size for w in wanted])
        self.reach = np.array([1.0 if s.unit(i) == "rad" else self.size for i in s.inputs])
        self.stride = np.where([w.axis == "angle" for w in wanted], PATH_STEP, self.size / STRIDES)

    def followed(self, poses: np.ndarray, time: np.ndarray | None) -> Followed:
        """Coordinates (n, N) at poses (n_inputs, N), of which each may have a time (s)."""
        found, sizes = [], []
        for row, pose in enumerate(poses.T):
            before = self.at
            steps = max(1, int(np.ceil(np.abs((pose - before) / self.stride).max() - 1e-9)))
            for k in range(1, steps + 1):
                ways = self.step_to(before + (pose - before) * k / steps, time, row - 1 + (k - 1) / steps, 1 / steps)
            found.append(self.near[:, 0])
            sizes.append(1.0 / np.linalg.norm(ways, axis=1))  # nothing where that input's leg is stretched or folded
        for size in np.array(sizes).T:
            passed = passes_zero(np.arange(len(sizes)) if time is None else time, size)
            if passed is not None:
                k, part = passed
                what = "is singular, or the path's rows are too far apart to tell that it is not: two ways to go on"
                pose = poses[:, k] + part * (poses[:, k + 1] - poses[:, k])
                raise self.failed(pose, f"{_told(time, k + part)}{what} meet there")
        return Followed(np.stack(found, axis=1))

    def step_to(self, pose: np.ndarray, time: np.ndarray | None, row: float, share: float) -> np.ndarray:
        """Go to a pose (n_inputs,) near by, a ``share`` of a row further than ``row``; how the inputs go there, as
        :meth:`to` says it.  Raises AssemblyError for a singular pose of the second kind on the way.
        """
        before, loops = self.at, self.loops
        ways = self.to(pose, _told(time, row + share))
        for group in self.s.groups:
            if not group.coordinates:
                continue
            was, now = (self.own(group, x) for x in (loops, self.loops))
            far, near = (abs(regularity(self.s, group, x)[0]) for x in (was, now))
            if near**2 < CHANGE_POINT or np.linalg.det(was[0].T @ now[0]) < 0:
                part = far / (far + near)
                when = _told(time, row + part * share)
                what = f"{when}is singular: {locks(group)}, and the drives do not hold it there"
                raise self.failed(before + part * (pose - before), what, "keep the path clear of it")
        return ways

    def to(self, pose: np.ndarray, when: str) -> np.ndarray:
        """Go to a pose (n_inputs,) near by; how far (inputs, wanted) its inputs go there, in their own units, by a unit
        of each wanted coordinate.  ``when`` is part of what is said where it fails.
        """
        s, u, groups = self.s, self.near.copy(), [g for g in self.s.groups if g.coordinates]
        arms, units = np.abs(s.loops[:, : len(s.bodies)]).sum(axis=1).max(initial=0.0), np.diag(self.unit)
        for _ in range(PASSES):
            columns = self.assembly.columns(u)
            loops, slope = self.slopes(columns)
            gap, miss = s.loops @ columns, self.pose(columns, u)[:, 0] - pose
            open_by = np.concatenate([gap.real, gap.imag])[:, 0]
            sides = [(np.linalg.qr(self.own(g, loops)[0])[0].T, self.rows(g)) for g in groups]  # what its own can close
            matrix = np.concatenate([*(q @ loops[0, rows] for q, rows in sides), slope[0]])
            left = np.concatenate([*(q @ open_by[rows] for q, rows in sides), miss])
            right = np.vstack([np.zeros((left.size - miss.size, miss.size)), units])
            try:
                found = np.linalg.solve(matrix, np.column_stack([left, right]))
                ways = found[list(s.inputs), 1:] / self.reach[:, None]
                far = np.linalg.svd(ways, compute_uv=False)[0]
            except np.linalg.LinAlgError:
                far = np.inf
            if not far * SINGULAR < 1.0:
                raise self.failed(pose, f"{when}is singular: the platform cannot move on, whatever its drives do")
            close = arms + np.abs(columns[len(s.bodies) : len(s.bodies) + len(s.slides)]).sum()
            closed = np.all(np.abs(left[: -miss.size]) <= SETTLED * close) and np.all(np.abs(open_by) <= AGREE * close)
            if closed and np.all(np.abs(miss) <= SETTLED * self.unit):
                self.near, self.at, self.loops = u, pose, loops
                return np.asarray(ways)
            u = u - found[:, :1]
        raise self.failed(pose, f"{when}cannot be reached: no position of the drives has it there", WITHIN)

    def failed(self, pose: np.ndarray, what: str, remedy: str = CLEAR) -> AssemblyError:
        told = [
            f"{w.name} = {np.degrees(x):.6g} deg" if w.axis == "angle" else f"{w.name} = {1e3 * x:.6g} mm"
            for w, x in zip(self.wanted, pose, strict=True)
        ]
        return AssemblyError(
            f"{self.assembly.mechanism.name}: {', '.join(told)} {what}",
            remedy=remedy,
        )


def _told(time: np.ndarray | None, row: float) -> str:
    """When (s) it is a share of the way beyond a row, in words; nothing before the first, or where nobody knows."""
    return "" if time is None or row < 0 else f"at {np.interp(row, np.arange(time.size), time):.6g} s "

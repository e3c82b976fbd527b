"""Where a platform can go: the poses of a grid that it reaches from the assembly, in the same assembly and working
mode.

All coordinates are sought together, so that the loops close and the platform is where it is wanted: Newton's method, on
all cells beside those that are known at the same time, from theirs, in steps that do not depend on how fine the grid
is.  A cell counts as reached if no singular pose lies between it and its neighbour: the derivatives of the loops
(second kind) and of the whole (first kind) keep their orientation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analytic.kinematics.assembly import Assembly, AssemblyError, Walk
from analytic.kinematics.closure import least
from analytic.kinematics.inverse import Posed, inverse
from analytic.kinematics.output import Output
from analytic.mechanism.one_line import count, one_line
from analytic.mechanism.signals import wrapped

CELL_PASSES = 12  # of Newton's method
CELL_SETTLED = 1e-12  # of a coordinate: rad, or of the linkage's size
LARGEST_JUMP = 1.0  # rad, or of the linkage's size; a cell that is farther from its neighbour is on another branch
STRIDE = 0.05  # of the linkage's size: how far a step goes at most
STARTS = 25  # cells near the assembly's pose that are tried as the first


@dataclass(frozen=True)
class Workspace:
    """A grid of places x (nx,) and y (ny,) m of a platform, at an angle (rad; None where it has no say in it).

    ``reached`` (ny, nx) says which of them it reaches, ``coordinates`` (n, M) are the structure's there, row by row.
    """

    x: np.ndarray
    y: np.ndarray
    angle: float | None
    reached: np.ndarray
    coordinates: np.ndarray

    def __repr__(self) -> str:
        return one_line(self, f"{count(int(self.reached.sum()), 'pose')} reached of {self.reached.size}")

    @property
    def followed(self) -> Walk:
        """The reached poses as samples."""
        return Walk(self.coordinates)

    def on_grid(self, values: np.ndarray) -> np.ndarray:
        """Values (M,) of the reached poses on the whole grid (ny * nx,), NaN elsewhere."""
        out = np.full(self.reached.size, np.nan)
        out[self.reached.ravel()] = values
        return out


def workspace(
    assembly: Assembly, wanted: Sequence[Output], x: np.ndarray, y: np.ndarray, angle: float | None = None
) -> Workspace:
    """The poses that a platform reaches of a grid; ``wanted`` are its x, its y and, of three inputs, its angle.

    ``angle`` (rad) is by default that of the assembly.  Raises AssemblyError where it reaches none, or the inputs are
    neither two nor three.
    """
    axes = [w.axis for w in wanted]
    if len(assembly.structure.inputs) != len(wanted) or axes not in (["x", "y"], ["x", "y", "angle"]):
        raise AssemblyError(
            f"{assembly.mechanism.name}: has {count(len(assembly.structure.inputs), 'input')}; a workspace is of two"
            " (a point's x and y) or three (and an angle)"
        )
    return _Flood(assembly, wanted, x, y, angle).filled()


class _Flood(Posed):
    def __init__(
        self, assembly: Assembly, wanted: Sequence[Output], x: np.ndarray, y: np.ndarray, angle: float | None
    ) -> None:
        super().__init__(assembly, wanted)
        home = assembly.follow(assembly.inputs[:, None]).coordinates
        pose = self.pose(assembly.columns(home), home)[:, 0]
        self.home, self.angle = pose, None
        if len(wanted) == 3:  # the turn nearest to the assembly's
            self.angle = pose[2] + (0.0 if angle is None else float(wrapped(np.array(angle - pose[2]))))
        self.x, self.y = x, y
        rows, columns = np.meshgrid(y, x, indexing="ij")
        self.poses = np.array([columns.ravel(), rows.ravel()])
        if self.angle is not None:
            self.poses = np.vstack([self.poses, np.full(self.poses.shape[1], self.angle)])
        self.unit = np.array([1.0 if c.bodies else self.size for c in self.s.coordinates])
        apart = max(float(np.ptp(line)) / max(line.size - 1, 1) for line in (x, y))
        self.parts = max(1, math.ceil(apart / (STRIDE * self.size) - 1e-9))

    def filled(self) -> Workspace:
        """The grid, cell by cell from the first."""
        n = self.poses.shape[1]
        u, known = np.full((len(self.s.coordinates), n), np.nan), np.zeros(n, bool)
        first, u[:, first] = self.first()
        known[first] = True
        front = np.array([first])
        while front.size:
            cells, near = self.beside(front, known)
            if not cells.size:
                break
            coordinates, good = self.walked(self.poses[:, near], self.poses[:, cells], u[:, near])
            front, once = np.unique(cells[good], return_index=True)
            u[:, front], known[front] = coordinates[:, good][:, once], True
        shape = self.y.size, self.x.size
        return Workspace(self.x, self.y, self.angle, known.reshape(shape), u[:, known])

    def first(self) -> tuple[int, np.ndarray]:
        """A cell near the assembly's pose that is reached from there, and its coordinates (n,).  Raises AssemblyError
        where none is.
        """
        far = np.hypot(*(self.poses[:2] - self.home[:2, None]))
        error: AssemblyError | None = None
        for cell in np.argsort(far, kind="stable")[:STARTS].tolist():
            try:
                return cell, inverse(self.assembly, self.wanted, self.poses[:, cell : cell + 1]).coordinates[:, 0]
            except AssemblyError as failed:
                error = error or failed
        raise AssemblyError(
            f"{self.assembly.mechanism.name}: no place of the grid near where it is assembled can be reached ({error})",
            remedy="give a grid around the assembly's pose, or another angle",
        )

    def beside(self, front: np.ndarray, known: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Cells beside the front that are not known yet, and which of the front each is beside."""
        nx, ny = self.x.size, self.y.size
        row, column = np.divmod(front, nx)
        cells, near = [], []
        for down, right in ((0, 1), (0, -1), (1, 0), (-1, 0)):
            r, c = row + down, column + right
            inside = (r >= 0) & (r < ny) & (c >= 0) & (c < nx)
            there = (r * nx + c)[inside]
            new = ~known[there]
            cells.append(there[new])
            near.append(front[inside][new])
        return np.concatenate(cells), np.concatenate(near)

    def walked(self, start: np.ndarray, end: np.ndarray, near: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates (n, N) at poses ``end`` (wanted, N), gone to from ``start`` and its coordinates, and whether (N,)
        that is possible.
        """
        good = np.ones(end.shape[1], bool)
        for k in range(1, self.parts + 1):
            coordinates, fine = self.closed(start + (end - start) * k / self.parts, near)
            coordinates = np.where(fine, coordinates, near)
            good &= fine & self.same(coordinates, near)
            near = coordinates
        return near, good

    def closed(self, poses: np.ndarray, near: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates (n, N) at poses (wanted, N) near others, and whether (N,) they are."""
        u = near.copy()
        for _ in range(CELL_PASSES):
            columns = self.assembly.columns(u)
            open_by, (loops, slope) = self.s.loops @ columns, self.slopes(columns)
            miss = np.concatenate([open_by.real, open_by.imag, self.pose(columns, u) - poses]).T
            with np.errstate(all="ignore"):
                step = self.step(np.concatenate([loops, slope], axis=1), miss)
            u = u - step.T
            last = np.abs(step).T / self.unit[:, None]
            if not np.any(last > CELL_SETTLED):
                break
        jump = np.abs(u - near) / self.unit[:, None]
        return u, np.all(last <= 1e3 * CELL_SETTLED, axis=0) & np.all(jump <= LARGEST_JUMP, axis=0)

    def step(self, matrix: np.ndarray, miss: np.ndarray) -> np.ndarray:
        """Newton's step (N, n); far beyond any jump where a matrix is singular."""
        try:
            return least(matrix, miss)
        except np.linalg.LinAlgError:
            return np.einsum("nij,nj->ni", np.linalg.pinv(matrix), miss)

    def same(self, u: np.ndarray, near: np.ndarray) -> np.ndarray:
        """Whether (N,) no singular pose lies between coordinates (n, N) and others near by.

        A matrix A with as many columns as its rank and B near by have det(A'B) > 0, until a singular one comes between.
        """
        (loops, slope), (loops0, slope0) = (self.slopes(self.assembly.columns(x)) for x in (u, near))
        whole, whole0 = np.concatenate([loops, slope], axis=1), np.concatenate([loops0, slope0], axis=1)
        groups = [g for g in self.s.groups if g.coordinates]
        pairs = [*((self.own(g, loops), self.own(g, loops0)) for g in groups), (whole, whole0)]
        return np.all([np.linalg.det(a.transpose(0, 2, 1) @ b) > 0 for a, b in pairs], axis=0)

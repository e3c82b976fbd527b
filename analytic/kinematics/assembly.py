"""Positions of a linkage: closed at every crank angle, in the assembly mode that the mechanism file picks.

Dyads are solved in closed form, larger Assur groups by Newton's method along the path from the assembly angle.  The
assembly mode is followed continuously: where a group stretches or folds (a change point) or cannot close at all,
:class:`AssemblyError` says which crank angle and why.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from analytic.kinematics.closure import AssemblyError, newton, set_coordinate, solve_dyad, with_travels
from analytic.kinematics.structure import Coordinate, Group, Structure, structure
from analytic.mechanism import Mechanism
from analytic.mechanism.one_line import angles, one_line
from analytic.mechanism.signals import continued, turned_near, wrapped

PATH_STEP = np.radians(1.0)  # crank angle between checks for change points
CHANGE_POINT = 1e-10  # sin^2 between the two sides of a group below which it counts as stretched or folded
ASSEMBLY_SLACK = np.radians(45.0)  # how far the file's approximate angles may be off


@dataclass(frozen=True)
class Path:
    """Angles of the coordinates along the crank's range, continued from the assembly angle."""

    theta: np.ndarray  # (M,) rad, increasing
    coordinates: np.ndarray  # (n_coordinates, M)

    def __repr__(self) -> str:
        return one_line(self, angles(self.theta))

    def near(self, theta: np.ndarray) -> np.ndarray:
        """Coordinates (n, N) interpolated at crank angles (N,)."""
        return np.array([np.interp(theta, self.theta, c) for c in self.coordinates])


class Assembly:
    """A linkage closed at its assembly angles.  Raises StructureError or AssemblyError where it cannot be."""

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism = mechanism
        self.structure: Structure = structure(mechanism)
        self.start = mechanism.assembly[mechanism.driven]
        self.turning = tuple(
            _turning(self.structure, c) for c in self.structure.coordinates
        )  # columns that turn with each coordinate
        self._forms: dict[tuple[str, str], np.ndarray] = {}
        self._driven = self.structure.coordinates[0]
        self._branch: dict[Group, float] = {}
        s = self.structure
        guess = np.zeros(len(s.coordinates))
        guess[0] = self.start
        for i, c in enumerate(s.coordinates):
            if c.bodies:
                named = [b for b in c.bodies if s.bodies[b] in mechanism.assembly]
                if not named:
                    raise AssemblyError(
                        f"{mechanism.name}: assembly.{s.bodies[c.bodies[0]]} is missing; give its approximate angle"
                        " (rad) to pick the assembly mode"
                    )
                guess[i] = mechanism.assembly[s.bodies[named[0]]] - s.held_at[named[0]]
        self._path = Path(np.array([self.start]), self._assemble(guess)[:, None])  # as far as it has been walked

    def __repr__(self) -> str:
        return one_line(self, self.mechanism.name, f"assembled at {np.degrees(self.start):.4g} deg")

    def form(self, body: str, point: str = "com") -> np.ndarray:
        """The structure's form (columns,) of a body's point, kept for the next call."""
        if (body, point) not in self._forms:
            self._forms[body, point] = self.structure.form(body, point)
        return self._forms[body, point]

    # ---------------------------------------------------------------- positions

    def coordinates(
        self, theta: np.ndarray, gaps: Mapping[str, np.ndarray] | None = None, path: Path | None = None
    ) -> np.ndarray:
        """Coordinates (n, N) at crank angles (N,) rad with the joints' gaps (m, complex, first pin minus second).

        Angles are continued from the assembly angle, never wrapped.  Raises AssemblyError.
        """
        u, columns = self.open(theta, gaps)
        self.close(u, columns, path or self.path(u[0].min(), u[0].max()), bool(gaps))
        return u

    def open(self, theta: np.ndarray, gaps: Mapping[str, np.ndarray] | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates (n, N) and columns (n_columns, N) that hold what is known before :meth:`close`: crank angles and
        gaps.

        Raises AssemblyError for a crank angle that is not a number.
        """
        theta = np.atleast_1d(np.asarray(theta, float))
        if not np.all(np.isfinite(theta)):
            raise AssemblyError(f"{self.mechanism.name}: crank angle {theta[~np.isfinite(theta)][0]} is not a number")
        u = np.zeros((len(self.structure.coordinates), theta.size))
        u[0] = theta
        return u, self._fixed_columns(theta.size, gaps)

    def close(self, u: np.ndarray, columns: np.ndarray, path: Path, displaced: bool) -> None:
        """Solve for all other coordinates and columns, in place; ``displaced`` says that there are gaps.  Raises
        AssemblyError.
        """
        theta, near = u[0], path.near(u[0])
        set_coordinate(self.structure, 0, columns, theta - self.structure.held_at[self._driven.bodies[0]])
        for group in self.structure.groups:
            if group in self._branch:
                margin = solve_dyad(self.structure, group, columns, u, self._branch[group])
            else:
                margin = newton(self.structure, group, columns, u, near, theta) ** 2
            self._refuse(theta, margin, group, displaced)
        turns = [i for i, c in enumerate(self.structure.coordinates) if c.bodies and i]
        u[turns] = turned_near(u[turns], near[turns])

    def columns(self, coordinates: np.ndarray, gaps: Mapping[str, np.ndarray] | None = None) -> np.ndarray:
        """The structure's columns (n_columns, N) at these coordinates."""
        columns = self._fixed_columns(coordinates.shape[1], gaps)
        for i in range(len(self.structure.coordinates)):
            set_coordinate(self.structure, i, columns, coordinates[i])
        return columns

    def _fixed_columns(self, n: int, gaps: Mapping[str, np.ndarray] | None) -> np.ndarray:
        """Columns (n_columns, n) with all that no coordinate moves: the ground, bodies held parallel to it, the
        gaps.
        """
        s = self.structure
        columns = np.zeros((s.n_columns, n), complex)
        turning = {b for c in s.coordinates for b in c.bodies}
        for b in range(len(s.bodies)):
            if b not in turning:
                columns[b] = np.exp(1j * s.held_at[b])
        for name, gap in (gaps or {}).items():
            columns[s.gap_column(name)] = gap
        return columns

    def path(self, low: float, high: float) -> Path:
        """The ideal linkage's path over at least [low, high] rad and the assembly angle.  Raises AssemblyError on the
        way.
        """
        low, high, known = min(low, high), max(low, high), self._path.theta
        if not (known[0] <= low and high <= known[-1]):  # the known part has no change point: only the rest is walked
            low, high, u = min(low, known[0]), max(high, known[-1]), self._path.coordinates
            below = np.linspace(known[0], low, int(np.ceil((known[0] - low) / PATH_STEP)) + 1)
            above = np.linspace(known[-1], high, int(np.ceil((high - known[-1]) / PATH_STEP)) + 1)
            u = np.hstack([self._walk(below, u[:, 0])[:, :0:-1], u, self._walk(above, u[:, -1])[:, 1:]])
            self._path = Path(np.concatenate([below[:0:-1], known, above[1:]]), u)
        return self._path

    def _walk(self, theta: np.ndarray, home: np.ndarray) -> np.ndarray:
        """Continue along theta (monotone) from the coordinates ``home`` (n,) at its first."""
        u, columns = self._driven_to(theta)
        for group in self.structure.groups:
            if group in self._branch:
                margin = solve_dyad(self.structure, group, columns, u, self._branch[group])
                self._check_passage(theta, margin, group, u)
            else:
                self._creep(theta, group, columns, u, home)
            for i in group.coordinates:
                if self.structure.coordinates[i].bodies:
                    u[i] = continued(np.concatenate([[home[i]], u[i]]))[1:]
        return u

    def _driven_to(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates and columns of the ideal linkage with its crank at theta, all groups still to be solved."""
        u, columns = self.open(theta)
        set_coordinate(self.structure, 0, columns, theta - self.structure.held_at[self._driven.bodies[0]])
        return u, columns

    def _assemble(self, guess: np.ndarray) -> np.ndarray:
        s = self.structure
        home = guess.copy()
        at = np.array([self.start])
        u, columns = self._driven_to(at)
        for group in s.groups:
            angles = [i for i in group.coordinates if s.coordinates[i].bodies]
            if len(group.coordinates) == 2:
                candidates: list[tuple[float, float, np.ndarray]] = []
                for branch in (1.0, -1.0):
                    trial, solved = u.copy(), columns.copy()
                    margin = solve_dyad(s, group, solved, trial, branch)
                    self._refuse(at, margin, group, False)
                    miss = float(np.abs(wrapped(trial[angles, 0] - guess[angles])).sum())
                    candidates.append((miss, branch, trial))
                candidates.sort(key=lambda c: c[0])
                _, self._branch[group], u = candidates[0]
                solve_dyad(s, group, columns, u, self._branch[group])
            else:
                near = with_travels(s, group, columns, guess[:, None])
                self._refuse(at, newton(s, group, columns, u, near, at) ** 2, group, False)
            for i in angles:
                home[i] = turned_near(u[i, 0], guess[i])
                if abs(home[i] - guess[i]) > ASSEMBLY_SLACK:
                    name = s.bodies[s.coordinates[i].bodies[0]]
                    raise AssemblyError(
                        f"{self.mechanism.name}: the loop through {', '.join(group.bodies)} does not close near the"
                        f" assembly angles: {name} would be at {home[i]:.4f} rad, assembly.{name} says {guess[i]:.4f};"
                        " correct it"
                    )
            for i in group.coordinates:
                home[i] = home[i] if i in angles else u[i, 0]
        return home

    # ---------------------------------------------------------------- change points

    def _creep(self, theta: np.ndarray, group: Group, columns: np.ndarray, u: np.ndarray, home: np.ndarray) -> None:
        """Newton from one angle of the path to the next, watching how far the group is from singular."""
        near = home[:, None].copy()
        before = None
        for k in range(theta.size):
            one, here = columns[:, k : k + 1], u[:, k : k + 1]
            regular = newton(self.structure, group, one, here, near, theta[k : k + 1])[0]
            if regular**2 < CHANGE_POINT or (before is not None and regular * before < 0):
                raise self._change_point(group, theta[k])
            columns[:, k], u[:, k], before = one[:, 0], here[:, 0], regular
            near = here + (here - u[:, k - 1 : k] if k else 0)

    def _check_passage(self, theta: np.ndarray, margin: np.ndarray, group: Group, u: np.ndarray) -> None:
        """Raise AssemblyError for the first place, at or between the angles of a walk, where the group's margin falls
        to zero; ``u`` are the walk's coordinates.
        """
        beside = np.concatenate([[np.inf], margin, [np.inf]])
        sound = np.logical_and.accumulate(margin > CHANGE_POINT)
        for k in np.flatnonzero(sound & (margin <= beside[:-2]) & (margin <= beside[2:]) & (margin < 0.1)).tolist():
            low, high = theta[max(k - 1, 0)], theta[min(k + 1, theta.size - 1)]
            for _ in range(5):
                zoom = np.linspace(low, high, 41)
                fine = self._margin(zoom, group, u[:, k : k + 1])
                j = int(np.argmin(fine))
                low, high = zoom[max(j - 1, 0)], zoom[min(j + 1, 40)]
            if fine[j] < CHANGE_POINT:
                raise self._change_point(group, zoom[j])
        self._refuse(theta, margin, group, False)

    def _margin(self, theta: np.ndarray, group: Group, near: np.ndarray) -> np.ndarray:
        """A dyad's margin at angles within a step of the walk from where the coordinates are ``near``."""
        u, columns = self._driven_to(theta)
        for g in self.structure.groups:
            if g in self._branch:
                margin = solve_dyad(self.structure, g, columns, u, self._branch[g])
            else:
                newton(self.structure, g, columns, u, near, theta)
            if g is group:
                break
        return margin

    def _refuse(self, theta: np.ndarray, margin: np.ndarray, group: Group, displaced: bool) -> None:
        bad = np.flatnonzero(~(margin > CHANGE_POINT))
        if not bad.size:
            return
        first = bad[0]
        if not margin[first] <= -CHANGE_POINT:  # NaN too: a side has no length
            raise self._change_point(group, theta[first])
        with_gap = " with its joints' clearance taken up" if displaced else ""
        raise AssemblyError(
            f"{self.mechanism.name}: crank angle {np.degrees(theta[first]):.6g} deg cannot be reached{with_gap}: "
            f"the loop through {', '.join(group.bodies)} does not close",
            float(theta[first]),
            "choose crank angles that it reaches",
        )

    def _change_point(self, group: Group, theta: float) -> AssemblyError:
        fall = (
            f"{' and '.join(group.bodies)} fall in line"
            if len(group.coordinates) == 2
            else f"the loops through {', '.join(group.bodies)} lock"
        )
        return AssemblyError(
            f"{self.mechanism.name}: change point at crank angle {np.degrees(theta):.6g} deg, where {fall} and the"
            " assembly mode is lost",
            float(theta),
            f"keep the range from the assembly angle ({np.degrees(self.start):.6g} deg) on clear of it",
        )


def _turning(s: Structure, coordinate: Coordinate) -> tuple[int, ...]:
    """Columns that turn with an angle: its bodies, then the travels along them."""
    return (*coordinate.bodies, *(len(s.bodies) + k for k, b in enumerate(s.slide_body) if b in coordinate.bodies))


__all__ = ["Assembly", "AssemblyError", "Path"]

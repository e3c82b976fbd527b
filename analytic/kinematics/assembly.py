"""Positions of a linkage: closed at every crank angle, or wherever its drives are, in the assembly mode that the
mechanism file picks.

Dyads are solved in closed form, larger Assur groups by Newton's method along the path from the assembly's posture.  The
assembly mode is followed continuously: where a group stretches or folds (a change point) or cannot close at all,
:class:`AssemblyError` says where and why.

With one crank the path is a table over its angle, walked as far as it is needed and kept.  With several inputs there is
no such table: :meth:`Assembly.follow` walks from one sample to the next.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from analytic.kinematics.closure import (
    AssemblyError,
    crank_angle,
    newton,
    partials,
    posture,
    set_bodies,
    set_coordinate,
    set_input,
    solve_dyad,
    with_travels,
)
from analytic.kinematics.schedule import Schedule, Turning
from analytic.kinematics.structure import BlockRest, BlockRests, Group, Structure, StructureError, structure
from analytic.mechanism import GROUND, Mechanism
from analytic.mechanism.one_line import angles, one_line
from analytic.mechanism.parts import SAME_POINT
from analytic.mechanism.signals import continued, turned_near, wrapped

PATH_STEP = np.radians(1.0)  # crank angle between checks for change points
MOST_WALKED = 10_000_000  # samples of a way, a few hundred bytes each: what a memory holds
STRIDES = 200  # steps that a travel as long as the longest body is walked in, with several inputs
# of a loop's size, by which a unit of an input would open loops beyond those needed, in a linkage that moves
RIGID_OPENING = 1e-6
CHANGE_POINT = 1e-10  # sin^2 between the two sides of a group below which it counts as stretched or folded
ASSEMBLY_SLACK = np.radians(45.0)  # how far the file's approximate angles may be off


@dataclass(frozen=True)
class CrankTable:
    """Coordinates over a crank's angle, continued from the assembly: the path that the linkage takes."""

    theta: np.ndarray  # (M,) rad, increasing
    coordinates: np.ndarray  # (n_coordinates, M)

    def __repr__(self) -> str:
        return one_line(self, angles(self.theta))

    def near(self, theta: np.ndarray) -> np.ndarray:
        """Coordinates (n, N) interpolated at crank angles (N,)."""
        return np.array([np.interp(theta, self.theta, c) for c in self.coordinates])


@dataclass(frozen=True)
class Walk:
    """Coordinates (n, N) of samples that the linkage was walked through, one after the other."""

    coordinates: np.ndarray

    def near(self, theta: np.ndarray) -> np.ndarray:
        """The samples' coordinates, whatever the first input is."""
        return self.coordinates

    def part(self, block: slice) -> Walk:
        """Some of the samples."""
        return Walk(self.coordinates[:, block])


class Assembly:
    """A linkage closed at its assembly angles.  Raises StructureError or AssemblyError where it cannot be."""

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism = mechanism
        self.structure: Structure = structure(mechanism)
        self._guess()  # a missing angle is that, whatever else may be wrong
        self._whole = False
        try:
            self._build()
        except AssemblyError as error:
            if not self.structure.one_too_many:
                raise
            self.structure = structure(mechanism, whole=True)
            self._whole = True
            try:
                self._build()
            except AssemblyError:
                raise StructureError(f"{self.structure.one_too_many}, or make its lengths agree") from error

    def _build(self) -> None:
        mechanism, s = self.mechanism, self.structure
        self.start = mechanism.assembly[mechanism.driven] if mechanism.cranked else float("nan")
        self._forms: dict[tuple[str, str], np.ndarray] = {}
        self._resting: dict[tuple[tuple[str, BlockRest], ...], Assembly] = {}
        self.branch: dict[Group, float] = {}  # which of a dyad's two postures: 1 or -1
        home = self._assemble(self._guess())[:, None]
        self.home = home  # (n, 1) coordinates of the assembly
        self._path = CrankTable(home[0], home)  # of a crank, as far as it has been walked
        if s.one_too_many:
            self._check_moves()

    def resting(self, rests: BlockRests) -> Assembly:
        """The linkage in this assembly mode with its blocks in their guides as ``rests`` says, by joint."""
        if not rests:
            return self
        key = tuple(sorted(rests.items()))
        if key not in self._resting:
            assembly = copy.copy(self)
            assembly.structure = structure(self.mechanism, self._whole, rests)
            assembly._forms, assembly._resting = {}, {}
            self._resting[key] = assembly
        return self._resting[key]

    @property
    def overheld(self) -> bool:
        """Whether joints hold the linkage more often than it needs: some of their constraints are redundant."""
        return any(group.surplus for group in self.structure.groups)

    @property
    def inputs(self) -> np.ndarray:
        """The inputs (n_inputs,) rad, m at the assembly."""
        return np.asarray(self.home[list(self.structure.inputs), 0])

    @property
    def positions(self) -> dict[str, float]:
        """Positions of the inputs' joints at the assembly, second body relative to first (rad, m)."""
        s = self.structure
        return {s.coordinates[i].joint: float(s.signs[i] * self.home[i, 0]) for i in s.inputs}

    def on_its_turn(self, joint: str, values: np.ndarray) -> np.ndarray:
        """Positions (N,) of a driven joint by whole turns to where the first of them (that is a number) is within half
        a turn of the assembly's.
        """
        if self.mechanism.joint(joint).prismatic:
            return values
        first = values[np.isfinite(values)][:1]
        return values + np.sum(turned_near(first, self.positions[joint]) - first)

    def inputs_at(self, positions: Mapping[str, np.ndarray]) -> np.ndarray:
        """Inputs (n_inputs, N) where their joints are at these positions (N,) rad, m; the signs of rates go alike."""
        s = self.structure
        return np.array([s.signs[i] * np.asarray(positions[s.coordinates[i].joint], float) for i in s.inputs])

    def _guess(self) -> np.ndarray:
        """Coordinates (n,) by the file's assembly angles.  Raises AssemblyError where one is missing."""
        mechanism, s = self.mechanism, self.structure
        guess, missing = np.zeros(len(s.coordinates)), dict[str, None]()

        def angle(name: str) -> float:
            if name != GROUND and name not in mechanism.assembly:
                missing[f"assembly.{name}"] = None
            return float(mechanism.assembly.get(name, 0.0))

        for i, c in enumerate(s.coordinates):
            if i in s.inputs and c.bodies:
                first, second = mechanism.joint(c.joint).bodies
                guess[i] = s.signs[i] * (angle(second) - angle(first))
            elif c.bodies:
                named = [b for b in c.bodies if s.turned[b] == (i,) and s.bodies[b] in mechanism.assembly]
                given = [angle(s.bodies[b]) - s.held_at[b] for b in named] or [angle(s.bodies[c.bodies[0]])]
                guess[i] = math.fsum(given) / len(given)
        if missing:
            raise AssemblyError(
                f"{mechanism.name}: {' and '.join(missing)} {'is' if len(missing) == 1 else 'are'} missing; give the"
                " approximate angle (rad) to pick the assembly mode"
            )
        return self._with_driven_travels(guess)

    def _with_driven_travels(self, guess: np.ndarray) -> np.ndarray:
        """Coordinates (n,) with those travels (m) of driven slides that, with all others, bring pins closest to each
        other: the sum of their squared gaps is least, whichever loops they close; zero of a slide that is in none.
        """
        s, coordinates = self.structure, guess.copy()
        slides = [i for i, c in enumerate(s.coordinates) if not c.bodies]
        if not set(slides) & set(s.inputs) or not len(s.loops):
            return coordinates
        columns = self.columns(guess[:, None])
        pins = s.loops[:, s.n_columns - len(s.pins) :].real  # which gaps each loop adds up
        loops = np.linalg.solve(np.linalg.cholesky(pins @ pins.T), s.loops)
        open_by = (loops @ columns)[:, 0]
        along = np.stack([partials(s, i, loops, columns)[:, 0] for i in slides], axis=-1)
        travels = -np.linalg.lstsq(
            np.concatenate([along.real, along.imag]), np.concatenate([open_by.real, open_by.imag]), rcond=None
        )[0]
        for i, travel in zip(slides, travels.tolist(), strict=True):
            if i in s.inputs:
                coordinates[i] = travel
        return coordinates

    def __repr__(self) -> str:
        at = f"{np.degrees(self.start):.4g} deg" if self.mechanism.cranked else posture(self.structure, self.home, 0)
        return one_line(self, self.mechanism.name, f"assembled at {at}")

    def form(self, body: str, point: str = "com") -> np.ndarray:
        """The structure's form (columns,) of a body's point, kept for the next call."""
        if (body, point) not in self._forms:
            self._forms[body, point] = self.structure.form(body, point)
        return self._forms[body, point]

    # ---------------------------------------------------------------- positions

    def coordinates(
        self, theta: np.ndarray, gaps: Mapping[str, np.ndarray] | None = None, path: CrankTable | Walk | None = None
    ) -> np.ndarray:
        """Coordinates (n, N) at crank angles (N,) rad, or at inputs (n_inputs, N), with the joints' gaps (m, complex,
        first pin minus second).

        Angles are continued from the assembly angle, never wrapped.  Raises AssemblyError.
        """
        u, columns = self.open(theta, gaps)
        self.close(u, columns, self.near(u, path), bool(gaps))
        return u

    def open(self, theta: np.ndarray, gaps: Mapping[str, np.ndarray] | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates (n, N) and columns (n_columns, N) that hold what is known before :meth:`close`: inputs, or
        crank angles (N,), and gaps.

        Raises AssemblyError for an input that is not a number.
        """
        theta = np.atleast_1d(np.asarray(theta, float))
        inputs = theta if theta.ndim == 2 else theta[None]
        if not np.all(np.isfinite(inputs)):
            what = "crank angle" if self.mechanism.cranked else "position"
            raise AssemblyError(f"{self.mechanism.name}: {what} {inputs[~np.isfinite(inputs)][0]} is not a number")
        u = np.zeros((len(self.structure.coordinates), inputs.shape[1]))
        u[list(self.structure.inputs)] = inputs
        return u, self._fixed_columns(inputs.shape[1], gaps)

    def near(self, u: np.ndarray, path: CrankTable | Walk | None = None) -> CrankTable | Walk:
        """What is near coordinates (n, N) whose inputs are known: ``path``, else a crank's, else those samples
        themselves, which are then in the order of a motion.  Raises AssemblyError on the way.
        """
        if path is not None:
            return path
        if self.structure.by_crank:
            return self.path(u[0].min(), u[0].max())
        return self.follow(u[list(self.structure.inputs)])

    def inputs_along(self, schedule: Schedule) -> Turning:
        """The inputs at the instants of a schedule in which nothing moves freely: a crank's angles (N,) where one alone
        moves the linkage, else (n_inputs, N).  At rest only their directions are left of rates.
        """
        if schedule.crank_angle is not None:
            theta, speed = schedule.crank_angle, schedule.crank_motion(self.mechanism).rate(0.0)
            return Turning(theta, np.full(theta.shape, speed), np.zeros(theta.shape))
        if schedule.crank is not None:
            crank = schedule.crank_motion(self.mechanism)
            return Turning(*(crank.positions(schedule.time, order) for order in range(3)))
        if schedule.at_rest:
            directions = self.inputs_at(schedule.directions(schedule.time))
            return Turning(self.inputs_at(schedule.positions()), directions, np.zeros(directions.shape))
        return Turning(*(self.inputs_at(schedule.positions(order=order)) for order in range(3)))

    def left_free(self, schedule: Schedule) -> bool:
        """Whether anything moves freely in a schedule."""
        return schedule.lets_go or (schedule.crank is None and bool(self.structure.free))

    def walk(self, schedule: Schedule) -> Walk | None:
        """The ideal linkage's coordinates at the instants of a schedule in which nothing moves freely, reached along
        its courses: few samples do not say by which way it comes from one to the next.  None of a crank, whose path is
        a table that is kept.  Raises AssemblyError on the way.
        """
        if schedule.crank is not None:
            theta = self.inputs_along(schedule).theta
            self.path(float(theta.min()), float(theta.max()))
            return None
        way = schedule.until(schedule.time)
        followed = self.follow(self.inputs_at(schedule.positions(way)))
        return Walk(followed.coordinates[:, np.searchsorted(way, schedule.time)])

    def _dyad(self, step: Group, columns: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Solve a dyad on its branch, in place; its margin (N,) from a dead point."""
        s = self.structure
        set_bodies(s, s.stacked[s.groups.index(step)], columns, u)
        return solve_dyad(s, step, columns, u, self.branch[step])

    def close(self, u: np.ndarray, columns: np.ndarray, path: CrankTable | Walk, displaced: bool) -> None:
        """Solve for all other coordinates and columns, in place; ``displaced`` says that there are gaps.  Raises
        AssemblyError.
        """
        s, near = self.structure, path.near(u[0])
        for step in s.steps:
            if isinstance(step, int):
                set_input(s, step, columns, u)
                continue
            if step in self.branch:
                margin = self._dyad(step, columns, u)
            else:
                margin = newton(s, step, columns, u, near) ** 2
            self._refuse(u, margin, step, displaced)
        turns = [i for i, c in enumerate(s.coordinates) if c.bodies and i not in s.inputs]
        u[turns] = turned_near(u[turns], near[turns])

    def follow(self, inputs: np.ndarray) -> Walk:
        """The ideal linkage's coordinates at inputs (n_inputs, N) that follow one another, reached from the assembly.

        Between samples it goes straight.  Raises AssemblyError on the way.
        """
        if self.is_open:
            return Walk(inputs[np.argsort(self.structure.inputs)])
        stops = self._stops(inputs)
        counts = self._looks(stops)
        self._check_walked(counts.sum())
        ends = np.concatenate([[0], np.cumsum(counts.astype(int))])
        walk = np.array([np.interp(np.arange(ends[-1] + 1), ends, row) for row in stops])
        return Walk(self._walk(walk, self.home[:, 0])[:, ends[1:]])

    @property
    def is_open(self) -> bool:
        """Whether all its coordinates are inputs: there is nothing to follow, and no change point on the way."""
        return len(self.structure.inputs) == len(self.structure.coordinates)

    def check_way(self, inputs: np.ndarray) -> None:
        """Raise AssemblyError where to follow inputs (n_inputs, N) would take too many samples."""
        self._check_walked(self._looks(self._stops(inputs)).sum())

    def _stops(self, inputs: np.ndarray) -> np.ndarray:
        """Inputs (n_inputs, 1 + N), of which the first are those of the assembly."""
        return np.column_stack([self.home[list(self.structure.inputs), 0], inputs])

    def _looks(self, stops: np.ndarray) -> np.ndarray:
        """How many steps (N,) it takes from each stop (n_inputs, 1 + N) to the next."""
        return np.maximum(1, np.ceil(np.abs(np.diff(stops) / self.strides[:, None]).max(axis=0) - 1e-9))

    def _check_walked(self, samples: float) -> None:
        """Raise AssemblyError for a way of so many samples, :attr:`strides` apart."""
        if samples > MOST_WALKED:
            raise AssemblyError(
                f"{self.mechanism.name}: the way there takes {samples:.3g} samples, one a degree and {STRIDES} in a"
                f" travel of the longest body's length, and {MOST_WALKED:g} are the most",
                remedy="ask for earlier times, slower drives or fewer turns",
            )

    @property
    def strides(self) -> np.ndarray:
        """How far each input (n_inputs,) goes at most between two looks for a change point: rad, m."""
        s = self.structure
        longest = max(body.length for body in self.mechanism.bodies)
        ground = [
            abs(complex(*p) - complex(*q))
            for p in self.mechanism.ground.points.values()
            for q in self.mechanism.ground.points.values()
        ]
        travel = (max(longest, *ground) or 1.0) / STRIDES
        return np.array([PATH_STEP if s.unit(i) == "rad" else travel for i in s.inputs])

    def columns(self, coordinates: np.ndarray, gaps: Mapping[str, np.ndarray] | None = None) -> np.ndarray:
        """The structure's columns (n_columns, N) at these coordinates."""
        columns = self._fixed_columns(coordinates.shape[1], gaps)
        s = self.structure
        angles = [i for i, c in enumerate(s.coordinates) if c.bodies]
        for i in angles:
            set_coordinate(s, i, columns, coordinates[i])
        set_bodies(s, (b for b, turned in enumerate(s.turned) if len(turned) > 1), columns, coordinates)
        for i in range(len(s.coordinates)):
            if i not in angles:  # a travel is along a body
                set_coordinate(s, i, columns, coordinates[i])
        return columns

    def check_springs(self, coordinates: np.ndarray, columns: np.ndarray | None = None) -> None:
        """Raise AssemblyError where the ends of a spring that has a length unloaded are at one place: its force has no
        direction there.  ``coordinates`` (n, N), and the structure's ``columns`` (n_columns, N) where they are known.
        """
        for spring in self.mechanism.springs:
            if not spring.stiffness * spring.length:
                continue
            columns = self.columns(coordinates) if columns is None else columns
            near, far = (self.form(*end) @ columns for end in spring.ends)
            for at in np.flatnonzero(np.abs(far - near) <= SAME_POINT * spring.length)[:1].tolist():
                ends = " and ".join(f"{body}.{point}" for body, point in spring.ends)
                raise AssemblyError(
                    f"{self.mechanism.name}: at {posture(self.structure, coordinates, at)} both ends of the spring"
                    f" between {ends} are at one place, where its force has no direction",
                    crank_angle(self.structure, coordinates, at),
                    f"keep clear of that instant, or give spring.points that stay apart, or 0 m for spring.length ="
                    f" {spring.length:g} m",
                )

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

    def path(self, low: float, high: float) -> CrankTable:
        """The ideal linkage's path over at least [low, high] rad and the assembly angle.  Raises AssemblyError on the
        way, and where it is not one crank's angle that tells the posture.
        """
        if not self.structure.by_crank:
            joints = ", ".join(self.positions)
            raise AssemblyError(
                f"{self.mechanism.name}: its posture is told by more than one crank's angle ({joints})",
                remedy="what is asked for is of linkages that one crank moves",
            )
        low, high, known = min(low, high), max(low, high), self._path.theta
        if not (known[0] <= low and high <= known[-1]):  # the known part has no change point: only the rest is walked
            low, high, u = min(low, known[0]), max(high, known[-1]), self._path.coordinates
            self._check_walked((high - low) / PATH_STEP)
            below = np.linspace(known[0], low, int(np.ceil((known[0] - low) / PATH_STEP)) + 1)
            above = np.linspace(known[-1], high, int(np.ceil((high - known[-1]) / PATH_STEP)) + 1)
            u = np.hstack([self._walk(below, u[:, 0])[:, :0:-1], u, self._walk(above, u[:, -1])[:, 1:]])
            self._path = CrankTable(np.concatenate([below[:0:-1], known, above[1:]]), u)
        return self._path

    def _walk(self, inputs: np.ndarray, home: np.ndarray) -> np.ndarray:
        """Continue along inputs (n_inputs, M), or a crank's angles (M,), from the coordinates ``home`` (n,) at its
        first.
        """
        s = self.structure
        u, columns = self.open(inputs)
        for step in s.steps:
            if isinstance(step, int):
                set_input(s, step, columns, u)
                continue
            if step in self.branch:
                margin = self._dyad(step, columns, u)
                self._check_passage(margin, step, u)
            else:
                self._creep(step, columns, u, home)
            for i in step.coordinates:
                if s.coordinates[i].bodies:
                    u[i] = continued(np.concatenate([[home[i]], u[i]]))[1:]
        return u

    def _assemble(self, guess: np.ndarray) -> np.ndarray:
        s = self.structure
        home = guess.copy()
        u, columns = self.open(guess[list(s.inputs), None])
        for step in s.steps:
            if isinstance(step, int):
                set_input(s, step, columns, u)
                self._check_turned((s.bodies[s.hung.index(step)],), home)
                continue
            group = step
            angles = [i for i in group.coordinates if s.coordinates[i].bodies]
            set_bodies(s, s.stacked[s.groups.index(group)], columns, u)
            if group.dyad:
                candidates: list[tuple[float, float, np.ndarray]] = []
                for branch in (1.0, -1.0):
                    trial, solved = u.copy(), columns.copy()
                    margin = solve_dyad(s, group, solved, trial, branch)
                    self._refuse(u, margin, group, False)
                    miss = float(np.abs(wrapped(trial[angles, 0] - guess[angles])).sum())
                    candidates.append((miss, branch, trial))
                candidates.sort(key=lambda c: c[0])
                _, self.branch[group], u = candidates[0]
                solve_dyad(s, group, columns, u, self.branch[group])
            else:
                near = with_travels(s, group, columns, guess[:, None])
                self._refuse(u, newton(s, group, columns, u, near) ** 2, group, False)
            for i in angles:
                home[i] = turned_near(u[i, 0], guess[i])
            for i in (*group.coordinates, *group.within):
                home[i] = home[i] if i in angles else u[i, 0]
            self._check_turned(group.bodies, home)
        return home

    def _check_turned(self, bodies: Sequence[str], home: np.ndarray) -> None:
        """Raise AssemblyError for a body that coordinates (n,) turn far from what the file's assembly says of it."""
        s, asked = self.structure, self.mechanism.assembly
        for name in bodies:
            b = s.body_column(name)
            angle = float(home[list(s.turned[b])].sum() + s.held_at[b])
            if abs(angle - asked.get(name, angle)) > ASSEMBLY_SLACK:
                degrees = f', or is "{asked[name]:g} deg" meant?' if abs(asked[name]) > math.pi else ""
                raise AssemblyError(
                    f"{self.mechanism.name}: it does not close near the assembly angles: {name} would be at"
                    f" {angle:.4f} rad, assembly.{name} says {asked[name]:.4f}; correct it{degrees}"
                )

    def _check_moves(self) -> None:
        """Raise StructureError where loops beyond those needed keep the inputs from moving: their lengths are no
        special ones.
        """
        s, columns = self.structure, self.columns(self.home)
        jacobian = np.stack([partials(s, i, s.loops, columns)[:, 0] for i in range(len(s.coordinates))], axis=-1)
        rows = np.concatenate([jacobian.real, jacobian.imag])
        sizes = np.tile(np.abs(s.loops[:, : len(s.bodies)]).sum(axis=1), 2)
        rows = rows / sizes[:, None]
        unknown = [i for i in range(len(s.coordinates)) if i not in s.inputs]
        moved = rows[:, list(s.inputs)]
        open_by = moved - rows[:, unknown] @ np.linalg.lstsq(rows[:, unknown], moved, rcond=None)[0]
        if np.abs(open_by).max(initial=0.0) > RIGID_OPENING:
            raise StructureError(s.one_too_many)

    # ---------------------------------------------------------------- change points

    def _creep(self, group: Group, columns: np.ndarray, u: np.ndarray, home: np.ndarray) -> None:
        """Newton from one sample of the walk to the next, watching how far the group is from singular."""
        near = home[:, None].copy()
        before = None
        for k in range(u.shape[1]):
            one, here = columns[:, k : k + 1], u[:, k : k + 1]
            regular = newton(self.structure, group, one, here, near)[0]
            if regular**2 < CHANGE_POINT or (before is not None and regular * before < 0):
                raise self._change_point(group, u, k)
            columns[:, k], u[:, k], before = one[:, 0], here[:, 0], regular
            near = here + (here - u[:, k - 1 : k] if k else 0)

    def _check_passage(self, margin: np.ndarray, group: Group, u: np.ndarray) -> None:
        """Raise AssemblyError for the first place, at or between the samples of a walk, where the group's margin falls
        to zero; ``u`` are the walk's coordinates.
        """
        beside, last = np.concatenate([[np.inf], margin, [np.inf]]), margin.size - 1
        sound = np.logical_and.accumulate(margin > CHANGE_POINT)
        for k in np.flatnonzero(sound & (margin <= beside[:-2]) & (margin <= beside[2:]) & (margin < 0.1)).tolist():
            low, high = (u[list(self.structure.inputs), j] for j in (max(k - 1, 0), min(k + 1, last)))
            for _ in range(5):
                zoom = np.linspace(low, high, 41, axis=1)
                fine = self._margin(zoom, group, u[:, k : k + 1])
                j = int(np.argmin(fine))
                low, high = zoom[:, max(j - 1, 0)], zoom[:, min(j + 1, 40)]
            if fine[j] < CHANGE_POINT:
                raise self._change_point(group, self.open(zoom)[0], j)
        self._refuse(u, margin, group, False)

    def _margin(self, inputs: np.ndarray, group: Group, near: np.ndarray) -> np.ndarray:
        """A dyad's margin at inputs (n_inputs, M) within a step of the walk from where the coordinates are ``near``."""
        s = self.structure
        u, columns = self.open(inputs)
        for step in s.steps:
            if isinstance(step, int):
                set_input(s, step, columns, u)
            elif step in self.branch:
                margin = self._dyad(step, columns, u)
            else:
                newton(s, step, columns, u, near)
            if step is group:
                break
        return margin

    def _refuse(self, u: np.ndarray, margin: np.ndarray, group: Group, displaced: bool) -> None:
        bad = np.flatnonzero(~(margin > CHANGE_POINT))
        if not bad.size:
            return
        first = int(bad[0])
        if not margin[first] <= -CHANGE_POINT:  # NaN too: a side has no length
            raise self._change_point(group, u, first)
        with_gap = " with its joints' clearance taken up" if displaced else ""
        s = self.structure
        raise AssemblyError(
            f"{self.mechanism.name}: {posture(s, u, first)} cannot be reached{with_gap}: "
            f"the loop through {', '.join(group.bodies)} does not close",
            crank_angle(s, u, first),
            f"choose {'crank angles' if self.mechanism.cranked else 'positions'} that it reaches",
        )

    def _change_point(self, group: Group, u: np.ndarray, k: int) -> AssemblyError:
        s, start = self.structure, getattr(self, "home", None)
        begin = u if start is None else start
        named = posture(s, begin, 0).removeprefix("crank angle ")
        clear = f"the range from the assembly angle ({named})" if self.mechanism.cranked else f"the way from {named}"
        return AssemblyError(
            f"{self.mechanism.name}: change point at {posture(s, u, k)}, where {locks(group)} and the assembly mode is"
            " lost",
            crank_angle(s, u, k),
            f"keep {clear} on clear of it",
        )


def locks(group: Group) -> str:
    """What a group does at its change point, in words."""
    names = group.bodies
    return f"{' and '.join(names)} fall in line" if group.dyad else f"the loops through {', '.join(names)} lock"


__all__ = ["Assembly", "AssemblyError", "CrankTable"]

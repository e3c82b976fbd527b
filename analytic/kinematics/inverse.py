"""The inverse problem: where must the inputs be for a platform to be where it is wanted?

All coordinates are sought together, so that the loops close and the platform is where it is wanted: Newton's method,
from the assembly on and from one wanted pose to the next: the assembly's angles pick the working mode.  Where the
derivative of all that is singular the platform cannot move as wanted whatever its drives do (a singularity of the first
kind: a leg stretched or folded); where the loops' own by the coordinates that are no inputs is, its drives do not hold
it (of the second kind), which is the assembly's change point.

Between poses the platform goes along the cubic spline through them.  It goes there from stop to stop, no farther than
the loops' and the pose's derivatives, which bend by a bounded amount, are certain to stay regular, those of each group
too (:meth:`_Inverse.lies_near`): the steps shrink towards a singular pose, and none is stepped over.

At a singular pose of the first kind two working modes meet, and a path through it, which touches the end of what is
reached and turns back, does not say in which of them it goes on.  Such a pose is refused wherever it is on the path;
where the spline turns back just before it, that the poses mean to pass it shows in how little the platform moves beside
it (:func:`passes_zero`).  A pose of the second kind is where a group's derivative loses its orientation: the path goes
on there, and its drives turn back or stand still.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from analytic.kinematics.assembly import CHANGE_POINT, Assembly, AssemblyError, Walk, locks
from analytic.kinematics.closure import AGREE, partials, regularity
from analytic.kinematics.output import Output
from analytic.kinematics.structure import Group

POSE_PASSES = 30  # of Newton's method
POSE_SETTLED = 1e-13  # of the platform's size, or rad
# of the platform's size, or rad: how far it is off the spline through its poses.  Where it swings by A, that makes
# sqrt(8/3 FOLLOWS / A) of its largest acceleration, by a cubic spline's errors of fourth and second order, and some
# times as much at the ends: less than a thousandth where A is a tenth
FOLLOWS = 1e-9
SINGULAR = 1e-6  # of the platform's size per rad: a pose that is settled is this near to one at which it cannot move
KEEP_WITHIN = "keep the path within reach"
EARLIER = np.array([[8, 0, 0, 0], [4, 4, 0, 0], [2, 4, 2, 0], [1, 3, 3, 1]]) / 8  # halves of a cubic, by its points
LATER = EARLIER[::-1, ::-1]
FINEST = np.finfo(float).eps ** 0.25  # of a row: a spline's error, of fourth order, is rounding's where halved so often
KEEP_CLEAR = "keep the path clear of it, or give a course of the drives instead"


def inverse(assembly: Assembly, wanted: Sequence[Output], poses: np.ndarray, time: np.ndarray | None = None) -> Walk:
    """Coordinates (n, N) at which the ``wanted``, as many as the linkage has inputs, are at ``poses`` (n_inputs, N),
    which are instants of one motion, at ``time`` (N,) s or evenly apart: between them it goes along the cubic spline.

    Raises AssemblyError with the pose where it cannot be reached, or is singular.
    """
    return Walk(_Inverse(assembly, wanted, np.asarray(poses, float), time).followed())


def splined(
    assembly: Assembly, wanted: Sequence[Output], poses: np.ndarray, time: np.ndarray
) -> tuple[np.ndarray, Walk]:
    """Instants (M,) s, those of the poses among them, and coordinates there as of :func:`inverse`: so many that the
    ``wanted`` are off the spline through the poses by no more than FOLLOWS where the inputs go along the spline through
    theirs.
    """
    path = _Inverse(assembly, wanted, np.asarray(poses, float), time)
    return path.refined(path.followed())


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

    def __init__(self, assembly: Assembly, wanted: Sequence[Output]) -> None:
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
                out.append(w.part(self.assembly.form(w.body, w.point) @ columns))
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
                pose[:, row, i] = w.part(partials(s, i, form, columns)[0])
        return np.concatenate([loops.real, loops.imag]).transpose(1, 0, 2), pose

    def rows(self, group: Group) -> list[int]:
        """Where a group's loops are among the derivatives of all of them."""
        return [*group.loops, *(len(self.s.loops) + k for k in group.loops)]

    def own(self, group: Group, loops: np.ndarray) -> np.ndarray:
        """Derivatives (N, 2 loops, unknowns) of a group's loops by its own coordinates, of those of all."""
        return loops[:, self.rows(group)][:, :, list(group.coordinates)]


class _Inverse(Posed):
    """Walks a platform along a path, straight from the assembly to the first of its poses (wanted, N), then along the
    cubic spline through them.  ``near`` (n, 1) are the coordinates where it is, ``at`` (wanted, 1) its pose; ``ways``
    (bodies and slides, wanted) is how far these turn (rad) and travel (sizes) from there by a unit of each wanted
    coordinate, ``bend`` as :meth:`bent` says, ``regular`` how far each group is from singular.
    """

    def __init__(
        self, assembly: Assembly, wanted: Sequence[Output], poses: np.ndarray, time: np.ndarray | None
    ) -> None:
        super().__init__(assembly, wanted)
        s = self.s
        if len(wanted) != len(s.inputs):
            raise AssemblyError(
                f"{assembly.mechanism.name}: {len(wanted)} wanted coordinates ({', '.join(w.name for w in wanted)}) and"
                f" {len(s.inputs)} inputs ({', '.join(assembly.positions)}); give as many as there are inputs"
            )
        self.unit = np.array([1.0 if w.axis == "angle" else self.size for w in wanted])
        self.reach = np.array([1.0 if s.unit(i) == "rad" else self.size for i in s.inputs])
        self.groups = [g for g in s.groups if g.coordinates]
        self.arms = np.abs(s.loops[:, : len(s.bodies)]).sum(axis=1).max(initial=0.0)
        self.time, self.timed = np.arange(float(poses.shape[1])) if time is None else time, time is not None
        self.near = assembly.follow(assembly.inputs[:, None]).coordinates
        self.at = self.pose(assembly.columns(self.near), self.near)
        self.pieces = self.cubics(poses)
        self.regular: list[float] = []
        self.turns = np.zeros((len(s.bodies) + len(s.slides), len(s.coordinates)))
        for b, turned in enumerate(s.turned):
            self.turns[b, list(turned)] = 1.0
        for i, c in enumerate(s.coordinates):
            if not c.bodies:
                self.turns[c.column, i] = 1.0 / self.size
        self.goal = self.near, self.at[:, 0], -1.0  # whence a row is gone to, its pose, and which
        self.stops: list[tuple[float, np.ndarray]] = []  # rows, coordinates (n,)

    def cubics(self, poses: np.ndarray) -> np.ndarray:
        """The path piece by piece (N, 4, wanted): the points between which Bernstein's polynomials are its cubic."""
        to_first = self.at[:, 0] + np.outer([0.0, 1 / 3, 2 / 3, 1.0], poses[:, 0] - self.at[:, 0])
        if poses.shape[1] == 1:
            return to_first[None]
        from scipy.interpolate import CubicSpline  # here: importing it takes a quarter of a second

        rates = CubicSpline(self.time, poses, axis=1)(self.time, 1)
        third, p = np.diff(self.time)[:, None] / 3, poses.T
        begin, end = p[:-1] + third * rates.T[:-1], p[1:] - third * rates.T[1:]
        return np.concatenate([to_first[None], np.stack([p[:-1], begin, end, p[1:]], axis=1)])

    def followed(self) -> np.ndarray:
        """Coordinates (n, N) at the poses.  Raises AssemblyError for one that is singular, there or on the way."""
        self.move(self.at[:, 0], -1.0)
        for row, piece in enumerate(self.pieces):
            parts = [(piece, row - 1.0, 1.0)]
            while parts:
                part, begin, length = parts.pop()
                if self.lies_near(part):
                    continue
                if begin > self.stops[-1][0]:
                    self.move(part[0], begin)
                    parts.append((part, begin, length))
                    continue
                if length == 1.0:
                    self.goal = self.near, piece[-1], row
                if length < np.finfo(float).eps:
                    raise self.stuck(part[0], begin)
                parts += [(LATER @ part, begin + length / 2, length / 2), (EARLIER @ part, begin, length / 2)]
        self.goal = self.near, self.at[:, 0], -1.0
        coordinates, ways = self.between(np.arange(self.time.size))
        for size in 1.0 / np.linalg.norm(self.shares(ways), axis=2).T:  # 0 where that input's leg is stretched
            passed = passes_zero(self.time, size)
            if passed is not None:
                raise self.unclear(sum(passed))
        return coordinates

    def lies_near(self, part: np.ndarray) -> bool:
        """Whether no pose of a piece of the path (4, wanted), nor between it and where the platform is, can be singular
        or out of reach, by the theorem of Newton and Kantorovich: times ``bend``, Newton's first step there is no
        longer than a half.  The piece lies between its points, and so do the steps.
        """
        return bool(np.abs(self.ways @ (part.T - self.at)).max() * self.bend <= 0.5)

    def bent(self, loops: np.ndarray, slope: np.ndarray) -> float:
        """How much the derivatives of the loops (2 loops, n) and of the pose (wanted, n) change at most, of themselves,
        while no body turns by more than 1 rad and no slide travels by more than the size: those of all coordinates, and
        those of each group by its own.  1 at least, so that half of that is not exceeded.

        A body's phasor bends by its turn's square, a travel with its body's, and by both as it goes along a body.
        """
        s, travels = self.s, np.abs(self.assembly.columns(self.near)[len(self.s.bodies) :, 0][: len(self.s.slides)])
        turning = np.array([bool(turned) for turned in s.turned])
        columns = np.append(turning, (travels + 3 * self.size) * turning[s.slide_body])
        forms = [
            np.zeros(s.n_columns) if w.axis == "angle" else self.assembly.form(w.body, w.point) for w in self.wanted
        ]
        changes = np.abs(np.vstack([s.loops, s.loops, *forms]))[:, : columns.size] @ columns
        every = [(self.turns, np.vstack([loops, slope]), changes)]
        for group in self.groups:
            turns = self.turns[:, list(group.coordinates)]
            every.append((turns, self.own(group, loops[None])[0], changes[self.rows(group)]))
        return max(1.0, *(float((np.abs(turns @ np.linalg.pinv(x)) @ y).max()) for turns, x, y in every))

    def move(self, pose: np.ndarray, row: float) -> None:
        """Go to a pose (wanted,) that :meth:`lies_near`.  Raises AssemblyError where it is singular."""
        before, self.at = self.at, pose[:, None]
        self.near, ways = self.there(self.at, self.near, np.array([row]))
        loops, slope = (x[0] for x in self.slopes(self.assembly.columns(self.near)))
        regular = [abs(regularity(self.s, g, self.own(g, loops[None]))[0]) for g in self.groups]
        for group, far, near in zip(self.groups, self.regular or regular, regular, strict=True):
            if near**2 < CHANGE_POINT:
                beyond = near / (far - near) if far > near else 0.0
                when = self.when(row + beyond * (row - self.stops[-1][0]) if beyond else row)
                what = f"{when}is singular: {locks(group)}, and the drives do not hold it there"
                raise self.failed(self.at + beyond * (self.at - before), what, "keep the path clear of it")
        self.ways, self.bend, self.regular = self.turns @ ways[0], self.bent(loops, slope), regular
        self.stops.append((row, self.near[:, 0]))

    def there(self, poses: np.ndarray, near: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates (n, M) at poses (wanted, M), and how they go on (M, n, wanted), from coordinates near by; at
        ``rows`` (M,) of the path.  Raises AssemblyError for one that is singular.
        """
        u, ways, good = self.closed(poses, near)
        good[good] = np.linalg.svd(self.shares(ways[good]), compute_uv=False)[:, 0] * SINGULAR < 1.0
        if not good.all():
            k = int(np.argmin(good))
            raise self.stuck(poses[:, k], rows[k])
        return u, ways

    def shares(self, ways: np.ndarray) -> np.ndarray:
        """How far the inputs go (M, inputs, wanted) by a unit of each wanted coordinate, both of their own size."""
        return ways[:, list(self.s.inputs)] * self.unit / self.reach[:, None]

    def closed(self, poses: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Newton's method to poses (wanted, M) from coordinates (n, M): coordinates there, how far (M, n, wanted) they
        go on by a unit of each wanted coordinate, and whether (M,) they are there.
        """
        s, m, w = self.s, poses.shape[1], len(poses)
        ways, good = np.full((m, len(u), w), np.inf), np.zeros(m, bool)
        for _ in range(POSE_PASSES):
            columns = self.assembly.columns(u)
            loops, slope = self.slopes(columns)
            gap, miss = s.loops @ columns, (self.pose(columns, u) - poses).T
            open_by = np.concatenate([gap.real, gap.imag]).T[..., None]
            # what each group's own coordinates can close
            sides = [(np.linalg.qr(self.own(g, loops))[0].transpose(0, 2, 1), self.rows(g)) for g in self.groups]
            matrix = np.concatenate([*(q @ loops[:, rows] for q, rows in sides), slope], axis=1)
            left = np.concatenate([*(q @ open_by[:, rows] for q, rows in sides), miss[..., None]], axis=1)
            right = np.broadcast_to(np.eye(len(u))[:, len(u) - w :], ways.shape)
            try:
                solution = np.linalg.solve(matrix, np.concatenate([left, right], axis=2))
            except np.linalg.LinAlgError:
                break
            ways = solution[:, :, 1:]
            close = self.arms + np.abs(columns[len(s.bodies) : len(s.bodies) + len(s.slides)]).sum(axis=0)[:, None]
            good = np.all(np.abs(left[:, :-w, 0]) <= POSE_SETTLED * close, axis=1)
            good &= np.all(np.abs(open_by[..., 0]) <= AGREE * close, axis=1)
            good &= np.all(np.abs(miss) <= POSE_SETTLED * self.unit, axis=1)
            if good.all():
                break
            u = u - solution[:, :, 0].T
        return u, ways, good

    def refined(self, u: np.ndarray) -> tuple[np.ndarray, Walk]:
        """Instants (M,) s, as :func:`splined` says, and coordinates (n, M) there, of those (n, N) at the poses.  Raises
        AssemblyError where no number of them will do.
        """
        from scipy.interpolate import CubicSpline  # here: importing it takes a quarter of a second

        inputs, rows = list(self.s.inputs), np.arange(float(self.time.size))
        while True:
            time = self.instants(rows)
            middle = (rows[1:] + rows[:-1]) / 2
            exact, ways = self.between(middle)
            drives = CubicSpline(time, u[inputs], axis=1)(self.instants(middle)) - exact[inputs]
            off = np.linalg.solve(ways[:, inputs], drives.T[..., None])[..., 0] / self.unit
            apart = np.abs(off).max(axis=1) > FOLLOWS
            if not apart.any():
                return time, Walk(u)
            finest = np.diff(rows) < FINEST
            if np.any(apart & finest):
                raise self.unclear(float(middle[np.argmax(apart & finest)]))
            rows, u = np.append(rows, middle[apart]), np.append(u, exact[:, apart], axis=1)
            order = np.argsort(rows)
            rows, u = rows[order], u[:, order]

    def between(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates (n, M) and how they go on, at rows (M,) and between them, on the way that is followed."""
        stops, coordinates = np.array([row for row, _ in self.stops]), np.stack([u for _, u in self.stops], axis=1)
        near = coordinates[:, np.searchsorted(stops, rows, side="right") - 1]
        return self.there(self.on_spline(rows), near, rows)

    def on_spline(self, rows: np.ndarray) -> np.ndarray:
        """Poses (wanted, M) of the path at rows (M,) and between them."""
        piece = np.minimum(np.floor(rows).astype(int), len(self.pieces) - 2)
        x = (rows - piece)[:, None]
        weights = np.hstack([(1 - x) ** 3, 3 * x * (1 - x) ** 2, 3 * x**2 * (1 - x), x**3])
        return np.einsum("mi,miw->wm", weights, self.pieces[piece + 1])

    def instants(self, rows: np.ndarray) -> np.ndarray:
        """Times (M,) s of rows (M,) and between them."""
        return np.interp(rows, np.arange(self.time.size), self.time)

    def when(self, row: float) -> str:
        """The time of a row in words; empty where no times were given."""
        at = f"{'at' if row >= 0 else 'on the way to'} {self.instants(np.array(row)):.6g} s "
        return at if self.timed else ""

    def stuck(self, pose: np.ndarray, row: float) -> AssemblyError:
        """The error for a pose (wanted,) where the path ends, by what its next row is."""
        start, goal, end = self.goal
        with np.errstate(all="ignore"):  # on no way to anything
            reached = self.closed(goal[:, None], start)[2].all()
        if not reached:
            what = f"{self.when(end)}cannot be reached: no position of the drives has it there"
            return self.failed(goal, what, KEEP_WITHIN)
        return self.failed(pose, f"{self.when(row)}is singular: the platform cannot move on, whatever its drives do")

    def unclear(self, row: float) -> AssemblyError:
        """The error for a place at which two ways to go on meet, or so nearly that the rows do not tell."""
        what = "is singular, or the path's rows are too far apart to tell that it is not: two ways to go on meet there"
        return self.failed(self.on_spline(np.array([row])), f"{self.when(row)}{what}")

    def failed(self, pose: np.ndarray, what: str, remedy: str = KEEP_CLEAR) -> AssemblyError:
        pose_in_words = [
            f"{w.name} = {np.degrees(x):.6g} deg" if w.axis == "angle" else f"{w.name} = {1e3 * x:.6g} mm"
            for w, x in zip(self.wanted, np.ravel(pose), strict=True)
        ]
        return AssemblyError(
            f"{self.assembly.mechanism.name}: {', '.join(pose_in_words)} {what}",
            remedy=remedy,
        )

"""The motion behind an encoder's readings: its angle, rate and acceleration at any time, and how far noise moves them.

The course is a spline of seventh degree, of which the integral of the squared fifth derivative is charged (Eilers and
Marx, Stat. Sci. 11, 1996), and, where a crank turns fully, harmonics: a motor that turns unevenly does so turn after
turn, which a spline alone must find anew in each of them.  They are of the crank's own angle, or of one that turns
evenly, whichever tells the readings better.  The charge fades towards the ends.  How stiff the
spline is and how many harmonics there are is chosen by generalised cross-validation (Craven and Wahba, Numer. Math. 31,
1979), each degree of freedom charged somewhat more than there (as Kim and Gu do, J. R. Stat. Soc. B 66, 2004).  Time
is counted in median sample intervals, so that nothing depends on its unit, and a stiffer spline has its knots further
apart, so that its equations stay solvable; all of them are banded.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import BSpline
from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded
from scipy.optimize import minimize_scalar
from scipy.sparse import csr_array, hstack

from compare.recorded.quantum import quantum

SPLINE_DEGREE = 7
CHARGED = 5  # order of the derivative that is charged
SHORTEST_REACH = (
    0.25  # samples: the shortest reach of a spline that is tried; twice as long each time, up to the whole run
)
ON_KNOT = 1e-6  # samples: so near to a knot is on it
KNOTS_A_REACH = 2  # to a reach, of one to a sample at most
CHARGE = 0.4  # of a degree of freedom, more than cross-validation's own, which follows the noise of some runs
GAUSS_NODES = [
    np.polynomial.legendre.leggauss(degree + 1) for degree in range(SPLINE_DEGREE)
]  # by degree, exact for its square
LEFT_FREEDOM = 0.1  # of the readings' freedom: where less is left, cross-validation knows little
HARMONIC_COUNTS = (1, 2, 3, 4, 6, 8)  # how many are tried
HARMONIC_TURNS = 2.0  # of a run, at least, before harmonics are
STEADY_RATE = 0.3  # of its mean rate that a crank keeps, at least, before harmonics are
SHORTEST_PERIOD = 2.9  # samples of a harmonic's period
HARMONIC_ROUNDS = 4  # at most, in which harmonics are of the angle that the last round found
NEAR_REACHES = (
    0.5,
    1.0,
    2.0,
    4.0,
    8.0,
    32.0,
)  # squares of reaches, over the best so far, that are tried with another angle
EVEN_ERROR = 1.0  # rad, that an even turning may be off over a run: what slow waves of the speed do to its mean
SLOPE_ACCURACY = 0.01  # rad, to which it is found
EASED = 5  # knots from an end over which the charge grows to its full size, as a spline that is charged there misses
FIRM = 0.01  # of the way, from which it does
STAIRS = 0.5  # of the rms of rounding: a course that misses its readings by less follows the stairs of the counts
BLURRED = 1.1  # of what a course through the middle of the stairs misses them by, as their height is known
SCORE_GAIN = 0.1  # a round that gains less of the score is one too many
RIDGE = 1e-9  # of a harmonic's own square: keeps those apart that the spline can follow too
UNSEEN_ERROR = 0.05  # sigmas of all numbers together
MOST_DIRECTIONS = 400  # directions of a course's errors
POWERS = 3  # rounds of the search for those that matter most (Halko, Martinsson and Tropp, SIAM Rev. 53, 2011)
REDRAWN = 16  # times
NO_VARIANCE = 1e-300
READING_ROUNDING = 1e-13  # of the range of readings


@dataclass(frozen=True)
class SmoothCourse:
    """An angle (rad) over time (s), called as a spline is; beyond its ends its acceleration stays what it is there.

    ``turn`` is the angle whose harmonics are added, cosine and sine one after the other in ``waves``.
    """

    start: float
    step: float
    spline: BSpline
    turn: BSpline
    waves: np.ndarray

    def __call__(self, time: np.ndarray, order: int = 0, /) -> np.ndarray:
        """The angle (N,) at times (N,), or its first or second derivative in time."""
        at = (np.asarray(time, float) - self.start) / self.step
        waves = _waves(self.turn, at, self.waves.size // 2, order)
        return np.asarray((_beyond(self.spline, at, order) + waves @ self.waves) / self.step**order)

    def moved(self, time: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The angle (N,) rad at times (N,) s, its rate and its acceleration."""
        at = (np.asarray(time, float) - self.start) / self.step
        angle, rate, bend = (_beyond(self.spline, at, order) for order in range(3))
        if self.waves.size:
            turn, turned, bent = (_beyond(self.turn, at, order) for order in range(3))
            n = np.arange(1, self.waves.size // 2 + 1)
            spin = np.exp(1j * np.multiply.outer(n, turn))  # a cos + b sin = Re (a - ib) exp(i turn)
            wave, slope, curve = (
                (self.waves[::2] - 1j * self.waves[1::2]) * (1j * n) ** order @ spin for order in range(3)
            )
            angle, rate = angle + wave.real, rate + slope.real * turned
            bend = bend + curve.real * turned**2 + slope.real * bent
        return angle, rate / self.step, bend / self.step**2


def _beyond(spline: BSpline, at: np.ndarray, order: int) -> np.ndarray:
    """A spline or its derivative (up to the second), continued as a parabola."""
    near = np.clip(at, spline.t[0], spline.t[-1])
    off, values = at - near, spline(near, order)
    for n in range(order + 1, 3) if np.any(off) else ():
        values = values + spline(near, n) * off ** (n - order) / (n - order)
    return np.asarray(values)


def _waves(turn: BSpline, at: np.ndarray, count: int, order: int) -> np.ndarray:
    """(N, 2 count) cosines and sines of 1 to ``count`` times an angle, or their first or second derivative."""
    if not count:
        return np.zeros((at.size, 0))
    n = np.arange(1, count + 1)
    angle, *rates = (np.multiply.outer(_beyond(turn, at, k), n) for k in range(order + 1))
    cos, sin = np.cos(angle), np.sin(angle)
    if order == 0:
        both = cos, sin
    elif order == 1:
        both = -rates[0] * sin, rates[0] * cos
    else:
        both = -rates[1] * sin - rates[0] ** 2 * cos, rates[1] * cos - rates[0] ** 2 * sin
    return np.stack(both, axis=-1).reshape(at.size, 2 * count)


# ---------------------------------------------------------------- one spline


class Basis:
    """B-splines over readings at (N,) sample times, ``apart`` samples between knots, and the charge on their bends."""

    def __init__(self, at: np.ndarray, apart: float) -> None:
        self._charged = charged = min(CHARGED, at.size - 2)
        edges = np.linspace(at[0], at[-1], 1 + max(1, round((at[-1] - at[0]) / apart)))
        full = np.diff(np.searchsorted(at, edges[:-1] - ON_KNOT)) > 0
        edges = edges[np.concatenate([[True], full, [True]])]  # no knots in a gap
        self.knots = np.concatenate([np.full(SPLINE_DEGREE, edges[0]), edges, np.full(SPLINE_DEGREE, edges[-1])])
        self.size = self.knots.size - SPLINE_DEGREE - 1
        self.here = self.matrix(at, 0)
        nodes, weights = GAUSS_NODES[SPLINE_DEGREE - charged]
        half = np.diff(edges)[:, None] / 2
        inside = ((edges[1:] + edges[:-1])[:, None] / 2 + half * nodes).ravel()
        ease = np.minimum(inside - at[0], at[-1] - inside) / (EASED * apart)
        self._gram = _bands(self.here, np.ones(at.size))
        self._rough = _bands(self.matrix(inside, charged), (half * weights).ravel() * np.clip(ease, FIRM, 1.0) ** 3)

    def matrix(self, at: np.ndarray, order: int) -> csr_array:
        """(M, K) values, or derivatives of that order, of every spline at M times: DEGREE + 1 beside each other."""
        lower = BSpline.design_matrix(at, self.knots[order : self.knots.size - order], SPLINE_DEGREE - order)
        few = SPLINE_DEGREE - order + 1
        values, first = lower.data.reshape(-1, few), lower.indices[::few]
        rises = np.ones((self.size, 1))
        for degree in range(SPLINE_DEGREE, SPLINE_DEGREE - order, -1):
            t = self.knots[SPLINE_DEGREE - degree : self.knots.size - (SPLINE_DEGREE - degree)]
            rise = (degree / (t[degree + 1 : -1] - t[1 : -degree - 1]))[:, None]
            rises = rise * (np.pad(rises[1:], ((0, 0), (1, 0))) - np.pad(rises[:-1], ((0, 0), (0, 1))))
        full = np.zeros((at.size, SPLINE_DEGREE + 1))
        for k in range(few):
            full[:, k : k + order + 1] += values[:, k : k + 1] * rises[first + k]
        columns = first[:, None] + np.arange(SPLINE_DEGREE + 1)
        rows = (SPLINE_DEGREE + 1) * np.arange(at.size + 1)
        return csr_array((full.ravel(), columns.ravel(), rows), shape=(at.size, self.size))

    def squared(self, coefficients: np.ndarray) -> np.ndarray:
        """The readings' normal matrix times coefficients (K, k)."""
        product = self._gram[0][:, None] * coefficients
        for d, band in enumerate(self._gram[1:, :], 1):
            product[d:] += band[:-d, None] * coefficients[:-d]
            product[:-d] += band[:-d, None] * coefficients[d:]
        return np.asarray(product)

    def factor(self, reach: float) -> np.ndarray:
        """Banded Cholesky factor of the equations of a spline of this reach, in samples.  Raises LinAlgError."""
        charge = (reach / 2) ** (2 * self._charged)
        return np.asarray(cholesky_banded(self._gram + charge * self._rough, lower=True, check_finite=False))

    def freedom(self, reach: float) -> float:
        """Degrees of freedom: size less the slope of the equations' log determinant in the logarithm of the charge."""
        less, more = (2 * float(np.sum(np.log(self.factor(reach * (1 + e))[0]))) for e in (-0.002, 0.002))
        return self.size - (more - less) / (2 * self._charged * 0.004)


def _bands(matrix: csr_array, weights: np.ndarray) -> np.ndarray:
    """Lower bands (DEGREE + 1, K) of a matrix (M, K), from the left times its own weighted transpose."""
    values, size = matrix.data.reshape(-1, SPLINE_DEGREE + 1), matrix.shape[1]
    first, values = matrix.indices[:: SPLINE_DEGREE + 1], np.ascontiguousarray(values.T)
    weighted = values * weights
    bands = np.zeros((SPLINE_DEGREE + 1, size))
    for d in range(SPLINE_DEGREE + 1):
        for k in range(SPLINE_DEGREE + 1 - d):
            bands[d] += np.bincount(first + k, weighted[k] * values[k + d], size)
    return bands


class SplineFit:
    """A spline of one reach through readings (N,) together with harmonics (N, 2 h): linear in the readings."""

    def __init__(self, basis: Basis, reach: float, values: np.ndarray, waves: np.ndarray) -> None:
        self.basis, self.values, self.waves = basis, values, waves
        self._factor = basis.factor(reach)
        self._both = basis.here.T @ waves
        self._inside = self._solve(self._both)
        square = waves.T @ waves
        self._within = square - self._both.T @ self._inside
        self._left = self._within - self._inside.T @ self._both + self._inside.T @ basis.squared(self._inside)
        self._ridge = RIDGE * np.diag(np.diag(square))
        self._plain = self._solve(basis.here.T @ values)
        self._missed = values - basis.here @ self._plain
        self._free = basis.freedom(reach)

    def _solve(self, right: np.ndarray) -> np.ndarray:
        return np.asarray(cho_solve_banded((self._factor, True), right, check_finite=False))

    def amplitudes(self, count: int) -> np.ndarray:
        """(2 count,) of so many harmonics."""
        n = 2 * count
        right = self.waves[:, :n].T @ self._missed
        return np.linalg.solve(self._within[:n, :n] + self._ridge[:n, :n], right) if n else np.zeros(0)

    def freedom(self, count: int) -> float:
        """Degrees of freedom with so many harmonics."""
        n = 2 * count
        within = self._within[:n, :n] + self._ridge[:n, :n]
        return self._free + (float(np.trace(np.linalg.solve(within, self._left[:n, :n]))) if n else 0.0)

    def spline(self, count: int) -> np.ndarray:
        """(K,) coefficients of the spline with so many harmonics."""
        return np.asarray(self._plain - self._inside[:, : 2 * count] @ self.amplitudes(count))

    def missed(self, count: int) -> np.ndarray:
        """(N,) readings less the course with so many harmonics."""
        return np.asarray(
            self.values - self.basis.here @ self.spline(count) - self.waves[:, : 2 * count] @ self.amplitudes(count)
        )

    def solve(self, right: np.ndarray, count: int) -> np.ndarray:
        """Solutions (K + 2 count, k) of the equations of all coefficients with right sides of that shape."""
        n, size = 2 * count, self.basis.size
        alone = self._solve(right[:size])
        if not n:
            return alone
        within = self._within[:n, :n] + self._ridge[:n, :n]
        waves = np.linalg.solve(within, right[size:] - self._both[:, :n].T @ alone)
        return np.concatenate([alone - self._inside[:, :n] @ waves, waves])


# ---------------------------------------------------------------- the best one


@dataclass(frozen=True)
class TriedSpline:
    """A spline of one reach with so many harmonics, its score (least is best), and how it misses (rms, worst)."""

    reach: float
    count: int
    score: float
    miss: float
    worst: float
    fit: SplineFit = field(repr=False)


class Smoother:
    """The course through an encoder's readings: times (N,), increasing, N >= 5, in any unit, and values (N,).

    ``sigma`` is the noise of the readings that it finds; ``freedom`` counts what it takes from them.  A ``reach``, in
    the unit of time, is kept to; without, cross-validation finds it.
    """

    def __init__(self, time: np.ndarray, values: np.ndarray, reach: float | None = None) -> None:
        self.start, self.step = float(time[0]), float(np.median(np.diff(time)))
        self.at = (time - self.start) / self.step
        slope = float(values[-1] - values[0]) / float(self.at[-1])
        self._slope, self._zero = slope, float(values[0])
        self._values = values - self._line(self.at)
        self._step = quantum(values)
        self._bases: dict[float, Basis] = {}
        self._given = None if reach is None else np.array([reach / self.step])
        self._chosen()

    def _line(self, at: np.ndarray) -> np.ndarray:
        return np.asarray(self._zero + self._slope * at)

    def _chosen(self) -> None:
        each = SHORTEST_REACH * 2.0 ** np.arange(max(1, math.ceil(math.log2(self.at[-1] / SHORTEST_REACH))))
        reaches = each if self._given is None else self._given
        turn = self._evenly()
        tried = self._tried(reaches, turn)
        best = self._best([*tried, *self._tried(self._near(self._best(tried), (0.5, 2.0)), turn)])
        for _ in range(HARMONIC_ROUNDS):
            if turn is None or not best.count:
                break
            again = self._curve(best.fit.basis, best.fit.spline(best.count))
            better = self._best(self._tried(self._near(best, NEAR_REACHES), again))
            if not better.score < best.score - SCORE_GAIN:
                break
            turn, best = again, better
        if turn is not None and best.count:
            clock = self._clock(best)
            better = self._best(self._tried(self._near(best, NEAR_REACHES), clock))
            if better.score < best.score - SCORE_GAIN:
                turn, best = clock, better
        self.fit, self.count = best.fit, best.count
        self.freedom = best.fit.freedom(best.count)
        self.reach = best.reach
        spline = self._curve(best.fit.basis, best.fit.spline(best.count))
        self.course = SmoothCourse(self.start, self.step, spline, turn or spline, best.fit.amplitudes(best.count))
        left = max(1.0, self.at.size - self.freedom)
        off = best.fit.missed(best.count)
        self.sigma = max(math.sqrt(float(off @ off) / left), self._step / math.sqrt(12)) * math.sqrt(_alike(off))

    def _near(self, best: TriedSpline, squares: Sequence[float]) -> np.ndarray:
        """The reaches to try beside the best so far."""
        return best.reach * np.sqrt(squares) if self._given is None else self._given

    def smoothed(self, values: np.ndarray) -> np.ndarray:
        """Other readings (N,) of the same times, smoothed as these are."""
        here = hstack([self.fit.basis.here, csr_array(self.fit.waves[:, : 2 * self.count])], format="csr")
        return np.asarray(here @ self.fit.solve(here.T @ values, self.count))

    @property
    def size(self) -> int:
        """Number p of the course's coefficients."""
        return self.fit.basis.size + 2 * self.count

    def answers(self, time: np.ndarray) -> tuple[csr_array, csr_array, csr_array]:
        """(N, p) how the angle (rad) at times (N,) s, its rate and its acceleration answer to the coefficients."""
        at, basis, turn = (np.asarray(time, float) - self.start) / self.step, self.fit.basis, self.course.turn
        near = np.clip(at, self.at[0], self.at[-1])
        first, second, third = (
            hstack([basis.matrix(near, n), csr_array(_waves(turn, at, self.count, n))], format="csr") / self.step**n
            for n in range(3)
        )
        return first, second, third

    def errors(self, answers: csr_array, sigma: float) -> np.ndarray:
        """Errors (S, k) of S numbers that answer to the course's coefficients (S, p); their covariance is the product
        with the transpose.

        All but the last come from white noise (sigma, rad) of the readings; the last is what smoothing takes off,
        estimated by smoothing what is smooth once more.  Directions that add up to less than UNSEEN are left out, and
        those beyond the MOST that matter most.
        """
        here = hstack([self.fit.basis.here, csr_array(self.fit.waves[:, : 2 * self.count])], format="csr")

        def out(readings: np.ndarray) -> np.ndarray:
            return np.asarray(answers @ self.fit.solve(here.T @ readings, self.count)) * sigma

        def back(numbers: np.ndarray) -> np.ndarray:
            return np.asarray(here @ self.fit.solve(answers.T @ numbers, self.count)) * sigma

        rank = min(here.shape[1], MOST_DIRECTIONS, answers.shape[0])
        probes = np.random.default_rng(0).standard_normal((self.at.size, rank))
        for _ in range(1 if rank == here.shape[1] else POWERS):
            basis = np.linalg.qr(out(probes))[0]
            probes = back(basis)
        square, turned = np.linalg.eigh(probes.T @ probes)
        kept = square > UNSEEN_ERROR**2
        lost = out(self.fit.missed(self.count)) / sigma
        return np.column_stack([basis @ turned[:, kept] * np.sqrt(square[kept]), lost])

    def uncertainty(self, answers: csr_array, sigma: float) -> np.ndarray:
        """Root mean square error (S,) of each of S numbers that answer to the course's coefficients (S, p): from a few
        redraws of the readings' noise (sigma, rad), and what smoothing takes off.
        """
        here = hstack([self.fit.basis.here, csr_array(self.fit.waves[:, : 2 * self.count])], format="csr")
        redrawn = sigma * np.random.default_rng(0).standard_normal((self.at.size, REDRAWN))
        noise, lost = (
            answers @ self.fit.solve(here.T @ readings, self.count)
            for readings in (redrawn, self.fit.missed(self.count)[:, None])
        )
        return np.sqrt(np.mean(noise**2, axis=1) + lost[:, 0] ** 2)

    def _evenly(self) -> BSpline | None:
        """The angle of a crank that turns fully, smoothed over a turn; None of any other."""
        length = 2 * math.pi / max(abs(self._slope), 1e-12)
        if self.at[-1] < HARMONIC_TURNS * length or length < SHORTEST_PERIOD:
            return None
        basis, waves = self._basis(length), np.zeros((self.at.size, 0))
        for _ in range(HARMONIC_ROUNDS):
            turn = self._curve(basis, SplineFit(basis, length, self._values, waves).spline(waves.shape[1] // 2))
            if float(np.min(turn(self.at, 1) / self._slope)) < STEADY_RATE:
                return None
            waves = self._waves(turn)
        return turn

    def _clock(self, best: TriedSpline) -> BSpline:
        """The angle of something that turns evenly, whatever the crank does, so that its harmonics tell these readings
        best: unevenness may come from a motor behind a belt as from the crank's own load.
        """
        knots = best.fit.basis.knots
        middle = _greville(knots)

        def evenly(slope: float) -> BSpline:
            return BSpline(knots, slope * middle, SPLINE_DEGREE)

        def score(slope: float) -> float:
            fit = SplineFit(best.fit.basis, best.reach, self._values, self._waves(evenly(slope)))
            return min(choice.score for choice in self._choices(best.reach, fit))

        reach = EVEN_ERROR / float(self.at[-1])
        around = (self._slope - reach, self._slope + reach)
        fitted = minimize_scalar(score, bounds=around, method="bounded", options={"xatol": SLOPE_ACCURACY * reach})
        return evenly(float(fitted.x))

    def _waves(self, turn: BSpline) -> np.ndarray:
        """(N, 2 h) all harmonics of an angle that these readings can tell."""
        most = int(2 * math.pi / abs(self._slope) / SHORTEST_PERIOD)
        return _waves(turn, self.at, max([0, *(n for n in HARMONIC_COUNTS if n <= most)]), 0)

    def _curve(self, basis: Basis, coefficients: np.ndarray) -> BSpline:
        """The spline of these coefficients and the line, over sample times."""
        return BSpline(basis.knots, coefficients + self._line(_greville(basis.knots)), SPLINE_DEGREE)

    def _basis(self, reach: float) -> Basis:
        apart = max(reach / KNOTS_A_REACH, 1.0)
        if apart not in self._bases:
            self._bases[apart] = Basis(self.at, apart)
        return self._bases[apart]

    def _tried(self, reaches: np.ndarray, turn: BSpline | None) -> list[TriedSpline]:
        """Splines of these reaches, alone and with harmonics of an angle."""
        waves = np.zeros((self.at.size, 0)) if turn is None else self._waves(turn)
        tried: list[TriedSpline] = []
        for reach in reaches[reaches <= max(reaches[0], self.at[-1])].tolist():
            try:
                fit = SplineFit(self._basis(reach), reach, self._values, waves)
            except LinAlgError:  # as stiff as numbers can have it on this clock
                break
            tried += self._choices(reach, fit)
        return tried

    def _best(self, tried: Sequence[TriedSpline]) -> TriedSpline:
        """The choice that predicts best; where that follows the stairs of coarse counts, the stiffest that they
        allow.
        """
        best, rounding = (
            min(tried, key=lambda choice: (np.round(choice.score, 2), -choice.reach)),
            self._step / math.sqrt(12),
        )
        if best.miss < STAIRS * rounding:
            smooth = [c for c in tried if c.miss <= BLURRED * rounding and c.worst <= BLURRED * self._step / 2]
            best = max([best, *smooth], key=lambda choice: choice.reach)
        return best

    def _choices(self, reach: float, fit: SplineFit) -> Iterator[TriedSpline]:
        n, least = self.at.size, READING_ROUNDING * float(np.ptp(self._values) + abs(self._slope) * self.at[-1])
        for count in (0, *(h for h in HARMONIC_COUNTS if 2 * h <= fit.waves.shape[1])):
            off, free = fit.missed(count), fit.freedom(count)
            left = 1 - free / n
            score = math.inf
            if left > LEFT_FREEDOM:
                score = n * math.log(float(off @ off) / n / left**2 + least**2 + NO_VARIANCE) + 2 * CHARGE * free
            yield TriedSpline(reach, count, score, math.sqrt(float(off @ off) / n), float(np.max(np.abs(off))), fit)


def _greville(knots: np.ndarray) -> np.ndarray:
    """Coefficients (K,) with which B-splines on these knots add up to time itself."""
    return np.lib.stride_tricks.sliding_window_view(knots[1:-1], SPLINE_DEGREE).mean(axis=1)


def _alike(off: np.ndarray) -> float:
    """By how much more neighbours' errors (N,) add up than white ones: 1 plus twice their correlations, up to the first
    that chance may bring.
    """
    square, total = float(off @ off), 1.0
    for lag in range(1, off.size // 4):
        alike = float(off[lag:] @ off[:-lag]) / square if square else 0.0
        if alike < 2 / math.sqrt(off.size):
            break
        total += 2 * alike
    return total

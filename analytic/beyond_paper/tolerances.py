"""What tolerances of a linkage's parts do to its outputs: first order, Monte Carlo, Sobol indices, share that is good.

An output's error is what it differs by from the ideal linkage as drawn: by points that lie elsewhere, exactly, and by
clearances of their sizes, each pin along its reaction in the linkage as drawn (Eq. 8, to first order in the clearance).
Masses, loads, friction and speed move no output of a rigid linkage, but for that direction, which is of second order.

A point's coordinates are factors of the structure's linear forms (:mod:`analytic.kinematics.structure`), so that a
form's slope by each of them is a difference of two forms, without error.  First order follows from the closure
differentiated: a loop that opens by its slope is a gap in the joint that closes it.  The samples of a Monte Carlo close
every loop again, all samples of a crank angle at once.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.closure import close_dyad, least, set_group, set_input
from analytic.kinematics.motion import Gap, Motion, kinematics
from analytic.kinematics.output import Output
from analytic.kinematics.structure import Group, Structure, structure
from analytic.mechanism.tolerances import Source, changed
from analytic.paper.superposition import AccuracyAnalysis

AT_ONCE = 8192  # samples worked on at once: their arrays stay in the processor's cache
CLOSED = 1e-12  # of the loops' size: what Newton's method may leave open
STEPS = 12  # of Newton's method, from the linkage as drawn
ROUNDING = 1e-9  # of the largest standard deviation: a part so small is none
TAIL = 0.025  # 95 % of the samples lie between the two tails
SOBOL_SAMPLES = 2**12  # by which an index of Saltelli's scheme is known to some 0.02

Slopes = Mapping[str, np.ndarray]  # by source
Sides = list[complex | np.ndarray]  # of a form by column: one number, or (S,) for as many linkages


@dataclass(frozen=True)
class OutputErrors:
    """The error of an output at N crank angles, in its unit; arrays are (N,)."""

    slope: Mapping[str, np.ndarray]  # by source: derivative by its number, in SI
    sd: np.ndarray  # standard deviation to first order
    by_group: Mapping[str, np.ndarray]  # standard deviation by each group or lone source alone, to first order
    mean: np.ndarray  # of the samples that assemble
    sigma: np.ndarray
    low: np.ndarray  # 2.5 % of them lie below
    high: np.ndarray  # 2.5 % lie above
    worst: int  # index of the crank angle at which sd is largest, of which the indices are
    first: Mapping[str, float]  # Sobol's first-order index by group or lone source; none where samples do not assemble
    total: Mapping[str, float]


@dataclass(frozen=True)
class TolerancedErrors:
    """Errors by output; shares of the samples."""

    outputs: Mapping[Output, OutputErrors]
    assembled: float  # reach every crank angle
    within: Mapping[
        Output, float
    ]  # are within an output's limit at every crank angle, as those that do not assemble are not
    within_all: float | None  # are so in all limits; None without any


@dataclass(frozen=True)
class Forms:
    """How a structure's forms change with the numbers of some sources, per unit of each: loops (loops, columns), and
    those of points by body and point (columns,).
    """

    loops: Slopes
    points: Mapping[tuple[str, str], Slopes]

    @classmethod
    def of(cls, assembly: Assembly, sources: Sequence[Source], points: Sequence[tuple[str, str]]) -> Forms:
        """The slopes of the sources' fields; none of what moves no point.

        Raises AssemblyError where such a source varies a linkage that has joints too many.
        """
        loops: dict[str, np.ndarray] = {}
        of_points: dict[tuple[str, str], dict[str, np.ndarray]] = {place: {} for place in points}
        for source in sources:
            low, high = source.ends
            a, b = (structure(changed(assembly.mechanism, {source.field: end})) for end in (low, high))
            slope = (b.loops - a.loops) / (high - low)
            if slope.any():
                loops[source.field] = slope
            for place in points:
                moved = (b.form(*place) - a.form(*place)) / (high - low)
                if moved.any():
                    of_points[place][source.field] = moved
        if loops and assembly.overheld:
            raise AssemblyError(
                f"{assembly.mechanism.name}: joints hold it more often than it needs, so that it does not close with"
                f" other lengths, and the tolerance of {next(iter(loops))} varies one",
                remedy="leave that tolerance out, or a joint",
            )
        return cls(loops, of_points)


class Made:
    """Linkages as made: an ideal motion (N,), and errors of outputs where sources have other numbers."""

    def __init__(self, cycle: AccuracyAnalysis, sources: Sequence[Source]) -> None:
        self.assembly, self.ideal = cycle.assembly, cycle.total.clearance.ideal.motion
        self.path, self.outputs, self.sources = cycle.path, tuple(cycle.unit_reactions), tuple(sources)
        self.groups = tuple(dict.fromkeys(source.group for source in self.sources))
        places = dict.fromkeys((d.body, d.point) for d in self.outputs if d.axis != "angle")
        self.forms = Forms.of(self.assembly, self.sources, tuple(places))
        self.shaping = [x for x in self.sources if x.field in {*self.forms.loops}.union(*self.forms.points.values())]
        # by source the motion in which its loops open at the rates of its slopes, the crank at rest
        self.opened = {field: self._open(slope @ self.ideal.columns) for field, slope in self.forms.loops.items()}
        self.nominal = {d: d.value(self.ideal) for d in self.outputs}
        self.along = _along(cycle)  # by output and pin
        # (N,) 0, NaN where a pin has no direction
        self.direction = {
            d: sum((0.0 * along for along in self.along[d].values()), np.zeros(cycle.theta.size)) for d in self.outputs
        }
        self.clearances = cycle.assembly.mechanism.clearances
        self.loose = {_joint(x.field): x for x in self.sources if x.field.endswith(".clearance")}

    def slopes(self, d: Output) -> dict[str, np.ndarray]:
        """Derivatives (N,) of an output's error by each source that changes it, exact."""
        return {x.field: slope for x in self.sources if (slope := self._slope(d, x)) is not None}

    def _slope(self, d: Output, source: Source) -> np.ndarray | None:
        if source.field.endswith(".clearance"):
            return self.along[d].get(_joint(source.field))
        moving = self.opened.get(source.field)
        slope = None if moving is None else d.rate(moving)
        direct = {} if d.axis == "angle" else self.forms.points[d.body, d.point]
        if source.field in direct:
            slope = (0.0 if slope is None else slope) + d.part(direct[source.field] @ self.ideal.columns)
        return slope

    def _open(self, rates: np.ndarray) -> Motion:
        s, closed = self.assembly.structure, np.zeros(self.ideal.theta.size, complex)
        gaps = {}
        for pin in s.pins:
            k = s.gap_column(pin)
            if not s.origins[:, k].any():  # it closes a loop, and no body hangs on it
                (row,) = np.flatnonzero(s.loops[:, k])
                gaps[pin] = Gap(closed, rates[row] / s.loops[row, k])
        return kinematics(self.assembly, self.ideal.theta, gaps=gaps, path=self.path)

    def values(self, shares: np.ndarray) -> dict[str, np.ndarray]:
        """The sources' numbers (S,) of samples whose groups are at these shares (groups, S) of their distributions."""
        return {x.field: x.at(shares[self.groups.index(x.group)]) for x in self.sources}

    def errors(self, k: int, values: Mapping[str, np.ndarray]) -> dict[Output, np.ndarray]:
        """Errors (S,) of the outputs at crank angle k where sources have these numbers (S,), without those of pins
        whose reaction has no direction there; NaN of what does not assemble.
        """
        count = next(iter(values.values())).size
        out = {d: np.empty(count) for d in self.outputs}
        for start in range(0, count, AT_ONCE):
            block = slice(start, start + AT_ONCE)
            for d, error in self._errors(k, {field: number[block] for field, number in values.items()}).items():
                out[d][block] = error
        return out

    def _errors(self, k: int, values: Mapping[str, np.ndarray]) -> dict[Output, np.ndarray]:
        off = {x.field: values[x.field] - x.nominal for x in self.shaping}
        columns, angle, open_ = self._closed(k, off)
        errors = {}
        for d in self.outputs:
            if d.axis == "angle":
                moved = angle(d.body) - self.nominal[d][k] + open_
            else:
                moved = d.part(_side_sum(self._form(d, off), columns)) - self.nominal[d][k] + open_
            for pin, along in self.along[d].items():
                size = values[self.loose[pin].field] if pin in self.loose else self.clearances.get(pin, 0.0)
                moved = moved + np.nan_to_num(along[k]) * np.maximum(size, 0.0)
            errors[d] = moved
        return errors

    def _form(self, d: Output, off: Mapping[str, np.ndarray]) -> Sides:
        return _varied(self.assembly.form(d.body, d.point), self.forms.points[d.body, d.point], off)

    def _closed(
        self, k: int, off: Mapping[str, np.ndarray]
    ) -> tuple[np.ndarray, Callable[[str], np.ndarray], np.ndarray]:
        """Columns (columns, S) of the linkages whose sources are ``off`` (S,) at crank angle k, their bodies' angles,
        and a zero (S,) that is NaN of those that do not close.
        """
        s = self.assembly.structure
        count = next(iter(off.values())).size if off else 1
        drawn = self.ideal.coordinates[:, k]
        u, columns = self.assembly.open(np.full(count, self.ideal.theta[k]))
        u[:], columns = drawn[:, None], columns[: len(s.bodies) + len(s.slides)]
        open_ = np.zeros(count)
        for step in s.steps:
            if isinstance(step, int):
                set_input(s, step, columns, u)
                continue
            rows = [
                _varied(s.loops[loop], {f: slope[loop] for f, slope in self.forms.loops.items()}, off)
                for loop in step.loops
            ]
            if step in self.assembly.branch:
                margin = self._dyad(step, rows[0], columns, u)
                open_[~(margin > 0)] = np.nan
            else:
                open_[~_newton(s, step, rows, columns, u)] = np.nan
        turns = [i for i, c in enumerate(s.coordinates) if c.bodies and i not in s.inputs]
        u[turns] += 2 * np.pi * np.round((drawn[turns, None] - u[turns]) / (2 * np.pi))

        def angle(body: str) -> np.ndarray:
            column = s.body_column(body)
            return np.asarray(u[list(s.turned[column])].sum(axis=0) + s.held_at[column])

        return columns, angle, open_

    def _dyad(self, group: Group, row: Sides, columns: np.ndarray, u: np.ndarray) -> np.ndarray:
        s, unknown = self.assembly.structure, set[int]()
        for i in group.coordinates:
            unknown |= set(s.turning[i]) if s.coordinates[i].bodies else {s.coordinates[i].column}
        known = [0.0 if c in unknown else side for c, side in enumerate(row)]
        target = -_side_sum(known, columns)
        return close_dyad(s, group, row, target, columns, u, self.assembly.branch[group])


def _joint(field: str) -> str:
    return field.split(".")[1]


def _varied(form: np.ndarray, slopes: Slopes, off: Mapping[str, np.ndarray]) -> Sides:
    """A form's sides by column where numbers are ``off`` (S,): one complex number, or (S,)."""
    sides: Sides = [complex(side) for side in form]
    for field, slope in slopes.items():
        for c in np.flatnonzero(slope):
            sides[c] = sides[c] + slope[c] * off[field]
    return sides


def _side_sum(sides: Sequence[complex | np.ndarray], columns: np.ndarray) -> np.ndarray:
    """Sum (S,) of sides times columns, of the gaps' none."""
    out = np.zeros(columns.shape[1], complex)
    for side, column in zip(sides, columns, strict=False):
        if isinstance(side, np.ndarray) or side:
            out += side * column
    return out


def _newton(s: Structure, group: Group, rows: Sequence[Sides], columns: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Close a larger group's loops from the coordinates u (n, S), in place; which samples (S,) are closed."""
    unknown = list(group.coordinates)
    size = max(float(sum(np.max(np.abs(side)) for side in row[: len(s.bodies)])) for row in rows)
    residual = np.zeros((len(rows), columns.shape[1]), complex)
    for _ in range(STEPS):
        set_group(s, group, columns, u)
        residual = np.array([_side_sum(row, columns) for row in rows])
        if not unknown or np.all(np.abs(residual) <= CLOSED * size):
            break
        jacobian = np.array([[_partial(s, i, row, columns) for i in unknown] for row in rows])
        matrix = np.concatenate([jacobian.real, jacobian.imag]).transpose(2, 0, 1)
        try:
            step = least(matrix, np.concatenate([residual.real, residual.imag]).T)
        except np.linalg.LinAlgError:
            break
        u[unknown] -= step.T
    return np.asarray(np.all(np.abs(residual) <= CLOSED * size, axis=0))


def _partial(s: Structure, i: int, row: Sides, columns: np.ndarray) -> np.ndarray:
    c = s.coordinates[i]
    if not c.bodies:
        return np.asarray(row[c.column] * columns[s.slide_body[c.column - len(s.bodies)]])
    return 1j * _side_sum([side if k in s.turning[i] else 0.0 for k, side in enumerate(row)], columns)


def _along(cycle: AccuracyAnalysis) -> dict[Output, dict[str, np.ndarray]]:
    """Displacement (N,) of each output per clearance of each pin that has one, along its reaction; NaN where that has
    no direction.
    """
    loose = [k for k in range(len(cycle.pins)) if cycle.clearances[k]]
    return {
        d: {cycle.pins[k]: (np.conj(unit[k]) * cycle.directions[k]).real for k in loose}
        for d, unit in cycle.unit_reactions.items()
    }


def toleranced_errors(
    cycle: AccuracyAnalysis, sources: Sequence[Source], samples: int, seed: int, limits: Mapping[Output, float]
) -> TolerancedErrors:
    """Errors of a linkage's outputs by tolerances, and the share of linkages as made whose errors are within ``limits``
    (in their units, to either side) at every crank angle.  Raises AssemblyError.
    """
    made = Made(cycle, sources)
    rng = np.random.default_rng(seed)
    values = made.values(rng.random((len(made.groups), samples)))
    closed, counts = np.ones(samples, bool), cycle.theta.size
    within = {d: np.ones(samples, bool) for d in limits}
    spread = {d: np.full((4, counts), np.nan) for d in made.outputs}
    for k in range(counts):
        errors = made.errors(k, values)
        for d, error in errors.items():
            known = np.isfinite(error)
            closed &= known
            if np.isnan(made.direction[d][k]):
                continue
            if d in within:
                within[d] &= np.abs(error) <= limits[d]
            if known.any():
                spread[d][:, k] = _statistics(error if known.all() else error[known])
    outputs = {d: _output(made, d, spread[d], seed if closed.all() else None) for d in made.outputs}
    good = np.all([*within.values(), closed], axis=0)
    return TolerancedErrors(
        outputs,
        float(closed.mean()),
        {d: float((each & closed).mean()) for d, each in within.items()},
        float(good.mean()) if within else None,
    )


def _statistics(values: np.ndarray) -> tuple[float, float, float, float]:
    """Mean, standard deviation, and the ends of the middle 95 %."""
    ordered = np.sort(values)  # faster than numpy's quantiles
    low, high = (ordered[round(share * (values.size - 1))] for share in (TAIL, 1 - TAIL))
    return float(values.mean()), float(values.std()), float(low), float(high)


def _output(made: Made, d: Output, spread: np.ndarray, seed: int | None) -> OutputErrors:
    slope = made.slopes(d)
    parts = {group: np.zeros(made.ideal.theta.size) for group in made.groups}
    for source in made.sources:
        if source.field in slope:
            parts[source.group] += slope[source.field] * source.sd
    sd = np.sqrt(sum((part**2 for part in parts.values()), np.zeros(made.ideal.theta.size)))
    worst = int(np.argmax(np.nan_to_num(sd)))
    sizes = {group: np.abs(part) for group, part in parts.items()}
    by_group = {group: size for group, size in sizes.items() if np.nanmax(size) > ROUNDING * np.nan_to_num(sd[worst])}
    first, total = _sobol(made, d, worst, seed) if seed is not None and sd[worst] > 0 else ({}, {})
    mean, sigma, low, high = spread
    return OutputErrors(slope, sd, by_group, mean, sigma, low, high, worst, first, total)


def _sobol(made: Made, d: Output, k: int, seed: int) -> tuple[dict[str, float], dict[str, float]]:
    """First-order and total Sobol indices by group of an output's error at a crank angle (Saltelli 2010); none of
    groups that move no output.
    """
    from scipy.stats import sobol_indices, uniform

    acting = [*made.shaping, *(x for x in made.loose.values() if _joint(x.field) in made.along[d])]
    moving = list(dict.fromkeys(source.group for source in acting))
    if len(moving) == 1:
        return ({moving[0]: 1.0},) * 2
    rows = [made.groups.index(group) for group in moving]

    def error(shares: np.ndarray) -> np.ndarray:
        every = np.full((len(made.groups), shares.shape[1]), 0.5)
        every[rows] = shares
        return made.errors(k, made.values(every))[d][None]

    found = sobol_indices(func=error, n=SOBOL_SAMPLES, dists=[uniform()] * len(moving), rng=np.random.default_rng(seed))
    return (
        dict(zip(moving, found.first_order.ravel().tolist(), strict=True)),
        dict(zip(moving, found.total_order.ravel().tolist(), strict=True)),
    )

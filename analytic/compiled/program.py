"""A linkage's program: which rows of numbers are added, multiplied and solved for its motion, and for its reactions.

The operations are those of :mod:`analytic.compiled.kernels`; what they compute is what
:mod:`analytic.kinematics.motion` and :mod:`analytic.paper.kinetostatics` compute by numpy, in the same order.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from analytic.compiled import kernels as op
from analytic.kinematics.assembly import Assembly
from analytic.kinematics.closure import arm_of
from analytic.kinematics.structure import Group
from analytic.mechanism import MASS_CENTRE, Joint, Spring

# arrays of a kernel's data, in its order
COORDINATES, RATES, ACCELERATIONS, COLUMNS, COLUMN_RATES, COLUMN_ACCELERATIONS, REALS, COMPLEXES, NEARBY = range(9)
OPERATION_WIDTH = 8  # numbers of an operation
CONSTANT = -1  # row of a sum's constant term


@dataclass(frozen=True)
class Program:
    """Operations (M, OPERATION_WIDTH), the rows and factors of their sums, the larger groups, and how many rows there
    are.
    """

    operations: np.ndarray
    terms: np.ndarray
    groups: np.ndarray
    factors: np.ndarray
    rows: int

    @cached_property
    def simple(self) -> bool:
        """Whether all its groups are dyads."""
        return not np.any(self.operations[:, 0] >= op.GUESS_ROOTS)

    @property
    def numbers(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """All that is written, in a kernel's order."""
        return self.operations, self.terms, self.groups, self.factors

    def work(self) -> np.ndarray:
        """Memory for its rows."""
        return np.empty(self.rows * op.LANES)

    def __repr__(self) -> str:
        return f"Program({len(self.operations)} operations on {self.rows} rows)"


@dataclass
class Writer:
    """Writes a program."""

    operations: list[tuple[int, ...]] = field(default_factory=list)
    terms: list[int] = field(default_factory=list)
    factors: list[float] = field(default_factory=list)
    groups: list[tuple[int, ...]] = field(default_factory=list)
    rows: int = 0

    def real_row(self) -> int:
        """A new real row."""
        self.rows += 1
        return self.rows - 1

    def complex_row(self) -> int:
        """A new complex row."""
        self.rows += 2
        return self.rows - 2

    def add(self, *operation: int) -> None:
        """Add an operation."""
        self.operations.append((*operation, *(0,) * (OPERATION_WIDTH - len(operation))))

    def list_rows(self, rows: Iterable[int]) -> tuple[int, int]:
        """First and last term that name these rows."""
        return self.list_terms((row, 1.0) for row in rows)

    def list_terms(self, terms: Iterable[tuple[int, complex]]) -> tuple[int, int]:
        """First and last of these terms: row and factor."""
        begin = len(self.terms)
        for row, factor in terms:
            self.terms.append(row)
            self.factors += [factor.real, factor.imag]
        return begin, len(self.terms)

    def numbers(self, *values: float) -> int:
        """Place of these numbers among the factors."""
        begin = len(self.factors)
        self.factors += [float(x) for x in values] + [0.0] * (len(values) % 2)
        self.terms += [CONSTANT] * (len(self.factors) // 2 - len(self.terms))  # a term goes with a pair of factors
        return begin

    def sum_real(self, out: int, terms: Iterable[tuple[int, float]]) -> None:
        """Write a sum into a real row."""
        self.add(op.SUM_REAL, out, *self.list_terms(terms))

    def sum(self, out: int, terms: Iterable[tuple[int, complex]], more: bool = False) -> None:
        """Write a sum, whose constant is the last term if it has one, into a complex row; or add rows to what is
        there.
        """
        listed = [*terms] or [(CONSTANT, 0.0)]
        assert all(row != CONSTANT for row, _ in (listed if more else listed[:-1]))
        self.add(op.ADD if more else op.SUM, out, *self.list_terms(listed))

    def program(self) -> Program:
        """What has been written."""
        return Program(
            np.array(self.operations, np.int64).reshape(-1, OPERATION_WIDTH), np.array([*self.terms, 0], np.int64),
            np.array(self.groups, np.int64).reshape(-1, op.SIZE + 1), np.array([*self.factors, 0.0]), self.rows + 1,
        )  # fmt: skip


class LinkageWriter:
    """What programs of one linkage have in common: rows of its coordinates and columns."""

    def __init__(self, assembly: Assembly) -> None:
        self.assembly, self.s, self.w = assembly, assembly.structure, Writer()
        s = self.s
        self.first_travel, self.first_gap = len(s.bodies), len(s.bodies) + len(s.slides)
        turning = {b for c in s.coordinates for b in c.bodies}
        self.fixed = {b: complex(np.exp(1j * s.held_at[b])) for b in range(len(s.bodies)) if b not in turning}
        self.alone = [len(t) == 1 for t in s.turned]  # bodies that turn with one coordinate

    def along(self, i: int) -> int:
        """The body along which the travel i moves."""
        return int(self.s.slide_body[self.s.coordinates[i].column - self.first_travel])

    def terms(self, form: np.ndarray, rows: Mapping[int, int]) -> list[tuple[int, complex]]:
        """Terms of a form (columns,): fixed columns are a constant, columns without a row are zero."""
        places = np.flatnonzero(form).tolist()
        moving: list[tuple[int, complex]] = [(rows[k], complex(form[k])) for k in places if k in rows]
        constant = sum(complex(form[k]) * self.fixed[k] for k in places if k in self.fixed and k not in rows)
        return [*moving, (CONSTANT, constant)] if constant else moving

    def partial(self, i: int, form: np.ndarray, rows: Mapping[int, int]) -> list[tuple[int, complex]]:
        """Terms of the derivative of a form (columns,) by coordinate i."""
        c = self.s.coordinates[i]
        if c.bodies:
            return [(rows[k], 1j * complex(form[k])) for k in self.s.turning[i] if form[k]]
        factor, body = complex(form[c.column]), self.along(i)
        if not factor:
            return []
        return [(rows[body], factor)] if body in rows else [(CONSTANT, factor * self.fixed[body])]

    def jacobian(self, group: Group, rows: Mapping[int, int]) -> list[list[int]]:
        """Rows of the derivatives of a group's loops, per unknown and loop, from rows of the columns."""
        derivatives = [[self.w.complex_row() for _ in group.loops] for _ in group.coordinates]
        for i, part in zip(group.coordinates, derivatives, strict=True):
            for loop, out in zip(group.loops, part, strict=True):
                self.w.sum(out, self.partial(i, self.s.loops[loop], rows))
        return derivatives


class MotionWriter(LinkageWriter):
    """Writes the program of a motion: positions, then rates, then accelerations, with joints' gaps or without."""

    def __init__(self, assembly: Assembly, displaced: bool) -> None:
        super().__init__(assembly)
        s, w = self.s, self.w
        self.displaced = displaced
        self.u, self.near = [w.real_row() for _ in s.coordinates], [w.real_row() for _ in s.coordinates]
        self.columns: dict[int, int] = {}
        self.margins: dict[Group, int] = {}
        self.jacobians: dict[Group, list[list[int]]] = {}  # rows of a complex number per unknown and loop
        self.tables: dict[Group, int] = {}

    # ------------------------------------------------------------ positions

    def positions(self) -> None:
        """Close the linkage, from inputs that are in their rows."""
        s, w = self.s, self.w
        if self.displaced:
            self.load_gaps(COLUMNS, self.columns)
        for step in s.steps:
            if isinstance(step, int):
                self.place_input(step)
            elif step.dyad:
                for b in s.stacked[s.groups.index(step)]:
                    self.turn_body(b)
                self.dyad(step)
            else:
                self.larger(step)
        for group in s.groups:
            if not group.dyad:
                for i in group.coordinates:
                    if s.coordinates[i].bodies:
                        w.add(op.WITHIN, self.u[i], self.near[i])

    def load_gaps(self, array: int, columns: dict[int, int]) -> None:
        for k in range(self.first_gap, self.s.n_columns):
            columns[k] = self.w.complex_row()
            self.w.add(op.LOAD_COMPLEX, columns[k], array, k)

    def place_input(self, i: int) -> None:
        child = self.s.hung.index(i)
        if len(self.s.turned[child]) > 1:
            self.turn_body(child)
        self.place(i)

    def place(self, i: int, phasor: int | None = None) -> None:
        """Write coordinate i into the columns that it moves; bodies that turn with others too are left."""
        s, w, c = self.s, self.w, self.s.coordinates[i]
        if not c.bodies:
            self.travel(i)
            return
        alone = [b for b in c.bodies if self.alone[b]]
        if phasor is None:
            phasor = w.complex_row()
            w.add(op.PHASOR, phasor, self.u[i])
        for b in alone:
            if s.held_at[b] == 0:
                self.columns[b] = phasor
            else:
                self.columns[b] = self.columns.get(b, w.complex_row())
                w.sum(self.columns[b], [(phasor, complex(np.exp(1j * s.held_at[b])))])

    def travel(self, i: int) -> None:
        column = self.s.coordinates[i].column
        self.columns[column] = self.columns.get(column, self.w.complex_row())
        self.times(op.TIMES, self.columns[column], self.u[i], self.along(i))

    def times(self, code: int, out: int, real: int, body: int) -> None:
        """A product with a body's phasor."""
        self.w.add(code, out, real, self.phasor(body))

    def phasor(self, body: int) -> int:
        """Row of a body's phasor; of one that does not turn it is made once."""
        if body not in self.columns:
            self.columns[body] = self.w.complex_row()
            self.w.sum(self.columns[body], [(CONSTANT, self.fixed[body])])
        return self.columns[body]

    def turn_body(self, b: int) -> None:
        """Write the phasor of a body that turns with a sum of coordinates."""
        w = self.w
        self.columns[b] = self.columns.get(b, w.complex_row())
        angle = w.real_row()
        w.sum_real(angle, [*((self.u[i], 1.0) for i in self.s.turned[b]), (CONSTANT, float(self.s.held_at[b]))])
        w.add(op.PHASOR, self.columns[b], angle)

    def dyad(self, group: Group) -> None:
        """Close a dyad's loop in closed form, as analytic.kinematics.closure.solve_dyad."""
        s, w = self.s, self.w
        row, (i, j), branch = s.loops[group.loops[0]], group.coordinates, self.assembly.branch[group]
        target, margin = w.complex_row(), w.real_row()
        self.margins[group] = margin
        w.sum(target, [(k, -factor) for k, factor in self.terms(row, self.columns)])
        angles = [k for k in (i, j) if s.coordinates[k].bodies]
        if len(angles) == 2:
            self.two_angles(row, (i, j), branch, target, margin)
        elif angles:
            self.angle_and_travel(row, angles[0], j if angles[0] == i else i, branch, (target, margin))
        else:
            one, two = (complex(row[s.coordinates[k].column]) for k in (i, j))
            at = w.numbers(one.real, one.imag, two.real, two.imag)
            along = [self.phasor(self.along(k)) for k in (i, j)]
            w.add(op.TWO_TRAVELS, target, self.u[i], self.u[j], margin, at, *along)
            self.travel(i)
            self.travel(j)

    def two_angles(self, row: np.ndarray, pair: tuple[int, int], branch: float, target: int, margin: int) -> None:
        w = self.w
        a, b = (arm_of(self.s, row, k) for k in pair)
        la, lb, one, two = abs(a), abs(b), 1 / a, 1 / b
        at = w.numbers(
            la**2, lb**2, 2 * la * lb, branch * la * lb, one.real, one.imag, two.real, two.imag
        )  # fmt: skip
        phasors = w.complex_row(), w.complex_row()
        w.add(op.TWO_ANGLES, target, *phasors, margin, at)
        for k, phasor in zip(pair, phasors, strict=True):
            self.angle(k, phasor)

    def angle(self, i: int, phasor: int) -> None:
        self.w.add(op.ANGLE, self.u[i], phasor, self.near[i])
        self.place(i, phasor)

    def angle_and_travel(self, row: np.ndarray, i: int, j: int, branch: float, rows: tuple[int, int]) -> None:
        s, w, (target, margin) = self.s, self.w, rows
        arm, along, body = arm_of(s, row, i), complex(row[s.coordinates[j].column]), self.along(j)
        phasor = w.complex_row()
        if body in s.coordinates[i].bodies:
            along *= complex(np.exp(1j * s.held_at[body]))
            size = abs(along)
            across = arm / (along / size)
            reach = float(np.abs(row[: len(s.bodies)]).sum())
            at = w.numbers(
                across.real, across.imag, reach, branch, size, arm.real, arm.imag, along.real, along.imag
            )  # fmt: skip
            w.add(op.SLIDE_TURNS, target, phasor, self.u[j], margin, at)
        else:
            one = 1 / arm
            at = w.numbers(abs(arm) ** 2, branch, one.real, one.imag, along.real, along.imag)
            w.add(op.SLIDE_KNOWN, target, phasor, self.u[j], margin, at, self.phasor(body))
        self.angle(i, phasor)
        self.travel(j)

    def larger(self, group: Group) -> None:
        """Close a larger group's loops by Newton's method."""
        s, w = self.s, self.w
        acting = (*group.coordinates, *group.within)
        stacked = s.stacked[s.groups.index(group)]
        loose = [b for i in acting for b in s.coordinates[i].bodies if self.alone[b]]
        slides = [i for i in acting if not s.coordinates[i].bodies]
        for i in slides:  # what a travel is along, and is not this group's, is known
            if self.along(i) not in (*loose, *stacked):
                self.phasor(self.along(i))
        margin = self.margins[group] = w.real_row()
        residual = [w.complex_row() for _ in group.loops]
        w.add(op.GUESS_ROOTS, len(w.groups))
        begin = len(w.operations)
        for i in acting:
            if s.coordinates[i].bodies:
                self.place(i)
        for b in stacked:
            self.turn_body(b)
        for i in slides:
            self.travel(i)
        for row, out in zip(group.loops, residual, strict=True):
            w.sum(out, self.terms(s.loops[row], self.columns))
        self.jacobians[group] = self.jacobian(group, self.columns)
        w.add(op.NEWTON, self.table(group, residual), begin, margin)

    def table(self, group: Group, residual: list[int]) -> int:
        s, w = self.s, self.w
        arms = np.abs(s.loops[list(group.loops), : len(s.bodies)]).sum(axis=1).max(initial=0.0)
        travels = [row for k, row in self.columns.items() if self.first_travel <= k < self.first_gap]
        w.groups.append((
            len(group.coordinates), len(group.loops),
            w.list_rows(row for part in self.jacobians[group] for row in part)[0], w.list_rows(residual)[0],
            w.list_rows(self.u[i] for i in group.coordinates)[0],
            w.list_rows(self.near[i] for i in group.coordinates)[0],
            w.list_rows(travels)[0], len(travels), w.numbers(arms),
        ))  # fmt: skip
        self.tables[group] = len(w.groups) - 1
        return self.tables[group]

    # ------------------------------------------------------------ rates and accelerations

    def rates(self) -> None:
        """Differentiate the closures once and twice."""
        s, w = self.s, self.w
        for group in s.groups:
            if group not in self.jacobians:
                self.jacobians[group] = self.jacobian(group, self.columns)
        self.spin, bend = [w.real_row() for _ in s.coordinates], [w.real_row() for _ in s.coordinates]
        turns: dict[int, int] = {}
        self.column_rates: dict[int, int] = {}
        self.column_accelerations: dict[int, int] = {}
        self.load_inputs(RATES, self.spin)
        if self.displaced:
            self.load_gaps(COLUMN_RATES, self.column_rates)
            self.load_gaps(COLUMN_ACCELERATIONS, self.column_accelerations)
        self.differentiate(self.spin, self.column_rates)
        for b, turned in enumerate(s.turned):
            if turned:
                turns[b] = self.spin[turned[0]]
            if len(turned) > 1:
                turns[b] = w.real_row()
                w.sum_real(turns[b], [(self.spin[i], 1.0) for i in turned])
        self.centripetal(turns)
        self.load_inputs(ACCELERATIONS, bend)
        self.differentiate(bend, self.column_accelerations)
        self.bend = bend

    def load_inputs(self, array: int, rows: list[int]) -> None:
        for i in self.s.inputs:
            self.w.add(op.LOAD_REAL, rows[i], array, i)

    def centripetal(self, turns: Mapping[int, int]) -> None:
        s, w = self.s, self.w
        for b, spin in turns.items():
            riding = s.riding((b,))
            for k in (b, *riding):
                self.column_accelerations[k] = w.complex_row()
                w.sum(self.column_accelerations[k], ())
                w.add(op.CENTRIPETAL, self.column_accelerations[k], spin, self.columns[k])
            for k in riding:
                w.add(op.CORIOLIS, self.column_accelerations[k], spin, self.columns[k], self.column_rates[k])

    def differentiate(self, values: list[int], columns: dict[int, int]) -> None:
        """Solve the differentiated closures for rows of coordinates' derivatives and of columns'."""
        s, w = self.s, self.w
        for i in s.inputs:
            self.spread(i, values[i], columns)
        for group in s.groups:
            right = [w.complex_row() for _ in group.loops]
            for row, out in zip(group.loops, right, strict=True):
                w.sum(out, moving_terms(s.loops[row], columns))
            if group.dyad:
                (a,), (b,) = self.jacobians[group]
                w.add(op.SOLVE_TWO, right[0], a, b, *(values[i] for i in group.coordinates))
            elif group.coordinates:
                unknown = w.list_rows(values[i] for i in group.coordinates)[0]
                w.add(op.SOLVE, self.tables[group], w.list_rows(right)[0], unknown)
            for i in group.coordinates:
                self.spread(i, values[i], columns)

    def spread(self, i: int, value: int, columns: dict[int, int]) -> None:
        """Add to the columns' derivatives what a derivative of coordinate i does."""
        c = self.s.coordinates[i]
        if not c.bodies:
            self.spread_into(columns, c.column, (op.TIMES, op.TIMES_ADD), value, self.phasor(self.along(i)))
            return
        for k in self.s.turning[i]:
            self.spread_into(columns, k, (op.TURN, op.TURN_ADD), value, self.columns[k])

    def spread_into(self, columns: dict[int, int], k: int, codes: tuple[int, int], value: int, column: int) -> None:
        known = k in columns
        if not known:
            columns[k] = self.w.complex_row()
        self.w.add(codes[known], columns[k], value, column)

    def store(self) -> None:
        """Store all that has been found; columns that do not move have derivatives of zero."""
        s, w, still = self.s, self.w, self.w.complex_row()
        w.sum(still, ())
        for array, rows in ((COORDINATES, self.u), (RATES, self.spin), (ACCELERATIONS, self.bend)):
            for i in range(len(s.coordinates)):
                if i not in s.inputs:
                    w.add(op.STORE_REAL, rows[i], array, i)
        for b in self.fixed:
            self.phasor(b)
        every = (
            (COLUMNS, self.columns),
            (COLUMN_RATES, self.column_rates),
            (COLUMN_ACCELERATIONS, self.column_accelerations),
        )
        for array, columns in every:
            for k in range(self.first_gap):
                w.add(op.STORE_COMPLEX, columns.get(k, still), array, k)


def moving_terms(form: np.ndarray, rows: Mapping[int, int]) -> list[tuple[int, complex]]:
    """Terms of a form's derivative: columns without a row are at rest."""
    return [(rows[k], complex(form[k])) for k in np.flatnonzero(form).tolist() if k in rows]


def motion_program(assembly: Assembly, displaced: bool) -> Program:
    """The program of a motion, with joints' gaps or without."""
    link = MotionWriter(assembly, displaced)
    s, w = link.s, link.w
    link.load_inputs(COORDINATES, link.u)
    if s.by_crank:
        expected = [(row, float(1 + i)) for i, row in enumerate(link.near) if i not in s.inputs]
        w.add(op.NEAR, link.u[s.inputs[0]], *w.list_terms(expected))
    else:
        for i, row in enumerate(link.near):
            if i not in s.inputs:
                w.add(op.LOAD_REAL, row, NEARBY, i)
    link.positions()
    link.rates()
    link.store()
    return w.program()


# ---------------------------------------------------------------- reactions


class BalanceWriter(LinkageWriter):
    """Writes the program of the reactions to a motion whose arrays are in the kernel's data."""

    def __init__(self, assembly: Assembly, inertia: bool, displaced: bool, gripped: bool) -> None:
        super().__init__(assembly)
        self.inertia, self.displaced, self.gripped = inertia, displaced, gripped
        self.loaded: dict[tuple[int, int], int] = {}
        self.work: dict[int, int] = {}  # rows of the work on a unit of each column, conjugate
        self.torques: dict[int, list[tuple[int, float]]] = {b: [] for b in range(len(self.s.bodies))}  # terms
        self.travel_forces: dict[str, int] = {}
        self.paces: list[int] = []

    def load(self, array: int, k: int) -> int:
        """Row of a motion's array, loaded once."""
        if (array, k) not in self.loaded:
            whole = array in (COLUMNS, COLUMN_RATES, COLUMN_ACCELERATIONS)
            self.loaded[array, k] = row = self.w.complex_row() if whole else self.w.real_row()
            self.w.add(op.LOAD_COMPLEX if whole else op.LOAD_REAL, row, array, k)
        return self.loaded[array, k]

    def moving(self, array: int) -> dict[int, int]:
        """Rows of the columns that move, of their rates or accelerations."""
        last = self.s.n_columns if self.displaced else self.first_gap
        return {k: self.load(array, k) for k in range(last) if k not in self.fixed}

    def coordinates(self, array: int) -> list[int]:
        return [self.load(array, i) for i in range(len(self.s.coordinates))]

    def turn(self, array: int, body: str, factor: float = 1.0) -> list[tuple[int, float]]:
        """Terms of a body's angle, without what it is held at, or of its derivatives."""
        return [(self.load(array, i), factor) for i in self.s.turned[self.s.body_column(body)]]

    def write(self) -> Program:
        """The whole program."""
        self.work_of_forces()
        self.torques_on_bodies()
        for group in reversed(self.s.groups):
            if group.coordinates:
                self.close(group)
        self.store()
        return self.w.program()

    # ------------------------------------------------------------ applied and inertia forces

    def work_of_forces(self) -> None:
        """Work of all applied and inertia forces, conjugate: a constant, the masses' and the springs'."""
        s, w, m = self.s, self.w, self.s.mechanism
        constant, masses = np.zeros(s.n_columns, complex), np.zeros((s.n_columns, s.n_columns), complex)
        for body in m.bodies:
            form = self.assembly.form(body.name, MASS_CENTRE)
            constant += np.conj(form) * (body.mass * complex(*m.gravity))
            masses += body.mass * np.outer(np.conj(form), form)
        for load in m.loads:
            constant += np.conj(self.assembly.form(load.body, load.point)) * complex(*load.force)
        moving = self.moving(COLUMN_ACCELERATIONS) if self.inertia else {}
        for k in range(1, s.n_columns):  # nothing is done to the ground
            self.work[k] = w.complex_row()
            terms = [(row, -complex(masses[k, j])) for j, row in moving.items() if masses[k, j]]
            w.sum(self.work[k], [*terms, (CONSTANT, complex(constant[k]))])
        for spring in m.springs:
            self.spring(spring)

    def spring(self, spring: Spring) -> None:
        w, (near, far) = self.w, spring.ends
        ends = [self.assembly.form(*end) for end in (near, far)]
        apart, pull, rate = w.complex_row(), w.complex_row(), CONSTANT
        w.sum(apart, self.terms(ends[1] - ends[0], self.moving(COLUMNS)))
        if self.inertia:
            rate = w.complex_row()
            w.sum(rate, moving_terms(ends[1] - ends[0], self.moving(COLUMN_RATES)))
        w.add(op.PULL, pull, apart, rate, w.numbers(spring.stiffness, spring.length, spring.damping))
        pushed = ends[0] - ends[1]
        for k in np.flatnonzero(pushed).tolist():
            if k in self.work:
                w.sum(self.work[k], [(pull, complex(np.conj(pushed[k])))], more=True)

    def torques_on_bodies(self) -> None:
        """Terms of the torques on each body, and rows of the forces along each slide."""
        s, w, m = self.s, self.w, self.s.mechanism
        for body in m.bodies if self.inertia else ():
            self.torques[s.body_column(body.name)] += self.turn(ACCELERATIONS, body.name, -body.moment_of_inertia)
        for load in m.loads:
            if load.torque:
                self.torques[s.body_column(load.body)].append((CONSTANT, load.torque))
        wave = m.periodic_torque
        if wave is not None:
            row = w.real_row()
            w.add(
                op.WAVE, row, self.load(COORDINATES, s.inputs[0]), w.numbers(wave.amplitude, wave.harmonic, wave.phase)
            )
            self.torques[s.body_column(m.driven)].append((row, 1.0))
        for joint in m.joints:
            if joint.has_law:
                self.law(joint)

    def law(self, joint: Joint) -> None:
        """The row of a joint's own torque, or force along its slide."""
        s, w, (first, second) = self.s, self.w, joint.bodies
        out = w.real_row()
        if joint.prismatic:
            i = next(i for i, c in enumerate(s.coordinates) if c.joint == joint.name and not c.bodies)
            position, rate = self.load(COORDINATES, i), self.load(RATES, i)
            self.travel_forces[joint.name] = out
        else:
            position, rate = w.real_row(), w.real_row()
            held = float(s.held_at[s.body_column(second)] - s.held_at[s.body_column(first)])
            angle = [*self.turn(COORDINATES, second), *self.turn(COORDINATES, first, -1.0)]
            w.sum_real(position, [*angle, (CONSTANT, held)])
            w.sum_real(rate, [*self.turn(RATES, second), *self.turn(RATES, first, -1.0)])
            self.torques[s.body_column(second)].append((out, 1.0))
            self.torques[s.body_column(first)].append((out, -1.0))
        numbers = (joint.stiffness, joint.cubic, joint.rest_angle, joint.damping, joint.drag, joint.coulomb)
        at = w.numbers(*numbers, joint.stiction, joint.stribeck_speed or 0.0)
        w.add(op.LAW, out, position, rate, self.pace(), self.load(REALS, 0) if self.gripped else -1, at, self.inertia)

    def pace(self) -> int:
        """Row of the fastest input's rate."""
        if not self.paces:
            self.paces.append(self.w.real_row())
            inputs = [self.load(RATES, i) for i in self.s.inputs]
            self.w.add(op.LARGEST_SIZE, self.paces[0], *self.w.list_rows(inputs))
        return self.paces[0]

    # ------------------------------------------------------------ closing forces, last group first

    def table(self, group: Group, jacobian: list[list[int]]) -> int:
        """Place of a larger group among the program's."""
        begin = self.w.list_rows(row for part in jacobian for row in part)[0]
        self.w.groups.append((len(group.coordinates), len(group.loops), begin, *(0,) * (op.SIZE - 2)))
        return len(self.w.groups) - 1

    def close(self, group: Group) -> None:
        """Add the work of a group's closing forces."""
        s, w = self.s, self.w
        jacobian, forces = self.jacobian(group, self.moving(COLUMNS)), [w.complex_row() for _ in group.loops]
        work = [self.generalised(i) for i in group.coordinates]
        if group.dyad:
            w.add(op.FORCE_TWO, forces[0], jacobian[0][0], jacobian[1][0], *work)
        else:
            w.add(op.FORCE, self.table(group, jacobian), w.list_rows(forces)[0], w.list_rows(work)[0])
        for loop, force in zip(group.loops, forces, strict=True):
            for k in np.flatnonzero(s.loops[loop]).tolist():
                if k in self.work:
                    w.sum(self.work[k], [(force, complex(np.conj(s.loops[loop, k])))], more=True)

    def generalised(self, i: int, sign: float = 1.0) -> int:
        """Row of the work on a unit change of coordinate i, or of its negative."""
        w, c = self.w, self.s.coordinates[i]
        if c.bodies:
            return self.turning_work(c.bodies, self.s.turning[i], sign)
        out, along = w.real_row(), self.along(i)
        force = self.travel_forces.get(c.joint)
        w.sum_real(out, [(force, 1.0)] if force is not None else [])
        w.add(op.DOT, out, self.work[c.column], self.phasor(along))
        return out if sign > 0 else self.negative(out)

    def negative(self, row: int) -> int:
        out = self.w.real_row()
        self.w.sum_real(out, [(row, -1.0)])
        return out

    def phasor(self, body: int) -> int:
        return self.load(COLUMNS, body)

    def turning_work(self, bodies: Iterable[int], turning: Iterable[int], sign: float = 1.0) -> int:
        """Row of the work on a unit turn of these bodies, and columns that turn with them."""
        w, out = self.w, self.w.real_row()
        terms: dict[int, float] = {}
        for row, factor in (term for b in bodies for term in self.torques[b]):
            terms[row] = terms.get(row, 0.0) + factor
        w.sum_real(out, [term for term in terms.items() if term[1]])
        for k in turning:
            if k in self.work:
                w.add(op.CROSS, out, self.work[k], self.load(COLUMNS, k))
        return out if sign > 0 else self.negative(out)

    def store(self) -> None:
        """Store the joints' forces, the slides' moments and what moves each input."""
        s, w = self.s, self.w
        for place, joint in enumerate(s.mechanism.joints):
            if joint.prismatic:
                force = w.complex_row()
                w.sum(force, [(self.work[s.slide_column(joint.name)], -joint.direction)])
            else:
                force = self.work[s.gap_column(joint.name)]
            w.add(op.STORE_COMPLEX, force, COMPLEXES, place)
        for place, (carried, second) in enumerate(zip(s.turned_by, s.far_is_second, strict=True)):
            moment = self.turning_work(carried, (*carried, *s.riding(carried)), -1.0 if second else 1.0)
            w.add(op.STORE_REAL, moment, REALS, 1 + place)
        for place, i in enumerate(s.inputs):
            w.add(op.STORE_REAL, self.generalised(i, -1.0), REALS, 1 + len(s.slides) + place)


def balance_program(assembly: Assembly, inertia: bool, displaced: bool, gripped: bool) -> Program:
    """The program of the reactions; ``gripped`` says that a share of the friction acts, the first of the real rows."""
    return BalanceWriter(assembly, inertia, displaced, gripped).write()


@dataclass(frozen=True)
class WalkProgram:
    """The program that closes a linkage from its inputs' rows, and what a kernel has to know to follow them."""

    program: Program
    places: np.ndarray  # (4, n) rows of coordinates, where they are expected, whether of a larger group; the inputs
    margins: np.ndarray  # rows of the dyads' margins
    regular: np.ndarray  # rows of the larger groups'


def walk_program(assembly: Assembly) -> WalkProgram:
    """How inputs are followed."""
    link = MotionWriter(assembly, False)
    link.positions()
    s = link.s
    larger = {i for group in s.groups if not group.dyad for i in group.coordinates}
    ahead = [int(i in larger) for i in range(len(s.coordinates))]
    inputs = [*s.inputs, *(0,) * (len(s.coordinates) - len(s.inputs))]
    margins, regular = ([row for g, row in link.margins.items() if g.dyad == dyad] for dyad in (True, False))
    places = np.array([link.u, link.near, ahead, inputs], np.int64)
    return WalkProgram(link.w.program(), places, np.array(margins, np.int64), np.array(regular, np.int64))

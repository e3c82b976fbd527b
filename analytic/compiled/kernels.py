"""Kernels that carry out a linkage's program (:mod:`analytic.compiled.program`), compiled by numba and kept on disk.

A program works on *rows* of LANES numbers, one number for each of as many configurations: a real row, or two rows for
a complex one, real part first.  The rows of a small linkage fit the processor's first cache, and a batch of any size
needs no memory beyond them and its results.  An operation is a row of integers: its code, then what it reads and
writes.  Which rows a sum adds up, and with what factors, is in ``terms`` and ``factors``; every linkage is carried out
by the same compiled code.

Nothing here raises: a kernel says whether all went well.  What goes wrong is left to the numpy functions, which say
what it is.  All kernels are in this file, because numba compiles again what it has kept on disk when this file changes,
and only then.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np
from numba import njit, types
from numba.extending import intrinsic
from numba.np.arrayobj import populate_array

LANES = 120  # not a power of two: rows so far apart would share their places in the processor's cache
CHANGE_POINT_SINE = 1e-5  # as analytic.kinematics.assembly's, of the sine itself
AGREE = 1e-6  # as analytic.kinematics.closure's
DEAD_CENTRE = 1e-12  # as analytic.kinematics.motion's
ITERATIONS = 30  # of Newton's method, as analytic.kinematics.closure's
ZOOM, ZOOMS = 41, 5  # samples in which a change point between two steps is looked for, and how often

# ---------------------------------------------------------------- operations: code, then what each number after it is
LOAD_REAL = 0  # out, array, its row
LOAD_COMPLEX = 1
STORE_REAL = 2  # row, array, its row
STORE_COMPLEX = 3
NEAR = 4  # input, first and last term: rows of coordinates, interpolated on rows (the factors) of the path
SUM = 5  # out, first and last term; a term of row -1 is a constant
SUM_REAL = 6
ADD = 7  # as SUM, to what is there
LAST_SUM = 7

PHASOR = 10  # out, angle: exp(i angle)
ANGLE = 11  # out, phasor, near: its angle, within half a turn of near
TIMES = 12  # out, real, complex: their product
TIMES_ADD = 13
TURN = 14  # out, real, complex: i times their product
TURN_ADD = 15
CENTRIPETAL = 16  # out, rate, complex: out minus rate^2 times complex
CORIOLIS = 17  # out, rate, complex, its rate: out plus 2 i rate (its rate less i rate complex)
WITHIN = 18  # angle, near: the angle within half a turn of near
LAST_PRODUCT = 18

DOT = 20  # out, complex, complex: real out plus their scalar product
CROSS = 21  # out, complex, complex: real out less the work of the first on a unit turn of the second
LARGEST_SIZE = 22  # out, first and last term: largest size of real rows
LAW = 23  # out, position, rate, pace, grip or -1, first factor, whether the linkage moves
WAVE = 24  # out, angle, first factor
PULL = 25  # out, apart, rate or -1, first factor
LAST_LOAD = 25

TWO_ANGLES = 30  # target, first out, second out, margin, first factor
SLIDE_TURNS = 31  # target, angle's phasor out, travel out, margin, first factor
SLIDE_KNOWN = 32  # target, angle's phasor out, travel out, margin, first factor, body along which it slides
TWO_TRAVELS = 33  # target, first out, second out, margin, first factor, bodies along which they slide
SOLVE_TWO = 34  # right side, first side, second side, first out, second out
FORCE_TWO = 35  # out, first side, second side, first work, second work

GUESS_ROOTS = 40  # group
NEWTON = 41  # group, operation to go back to until its loops are closed, margin
SOLVE = 42  # group, first term of the right sides' rows, then of the unknowns'
FORCE = 43  # group, first term of the forces' rows, then of the works'

SMALLEST_NUMBER = 1e-100  # as analytic.mechanism.parts'

# a group's matrix, its rows' order, its reflections, and the two sides of its equations
_Spare = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]
# a walk's last three samples: inputs, coordinates, dyads' margins
_History = tuple[np.ndarray, np.ndarray, np.ndarray]
# a walk's numbers, the ends of its step, the ends of what is looked at, its last samples
_State = tuple[np.ndarray, tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray], _History]

_Kernel = TypeVar("_Kernel", bound=Callable[..., Any])
_compile: Any = njit


def _inner(function: _Kernel) -> _Kernel:
    """A function that only other compiled functions call."""
    return _compile(function, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)


def _merged(function: _Kernel) -> _Kernel:
    """A function that is called in one place, and becomes part of what calls it: so it is compiled once."""
    return _compile(function, error_model="numpy", inline="always")


def _called(function: _Kernel) -> _Kernel:
    """A function that Python calls; it is compiled at its first call, and kept on disk."""
    return _compile(function, cache=True, error_model="numpy", nogil=True)


# sine, cosine and arctangent after Moshier's Cephes library and FreeBSD's msun, without branches, for whole rows
ROUND = 6755399441055744.0  # 1.5 * 2^52: added and taken away again, it rounds to the nearest integer
QUARTER_1, QUARTER_2, QUARTER_3 = 1.57079632673412561417e00, 6.07710050630396597660e-11, 2.02226624871116645580e-21
QUARTER_4 = 8.47842766036889956997e-32  # pi/2 in parts of 33 bits
LARGEST_REDUCED = 1e6  # rad, up to which those parts are enough
S1, S2, S3 = -1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04
S4, S5, S6 = 2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10
C1, C2, C3 = 4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05
C4, C5, C6 = -2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11
P0, P1, P2 = -8.750608600031904122785e-1, -1.615753718733365076637e1, -7.500855792314704667340e1
P3, P4 = -1.228866684490136173410e2, -6.485021904942025371773e1
Q0, Q1, Q2 = 2.485846490142306297962e1, 1.650270098316988542046e2, 4.328810604912902668951e2
Q3, Q4 = 4.853903996359136964868e2, 1.945506571482613964425e2
BEND = 0.41421356237309503  # tan(pi/8)


def _view(context: Any, work: Any, k: Any) -> Any:
    """View of row k of ``work``, and of the next, which is its imaginary part.

    A slice would do the same; its bounds are looked at in so much code that everything takes thrice as long to compile.
    """

    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        whole = context.make_array(signature.args[0])(context, builder, arguments[0])
        out = context.make_array(signature.return_type)(context, builder)
        size = context.get_constant(types.intp, 8)
        at = builder.mul(arguments[1], context.get_constant(types.int64, LANES))
        shape = (context.get_constant(types.intp, 2 * LANES),)
        populate_array(out, builder.gep(whole.data, [at]), shape, (size,), size, None)
        return out._getvalue()

    return types.Array(types.float64, 1, "C")(work, k), build


_row: Callable[[np.ndarray, int], np.ndarray] = cast(Any, intrinsic)(_view)


def _uncounted(context: Any, array: Any) -> Any:
    """The array without its count of references, which each operation would raise and lower for all it is given: that
    takes longer than the operation.  Whoever calls a kernel holds its arrays.
    """

    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        given = context.make_array(array)(context, builder, arguments[0])
        out = context.make_array(array)(context, builder)
        populate_array(out, given.data, given.shape, given.strides, given.itemsize, None)
        return out._getvalue()

    return array(array), build


_bare: Callable[[np.ndarray], np.ndarray] = cast(Any, intrinsic)(_uncounted)


# ---------------------------------------------------------------- moving and adding rows


@_merged
def _load(op: np.ndarray, data: tuple[np.ndarray, ...], work: np.ndarray, first: int, n: int) -> None:
    source = data[op[2]][op[3]]
    if op[0] == LOAD_REAL:
        out, source = _row(work, op[1]), source[first : first + n]
        for j in range(n):
            out[j] = source[j]
        return
    out, source = _row(work, op[1]), source[2 * first : 2 * (first + n)]
    for j in range(n):
        out[j] = source[2 * j]
        out[LANES + j] = source[2 * j + 1]


@_merged
def _store(op: np.ndarray, data: tuple[np.ndarray, ...], work: np.ndarray, first: int, n: int) -> None:
    target = data[op[2]][op[3]]
    if op[0] == STORE_REAL:
        row, target = _row(work, op[1]), target[first : first + n]
        for j in range(n):
            target[j] = row[j]
        return
    row, target = _row(work, op[1]), target[2 * first : 2 * (first + n)]
    for j in range(n):
        target[2 * j] = row[j]
        target[2 * j + 1] = row[LANES + j]


@_merged
def _bracket(known: np.ndarray, x: float, at: int) -> int:
    """Left end of the interval of increasing numbers in which x lies, of the first or last one for an x beyond them;
    ``at`` is that of the x before.
    """
    last = known.size - 2
    if known[at] <= x:
        if at == last or x < known[at + 1]:
            return at
        if at + 1 == last or x < known[at + 2]:
            return at + 1
    low, high = 0, last + 1
    while high - low > 1:
        middle = (low + high) // 2
        if known[middle] <= x:
            low = middle
        else:
            high = middle
    return low


@_inner
def _near(op: np.ndarray, tables: tuple[np.ndarray, np.ndarray], path: np.ndarray, work: np.ndarray, n: int) -> None:
    """Interpolate the path (1 + coordinates, M), the crank's angle first, at the crank's angles; ends are kept."""
    terms, factors = tables
    angle, known = _row(work, op[1]), path[0]
    if known.size == 1 or op[2] == op[3]:
        for k in range(op[2], op[3]):
            out, value = _row(work, terms[k]), path[int(factors[2 * k]), 0]
            for j in range(n):
                out[j] = value
        return
    place, at = _row(work, terms[op[2]]), 0  # along the path, in samples; the last coordinate that is written
    for j in range(n):
        at = _bracket(known, angle[j], at)
        share = (angle[j] - known[at]) / (known[at + 1] - known[at])
        place[j] = at + min(max(share, 0.0), 1.0)
    last = known.size - 2
    for k in range(op[3] - 1, op[2] - 1, -1):
        out, values = _row(work, terms[k]), path[int(factors[2 * k])]
        for j in range(n):
            left = min(int(place[j]), last)
            out[j] = values[left] + (place[j] - left) * (values[left + 1] - values[left])


@_inner
def _sum_real(op: np.ndarray, terms: np.ndarray, factors: np.ndarray, work: np.ndarray, n: int) -> None:
    out, begin = _row(work, op[1]), op[2]
    if begin < op[3] and terms[begin] >= 0:
        a, x = factors[2 * begin], _row(work, terms[begin])
        for j in range(n):
            out[j] = a * x[j]
        begin += 1
    else:
        for j in range(n):
            out[j] = 0.0
    for t in range(begin, op[3]):
        a = factors[2 * t]
        if terms[t] < 0:
            for j in range(n):
                out[j] += a
        else:
            x = _row(work, terms[t])
            for j in range(n):
                out[j] += a * x[j]


@_merged
def _first(out: np.ndarray, x: np.ndarray, a: float, b: float, c: float, d: float, n: int) -> None:
    """The first row of a sum, and its constant."""
    if b == 0.0:
        for j in range(n):
            out[j] = a * x[j] + c
            out[LANES + j] = a * x[LANES + j] + d
    else:
        for j in range(n):
            real, imag = x[j], x[LANES + j]
            out[j] = a * real - b * imag + c
            out[LANES + j] = a * imag + b * real + d


@_merged
def _add(out: np.ndarray, x: np.ndarray, a: float, b: float, n: int) -> None:
    if b == 0.0:
        for j in range(n):
            out[j] += a * x[j]
            out[LANES + j] += a * x[LANES + j]
    else:
        for j in range(n):
            real, imag = x[j], x[LANES + j]
            out[j] += a * real - b * imag
            out[LANES + j] += a * imag + b * real


@_inner
def _sum(op: np.ndarray, terms: np.ndarray, factors: np.ndarray, work: np.ndarray, n: int) -> None:
    out, begin, end, c, d = _row(work, op[1]), op[2], op[3], 0.0, 0.0
    if op[0] == SUM:
        if terms[end - 1] < 0:  # a constant is the last of them
            end -= 1
            c, d = factors[2 * end], factors[2 * end + 1]
        if begin == end:
            for j in range(n):
                out[j], out[LANES + j] = c, d
            return
        _first(out, _row(work, terms[begin]), factors[2 * begin], factors[2 * begin + 1], c, d, n)
        begin += 1
    for t in range(begin, end):
        _add(out, _row(work, terms[t]), factors[2 * t], factors[2 * t + 1], n)


@_merged
def _moving(
    op: np.ndarray,
    terms: np.ndarray,
    factors: np.ndarray,
    data: tuple[np.ndarray, ...],
    work: np.ndarray,
    first: int,
    n: int,
) -> None:
    code = op[0]
    if code == SUM or code == ADD:
        _sum(op, terms, factors, work, n)
    elif code == LOAD_REAL or code == LOAD_COMPLEX:
        _load(op, data, work, first, n)
    elif code == STORE_REAL or code == STORE_COMPLEX:
        _store(op, data, work, first, n)
    elif code == NEAR:
        _near(op, (terms, factors), data[len(data) - 1], work, n)
    else:
        _sum_real(op, terms, factors, work, n)


# ---------------------------------------------------------------- phasors, angles and products of rows


@_inner
def _phasor(out: np.ndarray, angle: np.ndarray, n: int) -> None:
    for j in range(n):
        x = angle[j]
        k = (x * (2 / math.pi) + ROUND) - ROUND
        r = (((x - k * QUARTER_1) - k * QUARTER_2) - k * QUARTER_3) - k * QUARTER_4
        z = r * r
        sine = r + r * z * (S1 + z * (S2 + z * (S3 + z * (S4 + z * (S5 + z * S6)))))
        cosine = 1.0 - 0.5 * z + z * z * (C1 + z * (C2 + z * (C3 + z * (C4 + z * (C5 + z * C6)))))
        q = k - 4.0 * ((k * 0.25 + ROUND) - ROUND)  # the quarter, from -2 to 2
        across = abs(q) == 1.0
        a = sine if across else cosine
        b = cosine if across else sine
        out[j] = -a if q == 1.0 or abs(q) == 2.0 else a
        out[LANES + j] = -b if q == -1.0 or abs(q) == 2.0 else b
    for j in range(n):
        if not abs(angle[j]) < LARGEST_REDUCED:
            out[j], out[LANES + j] = math.cos(angle[j]), math.sin(angle[j])


@_inner
def _angle(out: np.ndarray, phasor: np.ndarray, near: np.ndarray, n: int) -> None:
    for j in range(n):
        x, y = phasor[j], phasor[LANES + j]
        ax, ay = abs(x), abs(y)
        low, high = min(ax, ay), max(ax, ay)
        bent = low > BEND * high
        t = ((low - high) if bent else low) / ((low + high) if bent else high)
        z = t * t
        top = ((((P0 * z + P1) * z + P2) * z + P3) * z + P4) * z
        bottom = ((((z + Q0) * z + Q1) * z + Q2) * z + Q3) * z + Q4
        angle = t + t * (top / bottom)
        angle = math.pi / 4 + angle if bent else angle
        angle = math.pi / 2 - angle if ay > ax else angle
        angle = math.pi - angle if x < 0.0 else angle
        angle = -angle if y < 0.0 else angle
        turns = ((near[j] - angle) / (2 * math.pi) + ROUND) - ROUND
        out[j] = angle + 2 * math.pi * turns


@_inner
def _within(angle: np.ndarray, near: np.ndarray, n: int) -> None:
    for j in range(n):
        angle[j] += 2 * math.pi * (((near[j] - angle[j]) / (2 * math.pi) + ROUND) - ROUND)


@_inner
def _times(code: int, out: np.ndarray, x: np.ndarray, z: np.ndarray, n: int) -> None:
    if code == TIMES:
        for j in range(n):
            out[j], out[LANES + j] = x[j] * z[j], x[j] * z[LANES + j]
    elif code == TIMES_ADD:
        for j in range(n):
            out[j] += x[j] * z[j]
            out[LANES + j] += x[j] * z[LANES + j]
    elif code == TURN:
        for j in range(n):
            out[j], out[LANES + j] = -x[j] * z[LANES + j], x[j] * z[j]
    elif code == TURN_ADD:
        for j in range(n):
            out[j] -= x[j] * z[LANES + j]
            out[LANES + j] += x[j] * z[j]
    else:
        for j in range(n):
            square = x[j] * x[j]
            out[j] -= square * z[j]
            out[LANES + j] -= square * z[LANES + j]


@_inner
def _coriolis(out: np.ndarray, rate: np.ndarray, z: np.ndarray, slide: np.ndarray, n: int) -> None:
    for j in range(n):
        w = rate[j]
        across, along = slide[j] + w * z[LANES + j], slide[LANES + j] - w * z[j]
        out[j] -= 2.0 * w * along
        out[LANES + j] += 2.0 * w * across


@_merged
def _products(op: np.ndarray, work: np.ndarray, n: int) -> None:
    code = op[0]
    if code == PHASOR:
        _phasor(_row(work, op[1]), _row(work, op[2]), n)
    elif code == ANGLE:
        _angle(_row(work, op[1]), _row(work, op[2]), _row(work, op[3]), n)
    elif code == WITHIN:
        _within(_row(work, op[1]), _row(work, op[2]), n)
    elif code == CORIOLIS:
        _coriolis(_row(work, op[1]), _row(work, op[2]), _row(work, op[3]), _row(work, op[4]), n)
    else:
        _times(code, _row(work, op[1]), _row(work, op[2]), _row(work, op[3]), n)


# ---------------------------------------------------------------- loads


@_inner
def _work_on(code: int, out: np.ndarray, a: np.ndarray, b: np.ndarray, n: int) -> None:
    if code == DOT:
        for j in range(n):
            out[j] += a[j] * b[j] + a[LANES + j] * b[LANES + j]
    else:
        for j in range(n):
            out[j] -= a[j] * b[LANES + j] - a[LANES + j] * b[j]


@_inner
def _largest(op: np.ndarray, terms: np.ndarray, work: np.ndarray, n: int) -> None:
    out = _row(work, op[1])
    for j in range(n):
        out[j] = 0.0
    for t in range(op[2], op[3]):
        x = _row(work, terms[t])
        for j in range(n):
            out[j] = max(out[j], abs(x[j]))


@_inner
def _law(op: np.ndarray, factors: np.ndarray, work: np.ndarray, n: int) -> None:
    """A joint's spring, damper and dry friction, as analytic.paper.kinetostatics.joint_law."""
    at = op[6]
    stiffness, cubic, rest, damping, drag = (
        factors[at],
        factors[at + 1],
        factors[at + 2],
        factors[at + 3],
        factors[at + 4],
    )
    coulomb, stiction, slow = factors[at + 5], factors[at + 6], factors[at + 7]
    out, position, rate, pace = _row(work, op[1]), _row(work, op[2]), _row(work, op[3]), _row(work, op[4])
    for j in range(n):
        stretch, v = position[j] - rest, rate[j]
        slip = (1.0 if v > 0.0 else -1.0) if abs(v) > DEAD_CENTRE * pace[j] else 0.0
        if op[5] >= 0:
            slip *= work[op[5] * LANES + j]
        torque = -(stiffness + cubic * stretch * stretch) * stretch
        if op[7]:
            dry = coulomb + (stiction - coulomb) * math.exp(-((v / slow) ** 2)) if slow > 0.0 else coulomb
            torque -= (damping + drag * abs(v)) * v + dry * slip
        else:
            torque -= stiction * slip
        out[j] = torque


@_inner
def _wave(op: np.ndarray, factors: np.ndarray, work: np.ndarray, n: int) -> None:
    out, angle, at = _row(work, op[1]), _row(work, op[2]), op[3]
    for j in range(n):
        out[j] = factors[at] * math.sin(factors[at + 1] * angle[j] + factors[at + 2])


@_inner
def _pull(op: np.ndarray, factors: np.ndarray, work: np.ndarray, n: int) -> None:
    """A point spring's force on its first point, as analytic.mechanism.Spring.pull."""
    out, apart, at = _row(work, op[1]), _row(work, op[2]), op[4]
    for j in range(n):
        x, y = apart[j], apart[LANES + j]
        far = math.hypot(x, y)
        x, y = x / max(far, SMALLEST_NUMBER), y / max(far, SMALLEST_NUMBER)
        pull = factors[at] * (far - factors[at + 1])
        if op[3] >= 0:
            pull += factors[at + 2] * (x * work[op[3] * LANES + j] + y * work[(op[3] + 1) * LANES + j])
        out[j], out[LANES + j] = pull * x, pull * y


@_merged
def _loads(op: np.ndarray, terms: np.ndarray, factors: np.ndarray, work: np.ndarray, n: int) -> None:
    code = op[0]
    if code == DOT or code == CROSS:
        _work_on(code, _row(work, op[1]), _row(work, op[2]), _row(work, op[3]), n)
    elif code == LARGEST_SIZE:
        _largest(op, terms, work, n)
    elif code == LAW:
        _law(op, factors, work, n)
    elif code == WAVE:
        _wave(op, factors, work, n)
    else:
        _pull(op, factors, work, n)


# ---------------------------------------------------------------- dyads in closed form


@_inner
def _two_angles(op: np.ndarray, factors: np.ndarray, work: np.ndarray, n: int) -> None:
    target, first, second, margin = _row(work, op[1]), _row(work, op[2]), _row(work, op[3]), _row(work, op[4])
    la2, lb2, double, side = factors[op[5]], factors[op[5] + 1], factors[op[5] + 2], factors[op[5] + 3]
    ar, ai, br, bi = factors[op[5] + 4], factors[op[5] + 5], factors[op[5] + 6], factors[op[5] + 7]
    for j in range(n):
        x, y = target[j], target[LANES + j]
        d2 = x * x + y * y
        cosine = (d2 - la2 - lb2) / double
        room = (1.0 - cosine) * (1.0 + cosine)
        along, across = 0.5 * (d2 + la2 - lb2) / d2, side * math.sqrt(abs(room)) / d2
        u, v = x * along - y * across, x * across + y * along
        margin[j] = room
        first[j], first[LANES + j] = u * ar - v * ai, u * ai + v * ar
        x, y = x - u, y - v
        second[j], second[LANES + j] = x * br - y * bi, x * bi + y * br


@_inner
def _slide_turns(op: np.ndarray, factors: np.ndarray, work: np.ndarray, n: int) -> None:
    """(arm + travel along) phasor = target."""
    target, phasor, travel, margin = _row(work, op[1]), _row(work, op[2]), _row(work, op[3]), _row(work, op[4])
    t, h, reach, branch, size = (
        factors[op[5]],
        factors[op[5] + 1],
        factors[op[5] + 2],
        factors[op[5] + 3],
        factors[op[5] + 4],
    )
    ar, ai, sr, si = factors[op[5] + 5], factors[op[5] + 6], factors[op[5] + 7], factors[op[5] + 8]
    for j in range(n):
        x, y = target[j], target[LANES + j]
        d2 = x * x + y * y
        room = d2 - h * h
        margin[j] = min(1.0 - h * h / d2, room / (reach * reach))
        s = (branch * math.sqrt(abs(room)) - t) / size
        u, v = ar + sr * s, ai + si * s
        x, y = x * u + y * v, y * u - x * v
        far = math.sqrt(x * x + y * y)
        travel[j] = s
        phasor[j], phasor[LANES + j] = x / far, y / far


@_inner
def _slide_known(op: np.ndarray, factors: np.ndarray, work: np.ndarray, n: int) -> None:
    """arm phasor + travel direction = target."""
    target, phasor, travel, margin = _row(work, op[1]), _row(work, op[2]), _row(work, op[3]), _row(work, op[4])
    along, arm2, branch = _row(work, op[6]), factors[op[5]], factors[op[5] + 1]
    ar, ai, sr, si = factors[op[5] + 2], factors[op[5] + 3], factors[op[5] + 4], factors[op[5] + 5]
    for j in range(n):
        x, y = target[j], target[LANES + j]
        u, v = along[j] * sr - along[LANES + j] * si, along[j] * si + along[LANES + j] * sr
        size = math.sqrt(u * u + v * v)
        t, h = (x * u + y * v) / size, (y * u - x * v) / size
        margin[j] = 1.0 - h * h / arm2
        s = (t + branch * math.sqrt(abs(arm2 - h * h))) / size
        travel[j] = s
        x, y = x - s * u, y - s * v
        phasor[j], phasor[LANES + j] = x * ar - y * ai, x * ai + y * ar


@_inner
def _two_travels(op: np.ndarray, factors: np.ndarray, work: np.ndarray, n: int) -> None:
    target, first, second, margin = _row(work, op[1]), _row(work, op[2]), _row(work, op[3]), _row(work, op[4])
    one, two = _row(work, op[6]), _row(work, op[7])
    pr, pi, qr, qi = factors[op[5]], factors[op[5] + 1], factors[op[5] + 2], factors[op[5] + 3]
    for j in range(n):
        x, y = target[j], target[LANES + j]
        a, b = one[j] * pr - one[LANES + j] * pi, one[j] * pi + one[LANES + j] * pr
        c, d = two[j] * qr - two[LANES + j] * qi, two[j] * qi + two[LANES + j] * qr
        cross = a * d - b * c
        first[j], second[j] = (x * d - y * c) / cross, (a * y - b * x) / cross
        margin[j] = cross * cross / ((a * a + b * b) * (c * c + d * d))


@_inner
def _clear(margin: np.ndarray, n: int) -> bool:
    """Whether all are away from a change point; NaN is not."""
    clear = 0
    for j in range(n):
        clear += 1 if margin[j] > CHANGE_POINT_SINE * CHANGE_POINT_SINE else 0
    return clear == n


@_inner
def _solve_two(op: np.ndarray, work: np.ndarray, n: int) -> bool:
    right, first, second = _row(work, op[1]), _row(work, op[2]), _row(work, op[3])
    one, two = _row(work, op[4]), _row(work, op[5])
    sound = 0
    for j in range(n):
        a, b, c, d, x, y = first[j], first[LANES + j], second[j], second[LANES + j], right[j], right[LANES + j]
        cross = a * d - b * c
        sound += 1 if cross != 0.0 else 0
        one[j], two[j] = (c * y - d * x) / cross, (x * b - y * a) / cross
    return sound == n


@_inner
def _force_two(op: np.ndarray, work: np.ndarray, n: int) -> None:
    out, first, second = _row(work, op[1]), _row(work, op[2]), _row(work, op[3])
    one, two = _row(work, op[4]), _row(work, op[5])
    for j in range(n):
        a, b, c, d = first[j], first[LANES + j], second[j], second[LANES + j]
        cross = a * d - b * c
        out[j], out[LANES + j] = (two[j] * b - one[j] * d) / cross, (one[j] * c - two[j] * a) / cross


@_merged
def _dyads(op: np.ndarray, factors: np.ndarray, work: np.ndarray, n: int) -> bool:
    code = op[0]
    if code == SOLVE_TWO:
        return _solve_two(op, work, n)
    if code == FORCE_TWO:
        _force_two(op, work, n)
        return True
    if code == TWO_ANGLES:
        _two_angles(op, factors, work, n)
    elif code == SLIDE_TURNS:
        _slide_turns(op, factors, work, n)
    elif code == SLIDE_KNOWN:
        _slide_known(op, factors, work, n)
    else:
        _two_travels(op, factors, work, n)
    return _clear(_row(work, op[4]), n)


@_merged
def _simple(
    op: np.ndarray,
    terms: np.ndarray,
    factors: np.ndarray,
    data: tuple[np.ndarray, ...],
    work: np.ndarray,
    first: int,
    n: int,
) -> bool:
    """Carry out an operation that is no larger group's; False where it cannot be."""
    if op[0] <= LAST_SUM:
        _moving(op, terms, factors, data, work, first, n)
    elif op[0] <= LAST_PRODUCT:
        _products(op, work, n)
    elif op[0] <= LAST_LOAD:
        _loads(op, terms, factors, work, n)
    else:
        return _dyads(op, factors, work, n)
    return True


# ---------------------------------------------------------------- larger groups: small dense systems

# columns of a group's table
UNKNOWNS, LOOPS, JACOBIAN, RESIDUAL, ROOTS, GUESS, TRAVELS, N_TRAVELS, SIZE = 0, 1, 2, 3, 4, 5, 6, 7, 8


@_inner
def _gather(group: np.ndarray, terms: np.ndarray, work: np.ndarray, j: int, matrix: np.ndarray) -> None:
    """Write a lane's Jacobian (2 loops, unknowns), real parts of the loops first."""
    loops = group[LOOPS]
    for k in range(group[UNKNOWNS]):
        for r in range(loops):
            row = terms[group[JACOBIAN] + k * loops + r]
            matrix[r, k] = work[row * LANES + j]
            matrix[loops + r, k] = work[(row + 1) * LANES + j]


@_merged
def _exchange(matrix: np.ndarray, order: np.ndarray, k: int) -> None:
    """Bring the row with the largest number in column k, from row k on, to row k."""
    best = k
    for r in range(k + 1, order.size):
        if abs(matrix[r, k]) > abs(matrix[best, k]):
            best = r
    if best != k:
        order[k], order[best] = order[best], order[k]
        for c in range(order.size):
            matrix[k, c], matrix[best, c] = matrix[best, c], matrix[k, c]


@_inner
def _factor(matrix: np.ndarray, order: np.ndarray, mirrors: np.ndarray) -> bool:
    """Factor a square matrix by rows, in place, with its rows' order; a taller one by Householder's reflections.

    Whether it is regular.  ``mirrors`` takes the reflections' first numbers.
    """
    rows, n = matrix.shape
    if rows > n:
        return _reflect(matrix, mirrors)
    for k in range(n):
        order[k] = k
    for k in range(n):
        _exchange(matrix, order, k)
        if not abs(matrix[k, k]) > 0.0:
            return False
        for r in range(k + 1, n):
            share = matrix[r, k] / matrix[k, k]
            matrix[r, k] = share
            for c in range(k + 1, n):
                matrix[r, c] -= share * matrix[k, c]
    return True


@_merged
def _reflect(matrix: np.ndarray, mirrors: np.ndarray) -> bool:
    rows, n = matrix.shape
    for k in range(n):
        size = 0.0
        for r in range(k, rows):
            size = math.hypot(size, matrix[r, k])
        if not size > 0.0:
            return False
        size = -size if matrix[k, k] > 0.0 else size
        mirrors[k] = matrix[k, k] - size  # the reflection's vector is (mirrors[k], what stays below the diagonal)
        matrix[k, k] = size
        for c in range(k + 1, n):
            _mirror(matrix[:, k], mirrors[k], matrix[:, c], k, size)
    return True


@_inner
def _mirror(vector: np.ndarray, top: float, x: np.ndarray, k: int, size: float) -> None:
    """Reflect x at the plane across (top, vector below k), whose square is -2 size top."""
    product = top * x[k]
    for r in range(k + 1, x.size):
        product += vector[r] * x[r]
    product /= size * top
    x[k] += product * top
    for r in range(k + 1, x.size):
        x[r] += product * vector[r]


@_inner
def _solve(matrix: np.ndarray, order: np.ndarray, mirrors: np.ndarray, x: np.ndarray, y: np.ndarray) -> None:
    """Solve a factored system, ``x`` (rows,) into ``y`` (n,): closest, where it has more rows.  ``x`` is written
    over.
    """
    rows, n = matrix.shape
    if rows > n:
        for k in range(n):
            _mirror(matrix[:, k], mirrors[k], x, k, matrix[k, k])
        for k in range(n):
            y[k] = x[k]
    else:
        for k in range(n):
            y[k] = x[order[k]]
            for c in range(k):
                y[k] -= matrix[k, c] * y[c]
    for k in range(n - 1, -1, -1):
        for c in range(k + 1, n):
            y[k] -= matrix[k, c] * y[c]
        y[k] /= matrix[k, k]


@_inner
def _solve_transposed(matrix: np.ndarray, order: np.ndarray, mirrors: np.ndarray, y: np.ndarray, x: np.ndarray) -> None:
    """Solve the transposed system, ``y`` (n,) into ``x`` (rows,): the smallest, where it has more unknowns."""
    rows, n = matrix.shape
    for k in range(n):
        for c in range(k):
            y[k] -= matrix[c, k] * y[c]
        y[k] /= matrix[k, k]
    if rows > n:
        for k in range(rows):
            x[k] = y[k] if k < n else 0.0
        for k in range(n - 1, -1, -1):
            _mirror(matrix[:, k], mirrors[k], x, k, matrix[k, k])
        return
    for k in range(n - 1, -1, -1):
        for c in range(k + 1, n):
            y[k] -= matrix[c, k] * y[c]
    for k in range(n):
        x[order[k]] = y[k]


@_merged
def _scale(matrix: np.ndarray, loops: float) -> None:
    """Divide each column by its size, but by no less than a thousandth of the loops'."""
    rows, n = matrix.shape
    for k in range(n):
        size = 0.0
        for r in range(rows):
            size += matrix[r, k] * matrix[r, k]
        size = max(math.sqrt(size), 1e-3 * loops)
        for r in range(rows):
            matrix[r, k] /= size


@_merged
def _sense(matrix: np.ndarray, order: np.ndarray) -> float:
    """The sign of a factored matrix's determinant; 1 of one that is not square.  ``order`` is written over."""
    rows, n = matrix.shape
    if rows > n:
        return 1.0
    sense = 1.0
    for k in range(n):
        sense = -sense if matrix[k, k] < 0.0 else sense
        while order[k] != k:  # every exchange turns it
            other = order[k]
            order[k], order[other] = order[other], order[k]
            sense = -sense
    return sense


@_inner
def _regularity(spare: _Spare, loops: float) -> float:
    """No more than the smallest singular value of a matrix in its own scales, with the determinant's sign: as
    analytic.kinematics.closure's, by the size of the inverse.  The matrix is written over.
    """
    matrix, order, mirrors, x, y = spare
    rows, n = matrix.shape
    _scale(matrix, loops)
    if not _factor(matrix, order, mirrors):
        return 0.0
    inverse = 0.0
    for k in range(n):
        for r in range(n):
            y[r] = 1.0 if r == k else 0.0
        _solve_transposed(matrix, order, mirrors, y, x)
        for r in range(rows):
            inverse += x[r] * x[r]
    return _sense(matrix, order) / math.sqrt(inverse)


@_inner
def _room(group: np.ndarray) -> _Spare:
    """Memory for a group's matrix, its order or reflections, and the two sides of its equations."""
    rows, n = 2 * group[LOOPS], group[UNKNOWNS]
    return np.empty((rows, n)), np.empty(n, np.int64), np.empty(n), np.empty(rows), np.empty(n)


@_inner
def _residual(group: np.ndarray, terms: np.ndarray, work: np.ndarray, j: int, x: np.ndarray) -> float:
    """Write a lane's open loops (2 loops,); their largest size, NaN if one is."""
    worst = 0.0
    for r in range(group[LOOPS]):
        row = terms[group[RESIDUAL] + r]
        x[r], x[group[LOOPS] + r] = work[row * LANES + j], work[(row + 1) * LANES + j]
        size = math.hypot(x[r], x[group[LOOPS] + r])
        worst = worst if size <= worst else size
    return worst


@_inner
def _reach(group: np.ndarray, terms: np.ndarray, factors: np.ndarray, work: np.ndarray, j: int) -> float:
    """Size (m) of a lane's loops: arms and travels."""
    size = factors[group[SIZE]]
    for t in range(group[TRAVELS], group[TRAVELS] + group[N_TRAVELS]):
        size += math.hypot(work[terms[t] * LANES + j], work[(terms[t] + 1) * LANES + j])
    return size


@_inner
def _open(
    group: np.ndarray, tables: tuple[np.ndarray, np.ndarray], work: np.ndarray, n: int, x: np.ndarray, share: float
) -> bool:
    """Whether a lane's loops are open by more than this share of their size; a group without unknowns may be open by
    AGREE.
    """
    terms, factors = tables
    for j in range(n):
        if not _residual(group, terms, work, j, x) <= share * _reach(group, terms, factors, work, j):
            return True
    return False


@_merged
def _steps(
    group: np.ndarray, tables: tuple[np.ndarray, np.ndarray], work: np.ndarray, n: int, spare: _Spare, steps: np.ndarray
) -> float:
    """Find steps (unknowns, lanes) of Newton's method; the largest over what is worth taking, NaN if there is none."""
    terms, factors = tables
    matrix, order, mirrors, x, y = spare
    largest = 0.0
    for j in range(n):
        _gather(group, terms, work, j, matrix)
        if not _factor(matrix, order, mirrors):
            return math.nan
        _residual(group, terms, work, j, x)
        _solve(matrix, order, mirrors, x, y)
        worth = 1e-13 * max(1.0, _reach(group, terms, factors, work, j))
        for k in range(y.size):
            steps[k, j] = y[k]
            largest = largest if abs(y[k]) / worth <= largest else abs(y[k]) / worth
    return largest


@_merged
def _closed(group: np.ndarray, tables: tuple[np.ndarray, np.ndarray], work: np.ndarray, n: int, spare: _Spare) -> int:
    """Whether all lanes' loops are closed (1), or a step of Newton's method was taken (0), or cannot be (-1)."""
    matrix, _, _, x, _ = spare
    rows, unknowns = matrix.shape
    if unknowns == 0:
        return -1 if _open(group, tables, work, n, x, AGREE) else 1
    if not _open(group, tables, work, n, x, 1e-14):
        return 1
    steps = np.empty((unknowns, n))
    largest = _steps(group, tables, work, n, spare, steps)
    if not largest < math.inf:
        return -1
    if rows > unknowns and largest <= 1.0 and not _open(group, tables, work, n, x, AGREE):
        return 1
    for k in range(unknowns):
        root = _row(work, tables[0][group[ROOTS] + k])
        for j in range(n):
            root[j] -= steps[k, j]
    return 0


@_inner
def _guess(op: np.ndarray, tables: tuple[np.ndarray, np.ndarray], work: np.ndarray, n: int) -> None:
    """Begin Newton's method: a group's unknowns where they are expected."""
    terms, groups = tables
    group = groups[op[1]]
    for k in range(group[UNKNOWNS]):
        root, near = _row(work, terms[group[ROOTS] + k]), _row(work, terms[group[GUESS] + k])
        for j in range(n):
            root[j] = near[j]


@_inner
def _newton(
    op: np.ndarray, tables: tuple[np.ndarray, np.ndarray], factors: np.ndarray, work: np.ndarray, n: int
) -> int:
    """Whether a group's loops are closed in all lanes and clear of a change point (1), or another step of Newton's
    method was taken (0), or that cannot be (-1).
    """
    terms, groups = tables
    group, margin, spare = groups[op[1]], _row(work, op[3]), _room(groups[op[1]])
    state = _closed(group, (terms, factors), work, n, spare)
    if state > 0:
        for j in range(n):
            _gather(group, terms, work, j, spare[0])
            margin[j] = _regularity(spare, factors[group[SIZE]]) if group[UNKNOWNS] else 1.0
            if not abs(margin[j]) > CHANGE_POINT_SINE:
                return -1
    return state


@_inner
def _dense(op: np.ndarray, tables: tuple[np.ndarray, np.ndarray], work: np.ndarray, n: int) -> bool:
    """Rates of a group's unknowns, or its closing forces; False where they cannot be found."""
    terms, groups = tables
    group = groups[op[1]]
    loops, unknowns = group[LOOPS], group[UNKNOWNS]
    matrix, order, mirrors, x, y = _room(group)
    for j in range(n):
        _gather(group, terms, work, j, matrix)
        if not _factor(matrix, order, mirrors):
            return False
        if op[0] == SOLVE:
            for r in range(loops):
                row = terms[op[2] + r]
                x[r], x[loops + r] = work[row * LANES + j], work[(row + 1) * LANES + j]
            _solve(matrix, order, mirrors, x, y)
            for k in range(unknowns):
                work[terms[op[3] + k] * LANES + j] = -y[k]
        else:
            for k in range(unknowns):
                y[k] = -work[terms[op[3] + k] * LANES + j]
            _solve_transposed(matrix, order, mirrors, y, x)
            for r in range(loops):
                row = terms[op[2] + r]
                work[row * LANES + j], work[(row + 1) * LANES + j] = x[r], x[loops + r]
    return True


# ---------------------------------------------------------------- following inputs from sample to sample

# a walk's numbers: where it is, and what it does
SAMPLE, STEP, STEPS, LOOKING, LOOK, ROUND_OF, WALKED, ENDED = 0, 1, 2, 3, 4, 5, 6, 7
PLACES, EXPECTED, AHEAD, GIVEN = 0, 1, 2, 3  # rows of a way's table, see analytic.compiled.program


@_inner
def _everywhere(work: np.ndarray, rows: np.ndarray, values: np.ndarray, n: int) -> None:
    """Write numbers into all lanes of rows."""
    for k in range(rows.size):
        row = _row(work, rows[k])
        for j in range(n):
            row[j] = values[k]


@_merged
def _to_look_at(walk: np.ndarray, margin: np.ndarray) -> int:
    """The next dyad whose margin is least in the middle one of three samples; as many as there are if none is."""
    g = walk[LOOK]
    while g < margin.shape[1]:
        here = margin[1, g]
        if here <= margin[0, g] and here <= margin[2, g] and here < 0.1:
            return g
        g += 1
    return g


@_merged
def _zoom(
    places: np.ndarray, history: _History, sides: tuple[np.ndarray, np.ndarray], walk: np.ndarray, work: np.ndarray
) -> None:
    """Write samples between two places into the inputs' rows."""
    inputs, coordinates, _ = history
    low, high = sides
    count = low.size
    if walk[ROUND_OF] == 0:
        left = 1 if walk[WALKED] < 3 - walk[ENDED] else 0
        right = 1 if walk[ENDED] else 2
        for k in range(count):
            low[k], high[k] = inputs[left, k], inputs[right, k]
        _everywhere(work, places[EXPECTED], coordinates[1], ZOOM)
    for k in range(count):
        row = _row(work, places[PLACES, places[GIVEN, k]])
        for j in range(ZOOM):
            row[j] = low[k] + (high[k] - low[k]) * (j / (ZOOM - 1))


@_merged
def _narrowed(
    places: np.ndarray, sides: tuple[np.ndarray, np.ndarray], margin: int, walk: np.ndarray, work: np.ndarray
) -> bool:
    """Draw the two places closer to where the margin is least; whether there is no change point there."""
    row, at = _row(work, margin), 0
    for j in range(ZOOM):
        if row[j] < row[at]:
            at = j
    left, right = max(at - 1, 0), min(at + 1, ZOOM - 1)
    low, high = sides
    for k in range(low.size):
        inputs = _row(work, places[PLACES, places[GIVEN, k]])
        low[k], high[k] = inputs[left], inputs[right]
    walk[ROUND_OF] += 1
    if walk[ROUND_OF] < ZOOMS:
        return True
    walk[ROUND_OF] = 0
    walk[LOOK] += 1
    return row[at] >= CHANGE_POINT_SINE * CHANGE_POINT_SINE


@_merged
def _stepped(
    places: np.ndarray,
    goals: tuple[np.ndarray, np.ndarray],
    ends: tuple[np.ndarray, np.ndarray],
    coordinates: np.ndarray,
    walk: np.ndarray,
    work: np.ndarray,
) -> bool:
    """Write the next sample of a walk into the inputs' rows, and where coordinates are expected; False at its end."""
    inputs, strides = goals
    begin, target = ends
    if walk[STEP] == walk[STEPS]:
        walk[SAMPLE] += 1
        walk[STEP] = 0
        if walk[SAMPLE] == inputs.shape[1]:
            return False
        most = 0.0
        for k in range(strides.size):
            begin[k], target[k] = target[k], inputs[k, walk[SAMPLE]]
            most = max(most, abs(target[k] - begin[k]) / strides[k])
        walk[STEPS] = max(1, math.ceil(most - 1e-9))
    walk[STEP] += 1
    for k in range(strides.size):
        share = (target[k] - begin[k]) / walk[STEPS]
        there = target[k] if walk[STEP] == walk[STEPS] else begin[k] + share * walk[STEP]
        work[places[PLACES, places[GIVEN, k]] * LANES] = there
    for k in range(places.shape[1]):
        last, before = coordinates[2, k], coordinates[1, k]
        ahead = places[AHEAD, k] > 0 and walk[WALKED] > 1
        work[places[EXPECTED, k] * LANES] = last + (last - before) if ahead else last
    return True


@_merged
def _remember(
    places: np.ndarray, margins: tuple[np.ndarray, np.ndarray], history: _History, signs: np.ndarray, work: np.ndarray
) -> bool:
    """Push the sample in the first lane onto the history; whether no larger group has changed its sense.

    ``margins`` are rows of the dyads' margins and of the larger groups'.
    """
    inputs, coordinates, margin = history
    for k in range(inputs.shape[1]):
        here = work[places[PLACES, places[GIVEN, k]] * LANES]
        inputs[0, k], inputs[1, k], inputs[2, k] = inputs[1, k], inputs[2, k], here
    for k in range(places.shape[1]):
        here = work[places[PLACES, k] * LANES]
        coordinates[0, k], coordinates[1, k], coordinates[2, k] = coordinates[1, k], coordinates[2, k], here
    dyads, regular = margins
    for k in range(dyads.size):
        margin[0, k], margin[1, k], margin[2, k] = margin[1, k], margin[2, k], work[dyads[k] * LANES]
    for k in range(regular.size):
        now = work[regular[k] * LANES]
        if now * signs[k] < 0.0:
            return False
        signs[k] = now
    return True


@_merged
def _end(history: _History, walk: np.ndarray) -> None:
    """Push a last sample, with endless margins, so that the one before is looked at."""
    inputs, coordinates, margin = history
    for k in range(inputs.shape[1]):
        inputs[0, k], inputs[1, k] = inputs[1, k], inputs[2, k]
    for k in range(coordinates.shape[1]):
        coordinates[1, k] = coordinates[2, k]
    for k in range(margin.shape[1]):
        margin[0, k], margin[1, k], margin[2, k] = margin[1, k], margin[2, k], math.inf
    walk[ENDED], walk[LOOKING], walk[LOOK] = 1, 1, 0


@_inner
def _next(places: np.ndarray, goals: tuple[np.ndarray, np.ndarray], state: _State, work: np.ndarray) -> int:
    """Prepare the next lanes of a walk: how many, 0 at its end."""
    walk, ends, sides, history = state
    while True:
        if walk[LOOKING]:
            walk[LOOK] = _to_look_at(walk, history[2])
            if walk[LOOK] < history[2].shape[1]:
                _zoom(places, history, sides, walk, work)
                return ZOOM
            walk[LOOKING] = 0
        if walk[ENDED]:
            return 0
        if _stepped(places, goals, ends, history[1], walk, work):
            return 1
        _end(history, walk)


@_inner
def _after(
    places: np.ndarray,
    margins: tuple[np.ndarray, np.ndarray],
    state: _State,
    signs: np.ndarray,
    work: np.ndarray,
    out: np.ndarray,
) -> bool:
    """Look at what was found in the lanes of a walk; whether there is no change point."""
    walk, _, sides, history = state
    if walk[LOOKING]:
        return _narrowed(places, sides, margins[0][walk[LOOK]], walk, work)
    if not _remember(places, margins, history, signs, work):
        return False
    walk[WALKED] += 1
    walk[LOOKING], walk[LOOK] = (1 if walk[WALKED] > 1 else 0), 0
    if walk[STEP] == walk[STEPS] and walk[SAMPLE] >= 0:
        for k in range(places.shape[1]):
            out[k, walk[SAMPLE]] = history[1][2, k]
    return True


@_inner
def _start(count: int, home: np.ndarray, places: np.ndarray, dyads: int) -> _State:
    """A walk that begins at ``home`` (n,): its numbers, the ends of its step, of what is looked at, its history."""
    walk, begin, target = np.empty(8, np.int64), np.empty(count), np.empty(count)
    for k in range(8):
        walk[k] = 0
    walk[SAMPLE], walk[STEPS] = -1, 1
    for k in range(count):
        begin[k] = target[k] = home[places[GIVEN, k]]
    inputs, coordinates, margin = np.empty((3, count)), np.empty((3, home.size)), np.empty((3, dyads))
    for row in range(3):
        for k in range(home.size):
            coordinates[row, k] = home[k]
        for k in range(dyads):
            margin[row, k] = math.inf
    return walk, (begin, target), (np.empty(count), np.empty(count)), (inputs, coordinates, margin)


# ---------------------------------------------------------------- what is called from Python


@_merged
def _carry_out(
    program: np.ndarray,
    tables: tuple[np.ndarray, np.ndarray],
    factors: np.ndarray,
    data: tuple[np.ndarray, ...],
    work: np.ndarray,
    first: int,
    n: int,
) -> bool:
    """Carry out a program in lanes; False where it cannot be."""
    terms, groups = tables
    k, sound, tries = 0, True, 0
    while sound and k < program.shape[0]:
        op = program[k]
        k += 1
        if op[0] < GUESS_ROOTS:
            sound = _simple(op, terms, factors, data, work, first, n)
        elif op[0] == GUESS_ROOTS:
            _guess(op, (terms, groups), work, n)
        elif op[0] == NEWTON:
            state = _newton(op, (terms, groups), factors, work, n)
            tries = tries + 1 if state == 0 else 0
            sound = state >= 0 and tries < ITERATIONS
            k = op[2] if state == 0 else k
        else:
            sound = _dense(op, (terms, groups), work, n)
    return sound


@_called
def carry_out_dyads(  # noqa: PLR0913
    program: np.ndarray,
    terms: np.ndarray,
    factors: np.ndarray,
    work: np.ndarray,
    u: np.ndarray,
    w: np.ndarray,
    q: np.ndarray,
    c: np.ndarray,
    v: np.ndarray,
    a: np.ndarray,
    reals: np.ndarray,
    complexes: np.ndarray,
    near: np.ndarray,
) -> bool:
    """What :func:`carry_out` does with a program that has no larger group: apart, because it is compiled in half the
    time.
    """
    program, terms, factors, work = _bare(program), _bare(terms), _bare(factors), _bare(work)
    data = (_bare(u), _bare(w), _bare(q), _bare(c), _bare(v), _bare(a), _bare(reals), _bare(complexes), _bare(near))
    for first in range(0, u.shape[1], LANES):
        n = min(LANES, u.shape[1] - first)
        for k in range(program.shape[0]):
            if not _simple(program[k], terms, factors, data, work, first, n):
                return False
    return True


@_called
def carry_out(  # noqa: PLR0913
    program: np.ndarray,
    terms: np.ndarray,
    groups: np.ndarray,
    factors: np.ndarray,
    work: np.ndarray,
    u: np.ndarray,
    w: np.ndarray,
    q: np.ndarray,
    c: np.ndarray,
    v: np.ndarray,
    a: np.ndarray,
    reals: np.ndarray,
    complexes: np.ndarray,
    near: np.ndarray,
    home: np.ndarray,
    strides: np.ndarray,
    places: np.ndarray,
    dyads: np.ndarray,
    regular: np.ndarray,
) -> bool:
    """Carry out a program, in rows that are ``work``'s, for all N configurations, or a walk's; False where it
    cannot be.

    Coordinates and their derivatives are (n, N), columns and theirs (n_columns, 2 N), other results likewise; ``near``
    is a crank's path (1 + n, M), or coordinates (n, N) that are near.

    A walk begins at coordinates ``home`` (n,), of which there are none else, and fills ``u`` with the coordinates at
    the inputs ``w`` (n_inputs, N), reached one after the other with steps of ``strides`` (n_inputs,) at most; the other
    arrays and numbers are analytic.compiled.program.WalkProgram's.
    """
    program, terms, groups, factors, work = _bare(program), _bare(terms), _bare(groups), _bare(factors), _bare(work)
    data = (_bare(u), _bare(w), _bare(q), _bare(c), _bare(v), _bare(a), _bare(reals), _bare(complexes), _bare(near))
    home, strides, places, dyads, regular = _bare(home), _bare(strides), _bare(places), _bare(dyads), _bare(regular)
    walking = home.size > 0
    state = _start(strides.size, home, places, dyads.size)
    signs, first, n = np.empty(regular.size), 0, 0
    for k in range(regular.size):
        signs[k] = 0.0
    while True:
        n = _next(places, (data[1], strides), state, work) if walking else min(LANES, u.shape[1] - first)
        if n <= 0:
            return True
        if not _carry_out(program, (terms, groups), factors, data, work, first, n):
            return False
        if walking:
            if not _after(places, (dyads, regular), state, signs, work, data[0]):
                return False
        else:
            first += LANES

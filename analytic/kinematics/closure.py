"""Closing the loops of one Assur group: dyads in closed form, larger groups by Newton's method.

All functions work on N crank angles at once and fill the structure's columns and coordinates in place.  Without gaps
their columns, the structure's last and all zero, may be left out.
"""

from __future__ import annotations

import numpy as np

from analytic.errors import Error
from analytic.kinematics.structure import Group, Structure


class AssemblyError(Error, ValueError):
    """The linkage cannot be assembled at some crank angle: ``what`` says which and why, ``remedy`` what may help.

    ``at`` (rad) is that crank angle, NaN where it is not a single one.
    """

    def __init__(self, what: str, at: float = float("nan"), remedy: str = "") -> None:
        super().__init__(what, at, remedy)
        self.what, self.at, self.remedy = what, at, remedy

    def __str__(self) -> str:
        return f"{self.what}; {self.remedy}" if self.remedy else self.what


def set_coordinate(
    s: Structure, i: int, columns: np.ndarray, value: np.ndarray, phasor: np.ndarray | None = None
) -> None:
    """Write coordinate i (N,) into the columns that it moves."""
    c = s.coordinates[i]
    if c.bodies:
        phasor = np.exp(1j * value) if phasor is None else phasor
        for b in c.bodies:
            columns[b] = phasor if s.held_at[b] == 0 else phasor * np.exp(1j * s.held_at[b])
    else:
        columns[c.column] = value * columns[s.slide_body[c.column - len(s.bodies)]]


def partials(s: Structure, i: int, form: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Derivative (rows, N) of ``form @ columns`` by coordinate i."""
    c = s.coordinates[i]
    if not c.bodies:
        return np.outer(form[:, c.column], columns[s.slide_body[c.column - len(s.bodies)]])
    turning = [*c.bodies, *(len(s.bodies) + k for k, b in enumerate(s.slide_body) if b in c.bodies)]
    return 1j * (form[:, turning] @ columns[turning])


def solve_dyad(s: Structure, group: Group, columns: np.ndarray, u: np.ndarray, branch: float) -> np.ndarray:
    """Close a dyad's loop in closed form: fills its columns and coordinates in place.

    Returns its margin (N,): sin^2 of the angle between the loop's two unknown sides (for a dyad of three pins the
    transmission angle's); zero at a change point, negative where the loop cannot close (its columns are then wrong).
    """
    row = s.loops[group.loops[0]]
    i, j = group.coordinates
    known = np.ones(s.n_columns, bool)
    for c in (s.coordinates[i], s.coordinates[j]):
        known[list(c.bodies)] = False
        known[
            [len(s.bodies) + k for k, b in enumerate(s.slide_body) if b in c.bodies or len(s.bodies) + k == c.column]
        ] = False
    use = np.flatnonzero((known & (row != 0))[: len(columns)])
    target = -(row[use] @ columns[use])
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        if s.coordinates[i].bodies and s.coordinates[j].bodies:
            return _two_angles(s, row, i, j, target, columns, u, branch)
        if s.coordinates[i].bodies or s.coordinates[j].bodies:
            angle, travel = (i, j) if s.coordinates[i].bodies else (j, i)
            return _angle_and_travel(s, row, angle, travel, target, columns, u, branch)
        return _two_travels(s, row, i, j, target, columns, u)


def _arm(s: Structure, row: np.ndarray, i: int) -> complex:
    return complex(sum(row[b] * np.exp(1j * s.held_at[b]) for b in s.coordinates[i].bodies))


def _turn(s: Structure, i: int, columns: np.ndarray, u: np.ndarray, phasor: np.ndarray) -> None:
    u[i] = np.angle(phasor)
    set_coordinate(s, i, columns, u[i], phasor)


def _two_angles(
    s: Structure, row: np.ndarray, i: int, j: int, target: np.ndarray, columns: np.ndarray, u: np.ndarray, branch: float
) -> np.ndarray:
    a, b = _arm(s, row, i), _arm(s, row, j)
    la, lb = abs(a), abs(b)
    d2 = target.real**2 + target.imag**2
    cosine = (d2 - la**2 - lb**2) / (2 * la * lb)
    margin = (1 - cosine) * (1 + cosine)
    side = branch * la * lb * np.sqrt(np.abs(margin))
    toward = target * ((0.5 * (d2 + la**2 - lb**2) + 1j * side) / d2)
    _turn(s, i, columns, u, toward / a)
    _turn(s, j, columns, u, (target - toward) / b)
    return margin


def _angle_and_travel(
    s: Structure, row: np.ndarray, i: int, j: int, target: np.ndarray, columns: np.ndarray, u: np.ndarray, branch: float
) -> np.ndarray:
    arm = _arm(s, row, i)
    travel = s.coordinates[j]
    along = row[travel.column]
    body = int(s.slide_body[travel.column - len(s.bodies)])
    if body in s.coordinates[i].bodies:  # the slide turns with the unknown angle: (arm + s along) e = target
        along *= np.exp(1j * s.held_at[body])
        unit = along / abs(along)
        t, h, d2 = (arm / unit).real, (arm / unit).imag, np.abs(target) ** 2
        reach = np.abs(
            row[: len(s.bodies)]
        ).sum()  # m: where the slide is at its pivot, h may be zero as well and any angle closes the loop
        margin = np.minimum(1 - h**2 / d2, (d2 - h**2) / reach**2)
        u[j] = (-t + branch * np.sqrt(np.abs(d2 - h**2))) / abs(along)
        phasor = target / (arm + along * u[j])
        _turn(s, i, columns, u, phasor / np.abs(phasor))
        set_coordinate(s, j, columns, u[j])
        return margin
    direction = along * columns[body]  # the slide's direction is known: arm e + s direction = target
    unit = direction / np.abs(direction)
    t, h = (target / unit).real, (target / unit).imag
    margin = 1 - h**2 / abs(arm) ** 2
    u[j] = (t + branch * np.sqrt(np.abs(abs(arm) ** 2 - h**2))) / np.abs(direction)
    set_coordinate(s, j, columns, u[j])
    _turn(s, i, columns, u, (target - u[j] * direction) / arm)
    return margin


def _two_travels(
    s: Structure, row: np.ndarray, i: int, j: int, target: np.ndarray, columns: np.ndarray, u: np.ndarray
) -> np.ndarray:
    p, q = (
        row[s.coordinates[k].column] * columns[s.slide_body[s.coordinates[k].column - len(s.bodies)]] for k in (i, j)
    )
    cross = (np.conj(p) * q).imag
    for k, value in ((i, (np.conj(target) * q).imag / cross), (j, (np.conj(p) * target).imag / cross)):
        u[k] = value
        set_coordinate(s, k, columns, value)
    return (cross / (np.abs(p) * np.abs(q))) ** 2


def newton(
    s: Structure, group: Group, columns: np.ndarray, u: np.ndarray, near: np.ndarray, theta: np.ndarray
) -> np.ndarray:
    """Close a larger group's loops by Newton's method from ``near`` (n, N); fills columns and u in place.

    Returns how far (N,) the loops are from singular: see :func:`_regularity`.  Raises AssemblyError where it does not
    converge.
    """
    rows = s.loops[list(group.loops)]
    unknown = list(group.coordinates)
    for i in unknown:
        u[i] = near[i]
    arms = np.abs(rows[:, : len(s.bodies)]).sum(axis=1)  # m; the other columns have factors of 1
    for _ in range(30):
        for i in unknown:
            c = s.coordinates[i]
            if c.bodies:
                for b in c.bodies:
                    columns[b] = np.exp(1j * (u[i] + s.held_at[b]))
        for i in unknown:
            if not s.coordinates[i].bodies:
                set_coordinate(s, i, columns, u[i])
        residual = rows[:, : len(columns)] @ columns
        jacobian = np.stack([partials(s, i, rows, columns) for i in unknown], axis=-1)  # (loops, N, unknowns)
        matrix = np.concatenate([jacobian.real, jacobian.imag]).transpose(1, 0, 2)
        travels = np.abs(columns[len(s.bodies) : len(s.bodies) + len(s.slides)]).sum(axis=0)
        if np.all(np.abs(residual) <= 1e-14 * (arms.max() + travels)):
            return _regularity(s, rows, matrix)
        right = np.concatenate([residual.real, residual.imag]).T
        try:
            u[unknown] -= np.linalg.solve(matrix, right[..., None])[..., 0].T
        except np.linalg.LinAlgError:
            break
    worst = int(np.argmax(np.nan_to_num(np.abs(residual).max(axis=0), nan=np.inf)))
    raise AssemblyError(
        f"{s.mechanism.name}: crank angle {np.degrees(theta[worst]):.6g} deg cannot be reached: the loops through "
        f"{', '.join(group.bodies)} do not close",
        float(theta[worst]),
        "choose crank angles that they reach",
    )


def with_travels(s: Structure, group: Group, columns: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Coordinates ``near`` (n, 1) with those travels (m) of a group that come closest to closing its loops at these
    angles: linear least squares.
    """
    slides = [i for i in group.coordinates if not s.coordinates[i].bodies]
    if not slides:
        return near
    near, columns, rows = near.copy(), columns.copy(), s.loops[list(group.loops)]
    near[slides] = 0.0
    for i in sorted(group.coordinates, key=slides.__contains__):  # a travel is along a body
        set_coordinate(s, i, columns, near[i])
    open_by, along = (
        rows[:, : len(columns)] @ columns,
        np.stack([partials(s, i, rows, columns) for i in slides], axis=-1)[:, 0],
    )
    near[slides] = -np.linalg.lstsq(
        np.concatenate([along.real, along.imag]), np.concatenate([open_by.real, open_by.imag]), rcond=None
    )[0]
    return near


def _regularity(s: Structure, rows: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Smallest singular value (N,) of a group's Jacobian (N, n, n) in its own scales, with the determinant's sign; zero
    at a change point.

    Each coordinate's column is divided by its own size, but by no less than a thousandth of the loops': an arm that
    vanishes makes the group singular.
    """
    loops = np.abs(rows[:, : len(s.bodies)]).sum(axis=1).max()
    scaled = matrix / np.maximum(np.linalg.norm(matrix, axis=1), 1e-3 * loops)[:, None, :]
    return np.sign(np.linalg.det(scaled)) * np.linalg.svd(scaled, compute_uv=False)[:, -1]

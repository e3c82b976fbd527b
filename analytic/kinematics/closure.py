"""Closing the loops of one Assur group: dyads in closed form, larger groups by Newton's method.

All functions work on N crank angles at once and fill the structure's columns and coordinates in place.  Without gaps
their columns, the structure's last and all zero, may be left out.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import cast

import numpy as np

from analytic.errors import Error
from analytic.kinematics.structure import Group, Structure
from analytic.mechanism import GROUND

Row = np.ndarray | Sequence[complex | np.ndarray]  # a loop's sides by column, each one number or (N,) for N linkages
AGREE = 1e-6  # of the loops' size: what loops beyond those that are needed may be open, for lengths that are rounded


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
    """Write coordinate i (N,) into the columns that it moves; bodies that turn with others too are left."""
    c = s.coordinates[i]
    if c.bodies:
        phasor = np.exp(1j * value) if phasor is None else phasor
        for b in c.bodies:
            if len(s.turned[b]) > 1:
                continue
            columns[b] = phasor if s.held_at[b] == 0 else phasor * np.exp(1j * s.held_at[b])
    else:
        columns[c.column] = value * columns[s.slide_body[c.column - len(s.bodies)]]


def set_bodies(s: Structure, bodies: Iterable[int], columns: np.ndarray, u: np.ndarray) -> None:
    """Write the phasors of bodies (columns) that turn with a sum of coordinates u (n, N)."""
    for b in bodies:
        columns[b] = np.exp(1j * (u[list(s.turned[b])].sum(axis=0) + s.held_at[b]))


def set_input(s: Structure, i: int, columns: np.ndarray, u: np.ndarray) -> None:
    """Write an input that acts outside of groups into the columns, once all that comes before it is there."""
    child = s.hung.index(i)
    if len(s.turned[child]) > 1:
        set_bodies(s, (child,), columns, u)
    set_coordinate(s, i, columns, u[i])


def partials(s: Structure, i: int, form: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Derivative (rows, N) of ``form @ columns`` by coordinate i."""
    c = s.coordinates[i]
    if not c.bodies:
        return np.outer(form[:, c.column], columns[s.slide_body[c.column - len(s.bodies)]])
    turning = s.turning[i]
    return 1j * (form[:, turning] @ columns[turning])


def solve_dyad(s: Structure, group: Group, columns: np.ndarray, u: np.ndarray, branch: float) -> np.ndarray:
    """Close a dyad's loop in closed form: fills its columns and coordinates in place.

    Returns its margin (N,): sin^2 of the angle between the loop's two unknown sides (for a dyad of three pins the
    transmission angle's); zero at a change point, negative where the loop cannot close (its columns are then wrong).
    """
    row = s.loops[group.loops[0]]
    i, j = group.coordinates
    known = np.ones(s.n_columns, bool)
    for k in (i, j):
        known[s.turning[k] if s.coordinates[k].bodies else s.coordinates[k].column] = False
    use = np.flatnonzero((known & (row != 0))[: len(columns)])
    return close_dyad(s, group, row, -(row[use] @ columns[use]), columns, u, branch)


def close_dyad(
    s: Structure,
    group: Group,
    row: Row,
    target: np.ndarray,
    columns: np.ndarray,
    u: np.ndarray,
    branch: float,
) -> np.ndarray:
    """Close a dyad's loop whose sides ``row`` (by column, one number or (N,)) and whose known sides' negative sum
    ``target`` (N,) are given; else as :func:`solve_dyad`.
    """
    i, j = group.coordinates
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        if s.coordinates[i].bodies and s.coordinates[j].bodies:
            return _two_angles(s, row, i, j, target, columns, u, branch)
        if s.coordinates[i].bodies or s.coordinates[j].bodies:
            angle, travel = (i, j) if s.coordinates[i].bodies else (j, i)
            return _angle_and_travel(s, row, angle, travel, target, columns, u, branch)
        return _two_travels(s, row, i, j, target, columns, u)


def arm_of(s: Structure, row: Row, i: int) -> complex:
    """Arm (m, complex) that a coordinate's angle turns in a loop: the sum of its bodies' sides; (N,) where they are."""
    arm = sum(row[b] * np.exp(1j * s.held_at[b]) for b in s.coordinates[i].bodies)
    return cast(complex, arm) if isinstance(arm, np.ndarray) else complex(arm)


def _turn(s: Structure, i: int, columns: np.ndarray, u: np.ndarray, phasor: np.ndarray) -> None:
    u[i] = np.angle(phasor)
    set_coordinate(s, i, columns, u[i], phasor)


def _two_angles(
    s: Structure, row: Row, i: int, j: int, target: np.ndarray, columns: np.ndarray, u: np.ndarray, branch: float
) -> np.ndarray:
    a, b = arm_of(s, row, i), arm_of(s, row, j)
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
    s: Structure, row: Row, i: int, j: int, target: np.ndarray, columns: np.ndarray, u: np.ndarray, branch: float
) -> np.ndarray:
    arm = arm_of(s, row, i)
    travel = s.coordinates[j]
    along = row[travel.column]
    body = int(s.slide_body[travel.column - len(s.bodies)])
    if body in s.coordinates[i].bodies:  # the slide turns with the unknown angle: (arm + s along) e = target
        along *= np.exp(1j * s.held_at[body])
        unit = along / abs(along)
        t, h, d2 = (arm / unit).real, (arm / unit).imag, np.abs(target) ** 2
        reach = sum(
            abs(side) for side in row[: len(s.bodies)]
        )  # m: where the slide is at its pivot, h may be zero as well and any angle closes the loop
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
    s: Structure, row: Row, i: int, j: int, target: np.ndarray, columns: np.ndarray, u: np.ndarray
) -> np.ndarray:
    p, q = (
        row[s.coordinates[k].column] * columns[s.slide_body[s.coordinates[k].column - len(s.bodies)]] for k in (i, j)
    )
    cross = (np.conj(p) * q).imag
    for k, value in ((i, (np.conj(target) * q).imag / cross), (j, (np.conj(p) * target).imag / cross)):
        u[k] = value
        set_coordinate(s, k, columns, value)
    return (cross / (np.abs(p) * np.abs(q))) ** 2


def newton(s: Structure, group: Group, columns: np.ndarray, u: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Close a larger group's loops by Newton's method from ``near`` (n, N); fills columns and u in place.

    Returns how far (N,) the loops are from singular: see :func:`regularity`.  Raises AssemblyError where it does not
    converge.
    """
    rows = s.loops[list(group.loops)]
    unknown = list(group.coordinates)
    u[unknown] = near[unknown]
    arms = np.abs(rows[:, : len(s.bodies)]).sum(axis=1)  # m; the other columns have factors of 1
    for _ in range(30):
        set_group(s, group, columns, u)
        residual = rows[:, : len(columns)] @ columns
        travels = np.abs(columns[len(s.bodies) : len(s.bodies) + len(s.slides)]).sum(axis=0)
        size, close = np.abs(residual), arms.max() + travels
        if not unknown:
            if np.all(size <= AGREE * close):
                return np.ones(columns.shape[1])
            break
        jacobian = np.stack([partials(s, i, rows, columns) for i in unknown], axis=-1)  # (loops, N, unknowns)
        matrix = np.concatenate([jacobian.real, jacobian.imag]).transpose(1, 0, 2)
        if np.all(size <= 1e-14 * close):
            return regularity(s, group, matrix)
        try:
            step = least(matrix, np.concatenate([residual.real, residual.imag]).T)
        except np.linalg.LinAlgError:
            break
        still = np.all(np.abs(step) <= 1e-13 * np.maximum(1.0, close[:, None]))
        if group.surplus and still and np.all(size <= AGREE * close):
            return regularity(s, group, matrix)
        u[unknown] -= step.T
    worst = int(np.argmax(np.nan_to_num(np.abs(residual).max(axis=0), nan=np.inf)))
    raise AssemblyError(
        f"{s.mechanism.name}: {posture(s, u, worst)} cannot be reached: the loops through "
        f"{', '.join(group.bodies) or GROUND} do not close",
        crank_angle(s, u, worst),
        f"choose {'crank angles' if s.mechanism.cranked else 'positions'} that they reach",
    )


def set_group(s: Structure, group: Group, columns: np.ndarray, u: np.ndarray) -> None:
    """Write all coordinates u (n, N) that act within a group into the columns: angles, then travels along them."""
    within = (*group.coordinates, *group.within)
    for i in within:
        if s.coordinates[i].bodies:
            set_coordinate(s, i, columns, u[i])
    set_bodies(s, s.stacked[s.groups.index(group)], columns, u)
    for i in within:
        if not s.coordinates[i].bodies:
            set_coordinate(s, i, columns, u[i])


def posture(s: Structure, u: np.ndarray, k: int) -> str:
    """Where the inputs are in sample k of coordinates (n, N), in words: ``crank angle 30 deg``, or joint by joint."""
    if s.by_crank:
        return f"crank angle {np.degrees(u[0, k]):.6g} deg"
    places = []
    for i in s.inputs:
        value = float(s.signs[i] * u[i, k])
        at = f"{np.degrees(value):.6g} deg" if s.unit(i) == "rad" else f"{1e3 * value:.6g} mm"
        places.append(f"{s.coordinates[i].joint} = {at}")
    return ", ".join(places)


def crank_angle(s: Structure, u: np.ndarray, k: int) -> float:
    """The crank's angle (rad) in sample k of coordinates (n, N); NaN where there is more than a crank to say."""
    return float(u[0, k]) if s.by_crank else float("nan")


def least(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """x (N, n) with ``matrix`` (N, m, n) times x closest to ``right`` (N, m), m at least n.  Raises LinAlgError where
    it is singular.
    """
    if matrix.shape[1] == matrix.shape[2]:
        return np.asarray(np.linalg.solve(matrix, right[..., None])[..., 0])
    q, r = np.linalg.qr(matrix)
    return np.asarray(np.linalg.solve(r, q.swapaxes(1, 2) @ right[..., None])[..., 0])


def with_travels(s: Structure, group: Group, columns: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Coordinates ``near`` (n, 1) with those unknown travels (m) of a group that come closest to closing its loops at
    these angles: linear least squares.
    """
    slides = [i for i in group.coordinates if not s.coordinates[i].bodies]
    if not slides:
        return near
    near, columns, rows = near.copy(), columns.copy(), s.loops[list(group.loops)]
    near[slides] = 0.0
    set_group(s, group, columns, near)
    open_by, along = (
        rows[:, : len(columns)] @ columns,
        np.stack([partials(s, i, rows, columns) for i in slides], axis=-1)[:, 0],
    )
    near[slides] = -np.linalg.lstsq(
        np.concatenate([along.real, along.imag]), np.concatenate([open_by.real, open_by.imag]), rcond=None
    )[0]
    return near


def regularity(s: Structure, group: Group, matrix: np.ndarray) -> np.ndarray:
    """Smallest singular value (N,) of a group's Jacobian (N, n, n) in its own scales, with the determinant's sign,
    where it has one; zero at a change point.

    Each coordinate's column is divided by its own size, but by no less than a thousandth of the loops': an arm that
    vanishes makes the group singular.
    """
    loops = np.abs(s.loops[list(group.loops), : len(s.bodies)]).sum(axis=1).max()
    scaled = matrix / np.maximum(np.linalg.norm(matrix, axis=1), 1e-3 * loops)[:, None, :]
    sense = np.sign(np.linalg.det(scaled)) if scaled.shape[1] == scaled.shape[2] else 1.0
    return sense * np.linalg.svd(scaled, compute_uv=False)[:, -1]

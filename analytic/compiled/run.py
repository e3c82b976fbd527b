"""Carrying out a linkage's programs: what :mod:`analytic.kinematics.motion` and :mod:`analytic.paper.kinetostatics` ask
for.

Every function answers None where the compiled code does not serve: numba is missing, or it finds no place to keep what
it compiles, or a linkage does something that only the numpy functions do, or cannot be closed.  Those then do it, or
say what is wrong.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from analytic.kinematics.assembly import Assembly, CrankTable, Walk

if TYPE_CHECKING:
    from analytic.compiled.program import Program, WalkProgram

BATCH = 4000  # configurations of a crank in one call from which the compiled code serves
BULK = 200  # of a crank in a portion, where many linkages follow one another
POSES = 1000  # of several drives, which take numpy some hundred times as long to follow
CALLS = 100  # calls with one assembly after which it does, whatever their size
NO_ARRAY = np.zeros((1, 1))
NO_WALK = np.zeros(0), np.zeros(0), np.zeros((4, 0), np.int64), np.zeros(0, np.int64), np.zeros(0, np.int64)


@dataclass
class Programs:
    """The programs of one assembly, written when they are first needed, and how often it has been asked for."""

    motions: dict[bool, Program] = field(default_factory=dict)
    balances: dict[tuple[bool, bool, bool], Program] = field(default_factory=dict)
    walk: WalkProgram | None = None
    path: CrankTable | None = None
    table: np.ndarray | None = None  # of that path, (1 + n, M)
    calls: int = 0


_least: ContextVar[int] = ContextVar("configurations in one call from which the compiled code serves")
_programs: WeakKeyDictionary[Assembly, Programs] = WeakKeyDictionary()


def programs_of(assembly: Assembly) -> Programs:
    """The programs of an assembly."""
    programs = _programs.get(assembly)
    if programs is None:
        programs = _programs[assembly] = Programs()
    return programs


def serves(assembly: Assembly, count: int) -> bool:
    """Whether the compiled code is to be used for so many configurations of an assembly, and can be.

    Loading it takes a process half a second, and compiling it, once on a machine, five to fifteen: a short command
    does without.  The answer depends on this call and on earlier ones with the same assembly, not on what else the
    process has done, so that the same computation gives the same bits.
    """
    programs = programs_of(assembly)
    programs.calls += 1
    least = _least.get(BATCH) if assembly.structure.by_crank else POSES
    return (count >= least or programs.calls > CALLS) and _kernel() is not None


@contextmanager
def in_bulk() -> Iterator[None]:
    """Let the compiled code serve smaller batches: of many linkages, for which it is loaded once."""
    token = _least.set(BULK)
    try:
        yield
    finally:
        _least.reset(token)


def foresee(assembly: Assembly, count: int) -> None:
    """Let the compiled code serve all calls with an assembly of which so many configurations will be asked, in whatever
    portions.
    """
    if count >= _least.get(BATCH):
        programs = programs_of(assembly)
        programs.calls = max(programs.calls, CALLS)


@cache
def _kernel() -> tuple[Callable[..., bool], Callable[..., bool]] | None:
    """What carries out programs of dyads only, and all programs."""
    try:
        from numba.core import config

        from analytic.compiled.kernels import carry_out, carry_out_dyads
    except (ImportError, RuntimeError):  # numba says so where it finds no place to keep what it compiles
        return None
    return None if getattr(config, "DISABLE_JIT", False) else (carry_out_dyads, carry_out)


def _carry_out(program: Program, *data: np.ndarray, walk: tuple[np.ndarray, ...] = NO_WALK) -> bool:
    kernels = _kernel()
    if kernels is None:
        return False
    dyads, every = kernels
    if program.simple and walk is NO_WALK:
        return dyads(program.operations, program.terms, program.factors, program.work(), *data)
    return every(*program.numbers, program.work(), *data, *walk)


def moved(
    assembly: Assembly,
    inputs: np.ndarray,
    rates: tuple[np.ndarray | float, np.ndarray | float],
    gaps: Mapping[str, tuple[np.ndarray, np.ndarray | float, np.ndarray | float]],
    path: CrankTable | Walk | None,
) -> tuple[np.ndarray, np.ndarray] | None:
    """Coordinates (3, n, N) and columns (3, n_columns, N) complex, their first and second derivatives after them, at
    inputs (n_inputs, N) whose rates and accelerations are given.

    ``gaps`` are those of revolute joints by name, with their rates and accelerations.  None where that cannot be done.
    """
    s, programs, n = assembly.structure, programs_of(assembly), inputs.shape[1]
    coordinates, columns = np.empty((3, len(s.coordinates), n)), np.empty((3, s.n_columns, n), complex)
    given = s.inputs[0] if len(s.inputs) == 1 else list(s.inputs)
    for order, values in enumerate((inputs, *rates)):
        coordinates[order, given] = values
    near = _near(assembly, programs, coordinates[0, given], path) if n else None
    if near is None:
        return None
    columns[:, len(s.bodies) + len(s.slides) :] = 0.0
    for name, gap in gaps.items():
        for order, amount in enumerate(gap):
            columns[order, s.gap_column(name)] = amount
    displaced = bool(gaps)
    if displaced not in programs.motions:
        from analytic.compiled.program import motion_program

        programs.motions[displaced] = motion_program(assembly, displaced)
    data = *coordinates, *columns.view(float), NO_ARRAY, NO_ARRAY, near
    return (coordinates, columns) if _carry_out(programs.motions[displaced], *data) else None


def _near(
    assembly: Assembly, programs: Programs, inputs: np.ndarray, path: CrankTable | Walk | None
) -> np.ndarray | None:
    """What is near inputs (N,), or (n_inputs, N): a crank's path (1 + n, M), or coordinates (n, N); None where there is
    neither.
    """
    low, high = float(inputs.min()), float(inputs.max())
    cranked = assembly.structure.by_crank
    if not (math.isfinite(low) and math.isfinite(high)) or isinstance(path, Walk if cranked else CrankTable):
        return None
    n = len(assembly.structure.coordinates)
    if not cranked:
        every = inputs.reshape(len(assembly.structure.inputs), -1)
        near = path.coordinates if isinstance(path, Walk) else followed(assembly, every)
        return None if near is None or near.shape != (n, every.shape[1]) else _whole(near)
    known = path if isinstance(path, CrankTable) else assembly.path(low, high)
    if programs.path is not known or programs.table is None:
        programs.path, programs.table = known, np.vstack([known.theta, known.coordinates])
    return programs.table if len(programs.table) == 1 + n else None


def followed(assembly: Assembly, inputs: np.ndarray) -> np.ndarray | None:
    """Coordinates (n, N) at inputs (n_inputs, N), as analytic.kinematics.assembly.Assembly.follow, which raises
    AssemblyError where the way is too long; None where that cannot be done.
    """
    programs, s = programs_of(assembly), assembly.structure
    if assembly.is_open:
        return assembly.follow(inputs).coordinates
    assembly.check_way(inputs)
    if programs.walk is None:
        from analytic.compiled.program import walk_program

        programs.walk = walk_program(assembly)
    coordinates, home = np.empty((len(s.coordinates), inputs.shape[1])), np.ascontiguousarray(assembly.home[:, 0])
    data = coordinates, np.ascontiguousarray(inputs, float), *(NO_ARRAY,) * 7
    walk = home, assembly.strides, programs.walk.places, programs.walk.margins, programs.walk.regular
    return coordinates if _carry_out(programs.walk.program, *data, walk=walk) else None


def balanced(
    assembly: Assembly,
    coordinates: Sequence[np.ndarray],
    columns: Sequence[np.ndarray],
    displaced: bool,
    inertia: bool,
    grip: np.ndarray | None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """What holds a motion in balance, as :func:`analytic.paper.kinetostatics.kinetostatics`: forces (joints, N) N,
    complex, of each joint's first body on its second, in the file's order; moments (slides, N) N.m on the second
    body; what drives each input (inputs, N), N.m or N.  None where that cannot be done.

    ``coordinates`` (n, N) and ``columns`` (n_columns, N) are the motion's, each with its two derivatives.
    """
    s, programs, n = assembly.structure, programs_of(assembly), coordinates[0].shape[1]
    shapes = {x.shape for x in coordinates}, {x.shape for x in columns}
    if s.mechanism.varying_load or s.mechanism.stops or shapes != ({(len(s.coordinates), n)}, {(s.n_columns, n)}):
        return None
    kind = bool(inertia), displaced, grip is not None
    if kind not in programs.balances:
        from analytic.compiled.program import balance_program

        programs.balances[kind] = balance_program(assembly, *kind)
    reals = np.empty((1 + len(s.slides) + len(s.inputs), n))  # the first: the share of the friction
    forces = np.empty((len(s.mechanism.joints), n), complex)
    if grip is not None:
        reals[0] = grip
    given = *map(_whole, coordinates), *(_whole(x).view(float) for x in columns)
    if not _carry_out(programs.balances[kind], *given, reals, forces.view(float), NO_ARRAY):
        return None
    return forces, reals[1 : 1 + len(s.slides)], reals[1 + len(s.slides) :]


def _whole(array: np.ndarray) -> np.ndarray:
    """The array itself if its numbers lie one after the other and may be written, as the kernels take them, or a
    copy.
    """
    return array if array.flags.c_contiguous and array.flags.writeable else np.array(array, order="C")

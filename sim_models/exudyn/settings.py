"""Exudyn's own settings: its console off, and solvers that leave no files."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from exudyn import SimulationSettings


@contextmanager
def console_off() -> Iterator[None]:
    """Switch off what Exudyn itself prints, and leave its global settings as they were."""
    import exudyn

    before = exudyn.config.printToConsole, exudyn.config.suppressWarnings
    exudyn.config.printToConsole, exudyn.config.suppressWarnings = False, True
    try:
        yield
    finally:
        exudyn.config.printToConsole, exudyn.config.suppressWarnings = before


def static_settings(tolerance: float, difference: float = 1e-7, redundant: bool = False) -> SimulationSettings:
    """Exudyn's settings for a static solution in one go, to a residual of ``tolerance`` (N).

    ``difference`` is the step, of a coordinate, by which Exudyn differentiates what it has no derivative of.
    """
    settings = quiet_settings(redundant)
    solver = settings.staticSolver
    solver.useLoadFactor = solver.adaptiveStep = False
    solver.newton.maxIterations = 100
    solver.newton.relativeTolerance = 1e-12
    solver.newton.absoluteTolerance = tolerance
    solver.newton.numericalDifferentiation.relativeEpsilon = difference
    solver.discontinuous.maxIterations = 20
    solver.discontinuous.ignoreMaxIterations = False
    return settings


def quiet_settings(redundant: bool = False) -> SimulationSettings:
    """Exudyn's settings without files or messages.

    Constraints of which some are ``redundant`` make a matrix singular that its own solver does not go on with: another
    one does, and leaves out what says nothing new.
    """
    import exudyn

    settings = exudyn.SimulationSettings()
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = 0.0
    settings.staticSolver.verboseMode = settings.timeIntegration.verboseMode = 0
    settings.linearSolver.showCausingItems = False
    if redundant:
        settings.linearSolver.solverType = exudyn.LinearSolverType.EigenDense
        settings.linearSolver.ignoreSingularJacobian = True
    return settings

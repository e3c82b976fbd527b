"""How every engine answers a request: in the linkage's own units, and held to what must be true of a run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from sim_models.common.health import Implausible, check
from sim_models.common.requests import check_request
from sim_models.common.units import in_own_units
from sim_models.engine import (
    Engine,
    Request,
    SimulationError,
    Trace,
    check_exported,
    check_flexible,
    check_supported,
)

HALVINGS = 2  # of the engine's own step, where its run is not what it must be


def simulate(engine: Engine, request: Request, run: Callable[[Request], Trace]) -> Trace:
    """A request's trace by an engine's ``run``, in shorter steps than its own where these leave it implausible.

    Raises Unsupported, what the run raises, and Implausible for a run that cannot be right.
    """
    check_supported(engine, request)
    check_request(request)
    trace = in_own_units(run, request)
    try:
        check(request, trace)
        return trace
    except Implausible as implausible:
        step = trace.step
        if request.step is not None or request.motion == "static" or not step:
            raise
        for halving in range(1, HALVINGS + 1):
            found = _finer(run, replace(request, step=step / 2**halving))
            if found is not None:
                return found
        raise implausible from None


def _finer(run: Callable[[Request], Trace], request: Request) -> Trace | None:
    """The trace of a run in a given step; None where it cannot be made, or is implausible too."""
    try:
        trace = in_own_units(run, request)
        check(request, trace)
    except SimulationError:
        return None
    return trace


def simulate_flexible(engine: Engine, request: Request, run: Callable[[Request], Trace]) -> Trace:
    """A request's trace by an engine's ``run`` with links that bend, in SI.  Raises Unsupported, and what the run
    raises.
    """
    check_flexible(engine, request)
    check_request(request)
    return run(request)


def export(engine: Engine, request: Request, folder: Path, write: Callable[[Request, Path], list[Path]]) -> list[Path]:
    """Files that an engine's ``write`` makes of a request in a folder.  Raises Unsupported, and what it raises."""
    check_exported(engine, request)
    check_request(request)
    return write(request, folder)

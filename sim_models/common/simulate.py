"""How every engine answers a request: in the linkage's own units, and held to what must be true of a run."""

from __future__ import annotations

from collections.abc import Callable

from sim_models.common.health import check
from sim_models.common.units import in_own_units
from sim_models.engine import Engine, Request, Trace, check_supported


def simulate(engine: Engine, request: Request, run: Callable[[Request], Trace]) -> Trace:
    """A request's trace by an engine's ``run``.  Raises Unsupported, what the run raises, and Implausible for a run that cannot be right."""
    check_supported(engine, request)
    trace = in_own_units(run, request)
    check(request, trace)
    return trace

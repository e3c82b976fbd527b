"""How every engine answers a request: in the linkage's own units, and held to what must be true of a run."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from analytic.kinematics.closure import AssemblyError
from analytic.mechanism.one_line import count
from analytic.mechanism.signals import signals
from sim_models.common.contact_laws import rims
from sim_models.common.health import Implausible, check
from sim_models.common.requests import check_request
from sim_models.common.travel import with_positions
from sim_models.common.units import in_own_units
from sim_models.engine import (
    ENGINES,
    Cause,
    Engine,
    Request,
    SimulationError,
    SimulatorMissing,
    Trace,
    Unsupported,
    check_exported,
    check_flexible,
    check_supported,
    scheme_of,
)

HALVINGS_IF_IMPLAUSIBLE = 2  # of the engine's own step, where its run is not what it must be
NUMPY = Path(np.__file__).parent  # where its errors are raised, which says nothing of where they come from
MEND = "mend the engine, or use another simulator"


def simulate(engine: Engine, request: Request, run: Callable[[Request], Trace], seconds: bool = False) -> Trace:
    """A request's trace by an engine's ``run``, in shorter steps than its own where these leave it implausible, and in
    units of the linkage's own, of time in ``seconds`` if that is wanted.

    Raises Unsupported, what the run raises, Implausible for a run that cannot be right, and SimulationError for an
    answer that is no trace of the request, or that an engine of another package breaks off with an error of its own.
    """
    check_supported(engine, request)
    check_request(request)
    run = partial(answered, engine.name, run=run)
    trace = _run(run, request, seconds)
    try:
        check(request, trace)
        return trace
    except Implausible as implausible:
        step = trace.step
        if request.step is not None or request.motion == "static" or not step:
            raise
        for halving in range(1, HALVINGS_IF_IMPLAUSIBLE + 1):
            found = _finer(run, replace(request, step=step / 2**halving), seconds)
            if found is not None:
                return found
        raise implausible from None


def _run(run: Callable[[Request], Trace], request: Request, seconds: bool) -> Trace:
    trace = with_positions(request.mechanism, in_own_units(run, request, seconds))
    return replace(trace, settings={**trace.settings, **rims(request)})


def answered(name: str, request: Request, run: Callable[[Request], Trace]) -> Trace:
    """What an engine's ``run`` answers, if it is a whole trace of the request.

    Raises what the run raises, and SimulationError (Cause.FAULTY) for another answer, a trace that lacks something, and
    what the run of another package's engine raises that it must not.
    """
    try:
        trace = run(request)
    except (SimulationError, SimulatorMissing, Unsupported, AssemblyError, OverflowError):
        raise
    except Exception as error:  # an engine of another package raises whatever it likes; ours are not to hide faults
        if name in ENGINES:
            raise
        raise broken_off(name, request, error) from error
    if not isinstance(trace, Trace):
        raise _faulty(name, request, f"its answer is of type {type(trace).__name__}, not a Trace")
    asked = request.schedule.time.size
    if trace.crank_angle.size != asked:
        has = count(trace.crank_angle.size, "sample")
        raise _faulty(name, request, f"its trace has {has}, and {asked} {'was' if asked == 1 else 'were'} asked for")
    lacking = [] if scheme_of(name)[0] else list(_lacking(request, trace))  # somebody's model gives what its map has
    if lacking:
        more = f" and {count(len(lacking) - 3, 'more signal')}" if len(lacking) > 3 else ""
        raise _faulty(name, request, f"its trace lacks {', '.join(lacking[:3])}{more}")
    return trace


def broken_off(name: str, request: Request, error: Exception) -> SimulationError:
    """What is said of an engine of another package that raised an error of its own: which, and where."""
    frames = traceback.extract_tb(error.__traceback__)
    last = next((f for f in reversed(frames) if NUMPY not in Path(f.filename).parents), frames[-1])
    what = f"{type(error).__name__}{f' ({error})' if str(error) else ''}"
    return _faulty(name, request, f"it raised {what} at line {last.lineno} of {Path(last.filename).name}")


def _faulty(name: str, request: Request, what: str) -> SimulationError:
    where = f"{name} {request.joint_model} {request.motion} ({request.mechanism.name})"
    return SimulationError(f"{where}: {Cause.FAULTY.words}: {what}", Cause.FAULTY, "" if name in ENGINES else MEND)


def _lacking(request: Request, trace: Trace) -> Iterator[str]:
    """What a trace must have of a request and does not, by name."""
    m = request.mechanism
    for signal in signals(m.bodies, m.joints, m.drives, m.sensors):
        needed = (
            signal.kind == "pose"
            or (signal.kind == "drive" and (request.schedule.crank is not None or not request.schedule.lets_go))
            or (signal.kind == "rate" and request.motion == "driven")
            or (signal.kind == "reaction" and signal.component in ("x", "y", "moment"))
            or (signal.kind == "clearance" and signal.place in request.clearances)
        )
        if needed and signal.name not in trace.signals:
            yield signal.name
    yield from (f"rates of {body.name}" for body in m.bodies if trace.rates and body.name not in trace.rates)


def _finer(run: Callable[[Request], Trace], request: Request, seconds: bool) -> Trace | None:
    """The trace of a run in a given step; None where it cannot be made, or is implausible too."""
    try:
        trace = _run(run, request, seconds)
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


def export(
    engine: Engine, request: Request, folder: Path, write: Callable[[Engine, Request, Path], list[Path]]
) -> list[Path]:
    """Files that an engine's ``write`` makes of a request in a folder.  Raises Unsupported, and what it raises."""
    check_exported(engine, request)
    check_request(request)
    return write(engine, request, folder)

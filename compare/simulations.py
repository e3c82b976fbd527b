"""The simulations of a cross-check: one after the other, or spread over processes; one that fails does not stop the
rest.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields
from functools import partial

import numpy as np

from compare.judge.contact import contact_in, ideal_peaks
from compare.results.contact import Contact
from compare.results.crosscheck import Failure
from compare.sweep import Died, spread
from sim_models.common.simulate import answered
from sim_models.engine import (
    Cause,
    Engine,
    Request,
    SimulationError,
    SimulatorMissing,
    Trace,
    Unsupported,
    engine,
)

Resolve = Callable[[str], Engine]
Task = tuple[str, Request]
"""An engine's name, and what it is asked."""
Took = Callable[[int, float], None]
Numbered = tuple[int, str, Request]


@dataclass(frozen=True)
class ContactTrace(Trace):
    """A trace that was watched, and what contact did in it in place of its every step."""

    contact: Contact | None = None


def with_contact(request: Request, trace: Trace) -> Trace:
    """A trace with what contact did in it, which is little, in place of its every step, which is much."""
    if trace.watched is None:
        return trace
    trace_fields = {f.name: getattr(trace, f.name) for f in fields(Trace)} | {"watched": None}
    return ContactTrace(**trace_fields, contact=contact_in(trace, request.mechanism, ideal_peaks(request.mechanism)))


def simulate(
    simulator: str, request: Request, resolve: Resolve = engine, offers: tuple[str, ...] = ("motion", "angles")
) -> Trace | Failure:
    """Run one request; what an engine fails with becomes a Failure: its own errors, a broken installation, numbers that
    overflow, an answer that is no trace.  ``offers`` is what its remedies may tell a person to change.
    """
    cause: Cause | None = None
    try:
        return with_contact(request, answered(simulator, request, resolve(simulator).simulate))
    except SimulationError as error:
        why, cause = error.said(offers), error.cause
    except Unsupported as error:
        why, cause = str(error), error.cause
    except SimulatorMissing as error:
        why = str(error)
    except (ArithmeticError, np.linalg.LinAlgError) as error:
        cause = Cause.OVERFLOW
        run = f"{simulator} {request.joint_model} {request.motion} ({request.mechanism.name})"
        why = f"{run}: {cause.words} ({error}); {cause.remedy}"
    except ImportError as error:
        why = f"{simulator}: its installation is broken ({error}); install it anew"
    return Failure(simulator=simulator, joint_model=request.joint_model, why=why, cause=cause)


def simulate_all(
    tasks: Sequence[Task],
    workers: int = 1,
    resolve: Resolve = engine,
    offers: tuple[str, ...] = ("motion", "angles"),
    took: Took = lambda i, seconds: None,
) -> Iterator[tuple[int, Trace | Failure]]:
    """Run the tasks and yield (index, outcome) as each ends; more than one worker means processes.  ``took`` is told
    how long (s) each took, before it is yielded.

    An engine that brings its process down has failed.  What else a simulation raises is raised here.
    """
    numbered = [(i, simulator, request) for i, (simulator, request) in enumerate(tasks)]
    run = partial(_simulate, resolve=resolve, offers=offers)
    if workers == 1 or len(tasks) == 1:
        for task in numbered:
            outcome, seconds = run(task)
            took(task[0], seconds)
            yield task[0], outcome
        return
    for ended in spread(run, numbered, workers):
        i, simulator, request = ended.item
        if ended.value is not None:
            outcome, seconds = ended.value
            took(i, seconds)
            yield i, outcome
        elif isinstance(ended.error, Died):
            why = f"{simulator} {request.joint_model} {request.motion}: {ended.error}"
            yield i, Failure(simulator=simulator, joint_model=request.joint_model, why=why)
        elif ended.error is not None:
            raise ended.error


def _simulate(numbered: Numbered, resolve: Resolve, offers: tuple[str, ...]) -> tuple[Trace | Failure, float]:
    """What came of a task, and how long (s) it took."""
    _, simulator, request = numbered
    began = time.perf_counter()
    return simulate(simulator, request, resolve, offers), time.perf_counter() - began

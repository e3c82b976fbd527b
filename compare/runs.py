"""Many independent simulations: one after the other, or spread over processes; one that fails does not stop the rest."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from sim_models.engine import Engine, Request, SimulationError, Trace, engine

Resolve = Callable[[str], Engine]


@dataclass(frozen=True)
class Failure:
    """A simulation that raised; ``why`` is its sentence."""

    simulator: str
    joint_model: str
    why: str


def simulate(simulator: str, request: Request, resolve: Resolve = engine) -> Trace | Failure:
    """Run one request; a SimulationError becomes a Failure."""
    try:
        return resolve(simulator).simulate(request)
    except SimulationError as error:
        return Failure(simulator, request.joint_model, str(error))


def simulate_all(tasks: Sequence[tuple[str, Request]], workers: int = 1, resolve: Resolve = engine) -> Iterator[tuple[int, Trace | Failure]]:
    """Run (simulator, request) pairs and yield (index, outcome) as each ends; more than one worker means processes."""
    if workers == 1 or len(tasks) == 1:
        for i, (simulator, request) in enumerate(tasks):
            yield i, simulate(simulator, request, resolve)
        return
    from joblib import Parallel, delayed

    jobs = (delayed(_numbered)(i, simulator, request) for i, (simulator, request) in enumerate(tasks))
    yield from Parallel(n_jobs=workers, return_as="generator_unordered")(jobs)


def _numbered(i: int, simulator: str, request: Request) -> tuple[int, Trace | Failure]:
    return i, simulate(simulator, request)

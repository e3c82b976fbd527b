"""How long the runs of a cross-check still take, by what those took that have ended."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from compare.judge.reruns import span
from compare.progress import Progress
from compare.results.crosscheck import Failure
from compare.simulations import Task, Took
from sim_models.engine import Request, Trace

MINUTE = 60.0  # s
WORTH_SAYING = 3.0  # s: of less nobody needs to be told
Simulate = Callable[[Sequence[Task], Took], Iterator[tuple[int, Trace | Failure]]]


class Pace:
    """Runs tasks, and tells of each that ends how long the others still take.

    A task is as long as its crank turns; an engine with a joint model takes for a turn what it last took for one.  What
    has not run yet takes what others of its joint model take on the average, or all that have run.
    """

    def __init__(self, simulate: Simulate, workers: int, progress: Progress) -> None:
        self._simulate, self._workers, self._progress = simulate, workers, progress
        self._seconds: dict[tuple[str, str], float] = {}  # for a turn, by engine and joint model
        self._done = self._known = 0

    def run(self, tasks: Sequence[Task], remark: str = "") -> Iterator[tuple[int, Trace | Failure]]:
        """The outcome of each task by its place, as it ends; a ``remark`` is told beside."""
        self._known += len(tasks)
        pending = dict(enumerate(tasks))

        def took(i: int, seconds: float) -> None:
            simulator, request = tasks[i]
            self._seconds[simulator, request.joint_model] = seconds / length(request)

        def tell(name: str) -> None:
            left = self.left(list(pending.values()))
            words = [name] if left is None or left < WORTH_SAYING else [name, f"about {duration(left)} left"]
            self._progress("; ".join(words + [remark] * bool(remark and pending)), self._done, self._known)

        tell(" ".join(dict.fromkeys(simulator for simulator, _ in tasks)))
        for i, outcome in self._simulate(tasks, took):
            del pending[i]
            self._done += 1
            tell(f"{tasks[i][0]} {tasks[i][1].joint_model}")
            yield i, outcome

    def left(self, tasks: Sequence[Task]) -> float | None:
        """How long (s) tasks take together; None before anything has ended."""
        if not self._seconds:
            return None
        each = [self._rate(*task) * length(task[1]) for task in tasks]
        return max(sum(each) / self._workers, max(each, default=0.0))

    def _rate(self, simulator: str, request: Request) -> float:
        alike = [rate for (_, model), rate in self._seconds.items() if model == request.joint_model]
        own = self._seconds.get((simulator, request.joint_model))
        return own if own is not None else float(np.mean(alike or list(self._seconds.values())))


def length(request: Request) -> float:
    """How many turns the crank of a run makes, those of its lead-in too; 1 at rest, and where no crank moves it."""
    turned = 0.0 if request.motion == "static" else span(request) + request.beyond + request.lead_in
    return turned / math.tau or 1.0


def duration(seconds: float) -> str:
    """So many seconds, roughly: ``20 s``, ``3 min``, ``1.5 h``."""
    if seconds < MINUTE:
        return f"{max(5, 5 * round(seconds / 5))} s"
    return f"{round(seconds / MINUTE)} min" if seconds < 60 * MINUTE else f"{seconds / (60 * MINUTE):.1f} h"

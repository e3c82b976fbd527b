"""How long the runs of a cross-check still take, by what those took that have ended."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np

from compare.judge.reruns import span
from compare.progress import Progress
from compare.results.crosscheck import Failure
from compare.simulations import Task, Took
from sim_models.engine import Request, Trace

MINUTE = 60.0  # s
WORTH_SAYING = 3.0  # s: of less nobody needs to be told
LONG = 10.0  # s: who waits longer wants to know what is quick
# s for a turn on one core, means of the shipped linkages: 0.2 to 2.6 with ideal joints, 0.2 to 23 with others
IDEAL_TURN, OTHER_TURN = 0.7, 4.0
Simulate = Callable[[Sequence[Task], Took], Iterator[tuple[int, Trace | Failure]]]


class Pace:
    """Runs tasks, and tells of each that ends how long the others still take.

    A task is as long as its crank turns; an engine with a joint model takes for a turn what it last took for one.  What
    has not run yet takes what other engines take with its joint model, times what this one takes of their time with
    those that both have run.  Where an engine has run nothing yet, or none a joint model, which may take many times
    what others do, what is left is said to be more than they would take.  Processes do no more at a time than they have
    done since the first task ended: engines are loaded, and others may be at work on the machine.  Before anything has
    run it says how many runs there are and, roughly, how long such runs take.
    """

    def __init__(self, simulate: Simulate, workers: int, progress: Progress) -> None:
        self._simulate, self._workers, self._progress = simulate, workers, progress
        self._seconds: dict[tuple[str, str], float] = {}  # for a turn, by engine and joint model
        self._done = self._known = 0
        self._worked = self._elapsed = 0.0  # s: of what has ended after the first task, and by the clock

    def run(self, tasks: Sequence[Task], remark: str = "") -> Iterator[tuple[int, Trace | Failure]]:
        """The outcome of each task by its place, as it ends; a ``remark`` is told beside."""
        self._known += len(tasks)
        pending = dict(enumerate(tasks))

        def took(i: int, seconds: float) -> None:
            simulator, request = tasks[i]
            self._seconds[simulator, request.joint_model] = seconds / length(request)
            self._worked += seconds

        def tell(name: str) -> None:
            left, about = self.left(list(pending.values())), "about" if self.knows(pending.values()) else "more than"
            words = [name] if left is None or left < WORTH_SAYING else [name, f"{about} {duration(left)} left"]
            self._progress("; ".join(words + [remark] * bool(remark and pending)), self._done, self._known)

        names = " ".join(dict.fromkeys(simulator for simulator, _ in tasks))
        seconds = 0.0 if self._seconds else foreseen(tasks, self._workers)
        tell(names if seconds <= LONG else f"{names}: {len(tasks)} runs, {roughly(seconds)}")
        since = time.perf_counter()
        for i, outcome in self._simulate(tasks, took):
            since, before = time.perf_counter(), since
            if self._done:
                self._elapsed += since - before
            else:
                self._worked = 0.0
            del pending[i]
            self._done += 1
            tell(f"{tasks[i][0]} {tasks[i][1].joint_model}")
            yield i, outcome

    def left(self, tasks: Sequence[Task]) -> float | None:
        """How long (s) tasks take together; None before anything has ended."""
        if not self._seconds:
            return None
        each = [self._rate(*task) * length(task[1]) for task in tasks]
        at_once = min(self._workers, self._worked / max(self._elapsed, 1e-9)) if self._worked else self._workers
        return max(sum(each) / at_once, max(each, default=0.0))

    def knows(self, tasks: Iterable[Task]) -> bool:
        """Whether each task's engine has run something, and some engine its joint model."""
        engines, models = ({key[k] for key in self._seconds} for k in (0, 1))
        return all(simulator in engines and request.joint_model in models for simulator, request in tasks)

    def _rate(self, simulator: str, request: Request) -> float:
        own = self._seconds.get((simulator, request.joint_model))
        if own is not None:
            return own
        alike = {name: rate for (name, model), rate in self._seconds.items() if model == request.joint_model}
        scaled = [rate * self._share(simulator, name) for name, rate in alike.items()]
        return float(np.mean(scaled or list(self._seconds.values())))

    def _share(self, simulator: str, other: str) -> float:
        """How much of another engine's time this one takes (geometric mean); 1 where they have run nothing alike."""
        models = {model for name, model in self._seconds if name == simulator}
        both = [(simulator, model) for model in models if (other, model) in self._seconds]
        shares = [math.log(self._seconds[key] / self._seconds[other, key[1]]) for key in both]
        return math.exp(float(np.mean(shares))) if shares else 1.0


def length(request: Request) -> float:
    """How many turns the crank of a run makes, those of its lead-in too; 1 at rest, and where no crank moves it."""
    turned = 0.0 if request.motion == "static" else span(request) + request.beyond + request.lead_in
    return turned / math.tau or 1.0


def foreseen(tasks: Iterable[Task], workers: int) -> float:
    """How long (s) runs usually take together, within a factor of three or so."""
    each = [(IDEAL_TURN if asked.joint_model == "ideal" else OTHER_TURN) * length(asked) for _, asked in tasks]
    return max(sum(each) / workers, max(each, default=0.0))


def roughly(seconds: float) -> str:
    """So many seconds in words that promise nothing."""
    return "half a minute or so" if seconds < 45 else "a minute or two" if seconds < 150 else "several minutes"


def duration(seconds: float) -> str:
    """So many seconds, roughly: ``20 s``, ``3 min``, ``1.5 h``."""
    if seconds < MINUTE:
        return f"{max(5, 5 * round(seconds / 5))} s"
    return f"{round(seconds / MINUTE)} min" if seconds < 60 * MINUTE else f"{seconds / (60 * MINUTE):.1f} h"

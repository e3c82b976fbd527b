"""A run in which pins strike goes on until its averages over revolutions have converged, as far as it is let."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

from compare.judge.closer import Judged
from compare.judge.contact import TURN, more_revolutions
from compare.results.crosscheck import Failure
from sim_models.engine import Request, Trace

ROUNDS = 3
SHORT = 1e-6  # of a revolution, by which an engine's steps may end before it


def prolong(
    judged: Mapping[int, Judged | Failure],
    requests: Mapping[int, Request],
    simulate: Callable[[Mapping[int, Request]], Mapping[int, Trace | Failure]],
    judge: Callable[[Trace], Judged],
    most: float,
) -> dict[int, Judged | Failure]:
    """The runs, those whose statistics have not converged made again from their start, over more revolutions, ``most``
    at the utmost.  A longer run that fails leaves the shorter one.
    """
    ended = dict(judged)
    for _ in range(ROUNDS):
        again = {i: longer for i, one in ended.items() if i in requests and (longer := _longer(requests[i], one, most))}
        found = {i: trace for i, trace in simulate(again).items() if isinstance(trace, Trace)} if again else {}
        ended |= {i: judge(trace) for i, trace in found.items()}
        if len(found) < len(again) or not again:
            break
    return ended


def _longer(request: Request, one: Judged | Failure, most: float) -> Request | None:
    """The request of a longer run; None where that is no use, or not allowed."""
    if isinstance(one, Failure) or one.run.contact is None or one.run.contact.revolutions < 1 - SHORT:
        return None
    found = one.run.contact
    turns = min(math.ceil(more_revolutions(found)), most)
    if turns < found.revolutions + 0.5:
        return None
    return replace(request, beyond=TURN * turns - span(request))


def span(request: Request) -> float:
    """How far (rad) the crank turns from the first report to the last one."""
    return float(request.crank_angle.max() - request.crank_angle.min())

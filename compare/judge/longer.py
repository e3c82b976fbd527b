"""A run in which pins strike goes on until its averages over revolutions have converged, as far as it is let."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from compare.judge.closer import Judged
from compare.judge.contact import TURN, more_revolutions
from compare.report.words.contact import no_longer_run
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
    at the utmost.  Where a longer run fails, the shorter one stays and says so.
    """
    ended, asked = dict(judged), dict(requests)
    for _ in range(ROUNDS):
        again = {i: longer for i, one in ended.items() if i in asked and (longer := _longer(asked[i], one, most))}
        for i, outcome in (simulate(again) if again else {}).items():
            if isinstance(outcome, Trace):
                ended[i] = judge(outcome)
            else:
                ended[i] = _as_far(ended[i], outcome)
                del asked[i]
    return ended


def _as_far(one: Judged | Failure, longer: Failure) -> Judged | Failure:
    """A run that could not be prolonged, with the reason in its words."""
    if isinstance(one, Failure) or one.run.contact is None:
        return one
    contact = one.run.contact.model_copy(update={"words": no_longer_run(one.run.contact.words, longer.why)})
    return replace(one, run=one.run.model_copy(update={"contact": contact}))


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
    angles = request.schedule.crank_angle
    return 0.0 if angles is None else float(np.ptp(angles))

"""How long a cross-check still takes: by hand, and by the clock."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import linkage_crosscheck as lc
from analytic.kinematics.schedule import Schedule
from compare.crosscheck import job_of, quicker
from compare.pace import Pace, duration, foreseen, length
from compare.questions.crosscheck import CrosscheckQuestion
from compare.results.crosscheck import Failure
from compare.simulations import Task, Took
from sim_models.engine import JointModel, Request

ROCKER = lc.load("crank-rocker")
TURN = Schedule.at_angles(ROCKER, np.linspace(0.0, math.tau, 73))
RATES = {("a", "ideal"): 1.0, ("a", "contact"): 4.0, ("b", "contact"): 40.0}  # s for a turn


def asked(joint_model: JointModel, turns: float) -> Request:
    return Request(ROCKER, joint_model, TURN, beyond=math.tau * (turns - 1))


def at_these_rates(tasks: Sequence[Task], took: Took) -> Iterator[tuple[int, Failure]]:
    """Tasks that end in their order, as if each had taken what its rate says; no engine has any part in it."""
    for i, (name, request) in enumerate(tasks):
        took(i, RATES[name, request.joint_model] * length(request))
        yield i, Failure(simulator=name, joint_model=request.joint_model, why="nothing is simulated")


def unsimulated(tasks: Sequence[Task], took: Took) -> Iterator[tuple[int, Failure]]:
    """Tasks that end at once."""
    for i, (name, request) in enumerate(tasks):
        took(i, 1e-3)
        yield i, Failure(simulator=name, joint_model=request.joint_model, why="nothing is simulated")


def test_what_is_left_is_turns_times_what_a_turn_took() -> None:
    told: list[tuple[str, int, int | None]] = []
    pace = Pace(at_these_rates, 2, lambda *what: told.append(what))
    assert pace.left([("a", asked("ideal", 3))]) is None  # nothing has ended
    tasks = [("a", asked("ideal", 3)), ("a", asked("contact", 2)), ("b", asked("contact", 2))]
    list(pace.run(tasks, "a remark"))
    assert told == [
        ("a b; a remark", 0, 3),
        ("a ideal; a remark", 1, 3),  # 4 turns at 1 s on two workers: 2 s
        ("a contact; more than 10 s left; a remark", 2, 3),  # 2 turns of b at what contact took in a: 8 s
        ("b contact", 3, 3),
    ]
    assert pace.left([("b", asked("contact", 8)), ("a", asked("contact", 8))]) == 8 * 40.0  # the longest alone
    assert pace.left([("a", asked("contact", 8)), ("a", asked("contact", 4))]) == 4.0 * 8
    assert pace.left([("a", asked("spring-damper", 1))]) == (1.0 + 4.0 + 40.0) / 3 * 1
    assert pace.knows([("b", asked("contact", 8))])
    assert not pace.knows([("c", asked("contact", 8))])
    assert not pace.knows([("a", asked("contact", 8)), ("b", asked("spring-damper", 8))])
    list(pace.run([("b", asked("contact", 8))]))
    assert told[-2:] == [("b; about 5 min left", 3, 4), ("b contact", 4, 4)]


def test_what_no_engine_has_run_yet_is_said_to_take_longer() -> None:
    """The contact of b: what a's contact takes, 4 s a turn, times what b takes of a's time with ideal joints, 3."""
    told: list[str] = []
    rates = {("a", "ideal"): 1.0, ("b", "ideal"): 3.0, ("a", "contact"): 4.0, ("b", "contact"): 12.0}
    tasks = [(name, asked(model, 2)) for name, model in rates]

    def simulated(tasks: Sequence[Task], took: Took) -> Iterator[tuple[int, Failure]]:
        for i, (name, request) in enumerate(tasks):
            took(i, rates[name, request.joint_model] * length(request))
            yield i, Failure(simulator=name, joint_model=request.joint_model, why="nothing is simulated")

    list(Pace(simulated, 1, lambda what, *_: told.append(what)).run(tasks))
    assert told[2:] == ["b ideal; more than 10 s left", "a contact; about 25 s left", "b contact"]


def test_at_once_it_is_said_how_many_runs_there_are_how_long_they_take_and_what_is_quick() -> None:
    """12 runs of two turns at 4 s are 48 s on two cores, 3 ideal ones 2 s; what is short is not spoken of."""
    told: list[str] = []
    models: tuple[JointModel, ...] = ("ideal", "spring-damper", "contact")
    tasks = [(name, asked(model, 2)) for name in ("mujoco", "dart", "exudyn") for model in models]
    job = job_of(CrosscheckQuestion(mechanism=ROCKER, simulator=["mujoco", "exudyn"], workers=2))
    list(Pace(unsimulated, 2, lambda what, *_: told.append(what)).run(tasks))
    assert foreseen(tasks, 2) == pytest.approx((6 * 2 * 4.0 + 3 * 2 * 0.7) / 2)
    assert told[0] == "mujoco dart exudyn: 9 runs, half a minute or so"
    assert quicker(job, tasks) == ["quick: simulator mujoco or joint ideal"]
    alone = replace(job, simulators=("mujoco",))
    assert quicker(alone, tasks) == ["quick: joint ideal"]
    assert quicker(alone, tasks[:2]) == []
    list(Pace(unsimulated, 2, lambda what, *_: told.append(what)).run(tasks[:2]))
    assert told[-3] == "mujoco"


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(3.0, "5 s"), (22.0, "20 s"), (58.0, "60 s"), (61.0, "1 min"), (788.0, "13 min"), (7e3, "1.9 h")],
)
def test_a_duration_is_said_roughly(seconds: float, words: str) -> None:
    assert duration(seconds) == words


@pytest.mark.slow
@pytest.mark.mujoco
def test_what_is_said_to_be_left_is_what_it_takes() -> None:
    """Of longer runs of pins that strike, each round by itself: within a factor of three, on a machine with others."""
    told: list[tuple[float, str]] = []
    began = time.perf_counter()
    arguments: dict[str, Any] = {"joint_model": "spring-damper", "clearance": {"B": 1e-4, "E": 1e-4}, "workers": 1}
    lc.crosscheck(ROCKER, progress=lambda what, *_: told.append((time.perf_counter() - began, what)), **arguments)
    assert "unless revolutions is 1" in told[0][1]
    said = [
        (int(left[1]), told[k + 1][0] - at)
        for k, (at, what) in enumerate(told)
        if (left := re.search(r"about (\d+) s left; longer, as pins strike; revolutions 1 would end here", what))
    ]
    assert said  # some round was worth telling
    for left, took in said:
        assert left / 3 <= took <= 3 * left

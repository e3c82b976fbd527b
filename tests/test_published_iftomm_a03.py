"""Andrews' squeezer: what the analytic side and the engines make of it, held to its published solution
(:mod:`tests.evidence.published.squeezer`).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from analytic.beyond_paper.free_motion import free_motion
from analytic.beyond_paper.released import released
from analytic.kinematics.assembly import Assembly
from analytic.paper.kinetostatics import Reactions
from asked import request_of
from marks import slow
from sim_models.engine import declared, engine
from tests.evidence.published.squeezer import ANGLES, END, MULTIPLIERS, PINS, RATES, STATED, STEP, relative, squeezer


def by_its_crank(times: np.ndarray) -> Reactions:
    return released(Assembly(squeezer()), times).reactions


def by_its_inputs(times: np.ndarray) -> Reactions:
    return free_motion(Assembly(squeezer()), times, {})


@pytest.mark.slow
@pytest.mark.parametrize("solve", [by_its_crank, by_its_inputs])
def test_analytic_motion_is_the_published_one(solve: Callable[[np.ndarray], Reactions]) -> None:
    """1e-6 of each of the fourteen; reached: 1e-9 of the angles, 2e-7 of the rates."""
    motion = (found := solve(np.linspace(0.0, END, 4))).motion
    for name, angle in relative(lambda body: motion.angle(body)[-1]).items():
        assert angle == pytest.approx(ANGLES[name], rel=1e-8), name
    for name, rate in relative(lambda body: motion.angular_velocity(body)[-1]).items():
        assert rate == pytest.approx(RATES[name], rel=1e-6), name
    forces = [x for pin in PINS for x in (found.forces[pin][-1].real, found.forces[pin][-1].imag)]
    # the published multipliers are less exact than its angles: both ways of ours agree with each other to 2e-8
    assert forces == pytest.approx(MULTIPLIERS, rel=2e-6)


SIMULATES = [
    name
    for name in ("mujoco", "exudyn", "pybullet", "dart")
    if ("point_spring", ("ideal", "driven")) in declared(name).capabilities.rigid.features
]


@pytest.mark.parametrize("name", slow(*SIMULATES))
def test_an_engine_moves_it_as_published_within_what_it_states(name: str) -> None:
    trace = engine(name).simulate(request_of(squeezer(), "ideal", "driven", time=np.linspace(0.0, END, 4), step=STEP))
    for angle, value in relative(lambda body: trace.signals[f"{body}_angle"][-1]).items():
        assert abs(value - ANGLES[angle]) < STATED[name] * ANGLES["beta"], angle

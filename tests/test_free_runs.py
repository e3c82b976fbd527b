"""Released runs: the freedom that is integrated, the same read backward, and the turn of an encoder."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from analytic.beyond_paper.freedom import POINTS, Freedom, swing
from analytic.kinematics.assembly import Assembly
from analytic.mechanism import Mechanism
from analytic.mechanism.file import load
from analytic.mechanism.signals import wrapped
from compare.diagnose.data.recording import Channel, Measured, MeasuredRun
from compare.diagnose.inverse import beginnings
from compare.diagnose.prepare import on_one_turn
from compare.diagnose.problem import Options, Problem
from compare.diagnose.search import costs

PENDULUM = load("pendulum")
MASS, ARM = PENDULUM.bodies[0].mass, 0.15
INERTIA = PENDULUM.bodies[0].moment_of_inertia + MASS * ARM**2
WEIGHT = MASS * 9.81 * ARM  # N.m
SPRING, REST, DAMPER = 40 * WEIGHT, 0.4, 0.02
TIME = np.arange(240) / 120.0
STARTS = ((0.9, 0.0), (-0.5, 1.0))
NOISE = {"pendulum_angle": 2e-4, "pendulum_angular_velocity": 2e-2}


def swung(stiffness: float, rest: float, damper: float, start: Sequence[float], time: np.ndarray) -> np.ndarray:
    """Angle and rate (2, N) by scipy, of J q'' = - m g a cos q - k (q - rest) - d q'."""

    def slope(_: float, state: np.ndarray) -> tuple[float, float]:
        q, w = state
        return w, (-WEIGHT * math.cos(q) - stiffness * (q - rest) - damper * w) / INERTIA

    found = solve_ivp(slope, (time[0], time[-1]), start, "DOP853", time, rtol=1e-11, atol=1e-11)
    return np.asarray(found.y)


# ---------------------------------------------------------------- the freedom


@pytest.mark.parametrize(
    ("stiffness", "start"),
    [
        (0.05, (-0.5, 15.0)),  # over zero and on over a whole turn, where the spring is wound up
        (0.05, (0.5, -15.0)),  # the same backward
        (0.05, (2 * math.pi + 0.3, -15.0)),
        (5.0, (1.5, 0.0)),  # to and fro over zero
    ],
)
def test_a_spring_winds_up_with_every_turn(stiffness: float, start: tuple[float, float]) -> None:
    sprung = PENDULUM.with_joint("O", stiffness=stiffness, rest_angle=REST, damping=1e-3)
    time = np.linspace(0.0, 1.5, 151)
    theta, omega, alpha = swing([Freedom.of(Assembly(sprung))], np.array([start]), time)
    q, w = swung(stiffness, REST, 1e-3, start, time)
    assert q.min() < 0 < q.max() or np.ptp(q) > 2 * math.pi
    np.testing.assert_allclose(theta[0], q, atol=2e-6)
    np.testing.assert_allclose(omega[0], w, atol=1e-4)
    expected = (-WEIGHT * np.cos(q) - stiffness * (q - REST) - 1e-3 * w) / INERTIA
    np.testing.assert_allclose(alpha[0], expected, atol=1e-3 * np.abs(expected).max())


def test_the_swings_of_the_springs_do_reach_another_turn() -> None:
    time = np.linspace(0.0, 1.5, 151)
    assert np.ptp(swung(0.05, REST, 1e-3, (-0.5, 15.0), time)[0]) > 2 * math.pi


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("inertia", [0.0, -1e-3])
def test_a_linkage_without_positive_inertia_has_no_motion(inertia: float) -> None:
    table = np.zeros((6, POINTS))
    table[0], table[4] = inertia, 1.0
    freedom = Freedom(table)
    assert np.isnan(freedom.acceleration(np.array([0.0, 1.0]), np.array([1.0, 0.0]))).all()
    theta, omega, _ = swing([freedom, Freedom.of(Assembly(PENDULUM))], np.array([[0.0, 1.0], [0.0, 1.0]]), TIME)
    assert np.isnan(theta[0, 1:]).all()
    assert np.isnan(omega[0, 1:]).all()
    assert np.isfinite(theta[1]).all(), "the others of the batch go on"


# ---------------------------------------------------------------- released runs, read backward


def swings(turns: Sequence[int] = (0, 0)) -> Measured:
    """Two runs of a pendulum with a stiff spring and a damper, each recorded so many turns higher; neither is in the
    nominal model.
    """
    rng, runs = np.random.default_rng(1), []
    known = Measured(PENDULUM, (), {}, (), "").signals
    for k, (start, turn) in enumerate(zip(STARTS, turns, strict=True)):
        clean = dict(zip(NOISE, swung(SPRING, REST, DAMPER, start, TIME), strict=True))
        seen = {s: clean[s] + sigma * rng.standard_normal(TIME.size) for s, sigma in NOISE.items()}
        seen["pendulum_angle"] += 2 * math.pi * turn
        channels = {s: Channel(known[s], seen[s], sigma, True, known[s].unit) for s, sigma in NOISE.items()}
        first = {s: float(values[0]) for s, values in seen.items()}
        runs.append(MeasuredRun(f"swing-{k}", TIME, channels, "free", None, None, first, None, False, "swing.csv"))
    return Measured(PENDULUM, tuple(runs), {}, (), "rig")


def begun(measured: Measured, *only: str) -> list[dict[str, dict[str, float]]]:
    """What each beginning says of each effect, by name."""
    problem = Problem.of(on_one_turn(measured), PENDULUM, Options("mujoco", only=only, others=False, workers=1))
    wanted = [t for t in problem.terms if t.key not in problem.ruled_out]
    found = beginnings(problem.model, problem.fitter.bounds, costs(wanted, problem.rig, problem.data.size))
    return [
        {t.effect.name: t.effect.values(problem.rig, t.where, x, t.variant) for t, x in each.effects.items()}
        for each in found
    ]


def assert_one_near(beginnings: list[dict[str, dict[str, float]]]) -> None:
    """One beginning has a spring and a damper within 5 % of what they are, and nothing else."""
    (found,) = (each for each in beginnings if set(each) == {"joint_spring", "viscous_friction"})
    assert found["joint_spring"]["stiffness"] == pytest.approx(SPRING, rel=0.05)
    assert wrapped(np.array(found["joint_spring"]["rest_angle"] - REST)) == pytest.approx(0.0, abs=0.02)
    assert found["viscous_friction"]["damping"] == pytest.approx(DAMPER, rel=0.05)


@pytest.mark.parametrize("turns", [(0, 0), (0, 1), (1, 0), (-1, 1)])
def test_a_stiff_spring_and_a_damper_begin_near_what_they_are(turns: tuple[int, int]) -> None:
    """Whichever turn each run's encoder counts from."""
    assert_one_near(begun(swings(turns), "joint_spring", "viscous_friction"))


@pytest.mark.slow
def test_read_backward_one_of_the_beginnings_is_near_with_the_whole_vocabulary() -> None:
    """A larger moment of inertia with a stiffer spring and a stronger damper moves the same way but for gravity's part:
    which it is, the fits of the motion say.
    """
    assert_one_near(begun(swings()))


def test_runs_are_brought_to_one_turn_unless_the_model_has_a_spring() -> None:
    measured = swings((0, 3))
    moved = on_one_turn(measured)
    for before, after, turns in zip(measured.runs, moved.runs, (0, 3), strict=True):
        shift = before.channels["pendulum_angle"].values - after.channels["pendulum_angle"].values
        np.testing.assert_allclose(shift, 2 * math.pi * turns, atol=1e-12)
        assert before.start["pendulum_angle"] - after.start["pendulum_angle"] == pytest.approx(2 * math.pi * turns)
        assert after.start["pendulum_angular_velocity"] == before.start["pendulum_angular_velocity"]
    sprung: Mechanism = PENDULUM.with_joint("O", stiffness=1.0)
    known = replace(measured, mechanism=sprung)
    assert on_one_turn(known) is known, "there its angle has a meaning"

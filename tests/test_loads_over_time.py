"""Loads over time, which counts from a run's start: written out for linkages driven and released, and in engines."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import linkage_crosscheck as lc
from analytic.beyond_paper.released import released
from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.mechanism import Load, Mechanism
from analytic.mechanism.file import load, loads
from engine_checks import agreed, declared_runs
from engines_here import missing
from marks import slow_but
from sim_models.common.units import Units
from sim_models.engine import JointModel, Unsupported

SPEED = 12.0  # rad/s
CRANK, ROD = 0.05, 0.12  # m
TURN = np.radians(np.arange(2.5, 360.0, 15.0))
RISING = ((0.0, 0.0), (0.2, 1.0), (0.5, 3.0))  # s
PUSH = Load(body="slider", force=(-100.0, 0.0), over="time", table=RISING)
PULSE = Load(body="crank", torque=2.0, over="time", start=0.11, end=0.33)
STEADY = Load(body="slider", force=(-300.0, 0.0))


def press(*given: Load, speed: float = SPEED) -> Mechanism:
    """The slider-crank at this speed (rad/s), with these loads."""
    drive = load("slider-crank").drives[0].model_copy(update={"speed": speed})
    return load("slider-crank").replace(drives=(drive,), loads=given)


@pytest.mark.parametrize("speed", [SPEED, -SPEED])
def test_time_counts_from_the_first_angle_that_a_driven_crank_passes(speed: float) -> None:
    with_them, without = (lc.analyse(press(*g, speed=speed), angles=TURN) for g in ((PUSH, PULSE), ()))
    time = (TURN - TURN[0 if speed > 0 else -1]) / speed
    slope = -CRANK * np.sin(TURN) * (1 + CRANK * np.cos(TURN) / np.sqrt(ROD**2 - (CRANK * np.sin(TURN)) ** 2))
    acts = (time >= 0.11) & (time <= 0.33)
    assert 0 < acts.sum() < acts.size
    wanted = 100.0 * np.interp(time, *zip(*RISING, strict=True)) * slope - 2.0 * acts
    np.testing.assert_allclose(with_them["drive_torque"] - without["drive_torque"], wanted, atol=1e-11)


RUNS = [*declared_runs("driven")]


@pytest.mark.long_rows("pybullet-ideal")
@pytest.mark.parametrize(("name", "model"), slow_but([("mujoco", "ideal"), ("pybullet", "ideal")], RUNS))
def test_every_engine_that_has_such_loads_agrees(name: str, model: JointModel) -> None:
    agreed(name, press(PUSH, PULSE, STEADY), model, "driven", {"B": 1e-4}, TURN)


def wheel(*given: Load) -> Mechanism:
    """The pendulum without weight."""
    return load("pendulum").replace(gravity=(0.0, 0.0), loads=given)


@pytest.mark.long_rows("dart", "pybullet", "", "mujoco")
@pytest.mark.parametrize("name", ["", "mujoco", "exudyn", "pybullet", "dart"])
def test_a_released_wheel_gains_the_impulse_of_a_pulse(name: str) -> None:
    """A short one, that an integrator with an eye on smoothness alone would step over."""
    if name and missing(name):
        pytest.skip(missing(name))
    pulse = Load(body="pendulum", torque=0.4, over="time", start=0.9, end=0.95)
    m, time = wheel(pulse), np.linspace(0.0, 2.0, 41)
    body = m.bodies[0]
    gained = 0.4 / (body.moment_of_inertia + body.mass * abs(body.centre) ** 2) * np.clip(time - 0.9, 0.0, 0.05)
    if name:
        spin, near = lc.simulate(m, name, times=time)["pendulum_angular_velocity"], 0.02  # of a step in which it begins
    else:
        spin, near = released(Assembly(m), time).reactions.motion.angular_velocity("pendulum"), 1e-5
    np.testing.assert_allclose(spin, gained, atol=near * gained[-1])


@pytest.mark.mujoco
def test_several_drives_meet_it_too_and_its_ends_are_not_compared() -> None:
    five = load("five-bar")
    body = five.bodies[1].name
    pulse = Load(body=body, force=(30.0, -20.0), over="time", start=0.1, end=0.25)
    time, h = np.arange(0.05, 0.41, 0.05), 1e-5
    around = np.add.outer(time, [-h, 0.0, h]).ravel()
    with_it, without = (lc.analyse(five.replace(loads=g), times=around) for g in ((pulse,), ()))

    def rate(signal: str) -> np.ndarray:
        values = np.asarray(with_it[signal]).reshape(-1, 3)
        return np.asarray(values[:, 2] - values[:, 0]) / (2 * h)

    taken = sum(
        (with_it[f"drive_torque_{j.name}"] - without[f"drive_torque_{j.name}"])[1::3] * rate(f"position_{j.name}")
        for j in five.motors
    )
    given = 30.0 * rate(f"{body}_x") - 20.0 * rate(f"{body}_y")
    acts = (time > 0.11) & (time < 0.24)
    inside = acts | (time < 0.09) | (time > 0.26)  # an end has either
    np.testing.assert_allclose((taken + given * acts)[inside], 0.0, atol=1e-6)
    (run,) = lc.crosscheck(five.replace(loads=(pulse,)), simulator="mujoco", joint_model="ideal", times=time).runs
    assert run.flags == dict.fromkeys(("1", "4"), f"the load on {body} begins or ends here")
    assert run.verdict == "agrees"


def test_what_has_no_time_refuses_it_in_a_sentence(tmp_path: Path) -> None:
    m = press(PUSH)
    with pytest.raises(AssemblyError, match="the load on slider varies over time, which equilibria at rest"):
        lc.analyse(m, angles=TURN, motion="static")
    with pytest.raises(AssemblyError, match="the load on slider varies over time, which equilibria at rest"):
        lc.accuracy(m.with_clearances({"B": 1e-4}), angles=TURN)
    with pytest.raises(Unsupported, match="the load on 'slider' varies over time, which a run at rest has not"):
        lc.simulate(m, "mujoco", angles=TURN, motion="static")
    rubbing = wheel(Load(body="pendulum", torque=1.0, over="time", start=0.0, end=1.0))
    rubbing = rubbing.with_joint("O", friction_torque=0.1)
    with pytest.raises(AssemblyError, match="dry friction and a load over time"):
        released(Assembly(rubbing), np.array([0.0, 1.0]))


def test_it_is_written_in_units_of_time_and_scaled_in_these() -> None:
    text = 'over = "time"\nfrom = "110 ms"\nto = "330 ms"\n'
    from analytic.mechanism.file import dumps

    (read,) = loads(dumps(press()) + f'\n[[load]]\nbody = "crank"\ntorque = 2.0\n{text}').loads
    assert (read.start, read.end) == (pytest.approx(0.11), pytest.approx(0.33))
    (scaled,) = Units(length=0.5, mass=2.0, time=0.25).mechanism(press(PULSE)).loads
    assert (scaled.start, scaled.end) == (pytest.approx(0.44), pytest.approx(1.32))


def test_the_page_draws_it_over_the_time_that_a_crank_needs() -> None:
    from compare.report.peaks import acting

    (drawn,) = acting(lc.analyse(press(PUSH), angles=TURN))
    np.testing.assert_allclose(drawn.size, 100.0 * np.interp((TURN - TURN[0]) / SPEED, *zip(*RISING, strict=True)))

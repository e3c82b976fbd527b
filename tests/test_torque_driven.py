"""Runs whose input is what the motor gives: simulated forward in pieces, their positions compared."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from analytic.beyond_paper.freedom import Freedom, swings
from analytic.kinematics.assembly import Assembly
from analytic.mechanism.file import loads as read
from compare.diagnose.data.measured import load_measured
from compare.diagnose.data.recording import Measured, MeasuredError
from compare.diagnose.workflow import diagnose
from diagnosis_rigs import diagnosed, named, told
from measured_files import RunTable, write_measured
from test_reading_followed import CART, cart

PENDULUM = """
name = "pendulum"
gravity = [9.81, 0.0]
body = [
  { name = "arm", points = { O = [0.0, 0.0], tip = [0.5, 0.0] }, mass = 0.7, com = [0.4, 0.0], inertia = 0.01 },
]
joint = [
  { name = "O", type = "revolute", bodies = ["ground", "arm"] },
]
[ground]
points = { O = [0.0, 0.0] }
[drive]
joint = "O"
speed = "measured"
[assembly]
arm = 0.0
"""
INERTIA, WEIGHT = 0.01 + 0.7 * 0.4**2, 0.7 * 9.81 * 0.4  # kg.m2, N.m


def torque(time: np.ndarray) -> np.ndarray:
    """What the motor gives (N,) N.m."""
    return 1.2 * np.sin(2.1 * time) + 0.6 * np.sin(5.3 * time + 1)


def pendulum(time: np.ndarray, friction: float) -> np.ndarray:
    """Angle (N,) rad by scipy, dry friction (N.m) rounded off within 1 mrad/s."""

    def rates(t: float, state: np.ndarray) -> list[float]:
        rubs = friction * np.tanh(state[1] / 1e-3)
        return [state[1], (float(torque(np.array(t))) - rubs - WEIGHT * np.sin(state[0])) / INERTIA]

    ends = (time[0], time[-1])
    found = solve_ivp(rates, ends, [0.1, 0.0], "LSODA", t_eval=time, rtol=1e-9, atol=1e-11, max_step=2e-3)
    return np.asarray(found.y[0])


def measured(folder: Path, friction: float, **fields: object) -> Path:
    time, draw = np.arange(0, 8, 0.01), np.random.default_rng(2)
    angle = np.round((pendulum(time, friction) + draw.normal(0, 2e-4, time.size)) / 1e-3) * 1e-3
    columns = {"crank_angle [rad]": angle, "drive_torque [N.m]": torque(time) + draw.normal(0, 5e-3, time.size)}
    return write_measured(folder, PENDULUM, [RunTable("run", time, columns, {"drive": "torque", **fields})])


def test_a_pushed_crank_moves_as_its_own_equation_says() -> None:
    time = np.arange(0, 3, 1e-3)  # lines between samples leave out 5e-6 of the faster wave
    ((angle, rate, bend),) = swings(
        [Freedom.of(Assembly(read(PENDULUM)))], np.array([[0.1, 0.0]]), [time], [torque(time)]
    )
    np.testing.assert_allclose(angle, pendulum(time, 0.0), atol=2e-5)
    np.testing.assert_allclose(INERTIA * bend + WEIGHT * np.sin(angle), torque(time), atol=1e-6)
    held = swings([Freedom.of(Assembly(read(PENDULUM)))], np.array([[0.0, 0.0]]), [time], [0.0 * time])[0]
    np.testing.assert_allclose(held[:2], 0.0, atol=1e-12)
    assert rate.std() > 0.1


def test_what_pushes_is_no_sensor_and_is_needed(tmp_path: Path) -> None:
    run = load_measured(measured(tmp_path / "one", 0.0)).runs[0]
    assert list(run.channels) == ["arm_angle"]
    assert run.push is not None
    assert run.push.signal.name == "drive_torque"
    with pytest.raises(MeasuredError, match="start belongs to drive = 'free'"):
        load_measured(measured(tmp_path / "two", 0.0, start={"arm_angle": 0.0}))
    time = np.arange(0, 8, 0.01)
    alone = RunTable("run", time, {"crank_angle [rad]": np.sin(time)}, {"drive": "torque"})
    with pytest.raises(MeasuredError, match="no usable column 'drive_torque'"):
        load_measured(write_measured(tmp_path / "three", PENDULUM, [alone]))


def pushed_cart(folder: Path, friction: float) -> Measured:
    time, travel, force = cart(friction)
    columns = {"position_S [m]": travel, "drive_force_S [N]": force}
    found = load_measured(write_measured(folder, CART, [RunTable("run", time, columns, {"drive": "torque"})]))
    return replace(found, tolerance={})


@pytest.mark.slow
def test_a_cart_under_a_switched_force(tmp_path: Path) -> None:
    found = diagnose(pushed_cart(tmp_path, 3.0), "mujoco", others=False, workers=1)
    assert "moved by what its motor gives" in found.files()["diagnosis.html"]
    result = told(found)
    assert result["verdict"] == "explained"
    assert named(result) == [("coulomb_friction", "S")]
    assert result["effects"][0]["parameters"]["friction_torque"]["value"] == pytest.approx(3.0, rel=0.01)


@pytest.mark.slow
def test_a_pendulum_under_its_motor_with_dry_friction(tmp_path: Path) -> None:
    result = diagnosed(load_measured(measured(tmp_path, 0.12)))
    assert named(result) == [("coulomb_friction", "O")]
    assert result["effects"][0]["parameters"]["friction_torque"]["value"] == pytest.approx(0.12, rel=0.03)


@pytest.mark.slow
def test_a_pendulum_under_its_motor_that_lacks_nothing(tmp_path: Path) -> None:
    assert named(diagnosed(load_measured(measured(tmp_path, 0.0)))) == []

"""Runs that follow an encoder which rings, and forces that are switched: neither is told as a fault of the rig."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.signal import butter, filtfilt

from compare.diagnose.data.measured import load_measured
from compare.diagnose.data.quality import noise, switched
from compare.diagnose.prepare import followed
from diagnosis_rigs import diagnosed, named
from marks import slow
from measured_files import RunTable, write_measured

ROTOR = """
name = "rotor"
body = [
  { name = "rotor", points = { O = [0.0, 0.0], tip = [0.1, 0.0] }, mass = 1.0, com = [0.0, 0.0], inertia = 0.03 },
]
joint = [
  { name = "O", type = "revolute", bodies = ["ground", "rotor"] },
]
[ground]
points = { O = [0.0, 0.0] }
[drive]
joint = "O"
speed = "measured"
[assembly]
rotor = 0.0
"""
CART = """
name = "cart"
body = [
  { name = "cart", points = { S = [0.0, 0.0] }, mass = 6.28, com = [0.0, 0.0], inertia = 1.0 },
]
joint = [
  { name = "S", type = "prismatic", bodies = ["ground", "cart"], axis = [1.0, 0.0] },
]
[ground]
points = { S = [0.0, 0.0] }
[drive]
joint = "S"
speed = "measured"
[assembly]
cart = 0.0
"""


def ringing(folder: Path, friction: float, seed: int = 1) -> Path:
    """A rotor of 0.03 kg.m2 that swings along two sines, whose encoder rings at about 40 Hz by 0.15 mrad (rms)."""
    draw, time = np.random.default_rng(seed), np.arange(0, 8, 0.002)
    waves = ((0.6, 2 * np.pi * 0.7, 0.0), (0.25, 2 * np.pi * 1.9, 1.0))
    angle = sum(a * np.sin(w * time + p) for a, w, p in waves)
    rate = sum(a * w * np.cos(w * time + p) for a, w, p in waves)
    bend = -sum(a * w**2 * np.sin(w * time + p) for a, w, p in waves)
    torque = 0.03 * bend + friction * np.sign(rate) + draw.normal(0, 0.006, time.size)
    ring = filtfilt(*butter(2, [30, 50], "band", fs=500.0), draw.normal(size=time.size))
    read = angle + 1.5e-4 * ring / ring.std() + draw.normal(0, 1e-4, time.size)
    columns = {"crank_angle [rad]": read, "drive_torque [N.m]": torque}
    return write_measured(folder, ROTOR, [RunTable("run", time, columns, {"drive": "measured"})])


def cart(friction: float, step: float = 1e-4, every: int = 67) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time (N,) s, travel (N,) m in counts of 0.08 mm, and force (N,) N of a cart of 6.28 kg under +-13.34 N, switched
    where it is 10 mm off.
    """
    at = rate = 0.0
    force, rows = 13.34, []
    for _ in range(round(12 / step)):
        force = -13.34 if at > 0.01 else 13.34 if at < -0.01 else force
        rows.append((at, force))
        rate += (force - friction * np.sign(rate or force)) / 6.28 * step
        at += rate * step
    x, f = np.array(rows[::every]).T
    return np.arange(x.size) * every * step, np.round(x / 8e-5) * 8e-5, f


def switching(folder: Path, friction: float) -> Path:
    time, travel, force = cart(friction)
    columns = {"position_S [m]": travel, "drive_force_S [N]": force}
    return write_measured(folder, CART, [RunTable("run", time, columns, {"drive": "measured"})])


def test_noise_of_a_switched_force_is_what_its_samples_leave_open() -> None:
    _, travel, force = cart(0.0)
    jumps = np.count_nonzero(np.diff(force))
    assert switched(force) == pytest.approx(26.68 * np.sqrt(jumps / (force.size - 1) / 12))
    assert switched(np.repeat([0.0, 20.0, 50.0, 30.0, -10.0], 40)) > 0
    assert switched(travel) == 0
    draw = np.random.default_rng(0)
    stairs = np.round(3 * np.sin(np.linspace(0, 20, 2000)))  # of a coarse converter
    assert switched(stairs) == 0
    assert noise(np.arange(2000.0), stairs) == pytest.approx(1 / np.sqrt(12))
    assert switched(draw.normal(size=2000)) == 0


def test_a_course_does_not_follow_what_an_encoder_rings(tmp_path: Path) -> None:
    courses, measured = followed(load_measured(ringing(tmp_path, 0.1)))
    (run,) = measured.runs
    moved = courses["run"].at(run.time)
    torque = run.channels["drive_torque"].values
    known = np.isfinite(torque)
    columns = np.column_stack([moved.alpha, np.sign(moved.omega)])[known]
    inertia, friction = np.linalg.lstsq(columns, torque[known], rcond=None)[0]
    assert inertia == pytest.approx(0.03, rel=0.005)
    assert friction == pytest.approx(0.1, rel=0.01)
    assert "rings" in {fault.kind for fault in measured.faults}


def test_a_switched_force_is_as_smooth_as_the_course_beside_it(tmp_path: Path) -> None:
    courses, measured = followed(load_measured(switching(tmp_path, 3.0)))
    (run,) = measured.runs
    moved, force = courses["run"].at(run.time), run.channels["drive_force_S"]
    known = np.isfinite(force.values)
    columns = np.column_stack([moved.alpha, np.sign(moved.omega)])[known]
    mass, friction = np.linalg.lstsq(columns, force.values[known], rcond=None)[0]
    assert mass == pytest.approx(6.28, rel=0.01)
    assert friction == pytest.approx(3.0, rel=0.03)
    assert "switched" in {fault.kind for fault in measured.faults}


@pytest.mark.parametrize("friction", slow(0.1, 0.0))
def test_dry_friction_beside_an_encoder_that_rings(tmp_path: Path, friction: float) -> None:
    result = diagnosed(load_measured(ringing(tmp_path, friction)))
    assert named(result) == ([("coulomb_friction", "O")] if friction else [])
    if friction:
        (effect,) = result["effects"]
        assert effect["parameters"]["friction_torque"]["value"] == pytest.approx(friction, rel=0.02)


@pytest.mark.slow
def test_dry_friction_under_a_switched_force(tmp_path: Path) -> None:
    result = diagnosed(load_measured(switching(tmp_path, 3.0)))
    assert named(result) == [("coulomb_friction", "S")]
    assert result["effects"][0]["parameters"]["friction_torque"]["value"] == pytest.approx(3.0, rel=0.03)

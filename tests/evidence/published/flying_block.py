"""A slider-crank whose block has play in its guide, of Flores, Leine and Glocker (Multibody Syst Dyn 23, 2010, 165), by
Siconos (siconos-tutorials b6c9bfd1, mechanics/SliderCrank); its data are not kept here.

Siconos steps by 0.1 ms, of first order where the mass changes: up to the first impact it gains 1 % of the energy, and
its angles are off by up to 6e-4 rad.  After it the two published runs go on into the same error, and tell of no more.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from analytic.kinematics.schedule import Schedule
from analytic.mechanism import Mechanism
from analytic.mechanism.file import loads
from sim_models.engine import JointModel, Request

FOLDER, FILE = "siconos-slider-crank", "combined.csv"
PLAY, SPEED, STEP = 1e-3, 150.0, 4e-7  # m; rad/s; s, of engines
FREE = 26  # samples after the start, up to 2.6 ms, in which nothing is touched
TOML = """
name = "slider-crank of Flores, Leine and Glocker (2010)"
gravity = [0.0, -9.81]
ground = { points = { O = [0.0, 0.0], S = [0.0, 0.0] } }
body = [
  { name = "crank", points = { O = [0.0, 0.0], A = [0.153, 0.0] }, mass = 0.038, inertia = 7.4e-5 },
  { name = "rod", points = { A = [0.0, 0.0], B = [0.306, 0.0] }, mass = 0.038, inertia = 5.9e-4 },
  { name = "slider", points = { B = [0.0, 0.0], S = [0.0, 0.0] }, mass = 0.076, inertia = 2.7e-6 },
]
drive = { joint = "O", speed = "free" }
assembly = { crank = 0.0, rod = 0.0, slider = 0.0 }
[[joint]]
name = "O"
type = "revolute"
bodies = ["ground", "crank"]
[[joint]]
name = "A"
type = "revolute"
bodies = ["crank", "rod"]
[[joint]]
name = "B"
type = "revolute"
bodies = ["rod", "slider"]
[[joint]]
name = "S"
type = "prismatic"
bodies = ["ground", "slider"]
axis = [1.0, 0.0]
guide = [0.1, 0.05]
clearance = 1e-3
restitution = 0.4
"""


def flying_block() -> Mechanism:
    """The linkage, stretched, its block in the middle of its guide."""
    return loads(TOML)


def recorded(data: Path) -> dict[str, np.ndarray]:
    """Siconos' samples (FREE,) up to the first impact: time (s), angles of crank and rod (rad), the block's height
    (m).
    """
    rows = np.genfromtxt(data / FOLDER / FILE, delimiter=",", skip_header=1)[1 : FREE + 1]
    return {"time": rows[:, 0], "crank": 2 * np.pi * rows[:, 1], "rod": rows[:, 2], "height": PLAY * rows[:, 12]}


def request(joint_model: JointModel, time: np.ndarray) -> Request:
    """Its flight, let go in the middle of its guide, told at times (N,) s."""
    mechanism = flying_block()
    flight = Schedule.released(mechanism, time, SPEED)
    return Request(mechanism, joint_model, flight, start="centred", step=STEP)

"""A compressor's gas force over the piston's travel: the slider-crank of E. J. Haug, Computer-Aided Kinematics and
Dynamics of Mechanical Systems (Allyn and Bacon, 1989), ch. 10, with its data as github.com/rserban/simEngine2D has
them (Models/project2.adm, pistonForce.m): lengths, masses, a drive of 41450 N.m, and what the gas does as the piston
goes out.

The book's curves are no numbers here.  What is held is what follows from the data in closed form: in a turn the drive
gives what the gas takes, and each stroke changes the motion's energy by what both do in it.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

import linkage_crosscheck as lc
from analytic.beyond_paper.released import released
from analytic.kinematics.assembly import Assembly
from analytic.mechanism import Load, Mechanism
from analytic.mechanism.file import loads
from engines_here import missing
from marks import slow

TORQUE, SPEED = 41450.0, 30.0  # N.m; rad/s, where the piston is nearest
CRANK, ROD, ROD_MASS, PISTON_MASS = 2.0, 3.5, 35.0, 25.0  # m, kg
CRANK_INERTIA, ROD_INERTIA = 450.0, 35.0  # kg.m^2
NEAR, TOP, FAR = 1.5, 5.0, 5.5  # m: where the piston turns back, and between where its valve opens
GRAVITY = 9.81  # m/s^2, the way the piston goes
COMPRESSOR = f"""
name = "compressor"
gravity = [{GRAVITY}, 0.0]
ground = {{ points = {{ O = [0.0, 0.0], S = [0.0, 0.0] }} }}
assembly = {{ crank = 3.141592653589793, rod = 0.0, piston = 0.0 }}
drive = {{ joint = "O", speed = "free" }}
initial = {{ velocity_O = {SPEED} }}
joint = [
    {{ name = "O", type = "revolute", bodies = ["ground", "crank"] }},
    {{ name = "A", type = "revolute", bodies = ["crank", "rod"] }},
    {{ name = "B", type = "revolute", bodies = ["rod", "piston"] }},
    {{ name = "S", type = "prismatic", bodies = ["ground", "piston"], axis = [1.0, 0.0] }},
]

[[body]]
name = "crank"
points = {{ O = [0.0, 0.0], A = [{CRANK}, 0.0] }}
mass = 200.0
com = [0.0, 0.0]
inertia = {CRANK_INERTIA}

[[body]]
name = "rod"
points = {{ A = [0.0, 0.0], B = [{ROD}, 0.0] }}
mass = {ROD_MASS}
inertia = {ROD_INERTIA}

[[body]]
name = "piston"
points = {{ B = [0.0, 0.0], S = [0.0, 0.0] }}
mass = {PISTON_MASS}
com = [0.0, 0.0]
inertia = 0.02
"""
PUSHED = Load(body="crank", torque=TORQUE)


def gas(x: np.ndarray) -> np.ndarray:
    """The gas's force (N) on a piston that goes out, where it is at x (m)."""
    compressed = 62857.0 - 282857.0 / (6.0 - np.minimum(x, TOP))
    return np.where(x < TOP, compressed, -110000.0 * (1.0 - np.sin(2 * math.pi * (x - 5.25))))


def work() -> float:
    """What the gas takes (J) in a stroke, by its integral."""
    compressed = 62857.0 * (TOP - NEAR) - 282857.0 * math.log((6.0 - NEAR) / (6.0 - TOP))
    return -(compressed - 110000.0 * (FAR - TOP))  # of the sine half a wave about nothing


def stroke() -> Mechanism:
    """The piston's way out, with the gas over its travel."""
    x = np.linspace(NEAR, FAR, 801)
    table = tuple(zip(x.tolist(), gas(x).tolist(), strict=True))
    return loads(COMPRESSOR).replace(
        loads=(PUSHED, Load(body="piston", force=(1.0, 0.0), over="position_S", table=table))
    )


def turning() -> Mechanism:
    """The same in every turn: nothing on the way back, which the travel does not tell from the way out."""
    angle = np.linspace(math.pi, 2 * math.pi, 401)
    x = CRANK * np.cos(angle) + np.sqrt(ROD**2 - (CRANK * np.sin(angle)) ** 2)
    pairs = [(math.pi - 1e-6, 0.0), *zip(angle[:-1].tolist(), gas(x[:-1]).tolist(), strict=True)]
    pressed = Load(body="piston", force=(1.0, 0.0), over="crank_angle", table=(*pairs, (2 * math.pi - 1e-9, 0.0)))
    return loads(COMPRESSOR).replace(loads=(PUSHED, pressed))


def at(angle: float, theta: np.ndarray, omega: np.ndarray) -> float:
    """The crank's speed (rad/s) where it passes an angle (rad)."""
    return float(np.interp(angle, theta, omega))


def test_in_a_turn_the_drive_gives_what_the_gas_takes() -> None:
    assert work() == pytest.approx(2 * math.pi * TORQUE, rel=1e-5)  # its five digits


def after_the_stroke() -> float:
    """The crank's speed (rad/s) where the piston turns back: it stands there, and the rod turns about it."""
    whole = CRANK_INERTIA + ROD_INERTIA * (CRANK / ROD) ** 2 + ROD_MASS * (CRANK / 2) ** 2
    gained = math.pi * TORQUE - work() + (ROD_MASS + PISTON_MASS) * GRAVITY * 2 * CRANK
    return math.sqrt(SPEED**2 + 2 * gained / whole)


@pytest.mark.parametrize("name", [*slow(""), "mujoco", *slow("exudyn")])
def test_a_stroke_takes_the_energy_that_the_gas_takes(name: str) -> None:
    if name and missing(name):
        pytest.skip(missing(name))
    time = np.linspace(0.0, 0.16, 321)
    if name:
        simulated = lc.simulate(stroke(), name, times=time)
        theta, omega = np.array(simulated["crank_angle"]), np.array(simulated["crank_angular_velocity"])
    else:
        motion = released(Assembly(stroke()), time, math.pi, SPEED).reactions.motion
        theta, omega = motion.theta, motion.angular_velocity("crank")
    assert after_the_stroke() == pytest.approx(19.6, abs=0.1)
    assert at(2 * math.pi, theta, omega) == pytest.approx(after_the_stroke(), rel=2e-4 if name else 2e-5)


@pytest.mark.slow
def test_after_a_turn_the_crank_is_as_fast_as_before() -> None:
    motion = released(Assembly(turning()), np.linspace(0.0, 0.3, 601), math.pi, SPEED).reactions.motion
    speeds = [at(angle, motion.theta, motion.angular_velocity("crank")) for angle in math.pi * np.arange(2.0, 4.0)]
    np.testing.assert_allclose(speeds, [after_the_stroke(), SPEED], rtol=1e-4)

"""A textbook's slider-crank that rubs everywhere at once: friction circles at its pins, a coefficient at its block.

At rest the rod is a bar between two forces, along the line that touches the friction circles of both of its pins; the
block stands at the angle of friction to its guide (Norton, Design of Machinery; Mabie and Reinholtz, Mechanisms and
Dynamics of Machinery).  In motion Newton's equations of the three bodies are solved by themselves.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

import linkage_crosscheck as lc
from analytic.mechanism import Mechanism
from analytic.mechanism.file import load
from marks import slow
from sim_models.engine import ENGINES

CRANK, ROD, PUSH = 0.05, 0.12, -900.0  # m, m, N on the slider
RADII = {"O": 0.2 * 0.012, "A": 0.15 * 0.015, "B": 0.25 * 0.01}  # m: coefficient times pin radius
BLOCK = 0.18  # coefficient in its guide
DEGREES = np.array([20.0, 65.0, 110.0, 150.0, 200.0, 250.0, 290.0, 335.0])  # clear of the dead centres
SPEED = 60.0  # rad/s
RUBBING = [pytest.param(name, marks=getattr(pytest.mark, name)) for name in ENGINES if name != "exudyn"]


def rough(speed: float) -> Mechanism:
    """The slider-crank whose pins and block rub."""
    m = load("slider-crank").with_clearances({}).replace(loads=[{"body": "slider", "force": (PUSH, 0.0)}])
    m = m.replace(drive={"joint": "O", "speed": speed})
    for name, (friction, radius) in {"O": (0.2, 0.012), "A": (0.15, 0.015), "B": (0.25, 0.01)}.items():
        m = m.with_joint(name, friction=friction, pin_radius=radius)
    return m.with_joint("S", friction=BLOCK)


def rod_angle(theta: float) -> float:
    return -math.asin(CRANK / ROD * math.sin(theta))


def signs(theta: float, omega: float) -> tuple[float, float, float, float]:
    """Of the slip of O, A, B and S."""
    phi = rod_angle(theta)
    spin = -CRANK * math.cos(theta) / (ROD * math.cos(phi)) * omega
    slide = -CRANK * math.sin(theta) * omega - ROD * math.sin(phi) * spin
    return math.copysign(1, omega), math.copysign(1, spin - omega), math.copysign(1, -spin), math.copysign(1, slide)


def at_rest(theta: float, way: float) -> tuple[float, complex]:
    """Drive torque (N.m), and force (N) of the rod on the slider, by the lines that touch the circles."""
    o, a, b, s = signs(theta, way)
    phi = rod_angle(theta)
    beside = math.asin((RADII["B"] * b - RADII["A"] * a) / ROD)
    for line in (phi + beside, phi + math.pi - beside):  # it pushes, or pulls
        along = math.cos(line) - BLOCK * abs(math.sin(line)) * s
        size = -PUSH / along
        if size > 0:
            break
    force = size * complex(math.cos(line), math.sin(line))
    pin = CRANK * complex(math.cos(theta), math.sin(theta))
    turned = (pin.conjugate() * force).imag
    return turned - RADII["A"] * size * a + RADII["O"] * size * o, force


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_at_rest_the_rods_force_touches_both_circles_and_the_block_stands_at_its_angle(way: float) -> None:
    theta = np.radians(DEGREES)
    found = lc.analyse(rough(way * SPEED), motion="static", angles=theta)
    for k, angle in enumerate(theta.tolist()):
        torque, force = at_rest(angle, way)
        moment = found["reaction_S_moment"][k]
        *_, slides = signs(angle, way)
        assert 2 / 0.1 * abs(moment - slides * BLOCK * 0.025 * force.imag) < abs(force.imag), "its block lies flat"
        assert found["drive_torque"][k] == pytest.approx(torque, rel=1e-9)
        seen = complex(found["reaction_B_x"][k], found["reaction_B_y"][k])
        assert seen == pytest.approx(force, rel=1e-9)
        assert complex(found["reaction_S_x"][k], found["reaction_S_y"][k]) == pytest.approx(-force - PUSH, rel=1e-9)
    smooth = lc.analyse(rough(way * SPEED).ideal().with_joint("S", friction=0.0), motion="static", angles=theta)
    assert np.all((found["drive_torque"] - smooth["drive_torque"]) * way > 0)


def in_motion(theta: float, omega: float) -> np.ndarray:
    """Forces at O, A and B (x, y), the guide's on the block across, its moment, and the drive torque, by Newton's
    equations of three bodies and a fixed point.
    """
    o, a, b, s = signs(theta, omega)
    phi = rod_angle(theta)
    spin = -CRANK * math.cos(theta) / (ROD * math.cos(phi)) * omega
    bend = (CRANK * math.sin(theta) * omega**2 + ROD * math.sin(phi) * spin**2) / (ROD * math.cos(phi))
    out, along = complex(math.cos(theta), math.sin(theta)), complex(math.cos(phi), math.sin(phi))
    pin = CRANK * out * -(omega**2)
    middle = pin + ROD / 2 * along * (1j * bend - spin**2)
    end = pin + ROD * along * (1j * bend - spin**2)

    def cross(arm: complex, force: complex) -> float:
        return (arm.conjugate() * force).imag

    def left(x: np.ndarray, sizes: np.ndarray) -> np.ndarray:
        """What Newton's equations lack, under friction of these sizes: linear in the forces."""
        at_o, at_a, at_b = complex(*x[0:2]), complex(*x[2:4]), complex(*x[4:6])
        across, moment, torque = x[6:]
        rub_o, rub_a, rub_b, rub_s = sizes * [o, a, b, s]
        crank = at_o - at_a - 0.30 * 0.025 * out * -(omega**2)
        turned = torque - rub_o + rub_a + cross(-0.025 * out, at_o) + cross(0.025 * out, -at_a)
        rod = at_a - at_b - 0.21 * middle
        rolled = -rub_a + rub_b + cross(-ROD / 2 * along, at_a) + cross(ROD / 2 * along, -at_b) - 2.5e-4 * bend
        block = at_b + PUSH + 1j * across - rub_s - 0.14 * end
        parts = crank.real, crank.imag, turned, rod.real, rod.imag, rolled, block.real, block.imag, moment - rub_b
        return np.array(parts)

    def sizes(x: np.ndarray) -> np.ndarray:
        pins = [RADII[name] * math.hypot(*x[k : k + 2]) for k, name in ((0, "O"), (2, "A"), (4, "B"))]
        pressed = max(abs(x[6]), 2 / 0.1 * abs(x[7] + s * BLOCK * 0.025 * x[6]))
        return np.array([*pins, BLOCK * pressed])

    none = left(np.zeros(9), np.zeros(4))
    matrix = np.column_stack([left(unit, np.zeros(4)) - none for unit in np.eye(9)])
    x = np.zeros(9)
    for _ in range(60):  # the friction of these forces, and the forces under that friction
        x = np.linalg.solve(matrix, -left(np.zeros(9), sizes(x)))
    assert np.abs(left(x, sizes(x))).max() < 1e-10 * abs(PUSH)
    return x


@pytest.mark.long_rows("dart-60.0", "pybullet-60.0", "mujoco-60.0")
@pytest.mark.parametrize("omega", [SPEED, *slow(-SPEED)])
@pytest.mark.parametrize("side", ["analytic", *RUBBING])
def test_in_motion_all_rub_at_once(omega: float, side: str) -> None:
    theta = np.radians(DEGREES)
    m = rough(omega)
    found = lc.analyse(m, angles=theta) if side == "analytic" else lc.simulate(m, simulator=side, angles=theta)
    expected = np.array([in_motion(angle, omega) for angle in theta.tolist()])
    names = [f"reaction_{joint}_{axis}" for joint in "OAB" for axis in "xy"]
    names += ["reaction_S_y", "reaction_S_moment", "drive_torque"]
    for name, values in zip(names, expected.T, strict=True):
        rounding = 1e-8 if side == "analytic" else 1e-4
        np.testing.assert_allclose(found[name], values, atol=rounding * np.abs(values).max(), rtol=0, err_msg=name)

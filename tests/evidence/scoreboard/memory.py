"""Torques that remember how a joint has turned: hysteresis (Bouc and Wen), and friction that sticks before it slips.

A state z without a unit, zero a revolution before the run, follows the joint's angular velocity; the torque is in
proportion to it, against the motion.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

Slope = Callable[[float, float], float]  # dz/dt (1/s) at an angular velocity (rad/s) and a state


def bouc_wen(give: float, sharpness: float, fatness: float) -> Slope:
    """Hysteresis after Bouc (1967) and Wen (1976): z is elastic over the angle ``give`` (rad) and then yields, at 1.

    dz/dq = (1 - z^n (fatness sign(z dq) + 1 - fatness)) / give, n the ``sharpness``; with a fatness of 1/2 it unloads
    along a straight line.
    """

    def slope(rate: float, z: float) -> float:
        along = fatness * math.copysign(1.0, z * rate) + 1 - fatness
        return rate * (1 - abs(z) ** sharpness * along) / give

    return slope


def bristle(give: float, stribeck_rate: float, excess: float) -> Slope:
    """Friction after Dahl (1968) and Canudas de Wit (1995): bristles bend over the angle ``give`` (rad), then slip.

    Slipping at a steady rate z is the sign of the rate (rad/s) by 1 + excess exp(-(rate / stribeck_rate)^2).
    """

    def slope(rate: float, z: float) -> float:
        return (rate - abs(rate) * z / (1 + excess * math.exp(-((rate / stribeck_rate) ** 2)))) / give

    return slope


def remembered(slope: Slope, time: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """The state (n,) at every second of the times (2 n - 1,) s, evenly spaced, of these rates (rad/s), from zero (Runge
    and Kutta).
    """
    step, z, states = float(time[2] - time[0]), 0.0, [0.0]
    told = rate.tolist()
    for first, middle, last in zip(told[:-2:2], told[1::2], told[2::2], strict=True):
        a = slope(first, z)
        b = slope(middle, z + step / 2 * a)
        c = slope(middle, z + step / 2 * b)
        d = slope(last, z + step * c)
        z += step / 6 * (a + 2 * b + 2 * c + d)
        states.append(z)
    return np.array(states)

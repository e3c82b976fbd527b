"""A linkage without a motor, released at rest: its own motion under gravity, loads and joint laws.

With one freedom the drive torque that a motion needs is affine in the crank's acceleration; a free crank accelerates
so that it needs none.
"""

from __future__ import annotations

import numpy as np

from analytic.assembly import Assembly, AssemblyError
from analytic.kinematics import kinematics
from analytic.kinetostatics import Reactions, kinetostatics

ACCURACY = 1e-10  # relative, of the integration


def crank_acceleration(assembly: Assembly, theta: np.ndarray, omega: np.ndarray) -> np.ndarray:
    """Acceleration (rad/s^2) of a free crank at angles theta (rad) and speeds omega (rad/s), (N,) each."""
    still = kinetostatics(kinematics(assembly, theta, omega, 0.0)).drive_torque
    moving = kinetostatics(kinematics(assembly, theta, omega, 1.0)).drive_torque
    return -still / (moving - still)


def released(assembly: Assembly, time: np.ndarray, theta: float | None = None, omega: float = 0.0) -> Reactions:
    """Motion and reactions at times (N,) s after release at crank angle theta (the assembly angle) and speed omega.

    Raises AssemblyError where the motion meets a change point.
    """
    from scipy.integrate import solve_ivp

    def state_rate(_: float, state: np.ndarray) -> list[float]:
        angle, speed = state
        return [speed, float(crank_acceleration(assembly, np.array([angle]), np.array([speed]))[0])]

    start = [assembly.start if theta is None else theta, omega]
    found = solve_ivp(state_rate, (0.0, float(time[-1]) or 1e-12), start, "DOP853", t_eval=time, rtol=ACCURACY, atol=ACCURACY)
    if not found.success:
        raise AssemblyError(f"{assembly.mechanism.name}: the released motion cannot be followed beyond {found.t[-1]:g} s ({found.message})")
    angle, speed = found.y
    motion = kinematics(assembly, angle, speed, crank_acceleration(assembly, angle, speed))
    return kinetostatics(motion)

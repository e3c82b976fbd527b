"""A linkage without a motor, released: its own motion under gravity, loads and joint laws, until friction holds it.

With one freedom, Coulomb friction in every joint changes direction with the crank: the motion consists of stretches of
one direction.  Each ends where the crank comes to rest; it then turns back or, where friction is larger, stays.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from analytic.beyond_paper.free_motion import integration_accuracy
from analytic.beyond_paper.freedom import coefficients, resistance, stopping
from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.motion import kinematics
from analytic.mechanism.one_line import angles, one_line
from analytic.paper.kinetostatics import Reactions, kinetostatics

# s before and after the crank turns back, in which simulations preslide, or are within a step of the reversal
REVERSAL_TIME = 1e-3
REST_SPEED = 1e-150  # rad/s: enough to give friction its direction, too little to change any number


@dataclass(frozen=True)
class Released:
    """A released motion; ``held`` (N,) says at which times friction holds the linkage at rest, ``turning`` at which it
    turns back.
    """

    reactions: Reactions
    held: np.ndarray
    turning: np.ndarray

    def __repr__(self) -> str:
        motion = self.reactions.motion
        held = f"at rest in {int(self.held.sum())}" if self.held.any() else ""
        return one_line(self, motion.structure.mechanism.name, angles(motion.theta, "moment"), held)


def released(assembly: Assembly, time: np.ndarray, theta: float | None = None, omega: float = 0.0) -> Released:
    """Motion and reactions at times (N,) s after release, ascending, at crank angle theta (rad; the assembly angle) and
    speed omega (rad/s).

    Raises AssemblyError where the motion meets a change point.
    """
    m = assembly.mechanism
    if m.timed_load is not None and any(joint.rubs for joint in m.joints):
        raise AssemblyError(
            f"{m.name}: the analytic model knows no released motion with dry friction and a load over time, which may"
            " set the linkage going again",
            remedy="leave one of them out",
        )
    rubs = any(joint.rubs for joint in m.joints) or any(load.opposes for load in m.loads)
    # stops push over a part of the motion only, so that few rates do not tell their law
    bare = Assembly(m.replace(stops=())) if m.stops else assembly
    angles, speeds, accelerations = np.empty((3, time.size))
    grip, held = np.ones(time.size), np.zeros(time.size, bool)
    angle, speed, now, k = assembly.start if theta is None else theta, omega, 0.0, 0
    while k < time.size:
        here, still = np.array([angle]), np.zeros(1)
        now_at = coefficients(bare, here, np.array([now]))
        rest = float(now_at[4, 0] + stopping(assembly, here, still)[0])
        friction = float(resistance(now_at, still)[1][0])
        direction = float(np.sign(speed) or -np.sign(rest)) if rubs else 0.0
        if rubs and speed == 0 and abs(rest) <= friction:
            angles[k:], speeds[k:], accelerations[k:] = angle, direction * REST_SPEED, 0.0
            grip[k:], held[k:] = abs(rest) / friction if friction else 1.0, True
            break
        solution = _stretch(assembly, bare, time[k:], now, (angle, speed), direction)
        part = slice(k, k + solution.t.size)
        angles[part], speeds[part] = solution.y
        speeds[part] += direction * REST_SPEED  # at rest for an instant, friction is that of the motion to come
        accelerations[part] = _acceleration(assembly, bare, time[part], angles[part], speeds[part], direction)
        if solution.status == 1:
            now, angle, speed = float(solution.t_events[0][0]), float(solution.y_events[0][0, 0]), 0.0
        k = part.stop
    turning = ~held & rubs & (np.abs(speeds) <= REVERSAL_TIME * np.abs(accelerations))
    motion = kinematics(assembly, angles, speeds, accelerations, time=time)
    return Released(kinetostatics(motion, grip=grip), held, turning)


def _stretch(
    assembly: Assembly, bare: Assembly, time: np.ndarray, now: float, state: tuple[float, float], direction: float
) -> Any:
    """The motion from a state (rad, rad/s) at ``now`` (s) on, at the times, until it would turn back; with direction 0
    it may.  Where a joint comes to its stop, the integration's own accuracy makes its steps short.
    """
    from scipy.integrate import solve_ivp

    def rate(t: float, state: np.ndarray) -> list[float]:
        angle, speed = state
        here = np.array([t]), np.array([angle]), np.array([speed])
        return [speed, float(_acceleration(assembly, bare, *here, direction)[0])]

    def onward(_: float, state: np.ndarray) -> float:
        return float(direction * state[1])

    onward.terminal, onward.direction = True, -1.0  # type: ignore[attr-defined]  # scipy's way to say so
    accuracy = integration_accuracy(assembly.mechanism)
    span = (now, max(float(time[-1]), now + 1e-12))
    solution = solve_ivp(
        rate,
        span,
        state,
        "DOP853",
        t_eval=time,
        events=onward if direction else None,
        rtol=accuracy,
        atol=accuracy,
        max_step=assembly.mechanism.shortest_stretch,
    )
    if not solution.success:
        reached = solution.t[-1] if solution.t.size else now
        raise AssemblyError(
            f"{assembly.mechanism.name}: the released motion cannot be followed beyond {reached:g} s"
            f" ({solution.message})"
        )
    return solution


def _acceleration(
    assembly: Assembly, bare: Assembly, time: np.ndarray, angle: np.ndarray, speed: np.ndarray, direction: float
) -> np.ndarray:
    """Acceleration (rad/s^2) of the free crank at times (s), angles (rad) and speeds (rad/s), (N,) each, friction
    against ``direction``; ``bare`` is the linkage without its stops.
    """
    terms = coefficients(bare, angle, time)
    mass, half, _, _, rest = terms[:5]
    damped, dry = resistance(terms, speed)
    stopped = stopping(assembly, angle, speed)
    return np.asarray(-(half * speed**2 + damped + dry * direction + rest + stopped) / mass)

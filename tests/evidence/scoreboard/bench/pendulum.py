"""A released pendulum on its own equation of motion, integrated to 1e-10 by scipy and by no engine.

One body turns about a pin at the origin.  q is its angle from the ground's x axis, J its moment of inertia about
the pin, m its mass, c = (a, n) its centre in its own frame, g gravity; spring k with rest angle r, damper d, a
constant torque T:

    J q'' = m (c_x g_y - c_y g_x) - k (q - r) - d q' + T,    c_x + i c_y = (a + i n) exp(i q)

The pin pushes the body with m (c'' - g).
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from analytic.mechanism import Mechanism
from compare.diagnose.effects.effect import Values
from tests.evidence.scoreboard.rigs import Rejected
from tests.evidence.scoreboard.sizes import Planted

TOLERANCE = 1e-10
TORQUE = "a constant torque"


@dataclass(frozen=True)
class Pendulum:
    """SI; ``inertia`` about the pin, ``centre`` along and normal in the body's frame as one complex number."""

    mass: float
    inertia: float
    centre: complex
    gravity: complex
    stiffness: float = 0.0
    rest: float = 0.0
    damping: float = 0.0
    torque: float = 0.0

    @classmethod
    def of(cls, m: Mechanism) -> Pendulum:
        """A mechanism of one body, its pin at the origin of the body and of the ground, with what its joint has."""
        (body,), (joint,) = m.bodies, m.joints
        inertia = body.moment_of_inertia + body.mass * abs(body.centre) ** 2
        return cls(
            body.mass,
            inertia,
            complex(body.centre),
            complex(*m.gravity),
            joint.stiffness,
            joint.rest_angle,
            joint.damping,
        )

    def with_things(self, things: Sequence[Planted]) -> Pendulum:
        """With effects, as the contract says what they mean."""
        p = self
        for thing in things:
            if thing.name not in THINGS:
                raise ValueError(f"{thing.name}: a pendulum has a spring, a damper and a payload; use one of them")
            p = THINGS[thing.name](p, self.centre, thing.values)
        return p

    def acceleration(self, angle: np.ndarray, rate: np.ndarray) -> np.ndarray:
        """q'' (rad/s^2)."""
        arm = self.centre * np.exp(1j * angle)
        weight = self.mass * (arm.real * self.gravity.imag - arm.imag * self.gravity.real)
        joint = -self.stiffness * (angle - self.rest) - self.damping * rate + self.torque
        return np.asarray((weight + joint) / self.inertia)

    def swing(self, angle: float, rate: float, time: np.ndarray, tolerance: float = TOLERANCE) -> np.ndarray:
        """(2, N): angle (rad) and rate (rad/s) at times (N,) s from this state.  Raises Rejected."""

        def slope(_: float, state: np.ndarray) -> tuple[float, float]:
            return state[1], float(self.acceleration(state[0], state[1]))

        found = solve_ivp(
            slope, (time[0], time[-1]), (angle, rate), "DOP853", time, rtol=tolerance, atol=1e-2 * tolerance
        )
        if not found.success:
            raise Rejected(f"the pendulum: {found.message}")
        return np.asarray(found.y)

    def push(self, angle: np.ndarray, rate: np.ndarray) -> np.ndarray:
        """(N,) complex: force (N) of the pin on the body."""
        turn = 1j * self.acceleration(angle, rate) - rate**2
        return np.asarray(self.mass * (turn * self.centre * np.exp(1j * angle) - self.gravity))

    @property
    def weight_torque(self) -> float:
        """m g times the arm (N.m)."""
        return self.mass * abs(self.gravity) * abs(self.centre)


def _with_payload(p: Pendulum, nominal_centre: complex, v: Values) -> Pendulum:
    """With a mass at a place that is told from the nominal centre."""
    arm = nominal_centre + complex(v["along"], v["normal"])
    mass = p.mass + v["mass"]
    centre = (p.mass * p.centre + v["mass"] * arm) / mass
    return replace(p, mass=mass, centre=centre, inertia=p.inertia + v["mass"] * abs(arm) ** 2)


THINGS: Mapping[str, Callable[[Pendulum, complex, Values], Pendulum]] = {
    "joint_spring": lambda p, _, v: replace(p, stiffness=v["stiffness"], rest=v["rest_angle"]),
    "viscous_friction": lambda p, _, v: replace(p, damping=v["damping"]),
    "payload": _with_payload,
}


# ---------------------------------------------------------------- what else could explain a swing


def rival_left(pendulum: Pendulum, nominal: Pendulum, starts: Sequence[tuple[float, float]], time: np.ndarray,
               noise: tuple[float, float]) -> float:  # fmt: skip
    """Sigmas of angle and rate that the best wrong explanation of a spring leaves: gravity of another size and
    direction, or a constant torque, with the true damper and the starts free.

    Each starts from the torques that it would need along the true swings.
    """
    true = [pendulum.swing(*start, time) for start in starts]
    q, w = np.concatenate([s[0] for s in true]), np.concatenate([s[1] for s in true])
    without = replace(pendulum, stiffness=0.0, rest=0.0)
    missing = pendulum.inertia * (pendulum.acceleration(q, w) - without.acceleration(q, w))
    arm = nominal.centre * np.exp(1j * q)
    shapes = {"gravity": np.column_stack([-arm.imag, arm.real]) * nominal.mass, TORQUE: np.ones((q.size, 1))}
    left = []
    for name, shape in shapes.items():
        x = np.linalg.lstsq(np.column_stack([shape, -w]), missing, rcond=None)[0]

        def residual(p: np.ndarray, name: str = name) -> np.ndarray:
            other = _wrong(without, name, p)
            tail = np.reshape(p[-2 * len(starts) :], (-1, 2))
            swings = [other.swing(a, b, time, 1e-7) for a, b in tail]
            return np.concatenate(
                [((s - t) / np.array(noise)[:, None]).ravel() for s, t in zip(swings, true, strict=True)]
            )

        first = np.concatenate([x, np.ravel(starts)])
        found = least_squares(residual, first, x_scale=np.maximum(np.abs(first), 1e-2), max_nfev=12)
        left.append(math.sqrt(2 * found.cost))
    return min(left)


def _wrong(without: Pendulum, name: str, p: np.ndarray) -> Pendulum:
    damped = replace(without, damping=without.damping + p[1 if name == TORQUE else 2])
    if name == TORQUE:
        return replace(damped, torque=float(p[0]))
    return replace(damped, gravity=without.gravity + complex(p[0], p[1]))


def turned(angle: float) -> float:
    """An angle (rad) within half a turn of zero."""
    return cmath.phase(cmath.exp(1j * angle))

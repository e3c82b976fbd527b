"""A linkage's one freedom in tables over the crank angle, and many such linkages released side by side.

The drive torque that a motion needs is

    M alpha + M'/2 omega^2 + c omega + d omega |omega| + (f + sum of a exp(-(r omega)^2)) sign(omega) + g.

M and g follow from kinetostatics, once; what opposes the motion (c, d, f, and an a and r of each joint with Stribeck's
friction) by virtual work from the joints' rates.  Of springs that the turns t of the crank wind up, g is
g0 + h1 t + h2 t^2 + h3 t^3, all of them periodic.  A free motion is then a small ordinary differential equation.  At
rest friction holds whatever is no larger than itself: |g| <= f + sum of a.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.motion import kinematics
from analytic.mechanism.one_line import count, one_line
from analytic.paper.kinetostatics import kinetostatics, load_now

TABLE_POINTS = 720  # of a table over a revolution


@dataclass(frozen=True)
class Freedom:
    """Coefficients over a revolution, (9 + 2 n, P), at P crank angles evenly apart from 0 on: M, M'/2, c, f, g, then
    h1, h2 and h3 of the turns in it, d, and a and r of each of n joints with Stribeck's friction.
    """

    table: np.ndarray

    def __repr__(self) -> str:
        return one_line(self, count(self.table.shape[1], "crank angle"))

    @classmethod
    def of(cls, assembly: Assembly) -> Freedom:
        """The freedom of a linkage whose crank turns fully.  Raises AssemblyError where it does not, and for stops, of
        whose pushing no table over a revolution tells.
        """
        if assembly.mechanism.stops:
            raise AssemblyError(
                f"{assembly.mechanism.name}: a diagnosis knows no released motion with stops (stop of joint"
                f" {assembly.mechanism.stops[0].joint!r})",
                remedy="leave them out, or the released runs",
            )
        theta = np.arange(TABLE_POINTS) * 2 * math.pi / TABLE_POINTS
        first, wound = coefficients(assembly, theta), np.zeros((3, TABLE_POINTS))
        joints = assembly.mechanism.joints
        if terms := max(4 if joint.cubic else 2 if joint.springy else 0 for joint in joints):
            turns = np.arange(terms) - terms // 2
            pushed = [coefficients(assembly, theta + 2 * math.pi * n)[4] if n else first[4] for n in turns]
            powers = (theta[:, None] / (2 * math.pi) + turns)[:, :, None] ** np.arange(terms)
            wound[: terms - 1] = np.linalg.solve(powers, np.stack(pushed, axis=1)[:, :, None])[:, 1:, 0].T
        return cls(np.insert(first, 5, wound, axis=0))

    def inertia(self, theta: np.ndarray) -> np.ndarray:
        """M (kg.m^2) at crank angles (N,) rad."""
        from analytic.beyond_paper.swing_loop import coefficient

        return np.asarray(coefficient(self.splines, 0, np.ascontiguousarray(theta, float)))

    def acceleration(self, theta: np.ndarray, omega: np.ndarray) -> np.ndarray:
        """Acceleration (rad/s^2) of the free crank at angles theta (N,) rad and rates omega (N,) rad/s."""
        from analytic.beyond_paper.swing_loop import accelerations

        state = (np.ascontiguousarray(theta, float), np.ascontiguousarray(omega, float))
        return np.asarray(accelerations(self.splines, *state))

    @cached_property
    def splines(self) -> np.ndarray:
        """The table as cubic B-splines around the revolution, (P + 3, 9 + 2 n), one neighbour before the first and two
        after the last; g0 in place of g.
        """
        points, periodic = self.table.shape[1], self.table.copy()
        turns = np.arange(points) / points
        periodic[4] -= turns * (periodic[5] + turns * (periodic[6] + turns * periodic[7]))
        seen = (2 + np.cos(2 * math.pi * np.arange(points // 2 + 1) / points)) / 3  # of a wave, at the points
        weights = np.fft.irfft(np.fft.rfft(periodic) / seen, points)
        return np.ascontiguousarray(np.concatenate([weights[:, -1:], weights, weights[:, :2]], axis=1).T)


def coefficients(assembly: Assembly, theta: np.ndarray, time: np.ndarray | None = None) -> np.ndarray:
    """M, M'/2, c, f, g, d and the joints' a and r (6 + 2 n, N) at crank angles theta (N,) rad and, for loads that vary
    over it, times (N,) s.  Raises AssemblyError
    where the linkage does not reach them, and for friction that grows with reactions: they hold the motion's square.
    """
    if laws := [joint.load_law for joint in assembly.mechanism.load_rubbed]:
        raise AssemblyError(
            f"{assembly.mechanism.name}: {' and '.join(laws)} {'is' if len(laws) == 1 else 'are'} given, and the"
            " analytic model knows no released motion with friction that grows with reactions",
            remedy=f"leave {'it' if len(laws) == 1 else 'them'} out, or give the drive a speed",
        )
    omega, alpha = np.array([0.0, 0.0, 1.0, -1.0]), np.array([0.0, 1.0, 0.0, 0.0])
    states = np.tile(theta, omega.size), np.repeat(omega, theta.size), np.repeat(alpha, theta.size)
    motion = kinematics(assembly, *states, time=None if time is None else np.tile(time, omega.size))
    g, pushed, ahead, astern = kinetostatics(motion).drive_torque.reshape(omega.size, -1)
    viscous, coulomb, drag = np.zeros((3, theta.size))
    stribeck: list[np.ndarray] = []
    for joint in assembly.mechanism.joints:
        if not (joint.rubs or joint.damped):
            continue
        rate = np.abs(motion.slip(joint).reshape(omega.size, -1)[2])  # by the crank's
        viscous = viscous + joint.damping * rate**2
        drag = drag + joint.drag * rate**3
        coulomb = coulomb + joint.coulomb * rate
        if joint.stribeck_speed is not None:
            stribeck += [(joint.stiction - joint.coulomb) * rate, rate / joint.stribeck_speed]
    for load in (load for load in assembly.mechanism.loads if load.opposes):
        moving, spin = motion.velocity(load.body, load.point), motion.angular_velocity(load.body)
        force, torque = load_now(motion, load)
        power = np.real(moving * np.conj(force)) + torque * spin
        coulomb = coulomb - power.reshape(omega.size, -1)[2]
    for spring in assembly.mechanism.springs:
        if spring.damping:
            near, far = spring.ends
            apart = motion.position(*far) - motion.position(*near)
            rate = motion.velocity(*far) - motion.velocity(*near)
            length = (np.conj(apart) * rate).real / np.abs(apart)
            viscous = viscous + spring.damping * length.reshape(omega.size, -1)[2] ** 2
    return np.array([pushed - g, (ahead + astern) / 2 - g, viscous, coulomb, g, drag, *stribeck])


def stopping(assembly: Assembly, theta: np.ndarray, omega: np.ndarray) -> np.ndarray:
    """Torque (N,) N.m that the stops of joints need of a crank at angles theta (N,) rad and rates omega (N,) rad/s."""
    limited = [joint for joint in assembly.mechanism.joints if joint.stops]
    if not limited:
        return np.zeros(theta.size)
    motion = kinematics(assembly, theta, np.ones(theta.size))
    ways = [(joint, motion.slip(joint)) for joint in limited]  # by the crank's
    return -sum((joint.stop(motion.relative(joint), way * omega) * way for joint, way in ways), np.zeros(theta.size))


def resistance(coefficients: np.ndarray, omega: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Torque (N.m) that dampers and drag need of a crank at rates omega (N,) rad/s, and the size of dry friction; of
    :func:`coefficients` (6 + 2 n, N).
    """
    _, _, viscous, coulomb, _, drag, *stribeck = coefficients
    falling = (a * np.exp(-((r * omega) ** 2)) for a, r in zip(stribeck[::2], stribeck[1::2], strict=True))
    return (viscous + drag * np.abs(omega)) * omega, sum(falling, coulomb)


def swing(
    freedoms: Sequence[Freedom], start: np.ndarray, time: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angles (P, N) rad, rates (P, N) rad/s and accelerations (P, N) of P linkages released at ``start`` (P, 2), at
    times (N,) s from 0 (:func:`swings`).
    """
    theta, omega, alpha = np.stack(swings(freedoms, start, [time] * len(freedoms)), axis=1)
    return theta, omega, alpha


def swings(
    freedoms: Sequence[Freedom],
    start: np.ndarray,
    times: Sequence[np.ndarray],
    pushes: Sequence[np.ndarray] | None = None,
) -> list[np.ndarray]:
    """Angle (rad), rate (rad/s) and acceleration (3, N) of each linkage, released at ``start`` (P, 2), at its own times
    (N,) s from 0; ``pushes`` (N,) N.m are what a motor gives its crank at them, in between along straight lines.

    Steps keep an error of about 1e-11 rad (:mod:`analytic.beyond_paper.swing_loop`), but are not shorter than 1 ms and
    one degree; a step in which the crank comes to rest ends there, where friction turns with it or holds it.  A motion
    that diverges is NaN from there on.
    """
    from analytic.beyond_paper.swing_loop import integrate  # compiled at its first call

    each = {id(freedom): freedom for freedom in freedoms}
    place = {key: k for k, key in enumerate(each)}
    rows = max(len(freedom.table) for freedom in each.values())
    tables = np.stack([np.pad(f.splines, ((0, 0), (0, rows - len(f.table)))) for f in each.values()])
    start = np.ascontiguousarray(start, float)
    ends = np.cumsum([0, *(time.size for time in times)])
    out = np.empty((3, ends[-1]))
    shortest = np.minimum(1e-3, math.radians(1.0) / np.maximum(1.0, np.abs(start[:, 1])))
    which = np.array([place[id(freedom)] for freedom in freedoms])
    push = np.zeros(0) if pushes is None else np.concatenate(pushes).astype(float)
    integrate(tables, which, start, np.concatenate(times).astype(float), ends, shortest, push, out)
    return np.split(out, ends[1:-1], axis=1)

"""The tests' own referee for linkages of any drives and freedoms: maximal coordinates with multipliers, from the
mechanism's data alone.

Each body has x, y (of its centre of mass, m) and phi (rad); each joint has two rows, each driven joint one more, which
asks its position to be what it is told.  The rows' derivative J gives velocities and accelerations; the multipliers are
what M q'' - J^T l = forces has beside: reactions of joints and what their motors give.  Rows may say the same thing
twice (a parallelogram with a third bar): least squares then, and the multipliers that rows share are not determined.
Nothing here comes from the analytic model.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from analytic.mechanism import GROUND, MASS_CENTRE, Joint, Mechanism

Motor = Callable[[float, int], float]  # a joint's position, or a derivative of it, by time (s) and order
SAME = 1e-9  # of the largest singular value of the rows: one that is smaller says nothing new


@dataclass(frozen=True)
class Posed:
    """One instant: q, its rates and accelerations (3 bodies,), forces of joints' first bodies on their second ones (N,
    complex), moments of slides (N.m), what motors give (N.m, N), and the joints whose reaction is not determined.
    """

    q: np.ndarray
    rates: np.ndarray
    accelerations: np.ndarray
    forces: Mapping[str, complex]
    moments: Mapping[str, float]
    motors: Mapping[str, float]
    undetermined: frozenset[str]


class Maximal:
    """A mechanism; bodies without an assembly angle start at 0.  ``driven`` joints have a row of their own; pins may be
    off their bearings' centres by ``gaps`` (m), first pin less second.
    """

    gaps: Mapping[str, complex] = {}

    def __init__(self, mechanism: Mechanism, driven: tuple[str, ...]) -> None:
        self.m, self.driven = mechanism, driven
        self.index = {b.name: 3 * k for k, b in enumerate(mechanism.bodies)}
        self.mass = np.array([x for b in mechanism.bodies for x in (b.mass, b.mass, b.moment_of_inertia)])
        self.rows = [(joint, kind) for joint in mechanism.joints for kind in (0, 1)]
        self.rows += [(mechanism.joint(name), 2) for name in driven]
        self._locals: dict[tuple[str, str], complex] = {}
        names = [*self.index, GROUND]  # the ground is the last of all poses
        joints = [joint for joint, _ in self.rows]
        slides = np.array([joint.prismatic for joint in joints], bool)
        kinds = np.array([kind for _, kind in self.rows])
        self.ends = np.array([[names.index(j.bodies[side]) for j in joints] for side in (0, 1)])
        self.arms = np.array([[self._local(j.bodies[side], j.name) for j in joints] for side in (0, 1)])
        self.turns = np.where(slides, kinds == 1, kinds == 2)  # rows of an angle between bodies; the others of a place
        self.rides = slides & ~self.turns  # along or across an axis that turns with the first body
        axes = np.array([j.direction if j.prismatic else 1.0 for j in joints])
        self.along = np.where(slides, np.where(kinds == 0, 1j, 1.0), np.where(kinds == 1, 1j, 1.0)) * axes
        self.angles = np.array([j.angle if j.prismatic and kind == 1 else 0.0 for j, kind in self.rows])

    def home(self, positions: Mapping[str, float]) -> np.ndarray:
        """The closed posture nearest to the assembly angles with the driven joints there.  Raises ValueError."""
        q = np.zeros(3 * len(self.index))
        for name, k in self.index.items():
            q[k + 2] = self.m.assembly.get(name, 0.0)
        places = [k + axis for k in self.index.values() for axis in (0, 1)]
        closing = len(self.rows) - len(self.driven)
        r, j = self.residual(q, positions)[:closing], self.jacobian(q)[:closing]
        q[places] -= np.linalg.lstsq(j[:, places], r, rcond=None)[0]
        return self.closed(q, positions)

    def point(self, q: np.ndarray, body: str, point: str) -> complex:
        """A body's point (m), or the ground's."""
        return self._local(body, point) if body == GROUND else self._centre(q, body) + self.arm(q, body, point)

    def arm(self, q: np.ndarray, body: str, point: str) -> complex:
        """From a body's centre of mass to its point (m)."""
        return 0j if body == GROUND else complex(self._local(body, point) * np.exp(1j * q[self.index[body] + 2]))

    def angle(self, q: np.ndarray, body: str) -> float:
        """A body's angle (rad)."""
        return 0.0 if body == GROUND else float(q[self.index[body] + 2])

    def _local(self, body: str, point: str) -> complex:
        """A point in its body's frame, from the centre of mass (m); of the ground as it is."""
        if (body, point) not in self._locals:
            own = self.m.body(body)
            centre = 0.0 if body == GROUND else own.point(MASS_CENTRE)
            self._locals[body, point] = complex(own.point(point) - centre)
        return self._locals[body, point]

    def _centre(self, q: np.ndarray, body: str) -> complex:
        k = self.index[body]
        return complex(q[k], q[k + 1])

    def _turned(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Each row's arms (2, rows), its second point less its first, and its direction (m, complex)."""
        poses = np.append(q, (0.0, 0.0, 0.0)).reshape(-1, 3)
        phasors = np.exp(1j * poses[:, 2])[self.ends]
        arms = self.arms * phasors
        (near, far) = (poses[:, 0] + 1j * poses[:, 1])[self.ends] + arms
        apart = far - near + [self.gaps.get(joint.name, 0j) for joint, _ in self.rows]
        return arms, apart, self.along * np.where(self.rides, phasors[0], 1.0)

    def residual(self, q: np.ndarray, positions: Mapping[str, float]) -> np.ndarray:
        """What the rows miss (rows,)."""
        _, apart, along = self._turned(q)
        first, second = np.append(q[2::3], 0.0)[self.ends]
        out = np.where(self.turns, second - first - self.angles, (np.conj(along) * apart).real)
        out[len(out) - len(self.driven) :] -= [positions[name] for name in self.driven]
        return out

    def jacobian(self, q: np.ndarray) -> np.ndarray:
        """Their derivative (rows, 3 bodies)."""
        arms, apart, along = self._turned(q)
        out, every = np.zeros((len(self.rows), q.size + 3)), np.arange(len(self.rows))
        for ends, arm, sign in zip(3 * self.ends, arms, (-1.0, 1.0), strict=True):
            places = np.where(self.turns, 0.0, sign * along)
            out[every, ends] += places.real
            out[every, ends + 1] += places.imag
            out[every, ends + 2] += np.where(self.turns, sign, (np.conj(places) * 1j * arm).real)
        out[every, 3 * self.ends[0] + 2] += np.where(self.rides, (np.conj(1j * along) * apart).real, 0.0)
        return out[:, : q.size]

    def _apart(self, q: np.ndarray, joint: Joint) -> tuple[complex, complex]:
        """A slide's second point less its first, and its axis (m, complex)."""
        first, second = joint.bodies
        apart = self.point(q, second, joint.name) - self.point(q, first, joint.name)
        return apart, complex(joint.direction * np.exp(1j * self.angle(q, first)))

    def closed(self, q: np.ndarray, positions: Mapping[str, float]) -> np.ndarray:
        """The posture near q that the rows ask for.  Raises ValueError."""
        for _ in range(40):
            step = np.linalg.lstsq(self.jacobian(q), self.residual(q, positions), rcond=SAME)[0]
            q = q - step
            if np.abs(step).max() < 1e-13 * max(1.0, np.abs(q).max()):
                break
        if np.abs(self.residual(q, positions)).max() > 1e-9:
            raise ValueError("not closed")
        return q

    def positions(self, q: np.ndarray) -> dict[str, float]:
        """Where the driven joints are (rad, m)."""
        told = self.residual(q, dict.fromkeys(self.driven, 0.0))[len(self.rows) - len(self.driven) :]
        return dict(zip(self.driven, told.tolist(), strict=True))

    def bent(self, q: np.ndarray, rates: np.ndarray) -> np.ndarray:
        """d/dt(J) q' (rows,): what the rows' second derivatives are while nothing accelerates."""
        arms, apart, along = self._turned(q)
        moves = np.append(rates, (0.0, 0.0, 0.0)).reshape(-1, 3)
        spins = moves[:, 2][self.ends]
        near, far = (moves[:, 0] + 1j * moves[:, 1])[self.ends] + 1j * spins * arms
        bend = spins[0] ** 2 * arms[0] - spins[1] ** 2 * arms[1]
        # seen from a first body that turns: its spin takes off what turns with it, and Coriolis'
        bend = bend - np.where(self.rides, 2j * spins[0] * (far - near) + spins[0] ** 2 * apart, 0.0)
        return np.where(self.turns, 0.0, (np.conj(along) * bend).real)

    def forces(self, q: np.ndarray, rates: np.ndarray) -> np.ndarray:
        """Weights, loads, springs between points, and the laws of joints but for dry friction (3 bodies,)."""
        out = np.zeros(q.size)

        def push(body: str, point: str, force: complex) -> None:
            if body != GROUND:
                k, arm = self.index[body], self.arm(q, body, point)
                out[k : k + 3] += force.real, force.imag, (np.conj(arm) * force).imag

        def turn(body: str, torque: float) -> None:
            if body != GROUND:
                out[self.index[body] + 2] += torque

        for body in self.m.bodies:
            push(body.name, MASS_CENTRE, body.mass * complex(*self.m.gravity))
        for load in self.m.loads:
            push(load.body, load.point, complex(*load.force))
            turn(load.body, load.torque)
        for spring in self.m.springs:
            near, far = spring.ends
            apart = self.point(q, *far) - self.point(q, *near)
            rate = self.velocity(q, rates, *far) - self.velocity(q, rates, *near)
            along = apart / abs(apart)
            pull = (
                spring.stiffness * (abs(apart) - spring.length) + spring.damping * (np.conj(along) * rate).real
            ) * along
            push(*near, pull)
            push(*far, -pull)
        for joint in self.m.joints:
            first, second = joint.bodies
            if joint.prismatic:
                apart, axis = self._apart(q, joint)
                slip = self.velocity(q, rates, second, joint.name) - self.velocity(q, rates, first, joint.name)
                slip -= 1j * self.spin(rates, first) * apart
                law = joint.spring((np.conj(axis) * apart).real) + joint.damper((np.conj(axis) * slip).real)
                push(second, joint.name, law * axis)
                push(first, joint.name, -law * axis)
                turn(first, -(np.conj(apart) * law * axis).imag)
            else:
                law = joint.spring(self.angle(q, second) - self.angle(q, first))
                law += joint.damper(self.spin(rates, second) - self.spin(rates, first))
                turn(second, law)
                turn(first, -law)
        return out

    def spin(self, rates: np.ndarray, body: str) -> float:
        """A body's angular velocity (rad/s)."""
        return 0.0 if body == GROUND else float(rates[self.index[body] + 2])

    def velocity(self, q: np.ndarray, rates: np.ndarray, body: str, point: str) -> complex:
        """Velocity (m/s) of a body's point."""
        if body == GROUND:
            return 0j
        k = self.index[body]
        return complex(rates[k], rates[k + 1]) + 1j * rates[k + 2] * self.arm(q, body, point)

    def driven_at(self, q: np.ndarray, motors: Mapping[str, tuple[float, float, float]]) -> Posed:
        """The instant near q at which each driven joint, which with the others leave no freedom, has a position, rate
        and acceleration.
        """
        q = self.closed(q, {name: state[0] for name, state in motors.items()})
        j, own = self.jacobian(q), len(self.rows) - len(self.driven)
        asked = np.zeros((2, len(self.rows)))
        for k, name in enumerate(self.driven):
            asked[:, own + k] = motors[name][1:]
        rates = np.linalg.lstsq(j, asked[0], rcond=SAME)[0]
        accelerations = np.linalg.lstsq(j, asked[1] - self.bent(q, rates), rcond=SAME)[0]
        pushed = self.mass * accelerations - self.forces(q, rates)
        _, size, own = np.linalg.svd(j.T)
        idle = own[np.count_nonzero(size > SAME * size[0]) :]
        return self._posed(q, rates, accelerations, np.linalg.lstsq(j.T, pushed, rcond=SAME)[0], idle)

    def balanced(self, q: np.ndarray, rates: np.ndarray, asked: np.ndarray | None = None) -> Posed:
        """Accelerations and multipliers at a state: M q'' = forces + J^T l, J q'' = asked - J' q'."""
        j = self.jacobian(q)
        right = (np.zeros(len(self.rows)) if asked is None else asked) - self.bent(q, rates)
        applied = self.forces(q, rates)
        compliance = j / self.mass @ j.T
        scale = np.sqrt(np.diag(compliance))
        shared = np.linalg.svd(compliance / scale / scale[:, None])
        needed = (right - j / self.mass @ applied) / scale
        multipliers = np.linalg.lstsq(compliance / scale / scale[:, None], needed, rcond=SAME)[0] / scale
        accelerations = (applied + j.T @ multipliers) / self.mass
        return self._posed(q, rates, accelerations, multipliers, shared[2][shared[1] < SAME * shared[1][0]] / scale)

    def _posed(
        self, q: np.ndarray, rates: np.ndarray, accelerations: np.ndarray, multipliers: np.ndarray, idle: np.ndarray
    ) -> Posed:
        """An instant; ``idle`` (M, rows) are multipliers that do nothing."""
        loose = frozenset(self.rows[r][0].name for r in np.flatnonzero(np.abs(idle).max(axis=0, initial=0.0) > 1e-6))
        return Posed(q, rates, accelerations, *self._told(q, rates, multipliers), loose)

    def _told(
        self, q: np.ndarray, rates: np.ndarray, multipliers: np.ndarray
    ) -> tuple[dict[str, complex], dict[str, float], dict[str, float]]:
        forces: dict[str, complex] = {}
        moments: dict[str, float] = {}
        motors: dict[str, float] = {}
        along = self._turned(q)[2]
        for row, (joint, kind) in enumerate(self.rows):
            first, second = joint.bodies
            if kind == 2:
                motors[joint.name] = float(multipliers[row])
                if joint.prismatic:  # a slide's reaction is all that its first body does to the second
                    forces[joint.name] += multipliers[row] * complex(along[row])
            elif not joint.prismatic:
                forces[joint.name] = forces.get(joint.name, 0j) + multipliers[row] * complex(along[row])
            elif kind == 0:
                apart, axis = self._apart(q, joint)
                forces[joint.name] = multipliers[row] * 1j * axis
                slip = self.velocity(q, rates, second, joint.name) - self.velocity(q, rates, first, joint.name)
                slip -= 1j * self.spin(rates, first) * apart
                law = joint.spring((np.conj(axis) * apart).real) + joint.damper((np.conj(axis) * slip).real)
                forces[joint.name] += law * axis
            else:
                moments[joint.name] = float(multipliers[row])
        return forces, moments, motors

    def released(
        self,
        start: np.ndarray,
        rates: np.ndarray,
        times: np.ndarray,
        motors: Mapping[str, Motor],
    ) -> list[Posed]:
        """States at times (N,) s from 0 of a motion whose driven joints follow ``motors``, all else free."""
        from scipy.integrate import solve_ivp

        n, own = start.size, len(self.rows) - len(self.driven)

        def asked(t: float) -> np.ndarray:
            return np.array([0.0] * own + [motors[name](t, 2) for name in self.driven])

        def flow(t: float, state: np.ndarray) -> np.ndarray:
            return np.concatenate([state[n:], self.balanced(state[:n], state[n:], asked(t)).accelerations])

        found = solve_ivp(
            flow, (0.0, float(times[-1])), np.concatenate([start, rates]), "DOP853", times, rtol=1e-11, atol=1e-12
        )
        return [self.balanced(y[:n], y[n:], asked(t)) for t, y in zip(times, found.y.T, strict=True)]

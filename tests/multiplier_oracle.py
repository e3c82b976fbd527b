"""The tests' own referee: a linkage in maximal coordinates with multipliers, from the mechanism's data alone.

Each body has x, y (of its centre of mass) and phi; each joint has two rows of constraints, the drive has one.  Lengths
are in units of the linkage's span, time in radians of crank, so that the matrix of constraints has entries about 1 at
every scale.  With one drive for one freedom it is square, and the system [M J^T; J 0] comes apart: J gives the
accelerations, J^T the multipliers.  They are the reactions and the drive torque.  Nothing here comes from the analytic
model's kinematics.

A posture is judged only where the condition of J (its rows normalised) is below ``WORST_CONDITION``: at 1000, double
precision leaves some 1e-10 of a force that depends on accelerations.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from analytic.mechanism import GROUND, MASS_CENTRE, Mechanism

WORST_CONDITION = 1000.0
STEP = np.radians(2.0)  # of the walk along the crank's range
JUMP = 0.05  # rad or span; a larger correction of a step is not trusted to be on the same branch
TINY = 1e-30  # the complex step
RUNAWAY = 1e100  # N; friction that has grown so far as it is repeated does not settle


class LeftOut(ValueError):
    """The linkage or posture is too near a singular one to be judged; the message says where."""


@dataclass(frozen=True)
class Solved:
    """What the oracle finds at N crank angles: SI units; forces of a joint's first body on its second."""

    theta: np.ndarray
    places: Mapping[str, np.ndarray]  # marker (N,), complex, m
    angles: Mapping[str, np.ndarray]  # rad, continued from the assembly angles
    spins: Mapping[str, np.ndarray]  # rad/s
    forces: Mapping[str, np.ndarray]  # N, complex
    moments: Mapping[str, np.ndarray]  # N.m on the second body at its point, of prismatic joints
    torque: np.ndarray  # N.m
    slips: Mapping[str, np.ndarray]  # rate of each joint with friction over the crank's (rad; prismatic: spans)
    largest: float  # N, of all reactions, loads, weights and inertia forces


class Oracle:
    """A mechanism assembled at its assembly angles, which every body has, whole turns included.

    Raises LeftOut where that posture is singular or has none near it.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        m = self.mechanism = mechanism
        self.names = [GROUND, *(b.name for b in m.bodies)]
        points = [m.body(b).point(p) for b in self.names for p in m.body(b).points]
        self.span = max(b.length for b in m.bodies)
        self.span = max(
            self.span, max(abs(p - q) for p in points[: len(m.ground.points)] for q in points[: len(m.ground.points)])
        )
        self.pins = [j for j in m.joints if not j.prismatic]
        self.slides = [j for j in m.joints if j.prismatic]
        self.pin_bodies, self.pin_arms = self._arms(self.pins)
        self.slide_bodies, self.slide_arms = self._arms(self.slides)
        normal = [1j * j.direction for j in self.slides]
        self.normal = np.array([[n.real, n.imag] for n in normal]).reshape(-1, 2)
        self.held = np.array([j.angle for j in self.slides])
        self.driven = self.names.index(m.driven)
        if 2 * len(m.joints) + 1 != 3 * len(m.bodies):
            raise ValueError(f"{m.name}: {len(m.joints)} joints do not leave {len(m.bodies)} bodies one freedom")
        self.masses = np.array(
            [[0.0, 0.0, 0.0], *([b.mass, b.mass, b.moment_of_inertia / self.span**2] for b in m.bodies)]
        )
        self.start = m.assembly[m.driven]
        self.home = self._assembled()

    def _arm(self, body: str, point: str) -> tuple[float, float]:
        part = self.mechanism.body(body)
        arm = (part.point(point) - (0j if body == GROUND else part.point(MASS_CENTRE))) / self.span
        return arm.real, arm.imag

    def _arms(self, joints: list) -> tuple[np.ndarray, np.ndarray]:
        """Body indices (2, J) of joints and the arms (2, J, 2) of their points from the centres of mass."""
        bodies = np.array([[self.names.index(j.bodies[k]) for j in joints] for k in (0, 1)], int).reshape(2, -1)
        return bodies, np.array([[self._arm(j.bodies[k], j.name) for j in joints] for k in (0, 1)]).reshape(2, -1, 2)

    # ---------------------------------------------------------------- constraints: q is (N, bodies, 3), the ground's
    # zero

    def constraints(
        self, q: np.ndarray, theta: np.ndarray, gaps: np.ndarray | float = 0.0
    ) -> tuple[np.ndarray, np.ndarray]:
        """Residual (N, R) and its derivative (N, R, 3 n) at crank angles; ``gaps`` (N, pins, 2) of the pins, in
        spans.
        """
        n, p, s = len(q), len(self.pins), len(self.slides)
        residual = np.empty((n, 2 * p + 2 * s + 1), q.dtype)
        matrix = np.zeros((n, 2 * p + 2 * s + 1, len(self.names), 3), q.dtype)
        ends = [_point(q[:, b], a) for b, a in zip(self.pin_bodies, self.pin_arms, strict=True)]
        residual[:, : 2 * p] = (ends[0][0] - ends[1][0] - gaps).reshape(n, -1)
        rows = np.arange(p)
        for sign, b, (_, turned) in zip((1, -1), self.pin_bodies, ends, strict=True):
            for axis in (0, 1):
                matrix[:, 2 * rows + axis, b, axis] += sign
                matrix[:, 2 * rows + axis, b, 2] += sign * turned[..., axis]
        (z1, t1), (z2, t2) = (_point(q[:, b], a) for b, a in zip(self.slide_bodies, self.slide_arms, strict=True))
        normal, across = _turned(q[:, self.slide_bodies[0], 2], self.normal)
        rows, (first, second) = 2 * p + 2 * np.arange(s), self.slide_bodies
        residual[:, rows] = np.sum(normal * (z2 - z1), axis=-1)
        residual[:, rows + 1] = q[:, second, 2] - q[:, first, 2] - self.held
        for axis in (0, 1):
            matrix[:, rows, first, axis] -= normal[..., axis]
            matrix[:, rows, second, axis] += normal[..., axis]
        matrix[:, rows, first, 2] += np.sum(across * (z2 - z1) - normal * t1, axis=-1)
        matrix[:, rows, second, 2] += np.sum(normal * t2, axis=-1)
        matrix[:, rows + 1, first, 2] -= 1
        matrix[:, rows + 1, second, 2] += 1
        residual[:, -1] = q[:, self.driven, 2] - theta
        matrix[:, -1, self.driven, 2] = 1
        return residual, matrix[:, :, 1:].reshape(n, matrix.shape[1], -1)

    def closed(self, q: np.ndarray, theta: np.ndarray, gaps: np.ndarray | float = 0.0, passes: int = 8) -> np.ndarray:
        """Poses (N, bodies, 3) near q that satisfy the constraints.  Raises LeftOut where Newton's method does not find
        them.
        """
        q = q.astype(np.result_type(q, theta, gaps), copy=True)
        try:
            for _ in range(passes):
                residual, matrix = self.constraints(q, theta, gaps)
                step = np.linalg.solve(matrix, residual[..., None])[..., 0]
                q[:, 1:] -= step.reshape(len(q), -1, 3)
                if np.abs(step).max() < 1e-9:  # the next would be its square
                    return q
        except np.linalg.LinAlgError:
            raise LeftOut("singular") from None
        raise LeftOut("not closed")

    def _assembled(self) -> np.ndarray:
        """The assembly posture: with the angles given, positions follow from linear equations; then Newton's method."""
        q = np.zeros((1, len(self.names), 3))
        q[0, 1:, 2] = [self.mechanism.assembly[b] for b in self.names[1:]]
        theta = np.array([self.start])
        residual, matrix = self.constraints(q, theta)
        places = np.flatnonzero(np.arange(matrix.shape[2]) % 3 != 2)
        q[0, 1:, :2] -= np.linalg.lstsq(matrix[0][:, places], residual[0], rcond=None)[0].reshape(-1, 2)
        home = self.closed(q, theta, passes=20)
        if np.abs(home - q)[..., 2].max() > 0.5:
            raise LeftOut("assembled elsewhere")
        condition, self.branch = self._judged(home, theta)
        if not condition < WORST_CONDITION:
            raise LeftOut("assembled near a singular posture")
        return home

    def condition(self, q: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """Condition (N,) of the constraints' derivative, its rows normalised."""
        return _condition(self.constraints(q, theta)[1])

    def _judged(self, q: np.ndarray, theta: np.ndarray) -> tuple[float, float]:
        """A posture's condition, and the sign of its determinant, which changes only at a change point."""
        matrix = self.constraints(q, theta)[1]
        return float(_condition(matrix)[0]), float(np.linalg.slogdet(matrix)[0][0])

    def walk(self, far: float) -> tuple[np.ndarray, np.ndarray]:
        """Crank angles (M,) and poses from up to ``far`` rad below the assembly angle to above it, as long as they are
        well conditioned.
        """
        sides = []
        for sign in (-1, 1):
            thetas, poses = [self.start], [self.home]
            for k in range(1, int(far / STEP) + 1):
                theta = np.array([self.start + sign * k * STEP])
                rate = self.rates(poses[-1], np.array(thetas[-1:]))
                guess = poses[-1] + sign * STEP * rate
                try:
                    here = self.closed(guess, theta)
                except LeftOut:
                    break
                condition, branch = self._judged(here, theta)
                if np.abs(here - guess).max() > JUMP or not condition < WORST_CONDITION or branch != self.branch:
                    break
                thetas.append(float(theta[0]))
                poses.append(here)
            sides.append((thetas, poses))
        (low, below), (high, above) = sides
        return np.array(low[:0:-1] + high), np.concatenate(below[:0:-1] + above)

    def rates(self, q: np.ndarray, theta: np.ndarray, gaps: np.ndarray | float = 0.0) -> np.ndarray:
        """Derivative (N, bodies, 3) of the poses by the crank angle."""
        matrix = self.constraints(q, theta, gaps)[1]
        right = np.zeros(matrix.shape[:2], matrix.dtype)
        right[:, -1] = 1.0
        return self._spread(np.linalg.solve(matrix, right[..., None])[..., 0])

    def bends(self, q: np.ndarray, rate: np.ndarray, theta: np.ndarray, gaps: np.ndarray | float = 0.0) -> np.ndarray:
        """Second derivative (N, bodies, 3) of the poses by the crank angle."""
        matrix = self.constraints(q, theta, gaps)[1]
        turned = self.constraints(q + 1j * TINY * rate, theta, gaps)[1].imag / TINY
        right = -np.einsum("nri,ni->nr", turned, rate[:, 1:].reshape(len(q), -1))
        return self._spread(np.linalg.solve(matrix, right[..., None])[..., 0])

    def _spread(self, x: np.ndarray) -> np.ndarray:
        out = np.zeros((len(x), len(self.names), 3), x.dtype)
        out[:, 1:] = x.reshape(len(x), -1, 3)
        return out

    # ---------------------------------------------------------------- forces

    def solve(
        self, theta: np.ndarray, q: np.ndarray, inertia: bool, alpha: float = 0.0, gaps: np.ndarray | float = 0.0
    ) -> Solved:
        """Reactions at poses that are closed; ``alpha`` is the crank's acceleration over its speed squared, gaps do not
        move.
        """
        m, n = self.mechanism, len(q)
        omega = m.speed or 1.0
        rate = self.rates(q, theta, gaps)
        second = self.bends(q, rate, theta, gaps) + alpha * rate
        applied, slips = self._applied(q, rate, omega, inertia)
        pushed = applied - (self.masses * second * self.span * omega**2 if inertia else 0.0)
        matrix = self.constraints(q, theta, gaps)[1]

        def balanced(pushed: np.ndarray) -> np.ndarray:  # N; moments over the span
            on = np.linalg.solve(matrix.transpose(0, 2, 1), -pushed[:, 1:].reshape(n, -1)[..., None])
            return on[..., 0]

        on_bodies, rubbed = self._rubbed(q, pushed, balanced, slips, omega)
        forces, moments = {}, {}
        for k, j in enumerate(self.pins):  # the rows are first minus second
            forces[j.name] = -(on_bodies[:, 2 * k] + 1j * on_bodies[:, 2 * k + 1])
        normal, _ = _turned(q[:, self.slide_bodies[0], 2], self.normal)
        for k, j in enumerate(self.slides):
            across, hold = on_bodies[:, 2 * (len(self.pins) + k)], on_bodies[:, 2 * (len(self.pins) + k) + 1]
            along = -1j * (normal[:, k, 0] + 1j * normal[:, k, 1])
            drag, couple = rubbed.get(j.name, (0.0, 0.0))
            forces[j.name] = 1j * along * across + along * (self._law(j, q, rate, omega, inertia)[0] + drag)
            moments[j.name] = (hold + couple) * self.span  # the force across passes through the second's point
        reactions = [np.abs(f).max() for f in forces.values()]
        parts = applied[:, 1:], (self.masses * second * self.span * omega**2 * inertia)[:, 1:]
        largest = max([np.abs(on_bodies).max(), *reactions, *(np.abs(p).max() for p in parts)])
        turns = {b: rate[:, i, 2] * omega for i, b in enumerate(self.names)}
        places = {
            b: self._complex(_point(q[:, i], np.array(self._arm(b, "com")))[0]) for i, b in enumerate(self.names) if i
        }
        angles = {b: q[:, i, 2] for i, b in enumerate(self.names)}
        return Solved(
            theta, places, angles, turns, forces, moments, on_bodies[:, -1] * self.span, slips, float(largest)
        )

    def _rubbed(
        self,
        q: np.ndarray,
        pushed: np.ndarray,
        balanced: Callable[[np.ndarray], np.ndarray],
        slips: Mapping[str, np.ndarray],
        omega: float,
    ) -> tuple[np.ndarray, dict[str, tuple[np.ndarray, np.ndarray]]]:
        """What balances these forces (N, bodies, 3) and the friction that reactions give, by repeating it with the last
        one's; and by slide the force along it and the couple over the span (N,) N that this is.  Raises LeftOut where
        that does not settle.
        """
        last, radii = balanced(pushed), [j.friction_radius or j.friction * (j.pin_radius or 0.0) for j in self.pins]
        blocks = [(k, j) for k, j in enumerate(self.slides) if j.guide is not None and j.friction]
        ways = {name: np.where(np.abs(slip) > 1e-9, np.sign(slip * omega), 0.0) for name, slip in slips.items()}
        found: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        if not (any(radii) or blocks):
            return last, found
        for _ in range(400):
            rubbed = pushed.copy()
            for k, (joint, radius) in enumerate(zip(self.pins, radii, strict=True)):
                if radius:
                    size = radius * np.hypot(last[:, 2 * k], last[:, 2 * k + 1]) / self.span
                    first, second = (self.names.index(b) for b in joint.bodies)
                    rubbed[:, second, 2] -= size * ways[joint.name]
                    rubbed[:, first, 2] += size * ways[joint.name]
            for k, joint in blocks:
                across, hold = last[:, 2 * (len(self.pins) + k)], last[:, 2 * (len(self.pins) + k) + 1]
                found[joint.name] = self._corners(joint, across, hold, ways[joint.name])
                self._push_along(rubbed, q, joint, *found[joint.name])
            if np.abs(rubbed).max() > RUNAWAY:
                break
            now = balanced(rubbed)
            change, last = np.abs(now - last).max(), now
            if change <= 1e-14 * np.abs(now).max():
                return last, found
        raise LeftOut("friction that grows with reactions does not settle")

    def _corners(self, joint, across: np.ndarray, hold: np.ndarray, way: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Friction along a guide and its couple over the span (N,) N on a block whose walls push with a force across
        and a couple over the span (N,): corner by corner, each rubbed where it is.
        """
        length, height = (size / self.span for size in joint.guide)
        push = np.zeros((4, across.size))  # of the corners behind and in front, on the wall below and on that above
        behind, front = across / 2 - hold / length, across / 2 + hold / length
        for end, force in enumerate((behind, front)):
            push[end] = np.maximum(force, 0.0)
            push[2 + end] = np.maximum(-force, 0.0)
        rub = -joint.friction * way * push
        return rub.sum(axis=0), height / 2 * (rub[:2].sum(axis=0) - rub[2:].sum(axis=0))

    def _push_along(self, out: np.ndarray, q: np.ndarray, joint, force: np.ndarray, couple: np.ndarray) -> None:
        """Add a force along a slide at its second body's point, and a couple over the span, to what acts on both
        bodies (N, bodies, 3).
        """
        first, second = (self.names.index(b) for b in joint.bodies)
        along, _ = _turned(q[:, first, 2], np.array([joint.direction.real, joint.direction.imag]))
        for sign, i, name in ((1, second, joint.bodies[1]), (-1, first, joint.bodies[0])):
            arm = _turned(q[:, i, 2], np.array(self._arm(name, joint.name)))[0]
            push = sign * force[:, None] * along
            out[:, i, :2] += push
            out[:, i, 2] += arm[:, 0] * push[:, 1] - arm[:, 1] * push[:, 0] + sign * couple

    def _complex(self, z: np.ndarray) -> np.ndarray:
        return (z[..., 0] + 1j * z[..., 1]) * self.span

    def _position(self, joint, q: np.ndarray) -> np.ndarray:
        """Second body on first (N,): rad, or m along the axis."""
        first, second = (self.names.index(b) for b in joint.bodies)
        if not joint.prismatic:
            return q[:, second, 2] - q[:, first, 2]
        ends = [
            _point(q[:, b], np.array(self._arm(name, joint.name)))[0]
            for b, name in ((first, joint.bodies[0]), (second, joint.bodies[1]))
        ]
        along, _ = _turned(q[:, first, 2], np.array([joint.direction.real, joint.direction.imag]))
        return np.sum(along * (ends[1] - ends[0]), axis=-1) * self.span

    def _law(self, joint, q: np.ndarray, rate: np.ndarray, omega: float, moving: bool) -> tuple[np.ndarray, np.ndarray]:
        """Force or torque of a joint's spring, damper and friction on its second body, and its slip by the
        crank angle.
        """
        slip = self._position(joint, q + 1j * TINY * rate).imag / TINY
        size = self.span if joint.prismatic else 1.0
        rubs = np.where(np.abs(slip) > 1e-9 * size, np.sign(slip * omega), 0.0)
        stretch, speed = self._position(joint, q) - joint.rest_angle, slip * omega if moving else 0.0 * slip
        dry = np.full(slip.shape, joint.friction_torque or joint.friction * (joint.prismatic and joint.guide is None))
        if joint.stribeck_speed is not None:
            dry = dry + (joint.static_torque - dry) * np.exp(-((speed / joint.stribeck_speed) ** 2))
        law = -joint.stiffness * stretch - joint.cubic * stretch**3 - dry * rubs
        return law - joint.damping * speed - joint.drag * speed * np.abs(speed), slip / size

    def _applied(
        self, q: np.ndarray, rate: np.ndarray, omega: float, moving: bool
    ) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Applied forces (N, bodies, 3) on the bodies, moments over the span; and the slips."""
        m = self.mechanism
        out, slips = np.zeros(q.shape), {}
        for body in m.bodies:
            out[:, self.names.index(body.name), :2] += body.mass * np.array(m.gravity)
        for load in m.loads:
            i = self.names.index(load.body)
            arm = _turned(q[:, i, 2], np.array(self._arm(load.body, load.point)))[0]
            out[:, i, :2] += load.force
            out[:, i, 2] += arm[:, 0] * load.force[1] - arm[:, 1] * load.force[0] + load.torque / self.span
        wave = m.drive.periodic_torque if m.drive else None
        if wave is not None:
            driven = self.names.index(m.driven)
            out[:, driven, 2] += wave.amplitude * np.sin(wave.harmonic * q[:, driven, 2] + wave.phase) / self.span
        for joint in m.joints:
            law, slip = self._law(joint, q, rate, omega, moving)
            if joint.friction_torque or joint.friction or joint.static_torque or joint.friction_radius:
                slips[joint.name] = slip
            first, second = (self.names.index(b) for b in joint.bodies)
            if not joint.prismatic:
                out[:, second, 2] += law / self.span
                out[:, first, 2] -= law / self.span
                continue
            self._push_along(out, q, joint, law, np.zeros(law.shape))
        return out, slips

    def kinetic(self, rate: np.ndarray) -> np.ndarray:
        """Kinetic energy (N,) J at the drive's speed, from the poses' derivatives by the crank angle."""
        return np.sum(self.masses * (rate * self.span * (self.mechanism.speed or 1.0)) ** 2, axis=(1, 2)) / 2

    def energy(self, q: np.ndarray) -> np.ndarray:
        """Potential energy (N,) J of weights, dead loads and joint springs, from the poses alone (complex poses
        allowed).
        """
        m = self.mechanism
        out = np.zeros(len(q), q.dtype)
        for body in m.bodies:
            out = out - self.span * body.mass * (q[:, self.names.index(body.name), :2] @ np.array(m.gravity))
        for load in m.loads:
            i = self.names.index(load.body)
            out = out - self.span * (
                _point(q[:, i], np.array(self._arm(load.body, load.point)))[0] @ np.array(load.force)
            )
            out = out - load.torque * q[:, i, 2]
        for joint in m.joints:
            stretch = self._position(joint, q) - joint.rest_angle
            out = out + joint.stiffness * stretch**2 / 2 + joint.cubic * stretch**4 / 4
        wave = m.drive.periodic_torque if m.drive else None
        if wave is not None:
            turn = wave.harmonic * q[:, self.names.index(m.driven), 2] + wave.phase
            out = out + wave.amplitude / wave.harmonic * np.cos(turn)
        return out


def _condition(matrix: np.ndarray) -> np.ndarray:
    with np.errstate(divide="ignore"):
        return np.linalg.cond(matrix / np.linalg.norm(matrix, axis=2, keepdims=True))


def _turned(angle: np.ndarray, vector: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Body vectors (..., 2) at angles (N, ...) in the ground frame, and their derivative by the angle."""
    c, s = np.cos(angle), np.sin(angle)
    x, y = vector[..., 0], vector[..., 1]
    turned = np.empty((*np.broadcast_shapes(c.shape, x.shape), 2), c.dtype)
    turned[..., 0], turned[..., 1] = c * x - s * y, s * x + c * y
    across = np.empty_like(turned)
    across[..., 0], across[..., 1] = -turned[..., 1], turned[..., 0]
    return turned, across


def _point(pose: np.ndarray, arm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (N, ..., 2) at an arm from the centre of mass of poses (N, ..., 3), and their derivative by the angle."""
    arm, across = _turned(pose[..., 2], arm)
    return pose[..., :2] + arm, across

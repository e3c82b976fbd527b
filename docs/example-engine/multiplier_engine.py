"""A complete engine for linkage-crosscheck: rigid linkages with ideal pins by Lagrange multipliers.

Every body has three coordinates, the place of its mass centre and its angle; every pin two equations, and the drive
one.  Positions are solved by Newton's method.  Velocities, accelerations and the forces in the joints follow from
linear equations, J v = b, J a = c and M a + J' l = Q, with the Jacobian J; a multiplier l is the force in its pin.
"""

from __future__ import annotations

import cmath
from dataclasses import dataclass

import numpy as np

from analytic.kinematics.assembly import Assembly
from analytic.mechanism import GROUND, MASS_CENTRE, Mechanism
from sim_models.common.simulate import simulate
from sim_models.engine import Capabilities, Engine, Rates, Request, Scope, SimulationError, Trace
from sim_models.run.path import CrankPath

ITERATIONS, CLOSED = 20, 1e-13  # of Newton's method; how far pins may be apart, of the longest body


class MultiplierEngine(Engine):
    """What the engine does, without doing it: ideal pins, driven and at rest."""

    name = "multipliers"
    package = "numpy"  # what must be installed for it to run
    capabilities = Capabilities(rigid=Scope.of([("ideal", "driven"), ("ideal", "static")], features=()))

    def simulate(self, request: Request) -> Trace:
        """Run one request, in units that suit the linkage, and check what must be true of it whoever runs it."""
        return simulate(self, request, run)


ENGINE = MultiplierEngine()


def run(request: Request) -> Trace:
    """The linkage at every crank angle.  Raises SimulationError."""
    m = request.mechanism
    linkage, assembly = Multipliers(m), Assembly(m)
    speed = (m.speed or 0.0) if request.motion == "driven" else 0.0
    theta = request.schedule.crank_angle  # nothing else is declared
    assert theta is not None
    found = [linkage.at(angle, speed, assembly) for angle in theta]
    signals = {name: np.array([signals[name] for signals, _ in found]) for name in found[0][0]}
    rates = {b: Rates(*(np.array([moved[b][k] for _, moved in found]) for k in range(3))) for b in linkage.column}
    time = request.schedule.time if speed else None
    return Trace("multipliers", "1.0", "ideal", request.motion, theta.copy(), time, signals, rates=rates)


@dataclass
class Multipliers:
    """The equations of a linkage; coordinates are x, y (m) and angle (rad) of every moving body in turn."""

    mechanism: Mechanism

    def __post_init__(self) -> None:
        self.column = {body.name: 3 * k for k, body in enumerate(self.mechanism.bodies)}
        self.size = 3 * len(self.column)
        self.longest = max(body.length for body in self.mechanism.bodies)
        masses = [(b.mass, b.mass, b.moment_of_inertia) for b in self.mechanism.bodies]
        self.mass = np.array(masses).ravel()

    def at(self, theta: float, speed: float, assembly: Assembly) -> tuple[dict[str, float], dict[str, tuple]]:
        """Signals at a crank angle; of every body velocity, acceleration (complex) and angular acceleration."""
        q = self.closed(theta, assembly)
        jacobian, _, _ = self.equations(q, theta, np.zeros(self.size))
        v = np.linalg.solve(jacobian, np.append(np.zeros(self.size - 1), speed))
        _, _, turning = self.equations(q, theta, v)
        a = np.linalg.solve(jacobian, turning)
        force = np.linalg.solve(jacobian.T, self.loads(q) - self.mass * a)
        signals = {"drive_torque": -float(force[-1])}
        for k, joint in enumerate(self.mechanism.joints):
            signals |= {f"reaction_{joint.name}_x": force[2 * k], f"reaction_{joint.name}_y": force[2 * k + 1]}
        moved = {}
        for body in self.mechanism.bodies:
            i = self.column[body.name]
            marker = self.place(q, body.name, "com")
            signals |= {f"{body.name}_x": marker.real, f"{body.name}_y": marker.imag}
            signals |= {f"{body.name}_angle": q[i + 2], f"{body.name}_angular_velocity": v[i + 2]}
            moved[body.name] = (complex(*v[i : i + 2]), complex(*a[i : i + 2]), a[i + 2])
        return signals, moved

    def closed(self, theta: float, assembly: Assembly) -> np.ndarray:
        """Coordinates with all pins closed, near where the linkage was assembled.  Raises SimulationError."""
        start, q = CrankPath(assembly).poses(theta), np.zeros(self.size)
        for body in self.mechanism.bodies:
            pose = start[body.name]
            centre = pose.origin + body.point(MASS_CENTRE) * cmath.exp(1j * pose.angle)
            q[self.column[body.name] :][:3] = centre.real, centre.imag, pose.angle
        for _ in range(ITERATIONS):
            jacobian, apart, _ = self.equations(q, theta, np.zeros(self.size))
            if np.abs(apart).max() <= CLOSED * max(self.longest, 1.0):
                return q
            q = q - np.linalg.solve(jacobian, apart)
        raise SimulationError(f"multipliers: it does not close at {np.degrees(theta):.4g} deg; look at its points")

    def equations(self, q: np.ndarray, theta: float, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Jacobian, what the equations miss, and c of J a = c: first pin minus second, then the drive."""
        jacobian, apart, turning = np.zeros((self.size, self.size)), np.zeros(self.size), np.zeros(self.size)
        for k, joint in enumerate(self.mechanism.joints):
            rows = slice(2 * k, 2 * k + 2)
            for sign, body in zip((1, -1), joint.bodies, strict=True):
                place = self.place(q, body, joint.name)
                apart[rows] += sign * np.array([place.real, place.imag])
                if body != GROUND:
                    i = self.column[body]
                    arm = place - complex(*q[i : i + 2])
                    jacobian[rows, i : i + 3] = sign * np.array([[1, 0, -arm.imag], [0, 1, arm.real]])
                    turning[rows] += sign * v[i + 2] ** 2 * np.array([arm.real, arm.imag])
        crank = self.column[self.mechanism.driven] + 2
        jacobian[-1, crank], apart[-1] = 1.0, q[crank] - theta
        return jacobian, apart, turning

    def place(self, q: np.ndarray, body: str, point: str) -> complex:
        """Where a point of a body, or of the ground, is (m)."""
        if body == GROUND:
            return self.mechanism.ground.point(point)
        i, b = self.column[body], self.mechanism.moving[body]
        return complex(*q[i : i + 2]) + (b.point(point) - b.point(MASS_CENTRE)) * cmath.exp(1j * q[i + 2])

    def loads(self, q: np.ndarray) -> np.ndarray:
        """Weight and loads as forces along the coordinates."""
        out = np.zeros(self.size)
        out[0::3], out[1::3] = (self.mass[0::3] * g for g in self.mechanism.gravity)
        for load in self.mechanism.loads:
            i, force = self.column[load.body], complex(*load.force)
            arm = self.place(q, load.body, load.point) - complex(*q[i : i + 2])
            out[i : i + 3] += force.real, force.imag, (arm.conjugate() * force).imag + load.torque
        return out

"""An independent referee for dynamics: a four-bar with one clearance joint as an ordinary differential equation.

The crank turns at constant speed, so coupler and follower have one freedom each; their equations are Euler's about the
crank pin (which accelerates) and about the ground pivot.  Nothing is shared with the analytic model or the engines but
the mechanism's numbers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from analytic.mechanism import Mechanism


@dataclass(frozen=True)
class ClearanceMotion:
    """Motion at times (N,) s; ``gap`` (m) and ``force`` (N) are complex, of the first body relative to / on the
    second.
    """

    time: np.ndarray
    crank: np.ndarray
    coupler: np.ndarray
    follower: np.ndarray
    gap: np.ndarray
    force: np.ndarray

    @property
    def free(self) -> np.ndarray:
        """Whether the pin touches nothing, (N,) bool."""
        return self.force == 0


def clearance_four_bar_ode(
    mechanism: Mechanism,
    clearance: float,
    stiffness: float,
    damping: float,
    time: np.ndarray,
    theta: float,
    coupler: float,
    follower: float,
    *,
    joint: str = "B",
    max_step: float = 2e-5,
    tolerance: float = 1e-10,
) -> ClearanceMotion:
    """Bodies crank, coupler, follower; radial clearance (m) in ``joint``, the one between coupler and follower.

    Starts centred: at crank angle ``theta`` (rad) with the ideal linkage's angles ``coupler`` and ``follower`` (rad)
    and its velocities.  Contact pushes with max(0, K d + C d') at penetration d > 0, and so do stops of the follower.
    """
    m = mechanism
    speed = m.speed
    assert speed is not None
    base = next(j for j in m.joints if set(j.bodies) == {"ground", "follower"}).name
    knee = next(j for j in m.joints if set(j.bodies) == {"crank", "coupler"}).name
    sign = 1 if m.joint(joint).bodies == ("coupler", "follower") else -1
    drive, pivot = m.ground.point(m.drive_joint.name), m.ground.point(base)
    crank_arm = m.body("crank").point(knee) - m.body("crank").point(m.drive_joint.name)
    links = {name: m.body(name) for name in ("coupler", "follower")}
    hinge = {"coupler": links["coupler"].point(knee), "follower": links["follower"].point(base)}
    reach = {name: links[name].point(joint) - hinge[name] for name in links}
    com = {name: links[name].point("com") - hinge[name] for name in links}
    inertia = {name: links[name].moment_of_inertia + links[name].mass * abs(com[name]) ** 2 for name in links}
    push = {name: [] for name in links}
    for load in m.loads:
        if load.body in links:
            push[load.body].append(
                (links[load.body].point(load.point) - hinge[load.body], complex(*load.force), load.torque)
            )
    gravity = complex(*m.gravity)
    limits = [(stop.end, stop.stiffness, stop.damping) for stop in m.stops]  # of the follower's angle, above

    def contact(t: float, phi: float, psi: float, phi_t: float, psi_t: float) -> tuple[complex, complex]:
        """Gap and force on the follower."""
        arm = crank_arm * np.exp(1j * (theta + speed * t))
        p, q = reach["coupler"] * np.exp(1j * phi), reach["follower"] * np.exp(1j * psi)
        gap = drive + arm + p - pivot - q
        depth = abs(gap) - clearance
        if depth <= 0:
            return gap, 0j
        normal = gap / abs(gap)
        rate = 1j * speed * arm + 1j * phi_t * p - 1j * psi_t * q
        return gap, max(0.0, stiffness * depth + damping * (rate * normal.conjugate()).real) * normal

    def rates(t: float, y: np.ndarray) -> list[float]:
        phi, psi, phi_t, psi_t = y
        _, force = contact(t, phi, psi, phi_t, psi_t)
        knee_acceleration = -(speed**2) * crank_arm * np.exp(1j * (theta + speed * t))
        turn = []
        for name, angle, on_pin, base_acceleration in (
            ("coupler", phi, -force, knee_acceleration),
            ("follower", psi, force, 0j),
        ):
            e = np.exp(1j * angle)
            moment = _cross(reach[name] * e, on_pin) + _cross(
                com[name] * e, links[name].mass * (gravity - base_acceleration)
            )
            moment += sum(_cross(arm * e, f) + torque for arm, f, torque in push[name])
            if name == "follower":
                moment -= sum(max(0.0, k * (psi - end) + c * psi_t) for end, k, c in limits if psi > end)
            turn.append(moment / inertia[name])
        return [phi_t, psi_t, *turn]

    first = (
        crank_arm * np.exp(1j * theta) * 1j * speed
    )  # velocities of the ideal linkage: coupler + knee = follower at the joint
    p, q = 1j * reach["coupler"] * np.exp(1j * coupler), -1j * reach["follower"] * np.exp(1j * follower)
    start_rates = np.linalg.solve([[p.real, q.real], [p.imag, q.imag]], [-first.real, -first.imag])
    found = solve_ivp(
        rates,
        (0.0, float(time[-1])),
        [coupler, follower, *start_rates],
        "DOP853",
        t_eval=time,
        rtol=tolerance,
        atol=tolerance,
        max_step=max_step,
    )
    assert found.success, found.message
    sampled = [contact(t, *y) for t, y in zip(found.t, found.y.T, strict=True)]
    gap, force = (sign * np.array(values) for values in zip(*sampled, strict=True))
    return ClearanceMotion(found.t, theta + speed * found.t, found.y[0], found.y[1], gap, force)


def _cross(a: complex, b: complex) -> float:
    return a.real * b.imag - a.imag * b.real

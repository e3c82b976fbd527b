"""What joint clearance does to a linkage: Eq. 8, and its self-consistent completion.

A pin with radial clearance moves within its bearing along the reaction until the two touch.  Both answers put every
such pin on the rim of its clearance circle and close the linkage again with those gaps:

``first_order``   the paper's: the rim in the direction of the *ideal* linkage's reaction (Eq. 8);
``equilibrium``   the rim in the direction of the reaction of the *displaced* linkage itself.

Both presume contact at all times.  Where a reaction passes near zero it has no direction: such angles are flagged.
"Near" is relative to the joint's largest reaction at the linkage's usual crank angles: whether an angle is flagged does
not depend on the other angles asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.motion import Gap, kinematics
from analytic.kinematics.reach import usual_angles
from analytic.mechanism.one_line import angles, clearances, one_line
from analytic.mechanism.signals import Signal, wrapped
from analytic.paper.kinetostatics import Reactions, kinetostatics

Model = Literal["first_order", "equilibrium"]
MODELS: tuple[Model, ...] = get_args(Model)
NO_DIRECTION = 0.01  # of a joint's peak reaction, below which it is flagged
ROUNDING = 1e-12  # of the linkage's largest reaction: a smaller reaction is the rounding error of zero
STENCIL = 2e-3  # rad of crank angle, to either neighbour of the two that give the gaps' rates
UNSTEADY = 0.02  # rad by which a gap's own motion may turn it
SETTLED = 1e-12  # rad
PASSES = 40
NUDGE = 1e-4  # rad
UNSTABLE = "the equilibrium found is not stable: the pins would leave it"
SHORTER = 6  # times that a step of the search is halved at most


@dataclass(frozen=True)
class Displaced:
    """A linkage displaced by its joints' clearance, at N crank angles.

    ``reactions`` are the model's: the ideal linkage's for ``first_order``, the displaced one's for ``equilibrium``;
    ``configuration`` is the displaced linkage, ``ideal`` the one without clearance.  ``flags`` maps the index of an
    angle at which the model has no answer to the reason; values there mean nothing.
    """

    model: Model
    gaps: Mapping[str, np.ndarray]  # m, complex (N,): first pin centre minus second
    reactions: Reactions
    configuration: Reactions
    ideal: Reactions
    flags: Mapping[int, str]
    faint: Mapping[str, float]  # N, of every revolute joint: a reaction no larger has no direction

    def __repr__(self) -> str:
        motion = self.ideal.motion
        sizes = {name: float(np.abs(gap).max()) for name, gap in self.gaps.items()}
        flagged = f"{len(self.flags)} flagged" if self.flags else ""
        name = motion.structure.mechanism.name
        return one_line(self, name, self.model, angles(motion.theta), clearances(sizes), flagged)

    def signals(self) -> dict[str, np.ndarray]:
        """Contract signals, ``<body>_rotation`` (rad, psi) included; NaN at flagged angles."""
        out = self.configuration.signals() | self.reactions.loads()
        for body in self.ideal.motion.structure.bodies[1:]:
            turned = self.configuration.motion.angle(body) - self.ideal.motion.angle(body)
            out[Signal.of("rotation", body, "angle").name] = turned
        flagged = list(self.flags)
        return {name: _blank(values, flagged) for name, values in out.items()}


def displaced(
    assembly: Assembly,
    theta: np.ndarray,
    omega: np.ndarray | float = 0.0,
    *,
    alpha: np.ndarray | float = 0.0,
    model: Model = "equilibrium",
    inertia: bool = True,
    clearances: Mapping[str, float] | None = None,
) -> Displaced:
    """The linkage with its clearances taken up along the reactions, at crank angles theta (N,) rad.

    ``omega`` and ``alpha`` are the crank's angular velocity (rad/s) and acceleration (rad/s^2) there; the acceleration
    must change slowly.  Without ``inertia`` the equilibrium is static and omega only gives friction its direction.
    ``clearances`` (m) replace the mechanism's own.  Raises AssemblyError where the ideal or the displaced linkage
    cannot be assembled.
    """
    drive = np.array(np.broadcast_arrays(np.atleast_1d(np.asarray(theta, float)), omega, alpha), float)
    sizes = {
        name: c for name, c in (assembly.mechanism.clearances if clearances is None else clearances).items() if c > 0
    }
    turning = bool(inertia and np.any(drive[1:]))
    reach = STENCIL if turning and sizes else 0.0
    path = assembly.path(drive[0].min() - reach, drive[0].max() + reach)

    def solve(drive: np.ndarray, gaps: Mapping[str, Gap] | None = None) -> Reactions:
        theta, omega, alpha = drive
        return kinetostatics(kinematics(assembly, theta, omega, alpha, gaps, path), inertia)

    ideal = solve(drive)
    if not sizes:
        return Displaced(model, {}, ideal, ideal, ideal, {}, {})
    faint = faint_reactions(assembly, drive[1], drive[2], inertia)
    flags = _without_direction(ideal, sizes, faint)
    pins = _Pins(sizes, solve, model)
    toward = pins.directions(ideal)
    rates = None
    phi, learnt = pins.settled(drive, toward)
    if turning:
        rates = _rates(pins, drive, phi, toward, learnt)
        steady, (phi, _) = phi, pins.settled(drive, phi, rates, learnt)
        flags |= {i: why for i, why in _unsteady(sizes, phi - steady).items() if i not in flags}
    gaps = pins.gaps(phi, rates)
    configuration = solve(drive, gaps)
    reactions = ideal if model == "first_order" else configuration
    if model == "equilibrium":
        flags |= {i: why for i, why in _unsettled(configuration, gaps).items() if i not in flags}
        if not inertia:
            flags |= {i: UNSTABLE for i in np.flatnonzero(pins.leave(drive, phi)).tolist() if i not in flags}
    return Displaced(model, {name: g.value for name, g in gaps.items()}, reactions, configuration, ideal, flags, faint)


def faint_reactions(assembly: Assembly, omega: np.ndarray, alpha: np.ndarray, inertia: bool) -> dict[str, float]:
    """By revolute joint the reaction (N) up to which it has no direction, at the fastest of these speeds (rad/s) and
    accelerations (rad/s^2).

    It is a share of the joint's largest at the linkage's usual crank angles.
    """
    fastest, hardest = (float(x[np.argmax(np.abs(x))]) for x in (omega, alpha))
    found = kinetostatics(kinematics(assembly, usual_angles(assembly), fastest, hardest), inertia)
    peaks = {name: float(np.abs(force).max()) for name, force in found.forces.items()}
    largest = max(peaks.values())
    return {name: max(NO_DIRECTION * peaks[name], ROUNDING * largest) for name in assembly.structure.pins}


@dataclass(frozen=True)
class _Pins:
    """The K pins with clearance; ``solve`` gives the reactions for drive (3, N): crank angle, its rate and
    acceleration.
    """

    sizes: Mapping[str, float]  # m
    solve: Callable[[np.ndarray, Mapping[str, Gap] | None], Reactions]
    model: Model

    def directions(self, found: Reactions) -> np.ndarray:
        """Directions (N, K) rad of the reactions."""
        return np.stack([np.angle(found.forces[name]) for name in self.sizes], axis=-1)

    def gaps(self, phi: np.ndarray, rates: np.ndarray | None = None) -> dict[str, Gap]:
        """Gaps in the directions phi (N, K), with ``rates`` (2, N, K) complex: their first and second derivatives in
        time.
        """
        moving = np.zeros((2, *phi.shape), complex) if rates is None else rates
        return {
            name: Gap(c * np.exp(1j * phi[:, k]), *moving[:, :, k]) for k, (name, c) in enumerate(self.sizes.items())
        }

    def settled(
        self, drive: np.ndarray, phi: np.ndarray, rates: np.ndarray | None = None, inverse: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Directions (N, K) that are the displaced linkage's own reactions', from phi near by; for ``first_order`` phi
        itself.

        Broyden's method at all angles at once, until each has settled.  ``inverse`` (N, K, K) is its estimate of the
        inverse of minus the derivative of the miss by phi, which it returns improved; left out, it is the identity: a
        pin that turns does not turn its reaction.
        """
        phi, todo = phi.copy(), np.arange(len(phi))
        inverse = np.tile(np.eye(phi.shape[1]), (len(phi), 1, 1)) if inverse is None else inverse.copy()
        if self.model == "first_order":
            return phi, inverse
        miss = self.miss(drive, phi, rates)
        gain = np.ones(len(phi))  # by which the last step shrank the miss; the next one is expected to do as well
        for _ in range(PASSES):
            step = np.einsum("nij,nj->ni", inverse[todo], miss)
            step *= np.minimum(
                1.0, 0.5 / np.maximum(np.abs(step).max(axis=1, keepdims=True), 1e-300)
            )  # at most half a radian at a time
            phi[todo] += step
            size = np.abs(miss).max(axis=1)
            far = (size >= SETTLED) & (size * gain >= 1e-3 * SETTLED)
            todo, step, before, size = todo[far], step[far], miss[far], size[far]
            if not todo.size:
                break
            phi[todo] -= step
            miss, step = self.onward(drive[:, todo], phi[todo], step, None if rates is None else rates[:, todo])
            phi[todo] += step
            gain = np.minimum(1.0, np.abs(miss).max(axis=1) / size)
            known = inverse[todo]
            seen = np.einsum("nij,nj->ni", known, miss - before)
            along = np.sum(step * seen, axis=1, keepdims=True)
            weight = np.einsum("ni,nij->nj", step, known) / np.where(
                along, along, np.inf
            )  # no update where the miss has not changed
            inverse[todo] -= (step + seen)[..., None] * weight[:, None]
        return phi, inverse

    def onward(
        self, drive: np.ndarray, phi: np.ndarray, step: np.ndarray, rates: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """The miss (N, K) rad at phi + step, and the step; it is halved while the linkage does not close there."""
        for _ in range(SHORTER):
            try:
                return self.miss(drive, phi + step, rates), step
            except AssemblyError:
                step = step / 2
        return self.miss(drive, phi + step, rates), step

    def leave(self, drive: np.ndarray, phi: np.ndarray) -> np.ndarray:
        """Whether (N,) pins that rest in the directions phi (N, K) would leave them: their energy is no minimum.

        The derivative of the energy by a direction is clearance times force times minus the miss.
        """
        sizes = np.array(list(self.sizes.values()))
        forces = self.solve(drive, self.gaps(phi)).forces
        root = np.sqrt(np.maximum(sizes * np.stack([np.abs(forces[name]) for name in self.sizes], axis=-1), 1e-300))
        here, nudges = self.miss(drive, phi, None), NUDGE * np.eye(sizes.size)
        slopes = np.stack([here - self.miss(drive, phi + nudge, None) for nudge in nudges], axis=-1) / NUDGE
        bend = slopes * root[:, :, None] / root[:, None, :]
        return np.asarray(np.linalg.eigvalsh((bend + bend.transpose(0, 2, 1)) / 2)[:, 0] <= 0)

    def miss(self, drive: np.ndarray, phi: np.ndarray, rates: np.ndarray | None) -> np.ndarray:
        """Angles (N, K) rad from the pins' directions to their reactions'."""
        forces = self.solve(drive, self.gaps(phi, rates)).forces
        return np.stack(
            [np.angle(forces[name] * np.exp(-1j * phi[:, k])) for k, name in enumerate(self.sizes)], axis=-1
        )


def _rates(pins: _Pins, drive: np.ndarray, phi: np.ndarray, toward: np.ndarray, learnt: np.ndarray) -> np.ndarray:
    """First and second derivatives in time (2, N, K) of the gaps in directions phi, where the ideal linkage's reactions
    have the directions ``toward``.

    They are differences between equilibria just before and after, in which the gaps do not move, at the same
    acceleration of the crank.  This is the first term of a series in (gap's inertia force / reaction); on the paper's
    case the next is 1e-6 deg.
    """
    angle, speed, acceleration = drive
    pace = (np.abs(speed) + np.sqrt(speed**2 + 2 * np.abs(acceleration) * STENCIL)) / 2
    moment = STENCIL / np.where(pace > 0, pace, 1.0)  # s, in which the crank turns by the stencil
    sides = [
        np.array([angle + speed * t + acceleration * t**2 / 2, speed + acceleration * t, acceleration])
        for t in (-moment, moment)
    ]
    beside = np.hstack(sides)
    start = pins.directions(pins.solve(beside, None)) + np.tile(phi - toward, (2, 1))
    c = np.array(list(pins.sizes.values()))
    before, after = np.split(c * np.exp(1j * pins.settled(beside, start, inverse=np.tile(learnt, (2, 1, 1)))[0]), 2)
    return np.array(
        [(after - before) / (2 * moment[:, None]), (after - 2 * c * np.exp(1j * phi) + before) / moment[:, None] ** 2]
    )


def _without_direction(ideal: Reactions, sizes: Mapping[str, float], faint: Mapping[str, float]) -> dict[int, str]:
    flags: dict[int, str] = {}
    for name in sizes:
        size = np.abs(ideal.forces[name])
        for i in np.flatnonzero(size <= faint[name]):
            why = f"({size[i]:.3g} N, peak {faint[name] / NO_DIRECTION:.3g} N): no direction, contact may be lost"
            flags.setdefault(int(i), f"the reaction at {name} passes near zero {why}")
    return flags


def _unsteady(sizes: Mapping[str, float], turned: np.ndarray) -> dict[int, str]:
    """Angles at which a gap's own motion turns it too far, ``turned`` (N, K) rad, to be a small correction."""
    flags: dict[int, str] = {}
    for name, turn in zip(sizes, np.abs(wrapped(turned)).T, strict=True):
        for i in np.flatnonzero(~(turn < UNSTEADY)):
            flags.setdefault(
                int(i),
                f"the reaction at {name} turns too fast for its pin to follow (off by {np.degrees(turn[i]):.2g} deg)",
            )
    return flags


def _unsettled(found: Reactions, gaps: Mapping[str, Gap]) -> dict[int, str]:
    flags: dict[int, str] = {}
    for name, gap in gaps.items():
        miss = np.abs(np.angle(found.forces[name] / gap.value))
        for i in np.flatnonzero(~(miss < 1e-6)):
            flags.setdefault(int(i), f"no steady contact direction was found at {name}")
    return flags


def _blank(values: np.ndarray, flagged: list[int]) -> np.ndarray:
    values = np.array(values, float)
    values[flagged] = np.nan
    return values

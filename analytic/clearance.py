"""What joint clearance does to a linkage: Eq. 8, and its self-consistent completion.

A pin with radial clearance moves within its bearing along the reaction until the two touch.  Both answers put every such
pin on the rim of its clearance circle and close the linkage again with those gaps:

``first_order``   the paper's: the rim in the direction of the *ideal* linkage's reaction (Eq. 8);
``equilibrium``   the rim in the direction of the reaction of the *displaced* linkage itself.

Both presume contact at all times.  Where a reaction passes near zero it has no direction: such angles are flagged.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from analytic.assembly import Assembly
from analytic.kinematics import Gap, kinematics
from analytic.kinetostatics import Reactions, kinetostatics

Model = Literal["first_order", "equilibrium"]
MODELS: tuple[Model, ...] = get_args(Model)
NO_DIRECTION = 0.01  # of a joint's peak reaction, below which it is flagged
STENCIL = 2e-3  # rad of crank angle, between the neighbours that give the gaps' rates
UNSTEADY = 0.02  # rad by which a gap's own motion may turn it
SETTLED = 1e-12  # rad


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

    def signals(self) -> dict[str, np.ndarray]:
        """Contract signals, ``<body>_rotation`` (rad, psi) included; NaN at flagged angles."""
        out = self.configuration.signals()
        forces = self.reactions.signals()
        out |= {name: values for name, values in forces.items() if name.startswith("reaction_") or name == "drive_torque"}
        for body in self.ideal.motion.structure.bodies[1:]:
            out[f"{body}_rotation"] = self.configuration.motion.angle(body) - self.ideal.motion.angle(body)
        flagged = list(self.flags)
        return {name: _blank(values, flagged) for name, values in out.items()}


def displaced(
    assembly: Assembly,
    theta: np.ndarray,
    omega: float = 0.0,
    *,
    model: Model = "equilibrium",
    inertia: bool = True,
    clearances: Mapping[str, float] | None = None,
) -> Displaced:
    """The linkage with its clearances taken up along the reactions, at crank angles theta (N,) rad.

    ``omega`` is the crank's constant speed (rad/s); without ``inertia`` the equilibrium is static and omega only gives
    friction its direction.  ``clearances`` (m) replace the mechanism's own.  Raises AssemblyError where the ideal or the
    displaced linkage cannot be assembled.
    """
    theta = np.atleast_1d(np.asarray(theta, float))
    sizes = {name: c for name, c in (assembly.mechanism.clearances if clearances is None else clearances).items() if c > 0}
    turning = bool(inertia and omega)
    reach = STENCIL if turning and sizes else 0.0
    path = assembly.path(theta.min() - reach, theta.max() + reach)
    ideal = kinetostatics(kinematics(assembly, theta, omega, path=path), inertia)
    flags = _without_direction(ideal, sizes)
    if not sizes:
        return Displaced(model, {}, ideal, ideal, ideal, flags)

    def solve(at: np.ndarray, gaps: Mapping[str, Gap] | None = None) -> Reactions:
        return kinetostatics(kinematics(assembly, at, omega, gaps=gaps, path=path), inertia)

    gaps = _on_the_rim(solve, theta, sizes, model)
    if turning:
        steady, gaps = gaps, _in_motion(solve, theta, sizes, model, omega)
        flags |= {i: why for i, why in _unsteady(steady, gaps).items() if i not in flags}
    configuration = solve(theta, gaps)
    reactions = ideal if model == "first_order" else configuration
    if model == "equilibrium":
        flags |= {i: why for i, why in _unsettled(configuration, gaps).items() if i not in flags}
    return Displaced(model, {name: np.asarray(g.value) for name, g in gaps.items()}, reactions, configuration, ideal, flags)


Solve = Callable[[np.ndarray, Mapping[str, Gap] | None], Reactions]


def _on_the_rim(solve: Solve, theta: np.ndarray, sizes: Mapping[str, float], model: Model, rates: Mapping[str, Gap] | None = None) -> dict[str, Gap]:
    """Gaps whose directions are the reactions': Newton on all directions at once, differences for the Jacobian."""
    names = list(sizes)

    def gaps_at(phi: np.ndarray) -> dict[str, Gap]:
        rate = {name: (rates[name].rate, rates[name].acceleration) if rates else (0.0, 0.0) for name in names}
        return {name: Gap(sizes[name] * np.exp(1j * p), *rate[name]) for name, p in zip(names, phi, strict=True)}

    def miss(phi: np.ndarray) -> np.ndarray:
        forces = solve(theta, gaps_at(phi)).forces
        return np.array([np.angle(forces[name] * np.exp(-1j * p)) for name, p in zip(names, phi, strict=True)])

    ideal = solve(theta, None).forces
    phi = np.array([np.angle(ideal[name]) for name in names])
    if model == "first_order":
        return gaps_at(phi)
    error = miss(phi)
    for _ in range(40):
        if np.nanmax(np.abs(error)) < SETTLED:
            break
        step = 1e-6
        jacobian = np.empty((theta.size, len(names), len(names)))
        for k in range(len(names)):
            nudged = phi.copy()
            nudged[k] += step
            jacobian[:, :, k] = ((miss(nudged) - error) / step).T
        change = -np.linalg.solve(jacobian + 1e-14 * np.eye(len(names)), error.T[..., None])[..., 0].T
        change *= np.minimum(1.0, 0.5 / np.maximum(np.abs(change).max(axis=0), 1e-300))  # at most half a radian at a time
        phi = phi + change
        error = miss(phi)
    return gaps_at(phi)


def _in_motion(solve: Solve, theta: np.ndarray, sizes: Mapping[str, float], model: Model, omega: float) -> dict[str, Gap]:
    """Gaps that turn with the crank: found at rest beside each angle, then once more with the rates that these show.

    One pass is the first term of a series in (gap's inertia force / reaction); on the paper's case the next is 1e-6 deg.
    """
    beside = theta + STENCIL * np.array([[-1.0], [0.0], [1.0]])
    rates = {}
    for name, gap in _on_the_rim(solve, beside.ravel(), sizes, model).items():
        before, here, after = np.asarray(gap.value).reshape(3, -1)
        slope, bend = (after - before) / (2 * STENCIL), (after - 2 * here + before) / STENCIL**2
        rates[name] = Gap(here, slope * omega, bend * omega**2)
    return _on_the_rim(solve, theta, sizes, model, rates)


def _without_direction(ideal: Reactions, sizes: Mapping[str, float]) -> dict[int, str]:
    flags: dict[int, str] = {}
    for name in sizes:
        size = np.abs(ideal.forces[name])
        peak = size.max()
        for i in np.flatnonzero(size <= NO_DIRECTION * peak):
            flags.setdefault(
                int(i), f"the reaction at {name} passes near zero ({size[i]:.3g} N, peak {peak:.3g} N): no direction, contact may be lost"
            )
    return flags


def _unsteady(at_rest: Mapping[str, Gap], in_motion: Mapping[str, Gap]) -> dict[int, str]:
    """Angles at which a gap's own motion changes it so much that following the reaction is no approximation any more."""
    flags: dict[int, str] = {}
    for name, gap in in_motion.items():
        turned = np.abs(np.angle(np.asarray(gap.value) / np.asarray(at_rest[name].value)))
        for i in np.flatnonzero(~(turned < UNSTEADY)):
            flags.setdefault(int(i), f"the reaction at {name} turns too fast for its pin to follow (off by {np.degrees(turned[i]):.2g} deg)")
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

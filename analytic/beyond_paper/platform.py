"""How accurate a platform is: what clearance, compliance and the resolution of its drives make of its pose.

By virtual work a unit load along an output d has reactions R_i in the joints of the ideal linkage, such that gaps g_i
displace the output by the sum of R_i . g_i (:mod:`analytic.paper.envelope`), and drive loads J_k, such that drives that
are off by e_k displace it by the sum of -J_k e_k.  One statics problem for each output tells both, at all poses at
once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from analytic.kinematics.closure import AssemblyError
from analytic.kinematics.motion import Motion
from analytic.kinematics.output import Output
from analytic.mechanism.one_line import count, one_line
from analytic.paper.clearance import check_determined
from analytic.paper.compliance import Compliance, compliance
from analytic.paper.envelope import condition, displacement, farthest, worst_case
from analytic.paper.kinetostatics import Reactions, reactions_to


@dataclass(frozen=True)
class Platform:
    """The errors of a linkage's outputs at the N samples of a motion, to first order.

    ``clearances`` (pins,) m and ``steps`` (inputs,) rad, m of the drives' encoders are in the structure's order;
    ``gaps`` maps an output to its unit reactions (pins, N) complex, ``drives`` to its derivative by the inputs
    (inputs, N).
    """

    reactions: Reactions
    clearances: np.ndarray
    steps: np.ndarray
    gaps: Mapping[Output, np.ndarray]
    drives: Mapping[Output, np.ndarray]

    def __repr__(self) -> str:
        return one_line(
            self, self.motion.structure.mechanism.name, count(len(self.gaps), "output"),
            count(self.motion.theta.size, "pose"),
        )  # fmt: skip

    @property
    def motion(self) -> Motion:
        """The ideal linkage in motion, or at rest."""
        return self.reactions.motion

    @cached_property
    def directions(self) -> np.ndarray:
        """Where each pin's reaction points (pins, N), complex of length 1; NaN where there is none."""
        forces = _by_pin(self.motion, self.reactions.forces)
        size = np.abs(forces)
        with np.errstate(all="ignore"):
            return np.where(size > 0, forces / size, np.nan)

    def along_reactions(self, d: Output) -> np.ndarray:
        """Displacement (N,) with every pin along its reaction (Eq. 8); NaN where one with clearance has none."""
        return sum(self.by_joint(d).values(), np.zeros(self.motion.theta.shape[-1]))

    def by_joint(self, d: Output) -> dict[str, np.ndarray]:
        """What the clearance of each pin that has some does alone of :meth:`along_reactions` (N,)."""
        gaps = self.clearances[:, None] * self.directions
        loose = {pin: [k] for k, pin in enumerate(self.motion.structure.pins) if self.clearances[k] > 0}
        return {pin: displacement(self.gaps[d][k], gaps[k]) for pin, k in loose.items()}

    def worst_clearance(self, d: Output) -> np.ndarray:
        """Largest displacement (N,) to either side, wherever the pins lie."""
        return worst_case(self.gaps[d], self.clearances)

    def sensitivity(self, d: Output) -> dict[str, np.ndarray]:
        """By pin with clearance: displacement (N,) per radial clearance (m/m, rad/m)."""
        pins = self.motion.structure.pins
        return {pin: np.abs(self.gaps[d][k]) for k, pin in enumerate(pins) if self.clearances[k] > 0}

    def farthest(self, x: Output, y: Output) -> np.ndarray:
        """Farthest displacement (N,) complex of a point, wherever the pins lie; its opposite is as far."""
        return farthest(self.gaps[x], self.gaps[y], self.clearances)

    def resolution(self, d: Output) -> np.ndarray:
        """Largest displacement (N,) to either side by drives that are off by half a step of their encoders."""
        return np.asarray(0.5 * self.steps @ np.abs(self.drives[d]))

    @cached_property
    def holding(self) -> np.ndarray:
        """Condition number (N,) of the loops: how well the drives hold the linkage; infinite at a singular pose of the
        second kind.
        """
        return condition(self.motion)

    def dexterity(self, outputs: Sequence[Output]) -> np.ndarray:
        """Condition number (N,) of the outputs' derivative by the inputs, lengths over the longest body: how evenly the
        platform follows its drives; infinite at a singular pose of the first kind.
        """
        s = self.motion.structure
        size = max(body.length for body in s.mechanism.bodies) or 1.0
        rows = np.array([self.drives[d] / (1.0 if d.axis == "angle" else size) for d in outputs])
        rows = rows * np.array([1.0 if s.unit(i) == "rad" else size for i in s.inputs])[:, None]
        return np.asarray(np.linalg.cond(rows.transpose(2, 0, 1)))

    @cached_property
    def elastic(self) -> Compliance:
        """What the loads do to the links and joints that yield, the drives held.  Raises ComplianceError."""
        return compliance(self.motion)


def platform(
    reactions: Reactions, outputs: Sequence[Output], clearances: Mapping[str, float], steps: Mapping[str, float]
) -> Platform:
    """The errors of these outputs in a motion with these radial clearances (m) and encoder steps (rad, m) by joint.

    Raises AssemblyError for clearance in a joint whose reaction statics does not determine.
    """
    motion = reactions.motion
    s = motion.structure
    blocks = [name for name, size in clearances.items() if size > 0 and name in s.slides]
    if blocks:
        raise AssemblyError(
            f"{s.mechanism.name}: the errors of several drives are not worked out with clearance in prismatic joint"
            f" {blocks[0]!r}",
            remedy="leave that out",
        )
    check_determined(reactions, [name for name, size in clearances.items() if size > 0])
    joints = [s.coordinates[i].joint for i in s.inputs]
    unit_loads = {d: reactions_to(motion, d.body, *d.load) for d in outputs}
    signs = np.array([s.signs[i] for i in s.inputs])
    return Platform(
        reactions,
        np.array([clearances.get(pin, 0.0) for pin in s.pins]),
        np.array([steps.get(joint, 0.0) for joint in joints]),
        {d: _by_pin(motion, forces) for d, (forces, _, _) in unit_loads.items()},
        {d: -signs[:, None] * efforts for d, (_, _, efforts) in unit_loads.items()},
    )


def _by_pin(motion: Motion, forces: Mapping[str, np.ndarray]) -> np.ndarray:
    """Forces (pins, N) complex, of slides alone none."""
    s = motion.structure
    return np.array([forces[pin] for pin in s.pins], complex).reshape(len(s.pins), motion.theta.shape[-1])

"""Displacement of a linkage by clearance and compliance: their superposition (Fig. 7c), and how far it can be
trusted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from analytic.kinematics.assembly import Assembly, CrankTable
from analytic.kinematics.motion import kinematics
from analytic.kinematics.output import Output
from analytic.mechanism.one_line import angles, clearances, count, one_line
from analytic.mechanism.signals import Signal, named
from analytic.paper.clearance import Displaced, Model, displaced, loose_friction
from analytic.paper.compliance import Compliance, compliance
from analytic.paper.envelope import (
    ContactSideChange,
    condition,
    displacement,
    farthest,
    side_changes,
    sizes,
    unit_reactions,
    worst_case,
)
from analytic.paper.friction import lean
from analytic.paper.guide import GuidedBlock, direction
from analytic.paper.kinetostatics import kinetostatics

SWEEP_STEP = np.radians(0.25)  # crank angle between looks for a contact that changes side
ILL_CONDITIONED = 10.0  # loop Jacobian; a dyad's at a transmission angle of 11.4 deg
NONLINEAR = (
    0.05  # of the worst case (of the clearance if that is larger), between first order and the finite gaps' equilibrium
)


@dataclass(frozen=True)
class Total:
    """Both displacements of a linkage at N crank angles, and their sum."""

    clearance: Displaced
    compliance: Compliance

    def __repr__(self) -> str:
        return one_line(self, repr(self.clearance), repr(self.compliance))

    def by_clearance(self, body: str, point: str = "com") -> np.ndarray:
        """Displacement x + iy (m) of a body's point by the joints' clearance, (N,) complex."""
        return self.clearance.configuration.motion.position(body, point) - self.clearance.ideal.motion.position(
            body, point
        )

    def displacement(self, body: str, point: str = "com") -> np.ndarray:
        """Displacement x + iy (m) of a body's point by clearance and compliance together, (N,) complex."""
        return self.by_clearance(body, point) + self.compliance.displacement(body, point)

    def signals(self) -> dict[str, np.ndarray]:
        """Every signal of the contract with both displacements in it, by name (SI units); NaN at flagged angles."""
        return superposed(self.clearance.signals(), self.compliance)


def superposed(signals: Mapping[str, np.ndarray], compliance: Compliance) -> dict[str, np.ndarray]:
    """Signals (N,) of a linkage of rigid parts, its clearances taken up or not, with its compliance added (Fig. 7c).

    Bodies move and turn by their elastic displacement, joints turn and slide between the sections that they join, and
    the pins move in their bearings by the give of the joints' own springs (Eq. 4).  Reactions and torques change by
    what springs give that yield with the links; but for that they, and rates, change in second order only.  Directions
    and sizes of reactions are left as they were.
    """
    m, out = compliance.mechanism, dict(signals)
    for name, signal in named(m.bodies, m.joints, m.drives, m.sensors).items():
        part = elastic_part(signal, compliance) if name in out else None
        if part is not None:
            out[name] = out[name] + part
    return out


def elastic_part(signal: Signal, compliance: Compliance) -> np.ndarray | None:
    """What compliance adds to a signal (N,), in its unit; None where that is nothing, to first order."""
    if signal.component == "angle" and signal.kind in ("pose", "rotation"):
        return compliance.rotation(signal.place, compliance.mechanism.angle_point(signal.place))
    if signal.kind in ("reaction", "drive"):
        return compliance.loads.get(signal.name)
    if signal.kind == "position":
        return compliance.positions[signal.place]
    if signal.kind == "pose":
        moved = compliance.displacement(signal.place)
    elif signal.kind == "clearance":
        if compliance.mechanism.joint(signal.place).prismatic:  # a block keeps its rest
            return None
        moved = compliance.give(signal.place)
    else:
        return None
    return moved.real if signal.component == "x" else moved.imag


def total_displacement(
    assembly: Assembly,
    theta: np.ndarray,
    omega: np.ndarray | float = 1.0,
    *,
    model: Model = "first_order",
    inertia: bool = False,
    clearances: Mapping[str, float] | None = None,
) -> Total:
    """Superpose clearance (``model``) and the ideal configuration's compliance at crank angles theta (N,) rad.

    With ``first_order`` this is the paper's procedure.  Several inputs are (n_inputs, N); their drives hold their
    joints.  Raises what :func:`analytic.paper.clearance.displaced` and :func:`analytic.paper.compliance.compliance` do.
    """
    moved = displaced(assembly, theta, omega, model=model, inertia=inertia, clearances=clearances)
    return Total(moved, compliance(moved.ideal.motion, inertia))


@dataclass(frozen=True)
class AccuracyAnalysis:
    """What clearance and compliance do to a linkage's outputs at N crank angles; methods return (N,) in the output's
    unit.

    ``flags`` maps the index of an angle at which there is no equilibrium with the pins in contact to the reason: it is
    NaN there.  ``cautions`` does so for angles whose numbers stand but are not to be relied on.
    """

    assembly: Assembly
    path: CrankTable
    total: Total  # its clearance part is the equilibrium with the finite gaps
    pins: tuple[str, ...]  # and then the blocks with clearance
    blocks: int  # so many of the last of them
    clearances: np.ndarray  # (pins,) m
    unit_reactions: Mapping[Output, np.ndarray]  # (pins, N) complex
    directions: np.ndarray  # (pins, N) complex of length 1: where the ideal linkage's reactions press; see _directions
    condition: np.ndarray  # of the loop Jacobian
    side_changes: Sequence[ContactSideChange]
    jumps: Mapping[Output, np.ndarray]  # (side changes,): what each one does to the output
    flags: Mapping[int, str]

    def __repr__(self) -> str:
        sizes = dict(zip(self.pins, self.clearances.tolist(), strict=True))
        outputs, changes = count(len(self.unit_reactions), "output"), count(len(self.side_changes), "side change")
        return one_line(self, self.assembly.mechanism.name, angles(self.theta), clearances(sizes), outputs, changes)

    @property
    def theta(self) -> np.ndarray:
        """Crank angles (rad)."""
        return self.total.clearance.ideal.motion.theta

    def nominal(self, d: Output) -> np.ndarray:
        """First-order displacement with every pin along its reaction, sum R . c F/|F|; NaN where one has no
        direction.
        """
        return displacement(self.unit_reactions[d], self.clearances[:, None] * self.directions)

    def by_joint(self, d: Output) -> dict[str, np.ndarray]:
        """What each joint's clearance does alone of :meth:`nominal`, R . c F/|F| (N,)."""
        gaps = self.clearances[:, None] * self.directions
        parts = (displacement(self.unit_reactions[d][[k]], gaps[[k]]) for k in range(len(self.pins)))
        return dict(zip(self.pins, parts, strict=True))

    def equilibrium(self, d: Output) -> np.ndarray:
        """Displacement by finite gaps, each along the reaction of the linkage that they displace; NaN where flagged."""
        return self.total.clearance.moved(d)

    def worst_case(self, d: Output) -> np.ndarray:
        """Largest displacement to either side, wherever the pins lie within their clearance: sum c |R|."""
        return worst_case(self.unit_reactions[d], self.clearances, self.blocks)

    def sensitivity(self, d: Output) -> dict[str, np.ndarray]:
        """|R| of every revolute joint, with or without clearance, and of blocks with: displacement per clearance."""
        return dict(zip(self.pins, sizes(self.unit_reactions[d], self.blocks), strict=True))

    def compliance(self, d: Output) -> np.ndarray:
        """Elastic displacement of the ideal configuration."""
        return self.total.compliance.output(d)

    def by_both(self, d: Output) -> np.ndarray:
        """Displacement by the finite gaps and by compliance together (Fig. 7c); NaN where flagged."""
        return self.equilibrium(d) + self.compliance(d)

    def farthest(self, x: Output, y: Output) -> np.ndarray:
        """Farthest displacement of a point, x + iy, in any direction of the plane; complex (N,)."""
        return farthest(self.unit_reactions[x], self.unit_reactions[y], self.clearances, self.blocks)

    @property
    def cautions(self) -> dict[int, str]:
        """Angles near a singularity, or where the gaps are too large for first order."""
        reasons: dict[int, str] = {}
        size = max(body.length for body in self.assembly.mechanism.bodies)
        for d in self.unit_reactions:
            away = np.abs(self.equilibrium(d) - self.nominal(d))
            per_metre = 1.0 if d.axis != "angle" else 1.0 / size if size else np.inf  # an arm of one pin has no length
            least = self.clearances.max() * per_metre
            for i in np.flatnonzero(away > NONLINEAR * np.maximum(self.worst_case(d), least)):
                reasons.setdefault(
                    int(i),
                    f"first order is {away[i]:.2g} {d.unit} away from the equilibrium of the finite gaps in {d.name}",
                )
        for i in np.flatnonzero(self.condition > ILL_CONDITIONED):
            reasons[int(i)] = f"near a singularity: the loops' condition number is {self.condition[i]:.3g}"
        return dict(sorted(reasons.items()))


def accuracy(
    assembly: Assembly,
    theta: np.ndarray,
    outputs: Sequence[Output],
    clearances: Mapping[str, float],
    omega: float = 1.0,
    inertia: bool = False,
) -> AccuracyAnalysis:
    """Analyse outputs with these radial clearances (m) at crank angles theta (N,) rad.

    ``omega`` and ``inertia`` are those of :func:`analytic.paper.clearance.displaced`, and so is what is raised,
    ComplianceError besides.
    """
    total = total_displacement(assembly, theta, omega, model="equilibrium", inertia=inertia, clearances=clearances)
    sweep = closely(theta)
    path, m = assembly.path(sweep[0], sweep[-1]), assembly.mechanism
    sizes = {name: c for name, c in clearances.items() if not m.joint(name).prismatic}
    moved = total.clearance
    changes = side_changes(
        kinetostatics(kinematics(assembly, sweep, omega, path=path), inertia, loose=loose_friction(m, sizes)),
        sizes,
        moved.faint,
        whole_turn(theta),
    )
    blocks = {name: GuidedBlock.of(m, name, c) for name, c in clearances.items() if c > 0 and m.joint(name).prismatic}
    pins = (*assembly.structure.pins, *blocks)
    crossings = np.array([change.crank_angle for change in changes])
    return AccuracyAnalysis(
        assembly=assembly,
        path=path,
        total=total,
        pins=pins,
        blocks=len(blocks),
        clearances=np.array([clearances.get(pin, 0.0) for pin in pins]),
        unit_reactions=unit_reactions(assembly, theta, outputs, path, blocks.values()),
        directions=np.array(
            [
                direction(blocks[pin].rests(moved.ideal))
                if pin in blocks
                else _directions(moved.ideal.forces[pin], moved.faint[pin])
                * np.exp(1j * lean(moved.ideal.motion, m.joint(pin)))
                if pin in moved.faint and clearances.get(pin)
                else np.zeros(theta.size)
                for pin in pins
            ]
        ),
        condition=condition(moved.ideal.motion),
        side_changes=changes,
        jumps=_jumps(changes, unit_reactions(assembly, crossings, outputs) if changes else {}, pins),
        flags=moved.flags,
    )


def _directions(force: np.ndarray, faint: float) -> np.ndarray:
    """Unit vectors (N,) of a joint's reactions; NaN where near zero."""
    size = np.abs(force)
    clear = size > faint
    return np.where(clear, force / np.where(clear, size, 1.0), np.nan)


def _jumps(
    changes: Sequence[ContactSideChange], at_changes: Mapping[Output, np.ndarray], pins: Sequence[str]
) -> dict[Output, np.ndarray]:
    rows = [pins.index(change.joint) for change in changes]
    gaps = np.array([change.jump for change in changes])
    return {d: displacement(r[rows, range(len(rows))][None], gaps[None]) for d, r in at_changes.items()}


def whole_turn(theta: np.ndarray) -> bool:
    """Whether the step after theta's last crank angle would close a turn."""
    return bool(theta.size > 1 and np.ptp(theta) + np.diff(np.sort(theta)).max() >= 2 * np.pi - 1e-9)


def closely(theta: np.ndarray) -> np.ndarray:
    """Crank angles SWEEP_STEP apart over theta's range, or over a whole turn less its closing angle."""
    low, whole = theta.min(), whole_turn(theta)
    high = low + 2 * np.pi if whole else theta.max()
    return np.linspace(low, high, int(np.ceil((high - low) / SWEEP_STEP)) + (not whole), endpoint=not whole)

"""The cells of a validity map, and the map that their results make."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, Literal

import numpy as np

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.reach import turns_fully, usual_angles
from analytic.mechanism import GROUND, Mechanism
from analytic.mechanism.assumed import Assumed, assumed
from compare.domain_map.cell import CellTask
from compare.domain_map.leaving import boundary
from compare.faults import ArgumentError, no_pin
from compare.judge.assumptions import ASSUMPTIONS
from compare.judge.reruns import SOFT_CONTACT
from compare.judge.tolerances import Tolerances
from compare.report.words import validity as words
from compare.results.validity import Between, Boundary, Cell, Failed, Law, Limits, Meaning, Validity
from compare.versions import installed, versions
from sim_models.common.contact_laws import assumed_of_contact, contact_parameters
from sim_models.common.failed_starts import STIFF_GIVE

RealJoint = Literal["massless-link", "spring-damper", "contact"]


@dataclass(frozen=True)
class MapPlan:
    """The axes of a map.  Every joint in ``joints`` has the cell's clearance, the others have none."""

    mechanism: Mechanism
    joints: tuple[str, ...]
    speeds: tuple[float, ...]  # rad/s
    clearances: tuple[float, ...]  # m
    simulators: tuple[str, ...]
    joint_model: RealJoint
    tolerances: Tolerances
    joints_are: str = "as asked"  # why these joints
    warnings: tuple[str, ...] = ()
    restitutions: tuple[float, ...] | None = None  # None: as the mechanism has it
    revolutions: int = 0  # over which contact is watched

    @property
    def layers(self) -> tuple[float | None, ...]:
        """The restitutions; None for the mechanism's own."""
        return self.restitutions or (None,)

    def linkage(self, speed: float, clearance: float, restitution: float | None = None) -> Mechanism:
        """The mechanism of a cell: driven the way that it is, and its contact as stiff and as damped in every
        engine.

        With a ``restitution`` the damping follows from it, or the law that a joint names is asked for it.
        """
        linkage = self.asked(speed, clearance, restitution)
        for name in self.joints if self.joint_model != "massless-link" else ():
            joint = linkage.joint(name)
            law, named = contact_parameters(linkage, joint, "driven"), joint.contact_law not in (None, "kelvin-voigt")
            damping = None if named else law.damping
            linkage = linkage.with_joint(name, contact_stiffness=law.stiffness, contact_damping=damping)
        return linkage

    def asked(self, speed: float, clearance: float, restitution: float | None = None) -> Mechanism:
        """The mechanism of a cell with the contact that it gives itself, and this ``restitution``."""
        assert self.mechanism.speed is not None
        linkage = self.mechanism.with_drive(speed=math.copysign(speed, self.mechanism.speed))
        linkage = linkage.with_clearances(dict.fromkeys(self.joints, clearance))
        for name in self.joints if self.joint_model != "massless-link" and restitution is not None else ():
            linkage = linkage.with_joint(name, restitution=restitution, contact_damping=None)
        return linkage


def clearance_joints(mechanism: Mechanism, at: Sequence[str] | None) -> tuple[tuple[str, ...], str]:
    """The joints that carry the clearance, and why these.  Raises ArgumentError."""
    pins = [joint.name for joint in mechanism.joints if not joint.prismatic]
    if at is not None:
        for name in at:
            if name not in mechanism.may_be_loose:
                raise ArgumentError("joints", no_pin(name, pins, mechanism))
        return _alike(mechanism, tuple(dict.fromkeys(at))), "as asked"
    if mechanism.clearances:
        return _alike(mechanism, tuple(mechanism.clearances)), "the case's own"
    away = _distances(mechanism)
    far = max(
        pins,
        key=lambda name: (
            sum(away[body] for body in mechanism.joint(name).bodies),
            mechanism.driven not in mechanism.joint(name).bodies,
        ),
    )
    return (far,), "the joint farthest from the ground and the drive"


def _alike(mechanism: Mechanism, names: tuple[str, ...]) -> tuple[str, ...]:
    """Joints that are pins, or else blocks.  Raises ArgumentError for some of both."""
    for pin, block in product(names, names):
        if mechanism.joint(block).prismatic and not mechanism.joint(pin).prismatic:
            why = f"{block!r} is a block in a guide and {pin!r} a pin in a bearing; give each a map of its own"
            raise ArgumentError("joints", f"{why}, by naming the joints that are to have the clearance")
    return names


def _distances(mechanism: Mechanism) -> dict[str, int]:
    """How many joints are between each body and the ground."""
    far = len(mechanism.parts)
    away = dict.fromkeys(mechanism.parts, far) | {GROUND: 0}
    for _ in range(far):
        for joint in mechanism.joints:
            for here, there in (joint.bodies, joint.bodies[::-1]):
                away[there] = min(away[there], away[here] + 1)
    return away


def cells(plan: MapPlan) -> list[CellTask]:
    """The runs of a map, engine by engine."""
    theta, skip = _angles(Assembly(plan.mechanism))
    tolerances = plan.tolerances.only("driven", plan.joint_model)
    places = list(product(plan.layers, plan.speeds, plan.clearances))
    linkages = {(e, w, c): plan.linkage(w, c, e) for e, w, c in places}
    return [
        CellTask(
            simulator=simulator,
            joint_model=plan.joint_model,
            speed=speed,
            clearance=clearance,
            mechanism=linkages[restitution, speed, clearance],
            crank_angle=theta,
            skip=skip,
            tolerances=tolerances,
            versions=versions(installed(simulator)),
            restitution=restitution,
            revolutions=plan.revolutions,
        )
        for simulator in plan.simulators
        for restitution, speed, clearance in places
    ]


def _angles(assembly: Assembly) -> tuple[np.ndarray, int]:
    """Crank angles (N,) rad of every run, and how many of the first are not judged.

    A crank that turns fully has made a revolution before its first angle.  For another the first angle is the start
    itself, at which the engine was told where to be.
    """
    theta = usual_angles(assembly)
    return theta, 0 if turns_fully(assembly) or theta.size == 1 else 1


# ---------------------------------------------------------------- what they come to


def summarised(plan: MapPlan, tasks: Sequence[CellTask], results: Sequence[Cell | Failed]) -> Validity:
    """The map, but for the command and warnings; ``results`` are the cells of ``tasks``, in their order."""
    between, edge = _between(plan, results), _boundary(plan, tasks, results)
    blocks = [name for name in plan.joints if plan.mechanism.joint(name).prismatic]
    means = words.MEANS_OF_BLOCKS if blocks else words.MEANS
    sentences = words.come_to(plan.simulators, results, between, _inertia_only(plan.mechanism))
    optional: dict[str, Any] = {"between_simulators": between, "restitutions": plan.restitutions, "boundary": edge}
    return Validity(
        case=plan.mechanism.name,
        mechanism=plan.mechanism,
        versions=versions(installed(*plan.simulators)),
        simulators=plan.simulators,
        joint_model=plan.joint_model,
        motion="driven",
        analytic_model="equilibrium",
        joints=plan.joints,
        joints_are=plan.joints_are,
        speeds=plan.speeds,
        clearances=plan.clearances,
        crank_angle=tasks[0].crank_angle[tasks[0].skip :],
        contact=_contact(plan),
        assumptions={name: Meaning(means=each, examined=name in ASSUMPTIONS) for name, each in means.items()},
        cells=tuple(results),
        holds_up_to={name: _holds(plan, [c for c in results if c.simulator == name]) for name in plan.simulators},
        words=(*sentences, *words.contact_lost(results, blocks)),
        command="",
        warnings=tuple(too_soft(results)),
        assumed=(*assumed(plan.mechanism), *_assumed(plan, results)),
        **{name: value for name, value in optional.items() if value},
    )


def _boundary(plan: MapPlan, tasks: Sequence[CellTask], results: Sequence[Cell | Failed]) -> tuple[Boundary, ...]:
    """Where contact is first lost by the analytic model, by restitution and speed, where its cells were asked."""
    linkages = {task.at: task for task in tasks}
    leavings = {cell.at: cell.leaving for cell in results if isinstance(cell, Cell) and cell.leaving is not None}
    boundaries = []
    for restitution, speed in product(plan.layers, plan.speeds):
        column = [leavings.get((speed, clearance, restitution)) for clearance in plan.clearances]
        known = [(gap, one) for gap, one in zip(plan.clearances, column, strict=True) if one is not None]
        if not known:
            continue
        task = linkages[speed, known[0][0], restitution]
        gaps = tuple(gap for gap, _ in known)
        left = {kind: tuple(getattr(one, kind) is not None for _, one in known) for kind in ("rigid", "yielding")}
        edges = {
            kind: boundary(task.mechanism, task.crank_angle, gaps, left[kind], rigid=kind == "rigid") for kind in left
        }
        layer: dict[str, Any] = {} if restitution is None else {"restitution": restitution}
        boundaries.append(Boundary(speed=speed, **layer, **edges))
    return tuple(boundaries)


def _assumed(plan: MapPlan, results: Sequence[Cell | Failed]) -> Iterator[Assumed]:
    """What contact is made of in the cells that the mechanism does not say."""
    asked = plan.asked(plan.speeds[0], plan.clearances[0], plan.layers[0])
    cells = [cell for cell in results if isinstance(cell, Cell)]
    contact = [assumed_of_contact(asked, plan.joints, cell.settings) for cell in cells]
    yield from dict.fromkeys(each for one in contact for each in one)


def too_soft(results: Sequence[Cell | Failed]) -> Iterator[str]:
    """A warning for each engine in whose cells the contact gives so much that the clearance is hidden."""
    soft = [cell for cell in results if isinstance(cell, Cell) and cell.give > SOFT_CONTACT * cell.clearance]
    for name in dict.fromkeys(cell.simulator for cell in soft):
        mine = [cell for cell in soft if cell.simulator == name]
        cell = max(mine, key=lambda cell: cell.give / cell.clearance)
        stiffness, times = cell.settings.get("contact_stiffness"), cell.give / cell.clearance
        yield words.too_soft(name, mine, stiffness * times / STIFF_GIVE if isinstance(stiffness, float) else None)


def _contact(plan: MapPlan) -> dict[str, Law]:
    """Each joint's law; its damping, where that is the same in all cells."""
    linkage = plan.linkage(plan.speeds[0], plan.clearances[0], plan.layers[0])
    laws = {}
    for name in plan.joints:
        joint = linkage.joint(name)
        if joint.contact_stiffness:
            law = {} if joint.contact_law is None else {"law": joint.contact_law}
            damping = None if plan.restitutions else joint.contact_damping
            laws[name] = Law(stiffness=joint.contact_stiffness, damping=damping, **law)
    return laws


def _holds(plan: MapPlan, each: Sequence[Cell | Failed]) -> Limits:
    """By clearance the highest speed (rad/s) up to which the equilibrium, and Eq. 8, hold at every speed and
    restitution of the map; None if at none.
    """

    def highest(test: Callable[[Cell], bool]) -> tuple[float | None, ...]:
        limits: list[float | None] = []
        for clearance in plan.clearances:
            holding: float | None = None
            for cell in sorted((c for c in each if c.clearance == clearance), key=lambda c: c.speed):
                if isinstance(cell, Failed) or not test(cell):
                    holding = max((w for w in plan.speeds if w < cell.speed), default=None)
                    break
                holding = cell.speed
            limits.append(holding)
        return tuple(limits)

    return Limits(
        equilibrium=highest(lambda cell: cell.agrees), first_order=highest(lambda cell: cell.first_order_is_enough)
    )


def _between(plan: MapPlan, each: Sequence[Cell | Failed]) -> Between | None:
    """How far the engines are from one another; None for one engine."""
    judged = [cell for cell in each if isinstance(cell, Cell)]
    places = product(plan.speeds, plan.clearances, plan.layers)
    groups = [[c for c in judged if c.at == place] for place in places]
    groups = [group for group in groups if len(group) > 1]
    if not groups:
        return None
    return Between(
        cells=len(groups),
        same_verdict=sum(len({cell.verdict for cell in group}) == 1 for group in groups),
        same_cause=sum(len({(cell.verdict, cell.cause) for cell in group}) == 1 for group in groups),
        free_share_spread=max(float(np.ptp([cell.free for cell in group])) for group in groups),
        agreeing_share_spread=max(float(np.ptp([cell.agreeing_share for cell in group])) for group in groups),
    )


def _inertia_only(mechanism: Mechanism) -> bool:
    loaded = any(mechanism.gravity) or any(load.torque or any(load.force) for load in mechanism.loads)
    return (
        not loaded and not any(j.has_law or j.friction for j in mechanism.joints) and mechanism.periodic_torque is None
    )

"""Why a run with clearance disagrees: each assumption of the paper tested by itself, on the run's own linkage.

An assumption's cost is the largest error that it makes, as a multiple of what the cross-check allows:

``contact``       at all times: does a pin ever fly free in the simulation?
``first-order``   Eq. 8's displacement and forces, against the equilibrium's in the displaced configuration;
``quasi-static``  reactions without the inertia of the gap's own motion, against those with it; it fails as well where
                  that motion is too fast for an equilibrium to be found, and where a pin that never leaves its bearing
                  does not lie where the equilibrium says, because it swings along the rim;
``rigid``         contact: reactions with the gaps larger by force over stiffness, and moving as this does, against
                  those with gaps that keep their size.

Of a block in its guide ``contact`` fails where none of its corners is at a wall, ``quasi-static`` where it has not had
the time to come to rest or does not rest where the equilibrium says, and ``rigid`` is told by a guide that is wider by
what the hardest pressed corner gives.

The equilibrium itself does not need ``first-order`` and corrects ``quasi-static`` once, so it may agree where the
paper's formula does not; ``quasi-static-corrected`` is what a second correction would change.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, get_args

import numpy as np

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import Gap, kinematics
from analytic.kinematics.schedule import Schedule, Turning
from analytic.mechanism import Joint, Mechanism
from analytic.mechanism.signals import Signal
from analytic.paper.clearance import GAP_STENCIL, ON_ITS_WAY, Displaced, Model, displaced, loose_friction
from analytic.paper.kinetostatics import Reactions, kinetostatics
from analytic.paper.superposition import whole_turn
from compare.judge.discrepancy import (
    Comparison,
    Rule,
    Scales,
    contact_give,
    contact_stiffness,
    judge,
    run_rules,
)
from compare.judge.reference import TURNS_BACK
from compare.judge.rocking import rocking, undamped
from compare.judge.signals import with_derived, with_rotations
from compare.judge.tolerances import Tolerances
from compare.results.crosscheck import Discrepancy, Run
from compare.results.validity import Assumption, Costing
from sim_models.common.guide import Guide

SignalArrays = Mapping[str, np.ndarray]
ROCKING_SPREAD = 1.5  # times what a linear wall lets a block rock, as much as one that stiffens may
EITHER_SIDE = 0.3  # of its rms, below which the mean of a difference says that it is to neither side
ASSUMPTIONS: tuple[Assumption, ...] = get_args(Assumption)


@dataclass(frozen=True)
class Examined:
    """A cross-checked driven run of a mechanism with clearance, at the instants of a schedule, and its tolerances."""

    mechanism: Mechanism
    schedule: Schedule
    run: Run
    tolerances: Tolerances

    @property
    def theta(self) -> np.ndarray:
        """What the run's samples are told along (N,): the crank's angle (rad), or a drive's position."""
        return self.run.crank_angle

    @cached_property
    def verdicts(self) -> list[tuple[Comparison, np.ndarray]]:
        """Every compared signal of the run, and the angles (N,) at which it is within tolerance."""
        return list(self.judged(self.run.comparable, self.run.analytic))

    @cached_property
    def agreeing(self) -> np.ndarray:
        """Angles (N,) at which every signal is within tolerance, and the model has an answer."""
        return np.all([within for _, within in self.verdicts], axis=0) & ~self.flagged

    @property
    def contact_lost(self) -> bool:
        """Whether any pin flies free in the simulation."""
        return any(self.run.free_share.values())

    @cached_property
    def swings(self) -> bool:
        """Whether a pin never leaves its bearing, and does not lie where the equilibrium says; or swings about there,
        where no other cost tells why its reaction points to either side of the equilibrium's, in the mean to neither.
        """
        off = [d for d, _ in self.verdicts if d.verdict == "disagrees"]
        if self.contact_lost or any(d.signal.kind == "clearance" for d in off):
            return not self.contact_lost
        if self.rocks:
            return True
        directions = [Signal.of("reaction", joint, "angle").name for joint in self.run.clearance]
        turned = any(d.signal.name in directions and self._to_both_sides(d) for d in off)
        return turned and max(self.costs["quasi-static-corrected"], self.costs["rigid"]) <= 1

    @cached_property
    def rocks(self) -> str:
        """The joint whose block stays on its walls, and rocks there after its friction has turned round, or because
        nothing damps it, which is all that disagrees; empty if there is none.
        """
        if self.contact_lost or not self.schedule.turns_evenly:
            return ""
        off = [(d, within) for d, within in self.verdicts if d.verdict == "disagrees"]
        for joint in self.blocks:
            moment = Signal.of("reaction", joint.name, "moment").name
            where = [within for d, within in off if d.signal.name == moment]
            if where and (self._rocking(joint, moment, where[0], len(off)) or self._ringing(joint, off)):
                return joint.name
        return ""

    def _rocking(self, joint: Joint, moment: str, within: np.ndarray, signals: int) -> bool:
        """Whether a moment, the only one of so many ``signals``, is off by what a block has that rocks."""
        if signals > 1 or not joint.rough or self.run.joint_model != "contact":
            return False
        across = self.run.analytic[Signal.of("reaction", joint.name, "magnitude").name]
        least = ROCKING_SPREAD * rocking(self.assembly, joint, self.theta, self.mechanism.speed or 0.0, across)
        off = np.abs(self.run.comparable[moment] - self.run.analytic[moment])
        return bool(np.all(within | (off <= least)))

    def _ringing(self, joint: Joint, off: Sequence[tuple[Comparison, np.ndarray]]) -> bool:
        """Whether a block whose contact nothing damps swings about where it should be, in all that is off of it."""
        of_block = [d for d, _ in off if d.signal.place == joint.name and d.signal.component != "angle"]
        return undamped(self.mechanism, joint) and all(self._to_both_sides(d) for d in of_block)

    def _to_both_sides(self, comparison: Comparison) -> bool:
        """Whether a difference is of no sign."""
        apart = comparison.signal.apart(
            *(side[comparison.signal.name] for side in (self.run.comparable, self.run.analytic))
        )
        apart = apart[np.isfinite(apart) & ~self.flagged]
        return bool(abs(apart.mean()) < EITHER_SIDE * math.sqrt(float(np.mean(apart**2))))

    @cached_property
    def out_of_step(self) -> bool:
        """Whether a pin is not where any equilibrium has it."""
        return self.swings or bool((self.flagged & ~self.unloaded).any())

    @property
    def fails(self) -> list[Assumption]:
        """The assumptions that fail here, whether or not the model agrees."""
        failing: dict[Assumption, bool] = {
            "contact": self.contact_lost,
            "first-order": self.costs["first-order"] > 1,
            "quasi-static": self.costs["quasi-static"] > 1 or self.out_of_step,
            "rigid": self.costs["rigid"] > 1,
        }
        return [name for name in ASSUMPTIONS if failing[name]]

    @property
    def cause(self) -> Assumption | None:
        """The assumption whose failure explains that the equilibrium disagrees; None if that of none does.

        Of two known errors the larger counts.
        """
        if self.contact_lost:
            return "contact"
        left: dict[Assumption, float] = {
            "quasi-static": np.inf if self.out_of_step else self.costs["quasi-static-corrected"],
            "rigid": self.costs["rigid"],
        }
        largest = max(left, key=lambda name: left[name])
        return largest if left[largest] > 1 else None

    @cached_property
    def flagged(self) -> np.ndarray:
        """Angles (N,) at which the model has no answer, but for those at which friction turns back: nobody has one."""
        return np.isin(np.arange(self.theta.size), [i for i, back in self._flags.items() if not back])

    @cached_property
    def _flags(self) -> dict[int, bool]:
        """Which samples are flagged; whether for friction that turns back there."""
        return {int(i): why.endswith(TURNS_BACK) for i, why in self.run.flags.items()}

    @cached_property
    def unloaded(self) -> np.ndarray:
        """Angles (N,) at which a joint's reaction passes so near zero that it has no direction, or a block's rest is
        not known for the same reason.
        """
        moved = self.equilibrium
        if self.blocks:
            unsure = [i for i, why in moved.flags.items() if not why.endswith(ON_ITS_WAY)]
            return np.isin(np.arange(self.theta.size), unsure)
        return np.any([np.abs(moved.ideal.forces[name]) <= moved.faint[name] for name in self.run.clearance], axis=0)

    @property
    def blocks(self) -> list[Joint]:
        """The joints with clearance whose block has it."""
        return [joint for joint in map(self.mechanism.joint, self.run.clearance) if joint.prismatic]

    @cached_property
    def give(self) -> float:
        """How far (m) the contact yields under the simulation's peak force."""
        return contact_give(self.run.settings, self.run.clearance, self.run.simulated)

    # ---------------------------------------------------------------- the model against itself

    @cached_property
    def equilibrium(self) -> Displaced:
        """The model that the simulation is held to."""
        return self.displaced("equilibrium")

    def displaced(self, model: Model, later: tuple[float, ...] = (0.0,), wider: float = 0.0) -> Displaced:
        """A model of the linkage at the run's samples, or in turn these times (s) after each of them, with clearances
        that are so much wider (m).
        """
        at = self.turned(later)
        clearances = {name: c + wider for name, c in self.run.clearance.items()}
        return displaced(
            self.assembly, at.theta, at.omega, alpha=at.alpha, model=model, clearances=clearances,
            time=self.schedule.later(later).time,
        )  # fmt: skip

    def turned(self, later: tuple[float, ...] = (0.0,)) -> Turning:
        """How the drives move at the run's samples, or in turn these times (s) after each of them."""
        return self.assembly.inputs_along(self.schedule.later(later))

    @cached_property
    def assembly(self) -> Assembly:
        """The ideal linkage, assembled once; with the friction of contacts that the run has."""
        rubs = self.run.joint_model == "contact"
        return Assembly(self.mechanism if rubs else self.mechanism.without_contact_friction())

    @cached_property
    def costs(self) -> dict[Costing, float]:
        """What each assumption that the model makes about itself costs, 1 being the tolerance."""
        right = self.signals(self.equilibrium)
        if self.blocks:
            return self._costs_of_blocks(right)
        still = {name: Gap(value) for name, value in self.equilibrium.gaps.items()}
        moving = self.signals(self.with_gaps(self.moving(np.inf)))
        return {
            "first-order": self.cost(self.signals(self.displaced("first_order")), right),
            "quasi-static": self.cost(self.signals(self.with_gaps(still)), right),
            "quasi-static-corrected": self.cost(moving, right),
            "rigid": self.cost(self.signals(self.with_gaps(self.moving(contact_stiffness(self.run.settings)))), moving),
        }

    def _costs_of_blocks(self, right: SignalArrays) -> dict[Costing, float]:
        """The costs where blocks have the clearance: at rest on their corners they have no motion of their own."""
        first, wider = self.displaced("first_order"), self.displaced("equilibrium", wider=self._sunk)
        return {
            "first-order": self.cost(self.signals(first), right),
            "quasi-static": 0.0,
            "quasi-static-corrected": 0.0,
            "rigid": self.cost(self.signals(wider), right),
        }

    @property
    def _sunk(self) -> float:
        """How far (m) the hardest pressed corner of a block is in its wall."""
        stiffness, hardest = contact_stiffness(self.run.settings), [0.0]
        for joint in self.blocks:
            guide = Guide.of(joint)
            assert guide is not None  # of all that have clearance
            force, moment = (self.run.simulated[f"reaction_{joint.name}_{each}"] for each in ("magnitude", "moment"))
            hardest.append(float(np.nanmax(guide.hardest(force, moment), initial=0.0)))
        return max(hardest) / stiffness

    def with_gaps(self, gaps: Mapping[str, Gap]) -> Reactions:
        """Reactions of the linkage whose gaps move as given."""
        at = self.turned()
        motion = kinematics(self.assembly, at.theta, at.omega, at.alpha, gaps, time=self.schedule.time)
        return kinetostatics(motion, loose=loose_friction(self.assembly.mechanism, self.run.clearance))

    @cached_property
    def step(self) -> float:
        """Seconds in which the fastest drive moves by the stencil of a rate."""
        return GAP_STENCIL / (float(np.abs(self.turned().omega).max()) or 1.0)

    @cached_property
    def beside(self) -> Displaced:
        """The equilibrium a step before, at and after each of the run's samples."""
        return self.displaced("equilibrium", (-self.step, 0.0, self.step))

    def moving(self, stiffness: float) -> dict[str, Gap]:
        """The equilibrium's gaps, larger by force over stiffness (N/m), and their rates by differences."""
        gaps = {}
        for name, gap in self.beside.gaps.items():
            before, here, after = (gap + self.beside.reactions.forces[name] / stiffness).reshape(-1, 3).T
            gaps[name] = Gap(here, (after - before) / (2 * self.step), (after - 2 * here + before) / self.step**2)
        return gaps

    def signals(self, side: Displaced | Reactions) -> SignalArrays:
        """Every signal (N,) of an analytic answer."""
        motion = self.equilibrium.ideal.motion
        return with_rotations(
            with_derived(side.signals(), self.mechanism),
            {body.name: motion.angle(body.name) for body in self.mechanism.bodies},
        )

    # ---------------------------------------------------------------- judging

    def judged(self, one: SignalArrays, other: SignalArrays) -> Iterator[tuple[Comparison, np.ndarray]]:
        """Every compared signal of one side held against the other's, and at which angles (N,) it is within
        tolerance.
        """
        run, scales = self.run, Scales.of(other, self.mechanism)
        rules = run_rules(
            self.tolerances, self.mechanism, run.motion, run.joint_model, run.clearance, scales, self.give
        )
        for rule in rules.values():
            comparison = judge(rule, one, other, self.theta)
            if comparison is not None:
                yield comparison, self.within(rule, one, other)

    def within(self, rule: Rule, one: SignalArrays, other: SignalArrays) -> np.ndarray:
        """Angles (N,) at which a signal is within its rule, or means nothing."""
        apart = rule.signal.apart(one[rule.signal.name], other[rule.signal.name])
        tolerance, tube = rule.allowed(other, self.theta)
        return ~(np.abs(apart) > tolerance + np.where(apart > 0, tube.above, tube.below))

    def cost(self, one: SignalArrays, other: SignalArrays) -> float:
        """The largest difference of one side from the other over what is allowed, at angles where both have an
        answer.
        """
        reaction = Signal.of("reaction", next(iter(self.run.clearance)), "x").name
        known = np.isfinite(one[reaction]) & np.isfinite(other[reaction])
        known[list(self._flags)] = False
        sides = [{name: np.where(known, values, np.nan) for name, values in side.items()} for side in (one, other)]
        return max((excess(comparison) for comparison, _ in self.judged(*sides)), default=0.0) if known.any() else 0.0


def excess(comparison: Comparison) -> float:
    """A difference over its tolerance."""
    return abs(comparison.max) / max(comparison.tolerance, np.finfo(float).tiny)


# ---------------------------------------------------------------- why a cross-check disagrees


@dataclass(frozen=True)
class Failing:
    """The assumption of the analytic model that fails in a run that disagrees, and where: that of ``contact`` in a
    joint, or ``unknown`` if none that was examined explains the disagreement.

    ``cost`` is what it costs, in tolerances; ``give`` (m) how far the contact yields; ``worst`` the signal that the
    first order moves most, of those that it explains.  A pin that stays in contact ``swings`` along its rim; a block
    ``rocks`` on its walls, for a while or for ever.  Where a load opposes the motion, ``off`` are the angles (N,)
    at which the signal ``apart``, the farthest from its tolerance, is out of it, ``turned`` those by which a reaction
    has turned round.
    """

    assumption: Assumption | Literal["unknown"]
    joint: str | None = None
    cost: float = math.nan
    give: float = math.nan
    worst: str = ""
    swings: bool = False
    rocks: Literal["", "for a while", "for ever"] = ""
    apart: str = ""
    off: np.ndarray | None = None
    turned: np.ndarray | None = None


def failing_assumption(run: Run, mechanism: Mechanism, tolerances: Tolerances, schedule: Schedule) -> Failing | None:
    """Why a run with clearance disagrees, and where beside reversals of a load that opposes the motion; None where
    nothing is known of it.
    """
    failing = _failing(run, mechanism, tolerances, schedule)
    braked = run.motion == "driven" and any(load.opposes for load in mechanism.loads)
    if failing is None or not braked or run.crank_angle.size < 2:
        return failing
    examined = Examined(mechanism, schedule, run, tolerances)
    angles = [run.analytic[Signal.of("reaction", joint, "angle").name] for joint in run.clearance]
    turned = np.any([np.cos(np.diff(angle, prepend=angle[-1:])) < 0 for angle in angles], axis=0)
    for k in np.flatnonzero(np.any(np.isnan(angles), axis=0)):  # the model has no answer as the pin crosses there
        turned[k] = True
    turned[0] = turned[0] and whole_turn(run.crank_angle)
    off = [(excess(comparison), comparison.signal.name, ~within) for comparison, within in examined.verdicts]
    _, apart, where = max(off, key=lambda each: each[0])
    return replace(failing, apart=apart, off=where, turned=turned)


def _failing(run: Run, mechanism: Mechanism, tolerances: Tolerances, schedule: Schedule) -> Failing | None:
    """Why a run with clearance disagrees: the assumption of the analytic model that fails in it, and where.

    None where nothing is known of it: a run that is flagged everywhere.
    """
    lost = {joint: share for joint, share in run.free_share.items() if share > 0}
    if lost:
        return Failing("contact", max(lost, key=lambda name: lost[name]))
    moved = [d for d in run.discrepancies if _of_first_order(run, d)]
    if run.analytic_model == "first_order" and moved:
        return Failing("first-order", worst=max(moved, key=lambda d: d.share or 0.0).signal)
    if run.motion != "driven" or len(run.flags) == run.crank_angle.size:
        return None
    examined = Examined(mechanism, schedule, run, tolerances)
    return _rocking(examined) if examined.blocks else _tested(examined)  # no assumption's cost has blocks' rests


def _tested(examined: Examined) -> Failing:
    """Why a run whose pins keep contact disagrees, as its assumptions cost."""
    cause = examined.cause
    if cause == "quasi-static":
        return Failing(cause, cost=examined.costs["quasi-static-corrected"], swings=examined.swings)
    return Failing(cause or "unknown", cost=examined.costs["rigid"], give=examined.give)


def _rocking(examined: Examined) -> Failing | None:
    """Why a run with blocks disagrees, where that is that one rocks on its walls."""
    if not (name := examined.rocks):
        return None
    forever = undamped(examined.mechanism, examined.mechanism.joint(name))
    return Failing("quasi-static", name, rocks="for ever" if forever else "for a while")


def _of_first_order(run: Run, d: Discrepancy) -> bool:
    """Whether a signal that disagrees is off by about what the paper's first order is from the equilibrium."""
    apart = run.order_difference.get(d.signal)
    if d.verdict != "disagrees" or apart is None or apart.max is None or d.tolerance is None:
        return False
    return abs(apart.max) > d.tolerance

"""One cell of a validity map: a simulation at one speed and clearance, held against the model, and the model against
itself.

The simulation is cross-checked with the equilibrium at every crank angle.  Each assumption of the paper is then tested
by itself; its cost is the largest error that it makes, as a multiple of what the cross-check allows:

``contact``       at all times: does a pin ever fly free in the simulation?
``first-order``   Eq. 8's displacement and forces, against the equilibrium's in the displaced configuration;
``quasi-static``  reactions without the inertia of the gap's own motion, against those with it; it fails as well where that
                  motion is too fast for an equilibrium to be found, and where a pin that never leaves its bearing does
                  not lie where the equilibrium says, because it swings along the rim;
``rigid``         contact: reactions with the gaps larger by force over stiffness, and moving as this does, against those with
                  gaps that keep their size.

The equilibrium itself does not need ``first-order`` and corrects ``quasi-static`` once, so it may agree where the
paper's formula does not; ``quasi-static-corrected`` is what a second correction would change.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.motion import Gap, kinematics
from analytic.mechanism import Mechanism, MechanismWarning
from analytic.paper.clearance import STENCIL, Displaced, Model, displaced
from analytic.paper.kinetostatics import Reactions, kinetostatics
from compare.crosscheck import Job, crosscheck
from compare.judge.discrepancy import ANGULAR, Discrepancy, Rule, Scales, Tube, judge
from compare.judge.signals import compared, with_derived, with_rotations

Signals = Mapping[str, np.ndarray]
ASSUMPTIONS = ("contact", "first-order", "quasi-static", "rigid")


def examine(content: Mapping[str, Any]) -> dict[str, Any]:
    """Simulate and judge one cell: the plain data of :func:`compare.cli.validity.cells` in, a cell of validity.json
    out.

    The first ``skip`` crank angles are simulated and not judged.  Where the simulation fails, or the linkage cannot be
    assembled with these clearances, there is only ``failure``, why.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MechanismWarning)  # said once, where the file was read
        mechanism = Mechanism.model_validate(content["mechanism"])
    theta, skip = np.array(content["crank_angle"]), content["skip"]
    job = Job(
        mechanism,
        (content["simulator"],),
        content["tolerances"],
        theta=theta,
        joint_model=content["joint_model"],
        as_it_is=True,
    )
    try:
        result = crosscheck(job)
    except AssemblyError as error:
        return {"failure": str(error)}
    if result["failures"]:
        return {"failure": result["failures"][0]["why"]}
    return Cell(mechanism, theta[skip:], _later(result["runs"][0], skip), job.tolerances).verdict()


def _later(run: Mapping[str, Any], skip: int) -> dict[str, Any]:
    """A run without its first angles."""
    sides = {side: {name: values[skip:] for name, values in run[side].items()} for side in ("analytic", "simulated")}
    return {**run, **sides, "flags": {str(int(i) - skip): why for i, why in run["flags"].items() if int(i) >= skip}}


@dataclass(frozen=True)
class Cell:
    """A cross-checked run (as in result.json) of a mechanism at crank angles theta (N,) rad, and the tolerances it is
    held to.
    """

    mechanism: Mechanism
    theta: np.ndarray
    run: Mapping[str, Any]
    tolerances: Mapping[str, Any]

    def verdict(self) -> dict[str, Any]:
        """Whether model and simulation agree, at how much of the cycle, how they differ most, and which assumptions
        fail.
        """
        found = list(self.judged(self.run["simulated"], self.run["analytic"]))
        agreeing = np.all([ok for _, ok in found], axis=0) & ~self.flagged
        free = dict(self.run["free_share"])
        swings = not any(free.values()) and any(
            d.signal.startswith("clearance_") and d.verdict == "disagrees" for d, _ in found
        )
        out_of_step = swings or bool((self.flagged & ~self.unloaded).any())
        fails = {name: self.costs.get(name, 0.0) > 1 for name in ASSUMPTIONS} | {"contact": any(free.values())}
        fails["quasi-static"] |= out_of_step
        return {
            "verdict": "agrees" if agreeing.all() else "disagrees",
            "cause": None if agreeing.all() else self.cause(fails["contact"], out_of_step),
            "agreeing_share": float(agreeing.mean()),
            "free_share": free,
            "worst": _public(max((d for d, _ in found), key=excess), self.theta) if found else None,
            "fails": [name for name in ASSUMPTIONS if fails[name]],
            "cost": dict(self.costs),
            "swings": swings,
            "flagged_share": {
                "unloaded": float(np.mean(self.flagged & self.unloaded)),
                "unsteady": float(np.mean(self.flagged & ~self.unloaded)),
            },
            "give": self.give,
            "settings": {
                name: value for name, value in self.run["settings"].items() if name in ("contact_law", "step")
            },
        }

    def cause(self, contact_lost: bool, out_of_step: bool) -> str | None:
        """The assumption whose failure explains that the equilibrium disagrees; None if that of none does.

        ``out_of_step`` says that a pin is not where any equilibrium has it; else the larger of two known errors counts.
        """
        if contact_lost:
            return "contact"
        left = {
            "quasi-static": np.inf if out_of_step else self.costs["quasi-static-corrected"],
            "rigid": self.costs["rigid"],
        }
        largest = max(left, key=lambda name: left[name])
        return largest if left[largest] > 1 else None

    @cached_property
    def flagged(self) -> np.ndarray:
        """Angles (N,) at which the model has no answer."""
        flagged = np.zeros(self.theta.size, bool)
        flagged[[int(i) for i in self.run["flags"]]] = True
        return flagged

    @cached_property
    def unloaded(self) -> np.ndarray:
        """Angles (N,) at which a joint's reaction passes so near zero that it has no direction."""
        moved = self.equilibrium
        return np.any([np.abs(moved.ideal.forces[name]) <= moved.faint[name] for name in self.run["clearance"]], axis=0)

    @cached_property
    def stiffness(self) -> float:
        """Stiffness (N/m) of the contact; infinite where the run does not say it."""
        found = self.run["settings"].get("contact_stiffness")
        return float(found) if isinstance(found, int | float) else np.inf

    @cached_property
    def give(self) -> float:
        """How far (m) the contact yields under the simulation's peak force."""
        forces = [self.run["simulated"][f"reaction_{name}_magnitude"] for name in self.run["clearance"]]
        return float(np.nanmax(forces, initial=0.0)) / self.stiffness

    # ---------------------------------------------------------------- the model against itself

    @cached_property
    def equilibrium(self) -> Displaced:
        """The model that the simulation is held to."""
        return self.displaced("equilibrium")

    def displaced(self, model: Model, theta: np.ndarray | None = None) -> Displaced:
        """A model of the linkage, at the cell's crank angles or others (rad)."""
        at = self.theta if theta is None else theta
        return displaced(self.assembly, at, self.mechanism.speed or 0.0, model=model, clearances=self.run["clearance"])

    @cached_property
    def assembly(self) -> Assembly:
        """The ideal linkage, assembled once."""
        return Assembly(self.mechanism)

    @cached_property
    def costs(self) -> dict[str, float]:
        """What each assumption that the model makes about itself costs, 1 being the tolerance."""
        right = self.signals(self.equilibrium)
        still = {name: Gap(value) for name, value in self.equilibrium.gaps.items()}
        moving = self.signals(self.with_gaps(self.moving(np.inf)))
        return {
            "first-order": self.cost(self.signals(self.displaced("first_order")), right),
            "quasi-static": self.cost(self.signals(self.with_gaps(still)), right),
            "quasi-static-corrected": self.cost(moving, right),
            "rigid": self.cost(self.signals(self.with_gaps(self.moving(self.stiffness))), moving),
        }

    def with_gaps(self, gaps: Mapping[str, Gap]) -> Reactions:
        """Reactions of the linkage whose gaps move as given."""
        return kinetostatics(kinematics(self.assembly, self.theta, self.mechanism.speed or 0.0, gaps=gaps))

    @cached_property
    def beside(self) -> Displaced:
        """The equilibrium at three crank angles (rad) around each of the cell's."""
        return self.displaced("equilibrium", (self.theta + STENCIL * np.array([[-1.0], [0.0], [1.0]])).ravel())

    def moving(self, stiffness: float) -> dict[str, Gap]:
        """The equilibrium's gaps, larger by force over stiffness (N/m), and their rates by differences."""
        omega, out = self.mechanism.speed or 0.0, {}
        for name, gap in self.beside.gaps.items():
            before, here, after = (gap + self.beside.reactions.forces[name] / stiffness).reshape(3, -1)
            slope, bend = (after - before) / (2 * STENCIL), (after - 2 * here + before) / STENCIL**2
            out[name] = Gap(here, slope * omega, bend * omega**2)
        return out

    def signals(self, side: Displaced | Reactions) -> Signals:
        """Every signal (N,) of an analytic answer."""
        motion = self.equilibrium.ideal.motion
        return with_rotations(
            with_derived(side.signals(), self.mechanism),
            {body.name: motion.angle(body.name) for body in self.mechanism.bodies},
        )

    # ---------------------------------------------------------------- judging

    def judged(self, one: Signals, other: Signals) -> Iterator[tuple[Discrepancy, np.ndarray]]:
        """Every compared signal of one side held against the other's, and at which angles (N,) it is within
        tolerance.
        """
        sizes, scales = self.run["clearance"], Scales.of(other, self.mechanism)
        for name, kind in compared(self.mechanism, sizes).items():
            gap = sizes.get(name.removeprefix("clearance_")[:-2], max(sizes.values()))
            rule = Rule.read(self.tolerances, self.run["motion"], self.run["joint_model"], kind, scales, self.give, gap)
            found = judge(name, one, other, rule, self.theta)
            if found is not None:
                yield found, self.within(name, one, other, rule)

    def within(self, name: str, one: Signals, other: Signals, rule: Rule) -> np.ndarray:
        """Angles (N,) at which a signal is within its rule, or means nothing."""
        apart = one[name] - other[name]
        if rule.kind in ANGULAR:
            apart = (apart + np.pi) % (2 * np.pi) - np.pi
        tube = Tube.around(other[name], self.theta, rule.window)
        return ~(np.abs(apart) > rule.tolerance(name, other) + np.where(apart > 0, tube.above, tube.below))

    def cost(self, one: Signals, other: Signals) -> float:
        """The largest difference of one side from the other over what is allowed, at angles where both have an
        answer.
        """
        known = np.isfinite(one["drive_torque"]) & np.isfinite(other["drive_torque"]) & ~self.flagged
        sides = [{name: np.where(known, values, np.nan) for name, values in side.items()} for side in (one, other)]
        return max((excess(found) for found, _ in self.judged(*sides)), default=0.0) if known.any() else 0.0


def excess(found: Discrepancy) -> float:
    """A difference over its tolerance."""
    return abs(found.max) / max(found.tolerance, np.finfo(float).tiny)


def _public(found: Discrepancy, theta: np.ndarray) -> dict[str, Any]:
    return {
        "signal": found.signal, "unit": found.unit, "max": found.max, "tolerance": found.tolerance,
        "over_tolerance": excess(found), "at_crank_angle": float(theta[found.at]),
    }  # fmt: skip


__all__ = ["ASSUMPTIONS", "Cell", "examine", "excess"]

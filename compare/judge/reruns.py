"""Runs that are made again: finer where they disagree near a tolerance, longer where their averages have not converged.

An engine's own error falls with its step, and with the give of a contact whose stiffness this project chose; the error
of a model does not.  So a run that disagrees by little is made again, finer.  If the disagreement vanishes, it was the
engine's.  If it stays, it counts.  If it falls, a last run takes as fine a step as that fall asks for, within reason;
if it falls there too and does not vanish, the engine cannot decide, and the run has failed.

A contact that lets its pin far beyond the rim hides the clearance.  It is made harder where this project chose its
stiffness; the run has failed where the mechanism gives the stiffness, or the contact is still too soft.

A run in which pins strike goes on until its averages over revolutions have converged, as far as it is let.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from analytic.mechanism.signals import AXES, Signal
from compare.judge.contact import more_revolutions
from compare.judge.discrepancy import Rule
from compare.report.words.contact import no_longer_run
from compare.results.crosscheck import Discrepancy, Failure, Run
from sim_models.common.contact_laws import default_stiffness
from sim_models.common.failed_starts import STIFF_GIVE
from sim_models.engine import Cause, Request, Trace

if TYPE_CHECKING:
    from compare.results.analysis import Simulation  # a model that takes its time to be made

NEAR_TOLERANCE = 1e3  # tolerances: a run that is off by more is not off by its step
NEAR_LOOSE = 10.0  # tolerances, with clearance: pins that fly do so differently in every step
FINER_ROUNDS = 2
FINEST = 4  # halvings of a step in a last run, at most
FALLS = 0.6  # of a disagreement that is an engine's, at most, is left in a finer run
HARDER = 16.0  # times as stiff
SOFT_CONTACT = 0.5  # of a clearance: a pin that is seen farther beyond its rim hardly shows it
HIDDEN_CLEARANCE = 1.0  # of a clearance: a pin that is seen farther beyond its rim does not show it at all
LONGER_ROUNDS = 3  # of runs that are made longer
SHORT_TURN = 1e-6  # of a revolution, by which an engine's steps may end before it


@dataclass(frozen=True)
class JudgedRun:
    """A run that was judged: its trace, its entry in the result, and the rules that it was judged by."""

    trace: Trace
    run: Run
    rules: dict[str, Rule]

    @property
    def share(self) -> float:
        """The largest disagreement, in tolerances; 0 where the run agrees, infinite where no number says how far it is
        off.
        """
        shares = [math.inf if d.reason or d.share is None else d.share for d in self._off]
        return max(shares, default=0.0)

    @property
    def soft(self) -> float:
        """How far a pin is seen beyond its rim, in clearances."""
        return max((depth / self.run.clearance[joint] for joint, depth in beyond_rim(self.run).items()), default=0.0)

    @property
    def _off(self) -> list[Discrepancy]:
        return [d for d in self.run.discrepancies if d.verdict == "disagrees"]

    @property
    def words(self) -> str:
        """Which signal is off by most, in words."""
        worst = max(self._off, key=lambda d: d.share or 0.0)
        return f"{worst.signal} by {worst.max:.2g} {worst.unit}"


def settle(
    judged: Mapping[int, JudgedRun],
    requests: Mapping[int, Request],
    simulate: Callable[[Mapping[int, Request]], Mapping[int, Trace | Failure]],
    judge: Callable[[Trace], JudgedRun],
) -> tuple[dict[int, JudgedRun | Failure], dict[int, Request]]:
    """The runs, and what each of them was asked in the end; those that disagree by little are made again until they
    agree, no longer change, or have failed.

    ``requests`` are those of the runs that may be made again.
    """
    settled: dict[int, JudgedRun | Failure] = dict(judged)
    looking = {
        i: judgement
        for i, judgement in judged.items()
        if 0 < judgement.share <= (NEAR_LOOSE if judgement.trace.clearance else NEAR_TOLERANCE)
        or judgement.soft > SOFT_CONTACT
    }
    asked, halvings = dict(requests), dict.fromkeys(looking, 1)
    for round_ in range(1, FINER_ROUNDS + 1):
        again = {
            i: request
            for i, judgement in looking.items()
            if i in asked and (request := finer(asked[i], judgement.trace, halvings[i])) is not None
        }
        asked |= again
        outcomes = simulate(again) if again else {}
        before, looking = looking, {}
        for i, outcome in outcomes.items():
            if isinstance(outcome, Failure):
                settled[i] = _undecided(before[i], f"a finer run of it failed ({outcome.why})")
                continue
            judgement = judge(replace(outcome, settings={**outcome.settings, "refinements": round_}))
            settled[i] = judgement
            if judgement.soft > SOFT_CONTACT:
                looking[i] = judgement
            elif 0 < judgement.share <= FALLS * before[i].share:
                looking[i] = judgement
                wanted = math.log(judgement.share) / math.log(before[i].share / judgement.share)
                halvings[i] = min(max(math.ceil(wanted), 1), FINEST)
                settled[i] = _undecided(
                    judgement,
                    f"it was {before[i].share / judgement.share:.1f} times that in a coarser run, and still falls",
                )
    for i, run in settled.items():
        if isinstance(run, JudgedRun) and run.soft > HIDDEN_CLEARANCE:
            settled[i] = _too_soft(run)
    return settled, asked


def too_soft(run: Run | Simulation) -> Iterator[str]:
    """A warning for each pin whose path was seen to go so far beyond its clearance that this is hidden, whatever its
    contact is made of.
    """
    for joint, depth in beyond_rim(run).items():
        clearance = run.clearance[joint]
        if depth > SOFT_CONTACT * clearance:
            yield (
                f"{run.title}: the pin of joint {joint} is seen"
                f" {1e3 * depth:.2g} mm beyond its rim, {depth / clearance:.1f} times its clearance: too soft to"
                f" see this clearance; {stiff_enough(run, joint)}"
            )


def beyond_rim(run: Run | Simulation) -> dict[str, float]:
    """How far (m) each pin of a run is seen beyond the rim of its bearing, at its samples and on the way
    between them.
    """
    depths = {}
    for joint, clearance in run.clearance.items():
        if Signal("clearance", joint, "angle").name in run.simulated:  # a block's corners are not its point
            continue
        sides = [Signal("clearance", joint, axis).name for axis in AXES]
        path = [np.hypot(*(run.simulated[side] for side in sides))]
        path += [np.hypot(orbit.x, orbit.y) for name, orbit in run.journal.items() if name == joint]
        depths[joint] = float(np.nanmax(np.concatenate(path), initial=0.0)) - clearance
    return depths


def stiff_enough(run: Run | Simulation, joint: str) -> str:
    """The contact stiffness that lets a pin no farther than STIFF_GIVE of its clearance beyond its rim."""
    stiffness = run.settings.get("contact_stiffness")
    if not isinstance(stiffness, int | float):
        return f"give joint {joint} a higher contact_stiffness"
    wanted = stiffness * beyond_rim(run)[joint] / (STIFF_GIVE * run.clearance[joint])
    return f"give joint {joint} contact_stiffness = {wanted:.1e} (N/m) or more"


def _too_soft(judgement: JudgedRun) -> Failure:
    t, depths = judgement.trace, beyond_rim(judgement.run)
    joint = max(depths, key=lambda name: depths[name] / judgement.run.clearance[name])
    what = (
        f"{t.simulator} {t.joint_model} {t.motion}: contact too soft for this load: the pin of joint {joint} is seen"
        f" {depths[joint]:.2g} m"
    )
    times = f"{depths[joint] / judgement.run.clearance[joint]:.2g} times its clearance"
    why = f"{what} beyond its rim, {times}; {stiff_enough(judgement.run, joint)}, or a smaller load"
    return Failure(simulator=t.simulator, joint_model=t.joint_model, why=why, cause=Cause.TOO_SOFT)


def finer(request: Request, trace: Trace, halvings: int = 1) -> Request | None:
    """A run with a harder contact where this project chose its stiffness, else with a step that is halved so often;
    None where neither can be done.
    """
    m = request.mechanism
    ours = [name for name in trace.clearance if name in request.assumed or m.joint(name).contact_stiffness is None]
    if ours and ("contact_stiffness" in trace.settings or "bounce_time" in trace.settings):
        for name in ours:
            now = m.joint(name).contact_stiffness or default_stiffness(m, request.motion)
            m = m.with_joint(name, contact_stiffness=HARDER * now)
        return replace(request, mechanism=m, assumed=frozenset(ours))
    step = trace.step
    return replace(request, step=step / 2**halvings) if step and request.motion == "driven" else None


def _undecided(judgement: JudgedRun, why: str) -> Failure:
    t = judgement.trace
    error = f"{t.simulator} {t.joint_model} {t.motion}: {judgement.words} is its own error: {why}"
    cause = Cause.NOT_CONVERGED
    return Failure(simulator=t.simulator, joint_model=t.joint_model, why=f"{error}; {cause.remedy}", cause=cause)


# ---------------------------------------------------------------- longer


def prolong(
    judged: Mapping[int, JudgedRun | Failure],
    requests: Mapping[int, Request],
    simulate: Callable[[Mapping[int, Request]], Mapping[int, Trace | Failure]],
    judge: Callable[[Trace], JudgedRun],
    most: float,
) -> dict[int, JudgedRun | Failure]:
    """The runs, those whose statistics have not converged made again from their start, over more revolutions, ``most``
    at the utmost.  Where a longer run fails, the shorter one stays and says so.
    """
    ended, asked = dict(judged), dict(requests)
    for _ in range(LONGER_ROUNDS):
        again = {i: longer for i, one in ended.items() if i in asked and (longer := _longer(asked[i], one, most))}
        for i, outcome in (simulate(again) if again else {}).items():
            if isinstance(outcome, Trace):
                ended[i] = judge(outcome)
            else:
                ended[i] = _as_far(ended[i], outcome)
                del asked[i]
    return ended


def _as_far(shorter: JudgedRun | Failure, longer: Failure) -> JudgedRun | Failure:
    """A run that could not be prolonged, with the reason in its words."""
    if isinstance(shorter, Failure) or shorter.run.contact is None:
        return shorter
    contact = shorter.run.contact.model_copy(update={"words": no_longer_run(shorter.run.contact.words, longer.why)})
    return replace(shorter, run=shorter.run.model_copy(update={"contact": contact}))


def _longer(request: Request, shorter: JudgedRun | Failure, most: float) -> Request | None:
    """The request of a longer run; None where that is no use, or not allowed."""
    if isinstance(shorter, Failure) or shorter.run.contact is None or shorter.run.contact.revolutions < 1 - SHORT_TURN:
        return None
    contact = shorter.run.contact
    turns = min(math.ceil(more_revolutions(contact)), most)
    if turns < contact.revolutions + 0.5:
        return None
    return replace(request, beyond=math.tau * turns - span(request))


def span(request: Request) -> float:
    """How far (rad) the crank turns from the first report to the last one."""
    angles = request.schedule.crank_angle
    return 0.0 if angles is None else float(np.ptp(angles))

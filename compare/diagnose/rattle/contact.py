"""The law of contact that is asked for: where it can be looked for, and what the data say of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from analytic.mechanism import Mechanism
from analytic.mechanism.one_line import count
from compare.diagnose.data.recording import MeasuredError
from compare.diagnose.effects.effect import Rig
from compare.diagnose.effects.joints import ContactLaw, JointClearance
from compare.diagnose.intervals import Interval
from compare.diagnose.predict import Term
from compare.diagnose.rattle.law import LawSearch, Room, Simulate, Trial
from compare.diagnose.rattle.statistics import Key, Statistics
from compare.judge.statistics import NORMAL_95
from sim_models.engine import ENGINES, Unsupported, declared, engine

SILENT = (
    "A contact law is asked for, and these data do not tell it: they do not show that a pin leaves its bearing, which"
    " throws several sensors off at the same instants, in each revolution otherwise. Record faster or less loaded runs"
    " of three whole revolutions or more, at 100 samples of a revolution or more."
)


def asked(terms: Sequence[Term], ruled_out: Mapping[tuple[str, str], str]) -> list[Term]:
    """The laws of contact that are looked for."""
    return [t for t in terms if isinstance(t.effect, ContactLaw) and t.key not in ruled_out]


def lawless(
    terms: Sequence[Term],
    ruled_out: Mapping[tuple[str, str], str],
    mechanism: Mechanism,
    simulator: str,
    only: Sequence[str],
) -> dict[tuple[str, str], str]:
    """Laws of contact that are not looked for, and why: those of joints without clearance, unless that is looked for
    too.  Raises MeasuredError where none, or more than one, is left, or Unsupported for the engine.
    """
    laws = asked(terms, ruled_out)
    if not laws:
        return {}
    if not laws[0].effect.simulated_by(engine(simulator)):
        able = [name for name in ENGINES if laws[0].effect.simulated_by(declared(name))]
        raise Unsupported(
            f"{ContactLaw.name} is asked for, and the contact of {simulator} has no stiffness, restitution and friction"
            f" of its joint's own; choose `simulator` {' or '.join(able)}"
        )
    if any(isinstance(t.effect, JointClearance) and t.key not in ruled_out for t in terms):
        return {}
    able_joints = [t for t in laws if mechanism.joint(t.where).clearance]
    without = [t for t in laws if t not in able_joints]
    if not able_joints and not any(t.label in only for t in without):
        raise MeasuredError(
            f"{ContactLaw.name} is asked for, and no joint of {mechanism.name} has clearance; give it to one there"
            " (clearance), or ask for joint_clearance too"
        )
    for t in (t for t in without if t.label in only):
        raise MeasuredError(
            f"{t.label} is asked for, and joint {t.where} has no clearance in the mechanism; give it one there"
            " (clearance), or ask for joint_clearance too"
        )
    if len(able_joints) > 1:
        raise MeasuredError(
            f"contact_law is asked for in joints {' and '.join(t.where for t in able_joints)} at once; ask for one of"
            f" them: {able_joints[0].label}"
        )
    return {t.key: "the joint has no clearance" for t in without}


@dataclass(frozen=True)
class Found:
    """What was found of the law in a joint, with its clearance."""

    term: Term
    rig: Rig
    search: LawSearch

    @classmethod
    def of(
        cls,
        term: Term,
        rig: Rig,
        statistics: Statistics,
        simulate: Simulate,
        size: float,
        moves: bool,
        late: Callable[[], bool] = lambda: False,
    ) -> Found | None:
        """Look for the law in a joint with a clearance (m), which ``moves`` where it is not known; None where the
        engine has no answer.
        """
        assert isinstance(term.effect, ContactLaw)
        usual = term.effect.usual(rig, term.where)[1]
        search = LawSearch(statistics, simulate, Room(usual, size, moves), late)
        return cls(term, rig, search) if search.searched() else None

    @property
    def size(self) -> float:
        """The clearance (m)."""
        return self.search.room.at(self.search.answer.x)[1]

    @property
    def natural(self) -> np.ndarray:
        """Natural coordinates of the law."""
        law = self.search.room.at(self.search.answer.x)[0]
        return self.term.effect.natural(self.rig, self.term.where, law._asdict())

    def intervals(self) -> dict[str, Interval]:
        """The law with its 95 % intervals; where an end leaves what was tried, the interval is open, or goes as far as
        is physical.
        """
        room, best, wide = self.search.room, self.search.answer.x, NORMAL_95 * self.search.scatter()
        law, low, high = (room.at(x)[0] for x in (best, room.within(best - wide), room.within(best + wide)))
        under, over = best - wide < room.low, best + wide > room.high
        return {
            "restitution": Interval(
                law.restitution, 0.0 if under[0] else low.restitution, 1.0 if over[0] else high.restitution, "1"
            ),
            "stiffness": Interval(
                law.stiffness, -math.inf if under[2] else low.stiffness, math.inf if over[2] else high.stiffness, "N/m"
            ),
            "friction": Interval(law.friction, low.friction, math.inf if over[1] else high.friction, "1"),
        }

    def untold(self) -> list[str]:
        """Parameters of which the data say nothing: either end of their interval leaves what was tried."""
        room, best, wide = self.search.room, self.search.answer.x, NORMAL_95 * self.search.scatter()
        out = (best - wide <= room.low) & (best + wide >= room.high)
        return [name for name, k in (("restitution", 0), ("stiffness", 2), ("friction", 1)) if out[k]]

    def gains(self, misfit: float, less: Sequence[float]) -> float:
        """By how much the law lowers a misfit, and what it is with each group of revolutions left out: the least."""
        best = self.search.answer
        return min(each - best.misfit(None, g) for g, each in enumerate([misfit, *less]))

    def held_out(self, before: Mapping[Key, float]) -> tuple[float, float]:
        """Distances before, by sensor, and after on data that the law was not found with: each run in turn where there
        are three or more, else each group of revolutions.
        """
        s = self.search.statistics
        runs = list(s.turns) if len(s.turns) >= 3 else []
        chosen = [
            (self._best([key for key in s.floor if key[0] != out]), [key for key in s.floor if key[0] == out])
            for out in runs
        ]
        if not runs:
            chosen = [(self._best(None, 1 + group), list(s.floor)) for group in range(s.groups)]
        old = [float(np.mean([math.log(before[key]) for key in keys])) for _, keys in chosen]
        new = [best.misfit(keys) for best, keys in chosen]
        return math.exp(float(np.mean(old))), math.exp(float(np.mean(new)))

    def _best(self, keys: Sequence[Key] | None, without: int = 0) -> Trial:
        """The nearest trial by some sensors (None: all), or without a group of revolutions."""
        return min(self.search.trials, key=lambda each: each.misfit(keys, without))

    def told(self, simulator: str) -> str:
        """How it was found and what the data do not tell, in sentences."""
        laws = count(len(self.search.trials), "law")
        were = "was" if len(self.search.trials) == 1 else "were"
        text = f"{laws} of contact {were} simulated in joint {self.term.where} by {simulator}, with all revolutions."
        untold, found = self.untold(), self.intervals()["stiffness"]
        if untold:
            text += f" The data hardly answer to {' and '.join(untold)}."
        elif math.isinf(found.high) and math.isfinite(found.low):
            text += f" Of the stiffness they only tell that it is above {found.low:.2g} N/m."
        elif math.isinf(found.low) and math.isfinite(found.high):
            text += f" Of the stiffness they only tell that it is below {found.high:.2g} N/m."
        return text

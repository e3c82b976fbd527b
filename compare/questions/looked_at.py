"""Where a question looks at its linkage: at crank angles, at times along courses, or at times as it swings freely."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from analytic.kinematics.assembly import Assembly
from compare.arguments import crank_angles, over_time, timed
from compare.faults import ArgumentError
from compare.judge.courses import Courses
from compare.judge.grid import FREE_TIME
from compare.questions.analyse import AnalyseQuestion, ExportQuestion, SimulateQuestion
from compare.questions.crosscheck import CrosscheckQuestion

MovedQuestion = CrosscheckQuestion | AnalyseQuestion | SimulateQuestion | ExportQuestion


@dataclass(frozen=True)
class LookedAt:
    """Crank angles ``theta`` (N,) rad; or times (N,) s, along ``courses`` or, without them, of a free swing."""

    theta: np.ndarray = field(default_factory=lambda: np.zeros(0))
    time: np.ndarray | None = None
    courses: Courses | None = None

    @property
    def moved(self) -> tuple[np.ndarray, Courses] | None:
        """Times and courses, where drives follow these."""
        return None if self.time is None or self.courses is None else (self.time, self.courses)

    @property
    def swings(self) -> bool:
        """Whether the linkage swings freely."""
        return self.time is not None and self.courses is None


def looked_at(question: MovedQuestion, assembly: Assembly, *, may_swing: bool = True) -> LookedAt:
    """Where a question looks at its linkage.

    Raises ArgumentError for what that leaves no use for, and where a linkage swings freely and may not (``may_swing``);
    GridError, DataError or AssemblyError.
    """
    m = assembly.mechanism
    moved = timed(assembly, question.times, question.course, question.path)
    if moved is not None:
        over_time(assembly, question.motion, question.angles)
        return LookedAt(time=moved[0], courses=moved[1])
    if m.speed is not None or question.motion == "static":
        return LookedAt(crank_angles(assembly, question.angles))
    if not may_swing:
        raise ArgumentError("motion", f"the drive of {m.name} has no constant speed; ask for static motion")
    if question.angles is not None:
        raise ArgumentError("angles", f"{m.name} swings freely and is looked at over time; leave angles out")
    return LookedAt(time=FREE_TIME)

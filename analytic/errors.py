"""The base of every fault that is foreseen, and how one warns; it imports little, so that a command helps quickly."""

from __future__ import annotations

import sys
import warnings
from types import FrameType

# modules of these hold no line of whoever asks
WITHIN = ("analytic", "sim_models", "compare", "linkage_crosscheck", "contextlib", "pydantic")


class Error(Exception):
    """Base of every fault that is foreseen; its message is one sentence that says what is wrong and what to do.

    Each is a ValueError too, or a RuntimeError where a simulator is missing or fails.
    """

    def _render_traceback_(self) -> list[str]:
        """What a notebook shows: the line of whoever called into these packages, and the sentence."""
        import traceback

        steps = list(traceback.walk_tb(self.__traceback__))
        first = next((k for k, (frame, _) in enumerate(steps) if _within(frame)), len(steps))
        asked = traceback.StackSummary.extract(iter(steps[max(first - 1, 0) : first]))
        return [*"".join(asked.format()).splitlines(), f"{type(self).__name__}: {self}"]


def _within(frame: FrameType) -> bool:
    """Whether a frame is of these packages, or of one through which they are called."""
    return str(frame.f_globals.get("__name__")).partition(".")[0] in WITHIN


def warn(text: str, category: type[Warning] = UserWarning) -> None:
    """Warn at the line of whoever called into these packages."""
    level, frame = 1, sys._getframe()
    while frame.f_back is not None and _within(frame):
        level, frame = level + 1, frame.f_back
    warnings.warn(text, category, stacklevel=level)

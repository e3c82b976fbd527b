"""Faults of a data file, a sentence each."""

from __future__ import annotations

from collections.abc import Sequence

from analytic.errors import Error

MOST_FAULTS = 8  # faults of a message


class DataError(Error, ValueError):
    """A data file cannot be used: each fault is one sentence with file, line or column, value and remedy."""

    def __init__(self, *faults: str) -> None:
        super().__init__(*faults)
        self.faults = faults

    def __str__(self) -> str:
        if len(self.faults) == 1:
            return self.faults[0]
        head, *faults = first_faults(self.faults)
        return f"{head} {'; '.join(faults)}"


def first_faults(faults: Sequence[str]) -> list[str]:
    """The first faults, and how many more there are."""
    more = len(faults) - MOST_FAULTS
    head = f"{len(faults)} faults" + (f", the first {MOST_FAULTS} of them:" if more > 0 else ":")
    return [head, *faults[:MOST_FAULTS]]

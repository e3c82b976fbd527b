"""The diagnosis from end to end: measured data in; where it disagrees, what is missing, and how far that closes the gap
out.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from analytic.mechanism import Mechanism, MechanismWarning
from compare.diagnose.bench import Bench, Progress
from compare.diagnose.data.recording import Measured
from compare.diagnose.effects.effect import Effect
from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.diagnose.explain import Explanation
from compare.diagnose.result import as_result


@dataclass(frozen=True)
class Diagnosis:
    """What a diagnosis found; ``result`` is the content of diagnosis.json and ``explained`` the mechanism with the
    effects.
    """

    result: dict[str, Any]
    explained: Mechanism
    explanation: Explanation


@contextmanager
def _trying() -> Iterator[None]:
    """Not a word on the sizes of links that a fit only tries."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MechanismWarning)
        yield


@_trying()
def diagnose(
    measured: Measured,
    simulator: str,
    *,
    only: Sequence[str] = (),
    exclude: Sequence[str] = (),
    own: Sequence[Effect] = (),
    others: bool = True,
    workers: int | None = None,
    command: str = "",
    progress: Progress = lambda what, done, total: None,
) -> Diagnosis:
    """Find which effects the data want that the mechanism lacks.

    ``only`` and ``exclude`` are ``effect`` or ``effect@where``; ``own`` are effects beside the vocabulary.  With
    ``others`` every installed engine simulates the explanation too.  Raises MeasuredError for data that cannot be what
    they say, Unsupported or SimulatorMissing for the simulator, SimulationError where it fails on the nominal
    mechanism.
    """
    vocabulary = VOCABULARY | {e.name: e for e in own}
    stiff = measured.mechanism.rigid()
    bench = Bench.of(measured, stiff, simulator, vocabulary, only, exclude, others, workers, progress)
    explanation = bench.settled()
    if stiff != measured.mechanism and bench.sees(measured.mechanism):
        bending = Bench.of(
            measured, measured.mechanism, simulator, vocabulary, only, exclude, others, workers, progress
        )
        instead = bending.settled()
        nearer = bending.price(instead) < bench.price(explanation)
        bench, explanation = (bending, instead) if nearer else (bench, explanation)
        bench.notes.append(
            f"The links' stated moduli of elasticity are {'used' if nearer else 'left out'}: that explains the data"
            " with less."
        )
    found = bench.confirmed(explanation)
    return Diagnosis(as_result(bench, found, command), found.explained, found.explanation)

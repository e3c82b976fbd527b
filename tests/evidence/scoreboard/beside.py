"""The posterior over sets of effects beside the search, which decides in released runs: both on the same hidden sets.

``python -m tests.evidence.scoreboard.beside SEED [SEED ...]`` draws and records each set, has both diagnose it, scores
both, and prints a line for each: outcome, what is named with its probability, and processor time.  The
search goes when the posterior is no worse in released runs.
"""

from __future__ import annotations

import sys
import tempfile
import time
import warnings
from pathlib import Path

from compare.diagnose.data.measured import load_measured
from compare.diagnose.problem import Options
from compare.diagnose.workflow import diagnosis_of
from compare.results.diagnosis import Diagnosis
from tests.evidence.results.scoreboard import Truth
from tests.evidence.scoreboard.record import make_set
from tests.evidence.scoreboard.score import opened, score


def diagnosed(data: Path, truth: Truth, posterior: bool) -> Diagnosis:
    """The diagnosis of a set, by the engine that is to make it and without the words that are not to be used."""
    exclude = () if truth.outside is None else truth.outside.excluded
    options = Options(truth.simulator, exclude=exclude, others=False, workers=1, posterior=posterior)
    return diagnosis_of(load_measured(data / "measured.toml"), options)[0]


def told(data: Path, truth: Truth, posterior: bool) -> str:
    """How a diagnosis of a recorded set did, in a line."""
    began = time.process_time()
    found = diagnosed(data, truth, posterior)
    scored = score(found, truth)
    named = ", ".join(
        effect.key + ("" if effect.probability is None else f" {effect.probability:.2f}") for effect in found.effects
    )
    good = "right" if scored.good else "not right"
    return f"{scored.outcome} ({good}), {named or 'nothing'} in {time.process_time() - began:.1f} s"


def main(seeds: list[int]) -> None:
    """Both diagnoses of the sets of these seeds, a line each."""
    warnings.simplefilter("ignore")
    for seed in seeds:
        with tempfile.TemporaryDirectory() as folder:
            data, seal = Path(folder, "data"), Path(folder, "seal")
            make_set(seed, data, seal)
            truth = opened(seal)
            hidden = ", ".join(e.key for e in truth.effects) or "nothing"
            hidden = hidden if truth.outside is None else f"{truth.outside.kind} in {truth.outside.where}"
            print(f"{seed} {truth.kind}: {hidden}")
            for posterior in (False, True):
                print(f"  {'posterior' if posterior else 'search':9} {told(data, truth, posterior)}", flush=True)


if __name__ == "__main__":
    main([int(seed) for seed in sys.argv[1:]])

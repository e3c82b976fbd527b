"""The posterior over sets of effects beside the diagnosis that decides today: both on the same hidden sets.

``python -m tests.evidence.scoreboard.beside SEED [SEED ...]`` draws and records each set, has both diagnose it, and
prints a line for each: outcome and processor time of the one, and of the other with its probabilities.  The posterior
takes the place of the search when it is worse on no kind of set.
"""

from __future__ import annotations

import sys
import tempfile
import time
import warnings
from dataclasses import dataclass
from pathlib import Path

from compare.diagnose.data.measured import load_measured
from compare.diagnose.posterior.infer import Inference, Posterior
from compare.diagnose.posterior.prior import CREDIBLE
from compare.diagnose.prepare import on_one_turn
from compare.diagnose.problem import RECOLOURED, Options, Problem
from compare.diagnose.validation import parted
from tests.evidence.results.scoreboard import Truth
from tests.evidence.scoreboard.board import scored
from tests.evidence.scoreboard.record import make_set
from tests.evidence.scoreboard.score import of_sensor, opened

LIKELY = 0.5  # probability from which on an effect of the best set counts as named


@dataclass(frozen=True)
class Told:
    """What the posterior says of a set: true effects that it names or ties with, false ones of the rig, and how."""

    found: int
    of: int
    false: tuple[str, ...]
    named: dict[str, float]
    unknown: str
    seconds: float

    def __str__(self) -> str:
        named = ", ".join(f"{label} {share:.2f}" for label, share in self.named.items()) or "nothing"
        false = f"; false: {', '.join(self.false)}" if self.false else ""
        return f"{self.found} of {self.of} in {self.seconds:.1f} s: {named}{self.unknown}{false}"


def posterior_of(data: Path, truth: Truth) -> Posterior:
    """Of a recorded set, by the engine that is to diagnose it and without the words that are not to be used."""
    exclude = () if truth.outside is None else truth.outside.excluded
    measured, _ = parted(on_one_turn(load_measured(data / "measured.toml")))
    options = Options(truth.simulator, exclude=exclude, others=False, workers=1)
    problem = Problem.of(measured, measured.mechanism.rigid(), options)
    found = Inference(problem.fitter, problem.base, problem.sought).posterior()
    for _ in range(RECOLOURED):
        if not problem.coloured(found.judged):
            break
        again = Inference(problem.fitter, problem.base, problem.sought, before=found)
        found = again.posterior([found.best.fit])
    return found


def told(data: Path, truth: Truth) -> Told:
    """What the posterior says of a recorded set, held against its truth."""
    began = time.process_time()
    found = posterior_of(data, truth)
    true = {(e.name, e.where) for e in truth.effects}
    slight = {(f.name, f.where) for f in (*truth.slight, *truth.faults)}
    nothing = found.sets.get(frozenset(), 0.0) > CREDIBLE
    shares = {key: found.instead(key) for key in found.keys}
    tied = {key: {other for other, share in each.items() if share >= CREDIBLE} for key, each in shares.items()}
    named = {key for key in found.keys if not nothing and found.probability(key) + sum(shares[key].values()) >= LIKELY}
    said = named.union(*(tied[key] for key in named))
    named.discard(found.best.nameless or ("", ""))
    false = [key for key in named if not of_sensor(key[0]) and not ({key} | tied[key]) & (true | slight)]
    return Told(
        len(true & said),
        len(true),
        tuple("@".join(key) for key in false),
        {"@".join(key): found.probability(key) for key in sorted(named)},
        f" and {'@'.join(found.best.nameless)} {found.probability(found.best.nameless):.2f}"
        if found.best.nameless
        else "",
        time.process_time() - began,
    )


def main(seeds: list[int]) -> None:
    """Both diagnoses of the sets of these seeds, a line each."""
    warnings.simplefilter("ignore")
    for seed in seeds:
        with tempfile.TemporaryDirectory() as folder:
            data, seal = Path(folder, "data"), Path(folder, "seal")
            make_set(seed, data, seal)
            truth, began = opened(seal), time.process_time()
            today = scored(data, seal)
            seconds = time.process_time() - began
            names = ", ".join(e.key for e in truth.effects) or "nothing"
            print(
                f"{seed} {truth.kind} ({names}): today {today.outcome} in {seconds:.1f} s; {told(data, truth)}",
                flush=True,
            )


if __name__ == "__main__":
    main([int(seed) for seed in sys.argv[1:]])

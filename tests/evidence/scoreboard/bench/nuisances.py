"""What sensors may be wrong by, as columns (N, k) over noise: free to move when the size of an effect is judged."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.diagnose.predict import Term
from tests.evidence.scoreboard.bench.sigmas import Ruler
from tests.evidence.scoreboard.rigs import Experiment, Plan


def of_channels(experiment: Experiment, waves: int, signals: Iterable[str] | None = None) -> np.ndarray:
    """A constant of each channel in each run; with ``waves`` its slope and as many half waves over the run too."""
    wanted = set(experiment.noise if signals is None else signals)
    columns = []
    for plan, signal, part in _parts(experiment):
        if signal not in wanted:
            continue
        x = (plan.time - plan.time[0]) / np.ptp(plan.time)
        shapes = [np.ones_like(x), *([x] if waves else []), *(np.cos(np.pi * h * x) for h in range(1, waves + 1))]
        for shape in shapes:
            column = np.zeros(_size(experiment))
            column[part] = shape / experiment.noise[signal]
            columns.append(column)
    return np.column_stack(columns) if columns else np.zeros((_size(experiment), 0))


def lagging(ruler: Ruler, group: Iterable[str]) -> np.ndarray:
    """One small delay of all channels of a group."""
    group, column = set(group), np.zeros(_size(ruler.experiment))
    for _, signal, part, slope in _slopes(ruler):
        if signal in group:
            column[part] = -slope
    return column[:, None]


def late_clocks(ruler: Ruler) -> np.ndarray:
    """A small delay of all channels of each run."""
    columns = {plan.name: np.zeros(_size(ruler.experiment)) for plan in ruler.experiment.plans}
    for plan, _, part, slope in _slopes(ruler):
        columns[plan.name][part] = -slope
    return np.column_stack(list(columns.values()))


def encoder_zeros(ruler: Ruler) -> np.ndarray:
    """A zero of the encoder in each run."""
    effect = VOCABULARY["encoder_offset"]
    names, small = [p.name for p in ruler.experiment.plans], 1e-4
    asked = [[(Term(effect, ruler.experiment.encoder), {f"offset@{run}": small})] for run in names]
    return np.column_stack([(f - ruler.nominal) / small for f in ruler.readings(asked) if f is not None])


def _slopes(ruler: Ruler) -> Iterator[tuple[Plan, str, slice, np.ndarray]]:
    for plan, signal, part in _parts(ruler.experiment):
        yield plan, signal, part, np.gradient(ruler.nominal[part], plan.time)


def _parts(experiment: Experiment) -> Iterator[tuple[Plan, str, slice]]:
    """Where each channel is in all readings."""
    start = 0
    for plan in experiment.plans:
        for signal in experiment.noise:
            yield plan, signal, slice(start, start + plan.time.size)
            start += plan.time.size


def _size(experiment: Experiment) -> int:
    return sum(plan.time.size for plan in experiment.plans) * len(experiment.noise)

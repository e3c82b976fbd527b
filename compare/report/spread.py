"""How readings are spread in each part of a revolution, as rows: what a rig that rattles is judged by."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from analytic.mechanism.signals import wrapped
from compare.diagnose.rattle.statistics import QUANTILES, SEED, quantiles
from compare.diagnose.rattle.turns import TURNS, Turns
from compare.results.diagnosis import SIDES, DiagnosedRun, Diagnosis
from compare.results.document import Row

Noise = Mapping[str, np.random.Generator]


def rows(result: Diagnosis) -> list[Row]:
    """See :meth:`compare.results.diagnosis.Diagnosis.quantiles_frame`."""
    cranked = result.mechanism.cranked and not result.mechanism.several
    runs = [run for run in result.runs if run.drive in ("speed", "measured")] if cranked else []
    noise: Noise = {side: np.random.default_rng(SEED) for side in SIDES}
    found = [
        row for run in runs if (turns := Turns.enough(run.crank_angle)) for row in _of_run(result, run, turns, noise)
    ]
    if not found:
        raise KeyError(f"{result.case}: no run turns a crank {TURNS} times; quantiles are over whole revolutions")
    return found


def _of_run(result: Diagnosis, run: DiagnosedRun, turns: Turns, noise: Noise) -> Iterator[Row]:
    """A row for each sensor, part of a revolution and quantile."""
    table, encoders = turns.table(), {each.name for each in result.mechanism.encoders}
    for name, channel in run.signals.items():
        round_ = result.wraps(name)
        if name in encoders or (round_ and result.mechanism.clearances):
            continue
        simulated = (("before", channel.before), ("after", channel.after))
        usual = np.zeros(1) if result.mechanism.clearances else channel.before
        sides = {side: values + channel.noise * noise[side].standard_normal(values.size) for side, values in simulated}
        off = {side: values - usual for side, values in {"measured": channel.measured, **sides}.items()}
        told = {side: quantiles(wrapped(values) if round_ else values, table) for side, values in off.items()}
        for part, k in np.ndindex(turns.bins, QUANTILES.size):
            begin, end = (math.tau * edge / turns.bins for edge in (part, part + 1))
            head: Row = {"run": run.name, "signal": name, "unit": channel.unit, "quantile": float(QUANTILES[k])}
            numbers = ((side, float(each[part, k])) for side, each in told.items())
            known = {side: value if math.isfinite(value) else None for side, value in numbers}
            yield {**head, "crank_angle_from": begin, "crank_angle_to": end, **known}

"""Validation metrics of a diagnosis, and of results that were checked, as rows of a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from compare.quantities import DASH, fitting, plainly
from compare.report.words.effects import spoken
from compare.results.band import Metrics
from compare.results.crosscheck import Run
from compare.results.diagnosis import Diagnosis


def trusted(result: Diagnosis) -> list[tuple[str, ...]]:
    """A row for each sensor of each validation run, all lengths, angles, forces and torques of it in one unit."""
    rows: list[tuple[str, ...]] = []
    for run in result.validation:
        for name, record in run.signals.items():
            m, band = record.metrics, run.prediction.get(name)
            if m is None or band is None:
                continue
            covered = DASH if band.covered is None else f"{100 * band.covered:.0f} %"
            rows.append((*_row(f"{run.name}: {spoken(result, name)}", m), covered))
    return rows


class Checked(NamedTuple):
    """Validation metrics of a signal of a run, as a table has them, in its unit."""

    title: str
    unit: str
    error_mean: str
    error_rms: str
    u_d: str
    u_num: str
    u_input: str
    u_val: str
    within: str
    model_error: str
    area: str


def checked(runs: Sequence[Run], titles: Mapping[str, str]) -> list[Checked]:
    """A row for each signal of each run that has a title, and metrics of which the uncertainty is known: of results
    with all their digits, without noise, there is nothing to hold an error against.
    """
    told = [(run.title, name, m) for run in runs for name, m in run.metrics.items() if name in titles and m.u_val]
    return [_row(f"{run}: {titles[name]}", m) for run, name, m in told]


def _row(title: str, m: Metrics) -> Checked:
    """A signal's metrics in its unit."""
    unit, factor = fitting(m.unit, m.u_val, m.error_rms)
    low, high = (plainly(factor * end, 2) for end in m.model_error)
    sizes = (m.error_mean, m.error_rms, m.u_d, m.u_num, m.u_input, m.u_val, m.area)
    mean, rms, u_d, u_num, u_input, u_val, area = (plainly(factor * size, 2) for size in sizes)
    within = f"{100 * m.within:.0f} %"
    return Checked(title, unit, mean, rms, u_d, u_num, u_input, u_val, within, f"{low} to {high}", area)

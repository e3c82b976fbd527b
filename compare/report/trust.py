"""Validation metrics of a diagnosis as rows of a table."""

from __future__ import annotations

from compare.quantities import DASH, fitting, plainly
from compare.report.words.effects import spoken
from compare.results.diagnosis import Diagnosis


def trusted(result: Diagnosis) -> list[tuple[str, ...]]:
    """A row for each sensor of each validation run, all lengths, angles, forces and torques of it in one unit."""
    rows = []
    for run in result.validation:
        for name, record in run.signals.items():
            m, band = record.metrics, run.prediction.get(name)
            if m is None or band is None:
                continue
            unit, factor = fitting(m.unit, m.u_val, m.error_rms)
            low, high = (plainly(factor * end, 2) for end in m.model_error)
            sizes = (m.error_mean, m.error_rms, m.u_d, m.u_num, m.u_input, m.u_val)
            covered = DASH if band.covered is None else f"{100 * band.covered:.0f} %"
            rows.append(
                (
                    f"{run.name}: {spoken(result, name)}",
                    unit,
                    *(plainly(factor * size, 2) for size in sizes),
                    f"{100 * m.within:.0f} %",
                    f"{low} to {high}",
                    plainly(factor * m.area, 2),
                    covered,
                )
            )
    return rows

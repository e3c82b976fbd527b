"""Validation metrics of a signal: simulated less measured values, over what is known of both (ASME V&V 20, 2009)."""

from __future__ import annotations

import math

import numpy as np

from compare.results.band import Metrics

COVERAGE = 2.0  # standard uncertainties, k of ASME V&V 20


def metrics(
    unit: str,
    error: np.ndarray,
    measured: np.ndarray,
    noise: float,
    *,
    calibration: float = 0.0,
    u_num: float = 0.0,
    u_input: float = 0.0,
) -> Metrics | None:
    """The metrics of a signal from E = S - D and D (N,), NaN where either is silent; None where nothing is known.

    ``noise`` is of each reading by itself, ``calibration`` of all alike; these, ``u_num`` and ``u_input`` are standard
    uncertainties, all in the signal's SI unit.
    """
    known = np.isfinite(error) & np.isfinite(measured)
    if not known.any():
        return None
    e, read = error[known], measured[known]
    u_val = math.hypot(noise, calibration, u_num, u_input)
    shared = math.hypot(noise / math.sqrt(e.size), calibration, u_num, u_input)
    mean = float(np.mean(e))
    return Metrics(
        unit=unit,
        error_mean=mean,
        error_rms=rms(e),
        u_d=math.hypot(noise, calibration),
        u_calibration=calibration,
        u_num=u_num,
        u_input=u_input,
        u_val=u_val,
        within=float(np.mean(np.abs(e) <= COVERAGE * u_val)),
        model_error=(mean - COVERAGE * shared, mean + COVERAGE * shared),
        area=float(np.mean(np.abs(np.sort(read + e) - np.sort(read)))),  # a turn more of an angle counts as none
    )


def rms(values: np.ndarray) -> float:
    """Root mean square of what is known (not NaN) of values (N,); 0 where nothing is."""
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if known.size else 0.0

"""Rates of bodies among an engine's samples, and out of them again."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from sim_models.engine import Rates

RATE_COLUMNS = ("velocity x", "velocity y", "acceleration x", "acceleration y", "angular acceleration")


def rate_columns(body: str, velocity: complex, acceleration: complex, turning: float) -> dict[str, float]:
    """A body's rates at one instant, named so that they go along with its signals."""
    values = velocity.real, velocity.imag, acceleration.real, acceleration.imag, turning
    return {f"{body}: {name}": float(value) for name, value in zip(RATE_COLUMNS, values, strict=True)}


def part_rates(columns: Mapping[str, np.ndarray]) -> tuple[dict[str, np.ndarray], dict[str, Rates]]:
    """Signals and rates of samples (N,) in which both are."""
    found: dict[str, list[np.ndarray]] = {}
    for name in columns:
        body, _, column = name.partition(": ")
        if column == RATE_COLUMNS[0]:
            found[body] = [columns[f"{body}: {each}"] for each in RATE_COLUMNS]
    rates = {body: Rates(vx + 1j * vy, ax + 1j * ay, turning) for body, (vx, vy, ax, ay, turning) in found.items()}
    return {name: values for name, values in columns.items() if ": " not in name}, rates

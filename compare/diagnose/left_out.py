"""Data left out: how well a fit foretells what it was not fitted to."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from compare.diagnose.fit import Fit
from compare.diagnose.residuals import FOLDS, Data

RUNS = 3  # from which on whole runs are left out


def foretold(data: Data, fit: Fit, weights: np.ndarray) -> float:
    """-2 log of how likely the data of each fold are, as foretold from all others with what these leave open; less for
    a better fit.

    Coordinates that the others do not determine are foretold as anything that is no larger than the whole residual.
    """
    root = np.sqrt(weights)
    residual, columns = fit.residual * root, fit.jacobian[:, ~fit.bound] * root[:, None]
    norm = np.linalg.norm(columns, axis=0)
    columns = columns[:, norm > 0] / norm[norm > 0]
    loose = np.eye(columns.shape[1]) / max(float(residual @ residual), 1.0)
    total = 0.0
    for here in folds(data):
        known = columns[~here].T @ columns[~here] + loose
        mine = columns[here].T @ columns[here]
        # about the fit the others' optimum is off by: known^-1 columns[~here]^T residual[~here]
        step = np.linalg.solve(known, columns[~here].T @ residual[~here])
        left = residual[here] - columns[here] @ step
        pull = columns[here].T @ left
        total += float(left @ left - pull @ np.linalg.solve(known + mine, pull))
        total += float(np.linalg.slogdet(known + mine)[1] - np.linalg.slogdet(known)[1])
    return total


def folds(data: Data) -> Iterator[np.ndarray]:
    """Masks (size,) of what is left out together: whole runs where there are enough, else whole revolutions, else
    segments.
    """
    runs = _run_of(data)
    of = runs if len(np.unique(runs)) >= RUNS else data.fold if data.turn is None else data.turn
    for value in np.unique(of):
        yield of == value


def _run_of(data: Data) -> np.ndarray:
    run = np.zeros(data.size, int)
    for part in data.parts:
        run[part.place] = part.run
    return run


def held_out(data: Data, fit: Fit) -> np.ndarray:
    """Residual (size,) of each block with the coordinates refitted to all other blocks (about the fit, to first
    order).
    """
    columns = fit.jacobian[:, ~fit.bound]
    norm = np.linalg.norm(columns, axis=0)
    columns = columns[:, norm > 0] / norm[norm > 0]
    out = fit.residual.copy()
    for fold in range(FOLDS if columns.shape[1] else 0):
        rest, here = data.fold != fold, data.fold == fold
        matrix = columns[rest].T @ columns[rest] + 1e-9 * np.eye(columns.shape[1])
        out[here] -= columns[here] @ np.linalg.solve(matrix, columns[rest].T @ fit.residual[rest])
    return out

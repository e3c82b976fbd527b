"""What an effect must do to be named, each test with what it asks and what it found.

It must bring more than chance, weigh in the disagreement that there is, and foretell data that it was not fitted to.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from compare.diagnose.fit import Fit
from compare.diagnose.noise import CLOSED, rms
from compare.diagnose.residuals import FOLDS, Data
from compare.diagnose.search import Search

HELD_OUT = 9.0  # of chi^2 on data left out that an effect must bring
HALF = 0.5  # share of a sensor's excess that an effect must remove, in two runs, where something else remains
WHOLE = 0.05  # or this share of the whole weighted excess, or half of what is left of it
HARDLY = 0.01  # of what is left of the excess, all samples alike: a smaller share explains nothing
TWICE = 2  # runs
RUNS = 3  # from which on whole runs are left out


@dataclass(frozen=True)
class Trial:
    """A fit beside the same without one of its effects.

    ``gain`` is the weighted decrease of chi^2 that the effect brings, ``asked`` what it must bring at least, and
    ``foretold`` the decrease on data left out; ``share`` is that of the whole weighted excess, ``left`` that of what
    there is of it without the effect; ``sensors`` are those of whose excess it removes half in runs enough; ``noise``,
    that it only scatters and the gap is closed without it.
    """

    gain: float
    asked: float
    foretold: float
    share: float
    left: float
    sensors: tuple[str, ...]
    closed: bool
    noise: bool = False

    @property
    def failed(self) -> str:
        """Which test the effect fails, and by how much; empty where it fails none."""
        if self.gain < self.asked:
            return (
                f"it is worth {_sigmas(self.gain)}, and chance alone among so many candidates gives"
                f" {_sigmas(self.asked)}"
            )
        if self.noise:
            return "without it the gap is closed: it is no more than noise"
        if self.foretold < HELD_OUT:
            return (
                f"it does not foretell data that it was not fitted to ({_sigmas(self.foretold)},"
                f" {_sigmas(HELD_OUT)} are asked)"
            )
        if (
            not self.closed
            and self.left < HALF
            and not self.sensors
            and min(self.share / WHOLE, self.left / HARDLY) < 1
        ):
            return (
                f"it takes {100 * self.share:.2g} % of the weighted disagreement away ({100 * WHOLE:.0f} % are asked),"
                f" and {100 * max(self.left, 0.0):.2g} % of what the others leave ({100 * HARDLY:.0f} % is asked), less"
                " than half of any sensor's in two runs: something larger remains"
            )
        return ""


def _sigmas(chi2: float) -> str:
    return f"{math.copysign(math.sqrt(abs(chi2)), chi2):.3g} sigma"


def tried(search: Search, fit: Fit, less: Fit, i: int, weights: np.ndarray, told: float | None = None) -> Trial:
    """The trial of the i-th effect of a fit; ``less`` is the best fit without it, ``told`` how well the fit foretells,
    if that is known.
    """
    data = search.fitter.data
    gain = float(weights @ (less.residual**2 - fit.residual**2))
    excess = weights * (search.base.residual**2 - 1.0)
    whole = sum(max(0.0, float(excess[part.place].sum())) for part in data.parts)
    return Trial(
        gain,
        search.cost[fit.terms[i]],
        foretold(data, less, weights) - (foretold(data, fit, weights) if told is None else told),
        gain / whole if whole > 0 else 1.0,
        (less.chi2 - fit.chi2) / max(less.chi2 - less.residual.size, 1e-300),
        halved(data, less, fit, cells=not fit.terms[i].effect.sensor),
        rms(fit.residual) <= CLOSED,
        fit.terms[i].effect.scatters and rms(less.residual) <= CLOSED,
    )


def halved(data: Data, less: Fit, fit: Fit, cells: bool) -> tuple[str, ...]:
    """Sensors of whose excess over the noise a fit removes half in two runs, or in the only run that has any; with
    ``cells`` all that a joint's load cell reads is one sensor.
    """
    squares: dict[tuple[str, int], np.ndarray] = {}  # size, before, after
    for part in data.parts:
        signal = data.measured.signals[part.signal]
        sensor = signal.owner if cells and signal.kind == "reaction" else signal.name
        of = squares.setdefault((sensor, part.run), np.zeros(3))
        of += [part.used.size, *(float(f.residual[part.place] @ f.residual[part.place]) for f in (less, fit))]
    found: dict[str, list[bool]] = {}
    for (sensor, _), (size, before, after) in squares.items():
        if before > CLOSED**2 * size:
            found.setdefault(sensor, []).append(before - after >= HALF * (before - size))
    return tuple(sensor for sensor, runs in found.items() if sum(runs) >= min(TWICE, len(runs)))


# ---------------------------------------------------------------- data left out


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

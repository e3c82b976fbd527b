"""How far a column's numbers may be off because the file gives them with so many digits."""

from __future__ import annotations

import numpy as np

from compare.recorded.quantum import quantum

FEWEST_DIGITS, MOST_DIGITS = 2, 9  # significant digits that are looked for
DECIMALS = 12  # at most, that are told
LEAST_NUMBERS = 16  # numbers, by which they are told
DIGIT_ACCURACY = 1e-9  # of the last digit


def rounding(readings: np.ndarray) -> np.ndarray:
    """By how much each reading (N,) may be off: half of the step that all are multiples of, or half of its own last
    digit where all have so many significant digits (``%.4g``, ``%.5E``); 0 where neither shows.
    """
    return np.maximum(quantum(readings), _last_digit(readings)) / 2


def decimal(readings: np.ndarray) -> float:
    """One of the last decimal that readings (N,) are written with, 1e-3 of 0.25 and 0.125; 0 where they have more than
    can be told.
    """
    for decimals in range(DECIMALS + 1):
        last = 10.0**-decimals
        if np.all(np.abs(readings / last - np.round(readings / last)) < 1e-6):
            return last
    return 0.0


def _last_digit(readings: np.ndarray) -> np.ndarray:
    """(N,) one of the last digit of numbers with so many significant ones; 0 if there is no such number of digits, or
    if decimals explain them as well.
    """
    nothing = np.zeros(readings.shape)
    present = np.isfinite(readings) & (readings != 0)
    sizes = np.abs(readings[present])
    if sizes.size < LEAST_NUMBERS:
        return nothing
    decade = np.floor(np.log10(sizes) + 1e-12)
    for digits in range(FEWEST_DIGITS, MOST_DIGITS + 1):
        last = 10.0 ** (decade - digits + 1)
        if np.all(np.abs(sizes / last - np.round(sizes / last)) < DIGIT_ACCURACY * sizes / last + 1e-6):
            break
    else:
        return nothing
    coarse, small = last.max(), sizes[last < last.max()]
    finer = np.abs(small / coarse - np.round(small / coarse)) > 1e-6
    if small.size < LEAST_NUMBERS / 2 or np.mean(finer) < 0.5:
        return nothing
    nothing[present] = last
    return nothing

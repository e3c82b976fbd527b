"""Limits and fits of ISO 286 for a pin in its bore: ``H7/g6`` at a diameter gives the clearance between them.

Numbers are those of ISO 286-1:2010 (the same in ISO 286-2, ANSI B4.2 and DIN 7154), in micrometres, for nominal sizes
from 1 to 500 mm: table 1 has the standard tolerances, table 4 the fundamental deviations of shafts a to h; a hole A to
H has that of the shaft of its letter with the other sign, and js lies about the nominal size.  All other letters are of
transition and interference fits, with which a pin does not turn.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from typing import NamedTuple

SMALLEST, LARGEST = 1.0, 500.0  # mm
# mm, up to and including which each column of the tables counts
SIZES = (3.0, 6.0, 10.0, 18.0, 30.0, 50.0, 80.0, 120.0, 180.0, 250.0, 315.0, 400.0, 500.0)
GRADES: dict[int, tuple[float, ...]] = {  # um, by size
    1: (0.8, 1, 1, 1.2, 1.5, 1.5, 2, 2.5, 3.5, 4.5, 6, 7, 8),
    2: (1.2, 1.5, 1.5, 2, 2.5, 2.5, 3, 4, 5, 7, 8, 9, 10),
    3: (2, 2.5, 2.5, 3, 4, 4, 5, 6, 8, 10, 12, 13, 15),
    4: (3, 4, 4, 5, 6, 7, 8, 10, 12, 14, 16, 18, 20),
    5: (4, 5, 6, 8, 9, 11, 13, 15, 18, 20, 23, 25, 27),
    6: (6, 8, 9, 11, 13, 16, 19, 22, 25, 29, 32, 36, 40),
    7: (10, 12, 15, 18, 21, 25, 30, 35, 40, 46, 52, 57, 63),
    8: (14, 18, 22, 27, 33, 39, 46, 54, 63, 72, 81, 89, 97),
    9: (25, 30, 36, 43, 52, 62, 74, 87, 100, 115, 130, 140, 155),
    10: (40, 48, 58, 70, 84, 100, 120, 140, 160, 185, 210, 230, 250),
    11: (60, 75, 90, 110, 130, 160, 190, 220, 250, 290, 320, 360, 400),
    12: (100, 120, 150, 180, 210, 250, 300, 350, 400, 460, 520, 570, 630),
    13: (140, 180, 220, 270, 330, 390, 460, 540, 630, 720, 810, 890, 970),
}
# mm, the finer steps of the letters with large deviations
FINE = (3.0, 6.0, 10.0, 18.0, 30.0, 40.0, 50.0, 65.0, 80.0, 100.0, 120.0, 140.0, 160.0, 180.0, 200.0, 225.0, 250.0,
        280.0, 315.0, 355.0, 400.0, 450.0, 500.0)  # fmt: skip
DEVIATIONS: dict[str, tuple[float, ...]] = {  # um, by which the largest shaft is smaller than its nominal size
    "a": (270, 270, 280, 290, 300, 310, 320, 340, 360, 380, 410, 460, 520, 580, 660, 740, 820, 920, 1050, 1200, 1350,
          1500, 1650),
    "b": (140, 140, 150, 150, 160, 170, 180, 190, 200, 220, 240, 260, 280, 310, 340, 380, 420, 480, 540, 600, 680, 760,
          840),
    "c": (60, 70, 80, 95, 110, 120, 130, 140, 150, 170, 180, 200, 210, 230, 240, 260, 280, 300, 330, 360, 400, 440,
          480),
    "d": (20, 30, 40, 50, 65, 80, 100, 120, 145, 170, 190, 210, 230),
    "e": (14, 20, 25, 32, 40, 50, 60, 72, 85, 100, 110, 125, 135),
    "f": (6, 10, 13, 16, 20, 25, 30, 36, 43, 50, 56, 62, 68),
    "g": (2, 4, 5, 6, 7, 9, 10, 12, 14, 15, 17, 18, 20),
    "h": (0,) * len(SIZES),
}  # fmt: skip
WRITTEN = re.compile(r"([A-Z]{1,2})(\d{1,2})/([a-z]{1,2})(\d{1,2})")
TIGHT = ("j", "k", "m", "n", "p", "r", "s", "t", "u", "v", "x", "y", "z", "za", "zb", "zc")


class FitError(ValueError):
    """A fit cannot be used; the message says why, and what to write."""


class Play(NamedTuple):
    """What a fit leaves between pin and bore: the smallest and the largest diametral clearance (m)."""

    least: float
    most: float


def play(fit: str, diameter: float) -> Play:
    """The diametral clearance (m) of a fit such as ``H7/g6``, hole first, at a nominal diameter (m).

    Raises FitError where it is no fit, the diameter is beyond the tables, or the pin may be larger than its bore.
    """
    written = WRITTEN.fullmatch(fit)
    if written is None:
        raise FitError("give the bore's class and the pin's, such as 'H7/g6'")
    size = round(1e3 * diameter, 6)  # to a nanometre: 2 x 5 mm is 10 mm, the end of a step
    if not SMALLEST <= size <= LARGEST:
        raise FitError(f"fits are of pins from 1 to 500 mm across, and this one has {size:g} mm; give its clearance")
    hole, shaft = (
        _zone(letter.lower(), int(grade), size) for letter, grade in (written.group(1, 2), written.group(3, 4))
    )
    least, most = -(hole[1] + shaft[1]), -(hole[0] + shaft[0])  # a hole lies above its size as such a shaft below
    if least < 0:
        raise FitError(
            f"at {size:g} mm it leaves {least:g} to {most:g} um, so that the pin may be larger than its bore; give a"
            " clearance fit, such as 'H7/g6'"
        )
    return Play(1e-6 * least, 1e-6 * most)


def _zone(letter: str, grade: int, size: float) -> tuple[float, float]:
    """Lower and upper deviation (um) of a shaft of this letter and grade; those of a hole have the other signs."""
    if grade not in GRADES:
        raise FitError(f"there is no grade {grade} here; they are 1 to {max(GRADES)}")
    width = GRADES[grade][bisect_left(SIZES, size)]
    if letter == "js":
        return -width / 2, width / 2
    if letter in TIGHT:
        raise FitError(
            "it is a transition or interference fit, in which a pin does not turn; give a clearance fit, bore A to H"
            " and pin a to h, such as 'H7/g6'"
        )
    if letter not in DEVIATIONS:
        raise FitError(
            f"there is no letter {letter!r} here; they are {', '.join(DEVIATIONS)} and js, of a bore in capitals"
        )
    deviations = DEVIATIONS[letter]
    upper = -deviations[bisect_left(SIZES if len(deviations) == len(SIZES) else FINE, size)]
    return upper - width, upper

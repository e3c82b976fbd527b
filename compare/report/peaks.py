"""What a mechanical engineer reads off first: how large each reaction becomes and where, the drive's peaks, how far
each body and slide moves, and the error by clearance with the joint that has most of it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from compare.quantities import Quantity, drive_signals, plain, quantities, shown
from compare.report.summary import Abscissa, abscissa, by_reason
from compare.results.analysis import Analysis, OutputError, Simulation

NOTHING = 1e-9  # of what belongs to it (a reaction, a length): smaller is rounding
GOOD = 40.0  # deg: the transmission angle below which textbooks call a linkage poor (Norton, Design of Machinery)


@dataclass(frozen=True)
class Peak:
    """The highest and the lowest value of a signal, in its quantity's unit, with the samples at which they are."""

    quantity: Quantity
    values: np.ndarray

    @property
    def highest(self) -> int:
        """Sample of the highest value."""
        return int(np.nanargmax(self.values))

    @property
    def lowest(self) -> int:
        """Sample of the lowest value."""
        return int(np.nanargmin(self.values))

    def row(self, over: Abscissa) -> tuple[str, ...]:
        """As a table has it: name, unit, highest and lowest value, each with its place."""
        largest = np.nanmax(np.abs(self.values))
        ends = ((self.values[k], over.at(k)) for k in (self.highest, self.lowest))
        ends = ((0.0 if abs(v) < NOTHING * largest else v, at) for v, at in ends)
        return self.quantity.label, self.quantity.unit, *(cell for v, at in ends for cell in (plain(float(v), 4), at))


def peaks(result: Analysis | Simulation) -> Iterator[Peak]:
    """Of each joint's reaction, of what the drives give, of how bodies turn that do not turn round, and of slides;
    nothing that is zero, or stays where it is, throughout.
    """
    mechanism, known = result.mechanism, quantities(result.mechanism)
    reactions = [f"reaction_{joint.name}_magnitude" for joint in mechanism.joints]
    force = max((_size(result, name) for name in reactions), default=0.0)
    length = max((body.length for body in mechanism.bodies), default=0.0) or 1.0
    scale = {"N": force, "N·m": force * length, "mm": length, "deg": 1.0}
    driven = mechanism.driven if mechanism.cranked else ""
    turning = [f"{body.name}_angle" for body in mechanism.bodies if body.name != driven]
    sliding = [f"position_{joint.name}" for joint in mechanism.joints if joint.prismatic]
    for name in (*reactions, *drive_signals(mechanism)):
        if _size(result, name) > NOTHING * scale[known[name].unit]:
            yield Peak(known[name], known[name].factor * result.signals[name])
    for name in (*turning, *sliding):
        if _range(result, name) > NOTHING * scale[known[name].unit]:
            yield Peak(known[name], known[name].factor * result.signals[name])


def _size(result: Analysis | Simulation, name: str) -> float:
    """The largest size of a signal (SI); 0 of one that there is not."""
    values = result.signals.get(name, np.zeros(0))
    return float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 0.0


def _range(result: Analysis | Simulation, name: str) -> float:
    """How far a signal goes (SI); nowhere where there is none."""
    values = result.signals.get(name, np.zeros(0))
    return float(np.nanmax(values) - np.nanmin(values)) if np.isfinite(values).any() else 0.0


def over(result: Analysis | Simulation) -> Abscissa:
    """What a result's samples are plotted over."""
    return abscissa(result, result.mechanism)


def unanswered(result: Analysis) -> list[tuple[list[int], str]]:
    """Samples without an answer by reason, how far each is off left out but for the first."""
    kinds = {at: re.sub(r" \([^()]*\)$", "", why) for at, why in result.flags.items()}
    return [(at, result.flags[str(at[0])]) for at in by_reason(kinds).values()]


@dataclass(frozen=True)
class ErrorPeak:
    """The largest displacement of an output by clearance, in ``unit``: in equilibrium, in the worst case, and the
    joints' parts of the first-order displacement where they are together the largest, the largest part first.
    """

    name: str
    unit: str
    equilibrium: float | None
    at: str
    worst: float
    worst_at: str
    parts: tuple[tuple[str, float], ...]

    @property
    def mostly(self) -> str:
        """The joint with the largest part, and that part."""
        if not self.parts:
            return "-"
        joint, part = self.parts[0]
        return f"{joint} {plain(part, 3, True)} {self.unit}"


def error_peaks(result: Analysis) -> Iterator[ErrorPeak]:
    """The largest error of each output that has any."""
    at = over(result).at
    for name, error in result.errors.items():
        unit, factor = shown(error.unit)
        worst = factor * error.worst_case
        if not np.nanmax(worst, initial=0.0) > NOTHING:
            continue
        there = factor * error.equilibrium
        k, w = _largest(there), _largest(worst)
        parts = {} if k is None else {joint: factor * float(part[k]) for joint, part in error.by_joint.items()}
        ordered = sorted(parts.items(), key=lambda item: -abs(item[1]))
        known = tuple((joint, part) for joint, part in ordered if np.isfinite(part))
        largest, place = (None, "-") if k is None else (float(there[k]), at(k))
        most, most_at = (0.0, "-") if w is None else (float(worst[w]), at(w))
        yield ErrorPeak(name, unit, largest, place, most, most_at, known)


def _largest(values: np.ndarray) -> int | None:
    return int(np.nanargmax(np.abs(values))) if np.isfinite(values).any() else None


def transmission_angle(result: Analysis) -> np.ndarray | None:
    """The transmission angle (N,) deg, at most 90; None where the linkage has none."""
    return None if result.transmission is None else np.degrees(np.arcsin(np.clip(result.transmission, 0.0, 1.0)))


def poor(result: Analysis) -> str:
    """Where the transmission angle is poor, in words; empty where it is good throughout, or unknown."""
    angle = transmission_angle(result)
    if angle is None or not (angle < GOOD).any():
        return ""
    x, below = over(result), np.flatnonzero(angle < GOOD)
    stretches = np.split(below, np.flatnonzero(np.diff(below) > 1) + 1)
    said = [x.at(s[0]) if s.size == 1 else f"{plain(x.values[s[0]], 4)} to {x.at(s[-1])}" for s in stretches]
    return ", ".join(said)


def parts_of(error: OutputError) -> dict[str, np.ndarray]:
    """What each joint does to an output, those that do anything."""
    return {joint: part for joint, part in error.by_joint.items() if np.nanmax(np.abs(part), initial=0.0) > 0}

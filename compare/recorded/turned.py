"""How else a vector may be meant: in a body's frame, its axes swapped or reversed, turned; a signal a row off."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from analytic.mechanism import GROUND, Joint
from analytic.mechanism.columns import ColumnMeaning
from compare.recorded.alternatives import line
from compare.recorded.body_frames import Vector

LIKE = 0.03  # of a signal's rms: what a reading that is meant may leave
BETTER = 5.0  # times less is what it leaves than a simpler one, or than the file as it is read
LEAST_ROWS = 8  # by which a reading is told


@dataclass(frozen=True)
class _Look:
    """What a vector is (N,), complex, ground frame, if it is in a body's ``frame``, its columns ``swapped`` or of other
    ``signs``, or ``turned`` (rad) on that body.
    """

    meant: np.ndarray
    frame: str = GROUND
    swapped: bool = False
    signs: tuple[int, int] = (1, 1)
    turned: float = 0.0

    @property
    def words(self) -> str:
        """What it looks like."""
        how = [f"it turns with body {self.frame}"] * (self.frame != GROUND)
        how += ["its x and y are swapped"] * self.swapped
        names = [axis for axis, sign in zip("xy", self.signs, strict=True) if sign < 0]
        how += [f"its {' and '.join(names)} {'are' if names[1:] else 'is'} of the other sign"] * bool(names)
        how += [f"it is mounted turned by {math.degrees(self.turned):.4g} deg"] * bool(self.turned)
        return ", ".join(how)


def looks_turned(
    pair: Vector, read: np.ndarray, model: np.ndarray, angles: Mapping[str, np.ndarray], joint: Joint | None
) -> str:
    """What a vector (N,), complex, looks like that is not the ``model``'s, in words with the lines that mend it; empty
    where it is like nothing.  ``angles`` (N,) rad are the bodies'; ``joint`` is where it is, if it is a reaction.
    """
    here = np.isfinite(read) & np.isfinite(model)
    if here.sum() < LEAST_ROWS or not np.any(model[here]):
        return ""
    best: _Look | None = None
    left = _miss(read[here], model[here])
    for look in _ways(read[here], model[here], {body: angle[here] for body, angle in angles.items()}):
        miss = _miss(look.meant, model[here])
        if miss < LIKE and miss < left / BETTER:
            best, left = look, miss
    if best is None or (best.frame == GROUND and not best.swapped and not best.turned):  # a sign: each column's own
        return ""
    return f"its size agrees; {best.words}: {_remedy(pair, best, joint)}"


def looks_late(read: np.ndarray, model: np.ndarray) -> str:
    """Whether a signal (N,) is the ``model``'s a row before or after, in words; empty where it is not."""
    for words, seen, meant in (
        ("one sample earlier: write each of its numbers a row further up", read[1:], model[:-1]),
        ("one sample later: write each of its numbers a row further down", read[:-1], model[1:]),
    ):
        here = np.isfinite(seen) & np.isfinite(meant)
        if here.sum() < LEAST_ROWS or not np.ptp(meant[here]):
            continue
        off = _miss(seen[here], meant[here])
        if off < LIKE and off < _miss(read[:-1][here], model[:-1][here]) / BETTER:
            return f"it agrees {words}"
    return ""


def _miss(read: np.ndarray, model: np.ndarray) -> float:
    """What is left of a signal, as a share of its rms."""
    return float(np.sqrt(np.mean(np.abs(read - model) ** 2) / np.mean(np.abs(model) ** 2)))


def _ways(read: np.ndarray, model: np.ndarray, angles: Mapping[str, np.ndarray]) -> Iterator[_Look]:
    """Every way in which a vector may be meant, simple ones first."""
    frames = {GROUND: np.zeros(read.shape), **angles}
    plain = sorted(product((False, True), (1, -1), (1, -1)), key=lambda way: (way[0], -sum(way[1:])))
    for (swapped, *signs), (body, angle) in product(plain, frames.items()):
        x, y = signs[0] * read.real, signs[1] * read.imag
        along = y + 1j * x if swapped else x + 1j * y
        yield _Look(along * np.exp(1j * angle), body, swapped, (signs[0], signs[1]))
    for body, angle in frames.items():
        along = read * np.exp(1j * angle)
        turned = float(np.angle(np.vdot(along, model)))
        yield _Look(along * np.exp(1j * turned), body, turned=turned)


def _remedy(pair: Vector, look: _Look, joint: Joint | None) -> str:
    """The lines by which a vector is meant so."""
    if not look.turned:
        signals = [column.signal for column in (pair[::-1] if look.swapped else pair)]
        lines = []
        for column, signal, sign in zip(pair, signals, look.signs, strict=True):
            before = column.meaning or ColumnMeaning(signal=signal.name)
            frame = before.frame if look.frame == GROUND else look.frame
            update = {"signal": signal.name, "unit": column.unit, "sign": sign * before.sign, "frame": frame}
            lines.append(line(replace(column, signal=signal, meaning=before.model_copy(update=update))))
        return f"say {' and '.join(lines)} under [columns] of a map"
    if joint is None:
        return "turn it before it is written"
    c, s = math.cos(look.turned), math.sin(look.turned)
    return (
        f'give its columns as two [[sensor]] of kind = "force", body = "{joint.bodies[1]}", point = "{joint.name}",'
        f' frame = "{look.frame}", one with axis = [{c:.6g}, {s:.6g}], one with axis = [{-s:.6g}, {c:.6g}]'
    )

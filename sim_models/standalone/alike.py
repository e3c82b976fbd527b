"""What the scripts of all engines do alike.  An export writes it into its script, which needs no other file."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).resolve().parent


def share(how: Mapping[str, Any], where: Callable[[Mapping[str, str]], float]) -> float:
    """How much of a load acts that varies over what is now ``where`` (s, m, rad): by its table, or in its stretch."""
    over, turn = how["over"], 2 * math.pi
    if over is None:
        return 1.0
    here = where(over)
    if how["table"]:
        values, factors = zip(*how["table"], strict=True)
        return float(np.interp(here, values, factors, period=turn if over["kind"] == "angle" else None))
    low, high = how["stretch"] or (0.0, 0.0)
    if over["kind"] != "angle":
        return float(min(low, high) <= here < max(low, high))
    if high - low >= turn:
        return 1.0
    here, first, last = (round(x % turn, 12) % round(turn, 12) for x in (here, low, high))
    begun, open_yet = here >= first, here < last
    return float(begun and open_yet if first < last else begun or open_yet)


def against(
    force: complex, torque: float, velocity: complex, spin: float, fades: Sequence[float]
) -> tuple[complex, float]:
    """A load that opposes the motion of its point and of its body; below the velocities at which it fades in part."""
    slow, slow_spin = fades
    turn = float(np.clip(spin / slow_spin, -1.0, 1.0) if slow_spin else np.sign(spin))
    return -abs(force) * velocity / max(abs(velocity), slow, 1e-300), -abs(torque) * turn


def stopped(stops: list[list[float]], position: float, rate: float, over: float) -> float:
    """What stops of a joint push its second body back with, each only beyond where it is; its damper sets in over a
    time, half of it before.
    """
    size = 0.0
    for way, place, stiffness, damping in stops:
        depth = way * (place - position)
        share = min(max(depth / max(over * abs(rate), 1e-300) + 0.5, 0.0), 1.0)
        size += way * max(stiffness * max(depth, 0.0) - share * way * damping * rate, 0.0)
    return size


def compare(model: Mapping[str, Any], engine: str, found: Mapping[str, np.ndarray]) -> None:
    """Write signals.csv, and say how far it is from expected.csv."""
    with (HERE / "expected.csv").open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    names = [heading.split(" [")[0] for heading in header]
    with (HERE / "signals.csv").open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(header)
        table.writerows(zip(*(found[name].tolist() for name in names), strict=True))
    print(f"{model['title']}: {len(rows)} samples, {engine} (expected.csv: {model['version']})")
    print(f"{'signal':32} {'largest difference':>20} {'largest value':>15}")
    for name, theirs in zip(names, np.array(rows, float).T, strict=True):
        print(f"{name:32} {np.abs(found[name] - theirs).max():20.2g} {np.abs(theirs).max():15.6g}")

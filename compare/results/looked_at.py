"""Signals of results, looked at one by one: the largest value of each, and reactions as vectors."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Protocol

import numpy as np

from analytic.mechanism import Mechanism
from analytic.mechanism.signals import Signal
from compare.presentation import picture
from compare.results.document import Row, pictured

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NOTHING = 1e-9  # of the largest signal of its unit: smaller is rounding


def peaks(
    signals: Mapping[str, np.ndarray],
    kinds: Mapping[str, Signal],
    crank_angle: np.ndarray | None,
    time: np.ndarray | None,
    known: Mapping[str, tuple[float, float]],
    rms: Mapping[str, float | None] = MappingProxyType({}),
) -> Iterator[Row]:
    """A row for each of one side's signals (N,) SI that is more than rounding, but for directions of reactions and
    angles that go round: its largest value, with its sign, and the crank angle (rad) and time (s) of it, as far as
    there are such; where it is ``known`` between the samples too, there; and its ``rms``, if there is any.
    """
    named = {name: values for name, values in signals.items() if name in kinds and np.any(np.isfinite(values))}
    scale = dict.fromkeys(("N", "m", "N.m"), 0.0)
    for name, values in named.items():
        scale[kinds[name].unit] = max(scale.get(kinds[name].unit, 0.0), float(np.nanmax(np.abs(values))))
    scale["N.m"] = max(scale["N.m"], scale["N"] * scale["m"])
    for name, values in named.items():
        kind, at = kinds[name], int(np.nanargmax(np.abs(values)))
        aimless = kind.wraps and (kind.kind == "reaction" or _goes_round(values))
        if aimless or abs(values[at]) <= NOTHING * scale[kind.unit]:
            continue
        where = {"crank_angle": crank_angle, "time": time}
        places = {over: float(x[at]) for over, x in where.items() if x is not None}
        largest, first = known.get(name, (float(values[at]), None))
        if first is not None and time is not None and crank_angle is not None:
            places = {"crank_angle": float(np.interp(first, time, crank_angle)), "time": first}
        elif first is not None:
            places = dict.fromkeys(places, first)
        yield {
            "signal": name,
            "unit": kind.unit,
            "largest": largest,
            **places,
            **({"rms": rms.get(name)} if rms else {}),
        }


class _OfLinkage(Protocol):
    """A result of a linkage."""

    @property
    def mechanism(self) -> Mechanism: ...


class WithReactions:
    """What a result can show of the reactions of its joints."""

    def plot_polar(self: _OfLinkage, *joints: str) -> Figure:
        """A matplotlib figure of the reactions of these joints, or of all, as vectors: the size (N) over the direction
        of the force on the second body, in the ground's frame and in that body's own; of a cross-check in the ground's,
        the engines over the analytic curve, of several engines with the joint model that most of them have.

        Raises KeyError for what is no joint, ImportError with the remedy where matplotlib is not installed.
        """
        those = [joint.name for joint in self.mechanism.joints]
        for name in joints:
            if name not in those:
                raise KeyError(f"{name}: no such joint; they are {', '.join(those)}")
        return pictured(lambda figure: picture("polar")(self, joints or those, figure), "plot_polar")


class ByClearance(Protocol):
    """What clearance does to an output (N,) m or rad: in equilibrium, and to either side at most."""

    @property
    def unit(self) -> str: ...
    @property
    def equilibrium(self) -> np.ndarray: ...
    @property
    def worst_case(self) -> np.ndarray: ...


class Error(ByClearance, Protocol):
    """What displaces an output besides, and all together."""

    @property
    def compliance(self) -> np.ndarray: ...
    @property
    def total(self) -> np.ndarray: ...


def error_peaks(outputs: Mapping[str, Error], where: Mapping[str, np.ndarray]) -> Iterator[Row]:
    """A row for each output that has an error: the largest displacement in equilibrium, with its sign, ``where`` (N,)
    it is, and how large the others become, SI; null where there is none.
    """
    scale: dict[str, float] = {}
    for error in outputs.values():
        scale[error.unit] = max(scale.get(error.unit, 0.0), float(np.nanmax(np.abs(error.total), initial=0.0)))
    for name, error in outputs.items():
        known = {
            field: values
            for field in ("equilibrium", "worst_case", "compliance", "total")
            if np.isfinite(values := getattr(error, field)).any()
        }
        sizes = {field: float(np.nanmax(np.abs(values))) for field, values in known.items()}
        if max(sizes.values(), default=0.0) > NOTHING * scale[error.unit]:
            at = int(np.nanargmax(np.abs(known["equilibrium"]))) if "equilibrium" in known else None
            yield {
                "output": name,
                "unit": error.unit,
                "largest": None if at is None else float(error.equilibrium[at]),
                **{over: None if at is None else float(x[at]) for over, x in where.items()},
                **{field: sizes.get(field) for field in ("worst_case", "compliance", "total")},
            }


def _goes_round(angle: np.ndarray) -> bool:
    """Whether an angle (N,) rad makes a turn, with one more step like the largest."""
    known = angle[np.isfinite(angle)]
    return bool(np.ptp(known) + np.max(np.abs(np.diff(known)), initial=0.0) > 2 * np.pi * (1 - NOTHING))

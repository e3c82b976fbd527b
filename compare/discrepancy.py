"""How far two signals are apart, and whether that is too far."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any, Literal

import numpy as np

from compare.signals import UNITS, Kind

Verdict = Literal["agrees", "disagrees", "known"]
ANGULAR: tuple[Kind, ...] = ("angle", "rotation", "position")  # compared modulo a turn


class ToleranceError(ValueError):
    """A tolerance file cannot be used; the message says why."""


@dataclass(frozen=True)
class Difference:
    """Simulated minus analytic: the largest (signed), its crank angle's index, and the root mean square."""

    max: float
    rms: float
    at: int
    values: np.ndarray


@dataclass(frozen=True)
class Discrepancy:
    """A signal's difference with its tolerance and verdict, all in ``unit``."""

    signal: str
    kind: Literal["angle", "magnitude", "value"]
    unit: str
    max: float
    rms: float
    at: int
    tolerance: float
    verdict: Verdict


def load_tolerances(path: Path | None = None) -> dict[str, Any]:
    """The shipped tolerances, or a file's.  Raises ToleranceError."""
    source = resources.files("compare").joinpath("tolerances.toml") if path is None else path
    try:
        return tomllib.loads(source.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ToleranceError(f"--tolerance {path}: cannot be read ({error}); give a TOML file like compare/tolerances.toml") from None


def difference(simulated: np.ndarray, analytic: np.ndarray, angular: bool, where: np.ndarray | None = None) -> Difference | None:
    """Difference over the samples that both have (and ``where``); angles modulo a turn; None if there are none."""
    values = np.asarray(simulated, float) - np.asarray(analytic, float)
    if angular:
        values = (values + np.pi) % (2 * np.pi) - np.pi
    usable = np.isfinite(values) if where is None else np.isfinite(values) & where
    if not usable.any():
        return None
    values = np.where(usable, values, np.nan)
    at = int(np.nanargmax(np.abs(values)))
    return Difference(float(values[at]), float(np.sqrt(np.nanmean(values**2))), at, values)


@dataclass(frozen=True)
class Rule:
    """How far a signal may differ: the larger of ``absolute`` and ``relative`` times its scale."""

    absolute: float
    relative: float
    floor: float  # of its peak, below which a force has no direction
    clearance: float = 0.0  # m, the scale of a displacement

    @classmethod
    def read(cls, tolerances: Mapping[str, Any], motion: str, joint_model: str, kind: Kind, give: float = 0.0, clearance: float = 0.0) -> Rule:
        """The rule of a signal in a run.

        ``give`` (m) is how far the contact itself yields under the run's peak force, ``clearance`` (m) the joint's, or
        the largest of the run's.  Raises ToleranceError if the file has no such line.
        """
        try:
            line, floor = tolerances[motion][joint_model][kind], float(tolerances["floor"])
        except KeyError as error:
            raise ToleranceError(f"the tolerance file has no {error.args[0]!r} under {motion}.{joint_model}.{kind}; add it") from None
        yielding = give / clearance if kind in ("displacement", "rotation") and clearance else 0.0
        return cls(float(line.get("absolute", 0.0)), float(line.get("relative", 0.0)) + yielding, floor, clearance)

    def tolerance(self, kind: Kind, values: np.ndarray) -> float:
        """The tolerance, in the signal's unit, for a signal with these values."""
        scale = self.clearance if kind == "displacement" else float(np.nanmax(np.abs(values)))
        return max(self.absolute, self.relative * scale)

    def where(self, signal: str, kind: Kind, signals: Mapping[str, np.ndarray]) -> np.ndarray | None:
        """Samples at which the signal means something: for a direction, where the force is large enough to have one."""
        if kind != "angle":
            return None
        size = signals[signal.removesuffix("_angle") + "_magnitude"]
        return np.asarray(size > self.floor * np.nanmax(size))


def judge(signal: str, kind: Kind, simulated: Mapping[str, np.ndarray], analytic: Mapping[str, np.ndarray], rule: Rule) -> Discrepancy | None:
    """Compare one signal under its rule; None where it has no comparable sample."""
    found = difference(simulated[signal], analytic[signal], kind in ANGULAR, rule.where(signal, kind, analytic))
    if found is None:
        return None
    tolerance = rule.tolerance(kind, analytic[signal])
    public: Literal["angle", "magnitude", "value"] = "angle" if kind == "angle" else "magnitude" if kind == "magnitude" else "value"
    verdict: Verdict = "agrees" if abs(found.max) <= tolerance else "disagrees"
    return Discrepancy(signal, public, UNITS[kind], found.max, found.rms, found.at, tolerance, verdict)

"""How far two signals are apart, and whether that is too far."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any, Literal

import numpy as np

from analytic.mechanism import Mechanism
from compare.signals import UNITS, Kind

Verdict = Literal["agrees", "disagrees", "known"]
ANGULAR: tuple[Kind, ...] = ("angle", "rotation", "position")  # compared modulo a turn


class ToleranceError(ValueError):
    """A tolerance file cannot be used; the message says why."""


@dataclass(frozen=True)
class Difference:
    """One signal minus another where they differ most: ``max`` (signed), at sample ``at``, and the root mean square.

    "Most" is relative to the tolerance of each sample, where there is one: ``share`` is that largest share of it.
    """

    max: float
    rms: float
    at: int
    share: float


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


def difference(simulated: np.ndarray, analytic: np.ndarray, angular: bool, tolerance: np.ndarray | None = None) -> Difference | None:
    """Difference over the samples (N,) that both have; angles modulo a turn; None if there are none.

    ``tolerance`` (N,) is what each sample may differ by; NaN leaves a sample out.
    """
    values = np.asarray(simulated, float) - np.asarray(analytic, float)
    if angular:
        values = (values + np.pi) % (2 * np.pi) - np.pi
    share = np.abs(values) if tolerance is None else np.abs(values) / np.maximum(tolerance, np.finfo(float).tiny)
    if not np.isfinite(share).any():
        return None
    at = int(np.nanargmax(share))
    return Difference(float(values[at]), float(np.sqrt(np.nanmean(values[np.isfinite(share)] ** 2))), at, float(share[at]))


@dataclass(frozen=True)
class Scales:
    """What a run's small numbers are small against: its largest reaction (N) and its longest body (m)."""

    force: float
    length: float

    @classmethod
    def of(cls, analytic: Mapping[str, np.ndarray], mechanism: Mechanism) -> Scales:
        """Scales of a run, from its analytic side."""
        peaks = [np.nanmax(v, initial=0.0) for name, v in analytic.items() if name.endswith("_magnitude")]
        return cls(max(map(float, peaks), default=0.0), max(body.length for body in mechanism.bodies))


@dataclass(frozen=True)
class Rule:
    """How far a signal may differ, a line of tolerances.toml: the larger of ``absolute`` and ``relative`` times its peak.

    Nothing is judged below ``noise`` times the run's scales, nor a direction where its force is below ``floor`` of its
    peak; above that a direction may be off by ``absolute`` times peak over force, the same error in newtons everywhere.
    """

    kind: Kind
    absolute: float
    relative: float
    floor: float
    noise: float
    scales: Scales
    clearance: float = 0.0  # m, the scale of a displacement

    @classmethod
    def read(
        cls, tolerances: Mapping[str, Any], motion: str, joint_model: str, kind: Kind, scales: Scales, give: float = 0.0, clearance: float = 0.0
    ) -> Rule:
        """The rule of a signal in a run.

        ``give`` (m) is how far the contact itself yields under the run's peak force, ``clearance`` (m) the joint's, or
        the largest of the run's.  Raises ToleranceError if the file has no such line.
        """
        try:
            line, floor, noise = tolerances[motion][joint_model][kind], float(tolerances["floor"]), float(tolerances["noise"])
        except KeyError as error:
            raise ToleranceError(f"the tolerance file has no {error.args[0]!r} (looking for {motion}.{joint_model}.{kind}); add it") from None
        yielding = give / clearance if kind in ("displacement", "rotation") and clearance else 0.0
        return cls(kind, float(line.get("absolute", 0.0)), float(line.get("relative", 0.0)) + yielding, floor, noise, scales, clearance)

    def tolerance(self, signal: str, analytic: Mapping[str, np.ndarray]) -> np.ndarray:
        """What each sample (N,) may differ by, in the signal's unit; NaN where it means nothing."""
        if self.kind == "angle":
            size = analytic[signal.removesuffix("_angle") + "_magnitude"]
            peak = np.nanmax(size, initial=0.0)
            meaningful = size > max(self.floor * peak, self.noise * self.scales.force)
            return np.where(meaningful, self.absolute * peak / np.where(meaningful, size, 1.0), np.nan)
        peak = self.clearance if self.kind == "displacement" else float(np.nanmax(np.abs(analytic[signal]), initial=0.0))
        unit = {"magnitude": self.scales.force, "torque": self.scales.force * self.scales.length}.get(self.kind, 0.0)
        return np.full(analytic[signal].shape, max(self.absolute, self.relative * peak, self.noise * unit))


def judge(signal: str, simulated: Mapping[str, np.ndarray], analytic: Mapping[str, np.ndarray], rule: Rule) -> Discrepancy | None:
    """Compare one signal under its rule; None where it has no comparable sample."""
    tolerance = rule.tolerance(signal, analytic)
    found = difference(simulated[signal], analytic[signal], rule.kind in ANGULAR, tolerance)
    if found is None:
        return None
    public: Literal["angle", "magnitude", "value"] = "angle" if rule.kind == "angle" else "magnitude" if rule.kind == "magnitude" else "value"
    verdict: Verdict = "agrees" if found.share <= 1 else "disagrees"
    return Discrepancy(signal, public, UNITS[rule.kind], found.max, found.rms, found.at, float(tolerance[found.at]), verdict)

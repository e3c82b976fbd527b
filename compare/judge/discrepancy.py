"""How far two signals are apart, and whether that is too far."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from analytic.mechanism import Mechanism
from compare.judge.signals import UNITS, Kind, Unit
from compare.judge.tolerances import (
    Known,
    ToleranceError,
    Tolerances,
    check_known,
    known_differences,
    load_tolerances,
)
from sim_models.engine import JointModel, Motion

__all__ = [
    "ANGULAR", "Difference", "Discrepancy", "Rule", "Scales", "ToleranceError", "Tube",
    "check_known", "difference", "judge", "known_differences", "load_tolerances",
]  # fmt: skip

Verdict = Literal["agrees", "disagrees", "known"]
UNCOMPARED = "at no angle of the run has the signal a number, or its force a direction, to compare"
ANGULAR: tuple[Kind, ...] = ("angle", "rotation", "position")  # compared modulo a turn


@dataclass(frozen=True)
class Tube:
    """How far (N,) a signal rises above and falls below each of its samples within a window of crank angle; neither is
    negative.
    """

    above: np.ndarray
    below: np.ndarray

    @classmethod
    def around(cls, values: np.ndarray, theta: np.ndarray | None, window: float) -> Tube:
        """The tube of a signal (N,) sampled at crank angles theta (N,) rad, any order; ``window`` (rad) is to either
        side.

        Between samples the signal is the straight line; beyond its ends, and towards a missing sample, it allows
        nothing.
        """
        if theta is None or window == 0:
            return cls(np.zeros(values.shape), np.zeros(values.shape))
        order = np.argsort(theta)
        x, y = theta[order], values[order]
        before, after = (np.interp(x + side * window, x, y) - y for side in (-1, 1))
        above, below = np.empty_like(y), np.empty_like(y)
        above[order] = np.fmax(np.fmax(before, after), 0.0)
        below[order] = np.fmax(np.fmax(-before, -after), 0.0)
        return cls(above, below)


@dataclass(frozen=True)
class Difference:
    """One signal minus another where they differ most: ``max`` (signed), at sample ``at``, and the root mean square.

    "Most" is relative to what each sample is allowed, where that is given: ``share`` is the largest share of it,
    ``allowed`` the allowance there.
    """

    max: float
    rms: float
    at: int
    share: float
    allowed: float = float("nan")


NOTHING = Difference(float("nan"), float("nan"), -1, 0.0)  # there is no such sample


@dataclass(frozen=True)
class Discrepancy:
    """A signal's difference with its tolerance and verdict, all in ``unit``; ``reason`` is empty or why the verdict is
    not the tolerance's.
    """

    signal: str
    kind: Literal["angle", "magnitude", "value"]
    unit: Unit
    max: float
    rms: float
    at: int
    tolerance: float
    verdict: Verdict
    reason: str = ""


def difference(
    simulated: np.ndarray,
    analytic: np.ndarray,
    angular: bool,
    tolerance: np.ndarray | None = None,
    tube: Tube | None = None,
) -> Difference | None:
    """Difference over the samples (N,) that both have; angles modulo a turn; None if there are none.

    ``tolerance`` (N,) is what each sample may differ by, and ``tube`` how much further on the side where the analytic
    signal goes within its window; a NaN tolerance leaves a sample out.
    """
    values = np.asarray(simulated, float) - np.asarray(analytic, float)
    if angular:
        values = (values + np.pi) % (2 * np.pi) - np.pi
    if tolerance is None:
        allowed, share = np.full(values.shape, np.nan), np.abs(values)
    else:
        allowed = tolerance if tube is None else tolerance + np.where(values > 0, tube.above, tube.below)
        share = np.abs(values) / np.maximum(allowed, np.finfo(float).tiny)
    if not np.isfinite(share).any():
        return None
    at = int(np.nanargmax(share))
    rms = float(np.sqrt(np.nanmean(values[np.isfinite(share)] ** 2)))
    return Difference(float(values[at]), rms, at, float(share[at]), float(allowed[at]))


@dataclass(frozen=True)
class Scales:
    """What a run's small numbers are small against: its largest reaction (N), its longest body (m) and the mass of them
    all (kg).

    ``peaks`` are the largest sizes of its signals where they are the linkage's own, whatever part of its cycle the run
    looks at.
    """

    force: float
    length: float
    mass: float = 0.0
    peaks: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of(
        cls, analytic: Mapping[str, np.ndarray], mechanism: Mechanism, peaks: Mapping[str, float] | None = None
    ) -> Scales:
        """Scales of a run: the linkage's own ``peaks`` where they are known, else those of the run's analytic side."""
        known = largest(analytic) | (dict(peaks) if peaks else {})
        force = max((peak for name, peak in known.items() if name.endswith("_magnitude")), default=0.0)
        bodies = mechanism.bodies
        return cls(force, max(body.length for body in bodies), sum(body.mass for body in bodies), dict(peaks or {}))


def largest(signals: Mapping[str, np.ndarray]) -> dict[str, float]:
    """The largest size of each signal, in its unit; 0 where it has no number."""
    return {name: float(np.nanmax(np.abs(values), initial=0.0)) for name, values in signals.items()}


@dataclass(frozen=True)
class Rule:
    """How far a signal may differ, a line of tolerances.toml: the larger of ``absolute`` and ``relative`` times its
    peak.

    A peak is the linkage's own at its usual crank angles, or a sample's beyond it, so that what is allowed at one angle
    does not depend on which others are looked at; a run that has none, as over time, has its own. Nothing is judged
    below ``noise`` times the run's scales, or below the force that gives its mass the acceleration ``rest`` (m/s2), nor
    a direction where its force is below ``floor`` of its peak; above that a direction may be off by ``absolute`` times
    peak over force, the same error in newtons everywhere. ``window`` (rad of crank angle) widens this where the signal
    is steep.
    """

    kind: Kind
    absolute: float
    relative: float
    floor: float
    noise: float
    scales: Scales
    clearance: float = 0.0  # m, the scale of a displacement
    window: float = 0.0
    rest: float = 0.0

    @classmethod
    def read(
        cls,
        tolerances: Tolerances,
        motion: Motion,
        joint_model: JointModel,
        kind: Kind,
        scales: Scales,
        give: float = 0.0,
        clearance: float = 0.0,
    ) -> Rule:
        """The rule of a signal in a run.

        ``give`` (m) is how far the contact itself yields under the run's peak force, ``clearance`` (m) the joint's, or
        the smallest of the run's (every contact yields alike).  Raises ToleranceError if the file has no such line.
        """
        line = tolerances.line(motion, joint_model, kind)
        yielding = give / clearance if kind in ("displacement", "rotation") and clearance else 0.0
        return cls(
            kind,
            line.absolute,
            line.relative + yielding,
            tolerances.floor,
            tolerances.noise,
            scales,
            clearance,
            line.window,
            tolerances.rest,
        )

    def tolerance(self, signal: str, analytic: Mapping[str, np.ndarray]) -> np.ndarray:
        """What each sample (N,) may differ by before the window, in the signal's unit; NaN where it means nothing."""
        if self.kind == "angle":
            force = signal.removesuffix("_angle") + "_magnitude"
            size, peak = analytic[force], self._largest(force, analytic[force])
            meaningful = size > np.maximum(self.floor * peak, self._no_force)
            return np.where(meaningful, self.absolute * peak / np.where(meaningful, size, 1.0), np.nan)
        return np.maximum(max(self.absolute, self._noise), self.relative * self._peak(signal, analytic[signal]))

    def _peak(self, signal: str, values: np.ndarray) -> np.ndarray:
        """What ``relative`` refers to (N,); a body that clearance hardly turns is measured by what it does to the
        longest.
        """
        if self.kind == "displacement":
            return np.full(values.shape, self.clearance)
        peak = self._largest(signal, values)
        return np.maximum(peak, self.clearance / self.scales.length) if self.kind == "rotation" else peak

    def _largest(self, signal: str, values: np.ndarray) -> np.ndarray:
        """The linkage's own peak of a signal, or a sample's (N,) that is larger; the run's where there is no
        such peak.
        """
        own = self.scales.peaks.get(signal)
        return (
            np.full(values.shape, np.nanmax(np.abs(values), initial=0.0))
            if own is None
            else np.fmax(own, np.abs(values))
        )

    @property
    def _noise(self) -> float:
        return self._no_force * {"magnitude": 1.0, "torque": self.scales.length}.get(self.kind, 0.0)

    @property
    def _no_force(self) -> float:
        """The force (N) below which a joint carries none."""
        return max(self.noise * self.scales.force, self.rest * self.scales.mass)


def judge(
    signal: str,
    simulated: Mapping[str, np.ndarray],
    analytic: Mapping[str, np.ndarray],
    rule: Rule,
    theta: np.ndarray | None = None,
    known: Known | None = None,
) -> Discrepancy | None:
    """Compare one signal under its rule; None where it has no comparable sample.

    ``theta`` (N,) rad is the crank angle, for the rule's window; without it there is no window.  A sample that only one
    side has disagrees.  A ``known`` difference must be there, and within its bound; where nothing can be compared it
    disagrees.
    """
    tolerance = rule.tolerance(signal, analytic)
    tube = Tube.around(analytic[signal], theta, rule.window)
    found = difference(simulated[signal], analytic[signal], rule.kind in ANGULAR, tolerance, tube)
    one_sided = np.flatnonzero(np.isfinite(simulated[signal]) != np.isfinite(analytic[signal]))
    if one_sided.size:
        rms = found.rms if found else float("nan")
        why = f"{one_sided.size} of {tolerance.size} samples have a number on one side only"
        return _discrepancy(
            signal, rule.kind, Difference(float("nan"), rms, int(one_sided[0]), np.inf), "disagrees", why
        )
    if found is None and known is not None:
        return _discrepancy(
            signal, rule.kind, NOTHING, "disagrees", f"known difference cannot be judged: {UNCOMPARED} ({known.reason})"
        )
    if found is None:
        return None
    if known is None:
        return _discrepancy(signal, rule.kind, found, "agrees" if found.share <= 1 else "disagrees")
    bound = difference(
        simulated[signal], analytic[signal], rule.kind in ANGULAR, np.where(np.isnan(tolerance), np.nan, known.bound)
    )
    verdict, why = _judge_known(known, found, bound or found, UNITS[rule.kind])
    return _discrepancy(signal, rule.kind, found, verdict, why)


def _judge_known(known: Known, found: Difference, widest: Difference, unit: str) -> tuple[Verdict, str]:
    """The verdict on a difference that is declared known, and why; ``widest`` is its share of the bound."""
    if found.share <= 1:
        return (
            "disagrees",
            (
                "known difference has vanished: within the tolerance now, so strike it from the tolerance file"
                f" ({known.reason})"
            ),
        )
    if widest.share > 1:
        return (
            "disagrees",
            (
                f"known difference has left its bound of {known.bound:g} {unit}: it reaches {widest.max:.4g} {unit}"
                f" ({known.reason})"
            ),
        )
    return "known", f"{known.reason} (bound {known.bound:g} {unit})"


def _discrepancy(signal: str, kind: Kind, found: Difference, verdict: Verdict, reason: str = "") -> Discrepancy:
    public: Literal["angle", "magnitude", "value"] = (
        "angle" if kind == "angle" else "magnitude" if kind == "magnitude" else "value"
    )
    return Discrepancy(signal, public, UNITS[kind], found.max, found.rms, found.at, found.allowed, verdict, reason)

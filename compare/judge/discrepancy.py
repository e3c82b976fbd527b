"""How far two signals are apart, and whether that is too far."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from analytic.mechanism import Mechanism
from analytic.mechanism.signals import AXES, Signal, SiUnit
from compare.judge.signals import LINE_OF, ToleranceKind, compared, kind_of
from compare.judge.tolerances import Known, Tolerances
from sim_models.engine import JointModel, Motion, SettingValue

SignalVerdict = Literal["agrees", "disagrees", "known", "unjudged"]
NOT_TOLD_APART = "not told apart: the allowance is larger than the signal"
UNCOMPARED = "at no angle of the run has the signal a number, or its force a direction, to compare"


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


RATE_POWERS: dict[ToleranceKind, tuple[int, int]] = {  # of the longest body's length, and of the fastest rate
    "velocity": (0, 1), "speed": (1, 1), "angular_acceleration": (0, 2), "acceleration": (1, 2),
}  # fmt: skip
NO_DIFFERENCE = Difference(float("nan"), float("nan"), -1, 0.0)  # there is no such sample


@dataclass(frozen=True)
class Comparison:
    """A signal's difference with its tolerance and verdict, all in ``unit``; ``reason`` is empty or why the verdict is
    not the tolerance's.
    """

    signal: Signal
    kind: Literal["angle", "magnitude", "value"]
    unit: SiUnit
    max: float
    rms: float
    at: int
    tolerance: float
    verdict: SignalVerdict
    reason: str = ""


def difference(values: np.ndarray, tolerance: np.ndarray | None = None, tube: Tube | None = None) -> Difference | None:
    """The largest of a signal's differences (N,), simulated minus analytic (:meth:`Signal.apart`); None if there is
    none, as both sides need a number.

    ``tolerance`` (N,) is what each sample may differ by, and ``tube`` how much further on the side where the analytic
    signal goes within its window; a NaN tolerance leaves a sample out.
    """
    if tolerance is None:
        allowed, share = np.full(values.shape, np.nan), np.abs(values)
    else:
        allowed = tolerance if tube is None else tolerance + np.where(values > 0, tube.above, tube.below)
        with np.errstate(over="ignore"):  # beyond all bounds where nothing is allowed
            share = np.abs(values) / np.maximum(allowed, np.finfo(float).tiny)
    if not np.isfinite(share).any():
        return None
    at = int(np.nanargmax(share))
    rms = float(np.sqrt(np.nanmean(values[np.isfinite(share)] ** 2)))
    return Difference(float(values[at]), rms, at, float(share[at]), float(allowed[at]))


@dataclass(frozen=True)
class Scales:
    """What a run's small numbers are compared with: its largest reaction (N), its longest body (m; where bodies are
    points, how far out they are), the mass of all bodies (kg), and the rate (rad/s) of what turns fastest: a body, or a
    drive (one that slides by its speed over the longest body).

    ``peaks`` are the largest sizes of the signals over the linkage's usual crank angles, where they are known: they do
    not depend on the part of the cycle that the run covers.
    """

    force: float
    length: float
    mass: float = 0.0
    rate: float = 0.0
    peaks: Mapping[str, float] = field(default_factory=dict)

    def push(self, kind: ToleranceKind) -> float:
        """What the largest reaction gives the linkage's whole mass, if this kind of signal is an acceleration, else 0:
        a pin in its clearance swings and yields by itself, and a share of its force is that share of this.
        """
        per = {"acceleration": 1.0, "angular_acceleration": self.length}.get(kind, 0.0)
        return self.force / (self.mass * per) if self.mass * per else 0.0

    @classmethod
    def of(
        cls, analytic: Mapping[str, np.ndarray], mechanism: Mechanism, peaks: Mapping[str, float] | None = None
    ) -> Scales:
        """Scales of a run, by the linkage's ``peaks`` where they are known, else by those of its analytic side."""
        known = largest(analytic) | (dict(peaks) if peaks else {})
        sizes = [Signal("reaction", joint.name, "magnitude").name for joint in mechanism.joints]
        force = max((known[name] for name in sizes if name in known), default=0.0)
        bodies = mechanism.bodies
        places = [Signal("pose", body.name, axis).name for body in bodies for axis in AXES]
        length = max(body.length for body in bodies) or max(
            (known[name] for name in places if name in known), default=0.0
        )
        rates = [known.get(Signal("rate", body.name, "angular_velocity").name, 0.0) for body in bodies]
        rates += [
            abs(drive.speed) / (length if mechanism.joint(drive.joint).prismatic else 1.0)
            for drive in mechanism.drives
            if isinstance(drive.speed, float)
        ]
        return cls(force, length, sum(body.mass for body in bodies), max(rates), dict(peaks or {}))


def largest(signals: Mapping[str, np.ndarray]) -> dict[str, float]:
    """The largest size of each signal, in its unit; 0 where it has no number."""
    return {name: float(np.nanmax(np.abs(values), initial=0.0)) for name, values in signals.items()}


@dataclass(frozen=True)
class Rule:
    """How far a signal may differ, a line of tolerances.toml: the larger of ``absolute`` and ``relative`` times its
    peak.

    A peak is the linkage's own at its usual crank angles, or a sample's beyond it, so that the allowance at one angle
    does not depend on the other angles; where there is none, as over time, it is the run's.

    Nothing is judged below ``noise`` times the run's scales, or below the force that gives its mass the acceleration
    ``rest`` (m/s2), nor a direction where its force is below ``floor`` of its peak; above that a direction may be off
    by ``absolute`` times peak over force, the same error in newtons everywhere.  ``window`` (rad of crank angle) widens
    this where the signal is steep.  The peak of a block's moment is at least what friction turns it by at its corners,
    the joint's force at an ``arm`` (m).
    """

    signal: Signal
    absolute: float
    relative: float
    floor: float
    noise: float
    scales: Scales
    clearance: float = 0.0  # m, the scale of a displacement
    window: float = 0.0
    rest: float = 0.0
    unsure: np.ndarray | float = 0.0  # (N,) on top: how exactly the motion that both sides are held to is known
    arm: float = 0.0

    @classmethod
    def read(
        cls,
        tolerances: Tolerances,
        motion: Motion,
        joint_model: JointModel,
        signal: Signal,
        scales: Scales,
        give: float = 0.0,
        clearance: float = 0.0,
    ) -> Rule:
        """The rule of a signal in a run.

        ``give`` (m) is how far the contact itself yields under the run's peak force, ``clearance`` (m) the joint's, or
        the smallest of the run's (every contact yields alike).  Raises ToleranceError if the file has no such line.
        """
        kind = kind_of(signal)
        line = tolerances.line(motion, joint_model, LINE_OF.get(kind, kind))
        yielding = give / clearance if kind in ("displacement", "rotation") and clearance else 0.0
        return cls(
            signal,
            line.absolute,
            line.relative + yielding,
            tolerances.floor,
            tolerances.noise,
            scales,
            clearance,
            line.window,
            tolerances.rest,
            line.relative * scales.push(kind) if clearance else 0.0,
        )

    @property
    def kind(self) -> ToleranceKind:
        """The kind of its signal in the tolerance file."""
        return kind_of(self.signal)

    @property
    def presence(self) -> str:
        """The signal whose numbers say where there is something to judge: of a direction its force's size."""
        return self.signal.sibling("magnitude").name if self.kind == "angle" else self.signal.name

    def tolerance(self, analytic: Mapping[str, np.ndarray]) -> np.ndarray:
        """What each sample (N,) may differ by before the window, in the signal's unit; NaN where it means nothing."""
        if self.kind == "angle":
            force = self.signal.sibling("magnitude").name
            size, peak = analytic[force], self._largest(force, analytic[force])
            meaningful = size > np.maximum(self.floor * peak, self._no_force)
            return np.where(meaningful, self.absolute * peak / np.where(meaningful, size, 1.0) + self.unsure, np.nan)
        of = self.signal.name
        if self.signal.kind == "reaction" and self.kind == "magnitude":  # a component by the size of the whole
            of = self.signal.sibling("magnitude").name
        peak = self._peak(analytic[of])
        if self.arm:
            force = self.signal.sibling("magnitude").name
            peak = np.fmax(peak, self.arm * self._largest(force, analytic[force]))
        return np.maximum(max(self.absolute, self._noise), self.relative * peak) + self.unsure

    def nothing(self, analytic: Mapping[str, np.ndarray]) -> np.ndarray:
        """How far (N,) a column would be off that says nothing: no force, no torque, no speed; a direction that is the
        opposite one, a place a body's length away.
        """
        values = analytic[self.signal.name]
        if self.kind in ("angle", "position"):
            return np.full(values.shape, np.pi)
        return np.full(values.shape, self.scales.length) if self.kind == "place" else -values

    def allowed(self, analytic: Mapping[str, np.ndarray], theta: np.ndarray | None) -> tuple[np.ndarray, Tube]:
        """What each sample (N,) may differ by, and the window's tube at crank angles theta (N,) rad."""
        return self.tolerance(analytic), Tube.around(analytic[self.signal.name], theta, self.window)

    def _peak(self, values: np.ndarray) -> np.ndarray:
        """What ``relative`` refers to (N,): a signal's peak; for a displacement the clearance, for a rotation at least
        the clearance over the longest body, for a place that body's length, or what the rule has as clearance; for a
        rate or an acceleration at least those of what turns fastest, of a point at that body's length from its axis.
        """
        if self.kind == "displacement":
            return np.full(values.shape, self.clearance)
        if self.kind == "place":
            return np.full(values.shape, self.clearance or self.scales.length)
        whole = self.kind == "magnitude"
        peak = self._largest(self.signal.sibling("magnitude").name if whole else self.signal.name, values)
        if self.kind in RATE_POWERS:
            length, order = RATE_POWERS[self.kind]
            return np.maximum(peak, self.scales.length**length * self.scales.rate**order)
        return np.maximum(peak, self.clearance / self.scales.length) if self.kind == "rotation" else peak

    def _largest(self, signal: str, values: np.ndarray) -> np.ndarray:
        """The linkage's own peak of a signal, or a sample's (N,) where that is larger; the run's where the linkage's is
        not known.
        """
        usual = self.scales.peaks.get(signal)
        return (
            np.full(values.shape, np.nanmax(np.abs(values), initial=0.0))
            if usual is None
            else np.fmax(usual, np.abs(values))
        )

    @property
    def _noise(self) -> float:
        speed = self.scales.length * self.scales.rate
        of = {"magnitude": 1.0, "force": 1.0, "torque": self.scales.length, "power": speed}
        return self._no_force * of.get(self.kind, 0.0)

    @property
    def _no_force(self) -> float:
        """The force (N) below which a joint carries none."""
        return max(self.noise * self.scales.force, self.rest * self.scales.mass)


def run_rules(
    tolerances: Tolerances,
    mechanism: Mechanism,
    motion: Motion,
    joint_model: JointModel,
    clearances: Mapping[str, float],
    scales: Scales,
    give: float,
    judged: Iterable[Signal] | None = None,
) -> dict[str, Rule]:
    """The rule of every signal, by name, on which a run with these clearances (m) is judged; ``judged`` are others.

    ``give`` (m) is how far the contact yields (:func:`contact_give`).  Raises ToleranceError.
    """
    smallest = min(clearances.values(), default=0.0)
    arms = _arms(mechanism, clearances) if joint_model == "contact" else {}
    rules = {
        signal.name: Rule.read(
            tolerances, motion, joint_model, signal, scales, give, _loose(signal, clearances, smallest)
        )
        for signal in (compared(mechanism, clearances) if judged is None else judged)
    }
    return {name: replace(rule, arm=arms[name]) if name in arms else rule for name, rule in rules.items()}


def _arms(mechanism: Mechanism, clearances: Iterable[str]) -> dict[str, float]:
    """By the moment of a block with clearance: the moment (N.m) that friction at its corners has of a unit force (N) by
    which it is pressed to a wall; none of smooth ones.
    """
    blocks = [joint for joint in map(mechanism.joint, clearances) if joint.guide is not None and joint.rough]
    return {Signal("reaction", j.name, "moment").name: j.friction * j.guide[1] / 2 for j in blocks if j.guide}


def _loose(signal: Signal, clearances: Mapping[str, float], smallest: float) -> float:
    """The clearance (m) that scales a signal: of the joint in which it is displaced, the smallest for a rotation; none
    for a place.
    """
    if signal.kind == "pose" or (signal.kind == "sensor" and kind_of(signal) == "place"):
        return 0.0
    return clearances.get(signal.place if signal.kind == "clearance" else "", smallest)


def contact_stiffness(settings: Mapping[str, SettingValue]) -> float:
    """Stiffness (N/m) of a run's contact; infinite where its settings give no single number."""
    stiffness = settings.get("contact_stiffness")
    return float(stiffness) if isinstance(stiffness, int | float) else np.inf


def contact_give(
    settings: Mapping[str, SettingValue], clearances: Iterable[str], simulated: Mapping[str, np.ndarray]
) -> float:
    """How far (m) the contact of a run yields under the peak force in the joints with clearance; 0 where rigid."""
    sizes = (Signal("reaction", joint, "magnitude").name for joint in clearances)
    forces = (simulated[name] for name in sizes if name in simulated)
    peak = max((float(np.nanmax(force, initial=0.0)) for force in forces), default=0.0)
    return peak / contact_stiffness(settings)


def judge(
    rule: Rule,
    simulated: Mapping[str, np.ndarray],
    analytic: Mapping[str, np.ndarray],
    theta: np.ndarray | None = None,
    known: Known | None = None,
) -> Comparison | None:
    """Compare a rule's signal of two sides; None where it has no comparable sample.

    ``theta`` (N,) rad is the crank angle, for the rule's window; without it there is no window.  A sample that only one
    side has disagrees; a direction that only one side has is left out, as the forces disagree there, if their sizes are
    known.  A ``known`` difference must be there, and within its bound; where nothing can be compared it disagrees.
    """
    one, other = simulated[rule.signal.name], analytic[rule.signal.name]
    presence = [np.isfinite(side[rule.presence]) for side in (simulated, analytic)]
    apart, (tolerance, tube) = rule.signal.apart(one, other), rule.allowed(analytic, theta)
    widest = difference(apart, tolerance, tube)
    one_sided = np.flatnonzero(presence[0] != presence[1])
    if one_sided.size and (presence[0].any() or rule.presence == rule.signal.name):
        rms = widest.rms if widest else float("nan")
        why = f"{one_sided.size} of {tolerance.size} samples have a number on one side only"
        return _discrepancy(rule, Difference(float("nan"), rms, int(one_sided[0]), np.inf), "disagrees", why)
    if widest is None and known is not None:
        why = f"known difference cannot be judged: {UNCOMPARED} ({known.reason})"
        return _discrepancy(rule, NO_DIFFERENCE, "disagrees", why)
    if widest is None:
        return None
    if known is None:
        if widest.share > 1 or _told_apart(rule, analytic, apart, (tolerance, tube)):
            return _discrepancy(rule, widest, "agrees" if widest.share <= 1 else "disagrees")
        peak = f"{np.nanmax(np.abs(other)):.3g} {rule.signal.unit}"
        why = f"{NOT_TOLD_APART} (at most {peak}); a column that says nothing would agree as well"
        return _discrepancy(rule, widest, "unjudged", why)
    bound = difference(apart, np.where(np.isnan(tolerance), np.nan, known.largest))
    verdict, why = _judge_known(known, widest, bound or widest, rule.signal.unit)
    return _discrepancy(rule, widest, verdict, why)


def _told_apart(
    rule: Rule, analytic: Mapping[str, np.ndarray], apart: np.ndarray, allowed: tuple[np.ndarray, Tube]
) -> bool:
    """Whether differences (N,) that are ``allowed`` say something of the signal: they are within its tolerance alone,
    or what the motion leaves open, which is allowed on top, is less than the signal.
    """
    if not np.any(rule.unsure):
        return True
    alone = difference(apart, replace(rule, unsure=0.0).tolerance(analytic), allowed[1])
    nothing = difference(np.where(np.isfinite(apart), rule.nothing(analytic), np.nan), *allowed)
    return alone is None or nothing is None or alone.share <= 1 or nothing.share > 1


def _judge_known(known: Known, difference: Difference, of_bound: Difference, unit: str) -> tuple[SignalVerdict, str]:
    """The verdict on a difference that is declared known, and why; ``of_bound`` is its share of the bound."""
    if difference.share <= 1:
        return (
            "disagrees",
            (
                "known difference has vanished: within the tolerance now, so strike it from the tolerance file"
                f" ({known.reason})"
            ),
        )
    if of_bound.share > 1:
        return (
            "disagrees",
            (
                f"known difference has left its bound of {known.largest:g} {unit}: it reaches {of_bound.max:.4g} {unit}"
                f" ({known.reason})"
            ),
        )
    return "known", f"{known.reason} (bound {known.largest:g} {unit})"


def _discrepancy(rule: Rule, widest: Difference, verdict: SignalVerdict, reason: str = "") -> Comparison:
    kind, unit = rule.kind, rule.signal.unit
    public: Literal["angle", "magnitude", "value"] = kind if kind in ("angle", "magnitude") else "value"
    return Comparison(rule.signal, public, unit, widest.max, widest.rms, widest.at, widest.allowed, verdict, reason)

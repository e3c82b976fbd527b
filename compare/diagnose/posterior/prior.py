"""How likely each effect is before any data are seen, and how large it would be: where every probability begins.

The expected numbers are of a rig that somebody brings because its model is off.  Halved or tripled, they change the
odds and hardly ever a winner; that they are written down is what matters.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from compare.diagnose.effects.each_run import in_each_run
from compare.diagnose.effects.effect import Rig
from compare.diagnose.predict import Term

EXPECTED = {
    True: 1.5,
    False: 1.0,
}  # faults of sensors, effects of the rig: zeros and gains are off more often than links
MOST_EFFECTS = 6  # effects of the rig at once: of one that is expected, seven or more are there once in 10,000 times
NAMELESS = 0.1  # unknowns at a place: on one rig of ten something is at work that no effect describes
NOTHING = 0.5  # probability that the model is right, and nothing is missing
EACH_RUN = 0.3  # of a sensor's faults of one value, that one of several, one a run, is as likely as
REPEATS = 0.1  # the same of the rig's effects: a joint that warms up, a clamp that slips
RICHER = 0.1  # of its simple form: a law with further parameters
SCATTERING = 0.1  # of others: what only scatters looks like noise that is larger than thought

ALONE = 0.5  # of what has coordinates that may be there alone, that one is: a height is off, and nothing across
# how many of its coordinates may: of what has a direction each, of a payload its mass, at the centre of the body's
DIRECTED = {"pivot_position": 2, "com_offset": 2, "external_force": 2, "payload": 1}

# natural size (1 sigma) of each natural coordinate, in the small amounts that the effect itself states (``scales``)
NATURAL: Mapping[str, float | tuple[float, ...]] = {
    "gravity": 100.0,  # 10 m/s^2: forgotten altogether
    "payload": (100.0, 1.0, 1.0),  # the body's own mass; a third of its length off its centre
    "com_offset": 100.0,  # a tenth of the longest link
    "moment_of_inertia": 100.0,  # as large as the body's own
    "body_mass": 10.0,  # a tenth of the body's mass: computed, not weighed
    "link_length": 1000.0,  # 1 % of the longest link
    "pivot_position": 1000.0,  # the same
    "joint_clearance": 20.0,  # 0.4 % of the longest link
    "coulomb_friction": 300.0,  # a third of the torques that the rig carries
    "stribeck_friction": (200.0, 300.0, 30.0),  # the same, more at rest; slip speeds of the rig's own
    "load_friction": 300.0,  # 3 % of the longest link: friction of 0.3 on a pin of a tenth of it
    "viscous_friction": 300.0,  # a third of the torques, at the fastest speed
    "drag": 300.0,
    "joint_compliance": 3000.0,  # 0.3 % of the longest link under the rig's forces
    "joint_spring": 300.0,  # a third of the torques, over a radian
    "nonlinear_spring": (150.0, 300.0, 3.0),
    "external_force": 300.0,  # a third of the forces that the rig carries
    "load_torque": 300.0,
    "link_flexibility": 50.0,  # 2 GPa: plastic; steel is a hundredth of that
    "drive_compliance": 1000.0,  # 0.01 rad under the rig's torques
    "speed_ripple": 1000.0,  # 0.01 rad
    "periodic_torque": 300.0,  # a third of the torques
    "drive_backlash": 100.0,  # 0.01 rad
    "encoder_offset": 3000.0,  # 0.03 rad: a zero set by eye
    "encoder_harmonic": 1000.0,  # 0.01 rad: a disc of 30 mm that is 0.3 mm off its centre
    "sensor_bias": 30.0,  # times the noise
    "sensor_gain": 1000.0,  # 10 %
    "sensor_delay": 300.0,  # 0.03 rad of the fastest run
    "sensor_frame": 1000.0,  # 0.1 rad
    "clock_offset": 300.0,
    "sensor_lag": 30.0,
    "sensor_drift": 5.0,  # times the noise in the time of a radian
    "sensor_place": 200.0,  # 2 % of the longest link: glued by eye
    "axis_error": 300.0,  # 0.03 rad: the same
}
# the same of errors that careful work leaves on every rig; the search in released runs has its own in the effects
SLIGHT: Mapping[str, float] = {
    "link_length": 100.0,  # 0.1 % of the longest link
    "pivot_position": 100.0,
    "com_offset": 5.0,  # 0.5 % of it
    "payload": 2.0,  # 2 % of the body's mass
    "moment_of_inertia": 5.0,  # 5 %
    "coulomb_friction": 10.0,  # 1 % of the torques
    "viscous_friction": 10.0,
}
OTHERWISE = 300.0  # of an engineer's own effect

# of natural size, that an effect may be: an error is small oftener; a rig may carry far more than its model says
WIDTHS = np.array([1000, 100, 10, 3, 1, 0.3, 0.1, 0.03, 0.01])
WIDTH_ODDS = np.log([0.002, 0.008, 0.03, 0.07, 0.2, 0.25, 0.24, 0.15, 0.05])
CREDIBLE = 0.05  # probability of a set from which on its intervals count, and what a plan has to part
WORKMANSHIP = np.array([0.0, 0.03, 0.1, 0.3, 1.0])  # of what careful work leaves: the size of errors everywhere
WORKMANSHIP_ODDS = np.log([0.5, 0.1, 0.15, 0.15, 0.1])


@dataclass(frozen=True)
class Prior:
    """What is believed of the terms of a rig before its data are seen."""

    rig: Rig
    bounds: Callable[[Term], tuple[np.ndarray, np.ndarray]]
    places: Mapping[bool, int]  # how many effects at how many places there are, of sensors and of the rig
    variants: Mapping[tuple[str, str], int]
    simple_of: Mapping[Term, Term]  # of a richer form its simple one at the same place
    stated: Mapping[str, float]  # by name or name@where: how many times as likely as usual

    @classmethod
    def of(
        cls,
        rig: Rig,
        bounds: Callable[[Term], tuple[np.ndarray, np.ndarray]],
        sought: Sequence[Term],
        stated: Mapping[str, float] | None = None,
    ) -> Prior:
        """Of these terms, within their bounds, some of which are ``stated`` to be so many times as likely as usual."""
        keys = {sensor: {t.key for t in sought if t.effect.sensor is sensor} for sensor in (True, False)}
        variants: dict[tuple[str, str], int] = {}
        for term in sought:
            variants[term.key] = variants.get(term.key, 0) + (not in_each_run(term.effect, term.variant))
        simple: dict[str, list[Term]] = {}
        for term in sought:
            simple.setdefault(term.where, []).append(term)
        pairs = {rich: poor for rich in sought for poor in simple[rich.where] if rich.extends(poor)}
        places = {sensor: max(len(each), 1) for sensor, each in keys.items()}
        return cls(rig, bounds, places, variants, pairs, stated or {})

    def log_odds(self, term: Term) -> float:
        """Of a term being there against it being absent."""
        share = EXPECTED[term.effect.sensor] / self.places[term.effect.sensor]
        share = min(share, 0.5)
        odds = math.log(share / (1 - share) * self.stated.get(term.label, self.stated.get(term.effect.name, 1.0)))
        share = 1 / max(self.variants[term.key], 1)
        if in_each_run(term.effect, term.variant):
            share = EACH_RUN if term.effect.sensor else REPEATS
        odds += math.log(share)
        odds += math.log(RICHER) if term in self.simple_of else 0.0
        return odds + (math.log(SCATTERING) if term.effect.scatters else 0.0)

    def along(self, term: Term) -> dict[tuple[int, ...], float]:
        """Which coordinates a term may have, () of all, with the log of how likely that is of one that is there."""
        count = DIRECTED.get(term.effect.name, 0)
        if not count:
            return {(): 0.0}
        return {(): math.log(1 - ALONE)} | {(k,): math.log(ALONE / count) for k in range(count)}

    @staticmethod
    def nameless(places: int) -> float:
        """Log odds of an unknown at one of so many places."""
        share = NAMELESS / places
        return math.log(share / (1 - share))

    @staticmethod
    def nothing(log_odds: np.ndarray) -> float:
        """Log of how much more probable the empty set is than these odds (groups,) of each effect by itself make it."""
        alone = -float(np.log1p(np.exp(log_odds)).sum())
        return math.log(NOTHING / (1 - NOTHING)) + math.log(-math.expm1(alone)) - alone if alone < 0 else 0.0

    def family(self, term: Term) -> tuple[str, str]:
        """Of what there is one at most: an effect at a place in one variant, and either its simple form or a richer."""
        return self.simple_of.get(term, term).key

    def size(self, term: Term) -> np.ndarray:
        """Natural size (n,) of each natural coordinate; no more than the engineer's tolerances allow."""
        scales = np.asarray(term.effect.scales(self.rig, term.where, term.variant), float)
        size = scales * np.resize(np.asarray(NATURAL.get(term.effect.name, OTHERWISE), float), scales.size)
        return np.minimum(size, self._most(term))

    def widths(self, term: Term) -> np.ndarray:
        """Log odds of each width, of which none is beyond what a term's bounds allow."""
        return np.where(WIDTHS[:, None] * self.size(term) <= self._most(term), WIDTH_ODDS[:, None], -np.inf).min(axis=1)

    @staticmethod
    def is_slight(term: Term) -> bool:
        """Whether careful work leaves a little of it on every rig; of what may differ from run to run, one value."""
        return term.effect.name in SLIGHT and not in_each_run(term.effect, term.variant)

    def slight(self, term: Term) -> np.ndarray:
        """Sizes (n,) that careful work leaves of an effect on every rig."""
        scales = np.asarray(term.effect.scales(self.rig, term.where, term.variant), float)
        return np.minimum(scales * SLIGHT[term.effect.name], self._most(term))

    def _most(self, term: Term) -> np.ndarray:
        """How large natural coordinates (n,) may be at most by the engineer's tolerances."""
        low, high = self.bounds(term)
        return np.where(np.isfinite(high), np.maximum(np.abs(low), np.abs(high)), np.inf)

    def positive(self, term: Term) -> np.ndarray:
        """Which natural coordinates (n,) are never negative."""
        return np.asarray(self.bounds(term)[0] >= -1e-12)

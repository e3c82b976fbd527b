"""The flanks of a drive with backlash, the same in every engine: one-sided, and so damped that a crank which lands does
not bounce.

A flight from one flank to the other begins where the torque changes its sign, at a rate dT/dt; half a gap g and an
inertia I make it last (12 g I / (dT/dt))^(1/3).  A landing shall be over in a small share of that.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from analytic.mechanism import Mechanism

TURN_TO_LAND = math.pi  # rad that a motor turns in which its crank, put on a flank, has landed as it always does
INSTANTS_FELT = 37  # of a run at which what a motor feels is asked for
LANDING_SHARE = 1 / 40  # of a flight: the time constant of a landing
BRIEFEST = 2.5e-4  # rad of the motor's turn: shorter landings are seen by nobody
# Damping ratio of a landing, and landings in which a flank takes over what it carries: all decays alike
CRITICAL, HOLDS = math.sqrt(3) / 2, 3 * math.sqrt(3)
SPRINGY = 0.1  # the same where a drive.stiffness is stated


@dataclass(frozen=True)
class Felt:
    """What a motor feels of an ideal linkage at times (N,) s of a run: torque (N,) N.m and inertia (N,) kg.m^2."""

    times: np.ndarray
    torque: np.ndarray
    inertia: np.ndarray

    def landing(self, half_gap: float, top_speed: float) -> float:
        """The time constant (s) of a crank's landing in half a gap (rad), its motor's largest speed in rad/s."""
        slope = np.abs(np.diff(self.torque) / np.diff(self.times))
        turns = self.torque[1:] * self.torque[:-1] < 0
        steepest = float(slope[turns].max() if turns.any() else slope.max(initial=0.0))
        flight = (12 * half_gap * float(self.inertia.min()) / max(steepest, 1e-300)) ** (1 / 3)
        return float(
            np.clip(LANDING_SHARE * flight, BRIEFEST / top_speed, (self.times[-1] - self.times[0]) * LANDING_SHARE)
        )


@dataclass
class Flanks:
    """Half a gap (rad) with flanks of a stiffness (N.m/rad) and damping (N.m.s/rad).

    ``quickest`` (s) is the shortest time in which they do anything to the linkage.  Flanks with a time (s) in which one
    ``holds`` are rigid in the long run: within about that time it takes over the torque that its spring carries, and
    gives no more.
    """

    half_gap: float
    stiffness: float
    damping: float
    quickest: float
    holds: float = math.inf
    side: float = 0.0  # of the flank that is touched, 1 where the motor drives the crank; 0 in the gap
    held: float = 0.0  # N.m

    @classmethod
    def of(cls, mechanism: Mechanism, felt: Felt, top_speed: float) -> Flanks:
        """The flanks of a mechanism's drive in a run."""
        gap, stated = mechanism.half_gap, mechanism.drive_stiffness
        least, most = float(felt.inertia.min()), float(felt.inertia.max())
        landing = felt.landing(gap, top_speed)
        stiffness = stated or least / landing**2
        damping = 2 * math.sqrt(stiffness) * (SPRINGY * math.sqrt(least) if stated else CRITICAL * math.sqrt(most))
        quickest = min(math.sqrt(least / stiffness), 2 * least / damping)
        return cls(gap, stiffness, damping, quickest, math.inf if stated else HOLDS * landing)

    @property
    def rigid(self) -> bool:
        """Whether they hold."""
        return math.isfinite(self.holds)

    def carry(self, torque: float) -> float:
        """Carry a steady torque (N.m); says how far (rad) behind its motor the crank then is."""
        self.side = side(torque)
        self.held = abs(torque) if self.rigid else 0.0
        return self.side * self.half_gap + (0.0 if self.rigid else torque / self.stiffness)

    def torque(self, behind: float, rate: float, h: float) -> float:
        """Torque (N.m) over a step (s) on a crank that is so far (rad) behind its motor, and falls behind at a rate
        (rad/s).
        """
        if not self.side and abs(behind) > self.half_gap:
            self.side = math.copysign(1.0, behind)
        depth = self.side * behind - self.half_gap
        push = self.held + self.stiffness * depth + self.damping * self.side * rate
        if not self.side or push <= 0:
            self.side = self.held = 0.0
            return 0.0
        self.held += self.stiffness * depth * h / self.holds
        return self.side * push


def side(torque: float) -> float:
    """The flank that carries a torque (N.m): 1 where the motor drives the crank, -1 where the crank drives it."""
    return -1.0 if torque < 0 else 1.0

"""Rigs with several drives, drawn at random: arms and platforms whose motors follow smooth courses of their own."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.schedule import Turning
from analytic.mechanism import Mechanism
from analytic.mechanism.signals import AXES, POSE, Signal
from tests.evidence.scoreboard.rigs import (
    LOADED,
    Experiment,
    Plan,
    draw_mechanism,
    draw_noise,
    draw_unit,
    ideal,
)

CASES = ("five-bar", "3-rrr", "3-rpr", "2r-arm")
# what their hidden sets go through, one after the other
EFFECTS = (
    "payload", "link_length", "viscous_friction", "joint_clearance", "encoder_offset", "com_offset", "coulomb_friction",
    "joint_spring", "sensor_gain", "moment_of_inertia", "pivot_position", "sensor_bias", "external_force",
    "sensor_delay", "load_torque", "gravity", "sensor_frame",
)  # fmt: skip
SPEEDS = (2.0, 8.0)  # rad/s, of the fastest wave of a run
REACH = {"2r-arm": 0.8, "five-bar": 0.4, "3-rrr": 0.25, "3-rpr": 0.12}  # rad; of how far a cylinder is drawn out
SAMPLES = (300, 800)
WAVES = (1.0, 2.0)  # of the fastest, in a run
READ = 0.6  # of the components of the platform's pose, and of the joints, that have a sensor


@dataclass(frozen=True)
class Moves(Plan):
    """A run in which several motors move to and fro about where they are assembled, at ``speed`` (rad/s) at most.

    ``waves`` are by motor the amplitude (rad, m), rate (rad/s) and phase of each of its waves, ``middle`` what they
    are about.
    """

    middle: tuple[float, ...] = ()
    waves: tuple[tuple[tuple[float, float, float], ...], ...] = ()

    def command(self, time: np.ndarray) -> np.ndarray:
        """Where each motor is (k, N) at times (N,) s: rad, m."""
        return np.asarray(self.turning(time).theta)

    def turning(self, time: np.ndarray) -> Turning:
        """The same with its rates."""
        moved = np.zeros((3, len(self.waves), time.size))
        moved[0] += np.array(self.middle)[:, None]
        for k, waves in enumerate(self.waves):
            for amplitude, rate, phase in waves:
                for order in range(3):
                    moved[order, k] += amplitude * rate**order * np.sin(rate * time + phase + order * math.pi / 2)
        return Turning(*moved)


def draw_several(rng: np.random.Generator, cases: Sequence[str], wanted: Sequence[str], slow: bool) -> Experiment:
    """An experiment with one of the cases whose sensors include the ``wanted`` kinds; ``slow`` keeps it far from losing
    contact.

    Raises AssemblyError where the linkage that was drawn cannot move so.
    """
    case = str(rng.choice(list(cases)))
    nominal = draw_mechanism(rng, case)
    plans = _plans(rng, case, nominal, slow)
    peaks: dict[str, float] = {}
    for plan in plans:
        for name, values in ideal(nominal, plan).items():
            peaks[name] = max(peaks.get(name, 0.0), float(np.abs(values).max()))
    signals = _sensors(rng, case, nominal, wanted)
    noise: dict[str, float] = {}
    for s in signals:  # the two axes of a load cell are of one kind
        known = noise.get(s.sibling("x").name) if s.kind == "reaction" else None
        noise[s.name] = draw_noise(rng, s, peaks) if known is None else known
    units = {s.name: draw_unit(rng, s) for s in signals}
    return Experiment(case, nominal, plans, noise, bool(rng.random() < 0.5), units)


def _plans(rng: np.random.Generator, case: str, nominal: Mechanism, slow: bool) -> tuple[Moves, ...]:
    """Two or three runs, in which every motor goes its own way, the one swifter than the other."""
    low, high = SPEEDS
    high = math.sqrt(low * high) if slow else high
    count, n = int(rng.integers(2, 4)), int(rng.integers(SAMPLES[0], SAMPLES[1] + 1))
    speeds = np.exp(np.linspace(math.log(low), math.log(high), count) + rng.uniform(-0.15, 0.15, count))
    assembled, motors = Assembly(nominal).positions, nominal.motors
    plans = []
    names = ("slow", "middle", "fast") if count == 3 else ("slow", "fast")
    for name, speed in zip(names, speeds.tolist(), strict=True):
        reach = REACH[case] * rng.uniform(0.6, 1.0)
        waves = tuple(_waves(rng, speed, reach * (assembled[j.name] if j.prismatic else 1.0)) for j in motors)
        time = np.linspace(0.0, rng.uniform(*WAVES) * 2 * math.pi / speed, n)
        middle = tuple(assembled[joint.name] for joint in motors)
        plans.append(Moves(name, speed, 0.0, time, None, True, middle, waves))
    return tuple(plans)


def _waves(rng: np.random.Generator, speed: float, reach: float) -> tuple[tuple[float, float, float], ...]:
    """Two waves that together go no further than ``reach``; they have no period in common."""
    share = rng.uniform(0.5, 0.8)
    rates = speed * np.array([rng.uniform(0.35, 0.65), rng.uniform(0.75, 1.0)])
    phases = rng.uniform(0, 2 * math.pi, 2)
    return tuple(
        (float(reach * k), float(rate), float(phase))
        for k, rate, phase in zip((share, 1 - share), rates, phases, strict=True)
    )


def _sensors(rng: np.random.Generator, case: str, m: Mechanism, wanted: Sequence[str]) -> list[Signal]:
    """All encoders and all motors' efforts, and some of where the platform is and of the reactions."""
    pose = [Signal.of("pose", LOADED[case][0], component) for component in POSE]
    cells = [[Signal.of("reaction", j.name, axis) for axis in AXES] for j in m.joints if not j.prismatic]
    chosen = [*m.encoders, *m.efforts, *(s for s in pose if rng.random() < READ)]
    for cell in rng.permutation(len(cells))[: 1 + int(rng.integers(2))]:
        if "cell" in wanted or rng.random() < READ:
            chosen += cells[int(cell)]
    return chosen

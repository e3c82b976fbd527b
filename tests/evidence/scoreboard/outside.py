"""Faults that have no name in the vocabulary: a diagnosis must report them as unexplained, and may propose where they
are.

No engine has their laws; what it has is run, and put together.  The motor of a rigid linkage prescribes how it moves,
so that reactions and drive torque are linear in whatever torques act on it: a torque is run exactly as (undisturbed) +
torque(t) x (run with a unit torque - undisturbed).  A length that changes slowly, or jumps, is at each sample what it
is in a run with that length: by a parabola through three lengths, or one of two.  A crank behind its motor is driven
along a course.  What a law says depends on the motion, torque and forces of the undisturbed run.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from analytic.mechanism import GROUND, Load, Mechanism
from analytic.mechanism.signals import named, wrapped
from compare.results.diagnosis import Unknown
from tests.evidence.scoreboard.memory import Slope, bouc_wen, bristle, remembered
from tests.evidence.scoreboard.rigs import Experiment, Plan, Rejected, course_grid, ideal

# kinds of each kind of set; the vocabulary came to have words for some of the first
OUTSIDE = ("cracked tooth", "Stribeck friction", "nonlinear spring", "periodic torque", "bent link")
UNNAMED = ("hysteretic spring", "slipping belt", "growing link", "loose bolt", "stick-slip")
EXCLUDED: Mapping[str, tuple[str, ...]] = {
    "Stribeck friction": ("stribeck_friction",),
    "nonlinear spring": ("nonlinear_spring",),
    "periodic torque": ("periodic_torque",),
}  # without these words they are still outside the vocabulary
UNKNOWN: Mapping[str, Unknown] = {
    **dict.fromkeys((*OUTSIDE, *UNNAMED), "torque"),
    **dict.fromkeys(("cracked tooth", "slipping belt"), "lag"),
    **dict.fromkeys(("growing link", "loose bolt"), "length"),
    "bent link": "bend",
}
FINE = 2880  # times a revolution at which a joint's motion is followed
REVERSES = 0.1  # of all samples at least: those in which a link with a loose bolt is pulled, and those in which pushed
Course = Callable[[np.ndarray], np.ndarray]  # motor angle (rad) at times (s)
Simulate = Callable[[Mechanism, Plan, np.ndarray, Course | None], Mapping[str, np.ndarray]]


@dataclass(frozen=True)
class Outside:
    """A fault outside the vocabulary: ``size`` scales it, ``shape`` are the other numbers that it has."""

    kind: str
    where: str
    size: float
    shape: dict[str, float]

    def signals(self, nominal: Mechanism, plan: Plan, time: np.ndarray, simulate: Simulate) -> dict[str, np.ndarray]:
        """Signals (N,) at times (N,) s of a run, by engine or analytically as ``simulate`` does it; the encoder reads
        the motor.
        """
        m = nominal if plan.loads is None else nominal.replace(loads=plan.loads)
        if self.kind in ("cracked tooth", "slipping belt"):
            return dict(simulate(m, plan, time, self._course(m, plan, time, simulate)))
        if self.kind == "bent link":
            return dict(simulate(moved(m, self.where, 0.0, self.size), plan, time, None))
        still = simulate(m, plan, time, None)
        if self.kind in ("growing link", "loose bolt"):
            longest, shortest = (simulate(moved(m, self.where, e, 0.0), plan, time, None) for e in self._lengths)
            if self.kind == "loose bolt":
                pulled = pull(m, self.where, still) > 0
                return {s: np.where(pulled, longest[s], shortest[s]) for s in still}
            return between(m, still, shortest, longest, self.grown(time))
        pushed = simulate(self._with_unit_torque(m), plan, time, None)
        torque = self.torque(m, plan, time, still)
        return {s: still[s] + torque * (pushed[s] - still[s]) for s in still}

    @property
    def unknown(self) -> Unknown:
        """What a proposal would call it."""
        return UNKNOWN[self.kind]

    @property
    def excluded(self) -> tuple[str, ...]:
        """Words of the vocabulary that say what it is, and that a diagnosis is to do without."""
        return EXCLUDED.get(self.kind, ())

    def places(self, m: Mechanism) -> tuple[str, ...]:
        """Where a proposal of it would be right: of a torque on a body, in the joints of the body."""
        if self.unknown == "torque" and self.where in m.moving:
            return tuple(j.name for j in m.joints if self.where in j.bodies and not j.prismatic)
        return (self.where,)

    # ---------------------------------------------------------------- a crank behind its motor

    def _course(self, m: Mechanism, plan: Plan, time: np.ndarray, simulate: Simulate) -> Course:
        if self.kind == "cracked tooth":
            return lambda t: plan.command(t) + self._bump(plan.command(t))
        grid = course_grid(plan, time)
        behind = self.lag(plan, grid, simulate(m, plan, grid, None)["drive_torque"])
        return lambda t: plan.command(t) - behind(t)

    def _bump(self, angle: np.ndarray) -> np.ndarray:
        beside = wrapped(angle - self.shape["angle"])
        return np.asarray(self.size * np.exp(-0.5 * (beside / self.shape["width"]) ** 2))

    def lag(self, plan: Plan, time: np.ndarray, torque: np.ndarray) -> CubicSpline:
        """How far (rad) a belt has slipped since the plan's first sample, over time (N,) s: at a rate in proportion to
        the size of the drive torque (N,) N.m, and always behind the motor.
        """
        rate = CubicSpline(time, math.copysign(self.size, plan.speed) * np.abs(torque))
        slipped = rate.antiderivative()
        return CubicSpline(time, slipped(time) - slipped(plan.time[0]))

    # ---------------------------------------------------------------- a length that changes

    @property
    def _lengths(self) -> tuple[float, float]:
        """By how much (m) the link is longer in the two runs beside the undisturbed one."""
        return (self.size, -self.size) if self.kind == "loose bolt" else (self.size, self.size / 2)

    def grown(self, time: np.ndarray) -> np.ndarray:
        """The share (N,) of its size by which a link has grown at times (N,) s of a run that begins cold at the
        first.
        """
        return np.asarray(-np.expm1(-(time - time[0]) / self.shape["warming"]))

    # ---------------------------------------------------------------- torques

    def _with_unit_torque(self, m: Mechanism) -> Mechanism:
        """1 N.m on the second body of the joint and back on its first; on a body alone where there is no such joint."""
        loads = [*m.loads]
        if self.where in m.moving:
            return m.replace(loads=(*loads, Load(body=self.where, torque=1.0)))
        first, second = m.joint(self.where).bodies
        loads += [Load(body=b, torque=t) for b, t in ((first, -1.0), (second, 1.0)) if b != GROUND]
        return m.replace(loads=tuple(loads))

    def torque(self, m: Mechanism, plan: Plan, time: np.ndarray, signals: Mapping[str, np.ndarray]) -> np.ndarray:
        """The torque (N,) N.m at times (N,) s of a run of which these are the undisturbed signals."""
        shape = self.shape
        if self.kind == "periodic torque":
            return np.asarray(self.size * np.sin(shape["rate"] * time + shape["phase"]))
        if self.kind == "hysteretic spring":
            return self._remembering(bouc_wen(shape["give"], shape["sharpness"], shape["fatness"]), m, plan, time)
        if self.kind == "stick-slip":
            return self._remembering(bristle(shape["give"], shape["stribeck_rate"], shape["excess"]), m, plan, time)
        angle, rate = _relative(m, self.where, signals)
        if self.kind == "nonlinear spring":
            return np.asarray(-self.size * ((angle - shape["rest"]) / shape["travel"]) ** 3)
        slow = np.exp(-((rate / shape["stribeck_rate"]) ** 2))
        return np.asarray(-self.size * (1 + shape["excess"] * slow) * np.tanh(rate / shape["sharp_rate"]))

    def _remembering(self, slope: Slope, m: Mechanism, plan: Plan, time: np.ndarray) -> np.ndarray:
        """A torque that follows the joint's motion from a revolution before the run, by which time it repeats."""
        period = 2 * math.pi / abs(plan.speed)
        fine = np.linspace(time.min() - period, time.max(), 2 * math.ceil(FINE / 2 * (np.ptp(time) / period + 1)) + 1)
        _, rate = _relative(m, self.where, ideal(m, replace(plan, time=fine)))
        return np.asarray(-self.size * np.interp(time, fine[::2], remembered(slope, fine, rate)))


def moved(m: Mechanism, body: str, along: float, across: float) -> Mechanism:
    """The last point of a body moved along its axis and beside it (m); mass, marker and loads where they were."""
    b = m.moving[body]
    last = list(b.points)[-1]
    x, y = b.points[last]
    points = {**b.points, last: (x + along, y + across)}
    return m.with_body(body, com=(b.centre.real, b.centre.imag), inertia=b.moment_of_inertia, points=points)


def between(
    m: Mechanism,
    none: Mapping[str, np.ndarray],
    half: Mapping[str, np.ndarray],
    whole: Mapping[str, np.ndarray],
    share: np.ndarray,
) -> dict[str, np.ndarray]:
    """Signals (N,) of a linkage that has a share (N,) of a change of length, of runs with none, half, and the whole of
    it: by a parabola in each sample.
    """
    known = named(m.bodies, m.joints, m.drives, m.sensors)
    found = {}
    for s, base in none.items():
        middle, end = (known[s].apart(run[s], base) for run in (half, whole))
        found[s] = base + share * (4 * middle - end) + share**2 * (2 * end - 4 * middle)
    return found


def pull(m: Mechanism, body: str, signals: Mapping[str, np.ndarray]) -> np.ndarray:
    """The pull (N,) N in a link of two pins: the mean of the forces at its ends, along it and away from each other."""
    b = m.moving[body]
    (first, start), *_, (last, end) = ((joint, complex(*point)) for joint, point in b.points.items())
    axis = np.exp(1j * signals[f"{body}_angle"]) * (end - start) / abs(end - start)
    ends = []
    for joint in (first, last):
        force = signals[f"reaction_{joint}_x"] + 1j * signals[f"reaction_{joint}_y"]
        ends.append((force if m.joint(joint).bodies[1] == body else -force) * axis.conj())
    return np.asarray((ends[1] - ends[0]).real / 2)


def _relative(m: Mechanism, joint: str, signals: Mapping[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """A joint's angle (rad) and rate (rad/s), second body less first."""
    first, second = m.joint(joint).bodies
    angle, rate = (
        signals[f"{second}_{part}"] - (signals[f"{first}_{part}"] if first != GROUND else 0.0)
        for part in ("angle", "angular_velocity")
    )
    return angle, rate


def draw_outside(kind: str, experiment: Experiment, rng: np.random.Generator) -> Outside:
    """A fault of a kind, of a size that is scaled afterwards.  Raises Rejected where the linkage has no place for
    it.
    """
    if kind in ("cracked tooth", "slipping belt"):
        return _in_the_drive(kind, rng)
    if kind in ("bent link", "growing link", "loose bolt"):
        return _of_a_link(kind, experiment, rng)
    m = experiment.nominal
    if kind == "periodic torque":
        rocker = [b.name for b in m.bodies if b.name != m.driven and b.length > 0]
        rate = abs(experiment.plans[0].speed) * rng.uniform(4.2, 4.8)
        return Outside(kind, str(rng.choice(rocker)), 1e-3, {"rate": rate, "phase": rng.uniform(-math.pi, math.pi)})
    return _in_a_joint(kind, experiment, rng)


def _in_the_drive(kind: str, rng: np.random.Generator) -> Outside:
    if kind == "slipping belt":
        return Outside(kind, "drive", 1e-3, {})
    return Outside(kind, "drive", 1e-3, {"angle": rng.uniform(-math.pi, math.pi), "width": rng.uniform(0.12, 0.25)})


def _of_a_link(kind: str, experiment: Experiment, rng: np.random.Generator) -> Outside:
    m = experiment.nominal
    links = [b.name for b in m.bodies if b.length > 0]
    if kind == "bent link":
        links.remove(str(m.driven))
    if kind == "loose bolt":
        links = [b for b in links if _has_two_pins(m, b) and _reverses(experiment, b)]
        if not links:
            raise Rejected("no link is both pulled and pushed")
    where = str(rng.choice(links))
    longest = max(float(np.ptp(plan.time)) for plan in experiment.plans)
    shape = {"warming": longest * rng.uniform(0.3, 1.0)} if kind == "growing link" else {}
    return Outside(kind, where, 1e-3 * m.moving[where].length, shape)


def _has_two_pins(m: Mechanism, body: str) -> bool:
    pins = {j.name for j in m.joints if body in j.bodies and not j.prismatic}
    return len([j for j in m.joints if body in j.bodies]) == len(pins) == 2 and pins == set(m.moving[body].points)


def _reverses(experiment: Experiment, body: str) -> bool:
    """Whether a link is pulled for a while and pushed for a while."""
    pulled = np.concatenate(
        [pull(experiment.nominal, body, ideal(experiment.nominal, p)) > 0 for p in experiment.plans]
    )
    return REVERSES < float(pulled.mean()) < 1 - REVERSES


def _in_a_joint(kind: str, experiment: Experiment, rng: np.random.Generator) -> Outside:
    m = experiment.nominal
    signals = ideal(m, experiment.plans[0])
    rocking = [
        j.name
        for j in m.joints
        if not j.prismatic and j.name != m.drive_joint.name and np.ptp(np.sign(_relative(m, j.name, signals)[1])) > 1
    ]
    where = str(rng.choice(rocking))
    angle, turning = _relative(m, where, signals)
    fast, travel = float(np.abs(turning).max()), float(np.ptp(angle) / 2)
    if kind == "nonlinear spring":
        return Outside(kind, where, 1e-3, {"rest": float(angle.mean()), "travel": travel})
    if kind == "hysteretic spring":
        give = travel * rng.uniform(0.1, 0.4)
        shape = {"give": give, "sharpness": rng.uniform(1.0, 4.0), "fatness": rng.uniform(0.5, 0.9)}
    elif kind == "stick-slip":
        give = travel * rng.uniform(0.05, 0.15)
        shape = {"give": give, "stribeck_rate": fast * rng.uniform(0.1, 0.3), "excess": rng.uniform(0.5, 1.5)}
    else:
        shape = {"stribeck_rate": 0.35 * fast, "excess": 2.0, "sharp_rate": 0.01 * fast}
    return Outside(kind, where, 1e-3, shape)


def resized(outside: Outside, factor: float) -> Outside:
    """The same fault, ``factor`` times as large."""
    return replace(outside, size=outside.size * factor)

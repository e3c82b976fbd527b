"""Runs of a :class:`~sim_models.planar_bodies.PlanarWorld`: static, driven and released, and where its pins rest."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from sim_models.engine import Request, SimulationError, Trace, Unsupported, installed_version
from sim_models.planar_bodies import PROBE, PlanarWorld
from sim_models.start import Gaps, Pose, poses, schedule, substeps

STENCIL = 1e-3  # rad of crank angle, for the rates of a gap's equilibrium
NO_LOAD = 1e-9  # of the largest reaction: one below it leaves its pin loose
NO_FORCE = 1e-6  # N, the same where all vanish: the engines' rounding
NUDGE = 1e-4  # rad; of a depth, ten times that: differences for Newton's Jacobian
SETTLED = 1e-7  # of a Newton step's limit (0.3 rad, 0.7 of a depth): the last step that is worth taking
CLOSE = 1e-4  # of the same: below it a step that is no longer halved is the engine's rounding
SAMPLES = 24  # crank angles at which a run's largest reactions are looked for
JOURNAL_SAMPLES = 4000  # at least, where a run has as many steps
TOO_DEEP = 0.1  # of the shortest link at a joint: a penetration that means divergence

Changes = Mapping[str, complex]
NONE: Changes = MappingProxyType({})


def simulate(make: Callable[[Request], PlanarWorld], request: Request, package: str) -> Trace:
    """Run a request in worlds that ``make`` builds.  Raises SimulationError, Unsupported or AssemblyError."""
    with silence(), contextlib.ExitStack() as stack:
        world = stack.enter_context(contextlib.closing(make(request)))
        ideal = stack.enter_context(contextlib.closing(make(replace(request, joint_model="ideal")))) if world.pins else world
        run = _static if request.motion == "static" else _moving
        trace = run(world, Equilibria(world, ideal))
    return replace(trace, version=installed_version(package) or "unknown")


@contextlib.contextmanager
def silence() -> Iterator[None]:
    """Keep what an engine's C++ prints off the standard streams."""
    sys.stdout.flush()
    sys.stderr.flush()
    kept = [os.dup(1), os.dup(2)]
    sink = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(sink, 1)
        os.dup2(sink, 2)
        yield
    finally:
        for target, copy in zip((1, 2), kept, strict=True):
            os.dup2(copy, target)
            os.close(copy)
        os.close(sink)


# -------------------------------------------------------------------- equilibria


@dataclass
class Equilibria:
    """Finds where the pins rest: the gaps at which none accelerates, by Newton's method on one step of the engine.

    A gap is searched as direction and depth; a rigid contact has no depth.  The search starts from the reaction of the
    same engine's ideal linkage, turned and scaled as the last answer was.
    """

    world: PlanarWorld
    ideal: PlanarWorld
    last: dict[str, tuple[complex, float]] = field(default_factory=dict)

    def gaps(self, theta: float, speed: float, slope: Changes = NONE, bend: Changes = NONE) -> dict[str, complex]:
        """Gap (m) of every pin with the crank at theta (rad) and ``speed`` (rad/s).

        ``slope`` and ``bend`` are the gaps' derivatives by crank angle (m/rad, m/rad^2).  Raises SimulationError where no
        force presses a pin, or no equilibrium is found.
        """
        world = self.world
        if not world.pins:
            return {}
        forces = self.ideal.ideal_forces(theta, speed)
        names = list(world.pins)
        loose = [name for name in names if abs(forces[name]) <= max(NO_FORCE, NO_LOAD * max(abs(f) for f in forces.values()))]
        if loose:
            raise self._failed(f"nothing presses the pin of joint {loose[0]!r}", theta, "give the linkage a load or gravity, or start it centred")
        begin = np.array([self._guess(name, forces[name]) for name in names])
        n = len(names)

        def gaps_at(x: np.ndarray) -> dict[str, complex]:
            depth = x[n:] if world.compliant else np.zeros(n)
            return {name: (world.pins[name].clearance + d) * np.exp(1j * phi) for name, phi, d in zip(names, x[:n], depth, strict=True)}

        def miss(x: np.ndarray) -> np.ndarray:
            found = world.gap_accelerations(poses(world.assembly, theta, speed, near(gaps_at(x), theta, slope, bend)))
            polar = [(found[name] - bend.get(name, 0j) * speed**2) * np.exp(-1j * phi) for name, phi in zip(names, x[:n], strict=True)]
            return np.array([p.imag for p in polar] + ([p.real for p in polar] if world.compliant else []))

        x = self._newton(begin.T.ravel() if world.compliant else begin[:, 0], miss, n, theta)
        settled = gaps_at(x)
        for name in names:
            self.last[name] = (settled[name] / forces[name], (abs(settled[name]) - world.pins[name].clearance) / abs(forces[name]))
        return settled

    def _guess(self, name: str, force: complex) -> tuple[float, float]:
        """Direction (rad) and depth (m) to start from, given the ideal linkage's reaction (N)."""
        turn, give = self.last.get(name, (1 + 0j, 1 / self.world.pins[name].contact.stiffness))
        return float(np.angle(turn * force)), give * abs(force)

    def _newton(self, x: np.ndarray, miss: Callable[[np.ndarray], np.ndarray], angles: int, theta: float) -> np.ndarray:
        turns = np.arange(x.size) < angles
        previous = np.inf
        for _ in range(60):
            error = miss(x)
            nudge = np.where(turns, NUDGE, 10 * NUDGE * np.abs(x))
            jacobian = np.column_stack([(miss(x + nudge * unit) - error) / nudge[k] for k, unit in enumerate(np.eye(x.size))])
            if not np.all(np.isfinite(jacobian)) or np.linalg.matrix_rank(jacobian) < x.size:
                break
            change = -np.linalg.solve(jacobian, error)
            relative = float((np.abs(change) / np.where(turns, 0.3, 0.7 * np.abs(x))).max())
            x = x + change / max(1.0, relative)
            if relative < SETTLED or CLOSE > relative > previous / 2:
                return x
            previous = relative
        self.last.clear()
        what = f"no equilibrium of the pins at {', '.join(self.world.pins)} was found"
        raise self._failed(what, theta, "forces may lift them off there: choose other angles, or start the run centred")

    def _failed(self, what: str, theta: float, remedy: str) -> SimulationError:
        return SimulationError(f"{self.world.engine} {self.world.request.joint_model}: {what} at crank angle {np.degrees(theta):.6g} deg; {remedy}")

    def steady(self, theta: float, speed: float) -> dict[str, Pose]:
        """Poses and velocities of the linkage with its pins in steady contact at crank angle theta (rad)."""
        slope: dict[str, complex] = {}
        bend: dict[str, complex] = {}
        here = self.gaps(theta, speed)
        for _ in range(2 if speed and here else 0):
            before, after = (self.gaps(theta + side * STENCIL, speed, slope, bend) for side in (-1, 1))
            slope = {n: (after[n] - before[n]) / (2 * STENCIL) for n in here}
            bend = {n: (after[n] - 2 * here[n] + before[n]) / STENCIL**2 for n in here}
            here = self.gaps(theta, speed, slope, bend)
        return poses(self.world.assembly, theta, speed, near(here, theta, slope, bend))

    def peaks(self, theta: np.ndarray, speed: float) -> dict[str, float]:
        """Largest reaction (N) of each pin in the ideal linkage over crank angles theta (rad) at ``speed`` (rad/s)."""
        seen = [self.ideal.ideal_forces(float(t), speed) for t in theta[:: max(1, theta.size // SAMPLES)]] if self.world.pins else []
        return {name: max(abs(forces[name]) for forces in seen) for name in self.world.pins}


def near(gaps: Changes, theta: float, slope: Changes = NONE, bend: Changes = NONE) -> Gaps:
    """Gaps (m) as a parabola in the crank angle about theta (rad)."""
    return lambda t: {n: g + slope.get(n, 0j) * (t - theta) + bend.get(n, 0j) * (t - theta) ** 2 / 2 for n, g in gaps.items()}


# -------------------------------------------------------------------- runs


def _static(world: PlanarWorld, found: Equilibria) -> Trace:
    angles = world.request.crank_angle
    rows: list[dict[str, float]] = [{}] * angles.size
    for k in np.argsort(angles if world.speed >= 0 else -angles, kind="stable"):
        theta = float(angles[k])
        for each in (world, found.ideal):
            each.set_sliding(theta)
        world.approach(poses(world.assembly, theta, 0.0, near(found.gaps(theta, 0.0), theta)), PROBE)
        rows[k] = world.observe(PROBE)
        _check_depth(world, theta)
    trace = _trace(world, rows, angles, None, PROBE)
    gaps = {n: trace.signals[f"clearance_{n}_x"] + 1j * trace.signals[f"clearance_{n}_y"] for n in world.pins}
    free = {n: float(np.mean(np.abs(g) < world.pins[n].clearance * (1 - 1e-9))) for n, g in gaps.items()}
    return replace(trace, free_share=free, journal={n: np.column_stack([g.real, g.imag]) for n, g in gaps.items()})


@dataclass(frozen=True)
class Plan:
    """When a moving run reports, and from where it starts: times (s) from the first report, or from release."""

    times: np.ndarray  # (N,) in the request's order
    theta: np.ndarray  # (M,) rad: crank angles that the run is known to pass
    begin: float  # rad
    speed: float  # rad/s
    lead: float  # s from the start to time 0

    @classmethod
    def of(cls, world: PlanarWorld) -> Plan:
        """Raises Unsupported where a request's angles or times make no run."""
        request = world.request
        if not world.speed:
            times = np.zeros(0) if request.time is None else np.asarray(request.time, float)
            if times.size == 0 or not np.all(times >= 0):
                raise Unsupported(f"{world.mechanism.name}: a released linkage needs request.time, from 0 s on; it is {request.time}")
            return cls(times, np.array([world.assembly.start]), world.assembly.start, request.start_speed, float(times.min()))
        if request.crank_angle.size == 0:
            raise Unsupported(f"{world.mechanism.name}: a driven run needs crank angles to report at; give at least one")
        plan = schedule(request)
        times = np.empty(plan.order.size)
        times[plan.order] = np.round(plan.time, 12)  # equal angles, at equal times
        begin = float(plan.theta[0] - np.sign(plan.speed) * request.lead_in)
        return cls(times, plan.theta, begin, plan.speed, abs(request.lead_in / plan.speed))


def _moving(world: PlanarWorld, found: Equilibria) -> Trace:
    """Drive the crank at constant speed, or release it, and observe on the way."""
    request, plan = world.request, Plan.of(world)
    longest = request.step or world.longest_step(plan.begin, found.peaks(plan.theta, plan.speed))
    bodies = poses(world.assembly, plan.begin, plan.speed) if request.start == "centred" else found.steady(plan.begin, plan.speed)
    stops = np.unique(plan.times)
    leading = substeps(plan.lead, longest)
    intervals = [substeps(x, longest) for x in np.diff(stops)]
    h = leading[1] if plan.lead > 0 else intervals[0][1] if intervals else longest
    world.start(bodies, h)
    for _ in range(leading[0] if plan.lead > 0 else 0):
        world.step(h)
    tally = Tally(world, max(1, sum(count for count, _ in intervals) // JOURNAL_SAMPLES))
    seen = []
    last = intervals[-1][1] if intervals else h
    for count, size in [*intervals, (1, last)]:
        seen.append(world.observe(size))
        _check_depth(world, seen[-1][f"{world.mechanism.driven}_angle"])
        tally.add(size)
        for _ in range(count - 1):
            world.step(size)
            tally.add(size)
    rows = [seen[k] for k in np.searchsorted(stops, plan.times)]
    theta = np.array([row[f"{world.mechanism.driven}_angle"] for row in rows])
    if world.speed and not np.allclose(theta, request.crank_angle, rtol=0, atol=1e-6):
        raise SimulationError(f"{world.engine}: the crank is {np.abs(theta - request.crank_angle).max():.3g} rad off its course; use a smaller step")
    trace = _trace(world, rows, request.crank_angle if world.speed else theta, plan.times, longest)
    return replace(trace, free_share=tally.free_share(), journal=tally.journal())


class Tally:
    """Adds up the time without contact and samples the pins' paths."""

    def __init__(self, world: PlanarWorld, stride: int) -> None:
        self.world, self.stride, self.steps, self.time = world, stride, 0, 0.0
        self.free = dict.fromkeys(world.pins, 0.0)
        self.paths: dict[str, list[complex]] = {name: [] for name in world.pins}

    def add(self, h: float) -> None:
        """Take in the step (s) just made."""
        for name in self.free:
            self.free[name] += 0.0 if self.world.pin_forces[name] else h
            if self.steps % self.stride == 0:
                self.paths[name].append(self.world.gap(name)[0])
        self.steps += 1
        self.time += h

    def free_share(self) -> dict[str, float]:
        """Share of the time that each pin spent without contact."""
        return {name: float(time / self.time) for name, time in self.free.items()}

    def journal(self) -> dict[str, np.ndarray]:
        """Path (M, 2) of every pin (m)."""
        return {name: np.array([(g.real, g.imag) for g in path]) for name, path in self.paths.items()}


def _check_depth(world: PlanarWorld, theta: float) -> None:
    for name, pin in world.pins.items():
        gap = abs(world.gap(name)[0])
        shortest = min(b.length for b in world.mechanism.bodies if b.name in pin.joint.bodies and b.length)
        if not gap < pin.clearance + TOO_DEEP * shortest:
            raise SimulationError(
                f"{world.engine} {world.request.joint_model}: the pin at {name} is {gap:.3g} m off its centre (clearance {pin.clearance:g} m) near "
                f"crank angle {np.degrees(theta):.4g} deg: the run diverged; use a smaller step or softer contact"
            )


def _trace(world: PlanarWorld, rows: list[dict[str, float]], theta: np.ndarray, time: np.ndarray | None, step: float) -> Trace:
    request = world.request
    return Trace(
        simulator=world.engine, version="", joint_model=request.joint_model, motion=request.motion, crank_angle=theta, time=time,
        signals={name: np.array([row[name] for row in rows]) for name in rows[0]},
        clearance={name: pin.clearance for name, pin in world.pins.items()}, settings={"step": step} | world.settings(),
    )  # fmt: skip

"""Runs of a :class:`~sim_models.leapfrog.bodies.LeapfrogWorld`: static, driven and released."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.polynomial import Polynomial

from analytic.kinematics.schedule import Course, DriveMotion, Steady
from analytic.mechanism.signals import position
from sim_models.common.backlash import Felt, Flanks
from sim_models.common.contact_laws import TOO_DEEP, shortest_link
from sim_models.common.failed_starts import own_start
from sim_models.common.journal import free_share
from sim_models.common.rates import part_rates
from sim_models.common.silence import silence
from sim_models.common.start import Pose, check_steps
from sim_models.common.travel import told_by
from sim_models.engine import Cause, Request, SimulationError, Trace, Unsupported, installed_version
from sim_models.leapfrog.bodies import WARM_UP, LeapfrogWorld
from sim_models.leapfrog.courses import (
    Behind,
    Changes,
    Grid,
    Path,
    moving,
    near,
    path_of,
    told_angle,
)
from sim_models.leapfrog.equilibria import Equilibria
from sim_models.leapfrog.probe import PROBE, drive_inertia, forces_at
from sim_models.leapfrog.steps import longest_step
from sim_models.leapfrog.watch import Watch
from sim_models.run.path import CoursePath, CrankPath, RestingPath

JOURNAL_SAMPLES = 4000  # at least, where a run has as many steps
AT_REST = 1e-9  # rad, of a crank on a spring
OFF_COURSE = 1e-7  # rad, what a rigidly driven crank may be off its course
FELT = 37  # instants of a run at which what a motor feels is asked for
HEEDED_STEPS = 30  # before a report, in which friction settles where the motion does not depend on it
# Signals at rest, of a world by its equilibria and those of rods, with its motor at an angle (rad), or at a time (s).
Rest = Callable[[LeapfrogWorld, Equilibria, Equilibria | None, float], dict[str, float]]
HELD = 1e-3  # of the largest reaction: what one-sided pins and rods may differ by where both hold the same equilibrium


def run(make: Callable[[Request], LeapfrogWorld], request: Request, package: str) -> Trace:
    """Run a request in worlds that ``make`` builds.  Raises SimulationError, Unsupported or AssemblyError."""
    with silence(), contextlib.ExitStack() as stack:
        world = stack.enter_context(contextlib.closing(make(request)))
        ideal = stack.enter_context(contextlib.closing(make(_ideal(request)))) if world.loose or world.soft else world
        found, rods = Equilibria(world, ideal), None
        if world.one_sided:
            rods = Equilibria(
                stack.enter_context(contextlib.closing(make(replace(request, joint_model="massless-link")))), ideal
            )
        _check_rims(world)
        with own_start(world.engine, request, world.assembly):
            trace = _static(world, found, rods) if request.motion == "static" else _moving(world, found)
    return replace(trace, version=installed_version(package) or "unknown")


# -------------------------------------------------------------------- runs


def _check_rims(world: LeapfrogWorld) -> None:
    """Raise Unsupported where a bearing with clearance is to be soft whose rim is rigid, or a motor to push a block
    that is loose in its guide.
    """
    steered = [each.joint.name for each in world.steered if each.joint.name in world.blocks]
    if steered:
        raise Unsupported(
            f"{world.engine}: {world.mechanism.name}: its motors push no block that has clearance in its guide; leave"
            f" out the clearance of joint {steered[0]!r}, or use another simulator"
        )
    soft = [name for name in world.pins if name in world.mechanism.soft_bearings]
    if soft and world.request.joint_model == "contact":
        raise Unsupported(
            f"{world.engine}: {world.mechanism.name}: its contact is rigid; leave out radial_stiffness of joint"
            f" {soft[0]!r}, or use joint model spring-damper"
        )


def _ideal(request: Request) -> Request:
    """The same of the ideal linkage."""
    m = request.mechanism
    return replace(request, joint_model="ideal", mechanism=m.ideal() if m.soft_bearings else m)


def _static(world: LeapfrogWorld, found: Equilibria, rods: Equilibria | None) -> Trace:
    request, by_rods = world.request, 0
    rest: Rest = _rest
    asked, places, time = request.schedule.crank_angle, "angles", None
    if asked is None:
        asked, places, rest = request.schedule.time, "instants", _along(world)
        time = asked
    rows: list[dict[str, float]] = [{}] * asked.size
    for k in np.argsort(asked if world.speed >= 0 else -asked, kind="stable"):
        rows[k] = rest(world, found, rods, float(asked[k]))
        by_rods += world.by_rods
    told = asked if time is None else np.array([row[_told(world)] for row in rows])
    trace = _trace(world, rows, told, time, PROBE)
    if by_rods:
        trace = replace(trace, settings={**trace.settings, "read_from_rods": f"{by_rods} of {asked.size} {places}"})
    gaps = {n: trace.signals[f"clearance_{n}_x"] + 1j * trace.signals[f"clearance_{n}_y"] for n in world.pins}
    free = {n: free_share(g, world.pins[n].clearance) for n, g in gaps.items()}
    for name, block in world.blocks.items():
        height = np.hypot(trace.signals[f"clearance_{name}_x"], trace.signals[f"clearance_{name}_y"])
        reach = np.asarray(block.guide.reach(height, trace.signals[f"clearance_{name}_angle"]))
        free[name] = free_share(reach, block.guide.clearance)
    return replace(trace, free_share=free, journal={n: np.column_stack([g.real, g.imag]) for n, g in gaps.items()})


def _along(world: LeapfrogWorld) -> Rest:
    """How to find signals at rest with the drives where their courses have them at a time (s)."""
    path = RestingPath(world.request, world.assembly)

    def rest(world: LeapfrogWorld, found: Equilibria, rods: Equilibria | None, time: float) -> dict[str, float]:
        _slide(world, found, rods, lambda: path.moving(time, 1.0))
        row = _seen(world, found, rods, path, time)
        _check_depth(world, f"{time:.4g} s")
        return row

    return rest


def _rest(world: LeapfrogWorld, found: Equilibria, rods: Equilibria | None, motor: float) -> dict[str, float]:
    """Signals at rest with the motor at an angle (rad), which a crank on a spring lags."""
    theta = motor
    for _ in range(50):
        _slide(world, found, rods, partial(CrankPath(world.assembly).moving, theta, -1.0 if world.speed < 0 else 1.0))
        row = _seen(world, found, rods, Steady(theta), 0.0)
        _check_depth(world, _at_angle(theta))
        lagging = motor - world.behind(row["drive_torque"])
        if abs(lagging - theta) < AT_REST:
            return row
        theta = lagging
    raise SimulationError(
        f"{world.engine}: no rest of the crank on its drive was found near crank angle {np.degrees(motor):.6g} deg",
        Cause.NO_EQUILIBRIUM,
        "give a stiffer drive, one with less backlash, or smaller loads",
    )


def _slide(
    world: LeapfrogWorld, found: Equilibria, rods: Equilibria | None, motion: Callable[[], Mapping[str, Pose]]
) -> None:
    """Let friction oppose a motion, in all that is at rest."""
    for each in (world, found.ideal, *([rods.world] if rods else [])):
        each.laws.set_sliding(motion)


def _seen(
    world: LeapfrogWorld, found: Equilibria, rods: Equilibria | None, path: Path, time: float
) -> dict[str, float]:
    """Signals at rest at a time (s) of a path that goes nowhere."""
    return _one_sided(found, rods, path, time) if rods else _still(world, path, time, found.gaps(path, time))


def _still(world: LeapfrogWorld, path: Path, time: float, gaps: Changes) -> dict[str, float]:
    """Signals at rest at a time (s) of a path that goes nowhere, with the pins off centre by these gaps (m)."""

    def still() -> dict[str, float]:
        world.approach(moving(world.assembly, path, time, near(gaps, time)), PROBE)
        return world.observe(PROBE)

    def pressing(row: Mapping[str, float]) -> dict[str, float]:
        moments = {name: row[f"reaction_{name}_moment"] for name in world.loads if f"reaction_{name}_moment" in row}
        return world.pressing(_reactions(row, world.loads), moments)

    return world.settled(still, pressing)


def _one_sided(found: Equilibria, rods: Equilibria, path: Path, time: float) -> dict[str, float]:
    """Signals of pins that may leave their rims: their own, or, where the engine does not hold them there, those of
    rods, all of which pull.
    """
    gaps = rods.gaps(path, time)
    sure, found.last = _still(rods.world, path, time, gaps), dict(rods.last)
    forces = _reactions(sure, gaps)
    lifted = [name for name, gap in gaps.items() if (forces[name] * gap.conjugate()).real <= 0]
    if lifted:
        what = f"the only equilibrium found has the pin of joint {lifted[0]!r} pulled off its rim"
        raise found.failed(Cause.PULLED, what, told_angle(path, time))
    with contextlib.suppress(SimulationError):
        gaps = found.gaps(path, time)
    row = _still(found.world, path, time, gaps)
    apart = max(abs(force - forces[name]) for name, force in _reactions(row, gaps).items())
    found.world.by_rods = not apart < HELD * max(map(abs, forces.values()))
    return sure if found.world.by_rods else row


def _reactions(row: Mapping[str, float], joints: Iterable[str]) -> dict[str, complex]:
    return {name: complex(row[f"reaction_{name}_x"], row[f"reaction_{name}_y"]) for name in joints}


@dataclass(frozen=True)
class Plan:
    """When a moving run reports, from where it starts, and how its motor moves, or its motors."""

    times: np.ndarray  # (N,) s in the request's order: from the first report, from release, or of courses
    begin: float  # s
    motor: Path  # of a released linkage: as it starts
    seen: np.ndarray  # (M,) s at which the motor is known to be on its path

    @property
    def crank(self) -> DriveMotion:
        """The motor of a crank."""
        assert isinstance(self.motor, Steady | Course)
        return self.motor

    @classmethod
    def of(cls, world: LeapfrogWorld) -> Plan:
        """The plan of a world's request."""
        request, motor = world.request, world.motor
        if request.schedule.crank is None:
            return cls._together(world)
        assert not isinstance(motor, CoursePath)
        times = request.schedule.time
        if motor is None:
            start = Steady(world.assembly.start, request.schedule.start_speed(world.mechanism))
            return cls(times, 0.0, start, np.zeros(1))
        if isinstance(motor, Course):
            return cls(times, motor.begin, motor, motor.knots[motor.knots <= times.max()])
        return cls(np.round(times, 12), motor.begin, motor, np.sort(times))  # equal angles, at equal times

    @classmethod
    def _together(cls, world: LeapfrogWorld) -> Plan:
        """The plan of courses, and of what moves freely."""
        motor = world.motor if isinstance(world.motor, CoursePath) else CoursePath(world.request, world.assembly)
        times = world.request.schedule.time
        knots = np.unique([t for each in motor.motors.values() for t in each.knots if motor.begin <= t <= times.max()])
        return cls(times, motor.begin, motor, np.array([motor.begin]) if world.free else knots)


def _moving(world: LeapfrogWorld, found: Equilibria) -> Trace:
    """Drive the crank, or release it, and observe on the way."""
    request, plan = world.request, Plan.of(world)
    if world.mechanism.half_gap:
        felt = _felt(world, found, plan)
        world.flanks = Flanks.of(world.mechanism, felt, plan.motor.top_speed)
        world.drive_stiffness = world.flanks.stiffness
    longest = request.step or longest_step(world, plan.motor, plan.begin, found.peaks(plan.motor, plan.seen))
    beyond = request.beyond / plan.motor.top_speed if request.beyond else 0.0
    check_steps(
        f"{world.engine} {request.joint_model} ({world.mechanism.name})",
        float(plan.times.max()) - plan.begin + beyond,
        longest,
    )
    early = world.motor is not None and not world.free
    grid = world.grid = Grid.of(plan.times, plan.begin, longest, early, beyond)
    _start(world, found, plan, grid)
    tally = Tally(world, max(1, (grid.reported - grid.lead) // JOURNAL_SAMPLES))
    watch = Watch.of(world, grid) if request.watched else None
    rows = grid.rows(_follow(world, plan, grid, tally, watch))
    if world.motor is not None and world.held:
        _check_course(world, plan, rows)
    theta = np.array([row[_told(world)] for row in rows])
    asked = request.schedule.crank_angle
    trace = _trace(world, rows, theta if asked is None else asked, plan.times, grid.step)
    watched = watch.watched() if watch is not None else None
    return replace(trace, free_share=tally.free_share(), journal=tally.journal(), watched=watched)


def _told(world: LeapfrogWorld) -> str:
    return told_by(world.mechanism, world.assembly.structure)


def _check_course(world: LeapfrogWorld, plan: Plan, rows: list[dict[str, float]]) -> None:
    """Raise SimulationError where what motors move is not where they have it."""
    alone = world.request.schedule.crank is not None
    for each in world.steered:
        signal = _told(world) if alone else position(each.joint).name
        meant = path_of(plan.motor, each.joint.name).positions(plan.times)
        off = float(np.abs(np.array([row[signal] for row in rows]) - meant).max())
        if not off < OFF_COURSE:
            what = "the crank" if alone else f"joint {each.joint.name!r}"
            unit = "m" if each.joint.prismatic else "rad"
            raise SimulationError(f"{world.engine}: {what} is {off:.3g} {unit} off its course", Cause.OFF_COURSE)


def _felt(world: LeapfrogWorld, found: Equilibria, plan: Plan) -> Felt:
    """What the motor feels of the ideal linkage in the run."""
    times = np.linspace(plan.begin, float(plan.times.max()), FELT)
    torques = [found.ideal_torque(plan.crank, t) for t in times.tolist()]
    inertias = [drive_inertia(world, angle) for angle in plan.crank.positions(times).tolist()]
    return Felt(times, np.array(torques), np.array(inertias))


def _start(world: LeapfrogWorld, found: Equilibria, plan: Plan, grid: Grid) -> None:
    """Bring the linkage to its first poses, a crank that will lag its motor with the speed and acceleration of its
    steady motion.
    """
    begin = grid.begin
    path: Path = plan.motor
    if world.flanks is not None:
        path = Behind(plan.crank, Polynomial([world.flanks.carry(found.ideal_torque(path, begin))]))
    elif world.drive_stiffness:
        path = found.lagging(plan.crank, begin, world.drive_stiffness, drive_inertia(world, plan.crank.position(begin)))
    steady = world.request.start == "steady"
    bodies = found.steady(path, begin) if steady else moving(world.assembly, path, begin)
    spin_up = world.spin_ups(path, begin)
    if world.loads:
        forces_at(world, bodies, spin_up)  # which is what friction grows with there
    towards = begin + grid.step * np.arange(1.0 - WARM_UP, 1.0)
    aims = [None] * WARM_UP if path.constant_speed else world.aims(path, towards)
    world.start(bodies, grid.step, spin_up, aims)
    if world.drive_stiffness:
        world.hold(False)


def _follow(
    world: LeapfrogWorld, plan: Plan, grid: Grid, tally: Tally, watch: Watch | None
) -> dict[int, dict[str, float]]:
    """Signals at the beginnings of the grid's steps that reports need."""
    seen: dict[int, dict[str, float]] = {}
    wanted = set(grid.nodes.ravel().tolist())
    steers = world.drive_stiffness or not plan.motor.constant_speed
    ahead = 1 if world.held else 0
    feels = bool(world.loose) or not world.held  # the motion itself depends on friction
    times = grid.begin + grid.step * np.arange(ahead, grid.last + 1 + ahead)
    aims: Sequence[Sequence[float] | None] = world.aims(plan.motor, times) if steers else [None] * times.size
    for k, world.aim in enumerate(aims):
        world.heeding = bool(world.loads) and (feels or not wanted.isdisjoint(range(k + 1, k + HEEDED_STEPS)))
        if watch is not None and k == grid.lead:
            watch.begin()
        if k in wanted:
            seen[k] = world.observe(grid.step)
            _check_depth(world, _near(world, seen[k], grid.begin + k * grid.step))
        else:
            world.step(grid.step)
        if grid.lead <= k <= grid.reported:
            tally.add()
        if watch is not None and k >= grid.lead:
            watch.add(k - grid.lead)
    return seen


class Tally:
    """Samples the pins' paths, and every step of them for the time without contact."""

    def __init__(self, world: LeapfrogWorld, stride: int) -> None:
        self.world, self.stride = world, stride
        self.paths: dict[str, list[complex]] = {name: [] for name in world.pins}
        self.reaches: dict[str, list[float]] = {name: [] for name in world.blocks}

    def add(self) -> None:
        """Take in where the pins were as the step that was just made began."""
        for name, path in self.paths.items():
            path.append(self.world.pin_gaps[name])
        for name, reaches in self.reaches.items():
            seat = self.world.block_seats[name]
            reaches.append(float(self.world.blocks[name].guide.reach(seat.real, seat.imag)))

    def free_share(self) -> dict[str, float]:
        """Share of the time that each pin, and block, spent without contact."""
        clearances = self.world.request.clearances
        return {
            name: free_share(np.array(path), clearances[name]) for name, path in (self.paths | self.reaches).items()
        }

    def journal(self) -> dict[str, np.ndarray]:
        """Path (M, 2) of every pin (m)."""
        return {name: np.array([(g.real, g.imag) for g in path[:: self.stride]]) for name, path in self.paths.items()}


def _near(world: LeapfrogWorld, row: Mapping[str, float], time: float) -> str:
    """Where a run is, in words: a crank's angle, or the time (s)."""
    return _at_angle(row[_told(world)]) if world.request.schedule.crank is not None else f"{time:.4g} s"


def _at_angle(theta: float) -> str:
    return f"crank angle {np.degrees(theta):.4g} deg"


def _check_depth(world: LeapfrogWorld, near: str) -> None:
    for name, block in world.blocks.items():
        seat = block.seat(*(world.base(body) for body in block.joint.bodies))
        deep = float(block.guide.reach(seat.real, seat.imag)) - block.guide.clearance
        if not deep < TOO_DEEP * min(block.guide.length, block.guide.height):
            raise SimulationError(
                f"{world.engine} {world.request.joint_model}: the block at {name} is {deep:.3g} m in its wall near"
                f" {near}: the run diverged",
                Cause.DIVERGED,
            )
    for name, pin in (world.pins | world.soft).items():
        gap = abs(world.gap(name)[0])
        if not gap < pin.clearance + TOO_DEEP * shortest_link(world.mechanism, pin.joint):
            raise SimulationError(
                f"{world.engine} {world.request.joint_model}: the pin at {name} is {gap:.3g} m off its centre"
                f" (clearance {pin.clearance:g} m) near {near}: the run diverged",
                Cause.DIVERGED,
            )


def _trace(
    world: LeapfrogWorld, rows: list[dict[str, float]], theta: np.ndarray, time: np.ndarray | None, step: float
) -> Trace:
    request = world.request
    signals, rates = part_rates({name: np.array([row[name] for row in rows]) for name in rows[0]})
    return Trace(
        simulator=world.engine,
        version="",
        joint_model=request.joint_model,
        motion=request.motion,
        crank_angle=theta,
        time=time,
        signals=signals,
        clearance=world.request.clearances,
        settings={"step": step} | world.settings(),
        rates=rates,
    )

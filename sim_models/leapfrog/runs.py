"""Static, driven and released runs of a :class:`~sim_models.leapfrog.bodies.LeapfrogWorld`."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import ClassVar

import numpy as np
from numpy.polynomial import Polynomial

from analytic.mechanism.signals import DRIVE_TORQUE
from sim_models.common.backlash import INSTANTS_FELT, Felt, Flanks
from sim_models.common.contact_laws import TOO_DEEP, shortest_link
from sim_models.common.free_share import free_share
from sim_models.common.silence import silence
from sim_models.common.start import check_steps
from sim_models.common.travel import position_of
from sim_models.engine import Cause, Request, SimulationError, Trace, Unsupported
from sim_models.leapfrog.bodies import WARM_UP, LeapfrogWorld
from sim_models.leapfrog.equilibria import LeapfrogEquilibria
from sim_models.leapfrog.poses import Changes, moving, near
from sim_models.leapfrog.probe import PROBE, drive_inertia, forces_at
from sim_models.leapfrog.steps import longest_step
from sim_models.leapfrog.watch import LeapfrogWatch
from sim_models.run.grid import StepGrid
from sim_models.run.path import MotorPath, faced, seats
from sim_models.run.run import EngineRun, Observed, columns_of

JOURNAL_SAMPLES = 4000  # at least, where a run has as many steps
CRANK_AT_REST = 1e-9  # rad, of a crank on a spring
ATTEMPTS = 50  # at where such a crank rests
OFF_COURSE = 1e-7  # rad, what a rigidly driven crank may be off its course
HEEDED_STEPS = 30  # before a report, in which friction settles where the motion does not depend on it
HELD = 1e-3  # of the largest reaction: what one-sided pins and rods may differ by where both hold the same equilibrium


class LeapfrogRun(EngineRun):
    """One request on its way to a trace, in worlds of an engine's own.  Raises what :class:`EngineRun` does."""

    crank_by_time = True
    world_class: ClassVar[type[LeapfrogWorld]]
    world: LeapfrogWorld
    equilibria: LeapfrogEquilibria
    rods: LeapfrogEquilibria | None  # of rods of the clearance's length in place of pins that may leave their rims
    by_rods = False  # whether what was last seen of such pins is that of the rods

    def attempt(self) -> Trace:
        request, m = self.request, self.mechanism
        rigid = replace(request, joint_model="ideal", mechanism=m.ideal() if m.soft_bearings else m)
        with silence(), contextlib.ExitStack() as stack:

            def opened(request: Request) -> LeapfrogWorld:
                return stack.enter_context(contextlib.closing(self.world_class(request, self.path)))

            world = self.world = opened(request)
            ideal = opened(rigid) if world.loose or world.soft else world
            self.equilibria, self.rods = LeapfrogEquilibria(world, ideal), None
            if world.one_sided:
                self.rods = LeapfrogEquilibria(opened(replace(request, joint_model="massless-link")), ideal)
            self.check_rims()
            return super().attempt()

    def check_rims(self) -> None:
        """Raise Unsupported where a bearing with clearance is to be soft whose rim is rigid, or a motor to push a block
        that is loose in its guide.
        """
        world = self.world
        steered = [each.joint.name for each in world.steered if each.joint.name in world.blocks]
        if steered:
            raise Unsupported(
                f"{self.engine}: {self.mechanism.name}: its motors push no block that has clearance in its guide; leave"
                f" out the clearance of joint {steered[0]!r}, or use another simulator"
            )
        soft = [name for name in world.pins if name in self.mechanism.soft_bearings]
        if soft and self.request.joint_model == "contact":
            raise Unsupported(
                f"{self.engine}: {self.mechanism.name}: its contact is rigid; leave out radial_stiffness of joint"
                f" {soft[0]!r}, or use joint model spring-damper"
            )

    # ---------------------------------------------------------------- at rest

    def rest(self, places: np.ndarray) -> Observed:
        """Equilibria at places (N,) on the path."""
        rows, by_rods = [], 0
        for place in places.tolist():
            rows.append(self.at_rest(place))
            by_rods += self.by_rods
        columns, settings = columns_of(rows), {"step": PROBE} | self.world.settings()
        if by_rods:
            kind = "angles" if self.request.schedule.turns_evenly else "instants"
            settings["read_from_rods"] = f"{by_rods} of {places.size} {kind}"
        gaps = {n: columns[f"clearance_{n}_x"] + 1j * columns[f"clearance_{n}_y"] for n in self.world.pins}
        free = {n: free_share(gap, self.world.pins[n].clearance) for n, gap in gaps.items()}
        for name, block in self.world.blocks.items():
            height = np.hypot(columns[f"clearance_{name}_x"], columns[f"clearance_{name}_y"])
            reach = np.asarray(block.guide.reach(height, columns[f"clearance_{name}_angle"]))
            free[name] = free_share(reach, block.guide.clearance)
        return Observed(columns, settings, {n: np.column_stack([g.real, g.imag]) for n, g in gaps.items()}, free)

    def at_rest(self, motor: float) -> dict[str, float]:
        """Signals at rest with the motors where they are at a place on the path, which a crank on a spring lags."""
        place, gaps = motor, dict[str, complex]()
        for _ in range(ATTEMPTS):
            for world in (self.world, self.equilibria.ideal, *([self.rods.world] if self.rods else [])):
                world.face(partial(self.path.moving, place, math.copysign(1.0, world.speed), gaps))
            row = self.one_sided(self.rods, place) if self.rods else self.resting(self.equilibria, place)
            self.check_depth(f"crank angle {np.degrees(place):.4g} deg" if self.world.crank else f"{place:.4g} s")
            lagging = motor - (self.world.behind(row[DRIVE_TORQUE]) if self.world.crank else 0.0)
            before, gaps = gaps, seats(row, self.world.pins)
            if abs(lagging - place) < CRANK_AT_REST and faced(self.mechanism, before, gaps):
                return row
            place = lagging
        raise SimulationError(
            f"{self.engine}: no rest of the crank on its drive was found near crank angle {np.degrees(motor):.6g} deg",
            Cause.NO_EQUILIBRIUM,
            "give a stiffer drive, one with less backlash, or smaller loads",
        )

    def resting(self, equilibria: LeapfrogEquilibria, place: float, gaps: Changes | None = None) -> dict[str, float]:
        """Signals at rest at a place, with the pins off centre by these gaps (m), or where they are in equilibrium."""
        world = equilibria.world
        bodies = moving(self.path, place, near(equilibria.gaps(self.path, place) if gaps is None else gaps, place))

        def observe() -> dict[str, float]:
            world.approach(bodies, PROBE)
            return world.observe(PROBE)

        def pressing(row: Mapping[str, float]) -> dict[str, float]:
            moments = {name: row[f"reaction_{name}_moment"] for name in world.loads if f"reaction_{name}_moment" in row}
            return world.pressing(_reactions(row, world.loads), moments)

        return world.settled(observe, pressing)

    def one_sided(self, rods: LeapfrogEquilibria, place: float) -> dict[str, float]:
        """Signals of pins that may leave their rims: their own, or, where the engine does not hold them there, those of
        rods, all of which pull.
        """
        gaps, pins = rods.gaps(self.path, place), self.equilibria
        pulled, pins.last = self.resting(rods, place, gaps), dict(rods.last)
        forces = _reactions(pulled, gaps)
        lifted = [name for name, gap in gaps.items() if (forces[name] * gap.conjugate()).real <= 0]
        if lifted:
            what = f"the only equilibrium found has the pin of joint {lifted[0]!r} pulled off its rim"
            raise pins.failed(Cause.PULLED, what, place)
        with contextlib.suppress(SimulationError):
            gaps = pins.gaps(self.path, place)
        row = self.resting(pins, place, gaps)
        apart = max(abs(force - forces[name]) for name, force in _reactions(row, gaps).items())
        self.by_rods = not apart < HELD * max(map(abs, forces.values()))
        return pulled if self.by_rods else row

    # ---------------------------------------------------------------- in motion

    def march(self, times: np.ndarray) -> Observed:
        """Drive the linkage, or let it go, and observe on the way through reports at times (N,) s."""
        world, path, request = self.world, self.path, self.request
        last = float(times[-1])
        if self.mechanism.half_gap:
            world.flanks = Flanks.of(
                self.mechanism, self.felt(np.linspace(path.begin, last, INSTANTS_FELT)), path.top_speed
            )
            world.drive_stiffness = world.flanks.stiffness
        longest = request.step or longest_step(world, path, self.equilibria.peaks(path, self.known(times)))
        beyond = request.beyond / path.top_speed if request.beyond else 0.0
        who = f"{self.engine} {request.joint_model} ({self.mechanism.name})"
        check_steps(who, last - path.begin + beyond, longest)
        if path.held and path.constant_speed:  # equal angles, at equal times
            times = np.round(times, 12)
        grid = world.grid = StepGrid.fitted(times, path.begin, longest, path.held, beyond)
        world.laws.step = grid.step
        self.start(grid)
        tally = Tally(world, max(1, (grid.reported - grid.lead) // JOURNAL_SAMPLES))
        watch = LeapfrogWatch(world, grid) if request.watched else None
        columns = grid.columns(self.follow(grid, tally, watch))
        if world.held:
            self.check_course(columns, times)
        settings, watched = {"step": grid.step} | world.settings(), watch.watched() if watch is not None else None
        return Observed(columns, settings, tally.journal(), tally.free_share(), watched)

    def known(self, times: np.ndarray) -> np.ndarray:
        """Times (M,) s up to the last of times (N,) s at which the linkage is known to be on its path."""
        if not self.path.held:
            return np.array([self.path.begin])
        knots = np.unique([t for course in self.request.schedule.courses.values() for t in course.knots])
        knots = knots[(knots >= self.path.begin) & (knots <= times[-1])]
        return knots if knots.size else times

    def felt(self, times: np.ndarray) -> Felt:
        """What the motor feels of the ideal linkage at times (N,) s."""
        torques = [self.equilibria.ideal_torque(self.path, t) for t in times.tolist()]
        inertias = [drive_inertia(self.world, self.path.poses(t)) for t in times.tolist()]
        return Felt(times, np.array(torques), np.array(inertias))

    def start(self, grid: StepGrid) -> None:
        """Bring the linkage to its first poses, a crank that will lag its motor with the speed and acceleration of its
        steady motion.
        """
        world, path, equilibria, begin = self.world, self.path, self.equilibria, grid.begin
        if isinstance(path, MotorPath):
            if world.flanks is not None:
                path = path.behind(Polynomial([world.flanks.carry(equilibria.ideal_torque(path, begin))]))
            elif world.drive_stiffness:
                inertia = drive_inertia(world, path.poses(begin))
                path = equilibria.lagging(path, begin, world.drive_stiffness, inertia)
        bodies = equilibria.steady(path, begin) if self.request.start == "steady" else moving(path, begin)
        spin_up, world.clock = world.spin_ups(path, begin), begin
        if world.loads:
            forces_at(world, bodies, spin_up)  # which is what friction grows with there
        towards = begin + grid.step * np.arange(1.0 - WARM_UP, 1.0)
        aims = [None] * WARM_UP if path.constant_speed else world.aims(path, towards)
        world.start(bodies, grid.step, spin_up, aims)
        if world.drive_stiffness:
            world.hold(False)

    def follow(self, grid: StepGrid, tally: Tally, watch: LeapfrogWatch | None) -> dict[int, dict[str, float]]:
        """Signals at the beginnings of the grid's steps that reports need."""
        world, path = self.world, self.path
        rows: dict[int, dict[str, float]] = {}
        wanted = set(grid.wanted)
        steers = world.drive_stiffness or not path.constant_speed
        ahead = 1 if world.held else 0
        feels = bool(world.loose) or not world.held  # the motion itself depends on friction
        times = grid.begin + grid.step * np.arange(ahead, grid.last + 1 + ahead)
        aims: Sequence[Sequence[float] | None] = world.aims(path, times) if steers else [None] * times.size
        for k, world.aim in enumerate(aims):
            world.clock = grid.begin + k * grid.step
            world.heeding = bool(world.loads) and (feels or not wanted.isdisjoint(range(k + 1, k + HEEDED_STEPS)))
            if watch is not None and k == grid.lead:
                watch.begin()
            if k in wanted:
                rows[k] = world.observe(grid.step)
                angle = rows[k][self.mechanism.encoder.name] if world.crank else 0.0
                when = f"{grid.begin + k * grid.step:.4g} s"
                self.check_depth(f"crank angle {np.degrees(angle):.4g} deg" if world.crank else when)
            else:
                world.step(grid.step)
            if grid.lead <= k <= grid.reported:
                tally.add()
            if watch is not None and k >= grid.lead:
                watch.add(k - grid.lead)
        return rows

    def check_course(self, columns: Mapping[str, np.ndarray], times: np.ndarray) -> None:
        """Raise SimulationError where what motors move is not where they have it at times (N,) s."""
        meant = self.request.schedule.positions(times)
        for joint in (each.joint for each in self.world.steered):
            where = position_of(self.mechanism, joint, columns)
            assert where is not None
            off = float(np.abs(where - meant[joint.name]).max())
            if not off < OFF_COURSE:
                what = "the crank" if self.world.crank else f"joint {joint.name!r}"
                unit = "m" if joint.prismatic else "rad"
                raise SimulationError(f"{self.engine}: {what} is {off:.3g} {unit} off its course", Cause.OFF_COURSE)

    # ---------------------------------------------------------------- what is no run

    def check_depth(self, where: str) -> None:
        """Raise SimulationError where a pin or a block is far outside of its clearance."""
        world, who = self.world, f"{self.engine} {self.request.joint_model}"
        for name, block in world.blocks.items():
            seat = block.seat(*(world.base(body) for body in block.joint.bodies))
            deep = float(block.guide.reach(seat.real, seat.imag)) - block.guide.clearance
            if not deep < TOO_DEEP * min(block.guide.length, block.guide.height):
                what = f"the block at {name} is {deep:.3g} m in its wall near {where}"
                raise SimulationError(f"{who}: {what}: the run diverged", Cause.DIVERGED)
        for name, pin in (world.pins | world.soft).items():
            gap = abs(world.gap(name)[0])
            if not gap < pin.clearance + TOO_DEEP * shortest_link(self.mechanism, pin.joint):
                what = f"the pin at {name} is {gap:.3g} m off its centre (clearance {pin.clearance:g} m) near {where}"
                raise SimulationError(f"{who}: {what}: the run diverged", Cause.DIVERGED)


def _reactions(row: Mapping[str, float], joints: Iterable[str]) -> dict[str, complex]:
    return {name: complex(row[f"reaction_{name}_x"], row[f"reaction_{name}_y"]) for name in joints}


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

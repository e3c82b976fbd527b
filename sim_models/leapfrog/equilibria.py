"""Where the pins of a :class:`~sim_models.leapfrog.bodies.LeapfrogWorld` rest, and how far a crank lags a drive that
yields.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import product

import numpy as np
from numpy.polynomial import Polynomial

from analytic.kinematics.assembly import AssemblyError
from analytic.mechanism import GROUND
from sim_models.common.failed_starts import check_stiff_enough, no_start, why_no_equilibrium
from sim_models.common.start import AT_REST, Pose
from sim_models.engine import CENTRED, ELSEWHERE, Cause, SimulationError
from sim_models.leapfrog.block import LeapfrogBlock
from sim_models.leapfrog.bodies import FRICTION_ROUNDS, LeapfrogWorld
from sim_models.leapfrog.poses import NO_CHANGES, TURN_OF_STENCIL, Changes, duration, moving, near, still
from sim_models.leapfrog.probe import forces_at, gap_accelerations
from sim_models.run.path import MotorPath, Path

NO_LOAD = 1e-9  # of the largest reaction: one below it leaves its pin loose
FAINT_REACTION = (
    1e-3  # of the largest reaction: what a soft bearing is taken to give under at least, where steps are measured
)
VANISHING_REACTION = 1e-6  # N, the same where all vanish: the engines' rounding
ANGLE_NUDGE = 1e-4  # rad; of a depth, ten times that: differences for Newton's Jacobian
LAST_STEP_WORTH_TAKING = 1e-7  # of a Newton step's limit (0.3 rad, 0.7 of a depth): the last step that is worth taking
ROUNDING_OF_STEP = 1e-4  # of the same: below it a step that is no longer halved is the engine's rounding
PEAK_SAMPLES = 24  # instants at which a run's largest reactions are looked for
ALONGSIDE = 1e-6  # of the largest reaction: what friction may still move those that it grows with
LAG_DEGREE = 6  # of the polynomial in time that a crank's lag is
LAG_PERIODS = 6.0  # of the crank's own oscillation, in radians: half of the time that it is fitted over
LAG_REACH = 0.3  # rad of crank angle in the same, at most
LAG_STEADY = 1e-6  # of itself; and
LAG_ROUNDING = 1e-10  # rad
LARGEST_LAG = 1.0  # rad


class Nowhere(Exception):
    """Newton's method found no equilibrium."""


@dataclass
class LeapfrogEquilibria:
    """Finds where the pins rest: the gaps at which none accelerates, by Newton's method on one step of the engine.

    A gap is searched as direction and depth; a rigid contact has no depth, and a soft bearing's gap has two components.
    The search starts from the reaction of the same engine's ideal linkage, turned and scaled as the last answer was.
    Both linkages are driven rigidly.
    """

    world: LeapfrogWorld
    ideal: LeapfrogWorld
    last: dict[str, tuple[complex, float]] = field(default_factory=dict)

    def gaps(
        self, path: Path, time: float, rate: Changes = NO_CHANGES, bend: Changes = NO_CHANGES
    ) -> dict[str, complex]:
        """Gap (m) of every pin, and seat of every block, at a time (s) of the crank's path.

        ``rate`` and ``bend`` are the gaps' first two derivatives in time (m/s, m/s^2).  Raises SimulationError where no
        force presses a pin, or no equilibrium is found.
        """
        world = self.world
        if not (world.loose or world.soft):
            return {}
        theta = path.said(time)
        forces, moments, _ = self.ideal_forces(path, time)
        largest = max(abs(f) for f in forces.values())
        here = still(path, time) if world.blocks else {}
        forces |= {name: self._push(block, here, forces[name], moments[name]) for name, block in world.blocks.items()}
        loose = [name for name in world.loose if abs(forces[name]) <= max(VANISHING_REACTION, NO_LOAD * largest)]
        if loose:
            inner = world.mechanism.joint(loose[0]).inner
            raise self.failed(Cause.UNPRESSED, f"nothing presses the {inner} of joint {loose[0]!r}", theta)
        springs = {name: abs(forces[name]) for name in world.loose if world.compliant}
        check_stiff_enough(world.engine, world.request, theta, springs)
        for seats in self._seats(forces):
            with suppress(Nowhere, AssemblyError):
                return self._found(path, time, rate, bend, forces, seats, largest)
        self.last.clear()
        what = f"no equilibrium of the pins at {', '.join((*world.loose, *world.soft))} was found"
        remedy = ("use a smaller clearance", ELSEWHERE, CENTRED)
        raise why_no_equilibrium(world.engine, world.request, theta, springs) or self.failed(
            Cause.NO_EQUILIBRIUM, what, theta, remedy
        )

    @staticmethod
    def _push(block: LeapfrogBlock, here: Mapping[str, Pose], force: complex, moment: float) -> complex:
        """Force (N) across on a block and i times its moment (N.m) over half its length."""
        along = block.along({GROUND: AT_REST, **here}[block.joint.bodies[0]])
        return block.guide.push(float((force * along.conjugate()).imag), moment)

    def _seats(self, pushes: Mapping[str, complex]) -> Iterator[dict[str, complex]]:
        """Seats (m, and i times rad) in which these pushes (N) may hold all blocks, flat or tilted, likeliest first."""
        either = []
        for name, block in self.world.blocks.items():
            push = pushes[name]
            ways = sorted((complex(push.real), complex(0.0, push.imag)), key=abs, reverse=True)
            rests = [block.guide.rest(way, abs(push) / block.contact.stiffness / 2) for way in ways if way]
            either.append([(name, complex(rest.offset, rest.tilt)) for rest in rests])
        return (dict(seats) for seats in product(*either))

    def _found(
        self,
        path: Path,
        time: float,
        rate: Changes,
        bend: Changes,
        forces: Mapping[str, complex],
        seats: Mapping[str, complex],
        largest: float,
    ) -> dict[str, complex]:
        """The gaps of :meth:`gaps` near where these forces (N), of which the ``largest`` is anywhere, press the pins,
        and near these seats.  Raises Nowhere and AssemblyError.
        """
        world, spin_up, names = self.world, self.world.spin_ups(path, time), list(self.world.pins)
        world.clock = time
        begin = np.array([self._guess(name, forces[name]) for name in names]).reshape(-1, 2)
        n = len(names)
        rims = n * (2 if world.compliant else 1)
        sizes = {  # m, about what each soft bearing gives
            name: max(abs(forces[name]), FAINT_REACTION * largest, VANISHING_REACTION) / pin.contact.stiffness
            for name, pin in world.soft.items()
        }
        given = [forces[name] / pin.contact.stiffness / sizes[name] for name, pin in world.soft.items()]

        rest = rims + 2 * len(sizes)
        gives = {name: abs(forces[name]) / world.blocks[name].contact.stiffness for name in seats}  # m

        def moved(name: str, across: float, turned: float) -> complex:
            """A block's move (m, and i times rad), by how often what it gives."""
            return gives[name] * complex(across, 2 * turned / world.blocks[name].guide.length)

        def gaps_at(x: np.ndarray) -> dict[str, complex]:
            depth = x[n:rims] if world.compliant else np.zeros(n)
            rim = {
                name: (world.pins[name].clearance + d) * np.exp(1j * phi)
                for name, phi, d in zip(names, x[:n], depth, strict=True)
            }
            off = {name: size * complex(*x[rims + 2 * k :][:2]) for k, (name, size) in enumerate(sizes.items())}
            return rim | off | {n: seat + moved(n, *x[rest + 2 * k :][:2]) for k, (n, seat) in enumerate(seats.items())}

        def miss(x: np.ndarray) -> np.ndarray:
            found = gap_accelerations(world, moving(path, time, near(gaps_at(x), time, rate, bend)), spin_up)
            polar = [
                (found[name] - bend.get(name, 0j)) * np.exp(-1j * phi) for name, phi in zip(names, x[:n], strict=True)
            ]
            off = [found[name] - bend.get(name, 0j) for name in sizes]
            off += [
                complex(miss.real, miss.imag * world.blocks[name].guide.length / 2)
                for name in seats
                for miss in [found[name] - bend.get(name, 0j)]
            ]
            return np.array(
                [p.imag for p in polar]
                + ([p.real for p in polar] if world.compliant else [])
                + [part for miss in off for part in (miss.real, miss.imag)]
            )

        x = begin.T.ravel() if world.compliant else begin[:, 0]
        x = np.append(x, [part for z in given for part in (z.real, z.imag)] + [0.0] * 2 * len(seats))
        for _ in range(FRICTION_ROUNDS):
            x, known = self._newton(x, miss, n, rims), dict(world.loads)
            if not known:
                break
            forces_at(world, moving(path, time, near(gaps_at(x), time, rate, bend)), spin_up)
            change = max(abs(world.loads[name] - load) for name, load in known.items())
            if change <= ALONGSIDE * max(known.values()):
                break
        settled = gaps_at(x)
        for name in names:
            self.last[name] = (
                settled[name] / forces[name],
                (abs(settled[name]) - world.pins[name].clearance) / abs(forces[name]),
            )
        return settled

    def _guess(self, name: str, force: complex) -> tuple[float, float]:
        """Direction (rad) and depth (m) to start from, given the ideal linkage's reaction (N)."""
        turn, give = self.last.get(name, (1 + 0j, 1 / self.world.pins[name].contact.stiffness))
        return float(np.angle(turn * force)), give * abs(force)

    def _newton(self, x: np.ndarray, miss: Callable[[np.ndarray], np.ndarray], angles: int, rims: int) -> np.ndarray:
        turns, soft = np.arange(x.size) < angles, np.arange(x.size) >= rims
        previous = np.inf
        for _ in range(60):
            error = miss(x)
            size = np.where(soft, 1.0, np.abs(x))
            nudge = np.where(turns, ANGLE_NUDGE, 10 * ANGLE_NUDGE * size)
            jacobian = np.column_stack(
                [(miss(x + nudge * unit) - error) / nudge[k] for k, unit in enumerate(np.eye(x.size))]
            )
            if not np.all(np.isfinite(jacobian)) or np.linalg.matrix_rank(jacobian) < x.size:
                break
            change = -np.linalg.solve(jacobian, error)
            relative = float((np.abs(change) / np.where(turns, 0.3, 0.7 * size)).max())
            x = x + change / max(1.0, relative)
            if relative < LAST_STEP_WORTH_TAKING or ROUNDING_OF_STEP > relative > previous / 2:
                return x
            previous = relative
        raise Nowhere

    def failed(self, cause: Cause, what: str, theta: float, remedy: str | tuple[str, ...] = "") -> SimulationError:
        """The error that says what went wrong at which crank angle."""
        return no_start(self.world.engine, self.world.request, cause, what, theta, remedy)

    def ideal_forces(self, path: Path, time: float) -> tuple[dict[str, complex], dict[str, float], dict[str, float]]:
        """Reactions (N) of the ideal linkage, its slides' moments (N.m), and what its motors exert (N.m, N), at a time
        (s) of their path.
        """
        self.ideal.clock = time
        return forces_at(self.ideal, moving(path, time), self.ideal.spin_ups(path, time))

    def ideal_torque(self, path: Path, time: float) -> float:
        """Drive torque (N.m) of the ideal linkage at a time (s) of the crank's path."""
        _, _, efforts = self.ideal_forces(path, time)
        return efforts[self.ideal.mechanism.drive_joint.name]

    def steady(self, path: Path, time: float) -> dict[str, Pose]:
        """Poses and velocities of the linkage with its pins in steady contact at a time (s) of the crank's path."""
        rate: dict[str, complex] = {}
        bend: dict[str, complex] = {}
        here = self.gaps(path, time)
        apart = duration(path, TURN_OF_STENCIL)
        for _ in range(2 if here and np.isfinite(apart) else 0):
            before, after = (self.gaps(path, time + side * apart, rate, bend) for side in (-1, 1))
            rate = {n: (after[n] - before[n]) / (2 * apart) for n in here}
            bend = {n: (after[n] - 2 * here[n] + before[n]) / apart**2 for n in here}
            here = self.gaps(path, time, rate, bend)
        return moving(path, time, near(here, time, rate, bend))

    def peaks(self, path: Path, times: np.ndarray) -> dict[str, float]:
        """Largest reaction (N) of each pin in the ideal linkage over times (s) of the crank's path."""
        seen = (
            [self.ideal_forces(path, float(t))[0] for t in times[:: max(1, times.size // PEAK_SAMPLES)]]
            if self.world.pins
            else []
        )
        return {name: max(abs(forces[name]) for forces in seen) for name in self.world.pins}

    def lagging(self, path: MotorPath, time: float, stiffness: float, inertia: float) -> MotorPath:
        """The crank's path about a time (s) behind a motor on a spring (N.m/rad), in steady motion: no oscillation of
        its own.

        The lag is the drive torque over the stiffness, and its rates are part of the motion that this torque belongs
        to.  It is sought as a polynomial, over a time in which ``inertia`` (kg.m^2) on the spring would turn a few
        times.  Raises SimulationError where there is none.
        """
        reach = min(LAG_PERIODS * math.sqrt(inertia / stiffness), duration(path, LAG_REACH, knots=np.inf))
        times = self._window(path, time, reach)
        crank, last = path.behind(Polynomial([0.0])), np.inf
        for _ in range(20):
            lags = np.array([self.ideal_torque(crank, float(t)) for t in times]) / stiffness
            lag = Polynomial.fit(times, lags, LAG_DEGREE)
            crank, here = path.behind(lag), float(lag(time))
            if abs(here - last) < LAG_ROUNDING + LAG_STEADY * abs(here):
                return self._with_gaps(crank, lag, time, stiffness) if self.world.loose or self.world.soft else crank
            if not np.abs(lags).max() < LARGEST_LAG:
                break
            last = here
        why = f"no steady motion of the crank on a drive.stiffness of {stiffness:g} N.m/rad was found"
        raise self.failed(Cause.RESONANCE, why, path.said(time))

    def _with_gaps(self, crank: MotorPath, lag: Polynomial, time: float, stiffness: float) -> MotorPath:
        """The same crank with a lag (rad) that holds what the pins' gaps add to the drive torque at a time (s)."""
        if self.world.request.start == "centred":
            return crank
        _, _, efforts = forces_at(self.world, self.steady(crank, time), self.world.spin_ups(crank, time))
        torque = efforts[self.world.mechanism.drive_joint.name]
        return crank.behind(lag + (torque / stiffness - float(lag(time))))

    @staticmethod
    def _window(path: MotorPath, time: float, reach: float) -> np.ndarray:
        """Times (s) on both sides of one, within a path's course."""
        motor = path.motor
        first, last = (-np.inf, np.inf) if motor.constant_speed else (motor.begin, motor.end)
        low = max(first, min(time, last - reach) - reach)
        return np.linspace(low, min(low + 2 * reach, last), 2 * LAG_DEGREE + 1)

"""Static, driven and released runs of an Exudyn linkage that a crank moves, and what all runs have."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain, pairwise

import numpy as np

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.schedule import DriveMotion
from analytic.mechanism import Joint
from sim_models.common.contact_laws import (
    KelvinVoigt,
    contact_parameters,
    lighter_mass,
    told_of,
)
from sim_models.common.failed_starts import own_start
from sim_models.common.journal import free_share
from sim_models.common.mobility import corner_mass
from sim_models.common.start import check_steps, substeps
from sim_models.engine import (
    Cause,
    Request,
    SettingValue,
    SimulationError,
    Trace,
    installed_version,
)
from sim_models.exudyn.equilibria import Equilibria
from sim_models.exudyn.laws import MINIMUM_IMPACT_SPEED, contact_restitution, joint_creep
from sim_models.exudyn.linkage import ExudynLinkage, Inertia
from sim_models.exudyn.model import ExudynModel, named_laws
from sim_models.exudyn.motor import INSTANT, SETTLING, RunMotor
from sim_models.exudyn.named_contact import said
from sim_models.exudyn.record import Judge, Record, join, join_watched
from sim_models.exudyn.steady import steady_start
from sim_models.run.path import CrankPath, Path

TURN_PER_STEP = 2e-3  # rad of crank angle in a step, at most
SWING_PER_STEP = 5e-4  # rad, of a released linkage's time scale: it has no motor to keep its phase
MOST_STEPS = 500_000  # all of which are kept
MOST_STEPS_BEYOND = 4_000_000  # of those after the reports, about 200 bytes are kept where they are watched
STEPS_PER_PERIOD = 40  # of the lighter link on a contact's stiffness, or hanging on a massless link
STEPS_PER_SPRING = 400  # of the lighter link on a spring between points, which nothing damps


def swing_step(inertia: Inertia) -> float:
    """Step (s) for what is let go with these accelerations."""
    rate = max(math.sqrt(abs(w)) for w in inertia.angular.values())
    return SWING_PER_STEP / max(rate, 1.0)


class Run:
    """One request being run, whatever moves its linkage along its path."""

    path: Path

    def __init__(self, request: Request) -> None:
        self.request, self.m = request, request.mechanism
        self.assembly = Assembly(self.m)
        self.clearance = request.clearances
        compliant = self.clearance if request.joint_model in ("spring-damper", "contact") else {}
        self.contact = {name: contact_parameters(self.m, self.m.joint(name), request.motion) for name in compliant}
        self.named = named_laws(self.m, request.joint_model, request.motion)
        self.bearings = request.bearings
        loose = {**self.clearance, **dict.fromkeys(self.bearings, 0.0)}
        self.judge = Judge(self.m, loose, {name: law.stiffness for name, law in self.contact.items()} | self.bearings)
        self.redundant = self.assembly.overheld

    # ---------------------------------------------------------------- steps

    def longest_step(self, linkage: ExudynLinkage, moved: Iterable[float], pressing: Mapping[str, float]) -> float:
        """The longest step (s) for what moves the linkage, whose own are ``moved`` (s), for springs and bearings, and
        for pins under these forces (N).
        """
        steps = [*moved]
        for spring in self.m.springs:
            mass = min(self.m.moving[name].mass for name in spring.bodies if name in self.m.moving)
            if spring.stiffness:
                steps.append(2 * math.pi * math.sqrt(mass / spring.stiffness) / STEPS_PER_SPRING)
        for name, stiffness in self.bearings.items():
            mass = lighter_mass(self.m, self.m.joint(name))
            steps.append(2 * math.pi * math.sqrt(mass / stiffness) / STEPS_PER_PERIOD)
        for name, clearance in self.clearance.items():
            stiffness = (
                linkage.model.stiffness(name)
                if self.request.joint_model != "massless-link"
                else pressing[name] / clearance
            )
            joint = self.m.joint(name)
            mass = self._corner_mass(joint) if joint.prismatic else lighter_mass(self.m, joint)
            steps.append(2 * math.pi * math.sqrt(mass / stiffness) / STEPS_PER_PERIOD)
        return min(steps)

    def _corner_mass(self, joint: Joint) -> float:
        """Mass (kg) that a block's corners have for their walls, where the linkage is first closed."""
        loose = self.clearance.keys() | self.bearings.keys()
        closed = [each for each in self.m.joints if each.name not in loose]
        held = [self.m.joint(name) for name in self.request.schedule.drives]
        return corner_mass(self.m, self.path.poses(self.path.begin), joint, closed, held)

    def march(
        self, linkage: ExudynLinkage, times: np.ndarray, longest: float, motors: Sequence[RunMotor] = ()
    ) -> tuple[Record, np.ndarray]:
        """Integrate from 0 through all times (s, sorted): every step, and the row of each time."""
        check_steps(self.who, float(times[-1]), longest, MOST_STEPS)
        parts, clock = [self.advance(linkage, 0.0, INSTANT, 1).rows(slice(0, 1))], INSTANT
        onward, stops = any(not motor.steady for motor in motors), np.unique(times)
        if onward:
            begins = motors[0].begins
            parts, clock = [self.advance(linkage, clock, begins, 0).rows(slice(1, None))], begins
            for motor in motors:
                stops = np.union1d(stops, motor.knots_between(stops, longest))
        ends, rows = [clock], [0]
        for end in stops[stops > clock]:
            if onward and end - clock > 10 * SETTLING:
                self.advance(linkage, clock, clock + SETTLING, 0)
                clock += SETTLING
            count, _ = substeps(end - clock, longest)
            parts.append(self.advance(linkage, clock, float(end), count, onward).rows(slice(1, None)))
            clock = float(end)
            ends.append(clock)
            rows.append(rows[-1] + parts[-1].time.size)
        return join(parts), np.array(rows)[np.searchsorted(ends, times)]

    @property
    def who(self) -> str:
        """What is run, in words."""
        return f"exudyn {self.request.joint_model} {self.request.motion} ({self.m.name})"

    def advance(self, linkage: ExudynLinkage, begin: float, end: float, count: int, onward: bool = False) -> Record:
        """Integrate in ``count`` steps, or settle in one (count 0)."""
        if not (linkage.advance(begin, end, count, onward) if count else linkage.settle(begin, end)):
            raise self.failure(
                f"the integrator gave up between {begin:.6g} and {end:.6g} s (step"
                f" {(end - begin) / max(count, 1):.3g} s)"
            )
        record = linkage.history()
        self.check(self.judge.finite(record), self.judge.joined(record))
        return record

    # ---------------------------------------------------------------- judging and reporting

    def leading(self, sampled: Record) -> np.ndarray:
        """Position (N,) rad, m of the first of what moves the linkage."""
        raise NotImplementedError(f"{type(self).__name__} has to say what moves its linkage")

    def failure(self, why: str) -> SimulationError:
        return SimulationError(
            f"{self.who}: {why}",
            Cause.DIVERGED,
        )

    def check(self, *wrong: str | None) -> None:
        """Raise SimulationError with the first of the judge's objections."""
        for why in wrong:
            if why:
                raise self.failure(why)

    def report(
        self, sampled: Record, dense: Record, time: np.ndarray | None = None, step: float | None = None
    ) -> Trace:
        """The trace: signals at the sampled instants, the pins' paths and free share over the dense record."""
        r = self.request
        free = {
            name: free_share(dense.reach(self.m.joint(name)), clearance, dense.time)
            for name, clearance in self.clearance.items()
        }
        pins = [name for name in self.clearance if name not in dense.tilt]
        return Trace(
            simulator="exudyn",
            version=installed_version("exudyn") or "unknown",
            joint_model=r.joint_model,
            motion=r.motion,
            crank_angle=self.leading(sampled) if r.schedule.crank_angle is None else r.schedule.crank_angle.copy(),
            time=time,
            signals=self.told(sampled),
            clearance=dict(self.clearance),
            free_share=free,
            journal={name: np.column_stack([dense.gap[name].real, dense.gap[name].imag]) for name in pins},
            settings=self.settings(step),
            rates=sampled.rates(),
        )

    def told(self, sampled: Record) -> dict[str, np.ndarray]:
        """Signals at the sampled instants; along courses a drive is between its joint's bodies, and a crank's torque is
        on the crank.
        """
        signals = sampled.signals()
        schedule = self.request.schedule
        if schedule.crank is None and schedule.drives and self.m.crank_sign < 0:
            signals["drive_torque"] = -signals["drive_torque"]
        return signals

    def settings(self, step: float | None) -> dict[str, SettingValue]:
        r = self.request
        used: dict[str, SettingValue] = {
            "solver": "static Newton" if r.motion == "static" else "trapezoidal rule, index 2",
            "step": step,
        }
        if not self.contact:
            return used
        used["contact_stiffness"] = min(law.stiffness for law in self.contact.values())
        unnamed = {name: law for name, law in self.contact.items() if name not in self.named}
        if unnamed:
            used |= self._unnamed(unnamed)
        for key, value in (self._named() if self.named else {}).items():
            there = used.get(key)
            if isinstance(there, Mapping) and isinstance(value, Mapping):
                value = {**there, **value}
            elif isinstance(there, str):
                value = f"{there}; {value}"
            used[key] = value
        return used

    def _unnamed(self, laws: Mapping[str, KelvinVoigt]) -> dict[str, SettingValue]:
        """Of joints whose law the mechanism leaves to the engine."""
        r, used = self.request, dict[str, SettingValue]()
        joints = {name: self.m.joint(name) for name in laws}
        one_sided = {name for name, joint in joints.items() if r.joint_model == "spring-damper" or joint.prismatic}
        linear = one_sided | {name for name, joint in joints.items() if joint.contact_damping is not None}
        words = ["max(0, K d + C d')"] if one_sided else []
        words += ["K d + C d'"] if linear - one_sided else []
        if linear:
            used["contact_damping"] = {name: laws[name].damping for name in sorted(linear)}
        if laws.keys() - linear:
            words += ["K d (1 + chi d'/v0), Carvalho-Martins 2019 (e > 1/3) or Gonthier et al. 2004"]
            used["minimum_impact_speed"] = MINIMUM_IMPACT_SPEED
        used["contact_law"] = "; ".join(words)
        bouncing = {
            name: contact_restitution(self.m, joints[name], laws[name]) for name in joints if name not in linear
        }
        return used | ({"restitution": bouncing} if bouncing else {})

    def _named(self) -> dict[str, SettingValue]:
        """Of joints whose law the mechanism names."""
        laws = self.named
        damping = {name: law.damping for name, law in sorted(laws.items()) if not law.hysteresis}
        used: dict[str, SettingValue] = {"contact_law": said(laws, len(self.contact))}
        if any(damping.values()):
            used["contact_damping"] = damping
        return used | told_of(self.m, laws)


class ExudynRun(Run):
    """One request being run, of a linkage that a crank moves."""

    path: CrankPath

    def __init__(self, request: Request) -> None:
        super().__init__(request)
        self.path = CrankPath(self.assembly)

    def trace(self) -> Trace:
        with own_start("exudyn", self.request, self.assembly):
            if self.request.motion == "static":
                return self.static()
            motor = self.request.motor
            return self.released() if motor is None else self.driven(motor)

    # ---------------------------------------------------------------- motions

    def static(self) -> Trace:
        equilibria, asked = Equilibria(self.request, self.path, self.m.speed or 1.0), self.request.schedule.crank_angle
        assert asked is not None  # other poses are told by time, in a RestingRun
        order = np.argsort(asked, kind="stable")
        found = join([equilibria.at(equilibria.crank(float(theta))) for theta in asked[order]])
        self.check(self.judge.finite(found), self.judge.joined(found), self.judge.in_assembly_mode(found, self.path))
        return self.report(found.rows(np.argsort(order)), found)

    def driven(self, motor: DriveMotion) -> Trace:
        time, turned = self.request.schedule.time, RunMotor.of(motor)
        passing = turned.clock(time)
        order = np.argsort(passing, kind="stable")
        if not turned.steady:
            self.assembly.path(*turned.range)
        if self.m.drive_stiffness is not None:
            self.judge = replace(self.judge, motor=turned)
        linkage, longest = self.launch(turned)
        beyond = self.request.beyond / abs(self.m.speed or 1.0)
        check_steps(self.who, beyond, longest, MOST_STEPS_BEYOND)
        history, marks = self.march(linkage, passing[order], longest, [turned])
        self.check(self.judge.energy(history), self.judge.in_assembly_mode(history, self.path))
        seen = history.rows(slice(int(marks[0]), None))
        trace = self.report(history.rows(marks[np.argsort(order)]), seen, time, longest)
        onward = self.onward(linkage, float(passing.max()), beyond, longest)
        if not self.request.watched:
            deque(onward, maxlen=0)
            return trace
        loose = [self.m.joint(name) for name in self.clearance]
        watched = [record.watched(loose, turned, linkage.model.blocks) for record in chain([seen], onward)]
        watched[0].time[marks - marks[0]] = time[order]  # without the rounding of sums of steps
        return replace(trace, watched=join_watched(watched))

    def onward(self, linkage: ExudynLinkage, begin: float, beyond: float, longest: float) -> Iterator[Record]:
        """Every step of a time ``beyond`` (s) the reports, a revolution at a time: Exudyn keeps what its sensors see in
        one integration.
        """
        if not beyond:
            return
        pieces = math.ceil(self.request.beyond / (2 * math.pi) - 1e-9)
        for start, end in pairwise(np.linspace(begin, begin + beyond, pieces + 1).tolist()):
            record = self.advance(linkage, start, end, substeps(end - start, longest)[0]).rows(slice(1, None))
            self.check(self.judge.energy(record), self.judge.in_assembly_mode(record, self.path))
            yield record

    def released(self) -> Trace:
        time = self.request.schedule.time
        order = np.argsort(time, kind="stable")
        linkage, longest = self.launch(None)
        history, marks = self.march(linkage, time[order], longest)
        self.check(self.judge.energy(history))
        return self.report(history.rows(marks[np.argsort(order)]), history, time, longest)

    # ---------------------------------------------------------------- start

    def launch(self, motor: RunMotor | None) -> tuple[ExudynLinkage, float]:
        """The linkage ready to go, and its longest step (s)."""
        r, m = self.request, self.m
        pressing: dict[str, float] = {}
        inertia = None if motor else self.release_accelerations()
        theta = float(motor.angle(0.0)) if motor else self.assembly.start
        speed = float(motor.rate(0.0)) if motor else r.schedule.start_speed(m)
        start = self.path.moving(theta, speed)
        stiffness = m.drive_stiffness if motor else None
        if stiffness is not None or ((self.clearance or self.bearings) and r.start == "steady"):
            resting = r if r.start == "steady" else Request(m.tight())
            equilibria = Equilibria(resting, self.path, 0.0, joint_creep([motor] if motor else []))
            if motor:
                start, here = steady_start(equilibria, motor, stiffness)
            else:
                here = equilibria.at(theta, inertia)
                start = self.path.moving(theta, speed, here.gaps(equilibria.displaced))
            pressing = {name: abs(force[0]) for name, force in here.force.items()}
        model = ExudynModel(m, r.joint_model, "driven", start, motor=motor, redundant=self.redundant)
        linkage = ExudynLinkage(model)
        if motor is None:
            assert inertia is not None
            steps = [swing_step(inertia)]
        else:
            steps = [TURN_PER_STEP / max(motor.top_speed, 1.0), motor.longest_step]
        return linkage, r.step or self.longest_step(linkage, steps, pressing)

    def release_accelerations(self) -> Inertia:
        """Accelerations of the ideal linkage as it is let go at rest."""
        start = self.path.poses(self.path.begin)
        linkage = ExudynLinkage(ExudynModel(self.m, "ideal", "driven", start, redundant=self.redundant))
        self.advance(linkage, 0.0, INSTANT, 1)
        return linkage.inertia()

    def leading(self, sampled: Record) -> np.ndarray:
        """The crank's angle (N,) rad."""
        return sampled.angle[self.m.driven].copy()

"""What an Exudyn run saw, instant by instant, and whether to believe it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, TypeVar

import numpy as np

from analytic.kinematics.structure import BlockRest
from analytic.mechanism import GROUND, MASS_CENTRE, Joint, Mechanism
from analytic.mechanism.signals import DRIVE_TORQUE
from sim_models.common.contact_laws import TOO_DEEP, longest, shortest_link
from sim_models.common.guide import Guide
from sim_models.common.travel import slide_travel
from sim_models.engine import Rates, Watched
from sim_models.exudyn.block import Block
from sim_models.exudyn.motor import RunMotor
from sim_models.run.path import Path

OPEN_LOOP = 1e-4  # of the largest link: gap at an ideal joint beyond which a run is garbage
ENERGY_FROM_NOTHING = 0.05  # of the energy that a run turns over
JUMP = 0.2  # of a body's largest rate, in a step
NOT_TURNED = 1e-12  # rad in a whole run: rounding
FLIPPED = math.radians(45)  # between a body and the ideal linkage: it has left its assembly mode


@dataclass(frozen=True)
class Record:
    """What the sensors saw at M instants.  Complex numbers are x + iy in the ground frame."""

    time: np.ndarray  # s (M,)
    com: Mapping[str, np.ndarray]  # m (M,) complex, by body: its centre of mass
    marker: Mapping[str, np.ndarray]  # m (M,) complex, by body: where its position is read
    angle: Mapping[str, np.ndarray]  # rad (M,)
    velocity: Mapping[str, np.ndarray]  # m/s (M,) complex
    angular_velocity: Mapping[str, np.ndarray]  # rad/s (M,)
    acceleration: Mapping[str, np.ndarray]  # m/s^2 (M,) complex
    angular_acceleration: Mapping[str, np.ndarray]  # rad/s^2 (M,)
    gap: Mapping[str, np.ndarray]  # m (M,) complex, by revolute joint: first pin centre minus second; by block, across
    height: Mapping[str, np.ndarray]  # m (M,) by block with clearance: of its point across its guide
    tilt: Mapping[str, np.ndarray]  # rad (M,) by block with clearance
    force: Mapping[str, np.ndarray]  # N (M,) complex, by joint: of the first body on the second
    moment: Mapping[str, np.ndarray]  # N.m (M,) by prismatic joint: on the second body at its point
    drives: Mapping[str, np.ndarray]  # N.m, or N, (M,) of each motor, by its signal's name

    @property
    def drive_torque(self) -> np.ndarray:
        """Torque (M,) N.m of the only motor."""
        return self.drives[DRIVE_TORQUE]

    def rows(self, index: slice | np.ndarray) -> Record:
        """Some of the instants."""
        return self._each(lambda values: values[index])

    def at(self, time: np.ndarray) -> Record:
        """Interpolated linearly at times (s)."""
        return self._each(lambda values: np.interp(time, self.time, values))

    def _each(self, change: Callable[[np.ndarray], np.ndarray]) -> Record:
        parts: list[Any] = []
        for f in fields(self):
            part = getattr(self, f.name)
            parts.append(
                change(part)
                if isinstance(part, np.ndarray)
                else {name: change(values) for name, values in part.items()}
            )
        return Record(*parts)

    def reach(self, joint: Joint) -> np.ndarray:
        """How far (M,) m a pin, or a block's corner that is farthest out, is from where it is in the middle."""
        guide = Guide.of(joint) if joint.name in self.tilt else None
        if guide is None:
            return np.abs(self.gap[joint.name])
        return np.asarray(guide.reach(self.height[joint.name], self.tilt[joint.name]))

    def gaps(self, joints: Iterable[str]) -> dict[str, complex | BlockRest]:
        """Where the pins and blocks of these joints are, at the only instant."""
        return {
            name: BlockRest(float(self.height[name][0]), float(self.tilt[name][0]))
            if name in self.tilt
            else complex(self.gap[name][0])
            for name in joints
        }

    def signals(self) -> dict[str, np.ndarray]:
        """Every signal of a Trace, by name."""
        out = dict(self.drives)
        for body, marker in self.marker.items():
            out |= {f"{body}_x": marker.real, f"{body}_y": marker.imag}
            out |= {f"{body}_angle": self.angle[body], f"{body}_angular_velocity": self.angular_velocity[body]}
        for quantity, vectors in (("reaction", self.force), ("clearance", self.gap)):
            for joint, vector in vectors.items():
                out |= {f"{quantity}_{joint}_x": vector.real, f"{quantity}_{joint}_y": vector.imag}
        out |= {f"reaction_{joint}_moment": moment for joint, moment in self.moment.items()}
        out |= {f"clearance_{joint}_angle": -tilt for joint, tilt in self.tilt.items()}
        return {name: np.array(values) for name, values in out.items()}

    def rates(self) -> dict[str, Rates]:
        """Rates of every body, for a Trace."""
        return {
            body: Rates(v.copy(), self.acceleration[body].copy(), self.angular_acceleration[body].copy())
            for body, v in self.velocity.items()
        }

    def watched(self, loose: Iterable[Joint], motor: RunMotor, blocks: Mapping[str, Block]) -> Watched:
        """What of it is watched, with the forces of contact in these joints, on its crank's motor's own clock."""
        force, corners, rubbing = dict[str, np.ndarray](), dict[str, np.ndarray](), dict[str, np.ndarray]()
        for joint in loose:
            name, guide = joint.name, Guide.of(joint)
            force[name] = self.force[name]
            if guide is not None:
                turned = self.angle.get(joint.bodies[0], np.zeros(self.time.size))  # the ground stands still
                across = 1j * joint.direction * np.exp(1j * turned)
                pushed = np.real(force[name] * np.conj(across))
                unit = self._rubbing(blocks[name]) if blocks[name].friction else None
                corners[name] = guide.shares(pushed, self.moment[name], self.height[name], self.tilt[name], unit)
                force[name] = guide.across(corners[name]) * across
                if unit is not None:
                    rubbing[name] = unit * corners[name]
                    force[name] = force[name] - 1j * across * rubbing[name].sum(axis=0)
        return Watched(
            time=self.time + motor.first - motor.begins,
            place=self.com,
            velocity=self.velocity,
            angle=self.angle,
            angular_velocity=self.angular_velocity,
            force=force,
            torque=self.drive_torque,
            corners=corners,
            rubbing=rubbing,
        )

    def _rubbing(self, block: Block) -> np.ndarray:
        """Friction (4, M) on a block's corners along its guide, of a unit push of their walls."""
        moving = [body for body in block.joint.bodies if body != GROUND]
        parts = [((self.com[b], self.angle[b]), (self.velocity[b], self.angular_velocity[b])) for b in moving]
        q, rates = ([x for at, turn in each for x in (at.real, at.imag, turn)] for each in zip(*parts, strict=True))
        return block.rubbing(block.seen(np, q, rates))


Series = TypeVar("Series", "Record", Watched)


def join_watched(parts: Sequence[Watched]) -> Watched:
    """What was watched, one after the other."""
    return _joined(Watched, parts)


def join(records: Sequence[Record]) -> Record:
    """Records one after the other."""
    return _joined(Record, records)


def _joined(kind: type[Series], records: Sequence[Series]) -> Series:
    """Arrays, and mappings of arrays, one after the other in time, which is their last axis."""
    parts: list[Any] = []
    for f in fields(kind):
        each = [getattr(record, f.name) for record in records]
        single = isinstance(each[0], np.ndarray)
        parts.append(
            np.concatenate(each)
            if single
            else {name: np.concatenate([e[name] for e in each], axis=-1) for name in each[0]}
        )
    return kind(*parts)


def locate(
    m: Mechanism, com: Mapping[str, np.ndarray], angle: Mapping[str, np.ndarray], body: str, point: str
) -> np.ndarray:
    """Path (m, (M,) complex) of a body's named point."""
    if body == GROUND:
        return np.full_like(next(iter(com.values())), m.ground.point(point))
    return com[body] + (m.body(body).point(point) - m.body(body).point(MASS_CENTRE)) * np.exp(1j * angle[body])


def travel(m: Mechanism, record: Record, joint: Joint) -> np.ndarray:
    """A revolute joint's second angle minus its first (rad), or a prismatic one's travel (m), (M,)."""
    still = {GROUND: np.zeros(record.time.size)}
    first, second = joint.bodies
    angle = {**still, **record.angle}
    if not joint.prismatic:
        return angle[second] - angle[first]
    apart = locate(m, record.com, record.angle, second, joint.name) - locate(
        m, record.com, record.angle, first, joint.name
    )
    return slide_travel(joint, apart, angle[first])


@dataclass(frozen=True)
class Judge:
    """The checks that a record must pass; each answers with what is wrong, or None.

    ``stiffness`` (N/m) is that of each compliant contact, ``motor`` turns the crank through a spring; ``motors`` follow
    courses, where no crank moves the linkage, by their loads' signals.
    """

    mechanism: Mechanism
    clearance: Mapping[str, float]
    stiffness: Mapping[str, float]
    motor: RunMotor | None = None
    motors: Mapping[str, RunMotor] | None = None

    def finite(self, record: Record) -> str | None:
        """Divergence."""
        for values in (*record.force.values(), *record.com.values(), *record.angle.values()):
            if not np.all(np.isfinite(values)):
                return f"the run diverged at {self._place(record, int(np.argmin(np.isfinite(values))))}"
        return None

    def joined(self, record: Record) -> str | None:
        """Ideal joints that come apart, and pins that sink into their bearings."""
        size = longest(self.mechanism)
        for name, gap in record.gap.items():
            joint = self.mechanism.joint(name)
            excess, allowed = np.abs(gap), OPEN_LOOP * size
            if name in self.clearance:
                shortest = min(joint.guide) if joint.guide is not None else shortest_link(self.mechanism, joint)
                excess, allowed = record.reach(joint) - self.clearance[name], TOO_DEEP * shortest
            worst = int(np.argmax(excess))
            if excess[worst] > allowed:
                return (
                    f"the parts of joint {name} are {excess[worst]:.3g} m too far apart at {self._place(record, worst)}"
                )
        return None

    def in_assembly_mode(self, record: Record, path: Path) -> str | None:
        """A linkage that has flipped over; it stays so, and a dozen instants will show it."""
        rows = np.linspace(0, record.time.size - 1, 12).astype(int)
        crank = path.assembly.mechanism.driven if path.driven is None else None
        expected = path.turned((record.time if crank is None else record.angle[crank])[rows])
        for i, k in enumerate(rows):
            for name, (_, angle) in expected.items():
                if abs(record.angle[name][k] - angle[i]) > FLIPPED:
                    return f"body {name} has left its assembly mode at {self._place(record, int(k))}"
        return None

    def abrupt(self, record: Record) -> str | None:
        """A body's rate that jumps where nothing hits it: velocities are lost where constraints hold the linkage's
        parts more than once, as in a loop that is stretched out.
        """
        for name, spin in record.angular_velocity.items():
            if np.abs(spin).max() * np.ptp(record.time) < NOT_TURNED:
                continue
            jump = np.abs(np.diff(spin))
            worst = int(np.argmax(jump))
            if jump[worst] > JUMP * np.abs(spin).max():
                return (
                    f"body {name} changes from {spin[worst]:.4g} to {spin[worst + 1]:.4g} rad/s in a step at"
                    f" {self._place(record, worst)}, where the linkage may be stretched out"
                )
        return None

    def energy(self, record: Record) -> str | None:
        """Energy may be lost to friction, dampers and contact, but not come from nothing."""
        kinetic = np.zeros(record.time.size)
        for b in self.mechanism.bodies:
            kinetic += (
                b.mass / 2 * np.abs(record.velocity[b.name]) ** 2
                + b.moment_of_inertia / 2 * record.angular_velocity[b.name] ** 2
            )
        stored = self._stored(record)
        power = self._power(record)
        supplied = np.concatenate([[0.0], np.cumsum(np.diff(record.time) * (power[1:] + power[:-1]) / 2)])
        surplus = kinetic + stored - supplied
        created = surplus - np.minimum.accumulate(surplus)
        turned_over = max(np.ptp(kinetic), np.ptp(stored), np.ptp(supplied), 1e-12)
        worst = int(np.argmax(created))
        if created[worst] > ENERGY_FROM_NOTHING * turned_over:
            return (
                f"{created[worst]:.3g} J have come from nothing at {self._place(record, worst)}, of {turned_over:.3g} J"
                " turned over"
            )
        return None

    def _power(self, record: Record) -> np.ndarray:
        """Power (W) of the motors."""
        if self.motors is not None:
            rates = {name: motor.rate(record.time) for name, motor in self.motors.items()}
            return np.asarray(sum((record.drives[name] * rate for name, rate in rates.items()), 0.0 * record.time))
        if self.motor is not None:
            return record.drive_torque * self.motor.rate(record.time)
        return record.drive_torque * record.angular_velocity[self.mechanism.driven]

    def _stored(self, record: Record) -> np.ndarray:
        """Potential energy (J) of gravity, loads, springs, contacts and a compliant drive."""
        m = self.mechanism
        energy = np.zeros(record.time.size)
        for b in m.bodies:
            energy -= b.mass * np.real(record.com[b.name] * np.conj(complex(*m.gravity)))
        for load in m.loads:
            at = locate(m, record.com, record.angle, load.body, load.point)
            energy -= np.real(at * np.conj(complex(*load.force))) + load.torque * record.angle[load.body]
        for j in m.joints:
            if j.springy:
                stretch = travel(m, record, j) - j.rest_angle
                energy += j.stiffness / 2 * stretch**2 + j.cubic / 4 * stretch**4
        if m.periodic_torque is not None:
            wave = m.periodic_torque
            energy += wave.amplitude / wave.harmonic * np.cos(wave.harmonic * record.angle[m.driven] + wave.phase)
        for spring in m.springs:
            near, far = (locate(m, record.com, record.angle, *end) for end in spring.ends)
            energy += spring.stiffness / 2 * (np.abs(far - near) - spring.length) ** 2
        for name, stiffness in self.stiffness.items():
            guide = Guide.of(m.joint(name))
            if name in record.tilt and guide is not None:
                depth = guide.depths(record.height[name], record.tilt[name])
            else:
                depth = np.abs(record.gap[name])[None] - self.clearance[name]
            energy += stiffness / 2 * np.sum(np.maximum(depth, 0) ** 2, axis=0)
        drive = m.drive_stiffness
        if self.motor is not None and drive is not None:
            energy += record.drive_torque**2 / (2 * drive)
        return energy

    def _place(self, record: Record, row: int) -> str:
        if self.motors is not None:
            return f"time {record.time[row]:.4g} s"
        return (
            f"crank angle {math.degrees(record.angle[self.mechanism.driven][row]):.4g} deg (time"
            f" {record.time[row]:.4g} s)"
        )

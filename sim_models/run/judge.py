"""What a run must show at every step, between its reports too, to be believed.

What must be true at the reports is :mod:`sim_models.common.health`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from analytic.mechanism import Mechanism
from analytic.mechanism.varying import Seen
from sim_models.common.contact_laws import TOO_DEEP, longest, shortest_link
from sim_models.common.failed_starts import who
from sim_models.common.guide import Guide
from sim_models.engine import Cause, Request, SimulationError
from sim_models.run.path import Path
from sim_models.run.record import Record

OPEN_LOOP = 1e-4  # of the largest link: gap at an ideal joint beyond which a run is garbage
ENERGY_FROM_NOTHING = 0.05  # of the energy that a run turns over
JUMP_OF_RATE = 0.2  # of a body's largest rate, in a step
NOT_TURNED = 1e-12  # rad in a whole run: rounding
FLIPPED = math.radians(45)  # between a body and the ideal linkage: it has left its assembly mode
MODE_CHECKS = 12  # instants that show a linkage that has flipped over: it stays so


class Rated(Protocol):
    """A motor on the clock of a run."""

    def rate(self, time: np.ndarray) -> np.ndarray:
        """Its rate (M,) rad/s, m/s at times (M,) s."""


@dataclass(frozen=True)
class Judge:
    """The checks that a record of an ``engine`` must pass; each raises SimulationError.

    ``stiffness`` (N/m) is that of each compliant contact and soft bearing; ``motors`` are those that move the linkage,
    by their loads' signals.
    """

    engine: str
    request: Request
    stiffness: Mapping[str, float]
    motors: Mapping[str, Rated]
    since: float = 0.0  # s of the schedule where the record's time is 0

    @property
    def mechanism(self) -> Mechanism:
        """What is run."""
        return self.request.mechanism

    @property
    def clearance(self) -> dict[str, float]:
        """How far (m) the pin of each joint that is no ideal one is from its wall."""
        return self.request.clearances | dict.fromkeys(self.request.bearings, 0.0)

    def failure(self, why: str, remedy: str = "") -> SimulationError:
        """The error of a run that is none."""
        return SimulationError(f"{who(self.engine, self.request)}: {why}", Cause.DIVERGED, remedy)

    def check_together(self, record: Record) -> None:
        """The run has diverged, ideal joints come apart, or pins sink into their bearings."""
        for values in (*record.force.values(), *record.com.values(), *record.angle.values()):
            if not np.all(np.isfinite(values)):
                raise self.failure(f"the run diverged at {self._place(record, int(np.argmin(np.isfinite(values))))}")
        size, clearance = longest(self.mechanism), self.clearance
        for name, gap in record.gap.items():
            joint = self.mechanism.joint(name)
            excess, allowed = np.abs(gap), OPEN_LOOP * size
            if name in clearance:
                shortest = min(joint.guide) if joint.guide is not None else shortest_link(self.mechanism, joint)
                excess, allowed = record.reach(joint) - clearance[name], TOO_DEEP * shortest
            worst = int(np.argmax(excess))
            if excess[worst] > allowed:
                raise self.failure(
                    f"the parts of joint {name} are {excess[worst]:.3g} m too far apart at {self._place(record, worst)}"
                )

    def check_assembly_mode(self, record: Record, path: Path) -> None:
        """A linkage that all of its drives hold has flipped over."""
        rows = np.linspace(0, record.time.size - 1, MODE_CHECKS).astype(int)
        crank = self.mechanism.driven if path.driven is None else None
        expected = path.turned((record.time if crank is None else record.angle[crank])[rows])
        for i, k in enumerate(rows):
            for name, (_, angle) in expected.items():
                if abs(record.angle[name][k] - angle[i]) > FLIPPED:
                    raise self.failure(f"body {name} has left its assembly mode at {self._place(record, int(k))}")

    def check_smooth(self, record: Record) -> None:
        """A body's rate jumps where nothing hits it: velocities are lost where constraints hold the linkage's parts
        more than once, as in a loop that is stretched out.
        """
        for name, spin in record.angular_velocity.items():
            if np.abs(spin).max() * np.ptp(record.time) < NOT_TURNED:
                continue
            jump = np.abs(np.diff(spin))
            worst = int(np.argmax(jump))
            if jump[worst] > JUMP_OF_RATE * np.abs(spin).max():
                raise self.failure(
                    f"body {name} changes from {spin[worst]:.4g} rad/s to {spin[worst + 1]:.4g} rad/s in a step at"
                    f" {self._place(record, worst)}, where the linkage may be stretched out",
                    "ask for times before that, or use another simulator",
                )

    def check_energy(self, record: Record) -> None:
        """Energy, which may be lost to friction, dampers and contact, has come from nothing.

        What a motor gives, loads may take at once: the largest account of all is the measure, not what is left of them.
        """
        kinetic = np.zeros(record.time.size)
        for b in self.mechanism.bodies:
            kinetic += (
                b.mass / 2 * np.abs(record.velocity[b.name]) ** 2
                + b.moment_of_inertia / 2 * record.angular_velocity[b.name] ** 2
            )
        stored = self._stored(record)
        powers = [record.drives[name] * motor.rate(record.time) for name, motor in self.motors.items()]
        works = [_work(power, record.time) for power in (*powers, self._varying(record))]
        surplus = kinetic + stored - sum(works)
        created = surplus - np.minimum.accumulate(surplus)
        turned_over = max(1e-12, *(np.ptp(account) for account in (kinetic, stored, *works)))
        worst = int(np.argmax(created))
        if created[worst] > ENERGY_FROM_NOTHING * turned_over:
            raise self.failure(
                f"{created[worst]:.3g} J have come from nothing at {self._place(record, worst)}, of {turned_over:.3g} J"
                " turned over"
            )

    def _varying(self, record: Record) -> np.ndarray:
        """Power (M,) W of loads that vary over the motion, which have no potential energy."""
        m, power = self.mechanism, np.zeros(record.time.size)

        def point(body: str, name: str) -> np.ndarray:
            return record.point(m, body, name)

        def velocity(body: str, name: str) -> np.ndarray:
            return record.velocity[body] + 1j * record.angular_velocity[body] * (point(body, name) - record.com[body])

        seen = Seen(
            record.angle.__getitem__,
            point,
            velocity,
            record.angular_velocity.__getitem__,
            lambda: record.time + self.since,
        )
        for load in (load for load in m.loads if load.varies):
            force, torque = m.acting(load, seen)
            power += np.real(velocity(load.body, load.point) * np.conj(force))
            power += torque * record.angular_velocity[load.body]
        return power

    def _stored(self, record: Record) -> np.ndarray:
        """Potential energy (M,) J of gravity, loads, springs, contacts and a compliant drive."""
        m = self.mechanism
        energy = np.zeros(record.time.size)
        for b in m.bodies:
            energy -= b.mass * np.real(record.com[b.name] * np.conj(complex(*m.gravity)))
        for load in (load for load in m.loads if not load.varies):
            at = record.point(m, load.body, load.point)
            energy -= np.real(at * np.conj(complex(*load.force))) + load.torque * record.angle[load.body]
        for j in m.joints:
            if j.springy:
                stretch = record.position(m, j) - j.rest_angle
                energy += j.stiffness / 2 * stretch**2 + j.cubic / 4 * stretch**4
            energy += sum(stop.energy(record.position(m, j)) for stop in j.stops)
        if m.periodic_torque is not None:
            wave = m.periodic_torque
            energy += wave.amplitude / wave.harmonic * np.cos(wave.harmonic * record.angle[m.driven] + wave.phase)
        for spring in m.springs:
            near, far = (record.point(m, *end) for end in spring.ends)
            energy += spring.stiffness / 2 * (np.abs(far - near) - spring.length) ** 2
        for name, stiffness in self.stiffness.items():
            guide = Guide.of(m.joint(name))
            if name in record.tilt and guide is not None:
                depth = guide.depths(record.height[name], record.tilt[name])
            else:
                depth = np.abs(record.gap[name])[None] - self.clearance[name]
            energy += stiffness / 2 * np.sum(np.maximum(depth, 0) ** 2, axis=0)
        if self.motors and self.request.schedule.crank is not None and m.drive_stiffness is not None:
            energy += record.drive_torque**2 / (2 * m.drive_stiffness)
        return energy

    def _place(self, record: Record, row: int) -> str:
        """An instant in words; with a crank, where that is."""
        time = f"time {record.time[row]:.4g} s"
        if self.request.schedule.crank is None:
            return time
        return f"crank angle {math.degrees(record.angle[self.mechanism.driven][row]):.4g} deg ({time})"


def _work(power: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Work (M,) J that a power (M,) W has done since the first of these times (M,) s."""
    return np.concatenate([[0.0], np.cumsum(np.diff(time) * (power[1:] + power[:-1]) / 2)])

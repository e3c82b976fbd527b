"""The same linkage seen otherwise: mirrored, turned, moved, in other frames, with other names, in another order.

A mechanism is rewritten by hand, field by field, and each signal's value follows from what was done to it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from analytic.mechanism import GROUND, Drive, Joint, Mechanism
from analytic.mechanism.signals import Signal, named

Frame = tuple[complex, float]  # m, rad: where a body's new frame has its origin and its x axis, in the old one


@dataclass(frozen=True)
class Seen:
    """What is done to a linkage, in this order: bodies get other ``frames``, joints name their bodies the other way
    (``swapped``), the whole is ``mirrored`` (y becomes -y), turned by an angle (rad) and moved (m), all lists are
    ``reversed`` and names get a ``suffix``.
    """

    frames: Mapping[str, Frame] = field(default_factory=dict)
    swapped: bool = False
    mirrored: bool = False
    turn: float = 0.0
    shift: complex = 0j
    reversed: bool = False
    suffix: str = ""

    # ------------------------------------------------------------ of what it is made

    @property
    def sign(self) -> float:
        """Of all that turns."""
        return -1.0 if self.mirrored else 1.0

    def vector(self, z: complex | np.ndarray) -> complex | np.ndarray:
        """A vector of the world, x + iy, as it is seen."""
        return (np.conj(z) if self.mirrored else z) * np.exp(1j * self.turn)

    def ahead(self, body: str) -> float:
        """By how much (rad) a body's angle is more than that of old, which may have changed its sign."""
        return 0.0 if body == GROUND else self.sign * self.frames.get(body, (0j, 0.0))[1] + self.turn

    def angle(self, body: str, angle: float | np.ndarray) -> float | np.ndarray:
        """A body's angle (rad) as it is seen."""
        return self.sign * angle + self.ahead(body)

    def name(self, old: str) -> str:
        """A name as it is now."""
        return old if old in (GROUND, "com", "") else old + self.suffix

    def _order(self, several: object) -> tuple:
        return tuple(several)[::-1] if self.reversed else tuple(several)

    def _in_frame(self, body: str, place: tuple[float, float] | None) -> tuple[float, float] | None:
        """A place in a body's frame; a direction in that of the ground is no place."""
        if place is None:
            return None
        z = complex(*place)
        if body == GROUND:
            return _pair(self.vector(z) + self.shift)
        origin, turned = self.frames.get(body, (0j, 0.0))
        z = (z - origin) * np.exp(-1j * turned)
        return _pair(np.conj(z) if self.mirrored else z)

    # ------------------------------------------------------------ a mechanism

    def of(self, m: Mechanism) -> Mechanism:
        """The mechanism as it is seen."""
        assert not (self.swapped and any(j.guide and j.clearance for j in m.joints)), "which body is the guide matters"
        bodies = [
            b.model_copy(
                update={
                    "name": self.name(b.name),
                    "points": self._points(b.name, b.points),
                    **{f: self._in_frame(b.name, getattr(b, f)) for f in ("com", "marker") if f in b.model_fields_set},
                }
            )
            for b in m.bodies
        ]
        loads = [
            load.model_copy(
                update={
                    "body": self.name(load.body),
                    "point": self.name(load.point),
                    "force": _pair(self.vector(complex(*load.force))),
                    "torque": self.sign * load.torque,
                }
            )
            for load in m.loads
        ]
        springs = [
            s.model_copy(update={w: tuple(self.name(n) for n in getattr(s, w)) for w in ("bodies", "points")})
            for s in m.springs
        ]
        assembly = {self.name(b): self.angle(b, angle) for b, angle in m.assembly.items()}
        return m.replace(
            gravity=_pair(self.vector(complex(*m.gravity))),
            ground=m.ground.model_copy(update={"points": self._points(GROUND, m.ground.points)}),
            bodies=self._order(bodies),
            joints=self._order(self._joint(j) for j in m.joints),
            drives=self._order(self._drive(m, d) for d in m.drives),
            springs=self._order(springs),
            loads=self._order(loads),
            assembly=dict(self._order(assembly.items())),
        )

    def _points(self, body: str, points: Mapping[str, tuple[float, float]]) -> dict:
        return dict(self._order((self.name(n), self._in_frame(body, p)) for n, p in points.items()))

    def _joint(self, j: Joint) -> Joint:
        first, second = j.bodies
        between = self.ahead(second) - self.ahead(first)
        changed: dict = {"name": self.name(j.name), "bodies": (self.name(first), self.name(second))}
        if j.prismatic:
            axis = j.direction
            if first == GROUND:
                axis = self.vector(axis)
            else:
                axis = axis * np.exp(-1j * self.frames.get(first, (0j, 0.0))[1])
                axis = np.conj(axis) if self.mirrored else axis
            changed |= {"axis": axis, "angle": self.sign * j.angle + between}
        else:
            changed["rest_angle"] = self.sign * j.rest_angle + between
        if self.swapped:
            changed["bodies"] = changed["bodies"][::-1]
            changed["rest_angle"] = -changed.get("rest_angle", j.rest_angle)
            if j.prismatic:
                changed |= {"axis": changed["axis"] * np.exp(-1j * changed["angle"]), "angle": -changed["angle"]}
        if j.prismatic:
            changed["axis"] = _pair(changed["axis"])
        return j.model_copy(update=changed)

    def _drive(self, m: Mechanism, d: Drive) -> Drive:
        changed: dict = {"joint": self.name(d.joint)}
        if isinstance(d.speed, float):
            changed["speed"] = d.speed * self._of_drive(m, m.joint(d.joint))
        for wave in ("ripple", "periodic_torque"):
            if (old := getattr(d, wave)) is not None:
                phase = self.sign * old.phase - old.harmonic * self.ahead(m.driven)
                changed[wave] = old.model_copy(update={"phase": phase})
        return d.model_copy(update=changed)

    def _of_drive(self, m: Mechanism, joint: Joint) -> float:
        """Sign of what a drive does, and gives: of a crank, or of a joint's second body against its first."""
        turned = 1.0 if joint.prismatic else self.sign
        return turned * (-1.0 if self.swapped and not m.cranked else 1.0)

    # ------------------------------------------------------------ its signals

    def signals(self, m: Mechanism, old: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """What the signals (N,) of a mechanism become, by their new names."""
        known = named(m.bodies, m.joints, m.drives, m.sensors)
        return {
            Signal.of(s.kind, self.name(s.place), s.component).name: np.asarray(self._signal(m, s, old), float)
            for s in (known[name] for name in old if name in known)
        }

    def _signal(self, m: Mechanism, s: Signal, old: Mapping[str, np.ndarray]) -> np.ndarray:
        value, other = old[s.name], -1.0 if self.swapped else 1.0
        match s.kind, s.component:
            case "pose", "angle":
                found = self.angle(s.place, value)
            case "pose" | "reaction" | "clearance", "x" | "y":
                z = self.vector(old[s.sibling("x").name] + 1j * old[s.sibling("y").name])
                z = z + self.shift if s.kind == "pose" else other * z
                found = z.real if s.component == "x" else z.imag
            case "reaction", "angle":
                found = self.sign * value + self.turn + (np.pi if self.swapped else 0.0)
            case _, "magnitude":
                found = value
            case _, "moment":
                found = self.sign * (self._swapped_moment(m, s, old) if self.swapped else value)
            case "position", "travel":
                found = other * value
            case "position", _:
                first, second = m.joint(s.place).bodies
                found = other * (self.sign * value + self.ahead(second) - self.ahead(first))
            case "drive", _:
                found = value * self._of_drive(m, m.joint(s.place) if s.place else m.motors[0])
            case _:  # rates, rotations, tilts
                found = self.sign * value
        return np.asarray(found)

    @staticmethod
    def _swapped_moment(m: Mechanism, s: Signal, old: Mapping[str, np.ndarray]) -> np.ndarray:
        """Of the opposite force at the other body's point, of old."""
        joint = m.joint(s.place)
        along = joint.direction * np.exp(1j * (0.0 if joint.bodies[0] == GROUND else old[f"{joint.bodies[0]}_angle"]))
        lever = old[f"position_{joint.name}"] * along
        force = old[s.sibling("x").name] + 1j * old[s.sibling("y").name]
        return -(old[s.name] + (np.conj(lever) * force).imag)


def _pair(z: complex) -> tuple[float, float]:
    return float(np.real(z)), float(np.imag(z))

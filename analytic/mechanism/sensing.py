"""What sensors on a linkage read, of the signals of whoever says how it moves: the analytic model, an engine, a record.

Each side's readings follow from its own signals alone, by the arithmetic of a rigid body.  That arithmetic is the same
for all sides, so that a mistake in it would show in no comparison: tests hold it to closed forms, to MuJoCo's own
``accelerometer`` and ``gyro`` and to differences of engines' positions.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from analytic.mechanism.model import Mechanism
from analytic.mechanism.parts import GROUND, Body, Ground, Sensor
from analytic.mechanism.signals import Signal, driving, moving
from analytic.mechanism.spread import ends, mass_between

Columns = Mapping[str, np.ndarray]


def with_sensors(m: Mechanism, signals: Columns, *, still: bool = False) -> dict[str, np.ndarray]:
    """Signals (N,) SI with what the mechanism's sensors read of them; a sensor whose signals are not all there is left
    out, and one that is there stays.  A ``still`` linkage has no velocities and no accelerations.
    """
    found = dict(signals)
    for sensor in m.sensors:
        if sensor.name in signals:
            continue
        try:
            found[sensor.name] = _READINGS[sensor.kind](_Seen(m, signals, still), sensor)
        except KeyError:  # a signal that this side does not say
            continue
    return found


def read_again(m: Mechanism, signals: Columns, *, still: bool = False) -> dict[str, np.ndarray]:
    """Signals (N,) that have changed, with those sensors read again that are among them."""
    there = {sensor.name for sensor in m.sensors} & signals.keys()
    bare = {name: values for name, values in signals.items() if name not in there}
    again = with_sensors(m, bare, still=still)
    return {**signals, **bare, **{name: again[name] for name in there if name in again}}


@dataclass(frozen=True)
class _Seen:
    """A linkage by its signals.  Each method raises KeyError where they do not say what it asks."""

    m: Mechanism
    signals: Columns
    still: bool

    def _told(self, *names: str) -> np.ndarray:
        """A signal (N,), or two as x + iy."""
        x, *y = (self.signals[name] for name in names)
        return x + 1j * y[0] if y else x

    def _rate(self, *names: str) -> np.ndarray:
        return self.zeros if self.still else self._told(*names)

    @property
    def zeros(self) -> np.ndarray:
        """Nothing (N,)."""
        return np.zeros(next(iter(self.signals.values())).shape)

    def spot(self, sensor: Sensor) -> complex:
        """Where a sensor sits on its body (m, body frame)."""
        return sensor.at(self.m.moving[sensor.body])

    def angle(self, body: str) -> np.ndarray:
        """A body's angle (N,) rad."""
        return self.zeros if body == GROUND else self._told(f"{body}_angle")

    def spin(self, body: str) -> np.ndarray:
        """A body's angular velocity (N,) rad/s."""
        return self.zeros if body == GROUND else self._rate(f"{body}_angular_velocity")

    def spin_up(self, body: str) -> np.ndarray:
        """The angular acceleration (N,) rad/s^2 of a moving body."""
        return self._rate(Signal.of("acceleration", body, "angle").name)

    def place(self, body: str, point: complex) -> np.ndarray:
        """Where a point (m, body frame) is."""
        link = self.m.body(body)
        if isinstance(link, Ground):
            return point + self.zeros
        return self._told(f"{body}_x", f"{body}_y") + (point - link.point("com")) * np.exp(1j * self.angle(body))

    def velocity(self, body: str, point: complex) -> np.ndarray:
        """How fast a point (m, body frame) moves."""
        link = self.m.body(body)
        if isinstance(link, Ground):
            return self.zeros
        arm = (point - link.point("com")) * np.exp(1j * self.angle(body))
        x, y, *_ = (signal.name for signal in moving(body))
        return self._rate(x, y) + 1j * self.spin(body) * arm

    def acceleration(self, body: str, point: complex) -> np.ndarray:
        """How a point (m, of a moving body's frame) accelerates."""
        arm = (point - self.m.moving[body].point("com")) * np.exp(1j * self.angle(body))
        _, _, x, y, _ = (signal.name for signal in moving(body))
        return self._rate(x, y) + (1j * self.spin_up(body) - self.spin(body) ** 2) * arm

    def force(self, body: str, joint: str) -> np.ndarray:
        """The force (N,) N, x + iy, of a joint on one of the bodies that meet there."""
        sign = 1.0 if self.m.joint(joint).bodies[1] == body else -1.0
        return sign * self._told(*(Signal.of("reaction", joint, axis).name for axis in ("x", "y")))

    def torque(self, body: str, name: str) -> np.ndarray:
        """The moment (N,) N.m about a joint's point that a guide, or a motor, gives one of the bodies there."""
        m, joint = self.m, self.m.joint(name)
        sign = 1.0 if joint.bodies[1] == body else -1.0
        if joint.prismatic:
            return sign * self._told(Signal.of("reaction", name, "moment").name)
        motors = [each.name for each in m.motors]
        if name not in motors:
            return self.zeros
        return sign * m.crank_sign * self._told(driving(m.motors)[motors.index(name)].name)


def _along(seen: _Seen, sensor: Sensor) -> np.ndarray:
    """The sensor's axis (N,), of length 1, in the ground frame."""
    return sensor.direction * np.exp(1j * seen.angle(sensor.seen_from))


def _component(seen: _Seen, sensor: Sensor, vector: np.ndarray) -> np.ndarray:
    return np.real(np.conj(_along(seen, sensor)) * vector)


def _position(seen: _Seen, sensor: Sensor) -> np.ndarray:
    at, origin = seen.place(sensor.body, seen.spot(sensor)), seen.place(sensor.seen_from, 0j)
    return _component(seen, sensor, at - origin)


def _velocity(seen: _Seen, sensor: Sensor) -> np.ndarray:
    point, frame = seen.spot(sensor), sensor.seen_from
    velocity = seen.velocity(sensor.body, point)
    if frame not in (sensor.body, GROUND):  # as somebody sees it who rides on the frame and turns with it
        apart = seen.place(sensor.body, point) - seen.place(frame, 0j)
        velocity = velocity - seen.velocity(frame, 0j) - 1j * seen.spin(frame) * apart
    return _component(seen, sensor, velocity)


def _accelerometer(seen: _Seen, sensor: Sensor) -> np.ndarray:
    felt = seen.acceleration(sensor.body, seen.spot(sensor)) - complex(*seen.m.gravity)
    return _component(seen, sensor, felt)


def _gyro(seen: _Seen, sensor: Sensor) -> np.ndarray:
    return seen.spin(sensor.body)


def _distance(seen: _Seen, sensor: Sensor) -> np.ndarray:
    body, point = sensor.far_end
    return np.abs(seen.place(sensor.body, seen.spot(sensor)) - seen.place(body, seen.m.body(body).point(point)))


def _force(seen: _Seen, sensor: Sensor) -> np.ndarray:
    return _component(seen, sensor, seen.force(sensor.body, sensor.joint))


def _torque(seen: _Seen, sensor: Sensor) -> np.ndarray:
    return seen.torque(sensor.body, sensor.joint)


def _strain(seen: _Seen, sensor: Sensor) -> np.ndarray:
    """N / EA - M y / EI of a bar along its body's x axis, N and M those that the part beyond the gauge passes on.

    Either part says them; raises KeyError where what acts on both of them is not among the signals.
    """
    body, spot = seen.m.moving[sensor.body], seen.spot(sensor)
    height, depth = body.section
    for side in (1, -1):
        if _told(seen.m, body, spot.real, side):
            normal, moment = _passed_on(seen, body, spot.real, side)
            stress = normal / (height * depth) - moment * spot.imag / (depth * height**3 / 12)
            return side * stress / (sensor.modulus(body) or math.inf)
    raise KeyError(sensor.name)


def _told(m: Mechanism, body: Body, cut: float, side: int) -> bool:
    """Whether reactions, motors, constant loads and springs are all that acts on the part of a bar on one ``side`` (1:
    of larger x) of a cut (m).
    """

    def beyond(point: str) -> bool:
        return side * (body.point(point).real - cut) > 0

    joints = [joint for joint in m.joints if body.name in joint.bodies and beyond(joint.name)]
    driven = {drive.joint for drive in m.drives}
    own = [joint.has_law or (joint.prismatic and joint.name in driven) for joint in joints]
    turned = m.periodic_torque is not None and any(joint.name in driven for joint in joints)
    varying = any(load.body == body.name and load.varies and beyond(load.point) for load in m.loads)
    return not (any(own) or turned or varying)


def _passed_on(seen: _Seen, body: Body, cut: float, side: int) -> tuple[np.ndarray, np.ndarray]:
    """Force along the bar (N,) N and moment about the cut (N,) N.m that a part of a bar passes on to the rest."""
    m, back = seen.m, np.exp(-1j * seen.angle(body.name))
    low, high = ends(body)
    mass, first, second = mass_between(body, *((cut, high) if side > 0 else (low, cut)))
    turning = 1j * seen.spin_up(body.name) - seen.spin(body.name) ** 2
    aside = 1j * body.centre.imag
    start = back * (seen.acceleration(body.name, 0j) - complex(*m.gravity)) + turning * aside
    force = -(mass * start + first * turning)
    moment = -np.imag((first - (cut + aside) * mass) * start + (second - (cut + aside) * first) * turning)
    moment = moment - seen.spin_up(body.name) * mass * body.section[0] ** 2 / 12

    acting = [
        (j.name, seen.force(body.name, j.name), seen.torque(body.name, j.name))
        for j in m.joints
        if body.name in j.bodies
    ]
    acting += [
        (load.point, complex(*load.force) + 0 * seen.zeros, load.torque + seen.zeros)
        for load in m.loads
        if load.body == body.name and not load.varies
    ]
    acting += list(_springs(seen, body))
    for point, pull, torque in acting:
        arm = body.point(point) - cut
        if side * arm.real > 0:
            pull = pull * back
            force, moment = force + pull, moment + np.imag(np.conj(arm) * pull) + torque
    return np.real(force), moment


def _springs(seen: _Seen, body: Body) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Each end of a spring on a body, the force (N,) on it, and no torque."""
    for spring in seen.m.springs:
        for (name, point), (other, far) in (spring.ends, spring.ends[::-1]):
            if name == body.name:
                here, there = ((b, seen.m.body(b).point(p)) for b, p in ((name, point), (other, far)))
                apart, rate = seen.place(*there) - seen.place(*here), seen.velocity(*there) - seen.velocity(*here)
                yield point, spring.pull(apart, rate), seen.zeros


_READINGS = {
    "position": _position,
    "velocity": _velocity,
    "accelerometer": _accelerometer,
    "gyro": _gyro,
    "distance": _distance,
    "strain": _strain,
    "force": _force,
    "torque": _torque,
}

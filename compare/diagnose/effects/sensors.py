"""Effects on sensors, clocks and the encoder: pure functions on readings."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from analytic.kinematics.schedule import Turning
from analytic.mechanism import Body, Mechanism, Sensor
from analytic.mechanism.signals import AXES, Signal, wrapped
from compare.diagnose.effects.each_run import EachRun
from compare.diagnose.effects.effect import Draw, Effect, Growth, Hiding, Parameter, Readings, Rig, Values, Wave

HARMONICS = range(1, 25)  # of an encoder's error over a turn
NEWTON = 6  # steps, at most
FOUND = 1e-9  # rad, of a step: the next one is rounding


class OfSignal(EachRun):
    """Faults of a sensor that have one value, or one for each run: a zero that is set anew each time."""

    place = "signal"
    sensor = True

    def runs(self, rig: Rig, where: str) -> Sequence[str]:
        """The runs in which the sensor was read."""
        return [run for run in rig.runs if where in rig.recorded.get(run, rig.signals)]


class EncoderOffset(OfSignal):
    """A constant error of the driven body's angle, the motor's encoder; one value, or one for each run.

    In a run that follows the encoder the motor is at column minus offset, so the offset moves the whole linkage.
    """

    name = "encoder_offset"
    label = "an offset of the encoder for {}"
    meaning = "the encoder {} has an offset"
    hiding = Hiding(sensors=("encoder",))
    found = "the encoder {} reads {}"
    parameters = (Parameter("offset", "rad", "angle", more="too much", less="too little"),)

    def places(self, rig: Rig) -> Sequence[str]:
        return [encoder for encoder in rig.encoders if encoder in rig.signals]

    def unit(self, rig: Rig, where: str, parameter: str) -> str:
        return rig.known[where].unit

    def scale(self, rig: Rig, where: str) -> float:
        return 1e-5

    def values(self, rig: Rig, where: str, x: np.ndarray, variant: float = 0.0) -> dict[str, float]:
        turns = rig.known[where].wraps and np.isfinite(x).all()
        within = wrapped(x) if turns else x  # a turn more is the same zero
        return super().values(rig, where, within, variant)

    def on_readings(self, readings: Readings, run: str, where: str, values: Values) -> Readings:
        offset = self.value(run, values)
        return {**readings, where: readings[where] + offset} if offset and where in readings else readings

    def motor(self, run: str, read: Turning, values: Values) -> Turning:
        return replace(read, theta=read.theta - self.value(run, values))

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        share = draw.rng.uniform(-1, 1, len(rig.driven))
        if len(rig.driven) > 1 and draw.rng.random() < 0.3:
            shares = {f"offset@{run}": float(k) for run, k in zip(rig.driven, share, strict=True)}
            return Growth(lambda a: {name: a * k for name, k in shares.items()}, 0.05, self.each_run)
        return Growth(lambda a: {"offset": a * draw.sign}, 0.05)


class EncoderHarmonic(Wave):
    """An encoder whose reading is off by amplitude sin(harmonic angle + phase): an eccentric disc, a bent shaft.

    In a run that follows the encoder it moves the whole linkage.
    """

    name = "encoder_harmonic"
    place = "signal"
    label = "a periodic error of the encoder for {}"
    meaning = "the encoder {} errs over its turn"
    hiding = Hiding(sensors=("encoder",), sets="machines")
    sensor = True
    parameters = (
        Parameter("amplitude", "rad", "angle", 0.0),
        Parameter("harmonic", "1", "harmonic", discrete=True),
        Parameter("phase", "rad", "phase", circular=True),
    )

    def places(self, rig: Rig) -> Sequence[str]:
        return [rig.encoder] if rig.encoder in rig.signals and rig.mechanism.cranked else []

    def variants(self, rig: Rig, where: str) -> Sequence[float]:
        return rig.told(HARMONICS)

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-5, 1e-5)

    def on_readings(self, readings: Readings, run: str, where: str, values: Values) -> Readings:
        if where not in readings or not values["amplitude"]:
            return readings
        amplitude, harmonic, phase = (values[p.name] for p in self.parameters)
        return {**readings, where: readings[where] + amplitude * np.sin(harmonic * readings[where] + phase)}

    def motor(self, run: str, read: Turning, values: Values) -> Turning:
        """The angle that is read as this, by Newton's method, and its rates.  Raises ValueError where several are."""
        amplitude, harmonic, phase = (values[p.name] for p in self.parameters)
        if amplitude * harmonic >= 1:
            raise ValueError(f"an error of {amplitude:.3g} rad, {harmonic:g} times a turn, reads several angles as one")
        theta = read.theta
        for _ in range(NEWTON):
            turned = harmonic * theta + phase
            step = (theta + amplitude * np.sin(turned) - read.theta) / (1 + amplitude * harmonic * np.cos(turned))
            theta = np.clip(theta - step, read.theta - amplitude, read.theta + amplitude)
            if np.abs(step).max(initial=0.0) < FOUND:
                break
        turned = harmonic * theta + phase
        slope, bend = 1 + amplitude * harmonic * np.cos(turned), -amplitude * harmonic**2 * np.sin(turned)
        omega = read.omega / slope
        return Turning(theta, omega, (read.alpha - bend * omega**2) / slope)

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        harmonic, phase = float(draw.rng.integers(1, 13)), draw.turn - math.pi
        return Growth(lambda a: {"amplitude": a, "harmonic": harmonic, "phase": phase}, 0.02, harmonic)


def _judged(rig: Rig) -> Sequence[str]:
    """The sensors that are judged: of several drives not the encoders, which every run follows."""
    return [s for s in rig.signals if s not in rig.encoders] if rig.mechanism.several else rig.signals


class OnSensor(Effect):
    """Effects on one sensor."""

    place = "signal"
    sensor = True

    def places(self, rig: Rig) -> Sequence[str]:
        return [s for s in rig.signals if s not in rig.encoders]


class SensorBias(OnSensor, OfSignal):
    """A constant error of a sensor (of the encoder it is called ``encoder_offset``); one value, or one for each
    run.
    """

    name = "sensor_bias"
    label = "a bias of the sensor for {}"
    meaning = "the sensor {} has a bias"
    found = "the sensor {} reads {}"
    parameters = (Parameter("bias", "", "bias", more="too much", less="too little"),)

    def unit(self, rig: Rig, where: str, parameter: str) -> str:
        return rig.known[where].unit

    def scale(self, rig: Rig, where: str) -> float:
        return rig.noise[where]

    def on_readings(self, readings: Readings, run: str, where: str, values: Values) -> Readings:
        bias = self.value(run, values)
        return {**readings, where: readings[where] + bias} if bias and where in readings else readings

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        return Growth(lambda a: {"bias": a * draw.sign * rig.noise[where]}, 30.0)


class SensorDrift(OnSensor, OfSignal):
    """A sensor that creeps away from its first sample at a constant rate, as a warming amplifier does; one rate, or one
    for each run.
    """

    name = "sensor_drift"
    label = "a drift of the sensor for {}"
    meaning = "the sensor {} drifts"
    hiding = Hiding(sets=None)
    found = "the sensor {} drifts by {}"
    parameters = (Parameter("drift", "of the signal per s", "drift", more="upwards", less="downwards"),)

    def places(self, rig: Rig) -> Sequence[str]:
        return _judged(rig)

    def unit(self, rig: Rig, where: str, parameter: str) -> str:
        return f"{rig.known[where].unit}/s"

    def scale(self, rig: Rig, where: str) -> float:
        return rig.noise[where] * rig.speed

    def drift(self, run: str, signal: str, where: str, values: Values) -> float:
        return self.value(run, values) if signal == where else 0.0

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        rate = draw.sign * rig.noise[where] * rig.speed / (2 * math.pi)  # the noise, over a turn of the fastest run
        return Growth(lambda a: {"drift": a * rate}, 30.0)


class SensorGain(OnSensor):
    """A sensor whose scale is off: reading = (1 + gain_error) value."""

    name = "sensor_gain"
    label = "a gain error of the sensor for {}"
    meaning = "the sensor {} has a wrong gain"
    found = "the sensor {} reads {}"
    limited = True
    parameters = (Parameter("gain_error", "1", "gain", -0.9, percent=True, more="too much", less="too little"),)

    def places(self, rig: Rig) -> Sequence[str]:
        return _judged(rig)

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-4,)

    def on_readings(self, readings: Readings, run: str, where: str, values: Values) -> Readings:
        return {**readings, where: readings[where] * (1 + values["gain_error"])} if where in readings else readings

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        return Growth(lambda a: {"gain_error": a * draw.sign}, 0.2)


class SensorDelay(OnSensor):
    """A sensor that reads the motion of some time ago."""

    name = "sensor_delay"
    label = "a delay of the sensor for {}"
    meaning = "the sensor {} is late"
    parameters = (Parameter("delay", "s", "time", 0.0),)

    def places(self, rig: Rig) -> Sequence[str]:
        return _judged(rig)

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-4 / rig.speed,)

    def delay(self, run: str, signal: str, where: str, values: Values) -> float:
        return values["delay"] if signal == where else 0.0

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        return Growth(lambda a: {"delay": a}, 0.1 / rig.speed)


class SensorLag(Effect):
    """A first-order filter before a sensor, or before all forces and torques where one amplifier has them (``where`` is
    their names joined by +).
    """

    name = "sensor_lag"
    place = "signal"
    label = "a filter before the sensor for {}"
    meaning = "the sensor {} lags behind a filter"
    hiding = Hiding(sets=None)
    parameters = (Parameter("time_constant", "s", "time", 0.0),)
    sensor = True

    def places(self, rig: Rig) -> Sequence[str]:
        single = [s for s in rig.signals if s not in rig.encoders]
        amplifier = [s for s in single if rig.known[s].kind in ("reaction", "drive")]
        return [*single, "+".join(amplifier)] if len(amplifier) > 1 else single

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-3 / rig.speed,)

    def lag(self, run: str, signal: str, where: str, values: Values) -> float:
        return values["time_constant"] if signal in where.split("+") else 0.0

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        return Growth(lambda a: {"time_constant": a}, 0.1 / rig.speed)


class SensorFrame(Effect):
    """A load cell mounted turned about z: it reports the components of the force along its own axes."""

    name = "sensor_frame"
    place = "joint"
    label = "a turned load cell at joint {}"
    meaning = "the load cell at {} is mounted turned"
    hiding = Hiding(sensors=("cell",))
    found = "the load cell at {} is mounted turned by {}"
    parameters = (Parameter("rotation", "rad", "angle", circular=True, more="counter-clockwise", less="clockwise"),)
    sensor = True

    def places(self, rig: Rig) -> Sequence[str]:
        return [j.name for j in rig.mechanism.joints if set(_cell(j.name)) <= set(rig.signals)]

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-4,)

    def variants(self, rig: Rig, where: str) -> Sequence[float]:
        return (0.0, math.pi / 2, math.pi, -math.pi / 2)

    def acts_by_itself(self, variant: float) -> bool:
        return variant != 0.0

    def middle(self, variant: float) -> float:
        return variant

    def values(self, rig: Rig, where: str, x: np.ndarray, variant: float = 0.0) -> dict[str, float]:
        return {"rotation": float(x[0]) + variant}

    def natural(self, rig: Rig, where: str, values: Values, variant: float = 0.0) -> np.ndarray:
        return super().natural(rig, where, values, variant) - variant

    def on_readings(self, readings: Readings, run: str, where: str, values: Values) -> Readings:
        x, y = _cell(where)
        if x not in readings or y not in readings:
            return readings
        force = (readings[x] + 1j * readings[y]) * np.exp(-1j * values["rotation"])
        return {**readings, x: force.real, y: force.imag}

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        quarters = (math.pi / 2, math.pi, -math.pi / 2)
        turn = float(draw.rng.choice(quarters)) if draw.rng.random() < 0.25 else 0.0
        return Growth(lambda a: {"rotation": turn + a * draw.sign}, 0.3, turn)


class OnChip(Effect):
    """How an accelerometer is mounted: what it reads follows from the mechanism's ``[[sensor]]``, which changes."""

    place = "signal"
    hiding = Hiding(sets=None)
    sensor = True

    def places(self, rig: Rig) -> Sequence[str]:
        return [s.name for s in rig.mechanism.sensors if s.kind == "accelerometer" and s.name in rig.signals]

    @abstractmethod
    def mounted(self, chip: Sensor, body: Body, value: float) -> Sensor:
        """The chip on a body, mounted so."""

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        (value,) = values.values()
        return mechanism.replace(
            sensors=tuple(
                self.mounted(each, mechanism.moving[each.body], value) if each.name == where else each
                for each in mechanism.sensors
            )
        )


class SensorPlace(OnChip):
    """An accelerometer that sits elsewhere on its body than the file says, along the body's x axis."""

    name = "sensor_place"
    label = "another place of the accelerometer {}"
    meaning = "the accelerometer {} sits elsewhere on its body"
    found = "the accelerometer {} sits {} along its body"
    parameters = (Parameter("along", "m", "length", more="further", less="less far"),)

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-4 * rig.length,)

    def mounted(self, chip: Sensor, body: Body, value: float) -> Sensor:
        at = chip.at(body) + value
        return chip.model_copy(update={"point": (at.real, at.imag)})

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        return Growth(lambda a: {"along": a * draw.sign * rig.length}, 0.1)


class AxisError(OnChip):
    """An accelerometer whose axis is turned against the one that the file says."""

    name = "axis_error"
    label = "a turned axis of the accelerometer {}"
    meaning = "the axis of the accelerometer {} is turned"
    found = "the axis of the accelerometer {} is turned by {}"
    parameters = (Parameter("rotation", "rad", "angle", more="counter-clockwise", less="clockwise"),)

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-4,)

    def mounted(self, chip: Sensor, body: Body, value: float) -> Sensor:
        axis = chip.direction * np.exp(1j * value)
        return chip.model_copy(update={"axis": (float(axis.real), float(axis.imag))})

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        return Growth(lambda a: {"rotation": a * draw.sign}, 0.3)


class ClockOffset(Effect):
    """A whole run that is late on its command: it reads the motion that was commanded some time ago."""

    name = "clock_offset"
    place = "run"
    label = "a clock offset of run {}"
    meaning = "the clock of run {} is off against its command"
    hiding = Hiding(commanded=True)
    found = "run {} is {}"
    parameters = (Parameter("offset", "s", "time", more="late on its command", less="ahead of its command"),)
    sensor = True

    def places(self, rig: Rig) -> Sequence[str]:
        return [run for run in rig.driven if run not in rig.following]

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-4 / rig.speed,)

    def delay(self, run: str, signal: str, where: str, values: Values) -> float:
        return values["offset"] if run == where else 0.0

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        return Growth(lambda a: {"offset": a * draw.sign}, 0.1 / draw.speeds[where])


class StampJitter(OfSignal):
    """Lines of a run that follows its encoder which are not read when their stamps say: what the encoder is off its
    even course is then partly true motion; one jitter, or one for each run, as loggers at several rates have.  The
    natural coordinate is the square of the jitter, in which it is linear.
    """

    name = "stamp_jitter"
    label = "jitter of the time stamps of the runs that follow {}"
    meaning = "the time stamps of the runs that follow {} jitter"
    hiding = Hiding(sets=None)
    parameters = (Parameter("jitter", "s", "time", 0.0),)
    scatters = True

    def places(self, rig: Rig) -> Sequence[str]:
        single = len(rig.encoders) == 1 and rig.encoder in rig.signals  # several would tell several times
        return [rig.encoder] if rig.following and single else []

    def runs(self, rig: Rig, where: str) -> Sequence[str]:
        return rig.following

    def scale(self, rig: Rig, where: str) -> float:
        return (rig.noise.get(where, 1e-4) / rig.speed) ** 2

    def least(self, rig: Rig, where: str) -> float:
        return 0.0

    def values(self, rig: Rig, where: str, x: np.ndarray, variant: float = 0.0) -> dict[str, float]:
        return super().values(rig, where, np.sqrt(np.maximum(x, 0.0)), variant)

    def natural(self, rig: Rig, where: str, values: Values, variant: float = 0.0) -> np.ndarray:
        return super().natural(rig, where, values, variant) ** 2

    def jitter(self, run: str, values: Values) -> float:
        return self.value(run, values)

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        return Growth(lambda a: {"jitter": a / rig.speed}, 0.05)


def _cell(joint: str) -> tuple[str, str]:
    """Names of the two signals of a joint's load cell."""
    x, y = (Signal.of("reaction", joint, axis).name for axis in AXES)
    return x, y


EFFECTS: tuple[Effect, ...] = (
    EncoderOffset(),
    EncoderHarmonic(),
    SensorBias(),
    SensorGain(),
    SensorDelay(),
    SensorFrame(),
    ClockOffset(),
    SensorLag(),
    SensorDrift(),
    StampJitter(),
    SensorPlace(),
    AxisError(),
)

"""The next experiment: which further run, or which further sensor, would tell two explanations apart, by simulation."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from analytic.mechanism import Load, Mechanism
from analytic.mechanism.signals import AXES, POSE, Signal, SiUnit
from compare.diagnose.data.recording import Channel, Measured, MeasuredRun
from compare.diagnose.effects.effect import Readings, Rig
from compare.diagnose.fit import Fit, hypothesis, without_columns
from compare.diagnose.predict import Model
from compare.diagnose.residuals import bridged
from compare.files import file_name
from compare.quantities import amount

ENOUGH = 8.0  # sigmas between two explanations that separate them
USEFUL = 3.0
NONE_WOULD = "none of what was tried would"
SAMPLES = 90  # of a run that is tried
SHARE = 0.005  # of a signal's peak: the noise taken for a sensor that is not there yet
TYPICAL: dict[SiUnit, float] = {"rad": 5e-5, "rad/s": 1e-3, "m": 2e-5}  # the same for motions


@dataclass(frozen=True)
class Trial:
    """A run that could be made: in words, and as it would stand in measured.toml."""

    words: str
    run: MeasuredRun
    sensor: str = ""  # that is not there yet

    def as_toml(self, measured: Measured) -> str:
        """The run as a [[run]] of measured.toml, under a name that no run has yet."""
        name = f"{self.run.name}-with-{self.sensor}" if self.sensor else self.run.name
        taken = {run.name for run in measured.runs} | {run.file.removesuffix(".csv") for run in measured.runs}
        return as_toml(
            replace(
                self.run,
                name=next(n for k in itertools.count(1) if (n := name if k == 1 else f"{name}-{k}") not in taken),
            )
        )


def would_separate(model: Model, noise: dict[tuple[str, str], float], one: Fit, others: Sequence[Fit]) -> str:
    """The first run or sensor that would tell a fit from every one of others by ENOUGH sigmas, or else what would tell
    it from most of them, or what came nearest to that.
    """
    rig = model.rig
    best: tuple[tuple[int, float], str] = ((0, 0.0), "")
    tried: list[str] = []
    first = _with_every_sensor(model.measured.runs[0], rig.mechanism)
    known: list[Foretold] = []
    for trial in _trials(rig, model.measured):
        if trial.sensor:
            foretold = known = known or [Foretold.of(model, one, other, first) for other in others]
        else:
            foretold = [Foretold.of(model, one, other, trial.run) for other in others]
        found = [each.apart(noise, trial.run) for each in foretold]
        sigmas = sorted((apart for apart, _ in found), reverse=True)
        parted = sum(each > ENOUGH for each in sigmas)
        least = sigmas[max(parted, 1) - 1]
        given = ""
        if least and trial.sensor:
            sigma = max(found, key=lambda each: each[0])[1][trial.sensor]
            given = f", if its noise is {amount(sigma, rig.known[trial.sensor].unit)}"
        whom = "them" if parted == len(others) else f"{parted} of {len(others)}"
        by = f"by {least:.0f} sigma{given}"
        says = f" (would part {whom} {by})" if parted else f", though only {by}"
        rank = parted, 0.0 if parted else least  # of runs that part as many the first, which is the easiest to make
        if rank > best[0]:
            best = rank, f"{trial.words}{says}:\n{trial.as_toml(model.measured)}"
        if parted == len(others):
            break
        tried += [trial.words] if not trial.sensor else []
    (parted, least), says = best
    if parted or least > USEFUL:
        return says
    drive = " or ".join(dict.fromkeys(effort.component for effort in model.mechanism.efforts))
    sensors = f"a run like the first with any further sensor of a position, an angle, a reaction or the drive {drive}"
    return f"{NONE_WOULD}: {'; '.join([*tried, sensors])}"


def _trials(rig: Rig, measured: Measured) -> Iterator[Trial]:
    """Runs worth trying, the easiest first; then the sensors that are not there, one at a time."""
    driven = [r for r in measured.runs if r.drive == "speed" and r.speed]
    if driven:
        yield from Variations(max(driven, key=lambda r: r.time.size), rig, {r.speed for r in driven}).all()
    for base in measured.runs[:1]:
        every = _with_every_sensor(base, rig.mechanism).channels
        for name, channel in every.items():
            if name not in rig.signals:
                more = replace(base, channels={**base.channels, name: channel})
                yield Trial(f"measure {name} too, in a run like {base.name!r}", more, name)


def _with_every_sensor(run: MeasuredRun, mechanism: Mechanism) -> MeasuredRun:
    """A run in which everything is measured that can be."""
    more = {s.name: Channel(s, np.zeros(run.time.size), 0.0, False, "") for s in _sensors(mechanism)}
    return replace(run, channels={**more, **run.channels})


@dataclass(frozen=True)
class Variations:
    """Runs like one that was made at a speed, but with other loads, speeds or direction; ``taken`` are the speeds
    (rad/s) that have been run.
    """

    base: MeasuredRun
    rig: Rig
    taken: Collection[float | None]

    def all(self) -> Iterator[Trial]:
        """The runs, the easiest to make first."""
        loads, speed = self.loads, self.base.speed or 0.0
        if loads:
            yield self.run("reversed-load", "reverse the load", loads=tuple(_turned(load, -1) for load in loads))
        if all((other or 0.0) * speed >= 0 for other in self.taken):
            yield self.run("reverse", "run the drive the other way", speed=-speed)
        yield from self.other_loads()
        for factor in (2.0, 0.5, 4.0, 0.25):
            faster = math.copysign(abs(speed) * factor, speed or 1.0)
            yield self.run(f"{factor:g}-times-the-speed", f"run at {factor:g} times the speed", speed=faster)

    @property
    def loads(self) -> tuple[Load, ...]:
        """The loads of the run, but for those over its time: they are whatever acted on it."""
        loads = self.base.loads if self.base.loads is not None else self.rig.mechanism.loads
        return tuple(load for load in loads if load.over != "time")

    def other_loads(self) -> Iterator[Trial]:
        """The loads turned, doubled and taken off; where there are none, one up and one down."""
        loads, m = self.loads, self.rig.mechanism
        if loads:
            yield self.run(
                "turned-load", "turn the load by a quarter", loads=tuple(_turned(load, 1j) for load in loads)
            )
            yield self.run("double-load", "double the load", loads=tuple(_turned(load, 2) for load in loads))
            yield self.run("no-load", "take the load off", loads=())
            return
        floating = next((b.name for b in reversed(m.bodies) if b.name != m.driven), m.driven)
        force = 10 * self.rig.force
        for sign in (1, -1):
            pull = Load(body=floating, force=(0.0, sign * force))
            name = f"load-{'up' if sign > 0 else 'down'}"
            yield self.run(name, f"load {floating} with {force:.3g} N", loads=(pull,))

    def run(self, name: str, words: str, **change: object) -> Trial:
        """A run with something changed, over as large an angle."""
        base = self.base
        now = replace(base, name=name, **change)  # type: ignore[arg-type]
        span = abs(base.speed or 1.0) * float(base.time[-1] - base.time[0])
        time = np.linspace(0.0, span / abs(now.speed or 1.0), min(SAMPLES, base.time.size))
        return Trial(words, replace(now, time=time))


def _turned(load: Load, by: complex) -> Load:
    force = complex(*load.force) * by
    torque = load.torque * (by.real if by.imag == 0 else -1.0)
    return load.model_copy(update={"force": (force.real, force.imag), "torque": torque})


def _sensors(mechanism: Mechanism) -> list[Signal]:
    poses = [Signal.of("pose", b.name, component) for b in mechanism.bodies for component in POSE]
    cells = [Signal.of("reaction", j.name, axis) for j in mechanism.joints for axis in AXES]
    return [*poses, *mechanism.efforts, *cells]


@dataclass(frozen=True)
class Foretold:
    """What two fits say of a run: the first, the second, and the second with each of its coordinates a step further;
    None where one is impossible.
    """

    model: Model
    one: Fit
    other: Fit
    steps: np.ndarray
    readings: Sequence[Sequence[Readings] | None]

    @classmethod
    def of(cls, model: Model, one: Fit, other: Fit, run: MeasuredRun) -> Foretold:
        """Of this run."""
        trial = Model(replace(model.measured, runs=(run,)), model.rig, model.mechanism, model.courses)
        scale = [np.asarray(t.effect.scales(model.rig, t.where, t.variant), float) for t in other.terms]
        points = [list(other.x)]
        for i, x in enumerate(other.x):
            points += [[*other.x[:i], x + step, *other.x[i + 1 :]] for step in np.diag(scale[i])]
        asked = [hypothesis(model.rig, one.terms, one.x), *(hypothesis(model.rig, other.terms, p) for p in points)]
        return cls(model, one, other, np.concatenate(scale or [np.zeros(0)]), trial(asked))

    def apart(self, noise: dict[tuple[str, str], float], run: MeasuredRun) -> tuple[float, dict[str, float]]:
        """Sigmas between the two fits if the run were made too, with its sensors, after the second has been fitted to
        data and run again; the noise taken for it.
        """
        one, other, *stepped = self.readings
        if one is None or other is None:
            return 0.0, {}
        single = {s: _noise(channel.signal, one[0][s], noise) for s, channel in run.channels.items()}
        longest = max(r.time.size for r in self.model.measured.runs)
        coarse = math.sqrt(run.time.size / longest)  # fewer samples than the run would have
        sigma = {s: coarse * size for s, size in single.items()}

        def difference(a: Readings, b: Readings) -> np.ndarray:
            """Of two predictions of the run, over the noise; angles modulo a turn."""
            parts = [c.signal.apart(bridged(a[s]), bridged(b[s])) / sigma[s] for s, c in run.channels.items()]
            return np.concatenate(parts)

        new = difference(one[0], other[0])
        columns = [
            np.zeros(new.size) if f is None else difference(f[0], other[0]) / h
            for f, h in zip(stepped, self.steps, strict=True)
        ]
        apart = np.concatenate([self.other.residual - self.one.residual, new])
        beside = -np.column_stack(columns) if columns else np.zeros((new.size, 0))
        jacobian = np.concatenate([self.other.jacobian, beside])
        return float(np.linalg.norm(without_columns(apart, jacobian)[-new.size :])), single


def _noise(signal: Signal, values: np.ndarray, noise: dict[tuple[str, str], float]) -> float:
    known = [v for (_, s), v in noise.items() if s == signal.name]
    if known:
        return min(known)
    if signal.unit in TYPICAL and signal.kind != "reaction":
        return TYPICAL[signal.unit]
    return max(SHARE * float(np.nanmax(np.abs(values))), 1e-9)


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)  # which is a string of TOML too


def as_toml(run: MeasuredRun) -> str:
    """A run as a [[run]] of measured.toml."""
    lines = ["[[run]]", f"name = {_quoted(run.name)}", f"file = {_quoted(file_name(run.name) + '.csv')}"]
    if run.drive == "speed":
        lines += [f"drive_speed = {run.speed!r}", f"drive_angle = {run.angle!r}"]
    else:
        lines.append(f'drive = "{run.drive}"')
    if run.loads == ():
        lines.append("load = []")  # none, not the mechanism's own
    for load in run.loads or ():
        if load.over == "time":
            lines.append(f"# and what acts on {load.body} meanwhile, recorded: [columns] of the run says how")
            continue
        lines += [
            "[[run.load]]",
            f"body = {_quoted(load.body)}",
            f"point = {_quoted(load.point)}",
            f"force = [{load.force[0]!r}, {load.force[1]!r}]",
        ]
        lines += [f"torque = {load.torque!r}"] if load.torque else []
        lines += [f"over = {_quoted(load.over)}"] if load.over else []
        lines += [f"from = {load.start!r}", f"to = {load.end!r}"] if load.start is not None else []
        lines += [f"table = {[list(pair) for pair in load.table]!r}"] if load.table else []
        lines += ["opposes = true"] if load.opposes else []
    return "\n".join(lines)

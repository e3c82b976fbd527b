"""Which further run, or which further sensor, would tell two explanations apart: found by computing it."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from analytic.mechanism import Load, Mechanism
from compare.diagnose.data.recording import Channel, Measured, Run
from compare.diagnose.data.units import unit_of
from compare.diagnose.effects.effect import Rig
from compare.diagnose.fit import Fit, bridged, hypothesis
from compare.diagnose.predict import Model, wrapped
from compare.files import file_name
from compare.quantities import amount

ENOUGH = 8.0  # sigmas between two explanations that separate them
USEFUL = 3.0
SAMPLES = 90  # of a run that is tried
SHARE = 0.005  # of a signal's peak: the noise taken for a sensor that is not there yet
TYPICAL = {"_angle": 5e-5, "_angular_velocity": 1e-3, "_x": 2e-5, "_y": 2e-5}  # rad, rad/s, m: the same for motions


@dataclass(frozen=True)
class Trial:
    """A run that could be made: in words, and as it would stand in measured.toml."""

    words: str
    run: Run
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


def would_separate(model: Model, noise: dict[tuple[str, str], float], one: Fit, other: Fit) -> str:
    """The first run or sensor that would tell two fits apart by ENOUGH sigmas, or what came nearest."""
    rig = model.rig
    best: tuple[float, str] = (0.0, "")
    tried: list[str] = []
    for trial in _trials(rig, model.measured):
        sigmas, sigma = _apart(model, noise, one, other, trial.run)
        given = (
            f", if its noise is {amount(sigma[trial.sensor], unit_of(trial.sensor))}" if sigmas and trial.sensor else ""
        )
        if sigmas > ENOUGH:
            return f"{trial.words} (would part them by {sigmas:.0f} sigma{given}):\n{trial.as_toml(model.measured)}"
        tried += [trial.words] if not trial.sensor else []
        best = max(
            best, (sigmas, f"{trial.words}, though only by {sigmas:.0f} sigma{given}:\n{trial.as_toml(model.measured)}")
        )
    if best[0] > USEFUL:
        return best[1]
    sensors = "any further position, angle, reaction (x, y) or drive torque in a run like the first"
    return f"none of the runs and sensors tried would: {'; '.join([*tried, sensors])}"


def _trials(rig: Rig, measured: Measured) -> Iterator[Trial]:
    """Runs worth trying, the easiest first; then the sensors that are not there, one at a time."""
    driven = [r for r in measured.runs if r.drive == "speed" and r.speed]
    if driven:
        base = max(driven, key=lambda r: r.time.size)
        speed = abs(base.speed or 0.0)
        loads = base.loads if base.loads is not None else rig.mechanism.loads
        taken = {r.speed for r in driven}

        def run(name: str, words: str, **change: object) -> Trial:
            now = replace(base, name=name, **change)  # type: ignore[arg-type]
            span = abs(base.speed or 1.0) * float(base.time[-1] - base.time[0])
            return Trial(
                words, replace(now, time=np.linspace(0.0, span / abs(now.speed or 1.0), min(SAMPLES, base.time.size)))
            )

        if loads:
            reverse = tuple(_turned(load, -1) for load in loads)
            yield run("reversed-load", "reverse the load", loads=reverse)
        if -(base.speed or 0.0) not in taken:
            yield run("reverse", "run the drive the other way", speed=-(base.speed or 0.0))
        if loads:
            yield run("turned-load", "turn the load by a quarter", loads=tuple(_turned(load, 1j) for load in loads))
            yield run("double-load", "double the load", loads=tuple(_turned(load, 2) for load in loads))
            yield run("no-load", "take the load off", loads=())
        else:
            floating = next(
                (b.name for b in reversed(rig.mechanism.bodies) if b.name != rig.mechanism.driven), rig.mechanism.driven
            )
            force = 10 * rig.force
            for sign in (1, -1):
                pull = Load(body=floating, force=(0.0, sign * force))
                yield run(f"load-{'up' if sign > 0 else 'down'}", f"load {floating} with {force:.3g} N", loads=(pull,))
        for factor in (2.0, 0.5, 4.0, 0.25):
            faster = math.copysign(speed * factor, base.speed or 1.0)
            yield run(f"{factor:g}-times-the-speed", f"run at {factor:g} times the speed", speed=faster)
    for base in measured.runs[:1]:
        for signal in _sensors(rig.mechanism):
            if signal not in rig.signals:
                channel = Channel(signal, np.zeros(base.time.size), 0.0, False, "")
                more = replace(base, channels={**base.channels, signal: channel})
                yield Trial(f"measure {signal} too, in a run like {base.name!r}", more, signal)


def _turned(load: Load, by: complex) -> Load:
    force = complex(*load.force) * by
    torque = load.torque * (by.real if by.imag == 0 else -1.0)
    return Load(body=load.body, point=load.point, force=(force.real, force.imag), torque=torque)


def _sensors(mechanism: Mechanism) -> list[str]:
    names = [f"{b.name}_{part}" for b in mechanism.bodies for part in ("angle", "x", "y")]
    return [*names, "drive_torque", *(f"reaction_{j.name}_{axis}" for j in mechanism.joints for axis in "xy")]


def _apart(
    model: Model, noise: dict[tuple[str, str], float], one: Fit, other: Fit, run: Run
) -> tuple[float, dict[str, float]]:
    """Sigmas between two fits if the run were made too, after the second has been fitted to data and run again; the
    noise taken for it.
    """
    trial = Model(replace(model.measured, runs=(run,)), model.rig, model.mechanism, model.courses)
    terms, scale = other.terms, []
    for t in terms:
        scale.append(np.asarray(t.effect.scales(model.rig, t.where, t.variant), float))
    points = [list(other.x)]
    for i, x in enumerate(other.x):
        points += [[*other.x[:i], x + step, *other.x[i + 1 :]] for step in np.diag(scale[i])]
    found = trial([hypothesis(model.rig, one.terms, one.x), *(hypothesis(model.rig, terms, p) for p in points)])
    if found[0] is None or found[1] is None:
        return 0.0, {}
    signals = list(run.channels)
    coarse = math.sqrt(
        run.time.size / max(r.time.size for r in model.measured.runs)
    )  # fewer samples than the run would have
    single = {s: _noise(s, found[0][0][s], noise) for s in signals}
    sigma = {s: coarse * size for s, size in single.items()}

    def stacked(readings: Sequence[dict[str, np.ndarray]]) -> np.ndarray:
        return np.concatenate([bridged(readings[0][s]) / sigma[s] for s in signals])

    def difference(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        out, at = a - b, 0
        for s in signals:
            here = slice(at, at := at + run.time.size)
            if s.endswith("_angle"):
                out[here] = wrapped(out[here] * sigma[s]) / sigma[s]
        return out

    second = stacked(found[1])
    new = difference(stacked(found[0]), second)
    steps = np.concatenate(scale or [np.zeros(0)])
    columns = [
        np.zeros(new.size) if f is None else difference(stacked(f), second) / h
        for f, h in zip(found[2:], steps, strict=True)
    ]
    apart = np.concatenate([other.residual - one.residual, new])
    jacobian = np.concatenate([other.jacobian, -np.column_stack(columns) if columns else np.zeros((new.size, 0))])
    norm = np.linalg.norm(jacobian, axis=0)
    jacobian = jacobian[:, norm > 0] / norm[norm > 0]
    if jacobian.shape[1]:
        apart = apart - jacobian @ np.linalg.solve(
            jacobian.T @ jacobian + 1e-10 * np.eye(jacobian.shape[1]), jacobian.T @ apart
        )
    return float(np.linalg.norm(apart[-new.size :])), single


def _noise(signal: str, values: np.ndarray, noise: dict[tuple[str, str], float]) -> float:
    known = [v for (_, s), v in noise.items() if s == signal]
    if known:
        return min(known)
    for ending, size in TYPICAL.items():
        if signal.endswith(ending) and not signal.startswith("reaction_"):
            return size
    return max(SHARE * float(np.nanmax(np.abs(values))), 1e-9)


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)  # which is a string of TOML too


def as_toml(run: Run) -> str:
    """A run as a [[run]] of measured.toml."""
    lines = ["[[run]]", f"name = {_quoted(run.name)}", f"file = {_quoted(file_name(run.name) + '.csv')}"]
    if run.drive == "speed":
        lines += [f"drive_speed = {run.speed!r}", f"drive_angle = {run.angle!r}"]
    else:
        lines.append(f'drive = "{run.drive}"')
    if run.loads == ():
        lines.append("load = []")  # none, not the mechanism's own
    for load in run.loads or ():
        lines += [
            "[[run.load]]",
            f"body = {_quoted(load.body)}",
            f"point = {_quoted(load.point)}",
            f"force = [{load.force[0]!r}, {load.force[1]!r}]",
        ]
        lines += [f"torque = {load.torque!r}"] if load.torque else []
    return "\n".join(lines)

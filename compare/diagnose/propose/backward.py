"""Released runs read backward: the motion is taken as measured; its acceleration and the load cells are what a model
must say.

Whatever is missing, this residual answers to it nearly linearly, where the motion itself may be changed altogether: a
spring turns a swing into a vibration.  What has no name is told from it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from analytic.beyond_paper.freedom import Freedom
from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.motion import kinematics
from analytic.kinematics.schedule import Turning
from analytic.kinematics.structure import StructureError
from analytic.mechanism.signals import DRIVE_TORQUE
from analytic.paper.kinetostatics import kinetostatics
from compare.diagnose.courses import course, course_errors, encoder_noise
from compare.diagnose.data.quality import noise
from compare.diagnose.data.recording import Channel, Measured, MeasuredRun
from compare.diagnose.predict import Hypothesis, Impossible, Model
from compare.diagnose.residuals import Data

KNOWN_WITHIN = 3.0  # times the median error of a run: beyond, as at its ends, the motion is hardly known


class Backward:
    """Predicts, under hypotheses, the torque (N.m) that the nominal linkage lacks for the motion of each free run, its
    inertia times what the acceleration is off by; and what the load cells read (N) in that motion.
    """

    def __init__(self, model: Model, motions: Mapping[str, Turning]) -> None:
        self.model, self.motions = model, motions
        self.inertia = {
            run.name: Freedom.of(self.assembly(run, [])).inertia(motions[run.name].theta) for run in self.runs
        }

    @property
    def runs(self) -> list[MeasuredRun]:
        """The free runs."""
        return [run for run in self.model.measured.runs if run.drive == "free"]

    def assembly(self, run: MeasuredRun, hypothesis: Hypothesis) -> Assembly:
        """A run's linkage under a hypothesis.  Raises Impossible or AssemblyError."""
        return Assembly(self.model.altered(run, hypothesis).ideal())

    def __call__(self, hypotheses: Sequence[Hypothesis]) -> list[list[dict[str, np.ndarray]] | None]:
        """The readings of every run, (N,) by signal, for each hypothesis; None where it is impossible."""
        return [self._under(hypothesis) for hypothesis in hypotheses]

    def _under(self, hypothesis: Hypothesis) -> list[dict[str, np.ndarray]] | None:
        try:
            each = {loads: self.assembly(run, hypothesis) for loads, run in {r.loads: r for r in self.runs}.items()}
            freedoms = {loads: Freedom.of(assembly) for loads, assembly in each.items()}
        except (Impossible, AssemblyError, StructureError):
            return None
        return [self.readings(run, each[run.loads], freedoms[run.loads], self.motions[run.name]) for run in self.runs]

    def signals(self, run: MeasuredRun, hypothesis: Hypothesis) -> Mapping[str, np.ndarray]:
        """All signals (N,) of a run in its motion, under a hypothesis.  Raises Impossible or AssemblyError."""
        seen = self.motions[run.name]
        return kinetostatics(kinematics(self.assembly(run, hypothesis), seen.theta, seen.omega, seen.alpha)).signals()

    def readings(self, run: MeasuredRun, assembly: Assembly, freedom: Freedom, seen: Turning) -> dict[str, np.ndarray]:
        """The readings (N,) of a run by signal in a motion."""
        off = seen.alpha - freedom.acceleration(seen.theta, seen.omega)
        found = {DRIVE_TORQUE: self.inertia[run.name] * off}
        if cells(run):
            signals = kinetostatics(kinematics(assembly, seen.theta, seen.omega, seen.alpha)).signals()
            found |= {signal: signals[signal] for signal in cells(run)}
        return found

    def errors(self, run: MeasuredRun, sigma: float) -> dict[str, np.ndarray]:
        """How far (N,) each reading of the nominal linkage is off because the motion comes from an encoder of noise
        sigma (rad), root mean square.
        """
        assembly, seen, speed = self.assembly(run, []), self.motions[run.name], self.model.rig.speed
        freedom = Freedom.of(assembly)
        origin, slopes = self.readings(run, assembly, freedom, seen), []
        for order in range(3):
            nudge = 1e-5 * speed**order
            parts = [
                part + (nudge if k == order else 0.0) for k, part in enumerate((seen.theta, seen.omega, seen.alpha))
            ]
            there = self.readings(run, assembly, freedom, Turning(*parts))
            slopes.append({signal: (there[signal] - origin[signal]) / nudge for signal in origin})
        encoder = self.model.rig.encoder
        return {signal: course_errors(run, encoder, [slope[signal] for slope in slopes], sigma) for signal in origin}


def cells(run: MeasuredRun) -> list[str]:
    """The signals of a run's load cells."""
    return [name for name, channel in run.channels.items() if channel.signal.kind == "reaction"]


def read_backward(model: Model) -> tuple[Backward, Data] | None:
    """The free runs of a model read backward, and what is read of them; None where one has no encoder."""
    encoder, free = model.rig.encoder, [run for run in model.measured.runs if run.drive == "free"]
    if not free or any(encoder not in run.channels for run in free):
        return None
    backward = Backward(model, {run.name: course(run, encoder).at(run.time) for run in free})
    nominal = backward([[]])[0]
    if nominal is None:
        return None
    sigma = max(encoder_noise(run, encoder) for run in free)  # one encoder: where it rests, it shows no noise
    known = [
        _as_read(run, model.measured, n, backward.errors(run, sigma)) for run, n in zip(free, nominal, strict=True)
    ]
    noise = {(run.name, signal): channel.noise for run in known for signal, channel in run.channels.items()}
    return backward, Data(replace(model.measured, runs=tuple(known)), noise)


def _as_read(
    run: MeasuredRun, measured: Measured, nominal: Mapping[str, np.ndarray], errors: Mapping[str, np.ndarray]
) -> MeasuredRun:
    """A free run whose readings are that no torque is lacking, and what its load cells say, each as uncertain as the
    motion's ``errors`` (N,) make it and a cell's own scatter; none where the motion is hardly known.
    """
    signal = measured.signals[DRIVE_TORQUE]
    read = {DRIVE_TORQUE: Channel(signal, np.zeros(run.time.size), 0.0, True, signal.unit)}
    read |= {name: run.channels[name] for name in cells(run)}
    unknown = ~np.isfinite(run.channels[measured.mechanism.encoder.name].values)
    found = {}
    for name, channel in read.items():
        typical = float(np.median(errors[name]))
        values = np.where(unknown | (errors[name] > KNOWN_WITHIN * typical), np.nan, channel.values)
        off = (values - nominal[name])[np.isfinite(values)]
        own = noise(run.time[np.isfinite(values)], off) if name != DRIVE_TORQUE and off.size > 1 else 0.0
        found[name] = replace(channel, values=values, noise=max(math.hypot(own, typical), 1e-300))
    return replace(run, channels=found)

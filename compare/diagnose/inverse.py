"""Released runs read backward: the motion is taken as measured; its acceleration and the load cells are what a model
must say.

Whatever is missing, this residual answers to it nearly linearly, where the motion itself may be changed altogether: a
spring turns a swing into a vibration.  What is found begins the fits of the motion.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from analytic.beyond_paper.drive import Turning
from analytic.beyond_paper.freedom import Freedom
from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.motion import kinematics
from analytic.mechanism.signals import DRIVE_TORQUE
from analytic.paper.kinetostatics import kinetostatics
from compare.diagnose.data.quality import noise
from compare.diagnose.data.recording import Channel, Measured, MeasuredRun
from compare.diagnose.fit import Bounds, Fitter
from compare.diagnose.noise import rms
from compare.diagnose.predict import Hypothesis, Impossible, Model, Term
from compare.diagnose.prepare import acceleration_error, course
from compare.diagnose.residuals import Data
from compare.diagnose.search import Search
from compare.diagnose.sensitivities import sensitivities

NEAR = 1.2  # times the least gap of the acceleration: what is as simple and not worse than that begins a fit too
MOST = 6


@dataclass(frozen=True)
class Beginning:
    """Effects with their natural coordinates, and by run the angle (rad) and rate (rad/s) at its first sample."""

    effects: Mapping[Term, np.ndarray]
    starts: Mapping[str, np.ndarray]


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
        return Assembly(self.model.altered(run, hypothesis).with_clearances({}))

    def __call__(self, hypotheses: Sequence[Hypothesis]) -> list[list[dict[str, np.ndarray]] | None]:
        """The readings of every run, (N,) by signal, for each hypothesis; None where it is impossible."""
        return [self._under(hypothesis) for hypothesis in hypotheses]

    def _under(self, hypothesis: Hypothesis) -> list[dict[str, np.ndarray]] | None:
        found = []
        try:
            each = {loads: self.assembly(run, hypothesis) for loads, run in {r.loads: r for r in self.runs}.items()}
            freedoms = {loads: Freedom.of(assembly) for loads, assembly in each.items()}
        except (Impossible, AssemblyError):
            return None
        for run in self.runs:
            seen = self.motions[run.name]
            off = seen.alpha - freedoms[run.loads].acceleration(seen.theta, seen.omega)
            readings = {DRIVE_TORQUE: self.inertia[run.name] * off}
            if cells(run):
                moved = kinematics(each[run.loads], seen.theta, seen.omega, seen.alpha)
                signals = kinetostatics(moved).signals()
                readings |= {signal: signals[signal] for signal in cells(run)}
            found.append(readings)
        return found


def cells(run: MeasuredRun) -> list[str]:
    """The signals of a run's load cells."""
    return [name for name, channel in run.channels.items() if channel.signal.kind == "reaction"]


def beginnings(model: Model, bounds: Bounds, cost: Mapping[Term, float]) -> list[Beginning]:
    """Where fits of free runs may begin, the likeliest first; none where a free run has no encoder."""
    encoder, free = model.rig.encoder, [run for run in model.measured.runs if run.drive == "free"]
    if any(encoder not in run.channels for run in free):
        return []
    motions = {run.name: course(run, encoder).at(run.time) for run in free}
    backward = Backward(model, motions)
    nominal = backward([[]])[0]
    if nominal is None:
        return []
    known = [
        _balanced(run, model.measured, n, float(rms(backward.inertia[run.name])) * acceleration_error(run, encoder))
        for run, n in zip(free, nominal, strict=True)
    ]
    data = Data(
        replace(model.measured, runs=tuple(known)),
        {(run.name, signal): channel.noise for run in known for signal, channel in run.channels.items()},
        encoder,
    )
    fitter = Fitter(backward, data, model.rig, bounds)
    base = fitter.at((), {})
    if base is None:
        return []
    terms = [term for term in cost if not term.effect.sensor]
    search = Search(fitter, base, sensitivities(fitter, base, terms), {t: cost[t] for t in terms})
    starts = {run: np.array([motion.theta[0], motion.omega[0]]) for run, motion in motions.items()}
    best = search.best()
    near = [fit for fit in fitter.done() if fit.terms and rms(fit.residual) < NEAR * rms(best.residual)]
    leaders = [fit for fit in search.leaders(best) if fit.terms]
    simple = [fit for fit in sorted(near, key=lambda fit: (search.price(fit), fit.chi2)) if fit not in leaders]
    return [Beginning(dict(zip(fit.terms, fit.x, strict=True)), starts) for fit in (*leaders, *simple[:MOST])]


def _balanced(run: MeasuredRun, measured: Measured, nominal: Mapping[str, np.ndarray], sigma: float) -> MeasuredRun:
    """A free run whose readings are that no torque is lacking, to ``sigma`` (N.m), and its load cells', as noisy as
    they scatter about the nominal ones.
    """
    signal = measured.signals[DRIVE_TORQUE]
    found = {DRIVE_TORQUE: Channel(signal, np.zeros(run.time.size), sigma, True, signal.unit)}
    for name in cells(run):
        channel = run.channels[name]
        off = channel.values - nominal[name]
        found[name] = replace(channel, noise=noise(run.time[np.isfinite(off)], off[np.isfinite(off)]))
    return replace(run, channels=found)

"""What a proposal is sought in: the data, what a model says of them beside what is named, and what the linkage does."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.integrate import cumulative_trapezoid

from analytic.kinematics.assembly import AssemblyError
from analytic.kinematics.structure import StructureError
from analytic.mechanism import GROUND, Body
from analytic.mechanism.signals import wrapped
from compare.diagnose.data.recording import MeasuredRun
from compare.diagnose.effects.effect import Rig
from compare.diagnose.fit import Fit, Fitter, Predicts
from compare.diagnose.predict import Hypothesis, Impossible, Model, Term
from compare.diagnose.propose.backward import read_backward
from compare.diagnose.propose.laws import State
from compare.diagnose.propose.places import EFFECTS, FAINT, Place
from compare.diagnose.residuals import Data

Signals = Mapping[str, np.ndarray]


@dataclass(frozen=True)
class Scene:
    """The data and a fit to them; ``model`` predicts what their sensors read, ``signals`` are all of every run.

    ``residual`` (size,) is measured less predicted over the noise, ``whole`` the same with what samples share taken
    off; ``free`` (size, f) is how that answers to what is named.
    """

    rig: Rig
    model: Predicts
    data: Data
    hypothesis: Hypothesis
    signals: Mapping[str, Signals]
    moved: Callable[[MeasuredRun, Hypothesis], Signals]  # the same under any hypothesis
    residual: np.ndarray = field(repr=False)
    whole: np.ndarray = field(repr=False)
    free: np.ndarray = field(repr=False)

    @classmethod
    def of(cls, model: Model, fitter: Fitter, fit: Fit) -> Scene | None:
        """The scene of driven runs beside a fit, or of released ones read backward; None where there is none, or some
        runs are driven and others not.
        """
        runs = fitter.data.measured.runs
        released = [run.drive == "free" for run in runs]
        try:
            if not any(released):
                return cls._seen(
                    fitter.rig, model, fitter.data, fit, lambda run, wrong: model.signals(run, wrong, run.time)
                )
            found = read_backward(model) if all(released) else None
            if found is None:
                return None
            backward, data = found
            named = {fit.terms[i]: fit.x[i] for i in fit.named() if not fit.terms[i].effect.sensor}
            there = Fitter(backward, data, fitter.rig, fitter.bounds).at(list(named), named)
            if there is None:
                return None
            return cls._seen(fitter.rig, backward, data, there, backward.signals)
        except (Impossible, AssemblyError, StructureError):
            return None

    @classmethod
    def _seen(
        cls,
        rig: Rig,
        model: Predicts,
        data: Data,
        fit: Fit,
        moved: Callable[[MeasuredRun, Hypothesis], Signals],
    ) -> Scene | None:
        hypothesis = fit.values(rig)
        signals = {run.name: moved(run, hypothesis) for run in data.measured.runs}
        readings = model([hypothesis])[0]
        if readings is None:
            return None
        off = data.values - _plain(data, readings) * data.sigma
        off[data.turning] = wrapped(off[data.turning])
        return cls(
            rig, model, data, hypothesis, signals, moved, off / data.sigma, data.residual(readings), fit.jacobian
        )

    def spread(self, of: Callable[[Signals], np.ndarray]) -> np.ndarray:
        """Something of every run's signals (N,) at all samples (size,)."""
        by_run = [of(self.signals[run.name]) for run in self.data.measured.runs]
        return np.concatenate([by_run[p.run][p.used] for p in self.data.parts])

    def places(self) -> Iterator[Place]:
        """Every place where these data would show an unknown, beside what is named."""
        rig, data = self.rig, self.data

        def read(more: Hypothesis) -> np.ndarray | None:
            found = self.model([[*self.hypothesis, *more]])[0]
            return None if found is None else _plain(data, found)

        here, taken = read([]), {term.key for term, _ in self.hypothesis}
        for unknown, effect in EFFECTS.items() if here is not None else ():
            for where in effect.places(rig):
                step = float(effect.scales(rig, where)[0])
                there = read([(Term(effect, where), {effect.parameters[0].name: step})])
                if (effect.name, where) in taken or there is None or here is None:
                    continue
                answers = (there - here) / step
                if np.abs(answers).max() * step > FAINT:
                    yield Place(unknown, where, effect.unit(rig, where, effect.parameters[0].name), answers)
        for signal in dict.fromkeys(part.signal for part in data.parts if part.signal in rig.signals):
            answers = np.zeros(data.size)
            for part in data.parts:
                if part.signal == signal:
                    answers[part.place] = 1 / data.sigma[part.place]
            yield Place("error", signal, rig.known[signal].unit, answers)

    def state(self, place: Place) -> State:
        """What is known at every sample, at a place."""
        m, runs = self.rig.mechanism, self.data.measured.runs
        time = np.concatenate([runs[p.run].time[p.used] for p in self.data.parts])
        found = State(self.spread(lambda s: s[f"{m.driven}_angle"]), time, self.spread(lambda s: s["drive_torque"]))
        if place.unknown == "error":
            return replace(found, reading=self.spread(lambda s: s[place.where]))
        if place.unknown == "lag":
            return replace(found, carried=self._carried())
        if place.unknown == "length":
            return replace(found, pull=self._pull(m.moving.get(place.where)))
        if place.unknown not in ("torque", "give"):
            return found
        joint = m.joint(place.where)
        x, y = (f"reaction_{joint.name}_{axis}" for axis in "xy")
        found = replace(found, force=self.spread(lambda s: np.hypot(s[x], s[y])))
        if joint.prismatic:
            return found
        first, second = joint.bodies

        def across(part: str) -> np.ndarray:
            return self.spread(lambda s: s[f"{second}_{part}"] - (0.0 if first == GROUND else s[f"{first}_{part}"]))

        return replace(found, angle=across("angle"), rate=across("angular_velocity"))

    def _carried(self) -> np.ndarray:
        """The size of the drive torque, summed over each run in the sense of the crank's turning, N.m.s (size,)."""
        data, driven = self.data, self.rig.mechanism.driven
        by_run = []
        for run in data.measured.runs:
            signals = self.signals[run.name]
            sense = np.sign(np.mean(signals[f"{driven}_angular_velocity"]))
            by_run.append(sense * cumulative_trapezoid(np.abs(signals["drive_torque"]), run.time, initial=0.0))
        return np.concatenate([by_run[p.run][p.used] for p in data.parts])

    def _pull(self, body: Body | None) -> np.ndarray | None:
        """The pull in a link of two pins: the mean of the forces at its ends, along it and apart, N (size,); None of
        another.
        """
        m = self.rig.mechanism
        if body is None or len(body.points) != 2 or any(m.joint(j).prismatic for j in body.points):
            return None
        (first, start), (last, end) = ((j, complex(*at)) for j, at in body.points.items())
        axis = (end - start) / abs(end - start)

        def along(signals: Signals) -> np.ndarray:
            apart = np.zeros(len(signals["drive_torque"]))
            for joint, sense in ((first, -0.5), (last, 0.5)):
                force = signals[f"reaction_{joint}_x"] + 1j * signals[f"reaction_{joint}_y"]
                on = 1.0 if m.joint(joint).bodies[1] == body.name else -1.0
                apart += sense * on * (force * np.conj(axis * np.exp(1j * signals[f"{body.name}_angle"]))).real
            return apart

        return self.spread(along)


def _plain(data: Data, readings: Sequence[Mapping[str, np.ndarray]]) -> np.ndarray:
    """Readings as one vector (size,) over their noise."""
    return np.concatenate([readings[p.run][p.signal][p.used] for p in data.parts]) / data.sigma

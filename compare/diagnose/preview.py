"""Measured data before any diagnosis: what there is, the nominal model behind it, and what these runs could tell.

How an effect would show is taken from the analytic model, as the search does (:mod:`compare.diagnose.sensitivities`);
no engine runs.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from analytic.beyond_paper.drive import Motor
from analytic.mechanism import MechanismWarning
from compare.diagnose import prepare
from compare.diagnose import slips as of_data
from compare.diagnose.data.measured import data_of
from compare.diagnose.data.quality import gaps
from compare.diagnose.data.recording import Fault as SensorFault
from compare.diagnose.data.recording import Measured, MeasuredRun
from compare.diagnose.data.thin import picked
from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.diagnose.fit import Fit, Fitter
from compare.diagnose.noise import rms
from compare.diagnose.predict import Model, Motors, Term
from compare.diagnose.problem import begun
from compare.diagnose.residuals import Data
from compare.diagnose.sensitivities import Sensitivity, candidates, sensitivities
from compare.progress import progress_bar
from compare.results.diagnosis import EffectPlace, RecordingFault
from compare.results.preview import Preview, RunPreview, SensorPreview, Visible

SHOWN_SIGMAS = 4.0  # of all samples together, by which an effect shows
ALIKE = 0.1  # of an effect's signature, no more of which is left beside another's that looks the same
ROUNDS = 4  # of the search for the size from which an effect shows
NEARLY = 1.5  # times SHOWN_SIGMAS, by which it may show at that size
OPPOSITE = 0.7  # correlation with minus the prediction from which a load cell seems upside down
SAMPLES = 8_000  # of all sensors together, by which it is told what shows


@progress_bar(what="preview")
def preview(measured: Measured | str | Path) -> Preview:
    """What measured data are: each sensor beside the nominal model, its noise, gaps, what of the crank's turn there is,
    and which effects these runs would show, and which they could not tell apart.

    ``measured`` is a recording, or the path of a measured.toml (or of its folder).  Raises MeasuredError.
    """
    data = data_of(measured)
    with warnings.catch_warnings():  # of mechanisms that are only tried
        warnings.simplefilter("ignore", MechanismWarning)
        return _shown(data)


def _shown(data: Measured) -> Preview:
    """The data beside the nominal model."""
    data = prepare.on_one_turn(data)
    mechanism = data.mechanism.rigid()
    data = prepare.thinned(data)
    found = of_data.driven(data, mechanism)
    courses, data = prepare.followed(data)
    rig, model = prepare.nominal(data, mechanism, courses)
    data, rig, model = prepare.sorted_out(data, rig, model)
    prepare.check_prior(data, candidates(rig, VOCABULARY))
    noise = {(run.name, s): c.noise for run in data.runs for s, c in run.channels.items()}
    fitter = Fitter(model, Data(data, noise), rig, prepare.bounds(rig, data.tolerance))
    base = begun(model, fitter)
    nominal = model([base.values(rig)])[0]
    assert nominal is not None  # the fit has been there
    found = [*found, *of_data.free(data.runs, nominal)]
    slips: list[RecordingFault | SensorFault] = [
        replace(slip, text=f"{slip.text}; a diagnosis refuses it") for slip in of_data.as_faults(found, data.runs)
    ]
    known = {(slip.run.name, slip.signal) for slip in found}
    turned = [each for run, said in zip(data.runs, nominal, strict=True) for each in _upside_down(run, said)]
    slips += [each for each in turned if (each.run, each.signal) not in known]
    shown, hidden = _visible(data, model, courses, base)
    return Preview(
        case=mechanism.name,
        mechanism=data.mechanism,
        runs=tuple(_run(run, model, base, said) for run, said in zip(data.runs, nominal, strict=True)),
        faults=tuple(
            RecordingFault(run=f.run, signal=f.signal, kind=f.kind, samples=f.samples, text=f.text)
            for f in (*slips, *data.faults)
        ),
        visible=shown,
        invisible=hidden,
    )


def _upside_down(run: MeasuredRun, nominal: Mapping[str, np.ndarray]) -> Iterator[RecordingFault]:
    """Load cells that read the nominal model's force with the other sign, but for what a fault may make of it."""
    for name, channel in run.channels.items():
        here = np.isfinite(channel.values) & np.isfinite(nominal[name])
        force, read = nominal[name][here], channel.values[here]
        if channel.signal.kind != "reaction" or channel.signal.wraps or np.ptp(force) == 0 or np.ptp(read) == 0:
            continue
        slope = float(np.polyfit(force, read, 1)[0])
        if np.corrcoef(force, read)[0, 1] < -OPPOSITE and abs(slope + 1) < 1 - OPPOSITE:
            text = (
                f"{name} of run {run.name!r} is about {slope:.2g} times its prediction: is the load cell mounted upside"
                " down, or does it read the force on the other body? Then say sign = -1 for it among the columns"
            )
            yield RecordingFault(run=run.name, signal=name, kind="sign", samples=int(np.sum(here)), text=text)


def _run(run: MeasuredRun, model: Model, base: Fit, nominal: Mapping[str, np.ndarray]) -> RunPreview:
    """One run beside the nominal model."""
    if run.drive == "free":
        moved = model.released(run, [base.values(model.rig)])[0]
        assert moved is not None
        crank = moved[model.rig.encoder]
    else:
        crank = np.atleast_2d(model.motor(run, model.mechanism).at(run.time).theta)[0]
    signals = {}
    for name, channel in run.channels.items():
        apart = channel.signal.apart(channel.values, nominal[name]) / channel.noise
        here = np.isfinite(apart)
        followed = run.drive == "measured" and name in model.rig.encoders
        signals[name] = SensorPreview(
            unit=channel.signal.unit,
            noise=channel.noise,
            noise_given=channel.noise_given,
            samples=int(np.sum(here)),
            gap=rms(apart[here]) if here.any() and not followed else None,
            measured=channel.values,
            nominal=nominal[name],
        )
    return RunPreview(
        name=run.name,
        file=run.file,
        drive=run.input,
        role=run.role,
        samples=run.time.size,
        step=float(np.median(np.diff(run.time))),
        longest_gap=gaps(run.time)[2],
        crank_from=float(crank.min()),
        crank_to=float(crank.max()),
        time=run.time,
        crank_angle=crank,
        signals=signals,
    )


# ---------------------------------------------------------------- what would show


def _visible(
    measured: Measured, model: Model, courses: Mapping[str, Motor | Motors], base: Fit
) -> tuple[tuple[Visible, ...], tuple[EffectPlace, ...]]:
    """Effects that these runs would show, the clearest first, and those that they would not."""
    total = sum(run.time.size * len(run.channels) for run in measured.runs)
    every = max(1, math.ceil(total / SAMPLES))
    few = replace(measured, runs=tuple(picked(run, every) for run in measured.runs))
    rig = model.rig
    noise = {(run.name, s): c.noise / math.sqrt(every) for run in few.runs for s, c in run.channels.items()}
    fitter = Fitter(
        Model(few, rig, model.mechanism, courses),
        Data(few, noise),
        rig,
        prepare.bounds(rig, few.tolerance),
    )
    start = fitter.again(base)
    terms = prepare.allowed(candidates(rig, VOCABULARY), few.tolerance, fitter.bounds)
    found = sensitivities(fitter, start, terms) if start is not None else {}
    clearest: dict[tuple[str, str], Sensitivity] = {}
    for term, one in found.items():
        if term.key not in clearest or _size(one) > _size(clearest[term.key]):
            clearest[term.key] = one
    ordered = sorted(clearest.values(), key=_size, reverse=True)
    bases = [np.linalg.qr(one.columns)[0] for one in ordered]
    shown = tuple(
        _told(fitter, start, one, _like(one, ordered, bases)) for one in ordered if start is not None and _size(one) > 0
    )
    hidden = [key for key in dict.fromkeys(t.key for t in terms) if key not in clearest]
    return shown, tuple(EffectPlace(name=name, where=where) for name, where in hidden)


def _size(one: Sensitivity) -> float:
    """How clearly an effect of its own scale shows, in sigmas of all samples together."""
    return float(np.linalg.norm(one.columns[:, 0]))


def _like(one: Sensitivity, others: Sequence[Sensitivity], bases: Sequence[np.ndarray]) -> list[Term]:
    """Effects beside which hardly anything of this one's signature is left."""
    column = one.columns[:, 0] / _size(one)
    return [
        other.term
        for other, basis in zip(others, bases, strict=True)
        if other is not one and float(np.linalg.norm(column - basis @ (basis.T @ column))) < ALIKE
    ]


def _told(fitter: Fitter, start: Fit, one: Sensitivity, like: Sequence[Term]) -> Visible:
    t, rig = one.term, fitter.rig
    parameter, probe = t.effect.parameters[0], np.asarray(t.effect.probes(rig, t.where, t.variant)[0], float)
    times = _shows(fitter, start, t, probe, SHOWN_SIGMAS / _size(one))
    sizes = [
        abs(t.effect.values(rig, t.where, more * times * probe, t.variant)[parameter.name]) if times else math.nan
        for more in (1.0, 2.0)
    ]
    return Visible(
        name=t.effect.name,
        where=t.where,
        parameter=parameter.name,
        unit=t.effect.unit(rig, t.where, parameter.name),
        size=sizes[0],
        at_most=sizes[1] < sizes[0],
        like=tuple(EffectPlace(name=other.effect.name, where=other.where) for other in like),
    )


def _shows(fitter: Fitter, start: Fit, term: Term, probe: np.ndarray, times: float) -> float | None:
    """How many times a probe of an effect shows by SHOWN_SIGMAS, from a first guess; None if there is no such size."""
    for _ in range(ROUNDS):
        residual = fitter.residuals([*start.terms, term], [[*start.x, times * probe]])[0]
        seen = 0.0 if residual is None else float(np.linalg.norm(residual - start.residual))
        if not seen:
            return None
        if 1 / NEARLY < seen / SHOWN_SIGMAS < NEARLY:
            return times
        times *= SHOWN_SIGMAS / seen
    return None

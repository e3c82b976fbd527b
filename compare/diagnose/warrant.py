"""How far the explained model of a diagnosis can be trusted: its validation runs with bands and metrics, and whether it
is enough for what it is wanted for.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from analytic.mechanism import Mechanism
from compare.diagnose.ahead import runs_ahead
from compare.diagnose.data.recording import Measured, MeasuredError, Wanted
from compare.diagnose.effects.effect import Effect
from compare.diagnose.foretold import Explained, foretold
from compare.diagnose.planned import planned
from compare.diagnose.validation import Validation
from compare.judge.metrics import metrics
from compare.report.words.prediction import judgement
from compare.results.band import Band, Context, is_far
from compare.results.diagnosis import DiagnosedRun, Diagnosis


def warranted(
    result: Diagnosis, mechanism: Mechanism, vocabulary: Mapping[str, Effect], others: Measured, validation: Validation
) -> Diagnosis:
    """A diagnosis with what its model foretells of the runs that were not fitted, and what that is worth; not of a rig
    that rattles, of which averages alone are known.
    """
    if any(effect.evidence for effect in result.effects):
        return result
    explained = Explained(result, mechanism, vocabulary)
    update: dict[str, object] = {}
    if others.runs:
        try:
            ahead = {one.run.name: one for one in runs_ahead(others, mechanism)}
        except MeasuredError:  # the nominal mechanism does not make one: what it is off by says so
            ahead = {}
        runs = []
        for run in result.runs:
            said = next((v.after.readings for v in validation.runs if v.run.name == run.name), None)
            bands = foretold(explained, ahead[run.name], True, said or ()) if run.name in ahead else None
            runs.append(_warranted(result, explained, run, bands, others.context))
        update["runs"] = tuple(runs)
    if others.context is not None:
        update["context"] = judged_by(explained, others.context)
    return result.model_copy(update=update)


def _warranted(
    result: Diagnosis, explained: Explained, run: DiagnosedRun, bands: Mapping[str, Band] | None, wanted: Wanted | None
) -> DiagnosedRun:
    if run.role == "fit" or bands is None:
        return run
    calibration = {} if wanted is None else wanted.calibration
    signals = {}
    for name, record in run.signals.items():
        found = None
        if name in bands:
            said, error = bands[name].sd, -result.residual(run, name, "after")
            # u_num is the engine's difference from the analytic model, which has no steps
            found = metrics(
                record.unit,
                error,
                record.measured,
                record.noise,
                calibration=calibration.get(name, 0.0),
                u_num=said["engines"],
                u_input=math.hypot(said["parameters"], said["sets"]),
            )
        signals[name] = record.model_copy(update={"metrics": found})
    return run.model_copy(update={"signals": signals, "prediction": dict(bands)})


def judged_by(explained: Explained, wanted: Wanted) -> Context:
    """Whether the band of what is wanted is narrow enough, at the speed that is asked for."""
    r, signal = explained.result, wanted.signal
    half: float | None = None
    if r.mechanism.cranked and explained.speeds:
        speed = wanted.speed if wanted.speed is not None else max(explained.speeds)
        ahead = planned(r, explained.mechanism, speed, (signal.name,))
        bands = foretold(explained, ahead, False) if ahead is not None else None
        half = None if bands is None else half_width(bands[signal.name])
    context = Context(
        question=wanted.question,
        quantity=signal.name,
        unit=signal.unit,
        required=wanted.required,
        consequence=wanted.consequence,
        speed=wanted.speed,
        half_width=None,
        enough=None,
        says="-",
    )
    return judged(context, half, explained.speeds)


def judged(context: Context, half: float | None, speeds: Sequence[float]) -> Context:
    """What is wanted, judged by the half width of its band (SI; None: there is none)."""
    beyond = context.speed is not None and is_far(context.speed, speeds)
    enough = None if half is None or beyond else half <= context.required
    found = context.model_copy(update={"half_width": half, "enough": enough})
    return found.model_copy(update={"says": judgement(found, speeds)})


def half_width(band: Band) -> float:
    """The largest distance of a band's ends from its middle."""
    return float(np.nanmax(np.maximum(band.high - band.value, band.value - band.low)))

"""``predict``: the explained model of a diagnosis where nothing was measured, with a 95 % band."""

from __future__ import annotations

from dataclasses import replace

from analytic.mechanism import Load
from analytic.mechanism.signals import named
from compare.arguments import modelling, one_engine, path
from compare.diagnose.ahead import Ahead, Readings, runs_ahead
from compare.diagnose.data.measured import load_measured
from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.diagnose.engines import Engines
from compare.diagnose.foretold import Explained, foretold
from compare.diagnose.planned import planned
from compare.diagnose.warrant import half_width, judged
from compare.faults import ArgumentError
from compare.questions.predict import PredictQuestion
from compare.questions.question import answers
from compare.report.words.prediction import notes
from compare.results.diagnosis import Diagnosis
from compare.results.kinds import read_as
from compare.results.prediction import PredictedRun, Prediction
from compare.versions import installed, versions
from sim_models.engine import SimulationError

NONE = "none"  # no engine beside the analytic model


@answers(PredictQuestion)
def predict(question: PredictQuestion) -> Prediction:
    """Foretell runs that were not measured by what a diagnosis has explained: the linkage with the effects that it
    named, at a speed and with loads, or the runs of a measured.toml.

    A band of 95 % holds what the values found leave open (their joint covariance, to first order), the sets of effects
    that compete, weighted by their probability, what the engine and the analytic model differ by, and what stays
    unexplained, which grows away from the data, and in a free run with time.  It is of the linkage, without the noise
    of sensors; of a measured.toml it is of its sensors, with the faults that the diagnosis found in them.

    Raises ArgumentError, DocumentError, MeasuredError, Unsupported, SimulatorMissing, or SimulationError.
    """
    given = question.diagnosis
    result = given if isinstance(given, Diagnosis) else read_as(path(given, "diagnosis"), [Diagnosis])
    explained = _model(result)
    name = result.simulator.name if question.simulator is None else question.simulator
    simulator = None if name == NONE else modelling(one_engine(name))
    sensors = question.run is not None  # what they read is compared with what is recorded
    runs, told, context = [], list[str](), None
    for ahead in _of_file(question, result) if sensors else [_at_speed(question, explained)]:
        bands = foretold(explained, ahead, sensors, _simulated(explained, ahead, simulator, sensors))
        if bands is None:
            raise ArgumentError(
                "diagnosis", f"its explained mechanism cannot make run {ahead.run.name!r}; give another"
            )
        unmeasured = [s for s in bands if s not in explained.left]
        told += notes(bands, ahead.speed, explained.paces, unmeasured, explained.left_aside)
        runs.append(
            PredictedRun(
                name=ahead.run.name,
                speed=ahead.run.speed,
                time=ahead.run.time,
                crank_angle=ahead.position,
                signals=bands,
            )
        )
        if result.context is not None and result.context.quantity in bands:
            there = result.context.model_copy(update={"speed": ahead.speed})
            context = judged(there, half_width(bands[result.context.quantity]), explained.speeds)
    return Prediction(
        case=result.case,
        versions=versions({} if simulator is None else installed(simulator)),
        diagnosis=result.verdict,
        effects=tuple(e.key for e in result.effects),
        speeds=tuple(explained.speeds),
        runs=tuple(runs),
        context=context,
        explained=result.explained,
        notes=tuple(dict.fromkeys(told)),
    )


def _model(result: Diagnosis) -> Explained:
    """The model of a diagnosis.  Raises ArgumentError for one that nothing can be foretold from."""
    if any(effect.evidence for effect in result.effects):
        raise ArgumentError("diagnosis", "its rig rattles, so that averages alone are known of it; no run is foretold")
    unknown = [e.name for e in result.effects if e.name not in VOCABULARY]
    if unknown:
        raise ArgumentError(
            "diagnosis", f"it has the effect {unknown[0]}, which the vocabulary has not; diagnose without it"
        )
    return Explained(result, result.mechanism.rigid().replace(initial={}), VOCABULARY)


def _of_file(question: PredictQuestion, result: Diagnosis) -> list[Ahead]:
    """The runs of a measured.toml.  Raises ArgumentError, MeasuredError."""
    for field in ("speed", "load", "signals"):
        if getattr(question, field) is not None:
            raise ArgumentError(field, "it has no part in the runs of a file, which say it themselves; leave it out")
    measured = load_measured(path(question.run, "run"))
    return runs_ahead(replace(measured, mechanism=result.mechanism), result.mechanism.rigid().replace(initial={}))


def _at_speed(question: PredictQuestion, explained: Explained) -> Ahead:
    """The run at a speed.  Raises ArgumentError, MeasuredError."""
    result, m = explained.result, explained.mechanism
    if not m.cranked or not explained.speeds:
        raise ArgumentError("speed", f"no crank alone drove {m.name} in the data; give a RUN.TOML in its place")
    for body in question.load or {}:
        if body not in m.moving:
            raise ArgumentError("load", f"{body} is no moving body; they are {', '.join(m.moving)}")
    loads = None if question.load is None else tuple(Load(body=b, force=f) for b, f in question.load.items())
    known = named(m.bodies, m.joints, m.drives)
    asked = list(question.signals or explained.left)
    if result.context is not None and not question.signals:
        asked.append(result.context.quantity)
    for s in asked:
        if s not in known:
            raise ArgumentError("signals", f"{s} is no signal of {m.name}; they are {', '.join(known)}")
    speed = float(question.speed) if question.speed is not None else max(explained.speeds)
    ahead = planned(result, m, speed, tuple(dict.fromkeys(asked)), loads)
    assert ahead is not None
    return ahead


def _simulated(explained: Explained, ahead: Ahead, simulator: str | None, sensors: bool) -> list[Readings]:
    """What an engine makes of a run with the named effects.  Raises SimulationError where it cannot."""
    if simulator is None:
        return []
    hypothesis = [*ahead.start, *explained.candidates(ahead.run.name, sensors)[0].values]
    said = Engines(ahead.model, simulator, 1).simulate(hypothesis, (simulator,))[simulator]
    if said.readings is None:
        raise SimulationError(f"{simulator} cannot make run {ahead.run.name!r}: {said.skipped}")
    return list(said.readings)

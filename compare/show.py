"""One number of a cross-check with what it comes from, or what a diagnosis leaves of a signal."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import overload

import numpy as np

from analytic.mechanism import Mechanism
from analytic.mechanism.signals import Signal, wrapped
from compare.arguments import number, warn_of_degrees
from compare.faults import ArgumentError, unusable
from compare.quantities import quantities
from compare.questions.question import answers
from compare.questions.show import ShowQuestion
from compare.report.words import provenance as words
from compare.report.words.effects import quantity
from compare.results.crosscheck import CrossCheck, Discrepancy, Run
from compare.results.diagnosis import DiagnosedRun, Diagnosis, Side
from compare.results.document import Number
from compare.results.kinds import read_as
from compare.results.provenance import Analytic, Equation, Provenance, Sample, Simulated
from compare.results.residuals import Residual, Residuals, SignalResiduals
from sim_models.engine import ENGINES, SCHEMES, offers, scheme_of

KINETOSTATICS = "analytic/paper/kinetostatics.py"
CLEARANCE = "analytic/paper/clearance.py"
COMPLIANCE = "analytic/paper/compliance.py"
MOTION = "analytic/kinematics/motion.py"
RELEASED = "analytic/beyond_paper/released.py"


@overload
def show(
    result: CrossCheck, signal: str, *, at: float, joint_model: str | None = None, simulator: str | None = None
) -> Provenance: ...
@overload
def show(result: Diagnosis, signal: str) -> SignalResiduals: ...
@overload
def show(
    result: CrossCheck | Diagnosis | str | Path,
    signal: str | None = None,
    *,
    at: float | None = None,
    joint_model: str | None = None,
    simulator: str | None = None,
) -> Provenance | SignalResiduals | Diagnosis: ...
@answers(ShowQuestion)
def show(question: ShowQuestion) -> Provenance | SignalResiduals | Diagnosis:
    """One number of a cross-check: both sides, equation and module, engine and settings, verdict; or the residuals of
    a diagnosis.

    ``result`` is a cross-check, a diagnosis, or the path of the JSON file of either.  A cross-check takes a ``signal``
    and ``at``, the crank angle (rad; the time in s where the linkage swings freely or has several drives); the sample
    nearest to it is shown, in every run that has the signal, or in those of one joint model or engine.  Of a diagnosis
    a ``signal`` gives measured minus simulated by run; without one the diagnosis itself is returned.

    Raises DocumentError for the file and ArgumentError for what the result does not have.
    """
    result, signal, at = question.result, question.signal, question.at
    joint_model, simulator = question.joint_model, question.simulator
    document = read(result) if isinstance(result, str | Path) else result
    if isinstance(document, CrossCheck):
        if signal is None:
            raise ArgumentError("signal", "missing; a number of a result takes one, such as reaction_B_angle")
        if at is None:
            raise ArgumentError("at", "missing; a number belongs to a crank angle, or to a time if the linkage swings")
        place = number(at, "at", "s" if document.over_time else "rad")
        if not document.over_time:
            warn_of_degrees("at", place)
        return provenance(document, signal, place, joint_model, simulator)
    if not isinstance(document, Diagnosis):
        accepted = "a cross-check, a diagnosis, or the path of a JSON file of either"
        drawn = "; lc.analyse(...).write(folder) draws a mechanism" if isinstance(document, Mechanism) else ""
        raise unusable("result", document, accepted + drawn)
    for name, given in (("at", at), ("joint_model", joint_model), ("simulator", simulator)):
        if given is not None:
            raise ArgumentError(name, "a diagnosis takes a signal alone; leave this out")
    return document if signal is None else residuals(document, signal)


def read(path: str | Path) -> CrossCheck | Diagnosis:
    """The cross-check or the diagnosis of a JSON file.  Raises DocumentError."""
    kinds: tuple[type[CrossCheck | Diagnosis], ...] = (CrossCheck, Diagnosis)
    return read_as(path, kinds)


# ------------------------------------------------------------------ a number of a cross-check


def provenance(
    result: CrossCheck, name: str, at: float, joint_model: str | None = None, simulator: str | None = None
) -> Provenance:
    """A signal at a crank angle (rad; s over time) in every run that has it.  Raises ArgumentError."""
    runs = _chosen(result.runs, joint_model, simulator)
    having = [run for run in runs if name in run.analytic and name in run.simulated]
    if not having:
        names = dict.fromkeys(name for run in runs for name in run.simulated if name in run.analytic)
        raise ArgumentError("signal", f"no {name} in {_titles(runs)}; the signals are {', '.join(names)}")
    signal = result.signals.get(name)
    if signal is None:
        raise ArgumentError(
            "signal", f"{name} is not a signal of the mechanism {result.mechanism.name} that the result is about"
        )
    if not math.isfinite(at):
        raise _outside(having[0], at, result.over_time)
    return Provenance(
        case=result.case,
        command=result.command,
        versions=dict(result.versions),
        signal=name,
        label=quantities(result.mechanism)[name].label,
        acts=words.acts(result.mechanism, signal),
        unit=signal.unit,
        over_time=result.over_time,
        at=at,
        runs=tuple(_sample(run, signal, at, result.over_time) for run in having),
    )


def _chosen(runs: Sequence[Run], joint_model: str | None, simulator: str | None) -> list[Run]:
    for argument, wanted, names in (
        ("joint_model", joint_model, [run.joint_model for run in runs]),
        ("simulator", simulator, [run.simulator.name for run in runs]),
    ):
        if wanted is not None and wanted not in names:
            there = ", ".join(dict.fromkeys(names)) or "no runs"
            raise ArgumentError(argument, f"{wanted} is not in this result; it has {there}")
    chosen = [run for run in runs if joint_model in (None, run.joint_model) and simulator in (None, run.simulator.name)]
    if not chosen:
        raise ArgumentError("simulator", f"not with joint {joint_model} in this result; it has {_titles(runs)}")
    return chosen


def _titles(runs: Iterable[Run]) -> str:
    return "; ".join(run.title for run in runs) or "no runs"


def _places(run: Run, over_time: bool) -> np.ndarray:
    """Where the samples (N,) are: rad, or s over time."""
    if not over_time:
        return run.crank_angle
    return np.array([]) if run.time is None else run.time


def _nearest(run: Run, at: float, over_time: bool) -> tuple[int, float]:
    """Index of the sample nearest to ``at`` (rad, modulo a turn; s over time), and how far it is.

    Raises ArgumentError where that is farther than half the spacing of the samples.
    """
    places = _places(run, over_time)
    if not places.size:
        raise _outside(run, at, over_time)
    away = np.abs(places - at) if over_time else np.abs(wrapped(places - at))
    k = int(np.argmin(away))
    alone = 1.0 if over_time else math.radians(1.0)  # how wide the surroundings of a single sample are: s, or rad
    spacing = float(np.diff(np.sort(places)).max()) if places.size > 1 else alone
    if away[k] > spacing / 2 * (1 + 1e-9):
        raise _outside(run, at, over_time)
    return k, float(away[k])


def _outside(run: Run, at: float, over_time: bool) -> ArgumentError:
    """The error of a place that the run does not have, as a person reads it (deg or s)."""
    unit, factor = ("s", 1.0) if over_time else ("deg", math.degrees(1.0))
    places = factor * _places(run, over_time)
    span = f"from {places.min():.6g} to {places.max():.6g} {unit}" if places.size else "nowhere"
    return ArgumentError("at", f"the run {run.title} has samples {span}, none near {factor * at:g} {unit}")


def _sample(run: Run, signal: Signal, at: float, over_time: bool) -> Sample:
    k, away = _nearest(run, at, over_time)
    row = next((row for row in run.discrepancies if row.signal == signal.name), None)
    return Sample(
        simulator=run.simulator,
        joint_model=run.joint_model,
        motion=run.motion,
        clearance=dict(run.clearance),
        analytic_model=run.analytic_model,
        index=k,
        count=run.crank_angle.size,
        crank_angle=float(run.crank_angle[k]),
        time=None if run.time is None else float(run.time[k]),
        exact=away < (1e-6 if over_time else math.radians(1e-6)),
        flag=run.flags.get(str(k), ""),
        analytic=Analytic(
            value=_number(run.analytic[signal.name][k]),
            components=_components(run.analytic, signal, k),
            equations=tuple(_equations(run, signal, over_time)),
        ),
        simulated=Simulated(
            value=_number(run.simulated[signal.name][k]),
            components=_components(run.simulated, signal, k),
            module=_engine_module(run),
            settings=dict(run.settings),
        ),
        difference=_number(run.difference(signal)[k]),
        discrepancy=row,
        worst_time=_time_of(run, row) if over_time else None,
    )


def _number(value: float) -> Number:
    return float(value) if math.isfinite(value) else None


def _components(side: Mapping[str, np.ndarray], signal: Signal, k: int) -> dict[str, Number]:
    """The components of which the direction or the size of a reaction was made."""
    if signal.kind != "reaction" or signal.component not in ("angle", "magnitude"):
        return {}
    names = [signal.sibling(axis).name for axis in ("x", "y")]
    return {name: _number(side[name][k]) for name in names if name in side}


def _equations(run: Run, signal: Signal, over_time: bool) -> Iterator[Equation]:
    """The equations that an analytic number was computed from."""
    if over_time and not run.drive_position:
        yield Equation(words=words.SWUNG, module=RELEASED)
    elif signal.kind in ("reaction", "drive", "power"):
        yield from _forces(run)
    else:
        yield from _motion(run, signal)
    if run.bends and signal.kind not in ("reaction", "drive"):
        yield Equation(words=words.BENT, module=COMPLIANCE)


def _forces(run: Run) -> Iterator[Equation]:
    loose, first_order = any(run.clearance.values()), run.analytic_model == "first_order"
    yield Equation(words=words.forces(run.motion, loose and not first_order), module=KINETOSTATICS)
    if loose:
        equation = words.FIRST_ORDER if first_order else f"displaced by {words.GAP['equilibrium']}"
        yield Equation(words=equation, module=CLEARANCE)


def _motion(run: Run, signal: Signal) -> Iterator[Equation]:
    loose = any(run.clearance.values())
    gap = words.GAP[run.analytic_model] if loose else words.NO_CLEARANCE
    gap_module = CLEARANCE if loose else None
    if signal.kind == "clearance":
        yield Equation(words=gap, module=gap_module)
    elif signal.kind == "rotation":
        yield Equation(words=f"{words.TURNED}; {gap}", module=gap_module)
    else:
        yield Equation(words=words.closure(loose), module=MOTION)
        if loose:
            yield Equation(words=f"displaced by {gap}", module=CLEARANCE)


def _engine_module(run: Run) -> str | None:
    """Where the engine of a run is coded, if it is one that is known here: a file of this project, or the module of
    another package.
    """
    if run.simulator.name in ENGINES:
        return f"sim_models/{run.simulator.name}/{'beams' if run.bends else 'engine'}.py"
    scheme, _ = scheme_of(run.simulator.name)
    if scheme:
        return f"{SCHEMES[scheme].replace('.', '/')}.py"
    point = offers().points.get(run.simulator.name)
    return None if point is None else point.module


def _time_of(run: Run, row: Discrepancy | None) -> Number:
    """When the linkage is where a discrepancy is (s)."""
    if row is None or row.at_crank_angle is None or run.time is None:
        return None
    if not run.crank_angle.size:
        return None
    return float(run.time[np.argmin(np.abs(run.crank_angle - row.at_crank_angle))])


# ------------------------------------------------------------------ a signal of a diagnosis


def residuals(result: Diagnosis, name: str) -> SignalResiduals:
    """Measured minus simulated of a signal in every run that has it.  Raises ArgumentError for one that none has."""
    runs = [run for run in result.runs if name in run.signals]
    if not runs:
        names = dict.fromkeys(name for run in result.runs for name in run.signals)
        raise ArgumentError("signal", f"no run of this diagnosis has {name}; the signals are {', '.join(names)}")
    return SignalResiduals(
        case=result.case,
        verdict=result.verdict,
        simulator=result.simulator,
        signal=name,
        label=quantity(result, name).label,
        unit=runs[0].signals[name].unit,
        runs=tuple(_of_run(result, run, name) for run in runs),
    )


def _of_run(result: Diagnosis, run: DiagnosedRun, name: str) -> Residuals:
    channel = run.signals[name]
    return Residuals(
        name=run.name,
        over_time=run.over_time,
        time=run.time,
        crank_angle=run.crank_angle,
        noise=channel.noise,
        noise_given=channel.noise_given,
        before=_residual(result, run, name, "before"),
        after=_residual(result, run, name, "after"),
    )


def _residual(result: Diagnosis, run: DiagnosedRun, name: str, side: Side) -> Residual:
    values = result.residual(run, name, side)
    gap = run.signals[name].gap_before if side == "before" else run.signals[name].gap_after
    known = np.flatnonzero(np.isfinite(values))
    if not known.size:
        return Residual(rms=None, largest=None, crank_angle=None, time=None, gap=gap, values=values)
    k = int(known[np.argmax(np.abs(values[known]))])
    return Residual(
        rms=math.sqrt(float(np.mean(values[known] ** 2))),
        largest=float(values[k]),
        crank_angle=float(run.crank_angle[k]),
        time=float(run.time[k]),
        gap=gap,
        values=values,
    )

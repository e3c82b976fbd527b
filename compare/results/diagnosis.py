"""diagnosis.json: where measurement and simulation differ, and which effect the model lacks."""

from __future__ import annotations

from collections.abc import Mapping, Sized
from functools import cached_property
from itertools import product
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, get_args

import numpy as np
from pydantic import BeforeValidator, Field, FiniteFloat, model_validator

from analytic.mechanism.one_line import count
from analytic.mechanism.signals import Signal, named, wrapped
from compare.presentation import table
from compare.results.band import Band, Context, Metrics
from compare.results.crosscheck import Simulator
from compare.results.document import (
    Amount,
    Document,
    Filled,
    Grid,
    Mechanism,
    Number,
    Part,
    Row,
    Series,
    Text,
    as_dataframe,
    rows_of,
)
from sim_models.engine import SettingValue

if TYPE_CHECKING:
    import pandas

DiagnosisVerdict = Literal["no gap", "explained", "partly explained", "unexplained", "ambiguous"]
CandidateStatus = Literal["named", "tied", "not needed", "not physical", "invisible", "excluded"]
Side = Literal["before", "after"]
SIDES: tuple[Side, ...] = get_args(Side)
Kind = Literal["rig", "sensor"]
Role = Literal["fit", "validation"]
Unknown = Literal["torque", "give", "length", "bend", "lag", "error"]
SETTLED_VERDICTS: tuple[DiagnosisVerdict, ...] = ("no gap", "explained")
Size = Annotated[FiniteFloat, Field(ge=0)]
Unit = Annotated[str, Field(min_length=1, description="SI; 1 for a number without a unit")]
Key = Annotated[str, Field(pattern="^.+@.+$", description="name@where")]
Pair = Annotated[
    tuple[Key, Key, Annotated[float, Field(ge=-1.000001, le=1.000001)]],
    BeforeValidator(lambda pair: tuple(pair) if isinstance(pair, list) else pair),
]


class Located(Part):
    """A stretch of a run in which measured minus simulated leaves the noise."""

    run: str
    signal: str
    crank_angle_from: Annotated[FiniteFloat, Field(description="rad; of a slide its travel, m")]
    crank_angle_to: Annotated[FiniteFloat, Field(description="rad; of a slide its travel, m")]
    size: FiniteFloat
    unit: Unit
    sigmas: Size
    time_from: Annotated[Number, Field(description="s; null where it is not known.")] = None
    time_to: Annotated[Number, Field(description="s; null where it is not known.")] = None
    every_turn: Annotated[bool, Field(description="Whether it is there in every turn of the run.")] = False


class Estimate(Part):
    """A parameter of an effect with its 95 % interval; an end that is open is null."""

    value: FiniteFloat
    unit: Unit
    low: Annotated[Number, Field(description="of the 95 % interval")]
    high: Annotated[Number, Field(description="of the 95 % interval")]


class EffectPlace(Part):
    """An effect at a place."""

    name: Text
    where: Text

    @property
    def key(self) -> str:
        """``name@where``."""
        return f"{self.name}@{self.where}"


class Rival(EffectPlace):
    """An effect that explains the data as well as a named one in its place."""

    odds: Annotated[
        Amount,
        Field(
            description="How likely it is beside the named effect, by their evidence: 0.1 is 10 to 1 for the named one."
        ),
    ] = None


Parameters = Annotated[
    Mapping[str, Estimate], Field(min_length=1, description="By name; a value of one run is called name@run.")
]
EffectKind = Annotated[Kind, Field(description="rig: the linkage, its loads or its drive; sensor: what measures them.")]


class Repeats(Part):
    """How an effect of the rig differs from run to run; its parameters are called ``damping@run``."""

    low: Annotated[FiniteFloat, Field(description="The smallest of its values, SI.")]
    high: FiniteFloat
    trend: Annotated[
        Literal["", "falling", "rising"],
        Field(description="Whether each run has less, or more, than the one before it in the file."),
    ] = ""


class Effect(EffectPlace):
    """What is missing from the model."""

    parameters: Parameters
    gap_before: Amount
    gap_after: Amount
    held_out_before: Amount
    held_out_after: Amount
    ambiguous_with: Annotated[tuple[Rival, ...], Field(description="What explains these data as well.")]
    would_separate: Annotated[
        str, Field(description="A run or a sensor that would tell them apart, in words and as a [[run]].")
    ]
    kind: EffectKind = "rig"
    share: Annotated[
        Number,
        Field(description="Of the squared gap before any effect: what this one takes away, added in the listed order."),
    ] = None
    evidence: Annotated[
        str,
        Field(
            description="By what else than samples it is named: ``from statistics over 21 revolutions``; else empty."
        ),
    ] = ""

    probability: Annotated[
        Amount,
        Field(description="That it is there, summed over the sets of effects that have it; null where none were."),
    ] = None
    repeats: Annotated[
        Repeats | None, Field(description="Of an effect of the rig with a value for each run: how these differ.")
    ] = None

    def __repr__(self) -> str:
        values = ", ".join(f"{name} {p.value:.4g} {p.unit}" for name, p in self.parameters.items())
        return f"Effect({self.key}: {values})"


class JointCovariance(Part):
    """How well all parameters of a set are known together."""

    names: Annotated[tuple[str, ...], Field(description="name@where.parameter of each parameter.")]
    values: Annotated[
        tuple[tuple[FiniteFloat | None, ...], ...],
        Field(description="Covariance of each with each, SI; null where the data leave one open."),
    ]


class EffectSet(Part):
    """A set of effects that may be what is missing."""

    effects: Annotated[
        tuple[str, ...],
        Field(description="name@where; none where nothing is missing; rest: all sets that are not listed."),
    ]
    probability: Annotated[FiniteFloat, Field(ge=0, le=1.000001)]
    values: Annotated[
        Mapping[str, FiniteFloat] | None,
        Field(description="name@where.parameter, SI; null where the set is not likely enough to be fitted."),
    ] = None
    covariance: Annotated[JointCovariance | None, Field(description="Of these values.")] = None


class TriedEffect(EffectPlace):
    """An effect that takes a part of the gap away and is not named."""

    kind: EffectKind
    parameters: Parameters
    share: Annotated[Number, Field(description="Of the squared gap: what it takes away beside the named effects.")]
    gap_before: Annotated[Amount, Field(description="Without it, beside the named effects.")]
    gap_after: Annotated[Amount, Field(description="With it, beside the named effects.")]
    failed: Annotated[Text, Field(description="The test that it failed, and by how much.")]


class Curve(Part):
    """What was recovered of an unknown over what its law is of (N samples), and the law there; SI."""

    over: Annotated[str, Field(min_length=1, description="What it is shown over, in words.")]
    unit: Unit
    argument: Series
    recovered: Annotated[Series, Field(description="Solved for at each sample.")]
    sigma: Annotated[Series, Field(description="1 sigma of it.")]
    law: Annotated[Series, Field(description="What the law says there.")]


class SamePlace(Part):
    """A place whose unknown tells what is left, and the law that it looks like."""

    place: Annotated[Text, Field(description="The joint, body or signal; drive for a crank behind its encoder.")]
    unknown: Annotated[
        Unknown,
        Field(
            description="torque in a joint; give of its bearing along the reaction; length of a link; bend of a link"
            " across its axis; lag of the crank behind its encoder; error of a sensor"
        ),
    ]
    law: Annotated[str | None, Field(description="In letters; null where no law of the dictionary tells it.")]


def adopted_name(unknown: str) -> str:
    """Name of an effect that was proposed: ``proposed_torque``."""
    return f"proposed_{unknown}"


class Proposed(SamePlace):
    """A place where one unknown would tell what is left, and the law that it looks like: not a name, and no part of the
    verdict.
    """

    unit: Annotated[Unit, Field(description="Of the unknown.")]
    coefficients: Annotated[Mapping[str, Estimate], Field(description="By letter.")]
    share: Annotated[
        Number,
        Field(
            description="Of the squared gap beyond the noise that what is named leaves: what it takes away, on data"
            " left out. Of the whole gap, where the explanation leaves none."
        ),
    ]
    says: Annotated[Text, Field(description="The proposal in a sentence.")]
    curve: Curve
    ties: Annotated[tuple[SamePlace, ...], Field(description="Places that do as well.")] = ()
    would_separate: Annotated[str, Field(description="A sensor that would tell them apart, in words.")] = ""
    adopted: Annotated[bool, Field(description="Whether it was put into the model: then it is an effect.")] = False
    not_adopted: Annotated[str, Field(description="Why it is not in the model, where that was asked for.")] = ""
    replaces: Annotated[
        tuple[str, ...],
        Field(description="name@where of named effects that the law has in it: it stands in their place."),
    ] = ()

    @property
    def effect(self) -> str:
        """What it is called among the effects where it is adopted."""
        return adopted_name(self.unknown)


class SensorGap(Part):
    """How far measured and simulated values of one signal are apart over all fitted runs: root mean square, SI."""

    unit: Unit
    before: Amount
    after: Amount


class Closing(Part):
    """Root mean square of residual over noise, over all samples and signals of the fitted runs; 1 is the noise
    floor.
    """

    before: Size
    after: Size
    noise_floor: Size
    explained: Annotated[
        Number,
        Field(description="Share of the squared gap beyond the noise that the effects explain; null without a gap."),
    ] = None
    by_signal: Annotated[Mapping[str, SensorGap], Field(description="The same in each sensor's own unit.")] = Field(
        default_factory=dict
    )


class Elsewhere(Part):
    """The gap in another engine."""

    before: Amount
    after: Amount


class RecordingFault(Part):
    """What is wrong with the data themselves."""

    run: str
    signal: str
    kind: Annotated[str, Field(min_length=1, description="clipped, outliers, gap, constant, noise, ...")]
    samples: Annotated[int, Field(ge=0)]
    text: Text


class ConsideredEffect(EffectPlace):
    """An effect that was considered, and what became of it."""

    sigmas: Annotated[Amount, Field(description="How strongly the data want it alone.")]
    remaining: Annotated[
        Amount, Field(description="Sigmas left of its own signature once its best rival is projected out.")
    ]
    rival: Key | None
    status: CandidateStatus
    why: str


class EngineGaps(Part):
    """An engine that was asked to simulate the nominal and the explained mechanism."""

    name: str
    version: str | None
    agreement: Annotated[Amount, Field(description="Largest rms difference to the analytic model, in noise.")]
    before: Amount
    after: Amount
    skipped: Annotated[str | None, Field(description="Why it has no numbers.")]
    added: Annotated[
        tuple[str, ...],
        Field(description="Effects that it lacks and got as the difference that they make in the analytic model."),
    ]
    settings: Annotated[
        Mapping[str, Mapping[str, SettingValue]],
        Field(description="By run, the numbers with which it was set: step, contact law, solver."),
    ]


class SensorRecord(Part):
    """One sensor in one run: measured, and simulated without and with the effects (N)."""

    unit: Unit
    noise: Annotated[FiniteFloat, Field(gt=0, description="1 sigma")]
    noise_given: Annotated[bool, Field(description="false: estimated from the data")]
    measured: Annotated[Series, Field(min_length=1)]
    before: Annotated[Series, Field(min_length=1, description="Simulated with the nominal mechanism.")]
    after: Annotated[Series, Field(min_length=1, description="Simulated with the explained mechanism.")]
    gap_before: Amount
    gap_after: Amount
    metrics: Annotated[Metrics | None, Field(description="In the manner of ASME V&V 20; of validation runs.")] = None

    def residual(self, side: Side, wraps: bool) -> np.ndarray:
        """Measured minus simulated (N,); of what ``wraps`` modulo a turn, in [-pi, pi)."""
        difference = self.measured - (self.before if side == "before" else self.after)
        return wrapped(difference) if wraps else difference


class DiagnosedRun(Part):
    """One recording (N samples)."""

    name: str
    file: Annotated[str, Field(description="The data file; empty where the recording comes from none.")] = ""
    drive: Literal["speed", "measured", "free", "torque"]
    time: Annotated[Grid, Field(min_length=1, description="s")]
    crank_angle: Annotated[
        Grid,
        Field(
            min_length=1,
            description="rad; the motor's as commanded or measured, in a free run the driven body's; where a slide"
            " moves all else its travel, m; of several drives the position of the first",
        ),
    ]
    held_out: Annotated[
        tuple[Literal[0, 1], ...] | None,
        Field(
            description="1 at the samples of the first of six folds; each fold is judged by values fitted to the other"
            " five. Null where the run has none."
        ),
    ]
    signals: Annotated[Mapping[str, SensorRecord], Field(min_length=1)]
    role: Annotated[Role, Field(description="validation: never fitted, and no part of the gap or the verdict")] = "fit"
    prediction: Annotated[
        Mapping[str, Band],
        Field(description="Of a validation run: what the model foretells of each sensor, with 95 %."),
    ] = {}

    @model_validator(mode="after")
    def _whole(self) -> DiagnosedRun:
        """Each series has a value for each sample."""
        series: dict[str, Sized] = {"crank_angle": self.crank_angle, "held_out": self.held_out or self.time}
        for (name, channel), side in product(self.signals.items(), ("measured", "before", "after")):
            series[f"signals.{name}.{side}"] = getattr(channel, side)
        self._check_sizes(series, self.time.size)
        return self

    @property
    def over_time(self) -> bool:
        """Whether it is shown over time: its crank does not turn as commanded."""
        return self.drive != "speed"

    def __repr__(self) -> str:
        return f"Run({self.name}, {self.drive}, {count(self.time.size, 'sample')}: {', '.join(self.signals)})"


class Step(Part):
    """A step of the diagnosis, told."""

    title: Literal["Measured data", "Locate", "Isolate", "Name", "Add", "Result"]
    text: tuple[Text, ...]


class Diagnosis(Document):
    """Where measurement and simulation differ, the effect that is missing, and the gap without and with it.  SI units
    and radians; what has no number is null.
    """

    file: ClassVar[str] = "diagnosis.json"
    remedy: ClassVar[str] = "give the diagnosis.json of compare diagnose"
    opens: ClassVar[str] = "diagnosis.html"

    case: Annotated[str, Field(description="Name of the nominal mechanism.")]
    verdict: DiagnosisVerdict
    statement: Annotated[str, Field(min_length=1, description="The verdict in words.")]
    simulator: Annotated[Simulator, Field(description="The engine that diagnosed.")]
    command: Annotated[str, Field(description="The command that made this file.")]
    versions: Annotated[Mapping[str, str], Field(min_length=1, description="Version by package.")]
    located: Annotated[
        tuple[Located, ...],
        Field(description="Where measured minus simulated leaves the noise, before anything is added."),
    ]
    effects: Annotated[tuple[Effect, ...], Field(description="What is missing from the model.")]
    gap: Closing
    other_simulators: Annotated[
        Mapping[str, Elsewhere], Field(description="The gap with the same effects in other engines.")
    ]
    faults: Annotated[tuple[RecordingFault, ...], Field(description="What is wrong with the data themselves.")]
    candidates: Annotated[
        tuple[ConsideredEffect, ...], Field(description="What was considered, and what became of it.")
    ]
    attempts: Annotated[
        tuple[TriedEffect, ...], Field(description="What was tried and is not named, the best first.")
    ] = ()
    proposed: Annotated[
        tuple[Proposed, ...], Field(description="What has a place and a law, but no name: never part of the verdict.")
    ] = ()
    inseparable: Annotated[
        tuple[Pair, ...],
        Field(description="Pairs of candidates that look alike in these data, and how their changes correlate."),
    ]
    engines: Annotated[
        tuple[EngineGaps, ...],
        Field(description="Every engine that was asked to simulate nominal and explained mechanism."),
    ]
    runs: Annotated[tuple[DiagnosedRun, ...], Field(min_length=1)]
    mechanism: Annotated[Mechanism, Field(description="The nominal linkage as in its TOML file.")]
    explained: Annotated[Mechanism, Field(description="The linkage with the named effects.")]
    steps: Annotated[tuple[Step, ...], Field(description="How the verdict was come to, in order.")]
    notes: Annotated[tuple[str, ...], Field(description="What was assumed, and found of the noise, in sentences.")] = ()
    sets: Annotated[
        tuple[EffectSet, ...], Field(description="Sets of effects that may be what is missing, the likeliest first.")
    ] = ()
    covariance: Annotated[
        JointCovariance | None, Field(description="Of all named parameters; null where nothing is named.")
    ] = None
    context: Annotated[
        Context | None, Field(description="What it is wanted for, where measured.toml says so, and if it is enough.")
    ] = None
    assumed: Filled = ()
    complete: Annotated[bool, Field(description="false: the budget ended the search, and this is the best so far.")] = (
        True
    )

    @property
    def settled(self) -> bool:
        """Whether there is no gap, or it is explained."""
        return self.verdict in SETTLED_VERDICTS

    @property
    def fitted(self) -> tuple[DiagnosedRun, ...]:
        """The runs that the verdict rests on."""
        return tuple(run for run in self.runs if run.role == "fit")

    @property
    def validation(self) -> tuple[DiagnosedRun, ...]:
        """The runs that nothing was fitted to."""
        return tuple(run for run in self.runs if run.role == "validation")

    @cached_property
    def signals(self) -> dict[str, Signal]:
        """Every signal that the mechanism can have, by name."""
        return dict(named(self.mechanism.bodies, self.mechanism.joints, self.mechanism.drives, self.mechanism.sensors))

    def wraps(self, signal: str) -> bool:
        """Whether values of a signal that are a turn apart are the same; of a sensor that the mechanism does not have,
        whether it is an angle (rad).
        """
        if signal in self.signals:
            return self.signals[signal].wraps
        return any(run.signals[signal].unit == "rad" for run in self.runs if signal in run.signals)

    def residual(self, run: DiagnosedRun, signal: str, side: Side) -> np.ndarray:
        """Measured minus simulated (N,) of a signal, SI; angles modulo a turn.  Raises KeyError."""
        return run.signals[signal].residual(side, self.wraps(signal))

    def rows(self) -> list[Row]:
        """A row for each sample of each run: every sensor as measured and as simulated, before and after."""
        rows: list[Row] = []
        names = dict.fromkeys(name for run in self.runs for name in run.signals)
        for run in self.runs:
            absent, columns = np.full(run.time.size, np.nan), {"time": run.time, self._position_column: run.crank_angle}
            for name, side in product(names, ("measured", "before", "after")):
                columns[f"{name}_{side}"] = getattr(run.signals[name], side) if name in run.signals else absent
            rows += rows_of(columns, run=run.name)
        return rows

    def statistics_frame(self) -> pandas.DataFrame:
        """A data frame of how far simulation is from measurement in each sensor of each run, before and after, and the
        sensor's noise (SI): rms over noise; of a rig that rattles in its statistics over revolutions, where 1 is how
        far two recordings are.  Raises ImportError with the remedy where pandas is not installed.
        """
        fields = ("unit", "noise", "gap_before", "gap_after")
        rows: list[Row] = [
            {"run": run.name, "signal": name} | {field: getattr(channel, field) for field in fields}
            for run in self.runs
            for name, channel in run.signals.items()
        ]
        return as_dataframe(rows, "statistics_frame")

    def quantiles_frame(self) -> pandas.DataFrame:
        """A data frame of how readings are spread in each part of a revolution, over whole revolutions, as a rig that
        rattles is judged: run, signal, unit, quantile, the part (``crank_angle_from`` and ``_to``, rad), measured, and
        simulated before and after, SI; each less what the nominal linkage reads, unless that has clearance itself.
        The sensor's noise is added to simulated ones, and readings left out as spikes are not among the measured ones.

        Raises KeyError where no run has three whole revolutions, ImportError with the remedy where pandas is not
        installed.
        """
        return as_dataframe(table("spread")(self), "quantiles_frame")

    def units(self) -> Mapping[str, str]:
        """SI unit of each column."""
        sides = {
            f"{name}_{side}": channel.unit
            for run in self.runs
            for name, channel in run.signals.items()
            for side in ("measured", "before", "after")
        }
        return {"time": "s", self._position_column: self.mechanism.encoders[0].unit} | sides

    @property
    def _position_column(self) -> str:
        """What says where the linkage is: the crank's angle; of several drives the position of the first."""
        return self.mechanism.encoders[0].name if self.mechanism.several else "crank_angle"

    def __repr__(self) -> str:
        what = ", ".join(effect.key for effect in self.effects) or "nothing named"
        return (
            f"Diagnosis({self.case}: {self.verdict}, {what}; gap {self.gap.before:.3g} before, {self.gap.after:.3g}"
            f" after, {count(len(self.runs), 'run')})"
        )

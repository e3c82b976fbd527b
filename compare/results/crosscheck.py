"""result.json: a cross-check of the analytic model against multibody simulations."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import numpy as np
from pydantic import BeforeValidator, ConfigDict, Field, FiniteFloat, model_validator

from analytic.mechanism.one_line import count
from analytic.mechanism.signals import Signal, SiUnit, named, same_turn
from analytic.paper.clearance import Model
from compare.results.band import Metrics
from compare.results.contact import UNITS, Compared, Contact
from compare.results.document import (
    Document,
    Filled,
    Grid,
    Mechanism,
    Number,
    Part,
    Row,
    Series,
    Share,
    Text,
    as_dataframe,
    rows_of,
)
from compare.results.looked_at import WithReactions, peaks
from compare.results.play import WithPlay
from sim_models.engine import Cause, JointModel, Motion, SettingValue

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

Verdict = Literal["agrees", "disagrees", "unjudged"]
Signals = Annotated[
    Mapping[str, Series], Field(min_length=1, description="Every signal by name, a value for each crank angle.")
]
MetresByJoint = Annotated[
    Mapping[str, Annotated[float, Field(gt=0)]],
    Field(description="Radial clearance (m) by joint; empty in ideal runs."),
]
RECORDED = "recorded"
Index = Annotated[str, Field(pattern="^(0|[1-9][0-9]*)$")]


def without(signals: Mapping[str, np.ndarray], samples: Sequence[int]) -> dict[str, np.ndarray]:
    """Signals (N,) without a number at some samples."""
    kept = {name: np.array(values) for name, values in signals.items()}
    for values in kept.values():
        values[list(samples)] = np.nan
    return kept


class Simulator(Part):
    """Which engine made a run; the version of what was read from a file is ``recorded``."""

    name: str
    version: str

    @property
    def recorded(self) -> bool:
        """Whether the run was read from a file."""
        return self.version == RECORDED


class Discrepancy(Part):
    """Simulated minus analytic where it is the largest share of its tolerance."""

    model_config = ConfigDict(
        json_schema_extra={
            "if": {"properties": {"verdict": {"enum": ["known", "unjudged"]}}},
            "then": {"required": ["reason"]},
        }
    )

    signal: str
    kind: Literal["angle", "magnitude", "value"]
    unit: SiUnit
    max: Number
    rms: Number
    at_crank_angle: Number
    tolerance: Number
    verdict: Annotated[
        Literal["agrees", "disagrees", "known", "unjudged"],
        Field(description="unjudged if what is allowed is larger than the signal, so that anything would agree."),
    ]
    reason: Annotated[
        str,
        Field(
            min_length=1,
            description="Why a difference is known or unjudged, or why it disagrees for another reason than its size.",
        ),
    ] = ""

    @property
    def share(self) -> float | None:
        """Largest difference over tolerance; None where there is no number."""
        return abs(self.max) / self.tolerance if self.max is not None and self.tolerance else None

    def __repr__(self) -> str:
        unit = {"rad": "deg", "m": "mm"}.get(self.unit, self.unit)
        factor = {"rad": 180 / np.pi, "m": 1e3}.get(self.unit, 1.0)
        size = "no number" if self.max is None else f"{factor * self.max:+.3g} {unit}"
        return f"Discrepancy({self.signal} {size}, {self.verdict})"


class OrderDifference(Part):
    """The paper's first order minus the equilibrium, of one signal."""

    unit: SiUnit
    max: Number
    rms: Number
    at_crank_angle: Number


class PinPath(Part):
    """Path (m) of a pin in its bearing, densely sampled."""

    x: Series
    y: Series


class Because(Part):
    """The assumption of the analytic model that fails in a run that disagrees."""

    assumption: Annotated[
        Literal["contact", "first-order", "quasi-static", "rigid", "unknown"],
        Field(description="As in a map of validity; unknown if none that was examined explains the disagreement."),
    ]
    joint: Annotated[str | None, Field(description="Where it fails, if it fails in one joint.")]
    words: Annotated[str, Field(min_length=1, description="Why the run disagrees, in a sentence.")]


class Numerical(Part):
    """How far a signal of a run is off by the length of the engine's steps, from steps, half and quarter steps."""

    unit: SiUnit
    u_num: Annotated[
        float,
        Field(
            ge=0, description="Standard uncertainty: half of the grid convergence index (Roache), of the worst sample."
        ),
    ]
    order: Annotated[Number, Field(description="Observed; null where differences are no series, as rounding.")]


class Run(WithPlay, Part):
    """One engine with one joint model, and the analytic model at the same crank angles (N)."""

    simulator: Simulator
    joint_model: JointModel
    motion: Motion
    clearance: MetresByJoint
    analytic_model: Model
    settings: Annotated[
        Mapping[str, SettingValue],
        Field(
            description="The numbers that the engine used, such as contact_stiffness (N/m), contact_damping (N.s/m),"
            " contact_law and step (s; null where nothing steps); others than these are its own."
        ),
    ]
    crank_angle: Annotated[
        Grid,
        Field(
            min_length=1, description="rad; where no crank moves the linkage, the first drive's position (rad, or m)."
        ),
    ]
    time: Annotated[Grid | None, Field(min_length=1, description="s, in driven runs and over time at rest")] = None
    drive_position: Annotated[
        Mapping[str, Grid],
        Field(description="Position (rad, or m) of each driven joint, where the drives are not one crank's."),
    ] = {}
    flags: Annotated[
        Mapping[Index, Text],
        Field(
            description="Why the analytic model has no answer, by index into crank_angle; it is null there, and nothing"
            " is compared."
        ),
    ]
    analytic: Signals
    simulated: Signals
    discrepancies: tuple[Discrepancy, ...]
    verdict: Annotated[Verdict, Field(description="unjudged if nothing could be compared, or a signal of it is.")]
    reason: Annotated[str, Field(min_length=1, description="Why nothing could be compared in the run.")] = ""
    because: Annotated[Because | None, Field(description="Why it disagrees, where it does.")] = None
    order_difference: Annotated[
        Mapping[str, OrderDifference], Field(description="The paper's first order minus the equilibrium, by signal.")
    ]
    journal: Annotated[
        Mapping[str, PinPath], Field(description="Path (m) of each pin in its bearing, densely sampled.")
    ]
    free_share: Annotated[
        Mapping[str, Share],
        Field(description="Share of the time (static: of the angles) that each pin is without contact."),
    ]
    numerical: Annotated[
        Mapping[str, Numerical], Field(description="By signal, where that was asked for and the engine steps.")
    ] = {}
    metrics: Annotated[
        Mapping[str, Metrics],
        Field(
            description="By signal that results were read of: in a recorded run the analytic side held against them, in"
            " an engine's run with verify the engine. In the manner of ASME V&V 20."
        ),
    ] = {}
    contact: Annotated[
        Contact | None, Field(description="What contact did, in driven runs in which a pin may leave its wall.")
    ] = None

    @model_validator(mode="after")
    def _whole(self) -> Run:
        """Each series has a value for each sample."""
        series = {} if self.time is None else {"time": self.time}
        for part in ("drive_position", "analytic", "simulated"):
            series |= {f"{part}.{name}": values for name, values in getattr(self, part).items()}
        self._check_sizes(series, self.crank_angle.size)
        return self

    @property
    def title(self) -> str:
        """How the run is called everywhere."""
        return f"{self.simulator.name}, {self.joint_model}"

    @property
    def bends(self) -> bool:
        """Whether its links were made of beams; the analytic side is then a superposition (Fig. 7c)."""
        return "links" in self.settings

    @property
    def comparable(self) -> dict[str, np.ndarray]:
        """The simulated signals, without a number where the analytic model has no answer."""
        return without(self.simulated, [int(i) for i in self.flags])

    def difference(self, signal: Signal) -> np.ndarray:
        """Simulated minus analytic (N,) of a signal, SI; angles modulo a turn.  Raises KeyError."""
        return signal.apart(self.simulated[signal.name], self.analytic[signal.name])

    def __repr__(self) -> str:
        return f"Run({self.title}, {self.motion}, {count(self.crank_angle.size, 'sample')}: {self.verdict})"


class Printed(Part):
    """A number that the paper prints for this very linkage, beside what the analytic models give there."""

    signal: str
    crank_angle: Annotated[float, Field(description="rad")]
    printed: Annotated[float, Field(description="As printed, SI.")]
    first_order: Annotated[float, Field(description="What Eq. 8 gives here, SI.")]
    equilibrium: Annotated[float, Field(description="What the displaced linkage's own reactions give, SI.")]
    source: Annotated[str, Field(description="Where the paper prints it.")]


class Failure(Part):
    """A simulation that has no result."""

    simulator: str
    joint_model: JointModel
    why: Text
    cause: Annotated[Cause | None, Field(description="What kind of failure it is, if that is known.")] = None
    stopped: Annotated[bool, Field(description="Whether somebody did not wait for it.")] = False

    @property
    def unsupported(self) -> bool:
        """Whether the engine never had what it was asked for."""
        return self.cause is Cause.UNSUPPORTED

    def __repr__(self) -> str:
        return f"Failure({self.why[:120]})"


class Spread(Part):
    """With several engines: the largest difference between any two of them on a signal."""

    max: Annotated[float, Field(ge=0)]
    at_crank_angle: FiniteFloat
    between: Annotated[tuple[str, str], BeforeValidator(lambda pair: tuple(pair) if isinstance(pair, list) else pair)]
    joint_model: JointModel


class CrossCheck(WithReactions, Document):
    """A cross-check of the analytic model against multibody simulations.  SI units and radians; what has no number is
    null.
    """

    model_config = ConfigDict(
        json_schema_extra={
            "dependentRequired": {
                "spread": ["odd_one_out", "words"],
                "odd_one_out": ["spread", "words"],
                "words": ["spread", "odd_one_out"],
            }
        }
    )

    file: ClassVar[str] = "result.json"
    remedy: ClassVar[str] = "give the result.json of a cross-check"
    opens: ClassVar[str] = "report.html"

    case: Annotated[str, Field(description="Name of the mechanism.")]
    verdict: Annotated[
        Verdict,
        Field(
            description="disagrees if any run does, or a statistic of two; else unjudged if any run is, or has failed."
        ),
    ]
    command: Annotated[str, Field(description="The command that made this file.")]
    versions: Annotated[Mapping[str, str], Field(description="Version by package.", min_length=1)]
    mechanism: Mechanism
    warnings: tuple[str, ...]
    assumed: Filled = ()
    runs: tuple[Run, ...]
    failures: Annotated[tuple[Failure, ...], Field(description="Simulations that have no result.")]
    spread: Annotated[
        Mapping[str, Spread],
        Field(description="With several engines: the largest difference between any two, by signal."),
    ] = {}
    odd_one_out: Annotated[
        str | None, Field(description="With several engines: analytic or the engine that stands apart.")
    ] = None
    words: Annotated[str, Field(description="Which engine stands apart, or that none does, in a sentence.")] = ""
    statistics: Annotated[
        tuple[Compared, ...],
        Field(description="Of runs in which pins strike: each average over revolutions of one held against another's."),
    ] = ()
    printed: Annotated[
        tuple[Printed, ...], Field(description="Of the paper's own case: what the paper prints of it.")
    ] = ()

    @cached_property
    def signals(self) -> dict[str, Signal]:
        """Every signal that the mechanism can have, by name."""
        return dict(named(self.mechanism.bodies, self.mechanism.joints, self.mechanism.drives, self.mechanism.sensors))

    @property
    def swings(self) -> bool:
        """Whether the linkage swings freely in driven runs, so that samples belong to times."""
        return self.mechanism.speed is None

    @property
    def over_time(self) -> bool:
        """Whether the samples of its runs belong to times: no crank's angle says where the linkage is."""
        return self.swings and all(run.time is not None for run in self.runs)

    def run(self, simulator: str | None = None, joint_model: str | None = None) -> Run:
        """The first run of that engine and joint model.  Raises KeyError with those that there are."""
        for run in self.runs:
            if simulator in (None, run.simulator.name) and joint_model in (None, run.joint_model):
                return run
        raise KeyError(
            f"no run of {simulator or 'any engine'} with {joint_model or 'any'} joints; the runs are {self.runs}"
        )

    def contact_frame(self, joint: str | None = None) -> pandas.DataFrame:
        """:meth:`Run.contact_frame` of the run with clearance.  Raises KeyError where there is none, or several."""
        return self._loose("contact_frame").contact_frame(joint)

    def statistics_frame(self) -> pandas.DataFrame:
        """A data frame of the statistics of contact of each joint of each run in which pins may strike: their value
        over the revolutions with its 95 % interval, SI; :attr:`statistics` are held against each other.

        Raises ImportError with the remedy where pandas is not installed.
        """
        rows: list[Row] = [
            {"simulator": run.simulator.name, "joint_model": run.joint_model, "motion": run.motion, "joint": joint}
            | {"statistic": name, "unit": UNITS[name], "value": each.value, "low": each.low, "high": each.high}
            for run in self.runs
            for joint, contact in (run.contact.joints if run.contact else {}).items()
            for name, each in contact.statistics.items()
        ]
        return as_dataframe(rows, "statistics_frame")

    @property
    def peaks(self) -> pandas.DataFrame:
        """A data frame of the largest value of each signal of each run, on either ``side``, with its sign, SI: signal,
        unit, largest of the samples, and the crank angle (rad) and time (s) where it is.

        Raises ImportError with the remedy where pandas is not installed.
        """
        rows: list[Row] = []
        for run in self.runs:
            about = {"simulator": run.simulator.name, "joint_model": run.joint_model, "motion": run.motion}
            angle = run.crank_angle if self.mechanism.cranked or run.time is None or not self.swings else None
            for side, signals in (("analytic", run.analytic), ("simulated", run.simulated)):
                found = peaks(signals, self.signals, angle, run.time, {})
                rows += ({**about, "side": side, **row} for row in found)
        return as_dataframe(rows, "peaks")

    @property
    def drawable(self) -> Collection[str]:
        """The signals that :meth:`plot` draws by name, analytic and of every run that has them."""
        there = {name for run in self.runs for side in (run.analytic, run.simulated) for name in side}
        return [name for name in self.signals if name in there]

    def plot_orbit(self, joint: str | None = None) -> Figure:
        """:meth:`Run.plot_orbit` of the run with clearance.  Raises KeyError where there is none, or several."""
        return self._loose("plot_orbit").plot_orbit(joint)

    def _loose(self, wanted: str) -> Run:
        loose = [run for run in self.runs if run.clearance]
        if len(loose) != 1:
            which = [f"run({run.simulator.name!r}, {run.joint_model!r}).{wanted}()" for run in loose]
            raise KeyError(
                f"{self.case}: {count(len(loose), 'run')} with clearance{': ' * bool(which)}{', '.join(which)}"
            )
        return loose[0]

    def rows(self) -> list[Row]:
        """A row for each sample of each run: ``analytic_<signal>`` and ``simulated_<signal>``, side by side, an angle
        within half a turn of the other.
        """
        rows: list[Row] = []
        for run in self.runs:
            columns = {"crank_angle": run.crank_angle} | ({} if run.time is None else {"time": run.time})
            for name in self.signals:
                if name in run.analytic and name in run.simulated:
                    analytic, simulated = run.analytic[name], run.simulated[name]
                    simulated = same_turn(simulated, analytic) if self.signals[name].wraps else simulated
                    columns |= {f"analytic_{name}": analytic, f"simulated_{name}": simulated}
            rows += rows_of(columns, simulator=run.simulator.name, joint_model=run.joint_model, motion=run.motion)
        return rows

    def units(self) -> Mapping[str, str]:
        """SI unit of each column."""
        sides = {f"{side}_{name}": s.unit for name, s in self.signals.items() for side in ("analytic", "simulated")}
        return {"crank_angle": "rad", "time": "s"} | sides

    def __repr__(self) -> str:
        engines = ", ".join(dict.fromkeys(run.simulator.name for run in self.runs)) or "no engine"
        judged = [d for run in self.runs for d in run.discrepancies]
        off = sum(d.verdict == "disagrees" for d in judged)
        failed = f", {len(self.failures)} failed" if self.failures else ""
        return (
            f"CrossCheck({self.case} in {engines}: {self.verdict}; {count(len(self.runs), 'run')}{failed}, {off} of"
            f" {count(len(judged), 'comparison')} beyond tolerance)"
        )

"""analysis.json and simulation.json: one side of a comparison by itself."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from analytic.mechanism.one_line import count
from analytic.mechanism.signals import Signal, named
from analytic.paper.clearance import Model
from compare.results.crosscheck import Index, MetresByJoint, OrderDifference, PinPath, Signals, Simulator
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
    no_signal,
    rows_of,
)
from compare.results.looked_at import WithReactions, peaks
from compare.results.play import WithPlay
from compare.results.toleranced import SignalsByTolerance
from sim_models.engine import JointModel, Motion, SettingValue

if TYPE_CHECKING:
    import pandas


class _Side(WithReactions, Document):
    """Signals of a linkage over its crank angle, or over time where it swings freely."""

    case: Annotated[str, Field(description="Name of the mechanism.")]
    mechanism: Mechanism
    motion: Motion
    clearance: MetresByJoint
    crank_angle: Annotated[
        Grid, Field(description="rad; where no crank moves the linkage, the first drive's position (rad, or m).")
    ]
    time: Annotated[Grid | None, Field(description="s; of what is simulated in motion, or analysed over time.")] = None
    signals: Signals
    command: str = ""
    warnings: tuple[str, ...] = ()
    assumed: Filled = ()

    @cached_property
    def kinds(self) -> dict[str, Signal]:
        """What each signal is."""
        known = named(self.mechanism.bodies, self.mechanism.joints, self.mechanism.drives, self.mechanism.sensors)
        return {name: known[name] for name in self.signals if name in known}

    def __getitem__(self, name: str) -> np.ndarray:
        """A signal (N,), SI, NaN where there is no number.  Raises KeyError with the names that there are."""
        try:
            return self.signals[name]
        except KeyError:
            raise no_signal(name, self.signals) from None

    @property
    def peaks(self) -> pandas.DataFrame:
        """A data frame of the largest value of each signal, with its sign, SI: signal, unit, largest, the crank angle
        (rad) and time (s) where it is, and of an analysis the rms.

        Raises ImportError with the remedy where pandas is not installed.
        """
        swings = self.time is not None and self.mechanism.speed is None
        angle = self.crank_angle if self.mechanism.cranked or not swings else None
        return as_dataframe([*peaks(self.signals, self.kinds, angle, self.time, self._between, self._rms)], "peaks")

    @property
    def drawable(self) -> Collection[str]:
        """The signals that :meth:`plot` draws by name."""
        return self.kinds.keys()

    @property
    def _between(self) -> dict[str, tuple[float, float]]:
        """Largest value of signals and its crank angle or time, where that is known between the samples too."""
        return {}

    @property
    def _rms(self) -> dict[str, float | None]:
        """Root mean square of signals, where it was looked for."""
        return {}

    def units(self) -> Mapping[str, str]:
        """SI unit of each column."""
        return {"crank_angle": "rad", "time": "s"} | {name: kind.unit for name, kind in self.kinds.items()}

    def rows(self) -> list[Row]:
        """A row for each crank angle, or time."""
        timed = {} if self.time is None else {"time": self.time}
        angle = {"crank_angle": self.crank_angle} if self.mechanism.cranked or not timed else {}
        return rows_of({**angle, **timed, **self.signals, **angle})  # the angle is known where the model has no answer

    def _over(self) -> str:
        if not self.crank_angle.size:
            return "no crank angle"
        if self.time is not None and self.mechanism.speed is None:
            return f"{count(self.time.size, 'instant')} {self.time[0]:.4g} to {self.time[-1]:.4g} s"
        first, last = (math.degrees(self.crank_angle[k]) for k in (0, -1))
        sizes = ", ".join(f"{joint} {size:.4g} m" for joint, size in self.clearance.items())
        over = f"{count(self.crank_angle.size, 'crank angle')} {first:.4g} to {last:.4g} deg"
        return over + (f", clearance {sizes}" if sizes else "")


class OutputError(Part):
    """What clearance does to a coordinate of a body's centre of mass, or to its angle (m or rad)."""

    unit: Literal["m", "rad"]
    equilibrium: Annotated[Series, Field(description="Displacement with finite gaps, every pin along its reaction.")]
    worst_case: Annotated[Series, Field(description="Largest displacement to either side, wherever the pins lie.")]
    by_joint: Annotated[
        Mapping[str, Series],
        Field(description="First-order displacement by the clearance of each joint alone, its pin along its reaction."),
    ]


class Extremes(Part):
    """The highest and the lowest value of a signal over the crank angles or times, looked for between the samples
    too.
    """

    highest: Number
    highest_at: Annotated[Number, Field(description="Crank angle (rad); time (s) where there are times.")]
    lowest: Number
    lowest_at: Annotated[Number, Field(description="Crank angle (rad); time (s) where there are times.")]
    mean: Annotated[Number, Field(description="Over the crank angle or time; null where there is a gap.")] = None
    rms: Annotated[Number, Field(description="Root mean square, as the mean: what a motor is sized by.")] = None
    gap: Annotated[
        tuple[float, float] | None, Field(description="The widest one without an answer, where mean and rms are null.")
    ] = None


class Limit(Part):
    """A limit that was set to a number of a linkage, and the number that is farthest beyond it or nearest to it."""

    unit: Annotated[str, Field(description="SI, of all numbers.")]
    least: Annotated[Number, Field(description="Null where there is none; of a largest size both are there.")]
    largest: Number
    value: Annotated[Number, Field(description="Null where the model has no answer.")]
    at: Annotated[Number, Field(description="Crank angle (rad); time (s) where there are times; null of a stroke.")]
    missing: Annotated[int, Field(ge=0, description="Samples without an answer.")]
    over: Annotated[
        tuple[float, float] | None,
        Field(description="Crank angles (rad) between which a stroke, mean or rms is; null of a whole turn."),
    ] = None
    without_clearance: Annotated[
        bool, Field(description="Whether a linkage with clearance was looked at without it, as of strokes.")
    ] = False
    verdict: Literal["holds", "broken", "unknown"]

    @property
    def bound(self) -> float:
        """That of the two which the value is beyond, or nearest to."""
        bounds = [bound for bound in (self.least, self.largest) if bound is not None]
        return min(bounds, key=lambda bound: abs((self.value or 0.0) - bound))

    @property
    def times(self) -> float:
        """How large the value is in its bound, or the bound in the value where that is a least one."""
        parts = (abs(self.value or 0.0), abs(self.bound))
        larger, smaller = parts if self.bound == self.largest or self.bound < 0 else parts[::-1]
        return larger / smaller if smaller else 0.0


class Analysis(_Side):
    """The analytic model of a linkage: kinetostatics, clearance and, where asked for, compliance.  SI units and
    radians.
    """

    file: ClassVar[str] = "analysis.json"
    remedy: ClassVar[str] = "give the analysis.json of compare analyse"
    opens: ClassVar[str] = "analysis.html"
    opened: ClassVar[str] = "page"

    analytic_model: Model
    compliance: Annotated[bool, Field(description="Whether links and joints yield as well (Eqs. 1-7, Fig. 7c).")]
    flags: Annotated[
        Mapping[Index, Text],
        Field(description="Why the model has no answer, by index into crank_angle; signals are null there."),
    ]
    order_difference: Annotated[
        Mapping[str, OrderDifference], Field(description="The paper's first order minus the equilibrium, by signal.")
    ]
    transmission: Annotated[
        Series | None,
        Field(description="Sine of the transmission angle, the least over all loops; of a linkage that a crank moves."),
    ] = None
    extremes: Annotated[
        Mapping[str, Extremes],
        Field(
            description="By signal, of the transmission angle, and without clearance of each slide's travel and each"
            " body's angle (stroke_<name>), over closely spaced crank angles or times."
        ),
    ] = {}
    errors: Annotated[
        Mapping[str, OutputError],
        Field(
            description="By output (<body>_x, _y, _angle; <body>.<point>_x, _y where it has a limit) what clearance"
            " does to it; of loose joints in what is driven."
        ),
    ] = {}
    tolerances: Annotated[
        SignalsByTolerance | None, Field(description="What the mechanism's tolerances do, where it states any.")
    ] = None

    limits: Annotated[Mapping[str, Limit], Field(description="By name, where limits were asked for.")] = {}

    @property
    def holds(self) -> bool:
        """Whether every limit that was asked for holds."""
        return all(limit.verdict == "holds" for limit in self.limits.values())

    @property
    def _between(self) -> dict[str, tuple[float, float]]:
        found = {}
        for name, ends in self.extremes.items():
            both = ((ends.highest, ends.highest_at), (ends.lowest, ends.lowest_at))
            known = [(value, at) for value, at in both if value is not None and at is not None]
            if len(known) == len(both):
                found[name] = max(known, key=lambda end: abs(end[0]))
        return found

    @property
    def _rms(self) -> dict[str, float | None]:
        return {name: ends.rms for name, ends in self.extremes.items()}

    def __repr__(self) -> str:
        flagged = f", {len(self.flags)} without an answer" if self.flags else ""
        return f"Analysis({self.case}, {self.motion}, {self.analytic_model}, {self._over()}{flagged})"


class Simulation(WithPlay, _Side):
    """One run of one engine.  SI units and radians."""

    file: ClassVar[str] = "simulation.json"
    remedy: ClassVar[str] = "give the simulation.json of compare simulate"
    opens: ClassVar[str] = "signals.csv"
    opened: ClassVar[str] = "signals"

    simulator: Simulator
    joint_model: JointModel
    settings: Annotated[Mapping[str, SettingValue], Field(description="The numbers that the engine used.")]
    journal: Annotated[
        Mapping[str, PinPath], Field(description="Path (m) of each pin in its bearing, densely sampled.")
    ]
    free_share: Annotated[
        Mapping[str, Share],
        Field(description="Share of the time (static: of the angles) that each pin is without contact."),
    ]

    @property
    def title(self) -> str:
        """How the run is called, as one of a cross-check is."""
        return f"{self.simulator.name}, {self.joint_model}"

    @property
    def simulated(self) -> Mapping[str, np.ndarray]:
        """Its signals, as a run of a cross-check calls them."""
        return self.signals

    @property
    def contact(self) -> None:
        """What contact did: one run alone is not watched."""

    def __repr__(self) -> str:
        return f"Simulation({self.case} in {self.simulator.name}, {self.joint_model}, {self.motion}, {self._over()})"

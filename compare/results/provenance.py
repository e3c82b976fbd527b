"""provenance.json: one number of a cross-check, what stands on each side and where each comes from."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar

from pydantic import Field, FiniteFloat

from analytic.mechanism.one_line import count
from analytic.mechanism.signals import SiUnit
from analytic.paper.clearance import Model
from compare.results.crosscheck import Discrepancy, MetresByJoint, Simulator
from compare.results.document import Document, Number, Part, Row, Text
from sim_models.engine import JointModel, Motion, SettingValue

Components = Annotated[
    Mapping[str, Number],
    Field(description="The x and y (N) of which a direction or a size was made, by signal; else empty."),
]


class Equation(Part):
    """What an analytic number was computed from."""

    words: Annotated[Text, Field(description="The equation of the paper, or the model.")]
    module: Annotated[str | None, Field(description="Where it is coded; null where nothing is computed.")]


class Analytic(Part):
    """The analytic side of a number."""

    value: Annotated[Number, Field(description="SI")]
    components: Components
    equations: Annotated[tuple[Equation, ...], Field(min_length=1)]


class Simulated(Part):
    """The simulated side of a number."""

    value: Annotated[Number, Field(description="SI")]
    components: Components
    module: Annotated[
        str | None, Field(description="Where the engine is coded; null for one that this installation does not know.")
    ]
    settings: Annotated[Mapping[str, SettingValue], Field(description="The numbers that the engine used, as its run.")]


class Sample(Part):
    """Both sides of the number in one run, at the sample nearest to what was asked for."""

    simulator: Simulator
    joint_model: JointModel
    motion: Motion
    clearance: MetresByJoint
    analytic_model: Model
    index: Annotated[int, Field(ge=0, description="Of the sample, in the run's crank_angle.")]
    count: Annotated[int, Field(ge=1, description="Samples of the run.")]
    crank_angle: Annotated[FiniteFloat, Field(description="rad")]
    time: Annotated[Number, Field(description="s; null in static runs.")]
    exact: Annotated[bool, Field(description="Whether the sample lies at what was asked for; nothing is interpolated.")]
    flag: Annotated[str, Field(description="Why the analytic model has no answer here; empty if it has one.")]
    analytic: Analytic
    simulated: Simulated
    difference: Annotated[
        Number, Field(description="Simulated minus analytic, SI; of angles less whole turns, in [-pi, pi).")
    ]
    discrepancy: Annotated[
        Discrepancy | None,
        Field(description="The verdict on this signal over the whole run; null if it is not judged on its own."),
    ]
    worst_time: Annotated[
        Number,
        Field(description="Where the discrepancy is (s), if the run is over time; else it has only a crank angle."),
    ]

    def __repr__(self) -> str:
        size = "no number" if self.difference is None else f"{self.difference:+.3g}"
        return f"Sample({self.simulator.name}, {self.joint_model}, {self.motion}: {size} simulated minus analytic)"


class Provenance(Document):
    """One number of a cross-check in every run that has it: both sides, equation and module, engine and settings, and
    the verdict.
    """

    file: ClassVar[str] = "provenance.json"
    remedy: ClassVar[str] = "give what compare show --json prints of a result.json"

    case: Annotated[str, Field(description="Name of the mechanism.")]
    command: Annotated[str, Field(description="The command that made the result.")]
    versions: Annotated[Mapping[str, str], Field(description="Version by package, of the result.")]
    signal: Annotated[str, Field(description="Its name in files.")]
    label: Annotated[Text, Field(description="What it is, in words.")]
    acts: Annotated[str, Field(description="Of a joint's signal: which body pushes which; else empty.")]
    unit: SiUnit
    over_time: Annotated[bool, Field(description="Whether samples belong to times, as the linkage swings freely.")]
    at: Annotated[FiniteFloat, Field(description="What was asked for: a crank angle (rad), or a time (s) over time.")]
    runs: Annotated[tuple[Sample, ...], Field(min_length=1)]

    def rows(self) -> list[Row]:
        """A row for each run: both sides, the difference, and the verdict on the signal."""
        return [
            {"simulator": run.simulator.name, "joint_model": run.joint_model, "motion": run.motion}
            | {"crank_angle": run.crank_angle, "time": run.time}
            | {"analytic": run.analytic.value, "simulated": run.simulated.value, "difference": run.difference}
            | {
                "tolerance": None if run.discrepancy is None else run.discrepancy.tolerance,
                "verdict": None if run.discrepancy is None else run.discrepancy.verdict,
            }
            for run in self.runs
        ]

    def units(self) -> Mapping[str, str]:
        """SI unit of each column."""
        of_signal = dict.fromkeys(("analytic", "simulated", "difference", "tolerance"), str(self.unit))
        return {"crank_angle": "rad", "time": "s"} | of_signal

    def __repr__(self) -> str:
        place = f"{self.at:.6g} {'s' if self.over_time else 'rad'}"
        return f"Provenance({self.case}, {self.signal} at {place}: {count(len(self.runs), 'run')})"

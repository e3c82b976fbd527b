"""A run from its request to its trace, whatever the engine.

What every engine does alike is written here once: the places that a linkage passes, in the order in which it passes
them; steps that are halved while rigid joints come apart; and the trace, in the order in which it was asked for.  An
engine says how its linkage rests at these places (:meth:`EngineRun.rest`), and how it starts and goes from report to
report (:meth:`EngineRun.march`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from analytic.kinematics.assembly import Assembly
from sim_models.common.failed_starts import own_start
from sim_models.common.rates import part_rates
from sim_models.common.travel import told_by, with_positions
from sim_models.engine import Cause, Request, SettingValue, SimulationError, Trace, Watched, installed_version
from sim_models.run.path import CoursePath, CrankPath, MotorPath, Path, RestingPath

HALVINGS_IF_APART = 5  # of the step, before a run with rigid joints coming apart is given up


@dataclass(frozen=True)
class Observed:
    """What an engine saw at N places in the order of passing.

    ``columns`` (N,) are its signals, and with them the rates of its bodies (:mod:`sim_models.common.rates`); the rest
    is as in a :class:`~sim_models.engine.Trace`.
    """

    columns: Mapping[str, np.ndarray]
    settings: Mapping[str, SettingValue] = field(default_factory=dict)
    journal: Mapping[str, np.ndarray] = field(default_factory=dict)
    free_share: Mapping[str, float] = field(default_factory=dict)
    watched: Watched | None = None


def columns_of(rows: Sequence[Mapping[str, float]]) -> dict[str, np.ndarray]:
    """Signals (N,) from those at N places, one after the other."""
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


class EngineRun(ABC):
    """One request on its way to a trace.  Raises AssemblyError where the linkage cannot follow its courses."""

    engine: str
    package: str
    crank_by_time = False  # whether the path of a crank that moves is told by time, not by the crank's angle
    step: float | None = None  # s, of a march that has begun

    def __init__(self, request: Request) -> None:
        self.request, self.mechanism = request, request.mechanism
        self.assembly = Assembly(request.mechanism)
        self.path = self.make_path()

    def make_path(self) -> Path:
        """Where the linkage is at each place: a crank's angle (rad), or a time (s) of its courses."""
        schedule = self.request.schedule
        if schedule.crank is not None:
            kind = MotorPath if self.crank_by_time and not schedule.at_rest else CrankPath
            return kind.of(self.request, self.assembly)
        return (RestingPath if schedule.at_rest else CoursePath)(self.request, self.assembly)

    @abstractmethod
    def rest(self, places: np.ndarray) -> Observed:
        """Equilibria with the drives where they are at places (N,) on the path.  Raises SimulationError."""

    @abstractmethod
    def march(self, times: np.ndarray) -> Observed:
        """The motion, from its start through reports at times (N,) s.  Raises SimulationError."""

    def trace(self) -> Trace:
        """Run the request, in steps that are halved while rigid joints come apart, unless it says which.

        Raises SimulationError, AssemblyError or Unsupported.
        """
        asked = self.request.step
        for _ in range(HALVINGS_IF_APART):
            try:
                return self.attempt()
            except SimulationError as error:
                if error.cause is not Cause.CAME_APART or asked is not None or self.step is None:
                    raise
            self.request = replace(self.request, step=self.step / 2)
        return self.attempt()

    def attempt(self) -> Trace:
        """One attempt."""
        schedule = self.request.schedule
        angles = schedule.crank_angle
        places = angles if angles is not None and schedule.at_rest else schedule.time
        order = np.argsort(places, kind="stable")
        with own_start(self.engine, self.request, self.assembly):
            observed = self.rest(places[order]) if schedule.at_rest else self.march(places[order])
        signals, rates = part_rates({name: values[np.argsort(order)] for name, values in observed.columns.items()})
        trace = Trace(
            simulator=self.engine,
            version=installed_version(self.package) or "unknown",
            joint_model=self.request.joint_model,
            motion=self.request.motion,
            crank_angle=schedule.time,
            time=None if places is angles else schedule.time,
            signals=signals,
            clearance=self.request.clearances,
            journal=observed.journal,
            free_share=observed.free_share,
            settings=observed.settings,
            rates=rates,
            watched=observed.watched,
        )
        trace = with_positions(self.mechanism, trace)
        leading = trace.signals[told_by(self.mechanism, self.assembly.structure)] if angles is None else angles
        return replace(trace, crank_angle=leading.copy())

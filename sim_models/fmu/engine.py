"""An FMU as an engine: ``fmu:linkage.fmu``, with its map beside it or as ``fmu:linkage.fmu::map.toml``.

It has whatever joints, friction and springs its makers gave it; none of the mechanism reaches it but what the map says.
Its signals are those of the map, which need not be all that a linkage has.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from analytic.kinematics.schedule import DriveMotion
from sim_models.common.requests import check_request
from sim_models.engine import (
    FEATURES,
    SEPARATOR,
    Capabilities,
    Engine,
    Feature,
    Request,
    Scope,
    SettingValue,
    Trace,
    Unsupported,
    check_supported,
)
from sim_models.fmu.description import Fmu, FmuError, described
from sim_models.fmu.mapping import Map, MappedVariable, Moved, beside, mapped
from sim_models.fmu.run import run
from sim_models.fmu.schedule import scheduled

PACKAGE = "fmpy"
# A drive that yields has two angles, and a released linkage none that is told.
LACKS: frozenset[Feature] = frozenset({"drive_compliance", "backlash", "released"})


class FmuEngine(Engine):
    """One FMU with its map."""

    package = PACKAGE
    capabilities = Capabilities(rigid=Scope.of([("ideal", "driven")], [f for f in FEATURES if f not in LACKS]))

    def __init__(self, name: str, fmu: Fmu, columns: Map) -> None:
        self.name, self.fmu, self.columns = name, fmu, columns

    def simulate(self, request: Request) -> Trace:
        """Run one request.  Raises SimulationError, Unsupported (FmuError for the FMU and its map)."""
        check_supported(self, request)
        check_request(request)
        drives, signals = self._drives(request), self.columns.signals(request.mechanism)
        times, angles = request.schedule.time, request.schedule.crank_angle
        plan = scheduled(self.columns, drives, times, request.step)
        found = run(self.columns, [links for links, _ in drives], plan, [link.variable for link in signals.values()])
        at = plan.place(times)
        told = request.motor if request.mechanism.cranked else drives[0][1]
        assert told is not None  # nothing is let go
        settings: dict[str, SettingValue] = {"step": plan.step, "fmi": self.fmu.fmi, "map": str(self.columns.path)}
        return Trace(
            simulator=f"fmu:{self.fmu.path}",
            version=self.fmu.made_by or "unknown",
            joint_model="ideal",
            motion="driven",
            crank_angle=told.positions(times) if angles is None else angles.copy(),
            time=times,
            signals={name: link.si(found[at, k]) for k, (name, link) in enumerate(signals.items())},
            settings=settings,
        )

    def _drives(self, request: Request) -> list[tuple[Mapping[Moved, MappedVariable], DriveMotion]]:
        """The inputs of each motor, and how it moves.  Raises FmuError, and Unsupported where there is none."""
        m, schedule = request.mechanism, request.schedule
        if schedule.lets_go:
            raise Unsupported(f"fmu:{self.fmu.path}: {m.name} has no drive, and an FMU is driven; give it one")
        if any(schedule.rates.values()):
            raise Unsupported(
                f"fmu:{self.fmu.path}: an FMU starts in its own state; leave out initial of {m.name}, or use another"
                " simulator"
            )
        if schedule.crank is None and not (m.cranked and self.columns.inputs):
            links = self.columns.drives(m, schedule.drives)
            return [(links[name], motor) for name, motor in schedule.drives.items()]
        motor = request.motor
        assert motor is not None  # only what moves is supported
        if not self.columns.inputs:
            raise FmuError(f"{self.columns.path}: has [drives], of several, and {m.name} has a crank; give [inputs]")
        return [(self.columns.inputs, motor)]


def opened(rest: str) -> FmuEngine:
    """The engine of ``fmu:<rest>``: the path of an FMU, and after ``::`` that of its map.

    Raises FmuError, or MapError for the map's file.
    """
    path, _, columns = rest.partition(SEPARATOR)
    if not path:
        raise FmuError("fmu: names no file; give fmu:FILE, such as fmu:linkage.fmu")
    fmu = described(Path(path))
    return FmuEngine(f"fmu:{rest}", fmu, mapped(fmu, Path(columns) if columns else beside(fmu.path)))

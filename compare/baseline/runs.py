"""What a baseline holds of a case: which runs, and each run's reaction forces as a table.

Ideal joints are driven; joints with clearance rest in static equilibrium under load, the only motion in which every
engine gives the same direction to many digits.  A pin that bounces repeats only on average, so such a run keeps
averages over its revolutions.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from pydantic import JsonValue

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.initial import set_off
from analytic.kinematics.reach import usual_angles
from analytic.kinematics.schedule import Schedule
from analytic.mechanism import Drive, Load, Mechanism
from analytic.mechanism.file import load, shipped_cases
from analytic.mechanism.signals import named
from compare.baseline.file import UNDIRECTED, StoredRun
from compare.recorded.errors import DataError
from compare.recorded.table import Table
from compare.results.crosscheck import Failure
from compare.schedules import FREE_TIME, over_time
from compare.simulations import ContactTrace, Resolve, simulate
from sim_models.common.rates import with_rates
from sim_models.engine import (
    JOINT_MODELS,
    TOUCHING,
    Engine,
    Request,
    SimulationError,
    Trace,
    Unsupported,
    check_supported,
)

TABLE_ROWS = 36  # of a table, at most
NO_FORCE = 1e-6  # of the run's largest force: a joint below it carries none
IMPACT_REVOLUTIONS = 40  # of an impacting run
SAMPLES_A_REVOLUTION = 360  # of each of them


@dataclass(frozen=True)
class Loaded:
    """The clearance (m) and the further loads by which the pins of a shipped case rest against their bearings."""

    clearance: Mapping[str, float]
    loads: tuple[Load, ...] = ()


LOADED = {
    "2r-arm": Loaded({"K": 2e-4}),
    "3-rpr": Loaded({"C1": 2e-4}),
    "3-rrr": Loaded({"C1": 2e-4}),
    "five-bar": Loaded({"P": 2e-4}),
    "crank-rocker": Loaded({"B": 5e-4}, (Load(body="follower", torque=-2.0),)),
    "pendulum": Loaded({"O": 5e-4}),
    "six-bar": Loaded({"B": 5e-4}),
    "slider-crank": Loaded({"B": 5e-4}, (Load(body="slider", force=(-100.0, 0.0)),)),
}


@dataclass(frozen=True)
class Setup:
    """One run to make; ``added`` is what it has that the case has not, as the file says it."""

    request: Request
    added: Mapping[str, JsonValue] = field(default_factory=dict)
    impacting: bool = False

    @property
    def name(self) -> str:
        """What the run is called in the file."""
        return f"{self.request.joint_model}, {'impacting' if self.impacting else self.request.motion}"


def setups(mechanism: Mechanism) -> list[Setup]:
    """The runs of a case, ideal first; one that no crank moves has its drives at their speeds in all of them.

    Raises AssemblyError where the case cannot be assembled.
    """
    assembly = Assembly(mechanism)
    if not assembly.structure.by_crank:
        return list(_over_time(mechanism, set_off(assembly, over_time(assembly))))
    theta = _thinned(usual_angles(assembly))
    runs = []
    if mechanism.speed is not None:
        runs.append(Setup(Request(mechanism.tight(), "ideal", Schedule.at_angles(mechanism, theta))))
    else:
        swing = set_off(assembly, Schedule.released(mechanism, _thinned(FREE_TIME)))
        runs.append(Setup(Request(mechanism.tight(), "ideal", swing)))
    loaded = _loaded(mechanism)
    if loaded.clearance:
        added: dict[str, JsonValue] = {"clearance": dict(loaded.clearance)}
        if loaded.loads:
            added["load"] = [load.model_dump(exclude_unset=True, mode="json") for load in loaded.loads]
        at_rest = mechanism.with_clearances(loaded.clearance).replace(loads=mechanism.loads + loaded.loads)
        resting = Schedule.at_angles(at_rest, theta, at_rest=True)
        runs += [Setup(Request(at_rest, model, resting), added) for model in JOINT_MODELS[1:]]
    if _shipped(mechanism) and mechanism.name == "crank-rocker":
        runs += _impacting(mechanism)
    return runs


def _over_time(mechanism: Mechanism, schedule: Schedule) -> Iterator[Setup]:
    """Drives along their courses, with ideal joints and, where all freedoms have a drive, with clearance."""
    ideal = Request(mechanism.tight(), "ideal", replace(schedule, time=_thinned(schedule.time)))
    yield Setup(ideal)
    loaded = _loaded(mechanism)
    if loaded.clearance and len(schedule.drives) == len(Assembly(mechanism).structure.inputs):
        loose = mechanism.with_clearances(loaded.clearance)
        for model in JOINT_MODELS[1:]:
            yield Setup(replace(ideal, mechanism=loose, joint_model=model), {"clearance": dict(loaded.clearance)})


def _shipped(mechanism: Mechanism) -> bool:
    return mechanism.name in shipped_cases() and mechanism == load(mechanism.name)


def _loaded(mechanism: Mechanism) -> Loaded:
    """The clearance and loads by which the pins of a case rest against their bearings."""
    shipped = _shipped(mechanism) and mechanism.name in LOADED
    return LOADED[mechanism.name] if shipped else Loaded(mechanism.clearances)


def _impacting(mechanism: Mechanism) -> Iterator[Setup]:
    """600 rpm, 0.5 mm in B: its pin loses contact several times a revolution, and damping is too weak to hold
    it down.
    """
    fast = mechanism.with_clearances({"B": 5e-4}).with_joint("B", contact_damping=30.0)
    fast = fast.replace(drive=Drive(joint=mechanism.drive_joint.name, speed=20 * np.pi))
    added: dict[str, JsonValue] = {
        "speed": 20 * np.pi,
        "clearance": {"B": 5e-4},
        "contact_damping": 30.0,
        "revolutions": IMPACT_REVOLUTIONS,
    }
    theta = np.arange(SAMPLES_A_REVOLUTION * IMPACT_REVOLUTIONS) * (2 * np.pi / SAMPLES_A_REVOLUTION)
    for model in filter(TOUCHING["contact_law"].__contains__, JOINT_MODELS):
        request = Request(fast, model, Schedule.at_angles(fast, theta), lead_in=2 * np.pi, watched=True)
        yield Setup(request, added, impacting=True)


def _thinned(grid: np.ndarray) -> np.ndarray:
    return grid[:: -(-grid.size // TABLE_ROWS)]


def simulated(
    mechanism: Mechanism, simulator: str, resolve: Resolve, more: Sequence[str] = ()
) -> tuple[str, list[StoredRun]]:
    """The engine's version, and the runs of a case in it, with ``more`` signals on request of those that move; what it
    does not support is listed without a table.

    Raises SimulatorMissing or Unsupported for the engine, SimulationError where a run fails.
    """
    engine, version, runs = resolve(simulator), "", []
    for setup in setups(mechanism):
        request = setup.request
        why = not_run(simulator, engine, request)
        if why:
            runs.append(StoredRun(setup.name, setup.added, skipped=why))
            continue
        trace = _trace(engine, request)
        version = trace.version
        runs.append(_averages(setup, trace) if setup.impacting else _table(setup, trace, more))
    return version, runs


def not_run(simulator: str, engine: Engine, request: Request) -> str:
    """Why an engine does not run a request, in a sentence; empty if it does."""
    if (request.joint_model, request.motion) not in engine.capabilities.runs:
        return f"{simulator} does not simulate {request.joint_model} joints in {request.motion} motion"
    try:
        check_supported(engine, request)
    except Unsupported as error:
        return str(error)
    return ""


def _trace(engine: Engine, request: Request) -> Trace:
    outcome = simulate(engine.name, request, lambda name: engine)
    if isinstance(outcome, Failure):
        raise Unsupported(outcome.why) if outcome.unsupported else SimulationError(outcome.why)
    return outcome


def _force(trace: Trace, joint: str) -> np.ndarray:
    return trace.signals[f"reaction_{joint}_x"] + 1j * trace.signals[f"reaction_{joint}_y"]


def _reaction(joint: str, force: np.ndarray, least: float = 0.0) -> dict[str, np.ndarray]:
    """Direction (N,) deg of a joint's reaction where it is above ``least`` (N) and its limit, and its size (N,) N."""
    size = np.abs(force)
    known = size > max(UNDIRECTED * np.nanmax(size), least)
    angle = np.where(known, np.degrees(np.angle(force)), np.nan)
    return {f"reaction_{joint}_angle [deg]": angle, f"reaction_{joint}_magnitude [N]": size}


def _table(setup: Setup, trace: Trace, more: Sequence[str]) -> StoredRun:
    """Direction (deg) and size (N) of every reaction, and where it moves ``more`` signals (SI), a row for each crank
    angle (deg), or time (s) of a released linkage.
    """
    forces = {joint.name: _force(trace, joint.name) for joint in setup.request.mechanism.joints}
    largest = max(float(np.abs(f).max()) for f in forces.values())
    schedule = setup.request.schedule
    angles = {"crank_angle [deg]": np.degrees(trace.crank_angle)}
    columns = angles if schedule.turns_evenly else {"time [s]": schedule.time}
    for joint, force in forces.items():
        columns |= _reaction(joint, force, NO_FORCE * largest)
    if trace.motion == "driven":
        m = setup.request.mechanism
        columns |= _named(m, with_rates(m, trace, more), more, columns)
    return StoredRun(setup.name, setup.added, tuple(columns), np.column_stack(list(columns.values())))


def _named(
    mechanism: Mechanism, signals: Mapping[str, np.ndarray], more: Sequence[str], columns: Iterable[str]
) -> dict[str, np.ndarray]:
    """Those of ``more`` signals that there are and no column has already, by name and unit."""
    known = named(mechanism.bodies, mechanism.joints, mechanism.drives, mechanism.sensors)
    there = {column.partition(" [")[0] for column in columns}  # and of a tight joint rounding is no displacement
    there |= {n for n, s in known.items() if s.kind == "clearance" and not mechanism.joint(s.place).clearance}
    return {f"{name} [{known[name].unit}]": signals[name] for name in more if name in signals and name not in there}


def of_results(mechanism: Mechanism, table: Table, more: Sequence[str] = ()) -> StoredRun:
    """The reactions that a file of results has, and ``more`` of its signals, as a run: a row for each of at most ROWS
    of its samples.

    Raises DataError where it has none.
    """
    encoder = table.values.get(f"{mechanism.driven}_angle") if mechanism.cranked else None
    size = next(iter(table.values.values())).size
    every = slice(None, None, -(-size // TABLE_ROWS))
    if table.time.size:
        columns = {"time [s]": table.time[every]}
    elif encoder is not None:
        columns = {"crank_angle [deg]": np.degrees(encoder[every])}
    else:
        raise DataError(f"the results of {mechanism.name} have neither time nor the crank's angle; add one")
    for joint in (joint.name for joint in mechanism.joints):
        sides = [table.values.get(f"reaction_{joint}_{axis}") for axis in ("x", "y")]
        if sides[0] is None or sides[1] is None:
            continue
        columns |= _reaction(joint, (sides[0] + 1j * sides[1])[every])
    columns |= {name: values[every] for name, values in _named(mechanism, table.values, more, columns).items()}
    if len(columns) == 1 or not all(np.all(np.isfinite(v)) for n, v in columns.items() if not n.endswith("[deg]")):
        raise DataError(
            f"the results of {mechanism.name} have no reaction in every row with both components, reaction_<joint>_x"
            " and _y; add them"
        )
    return StoredRun("recorded", {}, tuple(columns), np.column_stack(list(columns.values())))


def _averages(setup: Setup, trace: Trace) -> StoredRun:
    """Averages of each joint with clearance over the revolutions: root mean square force and peak force (N), the share
    of time without contact, and impacts.

    A rigid contact (no stiffness in its settings) has impulses, whose force is a matter of the time step: none is kept.
    """
    columns: dict[str, float] = {}
    contact = trace.contact if isinstance(trace, ContactTrace) else None
    for joint, share in trace.free_share.items():
        known = contact.joints[joint].statistics if contact is not None else {}
        average = {name: each.value or 0.0 for name, each in known.items()}
        if "contact_stiffness" in trace.settings:
            columns[f"reaction_{joint}_rms [N]"] = float(np.sqrt(np.mean(np.abs(_force(trace, joint)) ** 2)))
            columns |= {f"reaction_{joint}_peak [N]": average["peak_force"]} if average else {}
        columns[f"free_share_{joint} [1]"] = share
        if average:
            columns[f"impacts_{joint} [per turn]"] = average["impacts"]
    return StoredRun(setup.name, setup.added, tuple(columns), np.array([list(columns.values())]))

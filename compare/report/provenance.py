"""Where a number of a result comes from: equation and module on the analytic side, engine and settings on the simulated
one.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise

import numpy as np

from analytic.mechanism import Mechanism
from analytic.mechanism.signals import Signal
from compare.faults import OptionError
from compare.quantities import Quantity, apart, quantities, shown
from compare.results.crosscheck import CrossCheck, Discrepancy, Run
from sim_models.engine import SettingValue

Samples = Mapping[str, np.ndarray]
SETTING_UNITS = {"contact_stiffness": "N/m", "contact_damping": "N.s/m", "step": "s"}
FORCE = "Eqs. 9-14, inertia forces and force balance of the {} linkage; analytic/paper/kinetostatics.py"
REST = "Eqs. 11-14, static force balance of the {} linkage; analytic/paper/kinetostatics.py"
MOTION = "loop closure of the {} linkage; analytic/kinematics/motion.py"
CONFIGURATION = {"first_order": "ideal", "equilibrium": "displaced"}  # whose reactions an analytic model gives
GAP = {
    "first_order": "Eq. 8: the clearance along the ideal linkage's reaction; analytic/paper/clearance.py",
    "equilibrium": "Eq. 8 along the displaced linkage's own reaction; analytic/paper/clearance.py",
}


def explain(
    result: CrossCheck, signal: str, at: float, joint_model: str | None = None, simulator: str | None = None
) -> str:
    """Text that shows a signal at a crank angle (deg; s where the linkage swings) in every run that has it.  Raises
    OptionError.
    """
    runs = _chosen(result.runs, joint_model, simulator)
    having = [run for run in runs if signal in run.analytic and signal in run.simulated]
    if not having:
        names = dict.fromkeys(name for run in runs for name in run.simulated if name in run.analytic)
        raise OptionError(f"--signal {signal}: no such signal in {_runs(runs)}; the signals are {', '.join(names)}")
    quantity = quantities(result.mechanism).get(signal)
    if quantity is None:
        raise OptionError(
            f"--signal {signal}: not a signal of the mechanism {result.mechanism.name} that the result is about"
        )
    lines = [
        f"{signal}: {quantity.label}{_between(result.mechanism, quantity)}",
        f"{result.case}: {result.command}".rstrip(": "),
    ]
    if result.versions:
        lines.append("made with " + ", ".join(f"{package} {version}" for package, version in result.versions.items()))
    for run in having:
        lines += ["", *_explained(result, run, quantity, at)]
    return "\n".join(lines)


def _chosen(runs: Sequence[Run], joint_model: str | None, simulator: str | None) -> list[Run]:
    for option, wanted, names in (
        ("joint", joint_model, [run.joint_model for run in runs]),
        ("simulator", simulator, [run.simulator.name for run in runs]),
    ):
        if wanted is not None and wanted not in names:
            raise OptionError(
                f"--{option} {wanted}: not in this result; it has {', '.join(dict.fromkeys(names)) or 'no runs'}"
            )
    found = [run for run in runs if joint_model in (None, run.joint_model) and simulator in (None, run.simulator.name)]
    if not found:
        raise OptionError(
            f"--simulator {simulator} --joint {joint_model}: not together in this result; it has {_runs(runs)}"
        )
    return found


def _runs(runs: Iterable[Run]) -> str:
    return "; ".join(f"{run.simulator.name}, {run.joint_model}" for run in runs) or "no runs"


def _between(mechanism: Mechanism, quantity: Quantity) -> str:
    """Which body pushes which, for what belongs to a joint."""
    for joint in mechanism.joints:
        if quantity.place == f"at {joint.name}":
            return f" (force of {joint.bodies[0]} on {joint.bodies[1]})"
        if quantity.place == f"in {joint.name}":
            return f" (pin centre of {joint.bodies[0]} minus that of {joint.bodies[1]})"
    return ""


def _explained(result: CrossCheck, run: Run, quantity: Quantity, at: float) -> Iterator[str]:
    k, where = _sample(run, at, swings=result.swings and run.motion == "driven")
    yield f"{run.simulator.name} {run.simulator.version}, {run.joint_model} joints, {run.motion}: {where}"
    if str(k) in run.flags:
        yield f"  flagged       no number on either side: {run.flags[str(k)]}"
        return
    analytic, simulated = (_number(side[quantity.signal][k]) for side in (run.analytic, run.simulated))
    row = next((row for row in run.discrepancies if row.signal == quantity.signal), None)
    unit = (
        row.unit if row else next(si for si in (*_SI, quantity.unit.replace("·", ".")) if shown(si)[0] == quantity.unit)
    )
    yield f"  analytic      {_both(analytic, unit)}"
    yield from (f"                {line}" for line in _analytic_source(run, quantity, result.swings))
    if _bends(run) and not (quantity.name.startswith("reaction") or quantity.name == "drive torque"):
        yield (
            "                plus the elastic displacement of links and joints (Eqs. 1-7); analytic/paper/compliance.py"
        )
    yield from _components(run.analytic, quantity, result.signals[quantity.signal], k)
    yield f"  simulated     {_both(simulated, unit)}"
    yield f"                sim_models/{run.simulator.name}/{'beams' if _bends(run) else 'engine'}.py; {_settings(run)}"
    yield from _components(run.simulated, quantity, result.signals[quantity.signal], k)
    if analytic is not None and simulated is not None:
        less = ", less whole turns" if quantity.angular and abs(simulated - analytic) > math.pi else ""
        yield (
            f"  difference    {_both(apart(simulated, analytic, quantity.angular), unit, '+')}, simulated minus"
            f" analytic{less}"
        )
    yield from _verdict(row, run, result.swings and run.motion == "driven")


_SI = ("rad", "m")


def _sample(run: Run, at: float, swings: bool) -> tuple[int, str]:
    """Index of the sample nearest to ``at`` (deg or s), and words for it.  Raises OptionError outside the run."""
    time = [] if run.time is None else run.time.tolist()
    places = time if swings else [math.degrees(theta) for theta in run.crank_angle]
    unit, name = ("s", "time") if swings else ("deg", "crank angle")
    away = [abs(place - at) if swings else abs((place - at + 180) % 360 - 180) for place in places]
    k = min(range(len(places)), key=away.__getitem__) if places and math.isfinite(at) else -1
    ordered = sorted(places)
    spacing = max((b - a for a, b in pairwise(ordered)), default=1.0)
    if k < 0 or away[k] > spacing / 2 * (1 + 1e-9):
        span = f"{ordered[0]:.6g} to {ordered[-1]:.6g} {unit}" if places else "at no sample"
        raise OptionError(f"--at {at:g}: the run {run.simulator.name}, {run.joint_model} has samples from {span}")
    words = f"{name} {places[k]:.8g} {unit}, sample {k + 1} of {len(places)}"
    return k, words if away[k] < 1e-6 else f"{words} (the nearest to {at:g} {unit}; nothing is interpolated)"


def _analytic_source(run: Run, quantity: Quantity, swings: bool) -> Iterator[str]:
    """Model, equation and module of an analytic number."""
    if swings and run.motion == "driven":
        yield "equation of motion of the released linkage, integrated; analytic/beyond_paper/released.py"
        return
    loose = any(run.clearance.values())
    model = run.analytic_model if loose else "ideal"
    if quantity.name in ("displacement x", "displacement y"):
        yield GAP.get(model, "no clearance: zero")
    elif quantity.name == "rotation":
        yield (
            "the body's angle in the displaced linkage minus that in the ideal one;"
            f" {GAP.get(model, 'no clearance: zero')}"
        )
    elif quantity.name in (
        "reaction angle",
        "reaction force",
        "reaction x",
        "reaction y",
        "reaction moment",
        "drive torque",
    ):
        yield (REST if run.motion == "static" else FORCE).format(CONFIGURATION.get(model, "ideal"))
        if model == "equilibrium":
            yield f"displaced by {GAP[model]}"
        elif model == "first_order":
            yield "first order: reactions as without clearance; analytic/paper/clearance.py"
    else:
        yield MOTION.format("displaced" if loose else "ideal")
        if loose:
            yield f"displaced by {GAP[model]}"


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _bends(run: Run) -> bool:
    """Whether the links of a run were made of beams."""
    return "links" in run.settings


def _components(side: Samples, quantity: Quantity, signal: Signal, k: int) -> Iterator[str]:
    """The components that a direction or a size was made of."""
    made_of = {"reaction angle": "atan2(y, x)", "reaction force": "hypot(x, y)"}.get(quantity.name)
    if made_of is None:
        return
    names = [signal.sibling(axis).name for axis in ("x", "y")]
    x, y = (_number(side[name][k]) for name in names)
    yield f"                {made_of} of {names[0]} = {_plain(x)} N, {names[1]} = {_plain(y)} N"


def _settings(run: Run) -> str:
    sizes = [f"clearance_{joint} = {1e3 * size:.6g} mm" for joint, size in run.clearance.items()]
    rest = [
        f"{name} = {_value(value)} {SETTING_UNITS.get(name, '')}".rstrip()
        for name, value in run.settings.items()
        if value is not None
    ]
    return ", ".join([*sizes, *rest]) or "no settings"


def _value(value: SettingValue) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {_value(item)}" for name, item in value.items())
    return f"{value:.6g}" if isinstance(value, int | float) else str(value)


def _verdict(row: Discrepancy | None, run: Run, swings: bool) -> Iterator[str]:
    if row is None:
        yield "  verdict       not judged on its own in this run"
        return
    place = "-"
    if row.at_crank_angle is not None:
        at = np.flatnonzero(run.crank_angle == row.at_crank_angle)
        place = (
            f"{run.time[at[0]]:.6g} s"
            if swings and run.time is not None and at.size
            else f"{math.degrees(row.at_crank_angle):.6g} deg"
        )
    yield f"  worst         {_both(row.max, row.unit, '+')} at {place}: the largest share of its tolerance in the run"
    yield f"  tolerance     {_both(row.tolerance, row.unit)} there"
    yield (
        f"  verdict       {row.verdict}" + (f": {row.reason}" if row.reason else "") + " (of this signal, over the run)"
    )


def _both(value: float | None, unit: str, sign: str = "") -> str:
    """A number for people, and in SI."""
    name, factor = shown(unit)
    if value is None:
        return "no number"
    people = f"{factor * value:{sign}.7g} {name.replace('·', '.')}"
    return people if factor == 1 else f"{people}  ({_plain(value, sign)} {unit})"


def _plain(value: float | None, sign: str = "") -> str:
    return "no number" if value is None else f"{value:{sign}.9g}"

"""Texts that every engine's export writes: the expected signals as CSV, and JSON that a person can read."""

from __future__ import annotations

import csv
import importlib.resources
import io
import json
import re
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from analytic.mechanism import Joint, Load, Mechanism
from analytic.mechanism.signals import named, position
from analytic.mechanism.varying import Fading
from sim_models.engine import Request, Trace

ALIKE = re.compile(r"^from sim_models\.standalone\.alike import .*\n", re.MULTILINE)  # in a script
BEYOND = "beyond_mjcf"  # the text of an exported MJCF file that has, as JSON, what MJCF has no words for


def expected(trace: Trace, request: Request, order: Iterable[int] | None = None) -> str:
    """The trace of a request as CSV with all digits, headed ``signal [unit]``, rows in this order; left out, in the
    order of passing.

    Where no crank tells where the linkage is, there is no column of its angle; where one does, none of the joints'
    positions, which then say nothing new.
    """
    crank, m = request.schedule.crank is not None, request.mechanism
    told = {position(joint).name for joint in m.joints} if crank else set()
    units = {name: signal.unit for name, signal in named(m.bodies, m.joints, m.drives, m.sensors).items()}
    units |= {"crank_angle": "rad", "time": "s"}
    columns = {
        **({"crank_angle": trace.crank_angle} if crank else {}),
        **({} if trace.time is None else {"time": trace.time}),
        **{name: values for name, values in trace.signals.items() if name not in told},
    }
    if order is None:
        order = range(trace.crank_angle.size) if trace.time is None else np.argsort(trace.time, kind="stable").tolist()
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(f"{name} [{units[name]}]" for name in columns)
    table.writerows([repr(float(values[i])) for values in columns.values()] for i in order)
    return text.getvalue()


def written(folder: Path, files: Mapping[str, str], script: str) -> list[Path]:
    """Texts, and as ``run.py`` the script of :mod:`sim_models.standalone`, with what all of these have alike in it, as
    files in an existing folder.  Raises OSError.
    """
    scripts = importlib.resources.files("sim_models.standalone")
    run, alike = (scripts.joinpath(name).read_text(encoding="utf-8") for name in (script, "alike.py"))
    run = ALIKE.sub(lambda _: alike.partition("import annotations\n\n")[2], run)
    for name, content in {**files, "run.py": run}.items():
        (folder / name).write_text(content, encoding="utf-8", newline="\n")
    return [folder / name for name in (*files, "run.py")]


def head(request: Request, trace: Trace) -> dict[str, object]:
    """What a run is, and what made it, as an export's JSON begins."""
    return {
        "title": f"{request.mechanism.name}, {request.joint_model} joints, {request.motion}",
        "version": f"{trace.simulator} {trace.version}",
        "units": trace.settings["units"],
        "settings": dict(trace.settings),
        "motion": request.motion,
    }


def lines(model: Mapping[str, object]) -> str:
    """JSON with a line for each thing."""
    return "{\n" + ",\n".join(f"{json.dumps(name)}: {_block(value)}" for name, value in model.items()) + "\n}\n"


def _block(value: object) -> str:
    if isinstance(value, dict) and value and isinstance(next(iter(value.values())), dict | list | tuple):
        return (
            "{\n" + ",\n".join(f"  {json.dumps(k)}: {json.dumps(v, allow_nan=False)}" for k, v in value.items()) + "\n}"
        )
    if isinstance(value, list) and value and isinstance(value[0], dict | tuple):
        return "[\n" + ",\n".join(f"  {json.dumps(v, allow_nan=False)}" for v in value) + "\n]"
    return json.dumps(value, allow_nan=False)


def varies(m: Mechanism, load: Load, fades: Fading) -> dict[str, object]:
    """What a load varies over, its stretch or table, whether it opposes the motion, and where one that does fades."""
    over = m.load_quantities[load.over] if load.over else None
    return {
        "over": over
        and {"kind": over.kind, "body": over.body, "less": over.less, "joint": over.slide.name if over.slide else ""},
        "stretch": None if load.start is None else [load.start, load.end],
        "table": load.table,
        "opposes": load.opposes,
        "fades": fades,
    }


def stops(joint: Joint) -> list[list[float]]:
    """Of each end of a joint's stops the way in which it pushes the second body (1, -1), where it is (rad; m), its
    stiffness and its damping.
    """
    return [[way, way * depth, stop.stiffness, stop.damping] for stop in joint.stops for way, depth in stop.depths(0.0)]

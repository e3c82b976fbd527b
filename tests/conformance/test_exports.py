"""What every engine exports runs in the bare engine, without this project, and gives the same numbers."""

from __future__ import annotations

import ast
import csv
import json
import shlex
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from analytic.kinematics.assembly import Assembly
from analytic.mechanism import Drive, Load, Mechanism, Stop
from analytic.mechanism.file import load, loads
from asked import request_of
from compare.cli.export import export
from compare.results.export import Exported
from document_faults import faults
from engine_checks import at_speed
from linkages import curved_slider, inverted_slider
from marks import slow_but
from maximal import Maximal
from several_linkages import CASES, KNOTS, SHIPPED, SLIDES, referee, sprung, third_bar
from several_truths import SWINGING, forces_agree, turned_round
from sim_models.common.units import Units
from sim_models.engine import (
    ENGINES,
    JOINT_MODELS,
    MOTIONS,
    JointModel,
    Request,
    Trace,
    Unsupported,
    check_exported,
    declared,
    engine,
)
from tests.evidence.validation.files import apart

ALONE = """
import runpy, sys
class Unimportable:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ("analytic", "sim_models", "compare"):
            raise ImportError(f"{name} is not for the bare engine")
sys.meta_path.insert(0, Unimportable())
for path in sys.argv[1:]:
    runpy.run_path(path, run_name="__main__")
"""
FILES = {"mujoco": {"model.xml", "start.json"}, "exudyn": {"model.json"}, "pybullet": {"start.json"}}
EXPORTING = [name for name in ENGINES if declared(name).capabilities.export is not None]

# ---------------------------------------------------------------- what is exported, of a crank

SHORT, TURN = np.radians([30.0, 40.0, 35.0]), np.radians([0.0, 50.0, 30.123])
FEW = np.array([0.1, 0.02, 0.06])  # s
PAPER = load("paper").with_clearances({"B": 1e-3})
ROCKER = load("crank-rocker").with_clearances({"B": 2e-4})
CURVED = curved_slider()
LAWS = inverted_slider().with_clearances({"A": 1e-4})  # prismatic between moving bodies, and every joint law
RUBBED = LAWS.with_joint("A", friction=0.1)
SOFT = PAPER.with_clearances({}).with_joint("A", radial_stiffness=1e5).with_joint("E", radial_stiffness=3e5)
GRIPPED = PAPER.with_joint("A", friction_radius=5e-3).with_joint("E", friction_radius=2e-3, friction_torque=0.05)
PENDULUM = load("pendulum").with_clearances({"O": 5e-4})
SLIDER = at_speed(load("slider-crank"), 100.0).with_clearances({"A": 1e-4})
MARKED = ROCKER.with_body("coupler", com=(0.1, 0.02), marker=(0.05, -0.01)).replace(
    loads=(Load(body="coupler", point="com", force=(1.0, 20.0)),)
)
YIELDING = at_speed(PAPER, 20.0, stiffness=2000.0)
COURSE = (KNOTS, np.radians(30.0) + 1.5 * KNOTS + 4.0 * KNOTS**2)
KNOWN = ROCKER.with_joint("B", contact_stiffness=1e6, contact_damping=300.0)
SPRING = {
    "bodies": ("crank", "follower"), "points": ("A", "E"), "stiffness": 200.0, "length": 0.05, "damping": 3.0
}  # fmt: skip
SPRUNG = PAPER.replace(springs=[SPRING])
GASSED = (
    at_speed(load("slider-crank"), 100.0)
    .with_clearances({"B": 5e-4})
    .replace(
        loads=(
            Load(body="slider", force=(-1.0, 0.0), over="position_S", table=((0.07, 900.0), (0.17, 100.0))),
            Load(body="rod", force=(30.0, 0.0), opposes=True, over="crank_angle", start=0.0, end=3.0),
            Load(body="crank", torque=-2.0, opposes=True, over="rod_y", start=-1.0, end=1.0),
            Load(body="rod", torque=1.0, over="rod_angle", table=((-3.0, 0.5), (0.0, 1.0), (3.0, 2.0))),
            Load(body="rod", torque=1.0, over="position_A", table=((-3.0, 0.5), (0.0, 1.0), (3.0, 2.0))),
        )
    )
)
PULSED = at_speed(load("slider-crank"), 20.0).replace(
    loads=(Load(body="slider", force=(-50.0, 10.0), over="time", table=((0.0, 1.0), (0.004, 2.0), (0.02, 0.0))),)
)
SPUN = load("pendulum").replace(loads=(Load(body="pendulum", torque=1.0, over="time", start=0.123, end=0.4),))
BRAKED = load("pendulum").replace(
    loads=(
        Load(body="pendulum", torque=0.05, opposes=True, over="pendulum_angle", start=-2.0, end=-0.5),
        Load(body="pendulum", point="com", force=(0.4, 0.0), opposes=True),
    )
)
STOPPED = (
    at_speed(load("slider-crank"), 60.0)
    .with_clearances({})
    .replace(
        stops=(
            Stop(joint="S", end=0.13, stiffness=4e4, damping=150.0),
            Stop(joint="B", start=-0.3, end=0.25, stiffness=20.0, damping=0.05),
        )
    )
)
ONTO = np.radians([0.0, 20.0, 340.0, 100.0])  # where stops push, and where none does
CAUGHT = load("pendulum").replace(stops=(Stop(joint="O", start=-1.0, stiffness=200.0, damping=0.05),))
TINY = Units(length=2.0**10, mass=2.0**20)  # a metre and a kilogram of the linkage are one of these
HUGE = Units(length=2.0**-6, mass=2.0**-16)
CRANKED: dict[str, Request] = {
    **{
        f"paper, {model}, {motion}": request_of(PAPER, model, motion, SHORT)
        for model in JOINT_MODELS
        for motion in MOTIONS
    },
    **{f"crank-rocker, {m}": request_of(ROCKER, m, "driven", TURN, lead_in=0.3) for m in ("ideal", "massless-link")},
    **{f"every joint law, {m}": request_of(RUBBED, "contact", m, SHORT) for m in MOTIONS},
    "every joint law without friction in contact, static": request_of(LAWS, "contact", "static", SHORT),
    **{f"every joint law, ideal, {m}": request_of(LAWS, "ideal", m, SHORT) for m in MOTIONS},
    **{f"laws that are not linear, {m}": request_of(CURVED, "ideal", m, SHORT) for m in MOTIONS},
    **{f"soft bearings, {m}": request_of(SOFT, "ideal", m, SHORT) for m in MOTIONS},
    **{f"spring between points, {m}": request_of(SPRUNG, "contact", m, SHORT) for m in MOTIONS},
    "spring between points, ideal, driven": request_of(SPRUNG, "ideal", "driven", SHORT),
    **{f"friction that grows with reactions, {m}": request_of(GRIPPED, "ideal", m, SHORT) for m in MOTIONS},
    **{f"held more than once, {m}": request_of(third_bar(), "ideal", m, SHORT) for m in MOTIONS},
    **{f"tiny, {m}": TINY.request(request_of(SPRUNG, "spring-damper", m, SHORT)) for m in MOTIONS},
    **{f"course, {m}": request_of(at_speed(PAPER, "measured"), m, time=FEW, course=COURSE) for m in JOINT_MODELS},
    "every joint law, spring-damper": request_of(LAWS, "spring-damper", "driven", SHORT),
    "paper, backwards and faster": request_of(at_speed(PAPER, -60.0), "ideal", "driven", SHORT),
    "paper, led in from its middle": request_of(
        PAPER, "spring-damper", "driven", SHORT, start="centred", lead_in=0.1, step=5e-5
    ),
    "crank-rocker with a marker": request_of(MARKED, "ideal", "driven", TURN),
    "slider-crank": request_of(SLIDER, "ideal", "driven", TURN),
    "slider-crank, spring-damper": request_of(SLIDER, "spring-damper", "driven", SHORT),
    "slider-crank with weight": request_of(SLIDER.replace(gravity=(0.0, -9.81)), "contact", "static", SHORT),
    "six-bar": request_of(load("six-bar"), "ideal", "driven", np.radians([0.0, 40.0])),
    "linear contact": request_of(PAPER.with_joint("B", contact_damping=300.0), "contact", "driven", SHORT),
    "two gaps, backwards": request_of(
        at_speed(PAPER.with_clearances({"A": 1e-3, "B": 5e-4}), -3.0), "contact", "driven", SHORT
    ),
    "compliant drive": request_of(YIELDING, "spring-damper", "driven", SHORT),
    "compliant drive, led in": request_of(YIELDING, "ideal", "driven", SHORT, lead_in=0.1),
    "compliant drive, backwards": request_of(at_speed(PAPER, -3.0, stiffness=500.0), "ideal", "driven", SHORT),
    "compliant drive, static": request_of(YIELDING, "contact", "static", SHORT),
    "compliant drive, course": request_of(
        at_speed(PAPER, "measured", stiffness=2e3), "contact", time=FEW, course=COURSE
    ),
    "compliant drive, course, ideal": request_of(
        at_speed(MARKED, "measured", stiffness=200.0), "ideal", time=FEW, course=COURSE
    ),
    "impacts": request_of(ROCKER, "contact", "driven", SHORT, start="centred"),
    "impacts, led in": request_of(ROCKER, "contact", "driven", SHORT, start="centred", lead_in=1.0),
    "a gap in a bearing of known stiffness": request_of(
        KNOWN, "contact", "driven", SHORT, start="centred", lead_in=1.0
    ),
    "soft bearings beside a gap": request_of(SOFT.with_clearances({"B": 1e-3}), "contact", "driven", SHORT),
    "soft bearing beside a gap, spring-damper": request_of(
        PAPER.with_joint("A", radial_stiffness=1e6), "spring-damper", "driven", SHORT
    ),
    "soft bearing with clearance": request_of(
        PAPER.with_joint("B", radial_stiffness=1e6), "spring-damper", "driven", SHORT
    ),
    "friction that grows with reactions, contact": request_of(GRIPPED, "contact", "static", SHORT),
    "friction that grows with reactions, released": request_of(
        PENDULUM.with_joint("O", friction_radius=5e-3), time=np.array([0.03, 0.1, 0.2])
    ),
    "released": request_of(load("pendulum"), "ideal", time=np.array([0.3, 0.1, 0.5])),
    "released with a gap": request_of(PENDULUM, "contact", time=np.array([0.0, 0.1, 0.2])),
    "released with a gap, spring-damper": request_of(PENDULUM, "spring-damper", time=np.array([0.03, 0.01])),
    "course, every joint law": request_of(at_speed(LAWS, "measured"), "ideal", time=FEW, course=COURSE),
    "held more than once, with a gap": request_of(
        third_bar().with_clearances({"f2": 1e-4}), "contact", "driven", SHORT
    ),
    **{f"loads that vary, {m}": request_of(GASSED, "spring-damper", m, SHORT) for m in MOTIONS},
    "a load over time": request_of(PULSED, "ideal", "driven", SHORT, lead_in=0.1),
    "loads that oppose, released": request_of(BRAKED, "ideal", time=np.linspace(0.02, 0.65, 5)),
    "a load over time, released": request_of(SPUN, "ideal", time=np.array([0.3, 0.1, 0.5])),
    **{f"stops, {m}": request_of(STOPPED, "ideal", m, ONTO) for m in MOTIONS},
    "stops beside a gap": request_of(STOPPED.with_clearances({"A": 1e-4}), "spring-damper", "driven", ONTO),
    "stops, released": request_of(CAUGHT, "ideal", time=np.linspace(0.02, 0.5, 9)),
    "a fast crank": request_of(load("slider-crank"), crank_angle=SHORT),
}

# ---------------------------------------------------------------- and of several drives

FIVE_BAR, ARM, PLATFORM = CASES["five-bar"], CASES["2r-arm"], CASES["3-rpr"]
GAPS = {"five-bar": {"P": 2e-4}, "3-rrr": {"C1": 2e-4}, "3-rpr": {"C1": 2e-4}, "2r-arm": {"K": 2e-4}}
MODELS: dict[str, tuple[JointModel, ...]] = {  # each pair of them once more, in another linkage
    "five-bar": JOINT_MODELS, "3-rrr": ("ideal", "spring-damper"), "3-rpr": ("ideal", "contact"),
    "2r-arm": ("ideal", "massless-link"),
}  # fmt: skip
GANTRY = loads(SLIDES)
LATE = {  # courses that begin late, with knots of their own
    "O": (np.linspace(7.0, 7.6, 31), -0.4 + np.linspace(0.0, 0.5, 31) ** 2),
    "K": (np.linspace(7.013, 7.6, 47), 1.2 - np.linspace(0.0, 0.7, 47) ** 2),
}


def rubbed(m: Mechanism) -> Mechanism:
    """The mechanism with friction, drag and a cubic spring in every joint."""
    turning = {"friction_torque": 0.02, "static_torque": 0.03, "stribeck_speed": 0.1, "drag": 0.01, "cubic": 0.3}
    for joint in m.joints:
        law = {"friction_torque": 0.5, "drag": 0.1, "cubic": 3.0} if joint.prismatic else turning
        m = m.with_joint(joint.name, **law)
    return m


def driven_at(m: Mechanism, **speeds: float | str) -> Mechanism:
    """The mechanism with these drives in place of its own."""
    return m.replace(drives=tuple(Drive(joint=joint, speed=speed) for joint, speed in speeds.items()))


def along(m: Mechanism) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Courses, from the assembly on and no straight lines, of all drives that are not free."""
    at, ways = Assembly(m).positions, KNOTS + 0.05 * np.sin(8 * KNOTS)
    return {d.joint: (KNOTS, at[d.joint] + float(d.speed) * ways) for d in m.drives if d.speed != "free"}


MOVED: dict[str, tuple[Mechanism, str, str]] = {
    **{f"{name}, {model}": (CASES[name].with_clearances(gap), model, "driven")
       for name, gap in GAPS.items() for model in MODELS[name]},
    **{f"{name}, {model}, at rest": (CASES[name].with_clearances(gap), model, "static")
       for name, gap in GAPS.items() for model in MODELS[name]},
    **{name: (m, "ideal", "driven") for name, m in CASES.items() if name not in SHIPPED},
    **{f"{name}, every law of a joint": (rubbed(CASES[name]), "ideal", "driven") for name in ("3-rpr", "five-bar")},
    "five-bar, two gaps": (FIVE_BAR.with_clearances({"A": 2e-4, "P": 1e-4}), "spring-damper", "driven"),
    "gantry": (GANTRY, "ideal", "driven"),
    "gantry with a free slide": (driven_at(GANTRY, X=0.2, Y="free", R=1.0), "ideal", "driven"),
    "2r-arm, told from the other side": (turned_round(ARM, "O", "K"), "ideal", "driven"),
    "five-bar, told from the other side": (turned_round(FIVE_BAR, "D", "A"), "ideal", "driven"),
    "3-rpr, told from the other side": (turned_round(PLATFORM, "S1", "A2"), "ideal", "driven"),
    "five-bar, a motor between bodies": (turned_round(driven_at(FIVE_BAR, D=1.0, A=-0.7), "A"), "ideal", "driven"),
    "five-bar, motors that turn what floats": (driven_at(FIVE_BAR, A=1.0, P=-0.7), "ideal", "driven"),
    "3-rpr, motors of both kinds": (driven_at(PLATFORM, S1=0.03, A2=0.1, C3=0.2), "ideal", "driven"),
    "soft bearing": (FIVE_BAR.with_joint("A", radial_stiffness=1e5), "ideal", "driven"),
    **{f"elbow free, {model}": (driven_at(ARM.with_clearances({"O": 2e-4}), O=1.5, K="free"), model, "driven")
       for model in ("ideal", "contact")},
    **{f"all free, {model}": (driven_at(ARM.with_clearances({"K": 2e-4}), O="free", K="free"), model, "driven")
       for model in ("massless-link", "spring-damper")},
    "one drive free": (driven_at(FIVE_BAR, D=2.0, E="free"), "ideal", "driven"),
    "one slide free": (driven_at(PLATFORM, S1=0.05, S2="free", S3=0.02), "ideal", "driven"),
    "one drive free, friction that grows with reactions": (
        driven_at(FIVE_BAR, D=2.0, E="free").with_joint("E", friction_radius=5e-3), "ideal", "driven"),
    "all free, with springs and dampers": (driven_at(sprung(FIVE_BAR), D="free", E="free"), "ideal", "driven"),
    "no drives": (SWINGING, "ideal", "driven"),
    "springs, at rest": (sprung(PLATFORM), "ideal", "static"),
    "every law of a joint, at rest": (rubbed(PLATFORM), "ideal", "static"),
    "soft bearing, at rest": (FIVE_BAR.with_joint("A", radial_stiffness=1e5), "ideal", "static"),
    "held more than once, at rest": (third_bar(), "ideal", "static"),
    "gantry, at rest": (GANTRY, "ideal", "static"),
}  # fmt: skip
SEVERAL: dict[str, Request] = {
    title: request_of(m, model, motion, time=FEW, courses=along(m)) for title, (m, model, motion) in MOVED.items()
}
SEVERAL |= {
    "late courses": request_of(ARM, time=np.array([7.4, 7.02, 7.58, 7.4]), courses=LATE),
    "impacts along courses": request_of(
        FIVE_BAR.with_clearances({"A": 2e-4}),
        "contact",
        time=np.array([0.1, 0.0, 0.05]),
        courses=along(FIVE_BAR),
        start="centred",
    ),
    "impacts along courses, spring-damper": replace(SEVERAL["five-bar, two gaps"], start="centred"),
    "a thousandth of the size": Units(1e3, 1e6, 30.0).request(SEVERAL["five-bar, spring-damper"]),
    **{f"{name}, tiny": TINY.request(SEVERAL[f"{name}, contact"]) for name in ("five-bar", "3-rpr")},
    "3-rpr, huge, driven": HUGE.request(SEVERAL["3-rpr, ideal"]),
    "3-rpr, huge, static": HUGE.request(SEVERAL["3-rpr, ideal, at rest"]),
}
REQUESTS = CRANKED | SEVERAL


LEFT_OUT = {  # requests that an engine has no run of, or no one answer to
    ("mujoco", "held more than once, with a gap"),  # it finds no start: see the loops that hold too much
    ("mujoco", "held more than once, static"),  # reactions are not determined there: a script has others, by 3e-6
    ("mujoco", "held more than once, at rest"),
}


def exportable() -> list[tuple[str, str]]:
    """Every request with each engine whose exports have it."""
    rows = []
    for name in EXPORTING:
        for title, request in REQUESTS.items():
            if (name, title) in LEFT_OUT:
                continue
            try:
                check_exported(declared(name), request)
            except Unsupported:
                continue
            rows.append((name, title))
    return rows


# ---------------------------------------------------------------- running it


def bare(*folders: Path) -> str:
    """Output of run.py, from a folder outside the repository and with this project's packages out of reach."""
    scripts = [str(folder / "run.py") for folder in folders]
    command = [sys.executable, "-I", "-c", ALONE, *scripts]
    done = subprocess.run(command, cwd=folders[0].parent, capture_output=True, text=True, timeout=1200, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def table(path: Path) -> dict[str, np.ndarray]:
    with path.open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    names = [heading.split(" [")[0] for heading in header]
    return dict(zip(names, np.array(rows, float).T, strict=True))


def columns(trace: Trace, request: Request) -> dict[str, np.ndarray]:
    """The trace in the order of passing, as it is exported: where a crank tells where the linkage is, without the
    joints' positions.  PyBullet's linkage at rest is in the order of its angle; moving, it passes each instant once.
    """
    crank = request.schedule.crank is not None
    told = {"crank_angle": trace.crank_angle} if crank else {}
    own = {name: values for name, values in trace.signals.items() if not (crank and name.startswith("position_"))}
    every = {**told, **({} if trace.time is None else {"time": trace.time}), **own}
    order = np.arange(trace.crank_angle.size) if trace.time is None else np.argsort(trace.time, kind="stable")
    if trace.simulator == "pybullet" and trace.time is None:
        order = np.argsort(trace.crank_angle, kind="stable")
    if trace.simulator == "pybullet" and trace.motion == "driven":
        order = np.unique(trace.time, return_index=True)[1]
    return {name: values[order] for name, values in every.items()}


ROUNDING = 1e-15  # m, N, N.m: where a pin without clearance is, say


def difference(found: Mapping[str, np.ndarray], truth: Mapping[str, np.ndarray], rounding: float = ROUNDING) -> float:
    """Largest difference, of the largest value among a vector's components; an angle's and a rate's of at least 1, what
    is rounding and nothing else of nothing.
    """
    worst = 0.0
    for name, values in truth.items():
        kind = [n for n in truth if n.rstrip("xy") == name.rstrip("xy")]
        least = [1.0] if "angle" in name or "angular" in name else []
        peak = max([float(np.abs(truth[n]).max()) for n in kind] + least)
        off = float(np.abs(found[name] - values).max())
        worst = max(worst, off / (peak or 1.0) if off > rounding else 0.0)
    return worst


def undone(asked: Request, folder: Path) -> float:
    """What Bullet's pins take (N) to undo, within a step h, a drift of a last digit, 1.1e-16 m, on either body: m/h^2
    times it.

    The last digit depends on the processor's matrix products (numpy's for Haswell: 4e-9 N of 55 N in the 3-RPR).
    """
    if asked.motion == "static" or asked.joint_model != "ideal":
        return 0.0
    runs = json.loads((folder / "start.json").read_text(encoding="utf-8"))["runs"]
    step = min(stage[1] for run in runs for stage in run["stages"])
    return 2 * float(np.finfo(float).epsneg) * sum(body.mass for body in asked.mechanism.bodies) / step**2


def places(trace: Mapping[str, np.ndarray]) -> list[np.ndarray]:
    """Where bodies are (m), along x."""
    return [values for name, values in trace.items() if name.endswith("_x") and name.count("_") == 1]


def wall(asked: Request, folder: Path, trace: Mapping[str, np.ndarray]) -> float:
    """What MuJoCo's hard contacts take to push a pin back by a last digit of either body's place: m/(time constant x
    damping ratio)^2 times it, as a share of the largest force.

    The last digit depends on the processor (4.6e-11 of the paper's case along a course on AMD's, 0 on Intel's).
    """
    contacts = json.loads((folder / "start.json").read_text(encoding="utf-8")).get("contacts", {})
    hard = [law["solref"] for law in contacts.values() if law["solref"][0] > 0.0]  # negative: a spring's N/m
    stiffest = max((1.0 / (time * damping) ** 2 for time, damping in hard), default=0.0)
    force = max(float(np.abs(values).max()) for name, values in trace.items() if name.startswith("reaction"))
    digit = (
        2 * float(np.finfo(float).epsneg) * max((float(np.abs(values).max()) for values in places(trace)), default=0.0)
    )
    return digit * sum(body.mass for body in asked.mechanism.bodies) * stiffest / force


def by_kind(found: Mapping[str, np.ndarray], truth: Mapping[str, np.ndarray], force: float) -> float:
    """Largest difference, of forces beyond ``force`` (N): of forces, torques and clearances in the largest of their
    kind; of others in their largest value, at least 1.
    """
    span = max(1.0, *(float(np.abs(values).max()) for values in places(truth)))
    worst = 0.0
    for name, values in truth.items():
        kind = next((k for k in ("reaction", "clearance") if name.startswith(k) and not name.endswith("moment")), name)
        peak = max(float(np.abs(truth[n]).max()) for n in truth if n.startswith(kind))
        slack = ROUNDING * span if kind == "clearance" else force if kind.startswith(("reaction", "drive")) else 0.0
        peak = (peak or 1.0) if kind in ("reaction", "clearance") else max(peak, 1.0)
        worst = max(worst, (float(np.abs(found[name] - values).max()) - slack) / peak)
    return worst


def assert_same(name: str, title: str, folder: Path) -> None:
    """Of a script's signals, as a share of the largest of their kind.

    MuJoCo at rest: contact of 1e8 N/m makes forces of positions, whose rounding is 1e-16 m; scripts add forces in
    another order.  A spring of PyBullet's makes forces of positions too, and its free motions amplify a rounding.
    """
    asked = REQUESTS[title]
    found, expected = (table(folder / file) for file in ("signals.csv", "expected.csv"))
    assert list(found) == list(expected)
    if name == "mujoco":
        at_rest = 2e-8 if "without friction" in title else 1e-8  # its loads are light
        rounding = 10 * ROUNDING if asked.motion == "static" else ROUNDING
        moving = max(3e-11, wall(asked, folder, expected))
        assert difference(found, expected, rounding) < (at_rest if asked.motion == "static" else moving)
    elif name == "exudyn":
        assert apart(found, expected) < (REPEATS | STEEP).get(title, 1e-12)
    else:
        free = any(drive.speed == "free" for drive in asked.mechanism.drives)
        soft = free or asked.joint_model == "spring-damper" or asked.bearings or not asked.mechanism.drives
        soft = soft or title == "compliant drive, course, ideal"  # of 200 N.m/rad: its crank is nearly free
        assert by_kind(found, expected, undone(asked, folder)) < (2e-8 if soft else 1e-11)


# A shaft free to swing is stepped without damping: a last digit of its speed, over the step, is an acceleration.
# Exudyn's own runs differ by that, one after another in one process: about one in fifteen by 2e-9 of the reactions.
# A load that opposes turns round within a few steps, in which a last digit of a velocity is a force.
STEEP = {"loads that oppose, released": 1e-9}
REPEATS = {title: 3e-9 for title in CRANKED if title.startswith("compliant drive")}
Scripts = Callable[[str, str], Path]


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Scripts:
    """A request's folder by engine and title, after its script has run in the bare one."""

    @cache
    def folder(name: str, title: str) -> Path:
        place = tmp_path_factory.mktemp("export")
        written = {path.name for path in engine(name).export(REQUESTS[title], place)}
        assert written == {path.name for path in place.iterdir()} >= FILES[name] | {"expected.csv", "run.py"}
        bare(place)
        return place

    return folder


QUICK = [
    ("mujoco", "paper, contact, driven"),
    ("mujoco", "3-rpr, contact"),
    ("exudyn", "paper, contact, static"),
    ("pybullet", "compliant drive"),
    ("mujoco", "stops, driven"),
    ("exudyn", "stops, released"),
    ("pybullet", "stops, static"),
]


@pytest.mark.long_rows(
    "mujoco-3-rpr, contact", "mujoco-stops, driven", "pybullet-compliant drive", "mujoco-paper, contact, driven",
    "exudyn-stops, released", "exudyn-paper, contact, static",
)  # fmt: skip
@pytest.mark.parametrize(("name", "title"), QUICK)
def test_a_few_scripts_give_the_same_numbers(name: str, title: str, tmp_path: Path) -> None:
    engine(name).export(REQUESTS[title], tmp_path)
    bare(tmp_path)
    assert_same(name, title, tmp_path)
    assert imported(tmp_path) == {name, "numpy"}


def imported(folder: Path) -> set[str]:
    """The packages that a script imports, beside Python's own."""
    tree = ast.parse((folder / "run.py").read_text(encoding="utf-8"))
    names = {a.name for node in ast.walk(tree) if isinstance(node, ast.Import) for a in node.names}
    names |= {str(node.module) for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    return {n.partition(".")[0] for n in names} - set(sys.stdlib_module_names)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "title"), exportable())
def test_bare_engine_gives_the_same_numbers(name: str, title: str, exported: Scripts) -> None:
    """And what is expected is the trace to the last digit; the script imports its engine and numpy alone, and writes
    its signals alone.
    """
    folder, asked = exported(name, title), REQUESTS[title]
    assert_same(name, title, folder)
    assert imported(folder) == {name, "numpy"}
    more = {path.name for path in folder.iterdir()} - FILES[name]
    assert {n for n in more if not n.endswith(".urdf")} == {"expected.csv", "run.py", "signals.csv"}
    if name == "mujoco":  # the file holds all but the virtual mass of soft rows
        start = json.loads((folder / "start.json").read_text(encoding="utf-8"))
        assert set(start["after_compiling"]) <= {"tendon_invweight0"}
    written, truth = table(folder / "expected.csv"), columns(engine(name).simulate(asked), asked)
    assert list(written) == list(truth)
    repeats = REPEATS.get(title, 0.0) if name == "exudyn" else 0.0
    if (name, title) == ("mujoco", "a thousandth of the size"):  # its own units are another rounding
        repeats = 1e-10
    assert apart(written, truth) <= repeats


RIGHT = {"mujoco": 1e-5, "exudyn": 3e-6, "pybullet": 2e-6}  # of the largest, as its steps are; at rest 1e-8


@pytest.mark.slow
@pytest.mark.parametrize(
    ("motion", "case"),
    [
        *((motion, case) for motion in MOTIONS for case in SHIPPED),
        ("driven", "3-rpr, motors of both kinds"),
        ("driven", "five-bar, motors that turn what floats"),
    ],
)
@pytest.mark.parametrize("name", EXPORTING)
def test_the_bare_engine_is_right_by_the_referee(name: str, case: str, motion: str, exported: Scripts) -> None:
    """In maximal coordinates, which knows no engine; at rest with its courses standing still."""
    title = case if case not in SHIPPED else f"{case}, ideal"
    title = title if motion == "driven" else f"{title}, at rest"
    m = REQUESTS[title].mechanism.with_clearances({})
    found, joints = table(exported(name, title) / "signals.csv"), [joint.name for joint in m.motors]
    if motion == "driven":
        _, posed = referee(m, along(m), found["time"])
    else:
        judge = Maximal(m, tuple(joints))
        q, posed = judge.home(Assembly(m).positions), []
        for k in range(found["time"].size):
            posed.append(judge.driven_at(q, {j: (found[f"position_{j}"][k], 0.0, 0.0) for j in joints}))
            q = posed[-1].q
    within = RIGHT[name] if motion == "driven" else 1e-8 if name == "exudyn" else 1e-6
    forces_agree(m, found, posed, within=within, motors=within)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "title", "file", "right", "wrong", "signal"),
    [
        ("mujoco", "paper, ideal, driven", "model.xml", 'gear="0.0 50.0', 'gear="0.0 50.001', "reaction_D_y"),
        ("mujoco", "paper, contact, static", "start.json", '"bearing_radius": 0.011, "margin": 0.0',
         '"bearing_radius": 0.011, "margin": -1.0', "reaction_D_y"),
        ("mujoco", "paper, spring-damper, static", "model.xml", 'range="-1 0.001"', 'range="-1 0.0010001"',
         "reaction_D_y"),
        ("exudyn", "paper, ideal, driven", "model.json", "[0.0, 50.0]", "[0.0, 50.001]", "reaction_B_x"),
        ("exudyn", "paper, massless-link, driven", "model.json", "[0.0, 50.0]", "[0.0, 50.001]", "reaction_B_x"),
        ("exudyn", "paper, spring-damper, static", "model.json", '"referenceLength": 0.001',
         '"referenceLength": 0.0009999', "reaction_B_x"),
        ("exudyn", "paper, contact, driven", "model.json", '"contactStiffness": 10000000.0',
         '"contactStiffness": 9000000.0', "reaction_B_x"),
        ("exudyn", "spring between points, static", "model.json", '"stiffness": 200.0', '"stiffness": 200.1',
         "reaction_D_x"),
        ("pybullet", "crank-rocker, ideal", "follower.urdf", 'izz="', 'izz="1', "reaction_E_y"),
        ("pybullet", "paper, ideal, driven", "start.json", "[0.0, 50.0]", "[0.0, 50.001]", "reaction_E_y"),
        ("pybullet", "paper, spring-damper, driven", "start.json", '"clearance": 0.001', '"clearance": 0.0010001',
         "reaction_E_y"),
        ("pybullet", "paper, contact, static", "B.strut.urdf", 'upper="0.0009', 'upper="0.0019', "reaction_E_y"),
        ("pybullet", "five-bar with springs", "start.json", '"length": 0.05', '"length": 0.0501', "reaction_E_y"),
        ("pybullet", "five-bar, ideal", "start.json", "[0.0, -20.0]", "[0.0, -20.01]", "reaction_E_y"),
        ("pybullet", "five-bar, ideal", "start.json", '"warm_up": 4', '"warm_up": 3', "reaction_E_y"),
    ],
)  # fmt: skip
def test_a_model_that_was_tampered_with_shows(
    name: str, title: str, file: str, right: str, wrong: str, signal: str, tmp_path: Path
) -> None:
    engine(name).export(REQUESTS[title], tmp_path)
    text = (tmp_path / file).read_text(encoding="utf-8")
    assert right in text
    (tmp_path / file).write_text(text.replace(right, wrong), encoding="utf-8")
    lines = [line.split() for line in bare(tmp_path).splitlines()]
    said = next(float(line[1]) for line in lines if line and line[0] == signal)
    found, truth = (table(tmp_path / f"{side}.csv")[signal] for side in ("signals", "expected"))
    assert said == pytest.approx(float(np.abs(found - truth).max()), rel=0.05)
    assert said > 1e-6 * float(np.abs(truth).max())


# ---------------------------------------------------------------- of one engine's files


FAR = [
    (title, units)
    for name, title in exportable()
    for word, units in (("tiny", TINY), ("huge", HUGE))
    if name == "exudyn" and word in title
]


@pytest.mark.slow
@pytest.mark.exudyn
@pytest.mark.parametrize(("title", "units"), FAR)
def test_exudyns_linkages_far_from_a_bench_are_exported_in_units_of_their_own(
    title: str, units: Units, exported: Scripts
) -> None:
    model = json.loads((exported("exudyn", title) / "model.json").read_text(encoding="utf-8"))
    assert np.sign(np.log(model["units"]["length"])) == -np.sign(np.log(units.length))


@pytest.mark.slow
@pytest.mark.parametrize(("title", "joint"), [("impacts", "B"), ("impacts along courses", "A")])
@pytest.mark.parametrize("name", ["exudyn"])
def test_pins_of_the_impacting_run_do_fly_free(name: str, title: str, joint: str) -> None:
    assert 0 < engine(name).simulate(REQUESTS[title]).free_share[joint] < 1


def changed(title: str, folder: Path, change: Callable[[dict], object]) -> tuple[Mapping[str, np.ndarray], ...]:
    """What an exudyn script finds, and what it expected, after this change of its model."""
    engine("exudyn").export(REQUESTS[title], folder)
    model = json.loads((folder / "model.json").read_text(encoding="utf-8"))
    change(model)
    (folder / "model.json").write_text(json.dumps(model), encoding="utf-8")
    bare(folder)
    return tuple(table(folder / f"{side}.csv") for side in ("signals", "expected"))


AT_REST = ["3-rpr, ideal, at rest", "five-bar, contact, at rest"]


@pytest.mark.slow
@pytest.mark.exudyn
@pytest.mark.parametrize("title", [*(f"paper, {model}, static" for model in JOINT_MODELS), *AT_REST])
def test_equilibria_are_found_and_not_read_from_the_file(title: str, tmp_path: Path) -> None:
    residual = []

    def aside(model: dict) -> None:
        residual.append(model["residual"])  # N, of some 50 N
        for near in model["equilibria"]:
            near["bodies"] = [value + 1e-8 * (-1) ** k for k, value in enumerate(near["bodies"])]

    assert apart(*changed(title, tmp_path, aside)) < residual[0]


@pytest.mark.slow
@pytest.mark.exudyn
@pytest.mark.parametrize("title", ["3-rpr, ideal", "five-bar, ideal", "elbow free, contact"])
def test_every_course_is_followed_from_the_file(title: str, tmp_path: Path) -> None:
    """Motors that go a thousandth faster, each alone, are a thousandth faster in what the script finds."""
    for joint in REQUESTS[title].schedule.courses:

        def faster(model: dict, joint: str = joint) -> None:
            course = model["drives"][joint]["course"]
            course["cubics"] = [[1.001 * c for c in cubic] for cubic in course["cubics"]]

        found, truth = (side[f"position_{joint}"] for side in changed(title, tmp_path, faster))
        gone = truth[-1] - truth[0]
        assert found[-1] - found[0] == pytest.approx(1.001 * gone, abs=1e-4 * abs(gone))


@pytest.mark.slow
@pytest.mark.exudyn
@pytest.mark.parametrize("title", AT_REST)
def test_every_drive_is_held_where_the_file_says(title: str, tmp_path: Path) -> None:
    """Each alone, held a thousandth of a radian or a tenth of a millimetre further, is found there, the others not."""
    m, joints = REQUESTS[title].mechanism, [*REQUESTS[title].schedule.courses]
    for joint in joints:
        aside = 1e-4 if m.joint(joint).prismatic else 1e-3

        def further(model: dict, joint: str = joint, aside: float = aside) -> None:
            for near in model["equilibria"]:
                near["held"][joint] += aside

        found, truth = changed(title, tmp_path, further)
        for other in joints:
            gone = found[f"position_{other}"] - truth[f"position_{other}"]
            np.testing.assert_allclose(gone, aside if other == joint else 0.0, rtol=0, atol=1e-9)


@pytest.mark.slow
@pytest.mark.pybullet
def test_urdfs_hold_the_bodies_to_the_last_digit_and_moments_of_inertia_come_from_them(tmp_path: Path) -> None:
    """Without its flag PyBullet would take them from collision shapes, of which there are none: no moment, and no
    resistance.
    """
    engine("pybullet").export(REQUESTS["crank-rocker, ideal"], tmp_path)
    links = {
        link.get("name"): link for path in tmp_path.glob("*.urdf") for link in ElementTree.parse(path).iterfind("link")
    }
    for body in load("crank-rocker").bodies:
        mass, inertia = (links[body.name].find(f"inertial/{what}") for what in ("mass", "inertia"))
        assert mass is not None
        assert inertia is not None
        assert float(mass.attrib["value"]) == body.mass
        moments = [float(inertia.attrib[i]) for i in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")]
        assert moments == [body.moment_of_inertia] * 3 + [0.0] * 3
    script = (tmp_path / "run.py").read_text(encoding="utf-8")
    assert "flags=p.URDF_USE_INERTIA_FROM_FILE" in script
    (tmp_path / "run.py").write_text(script.replace("flags=p.URDF_USE_INERTIA_FROM_FILE", "flags=0"), encoding="utf-8")
    bare(tmp_path)
    assert by_kind(table(tmp_path / "signals.csv"), table(tmp_path / "expected.csv"), 0.0) > 1e-3


def fall(arm: Mechanism, folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Energies (N,) J of motion and of weight of a released 2R arm in bare PyBullet, by where its signals have it."""
    bare(folder)
    found = table(folder / "signals.csv")
    at = [found[f"{b.name}_x"] + 1j * found[f"{b.name}_y"] for b in arm.bodies]
    spins = [found[f"{b.name}_angular_velocity"] for b in arm.bodies]
    elbow = arm.bodies[0].point("K").real * np.exp(1j * found["upper-arm_angle"])
    velocities = [1j * spins[0] * at[0], 1j * (spins[0] * elbow + spins[1] * (at[1] - elbow))]
    moving = zip(arm.bodies, velocities, spins, strict=True)
    swing = [b.mass * abs(v) ** 2 / 2 + b.moment_of_inertia * w**2 / 2 for b, v, w in moving]
    weight = [9.81 * b.mass * z.imag for b, z in zip(arm.bodies, at, strict=True)]
    return np.sum(swing, axis=0), np.sum(weight, axis=0)


@pytest.mark.slow
@pytest.mark.pybullet
def test_released_arm_keeps_its_energy_where_inertia_forces_are_put_right(tmp_path: Path) -> None:
    free = driven_at(ARM, O="free", K="free")
    engine("pybullet").export(request_of(free, time=np.linspace(0.0, 0.4, 9), courses={}), tmp_path)
    swing, weight = fall(free, tmp_path)
    assert np.ptp(swing) > 1.0  # J
    assert np.ptp(swing + weight) < 2e-6 * np.ptp(swing)
    start = (tmp_path / "start.json").read_text(encoding="utf-8")
    assert '"puts_right": true' in start
    (tmp_path / "start.json").write_text(start.replace('"puts_right": true', '"puts_right": false'), encoding="utf-8")
    swing, weight = fall(free, tmp_path)
    assert np.ptp(swing + weight) > 2e-4 * np.ptp(swing)


# ---------------------------------------------------------------- the command


def command(*arguments: str) -> tuple[int, str, str]:
    app = typer.Typer()
    app.command()(export)
    done = CliRunner().invoke(app, list(arguments))
    return done.exit_code, done.stdout, done.stderr


WRITES = {  # of each engine, more files
    "mujoco": {"model.xml", "start.json"},
    "exudyn": {"model.json"},
    "pybullet": {"crank.urdf", "follower.urdf", "coupler.urdf", "start.json"},
}


@pytest.mark.parametrize("name", slow_but(["mujoco"], EXPORTING))
def test_command_writes_the_files_and_says_how_to_run_them(name: str, tmp_path: Path) -> None:
    folder = tmp_path / "new" / "two words"
    model = [] if name == "pybullet" else ["--joint", "contact", "--clearance", "B=1e-3"]
    status, said, _ = command("--simulator", name, *model, "--angles", "30:40:5", "--out", str(folder))
    assert status == 0
    assert {path.name for path in folder.iterdir()} == WRITES[name] | {"expected.csv", "run.py"}
    assert said.splitlines()[-1].endswith(f"python {shlex.quote(str(folder / 'run.py'))}")
    assert shlex.split(said.splitlines()[-1])[-2:] == ["python", str(folder / "run.py")]
    assert f"paper, {'ideal' if name == 'pybullet' else 'contact'} joints, driven: 3 samples" in bare(folder)
    np.testing.assert_allclose(np.degrees(table(folder / "signals.csv")["crank_angle"]), [30, 35, 40], rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("case", ["five-bar", "3-rpr"])
@pytest.mark.parametrize("name", EXPORTING)
def test_command_writes_several_drives_at_times(name: str, case: str, tmp_path: Path) -> None:
    folder, m = tmp_path / "new", load(case)
    status, *_ = command("--simulator", name, "--case", case, "--times", "0:0.1:0.05", "--out", str(folder))
    assert status == 0
    assert f"{case}, ideal joints, driven: 3 samples" in bare(folder)
    found = table(folder / "signals.csv")
    assert "crank_angle" not in found
    for drive in m.drives:
        rate = np.diff(found[f"position_{drive.joint}"]) / 0.05
        assert rate == pytest.approx(drive.speed, rel=1e-6)


@pytest.mark.mujoco
@pytest.mark.filterwarnings("default:course.csv")
def test_command_exports_along_a_course(tmp_path: Path) -> None:
    course = tmp_path / "course.csv"
    rows = "".join(f"{t},{2.1 + t},{1.0 - t},9\n" for t in np.linspace(0.0, 0.2, 9))
    course.write_text(f"time [s],position_D [rad],position_E [rad],foo\n{rows}")
    asked = ["--case", "five-bar", "--simulator", "mujoco", "--course", str(course), "--times", "0:0.2:0.1"]
    status, said, why = command(*asked, "--out", str(tmp_path / "out"), "--json")
    assert status == 0, why
    ignored = "course.csv: 'foo' is no signal of the linkage, and ignored"
    assert ignored in why
    assert ignored in json.loads(said)["warnings"]
    assert ignored in (tmp_path / "out" / "run.py").read_text(encoding="utf-8")
    assert "ideal joints, driven: 3 samples" in bare(tmp_path / "out")
    found = table(tmp_path / "out" / "signals.csv")
    assert "crank_angle" not in found
    np.testing.assert_allclose(found["position_D"] - found["position_D"][0], [0.0, 0.1, 0.2], atol=1e-9)


@pytest.mark.mujoco
def test_json_says_what_was_written_as_its_schema_says_and_quiet_says_nothing(tmp_path: Path) -> None:
    folder = tmp_path / "two words"
    asked = ["--simulator", "mujoco", "--joint", "contact", "--angles", "30:40:5", "--out", str(folder)]
    status, said, _ = command(*asked, "--json")
    assert status == 0
    content = json.loads(said)
    assert faults(Exported, content) == []
    written = WRITES["mujoco"] | {"expected.csv", "run.py"}
    assert {Path(path).name for path in content["paths"]} == {path.name for path in folder.iterdir()} == written
    assert shlex.split(content["run"]) == ["python", str(folder / "run.py")]
    assert content["needs"] == ["mujoco", "numpy"]
    found = Exported.model_validate(content)
    assert found.to_json() + "\n" == said
    assert repr(found) == "Exported(paper, mujoco, contact, driven: 4 files)"
    assert "run.py</td>" in found._repr_html_()
    with pytest.raises(TypeError, match="no picture"):
        found.plot()
    assert command(*asked, "--quiet")[:2] == (0, "")


UNLOADED = ["--case", "crank-rocker", "--clearance", "B=1e-4", "--joint", "contact", "--motion", "static"]


@pytest.mark.mujoco
@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (["adams"], 2, ["'adams'", "mujoco"]),
        (["mujoco", "--case", "crank-rocker", "--joint", "contact"], 2, ["--joint contact", "give --clearance"]),
        (["mujoco", "--angles", "20:200:5"], 2, ["change point"]),
        (["mujoco", "--case", "pendulum", "--angles", "0:10:5"], 2, ["--angles 0:10:5", "swings freely"]),
        (["mujoco", "--case", "five-bar", "--angles", "0:10:5"], 2, ["--angles 0:10:5", "times"]),
        (["mujoco", "--clearance", "Q=1"], 2, ["Q=1", "D, A, B, E"]),
        (["mujoco", *UNLOADED], 3, ["nothing presses the pin of joint 'B'"]),
        (["dart"], 2, ["dart", "mujoco"]),
        (["pybullet", "--joint", "contact", "--clearance", "B=1e-3"], 2,
         ["contact joints in driven motion", "contact static"]),
        (["pybullet", "--joint", "massless-link", "--clearance", "B=1e-3"], 2, ["massless-link joints in driven"]),
    ],
)  # fmt: skip
def test_what_cannot_be_exported_is_refused_in_one_sentence_and_leaves_no_file(
    arguments: list[str], status: int, words: list[str], tmp_path: Path
) -> None:
    code, said, why = command("--simulator", *arguments, "--out", str(tmp_path / "out"))
    assert (code, said) == (status, "")
    assert len(why.strip().splitlines()) == 1
    for word in words:
        assert word in why
    assert not (tmp_path / "out").exists() or not list((tmp_path / "out").iterdir())


@pytest.mark.parametrize(
    ("name", "request_", "words"),
    [
        ("exudyn", request_of(PAPER.with_joint("B", friction=0.1), "contact", "static", SHORT), "friction"),
        ("pybullet", request_of(YIELDING, "ideal", "static", SHORT), r"drive\.stiffness = 2000"),
        ("pybullet", request_of(at_speed(PAPER, 20.0, half_gap=2e-3), "ideal", "driven", SHORT), r"drive\.half_gap"),
    ],
)  # fmt: skip
def test_what_an_engine_does_not_do_is_not_exported(name: str, request_: Request, words: str, tmp_path: Path) -> None:
    with pytest.raises(Unsupported, match=words):
        engine(name).export(request_, tmp_path)
    assert not list(tmp_path.iterdir())

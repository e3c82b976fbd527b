"""Diagnoses from accelerometers alone: reports/accelerometers.json and .md, made again set by set.

    python -m tests.evidence.accelerometers link 0 30        # kind, first set and number of sets
    python -m tests.evidence.accelerometers unbalance 0 30
    python -m tests.evidence.accelerometers clearance 0 30
    python -m tests.evidence.accelerometers page             # accelerometers.md alone

A slider-crank or a crank-rocker turns at three speeds under gravity; two or three accelerometers on coupler and
slider, or coupler and follower, are all that is read.  Exudyn makes the data, MuJoCo diagnoses.  What was measured
before stays, but for the same sets.
"""

from __future__ import annotations

import math
import sys
import tempfile
import time
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np

from analytic.kinematics.schedule import Schedule
from analytic.mechanism import Mechanism, Sensor
from analytic.mechanism.file import load
from analytic.writing import write_atomically
from compare.diagnose.effects.effect import Values
from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.diagnose.workflow import diagnose
from compare.versions import versions
from sim_models.common.rates import with_rates
from sim_models.engine import JointModel, Request, SimulationError, declared, engine, installed_version
from tests.evidence.pages.accelerometers import WORDS, page
from tests.evidence.results.accelerometers import Accelerometers, Kind, Told
from tests.evidence.scoreboard.files import Recording, write_files
from tests.evidence.scoreboard.rigs import Rejected, draw_log

FILE = Path("reports/accelerometers.json")
MAKER, DIAGNOSING = "exudyn", "mujoco"
CASES = {"crank-rocker": ("coupler", "follower"), "slider-crank": ("rod", "slider")}
NOISE = (0.005, 0.05)  # of the largest reading of each chip without the fault
SAMPLES = {"link": 200, "unbalance": 100, "clearance": 200}  # a revolution
TURNS = {"link": 3, "unbalance": 2, "clearance": 6}
FASTEST = {"link": (20.0, 40.0), "clearance": (18.0, 42.0)}  # rad/s
SAG, SLOW = 0.05, 7.0  # rad, by which a springy drive's crank sags under its links' weight; its rate over the fastest
DAMPED = 0.1  # of critical: by the crank's bearing
FREE = (0.01, 0.5)  # of the time that a pin with clearance is off its wall
ATTEMPTS = 100


@dataclass(frozen=True)
class Made:
    """A set: its rig, what is wrong with it, and what was recorded."""

    case: str
    nominal: Mechanism
    truth: tuple[str, str, Values]
    noise: Mapping[str, float]
    recordings: Sequence[Recording]
    sigmas: float
    free: float


def made(kind: Kind, k: int) -> Made:
    """The k-th set of a kind.  Raises Rejected where no attempt makes one."""
    for attempt in range(ATTEMPTS):
        try:
            return _drawn(kind, k, np.random.default_rng([list(WORDS).index(kind), k, attempt]))
        except (Rejected, SimulationError):
            continue
    raise Rejected(f"{kind}, set {k}: none of {ATTEMPTS} attempts made a usable set")


def _drawn(kind: Kind, k: int, rng: np.random.Generator) -> Made:
    case = list(CASES)[k % 2]
    links = CASES[case]
    nominal = load(case).rigid().replace(gravity=(0.0, -9.81))
    nominal = nominal.with_joint("B", restitution=None)  # nobody knows what impacts give back
    bodies = [*links, links[0]][: int(rng.integers(2, 4))]
    sensors = [_chip(rng, nominal, body, f"chip-{i}") for i, body in enumerate(bodies)]
    nominal = nominal.replace(sensors=tuple(sensors))
    if kind == "unbalance":
        nominal, fastest = _springy(rng, nominal)
    else:
        fastest = float(rng.uniform(*FASTEST[kind]))
    name, where, values = _fault(kind, nominal, rng)
    real = VOCABULARY[name].on_mechanism(nominal, where, values)
    if kind == "clearance" and rng.random() < 0.5:
        real = real.with_joint(where, contact_law="flores", restitution=float(rng.uniform(0.1, 0.9)))
    speeds = [fastest, -rng.uniform(0.6, 0.9) * fastest, rng.uniform(0.35, 0.6) * fastest]
    plans = [_plan(kind, speed, float(rng.uniform(0, math.tau))) for speed in speeds]
    still = [_nominal(nominal, *plan) for plan in plans]
    ranges = {s.name: max(float(np.abs(each[s.name]).max()) for each in still) for s in sensors}
    noise = {s: NOISE[k // 2 % 2] * size for s, size in ranges.items()}
    recordings: list[Recording] = []
    free, off = list[float](), 0.0
    for (speed, angle, at), without in zip(plans, still, strict=True):
        turned = real.replace(drive=real.drive and real.drive.model_copy(update={"speed": speed}))
        model: JointModel = "contact" if kind == "clearance" else "ideal"
        trace = engine(MAKER).simulate(Request(turned, model, Schedule.at_angles(turned, angle + speed * at)))
        chips = with_rates(turned, trace, noise)
        off += sum(float(np.sum(((chips[s] - without[s]) / sigma) ** 2)) for s, sigma in noise.items())
        read = {s: chips[s] + sigma * rng.standard_normal(at.size) for s, sigma in noise.items()}
        free.append(trace.free_share.get(where, 0.0))
        recordings.append(
            Recording(f"run-{len(recordings) + 1}", at, read, {"drive_speed": speed, "drive_angle": angle})
        )
    share = float(np.mean(free))
    if kind == "clearance" and not FREE[0] <= share <= FREE[1]:
        raise Rejected("its pin flies too seldom or too often")
    return Made(case, nominal, (name, where, values), noise, recordings, math.sqrt(off), share)


def _chip(rng: np.random.Generator, m: Mechanism, body: str, name: str) -> Sensor:
    length = m.moving[body].length
    spot = (float(rng.uniform(0.15, 0.9)) * length, float(rng.uniform(-0.05, 0.05)) * length)
    turn = 0.0 if length == 0 else float(rng.uniform(0, math.tau))  # a slider's own axis is the one that moves
    return Sensor(name=name, kind="accelerometer", body=body, point=spot, axis=(math.cos(turn), math.sin(turn)))


def _springy(rng: np.random.Generator, m: Mechanism) -> tuple[Mechanism, float]:
    """The same with a balanced crank behind a springy drive, and a speed (rad/s) at which it does not resonate."""
    weight = 9.81 * sum(body.mass for body in m.bodies) * m.moving["crank"].length
    inertia = sum(body.mass for body in m.bodies) * m.moving["crank"].length ** 2
    stiffness = weight / draw_log(rng, SAG / 2, SAG * 2)
    m = m.with_body("crank", com=(0.0, 0.0), inertia=m.moving["crank"].moment_of_inertia)
    m = m.with_joint(m.drive_joint.name, damping=2 * DAMPED * math.sqrt(stiffness * inertia))
    assert m.drive is not None
    return m.replace(drive=m.drive.model_copy(update={"stiffness": stiffness})), math.sqrt(stiffness / inertia) / SLOW


def _fault(kind: Kind, m: Mechanism, rng: np.random.Generator) -> tuple[str, str, Values]:
    if kind == "link":
        coupler = m.joint("B").bodies[0]
        size = draw_log(rng, 0.005, 0.03) * m.moving[coupler].length
        return "link_length", coupler, {VOCABULARY["link_length"].parameters[0].name: size * float(rng.choice((-1, 1)))}
    if kind == "clearance":
        pins = [joint.name for joint in m.joints if not joint.prismatic]
        return "joint_clearance", str(rng.choice(pins)), {"radial_clearance": draw_log(rng, 1e-4, 1e-3)}
    crank, turn, out = m.moving["crank"], float(rng.uniform(0, math.tau)), float(rng.uniform(0.3, 0.9))
    x, y = (out * crank.length * each for each in (math.cos(turn), math.sin(turn)))
    if rng.random() < 0.5:
        return "com_offset", "crank", {"along": x, "normal": y}
    mass = float(rng.uniform(0.3, 1.2)) * crank.mass
    return "payload", "crank", dict(zip((p.name for p in VOCABULARY["payload"].parameters), (mass, x, y), strict=True))


def _plan(kind: Kind, speed: float, angle: float) -> tuple[float, float, np.ndarray]:
    return speed, angle, np.linspace(0.0, math.tau * TURNS[kind] / abs(speed), TURNS[kind] * SAMPLES[kind])


def _nominal(m: Mechanism, speed: float, angle: float, at: np.ndarray) -> Mapping[str, np.ndarray]:
    """What the chips would read without the fault."""
    turned = m.replace(drive=m.drive and m.drive.model_copy(update={"speed": speed}))
    trace = engine(MAKER).simulate(Request(turned, "ideal", Schedule.at_angles(turned, angle + speed * at)))
    return with_rates(turned, trace, (sensor.name for sensor in m.sensors))


def told(kind: Kind, k: int) -> Told:
    """The k-th set, diagnosed from its files."""
    one = made(kind, k)
    name, where, values = one.truth
    with tempfile.TemporaryDirectory() as folder:
        write_files(Path(folder), one.nominal, one.recordings, {}, one.noise)
        began = time.perf_counter()
        found = diagnose(Path(folder), DIAGNOSING, others=False, workers=1)
    named = {e.key: tuple(f"{t.name}@{t.where}" for t in e.ambiguous_with) for e in found.effects}
    words = ("com_offset", "payload") if kind == "unbalance" else (name,)
    true = {f"{word}@{where}" for word in words}
    size = next((e.parameters for e in found.effects if e.key == f"{name}@{where}"), {})
    return Told(
        kind=kind, set=k, case=one.case, noise=NOISE[k // 2 % 2], sensors=len(one.noise), truth=f"{name}@{where}",
        values=dict(values), sigmas=one.sigmas, free=one.free, named=named,
        found={key: p.value for key, p in size.items()}, verdict=found.verdict,
        right=bool(named) and all(true & {key, *ties} for key, ties in named.items()),
        seconds=round(time.perf_counter() - began, 1),
    )  # fmt: skip


def store(found: Accelerometers) -> None:
    """Write both files."""
    write_atomically(FILE, found.model_dump_json(indent=1) + "\n")
    write_atomically(FILE.with_suffix(".md"), page(found))


def main(what: str, first: str = "0", count: str = "0") -> None:
    """Make and diagnose sets, and store each as it is known."""
    if what not in (*WORDS, "page"):
        sys.exit(__doc__)
    here = {name: v for name in (MAKER, DIAGNOSING) if (v := installed_version(declared(name).package))}
    found = Accelerometers(versions={})
    if FILE.is_file():
        found = Accelerometers.model_validate_json(FILE.read_text(encoding="utf-8"))
    found = found.model_copy(update={"versions": versions(here)})
    for k in range(int(first), int(first) + int(count)):
        row = told(cast(Kind, what), k)
        kept = [one for one in found.sets if (one.kind, one.set) != (row.kind, row.set)]
        every = sorted((*kept, row), key=lambda one: (list(WORDS).index(one.kind), one.set))
        found = found.model_copy(update={"sets": tuple(every)})
        store(found)
    store(found)


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    main(*(sys.argv[1:] or ["-"]))

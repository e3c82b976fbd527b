"""One diagnosis of three runs x 721 samples x 10 sensors: time, memory, repeatability; and the same data fitted by
mujoco.sysid.

``python tests/bench_diagnosis.py time [CASE ...]`` needs exudyn, which plays the rig, and so does ``released``, one
released run of many seconds; ``python tests/bench_diagnosis.py sysid`` needs ``pip install '.[bench]'`` too.  Cases are
the keys of ``TRUTH``.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from analytic.mechanism import Load, Mechanism
from analytic.mechanism.file import dumps, load
from analytic.mechanism.signals import named as signals_by_name
from asked import request_of
from compare.diagnose.effects.vocabulary import VOCABULARY
from sim_models.engine import JointModel, engine

Truth = Sequence[tuple[str, str, Mapping[str, float]]]  # effect, place, values

TRUTH: dict[str, Truth] = {
    "clearance": [
        ("joint_clearance", "B", {"radial_clearance": 1e-4}),
        ("coulomb_friction", "E", {"friction_torque": 0.05}),
    ],
    "friction": [
        ("coulomb_friction", "E", {"friction_torque": 0.05}),
        ("sensor_gain", "reaction_E_x", {"gain_error": 0.01}),
    ],
    "compliance": [("drive_compliance", "drive", {"stiffness": 2000.0})],
}
NOISE = {
    "crank_angle": 2e-5,
    "follower_angle": 5e-5,
    "coupler_angle": 5e-5,
    "drive_torque": 5e-3,
    "coupler_x": 1e-5,
    "coupler_y": 1e-5,
    "reaction_D_x": 0.1,
    "reaction_D_y": 0.1,
    "reaction_E_x": 0.1,
    "reaction_E_y": 0.1,
}
SAMPLES = 721
TURNS = 2
LET_GO = ((30.0, 1e-3, 2e-3), (60.0, 5e-4, 1e-3), (120.0, 3e-4, 5e-4))  # s, N.m.s/rad, N.m
ONE_THREAD = {
    "OPENBLAS_NUM_THREADS": "1"
}  # threads of linear algebra wait for each other on two busy cores, up to four times as long
CLOSING = (
    10  # samples in which mujoco.sysid's linkage, begun in the nominal shape, closes in another; they are left out
)


@dataclass(frozen=True)
class Recording:
    """A run as the rig makes it: ``speed`` rad/s from ``angle`` rad, or released from there without a speed; ``time``
    (N,) s.
    """

    name: str
    time: np.ndarray
    angle: float
    speed: float | None = None
    loads: tuple[Load, ...] = ()


def turns() -> list[Recording]:
    """A revolution slow, one fast, and one backwards with the load turned over."""
    down, up = (Load(body="coupler", force=(0.0, f)) for f in (-50.0, 50.0))
    speeds = ("slow", 6.0, down), ("fast", 31.4, down), ("back", -15.0, up)
    return [Recording(name, np.linspace(0, 2 * np.pi / abs(w), SAMPLES), 0.3, w, (force,)) for name, w, force in speeds]


def swing(seconds: float = 8.0, samples: int = SAMPLES) -> list[Recording]:
    """A pendulum let go."""
    return [Recording("swing", np.linspace(0, seconds, samples), -0.4)]


def record(
    nominal: Mechanism, runs: Sequence[Recording], truth: Truth, noise: Mapping[str, float], folder: Path
) -> Path:
    """Play the rig with Exudyn, contact in joints with clearance, and write measured.toml with its files."""
    rng, entries = np.random.default_rng(1), []
    known = signals_by_name(nominal.bodies, nominal.joints)
    folder.mkdir(parents=True, exist_ok=True)
    for run in runs:
        seen = played(nominal, run, truth)
        columns = [run.time, *(seen[s] + sigma * rng.standard_normal(run.time.size) for s, sigma in noise.items())]
        header = ",".join(["time [s]", *(f"{s} [{known[s].unit}]" for s in noise)])
        np.savetxt(
            folder / f"{run.name}.csv", np.column_stack(columns), fmt="%.12g", delimiter=",", header=header, comments=""
        )
        entry: dict[str, Any] = {"name": run.name, "file": f"{run.name}.csv", "noise": dict(noise)}
        entry |= {"drive": "free"} if run.speed is None else {"drive_speed": run.speed, "drive_angle": run.angle}
        entries.append(
            entry | ({"load": [f.model_dump(mode="json", exclude_unset=True) for f in run.loads]} if run.loads else {})
        )
    (folder / "nominal.toml").write_text(dumps(nominal), encoding="utf-8")
    (folder / "measured.toml").write_text(
        tomli_w.dumps({"mechanism": "nominal.toml", "run": entries}), encoding="utf-8"
    )
    return folder / "measured.toml"


def played(nominal: Mechanism, run: Recording, truth: Truth) -> Mapping[str, np.ndarray]:
    """What noiseless sensors of the rig read, (N,) by signal."""
    assert nominal.drive is not None
    m = nominal.replace(loads=run.loads)
    for effect, where, values in truth:
        m = VOCABULARY[effect].on_mechanism(m, where, values)
    joints: JointModel = "contact" if m.clearances else "ideal"
    if run.speed is None:
        request = request_of(m.replace(assembly={m.driven: run.angle}), joints, time=run.time)
    else:
        request = request_of(with_speed(m, run.speed), joints, crank_angle=run.angle + run.speed * run.time)
    seen: Mapping[str, np.ndarray] = engine("exudyn").simulate(request).signals
    if run.speed is not None:
        seen = {**seen, f"{m.driven}_angle": run.angle + run.speed * run.time}  # the encoder sits on the motor
    for effect, where, values in truth:
        seen = VOCABULARY[effect].on_readings(seen, run.name, where, values)
    return seen


def with_speed(m: Mechanism, speed: float) -> Mechanism:
    """A mechanism that is driven at a speed (rad/s)."""
    assert m.drive is not None
    return m.replace(drive=m.drive.model_copy(update={"speed": speed}))


# ---------------------------------------------------------------- time, memory, the same again


def one(measured: Path, out: Path, others: bool, workers: int) -> None:
    """In a fresh process: diagnose and publish; what it took, as JSON."""
    from compare.diagnose.data.measured import load_measured
    from compare.diagnose.workflow import diagnose

    start, spent = time.perf_counter(), time.process_time()
    found = diagnose(load_measured(measured), "mujoco", others=others, workers=workers)
    diagnosed, processor = time.perf_counter() - start, time.process_time() - spent
    found.write(out)
    print(json.dumps({"diagnosed": diagnosed, "processor": processor, "memory": most_held()}))


def most_held() -> float:
    """Memory (MB) that this process has held at most."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def timed(cases: Sequence[str]) -> None:
    """Each case twice with every engine and twice with MuJoCo alone, two workers."""
    print(f"load of the machine before: {os.getloadavg()[0]:.1f}")
    print(
        "| truth | found | engines | command | of it diagnosis | memory | same again |\n|---|---|---|--:|--:|--:|---|"
    )
    for case in cases:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            measured = record(load("crank-rocker").rigid(), turns(), TRUTH[case], NOISE, folder)
            for others in (True, False):
                print(f"| {case} | {row(measured, folder, others)} |", flush=True)


def row(measured: Path, folder: Path, others: bool) -> str:
    """The table's cells for one case; the least of two runs counts."""
    told, texts, memory = [], [], 0.0
    for turn in range(TURNS):
        out = folder / f"{others}{turn}"
        command = [sys.executable, __file__, "one", str(measured), str(out), str(int(others)), "2"]
        start = time.perf_counter()
        running = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, env=os.environ | ONE_THREAD
        )
        while running.poll() is None:
            memory = max(memory, sum(held(pid) for pid in family(running.pid)))
            time.sleep(0.1)
        assert running.stdout is not None
        assert running.returncode == 0, command
        told.append({"command": time.perf_counter() - start} | json.loads(running.stdout.read().splitlines()[-1]))
        texts.append((out / "diagnosis.json").read_bytes())
    result = json.loads(texts[0])
    least = {k: min(t[k] for t in told) for k in told[0]}
    named = ", ".join(f"{e['name']}@{e['where']}" for e in result["effects"]) or "nothing"
    cells = (
        f"{result['verdict']}: {named}",
        "all" if others else "mujoco",
        f"{least['command']:.1f} s",
        f"{least['diagnosed']:.1f} s",
    )
    return " | ".join([*cells, f"{memory:.0f} MB", "yes" if texts[0] == texts[1] else "NO"])


def family(pid: int) -> list[int]:
    """A process and all that it has started."""
    found = [pid]
    with contextlib.suppress(OSError):  # it has ended meanwhile
        for thread in Path(f"/proc/{pid}/task").iterdir():
            found += [one for child in (thread / "children").read_text().split() for one in family(int(child))]
    return found


def held(pid: int) -> float:
    """Memory (MB) of a process, what it shares with others divided among them."""
    try:
        text = Path(f"/proc/{pid}/smaps_rollup").read_text()
    except OSError:
        return 0.0
    return float(text.partition("\nPss:")[2].split()[0]) / 1024 if "\nPss:" in text else 0.0


def released() -> None:
    """A pendulum that rubs and is damped, let go for so long: what its diagnosis takes of the processor, over what
    MuJoCo takes to simulate it once.
    """
    print(f"load of the machine before: {os.getloadavg()[0]:.1f}")
    print("| let go for | samples | found | of the processor | of one simulation | ratio | memory |")
    print("|--:|--:|---|--:|--:|--:|--:|")
    nominal = load("pendulum").rigid()
    for seconds, damping, friction in LET_GO:
        truth: Truth = [
            ("viscous_friction", "O", {"damping": damping}),
            ("coulomb_friction", "O", {"friction_torque": friction}),
        ]
        (run,) = runs = swing(seconds, round(50 * seconds))
        with tempfile.TemporaryDirectory() as name:
            measured = record(nominal, runs, truth, {"pendulum_angle": 1e-3}, Path(name))
            command = [sys.executable, __file__, "one", str(measured), str(Path(name) / "out"), "0", "1"]
            said = subprocess.run(command, capture_output=True, text=True, check=True, env=os.environ | ONE_THREAD)
            result = json.loads((Path(name) / "out" / "diagnosis.json").read_bytes())
        spent, memory = (json.loads(said.stdout.splitlines()[-1])[key] for key in ("processor", "memory"))
        start = time.process_time()
        engine("mujoco").simulate(request_of(nominal.replace(assembly={nominal.driven: run.angle}), time=run.time))
        once = time.process_time() - start
        named = ", ".join(f"{e['name']}@{e['where']}" for e in result["effects"]) or "nothing"
        found = f"{result['verdict']}: {named}"
        cells = f"{spent:.1f} s | {once:.2f} s | {spent / once:.0f} | {memory:.0f} MB"
        print(f"| {seconds:.0f} s | {run.time.size} | {found} | {cells} |", flush=True)


# ---------------------------------------------------------------- beside mujoco.sysid


@dataclass(frozen=True)
class Fitted:
    """What mujoco.sysid is told to fit: one number of a MuJoCo model, and what the truth is."""

    words: str
    case: str
    truth: Truth
    offered: str
    right: float | None  # the offered parameter's true value; None where the model lacks something else
    bounds: tuple[float, float, float]  # start, lowest, highest
    change: Callable[[Any, Any], None]  # writes the parameter into an MjSpec


def set_damping(spec: Any, parameter: Any) -> None:
    """A hinge's damping (N.m.s/rad)."""
    damping = spec.joint("pendulum").damping
    value = float(parameter.value[0])
    spec.joint("pendulum").damping = value if np.isscalar(damping) else np.array([value, *np.ravel(damping)[1:]])


def set_length(spec: Any, parameter: Any) -> None:
    """The follower's length (m): where its last pin sits."""
    spec.site("B:follower").pos = np.array([parameter.value[0], 0.0, 0.0])


DAMPING, LENGTH = (5e-4, 0.0, 0.02), (0.1, 0.09, 0.11)
PAIRS = (
    Fitted(
        "pendulum damped",
        "pendulum",
        [("viscous_friction", "O", {"damping": 2e-3})],
        "damping",
        2e-3,
        DAMPING,
        set_damping,
    ),
    Fitted(
        "pendulum, dry friction",
        "pendulum",
        [("coulomb_friction", "O", {"friction_torque": 2e-3})],
        "damping",
        None,
        DAMPING,
        set_damping,
    ),
    Fitted(
        "follower longer",
        "crank-rocker",
        [("link_length", "follower", {"length_error": 1e-4})],
        "length",
        0.1001,
        LENGTH,
        set_length,
    ),
    Fitted(
        "clearance in B",
        "crank-rocker",
        [("joint_clearance", "B", {"radial_clearance": 1e-4})],
        "length",
        None,
        LENGTH,
        set_length,
    ),
)


def beside_sysid() -> None:
    """Each pair diagnosed with the whole vocabulary, and fitted by mujoco.sysid with the one parameter that it is
    offered.
    """
    print(f"load of the machine before: {os.getloadavg()[0]:.1f}")
    print(
        "| truth | ours | seconds | error | mujoco.sysid fits | seconds | error (or value) | left, in noise | its"
        " report says | time, ratio |"
    )
    print("|---|---|--:|--:|---|--:|--:|--:|---|--:|")
    for pair in PAIRS:
        free = pair.case == "pendulum"
        nominal, runs = load(pair.case).rigid(), swing() if free else turns()
        noise = (
            {"pendulum_angle": 1e-3}
            if free
            else {s: NOISE[s] for s in ("crank_angle", "follower_angle", "coupler_angle")}
        )
        with tempfile.TemporaryDirectory() as name:
            measured = record(nominal, runs, pair.truth, noise, Path(name))
            ours, theirs = diagnosed(measured, pair.truth), fitted(pair, nominal, runs, Path(name), noise)
        ratio = f"{float(ours[1]) / float(theirs[0]):.1f}"
        print("|", " | ".join([pair.words, *ours, pair.offered, *theirs, ratio]), "|", flush=True)


def diagnosed(measured: Path, truth: Truth) -> list[str]:
    """What we find, in how long, and how far off."""
    from compare.diagnose.data.measured import load_measured
    from compare.diagnose.workflow import diagnose

    start = time.perf_counter()
    result = diagnose(load_measured(measured), "mujoco", others=False, workers=1).plain()
    spent = time.perf_counter() - start
    (effect, where, values), error = truth[0], "-"
    for e in result["effects"]:
        if (e["name"], e["where"]) == (effect, where):
            p = next(iter(values))
            error = f"{abs(e['parameters'][p]['value'] / values[p] - 1):.2%}"
    named = ", ".join(f"{e['name']}@{e['where']}" for e in result["effects"]) or "nothing"
    return [f"{result['verdict']}: {named}", f"{spent:.1f}", error]


def fitted(
    pair: Fitted, nominal: Mechanism, runs: Sequence[Recording], folder: Path, noise: Mapping[str, float]
) -> list[str]:
    """What mujoco.sysid finds from the true state at the start, in how long, how far off, what it leaves, and what its
    report says.

    The models are those of ``compare export``: a crank heavy enough to keep its speed needs no control; an idle motor
    stands in for it.
    """
    from mujoco import sysid
    from mujoco.sysid.report.sections.insights import AutomatedInsights

    sequences, scales = [], []
    for run in runs:
        sequence, sigma = sequence_of(nominal, run, folder, noise)
        sequences.append(sequence)
        scales.append(sigma)
    start = time.perf_counter()
    first, low, high = pair.bounds
    parameters = sysid.ParameterDict(
        {pair.offered: sysid.Parameter(pair.offered, first, low, high, modifier=pair.change)}
    )
    residual = sysid.build_residual_fn(models_sequences=sequences)
    with contextlib.redirect_stdout(io.StringIO()):  # its iterations
        found, _ = sysid.optimize(parameters, residual, verbose=False, max_iters=50)
    spent = time.perf_counter() - start
    value = float(found[pair.offered].value[0])
    _, predicted, seen = residual(found.as_vector(), found, return_pred_all=True)
    parts = [((p[0].data - s[0].data) / sigma).ravel() for p, s, sigma in zip(predicted, seen, scales, strict=True)]
    left = float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))
    off = pair.bounds[0] if pair.offered == "length" else 0.0  # how far off what is missing is, not the whole length
    error = "-" if pair.right is None else f"{abs((value - off) / (pair.right - off) - 1):.2%}"
    (insight,) = AutomatedInsights("", found).get_context()["insights"]
    return [f"{spent:.1f}", error if pair.right is not None else f"{value:.5g}", f"{left:.2f}", insight["title"]]


def sequence_of(nominal: Mechanism, run: Recording, folder: Path, noise: Mapping[str, float]) -> tuple[Any, np.ndarray]:
    """A run's exported MuJoCo model with what was measured of its hinges, and the noise of each of them."""
    import mujoco
    from mujoco import sysid
    from mujoco.sysid import SignalType

    from sim_models.mujoco.engine import ENGINE

    out = folder / f"{run.name}-model"
    out.mkdir()
    if run.speed is None:
        ENGINE.export(request_of(nominal.replace(assembly={nominal.driven: run.angle}), "ideal", time=run.time), out)
    else:
        ENGINE.export(
            request_of(with_speed(nominal, run.speed), "ideal", crank_angle=run.angle + run.speed * run.time), out
        )
    begin = json.loads((out / "start.json").read_text(encoding="utf-8"))
    spec = mujoco.MjSpec.from_file(str(out / "model.xml"))
    spec.add_actuator(name="idle", target=nominal.driven, trntype=mujoco.mjtTrn.mjTRN_JOINT, gear=[0.0] * 6)
    table = np.genfromtxt(folder / f"{run.name}.csv", delimiter=",", skip_header=1)
    column = dict(zip(noise, table[:, 1:].T, strict=True))
    hinges = {nominal.driven: column[f"{nominal.driven}_angle"]}
    if run.speed is not None:
        command = run.angle + run.speed * run.time
        hinges = {
            "follower": column["follower_angle"],
            "coupler": column["coupler_angle"] - command,
        }  # the coupler's hinge is on the crank
    for hinge in hinges:
        spec.add_sensor(
            name=hinge, type=mujoco.mjtSensor.mjSENS_JOINTPOS, objtype=mujoco.mjtObj.mjOBJ_JOINT, objname=hinge
        )
    model = spec.compile()
    state = sysid.create_initial_state(model, np.array(begin["qpos"]), np.array(begin["qvel"]))
    # positions after each step; jointpos sensors, which count only in the check of sizes, tell those before it
    names = [(f"{hinge}_qpos", 1, SignalType.MjStateQPos) for hinge in hinges]
    seen = sysid.TimeSeries.from_custom_map(run.time[CLOSING:], np.column_stack(list(hinges.values()))[CLOSING:], names)
    control = sysid.TimeSeries(run.time, np.zeros((run.time.size, 1)))
    sigma = np.array([noise[f"{hinge}_angle"] for hinge in hinges])
    return sysid.ModelSequences(run.name, spec, run.name, state, control, seen), sigma


if __name__ == "__main__":
    if sys.argv[1] == "one":
        one(Path(sys.argv[2]), Path(sys.argv[3]), sys.argv[4] == "1", int(sys.argv[5]))
    elif sys.argv[1] == "sysid":
        beside_sysid()
    elif sys.argv[1] == "released":
        released()
    else:
        timed(sys.argv[2:] or list(TRUTH))

"""What is exported from PyBullet runs without this project and gives the same numbers."""

from __future__ import annotations

import ast
import csv
import json
import shlex
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from analytic.kinematics.assembly import Assembly
from analytic.mechanism import Drive, Load, Mechanism
from analytic.mechanism.file import load, loads
from compare.cli.export import export
from linkages import curved_slider, inverted_slider
from several_linkages import SLIDES as GANTRY
from several_linkages import referee, sprung, third_bar
from several_truths import turned_round
from sim_models.engine import Request, Trace, Unsupported
from sim_models.pybullet.engine import ENGINE

pytestmark = [pytest.mark.pybullet, pytest.mark.slow]  # test_export is in the short part

# Of the largest value of a signal's kind.  A spring of 1e7 N/m makes forces of positions: it magnifies rounding, where
# the script finds a pin by other operations.
RIGID, SOFT = 1e-11, 2e-8
DRIFT = 1e-15  # m, of where a pin without clearance is, in which script and project may differ
ALONE = """
import runpy, sys
class Unimportable:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ("analytic", "sim_models", "compare"):
            raise ImportError(f"{name} is not for the bare engine")
sys.meta_path.insert(0, Unimportable())
runpy.run_path(sys.argv[1], run_name="__main__")
"""


def request(
    m: Mechanism, joint_model: str = "ideal", motion: str = "driven", degrees: object = (30, 33, 32, 30), **more: object
) -> Request:
    return Request(m, joint_model, motion, np.radians(np.array(degrees, float)), **more)


PAPER = load("paper").with_clearances({"B": 1e-3})
ROCKER = load("crank-rocker").with_clearances({"B": 2e-4})
MARKED = ROCKER.with_body("coupler", com=(0.1, 0.02), marker=(0.05, -0.01)).replace(
    loads=(Load(body="coupler", point="com", force=(1.0, 20.0)),)
)
SLIDER = load("slider-crank").with_clearances({"A": 1e-4}).replace(drive=Drive(joint="O", speed=100.0))
LAWS = inverted_slider().with_clearances({"A": 1e-4})  # prismatic between moving bodies, and every joint law
PENDULUM = load("pendulum").with_clearances({"O": 5e-4})
FAST = Drive(joint="D", speed=-60.0)
STRETCHED = PAPER.replace(
    springs=[{"bodies": ("crank", "follower"), "points": ("A", "E"), "stiffness": 300.0, "length": 0.2, "damping": 2.0}]
)
SOFT_PIN = PAPER.with_joint("A", radial_stiffness=1e6)
YIELDING = PAPER.replace(drive=Drive(joint="D", speed=20.0, stiffness=2000.0))
GRIPPED = PAPER.with_joint("A", friction_radius=5e-3).with_joint("E", friction_radius=2e-3, friction_torque=0.05)
KNOTS = np.linspace(0.0, 0.06, 9)  # s
COURSE = {"course": (KNOTS, 0.5 + KNOTS + 20.0 * KNOTS**2), "time": np.array([0.01, 0.052, 0.03])}
REQUESTS = {
    "paper": request(PAPER),
    "paper, backwards and faster": request(PAPER.replace(drive=FAST)),
    "paper, spring-damper": request(PAPER, "spring-damper"),
    "paper, spring-damper, lead-in": request(PAPER, "spring-damper", lead_in=0.1, start="centred", step=5e-5),
    "crank-rocker": request(ROCKER, degrees=(0, 50, 30)),
    "crank-rocker, at angles between steps": request(ROCKER, degrees=(0, 30.123, 50, 31.4567)),
    "crank-rocker with a marker": request(MARKED, degrees=(0, 50, 30)),
    "crank-rocker, spring-damper": request(ROCKER, "spring-damper"),
    "slider-crank": request(SLIDER, degrees=(0, 50, 30)),
    "slider-crank, spring-damper": request(SLIDER, "spring-damper"),
    "six-bar": request(load("six-bar"), degrees=(0, 40)),
    "every joint law": request(LAWS),
    "every joint law, spring-damper": request(LAWS, "spring-damper"),
    "every joint law, static": request(LAWS, "ideal", "static"),
    "laws that are not linear": request(curved_slider()),
    "laws that are not linear, static": request(curved_slider(), "ideal", "static"),
    "a spring without friction, static": request(PAPER.with_joint("E", stiffness=2.0, damping=0.1), "ideal", "static"),
    "pendulum": Request(PENDULUM, time=np.array([0.3, 0.1, 0.2])),
    "pendulum, spring-damper": Request(PENDULUM, "spring-damper", time=np.array([0.03, 0.01])),
    "paper, static": request(PAPER, "ideal", "static"),
    "paper, spring-damper, static": request(PAPER, "spring-damper", "static"),
    "paper, massless link, static": request(PAPER, "massless-link", "static"),
    "paper, contact, static": request(PAPER, "contact", "static"),
    "slider-crank with weight, contact, static": request(SLIDER.replace(gravity=(0.0, -9.81)), "contact", "static"),
    "spring between points": request(STRETCHED),
    "spring between points, contact, static": request(STRETCHED, "contact", "static"),
    "friction that grows with reactions": request(GRIPPED),
    "friction that grows with reactions, static": request(GRIPPED, "ideal", "static"),
    "friction that grows with reactions, contact, static": request(GRIPPED, "contact", "static"),
    "friction that grows with reactions, released": Request(
        PENDULUM.with_joint("O", friction_radius=5e-3), time=np.array([0.03, 0.1, 0.2])
    ),
    "drive that yields": request(YIELDING),
    "drive that yields, lead-in": request(YIELDING, degrees=(30, 31.234, 33), lead_in=0.1),
    "drive that yields, spring-damper": request(YIELDING, "spring-damper"),
    "drive that yields, course": Request(YIELDING, **COURSE),
    "soft bearing": request(SOFT_PIN),
    "soft bearing, static": request(SOFT_PIN, "ideal", "static"),
    "soft bearing beside a pin, spring-damper": request(SOFT_PIN, "spring-damper"),
    "soft bearing with clearance, spring-damper": request(PAPER.with_joint("B", radial_stiffness=1e6), "spring-damper"),
    "course": Request(PAPER, **COURSE),
    "course, spring-damper": Request(PAPER, "spring-damper", **COURSE),
    "course, every joint law": Request(LAWS, **COURSE),
}


# ---------------------------------------------------------------- several drives

FIVE_BAR, ARM, SLIDES, PLATFORM = (load(name) for name in ("five-bar", "2r-arm", "3-rpr", "3-rrr"))
BETWEEN = np.array([0.0041, 0.03, 0.0123])  # s, not all of them at a step


FREELY = tuple(Drive(joint=joint, speed="free") for joint in ("D", "E"))


def driven_at(m: Mechanism, **speeds: float | str) -> Mechanism:
    """The mechanism with these drives in place of its own."""
    return m.replace(drives=tuple(Drive(joint=joint, speed=speed) for joint, speed in speeds.items()))


def several(
    m: Mechanism, joint_model: str = "ideal", time: np.ndarray = BETWEEN, begin: float = 0.0, **more: object
) -> Request:
    """Its drives, but those that are free, along courses that are no straight lines, from ``begin`` (s)."""
    at, speeds = Assembly(m).positions, {d.joint: d.speed for d in m.drives if d.speed != "free"}
    ways = KNOTS + 0.05 * np.sin(8.0 * KNOTS) + KNOTS**2
    courses = {joint: (begin + KNOTS, at[joint] + float(speed) * ways) for joint, speed in speeds.items()}
    return Request(m, joint_model, time=begin + time, courses=courses, **more)


def rubbing(m: Mechanism) -> Mechanism:
    """The mechanism with friction, a damper and drag in every joint."""
    for joint in m.joints:
        m = m.with_joint(joint.name, friction_torque=0.02, damping=0.02, drag=0.01)
    return m


LOOSE = FIVE_BAR.with_clearances({"P": 5e-4, "A": 2e-4})


def at_rest(m: Mechanism, joint_model: str = "ideal") -> Request:
    """The same at instants, one of them asked for twice."""
    return replace(several(m, joint_model, time=np.array([0.03, 0.0, 0.0523, 0.03])), motion="static")


REQUESTS |= {
    "five-bar": several(FIVE_BAR),
    "3-rrr": several(PLATFORM),
    "3-rpr": several(SLIDES),
    "2r-arm, at other times of the clock": several(ARM, begin=5.0),
    "five-bar with springs and dampers": several(sprung(FIVE_BAR)),
    "parallelogram with a third bar": several(third_bar()),
    "gantry: slides on slides, the second told from its rider": several(loads(GANTRY)),
    "2r-arm, joints told from the other side": several(turned_round(ARM, "O", "K")),
    "five-bar, a motor between moving bodies": several(turned_round(driven_at(FIVE_BAR, D=1.0, A=-0.7), "A")),
    "five-bar, motors that turn what floats": several(driven_at(FIVE_BAR, A=1.0, P=-0.7)),
    "3-rpr, motors of both kinds": several(driven_at(SLIDES, S1=0.03, A2=0.1, C3=0.2)),
    "five-bar, spring-damper": several(LOOSE, "spring-damper"),
    "five-bar, spring-damper, centred": several(LOOSE, "spring-damper", start="centred"),
    "five-bar, static": at_rest(rubbing(sprung(FIVE_BAR))),
    "gantry, static": at_rest(rubbing(loads(GANTRY))),
    "five-bar, spring-damper, static": at_rest(LOOSE, "spring-damper"),
    "five-bar, massless link, static": at_rest(LOOSE, "massless-link"),
    "five-bar, contact, static": at_rest(LOOSE, "contact"),
}
FREE = {
    "five-bar, one drive free": several(driven_at(FIVE_BAR, D=2.0, E="free")),
    "3-rpr, one slide free": several(driven_at(SLIDES, S1=0.05, S2="free", S3=0.02)),
    "2r-arm with a free elbow": several(driven_at(ARM, O=1.5, K="free")),
    "gantry with a free slide": several(rubbing(driven_at(loads(GANTRY), X=0.2, Y="free", R=1.0))),
    "2r-arm, released": several(driven_at(ARM, O="free", K="free")),
    "five-bar with springs and dampers, released": several(sprung(FIVE_BAR).replace(drives=FREELY)),
    "five-bar, one drive free, friction that grows with reactions": several(
        driven_at(FIVE_BAR, D=2.0, E="free").with_joint("E", friction_radius=5e-3)
    ),
    "five-bar, one drive free, spring-damper": several(
        driven_at(LOOSE, D=2.0, E="free"), "spring-damper", start="centred"
    ),
}
REQUESTS |= FREE


def bare(folder: Path) -> str:
    """Output of run.py, from a folder outside the repository and with this project's packages out of reach."""
    command = [sys.executable, "-I", "-c", ALONE, str(folder / "run.py")]
    done = subprocess.run(command, cwd=folder.parent, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def table(path: Path) -> dict[str, np.ndarray]:
    with path.open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    names = [heading.split(" [")[0] for heading in header]
    return dict(zip(names, np.array(rows, float).T, strict=True))


def columns(trace: Trace, speed: float | None, *, crank: bool) -> dict[str, np.ndarray]:
    """The trace in the order of passing, as it is exported: where a crank tells where the linkage is, without the
    joints' positions.  A moving linkage passes each instant once.
    """
    told = {"crank_angle": trace.crank_angle} if crank else {}
    own = {name: values for name, values in trace.signals.items() if not (crank and name.startswith("position_"))}
    every = {**told, **({} if trace.time is None else {"time": trace.time}), **own}
    order = np.argsort(trace.crank_angle * np.sign(speed or 1.0) if trace.time is None else trace.time, kind="stable")
    if trace.motion == "driven":
        order = np.unique(trace.time, return_index=True)[1]
    return {name: values[order] for name, values in every.items()}


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


def difference(found: Mapping[str, np.ndarray], truth: Mapping[str, np.ndarray], force: float = 0.0) -> float:
    """Largest difference, of forces beyond ``force`` (N): of forces, torques and clearances in the largest of their
    kind; of others in their largest value, at least 1.
    """
    worst = 0.0
    for name, values in truth.items():
        kind = next((k for k in ("reaction", "clearance") if name.startswith(k) and not name.endswith("moment")), name)
        peak = max(float(np.abs(truth[n]).max()) for n in truth if n.startswith(kind))
        slack = DRIFT if kind == "clearance" else force if kind.startswith(("reaction", "drive")) else 0.0
        peak = (peak or 1.0) if kind in ("reaction", "clearance") else max(peak, 1.0)
        worst = max(worst, (float(np.abs(found[name] - values).max()) - slack) / peak)
    return worst


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Every request's folder."""
    folders = {name: tmp_path_factory.mktemp("export") for name in REQUESTS}
    for name, folder in folders.items():
        written = {path.name for path in ENGINE.export(REQUESTS[name], folder)}
        assert written == {path.name for path in folder.iterdir()} >= {"start.json", "expected.csv", "run.py"}
    return folders


@pytest.mark.parametrize("name", REQUESTS)
def test_bare_engine_gives_the_same_numbers(name: str, exported: dict[str, Path]) -> None:
    bare(exported[name])
    found, truth = table(exported[name] / "signals.csv"), table(exported[name] / "expected.csv")
    assert found.keys() == truth.keys()
    asked = REQUESTS[name]
    soft = name in FREE or asked.joint_model == "spring-damper" or asked.bearings
    assert difference(found, truth, undone(asked, exported[name])) < (SOFT if soft else RIGID)


@pytest.mark.parametrize("name", REQUESTS)
def test_expected_values_are_the_trace_to_the_last_digit(name: str, exported: dict[str, Path]) -> None:
    asked = REQUESTS[name]
    truth = columns(ENGINE.simulate(asked), asked.mechanism.speed, crank=asked.courses is None)
    written = table(exported[name] / "expected.csv")
    assert list(written) == list(truth)
    for signal, values in truth.items():
        np.testing.assert_array_equal(written[signal], values)


def test_script_imports_pybullet_and_numpy_and_nothing_else(exported: dict[str, Path]) -> None:
    tree = ast.parse((exported["paper"] / "run.py").read_text(encoding="utf-8"))
    names = {a.name for node in ast.walk(tree) if isinstance(node, ast.Import) for a in node.names}
    names |= {str(node.module) for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert {name.partition(".")[0] for name in names} - set(sys.stdlib_module_names) == {"pybullet", "numpy"}


def test_urdfs_hold_the_bodies_to_the_last_digit(exported: dict[str, Path]) -> None:
    m = load("crank-rocker")
    links = {
        link.get("name"): link
        for path in exported["crank-rocker"].glob("*.urdf")
        for link in ElementTree.parse(path).iterfind("link")
    }
    for body in m.bodies:
        mass, inertia = (links[body.name].find(f"inertial/{what}") for what in ("mass", "inertia"))
        assert mass is not None
        assert inertia is not None
        assert float(mass.attrib["value"]) == body.mass
        assert [float(inertia.attrib[i]) for i in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")] == [
            body.moment_of_inertia
        ] * 3 + [0.0] * 3


@pytest.mark.parametrize(
    ("name", "file", "right", "wrong"),
    [
        ("crank-rocker", "follower.urdf", 'izz="', 'izz="1'),
        ("paper", "start.json", '"force": [0.0, 50.0]', '"force": [0.0, 50.001]'),
        ("paper, spring-damper", "start.json", '"clearance": 0.001', '"clearance": 0.0010001'),
        ("paper, contact, static", "B.strut.urdf", 'upper="0.0009', 'upper="0.0019'),
        ("five-bar with springs and dampers", "start.json", '"length": 0.05', '"length": 0.0501'),
        ("five-bar", "start.json", '"force": [0.0, -20.0]', '"force": [0.0, -20.01]'),
        ("five-bar", "start.json", '"warm_up": 4', '"warm_up": 3'),
    ],
)
def test_a_model_that_was_tampered_with_shows(name: str, file: str, right: str, wrong: str, tmp_path: Path) -> None:
    ENGINE.export(REQUESTS[name], tmp_path)
    text = (tmp_path / file).read_text(encoding="utf-8")
    assert right in text
    (tmp_path / file).write_text(text.replace(right, wrong), encoding="utf-8")
    lines = [line.split() for line in bare(tmp_path).splitlines()]
    said = next(float(line[1]) for line in lines if line and line[0] == "reaction_E_y")
    found, truth = (table(tmp_path / f"{side}.csv")["reaction_E_y"] for side in ("signals", "expected"))
    assert said == pytest.approx(float(np.abs(found - truth).max()), rel=0.05)
    assert said > 1e-5 * float(np.abs(truth).max())


def test_moments_of_inertia_come_from_the_urdf(exported: dict[str, Path]) -> None:
    """Without its flag PyBullet would take them from collision shapes, of which there are none: no moment, and no
    resistance.
    """
    script = (exported["crank-rocker"] / "run.py").read_text(encoding="utf-8")
    assert "flags=p.URDF_USE_INERTIA_FROM_FILE" in script
    changed = exported["crank-rocker"].parent / "without-flag"
    changed.mkdir()
    for path in exported["crank-rocker"].iterdir():
        (changed / path.name).write_text(
            path.read_text(encoding="utf-8").replace("flags=p.URDF_USE_INERTIA_FROM_FILE", "flags=0"), encoding="utf-8"
        )
    bare(changed)
    assert difference(table(changed / "signals.csv"), table(changed / "expected.csv")) > 1e-3


def command(*arguments: str) -> tuple[int, str, str]:
    app = typer.Typer()
    app.command()(export)
    done = CliRunner().invoke(app, list(arguments))
    return done.exit_code, done.stdout, done.stderr


def test_command_writes_the_files_and_says_how_to_run_them(tmp_path: Path) -> None:
    folder = tmp_path / "new folder"
    status, said, _ = command("--simulator", "pybullet", "--angles", "30:32:1", "--out", str(folder))
    assert status == 0
    assert {path.name for path in folder.iterdir()} == {
        "crank.urdf",
        "follower.urdf",
        "coupler.urdf",
        "start.json",
        "expected.csv",
        "run.py",
    }
    assert said.splitlines()[-1].endswith(f"python {shlex.quote(str(folder / 'run.py'))}")
    assert "paper, ideal joints, driven: 3 samples" in bare(folder)
    assert json.loads((folder / "start.json").read_text(encoding="utf-8"))["solver"] == "CONSTRAINT_SOLVER_LCP_DANTZIG"


def test_command_writes_several_drives_at_times(tmp_path: Path) -> None:
    out = tmp_path / "five-bar"
    status, _, why = command(
        "--simulator", "pybullet", "--case", "five-bar", "--times", "0:0.02:0.01", "--out", str(out)
    )
    assert status == 0, why
    assert {path.name for path in out.glob("*.urdf")} == {
        f"{side}-{part}.urdf" for side in ("left", "right") for part in ("crank", "arm")
    }
    assert "five-bar, ideal joints, driven: 3 samples" in bare(out)
    found = table(out / "signals.csv")
    start = load("five-bar").assembly
    np.testing.assert_allclose(found["position_D"], start["left-crank"] + 2.0 * found["time"], atol=1e-9)
    np.testing.assert_allclose(found["position_E"], start["right-crank"] - 1.0 * found["time"], atol=1e-9)


@pytest.mark.parametrize("name", ["five-bar", "3-rpr, motors of both kinds", "five-bar, motors that turn what floats"])
def test_bare_engine_is_right_by_the_referee_in_maximal_coordinates(name: str, exported: dict[str, Path]) -> None:
    """Whose equations of motion are written in the tests, for every body and every joint."""
    bare(exported[name])
    found, m = table(exported[name] / "signals.csv"), REQUESTS[name].mechanism
    _, posed = referee(m, dict(REQUESTS[name].courses or {}), found["time"])
    largest = max(abs(p.forces[j.name]) for p in posed for j in m.joints)
    for joint in m.joints:
        right = np.array([p.forces[joint.name] for p in posed])
        seen = found[f"reaction_{joint.name}_x"] + 1j * found[f"reaction_{joint.name}_y"]
        np.testing.assert_allclose(seen, right, rtol=0, atol=1e-6 * largest, err_msg=joint.name)
    for joint in posed[0].motors:
        right = np.array([p.motors[joint] for p in posed])
        seen = found[f"drive_{'force' if m.joint(joint).prismatic else 'torque'}_{joint}"]
        np.testing.assert_allclose(seen, right, rtol=0, atol=1e-6 * np.abs(right).max(), err_msg=joint)


def fall(arm: Mechanism, folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Energies (N,) J of motion and of weight of a released 2R arm in bare PyBullet, by where its signals have it."""
    bare(folder)
    found = table(folder / "signals.csv")
    at = [found[f"{b.name}_x"] + 1j * found[f"{b.name}_y"] for b in arm.bodies]
    spins = [found[f"{b.name}_angular_velocity"] for b in arm.bodies]
    elbow = arm.bodies[0].point("K").real * np.exp(1j * found["upper-arm_angle"])
    velocities = [1j * spins[0] * at[0], 1j * (spins[0] * elbow + spins[1] * (at[1] - elbow))]
    swing = [
        b.mass * abs(v) ** 2 + b.moment_of_inertia * w**2 for b, v, w in zip(arm.bodies, velocities, spins, strict=True)
    ]
    return np.sum(swing, axis=0) / 2, np.sum(
        [9.81 * b.mass * z.imag for b, z in zip(arm.bodies, at, strict=True)], axis=0
    )


def test_released_arm_keeps_its_energy_where_inertia_forces_are_put_right(tmp_path: Path) -> None:
    free = driven_at(ARM, O="free", K="free")
    ENGINE.export(several(free, time=np.linspace(0.0, 0.4, 9)), tmp_path)
    swing, weight = fall(free, tmp_path)
    assert np.ptp(swing) > 1.0  # J
    assert np.ptp(swing + weight) < 2e-6 * np.ptp(swing)
    start = (tmp_path / "start.json").read_text(encoding="utf-8")
    assert '"puts_right": true' in start
    (tmp_path / "start.json").write_text(start.replace('"puts_right": true', '"puts_right": false'), encoding="utf-8")
    swing, weight = fall(free, tmp_path)
    assert np.ptp(swing + weight) > 2e-4 * np.ptp(swing)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--joint", "contact", "--clearance", "B=1e-3"], ["contact joints in driven motion", "contact static"]),
        (["--joint", "massless-link", "--clearance", "B=1e-3"], ["massless-link joints in driven motion"]),
    ],
)
def test_what_cannot_be_exported_is_refused_in_one_sentence(
    arguments: list[str], words: list[str], tmp_path: Path
) -> None:
    status, said, why = command("--simulator", "pybullet", *arguments, "--out", str(tmp_path / "out"))
    assert (status, said) == (2, "")
    assert len(why.strip().splitlines()) == 1
    for word in words:
        assert word in why
    assert not (tmp_path / "out").exists() or not list((tmp_path / "out").iterdir())


def test_a_drive_that_yields_is_refused_at_rest(tmp_path: Path) -> None:
    with pytest.raises(Unsupported, match=r"drive\.stiffness = 2000"):
        ENGINE.export(request(YIELDING, "ideal", "static"), tmp_path)
    assert not list(tmp_path.iterdir())


def test_backlash_is_refused(tmp_path: Path) -> None:
    with pytest.raises(Unsupported, match=r"drive\.half_gap = 0\.002"):
        ENGINE.export(request(PAPER.replace(drive=Drive(joint="D", speed=20.0, half_gap=2e-3))), tmp_path)
    assert not list(tmp_path.iterdir())

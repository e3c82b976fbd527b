"""What is exported for Exudyn runs in the bare engine and gives the same numbers."""

from __future__ import annotations

import ast
import json
import shlex
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analytic.kinematics.assembly import Assembly
from analytic.mechanism import Drive, Mechanism
from analytic.mechanism.file import load
from asked import request_of
from linkages import curved_slider
from maximal import Maximal
from several_linkages import CASES, KNOTS, SHIPPED, referee, sprung, third_bar, waved
from several_truths import SWINGING, turned_round
from sim_models.common.units import Units
from sim_models.engine import JOINT_MODELS, MOTIONS, JointModel, Motion, Request, Unsupported
from sim_models.exudyn.engine import ENGINE
from test_export import PAPER, SHORT, SLIDER, bare, columns, command, driven_by, table
from tests.evidence.validation.files import apart

pytestmark = [pytest.mark.exudyn, pytest.mark.slow]  # test_export is in the short part

TOLERANCE = 1e-12  # of the largest value of a signal's kind
# A shaft free to swing is stepped without damping: a last digit of its speed, over the step, is an acceleration.
# Exudyn's own runs differ by that, 3e-11 of the reactions, one after another in one process.
REPEATS = {"compliant drive": 1e-9, "compliant drive, backwards": 1e-9}
FILES = {"model.json", "expected.csv", "run.py"}
ROCKER = load("crank-rocker").with_clearances({"B": 2e-4})
TURN = np.radians([0.0, 90.0, 45.0, 90.0])
CURVED = curved_slider()
SOFT = PAPER.with_clearances({}).with_joint("A", radial_stiffness=1e5).with_joint("E", radial_stiffness=3e5)
FEW = np.array([0.1, 0.0, 0.05])  # s
ANGLES = np.radians(30.0) + 1.5 * KNOTS + 4.0 * KNOTS**2
SPRING = {
    "bodies": ("ground", "coupler"), "points": ("D", "B"), "stiffness": 200.0, "length": 0.05, "damping": 3.0
}  # fmt: skip
SPRUNG = PAPER.replace(springs=[SPRING])


def measured(m: Mechanism, **drive: Any) -> Mechanism:
    """The mechanism with a crank that follows a course."""
    return m.replace(drives=(Drive(joint="D", speed="measured", **drive),))


def freed(m: Mechanism, *joints: str) -> Mechanism:
    """The mechanism with free drives in some joints."""
    free = {joint: Drive(joint=joint, speed="free") for joint in joints}
    return m.replace(drives=[free.get(drive.joint, drive) for drive in m.drives])


def moved(m: Mechanism, joint_model: JointModel = "ideal", time: np.ndarray = FEW, **fields: Any) -> Request:
    """A run along courses of all drives that are not free."""
    courses = {name: course for name, course in waved(CASES[m.name]).items() if m.joint(name) in m.motors}
    return request_of(m, joint_model, time=time, courses=courses, **fields)


def rubbed(m: Mechanism) -> Mechanism:
    """The mechanism with friction, drag and a cubic spring in every joint."""
    turning = {"friction_torque": 0.02, "static_torque": 0.03, "stribeck_speed": 0.1, "drag": 0.01, "cubic": 0.3}
    for joint in m.joints:
        law = {"friction": 0.5, "drag": 0.1, "cubic": 3.0} if joint.prismatic else turning
        m = m.with_joint(joint.name, **law)
    return m


GAPS = {"five-bar": "P", "3-rrr": "C1", "3-rpr": "C1", "2r-arm": "K"}
LATE = {  # courses that begin late, with knots of their own
    "O": (np.linspace(7.0, 7.6, 31), -0.4 + np.linspace(0.0, 0.5, 31) ** 2),
    "K": (np.linspace(7.013, 7.6, 47), 1.2 - np.linspace(0.0, 0.7, 47) ** 2),
}
TINY = Units(length=2.0**10, mass=2.0**20)  # a metre and a kilogram of the linkage are one of these
HUGE = Units(length=2.0**-6, mass=2.0**-16)
SEVERAL = {
    **{f"{name}, {model}": moved(CASES[name].with_clearances({pin: 2e-4}), model)
       for name, pin in GAPS.items() for model in JOINT_MODELS},
    **{f"{name}, springs and dampers": request_of(sprung(CASES[name]), time=FEW, courses=waved(CASES[name]))
       for name in SHIPPED},
    **{f"{name}, every law of a joint": moved(rubbed(CASES[name])) for name in ("3-rpr", "five-bar")},
    **{f"{name}, the other way round": moved(turned_round(CASES[name], *joints), time=FEW)
       for name, joints in {"2r-arm": ("O", "K"), "five-bar": ("D", "A")}.items()},
    "rods the other way round": request_of(
        turned_round(CASES["3-rpr"], "S1", "A2"), time=FEW, courses=waved(turned_round(CASES["3-rpr"], "S1", "A2"))
    ),
    "soft bearing": moved(CASES["five-bar"].with_joint("A", radial_stiffness=1e5)),
    "impacts along courses": moved(CASES["five-bar"].with_clearances({"A": 2e-4}), "contact", start="centred"),
    "late courses": request_of(CASES["2r-arm"], time=np.array([7.4, 7.02, 7.58, 7.4]), courses=LATE),
    **{f"elbow free, {model}": moved(freed(CASES["2r-arm"].with_clearances({"O": 2e-4}), "K"), model)
       for model in JOINT_MODELS},
    **{f"all free, {model}": moved(freed(CASES["2r-arm"].with_clearances({"K": 2e-4}), "O", "K"), model)
       for model in JOINT_MODELS},
    "one crank of two free": moved(freed(CASES["five-bar"], "E")),
    **{f"{name}, tiny": TINY.request(moved(CASES[name].with_clearances({pin: 2e-4}), "contact"))
       for name, pin in GAPS.items()},
    **{f"3-rpr, huge, {motion}": HUGE.request(moved(CASES["3-rpr"], motion=motion)) for motion in MOTIONS},
    "no drives": request_of(SWINGING, time=FEW, courses={}),
    "held more than once": request_of(third_bar(), time=FEW, courses=waved(third_bar())),
    **{f"{name}, {model}, at rest": moved(CASES[name].with_clearances({pin: 2e-4}), model, motion="static")
       for name, pin in GAPS.items() for model in JOINT_MODELS},
    "springs, at rest": request_of(sprung(CASES["3-rpr"]), motion="static", time=FEW, courses=waved(CASES["3-rpr"])),
    "every law of a joint, at rest": moved(rubbed(CASES["3-rpr"]), motion="static"),
    "soft bearing, at rest": moved(CASES["five-bar"].with_joint("A", radial_stiffness=1e5), motion="static"),
    "held more than once, at rest": request_of(third_bar(), motion="static", time=FEW, courses=waved(third_bar())),
}  # fmt: skip
REQUESTS = {
    **{
        f"paper, {model}, {motion}": request_of(PAPER, model, motion, SHORT)
        for model in JOINT_MODELS
        for motion in ("driven", "static")
    },
    **{f"crank-rocker, {model}": request_of(ROCKER, model, "driven", TURN, lead_in=0.3) for model in JOINT_MODELS},
    "slider-crank": request_of(driven_by(load("slider-crank"), speed=100.0), "ideal", "driven", TURN),
    "every joint law, driven": request_of(SLIDER, "contact", "driven", SHORT),
    "every joint law, static": request_of(SLIDER.with_joint("A", friction=0.0), "contact", "static", SHORT),
    "laws that are not linear, driven": request_of(CURVED, "ideal", "driven", SHORT),
    "laws that are not linear, static": request_of(CURVED, "ideal", "static", SHORT),
    "linear contact": request_of(PAPER.with_joint("B", contact_damping=300.0), "contact", "driven", SHORT),
    "two gaps, backwards": request_of(
        driven_by(PAPER.with_clearances({"A": 1e-3, "B": 5e-4}), speed=-3.0), "contact", "driven", SHORT
    ),
    "compliant drive": request_of(driven_by(PAPER, stiffness=2000.0), "spring-damper", "driven", SHORT),
    "compliant drive, backwards": request_of(driven_by(PAPER, stiffness=500.0, speed=-3.0), "ideal", "driven", SHORT),
    "compliant drive, static": request_of(driven_by(PAPER, stiffness=500.0), "contact", "static", SHORT),
    "impacts": request_of(ROCKER, "contact", "driven", SHORT, start="centred"),
    "soft bearings, driven": request_of(SOFT, "ideal", "driven", SHORT),
    "soft bearings beside a gap, driven": request_of(SOFT.with_clearances({"B": 1e-3}), "contact", "driven", SHORT),
    "soft bearings, static": request_of(SOFT, "ideal", "static", SHORT),
    "released": request_of(load("pendulum"), "ideal", time=np.array([0.3, 0.1, 0.5])),
    "released with a gap": request_of(
        load("pendulum").with_clearances({"O": 5e-4}), "contact", time=np.array([0.0, 0.1, 0.2])
    ),
    **{
        f"course, {model}": request_of(measured(PAPER), model, time=FEW, course=(KNOTS, ANGLES))
        for model in JOINT_MODELS
    },
    "course, compliant drive": request_of(measured(PAPER, stiffness=2e3), "contact", time=FEW, course=(KNOTS, ANGLES)),
    **{f"spring between points, {m}": request_of(SPRUNG, "contact", m, SHORT) for m in MOTIONS},
    **{f"tiny, {m}": TINY.request(request_of(SPRUNG, "spring-damper", m, SHORT)) for m in MOTIONS},
    **{f"held more than once, {m}": request_of(third_bar(), "ideal", m, SHORT) for m in MOTIONS},
    "held more than once, with a gap": request_of(
        third_bar().with_clearances({"f2": 1e-4}), "contact", "driven", SHORT
    ),
    **SEVERAL,
}


def simulated(request: Request) -> dict[str, np.ndarray]:
    """What is exported of a request: along courses there is no crank's angle, but the joints' positions."""
    trace = ENGINE.simulate(request)
    if request.schedule.crank is not None:
        return columns(trace)
    assert trace.time is not None
    order = np.argsort(trace.time, kind="stable")
    return {name: values[order] for name, values in {"time": trace.time, **trace.signals}.items()}


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Every request's folder, after its script has run in bare Exudyn."""
    folders = {name: tmp_path_factory.mktemp("export") for name in REQUESTS}
    for name, folder in folders.items():
        assert {path.name for path in ENGINE.export(REQUESTS[name], folder)} == FILES
    bare(*folders.values())
    return folders


@pytest.mark.parametrize("name", REQUESTS)
def test_bare_exudyn_gives_the_same_numbers(name: str, exported: dict[str, Path]) -> None:
    found, truth = table(exported[name] / "signals.csv"), simulated(REQUESTS[name])
    assert found.keys() == truth.keys()
    assert apart(found, truth) < REPEATS.get(name, TOLERANCE)
    assert apart(table(exported[name] / "expected.csv"), truth) <= REPEATS.get(name, 0.0)  # 0: to the last digit


@pytest.mark.parametrize(("name", "units"), [("tiny", TINY), ("huge", HUGE)])
def test_linkages_far_from_a_bench_are_exported_in_units_of_their_own(
    name: str, units: Units, exported: dict[str, Path]
) -> None:
    folders = [folder for request, folder in exported.items() if name in request]
    assert folders
    for folder in folders:
        model = json.loads((folder / "model.json").read_text(encoding="utf-8"))
        assert np.sign(np.log(model["units"]["length"])) == -np.sign(np.log(units.length))


@pytest.mark.parametrize(("name", "joint"), [("impacts", "B"), ("impacts along courses", "A")])
def test_pins_of_the_impacting_run_do_fly_free(name: str, joint: str) -> None:
    assert 0 < ENGINE.simulate(REQUESTS[name]).free_share[joint] < 1


@pytest.mark.parametrize("name", SHIPPED)
def test_motors_of_the_bare_script_give_what_newton_and_euler_say(name: str, exported: dict[str, Path]) -> None:
    """Against the referee in maximal coordinates, which knows no engine."""
    found, m = table(exported[f"{name}, ideal"] / "signals.csv"), CASES[name].with_clearances({})
    _, posed = referee(m, waved(m), found["time"])
    most = max(abs(value) for p in posed for value in p.motors.values())
    for joint in m.motors:
        kind = "force" if joint.prismatic else "torque"
        truth = np.array([p.motors[joint.name] for p in posed])
        np.testing.assert_allclose(found[f"drive_{kind}_{joint.name}"], truth, rtol=0, atol=3e-6 * most)


def test_script_imports_exudyn_and_numpy_and_nothing_else(exported: dict[str, Path]) -> None:
    tree = ast.parse((exported["impacts"] / "run.py").read_text(encoding="utf-8"))
    names = {a.name for node in ast.walk(tree) if isinstance(node, ast.Import) for a in node.names}
    names |= {str(node.module) for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert {name.partition(".")[0] for name in names} - set(sys.stdlib_module_names) == {"exudyn", "numpy"}


def test_script_writes_its_signals_and_nothing_else(exported: dict[str, Path]) -> None:
    for folder in exported.values():
        assert {path.name for path in folder.iterdir()} == FILES | {"signals.csv"}
    assert {path for path in exported["impacts"].parent.iterdir() if not path.name.endswith("current")} >= set(
        exported.values()
    )


@pytest.mark.parametrize("name", SHIPPED)
def test_motors_of_the_bare_script_hold_as_much_as_the_referee_says(name: str, exported: dict[str, Path]) -> None:
    """Against the referee, with its courses standing still."""
    found, m = table(exported[f"{name}, ideal, at rest"] / "signals.csv"), CASES[name].with_clearances({})
    judge = Maximal(m, tuple(joint.name for joint in m.motors))
    q, posed = judge.home(Assembly(m).positions), []
    for k in range(found["time"].size):
        posed.append(judge.driven_at(q, {j.name: (found[f"position_{j.name}"][k], 0.0, 0.0) for j in m.motors}))
        q = posed[-1].q
    most = max(abs(value) for p in posed for value in p.motors.values())
    for joint in m.motors:
        kind = "force" if joint.prismatic else "torque"
        truth = np.array([p.motors[joint.name] for p in posed])
        np.testing.assert_allclose(found[f"drive_{kind}_{joint.name}"], truth, rtol=0, atol=1e-8 * most)


STATIC = [f"paper, {model}, static" for model in JOINT_MODELS]


@pytest.mark.parametrize("name", [*STATIC, "3-rpr, ideal, at rest", "five-bar, contact, at rest"])
def test_equilibria_are_found_and_not_read_from_the_file(name: str, tmp_path: Path) -> None:
    ENGINE.export(REQUESTS[name], tmp_path)
    model = json.loads((tmp_path / "model.json").read_text(encoding="utf-8"))
    for near in model["equilibria"]:
        near["bodies"] = [value + 1e-8 * (-1) ** k for k, value in enumerate(near["bodies"])]
    (tmp_path / "model.json").write_text(json.dumps(model), encoding="utf-8")
    bare(tmp_path)
    assert (
        apart(table(tmp_path / "signals.csv"), table(tmp_path / "expected.csv")) < model["residual"]
    )  # N, of some 50 N


@pytest.mark.parametrize(
    ("name", "right", "wrong"),
    [
        ("paper, ideal, driven", '"force": [0.0, 50.0]', '"force": [0.0, 50.001]'),
        ("paper, massless-link, driven", '"force": [0.0, 50.0]', '"force": [0.0, 50.001]'),
        ("paper, spring-damper, static", '"referenceLength": 0.001', '"referenceLength": 0.0009999'),
        ("paper, contact, driven", '"contactStiffness": 10000000.0', '"contactStiffness": 9000000.0'),
        ("spring between points, static", '"stiffness": 200.0', '"stiffness": 200.1'),
    ],
)
def test_a_model_that_was_tampered_with_shows(name: str, right: str, wrong: str, tmp_path: Path) -> None:
    ENGINE.export(REQUESTS[name], tmp_path)
    text = (tmp_path / "model.json").read_text(encoding="utf-8")
    assert right in text
    (tmp_path / "model.json").write_text(text.replace(right, wrong), encoding="utf-8")
    lines = [line.split() for line in bare(tmp_path).splitlines()]
    said = next(float(line[1]) for line in lines if line[0] == "reaction_B_x")
    found, truth = (table(tmp_path / f"{side}.csv")["reaction_B_x"] for side in ("signals", "expected"))
    assert said == pytest.approx(float(np.abs(found - truth).max()), rel=0.05)
    assert said > 1e-6 * float(np.abs(truth).max())


@pytest.mark.parametrize("name", ["3-rpr, ideal", "five-bar, ideal", "elbow free, contact"])
def test_every_course_is_followed_from_the_file(name: str, tmp_path: Path) -> None:
    """Motors that go a thousandth faster, each alone, are a thousandth faster in what the script finds."""
    ENGINE.export(REQUESTS[name], tmp_path)
    text = (tmp_path / "model.json").read_text(encoding="utf-8")
    for joint in json.loads(text)["drives"]:
        model = json.loads(text)
        course = model["drives"][joint]["course"]
        course["cubics"] = [[1.001 * c for c in cubic] for cubic in course["cubics"]]
        (tmp_path / "model.json").write_text(json.dumps(model), encoding="utf-8")
        bare(tmp_path)
        found, truth = (table(tmp_path / f"{side}.csv")[f"position_{joint}"] for side in ("signals", "expected"))
        gone = truth[-1] - truth[0]
        assert found[-1] - found[0] == pytest.approx(1.001 * gone, abs=1e-4 * abs(gone))


@pytest.mark.parametrize("name", ["3-rpr, ideal, at rest", "five-bar, contact, at rest"])
def test_every_drive_is_held_where_the_file_says(name: str, tmp_path: Path) -> None:
    """Each alone, held a thousandth of a radian or a tenth of a millimetre further, is found there, the others not."""
    ENGINE.export(REQUESTS[name], tmp_path)
    text = (tmp_path / "model.json").read_text(encoding="utf-8")
    joints, m = [*json.loads(text)["drives"]], REQUESTS[name].mechanism
    for joint in joints:
        model, aside = json.loads(text), 1e-4 if m.joint(joint).prismatic else 1e-3
        for near in model["equilibria"]:
            near["held"][joint] += aside
        (tmp_path / "model.json").write_text(json.dumps(model), encoding="utf-8")
        bare(tmp_path)
        found, truth = (table(tmp_path / f"{side}.csv") for side in ("signals", "expected"))
        for other in joints:
            gone = found[f"position_{other}"] - truth[f"position_{other}"]
            np.testing.assert_allclose(gone, aside if other == joint else 0.0, rtol=0, atol=1e-9)


def test_command_writes_a_linkage_of_several_drives(tmp_path: Path) -> None:
    folder = tmp_path / "new"
    status, *_ = command("--simulator", "exudyn", "--case", "3-rpr", "--times", "0:0.2:0.05", "--out", str(folder))
    assert status == 0
    assert "3-rpr, ideal joints, driven: 5 samples" in bare(folder)
    found = table(folder / "signals.csv")
    assert apart(found, table(folder / "expected.csv")) < TOLERANCE
    assert "crank_angle" not in found
    for drive in load("3-rpr").drives:
        rate = np.diff(found[f"position_{drive.joint}"]) / 0.05
        assert rate == pytest.approx(drive.speed, rel=1e-6)


def test_command_writes_the_files_and_says_how_to_run_them(tmp_path: Path) -> None:
    folder = tmp_path / "new"
    arguments = ["--case", "crank-rocker", "--joint", "contact", "--clearance", "B=2e-4", "--angles", "0:90:45"]
    status, said, _ = command("--simulator", "exudyn", *arguments, "--out", str(folder))
    assert status == 0
    assert {path.name for path in folder.iterdir()} == FILES
    assert said.splitlines()[-1].endswith(f"python {shlex.quote(str(folder / 'run.py'))}")
    assert "exudyn" in said.splitlines()[-1]
    assert "crank-rocker, contact joints, driven: 3 samples" in bare(folder)
    assert apart(table(folder / "signals.csv"), table(folder / "expected.csv")) < TOLERANCE
    model = json.loads((folder / "model.json").read_text(encoding="utf-8"))
    assert model["stages"][1][1] == pytest.approx(2 * np.pi / ROCKER.speed)  # the turn in which it settles


@pytest.mark.parametrize(
    ("mechanism", "motion", "words"),
    [
        (PAPER.with_joint("B", friction=0.1), "static", "friction"),
        (PAPER.replace(drive=Drive(joint="D", speed="measured")), "driven", "measured drive"),
    ],
)
def test_what_exudyn_does_not_do_is_not_exported(
    mechanism: Mechanism, motion: Motion, words: str, tmp_path: Path
) -> None:
    with pytest.raises(Unsupported, match=words):
        ENGINE.export(request_of(mechanism, "contact", motion, SHORT), tmp_path)
    assert not list(tmp_path.iterdir())

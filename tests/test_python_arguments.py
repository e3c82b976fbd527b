"""``import linkage_crosscheck as lc``: what is given wrongly is one sentence of one type, whatever the function."""

from __future__ import annotations

import contextlib
import json
import math
import os
import pickle
import re
import threading
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import commands
import linkage_crosscheck as lc
from analytic.kinematics.closure import AssemblyError
from analytic.kinematics.structure import StructureError
from analytic.mechanism import MechanismError, MechanismWarning
from analytic.mechanism.file import dumps, load
from analytic.paper.frame import ComplianceError
from analytic.writing import OutputError
from compare import progress
from compare.arguments import engines, every_one, names, numbers, refuse_large
from compare.baseline.file import BaselineError
from compare.cli.app import app
from compare.diagnose.data.recording import MeasuredError
from compare.domain_map.map import MapPlan
from compare.domain_map.validity import plan_of
from compare.faults import ArgumentError, DegreesWarning
from compare.judge.tolerances import ToleranceError
from compare.questions.diagnose import DiagnoseQuestion
from compare.questions.option import Speeds
from compare.questions.validity import ValidityQuestion
from compare.results.document import DocumentError
from compare.sweep import ClusterError
from sample_result import as_document, sample_result
from sim_models.engine import SimulationError, SimulatorMissing, Unsupported

PAPER = lc.load("paper")


def one_sentence(error: BaseException, *words: str) -> None:
    """The message has these words and neither a second line, an address nor an option of the command."""
    text = str(error)
    for never in ("\n", "http", "--"):
        assert never not in text, text
    for word in words:
        assert word in text, f"{text!r} has no {word!r}"


# ------------------------------------------------------------------ one type to catch


@pytest.mark.parametrize(
    "kind",
    [
        AssemblyError, StructureError, ComplianceError, MechanismError, MeasuredError, BaselineError, ArgumentError,
        OutputError, ToleranceError, DocumentError, ClusterError, Unsupported,
    ],
)  # fmt: skip
def test_every_fault_of_what_was_given_is_an_error_and_a_value_error(kind: type[Exception]) -> None:
    assert issubclass(kind, lc.Error)
    assert issubclass(kind, ValueError)


@pytest.mark.parametrize("kind", [SimulatorMissing, SimulationError])
def test_every_fault_of_a_simulator_is_an_error_and_a_runtime_error(kind: type[Exception]) -> None:
    assert issubclass(kind, lc.Error)
    assert issubclass(kind, RuntimeError)


def test_an_argument_error_comes_back_whole_from_another_process() -> None:
    found = pickle.loads(pickle.dumps(ArgumentError("angles", "give some")))
    assert str(found) == "angles: give some"
    assert found.argument == "angles"


# ------------------------------------------------------------------ a mechanism changed in Python


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda: PAPER.replace(sped=3), ["'sped'", "gravity", "drives", "assembly"]),
        (lambda: PAPER.replace(speed=3), ["'speed'", "changed by with_drive(speed=...)"]),
        (lambda: PAPER.replace(clearance=3), ["'clearance'", "changed by with_joint(NAME, clearance=...)"]),
        (lambda: PAPER.replace(mass=3), ["'mass'", "changed by with_body(NAME, mass=...)"]),
        (lambda: PAPER.replace(bodies=[]), ["body = []"]),
        (
            lambda: PAPER.replace(tolerances={"joint.B.clearance": {"uniform": 2e-5}}),
            ["tolerances.joint.B.clearance.uniform is not a field", "sd, limits, distribution, group"],
        ),
        (lambda: PAPER.with_drive(speed="5 mm"), ["speed = '5 mm' has unit 'mm'", "rad/s"]),
        (lambda: PAPER.replace(gravity="no"), ["gravity = 'no'"]),
        (lambda: PAPER.replace(drive={"joint": "D", "speed": "fast"}), ["drive.speed = 'fast'"]),
        (lambda: PAPER.with_body("crankk"), ["'crankk'", "did you mean 'crank'", "coupler"]),
        (lambda: PAPER.with_body("crank", mass=-1), ["body[crank].mass = -1", "greater than 0"]),
        (lambda: PAPER.with_body("crank", weight=1), ["body[crank].weight is not a field"]),
        (lambda: PAPER.with_joint("Q", clearance=0.0), ["'Q'", "D, A, B, E"]),
        (lambda: PAPER.with_joint("B", clearance="wide"), ["joint[B].clearance = 'wide'"]),
        (lambda: PAPER.with_joint("B", clearance="1 kg"), ["paper: joint[B].clearance = '1 kg' has unit 'kg'"]),
        (lambda: PAPER.with_clearances({"B": -1}), ["joint[B].clearance = -1"]),
        (lambda: PAPER.with_clearances({"B": 1.0}), ["clearance = 1.0 m", "coupler"]),
        (lambda: PAPER.with_clearances({"Q": 1e-4}), ["'Q'", "D, A, B, E"]),
        (lambda: PAPER.with_clearances("B"), ["'B'", "metres by joint"]),
        (lambda: lc.Drive(joint="D", speed="fast"), ["Drive: speed = 'fast'", "'free' or 'measured'"]),
        (lambda: lc.Body(name="rod", points={"A": (0.0, 0.0)}, mass=-1.0), ["Body: mass = -1"]),
    ],
)
def test_a_wrong_change_of_a_mechanism_says_where_and_what_is_accepted(
    change: Callable[[], object], words: list[str]
) -> None:
    with pytest.raises(MechanismError) as caught:
        change()
    one_sentence(caught.value, *words)


def test_a_right_change_of_a_mechanism_is_made() -> None:
    assert PAPER.replace(gravity=(0.0, -9.81)).gravity == (0.0, -9.81)
    assert PAPER.with_body("crank", mass=2.0).moving["crank"].mass == 2.0
    assert PAPER.with_clearances({"B": np.float64(1e-4)}).clearances == {"B": 1e-4}


def test_a_fault_within_a_part_of_a_file_is_still_named_by_its_place(tmp_path: Path) -> None:
    path = tmp_path / "heavy.toml"
    path.write_text(dumps(PAPER).replace("mass = 0.157", "mass = -1", 1))
    with pytest.raises(MechanismError, match=re.escape("body[crank].mass = -1")):
        lc.load(path)


# ------------------------------------------------------------------ wrong arguments


ANGLES = np.array([1.0])
CALLS: dict[str, Callable[..., object]] = {
    "analyse": lambda **given: lc.analyse("crank-rocker", **({"angles": ANGLES} | given)),
    "simulate": lambda **given: lc.simulate("crank-rocker", **({"angles": ANGLES} | given)),
    "crosscheck": lambda **given: lc.crosscheck("crank-rocker", **({"angles": ANGLES} | given)),
    "accuracy": lambda **given: lc.accuracy("paper", **({"angles": ANGLES, "samples": 10} | given)),
    "validity": lambda **given: lc.validity("paper", **({"speeds": [60.0], "clearances": [1e-4]} | given)),
    "diagnose": lambda **given: lc.diagnose(**({"measured": "no-such-file"} | given)),
    "show": lc.show,
    "check_baselines": lambda **given: lc.check_baselines("paper", **({"simulator": "mujoco"} | given)),
    "export": lambda **given: lc.export("paper", **given),
}
WRONG = [
    ("analyse", {"angles": ["a"]}, "['a']"),
    ("analyse", {"angles": "20:160"}, "20:160: give start:stop:step in degrees"),
    ("crosscheck", {"angles": "0:1:a"}, "0:1:a: give start:stop:step in degrees"),
    ("analyse", {"angles": "20, 160"}, "'20, 160'"),
    ("analyse", {"angles": [[0.5, 0.6]]}, "flat"),
    ("analyse", {"angles": [[0.5], [0.6, 0.7]]}, "flat"),
    ("analyse", {"angles": [True]}, "[True]"),
    ("analyse", {"angles": [0.5, None]}, "rad"),
    ("analyse", {"angles": [np.nan]}, "finite"),
    ("analyse", {"angles": []}, "rad"),
    ("analyse", {"angles": [1e9]}, "17453.3 rad"),
    ("analyse", {"angles": np.zeros(1_000_001)}, "1000000"),
    ("analyse", {"clearance": {"B": "much"}}, "B = 'much'"),
    ("analyse", {"clearance": {"B": None}}, "B = None"),
    ("analyse", {"clearance": {"B": True}}, "B = True"),
    ("analyse", {"clearance": {"B": 1.0}}, "not smaller"),
    ("analyse", {"large": 1}, "True or False"),
    ("analyse", {"clearance": ["B"]}, "metres by joint"),
    ("analyse", {"clearance": "1e-3"}, "metres by joint"),
    ("analyse", {"model": "second"}, "'first_order' or 'equilibrium'"),
    ("analyse", {"motion": "fast"}, "'driven' or 'static'"),
    ("analyse", {"compliance": "yes"}, "True or False"),
    ("crosscheck", {"analytic": "x"}, "'first_order' or 'equilibrium'"),
    ("crosscheck", {"motion": "fast"}, "'driven' or 'static'"),
    ("crosscheck", {"joint_model": "bushing"}, "'massless-link'"),
    ("crosscheck", {"joint_model": "contact"}, "give `clearance` (m by joint)"),
    ("crosscheck", {"flexible": "yes"}, "True or False"),
    ("crosscheck", {"simulator": []}, "mujoco"),
    ("crosscheck", {"simulator": ["mujoco", "all"]}, "all by itself"),
    ("crosscheck", {"simulator": 5}, "5"),
    ("crosscheck", {"workers": 0}, "1 or more"),
    ("crosscheck", {"workers": -3}, "1 or more"),
    ("crosscheck", {"workers": 1.5}, "1 or more"),
    ("crosscheck", {"tolerances": {}}, "tolerance file"),
    ("simulate", {"simulator": ["mujoco"]}, "['mujoco']"),
    ("simulate", {"joint_model": "bushing"}, "'contact'"),
    ("accuracy", {"samples": "many"}, "from 2 to 1000000"),
    ("accuracy", {"samples": 10**8}, "from 2 to 1000000"),
    ("accuracy", {"seed": -1}, "0 or more"),
    ("accuracy", {"nonlinear": "yes"}, "True or False"),
    ("accuracy", {"outputs": 5}, "a list of names"),
    ("accuracy", {"clearance_tolerance": "1e-4"}, "metres by joint"),
    ("accuracy", {"limits": "follower_angle"}, "give OUTPUT=VALUE"),
    ("accuracy", {"limits": 5}, "give them by name"),
    ("validity", {"clearances": [1.0]}, "not smaller"),
    ("validity", {"clearances": "narrow"}, "'narrow'"),
    ("validity", {"speeds": [0.0]}, "rad/s above 0"),
    ("validity", {"speeds": [1.0, 1.0]}, "once"),
    ("validity", {"joints": []}, "one name"),
    ("validity", {"joint_model": "bushing"}, "'contact'"),
    ("validity", {"records": 5}, "a path"),
    ("validity", {"workers": 0}, "1 or more"),
    ("validity", {"tolerances": {}}, "tolerance file"),
    ("diagnose", {"only": 5}, "a list of names"),
    ("diagnose", {"others": "some"}, "True or False"),
    ("diagnose", {"workers": 0}, "1 or more"),
    ("diagnose", {"simulator": ["mujoco"]}, "['mujoco']"),
    ("diagnose", {"measured": 5}, "a path"),
    ("diagnose", {"own": ["rust"]}, "a list of effects"),
    ("validity", {"dask": 5}, "address"),
    ("show", {"result": 5}, "a cross-check"),
    ("check_baselines", {"folder": 5}, "a path"),
    ("check_baselines", {"simulator": []}, "mujoco"),
    ("export", {"folder": 5}, "a path"),
]


@pytest.mark.mujoco
@pytest.mark.parametrize(("call", "given", "word"), WRONG, ids=lambda value: str(value)[:40])
def test_a_wrong_argument_is_one_sentence_that_names_it(call: str, given: dict[str, object], word: str) -> None:
    with pytest.raises(ArgumentError) as caught:
        CALLS[call](**given)
    assert [caught.value.argument] == list(given)
    one_sentence(caught.value, f"{next(iter(given))}: ", word)


LOOSE: dict[str, Callable[..., object]] = {
    "analyse": lambda **given: lc.analyse("paper", **({"angles": ANGLES} | given)),
    "simulate": lambda **given: lc.simulate("paper", joint_model="contact", **({"angles": ANGLES} | given)),
    "crosscheck": lambda **given: lc.crosscheck("paper", joint_model="contact", **({"angles": ANGLES} | given)),
    "accuracy": lambda **given: lc.accuracy("paper", **({"angles": ANGLES, "samples": 10} | given)),
    "platform_accuracy": lambda **given: lc.platform_accuracy("paper", times=[0.0, 0.1], **given),
    "export": lambda **given: lc.export("paper", joint_model="contact", folder="out", **({"angles": ANGLES} | given)),
    "check": lambda **given: lc.check("rested.csv", "paper", motion="static", **given),
}


@pytest.mark.long_rows("check")
@pytest.mark.mujoco
@pytest.mark.parametrize("call", LOOSE)
def test_a_clearance_of_more_than_a_tenth_of_a_body_is_taken_only_where_it_is_meant(
    call: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Crank and follower of the paper are 200 mm long, its coupler is 400 mm long."""
    monkeypatch.chdir(tmp_path)
    Path("rested.csv").write_text("crank_angle [deg],drive_torque [N.m]\n57,0\n58,0\n", encoding="utf-8")
    what, still = LOOSE[call], {} if call == "platform_accuracy" else {"motion": "static"}
    if call == "check":
        still = {}
    with pytest.raises(ArgumentError) as caught:
        what(clearance={"B": 0.0201}, **still)
    said = "joint 'B' has clearance = 0.0201 m, more than a tenth of body 'follower' (0.2 m)"
    one_sentence(caught.value, "clearance: ", said, "`large`")
    what(clearance={"B": 0.02}, **still)
    what(clearance={"B": 0.0201}, large=True, **still)


def test_a_map_takes_large_clearances_only_where_they_are_meant() -> None:
    def grid(**asked: object) -> MapPlan:
        return plan_of(ValidityQuestion("paper", speeds=[60.0], **asked))

    with pytest.raises(
        ArgumentError, match=r"^clearances: joint 'B' has clearance = 0\.0201 m, more than a tenth of body"
    ):
        grid(clearances=[1e-4, 0.0201])
    assert grid(clearances=[1e-4, 0.0201], large=True).clearances == (1e-4, 0.0201)
    assert grid(clearances=[1e-4, 0.02]).clearances == (1e-4, 0.02)


def test_what_has_no_length_sets_no_limit_and_a_block_is_as_long_as_in_its_guide() -> None:
    m = load("slider-crank").with_joint("B", pin_radius=None)  # its slider is a point in that pin
    limit = min(m.moving[name].length for name in m.joint("B").bodies if m.moving[name].length > 0) / 10
    refuse_large(m.with_clearances({"B": limit}), "clearance")
    with pytest.raises(ArgumentError, match="more than a tenth of body"):
        refuse_large(m.with_clearances({"B": 1.01 * limit}), "clearance")
    m = m.with_joint("S", guide=(0.06, 0.002), clearance=0.006)  # a flat block may turn little, whatever its height
    refuse_large(m, "mechanism")
    with pytest.raises(
        ArgumentError, match=r"joint 'S' has clearance = 0\.0061 m, more than a tenth of its block \(0\.06 m\)"
    ):
        refuse_large(m.with_joint("S", clearance=0.0061), "mechanism")


def test_a_clearance_of_more_than_a_tenth_of_its_pin_is_taken_only_where_it_is_meant() -> None:
    m = load("slider-crank").with_joint("B", pin_radius=0.01)
    refuse_large(m.with_clearances({"B": 1e-3}), "clearance")
    with pytest.raises(ArgumentError, match=r"0\.0011 m, more than a tenth of its pin's radius \(0\.01 m\)"):
        refuse_large(m.with_clearances({"B": 1.1e-3}), "clearance")


@pytest.mark.parametrize("what", [5, None])
def test_what_is_no_mechanism_is_refused(what: object) -> None:
    with pytest.raises(MechanismError, match=f"{what}: give the name of a case"):
        lc.analyse(what)


def test_what_is_no_measurement_is_refused() -> None:
    with pytest.raises(MeasuredError, match=r"^'5' is no path; give that of a measured\.toml"):
        lc.read_measured(5)


@pytest.mark.mujoco
@pytest.mark.parametrize("call", ["crosscheck", "validity"])
def test_a_tolerance_file_that_is_missing_is_named_as_the_argument(call: str) -> None:
    with pytest.raises(ToleranceError) as caught:
        CALLS[call](tolerances="none.toml")
    one_sentence(caught.value, "tolerances none.toml: cannot be read")


def test_what_is_no_case_of_a_baseline_is_refused() -> None:
    with pytest.raises(MechanismError, match="5: give the name of a case"):
        lc.check_baselines(5)


# ------------------------------------------------------------------ one in place of several


def test_a_single_name_and_a_single_number_are_one() -> None:
    one = lc.accuracy("paper", outputs="coupler.B", angles=1.0, samples=10)
    assert list(one.outputs) == list(lc.accuracy("paper", outputs=["coupler.B"], angles=[1.0], samples=10).outputs)
    assert one.crank_angle.tolist() == [1.0]
    assert Speeds().check(60.0, "speeds") == (60.0,)
    assert names("rust", "only") == ("rust",)


def test_numbers_of_any_kind_are_taken() -> None:
    for given in (range(1, 3), (1, 2), np.array([1, 2]), np.float32([1, 2]), (x for x in (1, 2))):
        found = numbers(given, "angles", "rad")
        assert found.dtype == float
        assert found.tolist() == [1.0, 2.0]


@pytest.mark.mujoco
@pytest.mark.parametrize("given", ["MuJoCo", "mujoco, Mujoco", ["MUJOCO"], ("mujoco",)])
def test_engines_are_named_in_any_letters_with_commas_or_in_a_list(given: str | list[str]) -> None:
    assert engines(given) == (("mujoco",), [])
    assert not every_one(given)


def test_all_engines_in_any_letters() -> None:
    for given in ("all", "ALL", ["All"]):
        assert every_one(given)


# ------------------------------------------------------------------ degrees in place of radians


def test_angles_beyond_two_turns_are_asked_whether_they_are_degrees() -> None:
    with pytest.warns(
        UserWarning, match="40 rad is beyond two turns; angles are in radians; was it meant in degrees"
    ) as told:
        found = lc.analyse("crank-rocker", angles=range(20, 50, 10))
    (text,) = (each for each in found.warnings if "degrees" in each)
    assert [str(each.message) for each in told if each.category is DegreesWarning] == [text]
    assert text.endswith('Write np.radians(...), or a text, "40 deg"')


def test_angles_in_degrees_that_are_not_reached_are_asked_too() -> None:
    with pytest.warns(UserWarning, match="degrees"), pytest.raises(ArgumentError):
        lc.analyse("paper", angles=[20, 30])


@pytest.mark.parametrize(
    "asked",
    [
        lambda file: lc.load(file),
        lambda file: lc.analyse(file, clearance={"B": 1e-4}),
        lambda file: lc.accuracy(file, clearance={"B": 1e-4}, samples=10),
        lambda file: lc.simulate(file, clearance={"B": 1e-4}, motion="static", angles="0:20:10"),
        lambda file: lc.crosscheck(file, clearance={"B": 1e-4}, motion="static", joint_model="massless-link"),
        lambda file: lc.sweep(file, {"joint.B.clearance": [1e-4, 2e-4]}, workers=1),
    ],
)
def test_an_assembly_angle_that_looks_like_degrees_is_asked_about_once_with_how_it_is_written(
    asked: Callable[[Path], object], tmp_path: Path
) -> None:
    m = lc.load("crank-rocker")
    with pytest.warns(MechanismWarning):
        file = m.replace(assembly=m.assembly | {"crank": 20 * math.pi}).write(tmp_path / "turned.toml")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        asked(file)
    (told,) = (str(each.message) for each in caught if issubclass(each.category, MechanismWarning))
    assert "assembly.crank is 62.8319 rad" in told
    assert 'Write "62.8319 deg"' in told
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        m.replace(assembly=m.assembly | {"crank": "62.8319 deg"})


def test_a_mechanism_that_is_changed_is_asked_about_what_is_new() -> None:
    with pytest.warns(MechanismWarning, match="assembly.crank is 30 rad"):
        asked = PAPER.replace(assembly=PAPER.assembly | {"crank": 30.0})
    with pytest.warns(MechanismWarning) as told:
        asked.with_body("coupler", points={"A": (0.0, 0.0), "B": (400.0, 0.0)})
    assert [str(each.message) for each in told] == [
        "paper: coupler.points.B is 400 m; lengths are in metres, was it meant in millimetres?"
    ]


def test_angles_within_two_turns_are_not(recwarn: pytest.WarningsRecorder) -> None:
    lc.analyse("crank-rocker", angles=[-12.5, 0.0, 12.5])
    assert not recwarn.list


def test_a_command_takes_degrees_and_does_not_ask(tmp_path: Path) -> None:
    run = CliRunner().invoke(
        app, ["analyse", "--case", "crank-rocker", "--angles", "0:1080:360", "--out", str(tmp_path), "--quiet"]
    )
    assert run.exit_code == 0
    told = json.loads((tmp_path / "analysis.json").read_text())["warnings"]
    assert not any("degrees" in text for text in (run.output, *told))


# ------------------------------------------------------------------ files and engines by name


def test_a_table_is_written_where_a_path_says(tmp_path: Path) -> None:
    found = lc.analyse("crank-rocker", angles=[0.5, 1.0])
    assert found.to_csv(tmp_path / "table.csv") == tmp_path / "table.csv"
    assert (tmp_path / "table.csv").read_text(encoding="utf-8") == found.to_csv()
    with pytest.raises(OutputError) as caught:
        found.to_csv(tmp_path / "nowhere" / "table.csv")
    one_sentence(caught.value, "nowhere")


@pytest.mark.slow
@pytest.mark.mujoco
@pytest.mark.exudyn
def test_the_command_takes_engines_with_commas_between_them(tmp_path: Path) -> None:
    asked = "--simulator MuJoCo,exudyn --case crank-rocker --joint ideal --angles 20:30:10 --quiet"
    run = CliRunner().invoke(app, [*asked.split(), "--out", str(tmp_path)])
    assert run.exit_code == 0, run.output
    runs = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))["runs"]
    assert [each["simulator"]["name"] for each in runs] == ["mujoco", "exudyn"]


def test_a_moment_that_is_no_number_is_refused() -> None:
    result = as_document(sample_result())
    with pytest.raises(ArgumentError) as caught:
        lc.show(result, "drive_torque", at="x")
    one_sentence(caught.value, "at: 'x'", "rad")


# ------------------------------------------------------------------ progress


@contextlib.contextmanager
def terminal() -> Iterator[list[bytes]]:
    """A pseudo-terminal in place of standard error; what was written to it stands in the list afterwards."""
    ours, theirs = os.openpty()
    seen: list[bytes] = []

    def read() -> None:
        with contextlib.suppress(OSError):  # its end
            while piece := os.read(ours, 4096):
                seen.append(piece)

    reader = threading.Thread(target=read)
    reader.start()
    with os.fdopen(theirs, "w", encoding="utf-8") as stream, contextlib.redirect_stderr(stream):
        yield seen
    reader.join()
    os.close(ours)


@pytest.mark.mujoco
@pytest.mark.skipif(os.name != "posix", reason="has pseudo-terminals as POSIX does")
@pytest.mark.parametrize(("given", "told"), [({}, True), ({"progress": print}, False)], ids=["by itself", "print"])
def test_python_tells_its_progress_on_a_terminal_and_only_there(
    given: dict[str, object], told: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = {"motion": "static", "joint_model": "ideal", "angles": [0.6, 0.7], "workers": 1, **given}
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(progress, "TICK", 0.01)  # it ends within a second
    with terminal() as seen:
        lc.crosscheck("paper", **asked)
    said = b"".join(seen)
    assert (b"mujoco" in said and b"/1" in said) == told
    assert capsys.readouterr().out.splitlines()[:1] == ([] if told else ["mujoco 0 1"])
    lc.crosscheck("paper", **asked)
    assert capsys.readouterr().err == ""


@pytest.mark.mujoco
@pytest.mark.parametrize(("ci", "told"), [("true", True), ("", False)])
def test_the_log_of_ci_has_a_line_now_and_then(
    ci: str, told: bool, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("CI", ci)
    monkeypatch.delenv("GITHUB_ACTIONS", raising=False)
    monkeypatch.setattr(progress, "LOGGED", 0.0)
    lc.crosscheck("paper", motion="static", joint_model="ideal", angles=[0.6, 0.7], workers=1)
    assert bool(re.search(r"mujoco ideal.*\b0:00\n", capfd.readouterr().err)) == told


# ---------------------------------------------------------------- the same words, and what they were before


@pytest.mark.parametrize(
    ("text", "degrees"),
    [("0:1080:360", [0, 360, 720, 1080]), ("30:60:15", [30, 45, 60]), ("0:1 rad:0.5 rad", np.degrees([0, 0.5, 1]))],
)
def test_a_range_of_angles_is_a_text_as_a_command_has_it_and_nobody_is_asked_for_radians(
    text: str, degrees: list[float], recwarn: pytest.WarningsRecorder
) -> None:
    found = {
        "analyse": lc.analyse("crank-rocker", angles=text).crank_angle,
        "simulate": lc.simulate("crank-rocker", angles=text, motion="static").crank_angle,
        "accuracy": lc.accuracy("crank-rocker", clearance={"B": 1e-4}, angles=text).crank_angle,
        "crosscheck": lc.crosscheck("crank-rocker", angles=text, motion="static").runs[0].crank_angle,
    }
    for asked, angles in found.items():
        np.testing.assert_allclose(angles, np.radians(degrees), rtol=1e-12, atol=1e-12, err_msg=asked)
    assert not [each for each in recwarn if "radians" in str(each.message)]


def test_a_range_of_times_is_a_text_as_a_command_has_it() -> None:
    found = lc.analyse("five-bar", times="0:100:50 ms")
    np.testing.assert_allclose(found.time, [0.0, 0.05, 0.1], rtol=1e-12)
    with pytest.raises(ArgumentError, match="times: 0:1:0: give a start of 0 or more"):
        lc.crosscheck("five-bar", times="0:1:0")


def test_speeds_clearances_and_angles_may_be_texts_with_their_unit() -> None:
    """As a command line and a mechanism file take them."""
    assert numbers(["60 rpm", 10.0], "speeds", "rad/s").tolist() == pytest.approx([2 * math.pi, 10.0])
    assert numbers("60 rpm, 0.5 rev/s", "speeds", "rad/s").tolist() == pytest.approx([2 * math.pi, math.pi])
    assert numbers("30 deg", "angles", "rad").tolist() == pytest.approx([math.pi / 6])
    for wrong in ("60 kg", "60", "fast", ["1 rpm", "60"]):
        with pytest.raises(ArgumentError, match="speeds: "):
            numbers(wrong, "speeds", "rad/s")
    question = ValidityQuestion(speeds="60 rpm,30 rpm", clearances=["0.1 mm"])
    assert question.speeds == pytest.approx((math.pi, 2 * math.pi))
    assert question.clearances == pytest.approx((1e-4,))
    by_text = lc.analyse("paper", motion="static", angles=["30 deg", "60 deg"])
    np.testing.assert_allclose(by_text.crank_angle, np.radians([30.0, 60.0]))


@pytest.mark.parametrize("name", ["crosscheck", "check", "validity", "check_baselines"])
def test_an_argument_s_earlier_name_is_taken_and_warned_of(name: str) -> None:
    """An engine that there is not is refused under its name now, whichever was given."""
    asked = {"check": {"results": "none.csv"}, "validity": {"speeds": [1.0], "clearances": [1e-4]}}.get(name, {})
    with pytest.warns(DeprecationWarning, match=r"simulators= is called simulator= now") as warned:
        with pytest.raises(lc.Error, match=r"no-engine|none\.csv"):
            getattr(lc, name)(simulators="no-engine", **asked)
    assert warned[0].filename == __file__
    with pytest.raises(TypeError):
        getattr(lc, name)(simulators="mujoco", simulator="mujoco", **asked)


def test_validity_says_joints_and_takes_at_as_before(tmp_path: Path) -> None:
    asked = ["validity", "--speeds", "60", "--clearances", "1e-4"]
    for option in ("--joints", "--at"):
        done = commands.compare(*asked, option, "Q", cwd=tmp_path)
        assert done.returncode == 2
        assert done.stderr.startswith("compare: --joints Q: 'Q' is not a revolute joint of paper")
    with pytest.warns(DeprecationWarning, match="at= is called joints= now"):
        with pytest.raises(ArgumentError, match="joints: 'Q' is not a revolute joint"):
            lc.validity("paper", speeds=[1.0], clearances=[1e-4], at="Q")  # type: ignore[call-arg]


def test_parts_take_what_is_written_with_its_unit_as_a_file_does() -> None:
    """Lengths, masses, angles and speeds of parts made in Python, alone and within a mechanism that is changed."""
    rod = lc.Body(
        name="rod",
        points={"A": ("0 mm", 0), "B": ("50 mm", "1 m")},  # type: ignore[dict-item]
        mass="500 g",  # type: ignore[arg-type]
    )
    assert (rod.mass, rod.points["B"]) == (0.5, (0.05, 1.0))
    between: Any = {"name": "C", "type": "prismatic", "bodies": ("a", "b"), "axis": (1, 0)}
    slide = lc.Joint(**between, damping="2 N.s/mm")  # type: ignore[arg-type]
    assert slide.damping == pytest.approx(2000.0)
    spring = lc.Spring(bodies=("a", "b"), points=("A", "B"), stiffness="2 N/mm")  # type: ignore[arg-type]
    assert spring.stiffness == pytest.approx(2000.0)
    changed = PAPER.with_joint("B", clearance="0.1 mm").with_body("crank", mass="300 g").with_drive(speed="60 rpm")
    changed = changed.replace(gravity=(0, "-981 mm/s^2"), assembly={**PAPER.assembly, "crank": "90 deg"})
    assert changed.clearances == {"B": pytest.approx(1e-4)}
    assert (changed.moving["crank"].mass, changed.speed) == (0.3, pytest.approx(2 * math.pi))
    assert (changed.gravity, changed.assembly["crank"]) == ((0.0, pytest.approx(-0.981)), pytest.approx(math.pi / 2))


def test_engines_beside_are_asked_for_by_the_words_of_the_command_too() -> None:
    given = [DiagnoseQuestion("data", others=each).others for each in (True, "all", False, "none")]
    assert given == [True, True, False, False]


def test_an_angle_is_text_with_its_unit_and_one_that_looks_like_degrees_is_warned_of_at_the_callers_line() -> None:
    found = as_document(sample_result())
    assert lc.show(found, "reaction_B_angle", at="20 deg").at == pytest.approx(math.radians(20.0))
    for call in (lambda: lc.show(found, "reaction_B_angle", at=30.0), lambda: lc.analyse(PAPER, angles=[1.0, 30.0])):
        with warnings.catch_warnings(record=True) as caught, contextlib.suppress(lc.Error):
            warnings.simplefilter("always")
            call()
        (warned,) = (each for each in caught if "30 rad is beyond two turns" in str(each.message))
        assert warned.filename == __file__


@pytest.mark.parametrize("case", ["paper", "slider-crank", "crank-rocker"])
def test_a_mechanism_that_is_changed_in_python_is_written_and_read_again(case: str, tmp_path: Path) -> None:
    own = lc.load(case)
    changed = own.with_drive(speed="600 rpm").with_clearances({own.may_be_loose[0]: 1e-4}).replace(name="mine")
    assert lc.load(changed.write(tmp_path / "mine.toml")) == changed
    assert [file.name for file in tmp_path.iterdir()] == ["mine.toml"]
    with pytest.raises(OutputError, match="cannot be written"):
        changed.write(tmp_path / "nowhere" / "mine.toml")


def test_the_faults_of_several_parts_are_told_at_once_and_the_linkage_once() -> None:
    with pytest.raises(MechanismError, match=r"'B': axis, angle.*; joint 'E': axis, angle.*; drive.joint = 'Q'"):
        PAPER.replace(
            joints=[j.model_copy(update={"angle": 1.0} if j.name in "BE" else {}) for j in PAPER.joints],
            drive={"joint": "Q", "speed": 1.0},
        )
    with pytest.raises(MechanismError, match=r"^paper: assembly.coupler and assembly.follower are missing"):
        lc.analyse(PAPER.replace(assembly={"crank": 1.0}))


def test_a_drive_that_is_made_in_python_takes_its_speed_as_a_file_does() -> None:
    paper = load("paper").replace(drive=lc.Drive(joint="D", speed="60 rpm"))  # type: ignore[arg-type]
    assert paper.speed == pytest.approx(2 * math.pi)
    assert lc.Drive(joint="D", speed="free").speed == "free"
    with pytest.raises(MechanismError, match=r"speed = '3 kg' has unit 'kg', which is of another dimension"):
        lc.Drive(joint="D", speed="3 kg")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "said"),
    [("speed", "changed by with_drive(speed=...) of the mechanism, or by sweep"), ("motoin", "'motion'?")],
)
def test_an_argument_that_there_is_not_is_refused_by_the_functions_own_name(name: str, said: str) -> None:
    with pytest.raises(TypeError, match=rf"analyse\(\) has no argument '{name}'.*{re.escape(said)}$"):
        lc.analyse("crank-rocker", **{name: "60 rpm"})


def test_an_argument_called_as_on_the_command_line_is_told_by_its_name_in_python() -> None:
    with pytest.raises(TypeError, match=r"crosscheck\(\) has no argument 'joint'; did you mean 'joint_model'\?$"):
        lc.crosscheck("paper", joint="contact")  # type: ignore[call-arg]


def test_completion_offers_what_results_and_mechanisms_have_and_nothing_of_pydantic() -> None:
    for one, own in (
        (as_document(sample_result()), "to_dataframe"),
        (PAPER, "with_drive"),
        (PAPER.joints[0], "clearance"),
    ):
        assert own in dir(one)
        assert not {"parse_raw", "from_orm", "model_dump", "copy"} & {*dir(one)}


def test_a_name_that_is_none_of_the_package_is_told_the_near_one() -> None:
    with pytest.raises(AttributeError, match="did you mean 'analyse'"):
        lc.analyze  # type: ignore[attr-defined]  # noqa: B018


def test_a_notebook_shows_a_fault_as_the_callers_line_and_a_sentence() -> None:
    with pytest.raises(ArgumentError) as caught:
        lc.analyse(PAPER, clearance={"Q": 1e-4})
    *place, line, sentence = caught.value._render_traceback_()
    assert [Path(__file__).name in each for each in place] == [True]
    assert line.strip() == 'lc.analyse(PAPER, clearance={"Q": 1e-4})'
    assert sentence.startswith("ArgumentError: clearance: 'Q' is not a revolute joint")


def test_a_result_prints_its_table_by_itself(capsys: pytest.CaptureFixture[str]) -> None:
    lc.analyse("crank-rocker", clearance=dict.fromkeys("DABE", 1e-4)).print_to()
    printed = capsys.readouterr().out
    assert "drive torque" in printed
    assert "where a reaction turns too fast, first_order has an answer" in " ".join(printed.split())


def test_what_a_first_guess_in_python_gets_wrong_is_taken_or_told() -> None:
    given = {"body": "coupler", "force": (-4.0, 0.0)}
    tool = lc.Load(**given, over="crank_angle", from_="200 deg", to="340 deg")
    assert tool == lc.Load(**given, over="crank_angle", start="200 deg", end="340 deg")
    table = lc.Load(**given, over="position_B", table=np.array([[0.0, 1.0], [1.0, 2.0]]))
    assert table.table == ((0.0, 1.0), (1.0, 2.0))
    with pytest.raises(MechanismError, match="start = '2 deg': what position_B is measured in is not known here; give"):
        lc.Load(**given, over="position_B", start="2 deg", end="4 deg")
    rocker = lc.load("crank-rocker")
    with pytest.raises(KeyError, match="Z: no such joint; they are D, A, B, E"):
        rocker.joint("Z")
    with pytest.raises(KeyError, match="Z: no such body; they are ground, crank, coupler, follower"):
        rocker.body("Z")
    with pytest.raises(TypeError, match=r"^export\(\): missing a required argument: 'folder'$"):
        lc.export("crank-rocker", "mujoco")
    asked = lc.analyse("crank-rocker", angles=[0.0, 0.1], signals="coupler_velocity_x, drive_power")
    assert {"coupler_velocity_x", "drive_power"} <= asked.signals.keys()
    with pytest.raises(ArgumentError, match="coupler_x: give coupler, which is its x, y and angle, or"):
        lc.accuracy("crank-rocker", outputs="coupler_x")
    with pytest.raises(ArgumentError, match=r"lc\.analyse\(\.\.\.\)\.write\(folder\) draws a mechanism"):
        lc.show(rocker)
    swept = lc.sweep("crank-rocker", {"body.coupler.mass": range(1, 3)}, angles=[0.0, 0.1], workers=1)
    assert [point.at for point in swept.points] == [{"body.coupler.mass": k} for k in range(2)]


def test_what_is_given_in_the_place_of_a_mechanism_or_a_console_is_told_what_to_write(tmp_path: Path) -> None:
    fields = {"name": "arm"}
    for wrong, why in (
        (
            lambda: lc.Mechanism(fields),
            r"Mechanism: fields are given by name; write Mechanism\(name=...\), or Mechanism\(\*\*",
        ),
        (lambda: lc.Joint("B", "revolute"), r"Joint: fields are given by name; write Joint\(name=...\), or"),
        (lambda: lc.analyse(fields), r"or the path of a mechanism file, or lc.Mechanism\(\*\*fields\) of a dict"),
        (lambda: lc.analyse('name = "arm"\n[ground]'), r'^name = "arm" \[ground\]: no such mechanism file or case'),
        (lambda: lc.analyse("paper").print_to("out.txt"), r"or an open file as print_to\(file=...\)"),
    ):
        with pytest.raises(lc.Error, match=why):
            wrong()
    with (tmp_path / "out.txt").open("w", encoding="utf-8") as file:
        lc.analyse("paper").print_to(file=file)
    assert "drive torque" in (tmp_path / "out.txt").read_text(encoding="utf-8")


def test_samples_without_an_answer_are_told_once_for_each_reason(capsys: pytest.CaptureFixture[str]) -> None:
    result = lc.analyse("crank-rocker", angles=np.radians(np.arange(0.0, 30.0, 10.0)))
    near = "the reaction at B passes near zero ({} N, peak 100 N): no direction, contact may be lost"
    result.model_copy(update={"flags": {"0": near.format(1), "1": near.format(2)}}).print_to()
    assert "no answer at 2 samples of 3, first 0 deg: the reaction at B passes near zero (1 N, peak 100 N)" in (
        " ".join(capsys.readouterr().out.split())
    )

"""Every option of every command, and every field of a measured.toml and of a map of columns, matters: numbers move, or
a sentence says that it is not used, or it is refused.  A field or an option that is not in these tables fails.
"""

from __future__ import annotations

import inspect
import json
import re
import warnings
from collections.abc import Callable, Iterator
from copy import deepcopy
from dataclasses import MISSING
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
import typer

import linkage_crosscheck as lc
from analytic.mechanism import Load
from analytic.mechanism.columns import ColumnMeaning, Layout
from analytic.mechanism.file import dumps, load
from analytic.paper.clearance import MODELS
from commands import compare
from compare.baseline.check import check_baselines, update_baselines
from compare.cli.app import app
from compare.cli.folders import NOT_ASKED
from compare.diagnose import prepare
from compare.diagnose.data.measured import load_measured
from compare.diagnose.data.measured_file import QUANTITIES, Entry, MeasuredFile
from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.diagnose.posterior.prior import Prior
from compare.diagnose.sensitivities import candidates
from compare.questions import shared
from compare.questions.accuracy import AccuracyQuestion, PlatformQuestion
from compare.questions.analyse import AnalyseQuestion, ExportQuestion, SimulateQuestion
from compare.questions.baseline import BaselinesQuestion
from compare.questions.check import CheckQuestion
from compare.questions.crosscheck import CrosscheckQuestion
from compare.questions.diagnose import DiagnoseQuestion
from compare.questions.listing import ApplyQuestion, FieldsQuestion, ImportQuestion, NewQuestion, RunsQuestion
from compare.questions.plan import PlanQuestion
from compare.questions.predict import PredictQuestion
from compare.questions.question import Question, arguments, option_of
from compare.questions.question import options as of_question
from compare.questions.show import ShowQuestion
from compare.questions.sweep import SweepQuestion
from compare.questions.validity import ValidityQuestion
from marks import slow
from measured_files import csv_text
from sim_models.engine import JOINT_MODELS, MOTIONS


class Refused(dict[str, Any]):
    """A change of a question that is refused."""


Row = tuple[str, str, dict[str, Any], dict[str, Any]]

# ---------------------------------------------------------------- what is asked


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with what options name: courses, a path, results, maps, tolerances, a result."""
    folder = tmp_path_factory.mktemp("files")
    time = np.linspace(0.0, 0.1, 11)
    five, other = load("five-bar"), {"position_D [rad]": 2.094395 + 3 * time, "position_E [rad]": 1.047198 - 2 * time}
    (folder / "course.csv").write_text(csv_text(time, other), encoding="utf-8")
    pose = lc.analyse(five, course=folder / "course.csv", times=time).signals
    pose = {f"left-arm_{axis} [m]": pose[f"left-arm_{axis}"] for axis in "xy"}
    (folder / "path.csv").write_text(csv_text(time, pose), encoding="utf-8")
    for name, case in (("results", "paper"), ("others", "crank-rocker")):
        lc.simulate(case, angles=np.radians(np.arange(30.0, 81.0, 5.0)), motion="static").write(folder / name)
    (folder / "map.toml").write_text(
        '[columns]\n"reaction_B_x [N]" = {signal = "reaction_B_x", unit = "N", scale = 2.0}'
    )
    (folder / "torque.toml").write_text(
        '[columns]\n"drive_torque [N.m]" = {signal = "drive_torque", unit = "N.m", scale = 2.0}'
    )
    (folder / "tolerance.toml").write_text("[static.ideal]\ntorque = { relative = 1e-9, absolute = 1e-12 }\n")
    lc.crosscheck("paper", motion="static", joint_model="massless-link", angles=[0.5, 1.0]).write(folder / "cross")
    (folder / "model.xml").write_text(
        (lc.export("crank-rocker", folder=folder / "export", angles=[0.5])[0]).read_text()
    )
    return folder


AT = {"angles": np.radians([30.0, 60.0])}
PAPER = {"mechanism": "paper", "motion": "static", **AT}
ROCKER = {"mechanism": "crank-rocker", **AT}
VARIED = {"body.crank.length": {"sd": 1e-5}}
TOLERANCED = {**ROCKER, "mechanism": load("crank-rocker").replace(tolerances=VARIED)}
FIVE = {"mechanism": "five-bar", "times": [0.0, 0.05, 0.1]}
LOOSE = {"clearance": {"B": 1e-4}}
SPEEDS = {"mechanism": "paper", "speeds": 6.0, "clearances": 1e-4, "joint_model": "massless-link", "workers": 1}


def _along(command: str, base: dict[str, Any], more: dict[str, Any]) -> list[Row]:
    """What five commands have alike: the case, its joints and how it moves."""
    over = {key: value for key, value in FIVE.items() if key != "mechanism"} | {**more, "mechanism": "five-bar"}
    shared = [
        ("mechanism", base, {"mechanism": "crank-rocker"}),
        ("motion", base | {"mechanism": load("paper").with_clearances({})}, {"motion": "driven"}),
        ("angles", base, {"angles": np.radians([40.0])}),
        ("times", over, {"times": [0.0, 0.02]}),
        ("course", over, {"course": "course.csv"}),
        ("path", over, {"path": "path.csv"}),
    ]
    return [(command, option, {**one, **more}, change) for option, one, change in shared]


PLAN = {"rig": "crank-rocker", "sensors": {"drive_torque": 1e-2}, "budget": 1.0}
PLAIN = {"mechanism": "paper", "motion": "static", **AT}
IDEAL = {"joint_model": "ideal"}
OPTIONS_MATTER: list[Row] = [
    *slow(*_along("compare", PLAIN, {"simulator": "mujoco", **IDEAL})),
    ("compare", "simulator", {**PAPER, **IDEAL}, Refused(simulator="no-engine")),
    ("compare", "joint_model", {**PAPER, **IDEAL}, {"joint_model": "massless-link"}),
    ("compare", "clearance", {**PAPER, "joint_model": "massless-link"}, LOOSE),
    ("compare", "analytic", {**PAPER, "joint_model": "massless-link"}, {"analytic": "first_order"}),
    ("compare", "flexible", {**PAPER, **IDEAL}, Refused(flexible=True)),  # of MuJoCo
    *slow(("compare", "flexible", {**PAPER, **IDEAL, "simulator": "exudyn"}, {"flexible": True})),
    ("compare", "tolerances", {**PAPER, **IDEAL}, {"tolerances": "tolerance.toml"}),
    ("compare", "map", {**PAPER, **IDEAL}, Refused(map="map.toml")),  # of an engine
    (
        "compare",
        "revolutions",
        {**ROCKER, **LOOSE, "joint_model": "spring-damper", "revolutions": 0},
        {"revolutions": 1},
    ),
    ("compare", "verify", {**ROCKER, **IDEAL}, {"verify": True}),
    *_along("analyse", PLAIN, {}),
    ("analyse", "clearance", PAPER, LOOSE),
    ("analyse", "model", PAPER, {"model": "first_order"}),
    ("analyse", "compliance", PAPER, {"compliance": True}),
    ("compare", "signals", {**ROCKER, **IDEAL}, {"signals": "all"}),
    ("analyse", "signals", ROCKER, {"signals": "coupler_velocity_x"}),
    ("simulate", "signals", ROCKER, {"signals": ["drive_power", "acceleration_B"]}),
    ("analyse", "signals", PAPER, Refused(signals="all")),  # nothing moves at rest
    *_along("simulate", PLAIN, {"simulator": "mujoco"}),
    ("simulate", "simulator", {**PAPER}, Refused(simulator="no-engine")),
    ("simulate", "joint_model", PAPER, {"joint_model": "massless-link"}),
    ("simulate", "clearance", {**PAPER, "joint_model": "massless-link"}, LOOSE),
    ("export", "simulator", {**PAPER}, Refused(simulator="dart")),
    *slow(
        *_along("export", PLAIN, {"simulator": "mujoco"}),
        ("export", "joint_model", PAPER, {"joint_model": "massless-link"}),
        ("export", "clearance", {**PAPER, "joint_model": "massless-link"}, LOOSE),
    ),
    ("check", "results", {"results": "results/signals.csv"}, {"results": "others/signals.csv"}),
    ("check", "mechanism", {"results": "results/signals.csv"}, {"mechanism": "crank-rocker"}),
    ("check", "map", {"results": "results/signals.csv"}, {"map": "torque.toml"}),
    ("check", "simulator", {"results": "results/signals.csv"}, {"simulator": "mujoco"}),
    (
        "check",
        "joint_model",
        {"results": "results/signals.csv", "clearance": {"B": 1e-3}},
        {"joint_model": "massless-link"},
    ),
    ("check", "motion", {"results": "results/signals.csv"}, {"motion": "driven"}),
    ("check", "clearance", {"results": "results/signals.csv"}, {"clearance": {"B": 1e-3}}),
    ("check", "analytic", {"results": "results/signals.csv", "clearance": {"B": 1e-3}}, {"analytic": "first_order"}),
    ("check", "tolerances", {"results": "results/signals.csv"}, {"tolerances": "tolerance.toml"}),
    ("check", "verify", {"results": "results/signals.csv", "simulator": "mujoco"}, {"verify": True}),
    ("accuracy", "mechanism", {**PAPER, "samples": 9}, {"mechanism": "crank-rocker"}),
    ("accuracy", "clearance", {**PAPER, "samples": 9}, LOOSE),
    ("accuracy", "clearance_tolerance", {**PAPER, "samples": 9}, {"clearance_tolerance": {"B": 1e-3}}),
    ("accuracy", "outputs", {**PAPER, "samples": 9}, {"outputs": "coupler.B"}),
    ("analyse", "samples", TOLERANCED, {"samples": 5}),
    ("analyse", "seed", {**TOLERANCED, "samples": 5}, {"seed": 4}),
    ("analyse", "seed", TOLERANCED, {"seed": 4}),
    ("analyse", "limits", ROCKER, {"limits": {"transmission_angle": "30 deg"}}),
    ("analyse", "limits", ROCKER, {"limits": {"rms_drive_torque": "1 N.m"}}),
    ("accuracy", "limits", {**ROCKER, **LOOSE, "samples": 9}, {"limits": {"worst_follower_angle": 0.01}}),
    ("accuracy", "limits", {**TOLERANCED, "samples": 9}, {"limits": {"follower_angle": 0.01}}),
    ("accuracy", "min_yield", {**TOLERANCED, "samples": 9, "limits": {"follower_angle": 0.01}}, {"min_yield": 0.5}),
    ("accuracy", "motion", {**PAPER, "samples": 9}, {"motion": "driven"}),
    ("accuracy", "angles", {**PAPER, "samples": 9}, {"angles": [0.7]}),
    ("accuracy", "samples", {**PAPER, "samples": 9}, {"samples": 12}),
    ("accuracy", "seed", {**PAPER, "samples": 9}, {"seed": 4}),
    ("accuracy", "nonlinear", {**PAPER, "samples": 9}, {"nonlinear": True}),
    ("platform", "times", FIVE, {"times": [0.0, 0.02]}),
    ("platform", "course", FIVE, {"course": "course.csv"}),
    ("platform", "path", FIVE, {"path": "path.csv"}),
    ("platform", "encoder_step", FIVE, {"encoder_step": {"D": 1e-4}}),
    ("platform", "clearance", FIVE, {"clearance": {"P": 1e-4}}),
    ("platform", "outputs", FIVE, {"outputs": "left-arm.P"}),
    ("platform", "mechanism", FIVE, {"mechanism": "2r-arm"}),
    (
        "platform",
        "workspace",
        {"mechanism": "3-rrr", "outputs": "platform"},
        {"workspace": ((0.0, 0.02, 2), (0.0, 0.02, 2))},
    ),
    (
        "platform",
        "angle",
        {"mechanism": "3-rrr", "outputs": "platform", "workspace": ((0.0, 0.02, 2), (0.0, 0.02, 2))},
        {"angle": -0.2},
    ),
    *slow(
        ("validity", "speeds", SPEEDS, {"speeds": 9.0}),
        ("validity", "clearances", SPEEDS, {"clearances": 2e-4}),
        ("validity", "mechanism", SPEEDS, {"mechanism": "crank-rocker"}),
        ("validity", "joint_model", SPEEDS, {"joint_model": "spring-damper"}),
        ("validity", "joints", SPEEDS, {"joints": "A"}),
        ("validity", "tolerances", SPEEDS, {"tolerances": "tight.toml"}),
        (
            "validity",
            "revolutions",
            {**SPEEDS, "mechanism": "crank-rocker", "joint_model": "spring-damper"},
            {"revolutions": 2},
        ),
        ("validity", "restitutions", {**SPEEDS, "joint_model": "spring-damper"}, {"restitutions": 0.3}),
    ),
    *slow(
        *(
            (command, "large", {**PAPER, "clearance": {"B": 0.05}, "large": True, **more}, Refused(large=False))
            for command, more in (
                ("analyse", {}),
                ("simulate", {"joint_model": "massless-link"}),
                ("compare", {"joint_model": "massless-link"}),
                ("export", {"joint_model": "massless-link"}),
                ("accuracy", {"samples": 9}),
            )
        )
    ),
    *slow(
        (
            "check",
            "large",
            {"results": "results/signals.csv", "clearance": {"B": 0.05}, "large": True},
            Refused(large=False),
        )
    ),
    ("platform", "large", {**FIVE, "clearance": {"P": 0.05}, "large": True}, Refused(large=False)),
    ("validity", "large", {**SPEEDS, "clearances": 0.05, "large": True}, Refused(large=False)),
    ("validity", "simulator", SPEEDS, Refused(simulator="no-engine")),
    ("validity", "restitutions", SPEEDS, Refused(restitutions=0.3)),  # of pins that never leave
    ("plan", "rig", PLAN, {"rig": "slider-crank"}),
    ("plan", "sensors", PLAN, {"sensors": {"crank_angle": 1e-4}}),
    ("plan", "budget", PLAN, {"budget": 2.0}),
    ("plan", "budget", PLAN, Refused(budget=0.5)),
    ("show", "result", {"signal": "drive_torque", "at": 0.5}, Refused(result="results/simulation.json")),
    ("show", "signal", {"signal": "drive_torque", "at": 0.5}, {"signal": "reaction_B_angle"}),
    ("show", "at", {"signal": "drive_torque", "at": 0.5}, {"at": 1.0}),
    ("show", "joint_model", {"signal": "drive_torque", "at": 0.5}, Refused(joint_model="ideal")),
    ("show", "simulator", {"signal": "drive_torque", "at": 0.5}, Refused(simulator="dart")),
    *(
        (command, option, {"cases": "paper", "results": "results/signals.csv"}, change)
        for command in ("baseline check", "baseline update")
        for option, change in (
            ("cases", {"cases": "crank-rocker"}),
            ("simulator", Refused(simulator="mujoco")),
            ("folder", {"folder": "elsewhere"}),
            ("results", {"results": "others/signals.csv"}),
            ("map", {"map": "map.toml"}),
            ("signals", Refused(signals="no_signal")),
        )
    ),
    ("import", "file", {"file": "model.xml"}, Refused(file="map.toml")),
]
ELSEWHERE = {  # options whose effect another test shows
    ("diagnose", "measured"): "below, field by field",
    ("diagnose", "only"): "test_left_out.py",
    ("diagnose", "exclude"): "test_left_out.py",
    ("diagnose", "adopt"): "test_proposals.py",
    ("diagnose", "others"): "test_diagnose.py",
    ("diagnose", "budget"): "test_budget.py",
    ("diagnose", "simulator"): "test_capabilities.py",
    ("diagnose", "check"): "test_begin.py",
    ("diagnose", "init"): "test_begin.py",
    ("diagnose", "case"): "test_begin.py",
    **{(of, how): "test_bench_files.py" for of in ("diagnose", "check") for how in ("columns", "split")},
    ("baseline check", "junit"): "test_baseline.py",
    **dict.fromkeys([("compare", "set"), ("analyse", "set"), ("accuracy", "set")], "test_parametric.py"),
    ("list", "folder"): "test_history.py",
    ("apply", "file"): "test_mjcf_apply.py",
    ("apply", "to"): "test_mjcf_apply.py",
    **dict.fromkeys(
        [("predict", each) for each in ("diagnosis", "run", "speed", "load", "signals", "simulator")],
        "test_prediction.py",
    ),
    ("fields", "table"): "test_first_minutes.py",
    ("new", "name"): "test_first_minutes.py",
    ("new", "kind"): "test_first_minutes.py",
}
OF_TYPER = {"install_completion", "show_completion"}
QUESTIONS: dict[str, tuple[type[Question], ...]] = {
    "compare": (CrosscheckQuestion, SweepQuestion),
    "analyse": (AnalyseQuestion, SweepQuestion),
    "simulate": (SimulateQuestion,),
    "export": (ExportQuestion,),
    "check": (CheckQuestion,),
    "accuracy": (AccuracyQuestion, PlatformQuestion, SweepQuestion),
    "validity": (ValidityQuestion,),
    "diagnose": (DiagnoseQuestion,),
    "plan": (PlanQuestion,),
    "predict": (PredictQuestion,),
    "show": (ShowQuestion,),
    "baseline check": (BaselinesQuestion,),
    "baseline update": (BaselinesQuestion,),
    "list": (RunsQuestion,),
    "import": (ImportQuestion,),
    "apply": (ApplyQuestion,),
    "fields": (FieldsQuestion,),
    "new": (NewQuestion,),
}
OF_A_COMMAND = {  # options that are no argument, but for where and how an answer is given
    ("diagnose", "check"), ("diagnose", "init"), ("diagnose", "case"), ("diagnose", "columns"),
    ("diagnose", "split"), ("baseline check", "junit"),
}  # fmt: skip
FUNCTIONS: dict[str, Callable[..., Any]] = {
    "compare": lc.crosscheck,
    "analyse": lc.analyse,
    "simulate": lc.simulate,
    "export": lc.export,
    "check": lc.check,
    "accuracy": lc.accuracy,
    "platform": lc.platform_accuracy,
    "validity": lc.validity,
    "plan": lc.plan,
    "predict": lc.predict,
    "show": lc.show,
    "baseline check": check_baselines,
    "baseline update": update_baselines,
    "import": lc.import_mjcf,
    "apply": lc.apply,
}


def commands(command: Any = None, name: str = "") -> Iterator[tuple[str, Any]]:
    """Every command of the app, by its name."""
    command = typer.main.get_command(app) if command is None else command
    if command.params:
        yield name.strip() or "compare", command
    for one, under in getattr(command, "commands", {}).items():
        yield from commands(under, f"{name} {one}")


def options() -> list[tuple[str, str]]:
    """Every option and argument by its command, but for where and how an answer is given."""
    return [
        (name, each.name)
        for name, command in commands()
        for each in command.params
        if each.name not in NOT_ASKED | OF_TYPER
    ]


def argument(command: str, option: str) -> str:
    """What a function calls an option."""
    return {written: name for name, written in named(command).items()}.get(option, option)


def named(command: str) -> dict[str, str]:
    """The option of each argument that has one."""
    every = ((name, option) for question in QUESTIONS[command] for name, option in of_question(question).items())
    return {name: option.name or name for name, option in every if option.typed}


def rows() -> list[Row]:
    return [getattr(row, "values", row) for row in OPTIONS_MATTER]


def test_every_option_is_in_the_table() -> None:
    here = {(command, option) for command, option, _, _ in rows()}
    here |= {("accuracy", option) for command, option, _, _ in rows() if command == "platform"}
    missing = [
        (command, option)
        for command, option in options()
        if (command, argument(command, option)) not in here and (command, option) not in ELSEWHERE
    ]
    assert not missing
    assert len(options()) > 90


def test_every_option_is_an_argument_of_the_function_and_back() -> None:
    """What the command line takes, Python takes by its name, and back."""
    for command, questions in QUESTIONS.items():
        taken = {option for of, option in options() if of == command and (of, option) not in OF_A_COMMAND}
        assert taken == set(named(command).values()) - NOT_ASKED, command
        assert all(option_of(field.type) for question in questions for field in arguments(question)), command


def test_the_choices_that_a_command_offers_are_those_that_there_are() -> None:
    """The types behind them are of modules that import numpy, for which ``compare --help`` does not wait."""
    assert shared.JOINT_MODELS == JOINT_MODELS
    assert shared.MOTIONS == MOTIONS
    assert shared.MODELS == MODELS


@pytest.mark.parametrize(("command", "function"), FUNCTIONS.items())
def test_a_function_takes_what_its_question_asks_and_says_what_each_argument_is(
    command: str, function: Callable[..., Any]
) -> None:
    (question,) = [PlatformQuestion] if command == "platform" else QUESTIONS[command][:1]
    parameters = inspect.signature(function).parameters
    assert {name: each.default for name, each in parameters.items()} == {
        field.name: inspect.Parameter.empty if field.default is MISSING else field.default
        for field in arguments(question)
    }
    help_ = " ".join((inspect.getdoc(function) or "").split())
    for name, option in of_question(question).items():
        assert f"``{name}`` {option.python_help}" in help_
        assert "Option" not in str(parameters[name].annotation)


# ---------------------------------------------------------------- what comes of it


ECHOES = set(
    "command versions mechanism case motion clearance analytic_model compliance clearance_tolerance samples seed"
    " nonlinear encoder_step crank_angle time joint_model speeds clearances joints joints_are settings warnings"
    " stored at words contact".split()
)


def numbers(document: Any) -> Any:
    """A document without what only repeats the question; contact that was watched is an answer where it is."""
    if isinstance(document, dict):
        return {key: numbers(value) for key, value in document.items() if key not in ECHOES or _watched(key, value)}
    return [numbers(each) for each in document] if isinstance(document, list) else document


def _watched(key: str, value: Any) -> bool:
    return key == "contact" and isinstance(value, dict) and "joints" in value


def answer(command: str, question: dict[str, Any], folder: Path) -> tuple[str, list[str]]:
    """The numbers of an answer, and its warnings; of one that is refused, the sentence."""
    named = {"course", "path", "results", "map", "tolerances", "result", "file"}
    question = {
        key: folder / value if key in named and isinstance(value, str) else value for key, value in question.items()
    }
    if command == "show":
        question = {"result": folder / "cross" / "result.json", **question}
    if command == "export":
        question["folder"] = folder / "exported"
    if command.startswith("baseline"):
        question["folder"] = folder / question.get("folder", "baselines")
    if command == "check":
        question = {"mechanism": load("paper").with_clearances({}), "motion": "static", **question}
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            found = FUNCTIONS[command](**question)
        except lc.Error as error:
            return "refused", [str(error)]
    if command == "export":
        texts = {file.name: file.read_text(encoding="utf-8") for file in found}
        said = [line.removeprefix("# ") for line in texts["run.py"].splitlines() if line.startswith("# ")]
        return repr(texts), [*said, *(str(each.message) for each in caught)]
    document = json.loads(found.to_json())
    said = [*document.get("warnings", []), *(str(each.message) for each in caught)]
    return json.dumps(numbers(document), sort_keys=True), said


KNOWN: dict[str, tuple[str, list[str]]] = {}  # answers to questions that several rows begin with


def before(command: str, base: dict[str, Any], folder: Path) -> tuple[str, list[str]]:
    key = f"{command} {base}"
    if key not in KNOWN:
        KNOWN[key] = answer(command, base, folder)
    return KNOWN[key]


@pytest.mark.long_rows("plan-*")
@pytest.mark.filterwarnings("ignore::numpy.exceptions.RankWarning")
@pytest.mark.parametrize(("command", "option", "base", "change"), OPTIONS_MATTER)
def test_an_option_matters(
    command: str, option: str, base: dict[str, Any], change: dict[str, Any], files: Path
) -> None:
    (files / "tight.toml").write_text("[driven.massless-link]\ntorque = { relative = 1e-12 }\n")
    if command.startswith("baseline"):
        answer("baseline update", base, files)
    old, said = before(command, base, files)
    assert old != "refused", said
    new, now = answer(command, base | change, files)
    assert (new == "refused") == isinstance(change, Refused), now
    assert new != old or set(now) - set(said), f"{option} changes nothing, and nobody says so"


# ---------------------------------------------------------------- options that cannot act together


IN_VAIN: list[tuple[str, dict[str, Any], str]] = [
    ("compare", {**PAPER, **IDEAL, **LOOSE}, "left out: clearance of joint B, as joints are ideal here"),
    ("simulate", {**PAPER, **LOOSE}, "left out: clearance of joint B, as joints are ideal here"),
    ("export", {**PAPER, **LOOSE}, "left out: clearance of joint B, as joints are ideal here"),
    (
        "check",
        {"results": "results/signals.csv", **IDEAL, **LOOSE},
        "left out: clearance of joint B, as joints are ideal here",
    ),
    ("compare", {**PAPER, **IDEAL, "analytic": "first_order"}, "first_order is the equilibrium itself"),
    ("compare", {**ROCKER, "analytic": "first_order"}, "first_order is the equilibrium itself"),
    ("analyse", {**ROCKER, "model": "first_order"}, "first_order is the equilibrium itself"),
    ("check", {"results": "results/signals.csv", "analytic": "first_order"}, "first_order is the equilibrium itself"),
    ("check", {"results": "results/signals.csv", "verify": True}, "verify is left out; it is of the steps of engines"),
    ("compare", {**PAPER, **IDEAL, "verify": True}, "verify is left out; it is of steps, and at rest nothing steps"),
    ("compare", {**ROCKER, "revolutions": 3}, "revolutions = 3 is left out; it is of cranks that turn fully"),
    *slow(
        *(
            ("compare", {**question, "revolutions": 3}, "revolutions = 3 is left out; it is of cranks that turn fully")
            for question in (
                {**PAPER, "joint_model": "contact"},
                {**PAPER, "motion": "driven", "joint_model": "massless-link"},
                {**PAPER, "motion": "driven", "joint_model": "spring-damper"},  # its crank does not turn fully
                {**FIVE, **IDEAL},
            )
        )
    ),
    *slow(("validity", {**SPEEDS, "revolutions": 3}, "revolutions = 3 is left out; it is of cranks that turn fully")),
    ("analyse", {**ROCKER, "mechanism": "slider-crank", "motion": "static", "compliance": True}, "nothing yields"),
    ("analyse", {**ROCKER, "compliance": True}, "refused .*ask for static motion"),
    *(
        ("accuracy", {**ROCKER, "samples": 9, **more}, f"{next(iter(more), 'samples')} is of linkages with clearance")
        for more in ({}, {"seed": 3}, {"nonlinear": True})
    ),
    *(
        (command, {**FIVE, **AT}, "refused angles: five-bar is looked at over time")
        for command in ("compare", "analyse", "simulate", "export")
    ),
    *(
        (command, {**FIVE, "course": "course.csv", "path": "path.csv"}, "refused path: .*beside a course")
        for command in ("compare", "analyse", "simulate", "export", "platform")
    ),
    *(
        (command, {**PAPER, "clearance": {"Q": 1e-4}}, "refused clearance: 'Q' is not a revolute joint")
        for command in ("compare", "analyse", "simulate", "export", "accuracy")
    ),
    *(
        (command, {**ROCKER, "joint_model": "contact"}, "refused joint_model: contact joints need clearance")
        for command in ("compare", "simulate", "export")
    ),
    ("compare", {"mechanism": "pendulum", **AT}, "refused angles: pendulum swings freely"),
    ("compare", {**PAPER, "motion": "driven", "flexible": True}, "refused flexible: .*at rest, not in driven motion"),
    ("platform", {**FIVE, "workspace": ((0.0, 0.1, 2), (0.1, 0.2, 2))}, "refused times: is of a motion"),
    ("platform", {**FIVE, "angle": 0.1}, "refused angle: is that of a workspace"),
    (
        "accuracy",
        {**ROCKER, "clearance_tolerance": {"B": 1e-5}},
        "refused clearance_tolerance: .*more than the joint's",
    ),
    ("baseline check", {"cases": "paper", "map": "map.toml"}, "refused map: says what the columns of results are"),
    (
        "baseline check",
        {"cases": "paper", "results": "results/signals.csv", "simulator": "mujoco"},
        "refused simulator: results are another program's",
    ),
]


@pytest.mark.filterwarnings("ignore::numpy.exceptions.RankWarning")
@pytest.mark.parametrize(("command", "question", "says"), IN_VAIN)
def test_what_cannot_act_is_said_or_refused(command: str, question: dict[str, Any], says: str, files: Path) -> None:
    found, said = answer(command, question, files)
    told = [f"refused {said[0]}"] if found == "refused" else said
    assert any(re.search(says, sentence) for sentence in told), told


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["accuracy", "--case", "five-bar", "--samples", "9"], "--samples is of linkages that one crank moves"),
        (["accuracy", "--case", "crank-rocker", "--times", "0:1:0.5", "--angles", "0:9:9"], "--angles is of linkages"),
        (["diagnose", "m.toml", "--case", "paper"], "--case paper: belongs to --init"),
        (["diagnose", "m.toml", "--check", "--budget", "3"], "--budget: has no part in --check"),
        (["diagnose", "m.csv", "--init", "--case", "paper", "--adopt"], "--adopt: has no part in --init"),
        (["baseline", "check", "--results", "a.csv"], "--results: they are of one case"),
        (["baseline", "check", "--case", "paper", "--map", "a.toml"], "--map a.toml: says what the columns"),
        (["--motion", "static"], "no --simulator is given"),
        (["--motion", "static", "simulate"], "--motion stands before simulate"),
    ],
)
def test_what_cannot_act_is_refused_as_it_was_typed(words: list[str], says: str, tmp_path: Path) -> None:
    done = compare(*words, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("compare: ")
    assert says in done.stderr


# ---------------------------------------------------------------- measured.toml, and maps of columns


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """Two runs of a crank-rocker with a load: a folder, and what its measured.toml says of them."""
    folder = tmp_path_factory.mktemp("rig")
    m = load("crank-rocker").replace(loads=(Load(body="coupler", force=(0.0, 40.0)),))
    (folder / "nominal.toml").write_text(dumps(m), encoding="utf-8")
    (folder / "other.toml").write_text(dumps(m.with_body("coupler", mass=0.2)), encoding="utf-8")
    time, scatter = np.linspace(0.0, 0.2, 25), np.random.default_rng(2)
    for name, speed in (("slow", 31.41592653589793), ("swift", 40.0)):
        read = lc.analyse(m.replace(drive={"joint": "D", "speed": speed}), angles=speed * time).signals
        columns = {
            "enc": np.degrees(speed * time) + 1e-3 * scatter.normal(size=time.size),
            "follower_angle [rad]": read["follower_angle"] + 1e-5 * scatter.normal(size=time.size),
            "drive_torque [N.m]": read["drive_torque"] + 1e-3 * scatter.normal(size=time.size),
        }
        text = "logger 7\n" + csv_text(time, columns).replace("time [s]", "clock")
        (folder / f"{name}.csv").write_text(text.replace(",", ";"), encoding="utf-8")
    (folder / "unloaded.toml").write_text(dumps(m.replace(loads=())), encoding="utf-8")
    columns = {
        "clock": {"signal": "time", "unit": "s"},
        "enc": {"signal": "crank_angle", "unit": "deg", "scale": 1.0, "offset": 0.0, "sign": 1},
    }
    noise = {"crank_angle": 2e-5, "follower_angle": 1e-5, "drive_torque": 1e-3}
    load_ = {"body": "coupler", "point": "com", "force": [0.0, 40.0], "torque": 0.0}
    run = {"name": "slow", "file": "slow.csv", "drive_speed": 31.41592653589793, "drive_angle": 0.0, "noise": noise}
    runs = [{**run, "load": [load_]}, {**run, "name": "swift", "file": "swift.csv", "drive_speed": 40.0}]
    written = {"skip_rows": 1, "separator": ";", "decimal": ".", "columns": columns}
    return folder, {"mechanism": "nominal.toml", **written, "tolerance": {"mass": 0.1}, "run": runs}


def beside(folder: Path, said: dict[str, Any]) -> tuple[str, list[str]]:
    """What the runs are, what the nominal mechanism says in them, what may be blamed, within which bounds, and how
    likely it is beforehand; and what is said of the data.
    """
    path = folder / "measured.toml"
    path.write_text(tomli_w.dumps(said), encoding="utf-8")
    try:
        data = load_measured(path)
        courses, data = prepare.followed(prepare.on_one_turn(data))
        told = [fault.text for fault in data.faults]
        rigged, model = prepare.nominal(data, data.mechanism, courses)
    except lc.Error as error:
        return "refused", [str(error)]
    (predicted,) = model([[(t, t.effect.values(rigged, t.where, x)) for t, x in prepare.starts(data).items()]])
    assert predicted is not None
    bounds = prepare.bounds(rigged, data.tolerance)
    allowed = prepare.allowed(candidates(rigged, VOCABULARY), data.tolerance, bounds)
    runs = [
        (run.name, run.role, run.time.tolist(), {n: (c.values.tolist(), c.noise) for n, c in run.channels.items()})
        for run in data.runs
    ]
    nominal = [{name: values.tolist() for name, values in run.items()} for run in predicted]
    prior = Prior.of(rigged, bounds, allowed, data.prior)
    return repr((runs, nominal, [(t.key, t.variant, bounds(t), prior.log_odds(t)) for t in allowed])), told


def begun(folder: Path, said: dict[str, Any]) -> tuple[str, list[str]]:
    """The same, kept for the next row that begins with it."""
    if repr(said) not in KNOWN:
        KNOWN[repr(said)] = beside(folder, said)
    return KNOWN[repr(said)]


def changed(**fields: Any) -> Callable[[dict[str, Any]], None]:
    return lambda said: said.update(fields)


def in_run(**fields: Any) -> Callable[[dict[str, Any]], None]:
    """Fields of the first run; None leaves one out."""

    def edit(said: dict[str, Any]) -> None:
        said["run"][0] = {k: v for k, v in {**said["run"][0], **fields}.items() if v is not None}

    return edit


def of_encoder(**fields: Any) -> Callable[[dict[str, Any]], None]:
    return lambda said: said["columns"]["enc"].update(fields)


STROKE = {"over": "crank_angle", "from": 0.0, "to": 4.0}
TABLED = {"over": "crank_angle", "table": [[0.0, 0.5], [6.0, 1.0]]}


def of_load(**fields: Any) -> Callable[[dict[str, Any]], None]:
    return lambda said: said["run"][0]["load"][0].update(fields)


def acting(body: str) -> Callable[[dict[str, Any]], None]:
    """The column of the drive's torque as a torque on a body."""

    def edit(said: dict[str, Any]) -> None:
        said["columns"]["drive_torque [N.m]"] = {"load": {"body": body, "torque": 1.0}}
        for run in said["run"]:
            run["noise"].pop("drive_torque", None)

    return edit


def with_gauge(said: dict[str, Any]) -> None:
    """The column of the drive's torque as that of a torque transducer on the crank."""
    said["sensor"] = [{"name": "gauge", "kind": "torque", "body": "crank", "point": "D"}]
    said["columns"]["drive_torque [N.m]"] = {"signal": "gauge", "unit": "N.m"}
    for run in said["run"]:
        run["noise"].pop("drive_torque", None)


FREE = {"drive_speed": None, "drive_angle": None, "drive": "free"}
BEGUN = {"crank_angle": 0.1}
SAME = changed()


def spare(said: dict[str, Any]) -> None:
    """An entry that no file has."""
    said["columns"]["oil"] = "ignore"
    said["optional"] = True


FIELDS: list[Any] = [  # field, what to begin with, what to change, and with which words that is refused
    ("mechanism", SAME, changed(mechanism="other.toml"), ""),
    ("sensor", with_gauge, lambda said: said.pop("sensor"), "'gauge' is not a signal"),
    ("tolerance", SAME, changed(tolerance={"mass": 0.2}), ""),
    ("prior", SAME, changed(prior={"joint_clearance": 0.1}), ""),
    ("context", SAME, changed(context={"quantity": "crank_angle", "required": "1 mm"}), "required = .1 mm. has"),
    ("skip_rows", SAME, changed(skip_rows=2), "line 3 has numbers where the header should be"),
    ("headings", SAME, changed(headings=["clock", "enc"]), "line 2 has 4 cells, and 2 headings are given"),
    ("optional", spare, changed(optional=False), "columns.'oil' is no heading of a data file"),
    ("separator", SAME, changed(separator=","), "line 2 has no ',' in it"),
    ("decimal", SAME, changed(decimal=","), "has a decimal point"),
    ("columns", SAME, lambda said: said["columns"].update({"follower_angle [rad]": "ignore"}), ""),
    ("columns.signal", SAME, of_encoder(signal="coupler_angle"), "noise.crank_angle is not a column"),
    ("columns.load", acting("follower"), acting("coupler"), ""),
    ("columns.frame", SAME, of_encoder(frame="follower"), "turns x and y of a force"),
    ("columns.unit", SAME, of_encoder(unit="rad"), "the column looks like degrees"),
    ("columns.scale", SAME, of_encoder(scale=1.001), ""),
    ("columns.offset", SAME, of_encoder(offset=1.0), ""),
    ("columns.sign", SAME, of_encoder(sign=-1), "negate drive_speed or the column"),
    ("run", SAME, lambda said: said["run"].pop(), ""),
    ("run.columns", SAME, in_run(columns={"follower_angle [rad]": "ignore"}), ""),
    ("run.name", SAME, in_run(name="fast"), ""),
    ("run.file", SAME, in_run(file="swift.csv"), ""),
    ("run.part", SAME, in_run(part=2), "its clock starts 1 time; give 1 to 1"),
    ("run.drive_speed", SAME, in_run(drive_speed=31.5), ""),
    ("run.drive_angle", SAME, in_run(drive_angle=0.01), ""),
    ("run.drive", SAME, in_run(drive_speed=None, drive_angle=None, drive="measured"), ""),
    *slow(
        ("run.start", in_run(**FREE), in_run(start=BEGUN), ""),
        ("run.start", in_run(**FREE), in_run(start={"crank_angular_velocity": 30.0}), ""),
        ("run.start", in_run(**FREE, start=BEGUN), in_run(start={**BEGUN, "follower_angle": 1.6}), ""),
    ),
    ("run.start", SAME, in_run(start=BEGUN), "start belongs to drive = 'free'"),
    ("run.load", changed(mechanism="unloaded.toml"), in_run(load=None), ""),
    ("run.load", SAME, in_run(load=[]), ""),
    ("run.load.body", SAME, of_load(body="follower"), ""),
    ("run.load.point", SAME, of_load(point="B"), ""),
    ("run.load.force", SAME, of_load(force=[0.0, 41.0]), ""),
    ("run.load.torque", SAME, of_load(torque=0.3), ""),
    ("run.load.over", of_load(**TABLED), of_load(over="coupler_angle"), ""),
    ("run.load.table", of_load(**TABLED), of_load(table=[[0.0, 0.0], [6.0, 1.0]]), ""),
    ("run.load.from", of_load(**STROKE), of_load(**{"from": 2.0}), ""),
    ("run.load.opposes", SAME, of_load(opposes=True), ""),
    ("run.load.to", of_load(**STROKE), of_load(to=2.0), ""),
    ("run.noise", SAME, lambda said: said["run"][0]["noise"].update(follower_angle=3e-5), ""),
    ("run.noise", SAME, lambda said: said["run"][0]["noise"].update(reaction_B_x=3e-5), "noise.reaction_B_x is"),
    ("run.from_rest", SAME, in_run(from_rest=True), ""),
    ("run.role", SAME, in_run(role="validation"), ""),
]  # fmt: skip


def test_every_field_of_measured_toml_and_of_a_map_is_in_the_table() -> None:
    def named(model: Any, before: str) -> set[str]:
        return {before + (field.alias or name) for name, field in model.model_fields.items()}

    every = named(MeasuredFile, "") | named(Layout, "") | named(ColumnMeaning, "columns.")
    every |= named(Entry, "run.") | named(Load, "run.load.")
    assert every == {getattr(row, "values", row)[0] for row in FIELDS}


@pytest.mark.parametrize(("field", "begin", "edit", "refusal"), FIELDS)
def test_a_field_of_measured_toml_matters(
    field: str,
    begin: Callable[[dict[str, Any]], None],
    edit: Callable[[dict[str, Any]], None],
    refusal: str,
    rig: tuple[Path, dict[str, Any]],
) -> None:
    folder, said = rig[0], deepcopy(rig[1])
    begin(said)
    old, told = begun(folder, said)
    assert old != "refused", told
    edit(said)
    new, now = beside(folder, said)
    if refusal or new == "refused":
        assert new == "refused", f"{field} is taken"
        assert re.search(refusal or "^$", now[0]), now
    assert new != old or set(now) - set(told), f"{field} changes nothing, and nobody says so"


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_a_tolerance_of_each_quantity_matters(quantity: str, rig: tuple[Path, dict[str, Any]]) -> None:
    """0 rules out what depends on it."""
    folder, said = rig
    old, _ = begun(folder, said | {"tolerance": {}})
    new, told = beside(folder, said | {"tolerance": {quantity: 0.0}})
    assert new not in (old, "refused"), told

"""The JSON Schema files are right about what is written, and would notice what is not."""

from __future__ import annotations

import copy
import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
import typer

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.reach import usual_angles
from analytic.mechanism.file import load
from asked import job_of
from compare import cli
from compare.cli.app import app
from compare.crosscheck import crosscheck_job
from compare.judge.tolerances import Known, load_tolerances
from compare.results.schemas import FOLDER, documents, schema
from compare.schedules import FREE_TIME
from marks import slow
from planted import Planted, turned
from sim_models.engine import Motion
from tests.evidence import __main__ as of_evidence
from tests.evidence import results as evidence

SCHEMAS = {path.name: path for folder in (FOLDER, evidence.FOLDER) for path in sorted(folder.glob("*.json"))}
DOCUMENTS = documents() | evidence.documents()
RESULT = json.loads(SCHEMAS["result.json"].read_text(encoding="utf-8"))
TOLERANCES = load_tolerances()
REPORTS = Path(__file__).parents[1] / "reports"


def faults(result: Any, schema: Any = RESULT) -> list[str]:
    return [
        f"{error.json_path}: {error.message[:200]}"
        for error in jsonschema.Draft202012Validator(schema).iter_errors(result)
    ]


def written(case: str, motion: Motion = "driven", clearance: dict[str, float] | None = None, **job: Any) -> Any:
    """What result.json holds of a case in MuJoCo."""
    mechanism = load(case) if clearance is None else load(case).with_clearances(clearance)
    if mechanism.speed is None:
        job |= {"time": FREE_TIME}
    else:
        job = {"theta": usual_angles(Assembly(mechanism))[::12]} | job
    return json.loads(crosscheck_job(job_of(mechanism, ("mujoco",), TOLERANCES, motion=motion, **job)).to_json())


@pytest.fixture(scope="module")
def paper() -> Any:
    result = written("paper", "static")
    assert faults(result) == []
    return result


@pytest.mark.parametrize("name", SCHEMAS)
def test_a_schema_is_one_and_pins_the_version(name: str) -> None:
    schema = json.loads(SCHEMAS[name].read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator.check_schema(schema)
    assert schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    assert schema["properties"]["schema"] == {"const": 1}
    assert "schema" in schema["required"]


JSON_OF = {  # what a command prints with --json
    "compare": "result.json",
    "compare accuracy": "accuracy.json",
    "compare analyse": "analysis.json",
    "compare apply": "apply.json",
    "compare baseline check": "baselines.json",
    "compare baseline update": "baselines.json",
    "compare cases": "cases.json",
    "compare check": "result.json",
    "compare diagnose": "diagnosis.json",
    "compare effects": "effects.json",
    "compare fields": "fields.json",
    "compare export": "export.json",
    "compare import": "import.json",
    "compare list": "runs.json",
    "compare plan": "plan.json",
    "compare predict": "prediction.json",
    "python -m tests.evidence scoreboard check": "scoreboard-check.json",
    "python -m tests.evidence scoreboard show": "scoreboard-set.json",
    "python -m tests.evidence scoreboard update": "scoreboard.json",
    "compare show": "provenance.json",
    "compare simulate": "simulation.json",
    "compare simulators": "simulators.json",
    "python -m tests.evidence validation check": "validation-check.json",
    "python -m tests.evidence validation update": "validation.json",
    "compare validity": "validity.json",
}
# what compare show prints of it, without a signal and with one, and what compare diagnose --check prints
OF_A_DIAGNOSIS = {"diagnosis.json", "residuals.json", "data.json"}


def commands(name: str, command: Any) -> Iterator[tuple[str, Any]]:
    """A command and those below it."""
    yield name, command
    for below, inner in getattr(command, "commands", {}).items():
        yield from commands(f"{name} {below}", inner)


def test_every_command_that_prints_json_prints_a_document_with_a_schema() -> None:
    """That it is as its schema says is for the tests of each document."""
    every = [
        each
        for name, one in (("compare", app), ("python -m tests.evidence", of_evidence.app))
        for each in commands(name, typer.main.get_command(one))
    ]
    able = {name for name, command in every if any("--json" in parameter.opts for parameter in command.params)}
    assert able == set(JSON_OF)
    assert set(JSON_OF.values()) | OF_A_DIAGNOSIS <= set(DOCUMENTS) == set(SCHEMAS)


@pytest.mark.parametrize("name", SCHEMAS)
def test_a_schema_is_that_of_its_document(name: str) -> None:
    assert SCHEMAS[name].read_text(encoding="utf-8") == schema(DOCUMENTS[name]), "run python -m compare.results.schemas"


def test_json_is_printed_in_one_place_and_of_a_document() -> None:
    sources = {path.name: path.read_text(encoding="utf-8") for path in Path(cli.__file__).parent.glob("*.py")}
    assert [name for name, text in sources.items() if "to_json" in text] == ["publish.py"]
    assert not [name for name, text in sources.items() if re.search(r"^ *import json|json\.dumps", text, re.M)]


COMMITTED = [
    "validation.json",
    "scoreboard/scoreboard.json",
    *sorted(f"{p.name}/validity.json" for p in REPORTS.glob("validity-*")),
]


@pytest.mark.long_rows("scoreboard/scoreboard.json", "validation.json")
@pytest.mark.parametrize("path", COMMITTED)
def test_every_committed_report_is_what_its_schema_says(path: str) -> None:
    name = path.rpartition("/")[2]
    schema = json.loads(SCHEMAS[name].read_text(encoding="utf-8"))
    assert faults(json.loads((REPORTS / path).read_text(encoding="utf-8")), schema) == []


CASES: dict[str, Callable[[], Any]] = {
    "driven, every joint model": lambda: written("paper"),
    "first order": lambda: written("paper", "static", model="first_order"),
    "ideal only, a prismatic joint": lambda: written("slider-crank"),
    "flagged angles": lambda: written("crank-rocker", clearance={"B": 3e-3}, theta=np.radians([30.0, 60.0])),
    "no answer anywhere": lambda: written("slider-crank", clearance={"A": 1e-4}, theta=np.radians([300.0])),
    "a free drive": lambda: written("pendulum"),
}


@pytest.mark.long_rows("no answer anywhere", "first order", "driven, every joint model", "a free drive")
@pytest.mark.parametrize("case", [slow(c)[0] if c == "flagged angles" else c for c in CASES])
def test_what_is_written_is_what_the_schema_says(case: str) -> None:
    result = CASES[case]()
    assert faults(result) == []
    for run in result["runs"]:
        count = len(run["crank_angle"])
        assert all(len(values) == count for side in ("analytic", "simulated") for values in run[side].values())
        assert all(int(index) < count for index in run["flags"])
        assert "time" not in run or len(run["time"]) == count
    if case == "no answer anywhere":
        assert [run["verdict"] for run in result["runs"]] == ["agrees", *["unjudged"] * 3]
    if case == "flagged angles":
        assert any(run["flags"] for run in result["runs"])


def test_several_engines_a_failure_and_a_known_difference_are_in_the_schema() -> None:
    known = Known(case="paper", signal="reaction_B_angle", simulator=("second",), bound=0.1, reason="planted")
    mechanism = load("paper")
    engines = {
        "first": Planted(name="first"),
        "second": Planted(turned("B", 0.05), name="second"),
        "third": Planted(lambda s: {name: np.full_like(v, np.nan) for name, v in s.items()}, name="third"),
    }
    job = job_of(
        mechanism,
        tuple(engines),
        TOLERANCES.model_copy(update={"known": (known,)}),
        motion="static",
        theta=np.radians(np.arange(20.0, 161.0, 20.0)),
    )
    result = json.loads(crosscheck_job(job, resolve=lambda name: engines[name]).to_json())
    assert faults(result) == []
    assert {"spread", "odd_one_out", "words"} <= set(result)
    assert len(result["failures"]) == 2
    verdicts = {row["verdict"] for run in result["runs"] for row in run["discrepancies"]}
    assert verdicts == {"agrees", "known"}


def changed(result: Any, *path: Any, value: Any) -> Any:
    out = copy.deepcopy(result)
    here = out
    for step in path[:-1]:
        here = here[step]
    if value is None:
        del here[path[-1]]
    else:
        here[path[-1]] = value
    return out


WRONG: dict[str, tuple[tuple[Any, ...], Any]] = {
    "another schema": (("schema",), 2),
    "no verdict": (("verdict",), None),
    "a verdict of its own": (("verdict",), "maybe"),
    "a field that nobody knows": (("colour",), "red"),
    "a run without its model": (("runs", 0, "analytic_model"), None),
    "a joint model of its own": (("runs", 0, "joint_model"), "rubber"),
    "a sample in words": (("runs", 0, "simulated", "drive_torque", 0), "high"),
    "a clearance of nothing": (("runs", 1, "clearance", "B"), 0),
    "a flag that is no index": (("runs", 0, "flags", "first"), "why"),
    "a difference without a tolerance": (("runs", 0, "discrepancies", 0, "tolerance"), None),
    "a known difference without a reason": (("runs", 0, "discrepancies", 0, "verdict"), "known"),
    "half an attribution": (("odd_one_out",), "analytic"),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_what_is_wrong_is_noticed(wrong: str, paper: Any) -> None:
    path, value = WRONG[wrong]
    assert not jsonschema.Draft202012Validator(RESULT).is_valid(changed(paper, *path, value=value))

"""What is exported runs without this project and gives the same numbers."""

from __future__ import annotations

import ast
import csv
import json
import shlex
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from analytic.mechanism import Mechanism
from analytic.mechanism.file import load
from asked import request_of
from compare.cli.export import export
from compare.results.export import Exported
from document_faults import faults
from linkages import curved_slider, inverted_slider
from sim_models.engine import ENGINES, JOINT_MODELS, Trace, declared
from sim_models.mujoco.engine import ENGINE

pytestmark = pytest.mark.mujoco

# of the largest value of a signal's kind; at rest, contact of 1e8 N/m makes forces of positions, whose rounding is
# 1e-16 m
# and a torque is what they leave; scripts add forces in another order
TOLERANCE = {"driven": 3e-11, "static": 1e-8}
ROUNDING = 1e-15  # m, N, N.m: where a pin without clearance is, say
FILES = {"model.xml", "start.json", "expected.csv", "run.py"}
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


def driven_by(mechanism: Mechanism, **drive: float) -> Mechanism:
    assert mechanism.drive is not None
    return mechanism.replace(drive=mechanism.drive.model_copy(update=drive))


PAPER = load("paper").with_clearances({"B": 1e-3})
CURVED = curved_slider()
SLIDER = inverted_slider().with_clearances({"A": 1e-4}).with_joint("A", friction=0.1)  # prismatic, and every joint law
SOFT = PAPER.with_clearances({}).with_joint("A", radial_stiffness=1e5).with_joint("E", radial_stiffness=3e5)
SHORT = np.radians([30.0, 40.0, 35.0])
REQUESTS = {
    **{
        f"paper, {model}, {motion}": request_of(PAPER, model, motion, SHORT)
        for model in JOINT_MODELS
        for motion in ("driven", "static")
    },
    "every joint law, driven": request_of(SLIDER, "contact", "driven", SHORT),
    "every joint law, static": request_of(SLIDER, "contact", "static", SHORT),
    "laws that are not linear, driven": request_of(CURVED, "ideal", "driven", SHORT),
    "laws that are not linear, static": request_of(CURVED, "ideal", "static", SHORT),
    "two gaps, backwards": request_of(
        driven_by(PAPER.with_clearances({"A": 1e-3, "B": 5e-4}), speed=-3.0), "contact", "driven", SHORT
    ),
    "compliant drive": request_of(driven_by(PAPER, stiffness=2000.0), "spring-damper", "driven", SHORT),
    "impacts": request_of(
        load("crank-rocker").with_clearances({"B": 2e-4}), "contact", "driven", SHORT, start="centred", lead_in=1.0
    ),
    "soft bearings, driven": request_of(SOFT, "ideal", "driven", SHORT),
    "a gap in a bearing of known stiffness, driven": request_of(
        load("crank-rocker").with_joint("B", clearance=2e-4, contact_stiffness=1e6, contact_damping=300.0),
        "contact",
        "driven",
        SHORT,
        start="centred",
        lead_in=1.0,
    ),
    "soft bearings beside a gap, driven": request_of(SOFT.with_clearances({"B": 1e-3}), "contact", "driven", SHORT),
    "soft bearings, static": request_of(SOFT, "ideal", "static", SHORT),
    "released": request_of(load("pendulum"), "ideal", time=np.array([0.3, 0.1, 0.5])),
    "released with a gap": request_of(
        load("pendulum").with_clearances({"O": 5e-4}), "contact", time=np.array([0.1, 0.2])
    ),
}


def bare(*folders: Path) -> str:
    """Output of run.py, from a folder outside the repository and with this project's packages out of reach."""
    scripts = [str(folder / "run.py") for folder in folders]
    done = subprocess.run(
        [sys.executable, "-I", "-c", ALONE, *scripts],
        cwd=folders[0].parent,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def table(path: Path) -> dict[str, np.ndarray]:
    with path.open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    names = [heading.split(" [")[0] for heading in header]
    return dict(zip(names, np.array(rows, float).T, strict=True))


def columns(trace: Trace, *, crank: bool = True) -> dict[str, np.ndarray]:
    """The trace in the order of passing, as it is exported: where a crank tells where the linkage is, without the
    joints' positions.
    """
    told = {"crank_angle": trace.crank_angle} if crank else {}
    own = {name: values for name, values in trace.signals.items() if not (crank and name.startswith("position_"))}
    every = {**told, **({} if trace.time is None else {"time": trace.time}), **own}
    order = np.arange(trace.crank_angle.size) if trace.time is None else np.argsort(trace.time)
    return {name: values[order] for name, values in every.items()}


def difference(found: Mapping[str, np.ndarray], truth: Mapping[str, np.ndarray]) -> float:
    """Largest difference, of the largest value among a vector's components; an angle's and a rate's of at least 1, what
    is rounding and nothing else of nothing.
    """
    worst = 0.0
    for name, values in truth.items():
        kind = [n for n in truth if n.rstrip("xy") == name.rstrip("xy")]
        peak = max(
            [float(np.abs(truth[n]).max()) for n in kind] + ([1.0] if "angle" in name or "angular" in name else [])
        )
        off = float(np.abs(found[name] - values).max())
        worst = max(worst, off / (peak or 1.0) if off > ROUNDING else 0.0)
    return worst


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Every request's folder, after its script has run in bare MuJoCo."""
    folders = {name: tmp_path_factory.mktemp("export") for name in REQUESTS}
    for name, folder in folders.items():
        assert {path.name for path in ENGINE.export(REQUESTS[name], folder)} == FILES
    bare(*folders.values())
    return folders


@pytest.mark.slow
@pytest.mark.parametrize("name", REQUESTS)
def test_bare_engine_gives_the_same_numbers(name: str, exported: dict[str, Path]) -> None:
    found, truth = table(exported[name] / "signals.csv"), columns(ENGINE.simulate(REQUESTS[name]))
    assert found.keys() == truth.keys()
    assert difference(found, truth) < TOLERANCE[REQUESTS[name].motion]


@pytest.mark.parametrize("name", REQUESTS)
def test_expected_values_are_the_trace_to_the_last_digit(name: str, exported: dict[str, Path]) -> None:
    written, truth = table(exported[name] / "expected.csv"), columns(ENGINE.simulate(REQUESTS[name]))
    assert list(written) == list(truth)
    for signal, values in truth.items():
        np.testing.assert_array_equal(written[signal], values, signal)


def test_script_imports_mujoco_and_numpy_and_nothing_else(exported: dict[str, Path]) -> None:
    tree = ast.parse((exported["impacts"] / "run.py").read_text(encoding="utf-8"))
    names = {a.name for node in ast.walk(tree) if isinstance(node, ast.Import) for a in node.names}
    names |= {str(node.module) for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert {name.partition(".")[0] for name in names} - set(sys.stdlib_module_names) == {"mujoco", "numpy"}


@pytest.mark.parametrize("name", REQUESTS)
def test_mjcf_holds_all_but_the_virtual_mass_of_soft_rows(name: str, exported: dict[str, Path]) -> None:
    start = json.loads((exported[name] / "start.json").read_text(encoding="utf-8"))
    assert set(start["after_compiling"]) <= {"tendon_invweight0"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "file", "right", "wrong"),
    [
        ("paper, ideal, driven", "model.xml", 'gear="0.0 50.0', 'gear="0.0 50.001'),
        (
            "paper, contact, static",
            "start.json",
            '"bearing_radius": 0.011, "margin": 0.0',
            '"bearing_radius": 0.011, "margin": -1.0',
        ),
        ("paper, spring-damper, static", "model.xml", 'range="-1 0.001"', 'range="-1 0.0010001"'),
    ],
)
def test_a_model_that_was_tampered_with_shows(name: str, file: str, right: str, wrong: str, tmp_path: Path) -> None:
    ENGINE.export(REQUESTS[name], tmp_path)
    text = (tmp_path / file).read_text(encoding="utf-8")
    assert right in text
    (tmp_path / file).write_text(text.replace(right, wrong), encoding="utf-8")
    lines = [line.split() for line in bare(tmp_path).splitlines()]
    said = next(float(line[1]) for line in lines if line[0] == "reaction_D_y")
    found, truth = (table(tmp_path / f"{side}.csv")["reaction_D_y"] for side in ("signals", "expected"))
    assert said == pytest.approx(float(np.abs(found - truth).max()), rel=0.05)
    assert said > 1e-5 * float(np.abs(truth).max())


def command(*arguments: str) -> tuple[int, str, str]:
    app = typer.Typer()
    app.command()(export)
    done = CliRunner().invoke(app, list(arguments))
    return done.exit_code, done.stdout, done.stderr


def test_command_writes_the_files_and_says_how_to_run_them(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "folder"
    status, said, _ = command(
        "--simulator",
        "mujoco",
        "--joint",
        "contact",
        "--angles",
        "30:40:5",
        "--clearance",
        "B=1e-3",
        "--out",
        str(folder),
    )
    assert status == 0
    assert {path.name for path in folder.iterdir()} == FILES
    assert said.splitlines()[-1].endswith(f"python {shlex.quote(str(folder / 'run.py'))}")
    assert "paper, contact joints, driven: 3 samples" in bare(folder)
    np.testing.assert_allclose(np.degrees(table(folder / "signals.csv")["crank_angle"]), [30, 35, 40], rtol=1e-9)


def test_the_command_that_is_printed_can_be_pasted_where_the_folder_has_a_space(tmp_path: Path) -> None:
    folder = tmp_path / "two words"
    _, said, _ = command("--simulator", "mujoco", "--angles", "30:40:5", "--out", str(folder))
    assert shlex.split(said.splitlines()[-1])[-2:] == ["python", str(folder / "run.py")]


def test_json_says_what_was_written_as_its_schema_says_and_quiet_says_nothing(tmp_path: Path) -> None:
    folder = tmp_path / "two words"
    asked = ["--simulator", "mujoco", "--joint", "contact", "--angles", "30:40:5", "--out", str(folder)]
    status, said, _ = command(*asked, "--json")
    assert status == 0
    content = json.loads(said)
    assert faults(Exported, content) == []
    assert {Path(path).name for path in content["paths"]} == {path.name for path in folder.iterdir()} == FILES
    assert shlex.split(content["run"]) == ["python", str(folder / "run.py")]
    assert content["needs"] == ["mujoco", "numpy"]
    found = Exported.model_validate(content)
    assert found.to_json() + "\n" == said
    assert repr(found) == "Exported(paper, mujoco, contact, driven: 4 files)"
    assert "run.py</td>" in found._repr_html_()
    with pytest.raises(TypeError, match="no picture"):
        found.plot()
    assert command(*asked, "--quiet")[:2] == (0, "")


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (["--simulator", "adams"], 2, ["'adams'", "mujoco"]),
        (
            ["--simulator", "mujoco", "--case", "crank-rocker", "--joint", "contact"],
            2,
            ["--joint contact", "give --clearance"],
        ),
        (["--simulator", "mujoco", "--angles", "20:200:5"], 2, ["change point"]),
        (
            ["--simulator", "mujoco", "--case", "pendulum", "--angles", "0:10:5"],
            2,
            ["--angles 0:10:5", "swings freely"],
        ),
        (["--simulator", "mujoco", "--clearance", "Q=1"], 2, ["Q=1", "D, A, B, E"]),
    ],
)
def test_what_cannot_be_exported_is_refused_in_one_sentence(
    arguments: list[str], status: int, words: list[str], tmp_path: Path
) -> None:
    code, said, why = command(*arguments, "--out", str(tmp_path / "out"))
    assert (code, said) == (status, "")
    assert len(why.strip().splitlines()) == 1
    for word in words:
        assert word in why
    assert not (tmp_path / "out").exists() or not list((tmp_path / "out").iterdir())


def test_a_run_that_fails_leaves_no_file(tmp_path: Path) -> None:
    unloaded = ["--case", "crank-rocker", "--clearance", "B=1e-4", "--joint", "contact", "--motion", "static"]
    code, said, why = command("--simulator", "mujoco", *unloaded, "--out", str(tmp_path / "out"))
    assert (code, said) == (3, "")
    assert "nothing presses the pin of joint 'B'" in why
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", [n for n in ENGINES if declared(n).capabilities.export is None])
def test_an_engine_without_an_export_says_which_have_one(name: str, tmp_path: Path) -> None:
    code, _, why = command("--simulator", name, "--out", str(tmp_path))
    assert code == 2
    assert name in why
    assert "mujoco" in why

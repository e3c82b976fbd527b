"""An engine that is installed and cannot be imported: it counts as not installed, in the import's own words, and the
others go on.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from commands import assert_refused
from marks import slow
from sim_models.engine import declared

NO_LIBRARY = "ImportError('libGL.so.1: cannot open shared object file: No such file or directory')"
FAULTS = {
    "a library that is not there": (NO_LIBRARY, "ImportError: libGL.so.1"),
    "a library of another build": ("OSError('undefined symbol: _ZN3foo')", "OSError: undefined symbol: _ZN3foo"),
    "another numpy": (
        "RuntimeError('module compiled against ABI version 0x1000009\\nbut this is 0x2000000')",
        "version 0x1000009 but this is",
    ),
}
RIG = Path(__file__).parents[1] / "docs" / "example-rig"
REPORTS = Path(__file__).parents[1] / "reports"
pytestmark = [pytest.mark.mujoco, pytest.mark.exudyn]


def break_engine(folder: Path, package: str, fault: str) -> None:
    """A package that fails as a broken installation does, found before the real one."""
    (folder / "broken" / package).mkdir(parents=True)
    (folder / "broken" / package / "__init__.py").write_text(f"print('half way')\nraise {fault}\n", encoding="utf-8")


def compare(folder: Path, *arguments: str, module: str = "compare") -> subprocess.CompletedProcess[str]:
    paths = [str(folder / "broken"), str(Path(__file__).parents[1])]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths), "COLUMNS": "300"}
    return subprocess.run(
        [sys.executable, "-m", module, *arguments],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


@pytest.mark.parametrize("what", ["a library that is not there", *slow("a library of another build", "another numpy")])
def test_the_engine_that_is_named_is_missing_in_one_sentence(what: str, tmp_path: Path) -> None:
    fault, said = FAULTS[what]
    break_engine(tmp_path, "exudyn", fault)
    done = compare(tmp_path, "--simulator", "exudyn", "--out", "out")
    assert done.returncode == 3
    assert done.stderr.startswith("compare: simulator 'exudyn' is installed but cannot be imported (")
    assert said in done.stderr
    assert done.stderr.count("\n") == 1
    assert done.stdout == ""
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_all_goes_on_without_it_and_says_so(tmp_path: Path) -> None:
    break_engine(tmp_path, "exudyn", NO_LIBRARY)
    command = ["--simulator", "all", "--joint", "ideal", "--angles", "20:60:20", "--out", "out", "--json"]
    done = compare(tmp_path, *command)
    assert done.returncode == 0
    assert "left out: simulator 'exudyn' is installed but cannot be imported (ImportError: libGL.so.1" in done.stderr
    runs = json.loads(done.stdout)["runs"]  # nothing else on standard output
    names = {run["simulator"]["name"] for run in runs}
    assert "mujoco" in names
    assert "exudyn" not in names


def test_no_engine_that_works_is_said_once(tmp_path: Path) -> None:
    for name in ("mujoco", "exudyn", "pybullet", "dart"):
        break_engine(tmp_path, declared(name).package, "ImportError('libGL.so.1')")
    done = compare(tmp_path, "--simulator", "all", "--out", "out")
    assert_refused(done, "no simulator", status=3)


@pytest.mark.slow
def test_the_list_of_simulators_says_that_it_is_broken(tmp_path: Path) -> None:
    break_engine(tmp_path, "exudyn", NO_LIBRARY)
    done = compare(tmp_path, "simulators")
    assert done.returncode == 0
    rows = {line.split()[0]: line for line in done.stdout.splitlines()[4::-1] if line}
    assert rows["exudyn"].split()[1] == "broken"
    assert "broken" not in rows["mujoco"]
    assert (
        "exudyn is installed but cannot be imported: ImportError: libGL.so.1: cannot open shared object file"
        in done.stdout
    )


MISSING = "compare: simulator 'exudyn' is installed but"
COMMANDS = {
    "baseline": (["baseline", "update", "--case", "pendulum", "--baselines", "out"], "left out: simulator 'exudyn'", 0),
    "baseline of it": (
        ["baseline", "update", "--case", "pendulum", "--simulator", "exudyn", "--baselines", "out"],
        MISSING,
        3,
    ),
    "validity": (
        ["validity", "--speeds", "60", "--clearances", "1e-4", "--simulator", "exudyn", "--out", "out"],
        MISSING,
        3,
    ),
    "diagnose": (["diagnose", str(RIG / "measured.toml"), "--simulator", "exudyn", "--out", "out"], MISSING, 3),
    "export": (["export", "--simulator", "exudyn", "--out", "out"], MISSING, 3),
    "flexible": (["--flexible", "--motion", "static", "--simulator", "exudyn", "--out", "out"], MISSING, 3),
}


@pytest.mark.parametrize("what", ["baseline of it", *slow("export", "flexible", "baseline", "validity", "diagnose")])
def test_every_command_says_so_without_a_traceback(what: str, tmp_path: Path) -> None:
    arguments, said, status = COMMANDS[what]
    break_engine(tmp_path, "exudyn", NO_LIBRARY)
    done = compare(tmp_path, *arguments)
    assert_refused(done, said, status=status)


@pytest.mark.slow
def test_validity_validation_and_diagnosis_go_on_without_it(tmp_path: Path) -> None:
    break_engine(tmp_path, "exudyn", NO_LIBRARY)
    done = compare(tmp_path, "diagnose", str(RIG / "measured.toml"), "--json", "--out", "found")
    assert done.returncode == 0
    assert "mujoco" in done.stdout
    assert "cannot be imported (ImportError: libGL.so.1" in done.stdout
    done = compare(
        tmp_path, "validity", "--speeds", "60", "--clearances", "1e-4", "--simulator", "all", "--out", "out", "--json"
    )
    assert done.returncode == 0
    assert "mujoco" in json.loads(done.stdout)["simulators"]
    assert "exudyn" not in json.loads(done.stdout)["simulators"]
    assert "left out: simulator 'exudyn'" in done.stderr
    for name in ("README.md", "validation.json"):
        (tmp_path / name).write_text((REPORTS / name).read_text(encoding="utf-8"), encoding="utf-8")
    done = compare(tmp_path, "validation", "check", "--reports", ".", "--simulator", "exudyn", module="tests.evidence")
    assert_refused(done, "simulator 'exudyn' is installed but cannot be imported", status=3)


def test_help_and_the_cases_import_no_engine(tmp_path: Path) -> None:
    """They would be slow, and a broken engine is nothing to them."""
    for name in ("mujoco", "exudyn", "pybullet", "dart"):
        break_engine(tmp_path, declared(name).package, "SystemExit('imported')")
    for arguments in (["--help"], ["cases"], ["effects"]):
        began = time.perf_counter()
        done = compare(tmp_path, *arguments)
        assert done.returncode == 0, done.stderr
        assert "half way" not in done.stdout + done.stderr
        assert time.perf_counter() - began < 20

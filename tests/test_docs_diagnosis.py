"""docs/diagnosis.md says what the code does: its tables, its files, and an effect of one's own that runs."""

from __future__ import annotations

import importlib
import json
import re
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from compare.diagnose.data.measured import load_measured
from compare.diagnose.effects.vocabulary import VOCABULARY
from test_ci_example import step

ROOT = Path(__file__).parent.parent
RIG = ROOT / "docs" / "example-rig"
TEXT = (ROOT / "docs" / "diagnosis.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```(\w*)\n(.*?)```", TEXT, re.DOTALL)


def rows(head: str) -> list[list[str]]:
    """The rows of the table that begins with a head."""
    table = TEXT[TEXT.index(head) :].split("\n\n")[0].splitlines()[2:]
    return [[cell.strip() for cell in row.strip("|").split("|")] for row in table]


def parameters(text: str) -> list[tuple[str, str]]:
    """Names and units of ``x, y (m/s^2), z (N)``: a unit is that of all names before it."""
    found: list[tuple[str, str]] = []
    for names, unit in re.findall(r"([\w, ]+?)(?: \(([^)]*)\)|$)(?:, )?", text):
        found += [(name, unit) for name in names.split(", ")]
    return found


def test_its_vocabulary_is_the_code_s() -> None:
    said = {name: parameters(text) for name, _, text in rows("| Effect | Where | Parameters |")}
    assert said == {name: [(p.name, p.unit) for p in effect.parameters] for name, effect in VOCABULARY.items()}
    assert list(said) == list(VOCABULARY)


def test_its_numbers_are_the_code_s() -> None:
    table = rows("| What | Value | In the code |")
    assert len(table) >= 7
    for _, values, names in table:
        for value, name in zip(values.split(", "), names.replace("`", "").split(", "), strict=True):
            module, constant = name.split(".")
            assert getattr(importlib.import_module(f"compare.diagnose.{module}"), constant) == float(value), name


def test_the_files_that_it_shows_can_be_read(tmp_path: Path) -> None:
    (data,) = (text for kind, text in BLOCKS if kind == "")
    (measured,) = (text for kind, text in BLOCKS if kind == "toml")
    header, *shown = data.splitlines()
    assert [row.count(",") for row in shown] == [header.count(",")] * 2
    (tmp_path / "measured.toml").write_text(measured, encoding="utf-8")
    shutil.copy(RIG / "nominal.toml", tmp_path)
    time = np.linspace(0.0, 1.0, 40)
    columns = np.column_stack([time, np.degrees(6.0 * time), *(np.sin(k * time) for k in range(1, 5))])
    for name in ("slow", "by-hand", "let-go"):
        text = "\n".join([header, *(",".join(f"{value:.9g}" for value in row) for row in columns)])
        (tmp_path / f"{name}.csv").write_text(text + "\n", encoding="utf-8")
    found = load_measured(tmp_path / "measured.toml")
    assert [run.drive for run in found.runs] == ["speed", "measured", "free"]
    assert set(found.runs[0].channels) == {name.split(" [")[0] for name in header.split(",")[1:]}
    assert found.tolerance == {"mass": 0.002, "length_error": 2e-4}
    assert found.runs[2].loads is not None


def recorded(folder: Path, damping: dict[str, float]) -> None:
    """The example rig as if it had no clearance, and this drag (N.m.s/rad) in its bearings."""
    play = runpy.run_path(str(RIG / "make.py"))["make"]
    play.__globals__.update(CLEARANCE={}, DAMPING=damping)
    folder.mkdir()
    for name in ("measured.toml", "nominal.toml"):
        shutil.copy(RIG / name, folder)
    play(folder)


@pytest.mark.slow
def test_the_effect_of_one_s_own_is_found_in_data_that_have_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    recorded(tmp_path / "my-rig", dict.fromkeys("DABE", 3e-3))
    (example,) = (text for kind, text in BLOCKS if kind == "python")
    names: dict[str, object] = {"__name__": "example"}
    exec(compile(example, "diagnosis.md", "exec"), names)
    assert capsys.readouterr().out.strip() == "explained [('bearing_drag', 'linkage')]"
    damping = names["found"].result["effects"][0]["parameters"]["damping"]  # type: ignore[attr-defined]
    assert damping["low"] < 3e-3 < damping["high"]


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("bash") is None, reason="there is no bash to run the workflow's step")
def test_the_ci_example_s_step_says_what_it_found_and_keeps_the_report(tmp_path: Path) -> None:
    recorded(tmp_path / "rig", {"E": 4e-3})
    words = (
        step("Diagnose the rig")
        .replace("compare diagnose", f"{sys.executable} -m compare diagnose")
        .replace("python -c", f"{sys.executable} -c")
    )
    done = subprocess.run(
        ["bash", "-e", "-c", words], cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == ["explained", "viscous_friction at E"]
    assert (
        json.loads((tmp_path / "crosscheck-report" / "diagnosis" / "diagnosis.json").read_text(encoding="utf-8"))[
            "verdict"
        ]
        == "explained"
    )

"""The pytest plugin: what a test of somebody's linkage says when it fails, and what it leaves."""

from __future__ import annotations

import importlib.metadata
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import linkage_crosscheck as lc
from compare.baseline.check import check_baselines
from sim_models import engine as seam

pytest_plugins = ["pytester"]
pytestmark = pytest.mark.mujoco

ROOT = Path(__file__).parent.parent
ENTRY = importlib.metadata.entry_points(group="pytest11", name="linkage_crosscheck")
LOAD = () if ENTRY else ("-p", "linkage_crosscheck.pytest_plugin")
ANGLES = "angles=[0.6, 0.9, 1.2]"


@pytest.fixture(scope="module", autouse=True)
def _warm(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Everything is imported once: pytester takes out of memory what a run of its own imports."""
    folder = tmp_path_factory.mktemp("warm")
    lc.crosscheck("crank-rocker", angles=[0.6]).write(folder)
    check_baselines("crank-rocker", "mujoco", folder)


@pytest.fixture
def bench(pytester: pytest.Pytester) -> pytest.Pytester:
    """A folder with a linkage of somebody's own beside its tests."""
    crank_rocker = (ROOT / "analytic" / "mechanism" / "cases" / "crank-rocker.toml").read_text(encoding="utf-8")
    pytester.makefile(".toml", mine=crank_rocker.replace('name = "crank-rocker"', 'name = "mine"'))
    return pytester


def outcome(bench: pytest.Pytester, call: str, *options: str, **expected: int) -> str:
    """What pytest prints of a test that makes this call."""
    bench.makepyfile(f"def test_linkage(linkage_check):\n    found = linkage_check({call})\n    assert found.runs\n")
    done = bench.runpytest_inprocess("-p", "no:cacheprovider", *LOAD, *options)
    done.assert_outcomes(**(expected or {"failed": 1}))
    return "\n".join(done.outlines)


def test_a_linkage_that_agrees_passes_and_is_found_beside_the_test(bench: pytest.Pytester) -> None:
    outcome(bench, f"'mine.toml', {ANGLES}", passed=1)


@pytest.mark.slow
def test_somebodys_model_is_found_beside_the_test_too(bench: pytest.Pytester) -> None:
    lc.export("crank-rocker", "mujoco", folder=bench.path / "exported")
    bench.makefile(".xml", own=next((bench.path / "exported").rglob("*.xml")).read_text())
    bench.makepyfile(f"def test_it(linkage_check):\n    linkage_check('mine.toml', 'mjcf:own.xml', {ANGLES})\n")
    done = bench.runpytest_subprocess("-p", "no:cacheprovider", *LOAD, "--rootdir", ".", bench.path)
    done.assert_outcomes(passed=1)


def test_each_signal_that_disagrees_has_a_line_in_the_units_that_people_read(bench: pytest.Pytester) -> None:
    said = outcome(bench, "'paper', joint_model='contact', motion='static', analytic='first_order', angles=[0.6, 1.2]")
    (angle,) = [line for line in said.splitlines() if line.startswith("E ") and "reaction angle at B:" in line]
    assert "deg at " in angle
    assert "(tolerance " in angle
    assert "E         mujoco, contact: reaction force at B:" in said
    assert "run: pytest --linkage-report=DIR test_each_signal" in said
    assert "linkage_check('paper'" in said  # where it was asked
    assert "crosscheck.py" not in said  # and not where it was found


def test_the_report_of_every_check_is_written(bench: pytest.Pytester) -> None:
    call = f"'mine.toml', {ANGLES}); linkage_check('mine.toml', {ANGLES}"
    outcome(bench, call, "--linkage-report", "kept", passed=1)
    first, second = sorted((bench.path / "kept").iterdir())
    assert second.name == f"{first.name}-2"
    assert {"report.html", "result.json", "junit.xml"} <= {path.name for path in second.iterdir()}
    said = outcome(bench, "'paper', motion='static', analytic='first_order', angles=[0.6]", "--linkage-report", "kept")
    assert "report.html" in said


FAULTS = {
    "'no-such-linkage'": "no-such-linkage",
    "'mine.toml', clearance={'Q': 1e-4}": "'Q' is not a revolute joint of mine",
    "'mine.toml', simulator='adams'": "simulator 'adams' is unknown",
    "'mine.toml', baseline='kept', angles=[0.6]": "there is no such baseline; write it with: pytest --linkage-update",
    "'mine.toml', 'mujoco,exudyn', baseline='kept.toml', angles=[0.6]": "is one file for mujoco, exudyn",
}


@pytest.mark.exudyn
def test_a_fault_is_a_sentence(bench: pytest.Pytester) -> None:
    calls = [f"def test_{i}(linkage_check):\n    linkage_check({call})\n" for i, call in enumerate(FAULTS)]
    bench.makepyfile("\n".join(calls))
    done = bench.runpytest_inprocess("-p", "no:cacheprovider", *LOAD)
    done.assert_outcomes(failed=len(FAULTS))
    sentences = [line for line in done.outlines if line.startswith("E ")]
    assert len(sentences) == len(FAULTS)  # no class of ours, no traceback of ours
    for words, line in zip(FAULTS.values(), sentences, strict=True):
        assert words in line


def test_an_engine_that_is_asked_for_and_missing_fails_with_what_to_install(
    bench: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = seam.importlib.util.find_spec
    monkeypatch.setattr(seam.importlib.util, "find_spec", lambda name: None if name == "exudyn" else found(name))
    assert "run: pip install 'linkage-crosscheck[exudyn]'" in outcome(bench, "'mine.toml', simulator='exudyn'")


def test_baselines_are_stored_and_what_moves_is_told(bench: pytest.Pytester) -> None:
    call = f"'mine.toml', baseline='kept', {ANGLES}"
    said = outcome(bench, call, "--linkage-update-baselines", passed=1)
    stored = bench.path / "kept" / "mine-mujoco.toml"
    assert f"{stored}: written" in said
    outcome(bench, call, passed=1)
    linkage = bench.path / "mine.toml"
    text = linkage.read_text(encoding="utf-8")
    assert "mass = 0.0942\n" in text
    linkage.write_text(text.replace("mass = 0.0942\n", "mass = 0.0952\n"), encoding="utf-8")
    said = outcome(bench, call)
    assert f"{stored}: ideal, driven: reaction_" in said
    assert "moved by" in said


def test_it_costs_nothing_to_load() -> None:
    heavy = "{'numpy', 'pydantic', 'scipy', 'compare', 'analytic', 'sim_models'}"
    text = f"import sys, linkage_crosscheck.pytest_plugin; print(sorted({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", text], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_it_is_offered_to_pytest() -> None:
    fields = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert fields["project"]["entry-points"]["pytest11"] == {"linkage_crosscheck": "linkage_crosscheck.pytest_plugin"}

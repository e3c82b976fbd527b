"""The committed validation report: whatever in it is no longer so is said, and so is what was not looked at."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analytic.mechanism.file import load, shipped_cases
from commands import compare, without
from compare.evidence.stored import other_versions, read, stale_page
from compare.evidence.validation.check import REMEDY, differences, looked_at
from compare.evidence.validation.files import apart
from compare.evidence.validation.runs import first_order
from compare.evidence.validation.scales import checked
from compare.faults import OptionError
from compare.report.validation import drawn, page
from compare.results.validation import Validation, ValidationCheck
from document_faults import faults
from sample_result import as_document, sample_result
from sim_models.engine import declared

REPORTS = Path(__file__).parents[1] / "reports"
CONTENT = json.loads((REPORTS / "validation.json").read_text(encoding="utf-8"))
STORED = read(Validation, REPORTS)


def changed(*path: Any, value: Any) -> dict[str, Any]:
    """The committed report's content with one value of another."""
    out = copy.deepcopy(CONTENT)
    here: Any = out
    for step in path[:-1]:
        here = here[step]
    here[path[-1]] = value
    return out


def only(*engines: str) -> Validation:
    """What is found where these engines are installed and no other."""
    return STORED.model_copy(
        update={
            "runs": tuple(run for run in STORED.runs if run.simulator in engines),
            "scales": tuple(row for row in STORED.scales if row.simulator in engines),
            "versions": {name: STORED.versions[name] for name in engines},
            "superposition": STORED.superposition if "exudyn" in engines else (),
            "in_engines": {
                case: tuple(row for row in rows if row.simulator in engines) for case, rows in STORED.in_engines.items()
            },
        }
    )


def test_the_committed_report_is_written_again_as_it_is() -> None:
    text = (REPORTS / "validation.json").read_text(encoding="utf-8")
    assert STORED.files()["validation.json"] == text


def test_the_committed_page_and_first_order_table_are_those_of_the_committed_numbers(tmp_path: Path) -> None:
    assert list(stale_page(REPORTS / "README.md", page(STORED), REMEDY)) == []
    assert list(differences(STORED, STORED.model_copy(update={"first_order": first_order()}))) == []
    edited = tmp_path / "README.md"
    edited.write_text(page(STORED).replace("7.1 deg", "6.1 deg"), encoding="utf-8")
    (line,) = stale_page(edited, page(STORED), REMEDY)
    assert line.startswith(f"{edited}: line {page(STORED).splitlines().index('| 10 mm | 7.1 deg | 31 % |') + 1} ")
    assert len(list(stale_page(tmp_path / "none.md", page(STORED), REMEDY))) == 1


def test_every_picture_that_the_page_shows_is_drawn() -> None:
    drawings = {f"figures/paper-{name}.svg" for name in drawn(as_document(sample_result("paper")))}
    assert drawings == {
        line.split("](")[1].rstrip(")") for line in page(STORED).splitlines() if "](figures/paper-" in line
    }


AT = {run.key: k for k, run in enumerate(STORED.runs)}
FIRST = AT["crank-rocker", "ideal, driven", "mujoco"]
TAMPERED: dict[str, tuple[tuple[Any, ...], Any, str]] = {
    "a verdict": (
        ("runs", FIRST, "verdict"),
        "disagrees",
        "crank-rocker, ideal, driven, mujoco: verdict was disagrees, is agrees",
    ),
    "a count": (("runs", FIRST, "signals"), 11, "signals was 11, is 12"),
    "a share that is absurd": (("runs", FIRST, "share"), 1e9, "was 1e+11 % (reaction_D_angle), is 1 %"),
    "a share that is too good": (
        ("runs", AT["crank-rocker", "spring-damper, static", "mujoco"], "share"),
        0.1,
        "was 10 %",
    ),
    "another signal": (("runs", FIRST, "closest"), "crank_angle", "was 1 % (crank_angle), is 1 % (reaction_D_angle)"),
    "a first-order angle": (("first_order", 0, "angle"), 99.0, "first_order, clearance 0.01: angle was 99, is 7.05585"),
    "its last printed digit": (("first_order", 2, "magnitude"), 0.00578, "magnitude was 0.00578, is 0.00572865"),
    "a clearance": (("first_order", 0, "clearance"), 0.02, "first_order, clearance 0.02: row is no longer there"),
    "a verdict at a scale": (("scales", 0, "verdict"), "disagrees", "was disagrees, is refused"),
    "superposition": (("superposition", 0, "equilibrium"), 0.0034, "equilibrium was 0.0034, is 0.00331615"),
    "a workspace": (
        ("workspaces", "3-rrr", 0, "first_order"),
        0.01,
        "workspaces, 3-rrr, holding 5: first_order was 0.01, is",
    ),
    "an engine along a spiral": (
        ("in_engines", "five-bar", 1, "equilibrium"),
        0.1,
        "five-bar in exudyn, driven, along a spiral: equilibrium was 0.1, is 0.015",
    ),
    "a platform on links that bend": (
        ("bent", 0, "off_worst"),
        0.1,
        "five-bar on links that bend, ideal joints: off_worst was 0.1, is 0.00064",
    ),
    "a file that is run as an engine": (
        ("carried", 0, "simulated"),
        0.5,
        "2r-arm exported from mujoco: simulated was 0.5, is",
    ),
    "a published figure": (
        ("published", 0, "figures", 0, "apart", 0, "off"),
        9e-7,
        "Andrews' squeezer, seven angles, analytic, by its crank: was off by 9e-07, is off by 6.7e-10",
    ),
}


@pytest.mark.parametrize("case", TAMPERED)
def test_a_number_that_is_not_found_again_is_named(case: str) -> None:
    path, value, words = TAMPERED[case]
    said = list(differences(Validation.model_validate(changed(*path, value=value)), STORED))
    assert len(said) == (2 if case == "a clearance" else 1)
    assert any(words in line for line in said)


def test_a_published_figure_that_is_missed_is_named_whatever_is_stored() -> None:
    missed = Validation.model_validate(changed("published", 0, "figures", 1, "apart", 0, "off", value=2e-6))
    said = "Andrews' squeezer, seven rates, analytic, by its crank: is off by 2e-06, and 1e-06 is allowed"
    assert list(differences(missed, missed)) == [said]


@pytest.mark.parametrize("what", ["alone", "imported"])
def test_what_a_file_loses_is_named_whatever_is_stored(what: str) -> None:
    lost = Validation.model_validate(changed("carried", 0, what, value=2e-6))
    said = f"2r-arm exported from mujoco: {what} is off by 2e-06 of the largest value, and 1e-06 is allowed"
    assert list(differences(lost, lost)) == [said]


def test_what_a_file_makes_disagree_is_named_whatever_is_stored() -> None:
    odd = Validation.model_validate(changed("carried", 1, "checked", value=1.5))
    said = "2r-arm exported from exudyn: checked disagrees, with 1.5 of a tolerance"
    assert list(differences(odd, odd)) == [said]


def test_every_parallel_linkage_is_carried_in_files_of_every_engine_that_writes_them() -> None:
    several = [case for case in shipped_cases() if len(load(case).drives) > 1]
    can = [name for name in STORED.versions if declared(name).capabilities.export is not None]
    assert [(row.case, row.simulator) for row in STORED.carried] == [(case, name) for case in several for name in can]
    assert all(row.checked < 1.0 and (row.simulated or 0.0) < 1.0 for row in STORED.carried)


def test_a_table_that_differs_in_one_number_is_apart() -> None:
    table = {"drive_torque_A": np.array([1.0, -4.0]), "reaction_A_x": np.array([0.0, 1.0])}
    off = table | {"reaction_A_x": np.array([0.0, 1.5])}
    assert apart(table, table) == 0.0
    assert apart(off, table) == 0.5
    assert apart(off | {"drive_torque_A": np.array([3.0, -4.0])}, table) == 0.5  # 2 of 4
    assert apart(off | {"drive_torque_A": np.array([1.0, 4.0])}, table) == 2.0


def test_the_report_says_how_fast_it_is_beside_what_is_wanted() -> None:
    assert all(row.value <= row.wanted for row in STORED.speed if row.wanted is not None)
    assert {row.wanted for row in STORED.speed if row.unit == "us"} == {None, 10.0, 60.0}
    assert any("pylinkage" in row.what for row in STORED.speed)
    told = page(STORED).partition("## How fast it is")[2]
    assert all(f"| {row.what} | {f'{row.value:g} {row.unit}'.strip()} |" in told for row in STORED.speed)


def test_every_published_figure_of_the_committed_report_is_met() -> None:
    assert [source.name for source in STORED.published] == [
        "Andrews' squeezer",
        "A parallel robot of two motors",
        "A block with play in its guide",
        "A ball-screw axis (EMPS)",
    ]
    assert all(apart.off <= apart.allowed for s in STORED.published for held in s.figures for apart in held.apart)


def test_real_contact_is_where_the_equilibrium_says_and_not_where_eq_8_does() -> None:
    """MuJoCo's contact hardly yields: what the equilibrium is off it is far less than what Eq. 8 is."""
    for case, rows in STORED.in_engines.items():
        (row,) = (row for row in rows if (row.simulator, row.motion) == ("mujoco", "driven"))
        assert row.equilibrium < row.first_order / 10, case
        (row,) = (row for row in rows if row.simulator == "pybullet")  # at rest, whose pins lie on massless rods
        assert row.equilibrium < row.first_order / 1e4, case


def test_what_is_rounding_may_differ() -> None:
    k = AT["paper", "ideal, driven", "dart"]
    assert STORED.runs[k].share < 1e-5
    rounded = changed("runs", k, "share", value=2e-6)
    rounded["runs"][k]["closest"] = "crank_angle"
    rounded["superposition"][0]["equilibrium"] += 1e-7
    assert list(differences(STORED, Validation.model_validate(rounded))) == []
    k = AT["crank-rocker", "ideal, driven", "exudyn"]
    assert list(differences(Validation.model_validate(changed("runs", k, "share", value=0.03)), STORED)) == []


def test_an_engine_that_is_not_here_is_said_to_be_left_out() -> None:
    scales = len(STORED.scales)
    assert looked_at(STORED, STORED) == (
        f"142 of 142 runs, {scales} of {scales} at scales, 4 of 4 published, first_order, workspaces and superposition"
        " made again",
        (),
    )
    done, left_out = looked_at(STORED, only("mujoco"))
    assert done == (
        f"39 of 142 runs, {scales // 28 * 8} of {scales} at scales, 4 of 4 published, first_order, workspaces made"
        " again"
    )
    assert "; ".join(left_out) == (
        "42 runs of exudyn; 31 runs of pybullet; 30 runs of dart; superposition, which takes exudyn"
    )
    assert list(differences(STORED, only("mujoco"))) == []
    assert list(other_versions(STORED.versions, {"mujoco": "5.0"}, "report")) == [
        "mujoco is 5.0 here, and the report was made with 4.0.0"
    ]


DAMAGE: dict[str, tuple[Callable[[str], str], str]] = {
    "cut off": (lambda text: text[: len(text) // 2], "cannot be read as JSON"),
    "a list": (lambda text: "[]", "holds a list"),
    "another schema": (lambda text: text.replace('"schema": 1', '"schema": 2'), "schema = 2"),
    "a share in words": (lambda text: text.replace('"share": 0.2', '"share": "much"', 1), "'much'"),
    "no runs": (lambda text: json.dumps(json.loads(text) | {"runs": []}), "runs = []"),
    "a row without its number": (lambda text: text.replace('"angle"', '"angel"', 1), "first_order[0].angle is missing"),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_a_damaged_report_is_refused_in_one_sentence(damage: str, tmp_path: Path) -> None:
    spoil, words = DAMAGE[damage]
    path = tmp_path / "validation.json"
    path.write_text(spoil((REPORTS / "validation.json").read_text(encoding="utf-8")), encoding="utf-8")
    with pytest.raises(OptionError) as caught:
        read(Validation, tmp_path)
    assert words in str(caught.value)
    assert "compare validation update" in str(caught.value)
    assert "\n" not in str(caught.value)


def copied(folder: Path) -> None:
    for name in ("README.md", "validation.json"):
        (folder / name).write_text((REPORTS / name).read_text(encoding="utf-8"), encoding="utf-8")


@pytest.mark.slow
@pytest.mark.mujoco
def test_the_command_makes_the_runs_of_the_engines_that_are_here_and_does_not_pass_for_those_that_are_not(
    tmp_path: Path,
) -> None:
    copied(tmp_path)
    with without("exudyn", "pybullet", "dartpy"):
        done = compare("validation", "check", "--reports", ".", cwd=tmp_path)
    assert done.returncode == 3, done.stdout + done.stderr
    again, scales = len(checked()) * 8, len(STORED.scales)
    assert (
        done.stdout
        == f"39 of 142 runs, {again} of {scales} at scales, 1 of 4 published, first_order, workspaces made again;"
        " 0 differ from validation.json\n"
    )
    assert "not looked at: 42 runs of exudyn; 31 runs of pybullet; 30 runs of dart" in done.stderr


@pytest.mark.mujoco
def test_the_command_says_what_is_not_found_again_and_leaves_with_status_1(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The runs themselves are those of the committed report: that they are made again is another test's."""
    copied(tmp_path)
    tampered = changed("runs", FIRST, "share", value=1e9) | {
        "first_order": changed("first_order", 0, "angle", value=99.0)["first_order"]
    }
    (tmp_path / "validation.json").write_text(json.dumps(tampered), encoding="utf-8")
    asked = []
    monkeypatch.setattr(
        "compare.evidence.validation.check.run_all", lambda engines, *_, **__: asked.append(engines) or only("mujoco")
    )
    done = compare("validation", "check", "--reports", ".", "--simulator", "mujoco", cwd=tmp_path)
    assert asked == [("mujoco",)]
    assert done.returncode == 1, done.stdout + done.stderr
    page_line, run_line, table_line, summary = done.stdout.splitlines()
    assert page_line.startswith("README.md: line ")
    assert run_line.startswith("crank-rocker, ideal, driven, mujoco: largest share")
    assert table_line.startswith("first_order, clearance 0.01: angle was 99")
    assert summary.endswith("; 3 differ from validation.json")
    told = compare("validation", "check", "--reports", ".", "--simulator", "mujoco", "--json", cwd=tmp_path)
    content = json.loads(told.stdout)
    assert faults(ValidationCheck, content) == []
    assert content["differences"] == [page_line, run_line, table_line]


def test_a_folder_of_data_that_is_not_there_is_refused(tmp_path: Path) -> None:
    done = compare("validation", "check", "--data", "nowhere", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "compare: --data nowhere: there is no such folder\n"
    done = compare("validation", "check", "--data", ".", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert "has none of adams-parallel-robot, emps" in done.stderr

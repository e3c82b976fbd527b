"""Regression on reaction forces: what moved is found, all of it; what did not is left alone."""

from __future__ import annotations

import json
import os
import re
import shlex
import tomllib
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import jsonschema
import numpy as np
import pytest

import commands
from analytic.mechanism import Mechanism
from analytic.mechanism.file import dumps, load, shipped_cases
from compare.baseline.check import check_file, command, file_of, update_file
from compare.baseline.comparison import fits, moved
from compare.baseline.file import Baseline, BaselineError, MovedLimits, StoredRun, read, write
from compare.baseline.runs import not_run, setups
from compare.report.baselines import _cases, lines
from compare.results.baselines import Entry
from compare.results.schemas import FOLDER
from planted import Planted, turned
from sim_models.engine import ENGINES, declared, engine

ROOT = Path(__file__).parent.parent
PAPER = load("paper")
OF_PAPER = ["--case", "paper", "--simulator", "planted"]


def compare(*arguments: str, cwd: Path) -> commands.Ended:
    return commands.compare("baseline", *arguments, cwd=cwd)


def update(folder: Path, fault: Planted, mechanism: Mechanism = PAPER) -> None:
    folder.mkdir(exist_ok=True)
    path, checks = file_of(folder, mechanism.name, "planted"), command("check", OF_PAPER, folder)
    print(*lines(update_file(path, mechanism, "planted", checks, lambda name: fault)), sep="\n")


def check(folder: Path, fault: Planted, mechanism: Mechanism = PAPER) -> bool:
    path, again = file_of(folder, mechanism.name, "planted"), command("update", OF_PAPER, folder)
    entry = check_file(path, mechanism, "planted", again, lambda name: fault)
    print(*lines(entry), sep="\n")
    assert entry.status == ("moved" if entry.moved or entry.why else "same")
    return entry.status == "same"


# -------------------------------------------------------------------- the command


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The paper's baseline in MuJoCo, as the command writes it."""
    folder = tmp_path_factory.mktemp("written")
    done = compare("update", "--case", "paper", "--simulator", "mujoco", cwd=folder)
    assert done.returncode == 0, done.stderr
    return (folder / "reports" / "baselines" / "paper-mujoco.toml").read_text(encoding="utf-8")


def planted(text: str, folder: Path) -> Path:
    path = folder / "reports" / "baselines" / "paper-mujoco.toml"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def with_angle_moved(text: str, degrees: float, run: str = "contact, static") -> str:
    """The direction at B (sixth number) at 30 deg, moved."""
    head, _, tail = text.partition(f'name = "{run}"')
    row = next(line for line in tail.splitlines() if re.match(r"  \[ *30,", line))
    cells = row.strip(" [],").split(",")
    cells[5] = f"{float(cells[5]) + degrees:.4f}"
    return head + f'name = "{run}"' + tail.replace(row, "  [" + ",".join(cells) + "],", 1)


@pytest.mark.mujoco
def test_nothing_moved_is_status_0_and_says_how_much_was_looked_at(written: str, tmp_path: Path) -> None:
    planted(written, tmp_path)
    done = compare("check", "--case", "paper", "--simulator", "mujoco", cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.fullmatch(r"paper, mujoco \S+: nothing moved \(1044 numbers in 4 runs\)\n", done.stdout)
    assert done.stderr == ""


@pytest.mark.slow
@pytest.mark.mujoco
def test_two_hundredths_of_a_degree_are_status_1_and_reported_with_size_sign_and_place(
    written: str, tmp_path: Path
) -> None:
    twice = with_angle_moved(with_angle_moved(written, 0.02, "ideal, driven"), -0.02, "massless-link, static")
    planted(twice, tmp_path)
    done = compare("check", "--case", "paper", "--simulator", "mujoco", cwd=tmp_path)
    assert done.returncode == 1
    _, *lines, look, accept = done.stdout.splitlines()
    assert accept == "  to accept it: compare baseline update --case paper --simulator mujoco"
    stored = "reports/baselines/paper-mujoco.toml"
    assert look == (
        "  to look at it: compare baseline update --case paper --simulator mujoco --baselines moved"
        f" && diff -I '^#' {stored} moved/paper-mujoco.toml"
    )
    assert compare(*shlex.split(look.partition("&&")[0])[6:], cwd=tmp_path).returncode == 0
    now = (tmp_path / "moved" / "paper-mujoco.toml").read_text(encoding="utf-8").splitlines()
    differing = [a for a, b in zip(twice.splitlines(), now, strict=True) if a != b and not a.startswith("#")]
    assert len(differing) == 2  # the lines of 30 deg in two runs
    for line, run, by in zip(lines, ("ideal, driven", "massless-link, static"), (-0.02, 0.02), strict=True):
        found = re.search(
            r"(\S.*): reaction_B_angle moved by (\S+) deg from \S+ deg at 30 deg; moved at 1 of 29 \(tolerance 0.005"
            r" deg\)",
            line,
        )
        assert found is not None, line
        assert found[1] == run
        assert float(found[2]) == pytest.approx(by, abs=1.5e-4)  # now minus baseline


@pytest.mark.slow
@pytest.mark.mujoco
def test_another_version_of_the_engine_is_said(written: str, tmp_path: Path) -> None:
    planted(re.sub(r'version = ".*"', 'version = "3.0.1"', written), tmp_path)
    done = compare("check", "--case", "paper", "--simulator", "mujoco", cwd=tmp_path)
    assert done.returncode == 0
    assert "(the baseline was made with 3.0.1): nothing moved" in done.stdout


@pytest.mark.slow
def test_the_json_and_the_junit_file_name_what_moved_and_what_has_no_answer(written: str, tmp_path: Path) -> None:
    path = planted(with_angle_moved(written, 0.02), tmp_path)
    (path.parent / "pendulum-mujoco.toml").write_text("no baseline", encoding="utf-8")
    own = tmp_path / "pendulum.toml"
    own.write_text(dumps(load("pendulum")), encoding="utf-8")
    for case, status in (("paper", 1), ("pendulum.toml", 2)):
        done = compare(
            "check", "--case", case, "--simulator", "mujoco", "--json", "--junit", f"j/{case}.xml", cwd=tmp_path
        )
        assert done.returncode == status, done.stderr
        content = json.loads(done.stdout)
        rules = json.loads((FOLDER / "baselines.json").read_text(encoding="utf-8"))
        assert [e.message for e in jsonschema.Draft202012Validator(rules).iter_errors(content)] == []
        (entry,) = content["entries"]
        root = ElementTree.parse(tmp_path / "j" / f"{case}.xml").getroot()
        counts = [root.get(name) for name in ("tests", "failures", "errors")]
        if status == 1:
            (moved_one,) = entry["moved"]
            assert (entry["status"], moved_one["signal"], moved_one["run"]) == (
                "moved",
                "reaction_B_angle",
                "contact, static",
            )
            assert moved_one["by"] == pytest.approx(-0.02, abs=1.5e-4)
            assert len(content["differences"]) == 1
            assert counts == ["32", "1", "0"]  # four joints' direction and size in each of four runs
            (failed,) = [case for case in root.iter("testcase") if case.find("failure") is not None]
            assert failed.get("name") == "paper, mujoco, contact, static: reaction_B_angle"
            assert failed.get("classname") == "paper.mujoco.contact.static"
        else:
            assert entry["status"] == "unusable"
            assert content["left_out"] == [entry["why"]]
            assert entry["why"] in done.stderr
            assert counts == ["1", "0", "1"]


@pytest.mark.slow
def test_quiet_prints_nothing(written: str, tmp_path: Path) -> None:
    planted(written, tmp_path)
    done = compare("check", "--case", "paper", "--simulator", "mujoco", "--quiet", cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


DAMAGE = {
    "cut off": lambda text: text[: len(text) // 2],
    "no TOML": lambda text: text.replace("[[run]]", "[[run", 1),
    "a row too short": lambda text: re.sub(r"(?m)^  \[ *20, ", "  [", text, count=1),
    "a size without a number": lambda text: re.sub(r"\d+\.\d+\],", "nan],", text, count=1),
    "a field misspelt": lambda text: text.replace("version", "versoin", 1),
    "no such field": lambda text: text.replace("[tolerance]", "[tolerance]\nangles = 1.0", 1),
    "another schema": lambda text: text.replace("schema = 1", "schema = 2", 1),
    "a run less": lambda text: text[: text.rindex("[[run]]")],
    "other crank angles": lambda text: re.sub(r"(?m)^  \[ *30, ", "  [31, ", text),
    "empty": lambda text: "",
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_a_damaged_file_is_refused_with_the_remedy(damage: str, tmp_path: Path) -> None:
    update(tmp_path, Planted())
    path = file_of(tmp_path, "paper", "planted")
    text = path.read_text(encoding="utf-8")
    assert DAMAGE[damage](text) != text
    path.write_text(DAMAGE[damage](text), encoding="utf-8")
    with pytest.raises(BaselineError) as caught:
        check(tmp_path, Planted())
    assert str(caught.value).startswith(f"{path}: ")
    assert "compare baseline update --case paper --simulator planted" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.mujoco
def test_a_damaged_file_is_status_2_without_a_traceback(written: str, tmp_path: Path) -> None:
    planted(written[: len(written) // 2], tmp_path)
    done = compare("check", "--case", "paper", "--simulator", "mujoco", cwd=tmp_path)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert "paper-mujoco.toml: cannot be read as TOML" in line


@pytest.mark.slow
@pytest.mark.mujoco
def test_a_missing_file_is_status_2_and_the_other_cases_are_still_checked(written: str, tmp_path: Path) -> None:
    planted(written, tmp_path)
    done = compare("check", "--simulator", "mujoco", cwd=tmp_path)
    assert done.returncode == 2
    missing = [
        line
        for line in done.stderr.splitlines()
        if "there is no such baseline; write it with: compare baseline update" in line
    ]
    assert len(missing) == len(shipped_cases()) - 1
    assert "paper, mujoco" in done.stdout


@pytest.mark.parametrize(("option", "value"), [("--case", "papre"), ("--simulator", "adams")])
def test_a_misspelt_name_is_status_2(option: str, value: str, tmp_path: Path) -> None:
    done = compare("check", option, value, cwd=tmp_path)
    assert done.returncode == 2
    assert value in done.stderr
    assert "paper" in done.stderr or "mujoco" in done.stderr


def test_a_simulator_that_is_not_installed_is_status_3(tmp_path: Path) -> None:
    with commands.without("mujoco"):
        done = compare("check", "--simulator", "mujoco", cwd=tmp_path)
    assert done.returncode == 3
    assert "pip install 'linkage-crosscheck[mujoco]'" in done.stderr


def test_a_folder_that_cannot_be_written_is_refused_before_anything_runs(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way", encoding="utf-8")
    done = compare("update", "--case", "paper", "--baselines", "file/here", cwd=tmp_path)
    assert done.returncode == 2
    assert "--baselines file/here" in done.stderr


# -------------------------------------------------------------------- what moved, all of it


@pytest.mark.parametrize("joint", ["D", "A", "B", "E"])
@pytest.mark.parametrize("degrees", [0.02, 0.01, -0.01])
def test_a_hundredth_of_a_degree_has_moved_at_any_joint(joint: str, degrees: float, tmp_path: Path) -> None:
    update(tmp_path, Planted())
    assert not check(tmp_path, Planted(turned(joint, np.radians(degrees))))


@pytest.mark.parametrize("degrees", [1e-3, 360.0])
def test_a_thousandth_of_a_degree_and_a_whole_turn_have_not(degrees: float, tmp_path: Path) -> None:
    update(tmp_path, Planted())
    assert check(tmp_path, Planted(turned("B", np.radians(degrees))))


def test_every_signal_that_moved_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    update(tmp_path, Planted())
    capsys.readouterr()
    faulty = Planted(lambda s: turned("D", np.radians(-0.01))(turned("B", np.radians(0.02))(s)))
    assert not check(tmp_path, faulty)
    head, *lines = capsys.readouterr().out.splitlines()
    assert head == "paper, planted 1: 4 of 16 signals in 4 runs moved"
    assert len(lines) == 4
    for run in ("ideal, driven", "contact, static"):
        assert any(f"{run}: reaction_B_angle moved by +0.02" in line and "29 of 29" in line for line in lines)
        assert any(f"{run}: reaction_D_angle moved by -0.01" in line for line in lines)


def test_a_force_that_grows_is_reported_in_newtons(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    update(tmp_path, Planted())
    assert not check(
        tmp_path, Planted(), PAPER.replace(loads=(PAPER.loads[0].model_copy(update={"force": (0.0, 50.05)}),))
    )
    assert re.search(r"contact, static: reaction_B_magnitude moved by \+0\.0\d+ N", capsys.readouterr().out)


def test_what_an_engine_does_not_support_is_listed_with_the_reason(tmp_path: Path) -> None:
    update(tmp_path, Planted())
    runs = read(file_of(tmp_path, "paper", "planted"), "paper", "planted", "").runs
    assert [run.name for run in runs] == [
        "ideal, driven",
        "massless-link, static",
        "spring-damper, static",
        "contact, static",
    ]
    assert runs[1].skipped == "planted does not simulate massless-link joints in static motion"
    more = Planted(supports=Planted().supports | {("massless-link", "static")})
    with pytest.raises(BaselineError, match=r"'massless-link, static' was skipped .* and now runs"):
        check(tmp_path, more)


TABLE = StoredRun(
    "contact, static",
    {},
    ("crank_angle [deg]", "reaction_B_angle [deg]", "reaction_B_magnitude [N]"),
    np.array([[0, 179.999, 5], [5, np.nan, 0.05]]),
)


def seen(k: int, j: int, value: float) -> list[str]:
    rows = TABLE.rows.copy()
    rows[k, j] = value
    return [each.sentence for each in moved(TABLE, replace(TABLE, rows=rows), MovedLimits())]


def test_directions_are_compared_modulo_a_turn() -> None:
    assert seen(0, 1, -179.999) == []
    assert "moved by +0.011 deg" in seen(0, 1, -179.99)[0]


def test_a_direction_that_is_lost_or_turns_up_has_moved_but_for_a_force_at_the_very_limit() -> None:
    assert "has a direction on one side only at 0 deg" in seen(0, 1, np.nan)[0]
    assert "has a direction on one side only at 5 deg" in seen(1, 1, 12.0)[0]
    at_limit = replace(TABLE, rows=np.array([[0, 179.999, 5], [5, np.nan, 0.0999]]))
    assert moved(at_limit, replace(at_limit, rows=np.array([[0, 179.999, 5], [5, 12.0, 0.1001]])), MovedLimits()) == []


def test_averages_have_tolerances_of_their_own() -> None:
    average = StoredRun("contact, impacting", {}, ("reaction_B_rms [N]", "free_share_B [1]"), np.array([[50.0, 0.7]]))
    assert moved(average, replace(average, rows=np.array([[55.0, 0.8]])), MovedLimits()) == []
    lines = [each.sentence for each in moved(average, replace(average, rows=np.array([[70.0, 0.1]])), MovedLimits())]
    assert lines[0].startswith("contact, impacting: reaction_B_rms moved by +20 N from 50 N over the run")
    assert lines[1].startswith("contact, impacting: free_share_B moved by -0.6 from 0.7 over the run")


# -------------------------------------------------------------------- the file


def test_a_file_reads_back_as_it_was_written() -> None:
    rows = np.array([[20.0, -135.123449, 12.34567891], [25.0, np.nan, 0.0], [30.0, -0.00001, 1.0]])
    table = StoredRun(
        "contact, static", {"clearance": {"B": 5e-4}, "load": [{"body": "crank", "torque": -2.0}]}, TABLE.columns, rows
    )
    stored = Baseline(
        'a "case"',
        "mujoco",
        "4.0.0",
        (table, StoredRun("massless-link, static", {}, skipped='no "rubber"')),
        MovedLimits(angle=0.004),
    )
    text = write(stored, "compare baseline check")
    assert tomllib.loads(text)["run"][0]["rows"][0] == [20, -135.1234, 12.3457]
    assert "-0.0000" not in text
    assert text == write(stored, "compare baseline check")


@pytest.mark.mujoco
def test_a_written_file_is_small_and_has_a_line_for_each_crank_angle(written: str) -> None:
    assert len(written) < 20_000
    assert len(re.findall(r"(?m)^  \[ *30, ", written)) == 4
    assert max(len(line) for line in written.splitlines() if line.startswith("  [")) < 120


def test_updating_what_has_not_moved_writes_nothing(tmp_path: Path) -> None:
    update(tmp_path, Planted())
    path = file_of(tmp_path, "paper", "planted")
    os.utime(path, (1, 1))
    update(tmp_path, Planted(turned("B", np.radians(0.001))))
    assert path.stat().st_mtime == 1


def test_updating_changes_the_lines_of_what_moved_and_no_others(tmp_path: Path) -> None:
    update(tmp_path, Planted())
    path = file_of(tmp_path, "paper", "planted")
    path.write_text(path.read_text(encoding="utf-8").replace("angle = 0.005", "angle = 0.004"), encoding="utf-8")
    before = path.read_text(encoding="utf-8").splitlines()
    slightly = turned("A", np.radians(0.001))

    def fault(signals: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        at_rest = "clearance_B_x" in signals and np.abs(signals["clearance_B_x"]).max() > 0
        return turned("B", np.radians(0.02))(signals) if at_rest else slightly(signals)

    update(tmp_path, Planted(fault, version="2"))
    after = path.read_text(encoding="utf-8").splitlines()
    changed = [k for k, (a, b) in enumerate(zip(before, after, strict=True)) if a != b]
    start = after.index('name = "contact, static"')
    assert [after[k] for k in changed if k < start] == ['version = "2"']
    assert len([k for k in changed if k > start]) == 29
    assert check(tmp_path, Planted(fault, version="2"))


def test_a_tolerance_of_ones_own_is_kept_when_the_runs_are_other_ones(tmp_path: Path) -> None:
    update(tmp_path, Planted())
    path = file_of(tmp_path, "paper", "planted")
    path.write_text(path.read_text(encoding="utf-8").replace("angle = 0.005", "angle = 0.004"), encoding="utf-8")
    update(tmp_path, Planted(), PAPER.with_clearances({}))
    assert read(path, "paper", "planted", "").tolerance.angle == 0.004


def test_two_names_with_one_file_are_refused_even_where_it_is_damaged(tmp_path: Path) -> None:
    one, other = PAPER.replace(name="a b"), PAPER.replace(name="a-b")
    update(tmp_path, Planted(), one)
    path = file_of(tmp_path, "a b", "planted")
    text = path.read_text(encoding="utf-8")
    for kept in (text, text[: len(text) // 2]):
        path.write_text(kept, encoding="utf-8")
        with pytest.raises(
            BaselineError,
            match=r"is the baseline of 'a b' in planted, not of 'a-b' .*; both would have this file, so rename",
        ):
            update(tmp_path, Planted(), other)
        assert path.read_text(encoding="utf-8") == kept
    update(tmp_path, Planted(), one)
    with pytest.raises(BaselineError, match="not of 'a-b'"):
        check(tmp_path, Planted(), other)
    assert check(tmp_path, Planted(), one)


@pytest.mark.parametrize("name", ['quote " and \\', "# Kurbel = \u00dcbung"])
def test_a_name_with_any_character_makes_a_file_that_reads_back(name: str, tmp_path: Path) -> None:
    mechanism = PAPER.replace(name=name)
    update(tmp_path, Planted(), mechanism)
    head = file_of(tmp_path, name, "planted").read_text(encoding="utf-8").partition("schema = 1")[0]
    assert [line[0] for line in head.splitlines()] == ["#"] * 3
    assert check(tmp_path, Planted(), mechanism)


@pytest.mark.mujoco
def test_the_command_that_is_printed_and_stored_is_one_that_works(tmp_path: Path) -> None:
    (tmp_path / "my linkage.toml").write_text(dumps(PAPER.with_clearances({}).replace(name="mine")), encoding="utf-8")
    arguments = ["--case", "my linkage.toml", "--simulator", "mujoco", "--baselines", "kept here"]
    missing = compare("check", *arguments, cwd=tmp_path)
    assert missing.returncode == 2
    again = shlex.split(missing.stderr.strip().partition("write it with: ")[2])
    assert again == ["compare", "baseline", "update", *arguments]
    done = compare(*again[2:], cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (stored,) = (tmp_path / "kept here").iterdir()
    named = next(
        line for line in stored.read_text(encoding="utf-8").splitlines() if line.startswith("# To check them: ")
    )
    assert shlex.split(named.removeprefix("# To check them: ")) == ["compare", "baseline", "check", *arguments]


def test_a_damaged_file_is_replaced_by_an_update(tmp_path: Path) -> None:
    tmp_path.joinpath("paper-planted.toml").write_text("no baseline", encoding="utf-8")
    update(tmp_path, Planted())
    assert check(tmp_path, Planted())


def test_runs_that_differ_do_not_fit() -> None:
    assert fits([TABLE], [TABLE]) == ""
    assert "it has the runs" in fits([TABLE], [])
    assert "other columns" in fits(
        [TABLE], [replace(TABLE, columns=("crank_angle [deg]", "reaction_B_angle [deg]", "reaction_E_magnitude [N]"))]
    )


def test_a_changed_clearance_has_moved_and_is_said_with_the_forces_that_did(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    update(tmp_path, Planted(), PAPER.with_clearances({"A": 1e-4, "B": 1e-4}))
    changed = PAPER.with_clearances({"A": 1e-4, "B": 2e-4})
    assert not check(tmp_path, Planted(), changed)
    said = capsys.readouterr().out
    assert "the linkage is another: joint.B.clearance 0.0001 -> 0.0002\n" in said
    assert "reaction_B_angle moved by" in said
    path = file_of(tmp_path, "paper", "planted")
    old = re.sub(r"(?s)\[linkage\].*?\n\n", "", path.read_text(encoding="utf-8"), count=1)  # as it was written before
    path.write_text(old, encoding="utf-8")
    assert not check(tmp_path, Planted(), changed)
    assert "was made with clearance B 0.1 mm, and is now made with clearance B 0.2 mm" in capsys.readouterr().out


def test_another_linkage_is_said_where_its_forces_moved_and_where_none_did(tmp_path: Path) -> None:
    update(tmp_path, Planted())
    path = file_of(tmp_path, "paper", "planted")
    stiffer = PAPER.with_body("coupler", youngs_modulus=3e11)  # which rigid bodies do not feel
    light = check_file(path, stiffer, "planted", "", lambda name: Planted())
    assert (light.status, light.moved) == ("same", ())
    assert light.changed.startswith("body.coupler.youngs_modulus ")
    assert light.changed.endswith(" -> 300000000000.0")
    moved_ = check_file(path, stiffer, "planted", "", lambda name: Planted(turned("B", np.radians(0.02))))
    assert moved_.sentences[0] == f"the linkage is another: {light.changed}"
    failures = [case.failure for case in _cases(moved_) if case.failure]
    assert failures[0] == moved_.sentences[0]
    assert len(failures) == 1 + len(moved_.moved)
    same = check_file(path, PAPER, "planted", "", lambda name: Planted(turned("B", np.radians(0.02))))
    assert same.changed == ""  # so that it is the engine, or this code


def test_what_moved_is_marked_on_the_command_s_own_file_and_a_damaged_baseline_on_itself(tmp_path: Path) -> None:
    update(tmp_path, Planted())
    path = file_of(tmp_path, "paper", "planted")
    moved_one = check_file(path, PAPER, "planted", "", lambda name: Planted(turned("B", np.radians(0.02))))
    damaged = Entry(case="paper", simulator="planted", file=str(path), status="unusable", why="torn")
    faults = [case for entry in (moved_one, damaged) for case in _cases(entry) if case.failure or case.error]
    assert {(case.kind, case.file) for case in faults} == {("moved", ""), ("unusable", str(path))}


# -------------------------------------------------------------------- what is stored


def test_every_shipped_case_has_ideal_joints_driven_and_clearance_joints_at_rest_under_load() -> None:
    for case in shipped_cases():
        runs = setups(load(case))
        assert runs[0].name == "ideal, driven"
        if not load(case).cranked:
            models = ["ideal", "massless-link", "spring-damper", "contact"]
            assert [setup.request.joint_model for setup in runs] == models
            for setup in runs:
                assert sorted(setup.request.schedule.courses) == sorted(drive.joint for drive in load(case).drives)
                assert setup.request.mechanism.clearances == setup.added.get("clearance", {})
            continue
        at_rest = [setup for setup in runs if setup.request.motion == "static"]
        assert [setup.request.joint_model for setup in at_rest] == ["massless-link", "spring-damper", "contact"]
        assert all(setup.request.mechanism.clearances == setup.added["clearance"] for setup in at_rest)
    assert setups(PAPER)[1].request.mechanism.clearances == {"B": 0.01}


def test_a_linkage_of_ones_own_has_the_clearance_that_its_file_gives() -> None:
    assert len(setups(PAPER.with_clearances({}).replace(name="mine"))) == 1
    assert len(setups(PAPER.replace(name="mine"))) == 4


def test_a_linkage_of_ones_own_that_is_called_like_a_shipped_case_is_ones_own() -> None:
    own = load("crank-rocker").with_body("coupler", mass=0.3)
    assert [setup.name for setup in setups(own)] == ["ideal, driven"]
    assert all(
        not setup.added.get("load") and not setup.impacting for setup in setups(own.with_clearances({"B": 1e-4}))
    )


@pytest.mark.parametrize("name", ENGINES)
@pytest.mark.parametrize("case", shipped_cases())
def test_every_shipped_case_has_a_baseline_in_every_engine(case: str, name: str) -> None:
    stored = read(file_of(ROOT / "reports" / "baselines", case, name), case, name, "")
    assert [run.name for run in stored.runs] == [setup.name for setup in setups(load(case))]
    for run, setup in zip(stored.runs, setups(load(case)), strict=True):
        assert bool(run.skipped) == bool(not_run(name, declared(name), setup.request))


@pytest.mark.slow
@pytest.mark.mujoco
def test_the_committed_baselines_hold_with_the_arithmetic_of_another_processor() -> None:
    """With that of this one CI checks those of every engine."""
    other = {
        "OPENBLAS_CORETYPE": "Prescott",
        "NPY_DISABLE_CPU_FEATURES": "AVX2 FMA3 AVX512F AVX512CD AVX512_SKX X86_V3 X86_V4",
    }
    done = commands.compare_alone("baseline", "check", "--simulator", "mujoco", cwd=ROOT, **other)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.slow
def test_what_is_stored_of_a_bouncing_pin_repeats_from_starts_that_differ_in_rounding() -> None:
    for setup in setups(load("crank-rocker"))[-2:]:
        starts = [replace(setup.request, lead_in=setup.request.lead_in + k * 1e-9) for k in range(3)]
        traces = [engine("mujoco").simulate(request) for request in starts]
        rms = np.array(
            [np.sqrt(np.mean(t.signals["reaction_B_x"] ** 2 + t.signals["reaction_B_y"] ** 2)) for t in traces]
        )
        free = np.array([t.free_share["B"] for t in traces])
        assert np.ptp(rms) > 1e-3  # they are different runs
        assert np.ptp(rms) < MovedLimits().rms * rms.mean()
        assert np.ptp(free) < MovedLimits().free_share
        assert 0.3 < free.mean() < 0.95

"""Every number of a result can be traced: both sides, where they come from, and clear words where there is none."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from commands import compare
from compare.cli.app import app
from compare.faults import OptionError
from compare.files import to_json
from compare.report.diagnosis_text import terminal_lines
from compare.report.provenance import explain
from compare.results.crosscheck import CrossCheck
from compare.results.diagnosis import Diagnosis
from compare.results.document import DocumentError
from sample_diagnosis import sample_diagnosis
from sample_result import sample_result, swinging


def loaded(raw: dict[str, Any]) -> CrossCheck:
    return CrossCheck.model_validate(json.loads(to_json(raw)))


PAPER = sample_result()


def shown(signal: str, at: float, raw: dict[str, Any] = PAPER, **choice: str) -> str:
    return explain(loaded(raw), signal, at, choice.get("joint"), choice.get("simulator"))


@pytest.mark.mujoco
def test_the_command_prints_both_sides_and_where_they_come_from(tmp_path: Path) -> None:
    assert (
        compare(
            "--simulator", "mujoco", "--joint", "contact", "--motion", "static", "--out", "o", cwd=tmp_path
        ).returncode
        == 0
    )
    done = compare("show", "o/result.json", "--signal", "reaction_B_angle", "--at", "30", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    run = json.loads((tmp_path / "o" / "result.json").read_text(encoding="utf-8"))["runs"][0]
    k = min(range(29), key=lambda i: abs(math.degrees(run["crank_angle"][i]) - 30))
    for side in ("analytic", "simulated"):
        said = re.search(rf"(?m)^  {side} +(\S+) deg  \((\S+) rad\)$", done.stdout)
        assert said is not None, done.stdout
        assert float(said[2]) == pytest.approx(run[side]["reaction_B_angle"][k], rel=1e-8)
        assert float(said[1]) == pytest.approx(math.degrees(run[side]["reaction_B_angle"][k]), rel=1e-6)
    for words in (
        "compare --simulator mujoco --joint contact --motion static --out o",
        "force of coupler on follower",
        "crank angle 30 deg, sample 3 of 29",
        "Eqs. 11-14, static force balance of the displaced linkage; analytic/paper/kinetostatics.py",
        "analytic/paper/clearance.py",
        f"mujoco {run['simulator']['version']}, contact joints, static",
        "sim_models/mujoco/engine.py; clearance_B = 10 mm",
        "contact_stiffness = 1e+08 N/m",
        "simulated minus analytic",
        "verdict       agrees",
    ):
        assert words in done.stdout
    assert "None" not in done.stdout


def test_every_run_that_has_the_signal_is_shown_or_the_one_that_is_asked_for() -> None:
    several = sample_result(engines=("mujoco", "exudyn"))
    assert shown("reaction_B_angle", 30, several).count("simulated minus analytic") == 8
    assert shown("reaction_B_angle", 30, several, joint="contact").count("simulated minus analytic") == 2
    one = shown("reaction_B_angle", 30, several, joint="contact", simulator="exudyn")
    assert one.count("simulated minus analytic") == 1
    assert "sim_models/exudyn/engine.py" in one


def test_the_difference_is_that_of_the_two_sides_and_the_verdict_that_of_the_result() -> None:
    wrong = sample_result(wrong="reaction_B_x")
    row = next(d for d in wrong["runs"][3]["discrepancies"] if d["signal"] == "drive_torque")
    text = shown("drive_torque", 90, wrong, joint="contact")
    k = 14
    apart = wrong["runs"][3]["simulated"]["drive_torque"][k] - wrong["runs"][3]["analytic"]["drive_torque"][k]
    assert f"difference    {apart:+.7g} N.m" in text
    assert f"worst         {row['max']:+.7g} N.m at {math.degrees(row['at_crank_angle']):.6g} deg" in text
    assert f"tolerance     {row['tolerance']:.7g} N.m there" in text
    assert f"verdict       {row['verdict']}" in text


def test_a_known_difference_shows_its_reason() -> None:
    raw = json.loads(to_json(PAPER))
    row = next(d for d in raw["runs"][3]["discrepancies"] if d["signal"] == "drive_torque")
    row |= {"verdict": "known", "reason": "measured so (bound 0.5 N.m)"}
    assert "verdict       known: measured so (bound 0.5 N.m)" in shown("drive_torque", 90, raw, joint="contact")


def test_an_angle_between_two_samples_gives_the_nearer_and_says_so() -> None:
    text = shown("reaction_B_angle", 31.9, joint="contact")
    assert "crank angle 30 deg, sample 3 of 29 (the nearest to 31.9 deg; nothing is interpolated)" in text
    assert "nearest" not in shown("reaction_B_angle", 30, joint="contact")


def test_the_difference_of_angles_is_less_whole_turns_and_says_so() -> None:
    raw = sample_result()
    for run in raw["runs"]:
        run["simulated"]["reaction_B_angle"] = [v + 2 * math.tau for v in run["simulated"]["reaction_B_angle"]]
    difference = re.compile(r"(?m)^  difference +(\S+) deg .*simulated minus analytic(.*)$")
    as_is, turned = (difference.findall(shown("reaction_B_angle", 30, each)) for each in (PAPER, raw))
    assert [float(a) for a, _ in turned] == pytest.approx([float(a) for a, _ in as_is], abs=1e-6)
    assert {words for _, words in as_is} == {""}
    assert {words for _, words in turned} == {", less whole turns"}


def test_a_crank_angle_may_be_a_turn_further() -> None:
    assert "crank angle 30 deg, sample 3" in shown("reaction_B_angle", 390, joint="contact")
    assert "crank angle 0 deg, sample 1" in shown("reaction_B_angle", 359, sample_result("crank-rocker"), joint="ideal")


@pytest.mark.parametrize("at", [17.4, 162.6, 200.0, math.nan, math.inf])
def test_an_angle_outside_the_run_is_refused(at: float) -> None:
    with pytest.raises(OptionError, match=r"--at .*: the run mujoco, contact has samples from 20 to 160 deg"):
        shown("reaction_B_angle", at, joint="contact")


def test_a_free_drive_is_asked_for_by_its_time() -> None:
    text = shown("reaction_O_angle", 1.011, swinging())
    assert "time 1.02 s, sample 52 of 101 (the nearest to 1.011 s; nothing is interpolated)" in text
    assert "analytic/beyond_paper/released.py" in text
    with pytest.raises(OptionError, match="samples from 0 to 2 s"):
        shown("reaction_O_angle", 30, swinging())


def test_a_flagged_angle_has_a_reason_and_no_number() -> None:
    raw = json.loads(to_json(PAPER))
    run = raw["runs"][3]
    run["flags"] = {"2": "the reaction at B passes near zero"}
    for side in ("analytic", "simulated"):
        run[side] = {name: [None if k == 2 else v for k, v in enumerate(values)] for name, values in run[side].items()}
    text = shown("reaction_B_angle", 30, raw, joint="contact")
    assert "flagged       no number on either side: the reaction at B passes near zero" in text
    assert "simulated     " not in text


SOURCES = {
    (
        "reaction_B_magnitude",
        "ideal",
    ): "Eqs. 9-14, inertia forces and force balance of the ideal linkage; analytic/paper/kinetostatics.py",
    (
        "reaction_B_magnitude",
        "contact",
    ): "Eqs. 9-14, inertia forces and force balance of the displaced linkage; analytic/paper/kinetostatics.py",
    ("drive_torque", "contact"): "analytic/paper/kinetostatics.py",
    ("clearance_B_x", "contact"): "Eq. 8 along the displaced linkage's own reaction; analytic/paper/clearance.py",
    ("coupler_rotation", "contact"): "the body's angle in the displaced linkage minus that in the ideal one",
    ("follower_angle", "ideal"): "loop closure of the ideal linkage; analytic/kinematics/motion.py",
    ("follower_x", "contact"): "loop closure of the displaced linkage; analytic/kinematics/motion.py",
}


@pytest.mark.parametrize(("signal", "joint"), SOURCES)
def test_the_equation_and_the_module_are_those_of_the_signal(signal: str, joint: str) -> None:
    assert SOURCES[signal, joint] in shown(signal, 30, joint=joint)


def test_the_modules_that_are_named_exist() -> None:
    root = Path(__file__).parent.parent
    text = "".join(shown(signal, 30, joint=joint) for signal, joint in SOURCES) + shown(
        "reaction_O_angle", 1.0, swinging()
    )
    modules = set(re.findall(r"(?:analytic|sim_models)/[\w/]+\.py", text))
    assert len(modules) >= 4
    assert all((root / module).is_file() for module in modules)


def test_the_papers_first_order_takes_its_reactions_without_clearance() -> None:
    raw = json.loads(to_json(PAPER))
    for run in raw["runs"]:
        run["analytic_model"] = "first_order"
    text = shown("reaction_B_angle", 30, raw, joint="contact")
    assert "force balance of the ideal linkage" in text
    assert "first order: reactions as without clearance" in text
    assert "Eq. 8: the clearance along the ideal linkage's reaction" in shown("clearance_B_x", 30, raw, joint="contact")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"signal": "reaction_Q_angle"}, ["reaction_Q_angle", "the signals are", "reaction_B_angle"]),
        ({"joint": "rubber"}, ["--joint rubber", "ideal, massless-link, spring-damper, contact"]),
        ({"simulator": "adams"}, ["--simulator adams", "mujoco"]),
    ],
)
def test_what_the_result_does_not_have_is_refused_with_what_it_has(arguments: dict[str, str], words: list[str]) -> None:
    with pytest.raises(OptionError) as caught:
        shown(**({"signal": "reaction_B_angle", "at": 30} | arguments))  # type: ignore[arg-type]
    for word in words:
        assert word in str(caught.value)


FILES = {
    "no file": (None, "there is no such file"),
    "no JSON": ("{", "cannot be read as JSON"),
    "a list": ("[]", "holds a list"),
    "another JSON": ("{}", "schema is missing"),
    "another schema": ('{"schema": 2}', "schema = 2"),
}


@pytest.mark.parametrize("fault", FILES)
def test_a_file_that_is_no_result_is_refused(fault: str, tmp_path: Path) -> None:
    text, words = FILES[fault]
    path = tmp_path / "result.json"
    if text is not None:
        path.write_text(text, encoding="utf-8")
    with pytest.raises(DocumentError) as caught:
        CrossCheck.read(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert words in str(caught.value)
    assert "give the result.json of a cross-check" in str(caught.value)


def test_bad_input_is_status_2_and_one_sentence(tmp_path: Path) -> None:
    done = compare("show", "none.json", "--signal", "drive_torque", "--at", "30", cwd=tmp_path)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert done.stdout == ""


# ------------------------------------------------------------------ a diagnosis


@pytest.fixture(scope="module")
def diagnosed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("diagnosed") / "diagnosis.json"
    path.write_text(to_json(sample_diagnosis()), encoding="utf-8")
    return path


def said(*arguments: str) -> tuple[int, str]:
    done = CliRunner().invoke(app, ["show", *arguments])
    return done.exit_code, done.output


def test_a_diagnosis_is_shown_with_its_intervals(diagnosed: Path) -> None:
    status, text = said(str(diagnosed))
    assert status == 0
    assert text.splitlines() == terminal_lines(Diagnosis.read(diagnosed))
    assert "radial clearance 0.19999 mm (95 %: 0.19971 to 0.20026 mm)" in text


def test_a_signal_of_a_diagnosis_is_its_residual_by_run(diagnosed: Path) -> None:
    status, text = said(str(diagnosed), "--signal", "follower_angle")
    assert status == 0
    head, *lines = text.splitlines()
    assert head == "follower_angle: angle of follower, measured minus simulated"
    runs = json.loads(diagnosed.read_text(encoding="utf-8"))["runs"]
    assert len(lines) == 3 * len(runs)
    for k, run in enumerate(runs):
        signal = run["signals"]["follower_angle"]
        assert lines[3 * k].startswith(f"{run['name']}: 721 samples, noise 0.1 mrad (1 sigma)")
        for side, line in zip(("before", "after"), lines[3 * k + 1 : 3 * k + 3], strict=True):
            apart = [1e3 * (m - s) for m, s in zip(signal["measured"], signal[side], strict=True)]
            found = re.fullmatch(rf"  {side} +rms (\S+) (u|m)rad, largest (\S+) (u|m)rad at (\S+) deg; gap (\S+)", line)
            assert found is not None, line
            root = math.sqrt(sum(v * v for v in apart) / len(apart))
            assert float(found[1]) * (1 if found[2] == "m" else 1e-3) == pytest.approx(root, rel=6e-3)
            assert float(found[6]) == pytest.approx(signal[f"gap_{side}"], rel=6e-3)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (
            ["--signal", "reaction_B"],
            "--signal reaction_B: no run of this diagnosis has it; the signals are crank_angle,",
        ),
        (["--signal", "drive_torque", "--at", "30"], "--at: a diagnosis takes --signal alone"),
    ],
)
def test_what_a_diagnosis_cannot_show_is_said(options: list[str], words: str, diagnosed: Path) -> None:
    status, text = said(str(diagnosed), *options)
    assert status == 2
    assert words in text.replace("\n", " ")


def test_a_file_that_is_neither_is_refused_in_a_sentence(tmp_path: Path) -> None:
    path = tmp_path / "other.json"
    path.write_text('{"schema": 1, "thresholds": []}', encoding="utf-8")
    assert said(str(path)) == (
        2,
        f"compare: {path}: has not the fields of a result.json or diagnosis.json; give one of these\n",
    )
    path.write_text(to_json(PAPER), encoding="utf-8")
    assert said(str(path)) == (
        2,
        "compare: --signal is missing; a number of a result takes --signal, such as --signal reaction_B_angle\n",
    )

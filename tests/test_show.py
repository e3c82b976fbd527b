"""Every number of a result can be traced: both sides, where they come from, and clear words where there is none."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from functools import cache
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import linkage_crosscheck as lc
from commands import compare
from compare.cli.app import app
from compare.faults import ArgumentError, OptionError
from compare.files import to_json
from compare.report.diagnosis_terminal import terminal_lines
from compare.report.provenance import lines
from compare.results.crosscheck import CrossCheck
from compare.results.diagnosis import Diagnosis
from compare.results.document import DocumentError
from compare.results.provenance import Provenance
from compare.results.residuals import SignalResiduals
from document_faults import faults
from sample_diagnosis import sample_diagnosis
from sample_result import sample_result, swinging
from sim_models.engine import GROUP, Offers


def loaded(raw: dict[str, Any]) -> CrossCheck:
    return CrossCheck.model_validate(json.loads(to_json(raw)))


@cache
def paper() -> dict[str, Any]:
    return sample_result()


def number(signal: str, at: float, raw: dict[str, Any] | None = None, **choice: str) -> Provenance:
    """A number of a result at an angle in degrees, as a person gives it, or at a time."""
    result = loaded(raw or paper())
    where = at if result.over_time else math.radians(at)
    return lc.show(result, signal, at=where, joint_model=choice.get("joint"), simulator=choice.get("simulator"))


def shown(signal: str, at: float, raw: dict[str, Any] | None = None, **choice: str) -> str:
    return "\n".join(lines(number(signal, at, raw, **choice)))


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
    document = compare("show", "o/result.json", "--signal", "reaction_B_angle", "--at", "30", "--json", cwd=tmp_path)
    assert faults(Provenance, json.loads(document.stdout)) == []
    assert "\n".join(lines(Provenance.model_validate_json(document.stdout))) + "\n" == done.stdout


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
    raw = json.loads(to_json(paper()))
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
    as_is, turned = (difference.findall(shown("reaction_B_angle", 30, each)) for each in (paper(), raw))
    assert [float(a) for a, _ in turned] == pytest.approx([float(a) for a, _ in as_is], abs=1e-6)
    assert {words for _, words in as_is} == {""}
    assert {words for _, words in turned} == {", less whole turns"}


def test_a_crank_angle_may_be_a_turn_further() -> None:
    assert "crank angle 30 deg, sample 3" in shown("reaction_B_angle", 390, joint="contact")
    assert "crank angle 0 deg, sample 1" in shown("reaction_B_angle", 359, sample_result("crank-rocker"), joint="ideal")


@pytest.mark.parametrize("at", [17.4, 162.6, 200.0, math.nan, math.inf])
def test_an_angle_outside_the_run_is_refused(at: float) -> None:
    with pytest.raises(OptionError, match=r"^at: the run mujoco, contact has samples from 20 to 160 deg, none near"):
        shown("reaction_B_angle", at, joint="contact")


def test_a_free_drive_is_asked_for_by_its_time() -> None:
    text = shown("reaction_O_angle", 1.011, swinging())
    assert "time 1.02 s, sample 52 of 101 (the nearest to 1.011 s; nothing is interpolated)" in text
    assert "analytic/beyond_paper/released.py" in text
    with pytest.raises(OptionError, match="samples from 0 to 2 s"):
        shown("reaction_O_angle", 30, swinging())


def test_a_flagged_angle_has_a_reason_and_no_analytic_number() -> None:
    text = shown("reaction_B_angle", 30, flagged(), joint="contact")
    assert "flagged       no analytic number: the reaction at B passes near zero" in text
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
    raw = json.loads(to_json(paper()))
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
        ({"joint": "rubber"}, ["joint_model: rubber", "ideal, massless-link, spring-damper, contact"]),
        ({"simulator": "adams"}, ["simulator: adams", "mujoco"]),
    ],
)
def test_what_the_result_does_not_have_is_refused_with_what_it_has(arguments: dict[str, str], words: list[str]) -> None:
    with pytest.raises(OptionError) as caught:
        shown(**({"signal": "reaction_B_angle", "at": 30} | arguments))
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
            "--signal reaction_B: no run of this diagnosis has reaction_B; the signals are crank_angle,",
        ),
        (["--signal", "drive_torque", "--at", "30"], "--at 30.0: a diagnosis takes a signal alone"),
        (["--joint", "contact"], "--joint contact: a diagnosis takes a signal alone"),
    ],
)
def test_what_a_diagnosis_cannot_show_is_said(options: list[str], words: str, diagnosed: Path) -> None:
    status, text = said(str(diagnosed), *options)
    assert status == 2
    assert words in text.replace("\n", " ")


@pytest.mark.parametrize(
    ("file", "made"),
    [
        ("accuracy.json", lambda: lc.accuracy("paper", motion="static", samples=20)),
        ("analysis.json", lambda: lc.analyse("paper", motion="static")),
        ("cases.json", lc.cases),
    ],
)
def test_another_document_is_named_with_what_show_reads(file: str, made: Any, tmp_path: Path) -> None:
    path = made().write(tmp_path) / file
    assert said(str(path)) == (
        2,
        f"compare: {path}: has the fields of {file}; what is read here is result.json or diagnosis.json: give one of"
        " these\n",
    )


def test_a_result_that_lacks_a_field_is_still_a_result(tmp_path: Path) -> None:
    fields = json.loads(to_json(paper()))
    del fields["verdict"]
    (tmp_path / "result.json").write_text(json.dumps(fields), encoding="utf-8")
    status, text = said(str(tmp_path / "result.json"))
    assert (status, "result.json: verdict is missing; add it" in text) == (2, True)


def test_a_file_that_is_neither_is_refused_in_a_sentence(tmp_path: Path) -> None:
    path = tmp_path / "other.json"
    path.write_text('{"schema": 1, "thresholds": []}', encoding="utf-8")
    assert said(str(path)) == (
        2,
        f"compare: {path}: has not the fields of a result.json or diagnosis.json; give one of these\n",
    )
    path.write_text(to_json(paper()), encoding="utf-8")
    for options, complaint in {
        (): "--signal: missing; a number of a result takes one, such as reaction_B_angle",
        ("--signal", "drive_torque"): "--at: missing; a number belongs to a crank angle, or to a time if the linkage"
        " swings",
    }.items():
        assert said(str(path), *options) == (2, f"compare: {complaint}\n")


# ------------------------------------------------------------------ as a document


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    path = tmp_path / "result.json"
    path.write_text(to_json(paper()), encoding="utf-8")
    return path


def test_the_json_of_a_number_is_as_its_schema_says_and_what_the_text_is_made_of(saved: Path) -> None:
    asked = [str(saved), "--signal", "reaction_B_angle", "--at", "31.9", "--joint", "contact"]
    status, printed = said(*asked, "--json")
    assert status == 0
    content = json.loads(printed)
    assert faults(Provenance, content) == []
    found = Provenance.model_validate(content)
    assert found.to_json() + "\n" == printed
    assert said(*asked) == (0, "\n".join(lines(found)) + "\n")
    (one,) = content["runs"]
    run = paper()["runs"][3]
    assert (one["index"], one["count"], one["exact"]) == (2, 29, False)
    assert one["crank_angle"] == run["crank_angle"][2]
    for side in ("analytic", "simulated"):
        assert one[side]["value"] == run[side]["reaction_B_angle"][2]
        assert one[side]["components"] == {f"reaction_B_{axis}": run[side][f"reaction_B_{axis}"][2] for axis in "xy"}
    assert one["difference"] == pytest.approx(one["simulated"]["value"] - one["analytic"]["value"], rel=1e-9)
    assert one["discrepancy"] == next(d for d in run["discrepancies"] if d["signal"] == "reaction_B_angle")
    assert one["simulated"]["settings"] == run["settings"]
    assert one["simulated"]["module"] == "sim_models/mujoco/engine.py"
    assert [e["module"] for e in one["analytic"]["equations"]] == [
        "analytic/paper/kinetostatics.py",
        "analytic/paper/clearance.py",
    ]
    assert (content["unit"], content["acts"]) == ("rad", "force of coupler on follower")
    assert content["at"] == pytest.approx(math.radians(31.9))


def flagged() -> dict[str, Any]:
    raw = json.loads(to_json(paper()))
    for run in raw["runs"]:
        run["flags"] = {"2": "the reaction at B passes near zero"}
        for side in ("analytic", "simulated"):
            run[side] = {n: [None if k == 2 else v for k, v in enumerate(values)] for n, values in run[side].items()}
    return raw


KINDS: dict[str, Callable[[], tuple[str, float, dict[str, Any]]]] = {
    "several engines": lambda: ("drive_torque", 90.0, sample_result(engines=("mujoco", "exudyn"))),
    "flagged": lambda: ("reaction_B_angle", 30.0, flagged()),
    "over time": lambda: ("reaction_O_angle", 1.02, swinging()),
    "a moment": lambda: ("reaction_S_moment", 30.0, sample_result("slider-crank", clearance={"A": 1e-5})),
    "not judged": lambda: ("crank_angular_velocity", 30.0, paper()),
}


@pytest.mark.long_rows("over time", "a moment")
@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_number_is_as_its_schema_says(kind: str) -> None:
    found = number(*KINDS[kind]())
    content = json.loads(found.to_json())
    assert faults(Provenance, content) == []
    assert Provenance.model_validate(content).to_json() == found.to_json()
    assert len(found.rows()) == len(found.runs) == found._repr_html_().count("<tr><td>")
    without = {name: value for name, value in content.items() if name != "unit"}
    assert any("unit" in fault for fault in faults(Provenance, without))
    half = {name: value for name, value in content["runs"][0].items() if name != "analytic"}
    assert any("analytic" in fault for fault in faults(Provenance, content | {"runs": [half]}))


def test_what_each_kind_of_number_says() -> None:
    flag = number(*KINDS["flagged"]()).runs[0]
    assert (flag.flag, flag.analytic.value, flag.difference) == ("the reaction at B passes near zero", None, None)
    over_time = number(*KINDS["over time"]())
    assert (over_time.over_time, over_time.at, over_time.runs[0].time) == (True, 1.02, pytest.approx(1.02))
    row = over_time.runs[0].discrepancy
    raw = KINDS["over time"]()[2]["runs"][0]
    assert row is not None
    assert over_time.runs[0].worst_time == raw["time"][raw["crank_angle"].index(row.at_crank_angle)]
    assert "reaction moment at S (moment of ground on slider)" in shown(*KINDS["a moment"]())
    assert number(*KINDS["not judged"]()).runs[0].discrepancy is None


def test_an_engine_of_another_package_is_no_module_of_this_one(monkeypatch: pytest.MonkeyPatch) -> None:
    raw = sample_result(engines=("multiplier",))
    (contact,) = number("drive_torque", 30, raw, joint="contact").runs
    assert contact.simulated.module is None
    assert "an engine that is not installed here; clearance_B" in shown("drive_torque", 30, raw, joint="contact")
    point = EntryPoint("multiplier", "multiplier_engine:ENGINE", GROUP)
    monkeypatch.setattr("compare.show.offers", lambda: Offers({"multiplier": point}, {}))
    (contact,) = number("drive_torque", 30, raw, joint="contact").runs
    assert contact.simulated.module == "multiplier_engine"


def test_the_json_of_a_signal_of_a_diagnosis_is_its_residuals(diagnosed: Path) -> None:
    status, printed = said(str(diagnosed), "--signal", "follower_angle", "--json")
    assert status == 0
    content = json.loads(printed)
    assert faults(SignalResiduals, content) == []
    assert faults(SignalResiduals, content | {"runs": []}) != []
    raw = json.loads(diagnosed.read_text(encoding="utf-8"))["runs"]
    assert [run["name"] for run in content["runs"]] == [run["name"] for run in raw]
    for found, run in zip(content["runs"], raw, strict=True):
        channel = run["signals"]["follower_angle"]
        for side in ("before", "after"):
            left = np.subtract(channel["measured"], channel[side])
            k = int(np.argmax(np.abs(left)))
            np.testing.assert_allclose(found[side]["values"], left, rtol=0, atol=1e-14)
            assert found[side]["rms"] == pytest.approx(math.sqrt(np.mean(left**2)), rel=1e-9)
            assert found[side]["largest"] == pytest.approx(left[k], rel=1e-9)
            assert (found[side]["crank_angle"], found[side]["time"]) == (run["crank_angle"][k], run["time"][k])
            assert found[side]["gap"] == channel[f"gap_{side}"]


def test_a_sensor_that_was_silent_has_residuals_with_holes(diagnosed: Path) -> None:
    found = lc.show(Diagnosis.read(diagnosed), "coupler_y")
    silent = [run for run in found.runs if np.isnan(run.before.values).any()]
    assert silent
    assert faults(SignalResiduals, json.loads(found.to_json())) == []
    for run in silent:
        assert run.before.rms is not None
        assert run.before.rms == pytest.approx(math.sqrt(np.nanmean(run.before.values**2)))


def test_the_json_of_a_diagnosis_is_the_diagnosis(diagnosed: Path) -> None:
    status, printed = said(str(diagnosed), "--json")
    assert status == 0
    assert json.loads(printed) == json.loads(diagnosed.read_text(encoding="utf-8"))
    assert faults(Diagnosis, json.loads(printed)) == []


def test_quiet_prints_nothing_and_keeps_the_status(saved: Path, diagnosed: Path) -> None:
    number_of = [str(saved), "--signal", "drive_torque", "--at"]
    assert said(*number_of, "30", "--quiet") == (0, "")
    assert said(str(diagnosed), "-q") == (0, "")
    assert said(str(diagnosed), "--signal", "follower_angle", "-q") == (0, "")
    assert said(*number_of, "200", "--quiet")[0] == 2


def test_python_shows_what_the_command_does(saved: Path, diagnosed: Path) -> None:
    _, printed = said(str(saved), "--signal", "drive_torque", "--at", "30", "--json")
    for given in (saved, str(saved), CrossCheck.read(saved)):
        assert lc.show(given, "drive_torque", at=math.radians(30)).to_json() + "\n" == printed
    _, printed = said(str(diagnosed), "--signal", "follower_angle", "--json")
    for given in (diagnosed, Diagnosis.read(diagnosed)):
        assert lc.show(given, "follower_angle").to_json() + "\n" == printed
    assert isinstance(lc.show(diagnosed), Diagnosis)
    with pytest.raises(ArgumentError, match=r"^signal: missing"):
        lc.show(saved)
    with pytest.raises(ArgumentError, match=r"^joint_model: a diagnosis takes a signal alone"):
        lc.show(diagnosed, joint_model="contact")

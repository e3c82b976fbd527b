"""Limits of a linkage's numbers, held against closed forms, and what a command makes of them."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import linkage_crosscheck as lc
from analytic.mechanism.file import loads
from commands import assert_refused, compare
from compare.faults import ArgumentError
from compare.report.sweep import table
from compare.results.analysis import Analysis
from test_opposing_loads import WIPER

CRANK, COUPLER, FOLLOWER, GROUND = 0.05, 0.12, 0.10, 0.12  # m, of the shipped crank-rocker


def angle(one: float, other: float, opposite: float) -> float:
    """The angle (rad) between two sides of a triangle, by the law of cosines."""
    return math.acos((one**2 + other**2 - opposite**2) / (2 * one * other))


LEAST = angle(COUPLER, FOLLOWER, GROUND - CRANK)  # transmission angle, crank along the ground
STROKE = angle(GROUND, FOLLOWER, CRANK + COUPLER) - angle(
    GROUND, FOLLOWER, COUPLER - CRANK
)  # dead centre to dead centre


@pytest.mark.parametrize(
    ("name", "holds", "broken", "value"),
    [
        ("transmission_angle", 0.9999 * LEAST, 1.0001 * LEAST, LEAST),
        ("stroke_follower", f":{1.0001 * STROKE}rad", f":{0.9999 * STROKE}rad", STROKE),
        ("stroke_follower", f"{0.9999 * STROKE}rad:", f"{1.0001 * STROKE}rad:", STROKE),
        ("stroke_follower", f"1:{1.0001 * STROKE}rad", f"{1.0001 * STROKE}:2rad", STROKE),
    ],
)
def test_a_limit_between_the_samples_is_told_to_a_ten_thousandth(
    name: str, holds: float | str, broken: float | str, value: float
) -> None:
    """The crank angles that are looked at, 7 degrees apart, meet neither the least angle nor a dead centre."""
    angles = [math.radians(3 + 7 * k) for k in range(52)]
    for given, verdict in ((holds, "holds"), (broken, "broken")):
        found = lc.analyse("crank-rocker", angles=angles, limits={name: given})
        assert (found.limits[name].verdict, found.holds) == (verdict, verdict == "holds")
        assert found.limits[name].value == pytest.approx(value, rel=2e-5)


def test_the_size_of_a_torque_counts_to_either_side_and_a_range_keeps_its_signs() -> None:
    lowest = lc.analyse("crank-rocker").extremes["drive_torque"].lowest
    assert lowest is not None
    assert lowest == pytest.approx(-0.448, abs=5e-4)
    for given, verdict in (
        ("0.4 N.m", "broken"),
        ("0.45 N.m", "holds"),
        ("-0.45:0.2N.m", "broken"),
        (":0.3N.m", "holds"),
    ):
        limit = lc.analyse("crank-rocker", limits={"drive_torque": given}).limits["drive_torque"]
        assert limit.verdict == verdict, given
    assert limit.value == pytest.approx(0.2479, abs=5e-4)  # of the range whose least is open, the highest counts


def test_a_limit_that_cannot_be_judged_throughout_does_not_hold() -> None:
    """Where a reaction passes near zero the equilibrium with clearance has no answer."""
    found = lc.analyse("crank-rocker", clearance=dict.fromkeys("DABE", 1e-4), limits={"reaction_B": 1e9})
    assert found.flags
    assert (found.limits["reaction_B"].verdict, found.holds) == ("unknown", False)
    assert found.limits["reaction_B"].missing == len(found.flags)


WORST = 1e-4 / (FOLLOWER * math.sin(LEAST))  # rad, of the follower where B's gap of 0.1 mm lies along the coupler


@pytest.mark.parametrize(("size", "verdict"), [(1.0001 * WORST, "holds"), (0.9999 * WORST, "broken")])
def test_the_error_by_clearance_has_a_limit_without_tolerances(size: float, verdict: str) -> None:
    gap, name = {"B": 1e-4}, "worst_follower_angle"
    for found in (
        lc.analyse("crank-rocker", clearance=gap, limits={name: size}),
        lc.accuracy("crank-rocker", clearance=gap, limits={name: size}, samples=2),
    ):
        assert (found.limits[name].verdict, found.holds) == (verdict, verdict == "holds")
        assert found.limits[name].value == pytest.approx(WORST, rel=1e-9)


def test_the_error_in_equilibrium_has_a_limit_too() -> None:
    limits = {"error_follower_angle": "8 deg", "worst_follower_angle": "8 deg"}
    found = lc.analyse("paper", limits=limits)
    assert [each.verdict for each in found.limits.values()] == ["holds", "broken"]
    error = found.errors["follower_angle"]
    assert found.limits["error_follower_angle"].value == pytest.approx(max(error.equilibrium, key=abs), rel=1e-12)
    again = lc.accuracy("paper", limits={"follower_angle": "8 deg", "worst_follower_angle": "8 deg"}, samples=2)
    assert [each.value for each in again.limits.values()] == [each.value for each in found.limits.values()]


def test_a_broken_limit_of_the_error_is_status_1_of_accuracy_too(tmp_path: Path) -> None:
    asked = ("accuracy", "--case", "paper", "--samples", "2", "--limit", "worst_follower_angle=8deg,follower_x=6mm")
    done = compare(*asked, "--out", "out", cwd=tmp_path)
    said = "worst_follower_angle is 8.3761 deg at 20 deg, more than its limit of 8 deg"
    assert (done.returncode, f"broken: {said}" in done.stdout) == (1, True), done.stderr
    (failure,) = ElementTree.parse(tmp_path / "out" / "junit.xml").iter("failure")
    assert failure.get("message") == said
    page = (tmp_path / "out" / "accuracy.html").read_text(encoding="utf-8")
    assert f"broken: {said.removeprefix('worst_follower_angle is ')}" in page
    swept = lc.sweep("paper", {"joint.B.clearance": "5mm,10mm"}, "accuracy", limits={"worst_follower_angle": "8 deg"})
    assert [point.numbers["broken"] for point in swept.points] == [0.0, 1.0]
    assert swept.poor == 1


@pytest.mark.parametrize("command", [("analyse", "error_follower_angle=1deg"), ("accuracy", "follower_angle=1deg")])
def test_a_limit_of_the_error_of_a_linkage_without_clearance_is_refused(
    command: tuple[str, str], tmp_path: Path
) -> None:
    name, limit = command
    done = compare(name, "--case", "crank-rocker", "--limit", limit, cwd=tmp_path)
    assert_refused(done, "no joint of crank-rocker has any; give some by --clearance")


def test_a_broken_limit_is_status_1_with_one_sentence_everywhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    asked = ("crank-rocker", "--limit", "transmission_angle=40deg,reaction_B=0.5kN", "--out", "out")
    done = compare(*asked, cwd=tmp_path)
    said = "transmission_angle is 35.659 deg at 0 deg, less than its limit of 40 deg"
    assert done.returncode == 1, done.stderr
    assert f"broken: {said}" in done.stdout
    assert "holds: reaction_B is 10.2 N at 15.45 deg, within its limit of 500 N" in done.stdout
    (mark,) = [line for line in done.stderr.splitlines() if line.startswith("::error")]
    assert mark.endswith(f"::{said}")
    (failure,) = ElementTree.parse(tmp_path / "out" / "junit.xml").iter("failure")
    assert failure.get("message") == said
    page = (tmp_path / "out" / "analysis.html").read_text(encoding="utf-8")
    assert f"broken: {said.removeprefix('transmission_angle is ')}" in page
    stored = json.loads((tmp_path / "out" / "analysis.json").read_text(encoding="utf-8"))["limits"]
    assert stored["transmission_angle"]["least"] == pytest.approx(math.radians(40))
    assert {name: each["verdict"] for name, each in stored.items()} == {
        "transmission_angle": "broken",
        "reaction_B": "holds",
    }
    kept = compare("crank-rocker", "--limit", "reaction_B=500N", "--out", "kept", "-q", cwd=tmp_path)
    assert kept.returncode == 0, kept.stderr


@pytest.mark.slow
def test_a_sweep_tells_at_which_points_a_limit_is_broken() -> None:
    """Forces of inertia grow with the square of the speed: 10.2 N at 300 rpm."""
    limits = {"reaction_B": "12 N", "transmission_angle": "30 deg"}
    swept = lc.sweep("crank-rocker", {"drive.speed": "300:400:50rpm"}, limits=limits)
    assert [point.numbers["broken"] for point in swept.points] == [0.0, 0.5, 0.5]
    assert (swept.poor, swept.holds) == (2, False)


def test_a_swept_limit_says_in_a_ci_which_one_broke_where(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Forces of inertia grow with the square of the speed; the stroke does not."""
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(tmp_path / "summary.md"))
    limits = ("--limit", "reaction_B=12N,mean_drive_torque=1N.m,stroke_follower=60:70deg")
    done = compare(
        "crank-rocker", "--set", "drive.speed=300:400:50rpm", *limits, "--workers", "1", "--out", "out", cwd=tmp_path
    )
    said = "reaction_B is 18.134 N at 15.45 deg, more than its limit of 12 N"
    assert done.returncode == 1, done.stderr
    assert f"broken at 2 of 3 points: {said}, at drive.speed = 400 rpm" in done.stdout
    assert "holds at 3 of 3 points: stroke_follower is 65.148 deg" in done.stdout
    marks = [line for line in done.stderr.splitlines() if line.startswith("::error")]
    assert marks[0] == f"::error title=crank-rocker%2C drive.speed = 400 rpm%3A reaction_B::{said}"
    assert len(marks) == 2
    suites = ElementTree.parse(tmp_path / "out" / "junit.xml").getroot()
    assert (suites.get("tests"), suites.get("failures"), suites.get("errors")) == ("9", "2", "0")
    assert {case.get("message") for case in suites.iter("failure")} > {said}
    summary = (tmp_path / "summary.md").read_text(encoding="utf-8")
    assert "2 of 9 wrong; the worst: drive.speed = 400 rpm: " in summary
    assert f"{said}, at drive.speed" in (tmp_path / "out" / "sweep.html").read_text(encoding="utf-8").replace("R", "r")


def test_a_sweep_has_a_column_of_each_number_with_a_limit() -> None:
    limits = {"rms_drive_torque": "1 N.m", "worst_follower_angle": "1 deg", "stroke_coupler": ":90 deg"}
    given = {"joint.B.clearance": ["0.1 mm"]}
    swept = lc.sweep("crank-rocker", given, limits=limits, model="first_order", workers=1)
    numbers, (point,) = swept.points[0].numbers, swept.points
    for name in limits:
        assert numbers[name] == pytest.approx(point.limits[name].value, rel=1e-12), name
    assert numbers["stroke_follower"] == pytest.approx(STROKE, rel=1e-4)
    assert numbers["transmission_angle"] == pytest.approx(LEAST, rel=1e-4)
    heads, _ = table(swept)
    assert "RMS of drive torque (N.m)" in heads


def test_a_point_without_an_answer_is_an_error_of_a_swept_limit() -> None:
    swept = lc.sweep("crank-rocker", {"body.coupler.length": [0.12, 0.5]}, limits={"reaction_B": 1e3}, workers=1)
    (suite,) = swept.judgements()
    assert [(case.name, bool(case.failure), bool(case.error)) for case in suite.cases] == [
        ("reaction_B", False, False),
        ("answer", False, True),
    ]


@pytest.mark.parametrize(
    ("limit", "why"),
    [
        ("reaction_b=5N", "did you mean reaction_B?"),
        ("max_force_B=5N", "did you mean reaction_B?"),
        ("rms_motor_torque=5N.m", "did you mean rms_drive_torque?"),
        ("mean_power=5W", "did you mean mean_drive_power?"),
        ("mean_drive_power=5W", "drive_power is a signal on request; ask for it by --signals too"),
        ("pressure_angle=5deg", "did you mean transmission_angle?"),
        ("follower_swing=5deg:", "did you mean stroke_follower?"),
        ("reaction_follower=5N", "did you mean reaction_B or reaction_E?"),
        ("follower.B_x=5mm", "did you mean error_follower.B_x?"),
        ("time_ratio=1.5:", "did you mean time_ratio_follower?"),
        ("time_ratio_follower=1.5", "may be the least or the largest; write 1.5: or :1.5"),
        ("B=5N", "B is nothing of crank-rocker that may have a limit; did you mean reaction_B?"),
        ("follower=60deg", "did you mean stroke_follower?"),
        ("follower_stroke=60deg", "did you mean stroke_follower?"),
        ("transmission=40deg", "did you mean transmission_angle?"),
        ("stroke_follower=40deg", "stroke_follower = 40deg may be the least or the largest; write 40deg: or :40deg"),
        ("stroke_follower=40:30deg", "the least comes first"),
        ("stroke_follower=:", "give least:largest"),
        ("stroke_follower=4mm:3deg", "'4mm' has unit 'mm'"),
        ("transmission_angle=40", "has no unit; write 40deg"),
        ("reaction_B=5deg", "has unit 'deg', which is of another dimension; give it in N"),
        ("reaction_B<5N", "cannot be used; give NAME=VALUE, such as reaction_B=500N"),
        ("drive_power=3W", "is a signal on request; ask for it by --signals too"),
        ("reaction_B_angle=3deg", "may have a limit"),
        ("reaction_B=5N,reaction_B=6N", "reaction_B is there twice"),
    ],
)
def test_what_is_no_limit_is_refused_with_its_remedy(limit: str, why: str, tmp_path: Path) -> None:
    assert_refused(compare("crank-rocker", "--limit", limit, cwd=tmp_path), why)
    assert not (tmp_path / "reports").exists()


def test_a_cross_check_leads_to_the_command_that_has_limits(tmp_path: Path) -> None:
    done = compare("--simulator", "mujoco", "--limit", "reaction_B=5N", cwd=tmp_path)
    assert_refused(done, "No such option: --limit", "compare LINKAGE.toml --limit")


def test_the_stroke_of_a_slide_is_two_cranks() -> None:
    crank = lc.analyse("slider-crank").mechanism.moving["crank"].length
    limit = f"{2e3 * crank - 0.01}mm:{2e3 * crank + 0.01}mm"
    found = lc.analyse("slider-crank", limits={"stroke_S": limit})
    assert found.limits["stroke_S"].value == pytest.approx(2 * crank, rel=1e-5)
    with pytest.raises(ArgumentError, match="give them by name"):
        lc.analyse("slider-crank", limits=["reaction_B"])  # type: ignore[arg-type]


def test_the_ratio_of_times_of_a_quick_return_may_have_a_limit() -> None:
    """Both dead centres have crank and coupler in line; the angles of the crank between them are of triangles."""
    slow = math.pi + angle(GROUND, COUPLER - CRANK, FOLLOWER) - angle(GROUND, CRANK + COUPLER, FOLLOWER)
    ratio = max(slow, math.tau - slow) / min(slow, math.tau - slow)
    found = lc.analyse("crank-rocker", limits={"time_ratio_follower": "1.2:1.3", "stroke_follower": "60 deg:"})
    assert found.limits["time_ratio_follower"].value == pytest.approx(ratio, rel=1e-4)
    said = [case.said for case in found.judgements()[0].cases]
    assert said[0].startswith("time_ratio_follower is 1.2")
    assert said[0].endswith(", within 1.2 to 1.3")
    assert said[1].endswith(", no less than its limit of 60 deg")


def test_the_stroke_of_a_body_that_slides_is_that_of_its_slide() -> None:
    found = lc.analyse("slider-crank", limits={"stroke_slider": "1 mm:", "stroke_S": "1 mm:"}).limits
    assert found["stroke_slider"] == found["stroke_S"]
    assert found["stroke_slider"].unit == "m"


def test_a_point_of_a_body_has_a_limit_by_its_name_in_both_commands() -> None:
    """At a pin the error is that of the other body's point there, in the worst case within B's gap."""
    gap, names = {"B": 1e-4}, ("follower.B_y", "worst_follower.B_x")
    alone = lc.accuracy("crank-rocker", clearance=gap, outputs="follower.B", samples=2).outputs
    here = lc.accuracy("crank-rocker", clearance=gap, limits=dict.fromkeys(names, "1 mm"), samples=2)
    there = lc.analyse("crank-rocker", clearance=gap, limits={"error_follower.B_y": 1e-3, "worst_follower.B_x": 1e-3})
    np.testing.assert_array_equal(here.outputs["follower.B_x"].worst_case, alone["follower.B_x"].worst_case)
    assert [each.value for each in here.limits.values()] == [each.value for each in there.limits.values()]


def test_the_place_of_a_point_that_is_no_marker_is_told_as_one(tmp_path: Path) -> None:
    remedy = "give body follower the marker = [0.1, 0.0], and it is follower_x"
    asked = compare("crank-rocker", "--signals", "follower.B_x", cwd=tmp_path)
    assert_refused(asked, f"'follower.B_x' is no signal of crank-rocker; {remedy}")
    (tmp_path / "log.csv").write_text("crank_angle [rad],follower.B_x [m]\n0.0,0.1\n0.1,0.1\n", encoding="utf-8")
    assert_refused(compare("check", "log.csv", "--case", "crank-rocker", cwd=tmp_path), remedy)


def test_the_name_of_an_analysis_is_known_to_an_accuracy() -> None:
    found = lc.accuracy("paper", limits={"error_follower_x": "1 m"}, samples=2)
    assert [*found.limits] == ["follower_x"]


def test_a_stroke_says_that_it_is_without_clearance_and_of_which_part_of_the_turn(tmp_path: Path) -> None:
    asked = ("crank-rocker", "--clearance", "B=0.1mm", "--limit", "stroke_follower=:70deg,mean_drive_torque=1N.m")
    model = ("--model", "first_order")
    whole = compare(*asked, *model, "--out", "whole", cwd=tmp_path)
    assert "stroke of follower: 65.15 deg without clearance, 201.1 deg one way" in whole.stdout
    assert "holds: stroke_follower is 65.148 deg without clearance, within its limit of 70 deg" in whole.stdout
    part = compare(*asked, *model, "--angles", "0:90:5", "--out", "part", cwd=tmp_path)
    assert "deg without clearance between 0 and 90 deg, within its limit of 70 deg" in part.stdout
    assert "N.m between 0 and 90 deg, within its limit of 1 N.m" in part.stdout
    tight = lc.analyse("crank-rocker", limits={"stroke_follower": ":70deg"})
    assert "without clearance" not in tight.judgements()[0].cases[0].said


def test_where_there_is_no_answer_says_why_there_is_no_mean_and_no_rms(tmp_path: Path) -> None:
    done = compare(
        "crank-rocker", "--clearance", "B=0.1mm", "--limit", "rms_drive_torque=1N.m", "--out", "out", cwd=tmp_path
    )
    why = re.search(r"no mean and no RMS of drive torque: (no answer from (\S+) to (\S+) deg)", done.stdout)
    assert why is not None
    assert why[1] in (tmp_path / "out" / "analysis.html").read_text(encoding="utf-8")
    result = Analysis.read(tmp_path / "out" / "analysis.json")
    first, last = map(float, why.groups()[1:])
    inside = [k for k, angle in enumerate(np.degrees(result.crank_angle)) if first + 0.1 < angle < last - 0.1]
    assert inside
    assert np.all(np.isnan(result.signals["drive_torque"][inside]))
    assert result.limits["rms_drive_torque"].verdict == "unknown"


def test_an_error_by_clearance_is_looked_for_between_the_samples() -> None:
    """Of samples 5 degrees apart, to what samples 0.1 degrees apart have: more than any of the first ones."""
    close = lc.accuracy("crank-rocker", clearance=1e-4, angles="0:359.9:0.1", samples=2).outputs["coupler_x"].worst_case
    coarse = lc.accuracy("crank-rocker", clearance=1e-4, limits={"worst_coupler_x": 1.0}, samples=2)
    value = coarse.limits["worst_coupler_x"].value
    assert value is not None
    assert value == pytest.approx(np.max(close), rel=1e-4)
    assert value > np.max(coarse.outputs["coupler_x"].worst_case)
    assert coarse.limits["worst_coupler_x"].at == pytest.approx(np.radians(357.8), abs=np.radians(0.2))


def test_an_error_that_jumps_as_pins_cross_is_no_more_than_the_worst_case() -> None:
    """A brake turns round at the rocker's ends; a parabola through both sides of the jump said 0.29 of 0.24 deg."""
    limits = {"error_rocker_angle": 1e-9, "worst_rocker_angle": 1e-9}
    for step in (1, 5):
        told = lc.analyse(loads(WIPER), angles=f"0:359:{step}", limits=limits).limits
        error, worst = told["error_rocker_angle"].value, told["worst_rocker_angle"].value
        assert error is not None
        assert worst is not None
        assert 0.95 * worst < abs(error) <= 1.01 * worst


def test_a_limit_over_few_angles_says_that_it_is_of_these_alone(tmp_path: Path) -> None:
    few = compare("crank-rocker", "--angles", "90:270:45", "--limit", "reaction_B=2200N", cwd=tmp_path)
    assert "within its limit of 2200 N, at 5 samples alone" in " ".join(few.stdout.split())
    more = compare("crank-rocker", "--limit", "reaction_B=2200N", cwd=tmp_path)
    assert "alone" not in more.stdout

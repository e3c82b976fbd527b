"""What contact did, as a report shows it: averages in a reader's units, engines held together, paths by force."""

from __future__ import annotations

import io
import json
import math
import re
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from markupsafe import Markup
from rich.console import Console

from compare.judge.statistics import compared_statistics
from compare.judge.tolerances import load_tolerances
from compare.quantities import number
from compare.report.contact_figures import bands, contact_figures
from compare.report.crosscheck_figures import figures
from compare.report.crosscheck_motion import mover
from compare.report.crosscheck_terminal import print_table
from compare.report.figure import Figure
from compare.report.junit import suites
from compare.report.provenance import lines
from compare.report.summary import summarise
from compare.report.svg import COLOURS, draw
from compare.report.words.contact import MEASURES, PEAKS, PEAKS_APART, describe
from compare.report.words.crosscheck import headline
from compare.results.contact import STATISTICS, Statistic
from compare.results.crosscheck import CrossCheck, Failure, Run
from compare.show import show
from sample_result import rattling


@pytest.fixture(scope="module")
def agreeing() -> CrossCheck:
    return rattling()


@pytest.fixture(scope="module")
def disagreeing() -> CrossCheck:
    return rattling(louder=1.5)


def in_contact(result: CrossCheck) -> list[Run]:
    return [run for run in result.runs if run.contact is not None]


def flagged(result: CrossCheck) -> list[int]:
    return [int(k) for k in in_contact(result)[0].flags]


def printed(result: CrossCheck, width: int = 80) -> str:
    out = io.StringIO()
    print_table(result, Console(file=out, width=width))
    return out.getvalue()


def figure(result: CrossCheck, name: str) -> Figure:
    return next(figure for figure in contact_figures(result) if figure.name == name)


# ------------------------------------------------------------------ statistics of a run


def test_every_statistic_is_told_in_the_unit_that_people_read_with_its_interval(
    agreeing: CrossCheck, tmp_path: Path
) -> None:
    agreeing.write(tmp_path)
    markdown = (tmp_path / "report.md").read_text(encoding="utf-8").split("## What contact did")[1]
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    section = page[page.index('<section id="contact"') :]
    run = in_contact(agreeing)[0]
    assert run.contact is not None
    statistics = run.contact.joints["B"].statistics
    units = {"free_share": ("%", 1e2), "impulse": ("N·s", 1.0), "rms_force": ("N", 1.0), "penetration": ("µm", 1e6)}
    units |= {"restitution_loss": ("mJ", 1e3), "wear": ("N·mm", 1e3), "approach_speed": ("mm/s", 1e3)}
    for name, (unit, factor) in units.items():
        measure, found = MEASURES[name], statistics[name]
        row = next(
            line for line in markdown.splitlines() if line.startswith(f"| {measure.title.split(' (')[0]} ({unit}) |")
        )
        assert measure.meaning in row
        value, low, high = (factor * v for v in (found.value, found.low, found.high))
        assert f"{number(value)} ({number(low)} to {number(high)})" in row
        assert f"{number(value)}<small>{number(low)} to {number(high)}</small>" in section
    assert "| Friction loss (mJ) | 0 | 0 |" in markdown  # rounding is read as nothing


@pytest.mark.parametrize(("force", "unit", "factor"), [(999.0, "N", 1.0), (2.4e4, "kN", 1e-3)])
def test_large_forces_are_read_in_kilonewtons(force: float, unit: str, factor: float) -> None:
    found = MEASURES["peak_force"].fitting(force, None)
    assert (found.unit, found.factor) == (unit, factor)


def test_it_says_whether_averages_have_converged_and_the_motion_repeats_itself(agreeing: CrossCheck) -> None:
    one = describe(agreeing).runs[0]
    run = in_contact(agreeing)[0]
    assert run.contact is not None
    assert run.contact.words == "averages over 24 revolutions are known to 10 %"
    assert one.repeats == "the motion repeats itself every 2 revolutions"
    assert one.sentence == f"{run.contact.words}; {one.repeats}"
    wild = run.model_copy(update={"contact": run.contact.model_copy(update={"period": None})})
    brief = run.model_copy(update={"contact": run.contact.model_copy(update={"period": None, "revolutions": 2.0})})
    of_wild, of_brief = describe(agreeing.model_copy(update={"runs": (wild, brief)})).runs
    assert of_wild.repeats == "the motion does not repeat itself"
    assert of_brief.repeats.startswith("too few revolutions to tell")
    assert run.contact.energy is not None
    energy = run.contact.energy.model_copy(update={"missing": -2.0, "turned_over": 400.0})
    known = run.model_copy(update={"contact": run.contact.model_copy(update={"energy": energy})})
    said = describe(agreeing.model_copy(update={"runs": (known,)})).runs[0].energy
    assert said == "energy is balanced to 0.5 % of what the motor turns over"


def test_the_terminal_has_a_line_for_each_run_in_ascii_and_eighty_columns(agreeing: CrossCheck) -> None:
    text = printed(agreeing)
    assert text.isascii()
    assert max(map(len, text.splitlines())) <= 80
    (row,) = [line for line in text.splitlines() if line.startswith("mujoco, contact  ") and "+-" in line]
    found = in_contact(agreeing)[0].contact
    assert found is not None
    values = found.joints["B"].statistics
    assert f"{100 * values['free_share'].value:.3g} +-" in row
    assert f"{values['peak_force'].value:.3g} +-" in row
    assert "  0 +-" in row  # a wall like a spring takes nothing


# ------------------------------------------------------------------ engines held together


def test_engines_whose_statistics_agree_pass_and_the_headline_says_so(agreeing: CrossCheck) -> None:
    summary = summarise(agreeing)
    assert {one.verdict for one in agreeing.statistics} == {"agrees"}
    assert headline(summary).endswith(f"All {len(STATISTICS)} judged statistics of contact agree between engines.")
    suite = next(s for s in suites(summary) if s.title == "contact statistics")
    assert not any(case.failure for case in suite.cases)
    assert [case.name for case in suite.cases] == list(STATISTICS)
    assert {case.place for case in suite.cases} == {("crank-rocker", "mujoco-exudyn", "contact", "B")}


def test_a_statistic_that_disagrees_is_in_the_headline_the_page_and_the_junit_file(
    disagreeing: CrossCheck, tmp_path: Path
) -> None:
    wrong = [one for one in disagreeing.statistics if one.verdict == "disagrees"]
    assert {"rms_force", "peak_force", "impulse"} <= {one.statistic for one in wrong}
    assert "free_share" not in {one.statistic for one in wrong}
    summary = summarise(disagreeing)
    assert summary.verdict == "disagrees"
    said = f"{len(wrong)} of {len(STATISTICS)} statistics of contact disagree between engines, worst "
    assert said in headline(summary)
    assert said in " ".join(printed(disagreeing).split())
    suite = next(s for s in suites(summary) if s.title == "contact statistics")
    failed = {case.name: case.failure for case in suite.cases if case.failure}
    assert set(failed) == {one.statistic for one in wrong}
    peak = next(one for one in wrong if one.statistic == "peak_force")
    a, b = (f"{value:.3g}" for value in peak.values)
    assert max(peak.values) > PEAKS_APART * min(peak.values)
    assert PEAKS in " ".join(printed(disagreeing).split())
    assert f"peak force of B: {a} and {b} N, may differ by {peak.allowed:.3g}" in failed["peak_force"]
    disagreeing.write(tmp_path)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "<details open><summary>mujoco and exudyn, contact:" in page
    assert "statistics agree" in (tmp_path / "report.md").read_text(encoding="utf-8")


def test_what_is_not_judged_is_skipped_and_its_reason_is_said_once(tmp_path: Path) -> None:
    result = rattling(turns=(24, 2))
    assert {one.verdict for one in result.statistics} == {"unjudged"}
    reason = result.statistics[0].reason
    assert reason == "there are too few revolutions for an interval"
    summary = summarise(result)
    suite = next(s for s in suites(summary) if s.title == "contact statistics")
    assert all(f"not judged: {reason}" in case.skipped and not case.failure for case in suite.cases)
    assert "No statistics of contact were judged between engines." in headline(summary)
    result.write(tmp_path)
    assert (tmp_path / "report.html").read_text(encoding="utf-8").count(f"not judged: {reason}") == 1
    assert " ".join(printed(result, 400).split()).count(f"not judged: {reason}") == 1


def test_a_failed_run_does_not_hide_a_statistic_that_disagrees(disagreeing: CrossCheck) -> None:
    failure = Failure(simulator="dart", joint_model="contact", why="dart: it fell apart")
    runs = tuple(run.model_copy(update={"verdict": "agrees"}) for run in disagreeing.runs)
    failed = disagreeing.model_copy(update={"failures": (failure,), "runs": runs})
    assert summarise(failed).verdict == "disagrees"
    assert summarise(failed.model_copy(update={"statistics": ()})).verdict == "failed"


def test_friction_that_is_an_engine_s_rounding_is_no_disagreement(agreeing: CrossCheck) -> None:
    def with_losses(run: Run, friction: float, restitution: float = 3e-3) -> Run:
        assert run.contact is not None
        joint = run.contact.joints["B"]
        known = {"friction_loss": friction, "restitution_loss": restitution}
        exact = {n: Statistic(value=v, low=v, high=v, by_revolution=np.full(9, v)) for n, v in known.items()}
        joints = {"B": joint.model_copy(update={"statistics": {**joint.statistics, **exact}})}
        return run.model_copy(update={"contact": run.contact.model_copy(update={"joints": joints})})

    one, other = in_contact(agreeing)
    for friction, verdict in ((-7e-11, "agrees"), (-7e-8, "disagrees")):
        held = compared_statistics([with_losses(one, 4e-20), with_losses(other, friction)], load_tolerances())
        assert next(row.verdict for row in held if row.statistic == "friction_loss") == verdict


def test_a_loss_below_nothing_is_read_as_nothing_known_that_well(agreeing: CrossCheck) -> None:
    """What integration or rounding leaves: a wall gives back no more than it took."""
    run = in_contact(agreeing)[0]
    assert run.contact is not None
    joint = run.contact.joints["B"]
    for low, high, missed in ((None, None, 1e-6), (-3e-6, -1e-7, 3e-6)):
        below = Statistic(value=-1e-6, low=low, high=high, by_revolution=np.full(9, -1e-6))
        joints = {"B": joint.model_copy(update={"statistics": {**joint.statistics, "restitution_loss": below}})}
        contact = run.contact.model_copy(update={"joints": joints})
        quiet = agreeing.model_copy(update={"runs": (run.model_copy(update={"contact": contact}),), "statistics": ()})
        _, (value,) = describe(quiet).tables[0].of("restitution_loss")
        assert value.value == 0.0
        assert (value.low, value.high) == pytest.approx((-1e3 * missed, 1e3 * missed), rel=1e-12)  # mJ
        assert f"{1e3 * missed:g}" in printed(quiet)
        assert "-0.001" not in printed(quiet).replace("+-0.001", "")
    compared = next(each for each in agreeing.statistics if each.statistic == "restitution_loss")
    row = describe(agreeing.model_copy(update={"statistics": (compared.model_copy(update={"values": (-1e-6, 2e-6)}),)}))
    assert row.pairs[0].rows[0].values == pytest.approx((0.0, 2e-3))


# ------------------------------------------------------------------ figures


def test_a_joint_whose_pin_strikes_has_four_figures_and_a_pressed_one_none(agreeing: CrossCheck) -> None:
    assert [f.name for f in contact_figures(agreeing)] == ["orbit_B", "contact_force_B", "regimes_B", "section_B"]
    quiet = []
    for run in agreeing.runs:
        if run.contact is not None:
            joints = {n: j.model_copy(update={"first_impact": None}) for n, j in run.contact.joints.items()}
            run = run.model_copy(update={"contact": run.contact.model_copy(update={"joints": joints})})
        quiet.append(run)
    assert contact_figures(agreeing.model_copy(update={"runs": tuple(quiet)})) == []


def test_a_path_by_force_has_each_of_its_pieces_once_in_the_colour_of_its_force(agreeing: CrossCheck) -> None:
    run = in_contact(agreeing)[0]
    assert run.contact is not None
    path = run.contact.joints["B"].orbit
    shown = [series for series in figure(agreeing, "orbit_B").series if series.role != "frame"]
    at = {
        (float(f"{1e3 * x:.7g}"), float(f"{1e3 * y:.7g}")): f
        for x, y, f in zip(path.x, path.y, path.force, strict=True)
    }
    edges, pieces = [*bands(path.force), math.inf], 0
    for series in shown:
        points = list(zip(series.x, series.y, strict=True))
        for p, q in pairwise(points):
            if None in p or None in q:
                continue
            pieces += 1
            largest = max(at[p], at[q])
            level = 0 if series.role == "free" else int(series.role.removeprefix("force-"))
            assert level == (0 if largest <= 1e-6 * path.force.max() else 1 + int(np.digitize(largest, edges)))
    assert pieces == path.x.size - 1
    assert {series.role for series in shown} <= set(COLOURS)
    assert len({series.name for series in shown}) == len(shown) > 2


def test_a_path_without_any_force_has_one_colour(agreeing: CrossCheck) -> None:
    assert bands(np.zeros(4)) == []
    assert bands(np.array([0.0, 5.0, 5.0])) == [5.0]


def test_forces_over_the_crank_angle_lie_in_their_band(agreeing: CrossCheck) -> None:
    found = figure(agreeing, "contact_force_B")
    (band,) = [series for series in found.series if series.mark == "band"]
    n = len(band.x) // 2
    assert band.x[:n] == band.x[n:][::-1]
    assert all(low <= high for high, low in zip(band.y[:n], band.y[n:][::-1], strict=True))
    assert [s.name for s in found.series if s.name.startswith("mean")] == [
        "mean, mujoco, contact",
        "mean, exudyn, contact",
    ]
    (line,) = [series for series in found.series if series.role == "analytic"]
    assert {line.y[k] for k in flagged(agreeing)} == {None}
    root = ElementTree.fromstring(draw(found))
    filled = [p for p in root.iter("{http://www.w3.org/2000/svg}path") if p.get("fill-opacity")]
    assert len(filled) == 1
    assert filled[0].get("d", "").endswith("Z")


def test_once_a_revolution_there_is_one_point_of_each_engine(agreeing: CrossCheck) -> None:
    points = [series for series in figure(agreeing, "section_B").series if series.mark == "marker"]
    assert [len(series.x) for series in points] == [24, 24]
    assert len({series.role for series in points}) == 2  # colours tell engines of one joint model apart


def test_regimes_are_shares_of_the_time_and_impacts_in_a_hundred_revolutions(agreeing: CrossCheck) -> None:
    run = in_contact(agreeing)[0]
    assert run.contact is not None
    free, struck = figure(agreeing, "regimes_B").series[:2]
    assert (free.mark, struck.mark) == ("line", "marker")
    assert max(v for v in free.y if v is not None) <= 100
    per_turn = sum(v for v in struck.y if v is not None) / 100
    assert per_turn == pytest.approx(run.contact.joints["B"].statistics["impacts"].value, rel=0.05)


def test_a_table_of_contact_stands_open_only_where_contact_was_lost(agreeing: CrossCheck) -> None:
    (table,) = describe(agreeing).tables
    assert table.lost
    html = agreeing.files()["report.html"]
    assert "always in contact" not in html
    content = json.loads(agreeing.files()["result.json"])
    for run in content["runs"]:
        for joint in (run.get("contact") or {"joints": {}})["joints"].values():
            for name in ("free_share", "impacts"):
                joint["statistics"][name] |= {"value": 0.0, "low": 0.0, "high": 0.0}
    kept = CrossCheck.model_validate(content)
    assert not describe(kept).tables[0].lost
    section = kept.files()["report.html"].split('id="contact"')[1].split("</section>")[0]
    summary = "<summary>Contact forces and load times sliding distance in B, always in contact</summary>"
    assert section.index(summary) < section.index("<table")


def test_figures_of_contact_are_files_that_the_markdown_links(agreeing: CrossCheck) -> None:
    files = agreeing.files()
    assert {"orbit_B.svg", "contact_force_B.svg", "regimes_B.svg", "section_B.svg"} <= set(files)
    assert set(re.findall(r"\]\(([^)]+\.svg)\)", files["report.md"])) == {n for n in files if n.endswith(".svg")}


# ------------------------------------------------------------------ flagged angles keep what was simulated


def test_a_flagged_angle_shows_its_simulated_value_and_no_difference(agreeing: CrossCheck) -> None:
    summary, k = summarise(agreeing), flagged(agreeing)[3]
    runs = [run for run in mover(summary, summary.runs[0], Markup()).runs.values() if run.flags]
    assert runs
    for run in runs:
        simulated = next(side.poses for side in run.sides if side.which == "simulated")
        assert simulated is not None
        assert simulated["coupler"]["x"][k] is not None
        for reading in run.readout:
            analytic, simulated_value, difference = (values[k] for values in reading.values)
            assert simulated_value is not None
            assert analytic is difference is None
    shown = {f.name: f for f in figures(summary)}
    marks = [s for s in shown["gamma_B"].series if s.mark == "marker"]
    assert all(s.y[k] is not None for s in marks)
    loose = [s for s in shown["difference_reaction_B_angle"].series if s.name and s.role != "ideal"]
    assert {s.y[k] for s in loose} == {None}
    row = [row for row in agreeing.rows() if row["joint_model"] == "contact"][k]
    assert row["analytic_reaction_B_angle"] is None
    assert row["simulated_reaction_B_angle"] is not None


def test_the_direction_of_a_flagged_angle_lies_in_the_turn_of_its_neighbours(agreeing: CrossCheck) -> None:
    runs = []
    for run in agreeing.runs:
        gamma = np.array(run.simulated["reaction_B_angle"])
        gamma[flagged(agreeing)[2] :] += 2 * math.tau  # it went around while the pin flew
        runs.append(run.model_copy(update={"simulated": {**run.simulated, "reaction_B_angle": gamma}}))
    result = agreeing.model_copy(update={"runs": tuple(runs)})
    gamma_of = next(f for f in figures(summarise(result)) if f.name == "gamma_B")
    for series in (s for s in gamma_of.series if s.mark == "marker"):
        assert max(abs(np.diff(np.array(series.y, float)))) < 180


def test_one_number_at_a_flagged_angle_is_the_simulated_one(agreeing: CrossCheck) -> None:
    at = float(agreeing.runs[0].crank_angle[flagged(agreeing)[0]])
    text = "\n".join(lines(show(agreeing, "reaction_B_magnitude", at=at, joint_model="contact")))
    assert "flagged       no analytic number: the reaction at B turns too fast" in text
    value = in_contact(agreeing)[0].simulated["reaction_B_magnitude"][flagged(agreeing)[0]]
    assert f"simulated     {value:.7g} N" in text
    assert "difference" not in text

"""The report over one result: files, numbers, and what names and missing values may not do to them."""

from __future__ import annotations

import copy
import io
import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from rich.console import Console

import linkage_crosscheck as lc
from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import kinematics
from analytic.mechanism.file import dumps, load, loads
from analytic.mechanism.signals import same_turn
from analytic.writing import OutputError
from compare.crosscheck import crosscheck
from compare.files import escape_markdown
from compare.quantities import number, quantities
from compare.report.crosscheck_figures import beside, figures, thinned
from compare.report.crosscheck_terminal import print_table
from compare.report.figure import Axis, Figure, Series
from compare.report.linkage import exaggeration, linkage_figure, parts
from compare.report.pages import script_json
from compare.report.summary import summarise
from compare.report.svg import LEFT, RIGHT, WIDTH, draw, exponent, ticks
from compare.report.tables import print_rows
from compare.report.words.crosscheck import headline
from compare.results.crosscheck import CrossCheck
from compare.results.document import DocumentError
from marks import slow
from sample_result import as_document, sample_result, swinging, write_report

WRONG = "reaction_B_angle"
SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module")
def disagreeing() -> dict[str, Any]:
    return sample_result(wrong=WRONG)


@pytest.fixture(scope="module")
def report(disagreeing: dict[str, Any], tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("report")
    write_report(disagreeing, out)
    return out


# ------------------------------------------------------------------ files


def test_it_writes_the_page_the_markdown_the_junit_file_and_the_figures(
    disagreeing: dict[str, Any], tmp_path: Path
) -> None:
    files = write_report(disagreeing, tmp_path)
    assert {f.name for f in files} == {f.name for f in tmp_path.iterdir()}
    named = {
        "report.html",
        "report.md",
        "junit.xml",
        "linkage.svg",
        "gamma_B.svg",
        "journal_B.svg",
        f"difference_{WRONG}.svg",
    }
    assert named <= {f.name for f in files}


def test_a_result_that_cannot_be_shown_leaves_no_file(disagreeing: dict[str, Any], tmp_path: Path) -> None:
    broken = copy.deepcopy(disagreeing)
    broken["runs"][-1]["discrepancies"][0]["signal"] = "reaction_nowhere_x"
    with pytest.raises(KeyError, match="reaction_nowhere_x"):
        write_report(broken, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_made_is_named(disagreeing: dict[str, Any], tmp_path: Path) -> None:
    (tmp_path / "a-file").touch()
    with pytest.raises(OutputError, match="a-file"):
        write_report(disagreeing, tmp_path / "a-file" / "nowhere")


def test_arrays_and_nan_are_written_like_the_json_of_them(
    disagreeing: dict[str, Any], report: Path, tmp_path: Path
) -> None:
    raw = copy.deepcopy(disagreeing)
    for run in raw["runs"]:
        run["crank_angle"] = np.array(run["crank_angle"])
        run["simulated"] = {
            name: np.array([math.nan if v is None else v for v in values]) for name, values in run["simulated"].items()
        }
    write_report(raw, tmp_path)
    assert (tmp_path / "report.html").read_bytes() == (report / "report.html").read_bytes()


@pytest.mark.slow
def test_the_page_of_two_engines_stays_below_6_megabytes(tmp_path: Path) -> None:
    write_report(sample_result("crank-rocker", {"B": 2e-4, "E": 1e-4}, ("mujoco", "exudyn")), tmp_path)
    assert (tmp_path / "report.html").stat().st_size < 6e6


# ------------------------------------------------------------------ numbers


def test_the_markdown_table_shows_degrees_and_millimetres(disagreeing: dict[str, Any], report: Path) -> None:
    contact = (
        (report / "report.md")
        .read_text(encoding="utf-8")
        .split("### mujoco, contact")[1]
        .split("\n### ")[0]
        .split("\n## ")[0]
    )
    rows = {d["signal"]: d for d in disagreeing["runs"][-1]["discrepancies"]}
    cells = {
        line.split("|")[1].strip(): [c.strip() for c in line.split("|")[2:-1]]
        for line in contact.splitlines()
        if line.startswith("| Displacement")
    }
    shift = rows["clearance_B_x"]
    where = f"{math.degrees(shift['at_crank_angle']):.4g} deg"
    numbers = [number(1e3 * shift["max"], 3, True), where, number(1e3 * shift["rms"]), number(1e3 * shift["tolerance"])]
    assert cells["Displacement x in B"] == ["mm", *numbers, "✓ agrees"]
    angle = next(line for line in contact.splitlines() if line.startswith("| Reaction angle") and "at B" in line)
    assert number(math.degrees(rows[WRONG]["max"]), 3, True) in angle
    assert "✗ disagrees" in angle


def test_the_markdown_links_only_figures_that_were_written(report: Path) -> None:
    linked = re.findall(r"\]\(([^)]+)\)", (report / "report.md").read_text(encoding="utf-8"))
    assert set(linked) == {f.name for f in report.glob("*.svg")}


def test_the_headline_names_the_worst_signal_or_the_closest(disagreeing: dict[str, Any]) -> None:
    bad, good = summarise(as_document(disagreeing)), summarise(as_document(sample_result()))
    assert headline(bad).startswith("1 of ")
    assert "Worst: reaction angle at B (mujoco, contact)" in headline(bad)
    assert headline(good).startswith("All ")
    closest = max((row for run in good.runs for row in run.rows), key=lambda row: row.share or 0.0)
    assert closest.quantity.label in headline(good)
    assert headline(replace(bad, runs=bad.runs[:1])).startswith("All ")


def test_the_signal_that_a_headline_names_as_the_closest_is_in_the_table() -> None:
    good = summarise(as_document(sample_result()))
    run, shown = good.runs[-1], [quantity.signal for quantity in good.keys()]
    hidden = next(row for row in run.rows if row.verdict == "agrees" and row.quantity.signal not in shown)
    near = replace(hidden, maximum=0.999 * (hidden.tolerance or 0.0))
    rows = tuple(near if row is hidden else row for row in run.rows)
    near_one = replace(good, runs=(*good.runs[:-1], replace(run, rows=rows)))
    assert f"Closest to it: {hidden.quantity.label}" in headline(near_one)
    assert hidden.quantity.signal in [quantity.signal for quantity in near_one.keys()]


def test_junit_fails_what_disagrees_with_its_numbers_and_passes_what_is_known(
    disagreeing: dict[str, Any], tmp_path: Path
) -> None:
    result = copy.deepcopy(disagreeing)
    known = next(d for d in result["runs"][-1]["discrepancies"] if d["signal"] == "drive_torque")
    known |= {"verdict": "known", "reason": "friction is regularised"}
    write_report(result, tmp_path)
    root = ElementTree.parse(tmp_path / "junit.xml").getroot()
    rows = [d for run in result["runs"] for d in run["discrepancies"]]
    assert (root.get("tests"), root.get("failures")) == (str(len(rows)), "1")
    assert [len(suite) for suite in root] == [len(run["discrepancies"]) for run in result["runs"]]
    (failed,) = [case for case in root.iter("testcase") if case.find("failure") is not None]
    assert failed.get("classname") == "paper.mujoco.contact.driven"
    assert failed.get("name") == f"paper, mujoco, contact, driven: {WRONG}"
    failure = failed.find("failure")
    assert failure is not None
    wrong = next(d for d in rows if d["verdict"] == "disagrees")
    assert f"{math.degrees(wrong['max']):+.4g} deg at {math.degrees(wrong['at_crank_angle']):.4g} deg" in str(
        failure.get("message")
    )
    said = [
        case.findtext("system-out", "")
        for case in root.iter("testcase")
        if str(case.get("name")).endswith(": drive_torque")
    ]
    assert said[-1].startswith("known difference: drive torque: ")
    assert said[-1].endswith("friction is regularised")


def test_the_terminal_table_is_ascii_fits_eighty_columns_and_says_the_verdict(disagreeing: dict[str, Any]) -> None:
    out = io.StringIO()
    print_table(as_document(disagreeing), Console(file=out, width=80))
    lines = out.getvalue().splitlines()
    assert out.getvalue().isascii()
    assert max(map(len, lines)) <= 80
    assert [line.split()[-1] for line in lines if line.startswith("  reaction angle at B")] == ["agrees"] * 3 + [
        "DISAGREES"
    ]
    assert "paper: DISAGREES." in out.getvalue()


@pytest.mark.parametrize(("terminal", "blocks"), [(True, 2), (False, 1)])
def test_no_number_is_cut_in_a_narrow_terminal_and_what_is_none_has_room(terminal: bool, blocks: int) -> None:
    out = io.StringIO()
    console = Console(file=out, width=40, force_terminal=terminal, no_color=True, color_system=None)
    row = ("crank_x", "mm", "-0.644 to +0.104", "125 deg", "77.26 % in 0.5")
    print_rows(console, ("output", "unit", "95 %", "at", "good"), [row], left=("output", "unit"))
    lines = out.getvalue().splitlines()
    assert len(lines) == 2 * blocks  # each with its heads, behind the name and the unit
    assert all(line.startswith(("output", "crank_x  mm")) for line in lines)
    assert max(map(len, lines)) <= 40 or not terminal
    assert all(cell in out.getvalue() for cell in row)


def test_both_analytic_models_differences_are_reported(disagreeing: dict[str, Any], report: Path) -> None:
    text = (report / "report.md").read_text(encoding="utf-8").split("## Limits of the analytic model")[1]
    order = disagreeing["runs"][-1]["order_difference"][WRONG]
    assert math.isclose(math.degrees(order["max"]), -7.1, abs_tol=0.05)  # deg, at eps = 0.01 m
    assert number(math.degrees(order["max"]), 3, True) in text


def test_a_number_is_written_for_people() -> None:
    assert [number(v) for v in (0.0, 12.3456, -1.5e-7, None)] == [
        "0",
        "12.3",
        "\N{MINUS SIGN}1.5\N{MULTIPLICATION SIGN}10⁻⁷",
        "\N{EN DASH}",
    ]


# ------------------------------------------------------------------ what is missing or odd


def test_flagged_angles_break_the_curves_and_say_why(tmp_path: Path) -> None:
    result = sample_result()
    for run in result["runs"]:
        run["flags"] = {"4": "change | point", "5": "change | point"}
        for side in ("analytic", "simulated"):
            for values in run[side].values():
                values[4] = values[5] = None
    summary = summarise(as_document(result))
    gamma = next(f for f in figures(summary) if f.name == "gamma_B")
    line = next(s for s in gamma.series if s.name == "analytic, equilibrium")
    assert line.y[4] is None
    path = max(
        (p.get("d", "") for p in ElementTree.fromstring(draw(gamma)).iter(f"{SVG}path") if "L" in p.get("d", "")),
        key=len,
    )
    assert path.count("M") == 2  # two pieces, a gap between
    write_report(result, tmp_path)
    assert r"at 40 deg, 45 deg: change \| point" in (tmp_path / "report.md").read_text(encoding="utf-8")


def test_flagged_angles_of_one_reason_are_one_sentence_with_their_ranges(tmp_path: Path) -> None:
    result = sample_result()
    for run in result["runs"]:
        run["flags"] = {str(i): "no answer" if i != 9 else "change point" for i in (0, *range(2, 14), 16)}
    first = summarise(as_document(result)).runs[0]
    assert first.flagged == (
        ("20 deg; 30 to 60 deg, every 5 deg; 70 to 85 deg, every 5 deg; 100 deg", "no answer"),
        ("65 deg", "change point"),
    )
    write_report(result, tmp_path)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    item = f"<li>at {first.flagged[0][0]}: no answer</li><li>at 65 deg: change point</li>"
    assert page.count(item) == len(result["runs"])
    assert page.count(": no answer</li>") == len(result["runs"])
    text = (tmp_path / "report.md").read_text(encoding="utf-8")
    assert text.count(f": at {first.flagged[0][0]}: no answer") == len(result["runs"])


def test_unequal_steps_are_no_range() -> None:
    result = sample_result()
    for run in result["runs"]:
        run["crank_angle"][3] += 0.01
        run["flags"] = {str(i): "no answer" for i in range(6)}
    assert summarise(as_document(result)).runs[0].flagged == (
        ("20 to 30 deg, every 5 deg; 35.57 deg; 40 deg; 45 deg", "no answer"),
    )


def test_a_free_drive_is_shown_over_time(tmp_path: Path) -> None:
    result = swinging()
    summary = summarise(as_document(result))
    assert all(row.at.endswith(" s") for row in summary.runs[0].rows if row.maximum)
    assert {f.x.title for f in figures(summary)} == {"time (s)"}
    assert exaggeration(as_document(result).mechanism, as_document(result).runs[0]) == 1
    write_report(result, tmp_path)
    text = (tmp_path / "report.md").read_text(encoding="utf-8")
    assert "pendulum" in text
    assert "motion: swings freely" in text


def test_a_signal_with_nothing_to_compare_is_a_dash_and_not_a_zero(tmp_path: Path) -> None:
    result = sample_result()
    result["runs"][0]["discrepancies"][0] |= {"max": None, "rms": None, "at_crank_angle": None}
    write_report(result, tmp_path)
    assert "| \N{EN DASH} | - | \N{EN DASH} |" in (tmp_path / "report.md").read_text(encoding="utf-8")


def test_the_page_says_which_body_pushes_which_and_how_angles_count(tmp_path: Path) -> None:
    write_report(sample_result("paper"), tmp_path)
    for name in ("report.html", "report.md"):
        text = (tmp_path / name).read_text(encoding="utf-8")
        assert "B of coupler on follower" in text
        assert "counter-clockwise from the ground" in text


@pytest.mark.parametrize(
    "nasty",
    [
        "</script><script>alert(1)</script>",
        "a|b`c*[x](y)\n# d",
        *slow("<!--", "\x00\x1b[31m", "[red]x[/]", "../../x", "{{ 7*7 }}"),
    ],
)
def test_names_from_files_are_only_ever_text(nasty: str, tmp_path: Path) -> None:
    result = sample_result(engines=("mujoco", "exudyn"))
    result |= {"case": nasty, "warnings": [nasty], "command": f"compare {nasty}", "words": nasty}
    result["mechanism"]["name"] = nasty if nasty.isprintable() else "printable"
    result["versions"][nasty] = nasty
    run = result["runs"][0]
    run |= {"flags": {"0": nasty}, "settings": {nasty: nasty}, "simulator": {"name": nasty, "version": nasty}}
    run["discrepancies"][0] |= {"verdict": "known", "reason": nasty}
    run["because"] = {"assumption": "unknown", "joint": None, "words": nasty}
    files = write_report(result, tmp_path)
    assert all(f.parent == tmp_path for f in files)
    for file in files:
        if file.suffix in (".svg", ".xml"):
            ElementTree.parse(file)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert page.count("<script") == page.count("</script>") == 2
    markdown = (tmp_path / "report.md").read_text(encoding="utf-8")
    tables = [line for line in markdown.splitlines() if line.startswith("| Reaction")]
    assert {len(re.findall(r"(?<!\\)\|", line)) for line in tables} <= {6, 8}
    print_table(as_document(result), Console(file=io.StringIO(), width=80))


def test_the_papers_own_figure_stands_on_the_page_of_its_case(tmp_path: Path) -> None:
    """Section 4 prints the pin's displacement at 30 deg as 0.0087, 0.0050 m."""
    result = crosscheck("paper", joint_model="ideal", angles=np.radians([30.0, 60.0]))
    assert [(p.signal, p.printed) for p in result.printed] == [("clearance_B_x", 0.0087), ("clearance_B_y", 0.0050)]
    assert [p.first_order for p in result.printed] == pytest.approx([0.0087, 0.0050], abs=5e-5)
    result.write(tmp_path)
    for name in ("report.html", "report.md"):
        text = (tmp_path / name).read_text(encoding="utf-8")
        row = text[text.index("What the paper prints of this case") :]
        assert re.search(r"30 deg.*8\.7.*8\.66.*8\.22", row.replace("\n", " "))
    other = crosscheck("crank-rocker", joint_model="ideal", angles=np.radians([30.0]))
    assert other.printed == ()


def test_names_that_no_mechanism_may_have_are_refused_when_a_result_is_read(tmp_path: Path) -> None:
    text = json.dumps(sample_result()).replace("coupler", "<!--")
    (tmp_path / "result.json").write_text(text, encoding="utf-8")
    with pytest.raises(DocumentError, match="a name is made of letters, digits"):
        CrossCheck.read(tmp_path / "result.json")


def test_the_page_asks_for_nothing_outside_itself(report: Path) -> None:
    page = (report / "report.html").read_text(encoding="utf-8")
    outside = [
        url
        for url in re.findall(r"""(?:src|href|url)\s*[=(]\s*["']?([^"')\s>]+)""", page)
        if not url.startswith(("#", "data:", "`data:", "URL.createObjectURL"))  # the last two are made in the page
    ]
    assert outside == []
    assert "default-src 'none'" in page


def test_the_drawings_in_the_page_do_not_clip_each_other(report: Path) -> None:
    clips = re.findall(r'<clipPath id="([^"]+)"', (report / "report.html").read_text(encoding="utf-8"))
    assert len(clips) == len(set(clips)) == len(list(report.glob("*.svg")))


def test_json_in_a_script_cannot_end_it_and_reads_back() -> None:
    value = {"a": "</script><!-- & \u2028"}
    text = str(script_json(value))
    assert not set("<>&\u2028") & set(text)
    assert json.loads(text) == value


def test_markdown_is_escaped() -> None:
    assert escape_markdown("a|b_c\n<i>") == r"a\|b\_c \<i\>"


def test_a_signal_is_looked_up_and_not_parsed() -> None:
    text = dumps(load("paper")).replace("coupler", "reaction_x").replace('"B"', '"x_y"').replace("B = ", "x_y = ")
    named = quantities(loads(text))
    assert named["reaction_x_x"].label == "position x of reaction_x"
    assert named["reaction_x_y_x"].label == "reaction x at x_y"
    assert named["reaction_x_y_y"].label == "reaction y at x_y"


# ------------------------------------------------------------------ figures


def test_the_drawn_gap_is_the_clearance_times_the_factor_that_the_title_gives(disagreeing: dict[str, Any]) -> None:
    figure = linkage_figure(as_document(disagreeing))
    assert figure is not None
    factor = exaggeration(as_document(disagreeing).mechanism, as_document(disagreeing).runs[1])
    assert factor > 1
    assert f"gaps drawn {factor} times as large" in figure.title
    assert "30 deg" in figure.title
    links = next(s for s in figure.series if s.name.startswith("displaced"))
    points = [None if x is None or y is None else complex(x, y) for x, y in zip(links.x, links.y, strict=True)]
    coupler_b, follower_b = points[4], points[7]  # crank D A, coupler A B, follower E B
    assert coupler_b is not None
    assert follower_b is not None
    assert math.isclose(
        abs(coupler_b - follower_b), 10.0 * factor, rel_tol=0.02
    )  # mm; rotations are drawn to first order
    assert math.isclose(abs(points[1] - points[0]), 200.0, rel_tol=1e-6)


def test_every_figure_is_an_svg_with_its_data_in_a_text_alternative(report: Path) -> None:
    for file in report.glob("*.svg"):
        root = ElementTree.parse(file).getroot()
        assert root.get("role") == "img"
        assert len(str(root.get("aria-label"))) > 40
        width, height = (float(v) for v in str(root.get("viewBox")).split()[2:])
        for text in root.iter(f"{SVG}text"):
            assert 0 <= float(text.get("x", "-1")) <= width
            assert 0 <= float(text.get("y", "-1")) <= height


def test_a_joints_name_stays_within_the_axes_and_clear_of_another_one() -> None:
    joints = Series("", (0.0, 0.5, 30.0), (0.1, 0.0, 0.1), "frame", "joint", labels=("crankpin", "motor", "spindle"))
    edge = Series("", (-1.0, 31.0), (-1.0, 1.0), "frame")
    root = ElementTree.fromstring(draw(Figure("f", "t", "s", Axis("x", ""), Axis("y", ""), (edge, joints))))
    said = {t.text: (float(t.get("x", "nan")), float(t.get("y", "nan"))) for t in root.iter(f"{SVG}text")}
    for name in ("crankpin", "motor", "spindle"):
        assert LEFT < said[name][0] < WIDTH - RIGHT - 8.6 * len(name)
    assert abs(said["motor"][1] - said["crankpin"][1]) >= 13 or abs(said["motor"][0] - said["crankpin"][0]) > 8.6 * 8


@pytest.mark.parametrize("name", ["reactions", "drive_torque", "vector_F"])
def test_what_a_peak_is_covers_no_curve_of_a_drawing(name: str) -> None:
    root = ElementTree.fromstring(lc.analyse("six-bar").files()[f"{name}.svg"])
    (area,) = (g for g in root.iter(f"{SVG}g") if g.get("clip-path"))
    ends = [re.findall(r"([\d.]+) ([\d.]+)", path.get("d", "")) for path in area if path.get("stroke-width") != "1.6"]
    curves = np.array([[float(v) for v in end] for path in ends for end in path])
    peaks = [t for t in root.iter(f"{SVG}text") if " at " in str(t.text)]
    assert peaks
    for text in peaks:
        x, y, wide = float(text.get("x", "")), float(text.get("y", "")), 6.2 * len(str(text.text))
        inside = (curves > (x, y - 11)) & (curves < (x + wide, y + 3))
        assert not inside.all(axis=1).any(), text.text


def test_a_curve_is_drawn_where_its_axes_say() -> None:
    figure = Figure("f", "t", "s", Axis("x", ""), Axis("y", ""), (Series("line", (0.0, 10.0), (0.0, 4.0), "contact"),))
    root = ElementTree.fromstring(draw(figure))
    (area,) = (g for g in root if g.get("clip-path"))
    line = area[0].get("d", "")
    (x0, y0), (x1, y1) = (tuple(map(float, pair.split())) for pair in re.findall(r"[ML]([\d.]+ [\d.]+)", line))
    labels = {
        t.text: (float(t.get("x", "nan")), float(t.get("y", "nan")))
        for t in root.iter(f"{SVG}text")
        if t.get("text-anchor") != "start"
    }
    assert labels["10"][0] == pytest.approx(x1, abs=0.2)
    assert labels["4"][1] - 4 == pytest.approx(y1, abs=0.2)
    assert x1 > x0
    assert y1 < y0


def test_the_same_difference_is_drawn_that_is_judged(disagreeing: dict[str, Any]) -> None:
    figure = next(f for f in figures(summarise(as_document(disagreeing))) if f.name == f"difference_{WRONG}")
    contact = next(s for s in figure.series if s.role == "contact")
    worst = max((v for v in contact.y if v is not None), key=abs)
    judged = next(d for d in disagreeing["runs"][-1]["discrepancies"] if d["signal"] == WRONG)
    assert worst == pytest.approx(math.degrees(judged["max"]), rel=1e-6)


def test_directions_are_drawn_in_the_same_turn_piece_by_piece() -> None:
    assert beside((-205.0, -210.0, None, -545.0), (155.0, 150.0, 160.0, 170.0)) == (155.0, 150.0, None, 175.0)
    assert beside((1.0, 2.0), ()) == (1.0, 2.0)


def test_marks_lie_in_the_turn_of_the_line_at_every_sample() -> None:
    turned = same_turn(np.radians([-205.0, 150.0 + 720.0, np.nan, 10.0]), np.radians([155.0, 150.0, 160.0, np.nan]))
    np.testing.assert_allclose(np.degrees(turned), [155.0, 150.0, np.nan, 10.0])
    result = sample_result()
    for run in result["runs"]:
        gamma = run["simulated"]["reaction_B_angle"]
        run["simulated"]["reaction_B_angle"] = [v - 2 * math.tau * (i > 9) for i, v in enumerate(gamma)]
    line, *marks = next(f for f in figures(summarise(as_document(result))) if f.name == "gamma_B").series
    loose = next(s for s in (line, *marks) if s.name == "analytic, equilibrium")
    contact = next(s for s in marks if s.role == "contact")
    assert contact.y == pytest.approx(loose.y, abs=1.0)


def test_thinning_a_path_keeps_its_shape() -> None:
    angle = np.linspace(0.0, math.tau, 20_001)
    x, y = 1e-3 * np.cos(angle), 1e-3 * np.sin(angle)
    x[7000] = y[7000] = 0.0  # one free flight
    thin_x, thin_y = thinned(x, y, 2e-3)
    assert len(thin_x) < 3500
    assert (0.0, 0.0) in set(zip(thin_x, thin_y, strict=True))
    steps = np.hypot(np.diff(thin_x), np.diff(thin_y))
    assert np.sort(steps)[-3] < 1e-5


@pytest.mark.parametrize(
    ("low", "high", "degrees", "expected"),
    [(20, 160, True, 30), (0, 355, True, 60), (-1e-7, 2e-7, False, 5e-8), (3, 9, False, 1)],
)
def test_ticks_are_round_and_inside(low: float, high: float, degrees: bool, expected: float) -> None:
    found = ticks(low, high, 6, degrees)
    assert np.allclose(np.diff(found), expected)
    assert low <= found[0] <= low + expected
    assert high - expected <= found[-1] <= high


def test_small_axes_name_their_power_of_ten() -> None:
    assert [exponent(v) for v in (0.0, 5.0, 2e-4, 9e-7, 3e6)] == [0, 0, -6, -9, 6]


@pytest.mark.parametrize("case", ["slider-crank", "paper"])
def test_every_joint_has_its_name_in_the_drawing(case: str) -> None:
    result = sample_result(case)
    figure = linkage_figure(as_document(result))
    assert figure is not None
    assert sorted(name for series in figure.series for name in series.labels) == sorted(
        j["name"] for j in result["mechanism"]["joint"]
    )


def test_a_body_is_drawn_from_its_marker_where_its_position_is_measured() -> None:
    """Its pins stay where its neighbours have theirs."""
    m = load("paper")
    marked = m.with_body("coupler", com=(0.25, 0.0), marker=(0.2, 0.0))
    for each in (m, marked):
        (coupler,) = (body for body in parts(each)["bodies"] if body["name"] == "coupler")
        motion = kinematics(Assembly(each), np.array([0.5]))
        at, turn = complex(motion.position("coupler")[0]), np.exp(1j * motion.angle("coupler")[0])
        for joint in ("A", "B"):
            assert at + turn * complex(*coupler["points"][joint]) == pytest.approx(
                complex(motion.position("coupler", joint)[0]), abs=1e-12
            )

"""The page of ``compare accuracy``: who contributes what to an output's error, held to closed forms."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import linkage_crosscheck as lc
from analytic.mechanism.file import dumps, load, loads
from commands import compare
from compare.report.accuracy_page import figures, output_rows
from compare.report.peaks import LEAST_PART, error_peaks
from compare.results.accuracy import Accuracy
from test_linkage_page import ARM, GRAVITY, NEEDS_CHROMIUM, TURN
from test_report_browser import Browser, browser, no_errors

FIXTURES = (browser, no_errors)
GAP = 1e-4  # m


@pytest.fixture(scope="module")
def four() -> Accuracy:
    """The paper's linkage with the same clearance in all its pins."""
    return lc.accuracy("paper", clearance=dict.fromkeys("DABE", GAP), samples=200)


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory, four: Accuracy) -> Path:
    out = tmp_path_factory.mktemp("accuracy")
    four.write(out)
    return out / "accuracy.html"


def data(html: str) -> dict[str, Any]:
    """What the page's script reads."""
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', html)
    assert found is not None
    return dict(json.loads(found[1]))


def test_an_arm_is_thrown_out_by_its_pins_clearance_wherever_it_turns_to() -> None:
    """Without weight the reaction is the centripetal force: the arm moves outwards by the gap."""
    result = lc.accuracy(loads(ARM.replace(f"{-GRAVITY}", "0.0")), clearance={"D": GAP}, angles=TURN, samples=10)
    for axis, way in (("x", np.cos), ("y", np.sin)):
        output = result.outputs[f"arm_{axis}"]
        np.testing.assert_allclose(output.by_joint["D"], GAP * way(TURN), atol=1e-9 * GAP)
        np.testing.assert_allclose(output.equilibrium, GAP * way(TURN), atol=1e-6 * GAP)
        np.testing.assert_allclose(output.worst_case, GAP, rtol=1e-9)
    (figure,) = (figure for figure in figures(result) if figure.name == "error_arm_x")
    labels = [label for series in figure.series for label in series.labels]
    assert labels == ["0.1 at 0°"]  # mm; the worst case is the same at every angle, and has no peak
    moved = data(result.files()["accuracy.html"])["motion"]["runs"][0]
    place = np.hypot(moved["sides"][0]["poses"]["arm"]["x"], moved["sides"][0]["poses"]["arm"]["y"])
    np.testing.assert_allclose(place - np.hypot(moved["ideal"]["arm"]["x"], moved["ideal"]["arm"]["y"]), GAP, rtol=1e-3)


def test_parts_by_joint_are_those_of_each_joint_alone_and_add_up(four: Accuracy) -> None:
    alone = lc.accuracy("paper", clearance={"E": GAP}, samples=10).outputs
    for name, output in four.outputs.items():
        whole = sum(output.by_joint.values())
        np.testing.assert_allclose(whole, output.nominal, rtol=1e-9, atol=1e-15, err_msg=name)
        np.testing.assert_allclose(output.by_joint["E"], alone[name].nominal, rtol=1e-9, atol=1e-15, err_msg=name)
        assert set(output.by_joint) == set("DABE")


def test_the_page_says_who_has_which_part_of_the_worst_case(four: Accuracy) -> None:
    """The coupler's x: it goes along with D and A, and does not answer to the pins of the parallel follower."""
    html = four.files()["accuracy.html"]
    row = re.search(
        r'<th scope="row">coupler_x</th><td[^>]*>mm</td><td[^>]*class="parts">([^<]*)</td>',
        html.split('id="budget"')[1],
    )
    assert row is not None
    assert sorted(row[1].split(", ")) == ["A 0.1 (50 %)", "D 0.1 (50 %)"]
    errors = html.split('id="errors"')[1].split("</section>")[0]
    told = re.search(r'<th scope="row">coupler_x</th><td[^>]*>mm</td><td[^>]*class="number">([^<]*)</td>', errors)
    assert told is not None
    output = four.outputs["coupler_x"].equilibrium
    assert float(told[1].replace("\N{MINUS SIGN}", "-")) == pytest.approx(
        1e3 * output[np.nanargmax(np.abs(output))], rel=5e-3
    )
    assert "10⁻¹" not in errors  # rounding is nobody's part
    assert not re.search(r"\b(?:nan|inf|None)\b", html.split("<footer>")[0])


def test_what_is_zero_or_hardly_anything_is_not_listed(four: Accuracy) -> None:
    """The crank's angle is the drive's; the coupler stays parallel, so that B and E do less than 1 in 200 to it."""
    assert "crank_angle" not in {row[0] for row in output_rows(four)}
    for row in output_rows(four):
        assert any(cell != "-" for cell in row[2:])
    for peak in error_peaks(four):
        assert all(abs(part) > LEAST_PART * peak.worst for _, part in peak.parts)
    html = four.files()["accuracy.html"]
    assert "Worst case ±, first order" in html
    assert not re.search(r"\(0 %\)", html)


def test_an_output_is_sensitive_to_a_joint_that_has_clearance() -> None:
    """The paper's own 10 mm are in B; D answers more per millimetre, but has none."""
    found = lc.accuracy("paper", samples=2)
    assert {row[0]: row[-1].split()[0] for row in output_rows(found)} == {
        "crank_x": "-",
        "crank_y": "-",
        "coupler_x": "-",
        **dict.fromkeys(("coupler_y", "coupler_angle", "follower_x", "follower_y", "follower_angle"), "B"),
    }
    answers = {joint: values.max() for joint, values in found.outputs["coupler_y"].sensitivity.items()}
    assert answers["D"] > answers["B"]


def test_a_platform_without_clearance_shows_what_it_has() -> None:
    result = lc.platform_accuracy("3-rrr", times=np.linspace(0.0, 0.2, 5))
    html = result.files()["accuracy.html"]
    maps = data(html)["maps"]
    assert maps[0]["title"].endswith("all together, to either side")
    assert all(any(map(abs, (v for v in each["values"] if v is not None))) for each in maps)
    heads = re.findall(r'<th scope="col"[^>]*>([^<]*)</th>', html.split('id="largest"')[1])
    assert heads == ["Output", "Unit", "Compliance", "Together"]
    table = html.split('id="largest"')[1].split("</table>")[0]
    assert "crank1_angle" not in table
    assert ">-<" not in table


def test_one_output_alone_moves_the_linkage_without_its_gaps() -> None:
    result = lc.accuracy("six-bar", clearance={"C": GAP}, outputs="rocker.angle", samples=10)
    moved = data(result.files()["accuracy.html"])["motion"]["runs"][0]
    assert moved["clearance"] == {}  # nobody asked where the other bodies are
    assert [read["label"] for read in moved["readout"]] == ["rocker_angle"]


def test_its_drawings_can_be_read_and_the_page_comes_back_from_the_numbers(four: Accuracy) -> None:
    files = four.files()
    assert set(files) == {"accuracy.json", "accuracy.html", "accuracy.csv"}  # which stand beside any other result's
    drawings = re.findall(r'<noscript id="drawing-\d+">(.*?)</noscript>', files["accuracy.html"], re.DOTALL)
    assert len(drawings) == len(figures(four)) > 8
    for drawing in drawings:
        ElementTree.fromstring(drawing.strip())
    again = Accuracy.model_validate_json(files["accuracy.json"])
    assert again.files() == files


def test_without_clearance_the_page_has_what_links_yield() -> None:
    html = lc.accuracy("paper", clearance=0.0, motion="static").files()["accuracy.html"]
    assert 'id="errors"' not in html
    assert "Error of coupler_y" in html


def test_the_command_says_where_its_page_is(tmp_path: Path) -> None:
    done = compare(
        "accuracy", "--case", "crank-rocker", "--clearance", "B=1e-4", "--samples", "50", "--out", "o", cwd=tmp_path
    )
    assert done.stdout.splitlines()[-1] == "page: o/accuracy.html"
    assert (tmp_path / "o" / "accuracy.html").is_file()


def test_hostile_names_are_text() -> None:
    hostile = loads(dumps(load("crank-rocker")).replace('name = "crank-rocker"', 'name = "</script><b>x"'))
    assert "</script><b>" not in lc.accuracy(hostile, clearance={"B": GAP}, samples=10).files()["accuracy.html"]


@pytest.mark.slow
@NEEDS_CHROMIUM
def test_it_plays_and_its_peaks_are_labelled(browser: Browser, page: Path, four: Accuracy) -> None:
    browser.open(page)
    place = "document.querySelector('#mover svg.chart').getAttribute('aria-label')"
    before = browser.run(place)
    browser.run("document.querySelector('[data-play]').click()")
    browser.run("new Promise((done) => setTimeout(done, 700))")
    browser.run("document.querySelector('[data-play]').click()")
    assert browser.run(place) != before
    at = [figure.name for figure in figures(four)].index("error_coupler_angle")
    labels = browser.run(f"[...document.querySelectorAll('#plot-{at} .peak')].map(t => t.textContent)")
    error = np.degrees(four.outputs["coupler_angle"].equilibrium)
    assert any(text.startswith(f"equilibrium {error[np.argmax(np.abs(error))]:.4g} at ") for text in labels)
    assert any(text.startswith("worst case ") for text in labels)
    assert browser.run(
        "[...document.querySelectorAll('#figures figure')]"
        ".every(f => f.querySelectorAll('[data-download]').length === 3)"
    )


@pytest.mark.slow
@NEEDS_CHROMIUM
@pytest.mark.parametrize(("width", "scheme"), [(420, "light"), (420, "dark"), (1400, "light")])
def test_the_page_fits_every_screen_and_asks_for_nothing(browser: Browser, page: Path, width: int, scheme: str) -> None:
    browser.open(page, width, 900, scheme)
    assert browser.run("document.documentElement.scrollWidth") <= width
    assert [url for url in browser.requests if not url.startswith("data:")] == [page.as_uri()]

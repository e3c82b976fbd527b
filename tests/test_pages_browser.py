"""What every page keeps to, on a phone and on a screen: no column is cut, names and peaks can be read, controls and
circles stand in line.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import linkage_crosscheck as lc
from commands import compare
from compare.report.diagnosis_page import diagnosis_html
from sample_diagnosis import as_document, sample_diagnosis
from sample_result import sample_result, write_report
from test_linkage_page import NEEDS_CHROMIUM
from test_plan import folder
from test_report_browser import FOUR, Browser, browser, no_errors

FIXTURES = (browser, no_errors, folder)  # a browser for the module, a clean console, a plan
GAP = 5e-5  # m
RIG = Path(__file__).parents[1] / "docs" / "example-rig" / "measured.toml"
TURN = np.radians(np.arange(0.0, 360.0, 5.0))

pytestmark = [pytest.mark.slow, NEEDS_CHROMIUM]


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory, folder: Path) -> dict[str, Path]:
    """A page of each kind."""
    out = tmp_path_factory.mktemp("pages")
    write_report(sample_result(engines=FOUR), out / "crosscheck")
    shaper = out / "shaper.toml"
    assert compare("new", "shaper", "--kind", "quick-return", cwd=out).returncode == 0
    speeds, gaps = np.linspace(10.0, 30.0, 3), [1e-4, 2e-4]
    texts = {
        "analysis": lc.analyse("six-bar", clearance=GAP, angles=TURN).files()["analysis.html"],
        "shaper": lc.analyse(shaper, angles=TURN).files()["analysis.html"],
        "accuracy": lc.accuracy("six-bar", clearance=GAP, samples=20).files()["accuracy.html"],
        "platform": lc.platform_accuracy("3-rrr", times=np.linspace(0.0, 0.2, 5)).files()["accuracy.html"],
        "sweep": lc.sweep("paper", {"drive.speed": speeds, "joint.B.clearance": gaps}).files()["sweep.html"],
        "data": lc.preview(RIG).files()["data.html"],
        "plan": (folder / "out" / "plan.html").read_text(encoding="utf-8"),
        "diagnosis": diagnosis_html(as_document(sample_diagnosis())),
    }
    for name, text in texts.items():
        (out / f"{name}.html").write_text(text, encoding="utf-8")
    return {name: out / f"{name}.html" for name in texts} | {"crosscheck": out / "crosscheck" / "report.html"}


WHOLE = """[...document.querySelectorAll('details:not(.needs-script)')].forEach((d) => d.open = true)"""
CUT = """[...document.querySelectorAll('.scroll')].filter((e) => e.scrollWidth > e.clientWidth + 1)
  .map((e) => [e.getAttribute('aria-label'), e.scrollWidth, e.clientWidth])"""
UNSAID = """[...document.querySelectorAll('.stacks tbody td')].filter((e) => e.getBoundingClientRect().width > 0
  && !getComputedStyle(e, '::before').content.includes(e.dataset.label) && e.dataset.label !== 'Unit').length"""


@pytest.mark.parametrize("width", [420, 1400])
def test_no_column_of_a_table_is_cut(browser: Browser, pages: dict[str, Path], width: int) -> None:
    """Where a row stands in several lines, each number says what its column is."""
    for name, page in pages.items():
        browser.open(page, width, ready="true")
        browser.run(WHOLE)
        assert browser.run(CUT) == [], name
        assert browser.run("document.documentElement.scrollWidth") <= width, name
        if width == 420:
            assert browser.run(UNSAID) == 0, name
    browser.open(pages["crosscheck"], 420)
    row = "[...document.querySelectorAll('#differences tr.panels')[0].cells].map(c => c.getBoundingClientRect().top)"
    tops = browser.run(row)
    assert tops == sorted(set(tops))  # an engine under the other
    said = "getComputedStyle(document.querySelector('#differences tr.panels td:last-child'), '::before').content"
    assert browser.run(said).strip('"') == f"{FOUR[-1]} "


PAINTED = """[...document.querySelectorAll('svg rect, svg')].filter((e) => e.getBoundingClientRect().width > 100)
  .map((e) => [e.getAttribute('fill'), getComputedStyle(e).fill]).filter(([own]) => own === '#fff').length"""


def test_no_figure_of_a_page_is_white_in_the_dark(browser: Browser, pages: dict[str, Path]) -> None:
    for name, page in pages.items():
        browser.open(page, scheme="dark", ready="true")
        assert browser.run(PAINTED) == 0, name


LABELS = """[...document.querySelectorAll('svg.chart')].map((s) => {
  const from = s.getBoundingClientRect(), all = (which) => [...s.querySelectorAll(which)];
  const box = (e) => {
    const b = e.getBoundingClientRect();
    return [b.left - from.left, b.right - from.left, b.top - from.top + 2, b.bottom - from.top - 1];
  };
  const {x, y, width, height} = s.querySelector('clipPath rect').getBBox();
  const along = all('.series.line path, .series.dashed path').flatMap((p) =>
    Array.from({length: Math.ceil(p.getTotalLength() / 3)}, (_, k) => p.getPointAtLength(3 * k)));
  const marks = all('.series.marker path').flatMap((p) =>
    [...p.getAttribute('d').matchAll(/M([-.0-9]+) ([-.0-9]+)/g)].map(([, u, v]) => ({x: Number(u), y: Number(v)})));
  const under = (b, points) => points.filter((q) => q.x > b[0] && q.x < b[1] && q.y > b[2] && q.y < b[3]).length;
  return all('.CLASS').map((t) => {
    const b = box(t), inside = b[0] >= x - 1 && b[1] <= x + width + 1 && b[2] >= y - 2 && b[3] <= y + height + 2;
    return {text: t.textContent, box: b, inside, crossed: under(b, along), marked: under(b, marks)};
  });
}).filter((labels) => labels.length)"""


def _apart(labels: list[dict[str, Any]]) -> bool:
    """Whether no label lies on another."""
    boxes = [label["box"] for label in labels]
    return not any(
        min(a[1], b[1]) - max(a[0], b[0]) > 1 and min(a[3], b[3]) - max(a[2], b[2]) > 1
        for k, a in enumerate(boxes)
        for b in boxes[:k]
    )


@pytest.mark.parametrize("width", [420, 1400])
def test_peaks_stand_in_their_figures_beside_curves_and_markers(
    browser: Browser, pages: dict[str, Path], width: int
) -> None:
    for name in ("analysis", "accuracy", "shaper"):
        browser.open(pages[name], width)
        charts = browser.run(LABELS.replace("CLASS", "peak"))
        labels = [label for chart in charts for label in chart]
        assert len(labels) > 8
        assert [label["text"] for label in labels if not label["inside"] or label["marked"]] == [], name
        assert all(map(_apart, charts)), name
        crossed = [label["text"] for label in labels if label["crossed"]]
        assert len(crossed) <= (0.06 if width == 1400 else 0.2) * len(labels), crossed


GO = "(v) => { const s = document.querySelector('[data-slider]'); s.value = v; s.dispatchEvent(new Event('input')); }"


@pytest.mark.parametrize("width", [420, 1400])
def test_joints_at_one_place_are_named_one_beside_the_other(
    browser: Browser, pages: dict[str, Path], width: int
) -> None:
    """The shaper's G is on A, and its S on C, wherever it goes."""
    browser.open(pages["shaper"], width)
    names = browser.run("data.motion.parts.joints.length")
    for sample in range(0, TURN.size, 7):
        browser.run(f"({GO})({sample})")
        (labels,) = browser.run(LABELS.replace("svg.chart", "#mover svg.chart").replace("CLASS", "label"))
        assert len(labels) == names
        assert all(label["inside"] for label in labels), sample
        assert _apart(labels), sample


def test_a_drawing_has_the_room_that_links_and_arrows_need(browser: Browser, pages: dict[str, Path]) -> None:
    browser.open(pages["shaper"], 1400)
    area, drawn = browser.run(
        """['clipPath rect', '.series'].map((which) => {
        const all = [...document.querySelectorAll(`#mover svg.chart ${which}`)].map((e) => e.getBBox());
        return Math.max(...all.map((b) => b.y + b.height)) - Math.min(...all.map((b) => b.y)); })"""
    )
    assert 0.8 * area < drawn <= area + 16


def test_a_plans_figure_is_dark_in_the_dark_and_its_words_are_as_large_as_elsewhere(
    browser: Browser, pages: dict[str, Path]
) -> None:
    browser.open(pages["plan"], 420, scheme="dark")
    white = """[...document.querySelectorAll('#growth *')].filter((e) => e.getBoundingClientRect().width > 1
      && e.tagName !== 'text' && ['backgroundColor', 'fill'].some((p) =>
      getComputedStyle(e)[p] === 'rgb(255, 255, 255)')).length"""
    assert browser.run(white) == 0
    fill, height = browser.run(
        "(t => [getComputedStyle(t).fill, t.getBoundingClientRect().height])"
        "(document.querySelector('#growth svg.chart text'))"
    )
    assert min(map(int, fill[4:-1].split(","))) > 128
    assert height > 11


def test_what_stands_beside_the_linkage_is_whole_and_in_line(browser: Browser, pages: dict[str, Path]) -> None:
    """The signals, the circles of seven gaps, and the controls."""
    for name in ("analysis", "shaper", "crosscheck"):
        browser.open(pages[name], 1400)
        assert browser.run("(e => e.scrollHeight - e.clientHeight)(document.querySelector('.stage .scroll'))") <= 1, (
            name
        )
        middles = browser.run(
            """[...document.querySelectorAll('.controls :is(button, select, input)')].map((e) => {
            const b = e.getBoundingClientRect(); return (b.top + b.bottom) / 2; })"""
        )
        assert max(middles) - min(middles) < 1.0, name
        player, slider = browser.run(
            "['.player', '[data-slider]'].map((w) => document.querySelector(w).getBoundingClientRect())"
            ".map((b) => [b.left, b.right])"
        )
        assert player[1] <= slider[0]
    for width in (420, 1000, 1400):
        browser.open(pages["analysis"], width)
        tops = browser.run("[...document.querySelectorAll('.rim')].map((e) => e.getBoundingClientRect().top)")
        rows = [tops.count(top) for top in sorted(set(tops))]
        assert sum(rows) == 7
        assert rows[-1] > math.floor(7 / len(rows)) - 1, width

"""The page of a diagnosis in a real browser: what can be read, opened and copied, on every screen, and that nothing
runs that should not.
"""

from __future__ import annotations

import copy
import tomllib
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from compare.report.diagnosis_page import diagnosis_html
from sample_diagnosis import as_document, partly_explained, sample_diagnosis, swinging_diagnosis
from test_diagnosis_report import NASTY, hostile
from test_report_browser import CHROMIUM, Browser, browser, no_errors

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium: apt-get install chromium"),
]
FIXTURES = (browser, no_errors)  # theirs and ours: a browser for the module, and a console that every test leaves clean
CELLS = ".map tr[data-strip] td.cells svg"


def written(result: dict[str, Any], folder: Path) -> Path:
    page = folder / "diagnosis.html"
    page.write_text(diagnosis_html(as_document(result)), encoding="utf-8")
    return page


@pytest.fixture(scope="module")
def explained() -> dict[str, Any]:
    return sample_diagnosis()


@pytest.fixture(scope="module")
def page(explained: dict[str, Any], tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(explained, tmp_path_factory.mktemp("explained"))


@pytest.fixture(scope="module")
def tied(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(sample_diagnosis(runs=2), tmp_path_factory.mktemp("tied"))


def box(browser: Browser, selector: str) -> tuple[float, float, float, float]:
    """Left, top, width and height of an element, scrolled into view."""
    browser.run(f"document.querySelector({selector!r}).scrollIntoView({{block: 'center'}})")
    left, top, width, height = browser.run(
        f"(b => [b.left, b.top, b.width, b.height])(document.querySelector({selector!r}).getBoundingClientRect())"
    )
    return left, top, width, height


def test_three_runs_of_ten_signals_are_a_small_page_that_asks_for_nothing_else(browser: Browser, page: Path) -> None:
    browser.open(page)
    assert page.stat().st_size < 3e6  # opens in half a second
    assert [url for url in browser.requests if not url.startswith("data:")] == [page.as_uri()]
    assert browser.run(f"document.querySelectorAll({CELLS!r}).length") == 60


def test_the_map_is_read_with_the_pointer(browser: Browser, page: Path) -> None:
    browser.open(page)
    row = "document.querySelectorAll('.map tr[data-strip]')[2]"
    browser.run(f"{row}.scrollIntoView({{block: 'center'}})")
    left, top, width, height = browser.run(
        f"(b => [b.left, b.top, b.width, b.height])({row}.querySelector('svg').getBoundingClientRect())"
    )
    browser.mouse("mouseMoved", left + 0.5 * width, top + 0.5 * height)
    said = browser.run("document.querySelector('.map .tip').innerText")
    assert said.startswith("follower angle, slow-forward")
    assert "crank angle 180 to 185 deg" in said
    cell = browser.run("data.maps[0].strips[2].before[36]")
    assert f"before {cell:.3g}".replace("-", "\N{MINUS SIGN}") in said
    assert cell < -10


def test_the_map_is_read_with_the_keyboard(browser: Browser, page: Path) -> None:
    browser.open(page)
    browser.run("document.querySelector('.map').focus()")
    browser.press("ArrowRight")
    browser.press("ArrowRight")
    said = browser.run("document.querySelector('.map [aria-live]').textContent")
    assert "crank angle, slow-forward" in said
    assert "5 to 10 deg" in said


def test_a_strip_says_its_worst_cell_without_being_seen(browser: Browser, page: Path) -> None:
    browser.open(page)
    labels = browser.run(f"[...document.querySelectorAll({CELLS!r})].map(s => s.getAttribute('aria-label'))")
    assert labels[0] == "crank angle, before: within the noise"
    assert labels[4].startswith("follower angle, before: largest \N{MINUS SIGN}3")
    assert all(label.endswith("after: within the noise") for label in labels[1::2])


def test_a_name_in_the_map_opens_the_run_and_shows_the_curve(browser: Browser, page: Path) -> None:
    browser.open(page)
    assert browser.run("[...document.querySelectorAll('details.run')].map(d => d.open)") == [False, False, True]
    browser.run("document.querySelector('.map a').click()")
    browser.run("new Promise((done) => setTimeout(done, 100))")
    assert browser.run("document.querySelector('details.run').open") is True
    assert browser.run("document.querySelectorAll('#plot-0 svg.chart .series path').length") == 4


def test_a_curve_is_read_zoomed_and_reset_over_its_band_and_held_out_blocks(browser: Browser, page: Path) -> None:
    browser.open(page)
    chart = "#plot-22 svg.chart"  # follower angle of the open run
    left, top, width, height = box(browser, chart)
    assert browser.run(f"document.querySelectorAll('{chart} .held').length") == 4
    assert browser.run(f"document.querySelectorAll('{chart} .band').length") == 1
    browser.mouse("mouseMoved", left + 0.5 * width, top + 0.5 * height)
    said = browser.run("document.querySelector('#plot-22 .tip').innerText")
    assert said.startswith("crank angle")
    assert "before" in said
    assert "after" in said
    labels = f"[...document.querySelectorAll('{chart} > text')].map(t => t.textContent).join()"
    whole = browser.run(labels)
    browser.run("document.querySelector('#plot-22 .tools button').click()")
    assert browser.run(labels) != whole
    browser.run("document.querySelector('#plot-22 .tools button:last-child').click()")
    assert browser.run(labels) == whole
    browser.run(f"document.querySelector('{chart}').focus()")
    browser.press("End")
    assert browser.run("document.querySelector('#plot-22 [aria-live]').textContent").startswith(
        "crank angle 740 deg: before"
    )


def test_the_data_open_as_a_table_of_every_sample(browser: Browser, page: Path, explained: dict[str, Any]) -> None:
    browser.open(page)
    browser.run("document.querySelector('#panel-25 summary').click()")
    browser.run("new Promise((done) => setTimeout(done, 100))")
    rows = browser.run(
        "[...document.querySelectorAll('#panel-25 tbody tr')].map(r => [...r.children].map(c => c.textContent))"
    )
    assert len(rows) == 721
    measured = explained["runs"][2]["signals"]["coupler_y"]["measured"]
    assert measured[100] is None
    assert rows[100][1:4] == ["\N{EN DASH}"] * 3
    assert float(rows[50][1].replace("\N{MINUS SIGN}", "-")) == pytest.approx(1e3 * measured[50], rel=1e-6)
    assert [row[4] == "yes" for row in rows] == [held == 1 for held in explained["runs"][2]["held_out"]]


def test_a_long_run_is_drawn_thin_with_its_peaks_and_tabulated_whole(browser: Browser, tmp_path: Path) -> None:
    result = swinging_diagnosis()
    run = result["runs"][0]
    count = 50 * len(run["time"])
    run |= {"time": np.linspace(0.0, 2.0, count), "crank_angle": np.repeat(run["crank_angle"], 50), "held_out": None}
    for signal in run["signals"].values():
        signal |= {key: np.repeat(signal[key], 50) for key in ("measured", "before", "after")}
    run["signals"]["pendulum_angle"]["measured"][10_011] += 3.0  # rad, one sample
    page = written(result, tmp_path)
    browser.open(page)
    path = browser.run("document.querySelector('#plot-0 .frame .series path').getAttribute('d')")
    points = [tuple(map(float, point.split())) for point in path[1:].replace("M", "L").split("L")]
    assert 500 < len(points) < 5000
    down = [y for _, y in points]  # px from the top
    assert sum(y < 0.5 * (min(down) + max(down)) for y in down) == 1  # the peak
    assert browser.run("data.panels[0].before.length") == count


def test_the_separating_run_can_be_copied(browser: Browser, tied: Path) -> None:
    browser.open(tied)
    assert browser.run("document.querySelectorAll('header .card').length") == 2
    browser.run("document.querySelector('header .copy button').click()")
    browser.run("new Promise((done) => setTimeout(done, 100))")
    assert browser.run("document.querySelector('header .copy button').textContent") in ("Copied", "Selected")
    selected = browser.run("getSelection().toString()")
    assert tomllib.loads(selected)["run"][0]["drive_speed"] == 3.0


@pytest.mark.parametrize(("width", "scheme"), [(390, "light"), (390, "dark"), (1280, "dark")])
def test_no_screen_makes_the_page_scroll_sideways(
    browser: Browser, page: Path, tied: Path, width: int, scheme: str
) -> None:
    for each in (page, tied):
        browser.open(each, width, 800, scheme)
        browser.run("document.querySelectorAll('section > details').forEach(d => d.open = true)")
        assert browser.run("document.documentElement.scrollWidth") <= width
        assert browser.run(f"document.querySelector({CELLS!r}).getBoundingClientRect().width") > 90
    dark = browser.run("getComputedStyle(document.body).backgroundColor") == "rgb(20, 23, 27)"
    assert dark == (scheme == "dark")


def test_everything_has_a_name_and_every_name_is_its_own(browser: Browser, tied: Path) -> None:
    browser.open(tied)
    browser.run("document.querySelectorAll('details').forEach(d => d.open = true)")
    browser.run("new Promise((done) => setTimeout(done, 200))")
    assert browser.run("[...document.querySelectorAll('th')].filter(h => !h.scope).length") == 0
    assert (
        browser.run(
            "[...document.querySelectorAll('svg[role=img], [role=region]')].filter(s =>"
            " !s.getAttribute('aria-label')).length"
        )
        == 0
    )
    assert (
        browser.run(
            "[...document.querySelectorAll('button')].filter(b => !b.textContent &&"
            " !b.getAttribute('aria-label')).length"
        )
        == 0
    )
    assert (
        browser.run("(ids => ids.length - new Set(ids).size)([...document.querySelectorAll('[id]')].map(e => e.id))")
        == 0
    )
    assert (
        browser.run(
            "[...document.querySelectorAll('a[href^=\"#\"]')].filter(a =>"
            " !document.querySelector(a.getAttribute('href'))).length"
        )
        == 0
    )


def test_text_has_enough_contrast_and_the_colours_of_the_map_differ_in_lightness(browser: Browser, tied: Path) -> None:
    light = """
      const channel = (v) => (v /= 255) <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
      const weights = [0.2126, 0.7152, 0.0722];
      const light = (c) => c.match(/[0-9.]+/g).slice(0, 3)
        .reduce((sum, v, i) => sum + weights[i] * channel(Number(v)), 0);"""
    contrast = f"""(() => {{ {light}
      const painted = (e) => !getComputedStyle(e).backgroundColor.endsWith(', 0)');
      const behind = (e) => {{ while (!painted(e)) e = e.parentElement; return getComputedStyle(e).backgroundColor; }};
      const kinds = 'p, td, th, li, summary, a, small, h1, h2, h3, b, span, button, code';
      const words = [...document.querySelectorAll(kinds)];
      return Math.min(...words.filter((e) => e.offsetParent && e.innerText.trim()).map((e) => {{
        const [a, b] = [light(getComputedStyle(e).color), light(behind(e))].sort((p, q) => q - p);
        return (a + 0.05) / (b + 0.05);
      }}));
    }})()"""
    shades = (
        f"(() => {{ {light} return [...document.querySelectorAll('#where .key i')].map((i) =>"
        " light(getComputedStyle(i).backgroundColor)); })()"
    )
    for scheme in ("light", "dark"):
        browser.open(tied, scheme=scheme)
        assert browser.run(contrast) >= 4.5, scheme
        found = browser.run(shades)
        assert len(found) == 9
        outwards = 1 if scheme == "dark" else -1  # the stronger the residual, the further from the page
        for side in (found[4::-1], found[4:]):
            assert min(outwards * (b - a) for a, b in pairwise(side)) > 0, (scheme, side)


def test_hostile_names_are_shown_and_not_run(browser: Browser, tmp_path: Path) -> None:
    page = written(hostile(copy.deepcopy(sample_diagnosis(runs=2, samples=73))), tmp_path)
    browser.open(page)
    browser.run("document.querySelectorAll('details').forEach(d => d.open = true)")
    assert browser.run("document.images.length") == 0
    assert browser.run("document.title").startswith("</script><img")
    assert NASTY in browser.run("document.body.innerText")


def test_a_partly_explained_page_shows_shares_attempts_and_values_over_each_other(
    browser: Browser, tmp_path: Path
) -> None:
    page = written(partly_explained(), tmp_path)
    browser.open(page)
    widths = browser.run("[...document.querySelectorAll('.waterfall i')].map(i => i.getBoundingClientRect().width)")
    assert [w / widths[0] for w in widths] == pytest.approx([1, 0.6, 0.25, 0.15], abs=0.01)
    lefts = browser.run("[...document.querySelectorAll('.waterfall i')].map(i => i.getBoundingClientRect().left)")
    assert lefts[1] + widths[1] == pytest.approx(lefts[0] + widths[0], abs=1)
    assert browser.run("document.querySelectorAll('#attempts + p + .scroll tbody tr').length") == 2
    assert browser.run("[...document.querySelectorAll('details.run')].map(d => d.open)")[2] is False  # validation
    opened = browser.run("[...document.querySelectorAll('details.run')].findIndex(d => d.open)")
    charts = f"document.querySelectorAll('details.run')[{opened}].querySelectorAll('.pair svg.chart')"
    assert browser.run(f"{charts}.length") == 20
    first, second = browser.run(f"[...{charts}].slice(0, 2).map(s => s.getBoundingClientRect().left)")
    assert second > first + 300  # beside each other
    for width in (390, 1280):
        browser.open(page, width, 800)
        assert browser.run("document.documentElement.scrollWidth") <= width

"""The page in a real browser: Chromium, headless, spoken to over its debugging pipe (no driver, no port)."""

from __future__ import annotations

import json
import math
import os
import re
import select
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from sample_result import rattling, sample_result, write_report

fcntl = pytest.importorskip("fcntl", reason="speaks to Chromium over POSIX pipes")
CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "/usr/bin/chromium", "chromium-browser", "google-chrome"))), None
)
FLAGS = (
    "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking"
    " --disable-component-update --disable-sync --hide-scrollbars --remote-debugging-pipe"
).split()
READY = "document.documentElement.classList.contains('ready')"
# the browser reads commands from descriptor 3 and answers on 4
ON_DESCRIPTORS_3_AND_4 = (
    "import os, sys; r, w = int(sys.argv[1]), int(sys.argv[2]); os.dup2(r, 3); os.dup2(w, 4); os.execv(sys.argv[3],"
    " sys.argv[3:])"
)

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium: apt-get install chromium"),
]


class Browser:
    """One page of a fresh Chromium; remembers every error that the page reports and every request that it makes."""

    def __init__(self, profile: Path) -> None:
        theirs_in, self.to = os.pipe()
        self.back, theirs_out = os.pipe()
        ends = [fcntl.fcntl(end, fcntl.F_DUPFD, 10) for end in (theirs_in, theirs_out)]
        command = [
            sys.executable,
            "-c",
            ON_DESCRIPTORS_3_AND_4,
            *map(str, ends),
            str(CHROMIUM),
            *FLAGS,
            f"--user-data-dir={profile}",
            "about:blank",
        ]
        with open(profile / "log.txt", "wb") as log:
            self.process = subprocess.Popen(command, pass_fds=ends, stdout=log, stderr=log)
        for end in (theirs_in, theirs_out, *ends):
            os.close(end)
        self.sent, self.pending, self.session = 0, b"", ""
        self.errors: list[str] = []
        self.requests: list[str] = []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """The answer to one command of the DevTools protocol."""
        self.sent += 1
        message = {"id": self.sent, "method": method, "params": parameters} | (
            {"sessionId": self.session} if self.session else {}
        )
        os.write(self.to, json.dumps(message).encode() + b"\0")
        while True:
            answer = self.message()
            if answer.get("id") == self.sent:
                assert "error" not in answer, answer
                return dict(answer["result"])
            self.note(answer)

    def message(self, limit: float = 30.0) -> dict[str, Any]:
        """The next message of the browser."""
        while b"\0" not in self.pending:
            ready, _, _ = select.select([self.back], [], [], limit)
            chunk = os.read(self.back, 1 << 16) if ready else b""
            assert chunk, "Chromium does not answer"
            self.pending += chunk
        first, _, self.pending = self.pending.partition(b"\0")
        return dict(json.loads(first))

    def note(self, event: dict[str, Any]) -> None:
        """Remember an event that the tests ask about."""
        method, about = event.get("method"), event.get("params", {})
        if method == "Runtime.exceptionThrown":
            self.errors.append(json.dumps(about["exceptionDetails"]))
        elif method == "Log.entryAdded" and about["entry"]["level"] in ("error", "warning"):
            self.errors.append(about["entry"]["text"])
        elif method == "Runtime.consoleAPICalled" and about["type"] in ("error", "warning", "assert"):
            self.errors.append(json.dumps(about["args"]))
        elif method == "Network.requestWillBeSent":
            self.requests.append(about["request"]["url"])

    def open(self, page: Path, width: int = 1280, height: int = 900, scheme: str = "light", ready: str = READY) -> None:
        """Load a file and wait until its scripts have run, so that ``ready`` is true."""
        self.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 600
        )
        self.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        self.call("Page.navigate", url=page.as_uri())
        until = time.monotonic() + 20
        while not self.run(f"document.readyState === 'complete' && location.href === '{page.as_uri()}' && ({ready})"):
            assert time.monotonic() < until, f"the page did not get ready: {self.errors}"
            time.sleep(0.02)
        self.run("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def run(self, script: str) -> Any:
        """The value of a JavaScript expression in the page."""
        answer = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def press(self, key: str) -> None:
        """Press and release a key where the focus is."""
        codes = {"ArrowRight": 39, "ArrowLeft": 37, "End": 35, "Tab": 9, "+": 187}
        for kind in ("rawKeyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=key, code=key, windowsVirtualKeyCode=codes[key])

    def mouse(self, kind: str, x: float, y: float, pressed: bool = False) -> None:
        """Move or use the left button at a place of the window."""
        self.call(
            "Input.dispatchMouseEvent",
            type=kind,
            x=x,
            y=y,
            button="left" if pressed else "none",
            buttons=int(pressed),
            clickCount=int(pressed),
        )

    def close(self) -> None:
        """End the browser."""
        self.call("Page.disable")
        self.process.terminate()
        self.process.wait(10)
        os.close(self.to)
        os.close(self.back)


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    found = Browser(tmp_path_factory.mktemp("profile"))
    yield found
    found.close()


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("report")
    write_report(sample_result(wrong="reaction_B_angle"), out)
    return out / "report.html"


@pytest.fixture(autouse=True)
def no_errors(browser: Browser) -> Iterator[None]:
    """Every test must leave the console clean."""
    browser.errors.clear()
    browser.requests.clear()
    yield
    browser.run("1")
    assert browser.errors == []


JOINT_A = "document.querySelector('#mover .series.joint path').getAttribute('d').match(/M(.*?)m/g)[1]"
MOVE = (
    "(v) => { const s = document.querySelector('[data-slider]'), {x} = data.motion.runs[0]; s.value ="
    " x.findIndex((a) => Math.abs(a - v) < 1e-6); s.dispatchEvent(new Event('input', {bubbles: true})); }"
)


def test_the_slider_moves_the_linkage_and_says_the_angle(browser: Browser, page: Path) -> None:
    browser.open(page)
    assert browser.run("[s => [s.min, s.max, s.step]][0](document.querySelector('input[type=range]'))") == [
        "0",
        "28",
        "1",
    ]
    browser.run(f"({MOVE})(30)")
    before = browser.run(JOINT_A)
    browser.run(f"({MOVE})(120)")
    assert browser.run(JOINT_A) != before
    said = browser.run("document.querySelector('[data-live]').textContent")
    assert "120 deg" in said
    assert "at B: analytic 118.48, simulated" in said  # deg, the follower 0.21 m long
    assert browser.run("document.querySelector('[data-slider]').getAttribute('aria-valuetext')") == "120 deg"
    browser.run(f"({MOVE})(30)")
    assert browser.run(JOINT_A) == before


def test_a_report_without_a_single_run_says_why_and_leaves_the_console_clean(browser: Browser, tmp_path: Path) -> None:
    why = "mujoco: nothing presses the pin of joint 'B'"
    failure = {"simulator": "mujoco", "joint_model": "contact", "why": why}
    write_report(sample_result() | {"runs": [], "verdict": "disagrees", "failures": [failure]}, tmp_path)
    browser.open(tmp_path / "report.html")
    said = browser.run("document.body.innerText")
    assert "nothing was compared" in said
    assert why in said
    assert browser.run("document.querySelector('#mover')") is None


def test_a_report_whose_runs_are_not_judged_says_why_and_leaves_the_console_clean(
    browser: Browser, tmp_path: Path
) -> None:
    result = sample_result()
    for run in result["runs"]:
        run |= {"verdict": "unjudged", "reason": "no answer anywhere", "discrepancies": [], "order_difference": {}}
        run["flags"] = {str(i): "it turns too fast" for i in range(len(run["crank_angle"]))}
        for side in ("analytic", "simulated"):
            run[side] = {name: [None] * len(values) for name, values in run[side].items()}
    write_report(result | {"verdict": "unjudged"}, tmp_path)
    browser.open(tmp_path / "report.html")
    said = browser.run("document.body.innerText")
    assert "Nothing could be compared in 4 of 4 runs; mujoco, ideal: no answer anywhere." in said
    assert "First order and equilibrium cannot be compared" in said


def test_the_arrow_keys_move_the_slider_by_one_step(browser: Browser, page: Path) -> None:
    browser.open(page)
    browser.run(f"({MOVE})(105)")
    browser.run("document.querySelector('[data-slider]').focus()")
    browser.press("ArrowRight")
    assert browser.run("document.querySelector('[data-value]').textContent") == "110 deg"


def test_the_page_opens_where_the_run_disagrees_most_and_says_why(browser: Browser, tmp_path: Path) -> None:
    result = sample_result(wrong="reaction_B_angle")
    contact = next(run for run in result["runs"] if run["joint_model"] == "contact")
    row = next(d for d in contact["discrepancies"] if d["verdict"] == "disagrees")
    contact["because"] = {"assumption": "contact", "joint": "B", "words": "B loses contact for 7.9 % of the turn"}
    write_report(result, tmp_path)
    browser.open(tmp_path / "report.html")
    at = browser.run("data.motion.runs[0].x[Number(document.querySelector('[data-slider]').value)]")
    assert at == pytest.approx(math.degrees(row["at_crank_angle"]), abs=1e-6)
    assert browser.run("document.querySelector('[data-run]').selectedOptions[0].text") == "mujoco, contact"
    assert browser.run("document.querySelector('.verdict .why').textContent").startswith(
        "B loses contact for 7.9 % of the turn (mujoco, contact)"
    )


def test_a_figure_is_downloaded_as_a_drawing_and_as_a_table(browser: Browser, page: Path) -> None:
    browser.open(page)
    made = browser.run(
        """(async () => {
        const blobs = [], make = URL.createObjectURL, names = [];
        URL.createObjectURL = (blob) => { blobs.push(blob); return make.call(URL, blob); };
        HTMLAnchorElement.prototype.click = function () { names.push(this.download); };
        const buttons = document.querySelector('#figures figure').querySelectorAll('[data-download]');
        [...buttons].filter((b) => b.dataset.download !== 'png').forEach((b) => b.click());
        const texts = await Promise.all(blobs.map((blob) => blob.text()));
        return names.map((name, i) => [name, texts[i]]);
        })()"""
    )
    (drawing, svg), (table, csv) = made
    assert (drawing, table) == ("gamma_B.svg", "gamma_B.csv")
    kinds = browser.run(
        "[...document.querySelector('#figures figure').querySelectorAll('[data-download]')].map(b => b.textContent)"
    )
    assert kinds == ["SVG", "PNG", "CSV"]
    assert svg.strip() == (page.parent / "gamma_B.svg").read_text(encoding="utf-8").strip()
    head, *rows = csv.splitlines()
    assert head.startswith('"series","crank angle')
    assert len(rows) == 29 * len({row.split('",')[0] for row in rows})


def test_the_table_shows_the_numbers_of_the_result(browser: Browser, page: Path) -> None:
    browser.open(page)
    browser.run(f"({MOVE})(30)")
    row = browser.run(
        "[...document.querySelectorAll('[data-readout] tr')].map(r => r.innerText).find(t => t.includes('Reaction"
        " angle'))"
    )
    assert "34.676" in row  # deg at 30 deg, the follower 0.21 m long: the equilibrium direction of the printed case


def turned(result: dict[str, Any]) -> dict[str, Any]:
    """The same result as an engine may well report it: the same directions, continued from other turns and round the
    other way.
    """
    for run in result["runs"]:
        angles = {name: values for name, values in run["simulated"].items() if name.endswith("_angle")}
        for name, values in angles.items():
            turns = [-2 * (i > 9) if name.startswith("reaction_") else 1 for i in range(len(values))]
            run["simulated"][name] = [v + k * math.tau for v, k in zip(values, turns, strict=True)]
    return result


def explored(browser: Browser, result: dict[str, Any], folder: Path) -> list[tuple[list[list[str]], list[float]]]:
    """The rows and the drawing's coordinates that the linkage panel of the contact run shows at each angle, gaps drawn
    1.3 times as large.
    """
    folder.mkdir()
    write_report(result, folder)
    browser.open(folder / "report.html")
    set_value = "(e, v, kind) => { e.step = 'any'; e.value = v; e.dispatchEvent(new Event(kind)); }"
    browser.run(f"({set_value})(document.querySelector('[data-run]'), 3, 'change')")
    browser.run(f"({set_value})(document.querySelector('[data-factor]'), Math.log10(1.3), 'input')")
    assert browser.run("document.querySelector('[data-magnified]').textContent").endswith(" 1.3")
    rows = (
        "[...document.querySelectorAll('[data-readout] tr')].map(r => [...r.cells].map(c =>"
        " c.innerText.replace('\u2212', '-')))"
    )
    paths = (
        "[...document.querySelectorAll('#mover .series path')].flatMap(p =>"
        " p.getAttribute('d').match(/[-.0-9]+/g).map(Number))"
    )
    found = []
    for angle in range(20, 165, 5):
        browser.run(f"({MOVE})({angle})")
        found.append((browser.run(rows), browser.run(paths)))
    return found


def test_whole_turns_between_the_two_sides_change_neither_the_values_nor_the_drawing(
    browser: Browser, tmp_path: Path
) -> None:
    as_is = explored(browser, sample_result(wrong="reaction_B_angle"), tmp_path / "as-is")
    shifted = explored(browser, turned(sample_result(wrong="reaction_B_angle")), tmp_path / "turned")
    gamma = []
    for (rows, drawing), (rows_shifted, drawing_shifted) in zip(as_is, shifted, strict=True):
        assert rows_shifted == rows
        assert drawing_shifted == pytest.approx(drawing, abs=0.02)  # px
        assert rows[0][0].startswith("Reaction angle")
        gamma.append([float(cell) for cell in rows[0][1:]])
    assert all(simulated - analytic == pytest.approx(apart, abs=0.01) for analytic, simulated, apart in gamma)
    assert max(apart for *_, apart in gamma) == pytest.approx(math.degrees(0.01), rel=0.1)


def test_a_journal_that_a_soft_contact_lets_out_of_its_circle_stays_in_the_picture(
    browser: Browser, tmp_path: Path
) -> None:
    result = sample_result()
    for run in result["runs"][1:]:
        for axis in "xy":
            run["simulated"][f"clearance_B_{axis}"] = [1.9 * v for v in run["simulated"][f"clearance_B_{axis}"]]
    write_report(result, tmp_path)
    browser.open(tmp_path / "report.html")
    inside = """(() => { const box = (s) => document.querySelector(s).getBoundingClientRect();
      const [svg, pin] = ['.rim svg', '.rim .journal.simulated'].map(box);
      return pin.left >= svg.left && pin.right <= svg.right && pin.top >= svg.top && pin.bottom <= svg.bottom; })()"""
    for angle in (20, 90, 160):
        browser.run(f"({MOVE})({angle})")
        assert browser.run(inside), angle


def test_the_panel_and_the_figure_have_a_direction_in_the_same_turn_and_no_rounding_as_a_value(
    browser: Browser, tmp_path: Path
) -> None:
    result = sample_result()
    for run in result["runs"][1:]:
        for side in ("analytic", "simulated"):
            run[side]["reaction_B_angle"] = [v - math.tau for v in run[side]["reaction_B_angle"]]
            run[side]["clearance_B_y"][2] = 1e-17
    write_report(result, tmp_path)
    browser.open(tmp_path / "report.html")
    browser.run(f"({MOVE})(30)")
    rows = browser.run(
        "[...document.querySelectorAll('[data-readout] tr')].map(r => [...r.cells].map(c => c.innerText))"
    )
    assert rows[0][0].startswith("Reaction angle")
    assert rows[0][1:3] == ["34.676", "34.676"]
    assert next(row for row in rows if row[0].startswith("Displacement y"))[1:] == ["0", "0", "0"]
    assert browser.run("data.figures[0].series.map(s => Math.abs(s.y[2] - 34.676) < 5)") == [True] * 6


def test_the_selector_and_the_exaggeration_change_the_drawing(browser: Browser, page: Path) -> None:
    browser.open(page)
    drawing = "document.querySelector('#mover svg.chart').innerHTML"
    first = browser.run(drawing)
    browser.run(
        "[f => { f.value = 0.7; f.dispatchEvent(new Event('input')); }][0](document.querySelector('[data-factor]'))"
    )
    assert browser.run("document.querySelector('[data-magnified]').textContent").endswith(" 5")
    assert browser.run(drawing) != first
    browser.run(
        "[m => { m.value = 0; m.dispatchEvent(new Event('change')); }][0](document.querySelector('[data-run]'))"
    )
    assert browser.run("document.querySelector('[data-factor]').disabled") is True
    assert browser.run("document.querySelectorAll('.rim').length") == 0


def test_a_chart_can_be_read_zoomed_and_reset(browser: Browser, page: Path) -> None:
    browser.open(page)
    browser.run("document.querySelector('#plot-0').scrollIntoView({block: 'center'})")
    box = browser.run(
        "(b => [b.left, b.top, b.width, b.height])(document.querySelector('#plot-0 svg.chart').getBoundingClientRect())"
    )
    x, y = box[0] + 0.5 * box[2], box[1] + 0.5 * box[3]
    browser.mouse("mouseMoved", x, y)
    assert "crank angle θ₂" in browser.run("document.querySelector('#plot-0 .tip').innerText")
    labels = "[...document.querySelectorAll('#plot-0 svg.chart > text')].map(t => t.textContent).join()"
    whole = browser.run(labels)
    browser.mouse("mousePressed", x, y, True)
    browser.mouse("mouseMoved", x + 80, y + 60, True)
    browser.mouse("mouseReleased", x + 80, y + 60, True)
    assert browser.run(labels) != whole
    browser.run("document.querySelector('#plot-0 .tools button:last-child').click()")
    assert browser.run(labels) == whole
    browser.run("document.querySelector('#plot-0 svg.chart').focus()")
    browser.press("End")
    assert browser.run("document.querySelector('#plot-0 [aria-live]').textContent").startswith("crank angle θ₂ 160 deg")


def test_a_legend_entry_hides_its_series_and_the_data_open_as_a_table(browser: Browser, page: Path) -> None:
    browser.open(page)
    count = "document.querySelectorAll('#plot-0 svg.chart .series').length"
    before = browser.run(count)
    browser.run("document.querySelector('#plot-0 .legend button').click()")
    assert browser.run(count) == before - 1
    browser.run("document.querySelector('#plot-0').parentElement.querySelector('summary').click()")
    browser.run("new Promise((done) => setTimeout(done, 50))")
    assert browser.run("document.querySelectorAll('#figures tbody tr').length") == 29


@pytest.mark.parametrize(("width", "scheme"), [(360, "light"), (360, "dark"), (1280, "dark")])
def test_no_screen_makes_the_page_scroll_sideways(browser: Browser, page: Path, width: int, scheme: str) -> None:
    browser.open(page, width, 800, scheme)
    assert browser.run("document.documentElement.scrollWidth") <= width
    dark = browser.run("getComputedStyle(document.body).backgroundColor") == "rgb(20, 23, 27)"
    assert dark == (scheme == "dark")


def test_the_page_asks_for_nothing_but_itself(browser: Browser, page: Path) -> None:
    browser.open(page)
    assert [url for url in browser.requests if not url.startswith("data:")] == [page.as_uri()]


def test_every_control_has_a_name_and_every_header_a_scope(browser: Browser, page: Path) -> None:
    browser.open(page)
    unnamed = "[...document.querySelectorAll('input, select')].filter(c => !c.labels.length).length"
    assert browser.run(unnamed) == 0
    assert browser.run("[...document.querySelectorAll('th')].filter(h => !h.scope).length") == 0
    assert (
        browser.run("[...document.querySelectorAll('svg[role=img]')].filter(s => !s.getAttribute('aria-label')).length")
        == 0
    )
    assert (
        browser.run("(ids => ids.length - new Set(ids).size)([...document.querySelectorAll('[id]')].map(e => e.id))")
        == 0
    )


def test_text_has_enough_contrast_in_both_schemes(browser: Browser, page: Path) -> None:
    script = """(() => {
      const channel = (v) => (v /= 255) <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
      const weights = [0.2126, 0.7152, 0.0722];
      const light = (c) => c.match(/[0-9.]+/g).slice(0, 3)
        .reduce((sum, v, i) => sum + weights[i] * channel(Number(v)), 0);
      const painted = (e) => !getComputedStyle(e).backgroundColor.endsWith(', 0)');
      const behind = (e) => { while (!painted(e)) e = e.parentElement; return getComputedStyle(e).backgroundColor; };
      const kinds = 'p, td, th, li, dd, dt, summary, a, small, h1, h2, h3, label, b, span, button';
      const words = [...document.querySelectorAll(kinds)];
      return Math.min(...words.filter((e) => e.offsetParent && e.innerText.trim()).map((e) => {
        const [a, b] = [light(getComputedStyle(e).color), light(behind(e))].sort((p, q) => q - p);
        return (a + 0.05) / (b + 0.05);
      }));
    })()"""
    for scheme in ("light", "dark"):
        browser.open(page, scheme=scheme)
        assert browser.run(script) >= 4.5, scheme


def test_hostile_names_are_shown_and_not_run(browser: Browser, tmp_path: Path) -> None:
    nasty = "</script><img src=x onerror=\"document.title='owned'\">"
    text = json.dumps(sample_result()).replace("mujoco", "ENGINE")
    result = json.loads(text.replace("ENGINE", json.dumps(nasty)[1:-1]))
    result["case"] = result["mechanism"]["name"] = nasty
    result["warnings"] = [nasty]
    write_report(result, tmp_path)
    browser.open(tmp_path / "report.html")
    assert browser.run("document.images.length") == 0
    assert browser.run("document.title").startswith("</script><img")
    assert nasty in browser.run("document.body.innerText")


def test_several_engines_with_two_clearances_and_a_full_turn(browser: Browser, tmp_path: Path) -> None:
    write_report(sample_result("crank-rocker", {"B": 2e-4, "E": 1e-4}, ("mujoco", "exudyn")), tmp_path)
    browser.open(tmp_path / "report.html")
    assert browser.run("document.querySelectorAll('.rim').length") == 2
    before = browser.run(JOINT_A)
    browser.run(f"({MOVE})(355)")
    assert browser.run(JOINT_A) != before
    heads = browser.run(
        "[...document.querySelectorAll('#differences .multiples thead th')].map(h => h.firstChild.data.trim())"
    )
    assert heads == ["Signal", "mujoco", "exudyn"]


# ------------------------------------------------------------------ four engines

FOUR = ("mujoco", "exudyn", "pybullet", "dart")
LONGEST = 21_700 / 2  # px at a width of 1400: half of what this page once took


@pytest.fixture(scope="module")
def four(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("four")
    write_report(sample_result(engines=FOUR), out)
    return out / "report.html"


def test_the_linkage_plays_in_the_first_screen_and_takes_up_another_run(browser: Browser, four: Path) -> None:
    browser.open(four, 1400, 900)
    drawn = browser.run("document.querySelector('#mover svg.chart').getBoundingClientRect().bottom")
    assert drawn <= 900
    before = browser.run(JOINT_A)
    browser.run("document.querySelector('[data-play]').click()")
    browser.run("new Promise((done) => setTimeout(done, 700))")
    browser.run("document.querySelector('[data-play]').click()")
    stopped = browser.run("document.querySelector('[data-value]').textContent")
    assert browser.run(JOINT_A) != before
    assert stopped in browser.run("document.querySelector('#mover svg.chart').getAttribute('aria-label')")
    title = "(m => { m.value = 7; m.dispatchEvent(new Event('change')); return m.selectedOptions[0].text; })"
    assert browser.run(f"{title}(document.querySelector('[data-run]'))") == "exudyn, contact"
    assert browser.run("document.querySelector('[data-value]').textContent") == stopped  # at the same angle
    legend = browser.run("[...document.querySelectorAll('#mover .legend button')].map(b => b.textContent)")
    assert "exudyn, contact" in legend
    assert browser.run("document.querySelectorAll('#figures .mark[d]').length") == 3 * len(
        FOUR
    )  # and the figures say it


def test_engines_stand_side_by_side_at_one_scale_with_their_tolerances_in_sight(browser: Browser, four: Path) -> None:
    browser.open(four, 1400, 900)
    row = "document.querySelector('#differences tr.panels')"
    assert browser.run(
        f"[...{row}.querySelectorAll('svg.chart')].map(s => Math.round(s.getBoundingClientRect().top))"
    ) == [pytest.approx(browser.run(f"{row}.querySelector('svg.chart').getBoundingClientRect().top"), abs=1)] * len(
        FOUR
    )
    assert browser.run(
        f"(b => b.scrollWidth <= b.clientWidth)({row}.closest('.scroll'))"
    )  # no engine has to be scrolled to
    limits = """[...document.querySelectorAll('#differences tr.panels svg.chart')].map((s) => {
        const box = s.querySelector('.axis').getBoundingClientRect();
        const lines = [...s.querySelectorAll('.series.dashed path')].map((p) => p.getBoundingClientRect().top);
        return [lines.length, lines.every((y) => y > box.top && y < box.bottom)];
        })"""
    found = browser.run(limits)
    assert len(found) == len(FOUR) * browser.run("document.querySelectorAll('#differences tr.panels').length")
    assert all(inside and number >= 6 for number, inside in found), found
    words = "[...s.querySelectorAll('text')].map(t => t.textContent).join()"
    ticks = f"[...{row}.querySelectorAll('svg.chart')].map(s => {words})"
    assert len(set(browser.run(ticks))) == 1
    browser.run("document.querySelector('[data-close]').click()")
    closer = browser.run(limits)  # where curves are well within, their tolerances are out of sight now
    assert 0 < sum(inside for _, inside in closer) < len(found)


def test_a_tip_has_the_digits_that_tell_two_engines_apart(browser: Browser, four: Path) -> None:
    browser.open(four, 1400, 900)
    pane = "document.querySelector('#plot-1-1')"
    browser.run(f"{pane}.scrollIntoView({{block: 'center'}})")
    box = browser.run(
        f"(b => [b.left, b.top, b.width, b.height])({pane}.querySelector('svg.chart').getBoundingClientRect())"
    )
    browser.mouse("mouseMoved", box[0] + 0.6 * box[2], box[1] + 0.5 * box[3])
    told = dict(
        browser.run(
            f"[...{pane}.querySelectorAll('.tip span')]"
            ".map(s => [s.childNodes[1].data.trim(), s.lastChild.textContent])"
        )
    )
    assert {"analytic, equilibrium", "exudyn, massless-link", "exudyn, contact"} <= set(told)
    loose = [text for name, text in told.items() if not name.endswith("ideal")]
    assert len(set(loose)) == len(loose)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_on_a_small_screen_nothing_is_cut(browser: Browser, four: Path, scheme: str) -> None:
    browser.open(four, 420, 900, scheme)
    assert browser.run("document.documentElement.scrollWidth") <= 420
    clipped = """[...document.querySelectorAll('main *, header *')].filter((e) => {
        const box = e.getBoundingClientRect();
        return box.width > 1 && box.right > 421 && !e.closest('pre, .unseen, svg');
        }).map((e) => e.outerHTML.slice(0, 80))"""
    assert browser.run(clipped) == []
    hidden = """[...document.querySelectorAll('main *')].filter((e) => e.scrollWidth > e.clientWidth + 1
        && !e.closest('svg, .unseen') && getComputedStyle(e).overflowX === 'hidden' && e.clientWidth > 1).length"""
    assert browser.run(hidden) == 0
    wide = "[...document.querySelectorAll('.scroll')].filter((e) => e.scrollWidth > e.clientWidth + 1).length"
    assert browser.run(wide) == 0


def test_the_page_of_four_engines_is_at_most_half_as_long_as_it_was(browser: Browser, four: Path) -> None:
    browser.open(four, 1400, 900)
    assert browser.run("document.documentElement.scrollHeight") <= LONGEST


# ------------------------------------------------------------------ contact


@pytest.fixture(scope="module")
def rattled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("rattling")
    rattling(louder=1.5).write(out)
    return out / "report.html"


@pytest.mark.parametrize(("width", "scheme"), [(1280, "light"), (400, "dark")])
def test_what_contact_did_fits_any_screen(browser: Browser, rattled: Path, width: int, scheme: str) -> None:
    browser.open(rattled, width=width, scheme=scheme)
    assert browser.run("document.documentElement.scrollWidth") <= width
    assert browser.run("document.querySelectorAll('#contact .chart').length") == 4
    assert browser.run("document.querySelector('#contact details[open] summary').textContent").endswith("disagrees")


def test_a_band_is_filled_and_read_from_its_lower_to_its_upper_edge(browser: Browser, rattled: Path) -> None:
    browser.open(rattled)
    chart = "[...document.querySelectorAll('#contact figure')].find(f => f.textContent.includes('Contact force'))"
    band = browser.run(f"getComputedStyle({chart}.querySelector('.series.band path')).fillOpacity")
    assert float(band) == pytest.approx(0.2)
    browser.run(f"{chart}.querySelector('.chart').scrollIntoView()")
    browser.run(f"{chart}.querySelector('.chart').focus()")
    for _ in range(8):
        browser.press("ArrowRight")
    said = browser.run(f"{chart}.querySelector('.tip').textContent")
    assert re.search(r"5 to 95 % of the time, mujoco, contact [\d.]+ to [\d.]+ N", said), said


def test_the_slider_at_a_flagged_angle_shows_what_was_simulated_and_no_difference(
    browser: Browser, rattled: Path
) -> None:
    browser.open(rattled)
    browser.run(
        "(s => { s.selectedIndex = 3; s.dispatchEvent(new Event('change', {bubbles: true})); })(document"
        ".querySelector('[data-run]'))"
    )
    browser.run(f"({MOVE})(75)")
    assert "no answer here: the reaction at B" in browser.run("document.querySelector('[data-flag]').textContent")
    rows = browser.run(
        "[...document.querySelectorAll('[data-readout] tr')]"
        ".map(r => [...r.querySelectorAll('td')].map(c => c.textContent))"
    )
    assert all(analytic == difference == "\N{EN DASH}" != simulated for analytic, simulated, difference in rows)
    drawn = browser.run("[...document.querySelectorAll('[data-linkage] .legend button')].map(b => b.textContent)")
    assert drawn == ["without clearance", "mujoco, contact"]

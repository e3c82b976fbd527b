"""The documentation does what it says: its commands and code run, its links lead somewhere, its messages are the real
ones.
"""

from __future__ import annotations

import json
import os
import re
import runpy
import shlex
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from analytic.mechanism.columns import Layout
from analytic.mechanism.file import load
from compare.cli.app import app
from compare.diagnose.data.measured import load_measured
from sim_models.engine import ENGINES, GROUP
from test_ci_example import step

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
RIG = DOCS / "example-rig"
FENCE = re.compile(
    r"^(?:<!-- exit status (?P<status>\d) -->\n)?```(?P<kind>\w*)(?: title=\"(?P<title>[^\"]+)\")?\n(?P<text>.*?)^```$",
    re.MULTILINE | re.DOTALL,
)


@dataclass(frozen=True)
class Block:
    """A block of a page: its language, the file it is to be, the exit status of its last command, and its text."""

    kind: str
    title: str | None
    status: int
    text: str


def blocks(page: Path) -> list[Block]:
    """The fenced blocks of a page."""
    found = FENCE.finditer(page.read_text(encoding="utf-8"))
    return [Block(m["kind"], m["title"], int(m["status"] or 0), m["text"]) for m in found]


# ---------------------------------------------------------------- commands and code

# Pages whose blocks take long, or that ask every engine, are run with the slow tests.
DEAR = {
    "how-to/logger.md",
    "how-to/plan.md",
    "how-to/read-a-report.md",
    "how-to/sweep.md",
    "how-to/check.md",
    "how-to/several-drives.md",
    "theory/clearance.md",
    "how-to/fmu.md",
    "how-to/pytest.md",
    "how-to/rattle.md",
    "tutorial/paper.md",
    "tutorial/six-bar.md",
    "tutorial/rig.md",
    "how-to/baseline.md",
    "how-to/validity.md",
    "how-to/flexible.md",
    "how-to/export.md",
    "how-to/tolerances.md",
}
OWN_TEST = {"how-to/effect.md"}  # its data have to be made first
PAGES = sorted(
    path.relative_to(DOCS).as_posix()
    for folder in ("tutorial", "how-to", "theory")
    for path in (DOCS / folder).glob("*.md")
    if any(block.kind in ("sh", "python") for block in blocks(path))
    and path.relative_to(DOCS).as_posix() not in OWN_TEST
)


def in_process(text: str, status: int) -> str:
    """Output of commands, each of which begins with ``compare``; the last one ends with that exit status."""
    lines = [shlex.split(line, comments=True) for line in text.splitlines()]
    output = ""
    for i, (_, *words) in enumerate(lines):
        done = CliRunner().invoke(app, words)
        expected = status if i == len(lines) - 1 else done.exit_code
        assert done.exit_code == expected, f"{words}: {done.output}"
        output += done.output
    return output


def in_a_shell(text: str, status: int) -> str:
    """Output of a shell's commands; ``compare`` and ``python`` are this interpreter's."""
    folder = Path("commands-of-the-page").absolute()
    folder.mkdir(exist_ok=True)
    for name, arguments in (("compare", "-m compare"), ("python", "")):
        (folder / name).write_text(f'#!/bin/sh\nexec "{sys.executable}" {arguments} "$@"\n', encoding="utf-8")
        (folder / name).chmod(0o755)
    path = os.pathsep.join(str(place) for place in (os.environ.get("PYTHONPATH", ""), ROOT) if place)
    own = {
        "PATH": f"{folder}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": path,
        "EXAMPLES": str(DOCS),
        "COLUMNS": "110",
    }
    done = subprocess.run(
        ["bash", "-euc", text], env=os.environ | own, capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == status, f"{text}: {done.stdout} {done.stderr}"
    return done.stdout + done.stderr


def plain(text: str) -> str:
    """Text with every space and line break as one space."""
    return " ".join(text.split())


def run(page: Path) -> None:
    """Write the files that a page shows, run its commands and its code, and look for the output that it shows."""
    output = ""
    names: dict[str, object] = {"__name__": "page"}
    for block in blocks(page):
        if block.title is not None:
            with Path(block.title).open("a", encoding="utf-8") as file:
                file.write(block.text)
        elif block.kind == "sh":
            own = all(line.startswith("compare ") for line in block.text.splitlines())
            output = (in_process if own else in_a_shell)(block.text, block.status)
        elif block.kind == "text" and output:
            for line in block.text.splitlines():
                assert plain(line) in plain(output), f"{page.name} shows {line!r}, but the output is\n{output}"
            output = ""
        elif block.kind == "python":
            exec(compile(block.text, page.name, "exec"), names)


def marks(name: str) -> list[pytest.MarkDecorator]:
    """A page that is dear to run is slow, and it needs the engines that it names on a command line."""
    text = "".join(block.text for block in blocks(DOCS / name) if block.kind == "sh")
    named = [engine for engine in ENGINES if re.search(rf"--simulator (?:\S+,)?{engine}\b", text)]
    asked = ENGINES if "--simulator all" in text else named
    return [pytest.mark.slow] * (name in DEAR) + [getattr(pytest.mark, engine) for engine in asked]


@pytest.mark.long_rows(
    "how-to/one-side.md", "how-to/accuracy.md", "how-to/platform.md", "how-to/tolerances-of-parts.md", "how-to/mjcf.md",
    "how-to/ci.md",
)  # fmt: skip
@pytest.mark.parametrize("name", [pytest.param(page, marks=marks(page)) for page in PAGES])
def test_the_commands_and_code_of_a_page_run(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "110")
    run(DOCS / name)


def recorded(folder: Path, damping: dict[str, float]) -> None:
    """The example rig as if it had no clearance, and this drag (N.m.s/rad) in its bearings."""
    play = runpy.run_path(str(RIG / "make.py"))["make"]
    play.__globals__.update(CLEARANCE={}, DAMPING=damping)
    folder.mkdir()
    for name in ("measured.toml", "nominal.toml"):
        shutil.copy(RIG / name, folder)
    play(folder)


@pytest.mark.slow
@pytest.mark.exudyn
def test_the_effect_of_one_s_own_is_found_in_data_that_have_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    recorded(tmp_path / "my-rig", dict.fromkeys("DABE", 3e-3))
    (example,) = (block.text for block in blocks(DOCS / "how-to" / "effect.md") if block.kind == "python")
    names: dict[str, object] = {"__name__": "example"}
    exec(compile(example, "effect.md", "exec"), names)
    assert capsys.readouterr().out.strip() == "explained [('bearing_drag', 'linkage')]"
    damping = names["found"].effects[0].parameters["damping"]
    assert damping.low < 3e-3 < damping.high
    assert (tmp_path / "my-diagnosis" / "diagnosis.html").stat().st_size > 10_000


@pytest.mark.slow
@pytest.mark.exudyn
@pytest.mark.skipif(shutil.which("bash") is None, reason="there is no bash to run the workflow's step")
def test_the_ci_example_s_step_says_what_it_found_and_keeps_the_report(tmp_path: Path) -> None:
    recorded(tmp_path / "rig", {"E": 4e-3})
    words = (
        step("Diagnose the rig")
        .replace("compare diagnose", f"{sys.executable} -m compare diagnose")
        .replace("python -c", f"{sys.executable} -c")
    )
    done = subprocess.run(
        ["bash", "-e", "-c", words], cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == ["explained", "viscous_friction at E"]
    written = tmp_path / "crosscheck-report" / "diagnosis" / "diagnosis.json"
    assert json.loads(written.read_text(encoding="utf-8"))["verdict"] == "explained"


def test_the_files_of_measured_data_can_be_read(tmp_path: Path) -> None:
    found = blocks(DOCS / "reference" / "measured-data.md")
    (data,) = (block.text for block in found if block.kind == "text")
    layout, measured = (block.text for block in found if block.kind == "toml")
    assert set(Layout.model_validate(tomllib.loads(layout)).columns) == {"phi_deg", "enc", "torque", "temp", "push"}
    header, *shown = data.splitlines()
    assert [row.count(",") for row in shown] == [header.count(",")] * 2
    (tmp_path / "measured.toml").write_text(measured, encoding="utf-8")
    shutil.copy(RIG / "nominal.toml", tmp_path)
    time = np.linspace(0.0, 1.0, 40)
    columns = np.column_stack([time, np.degrees(6.0 * time), *(np.sin(k * time) for k in range(1, 5))])
    for name in ("slow", "by-hand", "let-go", "switched", "kept-back"):
        text = "\n".join([header, *(",".join(f"{value:.9g}" for value in row) for row in columns)])
        (tmp_path / f"{name}.csv").write_text(text + "\n", encoding="utf-8")
    data_set = load_measured(tmp_path / "measured.toml")
    assert [run.input for run in data_set.runs] == ["speed", "measured", "free", "torque", "speed"]
    assert [run.role for run in data_set.runs] == ["fit", "fit", "fit", "fit", "validation"]
    assert set(data_set.runs[0].channels) == {name.split(" [")[0] for name in header.split(",")[1:]}
    assert data_set.tolerance == {"mass": 0.002, "length_error": 2e-4}
    assert data_set.prior == {"joint_clearance": 0.1}
    assert data_set.runs[2].loads is not None


def test_the_six_bar_of_the_tutorial_is_the_shipped_one(tmp_path: Path) -> None:
    text = "".join(b.text for b in blocks(DOCS / "tutorial" / "six-bar.md") if b.title == "my-six-bar.toml")
    (tmp_path / "my-six-bar.toml").write_text(text, encoding="utf-8")
    mine, shipped = load(str(tmp_path / "my-six-bar.toml")), load("six-bar")
    assert mine.clearances == {"F": 5e-5}
    assert mine.joints == shipped.with_clearances(mine.clearances).joints
    assert mine.ground == shipped.ground
    assert (mine.drive, mine.loads, mine.gravity) == (shipped.drive, shipped.loads, shipped.gravity)
    assert [(b.name, b.points, b.mass) for b in mine.bodies] == [(b.name, b.points, b.mass) for b in shipped.bodies]


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (('name = "F"', 'name = "f"'), "joint 'f': body 'link' has no point 'f'; its points are C, F"),
        (("\nspeed =", "\nsped ="), "drive.sped is not a field; did you mean 'speed'"),
        (("mass = 0.14", "mass = -0.14"), "body[coupler].mass = -0.14: input should be greater than 0"),
        (
            ("B = [0.12, 0.0], C", "B = [0.32, 0.0], C"),
            "crank angle 0 deg cannot be reached: the loop through coupler, follower does not close",
        ),
    ],
)
def test_the_messages_about_mechanism_files_are_the_real_ones(
    edit: tuple[str, str], message: str, tmp_path: Path
) -> None:
    text = "".join(b.text for b in blocks(DOCS / "tutorial" / "six-bar.md") if b.title == "my-six-bar.toml")
    assert edit[0] in text
    (tmp_path / "bad.toml").write_text(text.replace(*edit), encoding="utf-8")
    shown = CliRunner().invoke(app, ["--simulator", "mujoco", "--case", str(tmp_path / "bad.toml")])
    assert shown.exit_code == 2
    assert message in plain(shown.output)
    assert message in plain((DOCS / "how-to" / "bad-data.md").read_text(encoding="utf-8"))


@pytest.mark.long_rows("forward.csv-edit1-message1")
@pytest.mark.parametrize(
    ("name", "edit", "message"),
    [
        (
            "forward.csv",
            ("follower_angle [deg]", "follower_angle [mm]"),
            "'follower_angle', has unit 'mm', which is of another dimension; an angle is given in rad, mrad, deg or"
            " rev",
        ),
        (
            "forward.csv",
            ("follower_angle [deg]", "follower_angle [rad]"),
            "follower_angle of run 'forward' is 57.37 times its prediction: it looks in deg, but its column says rad",
        ),
        (
            "measured.toml",
            ("drive_speed = 6.0 ", "drive_speed = 57.3 "),
            "drive_speed = 57.3 rad/s, but crank_angle in forward.csv turns at 6 rad/s, 0.1047 times as fast;"
            " drive_speed looks like rpm; give rad/s",
        ),
        (
            "forward.csv",
            ("follower_angle [deg]", "folower_angle [deg]"),
            "forward.csv: line 1: column 4, 'folower_angle', is not a signal of 'example-rig'; did you mean"
            " 'follower_angle'; if it is something else, say [columns] 'folower_angle [deg]' = \"ignore\"",
        ),
        (
            "measured.toml",
            ('mechanism = "nominal.toml"\n', 'mechanism = "nominal.toml"\ncolumns.phi = "ignore"\n'),
            "measured.toml: columns.'phi' is no heading of a data file; the headings are",
        ),
    ],
)
def test_the_messages_about_data_are_the_real_ones(
    name: str, edit: tuple[str, str], message: str, tmp_path: Path
) -> None:
    for file in RIG.iterdir():
        if file.suffix in (".csv", ".toml"):
            shutil.copy(file, tmp_path)
    text = (tmp_path / name).read_text(encoding="utf-8")
    assert edit[0] in text
    (tmp_path / name).write_text(text.replace(*edit), encoding="utf-8")
    shown = CliRunner().invoke(app, ["diagnose", str(tmp_path / "measured.toml"), "--out", str(tmp_path / "out")])
    assert shown.exit_code == 2
    assert message in plain(shown.output)
    assert message in plain((DOCS / "how-to" / "bad-data.md").read_text(encoding="utf-8"))


# ---------------------------------------------------------------- links, pictures and names


def tracked() -> set[Path]:
    """The files of the repository; in a copy without git, such as an archive of a release, those of its folders."""
    if (ROOT / ".git").exists():
        listed = subprocess.run(
            ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
            cwd=ROOT,
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        return {ROOT / name for name in listed.split("\0") if name and (ROOT / name).is_file()}
    return {
        path
        for pattern in ("*", "docs/**/*", "reports/**/*", "sim_models/*", "tests/*")
        for path in ROOT.glob(pattern)
        if path.is_file()
    }


MARKDOWN = sorted(path for path in tracked() if path.suffix == ".md")


def without_code(page: Path) -> str:
    """A page's text without its blocks of code and its spans of code."""
    return re.sub(r"`[^`\n]*`", "", re.sub(r"(?ms)^```.*?^```$", "", page.read_text(encoding="utf-8")))


def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, as GitHub and the site make them."""
    headings = re.findall(r"^#+ +(.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in headings}


def targets(page: Path) -> Iterator[tuple[Path, str]]:
    """Every file that a page links to or shows, and the anchor in it."""
    for target in re.findall(r"\]\(([^)\s]+)\)", without_code(page)):
        if not re.match(r"\w+:", target):
            name, _, anchor = target.partition("#")
            yield (page.parent / name).resolve() if name else page, anchor


@pytest.mark.parametrize("page", MARKDOWN, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_every_link_and_picture_leads_to_a_file_of_the_repository(page: Path) -> None:
    files = tracked()
    for target, anchor in targets(page):
        assert target in files, f"{page}: {target} is not there"
        assert not anchor or anchor in anchors(target), f"{page}: {target} has no heading #{anchor}"


def test_the_reports_show_their_pictures() -> None:
    shown = [target for target, _ in targets(ROOT / "reports" / "README.md") if target.suffix == ".svg"]
    assert len(shown) >= 10  # a drawing and the directions of each case


def test_no_page_shows_or_loads_anything_from_elsewhere() -> None:
    for page in MARKDOWN:
        assert not re.findall(r"!\[[^\]]*\]\(\w+:", without_code(page)), page


# Reports name the code that they were made with.
WRITTEN = [path for path in MARKDOWN if ROOT / "reports" not in path.parents]


@pytest.mark.parametrize("page", WRITTEN, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_every_file_and_every_name_of_the_code_that_a_page_names_exists(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for name in re.findall(r"`((?:analytic|sim_models|compare|docs|tests|\.ci)/[\w./-]*)`", text):
        assert (ROOT / name).exists(), f"{page}: {name}"
    for name in re.findall(r"`((?:analytic|sim_models|compare|linkage_crosscheck)(?:\.\w+)+)`", text):
        assert name == GROUP or resolved(name) is not None, f"{page}: {name}"


def resolved(name: str) -> object:
    """The module, class, function or constant of a dotted name.  Raises ImportError or AttributeError."""
    parts = name.split(".")
    for n in range(len(parts), 0, -1):
        try:
            found: object = import_module(".".join(parts[:n]))
        except ModuleNotFoundError:
            continue
        for part in parts[n:]:
            fields = getattr(found, "__annotations__", {})  # a field without a default is no attribute of its class
            found = fields[part] if part in fields else getattr(found, part)
        return found
    raise ImportError(name)

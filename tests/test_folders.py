"""Where results go: every question has a folder of its own, and nothing replaces what another command has left unless
it is told to.
"""

from __future__ import annotations

import io
import json
import shlex
import shutil
import sys
from pathlib import Path
from typing import Any

import pytest
import typer
from rich.console import Console
from typer.testing import CliRunner

import linkage_crosscheck as lc
from analytic.mechanism.file import dumps, load
from analytic.writing import OutputError
from compare.cli.app import app
from compare.cli.folders import named_after, result_folder
from compare.cli.publish import put
from test_readme import COMMANDS


def context(line: str) -> Any:
    """What typer makes of a command line."""
    root: Any = typer.main.get_command(app)
    parent, (name, *words) = root.make_context("compare", []), [*shlex.split(line)[1:]]
    return (
        root.make_context("compare", [name, *words])
        if name.startswith("-")
        else root.commands[name].make_context(name, words, parent=parent)
    )


def folder(line: str, stem: str, file: str = "result.json", out: Path | None = None) -> Path:
    return result_folder(context(line), stem, file, out, overwrite=False)


@pytest.fixture
def compare(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """The command, run in an empty folder: its exit status and what it says on standard error, but for what of the
    linkage it leaves out.
    """
    monkeypatch.chdir(tmp_path)

    def run(line: str) -> tuple[int, str]:
        words = shlex.split(line)[1:]
        monkeypatch.setattr(sys, "argv", ["compare", *words])
        done = CliRunner().invoke(app, words)
        said = (line for line in done.stderr.splitlines(keepends=True) if not line.startswith("left out: "))
        return done.exit_code, "".join(said)

    return run


NAMES = {
    "compare --simulator mujoco": "paper-mujoco",
    "compare --simulator all --json": "paper-all",
    "compare --simulator mujoco --quiet": "paper-mujoco",
    "compare --simulator mujoco --motion driven": "paper-mujoco",
    "compare --simulator mujoco --motion static": "paper-mujoco-static",
    "compare --clearance B=2e-4,E=1e-4 --simulator mujoco": "paper-mujoco-B_2e-4,E_1e-4",
    "compare --simulator mujoco --angles=-20:160:5 --joint contact --flexible": (
        "paper-mujoco-contact-angles_-20_160_5-flexible"
    ),
    "compare --simulator mujoco --tolerance ../my/tol.toml": "paper-mujoco-tolerance_.._my_tol.toml",
    "compare accuracy --samples 20000": "paper-accuracy",
    "compare accuracy --clearance D=1e-4 --seed 7 --output B --output coupler.angle": (
        "paper-accuracy-D_1e-4-output_B,coupler.angle-seed_7"
    ),
    "compare validity --speeds 60,600 --clearances 1e-4 --workers 2": "paper-validity-speeds_60,600-clearances_1e-4",
    "compare diagnose a.toml": "paper-diagnosis",
    "compare predict reports/a/diagnosis.json --speed 5": "paper-predict-speed_5",
    "compare diagnose a.toml --only gravity --only payload@coupler --simulator exudyn": (
        "paper-diagnosis-exudyn-only_gravity,payload@coupler"
    ),
}


@pytest.mark.parametrize("line", NAMES)
def test_a_default_folder_is_named_after_what_is_not_at_its_default(line: str) -> None:
    stem = "-".join(
        ["paper", *(word.replace("diagnose", "diagnosis") for word in line.split()[1:2] if not word.startswith("-"))]
    )
    assert folder(line, stem) == Path("reports") / NAMES[line]


def documented() -> list[str]:
    """Every command line of the README and of the documentation whose folder is left to the command."""
    pages = sorted((Path(__file__).parents[1] / "docs").rglob("*.md"))
    text = "\n".join(page.read_text(encoding="utf-8") for page in pages)
    lines = [line.partition("#")[0].strip() for line in text.splitlines() if line.startswith("compare ")]
    own = [line for line in lines if not {"--out", "<", "...", "\\"} & set(line.split())]
    return list(dict.fromkeys([*COMMANDS, *own]))


def test_the_commands_of_the_documentation_do_not_meet_in_a_folder() -> None:
    asking = [line for line in documented() if line.split()[1] in ("--simulator", "accuracy", "validity", "diagnose")]
    asked: dict[Path, set[tuple[str, ...]]] = {}
    for line in asking:
        stem = f"{line.partition('--case ')[2].split(' ')[0]} {line.split()[1]}"
        asked.setdefault(folder(line, stem), set()).add(tuple(sorted(line.split())))
    assert len(asked) >= 8
    assert [lines for lines in asked.values() if len(lines) > 1] == []


def test_a_name_that_would_be_too_long_is_cut_and_stays_its_own() -> None:
    lines = [
        f"compare --simulator mujoco --clearance {','.join(f'joint-{k}=1e-4' for k in range(40))},Z={size}"
        for size in ("1e-4", "2e-4")
    ]
    first, second = (folder(line, "paper").name for line in lines)
    assert first != second
    assert len(first) == len(second) == 150


QUICK = "compare --simulator mujoco --joint ideal --motion static --angles 30:60:30"


def contents(place: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in place.iterdir()}


@pytest.mark.mujoco
def test_the_same_command_replaces_its_own_report_and_another_only_when_it_is_told_to(
    compare: Any, tmp_path: Path
) -> None:
    assert compare(f"{QUICK} --out here") == (0, "")
    before = contents(tmp_path / "here")
    assert compare(
        "compare --angles=30:60:30 --motion=static --out ./here --joint ideal --case paper --json --simulator mujoco"
    ) == (0, "")
    assert set(contents(tmp_path / "here")) == set(before)
    before = contents(tmp_path / "here")
    status, said = compare(f"{QUICK.replace('60:30', '90:30')} --out here")
    assert status == 2
    assert len(said.splitlines()) == 1
    for words in (
        "--out here",
        "result.json is of another command",
        "--angles=30:60:30 --motion=static",
        "another folder",
        "--overwrite",
    ):
        assert words in said
    assert contents(tmp_path / "here") == before
    assert compare(f"{QUICK.replace('60:30', '90:30')} --out here --overwrite") == (0, "")
    assert (
        len(json.loads((tmp_path / "here" / "result.json").read_text(encoding="utf-8"))["runs"][0]["crank_angle"]) == 3
    )


def test_a_case_that_there_is_not_is_told_before_a_folder_that_is_another_s(compare: Any, tmp_path: Path) -> None:
    (tmp_path / "reports" / "wiper-analysis").mkdir(parents=True)
    (tmp_path / "reports" / "wiper-analysis" / "analysis.json").write_text("{}", encoding="utf-8")
    status, said = compare("compare analyse --case wiper")
    assert (status, "wiper: no such mechanism file or case" in said) == (2, True)


@pytest.mark.mujoco
def test_a_default_folder_follows_the_file_and_not_the_name_in_it(compare: Any, tmp_path: Path) -> None:
    (tmp_path / "rig").mkdir()
    for name, mass in (("one", 0.2), ("two", 0.3), ("rig/one", 0.4)):
        Path(f"{name}.toml").write_text(dumps(load("paper").with_body("crank", mass=mass)), encoding="utf-8")
    for file in ("one.toml", "two.toml", "one.toml"):
        assert compare(f"compare analyse --case {file}")[0] == 0
    assert {path.name for path in (tmp_path / "reports").iterdir()} == {"one-analysis", "two-analysis"}
    status, said = compare("compare analyse --case rig/one.toml")  # two files of one name do not share it silently
    assert status == 2
    assert "--case one.toml" in said
    assert named_after("docs/example-rig/measured.toml") == "example-rig"
    assert named_after("reports/my-rig/diagnosis.json") == "my-rig"
    assert named_after("paper") == "paper"


@pytest.mark.mujoco
def test_accuracy_validity_and_diagnosis_keep_to_the_same_rule(compare: Any, tmp_path: Path) -> None:
    rig = Path(__file__).parent.parent / "docs" / "example-rig" / "measured.toml"
    assert compare("compare accuracy --samples 50 --out here") == (0, "")
    assert compare("compare accuracy --samples 50 --out here") == (0, "")
    other = {
        "accuracy.json": "compare accuracy --samples 60 --out here",
        "validity.json": "compare validity --speeds 60 --clearances 1e-4 --out here",
        "diagnosis.json": f"compare diagnose {rig} --out here",
    }
    for name, line in other.items():
        (tmp_path / "here" / name).write_text(
            json.dumps({"command": "compare accuracy --samples 50"}), encoding="utf-8"
        )
        before = contents(tmp_path / "here")
        status, said = compare(line)
        assert status == 2
        assert f"its {name} is of another command (compare accuracy --samples 50)" in said
        assert contents(tmp_path / "here") == before


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"command": 7}', "[" * 100_000, "\udcff"], ids=repr)
def test_a_file_that_does_not_say_what_made_it_is_not_replaced(text: str, tmp_path: Path) -> None:
    (tmp_path / "result.json").write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(
        OutputError, match=r"does not say which command made it; choose another folder with --out, or add --overwrite"
    ):
        folder(QUICK, "paper", out=tmp_path)


@pytest.mark.parametrize(
    "made_by",
    ["", "compare 'open", "rm -rf /", "compare --help", "compare \x1b[2J --simulator mujoco", "compare baseline check"],
)
def test_whatever_a_file_says_that_made_it_is_only_compared(
    made_by: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "result.json").write_text(json.dumps({"command": made_by}), encoding="utf-8")
    with pytest.raises(OutputError, match="is of another command") as caught:
        folder(QUICK, "paper", out=tmp_path)
    assert str(caught.value).isprintable()
    assert capsys.readouterr() == ("", "")


READ = {
    "compare import in.xml --out ./in.xml": "in.xml",
    "compare analyse --case in.toml --course signals.csv --out .": "signals.csv",
    "compare simulate --case in.toml --simulator mujoco --path linked.csv --out .": "signals.csv",
    "compare check signals.csv --case in.toml --out .": "signals.csv",
    "compare --case in.toml --simulator exudyn,mjcf:junit.xml --out .": "junit.xml",
    "compare diagnose --init signals.csv --case in.toml --out in.toml": "in.toml",
    "compare baseline check --case in.toml --results junit.xml --junit junit.xml": "junit.xml",
    "compare export --case in.toml --simulator mujoco --course run.py --out .": "run.py",
}


@pytest.mark.long_rows(
    "compare export --case in.toml --simulator mujoco --course run.py --out .", "compare import in.xml --out ./in.xml",
    "compare analyse --case in.toml --course signals.csv --out .",
    "compare simulate --case in.toml --simulator mujoco --path linked.csv --out .",
    "compare check signals.csv --case in.toml --out .",
    "compare --case in.toml --simulator exudyn,mjcf:junit.xml --out .",
)  # fmt: skip
@pytest.mark.mujoco
@pytest.mark.parametrize("line", READ)
def test_a_file_that_is_read_is_never_written(line: str, compare: Any, tmp_path: Path) -> None:
    lc.export("crank-rocker", "mujoco", motion="static", folder=tmp_path)
    shutil.copy(tmp_path / "model.xml", tmp_path / "in.xml")
    shutil.copy(tmp_path / "model.xml", tmp_path / "junit.xml")
    (tmp_path / "in.toml").write_text(dumps(load("crank-rocker")), encoding="utf-8")
    (tmp_path / "signals.csv").write_text("time (s),crank_angle (deg)\n0,10\n0.1,11\n", encoding="utf-8")
    course = "".join(f"{t / 100},{30 + t}\n" for t in range(21))
    (tmp_path / "run.py").write_text(f"time (s),position_D (deg)\n{course}", encoding="utf-8")
    (tmp_path / "linked.csv").symlink_to("signals.csv")
    before = contents(tmp_path)
    status, said = compare(line + " --overwrite" * ("baseline" not in line))
    assert status == 2
    assert f"{READ[line]}: the command reads that file; choose another one with --" in said
    assert contents(tmp_path) == before


@pytest.mark.mujoco
def test_an_export_replaces_its_own_files_and_no_others(compare: Any, tmp_path: Path) -> None:
    line = "compare export --simulator mujoco --motion static --angles 30:60:30 --out alone"
    assert compare(line)[0] == 0
    before = contents(tmp_path / "alone")
    assert compare(line)[0] == 0
    assert contents(tmp_path / "alone") == before
    (tmp_path / "alone" / "run.py").write_text("print('mine')\n", encoding="utf-8")
    before = contents(tmp_path / "alone")
    status, said = compare(line)
    assert status == 2
    assert "--out alone: there is another run.py" in said
    assert contents(tmp_path / "alone") == before
    assert compare(f"{line} --overwrite")[0] == 0
    assert contents(tmp_path / "alone")["run.py"] != before["run.py"]


@pytest.mark.mujoco
def test_the_signals_of_a_report_are_not_replaced_by_those_of_one_side(compare: Any, tmp_path: Path) -> None:
    assert compare(f"{QUICK} --out here")[0] == 0
    before = contents(tmp_path / "here")
    for line, file in (("analyse", "an analysis.json"), ("simulate", "a simulation.json")):
        status, said = compare(f"compare {line} --motion static --out here")
        assert (status, said) == (
            2,
            f"compare: --out here: there is another signals.csv, without {file} beside it; choose another folder with"
            " --out, or add --overwrite\n",
        )
        assert contents(tmp_path / "here") == before
    assert compare("compare accuracy --samples 50 --out here")[0] == 0  # none of its files is there
    assert compare("compare analyse --motion static --out here --overwrite")[0] == 0
    assert contents(tmp_path / "here")["signals.csv"] != before["signals.csv"]


def test_of_two_commands_that_begin_in_one_folder_the_second_to_end_is_refused(compare: Any, tmp_path: Path) -> None:
    asked = context("compare analyse --motion static --out here")
    place = result_folder(asked, "paper-analysis", "analysis.json", tmp_path / "here", overwrite=False)
    assert compare("compare analyse --case crank-rocker --motion static --out here")[0] == 0
    before = contents(tmp_path / "here")
    found = lc.analyse("paper", motion="static")
    with pytest.raises(
        OutputError, match=r"its analysis\.json is of another command \(compare analyse --case crank-rock"
    ):
        put(found, place, False, asked)
    assert contents(tmp_path / "here") == before


def test_of_one_command_that_is_given_twice_at_once_the_last_to_end_stays(compare: Any, tmp_path: Path) -> None:
    asked = context("compare analyse --out=here --motion=static")
    place = result_folder(asked, "paper-analysis", "analysis.json", tmp_path / "here", overwrite=False)
    assert compare("compare analyse --motion static --out here")[0] == 0
    before = contents(tmp_path / "here")
    put(lc.analyse("paper", motion="static"), place, False, asked)
    after = contents(tmp_path / "here")
    assert set(after) == set(before)
    assert after["signals.csv"] == before["signals.csv"]


OTHERS = {"notes.txt": "mine\n", "gamma_Z.svg": "<svg/>", "run.py": "print(1)\n"}  # of a person


@pytest.mark.mujoco
def test_a_report_that_is_replaced_goes_with_all_its_pictures_and_nothing_else(compare: Any, tmp_path: Path) -> None:
    assert compare(f"{QUICK} --case slider-crank --out alone")[0] == 0
    assert compare(f"{QUICK} --case crank-rocker --out here")[0] == 0
    assert set(contents(tmp_path / "here")) - set(contents(tmp_path / "alone"))
    for name, text in OTHERS.items():
        (tmp_path / "here" / name).write_text(text, encoding="utf-8")
    assert compare("compare accuracy --samples 50 --out here")[0] == 0
    assert compare(f"{QUICK} --case slider-crank --out here --overwrite") == (0, "")
    own = {"accuracy.json", "accuracy.csv", "accuracy.html", *OTHERS}  # a whole result that lost nothing stays
    assert set(contents(tmp_path / "here")) == set(contents(tmp_path / "alone")) | own
    assert compare("compare analyse --motion static --out here --overwrite")[0] == 0  # takes signals.csv
    own |= set(lc.analyse("paper", motion="static").files())
    assert set(contents(tmp_path / "here")) == own
    lc.accuracy("crank-rocker", samples=50).write("here", overwrite=True)
    assert set(contents(tmp_path / "here")) == own


@pytest.mark.mujoco
def test_a_file_that_is_edited_replaces_its_own_report_with_all_its_pictures(compare: Any, tmp_path: Path) -> None:
    for case in ("crank-rocker", "slider-crank"):
        Path("mine.toml").write_text(dumps(load(case)), encoding="utf-8")
        assert compare(f"{QUICK} --case mine.toml")[0] == 0
    assert compare(f"{QUICK} --case slider-crank --out alone")[0] == 0
    (mine,) = (tmp_path / "reports").iterdir()
    assert set(contents(mine)) == set(contents(tmp_path / "alone"))


def test_what_cannot_be_read_is_replaced_alone(tmp_path: Path) -> None:
    """Nobody knows which files are a stranger's own."""
    (tmp_path / "analysis.json").write_text('{"schema": 1, "case": "mine"}', encoding="utf-8")
    (tmp_path / "gamma_A.svg").write_text("<svg/>", encoding="utf-8")
    found = lc.analyse("paper", motion="static")
    put(found, tmp_path, True, context("compare analyse --motion static"))
    assert set(contents(tmp_path)) == {*found.files(), "gamma_A.svg"}


def test_a_file_that_shows_up_while_a_command_computes_is_not_replaced(tmp_path: Path) -> None:
    found, asked = lc.analyse("paper", motion="static"), context("compare analyse --motion static")
    (tmp_path / "signals.csv").write_text("mine\n", encoding="utf-8")
    with pytest.raises(OutputError, match=r"there is another signals\.csv"):
        put(found, tmp_path, False, asked)
    assert contents(tmp_path) == {"signals.csv": b"mine\n"}
    put(found, tmp_path, True, asked)
    assert len(contents(tmp_path)["signals.csv"]) > 100


def test_python_keeps_to_the_same_rule(compare: Any, tmp_path: Path) -> None:
    assert compare("compare analyse --motion static --out here")[0] == 0
    before = contents(tmp_path / "here")
    found = lc.analyse("paper")
    refused = (
        r"its analysis.json is of another command \(compare analyse .*; choose another folder, or give overwrite=True"
    )
    with pytest.raises(OutputError, match=refused):
        found.write("here")
    assert contents(tmp_path / "here") == before
    found.write("here", overwrite=True)
    assert contents(tmp_path / "here") != before
    lc.analyse("crank-rocker").write("here")  # Python's own
    assert json.loads((tmp_path / "here" / "analysis.json").read_text(encoding="utf-8"))["case"] == "crank-rocker"
    status, said = compare("compare analyse --motion static --out here")
    assert (status, "an analysis.json that does not say which command made it" in said) == (2, True)
    (tmp_path / "there").mkdir()
    for name, words in (("signals.csv", "another signals.csv"), ("analysis.json", "does not say which command")):
        (tmp_path / "there" / name).write_text("mine\n", encoding="utf-8")
        with pytest.raises(OutputError, match=words):
            found.write("there")


def test_a_list_replaces_only_a_list(tmp_path: Path) -> None:
    lc.cases().write(tmp_path)
    lc.cases().write(tmp_path)
    (tmp_path / "cases.json").write_text("{}", encoding="utf-8")
    with pytest.raises(OutputError, match=r"a cases\.json that does not say which command made it"):
        lc.cases().write(tmp_path)


ODD = "[/x] :smiley: [red]"  # would be an end without a beginning, a picture and nothing, if they were markup


@pytest.mark.mujoco
@pytest.mark.parametrize(
    "line",
    [
        f"{QUICK} --case mine.toml",
        "compare accuracy --case mine.toml --samples 50",
        "compare analyse --case mine.toml",
        "compare simulate --case mine.toml --motion static",
        "compare export --case mine.toml --simulator mujoco --motion static --angles 30:60:30",
        "compare list",
    ],
)
def test_brackets_and_colons_of_names_and_paths_are_printed_as_they_are(
    line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mine.toml").write_text(dumps(load("paper").replace(name=ODD)), encoding="utf-8")
    place = "[/x]/:smiley:/[red]"
    if line == "compare list":
        lc.crosscheck("mine.toml", joint_model="ideal", angles=[0.5, 0.6]).write(place)
        words = ["list", place]
    else:
        words = [*shlex.split(line)[1:], "--out", place]
    monkeypatch.setattr(sys, "argv", ["compare", *words])
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0
    assert all(text.startswith("left out: ") for text in done.stderr.splitlines())
    assert place in done.stdout
    assert line.startswith("compare export") or ODD in done.stdout


def test_a_persons_own_console_is_not_told_to_read_markup_either() -> None:
    console = Console(file=io.StringIO(), width=200)
    with console.capture() as printed:
        lc.analyse(load("paper").replace(name=ODD), motion="static").print_to(console)
    assert ODD in printed.get()
    console.print("[bold]:smiley:")
    assert console.file.getvalue() == "\U0001f603\n"  # type: ignore[attr-defined]

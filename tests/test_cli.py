"""The real command, as a person runs it: statuses, messages, files."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import typer

from analytic.mechanism import Ripple
from analytic.mechanism.file import dumps, load
from commands import Ended, assert_refused, compare, compare_alone, without
from compare.cli.app import app
from compare.cli.folders import spelled_out
from compare.faults import Exit
from marks import slow

pytestmark = pytest.mark.mujoco


def saved(folder: Path, text: str) -> str:
    path = folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return str(path)


PAPER = dumps(load("paper"))

BAD_INPUT = {
    "missing file": (["--case", "nowhere.toml"], ["nowhere.toml", "no such mechanism file"]),
    "unknown simulator": (["--simulator", "adams"], ["'adams'", "mujoco"]),
    "unknown joint model": (["--joint", "rubber"], ["rubber", "contact"]),
    "unknown option": (["--spead", "3"], ["--spead"]),
    "angles that are no range": (["--angles", "20-160"], ["--angles 20-160", "start:stop:step"]),
    "angles that run backwards": (["--angles", "160:20:5"], ["--angles 160:20:5", "stop"]),
    "a change point in the range": (
        ["--angles", "20:200:5"],
        ["change point at crank angle 180 deg", "keep the range"],
    ),
    "an unreachable clearance joint": (["--clearance", "Q=1e-4"], ["Q=1e-4", "D, A, B, E"]),
    "a clearance without a number": (["--clearance", "B"], ["--clearance B", "JOINT=metres"]),
    "a negative clearance": (["--clearance", "B=-1e-4"], ["B=-1e-4", "0 or more"]),
    "a clearance larger than a link": (["--clearance", "B=0.5"], ["joint 'B'", "0.5", "not smaller than body"]),
    "a clearance that is large beside a link": (
        ["--case", "crank-rocker", "--clearance", "D=0.0051"],
        [
            "--clearance D=0.0051: joint 'D'",
            "0.0051 m, more than a tenth of body 'crank' (0.05 m)",
            "--large",
        ],
    ),
    "a clearance joint model for a linkage that swings freely": (
        ["--case", "pendulum", "--clearance", "O=1e-4", "--joint", "contact"],
        ["--joint contact", "pendulum swings freely", "leave the joint model out"],
    ),
    "a missing tolerance file": (["--tolerance", "none.toml"], ["--tolerance none.toml", "cannot be read"]),
    "angles out of all bounds": (["--joint", "ideal", "--angles", "1e17:1e17:1"], ["--angles 1e17", "1e+06"]),
    "a joint model without a clearance": (["--case", "crank-rocker", "--joint", "contact"], ["contact", "--clearance"]),
}


@pytest.mark.parametrize(
    ("run", "arguments", "words"),
    [(compare, *row) for row in BAD_INPUT.values()] + [(compare_alone, *BAD_INPUT["unknown option"])],
    ids=[*BAD_INPUT, "unknown option, in a process of its own"],
)
def test_bad_input_gets_one_sentence_and_status_2(
    run: Callable[..., Ended], arguments: list[str], words: list[str], tmp_path: Path
) -> None:
    with_simulator = arguments if "--simulator" in arguments else ["--simulator", "mujoco", *arguments]
    done = run(*with_simulator, "--out", "out", cwd=tmp_path)
    assert_refused(done, *words)
    assert done.stdout == ""
    assert not list((tmp_path / "out").glob("*")) if (tmp_path / "out").exists() else True


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("mass = 0.157", "mass = -0.157", ["mine.toml", "body[crank].mass", "-0.157"]),
        ("mass = 0.157", "mass = 0", ["mine.toml", "body[crank].mass = 0", "counts as massless", "1e-6 kg"]),
        ("mass = 0.157", "weight = 0.157", ["mine.toml", "body[crank].weight", "not a field"]),
        ("gravity", "gravy", ["mine.toml", "gravy", "gravity"]),
    ],
)
def test_a_faulty_file_is_named_with_its_field(old: str, new: str, words: list[str], tmp_path: Path) -> None:
    text = "gravity = [0.0, 0.0]\n" + PAPER
    done = compare("--simulator", "mujoco", "--case", saved(tmp_path, text.replace(old, new, 1)), cwd=tmp_path)
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1
    for word in words:
        assert word in done.stderr


def test_a_loop_that_cannot_close_is_refused(tmp_path: Path) -> None:
    broken = load("paper").with_clearances({}).with_body("coupler", points={"A": (0.0, 0.0), "B": (0.03, 0.0)})
    done = compare("--simulator", "mujoco", "--case", saved(tmp_path, dumps(broken)), cwd=tmp_path)
    assert done.returncode == 2
    assert "cannot be reached" in done.stderr


def test_an_output_folder_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way", encoding="utf-8")
    done = compare("--simulator", "mujoco", "--out", "file/report", cwd=tmp_path)
    assert done.returncode == 2
    assert "--out" in done.stderr
    assert "another folder" in done.stderr


def test_an_engine_that_is_not_installed_is_status_3_with_the_install_command(tmp_path: Path) -> None:
    with without("mujoco"):
        done = compare("--simulator", "mujoco", cwd=tmp_path)
    assert done.returncode == 3
    assert "pip install 'linkage-crosscheck[mujoco]'" in done.stderr


def test_help_and_lists_need_no_engine(tmp_path: Path) -> None:
    script = (
        "import sys; sys.argv = ['compare', '--help']\nfrom compare.cli.app import main\ntry:\n    main()\nexcept"
        " SystemExit:\n    pass\n"
    )
    script += (
        "heavy = {'mujoco', 'numpy', 'scipy', 'pydantic', 'matplotlib', 'jinja2'} & set(sys.modules)\nassert not heavy,"
        " heavy"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "--simulator" in done.stdout
    listed = compare("cases", cwd=tmp_path)
    assert listed.returncode == 0
    assert {"paper", "crank-rocker", "slider-crank", "pendulum", "six-bar", "quick-return"} <= {
        line.split()[0] for line in listed.stdout.splitlines()
    }


def test_the_main_job_agrees_and_leaves_a_whole_report(tmp_path: Path) -> None:
    done = compare_alone("--simulator", "mujoco", cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    folder = tmp_path / "reports" / "paper-mujoco"
    assert {"result.json", "report.md", "report.html", "junit.xml"} <= {p.name for p in folder.iterdir()}
    result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    assert result["schema"] == 1
    assert [run["joint_model"] for run in result["runs"]] == ["ideal", "massless-link", "spring-damper", "contact"]
    assert all(run["clearance"] == {"B": 0.01} for run in result["runs"][1:])
    assert all(len(run["crank_angle"]) == 29 for run in result["runs"])
    assert "equilibrium" in done.stdout
    assert "reaction" in done.stdout


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        ("paper --simulator mujoco", "--case paper --simulator mujoco"),
        ("--simulator mujoco -q own.toml", "--case own.toml --simulator mujoco -q"),
        ("--motion static own.toml", "analyse --case own.toml --motion static"),
        ("own.toml --plot f.svg", "analyse --case own.toml --plot f.svg"),
        ("show own.toml", "show own.toml"),
        ("accuracy own.toml --output rod", "accuracy --case own.toml --output rod"),
        ("accuracy -q own.toml", "accuracy -q --case own.toml"),
        ("accuracy --clearance B=1e-4 own.toml -q", "accuracy --clearance B=1e-4 --case own.toml -q"),
        ("accuracy --clearance=B=1e-4 paper", "accuracy --clearance=B=1e-4 --case paper"),
        ("accuracy --plot own.toml", "accuracy --plot own.toml"),  # a file to write
        ("analyse paper crank-rocker", "analyse --case paper crank-rocker"),  # one too many, which is said
        ("analyse rig", "analyse rig"),
        ("check own.csv", "check own.csv"),
        ("--case paper own.toml", "--case paper own.toml"),  # one too many, which is said
        ("--simulator own.toml", "--simulator own.toml"),  # a simulator's name
    ],
)
def test_a_linkage_by_its_name_alone_is_analysed_and_with_a_simulator_cross_checked(typed: str, meant: str) -> None:
    root = typer.main.get_command(app)
    assert isinstance(root, typer.core.TyperGroup)
    assert spelled_out(typed.split(), root) == meant.split()


def test_a_file_that_is_named_without_its_ending_is_hinted_at(tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text("", encoding="utf-8")
    assert_refused(compare("rig", cwd=tmp_path), "No such command 'rig'; did you mean rig.toml?")
    assert_refused(compare("analyse", "rig", cwd=tmp_path), "(rig); a linkage is named with --case rig.toml")
    assert_refused(
        compare("accuracy", "--case", "rig", cwd=tmp_path), "no such mechanism file or case; did you mean 'rig.toml'"
    )


def test_an_option_of_the_cross_check_given_to_an_analysis_says_so(tmp_path: Path) -> None:
    said = "--joint is of a cross-check: compare LINKAGE.toml --simulator mujoco --joint"
    assert_refused(compare("paper", "--joint", "contact", cwd=tmp_path), said)
    assert_refused(compare("paper", "--simulators", "mujoco", cwd=tmp_path), "Possible options: --simulator")


def test_json_goes_to_standard_output_and_nothing_else_does(tmp_path: Path) -> None:
    done = compare_alone(
        "--simulator",
        "mujoco",
        "--joint",
        "ideal",
        "--angles",
        "30:60:10",
        "--motion",
        "static",
        "--json",
        "--out",
        "here",
        cwd=tmp_path,
    )
    result = json.loads(done.stdout)
    assert done.returncode == 0
    assert all(line.startswith("left out: ") for line in done.stderr.splitlines()), done.stderr
    assert result == json.loads((tmp_path / "here" / "result.json").read_text(encoding="utf-8"))
    assert result["runs"][0]["crank_angle"] == pytest.approx(
        [0.5235987755982988, 0.6981317007977318, 0.8726646259971648, 1.0471975511965976]
    )


def test_the_papers_first_order_is_found_to_disagree(tmp_path: Path) -> None:
    done = compare(
        "--simulator",
        "mujoco",
        "--analytic",
        "first_order",
        "--motion",
        "static",
        "--joint",
        "contact",
        "--out",
        "o",
        cwd=tmp_path,
    )
    assert done.returncode == 1
    result = json.loads((tmp_path / "o" / "result.json").read_text(encoding="utf-8"))
    (gamma,) = (d for d in result["runs"][0]["discrepancies"] if d["signal"] == "reaction_B_angle")
    assert gamma["verdict"] == "disagrees"
    assert abs(gamma["max"]) == pytest.approx(0.1231, abs=2e-3)  # 7.06 deg
    assert gamma["max"] > 0  # simulated minus analytic: the real pin lies further round


def test_a_released_pendulum_is_compared_over_time(tmp_path: Path) -> None:
    done = compare("--simulator", "mujoco", "--case", "pendulum", "--out", "o", cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    run = json.loads((tmp_path / "o" / "result.json").read_text(encoding="utf-8"))["runs"][0]
    assert len(run["time"]) == len(run["simulated"]["pendulum_angle"]) == 101


@pytest.mark.long_rows("1e-4-spring-damper-left out: friction of joint B, as only contact joints rub")
@pytest.mark.parametrize(
    ("clearance", "joint", "says"),
    [
        ("0", "ideal", "left out: friction of joint B, as a pin without clearance"),
        ("1e-4", "spring-damper", "left out: friction of joint B, as only contact joints rub"),
    ],
)
def test_friction_that_no_joint_model_of_the_run_has_is_said(
    clearance: str, joint: str, says: str, tmp_path: Path
) -> None:
    (tmp_path / "rough.toml").write_text(dumps(load("paper").with_joint("B", friction=0.1)), encoding="utf-8")
    flags = ["--clearance", f"B={clearance}", "--joint", joint, "--motion", "static", "--angles", "20:40:20"]
    done = compare("--case", "rough.toml", "--simulator", "mujoco", *flags, cwd=tmp_path)
    assert done.returncode == 0
    assert says in done.stderr


def test_a_run_that_failed_is_no_disagreement(tmp_path: Path) -> None:
    flags = ["--clearance", "B=1e-30", "--joint", "contact", "--angles", "20:40:10", "--out", "o"]
    assert compare("--simulator", "mujoco", *flags, cwd=tmp_path).returncode == Exit.SIMULATOR_FAILED
    result = json.loads((tmp_path / "o" / "result.json").read_text(encoding="utf-8"))
    assert (result["verdict"], len(result["runs"]), len(result["failures"])) == ("unjudged", 0, 1)


def test_clearance_of_a_linkage_that_swings_freely_is_left_out_aloud(tmp_path: Path) -> None:
    done = compare("--simulator", "mujoco", "--case", "pendulum", "--clearance", "O=1e-4", "--out", "o", cwd=tmp_path)
    assert done.returncode == 0
    assert "clearance in O is left out" in done.stderr
    assert "clearance in O is left out" in (tmp_path / "o" / "report.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("engine", ["mujoco", *slow("pybullet")])
def test_friction_has_no_direction_at_a_dead_centre_and_nothing_is_judged_there(engine: str, tmp_path: Path) -> None:
    rubbing = load("slider-crank").with_joint("S", friction_torque=20.0)
    done = compare(
        "--simulator", engine, "--case", saved(tmp_path, dumps(rubbing)), "--joint", "ideal", "--out", "o", cwd=tmp_path
    )
    assert done.returncode == 0, done.stdout + done.stderr
    run = json.loads((tmp_path / "o" / "result.json").read_text(encoding="utf-8"))["runs"][0]
    assert list(run["flags"]) == ["0", "36"]  # 0 and 180 deg
    assert all("S stands or reverses" in why for why in run["flags"].values())
    assert run["analytic"]["reaction_B_x"][0] is None
    assert run["analytic"]["reaction_B_x"][1] is not None


def test_a_file_that_begins_as_windows_has_it_is_read(tmp_path: Path) -> None:
    path = saved(tmp_path, "\ufeff" + PAPER)
    done = compare(
        "--simulator", "mujoco", "--case", path, "--joint", "ideal", "--angles", "30:60:30", "--out", "o", cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr


def test_an_unforeseen_fault_is_no_disagreement(tmp_path: Path) -> None:
    broken = "import compare.cli.app as cli; cli.app = lambda **_: 1 / 0; cli.main()"
    done = subprocess.run([sys.executable, "-c", broken], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 3
    assert "unforeseen fault (ZeroDivisionError: division by zero)" in done.stderr


@pytest.mark.parametrize(("field", "value"), [("stiffness", 100.0), ("ripple", Ripple(amplitude=0.01, harmonic=2))])
def test_a_drive_is_taken_as_rigid_and_even_and_the_user_is_told(field: str, value: object, tmp_path: Path) -> None:
    m = load("paper")
    own = m.replace(drive=m.drive.model_copy(update={field: value}))
    arguments = ["--motion", "static", "--joint", "ideal", "--angles", "30:60:15", "--out", "o"]
    done = compare("--simulator", "mujoco", "--case", saved(tmp_path, dumps(own)), *arguments, cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"drive.{field} is left out" in done.stderr
    result = json.loads((tmp_path / "o" / "result.json").read_text(encoding="utf-8"))
    (warning,) = (text for text in result["warnings"] if not text.startswith("left out: "))
    assert f"drive.{field}" in warning
    assert field not in result["mechanism"]["drive"]


def test_a_cross_check_whose_only_simulation_fails_says_so_everywhere(tmp_path: Path) -> None:
    arguments = [
        "--case",
        "crank-rocker",
        "--joint",
        "contact",
        "--clearance",
        "B=1e-4",
        "--motion",
        "static",
        "--angles",
        "30:30:1",
    ]
    done = compare("--simulator", "mujoco", *arguments, "--out", "o", cwd=tmp_path)
    assert_refused(done, "nothing presses the pin of joint 'B'", status=3)
    page, text, junit = (
        (tmp_path / "o" / name).read_text(encoding="utf-8") for name in ("report.html", "report.md", "junit.xml")
    )
    for said in (page, text, done.stdout):
        assert "nothing was compared" in said
        assert "every position was compared" not in said
    assert "No simulation" in text
    assert 'errors="1"' in junit
    assert "nothing presses the pin" in junit
    assert json.loads((tmp_path / "o" / "result.json").read_text(encoding="utf-8"))["runs"] == []


NO_ANSWER = [
    "--case",
    "slider-crank",
    "--clearance",
    "A=1e-4",
    "--angles",
    "300:300:5",
    "--joint",
    "spring-damper",
    "--revolutions",
    "0",
]


def test_a_run_in_which_nothing_could_be_compared_does_not_agree_and_says_why(tmp_path: Path) -> None:
    done = compare("--simulator", "mujoco", *NO_ANSWER, "--out", "o", cwd=tmp_path)
    assert done.returncode == 1
    assert all(
        line.startswith("left out: ") or "beyond its rim" in line for line in done.stderr.splitlines()
    )  # its pin hits the wall hard
    page, text, junit = (
        (tmp_path / "o" / name).read_text(encoding="utf-8") for name in ("report.html", "report.md", "junit.xml")
    )
    terminal = " ".join(done.stdout.split())
    assert "slider-crank: NOT JUDGED. Nothing could be compared in 1 of 1 run; mujoco, spring-damper: " in terminal
    for said in (terminal, text.replace("\\", ""), page, junit):
        assert "the analytic model has no answer at any crank angle: the reaction at A turns too fast" in said
        assert "Without clearance first order and equilibrium are the same" not in said
    assert text.startswith("# ? Cross-check of slider-crank: not judged")
    assert 'tests="1" failures="1" errors="0"' in junit
    result = json.loads((tmp_path / "o" / "result.json").read_text(encoding="utf-8"))
    assert (result["verdict"], result["runs"][0]["verdict"], result["runs"][0]["discrepancies"]) == (
        "unjudged",
        "unjudged",
        [],
    )


def test_a_known_difference_that_cannot_be_judged_or_has_vanished_is_said_in_the_last_line_and_in_the_report(
    tmp_path: Path,
) -> None:
    (tmp_path / "known.toml").write_text(
        "".join(
            f'[[known]]\ncase = "{case}"\nsignal = "{signal}"\nbound = 0.13\nreason = "once it was so"\n'
            for case, signal in KNOWN
        ),
        encoding="utf-8",
    )
    unjudged = compare("--simulator", "mujoco", *NO_ANSWER, "--tolerance", "known.toml", "--out", "a", cwd=tmp_path)
    vanished = compare(
        "--simulator",
        "mujoco",
        "--joint",
        "ideal",
        "--motion",
        "static",
        "--tolerance",
        "known.toml",
        "--out",
        "b",
        cwd=tmp_path,
    )
    for done, folder, words in (
        (
            unjudged,
            "a",
            "reaction angle at A (mujoco, spring-damper): known difference cannot be judged: at no angle of the run",
        ),
        (
            vanished,
            "b",
            (
                "1 of 12 comparisons in 1 of 1 run disagrees: reaction angle at B (mujoco, ideal): known difference has"
                " vanished"
            ),
        ),
    ):
        assert done.returncode == 1
        last = " ".join(done.stdout.split()).partition("DISAGREES. ")[2]
        for said in (last, (tmp_path / folder / "report.md").read_text(encoding="utf-8").splitlines()[2]):
            assert words in said
            assert "exceed" not in said


KNOWN = (("paper", "reaction_B_angle"), ("slider-crank", "reaction_A_angle"))


def test_a_run_that_failed_is_in_the_last_line_beside_the_runs_that_agree(tmp_path: Path) -> None:
    arguments = ["--case", "crank-rocker", "--clearance", "B=1e-4", "--motion", "static", "--angles", "30:40:5"]
    done = compare("--simulator", "mujoco", *arguments, "--out", "o", cwd=tmp_path)
    assert done.returncode == 3
    assert (
        "crank-rocker: FAILED. 3 of 4 runs failed. All 8 judged comparisons of 1 run are within tolerance."
        in " ".join(done.stdout.split())
    )
    text = (tmp_path / "o" / "report.md").read_text(encoding="utf-8")
    assert text.startswith("# ✗ Cross-check of crank-rocker: failed\n\n3 of 4 runs failed. ")


def test_a_contact_too_soft_for_its_clearance_is_warned_of(tmp_path: Path) -> None:
    arguments = ["--motion", "static", "--joint", "spring-damper", "--angles", "30:30:1"]
    soft = load("paper").with_joint("B", contact_stiffness=1e8)
    (tmp_path / "soft.toml").write_text(dumps(soft), encoding="utf-8")
    done = compare(
        "--simulator",
        "mujoco",
        "--case",
        "soft.toml",
        *arguments,
        "--clearance",
        "B=7e-7",
        "--out",
        "soft",
        cwd=tmp_path,
    )
    words = (
        "times its clearance: too soft to see this clearance; give joint B contact_stiffness = 7.1e+08 (N/m) or more"
    )
    assert words in done.stderr
    assert words in (tmp_path / "soft" / "report.md").read_text(encoding="utf-8").replace("\\", "")
    stiff = compare("--simulator", "mujoco", *arguments, "--clearance", "B=1e-4", "--out", "stiff", cwd=tmp_path)
    assert all(line.startswith("left out: ") for line in stiff.stderr.splitlines()), stiff.stderr

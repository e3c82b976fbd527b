"""Somebody's own MJCF file as an engine: our exports and a four-bar written in many ways, seeded faults, refusals."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import linkage_crosscheck as lc
from analytic.mechanism import Mechanism
from analytic.mechanism.file import dumps, load, loads, shipped_cases
from asked import request_of
from compare.cli.app import app
from mjcf_files import BAR, MASS, PLAIN, WAYS, written
from sim_models.engine import SimulationError, Unsupported, declared, engine
from sim_models.mjcf.errors import MjcfError
from sim_models.mjcf.imported import imported

pytestmark = pytest.mark.mujoco
STIFF = '<option timestep="2e-4"/><default><equality solref="8e-4 1" solimp="0.9999 0.9999 0.001 0.5 2"/></default>'
WEIGHTLESS = STIFF.replace("/>", ' gravity="0 0 0"/>', 1)
BALL = 'type="sphere" density="7850" contype="0" conaffinity="0"'
ANGLES = np.radians(np.arange(0.0, 360.0, 15.0))


CRANKED = [case for case in shipped_cases() if load(case).cranked]  # the export knows no others yet


@pytest.fixture(scope="module")
def exports(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("exports")
    for case in CRANKED:
        lc.export(case, "mujoco", folder=folder / case)
    return folder


FOUR_BAR = f"""
name = "by hand"
gravity = [0.0, 0.0]
ground = {{ points = {{ D = [0.0, 0.0], E = [0.12, 0.0] }} }}
assembly = {{ crank = -1.5708, coupler = -2.1574, follower = 0.6792 }}
drive = {{ joint = "D", speed = 6.25 }}

[[body]]
name = "crank"
points = {{ A = [0.0, 0.0], D = [0.0, -0.05] }}
mass = {MASS[0.05]!r}
section = [0.01, 0.01]

[[body]]
name = "coupler"
points = {{ A = [0.1, 0.1], B = [-0.02, 0.1] }}
mass = {MASS[0.12]!r}
section = [0.01, 0.01]

[[body]]
name = "follower"
points = {{ E = [0.0, 0.0], B = [0.06, 0.08] }}
mass = {MASS[0.1]!r}
section = [0.01, 0.01]

[[joint]]
name = "D"
type = "revolute"
bodies = ["crank", "ground"]

[[joint]]
name = "A"
type = "revolute"
bodies = ["crank", "coupler"]

[[joint]]
name = "B"
type = "revolute"
bodies = ["coupler", "follower"]

[[joint]]
name = "E"
type = "revolute"
bodies = ["ground", "follower"]
"""


def by_hand(gravity: tuple[float, float] = (0.0, 0.0)) -> Mechanism:
    """The four-bar of the files, with bodies' frames and an order of bodies in a joint that no file has."""
    return loads(FOUR_BAR).replace(gravity=gravity)


def with_option(text: str, option: str) -> str:
    """An MJCF file with these elements before its own."""
    return re.sub(r"(<mujoco[^>]*>)", rf"\1{option}", text, count=1)


# ------------------------------------------------------------------ it agrees where it must


MOTIONS = [(case, motion) for case in CRANKED for motion in ("driven", "static")]


@pytest.mark.long_rows(
    "six-bar-driven", "paper-driven", "slider-crank-driven", "crank-rocker-driven", "pendulum-driven", "six-bar-static",
)  # fmt: skip
@pytest.mark.parametrize(("case", "motion"), [each for each in MOTIONS if each != ("pendulum", "static")])
def test_an_export_agrees_with_the_analytic_model(case: str, motion: str, exports: Path) -> None:
    result = lc.crosscheck(case, f"mjcf:{exports / case / 'model.xml'}", motion=motion)
    assert result.verdict == "agrees"
    assert len(result.runs) == 1
    assert all(abs(d.share or 0.0) < 0.2 for d in result.runs[0].discrepancies)


@pytest.mark.parametrize("case", ["crank-rocker", "slider-crank"])
def test_an_export_with_laws_of_joints_agrees(case: str, tmp_path: Path) -> None:
    """Their torques are tendons there; a slide's moment is without that of its pin's law."""
    m = lc.load(case)
    for joint in m.joints:
        m = m.with_joint(joint.name, damping=0.02, stiffness=0.5, rest_angle=0.3)
    lc.export(m, "mujoco", folder=tmp_path)
    result = lc.crosscheck(m, f"mjcf:{tmp_path / 'model.xml'}", angles=ANGLES)
    assert result.verdict == "agrees", [(d.signal, d.max, d.tolerance) for d in result.runs[0].discrepancies]
    (run,) = result.runs
    if case == "slider-crank":
        moment = np.abs(run.simulated["reaction_S_moment"] - run.analytic["reaction_S_moment"]).max()
        assert moment < 1e-3 * np.abs(run.analytic["reaction_S_moment"]).max()


@pytest.mark.long_rows(
    "the coupler cut in two and welded", "included", "bodies without joints", "plane y-z", "axes, and xyaxes",
    "classes", "layers, and a pin of bodies", "inertials about turned axes, capsules only to be seen",
    "degrees, boxes from point to point", "hinges the other way round", "radians and quaternions",
)  # fmt: skip
@pytest.mark.parametrize("way", WAYS)
def test_a_four_bar_written_in_many_ways_agrees(way: str, tmp_path: Path) -> None:
    """With a mechanism that was written by hand: other frames, another order, only names and lengths in common; how its
    bodies and joints accelerate with it.
    """
    files = dict(WAYS[way])
    still = way not in ("plane y-z", "plane x-z")
    files[""] = with_option(files[""], WEIGHTLESS if still else STIFF)
    m = by_hand() if still else by_hand((0.0, -9.81))
    result = lc.crosscheck(m, f"mjcf:{written(tmp_path, files)}", angles=ANGLES, signals="all")
    (run,) = result.runs
    assert result.verdict == "agrees", [(d.signal, d.max, d.tolerance) for d in run.discrepancies]
    assert {"coupler_acceleration_x", "follower_velocity_y", "acceleration_B"} <= {d.signal for d in run.discrepancies}
    at_rest = lc.crosscheck(m, f"mjcf:{tmp_path / 'linkage.xml'}", motion="static", angles=ANGLES)
    assert at_rest.verdict == "agrees"


def test_a_slider_crank_agrees_with_its_import(tmp_path: Path) -> None:
    """A slide, its damper and its spring, and springs of hinges: their signs and rests survive into both sides."""
    bar = 'type="box" size="0.005" density="7850" contype="0" conaffinity="0"'
    text = f"""
<mujoco model="slider-crank">
  <option timestep="5e-5" gravity="1 -9.81 0"/>
  <default><equality solref="2e-4 1" solimp="0.9999 0.9999 0.001 0.5 2"/></default>
  <worldbody>
    <body name="crank"><joint name="O" axis="0 0 -1" damping="0.01"/><geom {bar} fromto="0 0 0 0.05 0 0"/>
      <body name="rod" pos="0.05 0 0"><joint name="A" axis="0 0 -1" ref="20" springref="35" stiffness="0.3"/>
        <geom {bar} fromto="0 0 0 0.12 0 0"/></body>
    </body>
    <body name="slider" pos="0.17 0 0" euler="0 0 90">
      <joint name="S" type="slide" axis="0 1 0" damping="2" stiffness="50" springref="0.01" ref="0.003"/>
      <geom type="sphere" size="0.02" density="7850" pos="0.01 0.02 0" contype="0" conaffinity="0"/>
    </body>
  </worldbody>
  <equality><connect name="B" body1="slider" body2="rod" anchor="0 0 0"/></equality>
  <actuator><position joint="O" kp="5"/></actuator>
</mujoco>"""
    path = written(tmp_path, {"": text})
    m = imported(path).mechanism.replace(drive={"joint": "O", "speed": 20.0})
    for motion in ("driven", "static"):
        result = lc.crosscheck(m, f"mjcf:{path}", motion=motion, angles=ANGLES[1:12])
        assert result.verdict == "agrees", [(d.signal, d.max, d.tolerance) for d in result.runs[0].discrepancies]
        assert {"reaction_S_angle", "drive_torque"} <= {d.signal for d in result.runs[0].discrepancies}


@pytest.mark.slow
def test_a_released_linkage_agrees(tmp_path: Path) -> None:
    """Nothing drives it; a servo of the driven hinge is off, a damper of it acts."""
    option = '<option timestep="2e-4" integrator="RK4" gravity="0 -9.81 0"/>'
    text = with_option(PLAIN, STIFF.replace('<option timestep="2e-4"/>', option))
    text = text.replace('name="D" axis="0 0 1"', 'name="D" axis="0 0 1" damping="0.002"')
    path = written(tmp_path, {"": text})
    m = imported(path).mechanism.replace(drive={"joint": "D", "speed": "free"})
    result = lc.crosscheck(m, f"mjcf:{path}")
    assert result.verdict == "agrees", [(d.signal, d.max, d.tolerance) for d in result.runs[0].discrepancies]


# ------------------------------------------------------------------ it finds what is wrong in the file


FAULTS = {
    "a mass": (f'<geom {BAR} fromto="0 0 0 0.12', f'<geom {BAR} fromto="0 0 0 0.12'.replace("7850", "9000")),
    "a centre of mass": ("</body>\n    </body>", f'<geom {BALL} size="0.01" pos="0.06 0.05 0"/></body></body>'),
    "a force": ("</actuator>", '<motor site="b2" refsite="o" gear="0 1 0 0 0 0"/></actuator>'),
    "a damper": ('name="E" axis="0 0 1"', 'name="E" axis="0 0 1" damping="0.05"'),
    "an armature": ('name="A" axis="0 0 1"', 'name="A" axis="0 0 1" armature="0.001"'),
    "gravity": ('gravity="0 0 0"', 'gravity="0 -9.81 0"'),
}


@pytest.mark.long_rows("a damper", "a force", "an armature")
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_in_the_file_is_found(fault: str, tmp_path: Path) -> None:
    text = with_option(PLAIN, WEIGHTLESS)
    text = text.replace("<worldbody>", '<worldbody><site name="o"/>')
    before, after = FAULTS[fault]
    assert before in text
    text = text.replace(before, after, 1)
    if fault == "a force":  # a motor gives what it is commanded: a constant by its bias
        text = text.replace("<motor site", '<general biastype="affine" biasprm="1 0 0" site')
    (tmp_path / "by-hand.toml").write_text(dumps(by_hand()), encoding="utf-8")
    path, out = written(tmp_path, {"": text}), tmp_path / "out"
    arguments = [
        "--case",
        str(tmp_path / "by-hand.toml"),
        "--simulator",
        f"MJCF:{path}",
        "--angles",
        "0:345:15",
        "--out",
        str(out),
    ]
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 1, done.output
    result = json.loads((out / "result.json").read_text(encoding="utf-8"))
    (run,) = result["runs"]
    assert run["simulator"]["name"] == f"mjcf:{path}"
    assert result["verdict"] == "disagrees"
    off = {d["signal"] for d in run["discrepancies"] if d["verdict"] == "disagrees"}
    assert "drive_torque" in off
    assert "failure" in (out / "junit.xml").read_text(encoding="utf-8")


def test_soft_loops_are_found_and_their_gap_is_told(tmp_path: Path) -> None:
    """MuJoCo's default constraint opens the loop; the run says by how much, and is no failure."""
    path = written(tmp_path, {"": PLAIN})
    result = lc.crosscheck(by_hand(), f"mjcf:{path}", angles=ANGLES)
    (run,) = result.runs
    assert result.verdict == "disagrees"
    assert 1e-5 < float(str(run.settings["loops_open_by"])) < 1e-3
    off = np.hypot(run.simulated["clearance_B_x"], run.simulated["clearance_B_y"])
    assert off.max() == pytest.approx(run.settings["loops_open_by"], rel=0.3)


def test_the_crank_follows_the_request_whatever_its_servo_does(tmp_path: Path) -> None:
    for servo in ('<position joint="D" kp="1000"/>', '<velocity joint="D" kv="1000"/>', '<motor joint="D"/>'):
        path = written(tmp_path, {"": PLAIN.replace('<velocity joint="D" kv="10"/>', servo)})
        (run,) = lc.crosscheck(by_hand(), f"mjcf:{path}", angles=ANGLES).runs
        assert np.abs(run.simulated["crank_angle"] - ANGLES).max() < 1e-11
        assert np.abs(run.simulated["crank_angular_velocity"] - 6.25).max() < 1e-11


# ------------------------------------------------------------------ it refuses what is not the same linkage


def compared(path: Path, *more: str, case: str = "") -> tuple[int, str]:
    """Exit status and standard error of a cross-check, which is one line."""
    out = path.parent / "out"
    hand = path.parent / "by-hand.toml"
    hand.write_text(dumps(by_hand()), encoding="utf-8")
    arguments = ["--case", case or str(hand), "--simulator", f"mjcf:{path}", "--out", str(out), "-q", *more]
    done = CliRunner().invoke(app, arguments)
    assert not list(out.glob("*")) or done.exit_code == 3
    (line,) = (text for text in done.stderr.splitlines() if not text.startswith("left out: "))
    return done.exit_code, line


OTHERS = {
    "another length": (
        PLAIN.replace('<site name="b3" pos="0.12 0 0"/>', '<site name="b3" pos="0.12001 0 0"/>'),
        ("on body 'coupler' A and B are 0.12001 m apart", "0.12 m in the case by hand"),
    ),
    "a joint less": (
        PLAIN.replace('<connect name="B" site1="b2" site2="b3"/>', ""),
        ("has 3 joints that are a hinge or connect, the case by hand has 4", "(B)"),
    ),
    "a joint more": (
        PLAIN.replace("</worldbody>", '<body name="bob"><joint name="P"/><geom size="0.01"/></body></worldbody>'),
        ("has 5 joints", "(P)"),
    ),
    "another graph": (
        PLAIN.replace(
            "</worldbody>", '<body name="bob"><joint name="P"/><geom size="0.01"/></body></worldbody>'
        ).replace('<connect name="B" site1="b2" site2="b3"/>', ""),
        ("no joint of it is 'B' of the case by hand, between coupler and follower", "D, A, E, P"),
    ),
    "no XML": ("crank", ("not XML",)),
    "a ball": (PLAIN.replace('name="D" axis="0 0 1"', 'name="D" type="ball"'), ("is a ball joint",)),
    "a tendon": (
        PLAIN.replace(
            "<equality>",
            '<tendon><spatial name="t" stiffness="5"><site site="b2"/><site site="b3"/></spatial></tendon><equality>',
        ),
        ("tendon 't' pulls between bodies", "take"),
    ),
}


@pytest.mark.parametrize("other", OTHERS)
def test_a_file_of_another_linkage_is_refused(other: str, tmp_path: Path) -> None:
    text, words = OTHERS[other]
    status, said = compared(written(tmp_path, {"": text}))
    assert status == 2
    assert said.startswith("compare: ")
    for word in ("linkage.xml", *words):
        assert word in said, said


def test_the_drive_must_be_a_hinge_of_the_tree(tmp_path: Path) -> None:
    chain = """
<mujoco><worldbody><site name="d0"/>
  <body name="follower" pos="0.12 0 0"><joint name="E"/><geom size="0.01" pos="0.05 0 0"/>
    <body name="coupler" pos="0.1 0 0"><joint name="B"/><geom size="0.01" pos="0.05 0 0"/>
      <body name="crank" pos="0.12 0 0"><joint name="A"/><geom size="0.01" pos="0.02 0 0"/>
        <site name="d1" pos="0.05 0 0"/></body>
    </body></body></worldbody>
  <equality><connect name="D" site1="d1" site2="d0"/></equality></mujoco>"""
    status, said = compared(written(tmp_path, {"": chain}))
    assert status == 2
    assert "the drive's joint 'D' is a connect there" in said


def test_a_mirrored_link_is_another(exports: Path, tmp_path: Path) -> None:
    """All lengths are the same; the ternary link has its third joint on the other side."""
    text = (exports / "six-bar" / "model.xml").read_text(encoding="utf-8")
    here = '<body name="link" pos="0.06'
    assert text.count(here) == 1
    start = text.index(here) + len('<body name="link" pos="')
    x, y, z = map(float, text[start : text.index('"', start)].split())
    mirrored = f"{text[:start]}{x!r} {-y!r} {z!r}{text[text.index(chr(34), start) :]}"
    path = written(tmp_path, {"": mirrored})
    with pytest.raises(Unsupported, match="its joints do not sit in its bodies as those of the case six-bar do"):
        lc.crosscheck("six-bar", f"mjcf:{path}")


def test_names_decide_only_where_several_ways_fit(tmp_path: Path) -> None:
    """Without a name in common the joints are found by where they sit; a four-bar's crank is not its follower."""
    text = with_option(PLAIN, WEIGHTLESS)
    for old, new in {"crank": "p", "coupler": "q", "follower": "r"}.items():
        text = text.replace(f'name="{old}"', f'name="{new}"')
    for old, new in {"D": "hinge", "E": "D", "hinge": "E"}.items():
        text = text.replace(f'joint name="{old}"', f'joint name="{new}"').replace(f'joint="{old}"', f'joint="{new}"')
    path = written(tmp_path, {"": text})
    assert lc.crosscheck(by_hand(), f"mjcf:{path}", angles=ANGLES).verdict == "agrees"


@pytest.mark.parametrize(
    "arguments",
    [
        ["diagnose", str(Path(__file__).parents[1] / "docs" / "example-rig" / "measured.toml")],
        ["baseline", "check", "--case", "paper"],
        ["baseline", "update", "--case", "paper", "--baselines", "out"],
    ],
    ids=lambda words: " ".join(words[:2])[:15],
)
def test_what_changes_the_mechanism_cannot_use_a_model_as_it_is(
    arguments: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A diagnosis adds effects to the model, which a file does not get: it would name any effect at all."""
    monkeypatch.chdir(tmp_path)
    written(tmp_path, {"": PLAIN})
    done = CliRunner().invoke(app, [*arguments, "--simulator", "mjcf:linkage.xml"])
    assert done.exit_code == 2, done.output
    assert "is one model as it is" in done.stderr
    assert [path.name for path in tmp_path.rglob("*.*")] == ["linkage.xml"]


def test_a_number_says_where_it_comes_from(tmp_path: Path) -> None:
    path = written(tmp_path, {"": PLAIN})
    result = lc.crosscheck(by_hand(), f"mjcf:{path}", angles=ANGLES[:3])
    (sample,) = lc.show(result, signal="reaction_B_angle", at=0.0).runs
    assert sample.simulated.module == "sim_models/mjcf/engine.py"


# ------------------------------------------------------------------ it fails as an engine fails


def test_a_run_that_diverges_is_a_failed_simulation(tmp_path: Path) -> None:
    text = PLAIN.replace(
        "<worldbody>",
        '<option timestep="0.05" integrator="RK4"/><default><equality solref="-1e9 -1e6"/></default><worldbody>',
    )
    status, said = compared(written(tmp_path, {"": text}), "--angles", "0:345:15")
    assert status == 3
    assert "the run diverged" in said or "a loop is open by" in said
    assert "correct the model" in said


def test_contacts_are_counted_in_motion_and_refused_at_rest(tmp_path: Path) -> None:
    text = with_option(PLAIN, WEIGHTLESS).replace('contype="0" conaffinity="0"', "")
    path = written(tmp_path, {"": text})
    result = lc.crosscheck(by_hand(), f"mjcf:{path}", angles=ANGLES)
    assert result.verdict == "disagrees"
    assert int(str(result.runs[0].settings["contacts"])) > 0
    first = result.warnings[0]  # before any other advice, with what touches, how hard and from when on
    assert "geoms of the file touch, whose forces no mechanism has: the geom number " in first
    assert re.search(
        r"of body '\w+' with the geom number \d+ of body '\w+', up to [\d.e+]+ N, first (at|before) ", first
    )
    (tmp_path / "apart").mkdir()
    passing = written(tmp_path / "apart", {"": with_option(PLAIN, WEIGHTLESS)})
    apart = lc.crosscheck(by_hand(), f"mjcf:{passing}", angles=ANGLES)
    assert "touching" not in apart.runs[0].settings
    status, said = compared(path, "--motion", "static", "--angles", "0:90:15")
    assert status == 3
    assert "a contact of the model takes part at crank angle 0 deg" in said
    assert "contype" in said


def test_one_limit_that_acts_is_one(tmp_path: Path) -> None:
    text = with_option(PLAIN, WEIGHTLESS).replace('name="E" axis="0 0 1"', 'name="E" axis="0 0 1" range="-10 200"')
    result = lc.crosscheck(by_hand(), f"mjcf:{written(tmp_path, {'': text})}", angles=ANGLES)
    assert result.runs[0].settings["limits"] == 1
    assert any(
        "runs as its file says, with 1 limit of the file acting, in steps of" in said for said in result.warnings
    )


def test_too_many_steps_are_refused_before_they_are_taken(tmp_path: Path) -> None:
    text = PLAIN.replace("<worldbody>", '<option timestep="1e-9"/><worldbody>')
    with pytest.raises(SimulationError, match="would take"):
        engine(f"mjcf:{written(tmp_path, {'': text})}").simulate(request_of(by_hand(), crank_angle=ANGLES))


# ------------------------------------------------------------------ its name


def test_a_path_keeps_its_capitals_and_commas(tmp_path: Path) -> None:
    folder = tmp_path / "My, Rig"
    folder.mkdir()
    path = written(folder, {"": with_option(PLAIN, STIFF)})
    result = lc.crosscheck(by_hand(), f"Mjcf:{path},mujoco", angles=ANGLES[:3], motion="static", workers=1)
    assert [run.simulator.name for run in result.runs] == [f"mjcf:{path}", "mujoco"]
    assert result.verdict == "agrees"
    assert declared(f"mjcf:{path}").name == f"mjcf:{path}"
    with pytest.raises(MjcfError, match="no such file"):
        lc.crosscheck(by_hand(), f"mjcf:{folder}/other.xml")
    with pytest.raises(MjcfError, match="names no file"):
        lc.crosscheck(by_hand(), "mjcf:")
    with pytest.raises(Unsupported, match="is unknown"):
        engine("urdf:linkage.xml")


def test_what_it_does_not_do_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path, {"": PLAIN})
    with pytest.raises(Unsupported, match="does not simulate contact joints"):
        lc.crosscheck(by_hand().with_clearances({"B": 1e-4}), f"mjcf:{path}", joint_model="contact")
    with pytest.raises(lc.Error, match="cannot be exported"):
        lc.export(by_hand(), f"mjcf:{path}", folder=tmp_path / "out")


def test_what_touches_is_named_with_its_force_and_when(tmp_path: Path) -> None:
    """A bar of 1 kg and 0.3 m falls from level by 0.1 mm onto a ball at 0.2 m, where it accelerates by g, so that it
    touches after 4.5 ms, and then rests with m g (0.15/0.2) = 7.36 N, which a soft blow exceeds by less than as much.
    """
    path = written(
        tmp_path,
        {
            "": """<mujoco model="arm">
  <option timestep="2e-4" gravity="0 0 -9.81" integrator="RK4"/>
  <worldbody>
    <geom name="ball" type="sphere" size="0.05" pos="0.2 0 -0.0601" solref="0.02 1"/>
    <body name="arm">
      <joint name="O" axis="0 -1 0"/>
      <geom name="bar" type="capsule" fromto="0 0 0 0.3 0 0" size="0.01" mass="1"/>
    </body>
  </worldbody>
</mujoco>"""
        },
    )
    m = lc.import_mjcf(path).mechanism
    first = lc.crosscheck(m, f"mjcf:{path}", times=np.linspace(0.0, 0.6, 61)).warnings[0]
    said = re.search(
        r"geom 'ball' of body 'world' with geom 'bar' of body 'arm', up to (.*) N, first at (.*) s;", first
    )
    assert said
    assert float(said[2]) == pytest.approx(math.sqrt(2 * 1e-4 / 9.81), abs=3e-4)
    assert 9.81 * 0.15 / 0.2 < float(said[1]) < 2 * 9.81 * 0.15 / 0.2

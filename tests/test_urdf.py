"""URDF files of a planar linkage: the four-bar of the MJCF tests as onshape-to-robot writes it, and what is refused."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import linkage_crosscheck as lc
from commands import compare
from mjcf_files import MASS

pytestmark = pytest.mark.mujoco


def link(name: str, length: float) -> str:
    """A bar of square section along x, with a mesh that is nowhere."""
    mass = MASS[length]
    across, long = mass * (length**2 + 0.01**2) / 12, mass * (0.01**2 + 0.01**2) / 12
    return f"""
  <link name="{name}">
    <inertial>
      <origin xyz="{length / 2} 0 0" rpy="0 0 0"/> <mass value="{mass!r}"/>
      <inertia ixx="{long!r}" iyy="{across!r}" izz="{across!r}" ixy="0" ixz="0" iyz="0"/>
    </inertial>
    <visual><geometry><mesh filename="package://robot/assets/{name}.stl"/></geometry></visual>
  </link>"""


def joint(name: str, parent: str, child: str, place: str, kind: str = "continuous", more: str = "") -> str:
    return f"""
  <joint name="{name}" type="{kind}">
    <parent link="{parent}"/> <child link="{child}"/> <origin {place}/> <axis xyz="0 0 1"/>{more}
  </joint>"""


def closing(name: str, number: int, parent: str, x: float) -> str:
    frame = f"closing_{name}_{number}"
    return f'\n  <link name="{frame}"/>' + joint(f"{frame}_frame", parent, frame, f'xyz="{x} 0 0"', "fixed")


LOOPS = closing("B", 1, "coupler", 0.12) + closing("B", 2, "follower", 0.1)
MOTOR = '\n  <transmission name="t"><joint name="D"/><actuator name="m"/></transmission>'
FOUR_BAR = (
    '<robot name="four-bar">\n  <link name="base"/>'
    + link("crank", 0.05)
    + joint("D", "base", "crank", 'xyz="0 0 0"', more='<dynamics damping="0.02" friction="0.01"/>')
    + link("coupler", 0.12)
    + joint("A", "crank", "coupler", 'xyz="0.05 0 0" rpy="0 0 0.984149720637955"')
    + link("follower", 0.1)
    + joint(
        "E", "base", "follower", 'xyz="0.12 0 0" rpy="0 0 1.6065182091929755"', "revolute",
        '<limit lower="-3" upper="3" effort="5" velocity="4"/>',
    )
    + LOOPS + MOTOR + "\n</robot>\n"
)  # fmt: skip


def written(folder: Path, text: str) -> Path:
    (folder / "robot.urdf").write_text(text)
    return folder / "robot.urdf"


def test_a_four_bar_of_onshape_to_robot_is_the_linkage(tmp_path: Path) -> None:
    found = lc.import_mjcf(written(tmp_path, FOUR_BAR))
    m = found.mechanism
    assert {j.name: set(j.bodies) for j in m.joints} == {
        "D": {"ground", "crank"}, "A": {"crank", "coupler"}, "E": {"ground", "follower"}, "B": {"coupler", "follower"},
    }  # fmt: skip
    for name, length in (("crank", 0.05), ("coupler", 0.12), ("follower", 0.1)):
        body = m.body(name)
        assert body.mass == pytest.approx(MASS[length], rel=1e-12)
        assert body.centre == pytest.approx(length / 2, abs=1e-12)
        assert body.moment_of_inertia == pytest.approx(MASS[length] * (length**2 + 0.01**2) / 12, rel=1e-9)
        assert body.length == pytest.approx(length, rel=1e-9)
    assert (m.joint("D").damping, m.joint("D").friction_torque) == (0.02, 0.01)
    assert m.drive is not None
    assert m.drive.joint == "D"
    for said in ("shapes of the URDF file", "limits of velocity in E: left out", "limits of joints: left out (1)",
                 "limits of what actuators give in joints (actuatorfrcrange): left out (1)"):  # fmt: skip
        assert any(note.startswith(said) for note in found.notes), said


@pytest.mark.slow
def test_a_run_of_a_urdf_file_agrees(tmp_path: Path) -> None:
    path = written(tmp_path, FOUR_BAR)
    m = lc.import_mjcf(path).mechanism
    result = lc.crosscheck(m, f"mjcf:{path}", angles=np.radians([10.0, 60.0, 170.0, 300.0]))
    assert result.verdict == "agrees", result
    heavier = m.with_body("coupler", mass=1.02 * m.body("coupler").mass)
    assert lc.crosscheck(heavier, f"mjcf:{path}", angles=np.radians([10.0, 60.0])).verdict == "disagrees"


def test_a_mimic_in_a_closed_loop_is_left_out_and_said(tmp_path: Path) -> None:
    text = FOUR_BAR.replace('velocity="4"/>', 'velocity="4"/><mimic joint="D" multiplier="0.5"/>')
    found = lc.import_mjcf(written(tmp_path, text))
    assert "joint 'E' mimics joint 'D': left out, as its loops move it" in found.notes
    assert found.mechanism == lc.import_mjcf(written(tmp_path, FOUR_BAR)).mechanism


def test_an_open_chain_says_what_would_close_it(tmp_path: Path) -> None:
    path = written(tmp_path, FOUR_BAR.replace(LOOPS, ""))
    assert any("two links closing_<name>_1 and closing_<name>_2" in note for note in lc.import_mjcf(path).notes)
    (tmp_path / "robot.xml").write_text("<mujoco/>")
    assert any("the MJCF file beside it, robot.xml, may have them" in note for note in lc.import_mjcf(path).notes)


MIMIC = FOUR_BAR.replace(LOOPS, "").replace('velocity="4"/>', 'velocity="4"/><mimic joint="D"/>')
REFUSED = {
    "a mimic without loops": (MIMIC, "joint 'E' mimics joint 'D', for which a mechanism file has no word; if"),
    "half of a loop": (FOUR_BAR.replace(closing("B", 2, "follower", 0.1), ""), "'closing_B_1' and no 'closing_B_2'"),
    "a floating base": (FOUR_BAR.replace('"continuous"', '"floating"', 1), "joint 'D' is floating"),
    "no inertia": (re.sub(r"<inertial>.*?</inertial>", "", FOUR_BAR, count=1, flags=re.S), "'crank' moves and has no"),
    "no joint": ('<robot name="r"><link name="a"/></robot>', "has no joint"),
    "another root": ("<model/>", "its root is <model>; a URDF file has <robot>"),
    "a xacro": ('<robot xmlns:xacro="x"><xacro:macro/></robot>', "is a xacro"),
    "a document type": ('<!DOCTYPE robot [<!ENTITY a "b">]><robot/>', "has a <!DOCTYPE>"),
    "no XML": (FOUR_BAR[:200], "it is not XML"),
    "nothing": ("", "robot.urdf"),
    "a joint of no link": (FOUR_BAR.replace('<child link="coupler"/>', '<child link="cuopler"/>'), "MuJoCo cannot"),
    "no number": (FOUR_BAR.replace('value="0.0', 'value="x0.0', 1), "MuJoCo cannot"),
    "hinges that are not parallel": (FOUR_BAR.replace('<axis xyz="0 0 1"/>', '<axis xyz="0 1 0"/>', 1), "robot.urdf: "),
}  # fmt: skip


@pytest.mark.parametrize("what", REFUSED)
def test_what_cannot_be_read_is_a_sentence(tmp_path: Path, what: str) -> None:
    text, words = REFUSED[what]
    path = written(tmp_path, text)
    done = compare("import", path.name, "--out", "linkage.toml", cwd=tmp_path)
    assert done.returncode == 2, done.stdout
    assert done.stderr.startswith("compare: robot.urdf: ")
    assert words in done.stderr
    assert done.stderr.count("\n") == 1
    assert [file.name for file in tmp_path.iterdir()] == ["robot.urdf"]


def test_nothing_is_written_back_into_urdf(tmp_path: Path) -> None:
    path = written(tmp_path, FOUR_BAR)
    compare("import", path.name, "--out", "linkage.toml", cwd=tmp_path)
    done = compare("apply", "linkage.toml", "--to", path.name, cwd=tmp_path)
    assert done.returncode == 2
    assert "is URDF, into which nothing is written back" in done.stderr

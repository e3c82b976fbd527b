"""Mechanisms from somebody's MJCF: our own exports, one linkage written in many ways, and files that are refused."""

from __future__ import annotations

import cmath
import json
import math
import os
import random
import re
import subprocess
import sys
import textwrap
from pathlib import Path

import mujoco
import numpy as np
import pytest
from typer.testing import CliRunner

import linkage_crosscheck as lc
from analytic.kinematics.assembly import Assembly
from analytic.mechanism import Body, Load, Mechanism
from analytic.mechanism.file import load, shipped_cases
from compare.cli.app import app
from marks import slow
from mjcf_files import BAR, COUPLER, MASS, PLAIN, WAYS, written
from sim_models.common.start import AT_REST
from sim_models.mjcf.errors import MjcfError
from sim_models.mjcf.imported import imported
from sim_models.run.path import CrankPath

pytestmark = pytest.mark.mujoco
ROOT = Path(__file__).parents[1]


# ------------------------------------------------------------------ several motors

ARM = """
<mujoco model="arm"><compiler angle="radian"/><option gravity="0 -9.81 0"/>
  <worldbody><body name="upper" euler="0 0 0.5">
    <joint name="O" axis="0 0 1"/><inertial pos="0.13 0 0" mass="0.8" diaginertia="7e-3 7e-3 7e-3"/>
    <body name="fore" pos="0.3 0 0" euler="0 0 -1.1">
      <joint name="K" axis="0 0 -1" damping="0.02"/><inertial pos="0.1 0.02 0" mass="0.9" diaginertia="6e-3 6e-3 6e-3"/>
      <body name="hand" pos="0.2 0 0"><joint name="S" type="slide" axis="1 0 0"/>
        <inertial pos="0.01 0 0" mass="0.2" diaginertia="1e-4 1e-4 1e-4"/></body></body></body></worldbody>
  <actuator><velocity joint="K" kv="10"/><motor joint="S"/><velocity joint="O" kv="10"/></actuator>
  <keyframe><key ctrl="-1.5 0 2" qvel="2 -1.5 0.25"/></keyframe>
</mujoco>"""


def test_an_arm_s_every_motor_is_a_drive_with_its_keyframe_s_speed(tmp_path: Path) -> None:
    """The elbow's axis points down, so that its coordinate turns back; its motors' torques are MuJoCo's own inverse
    dynamics.
    """
    (tmp_path / "arm.xml").write_text(ARM, encoding="utf-8")
    m = lc.import_mjcf(tmp_path / "arm.xml").mechanism
    assert {d.joint: d.speed for d in m.drives} == {"O": 2.0, "K": 1.5, "S": 0.25}
    found = lc.analyse(m, times=np.array([0.0, 0.1]))
    model = mujoco.MjModel.from_xml_string(ARM)
    data = mujoco.MjData(model)
    data.qvel[:] = 2.0, -1.5, 0.25
    mujoco.mj_inverse(model, data)
    shoulder, elbow, hand = data.qfrc_inverse
    given = [found.signals[name][0] for name in ("drive_torque_O", "drive_torque_K", "drive_force_S")]
    assert given == pytest.approx([shoulder, -elbow, hand], rel=1e-9)
    assert lc.crosscheck(m, "mujoco", times=np.linspace(0.0, 0.3, 7)).verdict == "agrees"


def test_motors_beyond_the_freedoms_are_left_out_and_speeds_that_are_not_said_are_assumed(tmp_path: Path) -> None:
    more = PLAIN.replace("</actuator>", '<motor name="too many" joint="A"/></actuator>')
    (tmp_path / "more.xml").write_text(more, encoding="utf-8")
    found = lc.import_mjcf(tmp_path / "more.xml")
    assert [d.joint for d in found.mechanism.drives] == ["D"]
    assert any(note.startswith("actuator 'too many' is neither the drive's") for note in found.notes)
    silent = ARM[: ARM.index("<keyframe>")] + "</mujoco>"
    (tmp_path / "silent.xml").write_text(silent, encoding="utf-8")
    found = lc.import_mjcf(tmp_path / "silent.xml")
    assert {d.joint: d.speed for d in found.mechanism.drives} == {"O": 1.0, "K": 1.0, "S": 0.1}
    assert any("its motor in joint S moves is not in the file" in note and "0.1 m/s" in note for note in found.notes)


def test_what_no_motor_moves_swings(tmp_path: Path) -> None:
    """An acrobot, and a cart whose slide alone is on the ground; a loop that is switched off is another matter."""
    acrobot = ARM[: ARM.index('<body name="hand"')] + "</body></body></worldbody>"
    acrobot += '<actuator><motor joint="K"/></actuator></mujoco>'
    found = imported(written(tmp_path, {"": acrobot}))
    assert {d.joint: d.speed for d in found.mechanism.drives} == {"K": 1.0, "O": "free"}
    assert any(note.startswith("no motor moves O: what swings there is left free") for note in found.notes)
    cart = acrobot.replace('name="O" axis="0 0 1"', 'name="O" type="slide" axis="1 0 0"')
    cart = cart[: cart.index("<actuator>")] + "</mujoco>"
    found = imported(written(tmp_path, {"": cart}))
    assert {d.joint: d.speed for d in found.mechanism.drives} == {"O": "free", "K": "free"}
    assert any(note.startswith("nothing drives it") for note in found.notes)


# ------------------------------------------------------------------ our own exports


def xy(point: complex) -> tuple[float, float]:
    return point.real, point.imag


CRANKED = [case for case in shipped_cases() if load(case).cranked]  # the export knows no others yet


@pytest.fixture(scope="module")
def exports(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("exports")
    for case in CRANKED:
        lc.export(case, "mujoco", folder=folder / case)
    return folder


@pytest.mark.parametrize("case", CRANKED)
def test_a_shipped_case_survives_export_and_import(case: str, exports: Path) -> None:
    m, found = load(case), lc.import_mjcf(exports / case / "model.xml").mechanism
    assert found.name == m.name
    assert found.gravity == m.gravity
    assert set(found.moving) == set(m.moving)
    for name, part in m.parts.items():
        other = found.parts[name]
        assert set(other.points) == set(part.points)
        for point in part.points:
            assert xy(other.point(point)) == pytest.approx(xy(part.point(point)), abs=1e-12)
        if isinstance(part, Body) and isinstance(other, Body):
            assert other.mass == part.mass
            assert xy(other.centre) == pytest.approx(xy(part.centre), abs=1e-12)
            assert other.moment_of_inertia == pytest.approx(part.moment_of_inertia, abs=1e-12)
    assert {j.name: (j.type, j.bodies, j.direction) for j in found.joints} == {
        j.name: (j.type, j.bodies, j.direction) for j in m.joints
    }
    assert found.drive is not None
    assert m.drive is not None
    assert found.drive.joint == m.drive.joint
    assert found.drive.speed == m.drive.speed
    assert [(load.body, load.point, load.force, load.torque) for load in found.loads] == [
        (load.body, load.point, load.force, load.torque) for load in m.loads
    ]
    lc.analyse(found, motion="static" if m.speed is None else "driven")  # it assembles where the export began


# ------------------------------------------------------------------ one linkage, written in many ways


def shape(m: Mechanism) -> dict[str, float]:
    """What a four-bar is, whatever its bodies' frames and the ground's are."""
    pose = {"ground": AT_REST, **CrankPath(Assembly(m)).poses(m.assembly["crank"])}
    found: dict[str, float] = {}
    ends = {"ground": "DE", "crank": "DA", "coupler": "AB", "follower": "EB"}
    along = {
        name: (m.body(name).point(b) - m.body(name).point(a)) * cmath.exp(1j * pose[name].angle)
        for name, (a, b) in ends.items()
    }
    for name, (a, b) in ends.items():
        part = m.body(name)
        found[f"{name} length"] = abs(along[name])
        found[f"{name} angle"] = cmath.phase(along[name] / along["ground"])
        if isinstance(part, Body):
            mass = (part.centre - part.point(a)) / (part.point(b) - part.point(a))
            found |= {f"{name} along": mass.real, f"{name} across": mass.imag, f"{name} mass": part.mass}
            found[f"{name} inertia"] = part.moment_of_inertia
    return found | {"speed": m.speed or 0.0}


TRUTH = {
    "ground length": 0.12,
    "crank length": 0.05,
    "coupler length": 0.12,
    "follower length": 0.1,
    "speed": 6.25,
    **{f"{b} along": 0.5 for b in ("crank", "coupler", "follower")},
    **{f"{b} across": 0.0 for b in ("crank", "coupler", "follower")},
    **{f"{b} mass": MASS[length] for b, length in (("crank", 0.05), ("coupler", 0.12), ("follower", 0.1))},
    **{
        f"{b} inertia": MASS[length] * (length**2 + 0.01**2) / 12
        for b, length in (("crank", 0.05), ("coupler", 0.12), ("follower", 0.1))
    },
    "ground angle": 0.0,
    "crank angle": 0.0,
    "coupler angle": 0.984149720637955,
    "follower angle": 1.6065182091929755,
}


@pytest.mark.parametrize("way", WAYS)
def test_one_linkage_written_in_many_ways(way: str, tmp_path: Path) -> None:
    m = imported(written(tmp_path, WAYS[way])).mechanism
    assert {j.name: set(j.bodies) for j in m.joints} == {
        "D": {"ground", "crank"},
        "A": {"crank", "coupler"},
        "B": {"coupler", "follower"},
        "E": {"ground", "follower"},
    }
    assert shape(m) == pytest.approx(TRUTH, abs=1e-9)


def test_names_that_are_none_or_taken(tmp_path: Path) -> None:
    """Joints without names get letters; what is no identifier gets underscores, and a number where it is taken."""
    text = PLAIN.replace(' name="D"', "").replace(' name="A"', ' name="1 st/joint"').replace(' name="E"', "")
    text = text.replace('<actuator><velocity joint="D" kv="10"/></actuator>', "").replace('ctrl="6.25"', "")
    text = text.replace('name="crank"', 'name="world\'s own"').replace('name="coupler"', 'name="world_s_own"')
    found = lc.import_mjcf(written(tmp_path, {"": text}))
    m = found.mechanism
    assert [b.name for b in m.bodies] == ["world_s_own", "world_s_own-2", "follower"]
    assert [j.name for j in m.joints] == ["A", "n1_st_joint", "C", "B"]
    assert m.drive is not None
    assert m.drive.speed == "free"
    assert any("nothing drives it" in note for note in found.notes)


def test_laws_of_joints(tmp_path: Path) -> None:
    """Damping, friction and a spring; its rest is an angle of our bodies, whatever the axis, ref and springref are."""
    law = 'damping="0.01" frictionloss="0.002" stiffness="3" springref="10" ref="25"'
    texts = {"up": PLAIN, "down": PLAIN.replace('name="A" axis="0 0 1"', 'name="A" axis="0 0 -1"')}
    rests = {}
    for name, text in texts.items():
        folder = tmp_path / name
        folder.mkdir()
        joint = imported(written(folder, {"": text.replace('name="A"', f'name="A" {law}')})).mechanism.joint("A")
        assert (joint.damping, joint.friction_torque, joint.stiffness) == (0.01, 0.002, 3.0)
        rests[name] = joint.rest_angle
    # 15 degrees back from the initial angle, by the right hand about the axis
    assert rests["up"] == pytest.approx(math.radians(COUPLER - 15), abs=1e-12)
    assert rests["down"] == pytest.approx(math.radians(COUPLER + 15), abs=1e-12)


@pytest.mark.parametrize("case", ["crank-rocker", "slider-crank"])
def test_laws_of_joints_survive_export_and_import(case: str, tmp_path: Path) -> None:
    """The export writes them as tendons; angles of springs may be whole turns apart, as initial poses are."""
    m = load(case)
    own = {"damping": 0.01, "friction_torque": 0.02, "stiffness": 0.5, "rest_angle": 0.3}
    for k, joint in enumerate(m.joints):
        m = m.with_joint(joint.name, **{name: value * (1 + k) for name, value in own.items()})
    lc.export(m, "mujoco", folder=tmp_path)
    found = lc.import_mjcf(tmp_path / "model.xml").mechanism
    for joint in m.joints:
        other = found.joint(joint.name)
        assert other.bodies == joint.bodies
        for name in own:
            assert getattr(other, name) == pytest.approx(getattr(joint, name), abs=1e-12), (joint.name, name)


def test_gravity_is_projected_and_its_rest_noted(tmp_path: Path) -> None:
    found = imported(written(tmp_path, {"": WAYS["plane x-z"][""]}))
    assert found.mechanism.gravity == (0.0, -9.81)
    assert not any("gravity" in note for note in found.notes)
    across = imported(written(tmp_path, {"": PLAIN}))
    assert across.mechanism.gravity == (0.0, 0.0)
    assert any("gravity across the plane, -9.81 m/s^2" in note for note in across.notes)


SLIDER = f"""
<mujoco model="slider-crank">
  <worldbody>
    <body name="crank"><joint name="O" axis="0 0 1"/><geom {BAR} fromto="0 0 0 0.05 0 0"/>
      <body name="rod" pos="0.05 0 0"><joint name="A" axis="0 0 1"/><geom {BAR} fromto="0 0 0 0.12 0 0"/></body>
    </body>
    <body name="slider" pos="0.17 0 0" euler="0 0 90">
      <joint name="S" type="slide" axis="0 -1 0" damping="2" stiffness="5" springref="0.01"/>
      <geom {BAR} pos="0 0 0" type="sphere" size="0.02"/>
    </body>
  </worldbody>
  <equality><connect name="B" body1="slider" body2="rod" anchor="0 0 0"/></equality>
</mujoco>""".replace('type="box" size="0.005" density="7850" contype="0" conaffinity="0" pos', 'density="7850" pos')


def test_what_is_disabled_is_not_there(tmp_path: Path) -> None:
    law = 'name="A" damping="0.01" frictionloss="0.002" stiffness="3"'
    flag = '<option gravity="0 -9.81 0"><flag spring="disable" frictionloss="disable" gravity="disable"/></option>'
    text = PLAIN.replace('name="A"', law).replace("<worldbody>", f"{flag}<worldbody>")
    m = imported(written(tmp_path, {"": text})).mechanism
    assert (m.joint("A").damping, m.joint("A").friction_torque, m.joint("A").stiffness) == (0.01, 0.0, 0.0)
    assert m.gravity == (0.0, 0.0)
    open_loop = PLAIN.replace("<worldbody>", '<option><flag equality="disable"/></option><worldbody>')
    with pytest.raises(MjcfError, match="does not determine coupler, follower"):
        imported(written(tmp_path, {"": open_loop}))


def test_what_is_welded_to_the_world_is_ground(tmp_path: Path) -> None:
    base = '<body name="base" pos="0.3 0 0"><joint name="X" axis="0 0 1"/><geom size="0.01"/></body>'
    text = PLAIN.replace("<worldbody>", f"<worldbody>{base}").replace("<equality>", '<equality><weld body1="base"/>')
    found = imported(written(tmp_path, {"": text}))
    assert list(found.mechanism.moving) == ["crank", "coupler", "follower"]
    assert any("joint 'X' of body 'base' is held by a weld" in note for note in found.notes)


def test_an_armature_on_the_ground_is_inertia_and_elsewhere_noted(tmp_path: Path) -> None:
    plain = imported(written(tmp_path, {"": PLAIN})).mechanism.moving
    for name, body, more in (("E", "follower", 0.001), ("A", "coupler", 0.0)):
        text = PLAIN.replace(f'name="{name}" axis', f'name="{name}" armature="0.001" axis')
        found = imported(written(tmp_path, {"": text}))
        moved = found.mechanism.moving[body].moment_of_inertia - plain[body].moment_of_inertia
        assert moved == pytest.approx(more, abs=1e-15)
        assert any(f"the armature of joint '{name}'" in note for note in found.notes)


def test_a_speed_that_the_file_does_not_say_is_assumed_aloud(tmp_path: Path) -> None:
    found = imported(written(tmp_path, {"": PLAIN.replace('<key ctrl="6.25"/>', "")}))
    assert found.mechanism.speed == 1.0
    assert any("drive.speed = 1 rad/s is assumed, correct it" in note for note in found.notes)


def test_a_slide(tmp_path: Path) -> None:
    m = imported(written(tmp_path, {"": SLIDER})).mechanism
    slide = m.joint("S")
    assert slide.prismatic
    assert slide.bodies == ("ground", "slider")
    assert (slide.direction.real, slide.direction.imag) == pytest.approx((1.0, 0.0), abs=1e-12)
    assert slide.angle == pytest.approx(math.pi / 2)
    assert (slide.damping, slide.stiffness, slide.rest_angle) == (2.0, 5.0, 0.01)
    assert m.body("ground").point("S") == pytest.approx(0.17)


REFERRED = """
<mujoco model="referred"><compiler angle="degree"/><option timestep="1e-3" gravity="0 0 -9.81" integrator="RK4"/>
  <default><geom type="capsule" size="0.01" density="2000" contype="0" conaffinity="0"/></default>
  <worldbody>
    <body name="arm" pos="0.1 0 0.2" euler="0 -30 0">
      <joint name="S" axis="0 1 0" ref="20" springref="35" stiffness="3" damping="0.4"/>
      <geom fromto="0 0 0 0.3 0 0"/>{on_arm}
      <body name="car" pos="0.3 0 0">
        <joint name="W" type="slide" axis="1 0 0" ref="0.05" springref="0.02" stiffness="40" damping="3"/>
        <geom fromto="0 0 0 0.1 0 0.02"/>{on_car}
        <body name="tip" pos="0.1 0 0.02" euler="0 20 0">
          <joint name="E" axis="0 -1 0" ref="-40" springref="10" stiffness="2" damping="0.1"/>
          <geom fromto="0 0 0 0.2 0 0.01"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>"""
SITES = {"on_arm": '<site name="W:arm" pos="0.25 0 0"/>', "on_car": '<site name="W:car"/>'}


@pytest.mark.parametrize("sites", [{"on_arm": "", "on_car": ""}, SITES], ids=["bare", "two sites on its line"])
def test_what_coordinates_refer_to_moves_nothing(sites: dict[str, str], tmp_path: Path) -> None:
    """Hinges and a slide whose coordinates begin at ``ref``: places of the bodies, springs and a free swing (RK4) are
    those of MuJoCo's own arrays.  A file may say where a slide in no loop begins in no other way than by its points.
    """
    text = REFERRED.format(**sites)
    found = imported(written(tmp_path, {"": text}))
    assert any("joint 'W' of body 'car' is 0 m in the initial pose" in n and "is 0.05 m" in n for n in found.notes)
    signals = lc.analyse(found.mechanism, times=np.array([0.0, 0.05, 0.1])).signals
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    turns = {"S": -1.0, "W": 1.0, "E": 1.0}  # of coordinates in x-z, whose angles count from x to z, about -y
    springs = [
        turns[j.name] * j.stiffness * (j.rest_angle - signals[f"position_{j.name}"][0]) for j in found.mechanism.joints
    ]
    assert springs == pytest.approx(list(data.qfrc_passive), abs=1e-12)  # nothing moves: no damper takes part
    for k in range(3):
        for body in found.mechanism.moving:
            at = data.body(body).xipos
            place = signals[f"{body}_x"][k], signals[f"{body}_y"][k]
            assert place == pytest.approx((at[0], at[2]), abs=1e-7 if k else 1e-15), (body, k)
        mujoco.mj_step(model, data, nstep=50)
        mujoco.mj_forward(model, data)
    assert abs(data.joint("W").qpos[0] - 0.05) > 0.02


# ------------------------------------------------------------------ files that are refused

D = '<joint name="D" axis="0 0 1"/>'
BOMB = """<!DOCTYPE mujoco [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">]>
<mujoco model="&b;"/>"""
MANY = "<mujoco><worldbody>" + "<body><joint/><geom size='1'/></body>" * 5000 + "</worldbody></mujoco>"


def with_asset(asset: str) -> str:
    return PLAIN.replace("<worldbody>", f"<asset>{asset}</asset><worldbody>")


REFUSED: dict[str, tuple[str | bytes, tuple[str, ...]]] = {
    "empty": ("", ("not XML", "give an MJCF file")),
    "not XML": ("crank: 0.05", ("line 1", "not XML")),
    "XML that breaks off": (PLAIN[: len(PLAIN) // 2], ("not XML",)),
    "binary": (bytes(range(256)) * 10, ("not UTF-8",)),
    "another root": ("<robot name='arm'/>", ("line 1", "<robot>", "<mujoco>")),
    "entity bomb": (BOMB, ("<!DOCTYPE mujoco>", "take it out")),
    "external entity": (
        '<!DOCTYPE m [<!ENTITY x SYSTEM "file:///etc/passwd">]><mujoco model="&x;"/>',
        ("<!DOCTYPE m>", "entities are not read"),
    ),
    "include from above": (
        '<mujoco>\n<include file="../../etc/passwd"/></mujoco>',
        ("line 2", "include.file = '../../etc/passwd'", "leads out of the folder"),
    ),
    "include by backslashes": (
        '<mujoco><include file="..\\secret.xml"/></mujoco>',
        ("leads out of the folder",),
    ),
    "include of an absolute path": (
        '<mujoco><include file="/etc/passwd"/></mujoco>',
        ("'/etc/passwd'", "own folder", "copy"),
    ),
    "include through a link": ('<mujoco><include file="link/secret.xml"/></mujoco>', ("leads out of the folder",)),
    "include that is not there": ('<mujoco><include file="b.xml"/></mujoco>', ("'b.xml'", "no such file", "put it")),
    "include of itself": ('<mujoco><include file="linkage.xml"/></mujoco>', ("includes itself", "take that include")),
    "mesh from above": (with_asset('<mesh file="../m.stl"/>'), ("mesh.file = '../m.stl'", "leads out")),
    "meshdir above": (
        PLAIN.replace("<worldbody>", '<compiler meshdir="../"/><worldbody>'),
        ("compiler.meshdir", "out"),
    ),
    "mesh by a scheme": (with_asset('<mesh file="http://x/m.stl"/>'), ("mesh.file", "own folder")),
    "mesh that is not there": (
        with_asset('<mesh name="m" file="m.stl"/>').replace("</worldbody>", '<geom type="mesh" mesh="m"/></worldbody>'),
        ("MuJoCo cannot compile it", "m.stl", "correct it"),
    ),
    "texture from a device": (with_asset('<texture type="2d" name="t" file="pipe.png"/>'), ("pipe.png", "no file")),
    "texture of many pixels": (
        with_asset('<texture type="2d" builtin="flat" width="100000" height="100000" rgb1="1 1 1"/>'),
        ("texture.width = '100000'", "at most 4096"),
    ),
    "memory": (
        PLAIN.replace("<worldbody>", '<size memory="900G"/><worldbody>'),
        ("size.memory = '900G'", "at most 1G"),
    ),
    "user data": (
        PLAIN.replace("<worldbody>", '<size nuser_body="2000000000"/><worldbody>'),
        ("size.nuser_body = '2000000000'", "at most 4096"),
    ),
    "a mesh to be made": (with_asset('<mesh builtin="supertorus" params="100000 1 1 1"/>'), ("mesh.builtin", "a geom")),
    "iterations": (
        PLAIN.replace("<worldbody>", '<option iterations="2000000000" tolerance="0"/><worldbody>'),
        ("option.iterations = '2000000000'", "at most 4096"),
    ),
    "a million copies": (
        '<mujoco><worldbody><replicate count="1000"><replicate count="1000"><body><joint/><geom size="1"/></body>'
        "</replicate></replicate></worldbody></mujoco>",
        ("body number 1000000", "at most 500"),
    ),
    "5000 bodies": (MANY, ("body number 501", "at most 500")),
    "nested too deep": (
        "<mujoco><worldbody>" + "<body>" * 200 + "</body>" * 200 + "</worldbody></mujoco>",
        ("lies in",),
    ),
    "10 MB": ("<mujoco>" + "<!-- nothing -->" * 700_000 + "</mujoco>", ("no joint",)),
    "17 MB": ("<mujoco>" + " " * 2**24 + "</mujoco>", ("larger than 16 MB",)),
    "plugin": (
        PLAIN.replace("<worldbody>", '<extension><plugin plugin="mujoco.pid"/></extension><worldbody>'),
        ("<extension> is not read", "loads code"),
    ),
    "another model": (with_asset('<model name="m" file="m.xml"/>'), ("<model> is not read",)),
    "flexible": (PLAIN.replace("</worldbody>", '<flexcomp name="f"/></worldbody>'), ("<flexcomp>", "no rigid link")),
    "an unknown element": (PLAIN.replace("<joint", "<hinge", 1), ("MuJoCo cannot compile it", "hinge")),
    "not a number": (PLAIN.replace('pos="0.12 0 0" euler', 'pos="nan 0 0" euler'), ("body.pos = 'nan 0 0'", "finite")),
    "too large": (PLAIN.replace('pos="0.12 0 0" euler', 'pos="0.12 0 1e300" euler'), ("body_pos holds 1e+300", "SI")),
    "infinite": (PLAIN.replace('kv="10"', 'kv="-inf"'), ("velocity.kv = '-inf'", "finite")),
    "ball joint": (
        PLAIN.replace(D, '<joint name="D" type="ball"/>'),
        ("joint 'D' of body 'crank' is a ball joint", "hinges"),
    ),
    "free joint": (
        PLAIN.replace(D, '<freejoint name="D"/>'),
        ("joint 'D' of body 'crank' is a free joint", "hinges"),
    ),
    "a hinge across": (
        PLAIN.replace('name="A" axis="0 0 1"', 'name="A" axis="0 1 0"'),
        ("joint 'A' of body 'coupler'", "along z"),
    ),
    "a slide out of the plane": (
        PLAIN.replace('name="E" axis="0 0 1"', 'name="E" type="slide" axis="0.1 0 1"'),
        ("joint 'E' of body 'follower' is a slide", "across z"),
    ),
    "two joints in a body": (
        PLAIN.replace(D, D + '<joint type="slide" axis="0 0 1"/>'),
        ("body 'crank' has 2 joints", "a body with mass"),
    ),
    "joint equality": (
        PLAIN.replace('<connect name="B" site1="b2" site2="b3"/>', '<joint name="gear" joint1="D" joint2="E"/>'),
        ("equality 'gear' is of the kind joint", "connect and weld"),
    ),
    "tendon equality": (
        PLAIN.replace('<connect name="B" site1="b2" site2="b3"/>', '<tendon tendon1="t"/>').replace(
            "<equality>", '<tendon><fixed name="t"><joint joint="D" coef="1"/></fixed></tendon><equality>'
        ),
        ("of the kind tendon", "take it out"),
    ),
    "a spring between bodies": (
        PLAIN.replace(
            "<equality>",
            '<tendon><spatial name="t" stiffness="5"><site site="b2"/><site site="b3"/></spatial></tendon><equality>',
        ),
        ("tendon 't' has a spring", "no law of a joint", "take these out"),
    ),
    "gravcomp": (
        WAYS["plane x-z"][""].replace('name="crank"', 'name="crank" gravcomp="1"'),
        ("body 'crank' has gravcomp = 1", "take it out"),
    ),
    "no joint": ('<mujoco><worldbody><geom size="1"/></worldbody></mujoco>', ("has no joint", "a hinge at least")),
    "slides only": (
        '<mujoco><worldbody><body><joint type="slide"/><geom size="1"/></body></worldbody></mujoco>',
        ("has no hinge",),
    ),
    "no loop is closed": (
        PLAIN.replace("<connect ", '<connect active="false" '),
        ("does not determine coupler, follower", "mobility 3", "hold or join what is free"),
    ),
    "no time step": (
        PLAIN.replace("<worldbody>", '<option timestep="0"/><worldbody>', 1),
        ("option.timestep = 0 s cannot be stepped by", "give such as 0.001"),
    ),
    "time that runs back": (
        PLAIN.replace("<worldbody>", '<option timestep="-1"/><worldbody>', 1),
        ("option.timestep = -1 s cannot be stepped by",),
    ),
    "one joint too many": (
        PLAIN.replace("</equality>", '<connect name="C" body1="crank" body2="follower" anchor="0 0.1 0"/></equality>'),
        ("is rigid already", "mobility -1", "remove it"),
    ),
    "no mass": (PLAIN.replace('density="7850"', 'density="0"'), ("MuJoCo cannot compile it", "mass")),
    "a weld that is open": (
        PLAIN.replace(
            '<connect name="B" site1="b2" site2="b3"/>',
            '<weld name="w" body1="coupler" body2="follower" relpose="1 0 0 1 0 0 0"/>',
        ),
        ("equality 'w' welds what is", "keyframe"),
    ),
}


def refused(path: Path, folder: Path) -> str:
    """What the command says of a file that it refuses, in one sentence, and writes nothing."""
    before = sorted(folder.rglob("*"))
    done = CliRunner().invoke(app, ["import", str(path), "--out", str(folder / "linkage.toml")])
    assert done.exit_code == 2, done.output
    assert sorted(folder.rglob("*")) == before
    (line,) = done.stderr.splitlines()
    assert len(line) < 1100
    assert line.isprintable()
    assert line.startswith("compare: ")
    return line


@pytest.mark.parametrize("what", REFUSED)
def test_a_bad_file_is_one_sentence(what: str, tmp_path: Path) -> None:
    content, words = REFUSED[what]
    inside, outside = tmp_path / "in", tmp_path / "out"
    inside.mkdir()
    outside.mkdir()
    (outside / "secret.xml").write_text("<mujocoinclude/>", encoding="utf-8")
    (tmp_path / "secret.xml").write_text("<mujocoinclude/>", encoding="utf-8")
    (inside / "link").symlink_to(outside)
    os.mkfifo(inside / "pipe.png")
    path = inside / "linkage.xml"
    path.write_bytes(content if isinstance(content, bytes) else textwrap.dedent(content).strip().encode())
    said = refused(path, inside)
    assert "linkage.xml" in said
    for word in words:
        assert word in said, said


VALUES = ("", "0", "-1", "1e300", "1e-300", "0 0 0", "1 2", "abc", "D", "0 0 1e308", "crank", "world", "1 0 0 0")
PIECES = (
    "<joint/>", '<joint type="slide"/>', '<site name="x"/>', "<body/>", '<geom size="1e9"/>', '<weld body1="crank"/>',
    '<weld body1="coupler" body2="follower"/>', '<connect body1="crank" anchor="0 0 0"/>', '<motor joint="A"/>',
    '<key qpos="1 2 3"/>', '<flag equality="disable"/>', '<option gravity="1e30 0 0"/>', '<motor site="b2"/>',
    '<inertial pos="0 0 0" mass="1e-20" diaginertia="1 1 1"/>', '<general body="crank"/>', "<light/>",
)  # fmt: skip


def mutated(text: str, rng: random.Random) -> str:
    """A file with a value, an element or a character of it changed."""
    kind = rng.randrange(4)
    if kind == 0:
        at = rng.choice(list(re.finditer(r'="([^"]*)"', text)))
        return text[: at.start(1)] + rng.choice(VALUES) + text[at.end(1) :]
    if kind == 1:
        end = rng.choice(list(re.finditer(">", text))).end()
        return text[:end] + rng.choice(PIECES) + text[end:]
    if kind == 2:
        at = rng.choice(list(re.finditer(r"<[^>]*/>", text)))
        return text[: at.start()] + text[at.end() :]
    i = rng.randrange(len(text))
    return text[:i] + rng.choice('<>"&/ a0-') + text[i + 1 :]


@pytest.mark.parametrize("seed", [1, *slow(2, 3, 4)])
def test_a_mutated_file_is_read_or_refused_in_a_sentence(seed: int, tmp_path: Path) -> None:
    rng = random.Random(seed)
    texts = [files[""] for files in WAYS.values() if len(files) == 1]
    read = refused = 0
    for _ in range(200):
        path = written(tmp_path, {"": mutated(rng.choice(texts), rng)})
        try:
            assert imported(path).mechanism.bodies
            read += 1
        except MjcfError as error:
            refused += "\n" not in str(error)
    assert read + refused == 200
    assert min(read, refused) > 20


def test_a_file_that_is_none(tmp_path: Path) -> None:
    assert "there is no such file" in refused(tmp_path / "none.xml", tmp_path)
    assert "it is a folder" in refused(tmp_path, tmp_path)
    os.mkfifo(tmp_path / "pipe.xml")
    assert "a pipe or a device" in refused(tmp_path / "pipe.xml", tmp_path)
    with pytest.raises(lc.Error, match="give a path"):
        lc.import_mjcf(5)  # type: ignore[arg-type]
    with pytest.raises(MjcfError, match="no such file"):
        lc.import_mjcf("none.xml")


def test_included_files_lie_in_the_folder_of_the_file_itself(tmp_path: Path) -> None:
    """A link to a model is followed, and what it includes is looked for beside the model, not beside the link."""
    (tmp_path / "models").mkdir()
    real = written(tmp_path / "models", WAYS["included"])
    (tmp_path / "linked.xml").symlink_to(real)
    assert imported(tmp_path / "linked.xml").mechanism.bodies == imported(real).mechanism.bodies


def test_an_asset_is_looked_for_in_folders_that_are_named_after_it(tmp_path: Path) -> None:
    """``meshdir`` may stand below the mesh, and what it leads to may be a link."""
    (tmp_path / "in" / "meshes").mkdir(parents=True)
    (tmp_path / "secret.stl").write_bytes(b"")
    (tmp_path / "in" / "meshes" / "m.stl").symlink_to(tmp_path / "secret.stl")
    text = with_asset('<mesh name="m" file="m.stl"/>').replace("</mujoco>", '<compiler meshdir="meshes"/></mujoco>')
    with pytest.raises(MjcfError, match=r"mesh\.file = 'm\.stl' leads out of the folder"):
        imported(written(tmp_path / "in", {"": text}))


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("<equality>", '<equality><weld body1="crank" body2="coupler"/>', "body 'crank' and body 'coupler'"),
        ("<equality>", '<equality><weld name="clamp" body1="follower"/>', "equality 'clamp', of body 'follower'"),
        ('<connect name="B" site1="b2" site2="b3"/>', '<weld body1="follower" body2="coupler"/>', "body 'coupler'"),
    ],
)
def test_a_weld_that_locks_a_linkage_is_told_as_that(tmp_path: Path, before: str, after: str, words: str) -> None:
    """The crank, the coupler and the ground lie in line here: by its first order alone the last one could move."""
    said = refused(written(tmp_path, {"": PLAIN.replace(before, after)}), tmp_path)
    assert "a weld locks the linkage (" in said
    assert words in said
    assert "make it a connect" in said


# ------------------------------------------------------------------ the command


def test_the_command_writes_one_file_and_says_what_it_left_out(tmp_path: Path) -> None:
    path, out = written(tmp_path, {"": PLAIN}), tmp_path / "new" / "four-bar.toml"
    done = CliRunner().invoke(app, ["import", str(path), "--out", str(out)])
    assert done.exit_code == 0, done.output
    assert "drive D at 6.25 rad/s" in done.output
    assert f"written: {out}" in done.output
    assert sorted(p.name for p in out.parent.iterdir()) == ["four-bar.map.toml", "four-bar.toml"]
    assert load(out) == imported(path).mechanism
    again = CliRunner().invoke(app, ["import", str(path), "--out", str(out), "--json"])
    assert again.exit_code == 0
    found = json.loads(again.stdout)
    assert found["schema"] == 1
    assert found["case"] == "four-bar"
    assert found["path"] == str(out)
    assert any("gravity across the plane" in note for note in found["notes"])


def test_another_file_is_not_replaced(tmp_path: Path) -> None:
    path, out = written(tmp_path, {"": PLAIN}), tmp_path / "mine.toml"
    out.write_text("# mine\n", encoding="utf-8")
    command = ["import", str(path), "--out", str(out)]
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 2
    assert "--overwrite" in done.stderr
    assert out.read_text(encoding="utf-8") == "# mine\n"
    assert CliRunner().invoke(app, [*command, "--overwrite", "-q"]).stdout == ""
    assert load(out).name == "four-bar"


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="Linux says there how much memory was used")
def test_5000_bodies_cost_little(tmp_path: Path) -> None:
    path = written(tmp_path, {"": MANY})
    text = (
        "from sim_models.mjcf.errors import MjcfError\n"
        "from sim_models.mjcf.imported import imported\n"
        f"try: imported({str(path)!r})\nexcept MjcfError: pass\n"
        "print(open('/proc/self/status').read().split('VmHWM:')[1].split()[0])"
    )
    own = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, "-c", text], env=own, capture_output=True, text=True, timeout=30, check=True)
    assert int(done.stdout) < 500_000  # kB


def test_loads_that_vary_and_stops_come_back_from_an_export(tmp_path: Path) -> None:
    """And act as they did: over a slide's travel, a body's place, against the motion; a stop's angle in its turn."""
    told = load("slider-crank").with_clearances({})
    given = told.replace(
        loads=(
            Load(body="rod", force=(3.0, -5.0)),
            Load(body="slider", force=(-1.0, 0.0), over="position_S", table=((0.07, 900.0), (0.17, 100.0))),
            Load(body="crank", torque=-2.0, opposes=True, over="rod_y", start=0.0, end=1.0),
        ),
        stops=[
            {"joint": "S", "to": 0.13, "stiffness": 4e4, "damping": 1.0},
            {"joint": "B", "to": 0.2, "stiffness": 20.0},
        ],
    )
    angles = np.radians(np.arange(5.0, 360.0, 10.0))
    lc.export(given, simulator="mujoco", folder=tmp_path, angles=angles[:2])
    back = lc.import_mjcf(tmp_path / "model.xml")
    assert back.mechanism.stops == given.stops
    assert set(back.mechanism.loads[1:]) == set(given.loads[1:])
    assert any("'beyond_mjcf' has loads that vary and stops" in note for note in back.notes)
    right, found = (lc.analyse(m, angles=angles) for m in (given, back.mechanism))
    for name in ("drive_torque", "reaction_B_x", "reaction_S_y"):
        np.testing.assert_allclose(found[name], right[name], rtol=0, atol=1e-9 * np.abs(right[name]).max())
    text = (tmp_path / "model.xml").read_text(encoding="utf-8")
    (tmp_path / "model.xml").write_text(text.replace("&quot;assembly&quot;", "&quot;asembly&quot;"), encoding="utf-8")
    with pytest.raises(MjcfError, match="its text 'beyond_mjcf' is not as an export writes it"):
        lc.import_mjcf(tmp_path / "model.xml")

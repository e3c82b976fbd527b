"""In which turn a body lies: the one that the assembly says, whatever angle its slide is written with; springs, courses
and exports begin there.  Held to MuJoCo's own arrays, of models that are written here or that MuJoCo alone reads.
"""

from __future__ import annotations

import cmath
import itertools
import math
from pathlib import Path

import mujoco
import numpy as np
import pytest

import linkage_crosscheck as lc
from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.mechanism import Mechanism
from analytic.mechanism.file import dumps, loads
from engines_here import missing
from linkages import inverted_slider
from marks import slow
from mjcf_raw import Raw
from multiplier_oracle import Oracle
from sim_models.mjcf.imported import imported

TURN = 2 * math.pi
SIDES = {"crank": 0.4, "cylinder": 2.7, "rod": -0.9}  # rad, within half a turn
PIVOT, ARM = 0.25 + 0.1j, 0.08 * cmath.exp(0.4j)  # m, of the cylinder and the crank in the ground frame
ALONG = (ARM - PIVOT) / abs(ARM - PIVOT)  # the way of the slide there


def swinging_cylinder(turns: tuple[int, int, int], written: int, **fields: object) -> Mechanism:
    """A crank, a rod on it, and a cylinder on the ground along which the rod slides; the assembly has its bodies so
    many turns on, the slide's angle is written so many turns off.
    """
    told = {b: SIDES[b] + TURN * k for b, k in zip(SIDES, turns, strict=True)}
    axis = ALONG * cmath.exp(-1j * SIDES["cylinder"])
    return Mechanism.model_validate({
        "name": "swinging cylinder",
        "ground": {"points": {"D": (0.0, 0.0), "E": (PIVOT.real, PIVOT.imag)}},
        "body": [
            {"name": "crank", "points": {"D": (0, 0), "A": (0.08, 0)}, "mass": 0.2, "inertia": 3e-4},
            {"name": "cylinder", "points": {"E": (0, 0), "S": (0, 0)}, "mass": 0.4, "com": (0.05, 0), "inertia": 8e-4},
            {"name": "rod", "points": {"A": (0, 0), "S": (0, 0)}, "mass": 0.3, "com": (0.03, -0.01), "inertia": 5e-4},
        ],
        "joint": [
            {"name": "D", "type": "revolute", "bodies": ("ground", "crank")},
            {"name": "A", "type": "revolute", "bodies": ("crank", "rod")},
            {"name": "E", "type": "revolute", "bodies": ("ground", "cylinder")},
            {
                "name": "S", "type": "prismatic", "bodies": ("cylinder", "rod"), "axis": (axis.real, axis.imag),
                "angle": SIDES["rod"] - SIDES["cylinder"] + TURN * written,
            },
        ],
        "drive": {"joint": "D", "speed": 3.0},
        "assembly": told,
    } | fields)  # fmt: skip


def same_in_mujoco(m: Mechanism) -> str:
    """The same, written for MuJoCo from the assembly's angles alone: a hinge's coordinate is its body's angle, and the
    length of a tendon the angle of a joint.
    """
    told, joints = m.assembly, {j.name: j for j in m.joints}
    spring = {name: f'stiffness="{j.stiffness!r}" springlength="{j.rest_angle!r}"' for name, j in joints.items()}
    inertial = {
        b.name: f'<inertial pos="{b.centre.real!r} {b.centre.imag!r} 0" mass="{b.mass!r}" '
        f'diaginertia="1e-3 1e-3 {b.moment_of_inertia!r}"/>'
        for b in m.bodies
    }
    far = ARM - PIVOT
    at, way = far * cmath.exp(-1j * told["cylinder"]), ALONG * cmath.exp(-1j * told["rod"])
    turned = told["rod"] - told["cylinder"]  # a constant of the rod's angle, which is no coordinate
    rest = joints["A"].rest_angle - turned
    return f"""
<mujoco>
  <compiler angle="radian"/><option gravity="0 0 0"/>
  <default><joint axis="0 0 1"/></default>
  <worldbody>
    <body name="crank" euler="0 0 {told["crank"]!r}"><joint name="D" ref="{told["crank"]!r}"/>{inertial["crank"]}
      <site name="tip" pos="0.08 0 0"/></body>
    <body name="cylinder" pos="{PIVOT.real!r} {PIVOT.imag!r} 0" euler="0 0 {told["cylinder"]!r}">
      <joint name="E" ref="{told["cylinder"]!r}"/>{inertial["cylinder"]}
      <body name="rod" pos="{at.real!r} {at.imag!r} 0" euler="0 0 {turned!r}">
        <joint name="S" type="slide" axis="{way.real!r} {way.imag!r} 0" ref="{abs(far)!r}"/>
        {inertial["rod"]}<site name="end"/></body>
    </body>
  </worldbody>
  <tendon>
    <fixed name="E" {spring["E"]}><joint joint="E" coef="1"/></fixed>
    <fixed name="S" {spring["S"]}><joint joint="S" coef="1"/></fixed>
    <fixed name="A" stiffness="{joints["A"].stiffness!r}" springlength="{rest!r}">
      <joint joint="E" coef="1"/><joint joint="D" coef="-1"/></fixed>
  </tendon>
  <equality><connect site1="tip" site2="end"/></equality>
</mujoco>"""


def sprung(m: Mechanism) -> Mechanism:
    for name, (stiffness, rest) in {"A": (0.7, 0.3), "E": (1.1, -0.8), "S": (40.0, 0.2)}.items():
        m = m.with_joint(name, stiffness=stiffness, rest_angle=rest)
    return m


def wound(seed: int) -> Mechanism:
    rng = np.random.default_rng(seed)
    first, second, third, written = rng.integers(-1, 2, 4).tolist()
    return swinging_cylinder((first, second, third), written)


# ------------------------------------------------------------------ the rule


def test_a_slide_s_angle_is_written_in_any_turn() -> None:
    """The torque of the spring in E is what its turns make of it, in all the ways to write the same linkage."""
    for turns in ((0, 0, 0), (0, 1, 0), (1, -1, 1)):
        one, *others = (sprung(swinging_cylinder(turns, written)) for written in (0, -1, 2))
        for other in others:
            assert other.joint("S").angle == pytest.approx(one.joint("S").angle, abs=1e-14)
            assert other.with_joint("S", angle=one.joint("S").angle) == one
        home = lc.analyse(one, angles=np.array([one.assembly["crank"]]))
        for body in SIDES:
            assert home.signals[f"{body}_angle"] == pytest.approx(one.assembly[body], abs=1e-12)
        assert home.signals["position_E"] == pytest.approx(one.assembly["cylinder"], abs=1e-12)
        assert loads(dumps(one)) == one


def test_a_spring_at_rest_in_its_own_turn_gives_nothing() -> None:
    for turns in ((0, 0, 0), (0, 1, 1), (1, -1, 0)):
        m = swinging_cylinder(turns, written=1)
        m = m.with_joint("E", stiffness=1.0, cubic=2.0, rest_angle=m.assembly["cylinder"])
        still = lc.analyse(m, angles=np.array([m.assembly["crank"]]), motion="static")
        assert np.abs(still.signals["drive_torque"]).max() < 1e-12


def test_a_body_of_which_the_assembly_is_silent_lies_behind_its_slide() -> None:
    """It takes its neighbour's angle and the joint's, from either side; the next one has its own turn."""
    m = swinging_cylinder((0, 1, 0), written=-1)
    silent = m.replace(assembly={b: a for b, a in m.assembly.items() if b != "rod"}).with_joint("S", angle=TURN + 0.3)
    assert silent.joint("S").angle == TURN + 0.3
    found = lc.analyse(silent, angles=np.array([silent.assembly["crank"]])).signals
    assert found["rod_angle"] == pytest.approx(found["cylinder_angle"] + TURN + 0.3, abs=1e-12)
    silent = m.replace(assembly={b: a for b, a in m.assembly.items() if b != "cylinder"})
    found = lc.analyse(silent, angles=np.array([silent.assembly["crank"]])).signals
    assert found["rod_angle"] == pytest.approx(m.assembly["rod"], abs=1e-12)


def test_an_assembly_angle_behind_a_slide_that_cannot_be_is_said() -> None:
    m = swinging_cylinder((0, 0, 0), written=0)
    with pytest.raises(AssemblyError, match=r"rod would be at -0\.9000 rad, assembly\.rod says -1\.8000; correct it"):
        Assembly(m.replace(assembly={**m.assembly, "rod": -1.8}))
    near = Assembly(m.replace(assembly={**m.assembly, "rod": -0.5 - TURN}))
    assert near.mechanism.joint("S").angle == pytest.approx(SIDES["rod"] - SIDES["cylinder"] - TURN, abs=1e-12)


def test_a_course_of_a_driven_joint_begins_in_the_assembly_s_turn() -> None:
    m = sprung(swinging_cylinder((0, 1, -1), written=2)).replace(drive={"joint": "E", "speed": 0.5})
    found = lc.analyse(m, times=np.linspace(0.0, 0.2, 5)).signals
    assert found["position_E"] == pytest.approx(m.assembly["cylinder"] + 0.5 * np.linspace(0.0, 0.2, 5), abs=1e-12)
    assert found["rod_angle"][0] == pytest.approx(m.assembly["rod"], abs=1e-12)


# ------------------------------------------------------------------ MuJoCo's own arrays


@pytest.mark.mujoco
@pytest.mark.parametrize("seed", range(12))
def test_wound_springs_push_as_in_a_model_written_for_mujoco(seed: int) -> None:
    """The crank's torque by MuJoCo's passive forces, and each joint's position by its tendon's length."""
    m = sprung(wound(seed))
    raw = Raw(same_in_mujoco(m), "D")
    found = lc.analyse(m, angles=np.array([m.assembly["crank"]])).signals
    assert found["drive_torque"] == pytest.approx([raw.torque(3.0)], rel=1e-6)
    rod = m.assembly["rod"] - m.assembly["cylinder"]
    lengths = dict(zip("ESA", raw.d.ten_length + np.array([0.0, 0.0, rod]), strict=True))
    for joint, length in lengths.items():
        assert found[f"position_{joint}"] == pytest.approx([length], abs=1e-9), joint


@pytest.mark.mujoco
@pytest.mark.parametrize("seed", range(12))
def test_an_imported_file_s_springs_are_in_its_turns(seed: int, tmp_path: Path) -> None:
    """Whatever turns its coordinates count from; by way of the mechanism file that is written."""
    text = same_in_mujoco(sprung(wound(seed)))
    path = tmp_path / "wound.xml"
    path.write_text(text.replace("</mujoco>", '<actuator><velocity joint="D"/></actuator></mujoco>'), encoding="utf-8")
    m = loads(dumps(imported(path).mechanism)).replace(drive={"joint": "D", "speed": 3.0})
    found = lc.analyse(m, angles=np.array([m.assembly["crank"]])).signals
    assert found["drive_torque"] == pytest.approx([Raw(text, "D").torque(3.0)], rel=1e-6)


def same_unwound(m: Mechanism) -> Mechanism:
    """The same linkage with all bodies within half a turn, and springs that rest as many turns back."""
    turns = {b: round((m.assembly[b] - SIDES[b]) / TURN) for b in SIDES} | {"ground": 0}
    for name in "AE":
        (first, second), rest = m.joint(name).bodies, m.joint(name).rest_angle
        m = m.with_joint(name, rest_angle=rest - TURN * (turns[second] - turns[first]))
    return m.replace(assembly=SIDES)


@pytest.mark.parametrize("simulator", ["mujoco", *slow("exudyn", "pybullet", "dart")])
def test_engines_hold_bodies_in_their_turns(simulator: str) -> None:
    """Springs push as in the linkage unwound, in ideal joints and in a pin with clearance."""
    if missing(simulator):
        pytest.skip(missing(simulator))
    m = sprung(wound(5))
    assert {round((m.assembly[b] - SIDES[b]) / TURN) for b in SIDES} == {1, -1}
    found = []
    for one in (m, same_unwound(m)):
        angles = one.assembly["crank"] + np.array([0.0, 0.3])
        for joint_model, clearance in (("ideal", None), ("spring-damper", {"E": 1e-4})):
            request = {"joint_model": joint_model, "clearance": clearance, "motion": "static"}
            (run,) = lc.crosscheck(one, simulator, angles=angles, **request).runs
            found.append(run.simulated)
    for wound_up, unwound in zip(found[:2], found[2:], strict=True):
        assert wound_up["drive_torque"] == pytest.approx(unwound["drive_torque"], rel=1e-6)
        for body in SIDES:
            assert wound_up[f"{body}_angle"][0] == pytest.approx(m.assembly[body], abs=1e-3)


@pytest.mark.mujoco
def test_a_run_of_somebody_s_file_has_its_springs_in_its_turns(tmp_path: Path) -> None:
    """With the mechanism as it is imported, and with one that was written in other turns."""
    stiff = '<default><equality solref="8e-4 1" solimp="0.9999 0.9999 0.001"/>'
    m, path = sprung(wound(5)), tmp_path / "wound.xml"
    text = same_in_mujoco(m).replace("<option ", '<option timestep="2e-4" ').replace("<default>", stiff)
    path.write_text(text.replace("</mujoco>", '<actuator><velocity joint="D"/></actuator></mujoco>'), encoding="utf-8")
    for one in (imported(path).mechanism.replace(drive={"joint": "D", "speed": 3.0}), m, same_unwound(m)):
        result = lc.crosscheck(one, f"mjcf:{path}", angles=one.assembly["crank"] + np.array([0.0, 0.2]))
        assert result.verdict == "agrees"


def test_the_order_of_bodies_changes_nothing() -> None:
    """A block whose angle is a turn off its guide's, with a spring along it, held to multipliers: the torque was 65 %
    off where the arm came first.
    """
    m = inverted_slider()
    oracle = Oracle(m)
    theta, poses = oracle.walk(TURN)
    found, angles = oracle.solve(theta, poses, True), theta[::15]
    for order in itertools.permutations(m.bodies):
        signals = lc.analyse(m.replace(bodies=order), angles=angles).signals
        np.testing.assert_allclose(signals["drive_torque"], found.torque[::15], rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(signals["block_angle"], found.angles["block"][::15], atol=1e-9)


MODELS = [
    ("ideal", {}),
    *slow(("contact", {"E": 1e-4}), ("spring-damper", {"A": 1e-4, "E": 1e-4}), ("massless-link", {"E": 1e-4})),
]


@pytest.mark.mujoco
@pytest.mark.parametrize(("joint_model", "clearances"), MODELS)
def test_an_export_holds_its_springs_energy(joint_model: str, clearances: dict[str, float], tmp_path: Path) -> None:
    """What MuJoCo alone says is stored where the exported run begins: 1/2 k (position - rest)^2 of every spring.  Soft
    loops are open there by a little.
    """
    for seed in range(2):
        m = sprung(wound(seed)).with_clearances(clearances)
        lc.export(m, "mujoco", joint_model=joint_model, folder=tmp_path / str(seed))
        model = mujoco.MjModel.from_xml_path(str(tmp_path / str(seed) / "model.xml"))
        model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, 0)
        mujoco.mj_forward(model, data)
        at = lc.analyse(m.with_clearances({}), angles=data.joint("crank").qpos).signals
        stored = sum(0.5 * j.stiffness * (at[f"position_{j.name}"][0] - j.rest_angle) ** 2 for j in m.joints)
        assert data.energy[0] == pytest.approx(stored, rel=1e-2 if clearances else 1e-6)

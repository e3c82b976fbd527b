"""A log that MuJoCo itself wrote of somebody's model, by the names in it: read through the map that ``import`` writes,
it agrees with the analytic model.
"""

from __future__ import annotations

import math
from pathlib import Path

import mujoco
import numpy as np
import pytest

import linkage_crosscheck as lc
from analytic.mechanism.columns import Layout, read_map
from commands import compare
from marks import slow

pytestmark = pytest.mark.mujoco
STEP, EVERY, DURATION = 2e-5, 50, 0.6  # s, steps between samples, s
SETTLED = 0.1  # s, after which nothing is left of how the run began
SHARE = 1e-3  # of each signal's peak
HEAD = """<mujoco model="rig">
  <option timestep="2e-5" gravity="0 0 -9.81"/>
  <default>
    <geom contype="0" conaffinity="0"/>
    <equality solref="8e-5 1" solimp="0.9999 0.9999 0.001"/>
  </default>"""
SLIDER_CRANK = f"""{HEAD}
  <worldbody>
    <body name="crank" pos="0 0 1" euler="0 30 0">
      <joint name="motor" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 0.2 0 0" size="0.01" mass="1.0"/>
      <site name="chip" pos="0.1 0 0"/>
      <body name="rod" pos="0.2 0 0" euler="0 -39.5940682269 0">
        <joint name="pin" axis="0 1 0"/>
        <geom type="capsule" fromto="0 0 0 0.6 0 0" size="0.01" mass="0.5"/>
      </body>
    </body>
    <body name="slider" pos="0.7648128 0 1">
      <joint name="slide" type="slide" axis="-1 0 0" ref="0.3"/>
      <geom type="box" size="0.03 0.03 0.03" mass="2.0"/>
    </body>
  </worldbody>
  <equality><connect name="B" body1="rod" body2="slider" anchor="0.6 0 0"/></equality>
  <actuator><motor name="m" joint="motor" gear="0.1"/></actuator>
  <sensor>
    <gyro name="gyro" site="chip"/> <jointpos name="angle" joint="motor"/> <actuatorfrc name="f" actuator="m"/>
  </sensor>
</mujoco>"""
FOUR_BAR = f"""{HEAD}
  <worldbody>
    <body name="crank">
      <joint name="D" axis="0 -1 0" ref="20" damping="0.02"/>
      <geom type="capsule" fromto="0 0 0 0.05 0 0" size="0.005" mass="0.05"/>
      <body name="coupler" pos="0.05 0 0" euler="0 -56.387625 0">
        <joint name="A" axis="0 1 0"/> <geom type="capsule" fromto="0 0 0 0.12 0 0" size="0.005" mass="0.1"/>
      </body>
    </body>
    <body name="follower" pos="0.12 0 0" euler="0 -92.046713 0">
      <joint name="E" axis="0 -1 0"/> <geom type="capsule" fromto="0 0 0 0.1 0 0" size="0.005" mass="0.08"/>
    </body>
  </worldbody>
  <equality><connect name="B" body1="follower" body2="coupler" anchor="0.1 0 0"/></equality>
  <actuator><motor name="m" joint="D"/></actuator>
</mujoco>"""


def logged(xml: str, turns: float) -> dict[str, np.ndarray]:
    """What MuJoCo says at even times of a model whose motor follows to and fro by so many radians: its arrays, by the
    names in the file.
    """
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    gear, start = float(model.actuator_gear[0, 0]), float(data.qpos[0])
    dof = int(model.jnt_dofadr[model.actuator_trnid[0, 0]])
    rows: list[dict[str, float]] = []
    for k in range(round(DURATION / STEP) + 1):
        phase = 8.0 * data.time
        wanted, rate = start + turns * (1 - math.cos(phase)), 8.0 * turns * math.sin(phase)
        data.ctrl[0] = (40.0 * (wanted - data.qpos[dof]) + 4.0 * (rate - data.qvel[dof])) / gear
        mujoco.mj_forward(model, data)
        if k % EVERY == 0 and data.time > SETTLED:
            row = {"time [s]": data.time}
            for j in range(model.njnt):
                name = model.joint(j).name
                row |= {f"qpos_{name}": data.qpos[j], f"qvel_{name}": data.qvel[j]}
            row |= {f"actuator_force_{model.actuator(0).name}": data.actuator_force[0]}
            for i in range(model.nsensor):
                at, size, name = int(model.sensor_adr[i]), int(model.sensor_dim[i]), model.sensor(i).name
                axes = ("",) if size == 1 else ("_x", "_y", "_z")
                row |= {f"sensordata_{name}{axes[d]}": data.sensordata[at + d] for d in range(size)}
            rows.append({heading: float(value) for heading, value in row.items()})
        mujoco.mj_step(model, data)
    return {heading: np.array([row[heading] for row in rows]) for heading in rows[0]}


@pytest.mark.parametrize(("name", "xml", "turns"), [*slow(("sc", SLIDER_CRANK, 0.5)), ("fb", FOUR_BAR, 1.0)])
def test_a_log_of_mujoco_agrees_through_the_map_of_an_import(tmp_path: Path, name: str, xml: str, turns: float) -> None:
    (tmp_path / f"{name}.xml").write_text(xml)
    done = compare("import", f"{name}.xml", "--out", f"{name}.toml", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert f"written: {name}.map.toml" in done.stdout
    log = logged(xml, turns)
    text = (tmp_path / f"{name}.toml").read_text().replace("speed = 1.0", 'speed = "measured"')
    (tmp_path / f"{name}.toml").write_text(text)
    np.savetxt(
        tmp_path / "log.csv", np.column_stack(list(log.values())), "%.12g", ",", header=",".join(log), comments=""
    )
    result = lc.check(tmp_path / "log.csv", tmp_path / f"{name}.toml", map=tmp_path / f"{name}.map.toml")
    assert result.verdict == "agrees", result
    judged = {each.signal: each for each in result.runs[0].discrepancies}
    assert "drive_torque" in judged
    assert len(judged) == 3
    (run,) = result.runs
    for signal, each in judged.items():
        assert abs(each.max) < SHARE * np.nanmax(np.abs(run.simulated[signal])), signal
    # the map says something: a sign that is turned in it is found
    layout = read_map(tmp_path / f"{name}.map.toml", Layout)
    entry = "actuator_force_m"
    meaning = layout.columns[entry]
    turned = meaning.model_copy(update={"sign": -meaning.sign})  # type: ignore[union-attr]
    wrong = layout.model_copy(update={"columns": {**layout.columns, entry: turned}})
    assert lc.check(tmp_path / "log.csv", tmp_path / f"{name}.toml", map=wrong).verdict == "disagrees"


def test_relations_are_said_as_equations(tmp_path: Path) -> None:
    (tmp_path / "sc.xml").write_text(SLIDER_CRANK)
    relations = lc.import_mjcf(tmp_path / "sc.xml").relations
    for said in (
        "crank_angle = -qpos_motor - 0.523599",
        "position_slide = qpos_slide - 0.3",
        "drive_torque = -0.1 actuator_force_m",
        "crank_angular_velocity = -sensordata_gyro_y",
        "crank_angle = -sensordata_angle - 0.523599",
        "drive_torque = -0.1 sensordata_f",
    ):
        assert said in relations


@pytest.mark.parametrize("case", [*slow("five-bar"), "slider-crank"])
def test_an_export_says_what_the_coordinates_of_its_model_are(tmp_path: Path, case: str) -> None:
    """By its map the keyframe of the model is a pose of the linkage."""
    mechanism = lc.load(case)
    grid = {"times": [0.0, 0.01]} if case == "five-bar" else {"angles": [0.5]}
    lc.export(mechanism, "mujoco", folder=tmp_path, joint_model="ideal", **grid)
    assert "\n#   qpos_" in (tmp_path / "map.toml").read_text()
    columns = read_map(tmp_path / "map.toml", Layout).columns
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "model.xml"))
    placed = {}
    for joint in range(model.njnt):
        meaning = columns[f"qpos_{model.joint(joint).name}"]
        placed[meaning.signal] = float(meaning.of(model.key_qpos[0][joint]))  # type: ignore[union-attr]
    at = {"times": [float(model.key_time[0])]} if case == "five-bar" else {"angles": [placed.pop("crank_angle")]}
    angles = {"ground": 0.0}
    angles |= {
        body.name: float(lc.analyse(mechanism, **at).signals[f"{body.name}_angle"][0]) for body in mechanism.bodies
    }
    turning = [joint for joint in mechanism.joints if not joint.prismatic and f"position_{joint.name}" in placed]
    assert turning
    for joint in turning:
        first, second = joint.bodies
        apart = placed[f"position_{joint.name}"] - (angles[second] - angles[first])
        assert math.remainder(apart, math.tau) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.slow
def test_a_force_sensor_says_a_reaction_in_the_frame_of_its_body(tmp_path: Path) -> None:
    """The map turns it into the ground's frame.  The sensor's axes are those of its body turned by a quarter."""
    sensed = FOUR_BAR.replace(
        '<joint name="A" axis="0 1 0"/>', '<joint name="A" axis="0 1 0"/> <site name="cell" euler="0 90 0"/>'
    ).replace("</actuator>", '</actuator> <sensor><force name="cell" site="cell"/></sensor>')
    (tmp_path / "fb.xml").write_text(sensed)
    said = dict(each.split(" = ") for each in lc.import_mjcf(tmp_path / "fb.xml").relations)
    assert {said[f"reaction_A_{axis}"].split(", ")[1] for axis in "xy"} == {"in coupler's frame"}
    done = compare("import", "fb.xml", "--out", "fb.toml", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    mechanism = lc.load(tmp_path / "fb.toml").replace(drive={"joint": "D", "speed": "measured"})
    result = lc.check({"MuJoCo": logged(sensed, 1.0)}, mechanism, map=tmp_path / "fb.map.toml")
    theirs, ours = (
        side["reaction_A_magnitude"] * np.exp(1j * side["reaction_A_angle"])
        for side in (result.runs[0].simulated, result.runs[0].analytic)
    )
    assert np.nanmax(np.abs(theirs - ours)) < SHARE * np.nanmax(np.abs(ours))

"""What other programs log of linkages by themselves: models written by hand, read by their own sensors.

Nothing of the project is in them but the numbers of the linkage, so that they are a road to its answer of their own.
"""

from __future__ import annotations

from typing import Any

import numpy as np

SLIDER_CRANK = """
name = "rig"
gravity = [0.0, -9.81]
[ground]
points = { O = [0.0, 0.0], S = [0.0, 0.0] }
[[body]]
name = "crank"
points = { O = [0.0, 0.0], A = [0.05, 0.0] }
mass = 0.3
com = [0.02, 0.005]
inertia = 1e-4
[[body]]
name = "rod"
points = { A = [0.0, 0.0], B = [0.12, 0.0] }
mass = 0.21
com = [0.06, 0.0]
inertia = 2.5e-4
[[body]]
name = "slider"
points = { B = [0.0, 0.0], S = [0.0, 0.0] }
mass = 0.14
[[joint]]
name = "O"
type = "revolute"
bodies = ["ground", "crank"]
[[joint]]
name = "A"
type = "revolute"
bodies = ["crank", "rod"]
[[joint]]
name = "B"
type = "revolute"
bodies = ["rod", "slider"]
[[joint]]
name = "S"
type = "prismatic"
bodies = ["ground", "slider"]
axis = [1.0, 0.0]
[drive]
joint = "O"
speed = "measured"
[assembly]
crank = 0.0
rod = 0.0
slider = 0.0
[[sensor]]
name = "slider_chip"
kind = "accelerometer"
body = "slider"
[[sensor]]
name = "rod_chip"
kind = "accelerometer"
body = "rod"
point = [0.09, 0.01]
axis = [0.0, 1.0]
[[sensor]]
name = "rod_gyro"
kind = "gyro"
body = "rod"
[[sensor]]
name = "cell"
kind = "force"
body = "rod"
point = "A"
"""
SLIDER_CRANK_XML = """
<mujoco>
  <compiler autolimits="true"/>
  <option timestep="2e-5" gravity="0 -9.81 0" integrator="implicit"/>
  <default><equality solref="-4e8 -4e4"/></default>
  <worldbody>
    <body name="crank">
      <joint name="motor" type="hinge" axis="0 0 1"/>
      <inertial pos="0.02 0.005 0" mass="0.3" diaginertia="1e-4 1e-4 1e-4"/>
      <body name="rod" pos="0.05 0 0">
        <joint name="knee" type="hinge" axis="0 0 1"/>
        <inertial pos="0.06 0 0" mass="0.21" diaginertia="2.5e-4 2.5e-4 2.5e-4"/>
        <site name="on_rod" pos="0.09 0.01 0"/>
        <site name="in_knee" pos="0 0 0"/>
      </body>
    </body>
    <body name="slider" pos="0.17 0 0">
      <joint name="rail" type="slide" axis="1 0 0"/>
      <inertial pos="0 0 0" mass="0.14" diaginertia="1e-4 1e-4 1e-4"/>
      <site name="on_slider"/>
    </body>
  </worldbody>
  <equality><connect body1="rod" body2="slider" anchor="0.12 0 0"/></equality>
  <actuator><velocity name="servo" joint="motor" kv="2"/></actuator>
  <sensor>
    <accelerometer name="a_slider" site="on_slider"/>
    <accelerometer name="a_rod" site="on_rod"/>
    <gyro name="w_rod" site="on_rod"/>
    <force name="f_knee" site="in_knee"/>
  </sensor>
</mujoco>
"""


def mujoco_log(
    xml: str, speed: float, since: float = 0.05, until: float = 0.5, every: int = 50
) -> dict[str, np.ndarray]:
    """What MuJoCo itself says of a model whose only servo is told a speed (rad/s): its joint coordinates, its sensors
    component by component and the servo's torque, by name (N,), from when its start has died away.
    """
    import mujoco

    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    data.qvel[0] = speed
    data.ctrl[0] = speed
    rows: list[dict[str, float]] = []
    while data.time < until:
        for _ in range(every):
            mujoco.mj_step(model, data)
        mujoco.mj_forward(model, data)  # sensors of this instant, not of the step before
        if data.time > since:
            rows.append(_row(mujoco, model, data))
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def _row(mujoco: Any, model: Any, data: Any) -> dict[str, float]:
    row = {"time": float(data.time)}
    for k in range(model.njnt):
        row[f"qpos_{model.joint(k).name}"] = float(data.qpos[model.jnt_qposadr[k]])
    for k in range(model.nsensor):
        begin = model.sensor_adr[k]
        parts = zip("xyz", data.sensordata[begin : begin + model.sensor_dim[k]], strict=False)
        row |= {f"{model.sensor(k).name}_{axis}": float(value) for axis, value in parts}
    return row | {f"force_{model.actuator(k).name}": float(data.actuator_force[k]) for k in range(model.nu)}

"""What other programs log of linkages by themselves: models written by hand, read by their own sensors.

Nothing of the project is in them but the numbers of the linkage, so that they are a road to its answer of their own.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

SLIDER_CRANK = """
name = "rig"
gravity = [0.0, -9.81]
body = [
  { name = "crank", points = { O = [0.0, 0.0], A = [0.05, 0.0] }, mass = 0.3, com = [0.02, 0.005], inertia = 1e-4 },
  { name = "rod", points = { A = [0.0, 0.0], B = [0.12, 0.0] }, mass = 0.21, com = [0.06, 0.0], inertia = 2.5e-4 },
  { name = "slider", points = { B = [0.0, 0.0], S = [0.0, 0.0] }, mass = 0.14 },
]
joint = [
  { name = "O", type = "revolute", bodies = ["ground", "crank"] },
  { name = "A", type = "revolute", bodies = ["crank", "rod"] },
  { name = "B", type = "revolute", bodies = ["rod", "slider"] },
  { name = "S", type = "prismatic", bodies = ["ground", "slider"], axis = [1.0, 0.0] },
]
[ground]
points = { O = [0.0, 0.0], S = [0.0, 0.0] }
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
  <option timestep="2e-5" gravity="0 -9.81 0" integrator="RK4"/>
  <default><equality solref="-1e8 -2e4"/></default>
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

FOUR_BAR_XML = """
<mujoco>
  <compiler autolimits="true" angle="radian"/>
  <option timestep="2e-5" gravity="0 -9.81 0" integrator="RK4"/>
  <default><equality solref="-1e8 -2e4"/></default>
  <worldbody>
    <body name="crank">
      <joint name="motor" type="hinge" axis="0 0 1"/>
      <inertial pos="0.025 0 0" mass="0.03925" diaginertia="8.504166667e-6 8.504166667e-6 8.504166667e-6"/>
      <body name="coupler" pos="0.05 0 0" euler="0 0 0.984149720637955">
        <joint name="knee" type="hinge" axis="0 0 1"/>
        <inertial pos="0.06 0 0" mass="0.0942" diaginertia="1.13825e-4 1.13825e-4 1.13825e-4"/>
        <site name="on_coupler" pos="0.1 0.02 0"/>
      </body>
    </body>
    <body name="follower" pos="0.12 0 0" euler="0 0 1.6065182091929755">
      <joint name="rocker" type="hinge" axis="0 0 1"/>
      <inertial pos="0.05 0 0" mass="0.0785" diaginertia="6.607083333e-5 6.607083333e-5 6.607083333e-5"/>
      <site name="foot"/>
    </body>
  </worldbody>
  <equality><connect body1="coupler" body2="follower" anchor="0.12 0 0"/></equality>
  <actuator><velocity name="servo" joint="motor" kv="0.5"/></actuator>
  <sensor>
    <accelerometer name="a_coupler" site="on_coupler"/>
    <gyro name="w_coupler" site="on_coupler"/>
    <force name="f_foot" site="foot"/>
  </sensor>
</mujoco>
"""


def mujoco_log(
    xml: str, speed: float, since: float = 0.05, until: float = 0.4, every: int = 50
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


PENDULUM = """
name = "arm"
gravity = [0.0, -9.81]
body = [
  { name = "arm", points = { O = [0.0, 0.0], tip = [0.3, 0.0] }, mass = 0.2355, com = [0.15, 0.0], inertia = 1.8e-3 },
]
joint = [
  { name = "O", type = "revolute", bodies = ["ground", "arm"] },
]
[ground]
points = { O = [0.0, 0.0] }
[drive]
joint = "O"
speed = "free"
[assembly]
arm = 0.4
"""
PENDULUM_URDF = """<robot name="pendulum">
<link name="base"/>
<link name="arm"><inertial><origin xyz="0.15 0 0"/><mass value="0.2355"/>
<inertia ixx="1.8e-3" iyy="1.8e-3" izz="1.8e-3" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="pin" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/></joint>
</robot>"""
SWING = 0.4  # rad, where the pendulum is let go


def pybullet_log(folder: Path, until: float = 0.6, step: float = 2e-5, every: int = 500) -> dict[str, np.ndarray]:
    """A pendulum that swings in PyBullet, by its joint's state: angle, and the reaction in the arm's frame, by name
    (N,).
    """
    import pybullet as p

    (folder / "pendulum.urdf").write_text(PENDULUM_URDF, encoding="utf-8")
    client = p.connect(p.DIRECT)
    try:
        flags = p.URDF_USE_INERTIA_FROM_FILE
        arm = p.loadURDF(str(folder / "pendulum.urdf"), useFixedBase=True, flags=flags, physicsClientId=client)
        p.setGravity(0, -9.81, 0, physicsClientId=client)
        p.setPhysicsEngineParameter(fixedTimeStep=step, numSubSteps=0, physicsClientId=client)
        p.changeDynamics(arm, 0, linearDamping=0, angularDamping=0, jointDamping=0, physicsClientId=client)
        p.setJointMotorControl2(arm, 0, p.VELOCITY_CONTROL, force=0, physicsClientId=client)
        p.enableJointForceTorqueSensor(arm, 0, True, physicsClientId=client)
        falls = -0.2355 * 9.81 * 0.15 * np.cos(SWING) / (1.8e-3 + 0.2355 * 0.15**2)  # rad/s2, at rest: half a step back
        p.resetJointState(arm, 0, SWING, -falls * step / 2, physicsClientId=client)
        rows = []
        for k in range(round(until / step) + 1):
            angle = p.getJointState(arm, 0, physicsClientId=client)[0]
            p.stepSimulation(physicsClientId=client)
            if k % every == 0:  # the reaction is of where the arm was before the step
                force = p.getJointState(arm, 0, physicsClientId=client)[2]
                rows.append((k * step, angle, force[0], force[1]))
    finally:
        p.disconnect(client)
    return dict(zip(("time", "angle", "Fx", "Fy"), np.array(rows).T, strict=True))


def exudyn_log(speed: float, until: float = 0.4, step: float = 1e-4, every: int = 10) -> dict[str, np.ndarray]:
    """The slider-crank in Exudyn at a constant speed (rad/s), by its own sensors, by name (N,): accelerations along the
    bodies' axes, without gravity; a joint's force on its first marker, ground frame.
    """
    import exudyn
    from exudyn.itemInterface import (
        MarkerBodyRigid,
        MarkerNodeCoordinate,
        NodePointGround,
        NodeRigidBody2D,
        ObjectConnectorCoordinate,
        ObjectGround,
        ObjectJointRevolute2D,
        ObjectRigidBody2D,
        SensorBody,
        SensorObject,
    )

    kinds = exudyn.OutputVariableType
    container = exudyn.SystemContainer()
    mbs = container.AddSystem()
    ground = mbs.AddObject(ObjectGround())
    fixed = mbs.AddMarker(MarkerNodeCoordinate(nodeNumber=mbs.AddNode(NodePointGround()), coordinate=0))
    nodes, bodies, sensors = {}, {}, {}
    turned = -0.05 * speed / 0.12  # rad/s, the rod's where the linkage is stretched
    for name, mass, inertia, place, velocity in (
        ("crank", 0.3, 1e-4, (0.02, 0.005, 0.0), (-0.005 * speed, 0.02 * speed, speed)),
        ("rod", 0.21, 2.5e-4, (0.11, 0.0, 0.0), (0.0, 0.05 * speed + 0.06 * turned, turned)),
        ("slider", 0.14, 1e-4, (0.17, 0.0, 0.0), (0.0, 0.0, 0.0)),
    ):
        nodes[name] = mbs.AddNode(NodeRigidBody2D(initialCoordinates=[*place], initialVelocities=[*velocity]))
        bodies[name] = mbs.AddObject(ObjectRigidBody2D(mass=mass, inertia=inertia, nodeNumber=nodes[name]))
        load = exudyn.itemInterface.LoadForceVector(
            markerNumber=mbs.AddMarker(MarkerBodyRigid(bodyNumber=bodies[name])), loadVector=[0, -9.81 * mass, 0]
        )
        mbs.AddLoad(load)

    def sense(name: str, sensor: Any, kind: Any, **where: Any) -> None:
        sensors[name] = mbs.AddSensor(sensor(**where, storeInternal=True, writeToFile=False, outputVariableType=kind))

    def pin(name: str, *ends: tuple[int, tuple[float, float]]) -> None:
        markers = [mbs.AddMarker(MarkerBodyRigid(bodyNumber=b, localPosition=[*at, 0.0])) for b, at in ends]
        number = mbs.AddObject(ObjectJointRevolute2D(markerNumbers=markers))
        sense(f"F_{name}", SensorObject, kinds.Force, objectNumber=number)

    def hold(name: str, body: str, coordinate: int, **how: Any) -> None:
        ends = [fixed, mbs.AddMarker(MarkerNodeCoordinate(nodeNumber=nodes[body], coordinate=coordinate))]
        number = mbs.AddObject(ObjectConnectorCoordinate(markerNumbers=ends, **how))
        sense(name, SensorObject, kinds.Force, objectNumber=number)

    pin("O", (ground, (0.0, 0.0)), (bodies["crank"], (-0.02, -0.005)))
    pin("A", (bodies["crank"], (0.03, -0.005)), (bodies["rod"], (-0.06, 0.0)))
    pin("B", (bodies["rod"], (0.06, 0.0)), (bodies["slider"], (0.0, 0.0)))
    hold("rail", "slider", 1)
    hold("upright", "slider", 2)
    hold("motor", "crank", 2, velocityLevel=True, offset=speed)
    sense("angle", SensorBody, kinds.Rotation, bodyNumber=bodies["crank"])
    sense("rod_a", SensorBody, kinds.AccelerationLocal, bodyNumber=bodies["rod"])
    sense("slider_a", SensorBody, kinds.AccelerationLocal, bodyNumber=bodies["slider"])
    sense("rod_w", SensorBody, kinds.AngularVelocity, bodyNumber=bodies["rod"])
    mbs.Assemble()
    settings = exudyn.SimulationSettings()
    settings.timeIntegration.numberOfSteps = round(until / step)
    settings.timeIntegration.endTime = until
    settings.timeIntegration.verboseMode = 0
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = every * step
    settings.timeIntegration.generalizedAlpha.spectralRadius = 0.8
    mbs.SolveDynamic(settings)
    stored = {name: np.atleast_2d(mbs.GetSensorStoredData(number))[2:] for name, number in sensors.items()}
    columns = {"time": stored["angle"][:, 0]}
    return columns | {f"{name}_{k}": rows[:, 1 + k] for name, rows in stored.items() for k in range(rows.shape[1] - 1)}

"""MJCF files of linkages with several motors, as somebody may have written them: axes that point down, slides that run
backwards, motors, servos, and keyframes that say how fast.
"""

from __future__ import annotations

STIFF = '<default><equality solref="8e-4 1" solimp="0.9999 0.9999 0.001 0.5 2"/></default>'
GEOM = 'type="capsule" size="0.005" density="7850" contype="0" conaffinity="0"'

FIVE_BAR = f"""
<mujoco model="five-bar">
  <compiler angle="radian"/><option timestep="2e-4" gravity="0 -9.81 0"/>{STIFF}
  <worldbody>
    <body name="left-crank" euler="0 0 2.094395"><joint name="D" axis="0 0 1"/><geom {GEOM} fromto="0 0 0 0.1 0 0"/>
      <body name="left-arm" pos="0.1 0 0" euler="0 0 -1.281639"><joint name="A" axis="0 0 1"/>
        <geom {GEOM} fromto="0 0 0 0.16 0 0"/><site name="p1" pos="0.16 0 0"/></body></body>
    <body name="right-crank" pos="0.12 0 0" euler="0 0 1.047198"><joint name="E" axis="0 0 -1"/>
      <geom {GEOM} fromto="0 0 0 0.1 0 0"/>
      <body name="right-arm" pos="0.1 0 0" euler="0 0 1.281639"><joint name="B" axis="0 0 1" damping="1e-3"/>
        <geom {GEOM} fromto="0 0 0 0.16 0 0"/><site name="p2" pos="0.16 0 0"/></body></body>
  </worldbody>
  <equality><connect name="P" site1="p1" site2="p2"/></equality>
  <actuator><velocity joint="D" kv="10"/><velocity joint="E" kv="10"/></actuator>
  <keyframe><key ctrl="2 1"/></keyframe>
</mujoco>"""


def cylinder(number: int, pos: str, angle: float, rod: float, axis: str, more: str) -> str:
    """A cylinder on the ground, and its rod, whose tip is 0.08 m ahead of its frame."""
    inertial = '<inertial pos="{} 0 0" mass="{}" diaginertia="{i} {i} {i}"/>'
    return f"""
    <body name="cylinder{number}" pos="{pos} 0" euler="0 0 {angle}">
      <joint name="A{number}" axis="0 0 {-1 if number == 3 else 1}"/>{inertial.format(0.04, 0.3, i=3e-4)}
      <body name="rod{number}" pos="{rod} 0 0">
        <joint name="S{number}" type="slide" axis="{axis} 0 0"/>{inertial.format(0.02, 0.1, i=2e-4)}
        {more}
      </body></body>"""


PLATFORM = """
        <body name="platform" pos="0.08 0 0" euler="0 0 0.170326"><joint name="C1" axis="0 0 1"/>
          <inertial pos="0.069282 0.04 0" mass="0.4" diaginertia="8e-4 8e-4 8e-4"/>
          <site name="q2" pos="0.138564 0 0"/><site name="q3" pos="0.069282 0.12 0"/></body>"""
THREE_RPR = f"""
<mujoco model="3-rpr">
  <compiler angle="radian"/><option timestep="2e-4" gravity="0 -9.81 0"/>{STIFF}
  <worldbody><site name="o"/>
    {cylinder(1, "-0.216506 -0.125", 0.329674, 0.1259743442061601, "1", PLATFORM)}
    {cylinder(2, "0.216506 -0.125", 2.289861679414099, 0.09691162258451895, "-1", '<site name="r2" pos="0.08 0 0"/>')}
    {cylinder(3, "0 0.25", -1.6784753391530938, 0.09078264663203083, "1", '<site name="r3" pos="0.08 0 0"/>')}
  </worldbody>
  <equality><connect name="C2" site1="q2" site2="r2"/><connect name="C3" site1="q3" site2="r3"/></equality>
  <actuator>
    <velocity joint="S1" kv="100"/><position joint="S2" kp="100"/><motor joint="S3"/>
    <general biastype="affine" biasprm="1 0 0" site="q3" refsite="o" gear="15 -10 0 0 0 0"/>
  </actuator>
  <keyframe><key ctrl="0.05 0 0 0" qvel="0 0 0 0 0.03 0 0.02"/></keyframe>
</mujoco>"""

ARM = """
<mujoco model="arm">
  <compiler angle="radian"/><option timestep="2e-4" gravity="0 -9.81 0"/>
  <worldbody><body name="upper-arm" euler="0 0 0.5">
    <joint name="O" axis="0 0 1"/><inertial pos="0.13 0 0" mass="0.8" diaginertia="7e-3 7e-3 7e-3"/>
    <body name="forearm" pos="0.3 0 0" euler="0 0 1.1">
      <joint name="K" axis="0 0 -1"/><inertial pos="0.19 0 0" mass="0.9" diaginertia="6e-3 6e-3 6e-3"/></body>
  </body></worldbody>
  <actuator><velocity joint="K" kv="10"/><velocity joint="O" kv="10"/></actuator>
  <keyframe><key ctrl="2 1.5"/></keyframe>
</mujoco>"""

THREE_CRANKS = f"""
<mujoco model="three cranks">
  <option timestep="2e-4" gravity="0 -9.81 0"/>{STIFF}
  <worldbody>
    <body name="crank" euler="0 0 60"><joint name="D" axis="0 0 1"/><geom {GEOM} fromto="0 0 0 0.1 0 0"/>
      <body name="coupler" pos="0.1 0 0" euler="0 0 -60"><joint name="A" axis="0 0 1"/>
        <geom {GEOM} fromto="0 0 0 0.4 0 0"/><site name="b1" pos="0.4 0 0"/><site name="m1" pos="0.2 0 0"/></body>
    </body>
    <body name="follower" pos="0.4 0 0" euler="0 0 60"><joint name="E" axis="0 0 1"/>
      <geom {GEOM} fromto="0 0 0 0.1 0 0"/><site name="b2" pos="0.1 0 0"/></body>
    <body name="middle" pos="0.2 0 0" euler="0 0 60"><joint name="F" axis="0 0 1"/>
      <geom {GEOM} fromto="0 0 0 0.1 0 0"/><site name="m2" pos="0.1 0 0"/></body>
  </worldbody>
  <equality><connect name="B" site1="b1" site2="b2"/><connect name="M" site1="m1" site2="m2"/></equality>
  <actuator><velocity joint="D" kv="10"/></actuator>
  <keyframe><key ctrl="2"/></keyframe>
</mujoco>"""

SLIDER_CRANK = f"""
<mujoco model="slider-crank">
  <option timestep="1e-4" gravity="1 -9.81 0" integrator="RK4"/>
  <default><equality solref="2e-3 1" solimp="0.9999 0.9999 0.001 0.5 2"/></default>
  <worldbody>
    <body name="crank" euler="0 0 50"><joint name="O" axis="0 0 -1"/><geom {GEOM} fromto="0 0 0 0.05 0 0"/>
      <body name="rod" pos="0.05 0 0" euler="0 0 -68.614"><joint name="A" axis="0 0 -1"/>
        <geom {GEOM} fromto="0 0 0 0.12 0 0"/></body>
    </body>
    <body name="slider" pos="0.1458596 0 0" euler="0 0 90">
      <joint name="S" type="slide" axis="0 -1 0" damping="2"/>
      <geom type="sphere" size="0.02" density="7850" pos="0.01 0.02 0" contype="0" conaffinity="0"/>
    </body>
  </worldbody>
  <equality><connect name="B" body1="slider" body2="rod" anchor="0 0 0"/></equality>
  <actuator><velocity joint="S" kv="50"/></actuator>
  <keyframe><key ctrl="-0.1"/></keyframe>
</mujoco>"""

FILES = {"five-bar": FIVE_BAR, "3-rpr": THREE_RPR, "arm": ARM}
RK4 = {'<option timestep="2e-4"': '<option integrator="RK4" timestep="1e-4"', "8e-4 1": "2e-3 1"}  # of twenty steps


def altered(text: str, changes: dict[str, str]) -> str:
    """A file with each of these texts, which it has (but for a loop's, where there is none), replaced."""
    for old, new in changes.items():
        assert old in text or "<equality>" not in text, old
        text = text.replace(old, new)
    return text

"""One four-bar, written as MJCF in many ways."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping
from pathlib import Path

import numpy as np

BAR = 'type="box" size="0.005" density="7850" contype="0" conaffinity="0"'
TAIL = """
  <actuator><velocity joint="D" kv="10"/></actuator>
  <keyframe><key ctrl="6.25"/></keyframe>"""
COUPLER, FOLLOWER = (math.degrees(angle) for angle in (0.984149720637955, 1.6065182091929755))

PLAIN = f"""
<mujoco model="four-bar">
  <worldbody>
    <body name="crank">
      <joint name="D" axis="0 0 1"/>
      <geom {BAR} fromto="0 0 0 0.05 0 0"/>
      <body name="coupler" pos="0.05 0 0" euler="0 0 {COUPLER}">
        <joint name="A" axis="0 0 1"/>
        <geom {BAR} fromto="0 0 0 0.12 0 0"/>
      </body>
    </body>
    <body name="follower" pos="0.12 0 0" euler="0 0 {FOLLOWER}">
      <joint name="E" axis="0 0 1"/>
      <geom {BAR} fromto="0 0 0 0.1 0 0"/>
    </body>
  </worldbody>
  <equality><connect name="B" site1="b2" site2="b3"/></equality>{TAIL}
</mujoco>"""
PLAIN = PLAIN.replace(
    '<geom type="box" size="0.005" density="7850" contype="0" conaffinity="0" fromto="0 0 0 0.12 0 0"/>',
    f'<geom {BAR} fromto="0 0 0 0.12 0 0"/><site name="b3" pos="0.12 0 0"/>',
).replace(
    f'<geom {BAR} fromto="0 0 0 0.1 0 0"/>', f'<geom {BAR} fromto="0 0 0 0.1 0 0"/><site name="b2" pos="0.1 0 0"/>'
)


def half(degrees: float) -> str:
    turn = np.radians(degrees) / 2
    return f"{np.cos(turn)!r} 0 0 {np.sin(turn)!r}".replace("np.float64(", "").replace(")", "")


MASS = {length: 7850 * 0.01 * 0.01 * length for length in (0.05, 0.12, 0.1)}


def inertial(length: float, turned: str = "") -> str:
    """A bar's inertial, given about axes in another order."""
    mass = MASS[length]
    long, across = mass * (0.01**2 + 0.01**2) / 12, mass * (length**2 + 0.01**2) / 12
    return f'<inertial pos="{length / 2} 0 0" mass="{mass!r}" diaginertia="{across!r} {across!r} {long!r}" {turned}/>'


WAYS: dict[str, dict[str, str]] = {
    "degrees, boxes from point to point": {"": PLAIN},
    "radians and quaternions": {
        "": PLAIN.replace("<worldbody>", '<compiler angle="radian"/><worldbody>')
        .replace(f'euler="0 0 {COUPLER}"', f'quat="{half(COUPLER)}"')
        .replace(f'euler="0 0 {FOLLOWER}"', f'quat="{half(FOLLOWER)}"')
    },
    "axes, and xyaxes": {
        "": PLAIN.replace(f'euler="0 0 {COUPLER}"', f'axisangle="0 0 1 {COUPLER}"').replace(
            f'euler="0 0 {FOLLOWER}"',
            f'xyaxes="{np.cos(np.radians(FOLLOWER)):.17g} {np.sin(np.radians(FOLLOWER)):.17g} 0'
            f' {-np.sin(np.radians(FOLLOWER)):.17g} {np.cos(np.radians(FOLLOWER)):.17g} 0"',
        )
    },
    "classes": {
        "": PLAIN.replace(f"<geom {BAR}", '<geom class="bar"')
        .replace(' axis="0 0 1"', "")
        .replace("<worldbody>", '<worldbody><body name="frame" childclass="hinges">')
        .replace("</worldbody>", "</body></worldbody>")
        .replace(
            "<worldbody>",
            '<default><default class="hinges"><joint type="hinge" axis="0 0 2"/></default>'
            f'<default class="bar"><geom {BAR}/></default></default><worldbody>',
        )
    },
    "inertials about turned axes, capsules only to be seen": {
        "": PLAIN.replace(f'<geom {BAR} fromto="0 0 0 0.05 0 0"/>', inertial(0.05, 'euler="0 90 0"'))
        .replace(f'<geom {BAR} fromto="0 0 0 0.12 0 0"/>', inertial(0.12, 'euler="0 90 0"'))
        .replace(
            f'<geom {BAR} fromto="0 0 0 0.1 0 0"/>',
            inertial(0.1, 'euler="0 90 0"') + '<geom type="capsule" size="0.004" fromto="0 0 0 0.1 0 0" mass="1"/>',
        )
        .replace("<worldbody>", '<compiler inertiafromgeom="auto"/><worldbody>')
    },
    "bodies without joints": {
        "": PLAIN.replace(
            f'<geom {BAR} fromto="0 0 0 0.05 0 0"/>',
            f'<body name="half" pos="0.02 0 0" euler="0 0 30"><body pos="0 0 0" euler="0 0 -30">'
            f'<geom {BAR} fromto="0 0 0 0.03 0 0"/></body></body><geom {BAR} fromto="0 0 0 0.02 0 0"/>',
        )
        .replace('<body name="crank">', '<body name="table" pos="0.3 0 0"><body name="crank" pos="-0.3 0 0">', 1)
        .replace('    <body name="follower"', '    </body><body name="follower"')
    },
    "the coupler cut in two and welded": {
        "": PLAIN.replace(
            f'<geom {BAR} fromto="0 0 0 0.12 0 0"/><site name="b3" pos="0.12 0 0"/>',
            f'<geom {BAR} fromto="0 0 0 0.07 0 0"/>',
        )
        .replace(
            '<site name="b2" pos="0.1 0 0"/>',
            f'<body name="other" pos="0.1 0 0" euler="0 0 {COUPLER - FOLLOWER}"><joint name="B" axis="0 0 1"/>'
            f'<geom {BAR} fromto="-0.05 0 0 0 0 0"/></body>',
        )
        .replace('<connect name="B" site1="b2" site2="b3"/>', '<weld name="cut" body1="coupler" body2="other"/>')
    },
    "plane y-z": {
        "": PLAIN.replace('axis="0 0 1"', 'axis="1 0 0"')
        .replace('pos="0.05 0 0"', 'pos="0 0.05 0"')
        .replace('pos="0.12 0 0"', 'pos="0 0.12 0"')
        .replace('pos="0.1 0 0"', 'pos="0 0.1 0"')
        .replace("0 0 0 0.05 0 0", "0 0 0 0 0.05 0")
        .replace("0 0 0 0.12 0 0", "0 0 0 0 0.12 0")
        .replace("0 0 0 0.1 0 0", "0 0 0 0 0.1 0")
        .replace(f'euler="0 0 {COUPLER}"', f'euler="{COUPLER} 0 0"')
        .replace(f'euler="0 0 {FOLLOWER}"', f'euler="{FOLLOWER} 0 0"')
    },
    "plane x-z": {
        "": PLAIN.replace('axis="0 0 1"', 'axis="0 -1 0"')
        .replace(f'euler="0 0 {COUPLER}"', f'euler="0 {-COUPLER} 0"')
        .replace(f'euler="0 0 {FOLLOWER}"', f'euler="0 {-FOLLOWER} 0"')
    },
    "hinges the other way round": {
        "": PLAIN.replace('name="D" axis="0 0 1"', 'name="D" axis="0 0 -1"')
        .replace('name="A" axis="0 0 1"', 'name="A" axis="0 0 -1" ref="40"')
        .replace('ctrl="6.25"', 'ctrl="-6.25"')
    },
    "a tilted plane, in a frame": {
        "": PLAIN.replace("<worldbody>", '<worldbody><frame pos="0.1 0.2 0.3" euler="20 30 40">').replace(
            "</worldbody>", "</frame></worldbody>"
        )
    },
    "layers, and a pin of bodies": {
        "": PLAIN.replace('name="coupler" pos="0.05 0 0"', 'name="coupler" pos="0.05 0 0.02"').replace(
            '<connect name="B" site1="b2" site2="b3"/>',
            '<connect name="B" body1="follower" body2="coupler" anchor="0.1 0 0"/>',
        )
    },
    "included": {
        "": "<mujoco>" + '<include file="parts/links.xml"/>' + PLAIN[PLAIN.index("<equality>") :],
        "parts/links.xml": "<mujocoinclude>"
        + PLAIN[PLAIN.index("<worldbody>") : PLAIN.index("<equality>")]
        + "</mujocoinclude>",
    },
    "closed in a keyframe only": {
        "": PLAIN.replace(f'euler="0 0 {COUPLER}"', "")
        .replace(f'euler="0 0 {FOLLOWER}"', "")
        .replace(
            '<key ctrl="6.25"/>',
            f'<key ctrl="6.25" qpos="0 {0.984149720637955!r} {1.6065182091929755!r}"/>',
        )
    },
    "open in the initial pose": {
        "": PLAIN.replace(f'euler="0 0 {COUPLER}"', 'euler="0 0 60"').replace(
            f'euler="0 0 {FOLLOWER}"', 'euler="0 0 90"'
        )
    },
    "a chain that the world closes, with a site there": {
        "": f"""
<mujoco>
  <worldbody>
    <body name="crank"><joint name="D"/><geom {BAR} fromto="0 0 0 0.05 0 0"/>
      <body name="coupler" pos="0.05 0 0" euler="0 0 {COUPLER}"><joint name="A"/><geom {BAR} fromto="0 0 0 0.12 0 0"/>
        <body name="follower" pos="0.12 0 0" euler="0 0 {FOLLOWER - COUPLER}">
          <joint name="B" axis="0 0 -1"/><geom {BAR} fromto="0 0 0 -0.1 0 0"/><site name="e" pos="-0.1 0 0"/>
        </body>
      </body>
    </body>
    <site name="e0" pos="0.12 0 0"/>
  </worldbody>
  <equality><connect name="E" site1="e" site2="e0"/></equality>{TAIL}
</mujoco>"""
    },
    "hung on the follower": {
        "": f"""
<mujoco>
  <worldbody>
    <body name="crank"><joint name="D"/><geom {BAR} fromto="0 0 0 0.05 0 0"/></body>
    <body name="follower" pos="0.12 0 0" euler="0 0 {FOLLOWER}">
      <joint name="E"/><geom {BAR} fromto="0 0 0 0.1 0 0"/>
      <body name="coupler" pos="0.1 0 0" euler="0 0 {180 + COUPLER - FOLLOWER}">
        <joint name="B"/><geom {BAR} fromto="0 0 0 0.12 0 0"/><site name="tip" pos="0.12 0 0"/>
      </body>
    </body>
    <site name="origin"/>
  </worldbody>
  <equality><connect name="A" body1="crank" body2="coupler" anchor="0.05 0 0"/></equality>{TAIL}
</mujoco>"""
    },
}


def written(folder: Path, files: Mapping[str, str]) -> Path:
    for name, text in files.items():
        path = folder / (name or "linkage.xml")
        path.parent.mkdir(exist_ok=True)
        path.write_text(textwrap.dedent(text).strip(), encoding="utf-8")
    return folder / "linkage.xml"

"""Every number of a MuJoCo model that can change how a linkage moves is read with its right value, named, or refused.

A row of the table changes something of a file in which it must matter: the two models' own arrays are compared, and
what of them differs is what the row is about.  A number without a row fails, and so does one of a newer MuJoCo.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import pytest

import linkage_crosscheck as lc
from asked import request_of
from marks import slow
from mjcf_files import BAR, COUPLER, FOLLOWER, written
from mjcf_raw import Raw, moved
from sim_models.engine import Unsupported
from sim_models.mjcf.engine import opened
from sim_models.mjcf.errors import MjcfError
from sim_models.mjcf.imported import imported
from sim_models.mjcf.known import ATTRIBUTES_BY_ELEMENT, KNOWN_ATTRIBUTES, numbers, unknown

pytestmark = pytest.mark.mujoco

# What takes no part in the physics of rigid links in ideal joints: how things are stored, derived and shown, how
# MuJoCo's solver goes about its work, and how soft its constraints are.
STORED = """
body: bvhadr bvhnum dofadr dofnum geomadr geomnum jntadr rootid sameframe simple treeid user weldid plugin
body: invweight0 subtreemass
jnt: actuatorid bodyid dofadr qposadr group user
dof: M0 Madr bodyid invweight0 jntid length parentid simplenum treeid
tendon: actuatorid adr group invweight0 length0 matid num rgba treeid treenum user width
actuator: acc0 actadr actnum ctrladr historyadr length0 outadr outnum plugin user
opt: magnetic
"""
SOLVED = """
jnt: solimp solref
dof: solimp solref
eq: solimp solref
tendon: solimp_fri solimp_lim solref_fri solref_lim
opt: ccd_iterations ccd_tolerance cone enableflags impratio integrator iterations jacobian ls_iterations ls_tolerance
opt: noslip_iterations noslip_tolerance o_friction o_margin o_solimp o_solref sdf_initpoints sdf_iterations
opt: sleep_tolerance solver timestep tolerance
"""


def fields(text: str) -> set[str]:
    lines = [line.partition(":") for line in text.strip().splitlines()]
    return {f"{what}_{name}" for what, _, names in lines for name in names.split()}


LOOP = '<connect name="B" site1="tip" site2="end"/>'
PLATE = '<body name="plate"><joint/><geom size="0.01" pos="1 0 0"/></body>'


def linkage(
    option: str = 'gravity="0 0 -9.81"', flag: str = "", servo: str = '<velocity joint="D" kv="10"/>', more: str = "",
    key: str = 'ctrl="6.25"', D: str = "", A: str = "", E: str = "", follower: str = "", bar: str = BAR,
    tendon: str = "", loop: str = LOOP, lump: str = "", world: str = "", compiler: str = "",
) -> str:  # fmt: skip
    """A four-bar that stands upright, with room for what is to be added."""
    bar = f"<geom {bar}"
    return f"""
<mujoco model="four-bar">
  <compiler {compiler}/>
  <option timestep="2e-4" {option}>{flag and f"<flag {flag}/>"}</option>
  <default><joint axis="0 -1 0"/><equality solref="8e-4 1" solimp="0.9999 0.9999 0.001"/></default>
  <worldbody>
    <site name="o"/><site name="w" pos="0.02 0 0.2"/>{world}
    <body name="crank">
      <joint name="D" {D}/>{bar} fromto="0 0 0 0.05 0 0"/>
      <body name="coupler" pos="0.05 0 0" euler="0 {-COUPLER} 0">
        <joint name="A" {A}/>{bar} fromto="0 0 0 0.12 0 0"/><site name="end" pos="0.12 0 0"/>
      </body>
    </body>
    <body name="follower" pos="0.12 0 0" euler="0 {-FOLLOWER} 0" {follower}>
      <joint name="E" {E}/>{bar} fromto="0 0 0 0.1 0 0"/><site name="tip" pos="0.1 0 0"/>{lump}
    </body>
  </worldbody>
  <equality>{loop}</equality>
  <tendon>{tendon}</tendon>
  <actuator>{servo}{more}</actuator>
  <keyframe><key {key}/></keyframe>
</mujoco>"""


@dataclass(frozen=True)
class Row:
    """What is changed, in which file, and what becomes of it: a word of the note or of the refusal; else it is used.

    ``idle`` says that it does nothing to the file's own motion, by MuJoCo.
    """

    before: dict[str, str]
    after: dict[str, str]
    named: str = ""
    refused: str = ""
    idle: bool = False
    speed: float = 6.25  # rad/s of the drive; 0: no motor is left

    @property
    def used(self) -> bool:
        """Whether the mechanism has all that acts in the file."""
        return bool(self.speed) and not self.refused and (not self.named or self.idle or self.named == OFF)

    @property
    def texts(self) -> tuple[str, str]:
        return linkage(**self.before), linkage(**{**self.before, **self.after})


def row(after: dict[str, str], before: dict[str, str] | None = None, **outcome: object) -> Row:
    return Row(before or {}, after, **outcome)  # type: ignore[arg-type]


def push(more: str = "", force: str = 'biastype="affine" biasprm="3 0 0" gainprm="2"') -> dict[str, str]:
    return {"more": f'<general site="tip" refsite="o" gear="1 0 0.5 0 0.1 0" {force} {more}/>'}


def lump(pos: str = "0 0 0", euler: str = "0 0 0", middle: str = "0 0 0", axes: str = "0 0 0", seen: str = "") -> str:
    inertia = f'<inertial pos="{middle}" euler="{axes}" mass="0.3" diaginertia="4e-4 2e-4 3e-4"/>'
    return f'<body pos="{pos}" euler="{euler}">{inertia}{seen}</body>'


def fixed(more: str) -> dict[str, str]:
    return {"tendon": f'<fixed name="t" {more}><joint joint="E" coef="1.5"/></fixed>'}


def spatial(more: str, ends: str = '<site site="w"/><site site="tip"/>') -> dict[str, str]:
    return {"tendon": f'<spatial name="t" {more}>{ends}</spatial>'}


SPRING = 'stiffness="0.4" springref="20"'
OTHER = "is neither the drive's nor a constant force"
FOLLOWS = "is the drive's; how it follows its command"
FLOOR, TOUCHING = '<geom type="plane" size="1 1 0.1" pos="0 0 -0.004"/>', BAR.replace('"0"', '"1"')
PULLEY = '<site site="w"/><site site="tip"/><pulley divisor="2"/><site site="w"/><site site="end"/>'
SEEN = '<geom type="box" size="0.01 0.02 0.03" group="3" contype="0" conaffinity="0"/>'
ROUND = '<site site="w"/><geom geom="g"/><site site="tip"/>'
ROUNDED = '<geom name="g" type="sphere" size="0.03 0.1" pos="0.06 0 0.15" euler="90 0 0" contype="0" conaffinity="0"/>'
OFF = "switched off"
FREE = "nothing drives it"
ROWS = {
    # ---------------------------------------------------------------- bodies
    "a mass": row({"bar": BAR.replace("7850", "2700")}),
    "an inertial": row({"bar": 'type="box" size="0.005" mass="0.3" contype="0" conaffinity="0"'}),
    "a total mass": row({"compiler": 'settotalmass="2"'}),
    "least masses": row({"compiler": 'boundmass="0.07" boundinertia="1e-4"'}),
    "a lump on a link": row({"lump": lump("0.02 0 0.01", "10 30 0", "0.01 0 0", "30 0 5")}, {"lump": lump()}),
    "gravcomp": row({"follower": 'gravcomp="0.5"'}, refused="gravcomp = 0.5"),
    "gravcomp by actuators": row(
        {"follower": 'gravcomp="0.5"', "E": 'actuatorgravcomp="true"'}, refused="gravcomp = 0.5"
    ),
    "mocap": row({"world": '<body name="m" mocap="true" pos="0 1 0"/>'}, named="mocap bodies", idle=True),
    "contacts": row(
        {"world": FLOOR, "bar": TOUCHING + ' margin="0.001"'},
        named="contacts between geoms",
    ),
    "the inertia of its geom": row({"compiler": 'inertiafromgeom="true"'}, {"lump": lump(seen=SEEN)}),
    "that of a group": row({"compiler": 'inertiagrouprange="0 0"'}, {"lump": f'<body name="b">{SEEN}</body>'}),
    "angles in another order": row({"compiler": 'eulerseq="zyx"'}, {"lump": lump("0.02 0 0.01", "40 30 20")}),
    # ---------------------------------------------------------------- joints
    "an axis": row({"D": 'axis="0 -2 0"', "E": SPRING + ' axis="0 1 0"'}, {"E": SPRING}),
    "a joint's place": row({"E": 'pos="0.001 0 0"'}),
    "a slide": row({"E": 'type="slide" axis="1 0 0"'}),
    "two joints": row(
        {"world": '<body><joint/><joint type="slide" axis="1 0 0"/><geom size="1"/></body>'}, refused="2 joints"
    ),
    "damping": row({"E": 'damping="0.03"'}),
    "damping that is not linear": row({"E": 'damping="0.03 0.1"'}, refused="damper that is not linear"),
    "armature on the ground": row({"E": 'armature="0.001"'}),
    "armature elsewhere": row({"A": 'armature="0.001"'}, named="the armature of joint 'A'"),
    "dry friction": row({"E": 'frictionloss="0.02"'}),
    "a spring": row({"E": SPRING}),
    "its rest": row({"E": 'stiffness="0.4" springref="-70"'}, {"E": SPRING}),
    "a spring by its time": row({"E": 'springdamper="0.02 1"'}),
    "an offset of its angle": row({"E": SPRING + ' ref="50"'}, {"E": SPRING}),
    "a spring that is not linear": row({"E": 'stiffness="0.4 0.1"'}, refused="spring that is not linear"),
    "a spring that yields": row(
        {"E": SPRING + ' springyield="0.5"'}, {"E": SPRING}, refused="spring that is not linear"
    ),
    "a limit": row({"E": 'range="-1 1" margin="0.5"'}, named="limits of joints"),
    "what actuators give in a joint": row(
        {"E": 'actuatorfrcrange="-0.01 0.01"', "A": 'actuatorfrcrange="-0.01 0.01"'}, push(), refused="actuatorfrcrange"
    ),
    "what the drive's give in it": row({"D": 'actuatorfrcrange="-0.01 0.01"'}, named="(actuatorfrcrange)"),
    # ---------------------------------------------------------------- loops
    "a loop by bodies": row({"loop": '<connect body1="follower" body2="coupler" anchor="0.1 0 0"/>'}, idle=True),
    "a loop that is off": row(
        {"loop": '<connect site1="tip" site2="end" active="false"/>'}, refused="does not determine"
    ),
    "a weld": row({"loop": LOOP + '<weld body1="plate"/>'}, {"world": PLATE, "loop": LOOP}),
    "a gear": row({"loop": '<joint joint1="D" joint2="E"/>'}, refused="of the kind joint"),
    "a coupling of tendons": row({"loop": '<tendon tendon1="t"/>'}, fixed(""), refused="of the kind tendon"),
    "its sites the other way": row({"loop": '<connect site1="end" site2="tip"/>'}, idle=True),
    "a ball": row({"E": 'type="ball"'}, refused="is a ball joint"),
    "a free joint": row({"E": 'type="free"'}, refused="is a free joint"),
    # ---------------------------------------------------------------- tendons
    "a tendon": row(fixed('stiffness="0.3" springlength="1"')),
    "a tendon's damper": row(fixed('damping="0.02"')),
    "its friction": row(fixed('frictionloss="0.03"')),
    "a tendon's rest": row(fixed('stiffness="0.3" springlength="2"'), fixed('stiffness="0.3" springlength="1"')),
    "its slack": row(fixed('stiffness="0.3" springlength="-2 -1"'), refused="tendon 't'"),
    "its armature": row(fixed('armature="0.001"'), refused="tendon 't'"),
    "its limit": row(fixed('range="-3 -1" limited="true" margin="0.1"'), refused="tendon 't'"),
    "its curve": row(fixed('stiffness="0.3 0.1" springlength="1" damping="0.1 0.1"'), refused="tendon 't'"),
    "its yield": row(
        fixed('stiffness="0.3" springlength="1" springyield="0.1"'),
        fixed('stiffness="0.3" springlength="1"'),
        refused="springyield",
    ),
    "what actuators give in it": row(
        fixed('actuatorfrcrange="-1 1"') | {"more": '<motor tendon="t"/>'}, named=OTHER, idle=True
    ),
    "a spring between points": row(spatial('stiffness="30" springlength="0.1" damping="0.5"')),
    "one over a pulley": row(
        spatial('stiffness="30"', PULLEY),
        refused="tendon 't'",
    ),
    "one round a ball": row(spatial('stiffness="30"', ROUND) | {"world": ROUNDED}, refused="tendon 't'"),
    "one round a rod": row(
        spatial('stiffness="30"', ROUND) | {"world": ROUNDED.replace("sphere", "cylinder")}, refused="tendon 't'"
    ),
    # ---------------------------------------------------------------- actuators that are not the drive's
    "an actuator's damper": row({"more": '<motor joint="E" gear="2" damping="0.01"/>'}),
    "an actuator's armature": row({"more": '<motor joint="E" gear="2" armature="0.0005"/>'}),
    "one that is not linear": row({"more": '<motor joint="E" damping="0 0.1"/>'}, refused="damper that is not linear"),
    "one of a tendon": row(fixed("") | {"more": '<motor tendon="t" damping="0.01"/>'}, fixed("")),
    "an inertia of a tendon": row(
        fixed("") | {"more": '<motor tendon="t" armature="0.01"/>'}, fixed(""), refused="'t'"
    ),
    "a servo": row({"more": '<position joint="E" kp="1" kv="0.1"/>'}, named=OTHER),
    "a servo with an integrator": row({"more": '<intvelocity joint="E" kp="1" actrange="-1 1"/>'}, named=OTHER),
    "a servo that is late": row({"more": '<position joint="E" kp="1" delay="0.002" nsample="20"/>'}, named=OTHER),
    "a damper": row({"more": '<damper joint="E" kv="1" ctrlrange="0.5 1"/>'}, named=OTHER),
    "a cylinder": row({"more": '<cylinder joint="E" timeconst="0.1" bias="0.5 0 0"/>'}, named=OTHER),
    "a muscle": row({"more": '<muscle joint="E" lengthrange="-1 1" force="1"/>'}, named=OTHER, idle=True),
    "a motor with coils": row({"more": '<dcmotor joint="E" motorconst="0.1" resistance="1"/>'}, named=OTHER),
    "a regulator": row({"more": '<pid joint="E" kp="1" kv="0.1" ki="1"/>'}, named=OTHER),
    "one's own": row(
        {"more": '<general joint="E" dyntype="user" gaintype="user" biastype="user"/>'}, named=OTHER, idle=True
    ),
    "an exact filter": row({"more": '<general jointinparent="E" dyntype="filterexact"/>'}, named=OTHER, idle=True),
    "glue": row({"more": '<adhesion body="crank" ctrlrange="0 1"/>'}, named=OTHER, idle=True),
    "a slider-crank's": row(
        {"more": '<general cranksite="tip" slidersite="w" cranklength="0.3" biastype="affine" biasprm="1 0 0"/>'},
        named=OTHER,
    ),
    "early activation": row(
        {"more": '<general joint="E" dyntype="filter" dynprm="0.1" actearly="true"/>'}, named=OTHER, idle=True
    ),
    "a force": row(push()),
    "its gear": row({"more": push()["more"].replace('gear="1 0', 'gear="2 0')}, push()),
    "its range": row(push('forcerange="-1 2"'), push()),
    "its control's range": row(push('ctrlrange="0.7 1"'), push()),
    "its group, switched off": row(
        push('group="3"') | {"option": 'gravity="0 0 -9.81" actuatorgroupdisable="3"'}, push(), named=OFF
    ),
    "all that act, switched off": row({"flag": 'actuation="disable"'}, push(), named=FREE, speed=0.0),
    "a range that is not heeded": row({"flag": 'clampctrl="disable"'}, push('ctrlrange="0.7 1"')),
    "no range is of no force": row(push('ctrlrange="0.7 1" gaintype="affine"', 'gainprm="0 0 2"'), named=OTHER),
    # ---------------------------------------------------------------- the drive's
    "its speed": row({"key": 'ctrl="3"'}, speed=3.0),
    "its way round": row({"servo": '<velocity joint="D" kv="10" gear="-2"/>'}, speed=-3.125),
    "its range of speeds": row({"servo": '<velocity joint="D" kv="10" ctrlrange="-1 1"/>'}, speed=1.0),
    "its constant force": row(
        {"servo": '<general joint="D" biastype="affine" biasprm="5 0 -10" gainprm="10"/>'},
        {"servo": '<general joint="D" biastype="affine" biasprm="0 0 -10" gainprm="10"/>'},
        speed=6.75,
    ),
    "its damper": row({"servo": '<velocity joint="D" kv="10" damping="0.5"/>'}),
    "its strength": row({"servo": '<velocity joint="D" kv="10" forcerange="-0.001 0.001"/>'}, named=FOLLOWS),
    "its group": row({"option": 'gravity="0 0 -9.81" actuatorgroupdisable="0"'}, named=OFF, speed=0.0),
    "a speed that a keyframe tells": row({"key": 'qvel="5 0 0"', "servo": '<motor joint="D"/>'}, speed=5.0),
    "activation in a keyframe": row(
        {"key": 'ctrl="0" act="0.5"'},
        {"servo": '<intvelocity joint="D" kp="1"/>', "key": 'ctrl="0"'},
        named="is assumed",
        speed=1.0,
    ),
    # ---------------------------------------------------------------- what acts everywhere
    "gravity": row({"option": 'gravity="1 0 -5"'}),
    "gravity across": row({"option": 'gravity="0 3 -9.81"'}, named="gravity across the plane", idle=True),
    "air": row({"option": 'gravity="0 0 -9.81" density="100"'}, named="resistance of air"),
    "oil": row({"option": 'gravity="0 0 -9.81" viscosity="10"'}, named="resistance of air"),
    "wind": row(
        {"option": 'gravity="0 0 -9.81" density="100" wind="9 0 0"'},
        {"option": 'gravity="0 0 -9.81" density="100"'},
        named="wind",
    ),
    "no springs": row({"flag": 'spring="disable"'}, {"E": SPRING}),
    "no dampers": row(
        {"flag": 'damper="disable"'}, {"E": 'damping="0.03"', "servo": '<velocity joint="D" damping="1"/>'}
    ),
    "no dry friction": row({"flag": 'frictionloss="disable"'}, {"E": 'frictionloss="0.03"'}),
    "no gravity": row({"flag": 'gravity="disable"'}),
    "no limits": row({"flag": 'limit="disable"'}, {"E": 'range="-1 1" margin="0.5"'}),
    "no contacts": row(
        {"flag": 'contact="disable"'},
        {"world": FLOOR, "bar": TOUCHING},
    ),
    "no loops": row({"flag": 'equality="disable"'}, refused="does not determine"),
    "no constraints": row({"flag": 'constraint="disable"'}, refused="does not determine"),
}

# What of MuJoCo's words no file of rigid links in hinges and slides can have, and what is refused before it is compiled
NEVER = {
    mujoco.mjtTrn: "UNDEFINED SO3", mujoco.mjtGain: "SO3", mujoco.mjtBias: "SO3", mujoco.mjtDyn: "",
    mujoco.mjtEq: "DISTANCE FLEX FLEXVERT FLEXSTRAIN", mujoco.mjtJoint: "", mujoco.mjtWrap: "NONE",
}  # fmt: skip
OF = {
    "actuator_trntype": mujoco.mjtTrn, "actuator_gaintype": mujoco.mjtGain, "actuator_biastype": mujoco.mjtBias,
    "actuator_dyntype": mujoco.mjtDyn, "eq_type": mujoco.mjtEq, "jnt_type": mujoco.mjtJoint,
    "wrap_type": mujoco.mjtWrap,
}  # fmt: skip
# Words of elements that a model keeps under other names, or that only say how it is written or compiled
COMPILED = {
    "joint": "align classname compiler frame id info name parent ref signature solimp_friction solimp_limit"
    " solref_friction solref_limit springdamper springref userdata",
    "tendon": "compiler id info material name path signature solimp_friction solimp_limit solref_friction solref_limit"
    " springlength userdata",
    "actuator": "actdim classname compiler ffrange id info inheritrange interp name nsample refsite signature"
    " slidersite target type userdata velrange",
    "equality": "active classname compiler id info name name1 name2 signature",
    "body": "alt bodies cameras childclass classname compiler explicitinertial frame frames fullinertia fuse geoms ialt"
    " id info joints lights mocap name parent signature sites sleep userdata",
    "option": "",
    "compiler": "LRopt alignfree authored autolimits balanceinertia boundinertia boundmass conflict degree"
    " discardvisual eulerseq fitaabb fusestatic inertiafromgeom inertiagrouprange meshdir passthrough savecanonical"
    " savecompiled saveinertial settotalmass texturedir usethread",
}
SOLVER_FLAGS = "WARMSTART FILTERPARENT REFSAFE SENSOR MIDPHASE EULERDAMP AUTORESET NATIVECCD ISLAND MULTICCD"


def compiled(text: str) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(text)


def told(m: mujoco.MjModel) -> dict[str, np.ndarray]:
    """All numbers by name, those of keyframes and coordinates too."""
    own = {name: getattr(m, name) for name in ("qpos0", "qpos_spring", "key_ctrl", "key_qvel", "key_act")}
    return own | {f"{what}_{field}": value for what, field, value in numbers(m)}


def differing(before: str, after: str) -> Iterator[str]:
    """The numbers that two files tell apart; of parts that only one of them has, those that a file must give."""
    plain, one, other = (told(compiled(text)) for text in (ATTRIBUTES_BY_ELEMENT, before, after))
    for name, value in other.items():
        if value.shape == one[name].shape:
            if not np.array_equal(value, one[name]):
                yield name
        elif value.size and value.shape[1:] == plain[name].shape[1:] and np.any(value != plain[name][-1]):
            yield name


def every() -> Iterator[mujoco.MjModel]:
    return (compiled(text) for row in ROWS.values() for text in row.texts)


# ------------------------------------------------------------------ the table is whole


def test_every_number_of_a_model_is_known_and_has_its_row() -> None:
    """Of the MuJoCo that is installed."""
    there = {f"{what}_{field}" for what, field, _ in numbers(compiled(linkage()))}
    assert there == {f"{what}_{field}" for what, names in KNOWN_ATTRIBUTES.items() for field in names}
    covered = {name for row in ROWS.values() for name in differing(*row.texts)}
    assert there - covered - fields(STORED) - fields(SOLVED) == set()
    assert (fields(STORED) | fields(SOLVED)) - there == set()


def test_every_word_of_an_element_is_a_number_of_the_model_or_is_compiled_into_one() -> None:
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body()
    elements = {
        "joint": body.add_joint(), "tendon": spec.add_tendon(), "actuator": spec.add_actuator(), "body": body,
        "equality": spec.add_equality(), "option": spec.option, "compiler": spec.compiler,
    }  # fmt: skip
    kept = {"joint": ("jnt", "dof"), "equality": ("eq",), "option": ("opt",), "compiler": ()}
    for what, element in elements.items():
        words = {name for name in dir(element) if not name.startswith("_") and not callable(getattr(element, name))}
        known = {name for of in kept.get(what, (what,)) for name in KNOWN_ATTRIBUTES[of]}
        assert words - known == set(COMPILED[what].split()), what


def test_every_kind_of_joint_loop_tendon_and_actuator_has_its_row() -> None:
    models = list(every())
    for field, kinds in OF.items():
        there = {int(kind) for m in models for kind in getattr(m, field)}
        names = {name.split("_", 1)[1]: int(kind) for name, kind in kinds.__members__.items()}
        assert {name for name, kind in names.items() if kind not in there} == set(NEVER[kinds].split()), field


def test_every_flag_has_its_row() -> None:
    flags = 0
    for m in every():
        flags |= int(m.opt.disableflags)
    names = {name.removeprefix("mjDSBL_"): bit for name, bit in mujoco.mjtDisableBit.__members__.items()}
    del names["mjNDISABLE"]
    assert {name for name, bit in names.items() if not flags & int(bit)} == set(SOLVER_FLAGS.split())


def test_what_only_a_newer_mujoco_has_is_named_where_a_file_gives_it() -> None:
    older = {what: names - {"stiffness", "disableactuator"} for what, names in KNOWN_ATTRIBUTES.items()}
    assert list(unknown(compiled(linkage()), older)) == []
    (sentence,) = unknown(compiled(linkage(E=SPRING)), older)
    assert sentence.startswith("jnt_stiffness of MuJoCo")
    (sentence,) = unknown(compiled(linkage(option='actuatorgroupdisable="3"')), older)
    assert sentence.startswith("opt_disableactuator of MuJoCo")


# ------------------------------------------------------------------ what becomes of each


def torques(text: str, speed: float) -> float:
    """By MuJoCo's own arrays, of the crank in the sense of our angles."""
    return Raw(text, "D").torque(speed or 6.25)


@pytest.mark.parametrize("what", ROWS)
def test_it_matters_in_its_file(what: str) -> None:
    """By MuJoCo alone: in what the motor gives as the crank passes at a speed, or in forty steps from the keyframe."""
    row = ROWS[what]
    before, after = row.texts
    one, other = moved(before), moved(after)
    same = one.shape == other.shape and np.allclose(one, other, rtol=0, atol=1e-9)
    if same and not row.idle:
        same = torques(before, row.speed) == pytest.approx(torques(after, row.speed), rel=1e-6)
    assert same == row.idle


@pytest.mark.parametrize("what", ROWS)
def test_it_is_used_named_or_refused(what: str, tmp_path: Path) -> None:
    """What is used has the torque of MuJoCo's own arrays, at the speed at which its servo gives nothing."""
    row = ROWS[what]
    path = written(tmp_path, {"": row.texts[1]})
    if row.refused:
        with pytest.raises(MjcfError, match=re.escape(row.refused)) as caught:
            imported(path)
        assert str(caught.value).count(str(path)) == 1
        return
    found = imported(path)
    m = found.mechanism
    assert not row.named or any(row.named in note for note in found.notes), found.notes
    assert m.speed == (pytest.approx(row.speed, rel=1e-12) if row.speed else None)
    if row.used:
        given = lc.analyse(m, angles=np.array([m.assembly["crank"]])).signals["drive_torque"]
        assert given == pytest.approx([torques(row.texts[1], row.speed)], rel=1e-6, abs=1e-9)


def test_a_note_says_where_the_damper_and_armature_of_an_actuator_went(tmp_path: Path) -> None:
    """An actuator that gives no force damps its joint, by its gear squared; only the force is left out."""
    more = '<general name="m" joint="E" gear="2" gainprm="0" damping="0.05" armature="0.0005"/>'
    found = imported(written(tmp_path, {"": linkage(more=more)}))
    assert found.mechanism.joint("E").damping == pytest.approx(0.2, rel=1e-12)  # 0.05 N.m.s/rad, at twice the speed
    told = [note for note in found.notes if "actuator 'm'" in note]
    for name, size in (("damping", "0.2"), ("armature", "0.002")):
        (where,) = (
            note for note in told if note.startswith(f"the {name} of actuator 'm' is part of that of joint 'E'")
        )
        assert "of joint 'E'" in where
        assert where.endswith(f", {size} of it")
    (force,) = (note for note in told if OTHER in note)
    assert "; its force is left out" in force
    plain = imported(written(tmp_path, {"": linkage(more=more.replace('damping="0.05" armature="0.0005"', ""))}))
    assert not any("is part of that of" in note for note in plain.notes)


# ------------------------------------------------------------------ the file itself, run by MuJoCo

UNREADABLE = ["air", "oil", "wind", "what actuators give in it", "one of a tendon", "glue", "a slider-crank's"]
USED = [what for what, row in ROWS.items() if row.used and what not in UNREADABLE]
QUICK = [
    "an actuator's damper",
    "an actuator's armature",
    "its damper",
    "a tendon's damper",
    "its range of speeds",
    "its control's range",
]


@pytest.mark.parametrize("what", [*UNREADABLE, *(what for what, row in ROWS.items() if row.refused)])
def test_what_has_no_word_is_refused_in_a_run_of_the_file_too(what: str, tmp_path: Path) -> None:
    """With the mechanism of the file as it was before; and what fluids do, or actuators between bodies, is in no
    reaction that can be read.
    """
    before, after = ROWS[what].texts
    m = imported(written(tmp_path, {"": before})).mechanism
    path = written(tmp_path, {"": after})
    with pytest.raises((MjcfError, Unsupported)):
        opened(str(path)).simulate(request_of(m, crank_angle=np.array([0.0, 0.1])))


@pytest.mark.parametrize("what", [*QUICK, *slow(*(what for what in USED if what not in QUICK))])
def test_a_run_of_the_file_has_what_was_imported(what: str, tmp_path: Path) -> None:
    path = written(tmp_path, {"": ROWS[what].texts[1]})
    m = imported(path).mechanism
    angles = m.assembly["crank"] + np.array([0.0, 0.05, 0.1, 0.15]) * np.sign(m.speed or 1.0)
    given = opened(str(path)).simulate(request_of(m, crank_angle=angles)).signals["drive_torque"]
    truth = lc.analyse(m, angles=angles).signals["drive_torque"]
    assert given == pytest.approx(truth, abs=3e-3 * np.abs(truth).max())

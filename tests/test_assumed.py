"""What a description leaves out is nothing, or it is listed in the result with the number that stands for it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from pydantic import BaseModel

import linkage_crosscheck as lc
from analytic.mechanism import (
    Body,
    Drive,
    Elasticity,
    Ground,
    Joint,
    Load,
    Mechanism,
    PeriodicTorque,
    Ripple,
    Sensor,
    Spring,
    Stop,
    Tolerance,
)
from analytic.mechanism.assumed import Assumed, assumed
from analytic.mechanism.bars import division
from analytic.mechanism.file import load, loads
from commands import compare
from compare.quantities import assumptions
from compare.results.analysis import Analysis
from engines_here import missing, present
from linkages import shaper
from marks import slow_but
from sim_models.engine import ENGINES, FEATURES, JointModel, Motion, declared

LEVER = """
name = "lever"
gravity = [0.0, -9.81]
ground = { points = { E = [0.0, 0.0] } }
body = [
  { name = "lever", points = { E = [0.3, 0.0], S = [0.3, 0.0], B = [0.8, 0.0] }, mass = 20.0 },
]
joint = [
  { name = "E", type = "revolute", bodies = ["ground", "lever"] },
]
drive = { joint = "E", speed = 1.0 }
assembly = { lever = 0.0 }
"""


# ---------------------------------------------------------------- the centre of mass


@pytest.mark.parametrize("beside", [0.3, 0.1 + 0.2])
def test_points_at_one_place_count_once_in_the_centre_of_mass(beside: float) -> None:
    """A bar of 20 kg and 0.5 m that lies on its pivot: its weight turns it by 20 x 9.81 x 0.25 N.m."""
    m = loads(LEVER.replace("S = [0.3, 0.0]", f"S = [{beside!r}, 0.0]"))
    (body,) = m.bodies
    assert body.centre == pytest.approx(0.55, abs=1e-15)
    assert body.moment_of_inertia == pytest.approx(20.0 * 0.5**2 / 12)
    found = lc.analyse(m, motion="static", angles=[0.0])
    assert found["drive_torque"][0] == pytest.approx(20.0 * 9.81 * 0.25, rel=1e-12)
    assert found.assumed[0] == Assumed("body[lever].com", (body.centre.real, 0.0), "m", found.assumed[0].why)


def test_points_that_are_apart_all_count() -> None:
    near = loads(LEVER.replace("S = [0.3, 0.0]", "S = [0.30001, 0.0]")).bodies[0]
    assert near.centre == pytest.approx((0.3 + 0.30001 + 0.8) / 3, abs=1e-15)
    ternary = Body(name="t", points={"A": (0.0, 0.0), "B": (0.3, 0.0), "C": (0.0, 0.3), "D": (0.0, 0.3)}, mass=1.0)
    assert ternary.centre == pytest.approx(0.1 + 0.1j)
    assert division(ternary).nodes[0] == pytest.approx(0.1 + 0.1j)  # the hub of its bars, too
    assert Body(name="block", points={"A": (0.2, 0.1), "S": (0.2, 0.1)}, mass=1.0).centre == 0.2 + 0.1j


# ---------------------------------------------------------------- every field that may be left out

# Left out, these are nothing, or are refused where they are needed; none of them is a number that somebody must know.
NOTHING = {
    Mechanism: {
        "gravity": "none",
        "drives": "none",
        "springs": "none",
        "stops": "none",
        "loads": "none",
        "sensors": "none",
        "assembly": "refused where an angle is needed",
        "tolerances": "none",
        "initial": "at rest",
    },
    Ground: {"name": "always ground"},
    Body: {"marker": "the centre of mass", "youngs_modulus": "rigid"},
    Joint: {
        "axis": "refused where it is needed",
        "clearance": "none",
        "guide": "refused where it is needed",
        "friction": "none",
        "friction_torque": "none",
        "static_torque": "none beyond friction_torque",
        "stribeck_speed": "refused where it is needed",
        "friction_radius": "none",
        "damping": "none",
        "drag": "none",
        "stiffness": "none",
        "cubic": "none",
        "elasticity": "rigid",
        "radial_stiffness": "rigid",
        "fit": "none",
    },
    Elasticity: {},
    Drive: {"ripple": "none", "stiffness": "rigid", "half_gap": "none", "periodic_torque": "none"},
    Load: {
        "force": "none",
        "torque": "none",
        "over": "always",
        "start": "refused where it is needed",
        "end": "refused where it is needed",
        "table": "refused where it is needed",
        "opposes": "fixed in direction",
    },
    Sensor: {
        "point": "the marker",
        "axis": "along the frame's x axis",
        "to": "refused where it is needed",
        "frame": "the sensor's own body, of a position the ground",
        "youngs_modulus": "the body's, or refused where it is needed",
    },
    Spring: {"damping": "none"},
    Stop: {
        "start": "none, or refused where it is needed",
        "end": "none, or refused where it is needed",
        "damping": "none",
    },
    Ripple: {},
    PeriodicTorque: {},
    Tolerance: {
        "sd": "refused where it is needed",
        "limits": "refused where it is needed",
        "distribution": "the usual one: normal of sd, uniform of limits",
        "group": "varies alone",
    },
}
# In place of these a number enters, which is listed, by the fields' names in a result.
LISTED = {
    Body: {
        "com": "body[rod].com",
        "inertia": "body[rod].inertia",
        "section": "body[crank].section",
        "shear_modulus": "body[rod].shear_modulus",
    },
    Joint: {"angle": "joint[S].angle", "rest_angle": "joint[S].rest_angle"},
    Ripple: {"phase": "drive.ripple.phase"},
    PeriodicTorque: {"phase": "drive.periodic_torque.phase"},
    Load: {"point": "load[0].point"},
    Spring: {"length": "spring[0].length"},
}
# These are an engine's: what stands for them is in its settings.
OF_CONTACT = {"contact_stiffness", "contact_damping", "restitution", "pin_radius", "contact_law"}

BARE = """
name = "bare"
gravity = [0.0, -9.81]
ground = { points = { O = [0.0, 0.0], S = [0.0, 0.02], post = [0.1, 0.2] } }
joint = [
  { name = "O", type = "revolute", bodies = ["ground", "crank"] },
  { name = "A", type = "revolute", bodies = ["crank", "rod"] },
  { name = "B", type = "revolute", bodies = ["rod", "slider"] },
  { name = "S", type = "prismatic", bodies = ["ground", "slider"], axis = [1.0, 0.0], stiffness = 300.0 },
]
load = [
  { body = "rod", force = [4.0, 3.0] },
]
spring = [
  { bodies = ["ground", "rod"], points = ["post", "tip"], stiffness = 50.0 },
]
assembly = { crank = 0.4, rod = 0.0, slider = 0.0 }
[[body]]
name = "crank"
points = { O = [0.0, 0.0], A = [0.05, 0.01] }
mass = 0.3
[[body]]
name = "rod"
points = { A = [0.0, 0.0], B = [0.12, 0.0], tip = [0.12, 0.0] }
mass = 0.2
section = [0.01, 0.01]
youngs_modulus = 2e11
[[body]]
name = "slider"
points = { B = [0.0, 0.0], S = [0.01, 0.0] }
mass = 0.14
[drive]
joint = "O"
speed = 30.0
ripple = { amplitude = 0.01, harmonic = 2 }
periodic_torque = { amplitude = 0.2, harmonic = 3 }
"""


def test_every_field_that_may_be_left_out_is_nothing_or_listed_or_a_contact_s() -> None:
    for part in NOTHING:
        optional = {name for name, field in part.model_fields.items() if not field.is_required()}
        known = [set(NOTHING[part]), set(LISTED.get(part, {})), OF_CONTACT if part is Joint else set()]
        assert sum(map(len, known)) == len(set.union(*known)), part
        assert optional == set.union(*known), part
    reached = {
        Mechanism,
        Ground,
        Body,
        Joint,
        Elasticity,
        Drive,
        Ripple,
        PeriodicTorque,
        Load,
        Spring,
        Stop,
        Tolerance,
        Sensor,
    }
    assert set(NOTHING) == reached == _parts(Mechanism)


def _parts(model: type[BaseModel]) -> set[type[BaseModel]]:
    """The model and every one that its fields lead to."""
    schema = model.model_json_schema()
    every = {each.__name__: each for each in NOTHING}
    return {model} | {every[name] for name in schema["$defs"]}


@pytest.mark.filterwarnings("ignore:bare. cross-checks turn evenly")
def test_a_number_that_is_listed_is_the_one_that_is_used() -> None:
    """Written into the file, every one of them changes nothing, and nothing is assumed any more."""
    m = loads(BARE)
    listed = {each.field: each for each in assumed(m)}
    assert set(listed) >= {field for fields in LISTED.values() for field in fields.values()}
    assert listed["body[rod].com"].value == (0.06, 0.0)
    assert listed["body[rod].inertia"].value == pytest.approx(0.2 * (0.12**2 + 0.01**2) / 12)
    assert listed["body[rod].shear_modulus"].value == pytest.approx(2e11 / 2.6)
    assert listed["load[0].point"].value == (0.06, 0.0)
    given = written(m, listed)
    assert assumed(given) == ()
    for flexible in (False, True):
        asked = {"motion": "static", "compliance": True} if flexible else {"motion": "driven"}
        one, other = (lc.analyse(each, angles=np.radians([0.0, 40.0, 200.0]), **asked) for each in (m, given))
        assert all(np.array_equal(one[name], other[name], equal_nan=True) for name in one.signals)
        assert set(one.assumed) <= set(listed.values())
        assert other.assumed == ()


def written(m: Mechanism, listed: dict[str, Assumed]) -> Mechanism:
    """The mechanism with every one of these numbers in its file."""
    fields: dict[str, dict[str, object]] = {}
    for each in listed.values():
        where, _, field = each.field.partition(".")
        fields.setdefault(where, {})[field] = "com" if field == "point" else each.value
    drive = m.drives[0]
    waves = {
        name: getattr(drive, name).model_copy(update={"phase": listed[f"drive.{name}.phase"].value})
        for name in ("ripple", "periodic_torque")
    }
    return m.replace(
        bodies=tuple(b.model_copy(update=fields.get(f"body[{b.name}]", {})) for b in m.bodies),
        joints=tuple(j.model_copy(update=fields.get(f"joint[{j.name}]", {})) for j in m.joints),
        drives=(drive.model_copy(update=waves),),
        springs=tuple(s.model_copy(update=fields[f"spring[{k}]"]) for k, s in enumerate(m.springs)),
        loads=tuple(x.model_copy(update=fields[f"load[{k}]"]) for k, x in enumerate(m.loads)),
    )


def test_of_the_paper_s_case_the_centres_of_mass_and_the_inertias_are_assumed() -> None:
    """It gives sections and both moduli; its load is at a point that it names."""
    bodies = ("crank", "coupler", "follower")
    assert [each.field for each in assumed(load("paper"))] == [
        f"body[{b}].{f}" for b in bodies for f in ("com", "inertia")
    ]


# ---------------------------------------------------------------- what an engine puts for contact

PAIRS = [
    (name, model, motion)
    for name in ENGINES
    for model, motion in sorted(declared(name).capabilities.runs)
    if model in ("spring-damper", "contact")
]
NUMBERS = {"contact_stiffness": "N/m", "contact_damping": "N.s/m", "restitution": "1", "pin_radius": "m"}


@pytest.mark.filterwarnings("ignore:.*which is assumed")  # a pin's radius: it is in what is listed
@pytest.mark.parametrize(
    ("name", "model", "motion"),
    slow_but([("mujoco", "contact", "driven")], PAIRS),
)
def test_what_contact_is_made_of_is_in_the_settings_and_listed_with_its_value(
    name: str, model: JointModel, motion: Motion
) -> None:
    """Given as they are listed, the numbers change nothing; a mechanism that gives them assumes none."""
    if missing(name):
        pytest.skip(missing(name))
    features = declared(name).capabilities.rigid.features
    rubs = ("contact_friction", (model, motion)) in features and (name, motion) != ("mujoco", "driven")
    m = loads(PRESSED).with_joint("B", clearance=1e-4, friction=0.1 if rubs else 0.0)
    asked = {"joint_model": model, "motion": motion, "angles": np.radians([0.0, 5.0])}
    found = lc.simulate(m, name, **asked)
    listed = {each.field.removeprefix("joint[B]."): each for each in found.assumed if each.field.startswith("joint[B]")}
    for field, each in listed.items():
        value = found.settings.get(field)
        if field == "restitution" and "bounce_time" in found.settings:  # of MuJoCo's hard contact
            assert found.settings["contact_law"] == "hard, bounces at damping ratio 0.5"
            assert each.value == pytest.approx(0.2984, abs=1e-4)
            continue
        assert each.value == (value["B"] if isinstance(value, dict) else value)
        assert each.unit == NUMBERS[field]
    used = {field for field in NUMBERS if field in found.settings}
    assert set(listed) | {"restitution"} == used | {"restitution"}
    if rubs:
        assert listed["pin_radius"].value == 0.01
    given = m.with_joint("B", **{field: each.value for field, each in listed.items()})
    if "bounce_time" in found.settings:
        given = m.with_joint("B", restitution=listed["restitution"].value)
    again = lc.simulate(given, name, **asked)
    finer = 1e-4 if "bounce_time" in found.settings else 1e-6  # MuJoCo's steps are shorter where it is told to bounce
    assert not [each for each in again.assumed if each.field.startswith("joint[B]")]
    for signal in ("reaction_B_x", "reaction_B_y", "drive_torque", "clearance_B_x", "clearance_B_y"):
        assert again[signal] == pytest.approx(found[signal], rel=finer, abs=1e-9), signal


PRESSED = """
name = "pressed"
ground = { points = { D = [0.0, 0.0], E = [0.12, 0.0] } }
body = [
  { name = "crank", points = { D = [0.0, 0.0], A = [0.05, 0.0] }, mass = 0.04 },
  { name = "coupler", points = { A = [0.0, 0.0], B = [0.12, 0.0] }, mass = 0.09 },
  { name = "follower", points = { E = [0.0, 0.0], B = [0.10, 0.0] }, mass = 0.08 },
]
joint = [
  { name = "D", type = "revolute", bodies = ["ground", "crank"] },
  { name = "A", type = "revolute", bodies = ["crank", "coupler"] },
  { name = "B", type = "revolute", bodies = ["coupler", "follower"] },
  { name = "E", type = "revolute", bodies = ["ground", "follower"] },
]
drive = { joint = "D", speed = 10.0 }
load = [
  { body = "follower", torque = -2.0 },
]
assembly = { crank = 0.0, coupler = 0.984, follower = 1.6065 }
"""


def test_a_law_of_each_engine_s_own_is_named_in_its_settings() -> None:
    m = loads(PRESSED).with_clearances({"B": 1e-4})
    found = lc.simulate(m, present()[0], joint_model="contact", motion="static", angles=[0.0])
    assert found.settings["contact_law"]
    assert "contact_law" in FEATURES


# ---------------------------------------------------------------- where a person reads it

COM = "body.com (the middle of the body's points): crank (40, 0) mm; block (0, 0) mm; lever (200, 0) mm"


def test_what_is_assumed_is_told_by_name_in_the_units_that_are_read() -> None:
    lines = assumptions(assumed(shaper()))
    assert lines[0].startswith(COM)
    assert "load.point (com of body ram): 0 (0, 0) mm" in lines
    wound = [Assumed("drive.ripple.phase", 0.0, "rad", "none"), Assumed("joint[B].restitution", 0.5, "1", "half")]
    assert assumptions(wound) == ["drive.ripple.phase (none): 0 deg", "joint.restitution (half): B 0.5"]


def test_every_command_lists_what_is_assumed(tmp_path: Path) -> None:
    file = tmp_path / "pressed.toml"
    file.write_text(PRESSED, encoding="utf-8")
    own = [each.field for each in assumed(loads(PRESSED))]
    of_contact = ["joint[B].contact_stiffness", "joint[B].contact_damping"]
    joint = ("--joint", "spring-damper", "--clearance", "B=1e-4", "--angles", "0:0:1")
    commands = {
        ("analyse", "--case", str(file)): own,
        ("simulate", "--case", str(file), *joint): own + of_contact,
        ("--case", str(file), "--simulator", "mujoco", "--motion", "static", *joint): own + of_contact,
        ("export", "--case", str(file), "--simulator", "mujoco", *joint): own + of_contact,
        ("accuracy", "--case", str(file), "--clearance", "B=1e-4", "--samples", "10"): own,
    }
    for k, (command, fields) in enumerate(commands.items()):
        said = compare(*command, "--json", "--out", str(tmp_path / str(k)), cwd=tmp_path)
        assert [each["field"] for each in json.loads(said.stdout)["assumed"]] == fields, command
    assert Analysis.read(tmp_path / "0" / "analysis.json").assumed == assumed(loads(PRESSED))
    told = compare("analyse", "--case", str(file), "--out", str(tmp_path / "0"), cwd=tmp_path).stdout
    assert "assumed: body.com (the middle of the body's points): crank (25, 0) mm; coupler (60, 0) mm" in told
    for page in ("report.html", "report.md"):
        assert "B 1e+08 N/m" in (tmp_path / "2" / page).read_text(encoding="utf-8")


@pytest.mark.pybullet
def test_a_stiffness_that_an_engine_has_no_use_for_is_said() -> None:
    """PyBullet's walls at rest are hard: what the file says of them changes nothing there."""
    weighs = load("crank-rocker").replace(gravity=(0.0, -9.81))
    stiff = weighs.with_joint("B", clearance=1e-4, contact_stiffness=1e7)
    asked = {"joint_model": "contact", "motion": "static", "angles": [0.5, 1.0]}
    said = "left out: contact_stiffness of joint B, as the walls of pybullet are rigid here"
    assert said in lc.simulate(stiff, "pybullet", **asked).warnings
    assert said in lc.crosscheck(stiff, "pybullet", **asked).warnings
    given = lc.simulate(stiff, "pybullet", joint_model="spring-damper", motion="static", angles=[0.5])
    assert given.settings["contact_stiffness"] == 1e7
    assert said not in given.warnings

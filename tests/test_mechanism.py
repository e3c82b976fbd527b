"""The mechanism file: what it says comes back, and what is wrong with it is named."""

from __future__ import annotations

import pytest

from analytic.assembly import Assembly, AssemblyError
from analytic.mechanism import MechanismWarning
from analytic.mechanism_file import MechanismError, dumps, load, loads, shipped_cases
from analytic.structure import StructureError, structure
from linkages import INVERTED_SLIDER, inverted_slider, scotch_yoke

PAPER = dumps(load("paper"))


@pytest.mark.parametrize("case", shipped_cases())
def test_a_shipped_case_survives_object_and_file(case: str) -> None:
    mechanism = load(case)
    assert loads(dumps(mechanism)) == mechanism
    assert dumps(loads(dumps(mechanism))) == dumps(mechanism)


def test_the_paper_case_has_the_papers_masses_from_steel_bars() -> None:
    for body in load("paper").bodies:
        assert body.mass == pytest.approx(7850 * 0.01 * 0.01 * body.length, rel=1e-12)


def test_a_file_is_read_from_its_path(tmp_path) -> None:  # type: ignore[no-untyped-def]
    path = tmp_path / "mine.toml"
    path.write_text(PAPER, encoding="utf-8")
    assert load(path) == load("paper")


def test_what_is_left_out_is_worked_out() -> None:
    body = load("paper").bodies[1]
    assert body.centre == 0.2
    assert body.moment_of_inertia == pytest.approx(0.314 * (0.4**2 + 0.01**2) / 12)


def test_a_mechanism_is_frozen() -> None:
    with pytest.raises(ValueError, match="frozen"):
        load("paper").name = "other"


def edited(old: str, new: str) -> str:
    assert old in PAPER
    return PAPER.replace(old, new, 1)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (edited("mass = 0.157", "mass = -0.157"), ["body[crank].mass", "-0.157", "greater than 0"]),
        (edited("mass = 0.157", "mas = 0.157"), ["body[crank].mas", "not a field", "'mass'"]),
        (edited("mass = 0.157", 'mass = "0.157"'), ["body[crank].mass", "'0.157'", "number"]),
        (edited("mass = 0.157", "mass = nan"), ["body[crank].mass", "finite"]),
        (edited("mass = 0.157\n", ""), ["body[crank].mass is missing"]),
        (edited('name = "A"', 'name = "F"'), ["joint 'F'", "'crank'", "no point 'F'"]),
        (edited('"coupler",\n    "follower"', '"cupler",\n    "follower"'), ["joint 'B'", "'cupler'", "ground, crank"]),
        (edited('joint = "D"', 'joint = "Q"'), ["drive.joint", "'Q'", "D, A, B, E"]),
        (edited('joint = "D"', 'joint = "A"'), ["drive.joint", "ground"]),
        (edited("speed = 1.5707963267948966", 'speed = "fast"'), ["drive.speed", "'fast'"]),
        (edited("speed = 1.5707963267948966", "speed = 0.0"), ["drive.speed = 0"]),
        (edited("clearance = 0.01", "clearance = 0.2"), ["joint 'B'", "clearance = 0.2", "'follower'", "not smaller"]),
        (edited("clearance = 0.01", "clearance = -0.01"), ["joint[B].clearance", "-0.01"]),
        (edited('body = "coupler"', 'body = "ground"'), ["load.body", "'ground'"]),
        (edited('point = "com"', 'point = "Z"'), ["load.point", "'Z'"]),
        (edited("crank = 0.5235987755982988", "krank = 0.5"), ["assembly.krank", "crank"]),
        (edited('name = "crank"', 'name = "ground"'), ["'ground'", "twice"]),
        (PAPER.replace('"coupler"', '"world"').replace("coupler =", "world ="), ["body 'world'", "call it something else"]),
        (PAPER.replace('"coupler"', '"reaction_B"').replace("coupler =", "reaction_B ="), ["body 'reaction_B'", "joints", "call it something else"]),
        (PAPER.replace('name = "paper"', 'name = ""'), ["name = ''", "one line of text"]),
        (PAPER.replace('name = "paper"', 'name = "pa\\u0007per"'), ["name = ", "can be printed"]),
        (PAPER + "\n[[joint", ["not TOML"]),
        (INVERTED_SLIDER.replace("axis = [3.0, 1.0]", "axis = [0.0, 0.0]"), ["joint 'S'", "axis"]),
        (INVERTED_SLIDER.replace("axis = [3.0, 1.0]", "axis = [1.0, 0.0]\nclearance = 1e-4"), ["joint 'S'", "clearance"]),
    ],
)
def test_a_fault_is_named_with_field_and_value(text: str, words: list[str]) -> None:
    with pytest.raises(MechanismError) as error:
        loads(text, source="mine.toml")
    message = str(error.value)
    assert message.startswith("mine.toml: ")
    assert "\n" not in message
    for word in words:
        assert word in message


def test_a_missing_case_suggests_the_nearest() -> None:
    with pytest.raises(MechanismError, match=r"papr: no such mechanism file or case; did you mean 'paper'"):
        load("papr")


def test_a_body_without_length_is_refused() -> None:
    mechanism = load("paper")
    with pytest.raises(ValueError, match="'follower' has no length"):
        mechanism.with_joint("B", clearance=0.0).with_body("follower", points={"E": (0.1, 0.0), "B": (0.1, 0.0)})


def test_millimetres_are_suspected() -> None:
    with pytest.warns(MechanismWarning, match=r"coupler.points.B is 400 m"):
        load("paper").with_body("coupler", points={"A": (0.0, 0.0), "B": (400.0, 0.0)})


def test_degrees_are_suspected() -> None:
    with pytest.warns(MechanismWarning, match="assembly.crank is 30 rad"):
        load("paper").replace(assembly={"crank": 30.0, "coupler": 0.0, "follower": 30.0})


def test_a_loop_that_cannot_close_is_refused() -> None:
    short = load("paper").with_body("coupler", points={"A": (0.0, 0.0), "B": (0.03, 0.0)})
    with pytest.raises(AssemblyError, match=r"crank angle 30 deg cannot be reached.*coupler, follower"):
        Assembly(short)


def test_assembly_angles_far_from_any_closed_loop_are_refused() -> None:
    m = load("crank-rocker")
    with pytest.raises(AssemblyError, match=r"does not close near the assembly angles.*correct it"):
        Assembly(m.replace(assembly=dict(m.assembly) | {"coupler": 3.0, "follower": 3.0}))


def test_a_linkage_that_one_drive_does_not_determine_is_refused() -> None:
    m = load("paper")
    loose = m.replace(joints=tuple(j for j in m.joints if j.name != "E"))
    with pytest.raises(StructureError, match="does not determine coupler, follower"):
        structure(loose)


def test_a_rigid_structure_is_refused() -> None:
    m = load("paper")
    ground = m.ground.model_copy(update={"points": {**m.ground.points, "F": (0.2, 0.0)}})
    bodies = [b.model_copy(update={"points": {**b.points, "F": (0.2, 0.0)}}) if b.name == "coupler" else b for b in m.bodies]
    pinned = m.replace(
        ground=ground, bodies=bodies, joints=(*m.joints, m.joint("E").model_copy(update={"name": "F", "bodies": ("ground", "coupler")}))
    )
    with pytest.raises(StructureError, match=r"rigid already|mobility"):
        structure(pinned)


def test_prismatic_joints_hold_bodies_parallel() -> None:
    s = structure(scotch_yoke())
    assert len(s.groups) == 1
    assert all(not s.coordinates[i].bodies for i in s.groups[0].coordinates)
    assert structure(inverted_slider()).groups[0].bodies == ("block", "arm")

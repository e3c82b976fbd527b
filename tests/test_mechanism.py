"""The mechanism file: what it says comes back, and what is wrong with it is named."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.motion import kinematics
from analytic.kinematics.structure import StructureError, structure
from analytic.mechanism import Body, Mechanism, MechanismError, MechanismWarning
from analytic.mechanism.file import dumps, load, loads, shipped_cases
from linkages import INVERTED_SLIDER, chain, inverted_slider, scotch_yoke

PAPER = dumps(load("paper"))
ROOT = Path(__file__).parents[1]


@pytest.mark.parametrize("case", shipped_cases())
def test_a_shipped_case_survives_object_and_file(case: str) -> None:
    mechanism = load(case)
    assert loads(dumps(mechanism)) == mechanism
    assert dumps(loads(dumps(mechanism))) == dumps(mechanism)


def test_the_paper_case_has_the_papers_masses_from_steel_bars() -> None:
    for body in load("paper").bodies:
        assert body.mass == pytest.approx(7850 * 0.01 * 0.01 * body.length, rel=1e-12)


def test_a_file_is_read_from_its_path(tmp_path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(PAPER, encoding="utf-8")
    assert load(path) == load("paper")


def test_what_is_left_out_is_worked_out() -> None:
    body = load("paper").bodies[1]
    assert body.centre == 0.2
    assert body.moment_of_inertia == pytest.approx(0.314 * (0.4**2 + 0.01**2) / 12)


def body(points: np.ndarray) -> Body:
    """A body with these points, x + iy."""
    return Body(name="plate", points={f"P{k}": (p.real, p.imag) for k, p in enumerate(points.tolist())}, mass=1.0)


@pytest.mark.parametrize("kind", ["anywhere", "in a grid", "in line", "nearly in line", "in one place", "on a circle"])
def test_a_body_is_as_long_as_its_points_farthest_apart(kind: str) -> None:
    chance = np.random.default_rng(7)
    for count in (1, 2, 3, 4, 5, 40):
        for _ in range(20):
            x, y = chance.normal(size=(2, count))
            points = (
                np.exp(7j * chance.random())
                * {
                    "anywhere": x + 1j * y,
                    "in a grid": np.round(x) + 1j * np.round(y),
                    "in line": x + 0j,
                    "nearly in line": np.round(x) + 1e-15j * np.round(y),
                    "in one place": np.full(count, 0.3 + 0.1j),
                    "on a circle": np.exp(2j * np.pi * np.arange(count) / count),
                }[kind]
            )
            farthest = max(abs(p - q) for p in points.tolist() for q in points.tolist())
            assert body(points).length == pytest.approx(farthest, rel=1e-15, abs=0)


def test_a_body_may_have_twenty_thousand_points() -> None:
    """On a circle each of them may be the farthest of another; the square of their number took 30 s a time."""
    plate = body(0.1 * np.exp(2j * np.pi * np.arange(20_000) / 20_000))
    begun = time.process_time()
    assert plate.length == pytest.approx(0.2, rel=1e-14)
    assert time.process_time() - begun < 2


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
        (edited("speed = 1.5707963267948966", 'speed = "fast"'), ["drive.speed", "'fast'"]),
        (edited("speed = 1.5707963267948966", "speed = 0.0"), ["drive.speed = 0"]),
        (
            edited("speed = 1.5707963267948966", "speed = 1.5707963267948966\nperiodic_torque = 0.1"),
            ["drive.periodic_torque = 0.1: give a table with the fields amplitude, harmonic, phase"],
        ),
        (
            edited(
                "speed = 1.5707963267948966",
                "speed = 1.5707963267948966\nripple = { amplitude = 1e-3, harmonic = 2000 }",
            ),
            ["drive.ripple.harmonic = 2000", "less than or equal to 1000"],
        ),
        (
            edited("speed = 1.5707963267948966", "speed = 1.5707963267948966\nhalf_gap = 4.0"),
            ["drive.half_gap = 4.0", "less than or equal to 0.5"],
        ),
        (edited("clearance = 0.01", "clearance = 0.2"), ["joint 'B'", "clearance = 0.2", "'follower'", "not smaller"]),
        (edited("clearance = 0.01", "clearance = -0.01"), ["joint[B].clearance", "-0.01"]),
        (edited('body = "coupler"', 'body = "ground"'), ["load.body", "'ground'"]),
        (edited('point = "com"', 'point = "Z"'), ["load.point", "'Z'"]),
        (edited("crank = 0.5235987755982988", "krank = 0.5"), ["assembly.krank", "crank"]),
        (edited('name = "crank"', 'name = "ground"'), ["'ground'", "twice"]),
        (
            PAPER.replace('"coupler"', '"world"').replace("coupler =", "world ="),
            ["body 'world'", "call it something else"],
        ),
        (
            PAPER.replace('"coupler"', '"reaction_B"').replace("coupler =", "reaction_B ="),
            ["reaction_B_angle", "joint 'B'", "body 'reaction_B'", "another name"],
        ),
        (PAPER.replace('name = "paper"', 'name = ""'), ["name = ''", "one line of text"]),
        (PAPER.replace('name = "paper"', 'name = "pa\\u0007per"'), ["name = ", "can be printed"]),
        (PAPER + "\n[[joint", ["cannot be read as TOML"]),
        ("gravity = 9.81\n" + PAPER, ["gravity = 9.81", "[x, y] in m/s^2"]),
        (INVERTED_SLIDER.replace("axis = [3.0, 1.0]", "axis = [0.0, 0.0]"), ["joint 'S'", "axis"]),
        (INVERTED_SLIDER.replace("axis = [3.0, 1.0]", "axis = 3.0"), ["joint[S].axis = 3.0", "a list, in brackets"]),
        (
            INVERTED_SLIDER.replace("axis = [3.0, 1.0]", "axis = [1.0, 0.0]\nclearance = 1e-4"),
            ["joint 'S'", "clearance"],
        ),
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


def test_a_coefficient_of_a_slide_without_a_guide_is_asked_about() -> None:
    """There it is a force; more than 1 N, and what says that it is one, are not asked about."""
    slide = load("slider-crank").replace(
        joints=[j.model_copy(update={"guide": None, "clearance": 0.0}) for j in load("slider-crank").joints]
    )
    with pytest.warns(MechanismWarning, match=r"friction of joint 'S' is a force of 0.1 N, as it has no guide; was a"):
        slide.with_joint("S", friction=0.1)
    slide.with_joint("S", friction=20.0)
    slide.with_joint("S", friction_torque=0.1)


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
    bodies = [
        b.model_copy(update={"points": {**b.points, "F": (0.2, 0.0)}}) if b.name == "coupler" else b for b in m.bodies
    ]
    pinned = m.replace(
        ground=ground,
        bodies=bodies,
        joints=(*m.joints, m.joint("E").model_copy(update={"name": "F", "bodies": ("ground", "coupler")})),
    )
    with pytest.raises(StructureError, match=r"rigid already|mobility"):
        Assembly(pinned)


def test_prismatic_joints_hold_bodies_parallel() -> None:
    s = structure(scotch_yoke())
    assert len(s.groups) == 1
    assert all(not s.coordinates[i].bodies for i in s.groups[0].coordinates)
    assert structure(inverted_slider()).groups[0].bodies == ("block", "arm")


@pytest.mark.long_rows("False")
@pytest.mark.parametrize("closed", [True, False])
def test_a_chain_of_many_links_that_one_drive_does_not_determine_is_refused_at_once(
    closed: bool, tmp_path: Path
) -> None:
    """Trying all sets of 24 bodies took a minute and more, and each two bodies more took four times as long; here are
    200.
    """
    (tmp_path / "chain.toml").write_text(chain(200, closed), encoding="utf-8")
    program = (
        "from analytic.mechanism.file import load\nfrom analytic.kinematics.structure import"
        " structure\nstructure(load('chain.toml'))"
    )
    run = [sys.executable, "-c", program]
    done = subprocess.run(
        run,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    assert (
        "StructureError: chain: the drive at 'J0' does not determine b1, b2, b3, b4, b5, b6, b7, b8 and 191 more"
        in done.stderr
    )


def random_linkage(rng: np.random.Generator) -> Mechanism:
    """A crank, and on it Assur groups of two and four bodies, in any order of the file; some have a joint too few or
    too many.
    """
    pairs, count = [("ground", "b0")], 1
    for _ in range(int(rng.integers(1, 4))):
        old, new = ["ground", *(f"b{i}" for i in range(count))], [f"b{count + i}" for i in range(4)]
        hold = [old[i] for i in rng.integers(0, len(old), 3)]
        if rng.random() < 0.6:
            pairs += [(hold[0], new[0]), (new[0], new[1]), (new[1], hold[1])]
            count += 2
        else:
            pairs += [
                (hold[0], new[0]),
                (hold[1], new[1]),
                (hold[2], new[2]),
                (new[0], new[3]),
                (new[1], new[3]),
                (new[2], new[3]),
            ]
            count += 4
    slip = rng.random()
    if slip < 0.15:
        pairs.pop(int(rng.integers(1, len(pairs))))
    elif slip < 0.3:
        pairs.append(("ground", f"b{count - 1}"))
    joints = [{"name": f"J{i}", "type": "revolute", "bodies": (a, b)} for i, (a, b) in enumerate(pairs)]
    points = {
        b: {j["name"]: tuple(rng.random(2)) for j in joints if b in j["bodies"]}
        for b in ["ground", *(f"b{i}" for i in range(count))]
    }
    order = rng.permutation(count)
    bodies = [{"name": f"b{i}", "points": points[f"b{i}"] or {"free": (0.0, 0.0)}, "mass": 1.0} for i in order]
    fields = {
        "name": "random",
        "ground": {"points": points["ground"]},
        "body": bodies,
        "joint": [joints[0], *rng.permutation(joints[1:])],
    }
    return Mechanism.model_validate(
        {**fields, "drive": {"joint": "J0", "speed": 1.0}, "assembly": {f"b{i}": 0.0 for i in range(count)}}
    )


def groups_by_trying(mechanism: Mechanism) -> list[tuple[str, ...]] | None:
    """Assur groups by trying all sets of bodies, the smallest first; None where there is no such set, or a joint is
    left over.
    """
    known, waiting, groups, used = (
        {"ground", mechanism.driven},
        [b.name for b in mechanism.bodies],
        [],
        {mechanism.drive_joint.name},
    )
    waiting.remove(mechanism.driven)
    while waiting:
        for chosen in (c for size in range(2, len(waiting) + 1, 2) for c in combinations(waiting, size)):
            held = [
                j.name for j in mechanism.joints if set(j.bodies) <= {*known, *chosen} and set(j.bodies) & set(chosen)
            ]
            if 3 * len(chosen) == 2 * len(held):
                break
        else:
            return None
        known, used, groups = known | set(chosen), used | set(held), [*groups, chosen]
        waiting = [b for b in waiting if b not in chosen]
    return groups if len(used) == len(mechanism.joints) else None


def test_the_groups_of_random_linkages_are_those_that_trying_all_sets_finds() -> None:
    rng, refused = np.random.default_rng(11), 0
    for _ in range(150):
        try:
            mechanism = random_linkage(rng)
        except ValidationError:  # a body that lost its only joint
            continue
        wanted = groups_by_trying(mechanism)
        try:
            found = structure(mechanism)
        except StructureError:
            refused += 1
            assert wanted is None
        else:
            refused += wanted is None
            assert bool(found.one_too_many) == (wanted is None)
            assert wanted is None or [g.bodies for g in found.groups] == wanted
    assert 10 < refused < 80


@pytest.mark.parametrize("first", [True, False])
def test_a_parallelogram_with_a_second_coupler_has_a_joint_too_many_by_count_and_moves(first: bool) -> None:
    """Its bodies are held once too often: it says so, and whether that agrees with its lengths its assembly finds."""
    m = load("paper").with_clearances({})
    sides = {
        name: m.moving[name].model_copy(update={"points": {**m.moving[name].points, name[0]: (0.1, 0.0)}})
        for name in ("crank", "follower")
    }
    second = m.moving["coupler"].model_copy(update={"name": "second", "points": {"c": (0.0, 0.0), "f": (0.4, 0.0)}})
    pins = [
        m.joint("A").model_copy(update={"name": n, "bodies": b})
        for n, b in (("c", ("crank", "second")), ("f", ("second", "follower")))
    ]
    twice = m.replace(
        bodies=(sides["crank"], m.moving["coupler"], sides["follower"], second),
        joints=(*pins, *m.joints) if first else (*m.joints, *pins),
        assembly={**m.assembly, "second": 0.0},
    )
    assert re.search(
        r"joint '[EAf]' closes a loop that is rigid already, through coupler, follower, second \(mobility 0",
        structure(twice).one_too_many,
    )
    assembly = Assembly(twice)
    theta = np.radians([30.0, 60.0, 120.0])
    angles = assembly.coordinates(theta)
    assert np.allclose(Assembly(m).coordinates(theta)[0], angles[0])
    assert np.allclose(kinematics(assembly, theta).angle("follower"), theta)


def test_a_marker_that_is_the_name_of_a_point_is_told_where_that_is() -> None:
    points = {"E": [0.0, 0.0], "tip": ["50 mm", 0.0]}
    with pytest.raises(MechanismError, match=r"marker = 'tip'.* write where it is, marker = \[0\.05, 0\.0\]"):
        Body(name="rocker", points=points, mass=1.0, marker="tip")  # type: ignore[arg-type]

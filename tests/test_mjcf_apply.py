"""A mechanism's numbers, written back into the MuJoCo model that it was imported from: importing it again gives them,
and nothing else in the file changes.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import linkage_crosscheck as lc
from analytic.mechanism.file import dumps, load
from commands import compare
from mjcf_files import PLAIN
from test_mjcf_logs import FOUR_BAR, SLIDER_CRANK

pytestmark = pytest.mark.mujoco
DAMPED = FOUR_BAR.replace('<motor name="m" joint="D"/>', '<motor name="m" joint="D" damping="0.3" gear="0.5"/>')
INERTIAL = PLAIN.replace(  # turned about z, and given with a comment that stays
    '<geom type="box" size="0.005" density="7850" contype="0" conaffinity="0" fromto="0 0 0 0.1 0 0"/>',
    '<!-- weighed --> <inertial pos="0.05 0 0" mass="0.08" diaginertia="2e-6 6e-5 6e-5" euler="0 0 0"/>',
)
MODELS = {"a slider-crank": SLIDER_CRANK, "a connect by bodies": FOUR_BAR, "by sites": PLAIN, "an inertial": INERTIAL}


def explained(mechanism: lc.Mechanism) -> lc.Mechanism:
    """With another length, mass, centre, inertia, pivot and laws of every joint of the tree, and a clearance."""
    body, joint = mechanism.bodies[1], mechanism.joints[1]
    *_, last = body.points
    x, y = body.points[last]
    longer = mechanism.with_body(
        body.name, points={**body.points, last: (x + 0.003, y)}, mass=1.1 * body.mass, inertia=1.3 * body.inertia,
        com=(body.com[0] + 0.002, body.com[1] - 0.001),
    )  # fmt: skip
    pivot = next(iter(mechanism.ground.points))
    x, y = mechanism.ground.points[pivot]
    ground = mechanism.ground.model_copy(update={"points": {**mechanism.ground.points, pivot: (x + 0.001, y - 0.002)}})
    moved = longer.replace(ground=ground)
    return moved.with_joint(joint.name, damping=joint.damping + 0.01, friction_torque=0.02, clearance=1e-4)


@pytest.mark.parametrize("model", MODELS)
def test_importing_it_again_gives_the_numbers(tmp_path: Path, model: str) -> None:
    (tmp_path / "model.xml").write_text(MODELS[model])
    wanted = explained(lc.import_mjcf(tmp_path / "model.xml").mechanism)
    (tmp_path / "explained.toml").write_text(dumps(wanted))
    done = lc.apply(tmp_path / "explained.toml", to=tmp_path / "model.xml")
    (tmp_path / "new.xml").write_text(done.text)
    found = lc.import_mjcf(tmp_path / "new.xml").mechanism
    for body in wanted.bodies:
        there = found.body(body.name)
        assert there.mass == pytest.approx(body.mass, rel=1e-12)
        assert there.moment_of_inertia == pytest.approx(body.moment_of_inertia, rel=1e-9)
        assert abs(there.centre - body.centre) < 1e-12
        assert max(abs(there.point(name) - body.point(name)) for name in body.points) < 1e-6
    assert max(abs(found.ground.point(name) - wanted.ground.point(name)) for name in wanted.ground.points) < 1e-9
    name = wanted.joints[1].name
    assert found.joint(name).damping == pytest.approx(wanted.joint(name).damping, rel=1e-12)
    assert found.joint(name).friction_torque == pytest.approx(0.02, rel=1e-12)
    assert done.left == (f"joint.{name}.clearance = 0.0001",)
    assert len(done.written) >= 8


@pytest.mark.parametrize("model", MODELS)
def test_nothing_else_in_the_file_changes(tmp_path: Path, model: str) -> None:
    """The numbers that were taken back out leave the file as it was: start tags alone differ."""
    text = MODELS[model]
    (tmp_path / "model.xml").write_text(text)
    mechanism = lc.import_mjcf(tmp_path / "model.xml").mechanism
    (tmp_path / "same.toml").write_text(dumps(mechanism))
    assert lc.apply(tmp_path / "same.toml", to=tmp_path / "model.xml").text == text
    body = mechanism.bodies[1]
    (tmp_path / "heavier.toml").write_text(dumps(mechanism.with_body(body.name, mass=2 * body.mass)))
    heavier = lc.apply(tmp_path / "heavier.toml", to=tmp_path / "model.xml")
    assert len(heavier.written) == 1
    assert re.sub(r"<inertial [^>]*/>", "", heavier.text) == re.sub(r"<inertial [^>]*/>", "", text)


def test_what_an_actuator_gives_a_joint_stays_its_own(tmp_path: Path) -> None:
    (tmp_path / "model.xml").write_text(DAMPED)
    mechanism = lc.import_mjcf(tmp_path / "model.xml").mechanism
    assert mechanism.joint("D").damping == pytest.approx(0.02 + 0.3 * 0.5**2)
    (tmp_path / "more.toml").write_text(dumps(mechanism.with_joint("D", damping=0.15)))
    done = lc.apply(tmp_path / "more.toml", to=tmp_path / "model.xml")
    assert [float(each) for each in re.findall(r' damping="(.*?)"', done.text)] == [pytest.approx(0.075), 0.3]
    (tmp_path / "new.xml").write_text(done.text)
    assert lc.import_mjcf(tmp_path / "new.xml").mechanism.joint("D").damping == pytest.approx(0.15, rel=1e-12)


def test_springs_rest_where_they_should_in_the_units_of_the_file(tmp_path: Path) -> None:
    (tmp_path / "model.xml").write_text(FOUR_BAR)
    mechanism = lc.import_mjcf(tmp_path / "model.xml").mechanism
    (tmp_path / "sprung.toml").write_text(dumps(mechanism.with_joint("A", stiffness=2.0, rest_angle=0.5)))
    done = lc.apply(tmp_path / "sprung.toml", to=tmp_path / "model.xml")
    (tmp_path / "new.xml").write_text(done.text)
    joint = lc.import_mjcf(tmp_path / "new.xml").mechanism.joint("A")
    assert (joint.stiffness, joint.rest_angle) == (pytest.approx(2.0), pytest.approx(0.5, abs=1e-9))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda text: text.replace('coupler"', 'rod"'), "'A' is between other bodies; apply"),
        (lambda text: text.replace("<worldbody>", "<worldbody><frame>").replace("</worldbody>", "</frame></worldbody>"),
         "has <frame>, so that its bodies are not written where they are"),
        (lambda text: text[:200], "model.xml"),
    ],
)  # fmt: skip
def test_what_it_cannot_be_applied_to_is_a_sentence(tmp_path: Path, change: object, words: str) -> None:
    (tmp_path / "model.xml").write_text(FOUR_BAR)
    (tmp_path / "ours.toml").write_text(dumps(explained(lc.import_mjcf(tmp_path / "model.xml").mechanism)))
    (tmp_path / "model.xml").write_text(change(FOUR_BAR))  # type: ignore[operator]
    done = compare("apply", "ours.toml", "--to", "model.xml", cwd=tmp_path)
    assert done.returncode == 2
    assert words in done.stderr
    assert sorted(file.name for file in tmp_path.iterdir()) == ["model.xml", "ours.toml"]


def test_the_command_writes_a_file_beside_and_never_its_input(tmp_path: Path) -> None:
    (tmp_path / "model.xml").write_text(FOUR_BAR)
    (tmp_path / "ours.toml").write_text(dumps(explained(lc.import_mjcf(tmp_path / "model.xml").mechanism)))
    done = compare("apply", "ours.toml", "--to", "model.xml", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "written: body.coupler.mass = 0.11, was 0.1" in done.stdout
    assert "left out, as MJCF has no word or no place for it: joint.A.clearance = 0.0001" in done.stdout
    assert (tmp_path / "model-explained.xml").read_text() != FOUR_BAR
    over = compare("apply", "ours.toml", "--to", "model.xml", "--out", "model.xml", "--overwrite", cwd=tmp_path)
    assert over.returncode == 2
    assert (tmp_path / "model.xml").read_text() == FOUR_BAR
    assert load(tmp_path / "ours.toml").joint("A").clearance == 1e-4

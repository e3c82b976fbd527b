"""The law of contact of a rig that rattles: looked for where it is asked for, told by statistics, or refused."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import count, repeat
from pathlib import Path

import numpy as np
import pytest

from analytic.mechanism.file import load
from commands import assert_refused, compare
from compare.diagnose.data.recording import MeasuredError
from compare.diagnose.effects.joints import ContactLaw, JointClearance
from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.diagnose.predict import Term
from compare.diagnose.rattle.contact import Found, lawless
from compare.diagnose.rattle.law import Law, LawSearch, Room
from compare.diagnose.rattle.statistics import Readings
from compare.diagnose.sensitivities import candidates
from compare.diagnose.workflow import diagnose
from diagnosis_rigs import experiment, four_bar, played, readings
from sim_models.engine import Unsupported
from test_diagnose_rattle import smooth, statistics, struck
from tests.evidence.scoreboard.hidden import Hidden
from tests.evidence.scoreboard.record import write_data
from tests.evidence.validation.laws import CLEARANCE, LAWS, recorded, rig

TRUE = Law(0.7, 3e6, 0.1)
USUAL = 1e7  # N/m
LAW = ContactLaw()


def rattled(seed: int, law: Law, answers: bool = True) -> dict[str, np.ndarray]:
    """Blows that grow with restitution, are the shorter the harder the wall is, and of which friction turns a part
    about; without ``answers`` whatever law there is.
    """
    found = struck(np.random.default_rng(seed))
    if not answers:
        return found
    blow = {s: v - smooth()[s] for s, v in found.items()}
    hard, rub = math.log10(law.stiffness / TRUE.stiffness), law.friction - TRUE.friction
    factor = {
        "follower_angle": math.exp(1.5 * (law.restitution - TRUE.restitution) - 3.0 * rub),
        "reaction_E_x": math.exp(1.0 * (law.restitution - TRUE.restitution) + 0.7 * hard),
        "reaction_E_y": math.exp(-0.7 * hard + 4.0 * rub),
    }
    return {s: smooth()[s] + v * factor[s] for s, v in blow.items()}


def searched(answers: bool, seeds: Iterator[int]) -> LawSearch:
    """The law of such a rig, looked for with blows of these seeds."""

    def simulate(law: Law, size: float) -> Readings:
        return [rattled(next(seeds), law, answers)]

    search = LawSearch(statistics(rattled(4, TRUE)), simulate, Room(USUAL, 5e-4))
    assert search.searched()
    return search


def test_a_law_is_found_where_impacts_come_back() -> None:
    search = searched(True, repeat(4))
    found = Found(Term(LAW, "B"), None, search)  # type: ignore[arg-type]
    law, size = search.room.at(search.answer.x)
    assert size == 5e-4
    assert law.restitution == pytest.approx(TRUE.restitution, abs=0.05)
    assert law.friction == pytest.approx(TRUE.friction, abs=0.02)
    assert law.stiffness == pytest.approx(TRUE.stiffness, rel=0.2)
    assert found.untold() == []
    assert len(search.trials) < 80


def test_a_law_is_within_its_intervals_where_impacts_are_others_each_time() -> None:
    """They are wide: six revolutions of three sensors tell little."""
    found = Found(Term(LAW, "B"), None, searched(True, count(9)))  # type: ignore[arg-type]
    for name, interval in found.intervals().items():
        assert interval.low <= getattr(TRUE, name) <= interval.high, name


def test_parameters_to_which_statistics_do_not_answer_are_not_told() -> None:
    found = Found(Term(LAW, "B"), None, searched(False, count(9)))  # type: ignore[arg-type]
    assert found.untold() == ["restitution", "stiffness", "friction"]
    known = found.intervals()
    assert (known["restitution"].low, known["restitution"].high) == (0.0, 1.0)
    assert (known["stiffness"].low, known["stiffness"].high) == (-math.inf, math.inf)
    assert (known["friction"].low, known["friction"].high) == (0.0, math.inf)
    assert "hardly answer to restitution and stiffness and friction" in found.told("mujoco")


def test_a_search_without_time_finds_no_law() -> None:
    search = LawSearch(statistics(rattled(4, TRUE)), lambda law, size: None, Room(USUAL, 5e-4), lambda: True)
    assert not search.searched()
    assert search.trials == []


def test_it_is_no_candidate_unless_it_is_asked_for() -> None:
    rig = experiment().rig
    assert all(not t.effect.asked_for for t in candidates(rig, VOCABULARY))
    named = [t.label for t in candidates(rig, VOCABULARY, ["contact_law@B"]) if t.effect.asked_for]
    assert named == ["contact_law@B"]
    everywhere = [t.where for t in candidates(rig, VOCABULARY, ["contact_law"]) if t.effect.asked_for]
    assert everywhere == [joint.name for joint in rig.mechanism.joints]


def terms(*joints: str, clearance: bool = False) -> list[Term]:
    return [Term(LAW, j) for j in joints] + [Term(JointClearance(), j) for j in joints if clearance]


@pytest.mark.parametrize(
    ("joints", "simulator", "error", "words"),
    [
        ("B", "mujoco", None, ""),
        ("E", "mujoco", MeasuredError, r"contact_law@E .* joint E has no clearance .* ask for joint_clearance too"),
        ("BA", "mujoco", MeasuredError, "joints B and A at once; ask for one of them: contact_law@B"),
        ("B", "dart", Unsupported, "contact of dart .* choose `simulator` mujoco or exudyn"),
    ],
)
def test_laws_that_cannot_be_looked_for_are_refused(
    joints: str, simulator: str, error: type[Exception] | None, words: str
) -> None:
    m = load("crank-rocker").ideal().with_joint("B", clearance=2e-4).with_joint("A", clearance=2e-4)
    if error is None:
        assert lawless(terms(*joints), {}, m, simulator, []) == {}
        return
    with pytest.raises(error, match=words):
        lawless(terms(*joints), {}, m, simulator, [t.label for t in terms(*joints)])


def test_with_an_unknown_clearance_it_may_be_asked_for_anywhere() -> None:
    m = load("crank-rocker").ideal()
    assert lawless(terms(*"BE", clearance=True), {}, m, "mujoco", []) == {}
    excluded = {("joint_clearance", j): "excluded" for j in "BE"}
    with pytest.raises(MeasuredError, match="contact_law is asked for, and no joint of crank-rocker has clearance"):
        lawless(terms(*"BE", clearance=True), excluded, m, "mujoco", [])
    known = m.with_joint("B", clearance=2e-4)
    assert list(lawless(terms(*"BE", clearance=True), excluded, known, "mujoco", [])) == [("contact_law", "E")]


def test_the_law_is_the_joint_s_own_with_the_damping_that_its_restitution_stands_for() -> None:
    m = load("crank-rocker").with_joint("B", clearance=2e-4, contact_damping=40.0, restitution=None)
    made = LAW.on_mechanism(m, "B", TRUE._asdict()).joint("B")
    assert (made.restitution, made.contact_stiffness, made.friction) == tuple(TRUE)
    assert made.contact_damping is None
    assert made.clearance == 2e-4


@pytest.mark.mujoco
@pytest.mark.parametrize(
    ("asked", "simulator", "words"),
    [
        ("contact_law@E", "mujoco", "joint E has no clearance"),
        ("contact_law", "dart", "choose --simulator mujoco or exudyn"),
        ("contact_law@Q", "mujoco", "'contact_law@Q' is not an effect of these data"),
    ],
)
def test_the_command_refuses_in_a_sentence(asked: str, simulator: str, words: str, tmp_path: Path) -> None:
    rig = experiment()
    write_data(Hidden(0, "effects", rig, "exudyn", "mujoco"), readings(rig), tmp_path)
    done = compare("diagnose", "measured.toml", "--only", asked, "--simulator", simulator, cwd=tmp_path)
    assert_refused(done, words)


@pytest.mark.slow
@pytest.mark.mujoco
def test_pins_that_keep_touching_tell_no_law() -> None:
    rig = experiment(mechanism=four_bar().with_joint("B", clearance=1e-4))
    found = diagnose(played(rig), "mujoco", only=["contact_law"], others=False, workers=1)
    assert found.effects == ()
    (note,) = [note for note in found.notes if "contact law is asked for" in note]
    assert "do not show that a pin leaves its bearing" in note
    assert ("contact_law", "B") in {(c.name, c.where) for c in found.candidates}


# ---------------------------------------------------------------- rigs (long)


@pytest.mark.slow
@pytest.mark.exudyn
@pytest.mark.mujoco
def test_the_law_of_a_pin_is_found_with_its_joint_and_its_clearance(tmp_path: Path) -> None:
    """Without friction joint E does better than B, where the clearance is: 0.494 mm in B, 0.097 and 4.9e6 N/m were
    found.  What impacts give back these data do not tell.
    """
    made = rig("crank-rocker", LAWS["crank-rocker"] | {"contact_stiffness": 5e6})
    asked = ["joint_clearance", "contact_law"]
    path = recorded(made, made.believed, tmp_path, revolutions=4)
    found = diagnose(path, "mujoco", only=asked, others=False, workers=1)
    gap, law = found.effects
    assert (gap.name, gap.where, law.name, law.where) == ("joint_clearance", "B", "contact_law", "B")
    clearance, values = gap.parameters["radial_clearance"], law.parameters
    assert clearance.value == pytest.approx(CLEARANCE, rel=0.05)
    assert (clearance.low or 0.0) < CLEARANCE < (clearance.high or math.inf)
    assert (clearance.high or math.inf) < 1.3 * clearance.value
    assert values["friction"].value == pytest.approx(0.1, abs=0.02)
    assert values["stiffness"].value == pytest.approx(5e6, rel=0.5)
    assert law.gap_after < law.gap_before < gap.gap_before / 4
    joint = found.explained.joint("B")
    told = [values[name].value for name in ("restitution", "stiffness", "friction")]
    assert [joint.restitution, joint.contact_stiffness, joint.friction] == pytest.approx(told, rel=1e-12)
    assert joint.clearance == pytest.approx(CLEARANCE, rel=0.05)

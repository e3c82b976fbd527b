"""Maps of validity of blocks with clearance in their guides, against a closed form and between engines."""

from __future__ import annotations

import json
import re
from functools import cache
from importlib import resources
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from analytic.mechanism import Mechanism
from analytic.mechanism.file import load
from compare.domain_map.validity import plan_of, validity
from compare.faults import ArgumentError
from compare.questions.validity import ValidityQuestion
from compare.report.validity_text import markdown
from compare.report.words.validity import RPM, edge_rows
from compare.results.validity import Cell, Validity
from sim_models.engine import Unsupported, declared

SCHEMA = json.loads(resources.files("compare").joinpath("schemas", "validity.json").read_text(encoding="utf-8"))


def sliding(friction: float) -> Mechanism:
    """The slider-crank with gravity, a block of some moment of inertia, and clearance and friction in its guide."""
    m = load("slider-crank").replace(gravity=(0.0, -9.81))
    slider = m.body("slider").model_copy(update={"inertia": 2e-4})
    m = m.replace(bodies=(*m.bodies[:2], slider)).with_clearances({"S": 1e-4})
    return m.with_joint("S", friction=friction, restitution=0.5)


@cache
def of_blocks(simulator: str, friction: float) -> Validity:
    """Its map at 100 and 600 rpm, 0.01 and 0.1 mm."""
    return validity(
        sliding(friction),
        speeds=[100 * RPM, 600 * RPM],
        clearances=[1e-5, 1e-4],
        simulator=simulator,
        workers=1,
    )


@pytest.mark.slow
@pytest.mark.parametrize("simulator", ["exudyn", "mujoco"])
def test_a_block_has_a_map_of_its_own_words(simulator: str) -> None:
    """At 100 rpm its weight keeps it on its wall, and friction takes what it wears; at 600 it flies and bounces."""
    pytest.importorskip(simulator)
    result = of_blocks(simulator, 0.1)
    assert (result.joints, result.joints_are, result.boundary) == (("S",), "the case's own", None)
    kept, lost = (result.of(simulator)[speed * RPM, 1e-5] for speed in (100, 600))
    assert isinstance(kept, Cell)
    assert isinstance(lost, Cell)
    assert (kept.verdict, kept.left) == ("agrees", False)
    assert (lost.verdict, lost.cause) == ("disagrees", "contact")
    assert kept.watched is not None
    assert lost.watched is not None
    slid = 4 * 0.05 * 0.1 * (0.14 + 0.21 / 2) * 9.81  # J, two strokes of the block under its weight, about
    assert kept.watched.lost == pytest.approx(slid, rel=0.1)
    assert lost.watched.peak_ratio > 2.0
    assert lost.watched.free > 0.1
    head, *rows = edge_rows(result)
    assert (head, rows) == (["rpm", simulator], [["100", "kept"], ["600", "below 0.01"]])
    text = markdown(result)
    assert "not predicted, as S has a block" in text
    assert "one of the block's corners at least is at its wall at all times" in text
    assert re.search(r"\bpins?\b", text) is None
    Draft202012Validator(SCHEMA).validate(json.loads(result.to_json()))


@pytest.mark.slow
@pytest.mark.mujoco
def test_engines_have_the_same_map_of_a_block() -> None:
    pytest.importorskip("exudyn")
    one, other = of_blocks("mujoco", 0.1), of_blocks("exudyn", 0.1)
    for mine, its in zip(one.cells, other.cells, strict=True):
        assert isinstance(mine, Cell)
        assert isinstance(its, Cell)
        assert (mine.verdict, mine.fails) == (its.verdict, its.fails)
        assert mine.watched is not None
        assert its.watched is not None
        assert mine.watched.lost == pytest.approx(its.watched.lost, rel=0.05)
        assert mine.watched.free == pytest.approx(its.watched.free, abs=0.02)


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"joint_model": "massless-link"}, "a massless link holds a pin, and joint 'S' is a block in a guide"),
        ({"joints": ["S", "B"]}, "'S' is a block in a guide and 'B' a pin in a bearing; give each a map of its own"),
        ({"simulator": "pybullet"}, "pybullet does not simulate contact joints in driven motion"),
        ({"simulator": "dart"}, "dart has no friction in contact"),
    ],
)
def test_what_a_map_of_a_block_cannot_be_says_so(asked: dict[str, Any], words: str) -> None:
    if "simulator" in asked:
        pytest.importorskip(declared(asked["simulator"]).package)
    with pytest.raises((ArgumentError, Unsupported), match=re.escape(words)):
        validity(sliding(0.1), speeds=[10.0], clearances=[1e-4], workers=1, **({"simulator": "exudyn"} | asked))


def test_a_block_without_a_moment_of_inertia_has_no_map() -> None:
    with pytest.raises(Unsupported, match=r"body 'slider' may turn by its clearance.*give its inertia"):
        validity("slider-crank", speeds=[10.0], clearances=[1e-4], joints=["S"], simulator="exudyn", workers=1)


def test_a_map_of_springs_leaves_friction_out_and_says_so() -> None:
    pytest.importorskip("exudyn")
    asked: dict[str, Any] = {"simulator": "exudyn", "joint_model": "spring-damper"}
    grid = plan_of(ValidityQuestion(sliding(0.1), speeds=[10.0], clearances=[1e-4], **asked))
    assert "left out: friction of joint S, as only contact joints rub in their clearance" in grid.warnings

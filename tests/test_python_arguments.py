"""``import linkage_crosscheck as lc``: what is given wrongly is one sentence of one type, whatever the function."""

from __future__ import annotations

import pickle
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import linkage_crosscheck as lc
from analytic.kinematics.closure import AssemblyError
from analytic.kinematics.structure import StructureError
from analytic.mechanism import MechanismError
from analytic.mechanism.file import dumps
from analytic.paper.frame import ComplianceError
from compare.diagnose.data.recording import MeasuredError
from compare.evidence.baseline.file import BaselineError
from compare.faults import ArgumentError
from compare.files import OutputError
from compare.judge.grid import GridError
from compare.judge.tolerances import ToleranceError
from compare.results.document import DocumentError
from compare.sweep import ClusterError
from sim_models.engine import SimulationError, SimulatorMissing, Unsupported

PAPER = lc.load("paper")


def one_sentence(error: BaseException, *words: str) -> None:
    """The message has these words and neither a second line, an address nor an option of the command."""
    text = str(error)
    for never in ("\n", "http", "--"):
        assert never not in text, text
    for word in words:
        assert word in text, f"{text!r} has no {word!r}"


# ------------------------------------------------------------------ one type to catch


@pytest.mark.parametrize(
    "kind",
    [
        AssemblyError, StructureError, ComplianceError, MechanismError, MeasuredError, BaselineError, ArgumentError,
        OutputError, GridError, ToleranceError, DocumentError, ClusterError, Unsupported,
    ],
)  # fmt: skip
def test_every_fault_of_what_was_given_is_an_error_and_a_value_error(kind: type[Exception]) -> None:
    assert issubclass(kind, lc.Error)
    assert issubclass(kind, ValueError)


@pytest.mark.parametrize("kind", [SimulatorMissing, SimulationError])
def test_every_fault_of_a_simulator_is_an_error_and_a_runtime_error(kind: type[Exception]) -> None:
    assert issubclass(kind, lc.Error)
    assert issubclass(kind, RuntimeError)


def test_an_argument_error_comes_back_whole_from_another_process() -> None:
    found = pickle.loads(pickle.dumps(ArgumentError("angles", "give some")))
    assert str(found) == "angles: give some"
    assert found.argument == "angles"


# ------------------------------------------------------------------ a mechanism changed in Python


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda: PAPER.replace(speed=3), ["'speed'", "gravity", "drive", "assembly"]),
        (lambda: PAPER.replace(load=[]), ["'load'", "loads"]),
        (lambda: PAPER.replace(body=[]), ["'body'", "bodies"]),
        (lambda: PAPER.replace(joint=[]), ["'joint'", "joints"]),
        (lambda: PAPER.replace(gravity="no"), ["gravity = 'no'"]),
        (lambda: PAPER.replace(drive={"joint": "D", "speed": "fast"}), ["drive.speed = 'fast'"]),
        (lambda: PAPER.with_body("crankk"), ["'crankk'", "did you mean 'crank'", "coupler"]),
        (lambda: PAPER.with_body("crank", mass=-1), ["body[crank].mass = -1", "greater than 0"]),
        (lambda: PAPER.with_body("crank", weight=1), ["body[crank].weight is not a field"]),
        (lambda: PAPER.with_joint("Q", clearance=0.0), ["'Q'", "D, A, B, E"]),
        (lambda: PAPER.with_joint("B", clearance="wide"), ["joint[B].clearance = 'wide'"]),
        (lambda: PAPER.with_clearances({"B": -1}), ["joint[B].clearance = -1"]),
        (lambda: PAPER.with_clearances({"B": 1.0}), ["clearance = 1.0 m", "coupler"]),
        (lambda: PAPER.with_clearances({"Q": 1e-4}), ["'Q'", "D, A, B, E"]),
        (lambda: PAPER.with_clearances("B"), ["'B'", "metres by joint"]),  # type: ignore[arg-type]
        (lambda: lc.Drive(joint="D", speed="fast"), ["Drive: speed = 'fast'", "'free' or 'measured'"]),  # type: ignore[arg-type]
        (lambda: lc.Body(name="rod", points={"A": (0.0, 0.0)}, mass=-1.0), ["Body: mass = -1"]),
    ],
)
def test_a_wrong_change_of_a_mechanism_says_where_and_what_is_accepted(
    change: Callable[[], object], words: list[str]
) -> None:
    with pytest.raises(MechanismError) as caught:
        change()
    one_sentence(caught.value, *words)


def test_a_right_change_of_a_mechanism_is_made() -> None:
    assert PAPER.replace(gravity=(0.0, -9.81)).gravity == (0.0, -9.81)
    assert PAPER.with_body("crank", mass=2.0).moving["crank"].mass == 2.0
    assert PAPER.with_clearances({"B": np.float64(1e-4)}).clearances == {"B": 1e-4}


def test_a_fault_within_a_part_of_a_file_is_still_named_by_its_place(tmp_path: Path) -> None:
    path = tmp_path / "heavy.toml"
    path.write_text(dumps(PAPER).replace("mass = 0.157", "mass = -1", 1))
    with pytest.raises(MechanismError, match=re.escape("body[crank].mass = -1")):
        lc.load(path)

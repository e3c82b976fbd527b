"""Drives that stand or turn back where their joints have dry friction: only what such a drive gives has no number."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import linkage_crosscheck as lc
from analytic.kinematics.assembly import Assembly
from analytic.kinematics.schedule import Schedule
from analytic.mechanism import Drive, Mechanism
from analytic.mechanism.file import load, loads
from compare.judge.reference import reference
from several_linkages import GANTRY, waved
from sim_models.engine import ENGINES

TIMES = np.linspace(0.0, 0.2, 6)


def rubbing(**torques: float) -> Mechanism:
    m = load("five-bar")
    for joint, torque in torques.items():
        m = m.with_joint(joint, friction_torque=torque)
    return m


def test_a_drive_that_is_held_has_no_torque_and_all_else_has_its_number() -> None:
    """Without the friction it would be what it is with it, but for that torque."""
    drives = (Drive(joint="D", speed=2.0), Drive(joint="E", speed=0.0))
    found, free = (
        lc.analyse(m.replace(drives=drives), times=TIMES).signals for m in (rubbing(E=0.05), load("five-bar"))
    )
    assert np.all(np.isnan(found["drive_torque_E"]))
    for name, values in free.items():
        if name != "drive_torque_E" and np.all(np.isfinite(values)):
            np.testing.assert_allclose(found[name], values, atol=1e-12, err_msg=name)


def test_where_a_drive_turns_back_its_torque_alone_has_no_number(tmp_path: Path) -> None:
    t = np.linspace(0.0, 1.0, 41)
    at = {name: where[0] for name, (_, where) in waved(load("five-bar")).items()}
    rows = "".join(f"{x},{at['D'] + 0.2 * x},{at['E'] + 0.1 * np.sin(5 * x)}\n" for x in t)
    (tmp_path / "course.csv").write_text(f"time [s],position_D [rad],position_E [rad]\n{rows}", encoding="utf-8")
    found = lc.analyse(rubbing(D=0.03, E=0.05), course=tmp_path / "course.csv", times=t)
    assert not found.flags
    silent = np.flatnonzero(np.isnan(found.signals["drive_torque_E"]))
    assert silent.size
    turns = np.pi / 10 + np.pi / 5 * np.arange(2)
    assert all(np.abs(t[k] - turns).min() < 0.03 for k in silent)
    assert np.all(np.isfinite(found.signals["drive_torque_D"]))
    assert np.all(np.isfinite(found.signals["reaction_P_x"]))
    assert any("drive_torque_E has no number at" in each for each in found.warnings)


@pytest.mark.slow
@pytest.mark.parametrize("name", [pytest.param(n, marks=getattr(pytest.mark, n)) for n in ENGINES])
def test_engines_are_compared_in_everything_else(name: str, tmp_path: Path) -> None:
    t = np.linspace(0.0, 1.0, 41)
    at = {n: where[0] for n, (_, where) in waved(load("five-bar")).items()}
    x = np.clip(t / 0.4, 0.0, 1.0)
    moved = x**3 * (10 - 15 * x + 6 * x * x)  # and then it dwells
    rows = "".join(f"{a},{at['D'] + 0.3 * b},{at['E'] - 0.3 * np.sin(3 * a)}\n" for a, b in zip(t, moved, strict=True))
    (tmp_path / "course.csv").write_text(f"time [s],position_D [rad],position_E [rad]\n{rows}", encoding="utf-8")
    for motion in ("driven", "static"):
        m = rubbing(D=0.03, E=0.05)
        found = lc.crosscheck(m, simulator=name, course=tmp_path / "course.csv", times=t, motion=motion)
        assert found.verdict == "agrees"
        assert not found.runs[0].flags
        assert any("drive_torque_D has no number at" in each for each in found.warnings)


def test_how_near_a_reversal_a_slide_is_silent_is_no_matter_of_its_unit() -> None:
    """Of a slide a hundred times as long, whose way is a hundred times as far."""
    t = np.linspace(0.0, 2.0, 401)
    shares = []
    for size in (1.0, 100.0):
        text = GANTRY.replace("[0.2, 0.0]", f"[{0.2 * size}, 0.0]")
        m = loads(text).with_joint("X", friction_torque=1.0)
        schedule = Schedule.along({"X": (t, 0.05 * size * np.sin(5 * t)), "Y": (t, 0.01 * size * t)}, t)
        side = reference(Assembly(m), schedule, "equilibrium", {})
        shares.append(int(np.isnan(side.signals["drive_force_X"]).sum()))
        assert np.all(np.isfinite(side.signals["drive_force_Y"]))
    assert shares[0] == shares[1]
    assert 3 <= shares[0] <= 40  # half a hundredth of its length to either side of three reversals

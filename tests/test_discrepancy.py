"""The comparator: what agrees passes, and what must fail fails."""

from __future__ import annotations

import numpy as np
import pytest

from compare.discrepancy import Rule, Scales, ToleranceError, difference, judge, load_tolerances

THETA = np.linspace(0.3, 2.8, 51)
ANGLE, SIZE = THETA.copy(), 50.0 + 20 * np.cos(THETA)
SIDE = {"reaction_B_angle": ANGLE, "reaction_B_magnitude": SIZE, "drive_torque": -10 * np.cos(THETA)}
TOLERANCES = load_tolerances()


def rule(kind: str) -> Rule:
    return Rule.read(TOLERANCES, "static", "contact", kind, Scales(70.0, 0.4))  # type: ignore[arg-type]


def verdict(signal: str, kind: str, **changed: np.ndarray) -> str | None:
    found = judge(signal, SIDE | changed, SIDE, rule(kind))  # type: ignore[arg-type]
    return found.verdict if found else None


@pytest.mark.parametrize(("signal", "kind"), [("reaction_B_angle", "angle"), ("reaction_B_magnitude", "magnitude"), ("drive_torque", "torque")])
def test_equal_signals_agree(signal: str, kind: str) -> None:
    assert verdict(signal, kind) == "agrees"


FAULTS = {
    "an angle off by 0.02 deg": ("reaction_B_angle", "angle", ANGLE + np.radians(0.02)),
    "a flipped angle": ("reaction_B_angle", "angle", ANGLE + np.pi),
    "one bad sample": ("reaction_B_angle", "angle", ANGLE + np.radians(0.02) * (np.arange(51) == 17)),
    "a size off by 0.1 %": ("reaction_B_magnitude", "magnitude", SIZE * 1.001),
    "a flipped sign": ("drive_torque", "torque", 10 * np.cos(THETA)),
    "a shift by one sample": ("drive_torque", "torque", -10 * np.cos(np.roll(THETA, 1))),
}


@pytest.mark.parametrize(("signal", "kind", "values"), FAULTS.values(), ids=FAULTS)
def test_a_fault_disagrees(signal: str, kind: str, values: np.ndarray) -> None:
    assert verdict(signal, kind, **{signal: values}) == "disagrees"


def test_a_whole_turn_is_no_difference() -> None:
    assert verdict("reaction_B_angle", "angle", reaction_B_angle=ANGLE + 2 * np.pi) == "agrees"


def test_the_largest_difference_keeps_its_sign_and_place() -> None:
    values = np.zeros(51)
    values[7], values[30] = -3e-3, 2e-3
    found = difference(ANGLE + values, ANGLE, angular=True)
    assert found is not None
    assert (found.max, found.at) == (pytest.approx(-3e-3), 7)
    assert found.rms == pytest.approx(np.sqrt(np.mean(values**2)))


def test_a_force_near_zero_has_no_direction_to_compare() -> None:
    size = SIZE.copy()
    size[20] = 1e-9
    angle = ANGLE.copy()
    angle[20] += 1.0
    found = judge("reaction_B_angle", SIDE | {"reaction_B_angle": angle}, SIDE | {"reaction_B_magnitude": size}, rule("angle"))
    assert found is not None
    assert found.verdict == "agrees"


def test_signals_without_a_common_sample_are_not_judged() -> None:
    assert difference(np.full(5, np.nan), np.zeros(5), angular=False) is None


def test_a_faulty_tolerance_file_is_refused(tmp_path) -> None:  # type: ignore[no-untyped-def]
    path = tmp_path / "t.toml"
    path.write_text("not = [toml", encoding="utf-8")
    with pytest.raises(ToleranceError, match=r"--tolerance .*t.toml: cannot be read"):
        load_tolerances(path)


def test_a_direction_is_judged_by_its_error_in_newtons() -> None:
    size = np.where(np.arange(51) == 20, 5.0, 70.0)
    off = np.where(np.arange(51) == 20, np.radians(0.1), 0.0)  # ten times the tolerance, at a fourteenth of the force
    weak = judge("reaction_B_angle", SIDE | {"reaction_B_angle": ANGLE + off}, SIDE | {"reaction_B_magnitude": size}, rule("angle"))
    strong = judge("reaction_B_angle", SIDE | {"reaction_B_angle": ANGLE + np.roll(off, 1)}, SIDE | {"reaction_B_magnitude": size}, rule("angle"))
    assert weak is not None
    assert strong is not None
    assert (weak.verdict, strong.verdict) == ("agrees", "disagrees")
    assert weak.tolerance == pytest.approx(1.75e-4 * 14)


def test_rounding_around_zero_is_no_disagreement() -> None:
    nothing = {"drive_torque": np.zeros(51), "reaction_B_magnitude": SIZE}
    found = judge("drive_torque", {"drive_torque": np.full(51, 1e-13)}, nothing, rule("torque"))
    assert found is not None
    assert found.verdict == "agrees"

"""The comparator: what agrees passes, and what must fail fails."""

from __future__ import annotations

from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.reach import usual_angles
from analytic.kinematics.schedule import Schedule
from analytic.mechanism.file import load
from analytic.mechanism.signals import Signal, SiUnit, named
from compare.judge.discrepancy import (
    Comparison,
    Rule,
    Scales,
    Tube,
    contact_give,
    difference,
    judge,
    run_rules,
)
from compare.judge.reference import reference
from compare.judge.signals import compared, kind_of, with_derived
from compare.judge.tolerances import Known, Line, ToleranceError, known_differences, load_tolerances
from sim_models.engine import JointModel

THETA = np.linspace(0.3, 2.8, 51)
ANGLE, SIZE = THETA.copy(), 50.0 + 20 * np.cos(THETA)
SIDE = {"reaction_B_angle": ANGLE, "reaction_B_magnitude": SIZE, "drive_torque": -10 * np.cos(THETA)}
TOLERANCES = load_tolerances()


GAMMA, DRIVE_TORQUE = Signal("reaction", "B", "angle"), Signal("drive", "", "torque")
JUDGED = {s.name: s for s in (GAMMA, GAMMA.sibling("magnitude"), DRIVE_TORQUE)}


def rule(signal: str) -> Rule:
    return Rule.read(TOLERANCES, "static", "contact", JUDGED[signal], Scales(70.0, 0.4))


def verdict(signal: str, **changed: np.ndarray) -> str | None:
    found = judge(rule(signal), SIDE | changed, SIDE)
    return found.verdict if found else None


@pytest.mark.parametrize("signal", JUDGED)
def test_equal_signals_agree(signal: str) -> None:
    assert verdict(signal) == "agrees"


@pytest.mark.parametrize(
    ("case", "clearance"), [("paper", {"B": 1e-3}), ("slider-crank", {}), ("six-bar", {"G": 1e-4})]
)
def test_each_compared_signal_is_one_of_its_linkage_and_has_a_unit_of_results(
    case: str, clearance: dict[str, float]
) -> None:
    mechanism = load(case)
    known = named(mechanism.bodies, mechanism.joints, mechanism.drives, mechanism.sensors)
    judged = compared(mechanism, clearance)
    assert {known[signal.name] for signal in judged} == set(judged)
    for signal in judged:
        assert signal.unit in get_args(SiUnit)
        assert signal.wraps == (kind_of(signal) in ("angle", "rotation", "position"))


def test_a_contact_gives_by_its_peak_force_over_its_stiffness() -> None:
    simulated = {"reaction_B_magnitude": np.array([20.0, np.nan, 50.0]), "reaction_E_magnitude": np.array([5.0])}
    assert contact_give({"contact_stiffness": 1e6}, ["B", "E"], simulated) == pytest.approx(5e-5)
    assert contact_give({"contact_stiffness": 1e6}, ["E"], simulated) == pytest.approx(5e-6)
    assert contact_give({"contact_stiffness": None}, ["B"], simulated) == 0.0
    assert contact_give({}, [], simulated) == 0.0


def test_each_pin_has_its_own_clearance_and_a_rotation_the_smallest() -> None:
    sizes = {"B": 2e-4, "E": 1e-4}
    rules = run_rules(TOLERANCES, load("paper"), "static", "contact", sizes, Scales(70.0, 0.4), 1e-6)
    assert rules["clearance_B_x"].clearance == 2e-4
    assert rules["clearance_E_y"].clearance == 1e-4
    assert rules["coupler_rotation"].clearance == 1e-4
    plain = Rule.read(TOLERANCES, "static", "contact", Signal("clearance", "B", "x"), Scales(70.0, 0.4))
    assert rules["clearance_B_x"].relative == pytest.approx(plain.relative + 1e-6 / 2e-4)


FAULTS = {
    "an angle off by 0.02 deg": ("reaction_B_angle", ANGLE + np.radians(0.02)),
    "a flipped angle": ("reaction_B_angle", ANGLE + np.pi),
    "one bad sample": ("reaction_B_angle", ANGLE + np.radians(0.02) * (np.arange(51) == 17)),
    "a size off by 0.1 %": ("reaction_B_magnitude", SIZE * 1.001),
    "a flipped sign": ("drive_torque", 10 * np.cos(THETA)),
    "a shift by one sample": ("drive_torque", -10 * np.cos(np.roll(THETA, 1))),
}


@pytest.mark.parametrize(("signal", "values"), FAULTS.values(), ids=FAULTS)
def test_a_fault_disagrees(signal: str, values: np.ndarray) -> None:
    assert verdict(signal, **{signal: values}) == "disagrees"


def test_a_whole_turn_is_no_difference() -> None:
    assert verdict("reaction_B_angle", reaction_B_angle=ANGLE + 2 * np.pi) == "agrees"


def test_the_largest_difference_keeps_its_sign_and_place() -> None:
    values = np.zeros(51)
    values[7], values[30] = -3e-3, 2e-3
    found = difference(GAMMA.apart(ANGLE + values, ANGLE))
    assert found is not None
    assert (found.max, found.at) == (pytest.approx(-3e-3), 7)
    assert found.rms == pytest.approx(np.sqrt(np.mean(values**2)))


def test_a_force_near_zero_has_no_direction_to_compare() -> None:
    size = SIZE.copy()
    size[20] = 1e-9
    angle = ANGLE.copy()
    angle[20] += 1.0
    found = judge(rule("reaction_B_angle"), SIDE | {"reaction_B_angle": angle}, SIDE | {"reaction_B_magnitude": size})
    assert found is not None
    assert found.verdict == "agrees"


def test_where_a_pin_flies_its_force_disagrees_and_has_no_direction() -> None:
    force = SIZE * np.exp(1j * ANGLE)
    force[20:23] = 0
    reported = {"reaction_O_x": force.real, "reaction_O_y": force.imag}
    derived = with_derived(reported, load("pendulum"))
    flown = {f"reaction_B_{kind}": derived[f"reaction_O_{kind}"] for kind in ("angle", "magnitude")}
    assert np.flatnonzero(np.isnan(flown["reaction_B_angle"])).tolist() == [20, 21, 22]
    assert verdict("reaction_B_angle", **flown) == "agrees"
    found = judge(rule("reaction_B_magnitude"), SIDE | flown, SIDE)
    assert found is not None
    assert (found.verdict, found.at) == ("disagrees", 20)


def test_signals_without_a_common_sample_are_not_judged() -> None:
    assert difference(np.full(5, np.nan)) is None


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_sample_without_a_number_on_one_side_disagrees(value: float) -> None:
    torque = SIDE["drive_torque"].copy()
    torque[17] = value
    found = judge(rule("drive_torque"), SIDE | {"drive_torque": torque}, SIDE)
    assert found is not None
    assert (found.verdict, found.at) == ("disagrees", 17)
    assert "1 of 51 samples" in found.reason
    blank = {"drive_torque": np.where(np.arange(51) == 17, np.nan, SIDE["drive_torque"])}
    flagged = judge(rule("drive_torque"), SIDE | blank, SIDE | blank)
    assert flagged is not None
    assert flagged.verdict == "agrees"


def test_a_body_that_clearance_does_not_turn_may_turn_by_rounding() -> None:
    still = {"slider_rotation": np.zeros(51)}
    turn = Signal("rotation", "slider", "angle")
    limits = Rule.read(TOLERANCES, "static", "contact", turn, Scales(70.0, 0.4), clearance=1e-4)
    rounding = judge(limits, {"slider_rotation": np.full(51, 1e-12)}, still)
    turned = judge(limits, {"slider_rotation": np.full(51, 1e-6)}, still)
    assert rounding is not None
    assert turned is not None
    assert (rounding.verdict, turned.verdict) == ("agrees", "disagrees")


# -------------------------------------------------------------------- the window of crank angle

GRID = np.radians(np.arange(0.0, 181.0, 5.0))
WINDOW = np.radians(0.05)


def judged(values: np.ndarray, simulated: np.ndarray, window: float = WINDOW, absolute: float = 1e-3) -> Comparison:
    limits = Rule(DRIVE_TORQUE, absolute, 0.0, 0.02, 0.0, Scales(1.0, 1.0), window=window)
    found = judge(limits, {"drive_torque": simulated}, {"drive_torque": values}, GRID)
    assert found is not None
    return found


STEEP = np.interp(
    GRID, [0.0, np.radians(88), np.radians(92), np.pi], [0.0, 0.1, 10.0, 10.1]
)  # jumps from one sample to the next


@pytest.mark.parametrize("side", [-1, 1])
def test_a_steep_flank_a_moment_early_or_late_agrees_and_without_the_window_it_would_not(side: int) -> None:
    late = np.interp(GRID + side * 0.9 * WINDOW, GRID, STEEP)
    assert judged(STEEP, late).verdict == "agrees"
    assert judged(STEEP, late, window=0.0).verdict == "disagrees"


@pytest.mark.parametrize("side", [-1, 1])
def test_twice_the_window_is_too_much(side: int) -> None:
    assert judged(STEEP, np.interp(GRID + side * 2 * WINDOW, GRID, STEEP)).verdict == "disagrees"


@pytest.mark.parametrize("curve", [STEEP, np.sin(GRID), 5 * np.cos(3 * GRID)], ids=["steep", "sine", "fast"])
def test_a_shift_by_one_sample_is_no_matter_of_the_window(curve: np.ndarray) -> None:
    assert judged(curve, np.roll(curve, 1)).verdict == "disagrees"


def test_the_window_gives_nothing_where_the_signal_is_flat() -> None:
    flat = np.full(GRID.size, 3.0)
    assert judged(flat, flat + 1.01e-3).verdict == "disagrees"
    assert judged(flat, flat + 1.01e-3).tolerance == pytest.approx(1e-3)


def test_the_tube_is_open_only_to_the_side_that_the_signal_takes() -> None:
    rising = np.where(GRID > np.radians(87), (GRID - np.radians(87)) * 100, 0.0)  # flat, then a kink upward
    at = int(np.flatnonzero(rising == 0)[-1])
    bump = 0.9 * WINDOW * (rising[at + 1] - rising[at]) / np.radians(5) * (np.arange(GRID.size) == at)
    assert judged(rising, rising + bump).verdict == "agrees"
    assert judged(rising, rising - bump).verdict == "disagrees"


def test_the_tube_of_a_line_is_its_slope_times_the_window_in_any_order_of_samples() -> None:
    order = np.random.default_rng(1).permutation(GRID.size)
    tube = Tube.around(4 * GRID[order], GRID[order], WINDOW)
    inner = (GRID[order] > 0) & (GRID[order] < np.pi)
    np.testing.assert_allclose(tube.above[inner], 4 * WINDOW)
    np.testing.assert_allclose(tube.below[inner], 4 * WINDOW)
    assert tube.above[order == GRID.size - 1] == 0  # the last sample has nothing above it


def test_a_missing_neighbour_opens_nothing() -> None:
    curve = 4 * GRID
    curve[10] = np.nan
    tube = Tube.around(curve, GRID, WINDOW)
    assert tube.above[9] == 0
    assert tube.below[9] == pytest.approx(4 * WINDOW)
    assert np.isfinite(tube.above).all()


# -------------------------------------------------------------------- known differences

KNOWN = Known(case="paper", signal="drive_torque", bound=0.5, reason="measured so")
TORQUE = SIDE["drive_torque"]


@pytest.mark.parametrize(
    ("off", "expected", "words"),
    [
        (0.3, "known", "measured so (bound 0.5 N.m)"),
        (-0.3, "known", "measured so"),
        (0.6, "disagrees", "has left its bound of 0.5 N.m: it reaches 0.6 N.m"),
        (-0.6, "disagrees", "it reaches -0.6 N.m"),
        (0.0, "disagrees", "has vanished"),
        (1e-4, "disagrees", "has vanished"),
    ],
)
def test_a_known_difference_must_be_there_and_within_its_bound(off: float, expected: str, words: str) -> None:
    found = judge(rule("drive_torque"), {"drive_torque": TORQUE + off}, SIDE, known=KNOWN)
    assert found is not None
    assert found.verdict == expected
    assert words in found.reason


def test_the_bound_of_a_known_direction_holds_at_every_angle_that_has_one() -> None:
    size = np.where(np.arange(51) == 20, 5.0, 70.0)
    off = np.where(np.arange(51) == 20, 0.3, 0.1)  # in newtons the first is the smaller error, in angle the larger
    side = SIDE | {"reaction_B_magnitude": size}
    known = Known(case="paper", signal="reaction_B_angle", bound=0.2, reason="measured so")
    found = judge(rule("reaction_B_angle"), SIDE | {"reaction_B_angle": ANGLE + off}, side, known=known)
    assert found is not None
    assert found.verdict == "disagrees"
    assert "reaches 0.3 rad" in found.reason


def overlay(folder: Path, text: str) -> dict[str, Any]:
    path = folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return load_tolerances(path)


def test_a_known_difference_is_about_the_runs_that_its_selectors_name(tmp_path: Path) -> None:
    text = '[[known]]\ncase = "paper"\nsignal = "drive_torque"\nbound = 0.5\nreason = "r"\n'
    text += 'joint_model = ["contact", "spring-damper"]\nmotion = "static"\n'
    tolerances = overlay(tmp_path, text)
    run = {
        "case": "paper",
        "simulator": "mujoco",
        "joint_model": "contact",
        "motion": "static",
        "analytic_model": "equilibrium",
    }
    assert list(known_differences(tolerances, **run)) == ["drive_torque"]
    for other in ({"case": "six-bar"}, {"joint_model": "ideal"}, {"motion": "driven"}):
        assert known_differences(tolerances, **(run | other)) == {}


def test_a_known_difference_of_a_signal_without_a_sample_to_compare_does_not_vanish() -> None:
    blank = {"drive_torque": np.full(51, np.nan)}
    assert judge(rule("drive_torque"), SIDE | blank, SIDE | blank) is None
    found = judge(rule("drive_torque"), SIDE | blank, SIDE | blank, known=KNOWN)
    assert found is not None
    assert found.verdict == "disagrees"
    assert "cannot be judged" in found.reason


# -------------------------------------------------------------------- tolerance files


def test_a_file_is_laid_over_the_shipped_one_line_by_line(tmp_path: Path) -> None:
    mine = overlay(tmp_path, "noise = 1e-6\n[static.contact]\nangle = { absolute = 0.01 }\n")
    assert mine.noise == 1e-6
    assert mine.line("static", "contact", "angle") == Line(absolute=0.01)
    assert mine.line("static", "contact", "magnitude") == TOLERANCES.line("static", "contact", "magnitude")
    assert (mine.driven, mine.floor) == (TOLERANCES.driven, TOLERANCES.floor)
    assert TOLERANCES.line("static", "contact", "angle") != Line(absolute=0.01)  # the shipped one is left alone


FAULTY = {
    "not = [toml": "cannot be read",
    'floor = "2 %"': "floor = '2 %': input should be a valid number",
    "noise = nan": "noise = nan: input should be a finite number",
    "flor = 0.1": "flor is not a field; did you mean 'floor'",
    "[static.contat]\nangle = { absolute = 1 }": "static.contat is not a field; did you mean 'contact'",
    "[static.contact]\nangel = { absolute = 1 }": "static.contact.angel is not a field; did you mean 'angle'",
    "[static.contact]\nangle = { absolute = -1 }": (
        "static.contact.angle.absolute = -1: input should be greater than or equal to 0"
    ),
    "[static.contact]\nangle = { absolute = true }": (
        "static.contact.angle.absolute = True: input should be a valid number"
    ),
    "[static.contact]\nangle = {}": "static.contact.angle = {}: give absolute, relative, or both",
    "[driven.contact]\nangle = { absolute = 1, window = 0.1 }": (
        "driven.contact.angle.window = 0.1: input should be less than or equal to 0.0175"
    ),
    '[[known]]\ncase = "paper"\nsignal = "drive_torque"\nbound = 1.0': "known[0].reason is missing",
    '[[known]]\ncase = "paper"\nsignal = "drive_torque"\nreason = "r"\nbound = 0.0': (
        "known[0].bound = 0.0: input should be greater than 0"
    ),
    '[[known]]\ncase = "p"\nsignal = "s"\nreason = "r"\nbound = 1.0\nmotion = "quick"': (
        "known[0].motion[0] = 'quick': input should be"
    ),
    '[[known]]\ncase = "p"\nsignal = "s"\nreason = "r"\nbound = 1.0\nsimulator = "mujcoo"': (
        "known[0].simulator = 'mujcoo': there is no such"
    ),
    "rest = -1.0": "rest = -1.0: input should be greater than or equal to 0",
}


@pytest.mark.parametrize("text", FAULTY)
def test_a_faulty_tolerance_file_is_refused_with_its_field(text: str, tmp_path: Path) -> None:
    with pytest.raises(ToleranceError) as caught:
        overlay(tmp_path, text)
    assert f"--tolerance {tmp_path / 'mine.toml'}: " in str(caught.value)
    assert FAULTY[text] in str(caught.value)


def test_a_file_saved_by_a_windows_editor_is_read(tmp_path: Path) -> None:
    assert overlay(tmp_path, "\ufeffnoise = 1e-6\nrest = 2e-5\n") == TOLERANCES.model_copy(
        update={"noise": 1e-6, "rest": 2e-5}
    )


def test_a_missing_tolerance_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ToleranceError, match=r"none\.toml: cannot be read"):
        load_tolerances(tmp_path / "none.toml")


# -------------------------------------------------------------------- reactions


def test_a_direction_is_judged_by_its_error_in_newtons() -> None:
    size = np.where(np.arange(51) == 20, 5.0, 70.0)
    off = np.where(np.arange(51) == 20, np.radians(0.1), 0.0)  # ten times the tolerance, at a fourteenth of the force
    weak = judge(
        rule("reaction_B_angle"),
        SIDE | {"reaction_B_angle": ANGLE + off},
        SIDE | {"reaction_B_magnitude": size},
    )
    strong = judge(
        rule("reaction_B_angle"),
        SIDE | {"reaction_B_angle": ANGLE + np.roll(off, 1)},
        SIDE | {"reaction_B_magnitude": size},
    )
    assert weak is not None
    assert strong is not None
    assert (weak.verdict, strong.verdict) == ("agrees", "disagrees")
    assert weak.tolerance == pytest.approx(1.75e-4 * 14)


def test_rounding_around_zero_is_no_disagreement() -> None:
    nothing = {"drive_torque": np.zeros(51), "reaction_B_magnitude": SIZE}
    found = judge(rule("drive_torque"), {"drive_torque": np.full(51, 1e-13)}, nothing)
    assert found is not None
    assert found.verdict == "agrees"


@pytest.mark.parametrize(
    ("case", "clearance"), [("paper", {"B": 1e-3}), ("crank-rocker", {}), ("slider-crank", {"B": 1e-4})]
)
def test_what_is_allowed_at_an_angle_does_not_depend_on_which_others_are_asked_for(
    case: str, clearance: dict[str, float]
) -> None:
    mechanism = load(case)
    assembly = Assembly(mechanism)
    theta = np.radians([25.0, 63.0, 97.0, 140.0])

    def allowed(angles: np.ndarray) -> dict[str, np.ndarray]:
        side = reference(assembly, Schedule.at_angles(mechanism, angles, at_rest=True), "equilibrium", clearance)
        scales = Scales.of(side.signals, mechanism, side.peaks)
        joint_model: JointModel = "contact" if clearance else "ideal"
        return {
            s.name: Rule.read(TOLERANCES, "static", joint_model, s, scales, 0.0, 1e-4).tolerance(side.signals)
            for s in compared(mechanism, clearance)
        }

    together = allowed(theta)
    for i in range(theta.size):
        for name, tolerance in allowed(theta[i : i + 1]).items():
            np.testing.assert_allclose(tolerance, together[name][i : i + 1], rtol=1e-9, err_msg=name)


def test_at_the_usual_angles_the_peaks_are_the_runs() -> None:
    mechanism = load("crank-rocker")
    assembly = Assembly(mechanism)
    theta = usual_angles(assembly)
    side = reference(assembly, Schedule.at_angles(mechanism, theta), "equilibrium", {})
    assert Scales.of(side.signals, mechanism, side.peaks).force == Scales.of(side.signals, mechanism).force
    assert side.peaks["reaction_B_magnitude"] == side.signals["reaction_B_magnitude"].max()

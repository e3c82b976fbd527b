"""The paper's equations as printed against their corrected twins: what each erratum does, and where it cannot
be seen.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import kinematics
from analytic.mechanism import Load
from analytic.mechanism.file import dumps, load, loads
from analytic.paper import printed
from analytic.paper.compliance import compliance
from analytic.paper.frame import ComplianceError, ElasticBar, beam_stiffness
from analytic.paper.kinetostatics import kinetostatics
from analytic.paper.printed import FourBar, FourBarMotion, four_bar_motion

BAR = ElasticBar(length=0.2, height=0.01, depth=0.02, youngs_modulus=2e11, shear_modulus=0.8e11)
SPEED = np.pi / 2  # rad/s, 15 rpm
AT_JOINT = {"F_12": "D", "F_23": "A", "F_34": "B", "F_14": "E"}


def four_bar(ground: float, length: tuple[float, float, float], mass: tuple[float, float, float]) -> FourBar:
    inertia = tuple(printed.moment_of_inertia(m, r, 0.01) for m, r in zip(mass, length, strict=True))
    return FourBar(ground, length, tuple(r / 2 for r in length), mass, inertia)


PAPER = four_bar(0.4, (0.2, 0.4, 0.2), (0.157, 0.314, 0.157))
CRANK_ROCKER = four_bar(0.12, (0.05, 0.12, 0.10), (0.03925, 0.0942, 0.0785))


def with_printed_inertia(bar: FourBar) -> FourBar:
    return replace(bar, inertia=tuple(printed.printed_moment_of_inertia(m, 0.01, 0.01) for m in bar.mass))


def moving(bar: FourBar, degrees: np.ndarray | list[float], speed: float = SPEED) -> FourBarMotion:
    return four_bar_motion(bar, np.radians(np.asarray(degrees, float)), speed)


# ---------------------------------------------------------------- Eqs. 2, 3


def rigid_rotation(length: float) -> np.ndarray:
    motion = np.zeros(12)
    motion[[5, 11]], motion[7] = 1.0, length
    return motion


def test_eq2_printed_makes_force_of_a_rigid_rotation_and_none_of_a_uniform_turn() -> None:
    wrong, right = printed.printed_beam_stiffness(BAR), beam_stiffness(BAR)
    rotation, turn = rigid_rotation(BAR.length), np.eye(12)[5] + np.eye(12)[11]
    spurious = 12 * BAR.youngs_modulus * BAR.i_z / BAR.length**2  # N per radian, on the second end
    assert (wrong @ rotation)[7] == pytest.approx(spurious, rel=1e-12)
    assert np.abs(right @ rotation).max() < 1e-12 * spurious
    assert np.array_equal(wrong @ turn, np.zeros(12))
    assert (right @ turn)[1] == pytest.approx(spurious, rel=1e-12)  # 2 x 6EI/L^2: a real beam is bent to an S


def test_eq2_printed_hides_from_the_rank_and_from_a_cantilevers_tip_deflection() -> None:
    wrong, right = printed.printed_beam_stiffness(BAR), beam_stiffness(BAR)
    ranks = [np.linalg.matrix_rank(k, tol=1e-9 * np.abs(k).max()) for k in (wrong, right)]
    assert ranks == [6, 6]
    tips = [np.linalg.solve(k[6:, 6:], [0, 1.0, 0, 0, 0, 0]) for k in (wrong, right)]
    assert tips[0][1] == pytest.approx(BAR.length**3 / (3 * BAR.youngs_modulus * BAR.i_z), rel=1e-12)
    assert tips[1][1] == pytest.approx(tips[0][1], rel=1e-12)
    assert tips[1][5] == pytest.approx(-tips[0][5], rel=1e-12)  # but the tip turns the wrong way
    np.testing.assert_allclose(
        printed.printed_beam_block(BAR), right[:6, :6], rtol=1e-14, atol=0
    )  # Eq. 3 itself is right


def test_eq2_printed_leaves_the_papers_four_bar_singular_with_free_pins() -> None:
    motion = kinematics(Assembly(load("paper")), np.radians([30.0]))
    with pytest.raises(ComplianceError, match="paper: nothing holds the linkage in place at crank angle 30 deg"):
        compliance(motion, beam=printed.printed_beam_stiffness)
    assert compliance(motion).displacement("coupler")[0].imag == pytest.approx(1.001376e-3, abs=1e-9)


def test_eq2_printed_is_wrong_where_springs_at_the_pins_make_it_solvable() -> None:
    mechanism = load("paper")
    for joint, angle in (("A", -np.pi / 6), ("B", np.pi / 6), ("E", np.pi / 6)):
        mechanism = mechanism.with_joint(joint, stiffness=1.0, rest_angle=angle)  # N.m/rad, slack at 30 deg
    motion = kinematics(Assembly(mechanism), np.radians([30.0]))
    right, wrong = (
        compliance(motion, beam=k).displacement("coupler")[0] for k in (beam_stiffness, printed.printed_beam_stiffness)
    )
    assert right.imag == pytest.approx(1.001e-3, rel=0.02)  # weak springs hardly change the right one
    assert abs(wrong - right) > 0.1 * abs(right)


# ---------------------------------------------------------------- Eqs. 8-12, 14


def test_paper_section4_displacement_of_eq8() -> None:
    moved = printed.clearance_displacement(0.01, np.radians(30.0))
    assert (round(moved.real, 4), round(moved.imag, 4)) == (0.0087, 0.0050)


def test_paper_section4_figure_of_eq8_at_30_deg_beside_the_equilibrium() -> None:
    x, y = printed.printed_figures(load("paper"))
    assert (x.signal.name, y.signal.name) == ("clearance_B_x", "clearance_B_y")
    assert (x.source, y.source) == ("Eq. 8", "Eq. 8")
    assert (x.printed, y.printed) == (0.0087, 0.005)
    assert np.degrees([x.crank_angle, y.crank_angle]) == pytest.approx([30.0, 30.0])
    for figure in (x, y):
        assert round(figure.first_order, 4) == figure.printed
        assert abs(figure.equilibrium - figure.printed) > 4e-4  # m: the paper's directions are the ideal linkage's
    assert (round(x.equilibrium, 4), round(y.equilibrium, 4)) == (0.0082, 0.0057)


def test_the_paper_figure_is_offered_for_the_papers_case_alone() -> None:
    own = load("paper")
    assert printed.printed_figures(loads(dumps(own)))
    assert printed.printed_figures(own.with_clearances({"B": 0.01}))
    for other in (
        own.with_clearances({"B": 1e-3}),
        own.with_clearances({}),
        own.with_body("crank", mass=0.2),
        load("crank-rocker"),
    ):
        assert printed.printed_figures(other) == ()


@pytest.mark.parametrize(
    ("degrees", "force", "magnitude", "torque"),
    [
        (20, 68.7597 + 25.0265j, 73.1726, -9.3969),
        (30, 43.3684 + 25.0387j, 50.0775, -8.6603),
        (60, 14.4725 + 25.0671j, 28.9450, -5.0000),
        (90, 0.0000 + 25.0775j, 25.0775, 0.0000),
        (120, -14.4725 + 25.0671j, 28.9450, 5.0000),
        (160, -68.7597 + 25.0265j, 73.1726, 9.3969),
    ],
)
def test_paper_notes_table_of_kinetostatic_reactions(
    degrees: float, force: complex, magnitude: float, torque: float
) -> None:
    found = printed.reactions(PAPER, moving(PAPER, [degrees]), 50.0)
    digits = 0.5001e-4
    assert abs(found["F_34"][0].real - force.real) < digits
    assert abs(found["F_34"][0].imag - force.imag) < digits
    assert abs(abs(found["F_34"][0]) - magnitude) < digits
    assert abs(np.degrees(np.angle(found["F_34"][0])) - degrees) < digits
    assert abs(found["T_s"][0] - torque) < digits


@pytest.mark.parametrize(("name", "bar"), [("paper", PAPER), ("crank-rocker", CRANK_ROCKER)])
def test_corrected_eq11_is_the_general_kinetostatics(name: str, bar: FourBar) -> None:
    speed, degrees = 40.0, np.arange(20.0, 161.0, 7.0)
    mechanism = load(name).replace(loads=(Load(body="coupler", force=(0.0, 50.0)), Load(body="follower", torque=0.7)))
    general = kinetostatics(kinematics(Assembly(mechanism), np.radians(degrees), speed))
    found = printed.reactions(bar, moving(bar, degrees, speed), 50.0, 0.7)
    for force, joint in AT_JOINT.items():
        np.testing.assert_allclose(found[force], general.forces[joint], rtol=0, atol=1e-11)
    np.testing.assert_allclose(found["T_s"], general.drive_torque, rtol=0, atol=1e-12)


def test_every_row_of_eq11_is_the_one_printed() -> None:
    """The matrix against the nine right-hand sides spelt out as the paper prints them."""
    bar, theta = CRANK_ROCKER, np.array([0.3, 1.1, 2.2])
    x = np.random.default_rng(11).normal(size=9)
    f12x, f12y, f23x, f23y, f34x, f34y, f14x, f14y, ts = x
    (r2, r3, r4), (g2, g3, g4), (s2, s3, s4), (c2, c3, c4) = bar.length, bar.com, np.sin(theta), np.cos(theta)
    right = [
        -f12x + f23x,
        -f12y + f23y,
        -f12x * g2 * s2 + f12y * g2 * c2 - ts - f23x * (r2 - g2) * s2 + f23y * (r2 - g2) * c2,
        -f23x + f34x,
        -f23y + f34y,
        -f23x * g3 * s3 + f23y * g3 * c3 - f34x * (r3 - g3) * s3 + f34y * (r3 - g3) * c3,
        -f34x - f14x,
        -f34y - f14y,
        f34x * (r4 - g4) * s4 - f34y * (r4 - g4) * c4 - f14x * g4 * s4 + f14y * g4 * c4,
    ]
    np.testing.assert_allclose(printed.kinetostatic_matrix(bar, theta[:, None])[0] @ x, right, rtol=0, atol=1e-15)


def turn(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.degrees(np.abs(np.angle(a / b)))


def test_eq11_printed_turns_the_reactions_of_crank_and_coupler_by_tens_of_degrees() -> None:
    motion = moving(PAPER, [20, 30, 60, 90, 120, 160])
    wrong, right = printed.printed_reactions(PAPER, motion, 50.0), printed.reactions(PAPER, motion, 50.0)
    for force in ("F_12", "F_23"):
        assert turn(wrong[force], right[force]).min() > 19.0
        assert turn(wrong[force], right[force]).max() > 150.0
    assert np.abs(wrong["T_s"] - right["T_s"]).min() > 3.0


def test_eq11_printed_cannot_turn_a_two_force_follower_but_takes_its_load_away() -> None:
    motion = moving(PAPER, [20, 30, 60, 90, 120, 160])
    wrong, right = printed.printed_reactions(PAPER, motion, 50.0), printed.reactions(PAPER, motion, 50.0)
    unloaded = printed.reactions(PAPER, motion, 0.0)
    for force in ("F_34", "F_14"):
        assert turn(wrong[force], right[force]).max() < 1e-6  # so that gamma = 30 deg is no evidence for Eq. 11
    np.testing.assert_allclose(wrong["F_34"], unloaded["F_34"], rtol=0, atol=1e-12)
    assert np.abs(wrong["F_34"]).max() < 0.1 < 25.0 < np.abs(right["F_34"]).min()


def test_eq11_printed_turns_gamma_in_a_crank_rocker() -> None:
    motion = moving(CRANK_ROCKER, np.arange(0.0, 360.0, 5.0), 10 * np.pi)
    wrong, right = printed.printed_reactions(CRANK_ROCKER, motion, 50.0), printed.reactions(CRANK_ROCKER, motion, 50.0)
    assert turn(wrong["F_34"], right["F_34"]).max() > 90.0


# ---------------------------------------------------------------- Eq. 13


def test_eq13_printed_is_two_hundred_times_too_small() -> None:
    ratio = printed.moment_of_inertia(0.157, 0.2, 0.01) / printed.printed_moment_of_inertia(0.157, 0.01, 0.01)
    assert ratio == pytest.approx((0.2**2 + 0.01**2) / (2 * 0.01**2), rel=1e-12)
    assert ratio == pytest.approx(200.5)
    body = load("paper").bodies[0]
    assert body.moment_of_inertia == pytest.approx(printed.moment_of_inertia(body.mass, 0.2, 0.01), rel=1e-12)


def test_eq13_cannot_be_seen_in_the_papers_case_but_in_a_crank_rocker() -> None:
    def difference(bar: FourBar, speed: float) -> float:
        motion = moving(bar, np.arange(20.0, 161.0, 5.0), speed)
        wrong, right = (printed.reactions(b, motion, 0.0)["F_34"] for b in (with_printed_inertia(bar), bar))
        return float(np.abs(wrong - right).max() / np.abs(right).max())

    assert difference(PAPER, 10 * np.pi) < 1e-12
    assert difference(CRANK_ROCKER, 10 * np.pi) > 0.1


# ---------------------------------------------------------------- where there is no answer


@pytest.mark.parametrize("degrees", [0.0, 180.0])
def test_change_points_of_the_parallelogram_are_refused(degrees: float) -> None:
    with pytest.raises(ValueError, match=f"crank angle {degrees:g} deg is a change point"):
        moving(PAPER, [degrees])


def test_angle_out_of_reach_is_refused() -> None:
    with pytest.raises(ValueError, match="crank angle 120 deg cannot be reached"):
        moving(four_bar(0.3, (0.2, 0.1, 0.1), (1.0, 1.0, 1.0)), [120.0])

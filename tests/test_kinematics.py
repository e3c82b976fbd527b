"""Positions by continuation, exact rates, and honest refusals."""

from __future__ import annotations

import numpy as np
import pytest

from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.motion import Gap, kinematics
from analytic.mechanism import Mechanism
from analytic.mechanism.file import load
from linkages import dyad_on_a_triad, inverted_slider, scotch_yoke, six_bar_driven_from_the_rocker

FULL_TURN = np.linspace(-4.0, 9.0, 157)
LINKAGES = {
    "crank-rocker": (load("crank-rocker"), FULL_TURN),
    "six-bar": (load("six-bar"), FULL_TURN),
    "slider-crank": (load("slider-crank"), FULL_TURN),
    "paper": (load("paper"), np.radians(np.arange(5.0, 176.0, 3.0))),
    "inverted slider": (inverted_slider(), FULL_TURN),
    "scotch yoke": (scotch_yoke(), FULL_TURN),
    "six-bar driven from the rocker": (six_bar_driven_from_the_rocker(), np.linspace(1.7, 2.8, 23)),
    "dyad on a triad": (dyad_on_a_triad(), np.linspace(-0.2, 0.75, 20)),
}
each_linkage = pytest.mark.parametrize(("mechanism", "theta"), LINKAGES.values(), ids=LINKAGES)


@each_linkage
def test_every_joint_stays_together(mechanism: Mechanism, theta: np.ndarray) -> None:
    motion = kinematics(Assembly(mechanism), theta)
    for joint in mechanism.joints:
        first, second = joint.bodies
        apart = motion.position(second, joint.name) - motion.position(first, joint.name)
        if joint.prismatic:
            travel = motion.relative(joint)
            axis = joint.direction * np.exp(1j * motion.angle(first))
            np.testing.assert_allclose(apart, travel * axis, atol=1e-14)
            np.testing.assert_allclose(motion.angle(second) - motion.angle(first), joint.angle, atol=1e-12)
        else:
            np.testing.assert_allclose(apart, 0, atol=1e-14)


@each_linkage
def test_velocities_and_accelerations_are_the_derivatives_of_positions(mechanism: Mechanism, theta: np.ndarray) -> None:
    assembly, omega, alpha, h = Assembly(mechanism), 3.0, -7.0, 2e-4
    motion = kinematics(assembly, theta, omega, alpha)

    def after(t: float):
        return kinematics(assembly, theta + omega * t + alpha * t * t / 2, omega + alpha * t, alpha)

    sides = {k: after(k * h) for k in (-2, -1, 1, 2)}

    def slope(what):
        return sum(w * what(sides[k]) for k, w in ((-2, 1), (-1, -8), (1, 8), (2, -1))) / (12 * h)

    for body in mechanism.bodies:
        for exact, measured in (
            (motion.velocity(body.name), slope(lambda m, b=body.name: m.position(b))),
            (motion.acceleration(body.name), slope(lambda m, b=body.name: m.velocity(b))),
            (motion.angular_velocity(body.name), slope(lambda m, b=body.name: m.angle(b))),
            (motion.angular_acceleration(body.name), slope(lambda m, b=body.name: m.angular_velocity(b))),
        ):
            np.testing.assert_allclose(measured, exact, atol=2e-9 * max(1.0, np.abs(exact).max()))


def test_gaps_displace_the_linkage_and_their_rates_enter_its_velocities() -> None:
    assembly, theta, h = Assembly(load("crank-rocker")), np.linspace(0.1, 6.0, 41), 1e-4

    def at(t: float):
        direction = np.exp(1j * (theta + 5 * t))
        gap = Gap(1e-3 * direction, 5e-3j * direction, -25e-3 * direction)
        return kinematics(assembly, theta + 2 * t, 2.0, 0.0, {"B": gap, "D": gap})

    now, before, later = at(0.0), at(-h), at(h)
    apart = now.position("coupler", "B") - now.position("follower", "B")
    np.testing.assert_allclose(apart, 1e-3 * np.exp(1j * theta), atol=1e-15)
    np.testing.assert_allclose(
        (later.position("coupler") - before.position("coupler")) / (2 * h), now.velocity("coupler"), atol=1e-7
    )
    np.testing.assert_allclose(
        (later.velocity("coupler") - before.velocity("coupler")) / (2 * h), now.acceleration("coupler"), atol=1e-6
    )


def test_the_scotch_yoke_moves_as_a_cosine() -> None:
    motion = kinematics(Assembly(scotch_yoke()), FULL_TURN, 10.0)
    np.testing.assert_allclose(motion.position("yoke"), 0.05 * np.cos(FULL_TURN), atol=1e-15)
    np.testing.assert_allclose(motion.acceleration("yoke"), -5.0 * np.cos(FULL_TURN), atol=1e-12)


def test_the_slider_crank_reaches_flores_peak_acceleration() -> None:
    m = load("slider-crank")
    peak = np.abs(kinematics(Assembly(m), np.zeros(1), m.speed or 0.0).acceleration("slider"))[0]
    assert peak == pytest.approx(19419, abs=0.5)
    assert 0.14 * peak == pytest.approx(2718.7, abs=0.05)


def test_angles_are_continued_over_turns() -> None:
    motion = kinematics(
        Assembly(load("paper").replace(assembly={"crank": -1.0, "coupler": 0.0, "follower": -1.0})),
        np.linspace(-3.0, -0.2, 30),
    )
    np.testing.assert_allclose(motion.angle("follower"), motion.theta, atol=1e-12)


def test_closed_form_and_newton_agree_on_the_same_six_bar() -> None:
    forward, backward = Assembly(load("six-bar")), Assembly(six_bar_driven_from_the_rocker())
    crank = np.linspace(0.0, 0.6, 13)
    rocker = kinematics(forward, crank).angle("rocker")
    np.testing.assert_allclose(kinematics(backward, rocker).angle("crank"), crank, atol=1e-10)


@pytest.mark.parametrize(("low", "high", "where"), [(20, 181, "180"), (0, 90, "0"), (-30, 60, "0"), (30, 340, "180")])
def test_a_change_point_in_the_range_is_an_error_that_names_it(low: float, high: float, where: str) -> None:
    with pytest.raises(AssemblyError, match=rf"change point at crank angle -?{where}\b"):
        kinematics(Assembly(load("paper")), np.radians([low, high]))


def test_a_change_point_between_two_grid_angles_is_not_stepped_over() -> None:
    with pytest.raises(AssemblyError, match=r"change point at crank angle 180"):
        kinematics(Assembly(load("paper")), np.radians(np.arange(20, 341, 7.0)))


def test_an_unreachable_angle_is_an_error_that_names_it() -> None:
    rocker = load("crank-rocker").with_body("crank", points={"D": (0.0, 0.0), "A": (0.2, 0.0)})
    m = rocker.replace(assembly={"crank": 0.6, "coupler": -0.8, "follower": 0.5})
    with pytest.raises(
        AssemblyError, match=r"cannot be reached: the loop through coupler, follower|change point at crank angle"
    ):
        kinematics(Assembly(m), np.radians([40.0, 170.0]))


def test_no_number_comes_back_at_nan() -> None:
    with pytest.raises(AssemblyError, match="nan is not a number"):
        kinematics(Assembly(load("paper")), np.array([0.5, np.nan]))


def test_a_change_point_within_the_last_step_is_found() -> None:
    with pytest.raises(AssemblyError, match=r"change point at crank angle 180"):
        Assembly(load("paper")).path(0.5, np.radians(180.4962))


def test_a_path_may_be_asked_for_in_either_direction() -> None:
    with pytest.raises(AssemblyError, match=r"change point at crank angle -?0"):
        Assembly(load("paper")).path(0.5, np.radians(-150.0))

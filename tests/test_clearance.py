"""Eq. 8 and its self-consistent completion, each against another road to the same answer."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import kinematics
from analytic.mechanism.file import load
from analytic.paper.clearance import displaced
from analytic.paper.kinetostatics import kinetostatics

SWEEP = np.radians(np.arange(20.0, 161.0, 1.0))
ALL = {"D": 1e-3, "A": 1e-3, "B": 1e-3, "E": 1e-3}


def test_eq_8_prints_what_the_paper_prints() -> None:
    m = load("paper")
    found = displaced(Assembly(m), np.radians([30.0]), m.speed or 0.0, model="first_order")
    signals = found.signals()
    assert f"{signals['clearance_B_x'][0]:.4f} {signals['clearance_B_y'][0]:.4f}" == "0.0087 0.0050"
    assert np.degrees(np.angle(found.reactions.forces["B"][0])) == pytest.approx(30.0, abs=1e-9)


def test_the_equilibrium_at_30_degrees() -> None:
    found = displaced(Assembly(load("paper")), np.radians([30.0]), 1.0, inertia=False)
    force, gap = found.reactions.forces["B"][0], found.gaps["B"][0]
    assert f"{np.degrees(np.angle(force)):.2f} deg, {abs(force):.2f} N" == "34.66 deg, 47.28 N"
    assert f"{gap.real:.5f}, {gap.imag:.5f}" == "0.00823, 0.00569"


@pytest.mark.parametrize(("eps", "angle", "magnitude"), [(1e-2, 7.1, 0.31), (1e-3, 0.78, 0.053), (1e-4, 0.08, 0.0057)])
def test_how_far_eq_8_is_off(eps: float, angle: float, magnitude: float) -> None:
    found = displaced(Assembly(load("paper")), SWEEP, 1.0, inertia=False, clearances={"B": eps})
    force, ideal = found.reactions.forces["B"], found.ideal.forces["B"]
    assert np.degrees(np.abs(np.angle(force / ideal))).max() == pytest.approx(angle, rel=0.02)
    assert np.abs(np.abs(force) / np.abs(ideal) - 1).max() == pytest.approx(magnitude, rel=0.02)


@pytest.mark.parametrize("eps", [1e-2, 1e-3, 1e-4])
def test_the_equilibrium_of_the_papers_case_is_a_four_bar_with_a_longer_follower(eps: float) -> None:
    m = load("paper")
    found = displaced(Assembly(m), SWEEP, 1.0, inertia=False, clearances={"B": eps})
    longer = m.with_clearances({}).with_body(
        "follower", points={"E": (0.0, 0.0), "B": (0.2 + eps, 0.0)}, com=(0.1, 0.0)
    )
    ideal = kinetostatics(kinematics(Assembly(longer), SWEEP, 1.0), inertia=False)
    np.testing.assert_allclose(found.reactions.forces["B"], ideal.forces["B"], rtol=1e-10)
    np.testing.assert_allclose(found.configuration.motion.angle("coupler"), ideal.motion.angle("coupler"), atol=1e-12)


def test_several_gaps_at_once_minimise_the_potential_energy() -> None:
    m = load("paper")
    assembly, theta = Assembly(m), np.radians([40.0])
    found = displaced(assembly, theta, 1.0, inertia=False, clearances=ALL)

    def energy(phi: np.ndarray) -> float:
        gaps = {name: np.array([1e-3 * np.exp(1j * p)]) for name, p in zip(ALL, phi, strict=True)}
        columns = assembly.columns(assembly.coordinates(theta, gaps), gaps)
        return -50.0 * float((assembly.structure.form("coupler") @ columns)[0].imag)

    phi = np.array([np.angle(found.gaps[name][0]) for name in ALL])
    lowest = minimize(energy, phi + 0.3, method="BFGS", options={"gtol": 1e-9})
    np.testing.assert_allclose(np.exp(1j * lowest.x), np.exp(1j * phi), atol=1e-5)
    assert energy(phi) <= lowest.fun + 1e-12


@pytest.mark.parametrize("case", ["paper", "crank-rocker", "six-bar", "slider-crank"])
def test_every_pin_lies_on_its_rim_along_its_own_reaction(case: str) -> None:
    m = load(case)
    sizes = {j.name: 1e-4 for j in m.joints if not j.prismatic}
    theta = np.radians(np.arange(20.0, 161.0, 5.0))
    found = displaced(Assembly(m), theta, m.speed or 0.0, clearances=sizes)
    usable = [i for i in range(theta.size) if i not in found.flags]
    assert len(usable) > theta.size / 2
    for name, size in sizes.items():
        gap, force = found.gaps[name][usable], found.reactions.forces[name][usable]
        np.testing.assert_allclose(np.abs(gap), size, rtol=1e-12)
        np.testing.assert_allclose(np.angle(gap / force), 0, atol=1e-8)


def test_driven_gaps_turn_with_the_crank_consistently() -> None:
    m = load("paper")
    assembly, h = Assembly(m), 0.01
    theta = np.radians(50.0) + h * np.arange(-1, 2)
    found = displaced(assembly, theta, 3.0)
    rate = found.configuration.motion.column_rates[assembly.structure.gap_column("B")][1]
    assert rate == pytest.approx((found.gaps["B"][2] - found.gaps["B"][0]) / (2 * h) * 3.0, rel=1e-3)


def test_a_pin_that_cannot_follow_its_reaction_is_flagged() -> None:
    m = load("crank-rocker")  # no load but inertia: the reaction at B swings round between 60 and 80 deg
    found = displaced(Assembly(m), np.radians(np.arange(0.0, 360.0, 5.0)), 60.0, clearances={"B": 2e-4})
    assert {13, 14, 15, 16} <= set(found.flags)
    assert "too fast" in found.flags[14]
    assert 30 not in found.flags


def test_first_order_is_the_limit_of_small_gaps() -> None:
    assembly = Assembly(load("paper"))
    apart = []
    for eps in (1e-4, 1e-5):
        full, first = (
            displaced(assembly, SWEEP, 1.0, model=k, inertia=False, clearances={"B": eps})
            for k in ("equilibrium", "first_order")
        )
        apart.append(np.abs(full.gaps["B"] - first.gaps["B"]).max() / eps)
    assert apart[0] / apart[1] == pytest.approx(10.0, rel=0.01)


def test_a_reaction_that_passes_zero_is_flagged_not_extrapolated() -> None:
    m = load("paper").replace(loads=[{"body": "coupler", "point": "com", "force": (50.0, 0.0)}])
    theta = np.radians([60.0, 90.0, 120.0])
    level = m.replace(loads=())
    found = displaced(Assembly(level), theta, 1.0, inertia=False, clearances={"B": 1e-3})
    assert set(found.flags) == {0, 1, 2}  # no load, no reaction, no direction
    assert "near zero" in found.flags[0]
    assert np.isnan(found.signals()["clearance_B_x"]).all()
    tilted = m.replace(loads=[{"body": "follower", "torque": 5.0}], gravity=(0.0, -9.81))
    sweep = np.radians(np.arange(20.0, 161.0, 1.0))
    ideal = np.abs(displaced(Assembly(tilted), sweep, 1.0, inertia=False, clearances={"B": 1e-3}).ideal.forces["B"])
    flags = displaced(Assembly(tilted), sweep, 1.0, inertia=False, clearances={"B": 1e-3}).flags
    assert set(np.flatnonzero(ideal <= 0.01 * ideal.max())) <= set(flags)


def test_without_clearance_the_answer_is_the_ideal_linkage() -> None:
    found = displaced(Assembly(load("crank-rocker")), SWEEP, 3.0)
    assert found.gaps == {}
    assert np.array_equal(found.reactions.drive_torque, found.ideal.drive_torque)


@pytest.mark.long_rows("paper")
@pytest.mark.parametrize("case", ["paper", "crank-rocker", "slider-crank"])
def test_an_angle_is_flagged_or_not_whatever_other_angles_are_asked_for(case: str) -> None:
    m = load(case)
    if (
        case == "paper"
    ):  # the follower's own load, which B carries less and less of up to 90 deg, and then from the other side
        m = m.replace(loads=[{"body": "follower", "force": (0.0, 50.0)}])
    assembly, sizes = Assembly(m), {"B": 1e-4}
    theta = np.radians([20.0, 60.0, 70.0, 89.0, 89.8, 90.0, 90.2, 91.0, 120.0, 160.0])
    found = displaced(assembly, theta, m.speed or 1.0, inertia=case != "paper", clearances=sizes)
    assert {i for i, why in found.flags.items() if "near zero" in why} == (
        {3, 4, 5, 6, 7} if case == "paper" else set()
    )
    for i in range(theta.size):
        for some in (theta[i : i + 1], theta[max(i - 1, 0) : i + 1], theta[i:]):
            flags = displaced(assembly, some, m.speed or 1.0, inertia=case != "paper", clearances=sizes).flags
            assert flags.get(int(np.flatnonzero(some == theta[i])[0])) == found.flags.get(i)


def test_a_joint_that_carries_nothing_has_no_direction_though_rounding_gives_it_one() -> None:
    nothing = [{"body": "coupler", "force": (0.0, force)} for force in (0.1, 0.2, -0.3)]  # 5.6e-17 N
    m = load("six-bar").replace(loads=[*nothing, {"body": "crank", "force": (30.0, 50.0)}], gravity=(0.0, 0.0))
    found = displaced(Assembly(m), np.radians([40.0, 90.0]), 1.0, inertia=False, clearances={"B": 1e-4})
    assert 0 < abs(found.ideal.forces["B"][0]) < 1e-15
    assert set(found.flags) == {0, 1}

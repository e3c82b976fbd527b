"""Where contact is first lost, by the analytic model: closed forms of a pin on its rim, and an independent ODE of the
whole linkage with event location.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
import pytest

from analytic.mechanism import Mechanism
from analytic.mechanism.file import load
from compare.domain_map.leaving import Reaction, boundary, contact_law, leaving, reaction
from compare.domain_map.pin_motion import CrankWay
from marks import slow
from sim_models.common.contact_laws import NamedLaw
from tests.evidence.contact_ode import loop_of, pressed, simulate

RPM = math.pi / 30
MASS, FORCE, SPEED = 0.05, 3.0, 20.0  # kg, N, rad/s
THETA = np.radians(np.arange(0.0, 360.0, 5.0))
STIFF = NamedLaw("kelvin-voigt", 1e9, 1e3, 0.0, math.inf, math.nan)


def pushed(force: np.ndarray, time: np.ndarray) -> Reaction:
    """A mass at the pin's end that a force (n,) N pushes at times (n,) s, evenly apart; the crank turns with them."""
    terms = np.zeros((7, time.size), complex)
    terms[0], terms[5], terms[6] = force, -MASS, -1j * MASS  # F = F0 - m g''
    theta = SPEED * time
    way = CrankWay(
        terms, float(theta[0]), float(theta[1] - theta[0]), float(theta[0]), float(theta[-1] - theta[0]), SPEED
    )
    return Reaction(way)


# ---------------------------------------------------------------- closed forms


@pytest.mark.slow
@pytest.mark.parametrize("law", [None, STIFF], ids=["rigid", "yielding"])
def test_a_pin_follows_a_reaction_that_turns_evenly_however_fast(law: NamedLaw | None) -> None:
    """Its own motion presses it the harder: N = F + m c w^2."""
    time = np.linspace(0.0, 1.0, 20001)
    for turning in (3.0, 300.0):
        assert pushed(FORCE * np.exp(1j * turning * time), time).leaves(1e-4, law) is None


@pytest.mark.parametrize("law", [None, STIFF], ids=["rigid", "yielding"])
def test_a_pin_leaves_where_its_reaction_reverses(law: NamedLaw | None) -> None:
    time = np.linspace(-0.05, 0.05, 20001)
    left = pushed(FORCE * time / 0.05 + 0j, time).leaves(1e-4, law)
    assert left == pytest.approx(0.0, abs=5e-3)  # rad, a step at most


def test_a_pin_leaves_where_its_reaction_turns_faster_than_5_57_of_its_swing() -> None:
    """A reaction that passes by zero, a + i b t, acts by one number; its bound is of scipy's DOP853: 5.5699."""
    clearance, rate = 1e-4, 400.0
    for ratio, stays in ((5.5, True), (5.64, False)):
        nearest = (rate**2 * MASS * clearance / ratio**2) ** (1 / 3)  # (b / a) / sqrt(a / (m c)) is the ratio
        unit = (MASS * clearance / rate) ** (1 / 3)  # s
        time = np.linspace(-60 * unit, 60 * unit, 40001)
        left = pushed(nearest + 1j * rate * time, time).leaves(clearance)
        assert (left is None) == stays, ratio


# ---------------------------------------------------------------- the linkage's own motion


def working(rpm: float) -> Mechanism:
    """The crank-rocker whose follower turns against a torque of 2 N.m."""
    return at(load("crank-rocker").replace(loads=[{"body": "follower", "torque": -2.0}]), rpm)


def at(mechanism: Mechanism, rpm: float) -> Mechanism:
    """It, that fast."""
    return mechanism.replace(drive=mechanism.drive.model_copy(update={"speed": rpm * RPM}))


def first_lost(mechanism: Mechanism, clearance: float) -> float | None:
    """Crank angle (rad, from 0) at which B first leaves in two turns of the independent ODE; None: it stays."""
    one = mechanism.with_clearances({"B": clearance})
    loop = loop_of(one)
    found = simulate(one, loop, pressed(one, loop), 4 * math.pi, most=2000)
    left = found.impacts.left[np.isfinite(found.impacts.left)]
    return float(loop.theta + loop.speed * left[0]) if left.size else None


def held(mechanism: Mechanism, stiffness: float, clearances: Iterable[float], rigid: bool) -> list[float | None]:
    """For each clearance (m) where both, ODE and prediction, lose contact; they must agree about it, and to 1 deg.

    That is by the first order in the gap, 1 % of the links at the most.
    """
    one = mechanism.with_joint("B", contact_stiffness=stiffness, restitution=0.5, contact_law="kelvin-voigt")
    way, found = reaction(one.with_clearances({"B": 1e-4}), "B", THETA), []
    for clearance in clearances:
        lost = first_lost(one, clearance)
        said = way.leaves(clearance, None if rigid else contact_law(one, "B"))
        assert (said is None) == (lost is None), clearance
        if said is not None and lost is not None:  # the prediction counts from a turn before the first angle
            assert said + 2 * math.pi == pytest.approx(lost, abs=math.radians(1.0)), clearance
        found.append(lost)
    return found


@pytest.mark.parametrize("clearances", [(1e-4, 2.15e-4), *slow(((3e-5, 4.64e-4),))])
def test_contact_of_the_slider_crank_is_first_lost_where_the_reaction_says(clearances: tuple[float, float]) -> None:
    """At 5000 rpm on walls of 1e8 N/m, which give by a tenth of these clearances."""
    found = held(at(load("slider-crank"), 5000.0), 1e8, clearances, rigid=False)
    assert [lost is None for lost in found] == [True, False]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mechanism", "stiffness"),
    [
        *((working(rpm), k) for rpm in (600.0, 900.0, 1200.0, 2400.0) for k in (1e7, 1e8)),
        *((at(load("slider-crank"), 5000.0), k) for k in (1e7, 1e8)),
    ],
    ids=lambda value: f"{value:g}" if isinstance(value, float) else f"{value.name} {value.speed / RPM:.0f} rpm",
)
def test_contact_is_first_lost_where_the_reaction_says(mechanism: Mechanism, stiffness: float) -> None:
    held(mechanism, stiffness, np.geomspace(1e-6, 1e-3, 10), rigid=False)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mechanism", "stiffness"), [(at(load("slider-crank"), 5000.0), 3e10), (working(1200.0), 1e10)], ids=["slider", "4"]
)
def test_contact_with_walls_that_hardly_yield_is_first_lost_where_the_rim_says(
    mechanism: Mechanism, stiffness: float
) -> None:
    found = held(mechanism, stiffness, (2e-6, 3e-5, 1e-4, 2e-4, 5e-4), rigid=True)
    assert any(found)
    assert None in found


def test_without_load_the_boundary_between_rigid_walls_is_of_the_clearance_alone() -> None:
    edges = []
    for rpm in (500.0, 5000.0):
        linkage = at(load("slider-crank"), rpm).with_clearances({"B": 1e-4})
        edges.append(boundary(linkage, THETA, (2e-5, 1e-4), (False, True), rigid=True))
    assert edges[0] == pytest.approx(edges[1], rel=1e-6)


def test_a_load_keeps_a_slow_linkages_pins_on_their_walls() -> None:
    slow, fast = (leaving(working(rpm).with_clearances({"B": 2e-4}), THETA) for rpm in (300.0, 900.0))
    assert slow is not None
    assert fast is not None
    assert (slow.rigid, slow.yielding) == (None, None)
    assert fast.rigid is not None
    assert fast.yielding is not None


def test_the_crank_turns_either_way() -> None:
    backwards = leaving(at(working(300.0), -900.0).with_clearances({"B": 5e-4}), THETA)
    assert backwards is not None
    assert backwards.rigid is not None
    assert -2 * math.pi < backwards.rigid < 2 * math.pi


def test_a_crank_that_does_not_turn_fully_is_followed_along_its_way() -> None:
    found = leaving(load("paper").with_clearances({"B": 1e-4}), np.radians(np.arange(20.0, 165.0, 5.0)))
    assert found is not None
    assert (found.rigid, found.yielding) == (None, None)

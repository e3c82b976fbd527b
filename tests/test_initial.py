"""Initial velocities of what runs free: a thrown pendulum, a mass that slides on, two bars, a bob on a driven cart."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipk

import linkage_crosscheck as lc
from analytic.errors import Error
from analytic.kinematics.assembly import Assembly
from analytic.kinematics.initial import set_off
from analytic.kinematics.schedule import Schedule
from analytic.mechanism import Mechanism
from analytic.mechanism.file import dumps, load, loads
from asked import request_of
from measured_files import csv_text
from sim_models.engine import ENGINES, Unsupported, declared

G = 9.81  # m/s2
TIMES = np.linspace(0.0, 0.5, 11)
DEAR = [pytest.mark.slow]  # by steps of an engine that is slow
SIDES = [
    "analytic",
    *(pytest.param(n, marks=[getattr(pytest.mark, n), *DEAR * (n in ("pybullet", "dart"))]) for n in ENGINES),
]
# rad, or m, after half a second: the engines integrate to what their free runs without a throw are held to
ACCURACY = {"analytic": 1e-8, "mujoco": 1e-8, "exudyn": 3e-6, "pybullet": 3e-6, "dart": 3e-6}

HANGING = load("pendulum").replace(assembly={"pendulum": -math.pi / 2})
NATURAL = math.sqrt(3 * G / (2 * 0.3) / (1 + (0.01 / 0.3) ** 2 / 4))  # rad/s: a bar of 0.3 m, 10 mm high, on its end
SLIDING = """
name = "mass"
ground = { points = { S = [0.0, 0.0] } }
body = [{ name = "mass", points = { S = [0.0, 0.0] }, mass = 2.0, inertia = 0.01 }]
joint = [{ name = "S", type = "prismatic", bodies = ["ground", "mass"], axis = [1.0, 0.0], damping = 3.0 }]
drive = { joint = "S", speed = "free" }
initial = { velocity_S = "500 mm/s" }
"""
TWO_BARS = """
name = "two bars"
gravity = [0.0, -9.81]
ground = { points = { A = [0.0, 0.0] } }
body = [
  { name = "upper", points = { A = [0.0, 0.0], B = [0.3, 0.0] }, mass = 1.2, inertia = 0.012 },
  { name = "lower", points = { B = [0.0, 0.0], tip = [0.25, 0.0] }, mass = 0.7, com = [0.1, 0.0], inertia = 0.004 },
]
joint = [
  { name = "A", type = "revolute", bodies = ["ground", "upper"] },
  { name = "B", type = "revolute", bodies = ["upper", "lower"] },
]
assembly = { upper = -1.2, lower = -0.9 }
initial = { velocity_A = 7.0, velocity_B = -11.0 }
"""
CART = """
name = "cart"
gravity = [0.0, -9.81]
ground = { points = { S = [0.0, 0.0] } }
body = [
  { name = "cart", points = { S = [0.0, 0.0], P = [0.0, 0.0] }, mass = 2.0, inertia = 0.01 },
  { name = "bob", points = { P = [0.0, 0.0], tip = [0.3, 0.0] }, mass = 0.6, com = [0.2, 0.0], inertia = 0.003 },
]
joint = [
  { name = "S", type = "prismatic", bodies = ["ground", "cart"], axis = [1.0, 0.0] },
  { name = "P", type = "revolute", bodies = ["cart", "bob"] },
]
assembly = { cart = 0.0, bob = -1.0 }
initial = { velocity_P = "4 rad/s" }
drive = [{ joint = "S", speed = 0.4 }, { joint = "P", speed = "free" }]
"""


def positions(m: Mechanism, side: str, joint: str) -> np.ndarray:
    """A joint's position (N,) at the times, by the analytic model or an engine."""
    found = lc.analyse(m, times=TIMES) if side == "analytic" else lc.simulate(m, simulator=side, times=TIMES)
    return found[f"position_{joint}"]


@pytest.mark.long_rows("False-analytic", "True-analytic")
@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("swings", [True, False])
def test_a_thrown_pendulum_swings_or_turns_over_by_the_elliptic_functions(swings: bool, side: str) -> None:
    """From below at a rate w: sin(angle/2) = k sn(n t, k), k = w/(2 n); faster than 2 n it turns over (Whittaker)."""
    rate = NATURAL * (1.7 if swings else 2.3)
    k = rate / (2 * NATURAL)
    if swings:
        angle = 2 * np.arcsin(k * ellipj(NATURAL * TIMES, k**2)[0])
    else:
        angle = 2 * ellipj(rate / 2 * TIMES, 1 / k**2)[3]  # the amplitude, which goes on
    m = HANGING.replace(initial={"velocity_O": rate})
    np.testing.assert_allclose(positions(m, side, "O"), angle - math.pi / 2, rtol=0, atol=10 * ACCURACY[side])
    quarter = ellipk(k**2) / NATURAL if swings else math.inf
    assert (TIMES[-1] > quarter) == swings, "it turns back"


@pytest.mark.parametrize("side", SIDES)
def test_a_mass_slides_until_its_damper_holds_it(side: str) -> None:
    """x = v m/c (1 - exp(-c t/m)) of 2 kg, 3 N.s/m, 0.5 m/s."""
    way = 0.5 * 2.0 / 3.0 * (1 - np.exp(-3.0 * TIMES / 2.0))
    np.testing.assert_allclose(positions(loads(SLIDING), side, "S"), way, rtol=0, atol=ACCURACY[side])


def two_bars(state: np.ndarray) -> np.ndarray:
    """Accelerations of two bars by Lagrange's equations in their angles from the x axis."""
    p, q, v, w = state
    m1, m2, c1, c2, j1, j2, a = 1.2, 0.7, 0.15, 0.1, 0.012, 0.004, 0.3
    b = m2 * a * c2
    mass = np.array([[j1 + m1 * c1**2 + m2 * a**2, b * math.cos(p - q)], [b * math.cos(p - q), j2 + m2 * c2**2]])
    force = np.array(
        [
            -b * math.sin(p - q) * w**2 - (m1 * c1 + m2 * a) * G * math.cos(p),
            b * math.sin(p - q) * v**2 - m2 * c2 * G * math.cos(q),
        ]
    )
    return np.array([v, w, *np.linalg.solve(mass, force)])


def followed(slope: Callable[[np.ndarray], np.ndarray], start: list[float]) -> np.ndarray:
    return np.asarray(
        solve_ivp(lambda _, x: slope(x), (0.0, TIMES[-1]), start, "DOP853", TIMES, rtol=1e-11, atol=1e-11).y
    )


@pytest.mark.long_rows("analytic", "exudyn")
@pytest.mark.parametrize("side", SIDES)
def test_two_bars_are_thrown(side: str) -> None:
    p, q, _, _ = followed(two_bars, [-1.2, -0.9, 7.0, 7.0 - 11.0])
    m = loads(TWO_BARS)
    np.testing.assert_allclose(positions(m, side, "A"), p, rtol=0, atol=ACCURACY[side])
    np.testing.assert_allclose(positions(m, side, "B"), q - p, rtol=0, atol=ACCURACY[side])


@pytest.mark.long_rows("exudyn")
@pytest.mark.parametrize("side", SIDES)
def test_a_bob_is_thrown_on_a_cart_that_a_motor_moves(side: str) -> None:
    """At a constant speed of the cart the bob is a pendulum."""
    of_bob = 0.6 * 0.2 * G / (0.003 + 0.6 * 0.2**2)
    q, _ = followed(lambda x: np.array([x[1], -of_bob * math.cos(x[0])]), [-1.0, 4.0])
    np.testing.assert_allclose(positions(loads(CART), side, "P"), q, rtol=0, atol=ACCURACY[side])


def test_any_joint_says_how_fast_a_linkage_begins_that_has_one_freedom() -> None:
    """A four-bar thrown by its rocker: the joint has that velocity, and the crank what the loops make of it."""
    m = load("crank-rocker").replace(drive={"joint": "D", "speed": "free"}).with_clearances({})
    found = lc.analyse(m.replace(initial={"velocity_E": 8.0}), times=[0.0, 1e-5])
    follower = found["follower_angular_velocity"][0]
    assert follower * (1.0 if m.joint("E").bodies[0] == "ground" else -1.0) == pytest.approx(8.0, rel=1e-9)
    assert abs(found["crank_angular_velocity"][0]) > 8.0


def test_a_schedule_is_released_with_the_rates_of_the_file() -> None:
    m = HANGING.replace(initial={"velocity_O": 2.0})
    assert set_off(Assembly(m), Schedule.released(m, TIMES)).rates == {"O": 2.0}
    assert loads(dumps(m)) == m
    with pytest.raises(Unsupported, match="no rates for its initial velocities"):
        declared("mujoco").simulate(request_of(m, time=TIMES))


@pytest.mark.parametrize(
    ("initial", "named"),
    [
        ({"velocity_B": 1.0}, "no freedom; leave out initial, or give a drive speed = 'free'"),
        ({"velocity_A": 1.0, "velocity_B": 1.0}, "no freedom"),
        ({"velocity_D": 1.0}, "initial.velocity_D is given, and a motor moves that joint"),
        ({"velocity_X": 1.0}, "initial.velocity_X is no velocity of a joint; give one of velocity_A, velocity_B"),
        ({"speed_A": 1.0}, "initial.speed_A is no velocity of a joint"),
    ],
)
def test_velocities_that_a_driven_linkage_cannot_have_are_refused(initial: dict[str, float], named: str) -> None:
    with pytest.raises(Error, match=re.escape(named)):
        lc.analyse(load("crank-rocker").replace(initial=initial))


@pytest.mark.parametrize(
    ("initial", "named"),
    [
        ({"velocity_A": 1.0, "velocity_D": 1.0}, "only 1 freedom (D); leave out what is too many"),
        ({"velocity_B": 1.0}, "do not say how D move: where the linkage starts"),  # at a dead centre of B
    ],
)
def test_velocities_that_a_free_linkage_cannot_have_are_refused(initial: dict[str, float], named: str) -> None:
    m = load("crank-rocker")
    m = m.replace(drive={"joint": "D", "speed": "free"}, initial=initial).with_clearances({})
    with pytest.raises(Error, match=re.escape(named)):
        lc.analyse(m, times=TIMES)


def test_one_velocity_of_two_freedoms_is_that_of_one_of_them() -> None:
    five = load("five-bar").replace(drives=[], drive=[{"joint": n, "speed": "free"} for n in "DE"])
    for initial, fault in (({"velocity_P": 1.0}, "alone does not say how D and E move"), ({"velocity_E": 1.0}, "")):
        m = five.replace(initial=initial)
        if fault:
            with pytest.raises(Error, match=fault):
                lc.analyse(m, times=[0.0, 1e-3])
        else:
            assert lc.analyse(m, times=[0.0, 1e-3])["left-crank_angular_velocity"][0] == 0.0


def test_a_unit_that_does_not_fit_is_refused() -> None:
    with pytest.raises(Error, match=re.escape("initial.velocity_S = '2 rad/s' has")):
        loads(SLIDING.replace("500 mm/s", "2 rad/s"))


@pytest.mark.long_rows("False")
@pytest.mark.parametrize("says", [True, False])
def test_a_record_that_does_not_say_how_fast_it_begins_is_let_go_as_the_file_says(says: bool, tmp_path: Path) -> None:
    m = HANGING.replace(initial={"velocity_O": 3.0})
    found = lc.analyse(m, times=TIMES).signals
    seen = {"reaction_O_x [N]": found["reaction_O_x"], "reaction_O_y [N]": found["reaction_O_y"]}
    if says:
        seen |= {f"pendulum_{n}": found[f"pendulum_{k}"] for n, k in (
            ("angle [rad]", "angle"), ("angular_velocity [rad/s]", "angular_velocity"))}  # fmt: skip
    (tmp_path / "seen.csv").write_text(csv_text(TIMES, seen), encoding="utf-8")
    told = lc.check(tmp_path / "seen.csv", m)
    assert told.verdict == "agrees"
    left_out = [text for text in told.warnings if "left out: initial" in text]
    assert bool(left_out) == says
    assert any("at 3 rad/s" in text for text in told.warnings) != says
    assert (lc.check(tmp_path / "seen.csv", HANGING).verdict == "agrees") == says

"""Recorded results in which some freedoms are driven and others run free: a bob on a driven cart, two bars with one
motor, a free cart; held to differential equations of their own and to an engine's record.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import tomli_w
from scipy.integrate import solve_ivp

import linkage_crosscheck as lc
from analytic.errors import Error
from analytic.mechanism import Mechanism
from analytic.mechanism.file import loads
from measured_files import csv_text
from test_initial import CART, TWO_BARS

G, BOB, ARM, CART_MASS = 9.81, 0.6, 0.2, 2.0  # m/s2, kg, m, kg
TURNED = 0.003 + BOB * ARM**2  # kg.m2, of the bob about its pin
TIME = np.linspace(0.0, 0.6, 61)
DRIVEN_CART = loads(CART.replace("speed = 0.4", 'speed = "measured"').replace('velocity_P = "4 rad/s"', ""))
ONE_MOTOR = loads(
    TWO_BARS.replace("initial = { velocity_A = 7.0, velocity_B = -11.0 }", "")
    + 'drive = [{ joint = "A", speed = "measured" }, { joint = "B", speed = "free" }]\n'
)


def followed(slope: Callable[[float, np.ndarray], list[float]], start: list[float]) -> np.ndarray:
    return np.asarray(solve_ivp(slope, (0.0, TIME[-1]), start, "DOP853", TIME, rtol=1e-11, atol=1e-12).y)


def on_a_cart(twist: float = 0.0, rates: bool = False) -> dict[str, np.ndarray]:
    """J q'' = m c (x'' sin q - g cos q) + twist sin 9t (N.m), of a bob at angle q from the x axis on a cart at
    x = 0.05 sin 4t.
    """

    def bent(t: np.ndarray, q: np.ndarray) -> np.ndarray:
        return (BOB * ARM * (-0.8 * np.sin(4 * t) * np.sin(q) - G * np.cos(q)) + twist * np.sin(9 * t)) / TURNED

    q, w = followed(lambda t, x: [x[1], float(bent(np.array(t), x[0]))], [-0.7, 2.5])
    rise, pushed = bent(TIME, q), -0.8 * np.sin(4 * TIME)
    force = (CART_MASS + BOB) * pushed + BOB * ARM * (-np.sin(q) * rise - np.cos(q) * w**2)
    columns = {
        "position_S [m]": 0.05 * np.sin(4 * TIME),
        "bob_angle [rad]": q,
        "bob_angular_velocity [rad/s]": w,
        "drive_force_S [N]": force,
    }
    moving = {
        "bob_angular_acceleration [rad/s^2]": rise,
        "velocity_P [rad/s]": w,
        "acceleration_S [m/s^2]": pushed,
        "drive_power [W]": force * 0.2 * np.cos(4 * TIME),
    }
    return columns | (moving if rates else {}) | ({"brake [N.m]": twist * np.sin(9 * TIME)} if twist else {})


def checked(
    folder: Path, columns: dict[str, np.ndarray], m: Mechanism, late: float = 0.0, **how: object
) -> lc.CrossCheck:
    (folder / "seen.csv").write_text(csv_text(TIME + late, columns), encoding="utf-8")
    return lc.check(folder / "seen.csv", m, **how)


@pytest.mark.long_rows("0.0")
@pytest.mark.parametrize("late", [0.0, 3.0])
def test_a_bob_on_a_driven_cart_swings_by_its_own_equation(late: float, tmp_path: Path) -> None:
    """From the record's start on, 40 degrees from where the file assembles it, whatever the clock says then."""
    result = checked(tmp_path, on_a_cart(), DRIVEN_CART, late)
    assert result.verdict == "agrees"
    of = {each.signal: abs(each.max) for each in result.runs[0].discrepancies}
    assert of.keys() == {"bob_angle", "bob_angular_velocity", "drive_force_S"}
    assert of["bob_angle"] < 1e-6
    assert of["drive_force_S"] < 2e-3  # of 5 N: the cart is known by its positions alone
    assert not [text for text in result.warnings if "begins" in text]


def test_a_wrong_bob_is_found(tmp_path: Path) -> None:
    result = checked(tmp_path, on_a_cart(), DRIVEN_CART.with_body("bob", mass=0.63))
    off = {each.signal for each in result.runs[0].discrepancies if each.verdict == "disagrees"}
    assert {"bob_angle", "drive_force_S"} <= off


@pytest.mark.slow
def test_rates_and_power_are_judged_beside_what_they_follow_from(tmp_path: Path) -> None:
    result = checked(tmp_path, on_a_cart(rates=True), DRIVEN_CART)
    assert result.verdict == "agrees"
    of = {each.signal: abs(each.max) for each in result.runs[0].discrepancies}
    assert of["bob_angular_acceleration"] < 5e-3  # of 30 rad/s2, as the force
    assert of["drive_power"] < 5e-4
    heavier = checked(tmp_path, on_a_cart(rates=True), DRIVEN_CART.with_body("bob", mass=0.63)).runs[0]
    off = {each.signal for each in heavier.discrepancies if each.verdict == "disagrees"}
    assert {"bob_angular_acceleration", "velocity_P", "drive_power"} <= off
    assert "acceleration_S" not in off  # of the drive, that goes as it does


@pytest.mark.slow
@pytest.mark.parametrize("decimals", [3, 4])
def test_what_a_rounded_drive_leaves_open_is_allowed_and_no_more(decimals: int, tmp_path: Path) -> None:
    rounded = {name: np.round(values, decimals) for name, values in on_a_cart(rates=True).items()}
    assert checked(tmp_path, rounded, DRIVEN_CART).verdict == "agrees"
    heavier = checked(tmp_path, rounded, DRIVEN_CART.with_body("bob", mass=0.63)).runs[0]
    off = {each.signal for each in heavier.discrepancies if each.verdict == "disagrees"}
    assert {"bob_angle", "drive_power"} <= off


@pytest.mark.slow
@pytest.mark.parametrize("late", [0.0, 3.0])
@pytest.mark.parametrize("engine", [None, pytest.param("mujoco", marks=pytest.mark.mujoco)])
def test_a_recorded_torque_acts_on_what_runs_free(engine: str | None, late: float, tmp_path: Path) -> None:
    columns = on_a_cart(twist=0.3, rates=True)
    brake = {"load": {"body": "bob", "torque": 1.0}}
    for scale, verdict in ((1.0, "agrees"), (1.05, "disagrees")):
        (tmp_path / "map.toml").write_text(tomli_w.dumps({"columns": {"brake": brake | {"scale": scale}}}))
        result = checked(tmp_path, columns, DRIVEN_CART, late, map=tmp_path / "map.toml", simulator=engine)
        assert result.runs[0].verdict == verdict
        assert [run.verdict for run in result.runs[1:]] == ["agrees"] * bool(engine)


@pytest.mark.slow
def test_how_fast_it_begins_is_told_by_its_positions_or_by_the_file(tmp_path: Path) -> None:
    columns = {name: values for name, values in on_a_cart().items() if "velocity" not in name}
    result = checked(tmp_path, columns, DRIVEN_CART)
    assert result.verdict == "agrees"
    (told,) = [text for text in result.warnings if "how fast joint P begins" in text]
    assert "at 2.500" in told
    assert told.endswith("as its positions begin")
    by_file = checked(tmp_path, columns, DRIVEN_CART.replace(initial={"velocity_P": 2.5}))
    assert by_file.verdict == "agrees"
    assert checked(tmp_path, columns, DRIVEN_CART.replace(initial={"velocity_P": 3.0})).verdict == "disagrees"


@pytest.mark.parametrize("name", [pytest.param(n, marks=getattr(pytest.mark, n)) for n in ("mujoco", "pybullet")])
@pytest.mark.slow
def test_two_bars_with_one_motor_are_checked_by_an_engine_s_record(name: str, tmp_path: Path) -> None:
    """The lower bar's angle and rate are told in the ground's frame, the motor's by its joint."""
    knots = np.linspace(0.0, 0.61, 62)
    course = tmp_path / "course.csv"
    course.write_text(csv_text(knots, {"position_A [rad]": -1.2 + 0.4 * np.sin(5 * knots)}), encoding="utf-8")
    m = ONE_MOTOR.replace(initial={"velocity_B": -6.0})
    seen = lc.simulate(m, simulator=name, course=course, times=TIME)
    units = {"position_A": "rad", "lower_angle": "rad", "lower_angular_velocity": "rad/s", "drive_torque": "N.m"}
    columns = {f"{signal} [{unit}]": seen[signal] for signal, unit in units.items()}
    result = checked(tmp_path, columns, ONE_MOTOR)
    assert result.verdict == "agrees"
    assert len(result.runs[0].discrepancies) == 3
    heavier = checked(tmp_path, columns, ONE_MOTOR.with_body("lower", inertia=0.005))
    assert heavier.verdict == "disagrees"


@pytest.mark.slow
@pytest.mark.mujoco
def test_an_engine_beside_is_let_go_where_the_record_begins(tmp_path: Path) -> None:
    result = checked(tmp_path, on_a_cart(), DRIVEN_CART, simulator="mujoco")
    assert [(run.simulator.name, run.verdict) for run in result.runs] == [("seen", "agrees"), ("mujoco", "agrees")]


def test_nothing_is_driven_and_a_cart_slides_from_anywhere(tmp_path: Path) -> None:
    """Centre of mass at rest: x moves by -m/(M + m) of the bob's; the angle by Lagrange's equation."""
    m = DRIVEN_CART.replace(drives=())
    share = BOB / (CART_MASS + BOB)

    def slope(_: float, state: np.ndarray) -> list[float]:
        q, w = state
        b = BOB * share * ARM**2
        turned = -BOB * ARM * G * math.cos(q) + b * math.sin(q) * math.cos(q) * w**2
        return [w, turned / (TURNED - b * math.sin(q) ** 2)]

    q, w = followed(slope, [-0.7, 0.0])
    x = 0.1 - share * ARM * (np.cos(q) - math.cos(0.7))
    columns = {"position_S [m]": x, "bob_angle [rad]": q, "bob_angular_velocity [rad/s]": w, "cart_x [m]": x}
    result = checked(tmp_path, columns, m)
    assert result.verdict == "agrees", result.runs[0].discrepancies
    with pytest.raises(Error, match=r"joint 'S' slides freely from 0\.1 m on, and engines let it go where"):
        checked(tmp_path, columns, m, simulator="mujoco")


def test_what_cannot_be_is_one_sentence(tmp_path: Path) -> None:
    columns = on_a_cart()
    with pytest.raises(
        Error, match="joint 'P' of cart moves freely, and a freedom that no drive holds has no static motion"
    ):
        checked(tmp_path, columns, DRIVEN_CART, motion="static")
    with pytest.raises(Error, match="has no column 'position_S'"):
        checked(tmp_path, {k: v for k, v in columns.items() if "position" not in k}, DRIVEN_CART)
    with pytest.raises(Error, match="dry friction"):
        checked(tmp_path, columns, DRIVEN_CART.with_joint("P", friction_torque=0.1))
    with pytest.raises(Error, match="swings freely and is compared with ideal joints"):
        checked(tmp_path, columns, DRIVEN_CART.with_joint("P", clearance=1e-4))

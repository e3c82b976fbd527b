"""Stops of joints: a mass that strikes one, a rocker that is driven into one, and what says that it has none."""

from __future__ import annotations

import math
import re
from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid, solve_ivp
from scipy.optimize import brentq

import linkage_crosscheck as lc
from analytic.errors import Error
from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import kinematics
from analytic.mechanism import Mechanism
from analytic.mechanism.file import dumps, load, loads
from analytic.paper.kinetostatics import kinetostatics, kinetostatics_by_numpy
from engine_checks import at_speed, exact_motion, request_of, vector
from sim_models.common.health import Implausible
from sim_models.common.health import check as check_health
from sim_models.engine import ENGINES, JointModel, engine

ENGINE = [pytest.param(name, marks=getattr(pytest.mark, name)) for name in ENGINES]
SIDES = ["analytic", *ENGINE]
EXUDYN_LATER = [pytest.param("exudyn", marks=[pytest.mark.exudyn, pytest.mark.slow])]
MASS, STIFFNESS, SPEED, WAY = 2.0, 2e3, 0.5, 0.05  # kg, N/m, m/s, m
TIMES = np.linspace(0.0, 0.4, 81)
# m of where a mass is 0.2 s after it strikes, 0.5 m/s fast: the engines' steps
ACCURACY = {"analytic": 1e-9, "mujoco": 3e-7, "exudyn": 1e-6, "pybullet": 2e-6, "dart": 2e-6}


def sliding(damping: float) -> Mechanism:
    """A mass that slides freely onto a stop."""
    return loads(f"""
name = "mass"
ground = {{ points = {{ S = [0.0, 0.0] }} }}
body = [{{ name = "mass", points = {{ S = [0.0, 0.0] }}, mass = {MASS}, inertia = 0.01 }}]
joint = [{{ name = "S", type = "prismatic", bodies = ["ground", "mass"], axis = [1.0, 0.0] }}]
drive = {{ joint = "S", speed = "free" }}
initial = {{ velocity_S = {SPEED} }}
stop = [{{ joint = "S", to = "50 mm", stiffness = "2 N/mm", damping = {damping} }}]
""")


def struck(damping: float) -> tuple[Callable[[float], float], float, float]:
    """Where a mass is (m) at a time (s); how long it touches the stop (s), and how fast it leaves it (m/s).

    It oscillates, damped, on the stop until that would pull.
    """
    natural = math.sqrt(STIFFNESS / MASS)
    share = damping / (2 * math.sqrt(STIFFNESS * MASS))
    rate = natural * math.sqrt(1 - share**2)

    def depth(t: float) -> float:
        return SPEED / rate * math.exp(-share * natural * t) * math.sin(rate * t)

    def speed(t: float) -> float:
        turned = math.cos(rate * t) - share * natural / rate * math.sin(rate * t)
        return SPEED * math.exp(-share * natural * t) * turned

    half = math.pi / rate
    end = half if not damping else brentq(lambda t: STIFFNESS * depth(t) + damping * speed(t), 0.2 * half, half)
    begin = WAY / SPEED

    def place(t: float) -> float:
        if t <= begin:
            return SPEED * t
        on = min(t - begin, end)
        return WAY + depth(on) + speed(end) * max(t - begin - end, 0.0)

    return place, end, speed(end)


@pytest.mark.long_rows(
    "20.0-analytic", "0.0-analytic", "20.0-pybullet", "20.0-dart", "20.0-mujoco", "0.0-mujoco", "0.0-dart",
    "0.0-pybullet",
)  # fmt: skip
@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("damping", [0.0, 20.0])
def test_a_mass_rebounds_from_a_stop(damping: float, side: str) -> None:
    """Without a damper a half sine of pi sqrt(m/k), and it leaves as fast as it came."""
    place, touches, leaves = struck(damping)
    if not damping:
        assert touches == pytest.approx(math.pi * math.sqrt(MASS / STIFFNESS), rel=1e-12)
        assert leaves == pytest.approx(-SPEED, rel=1e-12)
    m = sliding(damping)
    found = lc.analyse(m, times=TIMES) if side == "analytic" else lc.simulate(m, simulator=side, times=TIMES)
    np.testing.assert_allclose(found["position_S"], [place(t) for t in TIMES.tolist()], rtol=0, atol=ACCURACY[side])
    last = np.diff(found["position_S"])[-1] / (TIMES[1] - TIMES[0])
    assert last == pytest.approx(leaves, abs=20 * ACCURACY[side])


@pytest.mark.long_rows("pybullet-driven", "dart-driven", "mujoco-driven", "exudyn-driven")
@pytest.mark.parametrize("motion", ["driven", "static"])
@pytest.mark.parametrize("side", SIDES)
def test_a_rocker_that_is_driven_into_a_stop_asks_its_torque_of_the_crank(motion: str, side: str) -> None:
    """k times the penetration on the rocker, and the damper's where that does not pull, by the rocker's rate over the
    crank's.
    """
    bare = load("crank-rocker").with_clearances({}).replace(gravity=(0.0, -9.81))
    m = bare.replace(stops=[{"joint": "E", "to": 1.8, "stiffness": 50.0, "damping": 0.5}])
    angles = np.radians(np.arange(3.0, 360.0, 20.0))
    how = {"motion": motion, "angles": angles}
    free = lc.analyse(bare, **how)
    found = lc.analyse(m, **how) if side == "analytic" else lc.simulate(m, simulator=side, **how)
    moved = lc.analyse(bare, angles=angles)
    deep, rate = np.maximum(moved["position_E"] - 1.8, 0.0), moved["follower_angular_velocity"]
    damped = 0.5 * rate * (motion == "driven")
    push = np.where(deep > 0, np.maximum(50.0 * deep + damped, 0.0), 0.0)
    asked = push * rate / moved["crank_angular_velocity"]
    assert np.sum(push > 0) > 4 < np.sum(push == 0)
    scale = 1e-9 if side == "analytic" else 2e-4
    apart = found["drive_torque"] - free["drive_torque"] - asked
    assert np.abs(apart).max() < scale * np.abs(asked).max()


@pytest.mark.long_rows("pybullet", "dart", "mujoco", "exudyn")
@pytest.mark.parametrize("side", SIDES)
def test_a_block_that_a_crank_drives_into_a_stop_asks_for_closed_forms(side: str) -> None:
    """Of the whole push F at x = r cos(a) + sqrt(l^2 - r^2 sin^2(a)): rod F/cos(b), crank F r sin(a + b)/cos(b), guide
    F tan(b), sin(b) = r sin(a)/l; everything else is as without the stop.
    """
    r, rod, speed, limit = 0.05, 0.12, 60.0, 0.13
    bare = load("slider-crank").with_clearances({}).replace(drive={"joint": "O", "speed": speed})
    m = bare.replace(stops=[{"joint": "S", "to": limit, "stiffness": 4e4, "damping": 150.0}])
    a = np.radians(np.arange(7.0, 360.0, 14.0))
    b = np.arcsin(r / rod * np.sin(a))
    deep = r * np.cos(a) + rod * np.cos(b) - limit
    rate = -speed * r * np.sin(a + b) / np.cos(b)
    push = np.where(deep > 0, np.maximum(4e4 * deep + 150.0 * rate, 0.0), 0.0)
    assert np.sum(push > 0) > 6
    assert np.any((deep > 0) & (push == 0)), "its damper would pull there"
    with_stop, without = (
        lc.analyse(each, angles=a) if side == "analytic" else lc.simulate(each, simulator=side, angles=a)
        for each in (m, bare)
    )
    asked = {
        "drive_torque": -push * r * np.sin(a + b) / np.cos(b),
        "reaction_B_x": push,
        "reaction_B_y": -push * np.tan(b),
        "reaction_S_y": push * np.tan(b),
    }
    for name, values in asked.items():
        apart = with_stop[name] - without[name] - values
        assert np.abs(apart).max() < (1e-9 if side == "analytic" else 2e-4) * np.abs(values).max(), name


# By engine, joint model and law: Exudyn's own contact of spheres would pull the pin back, and DART's is rigid.
THROWN = [
    ("mujoco", "contact", None),
    ("exudyn", "contact", "kelvin-voigt"),
    ("exudyn", "spring-damper", None),
    ("pybullet", "spring-damper", None),
    ("dart", "spring-damper", None),
]


@pytest.mark.long_rows(
    "pybullet-spring-damper-None", "dart-spring-damper-None", "mujoco-contact-None", "exudyn-spring-damper-None",
)  # fmt: skip
@pytest.mark.parametrize(
    ("name", "model", "law"), [pytest.param(*row, marks=getattr(pytest.mark, row[0])) for row in THROWN]
)
def test_a_pin_that_a_damped_stop_throws_across_its_bearing_flies_by_its_equation(
    name: str, model: JointModel, law: str | None
) -> None:
    """The damper asks for more at once than what presses the pin, which a moment later lands on the other side."""
    m = load("crank-rocker").with_joint("B", clearance=2e-4, contact_stiffness=1e6, contact_damping=300.0)
    m = at_speed(m, 6.0).replace(gravity=(0.0, -9.81), loads=[{"body": "follower", "torque": 1.0}])
    m = m.replace(stops=[{"joint": "E", "to": 1.8, "stiffness": 50.0, "damping": 0.5}])
    theta = np.radians(np.linspace(0, 110, 1101))
    exact = exact_motion(m, theta)
    first = int(np.argmax(exact.follower > 1.8))
    assert np.mean(exact.force[first:] == 0) > 0.1
    asked = m.with_joint("B", contact_law=law)
    trace = engine(name).simulate(request_of(asked, model, "driven", theta, start="centred"))
    later = slice(first - 5, None)  # of the start's own bounces nothing is left
    force, gap = vector(trace, "reaction_B")[later], vector(trace, "clearance_B")[later]
    np.testing.assert_allclose(trace.signals["follower_angle"][later], exact.follower[later], rtol=0, atol=6e-5)
    np.testing.assert_allclose(gap, exact.gap[later], rtol=0, atol=0.1 * 2e-4)
    assert np.abs(force - exact.force[later]).max() < 0.2 * np.abs(exact.force[later]).max()
    assert np.all((force * gap.conjugate()).real >= 0)


@pytest.mark.long_rows("dart")
@pytest.mark.parametrize("name", [pytest.param(n, marks=getattr(pytest.mark, n)) for n in ("mujoco", "dart")])
def test_a_light_rocker_on_a_strong_damper_has_its_forces_in_balance(name: str) -> None:
    """It loses its speed in half a millisecond, and its pin bounces: what a damper does half a step later is not an
    engine's fault.  Held to the momentum that the moments about its pivot give it.
    """
    m = load("crank-rocker").with_clearances({"B": 1e-4}).replace(gravity=(0.0, -9.81))
    m = m.replace(stops=[{"joint": "E", "to": 1.8, "stiffness": 50.0, "damping": 0.5}])
    angles = np.radians(np.arange(103.0, 107.0, 0.01))
    found = lc.simulate(m, simulator=name, joint_model="contact", angles=angles)
    body, q, w = m.body("follower"), found["follower_angle"], found["follower_angular_velocity"]
    arm = (body.point("B") - body.point("E")) * np.exp(1j * q)
    turned = (arm.conjugate() * (found["reaction_B_x"] + 1j * found["reaction_B_y"])).imag
    weight = -9.81 * body.mass * ((body.centre - body.point("E")) * np.exp(1j * q)).real
    stop = np.where(q > 1.8, np.maximum(50.0 * (q - 1.8) + 0.5 * w, 0.0), 0.0)
    inertia = body.moment_of_inertia + body.mass * abs(body.centre - body.point("E")) ** 2
    given = cumulative_trapezoid(turned + weight - stop, angles / m.speed, initial=0.0)
    changed = inertia * (w - w[0])
    assert stop.max() > 5
    assert np.abs(given - changed).max() < 0.02 * np.ptp(changed)


@pytest.mark.slow
@pytest.mark.parametrize("name", [pytest.param("mujoco", marks=pytest.mark.mujoco), *EXUDYN_LATER])
def test_a_pin_that_stays_pressed_is_where_its_equilibrium_has_it(name: str) -> None:
    m = load("crank-rocker").with_clearances({"B": 1e-4}).replace(drive={"joint": "D", "speed": 3.0})
    m = m.replace(gravity=(0.0, -9.81), loads=[{"body": "follower", "torque": -5.0}])
    m = m.replace(stops=[{"joint": "E", "to": 1.8, "stiffness": 50.0, "damping": 0.5}])
    (run,) = lc.crosscheck(m, simulator=name, joint_model="contact").runs
    assert [d.signal for d in run.discrepancies if d.verdict != "agrees"] == []
    assert not run.flags


@pytest.mark.long_rows("analytic", "dart", "mujoco", "pybullet")
@pytest.mark.parametrize("side", SIDES)
def test_a_pendulum_swings_between_two_stops(side: str) -> None:
    m = load("pendulum").replace(
        initial={"velocity_O": -2.0},
        stops=[{"joint": "O", "from": -2.2, "to": -0.3, "stiffness": 30.0, "damping": 0.02}],
    )
    body, time = m.bodies[0], np.linspace(0.0, 0.6, 13)
    weight, inertia = body.mass * 9.81 * 0.15, body.moment_of_inertia + body.mass * 0.15**2

    def slope(_: float, x: np.ndarray) -> tuple[float, float]:
        q, w = x
        low = max(30.0 * (-2.2 - q) - 0.02 * w, 0.0) if q < -2.2 else 0.0
        high = max(30.0 * (q + 0.3) + 0.02 * w, 0.0) if q > -0.3 else 0.0
        return w, (-weight * math.cos(q) + low - high) / inertia

    q = solve_ivp(slope, (0.0, 0.6), (0.0, -2.0), "DOP853", time, rtol=1e-11, atol=1e-12, max_step=2e-4).y[0]
    assert q.min() < -2.2 < -0.3 < q.max()
    found = lc.analyse(m, times=time) if side == "analytic" else lc.simulate(m, simulator=side, times=time)
    np.testing.assert_allclose(found["position_O"], q, atol=1e-7 if side == "analytic" else 2e-5)


@pytest.mark.slow
def test_a_released_crank_between_stops_is_the_same_by_either_integration() -> None:
    """By a linkage's one freedom, and as one of those of which there may be several."""
    m = load("crank-rocker").with_clearances({})
    m = m.replace(gravity=(0.0, -9.81), drive={"joint": "D", "speed": "free"})
    m = m.replace(initial={"velocity_D": 5.0}, stops=[{"joint": "E", "to": 1.7, "stiffness": 50.0, "damping": 0.05}])
    from analytic.beyond_paper.free_motion import free_motion
    from analytic.beyond_paper.released import released

    time, assembly = np.linspace(0.0, 0.4, 9), Assembly(m)
    one = released(assembly, time, omega=5.0).reactions
    other = free_motion(assembly, time, {}, {"D": 5.0})
    assert one.motion.relative(m.joint("E")).max() > 1.7
    np.testing.assert_allclose(one.motion.theta, other.motion.theta, atol=1e-6)  # dampers set in at once
    for name, force in one.forces.items():
        np.testing.assert_allclose(force, other.forces[name], atol=1e-3)


def test_large_batches_have_stops_too() -> None:
    """Compiled code has none, and leaves them to numpy."""
    m = load("crank-rocker").with_clearances({})
    m = m.replace(stops=[{"joint": "E", "to": 1.8, "stiffness": 50.0}])
    motion = kinematics(Assembly(m), np.linspace(0.0, 6.0, 6000), 3.0)
    np.testing.assert_array_equal(kinetostatics(motion).drive_torque, kinetostatics_by_numpy(motion).drive_torque)


LEVER = """
name = "lever"
ground = { points = { O = [0.0, 0.0] } }
body = [{ name = "lever", points = { O = [0.0, 0.0], T = [0.4, 0.0] }, mass = 1.0 }]
joint = [{ name = "O", type = "revolute", bodies = ["ground", "lever"] }]
drive = { joint = "O", speed = 2.0 }
stop = [{ joint = "O", to = 0.5, stiffness = 40.0, damping = 3.0 }, { joint = "O", from = -0.5, stiffness = 10.0 }]
assembly = { lever = 0.0 }
"""


@pytest.mark.slow
def test_a_stop_s_numbers_vary_and_are_swept_by_name() -> None:
    """Of a lever turned against it: torque = k (angle - to) + c speed, in closed form."""
    stated = {"to": "1 deg", "stiffness": "2 N.m/rad", "damping": "0.1 N.m.s/rad"}
    lines = [f'"stop.1.{name}" = {{ sd = "{sd}" }}' for name, sd in stated.items()]
    found = lc.analyse(loads(LEVER + "\n".join(["[tolerances]", *lines])), angles=[0.2, 0.7, 0.9])
    assert found.tolerances is not None
    torque = found.tolerances.signals["drive_torque"]
    np.testing.assert_allclose(torque.by_source["stop.1.to"], [0.0, *[40 * math.radians(1.0)] * 2], atol=1e-9)
    np.testing.assert_allclose(torque.by_source["stop.1.stiffness"], [0.0, 0.4, 0.8], atol=1e-9)
    np.testing.assert_allclose(torque.by_source["stop.1.damping"], [0.0, 0.2, 0.2], atol=1e-9)
    one = loads(LEVER.replace(', { joint = "O", from = -0.5, stiffness = 10.0 }', ""))
    for name in ("stop.to", "stop.O.to", "stop.1.to"):
        swept = lc.sweep(one, {name: "10 deg:30 deg:20 deg"}, angles=[0.9])
        largest = [point.numbers["drive_torque"] for point in swept.points]
        np.testing.assert_allclose(largest, [40 * (0.9 - math.radians(at)) + 6 for at in (10, 30)], rtol=1e-9)


def test_a_stop_keeps_its_joint_through_every_change() -> None:
    m = sliding(20.0)
    assert loads(dumps(m)) == m
    assert m.joint("S").stops == m.stops == m.with_joint("S", damping=1.0).joint("S").stops
    assert m.replace(stops=()).joint("S").stops == ()
    assert m.joint("S").stops, "another mechanism's joint is its own"


@pytest.mark.parametrize(
    ("edit", "named"),
    [
        (('to = "50 mm", ', ""), "a stop has from or to, or both"),
        (("to = ", "from = 0.06, to = "), "from = 0.06 is not less than to = 0.05"),
        (
            ('joint = "S", to = "50 mm", stiffness = "2 N/mm"', 'joint = "T", to = 0.05, stiffness = 2e3'),
            "stop.joint = 'T' is not a joint",
        ),
        (
            ('joint = "S", to = "50 mm"', 'joint = "T", to = "50 mm"'),
            "stop.joint = 'T' is not a joint",
        ),
        (("2 N/mm", "2 N.m/rad"), "stop[S].stiffness = '2 N.m/rad' has"),
        (('stiffness = "2 N/mm", ', ""), "stiffness"),
    ],
)
def test_what_is_no_stop_is_refused(edit: tuple[str, str], named: str) -> None:
    text = """
name = "mass"
ground = { points = { S = [0.0, 0.0] } }
body = [{ name = "mass", points = { S = [0.0, 0.0] }, mass = 2.0, inertia = 0.01 }]
joint = [{ name = "S", type = "prismatic", bodies = ["ground", "mass"], axis = [1.0, 0.0] }]
stop = [{ joint = "S", to = "50 mm", stiffness = "2 N/mm", damping = 3.0 }]
"""
    with pytest.raises(Error, match=re.escape(named)):
        loads(text.replace(*edit))


@pytest.mark.parametrize("side", ENGINE)
def test_a_body_without_a_moment_of_inertia_has_a_stop_at_its_pin(side: str) -> None:
    """A slider that its guide keeps from turning: the pin between rod and slider pushes with k times its depth."""
    r, rod = 0.05, 0.12
    bare = load("slider-crank").with_clearances({})
    assert bare.moving["slider"].moment_of_inertia == 0.0
    a = np.radians([60.0, 90.0, 120.0])
    turned = np.arcsin(r / rod * np.sin(a))  # of the slider on the rod
    m = bare.replace(stops=[{"joint": "B", "to": 0.2, "stiffness": 20.0}])
    with_stop, without = (lc.simulate(each, simulator=side, angles=a, motion="static") for each in (m, bare))
    rate = r / rod * np.cos(a) / np.cos(turned)  # of that by the crank's angle
    asked = 20.0 * (turned - 0.2) * rate
    apart = with_stop["drive_torque"] - without["drive_torque"] - asked
    assert np.abs(apart).max() < 1e-6 * np.abs(asked).max()


@pytest.mark.mujoco
@pytest.mark.parametrize("wrong", [{"stiffness": 52.0}, {"damping": 0.55}, {"to": 1.79}])
def test_an_engine_with_another_stop_than_it_is_asked_for_is_found_out(wrong: dict[str, float]) -> None:
    """What a damper may be at another instant of the step hides no wrong number of a stop."""
    m = load("crank-rocker").with_clearances({"B": 1e-4}).replace(gravity=(0.0, -9.81))
    stop = {"joint": "E", "to": 1.8, "stiffness": 50.0, "damping": 0.5}
    angles = np.radians(np.arange(103.0, 112.0, 0.05))
    right, other = (request_of(m.replace(stops=[each]), "contact", "driven", angles) for each in (stop, stop | wrong))
    trace = engine("mujoco").simulate(right)
    check_health(right, trace)
    with pytest.raises(Implausible, match="'follower'"):
        check_health(other, trace)

"""MuJoCo alone: where its armature, its units, its contact rows and laws, and its watched runs have something of their
own.  What it does silently is in test_mujoco_traps.py.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import kinematics
from analytic.mechanism import GROUND, Mechanism
from analytic.mechanism.file import load, loads
from analytic.mechanism.parts import ContactLaw
from analytic.paper.kinetostatics import kinetostatics
from asked import request_of
from compare.crosscheck import crosscheck
from compare.judge.contact_motion import WatchedRun, integral, taken
from engine_checks import at_speed, exact_motion, fast_crank_rocker, ideal_signals, is_force, off, run, vector
from rebounds import law_of
from sim_models.common.contact_laws import restitution
from sim_models.engine import JointModel, Trace, Unsupported
from sim_models.mujoco.engine import ENGINE

pytestmark = pytest.mark.mujoco

SPEED, CLEARANCE, REPORTED, BEYOND = 60.0, 2e-4, 1.8, 0.9  # rad/s, m, rad, rad
GRAVITY = -9.81
DROPPED = """
name = "dropped journal"
gravity = [0.0, -9.81]
ground = { points = { O = [0.0, 0.0] } }
body = [
  { name = "journal", points = { O = [0.0, 0.0], rim = [0.1, 0.0] }, com = [0.0, 0.0], mass = 0.2, inertia = 1e-4 },
]
joint = [{ name = "O", type = "revolute", bodies = ["ground", "journal"], clearance = 0.01 }]
assembly = { journal = 0.0 }
"""


@pytest.mark.slow
def test_a_slow_crank_is_not_moved_aside_by_reactions_in_minutes() -> None:
    """Two minutes under 50 N; the motor's armature of 1e9 kg.m^2 alone would gain 3e-5 rad in them."""
    theta, m = np.array([20.0, 90.0, 160.0]), at_speed(load("paper"), 0.02)
    trace = run("mujoco", m, "ideal", "driven", theta)
    np.testing.assert_allclose(trace.signals["crank_angle"], np.radians(theta), rtol=0, atol=3e-7)
    assert off(trace.signals, ideal_signals(m, np.radians(theta)), is_force) < 1e-4


@pytest.mark.parametrize("joint_model", ["ideal", "contact"])
def test_a_mass_below_mujocos_least_is_refused_in_a_sentence(joint_model: JointModel) -> None:
    m = load("paper").with_body("crank", mass=1e-30).with_clearances({"B": 1e-3})
    with pytest.raises(Unsupported, match=r"body 'crank' has mass = 1e-30 kg, .* more than 1e-15"):
        ENGINE.simulate(request_of(m, joint_model, "driven", np.radians([40.0])))


def test_a_wound_up_spring_does_not_pass_for_a_motion_that_repeats_itself() -> None:
    turn = 10 * np.pi * np.linspace(0.0, 0.2, 121)
    m = at_speed(load("crank-rocker").replace(gravity=(0.0, -9.81)), 10 * np.pi, stiffness=200.0)
    trace = ENGINE.simulate(request_of(m.with_joint("D", stiffness=0.1), crank_angle=turn))
    assert trace.settings["start"] == "equilibrium"
    wound = -0.1 * np.diff(trace.signals["crank_angle"][[0, -1]])[0]
    assert np.diff(trace.signals["drive_torque"][[0, -1]])[0] == pytest.approx(-wound, rel=0.02)


def test_reports_a_billionth_of_a_second_apart_are_followed() -> None:
    """The cubic between two such instants is rounding, and its slope was larger than MuJoCo takes for a control."""
    turn = np.linspace(0.0, 0.2, 721)
    m = at_speed(load("crank-rocker").replace(gravity=(0.0, -9.81)), "measured")
    course = (turn, 10 * np.pi * turn + 2e-3 * np.sin(60 * np.pi * turn + 0.3))
    time = np.sort(np.concatenate([turn[10:-10:40], turn[10:-10:40] + 1e-9]))
    torque = ENGINE.simulate(request_of(m, time=time, course=course)).signals["drive_torque"]
    assert np.abs(np.diff(torque.reshape(-1, 2), axis=1)).max() < 1e-4 * np.abs(torque).max()


# ---------------------------------------------------------------- contact


def test_a_smaller_step_comes_closer_to_the_equation_of_motion() -> None:
    m, theta = fast_crank_rocker(2e-4, 300.0), np.linspace(0.0, np.pi, 19)
    exact = exact_motion(m, theta).follower
    asked = request_of(m, "spring-damper", "driven", theta, start="centred")
    coarse, fine = (
        np.abs(ENGINE.simulate(replace(asked, step=h)).signals["follower_angle"] - exact).max() for h in (2e-5, 2.5e-6)
    )
    assert fine < coarse / 2


@pytest.mark.slow
def test_contact_of_known_stiffness_is_of_second_order_in_the_step() -> None:
    """The pin is pressed all the way, on a wall of which its bounces take a fraction of a step's turn."""
    theta = np.radians(np.arange(0.0, 180.0, 5.0))
    m = load("crank-rocker").with_joint("B", clearance=1e-4, contact_stiffness=1e7, contact_damping=886.0)
    asked = request_of(at_speed(m, 1000 * np.pi / 30), "contact", "driven", theta, lead_in=np.pi)

    def force(step: float) -> np.ndarray:
        trace = ENGINE.simulate(replace(asked, step=step))
        assert trace.free_share == {"B": 0.0}
        return vector(trace, "reaction_B")

    exact = force(1.4e-6)
    coarse, fine = (float(np.abs(force(h) - exact).max() / np.abs(exact).max()) for h in (2.3e-5, 1.15e-5))
    assert coarse < 1e-2
    assert fine < coarse / 3


def rises_again(mass: float, stiffness: float, damping: float, height: float) -> float:
    """Speed of leaving over speed of touching, of a mass (kg) that falls on K d + C d' and weighs on it meanwhile."""

    def lifts(t: float, state: np.ndarray) -> float:
        return float(stiffness * state[0] + damping * state[1])

    lifts.terminal, lifts.direction = True, -1  # type: ignore[attr-defined]
    touched = np.sqrt(2 * 9.81 * height)
    found = solve_ivp(
        lambda t, state: [state[1], 9.81 - lifts(t, state) / mass], (0, 1), [1e-12, touched],
        events=lifts, rtol=1e-10, atol=1e-14,
    )  # fmt: skip
    depth, rate = found.y_events[0][0]
    return float(np.sqrt(rate**2 - 2 * 9.81 * depth) / touched)  # where it is back at its height of touching


def test_stiffness_and_damping_in_si_units_bounce_as_their_law_says() -> None:
    ratio, stiffness = 0.2, 1e6
    damping = 2 * ratio * np.sqrt(stiffness * 0.2)
    m = loads(DROPPED).with_joint("O", contact_stiffness=stiffness, contact_damping=damping)
    time = np.linspace(0.0, 0.12, 1201)
    delivered = rises_again(0.2, stiffness, damping, 0.01)
    assert delivered == pytest.approx(restitution(ratio), rel=0.015)  # which leaves out the weight
    models: list[tuple[JointModel, float]] = [("spring-damper", 2e-3), ("contact", 2e-4)]
    for model, allowed in models:
        trace = ENGINE.simulate(request_of(m, model, time=time, start="centred", step=1e-5))
        height = 0.01 - trace.signals["clearance_O_y"]
        impact = int(np.argmax(height < 0))
        top = next(i for i in range(impact + 20, len(time) - 1) if height[i] >= height[i + 1])
        assert np.sqrt(height[top] / 0.01) == pytest.approx(delivered, rel=allowed)
        deepest = -height.min()
        assert deepest == pytest.approx(
            np.sqrt(2 * 9.81 * 0.01) * np.sqrt(0.2 / stiffness) * 0.76, rel=0.1
        )  # damping ratio 0.2: 0.76 of undamped


def test_settings_say_what_the_contact_was_made_of() -> None:
    theta = np.radians([60.0, 65.0])
    soft = ENGINE.simulate(request_of(load("paper"), "spring-damper", "driven", theta)).settings
    assert soft["contact_stiffness"] == 1e7
    assert soft["contact_damping"] == pytest.approx(np.sqrt(1e7 * 0.157))
    assert "K d + C d'" in soft["contact_law"]
    static = ENGINE.simulate(request_of(load("paper"), "contact", "static", theta)).settings
    assert static["contact_stiffness"] == 1e8
    hard = ENGINE.simulate(request_of(load("paper"), "contact", "driven", theta)).settings
    assert "hard" in hard["contact_law"]
    assert hard["step"] > 0


def crank_rocker(law: ContactLaw | None, asked: float = 0.8, friction: float = 0.0, **of_joint: float) -> Mechanism:
    """At 573 rpm, with clearance in B."""
    given = {"contact_stiffness": 1e6, "contact_law": law, "restitution": asked, **of_joint}
    m = load("crank-rocker").with_joint("B", clearance=CLEARANCE, friction=friction, pin_radius=0.01, **given)
    return at_speed(m.replace(gravity=(0.0, GRAVITY)), SPEED)


def turned(m: Mechanism, model: JointModel = "contact", **asked: object) -> Trace:
    """A part of a revolution from the pin in the middle of its gap."""
    theta = np.linspace(0.0, REPORTED, 9)
    return ENGINE.simulate(replace(request_of(m, model, "driven", theta, start="centred"), **asked))


@cache
def watched(law: ContactLaw | None, model: JointModel = "contact", friction: float = 0.0, asked: float = 0.8) -> Trace:
    """The same watched, and going on."""
    return turned(crank_rocker(law, asked, friction), model, watched=True, beyond=BEYOND)


def missing(trace: Trace, m: Mechanism) -> float:
    """Largest energy that a watched run has lost track of, over what its motor turned over."""
    assert trace.watched is not None
    run = WatchedRun(m, trace.watched)
    margin = trace.settings.get("contact_margin", {})
    pin = run.course(m.joint("B"), margin.get("B", 0.0))  # type: ignore[union-attr]
    power = run.motor + run.applied - taken({"B": pin}) - run.joints
    miss = integral(power, run.time) - (run.kinetic - run.kinetic[0])
    return float(np.abs(miss).max() / integral(np.abs(run.motor), run.time)[-1])


def test_energy_is_kept_where_joints_are_damped() -> None:
    """Less well: MuJoCo's dampers are of first order in the step."""
    m = crank_rocker("flores").with_joint("E", damping=0.01)
    assert missing(turned(m, watched=True), m) < 1e-4


@pytest.mark.slow
def test_energy_is_better_kept_in_shorter_steps() -> None:
    m = crank_rocker("flores")
    step = watched("flores").step
    assert step is not None
    coarse, fine = (missing(turned(m, watched=True, step=step / n), m) for n in (1, 2))
    assert fine < coarse / 2.5


@pytest.mark.parametrize("friction", [0.0, 0.2])
def test_the_wall_pushes_as_the_law_says_at_every_instant(friction: float) -> None:
    """Kelvin and Voigt's: stiffness and damping in SI units, and friction on the slip; but where a pin just touched."""
    m = crank_rocker("kelvin-voigt", 0.5, friction)
    trace = turned(m, watched=True)
    assert trace.watched is not None
    law, (pin,) = law_of(m, "B"), WatchedRun(m, trace.watched).course(m.joint("B")).contacts
    pressed = np.where(pin.depth > 0, np.maximum(law.stiffness * pin.depth + law.damping * pin.rate, 0.0), 0.0)
    steady = pin.depth > 0
    steady[1:] &= pin.depth[:-1] > 0  # of the step that finds it there the mean is taken
    slides = steady & (np.abs(pin.slip) > 5e-3)
    exact, near = (slides, 5e-4) if friction else (steady, 1e-6)
    np.testing.assert_allclose(pin.push[exact], pressed[exact], atol=near * pressed.max())
    assert pin.push.min() >= 0.0
    assert np.all(pin.push[pin.depth == 0] == 0)
    np.testing.assert_allclose(
        pin.rub[slides], -friction * pin.push[slides] * np.sign(pin.slip[slides]), atol=1e-6 * pressed.max()
    )
    assert np.all(np.abs(pin.rub) <= friction * pin.push * (1 + 1e-6) + 1e-9)


@pytest.mark.long_rows("10.0")
@pytest.mark.parametrize("damping", [0.0, 10.0])
def test_a_pin_rubs_as_its_coefficient_says_however_little_its_wall_is_damped(damping: float) -> None:
    """The rows of a cone are as soft as its wall is undamped: without damping they rubbed by 0.0007 in place of 0.2."""
    m = crank_rocker(None, friction=0.2).with_joint("B", restitution=None, contact_stiffness=1e7)
    m = m.with_joint("B", contact_damping=damping)
    trace = turned(m, watched=True)
    assert trace.watched is not None
    (pin,) = WatchedRun(m, trace.watched).course(m.joint("B")).contacts
    slides = (pin.push > 0.1 * pin.push.max()) & (np.abs(pin.slip) > 5e-3)
    assert slides.sum() > 100
    np.testing.assert_allclose(np.abs(pin.rub[slides]), 0.2 * pin.push[slides], rtol=1e-3)


def test_a_law_with_hysteresis_pushes_as_hooke_says_where_the_pin_turns_back() -> None:
    m = crank_rocker("flores")
    trace = watched("flores")
    assert trace.watched is not None
    law, (pin,) = law_of(m, "B"), WatchedRun(m, trace.watched).course(m.joint("B")).contacts
    turns = np.flatnonzero((pin.rate[:-1] > 0) & (pin.rate[1:] <= 0) & (pin.push[:-1] > 1.0))
    assert turns.size > 3
    part = pin.rate[turns] / (pin.rate[turns] - pin.rate[turns + 1])
    push, depth = (x[turns] * (1 - part) + x[turns + 1] * part for x in (pin.push, pin.depth))
    np.testing.assert_allclose(push, law.stiffness * depth, rtol=1e-3)


def test_what_rests_in_contact_is_damped_as_by_the_slowest_touch() -> None:
    """A run that begins pressed has touched nothing yet."""
    m = crank_rocker("hunt-crossley", 0.5)
    trace = ENGINE.simulate(request_of(m, "contact", "driven", np.array([1.0, 1.1]), watched=True))
    assert trace.watched is not None
    law, (pin,) = law_of(m, "B"), WatchedRun(m, trace.watched).course(m.joint("B")).contacts
    assert np.all(pin.push > 0)
    factor = 1 + law.hysteresis * pin.rate / law.slowest
    np.testing.assert_allclose(pin.push, law.stiffness * pin.depth * factor, rtol=1e-4)


def test_a_run_of_one_report_is_watched_from_there() -> None:
    m = crank_rocker("flores")
    trace = ENGINE.simulate(request_of(m, "contact", "driven", np.array([0.5]), watched=True, beyond=0.3, lead_in=0.2))
    assert trace.watched is not None
    assert trace.watched.angle["crank"][[0, -1]] == pytest.approx([0.5, 0.8])


def test_backward_as_well() -> None:
    m = at_speed(crank_rocker("flores"), -SPEED)
    trace = ENGINE.simulate(request_of(m, "contact", "driven", np.array([0.5, 1.0]), watched=True, beyond=0.3))
    assert trace.watched is not None
    assert trace.watched.angle["crank"][[0, -1]] == pytest.approx([1.0, 0.2])
    assert missing(trace, m) < 3e-6


def test_ideal_pins_and_massless_links_go_on_unwatched() -> None:
    m = crank_rocker(None)
    for model in ("ideal", "massless-link"):
        request = request_of(m, model, "driven", np.array([0.5, 1.0]))
        trace = ENGINE.simulate(replace(request, watched=True, beyond=0.2))
        assert trace.watched is None
        for name, values in ENGINE.simulate(request).signals.items():
            np.testing.assert_array_equal(values, trace.signals[name], name)


def test_a_slide_is_watched_too() -> None:
    m = load("slider-crank").with_joint("B", clearance=CLEARANCE, contact_law="flores", contact_stiffness=1e6)
    m = at_speed(m.replace(gravity=(0.0, GRAVITY)), SPEED)
    assert GROUND in {body for joint in m.joints for body in joint.bodies if joint.prismatic}
    assert missing(turned(m, watched=True), m) < 1e-5


@pytest.mark.slow
@pytest.mark.parametrize("asked", [0.9, 0.999])
def test_hard_contact_that_hardly_damps_rubs_by_its_coefficient(asked: float) -> None:
    """Friction of a pin pressed to its wall takes its coefficient times radius, reaction and turning between the two.
    Once it took a quarter of that at a restitution of 0.999, and gave energy at 1.
    """
    m = load("crank-rocker").replace(gravity=(0.0, -9.81)).with_clearances({"B": 1e-4})
    m = at_speed(m, 3.0).with_joint("B", restitution=asked, friction=0.03, pin_radius=0.02)
    (found_run,) = crosscheck(m, "mujoco", joint_model="contact", revolutions=2, workers=1).runs
    found = kinetostatics(kinematics(Assembly(m.ideal()), np.linspace(0, 2 * np.pi, 2001)[:-1], 3.0))
    turning = np.abs(found.motion.slip(m.joint("B")))
    took = 0.03 * 0.02 * float(np.mean(np.abs(found.forces["B"]) * turning)) * 2 * np.pi / 3.0
    assert found_run.contact is not None
    assert found_run.contact.joints["B"].statistics["friction_loss"].value == pytest.approx(took, rel=5e-3)

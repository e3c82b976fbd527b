"""MuJoCo's clearance joints in motion: against an independent equation of motion, laws of impact and of friction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import kinematics
from analytic.mechanism import Mechanism
from analytic.mechanism.file import load, loads
from asked import request_of
from compare.crosscheck import crosscheck
from engine_checks import many_impacts_against_the_ode
from marks import slow
from sim_models.common.contact_laws import restitution
from sim_models.engine import JointModel, Motion
from sim_models.mujoco.engine import ENGINE

pytestmark = pytest.mark.mujoco

DROPPED = """
name = "dropped journal"
gravity = [0.0, -9.81]
[ground]
points = { O = [0.0, 0.0] }
[[body]]
name = "journal"
points = { O = [0.0, 0.0], rim = [0.1, 0.0] }
com = [0.0, 0.0]
mass = 0.2
inertia = 1e-4
[[joint]]
name = "O"
type = "revolute"
bodies = ["ground", "journal"]
clearance = 0.01
[assembly]
journal = 0.0
"""


def crank_rocker(speed: float, clearance: float, stiffness: float, damping: float) -> Mechanism:
    m = load("crank-rocker").with_joint("B", clearance=clearance, contact_stiffness=stiffness, contact_damping=damping)
    assert m.drive is not None
    return m.replace(drive=m.drive.model_copy(update={"speed": speed}))


def equation_of_motion(
    speed: float, clearance: float, stiffness: float, damping: float, time: np.ndarray
) -> np.ndarray:
    """Coupler and follower angles (2, N) of the crank-rocker, its pin at B centred at first: written without this
    project's mechanics.
    """
    crank, coupler, follower, ground, m3, m4 = 0.05, 0.12, 0.10, 0.12, 0.0942, 0.0785
    inertia_a = m3 * (coupler**2 + 1e-4) / 12 + m3 * coupler**2 / 4
    inertia_e = m4 * (follower**2 + 1e-4) / 12 + m4 * follower**2 / 4

    def rate(t: float, state: np.ndarray) -> list[float]:
        alpha, beta, alpha_dot, beta_dot = state
        a, c, f = crank * np.exp(1j * speed * t), coupler * np.exp(1j * alpha), follower * np.exp(1j * beta)
        gap, gap_dot = a + c - ground - f, 1j * (speed * a + alpha_dot * c - beta_dot * f)
        size, force = abs(gap), 0j
        if size > clearance:
            out = gap / size
            force = max(0.0, stiffness * (size - clearance) + damping * (gap_dot * out.conjugate()).real) * out
        carried = m3 * (-(speed**2) * a)
        on_coupler = -(c.conjugate() * force).imag - (c.conjugate() / 2 * carried).imag
        return [alpha_dot, beta_dot, on_coupler / inertia_a, (f.conjugate() * force).imag / inertia_e]

    start = kinematics(Assembly(crank_rocker(speed, 0.0, stiffness, damping)), np.zeros(1), speed)
    state = [float(of(body)[0]) for of in (start.angle, start.angular_velocity) for body in ("coupler", "follower")]
    found = solve_ivp(rate, (0.0, time[-1]), state, "DOP853", t_eval=time, rtol=1e-9, atol=1e-11, max_step=2e-4)
    assert found.success
    return found.y[:2]


@pytest.mark.parametrize("model", ["spring-damper", "contact"])
def test_crank_rocker_at_600_rpm_moves_as_its_equation_of_motion_says(model: JointModel) -> None:
    speed, theta = 20 * np.pi, np.linspace(0.0, 2 * np.pi, 73)
    mechanism = crank_rocker(speed, 2e-4, 1e6, 300.0)
    trace = ENGINE.simulate(request_of(mechanism, model, "driven", theta, start="centred"))
    coupler, follower = equation_of_motion(speed, 2e-4, 1e6, 300.0, theta / speed)
    assert np.abs(trace.signals["coupler_angle"] - coupler).max() < 1e-4
    assert np.abs(trace.signals["follower_angle"] - follower).max() < 1e-4
    assert 0 < trace.free_share["B"] < 0.1  # the pin crosses its gap at first
    assert len(trace.journal["B"]) > 500


def test_a_smaller_step_comes_closer_to_the_equation_of_motion() -> None:
    speed, theta = 20 * np.pi, np.linspace(0.0, np.pi, 19)
    mechanism = crank_rocker(speed, 2e-4, 1e6, 300.0)
    _, follower = equation_of_motion(speed, 2e-4, 1e6, 300.0, theta / speed)
    coarse, fine = (
        float(
            np.abs(
                ENGINE.simulate(
                    request_of(mechanism, "spring-damper", "driven", theta, start="centred", step=h)
                ).signals["follower_angle"]
                - follower
            ).max()
        )
        for h in (2e-5, 2.5e-6)
    )
    assert fine < coarse / 2


def test_contact_of_known_stiffness_is_of_second_order_in_the_step() -> None:
    """The pin is pressed all the way, on a wall of which its bounces take a fraction of a step's turn."""
    theta = np.radians(np.arange(0.0, 360.0, 5.0))
    asked = request_of(crank_rocker(1000 * np.pi / 30, 1e-4, 1e7, 886.0), "contact", "driven", theta, lead_in=2 * np.pi)

    def force(step: float) -> np.ndarray:
        trace = ENGINE.simulate(replace(asked, step=step))
        assert trace.free_share == {"B": 0.0}
        return trace.signals["reaction_B_x"] + 1j * trace.signals["reaction_B_y"]

    exact = force(1.4e-6)
    coarse, fine = (float(np.abs(force(h) - exact).max() / np.abs(exact).max()) for h in (2.3e-5, 1.15e-5))
    assert coarse < 1e-2
    assert fine < coarse / 3


@pytest.mark.parametrize("model", ["spring-damper", "contact"])
@pytest.mark.parametrize("nominal", [0.9, 0.7, 0.5, 0.3])
def test_a_dropped_journal_bounces_with_its_restitution(model: JointModel, nominal: float) -> None:
    mechanism = loads(DROPPED).with_joint("O", restitution=nominal)
    time = np.linspace(0.0, 0.13, 1301)
    trace = ENGINE.simulate(request_of(mechanism, model, time=time, start="centred"))
    height = 0.01 - trace.signals["clearance_O_y"]  # of the journal over its deepest point in the gap
    impact = int(np.argmax(height < 1e-5))
    assert time[impact] == pytest.approx(np.sqrt(2 * 0.01 / 9.81), abs=2e-4)
    top = next(i for i in range(impact + 10, len(time) - 1) if height[i] >= height[i + 1])
    assert np.sqrt(height[top] / 0.01) == pytest.approx(nominal, rel=0.02)


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
    mechanism = loads(DROPPED).with_joint("O", contact_stiffness=stiffness, contact_damping=damping)
    time = np.linspace(0.0, 0.12, 1201)
    delivered = rises_again(0.2, stiffness, damping, 0.01)
    assert delivered == pytest.approx(restitution(ratio), rel=0.015)  # which leaves out the weight
    models: list[tuple[JointModel, float]] = [("spring-damper", 2e-3), ("contact", 2e-4)]
    for model, allowed in models:
        trace = ENGINE.simulate(request_of(mechanism, model, time=time, start="centred", step=1e-5))
        height = 0.01 - trace.signals["clearance_O_y"]
        impact = int(np.argmax(height < 0))
        top = next(i for i in range(impact + 20, len(time) - 1) if height[i] >= height[i + 1])
        assert np.sqrt(height[top] / 0.01) == pytest.approx(delivered, rel=allowed)
        deepest = -height.min()
        assert deepest == pytest.approx(
            np.sqrt(2 * 9.81 * 0.01) * np.sqrt(0.2 / stiffness) * 0.76, rel=0.1
        )  # damping ratio 0.2: 0.76 of undamped


@pytest.mark.parametrize("friction", [0.1, 0.3])
@pytest.mark.parametrize("motion", ["static", "driven"])
@pytest.mark.parametrize("direction", [1, *slow(-1)])
def test_friction_turns_the_displacement_and_moves_the_force_to_the_friction_circle(
    friction: float, motion: Motion, direction: int
) -> None:
    pin_radius, clearance, follower = 0.01, 1e-3, 0.2
    m = load("paper").with_joint("B", clearance=clearance, friction=friction, pin_radius=pin_radius)
    assert m.drive is not None
    m = m.replace(drive=m.drive.model_copy(update={"speed": direction * (m.speed or 0)}))
    theta = np.radians(np.arange(30.0, 141.0, 10.0))
    s = ENGINE.simulate(request_of(m, "contact", motion, theta)).signals
    force, gap = s["reaction_B_x"] + 1j * s["reaction_B_y"], s["clearance_B_x"] + 1j * s["clearance_B_y"]
    angle = np.arctan(friction)
    np.testing.assert_allclose(np.angle(force / gap), -direction * angle, atol=1e-6)
    circle = np.arcsin((pin_radius + clearance) * np.sin(angle) / follower)
    off_axis = np.angle(force * np.exp(-1j * s["follower_angle"]))
    np.testing.assert_allclose(off_axis, direction * circle, atol=1e-6 if motion == "static" else np.radians(0.02))


@pytest.mark.parametrize("model", ["contact", "spring-damper"])
def test_a_run_by_time_begins_in_steady_motion(model: JointModel) -> None:
    """At 300 rpm reactions are the analytic ones from the first instant on, to what the bearings' give makes of them.

    A first half step back by accelerations that do not feel it was 0.04 N off in contact, 0.15 N on springs.
    """
    m = load("crank-rocker").replace(gravity=(0.0, -9.81)).with_clearances({"B": 1e-4})
    (run,) = crosscheck(m, "mujoco", joint_model=model, times=[0.0, 0.01, 0.02], workers=1).runs
    for joint in ("B", "E"):
        for signal in (f"reaction_{joint}_x", f"reaction_{joint}_y"):
            np.testing.assert_allclose(run.simulated[signal], run.analytic[signal], rtol=0.0, atol=2e-4 * 10.7)


CRANK_ON_CARRIAGE = """
name = "crank on a carriage"
gravity = [0.0, -9.81]
[ground]
points = { S = [0.0, 0.0], E = [0.25, -0.05] }
[[body]]
name = "carriage"
points = { S = [0.0, 0.0], A = [0.0, 0.05] }
mass = 2.0
com = [0.01, 0.02]
inertia = 4e-3
[[body]]
name = "crank"
points = { A = [0.0, 0.0], B = [0.08, 0.0] }
mass = 0.3
[[body]]
name = "rod"
points = { B = [0.0, 0.0], E = [0.22, 0.0] }
mass = 0.5
[[joint]]
name = "S"
type = "prismatic"
bodies = ["ground", "carriage"]
axis = [1.0, 0.0]
guide = [0.1, 0.03]
[[joint]]
name = "A"
type = "revolute"
bodies = ["carriage", "crank"]
[[joint]]
name = "B"
type = "revolute"
bodies = ["crank", "rod"]
pin_radius = 0.01
[[joint]]
name = "E"
type = "revolute"
bodies = ["rod", "ground"]
[[load]]
body = "carriage"
point = "com"
force = [0.0, -40.0]
[drive]
joint = "A"
speed = 5.0
[assembly]
carriage = 0.0
crank = 0.6
rod = -0.6
"""


@pytest.mark.parametrize(
    ("simulator", "loose"),
    [
        ("mujoco", "S"),
        ("mujoco", "B"),
        pytest.param("exudyn", "B", marks=pytest.mark.exudyn),
        pytest.param("exudyn", "S", marks=[pytest.mark.exudyn, pytest.mark.slow]),
    ],
)
def test_a_run_whose_contacts_rub_ever_faster_begins_in_steady_motion(simulator: str, loose: str) -> None:
    """A block's corners, or a pin, rub while their slip grows, which MuJoCo's cone takes for a push: 1.14 and 0.6 N.

    Exudyn's runs began where nothing rubbed, and were 6 N off.
    """
    m = loads(CRANK_ON_CARRIAGE).with_joint(loose, clearance=1e-4, friction=0.1)
    (run,) = crosscheck(m, simulator, joint_model="contact", times=[0.0, 0.01], workers=1).runs
    for signal in (f"reaction_{joint}_{axis}" for joint in "SABE" for axis in "xy"):
        np.testing.assert_allclose(run.simulated[signal], run.analytic[signal], rtol=0.0, atol=0.02)


def test_contact_gives_way_where_it_is_not_pressed() -> None:
    """Unloaded parallelogram with the pin centred: no force, no contact, the pin stays in its gap."""
    mechanism = load("paper").replace(loads=()).with_clearances({"B": 1e-3})
    trace = ENGINE.simulate(request_of(mechanism, "contact", "driven", np.radians([60.0, 61.0, 62.0]), start="centred"))
    assert trace.free_share["B"] == 1.0
    assert np.abs(trace.journal["B"]).max() < 1e-3
    np.testing.assert_array_equal(trace.signals["reaction_B_x"], 0.0)


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


@pytest.mark.slow
def test_many_impacts_have_the_exact_statistics() -> None:
    for name, (measured, exact) in many_impacts_against_the_ode(ENGINE).items():
        assert measured == pytest.approx(exact, rel=0.05), name

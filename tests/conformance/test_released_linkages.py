"""Every engine's linkages that are let go, against the analytic model: pendulums with and without friction, a four-bar,
and pendulums that hang in a loose pin.
"""

from __future__ import annotations

import numpy as np
import pytest

from analytic.beyond_paper.released import released
from analytic.kinematics.assembly import Assembly
from analytic.mechanism.file import load
from asked import request_of
from engine_checks import LOOSE, at_speed, declared_runs, is_force, off, vector
from marks import slow_but
from sim_models.engine import ENGINES, JointModel, engine

PINS = declared_runs("driven", LOOSE, "released")
WEIGHT = 0.2355 * 9.81  # N
# Angle (rad), rate (rad/s), force (N) after 0.4 s.  Exudyn's and DART's forces are of a step's middle.
SMOOTH = {"mujoco": (1e-9, 1e-8, 1e-8), "exudyn": (1e-6, 5e-6, 1e-3), "pybullet": (1e-8, 1e-7, 1e-7),
          "dart": (1e-8, 1e-7, 1e-3)}  # fmt: skip
RUBBING = (2e-4, 1e-3, 2e-3)  # dry friction turns round once, somewhere in a step
TURNS_LATE = (2e-3, 1e-2, 1e-2)  # MuJoCo turns round a step late, of 0.4 ms: of the first order in its step


@pytest.mark.long_rows(
    "dart-True-3.0", "dart-True-0.0", "pybullet-True-0.0", "pybullet-True-3.0", "pybullet-False-0.0", "dart-False-0.0",
    "exudyn-True-0.0", "exudyn-False-0.0", "exudyn-False-3.0",
)  # fmt: skip
@pytest.mark.parametrize("start_speed", [0.0, 3.0])
@pytest.mark.parametrize("rubs", [False, True])
@pytest.mark.parametrize("name", ENGINES)
def test_a_pendulum_swings_as_its_equation_says(name: str, rubs: bool, start_speed: float) -> None:
    m = load("pendulum").with_joint("O", **({"friction_torque": 0.02, "damping": 0.001} if rubs else {}))
    time = np.linspace(0, 0.4, 9)
    trace = engine(name).simulate(request_of(m, time=time[::-1], start_speed=start_speed))
    found = released(Assembly(m), time, omega=start_speed)
    right, moving = found.reactions.signals(), ~found.turning
    assert moving.sum() >= time.size - 3
    within = SMOOTH[name]
    if rubs:
        within = TURNS_LATE if name == "mujoco" and start_speed else RUBBING
    for signal, allowed in zip(("angle", "angular_velocity"), within, strict=False):
        seen = trace.signals[f"pendulum_{signal}"][::-1]
        np.testing.assert_allclose(seen, right[f"pendulum_{signal}"], rtol=0, atol=allowed, err_msg=signal)
    force = vector(trace, "reaction_O")[::-1] - vector(right, "reaction_O")
    assert np.abs(force[moving]).max() < within[2]
    np.testing.assert_array_equal(trace.crank_angle, trace.signals["pendulum_angle"])
    assert not trace.signals["drive_torque"].any()


@pytest.mark.parametrize("name", slow_but(["mujoco"], ENGINES))
def test_a_crank_rocker_falls_as_its_equation_says(name: str) -> None:
    """Its crank turns by 20 rad/s in the end: an error of the first order in the step grows with it."""
    m = at_speed(load("crank-rocker").replace(gravity=(0.0, -9.81)), "free")
    time = np.linspace(0.0, 0.3, 4)
    trace, truth = engine(name).simulate(request_of(m, time=time)), released(Assembly(m), time).reactions.signals()
    allowed = 2e-6 if name in ("mujoco", "exudyn") else 3e-4
    for body in m.moving:
        np.testing.assert_allclose(trace.signals[f"{body}_angle"], truth[f"{body}_angle"], rtol=0, atol=allowed)
    assert off(trace.signals, truth, is_force) < (5e-4 if name == "dart" else 2e-4)


@pytest.mark.parametrize("name", ENGINES)
def test_unequal_times_change_no_force(name: str) -> None:
    free = at_speed(load("crank-rocker").replace(gravity=(0.0, -9.81)), "free")
    time = np.linspace(0.0, 0.05, 51)
    moved = time[[0, 3, 4, 11, 28, 29, 50]] + np.array([0.0, 1e-4, -2e-4, 3e-4, 0.0, 1e-4, 0.0])
    some = engine(name).simulate(request_of(free, time=moved, start_speed=10.0))
    right = released(Assembly(free), moved, omega=10.0).reactions.signals()
    for signal in ("reaction_B_x", "reaction_D_y", "follower_angular_velocity"):
        peak = np.abs(right[signal]).max()
        np.testing.assert_allclose(some.signals[signal], right[signal], rtol=0, atol=5e-4 * peak, err_msg=signal)


@pytest.mark.long_rows("dart-contact", "pybullet-spring-damper", "mujoco-contact", "mujoco-massless-link")
@pytest.mark.parametrize(("name", "model"), PINS)
def test_a_pendulum_hangs_in_its_loose_pin(name: str, model: JointModel) -> None:
    """A pin pressed against its bearing makes the pendulum a double one whose first link is the clearance."""
    m, time = load("pendulum").with_clearances({"O": 1e-4}), np.linspace(0, 0.15, 4)
    trace = engine(name).simulate(request_of(m, model, time=time))
    right = released(Assembly(m), time).reactions.signals()
    np.testing.assert_allclose(trace.signals["pendulum_angle"], right["pendulum_angle"], atol=1e-3)
    np.testing.assert_allclose(np.abs(vector(trace, "clearance_O")), 1e-4, rtol=0.01)
    assert trace.free_share == {"O": 0.0}
    hanging = engine(name).simulate(
        request_of(m.replace(assembly={"pendulum": -np.pi / 2}), model, time=np.array([0.0, 0.02]))
    ).signals  # fmt: skip
    np.testing.assert_allclose(hanging["clearance_O_y"], 1e-4, rtol=3e-3)
    np.testing.assert_allclose(hanging["reaction_O_y"], WEIGHT, rtol=1e-3)

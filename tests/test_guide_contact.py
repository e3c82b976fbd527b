"""Blocks with clearance in their guides in engines: corners against walls, held to the analytic model and to closed
forms.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from analytic.kinematics.assembly import Assembly
from analytic.mechanism import Load, Mechanism
from analytic.mechanism.file import load, loads
from analytic.paper.clearance import displaced
from compare.crosscheck import crosscheck
from linkages import inverted_slider
from marks import slow
from sim_models.engine import MOTIONS, Motion, Request, Unsupported, engine

pytest.importorskip("mujoco")

CLEARANCE = 1e-4
STIFFNESS = 1e9  # N/m
ANGLES = np.radians(np.arange(3.0, 363.0, 12.0))
LOADS = {
    "flat": Load(body="slider", force=(0.0, -40.0)),
    "tilted": Load(body="slider", force=(-60.0, 10.0), torque=6.0),
    "either": Load(body="slider", force=(-60.0, 0.0), torque=0.35),
}


def slider_crank(name: str, speed: float = 10.0) -> Mechanism:
    """The shipped slider-crank with its pin B off the middle of its block."""
    m = load("slider-crank").replace(gravity=(0.0, -9.81), loads=(LOADS[name],))
    slider = m.body("slider").model_copy(update={"points": {"B": (0.01, 0.02), "S": (0.0, 0.0)}, "com": (0.0, 0.0)})
    drive = m.drives[0].model_copy(update={"speed": speed})
    return m.replace(bodies=(*m.bodies[:2], slider), drive=drive).with_clearances({"S": CLEARANCE})


def check(seen: dict[str, np.ndarray], right: dict[str, np.ndarray], flags: set[int], places: float) -> None:
    """Places within so many clearances (angles over half the block), forces within 1e-3 of their peak."""
    known = [k for k in range(len(right["slider_x"])) if k not in flags]
    assert len(known) > 0.8 * len(right["slider_x"])
    for name, values in right.items():
        if name not in seen or name.startswith("position"):
            continue
        off = float(np.abs(seen[name] - values)[known].max())
        if name.startswith(("reaction", "drive")):
            like = [n for n in right if n.startswith(name[:8]) and n.endswith("moment") == name.endswith("moment")]
            assert off < 1e-3 * max(float(np.abs(right[n][known]).max()) for n in like), name
        elif name.endswith(("_angle", "rotation")):
            assert off * 0.05 < places * CLEARANCE, name
        elif not name.endswith("velocity"):
            assert off < places * CLEARANCE, name


@pytest.mark.parametrize("name", LOADS)
def test_at_rest_a_block_lies_where_the_analytic_model_has_it(name: str) -> None:
    m = slider_crank(name).with_joint("S", contact_stiffness=STIFFNESS)
    trace = engine("mujoco").simulate(Request(m, "contact", "static", ANGLES))
    found = displaced(Assembly(m), ANGLES, 10.0, inertia=False)
    assert {abs(each) for each in found.rests["S"]} == {"flat": {1.0}, "tilted": {2.0}, "either": {1.0, 2.0}}[name]
    check(dict(trace.signals), found.signals(), set(found.flags), 3e-3)
    assert trace.free_share == {"S": 0.0}


@pytest.mark.parametrize("name", ["either", *slow("flat", "tilted")])
def test_in_motion_too_and_it_begins_in_equilibrium(name: str) -> None:
    m = slider_crank(name)
    trace = engine("mujoco").simulate(Request(m, "contact", "driven", ANGLES, lead_in=0.5))
    found = displaced(Assembly(m), ANGLES, 10.0)
    assert trace.settings["start"] == "equilibrium"
    check(dict(trace.signals), found.signals(), set(found.flags), 3e-3)


def test_the_guide_may_be_on_a_moving_body_and_the_block_carry_it() -> None:
    """The inverted slider: its arm has the guide, and hangs on the ground; and with the joint's bodies exchanged, so
    that the block is the arm's.
    """
    m = inverted_slider().with_joint("S", guide=(0.05, 0.02), friction_torque=0.0).with_joint("C", friction_torque=0.0)
    joint = m.joint("S")
    turned = complex(*(joint.axis or (1.0, 0.0))) * np.exp(-1j * joint.angle)
    back = {"bodies": ("block", "arm"), "axis": (-turned.real, -turned.imag), "angle": -joint.angle}
    for each in (m, m.with_joint("S", **back)):
        loose = each.with_clearances({"S": CLEARANCE}).with_joint("S", contact_stiffness=STIFFNESS)
        theta = np.radians([20.0, 60.0, 140.0, 250.0])
        trace = engine("mujoco").simulate(Request(loose, "contact", "static", theta))
        found = displaced(Assembly(loose), theta, -1.0, inertia=False)
        assert not found.flags
        for name, values in found.signals().items():
            if name.startswith("clearance_S"):
                size = CLEARANCE / (0.025 if name.endswith("angle") else 1.0)
                np.testing.assert_allclose(trace.signals[name], values, atol=3e-3 * size, err_msg=name)
            if name.startswith("reaction_S"):
                np.testing.assert_allclose(trace.signals[name], values, atol=1e-3 * np.abs(values).max(), err_msg=name)


FALLING = """
name = "falling block"
gravity = [0.0, -9.81]
[ground]
points = { O = [0.0, 0.0], S = [0.0, 0.0] }
[[body]]
name = "crank"
points = { O = [0.0, 0.0] }
com = [0.0, 0.0]
mass = 1.0
inertia = 1.0
[[body]]
name = "block"
points = { S = [0.0, 0.0] }
mass = 0.5
inertia = 1e-3
[[joint]]
name = "O"
type = "revolute"
bodies = ["ground", "crank"]
[[joint]]
name = "S"
type = "prismatic"
bodies = ["ground", "block"]
axis = [1.0, 0.0]
guide = [0.1, 0.05]
clearance = 1e-2
contact_law = "flores"
restitution = 0.7
contact_stiffness = 1e8
[[drive]]
joint = "O"
speed = 1.0
[[drive]]
joint = "S"
speed = "free"
[assembly]
crank = 0.0
block = 0.0
"""


def test_a_block_that_falls_flat_bounces_as_its_law_has_it() -> None:
    """Both corners strike at once: the law's restitution delivered, e = 0.683 for 0.7 of Flores's, whatever the mass;
    and before that it falls freely.
    """
    m = loads(FALLING)
    fall = np.sqrt(2 * 1e-2 / 9.81)
    time = np.array([0.5 * fall, 0.9 * fall, 1.3 * fall, 1.35 * fall])
    knots = np.linspace(0.0, 2 * fall, 5)
    asked = Request(m, "contact", "driven", time=time, start="centred", courses={"O": (knots, knots)})
    seen = engine("mujoco").simulate(asked).signals
    np.testing.assert_allclose(seen["block_y"][:2], -9.81 * time[:2] ** 2 / 2, rtol=1e-3)
    np.testing.assert_allclose(seen["clearance_S_y"], -seen["block_y"], atol=1e-12)
    apart, (low, high) = time[3] - time[2], seen["block_y"][2:]
    middle = (low + high) / 2 + 9.81 * apart**2 / 8
    left = np.sqrt(((high - low) / apart) ** 2 + 2 * 9.81 * (middle + 1e-2))
    assert left / (9.81 * fall) == pytest.approx(0.68318, abs=2e-3)
    assert np.abs(seen["block_angle"]).max() < 1e-9


@pytest.mark.parametrize("name", ["exudyn", "pybullet", "dart"])
def test_engines_that_have_no_blocks_say_so(name: str) -> None:
    pytest.importorskip({"dart": "dartpy"}.get(name, name))
    with pytest.raises(Unsupported, match=r"clearance in prismatic joints.*clearance = 0.0001 m of joint 'S'"):
        engine(name).simulate(Request(slider_crank("flat"), "contact", "static", ANGLES))


def test_a_massless_link_holds_no_block() -> None:
    with pytest.raises(Unsupported, match="'S' is a block in a guide"):
        engine("mujoco").simulate(Request(slider_crank("flat"), "massless-link", "static", ANGLES))


FLYING = """
name = "slider-crank of Flores, Leine and Glocker (2010)"
gravity = [0.0, -9.81]
[ground]
points = { O = [0.0, 0.0], S = [0.0, 0.0] }
[[body]]
name = "crank"
points = { O = [0.0, 0.0], A = [0.153, 0.0] }
mass = 0.038
inertia = 7.4e-5
[[body]]
name = "rod"
points = { A = [0.0, 0.0], B = [0.306, 0.0] }
mass = 0.038
inertia = 5.9e-4
[[body]]
name = "slider"
points = { B = [0.0, 0.0], S = [0.0, 0.0] }
mass = 0.076
inertia = 2.7e-6
[[joint]]
name = "O"
type = "revolute"
bodies = ["ground", "crank"]
[[joint]]
name = "A"
type = "revolute"
bodies = ["crank", "rod"]
[[joint]]
name = "B"
type = "revolute"
bodies = ["rod", "slider"]
[[joint]]
name = "S"
type = "prismatic"
bodies = ["ground", "slider"]
axis = [1.0, 0.0]
guide = [0.1, 0.05]
clearance = 1e-3
restitution = 0.4
[drive]
joint = "O"
speed = "free"
[assembly]
crank = 0.0
rod = 0.0
slider = 0.0
"""


def flight(time: float, state: np.ndarray) -> list[float]:
    """Rates of that linkage's crank and rod (angles, rad; rates, rad/s) while its block touches nothing: a double
    pendulum with the block's mass at its end.
    """
    a, b, w, v = state
    l1, l2, m1, m2, m3, g = 0.153, 0.306, 0.038, 0.038, 0.076, 9.81
    both = (m2 / 2 + m3) * l1 * l2
    mass = np.array(
        [
            [7.4e-5 + m1 * l1**2 / 4 + (m2 + m3) * l1**2, both * np.cos(a - b)],
            [both * np.cos(a - b), 5.9e-4 + m2 * l2**2 / 4 + m3 * l2**2],
        ]
    )
    twist = both * np.sin(a - b)
    load = [-twist * v**2 - g * np.cos(a) * l1 * (m1 / 2 + m2 + m3), twist * w**2 - g * np.cos(b) * l2 * (m2 / 2 + m3)]
    return [w, v, *np.linalg.solve(mass, load)]


def test_a_block_flies_freely_until_its_corners_come_to_a_wall() -> None:
    time = np.arange(3e-4, 3.05e-3, 1e-4)
    asked = Request(loads(FLYING), "contact", "driven", time=time, start="centred", start_speed=150.0, step=2e-6)
    trace = engine("mujoco").simulate(asked)
    right = solve_ivp(flight, (0.0, time[-1]), [0.0, 0.0, 150.0, -75.0], t_eval=time, rtol=1e-11, atol=1e-13).y
    height = 0.153 * np.sin(right[0]) + 0.306 * np.sin(right[1])
    free = np.abs(height) < 1e-3
    assert free.sum() == 24  # to 2.6 ms
    np.testing.assert_allclose(trace.signals["crank_angle"][free], right[0][free], atol=2e-6)
    np.testing.assert_allclose(trace.signals["rod_angle"][free], right[1][free], atol=2e-6)
    np.testing.assert_allclose(trace.signals["crank_angular_velocity"][free], right[2][free], rtol=5e-5)
    np.testing.assert_allclose(trace.signals["clearance_S_y"][free], -height[free], atol=1e-6)
    assert np.all(np.abs(trace.signals["clearance_S_y"][~free]) < np.abs(height[~free]))
    assert 0.8 < trace.free_share["S"] < 0.95


@pytest.mark.parametrize("motion", MOTIONS)
def test_a_cross_check_compares_what_a_block_does(motion: Motion) -> None:
    found = crosscheck(slider_crank("tilted"), simulators="mujoco", motion=motion, angles=ANGLES[::3])
    assert [run.joint_model for run in found.runs] == ["ideal", "contact"]
    judged = {row.signal: row.verdict for row in found.runs[1].discrepancies}
    assert judged["clearance_S_angle"] == judged["clearance_S_y"] == judged["reaction_S_moment"] == "agrees"
    assert found.verdict == "agrees"


def test_a_cross_check_with_an_engine_that_has_no_blocks_says_so() -> None:
    pytest.importorskip("pybullet")
    with pytest.raises(Unsupported, match="clearance in prismatic joints"):
        crosscheck(slider_crank("tilted"), simulators="pybullet", motion="static", angles=ANGLES[::5])


def test_every_step_of_a_block_is_watched() -> None:
    m = slider_crank("flat").with_joint("S", contact_law="kelvin-voigt", contact_stiffness=1e7, restitution=0.5)
    theta = np.radians([10.0, 12.0])
    trace = engine("mujoco").simulate(Request(m, "contact", "driven", theta, watched=True))
    assert trace.watched is not None
    seen = trace.watched.force["S"]
    for k, at in ((0, 0), (1, -1)):
        assert seen[at].imag == pytest.approx(trace.signals["reaction_S_y"][k], rel=1e-3)

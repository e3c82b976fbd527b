"""Blocks with clearance in their guides in engines: corners against walls, held to the analytic model and to closed
forms.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from analytic.kinematics.assembly import Assembly
from analytic.mechanism import Load, Mechanism
from analytic.mechanism.file import load, loads
from analytic.paper.clearance import displaced
from asked import request_of
from compare.crosscheck import crosscheck
from linkages import inverted_slider
from marks import slow, slow_but
from sim_models.common.contact_laws import hysteresis
from sim_models.common.guide import Guide
from sim_models.engine import (
    ENGINES,
    JointModel,
    Motion,
    Request,
    SimulationError,
    Trace,
    Unsupported,
    declared,
    engine,
)
from tests.evidence.published.flying_block import flying_block

MODELS: dict[str, JointModel] = {  # of each engine that has blocks, one that has them
    name: model
    for name in ENGINES
    for model in ("spring-damper", "contact")
    if ("guide_clearance", (model, "driven")) in declared(name).capabilities.rigid.features
}
ANY = pytest.mark.parametrize("name", MODELS)
OTHERS = pytest.mark.parametrize("name", [name for name in MODELS if name != "mujoco"])
CLEARANCE = 1e-4
STIFFNESS = 1e9  # N/m
ANGLES = np.radians(np.arange(3.0, 363.0, 24.0))
LOADS = {
    "flat": Load(body="slider", force=(0.0, -40.0)),
    "tilted": Load(body="slider", force=(-60.0, 10.0), torque=6.0),
    "either": Load(body="slider", force=(-60.0, 0.0), torque=0.35),
}


def simulated(name: str, request: Request) -> Trace:
    """What an engine makes of a request, in the joint model in which it has blocks."""
    pytest.importorskip(declared(name).package)
    return engine(name).simulate(replace(request, joint_model=MODELS[name]))


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


@pytest.mark.long_rows("either-mujoco")
@ANY
@pytest.mark.parametrize("load", slow_but(["either"], LOADS))
def test_at_rest_a_block_lies_where_the_analytic_model_has_it(name: str, load: str) -> None:
    m = slider_crank(load).with_joint("S", contact_stiffness=STIFFNESS)
    trace = simulated(name, request_of(m, motion="static", crank_angle=ANGLES))
    found = displaced(Assembly(m), ANGLES, 10.0, inertia=False)
    assert {abs(each) for each in found.rests["S"]} == {"flat": {1.0}, "tilted": {2.0}, "either": {1.0, 2.0}}[load]
    check(dict(trace.signals), found.signals(), set(found.flags), 3e-3)
    assert trace.free_share == {"S": 0.0}


ROWS = [(name, load) for name in MODELS for load in LOADS if (name, load) != ("mujoco", "either")]


@pytest.mark.parametrize(("name", "load"), [("mujoco", "either"), *slow(*ROWS)])
def test_in_motion_too_and_it_begins_in_equilibrium(name: str, load: str) -> None:
    """But for what their corners give where they are springs: 6 % of the clearance."""
    m = slider_crank(load)
    trace = simulated(name, request_of(m, crank_angle=ANGLES, lead_in=0.5))
    found = displaced(Assembly(m), ANGLES, 10.0)
    check(dict(trace.signals), found.signals(), set(found.flags), 3e-3 if name == "mujoco" else 0.06)


@ANY
def test_a_run_begins_where_the_block_rests(name: str) -> None:
    """Without a lead-in; but for what its corners give where they are springs."""
    m, theta = slider_crank("tilted"), np.radians([30.0, 30.2])
    trace = simulated(name, request_of(m, crank_angle=theta))
    check(dict(trace.signals), displaced(Assembly(m), theta, 10.0).signals(), set(), 0.06)


@pytest.mark.long_rows("mujoco")
@ANY
def test_the_guide_may_be_on_a_moving_body_and_the_block_carry_it(name: str) -> None:
    """The inverted slider: its arm has the guide, and hangs on the ground; and with the joint's bodies exchanged, so
    that the block is the arm's.
    """
    m = inverted_slider().with_joint("S", guide=(0.05, 0.02), friction_torque=0.0).with_joint("C", friction_torque=0.0)
    for each in (m, exchanged(m)):
        loose = each.with_clearances({"S": CLEARANCE}).with_joint("S", contact_stiffness=STIFFNESS)
        theta = np.radians([20.0, 60.0, 140.0, 250.0])
        trace = simulated(name, request_of(loose, motion="static", crank_angle=theta))
        found = displaced(Assembly(loose), theta, -1.0, inertia=False)
        assert not found.flags
        for signal, values in found.signals().items():
            if signal.startswith("clearance_S"):
                size = CLEARANCE / (0.025 if signal.endswith("angle") else 1.0)
                np.testing.assert_allclose(trace.signals[signal], values, atol=3e-3 * size, err_msg=signal)
            if signal.startswith("reaction_S"):
                size = 1e-3 * np.abs(values).max()
                np.testing.assert_allclose(trace.signals[signal], values, atol=size, err_msg=signal)


@pytest.mark.long_rows("dart", "pybullet")
@OTHERS
def test_pins_and_a_block_with_clearance_rest_together(name: str) -> None:
    """As MuJoCo has them, with the same springs."""
    pytest.importorskip("mujoco")
    m = slider_crank("tilted").with_clearances({"S": CLEARANCE, "A": 1e-4, "B": 2e-4}).with_joint("B", restitution=None)
    for joint in ("S", "A", "B"):
        m = m.with_joint(joint, contact_stiffness=1e8)
    asked = request_of(m, motion="static", crank_angle=np.radians([30.0, 200.0]))
    own, other = (simulated(which, asked).signals for which in (name, "mujoco"))
    for signal, values in other.items():
        if signal.startswith(("reaction", "clearance", "drive")):
            size = CLEARANCE if signal.startswith("clearance") else 1.0
            np.testing.assert_allclose(own[signal], values, atol=1e-6 * size, rtol=1e-5, err_msg=signal)


def exchanged(m: Mechanism) -> Mechanism:
    """The inverted slider with its slide's bodies exchanged."""
    joint = m.joint("S")
    turned = complex(*(joint.axis or (1.0, 0.0))) * np.exp(-1j * joint.angle)
    back = {"bodies": ("block", "arm"), "axis": (-turned.real, -turned.imag), "angle": -joint.angle}
    return m.with_joint("S", **back)


@pytest.mark.slow
@OTHERS
def test_laws_along_the_guide_act_where_the_block_is(name: str) -> None:
    """The inverted slider with all of its laws, at rest: all reactions are MuJoCo's."""
    pytest.importorskip("mujoco")
    m = inverted_slider().with_joint("S", guide=(0.05, 0.02), contact_stiffness=STIFFNESS)
    for each in (m, exchanged(m)):
        asked = request_of(
            each.with_clearances({"S": CLEARANCE}), motion="static", crank_angle=np.radians([20.0, 140.0])
        )
        own, other = (simulated(which, asked).signals for which in (name, "mujoco"))
        for signal, values in other.items():
            if signal.startswith(("reaction", "drive")):
                size = 1e-5 * max(float(np.abs(values).max()), 1.0)
                np.testing.assert_allclose(own[signal], values, atol=size, err_msg=signal)


FALLING = """
name = "falling block"
gravity = [0.0, -9.81]
ground = { points = { O = [0.0, 0.0], S = [0.0, 0.0] } }
body = [
  { name = "crank", points = { O = [0.0, 0.0] }, com = [0.0, 0.0], mass = 1.0, inertia = 1.0 },
  { name = "block", points = { S = [0.0, 0.0] }, mass = 0.5, inertia = 1e-3 },
]
drive = [
  { joint = "O", speed = 1.0 },
  { joint = "S", speed = "free" },
]
assembly = { crank = 0.0, block = 0.0 }
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
clearance = 2e-3
contact_law = "flores"
restitution = 0.7
contact_stiffness = 1e8
"""


@pytest.mark.long_rows("mujoco")
@pytest.mark.parametrize("name", ["mujoco", "exudyn", *slow("dart", "pybullet")])
def test_a_block_that_falls_flat_bounces_as_its_law_has_it(name: str) -> None:
    """Both corners strike at once: the law's restitution delivered, e = 0.683 for 0.7 of Flores's, whatever the mass;
    and before that it falls freely.
    """
    m = loads(FALLING)
    fall = np.sqrt(2 * 2e-3 / 9.81)
    time = np.array([0.5 * fall, 0.9 * fall, 1.3 * fall, 1.35 * fall])
    knots = np.linspace(0.0, 2 * fall, 5)
    asked = request_of(m, time=time, start="centred", courses={"O": (knots, knots)}, step=2e-6)
    seen = simulated(name, asked).signals
    np.testing.assert_allclose(seen["block_y"][:2], -9.81 * time[:2] ** 2 / 2, rtol=1e-3)
    np.testing.assert_allclose(seen["clearance_S_y"], -seen["block_y"], atol=1e-12)
    apart, (low, high) = time[3] - time[2], seen["block_y"][2:]
    middle = (low + high) / 2 + 9.81 * apart**2 / 8
    left = np.sqrt(((high - low) / apart) ** 2 + 2 * 9.81 * (middle + 2e-3))
    assert left / (9.81 * fall) == pytest.approx(0.68318, abs=3e-3)
    assert np.abs(seen["block_angle"]).max() < 1e-9


@pytest.mark.parametrize(("name", "model"), [("mujoco", "spring-damper"), ("dart", "contact"), ("pybullet", "contact")])
def test_joint_models_that_have_no_blocks_say_so(name: str, model: JointModel) -> None:
    pytest.importorskip(declared(name).package)
    with pytest.raises(Unsupported, match=r"clearance in prismatic joints.*clearance = 0.0001 m of joint 'S'"):
        engine(name).simulate(request_of(slider_crank("flat"), model, "static", ANGLES))


@pytest.mark.long_rows("mujoco")
@ANY
def test_a_block_without_a_moment_of_inertia_rests_but_does_not_move(name: str) -> None:
    """The shipped slider-crank."""
    m = load("slider-crank").replace(gravity=(0.0, -9.81)).with_clearances({"S": CLEARANCE})
    trace = simulated(name, request_of(m, motion="static", crank_angle=ANGLES[:3]))
    np.testing.assert_allclose(trace.signals["reaction_S_y"], 0.5 * 0.21 * 9.81 + 0.14 * 9.81, rtol=1e-6)
    with pytest.raises(Unsupported, match=r"body 'slider' may turn by its clearance.*give its inertia"):
        simulated(name, request_of(m, crank_angle=ANGLES[:3]))


@pytest.mark.parametrize("name", ["pybullet", "dart"])
def test_motors_that_push_no_loose_block_say_so(name: str) -> None:
    pytest.importorskip(declared(name).package)
    m = loads(FALLING.replace('joint = "S", speed = "free"', 'joint = "S", speed = 0.1'))
    knots = np.linspace(0.0, 0.01, 5)
    asked = request_of(m, time=knots[1:], start="centred", courses={"O": (knots, knots), "S": (knots, 0.1 * knots)})
    with pytest.raises(Unsupported, match="push no block that has clearance"):
        simulated(name, asked)


@pytest.mark.parametrize("name", ["mujoco", "exudyn"])
def test_a_motor_along_a_guide_pushes_a_block_that_falls(name: str) -> None:
    pytest.importorskip(name)
    m = loads(FALLING.replace('joint = "S", speed = "free"', 'joint = "S", speed = 0.1'))
    knots = np.linspace(0.0, 0.01, 5)
    asked = request_of(m, time=knots[1:], start="centred", courses={"O": (knots, knots), "S": (knots, 0.1 * knots)})
    seen = simulated(name, asked).signals
    np.testing.assert_allclose(seen["block_x"], 0.1 * knots[1:], atol=1e-9)
    np.testing.assert_allclose(seen["block_y"], -9.81 * knots[1:] ** 2 / 2, atol=1e-8)


@pytest.mark.parametrize("name", ["mujoco", "exudyn"])
def test_a_massless_link_holds_no_block(name: str) -> None:
    pytest.importorskip(name)
    with pytest.raises(Unsupported, match="'S' is a block in a guide"):
        engine(name).simulate(request_of(slider_crank("flat"), "massless-link", "static", ANGLES))


@pytest.mark.mujoco
@pytest.mark.exudyn
def test_engines_that_are_asked_together_for_a_link_in_a_guide_say_which_joints_have_blocks() -> None:
    with pytest.raises(
        Unsupported, match=r"nothing to run with massless-link joints in .* a block in its guide"
    ) as why:
        crosscheck(slider_crank("flat"), ["mujoco", "exudyn"], joint_model="massless-link", workers=1)
    assert "mujoco has contact driven, contact static, ideal driven, ideal static;" in str(why.value)
    assert "massless-link static" not in str(why.value)


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


@pytest.mark.long_rows("pybullet", "exudyn", "dart")
@ANY
def test_a_block_flies_freely_until_its_corners_come_to_a_wall(name: str) -> None:
    time = np.arange(3e-4, 3.05e-3, 1e-4)
    asked = request_of(flying_block(), time=time, start="centred", start_speed=150.0, step=4e-7)
    trace = simulated(name, asked)
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


def energy(m: Mechanism, trace: Trace) -> np.ndarray:
    """Of motion, weight and the springs of its corners, (N,) J."""
    seen, joint = trace.signals, m.joint("S")
    found = np.zeros(trace.crank_angle.size)
    for body in m.bodies:
        found += body.mass / 2 * np.abs(trace.rates[body.name].velocity) ** 2
        found += body.moment_of_inertia / 2 * seen[f"{body.name}_angular_velocity"] ** 2
        found += body.mass * 9.81 * seen[f"{body.name}_y"]
    guide = Guide.of(joint)
    assert guide is not None
    assert joint.contact_stiffness is not None
    depth = guide.depths(-seen["clearance_S_y"], -seen["clearance_S_angle"])
    return found + joint.contact_stiffness / 2 * np.sum(np.maximum(depth, 0.0) ** 2, axis=0)


BOUNCES = {
    "elastic": {"contact_law": "kelvin-voigt", "contact_damping": 0.0, "restitution": None},
    "damped": {"contact_law": "kelvin-voigt", "contact_damping": 20.0, "restitution": None},
    "flores": {"contact_law": "flores", "restitution": 0.7},
}


@pytest.mark.parametrize("name", slow(*MODELS))
@pytest.mark.parametrize("law", ["elastic", "flores"])
def test_a_block_bounces_as_an_equation_of_motion_has_it(name: str, law: str) -> None:
    """Two or three touches, of both corners at once, by Runge and Kutta's steps of 0.1 us."""
    nonsmooth = pytest.importorskip("tests.evidence.nonsmooth")
    numbers = nonsmooth.Guide(0.153, 0.306, (0.038, 0.038, 0.076), (7.4e-5, 5.9e-4, 2.7e-6), 0.05, 0.025, 1e-3, 9.81)
    chi = 0.0 if law == "elastic" else hysteresis("flores", 0.7)
    begin, end = np.zeros(3), np.array([150.0, -75.0, 0.0])
    right, gaps = nonsmooth.compliant(numbers, 4, begin, end, 1e-7, 150_000, 100, 1e6, chi, 0.0, 1.0)
    assert np.sum(np.diff((gaps.min(axis=1) < 0).astype(int)) == 1) >= 2
    m = flying_block().with_joint("S", contact_stiffness=1e6, **BOUNCES[law])
    time = 1e-5 * np.arange(30, 1500)
    seen = simulated(name, request_of(m, time=time, start="centred", start_speed=150.0, step=1e-6)).signals
    height = 0.153 * np.sin(right[30:1500, 0]) + 0.306 * np.sin(right[30:1500, 1])
    np.testing.assert_allclose(seen["crank_angle"], right[30:1500, 0], atol=1e-4 if name == "dart" else 5e-6)
    np.testing.assert_allclose(seen["clearance_S_y"], -height, atol=5e-6 if name == "dart" else 2e-6)


LOSES = {
    "mujoco": 1e-6,
    "exudyn": 1e-5,
    "pybullet": 2e-5,
    "dart": 3e-4,
}  # of its energy, in flight: see leapfrog.bodies
SHARP = [(name, law) for name in MODELS for law in BOUNCES if (name, law) != ("exudyn", "flores")]


@pytest.mark.parametrize(("name", "law"), slow(("exudyn", "flores"), *SHARP))
def test_blocks_bounce_as_mujoco_s_do_and_gain_no_energy(name: str, law: str) -> None:
    """Touches of single corners, K = 1e6 N/m, of a block whose centre of mass is off its pin; what bounces elastically
    keeps its energy.
    """
    pytest.importorskip("mujoco")
    m = flying_block().with_joint("S", contact_stiffness=1e6, **BOUNCES[law])
    m = m.replace(bodies=(*m.bodies[:2], m.bodies[2].model_copy(update={"com": (0.01, 0.005), "inertia": 6e-5})))
    time = np.arange(3e-4, 6e-3, 1e-5)
    asked = request_of(m, time=time, start="centred", start_speed=150.0, step=1e-6)
    own, other = (simulated(which, asked) for which in (name, "mujoco"))
    kept, reference = energy(m, own), energy(m, other)
    assert np.max(kept - np.minimum.accumulate(kept)) < 1e-6 * kept[0]
    assert kept[0] - kept[-1] == pytest.approx(reference[0] - reference[-1], abs=LOSES[name] * kept[0])
    assert (kept[0] - kept[-1] < LOSES[name] * kept[0]) == (law == "elastic")
    np.testing.assert_allclose(own.signals["crank_angle"], other.signals["crank_angle"], atol=3e-5)
    np.testing.assert_allclose(own.signals["clearance_S_y"], other.signals["clearance_S_y"], atol=3e-6)


LONG = [(name, "driven") for name in MODELS]


@pytest.mark.long_rows("mujoco-static")
@pytest.mark.parametrize(("name", "motion"), [*((n, "static") for n in MODELS), *slow(*LONG)])
def test_a_cross_check_compares_what_a_block_does(name: str, motion: Motion) -> None:
    pytest.importorskip(declared(name).package)
    m = slider_crank("tilted", speed=30.0)
    found = crosscheck(m, simulator=name, motion=motion, angles=ANGLES[::5])
    assert [run.joint_model for run in found.runs if run.joint_model in ("ideal", MODELS[name])] == [
        "ideal",
        MODELS[name],
    ]
    judged = {row.signal: row.verdict for run in found.runs[1:] for row in run.discrepancies}
    assert judged["clearance_S_angle"] == judged["clearance_S_y"] == judged["reaction_S_moment"] == "agrees"
    assert found.verdict == "agrees"


@pytest.mark.long_rows("mujoco")
@ANY
def test_every_step_of_a_block_is_watched(name: str) -> None:
    m = slider_crank("flat").with_joint("S", contact_law="kelvin-voigt", contact_stiffness=1e7, restitution=0.5)
    theta = np.radians([10.0, 12.0])
    trace = simulated(name, request_of(m, crank_angle=theta, watched=True))
    assert trace.watched is not None
    seen = trace.watched.force["S"]
    for k, at in ((0, 0), (1, -1)):
        assert seen[at].imag == pytest.approx(trace.signals["reaction_S_y"][k], rel=1e-3)


@pytest.mark.mujoco
def test_a_block_too_deep_in_hard_contact_is_called_a_block() -> None:
    from sim_models.mujoco.laws import WallContact
    from sim_models.mujoco.limits import check_depth

    asked, hard = request_of(slider_crank("flat"), "contact"), WallContact(1e7, 0.0, (1e-4, 0.5))
    with pytest.raises(SimulationError, match=r"the block of joint 'S' is 0\.001 m deep in its guide"):
        check_depth(asked, {"S": hard}, {"S": [CLEARANCE + 1e-3 + 0j]}, {"S": [1.0]})

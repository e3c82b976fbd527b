"""Sensors of a mechanism file: what each reads, by closed forms and by differences of engines' positions; that both
sides have them, and what is refused.  MuJoCo's own sensors are in test_foreign_logs.py.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import linkage_crosscheck as lc
from analytic.mechanism import Mechanism, MechanismError
from analytic.mechanism.file import dumps, load, loads
from analytic.mechanism.signals import named
from commands import compare
from compare.diagnose.effects.vocabulary import VOCABULARY
from diagnosis_rigs import assert_recovered, diagnosed, experiment, four_bar, played, wrong
from foreign_logs import SLIDER_CRANK
from sim_models.engine import ENGINES
from tests.evidence.scoreboard.rigs import Experiment

G = 9.81
ARM = """
name = "arm"
gravity = [0.0, -9.81]
joint = [
  { name = "O", type = "revolute", bodies = ["ground", "arm"] },
]
[ground]
points = { O = [0.0, 0.0], P = [0.0, 0.3] }
[[body]]
name = "arm"
points = { O = [0.0, 0.0], tip = [0.4, 0.0] }
mass = 0.6
section = [0.01, 0.02]
youngs_modulus = 2e11
[drive]
joint = "O"
speed = 30.0
[[load]]
body = "arm"
point = "tip"
force = [5.0, -7.0]
[assembly]
arm = 0.3
"""
LENGTH, MASS, HEIGHT, DEPTH, MODULUS, SPEED = 0.4, 0.6, 0.01, 0.02, 2e11, 30.0


def with_sensors(m: Mechanism, *sensors: dict[str, Any]) -> Mechanism:
    return m.replace(sensors=sensors)


def sensor(kind: str, body: str, **fields: Any) -> dict[str, Any]:
    return {"name": kind, "kind": kind, "body": body, **fields}


# ---------------------------------------------------------------- closed forms


def test_an_arm_that_turns_evenly_is_read_as_its_closed_forms_say() -> None:
    """A uniform bar on a motor: specific force, speed, wire, load cell and torque transducer at its root, by hand."""
    m = with_sensors(
        loads(ARM),
        sensor("accelerometer", "arm", point="tip"),
        sensor("gyro", "arm"),
        sensor("position", "arm", point="tip", axis=(0.0, 2.0)),
        sensor("velocity", "arm", point="tip", axis=(0.0, 1.0)),
        sensor("distance", "arm", point="tip", to="ground.P"),
        sensor("force", "arm", point="O"),
        sensor("torque", "arm", point="O"),
    )
    found = lc.analyse(m).signals
    t = found["arm_angle"]
    axial = -MASS * SPEED**2 * LENGTH / 2 + MASS * G * np.sin(t) - (5 * np.cos(t) - 7 * np.sin(t))
    torque = MASS * G * LENGTH / 2 * np.cos(t) + LENGTH * (5 * np.sin(t) + 7 * np.cos(t))
    for name, expected in {
        "accelerometer": -(SPEED**2) * LENGTH + G * np.sin(t),  # gravity included: what the chip reads
        "gyro": np.full(t.shape, SPEED),
        "position": LENGTH * np.sin(t),
        "velocity": np.full(t.shape, SPEED * LENGTH),  # its axis turns with the arm
        "distance": np.abs(LENGTH * np.exp(1j * t) - 0.3j),
        "force": axial,
        "torque": torque,
    }.items():
        np.testing.assert_allclose(found[name], expected, rtol=0, atol=1e-12 * np.abs(expected).max(), err_msg=name)


@pytest.mark.parametrize("at", [0.1, 0.3])
@pytest.mark.parametrize("face", [1, -1])
def test_a_gauge_reads_the_strain_of_a_swung_bar(at: float, face: int) -> None:
    """Tension of the bar beyond the gauge and its bending, by hand, over EA and EI."""
    m = with_sensors(loads(ARM), sensor("strain", "arm", point=(at, face * HEIGHT / 2)))
    found = lc.analyse(m).signals
    t, beyond, line = found["arm_angle"], LENGTH - at, MASS / LENGTH
    tension = line * (SPEED**2 * (LENGTH**2 - at**2) / 2 - beyond * G * np.sin(t)) + 5 * np.cos(t) - 7 * np.sin(t)
    bending = -(5 * np.sin(t) + 7 * np.cos(t)) * beyond - line * G * np.cos(t) * beyond**2 / 2
    area, second = HEIGHT * DEPTH, DEPTH * HEIGHT**3 / 12
    strain = tension / (MODULUS * area) - bending * face * HEIGHT / 2 / (MODULUS * second)
    np.testing.assert_allclose(found["strain"], strain, rtol=0, atol=1e-12 * np.abs(strain).max())


def test_both_parts_of_a_bar_say_the_same_strain() -> None:
    """A coupler with a payload off its middle: spring and damper in one of its pins leave the part at the other one."""
    m = load("crank-rocker")
    coupler = next(b for b in m.bodies if b.name == "coupler")
    low, high = sorted(x for x, _ in coupler.points.values())
    gauge = sensor("strain", "coupler", point=(0.3 * low + 0.7 * high, coupler.section[0] / 2), youngs_modulus=2e11)
    m = with_sensors(m.with_body("coupler", com=(0.6 * high, 0.002)), gauge)
    either = [
        lc.analyse(m.with_joint(pin, damping=1e-12), motion="driven").signals["strain"] for pin in m_pins(m, "coupler")
    ]
    assert np.ptp(either[0]) > 1e-8
    np.testing.assert_allclose(either[0], either[1], rtol=0, atol=1e-9 * np.abs(either[0]).max())


def m_pins(m: Mechanism, body: str) -> list[str]:
    return [joint.name for joint in m.joints if body in joint.bodies]


@pytest.mark.parametrize(("axis", "reads"), [((0.0, 1.0), G), ((1.0, 0.0), 0.0), ((0.0, -3.0), -G)])
def test_a_chip_at_rest_with_its_axis_up_reads_g(axis: tuple[float, float], reads: float) -> None:
    m = with_sensors(loads(ARM), sensor("accelerometer", "arm", axis=axis, frame="ground"), sensor("gyro", "arm"))
    found = lc.analyse(m, motion="static").signals
    np.testing.assert_allclose(found["accelerometer"], reads, atol=1e-15)
    assert not np.any(found["gyro"])


def test_what_is_seen_from_a_body_is_what_its_rider_sees() -> None:
    """A velocity seen from another body is the rate of the position seen from it."""
    m = load("slider-crank")
    seen = {"point": "B", "axis": (1.0, 0.5), "frame": "crank"}
    m = with_sensors(m, sensor("position", "slider", **seen), sensor("velocity", "slider", **seen))
    h, speed = 1e-4, m.speed or 0.0
    found = lc.analyse(m, angles=0.7 + h * np.arange(-2, 3)).signals
    rate = (found["position"] @ [1, -8, 0, 8, -1]) / 12 * speed / h
    assert found["velocity"][2] == pytest.approx(rate, rel=1e-8)


# ---------------------------------------------------------------- engines


@pytest.mark.parametrize("name", ENGINES)
def test_every_engine_says_what_its_own_positions_make_sensors_read(name: str) -> None:
    """Both sides agree; and an accelerometer and a velocity are differences of the engine's own positions."""
    pytest.importorskip({"dart": "dartpy"}.get(name, name))
    spot = {"point": (0.09, 0.01), "frame": "ground"}
    m = with_sensors(
        load("slider-crank").replace(gravity=(0.0, -9.81)).with_body("rod", section=(0.01, 0.01)),
        sensor("position", "rod", axis=(0.0, 1.0), **spot),
        sensor("velocity", "rod", axis=(0.0, 1.0), **spot),
        sensor("accelerometer", "rod", axis=(0.0, 1.0), **spot),
        sensor("gyro", "rod"),
        sensor("distance", "slider", to="ground.O"),
        sensor("force", "rod", point="A"),
        sensor("torque", "crank", point="O"),
        sensor("strain", "rod", point=(0.06, 0.004), youngs_modulus=2e11),
    )
    h, speed = np.radians(1.0), m.speed or 0.0
    run = lc.crosscheck(m, simulator=name, joint_model="ideal", angles=1.3 + h * np.arange(-3, 4)).runs[0]
    judged = {d.signal: d.verdict for d in run.discrepancies}
    assert {judged[s.name] for s in m.sensors} == {"agrees"}
    heights = run.simulated["position"]
    rate = heights @ np.array([-1, 9, -45, 0, 45, -9, 1]) / 60 * speed / h
    bend = heights @ np.array([2, -27, 270, -490, 270, -27, 2]) / 180 * (speed / h) ** 2
    assert run.simulated["velocity"][3] == pytest.approx(rate, abs=1e-4 * speed * 0.12)
    assert run.simulated["accelerometer"][3] == pytest.approx(bend + G, abs=1e-4 * speed**2 * 0.12)


@pytest.mark.exudyn
def test_sensors_of_links_that_bend_are_read_of_the_bent_linkage() -> None:
    pytest.importorskip("exudyn")
    pull = [{"body": "coupler", "point": "com", "force": (0.0, -50.0)}]
    m = with_sensors(
        load("crank-rocker").replace(loads=pull, gravity=(0.0, -9.81)),
        sensor("distance", "coupler", point="B", to="ground.D"),
        sensor("strain", "follower", point=(0.05, 0.005)),
        sensor("force", "follower", point="E"),
        sensor("torque", "crank", point="D"),
        sensor("accelerometer", "coupler"),
    )
    how = {"motion": "static", "joint_model": "ideal", "angles": np.radians([20.0, 110.0, 200.0])}
    bent, stiff = (lc.crosscheck(m, simulator="exudyn", flexible=each, **how).runs[0] for each in (True, False))
    judged = {each.signal: each.verdict for each in bent.discrepancies}
    assert {judged[one.name] for one in m.sensors} == {"agrees"}
    ours, theirs = (getattr(bent, s)["distance"] - getattr(stiff, s)["distance"] for s in ("analytic", "simulated"))
    assert np.abs(theirs).max() > 1e-6
    np.testing.assert_allclose(ours, theirs, atol=0.02 * np.abs(theirs).max())


# ---------------------------------------------------------------- files


def test_sensors_are_written_and_read_again_and_are_signals_by_their_names() -> None:
    m = loads(SLIDER_CRANK)
    assert loads(dumps(m)) == m
    known = named(m.bodies, m.joints, m.drives, m.sensors)
    assert [known[s.name].unit for s in m.sensors] == ["m/s^2", "m/s^2", "rad/s", "N"]


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        (sensor("gyro", "wing"), "body = 'wing' is no moving body; they are arm"),
        (sensor("gyro", "ground"), "body = 'ground' is no moving body"),
        (sensor("gyro", "arm", axis=(1.0, 0.0)), "axis says nothing of a sensor of kind 'gyro'; leave it out"),
        (sensor("gyro", "arm", point="end"), "point names 'end', no point of 'arm'; use O, tip"),
        (sensor("accelerometer", "arm", axis=(0.0, 0.0)), "an axis has a direction"),
        (sensor("accelerometer", "arm", frame="wing"), "frame = 'wing' is no body; the bodies are ground, arm"),
        (sensor("position", "arm", frame="arm"), "a body does not move in its own frame"),
        (sensor("distance", "arm"), "give to = "),
        (sensor("distance", "arm", to="ground"), "a point of a body is written"),
        (sensor("distance", "arm", to="arm.tip"), "is no point of another body; they are ground"),
        (sensor("distance", "arm", to="ground.Q"), "to names 'Q', no point of 'ground'; use O, P"),
        (sensor("force", "arm"), "sits in a joint; give point = its name"),
        (sensor("force", "arm", point="tip"), "point = 'tip' is no joint of 'arm'; its joints are O"),
        (sensor("strain", "arm", point=(0.5, 0.0)), "is from 0 to 0.4 m along its x axis; give a place between"),
        (sensor("strain", "arm", point=(0.1, 0.1)), "outside the section of 'arm'; a gauge on its face is at 0.005 m"),
        (sensor("gyro", "arm") | {"name": "time"}, "sensor 'time' is defined twice"),
        (sensor("gyro", "arm") | {"name": "arm_angle"}, "signal arm_angle would be one of body 'arm' and of sensor"),
        (sensor("heat", "arm"), "kind"),
    ],
)
def test_what_no_sensor_can_read_is_refused_in_a_sentence(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(MechanismError) as error:
        with_sensors(loads(ARM), fields)
    assert message in str(error.value)


@pytest.mark.parametrize("lacking", ["youngs_modulus", "section"])
def test_a_gauge_needs_to_know_its_bar(lacking: str) -> None:
    bare = "\n".join(line for line in ARM.splitlines() if not line.startswith(lacking))
    with pytest.raises(MechanismError, match=f"its strain needs the {lacking} of body 'arm'; give it"):
        with_sensors(loads(bare), sensor("strain", "arm", point=(0.1, 0.0)))


def test_a_torque_is_read_where_one_passes() -> None:
    with pytest.raises(MechanismError, match="joint 'A' is a pin without a motor and passes no torque"):
        with_sensors(load("slider-crank"), sensor("torque", "rod", point="A"))


# ---------------------------------------------------------------- faults of sensors


def mounted() -> Experiment:
    """The four-bar at two speeds with a chip, a gyro, a load cell and a draw wire."""
    m = with_sensors(
        four_bar(),
        sensor("accelerometer", "coupler", point=(0.05, 0.0), axis=(0.0, 1.0)),
        sensor("gyro", "coupler"),
        sensor("force", "follower", point="E"),
        sensor("distance", "coupler", to="ground.E"),
    )
    noise = {"crank_angle": 5e-5, "accelerometer": 0.02, "gyro": 0.005, "force": 0.05, "distance": 1e-5}
    return experiment(mechanism=m, sensors=noise)


FAULTS = (
    ("sensor_place", "accelerometer", {"along": 4e-3}),
    ("axis_error", "accelerometer", {"rotation": -0.02}),
    ("sensor_bias", "gyro", {"bias": 0.05}),
    ("sensor_gain", "force", {"gain_error": 0.03}),
    ("sensor_delay", "accelerometer", {"delay": 3e-3}),
    ("sensor_lag", "gyro", {"time_constant": 4e-3}),
    ("sensor_drift", "distance", {"drift": 2e-4}),
)


@pytest.mark.exudyn
@pytest.mark.slow
@pytest.mark.parametrize(("name", "where", "values"), FAULTS)
def test_a_fault_of_a_sensor_is_found_among_the_faults_of_all(name: str, where: str, values: dict[str, float]) -> None:
    """Data of Exudyn; of what it is told to look for are a longer coupler and all of these faults of all sensors."""
    only = ("link_length", *dict.fromkeys(fault for fault, _, _ in FAULTS))
    result = diagnosed(played(mounted(), wrong(name, where, **values)), only=only)
    assert_recovered(result, wrong(name, where, **values))
    assert {effect["kind"] for effect in result["effects"]} == {"sensor"}


def test_a_chip_that_sits_elsewhere_is_the_one_that_the_file_puts_there() -> None:
    """Of both effects of its mounting, from a named point and along a turned axis; other sensors stay."""
    m = mounted().nominal
    chip = {"name": "accelerometer", "kind": "accelerometer", "body": "coupler"}
    for effect, value, written in (
        ("sensor_place", {"along": 0.01}, chip | {"point": (0.06, 0.0), "axis": (0.0, 1.0)}),
        ("axis_error", {"rotation": np.pi / 2}, chip | {"point": (0.05, 0.0), "axis": (-1.0, 0.0)}),
    ):
        moved = VOCABULARY[effect].on_mechanism(m, "accelerometer", value)
        expected = m.replace(sensors=(written, *m.sensors[1:]))
        found, wanted = (lc.analyse(each).signals for each in (moved, expected))
        for one in m.sensors:
            np.testing.assert_allclose(found[one.name], wanted[one.name], atol=1e-12, err_msg=one.name)
        assert np.abs(found["accelerometer"] - lc.analyse(m).signals["accelerometer"]).max() > 0.01


@pytest.mark.mujoco
def test_a_baseline_keeps_sensors_to_their_own_digits(tmp_path: Path) -> None:
    """A strain of 5e-5 has as many as a force; one that is 2 permille off has moved."""
    pytest.importorskip("mujoco")
    m = with_sensors(loads(ARM), sensor("strain", "arm", point=(0.1, 0.005)), sensor("force", "arm", point="O"))
    (tmp_path / "arm.toml").write_text(dumps(m), encoding="utf-8")
    asked = ["--case", "arm.toml", "--simulator", "mujoco", "--baselines", "kept"]
    assert compare("baseline", "update", *asked, cwd=tmp_path).returncode == 0
    assert compare("baseline", "check", *asked, cwd=tmp_path).returncode == 0
    (tmp_path / "arm.toml").write_text(dumps(m.with_body("arm", youngs_modulus=1.996e11)), encoding="utf-8")
    moved = compare("baseline", "check", *asked, cwd=tmp_path)
    assert moved.returncode == 1
    assert "strain moved by" in moved.stdout
    assert "force moved" not in moved.stdout

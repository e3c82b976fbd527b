"""Velocities, accelerations and drive power: closed forms, differences of positions, the power balance, every engine in
every case; and that they are there only where they are asked for.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import linkage_crosscheck as lc
from analytic.kinematics.assembly import Assembly
from analytic.mechanism import Mechanism
from analytic.mechanism.file import load, shipped_cases
from analytic.mechanism.signals import named
from analytic.paper.clearance import displaced
from commands import compare
from compare.crosscheck import crosscheck_job, job_of
from compare.faults import ArgumentError
from compare.judge.reference import Reference, reference
from compare.questions.crosscheck import CrosscheckQuestion
from compare.report import analysis_figures, crosscheck_figures
from compare.report.peaks import peaks
from compare.report.summary import summarise
from diagnosis_rigs import assert_recovered, diagnosed, experiment, played, wrong
from linkages import inverted_slider
from marks import slow, slow_but
from sim_models.engine import ENGINES, JointModel
from tests.evidence.scoreboard.sizes import Planted

TURN = np.radians(np.arange(0.0, 360.0, 7.5))


def on_request(m: Mechanism) -> set[str]:
    """The names of all signals on request."""
    return {name for name, signal in named(m.bodies, m.joints, m.drives, m.sensors).items() if signal.on_request}


# ---------------------------------------------------------------- closed forms


def test_the_slider_of_a_slider_crank_moves_as_its_closed_form_says() -> None:
    """x = r cos t + l cos b with sin b = -(r / l) sin t, differentiated by hand."""
    r, length, omega = 0.05, 0.12, load("slider-crank").speed or 0.0
    found = lc.analyse("slider-crank", angles=TURN, signals="all").signals
    b = np.arcsin(-r / length * np.sin(TURN))
    b1 = -r * np.cos(TURN) * omega / (length * np.cos(b))
    b2 = (r * omega**2 * np.sin(TURN) + length * b1**2 * np.sin(b)) / (length * np.cos(b))
    velocity = -r * omega * np.sin(TURN) - length * b1 * np.sin(b)
    acceleration = -r * omega**2 * np.cos(TURN) - length * (b2 * np.sin(b) + b1**2 * np.cos(b))
    for name in ("slider_velocity_x", "velocity_S"):
        np.testing.assert_allclose(found[name], velocity, atol=1e-12 * r * omega)
    for name in ("slider_acceleration_x", "acceleration_S"):
        np.testing.assert_allclose(found[name], acceleration, atol=1e-11 * r * omega**2)
    np.testing.assert_allclose(found["rod_angular_acceleration"], b2, atol=1e-11 * omega**2)
    np.testing.assert_allclose(found["acceleration_A"], b2, atol=1e-11 * omega**2)  # the crank turns evenly
    np.testing.assert_allclose(found["crank_acceleration_x"], -r / 2 * omega**2 * np.cos(TURN), rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(found["drive_power"], omega * found["drive_torque"], rtol=1e-12)


def test_the_four_bar_turns_as_its_loop_says() -> None:
    """Angular accelerations of coupler and follower by Cramer's rule on the loop, differentiated twice by hand."""
    r2, r3, r4, omega = 0.05, 0.12, 0.10, load("crank-rocker").speed or 0.0
    found = lc.analyse("crank-rocker", angles=TURN, signals="all").signals
    t2, t3, t4 = TURN, found["coupler_angle"], found["follower_angle"]
    w3 = r2 * omega * np.sin(t4 - t2) / (r3 * np.sin(t3 - t4))
    w4 = r2 * omega * np.sin(t2 - t3) / (r4 * np.sin(t4 - t3))
    a3 = (-r2 * omega**2 * np.cos(t2 - t4) - r3 * w3**2 * np.cos(t3 - t4) + r4 * w4**2) / (r3 * np.sin(t3 - t4))
    a4 = (r2 * omega**2 * np.cos(t2 - t3) + r3 * w3**2 - r4 * w4**2 * np.cos(t4 - t3)) / (r4 * np.sin(t4 - t3))
    np.testing.assert_allclose(found["coupler_angular_acceleration"], a3, atol=1e-10 * omega**2)
    np.testing.assert_allclose(found["follower_angular_acceleration"], a4, atol=1e-10 * omega**2)
    np.testing.assert_allclose(found["acceleration_B"], a4 - a3, atol=1e-10 * omega**2)
    np.testing.assert_allclose(found["velocity_B"], w4 - w3, atol=1e-11 * omega)
    middle = r4 / 2 * (1j * a4 - w4**2) * np.exp(1j * t4)
    np.testing.assert_allclose(found["follower_acceleration_x"], middle.real, atol=1e-11 * omega**2)
    np.testing.assert_allclose(found["follower_acceleration_y"], middle.imag, atol=1e-11 * omega**2)


# ---------------------------------------------------------------- the second road: positions

CENTRAL = {  # differences of sixth order over seven instants, by order of the derivative
    1: np.array([-1 / 60, 3 / 20, -3 / 4, 0, 3 / 4, -3 / 20, 1 / 60]),
    2: np.array([1 / 90, -3 / 20, 3 / 2, -49 / 18, 3 / 2, -3 / 20, 1 / 90]),
}


def found_by(m: Mechanism) -> Iterator[tuple[str, str, int]]:
    """Each rate and acceleration, the signal whose derivative it is, and of which order."""
    for body in (b.name for b in m.bodies):
        yield f"{body}_angular_acceleration", f"{body}_angle", 2
        for axis in "xy":
            yield f"{body}_velocity_{axis}", f"{body}_{axis}", 1
            yield f"{body}_acceleration_{axis}", f"{body}_{axis}", 2
    for joint in (j.name for j in m.joints):
        yield f"velocity_{joint}", f"position_{joint}", 1
        yield f"acceleration_{joint}", f"position_{joint}", 2


def inverted(marker: tuple[float, float] = (0.03, 0.01)) -> Mechanism:
    """A slide that turns, which gives its travel Coriolis' acceleration, and a body whose marker is not its com."""
    m = inverted_slider()
    return m.replace(bodies=[b.model_copy(update={"marker": marker}) for b in m.bodies])


@pytest.mark.parametrize(
    ("m", "gap", "within"),
    [
        (load("paper"), 0.0, 2e-6),
        (load("paper"), 1e-3, 1e-5),  # its pin's own motion in its bearing comes from differences over 2e-3 rad
        (load("six-bar"), 0.0, 2e-6),
        (inverted(), 0.0, 2e-6),
    ],
    ids=["paper", "paper with clearance", "six-bar", "inverted slider"],
)
def test_rates_are_those_of_the_positions(m: Mechanism, gap: float, within: float) -> None:
    assembly, speed, h = Assembly(m), m.speed or 1.0, 1e-3 / (m.speed or 1.0)
    theta = np.radians(np.arange(40.0, 140.0, 9.0))
    loose = {"B": gap} if gap else {}
    around = [displaced(assembly, theta + k * h * speed, speed, clearances=loose).signals() for k in range(-3, 4)]
    rates = displaced(assembly, theta, speed, clearances=loose).rates()

    derived = [*found_by(m)]
    assert {name for name, _, _ in derived} == on_request(m) - {"drive_power"}
    for name, of, order in derived:
        by_positions = CENTRAL[order] @ np.array([each[of] for each in around]) / h**order
        scale = max(float(np.max(np.abs(rates[name]))), 0.1 * speed**order * max(b.length for b in m.bodies))
        np.testing.assert_allclose(rates[name], by_positions, atol=within * scale, err_msg=name)


def test_what_the_drive_gives_is_what_the_linkage_takes() -> None:
    """Power of the drive, of the weight and of the load make up the change of the kinetic energy."""
    m = load("paper").replace(gravity=(0.0, -9.81))
    found = lc.analyse(m, angles=np.radians(np.arange(20.0, 161.0, 5.0)), signals="all", clearance={"B": 0.0}).signals
    energy, given = 0.0, found["drive_power"].copy()
    for body in m.bodies:
        name = body.name
        velocity = found[f"{name}_velocity_x"] + 1j * found[f"{name}_velocity_y"]  # of its marker: the com, here
        acceleration = found[f"{name}_acceleration_x"] + 1j * found[f"{name}_acceleration_y"]
        energy = energy + body.mass * (velocity.conj() * acceleration).real
        energy = energy + body.moment_of_inertia * (
            found[f"{name}_angular_velocity"] * found[f"{name}_angular_acceleration"]
        )
        given += -9.81 * body.mass * velocity.imag
    for load_on in m.loads:
        push = complex(*load_on.force)
        velocity = found[f"{load_on.body}_velocity_x"] + 1j * found[f"{load_on.body}_velocity_y"]
        given += (push.conjugate() * velocity).real
    assert np.ptp(found["drive_power"]) > 10
    np.testing.assert_allclose(given, energy, atol=1e-12 * float(np.ptp(found["drive_power"])))


# ---------------------------------------------------------------- engines


@pytest.mark.long_rows("dart-3-rpr", "pybullet-3-rpr", "pybullet-paper", "mujoco-3-rpr", "exudyn-3-rpr", "dart-paper")
@pytest.mark.parametrize("case", slow_but(["paper", "3-rpr"], shipped_cases()))
@pytest.mark.parametrize("name", ENGINES)
def test_engines_report_their_own_solvers_accelerations(name: str, case: str) -> None:
    """Every signal on request, by every engine, within the tolerances of the signals that it always has."""
    pytest.importorskip({"dart": "dartpy"}.get(name, name))
    m = load(case)
    how = {} if m.cranked and m.speed else {"times": np.linspace(0.0, 0.3, 7)}
    result = lc.crosscheck(m, simulator=name, joint_model="ideal", signals="all", **how)
    run = result.runs[0]
    assert run.verdict == "agrees", [d for d in run.discrepancies if d.verdict != "agrees"]
    assert on_request(m) <= run.simulated.keys()
    prescribed = 3 if m.cranked and m.motors else 0  # of the crank: its acceleration, and its joint's rates
    assert len({d.signal for d in run.discrepancies} & on_request(m)) == len(on_request(m)) - prescribed


@pytest.mark.long_rows("pybullet-0.0001", "dart-0.0001", "exudyn-0.0001")
@pytest.mark.parametrize("clearance", [0.0, 1e-4])
@pytest.mark.parametrize("name", ENGINES)
def test_an_engines_accelerations_are_those_of_its_own_positions(name: str, clearance: float) -> None:
    """By differences over seven of its reports: markers off the centre of mass, a slide on a body that turns, a pin
    that moves in its bearing.
    """
    pytest.importorskip({"dart": "dartpy"}.get(name, name))
    m = load("crank-rocker").with_clearances({"B": clearance}) if clearance else inverted()
    h, speed = np.radians(1.0), m.speed or 0.0
    joints: JointModel = "spring-damper" if clearance else "ideal"
    angles = np.radians(75.0) + h * np.arange(-3, 4)
    found = lc.simulate(m, simulator=name, joint_model=joints, signals="all", angles=angles)
    length = max(b.length for b in m.bodies)
    for signal, of, order in found_by(m):
        scale = abs(speed) ** order * (length if found.kinds[signal].unit in ("m/s", "m/s^2") else 1.0)
        by_positions = CENTRAL[order] @ found[of] / (h / speed) ** order
        assert abs(found[signal][3] - by_positions) < 1e-4 * scale, signal


@pytest.mark.long_rows("follower_acceleration_x", "drive_power")
@pytest.mark.parametrize("signal", ["follower_acceleration_x", "velocity_B", "drive_power", "coupler_velocity_y"])
def test_a_side_that_errs_by_a_hundredth_is_found(signal: str) -> None:
    pytest.importorskip("mujoco")

    def wrong(*asked: Any) -> Reference:
        side = reference(*asked, more=[signal])
        return replace(side, signals={**side.signals, signal: 1.01 * side.signals[signal]})

    job = job_of(CrosscheckQuestion("crank-rocker", "mujoco", joint_model="ideal", signals="all"))
    run = crosscheck_job(job, measure=wrong).runs[0]
    assert [d.signal for d in run.discrepancies if d.verdict == "disagrees"] == [signal]


# ---------------------------------------------------------------- columns of a file


@pytest.fixture(scope="module")
def columns() -> Mapping[str, np.ndarray]:
    """What a rig with a velocity sensor and an accelerometer on its follower would write, by heading."""
    pytest.importorskip("mujoco")
    found = lc.simulate("crank-rocker", signals="all", angles=np.radians(np.arange(20.0, 160.0, 2.0)))
    signals, speed = found.signals, load("crank-rocker").speed or 0.0
    return {
        "time [s]": (found.crank_angle - found.crank_angle[0]) / speed,
        "crank_angle [deg]": np.degrees(found.crank_angle),
        "follower_velocity_x [mm/s]": 1e3 * signals["follower_velocity_x"],
        "follower_acceleration_y [g]": signals["follower_acceleration_y"] / 9.80665,
    }


def test_a_file_is_checked_by_its_velocities_and_accelerations(columns: Mapping[str, np.ndarray]) -> None:
    run = lc.check({"rig": columns}, "crank-rocker").runs[0]
    assert {d.signal: d.verdict for d in run.discrepancies} == {
        "follower_velocity_x": "agrees",
        "follower_acceleration_y": "agrees",
    }


def test_an_accelerometer_of_another_size_is_found(columns: Mapping[str, np.ndarray]) -> None:
    off = {name: 1.02 * each if "acceleration" in name else each for name, each in columns.items()}
    run = lc.check({"rig": off}, "crank-rocker").runs[0]
    assert [d.signal for d in run.discrepancies if d.verdict == "disagrees"] == ["follower_acceleration_y"]


def test_an_acceleration_in_another_unit_is_said(columns: Mapping[str, np.ndarray]) -> None:
    other = {name.replace("[g]", "[m/s^2]"): each for name, each in columns.items()}
    result = lc.check({"rig": other}, "crank-rocker")
    assert result.verdict == "disagrees"
    assert any("in g" in warning for warning in result.warnings)


# ---------------------------------------------------------------- sensors of a diagnosis

RATES = {
    "crank_angle": 5e-5,
    "drive_torque": 1e-3,
    "follower_acceleration_x": 0.02,
    "coupler_velocity_x": 5e-4,
    "velocity_B": 2e-3,
}
FAULTS = [
    wrong("sensor_bias", "follower_acceleration_x", bias=0.1),
    wrong("sensor_gain", "follower_acceleration_x", gain_error=0.03),
    wrong("sensor_lag", "follower_acceleration_x", time_constant=4e-3),
    wrong("sensor_drift", "coupler_velocity_x", drift=4e-3),
    wrong("sensor_delay", "velocity_B", delay=2e-3),
    wrong("link_length", "follower", length_error=5e-4),
]


def test_a_rig_as_it_is_believed_to_be_has_no_gap_by_its_rates() -> None:
    result = diagnosed(played(experiment(sensors=RATES)))
    assert result["verdict"] == "no gap"
    assert result["gap"]["before"] == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("fault", slow(*FAULTS))
def test_what_is_wrong_is_told_by_rates(fault: Planted) -> None:
    assert_recovered(diagnosed(played(experiment(sensors=RATES), fault)), fault)


# ---------------------------------------------------------------- on request


def test_results_hold_them_only_where_they_are_asked_for() -> None:
    m = load("paper")
    usual, more = lc.analyse(m), lc.analyse(m, signals=["follower_velocity_x", "drive_power"])
    assert not usual.signals.keys() & on_request(m)
    assert more.signals.keys() - usual.signals.keys() == {"follower_velocity_x", "drive_power"}
    assert more.extremes.keys() - usual.extremes.keys() == {"follower_velocity_x", "drive_power"}
    assert lc.analyse(m, signals="all").signals.keys() - usual.signals.keys() == on_request(m)
    assert more.units()["drive_power"] == "W"
    assert more.units()["follower_velocity_x"] == "m/s"


@pytest.mark.parametrize("asked", ["follower_velocity_z", ["drive_powr"]])
def test_an_unknown_signal_is_refused_with_the_one_that_was_meant(asked: str | list[str]) -> None:
    meant = {"follower_velocity_z": "follower_velocity_", "drive_powr": "drive_power"}
    with pytest.raises(ArgumentError, match=meant[asked if isinstance(asked, str) else asked[0]]):
        lc.analyse("paper", signals=asked)


def test_pages_and_tables_show_them_only_where_they_are_asked_for(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    for asked in (None, ["follower_acceleration_x", "drive_power"]):
        result = lc.crosscheck("crank-rocker", simulator="mujoco", joint_model="ideal", signals=asked)
        summary = summarise(result)
        shown = {quantity.signal for quantity in summary.keys()}
        drawn = {figure.name for figure in crosscheck_figures.figures(summary)}
        assert shown & on_request(result.mechanism) == set(asked or ())
        assert drawn & on_request(result.mechanism) == set(asked or ())
        side = lc.analyse("crank-rocker", signals=asked)
        assert {each.quantity.signal for each in peaks(side)} & on_request(side.mechanism) == set(asked or ())
        asked_for = {figure.name for figure in analysis_figures.figures(side) if figure.name.startswith("asked")}
        assert asked_for == ({"asked_acceleration"} if asked else set())


def test_a_baseline_keeps_what_an_update_was_asked_for(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    case = ("--case", "pendulum", "--simulator", "mujoco")
    asked = ("--signals", "pendulum_angle,drive_torque,pendulum_velocity_x,acceleration_O")
    tight = compare("baseline", "update", *case, "--signals", "clearance_O_x", cwd=tmp_path)
    assert tight.returncode == 2
    assert "no run of pendulum in mujoco that moves has clearance_O_x; leave it out" in tight.stderr
    assert compare("baseline", "update", *case, *asked, cwd=tmp_path).returncode == 0
    path = tmp_path / "reports" / "baselines" / "pendulum-mujoco.toml"
    written = path.read_text(encoding="utf-8")
    kept = '"pendulum_angle [rad]", "drive_torque [N.m]", "pendulum_velocity_x [m/s]", "acceleration_O [rad/s^2]"]'
    assert kept in written
    assert compare("baseline", "update", *case, cwd=tmp_path).returncode == 0  # which asks for no others
    assert path.read_text(encoding="utf-8") == written
    assert compare("baseline", "check", *case, cwd=tmp_path).returncode == 0
    rows = tomllib.loads(written)["run"][0]["rows"]
    peak, last = max(abs(row[-1]) for row in rows), rows[-1][-1]
    at = re.escape(f"{last}") + r"0*\],\n\]"
    moved, times = re.subn(at, f"{last + 2e-4 * peak:.6f}],\n]", written, count=1)
    assert times == 1
    path.write_text(moved, encoding="utf-8")
    done = compare("baseline", "check", *case, cwd=tmp_path)
    assert done.returncode == 1
    assert "acceleration_O moved" in done.stdout
    assert "--signals pendulum_angle,drive_torque,pendulum_velocity_x,acceleration_O --baselines moved" in done.stdout
    assert compare("baseline", "check", *case, *asked, cwd=tmp_path).returncode == 2


def test_nothing_moves_at_rest() -> None:
    with pytest.raises(ArgumentError, match="nothing moves in static motion"):
        lc.crosscheck("paper", motion="static", signals="all")


def test_a_command_takes_their_names(tmp_path: Path) -> None:
    said = compare("analyse", "--case", "paper", "--signals", "acceleration_B", "--json", cwd=tmp_path)
    assert '"acceleration_B"' in said.stdout
    assert '"acceleration_A"' not in said.stdout

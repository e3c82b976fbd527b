"""Soft bearings: pins that give by their reaction over a radial stiffness, against other roads to the same answer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize, root

import linkage_crosscheck as lc
from analytic.beyond_paper.drive import Motor
from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import kinematics
from analytic.kinematics.schedule import Steady
from analytic.mechanism import Elasticity, Mechanism, MechanismError
from analytic.mechanism.file import load
from analytic.paper.clearance import displaced
from analytic.paper.compliance import compliance
from asked import request_of
from compare.diagnose.predict import _balanced
from compare.faults import ArgumentError
from marks import slow
from sim_models.common.health import Implausible, check
from sim_models.engine import ENGINES, Motion, Trace, Unsupported, engine

TURN = np.radians(np.arange(5.0, 365.0, 20.0))
ROCKER = load("crank-rocker").rigid().replace(
    gravity=(0.0, -9.81), loads=[{"body": "coupler", "force": (5.0, -30.0)}]
)  # fmt: skip
PINS = ("D", "A", "B", "E")


def turned_at(m: Mechanism, speed: float, **drive: float) -> Mechanism:
    assert m.drive is not None
    return m.replace(drive=m.drive.model_dump(exclude_unset=True) | {"speed": speed} | drive)


def soft(*joints: str, stiffness: float = 1e5, m: Mechanism = ROCKER) -> Mechanism:
    for name in joints:
        m = m.with_joint(name, radial_stiffness=stiffness)
    return m


# ---------------------------------------------------------------- the analytic model


def slider_crank_on_a_spring(speed: float, stiffness: float) -> tuple[np.ndarray, np.ndarray]:
    """Crank angles (rad) and the gap (m) in joint A of the shipped slider-crank at a constant speed (rad/s): the
    periodic solution of the two equations of motion of slide and rod, hung on a spring (N/m), as a Fourier series.
    """
    crank, rod, rod_mass, slider_mass, inertia, count = 0.05, 0.12, 0.21, 0.14, 2.5e-4, 96
    theta = 2 * np.pi * np.arange(count) / count
    waves = 1j * np.fft.fftfreq(count, 1 / count)[:, None]
    rate = speed * np.fft.ifft(waves * np.fft.fft(np.eye(count), axis=0), axis=0).real

    def gap(state: np.ndarray) -> np.ndarray:
        return crank * np.exp(1j * theta) - (state[:count] - rod * np.exp(1j * state[count:]))

    def off(state: np.ndarray) -> np.ndarray:
        slide, angle = state[:count], state[count:]
        turning, spin_up, along = rate @ angle, rate @ rate @ angle, np.exp(1j * angle)
        acceleration = rate @ rate @ slide - rod / 2 * (1j * spin_up - turning**2) * along
        force = stiffness * gap(state)
        on_slide = force.real - rod_mass * acceleration.real - slider_mass * (rate @ rate @ slide)
        about = (np.conj(-1j * rod * along) * force).real - inertia * spin_up
        on_angle = about - rod_mass * (np.conj(-1j * rod / 2 * along) * acceleration).real
        return np.concatenate([on_slide, on_angle / rod]) / (stiffness * crank)

    angle = np.arcsin(-crank / rod * np.sin(theta))
    start = np.concatenate([crank * np.cos(theta) + rod * np.cos(angle), angle])
    found = root(off, start, tol=1e-13)
    assert np.abs(found.fun).max() < 1e-12
    return theta, gap(found.x)


@pytest.mark.parametrize(
    ("stiffness", "gives", "accuracy"), [(1e8, 6.2e-5, 1e-6), (3e7, 2.1e-4, 3e-5), (1e7, 6.3e-4, 2e-3)]
)
def test_a_fast_slider_crank_moves_as_its_equations_of_motion_with_a_spring(
    stiffness: float, gives: float, accuracy: float
) -> None:
    """At 5000 rpm; two terms of the inertia of what the bearing gives leave the third power of it, and more where a
    harmonic is near the linkage's own frequency.
    """
    m = load("slider-crank")
    assert m.speed is not None
    theta, gap = slider_crank_on_a_spring(m.speed, stiffness)
    found = displaced(Assembly(soft("A", stiffness=stiffness, m=m)), theta, m.speed)
    size = np.abs(gap).max()
    assert size == pytest.approx(gives, rel=0.02)
    assert not found.flags
    assert np.abs(found.gaps["A"] - gap).max() < accuracy * size
    assert np.abs(found.reactions.forces["A"] - stiffness * gap).max() < accuracy * stiffness * size


def test_a_linkage_that_sways_in_its_bearing_is_flagged() -> None:
    m = turned_at(load("slider-crank"), 20.0)
    found = displaced(Assembly(soft("A", stiffness=1e3, m=m)), TURN, 20.0)
    assert "so soft that the linkage sways" in next(iter(found.flags.values()))
    assert not displaced(Assembly(soft("A", stiffness=1e5, m=m)), TURN, 20.0).flags


def test_small_displacements_at_rest_are_those_of_the_stiffness_matrix() -> None:
    """Eq. 4's springs, linear about the ideal linkage; what is left is of second order."""
    assembly, apart = Assembly(ROCKER), []
    for stiffness in (1e6, 1e7):
        found = displaced(Assembly(soft(*PINS, stiffness=stiffness)), TURN, 1.0, inertia=False)
        springs = Elasticity(translation=stiffness, rotation=1e9)
        elastic = Assembly(
            ROCKER.replace(joints=tuple(j.model_copy(update={"elasticity": springs}) for j in ROCKER.joints))
        )
        linear = compliance(kinematics(elastic, TURN, 1.0)).displacement("coupler", "B")
        place = kinematics(assembly, TURN, 1.0).position("coupler", "B")
        moved = found.configuration.motion.position("coupler", "B") - place
        apart.append(np.abs(moved - linear).max() / np.abs(linear).max())
    assert apart[0] < 2e-3
    assert apart[0] / apart[1] == pytest.approx(10.0, rel=0.05)


def test_pins_rest_where_the_energy_of_loads_and_bearings_is_least() -> None:
    m, stiffness = load("paper"), {"A": 2e3, "B": 5e3}
    for name, size in stiffness.items():
        m = m.with_joint(name, radial_stiffness=size)
    assembly, theta = Assembly(m.with_clearances({})), np.radians([40.0])
    found = displaced(assembly, theta, 1.0, inertia=False)

    def energy(x: np.ndarray) -> float:
        gaps = {name: np.array([1e-2 * complex(*x[2 * k :][:2])]) for k, name in enumerate(stiffness)}
        columns = assembly.columns(assembly.coordinates(theta, gaps), gaps)
        held = sum(k * abs(gaps[name][0]) ** 2 / 2 for name, k in stiffness.items())
        return float(held) - 50.0 * float((assembly.structure.form("coupler") @ columns)[0].imag)

    lowest = minimize(energy, np.zeros(4), method="BFGS", options={"gtol": 1e-10})
    gaps = [part for name in stiffness for part in (found.gaps[name][0].real, found.gaps[name][0].imag)]
    assert np.abs(gaps).max() > 5e-3
    np.testing.assert_allclose(1e-2 * lowest.x, gaps, atol=1e-7)
    assert not found.flags


@pytest.mark.parametrize("inertia", [True, False])
def test_a_soft_bearing_with_clearance_gives_beyond_its_rim(inertia: bool) -> None:
    m = soft("B").with_joint("B", clearance=2e-4)
    found = displaced(Assembly(m), TURN, 12.0, inertia=inertia)
    force = found.reactions.forces["B"]
    np.testing.assert_allclose(found.gaps["B"], (2e-4 / np.abs(force) + 1e-5) * force, rtol=1e-8)
    assert not found.flags


def test_a_drive_that_yields_carries_what_its_soft_linkage_needs() -> None:
    m = turned_at(soft("B"), 12.0, stiffness=500.0)
    assembly, time = Assembly(m), np.linspace(0.0, 0.5, 40)
    motor = Motor(Steady(0.4, 12.0))
    crank = motor.crank(time, 500.0, lambda turning: _balanced(assembly, turning).drive_torque, True)
    found = displaced(assembly, crank.theta, crank.omega, alpha=crank.alpha).configuration.drive_torque
    np.testing.assert_allclose(500.0 * (0.4 + 12.0 * time - crank.theta), found, atol=1e-4 * np.abs(found).max())


# ---------------------------------------------------------------- what is refused


def test_a_slide_has_no_radial_stiffness() -> None:
    with pytest.raises(MechanismError, match=r"radial_stiffness is 1000\.0; only a revolute joint has one"):
        load("slider-crank").with_joint("S", radial_stiffness=1e3)


def test_what_cannot_be_compared_is_refused_in_a_sentence() -> None:
    with pytest.raises(ArgumentError, match="swings freely, and there is no analytic model"):
        lc.crosscheck(load("pendulum").with_joint("O", radial_stiffness=1e5), simulator="mujoco")
    with pytest.raises(ArgumentError, match="leave one of them out"):
        lc.crosscheck(soft("B").with_joint("B", clearance=1e-4), simulator="mujoco")


@pytest.mark.parametrize("name", ENGINES)
def test_what_an_engine_cannot_do_with_a_soft_bearing_it_says(name: str) -> None:
    chosen, both = engine(name), turned_at(soft("B"), 12.0).with_joint("B", clearance=1e-4)
    free = request_of(load("pendulum").with_joint("O", radial_stiffness=1e5), time=np.array([0.1]))
    with pytest.raises(Unsupported, match="a released linkage has no soft bearings"):
        chosen.simulate(free)
    if ("massless-link", "static") in chosen.capabilities.runs:
        with pytest.raises(Unsupported, match="a massless link does not give"):
            chosen.simulate(request_of(both, "massless-link", "static", TURN))
    if name in ("pybullet", "dart"):
        with pytest.raises(Unsupported, match="its contact is rigid"):
            chosen.simulate(request_of(both, "contact", "static", TURN))


# ---------------------------------------------------------------- engines


def worst(trace: Trace, m: Mechanism, motion: Motion, kind: str) -> float:
    """The largest difference of signals of a kind, of the largest of them."""
    speed = m.speed if motion == "driven" else 1.0
    clearances = None if trace.clearance else {}
    found = displaced(Assembly(m), trace.crank_angle, speed or 1.0, inertia=motion == "driven", clearances=clearances)
    assert not found.flags
    truth = {name: values for name, values in found.signals().items() if kind in name}
    apart = max(float(np.abs(trace.signals[name] - values).max()) for name, values in truth.items())
    return apart / max(float(np.abs(values).max()) for values in truth.values())


@pytest.mark.long_rows("B-exudyn")
@pytest.mark.parametrize("name", ["mujoco", "exudyn", *slow("pybullet", "dart")])
@pytest.mark.parametrize("joints", ["B", *slow("D", "AB")])
def test_pins_give_in_an_engine_as_in_the_model(name: str, joints: str) -> None:
    """0.2 mm; rigid bearings would be off by 3e-3 of the reactions.  In motion dampers hold 2e-4 of the gap."""
    m = turned_at(soft(*joints), 12.0)
    still, moving = (engine(name).simulate(request_of(m, "ideal", motion, TURN)) for motion in ("static", "driven"))
    for kind in ("clearance", "reaction", "drive_torque"):
        assert worst(still, m, "static", kind) < 1e-8
    assert worst(moving, m, "driven", "clearance") < 5e-4
    assert worst(moving, m, "driven", "reaction") < 1e-4
    assert worst(moving, m, "driven", "drive_torque") < 1e-4


@pytest.mark.long_rows("A-mujoco", "A-pybullet")
@pytest.mark.parametrize("name", ENGINES)
@pytest.mark.parametrize("joint", ["A", *slow("B")])
def test_a_bearing_gives_beside_a_gap_and_beyond_its_own(name: str, joint: str) -> None:
    m = turned_at(soft(joint), 12.0).with_joint("B", clearance=2e-4)
    trace = engine(name).simulate(request_of(m, "spring-damper", "static", TURN))
    assert worst(trace, m, "static", "reaction") < 3e-6  # of which the contact gives 8e-4 of the clearance
    assert worst(trace, m, "static", "clearance") < 1e-3


@pytest.mark.filterwarnings("ignore::analytic.mechanism.MechanismWarning")
@pytest.mark.parametrize("name", ENGINES)
def test_a_small_and_a_large_linkage_give_alike(name: str) -> None:
    """Engines are given other units; at rest a linkage of another size under the same forces has other angles only by
    what its bearings give.
    """
    for scale in (1e-3, 1e3):

        def sized(points: dict[str, tuple[float, float]], by: float = scale) -> dict[str, tuple[float, float]]:
            return {point: (x * by, y * by) for point, (x, y) in points.items()}

        m = soft("B", stiffness=1e5 / scale)
        m = m.replace(
            ground=m.ground.model_copy(update={"points": sized(dict(m.ground.points))}),
            bodies=tuple(b.model_copy(update={"points": sized(dict(b.points))}) for b in m.bodies),
        )
        trace = engine(name).simulate(request_of(m, "ideal", "static", TURN))
        assert worst(trace, m, "static", "clearance") < 1e-6
        assert np.abs(trace.signals["clearance_B_x"]).max() == pytest.approx(1.07e-4 * scale, rel=0.2)


@pytest.mark.mujoco
def test_a_bearing_that_gives_otherwise_than_it_is_stiff_is_implausible() -> None:
    m = turned_at(soft("B"), 12.0)
    for motion in ("static", "driven"):
        request = request_of(m, "ideal", motion, TURN)
        trace = engine("mujoco").simulate(request)
        check(request, trace)
        with pytest.raises(Implausible, match="the bearing of joint 'B' does not give as it is stiff"):
            check(replace(request, mechanism=m.with_joint("B", radial_stiffness=1.01e5)), trace)


@pytest.mark.mujoco
@pytest.mark.exudyn
def test_a_cross_check_with_a_soft_bearing_agrees() -> None:
    m = turned_at(soft("A", "B"), 12.0)
    result = lc.crosscheck(m, simulator=["mujoco", "exudyn"], angles=TURN, workers=1)
    assert result.verdict == "agrees"
    assert {run.joint_model for run in result.runs} == {"ideal"}

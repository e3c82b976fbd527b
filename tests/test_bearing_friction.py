"""Friction that grows with a joint's reaction: a reaction touches the friction circle, by hand, by energy, by what
locks.
"""

from __future__ import annotations

import cProfile
import pstats
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from analytic.beyond_paper.freedom import Freedom
from analytic.beyond_paper.released import released
from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.motion import Motion as Moved
from analytic.kinematics.motion import kinematics
from analytic.mechanism import Drive, Load, Mechanism, MechanismError
from analytic.mechanism.file import dumps, load
from analytic.paper.clearance import Model, displaced
from analytic.paper.compliance import compliance
from analytic.paper.kinetostatics import kinetostatics
from asked import request_of
from commands import compare
from marks import slow
from multiplier_oracle import Oracle
from sim_models.engine import JointModel, Motion, engine

CRANK, ROD = 0.05, 0.12  # m
RADII = {"O": 3e-3, "A": 2e-3, "B": 1e-3}  # m
TURN = np.linspace(0.05, 6.2, 90)


def rubbed(m: Mechanism, radii: dict[str, float]) -> Mechanism:
    for name, radius in radii.items():
        m = m.with_joint(name, friction_radius=radius)
    return m


def moved(m: Mechanism, theta: np.ndarray = TURN, speed: float | None = None) -> Moved:
    return kinematics(Assembly(m), theta, m.speed if speed is None else speed)


def pressed_slider() -> Mechanism:
    """A slider-crank whose piston is pushed back by 1000 N."""
    return load("slider-crank").replace(loads=(Load(body="slider", force=(-1000.0, 0.0)),))


@pytest.mark.parametrize("speed", [1.0, -1.0])
def test_the_rods_force_is_tangent_to_its_friction_circles(speed: float) -> None:
    """The line of action is turned off the rod by sin b = (radii, each with its side) / length."""
    found = kinetostatics(moved(rubbed(pressed_slider(), RADII), speed=speed), inertia=False)
    along = -np.arcsin(CRANK / ROD * np.sin(TURN))
    turning = -speed * CRANK * np.cos(TURN) / (ROD * np.cos(along))
    at_pin = np.sign(turning - speed)
    line = along + np.arcsin((-RADII["A"] * at_pin - RADII["B"] * np.sign(turning)) / ROD)
    size = 1000.0 / np.cos(line)
    force = size * np.exp(1j * line)
    arm = (np.conj(CRANK * np.exp(1j * TURN)) * force).imag
    np.testing.assert_allclose(found.forces["B"], force, rtol=1e-12)
    np.testing.assert_allclose(
        found.drive_torque, arm - RADII["A"] * size * at_pin + RADII["O"] * size * np.sign(speed), atol=1e-11
    )


@pytest.mark.parametrize("name", ["crank-rocker", "slider-crank", "six-bar"])
@pytest.mark.parametrize("sign", [1, -1])
def test_the_drive_pays_what_the_bearings_take(name: str, sign: int) -> None:
    plain = load(name)
    m = rubbed(plain, {j.name: 2e-3 for j in plain.joints if not j.prismatic})
    speed = sign * (plain.speed or 1.0)
    without, found = (kinetostatics(moved(each, speed=speed)) for each in (plain, m))
    lost = sum(2e-3 * np.abs(found.forces[j.name]) * np.abs(found.motion.slip(j)) for j in m.load_rubbed)
    paid = (found.drive_torque - without.drive_torque) * speed
    np.testing.assert_allclose(paid, lost, atol=1e-12 * np.max(lost))
    assert np.max(lost) > 0.05 * np.abs(without.drive_torque * speed).max()


def test_a_linkage_whose_friction_turns_the_rod_across_its_slide_is_locked() -> None:
    """Driven backwards, at 60 deg both circles turn the rod's line away from the slide: it is across it where
    asin(radii / length) is what the rod itself lacks of a right angle.
    """
    m, at = pressed_slider(), np.radians([60.0])
    across = ROD * np.cos(np.arcsin(CRANK / ROD * np.sin(at[0])))
    found = kinetostatics(moved(rubbed(m, {"A": 0.6 * across, "B": 0.399 * across}), at, -1.0), inertia=False)
    assert 1e5 < np.abs(found.forces["B"][0]) < np.inf
    with pytest.raises(AssemblyError, match=r"locks the linkage at crank angle 60 deg; make friction_radius of") as no:
        kinetostatics(moved(rubbed(m, {"A": 0.6 * across, "B": 0.401 * across}), at, -1.0), inertia=False)
    assert no.value.at == pytest.approx(at[0])


def test_a_springy_drive_yields_to_the_friction_too() -> None:
    """Rigid links held by a spring: compliance turns the crank back by the drive torque over the stiffness."""
    m = rubbed(pressed_slider(), RADII).replace(drive=Drive(joint="O", speed=1.0, stiffness=1e4))
    motion = moved(m)
    turned = compliance(motion).rotation("crank", "A")
    np.testing.assert_allclose(turned, -kinetostatics(motion, inertia=False).drive_torque / 1e4, atol=1e-15)


def test_a_pin_with_clearance_follows_a_reaction_that_rubs() -> None:
    """The gap points where the reaction does that multipliers find with that gap, friction about its pin and all."""
    m = rubbed(load("crank-rocker"), {"B": 2e-3}).with_clearances({"B": 1e-4}).replace(gravity=(1.0, -9.81))
    oracle = Oracle(m.with_clearances({}))
    theta, q = (each[::5] for each in oracle.walk(1.0))
    found = displaced(Assembly(m), theta, m.speed or 1.0, inertia=False)
    assert not found.flags
    gaps = np.zeros((theta.size, len(oracle.pins), 2))
    gap = found.gaps["B"]
    gaps[:, [j.name for j in oracle.pins].index("B")] = np.stack([gap.real, gap.imag], axis=-1) / oracle.span
    right = oracle.solve(theta, oracle.closed(q, theta, gaps), inertia=False, gaps=gaps)
    np.testing.assert_allclose(right.forces["B"], np.abs(right.forces["B"]) * gap / 1e-4, atol=1e-8 * right.largest)
    np.testing.assert_allclose(found.reactions.drive_torque, right.torque, atol=1e-9 * right.largest * oracle.span)


@pytest.mark.parametrize("model", ["equilibrium", "first_order"])
def test_a_pin_with_clearance_lies_beside_its_reaction_and_is_rubbed_where_it_touches(model: Model) -> None:
    """Friction and push make the reaction, which touches the circle of radius r sin(arctan mu) about the pin, and of
    (r + c) sin(arctan mu) about the bearing: the gap between the centres is turned from it by the angle of friction.
    """
    mu, r, c = 0.3, 0.01, 1e-4
    plain = load("crank-rocker").replace(gravity=(1.0, -9.81))
    m = plain.with_joint("B", friction=mu, pin_radius=r, clearance=c)
    theta = np.radians(np.arange(5.0, 365.0, 20.0))
    found = displaced(Assembly(m), theta, m.speed or 1.0, inertia=False, model=model)
    assert not found.flags
    slip = np.sign(found.ideal.motion.slip(m.joint("B")))
    turned = np.angle(found.gaps["B"] / found.reactions.forces["B"])
    np.testing.assert_allclose(turned, slip * np.arctan(mu), atol=1e-9)
    np.testing.assert_allclose(np.abs(found.gaps["B"]), c, rtol=1e-12)
    expected = kinetostatics(moved(plain.with_joint("B", friction_radius=r * np.sin(np.arctan(mu))), theta), False)
    off = np.abs(found.ideal.drive_torque - expected.drive_torque).max()
    assert 0 < off < 2 * c / r * np.abs(found.ideal.rubbed["B"]).max()  # of what rubs the bearing, not the pin
    wide = found.ideal.forces["B"]  # moments about the bearing's centre, of all that acts on the follower
    arm, hangs = np.exp(1j * found.ideal.motion.angle("follower")), m.body("follower")
    span, centre = hangs.point("B") - hangs.point("E"), hangs.centre - hangs.point("E")
    weight = hangs.mass * complex(1.0, -9.81)
    moment = (np.conj(span * arm) * wide).imag + (np.conj(centre * arm) * weight).imag
    rub = -slip * (r + c) * np.sin(np.arctan(mu)) * np.abs(wide)
    np.testing.assert_allclose(moment + rub, 0.0, atol=1e-10)
    both = displaced(Assembly(m.with_joint("B", friction_radius=2e-3)), theta, m.speed or 1.0, inertia=False).ideal
    circle = 2e-3 + r * np.sin(np.arctan(mu))
    np.testing.assert_allclose(np.abs(both.rubbed["B"]), circle * np.abs(both.forces["B"]), rtol=1e-11)


@pytest.mark.mujoco
def test_contact_in_an_engine_has_the_friction_of_a_pin_with_clearance() -> None:
    plain = load("crank-rocker").replace(gravity=(1.0, -9.81))
    m = plain.with_joint("B", friction=0.3, pin_radius=0.01, clearance=1e-4, contact_stiffness=1e9)
    theta = np.radians([20.0, 75.0, 140.0, 300.0])
    found = displaced(Assembly(m), theta, m.speed or 1.0, inertia=False).signals()
    smooth = displaced(Assembly(m.without_contact_friction()), theta, m.speed or 1.0, inertia=False).signals()
    seen = engine("mujoco").simulate(request_of(m, "contact", "static", theta)).signals
    for name in ("drive_torque", "reaction_B_x", "reaction_B_y", "clearance_B_x", "clearance_B_y"):
        largest = np.abs(found[name]).max()
        np.testing.assert_allclose(seen[name], found[name], atol=2e-5 * largest, err_msg=name)
        assert np.abs(smooth[name] - found[name]).max() > 1e-3 * largest


def test_what_friction_circles_cannot_be() -> None:
    with pytest.raises(MechanismError, match=r"joint 'S': friction_radius is 0\.01; only a revolute joint has a pin"):
        load("slider-crank").with_joint("S", friction_radius=0.01)
    with pytest.raises(MechanismError, match="friction_radius"):
        load("slider-crank").with_joint("B", friction_radius=-0.01)


def test_a_released_linkage_with_friction_circles_is_refused() -> None:
    m = rubbed(load("pendulum"), {"O": 1e-3})
    with pytest.raises(AssemblyError, match="no released motion with friction that grows with reactions; leave it out"):
        released(Assembly(m), np.linspace(0.0, 0.1, 3))
    with pytest.raises(AssemblyError, match="friction_radius of joint 'O' is given"):
        Freedom.of(Assembly(m))
    m = rubbed(load("slider-crank"), {"A": 1e-3}).with_joint("S", friction=0.1)
    with pytest.raises(AssemblyError, match=r"joint 'A' and friction of joint 'S' are given.*them out"):
        released(Assembly(m), np.linspace(0.0, 0.1, 3))


# ---------------------------------------------------------------- engines

ENGINES = [pytest.param(name, marks=getattr(pytest.mark, name)) for name in ("mujoco", "pybullet", "dart")]
OFF = {"driven": 2e-4, "static": 1e-6}  # of the largest: a step of DART's and PyBullet's moves reactions by as much


@pytest.mark.parametrize("name", ENGINES)
@pytest.mark.parametrize("motion", [*slow("driven"), "static"])
@pytest.mark.parametrize("joints", ["B", *slow("DABE")])
def test_engines_rub_as_the_analytic_model(name: str, motion: Motion, joints: str) -> None:
    plain = load("crank-rocker").replace(gravity=(1.0, -9.81))
    m = rubbed(plain, dict.fromkeys(joints, 4e-3))
    theta, moving = np.radians(np.arange(5.0, 365.0, 20.0)), motion == "driven"
    expected, without = (kinetostatics(moved(each, theta), moving).drive_torque for each in (m, plain))
    found = engine(name).simulate(request_of(m, "ideal", motion, theta)).signals["drive_torque"]
    largest = np.abs(expected).max()
    assert np.abs(expected - without).max() > 0.02 * largest
    np.testing.assert_allclose(found, expected, atol=OFF[motion] * largest, rtol=0)


def driven_slider() -> Mechanism:
    """A slider-crank at 30 rad/s whose ideal joints rub by their reactions, with clearance in one pin."""
    m = load("slider-crank").with_joint("B", clearance=1e-4).with_joint("S", friction=0.1)
    for name in "OA":
        m = m.with_joint(name, friction=0.1, pin_radius=0.01)
    return m.replace(drives=(m.drives[0].model_copy(update={"speed": 30.0}),))


@pytest.mark.slow
@pytest.mark.mujoco
@pytest.mark.parametrize("model", ["contact", "spring-damper", *slow("massless-link")])
def test_a_step_with_friction_by_reactions_heeds_them_once(model: JointModel) -> None:
    """A step is begun once, and weighed once: a run with friction takes some times that without, and no twenty."""
    m, theta = driven_slider(), np.radians([20.0, 50.0])
    profile = cProfile.Profile()
    seen = profile.runcall(engine("mujoco").simulate, request_of(m, model, "driven", theta, step=2e-6))
    calls = {key[2]: count for key, (count, *_) in pstats.Stats(profile).stats.items()}  # type: ignore[attr-defined]
    looked = calls["look"]
    steps = calls["begin_step"] - looked
    assert steps > np.radians(30.0) / 30.0 / 2e-6
    assert calls["pressing"] < steps + 9 * looked
    smooth = m.with_joint("S", friction=0.0).with_joint("O", friction=0.0).with_joint("A", friction=0.0)
    found, without = (displaced(Assembly(each), theta, 30.0).signals() for each in (m, smooth))
    for name in ("drive_torque", "reaction_A_x", "reaction_S_x"):
        np.testing.assert_allclose(seen.signals[name], found[name], rtol=4e-3)
    assert np.abs(found["drive_torque"] / without["drive_torque"] - 1).min() > 0.1


@pytest.mark.slow
@pytest.mark.parametrize("name", ENGINES)
def test_a_released_pendulum_rubs_as_its_equation_of_motion_says(name: str) -> None:
    """The reaction is that of the motion, and the motion that of the reaction's friction: each is the other's."""
    m, radius = load("pendulum"), 2e-3
    body, gravity = m.bodies[0], complex(*m.gravity)
    arm = body.point("com") - body.point("O")
    inertia = body.moment_of_inertia + body.mass * abs(arm) ** 2

    def rate(_: float, state: np.ndarray) -> list[float]:
        theta, omega = state
        reach, alpha = arm * np.exp(1j * theta), 0.0
        for _ in range(50):
            force = body.mass * ((1j * alpha - omega**2) * reach - gravity)
            weight = (np.conj(reach) * body.mass * gravity).imag
            alpha = (weight + radius * abs(force)) / inertia
        return [omega, alpha]

    time = np.linspace(0.0, 0.35, 8)  # on its way down, all the while
    theta, omega = solve_ivp(rate, (0.0, 0.35), [0.0, -1e-12], t_eval=time, rtol=1e-10, atol=1e-12).y
    assert omega[1:].max() < -0.5
    found = engine(name).simulate(request_of(rubbed(m, {"O": radius}), time=time, step=5e-5)).signals["pendulum_angle"]
    free = engine(name).simulate(request_of(m, time=time)).signals["pendulum_angle"]
    assert np.abs(free - theta).max() > 5e-3
    np.testing.assert_allclose(found, theta, atol=3e-5, rtol=0)


def test_a_free_run_of_a_rig_with_friction_circles_is_refused_in_a_sentence(tmp_path: Path) -> None:
    time = np.linspace(0.0, 0.5, 40)
    rows = "\n".join(f"{t:.9g},{-4.0 * t**2:.9g}" for t in time)
    (tmp_path / "swing.csv").write_text(f"time [s],pendulum_angle [rad]\n{rows}\n")
    (tmp_path / "rubbed.toml").write_text(dumps(rubbed(load("pendulum"), {"O": 1e-3})))
    (tmp_path / "measured.toml").write_text(
        'mechanism = "rubbed.toml"\n[[run]]\nname = "swing"\nfile = "swing.csv"\ndrive = "free"\n'
    )
    done = compare("diagnose", "measured.toml", cwd=tmp_path)
    assert done.returncode == 2
    assert "run 'swing' cannot be made by the nominal mechanism: pendulum: friction_radius of joint 'O'" in done.stderr

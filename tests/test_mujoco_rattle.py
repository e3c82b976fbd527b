"""MuJoCo's pins that leave their bearings: contact laws by name, runs that go on beyond their reports, every step
watched.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import kinematics
from analytic.mechanism import GROUND, Mechanism
from analytic.mechanism.file import load
from analytic.mechanism.parts import ContactLaw
from analytic.paper.kinetostatics import kinetostatics
from asked import request_of
from compare.crosscheck import crosscheck
from compare.judge.watched import Run, integral, taken
from rebounds import exact_rebound, law_of, restitutions
from sim_models.common.contact_laws import delivered, restitution
from sim_models.engine import JointModel, Trace, Unsupported
from sim_models.mujoco.engine import ENGINE
from tests.evidence.validation.rebounds import dropped, hanging, rebound
from tests.evidence.validation.striking import LAWS

pytestmark = pytest.mark.mujoco

SPEED, CLEARANCE, REPORTED, BEYOND = 60.0, 2e-4, 1.8, 0.9  # rad/s, m, rad, rad
MODELS: tuple[JointModel, ...] = ("contact", "spring-damper")
GRAVITY = -9.81


def crank_rocker(law: ContactLaw | None, asked: float = 0.8, friction: float = 0.0, **of_joint: float) -> Mechanism:
    """At 573 rpm, with clearance in B."""
    given = {"contact_stiffness": 1e6, "contact_law": law, "restitution": asked, **of_joint}
    m = load("crank-rocker").with_joint("B", clearance=CLEARANCE, friction=friction, pin_radius=0.01, **given)
    assert m.drive is not None
    return m.replace(gravity=(0.0, GRAVITY), drive=m.drive.model_copy(update={"speed": SPEED}))


def turned(m: Mechanism, model: JointModel = "contact", last: float = REPORTED, **asked: object) -> Trace:
    """A part of a revolution from the pin in the middle of its gap."""
    theta = np.linspace(0.0, last, 9)
    return ENGINE.simulate(replace(request_of(m, model, "driven", theta, start="centred"), **asked))


@cache
def watched(law: ContactLaw | None, model: JointModel = "contact", friction: float = 0.0, asked: float = 0.8) -> Trace:
    """The same watched, and going on."""
    return turned(crank_rocker(law, asked, friction), model, watched=True, beyond=BEYOND)


@pytest.mark.parametrize("law", [None, "flores"])
def test_a_run_that_starts_centred_and_reports_at_once_has_its_accelerations(law: ContactLaw | None) -> None:
    """At 1430 rpm with the clearance in the crank's own pin, where another joint closes the loop: its two pins go as
    one from the first instant on.  They missed 241 m/s^2 there, a fifth of their own, and the run was refused.
    """
    m = load("crank-rocker").with_joint("D", clearance=2e-4, contact_law=law, restitution=0.9)
    assert m.drive is not None
    m = m.replace(drive=m.drive.model_copy(update={"speed": 150.0}))
    trace = ENGINE.simulate(request_of(m, "contact", "driven", np.radians([0.0, 5.0, 10.0]), start="centred"))
    found = {}
    for body in ("coupler", "follower"):
        part, rate = m.body(body), trace.rates[body]
        angle, spin = (trace.signals[f"{body}_{each}"] for each in ("angle", "angular_velocity"))
        arm = (complex(*part.points["B"]) - part.centre) * np.exp(1j * angle)
        found[body] = rate.acceleration + (1j * rate.angular_acceleration - spin**2) * arm
    assert np.abs(found["coupler"] - found["follower"])[0] < 1.0  # m/s^2


# ---------------------------------------------------------------- one pin that bounces


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("asked", [0.3, *(pytest.param(e, marks=pytest.mark.slow) for e in (0.05, 0.6, 0.95))])
def test_a_pin_rebounds_as_its_law_says_and_is_never_pulled(law: ContactLaw, model: JointModel, asked: float) -> None:
    m = hanging(law, asked, 1e7)
    trace = dropped(ENGINE, m, model)
    assert rebound(trace) == pytest.approx(exact_rebound(m), abs=1e-3)
    assert trace.signals["reaction_O_y"].min() >= 0.0  # of the ground, which has the pin, on the bar that hangs on it
    assert trace.signals["reaction_O_y"].max() > 100.0


def test_wherever_in_a_step_a_pin_touches_it_rebounds_alike() -> None:
    """The force of Kelvin and Voigt jumps at the wall: taken as it is at the step's end, a rebound scattered."""
    m = hanging("kelvin-voigt", 0.5, 1e7)
    step = dropped(ENGINE, m).step
    assert step is not None
    found = [rebound(dropped(ENGINE, m, late=late * step)) for late in np.arange(4) / 4]
    np.testing.assert_allclose(found, exact_rebound(m), atol=5e-3)
    assert np.mean(found) == pytest.approx(exact_rebound(m), abs=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("model", MODELS)
def test_restitution_delivered(model: JointModel) -> None:
    """0.05 to 0.95 by every law, on a wall so hard that weight does next to nothing meanwhile."""
    for law, by_asked in restitutions(ENGINE, model).items():
        for asked, (found, exact) in by_asked.items():
            of = law_of(hanging(law, asked, 1e9), "O")
            closed = asked if law == "kelvin-voigt" else delivered(of.hysteresis)
            assert found == pytest.approx(exact, abs=1e-3), (law, asked)
            assert found == pytest.approx(closed, abs=3e-3), (law, asked)


# ---------------------------------------------------------------- a linkage


def equation_of_motion(m: Mechanism, time: np.ndarray) -> np.ndarray:
    """Angles of coupler and follower (2, N) of the crank-rocker, its pin at B centred at first: written without this
    project's mechanics, stopped wherever the pin comes to its wall or leaves it.
    """
    crank, coupler, follower, ground, m3, m4 = 0.05, 0.12, 0.10, 0.12, 0.0942, 0.0785
    inertia_a = m3 * (coupler**2 + 1e-4) / 12 + m3 * coupler**2 / 4
    inertia_e = m4 * (follower**2 + 1e-4) / 12 + m4 * follower**2 / 4
    law, touched = law_of(m, "B"), 0.0

    def opening(t: float, y: np.ndarray) -> tuple[complex, complex]:
        alpha, beta, alpha_dot, beta_dot = y
        a, c, f = crank * np.exp(1j * SPEED * t), coupler * np.exp(1j * alpha), follower * np.exp(1j * beta)
        return a + c - ground - f, 1j * (SPEED * a + alpha_dot * c - beta_dot * f)

    def depth(t: float, y: np.ndarray) -> float:
        return abs(opening(t, y)[0]) - CLEARANCE

    def outwards(t: float, y: np.ndarray) -> float:
        gap, drift = opening(t, y)
        return (drift * gap.conjugate()).real / abs(gap)

    def rate(t: float, y: np.ndarray) -> list[float]:
        alpha, beta, alpha_dot, beta_dot = y
        a, c, f = crank * np.exp(1j * SPEED * t), coupler * np.exp(1j * alpha), follower * np.exp(1j * beta)
        gap, deep = opening(t, y)[0], depth(t, y)
        damping = law.damping or law.stiffness * deep * law.hysteresis / max(touched, law.slowest)
        size = max(0.0, law.stiffness * deep + damping * outwards(t, y)) if deep > 0 else 0.0
        force = size * gap / abs(gap) if size else 0j
        carried = m3 * (-(SPEED**2) * a - 1j * GRAVITY)
        on_coupler = -(c.conjugate() * force).imag - (c.conjugate() / 2 * carried).imag
        on_follower = (f.conjugate() * force).imag + (f.conjugate() / 2 * 1j * GRAVITY * m4).imag
        return [alpha_dot, beta_dot, on_coupler / inertia_a, on_follower / inertia_e]

    start = kinematics(Assembly(m.with_clearances({})), np.zeros(1), SPEED)
    y = np.array([float(of(b)[0]) for of in (start.angle, start.angular_velocity) for b in ("coupler", "follower")])
    found, t, inside = np.zeros((2, time.size)), 0.0, False
    depth.terminal = True  # type: ignore[attr-defined]
    while t < time[-1]:
        depth.direction = -1 if inside else 1  # type: ignore[attr-defined]
        run = solve_ivp(
            rate, (t, time[-1]), y, "DOP853", events=depth, dense_output=True, rtol=1e-9, atol=1e-12, max_step=2e-5
        )
        here = (time >= t) & (time <= run.t[-1])
        if here.any():
            found[:, here] = run.sol(time[here])[:2]
        t, y = float(run.t[-1]), run.y[:, -1]
        inside = outwards(t, y) > 0
        touched = outwards(t, y) if inside else touched
    return found


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "asked", "model"),
    [
        ("flores", 0.8, "contact"),
        *(
            pytest.param(*row, marks=pytest.mark.slow)
            for row in (
                ("hunt-crossley", 0.5, "spring-damper"),
                ("kelvin-voigt", 0.5, "contact"),
                ("gonthier", 0.2, "contact"),
                ("lankarani-nikravesh", 0.9, "spring-damper"),
            )
        ),
    ],
)
def test_a_linkage_that_rattles_moves_as_its_equation_says(law: ContactLaw, asked: float, model: JointModel) -> None:
    """To 3e-6 rad through its impacts, and a quarter of that at half the step."""
    m, theta = crank_rocker(law, asked), np.linspace(0.0, REPORTED, 9)
    exact = equation_of_motion(m, theta / SPEED)
    first = turned(m, model)
    assert first.free_share["B"] > 0.01
    assert first.step is not None
    off = [
        max(
            float(np.abs(t.signals[f"{b}_angle"] - x).max())
            for b, x in zip(("coupler", "follower"), exact, strict=True)
        )
        for t in (first, turned(m, model, step=first.step / 2))
    ]
    assert off[0] < 3e-6
    assert off[1] < off[0] / 3


@pytest.mark.parametrize("law", [None, "flores"])
@pytest.mark.parametrize("model", MODELS)
def test_watching_and_going_on_changes_no_report(law: ContactLaw | None, model: JointModel) -> None:
    """To the bit."""
    plain, seen = turned(crank_rocker(law), model), watched(law, model)
    assert seen.watched is not None
    for name, values in plain.signals.items():
        np.testing.assert_array_equal(values, seen.signals[name], name)
    assert plain.free_share == seen.free_share
    np.testing.assert_array_equal(plain.journal["B"], seen.journal["B"])


@pytest.mark.parametrize("law", [None, "flores"])
@pytest.mark.parametrize("model", MODELS)
def test_what_was_watched_is_that_of_the_reports(law: ContactLaw | None, model: JointModel) -> None:
    trace = watched(law, model)
    w = trace.watched
    assert w is not None
    assert trace.time is not None
    assert w.time[0] == trace.time[0]
    assert w.time[-1] == pytest.approx(trace.time[-1] + BEYOND / SPEED)
    assert np.diff(w.time).min() > 0
    k = np.abs(w.time[:, None] - trace.time).argmin(axis=0)
    np.testing.assert_allclose(w.time[k], trace.time, atol=1e-12)
    s = trace.signals
    for body in ("crank", "coupler", "follower"):
        np.testing.assert_allclose(w.place[body][k], s[f"{body}_x"] + 1j * s[f"{body}_y"], atol=1e-14)
        np.testing.assert_allclose(w.velocity[body][k], trace.rates[body].velocity, atol=2e-7)
        np.testing.assert_allclose(w.angle[body][k], s[f"{body}_angle"], atol=1e-14)
        np.testing.assert_allclose(w.angular_velocity[body][k], s[f"{body}_angular_velocity"], atol=2e-6)
    force = s["reaction_B_x"] + 1j * s["reaction_B_y"]
    np.testing.assert_allclose(w.force["B"][k], force, atol=1e-5 * np.abs(force).max())
    np.testing.assert_allclose(w.torque[k], s["drive_torque"], atol=1e-5 * np.abs(s["drive_torque"]).max())


def missing(trace: Trace, m: Mechanism) -> float:
    """Largest energy that a watched run has lost track of, over what its motor turned over."""
    assert trace.watched is not None
    run = Run(m, trace.watched)
    margin = trace.settings.get("contact_margin", {})
    pin = run.course(m.joint("B"), margin.get("B", 0.0))  # type: ignore[union-attr]
    power = run.motor + run.applied - taken({"B": pin}) - run.joints
    miss = integral(power, run.time) - (run.kinetic - run.kinetic[0])
    return float(np.abs(miss).max() / integral(np.abs(run.motor), run.time)[-1])


@pytest.mark.parametrize(
    ("law", "friction", "most"),
    [("flores", 0.0, 3e-6), ("gonthier", 0.2, 3e-6), ("kelvin-voigt", 0.0, 3e-6), (None, 0.0, 1e-4)],
)
def test_energy_is_kept_through_impacts(law: ContactLaw | None, friction: float, most: float) -> None:
    trace = watched(law, friction=friction)
    assert trace.watched is not None
    assert (np.abs(trace.watched.force["B"]) == 0).any()
    assert missing(trace, crank_rocker(law, friction=friction)) < most


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
    law, (pin,) = law_of(m, "B"), Run(m, trace.watched).course(m.joint("B")).contacts
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


@pytest.mark.parametrize("damping", [0.0, 10.0])
def test_a_pin_rubs_as_its_coefficient_says_however_little_its_wall_is_damped(damping: float) -> None:
    """The rows of a cone are as soft as its wall is undamped: without damping they rubbed by 0.0007 in place of 0.2."""
    m = crank_rocker(None, friction=0.2).with_joint("B", restitution=None, contact_stiffness=1e7)
    m = m.with_joint("B", contact_damping=damping)
    trace = turned(m, watched=True)
    assert trace.watched is not None
    (pin,) = Run(m, trace.watched).course(m.joint("B")).contacts
    slides = (pin.push > 0.1 * pin.push.max()) & (np.abs(pin.slip) > 5e-3)
    assert slides.sum() > 100
    np.testing.assert_allclose(np.abs(pin.rub[slides]), 0.2 * pin.push[slides], rtol=1e-3)


def test_a_law_with_hysteresis_pushes_as_hooke_says_where_the_pin_turns_back() -> None:
    m = crank_rocker("flores")
    trace = watched("flores")
    assert trace.watched is not None
    law, (pin,) = law_of(m, "B"), Run(m, trace.watched).course(m.joint("B")).contacts
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
    law, (pin,) = law_of(m, "B"), Run(m, trace.watched).course(m.joint("B")).contacts
    assert np.all(pin.push > 0)
    factor = 1 + law.hysteresis * pin.rate / law.slowest
    np.testing.assert_allclose(pin.push, law.stiffness * pin.depth * factor, rtol=1e-4)


def test_settings_say_what_is_delivered() -> None:
    settings = watched("flores").settings
    law = law_of(crank_rocker("flores"), "B")
    assert settings["contact_law"] == law.words
    assert settings["contact_stiffness"] == 1e6
    assert settings["restitution"] == {"B": 0.8}
    assert settings["restitution_delivered"] == {"B": delivered(law.hysteresis)}
    assert settings["minimum_impact_speed"] == pytest.approx(1e-3 * 0.12 * SPEED)
    assert "contact_damping" not in settings
    voigt = turned(crank_rocker("kelvin-voigt", 0.7), last=0.1).settings
    assert voigt["restitution_delivered"] == {"B": pytest.approx(0.7)}
    ratio = law_of(crank_rocker("kelvin-voigt", 0.7), "B").damping / (2 * math.sqrt(1e6 * 0.0785))
    assert restitution(ratio) == pytest.approx(0.7)
    bare = crank_rocker("flores").with_joint("B", contact_stiffness=None)
    assert "hard" not in str(turned(bare, last=0.1).settings["contact_law"])


def test_a_run_of_one_report_is_watched_from_there() -> None:
    m = crank_rocker("flores")
    trace = ENGINE.simulate(request_of(m, "contact", "driven", np.array([0.5]), watched=True, beyond=0.3, lead_in=0.2))
    assert trace.watched is not None
    assert trace.watched.angle["crank"][[0, -1]] == pytest.approx([0.5, 0.8])


def test_backward_as_well() -> None:
    m = crank_rocker("flores")
    assert m.drive is not None
    m = m.replace(drive=m.drive.model_copy(update={"speed": -SPEED}))
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


def test_a_law_by_name_is_not_exported(tmp_path: Path) -> None:
    with pytest.raises(Unsupported, match="contact laws by name"):
        ENGINE.export(request_of(crank_rocker("flores"), "contact", "driven", np.array([0.0, 0.1])), tmp_path)


def test_a_slide_is_watched_too() -> None:
    m = load("slider-crank").with_joint("B", clearance=CLEARANCE, contact_law="flores", contact_stiffness=1e6)
    assert m.drive is not None
    m = m.replace(drive=m.drive.model_copy(update={"speed": SPEED}), gravity=(0.0, GRAVITY))
    assert GROUND in {body for joint in m.joints for body in joint.bodies if joint.prismatic}
    assert missing(turned(m, watched=True), m) < 1e-5


@pytest.mark.slow
@pytest.mark.parametrize("restitution", [0.9, 0.999])
def test_hard_contact_that_hardly_damps_rubs_by_its_coefficient(restitution: float) -> None:
    """Friction of a pin pressed to its wall takes its coefficient times radius, reaction and turning between the two.
    Once it took a quarter of that at a restitution of 0.999, and gave energy at 1.
    """
    m = load("crank-rocker").replace(gravity=(0.0, -9.81)).with_clearances({"B": 1e-4})
    m = m.replace(drive=m.drive.model_copy(update={"speed": 3.0}))
    m = m.with_joint("B", restitution=restitution, friction=0.03, pin_radius=0.02)
    (run,) = crosscheck(m, "mujoco", joint_model="contact", revolutions=2, workers=1).runs
    found = kinetostatics(kinematics(Assembly(m.ideal()), np.linspace(0, 2 * np.pi, 2001)[:-1], 3.0))
    turning = np.abs(found.motion.slip(m.joint("B"))[0])
    took = 0.03 * 0.02 * float(np.mean(np.abs(found.forces["B"]) * turning)) * 2 * np.pi / 3.0
    assert run.contact is not None
    assert run.contact.joints["B"].statistics["friction_loss"].value == pytest.approx(took, rel=5e-3)

"""Exudyn alone: its differentiation, impact model and settings, and how it watches, rubs and starts with large gaps."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.schedule import ScheduleError
from analytic.mechanism import Drive, Load, Mechanism
from analytic.mechanism.file import load
from analytic.mechanism.parts import ContactLaw
from analytic.paper.clearance import displaced
from asked import request_of
from engine_checks import reaction_errors, run
from maximal import Maximal
from several_truths import agrees
from sim_models.engine import Cause, JointModel, Request, SimulationError, Trace, Unsupported, Watched
from sim_models.exudyn.engine import ENGINE
from sim_models.exudyn.laws import hysteresis
from tests.evidence import contact_ode
from tests.evidence.validation.rebounds import dropped, hanging, rebound

pytestmark = pytest.mark.exudyn


def test_a_light_linkage_presses_its_pins_less_deep_than_exudyn_differentiates() -> None:
    """Under its weight alone, 0.3 N; Exudyn's own step of 1e-8 m makes Newton's method go to and fro."""
    m = load("crank-rocker").replace(gravity=(0.0, -9.81)).with_clearances({"A": 1e-4, "B": 1e-4})
    trace = run("exudyn", m, "contact", "static", np.arange(0.0, 360.0, 8.0))
    for joint in "DABE":
        degrees, percent = reaction_errors(trace, m, joint)
        assert degrees < 0.01
        assert percent < 0.01


@pytest.mark.parametrize(("e", "delivered"), [(0.9, 0.9), (0.7, 0.69997), (0.5, 0.50017), (0.3, 0.30422)])
def test_hysteresis_factor_satisfies_the_momentum_balance(e: float, delivered: float) -> None:
    """chi (1 + e') = ln[(1 + chi)/(1 - chi e')], with Carvalho-Martins' and (0.3) Gonthier's published e'."""
    chi = hysteresis(e)
    assert chi * (1 + delivered) == pytest.approx(math.log((1 + chi) / (1 - chi * delivered)), rel=3e-4)


def test_what_exudyn_does_not_do_is_refused_in_words() -> None:
    m = load("paper").with_clearances({"B": 1e-3})
    with pytest.raises(ScheduleError, match="no constant speed"):
        run("exudyn", m.replace(drive=Drive(joint="D", speed="measured")), "ideal", "driven", [30.0])
    with pytest.raises(Unsupported, match="pin centred"):
        run("exudyn", m, "massless-link", "driven", [30.0], start="centred")
    with pytest.raises(Unsupported, match="friction"):
        run("exudyn", m.with_joint("B", friction=0.1), "contact", "static", [30.0])
    with pytest.raises(Unsupported, match="needs times to report at"):
        ENGINE.simulate(request_of(load("pendulum"), time=np.zeros(0)))
    with pytest.raises(Unsupported, match="no crank angle"):
        run("exudyn", m, "ideal", "driven", [])


def test_settings_say_which_law_and_numbers_were_used() -> None:
    m = load("paper").with_clearances({"B": 1e-3})
    settings = run("exudyn", m, "contact", "driven", [30.0, 30.5]).settings
    assert settings["contact_stiffness"] == 1e7
    assert settings["restitution"]["B"] == pytest.approx(0.2984, abs=1e-3)  # of a damping ratio of 0.5, never pulling
    assert 0 < settings["step"] < 1e-4
    linear = run("exudyn", m.with_joint("B", contact_damping=40.0), "contact", "driven", [30.0, 30.5]).settings
    assert linear["contact_damping"] == {"B": 40.0}


def moved(m: Mechanism, times: np.ndarray) -> Trace:
    """A linkage that nothing drives."""
    return ENGINE.simulate(request_of(m, "ideal", "driven", time=times, courses={}))


def test_a_motion_through_a_posture_that_holds_itself_twice_is_refused() -> None:
    """Let go, the five-bar's cranks fall outwards alike, until all bars lie in one line; with a push aside they miss
    it.
    """
    m, times = load("five-bar").replace(drives=()), np.linspace(0.0, 0.07, 8)
    with pytest.raises(SimulationError, match="stretched out") as failure:
        moved(m, times)
    assert failure.value.cause is Cause.DIVERGED
    m = m.replace(loads=(Load(body="left-arm", point="P", force=(7.0, -20.0)),))
    trace, judge = moved(m, times), Maximal(m, ())
    posed = judge.released(judge.home({}), np.zeros(12), times, {})
    agrees(m, trace, judge, posed, within=1e-4, motors=3e-4, places=1e-5, rates=3e-5)


def rattling(law: ContactLaw | None, friction: float = 0.0, **contact: float) -> Mechanism:
    """600 rpm, 0.5 mm in B, 1e6 N/m."""
    asked = {"contact_stiffness": 1e6, "restitution": 0.8, "friction": friction, **contact}
    m = load("crank-rocker").with_joint("B", clearance=5e-4, contact_law=law, **asked)
    return m.replace(gravity=(0.0, -9.81), drive=m.drive.model_copy(update={"speed": 20 * np.pi}))


def request(m: Mechanism, revolutions: float = 1.0, joint_model: JointModel = "contact") -> Request:
    theta = np.linspace(0.0, 2 * np.pi * revolutions, round(36 * revolutions) + 1)
    return request_of(m, joint_model, "driven", theta, start="centred", watched=True, beyond=2.5 * np.pi)


@cache
def watched(law: ContactLaw, friction: float = 0.0, joint_model: JointModel = "contact") -> Trace:
    return ENGINE.simulate(request(rattling(law, friction), joint_model=joint_model))


def seen(trace: Trace) -> Watched:
    assert trace.watched is not None
    return trace.watched


def arm(m: Mechanism, w: Watched, body: str, point: str) -> np.ndarray:
    return (m.body(body).point(point) - m.body(body).point("com")) * np.exp(1j * w.angle[body])


def meeting(m: Mechanism, w: Watched) -> tuple[np.ndarray, np.ndarray]:
    """Gap (m) of B, and velocity (m/s) of the first body where they touch, less the second's."""
    first, second = m.joint("B").bodies
    gap = w.place[first] + arm(m, w, first, "B") - w.place[second] - arm(m, w, second, "B")
    touch = w.place[second] + arm(m, w, second, "B") + gap / np.maximum(np.abs(gap), 1e-30) * (0.01 + 5e-4)
    moved = [w.velocity[b] + 1j * w.angular_velocity[b] * (touch - w.place[b]) for b in (first, second)]
    return gap, moved[0] - moved[1]


@pytest.mark.parametrize("law", ["hunt-crossley", "lankarani-nikravesh", "flores", "gonthier"])
def test_a_law_without_loss_loses_nothing(law: ContactLaw) -> None:
    """K so hard that gravity does next to nothing meanwhile."""
    assert rebound(dropped(ENGINE, hanging(law, 1.0, 1e9))) == pytest.approx(1.0, abs=1.5e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("law", "friction", "allowed"), [("hunt-crossley", 0.0, 2e-3), ("flores", 0.1, 2e-3)])
def test_the_first_impacts_are_those_of_the_ordinary_differential_equation(
    law: ContactLaw, friction: float, allowed: float
) -> None:
    """Impulses (normal and rubbing), by a referee with event location and Coulomb's friction as it is."""
    m = rattling(law, friction)
    loop = contact_ode.loop_of(m)
    exact = contact_ode.simulate(m, loop, contact_ode.centred(m, loop), 2.0).impacts
    w = seen(ENGINE.simulate(replace(request(m), step=4e-6)))
    assert exact.time.size >= 2
    for k in range(2):
        rows = (w.time > exact.time[k] - 2e-5) & (w.time < exact.left[k] + 2e-5)
        impulse = np.trapezoid(w.force["B"][rows], w.time[rows])
        assert abs(impulse - exact.vector[k]) < allowed * abs(exact.vector[k])


@pytest.mark.slow
@pytest.mark.parametrize(("law", "friction"), [("kelvin-voigt", 0.0), ("hunt-crossley", 0.0), ("gonthier", 0.2)])
def test_pins_rub_by_a_coefficient_that_grows_with_slow_slip(law: ContactLaw, friction: float) -> None:
    """Up to 1 mm/s; and they touch only where the gap is closed."""
    m, trace = rattling(law, friction), watched(law, friction)
    w = seen(trace)
    gap, slipping = meeting(m, w)
    force, along = w.force["B"], gap / np.maximum(np.abs(gap), 1e-30)
    push, rub = np.real(force * along.conj()), np.imag(force * along.conj())
    assert push.min() > -1e-9
    assert push.max() > 100
    assert np.count_nonzero(np.diff((push > 0).astype(int)) == 1) >= 3, "impacts"
    assert np.all(push[np.abs(gap) < 5e-4] == 0)
    slip = np.imag(slipping * along.conj())
    np.testing.assert_allclose(rub, friction * push * np.clip(slip / 1e-3, -1, 1), atol=2e-3 * push.max())


def test_both_joint_models_have_the_same_law() -> None:
    both = [seen(watched("flores", 0.0, model)).force["B"] for model in ("contact", "spring-damper")]
    np.testing.assert_array_equal(*both)


def test_massless_links_and_ideal_joints_are_watched_too() -> None:
    for joint_model in ("ideal", "massless-link"):
        trace = ENGINE.simulate(replace(request(rattling(None), 0.5, joint_model), start="steady"))
        w = seen(trace)
        assert set(w.force) == set(trace.clearance)
        assert w.angle["crank"][-1] - w.angle["crank"][0] == pytest.approx(3.5 * np.pi, rel=1e-9)


@pytest.mark.slow
def test_a_hundred_revolutions_are_watched_in_pieces() -> None:
    trace = ENGINE.simulate(replace(request(rattling("flores")), beyond=200 * np.pi))
    w = seen(trace)
    assert w.angle["crank"][-1] == pytest.approx(2 * np.pi * 101, abs=1e-6)
    assert np.diff(w.time).max() < 1.001 * (trace.step or 0.0)


def test_a_large_gap_at_speed_begins_along_the_ideal_reaction() -> None:
    """10 mm at 250 rpm: gaps that followed the inertia forces of the gaps' own motion would run away, to 138 rad/s of
    the follower.
    """
    m = load("paper").rigid().with_joint("B", clearance=1e-2, contact_stiffness=1e7, contact_damping=1253.0)
    speed, theta = 250 * np.pi / 30, np.radians(np.arange(20.0, 60.0, 1.0))
    m = m.replace(drive=Drive(joint=m.drive_joint.name, speed=speed))
    trace = ENGINE.simulate(request_of(m, "contact", "driven", theta))
    along = displaced(Assembly(m), theta, speed, model="first_order").configuration.motion
    turning = trace.signals["follower_angular_velocity"][0]
    assert turning == pytest.approx(along.angular_velocity("follower")[0], rel=0.05)
    assert trace.free_share == {"B": 0.0}

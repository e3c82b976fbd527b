"""Exudyn's pins that leave their bearings: laws of contact by name, and runs that go on beyond their reports."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from analytic.kinematics.assembly import Assembly
from analytic.mechanism import Body, Drive, Ground, Joint, Mechanism
from analytic.mechanism.file import load
from analytic.mechanism.parts import ContactLaw
from analytic.paper.clearance import displaced
from asked import request_of
from marks import slow
from sim_models.common.contact_laws import NamedLaw, delivered, named_law, restitution
from sim_models.engine import JointModel, Request, Trace, Unsupported, Watched
from sim_models.exudyn.engine import ENGINE
from tests.evidence import contact_ode

pytestmark = pytest.mark.exudyn

CLEARANCE, GRAVITY, MASS = 1e-3, 9.81, 1.0
LAWS: tuple[ContactLaw, ...] = ("kelvin-voigt", "hunt-crossley", "lankarani-nikravesh", "flores", "gonthier")
WITH_HYSTERESIS = LAWS[1:]


def hanging(law: ContactLaw, asked: float, stiffness: float) -> Mechanism:
    """A bar that falls straight down, by its clearance, onto the pin that it hangs on: all of its mass strikes."""
    return Mechanism(
        name="hanging",
        gravity=(0.0, -GRAVITY),
        ground=Ground(points={"P": (0.0, 0.0)}),
        bodies=(Body(name="bar", points={"P": (0.0, 0.0), "Q": (0.2, 0.0)}, mass=MASS),),
        joints=(
            Joint(
                name="P", type="revolute", bodies=("ground", "bar"), clearance=CLEARANCE,
                contact_stiffness=stiffness, restitution=asked, contact_law=law,
            ),
        ),
        assembly={"bar": -math.pi / 2},
        drives=(),
    )  # fmt: skip


def law_of(m: Mechanism, joint: str) -> NamedLaw:
    law = named_law(m, m.joint(joint), "driven")
    assert law is not None
    return law


def rebound(m: Mechanism, late: float = 0.0, finer: float = 1.0) -> float:
    """Speed at the wall after the bar's first touch, over that before it.

    Steps are the engine's own, by so much ``finer``, and ``late`` by that share of a step.
    """
    half = math.pi * math.sqrt(MASS / law_of(m, "P").stiffness)
    step = half / 20 / finer
    time = math.sqrt(2 * CLEARANCE / GRAVITY) + late * step + half * np.array([20.0, 40.0, 80.0])
    asked = request_of(m, "contact", "driven", time=time, start="centred")
    trace = ENGINE.simulate(asked if finer == 1.0 else replace(asked, step=step))
    gap, speed = np.abs(trace.signals["clearance_P_y"]), trace.rates["bar"].velocity.imag
    back = (gap < CLEARANCE) & (speed > 0)
    assert back.any(), "it has not come back"
    k = int(np.argmax(back))
    return math.sqrt((speed[k] ** 2 + 2 * GRAVITY * (CLEARANCE - gap[k])) / (2 * GRAVITY * CLEARANCE))


def exact_rebound(law: NamedLaw) -> float:
    """The same of the law's own differential equation."""
    v0 = math.sqrt(2 * GRAVITY * CLEARANCE)

    def rates(t: float, y: np.ndarray) -> list[float]:
        return [y[1], GRAVITY - law.size(float(y[0]), float(y[1]), v0) / MASS]

    def out(t: float, y: np.ndarray) -> float:
        return float(y[0])

    out.terminal, out.direction = True, -1  # type: ignore[attr-defined]
    half = math.pi * math.sqrt(MASS / law.stiffness)
    found = solve_ivp(
        rates, (0.0, 100 * half), [1e-15, v0], "LSODA", events=out, rtol=1e-9, atol=1e-14, max_step=half / 50
    )
    assert found.y_events[0].size
    return float(-found.y_events[0][0][1] / v0)


@pytest.mark.parametrize("law", WITH_HYSTERESIS)
def test_a_bar_rebounds_as_its_law_says(law: ContactLaw) -> None:
    m = hanging(law, 0.6, 1e9)
    assert rebound(m, finer=4.0) == pytest.approx(exact_rebound(law_of(m, "P")), abs=5e-4)


@pytest.mark.parametrize("law", WITH_HYSTERESIS)
def test_a_law_without_loss_loses_nothing(law: ContactLaw) -> None:
    """K so hard that gravity does next to nothing meanwhile."""
    assert rebound(hanging(law, 1.0, 1e9)) == pytest.approx(1.0, abs=1.5e-3)


@pytest.mark.slow
@pytest.mark.parametrize("asked", [0.2, 0.5])
def test_kelvin_and_voigt_deliver_what_is_asked_on_average(asked: float) -> None:
    """Their force jumps at the wall, wherever in a step that is: a rebound scatters, its mean does not."""
    m = hanging("kelvin-voigt", asked, 1e9)
    found = [rebound(m, late) for late in np.arange(8) / 8]
    assert np.mean(found) == pytest.approx(exact_rebound(law_of(m, "P")), abs=2e-3)
    assert np.std(found) < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("asked", [0.05, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95])
@pytest.mark.parametrize("law", LAWS)
def test_restitution_delivered(law: ContactLaw, asked: float) -> None:
    """On a wall so hard that the rest is the law's own: by closed forms, wherever in a step the bar touches."""
    m = hanging(law, asked, 1e11)
    of = law_of(m, "P")
    ratio = of.damping / (2 * math.sqrt(of.stiffness * MASS))
    expected = restitution(ratio) if law == "kelvin-voigt" else delivered(of.hysteresis)
    found = [rebound(m, late) for late in np.arange(4) / 4]
    assert np.mean(found) == pytest.approx(expected, abs=3e-3)


# ---------------------------------------------------------------- a linkage that rattles


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


@pytest.mark.slow
@pytest.mark.parametrize(("law", "friction"), [("kelvin-voigt", 0.0), ("hunt-crossley", 0.0), ("gonthier", 0.2)])
def test_energy_is_balanced_through_impacts_and_pins_are_never_pulled(law: ContactLaw, friction: float) -> None:
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
    kinetic = sum(
        b.mass / 2 * np.abs(w.velocity[b.name]) ** 2 + b.moment_of_inertia / 2 * w.angular_velocity[b.name] ** 2
        for b in m.bodies
    )
    height = sum(b.mass * w.place[b.name].imag * 9.81 for b in m.bodies)
    motor = w.torque * w.angular_velocity[m.driven]
    contact = -np.real(force * slipping.conj())
    work = [np.sum(np.diff(w.time) * (p[1:] + p[:-1]) / 2) for p in (motor, contact)]
    change = (kinetic + height)[[0, -1]]
    assert work[1] < 0, "contact takes energy"
    assert abs(np.diff(change)[0] - sum(work)) < 1e-3 * -work[1]


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


@pytest.mark.parametrize("law", [None, "flores"])
def test_reports_are_the_same_watched_or_not(law: ContactLaw | None) -> None:
    asked = request(rattling(law), 0.5)
    plain = ENGINE.simulate(replace(asked, watched=False, beyond=0.0))
    trace = ENGINE.simulate(asked)
    w = seen(trace)
    assert plain.watched is None
    assert trace.time is not None
    assert plain.free_share == trace.free_share
    for name, values in plain.signals.items():
        np.testing.assert_array_equal(trace.signals[name], values)
    rows = np.searchsorted(w.time, trace.time)
    np.testing.assert_array_equal(w.time[rows], trace.time)
    for name, values in (
        ("drive_torque", w.torque),
        ("reaction_B_x", w.force["B"].real),
        ("follower_angle", w.angle["follower"]),
        ("follower_x", w.place["follower"].real),
        ("coupler_angular_velocity", w.angular_velocity["coupler"]),
    ):
        np.testing.assert_array_equal(values[rows], trace.signals[name])
    np.testing.assert_array_equal(w.velocity["coupler"][rows], trace.rates["coupler"].velocity)
    assert np.all(np.diff(w.time) > 0)
    assert w.time[-1] == pytest.approx((1.0 + 2.5) / 20, rel=1e-9)
    assert np.all(np.diff(w.angle["crank"]) > 0)


def test_both_joint_models_have_the_same_law() -> None:
    both = [seen(watched("flores", 0.0, model)).force["B"] for model in ("contact", "spring-damper")]
    np.testing.assert_array_equal(*both)


def test_kelvin_and_voigt_by_name_are_the_springs_and_dampers_of_old() -> None:
    old, new = (
        ENGINE.simulate(request(rattling(law, contact_damping=30.0), 0.5, "spring-damper"))
        for law in (None, "kelvin-voigt")
    )
    for name, values in old.signals.items():
        np.testing.assert_array_equal(new.signals[name], values)


def test_a_result_says_what_its_law_is_and_delivers() -> None:
    settings, law = watched("flores").settings, law_of(rattling("flores"), "B")
    assert settings["contact_law"] == law.words
    assert settings["contact_stiffness"] == pytest.approx(1e6)
    assert settings["restitution"] == {"B": 0.8}
    assert settings["restitution_delivered"] == {"B": pytest.approx(delivered(law.hysteresis))}
    assert settings["minimum_impact_speed"] == pytest.approx(law.slowest)
    voigt = watched("kelvin-voigt").settings
    assert voigt["restitution_delivered"] == {"B": pytest.approx(0.8)}
    assert "contact_damping" in voigt


def test_massless_links_and_ideal_joints_are_watched_too() -> None:
    for joint_model in ("ideal", "massless-link"):
        trace = ENGINE.simulate(replace(request(rattling(None), 0.5, joint_model), start="steady"))
        w = seen(trace)
        assert set(w.force) == set(trace.clearance)
        assert w.angle["crank"][-1] - w.angle["crank"][0] == pytest.approx(3.5 * np.pi, rel=1e-9)


def test_exports_and_beams_have_no_laws_by_name(tmp_path: object) -> None:
    asked = replace(request(rattling("flores")), watched=False, beyond=0.0)
    with pytest.raises(Unsupported, match="contact laws by name in its exports"):
        ENGINE.export(asked, tmp_path)  # type: ignore[arg-type]
    with pytest.raises(Unsupported, match="contact laws by name among links that bend"):
        ENGINE.simulate_flexible(asked)


@pytest.mark.parametrize(("revolutions"), slow(100))
def test_a_hundred_revolutions_are_watched_in_pieces(revolutions: int) -> None:
    m = rattling("flores")
    trace = ENGINE.simulate(replace(request(m), beyond=2 * np.pi * revolutions))
    w = seen(trace)
    assert w.angle["crank"][-1] == pytest.approx(2 * np.pi * (revolutions + 1), abs=1e-6)
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

"""DART's and PyBullet's pins that leave their bearings: laws of contact by name, runs that go on beyond their reports,
every step watched.
"""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from analytic.mechanism import GROUND, MASS_CENTRE, Mechanism
from analytic.mechanism.file import load
from analytic.mechanism.parts import ContactLaw
from asked import request_of
from engine_checks import run, vector
from marks import slow
from sim_models.common.contact_laws import NamedLaw, delivered, named_law
from sim_models.common.mobility import mobility
from sim_models.common.start import Pose
from sim_models.engine import JointModel, Trace, Unsupported, Watched, engine
from sim_models.leapfrog.striking import Striking
from sim_models.run.path import CrankPath
from tests.evidence import contact_ode

LAWS: tuple[ContactLaw, ...] = ("kelvin-voigt", "hunt-crossley", "lankarani-nikravesh", "flores", "gonthier")
CLEARANCE, G = 5e-3, 9.81


# ---------------------------------------------------------------- one pin that bounces


def hanging(law: ContactLaw | None, asked: float, stiffness: float) -> Mechanism:
    """A bar that falls straight down, by its clearance, onto the pin that it hangs on: all of its mass strikes."""
    m = load("pendulum").with_joint(
        "O", clearance=CLEARANCE, restitution=asked, contact_stiffness=stiffness, contact_law=law
    )
    return m.replace(assembly={"pendulum": -math.pi / 2})


def rebound(name: str, m: Mechanism, joint_model: JointModel = "spring-damper", within: float = 0.0) -> float:
    """Speed at the wall after the bar's touch, over that before it; it has left within this share of its fall."""
    fall, speed = math.sqrt(2 * CLEARANCE / G), math.sqrt(2 * G * CLEARANCE)
    asked = max(m.joint("O").restitution or 0.0, 0.03)
    time = fall * np.linspace(1 + within, 1 + asked / 2, 40)
    step = fall / 4000 if joint_model == "contact" else None
    trace = engine(name).simulate(request_of(m, joint_model, "driven", time=time, start="centred", step=step))
    force, height = trace.signals["reaction_O_y"], CLEARANCE - trace.signals["clearance_O_y"]
    assert force.min() >= 0.0, "a pin is never pulled"
    rising = (force == 0) & (height > 1e-9) & (trace.rates["pendulum"].velocity.imag > 0)
    k = int(np.argmax(rising))
    assert rising[k], "it has not come back"
    return math.sqrt(trace.rates["pendulum"].velocity.imag[k] ** 2 + 2 * G * height[k]) / speed


def contact_time(m: Mechanism) -> float:
    """A little more than a touch lasts (s), over the time of the fall."""
    mass, stiffness = m.bodies[0].mass, m.joint("O").contact_stiffness
    assert stiffness is not None
    soft = 12 if (m.joint("O").restitution or 0) > 0.15 else 36
    return soft * math.sqrt(mass / stiffness) / math.sqrt(2 * CLEARANCE / G)


def promised(m: Mechanism) -> float:
    """What the law is to deliver: by closed form."""
    law = named_law(m, m.joint("O"), "driven")
    assert law is not None
    return law.asked if law.name == "kelvin-voigt" else delivered(law.hysteresis)


@pytest.mark.parametrize("asked", [0.3, *slow(0.9)])
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("name", ["dart", "pybullet"])
def test_a_bar_rebounds_as_its_law_says(name: str, law: ContactLaw, asked: float) -> None:
    m = hanging(law, asked, 1e8)
    assert rebound(name, m, within=contact_time(m)) == pytest.approx(promised(m), abs=6e-3)


@pytest.mark.slow
@pytest.mark.parametrize("asked", [0.05, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95])
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("name", ["dart", "pybullet"])
def test_restitution_delivered(name: str, law: ContactLaw, asked: float) -> None:
    """On a wall so hard that gravity does next to nothing meanwhile."""
    m = hanging(law, asked, 1e9)
    assert rebound(name, m, within=contact_time(m)) == pytest.approx(promised(m), abs=3e-3)


@pytest.mark.dart
@pytest.mark.parametrize("asked", [0.4, 0.9, *slow(0.35, 0.5, 0.65, 0.8, 0.95)])
def test_darts_own_contact_delivers_what_is_asked(asked: float) -> None:
    """It strikes at 0.31 m/s, and rebounds at more than DART's 0.1 m/s."""
    m = hanging(None, asked, 1e7)
    assert rebound("dart", m, "contact", within=1e-3) == pytest.approx(asked, abs=1e-3)


@pytest.mark.dart
@pytest.mark.parametrize("asked", [0.3, *slow(0.05, 0.1, 0.2)])
def test_darts_own_contact_holds_what_would_rebound_slowly(asked: float) -> None:
    """At less than 0.1 m/s: and its settings say from which speed of impact on it rebounds."""
    time = math.sqrt(2 * CLEARANCE / G) * np.array([1.001, 1.01, 1 + asked / 2])
    asking = request_of(hanging(None, asked, 1e7), "contact", "driven", time=time, start="centred", step=8e-6)
    trace = engine("dart").simulate(asking)
    np.testing.assert_allclose(trace.signals["clearance_O_y"], CLEARANCE, rtol=1e-6)
    least = trace.settings["minimum_impact_speed"]
    assert least == {"O": pytest.approx(0.1 / asked)}
    assert trace.settings["contact_law"] == "rigid, Newton's restitution"


# ---------------------------------------------------------------- the scheme


def strike(law: NamedLaw, mass: float, phase: float, late: float) -> float:
    """Restitution of a mass that strikes a wall at 1 m/s in a leapfrog's steps, of this share of its contact's phase
    and ``late`` by that share of a step.
    """
    h = phase * math.sqrt(mass / (law.stiffness * (1 + law.hysteresis)))
    striking = Striking(law, 1.0, lambda: np.eye(2) / mass)
    place, speed = 1.0 - (1 + late) * h, 1.0
    while speed > 0 or place > 1.0:
        speed -= striking.push(complex(place), complex(speed), h / 2).real * h / mass
        place += h * speed
    return -speed


@pytest.mark.parametrize("law", LAWS)
def test_restitution_is_of_second_order_in_the_step(law: ContactLaw) -> None:
    m = hanging(law, 0.7, 1e8)
    named, mass = named_law(m, m.joint("O"), "driven"), m.bodies[0].mass
    assert named is not None
    off = [
        max(abs(strike(named, mass, phase, late) - promised(m)) for late in np.arange(20) / 20)
        for phase in (0.2, 0.1, 0.05)
    ]
    assert off[0] < 6e-3
    assert off[1] < off[0] / 2.5
    assert off[2] < off[1] / 2.5


def test_a_law_that_damps_beyond_all_measure_does_not_shake() -> None:
    """A pin at rest on its wall, pressed: its law's damping is that of the slowest touch."""
    law = NamedLaw("flores", 1e7, 0.0, 30.0, 1e-6, 0.05)
    striking, h, mass, load = Striking(law, 1e-3, lambda: np.eye(2) / 0.1), 1e-5, 0.1, 50.0
    place, speed = 1e-3 + load / law.stiffness, 0.0
    for k in range(2000):
        force = striking.push(complex(place), complex(speed), h / 2).real
        assert force == pytest.approx(load, rel=0.05)
        speed += (load * (1 + 0.02 * math.sin(k / 50)) - force) * h / mass
        place += h * speed


@pytest.mark.parametrize(
    ("name", "case", "joint"),
    [
        ("dart", "crank-rocker", "B"),
        ("dart", "crank-rocker", "D"),
        ("dart", "six-bar", "F"),
        ("pybullet", "crank-rocker", "A"),
        ("pybullet", "slider-crank", "B"),
    ],
)
def test_a_gap_yields_to_a_force_as_in_the_engine(name: str, case: str, joint: str) -> None:
    m = load(case).with_joint(joint, clearance=1e-4)
    if name == "dart":
        from sim_models.dart.world import DartWorld as World
    else:
        from sim_models.pybullet.world import BulletWorld as World
    world, h = World(request_of(m, "spring-damper", "driven", np.array([1.0]))), 1e-5
    at: dict[str, Pose] = CrankPath(world.assembly).poses(1.0)
    speeds = []
    for force in (0j, 1 + 0j, 1j):
        world.place(at)
        world.pull(m.joint(joint), force)
        world.advance(h)
        speeds.append(-world.gap(joint)[1])
    world.close()
    columns = [(speed - speeds[0]) / h for speed in speeds[1:]]
    found = np.array([[c.real for c in columns], [c.imag for c in columns]])
    others = [j for j in m.joints if j.name != joint]
    ours = mobility(m, at, m.joint(joint), others, [m.drive_joint])
    np.testing.assert_allclose(ours, found, atol=1e-5 * np.abs(found).max())


# ---------------------------------------------------------------- a linkage that rattles


def rattling(law: ContactLaw | None = None, joint: str = "B", restitution: float = 0.8) -> Mechanism:
    """600 rpm, 0.2 mm, 1e6 N/m, under gravity and a load."""
    m = load("crank-rocker").with_joint(
        joint, clearance=2e-4, contact_stiffness=1e6, restitution=restitution, contact_law=law
    )
    loads = [{"body": "coupler", "point": "com", "force": (3.0, -8.0), "torque": 0.2}]
    return m.replace(gravity=(0.0, -G), loads=loads, drive=m.drive.model_copy(update={"speed": 20 * np.pi}))


@cache
def watched(name: str, joint_model: JointModel, law: ContactLaw | None, joint: str = "B") -> Trace:
    """Half a revolution from a centred pin, a fifth of one beyond the reports."""
    m = rattling(law, joint) if joint_model != "ideal" else rattling().with_clearances({"B": 0.0})
    degrees = np.arange(0.0, 109.0, 12.0)
    return run(engine(name), m, joint_model, "driven", degrees, start="centred", watched=True, beyond=0.4 * np.pi)


def seen(trace: Trace) -> Watched:
    assert trace.watched is not None
    return trace.watched


def moved(m: Mechanism, w: Watched, body: str, point: str) -> tuple[np.ndarray, np.ndarray]:
    """Place (m) and velocity (m/s) of a body's point."""
    if body == GROUND:
        return np.full(w.time.size, m.ground.point(point)), np.zeros(w.time.size, complex)
    arm = (m.body(body).point(point) - m.body(body).point(MASS_CENTRE)) * np.exp(1j * w.angle[body])
    return w.place[body] + arm, w.velocity[body] + 1j * w.angular_velocity[body] * arm


RATTLING: list[tuple[str, JointModel, ContactLaw | None, str]] = [
    ("dart", "spring-damper", "flores", "B"),
    ("dart", "contact", None, "A"),
    ("pybullet", "spring-damper", "kelvin-voigt", "B"),
]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "joint_model", "law", "joint"),
    [
        *RATTLING,
        *slow(
            *((name, "spring-damper", law, joint) for name in ("dart", "pybullet") for law in LAWS for joint in "DE"),
            *(("dart", "contact", None, joint) for joint in "DBE"),
            *((name, "ideal", None, "B") for name in ("dart", "pybullet")),
        ),
    ],
)
def test_energy_is_balanced_through_impacts(
    name: str, joint_model: JointModel, law: ContactLaw | None, joint: str
) -> None:
    """To 5e-5 of all that goes in and out, and 2 % of what contact takes; in the very step of a rigid impact the mean
    velocity's energy is none.
    """
    trace = watched(name, joint_model, law, joint)
    m, w = rattling(law, joint), seen(trace)
    energy = sum(
        b.mass * np.abs(w.velocity[b.name]) ** 2 / 2
        + b.moment_of_inertia * w.angular_velocity[b.name] ** 2 / 2
        + b.mass * G * w.place[b.name].imag
        for b in m.bodies
    )
    motor = w.torque * w.angular_velocity["crank"]
    load = np.real(np.conj(3 - 8j) * moved(m, w, "coupler", "com")[1]) + 0.2 * w.angular_velocity["coupler"]
    contact = np.zeros(w.time.size)
    for pin, force in w.force.items():
        first, second = m.joint(pin).bodies
        (at, rate), (end, end_rate) = (moved(m, w, body, pin) for body in (first, second))
        contact += np.real(np.conj(force) * (end_rate - rate))
        push = np.real(np.conj(force) * (at - end))
        assert push.min() > -1e-9, "a pin is never pulled"
        assert push.max() > 0

    def work(power: np.ndarray) -> np.ndarray:
        return np.append(0.0, np.cumsum((power[1:] + power[:-1]) * np.diff(w.time) / 2))

    missing = np.abs(energy - energy[0] - work(motor + load + contact))
    through = work(np.abs(motor) + np.abs(load) + np.abs(contact))[-1]
    assert np.quantile(missing, 0.99) < 5e-5 * through
    assert missing[-1] < 5e-5 * through
    if w.force:
        taken = -work(contact)[-1]
        assert taken > 1e-3
        assert missing[-1] < 0.02 * taken


@pytest.mark.slow
@pytest.mark.parametrize(("name", "joint_model", "law", "joint"), RATTLING)
def test_reports_are_the_same_watched_or_not(
    name: str, joint_model: JointModel, law: ContactLaw | None, joint: str
) -> None:
    trace = watched(name, joint_model, law, joint)
    m = rattling(law, joint) if joint_model != "ideal" else rattling().with_clearances({"B": 0.0})
    plain = engine(name).simulate(request_of(m, joint_model, "driven", trace.crank_angle, start="centred"))
    assert plain.watched is None
    assert plain.free_share == trace.free_share
    for signal, values in plain.signals.items():
        np.testing.assert_array_equal(trace.signals[signal], values)
    w = seen(trace)
    assert trace.time is not None
    assert np.degrees(w.angle["crank"][[0, -1]]) == pytest.approx([0.0, 108.0 + 72.0], abs=0.02)
    rows = np.array([int(np.argmin(np.abs(w.time - time))) for time in trace.time])
    np.testing.assert_allclose(w.time[rows], trace.time, atol=1e-10)
    for joint_seen, force in w.force.items():
        np.testing.assert_allclose(
            force[rows], vector(trace, f"reaction_{joint_seen}"), atol=1e-7 * np.abs(force).max()
        )
    np.testing.assert_allclose(w.torque[rows], trace.signals["drive_torque"], atol=1e-7 * np.abs(w.torque).max())
    for body in ("crank", "coupler", "follower"):
        np.testing.assert_allclose(w.angle[body][rows], trace.signals[f"{body}_angle"], atol=1e-8)
        spin = trace.signals[f"{body}_angular_velocity"]
        np.testing.assert_allclose(w.angular_velocity[body][rows], spin, atol=1e-6)
        np.testing.assert_allclose(w.place[body][rows], vector(trace, body), atol=1e-9)
        np.testing.assert_allclose(w.velocity[body][rows], trace.rates[body].velocity, atol=1e-7)


@pytest.mark.dart
def test_a_result_says_what_its_law_is_and_delivers() -> None:
    m = rattling("flores")
    law = named_law(m, m.joint("B"), "driven")
    assert law is not None
    settings = run(engine("dart"), m, "spring-damper", "driven", [0.0, 1.0], start="centred").settings
    assert settings["contact_law"] == law.words
    assert settings["contact_stiffness"] == pytest.approx(1e6)
    assert settings["restitution"] == {"B": 0.8}
    assert settings["restitution_delivered"] == {"B": pytest.approx(delivered(law.hysteresis))}
    assert settings["minimum_impact_speed"] == pytest.approx(law.slowest)
    m = rattling("kelvin-voigt")
    voigt = run(engine("dart"), m, "spring-damper", "driven", [0.0, 1.0], start="centred").settings
    assert voigt["restitution_delivered"] == {"B": pytest.approx(0.8)}
    assert "minimum_impact_speed" not in voigt


@pytest.mark.dart
def test_darts_own_contact_knows_no_law_by_name() -> None:
    with pytest.raises(Unsupported, match=r"dart has no contact laws by name \(for contact joints in driven motion\)"):
        run(engine("dart"), rattling("flores"), "contact", "driven", [10.0])


@pytest.mark.pybullet
def test_an_exported_script_knows_no_law_by_name(tmp_path: Path) -> None:
    asked = request_of(rattling("flores"), "spring-damper", "driven", np.zeros(1))
    with pytest.raises(Unsupported, match="pybullet has no contact laws by name in its exports"):
        engine("pybullet").export(asked, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("name", ["dart", "pybullet"])
def test_half_a_revolution_converges_to_the_exact_motion(name: str, law: ContactLaw) -> None:
    """Through its impacts, and as the step shrinks: of first order, as these engines' Coriolis forces are."""
    m = rattling(law)
    loop = contact_ode.loop_of(m)
    exact = contact_ode.simulate(m, loop, contact_ode.centred(m, loop), np.pi)
    assert exact.impacts.time.size >= 2
    theta = np.linspace(0.0, np.pi, 91)
    off = []
    for step in (3.2e-6, 0.8e-6):
        trace = engine(name).simulate(request_of(m, "spring-damper", "driven", theta, start="centred", step=step))
        angles = {body: np.interp(theta, exact.crank, exact.watched.angle[body]) for body in ("coupler", "follower")}
        off.append(max(float(np.abs(trace.signals[f"{b}_angle"] - angle).max()) for b, angle in angles.items()))
    assert off[1] < 0.4 * off[0]
    assert off[1] < 5e-5

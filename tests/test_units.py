"""Linkages of every size are simulated as what they are like; units change nothing but the exponents of numbers."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from analytic.mechanism import Drive, Load, Mechanism
from analytic.mechanism.file import dumps, load, loads, shipped_cases
from analytic.mechanism.signals import named
from asked import job_of, request_of
from compare.baseline.runs import setups
from compare.crosscheck import crosscheck_job
from compare.judge.tolerances import load_tolerances
from linkages import inverted_slider, shaper
from marks import slow
from sim_models.common.contact_laws import DRIVEN_STIFFNESS, STATIC_STIFFNESS, TURN_BY_GIVE, carried, default_stiffness
from sim_models.common.units import SI, Units
from sim_models.common.weights import with_equal_masses
from sim_models.engine import ENGINES, SimulationError, Trace, Unsupported, engine
from tests.evidence.validation.scales import Scale, linkage, scale_rows, scales

TURN = np.radians(np.arange(0.0, 360.0, 30.0))
OTHER = Units(2.0**3, 2.0**-30, 2.0**-12)  # of length (m), mass (kg) and time (s)


def everything() -> Mechanism:
    """A linkage with every field that has a unit."""
    m = inverted_slider()
    slide = next(j for j in m.joints if j.prismatic)
    pin = next(j for j in m.joints if not j.prismatic and j is not m.drive_joint)
    m = m.with_joint(slide.name, friction_torque=0.3, damping=0.7, stiffness=11.0, rest_angle=0.02)
    elasticity = {"translation": 2e11, "rotation": 3e9}
    m = m.with_joint(
        pin.name,
        clearance=1e-4,
        pin_radius=5e-3,
        contact_stiffness=3e6,
        contact_damping=40.0,
        stiffness=2.0,
        rest_angle=0.1,
    )
    m = m.with_joint(pin.name, elasticity=elasticity, damping=0.01, friction_torque=0.05)
    body = m.bodies[-1]
    m = m.with_body(
        body.name, marker=(0.01, 0.02), section=(0.01, 0.02), inertia=1e-4, youngs_modulus=2e11, shear_modulus=8e10
    )
    for name, static in ((slide.name, 0.5), (pin.name, 0.2)):
        m = m.with_joint(name, static_torque=static, stribeck_speed=0.7, drag=0.03, cubic=-0.9)
    drive = Drive(
        joint=m.drive_joint.name,
        speed=7.0,
        stiffness=500.0,
        ripple={"amplitude": 0.01, "harmonic": 2},
        periodic_torque={"amplitude": 0.3, "harmonic": 5},
    )
    return m.replace(gravity=(1.0, -9.0), drive=drive, loads=(Load(body=body.name, force=(3.0, -4.0), torque=0.6),))


def test_a_mechanism_comes_back_from_other_units_to_the_last_bit() -> None:
    m = everything()
    there = OTHER.mechanism(m)
    back = Units(1 / OTHER.length, 1 / OTHER.mass, 1 / OTHER.time).mechanism(there)
    assert back == m
    assert there.gravity[1] == -9.0 * OTHER.time**2 / OTHER.length
    assert there.speed == 7.0 * OTHER.time
    assert there.loads[0].torque == 0.6 * OTHER.time**2 / (OTHER.mass * OTHER.length**2)


WAYS = [("ideal", "driven"), ("contact", "static"), ("spring-damper", "driven")]
QUICK = [("mujoco", *WAYS[1]), ("mujoco", *WAYS[2]), ("exudyn", *WAYS[0]), ("pybullet", *WAYS[1]), ("dart", *WAYS[0])]


@pytest.mark.long_rows("mujoco-contact-static")
@pytest.mark.parametrize(
    ("name", "joint_model", "motion"),
    [*QUICK, *slow(*((name, *way) for name in ENGINES for way in WAYS if (name, *way) not in QUICK))],
)
def test_similar_linkages_have_the_same_digits(name: str, joint_model: str, motion: str) -> None:
    """A micromechanism, and one whose lengths, masses and times are other powers of two: what is said of both differs
    in exponents only.
    """
    chosen = engine(name)
    small = linkage(Scale(1e-5, 300.0, 1.0))
    smaller = Units(2.0**3, 2.0**7, 2.0**2).mechanism(small)
    first, second = (chosen.simulate(request_of(m, joint_model, motion, TURN[1:4])) for m in (small, smaller))
    known = named(small.bodies, small.joints, small.drives, small.sensors)
    for signal, values in first.signals.items():
        scale = Units(2.0**3, 2.0**7, 2.0**2).size(known[signal].unit)
        assert np.array_equal(values, second.signals[signal] * scale), signal
    assert first.settings["units"]["length"] < 1e-3
    if first.settings.get("step"):
        assert first.settings["step"] == second.settings["step"] * 4


@pytest.mark.parametrize(
    ("joint_model", "motion"), [("ideal", "driven"), *slow(("ideal", "static"), ("contact", "static"))]
)
@pytest.mark.parametrize("name", ENGINES)
def test_a_bodys_name_does_not_make_its_signals_others(name: str, joint_model: str, motion: str) -> None:
    """A coupler called reaction_hub, in a micromechanism, whose units are not SI's: its angle is no force."""
    chosen = engine(name)
    plain = linkage(Scale(1e-5, 300.0, 1.0))
    hub = loads(dumps(plain).replace("coupler", "reaction_hub"))
    assert "reaction_hub" in hub.moving
    expected, found = (chosen.simulate(request_of(m, joint_model, motion, TURN[1:4])) for m in (plain, hub))
    assert found.settings["units"]["length"] < 1e-3
    for signal, values in expected.signals.items():
        assert np.array_equal(values, found.signals[signal.replace("coupler", "reaction_hub")]), signal


def test_a_signal_that_a_linkage_has_not_is_refused() -> None:
    m = load("paper")
    trace = Trace("fake", "1", "ideal", "static", TURN[:1], None, {"elbow_angle": np.zeros(1)})
    with pytest.raises(SimulationError, match=r"fake: .* has no signal 'elbow_angle'"):
        SI.trace(m, trace)


def test_units_are_those_of_si_where_engines_are_at_home() -> None:
    for case in shipped_cases():
        for setup in setups(load(case)):
            units = Units.of(setup.request)
            assert units == (
                Units(time=2.0**-6) if (case, setup.request.motion) == ("slider-crank", "driven") else SI
            ), setup.name  # 5000 rpm


def test_the_units_of_a_course_are_those_of_its_pace() -> None:
    m = load("crank-rocker").replace(drive=Drive(joint="D", speed="measured"))
    time = np.linspace(0.0, 1e-3, 9)
    fast = request_of(m, time=time, course=(time, 2e4 * time))
    assert Units.of(fast).time < 1e-2
    assert Units.of(request_of(m, time=time, course=(time, 20 * time))) == SI


@pytest.mark.slow
@pytest.mark.parametrize("name", ENGINES)
def test_a_crank_rocker_of_a_twentieth_agrees(name: str) -> None:
    """2.5 mm of crank at 60 rad/s: inertias of 3e-12 kg.m2, which an engine once raised to 1e-10."""
    m = linkage(Scale(0.006, 60.0, 1.0))
    assert min(b.moment_of_inertia for b in m.bodies) < 3e-12
    result = crosscheck_job(
        job_of(
            m.replace(gravity=(0.0, 0.0), loads=()).with_clearances({}),
            (name,),
            load_tolerances(),
            theta=TURN,
        )
    )
    assert result.verdict == "agrees"


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [1e-9, *slow(1e-3, 1e3)])
@pytest.mark.parametrize("name", ENGINES)
def test_masses_of_nine_decades_agree_or_are_refused(name: str, ratio: float) -> None:
    for motion in ("driven", "static"):
        job = job_of(
            linkage(Scale(0.12, 30.0, ratio)),
            (name,),
            load_tolerances(),
            motion,
            TURN[::2],
            joint_model="ideal",
        )
        assert crosscheck_job(job).verdict == "agrees"


def test_at_rest_unequal_masses_are_weights_on_equal_ones() -> None:
    m = linkage(Scale(0.12, 30.0, 1e-9)).with_body("follower", marker=(0.02, 0.01))
    even = with_equal_masses(m)
    assert len({b.mass for b in even.bodies}) == 1
    assert even.gravity == (0.0, 0.0)
    for b in m.bodies:
        weight = next(load for load in even.loads if load.body == b.name and load not in m.loads)
        assert even.body(b.name).point(weight.point) == b.centre
        assert weight.force == (0.0, -9.81 * b.mass)
        assert even.body(b.name).point("com") == b.point("com")
    assert with_equal_masses(load("crank-rocker")) == load("crank-rocker")


def test_default_stiffness_is_that_of_shipped_cases_and_grows_with_the_forces_of_others() -> None:
    for case in shipped_cases():
        for setup in setups(load(case)):
            m, motion = setup.request.mechanism, setup.request.motion
            if (case, motion) != ("slider-crank", "driven"):  # 5000 rpm: 10 kN
                assert default_stiffness(m, motion) == (STATIC_STIFFNESS if motion == "static" else DRIVEN_STIFFNESS)
    light, heavy = (default_stiffness(linkage(Scale(size, 30.0, 1.0)), "driven") for size in (1e-3, 30.0))
    assert light < 1e-3 * DRIVEN_STIFFNESS
    assert heavy > 1e3 * DRIVEN_STIFFNESS
    assert math.log2(heavy / DRIVEN_STIFFNESS).is_integer()


def test_default_stiffness_lets_weights_and_loads_turn_no_link_by_more_than_a_cross_check_allows() -> None:
    """The ram of 3.3 kN and 17.5 kg of links, on a crank of 80 mm: 2.48e8 N/m, whatever the motion and its speed."""
    m = shaper()
    wanted = (3300.0 + 17.5 * 9.81) / (1.75e-4 * 0.08)
    assert wanted == pytest.approx(2.4798e8, rel=1e-4)
    for speed in (1.0, 6.283, -20.0):
        turned = m.replace(drive=m.drive.model_copy(update={"speed": speed}))  # type: ignore[union-attr]
        assert default_stiffness(turned, "driven") == pytest.approx(wanted, rel=1e-12)
    assert default_stiffness(m, "static") == pytest.approx(wanted, rel=1e-12)
    assert default_stiffness(m.replace(loads=()), "static") == STATIC_STIFFNESS  # its weights alone want 1.2e7
    assert default_stiffness(m.replace(loads=()), "driven") == pytest.approx(17.5 * 9.81 / (1.75e-4 * 0.08))
    twisted = m.replace(gravity=(0.0, 0.0), loads=(Load(body="lever", torque=-600.0),))  # 1.5 kN on 0.4 m
    assert carried(twisted) == pytest.approx(1500.0)
    assert load_tolerances().line("static", "contact", "angle").absolute == TURN_BY_GIVE


def test_an_error_has_its_times_in_seconds_whatever_units_a_run_is_in() -> None:
    asked = request_of(linkage(Scale(1e-6, 1e-3, 1.0)), "ideal", "driven", TURN)
    assert Units.of(asked).time != 1.0
    with pytest.raises(
        SimulationError, match=r": (\S+) s would take \S+ steps of \S+ s, and \S+ are the most"
    ) as found:
        engine("mujoco").simulate(asked)
    said = re.search(r": (\S+) s would take (\S+) steps of (\S+) s", str(found.value))
    assert said is not None
    whole, count, step = map(float, said.groups())
    assert whole == pytest.approx(np.ptp(asked.schedule.time), rel=0.05)
    assert count * step == pytest.approx(whole, rel=0.05)
    assert "units of" not in str(found.value)


def test_the_numbers_of_a_message_are_brought_to_si_each_by_its_unit() -> None:
    units = Units(length=0.5, mass=4.0, time=0.25)
    for said, in_si in (
        ("between 0.1 s and 2 s (step 1e-05 s)", "between 0.025 s and 0.5 s (step 2.5e-06 s)"),
        ("0.2 m deep at 90 deg, stiffness 1e+06 N/m", "0.1 m deep at 90 deg, stiffness 6.4e+07 N/m"),
        ("3 J of 8 J in 12 steps", "48 J of 128 J in 12 steps"),
    ):
        assert units.said(said, "four-bar") == in_si
    assert units.said("rig of 3 kg: 3 kg", "rig of 3 kg") == "rig of 3 kg: 12 kg"


def test_what_an_engine_does_not_do_is_said_in_si_too() -> None:
    light = linkage(Scale(1e-3, 1e3, 1.0)).with_body("coupler", mass=1e-22, inertia=1e-9)
    asked = request_of(light, "ideal", "driven", TURN)
    assert Units.of(asked).mass != 1.0
    with pytest.raises(Unsupported, match="has mass = 1e-22 kg, of which MuJoCo wants more"):
        engine("mujoco").simulate(asked)


@pytest.mark.exudyn
def test_exudyn_says_in_seconds_when_it_failed() -> None:
    """A step of 24 degrees tears the loop open at once: at the next 30 degrees, which is when the crank is there."""
    asked = request_of(linkage(Scale(1e-3, 1e3, 1.0)), "ideal", "driven", TURN)
    with pytest.raises(SimulationError) as found:
        engine("exudyn").simulate(replace(asked, step=0.8 * float(asked.schedule.time[1])))
    said = re.search(r"at crank angle 30 deg \(time (\S+) s\)", str(found.value))
    assert said is not None
    assert float(said[1]) == pytest.approx(asked.schedule.time[1], rel=1e-3)
    assert f"({asked.mechanism.name})" in str(found.value)


@pytest.mark.slow
def test_the_scales_of_the_report_span_what_they_should() -> None:
    every = scales()
    assert {s.length for s in every} >= {1e-6, 30.0}
    assert {s.speed for s in every} >= {1e-3, 1e3}
    assert max(s.mass_ratio for s in every) / min(s.mass_ratio for s in every) >= 1e9
    row, *_ = scale_rows(("mujoco",), [Scale(1e-6, 1e3, 1.0)], 1)
    assert (*row.scale, row.simulator, row.run, row.verdict) == (1e-6, 1e3, 1.0, "mujoco", "ideal, driven", "agrees")

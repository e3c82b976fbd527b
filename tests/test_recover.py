"""Every effect of the vocabulary, hidden in data that another engine made, comes back by name, place and value."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest

from analytic.mechanism import GROUND, MASS_CENTRE, Load, Mechanism, Sensor
from analytic.mechanism.file import load
from compare.diagnose.data.recording import Measured
from compare.diagnose.effects.effect import Effect, Rig, Values
from compare.diagnose.effects.sensors import EFFECTS
from compare.diagnose.effects.vocabulary import VOCABULARY
from diagnosis_rigs import SENSORS, assert_recovered, diagnosed, experiment, four_bar, named, played, turn, wrong
from tests.evidence.scoreboard.sizes import Planted

RECOVERED = {  # effect -> where, values
    "gravity": ("linkage", {"x": 1.0, "y": -9.0}),
    "payload": ("coupler", {"mass": 0.03, "along": 0.02, "normal": 0.015}),
    "com_offset": ("follower", {"along": 0.006, "normal": 0.003}),
    "moment_of_inertia": ("follower", {"inertia_error": 2e-4}),
    "body_mass": ("follower", {"mass_error": 0.03}),
    "link_length": ("follower", {"length_error": 2e-4}),
    "pivot_position": ("E", {"x": 2e-4, "y": -1.5e-4}),
    "joint_clearance": ("B", {"radial_clearance": 2e-4}),
    "coulomb_friction": ("B", {"friction_torque": 0.02}),
    "viscous_friction": ("E", {"damping": 0.01}),
    "joint_spring": ("E", {"stiffness": 0.05, "rest_angle": 1.2}),
    "external_force": ("follower", {"x": 1.0, "y": -0.7}),
    "load_torque": ("follower", {"torque": 0.05}),
    "link_flexibility": ("linkage", {"youngs_modulus": 3e10}),
    "drive_compliance": ("drive", {"stiffness": 500.0}),
    "drive_backlash": ("drive", {"half_gap": 3e-3}),
    "speed_ripple": ("drive", {"amplitude": 1e-3, "harmonic": 3.0, "phase": 0.7}),
    "encoder_offset": ("crank_angle", {"offset": 1e-3}),
    "sensor_bias": ("coupler_x", {"bias": 5e-5}),
    "sensor_gain": ("drive_torque", {"gain_error": 0.03}),
    "sensor_delay": ("follower_angle", {"delay": 1e-3}),
    "sensor_frame": ("E", {"rotation": 0.3}),
    "clock_offset": ("fast-reverse", {"offset": 1e-3}),
    "sensor_lag": ("drive_torque+reaction_E_x+reaction_E_y", {"time_constant": 5e-3}),
    "sensor_drift": ("reaction_E_x", {"drift": 0.08}),
    "stribeck_friction": ("E", {"friction_torque": 0.05, "static_torque": 0.15, "stribeck_speed": 1.5}),
    "load_friction": ("B", {"coefficient_radius": 1e-3}),
    "drag": ("E", {"drag": 0.01}),
    "joint_compliance": ("B", {"stiffness": 3e5}),
    "nonlinear_spring": ("E", {"stiffness": 0.02, "cubic": 0.3, "rest_angle": 1.2}),
    "periodic_torque": ("drive", {"amplitude": 0.05, "harmonic": 14.0, "phase": 0.7}),
    "encoder_harmonic": ("crank_angle", {"amplitude": 1e-3, "harmonic": 2.0, "phase": 0.7}),
}
PLAYED_BY = {
    "load_friction": "dart",
    "joint_clearance": "dart",
    "sensor_bias": "dart",
    "load_torque": "dart",
    "drive_backlash": "dart",
}  # the others by Exudyn; MuJoCo diagnoses
MORE_SENSORS = {"com_offset": {"coupler_y": 1e-5}}


def hidden(name: str) -> Planted:
    where, values = RECOVERED[name]
    return Planted(name, where, values)


# they have tests of their own: each line has its jitter, a law rattles, and chips are of a file with sensors
APART = {"stamp_jitter", "contact_law", "sensor_place", "axis_error"}
PLAYED = [n for n in VOCABULARY if n not in APART]


@pytest.mark.slow
@pytest.mark.parametrize("name", PLAYED)
def test_a_hidden_effect_is_recovered(name: str) -> None:
    assert name in RECOVERED, f"{name} has no case: say where it is hidden and how large it is"
    rig = experiment(sensors=SENSORS | MORE_SENSORS.get(name, {}))
    data = played(rig, hidden(name), source=PLAYED_BY.get(name, "exudyn"))
    assert_recovered(diagnosed(data), hidden(name))


def stamped(off: float, encoder: float) -> tuple[Measured, dict[str, float]]:
    """Two runs of 50 and 110 lines a second whose stamps are up to ``off`` (s) early or late, of an encoder with that
    noise (rad); with the jitter (s, rms) of each.
    """
    rig, rng = experiment(turn("slow", 4.0, follows=True, samples=80), turn("fast", -9.0, follows=True, samples=80)), 5
    late = [np.random.default_rng(rng + k).uniform(-off, off, p.time.size) for k, p in enumerate(rig.plans)]
    plans = tuple(replace(p, time=p.time + d) for p, d in zip(rig.plans, late, strict=True))
    seen = played(replace(rig, noise={**rig.noise, "crank_angle": encoder}, plans=plans))
    runs = tuple(replace(run, time=p.time) for run, p in zip(seen.runs, rig.plans, strict=True))
    drawn = {f"jitter@{p.name}": math.sqrt(float(np.mean(d**2))) for p, d in zip(rig.plans, late, strict=True)}
    return replace(seen, runs=runs), drawn


@pytest.mark.slow
def test_jitter_of_time_stamps_is_recovered() -> None:
    measured, drawn = stamped(3e-3, 5e-5)
    result = diagnosed(measured)
    assert named(result) == [("stamp_jitter", "crank_angle")]
    assert result["verdict"] == "explained"
    assert result["gap"]["before"] > 40
    (jitter,) = result["effects"][0]["parameters"].values()  # one value does for both, which are of one spread
    assert jitter["value"] == pytest.approx(np.mean([*drawn.values()]), rel=0.05)


@pytest.mark.slow
def test_a_noisy_encoder_is_no_jitter_of_time_stamps() -> None:
    assert named(diagnosed(stamped(0.0, 0.02)[0])) == []


@pytest.mark.slow
def test_a_coarse_encoder_that_alone_says_when_lines_were_read_leaves_no_gap() -> None:
    """2 mrad of the encoder are 1.4 mrad of the follower, and its own noise is 0.05 mrad."""
    measured, drawn = stamped(3e-3, 2e-3)
    result = diagnosed(measured)
    assert named(result) == [("stamp_jitter", "crank_angle")]
    assert result["verdict"] == "explained"
    assert any("lines seem not to be read when their stamps say" in note for note in result["notes"])
    jitter = result["effects"][0]["parameters"]["jitter"]["value"]  # one value does for both
    assert jitter == pytest.approx(np.mean([*drawn.values()]), rel=0.1)


# ---------------------------------------------------------------- the pure functions themselves


@dataclass(frozen=True)
class Place:
    """An effect somewhere on the four-bar."""

    effect: Effect
    where: str
    variant: float

    def __str__(self) -> str:
        return f"{self.effect.name}@{self.where}:{self.variant:.3g}"


CHIP = Sensor(name="chip", kind="accelerometer", body="coupler")
RIG = experiment(
    turn("slow", 4.0),
    turn("fast-reverse", -12.0),
    turn("followed", 4.0, follows=True),
    mechanism=four_bar().replace(sensors=(CHIP,)),
    sensors={**SENSORS, "chip": 0.02},
).rig
SLIDER = four_bar("slider-crank", loads=())


def few(variants: Sequence[float]) -> Sequence[float]:
    """The variants, of many harmonics the first and the last."""
    return variants if len(variants) <= 4 else (variants[0], variants[-1])


PLACES = [Place(e, w, v) for e in VOCABULARY.values() for w in e.places(RIG) for v in few(e.variants(RIG, w))]
BY_THEMSELVES = [p for p in PLACES if p.effect.acts_by_itself(p.variant)]  # as a quarter turn does
TIME = np.linspace(0.0, 1.0, 50)


def acts_in_time(effect: Effect, where: str, values: Values) -> list[bool]:
    """Whether it delays, filters or lets creep any sensor in any run, or makes its stamps jitter."""
    acts = effect.delay, effect.lag, effect.drift
    of_sensors = [any(act(run, s, where, values) for run in RIG.runs for s in RIG.signals) for act in acts]
    return [*of_sensors, any(effect.jitter(run, values) for run in RIG.runs)]


def changed(mechanism: Mechanism, name: str, where: str) -> Mechanism:
    return VOCABULARY[name].on_mechanism(mechanism, where, RECOVERED[name][1])


def test_every_effect_has_a_place_on_a_four_bar() -> None:
    assert {p.effect.name for p in PLACES} == set(VOCABULARY)


@pytest.mark.parametrize("place", PLACES, ids=str)
def test_an_effect_changes_nothing_that_it_is_given(place: Place) -> None:
    effect, where, variant = place.effect, place.where, place.variant
    scales = np.asarray(effect.scales(RIG, where, variant))
    values = effect.values(RIG, where, 3.0 * scales, variant)
    before, kept = RIG.mechanism.model_dump_json(), dict(values)
    seen = {s: np.cos(TIME + k) for k, s in enumerate(RIG.signals)}
    copies = {s: v.copy() for s, v in seen.items()}
    for v in seen.values():
        v.flags.writeable = False
    mechanism = effect.on_mechanism(RIG.mechanism, where, effect.in_run(values, "slow"))
    read = effect.on_readings(seen, "slow", where, values)
    assert RIG.mechanism.model_dump_json() == before
    assert values == kept
    assert list(seen) == list(copies)
    assert all(np.array_equal(seen[s], copies[s]) for s in seen)
    altered = any(not np.array_equal(read[s], seen[s]) for s in seen)
    done = [mechanism != RIG.mechanism, altered, *acts_in_time(effect, where, values)]
    assert sum(done) == 1, "it does its one thing, and does something"
    assert effect.sensor == (mechanism.replace(sensors=RIG.mechanism.sensors) == RIG.mechanism)


@pytest.mark.parametrize("place", BY_THEMSELVES, ids=str)
def test_a_variant_that_acts_by_itself_does_something_at_zero(place: Place) -> None:
    effect, where, variant = place.effect, place.where, place.variant
    values = effect.values(RIG, where, np.zeros(len(effect.scales(RIG, where, variant))), variant)
    seen = {s: np.cos(TIME + k) for k, s in enumerate(RIG.signals)}
    read = effect.on_readings(seen, "slow", where, values)
    assert any(not np.allclose(read[s], seen[s]) for s in seen)


def test_only_load_cells_have_variants_that_act_by_themselves() -> None:
    assert {p.effect.name for p in BY_THEMSELVES} == {"sensor_frame"}
    assert len(BY_THEMSELVES) == 3, "a quarter turn either way and a half turn of the one load cell"


@pytest.mark.parametrize("place", [p for p in PLACES if p not in BY_THEMSELVES], ids=str)
def test_an_effect_of_zero_is_none(place: Place) -> None:
    effect, where, variant = place.effect, place.where, place.variant
    zero = np.zeros(len(effect.scales(RIG, where, variant)))
    values = effect.values(RIG, where, zero, variant)
    seen = {s: np.cos(TIME + k) for k, s in enumerate(RIG.signals)}
    read = effect.on_readings(seen, "slow", where, values)
    assert all(np.array_equal(read[s], seen[s]) for s in seen)
    assert not any(acts_in_time(effect, where, values))
    assert np.all(effect.lowest(RIG, where, variant) <= 0), "no effect must be allowed"
    assert_same_linkage(effect.on_mechanism(RIG.mechanism, where, effect.in_run(values, "slow")), RIG.mechanism)


def assert_same_linkage(one: Mechanism, other: Mechanism) -> None:
    """Physically the same, to what a stiffness of 1e9 times the scale's reciprocal leaves."""
    assert one.gravity == pytest.approx(other.gravity)
    assert one.ground == other.ground
    for a, b in zip(one.bodies, other.bodies, strict=True):
        assert a.mass == pytest.approx(b.mass)
        assert a.moment_of_inertia == pytest.approx(b.moment_of_inertia)
        assert {k: complex(*v) for k, v in a.points.items()} == {
            k: pytest.approx(complex(*v)) for k, v in b.points.items()
        }
        for point in ("com", MASS_CENTRE):
            assert a.point(point) == pytest.approx(b.point(point))
        assert (1 / a.youngs_modulus if a.youngs_modulus else 0.0) < 1e-18
    for a, b in zip(one.joints, other.joints, strict=True):
        for field in ("clearance", "friction_torque", "stiction", "friction_radius", "damping", "drag", "cubic"):
            assert getattr(a, field) == getattr(b, field)
        assert (1 / a.radial_stiffness if a.radial_stiffness else 0.0) < 1e-12
        assert abs(a.stiffness - b.stiffness) < 1e-8 * RIG.torque
        assert abs(a.stiffness * a.rest_angle - b.stiffness * b.rest_angle) < 1e-8 * RIG.torque
    loads = [x for x in one.loads if any(x.force) or x.torque]
    assert loads == list(other.loads)
    drive = one.drive
    assert drive is not None
    assert drive.ripple is None or drive.ripple.amplitude == 0
    assert drive.periodic_torque is None or drive.periodic_torque.amplitude == 0
    assert drive.stiffness is None or drive.stiffness > 1e9


@pytest.mark.parametrize("name", ["payload", "com_offset", "link_length"])
@pytest.mark.parametrize("where", ["crank", "coupler", "follower"])
def test_marker_and_loads_stay_where_the_nominal_com_is(name: str, where: str) -> None:
    nominal = RIG.mechanism
    now = changed(nominal, name, where)
    assert now.moving[where].point("com") == pytest.approx(nominal.moving[where].centre)
    assert now.loads == nominal.loads
    moved = now.moving[where].centre - nominal.moving[where].centre
    assert (abs(moved) > 1e-4) == (name != "link_length")


def test_a_second_effect_on_a_body_leaves_the_marker_at_the_nominal_com_too() -> None:
    twice = changed(changed(RIG.mechanism, "com_offset", "coupler"), "payload", "coupler")
    assert twice.moving["coupler"].point("com") == pytest.approx(RIG.mechanism.moving["coupler"].centre)


def test_com_offset_moves_the_mass_and_keeps_the_inertia_about_it() -> None:
    body, now = RIG.mechanism.moving["follower"], changed(RIG.mechanism, "com_offset", "follower").moving["follower"]
    assert now.centre - body.centre == pytest.approx(complex(0.006, 0.003))
    assert (now.mass, now.moment_of_inertia) == pytest.approx((body.mass, body.moment_of_inertia))


def test_a_payload_is_a_point_mass() -> None:
    body, now = RIG.mechanism.moving["coupler"], changed(RIG.mechanism, "payload", "coupler").moving["coupler"]
    m, at = 0.03, body.centre + complex(0.02, 0.015)
    assert now.mass == pytest.approx(body.mass + m)
    assert now.mass * now.centre == pytest.approx(body.mass * body.centre + m * at)
    about_origin = body.moment_of_inertia + body.mass * abs(body.centre) ** 2 + m * abs(at) ** 2
    assert now.moment_of_inertia + now.mass * abs(now.centre) ** 2 == pytest.approx(about_origin)


def test_link_length_moves_the_last_point_along_the_link_and_pivot_position_a_ground_point() -> None:
    body, now = RIG.mechanism.moving["follower"], changed(RIG.mechanism, "link_length", "follower").moving["follower"]
    assert now.points["B"] == pytest.approx((body.points["B"][0] + 2e-4, body.points["B"][1]))
    assert now.points["E"] == body.points["E"]
    assert (now.centre, now.moment_of_inertia) == pytest.approx((body.centre, body.moment_of_inertia))
    ground = changed(RIG.mechanism, "pivot_position", "E").ground.points
    assert ground["E"] == pytest.approx((0.12 + 2e-4, -1.5e-4))
    assert ground["D"] == RIG.mechanism.ground.points["D"]


def test_reported_values_are_whole_fields_and_add_to_what_the_model_has() -> None:
    believed = RIG.mechanism.with_joint("B", damping=0.02)
    rig = Rig(believed, RIG.signals, RIG.runs, RIG.driven, noise=RIG.noise)
    viscous = VOCABULARY["viscous_friction"]
    assert viscous.values(rig, "B", np.array([0.01])) == {"damping": pytest.approx(0.03)}
    assert viscous.lowest(rig, "B") == pytest.approx([-0.02]), (
        "there may be less than is believed, but not less than none"
    )
    assert VOCABULARY["gravity"].values(rig, "linkage", np.array([0.5, 1.0])) == {"x": 0.5, "y": pytest.approx(-8.81)}


def test_loads_and_torques_are_added_to_those_that_there_are() -> None:
    nominal = RIG.mechanism
    assert changed(nominal, "external_force", "coupler").loads == (
        *nominal.loads,
        Load(body="coupler", force=(1.0, -0.7)),
    )
    assert changed(nominal, "load_torque", "follower").loads == (*nominal.loads, Load(body="follower", torque=0.05))


def test_effects_sit_where_they_can_and_nowhere_else() -> None:
    rig = Rig(SLIDER, ("crank_angle", "slider_x"), ("a",), ("a",), noise={"crank_angle": 1e-5, "slider_x": 1e-5})
    prismatic = [j.name for j in SLIDER.joints if j.prismatic]
    assert prismatic
    assert not set(prismatic) & set(VOCABULARY["joint_clearance"].places(rig)), "a prismatic joint has no clearance"
    assert set(prismatic) <= set(VOCABULARY["coulomb_friction"].places(rig))
    assert set(VOCABULARY["pivot_position"].places(rig)) <= set(SLIDER.ground.points)
    assert "crank_angle" not in VOCABULARY["sensor_bias"].places(rig), (
        "a constant error of the encoder is encoder_offset"
    )
    assert not VOCABULARY["sensor_frame"].places(rig), "there is no load cell"
    free = Rig(load("pendulum"), ("pendulum_angle",), ("swing",), (), noise={"pendulum_angle": 1e-4})
    for name in ("clock_offset", "drive_compliance", "speed_ripple"):
        assert not VOCABULARY[name].places(free), f"{name} needs a motor"
    assert GROUND not in VOCABULARY["payload"].places(rig)


def test_one_effect_of_sensors_is_what_the_contract_says() -> None:
    by_name = {e.name: e for e in EFFECTS}
    seen = {"coupler_x": np.sin(TIME), "reaction_E_x": np.cos(TIME), "reaction_E_y": np.sin(TIME), "crank_angle": TIME}
    assert np.allclose(
        by_name["sensor_bias"].on_readings(seen, "slow", "coupler_x", {"bias": 0.5})["coupler_x"], np.sin(TIME) + 0.5
    )
    assert np.allclose(
        by_name["sensor_gain"].on_readings(seen, "slow", "coupler_x", {"gain_error": 0.1})["coupler_x"],
        1.1 * np.sin(TIME),
    )
    turned = by_name["sensor_frame"].on_readings(seen, "slow", "E", {"rotation": math.pi / 2})
    assert np.allclose(turned["reaction_E_x"], np.sin(TIME))
    assert np.allclose(turned["reaction_E_y"], -np.cos(TIME))
    offsets = {"offset@slow": 0.1, "offset@fast-reverse": -0.2}
    for run, offset in (("slow", 0.1), ("fast-reverse", -0.2)):
        assert np.allclose(
            by_name["encoder_offset"].on_readings(seen, run, "crank_angle", offsets)["crank_angle"], TIME + offset
        )
    assert by_name["sensor_delay"].delay("slow", "coupler_x", "coupler_x", {"delay": 1e-3}) == 1e-3
    assert by_name["sensor_delay"].delay("slow", "crank_angle", "coupler_x", {"delay": 1e-3}) == 0
    amplifier, filtered = "drive_torque+reaction_E_x", {"time_constant": 1e-3}
    for signal, constant in (("drive_torque", 1e-3), ("reaction_E_x", 1e-3), ("reaction_E_y", 0), ("crank_angle", 0)):
        assert by_name["sensor_lag"].lag("slow", signal, amplifier, filtered) == constant
    rates = {"drift@slow": 0.1, "drift@fast-reverse": -0.2}
    for run, rate in (("slow", 0.1), ("fast-reverse", -0.2)):
        assert by_name["sensor_drift"].drift(run, "coupler_x", "coupler_x", rates) == rate
        assert by_name["sensor_drift"].drift(run, "crank_angle", "coupler_x", rates) == 0
    assert by_name["clock_offset"].delay("slow", "crank_angle", "slow", {"offset": -2e-3}) == -2e-3
    assert by_name["clock_offset"].delay("fast-reverse", "crank_angle", "slow", {"offset": -2e-3}) == 0


def test_the_case_of_an_effect_is_where_the_effect_can_be() -> None:
    for name, (where, values) in RECOVERED.items():
        assert where in VOCABULARY[name].places(RIG)
        assert set(values) == {p.name for p in VOCABULARY[name].parameters}
        assert wrong(name, where, **values) == hidden(name)

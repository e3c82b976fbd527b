"""The diagnosis from end to end: what it names, what it refuses to name, what would decide, and that it says so
plainly.
"""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import shared
from analytic.mechanism import Load, Mechanism
from analytic.mechanism.file import load
from commands import Ended, assert_refused, compare, compare_alone, without
from compare.diagnose.data.measured import load_measured
from compare.diagnose.data.measured_file import read_file
from compare.diagnose.data.recording import Measured, MeasuredError
from compare.diagnose.effects.effect import Effect, Parameter, Readings, Rig, Values
from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.diagnose.experiment_design import as_toml
from compare.diagnose.locate import locate
from compare.diagnose.prepare import thinned
from compare.diagnose.residuals import Data
from compare.diagnose.workflow import diagnose
from diagnosis_rigs import (
    SENSORS,
    assert_recovered,
    diagnosed,
    experiment,
    four_bar,
    named,
    played,
    readings,
    released,
    told,
    turn,
    wrong,
)
from marks import slow
from tests.evidence.scoreboard.record import write_data
from tests.evidence.scoreboard.rigs import Experiment, Plan
from tests.evidence.scoreboard.sizes import Planted

VISCOUS = wrong("viscous_friction", "E", damping=0.01)
LONGER = wrong("link_length", "coupler", length_error=1e-4)
BIASED = wrong("sensor_bias", "coupler_x", bias=5e-5)


def one(result: dict[str, Any]) -> dict[str, Any]:
    """The only effect named."""
    assert len(result["effects"]) == 1, result["statement"]
    return dict(result["effects"][0])


# ---------------------------------------------------------------- nothing missing


@pytest.mark.parametrize(
    ("seed", "source"),
    [(1, "exudyn"), *slow((2, "dart"), (3, "pybullet"), (4, "exudyn"), (5, "dart"))],
)
def test_no_gap_names_nothing(seed: int, source: str) -> None:
    result = diagnosed(played(experiment(), source=source, seed=seed))
    assert (result["verdict"], result["effects"]) == ("no gap", [])
    assert 0.9 < result["gap"]["before"] < 1.1
    assert result["gap"]["after"] == result["gap"]["before"]
    assert "Nothing is missing" in result["statement"]
    assert result["explained"] == result["mechanism"]


@pytest.mark.slow
def test_no_gap_in_a_free_run_whose_start_is_not_known() -> None:
    pendulum = load("pendulum")
    result = diagnosed(
        released(pendulum, pendulum, {"pendulum_angle": 1e-3}, [(0.2, 0.0), (-2.5, 1.0)], np.linspace(0, 3, 150))
    )
    assert (result["verdict"], result["effects"]) == ("no gap", [])
    assert result["gap"]["after"] < 1.1


@pytest.mark.slow
def test_no_gap_in_a_free_run_of_a_closed_linkage() -> None:
    result = diagnosed(released(four_bar(loads=()), four_bar(loads=()), ROCKER_NOISE, ROCKER_STARTS, ROCKER_TIME))
    assert (result["verdict"], result["effects"]) == ("no gap", [])
    assert result["gap"]["after"] < 1.1


# ---------------------------------------------------------------- several effects, and none of the vocabulary


def two_effects() -> dict[str, Any]:
    """The diagnosis of two effects at once, which several tests look at."""
    return shared.document("two effects", lambda: diagnosed(played(experiment(), VISCOUS, LONGER)))


@pytest.mark.slow
def test_two_effects_at_once() -> None:
    assert_recovered(two_effects(), VISCOUS, LONGER)


@pytest.mark.slow
def test_three_effects_at_once() -> None:
    truth = (VISCOUS, LONGER, BIASED)
    assert_recovered(diagnosed(played(experiment(), *truth)), *truth)


@pytest.mark.slow
def test_a_spring_and_an_encoder_offset_at_once() -> None:
    truth = (
        wrong("joint_spring", "E", stiffness=0.05, rest_angle=1.2),
        wrong("encoder_offset", "crank_angle", offset=1e-3),
    )
    assert_recovered(diagnosed(played(experiment(), *truth, source="dart")), *truth)


@pytest.mark.slow
def test_what_is_outside_the_vocabulary_is_not_explained() -> None:
    """A follower sensor that slips by a step for a third of every revolution is no effect that there is a name for."""
    rig = experiment()
    seen = readings(rig)
    for plan, run in zip(rig.plans, seen, strict=True):
        sector = np.abs(np.remainder(plan.command(plan.time), 2 * math.pi) - 2.0) < 1.0
        run["follower_angle"] = run["follower_angle"] + 2e-3 * sector
    result = diagnosed(rig.measured(seen))
    assert result["verdict"] in ("unexplained", "partly explained")
    assert result["gap"]["after"] > 2
    assert any(place["signal"] == "follower_angle" for place in result["located"])


def test_a_place_where_it_is_off_is_found() -> None:
    """Between 1 and 3 rad, by 2 mrad: what "located" says before anything is named."""
    rig = experiment()
    seen = readings(rig)
    for plan, run in zip(rig.plans, seen, strict=True):
        angle = np.remainder(plan.command(plan.time), 2 * math.pi)
        run["follower_angle"] = run["follower_angle"] + 2e-3 * ((angle > 1) & (angle < 3))
    places = [p for p in diagnosed(rig.measured(seen), only=("gravity",))["located"] if p["run"] == "slow"]
    assert {p["signal"] for p in places} == {"follower_angle"}
    worst = max(places, key=lambda p: p["sigmas"])
    assert worst["size"] == pytest.approx(2e-3, rel=0.1)
    assert worst["unit"] == "rad"
    ends = sorted((worst["crank_angle_from"], worst["crank_angle_to"]))
    assert ends == pytest.approx([1.0, 3.0], abs=0.3)


def test_what_the_engines_differ_by_is_not_listed_as_a_deviation() -> None:
    rig = experiment(turn("slow", 4.0))
    data = Data(rig.measured(readings(rig)), {("slow", signal): noise for signal, noise in SENSORS.items()})
    part = next(p for p in data.parts if p.signal == "follower_angle")
    residual = np.random.default_rng(1).standard_normal(data.size)
    residual[part.place][40:60] += 2e-3 / SENSORS["follower_angle"]
    angles = {"slow": rig.plans[0].command(rig.plans[0].time)}
    for between, listed in ((0.0, 1), (1e-3, 1), (3e-3, 0)):
        assert len(locate(data, residual, angles, {("slow", "follower_angle"): between})) == listed


@pytest.mark.slow
def test_what_every_turn_shows_is_told_by_the_angle_and_the_rest_by_the_turn() -> None:
    """Ten turns the other way round: a noise off around zero in each of them, and a jolt in the fourth."""
    rig = experiment(Plan("slow", -4.0, 0.3, np.linspace(0.0, 5 * math.pi, 3600), None))
    data = Data(rig.measured(readings(rig)), {("slow", signal): noise for signal, noise in SENSORS.items()})
    part = next(p for p in data.parts if p.signal == "follower_angle")
    theta = rig.plans[0].command(rig.plans[0].time)
    angle, passed = np.degrees(theta) % 360, np.degrees(theta[0] - theta)
    jolt = (passed > 3 * 360) & (passed < 3 * 360 + 20)
    residual = np.random.default_rng(1).standard_normal(data.size)
    residual[part.place] += 1.0 * ((angle > 330) | (angle < 40)) + 3.0 * jolt
    places = locate(data, residual, {"slow": theta})
    assert [(p.signal, p.time is None) for p in places] == [("follower_angle", True), ("follower_angle", False)]
    every, once = places
    assert np.degrees([every.begin, every.end - math.tau]) == pytest.approx([330, 40], abs=10)
    assert every.size == pytest.approx(SENSORS["follower_angle"], rel=0.2)
    when = rig.plans[0].time[jolt]
    assert once.time == pytest.approx((when[0], when[-1]), abs=0.5)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("size", "turns", "found"),
    [
        ([0, 10, 0, 0], 4, [False]),  # a jolt in one turn of four
        ([0, 0, 0, 0, 0, 6], 6, [False]),  # the last turn of six
        ([0, 1, 2, 3, 4, 5], 6, [True]),  # a drift: throughout the run
    ],
)
def test_what_one_turn_shows_is_said_of_no_other(size: list[float], turns: int, found: list[bool]) -> None:
    rig = experiment(Plan("slow", 4.0, 0.0, np.linspace(0.0, turns * math.pi / 2, 300 * turns), None))
    data = Data(rig.measured(readings(rig)), {("slow", signal): noise for signal, noise in SENSORS.items()})
    part = next(p for p in data.parts if p.signal == "follower_angle")
    theta = rig.plans[0].command(rig.plans[0].time)
    turn_of = np.minimum((theta - theta[0]) / (2 * math.pi), turns - 1e-9).astype(int)
    where = (np.degrees(theta) % 360 < 60) | (len(size) > 4)
    residual = np.random.default_rng(1).standard_normal(data.size)
    residual[part.place] += np.array(size)[turn_of] * where
    places = locate(data, residual, {"slow": theta})
    assert [p.time is None for p in places] == found
    assert all(p.size > 0 for p in places), "nothing is too low"


@pytest.mark.slow
def test_a_coordinate_that_these_data_do_not_show_stays_where_it_is() -> None:
    """The slide's pivot along the slide; across it, it is the crank's pivot the other way, and both are named."""
    sensors = {"crank_angle": 1e-4, "slider_x": 1e-4}
    rig = experiment(
        turn("slow", 4.0), turn("fast", -9.0), mechanism=four_bar("slider-crank", loads=()), sensors=sensors
    )
    seen = played(rig, wrong("pivot_position", "S", x=0.0, y=2e-3))
    alone = one(diagnosed(seen, only=["pivot_position@S"]))["parameters"]
    assert abs(alone["x"]["value"]) < 1e-9
    assert alone["x"]["low"] is alone["x"]["high"] is None
    assert alone["y"]["value"] == pytest.approx(2e-3, rel=0.03)
    either = one(diagnosed(seen, only=["pivot_position"]))
    assert {either["where"], *(tie["where"] for tie in either["ambiguous_with"])} == {"O", "S"}


@pytest.mark.slow
@pytest.mark.parametrize("bends", [*slow(True), False], ids=["used", "left out"])
def test_stated_moduli_of_elasticity_are_used_where_the_rig_bends(bends: bool) -> None:
    soft = wrong("link_flexibility", "linkage", youngs_modulus=3e10)
    stated = VOCABULARY[soft.name].on_mechanism(four_bar(), soft.where, soft.values)
    seen = replace(played(experiment(), *([soft] if bends else [])), mechanism=stated)
    result = diagnosed(seen)
    assert (result["verdict"], result["effects"]) == ("no gap", [])
    said = "used" if bends else "left out"
    assert any(f"moduli of elasticity are {said}: that explains the data" in note for note in result["notes"])


def test_data_that_are_thinned_for_the_search_are_said_to_be() -> None:
    rig = experiment(turn("slow", 4.0, samples=6000), turn("fast", 12.0, samples=6000))
    data = rig.measured([{s: np.zeros(6000) for s in SENSORS} for _ in rig.plans])
    thin = thinned(data)
    assert sum(run.time.size * len(run.channels) for run in thin.runs) <= 60_000
    assert [(f.run, f.kind, f.samples) for f in thin.faults] == [("slow", "thinned", 3000), ("fast", "thinned", 3000)]
    assert "one in 2 is used" in thin.faults[0].text


# ---------------------------------------------------------------- what these data cannot tell apart


ALIAS_SENSORS = {
    "crank_angle": 4e-5,
    "follower_angle": 6e-5,
    "follower_x": 1e-5,
    "follower_y": 1e-5,
    "coupler_angle": 6e-5,
    "drive_torque": 8e-3,
}
DOWN, UP = Load(body="coupler", force=(0.0, -50.0)), Load(body="coupler", force=(0.0, 50.0))
CLEARANCE = wrong("joint_clearance", "B", radial_clearance=1e-4)


def alias_rig(*more: Plan) -> Experiment:
    """The follower carries its pin's force along itself and, while the load only pushes, always the same way."""
    return experiment(
        turn("slow", 4.0),
        turn("fast", 6.5),
        *more,
        mechanism=four_bar(gravity=0.0, loads=(DOWN,)),
        sensors=ALIAS_SENSORS,
    )


@pytest.mark.slow
def test_clearance_is_not_told_from_length_until_the_load_reverses() -> None:
    result = diagnosed(played(alias_rig(), CLEARANCE, source="dart"))
    assert result["verdict"] == "ambiguous", result["statement"]
    effect = one(result)
    said = {(effect["name"], effect["where"]), *((a["name"], a["where"]) for a in effect["ambiguous_with"])}
    assert {("joint_clearance", "B"), ("link_length", "follower")} <= said
    assert "reverse the load" in effect["would_separate"]
    assert "explained as well" in result["statement"]
    advice = tomllib.loads(effect["would_separate"][effect["would_separate"].index("[[run]]") :])["run"][0]
    assert advice["load"][0]["force"] == [0.0, 50.0]
    lifted = turn("slow-lifted", advice["drive_speed"], tuple(Load.model_validate(x) for x in advice["load"]))
    resolved = diagnosed(played(alias_rig(lifted), CLEARANCE, source="dart"))
    assert_recovered(resolved, CLEARANCE)


@pytest.mark.long_rows("None")
@pytest.mark.parametrize(
    "loads", [None, (), (DOWN,), (DOWN, Load(body="follower", point="B", force=(1.0, 2.0), torque=0.3))]
)
def test_a_run_that_is_proposed_is_read_back_with_its_loads(loads: tuple[Load, ...] | None, tmp_path: Path) -> None:
    run = played(alias_rig()).runs[0]
    path = tmp_path / "measured.toml"
    path.write_text(f'mechanism = "nominal.toml"\n{as_toml(replace(run, loads=loads))}\n', encoding="utf-8")
    (entry,) = read_file(path).runs
    assert (entry.drive_speed, entry.drive_angle, entry.loads) == (run.speed, run.angle, loads)


@pytest.mark.long_rows("coupler")
@pytest.mark.parametrize(("body", "share"), [("follower", -0.2), ("follower", 0.05), ("coupler", -0.2)])
def test_a_link_of_another_mass_is_told_as_that(body: str, share: float) -> None:
    """A lighter one was told as a false bias of a force sensor, a centre of mass and an inertia, each for certain.
    Of a little more, a payload at the centre of mass does nearly as well.
    """
    sensors = {"crank_angle": 5e-4, "follower_angle": 5e-4, "drive_torque": 5e-3}
    cell = {"reaction_E_x": 0.02, "reaction_E_y": 0.02}
    rig = experiment(turn("slow", 4.0), turn("fast", 11.0), turn("reverse", -6.0), sensors=sensors | cell)
    own = rig.nominal.moving[body]
    about = {"com": (own.centre.real, own.centre.imag), "inertia": (1 + share) * own.moment_of_inertia}
    real = replace(rig, nominal=rig.nominal.with_body(body, mass=(1 + share) * own.mass, **about))
    result = diagnosed(rig.measured(readings(real)))
    effect = one(result)
    assert (effect["name"], effect["where"]) == ("body_mass", body)
    assert {t["name"] for t in effect["ambiguous_with"]} == ({"payload"} if share > 0 else set())
    error = effect["parameters"]["mass_error"]
    assert error["low"] < share * own.mass < error["high"]
    assert error["high"] - error["low"] < 0.02 * own.mass


@pytest.mark.slow
def test_a_sensor_that_is_proposed_comes_with_the_noise_that_it_may_have() -> None:
    """A pendulum's period has the ratio of its moment of weight to its inertia; the force in its pivot has more."""
    believed = load("pendulum")
    real = believed.with_body("pendulum", inertia=1.05 * believed.bodies[0].moment_of_inertia)
    data = released(believed, real, {"pendulum_angle": 1e-3}, [(0.8, 0.0)], np.linspace(0, 2, 80))
    effect = one(diagnosed(data, only=("moment_of_inertia", "com_offset")))
    assert effect["ambiguous_with"]
    assert effect["would_separate"].startswith("measure reaction_O_")
    assert "if its noise is" in effect["would_separate"]


CRANK_CELL = SENSORS | {"reaction_D_x": 0.01, "reaction_D_y": 0.01}


@pytest.mark.slow
@pytest.mark.parametrize(
    "truth",
    [
        wrong("payload", "crank", mass=0.02, along=0.015, normal=0.005),
        wrong("com_offset", "crank", along=0.005, normal=0.004),
    ],
    ids=lambda t: t.name,
)
def test_payload_and_com_offset_of_a_crank_at_constant_speed_are_aliases(truth: Planted) -> None:
    rig = experiment(turn("slow", 6.0), turn("fast", 25.0), mechanism=four_bar(gravity=0.0), sensors=CRANK_CELL)
    result = diagnosed(played(rig, truth))
    assert result["verdict"] == "ambiguous"
    effect = one(result)
    said = {effect["name"], *(a["name"] for a in effect["ambiguous_with"] if a["where"] == "crank")}
    assert {"payload", "com_offset"} <= said
    assert "none of what was tried" in effect["would_separate"]


@pytest.mark.slow
def test_friction_and_damping_at_one_speed_are_aliases_and_another_speed_would_tell() -> None:
    result = diagnosed(played(experiment(turn("only", 6.0)), wrong("viscous_friction", "D", damping=2e-3)))
    assert result["verdict"] == "ambiguous"
    effect = one(result)
    said = {(effect["name"], effect["where"]), *((a["name"], a["where"]) for a in effect["ambiguous_with"])}
    assert {("viscous_friction", "D"), ("coulomb_friction", "D")} <= said
    assert effect["would_separate"].count("[[run]]") == 1 or "none of what was tried" in effect["would_separate"]


# ---------------------------------------------------------------- what the engineer rules out


FOLLOWER = wrong("link_length", "follower", length_error=2e-4)


@pytest.fixture(scope="module")
def longer_follower() -> Measured:
    return played(experiment(), FOLLOWER)


def statuses(result: dict[str, Any], name: str, where: str) -> str:
    return str(next(c["status"] for c in result["candidates"] if (c["name"], c["where"]) == (name, where)))


def test_a_link_with_a_tip_behind_its_joints_is_longer_between_these() -> None:
    """The tip, which is told last, is no joint; the rig that was measured has none."""
    m = four_bar().with_body("follower", com=(0.05, 0.0), inertia=2e-4)
    tipped = m.with_body("follower", points={**m.moving["follower"].points, "tip": (0.2, 0.01)})
    result = diagnosed(experiment(mechanism=tipped).measured(readings(experiment(mechanism=m), FOLLOWER)))
    assert_recovered(result, FOLLOWER)


@pytest.mark.parametrize("exclude", slow("link_length", "link_length@follower"))
def test_what_is_excluded_is_not_named(longer_follower: Measured, exclude: str) -> None:
    result = diagnosed(longer_follower, exclude=(exclude,))
    assert ("link_length", "follower") not in named(result)
    assert result["verdict"] != "explained"
    assert statuses(result, "link_length", "follower") == "excluded"
    assert (statuses(result, "link_length", "crank") == "excluded") == (exclude == "link_length")


@pytest.mark.parametrize("only", ["link_length@follower", *slow("link_length")])
def test_only_what_is_asked_for_is_considered(longer_follower: Measured, only: str) -> None:
    result = diagnosed(longer_follower, only=(only,))
    assert_recovered(result, FOLLOWER)
    assert statuses(result, "gravity", "linkage") == "excluded"


def test_only_effects_that_do_not_explain_leave_it_unexplained(longer_follower: Measured) -> None:
    result = diagnosed(longer_follower, only=("gravity", "payload@coupler"))
    assert (result["verdict"], result["effects"]) == ("unexplained", [])
    assert result["gap"]["after"] > 10


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"only": ("drag",), "exclude": ("gravity", "drag")}, "'drag' is both among only and excluded"),
        ({"exclude": ("drag,gravity",)}, "give each by itself"),
    ],
    ids=["on both lists", "two in one"],
)
def test_lists_of_effects_that_say_nothing_are_refused(
    longer_follower: Measured, options: dict[str, Any], said: str
) -> None:
    with pytest.raises(MeasuredError, match=said):
        diagnosed(longer_follower, **options)


@pytest.mark.long_rows(
    "only-link_length@folower-link_length@follower", "only-clearance@B-joint_clearance@B", "exclude-gravty-gravity",
)  # fmt: skip
@pytest.mark.parametrize(
    ("given", "meant"),
    [("gravty", "gravity"), ("link_length@folower", "link_length@follower"), ("clearance@B", "joint_clearance@B")],
)
@pytest.mark.parametrize("option", ["only", "exclude"])
def test_unknown_names_are_refused_with_what_was_meant(
    longer_follower: Measured, option: str, given: str, meant: str
) -> None:
    with pytest.raises(MeasuredError, match=f"{given!r} is not an effect.*did you mean {meant!r}"):
        diagnosed(longer_follower, **{option: (given,)})


@pytest.mark.slow
@pytest.mark.parametrize(
    "tolerance", [{"length": 1e-6}, *slow({"link_length.length_error": 1e-6}, {"length_error": 0.0})]
)
def test_a_tolerance_rules_a_length_out(longer_follower: Measured, tolerance: dict[str, float]) -> None:
    result = diagnosed(replace(longer_follower, tolerance=tolerance))
    assert ("link_length", "follower") not in named(result)
    assert result["verdict"] in ("unexplained", "partly explained")


@pytest.mark.slow
def test_a_tolerance_that_is_wide_enough_rules_nothing_out(longer_follower: Measured) -> None:
    assert_recovered(diagnosed(replace(longer_follower, tolerance={"length": 3e-4})), FOLLOWER)


# ---------------------------------------------------------------- sensors, clocks, encoders


@pytest.mark.parametrize(
    "rotation",
    [
        pytest.param(math.pi, id="upside down", marks=pytest.mark.slow),
        pytest.param(0.3, id="turned", marks=pytest.mark.slow),
        pytest.param(-math.pi / 2, id="on its side", marks=pytest.mark.slow),
    ],
)
def test_a_load_cell_mounted_turned(rotation: float) -> None:
    assert_recovered(
        diagnosed(played(experiment(), wrong("sensor_frame", "E", rotation=rotation))),
        wrong("sensor_frame", "E", rotation=rotation),
    )


@pytest.mark.slow
def test_one_clock_offset_of_many_sensors_is_named_once() -> None:
    sensors = SENSORS | {"coupler_y": 1e-5, "coupler_angle": 5e-5, "reaction_D_x": 0.02, "reaction_D_y": 0.02}
    late = wrong("clock_offset", "slow", offset=2e-3)
    assert_recovered(diagnosed(played(experiment(sensors=sensors), late)), late)


@pytest.mark.slow
def test_an_encoder_that_is_off_by_another_amount_in_each_run() -> None:
    values = {"offset@slow": 1e-3, "offset@fast-reverse": -7e-4}
    truth = Planted("encoder_offset", "crank_angle", values)
    assert_recovered(diagnosed(played(experiment(), truth)), truth)


@pytest.mark.slow
def test_a_clipped_sensor_is_a_fault_of_the_data_and_nothing_is_named(tmp_path: Path) -> None:
    rig = experiment()
    seen = readings(rig)
    for run in seen:
        run["drive_torque"] = np.clip(run["drive_torque"], -0.4, 0.4)
    assert any(np.mean(np.abs(run["drive_torque"]) == 0.4) > 0.1 for run in seen)
    result = diagnosed(load_measured(written(rig, seen, tmp_path)))
    assert (result["verdict"], result["effects"]) == ("no gap", [])
    assert {f["signal"] for f in result["faults"]} == {"drive_torque"}
    assert {f["kind"] for f in result["faults"]} == {"clipped"}
    assert "clipped" in " ".join(result["steps"][0]["text"])


def written(rig: Experiment, seen: list[dict[str, np.ndarray]], folder: Path) -> Path:
    from tests.evidence.scoreboard.hidden import Hidden

    write_data(Hidden(0, "effects", rig, "exudyn", "mujoco"), seen, folder)
    return folder / "measured.toml"


def following(*effects: Planted) -> Measured:
    return played(experiment(turn("slow", 4.0, follows=True), turn("fast-reverse", -12.0, follows=True)), *effects)


@pytest.mark.slow
def test_a_run_that_follows_its_noisy_encoder() -> None:
    assert_recovered(diagnosed(following(VISCOUS)), VISCOUS)


@pytest.mark.slow
def test_a_run_that_follows_its_noisy_encoder_and_nothing_missing() -> None:
    result = diagnosed(following())
    assert (result["verdict"], result["effects"]) == ("no gap", [])


@pytest.mark.slow
def test_an_offset_of_the_encoder_that_a_run_follows() -> None:
    offset = wrong("encoder_offset", "crank_angle", offset=1e-3)
    assert_recovered(diagnosed(following(offset)), offset)


# ---------------------------------------------------------------- free runs


PENDULUM = load("pendulum")
ROCKER_NOISE = {"crank_angle": 1e-3, "follower_angle": 1e-3}
ROCKER_STARTS = [(0.9, 0.0), (0.5, 20.0)]  # rad, rad/s
ROCKER_TIME = np.linspace(0.0, 0.6, 100)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "field", "value"),
    [("viscous_friction", "damping", 3e-3), ("coulomb_friction", "friction_torque", 1e-2)],
)
def test_friction_of_a_free_pendulum_whose_start_is_not_known(name: str, field: str, value: float) -> None:
    real = PENDULUM.with_joint("O", **{field: value})
    data = released(PENDULUM, real, {"pendulum_angle": 1e-3}, [(0.2, 0.0), (-2.5, 1.0)], np.linspace(0, 3, 150))
    result = diagnosed(data)
    assert_recovered(result, wrong(name, "O", **{field: value}))
    assert result["gap"]["before"] > 50


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "joint", "field", "value"),
    [("viscous_friction", "E", "damping", 1e-3), ("coulomb_friction", "D", "friction_torque", 4e-3)],
)
def test_friction_of_a_free_crank_rocker(name: str, joint: str, field: str, value: float) -> None:
    believed = four_bar(loads=())
    time = np.linspace(
        0.0, 0.17, 100
    )  # s: until friction holds the second run, where Exudyn creeps by as much as the data would tell
    data = released(believed, believed.with_joint(joint, **{field: value}), ROCKER_NOISE, ROCKER_STARTS, time)
    assert_recovered(diagnosed(data), wrong(name, joint, **{field: value}))


# ---------------------------------------------------------------- an effect of one's own


class WornTooth(Effect):
    """A follower sensor's gear with a worn tooth: it lags over a sector of the crank's turn."""

    name = "worn_tooth"
    parameters = (Parameter("lag", "rad", "angle"),)
    sensor = True

    def places(self, rig: Rig) -> Sequence[str]:
        return ["follower_angle"]

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-5,)

    def on_readings(self, seen: Readings, run: str, where: str, values: Values) -> Readings:
        sector = np.abs(np.remainder(seen["crank_angle"], 2 * math.pi) - 2.0) < 0.5
        return {**seen, where: seen[where] - values["lag"] * sector}


class Tether(Effect):
    """A line that pulls sideways at the end of a link."""

    name = "tether"
    parameters = (Parameter("pull", "N", "force"),)

    def places(self, rig: Rig) -> Sequence[str]:
        return ["coupler"]

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-3 * rig.force,)

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        return mechanism.replace(loads=(*mechanism.loads, Load(body=where, point="B", force=(values["pull"], 0.0))))


@pytest.mark.slow
def test_an_effect_of_ones_own_on_a_sensor_is_found() -> None:
    rig, tooth = experiment(), WornTooth()
    seen = [
        dict(tooth.on_readings(run, plan.name, "follower_angle", {"lag": 5e-4}))
        for plan, run in zip(rig.plans, readings(rig), strict=True)
    ]
    assert named(diagnosed(rig.measured(seen))) != [("worn_tooth", "follower_angle")]
    result = diagnosed(rig.measured(seen), own=(tooth,))
    assert_recovered(result, wrong("worn_tooth", "follower_angle", lag=5e-4))
    assert "Worn tooth at follower_angle" in result["statement"]


@pytest.mark.slow
def test_an_effect_of_ones_own_on_the_mechanism_is_found_and_simulated() -> None:
    real = four_bar(loads=(*four_bar().loads, Load(body="coupler", point="B", force=(1.5, 0.0))))
    seen = readings(experiment(mechanism=real))
    result = diagnosed(
        experiment().measured(seen),
        own=(Tether(),),
        only=("tether", "gravity", "link_length", "viscous_friction", "sensor_bias"),
    )
    assert_recovered(result, wrong("tether", "coupler", pull=1.5))


# ---------------------------------------------------------------- the answer as an object, in files, and again


class WornBush(Effect):
    """Wear that opens a joint, which an engine learns only when it simulates it."""

    name = "worn_bush"
    parameters = (Parameter("wear", "m", "length", 0.0),)

    def places(self, rig: Rig) -> Sequence[str]:
        return ["B"]

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-4 * rig.length,)

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        return mechanism.with_clearances({where: values["wear"]})


OPEN = wrong("joint_clearance", "B", radial_clearance=3e-4)
PART = Plan("part", 6.0, 0.4, np.linspace(0.0, 0.4, 60), None)  # of a turn: PyBullet takes seconds for a whole one


@pytest.mark.slow
def test_an_engine_that_cannot_simulate_the_explanation_does_not_confirm_it() -> None:
    data = played(experiment(PART), OPEN, source="mujoco")
    result = told(diagnose(data, "pybullet", own=(WornBush(),), only=("worn_bush",), others=False, workers=1))
    assert named(result) == [("worn_bush", "B")]
    assert result["verdict"] == "partly explained"
    assert "pybullet could not simulate that" in result["statement"]
    assert "the gap after is the analytic model's" in result["statement"]
    assert result["engines"][0]["after"] is None


@pytest.mark.slow
def test_what_the_chosen_engine_lacks_is_said_to_be_the_analytic_models() -> None:
    result = told(
        diagnose(
            played(experiment(PART), OPEN, source="mujoco"),
            "pybullet",
            only=("joint_clearance", "viscous_friction"),
            others=False,
            workers=1,
        )
    )
    assert named(result) == [("joint_clearance", "B")]
    assert result["engines"][0]["added"] == ["joint_clearance@B"]
    (said,) = next(step["text"] for step in result["steps"] if step["title"] == "Add")
    assert "it has no joint_clearance@B, and got the difference that the analytic model makes of it" in said


@pytest.mark.slow
def test_the_same_answer_bit_for_bit_when_run_again() -> None:
    """The first time may have been in another process."""
    again = json.loads(json.dumps(diagnosed(played(experiment(), VISCOUS, LONGER))))
    assert again == two_effects()


@pytest.mark.slow
def test_the_explained_mechanism_has_no_gap_left() -> None:
    rig = experiment()
    seen = readings(rig, VISCOUS, LONGER)
    found = diagnose(rig.measured(seen), "mujoco", others=False, workers=1)
    assert found.explained.joint("E").damping == pytest.approx(0.01, rel=0.02)
    again = diagnosed(replace(rig.measured(seen), mechanism=found.explained))
    assert (again["verdict"], again["effects"]) == ("no gap", [])
    assert again["gap"]["after"] == pytest.approx(found.gap.after, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("plans", [(PART,), *slow(((),))], ids=["part of a turn", "two turns"])
def test_the_gap_shrinks_in_the_other_engines_too(plans: tuple[Plan, ...]) -> None:
    rig = experiment(*plans)
    result = told(diagnose(played(rig, VISCOUS), "mujoco", workers=1))
    assert set(result["other_simulators"]) == {"exudyn", "pybullet", "dart"}
    for gap in result["other_simulators"].values():
        assert gap["before"] > 5
        assert gap["after"] < 1.1
    assert {row["name"] for row in result["engines"]} == {"mujoco", "exudyn", "pybullet", "dart"}
    for row in result["engines"]:
        assert row["settings"].keys() == {plan.name for plan in rig.plans}
        assert all(settings["step"] > 0 for settings in row["settings"].values())
        assert row["added"] == []


@pytest.mark.slow
def test_processes_change_nothing() -> None:
    data = played(experiment(), VISCOUS)
    one_process, two = (told(diagnose(data, "mujoco", workers=n)) for n in (1, 2))
    assert json.dumps(one_process, sort_keys=True) == json.dumps(two, sort_keys=True)


@pytest.mark.slow
@pytest.mark.parametrize("simulator", ["exudyn", "pybullet", "dart"])
def test_every_engine_can_diagnose(simulator: str) -> None:
    result = told(diagnose(played(experiment(), VISCOUS, source="mujoco"), simulator, others=False, workers=1))
    assert result["simulator"]["name"] == simulator
    assert_recovered(result, VISCOUS)


@pytest.mark.mujoco
@pytest.mark.parametrize(
    "run", [compare, pytest.param(compare_alone, marks=pytest.mark.slow)], ids=["one engine", "as a person runs it"]
)
@pytest.mark.parametrize(
    ("truth", "options", "status", "verdict"),
    [
        ((VISCOUS,), (), 0, "explained"),
        *slow(((), (), 0, "no gap"), ((VISCOUS,), ("--only", "gravity"), 1, "unexplained")),
    ],
    ids=["explained", "no gap", "unexplained"],
)
def test_the_command(
    run: Callable[..., Ended],
    truth: Sequence[Planted],
    options: Sequence[str],
    status: int,
    verdict: str,
    tmp_path: Path,
) -> None:
    rig = experiment()
    written(rig, readings(rig, *truth), tmp_path)
    command = ["diagnose", "measured.toml", "--simulator", "mujoco", "--json", "--out", "out", "--workers", "1"]
    if run is compare_alone:
        done = compare_alone(*command, *options, cwd=tmp_path)
    else:
        with without("exudyn", "pybullet", "dartpy"):
            done = compare(*command, *options, cwd=tmp_path)
    assert done.returncode == status, done.stderr
    assert done.stderr == ""
    result = json.loads(done.stdout)
    assert result == json.loads((tmp_path / "out" / "diagnosis.json").read_text(encoding="utf-8"))
    assert result["verdict"] == verdict
    assert {p.name for p in (tmp_path / "out").iterdir()} >= {
        "diagnosis.json",
        "diagnosis.html",
        "diagnosis.md",
        "explained.toml",
    }
    assert load(tmp_path / "out" / "explained.toml").joint("E").damping == pytest.approx(
        0.01 if verdict == "explained" else 0.0, rel=0.02
    )
    head = (tmp_path / "out" / "explained.toml").read_text(encoding="utf-8")
    assert "# Data: slow (slow.csv), fast-reverse (fast-reverse.csv)." in head.splitlines()
    assert ("viscous_friction@E: damping 0.0" in head) == (verdict == "explained")


@pytest.mark.mujoco
def test_the_command_refuses_what_it_does_not_know(tmp_path: Path) -> None:
    rig = experiment()
    written(rig, readings(rig), tmp_path)
    for options, word in (
        (("--only", "gravty"), "did you mean 'gravity'"),
        (("--simulator", "adams"), "'adams' is unknown"),
    ):
        done = compare("diagnose", "measured.toml", "--out", "out", *options, cwd=tmp_path)
        assert_refused(done, word)
        assert done.stdout == ""
        assert not (tmp_path / "out").exists()

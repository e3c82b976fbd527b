"""The pages of a diagnosis: its words and units, its figures' numbers, and what names and missing values may not do to
them.
"""

from __future__ import annotations

import copy
import json
import math
import re
import tomllib
from importlib import resources
from typing import Any
from xml.etree import ElementTree

import jsonschema
import numpy as np
import pytest

from analytic.mechanism.file import load
from compare.diagnose.effects.effect import Effect as VocabularyEffect
from compare.diagnose.effects.effect import Parameter as SignedParameter
from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.files import to_json
from compare.quantities import DASH, MINUS, TIMES, amount, fitting, plainly
from compare.report.diagnosis import files as files_of
from compare.report.diagnosis import judged
from compare.report.diagnosis_figures import LEVELS, MAP_COLUMNS, broken, figure, level, maps, overlay, panels
from compare.report.diagnosis_page import changes, diagnosis_html, diagnosis_md
from compare.report.diagnosis_terminal import terminal_lines
from compare.report.words.diagnosis import attempts, next_steps, separation, ties, waterfall
from compare.report.words.effects import odds, own_values, parameter, phrase, rows, spoken, values_of
from compare.report.words.located import located, span, wrapped
from compare.report.words.measured import data_sentences, explained_to, off, off_by
from compare.results.diagnosis import Diagnosis, Effect, Estimate, Located
from diagnosis_rigs import valued
from marks import slow
from sample_diagnosis import (
    CLEARANCE,
    as_document,
    no_gap,
    partly_explained,
    sample_diagnosis,
    swinging_diagnosis,
)

SCHEMA = json.loads(resources.files("compare").joinpath("schemas", "diagnosis.json").read_text(encoding="utf-8"))
NASTY = "</script><img src=x onerror=\"document.title='owned'\">|`[x](y)"


@pytest.fixture(scope="module")
def explained() -> dict[str, Any]:
    return sample_diagnosis()


@pytest.fixture(scope="module")
def small() -> dict[str, Any]:
    return sample_diagnosis(samples=37)


@pytest.fixture(scope="module")
def ambiguous() -> dict[str, Any]:
    return sample_diagnosis(runs=2)


@pytest.fixture(scope="module")
def swinging() -> dict[str, Any]:
    return swinging_diagnosis()


@pytest.fixture(scope="module")
def partly() -> dict[str, Any]:
    return partly_explained()


@pytest.fixture(scope="module")
def page(explained: dict[str, Any]) -> str:
    return diagnosis_html(as_document(explained))


def embedded(html: str) -> Any:
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', html, re.DOTALL)
    assert found
    return json.loads(found.group(1))


def changed(result: dict[str, Any], *path: Any, value: Any) -> dict[str, Any]:
    out = copy.deepcopy(result)
    here: Any = out
    for step in path[:-1]:
        here = here[step]
    here[path[-1]] = value
    return out


# ------------------------------------------------------------------ schema


VALIDATOR = jsonschema.Draft202012Validator(SCHEMA)


@pytest.mark.slow
def test_every_sample_is_what_the_schema_says(
    small: dict[str, Any], swinging: dict[str, Any], partly: dict[str, Any]
) -> None:
    for result in (small, sample_diagnosis(2, 37), swinging, no_gap(), partly):
        VALIDATOR.validate(json.loads(to_json(result)))


WRONG: dict[str, tuple[tuple[Any, ...], Any]] = {
    "another schema": (("schema",), 2),
    "a verdict of its own": (("verdict",), "maybe"),
    "a field that nobody knows": (("colour",), "red"),
    "a step of its own": (("steps", 0, "title"), "Guess"),
    "a sample in words": (("runs", 0, "signals", "drive_torque", "before", 0), "high"),
    "no noise": (("runs", 0, "signals", "drive_torque", "noise"), 0),
    "a drive of its own": (("runs", 0, "drive"), "hand"),
    "half held out": (("runs", 0, "held_out", 0), 0.5),
    "a negative gap": (("gap", "before"), -1.0),
    "an effect without parameters": (("effects", 0, "parameters"), {}),
    "an interval without an end": (
        ("effects", 0, "parameters", "radial_clearance"),
        {"value": 1.0, "unit": "m", "low": 0.0},
    ),
    "a status of its own": (("candidates", 0, "status"), "perhaps"),
    "a rival without a place": (("candidates", 0, "rival"), "gravity"),
    "a pair of one": (("inseparable",), [["a@b", 1.0]]),
    "no runs": (("runs",), []),
    "a role of its own": (("runs", 0, "role"), "test"),
    "a kind of its own": (("effects", 0, "kind"), "drive"),
    "an attempt that failed nothing": (("attempts",), [{"name": "gravity", "where": "linkage"}]),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_what_is_wrong_is_noticed(wrong: str, small: dict[str, Any]) -> None:
    path, value = WRONG[wrong]
    assert not VALIDATOR.is_valid(changed(small, *path, value=value))


def test_every_field_that_was_not_added_later_is_required(small: dict[str, Any]) -> None:
    VALIDATOR.validate(small)
    for name in small:
        assert not VALIDATOR.is_valid({key: value for key, value in small.items() if key != name}), name


# ------------------------------------------------------------------ words


@pytest.mark.parametrize(
    ("value", "unit", "said"),
    [
        (6e-4, "rad", "0.6 mrad"),
        (0.5, "rad", "28.6 deg"),
        (3e-6, "rad", "3 µrad"),
        (2e-4, "m", "0.2 mm"),
        (5e-6, "m", "5 µm"),
        (0.05, "kg", "50 g"),
        (2e11, "Pa", "200 GPa"),
        (-0.02, "N", f"{MINUS}20 mN"),
        (1e-3, "N.m.s/rad", "1 mN·m·s/rad"),
        (3.5e-4, "s", "0.35 ms"),
        (9.81, "m/s^2", "9.81 m/s^2"),
        (2.0, "1", "2"),
        (None, "m", DASH),
    ],
)
def test_a_number_is_read_in_the_unit_that_fits_it(value: float | None, unit: str, said: str) -> None:
    assert amount(value, unit) == said


def test_the_largest_of_several_numbers_picks_their_unit() -> None:
    assert fitting("m", 1e-6, -3e-3, None, math.nan) == ("mm", 1e3)


def test_a_parameter_has_the_digits_that_its_interval_allows() -> None:
    assert parameter("radial_clearance", Estimate(value=1.99988e-4, unit="m", low=1.9e-4, high=2.1e-4)) == (
        "radial clearance",
        "0.200 mm",
        "0.190 to 0.210 mm",
    )
    assert parameter("offset@run-2", Estimate(value=-6e-4, unit="rad", low=-7e-4, high=-5e-4)) == (
        "offset in run run-2",
        f"{MINUS}0.60 mrad",
        f"{MINUS}0.70 to {MINUS}0.50 mrad",
    )
    assert parameter("gain_error", Estimate(value=0.02, unit="1", low=0.01, high=0.03))[1:] == (
        "2.0 %",
        "1.0 to 3.0 %",
    )
    assert parameter("harmonic", Estimate(value=3, unit="1", low=None, high=None)) == (
        "harmonic",
        "3",
        "not known",
    )


@pytest.mark.parametrize(
    ("run", "shift", "word"),
    [
        ("slow-forward", -6e-4, "late"),
        ("slow-forward", 6e-4, "early"),
        ("slow-reverse", 6e-4, "late"),
        ("slow-reverse", -6e-4, "early"),
    ],
)
def test_an_angle_that_moves_one_way_is_late_or_early(
    explained: dict[str, Any], run: str, shift: float, word: str
) -> None:
    index = [r["name"] for r in explained["runs"]].index(run)
    signal = explained["runs"][index]["signals"]["crank_angle"]
    planted = changed(
        explained, "runs", index, "signals", "crank_angle", "measured", value=[b + shift for b in signal["before"]]
    )
    way = -1.0 if run == "slow-reverse" else 1.0
    place = Located(
        run=run,
        signal="crank_angle",
        crank_angle_from=way * math.radians(40),
        crank_angle_to=way * math.radians(110),
        size=shift,
        unit="rad",
        sigmas=12.0,
    )
    where = "at 250 to 320 deg" if way < 0 else "at 40 to 110 deg"
    said = f"crank angle in run {run} is {word} by 0.6 mrad {where}, turn 1, 0.175 s"
    assert located(as_document(planted), place) == said


def test_what_turns_back_or_is_no_angle_is_too_high_or_too_low(explained: dict[str, Any]) -> None:
    whole = {
        "run": "slow-forward",
        "signal": "follower_angle",
        "crank_angle_from": math.radians(20),
        "crank_angle_to": math.radians(740),
        "size": -2e-3,
        "unit": "rad",
        "sigmas": 12.0,
    }
    assert (
        located(as_document(explained), Located.model_validate(whole))
        == "follower angle in run slow-forward is too low by 2 mrad throughout the run"
    )
    torque = whole | {"signal": "drive_torque", "size": 0.5, "unit": "N.m", "crank_angle_to": 1.0}
    said = located(as_document(explained), Located.model_validate(torque))
    assert re.fullmatch(
        r"drive torque in run slow-forward is too (high|low) by 0.5 N·m at 20 to 57.3 deg, turn 1, 0 s", said
    )


@pytest.mark.slow
def test_places_are_told_within_a_turn_with_the_turn_and_the_time(
    explained: dict[str, Any], swinging: dict[str, Any]
) -> None:
    def told(result: dict[str, Any], run: str, begin: float, end: float, **times: float) -> str:
        off = {"signal": "crank_angle", "size": 1e-3, "unit": "rad", "sigmas": 9.0}
        place = Located(run=run, crank_angle_from=math.radians(begin), crank_angle_to=math.radians(end), **off, **times)
        return span(as_document(result), place)

    assert wrapped(as_document(explained))
    assert told(explained, "slow-reverse", -110, -40) == "at 250 to 320 deg, turn 1, 0.175 s"
    assert told(explained, "slow-reverse", -400, -470) == "at 250 to 320 deg, turn 2, 3.32 s"
    assert told(explained, "slow-forward", 597, 690, time_from=2.8, time_to=2.9) == "at 237 to 330 deg, turn 2, 2.8 s"
    assert told(explained, "slow-forward", 330, 390) == "at 330 to 30 deg, turn 1, 2.71 s"
    assert told(explained, "slow-forward", 20, 400) == "over turns 1 to 2, 0 to 3.32 s"
    assert told(explained, "slow-reverse", -20, -700) == "throughout the run"
    assert not wrapped(as_document(swinging))
    times = {"time_from": 0.5, "time_to": 0.75}
    said = f"from 0.5 to 0.75 s, at {MINUS}110 to {MINUS}40 deg"
    assert told(swinging, "released", -110, -40, **times) == said


def test_many_turns_of_a_followed_crank_are_told_like_commanded_ones(explained: dict[str, Any]) -> None:
    run = explained["runs"][0]
    many = run | {"drive": "measured", "crank_angle": [20.0 * a for a in run["crank_angle"]]}
    result = as_document(explained | {"runs": [many, *explained["runs"][1:]]})
    begin, end = (math.radians(12 * 360 + at) for at in (237, 330))
    place = Located(
        run="slow-forward",
        signal="drive_torque",
        crank_angle_from=begin,
        crank_angle_to=end,
        size=0.1,
        unit="N.m",
        sigmas=9.0,
        time_from=2.8,
        time_to=2.9,
    )
    assert span(result, place) == "at 237 to 330 deg, turn 12, 2.8 s"  # it begins at 400 deg, in its first turn


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (17428.7, "17,400"),
        (131.2, "131"),
        (0.98712, "0.987"),
        (-2.0, f"{MINUS}2"),
        (0.0, "0"),
        (1.23e7, f"1.23{TIMES}10⁷"),
        (3e-5, f"3{TIMES}10⁻⁵"),
        (None, DASH),
        (math.nan, DASH),
    ],
)
def test_a_number_is_written_as_one_writes_it(value: float | None, said: str) -> None:
    assert plainly(value) == said


COORDINATES = ("rest_angle", "phase", "harmonic")  # whose sign is no direction of an error
SIGNED = [
    (effect, p)
    for effect in VOCABULARY.values()
    for p in effect.parameters
    if p.lowest < 0 and p.name not in COORDINATES
]
SENTENCES = {  # of a value, of its negative, and what both begin with
    "gravity.x": ("gravity acts on the linkage: 0.02 m/s^2 to the right", "0.02 m/s^2 to the left"),
    "gravity.y": ("gravity acts on the linkage: 0.02 m/s^2 up", "0.02 m/s^2 down"),
    "payload.along": (
        "a payload rides on the follower: 20 mm ahead of its centre of mass along its x axis",
        "20 mm behind its centre of mass along its x axis",
    ),
    "payload.normal": ("a payload rides on the follower: 20 mm to the left of it", "20 mm to the right of it"),
    "com_offset.along": (
        "the centre of mass of the follower is 20 mm farther along its x axis than drawn",
        "20 mm less far along its x axis than drawn",
    ),
    "com_offset.normal": (
        "the centre of mass of the follower is 20 mm farther to its left than drawn",
        "20 mm farther to its right than drawn",
    ),
    "moment_of_inertia.inertia_error": (
        "the moment of inertia of the follower is 0.02 kg·m² larger than modelled",
        "0.02 kg·m² smaller than modelled",
    ),
    "body_mass.mass_error": ("the follower is 20 g heavier than modelled", "20 g lighter than modelled"),
    "link_length.length_error": ("the follower is 20 mm longer than drawn", "20 mm shorter than drawn"),
    "pivot_position.x": (
        "the ground pivot E sits 20 mm to the right from where it is drawn",
        "20 mm to the left from where it is drawn",
    ),
    "pivot_position.y": (
        "the ground pivot E sits 20 mm up from where it is drawn",
        "20 mm down from where it is drawn",
    ),
    "nonlinear_spring.cubic": (
        "a spring that is not linear acts in joint B: 0.02 N·m/rad3 of cubic stiffening",
        "0.02 N·m/rad3 of cubic softening",
    ),
    "external_force.x": ("an unknown force acts on the follower: 20 mN to the right", "20 mN to the left"),
    "external_force.y": ("an unknown force acts on the follower: 20 mN up", "20 mN down"),
    "load_torque.torque": (
        "an unknown torque acts on the follower: 0.02 N·m counter-clockwise",
        "0.02 N·m clockwise",
    ),
    "encoder_offset.offset": ("the encoder follower angle reads 20 mrad too much", "20 mrad too little"),
    "sensor_bias.bias": ("the sensor follower angle reads 20 mrad too much", "20 mrad too little"),
    "sensor_drift.drift": ("the sensor follower angle drifts by 20 mrad/s upwards", "20 mrad/s downwards"),
    "sensor_gain.gain_error": ("the sensor follower angle reads 2 % too much", "2 % too little"),
    "sensor_frame.rotation": (
        "the load cell at B is mounted turned by 20 mrad counter-clockwise",
        "20 mrad clockwise",
    ),
    "sensor_place.along": (
        "the accelerometer follower angle sits 20 mm further along its body",
        "20 mm less far along its body",
    ),
    "axis_error.rotation": (
        "the axis of the accelerometer follower angle is turned by 20 mrad counter-clockwise",
        "20 mrad clockwise",
    ),
    "clock_offset.offset": ("run slow is 20 ms late on its command", "20 ms ahead of its command"),
}


@pytest.mark.parametrize(("effect", "p"), SIGNED, ids=lambda v: v.name)
def test_a_sentence_of_an_effect_says_which_way(
    explained: dict[str, Any], effect: VocabularyEffect, p: SignedParameter
) -> None:
    """Each parameter that has a sign has a word for either, in every sentence that tells its value."""
    result = as_document(explained)
    where = {
        "body": "follower", "joint": "B", "ground point": "E", "signal": "follower_angle", "run": "slow",
    }.get(effect.place, effect.place)  # fmt: skip
    unit = {"": "rad", "of the signal per s": "rad/s"}.get(p.unit, p.unit)
    place = spoken(result, where) if effect.place == "signal" else where
    positive, negative = SENTENCES[f"{effect.name}.{p.name}"]
    for value, said in ((0.02, positive), (-0.02, negative)):
        given = {p.name: Estimate(value=value, unit=unit, low=value, high=value)}
        told = effect.tells(place, values_of(result, valued(effect.name, where, given)))
        assert told.endswith(said)
        assert (told == said) is (value > 0)
        assert MINUS not in told


def test_a_direction_has_its_interval_counted_its_way(explained: dict[str, Any]) -> None:
    result = as_document(explained)
    shorter = {"length_error": Estimate(value=-2.98e-4, unit="m", low=-3.01e-4, high=-2.95e-4)}
    unsure = {"length_error": Estimate(value=-2.98e-4, unit="m", low=-7e-4, high=1e-4)}
    sure_words, unsure_words = (
        *values_of(result, valued("link_length", "follower", shorter), intervals=True),
        *values_of(result, valued("link_length", "follower", unsure), intervals=True),
    )
    assert sure_words == "0.2980 mm shorter than drawn (95 %: 0.2950 to 0.3010 mm)"
    assert unsure_words == f"0.30 mm shorter than drawn (95 %: {MINUS}0.10 to 0.70 mm)"


def test_a_link_that_is_drawn_backwards_is_longer_where_its_last_point_moves_back(explained: dict[str, Any]) -> None:
    m = load("crank-rocker").with_body("follower", points={"B": (0.1, 0.0), "E": (0.0, 0.0)}, com=(0.05, 0.0))
    result = as_document(explained).model_copy(update={"mechanism": m})
    for error, said in ((-3e-4, "0.300 mm longer than drawn"), (3e-4, "0.300 mm shorter than drawn")):
        moved = VOCABULARY["link_length"].on_mechanism(m, "follower", {"length_error": error})
        assert np.sign(moved.moving["follower"].length - 0.1) == -np.sign(error)
        given = {"length_error": Estimate(value=error, unit="m", low=error - 1e-5, high=error + 1e-5)}
        assert values_of(result, valued("link_length", "follower", given)) == [said]


def test_values_of_each_run_are_a_range_and_have_one_unit(explained: dict[str, Any]) -> None:
    given = {
        "offset@a": Estimate(value=-0.0297, unit="rad", low=-0.0302, high=-0.0292),
        "offset@b": Estimate(value=0.0628, unit="rad", low=0.0623, high=0.0633),
    }
    result = as_document(explained)
    own = own_values(result, valued("encoder_offset", "crank_angle", given))
    assert own is not None
    assert own.sentence(2) == "each run has its own encoder zero, 1.7 deg too little to 3.6 deg too much"
    assert own.sentence(6).startswith("two of six runs have their own encoder zero")
    assert own.runs[0] == ("a", f"{MINUS}1.702 deg", f"{MINUS}1.730 to {MINUS}1.673 deg")
    assert [value.split()[-1] for _, value, _ in own.runs] == ["deg", "deg"]  # the first alone would be in mrad
    assert own_values(result, valued("joint_clearance", "B", {"radial_clearance": given["offset@a"]})) is None
    jitter = {f"jitter@{run}": Estimate(value=s, unit="s", low=s, high=s) for run, s in (("a", 4e-4), ("b", 1.3e-3))}
    own = own_values(result, valued("stamp_jitter", "crank_angle", jitter))
    assert own is not None
    unsigned = "each run has its own jitter of the time stamps, 0.4 to 1.3 ms"  # no plus sign where none is negative
    assert own.sentence(2) == unsigned


@pytest.mark.parametrize(
    ("likely", "said"),
    [
        (1 / 19, "19 to 1 for clearance"),
        (1.0, "even"),
        (1e-6, "more than 1,000 to 1 for clearance"),
        (3.4, "3.4 to 1 for it"),
        (None, ""),
    ],
)
def test_odds_are_said_for_the_likelier_of_two(likely: float | None, said: str) -> None:
    assert odds(likely, "clearance") == said


def test_data_are_told_in_plain_sentences(explained: dict[str, Any]) -> None:
    assert data_sentences(as_document(explained).runs) == (
        "Three runs with ten sensors each, 21,594 samples.",
        "You gave the noise of 15 of the 30 records (a sensor in a run); of the others it was estimated from their"
        " scatter.",
    )
    runs = copy.deepcopy(explained["runs"])
    runs[2]["role"] = "validation"
    for channel in (channel for run in runs for channel in run["signals"].values()):
        channel["noise_given"] = False
    assert data_sentences(as_document(explained | {"runs": runs}).runs)[1:] == (
        "You gave no noise: it was estimated from the scatter of each sensor.",
        "Run load-reversed is for validation: nothing was fitted to it.",
    )


def test_effects_and_places_are_named_as_an_engineer_would(explained: dict[str, Any]) -> None:
    assert phrase(as_document(explained), "joint_clearance", "B") == "clearance in joint B"
    assert phrase(as_document(explained), "gravity", "linkage") == "gravity"
    assert phrase(as_document(explained), "sensor_bias", "reaction_B_x") == "a bias of the sensor for reaction x at B"
    assert phrase(as_document(explained), "belt_slip", "drive") == "belt slip at drive"  # a person's own effect


def test_a_separating_run_is_split_from_its_words() -> None:
    words, block = separation(
        'Reverse the load:\n\n[[run]]\nname = "back"\n\n[[run.load]]\ntorque = 2.0\n\nNothing else will do.'
    )
    assert words == "Reverse the load: Nothing else will do."
    assert tomllib.loads(block) == {"run": [{"name": "back", "load": [{"torque": 2.0}]}]}
    assert separation("No run can.") == ("No run can.", "")


def test_aliases_that_name_each_other_are_one_tie(explained: dict[str, Any]) -> None:
    one = explained["effects"][0] | {
        "name": "payload",
        "where": "crank",
        "ambiguous_with": [{"name": "com_offset", "where": "crank"}],
    }
    other = one | {"name": "com_offset", "ambiguous_with": [{"name": "payload", "where": "crank"}]}
    groups = ties(as_document(explained | {"effects": [one, other, explained["effects"][0]]}))
    assert [[effect.name for effect in group] for group in groups] == [
        ["payload", "com_offset"],
        ["joint_clearance"],
    ]
    assert isinstance(groups[0][1], Effect)


@pytest.mark.parametrize(
    ("low", "high", "said"),
    [
        (1.0, 2.0, "in every turn, at 57.3 to 115 deg"),
        (5.5, 7.0, "in every turn, at 315 to 41.1 deg"),
        (0.0, 2 * math.pi, "throughout the run"),
    ],
)
def test_a_deviation_of_every_turn_is_told_by_its_angle(
    explained: dict[str, Any], low: float, high: float, said: str
) -> None:
    result = as_document(explained)
    place = result.located[0].model_copy(
        update={
            "every_turn": True,
            "crank_angle_from": low,
            "crank_angle_to": high,
            "time_from": None,
            "time_to": None,
        }
    )
    assert span(result, place) == said
    assert located(result, place).endswith(said)


def test_what_was_found_of_the_noise_is_noted(explained: dict[str, Any]) -> None:
    note = "The noise of the torque hums at 50 Hz, 40 mN.m in all."
    assert note in diagnosis_md(as_document(explained | {"notes": [note]}))


def test_what_to_do_next_follows_the_verdict(explained: dict[str, Any], ambiguous: dict[str, Any]) -> None:
    clean = explained | {"faults": []}
    assert next_steps(as_document(clean))[0].startswith(
        "Confirm clearance in joint B at the rig: expect radial clearance 0.19999 mm"
    )
    assert any("Reverse the load" in step for step in next_steps(as_document(ambiguous)))
    assert next_steps(as_document(no_gap())) == [
        "Nothing has to be added: the model explains these data down to their noise."
    ]
    left = changed(clean, "runs", 1, "signals", "drive_torque", "gap_after", value=7.0) | {
        "verdict": "unexplained",
        "effects": [],
    }
    document = as_document(left)
    rest = off_by(document, "drive_torque", off(document, document.runs[1], "drive_torque", "after"))
    assert (
        next_steps(document)[0]
        == f"Look for what this program does not know: drive torque in run slow-reverse is still off by {rest} (rms), 7"
        " times its noise."
    )


def test_what_was_not_looked_for_is_said(explained: dict[str, Any]) -> None:
    seen = [{**explained["candidates"][0], "name": name} for name in VOCABULARY if name not in ("gravity", "payload")]
    said = "Not looked for, as nothing here has, reads or does what it takes: gravity and payload."
    document = as_document(explained | {"candidates": seen})
    assert said in diagnosis_md(document)
    assert said in diagnosis_html(document)


# ------------------------------------------------------------------ figures


def test_a_cell_of_the_map_is_the_root_mean_square_of_its_samples_with_their_sign(explained: dict[str, Any]) -> None:
    (found,) = maps(as_document(explained))
    assert (found.low, found.high, found.axis.unit) == (0.0, 360.0, "deg")
    run = explained["runs"][1]
    signal = run["signals"]["follower_angle"]
    strip = next(s for s in found.strips if s.run == "slow-reverse" and s.title == "follower angle")
    residual = (np.array(signal["measured"], float) - np.array(signal["before"])) / signal["noise"]
    degrees = np.round(np.degrees(run["crank_angle"]), 6) % 360
    for column in (3, 17, 40):
        inside = residual[(degrees >= 5 * column) & (degrees < 5 * column + 5)]
        assert inside.size == 10
        expected = math.copysign(math.sqrt(np.mean(inside**2)), inside.mean())
        assert strip.before[column] == pytest.approx(expected, rel=5e-3)


def test_the_map_shows_a_planted_pulse_where_it_is_and_noise_as_noise() -> None:
    result = no_gap()
    run = result["runs"][0]
    degrees = np.round(np.degrees(run["crank_angle"]), 6) % 360
    signal = run["signals"]["drive_torque"]
    signal["measured"] = [
        m + 20 * signal["noise"] * (100 <= d < 120) for m, d in zip(signal["measured"], degrees, strict=True)
    ]
    (found,) = maps(as_document(result))
    strips = {(s.run, s.title): [level(v) for v in s.before if v is not None] for s in found.strips}
    hit = next(s for s in found.strips if (s.run, s.title) == ("slow-forward", "drive torque"))
    assert {i for i, v in enumerate(hit.before) if v is not None and v > 10} == {20, 21, 22, 23}
    quiet = [shade for key, shades in strips.items() if key != ("slow-forward", "drive torque") for shade in shades]
    assert np.mean(np.array(quiet) == 0) > 0.85  # of a column's one or two samples
    assert set(quiet) <= {-1, 0, 1}


def test_a_colour_says_size_and_sign() -> None:
    assert [level(v) for v in (0.0, 1.9, -1.9, 2.0, -5.0, 10.0, -100.0)] == [0, 0, 0, 1, -2, 3, -4]
    assert len(LEVELS) == 4


@pytest.mark.slow
def test_a_free_run_is_shown_over_time_and_a_column_without_samples_stays_empty(swinging: dict[str, Any]) -> None:
    (found,) = maps(as_document(swinging))
    assert (found.axis.label, found.axis.unit) == ("time", "s")
    assert found.high == pytest.approx(swinging["runs"][0]["time"][-1])
    mixed = copy.deepcopy(swinging)
    signal = mixed["runs"][0]["signals"]["pendulum_angle"]
    signal["measured"] = [None if i < 100 else v for i, v in enumerate(signal["measured"])]
    cells = maps(as_document(mixed))[0].strips[0].before
    assert cells[: MAP_COLUMNS // 4 - 1] == (None,) * (MAP_COLUMNS // 4 - 1)
    assert None not in cells[MAP_COLUMNS // 4 + 1 :]


def test_residuals_are_measured_minus_simulated_in_a_unit_that_fits(explained: dict[str, Any]) -> None:
    found = {(p.run, p.signal): p for p in panels(as_document(explained))}
    panel, signal = found[0, "follower_angle"], explained["runs"][0]["signals"]["follower_angle"]
    assert panel.unit == "mrad"
    expected = 1e3 * (np.array(signal["measured"]) - np.array(signal["before"]))
    np.testing.assert_allclose(np.array(panel.before, float), expected, rtol=1e-3, atol=1e-9)
    held = np.array(explained["runs"][0]["held_out"])
    over = np.array(panel.over)
    shaded = np.any([(over >= a) & (over <= b) for a, b in panel.held_out], axis=0)
    np.testing.assert_array_equal(shaded, held == 1)


def test_an_angle_that_is_simulated_a_turn_further_has_the_same_residual_and_map(explained: dict[str, Any]) -> None:
    signal = copy.deepcopy(explained["runs"][0]["signals"]["follower_angle"])
    before = [v + 2 * math.tau * (i > 20) for i, v in enumerate(signal["before"])]
    further = changed(explained, "runs", 0, "signals", "follower_angle", "before", value=before)
    assert panels(as_document(further))[0].unit == panels(as_document(explained))[0].unit
    for shifted, panel in zip(panels(as_document(further)), panels(as_document(explained)), strict=True):
        np.testing.assert_allclose(np.array(shifted.before, float), np.array(panel.before, float), rtol=1e-3)
    cells, as_is = ([s.before for m in maps(as_document(result)) for s in m.strips] for result in (further, explained))
    for a, b in zip(cells, as_is, strict=True):
        np.testing.assert_allclose(np.array(a, float), np.array(b, float), rtol=1e-2)


@pytest.mark.slow
def test_a_drawing_keeps_the_peaks_of_a_long_run_and_few_of_its_samples(swinging: dict[str, Any]) -> None:
    result = copy.deepcopy(swinging)
    run = result["runs"][0]
    for key in ("time", "crank_angle", "held_out"):
        run[key] = list(np.repeat(run[key], 50))
    run["time"] = list(np.linspace(0.0, 2.0, len(run["time"])))
    for signal in run["signals"].values():
        signal |= {key: list(np.repeat(signal[key], 50)) for key in ("measured", "before", "after")}
    run["signals"]["pendulum_angle"]["measured"][10007] += 3.0  # one sample, in rad
    panel = panels(as_document(result))[0]
    line = figure(panel, "x").series[0]
    assert len(line.x) <= 600 < len(panel.over)
    assert max(v for v in line.y if v is not None) == max(v for v in panel.before if v is not None) > 100  # deg


# ------------------------------------------------------------------ the page


def test_settings_and_shortcomings_of_the_engines_are_said(page: str, explained: dict[str, Any]) -> None:
    text = diagnosis_md(as_document(explained))
    steps = "0.0001 in slow-forward, 0.0002 in slow-reverse, 0.0003 in load-reversed"
    for row in (("mujoco", "step", steps), ("mujoco", "contact law", "linear spring")):
        assert f"| {' | '.join(row)} |" in text
        assert re.search("<tr><th[^>]*>{}</th><td[^>]*>{}</td><td[^>]*>{}</td></tr>".format(*map(re.escape, row)), page)
    assert "has no coulomb_friction@B: got the difference that the analytic model makes of it" in page


def test_the_verdict_comes_first_and_the_sections_are_in_order(page: str, explained: dict[str, Any]) -> None:
    marks = [
        "<b>explained</b>",
        explained["statement"],
        "Clearance in joint B",
        "0.19999 mm",
        'id="where"',
        'id="story"',
        'id="residuals"',
    ]
    marks += ['id="engines"', 'id="candidates"', 'id="faults"', 'id="provenance"']
    places = [page.index(mark) for mark in marks]
    assert places == sorted(places)
    assert explained["effects"][0]["parameters"]["radial_clearance"]["low"] < CLEARANCE


def test_the_page_holds_every_sample_and_stays_below_6_megabytes(page: str, explained: dict[str, Any]) -> None:
    data = embedded(page)
    assert len(data["panels"]) == 30
    assert {len(panel[key]) for panel in data["panels"] for key in ("measured", "before", "after")} == {721}
    assert len(page.encode()) < 6e6


def test_the_page_reaches_for_nothing_outside_itself(page: str) -> None:
    assert set(re.findall(r"https?://[^\s\"'<]+", page)) == {"http://www.w3.org/2000/svg"}
    assert not re.search(r"<(link|img|iframe)[^>]+(href|src)=\"(?!data:)", page)


def test_an_ambiguous_page_has_both_names_side_by_side_and_the_run_that_separates_them(
    ambiguous: dict[str, Any],
) -> None:
    html = diagnosis_html(as_document(ambiguous))
    cards = re.findall(r'<div class="card[ a-z]*">\s*<h3>(.*?)(?: <span.*)?</h3>', html)
    assert cards == ["Clearance in joint B", "An error in the length of the coupler"]
    block = re.search(r'<div class="copy"><pre tabindex="0"><code>(\[\[run.*?)</code>', html, re.DOTALL)
    assert block
    assert tomllib.loads(block.group(1).replace("&#34;", '"'))["run"][0]["load"] == [
        {"body": "follower", "torque": 2.0}
    ]


def test_what_was_added_is_told_field_by_field(explained: dict[str, Any]) -> None:
    ((field, nominal, found),) = changes(as_document(explained))
    assert (field, nominal) == ("joint[B].clearance", DASH)
    assert float(found) == explained["effects"][0]["parameters"]["radial_clearance"]["value"]
    assert changes(as_document(no_gap())) == []


def test_arrays_and_nan_are_shown_like_the_json_of_them(page: str, explained: dict[str, Any]) -> None:
    raw = copy.deepcopy(explained)
    for run in raw["runs"]:
        run["crank_angle"] = np.array(run["crank_angle"])
        for signal in run["signals"].values():
            signal["measured"] = np.array([math.nan if v is None else v for v in signal["measured"]])
    assert diagnosis_html(as_document(raw)) == page
    assert diagnosis_md(as_document(raw)) == diagnosis_md(as_document(explained))


def hostile(result: dict[str, Any]) -> dict[str, Any]:
    """Every name and text in the result made into markup, but for the mechanisms, which take no such name."""
    text = json.dumps(result)
    for name in ("slow-forward", "coupler", "mujoco"):
        text = text.replace(name, json.dumps(NASTY)[1:-1] + name)
    out: dict[str, Any] = json.loads(text)
    out |= {"case": NASTY, "statement": NASTY, "command": NASTY}
    out |= {key: result[key] for key in ("mechanism", "explained")}
    out["faults"][0] |= {"text": NASTY, "kind": NASTY}
    out["effects"][0] |= {"name": NASTY, "would_separate": NASTY}
    return out


def test_names_and_texts_from_files_are_escaped_everywhere(ambiguous: dict[str, Any]) -> None:
    result = hostile(ambiguous)
    html = diagnosis_html(as_document(result))
    assert "<img" not in html
    assert html.count("<script") == html.count("</script>") == 2
    outside = re.sub(r"```.*?```", "", diagnosis_md(as_document(result)), flags=re.DOTALL)
    assert not re.search(r"(?<!\\)<img|(?<!\\)\[x\]", outside)


# ------------------------------------------------------------------ text


def test_the_markdown_has_the_effects_and_every_gap(explained: dict[str, Any]) -> None:
    text = diagnosis_md(as_document(explained))
    assert text.startswith("# ✓ Diagnosis of crank-rocker: explained")
    rows = [[c.strip() for c in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("|")]
    (effect,) = [row for row in rows if row[0] == "clearance in joint B"]
    assert effect[1:5] == ["rig", "radial clearance", "0.19999 mm", "0.19971 to 0.20026 mm"]
    gaps = [
        row
        for row in rows
        if len(row) == 7
        and row[0] in ("slow-forward", "slow-reverse", "load-reversed")
        and row[1] != "coupler position y"
    ]
    assert len(gaps) == 30
    follower = next(row for row in gaps if row[:2] == ["slow-forward", "Angle of follower"])
    signal = explained["runs"][0]["signals"]["follower_angle"]
    assert [float(cell) for cell in follower[5:]] == [
        pytest.approx(signal[f"gap_{side}"], rel=1e-2) for side in ("before", "after")
    ]


def test_the_markdown_of_a_tie_names_both_and_gives_the_run(ambiguous: dict[str, Any]) -> None:
    text = diagnosis_md(as_document(ambiguous))
    assert "| clearance in joint B |" in text
    assert "| an error in the length of the coupler |" in text
    block = re.search(r"```toml\n(.*?)\n```", text, re.DOTALL)
    assert block
    assert tomllib.loads(block.group(1))["run"][0]["name"] == "load-reversed"


def test_the_terminal_gets_the_verdict_the_values_and_the_gap_in_ascii(
    explained: dict[str, Any], ambiguous: dict[str, Any], swinging: dict[str, Any]
) -> None:
    lines = terminal_lines(as_document(explained))
    assert lines[0] == "crank-rocker: EXPLAINED"
    assert lines[1] == "missing: clearance in joint B, radial clearance 0.19999 mm (95 %: 0.19971 to 0.20026 mm)"
    assert any(line.startswith("gap: 9.73 before, 1.01 after, noise floor 1") for line in lines)
    tied = terminal_lines(as_document(ambiguous))
    assert [line.split(":")[0] for line in tied[1:4]] == ["either", "or", "to separate them"]
    every = [*lines, *tied, *terminal_lines(as_document(no_gap())), *terminal_lines(as_document(swinging))]
    assert all(line.isascii() and "\n" not in line for line in every)
    assert not any(line.startswith(("missing", "where")) for line in terminal_lines(as_document(no_gap())))


def test_a_power_of_ten_is_ascii_in_a_terminal(explained: dict[str, Any]) -> None:
    lines = terminal_lines(as_document(explained | {"gap": {"before": 1.23e7, "after": 1.0, "noise_floor": 1.0}}))
    assert any("1.23e7 before" in line for line in lines)


# ------------------------------------------------------------------ shares, attempts, validation runs


def test_the_waterfall_takes_effects_as_they_are_listed_and_ends_with_what_remains(partly: dict[str, Any]) -> None:
    bars = waterfall(as_document(partly))
    assert [bar.kind for bar in bars] == ["before", "sensor", "rig", "rest"]
    assert bars[1].label == "each run has its own encoder zero, 1.7 deg too little to 3.6 deg too much"
    assert [bar.share for bar in bars] == pytest.approx([100, 60, 25, 15])
    assert [bar.left for bar in bars] == pytest.approx([0, 40, 15, 0])  # each begins where the one before it ends
    assert sum(bar.share for bar in bars[1:]) == pytest.approx(100)
    html, text = diagnosis_html(as_document(partly)), diagnosis_md(as_document(partly))
    assert 'class="sensor" style="left: 40.00%; width: 60.00%"' in html
    assert "| Clearance in joint B | 25 % |" in text
    unknown = changed(partly, "effects", 1, "share", value=None)
    unknown = changed(unknown, "effects", 0, "share", value=0.0)
    assert waterfall(as_document(unknown)) == []
    assert "What takes the gap away" not in diagnosis_html(as_document(unknown))


@pytest.mark.slow
def test_the_best_attempts_are_ranked_with_what_they_failed(partly: dict[str, Any], explained: dict[str, Any]) -> None:
    first, second = attempts(as_document(partly))
    assert first[:4] == ("a spring in joint E", "stiffness 0.20 N·m/rad", "4 %", "3.2 → 2.9")
    assert second[1] == "2 % too much"
    html, text = diagnosis_html(as_document(partly)), diagnosis_md(as_document(partly))
    lines = terminal_lines(as_document(partly))
    for attempt in partly["attempts"]:
        assert attempt["failed"] in html
        assert attempt["failed"] in text
        assert any(line.startswith("tried: ") and attempt["failed"] in line for line in lines)
    for verdict in ("partly explained", "unexplained", "ambiguous"):
        silent = as_document(partly | {"verdict": verdict, "attempts": []})
        assert "Nothing else that was tried" in diagnosis_html(silent)
        assert "## The best attempts" in diagnosis_md(silent)
    assert "The best attempts" not in diagnosis_html(as_document(explained))


def test_a_tie_has_its_odds(partly: dict[str, Any]) -> None:
    said = "Explains these data nearly as well: odds 19 to 1 for clearance in joint B."
    assert said in diagnosis_html(as_document(partly))
    assert said in diagnosis_md(as_document(partly))
    assert "or: an error in the length of the coupler (odds 19 to 1 for clearance in joint B)" in terminal_lines(
        as_document(partly)
    )


def test_what_the_data_leave_open_of_a_direction_is_not_told_as_a_size(partly: dict[str, Any]) -> None:
    known = Estimate(value=0.018, unit="m", low=0.0179, high=0.0181)
    unseen = Estimate(value=-1.6e-11, unit="m", low=None, high=None)
    pivot = valued("pivot_position", "S", {"x": unseen, "y": known})
    assert values_of(as_document(partly), pivot) == ["x not known", "18.00 mm up"]
    assert rows(pivot.parameters)[0] == ("x", "not known", "not known")
    far = valued("pivot_position", "S", {"x": unseen.model_copy(update={"value": -0.02}), "y": known})
    assert values_of(as_document(partly), far)[0] == "20 mm to the left"


def test_a_sensor_with_a_zero_in_each_run_is_one_sentence_and_a_table(partly: dict[str, Any]) -> None:
    html = diagnosis_html(as_document(partly))
    assert "Each run has its own encoder zero, 1.7 deg too little to 3.6 deg too much." in html
    assert re.search(r"<tr><th[^>]*>slow-reverse</th><td[^>]*>3\.600 deg</td>", html)
    assert "In the validation runs it was not applied, as there is no value for it." in html
    lines = terminal_lines(as_document(partly))
    assert "missing: each run has its own encoder zero, 1.7 deg too little to 3.6 deg too much" in lines


def test_a_validation_run_is_shown_and_never_counts(partly: dict[str, Any]) -> None:
    planted = changed(partly, "runs", 2, "signals", "drive_torque", "gap_after", value=1e3)
    result = as_document(planted | {"faults": []})
    assert not any("load-reversed" in step for step in next_steps(result))
    suite = next(s for s in judged(result) if s.title == "validation run load-reversed")
    assert suite.cases
    assert not any(case.failure for case in suite.cases)
    html, text = diagnosis_html(result), diagnosis_md(result)
    assert "load-reversed (validation run: nothing was fitted to it)" in html
    assert "| load-reversed (validation) | Drive torque T |" in text
    said = "Validation run load-reversed, which nothing was fitted to, differs by"
    assert all(said in words for words in (html, text, "\n".join(terminal_lines(result))))


def test_the_worst_sensor_is_told_with_its_share_of_the_range(partly: dict[str, Any]) -> None:
    result = as_document(partly)
    torque = np.concatenate([run.signals["drive_torque"].measured for run in result.fitted])
    gap = partly["gap"]["by_signal"]["drive_torque"]
    share = 100 * gap["after"] / np.ptp(torque)
    said = explained_to(result)
    assert said.startswith(f"The data are explained to {share:.2g} % of the range: the worst sensor, drive torque,")
    assert f"off by {gap['after']:.3g} N·m (rms) of a range of {np.ptp(torque):.3g} N·m" in said
    assert (
        explained_to(as_document(partly | {"gap": {k: partly["gap"][k] for k in ("before", "after", "noise_floor")}}))
        == ""
    )


def test_measured_and_simulated_are_over_each_other_in_the_unit_that_is_read(explained: dict[str, Any]) -> None:
    result = as_document(explained)
    panel = next(p for p in panels(result) if (p.run, p.signal) == (0, "follower_angle"))
    before = np.degrees(explained["runs"][0]["signals"]["follower_angle"]["before"])
    np.testing.assert_allclose(np.array(panel.simulated("before"), float), before, atol=1e-4)
    drawn = overlay(panel, "x")
    assert [s.name for s in drawn.series] == ["measured", "before", "after"]
    assert drawn.y.unit == "deg"
    assert broken((170.0, 179.0, -179.0, -170.0, None, 10.0), 180.0) == (170.0, 179.0, None, -170.0, None, 10.0)


# ------------------------------------------------------------------ the document and its other files


@pytest.mark.parametrize("make", [sample_diagnosis, *slow(swinging_diagnosis), no_gap, partly_explained])
def test_a_diagnosis_is_read_and_written_as_it_was(make: Any) -> None:
    content = json.loads(to_json(make()))
    document = Diagnosis.model_validate(content)
    assert json.loads(document.to_json()) == content
    assert len(repr(document)) < 300
    assert "\n" not in repr(document)


def test_a_series_of_another_length_is_refused(small: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"signals.drive_torque.before has 1 values for 37 samples"):
        as_document(changed(small, "runs", 0, "signals", "drive_torque", "before", value=[0.0]))


def test_junit_fails_where_the_diagnosis_is_not_settled_and_names_what_is_left(
    explained: dict[str, Any], ambiguous: dict[str, Any]
) -> None:
    def failed(result: dict[str, Any]) -> list[str]:
        root = ElementTree.fromstring(files_of(as_document(result))["junit.xml"])
        names = (str(case.get("name")) for case in root.iter("testcase") if case.find("failure") is not None)
        found = [name.rpartition(": ")[2] for name in names]
        assert root.get("failures") == str(len(found))
        assert root.get("tests") == str(1 + sum(len(run["signals"]) for run in result["runs"]))
        return found

    assert failed(explained) == []
    assert failed(ambiguous) == ["verdict"]
    left = changed(explained, "runs", 1, "signals", "drive_torque", "gap_after", value=7.0)
    assert failed(left | {"verdict": "unexplained"})[:2] == ["verdict", "drive_torque"]
    ElementTree.fromstring(files_of(as_document(hostile(ambiguous)))["junit.xml"])

"""Clearance of rigs that rattle: told by how readings are spread over revolutions, where no sample can be foretold."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from analytic.mechanism import Mechanism
from analytic.mechanism.file import load
from analytic.mechanism.signals import named
from compare.diagnose.data.recording import Channel, Measured, MeasuredRun
from compare.diagnose.effects.joints import JointClearance
from compare.diagnose.predict import Term
from compare.diagnose.rattle.explained import Struck, jackknifed
from compare.diagnose.rattle.statistics import QUANTILES, Statistics, blows, quantiles
from compare.diagnose.rattle.trial import Trials, Tried, least, reaching, wanted
from compare.diagnose.rattle.turns import Turns, rattles
from compare.diagnose.workflow import diagnose
from compare.results.diagnosis import DiagnosedRun, Diagnosis, SensorRecord
from marks import slow
from sample_diagnosis import as_document, sample_diagnosis
from sim_models.common.contact_laws import default_stiffness
from tests.evidence.scoreboard.rattling import Rattling, drawn

SPEED, SAMPLES, COUNT = 30.0, 150, 6
SENSORS = {"follower_angle": 1e-4, "reaction_E_x": 0.05, "reaction_E_y": 0.05}


def recording(**values: np.ndarray) -> tuple[Measured, dict[str, Turns]]:
    """A run of six revolutions of the crank-rocker whose sensors read these values (N,)."""
    mechanism: Mechanism = load("crank-rocker").rigid()
    known = named(mechanism.bodies, mechanism.joints, mechanism.drives, mechanism.sensors)
    time = np.arange(SAMPLES * COUNT + 1) * 2 * math.pi / SPEED / SAMPLES
    channels = {s: Channel(known[s], v, SENSORS[s], True, known[s].unit) for s, v in values.items()}
    run = MeasuredRun("run", time, channels, "speed", SPEED, 0.4, {}, None, False, "run.csv")
    return Measured(mechanism, (run,), {}, (), "measured.toml"), {"run": Turns.of(0.4 + SPEED * time)}


def smooth() -> dict[str, np.ndarray]:
    """What the sensors would read without clearance and noise."""
    phase = np.arange(SAMPLES * COUNT + 1) * 2 * math.pi / SAMPLES
    return {"follower_angle": 0.3 * np.cos(phase), "reaction_E_x": 5 * np.sin(phase), "reaction_E_y": 4 * np.cos(phase)}


def noisy(rng: np.random.Generator) -> dict[str, np.ndarray]:
    """The same with the sensors' noise."""
    return {s: v + SENSORS[s] * rng.standard_normal(v.size) for s, v in smooth().items()}


def struck(rng: np.random.Generator, size: float = 1.0) -> dict[str, np.ndarray]:
    """Bursts after the middle of each revolution, in all sensors at once, each another."""
    found, phase = noisy(rng), (np.arange(SAMPLES * COUNT + 1) / SAMPLES) % 1.0
    hit = (phase > 0.5) & (phase < 0.6)
    blow = size * hit * rng.standard_normal(hit.size)
    return {s: v + blow * (1e-2 if s == "follower_angle" else 20.0) for s, v in found.items()}


# ---------------------------------------------------------------- revolutions


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_revolutions_are_counted_whichever_way_the_crank_turns(way: float) -> None:
    turns = Turns.of(0.4 + way * np.arange(SAMPLES * COUNT + 1) * 2 * math.pi / SAMPLES)
    assert turns.count == COUNT
    assert turns.bins == 24
    table = turns.table()
    assert np.sum(table >= 0) in (SAMPLES * COUNT, SAMPLES * COUNT + 1)
    assert np.all(turns.phase[table[3][table[3] >= 0]] * 24 // 1 == 3)
    assert set(turns.turn[turns.table([2, 4])[0]].tolist()) <= {2, 4, -1}


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_what_repeats_folds_onto_itself(way: float) -> None:
    angle = 0.4 + way * np.arange(167 * COUNT + 1) * 2 * math.pi / 167.3
    each = Turns.of(angle).folded(np.sin(angle))
    assert each.shape[0] == Turns.of(angle).count
    assert np.abs(each - each[0]).max() < 2e-3


def test_quantiles_are_those_of_numpy() -> None:
    rng = np.random.default_rng(3)
    values = rng.standard_normal(40)
    values[5] = math.nan
    table = np.array([np.r_[0:20], np.r_[20:35, [-1] * 5], [-1] * 20])
    found = quantiles(values, table)
    assert found[0] == pytest.approx(np.nanquantile(values[:20], QUANTILES))
    assert found[1] == pytest.approx(np.quantile(values[20:35], QUANTILES))
    assert np.isnan(found[2]).all()


# ---------------------------------------------------------------- what rattles


def test_blows_in_several_sensors_at_once_are_rattle() -> None:
    data, turns = recording(**struck(np.random.default_rng(1)))
    assert rattles(data, turns, {"run": list(SENSORS)})


def test_noise_hum_and_spikes_of_single_sensors_are_not() -> None:
    rng = np.random.default_rng(2)
    time = np.arange(SAMPLES * COUNT + 1) * 2 * math.pi / SPEED / SAMPLES
    quiet = noisy(rng)
    hums = {s: v + 30 * SENSORS[s] * np.sin(2 * math.pi * 50 * time) for s, v in noisy(rng).items()}
    spiky = {s: v + 300 * SENSORS[s] * (rng.random(v.size) < 0.01) for s, v in noisy(rng).items()}
    for values in (quiet, hums, spiky):
        data, turns = recording(**values)
        assert not rattles(data, turns, {"run": list(SENSORS)})


def test_isolated_spikes_are_evidence_where_pins_strike() -> None:
    spikes = np.array([math.nan, 7.0, math.nan])
    known = named(*((m := load("crank-rocker")).bodies, m.joints, m.drives))
    channel = Channel(known["reaction_E_x"], np.array([1.0, math.nan, 3.0]), 0.1, True, "N", spikes)
    assert channel.raw.tolist() == [1.0, 7.0, 3.0]
    assert channel.at(np.array([1, 2])).raw.tolist() == [7.0, 3.0]


# ---------------------------------------------------------------- statistics


def statistics(values: dict[str, np.ndarray]) -> Statistics:
    """Of a recording, foretold as smooth."""
    data, turns = recording(**values)
    return Statistics(data, [smooth()], turns, {"run": list(SENSORS)})


def test_two_recordings_of_one_rig_are_as_far_apart_as_their_halves() -> None:
    judged = statistics(struck(np.random.default_rng(4)))
    again = struck(np.random.default_rng(5))
    assert 0.7 < judged.gap([again]) < 1.6
    assert judged.gap([smooth()]) > 2.0 * judged.gap([again])
    assert judged.gap([struck(np.random.default_rng(6), 4.0)]) > 1.5 * judged.gap([again])


def diagnosed(measured: dict[str, np.ndarray], after: dict[str, np.ndarray]) -> Diagnosis:
    """A document of that recording, simulated as smooth before."""
    (run,) = recording(**measured)[0].runs
    before, noise = smooth(), {"noise_given": True, "gap_before": 9.0, "gap_after": 1.0}
    signals = {
        s: SensorRecord(unit=c.unit, noise=c.noise, measured=c.values, before=before[s], after=after[s], **noise)
        for s, c in run.channels.items()
    }
    angle = 0.4 + SPEED * run.time
    document = DiagnosedRun(name="run", drive="speed", time=run.time, crank_angle=angle, held_out=None, signals=signals)
    return as_document(sample_diagnosis(samples=37)).model_copy(update={"runs": (document,)})


def test_quantiles_of_a_diagnosis_are_a_frame_of_what_it_was_judged_by() -> None:
    """It has the judge's own numbers; a part of the turn is counted again."""
    measured, after = struck(np.random.default_rng(4)), struck(np.random.default_rng(5))
    result, judge = diagnosed(measured, after), statistics(measured)
    frame = result.quantiles_frame()
    assert len(frame) == len(SENSORS) * 24 * len(QUANTILES)
    judged = {
        "measured": judge.measured.whole,
        "before": judge.simulated([smooth()]),
        "after": judge.simulated([after]),
    }
    for side, told in judged.items():
        for signal, rows in frame.groupby("signal", sort=False):
            found = rows[side].to_numpy().reshape(24, 5)
            np.testing.assert_allclose(found, told["run", str(signal)], rtol=1e-12, err_msg=side)
    turned = (result.runs[0].crank_angle % math.tau)[: SAMPLES * COUNT]
    for row in frame.iloc[[0, 57, 121, 200, 240, 359]].to_dict("records"):
        there = (turned >= row["crank_angle_from"]) & (turned < row["crank_angle_to"])
        off = (measured[row["signal"]] - smooth()[row["signal"]])[: SAMPLES * COUNT][there]
        assert row["measured"] == pytest.approx(np.quantile(off, row["quantile"]), rel=1e-9)
    assert [*frame.loc[0]][:4] == ["run", "follower_angle", "rad", 0.1]


def test_quantiles_are_of_the_readings_themselves_where_the_nominal_linkage_has_clearance() -> None:
    measured = struck(np.random.default_rng(4))
    result = diagnosed(measured, measured)
    loose = result.model_copy(update={"mechanism": result.mechanism.with_clearances({"B": 1e-4})})
    frame = loose.quantiles_frame()
    assert set(frame["signal"]) == {"reaction_E_x", "reaction_E_y"}
    middle = frame[(frame["signal"] == "reaction_E_y") & (frame["quantile"] == 0.5)]
    middles = (middle["crank_angle_from"] + middle["crank_angle_to"]) / 2
    np.testing.assert_allclose(middle["before"], 4 * np.cos(middles - 0.4), atol=0.3)


def test_a_run_of_less_than_three_revolutions_has_no_quantiles() -> None:
    with pytest.raises(KeyError, match="no run turns a crank 3 times"):
        as_document(sample_diagnosis(samples=37)).quantiles_frame()


def test_a_recording_that_only_begins_the_same_is_compared_over_what_there_is() -> None:
    judged = statistics(struck(np.random.default_rng(4)))
    begun = {
        s: np.where(np.arange(v.size) < 3 * SAMPLES, v, math.nan) for s, v in struck(np.random.default_rng(5)).items()
    }
    assert 0.7 < judged.gap([begun]) < 2.2


def test_distances_are_told_with_each_group_of_revolutions_left_out() -> None:
    judged = statistics(struck(np.random.default_rng(4)))
    found = judged.distances(judged.spread([struck(np.random.default_rng(5))]))
    assert len(found) == 1 + judged.groups == 1 + COUNT
    assert all(set(each) == {("run", s) for s in SENSORS} for each in found)
    assert len({each["run", "reaction_E_x"] for each in found}) > 1
    assert judged.says() == "from statistics over 6 revolutions"


CHIPS = {
    "chip": {"kind": "accelerometer", "body": "coupler"},
    "spin": {"kind": "gyro", "body": "follower"},
    "gauge": {"kind": "strain", "body": "coupler", "point": (0.06, 0.005), "youngs_modulus": 2e11},
    "wire": {"kind": "distance", "body": "coupler", "to": "ground.E"},
}


def chips(rng: np.random.Generator, size: float) -> dict[str, np.ndarray]:
    """What two accelerometers and more read of blows that go with the root of a clearance, as approach speeds do."""
    return {name: values * math.sqrt(size) for name, values in zip(CHIPS, bursts(rng), strict=True)}


def bursts(rng: np.random.Generator) -> list[np.ndarray]:
    """A burst after the middle of each revolution in each of them."""
    phase = (np.arange(SAMPLES * COUNT + 1) / SAMPLES) % 1.0
    return [((phase > 0.5) & (phase < 0.6)) * rng.standard_normal(phase.size) for _ in CHIPS]


def read_by_chips(values: dict[str, np.ndarray]) -> Statistics:
    """Of a recording by sensors of the mechanism file, of which nothing is foretold but quiet."""
    m = load("crank-rocker").rigid()
    m = m.replace(sensors=tuple({"name": name, **CHIPS[name]} for name in values))
    known = named(m.bodies, m.joints, m.drives, m.sensors)
    time = np.arange(SAMPLES * COUNT + 1) * 2 * math.pi / SPEED / SAMPLES
    channels = {s: Channel(known[s], v, 1e-2, True, known[s].unit) for s, v in values.items()}
    run = MeasuredRun("run", time, channels, "speed", SPEED, 0.4, {}, None, False, "run.csv")
    quiet = {s: np.zeros(time.size) for s in values}
    data = Measured(m, (run,), {}, (), "measured.toml")
    return Statistics(data, [quiet], {"run": Turns.of(0.4 + SPEED * time)}, {"run": list(values)})


def test_of_all_sensors_only_those_of_a_position_say_how_far_a_pin_goes() -> None:
    assert read_by_chips(chips(np.random.default_rng(1), 1.0)).places == [("run", "wire")]


def test_accelerometers_alone_tell_a_size_to_a_third() -> None:
    """Their readings go with the root of a clearance here, so that scatter counts twice; and by least misfit it reads
    low, as two recordings scatter each in its own way.
    """
    size, found = 2e-4, []
    for seed in range(6):

        def of(own: int, clearance: float) -> dict[str, np.ndarray]:
            rng = np.random.default_rng(own)
            return {s: v + 1e-2 * rng.standard_normal(v.size) for s, v in chips(rng, clearance / size).items()}

        recorded = {s: v for s, v in of(10 + seed, size).items() if s != "wire"}
        trials = Trials(
            read_by_chips(recorded), lambda term, c, first, seed=seed: [of(50 + seed, c)], 0.05, lambda term: 1e-2
        )
        (tried,) = trials.searched({TERM: None}, math.inf)
        found.append(least(tried, Tried.misfit) / size)
    assert math.exp(np.mean(np.log(found))) == pytest.approx(0.85, abs=0.2)
    assert np.std(np.log(found)) < 0.35


def test_blows_of_a_sine_and_of_a_click_have_their_closed_forms() -> None:
    """A sine of size a: rms a/sqrt(2), kurtosis 3/2, one octave; a click h in n samples: h/sqrt(n), n, all octaves."""
    phase = 2 * math.pi * np.arange(256) / 256
    sine = blows(np.tile(3.0 * np.sin(5 * phase), (4, 1))).ravel()
    assert sine[:3] == pytest.approx([math.log(3 / math.sqrt(2)), math.log(1.5) / 2, 0.0], abs=1e-6)
    octaves = sine[3:11]
    assert np.nanargmax(octaves) == 2  # the 4th to 7th harmonic
    assert np.nanmax(np.delete(octaves, 2)) < octaves[2] - 20
    click = blows(np.eye(1, 256, 77) * 8.0 + np.zeros((4, 1))).ravel()
    assert click[:3] == pytest.approx([math.log(8 / 16), math.log(256) / 2, math.log(2)], abs=1e-6)
    assert np.ptp(click[3:11]) < 1e-6  # a click is as loud in every octave
    assert np.isnan(blows(np.zeros((4, 256)))[0, :2]).all()


def test_blows_too_short_for_quantiles_are_told_all_the_same() -> None:
    """Clicks in one sample of a hundred, three times as high in another rig, move no quantile of a part of a turn."""

    def clicking(seed: int, height: float) -> dict[str, np.ndarray]:
        rng = np.random.default_rng(seed)
        n = SAMPLES * COUNT + 1
        clicks = (rng.random(n) < 0.01) * rng.choice((-height, height), n)
        return {"chip": 0.1 * rng.standard_normal(n) + clicks}

    judged = read_by_chips(clicking(1, 3.0))
    again, louder = (judged.simulated([clicking(2, height)]) for height in (3.0, 9.0))
    bins = judged.turns["run"].bins
    key = ("run", "chip")
    off = [np.abs(each[key] - judged.measured.whole[key])[:bins].mean() for each in (again, louder)]
    assert off[1] == pytest.approx(off[0], rel=0.2)
    assert judged.gap([clicking(2, 9.0)]) > 1.5 * judged.gap([clicking(2, 3.0)])


# ---------------------------------------------------------------- sizes

TERM = Term(JointClearance(), "B")


def test_the_size_wanted_is_told_by_the_middle_of_positions_whatever_some_do() -> None:
    rng = np.random.default_rng(7)
    a_little = {("run", "follower_angle"): np.sin(np.arange(24.0)) + 0.1}
    measured = {key: 3.0 * v + 1e-3 * rng.standard_normal(24) for key, v in a_little.items()}
    measured["run", "follower_angle"][[2, 9]] += 40.0
    assert wanted(measured, a_little, {("run", "follower_angle"): 1e-3}) == pytest.approx(3.0, rel=0.02)


def test_the_least_misfit_is_found_between_the_sizes_that_were_tried() -> None:
    key = ("run", "follower_angle")
    tried = [Tried(TERM, c, [{key: math.exp(math.log(c / 2e-4) ** 2)}]) for c in (1e-4, 1.7e-4, 3e-4, 5e-4)]
    assert least(tried, lambda each: each.misfit()) == pytest.approx(2e-4, rel=1e-6)


def test_joints_are_tried_and_the_one_that_rattles_alike_is_found() -> None:
    judged = statistics(struck(np.random.default_rng(4)))
    asked: list[tuple[str, float, int | None]] = []

    def simulate(term: Term, size: float, first: int | None) -> list[dict[str, np.ndarray]]:
        asked.append((term.where, size, first))
        return [struck(np.random.default_rng(9), size / 2e-4 if term.where == "B" else 0.0)]

    trials = Trials(judged, simulate, 0.05, lambda term: 1e-3)
    terms = {Term(JointClearance(), joint): 2.5e-4 for joint in "BE"}
    found = trials.searched(terms, judged.distances(judged.spread([smooth()]))[0]["run", "reaction_E_x"])
    assert found[0][0].term.where == "B"
    assert found[0][0].size == pytest.approx(2e-4, rel=0.3)
    assert len(asked) == len(set(asked)) == len(trials.done)


def struck_trials(
    others: Callable[[Term], Sequence[Term]], size: float = 2e-4
) -> tuple[Trials, list[tuple[str, float]]]:
    """Trials of a rig whose pin gives back 0.6 of its speed: with less its blows are smaller, with more larger."""
    judged, asked = statistics(struck(np.random.default_rng(4))), []

    def simulate(term: Term, clearance: float, first: int | None) -> list[dict[str, np.ndarray]]:
        restitution = getattr(term.effect, "restitution", None)
        asked.append((term.where, restitution))
        there = {None: 0.3, 0.6: 1.0, 0.85: 3.0}[restitution]
        found = struck(np.random.default_rng(9), clearance / size if term.where == "B" else 0.2)
        return [
            {
                s: smooth()[s] + (v - smooth()[s]) * (there if s.startswith("reaction") else 1.0)
                for s, v in found.items()
            }
        ]

    return Trials(judged, simulate, 0.05, lambda term: 1e-3, others=others), asked


def test_a_size_is_not_read_low_where_two_rigs_scatter_each_in_its_own_way() -> None:
    """The least distance is: it gives up what it cannot foretell.  How far readings reach does not."""
    low, reached = [], []
    for seed in range(6):
        judged, size = statistics(struck(np.random.default_rng(10 + seed))), 2e-4
        trials = Trials(
            judged,
            lambda term, c, first, seed=seed: [struck(np.random.default_rng(50 + seed), c / 2e-4)],
            0.05,
            lambda term: 1e-3,
        )
        tried = sorted(trials.all(TERM, [f * size for f in (0.6, 0.8, 1.0, 1.25)], None), key=Tried.misfit)
        places = judged.places
        low.append(least(tried, lambda each, places=places: each.misfit(places)) / size)
        reached.append(reaching(tried, places) / size)
    assert np.mean(low) < 0.93
    assert np.mean(reached) == pytest.approx(1.0, abs=0.04)


def test_what_impacts_give_back_is_tried_until_more_of_it_does_worse() -> None:
    terms = {None: Term(Struck(SPEED), "B"), 0.6: Term(Struck(SPEED, 0.6), "B"), 0.85: Term(Struck(SPEED, 0.85), "B")}
    trials, asked = struck_trials(lambda term: [terms[0.6], terms[0.85]] if term.where == "B" else [])
    (found,) = trials.searched({terms[None]: 2e-4}, math.inf)
    assert found[0].term == terms[0.6]
    assert {each.term for each in found} == set(terms.values())
    again, asked = struck_trials(lambda term: [terms[0.85], terms[0.6]])
    (found,) = again.searched({terms[None]: 2e-4}, math.inf)
    assert ("B", 0.6) not in asked  # the first did worse


def test_a_wall_gives_as_suits_the_runs_and_not_the_nominal_speed() -> None:
    """The shipped slider-crank's own speed is 5000 rpm; what suits that takes a slow run a thousand times the steps."""
    m = load("slider-crank").rigid().with_joint("B", restitution=None)
    slow_one = m.replace(drive=m.drive.model_copy(update={"speed": SPEED}))
    made = Struck(SPEED, 0.6).on_mechanism(m, "B", {"radial_clearance": 3e-4}).joint("B")
    assert made.contact_stiffness == default_stiffness(slow_one, "driven") < 0.01 * default_stiffness(m, "driven")
    assert made.restitution == 0.6
    stated = m.with_joint("B", contact_stiffness=3e6)
    assert Struck(SPEED).on_mechanism(stated, "B", {"radial_clearance": 3e-4}).joint("B").contact_stiffness == 3e6


def test_the_scatter_of_a_mean_is_that_of_its_jackknife() -> None:
    values = np.random.default_rng(8).standard_normal(8)
    left_out = [float(np.delete(values, k).mean()) for k in range(8)]
    assert jackknifed(left_out) == pytest.approx(values.std(ddof=1) / math.sqrt(8))


# ---------------------------------------------------------------- rigs (long)


def found_in(made: Rattling, folder: Path) -> Diagnosis:
    """What MuJoCo finds."""
    return diagnose(made.written(folder), "mujoco", others=False, workers=1)


def said(found: Diagnosis) -> list[tuple[str, float, list[str]]]:
    """Joint, size (m) and tied joints of every clearance that is named."""
    return [
        (e.where, e.parameters["radial_clearance"].value, [r.where for r in e.ambiguous_with if r.name == e.name])
        for e in found.effects
        if e.name == "joint_clearance"
    ]


@pytest.mark.parametrize("k", slow(3, 8, 11))
def test_clearance_of_a_rig_that_rattles_is_named_with_its_size(k: int, tmp_path: Path) -> None:
    """A slider-crank recorded by Exudyn; one, and a crank-rocker that is free for 40 % of the time, by the equation."""
    _, made = drawn("rattling", k)
    ((where, size, ties),) = said(found := found_in(made, tmp_path))
    assert made.joint in (where, *ties)
    assert where != made.joint or size == pytest.approx(made.clearance, rel=0.1)
    for signal, rows in found.quantiles_frame().groupby("signal"):  # the document's count spikes too
        off = found.gap.by_signal[str(signal)]
        for side, told in (("before", off.before), ("after", off.after)):
            assert np.sqrt(np.mean((rows["measured"] - rows[side]) ** 2)) == pytest.approx(told, rel=0.2), signal


@pytest.mark.parametrize("k", slow(0, 3))
def test_rigs_whose_sensors_hum_spike_or_ring_have_no_clearance(k: int, tmp_path: Path) -> None:
    _, made = drawn("still", k)
    assert made.faults
    assert said(found_in(made, tmp_path)) == []

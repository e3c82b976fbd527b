"""Bands of predictions: closed forms, what a diagnosis hands on, and what an engine then does outside the data."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

import linkage_crosscheck as lc
from analytic.mechanism.file import load
from compare.diagnose.data.measured_file import ContextTable
from compare.diagnose.data.recording import MeasuredError
from compare.diagnose.data.wanted import wanted
from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.diagnose.foretold import Explained, for_run, foretold
from compare.diagnose.mixture import Discrepancy, axes, growth, quantile
from compare.diagnose.planned import planned
from compare.diagnose.warrant import half_width, judged, judged_by
from compare.faults import ArgumentError
from compare.questions.option import ByBody
from compare.report.words.prediction import notes, rpm
from compare.results.band import Band, Context
from compare.results.diagnosis import Diagnosis, EffectSet, Estimate, JointCovariance
from diagnosis_rigs import experiment, played, turn, wrong
from sample_diagnosis import as_document, sample_diagnosis

ALONG = "link_length@coupler.length_error"


# ---------------------------------------------------------------- closed forms


def test_a_quantile_of_one_normal_is_its_own() -> None:
    found = quantile(0.975, np.ones(1), np.array([[2.0, -1.0]]), np.array([[0.5, 3.0]]))
    assert found == pytest.approx([2.0 + 1.959964 * 0.5, -1.0 + 1.959964 * 3.0], rel=1e-6)


def test_a_quantile_of_two_far_apart_lies_in_the_one_that_holds_it() -> None:
    """Of 0.9 N(0, 1) and 0.1 N(100, 1): 3/4 of the second lie below the 97.5 %, 1/36 of the first below the 2.5 %."""
    weights, means, sds = np.array([0.9, 0.1]), np.array([[0.0], [100.0]]), np.ones((2, 1))
    assert quantile(0.975, weights, means, sds)[0] == pytest.approx(100.6745, abs=1e-3)
    assert quantile(0.025, weights, means, sds)[0] == pytest.approx(-1.9145, abs=1e-3)


def test_axes_make_the_covariance_again_and_what_is_open_is_known_to_its_size() -> None:
    covariance = np.array([[4.0, 1e-6], [1e-6, 1e-12]])  # correlated by a half, of very different sizes
    found = axes(np.array([1.0, 2.0]), covariance)
    assert found.T @ found == pytest.approx(covariance, rel=1e-9)
    covariance[1] = covariance[:, 1] = math.nan
    found = axes(np.array([1.0, 3.0]), covariance)
    assert found.T @ found == pytest.approx(np.diag([4.0, 9.0]))


def test_white_noise_leaves_next_to_nothing_unexplained_and_a_wave_its_size() -> None:
    noise = np.random.default_rng(1).standard_normal((2, 240))
    assert Discrepancy.of(list(noise)).size < 0.3
    wave = 5 * np.sin(np.linspace(0, 6 * math.pi, 240))
    found = Discrepancy.of([wave + each for each in noise])
    assert 10 < found.samples < 25  # a sixth of its 80 samples, where a cosine is a half
    open_ = math.sqrt(1 + math.sqrt(2 * found.samples / (480 * math.log(2))))
    assert found.size == pytest.approx(open_ * 5 / math.sqrt(2), rel=0.1)
    assert Discrepancy.of([np.full(240, np.nan)]).size == 0


@pytest.mark.parametrize(("alike", "samples", "runs"), [(20, 500, 1), (50, 1000, 1), (100, 1000, 3)])
def test_what_is_alike_over_many_samples_is_hardly_ever_larger_than_it_is_taken_to_be(
    alike: int, samples: int, runs: int
) -> None:
    """With one standard deviation added its estimate is no smaller than the truth in some five cases of six."""
    share, rng = 2 ** (-1 / alike), np.random.default_rng(1)
    sizes = []
    for _ in range(100):
        white = rng.standard_normal((runs, samples + 20 * alike))
        slow = lfilter([math.sqrt(1 - share**2)], [1, -share], white)[:, 20 * alike :]
        sizes.append(Discrepancy.of(list(slow + 0.5 * rng.standard_normal(slow.shape))).size)
    assert 0.65 < np.mean(np.array(sizes) >= 1.0) < 0.95
    assert np.median(sizes) < 1.25


def test_what_is_unexplained_grows_as_the_square_beyond_the_data_and_up_to_twice_below() -> None:
    assert growth(8.0, [4.0, 12.0], 1.0, 1.0) == 1.0
    assert growth(24.0, [4.0, 12.0], 1.0, 1.0) == 4.0
    assert growth(1.0, [4.0, 12.0], 1.0, 1.0) == 1.75
    assert growth(8.0, [4.0, 12.0], 3.0, 1.0) == 3.0


def test_values_of_runs_are_for_another_run_one_of_their_kind() -> None:
    names = ("sensor_bias@drive_torque.bias@a", "sensor_bias@drive_torque.bias@b", ALONG)
    told = JointCovariance(names=names, values=((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 4.0)))
    found, values, covariance = for_run(dict(zip(names, (1.0, 3.0, 5.0), strict=True)), told, "new")
    assert found == ["sensor_bias@drive_torque.bias", ALONG]
    assert values.tolist() == [2.0, 5.0]
    assert np.diag(covariance).tolist() == [2.0 * 1.5, 4.0]


# ---------------------------------------------------------------- models of one parameter


def explained_by(*sets: tuple[str, str, float, float | None, float]) -> Explained:
    """A diagnosis that leaves no residual, of sets of one effect at D: name, parameter, value, its variance (None:
    open) and probability; the first is named.
    """
    result = as_document(sample_diagnosis())
    runs = tuple(
        run.model_copy(
            update={"signals": {s: c.model_copy(update={"after": c.measured}) for s, c in run.signals.items()}}
        )
        for run in result.runs
    )
    told = []
    for name, parameter, value, variance, share in sets:
        at = f"{name}@D.{parameter}"
        joint = JointCovariance(names=(at,), values=((variance,),))
        told.append(EffectSet(effects=(f"{name}@D",), probability=share, values={at: value}, covariance=joint))
    name, parameter, value, *_ = sets[0]
    estimate = Estimate(value=value, unit="1", low=None, high=None)
    named = result.effects[0].model_copy(update={"name": name, "where": "D", "parameters": {parameter: estimate}})
    update = {"runs": runs, "effects": (named,), "sets": tuple(told), "covariance": told[0].covariance}
    return Explained(result.model_copy(update=update), result.mechanism.rigid(), VOCABULARY)


def torque(explained: Explained, speed: float) -> Band:
    """The band of the drive torque over a turn at a speed (rad/s)."""
    ahead = planned(explained.result, explained.mechanism, speed, ("drive_torque",))
    assert ahead is not None
    found = foretold(explained, ahead, False)
    assert found is not None
    return found["drive_torque"]


def test_a_damper_at_the_crank_is_known_as_well_as_its_torque() -> None:
    """Of a crank at constant speed the damper's torque is damping times speed: at 24 rad/s, known to 0.01 N.m.s/rad,
    the torque is known to 0.24 N.m at every angle.
    """
    band = torque(explained_by(("viscous_friction", "damping", 0.05, 1e-4, 1.0)), 24.0)
    assert band.high - band.value == pytest.approx(np.full(band.value.size, 1.959964 * 0.24), rel=1e-6)
    assert band.value - band.low == pytest.approx(np.full(band.value.size, 1.959964 * 0.24), rel=1e-6)
    assert band.sd == pytest.approx({"parameters": 0.24, "sets": 0.0, "engines": 0.0, "discrepancy": 0.0}, abs=1e-12)
    assert band.covered is None


def test_a_damping_that_the_data_leave_open_is_known_to_its_size() -> None:
    band = torque(explained_by(("viscous_friction", "damping", 0.05, None, 1.0)), 24.0)
    assert band.sd["parameters"] == pytest.approx(0.05 * 24.0, rel=1e-6)


def test_friction_and_a_damper_that_agree_in_the_data_part_beyond_them() -> None:
    """Friction of 0.1 N.m or a damper of 0.05 N.m.s/rad are the same at 2 rad/s, and 1.1 N.m apart at 24 rad/s."""
    explained = explained_by(
        ("viscous_friction", "damping", 0.05, 0.0, 0.5), ("coulomb_friction", "friction_torque", 0.1, 0.0, 0.5)
    )
    assert half_width(torque(explained, 2.0)) == pytest.approx(0.0, abs=1e-9)
    band = torque(explained, 24.0)
    assert band.high - band.low == pytest.approx(np.full(band.value.size, 1.1), rel=1e-6)
    assert band.sd["sets"] == pytest.approx(0.55, rel=1e-6)


def test_a_run_that_follows_its_encoder_is_of_all_the_speeds_that_it_goes_at() -> None:
    """One that speeds up evenly from rest to 10 rad/s: a twentieth is slower than 0.5, and one faster than 9.5."""
    explained = explained_by(("viscous_friction", "damping", 0.05, 1e-4, 1.0))
    (run, *_), time = explained.result.fitted, np.linspace(0.0, 1.0, 1001)
    angle, nothing = 5.0 * time**2, np.zeros(time.size)
    signals = {
        s: c.model_copy(update=dict.fromkeys(("measured", "before", "after"), nothing)) for s, c in run.signals.items()
    }
    update = {"drive": "measured", "time": time, "crank_angle": angle, "signals": signals, "held_out": None}
    followed = explained.result.model_copy(update={"runs": (run.model_copy(update=update),)})
    swept = replace(explained, result=followed)
    assert swept.paces == pytest.approx([0.5, 9.5], abs=0.01)
    assert swept.speeds == pytest.approx([5.0])


# ---------------------------------------------------------------- what is wanted


FOUR_BAR = load("crank-rocker")


def test_what_is_wanted_is_read_with_its_units_and_judged() -> None:
    table = ContextTable(quantity="drive_torque", required="500 mN.m", speed="24 rad/s", consequence="a larger motor")
    explained = explained_by(("viscous_friction", "damping", 0.05, 1e-4, 1.0))
    want = wanted("measured.toml", table, FOUR_BAR)
    assert want is not None
    context = judged_by(explained, want)
    assert context.required == 0.5
    assert context.half_width == pytest.approx(1.959964 * 0.24, rel=1e-6)
    assert context.enough
    assert context.says.startswith("Good enough for 0.5 N·m at 229 rpm: yes, with 95 %")
    assert judged_by(explained, replace(want, required=0.4)).enough is False


@pytest.mark.parametrize(
    ("table", "why"),
    [
        (
            {"quantity": "drive_torqe", "required": 1.0},
            "context.quantity: 'drive_torqe' is no signal of the mechanism;",
        ),
        ({"quantity": "drive_torque", "required": "1 mm"}, "context.required = '1 mm' has "),
        ({"quantity": "drive_torque", "required": 0.0}, "context.required = 0.0; give an error above 0, in N.m"),
        ({"quantity": "drive_torque", "required": 1.0, "speed": 0.0}, "context.speed = 0.0; give a speed other than 0"),
        ({"quantity": "drive_torque", "required": 1.0, "calibration": {"x": 1.0}}, "context.calibration.x: 'x' is no"),
    ],
)
def test_what_is_wanted_of_nothing_is_refused(table: dict[str, Any], why: str) -> None:
    with pytest.raises(MeasuredError, match=re.escape(why)):
        wanted("measured.toml", ContextTable(**table), FOUR_BAR)


# ---------------------------------------------------------------- a rig


@cache
def kept() -> tuple[Diagnosis, Diagnosis]:
    """The four-bar with a longer coupler and a damper, at two speeds, and a faster run in which nothing is fitted; with
    both looked for, and with the damper ruled out.
    """
    runs = (turn("slow", 4.0), turn("fast-reverse", -12.0), turn("kept", 20.0))
    longer, damped = wrong("link_length", "coupler", length_error=5e-4), wrong("viscous_friction", "E", damping=0.02)
    data = played(experiment(*runs), longer, damped)
    data = replace(data, runs=(*data.runs[:2], replace(data.runs[2], role="validation")))
    both, one = (
        lc.diagnose(data, others=False, workers=1, only=only)
        for only in (("link_length@coupler", "viscous_friction@E"), ("link_length@coupler",))
    )
    return both, one


@pytest.mark.slow
def test_a_run_of_another_engine_outside_the_data_lies_in_its_band() -> None:
    both, one = kept()
    assert {e.key for e in both.effects} == {"viscous_friction@E", "link_length@coupler"}
    for result, widest in ((both, 5.0), (one, math.inf)):  # sigmas of noise
        run = result.runs[2]
        shares = {s: band.covered for s, band in run.prediction.items()}
        assert min(shares.values()) > 0.9, shares
        assert max(half_width(b) / run.signals[s].noise for s, b in run.prediction.items()) < widest
    narrow, wide = (result.runs[2].prediction["drive_torque"] for result in (both, one))
    assert wide.sd["discrepancy"] > 10 * narrow.sd["discrepancy"]  # what has no name left is not forgotten
    found = both.runs[2].signals["drive_torque"].metrics
    assert found is not None
    assert found.model_error[0] < 0 < found.model_error[1]
    assert found.u_val == pytest.approx(math.hypot(found.u_d, found.u_num, found.u_input))
    assert found.within > 0.9


@pytest.mark.slow
def test_a_speed_is_foretold_and_what_it_cannot_be_is_refused(tmp_path: Path) -> None:
    both, _ = kept()
    both.write(tmp_path / "found")
    file = tmp_path / "found" / "diagnosis.json"
    found = lc.predict(file, speed="300 rpm", load={"coupler": (0.0, -60.0)})
    run = found.runs[0]
    assert run.speed == pytest.approx(10 * math.pi)
    assert any("faster than any fitted run" in note for note in found.notes)
    alone = lc.predict(both, speed=10 * math.pi, load={"coupler": (0.0, -60.0)}, simulator="none")
    assert alone.runs[0].signals["drive_torque"].sd["engines"] == 0
    assert alone.runs[0].signals["drive_torque"].value == pytest.approx(run.signals["drive_torque"].value, abs=1e-3)
    lifted = lc.predict(both, speed=10 * math.pi, simulator="none", signals=["reaction_B_x"])
    assert any("Nobody measured reaction_B_x" in note for note in lifted.notes)
    for asked, why in (
        ({"load": {"coupla": (0.0, 1.0)}}, "coupla is no moving body"),
        ({"signals": ["reaction_Z_x"]}, "reaction_Z_x is no signal"),
        ({"run": "run.toml", "speed": 1.0}, "it has no part in the runs of a file"),
        ({"speed": "300 mm"}, "300 mm"),
    ):
        with pytest.raises(ArgumentError, match=why):
            lc.predict(both, **asked)


def test_far_beyond_all_that_was_measured_the_band_is_said_to_say_nothing() -> None:
    explained = explained_by(("viscous_friction", "damping", 0.05, 1e-4, 1.0))
    fastest = max(explained.speeds)
    band = {"drive_torque": torque(explained, 24.0)}
    near, far = (notes(band, times * fastest, explained.speeds, [], 0.0)[0] for times in (9.0, 1e6))
    assert "bands grow with its square" in near
    assert f"1e+06 times as fast as anything measured ({rpm(fastest)}): the band says nothing there" in far
    asked = Context(
        quantity="drive_torque", unit="N.m", required=2.0, speed=-1e6 * fastest, half_width=None, enough=None, says="-"
    )
    there = judged(asked, 1.0, explained.speeds)
    assert there.enough is None
    assert "nobody can say, as that is 1e+06 times" in there.says
    near_by = judged(asked.model_copy(update={"speed": fastest}), 1.0, explained.speeds)
    assert near_by.enough
    assert "yes, with 95 %" in near_by.says


def test_the_force_on_a_body_is_given_once() -> None:
    """Of two the first would be lost."""
    assert ByBody().parse(["coupler=1:2", "crank=3:4"], "load") == {"coupler": (1.0, 2.0), "crank": (3.0, 4.0)}
    with pytest.raises(ArgumentError, match="coupler is there twice"):
        ByBody().parse(["coupler=1:2", "coupler=3:4"], "load")

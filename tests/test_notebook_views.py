"""What a notebook shows of a result: all that its page says of the answer."""

from __future__ import annotations

import html
import re
from pathlib import Path

import numpy as np
import pandas
import pytest

import linkage_crosscheck as lc
from analytic.mechanism.file import loads
from compare.new import begun
from compare.quantities import DASH, MINUS
from compare.report.words import diagnosis as words
from compare.report.words.effects import rival_words
from compare.results.band import Band, SdFrom
from compare.results.diagnosis import RecordingFault
from compare.results.document import Document
from compare.results.prediction import PredictedRun, Prediction
from compare.results.preview import Preview, RunPreview, SensorPreview
from sample_diagnosis import as_document as as_diagnosis
from sample_diagnosis import sample_diagnosis
from sample_result import rattling


def told(result: Document) -> str:
    """The text that a notebook shows of a result."""
    page = result._repr_html_()
    for tag in ("table", "section", "div", "ul", "details"):
        assert page.count(f"<{tag}") == page.count(f"</{tag}>")
    assert "<nav" not in page  # it would lead nowhere
    return " ".join(html.unescape(re.sub(r"<[^>]*>", " ", page)).split())


def test_a_cross_check_says_why_it_disagrees_what_failed_and_what_was_left_out() -> None:
    result = rattling(turns=(24, 2))
    failed = {"simulator": "dart", "joint_model": "contact", "why": "dart contact driven (rig): no equilibrium"}
    content = result.plain() | {"failures": [failed], "warnings": ["left out: pybullet has no contact joints"]}
    runs = [dict(run) for run in content["runs"]]
    runs[0] |= {"because": {"assumption": "contact", "joint": "B", "words": "the pin swings along the rim"}}
    text = told(type(result).model_validate(content | {"runs": runs}))
    for said in (
        "The pin swings along the rim (",
        "Failed: dart contact driven (rig): no equilibrium",
        "Left out: pybullet has no contact joints",
        "not judged: there are too few revolutions for an interval",
        "largest share of its tolerance",
    ):
        assert said in text
    (worst,) = re.findall(r"exudyn, contact disagrees reaction angle at B \S+ deg (\S+) deg", text)
    assert float(worst) > 0  # the tolerance has its unit


def test_an_accuracy_says_where_and_by_which_pin_and_how_many_linkages_are_good() -> None:
    m = lc.load("crank-rocker").replace(tolerances={"body.coupler.length": {"sd": 1e-4}})
    clearance, limits = {"A": 1e-4, "B": 1e-4}, {"follower_angle": "0.05 deg"}
    result = lc.accuracy(m, clearance=clearance, outputs="follower.angle", limits=limits, samples=100)
    text, output = told(result), result.outputs["follower_angle"]
    k = int(np.nanargmax(np.abs(output.equilibrium)))
    where = f"{np.degrees(output.equilibrium[k]):+.3g} {np.degrees(result.crank_angle[k]):.4g} deg"
    parts = (f"{joint} {np.degrees(output.by_joint[joint][k]):+.3g}" for joint in "AB")
    for said in (where, *parts):
        assert said.replace("-", MINUS) in text
    assert result.flags
    assert f"No equilibrium at {len(result.flags)} of 72 crank angles (the largest is of the others)" in text
    assert re.search(r"% of the linkages are within the limits at every crank angle", text)
    frame = result.to_dataframe()
    np.testing.assert_allclose(frame.error_A + frame.error_B, frame.nominal, atol=1e-12)
    assert result.units() == {"crank_angle": "rad"}


def test_a_plot_of_a_linkage_says_which_reactions_it_is_without() -> None:
    """Seven joints: the ram's guide presses least."""
    pytest.importorskip("matplotlib")
    figure = lc.analyse(loads(begun("quick-return").read_text(encoding="utf-8"))).plot()
    assert figure.get_supxlabel() == "7 of 8 curves, the largest, without reaction force at S"
    assert lc.analyse("crank-rocker").plot().get_supxlabel() == ""


def test_measured_data_count_the_samples_that_there_are() -> None:
    angle, m = np.linspace(0.0, 4 * np.pi, 40), lc.load("crank-rocker")
    read = lc.analyse(m, angles=angle)["follower_angle"] + np.random.default_rng(0).normal(0.0, 1e-4, angle.size)
    read[10:20] = np.nan
    columns = {"time [s]": angle / m.speed, "crank_angle [rad]": angle, "follower_angle [rad]": read}
    page = lc.measured(m, {"some": pandas.DataFrame(columns)})._repr_html_()
    assert "<td>crank_angle</td><td>40</td>" in page
    assert "<td>follower_angle</td><td>30</td>" in page


def test_a_preview_says_what_is_wrong_with_the_data() -> None:
    time = angle = np.array([0.0, 0.1, 0.2])
    fault = RecordingFault(run="slow", signal="time", kind="speed", samples=3, text="the drive is 33 % slower")
    sensor = SensorPreview(
        unit="rad", noise=1e-4, noise_given=True, samples=3, gap=2.0, measured=angle, nominal=angle + 2e-4
    )
    run = RunPreview(
        name="slow", file="slow.csv", drive="speed", role="fit", samples=3, step=0.1, longest_gap=0.0, crank_from=0.0,
        crank_to=0.2, time=time, crank_angle=angle, signals={"crank_angle": sensor},
    )  # fmt: skip
    m = lc.load("crank-rocker")
    text = told(Preview(case="rig", mechanism=m, runs=(run,), faults=(fault,), visible=(), invisible=()))
    assert "Run slow: the drive is 33 % slower" in text
    assert "slow angle of crank 3 0.1 mrad 2 times the noise" in text
    assert "0 effects would show in these runs" in text


def test_a_diagnosis_says_its_odds_what_to_do_next_and_how_it_was_found() -> None:
    result = as_diagnosis(sample_diagnosis(runs=1, samples=37))
    text = told(result)
    steps = [sentence for step in result.steps if step.title != "Result" for sentence in step.text]
    assert len(steps) > 3
    assert words.next_steps(result)
    (group,) = (group for group in words.ties(result) if len(group) > 1)
    for said in (rival_words(result, group, group[1]), "What would separate them", *words.next_steps(result), *steps):
        assert " ".join(said.split()) in text


def predicted(*signals: str) -> Prediction:
    """A run at 600 rpm in which the crank is known to rounding, everything else to 1 %."""
    time, m = np.linspace(0.0, 0.1, 50), lc.load("crank-rocker")
    sd: dict[SdFrom, float] = {"parameters": 0.005, "sets": 0.0, "engines": 0.0, "discrepancy": 0.0}
    bands = {}
    for k, name in enumerate(signals):
        value = (k + 1) * np.cos(60.0 * time)
        half = 1e-15 if name == "crank_angle" else 0.01
        unit = "rad" if name == "crank_angle" else "N"
        bands[name] = Band(unit=unit, value=value, low=value - half, high=value + half, sd=sd, growth=1.0, covered=None)
    run = PredictedRun(name="prediction", speed=20 * np.pi, time=time, crank_angle=60.0 * time, signals=bands)
    return Prediction(
        case="rig", versions={}, diagnosis="ambiguous", effects=(), speeds=(1.0,), runs=(run,), explained=m,
        notes=("the band says nothing there",),
    )  # fmt: skip


def test_a_prediction_says_its_speed_what_to_beware_of_and_no_rounding() -> None:
    text = told(predicted("crank_angle", "reaction_B_x"))
    assert text.startswith('rig at 600 rpm, as foretold by a diagnosis whose verdict is "ambiguous"')
    assert text.endswith("the band says nothing there")
    assert f"crank_angle deg {MINUS}57.2 57.3 0 {DASH}" in text
    assert f"reaction_B_x N {MINUS}2 2 ±0.01 parameters" in text
    assert "covered" not in text


def test_a_predictions_bands_are_seen_and_its_signals_drawn_by_name() -> None:
    names = [f"reaction_{joint}_{axis}" for joint in "DABE" for axis in "xy"]
    figure = predicted(*names).plot()
    assert len(figure.axes) == 12
    assert figure.get_supxlabel() == "6 of 8 signals"
    _, band = predicted(*names).plot("reaction_E_y").axes
    low, high = band.get_ylim()
    assert -20.0 < low < -10.0 < 10.0 < high < 20.0  # mN, beside a signal of 8 N
    with pytest.raises(KeyError, match="reaction_E_z: no such signal; did you mean reaction_E_y or reaction_E_x"):
        predicted(*names).plot("reaction_E_z")
    with pytest.raises(TypeError, match="Diagnosis has no picture of a signal by itself"):
        as_diagnosis(sample_diagnosis(samples=37)).plot("drive_torque")


def test_how_far_each_sensor_of_a_diagnosis_is_off_is_a_frame() -> None:
    result = as_diagnosis(sample_diagnosis(samples=37))
    frame = result.statistics_frame()
    assert len(frame) == sum(len(run.signals) for run in result.runs)
    run, first = result.runs[0], next(iter(result.runs[0].signals.items()))
    assert [*frame.iloc[0]] == [
        run.name,
        first[0],
        first[1].unit,
        first[1].noise,
        first[1].gap_before,
        first[1].gap_after,
    ]


@pytest.mark.slow
@pytest.mark.mujoco
def test_a_search_says_what_it_is_at() -> None:
    rig, said = Path(__file__).parents[1] / "docs" / "example-rig" / "measured.toml", list[str]()
    lc.diagnose(rig, others=False, only=["joint_clearance"], progress=lambda what, done, total: said.append(what))
    searching = said[said.index("search") : said.index("simulation")]
    assert len(set(searching)) > 2
    assert any(what.endswith("of effects fitted, now 1 effect together") for what in searching)

"""Data from memory: what frames say is what files say, in the same sentences."""

from __future__ import annotations

import ast
import dataclasses
import datetime
import math
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas
import pytest

import linkage_crosscheck as lc
from analytic.errors import Error
from analytic.mechanism.file import dumps, load
from compare.diagnose.data.recording import Measured
from compare.results.preview import Preview
from measured_files import RunTable, csv_text, write_measured
from test_check import FOUR_BAR, turning

RIG = Path(__file__).parents[1] / "docs" / "example-rig"
CRANK_ROCKER = load("crank-rocker")
SPEED = CRANK_ROCKER.speed or 0.0


def columns_of(file: Path) -> dict[str, np.ndarray]:
    """A CSV file's columns by heading, in the numbers that Python reads."""
    header, *rows = (line.split(",") for line in file.read_text().splitlines())
    table = np.array([[float(cell or "nan") for cell in row] for row in rows])
    return dict(zip(header, table.T, strict=True))


def rig(frame: Any) -> Measured:
    """The example rig from memory."""
    runs = tomllib.loads((RIG / "measured.toml").read_text())["run"]
    return lc.measured(
        RIG / "nominal.toml",
        {run["name"]: frame(columns_of(RIG / run["file"])) for run in runs},
        speed={"forward": "6 rad/s", "reverse": -12.0, "lifted": np.float64(9.0)},
        drive_angle="0 deg",
        noise=runs[0]["noise"],
        runs={"lifted": {"load": ({"body": "coupler", "point": "com", "force": np.array([0.0, 40.0])},)}},
    )


def turn(samples: int = 73) -> dict[str, np.ndarray]:
    """A turn of the crank-rocker's crank at its speed, and a column that is no signal of it."""
    theta = np.linspace(0.0, 2 * math.pi, samples)
    return {"time [s]": theta / SPEED, "crank_angle [rad]": theta, "drive_torque [N.m]": np.sin(3 * theta)}


def same(one: Measured, other: Measured) -> None:
    """Two recordings are alike to the last bit, but for what their files are called."""
    assert one.mechanism == other.mechanism
    assert one.tolerance == other.tolerance
    for run, again in zip(one.runs, other.runs, strict=True):
        fields = {field.name for field in dataclasses.fields(run)} - {"time", "channels", "file"}
        assert {name: getattr(run, name) for name in fields} == {name: getattr(again, name) for name in fields}
        np.testing.assert_array_equal(run.time, again.time)
        assert list(run.channels) == list(again.channels)
        for name, channel in run.channels.items():
            np.testing.assert_array_equal(channel.values, again.channels[name].values)
            assert (channel.noise, channel.unit) == (again.channels[name].noise, again.channels[name].unit)


@pytest.mark.parametrize("frame", [dict, pandas.DataFrame, lambda c: pandas.DataFrame(c).set_index("time [s]")])
def test_frames_of_the_example_rig_are_its_files(frame: Any) -> None:
    same(rig(frame), lc.read_measured(RIG))


@pytest.mark.slow
@pytest.mark.mujoco
def test_a_diagnosis_from_frames_is_that_from_files() -> None:
    """Every number and sentence, but for how long it took and where the data lay."""
    found = [lc.diagnose(each, others=False).model_dump() for each in (rig(pandas.DataFrame), RIG)]
    assert {name for name in found[0] if without_places(found[0][name]) != without_places(found[1][name])} == set()
    assert [effect["name"] for effect in found[0]["effects"]]


def without_places(given: Any) -> Any:
    """A document without seconds and file names."""
    if isinstance(given, Mapping):
        return {k: without_places(v) for k, v in given.items() if k not in ("file", "seconds", "command", "created")}
    return [without_places(each) for each in given] if isinstance(given, list | tuple) else given


def test_what_a_logger_s_clock_and_an_absent_reading_are_in_a_frame() -> None:
    """Moments are seconds after the first; None and pandas' NA are empty cells."""
    columns = turn()
    start = datetime.datetime(2020, 1, 1, 12, 0)
    clock = [start + datetime.timedelta(microseconds=round(1e6 * each)) for each in columns["time [s]"]]
    torque: list[float | None] = [None, *columns["drive_torque [N.m]"][1:]]
    frames = {
        "none": {"time": clock, "crank_angle [rad]": columns["crank_angle [rad]"], "drive_torque [N.m]": torque},
        "na": pandas.DataFrame(columns).assign(**{"drive_torque [N.m]": pandas.array(torque, dtype="Float64")}),
    }
    found = lc.measured(CRANK_ROCKER, frames, speed=SPEED, drive_angle=0.0)
    for run in found.runs:
        np.testing.assert_allclose(run.time, columns["time [s]"], atol=1e-6)  # the clock's microsecond
        values = run.channels["drive_torque"].values
        assert math.isnan(values[0])
        np.testing.assert_array_equal(values[1:], columns["drive_torque [N.m]"][1:])


@pytest.mark.parametrize("heading", ["time", "time [s]", "time [ms]"])
def test_durations_in_an_index_are_seconds_whatever_its_heading_says(heading: str) -> None:
    columns = turn()
    time = pandas.TimedeltaIndex(pandas.to_timedelta(columns.pop("time [s]"), unit="s"), name=heading)
    run = lc.measured(CRANK_ROCKER, {"a": pandas.DataFrame(columns, index=time)}).runs[0]
    assert run.time[-1] == pytest.approx(2 * math.pi / SPEED, rel=1e-6)


def test_frames_of_results_and_of_measured_data_go_back_in_with_their_units() -> None:
    """``attrs`` hold them, through a choice of columns; what is headed with a unit of its own is read by that."""
    frame = lc.analyse(CRANK_ROCKER).to_dataframe()
    assert {"crank_angle": "rad", "reaction_B_x": "N"}.items() <= frame.attrs["units"].items()
    assert lc.check(frame, CRANK_ROCKER).verdict == "agrees"
    chosen = frame[["crank_angle", "drive_torque"]].assign(**{"time [ms]": 1e3 * frame["crank_angle"] / SPEED})
    found = lc.measured(CRANK_ROCKER, {"a": chosen})
    np.testing.assert_array_equal(found.runs[0].channels["drive_torque"].values, frame["drive_torque"])
    again = lc.measured(CRANK_ROCKER, {"a": found.to_dataframe().drop(columns="run")}).runs[0]
    np.testing.assert_array_equal(again.time, found.runs[0].time)
    np.testing.assert_array_equal(again.channels["drive_torque"].values, frame["drive_torque"])


def test_a_series_over_a_time_that_is_its_index_is_a_frame() -> None:
    columns = turn()
    index = pandas.Index(columns["time [s]"], name="time [s]")
    series = pandas.Series(columns["crank_angle [rad]"], index=index, name="crank_angle [rad]")
    run = lc.measured(CRANK_ROCKER, {"a": series}).runs[0]
    np.testing.assert_array_equal(run.channels["crank_angle"].values, columns["crank_angle [rad]"])


@pytest.mark.parametrize(("argument", "sign", "rate"), [("columns", -1.0, 1.0), ("runs", 1.0, 1.01)])
def test_a_slip_in_a_frame_is_mended_by_the_argument_that_is_said(argument: str, sign: float, rate: float) -> None:
    """A torque of the other sign, and a speed that is 1 % more than the commanded one."""
    rng = np.random.default_rng(5)
    frame = lc.analyse(CRANK_ROCKER, angles=np.linspace(0.0, 4 * np.pi, 181)).to_dataframe()
    noise = {"follower_angle": 1e-5, "coupler_angle": 1e-5, "drive_torque": 1e-4}
    read = pandas.DataFrame({"time [s]": frame["crank_angle"] / SPEED})
    for name, sigma in noise.items():
        read[f"{name} [{frame.attrs['units'][name]}]"] = frame[name] + sigma * rng.normal(size=len(frame))
    read["drive_torque [N.m]"] *= sign

    def preview(**said: Any) -> Preview:
        return lc.preview(lc.measured(CRANK_ROCKER, {"a": read}, drive_angle=0.0, noise=noise, **said))

    (fault,) = preview(speed=rate * SPEED).faults
    name, _, value = fault.text.partition("; say ")[2].partition("; ")[0].partition("=")
    assert name == argument
    assert preview(**{name: ast.literal_eval(value)}, **({"speed": SPEED} if name == "columns" else {})).faults == ()


def faults_of_file(folder: Path, columns: Mapping[str, Any], fields: Mapping[str, Any]) -> str:
    time = np.asarray(columns["time [s]"], float)
    others = {name: np.asarray(each, float) for name, each in columns.items() if name != "time [s]"}
    with pytest.raises(Error) as raised:
        lc.read_measured(write_measured(folder, dumps(CRANK_ROCKER), [RunTable("slow", time, others, fields)]))
    return str(raised.value)


@pytest.mark.parametrize(
    ("change", "fields"),
    [
        ({"drive_torqe [N.m]": np.ones(73)}, {}),
        ({"follower_x [deg]": np.ones(73)}, {}),
        ({"time [s]": np.zeros(73)}, {}),
        ({"drive_torque [N.m]": np.full(73, 1e31)}, {}),
        ({}, {"noise": {"follower_x": 1e-5}}),
        ({}, {"drive_speed": "60 mm"}),
        ({}, {"drive_speed": 3 * SPEED}),
        ({}, {"start": {"crank_angle": 0.0}}),
        ({}, {"drive_sped": 1.0}),
        ({}, {"load": [{"body": "cupler", "point": "com", "force": [0.0, 1.0]}]}),
    ],
)
def test_a_frame_is_refused_in_the_sentence_of_a_file(
    tmp_path: Path, change: Mapping[str, Any], fields: Mapping[str, Any]
) -> None:
    columns, fields = turn() | dict(change), {"drive_speed": SPEED, "drive_angle": 0.0} | dict(fields)
    with pytest.raises(Error) as raised:
        lc.measured(CRANK_ROCKER, {"slow": columns}, runs={"slow": fields})
    words = str(raised.value).replace("measured:", "measured.toml:").replace("frame 'slow'", "slow.csv")
    assert words == in_rows(faults_of_file(tmp_path, columns, fields))


def in_rows(words: str) -> str:
    """A file's sentence with rows, which a frame has, in place of lines, the first of which is the header."""
    words = words.replace("slow.csv: line 1, column", "slow.csv: column").replace("slow.csv: line 1:", "slow.csv:")
    words = words.replace(
        "say [columns] 'drive_torqe [N.m]' = \"ignore\"", "leave the column out"
    )  # a frame has no map
    return re.sub(r"line (\d+)", lambda line: f"row {int(line[1]) - 1}", words)


@pytest.mark.parametrize(
    ("frames", "fields", "sentence"),
    [
        ({"a": {"time [s]": [0.0, 1.0], "crank_angle": [0.0]}}, {}, "frame 'a': its vectors have several lengths"),
        (
            {"a": {"time [s]": [0.0] * 9, "crank_angle [deg]": ["x"] * 9}},
            {},
            "column 2, 'crank_angle', holds <U1 and no",
        ),
        (turn(), {}, "frames: a dict of them cannot be used"),
        (pandas.DataFrame(turn()), {}, "frames: a DataFrame of them cannot be used"),
        ({"a": turn()}, {"speed": {"b": 1.0}}, "speed: 'b' is no run; they are a"),
        ({"a": turn()}, {"speed": 1.0, "drive_speed": 2.0}, "speed: run 'a' has drive_speed = '2.0' too; keep one"),
        ({"a": turn()}, {"runs": {"a": 5}}, "runs['a']: 5 cannot be used"),
        ({"a": turn()}, {"decimal": ","}, "decimal: it says how the text of a file is written"),
        ({"a": turn()}, {"columns": {"phi": "ignore"}}, "columns.'phi' is no heading"),
    ],
)
def test_what_only_memory_can_have_wrong_is_one_sentence(frames: Any, fields: Any, sentence: str) -> None:
    with pytest.raises(Error) as raised:
        lc.measured(CRANK_ROCKER, frames, **fields)
    assert sentence in str(raised.value)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(("name", "meant"), [("speeds", "speed"), ("toleranc", "tolerance"), ("run", "runs")])
def test_a_misspelt_argument_is_told_the_one_that_is_meant(name: str, meant: str) -> None:
    with pytest.raises(TypeError, match=rf"measured\(\) has no argument '{name}'; did you mean '{meant}'\?$"):
        lc.measured(CRANK_ROCKER, {"a": turn()}, **{name: "200 rpm"})


def test_a_column_is_mapped_by_the_name_of_its_signal() -> None:
    columns = turn()
    columns["M [N.mm]"] = 1e3 * columns.pop("drive_torque [N.m]")
    found = lc.measured(CRANK_ROCKER, {"a": columns}, columns={"M": "drive_torque"})
    same(found, lc.measured(CRANK_ROCKER, {"a": columns}, columns={"M": {"signal": "drive_torque", "unit": "N.mm"}}))
    np.testing.assert_allclose(found.runs[0].channels["drive_torque"].values, turn()["drive_torque [N.m]"], atol=1e-15)


def test_a_run_says_for_itself_what_a_keyword_says_of_all() -> None:
    runs = {"own": {"drive": "measured", "noise": {"drive_torque": 0.5}}}
    found = lc.measured(
        CRANK_ROCKER, {"own": turn(), "all": turn()}, runs=runs, drive_speed=SPEED, noise={"drive_torque": 0.25}
    )
    assert [run.drive for run in found.runs] == ["measured", "speed"]
    assert [run.channels["drive_torque"].noise for run in found.runs] == [0.5, 0.25]


def test_a_frame_is_checked_as_its_file(tmp_path: Path) -> None:
    columns = turning()
    others = {heading: values for heading, values in columns.items() if heading != "time [s]"}
    (tmp_path / "program.csv").write_text(csv_text(columns["time [s]"], others, 17))
    file = lc.check(tmp_path / "program.csv", FOUR_BAR)
    for results, name in (({"program": columns}, "program"), (pandas.DataFrame(columns), "results")):
        frame = lc.check(results, FOUR_BAR)
        assert frame.verdict == file.verdict
        (one,), (other,) = frame.runs, file.runs
        assert one.simulator.name == name
        assert [d.max for d in one.discrepancies] == [d.max for d in other.discrepancies]


@pytest.mark.slow
def test_a_plan_of_a_recording_is_of_its_rig() -> None:
    """Its speeds, its sensors and their noise."""
    found = lc.plan(rig(dict), budget=1)
    assert {sensor.signal: sensor.noise for sensor in found.sensors}["drive_torque"] == 4e-3
    assert abs(found.runs[0].speed) in (6.0, 9.0, 12.0)

"""Files as loggers and other programs write them: each reads as the plain file does, or is refused with every fault."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import linkage_crosscheck as lc
from analytic.mechanism.columns import Layout
from analytic.mechanism.file import dumps, load
from compare.diagnose.data.measured import load_measured
from compare.diagnose.data.recording import MeasuredError
from compare.recorded.errors import DataError
from compare.recorded.table import read_table

CRANK_ROCKER = load("crank-rocker")
TIME = np.round(np.arange(40) * 0.005, 6)
ANGLE = np.round(2.0 * TIME, 6)
PLACE = np.round(0.1 * np.sin(3 * TIME), 6)
DEGREES = np.round(np.degrees(ANGLE), 4)
COUNTS = np.round(DEGREES * 4096 / 360).astype(int)


def lines(*columns: np.ndarray, separator: str = ",", decimal: str = ".") -> str:
    cells = [[f"{value:.6f}".replace(".", decimal) for value in row] for row in zip(*columns, strict=True)]
    return "".join(separator.join(row) + "\n" for row in cells)


PLAIN_ROWS = lines(TIME, ANGLE, PLACE)
UNITS_ROW = "s;deg;mm\n"


def mapped(**fields: object) -> Layout:
    return Layout.model_validate(fields)


HABITS: dict[str, tuple[str | bytes, Layout]] = {
    "plain": ("time [s],crank_angle [rad],follower_x [m]\n" + PLAIN_ROWS, mapped()),
    "parentheses and capitals": ("Time (s),Crank Angle (rad),Follower X (m)\n" + PLAIN_ROWS, mapped()),
    "units after an underscore": ("time_s,crank_angle_rad,follower_x_m\n" + PLAIN_ROWS, mapped()),
    "milliseconds": ("time_ms,crank_angle_rad,follower_x_m\n" + lines(1e3 * TIME, ANGLE, PLACE), mapped()),
    "Time (ms), degrees and millimetres": (
        "Time (ms),crank_angle (deg),follower_x (mm)\n" + lines(1e3 * TIME, np.degrees(ANGLE), 1e3 * PLACE),
        mapped(),
    ),
    "decimal commas": (
        "time [s];crank_angle [rad];follower_x [m]\n" + lines(TIME, ANGLE, PLACE, separator=";", decimal=","),
        mapped(),
    ),
    "decimal commas, asked for": (
        "time [s]\tcrank_angle [rad]\tfollower_x [m]\n" + lines(TIME, ANGLE, PLACE, separator="\t", decimal=","),
        mapped(decimal=",", separator="tab"),
    ),
    "a row of units": (
        "time;crank angle;follower x\n" + UNITS_ROW + lines(TIME, np.degrees(ANGLE), 1e3 * PLACE, separator=";"),
        mapped(),
    ),
    "a preamble": (
        "Logger 7, serial 123\nStarted: 12.11.2026\n\ntime [s],crank_angle [rad],follower_x [m]\n" + PLAIN_ROWS,
        mapped(),
    ),
    "a preamble that is counted": (
        "time,1\nx,2\ntime [s],crank_angle [rad],follower_x [m]\n" + PLAIN_ROWS,
        mapped(skip_rows=2),
    ),
    "white space": (
        "time[s]   crank_angle[rad]  follower_x[m]\n" + lines(TIME, ANGLE, PLACE, separator="   "),
        mapped(),
    ),
    "columns in another order, and one that is text": (
        "state,follower_x [m],time [s],crank_angle [rad]\n"
        + "".join(f"ok,{x:.6f},{t:.6f},{a:.6f}\n" for x, t, a in zip(PLACE, TIME, ANGLE, strict=True)),
        mapped(),
    ),
    "lines that end with a separator": (
        "time [s];crank_angle [rad];follower_x [m];\n" + lines(TIME, ANGLE, PLACE, separator=";").replace("\n", ";\n"),
        mapped(),
    ),
    "UTF-16": (("time [s],crank_angle [rad],follower_x [m]\n" + PLAIN_ROWS).encode("utf-16"), mapped()),
    "Windows-1252": (
        (
            "time [s],crank_angle [°],follower_x [m],Temperatur [°C]\n" + lines(TIME, np.degrees(ANGLE), PLACE, ANGLE)
        ).encode("cp1252"),
        mapped(),
    ),
    "names of their own": (
        "t,phi_deg,x,temp\n" + lines(TIME, -np.degrees(ANGLE), 1e3 * PLACE + 5, ANGLE),
        mapped(
            columns={
                "t": {"signal": "time", "unit": "s"},
                "phi_deg": {"signal": "crank_angle", "unit": "deg", "sign": -1},
                "x": {"signal": "follower_x", "unit": "mm", "offset": -5.0},
                "temp": "ignore",
            }
        ),
    ),
}


@pytest.mark.parametrize("habit", HABITS)
def test_a_file_of_this_habit_reads_as_the_plain_one(tmp_path: Path, habit: str) -> None:
    data, layout = HABITS[habit]
    path = tmp_path / "run.csv"
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    found = read_table(path, CRANK_ROCKER, layout)
    np.testing.assert_allclose(found.time, TIME, atol=2e-9)
    np.testing.assert_allclose(found.values["crank_angle"], ANGLE, atol=2e-8)
    np.testing.assert_allclose(found.values["follower_x"], PLACE, atol=2e-9)
    assert set(found.values) == {"crank_angle", "follower_x"}


@pytest.mark.parametrize(
    "meant",
    [
        {"unit": "deg", "scale": 360 / 4096, "offset": 1.0},
        {"unit": "rad", "scale": "0.087890625 deg", "offset": "1 deg"},
        {"scale": "0.087890625deg", "offset": f"{math.pi / 180!r} rad"},
        {"scale": f"{1 / 4096!r} rev", "offset": "60 arcmin"},
    ],
)
def test_counts_of_an_encoder_are_angles(meant: dict[str, object], tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("time [s],enc\n" + lines(TIME, COUNTS.astype(float)))
    meaning = {"signal": "crank_angle", **meant}
    found = read_table(path, CRANK_ROCKER, mapped(columns={"enc": meaning}))
    np.testing.assert_allclose(found.values["crank_angle"], np.radians(COUNTS * 360 / 4096 + 1.0), rtol=1e-12)


@pytest.mark.parametrize(
    ("meant", "said"),
    [
        ({"offset": "90 deg"}, r"phi.*offset = '90 deg' goes with a unit; add that of the column"),
        ({"unit": "deg", "offset": "90 mm"}, "phi.*'mm' does not go with 'deg'; give two of one kind"),
        ({"scale": "1 mm"}, "column 2.*unit 'mm', which is of another dimension; an angle is given in rad"),
        ({"scale": "0 deg"}, "phi.*a scale of 0 leaves nothing"),
        ({"offset": "nine"}, "phi.offset = 'nine': input should be a valid number"),
    ],
)
def test_a_column_whose_numbers_go_with_another_unit_is_refused_by_name(
    meant: dict[str, object], said: str, tmp_path: Path
) -> None:
    table = pd.DataFrame({"time [s]": TIME, "phi": ANGLE})
    with pytest.raises(lc.Error, match=said):
        lc.measured(CRANK_ROCKER, {"run": table}, columns={"phi": {"signal": "crank_angle", **meant}})


def test_what_was_made_of_a_file_is_said(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    text = "made by\ntime [s];crank_angle [rad];oil temp [C]\n" + lines(TIME, ANGLE, PLACE, separator=";", decimal=",")
    path.write_text(text)
    notes = " ".join(read_table(path, CRANK_ROCKER).notes)
    for said in ("first line of it is skipped", "decimal commas", "'oil temp [C]' is no signal of the linkage"):
        assert said in notes


@pytest.mark.parametrize("word", ["", "NaN", "nan", "NA", "n/a", "#N/A", "NULL", "None", "-"])
def test_what_programs_write_where_there_is_nothing_is_absent(tmp_path: Path, word: str) -> None:
    path = tmp_path / "run.csv"
    head, *rows = ("time [s],crank_angle [rad],follower_x [m]\n" + lines(TIME, ANGLE, PLACE)).splitlines()
    rows[3] = ",".join([*rows[3].split(",")[:2], word])
    path.write_text("\n".join([head, *rows]))
    found = read_table(path, CRANK_ROCKER).values["follower_x"]
    assert np.flatnonzero(np.isnan(found)).tolist() == [3]


def test_a_minus_sign_as_typeset_is_one(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("time [s],crank_angle [rad],follower_x [m]\n" + lines(TIME, -ANGLE, PLACE).replace("-", "\u2212"))
    np.testing.assert_allclose(read_table(path, CRANK_ROCKER).values["crank_angle"], -ANGLE, atol=2e-8)


@pytest.mark.parametrize("cell", ["ERROR", "11.9%", "inf", "1.#QNAN", "0x1F"])
def test_a_hundred_cells_of_one_fault_are_one_sentence(tmp_path: Path, cell: str) -> None:
    path = tmp_path / "run.csv"
    head, *rows = ("time [s],crank_angle [rad],follower_x [m]\n" + lines(TIME, ANGLE, PLACE)).splitlines()
    path.write_text("\n".join([head, *(",".join([*row.split(",")[:2], cell]) for row in rows)]))
    with pytest.raises(DataError) as said:
        read_table(path, CRANK_ROCKER)
    (fault,) = said.value.faults
    assert f"line 2, column 'follower_x [m]': {cell!r} is not a finite number" in fault
    assert "lines more, at least)" in fault


def test_a_signal_in_two_columns_names_both(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("time [s],crank_angle [rad],Crank Angle (rad)\n" + lines(TIME, ANGLE, ANGLE))
    with pytest.raises(DataError, match="'crank_angle' is there 2 times, in columns 2, 3; give each signal one"):
        read_table(path, CRANK_ROCKER)


def test_a_misspelt_signal_does_not_vanish(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    for heading, meant in (("drive_torqe [N.m]", "drive_torque"), ("torque [N.m]", "drive_torque")):
        path.write_text(f"time [s],crank_angle [rad],{heading}\n" + PLAIN_ROWS)
        with pytest.raises(DataError, match=f"did you mean '{meant}'"):
            read_table(path, CRANK_ROCKER)


def parquet(path: Path) -> Path:
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    path = path.with_suffix(".parquet")
    pandas.DataFrame({"time [s]": TIME, "crank_angle [rad]": ANGLE, "follower_x [m]": PLACE, "who": "me"}).to_parquet(
        path
    )
    return path


def feather(path: Path) -> Path:
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    path = path.with_suffix(".feather")
    stamps = pandas.Timestamp("2026-11-01T08:00:00") + pandas.to_timedelta(TIME, unit="s")
    pandas.DataFrame({"time": stamps, "crank_angle [rad]": ANGLE, "follower_x [m]": PLACE}).to_feather(path)
    return path


def mat(path: Path) -> Path:
    from scipy.io import savemat

    path = path.with_suffix(".mat")
    savemat(path, {"log": {"time_s": TIME, "crank_angle_rad": ANGLE[:, None], "follower_x_m": PLACE, "note": "hello"}})
    return path


@pytest.mark.parametrize("written", [parquet, feather, mat])
def test_binary_tables_read_like_csv(tmp_path: Path, written: Callable[[Path], Path]) -> None:
    found = read_table(written(tmp_path / "run"), CRANK_ROCKER)
    np.testing.assert_allclose(found.time, TIME, atol=1e-8)
    np.testing.assert_array_equal(found.values["crank_angle"], ANGLE)
    np.testing.assert_array_equal(found.values["follower_x"], PLACE)


@pytest.mark.parametrize("suffix", [".parquet", ".feather", ".mat"])
@pytest.mark.parametrize("content", [b"", b"PAR1", b"time [s],crank_angle [rad]\n0,1\n", bytes(range(256)) * 40])
def test_a_damaged_binary_table_is_one_sentence(tmp_path: Path, suffix: str, content: bytes) -> None:
    path = tmp_path / f"run{suffix}"
    path.write_bytes(content)
    with pytest.raises(DataError) as caught:
        read_table(path, CRANK_ROCKER)
    assert "\n" not in str(caught.value)
    assert f"run{suffix}: cannot be read as a" in str(caught.value)


def measured(folder: Path, top: str, **files: str) -> Path:
    """measured.toml with a run for each file."""
    (folder / "nominal.toml").write_text(dumps(CRANK_ROCKER))
    runs = ""
    for name, text in files.items():
        (folder / f"{name}.csv").write_text(text)
        runs += f'[[run]]\nname = "{name}"\nfile = "{name}.csv"\ndrive = "measured"\n'
    path = folder / "measured.toml"
    path.write_text(f'mechanism = "nominal.toml"\n{top}\n{runs}')
    return path


def test_all_faults_of_all_files_are_told_together(tmp_path: Path) -> None:
    one = "time [s],crank_angel [rad],follower_x\n" + PLAIN_ROWS
    rows = PLAIN_ROWS.splitlines()
    rows[4], rows[8] = "0.02,oops,1", "0.04,1"
    other = "time [s],crank_angle [rad],follower_x [m]\n" + "\n".join(rows)
    with pytest.raises(MeasuredError) as caught:
        load_measured(measured(tmp_path, "", one=one, other=other))
    told = caught.value.faults
    assert len(told) == 4
    for fault, words in zip(
        told,
        [
            ("one.csv: line 1: column 2", "did you mean 'crank_angle'"),
            ("one.csv: line 1: column 3", "no unit"),
            ("other.csv: line 6, column 'crank_angle [rad]'", "'oops'"),
            ("other.csv: line 10 has 2 cells",),
        ],
        strict=True,
    ):
        assert all(word in fault for word in words), fault
    assert str(caught.value).startswith("4 faults: one.csv")


@pytest.mark.parametrize(
    ("top", "says"),
    [
        ("skip_rows = -1", "skip_rows = -1"),
        ("skip_rows = 3000", "skip_rows = 3000, and line 3001 is not there"),
        ('separator = "xx"', "separator = 'xx'"),
        ('decimal = "comma"', "decimal = 'comma'"),
        ('[columns]\n"phi" = { signal = "crank_angle", unit = "deg" }', "columns.'phi' is no heading of a data file"),
        ('[columns]\n"crank_angle [rad]" = { signl = "crank_angle" }', "signl is not a field"),
        ('[columns]\n"crank_angle [rad]" = { signal = "crank_angel" }', "did you mean 'crank_angle'"),
        ('[columns]\n"crank_angle [rad]" = { signal = "crank_angle", scale = 0.0 }', "scale of 0"),
        ('[columns]\n"crank_angle [rad]" = { signal = "crank_angle", sign = 2 }', "sign = 2"),
        ('[columns]\n"crank_angle [rad]" = { signal = "crank_angle", unit = "mm" }', "another dimension"),
        ('[columns]\n"crank_angle [rad]" = "ignored"', "columns"),
        ('[columns]\n"follower_x [m]" = { signal = "crank_angle", unit = "rad" }', "'crank_angle' is there 2 times"),
    ],
)
def test_a_wrong_layout_is_one_sentence(tmp_path: Path, top: str, says: str) -> None:
    text = "time [s],crank_angle [rad],follower_x [m]\n" + PLAIN_ROWS
    with pytest.raises(MeasuredError) as caught:
        load_measured(measured(tmp_path, top, run=text))
    assert "\n" not in str(caught.value)
    assert says in str(caught.value)


def test_a_diagnosis_reads_the_layout(tmp_path: Path) -> None:
    text = "Rig 3\nt;enc;x;temp\n" + lines(TIME, COUNTS.astype(float), 1e3 * PLACE, ANGLE, separator=";", decimal=",")
    top = """separator = ";"
decimal = ","
skip_rows = 1
[columns]
"t" = { signal = "time", unit = "s" }
"enc" = { signal = "crank_angle", unit = "deg", scale = 0.087890625 }
"x" = { signal = "follower_x", unit = "mm" }
"temp" = "ignore"
"""
    (run,) = load_measured(measured(tmp_path, top, run=text)).runs
    np.testing.assert_allclose(run.channels["crank_angle"].values, np.radians(COUNTS * 360 / 4096))
    np.testing.assert_allclose(run.channels["follower_x"].values, PLACE, atol=1e-9)

"""Files of test benches (TDMS, MDF4, HDF5, MAT 7.3, MCAP, spreadsheets): each reads as its CSV file does, or is refused
in a sentence.
"""

from __future__ import annotations

import gc
import os
import sys
import tracemalloc
import warnings
from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
import tomli_w

import linkage_crosscheck as lc
from analytic.mechanism.columns import Layout
from analytic.mechanism.file import load
from bench_files import WRITERS, Columns, add_imu, add_joint_states, hdf5, mcap, mdf, parted, tdms, xlsx
from commands import assert_refused, compare
from compare.recorded.errors import DataError
from compare.recorded.table import Table, read_parts, read_table
from marks import slow_but

ROWS = 40
CRANK_ROCKER, FIVE_BAR = load("crank-rocker"), load("five-bar")
TIME = np.round(np.arange(ROWS) * 0.005, 6)
COLUMNS = {
    "time [s]": TIME,
    "crank_angle [deg]": np.degrees(2.0 * TIME),
    "follower_x [mm]": 100.0 * np.sin(3 * TIME),
}
JOINTS = {"time [s]": TIME, "position_D [rad]": 2.0 + 3 * TIME, "position_E [rad]": 1.0 - 2 * TIME}
FOLDER = os.environ.get("MEASURED_DATA", "")
REAL = pytest.mark.skipif(not FOLDER, reason="MEASURED_DATA is not set: the folder with adams-fourbar, emps, pendulum")
KINDS = tuple(WRITERS)
SUFFIXES = (*KINDS, "mcap")


def write(path: Path, columns: Columns) -> Path:
    """A file of the kind that its name ends with."""
    if path.suffix == ".mcap":
        mcap(path, columns)
    else:
        WRITERS[path.suffix[1:]](path, columns)
    return path


def check_same(found: Table, time: np.ndarray) -> None:
    np.testing.assert_allclose(found.time, time, atol=1e-9)
    np.testing.assert_allclose(found.values["crank_angle"], 2.0 * time, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(found.values["follower_x"], 0.1 * np.sin(3 * time), rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("kind", KINDS)
def test_a_file_of_this_kind_reads_with_its_units(tmp_path: Path, kind: str) -> None:
    found = read_table(write(tmp_path / f"run.{kind}", COLUMNS), CRANK_ROCKER)
    check_same(found, TIME)
    assert {column.unit for column in found.columns} == {"deg", "mm"}


def test_joint_states_of_ros_are_in_whatever_si_unit_their_signals_have(tmp_path: Path) -> None:
    found = read_table(write(tmp_path / "run.mcap", JOINTS), FIVE_BAR)
    np.testing.assert_allclose(found.time, TIME, atol=1e-9)
    for joint in "DE":
        np.testing.assert_array_equal(found.values[f"position_{joint}"], JOINTS[f"position_{joint} [rad]"])


def test_an_imu_of_ros_has_units_and_is_a_topic_of_its_own(tmp_path: Path) -> None:
    from mcap_ros2.writer import Writer

    path, omega = tmp_path / "run.mcap", 2.0 + np.sin(TIME)
    with path.open("wb") as stream, Writer(stream) as bag:
        add_joint_states(bag, JOINTS, "/joint_states")
        add_imu(bag, TIME, omega)
    with pytest.raises(DataError, match=r"'/joint_states' \(3 columns, 40 rows\), '/imu' .* such as 'run.mcap#/joint"):
        read_table(path, FIVE_BAR)
    columns: dict[str, object] = {f"linear_acceleration.{axis}": "ignore" for axis in "xyz"}
    columns["angular_velocity.z"] = {"signal": "left-arm_angular_velocity"}
    found = read_table(Path(f"{path}#imu"), FIVE_BAR, Layout.model_validate({"columns": columns}))
    np.testing.assert_array_equal(found.values["left-arm_angular_velocity"], omega)


def test_waveforms_of_tdms_have_a_clock_of_their_increment(tmp_path: Path) -> None:
    import nptdms

    path, timing = tmp_path / "run.tdms", {"wf_increment": 0.005, "wf_start_offset": 0.0, "wf_samples": ROWS}
    with nptdms.TdmsWriter(path) as file:
        for heading in ("crank_angle [deg]", "follower_x [mm]"):
            name, unit = parted(heading)
            channel = nptdms.ChannelObject("run", name, COLUMNS[heading], {"unit_string": unit, **timing})
            file.write_segment([channel])
    check_same(read_table(path, CRANK_ROCKER), TIME)


def test_a_sheet_may_have_a_preamble_units_below_and_moments_in_time(tmp_path: Path) -> None:
    import openpyxl

    book = openpyxl.Workbook()
    page = book.active
    page.append(["Rig 7", "measured"])
    page.append([])
    page.append(["time", "crank_angle [deg]", "follower_x [mm]"])
    first = datetime(2026, 3, 1, 12)
    for at, *values in zip(*COLUMNS.values(), strict=True):
        page.append([first + timedelta(seconds=float(at)), *map(float, values)])
    book.save(tmp_path / "run.xlsx")
    found = read_table(tmp_path / "run.xlsx", CRANK_ROCKER)
    np.testing.assert_allclose(found.time, TIME, atol=1e-6)


@pytest.mark.parametrize("way", ["records", "a matrix with columns", "a matrix"])
def test_a_table_of_hdf5_is_read(tmp_path: Path, way: str) -> None:
    import h5py

    path, names = tmp_path / "run.h5", [heading.replace(" [", "_").rstrip("]") for heading in COLUMNS]
    matrix = np.column_stack(list(COLUMNS.values()))
    with h5py.File(path, "w") as file:
        if way == "records":
            file["data"] = np.rec.fromarrays(matrix.T, names=names)
        else:
            file["data"] = matrix
            file["data"].attrs.update({"columns": names} if way == "a matrix with columns" else {})
    signals = {"data_1": "time", "data_2": "crank_angle", "data_3": "follower_x"}
    columns = {h: {"signal": s, "unit": u} for (h, s), u in zip(signals.items(), ("s", "deg", "mm"), strict=True)}
    layout = Layout.model_validate({"columns": columns if way == "a matrix" else {}})
    check_same(read_table(path, CRANK_ROCKER, layout), TIME)


@pytest.mark.parametrize("kind", ["tdms", "h5", "xlsx"])
def test_several_tables_are_named_with_how_to_pick_one(tmp_path: Path, kind: str) -> None:
    path = tmp_path / f"log.{kind}"
    slow = {heading: values[::2] for heading, values in COLUMNS.items()}
    if kind == "xlsx":
        import openpyxl

        xlsx(path, COLUMNS, "fast")
        book = openpyxl.load_workbook(path)
        page = book.create_sheet("slow")
        page.append(list(slow))
        for row in zip(*slow.values(), strict=True):
            page.append([float(each) for each in row])
        book.save(path)
    elif kind == "tdms":
        import nptdms

        with nptdms.TdmsWriter(path) as file:
            for group, columns in (("fast", COLUMNS), ("slow", slow)):
                file.write_segment(
                    [
                        nptdms.ChannelObject(group, parted(h)[0], v, {"unit_string": parted(h)[1]})
                        for h, v in columns.items()
                    ]
                )
    else:
        import h5py

        with h5py.File(path, "w") as file:
            for group, columns in (("fast", COLUMNS), ("slow", slow)):
                for heading, values in columns.items():
                    file[f"{group}/{heading}"] = values
    with pytest.raises(
        DataError, match=r"log\.\w+: there are .*fast.*slow.*say which in its path, such as 'log\."
    ) as no:
        read_table(path, CRANK_ROCKER)
    assert len(no.value.faults) == 1
    check_same(read_table(Path(f"{path}#slow"), CRANK_ROCKER), TIME[::2])
    check_same(read_table(Path(f"{path}#2"), CRANK_ROCKER), TIME[::2])
    with pytest.raises(DataError, match=r"'quick' is no (group|sheet) of it; there are"):
        read_table(Path(f"{path}#quick"), CRANK_ROCKER)


def test_a_path_may_have_a_number_sign_of_its_own(tmp_path: Path) -> None:
    check_same(read_table(write(tmp_path / "rig #7.h5", COLUMNS), CRANK_ROCKER), TIME)


def a_turn() -> dict[str, np.ndarray]:
    """A turn of the crank at its speed."""
    said = lc.analyse(CRANK_ROCKER).to_dataframe()
    angle, follower = (said[name].to_numpy(float) for name in ("crank_angle", "follower_angle"))
    return {"time [s]": angle / CRANK_ROCKER.speed, "crank_angle [rad]": angle, "follower_angle [rad]": follower}


@pytest.mark.parametrize("kind", slow_but(("h5", "mcap"), SUFFIXES))
def test_check_and_init_take_a_file_of_this_kind(tmp_path: Path, kind: str) -> None:
    case = "five-bar" if kind == "mcap" else "crank-rocker"
    write(tmp_path / f"run.{kind}", JOINTS if kind == "mcap" else a_turn())
    begun = compare("diagnose", "--init", f"run.{kind}", "--case", case, cwd=tmp_path)
    assert begun.returncode == 0, begun.stderr
    text = (tmp_path / "measured.toml").read_text()
    assert f'file = "run.{kind}"' in text
    if kind == "mcap":  # two encoders alone, which a check has nothing to hold against
        return
    checked = compare("check", f"run.{kind}", "--case", case, "--out", "out", "--quiet", cwd=tmp_path)
    assert checked.returncode == 0, checked.stdout + checked.stderr


def test_only_what_is_wanted_is_read(tmp_path: Path) -> None:
    """Of 4 MB of numbers 0.24 MB are wanted, of which a few copies are made."""
    import h5py

    rows, path = 10_000, tmp_path / "log.h5"
    time = np.arange(rows) * 1e-3
    with h5py.File(path, "w") as file:
        for heading, values in (("time [s]", time), ("crank_angle [rad]", time), ("follower_x [m]", np.sin(time))):
            file[f"run/{heading}"] = values
        for k in range(47):
            file[f"run/noise {k}"] = time
    tracemalloc.start()
    read_table(path, CRANK_ROCKER)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2.5e6


def test_a_file_of_too_many_numbers_is_refused_before_it_is_read(tmp_path: Path) -> None:
    import h5py

    with h5py.File(tmp_path / "log.h5", "w") as file:
        for heading in COLUMNS:
            file.create_dataset(f"run/{heading}", shape=(10_000_000,), chunks=True, dtype=float)
    with pytest.raises(DataError, match="keep one row in 3"):
        read_table(tmp_path / "log.h5", CRANK_ROCKER)


PACKAGES = {"tdms": "nptdms", "mf4": "asammdf", "h5": "h5py", "mat": "h5py", "xlsx": "python_calamine", "mcap": "mcap"}


@pytest.mark.parametrize("kind", SUFFIXES)
def test_a_missing_package_is_a_sentence_with_what_to_run(
    tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write(tmp_path / f"run.{kind}", JOINTS)
    monkeypatch.setitem(sys.modules, PACKAGES[kind], None)
    extra = {"mf4": "mdf", "h5": "hdf5", "mat": "hdf5"}.get(kind, kind)
    with pytest.raises(DataError, match=rf"pip install 'linkage-crosscheck\[{extra}\]'"):
        read_table(path, FIVE_BAR)


# ---------------------------------------------------------------- damaged files

Damage = Callable[[bytes], bytes]
DAMAGED: dict[str, Damage] = {
    "empty": lambda data: b"",
    "twenty bytes": lambda data: data[:20],
    "a third": lambda data: data[: len(data) // 3],
    "zeros in its first half": lambda data: bytes(len(data) // 2) + data[len(data) // 2 :],
    "flipped bits": lambda data: bytes(255 - each for each in data),
    "text": lambda data: b"time [s],crank_angle [deg]\n0,1\n",
    "without its first byte": lambda data: data[1:],
}


def without(heading: str) -> Columns:
    return {each: values for each, values in COLUMNS.items() if each != heading}


WRONG: dict[str, tuple[Columns, str]] = {
    "no time": (without("time [s]"), "time"),
    "no signal": (
        {"time [s]": TIME, "oil [K]": TIME, "room [K]": TIME},
        "is a signal of 'crank-rocker'|has no column",
    ),
    "a unit of something else": ({**without("follower_x [mm]"), "follower_x [kN]": TIME}, "of another dimension"),
    "an unknown unit": ({**without("follower_x [mm]"), "follower_x [flurb]": TIME}, "flurb|did you mean"),
    "a name that is near one": ({**without("follower_x [mm]"), "folower_x [mm]": TIME}, "did you mean"),
    "too few rows": ({heading: values[:5] for heading, values in COLUMNS.items()}, "at least 8 are needed"),
    "a clock that runs back": ({**COLUMNS, "time [s]": TIME[::-1]}, "time runs back"),
    "a clock that stays": ({**COLUMNS, "time [s]": np.repeat(TIME[::2], 2)}, "has the time of the row before"),
    "no finite number": ({**COLUMNS, "follower_x [mm]": np.where(TIME > 0.1, np.inf, 1.0)}, "not a finite number|inf"),
    "a reading that is none": ({**COLUMNS, "follower_x [mm]": np.full(ROWS, 1e300)}, "is no reading"),
    "one signal twice": ({**COLUMNS, "follower-x [mm]": TIME}, "is there 2 times"),
}


# a clock in each group; no infinite cell; no units
CANNOT_BE = {("mf4", "no time"), ("xlsx", "no finite number"), ("mat", "an unknown unit")}


@pytest.mark.parametrize("damage", DAMAGED)
@pytest.mark.parametrize("kind", SUFFIXES)
def test_a_damaged_file_is_a_sentence(tmp_path: Path, kind: str, damage: str) -> None:
    path = write(tmp_path / f"run.{kind}", JOINTS if kind == "mcap" else COLUMNS)
    path.write_bytes(DAMAGED[damage](path.read_bytes()))
    check_refused(path, f"run.{kind}: ", FIVE_BAR if kind == "mcap" else CRANK_ROCKER)
    if kind == "mf4":  # asammdf leaves files of its own open where it fails
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ResourceWarning)
            gc.collect()


@pytest.mark.parametrize("wrong", WRONG)
@pytest.mark.parametrize("kind", KINDS)
def test_a_file_that_says_what_cannot_be_is_a_sentence(tmp_path: Path, kind: str, wrong: str) -> None:
    columns, words = WRONG[wrong]
    if (kind, wrong) in CANNOT_BE:
        pytest.skip(f"no {kind} file has that")
    path = write(tmp_path / f"run.{kind}", columns)
    check_refused(path, rf"(?s)^(\d+ faults: )?run.{kind}: .*({words})")


def check_refused(path: Path, words: str, mechanism: lc.Mechanism = CRANK_ROCKER) -> None:
    with pytest.raises(DataError, match=words) as refused:
        read_table(path, mechanism)
    assert len(refused.value.faults) == 1
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 500


@pytest.mark.parametrize("kind", ["tdms", "h5", "mat"])
def test_columns_of_several_lengths_are_a_sentence(tmp_path: Path, kind: str) -> None:
    path = write(tmp_path / f"run.{kind}", {**COLUMNS, "follower_x [mm]": TIME[:30]})
    check_refused(path, "its vectors have several lengths")


@pytest.mark.parametrize("kind", ["tdms", "h5", "xlsx"])
def test_text_in_place_of_numbers_is_a_sentence(tmp_path: Path, kind: str) -> None:
    path = write(tmp_path / f"run.{kind}", {**COLUMNS, "follower_x [mm]": ["on"] * ROWS})
    check_refused(path, "numbers|is not a finite number")


def test_files_without_a_table_are_a_sentence(tmp_path: Path) -> None:
    import h5py
    import nptdms
    import openpyxl
    from mcap_ros2.writer import Writer

    with h5py.File(tmp_path / "run.h5", "w") as file:
        file.create_group("run")
    with nptdms.TdmsWriter(tmp_path / "run.tdms") as file:
        file.write_segment([nptdms.RootObject({"rig": "7"})])
    openpyxl.Workbook().save(tmp_path / "run.xlsx")
    with (tmp_path / "run.mcap").open("wb") as stream, Writer(stream):
        pass
    for kind in ("h5", "tdms", "xlsx", "mcap"):
        check_refused(tmp_path / f"run.{kind}", "has no (group|sheet|topic) with numbers in it")


def test_a_name_that_is_there_twice_in_mdf_is_a_sentence(tmp_path: Path) -> None:
    import asammdf

    with asammdf.MDF(version="4.10") as file:
        file.append([asammdf.Signal(TIME, TIME, unit="deg", name="crank_angle") for _ in range(2)])
        file.save(tmp_path / "run.mf4")
    check_refused(tmp_path / "run.mf4", r"group 1 has 'crank_angle \[deg\]' twice")


def test_a_table_of_a_kind_that_has_one_is_not_picked(tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_text("time [s],crank_angle [rad],follower_x [m]\n")
    check_refused(tmp_path / "run.csv#sheet", "run.csv: has one table, and 'sheet' is asked for")


def test_a_damaged_file_ends_a_command_with_status_2(tmp_path: Path) -> None:
    (tmp_path / "run.h5").write_bytes(b"\x89HDF\r\n")
    ended = compare("check", "run.h5", "--case", "crank-rocker", cwd=tmp_path)
    assert ended.returncode == 2
    assert ended.stderr.startswith("compare: run.h5: cannot be read as an HDF5 file (")
    assert ended.stderr.count("\n") == 1


# ---------------------------------------------------------------- clocks that start again, files without a header


def test_a_last_row_that_repeats_the_one_before_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    hdf5(path, {heading: np.append(values, values[-1]) for heading, values in COLUMNS.items()})
    found = read_table(path, CRANK_ROCKER)
    check_same(found, TIME)
    assert found.notes == ("run.h5: row 41 repeats the one before it, and is left out",)


def twice() -> Columns:
    return {heading: np.concatenate([values, values[:20], values[:3]]) for heading, values in COLUMNS.items()}


def test_a_clock_that_starts_again_is_split_where_that_is_asked(tmp_path: Path) -> None:
    path = write(tmp_path / "run.tdms", twice())
    with pytest.raises(DataError, match=r"row 41: time runs back .* or have it split \(`split`\)"):
        read_table(path, CRANK_ROCKER)
    first, second = read_parts(path, CRANK_ROCKER, split=True)
    check_same(first, TIME)
    check_same(second, TIME[:20])
    assert first.notes[-2:] == (
        "run.tdms: its clock starts again after 3 rows, which are left out",
        "run.tdms: its clock starts again; it is split into 2 parts, from row 1, 41",
    )
    check_same(read_table(path, CRANK_ROCKER, part=2), TIME[:20])
    with pytest.raises(DataError, match=r"part = 3, and its clock starts 2 times; give 1 to 2"):
        read_table(path, CRANK_ROCKER, part=3)


def test_init_and_check_split_a_clock_that_starts_again(tmp_path: Path) -> None:
    columns = a_turn()
    write(tmp_path / "log.h5", {heading: np.tile(values, 2) for heading, values in columns.items()})
    refused = compare("check", "log.h5", "--case", "crank-rocker", cwd=tmp_path)
    assert_refused(refused, "or have it split (--split)")
    begun = compare("diagnose", "--init", "log.h5", "--case", "crank-rocker", "--split", cwd=tmp_path)
    assert begun.returncode == 0, begun.stderr
    data = lc.read_measured(tmp_path / "measured.toml")
    assert [run.name for run in data.runs] == ["log-1", "log-2"]
    np.testing.assert_allclose(data.runs[1].time, columns["time [s]"])
    checked = lc.check(tmp_path / "log.h5", "crank-rocker", split=True)
    assert [run.simulator.name for run in checked.runs] == ["log part 1", "log part 2"]
    assert checked.verdict == "agrees"
    with pytest.raises(lc.Error, match="split"):
        lc.check(data, split=True)


def test_a_file_without_a_header_is_given_its_headings(tmp_path: Path) -> None:
    rows = "".join(",".join(f"{each:.9g}" for each in row) + "\n" for row in zip(*COLUMNS.values(), strict=True))
    (tmp_path / "run.csv").write_text(rows)
    with pytest.raises(DataError, match="--columns"):
        read_table(tmp_path / "run.csv", CRANK_ROCKER)
    found = read_table(tmp_path / "run.csv", CRANK_ROCKER, Layout.with_headings(list(COLUMNS)))
    np.testing.assert_allclose(found.values["crank_angle"], 2.0 * TIME, rtol=1e-7)
    ended = compare(
        "diagnose", "--init", "run.csv", "--case", "crank-rocker", "--columns", ",".join(COLUMNS), cwd=tmp_path
    )
    assert ended.returncode == 0, ended.stderr
    np.testing.assert_allclose(lc.read_measured(tmp_path / "measured.toml").runs[0].time, TIME)
    np.savetxt(tmp_path / "turn.csv", np.column_stack(list(a_turn().values())), "%.12g", ",")
    assert lc.check(tmp_path / "turn.csv", "crank-rocker", columns=list(a_turn())).verdict == "agrees"
    with pytest.raises(DataError, match="line 1 has 3 cells, and 2 headings are given for them"):
        read_table(tmp_path / "run.csv", CRANK_ROCKER, Layout.with_headings(["time [s]", "crank_angle [deg]"]))


# ---------------------------------------------------------------- real rigs


def rig(name: str) -> tuple[Path, dict[str, np.ndarray]]:
    """The folder of a rig, and the columns of its run."""
    folder = Path(FOLDER) / name
    with (folder / "run.csv").open(encoding="utf-8") as file:
        headings = file.readline().strip().split(",")
        return folder, dict(zip(headings, np.loadtxt(file, delimiter=",").T, strict=True))


@pytest.mark.long_rows("MDF4")
@REAL
@pytest.mark.parametrize("write_as", [tdms, mdf], ids=["TDMS", "MDF4"])
def test_a_four_bar_of_adams_has_the_same_verdict_from_a_file_of_a_bench(
    tmp_path: Path, write_as: Callable[[Path, Columns], None]
) -> None:
    folder, columns = rig("adams-fourbar")
    path = tmp_path / {tdms: "run.tdms", mdf: "run.mf4"}[write_as]
    write_as(path, columns)
    ours, theirs = (lc.check(each, folder / "nominal.toml") for each in (folder / "run.csv", path))
    assert theirs.verdict == ours.verdict
    for one, other in zip(ours.runs[0].discrepancies, theirs.runs[0].discrepancies, strict=True):
        assert one.signal == other.signal
        assert other.max == pytest.approx(one.max, rel=1e-6, abs=1e-12)


@pytest.mark.long_rows("xlsx")
@REAL
@pytest.mark.parametrize("write_as", [hdf5, xlsx], ids=["HDF5", "xlsx"])
def test_a_positioning_axis_has_the_same_columns_from_a_file_of_a_bench(
    tmp_path: Path, write_as: Callable[[Path, Columns], None]
) -> None:
    folder, columns = rig("emps")
    path = tmp_path / {hdf5: "run.h5", xlsx: "run.xlsx"}[write_as]
    write_as(path, columns)
    text = {
        "mechanism": str(folder / "nominal.toml"),
        "run": [{"name": "steps", "file": path.name, "drive": "measured"}],
    }
    (tmp_path / "measured.toml").write_text(tomli_w.dumps(text))
    ours, theirs = (lc.read_measured(each / "measured.toml").runs[0] for each in (folder, tmp_path))
    np.testing.assert_array_equal(theirs.time, ours.time)
    assert set(theirs.channels) == set(ours.channels)
    for name, channel in ours.channels.items():
        np.testing.assert_array_equal(theirs.channels[name].values, channel.values)
        assert theirs.channels[name].noise == channel.noise

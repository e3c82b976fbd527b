"""Measured data that cannot be used: one sentence with the place, the value and the remedy, and never a traceback."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from analytic.mechanism.file import dumps, load
from compare.diagnose.data import measured
from compare.diagnose.data.measured import load_measured
from compare.diagnose.data.recording import MeasuredError
from compare.recorded import text as reading
from measured_files import RunTable, write_measured

CRANK_ROCKER = load("crank-rocker")
SPEED = CRANK_ROCKER.speed or 0.0
TEXT = dumps(CRANK_ROCKER)
TIME = np.arange(40) * 0.005
ANGLE = SPEED * TIME
GOOD = "time [s],crank_angle [rad],follower_x [m]\n" + "".join(
    f"{t:g},{a:.9g},{np.sin(3 * t):.9g}\n" for t, a in zip(TIME, ANGLE, strict=True)
)


def refused(path: Path) -> str:
    """The message; it is one line and names what it is about."""
    with pytest.raises(MeasuredError) as caught:
        load_measured(path)
    message = str(caught.value)
    assert "\n" not in message
    assert "Traceback" not in message
    return message


def rig(folder: Path, data: str | bytes = GOOD, **fields: object) -> Path:
    """measured.toml with one run of this data file."""
    entry = {"drive_speed": SPEED, "drive_angle": 0.0, **fields}
    path = write_measured(
        folder,
        TEXT,
        [RunTable("slow", TIME, {"crank_angle [rad]": ANGLE}, {k: v for k, v in entry.items() if v is not None})],
    )
    (folder / "slow.csv").write_bytes(data.encode() if isinstance(data, str) else data)
    return path


def edited(line: int, text: str) -> str:
    """The good file with one line (1 is the header) replaced."""
    lines = GOOD.splitlines()
    lines[line - 1] = text
    return "\n".join(lines) + "\n"


def test_the_good_file_is_good(tmp_path: Path) -> None:
    assert load_measured(rig(tmp_path)).faults == ()


@pytest.mark.parametrize(
    ("header", "says"),
    [
        ("time [s],crank_angle,follower_x [m]", ["line 1", "column 2", "crank_angle", "no unit", "deg"]),
        ("time [s],crank_angle [],follower_x [m]", ["column 2", "no unit"]),
        ("time [s],crank_angle [mm],follower_x [m]", ["column 2", "'mm'", "another dimension", "deg"]),
        ("time [s],crank_angle [degs/],follower_x [m]", ["column 2", "'degs/'", "cannot be read"]),
        ("time [s],crank_angle [parrots],follower_x [m]", ["column 2", "'parrots', which is unknown"]),
        ("time [Hz],crank_angle [rad],follower_x [m]", ["column 1", "time", "'Hz'", "ms"]),
        ("time [s],crank_angel [rad],follower_x [m]", ["column 2", "'crank_angel'", "did you mean 'crank_angle'"]),
        ("time [s],torque [N.m],follower_x [m]", ["column 2", "'torque'", "did you mean 'drive_torque'", '"ignore"']),
        ("time [s],quux [rad],temp [C]", ["line 1", "is it the header?", "drive_torque"]),
        ("time [s],crank_angle [rad],crank_angle [deg]", ["'crank_angle' is there 2 times"]),
        ("clock [s],crank_angle [rad],follower_x [m]", ["no column of time among 'clock [s]', 'crank_angle [rad]'"]),
        ("time [s]", ["is it the header?"]),
        ("time [s],,follower_x [m]", ["column 2", "''", "signal [unit]"]),
        ("time [s],crank [rad] angle,follower_x [m]", ["column 2", "signal [unit]"]),
        ("0,0.1,0.2", ["line 1", "numbers where the header should be"]),
    ],
)
def test_headers(tmp_path: Path, header: str, says: list[str]) -> None:
    message = refused(rig(tmp_path, edited(1, header)))
    assert "slow.csv" in message
    for word in says:
        assert word in message


@pytest.mark.parametrize(
    ("line", "text", "says"),
    [
        (5, "0.015,oops,1", ["line 5", "crank_angle [rad]", "'oops'", "leave the cell empty"]),
        (5, "0.015,inf,1", ["line 5", "crank_angle [rad]", "'inf'"]),
        (5, "0.015,0.4,-1e999", ["line 5", "follower_x [m]", "'-1e999'"]),
        (5, "0.015,1_000,1", ["line 5", "'1_000'"]),
        (5, "0.015,0.4", ["line 5", "2 cells", "header 3"]),
        (5, "0.015,0.4,1,2", ["line 5", "4 cells", "header 3"]),
        (5, "0,015,0,4,1,5", ["line 5", "6 cells", "decimal point"]),
        (5, ",0.4,1", ["line 5", "no time"]),
        (5, "nan,0.4,1", ["line 5", "no time"]),
        (5, "inf,0.4,1", ["line 5", "time [s]", "'inf'"]),
        (5, "0.01,0.4,1", ["line 5", "row before", "0.01 s"]),
        (5, "0.001,0.4,1", ["line 5", "time runs back from 0.01 s to 0.001 s"]),
        (41, "-1,0.4,1", ["line 41", "runs back"]),
        (41, "0.195;0.4;1", ["line 41", "1 cell and", "header 3"]),
        (41, '0.195,"0.4,1', ["line 41", "2 cells"]),
    ],
)
def test_rows(tmp_path: Path, line: int, text: str, says: list[str]) -> None:
    message = refused(rig(tmp_path, edited(line, text)))
    for word in ["slow.csv", *says]:
        assert word in message


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("line", "text", "says"),
    [
        (5, "0.015,0.4,1e300", ["line 5", "follower_x [m]", "1e+300 is no reading"]),
        (5, "0.015,-1e308,1", ["line 5", "crank_angle [rad]", "-1e+308 is no reading"]),
        (41, "1e300,0.4,1", ["line 41", "time [s]", "1e+300 is no reading"]),
        (3, "1e-320,0.4,1", ["line 3", "1e-320 s after the row before", "unit of time"]),
        (5, f"0.015,{'9' * 5001},1", ["line 5", "crank_angle [rad]", "999...", "is not a finite number"]),
        (1, f"time [s],crank_angle [rad],follower_x [{'(' * 5000}m]", ["column 3", "((...", "cannot be read"]),
        (1, "time [s],crank_angle [rad],follower_x [nan]", ["column 3", "'nan', which is unknown"]),
        (1, "time [s],crank_angle [rad],follower_x [dB]", ["column 3", "'dB'", "another dimension"]),
        (1, f"time [s],{'x' * 9000} [m],{'y' * 9000} [m]", ["is it the header?", "which they are, such as "]),
    ],
)
def test_what_no_bench_has_is_refused_shortly_and_not_reckoned_with(
    tmp_path: Path, line: int, text: str, says: list[str]
) -> None:
    message = refused(rig(tmp_path, edited(line, text)))
    assert len(message) < 800
    for word in ["slow.csv", *says]:
        assert word in message


HEAD, RUN = 'mechanism = "nominal.toml"\n', '[[run]]\nname = "slow"\nfile = "slow.csv"\n'
NINES = "9" * 5001


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (f"a = {'[' * 5000}{']' * 5000}", "too deep"),
        (f"{HEAD}tolerance = {'[' * 50000}{']' * 50000}\n{RUN}", "too deep"),
        (f"a = {'{a=' * 3000}1{'}' * 3000}", "too deep"),
        (f"{HEAD}{RUN}drive_speed = {NINES}", "too many digits"),
        (f"mechanism = {NINES}", "too many digits"),
        (f"{HEAD}tolerance = {{ mass = 0x{'f' * 5001} }}\n{RUN}", "too many digits"),
        (f"{HEAD}{RUN}drive_speed = {'9' * 4000}", "run[slow].drive_speed"),
        (f"{HEAD}{RUN}drive_speed = 1e300", "run[slow].drive_speed"),
        (f"{HEAD}{RUN}drive_speed = nan", "run[slow].drive_speed"),
        (f"{HEAD}{RUN}drive = 'free'\nstart = {{ crank_angle = 1e300 }}", "start.crank_angle"),
        (f"{HEAD}{RUN}drive_speed = 3.0\nnoise = {{ follower_x = 1e300 }}", "noise.follower_x"),
        (f"{HEAD}{RUN}drive_speed = 3.0\nload = [{{ body = 'coupler', force = [1e308, 0.0] }}]", "force[0] = 1e+308"),
        (f"mechanism = '{'a' * 900}'\n{RUN}", "cannot be read"),
        (f"mechanism = '{'a' * 5000}'\n{RUN}", "mechanism"),
        (f'mechanism = "a\\u0000b"\n{RUN}', "mechanism"),
        (f'{HEAD}[[run]]\nname = "slow"\nfile = "slow\\u0000.csv"', "file"),
        (f'{HEAD}[[run]]\nname = "\\u001b[31mred"\nfile = "slow.csv"', "name"),
        (f'{HEAD}[[run]]\nname = "{"a" * 100000}"\nfile = "slow.csv"', "at most 200 characters"),
        ("", "mechanism is missing"),
        ("\x00", "cannot be read as TOML"),
    ],
)
def test_a_measured_toml_that_nobody_wrote_by_hand(tmp_path: Path, text: str, says: str) -> None:
    path = rig(tmp_path)
    path.write_text(text)
    message = refused(path)
    assert "measured.toml" in message
    assert says in message
    assert message.isprintable()
    assert len(message) < 1200


@pytest.mark.parametrize("data", [GOOD.encode("utf-16"), bytes(range(256)) * 20, "mechanism = 'ä'".encode("latin-1")])
def test_a_measured_toml_that_is_no_text(tmp_path: Path, data: bytes) -> None:
    path = rig(tmp_path)
    path.write_bytes(data)
    assert "UTF-8" in refused(path)


def test_rows_without_the_encoder_that_a_run_follows_are_left_out_and_said(tmp_path: Path) -> None:
    """Where the drive was then is nobody's to guess; a sensor that is read more often than the encoder is kept."""
    fields = {"drive": "measured"}
    columns = {"crank_angle [rad]": ANGLE.copy(), "follower_x [m]": np.sin(3 * TIME)}
    columns["crank_angle [rad]"][[0, 1, 2, *range(15, 25), 38, 39]] = np.nan
    found = load_measured(write_measured(tmp_path, TEXT, [RunTable("a", TIME, columns, fields)]))
    assert found.runs[0].time.tolist() == pytest.approx([t for k, t in enumerate(TIME) if 3 <= k < 15 or 25 <= k < 38])
    (fault,) = [f for f in found.faults if f.kind == "absent"]
    assert (fault.signal, fault.samples) == ("crank_angle", 15)
    assert "follows crank_angle, which is absent for a while from 0 s; 15 rows" in fault.text
    columns["crank_angle [rad]"] = np.where(np.arange(40) % 3 == 0, ANGLE, np.nan)
    kept = load_measured(write_measured(tmp_path, TEXT, [RunTable("a", TIME, columns, fields)]))
    assert kept.runs[0].time.size == 40


def test_line_numbers_count_blank_lines(tmp_path: Path) -> None:
    message = refused(rig(tmp_path, GOOD.replace("\n0.01,", "\n\n\n0.01,").replace("\n0.02,", "\n0.012,")))
    assert "line 8: time runs back" in message


def test_a_decimal_comma_in_a_semicolon_file(tmp_path: Path) -> None:
    message = refused(rig(tmp_path, GOOD.replace(",", ";").replace("0.005", "0,005", 1)))
    assert "line 3, column 'time [s]': '0,005' has a decimal comma; save it with decimal points" in message


def test_decimal_commas_that_reached_the_units_are_named(tmp_path: Path) -> None:
    """Where commas part the cells as well; elsewhere they are read (tests/test_logger_files.py)."""
    head, *rows = GOOD.splitlines()
    cells = [[cell.replace(".", ",") for cell in line.split(",")] for line in [f"{head},drive_torque [N.m]", *rows]]
    message = refused(rig(tmp_path, "\n".join(",".join(row) for row in cells) + "\n"))
    assert "if the file has decimal commas, save it with decimal points, or with semicolons" in message


def test_a_comma_in_one_of_two_columns_does_not_hide_the_semicolon(tmp_path: Path) -> None:
    message = refused(rig(tmp_path, edited(1, "time [s];drive_torque [N,m]")))
    assert "unit 'N,m' has a comma" in message


def test_decimal_commas_in_a_file_of_commas_are_guessed(tmp_path: Path) -> None:
    message = refused(rig(tmp_path, GOOD.replace("\n0.005", "\n0,005", 1)))
    assert "if the file has decimal commas, save it with decimal points" in message


def test_a_literal_nan_is_absent(tmp_path: Path) -> None:
    lines = GOOD.splitlines()
    lines[9] = lines[9].rsplit(",", 1)[0] + ",NaN"
    channel = load_measured(rig(tmp_path, "\n".join(lines))).runs[0].channels["follower_x"]
    assert np.flatnonzero(np.isnan(channel.values)).tolist() == [8]


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"", "is empty"),
        (b"\n\n", "is empty"),
        (bytes(range(256)) * 20, "binary"),
        (GOOD.encode("utf-16-le"), "UTF-16"),
        (b"\x89PNG\r\n\x1a\n\xff\xfe" * 50, "UTF-8"),
        (b"time [s]," * 40_000, "longer than"),
        (GOOD.splitlines()[0].encode(), "0 rows"),
        ("\n".join(GOOD.splitlines()[:2]).encode(), "1 row of"),
        ("\n".join(GOOD.splitlines()[:8]).encode(), "7 rows"),
    ],
)
def test_files_that_are_no_table(tmp_path: Path, data: bytes, says: str) -> None:
    message = refused(rig(tmp_path, data))
    assert "slow.csv" in message
    assert says in message


@pytest.mark.parametrize("seed", range(30))
def test_damaged_files_are_refused_or_read_but_never_crash(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    data = bytearray(GOOD.encode())
    for _ in range(int(rng.integers(1, 6))):
        at = int(rng.integers(0, len(data)))
        match rng.integers(0, 3):
            case 0:
                data[at] = int(rng.integers(0, 256))
            case 1:
                del data[at : at + int(rng.integers(1, 200))]
            case _:
                data[at:at] = bytes(rng.choice(list(b',;"\n\r\t .-e0[]\x00\xff'), int(rng.integers(1, 5))).tolist())
    path = rig(tmp_path, bytes(data))
    found, message = None, ""
    try:
        found = load_measured(path)
    except MeasuredError as error:
        message = str(error)
    assert "slow" in message if found is None else np.all(np.diff(found.runs[0].time) > 0)
    assert found is None or all(c.noise > 0 for c in found.runs[0].channels.values())


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"drive_speed": 0.0}, ["run 'slow'", "drive_speed = 0"]),
        ({"drive": "measured"}, ["drive_speed", "exclude each other"]),
        ({"drive": "free", "drive_speed": None}, ["drive_angle", "free"]),
        ({"drive": "slow", "drive_speed": None}, ["run[slow].drive", "'slow'", "'measured', 'free' or 'torque'"]),
        ({"role": "test"}, ["run[slow].role", "'test'", "'fit' or 'validation'"]),
        ({"role": "validation"}, ["role = 'validation'", "nothing is left to fit", "(slow)"]),
        ({"drive_speed": "fast"}, ["run[slow].drive_speed", "'fast'"]),
        ({"drive_sped": 3.0}, ["drive_sped", "did you mean 'drive_speed'"]),
        ({"start": {"crank_angle": 1.0}}, ["start", "drive is speed"]),
        (
            {"drive": "free", "drive_speed": None, "drive_angle": None, "start": {"crank_angel": 1.0}},
            ["start.crank_angel", "'crank_angle'"],
        ),
        ({"drive": "free", "drive_speed": None, "drive_angle": None, "from_rest": True}, ["from_rest", "free"]),
        ({"noise": {"follower_y": 1e-3}}, ["noise.follower_y", "not a column of slow.csv", "follower_x"]),
        ({"noise": {"follower_x": 0.0}}, ["noise.follower_x", "greater than 0"]),
        ({"load": [{"body": "folower", "torque": 1.0}]}, ["'folower'", "follower"]),
        ({"load": [{"body": "follower", "torqe": 1.0}]}, ["torqe", "did you mean 'torque'"]),
        ({"file": "gone.csv"}, ["gone.csv", "no such file"]),
        ({"file": "."}, ["is a folder"]),
    ],
)
def test_fields_of_a_run(tmp_path: Path, fields: dict[str, object], says: list[str]) -> None:
    message = refused(rig(tmp_path, **fields))
    for word in says:
        assert word in message


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("nominal.toml", "nominl.toml", ["measured.toml", "mechanism = 'nominl.toml'", "no such mechanism file"]),
        ('mechanism = "nominal.toml"', "", ["mechanism is missing"]),
        ("run = [", "runs = [", ["runs is not a field", "did you mean 'run'"]),
        ('name = "slow"', 'name = "a@b"', ["run[a@b].name"]),
        ("run = [", "run = [[", ["measured.toml", "cannot be read as TOML"]),
        (
            'mechanism = "nominal.toml"',
            'mechanism = "nominal.toml"\ntolerance = { lenght = 1e-3 }',
            ["tolerance.lenght", "did you mean 'length'"],
        ),
        (
            'mechanism = "nominal.toml"',
            'mechanism = "nominal.toml"\nprior = { joint_clearance = 0.0 }',
            ["measured.toml", "prior.joint_clearance", "0"],
        ),
        (
            'mechanism = "nominal.toml"',
            'mechanism = "nominal.toml"\ntolerance = { qqq = 1e-3 }',
            ["tolerance.qqq", "use a quantity (mass"],
        ),
        (
            'mechanism = "nominal.toml"',
            'mechanism = "nominal.toml"\ntolerance = { payload = { torque = 1e-3 } }',
            ["tolerance.payload.torque"],
        ),
        (
            'mechanism = "nominal.toml"',
            'mechanism = "nominal.toml"\ntolerance = { mass = -1.0 }',
            ["tolerance.mass", "-1.0"],
        ),
    ],
)
def test_fields_of_the_file(tmp_path: Path, old: str, new: str, says: list[str]) -> None:
    path = rig(tmp_path)
    path.write_text(path.read_text().replace(old, new, 1))
    message = refused(path)
    for word in says:
        assert word in message


def test_two_runs_of_one_name(tmp_path: Path) -> None:
    run = RunTable("slow", TIME, {"follower_x [m]": np.sin(TIME)})
    assert "run 'slow' is there 2 times" in refused(write_measured(tmp_path, TEXT, [run, run]))


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    assert "no such file" in refused(tmp_path / "measured.toml")


def test_a_bad_mechanism_is_the_mechanisms_fault(tmp_path: Path) -> None:
    path = rig(tmp_path)
    (tmp_path / "nominal.toml").write_text(TEXT.replace("mass = 0.0942", "mass = -1.0"))
    assert "mass = -1.0" in refused(path)


def test_a_mechanism_without_a_motor_is_not_driven(tmp_path: Path) -> None:
    path = rig(tmp_path)
    start = TEXT.index("[drive]")
    (tmp_path / "nominal.toml").write_text(TEXT[:start] + TEXT[TEXT.index("[assembly]") :])
    assert "has no [drive]" in refused(path)


def test_a_run_that_follows_an_encoder_needs_one_that_moves_and_something_beside_it(tmp_path: Path) -> None:
    fields = {"drive": "measured"}
    still, only, none = (
        {"crank_angle [rad]": np.full(40, 0.3), "follower_x [m]": np.sin(TIME)},
        {"crank_angle [rad]": ANGLE},
        {"follower_x [m]": np.sin(TIME)},
    )
    for columns, says in ((still, "does not move"), (only, "besides the encoder"), (none, "no column 'crank_angle'")):
        assert says in refused(write_measured(tmp_path, TEXT, [RunTable("a", TIME, columns, fields)]))


def test_the_encoder_has_its_bodys_name(tmp_path: Path) -> None:
    path = rig(tmp_path)
    (tmp_path / "nominal.toml").write_text(TEXT.replace('"crank"', '"wheel"').replace("crank = 0.0", "wheel = 0.0"))
    assert "wheel_angle" in load_measured(path).runs[0].channels
    text = (tmp_path / "slow.csv").read_text().replace("crank_angle", "crank_angel")
    (tmp_path / "slow.csv").write_text(text)
    assert "wheel_angle" in refused(path)


def test_a_lone_constant_sensor(tmp_path: Path) -> None:
    path = write_measured(
        tmp_path, TEXT, [RunTable("a", TIME, {"drive_torque [N.m]": np.full(40, 0.25)}, {"drive_speed": SPEED})]
    )
    message = refused(path)
    assert "no usable signal" in message
    assert "0.25 N.m throughout" in message


@pytest.mark.parametrize(
    ("column", "factor", "says"),
    [
        ("rad", 180 / np.pi, "looks like deg/s"),
        ("rad", 30 / np.pi, "looks like rpm"),
        ("rad", -1.0, "negate drive_speed"),
        ("rad", 0.5 / np.pi, "turns per second"),
    ],
)
def test_a_speed_in_another_unit_contradicts_the_encoder(tmp_path: Path, column: str, factor: float, says: str) -> None:
    rng = np.random.default_rng(1)
    noisy = {f"crank_angle [{column}]": ANGLE + 1e-3 * rng.normal(size=40)}
    message = refused(write_measured(tmp_path, TEXT, [RunTable("a", TIME, noisy, {"drive_speed": SPEED * factor})]))
    assert f"drive_speed = {SPEED * factor:g} rad/s" in message
    assert says in message


def test_degrees_that_are_called_radians_contradict_the_speed(tmp_path: Path) -> None:
    columns = {"crank_angle [rad]": np.degrees(ANGLE) % 360}
    assert "the column looks like degrees" in refused(
        write_measured(tmp_path, TEXT, [RunTable("a", TIME, columns, {"drive_speed": SPEED})])
    )


def test_a_speed_a_little_off_is_for_the_diagnosis_to_explain(tmp_path: Path) -> None:
    columns = {"crank_angle [rad]": 1.1 * ANGLE}
    assert (
        load_measured(write_measured(tmp_path, TEXT, [RunTable("a", TIME, columns, {"drive_speed": SPEED})]))
        .runs[0]
        .speed
        == SPEED
    )


def test_a_followed_motion_that_thinning_would_lose_is_refused(tmp_path: Path) -> None:
    time = np.arange(2 * measured.SAMPLES + 10) * 1e-3
    columns = {"crank_angle [rad]": np.sin(700 * time), "drive_torque [N.m]": np.cos(time)}
    message = refused(write_measured(tmp_path, TEXT, [RunTable("a", time, columns, {"drive": "measured"})]))
    assert "cut the run into shorter ones" in message


def test_more_rows_than_can_be_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reading, "CELLS", 100)
    message = refused(rig(tmp_path))
    assert "has 40 rows of 3 columns" in message
    assert "keep one row in 2" in message


@pytest.mark.slow
def test_ten_million_rows_are_refused(tmp_path: Path) -> None:
    path = rig(tmp_path)
    rows = 10_000_000
    with (tmp_path / "slow.csv").open("w") as file:
        file.write("time [s],crank_angle [rad],follower_x [m]\n")
        for first in range(0, rows, 100_000):
            file.write("".join(f"{k}e-5,{k % 628}e-2,0.1\n" for k in range(first, first + 100_000)))
    message = refused(path)
    assert "has 10000000 rows of 3 columns" in message
    assert "keep one row in 3" in message

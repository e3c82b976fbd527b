"""Measured data that can be used: units, runs, noise, and faults that are mended and said."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import kinematics
from analytic.mechanism.columns import ANY_LAYOUT, readable
from analytic.mechanism.file import dumps, load
from analytic.mechanism.units import OFFERED, SI, QuantityKind, UnitError, factor
from analytic.paper.kinetostatics import kinetostatics
from compare.diagnose import slips
from compare.diagnose.data import measured, quality
from compare.diagnose.data.clipping import clipped
from compare.diagnose.data.measured import load_measured, once
from compare.diagnose.data.recording import Measured, MeasuredError
from compare.judge.signals import with_derived
from compare.recorded.alternatives import looks
from compare.recorded.headings import Naming, read_headings
from compare.recorded.table import read_table
from compare.recorded.text import _RowReader, coding, header
from measured_files import RunTable, csv_text, write_measured

CRANK_ROCKER = load("crank-rocker")
SPEED = CRANK_ROCKER.speed or 0.0
TEXT = dumps(CRANK_ROCKER)
REAL = os.environ.get("MEASURED_DATA")


def signals(samples: int = 73, turns: float = 1.0) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Time and exact signals of the crank-rocker from angle 0, evenly sampled, ends included."""
    theta = np.linspace(0, 2 * math.pi * turns, samples)
    motion = kinematics(Assembly(CRANK_ROCKER), theta, np.full(samples, SPEED), 0.0)
    return theta / SPEED, with_derived(kinetostatics(motion).signals(), CRANK_ROCKER)


def one(folder: Path, time: np.ndarray, columns: dict[str, np.ndarray], **fields: object) -> Measured:
    return load_measured(
        write_measured(
            folder, TEXT, [RunTable("a", time, columns, {"drive_speed": SPEED, "drive_angle": 0.0, **fields})]
        )
    )


def kinds(found: Measured) -> dict[str, str]:
    return {fault.signal: fault.kind for fault in found.faults}


@pytest.mark.parametrize(
    ("unit", "kind", "expected"),
    [
        ("deg", "angle", math.pi / 180),
        ("°", "angle", math.pi / 180),
        ("mrad", "angle", 1e-3),
        ("rev", "angle", 2 * math.pi),
        ("rpm", "angular velocity", math.pi / 30),
        ("rev/min", "angular velocity", math.pi / 30),
        ("deg/s", "angular velocity", math.pi / 180),
        ("rad.s^-1", "angular velocity", 1.0),
        ("mm", "length", 1e-3),
        ("in", "length", 0.0254),
        ("µm", "length", 1e-6),
        ("kN", "force", 1e3),
        ("kgf", "force", 9.80665),
        ("lbf", "force", 4.4482216152605),
        ("N.m", "torque", 1.0),
        ("Nm", "torque", 1.0),
        ("N-m", "torque", 1.0),
        ("mN.m", "torque", 1e-3),
        ("N·mm", "torque", 1e-3),
        ("lbf.in", "torque", 0.1129848290276167),
        ("in-lb", "torque", 0.1129848290276167),
        ("ft-lbs", "torque", 1.3558179483314004),
        ("oz-in", "torque", 0.1129848290276167 / 16),
        ("Nmm", "torque", 1e-3),
        ("ms", "time", 1e-3),
        ("us", "time", 1e-6),
        ("min", "time", 60.0),
        ("h", "time", 3600.0),
    ],
)
def test_units_of_the_right_dimension_are_converted(unit: str, kind: str, expected: float) -> None:
    assert factor(unit, kind) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize(
    ("unit", "kind"),
    [
        ("", "angle"),
        ("%", "angle"),
        ("Hz", "angular velocity"),
        ("1/s", "angular velocity"),
        ("mm", "angle"),
        ("g", "force"),
        ("rad", "length"),
        ("parrots", "length"),
        ("m**9**9**9", "length"),
        ("2 m", "length"),
        ("m^9", "length"),
        ("degC", "angle"),
        ("N/m", "torque"),
        ("nm", "torque"),
    ],
)
def test_other_units_are_refused_with_those_accepted(unit: str, kind: str) -> None:
    with pytest.raises(UnitError, match=", ".join(OFFERED[kind][:-1])):
        factor(unit, kind)


def test_every_offered_unit_is_accepted() -> None:
    for kind, units in OFFERED.items():
        for unit in units:
            assert factor(unit, kind) > 0


def test_data_in_si_do_not_wait_for_pint(tmp_path: Path) -> None:
    time, exact = signals()
    path = write_measured(tmp_path, TEXT, [RunTable("a", time, {"follower_angle [rad]": exact["follower_angle"]})])
    code = (
        "import sys, pathlib; from compare.diagnose.data.measured import load_measured as f;"
        " f(pathlib.Path(sys.argv[1]))"
    )
    code += "; print('pint' in sys.modules)"
    assert (
        subprocess.run(
            [sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True
        ).stdout.strip()
        == "False"
    )


def test_every_signal_is_read_in_any_unit(tmp_path: Path) -> None:
    time, exact = signals()
    rng = np.random.default_rng(1)
    exact |= {
        name: rng.normal(size=time.size)
        for name in readable(CRANK_ROCKER)
        if name.startswith("clearance") or "angular_velocity" in name or readable(CRANK_ROCKER)[name].on_request
    }
    exact |= {name: exact["crank_angle"] for name in readable(CRANK_ROCKER) if name.startswith("position")}
    other = {"angle": "deg", "angular_velocity": "rpm", "_x": "mm", "_y": "mm", "torque": "kN.m"}
    of_rates = {"m/s": "mm/s", "m/s^2": "g", "rad/s": "rpm", "rad/s^2": "deg/s^2", "W": "kW"}
    columns = {}
    for name, signal in readable(CRANK_ROCKER).items():
        unit = (
            of_rates[signal.unit]
            if signal.on_request
            else "kN"
            if name.startswith("reaction") and not name.endswith("angle")
            else "deg"
            if name.startswith("position")
            else next(u for end, u in other.items() if name.endswith(end))
        )
        kind = next(k for k in SI if _converts(unit, k))
        columns[f"{name} [{unit}]"] = exact[name] / factor(unit, kind)
    found = one(tmp_path, time, columns).runs[0]
    assert set(found.channels) == set(readable(CRANK_ROCKER))
    for name, channel in found.channels.items():
        here = np.isfinite(channel.values)
        assert here.sum() >= 72, name
        np.testing.assert_allclose(channel.values[here], exact[name][here], rtol=1e-9, atol=1e-12, err_msg=name)
    with pytest.raises(ValueError, match="read-only"):
        found.time[0] = 1.0


def _converts(unit: str, kind: str) -> bool:
    try:
        return factor(unit, kind) > 0
    except UnitError:
        return False


@pytest.mark.parametrize(
    "written", ["\ufeff{}", "{}", "{}\n\n"], ids=["byte order mark", "plain", "blank lines at the end"]
)
@pytest.mark.parametrize("ending", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
def test_files_of_other_programs_read_the_same(tmp_path: Path, written: str, ending: str, delimiter: str) -> None:
    time, exact = signals()
    values = exact["follower_angle"].copy()
    values[[3, 4, 70]] = np.nan
    text = csv_text(time, {"follower_angle [rad]": values, "drive_torque [N.m]": exact["drive_torque"]})
    plain, strange = tmp_path / "plain.csv", tmp_path / "strange.csv"
    plain.write_text(text)
    strange.write_bytes(written.format(text).replace(",", delimiter).replace("\n", ending).encode())
    one, two = (read_table(path, CRANK_ROCKER) for path in (plain, strange))
    np.testing.assert_array_equal(one.time, two.time)
    for name in one.values:
        np.testing.assert_array_equal(one.values[name], two.values[name])
    assert np.flatnonzero(np.isnan(two.values["follower_angle"])).tolist() == [3, 4, 70]


@pytest.mark.parametrize("seed", range(5))
def test_fast_and_careful_reading_agree(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    n, k = int(rng.integers(8, 400)), int(rng.integers(1, 6))
    names = rng.choice(list(readable(CRANK_ROCKER)), k, replace=False)
    data = rng.normal(size=(n, k)) * 10.0 ** rng.integers(-12, 12, (n, k))
    data[rng.random((n, k)) < 0.2] = np.nan
    columns = {f"{s} [{_si(s)}]": data[:, i] for i, s in enumerate(names)}
    text = csv_text(np.cumsum(rng.uniform(0.1, 1, n)), columns, digits=17)
    path = tmp_path / "x.csv"
    path.write_text(text)
    found = read_table(path, CRANK_ROCKER)
    top = header(path, coding(path), names_of := Naming(CRANK_ROCKER, ANY_LAYOUT))
    headings = read_headings(top.cells, {}, names_of, "line 1", True)
    assert headings.time is not None
    reader = _RowReader("x.csv", top, [headings.time, *headings.columns])
    slow, lines = reader._cell_by_cell(text.splitlines(True)[1:], 2)
    assert not reader.faults
    np.testing.assert_array_equal(np.column_stack([found.time, *found.values.values()]), slow)
    np.testing.assert_array_equal(slow[:, 1:], data)
    assert lines.tolist() == list(range(2, n + 2))


def _si(signal: str) -> str:
    return readable(CRANK_ROCKER)[signal].unit


def test_a_run_takes_from_the_mechanism_what_it_leaves_out(tmp_path: Path) -> None:
    time, exact = signals()
    columns = {"crank_angle [rad]": exact["crank_angle"], "drive_torque [N.m]": exact["drive_torque"]}
    runs = [
        RunTable("own speed", time, columns),
        RunTable("given", time, columns, {"drive_speed": 30.0, "drive_angle": 0.5, "from_rest": True, "load": []}),
        RunTable("followed", time, columns, {"drive": "measured", "load": [{"body": "follower", "torque": 0.5}]}),
        RunTable("released", time, columns, {"drive": "free", "start": {"crank_angle": 0.25}}),
    ]
    measured = load_measured(write_measured(tmp_path, TEXT, runs))
    own, given, followed, released = measured.runs
    assert [(each.field, each.value) for each in measured.assumed] == [
        ("run[own speed].drive_speed", SPEED),
        ("run[own speed].drive_angle", CRANK_ROCKER.assembly["crank"]),
        ("run[released].start.crank_angular_velocity", released.start["crank_angular_velocity"]),
    ]
    assert (own.drive, own.speed, own.angle, own.loads, own.from_rest) == (
        "speed",
        SPEED,
        CRANK_ROCKER.assembly["crank"],
        None,
        False,
    )
    assert (given.drive, given.speed, given.angle, given.loads, given.from_rest) == ("speed", 30.0, 0.5, (), True)
    assert (followed.drive, followed.speed, followed.angle) == ("measured", None, None)
    assert followed.loads is not None
    assert followed.loads[0].torque == 0.5
    assert released.drive == "free"
    assert released.start["crank_angle"] == 0.25  # as given; the rate from the readings
    assert released.start["crank_angular_velocity"] == pytest.approx(SPEED, rel=1e-6)


def test_a_run_is_fitted_unless_it_is_for_validation(tmp_path: Path) -> None:
    time, exact = signals()
    columns = {"drive_torque [N.m]": exact["drive_torque"]}
    runs = [RunTable("a", time, columns), RunTable("b", time, columns, {"role": "validation"})]
    assert [run.role for run in load_measured(write_measured(tmp_path, TEXT, runs)).runs] == ["fit", "validation"]


def test_tolerances_are_quantities_parameters_or_parameters_of_an_effect(tmp_path: Path) -> None:
    time, exact = signals()
    given = {"mass": 0.01, "radial_clearance": 1e-4, "sensor_bias.bias": 0.0}
    path = write_measured(tmp_path, TEXT, [RunTable("a", time, {"drive_torque [N.m]": exact["drive_torque"]})], given)
    assert load_measured(path).tolerance == given
    path.write_text(path.read_text().replace('"sensor_bias.bias" = 0.0', "sensor_bias.bias = 0.0"))
    assert load_measured(path).tolerance == given


def test_what_is_likelier_on_this_rig_is_said_by_effect_or_by_effect_and_place(tmp_path: Path) -> None:
    time, exact = signals()
    path = write_measured(tmp_path, TEXT, [RunTable("a", time, {"drive_torque [N.m]": exact["drive_torque"]})])
    assert load_measured(path).prior == {}
    path.write_text(path.read_text() + '\n[prior]\njoint_clearance = 0.1\n"coulomb_friction@E" = 20\n')
    assert load_measured(path).prior == {"joint_clearance": 0.1, "coulomb_friction@E": 20.0}


@pytest.mark.parametrize(
    "name", ["follower_angle", "coupler_angular_velocity", "reaction_B_x", "reaction_A_y", "drive_torque", "coupler_x"]
)
@pytest.mark.parametrize(
    ("samples", "turns", "relative", "within"),
    [(73, 1, 1e-3, 0.12), (73, 1, 1e-2, 0.08), (721, 2, 1e-4, 0.05), (721, 10, 1e-3, 0.05)],
)
def test_noise_of_smooth_signals_is_right_on_average(
    name: str, samples: int, turns: int, relative: float, within: float
) -> None:
    time, exact = signals(samples, turns)
    rng = np.random.default_rng(5)
    sigma = relative * np.ptp(exact[name])
    found = [quality.noise(time, exact[name] + sigma * rng.normal(size=samples)) / sigma for _ in range(60)]
    assert np.mean(found) == pytest.approx(1.0, abs=within)
    assert np.std(found) < 0.21 if samples == 73 else np.std(found) < 0.08


@pytest.mark.parametrize("seed", range(4))
def test_noise_of_irregular_samples_with_holes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    time = np.sort(rng.uniform(0, 10, 2000))
    values = np.sin(time) + 1e-4 * rng.normal(size=time.size)
    values[rng.random(time.size) < 0.3] = np.nan
    assert quality.noise(time, values) == pytest.approx(1e-4, rel=0.1)


def test_noise_is_never_zero_nor_less_than_the_rounding() -> None:
    time = np.linspace(0, 1, 500)
    smooth = np.sin(3 * time)
    assert quality.noise(time, smooth) == pytest.approx(1e-7 * np.ptp(smooth), rel=1e-6)
    for step in (1e-1, 1e-2, 1e-3, 1e-5):
        assert step / math.sqrt(12) <= quality.noise(time, step * np.round(smooth / step)) * 1.0001 < 1.3 * step
    assert quality.noise(time, np.zeros(500)) > 0
    assert quality.noise(time, np.full(500, np.nan)) > 0


@pytest.mark.parametrize("speed", [0.3, 3.0, 10.0, 33.3, 100.0, 400.0])
@pytest.mark.parametrize("counted", [np.floor, np.round])
def test_counts_of_a_crank_that_turns_evenly_are_its_noise(speed: float, counted: Any) -> None:
    """Its samples are many counts apart, and the rounding of one goes on in the next: differences would see none."""
    count = 2 * np.pi / 4096
    time = np.arange(0.0, 1.5, 0.004)
    angle = np.unwrap(counted(speed * time / count) % 4096 * count)
    assert quality.quantum(angle) == pytest.approx(count, rel=1e-6)
    assert quality.noise(time, angle) == pytest.approx(count / np.sqrt(12), rel=0.4)
    assert quality.quantum(speed * time) == 0


def test_steps_of_a_converter_are_found_and_of_noise_not() -> None:
    rng = np.random.default_rng(2)
    values = rng.normal(size=300)
    assert quality.quantum(np.round(values / 0.025) * 0.025) == pytest.approx(0.025, rel=1e-9)
    assert quality.quantum(values) == 0
    falling = np.cumsum([-124, *np.arange(-130, -306, -5), -306]) * 1e-5  # many steps apart, all by another number
    assert quality.quantum(np.round(0.25773 + falling, 5)) == pytest.approx(1e-5, rel=1e-9)


def test_signals_without_fault_are_left_as_they_are(tmp_path: Path) -> None:
    for samples in (37, 73, 145, 361):
        time, exact = signals(samples)
        for decimals in (6, 4, 16):
            for name, values in exact.items():
                rounded = np.round(values, decimals)
                sigma = quality.noise(time, rounded)
                assert quality.outliers(time, rounded, sigma).size == 0, (name, samples, decimals)
                assert not np.any(clipped(time, rounded)[0]), (name, samples, decimals)


@pytest.mark.parametrize("relative", [0.0, 1e-4, 1e-2])
def test_isolated_spikes_are_left_out_and_counted(tmp_path: Path, relative: float) -> None:
    time, exact = signals(361, 2)
    rng = np.random.default_rng(3)
    values = exact["follower_angle"] + relative * rng.normal(size=time.size)
    at = [2, 40, 41 + 30, 200, 358]
    values[at] += np.array([1, -1, 1, -1, 1]) * max(0.05, 40 * relative)
    found = one(tmp_path, time, {"follower_angle [rad]": values})
    (fault,) = found.faults
    assert (fault.kind, fault.samples) == ("outliers", 5)
    assert np.flatnonzero(np.isnan(found.runs[0].channels["follower_angle"].values)).tolist() == at
    assert found.runs[0].channels["follower_angle"].noise == pytest.approx(
        max(relative, 1e-7), rel=0.2 if relative else 2.0
    )


def test_a_step_is_no_spike() -> None:
    time = np.linspace(0, 1, 200)
    rng = np.random.default_rng(4)
    values = np.sign(np.sin(20 * time)) + 1e-3 * rng.normal(size=200)
    assert quality.outliers(time, values, quality.noise(time, values)).size == 0


@pytest.mark.parametrize("relative", [0.0, 1e-3, 2e-2])
@pytest.mark.parametrize("side", [1, -1])
def test_a_clipped_sensor_is_said_with_its_level(tmp_path: Path, relative: float, side: int) -> None:
    time, exact = signals(361, 2)
    force = exact["reaction_B_x"] * side
    peak = np.max(force)
    rng = np.random.default_rng(6)
    values = side * np.minimum(force + relative * np.ptp(force) * rng.normal(size=time.size), 0.7 * peak)
    found = one(tmp_path, time, {"reaction_B_x [N]": values})
    (fault,) = found.faults
    assert fault.kind == "clipped"
    assert f"{side * 0.7 * peak:.5g} N" in fault.text
    lost = np.isnan(found.runs[0].channels["reaction_B_x"].values)
    assert np.all(lost[values * side >= 0.7 * peak * (1 - 1e-12)])
    assert fault.samples == lost.sum() < 0.5 * time.size


def test_rest_and_coarse_peaks_are_not_clipped() -> None:
    time = np.linspace(0, 4, 801)
    ramp = np.clip(time - 1, 0, 2)
    rest = 0.5 * (1 - np.cos(math.pi * ramp / 2))  # at rest, moves, at rest
    coarse = np.round(np.sin(3 * time) / 0.05) * 0.05
    for values in (rest, coarse, np.sin(3 * time)):
        assert not np.any(clipped(time, values)[0])
    assert np.any(clipped(time, np.minimum(coarse, 0.7))[0])
    assert clipped(time, np.clip(np.sin(3 * time), -0.6, 0.7))[1] == [0.7, -0.6]


@pytest.fixture(scope="module")
def swings() -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Pendulums of 2 m, released where they turn near the top, near the horizontal and exactly there: they stand still
    for a while.
    """
    time, found = np.arange(500) / 100, {}
    for release in (0.0, 0.93, 1.2):
        motion = solve_ivp(
            lambda t, y: [y[1], -9.81 / 2 * math.cos(y[0])], (0, 5), [release, 0.0], t_eval=time, rtol=1e-11, atol=1e-12
        )
        angle, rate = motion.y
        found |= {
            f"angle {release}": angle,
            f"rate {release}": rate,
            f"x {release}": 2 * np.cos(angle),
            f"y {release}": 2 * np.sin(angle),
        }
    return time, found


@pytest.mark.parametrize("form", [".12g", ".6g", ".4g", ".3g", ".5f", ".3f", ".2f"])
def test_a_pendulum_at_its_turning_point_is_not_clipped(
    swings: tuple[np.ndarray, dict[str, np.ndarray]], form: str
) -> None:
    time, found = swings
    for name, values in found.items():
        read = np.array([float(format(v, form)) for v in values])
        assert not np.any(clipped(time, read)[0]), name


@pytest.mark.parametrize("counts", [100, 360, 1000, 4096])
def test_a_position_reckoned_from_counts_is_not_clipped_where_it_turns(
    swings: tuple[np.ndarray, dict[str, np.ndarray]], counts: int
) -> None:
    time, found = swings
    step = 2 * math.pi / counts
    for release in (0.93, 1.2):
        angle = np.round(found[f"angle {release}"] / step) * step
        for values in (angle, 2 * np.cos(angle), 2 * np.sin(angle)):
            assert not np.any(clipped(time, values)[0])


def test_what_comes_hard_against_a_stop_and_rests_there_is_not_clipped() -> None:
    time = np.linspace(0, 3, 600)
    falls = 1 - np.minimum(time, 1) ** 2  # lands at 1 s
    rises = np.maximum(time - 2, 0) ** 2  # is lifted off from 2 s
    assert not np.any(clipped(time, falls + rises)[0])


def test_a_sensor_that_is_clipped_at_both_ends_of_the_record_is_found_and_one_at_rest_there_is_not() -> None:
    time = np.linspace(0, 2 * math.pi, 200)
    noise = 1e-3 * np.random.default_rng(9).standard_normal(200)
    full, levels = clipped(time, np.minimum(np.cos(time) + noise, 0.4))
    assert levels == [0.4]
    assert np.all(full[np.cos(time) > 0.41])
    moves = 0.5 - 0.5 * np.cos(np.clip(time - 2, 0, 2) * math.pi / 2)
    assert not np.any(clipped(time, moves)[0])
    assert not np.any(clipped(time, np.round(moves + noise, 2))[0])


@pytest.mark.parametrize("share", [0.6, 0.8, 0.9, 0.95])
@pytest.mark.parametrize("form", [".12g", ".6g", ".4g"])
def test_a_sensor_that_is_clipped_a_little_is_found(
    swings: tuple[np.ndarray, dict[str, np.ndarray]], share: float, form: str
) -> None:
    time, found = swings
    rng = np.random.default_rng(8)
    for noise in (0.0, 1e-4, 1e-3):
        values = found["rate 0.93"] + noise * rng.standard_normal(time.size)
        level = share * values.max()
        read = np.array([float(format(v, form)) for v in np.minimum(values, level)])
        full, said = clipped(time, read)
        assert said == pytest.approx([level], rel=1e-3)
        assert np.all(full[values > level])


@pytest.mark.parametrize("unit", ["deg", "rad"])
@pytest.mark.parametrize("low", [0.0, -0.5])
def test_wrapped_angles_are_continued_even_over_a_gap(tmp_path: Path, unit: str, low: float) -> None:
    time, exact = signals(361, 5)
    turn = 2 * math.pi / factor(unit, "angle")
    wrapped = (exact["crank_angle"] / factor(unit, "angle") / turn - low) % 1.0 * turn + low * turn
    keep = (time < 0.3 * time[-1]) | (time > 0.8 * time[-1])
    found = one(tmp_path, time[keep], {f"crank_angle [{unit}]": wrapped[keep]})
    np.testing.assert_allclose(found.runs[0].channels["crank_angle"].values, exact["crank_angle"][keep], atol=1e-8)
    assert kinds(found) == {"crank_angle": "wrapped", "time": "gap"}


def test_a_recording_that_is_there_twice_counts_once_and_one_that_is_made_again_counts(tmp_path: Path) -> None:
    time, exact = signals()
    command, rng = {"drive_speed": SPEED, "drive_angle": 0.0}, np.random.default_rng(4)
    read = [{"follower_angle [rad]": exact["follower_angle"] + 1e-4 * rng.standard_normal(time.size)} for _ in range(2)]
    runs = [RunTable(name, time, columns, command) for name, columns in zip("abc", (*read, read[0]), strict=True)]
    measured = load_measured(write_measured(tmp_path, TEXT, runs))
    assert [run.name for run in once(measured).runs] == ["a", "b"]
    assert [(fault.run, fault.kind) for fault in measured.faults] == [("c", "repeated")]
    assert "the very numbers of run 'a'" in measured.faults[0].text


def test_a_column_may_be_left_out_whose_noise_is_given(tmp_path: Path) -> None:
    """As the line says that leaves out a sensor that reads nothing: it mends the data by itself."""
    time, exact = signals()
    columns = {"follower_angle [deg]": np.degrees(exact["follower_angle"]), "drive_torque [N.m]": exact["drive_torque"]}
    command = {"drive_speed": SPEED, "drive_angle": 0.0, "columns": {"drive_torque [N.m]": "ignore"}}
    noise = {"noise": {"follower_angle": 1e-4, "drive_torque": 1e-3}}
    found = load_measured(write_measured(tmp_path, TEXT, [RunTable("a", time, columns, command | noise)]))
    assert list(found.runs[0].channels) == ["follower_angle"]
    with pytest.raises(MeasuredError, match=r"noise\.coupler_angle is not a column"):
        one(tmp_path, time, columns, noise={"coupler_angle": 1e-4})


def test_a_wrapped_angle_without_a_command_is_continued() -> None:
    time = np.linspace(0, 10, 500)
    angle = 8 * np.sin(time)
    wrapped = (angle + math.pi) % (2 * math.pi) - math.pi
    found, jumps = quality.unwrapped(wrapped)
    assert jumps > 4
    np.testing.assert_allclose(found, angle, atol=1e-12)
    assert quality.unwrapped(angle)[1] == 0


def test_an_angle_sampled_once_a_turn_is_not_taken_for_wrapped() -> None:
    angle = np.arange(20) * 6.5
    assert quality.unwrapped(angle)[1] == 0


@pytest.mark.parametrize("degrees", [60.0, 200.0])
def test_a_wrapped_angle_whose_steps_do_not_say_which_way_it_turned_is_said_to_be_so(
    tmp_path: Path, degrees: float
) -> None:
    time, exact = signals(73, 72 * degrees / 360)
    columns = {"crank_angle [rad]": exact["crank_angle"] % (2 * math.pi), "follower_x [m]": exact["follower_x"]}
    run = RunTable("a", time, columns, {"drive": "measured"})
    found = load_measured(write_measured(tmp_path, TEXT, [run]))
    said = [fault.text for fault in found.faults if "may have turned the longer way round" in fault.text]
    assert len(said) == (degrees == 200.0)
    assert all("steps by 160 deg" in text for text in said)


def test_constant_absent_and_given_noise(tmp_path: Path) -> None:
    time, exact = signals()
    rng = np.random.default_rng(7)
    few = np.where(np.arange(time.size) < 5, exact["follower_x"], np.nan)
    columns = {
        "follower_angle [rad]": exact["follower_angle"] + 1e-3 * rng.normal(size=time.size),
        "reaction_B_x [N]": np.full(time.size, 3.0), "follower_x [m]": few, "drive_torque [N.m]": exact["drive_torque"],
    }  # fmt: skip
    found = one(tmp_path, time, columns, noise={"follower_angle": 1e-5, "drive_torque": 1e-3})
    assert kinds(found) == {"follower_angle": "noise", "reaction_B_x": "constant", "follower_x": "absent"}
    channels = found.runs[0].channels
    assert list(channels) == ["follower_angle", "drive_torque"]
    assert (channels["drive_torque"].noise, channels["drive_torque"].noise_given) == (1e-3, True)


def test_swapped_columns_and_wrong_units_are_seen_with_a_model(tmp_path: Path) -> None:
    time, exact = signals()
    rng = np.random.default_rng(8)
    noisy = {name: values + 1e-3 * np.ptp(values) * rng.normal(size=time.size) for name, values in exact.items()}
    columns = {
        "reaction_B_x [N]": noisy["reaction_B_y"],
        "reaction_B_y [N]": noisy["reaction_B_x"],
        "reaction_A_x [N]": noisy["reaction_A_x"],
        "crank_angle [rad]": noisy["crank_angle"],
        "coupler_x [m]": noisy["coupler_x"] * 1e3,
        "follower_angle [rad]": np.degrees(noisy["follower_angle"]),
        "reaction_E_x [N]": -noisy["reaction_E_x"],
        "drive_torque [N.m]": -noisy["drive_torque"],
    }
    found = one(tmp_path, time, columns)
    told = {f.signal: (f.kind, f.text) for f in slips.as_faults(slips.driven(found, found.mechanism), found.runs)}
    assert {signal: kind for signal, (kind, _) in told.items()} == {
        "reaction_B_x": "swapped",
        "coupler_x": "unit",
        "follower_angle": "unit",
        "reaction_E_x": "sign",  # one axis of a load cell alone is no cell that is mounted upside down
        "drive_torque": "sign",
    }
    for signal, words in (
        ("reaction_B_x", '"reaction_B_x [N]" = { signal = "reaction_B_y", unit = "N" }'),
        ("coupler_x", "it looks in mm, but its column says m"),
        ("follower_angle", '"follower_angle [rad]" = { signal = "follower_angle", unit = "deg" }'),
        ("drive_torque", "sign = -1"),
    ):
        assert words in told[signal][1]


@pytest.mark.parametrize(
    ("kind", "unit", "slope", "what"),
    [
        ("force", "N", 1e3, "in mN"),
        ("force", "kN", 1e3, "in N"),
        ("force", "N", 1e-3, "in kN"),
        ("force", "kN", 1e-3, None),
        ("length", "m", 1e3, "in mm"),
        ("length", "mm", 1e-3, "in m"),
        ("length", "m", 1e-3, "converted from mm twice"),
        ("angle", "rad", 180 / np.pi, "in deg"),
        ("angle", "deg", np.pi / 180, "in rad"),
        ("angle", "rad", np.pi / 180, "converted from deg twice"),
        ("angular velocity", "rad/s", 0.5 / np.pi, "in rev/s"),
        ("torque", "N.m", 1 / 0.1129848, "in lbf.in"),
        ("torque", "N.m", -1.0, "of the other sign"),
        ("torque", "N.m", 1.02, None),
        ("torque", "N.m", 1.3, None),
    ],
)
def test_a_slope_is_told_by_the_unit_that_a_column_is_read_in(
    kind: QuantityKind, unit: str, slope: float, what: str | None
) -> None:
    model = np.sin(np.linspace(0.0, 5.0, 50))
    told = looks(kind, unit, model, slope * model)
    assert told == (None if what is None else (pytest.approx(slope), what))


def test_right_columns_raise_no_suspicion(tmp_path: Path) -> None:
    time, exact = signals()
    rng = np.random.default_rng(9)
    units = {name: _si(name) for name in exact if not name.startswith("clearance")}
    columns = {
        f"{s} [{u}]": exact[s] * 1.02 + 1e-2 * np.ptp(exact[s]) * rng.normal(size=time.size) for s, u in units.items()
    }
    columns["crank_angle [rad]"] = exact["crank_angle"]
    found = one(tmp_path, time, columns)
    assert slips.driven(found, found.mechanism) == []


@pytest.mark.slow
def test_a_long_run_is_thinned_and_its_noise_kept(tmp_path: Path) -> None:
    samples = 3 * measured.SAMPLES
    rng = np.random.default_rng(10)
    time = np.arange(samples) * 1e-4
    values = np.sin(30 * time) + 1e-3 * rng.normal(size=samples)
    found = one(tmp_path, time, {"follower_angle [rad]": values})
    (fault,) = found.faults
    run = found.runs[0]
    assert (fault.kind, fault.samples) == ("thinned", 2 * measured.SAMPLES)
    np.testing.assert_allclose(run.channels["follower_angle"].values, values[::3], rtol=1e-11)
    np.testing.assert_allclose(run.time, time[::3], rtol=1e-11)
    assert run.channels["follower_angle"].noise == pytest.approx(1e-3, rel=0.02)


def test_reading_is_the_same_every_time(tmp_path: Path) -> None:
    time, exact = signals()
    path = write_measured(
        tmp_path, TEXT, [RunTable("a", time, {"follower_angle [deg]": np.degrees(exact["follower_angle"])})]
    )
    first, second = (load_measured(path).runs[0].channels["follower_angle"] for _ in range(2))
    np.testing.assert_array_equal(first.values, second.values)
    assert first.noise == second.noise


@pytest.mark.slow
def test_a_million_rows_are_read_in_bounded_memory(tmp_path: Path) -> None:
    time, exact = signals(1000, 1)
    rows = 1_200_000
    k = np.arange(rows)
    columns = {
        f"{s} [{_si(s)}]": np.tile(exact[s], rows // 1000) + 1e-3 * (k % 7)
        for s in ("follower_angle", "drive_torque", "reaction_B_x")
    }
    path = write_measured(tmp_path, TEXT, [RunTable("a", k * (time[1] - time[0]), columns, {"drive_speed": SPEED})])
    code = (
        "import sys, pathlib; from compare.diagnose.data.measured import load_measured as f; run ="
        " f(pathlib.Path(sys.argv[1])).runs[0];"
        # ru_maxrss has the parent's as well
        "peak = pathlib.Path('/proc/self/status').read_text().partition('VmHWM:')[2];"
        "print(run.time.size, peak.split()[0])"
    )
    done = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True)
    kept, kilobytes = map(int, done.stdout.split())
    assert kept == measured.SAMPLES
    assert kilobytes < 800_000


@pytest.mark.skipif(REAL is None, reason="real data: set MEASURED_DATA to their folder")
class TestRealData:
    """Recordings of real rigs are read as they are."""

    def test_pendulum(self) -> None:
        found = load_measured(Path(REAL or "") / "pendulum" / "measured.toml")
        assert [run.drive for run in found.runs] == ["free", "free"]
        assert found.runs[0].start == {"pendulum_angle": 3.0939601, "pendulum_angular_velocity": 1.8482541}
        for run in found.runs:
            assert run.time.size == 2292
            assert 1e-5 < run.channels["pendulum_angle"].noise < 1e-4
            assert np.isfinite(run.channels["pendulum_angle"].values).all()
        assert all(f.kind == "outliers" and f.samples < 10 for f in found.faults)

    def test_robot_axis(self) -> None:
        found = load_measured(Path(REAL or "") / "tx40-axis1" / "measured.toml")
        (run,) = found.runs
        assert (run.drive, run.time.size, list(run.channels)) == ("measured", 2250, ["arm_angle", "drive_torque"])
        assert 0.1 < run.channels["drive_torque"].noise < 2
        assert found.faults == ()

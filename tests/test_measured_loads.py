"""Force and torque columns of measured runs act as loads over time: held to a known push, written out by hand."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
import tomli_w

import linkage_crosscheck as lc
from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import kinematics
from analytic.mechanism import Mechanism
from analytic.mechanism.columns import MapError
from analytic.mechanism.file import dumps, load
from analytic.paper.kinetostatics import kinetostatics
from compare.diagnose.data.recording import Measured, MeasuredError
from compare.faults import ArgumentError
from compare.recorded.errors import DataError
from engines_here import missing
from marks import slow
from measured_files import RunTable, csv_text, write_measured

SPEED = 12.0  # rad/s
CRANK, ROD = 0.05, 0.12  # m
PUSH = {"load": {"body": "slider", "force": [-1.0, 0.0]}}  # against the slide's way out, as many N as the column says


def press(speed: float = SPEED) -> Mechanism:
    """The slider-crank without weight, clearance or loads of its own, turned evenly."""
    return load("slider-crank").replace(
        drives=(load("slider-crank").drives[0].model_copy(update={"speed": speed}),), loads=(), gravity=(0.0, 0.0)
    )


def pushed(time: np.ndarray, size: float = 200.0) -> np.ndarray:
    """A push (N,) N that no turn repeats."""
    return np.asarray(size * (1.0 + np.sin(2.7 * time)) * np.exp(-time))


def arm(theta: np.ndarray) -> np.ndarray:
    """By how much (m) the slide goes on with each rad of the crank, by hand."""
    s, c = CRANK * np.sin(theta), CRANK * np.cos(theta)
    return np.asarray(-s * (1 + c / np.sqrt(ROD**2 - s**2)))


def recorded(size: float = 200.0, speed: float = SPEED, late: float = 0.0) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Times (N,) s, and the columns of a run under a push: the torque is the linkage's own, and by virtual work what
    the push takes.
    """
    time = np.linspace(0.0, 1.4, 201) + late
    theta = 0.3 + speed * (time - late)
    idle = kinetostatics(kinematics(Assembly(press(speed)), theta, speed)).drive_torque
    force = pushed(time - late, size)
    return time, {"crank_angle [rad]": theta, "drive_torque [N.m]": idle + force * arm(theta), "press [N]": force}


def mapped(folder: Path, *entries: Mapping[str, object]) -> Path:
    """A map in which the column "press" is each of these."""
    path = folder / "columns.toml"
    path.write_text(tomli_w.dumps({"columns": {"press": {k: v for each in entries for k, v in each.items()}}}))
    return path


@pytest.mark.long_rows("both-12.0", "both--12.0", "angle--12.0")
@pytest.mark.parametrize("speed", [SPEED, -SPEED])
@pytest.mark.parametrize("columns", ["angle", "both"])
def test_a_recorded_push_acts_in_a_check_of_a_driven_linkage(tmp_path: Path, speed: float, columns: str) -> None:
    time, written = recorded(speed=speed, late=0.25)
    file = tmp_path / "bench.csv"
    text = csv_text(time, written)
    if columns == "angle":
        text = "\n".join(line.partition(",")[2] for line in text.splitlines()) + "\n"
    file.write_text(text)
    result = lc.check(file, mechanism=press(speed), map=mapped(tmp_path, PUSH))
    assert result.verdict == "agrees", result
    (torque,) = [each for each in result.runs[0].discrepancies if each.signal == "drive_torque"]
    assert abs(torque.max) < 1e-7 * np.abs(written["drive_torque [N.m]"]).max()
    wrong = lc.check(file, mechanism=press(speed), map=mapped(tmp_path, PUSH, {"scale": 1.05}))
    assert wrong.verdict == "disagrees"
    without = lc.check(file, mechanism=press(speed))
    assert without.verdict == "disagrees"
    told = "'press [N]' is no signal of the linkage, and ignored; if 'press [N]' acts on it, [columns] may say so: load"
    assert any(told in each for each in without.warnings)


def test_each_file_has_its_own_push_and_what_it_is_rounded_to_is_allowed(tmp_path: Path) -> None:
    files = {}
    for name, size in (("weak", 90.0), ("strong", 250.0)):
        time, written = recorded(size)
        written["press [N]"] = np.round(written["press [N]"])  # a display of whole newtons
        files[name] = tmp_path / f"{name}.csv"
        files[name].write_text(csv_text(time, written))
    result = lc.check(files, mechanism=press(), map=mapped(tmp_path, PUSH))
    assert [run.verdict for run in result.runs] == ["agrees", "agrees"], result
    strong = csv_text(*recorded(250.0)).replace("press [N]", "push [N]")
    files["strong"].write_text(strong)
    assert [run.verdict for run in lc.check(files, mechanism=press(), map=mapped(tmp_path, PUSH)).runs] == [
        "agrees",
        "disagrees",
    ]


@pytest.mark.slow
@pytest.mark.parametrize("engine", [*slow(""), "mujoco"])
def test_a_released_wheel_gains_the_impulse_of_a_recorded_torque(tmp_path: Path, engine: str) -> None:
    """By its angular momentum, written out: a torque of known integral, on a wheel without weight."""
    if engine and missing(engine):
        pytest.skip(missing(engine))
    wheel = load("pendulum").replace(gravity=(0.0, 0.0))
    body = wheel.bodies[0]
    inertia = body.moment_of_inertia + body.mass * abs(body.centre) ** 2
    time = np.linspace(0.0, 2.0, 201)
    torque, w = 0.05 * np.sin(3.0 * time), 3.0
    columns = {
        "pendulum_angle [rad]": wheel.assembly["pendulum"] + 0.05 / inertia * (time / w - np.sin(w * time) / w**2),
        "pendulum_angular_velocity [rad/s]": 0.05 / inertia * (1 - np.cos(w * time)) / w,
        "press [N.mm]": 1e3 * torque,
    }
    file = tmp_path / "wheel.csv"
    file.write_text(csv_text(time + 7.0, columns))
    map = mapped(tmp_path, {"load": {"body": "pendulum", "torque": 1.0}})
    result = lc.check(file, mechanism=wheel, map=map, **({"simulator": engine} if engine else {}))
    assert result.verdict == "agrees", result
    if engine:
        return
    assert lc.check(file, mechanism=wheel).verdict == "disagrees"
    off = mapped(tmp_path, {"load": {"body": "pendulum", "torque": 1.0}}, {"scale": 1.01})
    assert lc.check(file, mechanism=wheel, map=off).verdict == "disagrees"


@pytest.mark.parametrize(
    ("entry", "motion", "sentence"),
    [
        ({"loda": {"body": "slider"}}, "driven", "columns.press.loda is not a field; did you mean 'load'"),
        ({}, "driven", "a column is either a signal or a load"),
        (PUSH | {"signal": "slider_x"}, "driven", "a column is either a signal or a load"),
        ({"load": {"body": "sledge", "force": [1.0, 0.0]}}, "driven", "columns.press.load cannot act:.*'sledge'"),
        ({"load": {"body": "slider"}}, "driven", "is either force = .*, or torque = 1"),
        ({"load": {"body": "crank", "torque": 1.0}}, "driven", "column 4, 'press', has unit 'N'"),
        (
            {"load": PUSH["load"] | {"over": "time", "from": 0.0, "to": 1.0}},
            "driven",
            "varies with the column over its file's time; leave over out",
        ),
        (PUSH, "static", "'press .N.' acts as a load over time, which rows at rest have not"),
    ],
)
def test_a_column_that_cannot_act_is_one_sentence(tmp_path: Path, entry: dict, motion: str, sentence: str) -> None:
    (file := tmp_path / "bench.csv").write_text(csv_text(*recorded()))
    with pytest.raises((DataError, MapError), match=sentence):
        lc.check(file, mechanism=press(), map=mapped(tmp_path, entry), motion=motion)


# ---------------------------------------------------------------- diagnosis


def rig(folder: Path, speeds: Mapping[str, float], **fields: object) -> Path:
    """Runs of the press with a slider that is 60 g heavier than drawn, each under a push of its own; by hand."""
    runs, rng = [], np.random.default_rng(4)
    heavy = press().with_body("slider", mass=press().body("slider").mass + 0.06)
    for k, (name, speed) in enumerate(speeds.items()):
        time, columns = recorded(80.0 * (k + 1), speed)
        theta = columns["crank_angle [rad]"]
        torque = kinetostatics(kinematics(Assembly(heavy), theta, speed)).drive_torque
        torque = torque + columns["press [N]"] * arm(theta) + 0.01 * rng.standard_normal(time.size)
        columns = {"drive_torque [N.m]": torque, "press [N]": columns["press [N]"]}
        given = {"drive_speed": speed, "drive_angle": 0.3, "noise": {"drive_torque": 0.01}, **fields}
        runs.append(RunTable(name, time, columns, given))
    path = write_measured(folder, dumps(press()), runs)
    path.write_text("columns.press = " + "{ load = { body = 'slider', force = [-1.0, 0.0] } }\n" + path.read_text())
    return path


@pytest.mark.slow
@pytest.mark.mujoco
def test_a_diagnosis_takes_each_run_s_push_and_finds_the_mass_beside_it(tmp_path: Path) -> None:
    path = rig(tmp_path, {"slow": 9.0, "fast": 21.0, "back": -15.0})
    result = lc.diagnose(path, simulator="mujoco", only=["payload@slider", "payload@crank"], others=False)
    assert result.verdict in ("explained", "ambiguous"), result
    (effect,) = result.effects
    mass = effect.parameters["mass"]
    assert (effect.name, effect.where) == ("payload", "slider")
    assert mass.low < 0.06 < mass.high
    assert mass.value == pytest.approx(0.06, abs=0.006)
    assert result.gap.after < 1.1
    without = tmp_path / "without"
    path = rig(without, {"slow": 9.0, "fast": 21.0})
    path.write_text(path.read_text().replace("columns.press = {", 'columns.press = "ignore" #'))
    assert lc.diagnose(path, simulator="mujoco", only=["payload@slider"], others=False).verdict == "unexplained"


def test_what_a_diagnosis_cannot_follow_over_time_is_refused(tmp_path: Path) -> None:
    path = rig(tmp_path, {"slow": 9.0})
    nominal = dumps(press().replace(drive={"joint": "O", "speed": SPEED, "stiffness": 500.0}))
    (tmp_path / "nominal.toml").write_text(nominal)
    with pytest.raises(MeasuredError, match="'slow': has a drive that yields, and the load on 'slider'"):
        lc.diagnose(path, simulator="mujoco")
    path = rig(tmp_path, {"slow": 9.0})
    path.write_text(path.read_text().replace("drive_speed = 9.0", 'drive = "free"').replace("drive_angle = 0.3\n", ""))
    with pytest.raises(MeasuredError, match="'slow': is free, and the load on 'slider' varies over time"):
        lc.diagnose(path, simulator="mujoco")


# ---------------------------------------------------------------- measured data in a check


def bench(mass: float = 0.0, **fields: object) -> Measured:
    """Two runs of the press in memory, each under its own push, of a slider that is so much (kg) heavier; by hand."""
    frames, rng = {}, np.random.default_rng(7)
    made = press().with_body("slider", mass=press().body("slider").mass + mass)
    for name, speed in (("slow", 9.0), ("fast", 21.0)):
        time, columns = recorded(10.0 * speed, speed)
        theta = columns.pop("crank_angle [rad]")
        torque = kinetostatics(kinematics(Assembly(made), theta, speed)).drive_torque + columns["press [N]"] * arm(
            theta
        )
        columns["drive_torque [N.m]"] = torque + 0.02 * rng.standard_normal(time.size)
        frames[name] = {"time [s]": time, **columns}
    given = {"drive_angle": 0.3, "noise": {"drive_torque": 0.02}, "columns": {"press": PUSH}}
    return lc.measured(press(), frames, speed={"slow": 9.0, "fast": "21 rad/s"}, **given | fields)


def test_measured_data_are_checked_with_their_loads_speeds_and_noise() -> None:
    told: list[str] = []
    result = lc.check(bench(), progress=lambda what, done, total: told.append(what))
    assert result.mechanism.name == press().name
    assert [(run.simulator.name, run.verdict) for run in result.runs] == [("slow", "agrees"), ("fast", "agrees")]
    assert told == ["check slow", "check fast"]
    assert [run.verdict for run in lc.check(bench(mass=0.15)).runs] == ["agrees", "disagrees"]  # 5 times the inertia
    quiet = bench(noise={"drive_torque": 1e-4})
    assert lc.check(quiet).verdict == "disagrees"


def test_what_measured_data_say_themselves_is_not_said_again(tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match=r"mechanism: .*these data are measured of slider-crank; leave it out"):
        lc.check(bench(), mechanism="pendulum")
    with pytest.raises(ArgumentError, match="map: measured data say which signal each column is"):
        lc.check(bench(), map=mapped(tmp_path, PUSH))


@pytest.mark.slow
def test_free_runs_are_let_go_and_runs_of_two_kinds_are_refused() -> None:
    """A wheel without weight whose bearing drags: its rate dies away by an exponential."""
    wheel = load("pendulum").replace(gravity=(0.0, 0.0)).with_joint("O", damping=0.05)
    body, time = wheel.bodies[0], np.linspace(0.0, 2.0, 201)
    rate = 0.05 / (body.moment_of_inertia + body.mass * abs(body.centre) ** 2)
    swing = {
        "time [s]": time,
        "pendulum_angle [rad]": 0.4 + 3.0 / rate * (1 - np.exp(-rate * time)),
        "pendulum_angular_velocity [rad/s]": 3.0 * np.exp(-rate * time),
    }
    given = {"speed": "free", "noise": {"pendulum_angle": 1e-5, "pendulum_angular_velocity": 1e-5}}
    (run,) = lc.check(lc.measured(wheel, {"swing": swing}, **given)).runs
    assert (run.simulator.name, run.verdict) == ("swing", "agrees")
    dragged = wheel.with_joint("O", damping=0.06)
    assert lc.check(lc.measured(dragged, {"swing": swing}, **given)).verdict == "disagrees"
    columns = recorded()[1]
    frame = {"time [s]": recorded()[0], **{name: columns[name] for name in list(columns)[:2]}}
    both = lc.measured(press(), {"driven": frame, "let go": frame}, speed={"driven": "measured", "let go": "free"})
    with pytest.raises(ArgumentError, match="results: some runs are free and others driven"):
        lc.check(both)

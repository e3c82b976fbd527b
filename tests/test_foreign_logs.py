"""Logs that other programs write of linkages by themselves, read through maps: within 0.1 % of each peak, and
without ``frame`` the verdict says which line is missing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import linkage_crosscheck as lc
from analytic.mechanism import Mechanism
from analytic.mechanism.file import load, loads
from foreign_logs import (
    FOUR_BAR_XML,
    PENDULUM,
    SLIDER_CRANK,
    SLIDER_CRANK_XML,
    exudyn_log,
    mujoco_log,
    pybullet_log,
)

CHIPS = (
    {"name": "chip", "kind": "accelerometer", "body": "coupler", "point": (0.1, 0.02)},
    {"name": "across", "kind": "accelerometer", "body": "coupler", "point": (0.1, 0.02), "axis": (0.0, 1.0)},
    {"name": "gyro", "kind": "gyro", "body": "coupler"},
)


def four_bar() -> Mechanism:
    m = load("crank-rocker").rigid()
    return m.replace(gravity=(0.0, -9.81), drive={"joint": "D", "speed": "measured"}, sensors=CHIPS)


@dataclass(frozen=True)
class Log:
    """What a program writes of a linkage, the lines of its map, and the vector that is in a body's frame."""

    write: Callable[[Path], Mapping[str, np.ndarray]]
    mechanism: Callable[[], Mechanism]
    lines: str
    vector: str
    body: str


LOGS = {
    "mujoco, a slider-crank": Log(
        lambda folder: mujoco_log(SLIDER_CRANK_XML, 20.0),
        lambda: loads(SLIDER_CRANK),
        """
        time = { signal = "time", unit = "s" }
        qpos_motor = { signal = "crank_angle", unit = "rad" }
        qpos_rail = { signal = "slider_x", unit = "m", offset = 0.17 }
        a_slider_x = { signal = "slider_chip", unit = "m/s^2" }
        a_rod_y = { signal = "rod_chip", unit = "m/s^2" }
        w_rod_z = { signal = "rod_gyro", unit = "rad/s" }
        f_knee_x = { signal = "reaction_A_x", unit = "N", frame = "rod" }
        f_knee_y = { signal = "reaction_A_y", unit = "N", frame = "rod" }
        force_servo = { signal = "drive_torque", unit = "N.m" }
        """,
        "reaction_A",
        "rod",
    ),
    "mujoco, a four-bar": Log(
        lambda folder: mujoco_log(FOUR_BAR_XML, 15.0),
        four_bar,
        """
        time = { signal = "time", unit = "s" }
        qpos_motor = { signal = "crank_angle", unit = "rad" }
        qpos_rocker = { signal = "follower_angle", unit = "rad", offset = 1.6065182091929755 }
        a_coupler_x = { signal = "chip", unit = "m/s^2" }
        a_coupler_y = { signal = "across", unit = "m/s^2" }
        w_coupler_z = { signal = "gyro", unit = "rad/s" }
        f_foot_x = { signal = "reaction_E_x", unit = "N", frame = "follower" }
        f_foot_y = { signal = "reaction_E_y", unit = "N", frame = "follower" }
        force_servo = { signal = "drive_torque", unit = "N.m" }
        """,
        "reaction_E",
        "follower",
    ),
    "exudyn, a slider-crank": Log(
        lambda folder: exudyn_log(20.0),
        lambda: loads(SLIDER_CRANK),
        """
        time = { signal = "time", unit = "s" }
        angle_0 = { signal = "crank_angle", unit = "rad" }
        rod_a_0 = { signal = "rod_acceleration_x", unit = "m/s^2", frame = "rod" }
        rod_a_1 = { signal = "rod_acceleration_y", unit = "m/s^2", frame = "rod" }
        slider_a_0 = { signal = "slider_acceleration_x", unit = "m/s^2" }
        rod_w_2 = { signal = "rod_gyro", unit = "rad/s" }
        F_A_0 = { signal = "reaction_A_x", unit = "N", sign = -1 }
        F_A_1 = { signal = "reaction_A_y", unit = "N", sign = -1 }
        motor_0 = { signal = "drive_torque", unit = "N.m", sign = -1 }
        """,
        "rod_acceleration",
        "rod",
    ),
    "pybullet, a pendulum": Log(
        pybullet_log,
        lambda: loads(PENDULUM),
        """
        time = { signal = "time", unit = "s" }
        angle = { signal = "arm_angle", unit = "rad" }
        Fx = { signal = "reaction_O_x", unit = "N", frame = "arm" }
        Fy = { signal = "reaction_O_y", unit = "N", frame = "arm" }
        """,
        "reaction_O",
        "arm",
    ),
}


def read(name: str, folder: Path) -> tuple[dict[str, np.ndarray], str]:
    """The columns of a log that its map has, and the lines of that."""
    pytest.importorskip(name.partition(",")[0])
    lines = "\n".join(line.strip() for line in LOGS[name].lines.splitlines())
    written = LOGS[name].write(folder)
    return {heading: values for heading, values in written.items() if f"\n{heading} = " in lines}, lines


@pytest.mark.long_rows("pybullet, a pendulum", "exudyn, a slider-crank", "mujoco, a four-bar")
@pytest.mark.parametrize("name", LOGS)
def test_a_log_agrees_within_a_thousandth_and_without_its_frame_is_told_which_line_is_missing(
    name: str, tmp_path: Path
) -> None:
    log, m, engine = LOGS[name], LOGS[name].mechanism(), name.partition(",")[0]
    columns, lines = read(name, tmp_path)
    (tmp_path / "map.toml").write_text(f"[columns]\n{lines}", encoding="utf-8")
    found = lc.check({engine: columns}, m, map=tmp_path / "map.toml")
    run = found.runs[0]
    off = {each.signal: abs(each.max) / np.abs(run.analytic[each.signal]).max() for each in run.discrepancies}
    assert max(off.values()) < 1e-3, off
    assert found.verdict == "agrees"
    assert len(off) >= len(columns) - 2  # all but time and the encoder

    bare = lines.replace(f', frame = "{log.body}"', "")
    (tmp_path / "map.toml").write_text(f"[columns]\n{bare}", encoding="utf-8")
    blind = lc.check({engine: columns}, m, map=tmp_path / "map.toml")
    assert blind.verdict == "disagrees"
    (told,) = [text for text in blind.warnings if "its size agrees" in text]
    assert f"{log.vector}_x and _y: its size agrees; it turns with body {log.body}: say" in told
    written = [line for line in lines.splitlines() if f'frame = "{log.body}"' in line]
    assert all(line.partition(" = ")[2] in told for line in written)


def test_a_sensor_of_a_log_that_is_a_hundredth_off_disagrees_and_no_other(tmp_path: Path) -> None:
    """MuJoCo's own accelerometer, gyro and force sensor, along one axis of the rod each."""
    columns, lines = read("mujoco, a slider-crank", tmp_path)
    lines = "\n".join(line for line in lines.splitlines() if not line.startswith("f_knee"))
    del columns["f_knee_y"]
    (tmp_path / "map.toml").write_text(
        f'[columns]\n{lines}\nf_knee_x = {{ signal = "cell", unit = "N" }}', encoding="utf-8"
    )
    for heading, signal in (("a_rod_y", "rod_chip"), ("w_rod_z", "rod_gyro"), ("f_knee_x", "cell"), ("", "")):
        log = {**columns, heading: 1.01 * columns[heading]} if heading else columns
        run = lc.check({"mujoco": log}, loads(SLIDER_CRANK), map=tmp_path / "map.toml").runs[0]
        assert [each.signal for each in run.discrepancies if each.verdict != "agrees"] == [signal] * bool(signal)

"""Files of test benches, as their own libraries write them, of columns by heading: ``crank_angle [deg]``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

Columns = Mapping[str, Any]  # (N,) by heading
JOINT_STATE = """std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
"""
HEADER = f"""{"=" * 80}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{"=" * 80}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
VECTOR = f"{'=' * 80}\nMSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n"
IMU = "std_msgs/Header header\ngeometry_msgs/Vector3 angular_velocity\ngeometry_msgs/Vector3 linear_acceleration\n"


def parted(heading: str) -> tuple[str, str]:
    """The name and the unit of a heading."""
    name, _, unit = heading.partition(" [")
    return name, unit.rstrip("]")


def tdms(path: Path, columns: Columns, group: str = "run") -> None:
    import nptdms

    each = [(*parted(heading), values) for heading, values in columns.items()]
    with nptdms.TdmsWriter(path) as file:
        file.write_segment(
            [nptdms.ChannelObject(group, name, values, {"unit_string": unit}) for name, unit, values in each]
        )


def mdf(path: Path, columns: Columns) -> None:
    import asammdf

    clock = next((heading for heading in columns if heading.startswith("time")), "")
    times = columns[clock] if clock else np.arange(float(len(next(iter(columns.values())))))
    signals = [
        asammdf.Signal(values, times, unit=parted(heading)[1], name=parted(heading)[0])
        for heading, values in columns.items()
        if heading != clock
    ]
    with asammdf.MDF(version="4.10") as file:
        file.append(signals)
        file.save(path, overwrite=True)


def hdf5(path: Path, columns: Columns, group: str = "run") -> None:
    import h5py

    with h5py.File(path, "w") as file:
        for heading, values in columns.items():
            name, unit = parted(heading)
            file.create_dataset(f"{group}/{name}", data=values).attrs["units"] = unit


def mat73(path: Path, columns: Columns) -> None:
    """As ``save -v7.3`` writes a struct: rows and columns the other way round, after 512 bytes of MATLAB's."""
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        for heading, values in columns.items():
            data = file.create_dataset(f"run/{heading.replace(' [', '_').rstrip(']')}", data=np.atleast_2d(values))
            data.attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


def xlsx(path: Path, columns: Columns, sheet: str = "run") -> None:
    import openpyxl

    book = openpyxl.Workbook()
    page = book.active
    page.title = sheet
    page.append(list(columns))
    longest = max(len(values) for values in columns.values())
    for k in range(longest):
        page.append([v[k].item() if hasattr(v[k], "item") else v[k] for v in columns.values() if k < len(v)])
    book.save(path)


def mcap(path: Path, columns: Columns, topic: str = "/joint_states") -> None:
    """The columns ``position_<joint>``, ``velocity_<joint>`` and ``effort_<joint>`` of joint states."""
    from mcap_ros2.writer import Writer

    with path.open("wb") as stream, Writer(stream) as bag:
        add_joint_states(bag, columns, topic)


def add_joint_states(bag: Any, columns: Columns, topic: str) -> None:
    schema = bag.register_msgdef("sensor_msgs/msg/JointState", JOINT_STATE + HEADER)
    named = {parted(heading)[0]: values for heading, values in columns.items()}
    joints = list(dict.fromkeys(name.partition("_")[2] for name in named if name != "time"))
    for row, at in enumerate(named["time"]):
        message = {"header": stamped(at), "name": joints}
        for what in ("position", "velocity", "effort"):
            message[what] = [named[f"{what}_{joint}"][row] for joint in joints if f"{what}_{joint}" in named]
        bag.write_message(topic, schema, message, log_time=message["header"]["stamp"]["nanosec"])


def add_imu(bag: Any, time: Any, rate: Any, topic: str = "/imu") -> None:
    schema = bag.register_msgdef("sensor_msgs/msg/Imu", IMU + HEADER + VECTOR)
    for at, omega in zip(time, rate, strict=True):
        turning, pull = {"x": 0.0, "y": 0.0, "z": float(omega)}, {"x": 0.0, "y": 9.81, "z": 0.0}
        message = {"header": stamped(at), "angular_velocity": turning, "linear_acceleration": pull}
        bag.write_message(topic, schema, message, log_time=message["header"]["stamp"]["nanosec"])


def stamped(at: float) -> dict[str, Any]:
    """A ROS header of a time (s) from 1 s on."""
    whole = round((at + 1) * 1e9)
    return {"stamp": {"sec": whole // 10**9, "nanosec": whole % 10**9}, "frame_id": ""}


WRITERS: dict[str, Callable[[Path, Columns], None]] = {
    "tdms": tdms,
    "mf4": mdf,
    "h5": hdf5,
    "mat": mat73,
    "xlsx": xlsx,
}

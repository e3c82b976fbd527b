"""A pick-and-place robot with two motors, held more often than it needs, by MSC Adams: not in this repository.

Its torques are given to seven digits, the angle of M1 to seven decimals: a second difference at 5 ms knows the
acceleration to 0.01 rad/s2, and so a torque to some 2 N.m.  Near the start the motion is smooth, and a polynomial
through many samples knows it a hundred times better; later it has jitter of its own from sample to sample, which the
cubic spline through them follows.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import linkage_crosscheck as lc
from analytic.beyond_paper.free_motion import driven_motion
from analytic.kinematics.assembly import Assembly
from analytic.mechanism import Mechanism
from analytic.mechanism.file import load
from sim_models.engine import ENGINES, Request, declared, engine

DATA = Path(os.environ.get("MEASURED_DATA", "")) / "adams-parallel-robot"
HERE = pytest.mark.skipif(
    not (os.environ.get("MEASURED_DATA") and DATA.is_dir()), reason="MEASURED_DATA is not set: the folder of real rigs"
)
SMOOTH = 0.2  # s, from the start, that one polynomial follows
END_OF_SPLINE = 0.05  # s: at its end a spline's second derivative is off by 1.1 % of the peak; beyond, by less than 1 %
CORNERS = (2.5, 4.2)  # s, where the prescribed angles have corners in their second derivative
BESIDE = 0.1  # s
SEVERAL = [
    name for name in ENGINES if ("several_drives", ("ideal", "driven")) in declared(name).capabilities.rigid.features
]

Recorded = tuple[Mechanism, np.ndarray, dict[str, np.ndarray], dict[str, np.ndarray]]


def recorded() -> Recorded:
    """The robot, times (s), positions of its motors' joints (rad) and their torques (N.m).

    The file counts the angle of M2 along the crank, from its pivot; the mechanism file's crank has its x axis the
    other way.
    """
    table = np.genfromtxt(DATA / "run.csv", delimiter=",", skip_header=1)
    at = {"M1": table[:, 1], "M2": table[:, 2] + np.pi}
    return load(DATA / "nominal.toml"), table[:, 0], at, {"M1": table[:, 3], "M2": table[:, 4]}


def clear(time: np.ndarray) -> np.ndarray:
    """Which times are beyond the spline's beginning, and not beside a corner."""
    return (time >= END_OF_SPLINE) & np.all([np.abs(time - corner) > BESIDE for corner in CORNERS], axis=0)


@HERE
def test_at_the_start_the_torques_are_adams_within_a_tenth_of_a_newton_metre() -> None:
    """131.237 N.m, at rest for an instant."""
    m, time, at, torques = recorded()
    early = time <= SMOOTH
    fits = {n: np.polynomial.Polynomial.fit(time[early], values[early], 4) for n, values in at.items()}
    found = driven_motion(Assembly(m), time[early], {n: lambda t, k=0, f=f: f.deriv(k)(t) for n, f in fits.items()})
    for name, torque in torques.items():
        assert np.abs(found.drive_loads[name] - torque[early]).max() < 0.1, name
    assert abs(abs(torques["M1"][0]) - 131.237) < 1e-3


@HERE
def test_in_motion_the_torques_are_adams_within_one_percent_of_the_peak() -> None:
    m, time, at, torques = recorded()
    found = driven_motion(Assembly(m), time, {n: CubicSpline(time, values) for n, values in at.items()})
    peak = max(float(np.abs(torque).max()) for torque in torques.values())
    for name, torque in torques.items():
        assert np.abs(found.drive_loads[name] - torque)[clear(time)].max() < 0.01 * peak, name
    assert len(found.undetermined) == 16  # one stress of its own reaches every joint


@HERE
@pytest.mark.slow
@pytest.mark.parametrize("name", SEVERAL)
def test_engines_give_adams_torques_within_one_percent_of_the_peak(name: str) -> None:
    m, time, at, torques = recorded()
    asked = time[clear(time)][::8]
    trace = engine(name).simulate(Request(m, time=asked, courses={n: (time, values) for n, values in at.items()}))
    peak = max(float(np.abs(torque).max()) for torque in torques.values())
    for joint, torque in torques.items():
        off = trace.signals[f"drive_torque_{joint}"] - torque[clear(time)][::8]
        assert np.abs(off).max() < 0.01 * peak, joint


@HERE
def test_the_recorded_torques_are_checked_as_any_programs(tmp_path: Path) -> None:
    columns = tmp_path / "columns.toml"
    columns.write_text(
        '[columns]\n"position_M2 [rad]" = { signal = "position_M2", unit = "rad", offset = 3.141592653589793 }\n',
        encoding="utf-8",
    )
    found = lc.check(DATA / "run.csv", DATA / "nominal.toml", map=columns)
    assert found.verdict == "agrees"
    assert {d.signal for d in found.runs[0].discrepancies} == {"drive_torque_M1", "drive_torque_M2"}
    assert any("statics does not determine the reactions" in warning for warning in found.warnings)
    # without the map nothing closes: the crank would be on the other side of its pivot
    with pytest.raises(lc.Error):
        lc.check(DATA / "run.csv", DATA / "nominal.toml")

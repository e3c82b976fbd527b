"""Play the rig: Exudyn with what measured.toml and nominal.toml do not say, sensors with noise, and a CSV file for each
run.

``python docs/example-rig/make.py [FOLDER]`` writes the files into the folder, or beside itself.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from analytic.kinematics.schedule import Schedule
from analytic.mechanism import Mechanism
from analytic.mechanism.file import load
from compare.diagnose.data.measured_file import Entry, read_file
from sim_models.engine import Request, engine

HERE = Path(__file__).parent
CLEARANCE = {"B": 1.5e-4}  # m: the hidden answer, and so is the next line
DAMPING = {"E": 4e-3}  # N.m.s/rad
SAMPLES = 121
# How the logger writes each signal: unit, its size in SI, decimals (a hundredth of the noise or finer).
COLUMNS = {
    "crank_angle": ("deg", np.pi / 180, 5),
    "coupler_angle": ("deg", np.pi / 180, 5),
    "follower_angle": ("deg", np.pi / 180, 5),
    "follower_x": ("mm", 1e-3, 4),
    "follower_y": ("mm", 1e-3, 4),
    "drive_torque": ("N.m", 1.0, 5),
}


def real(nominal: Mechanism, run: Entry) -> Mechanism:
    """The linkage that stands in the laboratory, as it is loaded and driven in a run."""
    assert nominal.drive is not None
    m = nominal if run.loads is None else nominal.replace(loads=run.loads)
    m = m.replace(drive=nominal.drive.model_copy(update={"speed": run.drive_speed}))
    for joint, damping in DAMPING.items():
        m = m.with_joint(joint, damping=damping)
    return m.with_clearances(CLEARANCE)


def recorded(nominal: Mechanism, run: Entry, seed: int) -> str:
    """The CSV file of a run: one turn of the crank, every pin with clearance on its bearing's wall throughout."""
    assert run.drive_speed is not None
    assert run.drive_angle is not None
    time = np.linspace(0.0, 2 * np.pi / abs(run.drive_speed), SAMPLES)
    command = run.drive_angle + run.drive_speed * time
    linkage = real(nominal, run)
    trace = engine("exudyn").simulate(Request(linkage, "massless-link", Schedule.at_angles(linkage, command)))
    rng = np.random.default_rng(seed)
    columns = [[f"{t:.8f}" for t in time]]
    for signal, (_, size, decimals) in COLUMNS.items():
        clean = command if signal == "crank_angle" else trace.signals[signal]
        noisy = clean + run.noise[signal] * rng.standard_normal(SAMPLES)
        columns.append([f"{value:.{decimals}f}" for value in noisy / size])
    header = ",".join(["time [s]", *(f"{signal} [{unit}]" for signal, (unit, _, _) in COLUMNS.items())])
    return "\n".join([header, *map(",".join, zip(*columns, strict=True))]) + "\n"


def make(folder: Path) -> None:
    """Write the CSV file of every run of measured.toml into a folder."""
    nominal = load(HERE / "nominal.toml")
    for seed, run in enumerate(read_file(HERE / "measured.toml").runs):
        (folder / run.file).write_text(recorded(nominal, run, seed), encoding="utf-8")


if __name__ == "__main__":
    make(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE)

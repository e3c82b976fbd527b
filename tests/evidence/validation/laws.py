"""The law of contact of a pin that rattles, found again: rigs that one engine, or an equation of motion, records and
another engine diagnoses.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np

from analytic.kinematics.schedule import Schedule
from analytic.mechanism import Load, Mechanism
from analytic.mechanism.file import load
from compare.diagnose.effects.joints import ContactLaw
from compare.diagnose.workflow import diagnose
from compare.files import output_folder
from compare.results.diagnosis import Estimate
from sim_models.engine import Request, engine
from tests.evidence.results.validation import LawFound, Sought
from tests.evidence.scoreboard.files import Recording, write_files
from tests.evidence.scoreboard.rattling import by_equation
from tests.evidence.validation.workspaces import digits

SOURCE, EQUATION, SIMULATOR = "exudyn", "equation", "mujoco"
JOINT, CLEARANCE = "B", 5e-4  # m
REVOLUTIONS, SAMPLES = 6, 200  # of each run, in each
SPEEDS = (32.0, -24.0, 22.0)  # rad/s
PLACES = {"crank-rocker": "coupler_y", "slider-crank": "slider_x"}  # measured, beside angle, forces and torque
NOISE = {"x": 0.025, "y": 0.06}  # N, one sigma of a load cell, in a pin that the source tells of
CELL = {SOURCE: "A", EQUATION: JOINT}
TORQUE = {"drive_torque": 5e-4}  # N.m
ANGLE, PLACE = 5e-5, 8e-6  # rad, m
LOADED = {"crank-rocker": "coupler", "slider-crank": "slider"}
LAWS = {
    "crank-rocker": {"restitution": 0.75, "contact_stiffness": 3e6, "friction": 0.1},
    "slider-crank": {"restitution": 0.6, "contact_stiffness": 5e6, "friction": 0.05},
}
PARAMETERS = {"restitution": "restitution", "stiffness": "contact_stiffness", "friction": "friction"}


@dataclass(frozen=True)
class Rig:
    """A linkage as it is, with a law of contact in JOINT, and as it is believed to be; its sensors' noise."""

    real: Mechanism
    believed: Mechanism
    noise: Mapping[str, float]


def rig(case: str, law: Mapping[str, float], source: str = SOURCE) -> Rig:
    """A case with a light load, which a pin with this law in JOINT leaves now and then; believed are neither its
    clearance nor its law.  Its load cell is where the source tells of forces.
    """
    loads = (Load(body=LOADED[case], force=(0.26, 0.4)),)
    believed = load(case).ideal().rigid().replace(gravity=(0.0, 0.0), loads=loads)
    believed = believed.with_joint(JOINT, restitution=None, pin_radius=0.01)
    real = believed.with_joint(JOINT, clearance=CLEARANCE, contact_law="kelvin-voigt", **law)
    forces = {f"reaction_{CELL[source]}_{axis}": sigma for axis, sigma in NOISE.items()}
    return Rig(real, believed, {"crank_angle": ANGLE, PLACES[case]: PLACE} | forces | TORQUE)


def recorded(made: Rig, nominal: Mechanism, folder: Path, source: str = SOURCE, revolutions: int = REVOLUTIONS) -> Path:
    """Three runs of it, with noise, beside a nominal linkage; measured.toml's path."""
    rng, runs = np.random.default_rng(1), []
    for k, speed in enumerate(SPEEDS):
        turned = np.linspace(0.0, 2 * math.pi * revolutions, revolutions * SAMPLES)
        angle = 0.4 + k + np.sign(speed) * turned
        assert made.real.drive is not None
        turning = made.real.replace(drive=made.real.drive.model_copy(update={"speed": speed}))
        told = dict(_seen(turning, angle, source)) | {"crank_angle": angle}
        read = {s: told[s] + sigma * rng.standard_normal(angle.size) for s, sigma in made.noise.items()}
        fields = {"drive_speed": speed, "drive_angle": float(angle[0])}
        runs.append(Recording(f"run-{k + 1}", (angle - angle[0]) / speed, read, fields))
    write_files(output_folder(folder), nominal, runs, {}, made.noise)
    return folder / "measured.toml"


def _seen(turning: Mechanism, angle: np.ndarray, source: str) -> Mapping[str, np.ndarray]:
    """Signals (N,) of a linkage at angles (N,) rad of its crank."""
    if source == EQUATION:
        assert turning.speed
        return by_equation(turning, JOINT, (angle - angle[0]) / turning.speed, float(angle[0])).signals
    return engine(source).simulate(Request(turning, "contact", Schedule.at_angles(turning, angle))).signals


def laws_found(names: Sequence[str]) -> Iterator[LawFound]:
    """The law of each rig whose clearance is known, where both engines are here; a rig takes minutes."""
    if not {SOURCE, SIMULATOR} <= set(names):
        return
    for source, (case, law) in product(CELL, LAWS.items()):
        made = rig(case, law, source)
        with tempfile.TemporaryDirectory() as folder:
            path = recorded(made, made.believed.with_joint(JOINT, clearance=CLEARANCE), Path(folder), source)
            found = diagnose(path, SIMULATOR, only=[ContactLaw.name], others=False, workers=1)
        said = {name: p for e in found.effects if e.name == ContactLaw.name for name, p in e.parameters.items()}
        yield LawFound(
            case=case,
            recorded=source,
            joint=JOINT,
            clearance=CLEARANCE,
            revolutions=REVOLUTIONS * len(SPEEDS),
            verdict=found.verdict,
            parameters={name: _sought(law[of], said.get(name)) for name, of in PARAMETERS.items()},
        )


def _sought(true: float, said: Estimate | None) -> Sought:
    """A parameter beside what was said of it, if anything was."""
    if said is None:
        return Sought(true=true, found=None, low=None, high=None)
    low, high = (None if x is None or not math.isfinite(x) else digits(x, 3) for x in (said.low, said.high))
    return Sought(true=true, found=digits(said.value, 3), low=low, high=high)

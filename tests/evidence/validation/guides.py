"""The slider-crank with clearance in its guide, its block flat on one wall or across on two corners, smooth or
rough.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np

from analytic.kinematics.schedule import Schedule
from analytic.mechanism import Load, Mechanism
from analytic.mechanism.file import load
from compare.arguments import cores
from compare.crosscheck import Job, crosscheck_job
from compare.judge.tolerances import Tolerances
from compare.results.crosscheck import CrossCheck
from sim_models.engine import JointModel, Motion, Request, Unsupported, check_supported, declared

CASE, JOINT = "slider-crank", "S"
CLEARANCE, INERTIA, SPEED = 1e-4, 5e-5, 10.0  # m; kg.m^2; rad/s
STIFFNESS = {"static": 1e9, "driven": 1e7}  # N/m: steps resolve the block's bounces
PRESSED = {
    "flat in its guide": Load(body="slider", force=(0.0, -40.0)),
    "across its guide": Load(body="slider", force=(-60.0, 10.0), torque=6.0),
}
ANGLES = {motion: np.radians(np.arange(3.0, last, 12.0)) for motion, last in (("static", 363.0), ("driven", 123.0))}
RUNS: tuple[tuple[str, Motion], ...] = (
    ("flat in its guide", "static"),
    ("flat in its guide", "driven"),
    ("across its guide", "static"),
)
MODELS: tuple[JointModel, ...] = ("spring-damper", "contact")
FRICTION = 0.2  # Coulomb's coefficient at the corners, of the rough block


def block(pressed: str, motion: Motion, friction: float = 0.0) -> Mechanism:
    """The case with its block pressed so, turning slowly enough for it to rest."""
    m = load(CASE)
    bodies = tuple(b.model_copy(update={"inertia": INERTIA}) if b.name == "slider" else b for b in m.bodies)
    drive = m.drives[0].model_copy(update={"speed": SPEED})
    m = m.replace(bodies=bodies, loads=(PRESSED[pressed],), drive=drive).with_clearances({JOINT: CLEARANCE})
    return m.with_joint(JOINT, contact_stiffness=STIFFNESS[motion], friction=friction)


def guided(names: Sequence[str], tolerances: Tolerances) -> Iterator[tuple[str, CrossCheck]]:
    """What each run is called, and its cross-check: without friction by every joint model, with it in contact."""
    smooth = [(*run, model, 0.0) for run, model in product(RUNS, MODELS)]
    rough: list[tuple[str, Motion, JointModel, float]] = [(*run, "contact", FRICTION) for run in RUNS]
    for pressed, motion, model, friction in [*smooth, *rough]:
        m = block(pressed, motion, friction)
        schedule = Schedule.at_angles(m, ANGLES[motion], at_rest=motion == "static")
        able = tuple(name for name in names if _can(name, Request(m, model, schedule)))
        if able:
            job = Job(m, able, tolerances, schedule, model, workers=cores())
            words = f", friction {friction:g}" if friction else ""
            yield f"block {pressed}{words}, {model}, {motion}", crosscheck_job(job)


def _can(name: str, asked: Request) -> bool:
    """Whether an engine has what a run asks of it."""
    try:
        check_supported(declared(name), asked)
    except Unsupported:
        return False
    return True

"""One linkage at every scale: from a micromechanism to a crane, from a creep to a whirl, with masses far apart.

The shipped crank-rocker, of steel at every size, lifts its own weight and a torque on its follower that keeps the pins
pressed; its radial clearance in B is a 250th of its coupler.  Each engine either agrees with the analytic model there,
or says in a sentence why not.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

from analytic.kinematics.schedule import Schedule
from analytic.mechanism import Drive, Load, Mechanism, MechanismWarning
from analytic.mechanism.file import load
from sim_models.engine import Motion
from tests.evidence.results.validation import AtScale

MOTIONS: tuple[Motion, ...] = ("driven", "static")
LENGTHS = (1e-6, 1e-3, 0.12, 30.0)  # m, of the coupler
SPEEDS = (1e-3, 1.0, 30.0, 1e3)  # rad/s
MASS_RATIOS = (
    1e-9,
    1.0,
    1e9,
)  # of the coupler to what a steel bar would have; 4.5 to either side would be nine decades
GRAVITY = 9.81  # m/s^2
CLEARANCE = 1 / 250  # of the coupler
PRESS = 3.0  # times the linkage's weight and inertia forces, as a torque on the follower
EVERY = 5  # of the scales, one is made again by a check
ANGLES = 12


@dataclass(frozen=True)
class Scale:
    """A length (m), a speed (rad/s) and a ratio of masses."""

    length: float
    speed: float
    mass_ratio: float


def scales() -> list[Scale]:
    """Every combination."""
    return [Scale(*each) for each in product(LENGTHS, SPEEDS, MASS_RATIOS)]


def checked() -> list[Scale]:
    """Those that a check makes again."""
    return scales()[::EVERY]


def linkage(scale: Scale) -> Mechanism:
    """The crank-rocker at a scale."""
    m = load("crank-rocker").rigid()
    size = scale.length / m.moving["coupler"].length

    def grown(points: Mapping[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
        return {name: (x * size, y * size) for name, (x, y) in points.items()}

    bodies = []
    for b in m.bodies:
        mass = b.mass * size**3 * (scale.mass_ratio if b.name == "coupler" else 1.0)
        section = (b.section[0] * size, b.section[1] * size)
        bodies.append(b.model_copy(update={"points": grown(b.points), "mass": mass, "section": section}))
    press = PRESS * max(b.mass for b in bodies) * (GRAVITY + scale.speed**2 * scale.length) * scale.length
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MechanismWarning)  # 30 m are meant
        return m.replace(
            name=f"crank-rocker, {scale.length:g} m",
            gravity=(0.0, -GRAVITY),
            ground=m.ground.model_copy(update={"points": grown(m.ground.points)}),
            bodies=tuple(bodies),
            drive=Drive(joint="D", speed=scale.speed),
            loads=(Load(body="follower", torque=-press),),
        ).with_clearances({"B": CLEARANCE * scale.length})


def scale_rows(simulators: Sequence[str], which: Iterable[Scale], workers: int) -> list[AtScale]:
    """What every joint model of every engine says in both motions at these scales, a row each."""
    from compare.sweep import spread

    todo = [(k, scale, name) for k, (scale, name) in enumerate(product(which, simulators))]
    found: dict[int, list[AtScale]] = {}
    for ended in spread(_of_engine, todo, workers):
        if ended.error is not None:
            raise ended.error
        found[ended.item[0]] = ended.value or []
    return [row for k in sorted(found) for row in found[k]]


def _of_engine(item: tuple[int, Scale, str]) -> list[AtScale]:
    _, scale, simulator = item
    return [row for motion in MOTIONS for row in _runs(scale, simulator, motion)]


def _runs(scale: Scale, simulator: str, motion: Motion) -> Iterator[AtScale]:
    import numpy as np

    from compare.crosscheck import Job, crosscheck_job
    from compare.judge.tolerances import load_tolerances
    from sim_models.engine import Unsupported

    theta = 2 * np.pi * np.arange(ANGLES) / ANGLES
    row = AtScale(
        length=scale.length,
        speed=scale.speed,
        mass_ratio=scale.mass_ratio,
        simulator=simulator,
        run=f"ideal, {motion}",
        verdict="refused",
    )
    try:
        m = linkage(scale)
        schedule = Schedule.at_angles(m, theta, at_rest=motion == "static")
        result = crosscheck_job(Job(m, (simulator,), load_tolerances(), schedule))
    except Unsupported as error:
        yield row.model_copy(update={"why": str(error), "cause": error.cause})
        return
    for run in result.runs:
        yield row.model_copy(update={"run": f"{run.joint_model}, {motion}", "verdict": run.verdict})
    for failure in result.failures:
        yield row.model_copy(
            update={"run": f"{failure.joint_model}, {motion}", "why": failure.why, "cause": failure.cause}
        )

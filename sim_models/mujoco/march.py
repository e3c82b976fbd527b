"""Stepping a MuJoCo linkage from report to report."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from sim_models.common.start import MOST_STEPS, check_steps, substeps
from sim_models.engine import Request
from sim_models.mujoco.limits import check_closed, check_depth, check_together, room_apart
from sim_models.mujoco.model import MujocoLinkage
from sim_models.mujoco.motor import Steering
from sim_models.mujoco.state import (
    apart,
    check_warnings,
    friction_torques,
    gap,
    joint_forces,
    look,
    misclosure,
    on_track,
    signals,
)

MOST_STEPS_IN_MUJOCO = 5_000_000  # of a run that MuJoCo steps by itself: half a minute
SAMPLES = 600  # of a run's journal path, or somewhat more


def most_steps(link: MujocoLinkage) -> int:
    """Steps that a run may take; a contact passes through Python in each of them."""
    return MOST_STEPS if link.touch else MOST_STEPS_IN_MUJOCO


@dataclass
class Log:
    """Samples of a run: each clearance joint's gap (m) and force (N), and when they were taken (s; none at rest)."""

    gaps: dict[str, list[complex]]
    forces: dict[str, list[float]]
    times: list[float] = field(default_factory=list)

    @classmethod
    def of(cls, joints: Iterable[str]) -> Log:
        """An empty log."""
        return cls({name: [] for name in joints}, {name: [] for name in joints})


@dataclass
class MujocoSteps:
    """What a run stepped: the model, its state at the first ``time`` (s), then (steps, their size in s, whether signals
    were taken after them).
    """

    link: MujocoLinkage
    time: float
    q: np.ndarray
    v: np.ndarray
    stages: list[tuple[int, float, bool]] = field(default_factory=list)


def march(
    request: Request,
    link: MujocoLinkage,
    steering: Steering,
    state: tuple[np.ndarray, np.ndarray],
    marks: np.ndarray,
    lead: float,
) -> tuple[dict[str, np.ndarray], Log, MujocoSteps]:
    """Step from mark to mark (s), after the lead-in (s), from a state (nq,), (nv,): signals at the marks, samples of
    the journals between them.

    No step is longer than the linkage's.  Raises SimulationError: the run diverged, came apart, went too deep, or would
    take too long.
    """
    check_steps(
        f"mujoco: {link.mechanism.name}, {request.joint_model} joints",
        lead + float(marks[-1] - marks[0]),
        link.setting.step,
        most_steps(link),
    )
    m, d = link.model, link.data
    d.qpos[:], d.qvel[:] = state
    log = Log.of(link.contacts)
    reported: list[dict[str, float]] = []
    half = (
        0.5 if link.setting.stepped else 0.0
    )  # the velocities of semi-implicit Euler are half a step older than its positions
    time = float(marks[0]) - lead
    steering.place(link, time, 0.0)
    on_track(link)
    record = MujocoSteps(link, time, d.qpos.copy(), d.qvel.copy())
    look(link)
    lag, span, room = 0.0, lead + float(marks[-1] - marks[0]), room_apart(request, link)
    for k, interval in enumerate(np.diff(marks, prepend=time).tolist()):
        count, m.opt.timestep = substeps(interval, link.setting.step) if interval > 0 else (0, link.setting.step)
        if half:
            d.qvel[:] += (lag - half * m.opt.timestep) * d.qacc
            lag = half * m.opt.timestep
        pieces = min(count, math.ceil(SAMPLES * interval / span)) if count else 1
        for piece in range(pieces):
            steps = count * (piece + 1) // pieces - count * piece // pieces
            record.stages.append((steps, m.opt.timestep, piece == pieces - 1))
            steering.turn(link, time, steps)
            time += steps * m.opt.timestep
            steering.place(link, time, lag)
            look(link)
            check_warnings(link, f"{link.mechanism.name}, {request.joint_model} joints, t = {time:.4g} s")
            forces = joint_forces(link, d.efc_force)
            check_together(request, apart(link), room, link.setting.step)
            if not k and piece < pieces - 1:
                continue  # the lead-in
            log.times.append(time)
            for name in link.contacts:
                log.gaps[name].append(gap(link, name))
                log.forces[name].append(abs(forces[name][0]))
        check_closed(request, misclosure(link), link.setting.step)
        reported.append(signals(link, forces, friction_torques(link), d.qvel + lag * d.qacc if half else d.qvel))
    check_depth(request, link.contacts, log.gaps, log.forces)
    values = np.array([list(seen.values()) for seen in reported]).T
    return dict(zip(reported[0], values.copy(), strict=True)), log, record

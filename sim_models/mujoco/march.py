"""Stepping a MuJoCo linkage from report to report."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from sim_models.common.start import MOST_STEPS, check_steps, substeps
from sim_models.engine import Request, Watched
from sim_models.mujoco.block import seat
from sim_models.mujoco.limits import check_closed, check_depth, check_together, room_apart
from sim_models.mujoco.model import MujocoLinkage
from sim_models.mujoco.motor import Steering
from sim_models.mujoco.state import (
    Applied,
    apart,
    check_warnings,
    friction_torques,
    gap,
    joint_forces,
    lean,
    look,
    misclosure,
    on_track,
    pushes,
    signals,
)
from sim_models.mujoco.watch import MujocoWatch

MOST_STEPS_IN_MUJOCO = 5_000_000  # of a run that MuJoCo steps by itself: half a minute
AGEINGS = 40  # each leaves half of the error at most: the time constant of a rigid row is two steps
SAMPLES_OF_JOURNAL = 600  # of a run's journal path, or somewhat more


def most_steps(link: MujocoLinkage) -> int:
    """Steps that a run may take; a contact passes through Python in each of them."""
    return MOST_STEPS if link.kept else MOST_STEPS_IN_MUJOCO


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

    def add(self, link: MujocoLinkage, time: float, forces: Mapping[str, Applied]) -> None:
        """Take a sample."""
        self.times.append(time)
        for name in link.contacts:
            self.gaps[name].append(gap(link, name))
            self.forces[name].append(abs(forces[name][0]))
        for name, corners in pushes(link, link.data.efc_force).items():
            here = seat(link, link.blocks[name])
            self.gaps[name].append(complex(link.blocks[name].guide.reach(here.height, here.tilt)))
            self.forces[name].append(max(corners.values(), default=0.0))


@dataclass
class MujocoSteps:
    """What a run stepped: the model, its state and accelerations at the first ``time`` (s), then (steps, their size in
    s, whether signals were taken after them).
    """

    link: MujocoLinkage
    time: float
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    stages: list[tuple[int, float, bool]] = field(default_factory=list)


def age(link: MujocoLinkage, by: float) -> None:
    """Find forces and accelerations, and make velocities older by a time (s): by the accelerations that there are at
    these older ones, which rows and dampers feel.  That converges wherever steps of twice the time are stable.
    """
    look(link)
    now = link.data.qvel.copy()
    for _ in range(AGEINGS if by else 0):
        link.data.qvel[:] = now - by * link.data.qacc
        look(link)


def march(
    request: Request,
    link: MujocoLinkage,
    steering: Steering,
    state: tuple[np.ndarray, np.ndarray],
    marks: np.ndarray,
    lead: float,
) -> tuple[dict[str, np.ndarray], Log, MujocoSteps, Watched | None]:
    """Step from mark to mark (s), after the lead-in (s), from a state (nq,), (nv,), and on beyond the last: signals at
    the marks, samples of the journals between them, and every step since the first if the request wants it.

    No step is longer than the linkage's.  Raises SimulationError: the run diverged, came apart, went too deep, or would
    take too long.
    """
    beyond = request.beyond / steering.top_speed if request.beyond else 0.0
    check_steps(
        f"mujoco: {link.mechanism.name}, {request.joint_model} joints",
        lead + float(marks[-1] - marks[0]) + beyond,
        link.setting.step,
        MOST_STEPS if request.watched else most_steps(link),
    )
    m, d = link.model, link.data
    d.qpos[:], d.qvel[:] = state
    laws = {**link.contacts, **{name: block.law for name, block in link.blocks.items()}}
    log, after = Log.of(laws), Log.of(laws)  # up to the last report, and beyond
    reported: list[dict[str, float]] = []
    # the velocities of semi-implicit Euler are half a step older than its positions
    half = 0.5 if link.setting.stepped else 0.0
    d.time = time = float(marks[0]) - lead
    steering.place(link, time, 0.0)
    on_track(link)
    if request.start == "centred" and link.setting.stepped:
        lean(link)
    lag = half * link.setting.step
    age(link, lag)
    record = MujocoSteps(link, time, d.qpos.copy(), d.qvel.copy(), d.qacc.copy())
    span, room = lead + float(marks[-1] - marks[0]), room_apart(request, link)
    intervals = [*np.diff(marks, prepend=time).tolist(), *([beyond] if beyond else [])]
    stages = [substeps(each, link.setting.step) if each > 0 else (0, link.setting.step) for each in intervals]
    watch = MujocoWatch(link, float(marks[0]), stages[1:]) if request.watched and link.setting.stepped else None
    for k, (interval, (count, m.opt.timestep)) in enumerate(zip(intervals, stages, strict=True)):
        link.watch, told = watch if k else None, k < marks.size
        if half:
            d.qvel[:] += (lag - half * m.opt.timestep) * d.qacc
            lag = half * m.opt.timestep
        pieces = min(count, math.ceil(SAMPLES_OF_JOURNAL * interval / (span if told else beyond))) if count else 1
        for piece in range(pieces):
            steps = count * (piece + 1) // pieces - count * piece // pieces
            if told:
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
            (log if told else after).add(link, time, forces)
        check_closed(request, misclosure(link), link.setting.step)
        if told:
            reported.append(signals(link, forces, friction_torques(link), d.qvel + lag * d.qacc if half else d.qvel))
    for seen in (log, after) if beyond else (log,):
        check_depth(request, laws, seen.gaps, seen.forces)
    if watch is not None:
        watch.close(lag)
    values = np.array([list(row.values()) for row in reported]).T
    told_of = dict(zip(reported[0], values.copy(), strict=True))
    return told_of, log, record, None if watch is None else watch.watched()

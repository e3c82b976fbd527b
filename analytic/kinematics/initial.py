"""How fast what runs free is when it is let go: the rates of the freedoms that no drive moves, of ``[initial]``."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import kinematics
from analytic.kinematics.schedule import Schedule, ScheduleError
from analytic.mechanism.one_line import count as number_of
from analytic.mechanism.one_line import enumerated

DEPENDENT = 1e-9  # of the largest velocity by a freedom's: rates that so little tells apart are not determined


def set_off(assembly: Assembly, schedule: Schedule) -> Schedule:
    """The schedule with the rates that the mechanism's ``initial`` gives its free freedoms at time 0.

    As many velocities as there are freedoms may be of any joints that no motor moves; with fewer, each is of a joint
    whose position is a freedom, and the freedoms without one start at rest.  At rest nothing has a rate.  Raises
    ScheduleError for velocities that do not say how the linkage moves.
    """
    m, free = assembly.mechanism, _free(assembly, schedule)
    given = m.initial_velocities
    if not given or schedule.at_rest:
        return schedule
    if len(given) > len(free):
        left = f"only {number_of(len(free), 'freedom')} ({', '.join(free)})" if free else "no freedom"
        raise ScheduleError(
            f"{m.name}: initial has the velocity of {enumerated(list(given))}, and its drives leave the linkage {left};"
            f" leave out {'what is too many' if free else 'initial'}, or give a drive speed = 'free'"
        )
    if given.keys() <= set(free):
        return replace(schedule, rates={**schedule.rates, **given})
    others = [name for name in given if name not in free]
    if len(given) < len(free):
        raise ScheduleError(
            f"{m.name}: initial.velocity_{others[0]} alone does not say how {enumerated(free)} move; give a"
            f" velocity to {number_of(len(free), 'joint')}, or to any of these"
        )
    return replace(schedule, rates={**schedule.rates, **_solved(assembly, schedule)})


def _free(assembly: Assembly, schedule: Schedule) -> list[str]:
    """The joints whose positions are freedoms that nothing moves."""
    return [name for name in assembly.positions if name not in schedule.drives]


def _solved(assembly: Assembly, schedule: Schedule) -> dict[str, float]:
    """Rates (rad/s, m/s) of the free freedoms with which joints have the velocities of ``initial``."""
    m, free = assembly.mechanism, _free(assembly, schedule)
    given = m.initial_velocities
    now, count = np.zeros(1), 1 + len(free)  # the drives' rates alone, and a unit of each freedom's
    where = {n: np.full(count, x) for n, x in assembly.positions.items()}
    where |= {n: np.repeat(x, count) for n, x in schedule.positions(now).items()}
    rates = {n: np.eye(count)[1 + k] for k, n in enumerate(free)}
    rates |= {n: x * np.eye(count)[0] for n, x in schedule.positions(now, 1).items()}
    inputs, moving = assembly.inputs_at(where), assembly.inputs_at(rates)
    motion = kinematics(assembly, inputs, moving, np.zeros(moving.shape))
    slips = np.array([motion.slip(m.joint(name)) for name in given])
    by_freedom = slips[:, 1:]
    sizes = np.linalg.svd(by_freedom, compute_uv=False)
    if not sizes[-1] > DEPENDENT * sizes[0]:
        raise ScheduleError(
            f"{m.name}: the velocities of {enumerated(list(given))} in initial do not say how {enumerated(free)}"
            " move: where the linkage starts they depend on each other, or on its drives; give one to each of"
            f" {', '.join(free)}"
        )
    found = np.linalg.solve(by_freedom, np.array(list(given.values())) - slips[:, 0])
    return dict(zip(free, found.tolist(), strict=True))

"""When an FMU is asked and what it is told: communication points that hit the requested instants, and its inputs there.

An FMU holds its inputs from one communication point to the next.  It is told, before each step, what they are at the
step's end, so that what it gives there belongs to the same instant as they do.  A speed without an angle is told as the
mean over the step, which turns the crank as far as it has to turn.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from analytic.kinematics.schedule import DriveMotion
from sim_models.common.start import MOST_STEPS
from sim_models.fmu.description import FmuError
from sim_models.fmu.mapping import Map, MappedVariable, Moved

OF_A_TURN = 1000  # steps, where nobody says how long they are
SAME_INSTANT = 1e-9  # of a step, by which instants may differ that are one
EQUAL_STEPS = 1e-6  # of a step, by which equal ones may differ
WASTE = 4  # how many times as many steps are taken so that they are equal


@dataclass(frozen=True)
class StepPlan:
    """Communication points (P,) s from 0 on, which of them are reported, and the inputs (P, K) as the FMU is told them.

    ``begin`` (s) is the motors' time at the first point; ``starts`` (rad, or m) are their positions there.
    """

    points: np.ndarray
    reported: np.ndarray
    inputs: np.ndarray
    begin: float
    starts: tuple[float, ...]
    step: float

    def place(self, times: np.ndarray) -> np.ndarray:
        """Row (N,) of each of the requested times (s) among those that are reported."""
        there, wanted = self.points[self.reported], times - self.begin
        return np.searchsorted((there[1:] + there[:-1]) / 2, wanted)


def scheduled(
    columns: Map,
    drives: Sequence[tuple[Mapping[Moved, MappedVariable], DriveMotion]],
    times: np.ndarray,
    step: float | None = None,
) -> StepPlan:
    """The plan of a run that is reported at times (N,) s of its motors, each with its inputs, in steps (s) of the map
    where none is given.

    Raises FmuError.
    """
    motors = [motor for _, motor in drives]
    begin, top_speed = max(motor.begin for motor in motors), max(motor.top_speed for motor in motors)
    if motors[0].constant_speed:
        begin -= columns.file.lead_in / top_speed
    elif columns.file.lead_in:
        what = f"lead_in = {columns.file.lead_in:g} rad is of a crank that turns evenly, and this motion is a course"
        raise FmuError(f"{columns.path}: {what}; leave it out")
    step = step or columns.step or 2 * np.pi / (top_speed or 1.0) / OF_A_TURN
    wanted = np.unique(times - begin)
    wanted = wanted[np.concatenate([[True], np.diff(wanted) > SAME_INSTANT * step])]
    nodes = wanted if wanted[0] <= 0 else np.concatenate([[0.0], wanted])
    steps = (nodes[-1] - nodes[0]) / step + nodes.size
    if steps > MOST_STEPS:
        where = f"{columns.path}: step" if columns.file.step else f"{columns.fmu.path}: its default step"
        raise FmuError(
            f"{where} = {step:g} s: {steps:.3g} steps would be taken, and at most {MOST_STEPS} are; give a larger step"
            " in the map, or ask for less"
        )
    counts = _counts(columns, np.diff(nodes), step)
    parts = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(nodes[:-1], nodes[1:], counts, strict=True)]
    points = np.concatenate([*parts, nodes[-1:]])
    reported = np.concatenate([[0], np.cumsum(counts)])[nodes.size - wanted.size :]
    return StepPlan(
        points=points,
        reported=reported,
        inputs=np.column_stack([told for links, motor in drives for told in _told(links, motor, points + begin)]),
        begin=begin,
        starts=tuple(float(motor.positions(np.array([begin]))[0]) for motor in motors),
        step=float(np.diff(points).max(initial=0.0)),
    )


def _counts(columns: Map, gaps: np.ndarray, step: float) -> np.ndarray:
    """How many steps there are between nodes: equal ones where that takes not many more.  Raises FmuError."""
    if not gaps.size:
        return np.zeros(0, int)
    fewest = np.ceil(gaps / step * (1 - EQUAL_STEPS)).astype(int)
    equal = gaps.min() / fewest[np.argmin(gaps)]
    even = np.rint(gaps / equal).astype(int)
    if np.allclose(even * equal, gaps, rtol=0, atol=EQUAL_STEPS * equal) and even.sum() <= WASTE * fewest.sum():
        return even
    if columns.fmu.even:
        raise FmuError(
            f"{columns.fmu.path}: it takes equal steps only (canHandleVariableCommunicationStepSize is false), and the"
            " requested instants are not evenly spaced; ask for evenly spaced crank angles"
        )
    return fewest


def _told(links: Mapping[Moved, MappedVariable], motor: DriveMotion, times: np.ndarray) -> Iterator[np.ndarray]:
    """What the inputs of a motor (P,) are told, in the order of the map; where it starts is none of them."""
    rates: dict[Moved, np.ndarray] = {
        "position": motor.positions(times),
        "speed": motor.positions(times, 1),
        "acceleration": motor.positions(times, 2),
    }
    if "position" not in links and times.size > 1:
        rates["speed"] = np.concatenate([rates["speed"][:1], np.diff(rates["position"]) / np.diff(times)])
    for name, values in rates.items():
        if name in links:
            yield links[name].number(values)

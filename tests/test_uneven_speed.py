"""The displaced linkage on a crank that speeds up: its gaps' rates against differences in time, found at other
moments.
"""

from __future__ import annotations

import numpy as np
import pytest

from analytic.kinematics.assembly import Assembly
from analytic.mechanism.file import load
from analytic.paper.clearance import Displaced, displaced

SMALL = 1e-8  # m: the gaps' own inertia, which the second pass adds to the reactions, turns them by as little
MOMENT = 1e-4  # s


def speeding_up(
    assembly: Assembly, time: np.ndarray, speed: float, acceleration: float, pins: str, known: bool = True
) -> Displaced:
    """At times (s) after the crank left its assembly angle at that speed; ``known`` says whether its acceleration is
    told.
    """
    theta, omega = assembly.start + speed * time + acceleration * time**2 / 2, speed + acceleration * time
    return displaced(
        assembly, theta, omega, alpha=acceleration if known else 0.0, clearances=dict.fromkeys(pins, SMALL)
    )


@pytest.mark.parametrize(
    ("case", "speed", "acceleration", "pins"),
    [("slider-crank", 8.0, 60.0, "AB"), ("paper", -2.0, -9.0, "B"), ("paper", -0.3, 9.0, "B")],
)
def test_gaps_move_as_they_do_from_one_moment_to_the_next(
    case: str, speed: float, acceleration: float, pins: str
) -> None:
    assembly, time = Assembly(load(case)), np.linspace(0.0, 0.1, 6)
    before, here, after = (speeding_up(assembly, time + k * MOMENT, speed, acceleration, pins) for k in (-1, 0, 1))
    without = speeding_up(assembly, time, speed, acceleration, pins, known=False)
    assert not here.flags
    for pin in pins:
        column = assembly.structure.gap_column(pin)
        rate = (after.gaps[pin] - before.gaps[pin]) / (2 * MOMENT)
        bend = (after.gaps[pin] - 2 * here.gaps[pin] + before.gaps[pin]) / MOMENT**2
        told, untold = here.configuration.motion, without.configuration.motion
        assert np.abs(told.column_rates[column] - rate).max() < 1e-3 * np.abs(rate).max()
        assert np.abs(told.column_accelerations[column] - bend).max() < 1e-3 * np.abs(bend).max()
        assert (
            np.abs(untold.column_accelerations[column] - bend).max() > 0.3 * np.abs(bend).max()
        )  # the acceleration does matter


def test_every_angle_has_its_own_speed() -> None:
    m = load("crank-rocker")
    assembly, theta, omega = Assembly(m), np.radians([20.0, 70.0, 250.0]), np.array([9.0, -4.0, 0.0])
    together = displaced(assembly, theta, omega, clearances={"B": 1e-4}).signals()
    for k in range(3):
        alone = displaced(assembly, theta[k : k + 1], float(omega[k]), clearances={"B": 1e-4}).signals()
        for name, values in alone.items():
            np.testing.assert_allclose(together[name][k], values[0], rtol=1e-9, atol=1e-12, err_msg=name)


def test_a_crank_that_is_about_to_start_has_gaps_that_accelerate_with_it() -> None:
    m = load("slider-crank")
    assembly = Assembly(m)
    still = displaced(assembly, assembly.start + np.zeros(1), 0.0, alpha=40.0, clearances={"B": SMALL})
    later = displaced(
        assembly, assembly.start + 20.0 * MOMENT**2 * np.ones(1), 40.0 * MOMENT, alpha=40.0, clearances={"B": SMALL}
    )
    bend = 2 * (later.gaps["B"] - still.gaps["B"]) / MOMENT**2  # from rest: as much before as after
    column = assembly.structure.gap_column("B")
    np.testing.assert_allclose(still.configuration.motion.column_rates[column], 0.0, atol=1e-9 * SMALL)
    found = still.configuration.motion.column_accelerations[column]
    assert (
        np.abs(found - bend).max() < 0.02 * np.abs(bend).max()
    )  # both neighbours are ahead: of first order in the stencil

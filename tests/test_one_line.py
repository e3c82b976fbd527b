"""What results look like at a prompt: one line, whatever arrays they hold."""

from __future__ import annotations

import numpy as np
import pytest

from analytic.beyond_paper.drive import Motor
from analytic.beyond_paper.freedom import Freedom
from analytic.beyond_paper.monte_carlo import Population, draw
from analytic.beyond_paper.released import released
from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import Gap
from analytic.kinematics.output import Output
from analytic.kinematics.schedule import Schedule, Steady
from analytic.mechanism.file import load
from analytic.mechanism.one_line import LONGEST_LINE, angles, clearances, one_line
from analytic.paper.clearance import displaced
from analytic.paper.printed import FourBar, four_bar_motion
from analytic.paper.superposition import AccuracyAnalysis, accuracy
from compare.judge.reference import reference

THETA = np.radians(np.arange(20.0, 161.0, 5.0))
PAPER, LOOSE = Assembly(load("paper")), {"B": 1e-4, "E": 1e-4}
AT_REST = Schedule.at_angles(PAPER.mechanism, THETA, at_rest=True)


def analysed() -> AccuracyAnalysis:
    """The paper's case with clearance in two joints, and two outputs of it."""
    return accuracy(PAPER, THETA, [Output("coupler", "x"), Output("coupler", "y")], LOOSE)


FOUND = analysed()
TOTAL = FOUND.total
SAMPLES = draw(FOUND.clearances, 0.1 * FOUND.clearances, 50, seed=1)
POPULATION = Population(PAPER, TOTAL.clearance.ideal.motion, FOUND.path, FOUND.unit_reactions, FOUND.directions)
DISTRIBUTION = POPULATION.distribution(SAMPLES, "free")
FOUR_BAR = FourBar(0.4, (0.2, 0.4, 0.2), (0.1, 0.2, 0.1), (0.157, 0.314, 0.157), (5e-4, 4e-3, 5e-4))

LINES = {
    "Mechanism(paper, 3 moving links, 4 joints, drive D at 1.571 rad/s, clearance B 0.01 m)": load("paper"),
    "Mechanism(pendulum, 1 moving link, 1 joint, drive O free, no clearance)": load("pendulum"),
    "Assembly(paper, assembled at 30 deg)": PAPER,
    "Structure(paper, 4 joints, 1 Assur group)": PAPER.structure,
    "CrankTable(6 crank angles 28..32 deg)": Assembly(load("paper")).path(np.radians(28.0), np.radians(32.0)),
    "Gap(2 values, up to 0.002 m)": Gap(np.array([0.001j, 0.002])),
    "Motion(paper, 29 crank angles 20..160 deg)": TOTAL.clearance.ideal.motion,
    "Reactions(paper, 29 crank angles 20..160 deg, up to 73.1 N, drive torque up to 9.4 N.m)": TOTAL.clearance.ideal,
    "Displaced(paper, equilibrium, 29 crank angles 20..160 deg, clearance B 0.01 m)": displaced(PAPER, THETA),
    "Displaced(crank-rocker, first_order, 1 crank angle 30 deg, no clearance)": displaced(
        Assembly(load("crank-rocker")), np.radians([30.0]), model="first_order"
    ),
    "Compliance(paper, 29 crank angles 20..160 deg, up to 0.00114 m)": TOTAL.compliance,
    "Total(Displaced(paper, equilibrium, 29 crank angles 20..160 deg, clearance B 0.0001 m, E 0.0001 m), "
    "Compliance(paper, 29 crank angles 20..160 deg, up to 0.00114 m))": TOTAL,
    "AccuracyAnalysis(paper, 29 crank angles 20..160 deg, clearance B 0.0001 m, E 0.0001 m, 2 outputs, "
    "0 side changes)": FOUND,
    "Samples(50 linkages, 4 joints, up to 0.00011 m)": SAMPLES,
    "Population(paper, 29 crank angles 20..160 deg, 2 outputs)": POPULATION,
    "Distribution(2 outputs, 1 point)": DISTRIBUTION,
    "OutputSpread(29 crank angles, sigma up to 0.000157)": DISTRIBUTION.spreads[Output("coupler", "y")],
    "Turning(2 moments 0..57.3 deg)": Motor(Steady(0.0, 1.0)).at(np.array([0.0, 1.0])),
    "Freedom(720 crank angles)": Freedom.of(Assembly(load("crank-rocker"))),
    "Reference(44 signals, 29 samples)": reference(PAPER, AT_REST, "first_order", LOOSE),
    "FourBarMotion(29 crank angles 20..160 deg)": four_bar_motion(FOUR_BAR, THETA, 1.0),
}


@pytest.mark.parametrize("expected", LINES)
def test_a_result_is_one_line(expected: str) -> None:
    check_line(LINES[expected], expected)


def test_a_released_linkage_is_one_line() -> None:
    swung = released(Assembly(load("pendulum")), np.linspace(0.0, 0.1, 11))  # by compiled code: not at collection
    check_line(swung, "Released(pendulum, 11 moments -14.02..0 deg)")


def check_line(result: object, expected: str) -> None:
    text = repr(result)
    assert text == expected
    assert str(result) == expected
    assert len(text) <= LONGEST_LINE


def test_long_names_and_many_joints_are_cut_short() -> None:
    many = {f"joint-{'x' * 90}-{i}": 1e-3 * (i + 1) for i in range(7)}
    assert clearances(many) == "clearance in 7 joints up to 0.007 m"
    text = one_line(Gap(np.zeros(1)), "two\nlines", "x" * 300)
    assert len(text) == LONGEST_LINE
    assert "\n" not in text
    assert text.endswith("...)")


def test_angles_without_a_number_are_counted_only() -> None:
    assert angles(np.full(3, np.nan)) == "3 crank angles"
    assert angles(np.radians([-1e-12, 90.0, np.nan])) == "3 crank angles 0..90 deg"

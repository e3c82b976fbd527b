"""Runs of one mechanism are evaluated together, and read as each alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from analytic.beyond_paper.drive import Motor
from analytic.kinematics.assembly import Assembly
from analytic.kinematics.schedule import Steady
from analytic.mechanism import Load
from analytic.paper.clearance import displaced
from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.diagnose.predict import Hypothesis, Model, Term
from diagnosis_rigs import experiment, four_bar, turn

PLANS = (
    turn("slow", 4.0),
    turn("fast-reverse", -12.0, samples=77),
    turn("loaded", 6.0, loads=(Load(body="coupler", force=(9.0, 4.0)),)),
    turn("follows", 5.0, follows=True),
    turn("follows-too", -5.0, follows=True),  # at the same times, another course
)
RIG = experiment(*PLANS)
Things = Sequence[tuple[str, str, dict[str, float]]]


def model(*which: int) -> Model:
    """The model of some of the runs."""
    measured = RIG.measured()
    measured = replace(measured, runs=tuple(measured.runs[i] for i in which))
    courses = {p.name: Motor(CubicSpline(p.time, p.command(p.time))) for p in PLANS if p.follows}
    return Model(measured, RIG.rig, RIG.nominal, courses)


def hypothesis(things: Things) -> Hypothesis:
    return [(Term(VOCABULARY[name], where), values) for name, where, values in things]


@pytest.mark.long_rows("drive_compliance+viscous_friction", "joint_clearance")
@pytest.mark.parametrize(
    "things",
    [
        [],
        [("payload", "coupler", {"mass": 0.05, "along": 0.02, "normal": 0.01})],
        [("drive_compliance", "drive", {"stiffness": 300.0}), ("viscous_friction", "B", {"damping": 0.02})],
        [("speed_ripple", "drive", {"amplitude": 2e-3, "harmonic": 3.0, "phase": 0.3})],
        [("joint_clearance", "B", {"radial_clearance": 1e-4})],
        [("link_flexibility", "linkage", {"youngs_modulus": 3e10})],
        [
            ("encoder_offset", "crank_angle", {f"offset@{p.name}": 0.01 * k for k, p in enumerate(PLANS)}),
            ("sensor_lag", "drive_torque+reaction_E_x", {"time_constant": 4e-3}),
            ("sensor_delay", "follower_angle", {"delay": 2e-3}),
            ("sensor_drift", "coupler_x", {"drift": 1e-3}),
            ("clock_offset", "slow", {"offset": 3e-3}),
            ("sensor_frame", "E", {"rotation": 0.2}),
        ],
    ],
    ids=lambda things: "+".join(name for name, _, _ in things) or "nothing",
)
def test_runs_read_together_as_each_alone(things: Things) -> None:
    together = model(*range(len(PLANS)))([hypothesis(things)])[0]
    assert together is not None
    for i, plan in enumerate(PLANS):
        alone = model(i)([hypothesis(things)])[0]
        assert alone is not None
        assert set(together[i]) == set(alone[0]) == set(RIG.noise)
        for signal, values in alone[0].items():
            assert values.shape == plan.time.shape
            np.testing.assert_allclose(together[i][signal], values, rtol=1e-12, atol=1e-12, err_msg=signal)


def test_what_is_kept_of_one_hypothesis_is_not_read_under_another() -> None:
    """Readings are kept by what moves the linkage: sensors' faults share them, other linkages do not."""
    kept = model(*range(len(PLANS)))
    plain: Things = []
    heavy: Things = [("payload", "coupler", {"mass": 0.05, "along": 0.0, "normal": 0.0})]
    late: Things = [("sensor_delay", "follower_angle", {"delay": 2e-3})]
    turned: Things = [("encoder_offset", "crank_angle", {"offset": 0.02})]  # which the motor of some runs follows
    asked = [hypothesis(things) for things in (plain, heavy, late, turned, plain)]
    found = kept(asked)
    assert None not in found
    fresh = [model(*range(len(PLANS)))([each])[0] for each in asked]
    for one, other in zip(found, fresh, strict=True):
        assert one is not None
        assert other is not None
        for a, b in zip(one, other, strict=True):
            for signal in a:
                np.testing.assert_allclose(a[signal], b[signal], rtol=1e-12, atol=1e-12)
    read = [readings for readings in found if readings is not None]
    assert np.abs(read[1][0]["drive_torque"] - read[0][0]["drive_torque"]).max() > 1e-3
    assert np.abs(read[2][0]["follower_angle"] - read[0][0]["follower_angle"]).max() > 1e-4
    assert np.abs(read[3][3]["follower_angle"] - read[0][3]["follower_angle"]).max() > 1e-3, "its motor is elsewhere"
    np.testing.assert_allclose(read[3][0]["follower_angle"], read[0][0]["follower_angle"], atol=1e-12)


def test_where_no_pin_has_a_place_of_rest_what_clearance_changes_goes_on_as_before_and_after() -> None:
    """A straight line of the readings themselves would be off by hundreds of times what a little clearance changes."""
    plans = (turn("slow", 4.0), turn("fast-reverse", -12.0))
    rig = experiment(*plans, mechanism=four_bar(loads=()))
    predicted = Model(rig.measured(), rig.rig, rig.nominal, {})
    large = 2.4e-5  # m
    crank = Motor(Steady(plans[1].angle, -12.0)).at(plans[1].time)
    assembly = Assembly(rig.nominal.with_joint("D", clearance=large))
    lost = displaced(assembly, crank.theta, crank.omega, alpha=crank.alpha).signals()
    assert 0 < np.isnan(lost["drive_torque"]).sum() < 10
    found = predicted([hypothesis([("joint_clearance", "D", {"radial_clearance": c})]) for c in (0.0, 2.4e-7, large)])
    none, little, much = (each for each in found if each is not None)
    for signal in ("follower_angle", "coupler_x"):
        changes = [(each[1][signal] - none[1][signal]) / c for each, c in ((little, 2.4e-7), (much, large))]
        assert np.abs(changes[1] - changes[0]).max() < 0.2 * np.abs(changes[0]).max()

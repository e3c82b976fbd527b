"""One table for every engine: the same linkages, joint models and motions, judged by the shipped tolerances.

Rows come from what each engine declares; an engine that is not installed is skipped by name.
"""

from __future__ import annotations

import numpy as np
import pytest

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.reach import usual_angles
from analytic.mechanism import Mechanism, PeriodicTorque
from analytic.mechanism.file import load
from analytic.paper.clearance import displaced
from asked import job_of
from compare.crosscheck import crosscheck_job
from compare.judge.tolerances import load_tolerances
from engine_checks import at_speed
from marks import slow_but
from sim_models.engine import ENGINES, JOINT_MODELS, MOTIONS, JointModel, Motion, declared

GRAVITY = (0.0, -9.81)


def loaded_crank_rocker() -> Mechanism:
    """60 rpm and a steady pull on the follower, so that every pin stays on its rim all round."""
    pull = [{"body": "follower", "point": "B", "force": (40.0, 10.0)}]
    return at_speed(load("crank-rocker"), 6.0).replace(loads=pull)


def loaded_slider_crank() -> Mechanism:
    push = [{"body": "slider", "force": (-60.0, 0.0)}]
    return at_speed(load("slider-crank"), 6.0).replace(gravity=GRAVITY, loads=push)


def turned(m: Mechanism) -> Mechanism:
    return at_speed(m, -float(m.speed or 0.0))


TURN = np.radians(np.arange(10.0, 360.0, 50.0))
PAPER = np.radians(np.arange(20.0, 161.0, 20.0))
PIVOTS = {"D": 1e-4, "A": 2e-4, "B": 1e-4, "E": 2e-4}
CASES = {
    "paper": (load("paper"), PAPER),
    "gravity": (load("paper").with_clearances({"B": 1e-3}).replace(gravity=GRAVITY), PAPER),
    "oblique load": (
        load("paper")
        .with_clearances({"B": 1e-3})
        .replace(loads=[{"body": "coupler", "point": "com", "force": (30.0, 40.0)}]),
        PAPER,
    ),
    "joint friction": (
        load("paper").with_clearances({"B": 1e-3}).with_joint("E", friction_torque=0.2, damping=0.05),
        PAPER,
    ),
    "joint spring": (load("paper").with_clearances({"B": 1e-3}).with_joint("A", stiffness=2.0, rest_angle=0.3), PAPER),
    "Stribeck friction": (  # damped, as friction that falls with speed makes a loose pin swing up
        load("paper")
        .with_clearances({"B": 1e-3})
        .with_joint("E", friction_torque=0.1, static_torque=0.3, stribeck_speed=5.0, damping=0.05),
        PAPER,
    ),
    "drag": (load("paper").with_clearances({"B": 1e-3}).with_joint("E", drag=0.01), PAPER),
    "spring that is not linear": (
        load("paper").with_clearances({"B": 1e-3}).with_joint("A", stiffness=1.0, cubic=2.0, rest_angle=0.3),
        PAPER,
    ),
    "periodic torque": (
        at_speed(
            load("paper").with_clearances({"B": 1e-3}),
            load("paper").speed or 0.0,
            periodic_torque=PeriodicTorque(amplitude=0.2, harmonic=7),
        ),
        PAPER,
    ),
    "several clearances": (load("paper").with_clearances(PIVOTS), PAPER),
    "reverse rotation": (turned(load("paper").with_clearances({"B": 1e-3})), PAPER),
    "crank-rocker": (loaded_crank_rocker().with_clearances({"B": 2e-4}), TURN),
    "slider-crank": (loaded_slider_crank().with_clearances({"B": 2e-4}), TURN),
    "six-bar": (load("six-bar").with_clearances({"B": 1e-4, "F": 1e-4}), TURN),
}
# At rest every case is in the short part with ideal joints.  In motion a case takes up to seconds: of ideal joints
# MuJoCo does every law and each other engine a few, of pins that yield those that take less.
LAWS = {
    "gravity", "oblique load", "joint friction", "Stribeck friction", "drag", "joint spring",
    "spring that is not linear", "periodic torque", "reverse rotation",
}  # fmt: skip
SHARED_LAWS = {"reverse rotation"}
YIELDING = {
    ("mujoco", "massless-link", "driven"): {"joint friction"},
    ("mujoco", "spring-damper", "driven"): {"reverse rotation"},
    ("mujoco", "contact", "driven"): {"crank-rocker"},
    ("mujoco", "contact", "static"): {"joint friction"},
    ("exudyn", "massless-link", "driven"): {"reverse rotation"},
    ("exudyn", "contact", "static"): {"joint friction"},
    ("pybullet", "contact", "static"): {"slider-crank"},
    ("dart", "contact", "static"): {"joint friction"},
}


def quick(name: str, model: JointModel, motion: Motion, case: str) -> bool:
    if model == "ideal":
        return case != "several clearances" and (
            motion == "static" or case in (LAWS if name == "mujoco" else SHARED_LAWS)
        )
    return case in YIELDING.get((name, model, motion), ())


ABLE: list[tuple[str, JointModel, Motion]] = [
    (name, model, motion)
    for name in ENGINES
    for motion in MOTIONS
    for model in JOINT_MODELS
    if (model, motion) in declared(name).capabilities.runs
]
IN_TURN = sorted(LAWS)  # beside a pin that yields: what stands in another joint is the same to every model of this one


def asked(k: int, model: JointModel) -> list[str]:
    """Cases of the k-th row of ABLE: of ideal joints, which have no clearance, all linkages and laws; of others all
    linkages and three laws in turn.
    """
    if model == "ideal":
        return [case for case in CASES if case != "several clearances"]
    laws = {IN_TURN[(3 * k + i) % len(IN_TURN)] for i in range(3)}
    return [case for case in CASES if case in laws or case not in LAWS]


ROWS: list[tuple[str, JointModel, Motion, str]] = [
    (*row, case) for k, row in enumerate(ABLE) for case in CASES if case in asked(k, row[1]) or quick(*row, case)
]


@pytest.mark.long_rows(
    "mujoco-ideal-driven-spring that is not linear", "mujoco-ideal-driven-Stribeck friction",
    "mujoco-contact-static-joint friction", "pybullet-ideal-driven-reverse rotation", "mujoco-ideal-driven-drag",
    "exudyn-massless-link-driven-reverse rotation", "mujoco-contact-driven-crank-rocker",
    "mujoco-ideal-driven-periodic torque", "mujoco-spring-damper-driven-reverse rotation",
    "pybullet-contact-static-slider-crank", "mujoco-massless-link-driven-joint friction", "mujoco-ideal-driven-gravity",
    "mujoco-ideal-driven-joint friction", "dart-ideal-driven-reverse rotation", "mujoco-ideal-driven-reverse rotation",
    "mujoco-ideal-driven-joint spring", "mujoco-ideal-driven-oblique load", "dart-contact-static-joint friction",
)  # fmt: skip
@pytest.mark.parametrize(("name", "model", "motion", "case"), slow_but([row for row in ROWS if quick(*row)], ROWS))
def test_an_engine_agrees_with_the_analytic_model(name: str, model: JointModel, motion: Motion, case: str) -> None:
    mechanism, theta = CASES[case]
    result = crosscheck_job(job_of(mechanism, (name,), load_tolerances(), motion, theta, joint_model=model))
    assert not result.failures, result.failures[0].why
    (run,) = result.runs
    differ = [
        f"{d.signal} {d.max:+.3g} ({d.tolerance:.3g}) at {np.degrees(d.at_crank_angle):.0f} deg"
        for d in run.discrepancies
        if d.verdict != "agrees"
    ]
    assert not differ, "; ".join(differ)


def test_every_case_keeps_contact_by_its_analytic_model() -> None:
    for case, (mechanism, theta) in CASES.items():
        assert not displaced(Assembly(mechanism), theta, mechanism.speed or 1.0).flags, case


def test_the_shipped_default_grid_is_the_papers() -> None:
    np.testing.assert_allclose(
        np.degrees(usual_angles(Assembly(load("paper")))), np.arange(20.0, 161.0, 5.0), atol=1e-9
    )

"""What DART and PyBullet share: a leapfrog's steps, how laws of contact strike in them, how a gap yields to a force."""

from __future__ import annotations

import math

import numpy as np
import pytest

from analytic.mechanism.file import load
from analytic.mechanism.parts import ContactLaw
from asked import request_of
from rebounds import law_of
from sim_models.common.contact_laws import NamedLaw, delivered
from sim_models.common.mobility import mobility
from sim_models.common.start import Pose
from sim_models.leapfrog.striking import LeapfrogStriking
from sim_models.run.path import CrankPath
from tests.evidence.validation.rebounds import hanging
from tests.evidence.validation.striking import LAWS


def strike(law: NamedLaw, mass: float, phase: float, late: float) -> float:
    """Restitution of a mass that strikes a wall at 1 m/s in a leapfrog's steps, of this share of its contact's phase
    and ``late`` by that share of a step.
    """
    h = phase * math.sqrt(mass / (law.stiffness * (1 + law.hysteresis)))
    striking = LeapfrogStriking(law, 1.0, lambda: np.eye(2) / mass)
    place, speed = 1.0 - (1 + late) * h, 1.0
    while speed > 0 or place > 1.0:
        speed -= striking.push(complex(place), complex(speed), h / 2).real * h / mass
        place += h * speed
    return -speed


@pytest.mark.parametrize("law", LAWS)
def test_restitution_is_of_second_order_in_the_step(law: ContactLaw) -> None:
    m = hanging(law, 0.7, 1e8)
    named, mass = law_of(m, "O"), m.bodies[0].mass
    promised = named.asked if law == "kelvin-voigt" else delivered(named.hysteresis)
    off = [
        max(abs(strike(named, mass, phase, late) - promised) for late in np.arange(20) / 20)
        for phase in (0.2, 0.1, 0.05)
    ]
    assert off[0] < 6e-3
    assert off[1] < off[0] / 2.5
    assert off[2] < off[1] / 2.5


def test_a_law_that_damps_beyond_all_measure_does_not_shake() -> None:
    """A pin at rest on its wall, pressed: its law's damping is that of the slowest touch."""
    law = NamedLaw("flores", 1e7, 0.0, 30.0, 1e-6, 0.05)
    striking, h, mass, load = LeapfrogStriking(law, 1e-3, lambda: np.eye(2) / 0.1), 1e-5, 0.1, 50.0
    place, speed = 1e-3 + load / law.stiffness, 0.0
    for k in range(2000):
        force = striking.push(complex(place), complex(speed), h / 2).real
        assert force == pytest.approx(load, rel=0.05)
        speed += (load * (1 + 0.02 * math.sin(k / 50)) - force) * h / mass
        place += h * speed


@pytest.mark.parametrize(
    ("name", "case", "joint"),
    [
        ("dart", "crank-rocker", "B"),
        ("dart", "crank-rocker", "D"),
        ("dart", "six-bar", "F"),
        ("pybullet", "crank-rocker", "A"),
        ("pybullet", "slider-crank", "B"),
    ],
)
def test_a_gap_yields_to_a_force_as_in_the_engine(name: str, case: str, joint: str) -> None:
    m = load(case).with_joint(joint, clearance=1e-4)
    if name == "dart":
        from sim_models.dart.engine import DartRun as EngineRun
    else:
        from sim_models.pybullet.run import BulletRun as EngineRun
    run, h = EngineRun(request_of(m, "spring-damper", "driven", np.array([1.0]))), 1e-5
    world = run.world_class(run.request, run.path)
    at: dict[str, Pose] = CrankPath(world.path.assembly).poses(1.0)
    speeds = []
    for force in (0j, 1 + 0j, 1j):
        world.place(at)
        world.pull(m.joint(joint), force)
        world.advance(h)
        speeds.append(-world.gap(joint)[1])
    world.close()
    columns = [(speed - speeds[0]) / h for speed in speeds[1:]]
    found = np.array([[c.real for c in columns], [c.imag for c in columns]])
    others = [j for j in m.joints if j.name != joint]
    ours = mobility(m, at, m.joint(joint), others, [m.drive_joint])
    np.testing.assert_allclose(ours, found, atol=1e-5 * np.abs(found).max())

"""The referee without stiffness, refereed: closed forms of a bouncing journal and a sliding block, energy, and the
limit that walls which give have as they become stiff.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from analytic.mechanism import Mechanism
from analytic.mechanism.file import load
from marks import slow
from sim_models.common.contact_laws import NamedLaw
from tests.evidence.contact_ode import Loop, State, centred, kinetic, loop_of, simulate
from tests.evidence.nonsmooth import Floor, Steps, time_stepping

E = 0.6


def rigid(loop: Loop, start: State, step: float, count: int, restitution: float = E) -> Steps:
    """The journal's steps from a start of the ODE's."""
    return time_stepping(
        loop, np.array(start[:2]), np.array(start[2:]), step, count,
        restitution=restitution, friction=loop.friction,
    )  # fmt: skip


def strikes(steps: Steps) -> np.ndarray:
    """Steps with an impulse after one without."""
    hit = steps.normal[:, 0] > 0
    return np.flatnonzero(hit & ~np.concatenate([[False], hit[:-1]]))


pytestmark = pytest.mark.slow  # its compiled steps take longest to compile


@pytest.mark.parametrize("restitution", [0.9, 0.5, 0.0])
def test_a_journal_bounces_by_its_restitution(restitution: float) -> None:
    """Thrown by a constant force against a pin that stands still: speeds fall by e, flights last 2 e v/a; an impact is
    placed to a step.
    """
    push = 1.0
    m = load("slider-crank").with_joint("B", clearance=5e-4, contact_law="flores")
    m = m.with_body("rod", inertia=1e15).replace(
        drive=m.drive.model_copy(update={"speed": 1e-9}),
        loads=[{"body": "slider", "point": "com", "force": (-push, 0.0)}],
    )
    loop = loop_of(m)
    start = centred(m, loop)._replace(first_rate=0.0, second_rate=0.0)
    pull = push / loop.mass2
    fall = math.sqrt(2 * loop.clearance / pull)
    step = fall / 20000
    steps = rigid(loop, start, step, 80000, restitution)
    hit = strikes(steps)[:5] if restitution else strikes(steps)[:1]
    v0 = pull * fall
    np.testing.assert_allclose(steps.time[hit[0]], fall, atol=2 * step)
    speeds = v0 * restitution ** np.arange(1, hit.size + 1)
    after = np.array([steps.v[k + 1, 1] for k in hit])
    np.testing.assert_allclose(np.abs(after), speeds, atol=5e-4 * v0)
    np.testing.assert_allclose(np.diff(steps.time[hit]), 2 * speeds[:-1] / pull, rtol=2e-3)
    if restitution == 0:  # it stays, carried by the force
        np.testing.assert_allclose(steps.normal[hit[0] + 2 :, 0], push * step, rtol=1e-6)
        assert steps.gap.min() > -2 * v0 * step


def test_a_block_slides_and_sticks() -> None:
    """mu = 0.3: thrown at 2 m/s it stops after v^2/(2 mu g); pushed by less than mu m g it stays, by more it goes."""

    def slid(push: float, speed: float) -> Steps:
        start = np.array([0.0, 0.0]), np.array([speed, 0.0])
        return time_stepping(Floor(2.0, 9.81, push), *start, 1e-4, 10000, restitution=0.5, friction=0.3)

    thrown = slid(0.0, 2.0)
    assert thrown.q[-1, 0] == pytest.approx(4 / (2 * 0.3 * 9.81), rel=1e-4)
    assert abs(thrown.v[-1, 0]) < 1e-12
    assert np.abs(slid(5.8, 0.0).q[:, 0]).max() < 1e-12
    going = slid(6.886, 0.0)
    assert going.v[-1, 0] == pytest.approx((6.886 / 2 - 0.3 * 9.81) * 1.0, rel=1e-9)
    np.testing.assert_allclose(going.normal[:, 0], 2 * 9.81 * 1e-4, rtol=1e-9)


@pytest.mark.parametrize("case", ["crank-rocker", "slider-crank"])
@pytest.mark.parametrize("friction", [0.0, 0.2])
def test_energy_never_grows(case: str, friction: float) -> None:
    """The crank stands still, nothing pulls: what the two bodies have falls at every strike, and only there."""
    m = load(case).with_joint("B", clearance=5e-4, contact_law="flores", friction=friction)
    m = m.replace(drive=m.drive.model_copy(update={"speed": 1e-9}))
    loop = loop_of(m, 1.0)
    start = centred(m, loop)._replace(first_rate=3.0, second_rate=1.0 if case == "crank-rocker" else 0.2)
    steps = rigid(loop, start, 1e-6, 20000)
    energy = kinetic(loop, steps.time, np.hstack([steps.q, steps.v]))
    change = np.diff(energy)
    assert change.max() < 1e-12 * energy[0]
    assert strikes(steps).size > 2
    assert np.abs(change[(steps.normal[:, 0] == 0)]).max() < 1e-12 * energy[0]


def delivering(e: float) -> float:
    """Factor chi of a law that delivers e: chi (1 + e) = ln[(1 + chi)/(1 - chi e)], without rounding of a law's own."""
    return brentq(lambda chi: chi * (1 + e) - math.log((1 + chi) / (1 - chi * e)), 1e-6, (1 - 1e-12) / e)


def ends(m: Mechanism, friction: float, stiffnesses: list[float], step: float) -> tuple[np.ndarray, list[np.ndarray]]:
    """Times and speeds of the first four strikes (2, 4): of rigid walls, and of ones as stiff as that."""
    m = m.with_joint("B", clearance=5e-4, contact_law="flores", friction=friction)
    m = m.replace(drive=m.drive.model_copy(update={"speed": 200 * np.pi}))
    giving = []
    for stiffness in stiffnesses:
        loop = loop_of(m, 2.0, NamedLaw("flores", stiffness, 0.0, delivering(E), 1e-6, E))
        touches = simulate(m, loop, centred(m, loop), 2 * np.pi, step=1e-5, most=4).impacts
        giving.append(np.array([touches.time, touches.approach]))
    loop = loop_of(m, 2.0, NamedLaw("flores", 1.0, 0.0, 0.0, 1e-6, E))
    steps = rigid(loop, centred(m, loop), step, int(1.3 * giving[-1][0, -1] / step))
    hit = strikes(steps)[:4]
    # a strike's impulse over (1 + e) is the speed times the mass that the pin then has along its force
    speeds = [-(steps.gap[k] - steps.gap[k - 1])[0] / step for k in hit]
    return np.array([steps.time[hit], speeds]), giving


@pytest.mark.parametrize(
    ("case", "friction", "step"),
    [
        ("crank-rocker", 0.0, 1e-7),
        ("slider-crank", 0.0, 1e-7),
        ("crank-rocker", 0.1, 1e-7),
        *slow(("crank-rocker", 0.0, 2e-8), ("slider-crank", 0.0, 2e-8)),
    ],
)
def test_stiff_walls_tend_to_rigid_ones(case: str, friction: float, step: float) -> None:
    """Of the same restitution delivered: a hundred times the stiffness leaves a tenth of the difference, as contact
    lasts that much shorter; up to four strikes.  (Not where slip reverses within a strike, as the slider-crank's does
    with friction: there Coulomb's law through the strike and for the whole of it are two laws.)
    """
    walls, giving = ends(load(case), friction, [1e9, 1e11, 1e13], step)
    error = [np.abs(soft - walls) / np.abs(walls) for soft in giving]
    soft, firm, firmest = (float(e.max()) for e in error)
    assert soft > 4 * firm
    assert firm > 4 * firmest
    assert firmest < 5e-3

"""Linkages assembled where their drive has no hold on them: refused, whatever kind of group is singular there, and
right beside it.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.motion import kinematics
from analytic.mechanism import Mechanism
from analytic.mechanism.file import load, loads
from analytic.paper.clearance import displaced
from analytic.paper.kinetostatics import kinetostatics
from linkages import INVERTED_SLIDER, six_bar_driven_from_the_rocker


def driven_at(mechanism: Mechanism, joint: str, **assembly: float) -> Mechanism:
    """The mechanism with its drive at another joint, assembled at these angles (rad)."""
    assert mechanism.drive is not None
    drive = mechanism.drive.model_copy(update={"joint": joint, "speed": 1.0})
    return mechanism.replace(drive=drive, assembly={**mechanism.assembly, **assembly})


def parallelogram(angle: float) -> Mechanism:
    """The paper's linkage, which folds flat at 0 and 180 deg."""
    return load("paper").replace(assembly={"crank": angle, "coupler": 0.0, "follower": angle})


def crank_rocker(away: float, stretched: bool = True) -> Mechanism:
    """The crank-rocker driven at its rocker, so far (rad) from where crank and coupler are in line, on the side that it
    reaches.
    """
    crank, coupler, rocker, ground = 0.05, 0.12, 0.10, 0.12
    far = coupler + crank if stretched else coupler - crank
    x = (far**2 - rocker**2 + ground**2) / (2 * ground)
    b = complex(x, np.sqrt(far**2 - x**2))
    follower = np.angle(b - ground) + (away if stretched else -away)
    linkage = driven_at(
        load("crank-rocker"),
        "E",
        crank=np.angle(b) + (0 if stretched else np.pi),
        coupler=np.angle(b),
        follower=follower,
    )
    return linkage.replace(loads=[{"body": "coupler", "force": (3.0, 10.0)}])


def slider_crank(away: float) -> Mechanism:
    """A slider-crank whose slide is so high that the rod stands on it at a right angle when the crank points down;
    ``away`` (rad) of it.
    """
    m = load("slider-crank")
    ground = m.ground.model_copy(update={"points": {**m.ground.points, "S": (0.0, 0.07)}})
    return m.replace(ground=ground, assembly={"crank": -np.pi / 2 + away, "rod": np.pi / 2, "slider": 0.0})


def over_its_pivot(angle: float) -> Mechanism:
    """An inverted slider whose crank pin passes over the arm's pivot at 0 deg, where any angle of the arm closes the
    loop.
    """
    text = INVERTED_SLIDER.replace("A = [0.0, 0.01], S", "A = [0.0, 0.0], S").replace(
        "S = [0.02, 0.01], tip", "S = [0.0, 0.0], tip"
    )
    text = text.replace("C = [0.2, 0.05]", "C = [0.06, 0.0]").replace(
        "axis = [3.0, 1.0]\nangle = 0.4", "axis = [1.0, 0.0]"
    )
    arm = angle / 2 + np.pi / 2
    return loads(text).replace(assembly={"crank": angle, "block": arm, "arm": arm})


def six_bar(away: float) -> Mechanism:
    """The six-bar driven at its rocker, where that turns back: one group of four bodies, solved by Newton's method."""
    m = load("six-bar")
    assembly = Assembly(m)
    turn = brentq(
        lambda x: kinematics(assembly, np.array([x]), 1.0).angular_velocity("rocker")[0],
        4.0,
        4.2,
        xtol=1e-15,
        rtol=1e-14,
    )
    motion = kinematics(assembly, np.array([turn]))
    posture = {b.name: float(motion.angle(b.name)[0]) for b in m.bodies}
    posture["rocker"] -= away
    return six_bar_driven_from_the_rocker().replace(assembly=posture, loads=[{"body": "coupler", "force": (0.0, 10.0)}])


FLAT = {
    "parallelogram at 0": parallelogram(0.0),
    "parallelogram at 180 deg": parallelogram(np.pi),
    "parallelogram almost at 0": parallelogram(1e-9),
    "parallelogram almost at 180 deg": parallelogram(np.pi - 1e-9),
    "rocker at its outer dead point": crank_rocker(0.0),
    "rocker at its inner dead point": crank_rocker(0.0, stretched=False),
    "slider-crank whose rod stands on its slide": slider_crank(0.0),
    "crank pin over the arm's pivot": over_its_pivot(0.0),
    "crank pin almost over the arm's pivot": over_its_pivot(1e-9),
    "six-bar at its rocker's dead point": six_bar(0.0),
    "six-bar almost at its rocker's dead point": six_bar(1e-9),
}


@pytest.mark.parametrize("mechanism", FLAT.values(), ids=FLAT)
def test_no_force_comes_from_a_linkage_assembled_at_a_singular_posture(mechanism: Mechanism) -> None:
    with pytest.raises(AssemblyError, match=r"change point at crank angle|cannot be reached"):
        kinetostatics(kinematics(Assembly(mechanism), np.array([mechanism.assembly[mechanism.driven]]), 1.0))
    with pytest.raises(AssemblyError, match=r"change point at crank angle|cannot be reached"):
        displaced(
            Assembly(mechanism),
            np.array([mechanism.assembly[mechanism.driven]]),
            1.0,
            clearances={mechanism.joints[-2].name: 1e-5},
        )


@pytest.mark.parametrize("stretched", [True, False])
def test_beside_a_dead_point_the_force_grows_as_it_must(stretched: bool) -> None:
    """As the inverse root of the distance: what is left there is the linkage's own large force and no rounding."""
    largest = []
    for away in (1e-5, 1e-7, 1e-9):
        assembly = Assembly(crank_rocker(away, stretched))
        forces = kinetostatics(kinematics(assembly, np.array([assembly.start]), 1.0), inertia=False).forces
        largest.append(abs(forces["A"][0]))
    assert largest[1] / largest[0] == pytest.approx(10.0, rel=0.02)
    assert largest[2] / largest[1] == pytest.approx(10.0, rel=2e-3)


def test_a_crank_pin_that_passes_over_the_arms_pivot_is_a_change_point_and_no_jump_of_180_deg() -> None:
    linkage = over_its_pivot(0.3)
    with pytest.raises(AssemblyError, match=r"change point at crank angle -?[\d.e-]+ deg, where block and arm"):
        kinematics(Assembly(linkage), np.radians([-5.0, 5.0]))
    turned = np.diff(kinematics(Assembly(linkage), np.radians(np.arange(1.0, 359.0, 1.0))).angle("arm"))
    np.testing.assert_allclose(turned, np.radians(0.5), atol=1e-12)

"""Clearance and compliance added up (Fig. 7c), against a case worked out by hand, in every place that adds them.

A bar of length L on one pin D, held by the motor, with a force F across its tip.  The pin has radial clearance c and
Eq. 4's spring k, the bar a bending stiffness E I.  To first order the force pushes the whole bar by c + F/k and bends
its tip by F L^3 / (3 E I) more; at D, where its angle is read, the bar does not turn.
"""

from __future__ import annotations

import numpy as np
import pytest

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.schedule import Schedule, Turning
from analytic.mechanism import Body, Drive, Elasticity, Ground, Joint, Load, Mechanism
from analytic.paper.superposition import total_displacement
from compare.diagnose.predict import derived
from compare.judge.reference import reference, with_flexible_links

LENGTH, SIDE, MODULUS = 0.5, 0.01, 2e11  # m, m, Pa
FORCE, CLEARANCE, SPRING = 20.0, 3e-4, 4e5  # N, m, N/m
TURNED = np.radians([0.0, 60.0, 200.0])
GIVE = FORCE / SPRING  # m: 5e-5
BENDING = FORCE * LENGTH**3 / (3 * MODULUS * SIDE**4 / 12)  # m: 5e-3
BENT_MIDDLE = 5 / 16 * BENDING  # m, at half the length


def bar(turned: float, elastic: bool = True) -> Mechanism:
    """The bar at that angle (rad), its load across it."""
    across = 1j * FORCE * np.exp(1j * turned)
    return Mechanism(
        name="bar",
        ground=Ground(points={"D": (0.0, 0.0)}),
        bodies=(
            Body(
                name="bar",
                points={"D": (0.0, 0.0), "tip": (LENGTH, 0.0)},
                mass=1e-9,
                section=(SIDE, SIDE),
                youngs_modulus=MODULUS,
            ),
        ),
        joints=(
            Joint(
                name="D",
                type="revolute",
                bodies=("ground", "bar"),
                clearance=CLEARANCE,
                elasticity=Elasticity(translation=SPRING, rotation=1e3) if elastic else None,
            ),
        ),
        drive=Drive(joint="D", speed=1.0),
        loads=(Load(body="bar", point="tip", force=(float(across.real), float(across.imag))),),
        assembly={"bar": turned},
    )


def expected(turned: float, elastic: bool) -> dict[str, float]:
    """What clearance and compliance come to in the ground frame (m, rad)."""
    across = 1j * np.exp(1j * turned)
    pushed = (CLEARANCE + GIVE * elastic) * across
    com = LENGTH / 2 * np.exp(1j * turned) + pushed + BENT_MIDDLE * across
    return {
        "clearance_D_x": -pushed.real,  # the ground's pin centre minus the bar's
        "clearance_D_y": -pushed.imag,
        "bar_x": com.real,
        "bar_y": com.imag,
        "bar_angle": turned,
        "bar_rotation": 0.0,
    }


@pytest.mark.parametrize("elastic", [True, False])
@pytest.mark.parametrize("turned", TURNED)
def test_fig_7c_by_hand(turned: float, elastic: bool) -> None:
    assembly, theta = Assembly(bar(turned, elastic)), np.array([turned])
    total = total_displacement(assembly, theta)
    assert total.displacement("bar", "tip") == pytest.approx(
        (CLEARANCE + GIVE * elastic + BENDING) * 1j * np.exp(1j * turned), rel=1e-6
    )
    still = np.zeros(1)
    schedule = Schedule.at_angles(assembly.mechanism, theta, at_rest=True)
    side = reference(assembly, schedule, "equilibrium", assembly.mechanism.clearances)
    for found in (
        total.signals(),
        with_flexible_links(side, assembly, schedule).signals,
        derived(assembly, Turning(theta, still, still)),
    ):
        for name, value in expected(turned, elastic).items():
            if name in found:
                assert found[name] == pytest.approx(value, abs=1e-9), name
        assert np.hypot(found["reaction_D_x"], found["reaction_D_y"]) == pytest.approx(FORCE, rel=1e-6)


def test_a_joint_without_elasticity_gives_exactly_nothing() -> None:
    assembly = Assembly(bar(0.3, elastic=False))
    total = total_displacement(assembly, np.array([0.3]))
    rigid, bent = total.clearance.signals(), total.signals()
    assert bent["clearance_D_x"] == rigid["clearance_D_x"]
    assert bent["clearance_D_y"] == rigid["clearance_D_y"]
    assert bent["bar_y"] != rigid["bar_y"]

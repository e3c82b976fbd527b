"""Contact laws against what their authors' formulas deliver, by integrating one impact of each.

F = K d^n (1 + chi d'/v0) with v0 the speed of impact; chi as in Hunt and Crossley 1975, Herbert and McWhannell 1977,
Lankarani and Nikravesh 1990, Gonthier et al. 2004, Flores et al. 2011, Carvalho and Martins 2019.  What they call
"restitution" is not what they deliver, so that a report has to state the law.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sim_models.common.contact_laws import damping_ratio, hertz_stiffness, restitution

NOMINAL = (0.9, 0.7, 0.5, 0.3)
LAWS: dict[str, tuple[Callable[[float], float], tuple[float, float, float, float]]] = {
    "hunt crossley 1975": (lambda e: 1.5 * (1 - e), (0.90902, 0.76800, 0.66296, 0.58129)),
    "herbert mcwhannell 1977": (lambda e: 6 * (1 - e) / ((2 * e - 1) ** 2 + 3), (0.90089, 0.72268, 0.59362, 0.51997)),
    "lankarani nikravesh 1990": (lambda e: 0.75 * (1 - e**2), (0.91318, 0.79597, 0.72524, 0.68422)),
    "gonthier 2004": (lambda e: (1 - e**2) / e, (0.87644, 0.66958, 0.48774, 0.30422)),
    "flores 2011": (lambda e: 1.6 * (1 - e) / e, (0.89392, 0.68318, 0.47044, 0.25621)),
    "carvalho martins 2019": (lambda e: 1.5 * (1 - e) * (11 - e) / (1 + 9 * e), (0.90000, 0.69997, 0.50017, 0.30397)),
}


def one_impact(
    force: Callable[[float, float], float], mass: float, speed: float, stiffness: float, power: float
) -> float:
    """Rebound speed over impact speed of a mass that meets a contact force; it leaves where the force vanishes."""

    def leaves(_: float, state: np.ndarray) -> float:
        return force(state[0], state[1]) if state[1] < 0 else 1.0

    leaves.terminal = True
    duration = (mass * speed ** (1 - power) / stiffness) ** (1 / (power + 1)) * 60
    found = solve_ivp(
        lambda _, s: [s[1], -force(s[0], s[1]) / mass],
        (0, duration),
        [0.0, speed],
        "DOP853",
        events=leaves,
        rtol=1e-11,
        atol=1e-14,
        max_step=duration / 3000,
    )
    assert found.status == 1, "the journal did not leave"
    return float(-found.y[1, -1] / speed)


@pytest.mark.parametrize(("chi", "delivered"), LAWS.values(), ids=LAWS)
@pytest.mark.parametrize(("stiffness", "power", "mass", "speed"), [(6.61e10, 1.5, 0.21, 0.5), (1e8, 1.0, 1.3, 2.0)])
def test_delivered_restitution(chi, delivered, stiffness: float, power: float, mass: float, speed: float) -> None:
    for nominal, expected in zip(NOMINAL, delivered, strict=True):
        factor = chi(nominal) / speed
        rebound = one_impact(
            lambda d, v, f=factor: stiffness * max(d, 0.0) ** power * (1 + f * v), mass, speed, stiffness, power
        )
        assert rebound == pytest.approx(expected, abs=2e-5)


@pytest.mark.parametrize("ratio", [0.05, 0.1, 0.3, 0.5, 0.8, 1.0, 1.7])
def test_kelvin_voigt_delivers_what_its_formula_says(ratio: float) -> None:
    stiffness, mass, speed = 1e6, 0.2, 0.7
    damping = 2 * ratio * np.sqrt(stiffness * mass)
    assert one_impact(lambda d, v: stiffness * d + damping * v, mass, speed, stiffness, 1.0) == pytest.approx(
        restitution(ratio), abs=1e-6
    )


@pytest.mark.parametrize("delivered", NOMINAL)
def test_a_damping_ratio_is_found_for_every_restitution(delivered: float) -> None:
    assert restitution(damping_ratio(delivered)) == pytest.approx(delivered, abs=1e-12)


def test_hertz_stiffness_of_flores_bearing() -> None:
    assert hertz_stiffness(10e-3, 9.5e-3, 207e9) == pytest.approx(6.61e10, rel=1e-3)
    wrong = 4 / 3 * 207e9 / (2 * 0.91) * np.sqrt(10e-3 * 9.5e-3 / 19.5e-3)  # the sum of the radii, a known mistake
    assert wrong == pytest.approx(1.06e10, rel=5e-3)
    with pytest.raises(ValueError, match="does not fit"):
        hertz_stiffness(9.5e-3, 10e-3, 207e9)

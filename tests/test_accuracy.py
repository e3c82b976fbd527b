"""Fig. 7c: clearance and compliance superposed."""

from __future__ import annotations

import numpy as np

from analytic.accuracy import total_displacement
from analytic.assembly import Assembly
from analytic.mechanism_file import load


def test_the_papers_total_is_the_sum_of_figs_7a_and_7b() -> None:
    found = total_displacement(Assembly(load("paper")), np.radians([30.0]))
    moved = found.by_clearance("coupler", "B")[0] - found.by_clearance("follower", "B")[0]
    np.testing.assert_allclose(moved, 0.01 * np.exp(1j * np.radians(30.0)), atol=1e-12)  # Eq. 8, at the clearance itself
    elastic = found.compliance.displacement("coupler", "B")[0]
    np.testing.assert_allclose(elastic, complex(-0.347493e-3, 0.602877e-3), atol=1e-9)
    np.testing.assert_allclose(found.displacement("coupler", "B")[0], found.by_clearance("coupler", "B")[0] + elastic, atol=1e-15)


def test_without_clearance_the_total_is_the_compliance() -> None:
    found = total_displacement(Assembly(load("paper")), np.radians([30.0, 90.0]), clearances={})
    np.testing.assert_array_equal(found.displacement("coupler"), found.compliance.displacement("coupler"))

"""Products of columns that searches take once and use again."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.diagnose.predict import Term
from compare.diagnose.propose.regression import solved
from compare.diagnose.sensitivities import Columns, Screen, Sensitivity
from diagnosis_rigs import experiment
from tests.evidence.scoreboard.sizes import Sizer

SIZE = 200
RIG = Sizer(experiment()).rig


def sensitivity(where: str, count: int, rng: np.random.Generator, offset: bool = False) -> Sensitivity:
    """One of a term, made up."""
    term = Term(VOCABULARY["coulomb_friction"], where, float(count))
    still = rng.standard_normal(SIZE) if offset else np.zeros(SIZE)
    return Sensitivity(term, still, 10 * rng.standard_normal((SIZE, count)))


def by_term(found: Sequence[Sensitivity]) -> dict[Term, Sensitivity]:
    return {s.term: s for s in found}


def test_a_screen_with_other_columns_of_some_terms_is_that_taken_from_the_start() -> None:
    rng = np.random.default_rng(3)
    before = by_term([sensitivity("A", 1, rng), sensitivity("B", 2, rng, True), sensitivity("C", 1, rng, True)])
    first, second, third = before
    wide = Sensitivity(second, np.zeros(SIZE), rng.standard_normal((SIZE, 3)))
    other = Sensitivity(third, rng.standard_normal(SIZE), rng.standard_normal((SIZE, 1)))
    own = by_term([wide, other, sensitivity("D", 2, rng, True)])
    residual, none = rng.standard_normal(SIZE), np.zeros((SIZE, 0))
    step = Columns.of(RIG, before, none).replaced(RIG, {second: wide}).replaced(RIG, own)
    shared, anew = Screen(RIG, residual, step), Screen(RIG, residual, Columns.of(RIG, before | own, none))
    assert shared.terms == anew.terms == [first, *own]
    np.testing.assert_allclose(shared.gram, anew.gram, atol=1e-14)
    for chosen in ([0], [1], [0, 3], [1, 2, 3]):
        gain, coefficients = shared.gain(chosen)
        assert gain == pytest.approx(anew.gain(chosen)[0], rel=1e-12)
        np.testing.assert_allclose(coefficients, anew.gain(chosen)[1], rtol=1e-10)
        np.testing.assert_allclose(shared.further(chosen), anew.further(chosen), rtol=1e-9)


def test_coefficients_are_those_of_least_squares_and_nothing_is_told_by_columns_that_are_nothing() -> None:
    rng = np.random.default_rng(4)
    matrix, right = rng.standard_normal((SIZE, 3)) * [1.0, 1e-2, 1e2], rng.standard_normal(SIZE)
    x, covariance = solved(matrix, right)
    np.testing.assert_allclose(x, np.linalg.lstsq(matrix, right)[0], rtol=1e-9)
    np.testing.assert_allclose(covariance, np.linalg.inv(matrix.T @ matrix), rtol=1e-8)
    with np.errstate(all="raise", under="ignore"):
        x, _ = solved(np.column_stack([matrix, np.full(SIZE, 1e-160)]), right)
        alone, _ = solved(np.full((SIZE, 1), 1e-160), right)
    assert abs(x[3]) < 1e-100
    assert alone[0] == 0.0


def test_columns_beside_none_are_those_alone() -> None:
    own = by_term([sensitivity("A", 2, np.random.default_rng(5), True)])
    none = np.zeros((SIZE, 0))
    beside, alone = Columns.of(RIG, {}, none).replaced(RIG, own), Columns.of(RIG, own, none)
    np.testing.assert_array_equal(beside.gram, alone.gram)
    np.testing.assert_array_equal(beside.onto(np.ones(SIZE)), alone.onto(np.ones(SIZE)))

"""The fit's own least squares: it ends where SciPy's does, asks the model far less often, and takes walls and pins."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from scipy.optimize import least_squares

from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.diagnose.fit import Fit, Fitter, Space, joined
from compare.diagnose.least_squares import SETTLED, STEPS, Descent
from compare.diagnose.predict import Term
from compare.diagnose.residuals import Data
from diagnosis_rigs import experiment
from tests.evidence.scoreboard.sizes import Sizer


def term(label: str) -> Term:
    name, where = label.split("@")
    return Term(VOCABULARY[name], where)


TRUTH = [
    (term("payload@coupler"), {"mass": 2e-3, "along": 0.02, "normal": 0.015}),
    (term("viscous_friction@E"), {"damping": 1e-3}),
]


class Counted(Fitter):
    """A fitter that counts for how many points it asks the model."""

    asked = 0

    def residuals(self, terms: Sequence[Term], points: Sequence[Sequence[np.ndarray]]) -> list[np.ndarray | None]:
        self.asked += len(points)
        return super().residuals(terms, points)


class ByScipy(Counted):
    """The same by SciPy, with the same residuals, bounds, scales and Jacobian."""

    def _fit(
        self,
        terms: tuple[Term, ...],
        x: Sequence[np.ndarray],
        steps: int = STEPS,
        rough: float = 0.0,
        size: np.ndarray | None = None,
        beaten: float = np.inf,
    ) -> Fit | None:
        space, kept = Space(terms, self.rig, self.bounds), {}

        def residual(point: np.ndarray) -> np.ndarray:
            if point.tobytes() not in kept:
                (found,) = self.residuals(terms, [space.parted(point)])
                kept[point.tobytes()] = np.full(self.data.size, np.nan) if found is None else found
            return kept[point.tobytes()]

        start = np.clip(joined(x), space.low, space.high)
        begin = residual(start)
        if not steps or not start.size or np.isnan(begin).any():
            return super()._fit(terms, x, steps, rough, size, beaten)
        found = least_squares(
            residual,
            start,
            lambda point: self.jacobian(space, point, residual(point)),
            bounds=(space.low, space.high),
            method="dogbox",  # keeps to a bound, where the other method that knows bounds crawls towards it
            x_scale=space.scale,
            ftol=SETTLED / float(begin @ begin),
            gtol=None,
            max_nfev=STEPS,
        )
        return Fit(terms, tuple(space.parted(found.x)), found.fun, found.jac, found.active_mask != 0)


BESIDE = ("gravity@linkage", "link_length@follower", "coulomb_friction@D", "moment_of_inertia@coupler")


def fitted(kind: type[Counted]) -> tuple[list[Fit], int]:
    """Fits from nothing, to data of a four-bar with a payload and friction, of these alone and beside something else;
    and how often the model was asked.
    """
    sizer, rng = Sizer(experiment()), np.random.default_rng(5)
    rig, model = sizer.rig, sizer.model(TRUTH)
    (readings,) = model([TRUTH])
    assert readings is not None
    noisy = [{s: v + rig.noise[s] * rng.standard_normal(v.size) for s, v in run.items()} for run in readings]
    measured = sizer.experiment.measured(noisy)
    sigma = {(run.name, s): c.noise for run in measured.runs for s, c in run.channels.items()}
    fitter = kind(model, Data(measured, sigma), rig, sizer.bounds)
    true = [t for t, _ in TRUTH]
    sets = [true, *([*true, term(label)] for label in BESIDE)]
    starts = [{t: np.zeros(len(t.effect.scales(rig, t.where))) for t in each} for each in sets]
    fits = [fitter.likeliest({t: x + np.inf for t, x in start.items()}, start, rough=0.0) for start in starts]
    return [fit for fit in fits if fit is not None], fitter.asked


@pytest.mark.slow
def test_it_ends_where_scipy_does_and_asks_the_model_far_less_often() -> None:
    (ours, asked), (theirs, asked_by_scipy) = fitted(Counted), fitted(ByScipy)
    print(f"the model was asked {asked} times, by SciPy {asked_by_scipy} times")
    assert len(ours) == len(theirs) == 1 + len(BESIDE)
    for own, their in zip(ours, theirs, strict=True):
        assert own.chi2 == pytest.approx(their.chi2, abs=0.05)
    sigma = np.sqrt(np.diag(np.linalg.inv(theirs[0].jacobian.T @ theirs[0].jacobian)))
    apart = np.abs(joined(ours[0].x) - joined(theirs[0].x))
    assert np.all(apart < 0.1 * sigma), "far less than the noise leaves open"
    assert asked < 0.75 * asked_by_scipy


def line(wall: float) -> Descent:
    """(x - 3, y - 1), with y pinned to 0.5, impossible for x beyond a wall."""

    def residual(point: np.ndarray) -> np.ndarray | None:
        return None if point[0] > wall else point - [3.0, 1.0]

    low, high = np.array([-np.inf, 0.5]), np.array([np.inf, 0.5])
    return Descent(residual, lambda point, here: np.eye(2), low, high, np.full(2, 1.0), np.arange(2))


def test_a_coordinate_without_room_stays_and_lies_on_its_bound() -> None:
    found = line(wall=10.0).from_point(np.array([0.0, 0.0]))
    assert found is not None
    assert found.point == pytest.approx([3.0, 0.5], abs=5e-3)
    assert found.bound.tolist() == [False, True]


def test_it_goes_up_to_a_wall_and_not_beyond() -> None:
    found = line(wall=2.0).from_point(np.array([0.0, 0.5]))
    assert found is not None
    assert 1.5 < found.point[0] <= 2.0


def test_a_start_that_is_impossible_has_no_minimum() -> None:
    assert line(wall=2.0).from_point(np.array([2.5, 0.5])) is None


def test_no_steps_stay_where_they_start() -> None:
    found = line(wall=10.0).from_point(np.array([0.0, 0.5]), steps=0)
    assert found is not None
    assert found.point.tolist() == [0.0, 0.5]


def valley(beaten: float = np.inf, rough: float = 0.0, bend: float = 0.0) -> tuple[Descent, list[np.ndarray]]:
    """(x - 3 + bend x^2, 2): at best 4; and where its Jacobian was asked for."""
    asked: list[np.ndarray] = []

    def jacobian(point: np.ndarray, _: np.ndarray) -> np.ndarray:
        asked.append(point)
        return np.array([[1.0 + 2 * bend * point[0]], [0.0]])

    def residual(point: np.ndarray) -> np.ndarray:
        return np.array([point[0] - 3.0 + bend * point[0] ** 2, 2.0])

    edges = np.full(1, -np.inf), np.full(1, np.inf), np.ones(1), np.zeros(1, int)
    return Descent(residual, jacobian, *edges, rough, beaten=beaten), asked


@pytest.mark.parametrize(("beaten", "ends"), [(3.9, 0.0), (4.1, 3.0), (np.inf, 3.0)])
def test_it_is_left_where_no_straight_line_leads_below_what_is_reached_already(beaten: float, ends: float) -> None:
    found = valley(beaten)[0].from_point(np.zeros(1))
    assert found is not None
    assert found.point == pytest.approx([ends], abs=5e-3)


@pytest.mark.parametrize(("rough", "asked"), [(1e-3, 1), (0.0, 2)])
def test_a_fit_to_be_compared_keeps_a_jacobian_that_foretold_its_steps(rough: float, asked: int) -> None:
    descent, points = valley(rough=rough)
    assert descent.from_point(np.zeros(1)) is not None
    assert len(points) == asked


def test_a_fit_to_be_compared_has_its_own_jacobian_if_the_last_one_foretold_too_little() -> None:
    found = valley(rough=1e-3, bend=0.05)[0].from_point(np.zeros(1))
    assert found is not None
    assert found.jacobian[0, 0] == pytest.approx(1.0 + 0.1 * found.point[0], rel=0.01)

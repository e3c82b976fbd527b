"""reports/trust.md is what trust.json says, and what that says is what is asked of it."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from analytic.mechanism.file import load
from analytic.mechanism.signals import named
from compare.report.svg import draw
from tests.evidence.pages.trust import figures, page
from tests.evidence.results.trust import Impacting, Trust
from tests.evidence.trust.recorded import parted
from tests.evidence.trust.steps import SHORTER, against

REPORTS = Path(__file__).parents[1] / "reports"
STORED = Trust.model_validate_json((REPORTS / "trust.json").read_text(encoding="utf-8"))
ORDERS = {"mujoco": 2.0, "exudyn": 1.0, "pybullet": 1.0, "dart": 1.0}  # through impacts


def test_the_page_is_what_the_numbers_say() -> None:
    found = (REPORTS / "trust.md").read_text(encoding="utf-8")
    assert found == page(STORED), "run python -m tests.evidence.trust page"
    drawn = figures(STORED)
    assert len(drawn) == 3
    for name, figure in drawn.items():
        assert (REPORTS / name).read_text(encoding="utf-8") == draw(figure), name


def test_numerical_uncertainties_hold_with_an_order_and_without() -> None:
    whole, within, ordered, held = (
        sum(getattr(row, name) for row in STORED.steps) for name in ("signals", "within", "ordered", "ordered_within")
    )
    assert whole > ordered > 100
    assert within >= 0.95 * whole
    assert held >= 0.95 * ordered


def test_they_are_no_wider_than_the_grid_convergence_index_makes_them() -> None:
    """Of a known order 1.25 times the error, and 4/3 more at most where the order counts as two."""
    wide = [x for row in STORED.steps for x in row.excess[0]]
    assert 1.2 < np.median(wide) < 1.7


@pytest.mark.parametrize("row", STORED.struck, ids=lambda row: f"{row.simulator} {row.joint_model}")
def test_a_run_with_impacts_converges_with_its_engines_order(row: Impacting) -> None:
    assert row.order == pytest.approx(ORDERS[row.simulator], abs=0.2)
    assert row.touches >= 3
    assert row.errors[-1] < 2e-5


def test_where_rounding_grows_the_exact_solution_is_the_truth() -> None:
    """Of a force whose error is 2e-9 and rounding 1e-9 / h^2: the shortest steps are off by 256e-9, which is no fault
    of the run that is judged.
    """
    m = load("crank-rocker")
    force, shape = named(m.bodies, m.joints)["reaction_B_x"], np.array([0.2, -1.0, 0.7])
    exact, noise = np.array([3.0, 5.0, 4.0]), np.random.default_rng(1).choice([-1.0, 1.0], (len(SHORTER) + 1, 3))
    runs = [exact + 2e-9 * shape / n**2 + 1e-9 * n**2 * noise[k] for k, n in enumerate((1, *SHORTER))]
    held, doubted = against(force, runs, exact, 1.0), against(force, runs, None, 1.0)
    assert held.truth == "analytic"
    assert doubted.truth == "doubt"
    assert held.errors[0] == pytest.approx(np.abs(runs[0] - exact).max())
    assert held.within(held.errors[0])
    assert not doubted.within(doubted.errors[0])


def test_where_differences_fall_the_shortest_steps_are_the_truth() -> None:
    m = load("crank-rocker")
    force, shape = named(m.bodies, m.joints)["reaction_B_x"], np.array([0.2, -1.0, 0.7])
    runs = [5.0 + 1e-3 * shape / n for n in (1, *SHORTER)]
    held = against(force, runs, np.full(3, 4.0), 1.0)
    assert held.truth == "sixteenth"
    assert held.errors[0] == pytest.approx(1e-3 * 15 / 16)
    assert held.within(held.errors[0])


@pytest.mark.parametrize("backwards", [False, True])
def test_a_recording_is_cut_so_that_a_part_is_never_fitted(tmp_path: Path, backwards: bool) -> None:
    source, to = tmp_path / "rig", tmp_path / "cut"
    source.mkdir()
    to.mkdir()
    (source / "nominal.toml").write_text("", encoding="utf-8")
    (source / "run.csv").write_text("time [s],crank_angle [rad]\n" + "".join(f"{i},{i}\n" for i in range(10)))
    entry = '[[run]]\nname = "all"\nfile = "run.csv"\ndrive = "measured"\n'
    (source / "measured.toml").write_text(f'mechanism = "nominal.toml"\n\n{entry}', encoding="utf-8")
    file, says = parted(source, to, backwards)
    runs = tomllib.loads(file.read_text(encoding="utf-8"))["run"]
    rows = [(to / run["file"]).read_text(encoding="utf-8").splitlines()[1:] for run in runs]
    assert [len(part) for part in rows] == ([4, 6] if backwards else [6, 4])
    assert [line for part in rows for line in part] == [f"{i},{i}" for i in range(10)]
    assert [run.get("role") for run in runs] == (["validation", None] if backwards else [None, "validation"])
    assert says == ("first 40 %" if backwards else "last 40 %")

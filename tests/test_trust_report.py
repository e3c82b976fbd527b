"""reports/trust.md is what trust.json says, and what that says is what is asked of it."""

from __future__ import annotations

from pathlib import Path

from tests.evidence.pages.trust import page
from tests.evidence.results.trust import Trust

REPORTS = Path(__file__).parents[1] / "reports"
STORED = Trust.model_validate_json((REPORTS / "trust.json").read_text(encoding="utf-8"))


def test_the_page_is_what_the_numbers_say() -> None:
    found = (REPORTS / "trust.md").read_text(encoding="utf-8")
    assert found == page(STORED), "run python -m tests.evidence.trust page"


def test_numerical_uncertainties_hold_where_an_order_is_observed() -> None:
    ordered, held = (sum(getattr(row, name) for row in STORED.steps) for name in ("ordered", "ordered_within"))
    assert ordered > 100
    assert held >= 0.95 * ordered

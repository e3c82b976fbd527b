"""reports/accelerometers.md is what accelerometers.json says; and some of its sets, made and diagnosed again."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.evidence.accelerometers import NOISE, told
from tests.evidence.pages.accelerometers import SHOWN, page
from tests.evidence.results.accelerometers import Accelerometers, Kind

REPORTS = Path(__file__).parents[1] / "reports"
STORED = Accelerometers.model_validate_json((REPORTS / "accelerometers.json").read_text(encoding="utf-8"))


def test_the_page_is_what_the_numbers_say() -> None:
    found = (REPORTS / "accelerometers.md").read_text(encoding="utf-8")
    assert found == page(STORED), "run python -m tests.evidence.accelerometers page"


def test_a_longer_coupler_is_named_where_accelerometers_show_it_and_nothing_else_where_they_do_not() -> None:
    links = [r for r in STORED.sets if r.kind == "link"]
    clear = [r for r in links if r.sigmas >= SHOWN]
    assert len(links) >= 30
    assert sum(r.right for r in clear) >= 0.95 * len(clear)
    assert all(r.right or not r.named for r in links)
    assert all(r.right for r in links if r.noise == NOISE[0])


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "k"), [("link", 1), ("unbalance", 1), ("clearance", 0)])
def test_a_set_is_told_as_it_is_stored(kind: Kind, k: int) -> None:
    again, stored = told(kind, k), next(r for r in STORED.sets if (r.kind, r.set) == (kind, k))
    assert (again.truth, again.right) == (stored.truth, stored.right)

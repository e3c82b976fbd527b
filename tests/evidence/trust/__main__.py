"""``python -m tests.evidence.trust``: reports/trust.json and trust.md, made again in parts.

    python -m tests.evidence.trust steps crank-rocker pendulum     # shipped cases, in every engine that is installed
    python -m tests.evidence.trust coverage 0 1 2                  # seeds of hidden sets
    python -m tests.evidence.trust struck                          # a pin that strikes, against its equation of motion
    python -m tests.evidence.trust foretold FOLDER pendulum emps   # what others measured, in this folder
    python -m tests.evidence.trust swings 1 0 1 2                  # swings fitted, and seeds of a torque without a name
    python -m tests.evidence.trust page                            # trust.md and its figures alone

What was measured before stays, but for the same cases and seeds.
"""

from __future__ import annotations

import sys
import warnings
from pathlib import Path

from analytic.writing import write_atomically
from compare.report.svg import draw
from compare.versions import versions
from sim_models.engine import ENGINES, declared, installed_version
from tests.evidence.pages.trust import figures, page
from tests.evidence.results.trust import Trust
from tests.evidence.trust.coverage import coverage
from tests.evidence.trust.recorded import foretold
from tests.evidence.trust.steps import stepped
from tests.evidence.trust.strikes import struck
from tests.evidence.trust.swings import swings

FILE = Path("reports/trust.json")


def store(found: Trust) -> None:
    """Write all files."""
    write_atomically(FILE, found.model_dump_json(indent=1) + "\n")
    write_atomically(FILE.with_suffix(".md"), page(found))
    for name, figure in figures(found).items():
        write_atomically(FILE.parent / name, draw(figure))


def swung(found: Trust, fitted: int, *seeds: int) -> None:
    """Foretell made swings from so many, and store each row as it is known."""
    for seed in seeds:
        kept = tuple(one for one in found.swung if (one.fitted, one.seed) != (fitted, seed))
        rows = sorted((*kept, *swings(fitted, iter([seed]))), key=lambda one: (one.fitted, one.seed))
        found = found.model_copy(update={"swung": tuple(rows)})
        store(found)


def main(what: str, *words: str) -> None:
    """Measure, and store each row as it is known."""
    here = {name: v for name in ENGINES if (v := installed_version(declared(name).package))}
    found = Trust.model_validate_json(FILE.read_text(encoding="utf-8")) if FILE.is_file() else Trust(versions={})
    found = found.model_copy(update={"versions": versions(here)})
    if what == "page":
        store(found)
    elif what == "steps":
        for case in words:
            kept = tuple(row for row in found.steps if row.case != case)
            found = found.model_copy(update={"steps": (*kept, *stepped(tuple(here), (case,)))})
            store(found)
    elif what == "struck":
        store(found.model_copy(update={"struck": tuple(struck(here))}))
    elif what == "foretold":
        folder, *cases = words
        for case in cases:
            kept_rigs = tuple(one for one in found.foretold if one.case != case)
            rows = (*kept_rigs, *foretold(Path(folder), (case,)))
            found = found.model_copy(update={"foretold": tuple(sorted(rows, key=lambda one: one.case))})
            store(found)
    elif what == "swings":
        swung(found, *map(int, words))
    elif what == "coverage":
        for row in coverage(map(int, words)):
            kept_sets = tuple(one for one in found.coverage if one.seed != row.seed)
            every = sorted((*kept_sets, row), key=lambda one: one.seed)
            found = found.model_copy(update={"coverage": tuple(every)})
            store(found)
    else:
        sys.exit(__doc__)


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    main(*(sys.argv[1:] or ["-"]))

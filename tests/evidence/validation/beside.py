"""What is stored beside the validation report and is part of it: maps of where contact is lost, and how the diagnosis
does on rigs that rattle.  Both are read from their files, so that a table is never older than they are.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from statistics import median

from compare.diagnose.effects.joints import JointClearance
from compare.results.validity import Validity, foretold
from tests.evidence.results.scoreboard import Scoreboard, Scored, Threshold, relative_errors
from tests.evidence.results.validation import Diagnosed, Mapped, Validation
from tests.evidence.scoreboard.board import thresholds
from tests.evidence.scoreboard.score import RATTLING
from tests.evidence.stored import read
from tests.evidence.validation.workspaces import digits

MAPS = f"validity-*/{Validity.file}"
BOARD = "scoreboard"
LOOSE, STILL = "rattling: ", "still, "  # how the board's lines begin that count them
RATTLING_WANTED, SIZE_WANTED, STEADY_WANTED = 0.75, 0.20, 0.95  # shares of sets; of a size, in the median
EVERY = "all"  # its name among the linkages


def with_beside(found: Validation, folder: Path) -> Validation:
    """A report with the tables of what the folder has beside it.  Raises OptionError."""
    return found.model_copy(update={"maps": tuple(maps(folder)), "diagnosed": tuple(diagnosed(folder))})


def maps(folder: Path) -> Iterator[Mapped]:
    """Each stored map of validity, in a line."""
    for path in sorted(folder.glob(MAPS)):
        found = read(Validity, path.parent)
        told, between = foretold(found.cells), found.between_simulators
        yield Mapped(
            folder=path.parent.name,
            case=found.case,
            joints=found.joints,
            simulators=found.simulators,
            cells=len(found.cells),
            foretold=told.cells,
            lost=told.lost,
            yielding=told.yielding,
            rigid=told.rigid,
            both=between.cells if between else 0,
            same_verdict=between.same_verdict if between else 0,
            free_share_spread=digits(between.free_share_spread) if between else None,
        )


def diagnosed(folder: Path) -> Iterator[Diagnosed]:
    """How the stored sets were diagnosed that rattle, that only seem to, and that have clearance and do not rattle: by
    linkage, and all of them.
    """
    if not (folder / BOARD / Scoreboard.file).is_file():
        return
    results = [r for r in read(Scoreboard, folder / BOARD).results if r.kind in RATTLING or _steady(r)]
    for case in sorted({r.case for r in results}):
        yield _of(case, [r for r in results if r.case == case])
    yield _of(EVERY, results)


def _steady(r: Scored) -> bool:
    """Whether a set has a joint with clearance that does not rattle."""
    return r.kind not in RATTLING and any(e.effect.split("@")[0] == JointClearance.name for e in r.truth)


def _of(case: str, results: Sequence[Scored]) -> Diagnosed:
    lines = thresholds(results)

    def line(begins: str) -> tuple[int, int]:
        row: Threshold | None = next((each for each in lines if each.what.startswith(begins)), None)
        return (row.count, row.of) if row else (0, 0)

    (named, loose), (clear, still) = line(LOOSE), line(STILL)
    steady = [r for r in results if _steady(r)]
    sizes = relative_errors(p for r in results if r.kind == RATTLING[0] for p in r.parameters)
    return Diagnosed(
        case=case,
        loose=loose,
        named=named,
        size_off=digits(median(map(abs, sizes))) if sizes else None,
        steady=len(steady),
        steady_named=sum(r.outcome in ("exact", "tie") for r in steady),
        still=still,
        false=still - clear,
    )

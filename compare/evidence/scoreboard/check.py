"""The scoreboard: a share of its sets diagnosed again and compared, or all of them, stored."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from pathlib import Path

from analytic.mechanism.one_line import count
from compare.arguments import cores
from compare.evidence.scoreboard.board import FULL, board, digest, run_all, seeds
from compare.evidence.stored import read, store
from compare.files import output_folder
from compare.results.scoreboard import Scoreboard, ScoreboardCheck

WHERE = Path("reports") / "scoreboard"
EVERY = 20  # sets, of which a check does one again
Progress = Callable[[int, int | None], None]


def check_scoreboard(
    folder: str | Path = WHERE,
    *,
    every: int = EVERY,
    workers: int | None = None,
    progress: Progress = lambda done, total: None,
) -> ScoreboardCheck:
    """Do one set in ``every`` again, and find those whose outcome is worse than it is stored.

    Raises OptionError for a stored board that cannot be read.
    """
    stored = read(Scoreboard, folder)
    before = {r.seed: r for r in stored.results}
    found = run_all(sorted(before)[::every], None, workers or cores(), progress)
    path = Path(folder) / Scoreboard.file
    code = "of this very code" if stored.code == digest() else "of other code than this"
    return ScoreboardCheck(
        stored=str(path),
        made_again=f"{len(found)} of {count(len(before), 'set')} made again",
        differences=tuple(
            f"seed {r.seed}: was {before[r.seed].outcome}, is {r.outcome}"
            for r in found
            if before[r.seed].good and not r.good
        ),
        notes=(f"{path} is {code}",),
        left_out=(),
    )


def update_scoreboard(
    folder: str | Path = WHERE,
    counts: Mapping[str, int | None] | None = None,
    *,
    workers: int | None = None,
    progress: Progress = lambda done, total: None,
) -> Scoreboard:
    """Make, diagnose and score all sets (``counts`` of each kind, None for as many as there are on the full board), and
    write the board and its page.  What was interrupted goes on where it stopped.  Raises OutputError.
    """
    asked = {} if counts is None else counts
    wanted = seeds({kind: full if (n := asked.get(kind)) is None else n for kind, full in FULL.items()})
    records = output_folder(output_folder(Path(folder), "--reports") / "runs", "--reports")
    found = board(run_all(wanted, records, workers or cores(), progress))
    store(found, folder, "--reports")
    shutil.rmtree(records)
    return found

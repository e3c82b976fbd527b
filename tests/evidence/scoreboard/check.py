"""The scoreboard: a share of its sets diagnosed again and compared, or all of them, stored."""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path

from analytic.mechanism.one_line import count
from compare.arguments import cores
from compare.faults import OptionError
from compare.files import made_folder
from compare.results.document import DocumentError
from tests.evidence.results.scoreboard import Scoreboard, ScoreboardCheck
from tests.evidence.scoreboard.board import FULL, board, digest, in_turn, kept, run_all, seeds
from tests.evidence.stored import read, store

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
    code = digest()
    same = sum(r.code == code for r in kept(stored).values())
    return ScoreboardCheck(
        stored=str(path),
        made_again=f"{len(found)} of {count(len(before), 'set')} made again",
        differences=tuple(
            f"seed {r.seed}: was {before[r.seed].outcome}, is {r.outcome}"
            for r in found
            if before[r.seed].good and not r.good
        ),
        notes=(f"{path}: {same} of {count(len(before), 'set')} {'is' if same == 1 else 'are'} of this very code",),
        left_out=(),
    )


def update_scoreboard(
    folder: str | Path = WHERE,
    counts: Mapping[str, int | None] | None = None,
    *,
    minutes: float = math.inf,
    workers: int | None = None,
    progress: Progress = lambda done, total: None,
) -> Scoreboard:
    """Make, diagnose and score all sets (``counts`` of each kind, None for as many as there are on the full board), and
    write the board and its page.

    What the stored board has of this very code is not done again.  After about so many ``minutes`` the board is written
    with what there is: a set that was not reached keeps the score that other code gave it, or is absent.  What was
    interrupted goes on where it stopped.  Raises OptionError where no set is asked for, OutputError.
    """
    asked = {} if counts is None else counts
    wanted = seeds({kind: full if (n := asked.get(kind)) is None else n for kind, full in FULL.items()})
    if not wanted:
        raise OptionError("no set is asked for; give one kind of set a number above 0")
    if not minutes > 0:
        raise OptionError(f"--minutes: {minutes:g} is no time to work in; give a number above 0")
    try:
        known = kept(Scoreboard.read(Path(folder) / Scoreboard.file))
    except DocumentError:
        known = {}  # there is none, or it cannot be read and is written anew
    code = digest()
    todo = in_turn((seed for seed in wanted if seed not in known or known[seed].code != code), known)
    with made_folder(Path(folder) / "runs", "--reports") as records:
        known |= {r.seed: r for r in run_all(todo, records, workers or cores(), progress, minutes)}
        found = board([known[seed] for seed in wanted if seed in known])
        store(found, folder, "--reports")
        shutil.rmtree(records)
    return found

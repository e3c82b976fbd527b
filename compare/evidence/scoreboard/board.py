"""The board of many sets: each drawn, recorded, diagnosed and scored by itself; what thresholds the whole of them
meets.
"""

from __future__ import annotations

import hashlib
import tempfile
import time
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from analytic.mechanism import MechanismWarning
from compare.evidence.scoreboard.hidden import FIRST
from compare.evidence.scoreboard.record import make
from compare.evidence.scoreboard.score import failed, opened, score
from compare.sweep import sweep

FULL = {"effects": 220, "none": 300, "outside": 30, "alias": 8}  # sets of each kind
CLOSED = 1.1  # of the noise floor
Result = dict[str, Any]


def seeds(counts: Mapping[str, int]) -> list[int]:
    """Seeds of so many sets of each kind."""
    return [FIRST[kind] + k for kind, count in counts.items() for k in range(count)]


def examine(content: Mapping[str, Any]) -> Result:
    """Draw, record, diagnose and score the set of ``content["seed"]``."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", MechanismWarning)  # of values that are only tried
        data, seal = Path(folder, "data"), Path(folder, "seal")
        make(content["seed"], data, seal)
        return scored(data, seal)


def scored(data: Path, seal: Path) -> Result:
    """Diagnose a recorded set without looking at its seal, then open it."""
    from compare.diagnose.data.measured import load_measured
    from compare.diagnose.data.recording import MeasuredError
    from compare.diagnose.workflow import diagnose
    from sim_models.engine import SimulationError, Unsupported

    simulator, began = opened(seal)["simulator"], time.perf_counter()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            result = diagnose(load_measured(data / "measured.toml"), simulator, others=False, workers=1).plain()
    except (MeasuredError, SimulationError, Unsupported) as error:
        return failed(opened(seal), f"{type(error).__name__}: {error}")
    return score(result, opened(seal)) | {"seconds": round(time.perf_counter() - began, 1)}


def run_all(
    wanted: Sequence[int],
    folder: Path | None,
    workers: int,
    progress: Callable[[int, int | None], None] = lambda done, total: None,
) -> list[Result]:
    """The scores of these seeds, in order; what the folder holds of this very code is not done again."""
    code = digest()
    contents = [{"seed": seed, "code": code} for seed in wanted]
    found: dict[int, Result] = {}
    for end in sweep(examine, contents, folder, workers=workers, progress=progress):
        seed = wanted[end.index]
        found[seed] = (
            end.result if not end.failure else {"seed": seed, "outcome": "failed", "good": False, "why": end.failure}
        )
    return [found[seed] for seed in wanted]


def digest() -> str:
    """Of all code that a score depends on, so that a resumed board is never made of two versions."""
    root = Path(__file__).parents[3]
    parts = [root / "analytic", root / "sim_models", root / "compare" / "diagnose", Path(__file__).parent]
    hashed = hashlib.sha256()
    for path in sorted(p for part in parts for p in part.rglob("*") if p.suffix in (".py", ".toml")):
        hashed.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes())
    return hashed.hexdigest()[:16]


# ---------------------------------------------------------------- thresholds


def thresholds(results: Iterable[Result]) -> list[dict[str, Any]]:
    """What is asked of the board, how many of how many meet it, and whether that is enough."""
    results = list(results)

    def of(kind: str) -> list[Result]:
        return [r for r in results if r.get("kind") == kind]

    effects = of("effects")
    clear, blurred = ([r for r in effects if r["distinguishable"] is is_clear] for is_clear in (True, False))
    intervals = [p["covered"] for r in effects for p in r["parameters"]]
    explained = [r for r in effects if r["verdict"] == "explained"]
    closed = [r for r in explained if r["gap"]["after"] <= CLOSED * r["gap"]["noise_floor"]]
    rows = [
        _share("exact where every effect is distinguishable", _count(clear, "exact"), len(clear), 0.95),
        _share("exact or tie otherwise", _count(blurred, "exact", "tie"), len(blurred), 0.95),
        _share("wrong", _count(effects, "wrong"), len(effects), 0.0, 0.02),
        _share("false alarms without any effect", _count(of("none"), "false alarm"), len(of("none")), 0.0, 0.01),
        _share("95 % intervals that cover the truth", sum(intervals), len(intervals), 0.90, 0.99),
        _share(f"gap after at most {CLOSED:g} of the noise floor where explained", len(closed), len(explained), 1.0),
        _share(
            "outside the vocabulary: not explained away",
            _count(of("outside"), "abstained", "partly"),
            len(of("outside")),
            0.95,
        ),
        _share("clearance or length: as the load allows", sum(r["good"] for r in of("alias")), len(of("alias")), 1.0),
        _share("diagnosed at all", len(results) - _count(results, "failed"), len(results), 1.0),
    ]
    return [row for row in rows if row["of"]]


def _share(what: str, count: int, total: int, least: float, most: float = 1.0) -> dict[str, Any]:
    met = least * total - 1e-9 <= count <= most * total + 1e-9
    return {"what": what, "count": count, "of": total, "least": least, "most": most, "met": met}


def _count(results: Iterable[Result], *outcomes: str) -> int:
    return sum(r["outcome"] in outcomes for r in results)


__all__ = ["FULL", "digest", "examine", "run_all", "scored", "seeds", "thresholds"]

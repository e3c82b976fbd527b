"""The board of many sets: each drawn, recorded, diagnosed and scored by itself; what thresholds the whole of them
meets.
"""

from __future__ import annotations

import hashlib
import math
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TypedDict

from analytic.mechanism import MechanismWarning
from compare.diagnose.data.recording import MeasuredError
from compare.diagnose.workflow import diagnose
from compare.sweep import sweep
from sim_models.engine import ENGINES, SimulationError, Unsupported, declared, installed_version
from tests.evidence.results.scoreboard import Kind, Scoreboard, Scored, Threshold
from tests.evidence.scoreboard.hidden import FIRST, MANY, hidden_in, kind_of
from tests.evidence.scoreboard.record import make_set
from tests.evidence.scoreboard.score import BENCH, CLOSED, NAMED, NAMELESS, RATTLING, closed, failed, opened, score

# sets of each kind
FULL: dict[Kind, int] = {
    "effects": 220,
    "none": 300,
    "outside": 30,
    "alias": 8,
    "machines": 30 * len(hidden_in("machines")),
    "unnamed": 150,
    **dict.fromkeys(BENCH, 60),
    "several": 60,
    **dict.fromkeys(RATTLING, 60),
}
NEAR = 0.2  # of a clearance that rattles: half of the sizes are asked to be nearer
SURE = 0.9  # probability of a claim that is to be right in 93 % of all cases
NORMAL = 1.959964  # of a 95 % interval


def seeds(counts: Mapping[Kind, int]) -> list[int]:
    """Seeds of so many sets of each kind."""
    return [FIRST[kind] + k for kind, count in counts.items() for k in range(count)]


def in_turn(wanted: Iterable[int], known: Mapping[int, Scored]) -> list[int]:
    """Seeds in the order of work: those without a score first, and of each kind as many as of the others, so that what
    is done by a time is a fair sample.
    """
    return sorted(wanted, key=lambda seed: (seed in known, seed - FIRST[kind_of(seed)], seed))


class Asked(TypedDict):
    """A set to be made and diagnosed, and the hash of the code that is to do it."""

    seed: int
    code: str


def examine(content: Asked) -> dict[str, object]:
    """Draw, record, diagnose and score a set: the plain data of a :class:`Scored`, as the sweep stores it."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", MechanismWarning)  # of values that are only tried
        data, seal = Path(folder, "data"), Path(folder, "seal")
        make_set(content["seed"], data, seal)
        return scored(data, seal).model_dump(mode="json", exclude_unset=True)


def scored(data: Path, seal: Path) -> Scored:
    """Diagnose a recorded set, knowing of its seal who is to do so and which words not to use, and score it.  Raises
    DocumentError.
    """
    truth, began = opened(seal), time.perf_counter()
    exclude = () if truth.outside is None else truth.outside.excluded
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            result = diagnose(data, truth.simulator, exclude=exclude, others=False, workers=1)
    except (MeasuredError, SimulationError, Unsupported) as error:
        return failed(truth, f"{type(error).__name__}: {error}")
    seconds = round(time.perf_counter() - began, 1)
    return score(result, truth).model_copy(update={"seconds": seconds})


def run_all(
    wanted: Sequence[int],
    folder: Path | None,
    workers: int,
    progress: Callable[[int, int | None], None] = lambda done, total: None,
    minutes: float = math.inf,
) -> list[Scored]:
    """The scores of these seeds, in order; what the folder holds of this very code is not done again.  After some
    ``minutes`` no more are begun, and those that were not are left out.
    """
    code, end = digest(), time.monotonic() + 60 * minutes

    def asked() -> Iterator[Asked]:
        for seed in wanted:
            if time.monotonic() >= end:
                return
            yield Asked(seed=seed, code=code)

    found: dict[int, Scored] = {}
    for ended in sweep(examine, asked(), folder, workers=workers, progress=lambda n, _: progress(n, len(wanted))):
        seed = wanted[ended.index]
        scored = (
            Scored(seed=seed, outcome="failed", good=False, why=ended.failure)
            if ended.failure
            else Scored.model_validate(ended.result)
        )
        found[seed] = scored.model_copy(update={"code": code})
    return [found[seed] for seed in wanted if seed in found]


def board(results: Sequence[Scored]) -> Scoreboard:
    """The board of these results."""
    diagnosing, code = [name for name in ENGINES if any(r.simulator == name for r in results)], digest()
    codes = {each: Counter(kind_of(r.seed) for r in results if (r.code or code) == each) for each in made_by(results)}
    return Scoreboard(
        versions={name: installed_version(declared(name).package) for name in ENGINES},
        code=code,
        codes={each: {kind: counted[kind] for kind in FIRST if counted[kind]} for each, counted in codes.items()},
        thresholds=thresholds(results),
        by_simulator={name: thresholds(r for r in results if r.simulator == name) for name in diagnosing},
        results=tuple(results),
    )


def made_by(results: Iterable[Scored]) -> list[str]:
    """The codes that made these results, this very one first, then those that made most."""
    code = digest()
    counted = Counter(r.code or code for r in results)
    return sorted(counted, key=lambda each: (each != code, -counted[each], each))


def kept(stored: Scoreboard) -> dict[int, Scored]:
    """The scores of a stored board by seed, each with the code that made it; without those that came to no end."""
    return {r.seed: r.model_copy(update={"code": r.code or stored.code}) for r in stored.results if r.kind is not None}


def digest() -> str:
    """Of all code that a score depends on, so that a resumed board is never made of two versions."""
    root = Path(__file__).parents[3]
    parts = ("analytic", "sim_models", "compare/recorded", "compare/diagnose", "tests/evidence/scoreboard")
    files = [root / "tests" / "evidence" / "contact_ode.py", *(p for part in parts for p in (root / part).rglob("*"))]
    hashed = hashlib.sha256()
    for path in sorted(p for p in files if p.suffix in (".py", ".toml")):
        hashed.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes())
    return hashed.hexdigest()[:16]


# ---------------------------------------------------------------- thresholds


def thresholds(results: Iterable[Scored]) -> tuple[Threshold, ...]:
    """What is asked of the board, how many of how many meet it, and whether that is enough."""
    results = list(results)

    def of(kind: str) -> list[Scored]:
        return [r for r in results if r.kind == kind]

    effects, machines = of("effects"), of("machines")
    clear, blurred = ([r for r in effects if r.distinguishable is is_clear] for is_clear in (True, False))
    told, untold = ([r for r in machines if r.distinguishable is is_clear] for is_clear in (True, False))
    intervals = [p.covered for r in results if r.kind in NAMED for p in r.parameters]
    explained = [r for r in results if r.kind in NAMED and r.verdict == "explained"]
    sure = [claim.right for r in results for claim in r.claims if claim.probability >= SURE]
    rows = [
        _share("exact where every effect is distinguishable", _count(clear, "exact"), len(clear), 0.95),
        _share("exact or tie otherwise", _count(blurred, "exact", "tie"), len(blurred), 0.95),
        _share("wrong", _count(effects, "wrong"), len(effects), 0.0, 0.02),
        _share(
            "real machines: exact or tie where every effect is distinguishable",
            _count(told, "exact", "tie"),
            len(told),
            0.90,
        ),
        _share("real machines: exact or tie otherwise", _count(untold, "exact", "tie"), len(untold), 0.90),
        _share("real machines: wrong", _count(machines, "wrong"), len(machines), 0.0, 0.02),
        _share("false alarms without any effect", _count(of("none"), "false alarm"), len(of("none")), 0.0, 0.01),
        _share("95 % intervals that cover the truth", sum(intervals), len(intervals), 0.90, 0.99),
        _share(f"right of what is claimed with a probability of {SURE:g} or more", sum(sure), len(sure), 0.93),
        _share(
            f"gap after at most {CLOSED:g} of the noise floor where explained",
            sum(map(closed, explained)),
            len(explained),
            1.0,
        ),
        _share(
            "outside the vocabulary: not explained away",
            _count(of("outside"), "abstained", "partly"),
            len(of("outside")),
            0.95,
        ),
        *_of_the_nameless(results),
        _share("clearance or length: as the load allows", sum(r.good for r in of("alias")), len(of("alias")), 1.0),
        *_of_the_bench(results),
        *_of_several([r for r in results if r.kind == "several"]),
        *_of_rattling(results),
        _share("diagnosed at all", len(results) - _count(results, "failed"), len(results), 1.0),
    ]
    return tuple(row for row in rows if row is not None)


def _of_the_nameless(results: Sequence[Scored]) -> list[Threshold | None]:
    """What is asked of sets with something that has no name, and of what is proposed."""
    nameless = [r for r in results if r.kind in NAMELESS]
    unnamed = [r for r in results if r.kind == "unnamed"]
    many = [r for r in nameless if r.sensors >= MANY]
    empty = [r for r in results if r.kind == "none" and r.sensors]
    wrongly = sum(r.verdict == "explained" for r in nameless)
    return [
        _share("no name: not explained away", _count(unnamed, "abstained", "partly"), len(unnamed), 0.95),
        _share("no name: wrongly explained", wrongly, len(nameless), 0.0, 0.03),
        _share(
            "no name: the right place proposed, eight sensors or more",
            sum(bool(r.right_place) for r in many),
            len(many),
            0.80,
        ),
        _share("proposals on effect-free sets", sum(bool(r.proposed) for r in empty), len(empty), 0.0, 0.01),
    ]


def _of_the_bench(results: Sequence[Scored]) -> list[Threshold | None]:
    """What is asked of each family, of its sets with effects and of its empty ones."""
    asked: dict[Kind, tuple[str, float, str, float]] = {
        "slightly-off": (
            "slightly off everywhere: what matters is named, nothing false", 0.95,
            "slightly off, nothing that matters: nothing false named", 0.95,
        ),
        "coarse": ("coarse data: exact or tie", 0.90, "coarse data, empty: no gap", 0.95),
        "coloured": (
            "coloured noise: the truth is named, no false effect of the rig", 0.85,
            "coloured noise, empty: no false effect of the rig", 0.97,
        ),
        "per-run": (
            f"faults of each run: the rig's effect within 5 %, gap after at most {CLOSED:g}", 0.90,
            "faults of each run, empty: no false effect of the rig", 0.95,
        ),
        "large": (
            f"large effects: named, gap after at most {CLOSED:g}", 0.90,
            "where large effects are drawn, empty: nothing named", 0.95,
        ),
    }  # fmt: skip
    rows = []
    for kind, (what, least, empty, clear) in asked.items():
        sets = [r for r in results if r.kind == kind]
        for words, share, found in (
            (what, least, [r for r in sets if r.truth]),
            (empty, clear, [r for r in sets if not r.truth]),
        ):
            rows.append(_sampled(_share(words, sum(r.good for r in found), len(found), share)))
    return rows


def _of_several(sets: Sequence[Scored]) -> list[Threshold | None]:
    """What is asked of sets with several drives."""
    full = [r for r in sets if r.truth]
    empty = [r for r in sets if not r.truth]
    rows = [
        _share("several drives: exact or tie", _count(full, "exact", "tie"), len(full), 0.90),
        _share("several drives: wrong", _count(full, "wrong"), len(full), 0.0, 0.05),
        _share("several drives, empty: no gap", _count(empty, "clear"), len(empty), 0.95),
    ]
    return [_sampled(row) for row in rows]


def _of_rattling(results: Sequence[Scored]) -> list[Threshold | None]:
    """What is asked of rigs that rattle, and of those that only seem to."""
    loose, still = ([r for r in results if r.kind == kind] for kind in RATTLING)
    sizes = [abs(p.error) for r in loose for p in r.parameters if p.error is not None]
    near = sum(error <= NEAR for error in sizes)
    rows = [
        _share("rattling: the joint named, or a tie with it", _count(loose, "exact", "tie"), len(loose), 0.75),
        _share(f"rattling, joint named: size within {100 * NEAR:g} %", near, len(sizes), 0.5),
        _share("still, sensors hum, spike or ring: no clearance named", _count(still, "clear"), len(still), 1.0),
    ]
    return [_sampled(row) for row in rows]


def _sampled(row: Threshold | None) -> Threshold | None:
    """A row with the interval of its share."""
    return row and row.model_copy(update={"interval": wilson(row.count, row.of)})


def wilson(count: int, of: int) -> tuple[float, float]:
    """95 % interval of a share of which ``count`` in ``of`` is a sample (Wilson 1927)."""
    share, z = count / of, NORMAL**2 / of
    middle, half = share + z / 2, math.sqrt(z * (share * (1 - share) + z / 4))
    return max((middle - half) / (1 + z), 0.0), min((middle + half) / (1 + z), 1.0)


def _share(what: str, count: int, total: int, least: float, most: float = 1.0) -> Threshold | None:
    """A row of the table; None where there is no set that it asks of."""
    if not total:
        return None
    met = least * total - 1e-9 <= count <= most * total + 1e-9
    return Threshold(what=what, count=count, of=total, least=least, most=most, met=met)


def _count(results: Iterable[Scored], *outcomes: str) -> int:
    return sum(r.outcome in outcomes for r in results)


__all__ = ["FULL", "board", "digest", "examine", "in_turn", "kept", "run_all", "scored", "seeds", "thresholds"]

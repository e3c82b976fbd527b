"""scoreboard.json: how the diagnosis did on sets of measured data in which something, or nothing, is hidden."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import Field, FiniteFloat

from compare.results.diagnosis import Key
from compare.results.document import Number, Part, Row, Share
from compare.results.evidence import Remade, Stored

Kind = Literal["effects", "none", "outside", "alias"]
Outcome = Literal[
    "exact", "tie", "clear", "abstained", "partly", "incomplete", "missed", "wrong", "false alarm", "failed"
]
Sigmas = Annotated[FiniteFloat, Field(ge=0)]


class Hidden(Part):
    """An effect that was hidden: sigmas of its signature in all, left in the linear problem, and left after its best
    rival.
    """

    effect: Key
    total: Sigmas
    linear: Sigmas
    distinct: Sigmas
    rival: str | None


class Said(Part):
    """An effect that was named."""

    effect: Key
    ambiguous_with: tuple[Key, ...]


class Value(Part):
    """A parameter of an effect that was named exactly, SI."""

    parameter: str
    true: float
    found: float
    error: Annotated[Number, Field(description="Relative.")]
    covered: Annotated[bool, Field(description="Whether the 95 % interval has the true value.")]


class Gap(Part):
    """Root mean square of residual over noise; null where there was no diagnosis."""

    before: Number
    after: Number
    noise_floor: Number


class Scored(Part):
    """How a diagnosis did on a set; of a set that came to no end there is only its seed and why."""

    seed: Annotated[int, Field(ge=0, description="What `compare scoreboard show` takes.")]
    kind: Kind | None = None
    case: Annotated[str, Field(description="The linkage.")] = ""
    source: Annotated[str, Field(description="Engine that recorded the data.")] = ""
    simulator: Annotated[str, Field(description="Engine that diagnosed them.")] = ""
    truth: Annotated[tuple[Hidden, ...], Field(description="What was hidden.")] = ()
    outside: Annotated[str | None, Field(description="What of outside the vocabulary was hidden.")] = None
    distinguishable: Annotated[
        bool, Field(description="Whether every hidden effect has at least 8 sigma left after its best rival.")
    ] = False
    outcome: Outcome
    good: bool
    verdict: str = ""
    named: tuple[Said, ...] = ()
    parameters: Annotated[tuple[Value, ...], Field(description="Where the effects were named exactly.")] = ()
    gap: Gap | None = None
    seconds: Annotated[float, Field(ge=0, description="That the diagnosis took, on whatever machine.")] = 0.0
    why: Annotated[str, Field(description="Of a set that failed.")] = ""

    def __repr__(self) -> str:
        return f"Scored({self.seed}: {self.outcome})"


class Threshold(Part):
    """What is asked of the board, how many of how many meet it, and whether that is enough."""

    what: str
    count: Annotated[int, Field(ge=0)]
    of: Annotated[int, Field(ge=1)]
    least: Annotated[Share, Field(description="Share that is asked for.")]
    most: Share
    met: bool


class Scoreboard(Stored):
    """How the diagnosis did on sets of measured data in which something, or nothing, is hidden."""

    file: ClassVar[str] = "scoreboard.json"
    presentation: ClassVar[str] = "scoreboard"
    remedy: ClassVar[str] = "restore it, or write it with compare scoreboard update"
    opens: ClassVar[str] = "README.md"

    versions: Annotated[Mapping[str, str | None], Field(description="Of the engines.")]
    code: Annotated[
        str,
        Field(
            min_length=1,
            description="Hash over the code of the model, the engines' models, the diagnosis and this board.",
        ),
    ]
    thresholds: tuple[Threshold, ...]
    by_simulator: Annotated[Mapping[str, tuple[Threshold, ...]], Field(description="By diagnosing engine.")]
    results: Annotated[tuple[Scored, ...], Field(min_length=1)]

    @property
    def missed(self) -> tuple[Threshold, ...]:
        """The thresholds that are not met."""
        return tuple(row for row in self.thresholds if not row.met)

    def rows(self) -> list[Row]:
        """A row for each set."""
        return [
            {"seed": r.seed, "kind": r.kind, "case": r.case, "source": r.source, "simulator": r.simulator}
            | {"outcome": r.outcome, "verdict": r.verdict, "seconds": r.seconds}
            for r in self.results
        ]

    def units(self) -> Mapping[str, str]:
        """SI unit of each column."""
        return {"seconds": "s"}

    def __repr__(self) -> str:
        good = sum(r.good for r in self.results)
        met = len(self.thresholds) - len(self.missed)
        return f"Scoreboard({good} of {len(self.results)} sets good; {met} of {len(self.thresholds)} thresholds met)"


class ScoreboardCheck(Remade):
    """A share of the sets, diagnosed again and compared."""

    file: ClassVar[str] = "scoreboard-check.json"
    remedy: ClassVar[str] = "give what compare scoreboard check --json prints"

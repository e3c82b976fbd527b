"""scoreboard.json: how the diagnosis did on sets of measured data in which something, or nothing, is hidden; and
truth.json, what is hidden in one of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import Field, FiniteFloat

from analytic.mechanism.one_line import count
from compare.results.diagnosis import Key, Unknown
from compare.results.document import Number, Part, Row, Share
from tests.evidence.results.remade import Evidence, Remade, Stored

Kind = Literal[
    "effects",
    "none",
    "outside",
    "alias",
    "machines",
    "unnamed",
    "slightly-off",
    "coarse",
    "coloured",
    "per-run",
    "large",
    "several",
    "rattling",
    "still",
]  # fmt: skip
Outcome = Literal[
    "exact", "tie", "clear", "abstained", "partly", "incomplete", "missed", "wrong", "false alarm", "failed"
]
Sigmas = Annotated[FiniteFloat, Field(ge=0)]


class Recorder(Part):
    """The engine that recorded the data of a set."""

    name: str
    version: str | None


class TrueEffect(Part):
    """An effect of the vocabulary that is hidden in a set: its place, its size, and how well it shows."""

    name: str
    where: str
    parameters: Annotated[Mapping[str, FiniteFloat], Field(description="SI; a value per run is offset@run.")]
    total: Annotated[Sigmas, Field(description="Of its signature.")]
    linear: Annotated[Sigmas, Field(description="Left of it by the best rival in the linear problem.")]
    distinct: Annotated[
        Sigmas,
        Field(description="Left of it by the best rival that was fitted; 0 of rigs that rattle, where none was."),
    ]
    rival: Annotated[str | None, Field(description="That rival; null if none took anything away.")]

    @property
    def key(self) -> str:
        """``name@where``."""
        return f"{self.name}@{self.where}"


class TrueFault(Part):
    """Something else in a set: what is slightly off in the rig, or a fault of a sensor; never wrong when named."""

    name: str
    where: str
    parameters: Annotated[Mapping[str, FiniteFloat], Field(description="SI; a value per run is offset@run.")]

    @property
    def key(self) -> str:
        """``name@where``."""
        return f"{self.name}@{self.where}"


class TrueOutsider(Part):
    """A fault outside the vocabulary that is hidden in a set: its place, its size, and the other numbers it has."""

    kind: Literal[
        "cracked tooth", "Stribeck friction", "nonlinear spring", "periodic torque", "bent link", "hysteretic spring",
        "slipping belt", "growing link", "loose bolt", "stick-slip",
    ]  # fmt: skip
    where: str
    unknown: Annotated[Unknown, Field(description="What a proposal would call it.")]
    places: Annotated[tuple[str, ...], Field(min_length=1, description="Where a proposal of it would be right.")]
    excluded: Annotated[
        tuple[str, ...], Field(description="Effects that say what it is, and that the diagnosis is to do without.")
    ] = ()
    size: Annotated[
        FiniteFloat,
        Field(
            description="Largest: rad of a cracked tooth, m of a link; rad a second and N.m of a slipping belt; else"
            " N.m, in slow and fast friction that of Coulomb."
        ),
    ]
    left: Annotated[Sigmas, Field(description="Of its signature, by the best single effect of the vocabulary.")]
    angle: Annotated[FiniteFloat, Field(description="Of a cracked tooth on the crank (rad).")] = 0.0
    width: Annotated[FiniteFloat, Field(description="Of a cracked tooth (rad).")] = 0.0
    rate: Annotated[FiniteFloat, Field(description="Of a periodic torque (rad/s).")] = 0.0
    phase: Annotated[FiniteFloat, Field(description="Of a periodic torque (rad).")] = 0.0
    rest: Annotated[FiniteFloat, Field(description="Angle at which a nonlinear spring is at rest (rad).")] = 0.0
    travel: Annotated[FiniteFloat, Field(description="From there, at which its torque is ``size`` (rad).")] = 0.0
    stribeck_rate: Annotated[FiniteFloat, Field(description="Below which friction grows (rad/s).")] = 0.0
    excess: Annotated[FiniteFloat, Field(description="By how much, as a share of ``size``.")] = 0.0
    sharp_rate: Annotated[FiniteFloat, Field(description="Over which it changes its sign (rad/s).")] = 0.0

    give: Annotated[
        FiniteFloat, Field(description="Over which a hysteretic spring is elastic, or friction sticks (rad).")
    ] = 0.0
    sharpness: Annotated[FiniteFloat, Field(description="Exponent with which a hysteretic spring yields.")] = 0.0
    fatness: Annotated[FiniteFloat, Field(description="Of its loop; 0.5 where it unloads along a line.")] = 0.0
    warming: Annotated[FiniteFloat, Field(description="Time constant with which a link grows in a run (s).")] = 0.0

    @property
    def unit(self) -> str:
        """SI unit of its size."""
        if self.kind in ("bent link", "growing link", "loose bolt"):
            return "m"
        return {"cracked tooth": "rad", "slipping belt": "rad/(N.m.s)"}.get(self.kind, "N.m")


class Truth(Evidence):
    """What is hidden in a set of measured data, and who recorded it for whom to diagnose."""

    file: ClassVar[str] = "truth.json"
    presentation: ClassVar[str] = "hidden_set"
    remedy: ClassVar[str] = "give the seal that python -m tests.evidence scoreboard show --out leaves"
    opens: ClassVar[str] = ""

    seed: Annotated[int, Field(ge=0)]
    attempt: Annotated[int, Field(ge=0, description="Draws of this seed that made no usable set before this one.")]
    kind: Kind
    case: Annotated[str, Field(description="The linkage.")]
    source: Recorder
    simulator: Annotated[str, Field(description="Engine that is to diagnose the data.")]
    effects: Annotated[tuple[TrueEffect, ...], Field(description="What is to be named.")]
    slight: Annotated[tuple[TrueFault, ...], Field(description="What is slightly off in the rig beside them.")] = ()
    faults: Annotated[tuple[TrueFault, ...], Field(description="What is wrong with the sensors beside them.")] = ()
    together: Annotated[Sigmas, Field(description="Of the signature of all that is slightly off.")] = 0.0
    noise: Annotated[
        Mapping[str, Annotated[FiniteFloat, Field(gt=0)]],
        Field(description="1-sigma of each sensor by signal, in the signal's SI unit."),
    ]
    reversed_load: Annotated[bool, Field(description="Of an alias set: whether a run has the load reversed.")]
    outside: Annotated[
        TrueOutsider | None, Field(description="null where nothing of outside the vocabulary is hidden.")
    ]
    free: Annotated[Share, Field(description="Of the time, that a pin with clearance is off its wall.")] = 0.0

    def rows(self) -> list[Row]:
        """A row for each thing that is hidden, with its size."""
        inside: list[Row] = [
            {"name": e.name, "where": e.where, "total": e.total, "distinct": e.distinct, **e.parameters}
            for e in self.effects
        ]
        other = self.outside
        return inside if other is None else [{"name": other.kind, "where": other.where, "size": other.size}]

    def __repr__(self) -> str:
        hidden = [e.key for e in self.effects] + ([self.outside.kind] if self.outside is not None else [])
        return f"Truth({self.seed}: {self.case}, {', '.join(hidden) or 'nothing'} hidden)"


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
    small_errors: Annotated[tuple[Key, ...], Field(description="That together do as well in its place.")] = ()


class Value(Part):
    """A parameter of an effect that was named exactly, SI."""

    parameter: str
    true: float
    found: float
    error: Annotated[Number, Field(description="Relative.")]
    covered: Annotated[bool, Field(description="Whether the 95 % interval has the true value.")]


def relative_errors(values: Iterable[Value]) -> list[float]:
    """The relative errors of those whose size is known to be off by so much."""
    return [value.error for value in values if value.error is not None]


class Gap(Part):
    """Root mean square of residual over noise; null where there was no diagnosis."""

    before: Number
    after: Number
    noise_floor: Number


class Claim(Part):
    """How probable a diagnosis holds an effect at its place, and whether it is in the set."""

    effect: Key
    probability: Share
    right: bool


class Scored(Part):
    """How a diagnosis did on a set; of a set that came to no end there is only its seed and why."""

    seed: Annotated[int, Field(ge=0, description="What `python -m tests.evidence scoreboard show` takes.")]
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
    claims: Annotated[
        tuple[Claim, ...],
        Field(description="Effects, named or not, of a probability of at least 5 %; none in sets of what has no name."),
    ] = ()
    parameters: Annotated[tuple[Value, ...], Field(description="Where the effects were named exactly.")] = ()
    gap: Gap | None = None
    named_all: Annotated[
        bool,
        Field(
            description="Sets of the bench: whether each effect to be named is named, or tied with what is; of an empty"
            " one, whether nothing that is named is false."
        ),
    ] = False
    false_rig: Annotated[
        tuple[Key, ...],
        Field(
            description="Sets of the bench, and still ones: named effects of the rig, not of a sensor, that are not in"
            " the set."
        ),
    ] = ()
    worst_error: Annotated[
        float | None,
        Field(
            ge=0,
            description="Sets of the bench: largest relative error of what is to be named, a vector by its length, an"
            " angle in rad; null where one of them is not named itself.",
        ),
    ] = None
    proposed: Annotated[
        tuple[Key, ...], Field(description="unknown@place of what is proposed, and of the places that do as well.")
    ] = ()
    free: Annotated[Share, Field(description="Of the time, that the pin with clearance was off its wall.")] = 0.0
    right_place: Annotated[
        bool | None,
        Field(description="Whether what has no name is proposed where it is; null where there is no such thing."),
    ] = None
    sensors: Annotated[
        int, Field(ge=0, description="Signals that were measured; 0 where that, and what is proposed, was not kept.")
    ] = 0
    code: Annotated[str, Field(description="Hash of the code that made it; empty for that of the board.")] = ""
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
    interval: Annotated[
        tuple[Share, Share] | None,
        Field(description="95 % interval of the share (Wilson); rows of the bench, and of several drives."),
    ] = None


class Scoreboard(Stored):
    """How the diagnosis did on sets of measured data in which something, or nothing, is hidden."""

    file: ClassVar[str] = "scoreboard.json"
    presentation: ClassVar[str] = "scoreboard"
    remedy: ClassVar[str] = "restore it, or write it with python -m tests.evidence scoreboard update"
    opens: ClassVar[str] = "README.md"

    versions: Annotated[Mapping[str, str | None], Field(description="Of the engines.")]
    code: Annotated[
        str,
        Field(
            min_length=1,
            description="Hash over the code of the model, the engines' models, the diagnosis and this board.",
        ),
    ]
    codes: Annotated[
        Mapping[str, Mapping[Kind, int]], Field(description="By code that made them, how many sets of each kind.")
    ] = Field(default_factory=dict)
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
        sets, thresholds = count(len(self.results), "set"), count(len(self.thresholds), "threshold")
        return f"Scoreboard({good} of {sets} good; {met} of {thresholds} met)"


class HiddenSet(Evidence):
    """One set, made and diagnosed again: what is hidden in it, and how the diagnosis did."""

    file: ClassVar[str] = "scoreboard-set.json"
    presentation: ClassVar[str] = "hidden_set"
    remedy: ClassVar[str] = "give what python -m tests.evidence scoreboard show --json prints"
    opens: ClassVar[str] = ""

    truth: Truth
    scored: Scored

    def rows(self) -> list[Row]:
        """A row for each thing that is hidden, with its size."""
        return self.truth.rows()

    def __repr__(self) -> str:
        return f"HiddenSet({self.truth!r}, {self.scored!r})"


class ScoreboardCheck(Remade):
    """A share of the sets, diagnosed again and compared."""

    file: ClassVar[str] = "scoreboard-check.json"
    remedy: ClassVar[str] = "give what python -m tests.evidence scoreboard check --json prints"

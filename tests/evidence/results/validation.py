"""validation.json: every shipped case in every engine, and what the paper's two approximations cost."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import Field, FiniteFloat, PrivateAttr

from analytic.mechanism.one_line import count
from analytic.mechanism.parts import ContactLaw
from compare.results.contact import StatisticName
from compare.results.crosscheck import CrossCheck
from compare.results.document import Number, Part, Row
from sim_models.engine import Cause, JointModel, Motion
from tests.evidence.results.remade import Remade, Stored

Positive = Annotated[FiniteFloat, Field(gt=0)]
NotNegative = Annotated[FiniteFloat, Field(ge=0)]


class ValidationRun(Part):
    """A shipped case in an engine, and how near its signals are to their tolerances."""

    case: str
    run: Annotated[str, Field(description="Joint model and motion.")]
    simulator: str
    verdict: Annotated[str, Field(min_length=1, description="agrees, disagrees, unjudged, or failed and why")]
    signals: Annotated[int, Field(ge=1, description="How many were compared.")] = 1
    closest: Annotated[str, Field(description="The signal that is nearest to its tolerance.")] = ""
    share: Annotated[FiniteFloat, Field(ge=0, description="Of its tolerance, to one digit.")] = 0.0

    @property
    def key(self) -> tuple[str, str, str]:
        """Case, run and engine."""
        return self.case, self.run, self.simulator

    @property
    def compared(self) -> bool:
        """Whether any signal was compared."""
        return "share" in self.model_fields_set


class AtScale(Part):
    """A run of the linkage at a scale."""

    length: Annotated[Positive, Field(description="Of the coupler (m).")]
    speed: Annotated[Positive, Field(description="Of the crank (rad/s).")]
    mass_ratio: Annotated[Positive, Field(description="The coupler's mass over that of a steel bar of its size.")]
    simulator: str
    run: Annotated[str, Field(description="Joint model and motion.")]
    verdict: Literal["agrees", "disagrees", "refused", "unjudged"]
    why: Annotated[str, Field(description="The sentence with which a run was refused.")] = ""
    cause: Annotated[Cause | None, Field(description="What kind of failure that is, if it is known.")] = None

    @property
    def scale(self) -> tuple[float, float, float]:
        """Length (m), speed (rad/s) and ratio of masses."""
        return self.length, self.speed, self.mass_ratio


class FirstOrder(Part):
    """What Eq. 8 is off by at one clearance."""

    clearance: Annotated[Positive, Field(description="Radial, in B (m).")]
    angle: Annotated[NotNegative, Field(description="Of a reaction's direction (deg).")]
    magnitude: Annotated[NotNegative, Field(description="Of a reaction's size, as a share of it.")]


class Superposed(Part):
    """What superposition is off by at one clearance and crank angle, as a share of the displacement."""

    clearance: Annotated[NotNegative, Field(description="Radial, in B (m).")]
    crank_angle: Annotated[FiniteFloat, Field(description="rad")]
    first_order: NotNegative
    equilibrium: NotNegative


class OverWorkspace(Part):
    """A platform with loose pins at those poses of its workspace at which its drives hold it well."""

    holding: Annotated[Positive, Field(description="Condition number of the loops up to which poses count.")]
    poses: Annotated[int, Field(ge=1, description="How many.")]
    displacement: Annotated[NotNegative, Field(description="Largest displacement in equilibrium (m).")]
    farthest: Annotated[NotNegative, Field(description="Largest displacement wherever the pins lie (m).")]
    first_order: Annotated[
        NotNegative, Field(description="What Eq. 8 is off by, as a share of the displacement: the median.")
    ]
    first_order_worst: Annotated[NotNegative, Field(description="The same at the worst pose.")]


class InEngine(Part):
    """A platform with loose pins in an engine with real contact, at poses along a spiral: moved slowly along it, or at
    rest.
    """

    simulator: str
    motion: Motion
    poses: Annotated[int, Field(ge=1, description="How many.")]
    equilibrium: Annotated[
        NotNegative,
        Field(description="What the equilibrium is off the engine, as a share of the displacement: the median."),
    ]
    equilibrium_worst: Annotated[NotNegative, Field(description="The same at the worst pose.")]
    first_order: Annotated[NotNegative, Field(description="What Eq. 8 is off the engine: the median.")]
    first_order_worst: Annotated[NotNegative, Field(description="The same at the worst pose.")]
    flies: Annotated[NotNegative, Field(description="Largest share of the motion in which a pin has no contact.")]


class Bent(Part):
    """A platform on links that bend, at rest at poses along a spiral: superposition beside beams."""

    case: str
    joints: JointModel
    poses: Annotated[int, Field(ge=1, description="How many.")]
    displacement: Annotated[
        NotNegative, Field(description="Largest displacement of its centre from the ideal one (m).")
    ]
    off: Annotated[NotNegative, Field(description="What superposition is off, as a share of it: the median.")]
    off_worst: Annotated[NotNegative, Field(description="The same at the worst pose.")]


class Carried(Part):
    """A linkage of several drives in files that one program writes and another one reads."""

    case: str
    simulator: Annotated[str, Field(description="Whose model was exported.")]
    alone: Annotated[
        NotNegative,
        Field(description="What its script gives without this project is off the run: a share of the largest value."),
    ]
    checked: Annotated[
        NotNegative, Field(description="Share of a tolerance, of what the script wrote, by compare check.")
    ]
    imported: Annotated[
        NotNegative | None, Field(description="What reactions and drives of the MJCF file, read again, are off.")
    ] = None
    simulated: Annotated[
        NotNegative | None, Field(description="Share of a tolerance, of the MJCF file as an engine of its own.")
    ] = None


class Known(Part):
    """A figure over revolutions, SI, and its 95 % interval."""

    value: Number
    low: Number
    high: Number

    @property
    def half_width(self) -> float:
        """Half of the interval's width; infinite where there is none."""
        return math.inf if self.low is None or self.high is None else (self.high - self.low) / 2

    def agrees(self, other: Known) -> bool:
        """Whether two figures are no farther apart than their intervals leave open."""
        return abs((self.value or 0.0) - (other.value or 0.0)) <= math.hypot(self.half_width, other.half_width)


class Struck(Part):
    """A linkage whose pin strikes its wall, by one law of contact, in one engine or by the equation."""

    case: str
    law: ContactLaw
    joint: str
    clearance: Annotated[Positive, Field(description="Radial (m).")]
    speed: Annotated[Positive, Field(description="Of the crank (rad/s).")]
    restitution: Annotated[NotNegative, Field(description="Asked for.")]
    stiffness: Annotated[Positive, Field(description="Of the contact (N/m).")]
    friction: Annotated[NotNegative, Field(description="Coulomb's coefficient in the contact.")]
    simulator: Annotated[str, Field(description="An engine's name, or equation: an ODE of its own.")]
    joint_model: JointModel
    revolutions: Annotated[int, Field(ge=1)]
    ideal_peak: Annotated[Positive | None, Field(description="Largest reaction of the ideal linkage (N).")] = None
    missing: Annotated[NotNegative | None, Field(description="Of the energy that is turned over: what no account has.")]
    statistics: Mapping[StatisticName, Known]

    @property
    def peak_ratio(self) -> float | None:
        """A revolution's peak force over the ideal linkage's largest reaction."""
        peak = self.statistics["peak_force"].value
        return None if peak is None or self.ideal_peak is None else peak / self.ideal_peak

    @property
    def key(self) -> tuple[str, str, float, str]:
        """Case, law, friction and by whom."""
        return self.case, self.law, self.friction, self.simulator


class Delivered(Part):
    """What a law of contact delivers of the restitution that it is asked for."""

    law: str
    simulator: Annotated[str, Field(description="An engine's name, or formula.")]
    joint_model: JointModel | None
    asked: Annotated[tuple[float, ...], Field(description="Restitution asked for.")]
    delivered: Annotated[tuple[float | None, ...], Field(description="Of each; null where it cannot be asked.")]


class Mapped(Part):
    """A stored map of validity, in a line."""

    folder: Annotated[str, Field(description="Its folder, beside this report.")]
    case: str
    joints: Annotated[tuple[str, ...], Field(description="Those with clearance.")]
    simulators: tuple[str, ...]
    cells: Annotated[int, Field(ge=1, description="Of all engines.")]
    foretold: Annotated[int, Field(ge=0, description="In how many the analytic model says whether a pin leaves.")]
    lost: Annotated[int, Field(ge=0, description="In how many of these one does.")]
    yielding: Annotated[int, Field(ge=0, description="In how many that is as the model says, with walls that yield.")]
    rigid: Annotated[int, Field(ge=0, description="The same with rigid walls.")]
    both: Annotated[int, Field(ge=0, description="Places that two or more engines could simulate.")]
    same_verdict: Annotated[int, Field(ge=0, description="Of these: where they say the same.")]
    free_share_spread: Annotated[
        NotNegative | None, Field(description="Largest difference of their shares without contact; null for one.")
    ]


class Diagnosed(Part):
    """How the sets of the scoreboard were diagnosed whose pins rattle, only seem to, or have clearance all the same."""

    case: Annotated[str, Field(description="The linkage, or all.")]
    loose: Annotated[int, Field(ge=0, description="Sets that rattle.")]
    named: Annotated[int, Field(ge=0, description="Of these: the right joint, or a tie with it.")]
    size_off: Annotated[NotNegative | None, Field(description="Relative error of the clearance found: the median.")]
    steady: Annotated[int, Field(ge=0, description="Sets with clearance that does not rattle.")]
    steady_named: Annotated[int, Field(ge=0, description="Of these: named, or a tie with it.")]
    still: Annotated[int, Field(ge=0, description="Sets without clearance whose sensors hum, spike or ring.")]
    false: Annotated[int, Field(ge=0, description="Of these: clearance is named.")]


class Sought(Part):
    """A parameter of a law of contact, as it is and as it was found, SI, with its 95 % interval; null where an end is
    open, or nothing was found.
    """

    true: FiniteFloat
    found: Number
    low: Number
    high: Number

    @property
    def covered(self) -> bool:
        """Whether it was found, and its interval has the true value."""
        low, high = (-math.inf if self.low is None else self.low), (math.inf if self.high is None else self.high)
        return self.found is not None and low <= self.true <= high


class LawFound(Part):
    """The law of contact of a pin with a known clearance that rattles: recorded by an engine, or by an equation of
    motion, and diagnosed by another engine.
    """

    case: str
    recorded: Annotated[str, Field(description="An engine's name, or equation.")] = "exudyn"
    joint: str
    clearance: Annotated[Positive, Field(description="Radial (m).")]
    revolutions: Annotated[int, Field(ge=1, description="That were recorded.")]
    verdict: Annotated[str, Field(description="Of the diagnosis.")]
    parameters: Annotated[Mapping[str, Sought], Field(description="restitution, stiffness (N/m), friction")]

    @property
    def key(self) -> tuple[str, str]:
        """Case, and by whom it was recorded."""
        return self.case, self.recorded


class Apart(Part):
    """How far one side is off a published figure."""

    side: Annotated[str, Field(description="analytic, an engine's name, or diagnosis")]
    off: NotNegative
    allowed: Annotated[Positive, Field(description="How far off it may be.")]


class Held(Part):
    """A published figure, or the largest of several, and how far this project is off it."""

    figure: str
    unit: str
    published: Annotated[FiniteFloat, Field(description="Its size, or the largest of them; of shares 1.")]
    apart: tuple[Apart, ...]


class Published(Part):
    """What somebody else found, and how near this project comes to it."""

    name: str
    says: Annotated[str, Field(description="Where it is from and what was done, in sentences.")]
    figures: tuple[Held, ...]


class Span(Part):
    """From the least to the largest of several runs."""

    low: FiniteFloat
    high: FiniteFloat


class Ended(Part):
    """How a slider-crank with play in its guide ends after 0.2 s, by somebody's steps, from starts that are next to the
    same.
    """

    by: str
    step: Annotated[Positive, Field(description="s")]
    starts: Annotated[int, Field(ge=1, description="How many.")]
    turns: Annotated[Span, Field(description="Of the crank.")]
    crank: Annotated[Span, Field(description="Its rate (rad/s).")]
    rod: Annotated[Span, Field(description="The rod's rate (rad/s).")]
    free: Annotated[Span, Field(description="Share of the samples at which no corner touches.")]
    touched: Annotated[
        Span, Field(description="Energy gained up to the first impact, as a share of that at the start.")
    ]
    gained: Annotated[Span, Field(description="The same up to the end.")]

    @property
    def key(self) -> tuple[str, float]:
        """By whom, and the step."""
        return self.by, self.step


class Timed(Part):
    """What one computation takes, on the machine that wrote the report, in one run of all of them."""

    what: str
    value: Positive
    unit: Annotated[str, Field(description="us, s or MB; none for a ratio")]
    wanted: Annotated[Positive | None, Field(description="At most; null where it is only told.")] = None


class Validation(Stored):
    """The validation report: every shipped case in every engine, and what the paper's two approximations cost."""

    file: ClassVar[str] = "validation.json"
    presentation: ClassVar[str] = "validation"
    remedy: ClassVar[str] = "restore it, or write it with python -m tests.evidence validation update"
    opens: ClassVar[str] = "README.md"

    versions: Annotated[Mapping[str, str | None], Field(description="Of the engines.")]
    runs: Annotated[tuple[ValidationRun, ...], Field(min_length=1)]
    scales: Annotated[
        tuple[AtScale, ...],
        Field(
            description="One linkage from a micrometre to thirty metres, in every joint model and motion of every"
            " engine."
        ),
    ]
    first_order: Annotated[
        tuple[FirstOrder, ...],
        Field(
            description="What Eq. 8 (reactions of the ideal linkage) is off by against the self-consistent equilibrium,"
            " paper's case, 20 to 160 deg."
        ),
    ]
    superposition: Annotated[
        tuple[Superposed, ...],
        Field(description="What adding compliance to clearance is off by against beams with real contact."),
    ]
    workspaces: Annotated[
        Mapping[str, tuple[OverWorkspace, ...]],
        Field(description="By case: a platform with loose pins, at rest over its workspace."),
    ]
    in_engines: Annotated[
        Mapping[str, tuple[InEngine, ...]],
        Field(description="By case: the same platform with real contact in its pins, moved slowly or at rest."),
    ] = {}
    bent: Annotated[
        tuple[Bent, ...], Field(description="Platforms on links that bend: superposition against beams.")
    ] = ()
    carried: Annotated[
        tuple[Carried, ...], Field(description="Linkages of several drives exported, imported and checked.")
    ] = ()
    struck: Annotated[
        tuple[Struck, ...], Field(description="Pins that strike: averages by law, engine and an equation of its own.")
    ] = ()
    delivered: Annotated[
        tuple[Delivered, ...], Field(description="Restitution delivered against restitution asked for.")
    ] = ()
    maps: Annotated[
        tuple[Mapped, ...], Field(description="Maps of validity that are stored beside it, read from their files.")
    ] = ()
    diagnosed: Annotated[
        tuple[Diagnosed, ...], Field(description="The stored scoreboard's sets with clearance, by linkage.")
    ] = ()
    laws: Annotated[tuple[LawFound, ...], Field(description="Laws of contact found again by the diagnosis.")] = ()
    published: Annotated[
        tuple[Published, ...], Field(description="Published figures, and how far this project is off them.")
    ] = ()
    ended: Annotated[
        tuple[Ended, ...], Field(description="A slider-crank with play in its guide after its first impact.")
    ] = ()
    speed: Annotated[
        tuple[Timed, ...], Field(description="How fast it is; figures of one machine, which are not made again.")
    ] = ()
    _checks: dict[str, CrossCheck] = PrivateAttr(default_factory=dict)

    @property
    def checks(self) -> dict[str, CrossCheck]:
        """Cross-checks of each case with contact, where the report was made here; not in the file."""
        return self._checks

    def rows(self) -> list[Row]:
        """A row for each run of a case."""
        return [
            {"case": r.case, "run": r.run, "simulator": r.simulator, "verdict": r.verdict}
            | ({"signals": r.signals, "closest": r.closest, "share": r.share} if r.compared else {})
            for r in self.runs
        ]

    def __repr__(self) -> str:
        agree = sum(run.verdict == "agrees" for run in self.runs)
        return f"Validation({agree} of {count(len(self.runs), 'run')} agree; {len(self.scales)} at scales)"


class ValidationCheck(Remade):
    """The validation report, made again and compared."""

    file: ClassVar[str] = "validation-check.json"
    remedy: ClassVar[str] = "give what python -m tests.evidence validation check --json prints"

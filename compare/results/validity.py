"""validity.json: where the analytic model agrees with simulations, over speed and clearance."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from analytic.mechanism.one_line import count
from compare.results.document import Document, Grid, Mechanism, Number, Part, Row, Share

Assumption = Literal["contact", "first-order", "quasi-static", "rigid"]
Costing = Literal["first-order", "quasi-static", "quasi-static-corrected", "rigid"]
NotNegative = Annotated[float, Field(ge=0)]
Positive = Annotated[float, Field(gt=0)]
Names = Annotated[tuple[str, ...], Field(min_length=1)]


class Law(Part):
    """Contact law of a joint: max(0, stiffness d + damping d')."""

    stiffness: Annotated[float, Field(gt=0, description="N/m")]
    damping: Annotated[float, Field(ge=0, description="N.s/m")]


class Meaning(Part):
    """What an assumption of the paper says, and whether the map tests it."""

    means: str
    examined: bool


class Place(Part):
    """Which cell: engine, speed of the crank (rad/s) and radial clearance (m)."""

    simulator: str
    speed: Annotated[float, Field(description="rad/s")]
    clearance: Annotated[float, Field(description="m")]


class Failed(Place):
    """A cell without a result."""

    failure: Annotated[str, Field(min_length=1, description="Why there is no result.")]


class Worst(Part):
    """The signal that differs most, relative to its tolerance."""

    signal: str
    unit: str
    max: Annotated[Number, Field(description="Simulated minus analytic.")]
    tolerance: Number
    over_tolerance: Number
    at_crank_angle: float


class Cell(Place):
    """A simulation at one speed and clearance, held against the analytic model."""

    verdict: Annotated[
        Literal["agrees", "disagrees"],
        Field(description="Agrees if every compared signal is within tolerance at every crank angle."),
    ]
    cause: Annotated[
        Assumption | None,
        Field(description="Where it disagrees: the assumption that explains it; null if none that was examined does."),
    ]
    agreeing_share: Annotated[
        float,
        Field(ge=0, le=1, description="Share of the crank angles at which every signal is within tolerance."),
    ]
    free_share: Annotated[
        Mapping[str, Share], Field(description="By joint: share of the cycle that its pin touched nothing.")
    ]
    worst: Worst | None
    fails: tuple[Assumption, ...]
    cost: Annotated[
        Mapping[Costing, NotNegative],
        Field(
            description="Error that an assumption makes by itself, over the tolerance; quasi-static-corrected is what"
            " is left of it in the equilibrium, which corrects it once."
        ),
    ]
    swings: Annotated[
        bool,
        Field(description="The pin never leaves its bearing, and does not lie where the equilibrium says."),
    ]
    flagged_share: Annotated[
        Mapping[Literal["unloaded", "unsteady"], Share],
        Field(
            description="Shares of the crank angles at which the model has no answer: a reaction near zero, or one"
            " that turns too fast."
        ),
    ]
    give: Annotated[float, Field(ge=0, description="How far the contact yields under the peak force (m).")]
    settings: Annotated[
        Mapping[str, str | float | None], Field(description="The engine's contact law and time step (s).")
    ]

    @property
    def agrees(self) -> bool:
        """Whether the equilibrium agrees with the simulation."""
        return self.verdict == "agrees"

    @property
    def free(self) -> float:
        """The largest share of the cycle that one of the pins flew free."""
        return max(self.free_share.values(), default=0.0)

    @property
    def first_order_is_enough(self) -> bool:
        """Whether the paper's formula itself is within tolerance of a simulation that agrees."""
        return self.agrees and "first-order" not in self.fails


class Limits(Part):
    """For each clearance the highest speed (rad/s) up to which a model agrees at every speed; null if at none."""

    equilibrium: tuple[float | None, ...]
    first_order: tuple[float | None, ...]


class Between(Part):
    """In how many of the cells that two or more engines could simulate they say the same, and their largest spreads."""

    cells: Annotated[int, Field(ge=1)]
    same_verdict: Annotated[int, Field(ge=0)]
    same_cause: Annotated[int, Field(ge=0)]
    free_share_spread: Share
    agreeing_share_spread: Share


class Validity(Document):
    """Where the analytic model of a linkage with joint clearance agrees with simulations, over speed and clearance.
    SI units and radians.
    """

    file: ClassVar[str] = "validity.json"
    presentation: ClassVar[str] = "validity"
    remedy: ClassVar[str] = "give the validity.json of a map of validity"
    opens: ClassVar[str] = "validity.svg"
    opened: ClassVar[str] = "map"
    indent: ClassVar[int | None] = 1

    case: Annotated[str, Field(description="Name of the mechanism.")]
    mechanism: Mechanism
    versions: Mapping[str, str]
    simulators: Names
    joint_model: Literal["massless-link", "spring-damper", "contact"]
    motion: Literal["driven"]
    analytic_model: Annotated[Literal["equilibrium"], Field(description="What the simulations are held to.")]
    joints: Annotated[
        tuple[str, ...],
        Field(min_length=1, description="Joints that carry the cell's clearance; the others have none."),
    ]
    joints_are: Annotated[str, Field(description="Why these joints.")]
    speeds: Annotated[tuple[Positive, ...], Field(min_length=1, description="Speeds of the crank (rad/s), increasing.")]
    clearances: Annotated[tuple[Positive, ...], Field(min_length=1, description="Radial clearances (m), increasing.")]
    crank_angle: Annotated[Grid, Field(description="Where model and simulation are compared (rad).")]
    contact: Annotated[
        Mapping[str, Law],
        Field(description="Contact law of each joint with clearance, the same in every engine."),
    ]
    assumptions: Annotated[Mapping[str, Meaning], Field(description="The paper's assumptions.")]
    cells: Annotated[tuple[Cell | Failed, ...], Field(min_length=1)]
    holds_up_to: Annotated[Mapping[str, Limits], Field(description="By engine.")]
    between_simulators: Annotated[Between | None, Field(description="With several engines.")] = None
    words: Annotated[tuple[str, ...], Field(min_length=1)]
    command: str
    warnings: tuple[str, ...]

    def of(self, simulator: str) -> dict[tuple[float, float], Cell | Failed]:
        """An engine's cells by speed (rad/s) and clearance (m)."""
        return {(cell.speed, cell.clearance): cell for cell in self.cells if cell.simulator == simulator}

    def rows(self) -> list[Row]:
        """A row for each cell."""
        return [self._row(cell) for cell in self.cells]

    @staticmethod
    def _row(cell: Cell | Failed) -> Row:
        head: dict[str, float | str | None] = {
            "simulator": cell.simulator,
            "speed": cell.speed,
            "clearance": cell.clearance,
        }
        if isinstance(cell, Failed):
            return head | {"verdict": "failed", "failure": cell.failure}
        return head | {
            "verdict": cell.verdict,
            "cause": cell.cause,
            "agreeing_share": cell.agreeing_share,
            "free_share": cell.free,
            "fails": " ".join(cell.fails),
            "worst_signal": cell.worst.signal if cell.worst else None,
            "worst_over_tolerance": cell.worst.over_tolerance if cell.worst else None,
            "give": cell.give,
        }

    def __repr__(self) -> str:
        agreeing = sum(isinstance(cell, Cell) and cell.agrees for cell in self.cells)
        rpm = [30 / math.pi * speed for speed in self.speeds]
        return (
            f"Validity({self.case} in {', '.join(self.simulators)}: {agreeing} of"
            f" {count(len(self.cells), 'cell')} {'agrees' if agreeing == 1 else 'agree'},"
            f" {rpm[0]:.4g} to {rpm[-1]:.4g} rpm, {self.clearances[0]:.3g} to {self.clearances[-1]:.3g} m)"
        )

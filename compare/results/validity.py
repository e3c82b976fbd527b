"""validity.json: where the analytic model agrees with simulations, over speed and clearance."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Annotated, ClassVar, Literal, NamedTuple

from pydantic import Field

from analytic.mechanism.one_line import count
from compare.results.document import Amount, Document, Filled, Grid, Mechanism, Number, Part, Row, Share

Assumption = Literal["contact", "first-order", "quasi-static", "rigid"]
Costing = Literal["first-order", "quasi-static", "quasi-static-corrected", "rigid"]
NotNegative = Annotated[float, Field(ge=0)]
Positive = Annotated[float, Field(gt=0)]
Names = Annotated[tuple[str, ...], Field(min_length=1)]


class Law(Part):
    """Contact law of a joint: max(0, stiffness d + damping d'), or the ``law`` that it names."""

    stiffness: Annotated[
        float, Field(gt=0, description="N/m, at the slowest speed; the settings of each cell have its own.")
    ]
    damping: Annotated[
        NotNegative | None, Field(description="N.s/m; null where each cell's restitution says it, or the law has none.")
    ]
    law: Annotated[str | None, Field(description="Name of the law; absent: Kelvin and Voigt's.")] = None


class Meaning(Part):
    """What an assumption of the paper says, and whether the map tests it."""

    means: str
    examined: bool


class Place(Part):
    """Which cell: engine, speed of the crank (rad/s), clearance (m; a pin's radial one, half a block's play) and, in a
    map over several, restitution.
    """

    simulator: str
    speed: Annotated[float, Field(description="rad/s")]
    clearance: Annotated[float, Field(description="m")]
    restitution: Annotated[Share | None, Field(description="Of the contact; absent: the mechanism's own.")] = None

    @property
    def at(self) -> tuple[float, float, float | None]:
        """Speed (rad/s), clearance (m) and restitution."""
        return self.speed, self.clearance, self.restitution


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


class Pin(Part):
    """What contact did to a pin, or to a block's corners, in the revolutions that were watched; energies, impacts and
    impulse are a revolution's.
    """

    peak_force: Annotated[Amount, Field(description="Largest contact force (N); of a block, of one of its corners.")]
    peak_ratio: Annotated[Amount, Field(description="The same over the ideal linkage's largest in a turn.")]
    free_share: Annotated[
        Amount, Field(description="Share of the time that the pin, or every corner of the block, was off its wall.")
    ]
    impacts: Annotated[Amount, Field(description="Times that it, or one of its corners, struck its wall.")]
    impulse: Annotated[Amount, Field(description="Normal impulse of these (N.s).")]
    approach_speed: Annotated[Amount, Field(description="Fastest of these (m/s).")]
    restitution_loss: Annotated[Number, Field(description="Energy that the normal force took (J).")]
    friction_loss: Annotated[Number, Field(description="Energy that friction in the contact took (J).")]

    @property
    def lost(self) -> float:
        """Energy (J) that contact took in a revolution; it gives none, so that one below 0 is not known from 0."""
        return max(self.restitution_loss or 0.0, 0.0) + max(self.friction_loss or 0.0, 0.0)


class Watched(Part):
    """What contact did in a cell."""

    revolutions: Annotated[float, Field(ge=0, description="Turns of the crank that were watched.")]
    pins: Annotated[
        Mapping[str, Pin], Field(min_length=1, description="By joint with clearance, of pins and of blocks alike.")
    ]

    @property
    def peak_ratio(self) -> float:
        """The largest contact force over the joint's ideal peak."""
        return max((pin.peak_ratio or 0.0 for pin in self.pins.values()), default=0.0)

    @property
    def free(self) -> float:
        """The largest share of the time that one of the pins or blocks was off its wall."""
        return max((pin.free_share or 0.0 for pin in self.pins.values()), default=0.0)

    @property
    def lost(self) -> float:
        """Energy (J) that all contacts took in a revolution."""
        return sum(pin.lost for pin in self.pins.values())

    @property
    def impacts(self) -> float:
        """Impacts of all pins and corners in a revolution."""
        return sum(pin.impacts or 0.0 for pin in self.pins.values())


class Leaving(Part):
    """Crank angle (rad, continued from the start of the run) at which a pin first leaves by the analytic model, which
    knows how its reaction turns; null: it stays.
    """

    rigid: Annotated[Number, Field(description="On a rigid wall.")]
    yielding: Annotated[Number, Field(description="On a wall that yields as the cell's contact does.")]


class Boundary(Part):
    """The clearance (m) from which on a pin leaves at a speed by the analytic model: between two of the map, its least
    if it leaves there already; null: it leaves at none.
    """

    speed: Annotated[float, Field(description="rad/s")]
    restitution: Annotated[Share | None, Field(description="Of the contact; absent: the mechanism's own.")] = None
    rigid: Annotated[Number, Field(description="On a rigid wall.")]
    yielding: Annotated[Number, Field(description="On a wall that yields as the contact does.")]


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
        Mapping[str, Share], Field(description="By joint: share of the cycle that its pin or block touched nothing.")
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
        Field(description="The pin or block stays in contact, and does not lie where the equilibrium says."),
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
        Mapping[str, str | float | None],
        Field(
            description="The engine's contact law, contact_stiffness (N/m) and contact_damping (N.s/m), where these are"
            " numbers, and time step (s)."
        ),
    ]
    watched: Annotated[
        Watched | None, Field(description="Absent where the engine's steps were not watched, or nothing can leave.")
    ] = None
    leaving: Annotated[
        Leaving | None, Field(description="Where a pin leaves by the analytic model; absent: not asked, or a block's.")
    ] = None

    @property
    def agrees(self) -> bool:
        """Whether the equilibrium agrees with the simulation."""
        return self.verdict == "agrees"

    @property
    def free(self) -> float:
        """The largest share of the cycle that one of the pins or blocks flew free."""
        return max(self.free_share.values(), default=0.0)

    @property
    def left(self) -> bool:
        """Whether a pin left its bearing, or a block its walls, in the simulation."""
        return self.free > 0 or (self.watched is not None and self.watched.free > 0)

    @property
    def first_order_is_enough(self) -> bool:
        """Whether the paper's formula itself is within tolerance of a simulation that agrees."""
        return self.agrees and "first-order" not in self.fails


class Foretold(NamedTuple):
    """Of how many cells the analytic model says whether a pin leaves, in how many of these one does, and in how many
    that is as it says: with walls that yield, and with rigid ones.
    """

    cells: int
    lost: int
    yielding: int
    rigid: int


def foretold(cells: Iterable[Cell | Failed]) -> Foretold:
    """Contact kept and lost beside what the analytic model says of it."""
    predicted = [(cell.left, cell.leaving) for cell in cells if isinstance(cell, Cell) and cell.leaving is not None]
    return Foretold(
        cells=len(predicted),
        lost=sum(left for left, _ in predicted),
        yielding=sum(left == (one.yielding is not None) for left, one in predicted),
        rigid=sum(left == (one.rigid is not None) for left, one in predicted),
    )


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
    clearances: Annotated[
        tuple[Positive, ...],
        Field(min_length=1, description="Clearances (m), radial or half a block's play, increasing."),
    ]
    crank_angle: Annotated[Grid, Field(description="Where model and simulation are compared (rad).")]
    contact: Annotated[
        Mapping[str, Law],
        Field(description="Contact law of each joint with clearance, the same in every engine."),
    ]
    assumptions: Annotated[Mapping[str, Meaning], Field(description="The paper's assumptions.")]
    cells: Annotated[tuple[Cell | Failed, ...], Field(min_length=1)]
    holds_up_to: Annotated[Mapping[str, Limits], Field(description="By engine.")]
    between_simulators: Annotated[Between | None, Field(description="With several engines.")] = None
    restitutions: Annotated[
        tuple[Share, ...] | None, Field(min_length=1, description="Increasing; absent: the mechanism's own, if any.")
    ] = None
    boundary: Annotated[
        tuple[Boundary, ...] | None,
        Field(description="Where contact is first lost, by the analytic model; none for blocks."),
    ] = None
    words: Annotated[tuple[str, ...], Field(min_length=1)]
    command: str
    warnings: tuple[str, ...]
    assumed: Filled = ()

    def of(self, simulator: str, restitution: float | None = None) -> dict[tuple[float, float], Cell | Failed]:
        """An engine's cells by speed (rad/s) and clearance (m), of one restitution: the first, if none is given."""
        wanted = self.layers[0] if restitution is None else restitution
        return {
            (cell.speed, cell.clearance): cell
            for cell in self.cells
            if cell.simulator == simulator and cell.restitution == wanted
        }

    @property
    def layers(self) -> tuple[float | None, ...]:
        """The restitutions of the map; None alone for the mechanism's own."""
        return self.restitutions or (None,)

    @property
    def of_blocks(self) -> bool:
        """Whether blocks in their guides have the clearance."""
        return any(self.mechanism.joint(name).prismatic for name in self.joints)

    def panels(self) -> Iterator[tuple[str, float | None]]:
        """Each engine and restitution."""
        for simulator in self.simulators:
            for restitution in self.layers:
                yield simulator, restitution

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
        if cell.restitution is not None:
            head["restitution"] = cell.restitution
        if isinstance(cell, Failed):
            return head | {"verdict": "failed", "failure": cell.failure}
        row: dict[str, float | str | None] = {
            "verdict": cell.verdict,
            "cause": cell.cause,
            "agreeing_share": cell.agreeing_share,
            "free_share": cell.free,
            "fails": " ".join(cell.fails),
            "worst_signal": cell.worst.signal if cell.worst else None,
            "worst_over_tolerance": cell.worst.over_tolerance if cell.worst else None,
            "give": cell.give,
        }
        if cell.watched is not None:
            row |= {
                "peak_force": max(pin.peak_force or 0.0 for pin in cell.watched.pins.values()),
                "peak_ratio": cell.watched.peak_ratio,
                "impacts": cell.watched.impacts,
                "energy_lost": cell.watched.lost,
            }
        if cell.leaving is not None:
            row |= {"leaves_rigid_wall_at": cell.leaving.rigid, "leaves_wall_at": cell.leaving.yielding}
        return head | row

    def __repr__(self) -> str:
        agreeing = sum(isinstance(cell, Cell) and cell.agrees for cell in self.cells)
        rpm = [30 / math.pi * speed for speed in self.speeds]
        return (
            f"Validity({self.case} in {', '.join(self.simulators)}: {agreeing} of"
            f" {count(len(self.cells), 'cell')} {'agrees' if agreeing == 1 else 'agree'},"
            f" {rpm[0]:.4g} to {rpm[-1]:.4g} rpm, {self.clearances[0]:.3g} to {self.clearances[-1]:.3g} m)"
        )

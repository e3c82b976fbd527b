"""What contact did in a run: how long pins and blocks were free, how they struck, what that cost, and how sure the
figures are.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal, get_args

from pydantic import Field

from compare.results.document import Number, Part, Series

StatisticName = Literal[
    "free_share", "impacts", "impulse", "approach_speed", "rms_force", "peak_force", "high_peak",
    "restitution_loss", "friction_loss", "wear", "penetration",
]  # fmt: skip
STATISTICS: tuple[StatisticName, ...] = get_args(StatisticName)
UNITS: Mapping[StatisticName, str] = {
    "free_share": "1",
    "impacts": "1",
    "impulse": "N.s",
    "approach_speed": "m/s",
    "rms_force": "N",
    "peak_force": "N",
    "high_peak": "N",
    "restitution_loss": "J",
    "friction_loss": "J",
    "wear": "N.m",
    "penetration": "m",
}


LEAST_FORCE = 1e-6  # of the largest force of a path: less is none


class Statistic(Part):
    """A figure over the revolutions of a run, SI, with its 95 % interval by bootstrap; null where there are too few.

    Of a run that makes no whole revolution the figure is over all of it.
    """

    value: Number
    low: Number
    high: Number
    by_revolution: Series

    @property
    def half_width(self) -> float | None:
        """Half of the interval's width."""
        return None if self.low is None or self.high is None else (self.high - self.low) / 2


class Impacts(Part):
    """Every impact of a run, in order."""

    crank_angle: Annotated[Series, Field(description="rad, continued")]
    approach_speed: Annotated[Series, Field(description="m/s, along the wall's normal")]
    impulse: Annotated[Series, Field(description="N.s, normal, of the first blow until it leaves or presses anew")]
    energy: Annotated[Series, Field(description="J, that the normal force takes in it")]


class Profile(Part):
    """Contact over the crank angle, in bins (N): all revolutions together."""

    crank_angle: Annotated[Series, Field(description="rad, middle of each bin, from 0 to a turn")]
    free_share: Series
    impacts: Annotated[Series, Field(description="per revolution")]
    mean_force: Annotated[Series, Field(description="N")]
    low_force: Annotated[Series, Field(description="N, below which it is for 5 % of the time")]
    high_force: Annotated[Series, Field(description="N, below which it is for 95 % of the time")]


class Orbit(Part):
    """The pin's path in its bearing in the last revolution (first centre minus second), and the force there.

    Of a block x is its height across its guide, y its tilt times half its length, and the force that on a corner.
    """

    x: Annotated[Series, Field(description="m")]
    y: Annotated[Series, Field(description="m")]
    force: Annotated[Series, Field(description="N, size")]
    crank_angle: Annotated[Series, Field(description="rad, continued")]
    time: Annotated[Series | None, Field(description="s, as that of the run")] = None


class Section(Part):
    """Where the pin or block is, as in its orbit, and how it moves, once a revolution (Poincare section): at the run's
    first crank angle.
    """

    x: Annotated[Series, Field(description="m")]
    y: Annotated[Series, Field(description="m")]
    velocity_x: Annotated[Series, Field(description="m/s")]
    velocity_y: Annotated[Series, Field(description="m/s")]


class JointContact(Part):
    """Contact of one joint in a run."""

    statistics: Annotated[Mapping[StatisticName, Statistic], Field(description="By name; SI.")]
    peak_ratio: Annotated[
        Number,
        Field(
            description="Largest contact force over the ideal linkage's largest reaction in a turn; of a block, largest"
            " force on a corner over the largest that reaction and moment of the ideal linkage put on one."
        ),
    ]
    first_impact: Annotated[Number, Field(description="Crank angle (rad) of the first impact; null: there is none.")]
    impacts: Impacts
    profile: Profile
    orbit: Orbit
    section: Section


class Balance(Part):
    """Energy (J) over the whole revolutions of a run: what the motor and the loads put in, what contact and joints
    take, what is left in the links; and what is missing, over all that is turned over.
    """

    put_in: Annotated[Number, Field(description="J, by motor, loads, gravity and springs between points")]
    lost_in_contact: Annotated[Number, Field(description="J, with what the walls still store at the end")]
    lost_in_joints: Number
    kept: Annotated[Number, Field(description="J, kinetic energy gained")]
    missing: Annotated[Number, Field(description="put in less lost less kept, J")]
    turned_over: Annotated[Number, Field(description="J, by the motor in either direction")]

    @property
    def share(self) -> float | None:
        """What is missing, over what is turned over."""
        return abs(self.missing) / self.turned_over if self.missing is not None and self.turned_over else None


class Contact(Part):
    """Contact in a run: over how many revolutions, whether its averages have converged, and each joint with clearance.

    Where a pin or a block flies a motion need not repeat itself: such runs are compared by their statistics.
    """

    revolutions: Annotated[float, Field(ge=0, description="Turns of the crank that were watched.")]
    converged: Annotated[bool, Field(description="Whether its statistics are known well enough.")]
    period: Annotated[
        int | None, Field(description="Revolutions after which the motion repeats itself; null: it does not.")
    ]
    words: Annotated[str, Field(min_length=1, description="How well its averages are known, in a sentence.")]
    energy: Annotated[Balance | None, Field(description="Null where a joint's friction by load is not known.")]
    joints: Mapping[str, JointContact]

    @property
    def struck(self) -> bool:
        """Whether any pin or block struck its wall."""
        return any(joint.first_impact is not None for joint in self.joints.values())


class Compared(Part):
    """A statistic of two runs of one joint model with one law, held against each other."""

    joint: str
    statistic: StatisticName
    unit: str
    joint_model: str
    between: tuple[str, str]
    values: tuple[Number, Number]
    allowed: Annotated[Number, Field(description="Tolerance, and both intervals' half widths in quadrature.")]
    verdict: Literal["agrees", "disagrees", "unjudged"]
    reason: Annotated[str, Field(description="Why it is not judged.")] = ""

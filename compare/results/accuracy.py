"""accuracy.json: what joint clearance and compliance do to the outputs of a linkage."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field

from analytic.mechanism.one_line import count
from compare.results.analysis import Limit
from compare.results.document import Document, Filled, Grid, Mechanism, Part, Row, Series, as_dataframe, rows_of
from compare.results.looked_at import error_peaks
from compare.results.toleranced import AccuracyByTolerance

if TYPE_CHECKING:
    import pandas

MetresByJoint = Mapping[str, Annotated[float, Field(ge=0)]]
Reasons = Mapping[Annotated[str, Field(pattern="^[0-9]+$")], str]


class SideChange(Part):
    """Where a reaction passes near zero and its contact crosses to another side of the bearing."""

    joint: str
    crank_angle: Annotated[float, Field(description="Where the reaction is smallest (rad).")]
    before: Annotated[
        float,
        Field(alias="from", description="Last crank angle at which the reaction had a clear direction (rad)."),
    ]
    after: Annotated[float, Field(alias="to", description="First one after it (rad).")]
    reaction: Annotated[float, Field(ge=0, description="Smallest reaction (N).")]
    turned: Annotated[float, Field(description="Change of the contact's direction (rad).")]
    jump: Annotated[Mapping[str, float], Field(description="What that does to each output.")]


class Spread(Part):
    """Displacement over the samples of the Monte Carlo."""

    mean: Series
    sigma: Annotated[Series, Field(description="Standard deviation.")]
    low: Annotated[Series, Field(description="2.5 % of the samples lie below.")]
    high: Annotated[Series, Field(description="2.5 % of the samples lie above.")]
    formula: Annotated[Series, Field(description="Standard deviation in closed form, to first order.")]


class MonteCarlo(Part):
    """Displacement over the samples, contacts anywhere on the rim or where the reactions press them."""

    free: Spread
    along_reactions: Spread


class Output(Part):
    """A coordinate of a point, or a body's angle: displacements over the crank angle."""

    body: str
    point: Annotated[str, Field(description="Name of the body's point, or com; absent for an angle.")] = ""
    axis: Literal["x", "y", "angle"]
    unit: Literal["m", "rad"]
    nominal: Annotated[Series, Field(description="First-order displacement with every pin along its reaction.")]
    equilibrium: Annotated[
        Series, Field(description="The same with finite gaps, in equilibrium where they have moved to.")
    ]
    worst_case: Annotated[Series, Field(description="Largest displacement to either side, wherever the pins lie.")]
    sensitivity: Annotated[
        Mapping[str, Series],
        Field(description="By joint: displacement per radial clearance (m/m or rad/m)."),
    ]
    by_joint: Annotated[
        Mapping[str, Series],
        Field(description="What the clearance of each joint does alone of the first-order displacement."),
    ] = {}
    compliance: Annotated[Series, Field(description="Elastic displacement.")]
    total: Annotated[Series, Field(description="Equilibrium and compliance superposed.")]
    monte_carlo: MonteCarlo


class Radius(Part):
    """Radius (m) within which 95 % of the samples displace a point."""

    free: Series
    along_reactions: Series


class PointError(Part):
    """Displacement of a point in its plane."""

    farthest: Annotated[Series, Field(description="Largest displacement in any direction (m), wherever the pins lie.")]
    farthest_direction: Annotated[Series, Field(description="Its direction (rad); the opposite is as far.")]


class Point(PointError):
    """Displacement of a point in its plane, and how far the samples displace it."""

    radius_95: Radius


class Accuracy(Document):
    """What joint clearance and compliance do to the outputs of a linkage.  SI units and radians; series have one entry
    for each crank angle, null where there is no number.
    """

    file: ClassVar[str] = "accuracy.json"
    remedy: ClassVar[str] = "give the accuracy.json of compare accuracy"
    opens: ClassVar[str] = "accuracy.html"
    opened: ClassVar[str] = "page"

    case: Annotated[str, Field(description="Name of the mechanism.")]
    mechanism: Mechanism
    versions: Mapping[str, str]
    motion: Annotated[
        Literal["driven", "static"],
        Field(description="Whether the reactions include inertia forces at the drive's speed."),
    ]
    clearance: Annotated[MetresByJoint, Field(description="Radial clearances (m).")]
    clearance_tolerance: Annotated[
        MetresByJoint,
        Field(description="Half widths (m) of the uniform distributions that Monte Carlo draws clearances from."),
    ]
    samples: Annotated[int, Field(ge=2)]
    seed: Annotated[int, Field(ge=0)]
    nonlinear: Annotated[
        bool,
        Field(description="Whether every sample's linkage was closed again; otherwise Monte Carlo is to first order."),
    ]
    crank_angle: Annotated[Grid, Field(min_length=1, description="rad")]
    flags: Annotated[
        Reasons,
        Field(
            description="Crank angles (by index) without an equilibrium in contact: equilibrium and total are null"
            " there."
        ),
    ]
    cautions: Annotated[
        Reasons,
        Field(
            description="Crank angles (by index) whose numbers are not to be relied on: near a singularity, or gaps"
            " too large for first order."
        ),
    ]
    condition: Annotated[
        Series,
        Field(description="Condition number of the worst Assur group's loop Jacobian, unknowns scaled to unit effect."),
    ]
    transmission: Annotated[
        Series,
        Field(description="Margin to the nearest change point, 1 at best: the sine of a dyad's transmission angle."),
    ]
    side_changes: tuple[SideChange, ...]
    outputs: Annotated[Mapping[str, Output], Field(min_length=1)]
    points: Annotated[
        Mapping[str, Point], Field(description="Displacements of points in their plane, by body or body.point.")
    ]
    tolerances: Annotated[
        AccuracyByTolerance | None, Field(description="What the mechanism's tolerances do, where it states any.")
    ] = None
    limits: Annotated[
        Mapping[str, Limit], Field(description="Of the error by clearance, by name, where limits were asked for.")
    ] = {}
    command: str
    warnings: tuple[str, ...]
    assumed: Filled = ()

    @property
    def holds(self) -> bool:
        """Whether every limit of the error holds, and as many linkages are good as was asked for."""
        within = all(each.verdict == "holds" for each in self.limits.values())
        return within and (self.tolerances is None or self.tolerances.good)

    @property
    def time(self) -> None:
        """None: it is of a crank's angles."""

    @property
    def errors(self) -> Mapping[str, Output]:
        """The outputs, as a page of errors calls them."""
        return self.outputs

    @property
    def peaks(self) -> pandas.DataFrame:
        """A data frame of the largest error of each output that has one, SI: output, unit, largest (in equilibrium,
        with its sign), its crank angle (rad), and the largest
        sizes of worst_case, compliance and total.

        Raises ImportError with the remedy where pandas is not installed.
        """
        return as_dataframe([*error_peaks(self.outputs, {"crank_angle": self.crank_angle})], "peaks")

    def rows(self) -> list[Row]:
        """A row for each output and crank angle: displacements in the row's ``unit``, ``error_<joint>`` what its joint
        does alone of the nominal one, ``sensitivity_<joint>`` in the row's unit per m of radial clearance.
        """
        rows: list[Row] = []
        for name, output in self.outputs.items():
            displacements = ("nominal", "equilibrium", "worst_case", "compliance", "total")
            columns = {"crank_angle": self.crank_angle} | {each: getattr(output, each) for each in displacements}
            columns |= {each: getattr(output.monte_carlo.free, each) for each in ("sigma", "low", "high")}
            if self.tolerances is not None:
                columns |= {"tolerance_sd": self.tolerances.outputs[name].sd}
            columns |= {f"error_{joint}": values for joint, values in output.by_joint.items()}
            columns |= {f"sensitivity_{joint}": values for joint, values in output.sensitivity.items()}
            rows += rows_of(columns, output=name, unit=output.unit)
        return rows

    def units(self) -> Mapping[str, str]:
        """SI unit of the crank angle; those of the other columns are in each row's ``unit``."""
        return {"crank_angle": "rad"}

    def __repr__(self) -> str:
        sizes = ", ".join(f"{joint} {size:.4g} m" for joint, size in self.clearance.items()) or "no clearance"
        first, last = (math.degrees(self.crank_angle[k]) for k in (0, -1))
        return (
            f"Accuracy({self.case}, {self.motion}, {sizes}: {count(len(self.outputs), 'output')} at"
            f" {count(self.crank_angle.size, 'crank angle')}, {first:.4g} to {last:.4g} deg)"
        )

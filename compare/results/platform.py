"""accuracy.json of a linkage with several drives: the errors of a platform along a motion, or over its workspace."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from analytic.mechanism.one_line import count
from compare.results.accuracy import MetresByJoint, PointError, Reasons
from compare.results.document import Document, Filled, Grid, Mechanism, Part, Row, Series, as_dataframe, rows_of
from compare.results.looked_at import error_peaks

if TYPE_CHECKING:
    import pandas


class PoseError(Part):
    """Errors of a coordinate of a point, or of a body's angle, at each pose."""

    body: str
    point: Annotated[str, Field(description="Name of the body's point, or com; absent for an angle.")] = ""
    axis: Literal["x", "y", "angle"]
    unit: Literal["m", "rad"]
    value: Annotated[Series, Field(description="Where the ideal linkage has it.")]
    nominal: Annotated[Series, Field(description="First-order displacement with every pin along its reaction (Eq. 8).")]
    equilibrium: Annotated[
        Series, Field(description="The same with finite gaps, in equilibrium where they have moved to.")
    ]
    worst_case: Annotated[Series, Field(description="Largest displacement to either side, wherever the pins lie.")]
    sensitivity: Annotated[
        Mapping[str, Series], Field(description="By joint: displacement per radial clearance (m/m or rad/m).")
    ]
    resolution: Annotated[
        Series, Field(description="Largest displacement to either side by drives half a step of their encoders off.")
    ]
    compliance: Annotated[Series, Field(description="Elastic displacement under the loads, the drives held.")]
    total: Annotated[
        Series, Field(description="Largest displacement to either side by all: worst case, resolution and compliance.")
    ]


class BodyPoses(Part):
    """A body's frame at each pose."""

    x: Annotated[Series, Field(description="m, of its com.")]
    y: Annotated[Series, Field(description="m")]
    angle: Annotated[Series, Field(description="rad")]


class PoseGrid(Part):
    """The grid of a workspace: a pose for each x of each y, row by row."""

    output: Annotated[str, Field(description="The point that is moved over the grid, as body.point.")]
    x: Annotated[Grid, Field(description="m", min_length=1)]
    y: Annotated[Grid, Field(description="m", min_length=1)]
    angle: Annotated[float | None, Field(description="rad, of the body, where its drives set it.")]


class PlatformAccuracy(Document):
    """The errors of a linkage with several drives.  SI units and radians; series have one entry for each pose, null
    where it is not reached or there is no number.
    """

    file: ClassVar[str] = "accuracy.json"
    described: ClassVar[str] = "accuracy-platform.json"
    remedy: ClassVar[str] = "give the accuracy.json of compare accuracy for a linkage with several drives"
    opens: ClassVar[str] = "accuracy.html"

    case: Annotated[str, Field(description="Name of the mechanism.")]
    mechanism: Mechanism
    versions: Mapping[str, str]
    motion: Annotated[
        Literal["driven", "static"], Field(description="Whether the reactions include inertia forces of a motion.")
    ]
    clearance: Annotated[MetresByJoint, Field(description="Radial clearances (m).")]
    encoder_step: Annotated[
        Mapping[str, Annotated[float, Field(ge=0)]], Field(description="Step of each drive's encoder (rad, m).")
    ]
    time: Annotated[Grid | None, Field(description="s, of the poses of a motion.")] = None
    workspace: Annotated[PoseGrid | None, Field(description="The grid of the poses of a workspace.")] = None
    drive_position: Annotated[Mapping[str, Series], Field(description="Position (rad, or m) of each driven joint.")]
    poses: Annotated[Mapping[str, BodyPoses], Field(description="Where each body is, by name.")]
    holding: Annotated[
        Series,
        Field(
            description="Condition number of the loops: how well the drives hold the linkage; infinite (null) at a"
            " singular pose of the second kind."
        ),
    ]
    dexterity: Annotated[
        Series,
        Field(
            description="Condition number of the outputs' derivative by the drives, lengths over the longest body:"
            " infinite at a singular pose of the first kind."
        ),
    ]
    flags: Annotated[Reasons, Field(description="Poses (by index) without an equilibrium in contact.")]
    outputs: Annotated[Mapping[str, PoseError], Field(min_length=1)]
    points: Annotated[Mapping[str, PointError], Field(description="By body or body.point.")]
    first_order_off: Annotated[
        Mapping[str, float],
        Field(
            description="By output: the largest difference between Eq. 8 and the equilibrium, as a share of the largest"
            " displacement."
        ),
    ]
    command: str = ""
    warnings: tuple[str, ...] = ()
    assumed: Filled = ()

    @model_validator(mode="after")
    def _whole(self) -> PlatformAccuracy:
        """Each series has a value for each pose."""
        values = {f"outputs.{name}": output.value for name, output in self.outputs.items()}
        self._check_sizes(values, self.holding.size, "pose")
        return self

    @property
    def reached(self) -> np.ndarray:
        """Which poses (N,) are reached."""
        return np.isfinite(next(iter(self.poses.values())).x)

    @property
    def peaks(self) -> pandas.DataFrame:
        """A data frame of the largest error of each output that has one, SI: output, unit, largest (in equilibrium,
        with its sign), where it is (time, s; positions of the drives, rad or m), and the largest
        sizes of worst_case, compliance and total.

        Raises ImportError with the remedy where pandas is not installed.
        """
        return as_dataframe([*error_peaks(self.outputs, self._where)], "peaks")

    @property
    def _where(self) -> dict[str, np.ndarray]:
        """The time and the drives' positions of each pose."""
        timed = {} if self.time is None else {"time": self.time}
        return timed | {f"position_{name}": values for name, values in self.drive_position.items()}

    def rows(self) -> list[Row]:
        """A row for each output and reached pose."""
        rows: list[Row] = []
        at = self._where
        errors = ("value", "nominal", "equilibrium", "worst_case", "resolution", "compliance", "total")
        for name, output in self.outputs.items():
            columns = at | {each: getattr(output, each) for each in errors}
            columns |= {f"sensitivity_{joint}": values for joint, values in output.sensitivity.items()}
            reached = {column: values[self.reached] for column, values in columns.items()}
            rows += rows_of(reached, output=name, unit=output.unit)
        return rows

    def __repr__(self) -> str:
        sizes = ", ".join(f"{joint} {size:.4g} m" for joint, size in self.clearance.items()) or "no clearance"
        reached, of = int(self.reached.sum()), self.reached.size
        where = f"{reached} of {count(of, 'pose')} of a workspace" if self.workspace else count(of, "pose")
        return f"PlatformAccuracy({self.case}, {self.motion}, {sizes}: {count(len(self.outputs), 'output')} at {where})"

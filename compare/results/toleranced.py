"""What tolerances of a mechanism do, in accuracy.json and analysis.json."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field

from compare.results.document import Number, Part, Series, Share


class Varied(Part):
    """A number of the mechanism that varies from one made linkage to another, in SI units."""

    unit: str
    nominal: Annotated[float, Field(description="What the file says.")]
    distribution: Literal["uniform", "triangular", "normal"]
    mean: float
    sd: Annotated[float, Field(gt=0, description="Standard deviation.")]
    low: Annotated[float, Field(description="Its limit; of a normal distribution without any, 3 sd below the mean.")]
    high: float
    group: Annotated[str, Field(description="What it varies with; empty where it varies alone.")] = ""


class Made(Part):
    """Error over the samples of the Monte Carlo that assemble, over the crank angle or time."""

    mean: Series
    sigma: Annotated[Series, Field(description="Standard deviation.")]
    low: Annotated[Series, Field(description="2.5 % of the samples lie below.")]
    high: Annotated[Series, Field(description="2.5 % of the samples lie above.")]


class ByTolerance(Part):
    """How a number over the crank angle varies, to first order."""

    unit: str
    sd: Annotated[Series, Field(description="Standard deviation.")]
    by_source: Annotated[
        Mapping[str, Series], Field(description="Standard deviation by one source, or one group of them, alone.")
    ]
    monte_carlo: Annotated[Made | None, Field(description="Where samples are asked for.")] = None


class OutputByTolerance(ByTolerance):
    """The error of an output against the ideal linkage as drawn."""

    at: Annotated[float, Field(description="Crank angle (rad) at which sd is largest, of which the indices are.")]
    sobol_first: Annotated[
        Mapping[str, float],
        Field(description="Share of the variance by each source or group alone; absent where samples do not assemble."),
    ] = {}
    sobol_total: Annotated[
        Mapping[str, float], Field(description="The same with all that it does together with others.")
    ] = {}
    limit: Annotated[Number, Field(description="Largest error that is good, to either side.")] = None
    within: Annotated[
        Share | None,
        Field(description="Share of the samples within the limit at every crank angle; what does not assemble is not."),
    ] = None


class AccuracyByTolerance(Part):
    """What tolerances do to the outputs of a linkage."""

    sources: Mapping[str, Varied]
    assembled: Annotated[Share, Field(description="Share of the samples that assemble at every crank angle.")]
    outputs: Mapping[str, OutputByTolerance]
    within: Annotated[Share | None, Field(description="Share of the samples within all limits.")] = None
    min_yield: Annotated[Share | None, Field(description="Least such share that was asked for.")] = None

    @property
    def good(self) -> bool:
        """Whether as many linkages are within the limits as was asked for."""
        return self.min_yield is None or (self.within or 0.0) >= self.min_yield


class SignalsByTolerance(Part):
    """What tolerances do to the signals of a linkage."""

    sources: Mapping[str, Varied]
    samples: Annotated[int, Field(ge=0, description="Of the Monte Carlo, each analysed as a whole.")] = 0
    assembled: Annotated[Share | None, Field(description="Share of the samples that can be analysed.")] = None
    signals: Mapping[str, ByTolerance]

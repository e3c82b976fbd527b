"""reports/trust.json: bands of predictions and numerical uncertainties, held against what is known."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field

from compare.results.diagnosis import DiagnosisVerdict
from compare.results.document import Number, Part, Share


class Covered(Part):
    """A hidden set, and how its run ahead of the data lies in what was foretold of it."""

    seed: int
    kind: str
    nameless: Annotated[bool, Field(description="Whether what is missing could not be named.")]
    case: str
    source: Annotated[str, Field(description="Engine that made the data.")]
    simulator: Annotated[str, Field(description="Engine that diagnosed.")]
    truth: tuple[str, ...]
    named: tuple[str, ...]
    verdict: DiagnosisVerdict
    speed: Annotated[float, Field(description="Of the run ahead, over that of the fastest fitted one.")]
    samples: int
    readings: Annotated[Share | None, Field(description="Share of its readings within the band and their noise.")]
    true_values: Annotated[Share | None, Field(description="Share of what they would be without noise in the band.")]
    width: Annotated[Number, Field(description="Median width of the band, over one sigma of noise.")]
    off: Annotated[Number, Field(description="Largest gap of a sensor in that run, explained.")]


Truth = Literal["sixteenth", "analytic", "eighth", "doubt"]


class Stepped(Part):
    """Signals of an engine's runs with a joint model, and how their numerical uncertainty holds."""

    simulator: str
    joint_model: str
    case: str
    step: Annotated[float, Field(gt=0, description="s")]
    signals: int
    within: Annotated[int, Field(description="Whose error is 2 u_num at most.")]
    within_shortest: Annotated[int, Field(description="The same, held against steps a sixteenth as long alone.")]
    ordered: Annotated[int, Field(description="Of them, those with an observed order.")]
    ordered_within: int
    truth: Annotated[
        Mapping[Truth, int],
        Field(
            description="How many are held against what; doubt: rounding has overtaken the shortest steps, which yet"
            " stand for the truth."
        ),
    ]
    missed: Annotated[int, Field(description="Beyond 2 u_num, but for those in doubt.")]
    orders: Annotated[Mapping[str, Number], Field(description="Median observed order by kind of signal.")]
    worst: Annotated[float, Field(description="Largest error over 2 u_num of those with an order.")]
    excess: Annotated[
        tuple[tuple[float, ...], tuple[float, ...]],
        Field(description="2 u_num over the error of each signal that has one: with an order, and without."),
    ]
    errors: Annotated[
        Mapping[str, tuple[Number, ...]],
        Field(
            description="By kind of signal, in steps h, h/2, h/4 and h/8: median error over the largest signal of"
            " that unit, of those with an order."
        ),
    ]


class Impacting(Part):
    """The error of a run in which pins strike, against the equation of motion, over its steps."""

    simulator: str
    joint_model: str
    law: Annotated[str, Field(description="Of contact.")]
    steps: Annotated[tuple[float, ...], Field(min_length=2, description="s")]
    errors: Annotated[tuple[float, ...], Field(description="Largest of a body's angle in half a revolution, rad.")]
    order: Annotated[float, Field(description="Slope of the straight line through the logarithms of both.")]
    expanded: Annotated[float, Field(description="2 u_num of that angle in the longest steps, rad.")]
    touches: Annotated[int, Field(description="In that time, by the equation.")]


class Foretold(Part):
    """A sensor of a rig that others measured, in a run or a part of one to which nothing is fitted."""

    case: Annotated[str, Field(description="Folder of the data.")]
    left_out: Annotated[str, Field(description="What was foretold from the rest.")]
    simulator: str
    named: tuple[str, ...]
    verdict: DiagnosisVerdict
    signal: str
    samples: int
    readings: Annotated[Share | None, Field(description="Share of its readings within the 95 % band and their noise.")]
    width: Annotated[Number, Field(description="Median width of the band over the largest reading.")]
    off: Annotated[Number, Field(description="Gap of the sensor there, explained, in sigmas of its noise.")]


class Swung(Part):
    """A sensor in a swing of a pendulum on which a torque without a name acts, foretold from other swings of it."""

    seed: int
    fitted: Annotated[int, Field(description="Swings that it is foretold from.")]
    signal: str
    readings: Annotated[Share | None, Field(description="Share of its readings within the 95 % band and their noise.")]
    width: Annotated[Number, Field(description="Median width of the band over the largest reading.")]
    off: Annotated[Number, Field(description="Gap of the sensor there, explained, in sigmas of its noise.")]


class Trust(Part):
    """What numbers are worth, measured."""

    versions: Mapping[str, str]
    steps: tuple[Stepped, ...] = ()
    struck: tuple[Impacting, ...] = ()
    coverage: tuple[Covered, ...] = ()
    foretold: tuple[Foretold, ...] = ()
    swung: tuple[Swung, ...] = ()

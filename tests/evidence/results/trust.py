"""reports/trust.json: bands of predictions and numerical uncertainties, held against what is known."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

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


class Stepped(Part):
    """Signals of an engine's runs with a joint model, and how their numerical uncertainty holds."""

    simulator: str
    joint_model: str
    case: str
    step: Annotated[float, Field(gt=0, description="s")]
    signals: int
    within: Annotated[int, Field(description="Whose error against steps a sixteenth as long is 2 u_num at most.")]
    ordered: Annotated[int, Field(description="Of them, those with an observed order.")]
    ordered_within: int
    orders: Annotated[Mapping[str, Number], Field(description="Median observed order by kind of signal.")]
    worst: Annotated[float, Field(description="Largest error over 2 u_num of those with an order.")]


class Trust(Part):
    """What numbers are worth, measured."""

    versions: Mapping[str, str]
    steps: tuple[Stepped, ...] = ()
    coverage: tuple[Covered, ...] = ()

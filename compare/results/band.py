"""What is foretold of a signal with 95 %, what it is made of, and what it is wanted for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Literal

from pydantic import Field, FiniteFloat

from compare.results.document import Number, Part, Series, Share

SdFrom = Literal["parameters", "sets", "engines", "discrepancy"]
Sd = Annotated[FiniteFloat, Field(ge=0)]
TRUSTED_SPEEDS = 10.0  # times a speed: from there on other things matter than those that the data show


class Band(Part):
    """A signal (N) as the explained model foretells it, without its sensor's noise."""

    unit: str
    value: Annotated[
        Series,
        Field(
            min_length=1,
            description="Mean over the sets of effects that may be missing; of a free run with the torque that those"
            " fitted show beside them.",
        ),
    ]
    low: Annotated[Series, Field(min_length=1, description="2.5 % below.")]
    high: Annotated[Series, Field(min_length=1, description="2.5 % above.")]
    sd: Annotated[
        Mapping[SdFrom, Sd],
        Field(
            description="Standard deviation (rms over the samples) by what the parameters (and the start of a free run)"
            " leave open, by the sets that compete, by what engines differ by, and by what stays unexplained."
        ),
    ]
    growth: Annotated[
        FiniteFloat, Field(ge=1, description="Times as large as in the data what stays unexplained is taken to be.")
    ]
    covered: Annotated[
        Share | None, Field(description="Share of what was measured that lies within, its noise added; null: nothing.")
    ] = None


class Metrics(Part):
    """Validation metrics of a signal in a run in the manner of ASME V&V 20: E = S - D, simulated less measured.  All in
    the signal's SI unit, uncertainties standard ones (k = 1).
    """

    unit: str
    error_mean: Annotated[FiniteFloat, Field(description="Mean of E over the samples.")]
    error_rms: Annotated[Sd, Field(description="Root mean square of E.")]
    u_d: Annotated[
        Sd,
        Field(description="Of the measurement: noise (of a file without any, rounding) of a reading and calibration."),
    ]
    u_calibration: Annotated[Sd, Field(description="Of it, what all readings share (Type B), as [context] gives it.")]
    u_num: Annotated[
        Sd,
        Field(
            description="Of the simulation. In a diagnosis the engine's rms difference from the analytic model, over"
            " root 3; in a check 0 of the analytic model, which has no steps, and of an engine what its steps make."
        ),
    ]
    u_input: Annotated[
        Sd,
        Field(
            description="Of what the simulation is given. In a diagnosis of the values found, by their joint covariance"
            " and the sets; in a check of the recorded motion that is followed, and of [tolerances]."
        ),
    ]
    u_val: Annotated[Sd, Field(description="Root of the sum of the squares of these three.")]
    within: Annotated[Share, Field(description="Share of the samples with |E| of at most 2 u_val.")]
    model_error: Annotated[
        tuple[FiniteFloat, FiniteFloat],
        Field(description="95 % interval of the model's mean error: mean of E -+ 2 u_val, noise averaged."),
    ]
    area: Annotated[Sd, Field(description="Area between the distributions of simulated and measured values.")]


class Context(Part):
    """What a diagnosis is wanted for, and whether it is good enough for that."""

    question: str = ""
    quantity: Annotated[str, Field(description="The signal that is asked for.")]
    unit: str
    required: Annotated[FiniteFloat, Field(gt=0, description="Largest error that is good enough, either way.")]
    consequence: Annotated[str, Field(description="Of being wrong.")] = ""
    speed: Annotated[Number, Field(description="At which it is asked for (rad/s); null: as fast as what was fitted.")]
    half_width: Annotated[Number, Field(description="Largest distance of the 95 % band from its middle; null: none.")]
    enough: Annotated[bool | None, Field(description="Whether that is less than required; null where nobody can say.")]
    says: Annotated[str, Field(min_length=1, description="The judgement in a sentence.")]


def is_far(speed: float, speeds: Sequence[float]) -> bool:
    """Whether a speed (rad/s) is so far from those of the data that these say nothing there."""
    return bool(speeds) and abs(speed) > max(speeds) * TRUSTED_SPEEDS

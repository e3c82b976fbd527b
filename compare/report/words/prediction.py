"""Predictions in words: whether a model is good enough for what it is wanted for, and where its data say little."""

from __future__ import annotations

import math
from collections.abc import Sequence

from analytic.mechanism.one_line import capital, enumerated
from compare.quantities import amount, plainly
from compare.results.band import Band, Context, is_far
from compare.results.prediction import Prediction

METRICS_HEADS = (
    "Sensor", "Unit", "E, mean", "E, rms", "u_D", "u_num", "u_input", "u_val", "|E| ≤ 2 u_val", "Model error, mean",
    "Area metric", "In its 95 % band",
)  # fmt: skip
METRICS_MEAN = (
    "Of runs that nothing was fitted to, in the manner of ASME V&V 20: E is simulated less measured; u_D the standard"
    " uncertainty of the measurement (noise, and calibration where [context] gives it), u_num of the engine (what it"
    " differs by from the analytic model, which has no steps), u_input of the values found, u_val of them together. The"
    " model's mean error lies in the interval with 95 %. The area metric is the area between the distributions of"
    " simulated and measured values. The last column says how many readings lie in the band that was foretold for"
    " them."
)
OUTSIDE = 1.0 + 1e-6  # times a speed
HALF = 0.5  # of a band's variance, from which on one part of it is named


def rpm(speed: float) -> str:
    """A speed (rad/s) as people say it."""
    return f"{plainly(speed * 30 / math.pi)} rpm"


def headline(result: Prediction) -> str:
    """``rig at 600 rpm, as foretold by a diagnosis whose verdict is "explained"``."""
    speeds = dict.fromkeys(rpm(run.speed) for run in result.runs if run.speed is not None)
    at = f" at {enumerated([*speeds])}" if speeds else ""
    return f'{result.case}{at}, as foretold by a diagnosis whose verdict is "{result.diagnosis}"'


def judgement(context: Context, speeds: Sequence[float]) -> str:
    """``Good enough for 0.1 mm at 300 rpm: yes, with 95 %: the band is 0.04 mm to either side of ...``."""
    at = (
        rpm(context.speed)
        if context.speed is not None
        else f"{rpm(max(speeds))}, the fastest measured"
        if speeds
        else ""
    )
    lead = f"Good enough for {amount(context.required, context.unit)}{f' at {at}' if at else ''}"
    if context.half_width is None:
        return f"{lead}: nobody can say, as the model foretells no {context.quantity} there."
    band = f"the band of {context.quantity} is up to {amount(context.half_width, context.unit)} to either side"
    end = f"; of being wrong: {context.consequence.rstrip('.')}" if context.consequence else ""
    if context.enough is None and context.speed is not None:
        return f"{lead}: nobody can say, as that is {_far(context.speed, speeds)}{end}."
    return f"{lead}: {'yes, with 95 %' if context.enough else 'no, not with 95 %'}; {band}{end}."


def _far(speed: float, speeds: Sequence[float]) -> str:
    """How far a speed (rad/s) is from the data: ``3.3e+06 times as fast as anything measured (300 rpm)``."""
    return f"{abs(speed) / max(speeds):.2g} times as fast as anything measured ({rpm(max(speeds))})"


def notes(
    bands: dict[str, Band], speed: float, speeds: Sequence[float], unmeasured: Sequence[str], aside: float
) -> list[str]:
    """Where the data say little of a run, in sentences."""
    found = []
    if is_far(speed, speeds):
        found.append(f"{capital(rpm(speed))} is {_far(speed, speeds)}: the band says nothing there.")
    elif speeds and speed > max(speeds) * OUTSIDE:
        found.append(
            f"{capital(rpm(speed))} is faster than any fitted run ({rpm(max(speeds))}): bands grow with its square."
        )
    if speeds and 0 < speed < min(speeds) / OUTSIDE:
        found.append(f"{rpm(speed)} is slower than any fitted run ({rpm(min(speeds))}): bands grow up to twice.")
    larger = [f"{s} ({plainly(b.growth)} times)" for s, b in bands.items() if plainly(b.growth) != "1"]
    if larger:
        found.append(f"What stays unexplained is taken to be larger than in the data: {', '.join(larger)}.")
    if unmeasured:
        found.append(
            f"Nobody measured {', '.join(unmeasured)}: what stays unexplained of it is taken to be as large a share of"
            " its peak as the worst of what was measured."
        )
    if aside > 0.05:
        found.append(
            f"Sets of effects with a probability of {plainly(100 * aside, 2)} % together are not in the bands: each is"
            " too improbable to have values."
        )
    return found


def mostly(band: Band) -> str:
    """What a band is mostly made of: the part that has half of its variance or more, else two."""
    variances = {name: size**2 for name, size in band.sd.items()}
    total = sum(variances.values())
    if not total:
        return "nothing"
    names = sorted(variances, key=lambda name: -variances[name])
    return names[0] if variances[names[0]] >= HALF * total else f"{names[0]}, {names[1]}"

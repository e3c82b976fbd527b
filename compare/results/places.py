"""Located deviations in words, whatever moves the linkage: a crank, by its angle; a slide, by time and travel; several
drives, by time.
"""

from __future__ import annotations

import math

from compare.quantities import fitting
from compare.results.diagnosis import Diagnosis, Located
from compare.results.sentences import MOST_OF_RUN, plainly, sentence, spoken

SHORTEST = 1e-9  # m, of a travel that is told


def located(result: Diagnosis, place: Located) -> str:
    """A deviation and where it is: ``drive force at S in run steps is too low by 41 N from 15.9 to 18.6 s, at 2 to
    234 mm``; of a crank see :func:`compare.results.sentences.sentence`.
    """
    if result.mechanism.cranked:
        return sentence(result, place)
    alike = (other.size for other in result.located if other.signal == place.signal)
    unit, factor = fitting(place.unit, place.size, *alike)  # one unit for all that is said of a sensor
    much = f"{plainly(abs(place.size) * factor, 2)} {unit}"
    way = "high" if place.size > 0 else "low"
    return f"{spoken(result, place.signal)} in run {place.run} is too {way} by {much} {_where(result, place)}"


def _where(result: Diagnosis, place: Located) -> str:
    """When it is there, and between which travels of a slide."""
    begin, end = place.time_from, place.time_to
    run = next((run for run in result.runs if run.name == place.run), None)
    travel = f", {_travel(result, place)}" if result.mechanism.sliding else ""
    if begin is None or end is None:
        return travel.removeprefix(", ")
    if run is not None and end - begin >= MOST_OF_RUN * float(run.time[-1] - run.time[0]):
        return "throughout the run"
    return f"from {plainly(begin)} to {plainly(end)} s{travel}"


def _travel(result: Diagnosis, place: Located) -> str:
    """Between which travels it is, to a hundredth of those of all runs."""
    ends = sorted((place.crank_angle_from, place.crank_angle_to))
    limits = [float(limit) for run in result.runs for limit in (run.crank_angle.min(), run.crank_angle.max())]
    unit, factor = fitting("m", *limits, *ends)
    reach = max(max(limits) - min(limits), SHORTEST)
    step = 10.0 ** (math.floor(math.log10(factor * reach)) - 2)
    low, high = (plainly(round(end * factor / step) * step + 0.0, 4) for end in ends)
    return f"at {low} to {high} {unit}"

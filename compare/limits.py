"""Limits that somebody sets to numbers of a result: how they are written, and what a linkage makes of them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from numbers import Real
from typing import Literal

import numpy as np

from analytic.kinematics.output import Output
from analytic.mechanism import GROUND, Mechanism
from analytic.mechanism.errors import quoted
from analytic.mechanism.signals import named
from analytic.mechanism.units import UnitError
from analytic.mechanism.written import number, one_unit, quantity
from analytic.paper.superposition import whole_turn
from compare.faults import ArgumentError
from compare.judge.metrics import rms
from compare.meant import meant
from compare.quantities import drive_signals
from compare.results.accuracy import Accuracy
from compare.results.analysis import Analysis, Extremes, Limit
from compare.results.looked_at import ByClearance
from compare.sampled import vertices
from compare.strokes import STROKE, strokes

ROUNDING = 1e-6  # of a limit: what is beyond it by less is on it, as peaks between samples are interpolated
MOST_LISTED = 16  # names in a sentence
EFFORTS = ("N", "N.m", "W")
TRANSMISSION = "transmission_angle"
RMS, MEAN = "rms_", "mean_"  # with the name of a force, a torque or a power after it
RATIO = "time_ratio_"  # with the same after it: how many times as long the slow way takes as the quick one
ERROR, WORST = "error_", "worst_"  # with an output's name after it: its error by clearance in equilibrium, at worst
Bounds = tuple[float, float]


@dataclass(frozen=True)
class Limitable:
    """A number that may have limits: its SI unit, what one without a colon is, and the signal whose it is."""

    unit: str
    alone: Literal["size", "least", "either"] = "size"
    signal: str = ""
    of: Literal["throughout", "mean", "rms", "travel", "once"] = "throughout"


def limited(
    given: object, known: Mapping[str, Limitable], unknown: str, m: Mechanism, more: Iterable[str] = ()
) -> dict[str, Bounds]:
    """The least and the largest value (SI; infinite where there is none) by name, as they were given: a number or a
    text with its unit, which is a largest size, or ``least:largest``.  Raises ArgumentError, with what is ``unknown``
    said of a name that is not known, and which of these and of ``more`` of a mechanism's was meant.
    """
    if not isinstance(given, Mapping):
        raise ArgumentError("limits", f"{quoted(given)} cannot be used; give them by name, as {next(iter(known))}=...")
    for name in given:
        if name not in known:
            joints = {b.name: [j.name for j in m.joints if b.name in j.bodies] for b in m.bodies}
            near = meant(str(name), [*known, *more], joints)
            first = [*list(known)[:MOST_LISTED], *["..."] * (len(known) > MOST_LISTED)]
            those = f"did you mean {near}?" if near else f"they are {', '.join(first)}"
            raise ArgumentError("limits", f"{name} is {unknown}; {those}")
    return {name: _bounds(name, size, known[name]) for name, size in given.items()}


def _bounds(name: str, given: object, of: Limitable) -> Bounds:
    """A limit as its least and largest value.  Raises ArgumentError."""
    if isinstance(given, str) and ":" in given:
        return _range(name, given, of.unit)
    value = _amount(name, given, of.unit)
    if value <= 0:
        raise ArgumentError("limits", f"{name} = {quoted(given)}; give {of.unit}, above 0")
    if of.alone == "either":
        raise ArgumentError("limits", f"{name} = {given} may be the least or the largest; write {given}: or :{given}")
    return (value, math.inf) if of.alone == "least" else (-value, value)


def _range(name: str, given: str, unit: str) -> Bounds:
    parts = [part.strip() for part in given.split(":")]
    ends = [part for part in parts if part]
    if len(parts) != 2 or not ends:
        raise ArgumentError("limits", f"{name} = {given} is no range; give least:largest, of which one may be left out")
    try:
        amounts = iter([_amount(name, end, unit) for end in one_unit(ends)])
    except UnitError as error:
        raise ArgumentError("limits", f"{name} = {given} has {error}") from None
    low, high = (next(amounts) if part else sign * math.inf for part, sign in zip(parts, (-1, 1), strict=True))
    if low >= high:
        raise ArgumentError("limits", f"{name} = {given}: the least comes first, and is less than the largest")
    return low, high


def _amount(name: str, size: object, unit: str) -> float:
    """A number (SI).  Raises ArgumentError."""
    if isinstance(size, bool) or not isinstance(size, Real | str):
        raise ArgumentError("limits", f"{name} = {quoted(size)}; give {unit}")
    try:
        value = number(size if isinstance(size, str) else float(size), unit)
    except UnitError as error:
        raise ArgumentError("limits", f"{name} = {quoted(size)} has {error}") from None
    if not math.isfinite(value):
        raise ArgumentError("limits", f"{name} = {quoted(size)}; give {unit}")
    if unit == "rad" and isinstance(size, str) and quantity(size, unit) is None:
        raise ArgumentError("limits", f"{name} = {size} has no unit; write {size}deg, or {size}rad if meant")
    return value


# ---------------------------------------------------------------- of an analysis


def limits_of(result: Analysis, given: object) -> dict[str, Limit]:
    """What an analysis makes of limits to its signals, ``reaction_B`` for the size of one, to ``stroke_<joint or
    body>`` and ``time_ratio_<joint or body>``, to the least ``transmission_angle``, to errors by clearance,
    ``error_<output>`` in equilibrium and ``worst_<output>``, and to the mean and the root mean square of forces,
    torques and powers, ``mean_<signal>`` and ``rms_<signal>``.  Raises ArgumentError.
    """
    m, known = result.mechanism, _known(result)
    if isinstance(given, Mapping) and not m.clearances:
        refuse_errors_of_none(m.name, (name for name in given if str(name).startswith((ERROR, WORST))))
    every = named(m.bodies, m.joints, m.drives, m.sensors)
    asleep = {name: signal for name, signal in every.items() if signal.on_request and name not in known}
    means = [f"{head}{name}" for head in (MEAN, RMS) for name in asleep if asleep[name].unit in EFFORTS]
    for name in (name for name in [*asleep, *means] if isinstance(given, Mapping) and name in given):
        signal = name.removeprefix(MEAN).removeprefix(RMS)
        raise ArgumentError("limits", f"{signal} is a signal on request; ask for it by `signals` too")
    points = [f"{ERROR}{d.name}" for d in points_of(m)]
    bounds = limited(given, known, f"nothing of {m.name} that may have a limit", m, [*asleep, *means, *points])
    angle = np.zeros(0) if result.transmission is None else np.arcsin(np.clip(result.transmission, 0.0, 1.0))
    series = {TRANSMISSION: angle} | errors(result.errors) | dict(result.signals)
    series |= {f"{RATIO}{stroke.what}": np.array([stroke.ratio]) for stroke in strokes(result)}
    places = result.crank_angle if result.time is None else result.time
    extremes = {**result.extremes, **between(errors(result.errors), places)}
    found = {name: _limit(known[name], both, series, places, extremes) for name, both in bounds.items()}
    return {name: each.model_copy(update=_basis(result, known[name])) for name, each in found.items()}


def _basis(result: Analysis, of: Limitable) -> dict[str, object]:
    """What a number is of, where that is not the whole turn, or not the linkage as it is."""
    theta = result.crank_angle
    part = of.of in ("mean", "rms", "travel") and result.time is None and not whole_turn(theta)
    over = {"over": (float(theta.min()), float(theta.max()))} if part and theta.size else {}
    ideal = of.signal.startswith((STROKE, RATIO)) and bool(result.clearance)
    return over | ({"without_clearance": True} if ideal else {})


def limits_of_errors(result: Accuracy, bounds: Mapping[str, Bounds]) -> dict[str, Limit]:
    """What errors by clearance make of limits, ``<output>`` in equilibrium and ``worst_<output>``."""
    series = {name.removeprefix(ERROR): values for name, values in errors(result.outputs).items()}
    units = {name: result.outputs[name.removeprefix(WORST)].unit for name in bounds}
    extremes = between(series, result.crank_angle)
    return {
        name: _limit(Limitable(units[name], signal=name), both, series, result.crank_angle, extremes)
        for name, both in bounds.items()
    }


def points_of(m: Mechanism) -> list[Output]:
    """Where each point of each body is: x and y."""
    return [Output(b.name, axis, point) for b in m.bodies for point in b.points for axis in ("x", "y")]


def points_in(given: object, m: Mechanism) -> list[Output]:
    """Both axes of the points of bodies whose errors have limits, ``error_rocker.tip_x``, or ``rocker.tip_x`` of an
    accuracy.
    """
    asked = {str(name).removeprefix(ERROR).removeprefix(WORST) for name in given} if isinstance(given, Mapping) else ()
    return [each for each in points_of(m) if {f"{each.place}_x", f"{each.place}_y"} & {*asked}]


def refuse_errors_of_none(case: str, asked: Iterable[str]) -> None:
    """Raises ArgumentError where anything is asked of the errors of a linkage without clearance."""
    for name in asked:
        why = f"{name} is an error by clearance, and no joint of {case} has any; give some by `clearance`"
        raise ArgumentError("limits", why)


def errors(outputs: Mapping[str, ByClearance]) -> dict[str, np.ndarray]:
    """The errors (N,) of outputs by clearance, as limits call them."""
    return {
        f"{kind}{name}": values
        for name, error in outputs.items()
        for kind, values in ((ERROR, error.equilibrium), (WORST, error.worst_case))
    }


def between(series: Mapping[str, np.ndarray], places: np.ndarray) -> dict[str, Extremes]:
    """The ends of errors (N,) between samples ``places`` (N,) evenly apart, where a parabola through three is near."""
    step = np.diff(places)
    if step.size < 2 or np.ptp(step) > ROUNDING * abs(step[0]):
        return {}
    found = {}
    for name, values in series.items():
        beside = (values[-2:], values[:2]) if whole_turn(places) else (np.full(2, np.nan),) * 2
        share, value, way = vertices(np.concatenate([beside[0], values, beside[1]]))
        there = places + share * step[0]
        there = np.where(there < places.min(), there + math.tau, there)  # of a whole turn
        end: list[tuple[float, float] | tuple[None, None]] = [(None, None)] * 2
        for which, sign in enumerate((1.0, -1.0)):
            if (way == sign).any():
                k = int(np.argmax(np.where(way == sign, sign * value, -np.inf)))
                end[which] = float(value[k]), float(there[k])
        (top, top_at), (bottom, bottom_at) = end
        found[name] = Extremes(highest=top, highest_at=top_at, lowest=bottom, lowest_at=bottom_at)
    return found


def _known(result: Analysis) -> dict[str, Limitable]:
    """What may have a limit; not how a reaction is directed, which has no size."""
    m, kinds = result.mechanism, result.kinds
    signals = [n for n, kind in kinds.items() if not (kind.kind == "reaction" and kind.wraps)]
    whole = [n for n in signals if kinds[n].component == "magnitude"]
    slides = {f"{joint.name}": joint for joint in m.joints if joint.prismatic}
    moves = [(f"position_{name}", name) for name in slides]
    moves += [(f"{body.name}_angle", body.name) for body in m.bodies if not m.cranked or body.name != m.driven]
    on_ground = {body: name for name, joint in slides.items() if GROUND in joint.bodies for body in joint.bodies}
    known = {n.removesuffix("_magnitude"): Limitable(kinds[n].unit, signal=n) for n in whole}
    known |= {n: Limitable(kinds[n].unit, signal=n) for n in drive_signals(m) if n in kinds}
    ideal = {n: f"{STROKE}{what}" for n, what in moves if f"{STROKE}{what}" in result.extremes}
    known |= {f"{STROKE}{what}": Limitable(kinds[n].unit, "either", ideal.get(n, n), "travel") for n, what in moves}
    known |= {f"{STROKE}{b}": known[f"{STROKE}{s}"] for b, s in on_ground.items() if f"{STROKE}{b}" in known}
    known |= {f"{RATIO}{s.what}": Limitable("", "either", f"{RATIO}{s.what}", "once") for s in strokes(result)}
    known |= {} if result.transmission is None else {TRANSMISSION: Limitable("rad", "least", TRANSMISSION)}
    known |= {n: Limitable(kinds[n].unit, signal=n) for n in signals}
    known |= {n: Limitable(result.errors[n[len(ERROR) :]].unit, signal=n) for n in errors(result.errors)}
    efforts = {n: of for n, of in known.items() if of.unit in EFFORTS and of.signal in kinds}
    known |= {f"{RMS}{n}": replace(of, of="rms") for n, of in efforts.items()}
    return known | {f"{MEAN}{n}": replace(of, of="mean") for n, of in efforts.items()}


def _limit(
    of: Limitable,
    bounds: Bounds,
    every: Mapping[str, np.ndarray],
    places: np.ndarray,
    extremes: Mapping[str, Extremes],
) -> Limit:
    """The value that is farthest beyond its bound, or nearest to it, of ``every`` series (N,) at ``places`` (N,), and
    between them; of a stroke highest less lowest.
    """
    series = every.get(of.signal, np.zeros(0))
    there, found = np.isfinite(series), extremes.get(of.signal)
    ends = list(zip(series[there].tolist(), places[: series.size][there].tolist(), strict=True))
    looked = () if found is None else ((found.highest, found.highest_at), (found.lowest, found.lowest_at))
    ends += [(v, x) for v, x in looked if v is not None and x is not None]
    if of.of in ("mean", "rms") and ends:
        known = (rms if of.of == "rms" else np.nanmean)(series) if found is None else getattr(found, of.of)
        ends = [] if known is None else [(known, math.nan)]
    off, value, at = math.inf, None, None
    if ends:
        highest, lowest = max(ends), min(ends)
        if of.of == "travel":
            highest = lowest = (highest[0] - lowest[0], math.nan)
        if of.of == "once":
            highest = lowest = (highest[0], math.nan)
        off, (value, at) = max((highest[0] - bounds[1], highest), (bounds[0] - lowest[0], lowest))
    slack = ROUNDING * max(abs(bound) for bound in bounds if math.isfinite(bound))
    verdict: Literal["holds", "broken", "unknown"] = "holds" if there.all() and ends else "unknown"
    return Limit(
        unit=of.unit,
        least=bounds[0],
        largest=bounds[1],
        value=value,
        at=at,
        missing=int(np.sum(~there)),
        verdict="broken" if ends and off > slack else verdict,
    )

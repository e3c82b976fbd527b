"""Tolerances of a mechanism in accuracy and analysis: what varies, and what it does to outputs and signals."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from numbers import Real

import numpy as np

from analytic.beyond_paper.tolerances import ROUNDING, toleranced_errors
from analytic.kinematics.output import Output
from analytic.mechanism import Mechanism, MechanismError
from analytic.mechanism.errors import quoted
from analytic.mechanism.signals import named
from analytic.mechanism.tolerances import Source, changed, sources
from analytic.mechanism.units import UnitError
from analytic.mechanism.written import quantity
from analytic.paper.superposition import AccuracyAnalysis
from compare.faults import ArgumentError
from compare.results.toleranced import (
    AccuracyByTolerance,
    ByTolerance,
    Made,
    OutputByTolerance,
    SignalsByTolerance,
    Varied,
)

Signals = Mapping[str, np.ndarray]


def states_tolerances(m: Mechanism) -> bool:
    """Whether anything of a mechanism varies from one made linkage to another."""
    return bool(m.tolerances) or any(joint.fit for joint in m.joints)


def varying(m: Mechanism, replaced: bool) -> tuple[tuple[Source, ...], list[str]]:
    """What varies of a linkage, and a sentence on tolerances of clearances that do not go with those that were asked
    for in their place, if they were ``replaced``.  Raises MechanismError.
    """
    loose = {f"joint.{name}.clearance" for name in (j.name for j in m.joints)}
    if not replaced:
        return sources(m), []
    others = {field: tolerance for field, tolerance in m.tolerances.items() if field not in loose}
    unfitted = tuple(j.model_copy(update={"fit": None}) for j in m.joints)
    kept = list(sources(m.replace(tolerances=others, joints=unfitted)))
    given = [*(loose & {*m.tolerances}), *(f"joint.{j.name}.clearance" for j in m.joints if j.fit)]
    left_out = ", ".join(sorted(given))
    return tuple(kept), [f"left out: tolerances of {left_out}, as other clearances were asked for"] if given else []


def limited(given: object, outputs: list[Output]) -> dict[Output, float]:
    """Limits by output (m or rad) as they were given, numbers or strings with units.  Raises ArgumentError."""
    known = {d.name: d for d in outputs}
    if not isinstance(given, Mapping):
        raise ArgumentError(
            "limit", f"{quoted(given)} cannot be used; give limits by output, such as {next(iter(known))}=..."
        )
    limits = {}
    for name, size in given.items():
        if name not in known:
            raise ArgumentError("limit", f"{name} is no output that is looked at; they are {', '.join(known)}")
        unit = known[name].unit
        try:
            value = quantity(size, unit) if isinstance(size, str) else size
            value = float(size) if value is None else value
        except (UnitError, ValueError) as error:
            why = str(error) if isinstance(error, UnitError) else f"no number; give {unit}, or a number with its unit"
            raise ArgumentError("limit", f"{name} = {quoted(size)} has {why}") from None
        if not isinstance(value, Real) or isinstance(value, bool) or not 0 < float(value) < math.inf:
            raise ArgumentError("limit", f"{name} = {quoted(size)}; give {unit}, above 0")
        limits[known[name]] = float(value)
    return limits


def of_outputs(
    cycle: AccuracyAnalysis, every: tuple[Source, ...], samples: int, seed: int, limits: Mapping[Output, float]
) -> AccuracyByTolerance:
    """What tolerances do to a linkage's outputs.  Raises AssemblyError."""
    result = toleranced_errors(cycle, every, samples, seed, limits)
    return AccuracyByTolerance(
        sources=_varied(every),
        assembled=result.assembled,
        outputs={
            d.name: OutputByTolerance(
                unit=d.unit,
                sd=errors.sd,
                by_source=errors.by_group,
                monte_carlo=Made(mean=errors.mean, sigma=errors.sigma, low=errors.low, high=errors.high),
                at=float(cycle.theta[errors.worst]),
                sobol_first=errors.first,
                sobol_total=errors.total,
                limit=limits.get(d),
                within=result.within.get(d),
            )
            for d, errors in result.outputs.items()
        },
        within=result.within_all,
    )


def of_signals(
    m: Mechanism, every: tuple[Source, ...], signals: Signals, ask: Callable[[Mechanism], Signals]
) -> SignalsByTolerance:
    """What tolerances do to a linkage's ``signals``, to first order: by the difference over a standard deviation to
    either side of what each number is, of what a linkage ``ask``ed has for signals.

    Raises MechanismError of a linkage that cannot be analysed there.
    """
    groups: dict[str, dict[str, np.ndarray]] = {}
    units = named(m.bodies, m.joints, m.drives)
    for source in every:
        try:
            high, low = (ask(changed(m, {source.field: source.nominal + way * source.sd})) for way in (1, -1))
        except ValueError as error:
            raise MechanismError(
                f"{m.name}: tolerances[{source.field}] of sd {source.sd:g} {source.unit} is too large for first order:"
                f" {error}"
            ) from None
        parts = groups.setdefault(source.group, {})
        for name in signals.keys() & units.keys() & high.keys() & low.keys():
            apart = high[name] - low[name]
            if units[name].unit == "rad":  # continued from the first sample on, which may lie in another turn
                apart -= math.tau * np.round(apart / math.tau)
            parts[name] = parts.get(name, 0.0) + apart / 2
    found = {}
    for name in signals.keys() & units.keys():
        by_source = {group: np.abs(parts[name]) for group, parts in groups.items() if name in parts}
        sd = np.sqrt(sum((part**2 for part in by_source.values()), np.zeros(signals[name].shape)))
        least = ROUNDING * max(np.nanmax(np.abs(x), initial=0.0) for x in (signals[name], *by_source.values()))
        kept = {group: part for group, part in by_source.items() if np.nanmax(part, initial=0.0) > 1e3 * least}
        if kept:
            found[name] = ByTolerance(unit=units[name].unit, sd=sd, by_source=kept)
    return SignalsByTolerance(sources=_varied(every), signals={name: found[name] for name in signals if name in found})


def _varied(every: tuple[Source, ...]) -> dict[str, Varied]:
    return {
        x.field: Varied(
            unit=x.unit,
            nominal=x.nominal,
            distribution=x.tolerance.shape,
            mean=x.mean,
            sd=x.sd,
            low=x.ends[0],
            high=x.ends[1],
            group=x.tolerance.group or "",
        )
        for x in every
    }

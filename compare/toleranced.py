"""Tolerances of a mechanism in accuracy and analysis: what varies, and what it does to outputs and signals."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from analytic.beyond_paper.tolerances import TAIL, toleranced_errors
from analytic.kinematics.output import Output
from analytic.mechanism import Mechanism, MechanismError
from analytic.mechanism.signals import Signal, named
from analytic.mechanism.tolerances import Source, changed, sources
from analytic.paper.superposition import AccuracyAnalysis
from compare.faults import ArgumentError
from compare.limits import ERROR, WORST, Bounds, Limitable, limited, points_of
from compare.results.toleranced import (
    AccuracyByTolerance,
    ByTolerance,
    Made,
    OutputByTolerance,
    SignalsByTolerance,
    Varied,
)

Signals = Mapping[str, np.ndarray]
Ask = Callable[[Mechanism], Signals]
FOUND_TO = 1e-8  # of a signal: an equilibrium is found to 1e-9 of it, and a difference has two


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


def limits_of_outputs(given: object, outputs: list[Output], m: Mechanism) -> dict[str, Bounds]:
    """Largest good errors, to either side, by output (m or rad), or by ``worst_<output>``, as they were given.  Raises
    ArgumentError.
    """
    known = {f"{kind}{d.name}": Limitable(d.unit) for kind in ("", WORST) for d in outputs}
    if isinstance(given, Mapping):  # as an analysis has them
        given = {str(name).removeprefix(ERROR): value for name, value in given.items()}
    limits = limited(given, known, "no output that is looked at", m, [d.name for d in points_of(m)])
    for name, (least, largest) in limits.items():
        if least != -largest:
            raise ArgumentError("limits", f"{name} has a range; an error has one limit to either side: give {name}=...")
    return limits


def of_outputs(
    cycle: AccuracyAnalysis,
    every: tuple[Source, ...],
    samples: int,
    seed: int,
    limits: Mapping[Output, float],
    min_yield: float | None,
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
        min_yield=min_yield,
    )


def of_signals(
    m: Mechanism, every: tuple[Source, ...], signals: Signals, ask: Ask, samples: int, seed: int
) -> SignalsByTolerance:
    """What tolerances do to a linkage's ``signals``: to first order, and over so many linkages as made, each of which
    is ``ask``ed for its signals.

    Raises MechanismError of a linkage that cannot be analysed a standard deviation from what the file says.
    """
    units = {name: signal for name, signal in named(m.bodies, m.joints, m.drives, m.sensors).items() if name in signals}
    asked = {name: signals[name] for name in units}
    groups: dict[str, dict[str, np.ndarray]] = {}
    for source in every:
        parts = groups.setdefault(source.group, {})
        for name, part in _parts(m, source, ask, units).items():
            parts[name] = parts.get(name, 0.0) + part
    made, assembled = _made(m, every, asked, ask, units, samples, seed) if samples else ({}, None)
    found = {}
    for name, nominal in asked.items():
        by_source = {group: np.abs(parts[name]) for group, parts in groups.items() if name in parts}
        least = FOUND_TO * max(np.nanmax(np.abs(x), initial=0.0) for x in (nominal, *by_source.values()))
        kept = {group: part for group, part in by_source.items() if np.nanmax(part, initial=0.0) > least}
        if kept:
            sd = np.sqrt(sum((part**2 for part in by_source.values()), np.zeros(nominal.shape)))
            found[name] = ByTolerance(unit=units[name].unit, sd=sd, by_source=kept, monte_carlo=made.get(name))
    return SignalsByTolerance(sources=_varied(every), signals=found, samples=samples, assembled=assembled)


def _parts(m: Mechanism, source: Source, ask: Ask, units: Mapping[str, Signal]) -> dict[str, np.ndarray]:
    """By signal (N,) half of what it differs by where a number is one standard deviation more and one less."""
    try:
        high, low = (ask(changed(m, {source.field: source.nominal + way * source.sd})) for way in (1, -1))
    except ValueError as error:
        raise MechanismError(
            f"{m.name}: tolerances[{source.field}] of sd {source.sd:g} {source.unit} is too large for first order:"
            f" {error}"
        ) from None
    return {
        name: _apart(high[name], low[name], unit) / 2 for name, unit in units.items() if name in high and name in low
    }


def _apart(one: np.ndarray, other: np.ndarray, signal: Signal) -> np.ndarray:
    """One less the other (N,); angles are continued from the first sample on, which may lie in another turn."""
    apart = one - other
    return apart - math.tau * np.round(apart / math.tau) if signal.unit == "rad" else apart


def _made(
    m: Mechanism,
    every: tuple[Source, ...],
    signals: Signals,
    ask: Ask,
    units: Mapping[str, Signal],
    samples: int,
    seed: int,
) -> tuple[dict[str, Made], float]:
    """What signals differ by from the linkage as drawn, over linkages as made, and the share that assembles."""
    names = tuple(dict.fromkeys(x.group for x in every))
    shares = dict(zip(names, np.random.default_rng(seed).random((len(names), samples)), strict=True))
    values = {x.field: x.at(shares[x.group]) for x in every}
    errors: dict[str, list[np.ndarray]] = {name: [] for name in signals}
    for k in range(samples):
        try:
            one = ask(changed(m, {field: float(numbers[k]) for field, numbers in values.items()}))
        except ValueError:  # it does not assemble
            continue
        for name, nominal in signals.items():
            errors[name].append(_apart(one[name], nominal, units[name]))
    made = {}
    for name, rows in errors.items():
        if rows:
            table = np.array(rows)
            low, high = np.quantile(table, (TAIL, 1 - TAIL), axis=0)
            made[name] = Made(mean=table.mean(axis=0), sigma=table.std(axis=0), low=low, high=high)
    return made, max(len(rows) for rows in errors.values()) / samples


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

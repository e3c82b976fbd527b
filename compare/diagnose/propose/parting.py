"""Which sensor would tell two places apart that do as well on the sensors that there are."""

from __future__ import annotations

import numpy as np

from compare.diagnose.effects.effect import LANDING
from compare.diagnose.predict import Term
from compare.diagnose.propose.places import EFFECTS
from compare.diagnose.propose.proposal import Proposal
from compare.quantities import amount, quantities

LEAST_DIFFERENCE = 1e-3  # of a signal's range: a smaller difference (rms) is not worth a sensor


def would_separate(one: Proposal, other: Proposal) -> str:
    """A signal that is not measured and differs most between two proposals, in words; empty where none does."""
    scene = one.scene
    run = max(scene.data.measured.runs, key=lambda r: r.time.size)
    first, second = (_changes(p, run.name) for p in (one, other))
    words = quantities(scene.rig.mechanism)
    best, said = LEAST_DIFFERENCE, ""
    for signal, values in scene.signals[run.name].items():
        known = scene.rig.known[signal]
        directed = known.kind == "reaction" and known.wraps  # of a force, which no sensor reads
        if signal in run.channels or signal not in words or known.kind == "clearance" or directed:
            continue
        apart = np.atleast_1d(first.get(signal, 0.0) - second.get(signal, 0.0))
        apart = apart[np.isfinite(apart)]
        size = float(np.sqrt(np.mean(apart**2))) if apart.size else 0.0
        share = size / max(float(np.ptp(values)), 1e-300)
        if share > best and np.ptp(values) > 0:
            best = share
            by = amount(size, known.unit)
            said = (
                f"a sensor for the {words[signal].label}: the two differ there by {by} (rms) in run {run.name},"
                f" {100 * share:.2g} % of its range"
            )
    return said


def _changes(p: Proposal, name: str) -> dict[str, np.ndarray]:
    """What a proposal's unknown does to every signal (N,) of a run, to first order."""
    if p.place.unknown == "error":
        return {}
    scene = p.scene
    r, run = next((i, run) for i, run in enumerate(scene.data.measured.runs) if run.name == name)
    effect = EFFECTS[p.place.unknown]
    step = float(effect.scales(scene.rig, p.place.where)[0])
    term = Term(effect, p.place.where), {effect.parameters[0].name: step}
    there, here = scene.moved(run, [*scene.hypothesis, term]), scene.signals[name]
    known = scene.rig.known
    return {s: known[s].apart(there[s], here[s]) / step * p.found.values[r] for s in here if s != LANDING}

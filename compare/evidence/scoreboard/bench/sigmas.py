"""How well an effect shows beside its best rival and all that the family allows for: nuisances of sensors, and what is
slightly off.

Everything is linear about the nominal rig, by the analytic model.  ``distinct`` of an effect: with r the sigmas
that are left once a rival, the other true effects and the nuisances are fitted to the data, and r0 those once the
true effect is, the smallest sqrt(r^2 - r0^2) of all rivals.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from compare.diagnose.effects.effect import Values
from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.diagnose.predict import Term
from compare.evidence.scoreboard.rigs import Experiment, Rejected
from compare.evidence.scoreboard.sizes import Planted, Sizer, left

# the vocabulary of the first scoreboard, so that a set stays what it is when the vocabulary grows
RIVALS = (
    "gravity", "payload", "com_offset", "moment_of_inertia", "link_length", "pivot_position", "joint_clearance",
    "coulomb_friction", "viscous_friction", "joint_spring", "external_force", "load_torque", "drive_compliance",
    "speed_ripple", "encoder_offset", "sensor_bias", "sensor_gain", "sensor_delay", "sensor_frame", "clock_offset",
)  # fmt: skip
Hypothesis = Sequence[tuple[Term, Values]]


class Ruler:
    """Signatures of an experiment, in sigmas of its white noise."""

    def __init__(self, experiment: Experiment) -> None:
        self.experiment, self.sizer = experiment, Sizer(experiment)
        self.model = self.sizer.model([])
        nominal = self.readings([[]])[0]
        if nominal is None:
            raise Rejected("the nominal rig is not possible everywhere")
        self.nominal = nominal

    def readings(self, hypotheses: Sequence[Hypothesis]) -> list[np.ndarray | None]:
        """All readings over their noise, of run after run and sensor after sensor."""
        found: list[np.ndarray | None] = []
        for runs in self.model(hypotheses):
            if runs is None:
                found.append(None)
                continue
            flat = np.concatenate([run[s] / sigma for run in runs for s, sigma in self.experiment.noise.items()])
            found.append(flat if np.isfinite(flat).all() else None)
        return found

    def signature(self, things: Sequence[Planted]) -> np.ndarray:
        """What things together change.  Raises Rejected where they are not possible."""
        found = self.readings([[(_term(t), t.values) for t in things]])[0]
        if found is None:
            raise Rejected("the truth is not possible everywhere")
        return np.asarray(found - self.nominal)

    def columns(self, term: Term) -> np.ndarray | None:
        """(N, k) small changes that an effect can make; None where it can make none."""
        rig = self.sizer.rig
        probes = np.atleast_2d(term.effect.probes(rig, term.where, term.variant))
        asked = [[(term, term.effect.values(rig, term.where, x, term.variant))] for x in probes]
        still = [(term, term.effect.values(rig, term.where, 0.0 * probes[0], term.variant))]
        base, *found = self.readings([still, *asked])
        if base is None or any(f is None for f in found):
            return None
        return np.column_stack([f - base for f in found if f is not None])

    def rivals(self) -> list[tuple[Term, np.ndarray]]:
        """Every effect at every place with its changes."""
        rig, found = self.sizer.rig, []
        for name in RIVALS:
            effect = VOCABULARY[name]
            for where in effect.places(rig):
                for variant in effect.variants(rig, where):
                    term = Term(effect, where, variant)
                    columns = self.columns(term)
                    if columns is not None:
                        found.append((term, columns))
        return found

    def judged(
        self, truth: Sequence[Planted], slight: Sequence[Planted] = (), nuisances: np.ndarray | None = None
    ) -> tuple[Planted, ...]:
        """The true effects with their sizes, ``nuisances`` (N, k) and the others free to move."""
        if not truth:
            return ()
        rivals = self.rivals()
        known = {(t.effect.name, t.where): c for t, c in rivals}
        free = np.zeros((0, 0)) if nuisances is None else nuisances
        off = self.signature(slight) if slight else 0.0 * self.signature(truth[:1])
        out = []
        for thing in truth:
            others = [known[t.name, t.where] for t in truth if t is not thing and (t.name, t.where) in known]
            base = np.column_stack([c for c in (free, *others) if c.size]) if free.size or others else None
            whole = off + self.signature([thing])
            right = _rest(off, base)
            best, rival = _rest(whole, base), None
            for term, columns in rivals:
                if term.key in {(t.name, t.where) for t in truth}:
                    continue
                rest = _rest(whole, columns if base is None else np.column_stack([base, columns]))
                if rest < best:
                    best, rival = rest, term.label
            distinct = math.sqrt(max(best**2 - right**2, 0.0))
            total = float(np.linalg.norm(self.signature([thing])))
            out.append(replace(thing, total=total, linear=distinct, distinct=distinct, rival=rival))
        return tuple(out)

    def uncertainty(self, thing: Planted, nuisances: np.ndarray, step: float = 1e-3) -> float:
        """One sigma of the effect's parameters over their size, nuisances free: the worst group of one unit."""
        names, groups = list(thing.values), units_of(thing)
        columns = []
        for name in names:
            size = math.hypot(*(thing.values[n] for n in groups[name]))
            ends = [
                self.signature([replace(thing, values={**thing.values, name: thing.values[name] + s * step * size})])
                for s in (-1, 1)
            ]
            columns.append((ends[1] - ends[0]) / (2 * step))  # over a change as large as the parameter
        jacobian = np.column_stack([*columns, nuisances]) if nuisances.size else np.column_stack(columns)
        scale = np.linalg.norm(jacobian, axis=0)
        scale[scale == 0] = 1.0
        unit = jacobian / scale
        covariance = np.linalg.pinv(unit.T @ unit, rcond=1e-12)
        sigmas = np.sqrt(np.diag(covariance)[: len(names)]) / scale[: len(names)]
        return max(
            math.hypot(*(sigmas[names.index(n)] for n in group)) for group in {tuple(g) for g in groups.values()}
        )


def units_of(thing: Planted) -> dict[str, tuple[str, ...]]:
    """For each parameter those of the same unit, itself among them: a vector is judged by its length."""
    unit = {p.name: p.unit for p in VOCABULARY[thing.name].parameters}
    return {name: tuple(n for n in thing.values if unit[n] == unit[name]) for name in thing.values}


def _term(thing: Planted) -> Term:
    return Term(VOCABULARY[thing.name], thing.where)


def _rest(residual: np.ndarray, columns: np.ndarray | None) -> float:
    return float(np.linalg.norm(residual)) if columns is None else left(residual, columns)

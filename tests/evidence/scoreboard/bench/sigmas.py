"""How well an effect shows beside its best rival and all that the family allows for: nuisances of sensors, and what is
slightly off.

Everything is linear about the nominal rig, by the analytic model, but a payload as a rival, which is fitted in
full.  ``distinct`` of an effect: with r the sigmas
that are left once a rival, the other true effects and the nuisances are fitted to the data, and r0 those once the
true effect is, the smallest sqrt(r^2 - r0^2) of all rivals.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from compare.diagnose.effects.bodies import Payload
from compare.diagnose.effects.effect import Values
from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.diagnose.predict import Term
from tests.evidence.scoreboard.rigs import Experiment, Rejected
from tests.evidence.scoreboard.score import DISTINCT
from tests.evidence.scoreboard.sizes import Planted, Sizer, left

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

    def rivals(self, truth: Sequence[Planted]) -> list[Term]:
        """Every other effect at every place; first those at the same places, which are likely to look the same."""
        rig, true = self.sizer.rig, {(t.name, t.where) for t in truth}
        effects = [VOCABULARY[name] for name in RIVALS]
        terms = [Term(e, w, v) for e in effects for w in e.places(rig) for v in e.variants(rig, w)]
        places = {t.where for t in truth}
        return sorted((t for t in terms if t.key not in true), key=lambda t: t.where not in places)

    def judged(
        self,
        truth: Sequence[Planted],
        slight: Sequence[Planted] = (),
        nuisances: np.ndarray | None = None,
        least: float = DISTINCT,
    ) -> tuple[Planted, ...]:
        """The true effects with their sizes, ``nuisances`` (N, k) and the others free to move.

        Raises Rejected where one of them is not told from a rival by ``least`` sigmas.
        """
        if not truth:
            return ()
        own = [self.columns(_term(t)) for t in truth]
        off = self.signature(slight) if slight else np.zeros(self.nominal.size)
        free = [] if nuisances is None else [nuisances]
        bases, wholes, right = [], [], []
        for i, thing in enumerate(truth):
            others = [c for k, c in enumerate(own) if k != i and c is not None]
            bases.append(np.column_stack([np.zeros((off.size, 0)), *free, *others]))
            wholes.append(off + self.signature([thing]))
            right.append(left(off, bases[i]))
        best = [left(whole, base) for whole, base in zip(wholes, bases, strict=True)]
        names: list[str | None] = [None] * len(best)
        for term in self.rivals(truth):
            columns = self.columns(term)
            for i in range(len(best) if columns is not None else 0):
                assert columns is not None
                rest = left(wholes[i], np.column_stack([bases[i], columns]))
                if rest < best[i] and isinstance(term.effect, Payload):
                    rest = self.left_by_payload(term, wholes[i], bases[i], columns)
                if rest < best[i]:
                    best[i], names[i] = rest, term.label
                if best[i] ** 2 - right[i] ** 2 < least**2:
                    raise Rejected(f"{truth[i].name} is not told from {term.label}")
        found = []
        for thing, rest, none, rival in zip(truth, best, right, names, strict=True):
            distinct, total = math.sqrt(rest**2 - none**2), float(np.linalg.norm(self.signature([thing])))
            found.append(replace(thing, total=total, linear=distinct, distinct=distinct, rival=rival))
        return tuple(found)

    def left_by_payload(self, term: Term, whole: np.ndarray, base: np.ndarray, columns: np.ndarray) -> float:
        """Sigmas that the best payload with a mass leaves: small ones, ``columns`` (N, 4), span more than any one of
        them can be, such as a centre of mass elsewhere.

        It is looked for from what the small ones say, and from the best of a grid over the body.
        """
        rig, free = self.sizer.rig, _basis(base)
        scale = np.asarray(term.effect.scales(rig, term.where), float)

        def rest(values: np.ndarray) -> np.ndarray:
            return np.asarray(values - free @ (free.T @ values))

        def signature(x: np.ndarray) -> np.ndarray:
            return self.signature(
                [Planted(term.effect.name, term.where, term.effect.values(rig, term.where, x * scale))]
            )

        wanted, starts = rest(whole), []
        linear = np.linalg.lstsq(rest(columns), wanted, rcond=None)[0]
        first = term.effect.start(rig, term.where, linear)
        if first[0] > 0:
            starts.append(first / scale)
        grid = []
        for along in np.linspace(-2.0, 2.0, 9):
            for normal in (-1.0, 0.0, 1.0):
                shape = rest(signature(np.array([1.0, along, normal])))
                mass = max(float(shape @ wanted) / max(float(shape @ shape), 1e-30), 1e-3)
                grid.append((float(np.linalg.norm(wanted - mass * shape)), mass, along, normal))
        starts.append(np.array(min(grid)[1:]))
        low = np.array([0.0, -np.inf, -np.inf])
        fits = [
            least_squares(
                lambda x: rest(whole - signature(x)), start, bounds=(low, np.inf), x_scale=np.abs(start) + 0.1
            )
            for start in starts
        ]
        return min(math.sqrt(2 * fit.cost) for fit in fits)

    def uncertainty(self, thing: Planted, nuisances: np.ndarray, step: float = 1e-3) -> float:
        """One sigma of the effect's parameters over their size, nuisances free; parameters of one unit are one vector,
        angles are in rad.  Infinite where the data do not tell one at all.
        """
        names, units = list(thing.values), {p.name: p.unit for p in VOCABULARY[thing.name].parameters}
        groups = {name: tuple(n for n in names if units[n] == units[name]) for name in names}
        columns = []
        for name in names:
            angle = units[name] == "rad"
            size = 1.0 if angle else math.hypot(*(thing.values[n] for n in groups[name]))
            ends = [
                self.signature([replace(thing, values={**thing.values, name: thing.values[name] + s * step * size})])
                for s in (-1, 1)
            ]
            columns.append((ends[1] - ends[0]) / (2 * step))  # over a change as large as the parameter
        own = np.column_stack(columns)
        if nuisances.size:
            basis = _basis(nuisances)
            own = own - basis @ (basis.T @ own)
        _, sizes, turn = np.linalg.svd(own, full_matrices=False)
        if sizes[-1] < 1e-9 * sizes[0]:
            return math.inf
        sigmas = np.sqrt(np.sum((turn / sizes[:, None]) ** 2, axis=0))
        return max(
            math.hypot(*(sigmas[names.index(n)] for n in group)) for group in {tuple(g) for g in groups.values()}
        )


def _basis(columns: np.ndarray) -> np.ndarray:
    """Orthonormal columns that span these, (N, k)."""
    if not columns.shape[1]:
        return columns
    basis, sizes, _ = np.linalg.svd(columns / np.linalg.norm(columns, axis=0).clip(1e-12), full_matrices=False)
    return np.asarray(basis[:, sizes > 1e-9 * sizes[0]])


def _term(thing: Planted) -> Term:
    return Term(VOCABULARY[thing.name], thing.where)

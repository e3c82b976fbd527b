"""Which sets are probable: a linear problem about a fit, its best sets fitted in full, and again until stable."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import logsumexp

from analytic.mechanism.one_line import count
from compare.diagnose.fit import Fit, Fitter
from compare.diagnose.noise import CLOSED, rms, sample_weights
from compare.diagnose.posterior.compress import Compressed, Group, Name
from compare.diagnose.posterior.nameless import Nameless, nameless
from compare.diagnose.posterior.prior import WIDTH_ODDS, WIDTHS, WORKMANSHIP, WORKMANSHIP_ODDS, Prior
from compare.diagnose.posterior.sets import Set, Sets, with_group, without
from compare.diagnose.predict import Model, Term
from compare.diagnose.propose.scene import Scene
from compare.diagnose.residuals import Data
from compare.diagnose.sensitivities import Sensitivity, sensitivities

ROUNDS = 12  # linear problems
PLAIN = 2  # of them, after which what is left counts as noise though sets still change
FITTED = 3  # of the best sets of each, fitted in full
RIVALS = 12  # of the last one's
DOUBTS = 3  # and of those without each effect of the best
WITHIN = 8.0  # log: sets that are less probable than the best by more are not
EVEN = 1.0  # log: of sets as probable as the best, but for this, the one is told of which most is there
ALIKE = 0.1  # of a weight, that makes no difference
LAYER = 8.0  # log: sizes of errors everywhere that are less probable by more are left aside
NEAR_BEST = 12.0  # log: what is in no set that is within this of the best keeps its first signature
TOLD_FROM = 0.01  # probability of a set: a less probable one moves a 95 % band by less than its own standard deviation
NEXT_TO_NOTHING = 1e-4  # of a sample
STRAYED = 0.3  # of the noise (rms), by which a fit may move before signatures are taken anew
Names = frozenset[Name]
Key = tuple[str, str]  # an effect's name and place
Keys = frozenset[Key]


@dataclass(frozen=True)
class Weighed:
    """A set of effects fitted in full, with the sizes that its values were expected to have, and its log probability up
    to a constant; what its unknown may do (size, k) is part of the noise.
    """

    names: Names
    fit: Fit
    unknown: np.ndarray = field(repr=False)
    sizes: Mapping[Term, np.ndarray] = field(repr=False)
    log: float

    @property
    def keys(self) -> Keys:
        """Its effects at their places, an unknown among them."""
        return frozenset((name, where) for name, where, *_ in self.names)

    @property
    def nameless(self) -> Key | None:
        """Its unknown, if there is one."""
        return next(iter(self.keys - {term.key for term in self.fit.terms}), None)


@dataclass(frozen=True)
class Surveyed:
    """Signatures of all terms and unknowns, over each sample's noise alone, and the fit about which they were taken."""

    about: Fit
    signatures: Mapping[Term, Sensitivity]
    unknown: Sequence[Nameless]


@dataclass(frozen=True)
class Posterior:
    """What the data make of sets of effects.

    ``best`` is the most probable set, fitted in ``fitter``'s data: of these, samples count by their weights, and what
    an unknown of the set and ``errors`` (size, k) everywhere may do is in the noise.  ``judged`` is the same fit where
    samples count alike and an unknown is no noise, in ``judge``'s data; ``plain`` has neither.  ``sets`` are the
    probabilities of sets, ``fitted`` those that were fitted in full; ``evidence`` is the log probability of the data
    with the best one, up to a constant, where samples count alike.
    """

    best: Weighed
    fitter: Fitter
    judged: Fit
    judge: Fitter
    plain: Fitter
    sets: Mapping[Keys, float]
    fitted: Sequence[Weighed]
    evidence: float
    errors: np.ndarray = field(repr=False)
    surveyed: Surveyed = field(repr=False)

    @property
    def keys(self) -> Keys:
        """The most probable set."""
        return self.best.keys

    def shifted(self, difference: np.ndarray) -> Posterior:
        """The same sets in data less a difference (size,) in units of noise: the best one is fitted anew."""

        def moved(fitter: Fitter) -> Fitter:
            return fitter.on(fitter.data.shifted(fitter.data.seen_beside(difference)))

        fitter, judge = moved(self.fitter), moved(self.judge)
        fit = self.best.fit
        fit = fitter.likeliest(self.best.sizes, dict(zip(fit.terms, fit.x, strict=True)), rough=0.0) or fit
        judged = judge.again(fit) or fit
        best = replace(self.best, fit=fit)
        return replace(self, best=best, fitter=fitter, judged=judged, judge=judge, plain=moved(self.plain))

    def probability(self, key: Key) -> float:
        """Of an effect at a place."""
        return probability(self.sets, key)

    def instead(self, key: Key) -> dict[Key, float]:
        """What shares the probability of an effect of the best set: how probable each other is in its place, beyond how
        probable it is beside it.
        """
        return instead(self.sets, self.keys, key)


def seen(data: Data, signature: Sensitivity) -> Sensitivity:
    """A signature as these data have it."""
    return Sensitivity(signature.term, data.columns(signature.offset), data.columns(signature.columns))


def probability(sets: Mapping[Keys, float], key: Key) -> float:
    """Of an effect at a place, summed over the sets that have it."""
    return min(sum(share for keys, share in sets.items() if key in keys), 1.0)


def instead(sets: Mapping[Keys, float], best: Keys, key: Key) -> dict[Key, float]:
    """Of each effect outside the best set how probable it is in the place of one of it, the most probable first."""
    there, lost = 0.0, 0.0
    beside, place = dict[Key, float](), dict[Key, float]()
    for keys, share in sets.items():
        there, lost = (there + share, lost) if key in keys else (there, lost + share)
        for other in keys - best:
            side = beside if key in keys else place
            side[other] = side.get(other, 0.0) + share
    odds = lost / there if there else 0.0
    found = {other: share - odds * beside.get(other, 0.0) for other, share in place.items()}
    return dict(sorted(found.items(), key=lambda item: -item[1]))


class Inference:
    """The way to the posterior of some data."""

    def __init__(
        self,
        fitter: Fitter,
        base: Fit,
        sought: Sequence[Term],
        late: Callable[[], bool] = lambda: False,
        before: Inference | None = None,
        tell: Callable[[str], None] = lambda said: None,
    ) -> None:
        self.plain, self.fitter, self.base, self.sought = fitter, fitter, base, sought
        self.late, self.tell = late, tell
        self.prior = Prior.of(fitter.rig, fitter.bounds, sought, fitter.data.measured.prior)
        # signatures over each sample's noise alone, which stay true in other colours
        self.bare = fitter.on(fitter.data.plain())
        self.weighed: dict[Names, Weighed] = {}
        # where fits of sets ended, in whatever noise
        self.ended: dict[Names, Mapping[Term, np.ndarray]] = {} if before is None else before.ended
        self.surveyed: Surveyed | None = None
        if before is not None and before.surveyed is not None:
            there = fitter.again(before.surveyed.about)
            self.surveyed = None if there is None else replace(before.surveyed, about=there)
        self.workmanship = 0.0
        self.foretold: np.ndarray | None = None  # of samples, as how much those count that nothing foretells
        self.counted = [np.ones(fitter.data.size)]  # how much samples did, now at last

    @property
    def weights(self) -> np.ndarray:
        """How much samples count (size,)."""
        return self.counted[-1]

    @property
    def best(self) -> Weighed:
        """The best of the sets that were fitted in full, so far."""
        return max(self.weighed.values(), key=lambda w: w.log)

    @property
    def judge(self) -> Fitter:
        """Fits where samples count alike and an unknown is no noise."""
        return self.plain.on(self._noise(self.compressed, self.workmanship))

    @property
    def judged(self) -> Fit:
        """The best fit so far, as the judge has it."""
        return self.judge.again(self.best.fit) or self.best.fit

    @property
    def left(self) -> np.ndarray:
        """What all effects together leave (size,) of the nominal model's residual, as far as straight lines tell; not
        those that turn at some harmonic.
        """
        return self.survey(self.base).left(steady=True)

    def search(self, first: Sequence[Fit] = (), far: bool = True) -> Inference:
        """Look for the best set, about which other data may be begun or the posterior concluded; ``first`` are fits
        that may be near it.  Not ``far``, it ends where the steps from set to set that are nearest lead no further.
        """
        self.compressed, self.layers = self._found(first, far)
        return self

    def _found(self, first: Sequence[Fit], far: bool) -> tuple[Compressed, dict[float, Sets]]:
        """The linear problem about the best set, and the sets that were looked at, by size of errors everywhere."""
        again = [fit for begun in first if (fit := self.plain.again(begun)) is not None]
        fit = min([self.base, *again], key=lambda fit: fit.chi2)
        fit, names = self._leapt(fit, self._names(fit))
        likely: set[Name] = set()
        thorough = False
        for k in range(ROUNDS):
            compressed = self.survey(fit, likely)
            self._take_for_noise(compressed)
            layers = self._explored(compressed, names, thorough)
            sets = layers[self.workmanship]
            likely = {compressed.groups[i].name for s in sets.known for i in s if sets.known[s] > sets.top - NEAR_BEST}
            candidates = self._candidates(sets, compressed, names)
            new = [c for c in candidates if self._named(compressed, c) not in self.weighed]
            for chosen in new:
                self._weigh(compressed, sets, chosen, fit)
            if self.late() or k == ROUNDS - 1:
                break
            best = self.best
            stable = best.names == names and not new
            fit, names = self._in_plain(best), best.names
            if self._spares(compressed, fit):
                continue
            settled = stable or (k >= PLAIN and not thorough)
            if settled and not far:
                break
            if settled:
                # what the best set leaves counts as noise, as large and as slow as it is, and sets are looked at again
                left = self._noise(compressed, self.workmanship, unknown=best.unknown).seen_beside(fit.residual)
                if not self._counted(compressed, self._weights(left)) and thorough:
                    self._doubt(compressed, sets, fit)
                    better = self.best
                    if better.names == names:
                        break
                    fit, names = self._in_plain(better), better.names
                thorough = True
        return compressed, layers

    def _leapt(self, fit: Fit, names: Names) -> tuple[Fit, Names]:
        """The fit, or that of an effect under which samples leap, alone, if it explains more than any other alone
        would: no linear problem about a rig without it tells what it does.
        """
        leaping = any(t.effect.leaps for t in self.sought)
        if names or not leaping or rms(self.base.residual) <= CLOSED:
            return fit, names
        compressed = self.survey(fit)
        sets = Sets(compressed.groups, compressed.products(self.weights)(0.0), self.late)
        sets.named_only = True
        least = sets.additions(())[0].max(initial=-math.inf)
        for i, group in enumerate(compressed.groups):
            if group.term is not None and group.term.effect.leaps:
                sets.score((i,))
                self._weigh(compressed, sets, (i,), fit)
        best = max(self.weighed.values(), key=lambda w: w.log, default=None)
        if best is None or best.log <= least:
            return fit, names
        fit, names = self._in_plain(best), best.names
        self._spares(compressed, fit)
        return fit, names

    # ---------------------------------------------------------------- signatures

    def survey(self, fit: Fit, likely: Collection[Name] = ()) -> Compressed:
        """The linear problem about a fit, with signatures that are taken anew if the last ones were taken far from it:
        once of all terms, then of ``likely`` ones.
        """
        if self.surveyed is None or rms(fit.residual - self.surveyed.about.residual) >= STRAYED:
            free = len(fit.named()) < len(fit.terms)
            about = [t for t in self.sought if t not in fit.terms]
            about = [t for t in about if not (t.effect.scatters and rms(self.base.residual) <= CLOSED)]
            kept: Mapping[Term, Sensitivity] = {}
            if self.surveyed is not None and not free:
                kept = self.surveyed.signatures
                families = {self.prior.family(fit.terms[i]) for i in fit.named()}
                about = [t for t in about if (*t.key, t.variant) in {name[:3] for name in likely}]
                about = [t for t in about if self.prior.family(t) not in families]
            new = self._signatures(fit, about)
            self.surveyed = Surveyed(fit, {**kept, **new}, self._nameless(fit))
        data = self.plain.data
        known = {t: seen(data, s) for t, s in self.surveyed.signatures.items() if t not in fit.terms}
        unknown = [replace(u, columns=data.columns(u.columns)) for u in self.surveyed.unknown]
        return Compressed(self.plain, fit, self.prior, known, unknown)

    def _nameless(self, fit: Fit) -> list[Nameless]:
        """Unknowns beside what a fit names; none where the nominal model leaves no gap, or where no crank is driven."""
        model, runs = self.plain.model, self.plain.data.measured.runs
        driven = self.plain.rig.mechanism.cranked and all(run.drive != "free" for run in runs)
        if not driven or rms(self.base.residual) <= CLOSED or not isinstance(model, Model):
            return []
        scene = Scene.of(model, self.bare, fit)
        return [] if scene is None else list(nameless(scene))

    def _signatures(self, fit: Fit, terms: Sequence[Term]) -> dict[Term, Sensitivity]:
        """Signatures of terms about a fit; of other variants and forms of what it has, about the fit without that."""
        of = {self.prior.family(fit.terms[i]): fit.terms[i] for i in fit.named()}
        found: dict[Term, Sensitivity] = {}
        for own in dict.fromkeys([None, *of.values()]):
            each = [t for t in terms if of.get(self.prior.family(t)) is own]
            x = {t: v for t, v in zip(fit.terms, fit.x, strict=True) if t is not own}
            bare = self.bare.at(list(x), x) if each else None
            found |= {} if bare is None else sensitivities(self.bare, bare, each)
        return found

    # ---------------------------------------------------------------- sets

    def _explored(self, compressed: Compressed, names: Names, thorough: bool) -> dict[float, Sets]:
        """Sets looked at for each size of errors everywhere, from the best of the last."""
        start = tuple(i for i, g in enumerate(compressed.groups) if g.name in names)
        # small errors move a free rig far, and are named: in noise they would stand for all that it is found to lack
        every = [0.0] if self.base.terms or not compressed.slight.shape[1] else WORKMANSHIP.tolist()
        layers, size = self._climbed(compressed, every, start)
        if size != self.workmanship:
            self.workmanship = size
            self._renew(compressed)
        if thorough:
            least = layers[size].top + self._odds[size] - LAYER
            layers = {each: sets for each, sets in layers.items() if sets.top + self._odds[each] > least}
            for sets in layers.values():
                sets.climb(sets.best()[0], thorough=True)
        else:
            self._climb_named(layers[size])
        return layers

    def _climb_named(self, sets: Sets) -> None:
        """Where an unknown is in the best set, look at sets without too: an effect that leaps or is far from linear may
        explain in full what a linear problem gives to an unknown.
        """
        if sets.named(sets.best()[0]):
            return
        sets.named_only = True
        sets.climb(max((s for s in sets.best(named=True)), key=sets.score, default=()), thorough=False)
        sets.named_only = False

    def _climbed(self, compressed: Compressed, every: Sequence[float], start: Set) -> tuple[dict[float, Sets], float]:
        """Sets looked at for each of these sizes of errors everywhere, and the size with the most probable one."""
        products = compressed.products(self.weights)
        layers: dict[float, Sets] = {}
        for size in every:
            layers[size] = sets = Sets(compressed.groups, products(size), self.late)
            start = sets.climb(start, thorough=False)
        return layers, max(layers, key=lambda each: layers[each].top + self._odds[each])

    _odds: Mapping[float, float] = dict(zip(WORKMANSHIP.tolist(), WORKMANSHIP_ODDS.tolist(), strict=True))

    def _counted(self, compressed: Compressed, weights: np.ndarray) -> bool:
        """Let samples count so much from now on; whether they never counted so before."""
        weights = weights if self.foretold is None else weights * self.foretold
        if any(np.abs(weights / before - 1).max() < ALIKE for before in self.counted):
            return False
        self.counted.append(weights)
        self._renew(compressed)
        return True

    def _take_for_noise(self, compressed: Compressed) -> None:
        """Where runs are free, what all effects together leave is noise from now on: a motion that lacks one of them
        goes another way altogether, and what it leaves is no noise.
        """
        if self.base.terms:
            self._counted(compressed, sample_weights(self.plain.data, compressed.left()))

    def _weights(self, left: np.ndarray) -> np.ndarray:
        """How much samples (size,) count where the best set leaves this: it is noise, but where runs are free."""
        return self.weights if self.base.terms else sample_weights(self.plain.data, left)

    def _spares(self, compressed: Compressed, fit: Fit) -> bool:
        """Let samples in which a crank lands, by a fit, count for nothing from now on: how hard it lands nobody
        foretells, and what it leaves there is no sign of anything else.
        """
        if self.foretold is not None or not any(t.effect.leaps for t in fit.terms):
            return False
        readings = self.plain.model([fit.values(self.plain.rig)])[0]
        self.foretold = np.ones(self.plain.data.size)
        if readings is not None:
            self.foretold[self.plain.data.lands(readings)] = NEXT_TO_NOTHING
        return self._counted(compressed, np.ones(self.plain.data.size))

    def _renew(self, compressed: Compressed) -> None:
        """Sets are to be fitted in full anew, with the noise as it is now."""
        self.fitter, self.weighed = self.plain.on(self._noise(compressed, self.workmanship, self.weights)), {}

    def _noise(
        self,
        compressed: Compressed,
        workmanship: float,
        weights: np.ndarray | None = None,
        unknown: np.ndarray | None = None,
    ) -> Data:
        """The data, with errors everywhere of this size and what an unknown may do (size, k) in their noise, and
        samples that count so much.
        """
        data = self.plain.data if weights is None else self.plain.data.weighed(weights)
        errors = [compressed.slight * workmanship] if workmanship else []
        errors += [unknown] if unknown is not None and unknown.size else []
        return data.beside(data.seen_beside(np.column_stack(errors))) if errors else data

    def _candidates(self, sets: Sets, compressed: Compressed, names: Names) -> list[Set]:
        """The best sets, which are to be fitted in full, beside the empty one and, of the best, those with a richer
        or a simpler form of an effect, of which a linear problem about another says little; of a free motion, of which
        it says little altogether, the one that it is about too.
        """
        sets.score(())
        best = sets.best(FITTED)
        about = tuple(i for i, group in enumerate(compressed.groups) if group.name in names)
        chosen = [
            *([about] if self.base.terms else []),
            *(s for s in best if sets.known[s] > sets.known[best[0]] - WITHIN),
            (),
        ]
        chosen += [] if sets.named(best[0]) else sets.best(FITTED, named=True)
        for i in best[0]:
            own = compressed.groups[i]
            forms = [k for k, g in enumerate(compressed.groups) if self._enriches(g, own) or self._enriches(own, g)]
            chosen += [with_group(without(best[0], i), k) for k in forms]
        return list(dict.fromkeys(chosen))

    def _doubt(self, compressed: Compressed, sets: Sets, fit: Fit, most: int = 1) -> None:
        """Fit in full, of the best set, the best sets without each of its effects, so many: no linear problem about a
        fit with it decides alone.
        """
        for i in sets.best()[0]:
            key = compressed.groups[i].key
            without_it = [chosen for chosen in sets.widths if key not in {compressed.groups[k].key for k in chosen}]
            for chosen in sorted(without_it, key=lambda each: -sets.known[each])[:most]:
                if self._named(compressed, chosen) not in self.weighed and not self.late():
                    self._weigh(compressed, sets, chosen, fit)

    def _enriches(self, rich: Group, simple: Group) -> bool:
        poor = None if rich.term is None else self.prior.simple_of.get(rich.term)
        return poor is not None and poor == simple.term

    @staticmethod
    def _named(compressed: Compressed, chosen: Set) -> Names:
        return frozenset(compressed.groups[i].name for i in chosen)

    def _names(self, fit: Fit) -> Names:
        return frozenset((*fit.terms[i].key, fit.terms[i].variant, ()) for i in fit.named())

    # ---------------------------------------------------------------- fits

    def _weigh(self, compressed: Compressed, sets: Sets, chosen: Set, about: Fit) -> None:
        """Fit a set in full, from where the linear problem has it, and keep it with its probability by Laplace."""
        self.tell(f"{count(len(self.weighed), 'set')} of effects fitted, now {count(len(chosen), 'effect')} together")
        groups = [compressed.groups[i] for i in chosen]
        coefficients, widths = sets.coefficients(chosen), sets.widths[chosen]
        now = dict(zip(about.terms, about.x, strict=True))
        always = {t: now[t] for t in self.base.terms}
        starts, sizes = dict(always), {t: np.full(len(x), np.inf) for t, x in always.items()}
        unknown = np.zeros((self.plain.data.size, 0))
        for i, group in zip(chosen, groups, strict=True):
            width = float(WIDTHS[widths[i]])
            if group.term is None:
                unknown = compressed.columns(group) * width
                continue
            starts[group.term] = compressed.coordinates(group, coefficients[i])
            sizes[group.term] = self._size(group.term, group.along, width)
        tried: list[Mapping[Term, np.ndarray]] = [starts]
        tried += [starts | {t: now.get(t, np.zeros(len(x))) for t, x in starts.items()}]
        other = {t: x for t in starts if (x := t.effect.other_start(self.plain.rig, t.where, starts[t])) is not None}
        tried += [starts | other] if other else []
        tried += [starts | dict(zip(self.base.terms, self.base.x, strict=True))] if always else []
        fitter = self._fitter(compressed, unknown) if unknown.size else self.fitter
        names = self._named(compressed, chosen)
        tried += [self.ended[names]] if names in self.ended else []
        nearest = fitter.nearest(tried)
        fits = [fitter.likeliest(sizes, tried[nearest])]
        if always and nearest and names not in self.ended:
            fits += [fitter.likeliest(sizes, starts, beside=fits[0])]
        fit = max((fit for fit in fits if fit is not None), key=lambda fit: self._evidence(fit, sizes), default=None)
        if fit is None:
            return
        self.ended[names] = dict(zip(fit.terms, fit.x, strict=True))
        log = sum(g.log_odds for g in groups) + sum(WIDTH_ODDS[widths[i]] for i in chosen)
        log += 0.0 if chosen else Prior.nothing(np.array([g.log_odds for g in compressed.groups]))
        log += self._evidence(fit, sizes) - (fitter.data.log_volume - self.fitter.data.log_volume) / 2
        impossible = fit.impossible(self.plain.rig)
        self.weighed[names] = Weighed(names, fit, unknown, sizes, -math.inf if impossible else log)
        if impossible:  # the others may explain nearly as much
            others = tuple(i for i, group in zip(chosen, groups, strict=True) if group.term not in impossible)
            if self._named(compressed, others) not in self.weighed:
                sets.score(others)
                self._weigh(compressed, sets, others, about)

    def _fitter(self, compressed: Compressed, unknown: np.ndarray) -> Fitter:
        """Fits beside what an unknown may do (size, k)."""
        return self.plain.on(self._noise(compressed, self.workmanship, self.weights, unknown))

    def _size(self, term: Term, along: tuple[int, ...], width: float) -> np.ndarray:
        """Size (n,) of each natural coordinate of a term at a width; how or where it is does not go with it.  Those
        that it does not have are next to nothing.
        """
        size, kept = self.prior.size(term), term.effect.sized
        size[:kept] *= width
        return size if not along else np.where(np.isin(np.arange(size.size), along), size, NEXT_TO_NOTHING * size)

    def _evidence(self, fit: Fit, sizes: Mapping[Term, np.ndarray]) -> float:
        """Log evidence of a fit by Laplace: what it leaves, how far its values are from nothing, and how much of what
        they might have been is ruled out.
        """
        log, parts = -fit.chi2 / 2, [np.zeros((self.plain.data.size, 0))]
        for i in fit.named():
            size = sizes[fit.terms[i]]
            log -= float(np.sum((fit.x[i] / size) ** 2)) / 2
            parts.append(fit.jacobian[:, fit.columns(i)] * size)
        scaled = np.column_stack(parts)
        return log - float(np.linalg.slogdet(np.eye(scaled.shape[1]) + scaled.T @ scaled)[1]) / 2

    def _in_plain(self, best: Weighed) -> Fit:
        """A fit with errors everywhere and an unknown left out of the noise."""
        fit = best.fit
        if self.fitter is self.plain and not best.unknown.size:
            return fit
        return self.plain.again(fit) or fit

    # ---------------------------------------------------------------- conclusion

    def posterior(self) -> Posterior:
        """What the data make of all sets, when they were looked for: what may share the probability of the best one is
        fitted in full.
        """
        compressed, layers, best = self.compressed, self.layers, self.best
        for each in layers.values():
            each.survey(each.best()[0])
        self._weigh_rivals(compressed, layers[self.workmanship], self._in_plain(best), best)
        logs = self._logs(compressed, layers)
        while not self.late() and self._weigh_likely(compressed, layers[self.workmanship], logs):
            logs = self._logs(compressed, layers)
        best = self.best
        sets = probabilities(logs)

        def right(weighed: Weighed) -> float:
            """How many more of its effects are there than not, as far as one can expect."""
            return sum(share * (2 * len(keys & weighed.keys) - len(weighed.keys)) for keys, share in sets.items())

        best = max((w for w in self.weighed.values() if w.log > best.log - EVEN), key=right)
        judge = self.judge
        start = judge.nearby(best.fit)
        if self.foretold is not None:  # a landing moves with the gap, and then tells how large that is
            self.counted.append(self.counted[-1] / self.foretold)
            self.foretold = None
        fitter = self._fitter(compressed, best.unknown)
        best = replace(best, fit=fitter.likeliest(best.sizes, start, rough=0.0) or best.fit)
        x = dict(zip(best.fit.terms, best.fit.x, strict=True))
        judged = judge.at(best.fit.terms, x) or best.fit
        errors = compressed.slight * self.workmanship
        fitted = [self._exact(compressed, w) if sets[w.keys] >= TOLD_FROM else w for w in self.weighed.values()]
        odds = [group.log_odds for group in compressed.groups if group.name in best.names]
        evidence = sum(odds) + self._evidence(judged, best.sizes) - judge.data.log_volume / 2
        assert self.surveyed is not None
        return Posterior(best, fitter, judged, judge, self.plain, sets, fitted, evidence, errors, self.surveyed)

    def _exact(self, compressed: Compressed, weighed: Weighed) -> Weighed:
        """A set whose values are said, not only compared."""
        start = dict(zip(weighed.fit.terms, weighed.fit.x, strict=True))
        fit = self._fitter(compressed, weighed.unknown).likeliest(weighed.sizes, start, rough=0.0)
        return replace(weighed, fit=fit or weighed.fit)

    def _weigh_rivals(self, compressed: Compressed, sets: Sets, about: Fit, best: Weighed) -> None:
        """Fit in full what would share the best set's probability, as far as the linear problem says."""
        own = [log for chosen, log in sets.known.items() if self._named(compressed, chosen) == best.names]
        least = max(own, default=sets.top) - WITHIN
        for chosen in [each for each in sets.best(RIVALS) if sets.known[each] > least]:
            if self._named(compressed, chosen) not in self.weighed and not self.late():
                self._weigh(compressed, sets, chosen, about)
        self._doubt(compressed, sets, about, DOUBTS)

    def _weigh_likely(self, compressed: Compressed, sets: Sets, logs: Mapping[Names, float]) -> bool:
        """Fit the likeliest set in full, if it was not; whether that is done."""
        likely = max(logs, key=lambda names: logs[names])
        chosen = {self._named(compressed, each): each for each in sets.known}
        if likely in self.weighed or likely not in chosen:
            return False
        self._weigh(compressed, sets, chosen[likely], self._in_plain(self.best))
        return likely in self.weighed

    def _logs(self, compressed: Compressed, layers: Mapping[float, Sets]) -> dict[Names, float]:
        """Log probability, up to a constant, of every set that was looked at, for all sizes of errors everywhere: of
        those that were fitted in full as they then stand against the best, whatever that size; of others by the linear
        problem, corrected as the largest set in them that was fitted in full.
        """
        best = self.best
        logs: dict[Names, list[float]] = {}
        for size, sets in layers.items():
            for chosen, log in sets.known.items():
                logs.setdefault(self._named(compressed, chosen), []).append(log + self._odds[size])
        linear = {names: float(logsumexp(each)) for names, each in logs.items()}
        top = linear.get(best.names, 0.0)
        full = {names: top + w.log - best.log for names, w in self.weighed.items()}
        known = {names: log - linear[names] for names, log in full.items() if names in linear}
        parts = sorted(known, key=lambda names: (-len(names), known[names]))
        for names in linear:
            linear[names] += next((known[part] for part in parts if part and part <= names), 0.0)
        return linear | full


def probabilities(logs: Mapping[Names, float]) -> dict[Keys, float]:
    """Of sets of effects, in whatever variants, from log probabilities up to a constant."""
    total: dict[Keys, list[float]] = {}
    for names, log in logs.items():
        total.setdefault(frozenset((name, where) for name, where, *_ in names), []).append(log)
    norm = float(logsumexp(list(logs.values())))
    return {keys: math.exp(float(logsumexp(each)) - norm) for keys, each in total.items()}

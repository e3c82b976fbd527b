"""Open the seal: what a diagnosis said, held against the truth.

``exact``        the same effects at the same places, no more and no less
``tie``          every true effect is named or in an ``ambiguous_with``; what else is named has a true one in its own.
                 A true effect that these data do not tell from a simpler special case of it (a payload from a moment of
                 inertia) counts as named if that one is: a richer effect is only named where its further parameters
                 earn their place
``incomplete``   what is named is true or ties with it, but a true effect is left out
``missed``       no gap was seen, though there was something
``wrong``        something is named that is neither true nor tied with it
``abstained``    nothing is named, and a gap reported (also the right answer to what is outside the vocabulary)
``partly``       outside the vocabulary: something is named, and that it does not explain the data is said (where it is
                 said that it does, or may, the set is ``wrong``)
``clear``, ``false alarm``   effect-free: nothing is named; something is (with several drives a gap that is reported is
                 not clear either: ``abstained``); of a still rig, that clearance is not named, or is
``failed``       there was no diagnosis

In sets of the bench what is slightly off and the faults of sensors that are truly there are never wrong when named, and
never asked for;
``exact`` and ``tie`` are about the effects to be named.  An empty set is ``clear`` where no effect of
the rig is named that is not in it; of a coarse one "no gap" is asked, or what is truly there of its logger.

Of what has no name the *place* is scored too: it is right where the true unknown at its place is proposed, or is among
the places that do as well.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from analytic.mechanism.signals import wrapped
from compare.diagnose.effects.bodies import LinkLength, PivotPosition
from compare.diagnose.effects.joints import JointClearance
from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.results.diagnosis import Diagnosis, SamePlace
from tests.evidence.results.scoreboard import Claim, Gap, Hidden, Kind, Outcome, Said, Scored, Truth, Value

Key = tuple[str, str]
DISTINCT = 8.0  # sigmas left after the best rival, from which on an effect can be told from all others
GOOD: dict[Kind, tuple[Outcome, ...]] = {
    "effects": ("exact", "tie"),
    "none": ("clear",),
    "outside": ("abstained", "partly"),
    "alias": ("exact", "tie"),
    "machines": ("exact", "tie"),
    "unnamed": ("abstained", "partly"),
    "several": ("exact", "tie", "clear"),
    "rattling": ("exact", "tie"),
    "still": ("clear",),
}
NAMED: tuple[Kind, ...] = ("effects", "machines")  # sets of the vocabulary's effects
NAMELESS: tuple[Kind, ...] = ("outside", "unnamed")  # sets of what it has no word for
BENCH: tuple[Kind, ...] = ("slightly-off", "coarse", "coloured", "per-run", "large")
RATTLING: tuple[Kind, ...] = ("rattling", "still")
LATER = ("sensor_lag", "sensor_drift")  # of sensors, whether the vocabulary has them or not
WITHIN = 0.05  # of its size: an effect of the rig beside faults of each run
CLOSED = 1.1  # of the noise floor
CLAIMED = 0.05  # probability from which on an effect's is kept
SAME = 3.0  # times the largest slight displacement of a pivot: another pivot's that may be the same


def opened(seal: Path) -> Truth:
    """The truth of a set.  Raises DocumentError."""
    return Truth.read(seal / Truth.file)


def score(diagnosis: Diagnosis, truth: Truth) -> Scored:
    """How a diagnosis did on a set: its outcome, its parameters, and its gap."""
    found = {(e.name, e.where): {(t.name, t.where) for t in e.ambiguous_with} for e in diagnosis.effects}
    true = {(e.name, e.where) for e in truth.effects}
    gap = diagnosis.gap
    if truth.kind in BENCH:
        outcome, more = _on_bench(truth, diagnosis, found, true)
    else:
        outcome, more = judged(truth, diagnosis, found, true), {"false_rig": _false_in_rig(truth, found)}
    scored = _of(truth, outcome, diagnosis.verdict).model_copy(
        update={
            **more,
            "named": tuple(
                Said(
                    effect="@".join(key),
                    ambiguous_with=tuple(sorted("@".join(t) for t in ties)),
                )
                for key, ties in found.items()
            ),
            "claims": claims(diagnosis, truth),
            "parameters": parameters(diagnosis, truth) if outcome == "exact" else (),
            "gap": Gap(before=gap.before, after=gap.after, noise_floor=gap.noise_floor),
            "proposed": tuple(f"{p.unknown}@{p.place}" for p in proposals(diagnosis)),
            "right_place": right_place(diagnosis, truth),
        }
    )
    return scored.model_copy(update={"good": good_on_bench(scored)}) if truth.kind in BENCH else scored


def claims(diagnosis: Diagnosis, truth: Truth) -> tuple[Claim, ...]:
    """How probable each effect is held to be, as it is named or in the sets of effects that are listed, and whether it
    is there: a simpler special case of one that these data do not tell from it is.
    """
    if truth.kind in (*NAMELESS, *RATTLING):
        return ()
    true = {(e.name, e.where) for e in truth.effects}
    shares: dict[Key, float] = {}
    for each in diagnosis.sets:
        for name, _, where in (label.partition("@") for label in each.effects):
            shares[name, where] = shares.get((name, where), 0.0) + each.probability
    shares |= {(e.name, e.where): e.probability for e in diagnosis.effects if e.probability is not None}
    blurred = [(e.name, e.where) for e in truth.effects if e.distinct < DISTINCT]
    right = true | {(f.name, f.where) for f in (*truth.slight, *truth.faults)}
    right |= {other for key in blurred for other in shares if is_special_case(other, key)}
    return tuple(
        Claim(effect="@".join(key), probability=min(share, 1.0), right=_among(right, key))
        for key, share in sorted(shares.items())
        if share >= CLAIMED and key[0] in VOCABULARY
    )


def _false_in_rig(truth: Truth, found: Mapping[Key, set[Key]]) -> tuple[str, ...]:
    """What is named of a still rig and no fault of a sensor."""
    return tuple("@".join(key) for key in found if truth.kind == "still" and not of_sensor(key[0]))


def proposals(diagnosis: Diagnosis) -> tuple[SamePlace, ...]:
    """What is proposed, each with the places that do as well."""
    return tuple(place for p in diagnosis.proposed for place in (p, *p.ties))


def right_place(diagnosis: Diagnosis, truth: Truth) -> bool | None:
    """Whether what has no name is proposed where it is; None where there is no such thing."""
    hidden = truth.outside
    if hidden is None:
        return None
    return any(p.unknown == hidden.unknown and p.place in hidden.places for p in proposals(diagnosis))


def _of(truth: Truth, outcome: Outcome, verdict: str) -> Scored:
    """The score of a set in which nothing is named."""
    hidden = truth.effects
    return Scored(
        seed=truth.seed,
        kind=truth.kind,
        case=truth.case,
        source=truth.source.name,
        simulator=truth.simulator,
        truth=tuple(
            Hidden(effect=e.key, total=e.total, linear=e.linear, distinct=e.distinct, rival=e.rival) for e in hidden
        ),
        outside=truth.outside.kind if truth.outside is not None else None,
        distinguishable=bool(hidden) and all(e.distinct >= DISTINCT for e in hidden),
        outcome=outcome,
        good=outcome in GOOD.get(truth.kind, ()),
        verdict=verdict,
        named=(),
        parameters=(),
        gap=Gap(before=None, after=None, noise_floor=None),
        right_place=None if truth.outside is None else False,
        sensors=len(truth.noise),
        free=truth.free,
    )


def judged(truth: Truth, diagnosis: Diagnosis, found: Mapping[Key, set[Key]], true: set[Key]) -> Outcome:
    """The outcome."""
    kind, verdict = truth.kind, diagnosis.verdict
    if kind == "still":
        return "false alarm" if any(name == JointClearance.name for name, _ in found) else "clear"
    if not true and truth.outside is None:
        quiet = kind == "none" or verdict == "no gap"
        return "false alarm" if found else "clear" if quiet else "abstained"
    if not found:
        return "missed" if verdict == "no gap" else "abstained"
    if kind in NAMELESS:
        return "partly" if verdict == "partly explained" else "wrong"
    if kind == "alias":
        return _alias(truth, diagnosis, found, true)
    return "exact" if set(found) == true else _nearly(truth, found, true)


def _nearly(truth: Truth, found: Mapping[Key, set[Key]], true: set[Key]) -> Outcome:
    """The outcome where other effects are named than the true ones, or fewer."""
    said, simpler = _simpler(truth, found, true)
    right = true.union(*simpler.values())
    if any(key not in right and not ties & right for key, ties in found.items()):
        return "wrong"
    return "tie" if all(key in said or simpler.get(key) for key in true) else "incomplete"


def _simpler(truth: Truth, found: Mapping[Key, set[Key]], true: set[Key]) -> tuple[set[Key], dict[Key, set[Key]]]:
    """All that is said, and of it the special cases of each true effect that is not told from them."""
    distinct = {(e.name, e.where): e.distinct for e in truth.effects}
    said = set(found) | set().union(*found.values())
    blurred = (key for key in true if distinct[key] < DISTINCT)
    return said, {key: {other for other in said if is_special_case(other, key)} for key in blurred}


def is_special_case(simple: Key, rich: Key) -> bool:
    """Whether an effect is the simpler form of another: at the same place, where both have one kind of place; a length
    of any pivot's.
    """
    one, other = VOCABULARY.get(simple[0]), VOCABULARY.get(rich[0])
    if one is None or other is None or other.name not in one.special_case_of:
        return False
    return simple[1] == rich[1] or one.place != other.place


def _alias(truth: Truth, diagnosis: Diagnosis, found: Mapping[Key, set[Key]], true: set[Key]) -> Outcome:
    """Clearance or length of the follower: both while the load never reverses, with the advice to reverse it or to take
    it off; else clearance only.
    """
    reached = set(found) | set().union(*found.values())
    length = (LinkLength.name, "follower") in reached
    if not true <= reached:
        return "wrong"
    if truth.reversed_load:
        return "wrong" if length else "exact" if set(found) == true else "tie"
    advised = any(way in e.would_separate for e in diagnosis.effects for way in ("reverse the load", "load off"))
    return "tie" if diagnosis.verdict == "ambiguous" and length and advised else "incomplete"


# ---------------------------------------------------------------- sets of the bench


def of_sensor(name: str) -> bool:
    """Whether an effect is a fault of a sensor and not of the rig."""
    effect = VOCABULARY.get(name)
    return name in LATER if effect is None else effect.sensor


def _on_bench(
    truth: Truth,
    diagnosis: Diagnosis,
    found: Mapping[Key, set[Key]],
    true: set[Key],
) -> tuple[Outcome, dict[str, object]]:
    """The outcome, and what else is scored."""
    said, simpler = _simpler(truth, found, true)
    right = true.union(*simpler.values(), {(f.name, f.where) for f in (*truth.slight, *truth.faults)})
    right |= _off_against_others(truth, diagnosis)
    false = [key for key, ties in found.items() if not any(_among(right, k) for k in (key, *ties))]
    rig = tuple("@".join(key) for key in false if not of_sensor(key[0]))
    everything = all(key in said or simpler.get(key) for key in true)
    more: dict[str, object] = {"named_all": everything, "false_rig": rig}
    more["worst_error"] = _worst_error(diagnosis, truth)
    if not true:
        more["named_all"] = not false
        return "false alarm" if rig else "clear", more
    if not found:
        return "missed" if diagnosis.verdict == "no gap" else "abstained", more
    if false:
        return "wrong", more
    return ("exact" if true <= set(found) else "tie") if everything else "incomplete", more


def _among(right: set[Key], key: Key) -> bool:
    """Whether an effect is one of these; one of several signals (``drive_torque+reaction_A_x``) where it is at each."""
    name, where = key
    return key in right or all((name, part) in right for part in where.split("+"))


def _off_against_others(truth: Truth, diagnosis: Diagnosis) -> set[Key]:
    """Ground pivots that are said to be displaced where others are slightly displaced, and by about as much: a pivot is
    off against the others as they are against it.
    """
    pivot = PivotPosition.name
    slight = [math.hypot(*f.parameters.values()) for f in truth.slight if f.name == pivot]
    return {
        (e.name, e.where)
        for e in diagnosis.effects
        if e.name == pivot and math.hypot(*(p.value for p in e.parameters.values())) <= SAME * max(slight, default=0.0)
    }


def _worst_error(diagnosis: Diagnosis, truth: Truth) -> float | None:
    """The largest relative error of the true effects' parameters; None where one of them is not named, or there is
    none.

    Parameters of one unit are one vector.  Angles are compared within a turn, their error in rad.
    """
    answers = {(e.name, e.where): e.parameters for e in diagnosis.effects}
    worst = []
    for effect in truth.effects:
        said, known = answers.get((effect.name, effect.where)), effect.parameters
        if said is None or not set(known) <= set(said):
            return None
        unit = {p.name: p.unit for p in VOCABULARY[effect.name].parameters}
        for one in {unit[name.split("@")[0]] for name in known}:
            names = [name for name in known if unit[name.split("@")[0]] == one]
            off = np.array([said[name].value - known[name] for name in names])
            angle = one == "rad" and all(said[name].unit == "rad" for name in names)
            size = 1.0 if angle else math.hypot(*(known[name] for name in names))
            if angle:
                off = wrapped(off)
            worst.append(float(np.linalg.norm(off)) / size if size else math.inf)
    return max(worst, default=None)


def good_on_bench(r: Scored) -> bool:
    """Whether a set of the bench was diagnosed as is asked of its family."""
    if r.kind == "coloured":
        return (not r.truth or r.named_all) and not r.false_rig and r.outcome != "failed"
    if r.outcome not in ("exact", "tie", "clear"):
        return False
    if r.kind == "coarse":
        return bool(r.truth) or r.verdict == "no gap" or (r.verdict == "explained" and bool(r.named_all))
    if r.kind == "per-run" and r.truth:
        return r.worst_error is not None and r.worst_error <= WITHIN and closed(r)
    return closed(r) if r.kind in ("per-run", "large") and r.truth else True


def closed(r: Scored) -> bool:
    """Whether what the explanation leaves is about the noise."""
    gap = r.gap
    if gap is None or gap.after is None or gap.noise_floor is None:
        return False
    return gap.after <= CLOSED * gap.noise_floor


def parameters(diagnosis: Diagnosis, truth: Truth) -> tuple[Value, ...]:
    """True and found value of every continuous parameter of effects that are named rightly, and whether the interval
    has it.
    """
    answers = {(e.name, e.where): e.parameters for e in diagnosis.effects}
    rows = []
    for effect in truth.effects:
        said, known = answers.get((effect.name, effect.where), {}), effect.parameters
        about = VOCABULARY[effect.name].parameters
        discrete, circular = {p.name for p in about if p.discrete}, {p.name for p in about if p.circular}
        for name in sorted(set(said) | set(known) if not set(said) & set(known) else set(said) & set(known)):
            plain = name.split("@")[0]
            value, answer = known.get(name, known.get(plain)), said.get(name, said.get(plain))
            if plain in discrete or value is None or answer is None:
                continue
            low = -math.inf if answer.low is None else answer.low
            high = math.inf if answer.high is None else answer.high
            if plain in circular:
                value = answer.value + float(wrapped(np.asarray(value - answer.value)))
            rows.append(
                Value(
                    parameter=f"{effect.name}.{name}",
                    true=value,
                    found=answer.value,
                    error=(answer.value - value) / abs(value) if value else math.inf,
                    covered=bool(low <= value <= high),
                )
            )
    return tuple(rows)


def failed(truth: Truth, why: str) -> Scored:
    """The score of a set that the diagnosis gave up on."""
    return _of(truth, "failed", "failed").model_copy(update={"good": False, "why": why})

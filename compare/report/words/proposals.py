"""What a diagnosis proposes: one unknown at one place, the law that it looks like, and what would tell it apart."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING

from analytic.mechanism.one_line import capital, enumerated
from compare.quantities import amount
from compare.report.words.diagnosis import percent
from compare.report.words.effects import ParameterRow, parameter, unknown
from compare.results.diagnosis import Diagnosis, Estimate, Proposed

if TYPE_CHECKING:
    from compare.diagnose.propose.proposal import Proposal

HEADING = "Proposed, not named"
ADOPTED = "Proposed, and adopted"
PROPOSAL_MEANS = (
    "A place where one unknown number at each moment would tell what is left, and the law that it looks like. It is"
    " solved for with the analytic model, beside what is named, whose values are fitted again with it. It is a hint for"
    " the engineer: it has no name in the vocabulary, and it changes neither the verdict nor the gap."
)
WHOLE_UNKNOWN = 0.99  # of an unknown: a law that tells as much tells all of it
LETTERS: Mapping[str, str] = {  # of the dictionary's laws, by what a term has in it
    r"\bw\b": "w is the angular velocity in joint {}, of the {second} less the {first}",
    r"\bq\b": "q is the angle in joint {}, of the {second} less the {first}",
    r"\|F\|": "|F| is the reaction at {}",
    r"\bP\b": "P is the pull in the {}",
    r"\bS\b": "S is the size of the drive torque summed over the run, in the sense of its turning",
    r"\bT\b": "T is the drive torque",
    r"\btheta\b": "theta is the crank angle",
    r"\by\b": "y is what the sensor for {} should read",
    r"\bt\b": "t is the time",
    r"\bgap\(": "gap(x, h) is zero as far as h to both sides of x = 0, and as long as x is beyond that",
    r"\bbump\(": "bump(x, s) is exp(-(x/s)^2/2)",
}
UNKNOWN_SAID = {
    "torque": "a torque acts in joint {} on the {second} (and back on the {first})",
    "give": "the bearing of joint {} gives along its reaction",
    "length": "the length of the {} changes",
    "bend": "the end of the {} lies beside its axis",
    "lag": "the crank is behind its encoder",
    "error": "the sensor for {} has an error",
}


def says(p: Proposal, law: str | None, coefficients: Mapping[str, Estimate], related: bool) -> str:
    """``A torque acts in joint E, and it looks like this: ...``; ``related`` says whether what it replaces is of the
    same place and kind.
    """
    what = UNKNOWN_SAID[p.place.unknown].format(p.place.where, **_bodies(p))
    if p.place.unit == "N":
        what = what.replace("a torque acts in", "a force acts along")
    named = enumerated([t.effect.called(t.where) for t in p.replaced])
    if law is None:
        return f"{f'In place of {named}: ' if named else ''}{what if named else capital(what)}; no known law tells it."
    numbers = ", ".join(f"{name} = {amount(c.value, c.unit)}" for name, c in coefficients.items())
    names = enumerated(list(dict.fromkeys(one.law.name for one in p.law.laws)))
    most = "" if p.told > WHOLE_UNKNOWN else f" That tells {100 * p.told:.0f} % of it."
    looks = f"looks like {names}: {law}, with {numbers}{_legend(p, law)}.{most}"
    if named and related:
        on = " on the {second} (and back on the {first})".format(**_bodies(p)) if p.place.unknown == "torque" else ""
        return f"More than {named}: what acts there{on} {looks}"
    return f"In place of {named}: {what}, and it {looks}" if named else f"{capital(what)}, and it {looks}"


def _bodies(p: Proposal) -> dict[str, str]:
    """The two bodies of a joint: its torque acts on the ``second``, whose angle and rate count less the ``first``'s."""
    joints = {j.name: j.bodies for j in p.scene.rig.mechanism.joints}
    return dict(zip(("first", "second"), joints.get(p.place.where, ("", "")), strict=True))


def _legend(p: Proposal, law: str) -> str:
    """``; w is the angular velocity in joint E``: what the letters of a law mean."""
    meant = [means.format(p.place.where, **_bodies(p)) for letter, means in LETTERS.items() if re.search(letter, law)]
    return f"; {enumerated(meant)}" if meant else ""


def heading(result: Diagnosis) -> tuple[str, str]:
    """The heading of what is proposed, and what it means."""
    if all(p.adopted for p in result.proposed):
        return ADOPTED, "You decided that it is there: it is an effect of the model, and counts in the verdict."
    return HEADING, PROPOSAL_MEANS


def sentences(result: Diagnosis, p: Proposed) -> list[str]:
    """What is proposed, how much it would take away, what does as well, and what would tell them apart; of what is
    adopted, that it is.
    """
    out = [p.says]
    if p.adopted:
        return [*out, "It is adopted: an effect like the others, with the gap that every engine leaves with it."]
    if p.not_adopted:
        out.append(f"It cannot be adopted: {p.not_adopted}.")
    if p.share is not None:
        of = "what is left" if result.verdict in ("unexplained", "partly explained") else "the whole gap"
        where = ", on data left out" if p.law else ", with a number for each moment"
        out.append(f"It would take {percent(min(p.share, 1.0))} of {of} beyond the noise away{where}.")
    if p.ties:
        nouns = [unknown(result, tie) for tie in p.ties]
        others = enumerated([f"{'an' if noun[0] in 'aeiou' else 'a'} {noun}" for noun in nouns])
        out.append(f"These data would be told as well by {others}.")
        out.append(
            f"{capital(p.would_separate)}." if p.would_separate else "No sensor of this linkage would part them."
        )
    return out


def numbers(p: Proposed) -> list[ParameterRow]:
    """Letter, value and 95 % interval of each number of the law."""
    return [parameter(letter, estimate) for letter, estimate in p.coefficients.items()]

"""Names of numbers as engineers say them: which one was meant."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping
from difflib import get_close_matches

from analytic.mechanism import Mechanism

ALIKE = 0.8  # of a name's letters, from which on another one is a slip of it
WORDS = {  # what is said for the words of a name; "" for what every one of them is
    "force": "reaction", "load": "reaction", "pin": "reaction", "bearing": "reaction", "moment": "torque",
    "motor": "drive", "average": "mean", "effective": "rms", "travel": "stroke", "swing": "stroke", "lift": "stroke",
    "range": "stroke", "pressure": "transmission", "deviation": "error", "accuracy": "error", "displacement": "error",
    "backlash": "error", "speed": "velocity", "max": "", "maximum": "", "min": "", "least": "", "peak": "",
    "largest": "", "highest": "",
}  # fmt: skip


def meant(name: str, known: Collection[str], joints: Mapping[str, Iterable[str]]) -> str:
    """The known name, or names, that another one is likeliest for: the same in capitals or small letters, of the same
    words, in any order, or of words that say the same, with a body for one of its ``joints``; else of nearly the same
    letters, or with a word of it of somewhat the same.  Empty where there is none.
    """
    same = next((each for each in known if each.lower() == name.lower()), "")
    if same:
        return same
    typed = re.split(r"[_.\s]+", name)
    words = [each for each in (WORDS.get(word.lower(), word) for word in typed) if each]
    bodies = [(body, at) for body in joints if body in words for at in joints[body]]
    at_joints = [[at if word == body else word for word in words] for body, at in bodies]
    first = sorted(known, key=lambda each: len(typed) > 1 and not each.startswith(name))
    for wanted in ([typed], [words], at_joints):
        near = [next((each for each in first if {*those} <= _words(each)), "") for those in wanted]
        if any(near) and words:
            return " or ".join(dict.fromkeys(filter(None, near)))
    partly = [each for each in known if {*typed} & _words(each)]
    slips = get_close_matches(name, known, n=1, cutoff=ALIKE) or get_close_matches(name, partly, n=1)
    return next(iter(slips), "")


def marked(name: str, m: Mechanism) -> str:
    """How the place of a point of a body, such as ``rocker.tip_x``, becomes a signal; empty of another name."""
    for body in m.bodies:
        for point, place in body.points.items():
            for axis in ("x", "y"):
                if name == f"{body.name}.{point}_{axis}":
                    return f"give body {body.name} the marker = {list(place)}, and it is {body.name}_{axis}"
    return ""


def _words(name: str) -> set[str]:
    return {*re.split(r"[_.]", name)}

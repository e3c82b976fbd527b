"""A mechanism file to begin with: a shipped linkage of a kind under a name of one's own."""

from __future__ import annotations

import re
from importlib import resources
from importlib.resources.abc import Traversable

from compare.faults import ArgumentError
from compare.questions.listing import KINDS, NewQuestion
from compare.questions.question import answers

NAME = re.compile(r"[^\W\d][\w.-]*")
HEADING = """\
# {name}, begun as a {kind}: change what is otherwise with yours.
#
# compare {file} shows it in motion, with its reactions, torque and peaks.
# compare --simulator mujoco --case {file} holds it to a simulation.
# Numbers are SI, or in quotes with their unit: "60 rpm", "25 mm", "30 deg".
# compare fields lists all that a table may hold, such as a joint's clearance.
# A point is named after the joint that sits in it.
"""


def begun(kind: str) -> Traversable:
    """The file that a linkage of this kind begins as."""
    if case := KINDS[kind]:
        return resources.files("analytic.mechanism").joinpath("cases", f"{case}.toml")
    return resources.files("compare").joinpath("kinds", f"{kind}.toml")


@answers(NewQuestion)
def new(question: NewQuestion) -> str:
    """The text of a mechanism file of this kind and name, with comments.  Raises ArgumentError."""
    name = question.name.removesuffix(".toml")
    if not NAME.fullmatch(name):
        raise ArgumentError("name", "a name has letters, digits, '_', '-' and '.', and begins with a letter")
    text = re.sub(r"\A(#.*\n)+", "", begun(question.kind).read_text(encoding="utf-8"))
    text = re.sub(r'^name = ".*"$', f'name = "{name}"', text, count=1, flags=re.MULTILINE)
    return HEADING.format(name=name, kind=question.kind, file=f"{name}.toml") + text

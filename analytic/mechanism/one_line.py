"""One line of text for results that hold arrays, as a person wants to see them at a prompt, and the plurals and lists
of plain English.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

LONGEST_LINE = 200  # characters
MOST_CLEARANCES = 3  # joints that are listed with their clearances
LONGEST_CELL = 80  # characters of what a file has, in a message
NUMBER_WORDS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve")


def one_line(result: object, *parts: str) -> str:
    """``Name(part, part)`` on one line of at most LONGEST_LINE characters; empty parts are left out."""
    text = ", ".join(" ".join(part.split()) for part in parts if part)
    room = LONGEST_LINE - len(type(result).__name__) - 2
    return f"{type(result).__name__}({text if len(text) <= room else text[: room - 3] + '...'})"


def count(number: int | str, thing: str) -> str:
    """``1 joint``, ``2 joints``; of a number, or of one as it is printed: ``0.5 turns``."""
    return f"{number} {thing}{'' if str(number) == '1' else 's'}"


def in_words(number: int) -> str:
    """A count as one says it: ``six``, ``3,000``."""
    return NUMBER_WORDS[number] if 0 <= number < len(NUMBER_WORDS) else f"{number:,}"


def enumerated(names: Sequence[str]) -> str:
    """``a, b and c``."""
    return " and ".join(part for part in (", ".join(names[:-1]), names[-1] if names else "") if part)


def capital(text: str) -> str:
    """A text that begins a sentence; a field's or a signal's name stays as it is."""
    return text if "_" in text.partition(" ")[0] else text[:1].upper() + text[1:]


def angles(theta: np.ndarray, of: str = "crank angle") -> str:
    """``29 crank angles 20..160 deg`` for angles (N,) rad; NaN is left out."""
    known = np.degrees(theta[np.isfinite(theta)]).round(6) + 0.0  # no minus zero
    if not known.size:
        return count(theta.size, of)
    low, high = known.min(), known.max()
    span = f"{low:.4g}" if theta.size == 1 else f"{low:.4g}..{high:.4g}"
    return f"{count(theta.size, of)} {span} deg"


def clearances(sizes: Mapping[str, float]) -> str:
    """``clearance B 0.01 m`` for radial clearances (m) by joint."""
    loose = {name: size for name, size in sizes.items() if size > 0}
    if not loose:
        return "no clearance"
    if len(loose) > MOST_CLEARANCES:
        return f"clearance in {count(len(loose), 'joint')} up to {max(loose.values()):.4g} m"
    return f"clearance {', '.join(f'{name} {size:.4g} m' for name, size in loose.items())}"


def largest(values: np.ndarray, unit: str) -> str:
    """``up to 73.2 N``: the largest size in an array; empty where it has no number."""
    known = np.abs(values[np.isfinite(values)])
    return f"up to {known.max():.3g} {unit}" if known.size else ""


def shown(text: str) -> str:
    """What a file has, quoted for a message: one printable line, not longer than can be read."""
    return repr(text if len(text) <= LONGEST_CELL else f"{text[:LONGEST_CELL]}...")


def own_names(names: Iterable[str]) -> list[str]:
    """The names of a part's attributes without those that any of pydantic's models has, for completion."""
    from pydantic import BaseModel

    return sorted({*names} - ({*dir(BaseModel)} - {*dir(object)}))

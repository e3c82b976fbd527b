"""Mechanism files: TOML in, TOML out, and the cases that ship with the package.

Every fault of a file is raised as :class:`MechanismError` with one sentence: file, field, value, remedy.
"""

from __future__ import annotations

import difflib
import os
from collections.abc import Mapping
from functools import cache
from importlib import resources
from pathlib import Path

from pydantic import ValidationError

from analytic.mechanism import Mechanism
from analytic.mechanism.errors import MechanismError, brief, describe, quoted
from analytic.mechanism.reading import ReadingError, parse_toml, read_toml
from analytic.mechanism.tolerances import sources
from analytic.mechanism.units import UnitError
from analytic.mechanism.written import in_si


def shipped_cases() -> list[str]:
    """Names of the mechanisms that ship with the package."""
    return sorted(
        p.name.removesuffix(".toml")
        for p in resources.files("analytic.mechanism").joinpath("cases").iterdir()
        if p.name.endswith(".toml")
    )


def load(case: str | Path) -> Mechanism:
    """Read a shipped case by name, or a TOML file by path.

    Raises MechanismError if there is no such file, or what it says is not a mechanism.  That its loops close is
    found when it is assembled (:mod:`analytic.kinematics.assembly`).
    """
    if not isinstance(case, str | os.PathLike):
        made = ", or lc.Mechanism(**fields) of a dict" if isinstance(case, Mapping) else ", or a Mechanism"
        raise MechanismError(f"{quoted(case)}: give the name of a case, or the path of a mechanism file{made}")
    if str(case) in shipped_cases():
        return _shipped(str(case))
    if not os.path.lexists(case):
        file = f"{case}.toml"
        close = [file] if os.path.isfile(file) else difflib.get_close_matches(str(case), shipped_cases(), n=1)
        hint = f"; did you mean {close[0]!r}" if close else ""
        given = " ".join(brief(case).split())  # also of TOML text, in one line
        raise MechanismError(
            f"{given}: no such mechanism file or case{hint}; the cases are {', '.join(shipped_cases())}"
        )
    try:
        fields = read_toml(Path(case))
    except ReadingError as error:
        raise MechanismError(f"{case}: {error}; give a mechanism file") from None
    return checked(fields, str(case), Path(case).parent)


@cache
def _shipped(case: str) -> Mechanism:
    """A shipped case, which is read once."""
    file = resources.files("analytic.mechanism").joinpath("cases", f"{case}.toml")
    return loads(file.read_text(encoding="utf-8"), source=case)


def loads(text: str, source: str = "mechanism") -> Mechanism:
    """Mechanism from TOML text; ``source`` is its name in messages.  It has no folder, and so no tables in files.
    Raises MechanismError.
    """
    try:
        fields = parse_toml(text)
    except ReadingError as error:
        raise MechanismError(f"{source}: {error}") from None
    return checked(fields, source)


def checked(fields: Mapping[str, object], source: str, folder: Path | None = None) -> Mechanism:
    """Mechanism of a file's fields; ``source`` is its name in messages, ``folder`` where its tables are.  Raises
    MechanismError.
    """
    try:
        fields = in_si(fields, folder)
        mechanism = Mechanism.model_validate(fields)
        sources(mechanism)
        return mechanism
    except (MechanismError, UnitError, ReadingError) as error:
        raise MechanismError(f"{source}: {error}") from None
    except ValidationError as error:
        raise MechanismError(f"{source}: {'; '.join(describe(error, fields, Mechanism))}") from None


def dumps(mechanism: Mechanism) -> str:
    """TOML text that :func:`loads` turns into an equal mechanism: its :meth:`~Mechanism.to_toml`."""
    return mechanism.to_toml()

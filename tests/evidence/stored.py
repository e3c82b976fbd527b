"""Stored evidence: read, made again, compared.  What validation and scoreboard share.

Each has a function ``check_...``, which makes its evidence again and gives a
:class:`tests.evidence.results.remade.Remade`, and ``update_...``, which stores what it makes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TypeVar

from analytic.writing import write_together
from compare.arguments import Simulators, engines, modelling
from compare.faults import Exit, OptionError
from compare.files import output_folder
from compare.results.document import Document, DocumentError
from tests.evidence.results.remade import Remade

D = TypeVar("D", bound=Document)


def read(kind: type[D], folder: str | Path) -> D:
    """What is stored in a folder.  Raises OptionError with file, field, value and the command that writes it."""
    try:
        return kind.read(Path(folder) / kind.file)
    except DocumentError as error:
        raise OptionError(f"--reports: {error}") from None


def store(document: Document, folder: str | Path, option: str) -> Path:
    """Write a document and its pages, whole or not at all; the folder.  Raises OutputError."""
    place = output_folder(Path(folder), option)
    files = document.files()
    for inner in {(place / name).parent for name in files}:
        output_folder(inner, option)
    write_together(place, files)
    return place


def stale_page(path: Path, wanted: str, remedy: str) -> Iterator[str]:
    """Where a page is not what the stored numbers make of it."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        yield f"{path}: cannot be read ({error}); {remedy}"
        return
    expected = wanted.splitlines()
    if lines != expected:
        pairs = enumerate(zip(lines, expected, strict=False))
        k = next((k for k, (one, other) in pairs if one != other), min(len(lines), len(expected)))
        yield f"{path}: line {k + 1} is not what the stored numbers say; {remedy}"


def other_versions(stored: Mapping[str, str | None], found: Mapping[str, str | None], what: str) -> Iterator[str]:
    """Engines that are not those of the evidence, a sentence each; that alone is no difference."""
    for name, version in found.items():
        if stored.get(name, version) != version:
            yield f"{name} is {version} here, and the {what} was made with {stored[name]}"


def asked(simulators: Simulators) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The engines that are meant, and of all those that are not installed, a sentence each.

    Raises Unsupported for an unknown name, SimulatorMissing where none is installed, ArgumentError for a model file.
    """
    names, left_out = engines(simulators)
    return tuple(modelling(name) for name in names), tuple(left_out)


def status(found: Remade, simulators: Simulators = "all") -> Exit:
    """The exit status of a check: a difference, or of all engines one that is left out, does not pass."""
    if not found.holds:
        return Exit.DISAGREES
    return Exit.SIMULATOR_FAILED if found.left_out and simulators == "all" else Exit.AGREES

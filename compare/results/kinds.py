"""Which document a file is, found by its fields, and which files of its folder are its own."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar

from analytic.mechanism.reading import ReadingError, read_json
from compare.results.document import Document, DocumentError
from compare.results.schemas import documents

D = TypeVar("D", bound=Document)


def read_as(path: str | Path, kinds: Sequence[type[D]]) -> D:
    """The document of a JSON file: of those ``kinds`` the one of whose required fields it has the largest share.

    Raises DocumentError with file, field and value.
    """
    wanted = " or ".join(kind.file for kind in kinds)
    try:
        fields = read_json(Path(path))
    except ReadingError as error:
        raise DocumentError(f"{path}: {error}; give a {wanted}") from None
    shares = {kind: _share(set(fields), kind) for kind in kinds}
    likeliest = max(kinds, key=lambda kind: shares[kind])
    if shares[likeliest] < 1.0:
        _refuse_others(path, set(fields), kinds, wanted)
    if shares[likeliest] < 0.5:
        raise DocumentError(f"{path}: has not the fields of a {wanted}; give one of these")
    return likeliest.read(path)


def _refuse_others(path: str | Path, fields: set[str], kinds: Sequence[type[D]], wanted: str) -> None:
    """Raise DocumentError for a document that has all its fields and is none of these kinds."""
    whole = [kind for kind in documents().values() if _share(fields, kind) == 1.0 and kind not in kinds]
    if whole:
        likeliest = max(whole, key=lambda kind: len(fields & set(kind.model_fields)))
        file = likeliest.file
        raise DocumentError(f"{path}: has the fields of {file}; what is read here is {wanted}: give one of these")


def _share(fields: set[str], kind: type[Document]) -> float:
    """The share of a document's required fields, beside those that every document may have, that are there."""
    required = {name for name, field in kind.model_fields.items() if field.is_required()}
    return len(required & fields) / len(required) if required else 0.0


def left_over(folder: Path, names: set[str]) -> set[str]:
    """The other files of those earlier results in a folder of which one file is replaced."""
    if set(os.listdir(folder)) <= names:
        return set()
    left: set[str] = set()
    for file in {kind.file for kind in documents().values()}:
        if not (folder / file).is_file():
            continue
        try:
            earlier = set(read_as(folder / file, [kind for kind in documents().values() if kind.file == file]).files())
        except DocumentError:
            continue  # a stranger's, or of another version: nobody knows what is its own
        if earlier & names:
            left |= earlier - names
    return left

"""Writing files whole or not at all."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path

from analytic.errors import Error


class OutputError(Error, ValueError):
    """The output folder cannot be written; the message names it."""


def write_atomically(path: Path, text: str | bytes) -> Path:
    """Write text or bytes to a temporary neighbour and rename it: nobody sees half a file.  Raises OutputError."""
    return write_together(path.parent, {path.name: text})[0]


def write_together(folder: Path, texts: Mapping[str, str | bytes], gone: Iterable[str] = ()) -> list[Path]:
    """Write files into a folder by their names: all of them, or none where one cannot be written, and never half of
    one; those that are to be ``gone`` go when all are there.

    Each is written to a temporary neighbour; when all are, they are renamed.  Raises OutputError.
    """
    drafts: dict[Path, Path] = {}
    path = folder
    try:
        for name, text in texts.items():
            path = folder / name
            draft = path.parent / f".{path.name}.{secrets.token_hex(4)}"
            with open(draft, "xb") as file:  # readable by whom the umask lets
                drafts[path] = draft
                file.write(text if isinstance(text, bytes) else text.encode())
        for path in list(drafts):
            os.replace(drafts[path], path)
            del drafts[path]
        for path in (folder / name for name in gone):
            path.unlink(missing_ok=True)
    except OSError as error:
        raise OutputError(
            f"{path}: cannot be written ({error.strerror}); free space there, or choose another folder"
        ) from None
    finally:
        for draft in drafts.values():
            with suppress(OSError):
                os.unlink(draft)
    return [folder / name for name in texts]

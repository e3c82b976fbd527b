"""Files: their names, writing them whole or not at all, and JSON without NaN."""

from __future__ import annotations

import json
import math
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any


class OutputError(ValueError):
    """The output folder cannot be written; the message names it."""


def file_name(name: str) -> str:
    """A mechanism's or a run's name as part of a file name."""
    return "".join(c if c.isalnum() or c in "-_" else "-" for c in name)


def output_folder(path: Path) -> Path:
    """The folder, made if need be and proven writable.  Raises OutputError."""
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            pass
    except OSError as error:
        raise OutputError(f"--out {path}: cannot write there ({error.strerror}); choose another folder with --out") from None
    return path


def write_atomically(path: Path, text: str) -> Path:
    """Write text to a temporary neighbour and rename it, so that nobody ever sees half a file.  Raises OutputError."""
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror}); choose another folder with --out") from None
    try:
        with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as file:
            file.write(text)
        os.chmod(name, 0o644)
        os.replace(name, path)
    except OSError as error:
        os.unlink(name)
        raise OutputError(f"{path}: cannot be written ({error.strerror}); free space or choose another folder with --out") from None
    return path


def to_json(value: Any, indent: int | None = None) -> str:
    """JSON text; numbers that are not finite become null."""
    return json.dumps(_plain(value), indent=indent, allow_nan=False, ensure_ascii=False)


def _plain(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    return value

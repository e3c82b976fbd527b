"""Reading TOML and JSON from files that may hold anything: each fault is one :class:`ReadingError`.

A file's kind is checked before it is opened: reading a pipe would wait for ever, and a device might fill the memory.
"""

from __future__ import annotations

import json
import os
import stat
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from analytic.errors import Error

LARGEST_TOML = 2**24  # bytes; the largest baseline has 2**18
LARGEST_JSON = 2**28


class ReadingError(Error, ValueError):
    """A file cannot be read; the message says why, and leaves the file's name and the remedy to the caller."""


def read_toml(path: Path) -> dict[str, object]:
    """The fields of a TOML file, with or without the byte order mark of Windows editors.  Raises ReadingError."""
    return parse_toml(read_text(path))


def parse_toml(text: str) -> dict[str, object]:
    """The fields of TOML text.  Raises ReadingError."""
    return _parsed(tomllib.loads, text, "TOML")


def read_json(path: Path) -> dict[str, object]:
    """The fields of a JSON file, which holds one object.  Raises ReadingError."""
    fields = _parsed(json.loads, read_text(path, LARGEST_JSON), "JSON")
    if not isinstance(fields, dict):
        raise ReadingError(f"holds a {type(fields).__name__}, and no object with fields")
    return fields


def read_text(path: Path, largest: int = LARGEST_TOML) -> str:
    """The text of a file of at most so many bytes, in UTF-8.  Raises ReadingError."""
    try:
        mode = os.stat(path).st_mode
        if stat.S_ISDIR(mode):
            raise ReadingError("cannot be read: it is a folder")
        if not stat.S_ISREG(mode):
            raise ReadingError("cannot be read: it is a pipe or a device, and no file")
        with open(path, "rb") as file:
            content = file.read(largest + 1)
    except FileNotFoundError:
        raise ReadingError("cannot be read: there is no such file") from None
    except (OSError, ValueError) as error:  # a name with a null character is a ValueError
        if isinstance(error, ReadingError):
            raise
        raise ReadingError(f"cannot be read: {error.strerror if isinstance(error, OSError) else error}") from None
    if len(content) > largest:
        raise ReadingError(f"cannot be read: it is larger than {largest / 2**20:.0f} MB")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ReadingError(f"cannot be read: it is not UTF-8 text ({error.reason} at byte {error.start})") from None


def _parsed(parse: Callable[[str], Any], text: str, language: str) -> Any:
    try:
        return parse(text)
    except RecursionError:
        raise ReadingError(f"cannot be read as {language}: its values are nested too deep") from None
    except ValueError as error:  # the languages' own errors, and Python's for a number of more than 4300 digits
        why = "a number has too many digits" if "integer string conversion" in str(error) else error
        raise ReadingError(f"cannot be read as {language}: {why}") from None

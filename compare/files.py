"""Files: their names, writing them whole or not at all, and JSON without NaN."""

from __future__ import annotations

import json
import math
import os
import re
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from analytic.writing import OutputError

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

LOCK_PATIENCE = 10.0  # s to wait for another process that is writing the same files
NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")  # characters that no XML file holds


def file_name(name: str) -> str:
    """A mechanism's or a run's name as part of a file name."""
    return "".join(c if c.isalnum() or c in "-_" else "-" for c in name)


def relative(text: str) -> str:
    """Text in which paths of the working folder and below are relative to it, so that they mean the same elsewhere."""
    here = re.escape(os.getcwd())
    return re.sub(rf"(?<![\w/.]){here}(?:(/)|(?![\w.-]))", lambda path: "" if path[1] else ".", text)


def escape_markdown(text: str) -> str:
    """Text as a Markdown table cell or sentence shows it, markup and line breaks made harmless."""
    return re.sub(r"([\\`*_\[\]|<>&#~!$@])", r"\\\1", re.sub(r"\s+", " ", str(text)))


def output_folder(path: Path, option: str = "--out") -> Path:
    """The folder that an option names, made if need be and proven writable.  Raises OutputError."""
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            pass
    except OSError as error:
        raise OutputError(
            f"{option} {path}: cannot write there ({error.strerror}); choose another folder"
            + f" with {option}" * option.startswith("--")
        ) from None
    return path


@contextmanager
def made_folder(path: Path, option: str = "--out") -> Iterator[Path]:
    """The folder that an option names, made if need be; what this made is removed again where nothing was left in it.
    Raises OutputError.
    """
    new = [each for each in (path, *path.parents) if not os.path.lexists(each)]
    try:
        yield output_folder(path, option)
    finally:
        with suppress(OSError):  # not empty, or gone
            for each in new:
                each.rmdir()


def check_replaceable(
    folder: Path, file: str, names: Iterable[str], same: Callable[[str | None], bool], option: str, remedy: str
) -> None:
    """Raise OutputError where files that are to be written would replace what is not their command's own.

    The result ``file`` says whose the folder is: where it is there, its command (None: it says none) must be the
    ``same``; where it is not, none of the ``names`` that are to stand beside it may be there.  ``option`` and
    ``remedy`` are for the message.
    """
    an = "an" if file[0] in "aeiou" else "a"
    if not os.path.lexists(folder / file):
        there = next((name for name in names if os.path.lexists(folder / name)), None)
        if there is not None:
            raise OutputError(f"{option} {folder}: there is another {there}, without {an} {file} beside it; {remedy}")
        return
    made_by = _made_by(folder / file)
    if same(made_by):
        return
    if made_by is None:
        raise OutputError(f"{option} {folder}: there is {an} {file} that does not say which command made it; {remedy}")
    command = "".join(c if c.isprintable() else "?" for c in made_by[:200]) or "none: it is of Python"
    raise OutputError(f"{option} {folder}: its {file} is of another command ({command}); {remedy}")


def _made_by(path: Path) -> str | None:
    """The command that a result says it is of, "" for one of Python; None where it says none."""
    from analytic.mechanism.reading import ReadingError, read_json

    try:
        command = read_json(path).get("command")
    except ReadingError:
        return None
    return command if isinstance(command, str) else None


@contextmanager
def alone_in(folder: Path, patience: float = LOCK_PATIENCE, option: str = "--out") -> Iterator[None]:
    """Hold a folder, of those processes that ask for it like this, for this one; a process that ends lets it go.

    Raises OutputError where another one holds it for longer than ``patience`` (s).  Does nothing where the system has
    no such locks.
    """
    if fcntl is None:
        yield
        return
    elsewhere = "choose another folder" + f" with {option}" * option.startswith("--")
    try:
        handle, until = os.open(folder, os.O_RDONLY), time.monotonic() + patience
    except OSError as error:
        raise OutputError(f"{option} {folder}: cannot write there ({error.strerror}); {elsewhere}") from None
    try:
        while not _locked(handle):
            if time.monotonic() > until:
                raise OutputError(f"{option} {folder}: another run is writing there; wait for it, or {elsewhere}")
            time.sleep(0.05)
        yield
    finally:
        os.close(handle)


def _locked(handle: int) -> bool:
    """Lock a folder, unless another process has; one on a file system without locks counts as locked."""
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        return not isinstance(error, BlockingIOError)
    return True


def to_json(value: object, indent: int | None = None) -> str:
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

"""Earlier results in a folder, found quickly: of a file only its beginning and its end are read where they do."""

from __future__ import annotations

import json
import os
import re
import stat
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import cast

from analytic.mechanism.reading import ReadingError, read_json
from compare.faults import OptionError, printable
from compare.questions.listing import REPORTS, RunsQuestion
from compare.questions.question import answers
from compare.results.history import EarlierRun, Kind, Runs

RESULT_KINDS: Mapping[str, Kind] = {
    "result.json": "cross-check",
    "diagnosis.json": "diagnosis",
    "analysis.json": "analysis",
    "accuracy.json": "accuracy",
    "validity.json": "validity",
    "sweep.json": "sweep",
    "data.json": "data",
    "plan.json": "plan",
}
WITH_VERDICT = ("cross-check", "diagnosis")  # kinds that have a verdict
DEEPEST_FOLDER = 4  # folders below the one that is asked for
HEAD = 2**16  # bytes in which case, verdict and command are looked for
WHOLE_FILE = 2**22  # bytes of a file that is read whole where its head has not got them all
_BLANK = re.compile(r"[ \t\r\n]*")
_DECODER = json.JSONDecoder()


@answers(RunsQuestion)
def runs(question: RunsQuestion) -> Runs:
    """Earlier results in a folder and those below it, newest first: case, command, verdict and date of each.

    A file that has the name of a result and is none is told in ``unreadable``.  Raises OptionError where there is no
    such folder.
    """
    place = Path(question.folder)
    if not place.is_dir():
        raise OptionError(f"{place}: there is no such folder; give one that holds reports, such as {REPORTS}")
    earlier, unreadable = [], []
    for path in _results(place, DEEPEST_FOLDER):
        try:
            earlier.append(_run(path))
        except ReadingError as error:
            unreadable.append(printable(f"{path}: {error}"))
    earlier.sort(key=lambda run: run.file)
    earlier.sort(key=lambda run: run.date, reverse=True)
    return Runs(folder=str(place), runs=tuple(earlier), unreadable=tuple(sorted(unreadable)))


def _results(folder: Path, depth: int) -> Iterator[Path]:
    """Files with the name of a result; folders that cannot be read, hidden ones and links to folders are passed by."""
    try:
        with os.scandir(folder) as entries:
            inner = []
            for entry in entries:
                if entry.name in RESULT_KINDS:
                    yield Path(entry.path)
                elif depth and not entry.name.startswith(".") and entry.is_dir(follow_symlinks=False):
                    inner.append(Path(entry.path))
    except OSError:
        return
    for each in inner:
        yield from _results(each, depth - 1)


def _run(path: Path) -> EarlierRun:
    """The case, command, verdict and date that a result gives.  Raises ReadingError."""
    kind = RESULT_KINDS[path.name]
    wanted = {"schema", "case", "command", *(["verdict"] if kind in WITH_VERDICT else [])}
    fields, written = _read(path, wanted)
    if fields.get("schema") != 1:
        raise ReadingError(f"is not a result of compare: schema is {_shown_value(fields, 'schema')}, and not 1")
    for name in sorted(wanted & {"case", "verdict"}):
        if not isinstance(fields.get(name), str):
            raise ReadingError(f"is not a result of compare: {name} is {_shown_value(fields, name)}, and no text")
    command = fields.get("command")
    return EarlierRun(
        file=str(path),
        kind=kind,
        case=printable(cast(str, fields["case"])),
        verdict=printable(cast(str, fields["verdict"])) if kind in WITH_VERDICT else None,
        command=printable(command) if isinstance(command, str) else "",
        date=_date(fields.get("date"), written),
    )


def _shown_value(fields: Mapping[str, object], name: str) -> str:
    return repr(fields[name])[:60] if name in fields else "missing"


def _read(path: Path, wanted: set[str]) -> tuple[Mapping[str, object], float]:
    """The fields of a file as far as they are needed, and when it was written (s since 1970).  Raises ReadingError."""
    try:
        about = os.stat(path)
        if about.st_size <= HEAD or not stat.S_ISREG(about.st_mode):
            return read_json(path), about.st_mtime
        with open(path, "rb") as file:
            head = file.read(HEAD)
            file.seek(about.st_size - 64)
            tail = file.read(64)
    except OSError as error:
        raise ReadingError(f"cannot be read: {error.strerror}") from None
    fields = _fields(head.decode("utf-8-sig", errors="replace"))
    if about.st_size <= WHOLE_FILE and not wanted <= set(fields):
        return read_json(path), about.st_mtime
    if not tail.rstrip().endswith(b"}"):
        raise ReadingError("is cut off: it does not end with a brace")
    return fields, about.st_mtime


def _fields(text: str) -> dict[str, object]:
    """The first fields of a JSON object whose end may be missing."""
    fields: dict[str, object] = {}
    at = _blank(text, 0)
    if text[at : at + 1] != "{":
        return fields
    try:
        while text[at : at + 1] in ("{", ","):
            name, at = _DECODER.raw_decode(text, _blank(text, at + 1))
            value, at = _DECODER.raw_decode(text, _blank(text, _blank(text, at) + 1))
            at = _blank(text, at)
            if at == len(text):
                break  # a number may go on
            fields[name] = value
    except (ValueError, RecursionError, TypeError):
        pass
    return fields


def _blank(text: str, at: int) -> int:
    """Where the next character that is no blank is."""
    return cast(re.Match[str], _BLANK.match(text, at)).end()


def _date(given: object, written: float) -> str:
    """ISO 8601 in UTC: the date that a file says, or when it was written."""
    date = datetime.fromtimestamp(written, UTC)
    if isinstance(given, str):
        try:
            date = datetime.fromisoformat(given)
        except ValueError:
            pass
        else:
            date = date.replace(tzinfo=UTC) if date.tzinfo is None else date.astimezone(UTC)
    return date.isoformat(timespec="seconds")

"""What takes long to make and several tests look at, made once for all workers of a session and kept in files.

A value is kept under everything that it follows from, so a test cannot meet another's.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

FOLDER: Path | None = None  # of this session; conftest sets it


@contextlib.contextmanager
def _locked(path: Path) -> Iterator[None]:
    """One worker at a time; where files have no locks, two may do the same work."""
    with path.open("w", encoding="utf-8") as file:
        with contextlib.suppress(ImportError):
            import fcntl

            fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _place(name: str, follows_from: tuple[Any, ...], suffix: str) -> Path:
    assert FOLDER is not None, "only tests share: conftest.py says where"
    digest = hashlib.sha256(repr(follows_from).encode()).hexdigest()[:24]
    return FOLDER / f"{name}-{digest}{suffix}"


def document(name: str, make: Callable[[], Any], *follows_from: Any) -> Any:
    """What ``make`` returns, as JSON has it; ``follows_from`` has a ``repr`` that tells two of them apart."""
    path = _place(name, follows_from, ".json")
    with _locked(path.with_suffix(".lock")):
        if not path.exists():
            path.write_text(json.dumps(make()), encoding="utf-8")
        return json.loads(path.read_text(encoding="utf-8"))


def arrays(
    name: str, make: Callable[[], list[Mapping[str, np.ndarray]]], *follows_from: Any
) -> list[dict[str, np.ndarray]]:
    """Rows of named arrays, to the last bit."""
    path = _place(name, follows_from, ".npz")
    with _locked(path.with_suffix(".lock")):
        if not path.exists():
            rows = make()
            np.savez(path, **{f"{k} {key}": values for k, row in enumerate(rows) for key, values in row.items()})
        found: dict[int, dict[str, np.ndarray]] = {}
        with np.load(path, allow_pickle=False) as stored:
            for key in stored.files:
                k, _, signal = key.partition(" ")
                found.setdefault(int(k), {})[signal] = stored[key]
        return [found[k] for k in sorted(found)]

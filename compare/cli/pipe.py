"""Standard output of which the reader goes away, as head does: the command ends as one does that a signal ends."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from typing import Any, TextIO, cast

from compare.faults import Exit


class _Output:
    """A stream that ends the command where nobody reads it any more."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write text.  Raises SystemExit."""
        try:
            return self._stream.write(text)
        except BrokenPipeError:
            raise self._gone() from None

    def flush(self) -> None:
        """Pass on what was written.  Raises SystemExit."""
        try:
            self._stream.flush()
        except BrokenPipeError:
            raise self._gone() from None

    def _gone(self) -> SystemExit:
        """What is raised; what is still to be written goes nowhere, or Python would complain of it at its end."""
        with contextlib.suppress(OSError, ValueError):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self._stream.fileno())
            os.close(nowhere)
        return SystemExit(Exit.READER_GONE)


@contextlib.contextmanager
def reader_may_go() -> Iterator[None]:
    """Within this, printing for nobody ends the command with 128 + SIGPIPE, which is no verdict.  Raises SystemExit."""
    output = _Output(sys.stdout)
    with contextlib.redirect_stdout(cast(TextIO, output)):
        try:
            yield
        finally:
            output.flush()

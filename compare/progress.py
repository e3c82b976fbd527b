"""Progress of commands and of the functions that a person calls: on standard error where that is a terminal, in the
cell of a notebook, line by line in the log of CI, and nowhere else.
"""

from __future__ import annotations

import html
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from compare.ci import in_ci

Progress = Callable[[str, int, int | None], None]

TICK = 1.0  # s, of a notebook's clock; what ends sooner needs no bar
LOGGED = 20.0  # s, at the least, between lines of a log

_up: Progress | None = None  # the bar that is up: a function that calls another has one with it


@contextmanager
def progress_bar(given: Progress | None = None, what: str = "") -> Iterator[Progress]:
    """Tell what this gives (what is being done, how many are done, how many there are); it is what was ``given``, if
    anything was, or the bar that is up.  Until it is told something it says ``what``.

    Its clock ticks while a run is under way, also where an engine is kept off the standard streams: the bar has a
    stream of its own.
    """
    global _up
    if _up is not None:
        yield given or _up
        return
    with _place(given, what) as bar:
        _up = bar
        try:
            yield bar
        finally:
            _up = None


@contextmanager
def _place(given: Progress | None, what: str) -> Iterator[Progress]:
    """Where progress goes."""
    if given is not None:
        yield given
    elif _in_notebook():
        with _cell(what) as cell:
            yield cell
    elif sys.stderr is not None and sys.stderr.isatty():
        with _terminal(what) as terminal:
            yield terminal
    elif sys.stderr is not None and in_ci():
        with _log() as log:
            yield log
    else:
        yield lambda what, done, total: None


@contextmanager
def _log() -> Iterator[Progress]:
    """A line now and then, of what takes long: where nobody watches a bar, it says what a job spent its time on."""
    try:
        copy = os.dup(sys.stderr.fileno())
    except (OSError, ValueError):  # no file, as where a test has its own
        yield lambda what, done, total: None
        return
    began = last = time.monotonic()
    with os.fdopen(copy, "w", encoding=sys.stderr.encoding) as log:

        def tell(what: str, done: int, total: int | None) -> None:
            nonlocal last
            if (now := time.monotonic()) - last >= LOGGED:
                last = now
                print(_line(what, done, total, now - began)["text/plain"], file=log, flush=True)

        yield tell


@contextmanager
def _terminal(what: str) -> Iterator[Progress]:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
    from rich.table import Column

    columns = (
        SpinnerColumn("line"),
        BarColumn(20),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.description}", markup=False, table_column=Column()),  # which may take a second line
    )
    with os.fdopen(os.dup(sys.stderr.fileno()), "w", encoding=sys.stderr.encoding) as terminal:
        bar = Progress(
            *columns,
            console=Console(file=terminal),
            transient=True,
            redirect_stdout=False,
            redirect_stderr=False,
        )
        task = bar.add_task(what, total=None)
        shown = threading.Timer(TICK, bar.start)
        shown.daemon = True
        shown.start()
        try:
            yield lambda what, done, total: bar.update(task, description=what, completed=done, total=total)
        finally:
            shown.cancel()
            shown.join()
            if bar.live.is_started:
                bar.stop()


def _in_notebook() -> bool:
    """Whether a notebook's kernel runs us."""
    ipython = sys.modules.get("IPython")
    return ipython is not None and getattr(ipython.get_ipython(), "kernel", None) is not None


@contextmanager
def _cell(what: str) -> Iterator[Progress]:
    """A bar in the cell that is run, which is gone at the end.  Rich's own needs ipywidgets, and tqdm's as well."""
    from IPython.display import display

    began, ended = time.monotonic(), threading.Event()
    state: list[tuple[str, int, int | None]] = [(what, 0, None)]

    def tick() -> None:
        handle = None
        while not ended.wait(TICK):
            line = _line(*state[0], time.monotonic() - began)
            if handle is None:
                handle = display(line, raw=True, display_id=True)
            else:
                handle.update(line, raw=True)
        if handle is not None:
            handle.update({}, raw=True)

    def tell(what: str, done: int, total: int | None) -> None:
        state[0] = what, done, total

    clock = threading.Thread(target=tick, daemon=True)
    clock.start()
    try:
        yield tell
    finally:
        ended.set()
        clock.join()


def _line(what: str, done: int, total: int | None, seconds: float) -> dict[str, str]:
    """What a notebook shows, as text and as HTML."""
    clock = f"{int(seconds) // 60}:{int(seconds) % 60:02}"
    counted = "" if total is None else f"{done}/{total}"
    size = "" if total is None else f' value="{done}" max="{total}"'
    return {
        "text/plain": "  ".join(each for each in (what, counted, clock) if each),
        "text/html": f"<progress{size}></progress> {html.escape(what)} {counted} {clock}",
    }

"""Processes that do the runs of this one: quiet, with one thread each, and gone as soon as it is."""

from __future__ import annotations

import ctypes
import multiprocessing.resource_tracker
import os
import signal
import sys
import threading
import time
import warnings
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager

ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"), "1"
)
IDLE = 10  # s after which a process without work ends
WATCH = 1.0  # s between two looks at whether the parent is still there, where the system does not tell
PARENT_DIED = 1  # Linux's PR_SET_PDEATHSIG


@contextmanager
def processes(count: int) -> Iterator[Executor]:
    """An executor of so many processes, which are killed at the end of this, or with this process."""
    from joblib.externals.loky import ProcessPoolExecutor
    from joblib.externals.loky.backend import resource_tracker

    # It replaces a process that has grown, and warns of it: as an error, that would end the thread that replaces it
    warnings.filterwarnings("ignore", "A worker stopped while some jobs were given", UserWarning)
    with _without_warnings():
        for tracker in (resource_tracker, multiprocessing.resource_tracker):
            tracker.ensure_running()
    executor = ProcessPoolExecutor(count, timeout=IDLE, env=ONE_THREAD, initializer=end_with, initargs=(os.getpid(),))
    try:
        yield executor
    finally:
        executor.shutdown(kill_workers=True)


@contextmanager
def _without_warnings() -> Iterator[None]:
    """Python processes that are started within this warn of nothing.

    The trackers of semaphores outlive us, and would tell the user of those that a killed process has left for them to
    remove.
    """
    before = list(sys.warnoptions)
    sys.warnoptions.append("ignore")
    try:
        yield
    finally:
        sys.warnoptions[:] = before


@contextmanager
def deaf() -> Iterator[None]:
    """Processes that are started within this do not hear an interrupt from the keyboard, which reaches them before they
    can ignore it.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def end_with(parent: int) -> None:
    """Let this worker end within a second or so of its parent, a process number, however that ends.

    Linux kills it, in the middle of an engine's step too; elsewhere a thread watches, which has to wait for such a
    step.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # an interrupt from the keyboard reaches us all; the parent ends us
    warnings.simplefilter("ignore")  # what a worker has to say is in its result
    if not (sys.platform == "linux" and ctypes.CDLL(None).prctl(PARENT_DIED, signal.SIGKILL) == 0):
        threading.Thread(target=_watch, args=(parent,), daemon=True).start()
    if os.name == "posix" and os.getppid() != parent:  # it ended before we asked
        os._exit(1)


def _watch(parent: int) -> None:
    while os.name == "posix" and os.getppid() == parent:
        time.sleep(WATCH)
    if os.name == "posix":
        os._exit(1)

"""Many independent runs, spread over processes or a Dask cluster, and recorded as they end.

:func:`spread` only spreads.  :func:`sweep` also records each result in a folder, one file a run, named after what the
run is, so that an interrupted sweep goes on where it stopped.  Numbers do not depend on the number of workers: a run
knows nothing of the others, and linear algebra in a worker uses one thread.
"""

from __future__ import annotations

import hashlib
import json
import socket
import threading
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sized
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, ThreadPoolExecutor, wait
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Generic, TypeVar

from analytic.writing import write_atomically
from compare.faults import ArgumentError
from compare.files import to_json
from compare.workers import deaf

RUNS_AHEAD = 2  # runs under way for each worker: one that it does, one that waits for it
CONNECT = 10.0  # s to wait for a cluster's scheduler
WORKERS_PATIENCE = 60.0  # s to wait for its workers
RUNS_TAKE_TURNS = threading.Lock()  # engines are not made for threads: the runs of one process take turns

T = TypeVar("T")
R = TypeVar("R")
C = TypeVar("C", bound=Mapping[str, object])  # what a run of a sweep is: plain JSON data


class ClusterError(ArgumentError):
    """The Dask cluster of the argument ``dask`` cannot be used; the message says why and what to do."""


class Died(RuntimeError):
    """The process of a run died under it, not under its neighbours."""


@dataclass(frozen=True)
class Ended(Generic[T, R]):
    """An item that is done: ``value`` is what came of it, unless it raised ``error``; ``known`` if it was known
    before.
    """

    item: T
    value: R | None = None
    error: BaseException | None = None
    known: bool = False


@dataclass(frozen=True)
class SweepOutcome:
    """A run of a sweep: its place in the sequence, its result as plain JSON data or ``failure``, why there is none.

    ``recorded`` says that the folder had the result already.
    """

    index: int
    result: object = None
    failure: str = ""
    recorded: bool = False


def spread(
    work: Callable[[T], R],
    items: Iterable[T],
    workers: int = 1,
    dask: str | None = None,
    known: Callable[[T], R | None] = lambda item: None,
) -> Iterator[Ended[T, R]]:
    """Call ``work`` on each item that is not ``known``; yield each end as it comes, in no particular order.

    One worker is a thread of this process, more are processes of their own; with ``dask``, a scheduler's address, its
    workers do it all.  Items are taken as there is room for them.  What one raises, or the death of its process (Died),
    is its own end and not that of the others.  Raises ClusterError.
    """
    todo = iter(items)
    while True:
        suspects = yield from _until_broken(work, todo, lambda: _pool(workers, dask), known)
        if not suspects:
            return
        for (
            item
        ) in suspects:  # one of these brought its process down: each by itself, so that the others come to their end
            if (yield from _until_broken(work, iter([item]), lambda: _processes(1), known)):
                yield Ended(
                    item,
                    error=Died(
                        "the process that ran this died (out of memory, or a crash of the engine); run it by itself to"
                        " see why"
                    ),
                )


def sweep(
    work: Callable[[C], Mapping[str, object]],
    runs: Iterable[C],
    folder: Path | None = None,
    *,
    workers: int = 1,
    dask: str | None = None,
    progress: Callable[[int, int | None], None] = lambda done, total: None,
) -> Iterator[SweepOutcome]:
    """Do every run that the folder does not hold; yield and record each outcome as it comes, in no particular order.

    A run is plain JSON data, everything that its result depends on; ``work``, importable wherever it is called, makes
    plain data of it.  A run that raises, or whose process dies, is not recorded, so that it is tried again the next
    time; a failure that would only repeat itself is for ``work`` to return.  ``progress`` is told (done, total).
    Memory holds only the runs under way, if ``runs`` and the caller do.  Raises ClusterError and OutputError.
    """
    total = len(runs) if isinstance(runs, Sized) else None
    progress(0, total)
    ends = spread(partial(_record, work), enumerate(runs), workers, dask, lambda item: _recorded(folder, item[1]))
    for done, ended in enumerate(ends, 1):
        index, content = ended.item
        if ended.value is None:
            yield SweepOutcome(index, failure=f"{type(ended.error).__name__}: {ended.error}")
        else:
            if folder is not None and not ended.known:
                write_atomically(folder / _file(content), ended.value)
            yield SweepOutcome(index, json.loads(ended.value)["result"], recorded=ended.known)
        progress(done, total)


# ---------------------------------------------------------------- records


def _record(work: Callable[[C], Mapping[str, object]], item: tuple[int, C]) -> str:
    """Do a run; the text of its file."""
    with RUNS_TAKE_TURNS:
        return to_json({"run": item[1], "result": work(item[1])})


def _recorded(folder: Path | None, content: Mapping[str, object]) -> str | None:
    """The text of a run's file; None if there is none, or none of this very run."""
    if folder is None:
        return None
    try:
        text = (folder / _file(content)).read_text(encoding="utf-8")
        same = json.loads(text)["run"] == json.loads(to_json(content))
    except (FileNotFoundError, UnicodeDecodeError, json.JSONDecodeError, KeyError, TypeError):
        return None
    return text if same else None


def _file(content: Mapping[str, object]) -> str:
    canonical = json.dumps(json.loads(to_json(content)), sort_keys=True)
    return f"{hashlib.sha256(canonical.encode()).hexdigest()[:32]}.json"


# ---------------------------------------------------------------- where runs are done

Pool = tuple[Executor, Callable[[], int]]  # an executor, and how many runs may be under way in it


def _until_broken(
    work: Callable[[T], R],
    todo: Iterator[T],
    pool: Callable[[], AbstractContextManager[Pool]],
    known: Callable[[T], R | None],
) -> Generator[Ended[T, R], None, list[T]]:
    """Work through the items until there are no more, or a process dies; returns the items that were then under way."""
    under_way: dict[Future[R], T] = {}
    with pool() as (executor, room):
        while True:
            for item in todo if len(under_way) < room() else ():
                result = known(item)
                if result is not None:
                    yield Ended(item, result, known=True)
                    continue
                try:
                    with deaf():
                        under_way[executor.submit(work, item)] = item
                except BrokenExecutor:
                    return [item, *under_way.values()]
                if len(under_way) >= room():
                    break
            if not under_way:
                return []
            done, _ = wait(under_way, WORKERS_PATIENCE, FIRST_COMPLETED)
            if any(future.cancelled() for future in done):
                raise ClusterError(
                    "dask", "the cluster was lost while runs were under way; start the same again to go on"
                )
            whole = [future for future in done if not isinstance(future.exception(), BrokenExecutor)]
            for future in whole:
                item, error = under_way.pop(future), future.exception()
                yield Ended(item, error=error) if error else Ended(item, future.result())
            if len(whole) < len(done):
                return list(under_way.values())


@contextmanager
def _pool(workers: int, dask: str | None) -> Iterator[Pool]:
    if dask is not None:
        with _cluster(dask) as pool:
            yield pool
    elif workers > 1:
        with _processes(workers) as pool:
            yield pool
    else:
        with ThreadPoolExecutor(1) as executor:
            yield executor, lambda: 1


@contextmanager
def _processes(workers: int) -> Iterator[Pool]:
    from compare.workers import processes

    with processes(workers) as executor:
        yield executor, lambda: RUNS_AHEAD * workers


@contextmanager
def _cluster(address: str) -> Iterator[Pool]:
    """The workers of a Dask scheduler; Dask gives the runs of a worker that is lost to another one."""
    try:
        from dask.distributed import Client
    except ImportError:
        raise ClusterError(
            "dask", f"{address}: Dask is not installed; run: pip install 'linkage-crosscheck[dask]'"
        ) from None
    try:
        _knock(address)
        client = Client(address, timeout=CONNECT, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ClusterError(
            "dask", f"{address}: no scheduler answers there ({error}); give its address, such as tcp://localhost:8786"
        ) from None

    def room() -> int:
        try:
            client.wait_for_workers(1, timeout=WORKERS_PATIENCE)
        except TimeoutError:
            raise ClusterError(
                "dask", f"{address}: the cluster has no workers; start some, then the same again"
            ) from None
        return RUNS_AHEAD * max(1, sum(client.nthreads().values()))

    with client:
        yield client.get_executor(pure=False), room


def _knock(address: str) -> None:
    """Raise OSError or ValueError where nothing listens; a Client would say so late and with a traceback."""
    from distributed.comm.addressing import parse_address, parse_host_port
    from distributed.comm.registry import get_backend

    scheme, place = parse_address(address)
    get_backend(scheme)
    if scheme in ("tcp", "tls"):
        socket.create_connection(parse_host_port(place, 8786), CONNECT).close()

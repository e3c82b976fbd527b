"""What all tests share: a core for each worker, a folder between them, engines that may be absent, and time that may
not do.

A test that takes an engine carries its name as a mark: from a parameter that is an engine's name, or written in the
file.  Where the engine is not installed, or cannot be imported, the test is skipped, in one line of the summary for
each engine; so is a test without the mark that meets the missing engine on its way.

``--minutes 30`` begins no test after half an hour, and the summary says how many were not run.  Which these are, a
``--turn`` decides: it shuffles the files, so that another turn leaves out others.
"""

# ruff: noqa: E402 - the environment is set before numpy is imported

from __future__ import annotations

import gc
import math
import os
import random
import time
from collections.abc import Generator
from fnmatch import fnmatchcase
from typing import NoReturn

for threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(threads, "1")  # before numpy is imported: the workers share the cores
for each in ("GITHUB_ACTIONS", "CI"):  # a workflow that runs the tests is not one whose commands they are
    os.environ.pop(each, None)

import pytest

import shared
from engines_here import missing
from sim_models.engine import ENGINES, SimulatorMissing

END = math.inf  # on the monotonic clock: what is not begun by then is not run
MOST_WORKERS = 8  # beyond it, what is left is the few longest tests


def pytest_xdist_auto_num_workers() -> int:
    """One worker for each core that this process may use."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return min(cores, MOST_WORKERS)


@pytest.fixture(autouse=True, scope="session")
def _shared_folder(tmp_path_factory: pytest.TempPathFactory) -> None:
    """One folder for all workers of this session."""
    base = tmp_path_factory.getbasetemp()
    shared.FOLDER = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "shared"
    shared.FOLDER.mkdir(exist_ok=True)


# ---------------------------------------------------------------- time


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--minutes", type=float, default=math.inf, help="begin no test after so many minutes")
    parser.addoption("--turn", type=int, help="shuffle the test files, each number in its own way")


def pytest_configure(config: pytest.Config) -> None:
    global END
    END = time.monotonic() + 60 * config.getoption("--minutes")


def pytest_collection_finish() -> None:
    """What was imported and collected stays: Python's collector need not look through it again in every test."""
    gc.collect()
    gc.freeze()


# ---------------------------------------------------------------- engines


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """A test whose parameter is an engine's name is of that engine, a row that its test's ``long_rows`` names is of
    the long suite; files come in the order of their turn.
    """
    turn = config.getoption("--turn")
    if turn is not None:
        order = {path: random.Random(f"{turn} {path.name}").random() for path in {item.path for item in items}}
        items.sort(key=lambda item: order[item.path])
    for item in items:
        values = item.callspec.params.values() if hasattr(item, "callspec") else ()
        for name in {value for value in values if isinstance(value, str)} & set(ENGINES):
            item.add_marker(name)
        for rows in item.iter_markers("long_rows"):
            if any(fnmatchcase(item.callspec.id, row) for row in rows.args):
                item.add_marker("slow")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup(item: pytest.Item) -> Generator[None, object, object]:
    if time.monotonic() > END:
        _skip("not run: the time of --minutes was over")
    for name in ENGINES:
        if item.get_closest_marker(name) and missing(name):
            _skip(missing(name))
    return (yield from _skipped_without_its_engine())


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call() -> Generator[None, object, object]:
    return (yield from _skipped_without_its_engine())


def _skipped_without_its_engine() -> Generator[None, object, object]:
    try:
        return (yield)
    except SimulatorMissing as why:
        if str(why) in map(missing, ENGINES):  # truly missing, not hidden by the test
            _skip(str(why))
        raise


def _skip(why: str) -> NoReturn:
    """From one place, so that pytest adds the tests of an engine up in one line."""
    pytest.skip(why)

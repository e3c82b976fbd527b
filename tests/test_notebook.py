"""Functions called in a notebook that is executed: what its cells show while they run, and what is left of it."""

from __future__ import annotations

from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient

pytestmark = pytest.mark.mujoco

CELLS = (
    "import linkage_crosscheck as lc\nlc.load('paper')",
    # three seconds and more: runs in which pins strike, over many turns
    "result = lc.crosscheck('crank-rocker', joint_model='spring-damper', clearance={'B': 1e-4}, workers=1)",
    "import time\nfrom compare.progress import progress_bar\n"
    "with progress_bar(what='nothing is told') as told:\n    time.sleep(2.5)",
    "print(lc.read_measured)",
)


class Watched(NotebookClient):
    """A client that keeps what each cell is told to show, in order."""

    def __init__(self, *arguments: Any, **named: Any) -> None:
        super().__init__(*arguments, **named)
        self.shown: dict[int, list[dict[str, str]]] = {}

    def process_message(self, msg: Any, cell: Any, cell_index: int) -> Any:
        if msg["msg_type"] in ("display_data", "update_display_data"):
            self.shown.setdefault(cell_index, []).append(msg["content"]["data"])
        return super().process_message(msg, cell, cell_index)


@pytest.mark.slow
def test_a_cell_shows_progress_while_it_runs_and_not_afterwards() -> None:
    book = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(text) for text in CELLS])
    client = Watched(book, timeout=300, extra_arguments=["--log-level=ERROR"])
    client.execute()
    assert sorted(client.shown) == [1, 2]  # calls of over two seconds, and no others
    for number, words in ((1, "mujoco"), (2, "nothing is told")):
        *under_way, last = client.shown[number]
        lines = [each["text/plain"] for each in under_way]
        assert len(lines) > 1
        assert all(words in line for line in lines)
        assert lines[0].endswith("0:01")
        assert lines[-1].split()[-1] > lines[0].split()[-1]  # its clock goes on
        assert all(each["text/html"].startswith("<progress") for each in under_way)
        assert last == {}
        assert [output["data"] for output in book.cells[number].outputs] == [{}]

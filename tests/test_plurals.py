"""One of a thing is not called by its plural, in what is printed and in what a result says of itself."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path

import pytest

import linkage_crosscheck as lc
from commands import compare
from compare.results.document import Document

ONE = [math.radians(30.0)]
OF_ONE = re.compile(
    r"\b1 (?:crank )?(?:angle|run|sample|set|cell|comparison|file|output|joint|body|bodie)s\b"
    r"|\b1 (?:position|revolution|turn|time)s\b|[a-z]\(s\)"
)
RESULTS: dict[str, Callable[[], Document]] = {
    "crosscheck": lambda: lc.crosscheck("paper", simulator="mujoco", joint_model="ideal", angles=ONE),
    "contact": lambda: lc.crosscheck("six-bar", simulator="mujoco", joint_model="contact", clearance={"B": 1e-4}),
    "analyse": lambda: lc.analyse("paper", angles=ONE),
    "simulate": lambda: lc.simulate("paper", angles=ONE),
    "accuracy": lambda: lc.accuracy("paper", angles=ONE, outputs=["coupler"], samples=20),
}


@pytest.mark.long_rows("contact")
@pytest.mark.mujoco
@pytest.mark.parametrize("name", RESULTS)
def test_a_result_says_one_of_a_thing_in_the_singular(name: str) -> None:
    result = RESULTS[name]()
    said = "\n".join(
        [repr(result), *(text for file, text in result.files().items() if file.endswith((".md", ".html")))]
    )
    assert re.search(r"\b1 (run|crank angle|output)\b", repr(result))
    assert OF_ONE.findall(said) == []


@pytest.mark.long_rows("validity")
@pytest.mark.mujoco
@pytest.mark.parametrize(
    "arguments",
    [
        ["cases"],
        ["--simulator", "mujoco", "--joint", "ideal", "--angles", "30:30:1", "--out", "out"],
        ["analyse", "--angles", "30:30:1", "--out", "out"],
        ["accuracy", "--angles", "30:30:1", "--samples", "20", "--output", "coupler", "--out", "out"],
        ["validity", "--speeds", "60", "--clearances", "1e-4", "--workers", "1", "--out", "out"],
    ],
    ids=lambda a: a[0],
)
def test_the_command_prints_one_of_a_thing_in_the_singular(arguments: list[str], tmp_path: Path) -> None:
    done = compare(*arguments, cwd=tmp_path)
    assert done.stdout, done.stderr
    assert OF_ONE.findall(done.stdout + done.stderr) == []

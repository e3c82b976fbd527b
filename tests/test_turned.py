"""Vectors that a file has in another frame than the ground's: read through ``frame``, told by what they look like."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest

import linkage_crosscheck as lc
from analytic.mechanism.columns import MapError
from analytic.mechanism.file import load
from compare.recorded.errors import DataError

M = load("slider-crank").replace(gravity=(0.0, -9.81))
SPEED = M.speed or 0.0
ANGLES = np.radians(np.arange(0.0, 360.0, 3.0))
SIGNALS = lc.analyse(M, angles=ANGLES, signals="all").signals
ROD = np.exp(1j * SIGNALS["rod_angle"])
X, Y = "reaction_A_x [N]", "reaction_A_y [N]"
Columns = Mapping[str, np.ndarray]


def frame(force: np.ndarray, **others: np.ndarray) -> Columns:
    """A file of the crank's angle, a force (N,) and other columns."""
    return {"time [s]": ANGLES / SPEED, "crank_angle [rad]": ANGLES, X: force.real, Y: force.imag, **others}


FORCE = SIGNALS["reaction_A_x"] + 1j * SIGNALS["reaction_A_y"]


def swapped(vector: np.ndarray) -> np.ndarray:
    return 1j * np.conj(vector)


def checked(columns: Columns, tmp_path: Path, written: str = "") -> lc.CrossCheck:
    """A file held to the linkage by a map that has these lines."""
    if not written:
        return lc.check({"site": columns}, M)
    (tmp_path / "map.toml").write_text(f"[columns]\n{written}\n", encoding="utf-8")
    return lc.check({"site": columns}, M, map=tmp_path / "map.toml")


MEANT: dict[str, tuple[Callable[[np.ndarray], np.ndarray], str]] = {
    "a cell on the rod": (lambda f: f / ROD, "it turns with body rod: say"),
    "a cell on the rod upside down": (
        lambda f: -f / ROD,
        "it turns with body rod, its x and y are of the other sign: say",
    ),
    "a cell on the rod across": (lambda f: swapped(f / ROD), "it turns with body rod, its x and y are swapped: say"),
    "a cell a quarter turn on": (lambda f: 1j * f, "its x and y are swapped, its x is of the other sign: say"),
    "axes swapped": (swapped, "its x and y are swapped: say"),
}


@pytest.mark.long_rows("a cell on the rod", "a cell on the rod upside down", "axes swapped")
@pytest.mark.parametrize("planted", MEANT)
def test_how_a_force_is_meant_is_told_with_the_lines_by_which_it_agrees(planted: str, tmp_path: Path) -> None:
    spoilt, words = MEANT[planted]
    columns = frame(spoilt(FORCE), **{"rod_angle [rad]": SIGNALS["rod_angle"]})
    found = checked(columns, tmp_path)
    (sentence,) = [each for each in found.warnings if "its size agrees" in each]
    assert found.verdict == "disagrees"
    assert f"site: reaction_A_x and _y: its size agrees; {words}" in sentence
    lines = sentence.partition(": say ")[2].removesuffix(" under [columns] of a map").replace(' and "', '\n"')
    assert checked(columns, tmp_path, lines).verdict == "agrees"


@pytest.mark.parametrize("angle_is_there", [True, False])
def test_a_body_is_turned_as_its_column_or_the_crank_says(angle_is_there: bool, tmp_path: Path) -> None:
    """Without the rod's angle it is where the linkage has it; the result has the force in the ground's frame."""
    lines = "\n".join(f'"{s} [N]" = {{ signal = "{s}", unit = "N", frame = "rod" }}' for s in (X[:-4], Y[:-4]))
    more = {"rod_angle [rad]": SIGNALS["rod_angle"]} if angle_is_there else {}
    run = checked(frame(FORCE / ROD, **more), tmp_path, lines).runs[0]
    assert run.verdict == "agrees"
    np.testing.assert_allclose(run.simulated["reaction_A_x"], FORCE.real, atol=1e-9 * np.abs(FORCE).max())


@pytest.mark.parametrize("body", ["ground", "rod"])
def test_a_cell_that_is_mounted_turned_is_told_as_two_sensors(body: str, tmp_path: Path) -> None:
    read = FORCE / (ROD if body == "rod" else 1) * np.exp(-1j * np.radians(20.0))
    found = checked(frame(read, **{"rod_angle [rad]": SIGNALS["rod_angle"]}), tmp_path)
    (sentence,) = [each for each in found.warnings if "its size agrees" in each]
    assert "it is mounted turned by 20 deg: give its columns as two [[sensor]]" in sentence
    axes = [tuple(map(float, each.split(","))) for each in re.findall(r"axis = \[([^]]*)\]", sentence)]
    cell = {"kind": "force", "body": "rod", "point": "A", "frame": body}
    assert f'body = "rod", point = "A", frame = "{body}"' in sentence
    m = M.replace(sensors=[cell | {"name": n, "axis": axis} for n, axis in zip(("fx", "fy"), axes, strict=True)])
    columns = {"time [s]": ANGLES / SPEED, "crank_angle [rad]": ANGLES, "fx [N]": read.real, "fy [N]": read.imag}
    assert lc.check({"site": columns}, m).verdict == "agrees"


@pytest.mark.long_rows("-1-one sample earlier")
@pytest.mark.parametrize(("by", "words"), [(-1, "one sample earlier"), (1, "one sample later")])
def test_a_column_that_is_a_row_off_is_told(by: int, words: str, tmp_path: Path) -> None:
    torque = np.roll(SIGNALS["drive_torque"], -by)
    found = checked(frame(FORCE, **{"drive_torque [N.m]": torque}), tmp_path)
    assert [each for each in found.warnings if "site: drive_torque: it agrees " + words in each]
    assert found.verdict == "disagrees"


def test_what_is_like_nothing_is_told_as_nothing(tmp_path: Path) -> None:
    wrong = FORCE * np.exp(0.3j * np.sin(2 * ANGLES))
    found = checked(frame(wrong, **{"drive_torque [N.m]": SIGNALS["drive_torque"]}), tmp_path)
    assert found.verdict == "disagrees"
    assert not [each for each in found.warnings if "its size agrees" in each or "one sample" in each]


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ({X: "wing", Y: "wing"}, "frame = 'wing' is no body; the bodies are ground, crank, rod, slider"),
        ({X: "rod", Y: "crank"}, "reaction_A_x has frame = 'rod' and reaction_A_y 'crank'"),
        (
            {"drive_torque [N.m]": "rod"},
            "turns x and y of a force, a velocity or an acceleration; leave it out of drive_tor",
        ),
        ({X: "rod", Y: ""}, "turns x and y together; give the column of reaction_A_y, too"),
    ],
)
def test_a_frame_that_turns_nothing_is_refused(lines: dict[str, str], message: str, tmp_path: Path) -> None:
    written = [
        f'"{h}" = {{ signal = "{h.split()[0]}", frame = "{body}" }}' if body else f'"{h}" = "ignore"'
        for h, body in lines.items()
    ]
    with pytest.raises(DataError, match=re.escape(message)):
        checked(frame(FORCE, **{"drive_torque [N.m]": SIGNALS["drive_torque"]}), tmp_path, "\n".join(written))


def test_a_load_has_no_frame(tmp_path: Path) -> None:
    line = f'"{X}" = {{ load = {{ body = "slider", force = [1.0, 0.0] }}, frame = "rod" }}'
    with pytest.raises(MapError, match="a column's load acts in the ground's frame; leave frame out"):
        checked(frame(FORCE), tmp_path, line)

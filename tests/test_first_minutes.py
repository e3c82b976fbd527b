"""The first minutes of an engineer who has nothing yet: a file to begin with, and what its tables may hold."""

from __future__ import annotations

import math
import re
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import linkage_crosscheck as lc
from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import kinematics
from analytic.mechanism.file import loads
from compare.cli.app import app
from compare.faults import ArgumentError
from compare.mechanism_fields import MEANS, PARTS
from compare.new import begun, new
from compare.questions.listing import KINDS, TABLES


def run(words: list[str], monkeypatch: pytest.MonkeyPatch) -> tuple[int, str, str]:
    monkeypatch.setattr(sys, "argv", ["compare", *words])
    done = CliRunner().invoke(app, words)
    return done.exit_code, done.stdout, done.stderr


@pytest.mark.parametrize("kind", KINDS)
def test_a_new_file_is_a_linkage_of_its_kind_and_keeps_its_comments(kind: str) -> None:
    text = new("mine", kind=kind)
    shipped_text = begun(kind).read_text("utf-8")
    shipped = loads(shipped_text)
    assert loads(text) == shipped.replace(name="mine")
    assert text.startswith(f"# mine, begun as a {kind}")
    beside = [line for line in shipped_text.splitlines() if "#" in line and not line.startswith("#")]
    assert all(line in text for line in beside)


def test_new_writes_a_file_that_the_next_command_shows_and_replaces_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["new", "press.toml", "--kind", "slider-crank"], monkeypatch)[:2] == (
        0,
        "written: press.toml; look at it with: compare press.toml\n",
    )
    assert run(["press.toml", "--quiet"], monkeypatch)[0] == 0
    mine = (tmp_path / "press.toml").read_bytes()
    status, _, said = run(["new", "press"], monkeypatch)
    assert (status, said) == (2, "compare: press.toml: it is there already; choose another name, or add --overwrite\n")
    assert (tmp_path / "press.toml").read_bytes() == mine
    assert run(["new", "press", "--overwrite"], monkeypatch)[0] == 0
    assert loads((tmp_path / "press.toml").read_text(encoding="utf-8")).name == "press"


def test_a_quick_return_swings_and_returns_as_its_two_lengths_say() -> None:
    """The lever stands at its ends where the crank is square to it: asin(r/c) to each side, the crank pi + 2 of it."""
    m, half = loads(new("shaper", kind="quick-return")), math.asin(80 / 240)
    ends = np.array([-half, math.pi + half])
    theta = np.sort(np.concatenate([ends, np.linspace(-half, 2 * math.pi - half, 400)]))
    motion = kinematics(Assembly(m), theta, np.full(theta.size, m.speed))
    np.testing.assert_allclose(np.ptp(motion.angle("lever")), 2 * half, rtol=1e-12)
    still = np.isin(theta, ends)
    np.testing.assert_allclose(motion.angular_velocity("lever")[still], 0.0, atol=1e-12)
    cutting = (theta > -half) & (theta < math.pi + half)
    assert np.all(motion.angular_velocity("lever")[cutting & ~still] > 0)
    assert (math.pi + 2 * half) / (math.pi - 2 * half) == pytest.approx(1.55, abs=0.003)


@pytest.mark.parametrize(
    "words", [["new", "x", "--kind", "swing"], ["--motion", "swing"], ["analyse", "--motion", "swing"]]
)
def test_a_word_that_is_none_of_an_option_s_is_refused_in_one_sentence(
    words: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    status, _, said = run(words, monkeypatch)
    assert status == 2
    assert re.search(rf"Invalid value for '{words[-2]}': 'swing' is not one of '[\w-]+', '[\w-]+'", said)


@pytest.mark.parametrize("words", [["ci"], ["--simulator", "mujoco", "--junit", "x.xml"], ["diagnose", "--junit", "x"]])
def test_who_looks_for_ci_is_told_where_it_is(
    words: list[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    status, _, said = run(words, monkeypatch)
    page = Path(__file__).parents[1] / re.search(r"docs/\S+\.md", said)[0]  # type: ignore[index]
    assert status == 2
    assert "junit.xml" in said
    assert "junit.xml" in page.read_text(encoding="utf-8")
    for command in ([], ["baseline", "check"], ["baseline", "update"]):
        assert "docs/how-to/ci.md" in " ".join(run([*command, "--help"], monkeypatch)[1].split())


@pytest.mark.parametrize("command", [["baseline", "update"], ["analyse"], ["accuracy"]])
def test_a_case_without_its_option_is_told_which(command: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    status, _, said = run([*command, "my-rig"], monkeypatch)
    assert status == 2
    assert "(my-rig); a linkage is named with --case" in said


@pytest.mark.parametrize("name", ["../up", "a b", "", "3d", "x\ny", 'x"'])
def test_a_name_that_is_no_file_s_is_refused(name: str) -> None:
    with pytest.raises(ArgumentError, match="begins with a letter"):
        new(name)


def test_every_field_is_listed_with_its_meaning() -> None:
    found = lc.fields()
    assert list(PARTS) == list(TABLES) == list(dict.fromkeys(f.table for f in found.fields))
    for table, part in PARTS.items():
        names = {f.alias or name for name, f in part.model_fields.items() if not f.exclude}
        assert {f.name for f in found.fields if f.table == table} == names
    assert all(field.means for field in found.fields)
    assert '"free" (released' in next(f.means for f in found.fields if (f.table, f.name) == ("drive", "speed"))
    for text in (found.to_json(), found._repr_html_(), found.to_csv()):
        assert not re.search(r"`|\*\*|\]\(|see below", text)
    known = {(part.__name__, f.alias or name) for part in PARTS.values() for name, f in part.model_fields.items()}
    assert set(MEANS) <= known  # no meaning of a field that is gone
    (clearance,) = (f for f in lc.fields("joint").fields if f.name == "clearance")
    assert (clearance.default, clearance.means) == ("0.0", "m, radial; prismatic: half the block's play")
    (mass,) = (f for f in lc.fields("body").fields if f.name == "mass")
    assert mass.default == "required"


def test_a_table_is_printed_by_name_and_another_word_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    status, said, _ = run(["fields", "joint"], monkeypatch)
    assert status == 0
    assert said.startswith("[[joint]]\n")
    assert "N.m (prismatic: N), constant Coulomb" in said
    assert "[[body]]" not in said
    every = run(["fields"], monkeypatch)[1]
    assert not [c for c in every if ord(c) > 126]
    assert not re.search(r"`|\*\*|\]\(", every)  # no Markdown
    status, _, why = run(["fields", "jiont"], monkeypatch)
    assert status == 2
    assert why.startswith("compare: jiont: no table of a mechanism file; they are mechanism, ground, body, joint,")

"""The committed validation report: whatever in it is no longer so is said, and so is what was not looked at."""

from __future__ import annotations

import copy
import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from analytic.mechanism.file import load, shipped_cases
from commands import evidence, without
from compare.faults import OptionError
from compare.judge.tolerances import load_tolerances
from compare.results.validity import Validity
from document_faults import faults
from sample_result import as_document, sample_result
from sim_models.engine import declared
from tests.evidence.pages.striking import beside
from tests.evidence.pages.validation import drawn, page
from tests.evidence.results.scoreboard import Scoreboard
from tests.evidence.results.validation import Validation, ValidationCheck
from tests.evidence.stored import other_versions, read, stale_page
from tests.evidence.validation.beside import diagnosed, maps, with_beside
from tests.evidence.validation.check import REMEDY, differences, looked_at, update_validation
from tests.evidence.validation.files import apart
from tests.evidence.validation.runs import DRAWN, cross_checks, first_order

REPORTS = Path(__file__).parents[1] / "reports"
CONTENT = json.loads((REPORTS / "validation.json").read_text(encoding="utf-8"))
STORED = read(Validation, REPORTS)


def changed(*path: Any, value: Any) -> dict[str, Any]:
    """The committed report's content with one value of another."""
    out = copy.deepcopy(CONTENT)
    here: Any = out
    for step in path[:-1]:
        here = here[step]
    here[path[-1]] = value
    return out


def only(*engines: str) -> Validation:
    """What is found where these engines are installed and no other."""
    return STORED.model_copy(
        update={
            "runs": tuple(run for run in STORED.runs if run.simulator in engines),
            "scales": tuple(row for row in STORED.scales if row.simulator in engines),
            "versions": {name: STORED.versions[name] for name in engines},
            "superposition": STORED.superposition if "exudyn" in engines else (),
            "in_engines": {
                case: tuple(row for row in rows if row.simulator in engines) for case, rows in STORED.in_engines.items()
            },
        }
    )


def test_the_committed_report_is_written_again_as_it_is() -> None:
    text = (REPORTS / "validation.json").read_text(encoding="utf-8")
    assert STORED.files()["validation.json"] == text


def test_the_committed_page_and_first_order_table_are_those_of_the_committed_numbers(tmp_path: Path) -> None:
    assert list(stale_page(REPORTS / "README.md", page(STORED), REMEDY)) == []
    assert list(differences(STORED, STORED.model_copy(update={"first_order": first_order()}))) == []
    edited = tmp_path / "README.md"
    edited.write_text(page(STORED).replace("7.1 deg", "6.1 deg"), encoding="utf-8")
    (line,) = stale_page(edited, page(STORED), REMEDY)
    assert line.startswith(f"{edited}: line {page(STORED).splitlines().index('| 10 mm | 7.1 deg | 31 % |') + 1} ")
    assert len(list(stale_page(tmp_path / "none.md", page(STORED), REMEDY))) == 1


def words(svg: str) -> list[str]:
    """The texts of a drawing, but for the numbers along its axes."""
    root = ElementTree.fromstring(svg)
    texts = ("".join(text.itertext()) for text in root.iter("{http://www.w3.org/2000/svg}text"))
    return [text for text in texts if re.search(r"[^\d.\u2212-]", text)]


@pytest.mark.parametrize("case", shipped_cases())
def test_the_committed_figures_are_labelled_as_they_are_drawn_today(case: str) -> None:
    """One engine is enough: it is one of the panels, and the linkage is the analytic side's."""
    ((_, _, check),) = cross_checks(("mujoco",), load_tolerances(), (case,), (DRAWN,))
    for name, drawing in drawn(check).items():
        stored = words((REPORTS / "figures" / f"{case}-{name}.svg").read_text(encoding="utf-8"))
        assert {word.removeprefix("mujoco, ") for word in words(drawing)} <= set(stored), name
        assert name != "linkage" or words(drawing) == stored


def test_the_picture_of_the_tutorial_is_that_of_the_report() -> None:
    shown = (REPORTS.parent / "docs" / "paper-linkage.svg").read_text(encoding="utf-8")
    assert words(shown) == words((REPORTS / "figures" / "paper-linkage.svg").read_text(encoding="utf-8"))
    assert "gaps drawn 2 times as large" in words(shown)[0]


def test_every_picture_that_the_page_shows_is_drawn() -> None:
    drawings = {f"figures/paper-{name}.svg" for name in drawn(as_document(sample_result("paper")))}
    assert drawings == {
        line.split("](")[1].rstrip(")") for line in page(STORED).splitlines() if "](figures/paper-" in line
    }


AT = {run.key: k for k, run in enumerate(STORED.runs)}
FIRST = AT["crank-rocker", "ideal, driven", "mujoco"]
TAMPERED: dict[str, tuple[tuple[Any, ...], Any, str]] = {
    "a verdict": (
        ("runs", FIRST, "verdict"),
        "disagrees",
        "crank-rocker, ideal, driven, mujoco: verdict was disagrees, is agrees",
    ),
    "a count": (("runs", FIRST, "signals"), 11, "signals was 11, is 12"),
    "a share that is absurd": (("runs", FIRST, "share"), 1e9, "was 1e+11 % (reaction_D_angle), is 1 %"),
    "a share that is too good": (
        ("runs", AT["crank-rocker", "spring-damper, static", "mujoco"], "share"),
        0.1,
        "was 10 %",
    ),
    "another signal": (("runs", FIRST, "closest"), "crank_angle", "was 1 % (crank_angle), is 1 % (reaction_D_angle)"),
    "a first-order angle": (("first_order", 0, "angle"), 99.0, "first_order, clearance 0.01: angle was 99, is 7.05585"),
    "its last printed digit": (("first_order", 2, "magnitude"), 0.00578, "magnitude was 0.00578, is 0.00572865"),
    "a clearance": (("first_order", 0, "clearance"), 0.02, "first_order, clearance 0.02: row is no longer there"),
    "a verdict at a scale": (("scales", 0, "verdict"), "disagrees", "was disagrees, is refused"),
    "superposition": (("superposition", 0, "equilibrium"), 0.0034, "equilibrium was 0.0034, is 0.00331615"),
    "a workspace": (
        ("workspaces", "3-rrr", 0, "first_order"),
        0.01,
        "workspaces, 3-rrr, holding 5: first_order was 0.01, is",
    ),
    "an engine along a spiral": (
        ("in_engines", "five-bar", 1, "equilibrium"),
        0.1,
        "five-bar in exudyn, driven, along a spiral: equilibrium was 0.1, is 0.015",
    ),
    "a platform on links that bend": (
        ("bent", 0, "off_worst"),
        0.1,
        "five-bar on links that bend, ideal joints: off_worst was 0.1, is 0.00064",
    ),
    "a file that is run as an engine": (
        ("carried", 0, "simulated"),
        0.5,
        "2r-arm exported from mujoco: simulated was 0.5, is",
    ),
    "wear of a pin that strikes": (
        ("struck", 0, "statistics", "wear", "value"),
        2.0,
        "crank-rocker by kelvin-voigt in equation, friction 0: wear was 2, is ",
    ),
    "a map of validity": (("maps", 0, "yielding"), 3, "map validity-crank-rocker: yielding was 3, is 96"),
    "rigs that rattle": (("diagnosed", 1, "named"), 35, "scoreboard crank-rocker: named was 35, is 36"),
    "where a published run ends": (
        ("ended", 1, "crank", "high"),
        71.0,
        "published, combined, 0.1 ms: crank was 122.76 to 71, is 122.76 to 122.76",
    ),
    "a published figure": (
        ("published", 0, "figures", 0, "apart", 0, "off"),
        9e-7,
        "Andrews' squeezer, seven angles, analytic, by its crank: was off by 9e-07, is off by 6.7e-10",
    ),
}


@pytest.mark.parametrize("case", TAMPERED)
def test_a_number_that_is_not_found_again_is_named(case: str) -> None:
    path, value, words = TAMPERED[case]
    said = list(differences(Validation.model_validate(changed(*path, value=value)), STORED))
    assert len(said) == (2 if case == "a clearance" else 1)
    assert any(words in line for line in said)


def test_a_published_figure_that_is_missed_is_named_whatever_is_stored() -> None:
    missed = Validation.model_validate(changed("published", 0, "figures", 1, "apart", 0, "off", value=2e-6))
    said = "Andrews' squeezer, seven rates, analytic, by its crank: is off by 2e-06, and 1e-06 is allowed"
    assert list(differences(missed, missed)) == [said]


@pytest.mark.parametrize("what", ["alone", "imported"])
def test_what_a_file_loses_is_named_whatever_is_stored(what: str) -> None:
    lost = Validation.model_validate(changed("carried", 0, what, value=2e-6))
    said = f"2r-arm exported from mujoco: {what} is off by 2e-06 of the largest value, and 1e-06 is allowed"
    assert list(differences(lost, lost)) == [said]


def test_what_a_file_makes_disagree_is_named_whatever_is_stored() -> None:
    odd = Validation.model_validate(changed("carried", 1, "checked", value=1.5))
    said = "2r-arm exported from exudyn: checked disagrees, with 1.5 of a tolerance"
    assert list(differences(odd, odd)) == [said]


def test_every_parallel_linkage_is_carried_in_files_of_every_engine_that_writes_them() -> None:
    several = [case for case in shipped_cases() if len(load(case).drives) > 1]
    can = [name for name in STORED.versions if declared(name).capabilities.export is not None]
    assert [(row.case, row.simulator) for row in STORED.carried] == [(case, name) for case in several for name in can]
    assert all(row.checked < 1.0 and (row.simulated or 0.0) < 1.0 for row in STORED.carried)


def test_a_table_that_differs_in_one_number_is_apart() -> None:
    table = {"drive_torque_A": np.array([1.0, -4.0]), "reaction_A_x": np.array([0.0, 1.0])}
    off = table | {"reaction_A_x": np.array([0.0, 1.5])}
    assert apart(table, table) == 0.0
    assert apart(off, table) == 0.5
    assert apart(off | {"drive_torque_A": np.array([3.0, -4.0])}, table) == 0.5  # 2 of 4
    assert apart(off | {"drive_torque_A": np.array([1.0, 4.0])}, table) == 2.0


def test_the_report_says_how_fast_it_is_beside_what_is_wanted() -> None:
    assert all(row.value <= row.wanted for row in STORED.speed if row.wanted is not None)
    assert {row.wanted for row in STORED.speed if row.unit == "us"} == {None, 10.0, 60.0}
    assert any("pylinkage" in row.what for row in STORED.speed)
    told = page(STORED).partition("## How fast it is")[2]
    sizes = [f"{row.value:g} {row.unit}" if row.unit else f"x {row.value:g}" for row in STORED.speed]
    assert all(f"| {row.what} | {size} |" in told for row, size in zip(STORED.speed, sizes, strict=True))


def test_every_published_figure_of_the_committed_report_is_met() -> None:
    assert [source.name for source in STORED.published] == [
        "Andrews' squeezer",
        "A parallel robot of two motors",
        "A block with play in its guide",
        "A ball-screw axis (EMPS)",
    ]
    assert all(apart.off <= apart.allowed for s in STORED.published for held in s.figures for apart in held.apart)


def test_maps_are_told_as_their_files_have_them() -> None:
    assert STORED.maps == tuple(maps(REPORTS))
    assert {"crank-rocker", "slider-crank", "paper"} <= {row.case for row in STORED.maps}
    for row in STORED.maps:
        said = " ".join(read(Validity, REPORTS / row.folder).words)
        cells = (
            f"predicts in {row.yielding} of {row.foretold} cells with the walls' give, and in {row.rigid} with rigid"
        )
        assert cells in said
        assert f"the same verdict in {row.same_verdict} of {row.both} cells" in said
        assert f"differ by at most {100 * row.free_share_spread:.2g} % of the cycle" in said
        assert f"[{row.case}]({row.folder}/validity.md) | B | mujoco, exudyn | {row.lost} of " in page(STORED)


def test_a_map_in_which_a_pin_leaves_after_all_is_told_otherwise(tmp_path: Path) -> None:
    content = json.loads((REPORTS / "validity-paper" / "validity.json").read_text(encoding="utf-8"))
    kept = [cell for cell in content["cells"] if not any(cell["free_share"].values())]
    cell = next(cell for cell in kept if cell["leaving"]["yielding"] is None)
    cell["free_share"]["B"] = 0.25
    (tmp_path / "validity-paper").mkdir()
    (tmp_path / "validity-paper" / "validity.json").write_text(json.dumps(content), encoding="utf-8")
    said = list(differences(STORED, STORED.model_copy(update={"maps": tuple(maps(tmp_path))})))
    assert [line for line in said if "validity-paper" in line] == [
        "map validity-paper: lost was 6, is 7",
        "map validity-paper: yielding was 92, is 91",
        "map validity-paper: rigid was 94, is 93",
    ]
    assert "map validity-slider-crank: is no longer there" in said


def test_rigs_that_rattle_are_counted_as_the_scoreboard_does(tmp_path: Path) -> None:
    assert STORED.diagnosed == tuple(diagnosed(REPORTS))
    board = read(Scoreboard, REPORTS / "scoreboard")
    every = STORED.diagnosed[-1]
    asked = {row.what: (row.count, row.of) for row in board.thresholds}
    assert asked["rattling: the joint named, or a tie with it"] == (every.named, every.loose)
    assert asked["still, sensors hum, spike or ring: no clearance named"] == (every.still - every.false, every.still)
    (line,) = [line for line in board.files()["README.md"].splitlines() if line.startswith("| sets in all |")]
    assert f"| {100 * every.size_off:.2g} % |" in line
    for name in ("loose", "named", "steady", "steady_named", "still", "false"):
        assert getattr(every, name) == sum(getattr(row, name) for row in STORED.diagnosed[:-1])
    k = next(k for k, r in enumerate(board.results) if r.kind == "still")
    mistaken = board.results[k].model_copy(update={"outcome": "false alarm"})
    other = board.model_copy(update={"results": (*board.results[:k], mistaken, *board.results[k + 1 :])})
    (tmp_path / "scoreboard").mkdir()
    (tmp_path / "scoreboard" / "scoreboard.json").write_text(other.to_json(), encoding="utf-8")
    said = list(differences(STORED, STORED.model_copy(update={"diagnosed": tuple(diagnosed(tmp_path))})))
    assert "scoreboard all: false was 0, is 1" in said
    assert len(said) == 2  # and of its linkage


def test_a_folder_without_maps_and_scoreboard_has_neither_table(tmp_path: Path) -> None:
    bare = with_beside(STORED, tmp_path)
    assert (bare.maps, bare.diagnosed) == ((), ())
    assert "Where contact is lost" not in page(bare)


def test_pins_that_strike_have_peak_over_ideal_wear_and_penetration() -> None:
    told = page(STORED)
    for row in STORED.struck:
        peak = row.statistics["peak_force"].value
        assert peak is not None
        assert row.ideal_peak is not None
        assert row.peak_ratio == pytest.approx(peak / row.ideal_peak)
        assert f" | {row.peak_ratio:.3g} | " in told
        wear, deep = row.statistics["wear"].value or 0.0, row.statistics["penetration"].value or 0.0
        assert wear > 0
        assert 0 < deep < row.clearance
        if row.friction:
            assert row.statistics["friction_loss"].value == pytest.approx(row.friction * wear, rel=2e-3)
    assert told.count("| over ideal |") == len({(row.case, row.friction) for row in STORED.struck})


def test_rough_blocks_are_in_the_report_where_engines_have_them() -> None:
    found = {(run.run, run.simulator): run.verdict for run in STORED.runs if ", friction " in run.run}
    assert found == {
        ("block flat in its guide, friction 0.2, contact, static", "mujoco"): "agrees",
        ("block flat in its guide, friction 0.2, contact, driven", "mujoco"): "agrees",
        ("block flat in its guide, friction 0.2, contact, driven", "exudyn"): "agrees",
        ("block across its guide, friction 0.2, contact, static", "mujoco"): "agrees",
    }


def test_published_ends_of_a_flying_block_are_out_of_reach_of_what_keeps_energy() -> None:
    theirs = [row for row in STORED.ended if row.by.startswith("published")]
    keeping = [row for row in STORED.ended if row.by.startswith(("steps that keep", "walls"))]
    assert len(theirs) == 2
    assert len(keeping) == 3
    for name in ("turns", "crank"):
        most = max(getattr(row, name).high for row in keeping)
        assert all(getattr(row, name).low > 1.05 * most for row in theirs)
    assert all(row.touched.low > 0.005 and row.gained.low > 0.1 for row in theirs)
    assert all(abs(row.touched.high) < 1e-4 and row.gained.high < 0.0 for row in keeping)
    told = page(STORED)
    assert "| published, direct | 0.1 ms | 1 | 3.054 | 119 |" in told
    assert "*combined*, ends here at 120.1 rad/s of the crank" in told
    assert "published are 122.8 rad/s of the crank, -56.54 rad/s of the rod and 66.8 % free." in told


def test_half_widths_are_told_to_two_digits_and_what_is_beside_them_as_far() -> None:
    assert beside(8736.4, 1234.5) == "8700 ± 1200"
    assert beside(509.2, 12.4) == "509 ± 12"
    assert beside(7.962, 0.996) == "8.0 ± 1.0"
    assert beside(0.62848, 0.0059) == "0.6285 ± 0.0059"
    assert beside(3.0, 0.0) == "3 ± 0"


def test_laws_of_contact_are_told_with_their_intervals() -> None:
    cases = ("crank-rocker", "slider-crank")
    assert [row.key for row in STORED.laws] == [(case, by) for by in ("exudyn", "equation") for case in cases]
    told = page(STORED).partition("### The law of contact found again")[2]
    for row in STORED.laws:
        assert row.parameters["friction"].covered
        rig, true = f"{row.case}, 0.5 mm in B, 18 revolutions", row.parameters["restitution"].true
        assert f"| {rig} | {row.recorded} | is | {true:g} |" in told
    missed = STORED.laws[0].parameters["friction"].model_copy(update={"low": 0.5, "high": 0.6})
    one = STORED.laws[0].model_copy(update={"parameters": {**STORED.laws[0].parameters, "friction": missed}})
    assert "(0.5 to 0.6)** |" in page(STORED.model_copy(update={"laws": (one,)}))


def test_an_update_keeps_what_it_does_not_make(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    copied(tmp_path)
    again = STORED.ended[2].model_copy(update={"starts": 7})
    bare = STORED.model_copy(update={"published": STORED.published[:1], "laws": (), "ended": (again,), "maps": ()})
    monkeypatch.setattr("tests.evidence.validation.check.run_all", lambda *_, **__: bare)
    update_validation(tmp_path)
    found = read(Validation, tmp_path)
    assert found.laws == STORED.laws
    assert [source.name for source in found.published] == [source.name for source in STORED.published]
    assert found.ended == (*STORED.ended[:2], again, *STORED.ended[3:])
    assert found.maps == STORED.maps


def test_real_contact_is_where_the_equilibrium_says_and_not_where_eq_8_does() -> None:
    """MuJoCo's contact hardly yields: what the equilibrium is off it is far less than what Eq. 8 is."""
    for case, rows in STORED.in_engines.items():
        (row,) = (row for row in rows if (row.simulator, row.motion) == ("mujoco", "driven"))
        assert row.equilibrium < row.first_order / 10, case
        (row,) = (row for row in rows if row.simulator == "pybullet")  # at rest, whose pins lie on massless rods
        assert row.equilibrium < row.first_order / 1e4, case


def test_what_is_rounding_may_differ() -> None:
    k = AT["paper", "ideal, driven", "dart"]
    assert STORED.runs[k].share < 1e-5
    rounded = changed("runs", k, "share", value=2e-6)
    rounded["runs"][k]["closest"] = "crank_angle"
    rounded["superposition"][0]["equilibrium"] += 1e-7
    assert list(differences(STORED, Validation.model_validate(rounded))) == []
    k = AT["crank-rocker", "ideal, driven", "exudyn"]
    assert list(differences(Validation.model_validate(changed("runs", k, "share", value=0.03)), STORED)) == []


def test_an_engine_that_is_not_here_is_said_to_be_left_out() -> None:
    scales = len(STORED.scales)
    assert looked_at(STORED, STORED) == (
        f"146 of 146 runs, {scales} of {scales} at scales, 4 of 4 published, first_order, workspaces and superposition"
        " made again",
        (),
    )
    done, left_out = looked_at(STORED, only("mujoco"))
    assert done == (
        f"42 of 146 runs, {scales // 28 * 8} of {scales} at scales, 4 of 4 published, first_order, workspaces made"
        " again"
    )
    assert "; ".join(left_out) == (
        "43 runs of exudyn; 31 runs of pybullet; 30 runs of dart; superposition, which takes exudyn"
    )
    assert list(differences(STORED, only("mujoco"))) == []
    assert list(other_versions(STORED.versions, {"mujoco": "5.0"}, "report")) == [
        "mujoco is 5.0 here, and the report was made with 4.0.0"
    ]


DAMAGE: dict[str, tuple[Callable[[str], str], str]] = {
    "cut off": (lambda text: text[: len(text) // 2], "cannot be read as JSON"),
    "a list": (lambda text: "[]", "holds a list"),
    "another schema": (lambda text: text.replace('"schema": 1', '"schema": 2'), "schema = 2"),
    "a share in words": (lambda text: text.replace('"share": 0.2', '"share": "much"', 1), "'much'"),
    "no runs": (lambda text: json.dumps(json.loads(text) | {"runs": []}), "runs = []"),
    "a row without its number": (lambda text: text.replace('"angle"', '"angel"', 1), "first_order[0].angle is missing"),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_a_damaged_report_is_refused_in_one_sentence(damage: str, tmp_path: Path) -> None:
    spoil, words = DAMAGE[damage]
    path = tmp_path / "validation.json"
    path.write_text(spoil((REPORTS / "validation.json").read_text(encoding="utf-8")), encoding="utf-8")
    with pytest.raises(OptionError) as caught:
        read(Validation, tmp_path)
    assert words in str(caught.value)
    assert "python -m tests.evidence validation update" in str(caught.value)
    assert "\n" not in str(caught.value)


def copied(folder: Path) -> None:
    """The committed report, with what is stored beside it."""
    beside = ("scoreboard/scoreboard.json", *(f"{row.folder}/validity.json" for row in STORED.maps))
    for name in ("README.md", "validation.json", *beside):
        (folder / name).parent.mkdir(exist_ok=True)
        shutil.copyfile(REPORTS / name, folder / name)


@pytest.mark.slow
def test_the_command_does_not_pass_for_engines_that_are_not_here(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The runs are those of the committed report; that they are made again is the command's own work."""
    copied(tmp_path)
    monkeypatch.setattr("tests.evidence.validation.check.run_all", lambda engines, *_, **__: only(*engines))
    with without("exudyn", "pybullet", "dartpy"):
        done = evidence("validation", "check", "--reports", ".", cwd=tmp_path)
    assert done.returncode == 3, done.stdout + done.stderr
    assert done.stdout.startswith("42 of 146 runs, ")
    assert done.stdout.endswith("; 0 differ from validation.json\n")
    assert "not looked at: 43 runs of exudyn; 31 runs of pybullet; 30 runs of dart" in done.stderr


@pytest.mark.mujoco
def test_the_command_says_what_is_not_found_again_and_leaves_with_status_1(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The runs themselves are those of the committed report: that they are made again is another test's."""
    copied(tmp_path)
    tampered = changed("runs", FIRST, "share", value=1e9) | {
        "first_order": changed("first_order", 0, "angle", value=99.0)["first_order"]
    }
    (tmp_path / "validation.json").write_text(json.dumps(tampered), encoding="utf-8")
    asked = []
    monkeypatch.setattr(
        "tests.evidence.validation.check.run_all", lambda engines, *_, **__: asked.append(engines) or only("mujoco")
    )
    done = evidence("validation", "check", "--reports", ".", "--simulator", "mujoco", cwd=tmp_path)
    assert asked == [("mujoco",)]
    assert done.returncode == 1, done.stdout + done.stderr
    page_line, run_line, table_line, summary = done.stdout.splitlines()
    assert page_line.startswith("README.md: line ")
    assert run_line.startswith("crank-rocker, ideal, driven, mujoco: largest share")
    assert table_line.startswith("first_order, clearance 0.01: angle was 99")
    assert summary.endswith("; 3 differ from validation.json")
    told = evidence("validation", "check", "--reports", ".", "--simulator", "mujoco", "--json", cwd=tmp_path)
    content = json.loads(told.stdout)
    assert faults(ValidationCheck, content) == []
    assert content["differences"] == [page_line, run_line, table_line]


def test_a_folder_of_data_that_is_not_there_is_refused(tmp_path: Path) -> None:
    done = evidence("validation", "check", "--data", "nowhere", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "compare: --data nowhere: there is no such folder\n"
    done = evidence("validation", "check", "--data", ".", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert "has none of adams-parallel-robot, emps" in done.stderr

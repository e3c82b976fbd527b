"""Every result of the Python interface: one line, a table, a picture, files, and its JSON as its schema says."""

from __future__ import annotations

import inspect
import json
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from IPython.core.formatters import DisplayFormatter

import linkage_crosscheck as lc
import sample_diagnosis
from compare.diagnose.data.recording import Measured
from compare.presentation import PRESENTATIONS
from compare.results.crosscheck import CrossCheck
from compare.results.document import Document, DocumentError
from compare.results.schemas import documents
from document_faults import faults
from tests.evidence.results.scoreboard import Scoreboard
from tests.evidence.results.validation import Validation

REPORTS = Path(__file__).parents[1] / "reports"
ANGLES = np.radians([20.0, 90.0, 160.0])


@cache
def crosscheck() -> CrossCheck:
    """The example of the contract."""
    return lc.crosscheck("paper", simulator="mujoco", clearance={"B": 1e-4}, angles=ANGLES)


RESULTS: dict[str, Callable[[], Document]] = {
    "crosscheck": crosscheck,
    "analyse": lambda: lc.analyse("paper", clearance={"B": 1e-4}, angles=ANGLES),
    "simulate": lambda: lc.simulate("paper", "mujoco", joint_model="contact", angles=ANGLES),
    "accuracy": lambda: lc.accuracy("paper", angles=ANGLES, samples=100),
    "validity": lambda: lc.validity("paper", speeds=[1.0], clearances=[1e-4], revolutions=0, workers=1),
    "diagnose": lambda: sample_diagnosis.as_document(sample_diagnosis.sample_diagnosis(samples=37)),
    "show a number": lambda: lc.show(crosscheck(), "reaction_B_angle", at=ANGLES[1]),
    "show residuals": lambda: lc.show(RESULTS["diagnose"](), "follower_angle"),
    "check_baselines": lambda: lc.check_baselines("pendulum", "mujoco", REPORTS / "baselines"),
    "validation": lambda: Validation.read(REPORTS / "validation.json"),
    "scoreboard": lambda: Scoreboard.read(REPORTS / "scoreboard" / "scoreboard.json"),
    "cases": lc.cases,
    "simulators": lc.simulators,
    "effects": lc.effects,
    "runs": lambda: lc.runs(REPORTS),
}
LISTS = ("provenance", "baselines", "cases", "simulators", "effects", "runs")


@pytest.fixture(scope="module", params=RESULTS)
def result(request: pytest.FixtureRequest) -> Document:
    return RESULTS[request.param]()


def test_a_result_is_one_line_and_frozen(result: Document) -> None:
    assert len(repr(result)) <= 300
    assert "\n" not in repr(result)
    assert str(result) == repr(result)
    with pytest.raises(ValueError, match="frozen"):
        result.format = 2


def test_a_result_is_html_in_a_notebook_and_a_table_in_pandas(result: Document) -> None:
    page = result._repr_html_()
    assert page.count("<table") == page.count("</table>")
    assert "<table" in page or "95 % interval" in page  # a diagnosis has a card for each effect
    frame = result.to_dataframe()
    assert len(frame) == len(result.rows()) > 0
    head, *rows = result.to_csv().splitlines()
    assert len(rows) == len(frame)
    assert [name.split(" [")[0] for name in head.split(",")] == list(frame.columns)


@pytest.mark.long_rows(
    "validation", "accuracy", "scoreboard", "show residuals", "diagnose", "crosscheck", "simulate", "analyse",
    "validity",
)  # fmt: skip
def test_a_result_is_plotted_or_says_that_a_list_has_no_picture(result: Document, tmp_path: Path) -> None:
    if type(result).__name__.lower() in LISTS:
        with pytest.raises(TypeError, match="no picture"):
            result.plot()
        return
    figure = result.plot()
    figure.savefig(tmp_path / "picture.png")
    assert (tmp_path / "picture.png").stat().st_size > 5000
    assert len(figure.axes) <= 12
    for axis in figure.axes:
        assert len({line.get_label() for line in axis.lines if not line.get_label().startswith("_")}) <= 6
        legend = axis.get_legend()  # beside the data
        assert legend is None or legend.get_window_extent().x0 >= axis.get_window_extent().x1
    shown, _ = DisplayFormatter().format(figure)  # in a notebook in which nothing was switched on
    assert shown["image/png"].startswith(b"\x89PNG")
    assert len(shown["image/png"]) > 5000


@pytest.mark.long_rows("scoreboard", "validation")
def test_a_result_is_written_read_again_and_as_its_schema_says(result: Document, tmp_path: Path) -> None:
    folder = result.write(tmp_path / "new" / "folder")
    assert {path.name for path in folder.iterdir()} == set(result.files())
    content = json.loads((folder / result.file).read_text(encoding="utf-8"))
    assert content == json.loads(result.to_json())
    assert faults(type(result), content) == []
    assert type(result).read(folder / result.file).to_json() == result.to_json()


def test_a_file_that_is_another_document_is_refused_with_field_and_remedy(result: Document, tmp_path: Path) -> None:
    (tmp_path / "other.json").write_text('{"schema": 1, "case": "paper"}', encoding="utf-8")
    with pytest.raises(DocumentError, match=r"other\.json: .* is missing; add it; (give|restore)"):
        type(result).read(tmp_path / "other.json")


def test_every_kind_of_document_is_shown() -> None:
    kinds = documents().values()
    assert not [kind for kind in kinds if not {base.__name__ for base in kind.__mro__} & set(PRESENTATIONS)]
    assert not set(PRESENTATIONS) - {base.__name__ for kind in (*kinds, Measured) for base in kind.__mro__}


@pytest.mark.parametrize("name", lc.__all__)
def test_every_name_is_there_and_documented(name: str) -> None:
    found = getattr(lc, name)
    assert inspect.getdoc(found)


def test_importing_it_imports_nothing_heavy() -> None:
    heavy = "{'numpy', 'pydantic', 'scipy', 'mujoco'} & set(sys.modules)"
    run = f"import sys, linkage_crosscheck as lc; assert not {heavy}, {heavy}; print(lc.__version__)"
    done = subprocess.run([sys.executable, "-c", run], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.strip()


def test_an_unknown_name_says_what_there_is() -> None:
    with pytest.raises(AttributeError, match="it has Body, Drive"):
        _ = lc.nothing


def test_both_sides_of_the_contracts_example() -> None:
    found = crosscheck()
    assert found.verdict == "agrees"
    run = found.run("mujoco", "contact")
    np.testing.assert_allclose(run.simulated["reaction_B_angle"], run.analytic["reaction_B_angle"], atol=1e-4)
    assert run.difference(found.signals["reaction_B_angle"]).shape == (3,)
    with pytest.raises(KeyError, match="no run of exudyn"):
        found.run("exudyn")


def test_measured_data_are_one_line_a_table_and_a_frame() -> None:
    found = lc.read_measured(Path(__file__).parents[1] / "docs" / "example-rig" / "measured.toml")
    for part in (found, found.runs[0], found.runs[0].channels["follower_angle"]):
        assert len(repr(part)) < 200
        assert "\n" not in repr(part)
    frame = found.to_dataframe()
    assert list(frame.columns) == ["run", "time", *found.runs[0].channels]
    assert len(frame) == sum(run.time.size for run in found.runs)
    assert frame["follower_angle"][0] == found.runs[0].channels["follower_angle"].values[0]
    assert found._repr_html_().count("<tr>") == 1 + sum(len(run.channels) for run in found.runs)


def test_a_diagnosis_of_a_file_is_that_of_its_recording(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is asked for in Python reaches the diagnosis, of a path as of the recording of it."""
    from compare.diagnose import workflow
    from compare.diagnose.problem import Options

    asked: list[tuple[object, ...]] = []

    class Stop(Exception):
        pass

    def of(*given: object) -> None:
        asked.append(given)
        raise Stop

    monkeypatch.setattr(workflow.Problem, "of", of)
    path = Path(__file__).parents[1] / "docs" / "example-rig"
    for measured in (path, str(path / "measured.toml"), lc.read_measured(path)):
        with pytest.raises(Stop):
            lc.diagnose(measured, only=["gravity"], others=False, workers=1)
    for data, mechanism, options in asked:
        assert isinstance(data, lc.read_measured(path).__class__)
        assert mechanism == data.mechanism.rigid()
        assert isinstance(options, Options)
        assert options == Options(
            "mujoco",
            only=("gravity",),
            others=False,
            workers=1,
            began=options.began,
            progress=options.progress,
        )
    assert len(asked) == 3

"""The documentation's site: what it generates from the code is complete, and it needs no network."""

from __future__ import annotations

import inspect
import json
import re
import subprocess
import sys
from html.parser import HTMLParser
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from typer.testing import CliRunner

import shared
from analytic.mechanism import signals
from analytic.mechanism.file import load, shipped_cases
from compare.cli.app import app
from compare.diagnose.effects.vocabulary import VOCABULARY

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
pytest.importorskip("mkdocs", reason="the documentation's tools are not installed: pip install '.[docs]'")


@pytest.fixture(scope="module")
def reference() -> ModuleType:
    """The module that reads the reference pages from the code."""
    sys.path.insert(0, str(DOCS / "generate"))
    try:
        import docstrings  # noqa: F401 - which it imports when it is asked for a docstring
        import reference
    finally:
        sys.path.pop(0)
    return reference


def cells(table: str) -> list[list[str]]:
    """The rows of a Markdown table."""
    lines = [line for line in table.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in lines[2:]]


def test_every_page_asks_only_for_what_can_be_generated(reference: ModuleType) -> None:
    asked = {
        name
        for page in DOCS.rglob("*.md")
        for name in re.findall(r"^<!-- generate: ([\w-]+) -->$", page.read_text(encoding="utf-8"), re.MULTILINE)
    }
    assert asked == set(reference.CONTENTS)


@pytest.mark.long_rows("reference/mechanism-file.md")
@pytest.mark.parametrize("page", sorted(path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md")))
def test_what_is_made_from_the_code_is_committed_as_it_is_made(page: str, reference: ModuleType) -> None:
    text = (DOCS / page).read_text(encoding="utf-8")
    assert text == reference.written(text), "run python docs/generate/reference.py"


def test_a_browser_of_the_repository_shows_what_is_made_from_the_code(reference: ModuleType) -> None:
    """Neither a directive nor an anchor that only the site can show, no tag that a browser would swallow, and the
    tables of fields, signals and functions in full.
    """
    pages = {path: path.read_text(encoding="utf-8") for path in DOCS.rglob("*.md")}
    blocks = [block for text in pages.values() for block in reference.BLOCK.finditer(text)]
    assert len(blocks) == len(reference.CONTENTS)
    for block in blocks:
        text = re.sub(r"(?s)```.*?```|`[^`\n]*`|<code>.*?</code>", "", block[0])
        assert not re.findall(r"(?m)^::: |\{ #|<(?!!--)\w+>", text), block[1]
        assert len(block[0].splitlines()) > 4 or block[1] == "example-engine", block[1]
    fields = (DOCS / "reference" / "mechanism-file.md").read_text(encoding="utf-8")
    assert "| `clearance` | `0.0` |" in fields
    assert "### lc.crosscheck\n" in (DOCS / "reference" / "python.md").read_text(encoding="utf-8")


def test_text_made_anew_takes_the_place_of_what_stood_there_and_of_nothing_else(reference: ModuleType) -> None:
    page = "before\n<!-- generate: cases -->\nold\n<!-- end: cases -->\nbetween\n<!-- generate: decisions -->\nafter\n"
    once = reference.written(page)
    assert once == reference.written(once)
    assert "\nold\n" not in once
    for words in ("before\n<!--", "-->\nbetween\n", "-->\nafter\n", "| `six-bar` |"):
        assert once.count(words) == 1, words


def test_every_option_of_every_command_is_there(reference: ModuleType) -> None:
    text = reference.commands()
    sections = re.split(r"(?m)^## ", text)[1:]
    assert len(sections) >= 15
    for section in sections:
        _, *words = section.splitlines()[0].split()
        help_ = CliRunner().invoke(app, [*words, "--help"], terminal_width=200)
        assert help_.exit_code == 0
        for option in set(re.findall(r"(?m)^  (--[\w-]+)", help_.stdout)) - {"--help"}:
            assert f"<code>{option}" in section, f"{words}: {option}"


def test_every_field_of_every_schema_is_there(reference: ModuleType) -> None:
    text = reference.schemas()

    def names(node: object) -> set[str]:
        if isinstance(node, list):
            return {name for one in node for name in names(one)}
        if not isinstance(node, dict):
            return set()
        own = set(node["properties"]) if isinstance(node.get("properties"), dict) else set()
        return own | {name for one in node.values() for name in names(one)}

    for file, schema in reference.schema_files().items():
        section = re.search(rf"(?ms)^## {re.escape(file)}\n(.*?)(?=^## |\Z)", text)
        assert section is not None
        for name in names(schema):
            assert re.search(rf"[`.\]]{re.escape(name)}`", section[1]), f"{file}: {name}"


def test_the_vocabulary_is_the_code_s(reference: ModuleType) -> None:
    found = cells(reference.effects())
    assert [row[0].strip("`") for row in found] == list(VOCABULARY)
    for row, effect in zip(found, VOCABULARY.values(), strict=True):
        assert row[1] == effect.place
        assert row[2].endswith("tried only where `--only` names it") == effect.asked_for
        for parameter in effect.parameters:
            assert f"{parameter.name} ({parameter.unit or 'of the signal'})" in row[3].replace("\\", "")


def test_every_field_of_a_mechanism_file_is_there_with_its_meaning(reference: ModuleType) -> None:
    text = reference.mechanism_file()
    found = {row[0].strip("`"): row for row in cells(text)}
    for part in ("body", "joint", "load", "drive"):
        example = json.loads(json.dumps(load("paper").model_dump(by_alias=True)))[part]
        for field in example[0] if isinstance(example, list) else example:
            assert f"| `{field}` |" in text
    assert all(meaning for _, _, meaning in cells(text)), [row for row in cells(text) if not row[2]]
    assert found["clearance"][1] == "`0.0`"


def test_every_signal_of_every_case_is_there(reference: ModuleType) -> None:
    listed = {row[0].strip("`") for row in cells(reference.signals())}
    for case in shipped_cases():
        linkage = load(case)
        for signal in signals.signals(linkage.bodies, linkage.joints, linkage.drives, linkage.sensors):
            place = "<joint>" if signal.of_joint else "<body>"
            forms = {signal.name}
            if signal.place:
                head, _, tail = signal.name.rpartition(f"_{signal.place}")
                forms = {f"{head}_{place}{tail}", signal.name.replace(signal.place, place, 1)}
            assert forms & listed, signal.name


def test_the_numbers_that_decide_are_found(reference: ModuleType) -> None:
    found = cells(reference.decisions())
    assert len(found) == len(reference.DECISIONS)
    assert all(float(value) > 0 for _, value, _ in found)


# ---------------------------------------------------------------- the notebook

NOTEBOOK = DOCS / "tutorial" / "python.ipynb"


def code_cells() -> list[dict[str, Any]]:
    """The notebook's cells of code."""
    cells: list[dict[str, Any]] = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    return [cell for cell in cells if cell["cell_type"] == "code"]


def test_the_notebook_needs_nothing_of_the_project_but_its_way_in() -> None:
    text = "\n".join("".join(cell["source"]) for cell in code_cells())
    imported = re.findall(r"(?m)^(?:import|from) (\w+)", text)
    assert "linkage_crosscheck" in imported
    assert set(imported) <= {"linkage_crosscheck", "numpy", *sys.stdlib_module_names}


def test_the_notebook_is_committed_without_outputs() -> None:
    assert all(not cell["outputs"] and cell["execution_count"] is None for cell in code_cells())


@pytest.mark.slow
def test_the_notebook_runs_and_shows_the_paper_s_number() -> None:
    sys.path.insert(0, str(DOCS / "generate"))
    try:
        import notebook
    finally:
        sys.path.pop(0)
    shown = notebook.page(NOTEBOOK)
    assert "first_order  (0.0087, 0.0050) m" in shown  # as printed in section 4
    assert "equilibrium  (0.0082, 0.0057) m" in shown
    assert "paper in mujoco: agrees" in shown
    plotted = [cell for cell in code_cells() if re.search(r"\bplot(_orbit)?\(", "".join(cell["source"]))]
    assert shown.count("data:image/png;base64,") == len(plotted) > 1


# ---------------------------------------------------------------- the site


class Loaded(HTMLParser):
    """What a browser would fetch for a page by itself."""

    def __init__(self) -> None:
        super().__init__()
        self.urls: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note what the tag loads."""
        given = dict(attrs)
        if tag in ("script", "img", "iframe", "source", "video", "audio", "embed"):
            self.urls.append(given.get("src") or "")
        if tag == "link" and given.get("rel") not in ("canonical", "prev", "next"):
            self.urls.append(given.get("href") or "")


def built() -> str:
    """The folder of the site, built as CI builds it: any warning is an error."""
    folder = shared.FOLDER / "site"
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return str(folder)


@pytest.fixture(scope="module")
def site() -> Path:
    """The site, built once for all workers."""
    return Path(shared.document("site", built))


@pytest.mark.slow
def test_the_site_loads_nothing_from_elsewhere(site: Path) -> None:
    pages = sorted(site.rglob("*.html"))
    assert len(pages) > 40
    for page in pages:
        parser = Loaded()
        parser.feed(page.read_text(encoding="utf-8"))
        assert [url for url in parser.urls if re.match(r"(\w+:)?//", url)] == [], page
    for sheet in site.rglob("*.css"):
        assert not re.findall(r"(?:@import|url\()\s*[\"']?(?:https?:)?//", sheet.read_text(encoding="utf-8")), sheet


@pytest.mark.slow
def test_the_site_shows_the_paper_s_fourteen_equations(site: Path) -> None:
    text = (site / "theory" / "paper.html").read_text(encoding="utf-8")
    assert re.findall(r'<span class="number">\((\d+)\)</span>', text) == [str(n) for n in range(1, 15)]
    assert text.count("<math") == 14
    assert "\\begin" not in text


@pytest.mark.slow
def test_every_public_function_of_the_paper_s_package_has_a_section(site: Path, reference: ModuleType) -> None:
    text = (site / "reference" / "analytic-paper.html").read_text(encoding="utf-8")
    modules = [import_module(name) for name in reference.public_modules("analytic.paper")]
    functions = [
        f"{module.__name__}.{name}"
        for module in modules
        for name, found in vars(module).items()
        if inspect.isfunction(found) and found.__module__ == module.__name__ and not name.startswith("_")
    ]
    assert len(functions) > 20
    assert [name for name in functions if f'id="{name}"' not in text] == []


@pytest.mark.slow
def test_the_site_shows_no_leftovers(site: Path) -> None:
    """Neither what a page asks to be generated, nor the markup of docstrings."""
    for page in site.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        assert "generate:" not in text, page
        assert not re.search(r":(?:class|func|meth|mod):", text), page

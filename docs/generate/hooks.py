"""What the site has beside the Markdown files of this folder: reference pages read from the code, the notebook with its
outputs, the repository's own reports, equations without scripts, and links from names of modules to their reference.
"""

from __future__ import annotations

import posixpath
import re
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

import notebook  # noqa: E402 - both are beside this file
import reference  # noqa: E402

EQUATION = re.compile(r"^```math\n(.*?)^```$", re.MULTILINE | re.DOTALL)
TAG = re.compile(r"\s*\\tag\{(.*?)\}")
LINK = re.compile(r"(\]\()([^)\s#]+)((?:#[^)]*)?\))")
FENCE = re.compile(r"(^```.*?^```$)", re.MULTILINE | re.DOTALL)
NAME = re.compile(r"(?<![\[`])`((?:analytic|sim_models|compare|linkage_crosscheck)(?:\.\w+)+)`(?![\]`])")
NOTEBOOK = "tutorial/python.ipynb"
# Pages of the repository that are not in this folder, and where the site has them.
OUTSIDE = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "CITATION.cff": "CITATION.cff",
    "sim_models/CONVENTIONS.md": "reference/conventions.md",
    "reports/README.md": "evidence/validation.md",
    "reports/scoreboard/README.md": "evidence/scoreboard.md",
    "reports/trust.md": "evidence/trust.md",
    "reports/accelerometers.md": "evidence/accelerometers.md",
    "reports/validity-paper/validity.md": "evidence/validity-paper.md",
    "reports/validity-crank-rocker/validity.md": "evidence/validity-crank-rocker.md",
    "reports/validity-crank-rocker-loaded/validity.md": "evidence/validity-crank-rocker-loaded.md",
    "reports/validity-slider-crank/validity.md": "evidence/validity-slider-crank.md",
}
PICTURES = ("reports/figures/*.svg", "reports/scoreboard/*.svg", "reports/validity-*/*.svg")


def _places() -> dict[str, str]:
    """Where the site has each file of the repository that is outside this folder."""
    pictures = {path.relative_to(ROOT).as_posix() for pattern in PICTURES for path in ROOT.glob(pattern)}
    return OUTSIDE | {name: "evidence/" + name.removeprefix("reports/") for name in pictures}


FILES = _places()
SOURCES = {site: source for source, site in FILES.items()}
PLACES = FILES | {f"docs/{NOTEBOOK}": "tutorial/python.md"}  # a link to the notebook leads to its page
_made: list[str] = []  # folders to be removed when the site is built


def on_files(files: Files, config: Any, **_: Any) -> Files:
    """Add what is not in this folder."""
    for source, site in FILES.items():
        files.append(File.generated(config, site, abs_src_path=str(ROOT / source)))
    folder = tempfile.mkdtemp()
    _made.append(folder)
    page = Path(folder) / "python.md"
    page.write_text(notebook.page(Path(config.docs_dir) / NOTEBOOK), encoding="utf-8")
    files.append(File.generated(config, "tutorial/python.md", abs_src_path=str(page)))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Fill in what is generated, turn equations into MathML, and mend links that leave this folder."""
    site = page.file.src_uri
    markdown = reference.BLOCK.sub(lambda found: reference.CONTENTS[found[1]](), markdown)
    markdown = EQUATION.sub(lambda found: mathml(found[1]), markdown)
    parts = FENCE.split(markdown)
    parts[::2] = [linked(text, site) for text in parts[::2]]
    return "".join(parts)


def on_post_build(**_: Any) -> None:
    """Remove what was made on the way."""
    while _made:
        shutil.rmtree(_made.pop())


def mathml(latex: str) -> str:
    """An equation, numbered where it has a ``\\tag``, as MathML."""
    tag = TAG.search(latex)
    number = f'<span class="number">({tag[1]})</span>' if tag else ""
    plain = TAG.sub("", latex).strip()
    plain = plain.replace(r"\begin{aligned}", r"\begin{array}{rl}").replace(r"\end{aligned}", r"\end{array}")
    return f'<div class="equation">{convert(plain, display="block")}{number}</div>'


def linked(text: str, site: str) -> str:
    """Text of a page with its links to files of the repository as the site has them, and names of modules linked."""
    here = posixpath.dirname(SOURCES.get(site, f"docs/{site}"))

    def target(found: re.Match[str]) -> str:
        if "://" in found[2] or found[2].startswith("mailto:"):
            return found[0]
        goal = posixpath.normpath(posixpath.join(here, found[2]))
        on_site = PLACES.get(goal) or (goal.removeprefix("docs/") if goal.startswith("docs/") else None)
        if on_site is None:
            return found[0]
        return found[1] + posixpath.relpath(on_site, posixpath.dirname(site) or ".") + found[3]

    return NAME.sub(_reference, LINK.sub(target, text))


def _reference(found: re.Match[str]) -> str:
    name = found[1]
    known = any(name == module or name.startswith(f"{module}.") for module in reference.documented())
    return f"[`{name}`][{name}]" if known else found[0]

"""Pages: lists of sections, each a template with what it is filled with, in one file that needs no network."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib import resources
from itertools import count

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from analytic.mechanism.one_line import capital
from compare.files import escape_markdown
from compare.quantities import number, plain, plainly, setting
from compare.report.figure import Figure

LEFT_OUT = "left out: "  # how a warning of what a question does not use begins
SCROLLED = re.compile(r'(<div class="scroll"[^>]*>\s*<table\b.*?</thead>)(.*?</table>)', re.DOTALL)
CELL = re.compile(r"<t[dh]\b([^>]*)>(.*?)</t[dh]>", re.DOTALL)  # of a table: its attributes, and what stands in it
PHONE, BETWEEN, LEAST_TEXT = 54, 1, 20  # characters: across a phone, between columns, and of a column that has words


def code_block(text: str, language: str = "sh") -> str:
    """A code block whose fence is longer than any run of backticks in it."""
    fence = "`" * max(3, 1 + max((len(run) for run in re.findall("`+", text)), default=0))
    return f"{fence}{language}\n{text}\n{fence}"


def markdown_table(
    heads: Sequence[str], rows: Iterable[Sequence[str]], right: Collection[int] = (), *, numbered: bool = False
) -> str:
    """A table in Markdown with a line break at its end: columns of these numbers are aligned to the ``right``, and rows
    are ``numbered`` from 1 on request.
    """
    rule = ["--:" if i in right else "---" for i in range(len(heads))]
    cells = ([*[str(i)] * numbered, *map(escape_markdown, row)] for i, row in enumerate(rows, 1))
    return "".join("| " + " | ".join(line) + " |\n" for line in (heads, rule, *cells))


ENVIRONMENT = Environment(
    loader=PackageLoader("compare.report"),
    autoescape=lambda name: name is not None and name.endswith(".html.j2"),
    undefined=StrictUndefined,
    keep_trailing_newline=True,
)
ENVIRONMENT.globals["table"] = markdown_table
ENVIRONMENT.tests["numeric"] = re.compile(r"[-+]?[.\d]+(e[-+]?\d+)?( %)?|-").fullmatch
ENVIRONMENT.filters |= {
    "capital": capital,
    "degrees": lambda angle: f"{plain(math.degrees(angle), 4)} deg",
    "md": escape_markdown,
    "md_code": code_block,
    "number": number,
    "plainly": plainly,
    "setting": setting,
    "signed": lambda value: number(value, 3, True),
}


@dataclass(frozen=True)
class PageSection:
    """A part of a page: its template, and what that is filled with."""

    template: str
    context: Mapping[str, object]

    @property
    def name(self) -> str:
        """Its template's name, which is what a link of the page calls it."""
        return self.template.rpartition("/")[2].partition(".")[0]

    def text(self) -> str:
        """What the page shows."""
        return ENVIRONMENT.get_template(self.template).render(self.context)


def markdown(section: PageSection) -> str:
    """A whole text in Markdown, without the empty lines that a template leaves."""
    return re.sub(r"\n{3,}", "\n\n", section.text()).rstrip("\n") + "\n"


def figures_context(
    figures: Sequence[Figure], drawings: Mapping[str, str], elsewhere: Collection[str] = ()
) -> dict[str, object]:
    """What the sections of a page show figures with: their drawings and files' stems by name, their places in the
    page's data, and those that do not stand in the section of figures.
    """
    return {
        "figures": list(figures),
        "drawings": {figure.name: Markup(drawings[figure.name]) for figure in figures},
        "stems": {figure.name: stem(figure.name) for figure in figures},
        "numbered": {figure.name: k for k, figure in enumerate(figures)},
        "elsewhere": elsewhere,
    }


def stem(name: str) -> str:
    """A figure's name as a file's."""
    return re.sub(r"[^A-Za-z0-9_-]", "_", name)


def warnings_context(warnings: Iterable[str]) -> dict[str, list[str]]:
    """Warnings, and apart from them what was left out, which stands at the end of a page."""
    texts = list(warnings)
    left_out = [text.removeprefix(LEFT_OUT) for text in texts if text.startswith(LEFT_OUT)]
    return {"warnings": [text for text in texts if not text.startswith(LEFT_OUT)], "left_out": left_out}


@dataclass(frozen=True)
class Script:
    """What makes a page move: its scripts by name, and the data that they read."""

    names: Sequence[str]
    data: object


def charts(figures: Iterable[Figure], motion: object = None) -> Script:
    """What draws the figures of a page, and moves its linkage."""
    data = {"figures": [asdict(figure) for figure in figures], "motion": motion}
    return Script(("chart.js", "linkage.js", "mover.js"), data)


def page(
    title: str,
    header: PageSection,
    sections: Sequence[PageSection],
    *,
    styles: Sequence[str] = (),
    script: Script | None = None,
    skip_to: str = "",
    footer: str = "",
) -> str:
    """A whole page.  ``styles`` are style sheets beside the common one; ``skip_to`` says what its first section is, for
    who goes there by keyboard.
    """
    return PageSection(
        "page.html.j2",
        {
            "title": title,
            "header": stacking(header.text().strip("\n")),
            "sections": [stacking(section.text().strip("\n")) for section in sections],
            "css": Markup("").join(map(static, ("report.css", *styles))),
            "scripts": Markup("").join(map(static, script.names)) if script else "",
            "data": script_json(script.data) if script else "",
            "skip": f"#{sections[0].name}" if skip_to else "",
            "skip_to": skip_to,
            "footer": footer,
        },
    ).text()


def glimpse(*sections: PageSection) -> str:
    """Sections of a page as a notebook shows them: under small headings, without links to the others."""
    text = "".join(section.text() for section in sections)
    text = re.sub(r'<nav\b.*?</nav>|<caption.*?</caption>|<span class="sign".*?</span>', "", text, flags=re.DOTALL)
    return re.sub(r"(</?)h[1-3]\b", r"\1h4", text)


def stacking(text: str) -> Markup:
    """A section whose tables say in each cell what its column is; those that are wider than a phone are marked, and
    there the style sheet puts the cells of a row one after the other.
    """
    return Markup(SCROLLED.sub(lambda found: _stacking(*found.groups()), text))


def _stacking(head: str, body: str) -> str:
    """The same of one table (HTML), its head and its body."""
    heads = [Markup(re.sub("<small>.*?</small>", "", cell)).striptags() for _, cell in CELL.findall(head)]
    widths = [max(map(len, cell.split()), default=0) for cell in heads]

    def labelled(k: int, cell: re.Match[str]) -> str:
        said = Markup(cell[2]).striptags()
        whole = re.search("number|one", cell[1]) or len(said) < LEAST_TEXT
        widths[k] = max(widths[k], len(said) if whole else max(LEAST_TEXT, *map(len, said.split())))
        return f'<td data-label="{escape(heads[k])}"{cell[0][3:]}' if cell[0].startswith("<td") else cell[0]

    def row(text: str) -> str:
        columns = count()
        return CELL.sub(lambda cell: labelled(min(next(columns), len(heads) - 1), cell), text)

    rows = list(map(row, body.split("</tr>")))
    if sum(widths) + BETWEEN * len(widths) > PHONE:
        head = re.sub('<table(?: class="([^"]*)")?', r'<table class="stacks \1"', head)
    return head + "</tr>".join(rows)


def script_json(value: object) -> Markup:
    """JSON that may stand in a script element: nothing in it can end the element or start a comment."""
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return Markup(text)


def static(name: str) -> Markup:
    """A style sheet or script of the pages."""
    return Markup(resources.files("compare.report").joinpath("static", name).read_text(encoding="utf-8"))

"""The reference pages' contents, read from the code: commands, schemas, effects, engines, signals, mechanism files.

Each function of :data:`CONTENTS` returns Markdown for the site.  A page asks for one with a line
``<!-- generate: name -->``; what stands between that and ``<!-- end: name -->`` is the same for any browser of the
repository, without what only the site can show (:func:`plain`).  ``python docs/generate/reference.py`` writes it again;
a test holds it to the code.
"""

from __future__ import annotations

import functools
import html
import inspect
import json
import pkgutil
import re
import sys
import textwrap
from collections.abc import Callable, Iterator, Mapping
from importlib import import_module, resources
from pathlib import Path
from types import ModuleType
from typing import Any

DOCS = Path(__file__).resolve().parents[1]
BLOCK = re.compile(r"^<!-- generate: ([\w-]+) -->$(?:.*?^<!-- end: \1 -->$)?", re.MULTILINE | re.DOTALL)
ROW = re.compile(r"\s+")
ANCHOR = re.compile(r"(?m)^(#+ .*?) \{ #[\w.-]+ \}$")


def table(heads: list[str], rows: list[list[str]]) -> str:
    """A Markdown table; cells lose line breaks, and their pipes are escaped."""
    lines = [heads, ["---"] * len(heads), *rows]
    cells = [[ROW.sub(" ", cell).replace("|", "\\|").strip() for cell in line] for line in lines]
    return "\n".join(f"| {' | '.join(line)} |" for line in cells) + "\n"


def escaped(text: str, code: bool = False) -> str:
    """Plain text as Markdown: angle brackets, stars, underscores and square brackets stand for themselves, but for what
    is ``code`` between backticks.
    """
    if code:
        return "".join(part if k % 2 else escaped(part) for k, part in enumerate(re.split("(`[^`]*`)", text)))
    return re.sub(r"([*_\[\]])", r"\\\1", text.replace("<", "&lt;"))


def code(text: str) -> str:
    """Text in the type of code; unlike between backticks, a pipe in it is no end of a table's cell."""
    return f"<code>{html.escape(text, quote=False).replace('|', '&#124;')}</code>"


# ---------------------------------------------------------------- commands


def _command_tree(name: str, command: Any) -> Iterator[tuple[str, Any]]:
    """A command and those below it, by full name, in the order of its help."""
    yield name, command
    for below in getattr(command, "commands", {}).values():
        if not below.hidden:
            yield from _command_tree(f"{name} {below.name}", below)


def commands() -> str:
    """Every command with its usage, its help and its options."""
    import typer

    from compare.cli.app import app

    parts = []
    for name, command in _command_tree("compare", typer.main.get_command(app)):
        context = command.make_context(name, [], resilient_parsing=True)
        records = [record for p in command.get_params(context) if (record := p.get_help_record(context))]
        rows = [[code(option), escaped(text)] for option, text in records if not option.startswith(("-h", "--help"))]
        parts += [
            f"## {name}\n",
            escaped(inspect.cleandoc(command.help or "")) + "\n",
            f"```text\n{command.get_usage(context)}\n```\n",
            table(["argument or option", "meaning"], rows) if rows else "",
        ]
    return "\n".join(parts)


# ---------------------------------------------------------------- JSON Schemas


def schema_files() -> dict[str, dict[str, Any]]:
    """The JSON Schemas that ship with the package, by file name."""
    folder = resources.files("compare").joinpath("schemas")
    names = sorted(p.name for p in folder.iterdir() if p.name.endswith(".json"))
    return {name: json.loads(folder.joinpath(name).read_text(encoding="utf-8")) for name in names}


def _kind(node: Mapping[str, Any]) -> str:
    """What a value may be, in a few words."""
    if "$ref" in node:
        return f"*{escaped(node['$ref'].rpartition('/')[2])}*"
    values = [node["const"]] if "const" in node else node.get("enum")
    if values is not None:
        return ", ".join(f"`{json.dumps(value)}`" for value in values)
    either = node.get("anyOf", node.get("oneOf"))
    if either is not None:
        return " or ".join(_kind(one) for one in either)
    kind = node.get("type", "any")
    inner = node.get({"array": "items", "object": "additionalProperties"}.get(str(kind), ""))
    of = f" of {_kind(inner)}" if isinstance(inner, dict) else ""
    of = f" of ({of[4:]})" if " or " in of else of
    return " or ".join(kind) if isinstance(kind, list) else f"{kind}{of}"


def _rows(node: Mapping[str, Any], path: str = "") -> Iterator[list[str]]:
    """Path, kind, whether it may be left out, and meaning of everything that lies inside a node."""
    if isinstance(node.get("items"), dict):
        yield from _rows(node["items"], f"{path}[]")
    if isinstance(node.get("additionalProperties"), dict):
        yield from _rows(node["additionalProperties"], f"{path}.*" if path else "*")
    for name, inner in node.get("properties", {}).items():
        full = f"{path}.{name}" if path else name
        optional = "" if name in node.get("required", ()) else "optional"
        yield [f"`{full}`", _kind(inner), optional, escaped(inner.get("description", ""))]
        yield from _rows(inner, full)


def schemas() -> str:
    """A table for each JSON Schema, and for each definition inside it."""
    heads = ["field", "value", "", "meaning"]
    parts = []
    for name, schema in schema_files().items():
        parts += [f"## {name}\n", escaped(schema.get("description", "")) + "\n", table(heads, list(_rows(schema)))]
        for inner, node in schema.get("$defs", {}).items():
            parts.append(f"### {inner} {{ #{name.removesuffix('.json')}-{inner} }}\n")
            parts.append(escaped(node.get("description", "")) + "\n")
            rows = list(_rows(node))
            parts.append(table(heads, rows) if rows else f"{_kind(node)}\n")
    return "\n".join(parts)


# ---------------------------------------------------------------- what the command lists


def effects() -> str:
    """The vocabulary of the diagnosis."""
    from compare.catalogue import effects as found

    rows = [
        [
            f"`{e.name}`",
            e.where,
            escaped(e.says) + "; tried only where `--only` names it" * e.asked_for,
            ", ".join(f"{escaped(p.name)} ({p.unit})" for p in e.parameters),
            ", ".join(e.simulators),
        ]
        for e in found().effects
    ]
    return table(["effect", "where", "what it says", "parameters", "simulated by"], rows)


def simulators() -> str:
    """Which engine does what, whether it is installed or not."""
    from compare.catalogue import simulators as found

    rows = [[f"`{e.name}`", *(", ".join(can.motions) or "&ndash;" for can in e.supports)] for e in found().simulators]
    return table(["engine", *(can.joint_model for can in found().simulators[0].supports)], rows)


def cases() -> str:
    """The mechanisms that ship with the package, each with the comment at the head of its file, and what else a file
    may begin with.
    """
    from compare.new import begun
    from compare.questions.listing import KINDS

    rows = []
    for path in sorted(resources.files("analytic.mechanism").joinpath("cases").iterdir(), key=lambda p: p.name):
        first = path.read_text(encoding="utf-8").splitlines()[0]
        rows.append([f"`{path.name.removesuffix('.toml')}`", escaped(first.removeprefix("# "))])
    for kind in (kind for kind, case in KINDS.items() if not case):
        first = begun(kind).read_text(encoding="utf-8").splitlines()[0]
        begin = f"To begin with: `compare new NAME --kind {kind}`."
        rows.append([f"`{kind}`", f"{escaped(first.removeprefix('# '))} {begin}"])
    return table(["case", "what it is"], rows)


# ---------------------------------------------------------------- the numbers that decide a diagnosis

DECISIONS = (
    ("Probability, before any data, that nothing is missing", "posterior.prior.NOTHING"),
    ("Effects of the rig in a set, at most", "posterior.prior.MOST_EFFECTS"),
    ("Share of rigs on which something is at work that has no name", "posterior.prior.NAMELESS"),
    ("How usual a value per run is beside one value, of a fault of a sensor", "posterior.prior.EACH_RUN"),
    ("The same of an effect of the rig", "posterior.prior.REPEATS"),
    ("How usual a richer form of an effect is beside its simple one", "posterior.prior.RICHER"),
    ("How usual it is that what has a direction is along one axis alone", "posterior.prior.ALONE"),
    ("Probability from which on an effect is named, with what may be in its place", "verdict.NAMED_FROM"),
    ("Probability from which on something may be in its place", "verdict.TIED"),
    ("Probability of a set from which on its intervals count", "posterior.prior.CREDIBLE"),
    ("Runs from which on whole runs are left out", "left_out.RUNS"),
    (
        "Angle (rad) that the nominal mechanism may be off at the end of a piece of a released run",
        "released.LINEAR_WITHIN",
    ),
    ("Samples of such a piece, at least", "released.FEWEST_SAMPLES"),
    ("Gap, in noise floors, below which the noise is overstated and nothing is named", "problem.OVERSTATED"),
    ("Gain of twice the log likelihood from which on noise has a colour", "colour.GAINED"),
    ("Chi-squared that the mains' hum must bring in a sensor", "colour.HUM"),
    ("Standard deviations of correlation between two sensors from which on it is no noise", "colour.ALIKE"),
    ("Standard deviations by which a proposed run must part two explanations", "experiment_design.ENOUGH"),
    ("Gap, in noise floors, up to which it counts as closed", "noise.CLOSED"),
    ("Standard deviations of a stretch that is listed", "locate.WINDOW_SIGMAS"),
    ("Segments of a run", "residuals.SEGMENTS"),
    ("Folds that share the segments", "residuals.FOLDS"),
)


def decisions() -> str:
    """The thresholds of the diagnosis, with where they stand."""
    rows = []
    for meaning, place in DECISIONS:
        module, _, constant = place.rpartition(".")
        value = getattr(import_module(f"compare.diagnose.{module}"), constant)
        rows.append([meaning, f"{value:g}", f"`compare.diagnose.{place}`"])
    return table(["what", "value", "in the code"], rows)


# ---------------------------------------------------------------- signals

MEANING = {
    ("reaction", "x"): "force of the joint's first body on its second, ground frame",
    ("reaction", "y"): "the same",
    ("reaction", "angle"): "its direction from the ground's x axis: the paper's &gamma;",
    ("reaction", "magnitude"): "its size",
    ("reaction", "moment"): "prismatic joints: moment on the second body, about that body's point",
    (
        "clearance",
        "x",
    ): "first pin's centre minus the second's, ground frame: the paper's &epsilon;; of a block that across its guide",
    ("clearance", "y"): "the same",
    ("clearance", "angle"): "prismatic joints with a guide: the guide's angle less that of the block in it",
    (
        "rotation",
        "angle",
    ): "how far clearance turns the body: displaced minus ideal angle; the coupler's is the paper's &psi;",
    ("pose", "angle"): "angle of the body's x axis from the ground's; continued along a run, never wrapped",
    ("pose", "x"): "position of the body's marker (its centre of mass, unless the file says otherwise), ground frame",
    ("pose", "y"): "the same",
    ("rate", "angular_velocity"): "rate of the body's angle",
    ("velocity", "x"): "on request: velocity of the body's marker, ground frame",
    ("velocity", "y"): "the same",
    ("acceleration", "x"): "on request: acceleration of the body's marker, ground frame; gravity is no part of it",
    ("acceleration", "y"): "the same",
    ("acceleration", "angle"): "on request: rate of the body's angular velocity",
    ("joint_velocity", "angle"): "on request: rate of `position_<joint>`; of prismatic joints in m/s",
    ("joint_velocity", "travel"): "on request: rate of `position_<joint>`",
    ("joint_acceleration", "angle"): "on request: rate of `velocity_<joint>`; of prismatic joints in m/s^2",
    ("joint_acceleration", "travel"): "on request: rate of `velocity_<joint>`",
    ("position", "angle"): "revolute joints: angle of the second body less the first's",
    ("position", "travel"): "prismatic joints: how far the second body's point is from the first's along the axis",
    ("drive", "torque"): "torque of the motor on the driven body; of several, each on its joint's second body",
    ("drive", "force"): "force of a motor that slides, on the joint's second body along the axis",
    (
        "power",
        "power",
    ): "on request: what all drives together give the linkage: torque or force times rate of the joint",
}


def _with_place(name: str, place: str, word: str) -> str:
    """A signal's name with a word for its place, which stands at its beginning or its end."""
    if name.startswith(f"{place}_"):
        return word + name[len(place) :]
    head, _, tail = name.rpartition(f"_{place}")
    return f"{head}_{word}{tail}"


def signals() -> str:
    """Every kind of signal that a linkage of revolute and prismatic joints has."""
    from analytic.mechanism import signals as module
    from analytic.mechanism.file import load

    linkage, turning, sliding = load("slider-crank"), load("five-bar"), load("3-rpr")
    rows: dict[str, list[str]] = {}
    own = module.signals(linkage.bodies, linkage.joints, linkage.drives)
    for signal in (*own, *module.driving(turning.motors), *module.driving(sliding.motors)):
        word = "<joint>" if signal.of_joint else "<body>"
        name = _with_place(signal.name, signal.place, word) if signal.place else signal.name
        rows.setdefault(name, [f"`{name}`", signal.unit, MEANING[signal.kind, signal.component]])
    return table(["signal", "unit", "meaning"], list(rows.values()))


# ---------------------------------------------------------------- mechanism files


def mechanism_file() -> str:
    """The fields of a mechanism file, table by table."""
    from compare.mechanism_fields import of_table

    headings = {
        "mechanism": "Top level",
        "ground": "`[ground]`",
        "body": "`[[body]]`",
        "joint": "`[[joint]]`",
        "elasticity": "elasticity of a joint",
        "drive": "`[drive]`",
        "ripple": "ripple of a drive",
        "periodic_torque": "periodic_torque of a drive",
        "spring": "`[[spring]]`",
        "stop": "`[[stop]]`",
        "load": "`[[load]]`",
        "sensor": "`[[sensor]]`",
    }
    out = []
    for name, heading in headings.items():
        rows = [[f"`{f.name}`", _default(f.default), escaped(f.means, code=True)] for f in of_table(name)]
        out.append(f"### {heading}\n")
        out.append(table(["field", "default", "meaning"], rows))
    return "\n".join(out)


def _default(text: str) -> str:
    return text if text == "required" else f"`{text}`" if text else "&ndash;"


def left_out() -> str:
    """What each command leaves out of a mechanism file, a row for each reason."""
    from compare.omissions import OMISSIONS

    rows = [[", ".join(f"`{field}`" for field in one.fields), one.where, escaped(one.why)] for one in OMISSIONS]
    return table(["field", "left out by", "because"], rows)


# ---------------------------------------------------------------- Python


def public_modules(package: str) -> list[str]:
    """A package and all public modules below it that say something."""
    found: ModuleType = import_module(package)
    names = [package, *(m.name for m in pkgutil.walk_packages(found.__path__, f"{package}."))]
    return [name for name in names if "._" not in name]


def _modules(*names: str) -> str:
    return "\n".join(f"::: {name}\n" for name in names)


PYTHON: dict[str, tuple[str, ...]] = {
    "mechanism": ("analytic.mechanism",),
    "kinematics": ("analytic.kinematics",),
    "paper": ("analytic.paper",),
    "beyond": ("analytic.beyond_paper",),
}
SINGLE = (
    "sim_models.engine", "sim_models.common.simulate", "sim_models.common.contact_laws", "sim_models.run.path",
    "compare.diagnose.effects.effect",
)  # fmt: skip


@functools.cache
def documented() -> tuple[str, ...]:
    """Every module that the reference has a section for."""
    return (*(m for names in PYTHON.values() for name in names for m in public_modules(name)), *SINGLE)


def _python(part: str) -> Callable[[], str]:
    return lambda: _modules(*(m for name in PYTHON[part] for m in public_modules(name)))


def seam() -> str:
    """The modules that an engine or an effect of somebody's own is written against."""
    return _modules(*SINGLE)


def functions() -> str:
    """The way in from Python: every function, from where it is written."""
    import linkage_crosscheck as lc
    from analytic.mechanism.parts import MechanismPart

    found = {name: getattr(lc, name) for name in lc.__all__}
    parts = []
    for name, function in found.items():
        if inspect.isfunction(function):
            parts.append(
                f"::: {function.__module__}.{function.__name__}\n    options:\n"
                f"      heading: lc.{name}\n      toc_label: lc.{name}\n      heading_level: 3\n"
            )
    parts.append("The parts of a mechanism, for one that is made or changed in Python: ")
    classes = [c for c in found.values() if inspect.isclass(c) and issubclass(c, MechanismPart)]
    parts.append(", ".join(f"`{c.__module__}.{c.__name__}`" for c in classes) + ".\n")
    return "\n".join(parts)


def results() -> str:
    """The documents that the functions give, without their fields."""
    from compare.results.schemas import documents as found

    def methods(document: type) -> list[str]:
        own = (name for name, value in vars(document).items() if callable(value) or isinstance(value, property))
        return [name for name in own if not name.startswith(("_", "model_"))]

    return "\n".join(
        f"::: {d.__module__}.{d.__name__}\n    options:\n      heading: {d.__name__}\n      heading_level: 3\n"
        f"      members: {json.dumps(methods(d))}\n"
        for d in found().values()
    )


def document() -> str:
    """What all documents can do."""
    members = "[to_json, plain, read, rows, units, to_csv, to_dataframe, plot, write, print_to]"
    options = f"    options:\n      heading: Document\n      heading_level: 3\n      members: {members}\n"
    return f"::: compare.results.document.Document\n{options}"


def example_engine() -> str:
    """The example of an engine, whole."""
    text = (Path(__file__).parents[1] / "example-engine" / "multiplier_engine.py").read_text(encoding="utf-8")
    return f"```python\n{text}```\n"


CONTENTS: dict[str, Callable[[], str]] = {
    "commands": commands,
    "schemas": schemas,
    "effects": effects,
    "simulators": simulators,
    "decisions": decisions,
    "cases": cases,
    "signals": signals,
    "mechanism-file": mechanism_file,
    "left-out": left_out,
    "seam": seam,
    "example-engine": example_engine,
    "document": document,
    "functions": functions,
    "documents": results,
    **{f"python-{part}": _python(part) for part in PYTHON},
}


# ---------------------------------------------------------------- the same without the site

DIRECTIVE = re.compile(r"(?m)^::: ([\w.]+)\n(?:    .*\n)*")


def plain(name: str) -> str:
    """The contents as any browser of the repository shows them."""
    if name == "example-engine":
        return "It is [multiplier_engine.py](../example-engine/multiplier_engine.py).\n"
    text = ANCHOR.sub(r"\1", DIRECTIVE.sub(_described, CONTENTS[name]()))
    return re.sub(r"\n{3,}", "\n\n", text).strip() + "\n"


def _described(directive: re.Match[str]) -> str:
    """What a module, a function or a document is, from where it is written."""
    place = directive[1]
    heading = re.search(r"heading: (\S+)", directive[0])
    try:
        thing: Any = import_module(place)
    except ModuleNotFoundError:
        module, _, named = place.rpartition(".")
        thing = getattr(import_module(module), named)
    if inspect.ismodule(thing):
        return f"## {place}\n\n{_said(thing)}\n\n{_table_of(thing)}\n"
    if inspect.isfunction(thing):
        return f"### {heading[1] if heading else place}\n\n```text\n{_call(thing)}\n```\n\n{_said(thing, whole=True)}\n"
    members = re.search(r"members: \[(.*)\]", directive[0])
    names = re.findall(r"\w+", members[1]) if members else []
    rows = [[code(each), escaped(_said(getattr(thing, each)), code=True)] for each in names]
    methods = f"\n{table(['', 'what it is'], rows)}" if rows else ""
    return f"### {thing.__name__}\n\n{_said(thing)}\n{methods}"


def _table_of(module: ModuleType) -> str:
    """The functions and classes that a module defines, each with the first sentence that it says of itself."""
    own = {
        name: each
        for name, each in vars(module).items()
        if not name.startswith("_") and getattr(each, "__module__", "") == module.__name__ and callable(each)
    }
    rows = [[code(name), escaped(_said(each), code=True)] for name, each in own.items() if inspect.getdoc(each)]
    return table(["", "what it is"], rows) if rows else ""


def _said(thing: object, whole: bool = False) -> str:
    """What a thing says of itself, or the first paragraph of that, as Markdown."""
    from docstrings import as_markdown

    text = inspect.getdoc(thing) or ""
    text = as_markdown(text) if whole else as_markdown(text.partition("\n\n")[0])
    text = re.sub("(`+)(?!``)", lambda ticks: "`" * (3 if len(ticks[1]) == 3 else 1), text).strip()
    parts = re.split("(```.*?```|`[^`]*`)", text, flags=re.DOTALL)
    parts[::2] = [part.replace("<", "&lt;") for part in parts[::2]]  # a name in angle brackets is no tag
    return "".join(parts) if whole else ROW.sub(" ", text)


def _call(function: Any) -> str:
    """How a function is called: its arguments with what stands for them where they are left out."""
    arguments = []
    for each in inspect.signature(function).parameters.values():
        if each.kind is each.KEYWORD_ONLY and "*" not in arguments:
            arguments.append("*")
        stars = {each.VAR_KEYWORD: "**", each.VAR_POSITIONAL: "*"}.get(each.kind, "")
        default = (
            ""
            if each.default is each.empty
            else f"={each.default if isinstance(each.default, Path) else repr(each.default)}"
        )
        arguments.append(f"{stars}{each.name}{default}")
    called = f"{function.__name__}({', '.join(arguments)})"
    return textwrap.fill(called, 100, subsequent_indent="    ", break_long_words=False)


def written(page: str) -> str:
    """The text of a page with what it asks for."""
    return BLOCK.sub(
        lambda block: f"<!-- generate: {block[1]} -->\n\n{plain(block[1])}\n<!-- end: {block[1]} -->", page
    )


def main() -> None:
    """Write every page again that asks for something."""
    for page in sorted(DOCS.rglob("*.md")):
        text = page.read_text(encoding="utf-8")
        if (new := written(text)) != text:
            page.write_text(new, encoding="utf-8")
            print(page.relative_to(DOCS.parent).as_posix())


if __name__ == "__main__":
    sys.path[:0] = [str(DOCS.parent)]
    main()

"""The reference pages' contents, read from the code: commands, schemas, effects, engines, signals, mechanism files.

Each function of :data:`CONTENTS` returns Markdown.  A page asks for one with a line ``<!-- generate: name -->``.
"""

from __future__ import annotations

import ast
import functools
import html
import inspect
import io
import json
import pkgutil
import re
import tokenize
from collections.abc import Callable, Iterator, Mapping
from importlib import import_module, resources
from pathlib import Path
from types import ModuleType
from typing import Any

ROW = re.compile(r"\s+")


def table(heads: list[str], rows: list[list[str]]) -> str:
    """A Markdown table; cells lose line breaks, and their pipes are escaped."""
    lines = [heads, ["---"] * len(heads), *rows]
    cells = [[ROW.sub(" ", cell).replace("|", "\\|").strip() for cell in line] for line in lines]
    return "\n".join(f"| {' | '.join(line)} |" for line in cells) + "\n"


def escaped(text: str) -> str:
    """Plain text as Markdown: angle brackets, stars, underscores and square brackets stand for themselves."""
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
    """The mechanisms that ship with the package, each with the comment at the head of its file."""
    rows = []
    for path in sorted(resources.files("analytic.mechanism").joinpath("cases").iterdir(), key=lambda p: p.name):
        first = path.read_text(encoding="utf-8").splitlines()[0]
        rows.append([f"`{path.name.removesuffix('.toml')}`", escaped(first.removeprefix("# "))])
    return table(["case", "what it is"], rows)


# ---------------------------------------------------------------- the numbers that decide a diagnosis

DECISIONS = (
    ("Probability, before any data, that nothing is missing", "posterior.prior.NOTHING"),
    ("Effects of the rig in a set, at most", "posterior.prior.MOST"),
    ("Share of rigs on which something is at work that has no name", "posterior.prior.NAMELESS"),
    ("How usual a value per run is beside one value, of a fault of a sensor", "posterior.prior.EACH_RUN"),
    ("How usual a richer form of an effect is beside its simple one", "posterior.prior.RICHER"),
    ("How usual it is that what has a direction is along one axis alone", "posterior.prior.ALONE"),
    ("Probability from which on an effect is named, with what may be in its place", "verdict.LIKELY"),
    ("Probability from which on something may be in its place", "verdict.TIED"),
    ("Probability of a set from which on its intervals count", "posterior.prior.CREDIBLE"),
    ("Search: probability that noise alone names anything at all", "search.CHANCE"),
    ("Search: effects of the rig at once, at most", "search.MOST"),
    ("Search: faults of sensors beside them, at most", "search.FAULTS"),
    ("Search: chi-squared that each value of a fault that differs from run to run must bring more", "search.ANEW"),
    ("Search: chi-squared that an effect must gain on data that it was not fitted to", "admission.HELD_OUT"),
    ("Search: share of the whole excess that an effect must remove where something else remains", "admission.WHOLE"),
    ("Search: and the share of what the others leave, all samples alike", "admission.HARDLY"),
    ("Search: or the share of what the others leave, or of a sensor's excess", "admission.HALF"),
    ("Search: ... in so many runs", "admission.TWICE"),
    ("Runs from which on whole runs are left out", "admission.RUNS"),
    ("Gap, in noise floors, below which the noise is overstated and nothing is named", "problem.OVERSTATED"),
    (
        "Search: noise (rms) by which a linear forecast may miss a fit before all effects are screened again",
        "search.STRAYED",
    ),
    ("Gain of twice the log likelihood from which on noise has a colour", "colour.GAINED"),
    ("Chi-squared that the mains' hum must bring in a sensor", "colour.HUM"),
    ("Standard deviations of correlation between two sensors from which on it is no noise", "colour.ALIKE"),
    ("Search: chi-squared within which two explanations tie (four standard deviations)", "explain.TIE"),
    ("Standard deviations by which a proposed run must part two explanations", "experiment_design.ENOUGH"),
    ("Gap, in noise floors, up to which it counts as closed", "noise.CLOSED"),
    ("Standard deviations of a stretch that is listed", "locate.SURE"),
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
    ("position", "angle"): "revolute joints: angle of the second body less the first's",
    ("position", "travel"): "prismatic joints: how far the second body's point is from the first's along the axis",
    ("drive", "torque"): "torque of the motor on the driven body; of several, each on its joint's second body",
    ("drive", "force"): "force of a motor that slides, on the joint's second body along the axis",
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
        of_joint = signal.kind in ("reaction", "clearance", "position", "drive")
        name = (
            _with_place(signal.name, signal.place, "<joint>" if of_joint else "<body>") if signal.place else signal.name
        )
        rows.setdefault(name, [f"`{name}`", signal.unit, MEANING[signal.kind, signal.component]])
    return table(["signal", "unit", "meaning"], list(rows.values()))


# ---------------------------------------------------------------- mechanism files


MEANS = {
    ("Mechanism", "name"): "what reports call the linkage",
    ("Mechanism", "gravity"): "m/s²; left out: none",
    ("Mechanism", "ground"): "the fixed link, see below",
    ("Mechanism", "body"): "`[[body]]`, one for each moving link",
    ("Mechanism", "joint"): "`[[joint]]`, one for each joint",
    ("Mechanism", "drive"): "`[drive]`, the motor, or `[[drive]]`, several; left out: none",
    ("Mechanism", "spring"): "`[[spring]]`, any number",
    ("Mechanism", "load"): "`[[load]]`, any number",
    ("Mechanism", "assembly"): "rad by body: roughly the angles at which the linkage is assembled",
    ("Ground", "points"): "m by joint, ground frame",
    ("Body", "name"): "also the beginning of its signals' names",
    ("Body", "points"): "m by joint, body frame",
    ("Joint", "name"): "also the name of the point in both of its bodies",
    ("Joint", "type"): '`"revolute"` or `"prismatic"`',
    ("Joint", "bodies"): "the two bodies (or `ground`); the reaction is the force of the first on the second",
    (
        "Joint",
        "guide",
    ): "m, prismatic: length along the axis and height of the block, which is the second body's, about its"
    " point; the guide's walls are on the first body, farther out by the clearance",
    ("Joint", "restitution"): "share of its speed with which a pin leaves the wall, 0 to 1",
    ("Joint", "elasticity"): "Eq. 4, see below; left out: rigid",
    ("Elasticity", "translation"): "N/m along x, y and z",
    ("Elasticity", "rotation"): "N.m/rad about x and y",
    ("Drive", "joint"): "the joint that it moves; a single drive of a revolute joint on the ground turns a crank",
    (
        "Drive",
        "speed",
    ): 'rad/s (prismatic: m/s), constant; or `"free"` (released at the assembly angles) or `"measured"` (follows data).'
    " A crank's own angular velocity, whichever body its joint names first; of any other drive that of the joint's"
    " second body relative to its first",
    ("Drive", "half_gap"): "rad, backlash: the crank's play behind the motor, and as much ahead of it",
    ("Drive", "ripple"): "unevenness of the motor, see below",
    ("Drive", "periodic_torque"): "on the driven body over its angle, see below",
    ("PeriodicTorque", "amplitude"): "N.m",
    ("PeriodicTorque", "harmonic"): "how often in a turn",
    ("Ripple", "amplitude"): "rad",
    ("Ripple", "harmonic"): "how often in a turn",
    ("Spring", "bodies"): "the two bodies (or `ground`) that it joins",
    ("Spring", "points"): 'a point of each, or `"com"`: its marker',
    ("Load", "body"): "where it acts",
    ("Load", "point"): 'a point of the body, or `"com"`: its marker',
    ("Load", "force"): "N, ground frame, fixed in direction",
    ("Load", "torque"): "N.m",
    (
        "Load",
        "over",
    ): "what it varies over: `crank_angle`, `<body>_angle`, `<body>_x`, `<body>_y` or `position_<slide>`",
    ("Load", "from"): "rad or m, of what it varies over: from where on it acts",
    ("Load", "to"): "rad or m: up to where it acts",
    ("Load", "table"): "pairs of value (rad or m) and factor of the load, straight lines between them",
}  # of fields beside which the code has no comment, or hardly one


def _comments(model: type) -> dict[str, str]:
    """The comment that stands beside each field of a class, by field."""
    source = inspect.cleandoc("\n" + inspect.getsource(model))
    said = {
        token.start[0]: token.string.lstrip("# ")
        for token in tokenize.generate_tokens(io.StringIO(source).readline)
        if token.type == tokenize.COMMENT
    }
    found = {}
    (node,) = ast.parse(source).body
    assert isinstance(node, ast.ClassDef)
    for line in node.body:
        if isinstance(line, ast.AnnAssign) and isinstance(line.target, ast.Name):
            beside = [said[n] for n in range(line.lineno, (line.end_lineno or line.lineno) + 1) if n in said]
            found[line.target.id] = " ".join(beside)
    return found


def _default(field: Any) -> str:
    if field.is_required():
        return "required"
    value = field.get_default(call_default_factory=True)
    if value is None or value in ((), {}):
        return "&ndash;"
    return f"`{json.dumps(value)}`"


def mechanism_file() -> str:
    """The fields of a mechanism file, table by table."""
    from analytic.mechanism import model, parts

    headings = (
        ("Top level", model.Mechanism),
        ("[ground]", parts.Ground),
        ("[[body]]", parts.Body),
        ("[[joint]]", parts.Joint),
        ("elasticity of a joint", parts.Elasticity),
        ("[drive]", parts.Drive),
        ("ripple of a drive", parts.Ripple),
        ("periodic_torque of a drive", parts.PeriodicTorque),
        ("[[spring]]", parts.Spring),
        ("[[load]]", parts.Load),
    )
    out = []
    for heading, part in headings:
        comments = _comments(part)
        rows = [
            [
                f"`{field.alias or name}`",
                _default(field),
                MEANS.get((part.__name__, field.alias or name)) or escaped(field.description or comments[name]),
            ]
            for name, field in part.model_fields.items()
            if not field.exclude
        ]
        out.append(f"### `{heading}`\n" if heading.startswith("[") else f"### {heading}\n")
        out.append(table(["field", "default", "meaning"], rows))
    return "\n".join(out)


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
    "functions": functions,
    "documents": results,
    **{f"python-{part}": _python(part) for part in PYTHON},
}

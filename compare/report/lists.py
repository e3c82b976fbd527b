"""What is a list, shown: cases, engines and effects, earlier results, exported files, an import."""

from __future__ import annotations

import html

from rich.console import Console
from rich.text import Text

from analytic.mechanism.one_line import count
from compare.presentation import LIST_HAS_NO_PICTURE, Presentation
from compare.questions.listing import KINDS
from compare.report.tables import html_list, html_table, print_rows, say
from compare.results.applied import Applied
from compare.results.catalogue import Cases, Effects, Fields, Listing, Simulators
from compare.results.export import Exported
from compare.results.history import Runs
from compare.results.imported import Imported
from sim_models.engine import JOINT_MODELS, SCHEMES

HEADINGS = {  # of tables that there are not any number of
    "mechanism": "the file itself",
    "ground": "[ground]",
    "drive": "[drive], or several [[drive]]",
    "elasticity": "elasticity = { ... } of a joint",
    "tolerance": "[tolerances], { ... } of each field",
    "ripple": "ripple = { ... } of a drive",
    "periodic_torque": "periodic_torque = { ... } of a drive",
}
TABLE_WIDTH = 130  # columns of a terminal that the table of engines takes


def list_files(result: Listing) -> dict[str, str]:
    """The list as a table for other programs."""
    return {result.file.replace(".json", ".csv"): result.to_csv()}


def list_html(result: Listing) -> str:
    """The list as an HTML table."""
    rows = result.rows()
    columns = list(dict.fromkeys(name for row in rows for name in row))
    return html_table(([str(row.get(name, "")) for name in columns] for row in rows), columns)


def print_cases(result: Cases, console: Console) -> None:
    """Print a line for each case."""
    for case in result.cases:
        gaps = ", ".join(f"{joint} {c * 1000:g} mm" for joint, c in case.clearance.items()) or "none"
        bodies = f"{len(case.bodies)} {'body' if len(case.bodies) == 1 else 'bodies'}"
        say(console, f"{case.name:14} {bodies}, {count(len(case.joints), 'joint')}, clearance: {gaps}")
    for kind in (kind for kind, case in KINDS.items() if not case):
        say(console, f"{kind:14} a file to begin with: compare new NAME --kind {kind}")


def print_effects(result: Effects, console: Console) -> None:
    """Print two lines for each effect."""
    for effect in result.effects:
        values = ", ".join(f"{p.name} [{p.unit}]" for p in effect.parameters)
        said = f"{effect.name:<18} {effect.says}\n{'':<18} {values}; simulated by {', '.join(effect.simulators)}"
        say(console, said + (f"; tried only with --only {effect.name}" if effect.asked_for else ""))


def print_fields(result: Fields, console: Console) -> None:
    """Print the fields table by table; ASCII."""
    for table in dict.fromkeys(field.table for field in result.fields):
        say(console, HEADINGS.get(table, f"[[{table}]]"))
        rows = [
            (f"  {f.name}", f.default, f.means.replace("\N{SUPERSCRIPT TWO}", "^2"))
            for f in result.fields
            if f.table == table
        ]
        heads = ("  field", "left out", "meaning")
        print_rows(console, heads, rows, folded=("meaning",), header_style="")
    say(console, 'bare numbers are SI; in quotes with their unit: "60 rpm", "25 mm", "30 deg"')


def print_simulators(result: Simulators, console: Console) -> None:
    """Print what each engine has, and how to get it."""
    known = dict.fromkeys(effect for engine in result.simulators for effect in engine.effects)
    rows = []
    for engine in result.simulators:
        motions = {c.joint_model: ", ".join(c.motions) or "-" for c in engine.supports}
        lacks = [effect for effect in known if effect not in engine.effects]
        effects = f"all but {', '.join(lacks)}" if lacks else "all"
        version = engine.version if engine.status == "installed" else engine.status
        rows.append((engine.name, version or "", *(motions.get(model, "-") for model in JOINT_MODELS), effects))
    heads = ("simulator", "version", *JOINT_MODELS, "effects")
    console.width = max(console.width, TABLE_WIDTH)
    print_rows(console, heads, rows, folded=heads, header_style="")
    faults = [f"{e.name} is installed but cannot be imported: {e.fault}" for e in result.simulators if e.fault]
    say(console, *faults, f"effects: {', '.join(known)}; see compare effects")
    for line in (
        f"somebody's own model is one too: {', '.join(f'{each}:FILE' for each in SCHEMES)}",
        "install one with: pip install 'linkage-crosscheck[NAME]' (in a clone: pip install '.[NAME]')",
    ):
        console.print(line, markup=False, highlight=False)


def print_runs(result: Runs, console: Console) -> None:
    """Print a line for each earlier result, newest first, and one for each file that is none."""
    rows = [
        (
            run.date[:16].replace("T", " "),
            run.verdict or run.kind,
            Text(run.case),
            Text(f"{run.command or 'Python'}\n{run.file}"),
        )
        for run in result.runs
    ]
    if rows:
        heads = ("date (UTC)", "verdict", "case", "made by")
        print_rows(console, heads, rows, folded=heads[1:])
    say(console, *result.unreadable, f"{result.folder}: {count(len(result.runs), 'result')}")


def print_exported(result: Exported, console: Console) -> None:
    """Print each path, and the command that runs the model."""
    say(console, *result.paths, f"run it in an environment that has {' and '.join(result.needs)}: {result.run}")


def exported_html(result: Exported) -> str:
    """The files as a table."""
    return html_table(([path] for path in result.paths), title=repr(result))


def print_imported(result: Imported, console: Console) -> None:
    """Print the mechanism, the notes, and where the file is."""
    say(console, repr(result.mechanism), *(f"note: {note}" for note in result.notes))
    say(console, *(f"in the file's coordinates: {relation}" for relation in result.relations))
    say(console, *(f"written: {path}" for path in (result.path, result.map_path) if path))


def print_applied(result: Applied, console: Console) -> None:
    """Print what was written, what was not, and where the file is."""
    say(console, repr(result), *(f"written: {field}" for field in result.written))
    say(console, *(f"left out, as MJCF has no word or no place for it: {field}" for field in result.left))
    say(console, *([f"written: {result.path}"] if result.path else []))


def applied_files(result: Applied) -> dict[str, str]:
    """The model file."""
    return {"model.xml": result.text}


def applied_html(result: Applied) -> str:
    """The fields as a table."""
    return html_table(([field] for field in (*result.written, *result.left)), title=repr(result))


def imported_files(result: Imported) -> dict[str, str]:
    """The mechanism file, and the map of a log's columns."""
    return {"mechanism.toml": result.text, "mechanism.map.toml": result.map}


def imported_html(result: Imported) -> str:
    """The mechanism in a line, and the notes as a list."""
    return f"<p>{html.escape(repr(result.mechanism))}</p>{html_list(result.notes)}"


CASES = Presentation(list_html, print_cases, list_files, no_picture=LIST_HAS_NO_PICTURE)
EFFECTS = Presentation(list_html, print_effects, list_files, no_picture=LIST_HAS_NO_PICTURE)
FIELDS = Presentation(list_html, print_fields, list_files, no_picture=LIST_HAS_NO_PICTURE)
EXPORTED = Presentation(exported_html, print_exported, no_picture="is a list of files and has no picture; print it")
APPLIED = Presentation(
    applied_html, print_applied, applied_files, no_picture="is a model file and has no picture; open it in MuJoCo"
)
IMPORTED = Presentation(
    imported_html,
    print_imported,
    imported_files,
    no_picture="is a mechanism and has no picture; cross-check it, and plot that",
)
RUNS = Presentation(list_html, print_runs, list_files, no_picture=LIST_HAS_NO_PICTURE)
SIMULATORS = Presentation(list_html, print_simulators, list_files, no_picture=LIST_HAS_NO_PICTURE)

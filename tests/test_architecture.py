"""Walls of the house that are not imports."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
SOURCES = sorted(
    p for folder in ("analytic", "sim_models", "compare", "linkage_crosscheck") for p in (ROOT / folder).rglob("*.py")
)


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(ROOT)))
def test_no_pickle_no_eval(path: Path) -> None:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    names = {n.id for n in ast.walk(tree) if isinstance(n, ast.Name)} | {
        a.name for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names
    }
    assert not names & {"eval", "exec", "pickle", "marshal", "shelve"}


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(ROOT)))
def test_every_module_and_public_name_says_what_it_is(path: Path) -> None:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    assert ast.get_docstring(tree)
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
            assert ast.get_docstring(node), f"{node.name} has no docstring"


def imported(path: Path) -> set[str]:
    """Modules of this repository that a module imports anywhere in it, type checking included."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module, *(f"{node.module}.{a.name}" for a in node.names)}
        elif isinstance(node, ast.Import):
            found |= {a.name for a in node.names}
    return found


MODULES = {".".join(p.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): p for p in SOURCES}


@pytest.mark.parametrize("package", ["analytic"])
def test_no_import_goes_round_in_a_circle(package: str) -> None:
    imports = {m: imported(p) & set(MODULES) - {m} for m, p in MODULES.items() if m.split(".")[0] == package}
    while leaves := [m for m, found in imports.items() if not found & set(imports)]:
        for module in leaves:
            del imports[module]
    assert not imports


WRAPS = re.compile(r"% ?\(2(\.0)? ?\* ?(np|math)\.pi\)|remainder\(|np\.unwrap|np\.angle\(np\.exp\(|rint\(.*pi\)")
TAKEN_APART = re.compile(
    r"""\.(startswith|endswith|removeprefix|removesuffix)\(\(?["'](reaction_|clearance_|drive_|_)"""
)
WRAPPING = ROOT / "analytic" / "mechanism" / "signals.py"
BY_SIGNAL = (
    "analytic",
    "compare/judge",
    "compare/domain_map",
    "compare/diagnose",
    "compare/evidence/scoreboard",
)  # rooms that know signals as values


def lines_with(pattern: re.Pattern[str], folder: str) -> list[str]:
    return [
        f"{path.relative_to(ROOT)}: {line.strip()}"
        for path in SOURCES
        if path.is_relative_to(ROOT / folder) and path != WRAPPING
        for line in path.read_text(encoding="utf-8").splitlines()
        if pattern.search(line)
    ]


@pytest.mark.parametrize("folder", BY_SIGNAL)
def test_angles_are_wrapped_in_one_place(folder: str) -> None:
    assert not lines_with(WRAPS, folder)
    assert WRAPS.search(WRAPPING.read_text(encoding="utf-8"))


@pytest.mark.parametrize("folder", BY_SIGNAL)
def test_no_signals_name_is_taken_apart(folder: str) -> None:
    assert not lines_with(TAKEN_APART, folder)
    assert TAKEN_APART.search("name.startswith(('reaction_', 'drive_'))")
    assert TAKEN_APART.search('signal.removesuffix("_angle")')


LOOSE = {  # public functions that may take or give plain data of any shape, and why
    "analytic/mechanism/file.py: describe": "the content of somebody's file, for a message on what is wrong in it",
    "analytic/mechanism/model.py: replace": "fields of pydantic's model_copy",
    "analytic/mechanism/model.py: with_body": "fields of pydantic's model_copy",
    "analytic/mechanism/model.py: with_joint": "fields of pydantic's model_copy",
    "analytic/mechanism/parts.py: as_tuple": "what pydantic hands a validator",
    "analytic/mechanism/parts.py: titled": "what pydantic hands a hook of its JSON Schema",
    "analytic/mechanism/reading.py: parse_toml": "the content of somebody's file, not yet checked",
    "analytic/mechanism/reading.py: read_json": "the content of somebody's file, not yet checked",
    "analytic/mechanism/reading.py: read_toml": "the content of somebody's file, not yet checked",
    "compare/evidence/scoreboard/board.py: examine": "plain JSON at the sweep's process wall",
    "compare/files.py: to_json": "whatever JSON can hold",
    "compare/report/pages.py: script_json": "whatever JSON can hold",
}
STILL_LOOSE = 25  # others; lower it with each that gets a type


def is_loose(annotation: ast.expr | None) -> bool:
    """Whether a type is Any, or a mapping from text to Any, by itself or as one of several."""
    parts = [] if annotation is None else ast.unparse(annotation).split(" | ")
    return any(part in ("Any", "dict[str, Any]", "Mapping[str, Any]") for part in parts)


def loose_functions(text: str) -> list[str]:
    """Public functions and methods with such a type as a whole argument or as what they give."""
    tree = ast.parse(text)
    owners = [tree, *(node for node in ast.walk(tree) if isinstance(node, ast.ClassDef))]
    found = []
    for node in (node for owner in owners for node in owner.body if isinstance(node, ast.FunctionDef)):
        each = node.args
        arguments = [*each.posonlyargs, *each.args, *each.kwonlyargs, each.vararg, each.kwarg]
        types = [node.returns, *(argument.annotation for argument in arguments if argument is not None)]
        if not node.name.startswith("_") and any(map(is_loose, types)):
            found.append(node.name)
    return found


def test_plain_data_of_any_shape_crosses_fewer_and_fewer_walls() -> None:
    found = {
        f"{path.relative_to(ROOT)}: {name}"
        for path in SOURCES
        if "standalone" not in path.parts  # scripts of one file each, which import nothing of ours
        for name in loose_functions(path.read_text(encoding="utf-8"))
    }
    assert not set(LOOSE) - found, "these have types by now: take them out of the list"
    assert len(found - set(LOOSE)) <= STILL_LOOSE, sorted(found - set(LOOSE))


def test_a_type_that_says_nothing_is_counted() -> None:
    text = """
def public(a: int, *, b: dict[str, Any] | None = None) -> int: ...
def fine(a: Mapping[str, float], b: list[Any]) -> dict[str, object]: ...
def _private(a: Any) -> Any: ...
class Thing:
    def method(self, **fields: Any) -> Thing: ...
    def given(self) -> Mapping[str, Any]: ...
"""
    assert loose_functions(text) == ["public", "method", "given"]

"""Walls of the house that are not imports."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
ROOMS = ("analytic", "sim_models", "compare", "linkage_crosscheck", "tests/evidence")
SOURCES = sorted(p for folder in ROOMS for p in (ROOT / folder).rglob("*.py"))


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
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_") and not overload(node):
            assert ast.get_docstring(node), f"{node.name} has no docstring"


def overload(node: ast.FunctionDef | ast.ClassDef) -> bool:
    """Whether it is one more signature of a function whose docstring stands at the last."""
    return any(ast.unparse(decorator) == "overload" for decorator in node.decorator_list)


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
    "tests/evidence/scoreboard",
)  # rooms that know signals as values


def lines_with(pattern: re.Pattern[str], folder: str) -> list[str]:
    return [
        f"{path.relative_to(ROOT)}: {line.strip()}"
        for path in SOURCES
        if path.is_relative_to(ROOT / folder) and path != WRAPPING
        for line in path.read_text(encoding="utf-8").splitlines()
        if pattern.search(line)
    ]


@pytest.mark.parametrize("folder", [*BY_SIGNAL, "compare/recorded"])
def test_angles_are_wrapped_in_one_place(folder: str) -> None:
    assert not lines_with(WRAPS, folder)
    assert WRAPS.search(WRAPPING.read_text(encoding="utf-8"))


@pytest.mark.parametrize("folder", BY_SIGNAL)
def test_no_signals_name_is_taken_apart(folder: str) -> None:
    assert not lines_with(TAKEN_APART, folder)
    assert TAKEN_APART.search("name.startswith(('reaction_', 'drive_'))")
    assert TAKEN_APART.search('signal.removesuffix("_angle")')


def says_nothing(annotation: ast.expr | None) -> bool:
    """Whether a type is Any, or has Any somewhere in it."""
    names = () if annotation is None else ast.walk(annotation)
    return any("Any" in (getattr(name, "id", None), getattr(name, "attr", None)) for name in names)


def loose(text: str) -> list[str]:
    """What a module offers others with Any in its type: functions, methods, attributes of classes, and names."""
    tree = ast.parse(text)
    found = []
    for owner in (tree, *(node for node in ast.walk(tree) if isinstance(node, ast.ClassDef))):
        for node in owner.body:
            for name, types in declared(node):
                if (name == "__init__" or not name.startswith("_")) and any(map(says_nothing, types)):
                    found.append(name)
    return found


def declared(node: ast.stmt) -> Iterator[tuple[str, list[ast.expr | None]]]:
    """The names that a statement declares, and the types that it says they have."""
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
        each = node.args
        arguments = [*each.posonlyargs, *each.args, *each.kwonlyargs, each.vararg, each.kwarg]
        yield node.name, [node.returns, *(argument.annotation for argument in arguments if argument is not None)]
    elif isinstance(node, ast.AnnAssign):
        yield ast.unparse(node.target), [node.annotation]
    elif isinstance(node, ast.Assign):
        yield from ((ast.unparse(target), [node.value]) for target in node.targets)


OF_SEVERAL = [path for path in SOURCES if "standalone" not in path.parts]  # those are scripts of one file each


@pytest.mark.parametrize("path", OF_SEVERAL, ids=lambda p: str(p.relative_to(ROOT)))
def test_no_plain_data_of_any_shape_crosses_a_modules_wall(path: Path) -> None:
    assert not loose(path.read_text(encoding="utf-8"))


def test_a_type_that_says_nothing_is_counted() -> None:
    text = """
Content = Mapping[str, Any]
_Own = Any
def public(a: int, *, b: dict[str, Any] | None = None) -> int: ...
def nested(a: Mapping[str, list[Any]]) -> None: ...
def fine(a: Mapping[str, float], b: list[object]) -> dict[str, object]: ...
def _private(a: Any) -> Any: ...
class Thing:
    field: Any
    _own: Any
    def __init__(self, given: Any) -> None: ...
    def method(self, **fields: Any) -> Thing: ...
    def given(self) -> Iterator[typing.Any]: ...
    def typed(self) -> Thing: ...
"""
    assert loose(text) == ["Content", "public", "nested", "field", "__init__", "method", "given"]

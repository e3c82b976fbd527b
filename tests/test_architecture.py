"""Walls of the house that are not imports."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
ROOMS = ("analytic", "sim_models", "compare", "linkage_crosscheck", "tests/evidence")
SOURCES = sorted(p for folder in ROOMS for p in (ROOT / folder).rglob("*.py"))


PATHS = {p.relative_to(ROOT).as_posix(): p for p in SOURCES}


@cache
def trees() -> dict[str, ast.Module]:
    """Every module of the product by its path, parsed when a test looks and not when tests are collected."""
    return {path: ast.parse(p.read_text(encoding="utf-8")) for path, p in PATHS.items()}


@cache
def walk(tree: ast.Module) -> list[ast.AST]:
    """All that is in a module, listed once for all tests."""
    return list(ast.walk(tree))


@pytest.fixture(autouse=True, scope="module")
def _forgotten() -> Iterator[None]:
    """Millions of nodes would slow Python's collector down in all tests that follow."""
    yield
    walk.cache_clear()
    trees.cache_clear()


def test_no_pickle_no_eval() -> None:
    for path, tree in trees().items():
        names = {n.id for n in walk(tree) if isinstance(n, ast.Name)} | {
            a.name for n in walk(tree) if isinstance(n, ast.Import) for a in n.names
        }
        assert not names & {"eval", "exec", "pickle", "marshal", "shelve"}, path


def test_every_module_and_public_name_says_what_it_is() -> None:
    silent = [path for path, tree in trees().items() if not ast.get_docstring(tree)]
    for path, tree in trees().items():
        for node in tree.body:
            public = isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_")
            if public and not overload(node) and not ast.get_docstring(node):
                silent.append(f"{path}: {node.name}")
    assert not silent


def overload(node: ast.FunctionDef | ast.ClassDef) -> bool:
    """Whether it is one more signature of a function whose docstring stands at the last."""
    return any(ast.unparse(decorator) == "overload" for decorator in node.decorator_list)


# ---------------------------------------------------------------- imports, also in functions, for types, by strings

MODULES = {path.removesuffix(".py").replace("/", ".").removesuffix(".__init__"): path for path in PATHS}
LAYERS = ("analytic", "sim_models", "compare", "linkage_crosscheck", "tests")  # each imports itself and those before it


def imports(module: str, tree: ast.Module) -> set[str]:
    """The modules of this repository that one imports anywhere in it: also inside functions, and for types alone."""
    names = set()
    for node in walk(tree):
        if isinstance(node, ast.ImportFrom):
            assert node.module, f"{module}: imports are absolute here"
            assert not node.level, f"{module}: imports are absolute here"
            names |= {node.module, *(f"{node.module}.{a.name}" for a in node.names)}
        elif isinstance(node, ast.Import):
            names |= {a.name for a in node.names}
    return names & set(MODULES) - {module}


def circles(imported: Mapping[str, set[str]]) -> set[str]:
    """The modules that are in a circle of imports or between two."""
    left = dict(imported)
    while ends := [m for m, others in left.items() if not others & set(left)]:
        for module in ends:
            del left[module]
    return set(left)


@cache
def graph() -> dict[str, set[str]]:
    """What each module imports."""
    return {module: imports(module, trees()[path]) for module, path in MODULES.items()}


def test_no_import_goes_round_in_a_circle() -> None:
    assert not circles(graph())


def test_a_circle_is_found_however_it_is_imported() -> None:
    lazy = "def f():\n    import analytic.mechanism\n"
    typed = "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from analytic import mechanism\n"
    for text in (lazy, typed):
        assert imports("analytic.paper", ast.parse(text)) >= {"analytic.mechanism"}
    ring = {"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}, "e": set()}
    assert circles(ring) == {"a", "b", "c", "d"}
    assert circles({"a": {"b"}, "b": {"a"}, "c": set()}) == {"a", "b"}


def test_imports_point_one_way() -> None:
    """Of all modules, in functions and for types too; a string that names a module is as good as an import."""
    layer = {module: LAYERS.index(module.split(".")[0]) for module in MODULES}
    named = {module: graph()[module] | named_in(trees()[path]) for module, path in MODULES.items()}
    up = {(m, to) for m, others in named.items() for to in others if LAYERS.index(to.split(".")[0]) > layer[m]}
    assert not up


def named_in(tree: ast.Module) -> set[str]:
    """The modules of this repository that a string names, or whose name it begins with."""
    texts = {n.value for n in walk(tree) if isinstance(n, ast.Constant) and isinstance(n.value, str)}
    return {text.rstrip(".") for text in texts if "." in text} & set(MODULES)


def test_what_computes_names_no_presentation_in_a_string() -> None:
    rooms = ("compare/report/", "compare/cli/", "linkage_crosscheck/", "tests/")
    reach = {path for path, tree in trees().items() if any(n.startswith("compare.report") for n in named_in(tree))}
    assert not {path for path in reach if not path.startswith(rooms)}


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


def loose(tree: ast.Module) -> list[str]:
    """What a module offers others with Any in its type: functions, methods, attributes of classes, and names."""
    found = []
    for owner in (tree, *(node for node in walk(tree) if isinstance(node, ast.ClassDef))):
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


def test_no_plain_data_of_any_shape_crosses_a_modules_wall() -> None:
    scripts = "/standalone/"  # of one file each
    found = {path: loose(tree) for path, tree in trees().items() if scripts not in path}
    assert {path: names for path, names in found.items() if names} == {}


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
    assert loose(ast.parse(text)) == ["Content", "public", "nested", "field", "__init__", "method", "given"]

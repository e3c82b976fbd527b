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
BY_SIGNAL = ("analytic", "compare/judge", "compare/domain_map")  # rooms that know signals as values


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

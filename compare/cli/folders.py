"""Folders of results: what they are called, and that no command silently replaces what another one has left."""

from __future__ import annotations

import hashlib
import os.path
import shlex
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from difflib import get_close_matches
from enum import Enum
from pathlib import Path
from typing import Any

import typer

from analytic.writing import OutputError
from compare.ci import is_no_answer
from compare.files import check_replaceable, file_name, relative

NOT_ASKED = {
    "out",
    "plot",
    "overwrite",
    "json",
    "quiet",
    "workers",
    "dask",
    "version",
}  # where and how an answer is given, and not which
WRITTEN_FILES = {"out", "junit", "plot"}  # files that a command writes, and does not read
MODEL_SCHEMES = ("mjcf:", "fmu:")  # before a file among the engines
STEM = {"case", "measured", "results", "rig", "diagnosis"}  # whose mechanism a name begins with
NAMED_BY_FOLDER = ("measured.toml", "diagnosis.json")
BARE = {"simulator", "clearance"}  # options whose value says in a name what it is
LONGEST_NAME = 150  # characters of a name; file systems take 255 bytes
REMEDY = "choose another folder with --out, or add --overwrite"


def result_folder(
    context: typer.Context, stem: str, file: str, out: Path | None, overwrite: bool, beside: Sequence[str] = ()
) -> Path:
    """The folder of a command's result: ``out``, or ``reports/<stem>`` and each option that is not at its default.

    ``file`` in it is the result (JSON that has its ``command``), ``beside`` names files that are known to be written
    with it.  Raises OutputError where one of them is a file that the command reads, and where the result is there and
    is not of the same command, or is not there and one of the others is; the same command again, however it is written,
    may replace its own.
    """
    folder = default_folder(context, stem) if out is None else out
    refuse_inputs(context, (folder / name for name in (file, *beside)))
    if not overwrite:
        beside = [name for name in beside if not is_no_answer(folder / name)]
        check_replaceable(folder, file, beside, same_question(context), "--out", REMEDY)
    return folder


def default_folder(context: typer.Context, stem: str) -> Path:
    """The folder of a command's result where none is typed."""
    return Path("reports") / _named(context, stem)


def named_after(file: str | Path) -> str:
    """The name of a default folder: a shipped case, a file's stem, the folder of a measured.toml or a diagnosis."""
    path = Path(file).absolute()
    return path.stem if path.name not in NAMED_BY_FOLDER else path.parent.name or path.stem


def spelled_out(words: Sequence[str], root: typer.core.TyperGroup) -> list[str]:
    """The words of a command line of ``root``; those whose first, but for its options, is a mechanism file, or a
    shipped case that no command is called like, ask for its analysis, or with a simulator for its cross-check.  So do
    those that begin with what is more like a case than like a command.  Behind a command that has a case and nothing
    else without an option's name, the file or the case may stand alone, between its options or after them.
    """
    commands = root.commands
    if words[0:1] and (command := commands.get(words[0])) and len(words) > 1 and "--case" not in words:
        alone = any(o.name == "case" for o in command.params) and all(
            o.param_type_name == "option" for o in command.params
        )
        k = 1 + _unnamed(words[1:], command.params)
        return [*words[:k], *["--case"] * (alone and k < len(words) and _is_case(words[k])), *words[k:]]
    k = _unnamed(words, root.params)
    if k >= len(words) or words[k] in commands or "--case" in words:
        return list(words)
    from analytic.mechanism.file import shipped_cases

    word, others = words[k], [*words[:k], *words[k + 1 :]]
    cases = shipped_cases()
    near = () if k else get_close_matches(word, [*commands, *cases], n=1)
    if not (_is_case(word) or (near and near[0] in cases)):
        return list(words)
    checked = any(other.startswith("--simulator") for other in others)
    return [*([] if checked else ["analyse"]), "--case", word, *others]


def _unnamed(words: Sequence[str], options: Iterable[Any]) -> int:
    """The index of the first word that is none of these options and no value of one; their number where there is
    none.
    """
    flags = {word for option in options if getattr(option, "is_flag", False) for word in option.opts}
    k = 0
    while k < len(words) and words[k].startswith("-"):
        k += 1 if "=" in words[k] or words[k] in flags | {"-h", "--help"} else 2
    return min(k, len(words))


def _is_case(word: str) -> bool:
    """Whether a word is a mechanism file or a shipped case."""
    from analytic.mechanism.file import shipped_cases

    return word.endswith(".toml") or word in shipped_cases()


def same_question(context: typer.Context) -> Callable[[str | None], bool]:
    """Whether a line, as it was typed, asks what the command of a context asks, however it is written."""
    question = (context.info_name if context.parent else "", _question(context.params))
    return lambda line: line is not None and _asked(context, line) == question


def refuse_inputs(context: typer.Context, written: Iterable[Path], option: str = "--out") -> None:
    """Raises OutputError if a file that a command is to write is one that it was given to read."""
    given = [file for file in _given(context) if os.path.exists(file)]
    for path in written:
        if os.path.exists(path) and any(os.path.samefile(path, file) for file in given):
            raise OutputError(f"{option} {path}: the command reads that file; choose another one with {option}")


def _given(context: typer.Context) -> Iterator[str]:
    """What may be files that a command reads, of its options."""
    for name, value in context.params.items():
        for one in () if name in WRITTEN_FILES else value if isinstance(value, list | tuple) else (value,):
            for text in (str(one), *str(one).split(",")):
                yield text
                yield from (text.removeprefix(kind) for kind in MODEL_SCHEMES if text.startswith(kind))


def refuse_others(context: typer.Context, folder: Path, texts: Mapping[str, str], overwrite: bool) -> None:
    """Raises OutputError if a file that is to be written is one that the command was given to read, or is there with
    another content.
    """
    refuse_inputs(context, (folder / name for name in texts))
    for name, text in texts.items():
        path = folder / name
        if not overwrite and path.exists() and not (path.is_file() and path.read_bytes() == text.encode()):
            raise OutputError(
                f"--out {folder}: there is another {name}, which is not what this command writes; {REMEDY}"
            )


def _named(context: typer.Context, stem: str) -> str:
    """A default folder's name: ``paper-mujoco``, ``paper-mujoco-static-B_2e-4``."""
    parts = [file_name(stem)]
    for option in context.command.params:
        value = context.params.get(option.name or "")
        if (
            option.name not in NOT_ASKED | STEM
            and value not in (None, (), [])
            and str(value) != str(option.get_default(context))
        ):
            parts.append(_part(str(option.name), value))
    name = "".join(c if c.isalnum() or c in "-_+.,@" else "_" for c in "-".join(parts))
    if len(name) <= LONGEST_NAME:
        return name
    return f"{name[: LONGEST_NAME - 9]}-{hashlib.sha256(name.encode()).hexdigest()[:8]}"


def _part(option: str, value: Any) -> str:
    """An option that is not at its default, as a part of a name: ``static``, ``B=2e-4``, ``flexible``, ``seed=7``."""
    if value is True:
        return option
    if isinstance(value, Enum) or option in BARE:
        return str(value)
    return f"{option}={','.join(map(str, value)) if isinstance(value, list | tuple) else value}"


def _asked(context: typer.Context, line: str) -> tuple[str, dict[str, str]] | None:
    """The command of a line as it was typed, and the value of every option of it, given or not; None if it is no such
    line.
    """
    try:
        words = shlex.split(line)[1:]
    except ValueError:
        return None
    root = context.find_root().command
    commands = getattr(root, "commands", {})
    words = spelled_out(words, root) if isinstance(root, typer.core.TyperGroup) else words
    name = words[0] if words and words[0] in commands else ""
    command, words = (commands[name], words[1:]) if name else (root, words)
    return name, _question(command.make_context(name, words, resilient_parsing=True).params)


def _question(options: Mapping[str, Any]) -> dict[str, str]:
    """The options of a command that say what it was asked, as text by name."""
    return {
        name: relative(str(list(value) if isinstance(value, tuple) else value))
        for name, value in options.items()
        if name not in NOT_ASKED
    }

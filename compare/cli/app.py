"""The ``compare`` command.  Heavy imports wait until a command needs them, so that ``compare --help`` answers
at once.
"""

import os
import re
import signal
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise, takewhile
from pathlib import Path
from typing import Annotated, Any

import typer
import typer.core

from compare.ci import head_summary, in_ci, record_no_answer
from compare.cli.accuracy import accuracy
from compare.cli.analyse import analyse, simulate
from compare.cli.apply import apply_
from compare.cli.baseline import baseline
from compare.cli.check import check
from compare.cli.diagnose import diagnose
from compare.cli.export import export
from compare.cli.folders import spelled_out
from compare.cli.imported import import_
from compare.cli.listing import cases, effects, fields, runs, simulators
from compare.cli.new import new
from compare.cli.pipe import reader_may_go
from compare.cli.plan import plan
from compare.cli.predict import predict
from compare.cli.show import show
from compare.cli.sweep import answer, is_swept
from compare.cli.typed import CommandLine, Shown, Where, command
from compare.cli.validity import validity
from compare.faults import Exit
from compare.questions.crosscheck import CrosscheckQuestion
from compare.questions.option import Option, Switch
from compare.questions.question import Question
from compare.questions.sweep import SweepQuestion

_UsageError: Any = typer.BadParameter.__mro__[1]  # typer's, or that of the click below it
JUDGES = ("compare", "compare check", "compare diagnose")  # commands whose folder always has a JUnit file
IN_CI = "in CI the exit status is the verdict, and the folder of a result has junit.xml: docs/how-to/ci.md shows it"


class Commands(typer.core.TyperGroup):
    """The commands; a mechanism file, or a shipped case that no command is called like, asks for its analysis, or with
    a simulator for its cross-check.
    """

    def parse_args(self, ctx: typer.Context, args: list[str]) -> list[str]:  # type: ignore[override]
        """The words that are left for the command that is meant."""
        with _plain():
            words = spelled_out(args, self)
            _check_once(words, self, ctx)
            return super().parse_args(ctx, words)

    def invoke(self, ctx: typer.Context) -> object:  # type: ignore[override]
        """What the command that is meant gives; it reads its own words."""
        with _plain():
            return super().invoke(ctx)


def _check_once(words: list[str], root: typer.core.TyperGroup, context: typer.Context) -> None:
    """Raises a usage error for an option with one value that is given two: the parser would take the last."""
    command: Any = root
    for word in takewhile(lambda word: not word.startswith("-"), words):
        command = getattr(command, "commands", {}).get(word, command)
    single = {name: each for each in command.params if not each.multiple and each.nargs == 1 for name in each.opts}
    given: dict[str, str] = {}
    for k, word in enumerate(words[: words.index("--")] if "--" in words else words):
        name, equals, value = word.partition("=")
        option = single.get(name) if name.startswith("-") else None
        if option is None or option.is_flag:
            continue
        value = value if equals else " ".join(words[k + 1 : k + 2])
        before = given.setdefault(option.name, value)
        if before != value:
            joined = f"name them together: {name} {before},{value}" if ",..." in (option.metavar or "") else "keep one"
            raise _UsageError(f"{name} is given twice, {before} and {value}; {joined}", context)


@contextmanager
def _plain() -> Iterator[None]:
    """Have typer's own sentence about a word say what is meant, without what its validator puts before it."""
    try:
        yield
    except _UsageError as error:
        said = error.message.removeprefix("Value error, ")
        options = {option.name for option in error.ctx.command.params} if error.ctx else set()
        if re.match(r"No such (command|option):? '?(ci|(--)?junit)\b", said):
            said, error.possibilities = f"{said.rstrip('.')}; {IN_CI}", None
        elif of_crosscheck := _of_crosscheck(said, error.ctx):
            said, error.possibilities = f"{said.rstrip('.')}; {of_crosscheck}", None
        elif re.match(r"No such option: '?--limit\b", said) and not error.ctx.parent:
            said = f"{said.rstrip('.')}; limits are of one side: compare LINKAGE.toml --limit reaction_B=500N"
        elif (named := re.match(r"No such command '(.+)'", said)) and (file := _file(named[1])):
            said, error.possibilities = f"{said.rstrip('.')}; did you mean {file}?", None
        elif said.startswith("Got unexpected extra argument") and "case" in options:
            named = re.search(r"\((\S+)\)$", said)
            said = f"{said}; a linkage is named with --case {_file(named[1]) if named else ''}".rstrip()
        error.message = said
        _record(error.format_message(), error.ctx.command_path if error.ctx else "compare")
        raise


def _file(word: str) -> str:
    """The mechanism file whose name without its ending a word is; empty where there is none."""
    return f"{word}.toml" if Path(f"{word}.toml").is_file() else ""


def _of_crosscheck(said: str, context: typer.Context | None) -> str:
    """What to write where an option that ``compare analyse`` has not is one of the cross-check; else empty."""
    option = re.match(r"No such option: '?(--[\w-]+)", said)
    if option is None or context is None or context.info_name != "analyse":
        return ""
    name, options = option[1], {word for each in context.find_root().command.params for word in each.opts}
    return f"{name} is of a cross-check: compare LINKAGE.toml --simulator mujoco {name} ..." if name in options else ""


def _record(said: str, command: str) -> None:
    """A fault of a command's words as its JUnit file has it, and on the page of a workflow's run: in the file of
    ``--junit``, or in CI in the folder of ``--out``.
    """
    head_summary(f"✗ no answer: {said}")
    given = [each for word in sys.argv[1:] for each in (word.split("=", 1) if word.startswith("--") else [word])]
    after = dict(pairwise(given))
    judges = command in JUDGES or {"--limit", "--min-yield"} & {*after}
    in_folder = str(Path(after["--out"]) / "junit.xml") if judges and in_ci() and "--out" in after else ""
    file = after.get("--junit", in_folder)
    if file:
        record_no_answer(Path(file), command, said, Exit.BAD_INPUT.name.lower().replace("_", " "))


app = typer.Typer(
    cls=Commands,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def main() -> None:
    """Entry point of the console command."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # our matrices are small: threads cost more than they bring
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # a job that is cancelled ends as with Ctrl-C
    try:
        with reader_may_go():
            app(prog_name="compare")
    except Exception as error:  # noqa: BLE001 - Python's own status, 1, means that the two sides disagree
        traceback.print_exc()
        typer.echo(
            f"compare: unforeseen fault ({type(error).__name__}: {error}); it is this program's: please report it with"
            " the lines above",
            err=True,
        )
        raise SystemExit(Exit.SIMULATOR_FAILED) from None


class Version(Question):
    """The version of the package."""

    version: Annotated[bool, Option("Print the version.", Switch())] = False


@app.callback(invoke_without_command=True)
@command(CrosscheckQuestion, SweepQuestion, Where, Shown, Version)
def compare(line: CommandLine) -> None:
    """Cross-check the analytic clearance model of a planar linkage against a multibody simulation.

    compare LINKAGE.toml, or a shipped case by its name alone, is compare analyse --case LINKAGE.toml: the linkage in
    motion, its reactions and torque with their peaks, its error by joint, on a page and without an engine.  With
    --simulator it is cross-checked.

    With --set fields of the mechanism are varied, and a table says what each comes to.

    Exit status: 0 agrees, 1 disagrees beyond tolerance or cannot be judged, 2 bad input, 3 a simulator is missing or
    failed.

    In CI: docs/how-to/ci.md; junit.xml lies beside the report.
    """
    context = line.context
    typed = [name for name in context.params if line.has(name)]
    if context.invoked_subcommand is not None:
        if typed:
            option, under = f"--{typed[0].replace('_', '-')}", context.invoked_subcommand
            typer.echo(f"compare: {option} stands before {under}, which does not see it; write it after", err=True)
            raise typer.Exit(Exit.BAD_INPUT)
        return
    if line.asked(Version).version:
        from importlib.metadata import version as installed

        typer.echo(f"linkage-crosscheck {installed('linkage-crosscheck')}")
        return
    if line.words["simulator"] is None:
        if typed:
            typer.echo(
                "compare: no --simulator is given; name one of those that compare simulators lists, or all", err=True
            )
        else:
            typer.echo(context.get_help())
        raise typer.Exit(Exit.BAD_INPUT)
    with line.complaints() as caught:
        if is_swept(line, alone=["workers"]):
            answer(line, "crosscheck", CrosscheckQuestion, caught)
        from compare.crosscheck import crosscheck

        folder = line.folder(line.stem, "result.json", "junit.xml", "signals.csv")
        line.judge(lambda: line.ask(crosscheck, CrosscheckQuestion), caught, folder)


for listed in (accuracy, analyse, cases, check, diagnose, effects, export, fields):
    app.command()(listed)
app.command("apply")(apply_)
app.command("import")(import_)
app.command("list")(runs)
for listed in (new, plan, predict, simulate, simulators, validity, show):
    app.command()(listed)
app.add_typer(baseline, name="baseline")

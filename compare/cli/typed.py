"""Questions on a command line: their options for typer, the arguments that were typed, and where the answer goes."""

import inspect
import io
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import MISSING, Field, dataclass
from dataclasses import field as attribute
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar, cast

import typer

from analytic.writing import write_atomically
from compare.ci import in_ci, record_no_answer, source
from compare.cli.folders import default_folder, named_after, refuse_inputs, result_folder
from compare.cli.publish import finished, put, show
from compare.faults import Exit, OptionError, Stopped, complaints
from compare.files import alone_in, made_folder
from compare.questions.option import LeftOut, Option, Switch, Whole, Written
from compare.questions.question import Question, arguments, option_of

if TYPE_CHECKING:
    from compare.results.crosscheck import CrossCheck
    from compare.results.document import Document

D = TypeVar("D", bound="Document")
Q = TypeVar("Q", bound=Question)
R = TypeVar("R")
PICTURES = (".svg", ".png", ".pdf")
TYPED = "COMMANDLINE"  # typer's word for what is not left out


class Shown(Question):
    """What goes to standard output."""

    json: Annotated[
        bool, Option("Print the result file (JSON) to standard output, and nothing else there.", Switch())
    ] = False
    quiet: Annotated[
        bool, Option("Print nothing to standard output; files are written as without it.", Switch(), also="-q")
    ] = False


class Overwrite(Question):
    """Whether files may be replaced."""

    overwrite: Annotated[bool, Option("Replace what another command has left in the folder.", Switch())] = False


class Plotted(Question):
    """Whether the main curves are drawn into a file."""

    plot: Annotated[
        Path | None, Option("Draw the main curves into this file as well: .svg, .png or .pdf.", Written("FILE"))
    ] = None


class Where(Overwrite):
    """Where the files of an answer go."""

    out: Annotated[
        Path | None, Option("Folder of the files [reports/ and a name of the case and the options].", Written("PATH"))
    ] = None


@dataclass(frozen=True)
class CommandLine:
    """A command line of some questions: the word of each option, typed or what stands in its place."""

    context: typer.Context
    questions: tuple[type[Question], ...]
    words: Mapping[str, object]
    tests: list[Path] = attribute(default_factory=list)  # JUnit files that it writes

    @contextmanager
    def complaints(self) -> Iterator[list[str]]:
        """Faults as sentences that name an option as it was typed; see :func:`compare.faults.complaints`.  In CI, and
        where one is asked for, a JUnit file has them too.
        """
        names = {field.name: name for q in self.questions for field, name, _ in _typed(q)}
        try:
            with complaints(self.context, names) as caught:
                yield caught
        except Stopped as stopped:
            for path in self.tests if self.has("junit") or in_ci() else ():
                kind = Exit(stopped.exit_code).name.lower().replace("_", " ")
                record_no_answer(path, self.context.command_path, stopped.why, kind)
            raise

    def has(self, name: str) -> bool:
        """Whether an option was typed."""
        source = self.context.get_parameter_source(name)
        return source is not None and source.name == TYPED

    def ask(self, function: Callable[..., R], question: type[Question], **more: object) -> R:
        """Call a function with the arguments of its question that are not left out, and ``more``.

        Raises ArgumentError, and what the function raises.
        """
        return function(**self.arguments(question) | more)

    def arguments(self, question: type[Question]) -> dict[str, object]:
        """The arguments of a question that are not left out, by name.  Raises ArgumentError."""
        words = ((field.name, option.kind, self.words[name]) for field, name, option in _typed(question))
        return {name: kind.parse(word, name) for name, kind, word in words if word not in (None, [], ())}

    def asked(self, question: type[Q], **more: object) -> Q:
        """A question itself.  Raises ArgumentError."""
        return self.ask(question, question, **more)

    def folder(self, stem: str, file: str, *beside: str) -> Path:
        """The folder of the answer, whose result is ``file``; see :func:`compare.cli.folders.result_folder`.  Raises
        MechanismError first where there is no such case.
        """
        case, where = self.words.get("case"), self.asked(Where)
        if isinstance(case, str) and not os.path.lexists(case):
            from analytic.mechanism.file import load

            self._expect(where.out, beside)
            load(case)
        folder = where.out or default_folder(self.context, stem)
        self._expect(folder, beside)
        return result_folder(self.context, stem, file, folder, where.overwrite, beside)

    def _expect(self, folder: Path | None, files: Sequence[str]) -> None:
        """A JUnit file among those of a folder is to have a fault."""
        self.tests[:] = [folder / name for name in files if folder is not None and name == "junit.xml"]

    def answer(self, ask: Callable[[], D], caught: Sequence[str], folder: Path) -> D:
        """Ask, write what comes of it into a folder, and print it."""
        with made_folder(folder) as place:
            document = finished(ask(), caught)
            with alone_in(place):
                put(document, place, self.asked(Overwrite).overwrite, self.context)
            self.show(document, place)
        return document

    def drawn(self, ask: Callable[[], D], caught: Sequence[str], folder: Path) -> D:
        """The same, and its main curves in the file that is typed for them.  Raises OptionError where they cannot be
        drawn.
        """
        file = self.asked(Plotted).plot
        if file is None:
            return self.answer(ask, caught, folder)
        if file.suffix.lower() not in PICTURES:
            raise OptionError(f"--plot {file}: a picture is {', '.join(PICTURES[:-1])} or {PICTURES[-1]}")
        try:
            import matplotlib  # noqa: F401 - before anything is computed
        except ImportError:
            raise OptionError(f"--plot {file} needs matplotlib; run: pip install 'linkage-crosscheck[plot]'") from None
        refuse_inputs(self.context, [file], "--plot")
        document = self.answer(ask, caught, folder)
        picture = io.BytesIO()
        document.plot().savefig(picture, format=file.suffix.lower()[1:])
        with made_folder(file.parent):
            write_atomically(file, picture.getvalue())
        if not (self.asked(Shown).quiet or self.asked(Shown).json):
            typer.echo(f"plot: {file}")
        return document

    def show(self, document: "Document", place: Path | None = None) -> None:
        """Print a document, whose files are in a folder."""
        shown = self.asked(Shown)
        tests = next(iter(self.tests), None)
        show(document, json=shown.json, quiet=shown.quiet, place=place, tests=tests, file=source(self.words))

    def judge(self, ask: Callable[[], "CrossCheck"], caught: Sequence[str], folder: Path) -> None:
        """Answer by a cross-check, and leave with its verdict as the status; of one that is stopped, with the runs that
        had ended.  Raises typer's Exit.
        """
        from compare.crosscheck import Interrupted

        stopped: list[Interrupted] = []

        def ended() -> "CrossCheck":
            try:
                return ask()
            except Interrupted as interrupted:
                stopped.append(interrupted)
                return interrupted.result

        result = self.answer(ended, caught, folder)
        if stopped:
            self.tests.clear()  # they have the runs that had ended
            raise KeyboardInterrupt(*stopped[0].args)
        for failure in result.failures:  # the status is theirs even where the others agree
            typer.echo(f"compare: {failure.why}", err=True)
        if result.failures:
            raise typer.Exit(Exit.SIMULATOR_FAILED)
        raise typer.Exit(Exit.AGREES if result.verdict == "agrees" else Exit.DISAGREES)

    def files(self, name: str) -> list[Path]:
        """The files of an option that may be repeated."""
        return cast(list[Path], self.words[name] or [])

    @property
    def case(self) -> str:
        """The linkage that is meant, as it was typed."""
        return cast(str, self.words["case"])

    @property
    def stem(self) -> str:
        """The name of the case, after which folders are named."""
        return named_after(self.case)


def command(*questions: type[Question]) -> Callable[[Callable[[CommandLine], None]], Callable[..., None]]:
    """Make of a function of a line a command that has the options of these questions."""

    def of(run: Callable[[CommandLine], None]) -> Callable[..., None]:
        def called(context: typer.Context, **words: Any) -> None:
            run(CommandLine(context, questions, words))

        context = inspect.Parameter("context", inspect.Parameter.KEYWORD_ONLY, annotation=typer.Context)
        parameters: dict[str, inspect.Parameter] = {}
        for field, name, option in chain.from_iterable(map(_typed, questions)):
            parameters.setdefault(name, _parameter(field, name, option))
        called.__signature__ = inspect.Signature([context, *parameters.values()])  # type: ignore[attr-defined]
        called.__name__, called.__doc__, called.__annotations__ = run.__name__, run.__doc__, {}
        return called

    return of


def option_names(question: type[Question]) -> list[str]:
    """The options of a command by which a question is asked."""
    return [name for _, name, _ in _typed(question)]


def _typed(question: type[Question]) -> Iterator[tuple[Field[Any], str, Option]]:
    """The fields of a question that are options of a command, with their names there."""
    for field in arguments(question):
        option = option_of(field.type)
        if option is not None and option.typed:
            yield field, option.name or field.name, option


def _parameter(field: Field[Any], name: str, option: Option) -> inspect.Parameter:
    """An option as typer takes it from a function's signature."""
    kind, left_out = option.kind, option.left_out
    default = field.default if left_out is LeftOut.AS_ARGUMENT else left_out
    word: Any = kind.word
    required = default in (MISSING, LeftOut.REFUSED)
    default = default if required else kind.stands_for(default)
    if kind.repeated:
        word = list[word]
    bounds = {"min": kind.least, "max": kind.most} if isinstance(kind, Whole) else {}
    shown: dict[str, Any] = {"help": option.typed_help, "metavar": kind.metavar, **bounds}
    flags = [f"--{name.replace('_', '-')}", *filter(None, [option.also])]
    info = typer.Argument(**shown) if option.positional else typer.Option(*flags, **shown)
    return inspect.Parameter(
        name,
        inspect.Parameter.KEYWORD_ONLY,
        default=inspect.Parameter.empty if required else default,
        annotation=Annotated[word if default is not None else word | None, info],
    )

"""What every command shares: exit statuses, and foreseen faults as one sentence each."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from enum import IntEnum
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import typer

from analytic.errors import Error
from compare.ci import annotation, head_summary, in_workflow, source
from compare.recorded.errors import first_faults

if TYPE_CHECKING:
    from analytic.mechanism import Mechanism

EVERY_PIN = "*"  # in place of a joint's name, where a number goes for every revolute one
LONGEST_SENTENCE = 1000  # characters of a sentence; what is longer repeats somebody's file


class Exit(IntEnum):
    """Exit statuses of every command."""

    AGREES = 0
    DISAGREES = 1
    BAD_INPUT = 2
    SIMULATOR_FAILED = 3
    INTERRUPTED = 130  # 128 + SIGINT
    READER_GONE = 141  # 128 + SIGPIPE


@contextmanager
def complaints(
    context: typer.Context | None = None, names: Mapping[str, str] = MappingProxyType({})
) -> Iterator[list[str]]:
    """Turn every foreseen fault into one sentence on standard error and its exit status; collect warnings.

    With the ``context`` of a command, and the ``names`` of its options by argument, a fault of an argument names the
    option in which it was typed.
    """
    caught: list[str] = []

    def note(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
        if issubclass(category, RuntimeWarning):
            return  # numpy's remark on a number that is none: the result that it belongs to has failed, and says so
        if str(message) in caught:
            return  # it is said once, of however many runs
        caught.append(str(message))
        typer.echo(f"warning: {printable(str(message))}", err=True)

    from pydantic import ValidationError

    from sim_models.engine import SimulationError, SimulatorMissing

    file = "" if context is None else source(context.params)
    try:
        with warnings.catch_warnings():
            warnings.showwarning = note
            warnings.simplefilter("ignore", DegreesWarning)
            yield caught
    except ArgumentError as error:
        raise stop(_as_typed(error, context, names), Exit.BAD_INPUT, file) from None
    except SimulationError as error:
        raise stop(error.said(() if context is None else context.params), Exit.SIMULATOR_FAILED, file) from None
    except SimulatorMissing as error:
        raise stop(error, Exit.SIMULATOR_FAILED, file) from None
    except Error as error:
        raise stop(error, Exit.BAD_INPUT, file, lambda text: _with_options(text, context, names)) from None
    except ValidationError as error:
        messages = (fault["msg"].removeprefix("Value error, ") for fault in error.errors())
        raise stop("; ".join(messages), Exit.BAD_INPUT, file) from None
    except KeyboardInterrupt as interrupt:
        raise stop("; ".join(["stopped", *map(str, interrupt.args)]), Exit.INTERRUPTED, file) from None


class DegreesWarning(UserWarning):
    """Angles (rad) that a function was given look like degrees.  A command takes degrees, and gives none."""


class OptionError(Error, ValueError):
    """A command-line option cannot be used; the message says what is accepted."""


class ArgumentError(OptionError):
    """An argument of a function cannot be used; the message says what is accepted.

    Another argument that it speaks of stands in backquotes, so that a command can name its option instead.
    """

    def __init__(self, argument: str, why: str) -> None:
        super().__init__(argument, why)
        self.argument, self.why = argument, why

    def __str__(self) -> str:
        return f"{self.argument}: {self.why}"


def unusable(argument: str, given: object, accepted: str) -> ArgumentError:
    """The error of an argument that cannot be what was given; ``accepted`` says what it can be."""
    from analytic.mechanism.errors import quoted

    said = quoted(given)
    said = f"a {type(given).__name__}" if "\n" in said else said  # a frame, which Python writes in lines
    return ArgumentError(argument, f"{said} cannot be used; give {accepted}")


def _as_typed(error: ArgumentError, context: typer.Context | None, names: Mapping[str, str]) -> str:
    """A fault of an argument, as one of the option that it came from."""

    name = names.get(error.argument, error.argument)
    if context is None or name not in context.params:
        return str(error)
    value = context.params[name]
    why = _with_options(error.why, context, names)
    typed = "" if value in (None, True) else f" {','.join(map(str, value)) if isinstance(value, list) else value}"
    why = why.removeprefix(f"{typed.strip()}: ")  # the value is said once
    if any(each.name == name and each.param_type_name == "argument" for each in context.command.params):
        return f"{typed.strip()}: {why}"
    return f"{_with_options(f'`{error.argument}`', context, names)}{typed}: {why}"


def _with_options(text: str, context: typer.Context | None, names: Mapping[str, str]) -> str:
    """A text in which an argument in backquotes, if the command has it, is its option."""

    def option(argument: re.Match[str]) -> str:
        name = names.get(argument[1], argument[1])
        known = context is not None and name in context.params
        return f"--{name.replace('_', '-')}" if known else argument[0]

    return re.sub(r"`(\w+)`", option, text)


def printable(text: str) -> str:
    """Text in which a line break or a control character of somebody's file is spelled out, so that it cannot move a
    terminal's cursor.
    """
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


class Stopped(typer.Exit):
    """The end of a command that has no answer; ``why`` is what it said."""

    def __init__(self, status: Exit, why: str) -> None:
        super().__init__(status)
        self.why = why


def stop(error: object, status: Exit, file: str = "", told: Callable[[str], str] = str) -> Stopped:
    """Say why on standard error, in one line, or one for each fault of a file, each as it is ``told``, and mark it in a
    workflow of GitHub; raise what this returns.
    """
    faults = getattr(error, "faults", ())
    several = first_faults(faults) if len(faults) > 1 else [str(error)]
    marked = several[1:] or several  # not the line that says how many there are
    for fault in several:
        text = printable(told(fault))
        if len(text) > LONGEST_SENTENCE:  # the file and the remedy are at the ends
            text = f"{text[: LONGEST_SENTENCE // 2]} ... {text[-LONGEST_SENTENCE // 2 :]}"
        typer.echo(f"compare: {text}", err=True)
        if in_workflow() and fault in marked and status in (Exit.BAD_INPUT, Exit.SIMULATOR_FAILED):
            typer.echo(annotation(text, "compare", file), err=True)
    if status != Exit.INTERRUPTED:
        head_summary(f"✗ no answer: {printable(told(marked[0]))}{' and more' * (len(marked) > 1)}")
    return Stopped(status, "; ".join(marked))


def no_pin(name: str, pins: Sequence[str], linkage: Mechanism) -> str:
    """What there is to say of a name that is none of a linkage's joints that may have clearance: of these, its revolute
    ones, and of blocks with a guide.
    """
    joint = next((j for j in linkage.joints if j.name == name), None)
    if joint is not None and joint.prismatic and joint.guide is None:
        return (
            f"{name!r} is a prismatic joint of {linkage.name}; give it guide = [length, height] (m) of its block first"
        )
    blocks = [other for other in linkage.may_be_loose if linkage.joint(other).prismatic]
    those = ", ".join([*pins, *(f"{other} (a block)" for other in blocks)])
    kinds = "a joint that may have clearance, revolute or with a block in its guide," if blocks else "a revolute joint"
    return f"{name!r} is not {kinds} of {linkage.name}; " + (f"they are {those}" if those else "it has none")

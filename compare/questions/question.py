"""A question as a frozen type, and the function that answers it as a person calls it: with its fields as arguments."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Collection, Mapping
from dataclasses import Field, dataclass, fields
from difflib import get_close_matches
from textwrap import fill
from typing import TYPE_CHECKING, Any, ForwardRef, ParamSpec, TypeVar, cast, dataclass_transform, get_args

from analytic.errors import warn
from compare.progress import progress_bar
from compare.questions.option import Option

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

P = ParamSpec("P")
Q = TypeVar("Q", bound="Question")
R = TypeVar("R")
HELP_WIDTH = 116  # characters of a line of help, which Python indents by four


@dataclass_transform(eq_default=False, frozen_default=True)
class Question:
    """What is asked: a class derived from this is a frozen dataclass, of which each field is an argument with its
    default; one whose annotation has an :class:`~compare.questions.option.Option` is an option of the command too.

    Two of them are not compared, as arrays in them could not be.
    Raises ArgumentError for an argument that cannot be what it is given.
    """

    def __init_subclass__(cls) -> None:
        dataclass(frozen=True, eq=False)(cls)

    def __post_init__(self) -> None:
        for each in arguments(type(self)):
            option, given = option_of(each.type), getattr(self, each.name)
            if option is not None and given is not each.default:
                object.__setattr__(self, each.name, option.kind.check(given, each.name))


def arguments(question: type[Question]) -> tuple[Field[object], ...]:
    """The fields of a question, in the order in which a function takes them."""
    every = fields(cast("type[DataclassInstance]", question))
    return tuple(sorted(every, key=lambda field: bool(field.kw_only)))


def options(question: type[Question]) -> Mapping[str, Option]:
    """The option of each argument that has one."""
    return {each.name: option for each in arguments(question) if (option := option_of(each.type)) is not None}


def option_of(annotation: object) -> Option | None:
    """The option in an annotation."""
    return next((each for each in get_args(annotation)[1:] if isinstance(each, Option)), None)


def answers(question: Callable[P, Q]) -> Callable[[Callable[[Q], R]], Callable[P, R]]:
    """Make of the function that answers a question one that takes its fields as arguments, with the help of each."""

    def of(answer: Callable[[Q], R]) -> Callable[P, R]:
        @functools.wraps(answer)
        def asked(*arguments: P.args, **named: P.kwargs) -> R:
            now = _renamed(question, named)
            check_names(answer.__name__, known, now)
            try:
                signature.bind(*arguments, **now)
            except TypeError as error:
                raise TypeError(f"{answer.__name__}(): {error}") from None
            given = question(*arguments, **now)
            with progress_bar(getattr(given, "progress", None), answer.__name__.replace("_", " ")):
                return answer(given)

        assert isinstance(question, type)
        known = [each.name for each in arguments(question)]
        returns = inspect.signature(answer).return_annotation
        signature = inspect.signature(question).replace(return_annotation=returns)
        asked.__signature__ = signature.replace(  # type: ignore[attr-defined]
            parameters=[each.replace(annotation=_type(each.annotation)) for each in signature.parameters.values()]
        )
        helps = [
            fill(f"``{name}``   {option.python_help}", HELP_WIDTH, subsequent_indent="  ")
            for name, option in options(question).items()
        ]
        asked.__doc__ = "\n".join([inspect.cleandoc(answer.__doc__ or ""), "", *helps])
        return asked

    return of


def _renamed(question: object, named: Mapping[str, object]) -> Any:
    """Arguments by the names that they have now; warns of one by which it was called before."""
    assert isinstance(question, type)
    now = dict(named)
    for name, option in options(question).items():
        if option.formerly in now and name not in now:
            text = f"{option.formerly}= is called {name}= now, as on the command line"
            warn(text, DeprecationWarning)
            now[name] = now.pop(option.formerly)
    return now


def check_names(called: str, known: Collection[str], named: Mapping[str, object]) -> None:
    """Raise TypeError for an argument that is not among those of the function that is ``called`` so."""
    for name in (name for name in named if name not in known):
        from analytic.mechanism.model import changed_by

        near = get_close_matches(name, known, 1)
        other = f"did you mean {near[0]!r}?" if near else f"it has {', '.join(known)}"
        own = None if near and near[0].startswith(name) else changed_by(name)
        raise TypeError(
            f"{called}() has no argument {name!r}; {f'{own} of the mechanism, or by sweep' if own else other}"
        )


def _type(annotation: Any) -> Any:
    """The type of an argument as it is written, without its option."""
    inner = get_args(annotation)[0] if option_of(annotation) is not None else annotation
    return inner.__forward_arg__ if isinstance(inner, ForwardRef) else inner

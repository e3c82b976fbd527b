"""Docstrings as Markdown: the roles and tables of reStructuredText in them become what the site can show.  A function
that answers a question is shown with the arguments that it takes, as Python's own help does.
"""

from __future__ import annotations

import inspect
import re
from importlib import import_module
from typing import Any

import griffe

ROLE = re.compile(r":(?:class|func|meth|mod|data|attr):`~?([^`]+)`")
TABLE = re.compile(r"(?ms)^=+(?: +=+)+ *$.*?^=+(?: +=+)+ *$.*?^=+(?: +=+)+ *$")
HELP = re.compile(r"(?m)^``\w+``   .*(?:\n  .*)*")
LEFT_ALIGNED = re.compile(r"(?m)^``(\w+)``   +(?=\S)")


def as_markdown(text: str) -> str:
    """A docstring without roles, with its tables as blocks of code and its definitions as a list."""
    text = ROLE.sub(r"`\1`", text)
    text = TABLE.sub(lambda found: "```text\n" + found[0] + "\n```", text)
    return LEFT_ALIGNED.sub(r"- `\1`: ", text)


class Markdown(griffe.Extension):
    """Rewrites every docstring as it is read."""

    def on_instance(self, *, obj: Any, **_: Any) -> None:
        """Rewrite one docstring, and give a function the signature that it has."""
        if obj.is_function and any(str(each.value).startswith("answers(") for each in obj.decorators):
            function = getattr(import_module(obj.module.path), obj.name)
            obj.docstring.value = HELP.sub(lambda help_: help_[0].replace("<", "&lt;"), inspect.getdoc(function))
            obj.parameters = griffe.Parameters(*map(_parameter, inspect.signature(function).parameters.values()))
        if obj.docstring is not None:
            obj.docstring.value = as_markdown(obj.docstring.value)


def _parameter(each: inspect.Parameter) -> griffe.Parameter:
    """An argument as the site shows it."""
    kind, required = griffe.ParameterKind(each.kind.description), each.default is inspect.Parameter.empty
    annotation = each.annotation if isinstance(each.annotation, str) else inspect.formatannotation(each.annotation)
    return griffe.Parameter(
        each.name, kind=kind, annotation=annotation, default=None if required else repr(each.default)
    )

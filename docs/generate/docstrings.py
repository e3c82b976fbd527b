"""Docstrings as Markdown: the roles and tables of reStructuredText in them become what the site can show."""

from __future__ import annotations

import re
from typing import Any

import griffe

ROLE = re.compile(r":(?:class|func|meth|mod|data|attr):`~?([^`]+)`")
TABLE = re.compile(r"(?ms)^=+(?: +=+)+ *$.*?^=+(?: +=+)+ *$.*?^=+(?: +=+)+ *$")
LEFT_ALIGNED = re.compile(r"(?m)^``(\w+)``   +(?=\S)")


def as_markdown(text: str) -> str:
    """A docstring without roles, with its tables as blocks of code and its definitions as a list."""
    text = ROLE.sub(r"`\1`", text)
    text = TABLE.sub(lambda found: "```text\n" + found[0] + "\n```", text)
    return LEFT_ALIGNED.sub(r"- `\1`: ", text)


class Markdown(griffe.Extension):
    """Rewrites every docstring as it is read."""

    def on_instance(self, *, obj: Any, **_: Any) -> None:
        """Rewrite one docstring."""
        if obj.docstring is not None:
            obj.docstring.value = as_markdown(obj.docstring.value)

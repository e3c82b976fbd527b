"""An XML file whose start tags can be changed while every other byte of it stays as it is."""

from __future__ import annotations

import re
from dataclasses import dataclass
from xml.parsers import expat
from xml.sax.saxutils import quoteattr


@dataclass(frozen=True)
class Tag:
    """A start tag: its element's name and attributes, the tag that it lies in (-1: none), and its bytes."""

    name: str
    attributes: dict[str, str]
    within: int
    start: int
    end: int


class XmlText:
    """The start tags of an XML file in the order of the file, and what is to be changed in them."""

    def __init__(self, text: bytes) -> None:
        """Read them; raises expat.ExpatError for what is no XML."""
        self.text, self.tags = text, list[Tag]()
        self._changes: dict[int, dict[str, str | None]] = {}
        self._inside: dict[int, str] = {}
        open_tags = [-1]
        parser = expat.ParserCreate()

        def start(name: str, attributes: dict[str, str]) -> None:
            at = parser.CurrentByteIndex
            self.tags.append(Tag(name, attributes, open_tags[-1], at, _end(text, at)))
            open_tags.append(len(self.tags) - 1)

        parser.StartElementHandler = start
        parser.EndElementHandler = lambda name: open_tags.pop()
        parser.Parse(text, True)

    def children(self, of: int, *names: str) -> list[int]:
        """The tags of these names directly within another."""
        return [k for k, tag in enumerate(self.tags) if tag.within == of and (not names or tag.name in names)]

    def named(self, *names: str) -> list[int]:
        """All tags of these names."""
        return [k for k, tag in enumerate(self.tags) if tag.name in names]

    def lies_in(self, tag: int, name: str) -> bool:
        """Whether a tag lies in one of this name, however deep."""
        while (tag := self.tags[tag].within) >= 0:
            if self.tags[tag].name == name:
                return True
        return False

    def set(self, tag: int, **attributes: str | None) -> None:
        """Give a tag attributes; None takes one away."""
        self._changes.setdefault(tag, {}).update(attributes)

    def insert(self, tag: int, element: str) -> None:
        """Put an element first in another, on the line of its tag."""
        self._inside[tag] = self._inside.get(tag, "") + element

    def changed(self) -> bytes:
        """The file with the changes."""
        text = self.text
        for k in sorted({*self._changes, *self._inside}, reverse=True):
            tag = self.tags[k]
            written = text[tag.start : tag.end].decode("utf-8")
            for name, value in self._changes.get(k, {}).items():
                written = _with(written, name, value)
            inside = self._inside.get(k, "")
            if inside and written.endswith("/>"):
                written = f"{written[:-2].rstrip()}>{inside}</{tag.name}>"
            else:
                written += inside
            text = text[: tag.start] + written.encode() + text[tag.end :]
        return text


def _end(text: bytes, start: int) -> int:
    """Where a start tag ends: after its '>', which may be in a quoted value too."""
    tag = re.compile(rb"<[^\s/>]+(?:[^>\"']|\"[^\"]*\"|'[^']*')*>").match(text, start)
    assert tag  # of what the parser took for one
    return tag.end()


def _with(tag: str, name: str, value: str | None) -> str:
    """A start tag with an attribute, or without it."""
    there = re.compile(rf"(\s+){re.escape(name)}\s*=\s*(\"[^\"]*\"|'[^']*')")
    if value is None:
        return there.sub("", tag, count=1)
    if there.search(tag):
        return there.sub(lambda found: f"{found[1]}{name}={quoteattr(value)}", tag, count=1)
    close = "/>" if tag.endswith("/>") else ">"
    return f"{tag[: -len(close)].rstrip()} {name}={quoteattr(value)}{close}"

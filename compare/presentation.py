"""How each kind of result is shown, and what an earlier one leaves behind: registries that :mod:`compare.report` fills,
so that no result imports a page or all other kinds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Generic, TypeVar, cast

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.console import Console

    from compare.ci import JUnitSuite


D = TypeVar("D", contravariant=True)
LIST_HAS_NO_PICTURE = "is a list and has no picture; use to_dataframe()"


@dataclass(frozen=True)
class Presentation(Generic[D]):
    """How a kind of result is shown: a short piece of HTML for a notebook, a table on a terminal; text by file name
    beside its JSON file; a drawing into a matplotlib figure, or what to do in its place, and one of signals by name;
    what it judges as test cases.
    """

    summary_html: Callable[[D], str]
    print_table: Callable[[D, Console], None]
    files: Callable[[D], dict[str, str]] = lambda result: {}
    plot: Callable[[D, Figure], None] | None = None
    plot_signals: Callable[[D, Figure, Sequence[str]], None] | None = None
    no_picture: str = "has no picture; print it"
    judged: Callable[[D], Sequence[JUnitSuite]] = lambda result: ()


PRESENTATIONS: dict[str, str] = {}
"""By the name of a kind of result, where its presentation is (``module:name``): it is imported when the first one of
the kind is shown."""
PICTURES: dict[str, str] = {}
"""By its name, where what draws a picture of a part of a result into a matplotlib figure is (``module:name``)."""
TABLES: dict[str, str] = {}
"""By its name, where what makes the rows of a table of a part of a result is (``module:name``)."""
LEFT_OVER: list[Callable[[Path, set[str]], set[str]]] = []
"""What tells which other files of a folder belong to earlier results that lose one of these names."""


def presentation(result: D) -> Presentation[D]:
    """How a result of its kind is shown, or of the nearest kind that it is one of."""
    kind = next(base.__name__ for base in type(result).__mro__ if base.__name__ in PRESENTATIONS)
    return cast(Presentation[D], resolve_name(PRESENTATIONS[kind]))


def picture(name: str) -> Callable[..., None]:
    """What draws the picture of that name."""
    return cast(Callable[..., None], resolve_name(PICTURES[name]))


def table(name: str) -> Callable[[D], list[Mapping[str, float | str | None]]]:
    """What makes the rows of the table of that name."""
    return cast("Callable[[D], list[Mapping[str, float | str | None]]]", resolve_name(TABLES[name]))

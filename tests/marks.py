"""Marks on some rows of a table."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Any

import pytest


def slow(*rows: Any) -> list[Any]:
    """Rows of a table for the long suite; a row of several parameters is a tuple."""
    return [pytest.param(*(row if isinstance(row, tuple) else (row,)), marks=pytest.mark.slow) for row in rows]


def slow_but(quick: Collection[Any], rows: Iterable[Any]) -> list[Any]:
    """Rows of a table, of which only the ``quick`` ones are for the short suite as well."""
    rows = list(rows)
    unknown = [row for row in quick if row not in rows]
    assert not unknown, f"no rows of the table: {unknown}"
    return [row if row in quick else slow(row)[0] for row in rows]

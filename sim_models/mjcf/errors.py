"""Faults of somebody's MJCF file."""

from __future__ import annotations

from analytic.errors import Error


class MjcfError(Error, ValueError):
    """An MJCF file cannot be used; the message names file, place, value and remedy."""

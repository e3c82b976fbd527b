"""Which engines can be used on this machine."""

from __future__ import annotations

from functools import cache

from sim_models.engine import ENGINES, SimulatorMissing, engine


@cache
def missing(name: str) -> str:
    """Why an engine cannot be used here, in its own words; empty if it can."""
    try:
        engine(name)
    except SimulatorMissing as why:
        return str(why)
    return ""


def present() -> tuple[str, ...]:
    """The engines that can."""
    return tuple(name for name in ENGINES if not missing(name))

"""What computed a result: the versions of its packages and engines."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from types import MappingProxyType

from sim_models.engine import declared, installed_version


def versions(engines: Mapping[str, str] = MappingProxyType({})) -> dict[str, str]:
    """Version of Python, of this package and numpy, and of these engines, by name."""
    packages = {name: installed_version(name) or "not installed" for name in ("linkage-crosscheck", "numpy")}
    return {"python": platform.python_version(), **packages, **engines}


def installed(*simulators: str) -> dict[str, str]:
    """The versions of engines, as their packages are installed."""
    return {name: installed_version(declared(name).package) or "not installed" for name in simulators}

"""Accuracy of planar linkages with joint clearance, cross-checked against multibody simulations.

    import numpy as np
    import linkage_crosscheck as lc

    angles = np.radians(np.arange(20, 161, 5))
    result = lc.crosscheck("paper", simulators="mujoco", clearance={"B": 1e-4}, angles=angles)
    result.verdict, result.run("mujoco", "contact").simulated["reaction_B_angle"]
    result.plot()
    result.to_dataframe()
    result.write("my-report")

SI units and radians throughout.  Every fault that is foreseen is an ``lc.Error`` whose message is one sentence; it is
a ValueError too, or a RuntimeError where a simulator is missing or fails:

    try:
        result = lc.crosscheck("my-linkage.toml")
    except lc.Error as error:
        print(error)

Every name here is imported when it is first used, so that importing this costs
nothing; the command line (``compare``, ``linkage-crosscheck``) is a thin layer over the same functions.
"""

from __future__ import annotations

import importlib
import importlib.metadata
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from analytic.errors import Error
    from analytic.mechanism import Body, Drive, Joint, Load, Mechanism, Spring
    from analytic.mechanism.file import load
    from compare.accuracy import accuracy
    from compare.analyse import analyse, simulate
    from compare.baseline.check import check_baselines
    from compare.catalogue import cases, effects, simulators
    from compare.check import check
    from compare.crosscheck import crosscheck
    from compare.diagnose.begin import begin
    from compare.diagnose.data.measured import load_measured as read_measured
    from compare.diagnose.preview import preview
    from compare.diagnose.workflow import diagnose
    from compare.domain_map.validity import validity
    from compare.export import export
    from compare.history import runs
    from compare.imported import import_mjcf
    from compare.platform import platform_accuracy
    from compare.show import show

_WHERE = {
    "Body": "analytic.mechanism",
    "Drive": "analytic.mechanism",
    "Error": "analytic.errors",
    "Joint": "analytic.mechanism",
    "Load": "analytic.mechanism",
    "Mechanism": "analytic.mechanism",
    "Spring": "analytic.mechanism",
    "accuracy": "compare.accuracy",
    "analyse": "compare.analyse",
    "begin": "compare.diagnose.begin",
    "cases": "compare.catalogue",
    "check": "compare.check",
    "check_baselines": "compare.baseline.check",
    "crosscheck": "compare.crosscheck",
    "diagnose": "compare.diagnose.workflow",
    "effects": "compare.catalogue",
    "export": "compare.export",
    "import_mjcf": "compare.imported",
    "load": "analytic.mechanism.file",
    "platform_accuracy": "compare.platform",
    "preview": "compare.diagnose.preview",
    "read_measured": "compare.diagnose.data.measured:load_measured",
    "runs": "compare.history",
    "show": "compare.show",
    "simulate": "compare.analyse",
    "simulators": "compare.catalogue",
    "validity": "compare.domain_map.validity",
}

__all__ = [
    "Body",
    "Drive",
    "Error",
    "Joint",
    "Load",
    "Mechanism",
    "Spring",
    "accuracy",
    "analyse",
    "begin",
    "cases",
    "check",
    "check_baselines",
    "crosscheck",
    "diagnose",
    "effects",
    "export",
    "import_mjcf",
    "load",
    "platform_accuracy",
    "preview",
    "read_measured",
    "runs",
    "show",
    "simulate",
    "simulators",
    "validity",
]


def __getattr__(name: str) -> object:
    if name == "__version__":
        return importlib.metadata.version("linkage-crosscheck")
    if name not in _WHERE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}; it has {', '.join(__all__)}")
    module, _, other = _WHERE[name].partition(":")
    value = getattr(importlib.import_module(module), other or name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*__all__, "__version__"]

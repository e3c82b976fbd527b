"""Accuracy of planar linkages with joint clearance, cross-checked against multibody simulations.

    import numpy as np
    import linkage_crosscheck as lc

    angles = np.radians(np.arange(20, 161, 5))
    result = lc.crosscheck("paper", simulator="mujoco", clearance={"B": 1e-4}, angles=angles)
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
from difflib import get_close_matches
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from analytic.errors import Error as Error
    from analytic.mechanism import Body as Body
    from analytic.mechanism import Drive as Drive
    from analytic.mechanism import Joint as Joint
    from analytic.mechanism import Load as Load
    from analytic.mechanism import Mechanism as Mechanism
    from analytic.mechanism import Spring as Spring
    from analytic.mechanism.file import load as load
    from compare.accuracy import accuracy as accuracy
    from compare.analyse import analyse as analyse
    from compare.analyse import simulate as simulate
    from compare.applied import apply as apply
    from compare.baseline.check import check_baselines as check_baselines
    from compare.catalogue import cases as cases
    from compare.catalogue import effects as effects
    from compare.catalogue import simulators as simulators
    from compare.check import check as check
    from compare.crosscheck import crosscheck as crosscheck
    from compare.diagnose.begin import begin as begin
    from compare.diagnose.data.measured import load_measured
    from compare.diagnose.data.measured_frames import measured as measured
    from compare.diagnose.plan.workflow import plan as plan
    from compare.diagnose.prediction import predict as predict
    from compare.diagnose.preview import preview as preview
    from compare.diagnose.workflow import diagnose as diagnose
    from compare.domain_map.validity import validity as validity
    from compare.export import export as export
    from compare.history import runs as runs
    from compare.imported import import_mjcf as import_mjcf
    from compare.mechanism_fields import fields as fields
    from compare.parametric import sweep as sweep
    from compare.platform import platform_accuracy as platform_accuracy
    from compare.show import show as show

    read_measured = load_measured


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
    "apply": "compare.applied",
    "begin": "compare.diagnose.begin",
    "cases": "compare.catalogue",
    "check": "compare.check",
    "check_baselines": "compare.baseline.check",
    "crosscheck": "compare.crosscheck",
    "diagnose": "compare.diagnose.workflow",
    "effects": "compare.catalogue",
    "export": "compare.export",
    "fields": "compare.mechanism_fields",
    "import_mjcf": "compare.imported",
    "load": "analytic.mechanism.file",
    "measured": "compare.diagnose.data.measured_frames",
    "plan": "compare.diagnose.plan.workflow",
    "platform_accuracy": "compare.platform",
    "predict": "compare.diagnose.prediction",
    "preview": "compare.diagnose.preview",
    "read_measured": "compare.diagnose.data.measured:load_measured",
    "runs": "compare.history",
    "show": "compare.show",
    "simulate": "compare.analyse",
    "simulators": "compare.catalogue",
    "sweep": "compare.parametric",
    "validity": "compare.domain_map.validity",
}

__all__ = [*_WHERE]


def __getattr__(name: str) -> object:
    if name == "__version__":
        return importlib.metadata.version("linkage-crosscheck")
    if name not in _WHERE:
        near = get_close_matches(name, __all__, 1)
        remedy = f"did you mean {near[0]!r}?" if near else f"it has {', '.join(__all__)}"
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}; {remedy}")
    module, _, other = _WHERE[name].partition(":")
    value = getattr(importlib.import_module(module), other or name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*__all__, "__version__"]

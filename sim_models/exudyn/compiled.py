"""Forces on bodies in functions that Exudyn compiles, on the coordinates of all that they act between."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

_Exu = Any  # an object of Exudyn's, or a number of its symbolic functions
Forces = Callable[[_Exu, _Exu, _Exu], _Exu]  # symbolic, coordinates, rates: generalised forces (N, N, N.m of each body)


def add_forces(exu: _Exu, mbs: _Exu, items: _Exu, nodes: list[_Exu], forces: Forces) -> _Exu:
    """Add forces between the bodies of these nodes to a system; the object's number.

    Exudyn's helper for symbolic functions does not know how many coordinates there are.
    """
    symbolic, name, size = exu.symbolic, "forceUserFunction", 3 * len(nodes)
    number = mbs.AddObject(
        items.ObjectGenericODE2(nodeNumbers=nodes, massMatrix=np.zeros((size, size)), forceUserFunction=lambda *_: [])
    )
    before = symbolic.GetRecording()
    symbolic.SetRecording(True)
    t, item = symbolic.Real("t", 0.0), symbolic.Real("item", 0)
    q, q_t = (symbolic.Vector(each, [0.0] * size) for each in ("q", "q_t"))
    value = forces(symbolic, q, q_t)
    symbolic.SetRecording(before)
    compiled = symbolic.UserFunction()
    described = {
        "functionName": "forces",
        "argList": [mbs, t, item, q, q_t],
        "argTypeList": ["MainSystem", "Real", "Index", "StdVector", "StdVector"],
        "returnValue": value,
        "returnType": "StdVector",
    }
    compiled.SetUserFunctionFromDict(mbs, described, name, number, "None")
    mbs.SetObjectParameter(number, name, compiled)
    return number

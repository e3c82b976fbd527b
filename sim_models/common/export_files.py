"""Texts that every engine's export writes: the expected signals as CSV, and JSON that a person can read."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable, Mapping

import numpy as np

from sim_models.engine import Trace


def expected(trace: Trace, order: Iterable[int] | None = None, *, crank: bool = True) -> str:
    """The trace as CSV with all digits, rows in this order; left out, in the order of passing.

    Where no ``crank`` tells where the linkage is, there is no column of its angle.
    """
    columns = {
        **({"crank_angle": trace.crank_angle} if crank else {}),
        **({} if trace.time is None else {"time": trace.time}),
        **trace.signals,
    }
    if order is None:
        order = range(trace.crank_angle.size) if trace.time is None else np.argsort(trace.time, kind="stable").tolist()
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(columns)
    table.writerows([repr(float(values[i])) for values in columns.values()] for i in order)
    return text.getvalue()


def lines(model: Mapping[str, object]) -> str:
    """JSON with a line for each thing."""
    return "{\n" + ",\n".join(f"{json.dumps(name)}: {_block(value)}" for name, value in model.items()) + "\n}\n"


def _block(value: object) -> str:
    if isinstance(value, dict) and value and isinstance(next(iter(value.values())), dict | list | tuple):
        return (
            "{\n" + ",\n".join(f"  {json.dumps(k)}: {json.dumps(v, allow_nan=False)}" for k, v in value.items()) + "\n}"
        )
    if isinstance(value, list) and value and isinstance(value[0], dict | tuple):
        return "[\n" + ",\n".join(f"  {json.dumps(v, allow_nan=False)}" for v in value) + "\n]"
    return json.dumps(value, allow_nan=False)

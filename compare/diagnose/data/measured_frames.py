"""Measured data from memory: frames by run, and in keywords what measured.toml says of them; the reader is the one of
files (:mod:`compare.diagnose.data.measured`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from analytic.mechanism import Mechanism
from analytic.mechanism.file import load
from analytic.mechanism.one_line import shown
from compare.arguments import Linkage
from compare.diagnose.data.measured import recorded
from compare.diagnose.data.measured_file import Entry, Said, checked
from compare.diagnose.data.recording import Measured
from compare.faults import ArgumentError, unusable
from compare.progress import progress_bar
from compare.questions.question import check_names
from compare.recorded.frames import Frame, frame_name, frame_source, is_frame

CALLED = "measured"  # in messages, where those of a file begin with its name
OF_A_RUN = {field.alias or name for name, field in Entry.model_fields.items()} - {"name", "file"}
DRIVE = {"drive_speed", "drive"}  # of a run, of which it has one
OF_THE_WHOLE = ("columns", "tolerance", "prior", "sensor", "context", "optional")
OF_TEXT = ("headings", "skip_rows", "separator", "decimal")  # how a file's text is written

Speed = float | str
"""rad/s, a text with its unit such as "90 rpm", or "measured", "free" or "torque"."""


@progress_bar(what="read measured data")
def measured(
    mechanism: Linkage,
    frames: Mapping[str, Frame],
    *,
    speed: Speed | Mapping[str, Speed] | None = None,
    runs: Mapping[str, Mapping[str, object]] | None = None,
    **said: object,
) -> Measured:
    """Measured data of a mechanism from ``frames``, a data frame or a mapping of headings to numbers (N,) by run, for
    ``lc.diagnose``, ``lc.preview`` and ``lc.plan``.

    Headings are those of a CSV file, ``signal [unit]``, with ``time [s]`` among them.  ``speed`` is that of every run,
    or by run: rad/s, ``"90 rpm"``, ``"measured"`` (follow the encoder), ``"free"`` or
    ``"torque"`` (moved by what its motor gives); left out, the mechanism's.
    ``runs`` has by run the fields of measured.toml's ``[[run]]``, and a keyword that is such a field (``noise``,
    ``drive_angle``, ``start``, ``load``, ``from_rest``, ``role``) is that of every run which has none of its own.
    Other keywords are what measured.toml says at its top: ``columns``, ``tolerance``, ``prior``, ``sensor`` and
    ``context``.

    Raises ArgumentError, MechanismError, or MeasuredError with every fault of the data.
    """
    check_names(CALLED, ["speed", "runs", *OF_TEXT, *OF_THE_WHOLE, *OF_A_RUN], said)
    if not isinstance(frames, Mapping) or not all(isinstance(k, str) and is_frame(v) for k, v in frames.items()):
        raise ArgumentError(
            "frames", f'a {type(frames).__name__} of them cannot be used; give {{"name of run": frame}}'
        )
    written = next((name for name in OF_TEXT if name in said), None)
    if written is not None:
        raise ArgumentError(written, "it says how the text of a file is written, and frames are none; leave it out")
    of_runs = _by_run("runs", {} if runs is None else runs, frames)
    speeds = _by_run("speed", speed, frames) if isinstance(speed, Mapping) else dict.fromkeys(frames, speed)
    of_every = {name: said.pop(name) for name in OF_A_RUN & set(said)}
    tables: list[dict[str, Any]] = []
    for name in frames:
        fields = of_runs.get(name, {})
        if not isinstance(fields, Mapping):
            raise unusable(f"runs[{name!r}]", fields, "a mapping of the fields of a [[run]]")
        driven = _driven(name, speeds.get(name), of_every | dict(fields))
        if driven or DRIVE & set(fields):  # in place of both
            of_run = {key: value for key, value in of_every.items() if key not in DRIVE}
        else:
            of_run = of_every
        tables.append({"name": name, "file": frame_name(name)} | _plain(of_run | dict(fields) | driven))
    nominal = mechanism if isinstance(mechanism, Mechanism) else load(mechanism)
    sources = {table["file"]: table["name"] for table in tables}
    file = checked(CALLED, _plain(said) | {"run": tables}, Said, lambda: nominal, None)
    return recorded(CALLED, CALLED, file, nominal, lambda each: frame_source(sources[each], frames[sources[each]]))


def _by_run(called: str, given: object, frames: Mapping[str, Frame]) -> Mapping[str, Any]:
    """A mapping by run, each of which there is.  Raises ArgumentError."""
    if not isinstance(given, Mapping):
        raise unusable(called, given, "a mapping by run")
    unknown = next((name for name in given if name not in frames), None)
    if unknown is not None:
        raise ArgumentError(called, f"{shown(str(unknown))} is no run; they are {', '.join(map(str, frames))}")
    return given


def _driven(name: str, speed: object, fields: Mapping[str, object]) -> dict[str, object]:
    """How a run is driven, as its ``[[run]]`` says it.  Raises ArgumentError where that is said twice."""
    if speed is None:
        return {}
    twice = next((key for key in DRIVE if key in fields), None)
    if twice is not None:
        raise ArgumentError("speed", f"run {name!r} has {twice} = {shown(str(fields[twice]))} too; keep one")
    return {"drive": speed} if speed in ("measured", "free", "torque") else {"drive_speed": speed}


def _plain(given: Any) -> Any:
    """What TOML would have given: mappings, lists, and Python's own numbers."""
    if isinstance(given, Mapping):
        return {key: _plain(value) for key, value in given.items()}
    if isinstance(given, list | tuple):
        return [_plain(value) for value in given]
    return given.tolist() if isinstance(given, np.ndarray | np.generic) else given

"""A measured.toml to begin with, written from data files and a nominal mechanism: what was guessed is said in it."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from analytic.mechanism import Mechanism
from analytic.mechanism.columns import ANY_LAYOUT, Layout
from analytic.mechanism.errors import quoted
from analytic.mechanism.file import load, shipped_cases
from analytic.mechanism.one_line import count
from analytic.mechanism.signals import unwound
from compare.arguments import path
from compare.diagnose.data.quality import noise, switched
from compare.faults import ArgumentError
from compare.progress import progress_bar
from compare.quantities import amount
from compare.recorded.errors import DataError
from compare.recorded.guess import OFF_SPEED, Guessed, guess
from compare.recorded.likeness import Guess
from compare.recorded.text import MIN_ROWS


@dataclass(frozen=True)
class Begun:
    """The text of a measured.toml, and what was made of the files, in sentences."""

    text: str
    notes: tuple[str, ...]


@progress_bar(what="begin")
def begin(
    files: Sequence[str | Path] | str | Path,
    mechanism: str | Path,
    folder: str | Path = ".",
    *,
    headings: Sequence[str] | None = None,
    split: bool = False,
) -> Begun:
    """A measured.toml for these data files of a linkage, as it would stand in ``folder``: columns matched to signals,
    drives, speeds and directions guessed, noise estimated, runs named after their files.  ``headings`` are those of
    files that have none; with ``split``, each part of a file whose clock starts again is a run.

    Raises MechanismError, ArgumentError, or DataError with every fault of the files.
    """
    given = [files] if isinstance(files, str | Path) else files
    if not isinstance(given, Sequence):
        raise ArgumentError("files", f"{quoted(given)} cannot be used; give the path of a data file, or several")
    if not given:
        raise ArgumentError("files", "there are none; give the data files of the runs")
    nominal, layout = load(mechanism), ANY_LAYOUT if headings is None else Layout.with_headings(headings)
    paths = [path(file, "files") for file in given]
    found: list[Guessed] = []
    faults: list[str] = []
    for file in paths:
        try:
            found += guess(file, nominal, layout, split)
        except DataError as error:
            faults += error.faults
    if faults:
        raise DataError(*faults)
    names = _names([one.file for one in found])
    notes = tuple(note for one in found for note in one.notes)
    head = _head(mechanism, Path(folder), nominal)
    head += f"headings = {json.dumps(layout.headings, ensure_ascii=False)}    # of files without a header\n" * bool(
        headings
    )
    columns = _columns(found)
    runs = [_run(name, one, nominal, Path(folder)) for name, one in zip(names, found, strict=True)]
    return Begun("\n".join([head, columns, *runs]), (*notes, *_told(found)))


def _told(found: Sequence[Guessed]) -> list[str]:
    """How many columns were told by what, in a sentence for each file."""
    said = []
    for one in found:
        sure = sum(g.sure for g in one.guesses)
        guessed = [f"{g.heading} is {g.signal.name}" for g in one.guesses if g.signal is not None and not g.sure]
        left = [g.heading for g in one.guesses if g.signal is None]
        listed = f" ({', '.join(guessed)})" if guessed else ""
        out = f" ({', '.join(left)})" if left else ""
        said.append(
            f"{one.file.name}: {count(sure, 'column')} by heading, {len(guessed)} guessed{listed}, {len(left)} left"
            f" out{out}"
        )
    return said


def _head(mechanism: str | Path, folder: Path, nominal: Mechanism) -> str:
    shipped = str(mechanism) in shipped_cases() and not Path(mechanism).exists()
    where = str(mechanism) if shipped else Path(os.path.relpath(mechanism, folder)).as_posix()
    return (
        "# What was measured, and on what.  Each line that says 'guessed' is to be looked at; SI units and radians.\n"
        f"# Next: compare diagnose measured.toml --check\nmechanism = {_quoted(where)}"
        f"    # {nominal.name}, as you believe it to be\n"
        "# tolerance = { mass = 0.002, length_error = 2e-4 }   # what may be blamed at most\n"
    )


def _columns(found: Sequence[Guessed]) -> str:
    """[columns]: an entry for each heading that does not say itself what it is."""
    entries: dict[str, str] = {}
    told: dict[str, bool] = {}  # what one file tells holds for those that do not
    for one in found:
        for g in one.guesses:
            if g.sure:
                continue
            if g.heading not in entries or (g.signal is not None and not told.get(g.heading)):
                entries[g.heading], told[g.heading] = _entry(g), g.signal is not None
    return "\n".join(["[columns]", *entries.values(), ""]) if entries else ""


def _entry(g: Guess) -> str:
    if g.signal is None:
        return f'{_quoted(g.heading)} = "ignore"    # {g.why}'
    fields = [f'signal = "{g.signal.name}"', f"unit = {_quoted(g.unit)}"]
    fields += [f"scale = {g.scale!r}"] if g.scale != 1.0 else []
    fields += [f"offset = {g.offset!r}"] if g.offset else []
    fields += ["sign = -1"] if g.sign < 0 else []
    return f"{_quoted(g.heading)} = {{ {', '.join(fields)} }}    # guessed: {g.why}"


def _run(name: str, one: Guessed, mechanism: Mechanism, folder: Path) -> str:
    """A [[run]]."""
    file = Path(os.path.relpath(one.file, folder)).as_posix()
    lines = ["[[run]]", f"name = {_quoted(name)}", f"file = {_quoted(file)}"]
    lines += [f"part = {one.part}    # its clock starts again"] if one.part is not None else []
    lines += _drive(one, mechanism)
    time = one.values["time"]
    sigmas = [
        f"{signal} = {noise(time, values):.2g}"
        for signal, values in one.values.items()
        if signal != "time" and np.isfinite(values).sum() >= MIN_ROWS
    ]
    if sigmas:
        lines.append(f"# noise = {{ {', '.join(sigmas)} }}    # one sigma; estimated, as it is if left out")
    lines += [
        f"# no column was taken for {encoder.name}: say in [columns] which one is"
        + ("" if mechanism.several else ", if there is one")
        for encoder in mechanism.encoders
        if encoder.name not in one.values
    ]
    return "\n".join([*lines, ""])


def _drive(one: Guessed, mechanism: Mechanism) -> list[str]:
    """How a run was driven, as its encoder says."""
    if not mechanism.cranked:
        if mechanism.sliding:
            return [
                _by_its_motor(one, mechanism) or 'drive = "measured"    # a slide: or "torque", if its force is given'
            ]
        what = "several drives" if len(mechanism.drives) > 1 else "such a drive"
        return [f'drive = "measured"    # the only kind of run of {what}']
    encoder, time = mechanism.encoder.name, one.values["time"]
    angle = one.values.get(encoder, np.zeros(0))
    here = np.isfinite(angle)
    if mechanism.drive is None or mechanism.drive.speed == "free":
        first = [f"start = {{ {encoder} = {angle[here][0]:.6g} }}    # rad, its first reading"] if here.any() else []
        return ['drive = "free"    # as in the mechanism file', *first]
    if here.sum() < MIN_ROWS:
        speed = mechanism.speed
        said = "# drive_speed = ...    # rad/s, as commanded"
        return [f"drive_speed = {speed!r}    # rad/s, guessed: the mechanism file's own" if speed else said]
    continued = unwound(angle[here])
    slope, zero = np.polyfit(time[here], continued, 1)
    off = float(np.abs(continued - zero - slope * time[here]).max())
    if off > OFF_SPEED or abs(slope) * np.ptp(time[here]) < 10 * OFF_SPEED:
        followed = f'drive = "measured"    # guessed: its crank is up to {amount(off, "rad")} off an even turning'
        return [_by_its_motor(one, mechanism) or followed]
    way = "" if slope > 0 else ", in reverse"
    rpm = f"{slope * 30 / math.pi:.5g} rpm by the encoder{way}"
    return [
        f"drive_speed = {float(f'{slope:.6g}')!r}    # rad/s, guessed: {rpm}; put what was commanded",
        f"drive_angle = {float(f'{zero:.6g}')!r}    # rad at time 0, guessed likewise",
    ]


def _by_its_motor(one: Guessed, mechanism: Mechanism) -> str:
    """That a run moves by what its motor gives, where that is switched: no smooth course has its acceleration."""
    effort = mechanism.efforts[0].name if mechanism.efforts else ""
    if effort not in one.values or not switched(one.values[effort]):
        return ""
    return f'drive = "torque"    # guessed: {effort} is switched; or "measured": the run follows its encoder'


def _names(files: Sequence[Path]) -> list[str]:
    stems = [file.stem.replace("@", "_").strip() or "run" for file in files]
    return [stem if stems.count(stem) == 1 else f"{stem}-{stems[: k + 1].count(stem)}" for k, stem in enumerate(stems)]


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)

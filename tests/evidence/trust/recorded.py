"""Rigs that others measured: a run, or the rest of one, is foretold from what is fitted before it."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from compare.diagnose.data.measured import load_measured
from compare.diagnose.workflow import diagnose
from tests.evidence.results.trust import Foretold

SIMULATOR = "mujoco"
FITTED = 0.6  # of a run's rows, where there is one run alone


def foretold(folder: Path, cases: Iterable[str]) -> Iterator[Foretold]:
    """Each of these cases of a folder, either way round: what is fitted is foretold from what was foretold."""
    for case in cases:
        for backwards in (False, True):
            with tempfile.TemporaryDirectory() as scratch:
                file, says = parted(folder / case, Path(scratch), backwards)
                yield from _held(case, says, file)


def parted(source: Path, to: Path, backwards: bool) -> tuple[Path, str]:
    """A measurement of which a part is there for validation alone, and that part in words."""
    shutil.copy(source / "nominal.toml", to)
    files = sorted(source.glob("*.csv"))
    head, _, rest = (source / "measured.toml").read_text(encoding="utf-8").partition("[[run]]")
    entries = rest.split("[[run]]")
    if len(files) > 1:
        kept = len(entries) - 1 if not backwards else 0
        entries = [e + 'role = "validation"\n' * (i == kept) for i, e in enumerate(entries)]
        for file in files:
            shutil.copy(file, to)
        says = f"run {kept + 1} of {len(entries)}"
    else:
        heading, *rows = files[0].read_text(encoding="utf-8").splitlines()
        cut = round(len(rows) * (1 - FITTED if backwards else FITTED))
        share = f"{100 * (1 - FITTED):.0f} %"
        (whole,) = entries
        name = next(line for line in whole.splitlines() if line.startswith("name"))
        entries = []
        for k, part in enumerate((rows[:cut], rows[cut:])):
            (to / f"part-{k}.csv").write_text("\n".join([heading, *part]) + "\n", encoding="utf-8")
            entry = whole.replace(name, f'name = "part {k + 1}"').replace(files[0].name, f"part-{k}.csv")
            entries.append(entry.rstrip("\n") + "\n" + 'role = "validation"\n' * (k != backwards))
        says = f"{'first' if backwards else 'last'} {share}"
    written = to / "measured.toml"
    written.write_text(head + "".join(f"[[run]]{entry}\n" for entry in entries), encoding="utf-8")
    return written, says


def _held(case: str, says: str, file: Path) -> Iterator[Foretold]:
    found = diagnose(load_measured(file), SIMULATOR, others=False, workers=1)
    for run in found.validation:
        for signal, band in run.prediction.items():
            record = run.signals[signal]
            width = float(np.nanmedian(band.high - band.low))
            peak = float(np.nanmax(np.abs(record.measured)))
            yield Foretold(
                case=case,
                left_out=says,
                simulator=SIMULATOR,
                named=tuple(e.key for e in found.effects),
                verdict=found.verdict,
                signal=signal,
                samples=int(np.isfinite(record.measured).sum()),
                readings=band.covered,
                width=width / peak if peak else None,
                off=record.gap_after,
            )

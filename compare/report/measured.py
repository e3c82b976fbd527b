"""Measured data, shown in a notebook."""

from __future__ import annotations

import numpy as np
from rich.console import Console

from compare.diagnose.data.recording import Measured
from compare.presentation import Presentation
from compare.quantities import amount
from compare.report.tables import html_list, html_table, say


def summary_html(measured: Measured) -> str:
    """Each sensor of each run with its samples and noise, and what was wrong with the data."""
    rows = []
    for run in measured.runs:
        for name, channel in run.channels.items():
            noise = amount(channel.noise, channel.signal.unit) + ("" if channel.noise_given else ", estimated")
            rows.append((run.name, run.role, run.drive, name, str(int(np.isfinite(channel.values).sum())), noise))
    heads = ("run", "role", "drive", "signal", "samples", "noise (1 sigma)")
    faults = (f"{fault.run}, {fault.signal}: {fault.text}" for fault in measured.faults)
    return html_table(rows, heads, repr(measured)) + html_list(faults)


def print_table(measured: Measured, console: Console) -> None:
    """Print the recording in a line."""
    say(console, repr(measured))


PRESENTATION = Presentation(summary_html, print_table)

"""Measured data, shown in a notebook."""

from __future__ import annotations

import html

from compare.diagnose.data.recording import Measured
from compare.quantities import amount


def summary_html(measured: Measured) -> str:
    """Each sensor of each run with its samples and noise, and what was wrong with the data."""
    rows = []
    for run in measured.runs:
        for name, channel in run.channels.items():
            noise = amount(channel.noise, channel.signal.unit) + ("" if channel.noise_given else ", estimated")
            rows.append((run.name, run.role, run.drive, name, str(channel.values.size), noise))
    head = "".join(f"<th>{name}</th>" for name in ("run", "role", "drive", "signal", "samples", "noise (1 sigma)"))
    body = "".join("<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    faults = "".join(f"<li>{html.escape(f'{f.run}, {f.signal}: {f.text}')}</li>" for f in measured.faults)
    return f"<p>{html.escape(repr(measured))}</p><table><tr>{head}</tr>{body}</table><ul>{faults}</ul>"

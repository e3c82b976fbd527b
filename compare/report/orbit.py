"""The paths of pins in their bearings, drawn with matplotlib."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from analytic.mechanism.one_line import count
from compare.report.curves import MOST_CURVES
from compare.results.crosscheck import Run
from compare.results.document import Row

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from compare.results.analysis import Simulation

BLOCK = ((1, 0, -1, 0, 1), (0, 1, 0, -1, 0))  # heights and tilts at which a corner is at its wall


def plot(run: Run | Simulation, rows: Mapping[str, Sequence[Row]], figure: Figure) -> None:
    """The path of each joint's pin in its clearance circle, of a block where its corners come to their walls; each row
    is a point in the colour of the force there.
    """
    shown = list(rows)[:MOST_CURVES]
    for axis, joint in zip(figure.subplots(1, len(shown), squeeze=False)[0], shown, strict=True):
        radius = 1e3 * run.clearance[joint]
        turn = np.linspace(0.0, 2 * np.pi, 121)
        block = f"clearance_{joint}_angle" in run.simulated
        wall = np.array(BLOCK) if block else np.array([np.cos(turn), np.sin(turn)])
        axis.plot(*(radius * wall), "k-", linewidth=0.8)
        watched = run.contact is not None and joint in run.contact.joints
        x, y, force = (
            np.array([row[name] for row in rows[joint]], float) for name in ("journal_x", "journal_y", "contact_force")
        )
        if joint in run.journal and not watched:
            axis.plot(1e3 * run.journal[joint].x, 1e3 * run.journal[joint].y, color="0.7", linewidth=0.6)
        else:
            axis.plot(1e3 * x, 1e3 * y, color="0.7", linewidth=0.6)
        points = axis.scatter(1e3 * x, 1e3 * y, c=force, s=8, zorder=2)
        figure.colorbar(points, ax=axis, label="contact force (N)", location="bottom")
        axis.set_aspect("equal")
        axis.set_title(f"{joint}, {'last revolution' if watched else count(x.size, 'sample')}", fontsize="medium")
        axis.set_xlabel("height across the guide (mm)" if block else "displacement x (mm)")
        axis.set_ylabel("tilt times half length (mm)" if block else "displacement y (mm)")
    more = f"; {len(rows) - len(shown)} more joints" if len(rows) > len(shown) else ""
    figure.suptitle(f"{run.title}{more}")

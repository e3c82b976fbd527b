"""The runs of a cross-check in motion: both sides over the linkage without clearance, and what they say there."""

from __future__ import annotations

import math

import numpy as np
from markupsafe import Markup

from analytic.mechanism.signals import same_turn
from compare.quantities import Quantity
from compare.report.crosscheck_figures import beside, difference
from compare.report.figure import Numbers, scaled
from compare.report.linkage import exaggeration, ideal_poses, in_turn_of, poses_of
from compare.report.mover import Column, Mover, Moving, Read, Side, gap, opens
from compare.report.summary import ShownRun, Summary
from compare.results.crosscheck import Run
from compare.results.document import listed

READ_AS_ZERO = 1e-9  # of a signal's peak: smaller is read as 0
COLUMNS = (Column("Analytic", "analytic", 5), Column("Simulated", "simulated", 5), Column("Difference", "", 3))


def mover(summary: Summary, first: ShownRun, still: Markup) -> Mover:
    """Every run in motion, ``first`` the one that is shown first; ``still`` is for who runs no script."""
    runs = {shown.run.title: _moving(summary, shown) for shown in summary.runs}
    boxes = {"ideal": "without clearance", "analytic": "analytic", "simulated": "simulated", "paths": "paths of joints"}
    boxes = boxes if any(run.clearance for run in runs.values()) else {k: v for k, v in boxes.items() if k != "ideal"}
    return Mover(summary.result.mechanism, runs, boxes, still, first=summary.runs.index(first))


def _moving(summary: Summary, shown: ShownRun) -> Moving:
    run, mechanism = shown.run, summary.result.mechanism
    ideal = ideal_poses(summary.result, run)
    poses = (in_turn_of(poses_of(mechanism, side), ideal) for side in (run.analytic, run.simulated))
    model = f"analytic, {run.analytic_model.replace('_', ' ')}" if run.clearance else "analytic"
    names = (("analytic", model, "analytic"), ("simulated", run.title, run.joint_model))
    return Moving(
        over=shown.over,
        opens=_opens(shown),
        factor=exaggeration(mechanism, run) if ideal else 1,
        clearance=dict(run.clearance),
        flags=dict(run.flags),
        ideal=ideal,
        sides=[Side(*named, pose) for named, pose in zip(names, poses, strict=True)],
        columns=COLUMNS,
        readout=[
            _read(quantity, run, summary.result.runs[0].analytic.get(quantity.signal, np.zeros(0)))
            for quantity in summary.keys()
            if quantity.signal in run.analytic and quantity.signal in run.simulated
        ],
        gaps={joint: [gap(side, joint) for side in (run.analytic, run.simulated)] for joint in run.clearance},
    )


def _opens(shown: ShownRun) -> int:
    """Index of the sample at which the page opens: where a run disagrees most, else the paper's crank angle."""
    run = shown.run
    if run.verdict == "disagrees":
        worst = max((d for d in run.discrepancies if d.verdict == "disagrees"), key=lambda d: d.share or 0.0)
        if worst.at_crank_angle is not None:
            return int(np.argmin(np.abs(run.crank_angle - worst.at_crank_angle)))
    return opens(shown.over)


def _read(quantity: Quantity, run: Run, first: np.ndarray) -> Read:
    """Both sides of a signal and their difference; angles in the turn that the figures have them in, which is that of
    the first run.
    """
    analytic, simulated = (tuple(listed(side[quantity.signal])) for side in (run.analytic, run.simulated))
    if quantity.angular:
        analytic = beside(analytic, tuple(listed(first)), math.tau)
        simulated = tuple(listed(same_turn(run.simulated[quantity.signal], np.array(analytic, float))))
    nothing = READ_AS_ZERO * max((abs(v) for v in (*analytic, *simulated) if v is not None), default=0.0)

    def rounded(values: Numbers) -> Numbers:
        return scaled((0.0 if v is not None and abs(v) < nothing else v for v in values), quantity.factor)

    return Read(quantity.title, quantity.unit, (rounded(analytic), rounded(simulated), difference(run, quantity)))

"""Runs in which a pin strikes, in ever shorter steps, held against the equation of motion with event location.

Sample by sample a long run of impacts converges to nothing, as each is as sensitive as the last; half a revolution has
few enough of them that every engine still does.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from analytic.kinematics.schedule import Schedule
from analytic.mechanism.signals import named
from compare.baseline.runs import not_run
from compare.judge.numerical import COVERAGE, PARTS, convergence
from sim_models.engine import TOUCHING, Request, SimulationError, declared, engine
from tests.evidence.contact_ode import ContactMotion, centred, loop_of, names_of, simulate
from tests.evidence.results.trust import Impacting
from tests.evidence.validation.striking import CHECKED, Rattling
from tests.evidence.validation.workspaces import digits

LINKAGE = Rattling("crank-rocker", "B", 2e-4, 20 * math.pi, 0.8, 1e6)
TURN = math.pi  # rad
STEPS = (12.8e-6, 6.4e-6, 3.2e-6, 1.6e-6, 0.8e-6)  # s; contact lasts about 3e-4 s
SAMPLES, WITHIN = 91, 100  # of the runs, and rows of the equation between two of them, which thus meet


def struck(names: Iterable[str]) -> Iterator[Impacting]:
    """Each joint model in which these engines let a pin strike."""
    m = LINKAGE.linkage(CHECKED)
    loop = loop_of(m)
    exact = simulate(m, loop, centred(m, loop), TURN, step=TURN / loop.speed / (SAMPLES - 1) / WITHIN)
    asked = Schedule.at_angles(m, np.linspace(0.0, TURN, SAMPLES))
    for name in names:
        for model in TOUCHING["contact_law"]:
            request = Request(m, model, asked, start="centred")
            if not not_run(name, declared(name), request):
                try:
                    yield _struck(name, request, exact)
                except SimulationError:
                    continue


def _struck(name: str, request: Request, exact: ContactMotion) -> Impacting:
    m = request.mechanism
    who, theta = names_of(m), request.schedule.crank_angle
    assert theta is not None
    runs = [engine(name).simulate(replace(request, step=step)).signals for step in STEPS]
    bodies = {named(m.bodies, m.joints)[f"{b}_angle"]: exact.watched.angle[b] for b in (who.first, who.second)}
    errors, expanded = np.zeros(len(STEPS)), 0.0
    for signal, angle in bodies.items():
        each = [run[signal.name] for run in runs]
        off = np.array([np.abs(signal.apart(one, np.interp(theta, exact.crank, angle))).max() for one in each])
        if off[0] > errors[0]:
            expanded = COVERAGE * convergence(signal, each[: len(PARTS) + 1]).u_num
        errors = np.maximum(errors, off)
    return Impacting(
        simulator=name,
        joint_model=request.joint_model,
        law=CHECKED,
        steps=STEPS,
        errors=tuple(map(digits, errors)),
        order=float(f"{np.polyfit(np.log(STEPS), np.log(errors), 1)[0]:.2f}"),
        expanded=digits(expanded),
        touches=exact.impacts.time.size,
    )

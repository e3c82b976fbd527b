"""Released runs in pieces, each from a start of its own (multiple shooting).

A long motion answers to whatever is missing as nothing linear does: a spring turns a swing into a vibration.  In pieces
that the nominal mechanism nearly follows it does, and there the posterior over sets of effects is found first.  What is
probable there is fitted to pieces twice as long, and again, until each run goes from one start.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from compare.diagnose.courses import course
from compare.diagnose.fit import Fit, Fitter
from compare.diagnose.noise import CLOSED, rms
from compare.diagnose.posterior.compress import FORECAST
from compare.diagnose.posterior.infer import Inference
from compare.diagnose.predict import StartOfRun, Term, pieces
from compare.diagnose.residuals import bridged

LINEAR_WITHIN = 2 * FORECAST  # rad: of a motion that is off by so much, the second order is about half of that
FEWEST_SAMPLES = 4  # samples of a piece: twice as many as its start has unknowns
Starts = Mapping[Term, np.ndarray]


def in_pieces(fitter: Fitter, starts: Starts) -> Starts:
    """The starts of each free run in as few pieces as the nominal mechanism nearly follows; ``starts`` are those of the
    whole runs, which stay where they go in one piece, or nothing tells their angle.
    """
    rig, found = fitter.rig, dict(starts)
    runs = {run.name: k for k, run in enumerate(fitter.data.measured.runs)}
    for whole, given in starts.items():
        k = runs[whole.where]
        run = fitter.data.measured.runs[k]
        if rig.encoder not in run.channels or run.push is not None:
            continue
        moved, values = course(run, rig.encoder).at(run.time), bridged(run.channels[rig.encoder].values)
        term, x, count = whole, given, 1
        while 2 * count * FEWEST_SAMPLES <= run.time.size:
            here = {t: v for t, v in starts.items() if t != whole} | {term: x}
            (said,) = fitter.model([[(t, t.effect.values(rig, t.where, v, t.variant)) for t, v in here.items()]])
            if said is not None and np.abs(said[k][rig.encoder] - values).max() <= LINEAR_WITHIN:
                break
            count *= 2
            begin = [part.start for part in pieces(run.time.size, count)]
            term = Term(whole.effect, run.name, float(count))
            x = np.column_stack([moved.theta[begin], moved.omega[begin]]).ravel()
        del found[whole]
        found[term] = x
    return found


def longer(starts: Starts) -> Starts:
    """The starts of pieces twice as long."""
    found: dict[Term, np.ndarray] = {}
    for term, x in starts.items():
        count = StartOfRun.pieces(term.variant) // 2
        if count < 1:
            found[term] = x
        else:
            kept = np.reshape(x, (-1, 2))[::2].ravel()
            found[Term(term.effect, term.where, float(count) if count > 1 else 0.0)] = kept
    return found


def first_fit(fitter: Fitter, starts: Starts, sought: Sequence[Term], late: Callable[[], bool]) -> Fit | None:
    """A fit of whole free runs from which their effects may be looked for; ``starts`` are the nominal ones.  None where
    they go in one piece from the beginning, or no longer ones can be fitted.

    The likeliest effects in pieces are fitted to pieces twice as long, and again; where they leave a gap there, the
    likeliest ones of these are looked for.
    """
    now = in_pieces(fitter, starts)
    base = fitter.fit(list(now), now) if now.keys() != starts.keys() else None
    found = None if base is None else Inference(fitter, base, sought, late).search().best
    while found is not None and not late():
        x = dict(zip(found.fit.terms, found.fit.x, strict=True))
        effects = {found.fit.terms[i]: found.fit.x[i] for i in found.fit.named()}
        now = longer({t: start for t, start in x.items() if t not in effects})
        sizes = {t: found.sizes[t] for t in effects} | {t: np.full(start.size, np.inf) for t, start in now.items()}
        fit = fitter.likeliest(sizes, effects | dict(now))
        if all(t.variant <= 1 for t in now):
            return fit
        if fit is not None and rms(fit.residual) <= CLOSED:
            found = replace(found, fit=fit)
            continue
        base = fitter.fit(list(now), now)
        begun = [] if fit is None else [fit]
        found = None if base is None else Inference(fitter, base, sought, late).search(begun).best
    return None

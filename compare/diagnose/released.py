"""Released runs in pieces, each from a start of its own (multiple shooting).

A long motion answers to whatever is missing as nothing linear does: a spring turns a swing into a vibration.  In pieces
that the nominal mechanism nearly follows it does, and there the posterior over sets of effects is found first.  What is
probable there is fitted to pieces twice as long, and again, until each run goes from one start.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from compare.diagnose.fit import Fit, Fitter
from compare.diagnose.predict import StartOfRun, Term, pieces
from compare.diagnose.prepare import course
from compare.diagnose.residuals import bridged

NEAR = 0.24  # rad: a forecast to first order misses a motion that is off by so much by 12 % of it (FORECAST)
LEAST = 4  # samples of a piece
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
        if rig.encoder not in run.channels:
            continue
        moved, values = course(run, rig.encoder).at(run.time), bridged(run.channels[rig.encoder].values)
        term, x, count = whole, given, 1
        while 2 * count * LEAST <= run.time.size:
            here = {t: v for t, v in starts.items() if t != whole} | {term: x}
            (said,) = fitter.model([[(t, t.effect.values(rig, t.where, v, t.variant)) for t, v in here.items()]])
            if said is not None and np.abs(said[k][rig.encoder] - values).max() <= NEAR:
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
        count = max(int(term.variant), 1) // 2
        if count < 1:
            found[term] = x
        else:
            kept = np.reshape(x, (-1, 2))[::2].ravel()
            found[Term(term.effect, term.where, float(count) if count > 1 else 0.0)] = kept
    return found


def whole(fitter: Fitter, fit: Fit, sizes: Mapping[Term, np.ndarray]) -> Fit | None:
    """A fit of runs in pieces, fitted to whole ones; ``sizes`` are how large its effects are expected to be (1 sigma of
    each coordinate).  None where that is impossible.
    """
    while any(t.variant > 1 for t in fit.terms if isinstance(t.effect, StartOfRun)):
        now = dict(zip(fit.terms, fit.x, strict=True))
        effects = {t: now[t] for t in (fit.terms[i] for i in fit.named())}
        starts = longer({t: x for t, x in now.items() if t not in effects})
        wanted = {t: sizes[t] for t in effects} | {t: np.full(x.size, np.inf) for t, x in starts.items()}
        again = fitter.likeliest(wanted, [effects | dict(starts)])
        if again is None:
            return None
        fit = again
    return fit

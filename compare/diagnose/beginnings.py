"""Where the fits of released runs begin: with what their motion, read backward, says is missing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from compare.diagnose.fit import Bounds, Fitter
from compare.diagnose.inverse import MOST, Beginning, read_backward
from compare.diagnose.posterior.infer import Inference
from compare.diagnose.predict import Model, Term


def begin(model: Model, bounds: Bounds, sought: Sequence[Term]) -> list[Beginning]:
    """Where fits of free runs may begin, the likeliest first; none where a free run has no encoder."""
    found = read_backward(model)
    if found is None:
        return []
    backward, data = found
    fitter = Fitter(backward, data, model.rig, bounds)
    base = fitter.at((), {})
    if base is None:
        return []
    starts = {run: np.array([motion.theta[0], motion.omega[0]]) for run, motion in backward.motions.items()}
    fitted = Inference(fitter, base, [t for t in sought if not t.effect.sensor]).posterior().fitted
    near = [w.fit for w in sorted(fitted, key=lambda w: -w.log) if w.fit.terms]
    return [Beginning(dict(zip(fit.terms, fit.x, strict=True)), starts) for fit in near[:MOST]]

"""Exudyn as a referee: static equilibria, driven and released motion, with ideal or real clearance joints.

``ideal`` is a RevoluteJoint2D; ``massless-link`` a DistanceConstraint as long as the clearance (in statics a rod of
1e10 N/m); ``spring-damper`` pushes with max(0, K d + C d') outside the gap; ``contact`` is a journal in its bearing
(ObjectContactSphereSphere): K d + C d' where the mechanism gives ``contact_damping``, else a restitution law. That
damping also pulls while the pin leaves, which the spring-damper's does not: with many impacts the pin is free 4-6 %
less.
"""

from __future__ import annotations

from pathlib import Path

from sim_models.common.simulate import simulate
from sim_models.engine import (
    IN_JOINTS,
    JOINT_MODELS,
    Engine,
    JointModel,
    Motion,
    Pair,
    Request,
    Trace,
    check_supported,
)
from sim_models.exudyn.settings import silence


class Exudyn(Engine):
    """The engine; see :class:`sim_models.engine.Engine`."""

    name = "exudyn"
    package = "exudyn"
    supports: frozenset[tuple[JointModel, Motion]] = frozenset(
        (model, motion) for model in JOINT_MODELS for motion in ("static", "driven")
    )
    effects = IN_JOINTS | {"drive_compliance"}
    beams: frozenset[Pair] = frozenset({("ideal", "static"), ("contact", "static")})
    exports = True

    def simulate(self, request: Request) -> Trace:
        """Run one request.

        ``steady`` starts in the equilibrium of the same joint model under loads and inertia forces, moving as that
        equilibrium moves with the crank.  Requested angles and courses are the motor's; with a compliant drive the
        crank lags by torque / stiffness, and ``steady`` is :func:`sim_models.exudyn.steady.crank_behind`.  Raises
        SimulationError, Unsupported or AssemblyError.
        """
        from sim_models.exudyn.runs import Run

        with silence():
            return simulate(self, request, lambda r: Run(r).trace())

    def simulate_flexible(self, request: Request) -> Trace:
        """Run one request with links of beams.  Raises SimulationError, Unsupported or AssemblyError."""
        from sim_models.exudyn.beams import flexible

        return flexible(request)

    def export(self, request: Request, folder: Path) -> list[Path]:
        """Write a request, and what came of it, as files that run in Exudyn alone.  Raises what
        :meth:`simulate` does.
        """
        from sim_models.exudyn.export import export

        check_supported(self, request)
        with silence():
            return export(request, folder)


ENGINE = Exudyn()

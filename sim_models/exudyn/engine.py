"""Exudyn as an engine: static equilibria, driven and released motion, with ideal or real clearance joints.

``ideal`` is a RevoluteJoint2D; ``massless-link`` a DistanceConstraint as long as the clearance (in statics a rod of
1e10 N/m); ``spring-damper`` pushes with max(0, K d + C d') outside the gap; ``contact`` is a journal in its bearing
(ObjectContactSphereSphere): K d + C d' where the mechanism gives ``contact_damping``, else a restitution law. That
damping also pulls while the pin leaves, which the spring-damper's does not: with many impacts the pin is free 4-6 %
less.  Where the mechanism names a ``contact_law``, both are :mod:`sim_models.exudyn.named_contact`, which never pulls.
Of blocks with clearance in their guides both are :mod:`sim_models.exudyn.block`, which does not either.
"""

from __future__ import annotations

from pathlib import Path

from sim_models.common.simulate import export, simulate, simulate_flexible
from sim_models.engine import (
    FEATURES,
    JOINT_MODELS,
    MOTIONS,
    Capabilities,
    Engine,
    Feature,
    Pair,
    Request,
    Scope,
    Trace,
)
from sim_models.exudyn.settings import console_off

RUNS: tuple[Pair, ...] = tuple((model, motion) for model in JOINT_MODELS for motion in MOTIONS)
BENDING: tuple[Pair, ...] = tuple((model, motion) for model in ("ideal", "contact") for motion in MOTIONS)
# No law of a joint sees another's reaction; one-sided laws between a motor and its crank would be slow in Python.
HAS: frozenset[Feature] = frozenset(FEATURES) - {"load_friction", "guide_friction", "backlash"}
# What an exported script does, each by name: functions of the run's own are no part of a model file.
WRITTEN: frozenset[Feature] = frozenset({
    "prismatic", "coulomb_friction", "stribeck_friction", "viscous_friction", "drag",
    "joint_spring", "nonlinear_spring", "contact_friction", "drive_compliance", "periodic_torque",
    "soft_bearing", "course", "released", "several_drives", "point_spring", "varying_load", "stop",
})  # fmt: skip
BEYOND: frozenset[Feature] = frozenset(
    {
        "contact_law",
        "contact_friction",
        "drive_compliance",
        "guide_clearance",
        "soft_bearing",
        "released",
        "stop",
        "varying_load",
    }
)  # of beams
# Of beams in motion: inertia forces of several drives, and dampers beside springs, are not worked out.
AT_REST_ALONE: frozenset[tuple[Feature, Pair]] = frozenset(
    (feature, pair) for feature in ("several_drives", "point_spring") for pair in BENDING if pair[1] == "driven"
)
# Friction of a pin on its rim falls to zero with its sliding speed: at rest there is none.
NO_RIM_FRICTION_AT_REST: frozenset[tuple[Feature, Pair]] = frozenset({("contact_friction", ("contact", "static"))})


class ExudynEngine(Engine):
    """The engine; see :class:`sim_models.engine.Engine`."""

    name = "exudyn"
    package = "exudyn"
    capabilities = Capabilities(
        rigid=Scope.of(RUNS, HAS, but=NO_RIM_FRICTION_AT_REST),
        beams=Scope.of(BENDING, HAS - BEYOND, but=AT_REST_ALONE),
        export=Scope.of(RUNS, WRITTEN, but=NO_RIM_FRICTION_AT_REST),
    )

    def simulate(self, request: Request) -> Trace:
        """Run one request.

        ``steady`` starts in the equilibrium of the same joint model under loads and inertia forces, moving as that
        equilibrium moves with the crank.  Requested angles and courses are the motor's; with a compliant drive the
        crank lags by torque / stiffness, and ``steady`` is :func:`sim_models.exudyn.steady.crank_behind`.  Raises
        SimulationError, Unsupported or AssemblyError.
        """
        from sim_models.exudyn.runs import ExudynRun

        with console_off():
            return simulate(self, request, lambda asked: ExudynRun(asked).trace())

    def simulate_flexible(self, request: Request) -> Trace:
        """Run one request with links of beams.  Raises SimulationError, Unsupported or AssemblyError."""
        from sim_models.exudyn.beams import flexible

        return simulate_flexible(self, request, flexible)

    def export(self, request: Request, folder: Path) -> list[Path]:
        """Write a request, and what came of it, as a script that runs in bare Exudyn.  Raises what
        :meth:`simulate` does.
        """
        from sim_models.exudyn.export import write

        with console_off():
            return export(self, request, folder, write)


ENGINE = ExudynEngine()

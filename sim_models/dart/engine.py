"""DART as one of the engines: what it simulates."""

from __future__ import annotations

from sim_models.common.health import check
from sim_models.dart.world import DartWorld
from sim_models.engine import COMMON_EFFECTS, JointModel, Motion, Request, Trace, check_supported
from sim_models.planar.runs import simulate

MODELS: tuple[JointModel, ...] = ("ideal", "spring-damper", "contact")
MOTIONS: tuple[Motion, ...] = ("driven", "static")


class DartEngine:
    """See :class:`sim_models.engine.Engine`."""

    name = "dart"
    package = "dartpy"
    effects = COMMON_EFFECTS | {"drive_compliance"}
    supports: frozenset[tuple[JointModel, Motion]] = frozenset((model, motion) for model in MODELS for motion in MOTIONS)

    def simulate(self, request: Request) -> Trace:
        """Run one request; see the protocol."""
        check_supported(self, request)
        trace = simulate(DartWorld, request, self.package)
        check(request, trace)
        return trace


ENGINE = DartEngine()

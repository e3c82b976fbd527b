"""DART as one of the engines: what it simulates."""

from __future__ import annotations

from sim_models.common.simulate import simulate
from sim_models.dart.world import DartWorld
from sim_models.engine import FEATURES, MOTIONS, Capabilities, Engine, Feature, JointModel, Pair, Request, Scope, Trace
from sim_models.leapfrog.runs import LeapfrogRun

# A pin that moves in its bearing changes reactions, and with them such friction, too much from step to step.
GROWN: tuple[Feature, ...] = ("load_friction", "guide_friction")
QUICKER: frozenset[tuple[Feature, Pair]] = frozenset(
    (feature, (model, "driven")) for feature in GROWN for model in ("spring-damper", "contact")
)
# DART's own contact is rigid, and knows no law but Newton's restitution; nor do blocks have it.
RIGID: frozenset[tuple[Feature, Pair]] = frozenset(
    {("contact_law", ("contact", "driven")), *(("guide_clearance", ("contact", motion)) for motion in MOTIONS)}
)
DART_MODELS: tuple[JointModel, ...] = ("ideal", "spring-damper", "contact")


class DartRun(LeapfrogRun):
    """See :class:`sim_models.run.run.EngineRun`."""

    engine, package, world_class = "dart", "dartpy", DartWorld


class DartEngine(Engine):
    """See :class:`sim_models.engine.Engine`."""

    name = "dart"
    package = "dartpy"
    capabilities = Capabilities(
        rigid=Scope.of(
            ((model, motion) for model in DART_MODELS for motion in MOTIONS),
            set(FEATURES) - {"contact_friction"},
            but=QUICKER | RIGID,
        )
    )

    def simulate(self, request: Request) -> Trace:
        """Run one request; see the protocol."""
        return simulate(self, request, lambda asked: DartRun(asked).trace())


ENGINE = DartEngine()

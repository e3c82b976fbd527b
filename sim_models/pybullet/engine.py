"""PyBullet as one of the engines: what it simulates, and export."""

from __future__ import annotations

from pathlib import Path

from sim_models.common.simulate import export, simulate
from sim_models.engine import FEATURES, Capabilities, Engine, Feature, Pair, Request, Scope, Trace
from sim_models.pybullet.run import BulletRun

RUNS: tuple[Pair, ...] = (
    ("ideal", "driven"),
    ("ideal", "static"),
    ("spring-damper", "driven"),
    ("spring-damper", "static"),
    ("massless-link", "static"),
    ("contact", "static"),
)
# A pin that moves in its bearing changes reactions, and with them such friction, too much from step to step.
QUICKER: frozenset[tuple[Feature, Pair]] = frozenset(
    {("load_friction", ("spring-damper", "driven")), ("guide_friction", ("spring-damper", "driven"))}
)
# A strut is between two pins, and no corner of a block is one.
STRUTS: frozenset[tuple[Feature, Pair]] = frozenset({("guide_clearance", ("contact", "static"))})
HAS: frozenset[Feature] = frozenset(FEATURES) - {"contact_friction"}
# What an exported script does, each by name; a drive that yields it does not at rest.
WRITTEN: frozenset[Feature] = frozenset({
    "prismatic", "coulomb_friction", "stribeck_friction", "load_friction", "viscous_friction",
    "drag", "joint_spring", "nonlinear_spring", "drive_compliance", "periodic_torque",
    "soft_bearing", "course", "released", "several_drives", "point_spring", "varying_load", "stop",
})  # fmt: skip
DRIVE_AT_REST: frozenset[tuple[Feature, Pair]] = frozenset(
    ("drive_compliance", pair) for pair in RUNS if pair[1] == "static"
)


class BulletEngine(Engine):
    """See :class:`sim_models.engine.Engine`."""

    name = "pybullet"
    package = "pybullet"
    capabilities = Capabilities(
        rigid=Scope.of(RUNS, HAS, but=QUICKER | STRUTS),
        export=Scope.of(RUNS, WRITTEN, but=QUICKER | DRIVE_AT_REST),
    )

    def simulate(self, request: Request) -> Trace:
        """Run one request; see the protocol."""
        return simulate(self, request, lambda asked: BulletRun(asked).trace())

    def export(self, request: Request, folder: Path) -> list[Path]:
        """Write a request, and what came of it, as a script that runs in bare PyBullet.  Raises what :meth:`simulate`
        does.
        """
        from sim_models.pybullet.export import write

        return export(self, request, folder, write)


ENGINE = BulletEngine()

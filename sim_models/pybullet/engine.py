"""PyBullet as one of the engines: what it simulates, and export."""

from __future__ import annotations

from pathlib import Path

from sim_models.common.simulate import simulate
from sim_models.engine import IN_JOINTS, Engine, JointModel, Motion, Request, Trace, check_supported
from sim_models.leapfrog.runs import run
from sim_models.pybullet.world import BulletWorld


class BulletEngine(Engine):
    """See :class:`sim_models.engine.Engine`."""

    name = "pybullet"
    package = "pybullet"
    effects = IN_JOINTS | {"drive_compliance"}
    exports = True
    supports: frozenset[tuple[JointModel, Motion]] = frozenset(
        {
            ("ideal", "driven"),
            ("ideal", "static"),
            ("spring-damper", "driven"),
            ("spring-damper", "static"),
            ("massless-link", "static"),
            ("contact", "static"),
        }
    )

    def simulate(self, request: Request) -> Trace:
        """Run one request; see the protocol."""
        return simulate(self, request, lambda r: run(BulletWorld, r, self.package))

    def export(self, request: Request, folder: Path) -> list[Path]:
        """Write a request, and what came of it, as files that run in PyBullet alone.  Raises what :meth:`simulate`
        does.
        """
        from sim_models.pybullet.export import export

        check_supported(self, request)
        return export(request, folder)


ENGINE = BulletEngine()

"""A PyBullet run."""

from __future__ import annotations

from sim_models.leapfrog.runs import LeapfrogRun
from sim_models.pybullet.world import BulletWorld


class BulletRun(LeapfrogRun):
    """See :class:`sim_models.run.run.EngineRun`."""

    engine, package, world_class = "pybullet", "pybullet", BulletWorld

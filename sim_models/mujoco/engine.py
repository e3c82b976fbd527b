"""MuJoCo as an engine: its declaration, without the package."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sim_models.common.simulate import export, simulate
from sim_models.engine import (
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

RUNS = tuple((model, motion) for model in JOINT_MODELS for motion in MOTIONS)
# Blocks touch their guides by contact alone: a tendon knows no corner.
WITHOUT_BLOCKS: frozenset[tuple[Feature, Pair]] = frozenset(
    ("guide_clearance", ("spring-damper", motion)) for motion in MOTIONS
)
# What an exported script does, each by name: a new feature is refused until the script has it.
WRITTEN: frozenset[Feature] = frozenset({
    "prismatic", "coulomb_friction", "stribeck_friction", "viscous_friction", "drag",
    "joint_spring", "nonlinear_spring", "contact_friction", "drive_compliance", "periodic_torque",
    "soft_bearing", "course", "released", "several_drives", "point_spring", "varying_load", "stop",
})  # fmt: skip


class MujocoEngine(Engine):
    """MuJoCo.  Joints with clearance follow any of the four joint models, in driven and static motion.

    With a drive that yields, the requested crank angles, or the course, are the motor's.  Where these repeat themselves
    with each revolution, so does the crank of an ideal linkage from the start; else it starts where its motor's motion
    nearby has it.  Where joints follow courses and nothing else is free, pins start in equilibrium with their motion;
    where something is, pressed where the ideal linkage's reactions point.
    """

    name = "mujoco"
    package = "mujoco"
    capabilities = Capabilities(
        rigid=Scope.of(RUNS, but=WITHOUT_BLOCKS),
        export=Scope.of(RUNS, WRITTEN),
    )

    def simulate(self, request: Request) -> Trace:
        """Run one request.  Raises SimulationError, Unsupported or AssemblyError."""
        from sim_models.mujoco.runs import MujocoRun

        with no_log_file():
            return simulate(self, request, lambda asked: MujocoRun(asked).trace())

    def export(self, request: Request, folder: Path) -> list[Path]:
        """Write a request, and what came of it, as a script that runs in bare MuJoCo.  Raises what
        :meth:`simulate` does.
        """
        from sim_models.mujoco.export import write

        with no_log_file():
            return export(self, request, folder, write)


ENGINE = MujocoEngine()


@contextmanager
def no_log_file() -> Iterator[None]:
    """MuJoCo would write its warnings to a file; it also counts them, and every run checks the count."""
    import mujoco

    mujoco.set_mju_user_warning(lambda message: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(None)

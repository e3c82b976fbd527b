"""MuJoCo as a referee: its declaration, without the package."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from sim_models.engine import JOINT_MODELS, JointModel, Motion, Request, Trace, check_supported


class MujocoEngine:
    """MuJoCo.  Joints with clearance follow any of the four joint models, in driven and static motion.

    With a drive that yields, the requested crank angles are the motor's.
    """

    name = "mujoco"
    package = "mujoco"
    supports: frozenset[tuple[JointModel, Motion]] = frozenset((model, motion) for model in JOINT_MODELS for motion in ("driven", "static"))

    def simulate(self, request: Request) -> Trace:
        """Run one request.  Raises SimulationError, Unsupported or AssemblyError."""
        from sim_models.mujoco_runs import Run

        check_supported(self, request)
        with _quiet():
            return Run(request).trace()


ENGINE = MujocoEngine()


@contextmanager
def _quiet() -> Iterator[None]:
    """MuJoCo would write its warnings to a file; it also counts them, and every run checks the count."""
    import mujoco

    mujoco.set_mju_user_warning(lambda message: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(None)

"""Somebody's own MJCF file as an engine, ``mjcf:linkage.xml``: its declaration, without MuJoCo."""

from __future__ import annotations

from pathlib import Path

from sim_models.common.requests import check_request
from sim_models.engine import Capabilities, Engine, Feature, Pair, Request, Scope, Trace, check_supported

PACKAGE = "mujoco"
RUNS: tuple[Pair, ...] = (("ideal", "driven"), ("ideal", "static"))
MODEL_FEATURES: tuple[Feature, ...] = (
    "prismatic", "coulomb_friction", "viscous_friction", "joint_spring", "released", "several_drives",
    "point_spring",
)  # fmt: skip


class MjcfEngine(Engine):
    """A file's model as it is: its masses, its time step, its solver, its soft constraints, its contacts.

    Only the drives are imposed.  A hinge or slide that the mechanism drives gets an armature of a thousand times the
    linkage's inertia or mass, which is pushed as its course accelerates and against what the linkage does to it, and is
    put on its course after every step; actuators of that joint are switched off, so that a servo of the file does not
    lag behind the request, and so are those of a drive that is free; their dampers and armatures are the joint's, and
    stay.  All others act with control 0.  A run begins in
    the state without transients that the file's own constraint rows give, or where something moves freely with loops
    closed; statics are that state at rest.

    A run is not held to the mechanism's balances, as other engines' are: that the file has other masses, or opens its
    loops, is for the cross-check to find.
    """

    package = PACKAGE
    capabilities = Capabilities(rigid=Scope.of(RUNS, MODEL_FEATURES, but=[("coulomb_friction", ("ideal", "static"))]))

    def __init__(self, path: str) -> None:
        self.path = Path(path)
        self.name = f"mjcf:{path}"

    def simulate(self, request: Request) -> Trace:
        """Run one request.  Raises MjcfError, SimulationError, AssemblyError, or Unsupported where the file is not the
        mechanism's linkage.
        """
        from sim_models.mjcf.planar import read
        from sim_models.mjcf.runs import TheirRun
        from sim_models.mujoco.engine import no_log_file

        check_supported(self, request)
        check_request(request)
        with no_log_file():
            return TheirRun(self.name, request, read(self.path)).trace()


def opened(path: str) -> MjcfEngine:
    """The engine of a file, which is looked through.  Raises MjcfError where it cannot be used."""
    from sim_models.mjcf.errors import MjcfError
    from sim_models.mjcf.planar import read
    from sim_models.mujoco.engine import no_log_file

    if not path.strip():
        raise MjcfError("mjcf: names no file; give its path, as in mjcf:linkage.xml")
    with no_log_file():
        read(Path(path))
    return MjcfEngine(path)

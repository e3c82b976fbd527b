"""How accurate a platform is: what clearance, compliance and the resolution of several drives make of its pose, along a
motion or over its workspace.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from analytic.beyond_paper.platform import Platform, platform
from analytic.kinematics.assembly import Assembly, AssemblyError, Walk
from analytic.kinematics.motion import kinematics
from analytic.kinematics.output import Output
from analytic.kinematics.schedule import Schedule
from analytic.kinematics.workspace import Workspace, workspace
from analytic.mechanism import Mechanism
from analytic.mechanism.assumed import assumed
from analytic.mechanism.errors import quoted
from analytic.mechanism.one_line import count
from analytic.paper.clearance import Displaced, displaced
from analytic.paper.compliance import compliance
from analytic.paper.frame import ComplianceError
from analytic.paper.kinetostatics import kinetostatics
from compare.accuracy import named_outputs
from compare.arguments import (
    in_unit,
    linkage,
    noted,
    number,
    warn_of_friction,
)
from compare.faults import ArgumentError, unusable
from compare.omissions import Asked, omitted
from compare.questions.accuracy import PlatformQuestion, WorkspaceGrid
from compare.questions.option import Places
from compare.questions.question import answers
from compare.results.accuracy import PointError
from compare.results.platform import BodyPoses, PlatformAccuracy, PoseError, PoseGrid
from compare.schedules import over_time
from compare.toleranced import states_tolerances
from compare.versions import versions

POORLY_HELD = (300.0, 100.0, 30.0, 10.0)  # condition of the loops, up to which finite errors are sought, in turn
MOST_POSES = 250_000
_Spread = Callable[[np.ndarray], np.ndarray]


@answers(PlatformQuestion)
def platform_accuracy(question: PlatformQuestion) -> PlatformAccuracy:
    """How accurate the outputs of a linkage with several drives are, along a motion or at rest over a workspace.

    ``outputs`` are names such as ``platform`` (its com and angle) or ``left-arm.P``; the first of them is what is moved
    over a ``workspace``, ``((x0, x1, nx), (y0, y1, ny))``: lowest, highest (m) and number of its x and of its y, with
    its ``angle`` where there are three drives.  Without a workspace the drives move over ``times`` (s), along a
    ``course`` or such that a platform follows a ``path``, as in :func:`compare.crosscheck.crosscheck`.

    Raises MechanismError, ArgumentError, DataError or AssemblyError.
    """
    times, course, path = question.times, question.course, question.path
    workspace, angle = question.workspace, question.angle
    with noted() as warned:
        m = linkage(question.mechanism, question.clearance, large=question.large)
        warn_of_friction(m, None, "driven", engines=False)
        warned += omitted(m, Asked("accuracy", "driven" if workspace is None else "static", bends=True))
        if states_tolerances(m):
            warned.append(f"left out: tolerances of {m.name}, as errors by them are of linkages that one crank moves")
        assembly = Assembly(m)
        if assembly.structure.free:
            raise ArgumentError("mechanism", f"{m.name} has freedoms without a drive; give each one a drive")
        steps, wanted = _steps(question.encoder_step, assembly), named_outputs(question.outputs, m)
        if angle is not None and not np.isfinite(number(angle, "angle", "rad")):
            raise unusable("angle", angle, "a finite number (rad)")
        if workspace is not None:
            for name, given in (("times", times), ("course", course), ("path", path)):
                if given is not None:
                    raise ArgumentError(
                        name, "is of a motion, and a workspace is of poses at rest; leave one of them out"
                    )
            result = _over_workspace(assembly, wanted, _grid(workspace), angle, steps)
        else:
            if angle is not None:
                raise ArgumentError("angle", "is that of a workspace; give one, or leave the angle out")
            asked = np.linspace(0.0, 1.0, 51) if _plain(times, course, path, m) else times
            result = _along(assembly, wanted, over_time(assembly, False, asked, course, path), steps)
    return result.model_copy(update={"warnings": (*result.warnings, *warned)})


def _grid(given: object) -> WorkspaceGrid:
    """((x0, x1, nx), (y0, y1, ny)), as that is written in a command.  Raises ArgumentError."""
    try:
        axes = [(float(low), float(high), number) for low, high, number in given]  # type: ignore[attr-defined]
        return Places().parse(",".join(f"{low}:{high}:{number}" for low, high, number in axes), "workspace")
    except (TypeError, ValueError):
        accepted = "((x0, x1, nx), (y0, y1, ny)): lowest, highest (m) and number of the x, and of the y"
        raise unusable("workspace", given, accepted) from None


def _plain(times: object, course: object, path: object, m: Mechanism) -> bool:
    """Whether nothing says when one looks at a linkage that one crank moves."""
    return times is None and course is None and path is None and m.cranked


def _steps(given: Mapping[str, float | str] | None, assembly: Assembly) -> dict[str, float]:
    joints = {joint.name: joint for joint in assembly.mechanism.motors}
    if given is not None and not isinstance(given, Mapping):
        raise unusable("encoder_step", given, "rad, or m, by driven joint")
    steps = {}
    for name, step in (given or {}).items():
        if name not in joints:
            raise ArgumentError("encoder_step", f"{name!r} is no driven joint; they are {', '.join(joints)}")
        unit = "m" if joints[name].prismatic else "rad"
        size = number(in_unit(step, unit, "encoder_step") if isinstance(step, str) else step, "encoder_step", unit)
        if not 0 <= size < np.inf:
            raise ArgumentError("encoder_step", f"{name} = {quoted(step)}; give rad, or m, of 0 or more")
        steps[name] = size
    return steps


@dataclass(frozen=True)
class FiniteGaps:
    """Equilibria with finite gaps at some (indices) of so many poses."""

    found: Displaced
    at: np.ndarray
    count: int

    def by(self, d: Output) -> np.ndarray:
        """Displacement (N,) of an output; NaN where there is none."""
        displacement = np.full(self.count, np.nan)
        displacement[self.at] = self.found.moved(d)
        return displacement

    @property
    def flags(self) -> dict[int, str]:
        """Why there is none, by pose."""
        return {int(self.at[i]): why for i, why in sorted(self.found.flags.items())}


# ---------------------------------------------------------------- along a motion


def _along(
    assembly: Assembly, outputs: Sequence[Output], schedule: Schedule, steps: Mapping[str, float]
) -> PlatformAccuracy:
    time, inputs = schedule.time, assembly.inputs_along(schedule)
    gaps = displaced(assembly, inputs.theta, inputs.omega, alpha=inputs.alpha, near=assembly.walk(schedule))
    errors = platform(gaps.ideal, outputs, assembly.mechanism.clearances, steps)
    moved = FiniteGaps(gaps, np.arange(time.size), time.size)
    return _result(assembly, errors, moved, outputs, steps, np.asarray).model_copy(
        update={"motion": "driven", "time": time}
    )


# ---------------------------------------------------------------- over a workspace


def _over_workspace(
    assembly: Assembly, outputs: Sequence[Output], grid: WorkspaceGrid, angle: float | None, steps: Mapping[str, float]
) -> PlatformAccuracy:
    space = _reached(assembly, outputs, grid, angle)
    inputs = space.coordinates[list(assembly.structure.inputs)]
    ideal = kinetostatics(kinematics(assembly, inputs, path=space.followed), inertia=False)
    clearances = assembly.mechanism.clearances
    errors = platform(ideal, outputs, clearances, steps)
    moved, why = _equilibria(assembly, space.coordinates, errors) if clearances else (None, "")
    first = next(d for d in outputs if d.axis == "x")
    where = PoseGrid(output=first.place, x=space.x, y=space.y, angle=space.angle)
    result = _result(assembly, errors, moved, outputs, steps, space.on_grid)
    return result.model_copy(update={"workspace": where, "warnings": (why,) if why else ()})


def _reached(assembly: Assembly, outputs: Sequence[Output], grid: WorkspaceGrid, angle: float | None) -> Workspace:
    """The workspace of the first point among the outputs.  Raises ArgumentError or AssemblyError."""
    first = next((d for d in outputs if d.axis == "x"), None)
    if first is None:
        raise ArgumentError("outputs", "a workspace is that of a point; name a body or a body's point first")
    x, y = (np.linspace(*axis) for axis in grid)
    if x.size * y.size > MOST_POSES:
        raise ArgumentError("workspace", f"{x.size * y.size} poses cannot be used; give at most {MOST_POSES}")
    wanted = [Output(first.body, "x", first.point), Output(first.body, "y", first.point)]
    if len(assembly.structure.inputs) == 3:
        wanted.append(Output(first.body, "angle"))
    elif angle is not None:
        drives = count(len(assembly.structure.inputs), "drive")
        raise ArgumentError(
            "angle", f"is set by three drives, and {assembly.mechanism.name} has {drives}; leave it out"
        )
    return workspace(assembly, wanted, x, y, angle)


def _well_held(errors: Platform) -> Iterator[tuple[float, np.ndarray]]:
    """Limits of the condition of holding, each lower than the one before, and the poses (indices) below each."""
    for limit in POORLY_HELD:
        poses = np.flatnonzero(errors.holding < limit)
        if poses.size:
            yield limit, poses


def _equilibria(assembly: Assembly, coordinates: np.ndarray, errors: Platform) -> tuple[FiniteGaps | None, str]:
    """The equilibria of finite gaps where the linkage is held well, and a sentence on what is left out.

    Near a singular pose gaps may keep the linkage from closing: it is sought where it is held better.
    """
    chosen = list(assembly.structure.inputs)
    for limit, poses in _well_held(errors):
        near = coordinates[:, poses]
        try:
            gaps = displaced(assembly, near[chosen], inertia=False, near=Walk(near))
        except AssemblyError:
            continue
        left = errors.holding.size - poses.size
        why = f"equilibria are left out of {count(left, 'pose')} whose condition of holding is above {limit:g}"
        return FiniteGaps(gaps, poses, errors.holding.size), why if left else ""
    return None, "equilibria with finite gaps are left out: with them the linkage does not close"


# ---------------------------------------------------------------- both


def _result(
    assembly: Assembly,
    first_order: Platform,
    moved: FiniteGaps | None,
    outputs: Sequence[Output],
    steps: Mapping[str, float],
    spread: _Spread,
) -> PlatformAccuracy:
    m, motion = assembly.mechanism, first_order.motion
    elastic = _elastic(first_order, outputs)
    nothing = np.full(motion.theta.size, np.nan)
    errors = {d: _error(d, first_order, moved.by(d) if moved else nothing, elastic[d], spread) for d in outputs}
    planes = zip([d for d in outputs if d.axis == "x"], [d for d in outputs if d.axis == "y"], strict=True)
    indices = np.flatnonzero(np.isfinite(spread(np.zeros(motion.theta.size))))
    flags = {str(int(indices[i])): why for i, why in moved.flags.items()} if moved else {}
    moves = _moves(outputs, len(assembly.structure.inputs))
    return PlatformAccuracy(
        case=m.name,
        mechanism=m,
        versions=versions(),
        motion="static",
        clearance=dict(m.clearances),
        encoder_step=dict(steps),
        drive_position={joint.name: spread(motion.relative(joint)) for joint in m.motors},
        poses={
            body.name: BodyPoses(
                x=spread(motion.position(body.name).real),
                y=spread(motion.position(body.name).imag),
                angle=spread(motion.angle(body.name)),
            )
            for body in m.bodies
        },
        holding=spread(first_order.holding),
        dexterity=spread(first_order.dexterity(moves) if moves else np.full(motion.theta.size, np.nan)),
        flags=flags,
        outputs={d.name: error for d, error in errors.items()},
        points={x.place: _point(first_order, x, y, spread) for x, y in planes},
        first_order_off={d.name: _off(errors[d]) for d in outputs if moved and m.clearances},
        assumed=assumed(m),
    )


def _moves(outputs: Sequence[Output], inputs: int) -> list[Output]:
    """The coordinates of the first point among the outputs that its drives set."""
    first = next((d for d in outputs if d.axis == "x"), None)
    if first is None:
        return []
    moves = [first, Output(first.body, "y", first.point), Output(first.body, "angle")][:inputs]
    return moves if inputs in (2, 3) and all(d in outputs for d in moves) else []


def _elastic(errors: Platform, outputs: Sequence[Output]) -> dict[Output, np.ndarray]:
    """Elastic displacement (N,) of each output where the linkage is held well; zero where nothing yields."""
    m, n = errors.motion.structure.mechanism, errors.motion.theta.size
    if not (m.bends or m.drive_stiffness or any(joint.elasticity is not None for joint in m.joints)):
        return {d: np.zeros(n) for d in outputs}
    elastic = {d: np.full(n, np.nan) for d in outputs}
    for limit, poses in _well_held(errors):
        try:
            yielding = compliance(errors.motion.part(poses))
        except ComplianceError as error:
            if limit == POORLY_HELD[-1]:
                raise ArgumentError("mechanism", str(error)) from None
            continue
        for d, values in elastic.items():
            values[poses] = yielding.output(d)
        break
    return elastic


def _error(d: Output, errors: Platform, moved: np.ndarray, elastic: np.ndarray, spread: _Spread) -> PoseError:
    worst, resolution = errors.worst_clearance(d), errors.resolution(d)
    error = PoseError(
        body=d.body,
        axis=d.axis,
        unit=d.unit,
        value=spread(d.value(errors.motion)),
        nominal=spread(errors.along_reactions(d)),
        equilibrium=spread(moved),
        worst_case=spread(worst),
        sensitivity={joint: spread(values) for joint, values in errors.sensitivity(d).items()},
        resolution=spread(resolution),
        compliance=spread(elastic),
        total=spread(worst + resolution + np.abs(elastic)),
    )
    return error if d.axis == "angle" else error.model_copy(update={"point": d.point})


def _point(errors: Platform, x: Output, y: Output, spread: _Spread) -> PointError:
    far = errors.farthest(x, y)
    return PointError(farthest=spread(np.abs(far)), farthest_direction=spread(np.angle(far)))


def _off(error: PoseError) -> float:
    """The largest difference between first order and equilibrium, as a share of the largest displacement."""
    apart, size = np.abs(error.nominal - error.equilibrium), np.abs(error.equilibrium)
    largest = float(np.nanmax(size, initial=0.0))
    return float(np.nanmax(apart, initial=0.0)) / largest if largest else 0.0

"""The linkage itself, drawn: where every body is in the ideal, the analytic displaced and the simulated configuration.

Gaps are too small to see, so a drawing exaggerates: a body is drawn at its ideal pose plus ``factor`` times the way
from there to its displaced one.  Links stay rigid; joints without clearance stay closed to first order.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.motion import kinematics
from analytic.mechanism import GROUND, Mechanism
from analytic.mechanism.signals import same_turn
from compare.quantities import number
from compare.report.figure import Axis, Figure, Mark, Numbers, Series, scaled
from compare.report.summary import Sampled, abscissa
from compare.results.crosscheck import CrossCheck, Run

FACTORS = [m * 10**e for e in range(6) for m in (1, 2, 5)]
DRAWN_GAP = 0.12  # of a typical link's length: how large an exaggerated gap is drawn
PRINTED_ANGLE = math.radians(30.0)  # crank angle of the printed figure, the paper's own
Poses = dict[str, dict[str, Numbers]]  # body -> x, y (m, marker) and angle (rad) of every sample


def parts(mechanism: Mechanism) -> dict[str, object]:
    """What a page's script draws a linkage from: bodies' points from where its position is measured (marker,
    else com), ground points and joints (m).
    """
    bodies: list[dict[str, object]] = []
    for body in mechanism.bodies:
        points = {name: complex(*p) - body.point("com") for name, p in body.points.items()}
        bodies.append({"name": body.name, "points": {name: [p.real, p.imag] for name, p in points.items()}})
    joints = [
        {"name": j.name, "bodies": list(j.bodies), "axis": list(j.axis) if j.axis else None} for j in mechanism.joints
    ]
    ground = {name: list(map(float, p)) for name, p in mechanism.ground.points.items()}
    return {"bodies": bodies, "ground": ground, "joints": joints, "size": typical_length(mechanism)}


def typical_length(mechanism: Mechanism) -> float:
    """The shortest link (m) that has a length, which is what a drawn gap must not outgrow."""
    lengths = [
        max(math.dist(p, q) for p in body.points.values() for q in body.points.values()) for body in mechanism.bodies
    ]
    return min((length for length in lengths if length > 0), default=1.0)


class Loose(Sampled, Protocol):
    """The same of a linkage with these radial clearances (m) by joint."""

    @property
    def clearance(self) -> Mapping[str, float]: ...


def exaggeration(mechanism: Mechanism, run: Loose) -> int:
    """The roundest factor at which the run's largest gap is seen, 1 without gaps and in a free drive."""
    largest = max(run.clearance.values(), default=0.0)
    if not largest or abscissa(run, mechanism).of_time:
        return 1
    return max(f for f in FACTORS if f == 1 or f * largest <= DRAWN_GAP * typical_length(mechanism))


def ideal_poses(result: CrossCheck, run: Run) -> Poses | None:
    """Poses of the linkage without clearance at a run's samples: from the ideal run, else assembled; None if neither
    can.
    """
    over = abscissa(run, result.mechanism)
    for other in result.runs:
        if other.joint_model == "ideal" and abscissa(other, result.mechanism) == over:
            return poses_of(result.mechanism, other.analytic)
    return None if over.of_time else assembled(result.mechanism, run.crank_angle)


def assembled(mechanism: Mechanism, crank_angle: np.ndarray) -> Poses | None:
    """Poses of the linkage without clearance at crank angles (N,) rad; None where it cannot be assembled at one."""
    signals = positions(mechanism, crank_angle)
    return None if signals is None else poses_of(mechanism, signals)


def positions(mechanism: Mechanism, crank_angle: np.ndarray) -> dict[str, np.ndarray] | None:
    """Where the bodies of the same are: signals (N,) m and rad."""
    try:
        motion = kinematics(Assembly(mechanism.with_clearances({})), crank_angle)
    except AssemblyError:  # somewhere on the grid is a change point; the drawing then does without
        return None
    signals: dict[str, np.ndarray] = {}
    for body in (b.name for b in mechanism.bodies):
        com = motion.position(body)
        signals |= {f"{body}_x": com.real, f"{body}_y": com.imag, f"{body}_angle": motion.angle(body)}
    return signals


class Moved(Loose, Protocol):
    """The same with its signals and its mechanism."""

    @property
    def mechanism(self) -> Mechanism: ...

    @property
    def signals(self) -> Mapping[str, np.ndarray]: ...


def both_poses(side: Moved) -> tuple[Poses | None, Poses | None]:
    """Poses without clearance, where they can be had, and as one side's signals have them, in the same turns."""
    m = side.mechanism
    ideal = None if abscissa(side, m).of_time else assembled(m, side.crank_angle)
    return ideal, in_turn_of(poses_of(m, side.signals), ideal)


def poses_of(mechanism: Mechanism, signals: Mapping[str, np.ndarray]) -> Poses | None:
    """Every body's pose as signals have it; None where one is not among them."""
    names = [body.name for body in mechanism.bodies]
    if any(f"{name}_{part}" not in signals for name in names for part in ("x", "y", "angle")):
        return None
    return {name: {part: scaled(signals[f"{name}_{part}"]) for part in ("x", "y", "angle")} for name in names}


def in_turn_of(poses: Poses | None, ideal: Poses | None) -> Poses | None:
    """Poses whose angles are in the turn of the ideal linkage's, as a drawing multiplies their difference."""
    if not poses or not ideal:
        return poses

    def turned(body: str) -> Numbers:
        return scaled(same_turn(*(np.array(each[body]["angle"], float) for each in (poses, ideal))))

    return {body: {**values, "angle": turned(body)} for body, values in poses.items()}


def linkage_figure(result: CrossCheck) -> Figure | None:
    """The ideal and the displaced linkage of the first run with clearance (else the first), at one crank angle."""
    if not result.runs:
        return None
    run = next((run for run in result.runs if run.clearance), result.runs[0])
    over, ideal = abscissa(run, result.mechanism), ideal_poses(result, run)
    displaced = in_turn_of(poses_of(result.mechanism, run.analytic), ideal)
    if displaced is None:
        return None
    usable = [k for k in range(run.crank_angle.size) if pose_at(displaced, k) and (ideal is None or pose_at(ideal, k))]
    if not usable:
        return None
    nearest = min(usable, key=lambda i: abs(run.crank_angle[i] - PRINTED_ANGLE))
    k = usable[len(usable) // 2] if over.of_time else nearest
    times = exaggeration(result.mechanism, run) if ideal else 1
    gaps = {joint: times * size for joint, size in run.clearance.items()}
    series = configuration(result.mechanism, pose_at(ideal, k), "ideal linkage", "ideal-line") if ideal and gaps else []
    model = run.analytic_model.replace("_", " ")
    pose = displaced_by(pose_at(ideal, k), pose_at(displaced, k), times)
    series += configuration(result.mechanism, pose, f"displaced ({model})" if gaps else "analytic", "analytic", gaps)
    title = f"The linkage at {over.label} {number(over.values[k], 4)} {over.unit}"
    title += f", gaps drawn {times} times as large" if gaps and times > 1 else ""
    sizes = ", ".join(f"{joint} {number(1e3 * size)} mm" for joint, size in run.clearance.items()) or "none"
    text, note = f"{title}. Radial clearance: {sizes}.", f"clearance: {sizes}"
    return Figure("linkage", title, text, Axis("x", "mm"), Axis("y", "mm"), tuple(series), "plane", note)


Pose = dict[str, tuple[complex, float]]


def pose_at(poses: Poses | None, k: int) -> Pose:
    """Every body's com (m) and angle (rad) at sample k; empty if any is unknown."""
    pose: Pose = {}
    for body, values in (poses or {}).items():
        x, y, angle = (values[part][k] for part in ("x", "y", "angle"))
        if x is None or y is None or angle is None:
            return {}
        pose[body] = (complex(x, y), angle)
    return pose


def displaced_by(ideal: Pose, displaced: Pose, factor: float) -> Pose:
    """The ideal pose plus ``factor`` times the way to the displaced one; the latter itself where there is no ideal."""
    if not ideal:
        return displaced
    return {
        b: (ideal[b][0] + factor * (z - ideal[b][0]), ideal[b][1] + factor * (a - ideal[b][1]))
        for b, (z, a) in displaced.items()
    }


def configuration(
    mechanism: Mechanism, pose: Pose, name: str, role: str, gaps: Mapping[str, float] | None = None
) -> list[Series]:
    """Links, slides, clearance circles, pivots and labelled joints of one configuration (mm)."""
    ideal = role == "ideal-line"

    def place(body: str, point: str) -> complex:
        if body == GROUND:
            return mechanism.ground.point(point)
        (com, angle), frame = pose[body], mechanism.body(body)
        return com + (frame.point(point) - frame.point("com")) * cmath.exp(1j * angle)

    links: list[complex | None] = []
    for body in mechanism.bodies:
        corners = [place(body.name, point) for point in body.points]
        corners += [pose[body.name][0]] if len(corners) == 1 else []
        links += [*corners, *(corners[:1] if len(corners) > 2 else []), None]
    series = [_series(name, links, role, "dashed" if ideal else "link")]
    for joint in mechanism.joints:
        if joint.axis is None:
            continue
        first, second = joint.bodies
        along = complex(*joint.axis) * cmath.exp(1j * (pose[first][1] if first != GROUND else 0.0))
        along *= 0.2 * typical_length(mechanism) / abs(along)
        centre = place(second, joint.name)
        block = [centre + along * corner for corner in (1 + 0.6j, -1 + 0.6j, -1 - 0.6j, 1 - 0.6j, 1 + 0.6j)]
        series += [
            _series("", [centre - 4 * along, centre + 4 * along], "frame", "dashed"),
            _series("", block, role, labels=() if ideal else (joint.name,)),
        ]
    for joint_name, gap in (gaps or {}).items():
        centre = place(mechanism.joint(joint_name).bodies[1], joint_name)
        rim = [centre + cmath.rect(gap, 2 * math.pi * i / 60) for i in range(61)]
        series.append(_series("", rim, role))
    pins = [joint for joint in mechanism.joints if joint.axis is None]
    pivots = [mechanism.ground.point(pin.name) for pin in pins if GROUND in pin.bodies]
    series += [] if ideal else [_series("", pivots, "frame", "pivot")]
    labels = () if ideal else tuple(pin.name for pin in pins)
    series.append(_series("", [place(pin.bodies[0], pin.name) for pin in pins], role, "joint", labels))
    return series


def _series(
    name: str, points: Sequence[complex | None], role: str, mark: Mark = "line", labels: tuple[str, ...] = ()
) -> Series:
    x = scaled((None if z is None else z.real for z in points), 1e3)
    return Series(name, x, scaled((None if z is None else z.imag for z in points), 1e3), role, mark, labels=labels)

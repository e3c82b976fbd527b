"""The inverse problem: where must the inputs be for a platform to be where it is wanted?

Newton's method on the inputs, whose derivative is the platform's velocity at a unit rate of each, from the assembly on
and from one wanted pose to the next: the assembly's angles pick the working mode.  Where that derivative is singular
the platform cannot move as wanted whatever its drives do (a singularity of the first kind: a leg stretched or folded);
where the loops' own is, its drives do not hold it (of the second kind), which is the assembly's change point.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from analytic.kinematics.assembly import PATH_STEP, STRIDES, Assembly, AssemblyError, Followed
from analytic.kinematics.motion import Motion, kinematics

PASSES = 30
SETTLED = 1e-13  # of the platform's size, or rad
SINGULAR = 1e7  # condition of the derivative, from which on a pose counts as singular


@dataclass(frozen=True)
class Coordinate:
    """What is wanted of a platform: x or y (m, ground frame) of a point of it, or its angle (rad)."""

    body: str
    axis: Literal["x", "y", "angle"]
    point: str = "com"

    @property
    def name(self) -> str:
        """``platform_x`` as in the signals, ``left-arm.P_x`` of another point."""
        return f"{self.body if self.point == 'com' else f'{self.body}.{self.point}'}_{self.axis}"

    def value(self, motion: Motion) -> np.ndarray:
        """It (N,) in a motion."""
        if self.axis == "angle":
            return motion.angle(self.body)
        place = motion.position(self.body, self.point)
        return place.real if self.axis == "x" else place.imag

    def rate(self, motion: Motion) -> np.ndarray:
        """Its rate (N,) in a motion."""
        if self.axis == "angle":
            return motion.angular_velocity(self.body)
        velocity = motion.velocity(self.body, self.point)
        return velocity.real if self.axis == "x" else velocity.imag


def inverse(assembly: Assembly, wanted: Sequence[Coordinate], poses: np.ndarray) -> Followed:
    """Coordinates (n, N) at which the ``wanted``, as many as the linkage has inputs, are at ``poses`` (n_inputs, N),
    which follow one another.

    Raises AssemblyError with the pose where it cannot be reached, or is singular.
    """
    return _Inverse(assembly, wanted).followed(np.asarray(poses, float))


class _Inverse:
    """Walks a platform from pose to pose; ``near`` (n, 1) are the coordinates where it is."""

    def __init__(self, assembly: Assembly, wanted: Sequence[Coordinate]) -> None:
        s = assembly.structure
        if len(wanted) != len(s.inputs):
            raise AssemblyError(
                f"{assembly.mechanism.name}: {len(wanted)} wanted coordinates ({', '.join(w.name for w in wanted)}) and"
                f" {len(s.inputs)} inputs ({', '.join(assembly.positions)}); give as many as there are inputs"
            )
        self.assembly, self.wanted = assembly, tuple(wanted)
        self.inputs = assembly.inputs
        self.near = assembly.follow(self.inputs[:, None]).coordinates
        size = max(body.length for body in assembly.mechanism.bodies) or 1.0
        self.unit = np.array([1.0 if w.axis == "angle" else size for w in wanted])
        self.stride = np.where([w.axis == "angle" for w in wanted], PATH_STEP, size / STRIDES)

    def followed(self, poses: np.ndarray) -> Followed:
        """Coordinates (n, N) at poses (n_inputs, N)."""
        at, _ = self.look()
        found = []
        for pose in poses.T:
            steps = max(1, int(np.ceil(np.abs((pose - at) / self.stride).max() - 1e-9)))
            for k in range(1, steps + 1):
                self.to(at + (pose - at) * k / steps)
            at = pose
            found.append(self.near[:, 0])
        return Followed(np.stack(found, axis=1))

    def look(self) -> tuple[np.ndarray, np.ndarray]:
        """The wanted coordinates (n_inputs,) here, and their derivative (n_inputs, n_inputs) by the inputs."""
        n = self.inputs.size
        inputs, near = np.tile(self.inputs[:, None], n), Followed(np.tile(self.near, n))
        motion = kinematics(self.assembly, inputs, np.eye(n), path=near)
        self.near = motion.coordinates[:, :1].copy()
        return np.array([w.value(motion)[0] for w in self.wanted]), np.array([w.rate(motion) for w in self.wanted])

    def to(self, pose: np.ndarray) -> None:
        """Go to a pose (n_inputs,) near by."""
        for _ in range(PASSES):
            try:
                at, slope = self.look()
            except AssemblyError as error:
                raise self.failed(pose, f"cannot be reached: {error.what}") from None
            if not np.linalg.cond(slope / self.unit[:, None]) < SINGULAR:
                raise self.failed(pose, "is singular: the platform cannot move on, whatever its drives do")
            if np.all(np.abs(at - pose) <= SETTLED * self.unit):
                return
            self.inputs = self.inputs - np.linalg.solve(slope, at - pose)
        raise self.failed(pose, "cannot be reached: no position of the drives has it there")

    def failed(self, pose: np.ndarray, what: str) -> AssemblyError:
        told = [
            f"{w.name} = {np.degrees(x):.6g} deg" if w.axis == "angle" else f"{w.name} = {1e3 * x:.6g} mm"
            for w, x in zip(self.wanted, pose, strict=True)
        ]
        return AssemblyError(
            f"{self.assembly.mechanism.name}: {', '.join(told)} {what}", remedy="keep the path clear of it"
        )

"""The inverse problem: where must the inputs be for a platform to be where it is wanted?

Newton's method on the inputs, whose derivative is the platform's velocity at a unit rate of each, from the assembly on
and from one wanted pose to the next: the assembly's angles pick the working mode.  Where that derivative is singular
the platform cannot move as wanted whatever its drives do (a singularity of the first kind: a leg stretched or folded);
where the loops' own is, its drives do not hold it (of the second kind), which is the assembly's change point.

At a singular pose of the first kind two working modes meet, and a path through it, which touches the end of what is
reached and turns back, does not say in which of them it goes on.  Such a pose is refused wherever it is on the path:
that it lies between two wanted poses shows in how little the platform moves beside it (:func:`passes_zero`).
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
SINGULAR = 1e-6  # of the platform's size per rad: a pose that is settled is this near to one at which it cannot move


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


def inverse(
    assembly: Assembly, wanted: Sequence[Coordinate], poses: np.ndarray, time: np.ndarray | None = None
) -> Followed:
    """Coordinates (n, N) at which the ``wanted``, as many as the linkage has inputs, are at ``poses`` (n_inputs, N),
    which are instants of one motion, at ``time`` (N,) s or evenly apart.

    Raises AssemblyError with the pose where it cannot be reached, or is singular.
    """
    return _Inverse(assembly, wanted).followed(np.asarray(poses, float), time)


def passes_zero(time: np.ndarray, sizes: np.ndarray) -> tuple[int, float] | None:
    """Between which samples (the earlier one's index) a quantity passes through zero, and where between them (0 to 1),
    of which only the ``sizes`` (N,) are known; None where it does not.

    Its square is smooth, whether it passes zero or turns back before.  Polynomials through the six samples about an
    interval say what it is in the middle of that either way, and what its square is: the one that agrees is right.
    """
    for k in range(time.size - 1):
        first = min(max(k - 2, 0), max(time.size - 6, 0))
        near, at = sizes[first : first + 6], (time[first : first + 6] - time[k]) / (time[k + 1] - time[k])
        weights = np.linalg.solve(np.vander(at).T, np.vander([0.5], at.size)[0])
        back, on, square = (weights @ x for x in (near, near * np.where(at > 0.5, -1.0, 1.0), near**2))
        if abs(on**2 - square) < abs(back**2 - square):
            return k, float(sizes[k] / (sizes[k] + sizes[k + 1]))
    return None


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
        self.reach = np.array([1.0 if s.unit(i) == "rad" else size for i in s.inputs])
        self.stride = np.where([w.axis == "angle" for w in wanted], PATH_STEP, size / STRIDES)

    def followed(self, poses: np.ndarray, time: np.ndarray | None) -> Followed:
        """Coordinates (n, N) at poses (n_inputs, N), of which each may have a time (s)."""
        at, slope = self.look()
        found, sizes = [], []
        for row, pose in enumerate(poses.T):
            steps = max(1, int(np.ceil(np.abs((pose - at) / self.stride).max() - 1e-9)))
            for k in range(1, steps + 1):
                slope = self.to(at + (pose - at) * k / steps, _told(time, row - 1 + k / steps))
            at = pose
            found.append(self.near[:, 0])
            sizes.append(self.yields(slope))
        for size in np.array(sizes).T:
            passed = passes_zero(np.arange(len(sizes)) if time is None else time, size)
            if passed is not None:
                k, part = passed
                what = "is singular, or the path's rows are too far apart to tell that it is not: two ways to go on"
                pose = poses[:, k] + part * (poses[:, k + 1] - poses[:, k])
                raise self.failed(pose, f"{_told(time, k + part)}{what} meet there")
        return Followed(np.stack(found, axis=1))

    def look(self) -> tuple[np.ndarray, np.ndarray]:
        """The wanted coordinates (n_inputs,) here, and their derivative (n_inputs, n_inputs) by the inputs."""
        n = self.inputs.size
        inputs, near = np.tile(self.inputs[:, None], n), Followed(np.tile(self.near, n))
        motion = kinematics(self.assembly, inputs, np.eye(n), path=near)
        self.near = motion.coordinates[:, :1].copy()
        return np.array([w.value(motion)[0] for w in self.wanted]), np.array([w.rate(motion) for w in self.wanted])

    def yields(self, slope: np.ndarray) -> np.ndarray:
        """How far (n_inputs,) the platform goes, in its own size or rad, on the shortest way that takes a unit of each
        input: nothing where that input's leg is stretched or folded.
        """
        return 1.0 / np.linalg.norm(np.linalg.inv(slope / self.unit[:, None] * self.reach), axis=1)

    def to(self, pose: np.ndarray, when: str) -> np.ndarray:
        """Go to a pose (n_inputs,) near by; the derivative there.  ``when`` is part of what is said where it fails."""
        for _ in range(PASSES):
            try:
                at, slope = self.look()
            except AssemblyError as error:
                raise self.failed(pose, f"{when}cannot be reached: {error.what}") from None
            scaled = slope / self.unit[:, None] * self.reach
            if not np.linalg.svd(scaled, compute_uv=False)[-1] > SINGULAR:
                raise self.failed(pose, f"{when}is singular: the platform cannot move on, whatever its drives do")
            if np.all(np.abs(at - pose) <= SETTLED * self.unit):
                return slope
            self.inputs = self.inputs - np.linalg.solve(slope, at - pose)
        raise self.failed(pose, f"{when}cannot be reached: no position of the drives has it there")

    def failed(self, pose: np.ndarray, what: str) -> AssemblyError:
        told = [
            f"{w.name} = {np.degrees(x):.6g} deg" if w.axis == "angle" else f"{w.name} = {1e3 * x:.6g} mm"
            for w, x in zip(self.wanted, pose, strict=True)
        ]
        return AssemblyError(
            f"{self.assembly.mechanism.name}: {', '.join(told)} {what}",
            remedy="keep the path clear of it, or give a course of the drives instead",
        )


def _told(time: np.ndarray | None, row: float) -> str:
    """When (s) it is a share of the way beyond a row, in words; nothing before the first, or where nobody knows."""
    return "" if time is None or row < 0 else f"at {np.interp(row, np.arange(time.size), time):.6g} s "

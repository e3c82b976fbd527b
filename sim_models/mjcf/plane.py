"""The plane that a MuJoCo model moves in."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from sim_models.mjcf.errors import MjcfError

PARALLEL = 1e-6  # rad, by which hinge axes may differ and slides lie off the plane
LEVEL = 0.9  # of a normal along the world's z: the plane is seen from above
JOINT_TYPE = mujoco.mjtJoint
HINGE, SLIDE = int(JOINT_TYPE.mjJNT_HINGE), int(JOINT_TYPE.mjJNT_SLIDE)
JOINT_KINDS = {int(JOINT_TYPE.mjJNT_FREE): "free", int(JOINT_TYPE.mjJNT_BALL): "ball"}


@dataclass(frozen=True)
class Plane:
    """Unit vectors (3,) in MuJoCo's world: x and y of the mechanism's ground frame, and the normal, x cross y."""

    x: np.ndarray
    y: np.ndarray
    normal: np.ndarray

    def flat(self, vector: np.ndarray) -> complex:
        """The part of a vector (3,) in the plane, as x + iy."""
        return complex(float(self.x @ vector), float(self.y @ vector))

    def __str__(self) -> str:
        return f"x along {_words(self.x)} and y along {_words(self.y)} of MuJoCo's world"


def _line(axis: np.ndarray) -> str:
    """A direction whose sense does not matter, towards the positive side."""
    return _words(axis * np.sign(axis[np.argmax(np.abs(axis) > PARALLEL)]))


def _words(axis: np.ndarray) -> str:
    for k, name in enumerate("xyz"):
        if abs(axis[k]) == 1.0:
            return name if axis[k] > 0 else f"-{name}"
    return "[" + ", ".join(f"{v:.6g}" for v in axis) + "]"


def across(normal: np.ndarray) -> Plane:
    """The plane across a direction (3,): x-y, x-z or y-z where it is one of these, else with y upward."""
    k = int(np.argmax(np.abs(normal)))
    world = np.eye(3)
    if abs(normal[k]) > 1.0 - PARALLEL**2:
        x, y = world[[i for i in range(3) if i != k]]
        return Plane(x, y, np.cross(x, y))
    seen = 0 if abs(normal[2]) > LEVEL else 2
    along = world[seen] - normal * normal[seen]
    along /= np.linalg.norm(along)
    if seen == 0:
        normal = normal * np.sign(normal[2])
        return Plane(along, np.cross(normal, along), normal)
    x = np.cross(along, normal)
    x *= np.sign(x[np.argmax(np.abs(x))])
    return Plane(x, along, np.cross(x, along))


def plane_of(model: mujoco.MjModel, data: mujoco.MjData, said: str) -> Plane:
    """The plane that all joints leave a model to move in.  Raises MjcfError with the body and axis of one that does
    not.
    """
    for j in range(model.njnt):
        if int(model.jnt_type[j]) in JOINT_KINDS:
            raise MjcfError(
                f"{said}: {joint_words(model, j)} is a {JOINT_KINDS[int(model.jnt_type[j])]} joint; a planar linkage"
                " has hinges, all parallel, and slides across them"
            )
    hinges = [j for j in range(model.njnt) if model.jnt_type[j] == HINGE]
    if not hinges:
        raise MjcfError(f"{said}: has no hinge; a linkage has one at least, between a body and the ground")
    axes = data.xaxis[hinges]
    agree = (np.abs(axes @ axes.T) > 1.0 - PARALLEL).sum(axis=1)
    plane = across(axes[int(np.argmax(agree))])
    for j in range(model.njnt):
        axis = data.xaxis[j]
        hinge = j in hinges
        off = np.linalg.norm(np.cross(axis, plane.normal)) if hinge else abs(float(axis @ plane.normal))
        if off > PARALLEL:
            kind, must = ("hinge", "along") if hinge else ("slide", "across")
            raise MjcfError(
                f"{said}: {joint_words(model, j)} is a {kind} with the axis {_line(axis)}; in a planar linkage it"
                f" lies {must} {_line(plane.normal)}, as the other joints have it"
            )
    return plane


def body_words(model: mujoco.MjModel, body: int) -> str:
    """A body in words."""
    name = model.body(body).name
    return f"body {name!r}" if name else f"the body without a name, number {body}"


def joint_words(model: mujoco.MjModel, joint: int) -> str:
    """A joint in words, with its body."""
    name = model.joint(joint).name
    of = body_words(model, int(model.jnt_bodyid[joint]))
    return f"joint {name!r} of {of}" if name else f"the joint of {of}"


def actuator_words(model: mujoco.MjModel, i: int) -> str:
    """An actuator in words."""
    name = model.actuator(i).name
    return f"actuator {name!r}" if name else f"the actuator number {i + 1}"

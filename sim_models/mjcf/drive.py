"""What drives a MuJoCo model, and what else acts on it: a mechanism's drive, its loads, what it has no word for.

A motor is a huge armature on a hinge of the ground, whose speed is the first keyframe's, or an actuator of such a
hinge, whose speed is the first keyframe's control of a velocity servo, or the keyframe's speed of the hinge.  Where one
motor leaves freedoms, actuators of other joints, slides too, are motors as well.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np

from sim_models.mjcf.planar import Pin, Planar

AT_JOINT = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
AT_SITE = int(mujoco.mjtTrn.mjTRN_SITE)
AFFINE, STATELESS = int(mujoco.mjtBias.mjBIAS_AFFINE), int(mujoco.mjtDyn.mjDYN_NONE)
FLYWHEEL = 1e4  # times the inertia of the whole linkage: an armature that no reaction slows down
ASSUMED = 1.0  # rad/s, where the file does not say how fast its motor turns
ASSUMED_SLIDE = 0.1  # m/s


@dataclass(frozen=True)
class Motor:
    """A drive: its joint, its speed (rad/s of the link on the ground, else of the second link relative to the first; of
    a slide m/s; None: not said) and its actuator's number (or -1).
    """

    pin: Pin
    speed: float | None
    actuator: int


@dataclass(frozen=True)
class Push:
    """A constant force (N, ground frame) and torque (N.m) on a link at a point (m, link frame), by an actuator."""

    actuator: int
    link: int
    name: str  # of its site
    point: complex
    force: complex
    torque: float


def motor(planar: Planar) -> Motor | None:
    """The drive of a model; None where nothing drives it."""
    grounded = {pin.joint: pin for pin in planar.pins if pin.joint >= 0 and not pin.slides and 0 in pin.links}
    m = planar.model
    for j, pin in grounded.items():
        if flywheel(planar, pin):
            return Motor(pin, _turning(planar, pin, j), next(_acting(m, j), -1))
    for i in range(m.nu):
        if m.actuator_trntype[i] in AT_JOINT and m.actuator_trnid[i, 0] in grounded:
            pin = grounded[int(m.actuator_trnid[i, 0])]
            speed = _commanded(planar, i, pin)
            return Motor(pin, speed or _turning(planar, pin, pin.joint), i)
    return None


def _acting(m: mujoco.MjModel, j: int) -> Iterator[int]:
    """The actuators of a joint."""
    return (i for i in range(m.nu) if m.actuator_trntype[i] in AT_JOINT and m.actuator_trnid[i, 0] == j)


def motors(planar: Planar) -> list[Motor]:
    """What may drive a model, the likeliest first: the one motor, then every actuator of another joint of its tree."""
    first, m, found = motor(planar), planar.model, []
    pins = {pin.joint: pin for pin in planar.pins if pin.joint >= 0}
    taken = set() if first is None else {first.pin.joint}
    for i in range(m.nu):
        joint = int(m.actuator_trnid[i, 0])
        if m.actuator_trntype[i] in AT_JOINT and joint in pins and joint not in taken:
            pin = pins[joint]
            taken.add(joint)
            found.append(Motor(pin, _commanded(planar, i, pin) or _turning(planar, pin, joint), i))
    return found if first is None else [first, *found]


def flywheel(planar: Planar, pin: Pin) -> bool:
    """Whether a joint has so large an armature that it moves on as it does, whatever the linkage does."""
    m = planar.model
    links = planar.links[1:]
    size = max([planar.size, *(abs(p) for pin in planar.pins for p in pin.points)])
    whole = sum(link.mass for link in links) * (1.0 if pin.slides else size**2)
    whole += 0.0 if pin.slides else sum(link.inertia for link in links)
    return bool(m.dof_armature[m.jnt_dofadr[pin.joint]] > FLYWHEEL * whole)


def _turning(planar: Planar, pin: Pin, joint: int) -> float | None:
    """How fast a hinge turns in the first keyframe in which it does."""
    m = planar.model
    speeds = m.key_qvel[:, m.jnt_dofadr[joint]] if m.nkey else np.zeros(0)
    return next((_driven_by(pin) * float(v) for v in speeds if v), None)


def _driven_by(pin: Pin) -> float:
    """What a joint's speed is times: of a hinge on the ground for the link's, else for the second link's relative to
    the first's.
    """
    if pin.slides:
        return 1.0
    return -pin.turn if pin.links[1] == 0 else pin.turn


def _commanded(planar: Planar, i: int, pin: Pin) -> float | None:
    """The speed that a keyframe commands of a velocity servo."""
    m = planar.model
    gain, slope, damping = m.actuator_gainprm[i, 0], m.actuator_biasprm[i, 1], m.actuator_biasprm[i, 2]
    servo = m.actuator_biastype[i] == AFFINE and not slope and gain and damping == -gain
    commands = m.key_ctrl[:, m.actuator_ctrladr[i]] if m.nkey and m.actuator_ctrlnum[i] == 1 else np.zeros(0)
    if not servo:
        return None
    return next((_driven_by(pin) * float(c / m.actuator_gear[i, 0]) for c in commands if c), None)


def push(planar: Planar, i: int) -> Push | None:
    """What an actuator does if it is a constant force: on a site, in the directions of one that the ground has."""
    m = planar.model
    steady = (
        m.actuator_trntype[i] == AT_SITE
        and m.actuator_biastype[i] == AFFINE
        and m.actuator_dyntype[i] == STATELESS
        and not m.actuator_biasprm[i, 1:3].any()
        and not m.actuator_forcelimited[i]
        and int(m.actuator_trnid[i, 1]) >= 0
        and not m.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
    )
    if not steady:
        return None
    site, refsite = (planar.sites[int(k)] for k in m.actuator_trnid[i])
    if refsite.link != 0 or site.link == 0:
        return None
    data = mujoco.MjData(m)
    mujoco.mj_kinematics(m, data)
    turned = data.site_xmat[refsite.number].reshape(3, 3)
    size, gear = float(m.actuator_biasprm[i, 0]), m.actuator_gear[i]
    force, torque = planar.plane.flat(turned @ gear[:3]), float(planar.plane.normal @ (turned @ gear[3:]))
    return Push(i, site.link, site.name, site.point, force * size, torque * size)


def left_out(planar: Planar) -> Iterator[str]:
    """What of the model a mechanism has no word for and does not need, a sentence each."""
    m, options = planar.model, planar.model.opt
    counted = (
        ("sensors", m.nsensor),
        ("contacts between geoms", _may_touch(m)),
        ("limits of joints", int(m.jnt_limited.sum())),
        ("cameras and lights", m.ncam + m.nlight),
        ("mocap bodies, which stand still", m.nmocap),
    )
    yield from (f"{what}: left out ({n})" for what, n in counted if n)
    if options.density or options.viscosity:
        yield "the resistance of air or another fluid (option.density, viscosity): left out"
    across = float(planar.plane.normal @ gravity(m))
    if abs(across) > 1e-9 * float(np.abs(options.gravity).max(initial=0.0)):
        yield f"gravity across the plane, {across:.6g} m/s^2: carried by the joints, and left out"


def gravity(m: mujoco.MjModel) -> np.ndarray:
    """Gravity (3,) m/s^2 as it acts."""
    off = m.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)
    return np.zeros(3) if off else np.array(m.opt.gravity)


def _may_touch(m: mujoco.MjModel) -> int:
    """How many geoms may touch another, or pairs of them that are named."""
    off = m.opt.disableflags & (int(mujoco.mjtDisableBit.mjDSBL_CONTACT) | int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT))
    if off:
        return 0
    kinds, accepts = m.geom_contype, m.geom_conaffinity
    touching = (kinds[:, None] & accepts[None, :]) | (accepts[:, None] & kinds[None, :])
    apart = m.geom_bodyid[:, None] != m.geom_bodyid[None, :]
    return int((touching.astype(bool) & apart).any(axis=1).sum()) + m.npair

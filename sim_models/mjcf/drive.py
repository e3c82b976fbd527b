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

from sim_models.mjcf.compiled import AT_JOINT
from sim_models.mjcf.parts import PlanarPin
from sim_models.mjcf.planar import Planar

AT_SITE = int(mujoco.mjtTrn.mjTRN_SITE)
NO_BIAS, AFFINE = int(mujoco.mjtBias.mjBIAS_NONE), int(mujoco.mjtBias.mjBIAS_AFFINE)
FIXED, STATELESS = int(mujoco.mjtGain.mjGAIN_FIXED), int(mujoco.mjtDyn.mjDYN_NONE)
NO_ACTUATION, NO_CLAMP = int(mujoco.mjtDisableBit.mjDSBL_ACTUATION), int(mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL)
FLYWHEEL = 1e4  # times the inertia of the whole linkage: an armature that no reaction slows down
ASSUMED = 1.0  # rad/s, where the file does not say how fast its motor turns
ASSUMED_SLIDE = 0.1  # m/s


@dataclass(frozen=True)
class ModelMotor:
    """A drive: its joint, its speed (rad/s of the link on the ground, else of the second link relative to the first; of
    a slide m/s; None: not said).
    """

    pin: PlanarPin
    speed: float | None


@dataclass(frozen=True)
class Push:
    """A constant force (N, ground frame) and torque (N.m) on a link at a point (m, link frame), by an actuator."""

    actuator: int
    link: int
    name: str  # of its site
    point: complex
    force: complex
    torque: float


def motor(planar: Planar) -> ModelMotor | None:
    """The drive of a model; None where nothing drives it."""
    grounded = {pin.joint: pin for pin in planar.pins if pin.joint >= 0 and not pin.slides and 0 in pin.links}
    m = planar.model
    for j, pin in grounded.items():
        if flywheel(planar, pin):
            return ModelMotor(pin, _turning(planar, pin, j))
    for i, joint in _acting(m):
        if joint in grounded:
            pin = grounded[joint]
            return ModelMotor(pin, _commanded(planar, i, pin) or _turning(planar, pin, joint))
    return None


def switched_off(m: mujoco.MjModel, i: int) -> bool:
    """Whether an actuator gives no force: all are disabled, or its group is."""
    group = int(m.actuator_group[i])
    return bool(m.opt.disableflags & NO_ACTUATION) or (group >= 0 and bool(m.opt.disableactuator >> group & 1))


def _acting(m: mujoco.MjModel) -> Iterator[tuple[int, int]]:
    """The actuators of joints that are not switched off, and their joints."""
    for i in range(m.nactuator):
        if m.actuator_trntype[i] in AT_JOINT and not switched_off(m, i):
            yield i, int(m.actuator_trnid[i, 0])


def motors(planar: Planar) -> list[ModelMotor]:
    """What may drive a model, the likeliest first: the one motor, then every actuator of another joint of its tree."""
    first, m, found = motor(planar), planar.model, []
    pins = {pin.joint: pin for pin in planar.pins if pin.joint >= 0}
    taken = set() if first is None else {first.pin.joint}
    for i, joint in _acting(m):
        if joint in pins and joint not in taken:
            pin = pins[joint]
            taken.add(joint)
            found.append(ModelMotor(pin, _commanded(planar, i, pin) or _turning(planar, pin, joint)))
    return found if first is None else [first, *found]


def flywheel(planar: Planar, pin: PlanarPin) -> bool:
    """Whether a joint has so large an armature that it moves on as it does, whatever the linkage does."""
    m = planar.model
    links = planar.links[1:]
    size = max([planar.size, *(abs(p) for pin in planar.pins for p in pin.points)])
    whole = sum(link.mass for link in links) * (1.0 if pin.slides else size**2)
    whole += 0.0 if pin.slides else sum(link.inertia for link in links)
    return bool(m.dof_armature[m.jnt_dofadr[pin.joint]] > FLYWHEEL * whole)


def _turning(planar: Planar, pin: PlanarPin, joint: int) -> float | None:
    """How fast a hinge turns in the first keyframe in which it does."""
    m = planar.model
    speeds = m.key_qvel[:, m.jnt_dofadr[joint]] if m.nkey else np.zeros(0)
    return next((_driven_by(pin) * float(v) for v in speeds if v), None)


def _driven_by(pin: PlanarPin) -> float:
    """What a joint's speed is times: of a hinge on the ground for the link's, else for the second link's relative to
    the first's.
    """
    if pin.slides:
        return 1.0
    return -pin.turn if pin.links[1] == 0 else pin.turn


def _commanded(planar: Planar, i: int, pin: PlanarPin) -> float | None:
    """The speed at which a velocity servo gives no force: that of the first keyframe whose command moves it, or of
    control 0 where its range, or a constant force of its own, moves that.
    """
    m = planar.model
    gain, (bias, slope, damping) = m.actuator_gainprm[i, 0], m.actuator_biasprm[i, :3]
    servo = m.actuator_biastype[i] == AFFINE and not slope and gain and damping == -gain
    if not servo or m.actuator_gaintype[i] != FIXED or m.actuator_ctrlnum[i] != 1:
        return None
    commands = (clamped(m, i, c) + bias / gain for c in (*m.key_ctrl[:, m.actuator_ctrladr[i]], 0.0))
    return next((_driven_by(pin) * float(c / m.actuator_gear[i, 0]) for c in commands if c), None)


def clamped(m: mujoco.MjModel, i: int, control: float = 0.0) -> float:
    """What an actuator with one control takes that for, within its range."""
    at = int(m.actuator_ctrladr[i])
    if not m.actuator_ctrllimited[at] or m.opt.disableflags & NO_CLAMP:
        return control
    return float(np.clip(control, *m.actuator_ctrlrange[at]))


def steady_force(m: mujoco.MjModel, i: int) -> float | None:
    """The force of an actuator with control 0, times whose gear it pushes; None where it is none that is constant."""
    bias = m.actuator_biasprm[i, :3] if m.actuator_biastype[i] == AFFINE else np.zeros(3)
    control = clamped(m, i) if m.actuator_ctrlnum[i] == 1 else 0.0
    if m.actuator_dyntype[i] != STATELESS or m.actuator_biastype[i] not in (NO_BIAS, AFFINE) or bias[1:].any():
        return None
    if control and m.actuator_gaintype[i] != FIXED:
        return None
    force = float(bias[0] + (control and m.actuator_gainprm[i, 0] * control))
    return float(np.clip(force, *m.actuator_forcerange[i])) if m.actuator_forcelimited[i] else force


def throttled(m: mujoco.MjModel, i: int) -> int | None:
    """A joint whose ``actuatorfrcrange`` may take some of what an actuator on a site gives; None where there is
    none.
    """
    body = int(m.site_bodyid[m.actuator_trnid[i, 0]])
    while body:
        for j in range(m.body_jntadr[body], m.body_jntadr[body] + m.body_jntnum[body]):
            if m.jnt_actfrclimited[j]:
                return int(j)
        body = int(m.body_parentid[body])
    return None


def push(planar: Planar, i: int) -> Push | None:
    """What an actuator does with control 0 if it is a constant force: on a site, in the directions of one that the
    ground has.
    """
    m = planar.model
    if m.actuator_trntype[i] != AT_SITE or int(m.actuator_trnid[i, 1]) < 0 or switched_off(m, i):
        return None
    size = steady_force(m, i)
    if not size:
        return None
    site, refsite = (planar.sites[int(k)] for k in m.actuator_trnid[i])
    if refsite.link != 0 or site.link == 0:
        return None
    data = mujoco.MjData(m)
    mujoco.mj_kinematics(m, data)
    turned = data.site_xmat[refsite.number].reshape(3, 3)
    gear = m.actuator_gear[i]
    force, torque = planar.plane.flat(turned @ gear[:3]), float(planar.plane.normal @ (turned @ gear[3:]))
    return Push(i, site.link, site.name, site.point, force * size, torque * size)


def left_out(planar: Planar) -> Iterator[str]:
    """What of the model a mechanism has no word for and does not need, a sentence each."""
    m, options = planar.model, planar.model.opt
    counted = (
        ("sensors", m.nsensor),
        ("contacts between geoms", _may_touch(m)),
        ("limits of joints", int(m.jnt_limited.sum())),
        ("limits of what actuators give in joints (actuatorfrcrange)", int(m.jnt_actfrclimited.sum())),
        ("cameras and lights", m.ncam + m.nlight),
        ("mocap bodies, which stand still", m.nmocap),
    )
    yield from (f"{what}: left out ({n})" for what, n in counted if n)
    if options.density or options.viscosity:
        yield "the resistance of air or another fluid (option.density, viscosity, wind): left out"
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

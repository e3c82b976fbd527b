"""Laws of joints, and springs between points, that an MJCF file writes as tendons, as this project's own exports do.

The relative angle of any two links is a sum of hinge angles, so a fixed tendon over hinges can be the spring, the
damper or the friction of a joint that closes a loop.  A spatial one from site to site is a spring between points.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from sim_models.mjcf.parts import PlanarPin, Site
from sim_models.mjcf.planar import LOOP_CLOSED, Planar, positioned

OVER_JOINTS, FROM_SITE = int(mujoco.mjtWrap.mjWRAP_JOINT), int(mujoco.mjtWrap.mjWRAP_SITE)
SAME_COEFFICIENT = 1e-9  # of the largest coefficient


@dataclass(frozen=True)
class TendonLaw:
    """A tendon that acts in a joint: its length is ``scale`` times the joint's angle or travel, but for a constant."""

    tendon: int
    pin: PlanarPin
    scale: float


@dataclass(frozen=True)
class PointSpring:
    """A tendon that is a spring, with a damper beside it, between two points: its sites, on two links."""

    tendon: int
    sites: tuple[Site, Site]


def acts(m: mujoco.MjModel, t: int) -> bool:
    """Whether a tendon gives any force by itself."""
    return bool(
        m.tendon_stiffness[t] or m.tendon_damping[t] or m.tendon_frictionloss[t] or _beyond(m, t)
    )  # fmt: skip


def law(planar: Planar, t: int) -> TendonLaw | None:
    """The joint in which a tendon acts, if it is a law that a mechanism's joint can have."""
    m = planar.model
    form, spin = coefficients(m, t), planar.spin
    low, high = m.tendon_lengthspring[t]
    if form is None or not form.any() or _beyond(m, t) or (m.tendon_stiffness[t] and low != high):
        return None
    for pin in planar.pins:
        own = np.zeros(m.nv)
        if pin.slides:
            own[m.jnt_dofadr[pin.joint]] = 1.0
        else:
            own = spin[pin.links[1]] - spin[pin.links[0]]
        if not own.any():
            continue
        scale = float(form @ own / (own @ own))
        if scale and np.abs(form - scale * own).max() <= SAME_COEFFICIENT * np.abs(form).max():
            return TendonLaw(t, pin, scale)
    return None


def point_spring(planar: Planar, t: int) -> PointSpring | None:
    """The spring between two points of the plane that a tendon is, if it is one, and they are apart at the start."""
    m, plane, near = planar.model, planar.plane, LOOP_CLOSED * planar.size
    low, high = m.tendon_lengthspring[t]
    wraps = range(m.tendon_adr[t], m.tendon_adr[t] + m.tendon_num[t])
    if [int(m.wrap_type[w]) for w in wraps] != [FROM_SITE, FROM_SITE]:
        return None
    if _beyond(m, t) or m.tendon_frictionloss[t] or (m.tendon_stiffness[t] and low != high):
        return None
    first, second = (planar.sites[int(m.wrap_objid[w])] for w in wraps)
    places = positioned(m, planar.pose).site_xpos
    apart = places[second.number] - places[first.number]
    if first.link == second.link or abs(plane.flat(apart)) <= near or abs(float(plane.normal @ apart)) > near:
        return None
    return PointSpring(t, (first, second))


def coefficients(m: mujoco.MjModel, t: int) -> np.ndarray | None:
    """The length of a fixed tendon as a linear form (nv,) of coordinates; None of another."""
    wraps = range(m.tendon_adr[t], m.tendon_adr[t] + m.tendon_num[t])
    if any(int(m.wrap_type[w]) != OVER_JOINTS for w in wraps):
        return None
    form = np.zeros(m.nv)
    for w in wraps:
        form[m.jnt_dofadr[m.wrap_objid[w]]] += m.wrap_prm[w]
    return form


def _beyond(m: mujoco.MjModel, t: int) -> bool:
    """Whether a tendon has what no mechanism's joint has."""
    curved = m.tendon_stiffnesspoly[t].any() or m.tendon_dampingpoly[t].any()
    return bool(curved or m.tendon_limited[t] or m.tendon_armature[t])

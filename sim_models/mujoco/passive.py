"""Laws that MuJoCo's tendons have no words for, felt in every evaluation of a step, stages of Runge-Kutta included.

MuJoCo has one passive callback for all models; ours is set while a linkage that needs it is evaluated.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from analytic.mechanism import Joint, PeriodicTorque
from analytic.mechanism.varying import Vectors


@dataclass(frozen=True)
class Passive:
    """What acts in a model: the laws of joints, by their tendon's number, each with the form (nv,) of its coordinate,
    and the ``loads`` (N) of those whose friction grows with their reaction; a torque over the angle of the driven body,
    which is ``angle`` (rad) plus a ``form`` (nq,) of the coordinates; and, by the number of their sites, what says the
    force (N, x + iy) and torque (N.m) now of the loads that vary.
    """

    joints: Mapping[int, tuple[Joint, np.ndarray]]
    loads: Mapping[str, float]
    periodic: PeriodicTorque | None
    angle: float
    form: np.ndarray
    pushes: Mapping[int, Callable[[], tuple[Vectors, float]]]

    def __call__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Add to the passive forces, and give dry friction the size that it has at this rate and load."""
        for t, joint, form in self._pushing:
            if joint.cubic or joint.drag:
                rate, stretch = float(data.ten_velocity[t]), float(data.ten_length[t] - model.tendon_lengthspring[t, 0])
                data.qfrc_passive[:] -= (joint.cubic * stretch**3 + joint.drag * abs(rate) * rate) * form
            if joint.stops:
                position = float(data.ten_length[t] - model.tendon_lengthspring[t, 0]) + joint.rest_angle
                data.qfrc_passive[:] += joint.stop(position, float(data.ten_velocity[t]), model.opt.timestep) * form
        if self.periodic is not None:
            data.qfrc_passive[:] += self.periodic.at(self.angle + float(self.form @ data.qpos)) * self.form
        for site, push in self.pushes.items():
            now, torque = push()
            force = complex(now)
            vectors = [force.real, force.imag, 0.0], [0.0, 0.0, torque], data.site_xpos[site]
            mujoco.mj_applyFT(model, data, *vectors, model.site_bodyid[site], data.qfrc_passive)
        self.rub(data)

    @cached_property
    def _pushing(self) -> list[tuple[int, Joint, np.ndarray]]:
        """What has more than dry friction, by its tendon's number: looked up once, not in every evaluation."""
        each = self.joints.items()
        return [(t, joint, form) for t, (joint, form) in each if joint.cubic or joint.drag or joint.stops]

    @cached_property
    def _rubbing(self) -> dict[int, Joint]:
        """Whose dry friction depends on its rate."""
        return {t: joint for t, (joint, _) in self.joints.items() if joint.stribeck_speed}

    def rub(self, data: mujoco.MjData) -> None:
        """Give the rows of dry friction that depends on its rate the size that it has at this one and its load."""
        for row, t in friction_rows(data):
            if (joint := self._rubbing.get(t)) is not None:
                load = joint.load_friction(self.loads.get(joint.name, 0.0))
                data.efc_frictionloss[row] = joint.dry(float(data.ten_velocity[t])) + load


def friction_rows(data: mujoco.MjData) -> Iterator[tuple[int, int]]:
    """The rows of dry friction, each with its tendon."""
    first = data.ne
    return enumerate(data.efc_id[first : first + data.nf].tolist(), first)


@contextlib.contextmanager
def felt(passive: Passive | None) -> Iterator[None]:
    """Within, every evaluation of MuJoCo's feels it.  Not for longer: a model cannot be compiled meanwhile."""
    if passive is None:
        yield
        return
    before = mujoco.get_mjcb_passive()
    mujoco.set_mjcb_passive(passive)
    try:
        yield
    finally:
        mujoco.set_mjcb_passive(before)

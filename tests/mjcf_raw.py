"""What MuJoCo's own arrays say of a linkage of one crank, with none of this project's reading of its file."""

from __future__ import annotations

import mujoco
import numpy as np

H = 1e-6  # s, of difference quotients along the motion
EQUALITY = int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
DRY = (int(mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF), int(mujoco.mjtConstraint.mjCNSTR_FRICTION_TENDON))


class Raw:
    """A model at coordinates (nq,) in which its loops are closed; the actuators of its crank's joint give nothing."""

    def __init__(self, text: str, crank: str, q: np.ndarray | None = None) -> None:
        self.m = m = mujoco.MjModel.from_xml_string(text)
        self.d = mujoco.MjData(m)
        joint = m.joint(crank).id
        self.dof = int(m.jnt_dofadr[joint])
        for i in range(m.nactuator):
            if m.actuator_trntype[i] == int(mujoco.mjtTrn.mjTRN_JOINT) and m.actuator_trnid[i, 0] == joint:
                m.actuator_gainprm[i] = m.actuator_biasprm[i] = 0.0
        self.q = m.qpos0.copy() if q is None else q

    def rows(self, q: np.ndarray) -> np.ndarray:
        """The loops' Jacobian (k, nv) at coordinates."""
        self.d.qpos[:] = q
        mujoco.mj_forward(self.m, self.d)
        return np.asarray(self.d.efc_J.reshape(self.d.nefc, self.m.nv)[self.d.efc_type == EQUALITY])

    def allowed(self, rows: np.ndarray, target: np.ndarray, crank: float) -> np.ndarray:
        """What (nv,) moves the crank so and the loops by ``target`` (k,)."""
        own = np.eye(self.m.nv)[self.dof]
        return np.asarray(np.linalg.lstsq(np.vstack([rows, own]), np.append(target, crank), rcond=None)[0])

    def torque(self, speed: float) -> float:
        """What the crank's motor gives (N.m) along its coordinate as that goes at ``speed`` (rad/s), by virtual
        work.
        """
        m, d, rows = self.m, self.d, self.rows(self.q)
        v = self.allowed(rows, np.zeros(len(rows)), speed)
        turning = (self.rows(self.q + H * v) - self.rows(self.q - H * v)) / (2 * H)
        a = self.allowed(rows, -turning @ v, 0.0)
        d.qpos[:], d.qvel[:] = self.q, v
        mujoco.mj_forward(m, d)
        inertia = np.zeros(m.nv)
        mujoco.mj_mulM(m, d, inertia, a)
        force = inertia + d.qfrc_bias - d.qfrc_passive - d.qfrc_actuator
        for row in np.flatnonzero(np.isin(d.efc_type, DRY)):
            along = d.efc_J.reshape(d.nefc, m.nv)[row]
            force += np.sign(along @ v) * d.efc_frictionloss[row] * along
        return float(force @ v) / speed


def moved(text: str, steps: int = 40) -> np.ndarray:
    """Coordinates and velocities (nq + nv,) after so many steps from the first keyframe, or from rest at qpos0."""
    m = mujoco.MjModel.from_xml_string(text)
    d = mujoco.MjData(m)
    if m.nkey:
        mujoco.mj_resetDataKeyframe(m, d, 0)
    mujoco.mj_step(m, d, nstep=steps)
    return np.concatenate([d.qpos, d.qvel])

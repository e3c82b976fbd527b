"""A state of somebody's model without transients, as its own constraint rows give.

MuJoCo's loops are soft: they open until the rows' springs carry the reactions, and what its rows leave out of the
acceleration.  A run that began closed would swing into that; so it begins where Newton's method finds it open.
"""

from __future__ import annotations

import mujoco
import numpy as np

from sim_models.mjcf.linkage import EQUALITY, TheirLinkage

DIFFERENCE_STEP = 1e-7  # rad or m, of difference quotients
SMALLEST_CORRECTION = 1e-10  # the same: Newton's last step
NEWTON_STEPS = 30
STANDSTILL_OF_SLIP = 1e-8  # of the fastest joint's speed: one that turns no faster has no direction of slip
DRY = (int(mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF), int(mujoco.mjtConstraint.mjCNSTR_FRICTION_TENDON))


def rest(link: TheirLinkage, q: np.ndarray, v: np.ndarray, a: np.ndarray, lag: float) -> np.ndarray | None:
    """Coordinates (nq,) at which the model has the accelerations ``a``, near coordinates q, the motors held; None where
    there are none.

    ``v`` are true velocities; MuJoCo's are older by ``lag`` (s).  The data is left at the state.
    """
    m = link.model
    free = np.setdiff1d(np.arange(m.nv), link.dofs)
    n, q = free.size, q.copy()
    force = np.zeros(0)
    for _ in range(NEWTON_STEPS):
        load, push, miss, soft = _balance(link, q, v, a, lag)
        if force.size != push.shape[0]:
            force = np.linalg.lstsq(push[:, free].T, load[free], rcond=None)[0]
        matrix = np.zeros((n + force.size, n + force.size))
        matrix[:n, n:], matrix[n:, n:] = -push[:, free].T, -np.diag(soft)
        for column, i in enumerate(free):
            beside = q.copy()
            beside[i] += DIFFERENCE_STEP
            load_there, push_there, miss_there, _ = _balance(link, beside, v, a, lag)
            if push_there.shape != push.shape:
                return None
            matrix[:n, column] = (load_there - load - (push_there - push).T @ force)[free] / DIFFERENCE_STEP
            matrix[n:, column] = (miss_there - miss) / DIFFERENCE_STEP
        left = np.concatenate([(load - push.T @ force)[free], miss - soft * force])
        if not (np.all(np.isfinite(matrix)) and np.all(np.isfinite(left))):
            return None
        move = np.linalg.lstsq(matrix, -left, rcond=1e-15)[0]
        q[free] += move[:n]
        force = force + move[n:]
        if float(np.abs(move[:n]).max(initial=0.0)) < SMALLEST_CORRECTION:
            _balance(link, q, v, a, lag)
            d = link.data
            d.efc_force[:] = 0.0
            d.efc_force[d.efc_type == EQUALITY] = force
            d.qacc[:] = a
            return q
    return None


def _balance(
    link: TheirLinkage, q: np.ndarray, v: np.ndarray, a: np.ndarray, lag: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """What the forces f of the equalities' rows must satisfy: load (nv,) = push^T f, and miss (k,) = soft f."""
    m, d = link.model, link.data
    d.qpos[:], d.qvel[:] = q, v - lag * a
    mujoco.mj_fwdPosition(m, d)
    mujoco.mj_fwdVelocity(m, d)
    mujoco.mj_fwdActuation(m, d)
    inertia = np.zeros(m.nv)
    mujoco.mj_mulM(m, d, inertia, a)
    jacobian = d.efc_J.reshape(d.nefc, m.nv)
    load = inertia + d.qfrc_bias - d.qfrc_passive - d.qfrc_actuator
    for row in np.flatnonzero(np.isin(d.efc_type, DRY)):  # dry friction is its whole size where there is slip
        slip = float(jacobian[row] @ v)
        if abs(slip) > STANDSTILL_OF_SLIP * float(np.abs(v).max(initial=0.0)):
            load += np.sign(slip) * d.efc_frictionloss[row] * jacobian[row]
    closing = d.efc_type == EQUALITY
    push = jacobian[closing]
    damping = d.efc_KBIP[closing, 1]
    miss = d.efc_aref[closing] - push @ a
    if not lag:  # what velocity there is across the rows is an error of v, which need not become one of q
        miss = miss + damping * d.efc_vel[closing]
    return load, push, miss, d.efc_R[closing].copy()

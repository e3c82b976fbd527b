"""Equilibria of a MuJoCo linkage: at rest, or in a motion without transients.

Both are found by Newton's method on MuJoCo's own equations, row by row, for a *pressed* linkage: its joints with
clearance touch, whatever the sign of their force.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from analytic.kinematics import structure
from analytic.mechanism import GROUND
from sim_models.common.contact_laws import pressed_to
from sim_models.common.failed_starts import check_stiff_enough, no_start, why_no_equilibrium
from sim_models.engine import Cause, Request, SimulationError
from sim_models.mujoco.laws import WallContact
from sim_models.mujoco.mjcf import Setting
from sim_models.mujoco.model import MujocoLinkage
from sim_models.mujoco.passive import felt
from sim_models.mujoco.state import (
    FRICTION_LOOKS,
    contact_rows,
    corner_friction,
    gap,
    heed,
    joint_forces,
    pressing,
    pushes,
    signals,
    touch,
    unheeded,
)
from sim_models.mujoco.steady import ANGLES_AROUND, derivative
from sim_models.run.path import NO_GAPS, TURN_ASIDE, Gaps, Path, Poses, faced, seats

DIFFERENCE_STEP = 1e-7  # rad or m, of difference quotients
LAST_NEWTON_STEP = 1e-9  # rad, or m over the linkage's size: Newton's last step; the error left is its square
BLOCK_TRIES = 3  # of how blocks rest
FACINGS = 5  # times that a motion that loads oppose at rest is found anew from the gaps that they press pins to
NO_LOAD = 1e-9  # of the largest force: a reaction without direction
SLIP_STANDSTILL = 2e-8  # of TURN_ASIDE: a joint that turns no farther around where a path is has no direction of slip


@dataclass(frozen=True)
class StateEquations:
    """Newton's equations at a state: ``load`` (nv,) = ``push``^T f, and rows ``goal`` (k,) = ``softness`` f."""

    load: np.ndarray
    push: np.ndarray
    goal: np.ndarray
    softness: np.ndarray
    rows: np.ndarray


def balance(
    link: MujocoLinkage, q: np.ndarray, v: np.ndarray, a: np.ndarray, slip: Mapping[str, float]
) -> StateEquations:
    """What joint forces f must satisfy for the linkage to have this position, velocity and acceleration.

    Every joint with clearance counts as pressed; ``slip`` is the sign of its relative angular velocity, against which
    friction acts, that of the joint's own law as well as that in the contact.
    """
    m, d = link.model, link.data
    d.qpos[:], d.qvel[:] = q, v
    mujoco.mj_fwdPosition(m, d)
    if touch(link, always=True):
        mujoco.mj_makeConstraint(m, d)
    with felt(link.passive):
        mujoco.mj_fwdVelocity(m, d)
    mujoco.mj_fwdActuation(m, d)
    inertia = np.zeros(m.nv)
    mujoco.mj_mulM(m, d, inertia, a)
    load = inertia + d.qfrc_bias - d.qfrc_passive - d.qfrc_actuator
    for joint, form in link.rubbing:
        dry = joint.dry(abs(float(form @ v))) + joint.load_friction(link.loads.get(joint.name, 0.0))
        load += slip[joint.name] * dry * form
    jacobian = d.efc_J.reshape(d.nefc, m.nv)
    push = jacobian.copy()
    rows, parting = np.ones(d.nefc, bool), np.zeros(d.nefc)
    for name, row in contact_rows(link).items():
        if link.rubs[name]:
            push[row] += along(link, name, slip) * jacobian[row + 1]
            rows[row + 1 : row + 3] = False
        if name in link.cones:  # its push apart is taken back for the slip that there is, not for how that grows
            parting[row] = -along(link, name, slip) * float(jacobian[row + 1] @ a)
    damping, impedance = d.efc_KBIP[:, 1], d.efc_KBIP[:, 2]
    # where velocity across the row can only be an error of v, which need not become one of q
    rigid = (impedance > 0.5) & (d.efc_type == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY))
    gained = jacobian @ a
    for name, row in contact_rows(link).items():
        if name in link.rims and link.rims[name].law.hard:
            gained[row] -= link.rims[name].bend()  # which a run follows
    older = link.setting.step / 2 if link.setting.stepped else 0.0  # s: a run's rows are damped by velocities of then
    goal = d.efc_aref + parting - gained + damping * (older * gained + np.where(rigid, d.efc_vel, 0.0))
    return StateEquations(load, push[rows], goal[rows], d.efc_R[rows].copy(), np.flatnonzero(rows))


def along(link: MujocoLinkage, name: str, slip: Mapping[str, float]) -> float:
    """Force of a contact's row of friction over that of its wall, where joints slip in these directions."""
    friction = link.frictions[name]
    return -friction.way * slip[friction.joint] * friction.coefficient


@dataclass(frozen=True)
class RestState:
    """A state without transients: coordinates (nq,), forces of all constraint rows (nefc,)."""

    q: np.ndarray
    force: np.ndarray


def rest(
    link: MujocoLinkage, q: np.ndarray, v: np.ndarray, a: np.ndarray, slip: Mapping[str, float]
) -> RestState | None:
    """Solve :func:`balance` for coordinates and forces, the motors held; None where Newton's method finds no solution.

    Forces are unknowns of their own: however stiff the rows, a step along the rim of a clearance circle does not
    spoil them, as it would if they were computed from the penetration.  The data is left at the solution.
    """
    q = q.copy()
    unknown = link.moved
    n = unknown.size
    reach = min((0.5 * link.mechanism.joint(name).clearance for name in (*link.contacts, *link.blocks)), default=np.inf)
    force = np.zeros(0)
    for _ in range(60):
        here = balance(link, q, v, a, slip)
        if not force.size:
            force = np.linalg.lstsq(here.push[:, unknown].T, here.load[unknown], rcond=None)[0]
        matrix = np.zeros((n + force.size, n + force.size))
        matrix[:n, n:], matrix[n:, n:] = -here.push[:, unknown].T, -np.diag(here.softness)
        for column, i in enumerate(unknown):
            beside = q.copy()
            beside[i] += DIFFERENCE_STEP
            there = balance(link, beside, v, a, slip)
            matrix[:n, column] = (there.load - here.load - (there.push - here.push).T @ force)[
                unknown
            ] / DIFFERENCE_STEP
            matrix[n:, column] = (there.goal - here.goal) / DIFFERENCE_STEP
        miss = np.concatenate([(here.load - here.push.T @ force)[unknown], here.goal - here.softness * force])
        try:
            move = np.linalg.solve(matrix, -miss)
        except np.linalg.LinAlgError:
            return None
        largest = float(np.abs(move[:n]).max(initial=0.0)) * link.size
        share = min(1.0, reach / largest) if largest else 1.0
        q[unknown] += share * move[:n]
        force = force + share * move[n:]
        if not np.all(np.isfinite(q)):
            return None
        if share == 1 and largest < LAST_NEWTON_STEP * link.size:
            here = balance(link, q, v, a, slip)
            every = np.zeros(link.data.nefc)
            every[here.rows] = force
            for name, row in contact_rows(link).items():
                if link.rubs[name]:
                    every[row + 1] = along(link, name, slip) * every[row]
            link.data.qacc[:], link.data.efc_force[:] = a, every
            mujoco.mj_rnePostConstraint(link.model, link.data)
            return RestState(q, every)
    return None


class MujocoEquilibria:
    """Equilibria of a request's mechanism, near the crank angle theta (rad) of a path, or its time (s) on courses.

    ``step`` (s) sets how rigid the rigid rows are.  ``forces`` are the sizes (N) of the ideal linkage's reactions at
    the joints with clearance, as last asked for.
    """

    def __init__(
        self,
        request: Request,
        path: Path,
        laws: Mapping[str, WallContact],
        theta: float,
        step: float,
    ) -> None:
        self.request, self.mechanism, self.path, self.laws = request, request.mechanism, path, laws
        pose = path.poses(theta)
        rows = "spring" if request.joint_model == "spring-damper" else request.joint_model
        setting = Setting(rows, step, hold=path.held, friction=False, driven=path.driven)
        self.ideal = MujocoLinkage(self.mechanism, {}, pose, replace(setting, rows="ideal"))
        self.pressed = MujocoLinkage(self.mechanism, laws, pose, setting) if laws else self.ideal
        self.forces: dict[str, float] = {}

    def place(self, link: MujocoLinkage, theta: float, gaps: Gaps = NO_GAPS) -> np.ndarray:
        """Coordinates (nq,) of an assembled linkage with these gaps (m) of pins, and blocks where they rest."""
        return link.placed(self.path.poses(theta, gaps))

    def slip(self, theta: float) -> dict[str, float]:
        """Sign of each joint's relative velocity, second body less first, as the drive turns the ideal linkage."""
        rubs = any(j.rubs or j.friction for j in self.mechanism.joints)
        around = self.path.around(theta) if rubs else None
        if around is None:
            return {j.name: 0.0 for j in self.mechanism.joints}
        link = self.ideal
        back, ahead = (link.placed(poses) for poses in around)
        moves = {j.name: float(link.between(j) @ (ahead - back)) for j in self.mechanism.joints}
        return {
            name: math.copysign(1.0, x) if abs(x) > SLIP_STANDSTILL * TURN_ASIDE else 0.0 for name, x in moves.items()
        }

    def torques(self, link: MujocoLinkage, state: RestState, slip: Mapping[str, float]) -> dict[str, float]:
        """Friction of the equilibrium that was found last (see :func:`sim_models.mujoco.state.friction_torques`)."""
        dry = {
            joint.name: joint.dry(float(form @ link.data.qvel)) + joint.load_friction(link.loads.get(joint.name, 0.0))
            for joint, form in link.rubbing
        }
        return {name: -size * slip[name] for name, size in dry.items()} | corner_friction(link, state.force)

    def signals(self, link: MujocoLinkage, state: RestState, slip: Mapping[str, float]) -> dict[str, float]:
        """All signals of the equilibrium that was found last."""
        return signals(link, joint_forces(link, state.force), self.torques(link, state, slip))

    def rest(
        self, link: MujocoLinkage, q: np.ndarray, v: np.ndarray, a: np.ndarray, slip: Mapping[str, float]
    ) -> RestState | None:
        """The state without transients, with the friction that its reactions give."""
        for _ in range(FRICTION_LOOKS):
            state = rest(link, q, v, a, slip)
            if state is None or not link.loads:
                return state
            friction = self.torques(link, state, slip)
            if heed(link, pressing(link, joint_forces(link, state.force), friction, slip)):
                return state
            q = state.q
        raise unheeded(link)

    def felt(self, theta: float, rate: float, spin_up: float) -> tuple[float, float]:
        """The torque (N.m) that a motor on a spring gives the ideal linkage in this motion (rad, rad/s, rad/s^2), and
        the inertia (kg.m^2) that it feels; by virtual work.
        """
        link, angles = self.ideal, theta + ANGLES_AROUND
        q = np.array([self.place(link, at) for at in angles])
        slope = derivative(ANGLES_AROUND)
        turn, bend = (slope @ q)[2], (slope @ slope @ q)[2]
        turn[link.motor] = bend[link.motor] = 0.0
        here = balance(link, q[2], turn * rate, bend * rate**2 + turn * spin_up, self.slip(theta))
        carried = np.zeros(turn.size)
        mujoco.mj_mulM(link.model, link.data, carried, turn)
        return float(turn @ here.load), float(turn @ carried)

    def reactions(self, theta: float, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> dict[str, complex]:
        """Reactions (N) of the ideal linkage at the joints with clearance, in this state of motion."""
        slip = self.slip(theta)
        state = self.rest(self.ideal, q, v, a, slip)
        if state is None:
            raise self.failed(Cause.NO_EQUILIBRIUM, "the ideal linkage is not in equilibrium", theta, "check its loads")
        return self.noted(self.signals(self.ideal, state, slip))

    def noted(self, row: Mapping[str, float]) -> dict[str, complex]:
        """Reactions (N) at the joints with clearance from the ideal linkage's signals; zero where there is no direction
        to them.
        """
        forces = {name: complex(row[f"reaction_{name}_x"], row[f"reaction_{name}_y"]) for name in self.laws}
        forces |= {name: self.push(name, row) for name in self.pressed.blocks}
        largest = max(
            math.hypot(row[f"reaction_{j.name}_x"], row[f"reaction_{j.name}_y"]) for j in self.mechanism.joints
        )
        forces = {name: force if abs(force) > NO_LOAD * largest else 0j for name, force in forces.items()}
        self.forces |= {name: abs(force) for name, force in forces.items()}
        return forces

    def push(self, name: str, row: Mapping[str, float], slip: float = 0.0) -> complex:
        """Force (N) on a block across its guide plus i times moment over half its length, from signals; without the
        moment of friction, where that has acted against a ``slip`` of this sign.
        """
        block, first = self.pressed.blocks[name], self.mechanism.joint(name).bodies[0]
        angle = 0.0 if first == GROUND else row[f"{first}_angle"]
        force = complex(row[f"reaction_{name}_x"], row[f"reaction_{name}_y"])
        across = 1j * block.joint.direction * complex(np.exp(1j * angle))
        pressed = (force * across.conjugate()).real
        rubbed = slip * block.joint.friction * block.guide.height / 2 * pressed
        return block.guide.push(pressed, row[f"reaction_{name}_moment"] + rubbed)

    def pressing(self, theta: float, forces: Mapping[str, complex]) -> dict[str, complex | structure.BlockRest]:
        """Where these reactions press each pin (m): on the rim, and as far beyond as its stiffness lets it; and where
        each block rests, whose corners there are pressed from now on.
        """
        for name, force in forces.items():
            if force == 0:
                inner = self.mechanism.joint(name).inner
                raise self.failed(Cause.UNPRESSED, f"nothing presses the {inner} of joint {name!r}", theta)
        check_stiff_enough("mujoco", self.request, theta, self.on_springs(forces))
        self.seat(forces)
        return {name: self.rim(name, force) for name, force in forces.items()}

    def seat(self, forces: Mapping[str, complex]) -> None:
        """Have each block rest on the corners at which these push it (N; see :meth:`push`)."""
        for name, block in self.pressed.blocks.items():
            block.pressed = block.guide.corners_at(forces[name])

    def on_springs(self, forces: Mapping[str, complex]) -> dict[str, float]:
        """Sizes (N) of the forces that press a pin into a bearing that gives."""
        giving = (
            () if self.request.joint_model == "massless-link" else (name for name in forces if not self.laws[name].hard)
        )
        return {name: abs(forces[name]) for name in giving}

    def rim(self, name: str, force: complex) -> complex | structure.BlockRest:
        """Gap (m) of a joint that carries this force (N); where a block rests that is pushed so."""
        give = self.on_springs({name: force}).get(name, 0.0) / self.laws[name].stiffness
        if name in self.pressed.blocks:
            return self.pressed.blocks[name].guide.rest(force, give / 2)
        return pressed_to(self.mechanism.joint(name).clearance, give, force)

    def at_rest(self, theta: float) -> dict[str, float]:
        """Signals of the equilibrium at one crank angle.  Raises SimulationError if there is none with the pins
        pressed.
        """
        gaps: dict[str, complex] = {}
        for _ in range(FACINGS):
            self.ideal.heading = self.pressed.heading = self.heading(theta, gaps)
            row, before = self._at_rest(theta), gaps
            gaps = seats(row, self.pressed.contacts)
            if faced(self.mechanism, before, gaps):
                break
        return row

    def heading(self, theta: float, gaps: Gaps) -> Poses:
        """The bodies in the motion that loads oppose at rest, with these gaps (m); nothing where none does."""
        if not any(load.opposes for load in self.mechanism.loads):
            return {}
        return self.path.moving(theta, math.copysign(1.0, self.mechanism.speed or 1.0), gaps)

    def _at_rest(self, theta: float) -> dict[str, float]:
        slip = self.slip(theta)
        still = np.zeros(self.ideal.model.nv)
        forces = self.reactions(theta, self.place(self.ideal, theta), still, still)
        for _ in range(BLOCK_TRIES):
            gaps = self.pressing(theta, forces)
            still = np.zeros(self.pressed.model.nv)
            state = self.rest(self.pressed, self.place(self.pressed, theta, gaps), still, still, slip)
            if state is None:
                soft = why_no_equilibrium("mujoco", self.request, theta, self.on_springs(forces))
                raise soft or self.failed(Cause.NO_EQUILIBRIUM, "no equilibrium was found", theta)
            pulled = [n for n, corners in pushes(self.pressed, state.force).items() if min(corners.values()) < 0]
            if not pulled:
                break
            row = self.signals(self.pressed, state, slip)
            forces |= {name: self.push(name, row, slip[name]) for name in pulled}  # it rests otherwise
        else:
            what = f"the only equilibria found have a corner of the block of joint {pulled[0]!r} pulled, not pressed"
            raise self.failed(Cause.PULLED, what, theta)
        for name, (force, _) in joint_forces(self.pressed, state.force).items():
            if name in self.pressed.contacts and not _pressed(force, gap(self.pressed, name)):
                what = f"the only equilibrium found has the pin of joint {name!r} pulled, not pressed"
                raise self.failed(Cause.PULLED, what, theta)
        return self.signals(self.pressed, state, slip)

    def steady(self, angles: np.ndarray, q: np.ndarray, rate: np.ndarray) -> np.ndarray | None:
        """Coordinates (angles, nq) of a motion without transients: equilibria beside each other give each other's
        rates.
        """
        slips = [self.slip(at) for at in angles]
        change = np.inf
        for _ in range(12):
            settled = [
                self.settled(at, v, a, slip) for at, v, a, slip in zip(q, rate @ q, rate @ rate @ q, slips, strict=True)
            ]
            ahead = np.array([one for one in settled if one is not None])
            if len(ahead) < len(settled):
                return None
            before, change = change, float(np.abs(ahead - q).max())
            if change > 0.3 * before:  # the series has given what it can: rates of rates are noise from here on
                return q
            q = ahead
            if change < 1e-10:
                break
        return q

    def settled(self, q: np.ndarray, v: np.ndarray, a: np.ndarray, slip: Mapping[str, float]) -> np.ndarray | None:
        """Coordinates of the equilibrium in this motion, None if there is none with all pins pressed."""
        state = self.rest(self.pressed, q, v, a, slip)
        if state is None:
            return None
        forces = joint_forces(self.pressed, state.force)
        pins = all(_pressed(forces[name][0], gap(self.pressed, name)) for name in self.pressed.contacts)
        walls = all(min(corners.values()) >= 0 for corners in pushes(self.pressed, state.force).values())
        return state.q if pins and walls else None

    def failed(self, cause: Cause, what: str, theta: float, remedy: str | tuple[str, ...] = "") -> SimulationError:
        """The error that says what went wrong at which crank angle."""
        return no_start("mujoco", self.request, cause, what, theta, remedy)


def _pressed(force: complex, gap: complex) -> bool:
    return (force * gap.conjugate()).real > 0

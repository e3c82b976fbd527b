"""What a MuJoCo linkage does at one instant: its contacts, the forces in its joints, its signals."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import mujoco
import numpy as np

from analytic.mechanism import GROUND, Joint
from sim_models.common.backlash import Flanks
from sim_models.common.rates import rate_columns
from sim_models.engine import Cause, SimulationError
from sim_models.mujoco.block import ease as ease_of_corner
from sim_models.mujoco.block import played, touch_walls
from sim_models.mujoco.model import LEAST_FRICTION, ROW, MujocoLinkage, TreeDrive, TreePart
from sim_models.mujoco.passive import felt, friction_rows
from sim_models.mujoco.striking import GRIP

SWAY = 1.0  # rad: how far a joint may go from where it starts, for the tangent of a spring that is not linear
UNKNOWN_SPEED = 10.0  # rad/s, of a linkage that nothing drives, for the slope of its drag
FRICTION_CHANGE = 1e-10  # of the largest reaction that friction grows with: what it may still change by
GLANCES = 1  # times that friction is found anew from the reactions that it changes, in every step that it matters to
FRICTION_LOOKS = 200  # the same where a state is looked at
SINGULAR_ROWS = 1e-9  # of the largest: a singular value of closing joints that says nothing
Applied = tuple[complex, complex]  # force on a joint's second body (N), and the point where it acts (m)


def touch(link: MujocoLinkage, always: bool = False) -> bool:
    """Add the contact of each journal that has left its gap (or of every journal), and of blocks' corners; says whether
    there is one.
    """
    link.touching = []
    for name, rim in link.rims.items():
        if rim.meets(always):
            rim.add()
            link.touching.append(name)
    if link.blocks:
        touch_walls(link, always)
    return bool(link.touching)


def advance(link: MujocoLinkage, count: int) -> None:
    """Take steps."""
    m, d = link.model, link.data
    heeding = link.growing and (link.description.compliant or link.contacts or link.blocks or not link.setting.hold)
    watch = link.watch
    with felt(link.passive):
        if not link.kept and not heeding:  # a rigidly driven ideal linkage moves as it does, whatever its friction
            mujoco.mj_step(m, d, nstep=count)
            return
        for _ in range(count):
            begin_step(link)
            if heeding:
                settle(link, GLANCES)
            if watch is not None:
                watch.begin()
            if link.setting.stepped:
                mujoco.mj_step2(m, d)
            else:
                mujoco.mj_RungeKutta(m, d, 4)
            if watch is not None:
                watch.end()


def begin_step(link: MujocoLinkage) -> None:
    """First half of a step, contacts included; whoever calls it sees to it that laws are :func:`felt`.

    MuJoCo's convex cone drives sliding surfaces apart at friction coefficient times slip; that is taken back here.
    """
    m, d = link.model, link.data
    mujoco.mj_step1(m, d)
    if link.striking:
        catch_up(link)
    if touch(link):
        mujoco.mj_makeConstraint(m, d)
        mujoco.mj_referenceConstraint(m, d)
        if link.passive is not None:
            link.passive.rub(d)
        if link.cones:
            for i, name in enumerate(link.touching):
                if name in link.cones:
                    row = d.contact[i].efc_address
                    d.efc_aref[row] -= link.frictions[name].coefficient * abs(d.efc_aref[row + 1])
        for i, name in enumerate(link.touching):
            if name in link.rims and link.rims[name].law.hard:
                link.rims[name].follow(d.contact[i].efc_address)
    if link.striking:
        strike(link)


def catch_up(link: MujocoLinkage) -> None:
    """Reckon the forces of curved paths with the velocities of this instant, not with those of half a step ago.

    Without it the run gains or loses energy in proportion to the step, as much as gentle impacts do.
    """
    m, d = link.model, link.data
    # the acceleration is that of the instant before, or of this one where it was looked at
    link.present = d.qvel + m.opt.timestep / 2 * d.qacc
    with present(link):
        mujoco.mj_comVel(m, d)
        mujoco.mj_rne(m, d, 0, d.qfrc_bias)


@contextmanager
def present(link: MujocoLinkage) -> Iterator[None]:
    """Within, the data has the velocities of this instant, where they are known."""
    if link.present is None:
        yield
        return
    trailing = link.data.qvel.copy()
    link.data.qvel[:] = link.present
    yield
    link.data.qvel[:] = trailing


def strike(link: MujocoLinkage) -> None:
    """Give the rows of walls whose law has a name the force of that."""
    m, d, rows = link.model, link.data, wall_rows(link)
    step = m.opt.timestep
    for name, pin in link.striking.items():
        pin.see(d.time, depth(link, name))
        row = rows.get(name)
        if row is None:
            continue
        force, soft = pin.push(-float(d.efc_vel[row]), step)
        beside = 0.0
        if link.rubs[name]:
            slip = float(d.efc_vel[row + 1])
            gain = float(d.efc_J.reshape(d.nefc, m.nv)[row + 1] @ d.qacc)
            beside, mu = pin.rub(force, soft, slip, gain, step)
            along = slice(row + 1, row + 3)
            d.efc_D[along], d.efc_R[along] = GRIP * pin.mass, 1 / (GRIP * pin.mass)
            d.efc_aref[along] = -slip / step, 0.0
            d.contact[link.touching.index(name)].mu = mu
        d.efc_D[row], d.efc_R[row], d.efc_aref[row] = soft, 1 / soft, force / soft + beside


def depth(link: MujocoLinkage, name: str) -> float:
    """How deep (m) a pin, or a block's corner, is in its wall; negative where it is off."""
    if name in link.rims:
        return link.rims[name].depth
    if name in link.tendon:
        return float(link.data.ten_length[link.tendon[name]]) - link.radii[name][0]
    return link.depth[name]


def wall_rows(link: MujocoLinkage) -> dict[str, int]:
    """First row of each wall that a pin is at, by its joint: contacts' rows are the last, in their order; those of
    limits come before.
    """
    d = link.data
    first = d.ne + d.nf
    if link.tendon:
        ids = d.efc_id[first : first + d.nl].tolist() if d.nl else ()
        return {name: first + ids.index(tendon) for name, tendon in link.tendon.items() if tendon in ids}
    rows, first = {}, first + d.nl
    for name in link.touching:
        rows[name] = first
        first += 3 if link.rubs[name] else 1
    return rows


def look(link: MujocoLinkage) -> None:
    """Evaluate forces and accelerations at the present state, without a step, until friction that grows with reactions
    is that of these.
    """
    for _ in range(2 if link.striking else 1):  # the first finds the acceleration that gives this instant's velocities
        with felt(link.passive):
            begin_step(link)
        if not settle(link, FRICTION_LOOKS):
            raise unheeded(link)


def settle(link: MujocoLinkage, times: int) -> bool:
    """Find forces and accelerations of a step that has begun, anew with the friction that its reactions give, up to so
    many ``times``; says whether it was that of the reactions in the end.
    """
    m, d = link.model, link.data
    mujoco.mj_fwdActuation(m, d)
    mujoco.mj_fwdAcceleration(m, d)
    for _ in range(times):
        mujoco.mj_fwdConstraint(m, d)
        with present(link):
            mujoco.mj_rnePostConstraint(m, d)
        if not link.growing:
            return True
        slip = {j.name: float(np.sign(d.ten_velocity[t])) for t, (j, _) in link.growing.items() if j.prismatic}
        friction = friction_torques(link) if slip else {}  # its moments press blocks only
        known = heed(link, pressing(link, joint_forces(link, d.efc_force), friction, slip))
        rub(link)
        if known:
            return True
    mujoco.mj_fwdConstraint(m, d)
    return False


def rub(link: MujocoLinkage) -> None:
    """Give dry friction the size that it has by the last loads: in this step's rows, and in the model for those to
    come.
    """
    rates, sizes, model = link.data.ten_velocity, link.data.efc_frictionloss, link.model.tendon_frictionloss
    for row, t in friction_rows(link.data):
        if t in link.growing:
            joint, growth = link.growing[t]
            size = joint.dry(float(rates[t])) + growth * link.loads[joint.name]
            sizes[row] = model[t] = max(size, LEAST_FRICTION)


def heed(link: MujocoLinkage, now: Mapping[str, float]) -> bool:
    """Take in how hard (N) the joints are pressed whose friction grows with their reactions; says whether that was
    known already.
    """
    change = max(abs(now[name] - load) for name, load in link.loads.items())
    link.loads.update(now)
    return change <= FRICTION_CHANGE * max(now.values())


def unheeded(link: MujocoLinkage) -> SimulationError:
    """What there is to say where those reactions do not settle."""
    return SimulationError(
        f"mujoco: {link.mechanism.name}: the friction that its reactions give does not settle: it is about to lock"
        " the linkage",
        Cause.NO_EQUILIBRIUM,
        f"use a smaller {' or '.join(joint.load_law for joint in link.mechanism.load_rubbed)}",
    )


def equality_rows(link: MujocoLinkage) -> dict[int, int]:
    """First row of each equality, by its number: they are the first, one after the other."""
    ids = link.data.efc_id[: link.data.ne].tolist()
    return {number: row for row, number in zip(reversed(range(len(ids))), reversed(ids), strict=True)}


def contact_rows(link: MujocoLinkage) -> dict[str, int]:
    """First row of each contact, by its joint."""
    rows = ((name, link.data.contact[i].efc_address) for i, name in enumerate(link.touching))
    return {name: row for name, row in rows if row >= 0}


def pushes(link: MujocoLinkage, force: np.ndarray) -> dict[str, dict[int, float]]:
    """Force (N) of the wall on each corner of each block that touches one, from the constraint rows' forces (nefc,)."""
    rows = contact_rows(link)
    return {
        name: {k: float(force[rows[key]]) for k in range(4) if (key := block.key(k)) in rows}
        for name, block in link.blocks.items()
    }


def gap(link: MujocoLinkage, name: str) -> complex:
    """First pin centre minus second (m)."""
    return pin(link, name, second=False) - pin(link, name)


def pin(link: MujocoLinkage, name: str, second: bool = True) -> complex:
    """Centre of a joint's pin on its second (or first) body (m)."""
    x, at = link.places, 3 * link.sites[name][second]
    return complex(x[at], x[at + 1])


def joint_forces(link: MujocoLinkage, force: np.ndarray) -> dict[str, Applied]:
    """Force of each closing joint on its second body, from the constraint rows' forces (nefc,)."""
    rows, force = equality_rows(link), force.tolist()
    applied: dict[str, Applied] = {}
    for j in (*link.description.closing, *link.description.soft):
        row = rows[link.row_id[j.name]]
        applied[j.name] = complex(force[row], force[row + 1]), pin(link, j.name)
    touched = wall_rows(link) if link.tendon else contact_rows(link)
    for name in link.contacts:
        g = gap(link, name)
        n = g / abs(g) if g else 0j
        f, at = 0j, pin(link, name)
        if link.setting.rows == "contact":
            if name in touched:
                row = touched[name]
                slide = force[row + 1] if link.mechanism.joint(name).friction else 0.0
                f, at = force[row] * n + slide * 1j * n, at + n * link.radii[name][1]
        elif link.setting.rows == "spring-damper":
            f = force[touched[name]] * n if name in touched else 0j
        else:
            f = -force[rows[link.row_id[name]]] * n
        applied[name] = f, at
    return applied


def friction_torques(link: MujocoLinkage) -> dict[str, float]:
    """Coulomb friction of each joint's law on its second body (N.m or N), from the present rows; and, by the names of
    :func:`corner_friction`, of blocks' corners.
    """
    rows = {t: row for row, t in friction_rows(link.data)}
    dry = {name: float(link.data.efc_force[rows[t]]) if t in rows else 0.0 for name, t in link.laws.items()}
    return dry | corner_friction(link, link.data.efc_force)


def corners(link: MujocoLinkage) -> Iterator[tuple[Joint, complex, complex]]:
    """Joint, force (N) on its second body, and where it acts (m), of each corner of a block that touches a wall."""
    rows = contact_rows(link) if link.blocks else {}
    for block in link.blocks.values():
        for k, contact in enumerate(block.contacts):
            if (row := rows.get(block.key(k))) is not None:
                push = link.data.efc_force[row : row + contact.dim].tolist()
                out, at = (complex(*each[:2].tolist()) for each in (contact.frame, contact.pos))
                yield block.joint, -complex(push[0], push[1] if block.joint.rough else 0.0) * out, at


def corner_friction(link: MujocoLinkage, force: np.ndarray) -> dict[str, float]:
    """Friction (N) along its guide on the second body of all corners of each block whose contact has some, named after
    its first, from the constraint rows' forces (nefc,).
    """
    rough = [block for block in link.blocks.values() if block.joint.rough]
    rows = contact_rows(link) if rough else {}
    return {
        block.key(0): sum(
            side * float(force[rows[key] + 1])
            for k, side in enumerate(block.guide.sides)
            if (key := block.key(k)) in rows
        )
        for block in rough
    }


def law_torque(link: MujocoLinkage, name: str, friction: Mapping[str, float]) -> float:
    """Spring, damper and friction of a joint on its second body (N.m or N)."""
    j = link.mechanism.joint(name)
    if name not in link.laws:  # nothing, or a spring that slides keep from turning
        return 0.0 if j.prismatic else float(j.give(link.fixed_angle[j.bodies[1]] - link.fixed_angle[j.bodies[0]], 0.0))
    m, d, t = link.model, link.data, link.laws[name]
    stretch = float(d.ten_length[t] - m.tendon_lengthspring[t, 0])
    return friction.get(name, 0.0) + float(j.give(stretch + j.rest_angle, float(d.ten_velocity[t])))


def _cross(a: complex, b: complex) -> float:
    return (a.conjugate() * b).imag


def applied(link: MujocoLinkage) -> Iterator[tuple[str, complex, float]]:
    """Body, force on it (N) and moment about the ground's origin (N.m) of loads, and of what turns the crank over its
    angle.
    """
    m, x = link.mechanism, link.data.site_xpos
    for number, (load, acting) in zip(link.load_sites, link.loaded, strict=True):
        force, torque = acting()
        yield load.body, complex(force), float(torque) + _cross(complex(*x[number, :2].tolist()), complex(force))
    if m.periodic_torque is not None:
        yield m.driven, 0j, m.periodic_torque.at(link.angle(m.driven))


def effort(
    link: MujocoLinkage, drive: TreeDrive, force: complex, beyond: float, friction: Mapping[str, float]
) -> float:
    """What a motor gives its joint's second body: of the ``force`` (N) that the outer body has of the joint what is
    along a slide, less its law and what rubs a block's corners; in a pin the torque (N.m) ``beyond`` joint and law.
    """
    if not drive.joint.prismatic:
        return drive.sign * beyond
    first = drive.joint.bodies[0]
    angle = link.angle(first)
    axis = drive.joint.direction * np.exp(1j * angle)
    along = float((np.conj(axis) * drive.sign * force).real)
    block = link.blocks.get(drive.joint.name)
    rubbed = 0.0 if block is None else friction.get(block.key(0), 0.0)
    return along - rubbed - law_torque(link, drive.joint.name, friction)


@dataclass(frozen=True)
class Carried:
    """What a body has of its parent in the tree: ``force`` (N) and ``moment`` (N.m, about the ground's origin)."""

    part: TreePart
    force: complex
    moment: float

    def about_pin(self, link: MujocoLinkage) -> float:
        """The moment (N.m) about its joint's pin on the second body."""
        return self.moment - _cross(pin(link, self.part.joint), self.force)


def carried(link: MujocoLinkage, forces: Mapping[str, Applied], friction: Mapping[str, float]) -> Iterator[Carried]:
    """The bodies one by one, tips first: MuJoCo's balance of its accelerations, gravity, contacts and closing joints,
    less what acts through tendons and actuators, of which it knows no force on a body.
    """
    d = link.data
    push_on, turn_on = dict.fromkeys((GROUND, *link.body_id), 0j), dict.fromkeys((GROUND, *link.body_id), 0.0)

    def act(body: str, force: complex, moment: float) -> None:  # about the ground's origin
        push_on[body] += force
        turn_on[body] += moment

    for given in applied(link):
        act(*given)
    for joint, force, at in corners(link):  # which are what the joint is, and no load on what it joins
        act(joint.bodies[0], force, _cross(at, force))
        act(joint.bodies[1], -force, -_cross(at, force))
    for name in forces:
        first, second = link.mechanism.joint(name).bodies
        moment = law_torque(link, name, friction)
        act(second, 0j, moment)
        act(first, 0j, -moment)
    balance, centre, root = d.cfrc_int.tolist(), d.subtree_com.tolist(), link.model.body_rootid
    for part in link.outward:
        _, _, turn, x, y, _ = balance[part.number]
        force = complex(x, y) - push_on[part.name]
        moment = turn + _cross(complex(*centre[root[part.number]][:2]), complex(x, y)) - turn_on[part.name]
        act(part.parent, push_on[part.name], turn_on[part.name])
        yield Carried(part, force, moment)


def pressing(
    link: MujocoLinkage, forces: Mapping[str, Applied], friction: Mapping[str, float], slip: Mapping[str, float]
) -> dict[str, float]:
    """How hard (N) the joints are pressed whose friction grows with their reactions; ``slip`` has the signs of their
    slip.
    """
    reactions = {name: (force, 0.0) for name, (force, _) in forces.items()}
    if not link.loads.keys() <= reactions.keys():
        for body in carried(link, forces, friction):
            part = body.part
            if part.joint in link.loads:
                turned = part.sign * body.about_pin(link) if part.slides else 0.0
                reactions[part.joint] = part.sign * body.force, turned
    out: dict[str, float] = {}
    for name in link.loads:
        (force, moment), joint = reactions[name], link.mechanism.joint(name)
        angle = link.angle(joint.bodies[0]) if joint.prismatic else 0.0
        out[name] = float(joint.pressed(force, moment, angle, slip.get(name, 0.0)))
    return out


def signals(
    link: MujocoLinkage,
    forces: Mapping[str, Applied],
    friction: Mapping[str, float],
    velocity: np.ndarray | None = None,
) -> dict[str, float]:
    """All signals of the present state, and its rates; accelerations are those that :func:`look` left in the data, or
    an equilibrium.  What turns the crank beside its reaction is the drive.
    """
    m, d = link.model, link.data
    velocity = d.qvel if velocity is None else velocity
    site = d.site_xpos[:, :2].tolist()
    out = dict.fromkeys(link.efforts, 0.0)
    for name, (force, _) in forces.items():
        out[f"reaction_{name}_x"], out[f"reaction_{name}_y"] = force.real, force.imag
    carry, motion, gravity = np.zeros((3, m.nv)), np.zeros(6), complex(*link.mechanism.gravity)
    for body in carried(link, forces, friction):
        part, force = body.part, body.force
        name, joint = part.name, part.joint
        out[f"{name}_x"], out[f"{name}_y"] = site[part.marker]
        out[f"{name}_angle"], out[f"{name}_angular_velocity"] = link.angle(name), float(part.form @ velocity)
        mujoco.mj_jacBodyCom(m, d, carry, None, part.number)
        speed = carry[:2] @ velocity
        mujoco.mj_objectAcceleration(m, d, mujoco.mjtObj.mjOBJ_BODY, part.number, motion, 0)  # less gravity's
        _, _, spin, x, y, _ = motion.tolist()
        out |= rate_columns(name, complex(speed[0], speed[1]), complex(x, y) + gravity, spin)
        beyond = body.moment  # of what joint forces and laws give the body
        if joint:
            out[f"reaction_{joint}_x"], out[f"reaction_{joint}_y"] = part.sign * force.real, part.sign * force.imag
            at_pin = body.about_pin(link)
            if part.slides:
                out[f"reaction_{joint}_moment"] = part.sign * at_pin
            beyond = at_pin - part.sign * law_torque(link, joint, friction)
        if part.drive is not None:
            out[part.drive.signal] = effort(link, part.drive, force, beyond, friction)
    for name in link.pins:
        g = gap(link, name) if name in link.contacts or name in link.soft else 0j
        out[f"clearance_{name}_x"], out[f"clearance_{name}_y"] = g.real, g.imag
    return out | played(link)


def on_track(link: MujocoLinkage) -> None:
    """Remove from the data's velocity what would tear rigid rows apart; the motors' speeds stay."""
    m, d = link.model, link.data
    mujoco.mj_fwdPosition(m, d)
    rigid = rigid_rows(link)
    jacobian = d.efc_J.reshape(d.nefc, m.nv)[rigid]
    if rigid.any():
        d.qvel[link.moved] -= np.linalg.lstsq(jacobian[:, link.moved], jacobian @ d.qvel, rcond=None)[0]


def rigid_rows(link: MujocoLinkage) -> np.ndarray:
    """Which rows (nefc,) of the data close rigid joints, or hold motors."""
    d, soft = link.data, [link.row_id[name] for name in link.soft]
    return (d.efc_type == int(ROW.mjCNSTR_EQUALITY)) & ~np.isin(d.efc_id, soft)


def lean(link: MujocoLinkage) -> None:
    """Open rigid rows of a state :func:`on_track` by so little that their springs take back what their dampers make of
    velocities half a step older than the positions, as a run has them.  An equilibrium has done so already.
    """
    m, d = link.model, link.data
    mujoco.mj_fwdPosition(m, d)
    with felt(link.passive):
        mujoco.mj_fwdVelocity(m, d)
    rigid = rigid_rows(link)
    if not rigid.any():
        return
    stiffness, damping, impedance = d.efc_KBIP[rigid, :3].T
    older = damping * link.setting.step / 2
    wanted = older * d.efc_aref[rigid] / (stiffness * impedance)
    jacobian = d.efc_J.reshape(d.nefc, m.nv)[rigid][:, link.moved]
    d.qpos[link.moved] += np.linalg.lstsq(jacobian, wanted, rcond=None)[0]


def mobility(link: MujocoLinkage, q: np.ndarray, name: str) -> float:
    """Largest acceleration (1/kg) of a joint's gap, or of a block's corner, by a unit force in it."""
    link.data.qpos[:] = q
    mujoco.mj_fwdPosition(link.model, link.data)
    if name in link.blocks:
        return ease_of_corner(link, link.blocks[name])
    return ease(link, link.sites[name])


def ease(link: MujocoLinkage, sites: Sequence[int]) -> float:
    """Largest acceleration (1/kg) of two sites against each other by a unit force between them, as bodies now are."""
    m, d = link.model, link.data
    first, second = np.zeros((3, m.nv)), np.zeros((3, m.nv))
    for jacobian, site in zip((first, second), sites, strict=True):
        mujoco.mj_jacSite(m, d, jacobian, None, site)
    across = (first - second)[:2]
    eased = np.zeros_like(across)
    mujoco.mj_solveM(m, d, eased, across)
    return float(np.linalg.eigvalsh(across @ eased.T).max())


def stiffest_law(link: MujocoLinkage, q: np.ndarray, flanks: Flanks | None = None) -> float:
    """Highest rate (1/s) of a joint's spring or damper, of one between points, or of the drive's spring unless it
    stands for rigid flanks.
    """
    m, d = link.model, link.data
    d.qpos[:] = q
    mujoco.mj_fwdPosition(m, d)
    springs = [(link.mechanism.joint(n), link.between(link.mechanism.joint(n))) for n in link.laws]
    speed = abs(link.mechanism.speed or UNKNOWN_SPEED)
    laws = []
    for j, form in springs:
        stretch = float(form @ q - m.tendon_lengthspring[link.laws[j.name], 0])
        stiffness = j.stiffness + 3 * abs(j.cubic) * (abs(stretch) + SWAY * (link.size if j.prismatic else 1.0)) ** 2
        falling = (j.stiction - j.coulomb) / j.stribeck_speed if j.stribeck_speed else 0.0
        damping = j.damping + 2 * j.drag * speed * (link.size if j.prismatic else 1.0) + falling
        stiffness, damping = stiffness + j.stiffest(), sum((stop.damping for stop in j.stops), damping)
        laws.append((stiffness, damping, form))
    if link.description.compliant and not (flanks and flanks.rigid):
        laws.append((link.description.stiffness, 0.0, link.form[link.mechanism.driven]))
    rates = [0.0]
    for stiffness, damping, form in laws:
        eased = np.zeros((1, m.nv))
        mujoco.mj_solveM(m, d, eased, form[None])
        own = float(form @ eased[0])
        rates += [math.sqrt(stiffness * own), damping * own]
    for spring, _, sites in link.springs:
        own = ease(link, sites)
        rates += [math.sqrt(spring.stiffness * own), spring.damping * own]
    return max(rates)


def apart(link: MujocoLinkage) -> float:
    """Largest distance (m) by which the pins of rigid closing joints, or the ends of massless links, miss each
    other.
    """
    misses = [abs(gap(link, j.name)) for j in link.description.closing]
    if link.setting.rows == "massless-link":
        misses += [abs(abs(gap(link, n)) - link.radii[n][0]) for n in link.contacts]
    return max(misses, default=0.0)


def misclosure(link: MujocoLinkage) -> float:
    """Largest angle (rad) by which a body would have to turn, the motors held, for the pins of rigid closing joints to
    meet.
    """
    if not link.description.closing:
        return 0.0
    m, d, rows = link.model, link.data, equality_rows(link)
    closed = [rows[link.row_id[j.name]] + k for j in link.description.closing for k in (0, 1)]
    turn = np.zeros(m.nv)
    turn[link.moved] = np.linalg.lstsq(
        d.efc_J.reshape(d.nefc, m.nv)[closed][:, link.moved], d.efc_pos[closed], rcond=SINGULAR_ROWS
    )[0]
    return max(abs(float(form @ turn)) for form in link.form.values())


def check_warnings(link: MujocoLinkage, where: str) -> None:
    """Raise SimulationError for anything that MuJoCo only warns of, and for a state that is not a number."""
    d = link.data
    if not d.warning.number.any() and math.isfinite(float(d.qpos.sum()) + float(d.qvel.sum())):
        return
    raised = [mujoco.mjtWarning(i).name.removeprefix("mjWARN_") for i in range(len(d.warning)) if d.warning[i].number]
    raise SimulationError(f"mujoco: {where}: the run diverged ({', '.join(raised) or 'not a number'})", Cause.DIVERGED)

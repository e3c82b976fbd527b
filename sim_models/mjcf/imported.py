"""A mechanism from somebody's MJCF file, and what there is to say of it."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.structure import StructureError, structure
from analytic.mechanism import Mechanism, MechanismError
from sim_models.common.export_files import BEYOND
from sim_models.mjcf.compiled import AT_JOINT
from sim_models.mjcf.coordinates import Relation, relations
from sim_models.mjcf.drive import (
    ASSUMED,
    ASSUMED_SLIDE,
    ModelMotor,
    Push,
    flywheel,
    gravity,
    left_out,
    motors,
    push,
    switched_off,
    throttled,
)
from sim_models.mjcf.errors import MjcfError
from sim_models.mjcf.known import unknown
from sim_models.mjcf.laws import PointSpring, TendonLaw, acts, coefficients, law, point_spring
from sim_models.mjcf.parts import Frames, PlanarPin
from sim_models.mjcf.planar import Planar, read
from sim_models.mjcf.plane import actuator_words, body_words, joint_words
from sim_models.mujoco.engine import no_log_file

LENGTH_DIGITS = 15  # of a length, over the linkage's size: what rounding leaves of one
OFF = mujoco.mjtDisableBit
DISABLED = {  # for the whole model, by bits of option.flag
    "stiffness": int(OFF.mjDSBL_SPRING),
    "damping": int(OFF.mjDSBL_DAMPER),
    "friction_torque": int(OFF.mjDSBL_FRICTIONLOSS) | int(OFF.mjDSBL_CONSTRAINT),
}
NEAREST_POINT = 1e-9  # of the same: a point that is nearer to another is that one


@dataclass(frozen=True)
class ImportedFile:
    """A mechanism read from a file, and in ``notes`` what of the file it leaves out, takes on or assumes."""

    mechanism: Mechanism
    notes: tuple[str, ...]
    relations: tuple[Relation, ...] = ()  # of its signals to the file's coordinates, actuators and sensors


def imported(path: str | Path) -> ImportedFile:
    """The mechanism of an MJCF file.  Raises MjcfError with file, place, value and remedy in one sentence."""
    with no_log_file():
        return of_planar(read(Path(path)))


def of_planar(planar: Planar) -> ImportedFile:
    """The mechanism of a file that is read already.  Raises MjcfError."""
    return _Writer(planar).imported()


class _Writer:
    def __init__(self, planar: Planar) -> None:
        self.p, self.m = planar, planar.model
        self.frames: Frames = planar.at(planar.pose)
        self.notes = [f"the plane has {planar.plane}", *planar.notes]
        self.digits = LENGTH_DIGITS - math.ceil(math.log10(planar.size))
        self.tendons: list[TendonLaw] = []
        self.springs: list[PointSpring] = []
        self.points: list[dict[str, tuple[float, float]]] = [{} for _ in planar.links]

    def imported(self) -> ImportedFile:
        p = self.p
        self.refuse()
        for pin in p.pins:
            for link, point in zip(pin.links, pin.points, strict=True):
                self.points[link][pin.name] = self.xy(point)
        try:
            driving, free = self._driving()
            beyond = self._beyond()
            loads = self._loads(driving) + beyond.get("load", [])
            acting = {"spring": self._springs(), "load": loads, "stop": beyond.get("stop", [])}
            self.notes += [] if loads else ["it has no loads"]
            self.marked()
            linkage = self._linkage()
            for body, angle in beyond.get("assembly", {}).items():  # in whose turns loads and stops count
                if body in linkage["assembly"]:
                    turns = round((angle - linkage["assembly"][body]) / math.tau)
                    linkage["assembly"][body] += math.tau * turns
            fields = linkage | {"drive": self._drives(driving, free), **{k: v for k, v in acting.items() if v}}
            mechanism = Mechanism.model_validate(fields)
            Assembly(mechanism)
        except MjcfError:
            raise
        except ValueError as error:
            if isinstance(error, StructureError | AssemblyError | MechanismError):
                raise MjcfError(f"{p.said}: {error}") from None
            raise MjcfError(f"{p.said}: {_reason(error)}") from None
        self.notes += [*left_out(p), *unknown(self.m)]
        self.notes.append("not in MJCF, and left out: sections, moduli of elasticity, clearances")
        return ImportedFile(mechanism, tuple(self.notes), relations(mechanism, p))

    # ------------------------------------------------------------------ parts

    def _linkage(self) -> dict[str, Any]:
        """Bodies and joints, as the mechanism file says them."""
        p = self.p
        return {
            "name": p.name,
            "gravity": _vector(p.plane.flat(gravity(self.m))),
            "ground": {"points": self.points[0]},
            "body": [self._body(k) for k in range(1, len(p.links))],
            "joint": [self._joint(pin) for pin in p.pins],
            "assembly": {
                link.name: _tidy(angle)
                for link, angle in zip(p.links[1:], self.frames.angles[1:], strict=True)
            },
        }  # fmt: skip

    def xy(self, z: complex) -> tuple[float, float]:
        """A point (m), without what rounding has left of it."""
        return round(z.real, self.digits) + 0.0, round(z.imag, self.digits) + 0.0

    def _body(self, k: int) -> dict[str, Any]:
        link = self.p.links[k]
        inertia = link.inertia
        for pin in self.p.pins:
            if pin.joint >= 0 and set(pin.links) == {0, k}:
                inertia += self.rotor(pin)
        return {
            "name": link.name,
            "points": self.points[k],
            "mass": link.mass,
            "com": self.xy(link.centre),
            "inertia": inertia,
        }

    def rotor(self, pin: PlanarPin) -> float:
        """What the armature of a hinge on the ground adds to a link's inertia (kg.m^2); a motor's adds nothing."""
        armature = float(self.m.dof_armature[self.m.jnt_dofadr[pin.joint]])
        if not armature or pin.slides or flywheel(self.p, pin):
            return 0.0
        self.notes.append(
            f"the armature of {joint_words(self.m, pin.joint)}, {armature:g} kg.m^2, is part of the link's inertia"
        )
        return armature

    def _joint(self, pin: PlanarPin) -> dict[str, Any]:
        fields: dict[str, Any] = {
            "name": pin.name,
            "type": "prismatic" if pin.slides else "revolute",
            "bodies": tuple(self.p.links[k].name for k in pin.links),
        }
        if pin.slides:
            fields |= {"axis": (_tidy(pin.axis.real), _tidy(pin.axis.imag)), "angle": _tidy(pin.angle)}
            q, travel = float(self.p.pose[self.m.jnt_qposadr[pin.joint]]), self.p.relative(pin, self.frames)
            if abs(q - travel) > NEAREST_POINT * self.p.size:
                self.notes.append(
                    f"the travel of {joint_words(self.m, pin.joint)} is {_tidy(travel):g} m in the initial pose, where"
                    f" its coordinate in the file is {q:g} m"
                )
        laws = ([self.laws(pin)] if pin.joint >= 0 else []) + [
            self.tendon(one) for one in self.tendons if one.pin is pin
        ]
        return fields | self.together(pin, [each for each in laws if each])

    def together(self, pin: PlanarPin, laws: list[dict[str, float]]) -> dict[str, float]:
        """The laws of a joint as one.  Raises MjcfError for two springs with different rests."""
        if len({each["rest_angle"] for each in laws if "rest_angle" in each}) > 1:
            raise MjcfError(f"{self.p.said}: joint {pin.name!r} has two springs that rest apart; give it one")
        law: dict[str, float] = {}
        for each in laws:
            for name, value in each.items():
                law[name] = value if name == "rest_angle" else law.get(name, 0.0) + value
        return law

    def tendon(self, one: TendonLaw) -> dict[str, float]:
        """Damping, friction and spring that a tendon gives a joint."""
        m, t, scale = self.m, one.tendon, one.scale
        law = {
            "damping": float(m.tendon_damping[t]) * scale**2,
            "friction_torque": float(m.tendon_frictionloss[t]) * abs(scale),
            "stiffness": float(m.tendon_stiffness[t]) * scale**2,
        }
        if law["stiffness"]:
            form = coefficients(m, t)
            assert form is not None
            stretch = float(m.tendon_lengthspring[t, 0] - form @ self.p.pose)
            law["rest_angle"] = _tidy(self.p.relative(one.pin, self.frames) + stretch / scale)
        return self.acting(law)

    def acting(self, law: dict[str, float]) -> dict[str, float]:
        """The laws that act, of a joint's: there, and not disabled for the whole model."""
        off = {name for name, bits in DISABLED.items() if self.m.opt.disableflags & bits}
        some = {name: value for name, value in law.items() if value and name not in off}
        return some | ({"rest_angle": law.get("rest_angle", 0.0)} if "stiffness" in some else {})

    def laws(self, pin: PlanarPin) -> dict[str, float]:
        """Damping, friction and spring of a tree's joint."""
        m, dof = self.m, int(self.m.jnt_dofadr[pin.joint])
        words = joint_words(m, pin.joint)
        if m.dof_armature[dof] and (pin.slides or 0 not in pin.links) and not flywheel(self.p, pin):
            self.notes.append(f"the armature of {words}, {m.dof_armature[dof]:g}: left out, though it takes part")
        stiffness = float(m.jnt_stiffness[pin.joint])
        law = {"damping": float(m.dof_damping[dof]), "friction_torque": float(m.dof_frictionloss[dof])}
        if stiffness:
            at = int(m.jnt_qposadr[pin.joint])
            stretch = float(m.qpos_spring[at] - self.p.pose[at])
            sign = 1.0 if pin.slides else pin.turn
            rest = self.p.relative(pin, self.frames) + sign * stretch
            law |= {"stiffness": stiffness, "rest_angle": _tidy(rest)}
        return self.acting(law)

    def _driving(self) -> tuple[list[ModelMotor], list[str]]:
        """The motors that drive it, of several as many as it has freedoms, and the joints that then move freely: those
        nearest to the ground.
        """
        drives, said = motors(self.p), list(self.notes)
        linkage = self._linkage()
        self.notes = said
        freedoms = len(structure(Mechanism.model_validate(linkage)).inputs)
        drives = drives[: max(freedoms, 1)]
        if len(drives) >= freedoms or not self.p.whole:
            return drives, []
        held = [{"joint": one.pin.name, "speed": "free"} for one in drives]
        free = structure(Mechanism.model_validate(linkage | {"drive": held})).free_joints
        return drives, [name for name in free if name not in {one.pin.name for one in drives}]

    def _drives(self, driving: Sequence[ModelMotor], free: Sequence[str]) -> list[dict[str, Any]]:
        """The drives, free ones where nothing drives; what is assumed of them is noted."""
        if free and driving:
            self.notes.append(
                f"no motor moves {', '.join(free)}: what swings there is left free (drive.speed = 'free'); if nothing"
                " is to, the file lacks a motor or what closes a loop"
            )
        elif free:
            self.notes.append("nothing drives it: it is released at its initial pose (drive.speed = 'free')")
        for one in driving:
            if one.speed is None:
                assumed = f"{ASSUMED_SLIDE:g} m/s" if one.pin.slides else f"{ASSUMED:g} rad/s"
                which = f" in joint {one.pin.name}" * (len(driving) > 1)
                self.notes.append(
                    f"how fast its motor{which} {'moves' if one.pin.slides else 'turns'} is not in the file (a keyframe"
                    f" would say it): drive.speed = {assumed} is assumed, correct it"
                )
        moved = [{"joint": one.pin.name, "speed": _speed(one)} for one in driving]
        return moved + [{"joint": name, "speed": "free"} for name in free]

    def _loads(self, driving: Sequence[ModelMotor]) -> list[dict[str, Any]]:
        """Constant forces by actuators; every other actuator is noted.  Raises MjcfError for a force that a joint may
        take part of.
        """
        m, own = self.m, {one.pin.joint for one in driving}
        loads = []
        for i in range(m.nactuator):
            words = actuator_words(m, i)
            steady = push(self.p, i)
            if steady is not None:
                taking = throttled(m, i)
                if taking is not None:
                    raise MjcfError(
                        f"{self.p.said}: the actuatorfrcrange of {joint_words(m, taking)} limits what {words} gives, a"
                        " constant force on a link, for which a mechanism file has no word; take one of them out"
                    )
                loads.append(self._load(steady))
            elif switched_off(m, i):
                self.notes.append(
                    f"{words} is switched off (option.actuatorgroupdisable, or its flag actuation), and gives no force"
                )
            elif m.actuator_trntype[i] in AT_JOINT and int(m.actuator_trnid[i, 0]) in own:
                self.notes.append(
                    f"{words} is the drive's; how it follows its command, and what it can give at most, are left out"
                )
            else:
                self.notes.append(
                    f"{words} is neither the drive's nor a constant force on a site; its force is left out, and in a"
                    " run of the file it acts with control 0"
                )
        return loads

    def _beyond(self) -> dict[str, Any]:
        """What an export of this project says beside MJCF: loads that vary and stops, as a mechanism file has them."""
        text = mujoco.mj_name2id(self.m, mujoco.mjtObj.mjOBJ_TEXT, BEYOND)
        if text < 0:
            return {}
        begin = int(self.m.text_adr[text])
        try:
            said = json.loads(bytes(self.m.text_data[begin : begin + int(self.m.text_size[text]) - 1]))
            parts = {name: list(said.get(name, [])) for name in ("load", "stop")} | {"assembly": dict(said["assembly"])}
        except (ValueError, TypeError, AttributeError, KeyError) as error:
            raise MjcfError(
                f"{self.p.said}: its text {BEYOND!r} is not as an export writes it ({error}); leave it out"
            ) from None
        has = [words for name, words in (("load", "loads that vary"), ("stop", "stops")) if parts[name]]
        self.notes.append(f"its text {BEYOND!r} has {' and '.join(has)}, which a run of the file alone has not")
        return parts

    def _load(self, steady: Push) -> dict[str, Any]:
        """A load, at the point where it acts: the com, a joint, or a point that is named after the site."""
        point = self.point_at(steady.link, steady.point, f"load{steady.actuator}")
        load: dict[str, Any] = {"body": self.p.links[steady.link].name, "point": point}
        if steady.force:
            load["force"] = _vector(steady.force)
        if steady.torque:
            load["torque"] = _tidy(steady.torque)
        return load

    def point_at(self, link: int, place: complex, new: str) -> str:
        """The name of a link's point at a place (m): com, one that it has, or a ``new`` one, which it is given."""
        names, near = self.points[link], NEAREST_POINT * self.p.size
        if link and abs(place - self.p.links[link].centre) <= near:
            return "com"
        name = next((name for name, at in names.items() if abs(complex(*at) - place) <= near), new)
        if name == new:
            names[new] = self.xy(place)
        return name

    def _springs(self) -> list[dict[str, Any]]:
        """Springs between points, those that act."""
        m, springs = self.m, []
        for one in self.springs:
            t = one.tendon
            law = self.acting({"stiffness": float(m.tendon_stiffness[t]), "damping": float(m.tendon_damping[t])})
            if not law:
                continue
            points = tuple(self.point_at(site.link, site.point, f"spring{t}") for site in one.sites)
            bodies = tuple(self.p.links[site.link].name for site in one.sites)
            length = float(m.tendon_lengthspring[t, 0]) if "stiffness" in law else 0.0
            law = {"stiffness": law.get("stiffness", 0.0), "damping": law.get("damping", 0.0), "length": length}
            springs.append({"bodies": bodies, "points": points, **law})
        return springs

    def marked(self) -> None:
        """Add the sites ``name:link`` of a link that lie in no joint to its points."""
        for site in self.p.sites:
            name, _, of = site.name.partition(":")
            link = self.p.links[site.link]
            if of == link.name and name.isidentifier() and name not in self.points[site.link]:
                self.points[site.link][name] = self.xy(site.point)

    # ------------------------------------------------------------------ what is refused

    def refuse(self) -> None:
        """Raise MjcfError for what acts on the links and a mechanism has no word for."""
        m, said = self.m, self.p.said
        for t in range(m.ntendon):
            tendon, spring = law(self.p, t), point_spring(self.p, t)
            if tendon is not None:
                self.tendons.append(tendon)
            elif spring is not None:
                self.springs.append(spring)
            elif acts(m, t):
                raise MjcfError(
                    f"{said}: tendon {m.tendon(t).name!r} has a spring, a damper, friction, inertia or a limit, and is"
                    " no law of a joint, nor a spring between two points of the plane; take these out"
                )
        down = self.p.plane.flat(gravity(m))
        for b in np.flatnonzero(m.body_gravcomp).tolist():
            if down:
                raise MjcfError(
                    f"{said}: {body_words(m, b)} has gravcomp = {m.body_gravcomp[b]:g}, for which a mechanism file has"
                    " no word; take it out"
                )


def _speed(driving: ModelMotor) -> float:
    """How fast a motor moves (rad/s, m/s), as its file says, or as is assumed."""
    if driving.speed is not None:
        return driving.speed
    return ASSUMED_SLIDE if driving.pin.slides else ASSUMED


def _tidy(value: float) -> float:
    """A number without the minus of a zero, and without what rounding has left of a zero."""
    return 0.0 if abs(value) < 1e-15 else float(value)


def _vector(z: complex) -> tuple[float, float]:
    return _tidy(z.real), _tidy(z.imag)


def _reason(error: ValueError) -> str:
    """What pydantic says, in one sentence."""
    from pydantic import ValidationError

    if isinstance(error, ValidationError):
        return "; ".join(fault["msg"].removeprefix("Value error, ") for fault in error.errors())
    return str(error)

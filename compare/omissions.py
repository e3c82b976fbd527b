"""Fields of a mechanism file that commands leave out, and why: one table, told in every result and in the docs.

A field that does nothing where it stands is told wherever it is; so is one that this question has no use for.
Drives are told of where they are looked at (:func:`compare.arguments.rigidly_and_evenly_driven`).
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

from analytic.mechanism import Body, Drive, Joint, Load, Mechanism, Spring
from analytic.mechanism.one_line import enumerated
from analytic.mechanism.parts import MechanismPart
from sim_models.engine import JOINT_MODELS, TOUCHING, JointModel, Motion, SettingValue

Command = Literal["analyse", "accuracy", "compare", "simulate", "check", "validity", "export", "diagnose", "plan"]
AT_SPEED = ("contact_damping", "restitution", "contact_law")
AT_STATIC = "dry friction at rest is static_torque"
CONTACT_FIELDS = tuple(f"joint.{field}" for field in ("contact_stiffness", *AT_SPEED))


@dataclass(frozen=True)
class Asked:
    """What is asked: by a command, in a motion, of engines with these joint models; whether links bend in it; which
    joints a map gives its clearances.
    """

    command: Command
    motion: Motion = "driven"
    joint_models: tuple[JointModel, ...] = ()
    bends: bool = False
    mapped: tuple[str, ...] = ()
    sliding: tuple[str, ...] = ()  # bodies that never turn
    begun: bool = False  # data say how fast what runs free begins

    @classmethod
    def of_engines(
        cls, command: Command, mechanism: Mechanism, motion: Motion, joint_model: JointModel | None, bends: bool = False
    ) -> Asked:
        """What engines are asked; None is every joint model, of a linkage that swings freely the ideal one."""
        swings = motion == "driven" and not mechanism.motors
        every: tuple[JointModel, ...] = ("ideal",) if swings else JOINT_MODELS
        return cls(command, motion, every if joint_model is None else (joint_model,), bends)

    @property
    def touches(self) -> bool:
        """Whether pins touch their bearings by a law of contact, in any engine."""
        return any(model in TOUCHING["contact_law"] for model in self.joint_models)


@dataclass(frozen=True)
class Omission:
    """Fields that are left out ``where`` (in words) something holds, and ``why``; ``applies`` tests a part for it."""

    fields: tuple[str, ...]
    where: str
    why: str
    applies: Callable[[Asked, MechanismPart], bool]


def _loose(asked: Asked, part: MechanismPart) -> bool:
    """A joint with clearance; of a map with one that it gives."""
    assert isinstance(part, Joint)
    return part.name in asked.mapped if asked.command == "validity" else part.clearance > 0


def _frictionless(asked: Asked, part: MechanismPart) -> bool:
    return isinstance(part, Joint) and not part.friction


def _unused_radius(asked: Asked, part: MechanismPart) -> bool:
    """A pin without clearance whose friction has no radius to act at, or has a circle of its own already."""
    assert isinstance(part, Joint)
    pinned = bool(part.friction) and not part.prismatic and not _loose(asked, part)
    return pinned and (part.pin_radius is None or part.friction_radius > 0)


def _sticks(part: MechanismPart) -> bool:
    """A joint whose friction at rest is given by itself."""
    return isinstance(part, Joint) and part.static_torque is not None


def _guides_nothing(asked: Asked, part: MechanismPart) -> bool:
    """The block neither leans in its guide nor is rubbed by it."""
    return asked.joint_models == ("ideal",) if _loose(asked, part) else _frictionless(asked, part)


def _no_use_for_section(asked: Asked, part: MechanismPart) -> bool:
    """Neither bends the body, nor has it an inertia of its own that matters."""
    assert isinstance(part, Body)
    bends = asked.bends and part.youngs_modulus is not None
    return not bends and (part.inertia is not None or asked.motion == "static" or part.name in asked.sliding)


def _sliding(mechanism: Mechanism, asked: Asked) -> tuple[str, ...]:
    """The bodies that never turn: on blocks, one on another, that do not lean in their guides in any engine."""
    ideal = asked.joint_models == ("ideal",)
    guided = [
        set(joint.bodies) for joint in mechanism.joints if joint.prismatic and (ideal or not _loose(asked, joint))
    ]
    unturned = {"ground"}
    while more := [pair - unturned for pair in guided if len(pair & unturned) == 1]:
        unturned.update(*more)
    return tuple(sorted(unturned - {"ground"}))


OMISSIONS: tuple[Omission, ...] = (
    Omission(
        ("body.youngs_modulus", "body.shear_modulus", "joint.elasticity"),
        "`analyse` without `--compliance`, `compare` without `--flexible`, `simulate`, `check`, `validity`, `export`;"
        " `diagnose` without `youngs_modulus`",
        "links and joints are rigid here",
        lambda asked, part: not asked.bends,
    ),
    Omission(
        ("body.section",),
        "the same, and a body without `youngs_modulus`, where its `inertia` is given or does nothing",
        "only what bends, and an inertia that is not given, has a use for it",
        _no_use_for_section,
    ),
    Omission(
        ("body.shear_modulus",),
        "a body without `youngs_modulus`",
        "a link without youngs_modulus is rigid",
        lambda asked, part: isinstance(part, Body) and part.youngs_modulus is None,
    ),
    Omission(
        ("body.shear_modulus", "joint.elasticity.rotation"),
        "`analyse --compliance`, `accuracy`, `diagnose`, and the analytic side of `compare --flexible`",
        "the analytic model's links do not shear, and nothing twists or tilts out of the plane",
        lambda asked, part: asked.bends,
    ),
    Omission(
        (
            *("body.inertia", "spring.damping", "stop.damping", "drive.speed", "mechanism.initial"),
            *(f"joint.{field}" for field in ("damping", "drag", "stribeck_speed", *AT_SPEED)),
        ),
        "`static` motion; of `drive.speed` the direction is used, by friction",
        "nothing moves at rest",
        lambda asked, part: asked.motion == "static",
    ),
    Omission(
        ("mechanism.initial",),
        "`diagnose`, `plan`; `check` of a table that says how fast its linkage begins",
        "a free run begins as its data have it",
        lambda asked, part: asked.command in ("diagnose", "plan") or asked.begun,
    ),
    Omission(
        ("mechanism.initial",),
        "`accuracy`, `validity`",
        "nothing is let go here",
        lambda asked, part: asked.command in ("accuracy", "validity"),
    ),
    Omission(
        ("joint.friction_torque",),
        "`static` motion, a joint with `static_torque`",
        AT_STATIC,
        lambda asked, part: asked.motion == "static" and _sticks(part),
    ),
    Omission(
        ("joint.friction",),
        "the same, a prismatic joint without `guide`, whose friction is in N",
        AT_STATIC,
        lambda asked, part: (
            asked.motion == "static"
            and isinstance(part, Joint)
            and _sticks(part)
            and part.prismatic
            and part.guide is None
        ),
    ),
    Omission(
        ("drive.ripple", "drive.half_gap"),
        "`analyse --compliance`, `accuracy`; with `drive.stiffness` all others but `diagnose`",
        "the motor holds the crank where it is looked at",
        lambda asked, part: asked.bends and asked.command in ("analyse", "accuracy"),
    ),
    Omission(
        CONTACT_FIELDS,
        "a joint without `clearance`",
        "nothing touches without clearance",
        lambda asked, part: not _loose(asked, part),
    ),
    Omission(
        CONTACT_FIELDS,
        "`analyse`, `accuracy`, `check`",
        "the analytic model's contact is rigid",
        lambda asked, part: asked.command in ("analyse", "accuracy", "check"),
    ),
    Omission(
        CONTACT_FIELDS,
        "`ideal` and `massless-link` joints",
        "no pin touches its bearing by a law of contact in these joint models",
        lambda asked, part: not asked.touches,
    ),
    Omission(
        ("joint.contact_stiffness",),
        "a joint with `radial_stiffness`",
        "its soft bearing is what the pin touches",
        lambda asked, part: isinstance(part, Joint) and part.radial_stiffness is not None,
    ),
    Omission(
        ("joint.restitution",),
        "a joint with `contact_damping`",
        "contact_damping is given",
        lambda asked, part: isinstance(part, Joint) and part.contact_damping is not None,
    ),
    Omission(
        CONTACT_FIELDS,
        "the analytic side of `compare` and `validity`",
        "contact is rigid on the analytic side; the simulation has them",
        lambda asked, part: asked.command in ("compare", "validity"),
    ),
    Omission(
        ("joint.clearance", "joint.fit"),
        "`ideal` joints, and what swings freely",
        "joints are ideal here",
        lambda asked, part: asked.joint_models == ("ideal",),
    ),
    Omission(
        ("joint.guide",),
        "a joint with `clearance` of the same, and one without `clearance` and `friction`",
        "the block does not lean in its guide without clearance",
        _guides_nothing,
    ),
    Omission(
        ("joint.pin_radius",),
        "a joint without `friction` and `fit`, and a prismatic one",
        "nothing rubs there",
        lambda asked, part: isinstance(part, Joint) and not part.fit and (not part.friction or part.prismatic),
    ),
    Omission(
        ("joint.friction", "joint.pin_radius"),
        "a pin without `clearance` that has no `pin_radius`, or has a `friction_radius`",
        "a pin without clearance rubs by its pin_radius (m) or by its friction_radius (m), the one or the other",
        _unused_radius,
    ),
    Omission(
        ("joint.friction", "joint.pin_radius"),
        "a joint with `clearance`, in all joint models but `contact`, on both sides",
        "only contact joints rub in their clearance",
        lambda asked, part: _loose(asked, part) and any(model != "contact" for model in asked.joint_models),
    ),
    Omission(
        ("joint.rest_angle",),
        "a joint without `stiffness` and `cubic`",
        "there is no spring",
        lambda asked, part: isinstance(part, Joint) and not part.springy,
    ),
    Omission(
        ("joint.clearance", "joint.fit", "drive.speed"),
        "`validity`",
        "a map has clearances and speeds of its own",
        lambda asked, part: asked.command == "validity",
    ),
    Omission(
        ("body.marker",),
        "`validity`",
        "a map has no positions",
        lambda asked, part: asked.command == "validity",
    ),
    Omission(
        ("sensor.kind",),
        "`accuracy`, `validity`, `export`",
        "no sensor is read here",
        lambda asked, part: asked.command in ("accuracy", "validity", "export"),
    ),
    Omission(
        ("body.inertia",),
        "a body on a block in a guide of the ground, or on a block of such a body, `ideal` or without `clearance`",
        "it only slides",
        lambda asked, part: isinstance(part, Body) and part.name in asked.sliding,
    ),
    Omission(
        ("load.body", "load.point"),
        "a load without `force` and `torque`",
        "it has neither force nor torque",
        lambda asked, part: isinstance(part, Load) and not any((*part.force, part.torque)),
    ),
    Omission(
        ("spring.bodies", "spring.points", "spring.length"),
        "a spring without `stiffness` and `damping`",
        "it has neither stiffness nor damping",
        lambda asked, part: isinstance(part, Spring) and not (part.stiffness or part.damping),
    ),
    Omission(
        ("spring.length",),
        "a spring without `stiffness`",
        "it has no stiffness",
        lambda asked, part: isinstance(part, Spring) and not part.stiffness,
    ),
    Omission(
        ("mechanism.tolerances",),
        "all but `analyse`, and `accuracy` of a crank",
        "every number is what the file says here",
        lambda asked, part: asked.command not in ("accuracy", "analyse"),
    ),
    Omission(
        ("joint.fit",),
        "the same, a joint whose `clearance` is given",
        "its clearance is what the file says",
        lambda asked, part: (
            asked.command not in ("accuracy", "analyse") and isinstance(part, Joint) and not part.clearance_of_fit
        ),
    ),
    Omission(
        ("drive.periodic_torque",),
        "`accuracy` of a drive without `stiffness`",
        "a stiff drive holds its joint whatever its torque",
        lambda asked, part: asked.command == "accuracy" and isinstance(part, Drive) and part.stiffness is None,
    ),
)


def omitted(mechanism: Mechanism, asked: Asked) -> list[str]:
    """The fields that a question leaves out, a sentence for each reason; of a field the first that holds."""
    asked, mentioned = replace(asked, sliding=_sliding(mechanism, asked)), set[tuple[str, str]]()
    sentences = []
    for omission in OMISSIONS:
        by_parts: dict[str, list[str]] = {}  # fields by whose they are
        for field in omission.fields:
            kind, _, name = field.partition(".")
            owners = dict.fromkeys(w for w, part in _given(mechanism, kind, name) if omission.applies(asked, part))
            names = [whose for whose in owners if (field, whose) not in mentioned]
            mentioned |= {(field, whose) for whose in names}
            if names:
                by_parts.setdefault(_called(kind, names), []).append(name)
        if by_parts:
            each = "; ".join(f"{enumerated(fields)} of {parts}" for parts, fields in by_parts.items())
            sentences.append(f"left out: {each}, as {omission.why}")
    return sentences


def untold(simulator: str, asked: Iterable[str], signals: Container[str]) -> list[str]:
    """A sentence on signals that were asked for and that a run does not have."""
    lacking = [name for name in asked if name not in signals]
    return [f"{simulator}: does not say {', '.join(lacking)}"] if lacking else []


def rigid_walls(
    mechanism: Mechanism, simulator: str, joint_model: JointModel, settings: Mapping[str, SettingValue]
) -> list[str]:
    """A sentence on stiffness of contact that an engine had no use for, as the ``settings`` of its run have none."""
    given = [name for name in mechanism.clearances if mechanism.joint(name).contact_stiffness]
    if not given or joint_model not in TOUCHING["contact_law"] or "contact_stiffness" in settings:
        return []
    return [f"left out: contact_stiffness of {_called('joint', given)}, as the walls of {simulator} are rigid here"]


def _given(mechanism: Mechanism, kind: str, field: str) -> Iterator[tuple[str, MechanismPart]]:
    """Each part of a kind to which a file gives this field, after its name."""
    parts: dict[str, list[tuple[str, MechanismPart]]] = {
        "body": list(mechanism.moving.items()),
        "joint": [(joint.name, joint) for joint in mechanism.joints],
        "spring": [(" to ".join(".".join(end) for end in each.ends), each) for each in mechanism.springs],
        "stop": [(stop.joint, stop) for stop in mechanism.stops],
        "sensor": [(sensor.name, sensor) for sensor in mechanism.sensors],
        "load": [(f"{load.body}.{load.point}", load) for load in mechanism.loads],
        "drive": [(drive.joint, drive) for drive in mechanism.drives],
        "mechanism": [(mechanism.name, mechanism)],
    }
    *way, last = field.split(".")
    for name, part in parts[kind]:
        owner: Any = part
        for step in way:
            owner = getattr(owner, step)
        value = getattr(owner, last, None)
        given = value is not None and value != type(owner).model_fields[last].get_default(call_default_factory=True)
        if given and value not in ("free", "measured"):  # a drive's speed in words
            yield name, part


def _called(kind: str, names: Sequence[str]) -> str:
    words = {
        "joint": "joint",
        "sensor": "sensor",
        "spring": "the spring",
        "stop": "the stop",
        "load": "the load",
        "drive": "the drive",
    }
    word = words.get(kind, "")
    word += "s" * (len(names) > 1 and bool(word))
    return f"{word} {enumerated(names)}".strip()

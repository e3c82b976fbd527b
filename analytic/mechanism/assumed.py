"""What a mechanism leaves out and a number is put for.

A field that is left out is either nothing (no gravity, no spring, no friction, a rigid link) or one of these.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from analytic.mechanism.bars import shear_modulus
from analytic.mechanism.model import Mechanism
from analytic.mechanism.parts import Body, Drive, Joint


@dataclass(frozen=True)
class Assumed:
    """A field that was left out, the number that stands for it (in ``unit``, SI), and what that is."""

    field: str
    value: float | tuple[float, float]
    unit: str
    why: str


def assumed(m: Mechanism) -> tuple[Assumed, ...]:
    """Every number that a mechanism takes on, as its file gives none, body by body, then joints, drives, springs and
    loads.
    """
    drives = {"drive" if len(m.drives) == 1 else f"drive[{drive.joint}]": drive for drive in m.drives}
    return (
        *(each for body in m.bodies for each in _of_body(body)),
        *(each for joint in m.joints for each in _of_joint(joint)),
        *(each for where, drive in drives.items() for each in _of_drive(where, drive)),
        *(
            Assumed(f"spring[{k}].length", 0.0, "m", "a spring that pulls until its ends meet")
            for k, spring in enumerate(m.springs)
            if "length" not in spring.model_fields_set
        ),
        *(
            Assumed(f"load[{k}].point", _pair(m.moving[load.body].point("com")), "m", f"com of body {load.body}")
            for k, load in enumerate(m.loads)
            if "point" not in load.model_fields_set and any(load.force)
        ),
    )


def _of_body(b: Body) -> Iterator[Assumed]:
    where = f"body[{b.name}]"
    if b.com is None:
        yield Assumed(f"{where}.com", _pair(b.middle), "m", "the middle of the body's points")
    if b.inertia is None:
        yield Assumed(f"{where}.inertia", b.moment_of_inertia, "kg.m2", "a uniform bar of the body's length and height")
        if "section" not in b.model_fields_set:
            yield Assumed(f"{where}.section", b.section, "m", "a bar without height or depth")
    if b.youngs_modulus is not None and b.shear_modulus is None:
        yield Assumed(f"{where}.shear_modulus", shear_modulus(b), "Pa", "an isotropic material of Poisson's ratio 0.3")


def _of_joint(j: Joint) -> Iterator[Assumed]:
    where = f"joint[{j.name}]"
    if j.prismatic and "angle" not in j.model_fields_set:
        yield Assumed(f"{where}.angle", j.angle, "rad", "the second body's angle is the first's")
    if j.clearance_of_fit:
        yield Assumed(f"{where}.clearance", j.clearance, "m", f"the middle of its fit {j.fit}, radial")
    if j.springy and "rest_angle" not in j.model_fields_set:
        yield Assumed(f"{where}.rest_angle", j.rest_angle, "m" if j.prismatic else "rad", "where the spring rests")


def _of_drive(where: str, drive: Drive) -> Iterator[Assumed]:
    for name, wave in (("ripple", drive.ripple), ("periodic_torque", drive.periodic_torque)):
        if wave is not None and "phase" not in wave.model_fields_set:
            yield Assumed(f"{where}.{name}.phase", wave.phase, "rad", "the wave starts at the crank's angle 0")


def _pair(place: complex) -> tuple[float, float]:
    return place.real, place.imag

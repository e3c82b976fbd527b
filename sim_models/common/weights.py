"""At rest a mass is nothing but a weight: a linkage of very unequal masses is put to an engine with equal ones.

Engines find an equilibrium by letting bodies accelerate, or by rows that give as masses tell them to; a link a
billionth as heavy as its neighbour is beyond their arithmetic, though its equilibrium is as plain as any other.
"""

from __future__ import annotations

from analytic.mechanism import Body, Load, Mechanism

UNEVEN = 1e3  # of the heaviest body's mass to the lightest's, from which on masses are made equal at rest
WEIGHT = "weight"  # point of a body whose marker is not its centre of mass


def with_equal_masses(m: Mechanism) -> Mechanism:
    """The mechanism with its mean mass in every body and each body's own weight as a load at its centre of mass; no
    gravity.

    Where masses are within UNEVEN of each other, the mechanism itself.
    """
    masses = [b.mass for b in m.bodies]
    if max(masses) < UNEVEN * min(masses):
        return m
    mean = sum(masses) / len(masses)
    weights = tuple(
        Load(
            body=b.name,
            point="com" if b.marker is None else WEIGHT,
            force=(b.mass * m.gravity[0], b.mass * m.gravity[1]),
        )
        for b in m.bodies
    )
    return m.replace(bodies=tuple(_of_mass(b, mean) for b in m.bodies), loads=m.loads + weights, gravity=(0.0, 0.0))


def _of_mass(b: Body, mass: float) -> Body:
    inertia = mass * max(b.length, b.moment_of_inertia**0.5 / b.mass**0.5) ** 2 / 12
    body = b.model_copy(update={"mass": mass, "inertia": inertia})
    if b.marker is None:
        return body
    return body.model_copy(
        update={"points": {**b.points, WEIGHT: (b.centre.real, b.centre.imag)}, "com": b.marker, "marker": None}
    )

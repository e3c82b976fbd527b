"""A proposed law as an effect like any other: on the mechanism or on the readings, so that engines simulate it too.

What each law of the dictionary is on a mechanism is one function of it here; a law without one cannot be adopted.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from string import ascii_lowercase

import numpy as np

from analytic.mechanism import GROUND, Load, Mechanism, PeriodicTorque
from compare.diagnose.effects.bodies import LinkLength
from compare.diagnose.effects.effect import Effect, Parameter, Readings, Rig, Values
from compare.diagnose.propose.document import in_letters, units
from compare.diagnose.propose.laws import UNKNOWNS, Candidate
from compare.diagnose.propose.places import EFFECTS, Bend
from compare.diagnose.propose.proposal import Proposal
from compare.results.diagnosis import Unknown, adopted_name

SMALL = 0.01  # of a coefficient: a small amount of it
Numbers = Sequence[float]  # of a law: its coefficients, then its shapes


class Unadoptable(ValueError):
    """A proposal that no mechanism's field and no sensor's fault can express; the message says which law."""


def adopted(p: Proposal) -> Adopted:
    """A proposal as an effect.  Raises Unadoptable."""
    unknown, where = p.place.unknown, p.place.where
    laws = [c.law.name for c in p.law.laws]
    if not laws:
        raise Unadoptable("no law is proposed with the place")
    for name in laws:
        if (unknown, _kind(name)) not in (ON_MECHANISM if unknown != "error" else ON_READINGS):
            raise Unadoptable(f"no mechanism file can say {in_letters(p.law)} ({name}) of {p.place.words}")
    if unknown == "error" and where == p.scene.rig.encoder and p.scene.rig.following:
        raise Unadoptable("the runs follow the very encoder that is said to err")
    noun, kind = UNKNOWNS[unknown], "signal" if unknown == "error" else EFFECTS[unknown].place
    said = {
        "name": adopted_name(unknown),
        "place": kind,
        "label": f"the proposed {noun}",
        "meaning": f"the proposed {noun} is there",
        "sensor": unknown == "error",
        "needs": frozenset().union(*(NEEDS.get((unknown, _kind(name)), frozenset()) for name in laws)),
        "parameters": tuple(Parameter(a, unit, "law") for a, unit in zip(ascii_lowercase, units(p), strict=False)),
    }
    found: Adopted = type(f"Adopted{unknown.capitalize()}", (Adopted,), said)(p)
    try:
        found.on_mechanism(p.scene.rig.mechanism, where, found.proposed)
    except ValueError as error:
        raise Unadoptable(f"a mechanism with the proposed law is refused: {error}") from None
    return found


class Adopted(Effect):
    """A proposed law at its place.  Natural: its coefficients, in the sense proposed, and by how much its shapes
    differ from the proposed ones.
    """

    def __init__(self, p: Proposal) -> None:
        self.unknown: Unknown = p.place.unknown
        self.where, self.encoder = p.place.where, p.scene.rig.encoder
        self.laws: tuple[Candidate, ...] = p.law.laws
        coefficients, numbers = iter(p.law.coefficients.tolist()), list[float]()
        for c in self.laws:
            numbers += [*(next(coefficients) for _ in c.law.terms), *c.shape]
        self.proposed: Values = dict(zip(ascii_lowercase, numbers, strict=False))

    @property
    def linear(self) -> np.ndarray:
        """Which of the numbers (n,) are coefficients."""
        return np.array([k < len(c.law.terms) for c in self.laws for k in range(len(c.law.terms) + len(c.shape))])

    def places(self, rig: Rig) -> Sequence[str]:
        return [self.where]

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return [SMALL * max(abs(v), 1e-12) for v in self.proposed.values()]

    def probes(self, rig: Rig, where: str, variant: float = 0.0) -> np.ndarray:
        return np.diag(self.scales(rig, where))[self.linear]

    def lowest(self, rig: Rig, where: str, variant: float = 0.0) -> np.ndarray:
        """No coefficient changes its sense: friction would drive."""
        return np.where(self.linear, 0.0, -math.inf)

    def values(self, rig: Rig, where: str, x: np.ndarray, variant: float = 0.0) -> dict[str, float]:
        known = np.array([*self.proposed.values()])
        found = np.where(self.linear, np.sign(known) * x, known + x)
        return dict(zip(self.proposed, found.tolist(), strict=True))

    def natural(self, rig: Rig, where: str, values: Values, variant: float = 0.0) -> np.ndarray:
        known, given = (np.array([v[p.name] for p in self.parameters]) for v in (self.proposed, values))
        return np.where(self.linear, np.sign(known) * given, given - known)

    def blames(self, parameter: str) -> bool:
        return False

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        if self.unknown == "error":
            return mechanism
        for c, numbers in self._parted(values):
            mechanism = ON_MECHANISM[self.unknown, _kind(c.law.name)](mechanism, where, [*numbers, _harmonic(c)])
        return mechanism

    def on_readings(self, readings: Readings, run: str, where: str, values: Values) -> Readings:
        if self.unknown != "error" or where not in readings:
            return readings
        off = np.zeros_like(readings[where])
        for c, numbers in self._parted(values):
            error = ON_READINGS[self.unknown, _kind(c.law.name)]
            off = off + error(readings, where, self.encoder, [*numbers, _harmonic(c)])
        return {**readings, where: readings[where] + off}

    def _parted(self, values: Values) -> list[tuple[Candidate, list[float]]]:
        """The numbers of each law."""
        numbers = iter([values[p.name] for p in self.parameters])
        return [(c, [next(numbers) for _ in range(len(c.law.terms) + len(c.shape))]) for c in self.laws]


def _kind(law: str) -> str:
    """The name of a law, that of a harmonic without its order."""
    return "harmonic" if law.startswith("harmonic ") else law


def _harmonic(c: Candidate) -> float:
    """The order of a harmonic of the crank angle; 0 of other laws."""
    _, _, order = c.law.name.partition("harmonic ")
    return float(order or 0)


# ---------------------------------------------------------------- laws of joints, of torques on their second bodies


def _constant(m: Mechanism, where: str, n: Numbers) -> Mechanism:
    joint = m.joint(where)
    if joint.prismatic:
        raise ValueError(f"joint {where} slides: a constant force in it is no load of a mechanism file")
    pair = zip(joint.bodies, (-n[0], n[0]), strict=True)
    return m.replace(loads=(*m.loads, *(Load(body=b, torque=t) for b, t in pair if b != GROUND)))


def _coulomb(m: Mechanism, where: str, n: Numbers) -> Mechanism:
    return m.with_joint(where, friction_torque=m.joint(where).coulomb - n[0])


def _viscous(m: Mechanism, where: str, n: Numbers) -> Mechanism:
    return m.with_joint(where, damping=m.joint(where).damping - n[0])


def _drag(m: Mechanism, where: str, n: Numbers) -> Mechanism:
    return m.with_joint(where, drag=m.joint(where).drag - n[0])


def _stribeck(m: Mechanism, where: str, n: Numbers) -> Mechanism:
    friction = m.joint(where).coulomb - n[0]
    return m.with_joint(where, friction_torque=friction, static_torque=friction - n[1], stribeck_speed=n[2])


def _of_load(m: Mechanism, where: str, n: Numbers) -> Mechanism:
    return m.with_friction_circle(where, m.joint(where).load_coefficient - n[0])


def _spring(m: Mechanism, where: str, n: Numbers) -> Mechanism:
    """A spring beside what is there: at the same rest angle with what it pulls there as a constant torque."""
    joint = m.joint(where)
    stiffer = m.with_joint(where, stiffness=joint.stiffness - n[0], rest_angle=joint.rest_angle)
    return _constant(stiffer, where, [n[0] * joint.rest_angle]) if joint.rest_angle else stiffer


def _stiffening(m: Mechanism, where: str, n: Numbers) -> Mechanism:
    """A cubic spring; one that is there already keeps its torque, about the cubic one's rest angle."""
    joint, rest = m.joint(where), n[1]
    if joint.cubic:
        raise ValueError(f"joint {where} has a spring that is not linear already")
    bent = m.with_joint(where, stiffness=joint.stiffness, cubic=-n[0], rest_angle=rest)
    moved = joint.stiffness * (joint.rest_angle - rest)
    return _constant(bent, where, [moved]) if moved else bent


def _cogging(m: Mechanism, where: str, n: Numbers) -> Mechanism:
    if where != m.drive_joint.name:
        raise ValueError(f"a torque over the crank angle can be in the drive's joint only, not in {where}")
    if m.periodic_torque is not None:
        raise ValueError("the drive has a periodic torque already")
    sense = 1.0 if m.drive_joint.bodies[1] == m.driven else -1.0
    wave = PeriodicTorque(
        amplitude=math.hypot(n[0], n[1]), harmonic=round(n[-1]), phase=math.atan2(sense * n[0], sense * n[1])
    )
    return m.with_drive(periodic_torque=wave)


def _longer(m: Mechanism, where: str, n: Numbers) -> Mechanism:
    return LinkLength().on_mechanism(m, where, {"length_error": n[0]})


def _bent(m: Mechanism, where: str, n: Numbers) -> Mechanism:
    return Bend().on_mechanism(m, where, {"length_error": n[0]})


def _loose(m: Mechanism, where: str, n: Numbers) -> Mechanism:
    return m.with_joint(where, clearance=m.joint(where).clearance + n[0])


def _soft(m: Mechanism, where: str, n: Numbers) -> Mechanism:
    known = m.joint(where).radial_stiffness
    return m.with_joint(where, radial_stiffness=1 / (n[0] + (1 / known if known else 0.0)))


def _springy(m: Mechanism, where: str, n: Numbers) -> Mechanism:
    known = m.drive_stiffness
    return m.with_drive(stiffness=1 / (n[0] + (1 / known if known else 0.0)))


ON_MECHANISM: Mapping[tuple[Unknown, str], Callable[[Mechanism, str, Numbers], Mechanism]] = {
    ("torque", "constant"): _constant,
    ("torque", "Coulomb friction"): _coulomb,
    ("torque", "viscous friction"): _viscous,
    ("torque", "drag"): _drag,
    ("torque", "Stribeck friction"): _stribeck,
    ("torque", "friction of the load"): _of_load,
    ("torque", "spring"): _spring,
    ("torque", "stiffening spring"): _stiffening,
    ("torque", "harmonic"): _cogging,
    ("length", "constant"): _longer,
    ("bend", "constant"): _bent,
    ("give", "constant"): _loose,
    ("give", "load"): _soft,
    ("lag", "drive torque"): _springy,
}
NEEDS: Mapping[tuple[Unknown, str], frozenset[str]] = {  # of an engine
    ("torque", "Coulomb friction"): frozenset({"coulomb_friction"}),
    ("torque", "viscous friction"): frozenset({"viscous_friction"}),
    ("torque", "drag"): frozenset({"drag"}),
    ("torque", "Stribeck friction"): frozenset({"stribeck_friction"}),
    ("torque", "friction of the load"): frozenset({"load_friction"}),
    ("torque", "spring"): frozenset({"joint_spring"}),
    ("torque", "stiffening spring"): frozenset({"joint_spring", "nonlinear_spring"}),
    ("torque", "harmonic"): frozenset({"periodic_torque"}),
    ("give", "constant"): frozenset({"contact"}),
    ("give", "load"): frozenset({"soft_bearing"}),
    ("lag", "drive torque"): frozenset({"drive_compliance"}),
}


# ---------------------------------------------------------------- errors of sensors


def _wave(readings: Readings, where: str, encoder: str, n: Numbers) -> np.ndarray:
    if encoder not in readings:
        raise ValueError("an error over the crank angle needs the crank's encoder")
    return np.asarray(n[0] * np.cos(n[-1] * readings[encoder]) + n[1] * np.sin(n[-1] * readings[encoder]))


ON_READINGS: Mapping[tuple[Unknown, str], Callable[[Readings, str, str, Numbers], np.ndarray]] = {
    ("error", "constant"): lambda readings, where, encoder, n: np.full_like(readings[where], n[0]),
    ("error", "gain"): lambda readings, where, encoder, n: n[0] * readings[where],
    ("error", "harmonic"): _wave,
}

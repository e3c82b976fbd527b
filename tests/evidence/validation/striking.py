"""Pins that strike: what a revolution has of each figure on average, by each law of contact, in each engine and by an
ordinary differential equation of its own; and what each law delivers of the restitution that it is asked for.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.reach import usual_angles
from analytic.kinematics.schedule import Schedule
from analytic.mechanism import Mechanism
from analytic.mechanism.file import load
from analytic.mechanism.parts import ContactLaw
from compare.arguments import cores
from compare.judge.contact import contact, ideal_peaks
from compare.results.contact import Contact, StatisticName
from compare.results.crosscheck import Failure
from compare.simulations import ContactTrace, simulate_all
from sim_models.common.contact_laws import named_law
from sim_models.engine import JointModel, Request, SimulationError, Unsupported, check_supported, declared
from tests.evidence.contact_ode import centred, loop_of, simulate
from tests.evidence.results.validation import Known, Struck
from tests.evidence.validation.workspaces import digits

LAWS: tuple[ContactLaw, ...] = get_args(ContactLaw)
REVOLUTIONS, MORE, OF_ODE = 12, 24, 96  # of an engine, where the report is written, and of the equation
SHOWN: tuple[StatisticName, ...] = (
    "free_share",
    "impacts",
    "rms_force",
    "peak_force",
    "restitution_loss",
    "friction_loss",
    "wear",
    "penetration",
)
CHECKED: ContactLaw = "flores"  # is made again where the report is checked
ODE = "equation"  # its name among the engines


@dataclass(frozen=True)
class Rattling:
    """A case with radial clearance (m) in one joint, fast (rad/s) enough to strike; restitution asked for, stiffness
    (N/m).
    """

    case: str
    joint: str
    clearance: float
    speed: float
    restitution: float
    stiffness: float
    friction: float = 0.0  # Coulomb's coefficient, of a pin of PIN_RADIUS
    laws: tuple[ContactLaw, ...] = LAWS

    def linkage(self, law: ContactLaw) -> Mechanism:
        """The case by a law of contact."""
        m = load(self.case).with_clearances({self.joint: self.clearance})
        assert m.drive is not None
        m = m.replace(drive=m.drive.model_copy(update={"speed": self.speed}))
        made_of = {"restitution": self.restitution, "contact_stiffness": self.stiffness, "friction": self.friction}
        return m.with_joint(self.joint, contact_law=law, **made_of)


CASES = (
    Rattling("crank-rocker", "B", 5e-4, 20 * math.pi, 0.5, 1e7),
    Rattling("slider-crank", "B", 5e-4, 5000 * math.pi / 30, 0.9, 1e8),  # of Flores et al.
    Rattling("crank-rocker", "B", 5e-4, 20 * math.pi, 0.5, 1e7, 0.02, (CHECKED,)),
    Rattling("slider-crank", "B", 5e-4, 5000 * math.pi / 30, 0.9, 1e8, 0.02, (CHECKED,)),
)


def striking(
    names: Sequence[str], laws: Sequence[ContactLaw] = LAWS, revolutions: int = REVOLUTIONS
) -> tuple[Struck, ...]:
    """Each case with each of these laws in each engine that has it, over so many revolutions, and by the equation.

    Raises SimulationError where an engine fails.
    """
    cells = [(rattling, law, rattling.linkage(law)) for rattling in CASES for law in laws if law in rattling.laws]
    asked = [(i, name, _request(m, name, revolutions)) for i, (_, _, m) in enumerate(cells) for name in names]
    able = [(i, name, request) for i, name, request in asked if request is not None]
    ideal = [ideal_peaks(m)[rattling.joint] for rattling, _, m in cells]
    found: dict[tuple[int, str], Struck] = {}
    for k, outcome in simulate_all([(name, request) for _, name, request in able], cores()):
        i, name, _ = able[k]
        rattling, law, _ = cells[i]
        if isinstance(outcome, Failure):
            raise SimulationError(f"{rattling.case}, {law}, in {name}: {outcome.why}")
        assert isinstance(outcome, ContactTrace)
        assert outcome.contact is not None
        found[i, name] = _row(rattling, law, name, outcome.joint_model, outcome.contact, ideal[i])
    equations = [
        _row(rattling, law, ODE, "contact", by_equation(m), peak)
        for (rattling, law, m), peak in zip(cells, ideal, strict=True)
    ]
    return tuple(
        row
        for i, equation in enumerate(equations)
        for row in (equation, *(found[i, name] for name in names if (i, name) in found))
    )


def by_equation(m: Mechanism, revolutions: int = OF_ODE) -> Contact:
    """What contact does by the equation, after a revolution that does not count."""
    (joint,) = m.clearances
    loop = loop_of(m, 0.0, named_law(m, m.joint(joint), "driven"))
    watched = simulate(m, loop, centred(m, loop), (revolutions + 1) * math.tau).watched
    late = watched.time >= math.tau / abs(m.speed or 1.0)

    def kept(values: np.ndarray) -> np.ndarray:
        return values[late]

    by = {
        name: {key: kept(values) for key, values in getattr(watched, name).items()}
        for name in ("place", "velocity", "angle", "angular_velocity", "force")
    }
    return contact(m, replace(watched, time=kept(watched.time), torque=kept(watched.torque), **by), ideal_peaks(m))


def _request(m: Mechanism, name: str, revolutions: int = REVOLUTIONS) -> Request | None:
    """A run of an engine that has the law in contact, or else between pin centres; None where it has it in neither."""
    theta = usual_angles(Assembly(m))
    beyond = revolutions * math.tau - float(theta[-1] - theta[0])
    rough = any(joint.friction for joint in m.joints if joint.clearance)
    models: tuple[JointModel, ...] = ("contact",) if rough else ("contact", "spring-damper")
    for model in models:
        asked = Request(
            m, model, Schedule.at_angles(m, theta), start="centred", lead_in=math.tau, beyond=beyond, watched=True
        )
        try:
            check_supported(declared(name), asked)
        except Unsupported:
            continue
        return asked
    return None


def _row(rattling: Rattling, law: ContactLaw, by: str, joint_model: JointModel, found: Contact, ideal: float) -> Struck:
    """The figures that the report shows, with their intervals."""
    told = [name for name in SHOWN if name != "friction_loss" or rattling.friction]
    figures = {name: found.joints[rattling.joint].statistics[name] for name in told}
    share = found.energy.share if found.energy is not None else None
    return Struck(
        case=rattling.case,
        law=law,
        joint=rattling.joint,
        clearance=rattling.clearance,
        speed=rattling.speed,
        restitution=rattling.restitution,
        stiffness=rattling.stiffness,
        friction=rattling.friction,
        simulator=by,
        joint_model=joint_model,
        revolutions=round(found.revolutions),
        ideal_peak=_four(ideal),
        missing=None if share is None else digits(share),
        statistics={
            name: Known(value=_four(s.value), low=_four(s.low), high=_four(s.high)) for name, s in figures.items()
        },
    )


def _four(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(f"{value:.4g}")

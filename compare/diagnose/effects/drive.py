"""Effects in the drive: a motor that is springy, turns or pulls unevenly, or has backlash."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from analytic.mechanism import Mechanism, PeriodicTorque, Ripple
from compare.diagnose.effects.effect import Draw, Effect, Growth, Hiding, Parameter, Reciprocal, Rig, Values, Wave

HARMONICS = range(1, 13)
OF_TORQUE = range(1, 25)  # poles and teeth are many
PROBED = 5e-4  # rad, half of a gap
PLAY = 2e-4  # rad, half of a machine's least gap: of smaller ones flights are shorter than a sample


class DriveCompliance(Reciprocal):
    """A springy transmission: the crank lags its motor by torque over stiffness."""

    name = "drive_compliance"
    place = "drive"
    label = "a compliant drive"
    meaning = "the drive is springy"
    hiding = Hiding(exclusive=True, makers={"exudyn": 1.0, "mujoco": 1.0})
    needs = frozenset({"drive_compliance"})
    parameters = (Parameter("stiffness", "N.m/rad", "stiffness", 0.0),)

    def places(self, rig: Rig) -> Sequence[str]:
        return ["drive"] if rig.repeating and not (rig.mechanism.drive and rig.mechanism.drive.stiffness) else []

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-5 / rig.torque,)

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        return mechanism.with_drive(stiffness=values["stiffness"])

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        return Growth(lambda a: {"stiffness": rig.torque / a}, 0.02)


class SpeedRipple(Wave):
    """A motor that turns unevenly: command plus amplitude sin(harmonic command + phase)."""

    name = "speed_ripple"
    place = "drive"
    label = "a ripple of the drive's speed"
    meaning = "the drive turns unevenly"
    hiding = Hiding(commanded=True, exclusive=True)
    parameters = (
        Parameter("amplitude", "rad", "angle", 0.0),
        Parameter("harmonic", "1", "harmonic", discrete=True),
        Parameter("phase", "rad", "phase", circular=True),
    )

    def places(self, rig: Rig) -> Sequence[str]:
        uneven = any(drive.ripple is not None for drive in rig.mechanism.drives)
        return ["drive"] if set(rig.turning) - set(rig.following) and not uneven else []

    def variants(self, rig: Rig, where: str) -> Sequence[float]:
        return rig.told(HARMONICS)

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-5, 1e-5)

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        ripple = Ripple(amplitude=values["amplitude"], harmonic=round(values["harmonic"]), phase=values["phase"])
        return mechanism.with_drive(ripple=ripple)

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        harmonic, phase = float(draw.rng.integers(1, 7)), draw.turn - math.pi
        return Growth(lambda a: {"amplitude": a, "harmonic": harmonic, "phase": phase}, 0.02, harmonic)


class TorqueWave(Wave):
    """A torque on the crank over its angle, amplitude sin(harmonic angle + phase): cogging, a tooth, a belt's joint."""

    name = "periodic_torque"
    place = "drive"
    label = "a periodic torque on the crank"
    meaning = "a torque on the crank goes with its angle"
    needs = frozenset({"periodic_torque"})
    hiding = Hiding(sets="machines")
    parameters = (
        Parameter("amplitude", "N.m", "torque", 0.0),
        Parameter("harmonic", "1", "harmonic", discrete=True),
        Parameter("phase", "rad", "phase", circular=True),
    )

    def places(self, rig: Rig) -> Sequence[str]:
        return ["drive"] if rig.turning and rig.mechanism.periodic_torque is None else []

    def variants(self, rig: Rig, where: str) -> Sequence[float]:
        return rig.told(OF_TORQUE)

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-3 * rig.torque, 1e-3 * rig.torque)

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        wave = PeriodicTorque(amplitude=values["amplitude"], harmonic=round(values["harmonic"]), phase=values["phase"])
        return mechanism.with_drive(periodic_torque=wave)

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        harmonic, phase = float(draw.rng.choice(OF_TORQUE)), draw.turn - math.pi
        return Growth(lambda a: {"amplitude": a * rig.torque, "harmonic": harmonic, "phase": phase}, 0.5, harmonic)


class DriveBacklash(Effect):
    """A gap between motor and crank: the crank lies half of it behind its motor, or ahead where it drives the motor,
    and flies across where the torque changes its sign.
    """

    name = "drive_backlash"
    place = "drive"
    label = "backlash in the drive"
    meaning = "the drive has backlash"
    hiding = Hiding(exclusive=True, sets="machines", makers={"mujoco": 1.0, "dart": 0.3})
    needs = frozenset({"backlash"})
    leaps = True
    parameters = (Parameter("half_gap", "rad", "angle", 0.0),)

    def places(self, rig: Rig) -> Sequence[str]:
        return ["drive"] if rig.repeating and not (rig.mechanism.drive and rig.mechanism.drive.half_gap) else []

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-4,)  # in smaller steps what lands a sample sooner would drown what the crank lags

    def probes(self, rig: Rig, where: str, variant: float = 0.0) -> np.ndarray:
        return np.array([[PROBED]])  # flights are the longer beside what the crank lags the smaller the gap is

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        return mechanism.with_drive(half_gap=values["half_gap"])

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        return Growth(lambda a: {"half_gap": a}, 0.02, least=PLAY * 10 ** draw.rng.random())


EFFECTS: tuple[Effect, ...] = (DriveCompliance(), SpeedRipple(), TorqueWave(), DriveBacklash())

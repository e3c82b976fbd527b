"""The one description of a planar linkage, its checks and its files."""

from analytic.mechanism.checks import MechanismWarning
from analytic.mechanism.errors import MechanismError
from analytic.mechanism.model import Mechanism
from analytic.mechanism.parts import (
    FARTHEST_ANGLE,
    GROUND,
    LARGEST_NUMBER,
    MASS_CENTRE,
    SMALLEST_NUMBER,
    Body,
    Drive,
    Elasticity,
    Ground,
    Joint,
    Load,
    PeriodicTorque,
    Ripple,
    Sensor,
    Spring,
    Stop,
    Tolerance,
)

__all__ = [
    "FARTHEST_ANGLE",
    "GROUND",
    "LARGEST_NUMBER",
    "MASS_CENTRE",
    "SMALLEST_NUMBER",
    "Body",
    "Drive",
    "Elasticity",
    "Ground",
    "Joint",
    "Load",
    "Mechanism",
    "MechanismError",
    "MechanismWarning",
    "PeriodicTorque",
    "Ripple",
    "Sensor",
    "Spring",
    "Stop",
    "Tolerance",
]

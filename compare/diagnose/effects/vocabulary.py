"""The vocabulary: every effect that a diagnosis can name, by name, in the order of the contract's table."""

from __future__ import annotations

from compare.diagnose.effects import bodies, joints
from compare.diagnose.effects.effect import Effect
from compare.diagnose.effects.sensors import SENSOR_EFFECTS

MECHANISM_EFFECTS: tuple[Effect, ...] = (
    bodies.Gravity(),
    bodies.Payload(),
    bodies.ComOffset(),
    bodies.MomentOfInertia(),
    bodies.LinkLength(),
    bodies.PivotPosition(),
    joints.JointClearance(),
    joints.CoulombFriction(),
    joints.ViscousFriction(),
    joints.JointSpring(),
    bodies.ExternalForce(),
    bodies.LoadTorque(),
    bodies.LinkFlexibility(),
    joints.DriveCompliance(),
    joints.SpeedRipple(),
)
VOCABULARY: dict[str, Effect] = {e.name: e for e in (*MECHANISM_EFFECTS, *SENSOR_EFFECTS)}

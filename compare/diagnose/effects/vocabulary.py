"""The vocabulary: every effect that a diagnosis can name, by name."""

from __future__ import annotations

from compare.diagnose.effects import bodies, drive, joints, loads, sensors
from compare.diagnose.effects.effect import Effect

VOCABULARY: dict[str, Effect] = {
    effect.name: effect for module in (bodies, joints, loads, drive, sensors) for effect in module.EFFECTS
}

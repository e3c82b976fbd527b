"""reports/accelerometers.json: what diagnoses from accelerometers alone said, set by set."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from compare.results.diagnosis import DiagnosisVerdict
from compare.results.document import Part

Kind = Literal["link", "unbalance", "clearance"]


class Told(Part):
    """What a diagnosis said of a set; ``sigmas`` is how far all readings together are off the nominal rig's over their
    noise, ``free`` the share of the time that a pin is off its wall.
    """

    kind: Kind
    set: int
    case: str
    noise: float
    sensors: int
    truth: str
    values: Mapping[str, float]
    sigmas: float
    free: float
    named: Mapping[str, tuple[str, ...]]
    found: Mapping[str, float]
    verdict: DiagnosisVerdict
    right: bool
    seconds: float


class Accelerometers(Part):
    """All sets."""

    versions: Mapping[str, str]
    sets: tuple[Told, ...] = ()

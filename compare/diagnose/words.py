"""A diagnosis in an engineer's words."""

from __future__ import annotations

import math

from compare.diagnose.explain import Explanation, Named
from compare.report.diagnosis_words import parameter

SAYS = {
    "gravity": "gravity acts on the linkage", "payload": "a payload rides on the {where}", "com_offset": "the centre of mass of the {where} is off",
    "moment_of_inertia": "the moment of inertia of the {where} is off", "link_length": "the {where} is not as long as thought",
    "pivot_position": "the ground pivot {where} is not where it is thought to be", "joint_clearance": "joint {where} has clearance",
    "coulomb_friction": "joint {where} has dry friction", "viscous_friction": "joint {where} has viscous friction",
    "joint_spring": "a spring acts in joint {where}", "external_force": "an unknown force acts on the {where}",
    "load_torque": "an unknown torque acts on the {where}", "link_flexibility": "the links bend", "drive_compliance": "the drive is springy",
    "speed_ripple": "the drive turns unevenly", "encoder_offset": "the encoder {where} has an offset", "sensor_bias": "the sensor {where} has a bias",
    "sensor_gain": "the sensor {where} has a wrong gain", "sensor_delay": "the sensor {where} is late",
    "sensor_frame": "the load cell at {where} is mounted turned", "clock_offset": "the clock of run {where} is off against its command",
}  # fmt: skip


def says(name: str, where: str) -> str:
    """What an effect at a place means."""
    return SAYS.get(name, f"{name.replace('_', ' ')} at {{where}}").format(where=where)


def named(n: Named) -> str:
    """A named effect in a sentence, its parameters with their 95 % intervals."""
    values = []
    for p, i in n.parameters.items():
        name, value, interval = parameter(p, {"value": i.value, "unit": n.unit(p), "low": _finite(i.low), "high": _finite(i.high)})
        values.append(f"{name} {value}" + (f" (95 %: {interval})" if i.low < i.high else ""))
    text = f"{says(*n.term.key)}: {'; '.join(values)}."
    return text[0].upper() + text[1:]


def tied(n: Named) -> str:
    """What explains the data as well as a named effect, in words."""
    return "; or ".join(says(*t.key) for t, _ in n.ties)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def statement(e: Explanation, gap: tuple[float, float]) -> str:
    """The verdict in a paragraph."""
    before, after = gap
    measure = f"The gap is {before:.3g} times the noise before and {after:.3g} after."
    if e.verdict == "no gap":
        agree = f"Simulation and measurement agree within the noise (gap {before:.3g} times the noise floor)."
        return f"{agree} Nothing is missing that these data could show."
    if e.verdict == "unexplained":
        disagree = f"Simulation and measurement disagree (gap {before:.3g} times the noise floor)"
        return f"{disagree}, and nothing in the vocabulary explains it."
    what = " ".join(named(n) for n in e.named)
    if e.verdict == "explained":
        return f"{what} {measure}"
    if e.verdict == "ambiguous":
        ties = " ".join(f"These data would be explained as well if {tied(n)} (instead of {n.term.label})." for n in e.named if n.ties)
        return f"{what} {ties} {measure}"
    return f"{what} {measure} Something remains that these effects do not explain."

"""A mechanism's numbers, such as explained.toml's, written back into the MuJoCo model that it came from."""

from __future__ import annotations

from analytic.mechanism.file import load
from compare.arguments import path
from compare.questions.listing import ApplyQuestion
from compare.questions.question import answers
from compare.results.applied import Applied
from sim_models.engine import SimulatorMissing, broken


@answers(ApplyQuestion)
def apply(question: ApplyQuestion) -> Applied:
    """Put the lengths, masses, centres of mass, inertias and laws of joints of a mechanism into the MuJoCo model that
    it was imported from, or explained from: the model's text, in which nothing else changes, and what of the mechanism
    MJCF has no word for.

    Raises MechanismError, MjcfError with file, place, value and remedy, ArgumentError, or SimulatorMissing where MuJoCo
    is not installed.
    """
    mechanism, model = load(path(question.file, "file")), path(question.to, "to")
    fault = broken("mujoco")
    if fault:
        raise SimulatorMissing(f"MuJoCo, which reads MJCF, cannot be imported ({fault}); run: pip install mujoco")
    from sim_models.mjcf.applied import applied

    done = applied(mechanism, model)
    return Applied(
        case=mechanism.name,
        source=str(model),
        written=tuple(f"{field} = {_shown(to)}, was {_shown(was)}" for field, (was, to) in done.written.items()),
        left=tuple(f"{field} = {_shown(to)}" for field, to in done.left.items()),
        text=done.text.decode("utf-8"),
    )


def _shown(value: float | str | None) -> str:
    return f"{value:.10g}" if isinstance(value, int | float) else str(value or 0)

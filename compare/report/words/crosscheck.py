"""What a cross-check comes to: its verdict in a few sentences, and how its numbers are to be read."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterator, Sequence

from analytic.mechanism import Mechanism
from analytic.mechanism.one_line import capital, count
from compare.quantities import number, plain
from compare.report.summary import REAL, ShownDiscrepancy, ShownRun, Summary, abscissa
from compare.results.crosscheck import Run

VERDICT_WORDS = {
    "agrees": "agrees",
    "disagrees": "disagrees",
    "known": "known difference",
    "unjudged": "not judged",
    "failed": "failed",
}
METRICS_BRIEFLY = (
    "E is simulated less recorded, u_val its standard uncertainty by noise or rounding, steps, recorded motion and"
    " [tolerances]; the mean error of the model lies in its interval with 95 %, if nothing else errs"
)
METRICS_MEAN = (
    "In the manner of ASME V&V 20: E is simulated less recorded, in a recorded run by the analytic side; u_D is the"
    " standard uncertainty of a reading (its sensor's noise where measured data say it, or else rounding), u_num of an"
    " engine's steps (the analytic side has none), u_input of the recorded motion that is followed and of [tolerances],"
    " u_val of them together. The mean error of the model lies in the interval with 95 %. The area metric is the area"
    " between the distributions of simulated and recorded values."
)
NUMERICAL_MEANS = (
    "what the length of the engine's steps may make of a difference, with 95 %, by the grid convergence index of steps,"
    " half and quarter steps; order: by which it falls with the step, - where rounding is all there is. A difference"
    " beyond its tolerance that is smaller than 2 u_num is not judged. At rest nothing steps"
)
VERDICT_SIGNS = {"agrees": "✓", "disagrees": "✗", "known": "≈", "unjudged": "?", "failed": "✗"}
MODEL_WORDS = {
    "first_order": "first order (Eq. 8: ideal reaction directions)",
    "equilibrium": "equilibrium (displaced linkage, self-consistent)",
}


def headline(summary: Summary, say: Callable[..., str] = number) -> str:
    """The verdict in a few sentences: runs that failed or are not judged, comparisons that disagree, and the worst (or
    closest) by its tolerance; and what the engines' statistics of contact say of each other.
    """
    if not summary.runs:
        return "No simulation came to its end: nothing was compared."
    sentences = (*_left(summary), *_sentences(summary.runs, say), summary.contact.headline(say))
    return " ".join(filter(None, sentences))


def _left(summary: Summary) -> Iterator[str]:
    """How many runs have no result."""
    failed, stopped = len(summary.failures), len(summary.stopped)
    of = count(failed + stopped + len(summary.runs), "run")
    if failed:
        yield f"{failed} of {of} failed."
    if stopped:
        yield f"{stopped} of {of} {'was' if stopped == 1 else 'were'} stopped before the end."


def _sentences(runs: Sequence[ShownRun], say: Callable[..., str]) -> Iterator[str]:
    rows = [(shown.run, row) for shown in runs for row in shown.rows]
    wrong = [(run, row) for run, row in rows if row.verdict == "disagrees"]
    exceeding = [(run, row) for run, row in wrong if not row.reason]
    otherwise = [(run, row) for run, row in wrong if row.reason]
    agreeing = [(run, row) for run, row in rows if row.verdict == "agrees"]
    hidden = [(run, row) for run, row in rows if row.verdict == "unjudged"]
    known = len(rows) - len(wrong) - len(agreeing) - len(hidden)
    silent = [shown.run for shown in runs if shown.run.reason or not shown.rows]
    if silent:
        why = f"; {silent[0].title}: {silent[0].reason}" if silent[0].reason else ""
        yield f"Nothing could be compared in {len(silent)} of {count(len(runs), 'run')}{why}."
    if exceeding:
        yield f"{_share(exceeding, runs)} {'exceeds its' if len(exceeding) == 1 else 'exceed their'} tolerance."
    elif agreeing and not wrong:
        compared = sum(bool(shown.rows) for shown in runs)
        all_of = f"All {len(agreeing)} judged comparisons" if len(agreeing) > 1 else "The one judged comparison"
        verb = "are" if len(agreeing) > 1 else "is"
        yield f"{all_of} of {count(compared, 'run')} {verb} within tolerance."
    if known:
        yield f"{known} of {count(len(rows), 'comparison')} {'differs' if known == 1 else 'differ'} as known."
    if hidden:
        run, row = hidden[0]
        first = "is" if len(hidden) == 1 else "are"
        yield f"{_share(hidden, runs)} {first} not judged: {row.quantity.label} ({run.title}): {row.reason}."
    if exceeding:
        yield f"Worst: {_most(exceeding, say)}."
    elif agreeing and not wrong:
        yield f"Closest to it: {_most(agreeing, say)}."
    if otherwise:
        run, row = otherwise[0]
        first = "disagrees:" if len(otherwise) == 1 else "disagree, the first being"
        yield f"{_share(otherwise, runs)} {first} {row.quantity.label} ({run.title}): {row.reason}."


def _share(some: Sequence[tuple[Run, ShownDiscrepancy]], runs: Sequence[ShownRun]) -> str:
    rows, of_runs = sum(len(shown.rows) for shown in runs), len({id(run) for run, _ in some})
    return f"{len(some)} of {count(rows, 'comparison')} in {of_runs} of {count(len(runs), 'run')}"


def _most(rows: Sequence[tuple[Run, ShownDiscrepancy]], say: Callable[..., str]) -> str:
    """The row that uses up most of its tolerance, in words."""
    run, row = max(rows, key=lambda pair: pair[1].share or 0.0)
    unit = row.quantity.unit
    return (
        f"{row.quantity.label} ({run.title}), {say(row.maximum, 3, True)} {unit} at {row.at}, tolerance"
        f" {say(row.tolerance)} {unit}"
    )


def why(summary: Summary) -> str:
    """Each assumption of the analytic model that fails, in a sentence: of the run with the most real joints, and in how
    many others; empty where none is known to.
    """
    by_assumption: dict[str, list[str]] = {}
    for run in sorted(summary.result.runs, key=lambda run: REAL.index(run.joint_model)):
        if run.because is not None:
            by_assumption.setdefault(run.because.assumption, []).append(f"{capital(run.because.words)} ({run.title}")
    return " ".join(_with_others(first, len(others)) for first, *others in by_assumption.values())


def _with_others(first: str, others: int) -> str:
    return first + (f", and likewise in {count(others, 'other run')})." if others else ").")


def rows(
    by_engine: Sequence[tuple[str, Sequence[ShownRun]]], joint_model: str, signal: str
) -> list[ShownDiscrepancy | None]:
    """The row of a signal in each engine's run of a joint model; None where there is none."""
    runs = [next((one for one in of if one.run.joint_model == joint_model), None) for _, of in by_engine]
    return [shown.row(signal) if shown else None for shown in runs]


def row_sentence(row: ShownDiscrepancy) -> str:
    """A row in words, ASCII but for names: ``reaction angle at B: +0.2 deg at 30 deg, rms 0.1 deg (tolerance 0.05
    deg)``.
    """
    unit = row.quantity.unit.replace("·", ".")
    numbers = (
        f"{plain(row.maximum, 4, True)} {unit} at {row.at}, rms {plain(row.rms)} {unit} (tolerance"
        f" {plain(row.tolerance)} {unit})"
    )
    return f"{row.quantity.label}: {numbers}" + (f"; {row.reason}" if row.reason else "")


def to_look(run: Run, row: ShownDiscrepancy) -> str:
    """The command that shows both sides of a row where they differ most, ``{file}`` for the result.json; empty where
    they differ nowhere in particular.
    """
    at, of_run = row.at.partition(" ")[0], ["--simulator", run.simulator.name, "--joint", run.joint_model]
    words = shlex.join(["--signal", row.quantity.signal, "--at", at, *of_run])
    return f"compare show {{file}} {words}" if at != "-" else ""


def frame_and_signs(mechanism: Mechanism) -> str:
    """On which body each force acts, and from where an angle counts, for a reader of the numbers."""
    pairs = ", ".join(f"{j.name} of {j.bodies[0]} on {j.bodies[1]}" for j in mechanism.joints)
    return (
        f"Reactions are forces at {pairs}, in the ground frame; a displacement in a joint is the first body's pin"
        " centre minus the second's. Angles count counter-clockwise from the ground's x axis, and"
        f" {_of_motors(mechanism)}."
    )


def _of_motors(mechanism: Mechanism) -> str:
    """On what the motors act."""
    if mechanism.cranked:
        return f"the drive torque is the motor's on the {mechanism.driven}"
    ends = [mechanism.joint(drive.joint) for drive in mechanism.drives]
    acting = ", ".join(f"in {joint.name} on {joint.bodies[1]}" for joint in ends)
    return f"a motor's torque or force is that of its joint's first body on its second ({acting})"


def motion(run: Run, mechanism: Mechanism) -> str:
    """How a run moved."""
    if not abscissa(run, mechanism).of_time:
        return run.motion
    if run.motion == "static":
        return "static over time"
    moved = [drive.speed for drive in mechanism.drives if drive.speed != "free"]
    if not moved:
        return "swings freely"
    if any(speed == "measured" for speed in moved) or not run.drive_position:
        return "follows a recorded course"
    return "driven over time"


def same_order(runs: Sequence[Run]) -> str:
    """What is said where no run has a difference between first order and equilibrium."""
    if any(run.clearance for run in runs):
        return "First order and equilibrium cannot be compared: the analytic model has no answer at any crank angle."
    return "Without clearance first order and equilibrium are the same."

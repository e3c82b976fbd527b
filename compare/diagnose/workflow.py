"""The diagnosis from end to end: from measured data to where they disagree with the model, and what it lacks."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

from threadpoolctl import threadpool_limits

from analytic.compiled.run import in_bulk
from analytic.mechanism import MechanismWarning
from analytic.mechanism.errors import quoted
from compare.arguments import modelling, noted, one_engine, warn_of_friction
from compare.diagnose.data.measured import data_of, once
from compare.diagnose.data.recording import Measured
from compare.diagnose.effects.effect import Effect
from compare.diagnose.explanation import Explanation
from compare.diagnose.prepare import on_one_turn
from compare.diagnose.problem import Options, Problem, Verified
from compare.diagnose.propose.adopted import Unadoptable, adopted
from compare.diagnose.propose.document import as_proposed
from compare.diagnose.propose.proposal import Proposal, proposal, simpler
from compare.diagnose.rattle.contact import asked
from compare.diagnose.rattle.explained import note_unjudged, rattling
from compare.diagnose.result import as_document
from compare.diagnose.validation import parted, validated
from compare.diagnose.warrant import warranted
from compare.faults import ArgumentError
from compare.omissions import Asked, omitted
from compare.progress import progress_bar
from compare.questions.diagnose import DiagnoseQuestion
from compare.questions.question import answers
from compare.results.diagnosis import Diagnosis

MANY = 4  # named effects that explain: one unknown at one place may be simpler


@contextmanager
def _trying() -> Iterator[None]:
    """Many linkages of few samples each: without the warnings about the sizes of links that a fit only tries, and
    without threads of linear algebra, which take three times the processor's time for matrices as small.
    """
    with warnings.catch_warnings(), in_bulk(), threadpool_limits(limits=1, user_api="blas"):
        warnings.simplefilter("ignore", MechanismWarning)
        yield


@_trying()
@answers(DiagnoseQuestion)
def diagnose(question: DiagnoseQuestion) -> Diagnosis:
    """Find which effects the data want that the mechanism lacks.

    ``measured`` is a recording, or the path of a measured.toml (or of its folder).  ``only`` and ``exclude`` are
    ``effect`` or ``effect@where``.  After ``budget`` seconds the search ends with the best so far, and the result says
    so.

    Raises ArgumentError, MeasuredError for data that cannot be what they say, Unsupported or SimulatorMissing for the
    simulator, SimulationError where it fails on the nominal mechanism.
    """
    own, measured = question.own, question.measured
    if not isinstance(own, Sequence) or not all(isinstance(each, Effect) for each in own):
        raise ArgumentError("own", f"{quoted(own)} cannot be used; give a list of effects")
    with progress_bar(question.progress) as told:
        options = Options(
            modelling(one_engine(question.simulator)),
            tuple(question.only),
            tuple(question.exclude),
            own,
            bool(question.others),
            question.workers,
            told,
            question.budget,
        )
        data = data_of(measured)
        return _with_adopted(data, options) if question.adopt else diagnosis_of(data, options)[0]


def _with_adopted(data: Measured, options: Options) -> Diagnosis:
    """A diagnosis, made again with what the first one proposes."""
    first, best = diagnosis_of(data, options)
    if best is None:
        return first.model_copy(update={"notes": (*first.notes, "Nothing is proposed that could be adopted.")})
    try:
        effect = adopted(best)
    except Unadoptable as error:
        return _marked(first, not_adopted=str(error))
    only = (*options.only, effect.name) if options.only else ()
    again = diagnosis_of(data, replace(options, own=(*options.own, effect), only=only))[0]
    if effect.name not in {e.name for e in again.effects}:
        return _marked(first, not_adopted="as an effect among the others it does not pass their tests")
    return again.model_copy(update={"proposed": (*_marked(first, adopted=True).proposed, *again.proposed)})


def _marked(result: Diagnosis, **said: object) -> Diagnosis:
    """A diagnosis that says of what it proposes whether it was adopted."""
    return result.model_copy(update={"proposed": tuple(p.model_copy(update=said) for p in result.proposed)})


def diagnosis_of(given: Measured, options: Options) -> tuple[Diagnosis, Proposal | None]:
    """A diagnosis, and what it proposes as an object; made again without an effect with which the engine moves in
    another way than the analytic model, where its gap grows with that.
    """
    data, unfitted = parted(on_one_turn(once(given)))
    rigid = data.mechanism.rigid()
    with noted() as warned:
        warn_of_friction(data.mechanism, "contact", "driven")
    warned += omitted(data.mechanism, Asked("diagnose", "driven", ("contact",), data.mechanism.bends))
    data, rigid = replace(data, mechanism=data.mechanism.replace(initial={})), rigid.replace(initial={})
    problem = Problem.of(data, rigid, options)
    explanation = _explained(problem)
    if rigid != data.mechanism and not rigid.cranked:
        problem.notes.append(
            "The links' stated moduli of elasticity are left out: links that bend are of linkages that one crank moves."
        )
    elif rigid != data.mechanism and explanation.statistics is None and problem.shows_bending(data.mechanism):
        bending = Problem.of(data, data.mechanism, options)
        instead = _explained(bending)
        nearer = bending.evidence > problem.evidence
        problem, explanation = (bending, instead) if nearer else (problem, explanation)
        problem.notes.append(
            f"The links' stated moduli of elasticity are {'used' if nearer else 'left out'}: that explains the data"
            " with less."
        )
    if (attempt := problem.astray(explanation)) is not None:
        return diagnosis_of(given, replace(options, astray=(*options.astray, attempt)))
    problem.notes += warned
    found = problem.verified(explanation)
    best = proposed(problem, found)
    told = () if best is None else (as_proposed(best),)
    kept = validated(problem, found, unfitted)
    result = as_document(problem, found, kept, told)
    return warranted(result, problem.mechanism, problem.options.vocabulary, unfitted, kept), best


def _explained(problem: Problem) -> Explanation:
    """What the data say: by their statistics where the rig rattles, else sample by sample."""
    problem.options.progress("search", 1, 4)
    laws = asked(problem.terms, problem.ruled_out)  # with clearance the nominal mechanism may rattle itself
    if not laws:
        note_unjudged(problem)
    rattled = rattling(problem) if laws or not problem.overstated else None
    return rattled or problem.explanation()


def proposed(problem: Problem, found: Verified) -> Proposal | None:
    """A place and a law for what an explanation leaves, or in place of one of many effects; none where it is simple and
    leaves nothing, or the time is over.
    """
    e = found.explanation
    if problem.options.late() or problem.inference is None or not problem.mechanism.cranked:
        return None  # its laws are of a crank's angle, and solved for sample by sample
    if any(run.push is not None for run in problem.measured.runs):
        return None  # nor of what moves by its motor's torque, in pieces
    if e.verdict in ("unexplained", "partly explained"):
        return proposal(problem.model, problem.inference.plain, e.fit)
    return simpler(problem.model, problem.inference.plain, e.fit) if len(e.named) >= MANY else None

"""A plan from end to end: what a rig can do, what each run would tell, the best of them, and what they leave open."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np

from analytic.mechanism import MechanismWarning
from analytic.mechanism.assumed import assumed
from compare.arguments import noted
from compare.diagnose.data.recording import MeasuredRun
from compare.diagnose.experiment_design import as_toml
from compare.diagnose.plan.bench import read_bench
from compare.diagnose.plan.design import Chooser, Chosen
from compare.diagnose.plan.foretell import Known, combinations, groups, known
from compare.diagnose.plan.information import CAREFUL, Outcomes, outcomes, products
from compare.diagnose.plan.pool import CandidateRun, Pool, Suspect, pool
from compare.diagnose.posterior.prior import CREDIBLE
from compare.diagnose.predict import Term
from compare.omissions import Asked, omitted
from compare.progress import Progress, progress_bar
from compare.questions.plan import RUNS, PlanQuestion
from compare.questions.question import answers
from compare.results import plan as results
from compare.results.diagnosis import EffectPlace
from compare.results.plan import Plan
from compare.versions import versions

THOROUGH = 32  # outcomes of each effect at a place, for what is reported
USUAL = (1.0,)  # times its natural size


@answers(PlanQuestion)
def plan(question: PlanQuestion) -> Plan:
    """Plan the runs and the sensors that would tell which effect a mechanism lacks, before any data exist.

    ``rig`` is a mechanism, or the path of a plan.toml, whose ``[rig]`` says which speeds, loads and sensors there are
    and what they cost; or a recording, whose speeds and sensors the rig then has.  What is foretold is of one effect
    that is missing, to first order about the nominal mechanism, by the analytic model alone.

    Raises MechanismError, MeasuredError or ArgumentError.
    """
    with noted() as warned, progress_bar(question.progress) as told, warnings.catch_warnings():
        warnings.simplefilter("ignore", MechanismWarning)  # of mechanisms that are only tried
        assert not isinstance(question.sensors, str)  # the question has read it
        bench = read_bench(question.rig, question.sensors, question.budget, RUNS)
        every = pool(bench, told)
        best = Chooser(every, told).best()
        warned += omitted(bench.mechanism, Asked("plan", "driven", ("contact",), bench.mechanism.bends))
        return _document(every, best, tuple(warned), told)


def _document(every: Pool, best: Chosen, warned: tuple[str, ...], told: Progress) -> Plan:
    """The plan as its document."""
    bench, made = every.bench, [every.runs[i] for i in best.runs]
    told("what the data would tell", 0, None)
    these = products(every, best.runs, best.sensors)
    any_size, usual = outcomes(these, THOROUGH), outcomes(these, THOROUGH, USUAL)
    terms = [_likeliest(these.suspects, key) for key in these.keys]
    intervals = known(every, best.runs, best.sensors, [t for t in terms if t not in every.hidden], told)
    effects = [_effect(term, i, any_size, usual, intervals.get(term)) for i, term in enumerate(terms)]
    hidden = [t.key for t in every.hidden]
    return Plan(
        case=bench.mechanism.name,
        mechanism=bench.mechanism,
        versions=versions(),
        runs=tuple(_run(run) for run in made),
        sensors=tuple(
            results.PlannedSensor(
                signal=s.signal,
                unit=every.measured.signals[s.signal].unit,
                noise=s.noise,
                price=s.price,
                used=s.signal in best.sensors,
            )
            for s in bench.sensors
        ),
        steps=tuple(_steps(every, best, told)),
        budget=bench.budget,
        spent=best.spent,
        possible_runs=len(every.runs),
        bits=any_size.bits,
        possible_bits=any_size.possible,
        told=any_size.told,
        told_if_usual=usual.told,
        effects=tuple(effects),
        groups=tuple(tuple(EffectPlace(name=n, where=w) for n, w in group) for group in groups(usual)),
        combinations=tuple(
            tuple(
                results.CombinedEffect(
                    name=term.effect.name,
                    where=term.where,
                    parameter=parameter,
                    unit=term.effect.unit(every.rig, term.where, parameter),
                    value=value,
                )
                for (term, parameter), value in one.items()
            )
            for one in combinations(every, products(every, best.runs, best.sensors, careful=0.0))
        ),
        hidden=tuple(EffectPlace(name=n, where=w) for n, w in dict.fromkeys(hidden)),
        careful=CAREFUL,
        template=_template(made, {s.signal: s.noise for s in bench.sensors if s.signal in best.sensors}),
        taken=bench.assumed,
        warnings=warned,
        assumed=assumed(bench.mechanism),
    )


def _likeliest(suspects: Sequence[Suspect], key: tuple[str, str]) -> Term:
    """Of an effect at a place the variant that is likeliest."""
    own = [s for s in suspects if s.term.key == key]
    return max(own, key=lambda s: s.odds).term


def _effect(term: Term, i: int, any_size: Outcomes, usual: Outcomes, one: Known | None) -> results.PlannedEffect:
    """What the planned data would make of an effect at a place."""
    shares = usual.named[i]
    rivals = [j for j in np.argsort(-shares[:-2]).tolist() if j != i and shares[j] >= CREDIBLE]
    return results.PlannedEffect(
        name=term.effect.name,
        where=term.where,
        told=_share(any_size.named[i, i]),
        told_if_usual=_share(shares[i]),
        of_sensor=_share(shares[-2]),
        unseen=_share(shares[-1]),
        instead=tuple(
            results.Instead(name=usual.keys[j][0], where=usual.keys[j][1], share=_share(shares[j])) for j in rivals
        ),
        parameters={} if one is None else _parameters(one),
    )


def _share(value: float) -> float:
    return min(max(float(value), 0.0), 1.0)


def _parameters(one: Known) -> dict[str, results.Foretold]:
    """Intervals as the document has them."""
    return {
        name: results.Foretold(
            value=alone.value,
            unit=alone.unit or "1",
            low=alone.low,
            high=alone.high,
            careful_low=one.careful[name].low,
            careful_high=one.careful[name].high,
        )
        for name, alone in one.alone.items()
    }


def _run(candidate: CandidateRun) -> results.PlannedRun:
    run = candidate.run
    assert run.speed is not None  # every candidate is driven
    assert run.angle is not None
    return results.PlannedRun(
        name=run.name,
        speed=run.speed,
        angle=run.angle,
        duration=candidate.duration,
        samples=candidate.samples,
        loading=candidate.loading.name,
        loads=run.loads,
        price=candidate.price,
    )


def _steps(every: Pool, best: Chosen, told: Progress) -> list[results.PlanStep]:
    """What each part adds, in the order in which they are worth most."""
    free = {s.signal for s in every.bench.sensors if not s.price}
    price = {s.signal: s.price for s in every.bench.sensors}
    found = []
    for k, step in enumerate(best.steps):
        told("what each run and sensor adds", k, len(best.steps))
        parts = [each.part for each in best.steps[: k + 1]]
        runs = [part for part in parts if isinstance(part, int)]
        sensors = [s for s in best.sensors if s in free or s in parts]
        now = outcomes(products(every, runs, sensors), THOROUGH) if runs and sensors else None
        of_run = every.runs[step.part] if isinstance(step.part, int) else None
        found.append(
            results.PlanStep(
                kind="sensor" if of_run is None else "run",
                name=str(step.part) if of_run is None else of_run.run.name,
                price=price[str(step.part)] if of_run is None else of_run.price,
                bits=now.bits if now else 0.0,
                told=_share(now.told) if now else 0.0,
            )
        )
    return found


def _template(made: Sequence[CandidateRun], noise: dict[str, float]) -> str:
    """A measured.toml in which the runs stand ready."""
    sigmas = ", ".join(f"{name} = {size!r}" for name, size in noise.items())
    head = (
        "# Runs as planned; record each into its file, with a column for time [s] and one for each sensor.\n"
        "# Then: compare diagnose measured.toml\n"
        'mechanism = "nominal.toml"\n'
    )
    return "\n".join([head, *(f"{_entry(each, sigmas)}\n" for each in made)])


def _entry(candidate: CandidateRun, sigmas: str) -> str:
    """A run as a [[run]], with its samples and noise."""
    run: MeasuredRun = candidate.run
    step = candidate.duration / max(candidate.samples - 1, 1)
    name, *rest = as_toml(run).splitlines()
    at = next((k for k, line in enumerate(rest) if line.startswith(("[[run.load]]", "load ="))), len(rest))
    said = f"# {candidate.samples} samples, one every {step:.6g} s, for {candidate.duration:.6g} s"
    return "\n".join([name, said, *rest[:at], f"noise = {{ {sigmas} }}", *rest[at:]])

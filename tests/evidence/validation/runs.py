"""What the validation report holds: every shipped case in the engines, and what the paper's two approximations cost."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from analytic.kinematics.assembly import Assembly
from analytic.mechanism.file import load, shipped_cases
from analytic.paper.clearance import displaced
from analytic.paper.superposition import total_displacement
from compare.arguments import cores
from compare.baseline.runs import Setup, not_run, setups
from compare.crosscheck import Job, crosscheck_job
from compare.judge.tolerances import Tolerances, load_tolerances
from compare.results.crosscheck import CrossCheck
from compare.results.crosscheck import Run as Compared
from sim_models.engine import JOINT_MODELS, JointModel, declared, installed_version
from tests.evidence.published.after_impact import after_impact
from tests.evidence.results.validation import FirstOrder, Superposed, Validation, ValidationRun
from tests.evidence.validation.bending import bending
from tests.evidence.validation.files import carried
from tests.evidence.validation.guides import CASE as GUIDED
from tests.evidence.validation.guides import guided
from tests.evidence.validation.laws import laws_found
from tests.evidence.validation.published import published
from tests.evidence.validation.rebounds import rebounds
from tests.evidence.validation.scales import Scale, scale_rows
from tests.evidence.validation.speed import timed
from tests.evidence.validation.striking import CHECKED, LAWS, MORE, striking
from tests.evidence.validation.workspaces import SPIRALS, in_engines, workspaces

DRAWN: JointModel = "contact"  # what the figures show
GAPS = (1e-2, 1e-3, 1e-4)  # m, of the paper's case
PINS = (("crank", "A"), ("coupler", "com"), ("coupler", "B"), ("follower", "B"))
BEAM_ANGLES = (20.0, 30.0, 60.0, 90.0, 120.0, 160.0)  # deg


def run_all(names: tuple[str, ...], which: Sequence[Scale], data: Path | None, whole: bool) -> Validation:
    """Every shipped case in these engines, as the baselines set it up; one linkage at these scales; how far Eq. 8 and
    superposition are off, also over the workspaces of platforms; published figures, with those of the folder ``data``.

    Unless ``whole``, the engines move one platform alone, what takes minutes is left out of the published figures, no
    law of contact is looked for, and nothing is timed.
    """
    tolerances = load_tolerances()
    rows: list[ValidationRun] = []
    checks: dict[str, CrossCheck] = {}
    for case, setup, result in cross_checks(names, tolerances):
        rows += told(case, setup.name, result)
        if setup.request.joint_model == DRAWN:
            checks[case] = result
    for name, result in guided(names, tolerances):
        rows += told(GUIDED, name, result)
    found = Validation(
        versions={name: installed_version(declared(name).package) for name in names},
        runs=tuple(rows),
        scales=tuple(scale_rows(names, which, cores())),
        first_order=first_order(),
        superposition=superposition() if "exudyn" in names else (),
        workspaces=workspaces(),
        in_engines=in_engines(names, tuple(SPIRALS) if whole else tuple(SPIRALS)[:1]),
        bent=bending(names),
        carried=carried(names),
        struck=striking(names, LAWS, MORE) if whole else striking(names, (CHECKED,)),
        delivered=rebounds(names, LAWS if whole else (CHECKED,)),
        published=published(names, data, whole),
        ended=tuple(after_impact(names, data, whole)),
        laws=tuple(laws_found(names)) if whole else (),
        speed=timed() if whole else (),
    )
    found.checks.update(checks)
    return found


def cross_checks(
    names: Sequence[str],
    tolerances: Tolerances,
    cases: Iterable[str] = (),
    models: Collection[JointModel] = JOINT_MODELS,
) -> Iterator[tuple[str, Setup, CrossCheck]]:
    """These cases, or every shipped one, with these joint models in these engines, as the baselines set them up."""
    for case in cases or shipped_cases():
        for setup in setups(load(case)):
            r = setup.request
            engines = tuple(n for n in names if not not_run(n, declared(n), r))
            if setup.impacting or r.joint_model not in models or not engines:
                continue  # nothing to hold an impacting run to but another engine: the baselines do
            workers = min(len(engines), cores())
            job = Job(r.mechanism, engines, tolerances, r.schedule, r.joint_model, workers=workers)
            yield case, setup, crosscheck_job(job)


def told(case: str, name: str, result: CrossCheck) -> list[ValidationRun]:
    """The lines of the report that a cross-check gives."""
    failed = [(f.simulator, f"failed: {f.why}") for f in result.failures]
    return [row(case, name, run) for run in result.runs] + [
        ValidationRun(case=case, run=name, simulator=simulator, verdict=why) for simulator, why in failed
    ]


def row(case: str, name: str, run: Compared) -> ValidationRun:
    """One line of the report: the verdict, and the signal that uses up most of its tolerance."""
    head = ValidationRun(case=case, run=name, simulator=run.simulator.name, verdict=run.verdict)
    if not run.discrepancies:
        return head
    worst = max(run.discrepancies, key=lambda d: d.share or 0.0)
    share = float(f"{worst.share or 0.0:.1g}")
    return head.model_copy(update={"signals": len(run.discrepancies), "closest": worst.signal, "share": share})


def first_order() -> tuple[FirstOrder, ...]:
    """How far the paper's Eq. 8 is from its self-consistent completion on the paper's case, 20 to 160 deg."""
    assembly, theta = Assembly(load("paper")), np.radians(np.arange(20.0, 160.5, 0.5))
    rows = []
    for gap in GAPS:
        found = displaced(assembly, theta, 1.0, inertia=False, clearances={"B": gap})
        ratio = found.reactions.forces["B"] / found.ideal.forces["B"]
        rows.append(
            FirstOrder(
                clearance=gap,
                angle=float(np.degrees(np.abs(np.angle(ratio))).max()),
                magnitude=float(np.abs(np.abs(ratio) - 1).max()),
            )
        )
    return tuple(rows)


def superposition() -> tuple[Superposed, ...]:
    """Error of Fig. 7c's superposition on the paper's case, against beams with a real clearance joint at the same time.

    The largest error of any pin's or the coupler's middle's displacement, relative to the largest displacement; the row
    without clearance is compliance alone, whose error is the matrix's linearity.
    """
    from tests.evidence.validation.beam_equilibrium import flexible_static  # only where Exudyn is installed

    rows = []
    for gap in (0.0, *reversed(GAPS)):
        mechanism = load("paper").with_clearances({"B": gap} if gap else {})
        for degrees in BEAM_ANGLES:
            theta = np.radians([degrees])
            both = flexible_static(mechanism, float(theta[0]), joint_model="contact" if gap else "ideal").displacement
            largest = max(abs(both[point]) for point in PINS)
            errors = {}
            for model in ("first_order", "equilibrium"):
                total = total_displacement(Assembly(mechanism), theta, model=model)
                errors[model] = max(float(abs(total.displacement(*point)[0] - both[point])) for point in PINS) / largest
            rows.append(Superposed(clearance=gap, crank_angle=float(theta[0]), **errors))
    return tuple(rows)

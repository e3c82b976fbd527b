"""What the validation report holds: every shipped case in the engines, and what the paper's two approximations cost."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from compare.arguments import cores
from compare.evidence.validation.scales import Scale, scale_rows
from compare.results.crosscheck import CrossCheck, Run

GAPS = (1e-2, 1e-3, 1e-4)  # m, of the paper's case
PINS = (("crank", "A"), ("coupler", "com"), ("coupler", "B"), ("follower", "B"))
BEAM_ANGLES = (20.0, 30.0, 60.0, 90.0, 120.0, 160.0)  # deg


def run_all(names: tuple[str, ...], which: Sequence[Scale]) -> dict[str, Any]:
    """Every shipped case in these engines, as the baselines set it up; one linkage at these scales; how far Eq. 8 and
    superposition are off.
    """
    from analytic.mechanism.file import load, shipped_cases
    from compare.crosscheck import Job, crosscheck_job
    from compare.evidence.baseline.runs import setups
    from compare.judge.discrepancy import load_tolerances
    from sim_models.engine import declared, installed_version

    tolerances = load_tolerances()
    rows: list[dict[str, Any]] = []
    drawings: dict[str, str] = {}
    for case in shipped_cases():
        for setup in setups(load(case)):
            if setup.impacting:
                continue  # nothing to hold an impacting run to but another engine: the baselines do
            r = setup.request
            engines = tuple(n for n in names if (r.joint_model, r.motion) in declared(n).supports)
            workers = min(len(engines), cores())
            job = Job(r.mechanism, engines, tolerances, r.motion, r.crank_angle, r.time, r.joint_model, workers=workers)
            result = crosscheck_job(job)
            rows += [row(case, setup.name, run) for run in result.runs]
            rows += [
                {"case": case, "run": setup.name, "simulator": f.simulator, "verdict": f"failed: {f.why}"}
                for f in result.failures
            ]
            if r.joint_model == "contact":
                drawings |= {f"{case}-{name}.svg": drawing for name, drawing in drawn(result).items()}
    versions = {name: installed_version(declared(name).package) for name in names}
    beams = superposition() if "exudyn" in names else []
    sized = scale_rows(names, which, cores())
    approximations = {"first_order": first_order(), "superposition": beams}
    return {"schema": 1, "versions": versions, "runs": rows, "scales": sized, **approximations, "figures": drawings}


def row(case: str, name: str, run: Run) -> dict[str, Any]:
    """One line of the report: the verdict, and the signal that uses up most of its tolerance."""
    if not run.discrepancies:
        return {"case": case, "run": name, "simulator": run.simulator.name, "verdict": run.verdict}
    worst = max(run.discrepancies, key=lambda d: d.share or 0.0)
    return {
        "case": case,
        "run": name,
        "simulator": run.simulator.name,
        "verdict": run.verdict,
        "signals": len(run.discrepancies),
        "closest": worst.signal,
        "share": float(f"{worst.share or 0.0:.1g}"),
    }


def drawn(result: CrossCheck) -> dict[str, str]:
    """SVG drawings of a result: the linkage, and the reaction directions at its first joint with clearance."""
    from compare.report.figures import reaction_directions
    from compare.report.linkage import linkage_figure
    from compare.report.summary import summarise
    from compare.report.svg import draw

    summary = summarise(result)
    linkage = linkage_figure(result, summary)
    found = {"gamma": draw(reaction_directions(result, summary, summary.joints[0]))}
    return found | ({"linkage": draw(linkage)} if linkage else {})


def first_order() -> list[dict[str, float]]:
    """How far the paper's Eq. 8 is from its self-consistent completion on the paper's case, 20 to 160 deg."""
    import numpy as np

    from analytic.kinematics.assembly import Assembly
    from analytic.mechanism.file import load
    from analytic.paper.clearance import displaced

    assembly, theta = Assembly(load("paper")), np.radians(np.arange(20.0, 160.5, 0.5))
    rows = []
    for gap in GAPS:
        found = displaced(assembly, theta, 1.0, inertia=False, clearances={"B": gap})
        ratio = found.reactions.forces["B"] / found.ideal.forces["B"]
        rows.append(
            {
                "clearance": gap,
                "angle": float(np.degrees(np.abs(np.angle(ratio))).max()),
                "magnitude": float(np.abs(np.abs(ratio) - 1).max()),
            }
        )
    return rows


def superposition() -> list[dict[str, float]]:
    """Error of Fig. 7c's superposition on the paper's case, against beams with a real clearance joint at the same time.

    The largest error of any pin's or the coupler's middle's displacement, relative to the largest displacement; the row
    without clearance is compliance alone, whose error is the matrix's linearity.
    """
    import numpy as np

    from analytic.kinematics.assembly import Assembly
    from analytic.mechanism.file import load
    from analytic.paper.superposition import total_displacement
    from sim_models.exudyn.beams import flexible_static

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
            rows.append({"clearance": gap, "crank_angle": float(theta[0]), **errors})
    return rows

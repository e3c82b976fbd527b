"""``compare validation update`` and ``check``: the project's own validation report, every shipped case in every engine.

``reports/README.md`` is written from ``reports/validation.json``, which keeps each run's verdict; ``check`` makes all
runs again and compares the verdicts (that no number moves is what the baselines are for).
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import typer

from compare.faults import Exit, OptionError, complaints
from compare.options import cores

validation = typer.Typer(help="The validation report of the project itself: every shipped case in every engine.", no_args_is_help=True)

Folder = Annotated[Path, typer.Option("--reports", metavar="DIR", help="Folder of the report.")]
WHERE = Path("reports")
GAPS = (1e-2, 1e-3, 1e-4)  # m, of the paper's case
PINS = (("crank", "A"), ("coupler", "com"), ("coupler", "B"), ("follower", "B"))
BEAM_ANGLES = (20.0, 30.0, 60.0, 90.0, 120.0, 160.0)  # deg


@validation.command()
def update(folder: Folder = WHERE) -> None:
    """Run everything and write README.md, validation.json and figures."""
    with complaints():
        from compare.files import output_folder, to_json, write_atomically

        output_folder(folder / "figures")
        found = run_all()
        for name, drawing in found.pop("figures").items():
            write_atomically(folder / "figures" / name, drawing)
        write_atomically(folder / "validation.json", to_json(found, indent=1) + "\n")
        write_atomically(folder / "README.md", page(found))
        typer.echo(f"{len(found['runs'])} runs: {folder / 'README.md'}")


@validation.command()
def check(folder: Folder = WHERE) -> None:
    """Run everything again; exit 1 and say which, where a verdict is not the committed one."""
    with complaints():
        stored = read(folder / "validation.json")
        found = run_all()
        changed = list(differences(stored["runs"], found["runs"]))
        for line in changed:
            typer.echo(line)
        typer.echo(f"{len(found['runs'])} runs, {len(changed)} differ from {folder / 'validation.json'}")
    raise typer.Exit(Exit.DISAGREES if changed else Exit.AGREES)


def read(path: Path) -> dict[str, Any]:
    """A stored report.  Raises OptionError where there is none, or it is damaged."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        if found["schema"] != 1 or not all({"case", "run", "simulator", "verdict"} <= set(run) for run in found["runs"]):
            raise ValueError("not a validation report of schema 1")
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise OptionError(f"--reports: {path} cannot be used ({error}); write it with compare validation update") from None
    return dict(found)


def differences(stored: list[dict[str, Any]], found: list[dict[str, Any]]) -> Iterator[str]:
    """What changed between two lists of runs, a sentence each; engines that are not installed here are left out."""

    def verdicts(runs: list[dict[str, Any]]) -> dict[tuple[str, str, str], str]:
        return {(run["case"], run["run"], run["simulator"]): run["verdict"] for run in runs}

    before, after = verdicts(stored), verdicts(found)
    here = {simulator for _, _, simulator in after}
    for key in sorted(before.keys() | after.keys()):
        if key[2] in here and before.get(key) != after.get(key):
            yield f"{', '.join(key)}: was {before.get(key, 'not there')}, is {after.get(key, 'not there')}"


def run_all() -> dict[str, Any]:
    """Every shipped case's runs, as the baselines set them up, in every installed engine; and how far Eq. 8 is off."""
    from analytic.mechanism_file import load, shipped_cases
    from compare.baseline.runs import setups
    from compare.crosscheck import Job, crosscheck
    from compare.discrepancy import load_tolerances
    from sim_models.engine import ENGINES, declared, installed_version

    names = tuple(name for name in ENGINES if installed_version(declared(name).package))
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
            result = crosscheck(job)
            rows += [row(case, setup.name, run) for run in result["runs"]]
            rows += [{"case": case, "run": setup.name, "simulator": f["simulator"], "verdict": f"failed: {f['why']}"} for f in result["failures"]]
            if r.joint_model == "contact":
                drawings |= {f"{case}-{name}.svg": drawing for name, drawing in drawn(result).items()}
    versions = {name: installed_version(declared(name).package) for name in names}
    beams = superposition() if "exudyn" in names else []
    return {"schema": 1, "versions": versions, "runs": rows, "first_order": first_order(), "superposition": beams, "figures": drawings}


def row(case: str, name: str, run: dict[str, Any]) -> dict[str, Any]:
    """One line of the report: the verdict, and the signal that uses up most of its tolerance."""
    worst = max(run["discrepancies"], key=lambda d: abs(d["max"]) / d["tolerance"] if d["tolerance"] else 0.0)
    share = abs(worst["max"]) / worst["tolerance"] if worst["tolerance"] else 0.0
    return {
        "case": case, "run": name, "simulator": run["simulator"]["name"], "verdict": run["verdict"],
        "signals": len(run["discrepancies"]), "closest": worst["signal"], "share": float(f"{share:.1g}"),
    }  # fmt: skip


def drawn(result: dict[str, Any]) -> dict[str, str]:
    """SVG drawings of a result: the linkage, and the reaction directions at its first joint with clearance."""
    from compare.files import to_json
    from compare.report.figures import figures
    from compare.report.summary import summarise
    from compare.report.svg import draw

    plain = json.loads(to_json(result))
    found = {figure.name.split("_")[0]: draw(figure) for figure in reversed(figures(plain, summarise(plain)))}
    return {name: drawing for name, drawing in found.items() if name in ("linkage", "gamma")}


def first_order() -> list[dict[str, float]]:
    """How far the paper's Eq. 8 is from its self-consistent completion on the paper's case, 20 to 160 deg."""
    import numpy as np

    from analytic.assembly import Assembly
    from analytic.clearance import displaced
    from analytic.mechanism_file import load

    assembly, theta = Assembly(load("paper")), np.radians(np.arange(20.0, 160.5, 0.5))
    rows = []
    for gap in GAPS:
        found = displaced(assembly, theta, 1.0, inertia=False, clearances={"B": gap})
        ratio = found.reactions.forces["B"] / found.ideal.forces["B"]
        rows.append(
            {"clearance": gap, "angle": float(np.degrees(np.abs(np.angle(ratio))).max()), "magnitude": float(np.abs(np.abs(ratio) - 1).max())}
        )
    return rows


def superposition() -> list[dict[str, float]]:
    """Error of Fig. 7c's superposition on the paper's case, against beams with a real clearance joint at the same time.

    The largest error of any pin's or the coupler's middle's displacement, relative to the largest displacement; the row
    without clearance is compliance alone, whose error is the matrix's linearity.
    """
    import numpy as np

    from analytic.accuracy import total_displacement
    from analytic.assembly import Assembly
    from analytic.mechanism_file import load
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


def page(found: dict[str, Any]) -> str:
    """The report as Markdown."""
    agree = sum(run["verdict"] == "agrees" for run in found["runs"])
    cases = list(dict.fromkeys(run["case"] for run in found["runs"]))
    lines = [
        "# Validation report",
        "",
        f"{agree} of {len(found['runs'])} runs agree with the analytic `equilibrium` within `compare/tolerances.toml`. Engines: "
        + ", ".join(f"{name} {version}" for name, version in found["versions"].items())
        + ". Written by `compare validation update`; CI makes every run again with `compare validation check`, and holds each reaction force "
        "to `reports/baselines/` with `compare baseline check`.",
        "",
        "Each run has its engine's verdict and the largest share of a tolerance that any of its signals uses up. Ideal joints are",
        "driven; joints with clearance rest in equilibrium under load (`compare/baseline/runs.py` says which clearance and load).",
    ]
    for case in cases:
        lines += ["", f"## {case}", "", *_table([run for run in found["runs"] if run["case"] == case])]
        lines += [
            "",
            f"![{case}: ideal and displaced by clearance](figures/{case}-linkage.svg)",
            f"![{case}: directions of the reaction](figures/{case}-gamma.svg)",
        ]
    lines += ["", "## How far the paper's Eq. 8 is off", "", "| clearance in B of the paper's case | direction | size |", "|---|--:|--:|"]
    lines += [f"| {1000 * r['clearance']:g} mm | {r['angle']:.2g} deg | {100 * r['magnitude']:.2g} % |" for r in found["first_order"]]
    if found["superposition"]:
        lines += ["", "## How good superposition is (Fig. 7c)", "", *_superposed(found["superposition"])]
    return "\n".join(lines) + "\n"


def _superposed(rows: list[dict[str, float]]) -> Iterator[str]:
    yield "Clearance and compliance added up, against Exudyn's Euler-Bernoulli beams with a real journal in its bearing, at 50 N: largest"
    yield "error of a pin's or the coupler's middle's displacement over the largest displacement, with `equilibrium` / with `first_order`"
    yield "(Eq. 8). Without clearance what is left is geometric nonlinearity: at 0.5 N it is a hundred times smaller."
    yield ""
    yield "| clearance in B | " + " | ".join(f"{degrees:g} deg" for degrees in BEAM_ANGLES) + " |"
    yield "|---|" + "---|" * len(BEAM_ANGLES)
    for gap in dict.fromkeys(row["clearance"] for row in rows):
        cells = [f"{100 * r['equilibrium']:.2f} / {100 * r['first_order']:.2f} %" for r in rows if r["clearance"] == gap]
        yield f"| {1000 * gap:g} mm | " + " | ".join(cells) + " |"


def _table(runs: list[dict[str, Any]]) -> Iterator[str]:
    engines = list(dict.fromkeys(run["simulator"] for run in runs))
    yield "| run | " + " | ".join(engines) + " |"
    yield "|---|" + "---|" * len(engines)
    for name in dict.fromkeys(run["run"] for run in runs):
        cells = {run["simulator"]: _cell(run) for run in runs if run["run"] == name}
        yield f"| {name} | " + " | ".join(cells.get(engine, "not supported") for engine in engines) + " |"


def _cell(run: dict[str, Any]) -> str:
    return f"{run['verdict']}, at most {100 * run['share']:g} % ({run['closest']})" if "share" in run else run["verdict"]

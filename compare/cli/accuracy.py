"""``compare accuracy``: what clearance and compliance do to the outputs that a user names, over the whole cycle."""

from __future__ import annotations

import math
import shlex
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from compare.cli.folders import Overwrite, result_folder
from compare.cli.options import MotionChoice, listed_once, load_case, metres_by_joint
from compare.faults import OptionError, complaints
from compare.files import output_folder, to_json, write_atomically

if TYPE_CHECKING:
    import numpy as np
    from rich.console import Console

    from analytic.kinematics.assembly import Assembly
    from analytic.mechanism import Mechanism
    from analytic.paper.envelope import Output
    from analytic.paper.superposition import Accuracy

SCHEMA = 1
ROUNDING = 1e-12  # m or rad, below which the table shows nothing


def accuracy(
    context: typer.Context,
    case: Annotated[str, typer.Option(help="Shipped case (see: compare cases) or a mechanism file.")] = "paper",
    clearance: Annotated[
        str | None, typer.Option(metavar="JOINT=M,...", help="Radial clearances (m) in place of the case's own.")
    ] = None,
    clearance_tolerance: Annotated[
        str | None,
        typer.Option(metavar="JOINT=M,...", help="Clearances are uniform within +- this (m) in the Monte Carlo [0]."),
    ] = None,
    output: Annotated[
        list[str] | None,
        typer.Option(
            metavar="POINT_OR_BODY",
            help="coupler, coupler.B, follower.angle, ...; left out, every body's com and angle.",
        ),
    ] = None,
    motion: Annotated[
        MotionChoice | None,
        typer.Option(help="Reactions with inertia forces or without [driven, if the drive has a speed]."),
    ] = None,
    angles: Annotated[str | None, typer.Option(metavar="START:STOP:STEP", help="Crank angles (deg).")] = None,
    samples: Annotated[int, typer.Option(min=2, max=1_000_000, help="Linkages in the Monte Carlo.")] = 20_000,
    seed: Annotated[int, typer.Option(min=0, help="Of the Monte Carlo's random numbers.")] = 0,
    nonlinear: Annotated[bool, typer.Option("--nonlinear", help="Close the linkage again for every sample.")] = False,
    out: Annotated[
        Path | None, typer.Option(help="Folder of accuracy.json [reports/<case>-accuracy, then the options].")
    ] = None,
    overwrite: Overwrite = False,
    json: Annotated[
        bool, typer.Option("--json", help="Print accuracy.json to standard output, and nothing else there.")
    ] = False,
) -> None:
    """Say how accurate a linkage with clearance can be: nominal, worst case, by joint, Monte Carlo, compliance.

    Exit status: 0 computed, 2 bad input.
    """
    with complaints() as caught:
        from analytic.kinematics.assembly import Assembly
        from compare.judge.grid import chosen_angles

        mechanism = load_case(case, clearance)
        folder = result_folder(context, f"{mechanism.name}-accuracy", "accuracy.json", out, overwrite)
        tolerances = (
            metres_by_joint(clearance_tolerance, "--clearance-tolerance", mechanism) if clearance_tolerance else {}
        )
        assembly = Assembly(mechanism)
        result = analyse(
            assembly,
            chosen_angles(assembly, angles),
            named_outputs(output, mechanism),
            tolerances=tolerances,
            inertia=_inertia(motion, mechanism),
            samples=samples,
            seed=seed,
            nonlinear=nonlinear,
        )
        result |= {"command": shlex.join(["compare", *sys.argv[1:]]), "warnings": caught}
        text = to_json(result)
        path = write_atomically(output_folder(folder) / "accuracy.json", text)
        if json:
            typer.echo(text)
            return
        from rich.console import Console

        console = Console(width=None if sys.stdout.isatty() else 110)
        print_table(result, console)
        console.print(f"numbers: {path}", soft_wrap=True, highlight=False)


def named_outputs(names: Sequence[str] | None, mechanism: Mechanism) -> list[Output]:
    """Outputs by name: ``coupler`` (its com and angle), ``coupler.B``, ``coupler.angle``, or a point that only one body
    has.

    Raises OptionError.
    """
    bodies = mechanism.moving
    found: dict[Output, None] = {}
    for name in listed_once(",".join(names), "--output") if names else list(bodies):
        body, _, point = name.partition(".")
        owners = [b for b in bodies if name in bodies[b].points]
        if body not in bodies and len(owners) == 1:
            body, point = owners[0], name
        if body not in bodies:
            why = (
                f"is a point of {' and '.join(owners)}; write {owners[0]}.{name}"
                if owners
                else f"is no body; they are {', '.join(bodies)}"
            )
            raise OptionError(f"--output {name}: {body!r} {why}")
        if point not in ("", "com", "angle", *bodies[body].points):
            raise OptionError(
                f"--output {name}: {body} has no point {point!r}; give com, angle, {', '.join(bodies[body].points)}"
            )
        found |= dict.fromkeys(_outputs_of(body, point))
    return list(found)


def _outputs_of(body: str, point: str) -> list[Output]:
    from analytic.paper.envelope import Output

    place = [] if point == "angle" else [Output(body, "x", point or "com"), Output(body, "y", point or "com")]
    return place + ([Output(body, "angle")] if point in ("", "angle") else [])


def _inertia(motion: MotionChoice | None, mechanism: Mechanism) -> bool:
    if motion is MotionChoice.driven and mechanism.speed is None:
        raise OptionError(
            f"--motion driven: the drive of {mechanism.name} has no constant speed; give it one, or take --motion"
            " static"
        )
    return motion is not MotionChoice.static and mechanism.speed is not None


def analyse(
    assembly: Assembly,
    theta: np.ndarray,
    outputs: Sequence[Output],
    *,
    tolerances: Mapping[str, float],
    inertia: bool,
    samples: int,
    seed: int,
    nonlinear: bool = False,
) -> dict[str, Any]:
    """The content of accuracy.json for a linkage with its own clearances at crank angles theta (N,) rad.

    Raises OptionError where a tolerance exceeds its clearance, ComplianceError where the links cannot carry their
    loads, and AssemblyError.
    """
    import numpy as np

    from analytic.beyond_paper.monte_carlo import Contacts, Population, draw
    from analytic.paper.envelope import transmission
    from analytic.paper.superposition import accuracy as accuracy_of

    mechanism = assembly.mechanism
    for joint, tolerance in tolerances.items():
        if tolerance > mechanism.joint(joint).clearance:
            limit = f"the joint's clearance, {mechanism.joint(joint).clearance:g} m"
            raise OptionError(
                f"--clearance-tolerance {joint}={tolerance:g}: is more than {limit}; a clearance cannot be negative"
            )
    found = accuracy_of(assembly, theta, outputs, mechanism.clearances, mechanism.speed or 1.0, inertia)
    drawn = draw(found.clearances, np.array([tolerances.get(pin, 0.0) for pin in found.pins]), samples, seed)
    population = Population(
        assembly, found.total.clearance.ideal.motion, found.path, found.unit_reactions, found.directions
    )
    kinds: tuple[Contacts, ...] = ("free", "along reactions")
    spreads = {kind.replace(" ", "_"): population.distribution(drawn, kind, nonlinear) for kind in kinds}
    return {
        "schema": SCHEMA,
        "case": mechanism.name,
        "mechanism": mechanism.model_dump(by_alias=True, exclude_none=True, exclude_unset=True, mode="json"),
        "versions": _versions(),
        "motion": "driven" if inertia else "static",
        "clearance": dict(mechanism.clearances),
        "clearance_tolerance": dict(tolerances),
        "samples": samples,
        "seed": seed,
        "nonlinear": nonlinear,
        "crank_angle": theta,
        "flags": {str(i): why for i, why in sorted(found.flags.items())},
        "cautions": {str(i): why for i, why in found.cautions.items()},
        "condition": found.condition,
        "transmission": transmission(found.condition),
        "side_changes": _side_changes(found),
        "outputs": {
            d.name: {
                "body": d.body, "axis": d.axis, "unit": d.unit, **({} if d.axis == "angle" else {"point": d.point}),
                "nominal": found.nominal(d), "equilibrium": found.equilibrium(d), "worst_case": found.worst_case(d),
                "sensitivity": found.sensitivity(d), "compliance": found.compliance(d), "total": found.equilibrium(d) + found.compliance(d),
                "monte_carlo": {kind: vars(spread.spreads[d]) for kind, spread in spreads.items()},
            }
            for d in outputs
        },
        "points": {
            x.place: {
                "farthest": np.abs(found.farthest(x, y)), "farthest_direction": np.angle(found.farthest(x, y)),
                "radius_95": {kind: spread.radius[x.place] for kind, spread in spreads.items()},
            }
            for x, y in zip([d for d in outputs if d.axis == "x"], [d for d in outputs if d.axis == "y"], strict=True)
        },
    }  # fmt: skip


def _versions() -> dict[str, str]:
    import platform

    from sim_models.engine import installed_version

    return {
        "python": platform.python_version(),
        **{name: installed_version(name) or "not installed" for name in ("linkage-crosscheck", "numpy")},
    }


def _side_changes(found: Accuracy) -> list[dict[str, Any]]:
    return [
        {
            "joint": change.joint,
            "crank_angle": change.crank_angle,
            "from": change.before,
            "to": change.after,
            "reaction": change.reaction,
            "turned": change.turned,
            "jump": {d.name: float(jump[k]) for d, jump in found.jumps.items()},
        }
        for k, change in enumerate(found.side_changes)
    ]


def print_table(result: Mapping[str, Any], console: Console) -> None:
    """Print each output's largest numbers over the crank angles in millimetres and degrees, then what to beware of;
    ASCII.
    """
    from rich.markup import escape
    from rich.table import Table

    from compare.report.quantities import plain, shown

    theta = result["crank_angle"]
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="bold")
    for heading in (
        "output",
        "unit",
        "equilibrium",
        "at",
        "worst case",
        "at",
        "sigma",
        "compliance",
        "total",
        "sensitive to",
    ):
        table.add_column(
            heading, justify="left" if heading in ("output", "unit", "sensitive to") else "right", no_wrap=True
        )
    for name, row in result["outputs"].items():
        unit, factor = shown(row["unit"])

        def cell(values: np.ndarray, sign: bool = True, factor: float = factor) -> str:
            k = _largest(values)
            return "-" if k is None else plain(float(values[k]) * factor, 3, sign)

        slope, joint = max((float(values.max()), joint) for joint, values in row["sensitivity"].items())
        table.add_row(
            escape(name),
            unit,
            cell(row["equilibrium"]),
            _at(row["equilibrium"], theta),
            cell(row["worst_case"], False),
            _at(row["worst_case"], theta),
            cell(row["monte_carlo"]["free"]["sigma"], False),
            cell(row["compliance"]),
            cell(row["total"]),
            f"{joint} {plain(slope * factor * 1e-3)} {unit}/mm" if slope else "-",
        )
    console.print(table)
    for line in _notes(result):
        console.print(escape(line), highlight=False, soft_wrap=True)


def _largest(values: np.ndarray) -> int | None:
    """Index of the number largest in size; None where there is none but rounding."""
    import numpy as np

    size = np.nan_to_num(np.abs(values))
    return int(size.argmax()) if size.max() > ROUNDING else None


def _at(values: np.ndarray, theta: np.ndarray) -> str:
    k = _largest(values)
    return "-" if k is None else f"{math.degrees(theta[k]):.4g} deg"


def _notes(result: Mapping[str, Any]) -> list[str]:
    from compare.report.quantities import plain, shown

    sizes = ", ".join(f"{joint} {1e3 * c:.4g} mm" for joint, c in result["clearance"].items()) or "none"
    closed = "each closed again" if result["nonlinear"] else "to first order"
    notes = [
        "largest over the crank angles; sigma with contacts anywhere on the rim, worst case to either side",
        (
            f"{result['case']}: {result['motion']}, clearance {sizes}; {result['samples']} samples {closed}, seed"
            f" {result['seed']}"
        ),
    ]
    for what in ("flags", "cautions"):
        found = result[what]
        for first, why in list(found.items())[:1]:
            notes.append(
                f"{len(found)} crank angles with {what}, first {math.degrees(result['crank_angle'][int(first)]):.4g}"
                f" deg: {why}"
            )
    for change in result["side_changes"]:
        name = max(change["jump"], key=lambda n: (result["outputs"][n]["unit"] == "m", abs(change["jump"][n])))
        unit, factor = shown(result["outputs"][name]["unit"])
        what = "changes side" if abs(change["turned"]) > math.pi / 2 else "is hardly loaded"
        where = f"{math.degrees(change['crank_angle']):.4g} deg"
        notes.append(
            f"the contact in {change['joint']} {what} at {where}: {name} jumps by"
            f" {plain(change['jump'][name] * factor)} {unit}"
        )
    return notes


__all__ = ["accuracy", "analyse", "metres_by_joint", "named_outputs", "print_table"]

"""What clearance and compliance do to the outputs that a person names, over the whole cycle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from analytic.beyond_paper.monte_carlo import Contacts, Distribution, Population, draw
from analytic.kinematics.assembly import Assembly
from analytic.kinematics.output import Output
from analytic.mechanism import Mechanism
from analytic.mechanism.assumed import assumed
from analytic.paper.envelope import transmission
from analytic.paper.superposition import AccuracyAnalysis as CycleAccuracy
from analytic.paper.superposition import accuracy as accuracy_of
from compare.arguments import (
    Names,
    linkage,
    metres,
    noted,
    warn_of_friction,
)
from compare.faults import ArgumentError
from compare.limits import Bounds, limits_of_errors, points_in, points_of, refuse_errors_of_none
from compare.omissions import Asked, omitted
from compare.questions.accuracy import DRAWS, AccuracyQuestion
from compare.questions.question import answers
from compare.results import accuracy as results
from compare.results.accuracy import Accuracy, MonteCarlo, Point, Radius, SideChange, Spread
from compare.schedules import crank_angles
from compare.toleranced import limits_of_outputs, of_outputs, states_tolerances, varying
from compare.versions import versions
from sim_models.engine import Motion


@answers(AccuracyQuestion)
def accuracy(question: AccuracyQuestion) -> Accuracy:
    """How accurate a linkage with clearance can be: nominal, worst case, by joint, Monte Carlo, compliance.

    In the Monte Carlo each clearance is uniform within +-``clearance_tolerance`` (m).  ``outputs`` are names such as
    ``coupler`` (its com and angle), ``coupler.B`` or ``follower.angle``.  Reactions have inertia forces in ``driven``
    motion.  ``limits`` are of the linkages within the mechanism's tolerances; without any, and of ``worst_<output>``,
    of the error by clearance.

    Raises MechanismError, ArgumentError, AssemblyError or ComplianceError.
    """
    samples, seed, nonlinear = question.samples, question.seed, question.nonlinear
    with noted() as warned:
        m = linkage(question.mechanism, question.clearance, large=question.large)
        inertia = _inertia(question.motion, m)
        moves: Motion = "driven" if inertia else "static"
        warn_of_friction(m, None, moves, engines=False)
        warned += omitted(m, Asked("accuracy", moves, bends=True))
        assembly, outputs = Assembly(m), named_outputs(question.outputs, m)
        outputs += [each for each in points_in(question.limits, m) if each not in outputs]
        varied, told = varying(m, question.clearance is not None) if states_tolerances(m) else ((), [])
        warned += told
        toleranced, alone = _limits(question, m, outputs, bool(varied))
        result = accuracy_at(
            assembly,
            crank_angles(assembly, question.angles),
            outputs,
            tolerances=metres(question.clearance_tolerance or {}, m, "clearance_tolerance"),
            inertia=inertia,
            samples=samples,
            seed=seed,
            nonlinear=nonlinear,
        )
        if varied:
            cycle = accuracy_of(assembly, result.crank_angle, outputs, m.clearances, m.speed or 1.0, inertia)
            by = of_outputs(cycle, varied, samples, seed, toleranced, question.min_yield)
            result = result.model_copy(update={"tolerances": by})
        result = result.model_copy(update={"limits": limits_of_errors(result, alone)})
    asked = {"samples": samples != DRAWS, "seed": seed != 0, "nonlinear": nonlinear}
    drawn = bool(m.clearances) or result.tolerances is not None
    unused = [
        f"{m.name}: {name} is of linkages with clearance or tolerances; this has neither"
        for name in asked
        if asked[name] and not (m.clearances if name == "nonlinear" else drawn)
    ]
    return result.model_copy(update={"warnings": (*warned, *unused)})


def _limits(
    question: AccuracyQuestion, m: Mechanism, outputs: list[Output], varied: bool
) -> tuple[dict[Output, float], dict[str, Bounds]]:
    """Limits that linkages within tolerances have to keep where any number is ``varied``, and those of clearance alone.
    Raises ArgumentError.
    """
    alone = {} if question.limits is None else limits_of_outputs(question.limits, outputs, m)
    toleranced = {d: alone.pop(d.name)[1] for d in outputs if varied and d.name in alone}
    if question.min_yield is not None and not varied:
        why = f"{m.name} states no tolerance, so that all its linkages are alike; give [tolerances], or leave it out"
        raise ArgumentError("min_yield", why)
    if question.min_yield is not None and not toleranced:
        raise ArgumentError("min_yield", "is of linkages within limits; give them by `limits`, or leave it out")
    if not m.clearances:
        refuse_errors_of_none(m.name, alone)
    return toleranced, alone


def named_outputs(names: Names | None, mechanism: Mechanism) -> list[Output]:
    """Outputs by name: ``coupler`` (its com and angle), ``coupler.B``, ``coupler.angle``, or a point that only one body
    has.

    Raises ArgumentError.
    """
    bodies = mechanism.moving
    outputs: dict[Output, None] = {}
    for name in dict.fromkeys(names) if names else list(bodies):
        body, _, point = name.partition(".")
        owners = [b for b in bodies if name in bodies[b].points]
        if body not in bodies and len(owners) == 1:
            body, point = owners[0], name
        if body not in bodies:
            own = next((b for b in bodies if name in (f"{b}_x", f"{b}_y", f"{b}_angle")), None)
            if own is not None:
                raise ArgumentError("outputs", f"{name}: give {own}, which is its x, y and angle, or {own}.angle")
            words = name.removesuffix("_x").removesuffix("_y")
            at = next((d for d in points_of(mechanism) if words in (d.place, f"{d.body}_{d.point}")), None)
            if at is not None:
                raise ArgumentError("outputs", f"{name}: give {at.place}, which is its x and y")
            why = (
                f"is a point of {' and '.join(owners)}; write {owners[0]}.{name}"
                if owners
                else f"is no body; they are {', '.join(bodies)}"
            )
            raise ArgumentError("outputs", f"{name}: {body!r} {why}")
        if point not in ("", "com", "angle", *bodies[body].points):
            raise ArgumentError(
                "outputs", f"{name}: {body} has no point {point!r}; give com, angle, {', '.join(bodies[body].points)}"
            )
        outputs |= dict.fromkeys(_outputs_of(body, point))
    return list(outputs)


def _outputs_of(body: str, point: str) -> list[Output]:
    place = [] if point == "angle" else [Output(body, "x", point or "com"), Output(body, "y", point or "com")]
    return place + ([Output(body, "angle")] if point in ("", "angle") else [])


def _inertia(motion: Motion | None, mechanism: Mechanism) -> bool:
    if motion == "driven" and mechanism.speed is None:
        raise ArgumentError(
            "motion", f"the drive of {mechanism.name} has no constant speed; give it one, or ask for static motion"
        )
    return motion != "static" and mechanism.speed is not None


def accuracy_at(
    assembly: Assembly,
    theta: np.ndarray,
    outputs: Sequence[Output],
    *,
    tolerances: Mapping[str, float],
    inertia: bool,
    samples: int,
    seed: int,
    nonlinear: bool = False,
) -> Accuracy:
    """How accurate a linkage with its own clearances is at crank angles theta (N,) rad.

    Raises ArgumentError where a tolerance exceeds its clearance, ComplianceError where the links cannot carry their
    loads, and AssemblyError.
    """
    mechanism = assembly.mechanism
    if nonlinear and mechanism.loose_guides:
        name = next(iter(mechanism.loose_guides))
        raise ArgumentError(
            "nonlinear", f"joint {name} is a block in its guide, which goes to first order; leave it out"
        )
    for joint, tolerance in tolerances.items():
        if tolerance > mechanism.joint(joint).clearance:
            limit = f"the joint's clearance, {mechanism.joint(joint).clearance:g} m"
            raise ArgumentError(
                "clearance_tolerance", f"{joint}={tolerance:g} is more than {limit}; a clearance cannot be negative"
            )
    cycle = accuracy_of(assembly, theta, outputs, mechanism.clearances, mechanism.speed or 1.0, inertia)
    drawn = draw(
        cycle.clearances, np.array([tolerances.get(pin, 0.0) for pin in cycle.pins]), samples, seed, cycle.blocks
    )
    population = Population(
        assembly, cycle.total.clearance.ideal.motion, cycle.path, cycle.unit_reactions, cycle.directions
    )
    kinds: tuple[Contacts, Contacts] = ("free", "along reactions")
    free, along = (population.distribution(drawn, kind, nonlinear) for kind in kinds)
    planes = zip([d for d in outputs if d.axis == "x"], [d for d in outputs if d.axis == "y"], strict=True)
    return Accuracy(
        case=mechanism.name,
        mechanism=mechanism,
        versions=versions(),
        motion="driven" if inertia else "static",
        clearance=dict(mechanism.clearances),
        clearance_tolerance=dict(tolerances),
        samples=samples,
        seed=seed,
        nonlinear=nonlinear,
        crank_angle=theta,
        flags={str(i): why for i, why in sorted(cycle.flags.items())},
        cautions={str(i): why for i, why in cycle.cautions.items()},
        condition=cycle.condition,
        transmission=transmission(cycle.condition),
        side_changes=_side_changes(cycle),
        outputs={d.name: _output(d, cycle, free, along) for d in outputs},
        points={
            x.place: Point(
                farthest=np.abs(cycle.farthest(x, y)),
                farthest_direction=np.angle(cycle.farthest(x, y)),
                radius_95=Radius(free=free.radius[x.place], along_reactions=along.radius[x.place]),
            )
            for x, y in planes
        },
        command="",
        warnings=(),
        assumed=assumed(mechanism),
    )


def _output(d: Output, cycle: CycleAccuracy, free: Distribution, along: Distribution) -> results.Output:
    of_sides = MonteCarlo(free=Spread(**vars(free.spreads[d])), along_reactions=Spread(**vars(along.spreads[d])))
    output = results.Output(
        body=d.body,
        axis=d.axis,
        unit=d.unit,
        nominal=cycle.nominal(d),
        equilibrium=cycle.equilibrium(d),
        worst_case=cycle.worst_case(d),
        sensitivity=cycle.sensitivity(d),
        by_joint={
            joint: part
            for (joint, part), clearance in zip(cycle.by_joint(d).items(), cycle.clearances, strict=True)
            if clearance
        },
        compliance=cycle.compliance(d),
        total=cycle.by_both(d),
        monte_carlo=of_sides,
    )
    return output if d.axis == "angle" else output.model_copy(update={"point": d.point})


def _side_changes(cycle: CycleAccuracy) -> tuple[SideChange, ...]:
    return tuple(
        SideChange(**vars(change) | {"jump": {d.name: float(jump[k]) for d, jump in cycle.jumps.items()}})
        for k, change in enumerate(cycle.side_changes)
    )

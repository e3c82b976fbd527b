"""One side of a comparison by itself: what the analytic model says of a linkage, and what an engine does."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from math import ceil, degrees, radians, tau
from typing import Any

import numpy as np

from analytic.beyond_paper.platform import platform
from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.motion import along
from analytic.kinematics.output import Output
from analytic.kinematics.reach import turns_fully
from analytic.kinematics.schedule import Schedule
from analytic.mechanism import Mechanism
from analytic.mechanism.assumed import assumed
from analytic.mechanism.signals import position
from analytic.paper.clearance import displaced
from analytic.paper.envelope import ContactSideChange, condition, transmission
from analytic.paper.superposition import accuracy as cycle_accuracy
from analytic.paper.superposition import whole_turn
from compare.arguments import (
    idle,
    linkage,
    loose,
    noted,
    on_request,
    one_engine,
    rigidly_and_evenly_driven,
    warn_of_friction,
)
from compare.faults import ArgumentError
from compare.judge.reference import Reference, reference, with_flexible_links
from compare.judge.reruns import too_soft
from compare.judge.signals import only, with_derived
from compare.limits import TRANSMISSION, limits_of, points_in
from compare.omissions import Asked, omitted, rigid_walls, untold
from compare.quantities import plain, shown
from compare.questions.analyse import AnalyseQuestion, RunQuestion, SimulateQuestion
from compare.questions.question import answers
from compare.results.analysis import Analysis, Extremes, OutputError, Simulation
from compare.results.crosscheck import PinPath, Simulator
from compare.sampled import integral, vertices
from compare.schedules import scheduled
from compare.strokes import STROKE
from compare.toleranced import of_signals, states_tolerances, varying
from sim_models.common.contact_laws import assumed_of_contact
from sim_models.common.rates import with_rates
from sim_models.common.simulate import answered
from sim_models.engine import Motion, Request, engine

FEWEST = 8  # crank angles or times between which they are looked for
ROUNDING = 1e-9  # of what a table of a load goes over: by so much a motion does not leave it
PEAK_STEP = radians(1.0)  # crank angle between looks: a parabola misses the peak of a tenth harmonic by 2e-5 of it
LOOKS = 360  # at the least over times, however few these are
MOST_LOOKS = 1440
SAME_PLACE = 0.5  # deg, between pins that cross their bearings: a sentence says one of them
CLOSER, ROUNDS = 20, 2  # looks to either side of such a peak, so many times as close as the last ones: to 0.0025 deg


@answers(AnalyseQuestion)
def analyse(question: AnalyseQuestion) -> Analysis:
    """Kinetostatics and clearance of a linkage over its crank angle (N,) rad, and its compliance where asked for.

    The model is the paper's ``first_order`` (Eq. 8) or the self-consistent ``equilibrium``.  ``static`` motion has no
    inertia forces; without a speed of the drive it is the only one.  With ``compliance`` links that have a modulus of
    elasticity and joints that have an elasticity yield as well (Eqs. 1-7), superposed as in Fig. 7c, in static motion.

    A linkage that no single crank moves is analysed at ``times`` (N,) s, its drives at their speeds, along the
    ``course`` of a file or such that a platform follows a ``path``, as in :func:`compare.crosscheck.crosscheck`; in
    ``static`` motion at rest in each of those poses.  ``limits`` are numbers that the linkage has to keep, such as
    ``{"reaction_B": "500 N", "transmission_angle": "40 deg", "stroke_rocker": "84:87 deg"}``; a range is
    ``least:largest``.
    Raises MechanismError, ArgumentError, AssemblyError or ComplianceError.
    """
    motion, model, compliance = question.motion, question.model, question.compliance
    with noted() as warned:
        given = linkage(question.mechanism, question.clearance, large=question.large)
        m = given if compliance else rigidly_and_evenly_driven(given)
        warn_of_friction(m, None, motion, engines=False)
        warned += [*idle(m, model), *omitted(m, Asked("analyse", motion, bends=compliance))]
        if compliance and not (m.bends or any(joint.elasticity for joint in m.joints)):
            warned.append(f"{m.name}: no body has a youngs_modulus and no joint an elasticity, so that nothing yields")
        assembly = Assembly(m)
        schedule = scheduled(assembly, question)
        if motion == "driven" and compliance:
            raise ArgumentError("compliance", "elastic displacement is found at rest; ask for static motion")
        side = _side(assembly, schedule, question)
        warned += _without_use(m, side, schedule.time)
    optional, crossing = ({}, []) if compliance else _of_outputs(assembly, schedule, motion, question.limits)
    if not compliance:
        optional["extremes"] = _extremes(assembly, schedule, question, side.signals)
    optional |= {} if schedule.crank_angle is not None else {"time": schedule.time}
    if states_tolerances(m) or question.samples or question.seed:
        varied, told = varying(m, question.clearance is not None)
        warned += told
        if not varied and (question.samples or question.seed):
            asked = "samples" if question.samples else "seed"
            raise ArgumentError(asked, f"{m.name} has no tolerances to draw from; give [tolerances], or leave it out")
        if question.seed and not question.samples:
            warned.append("seed is of samples, of which there are none")
        if varied:
            ask = _signals_of(question, schedule)
            optional["tolerances"] = of_signals(m, varied, side.signals, ask, question.samples, question.seed)
    result = Analysis(
        case=m.name,
        mechanism=m,
        motion=motion,
        clearance=m.clearances,
        analytic_model=model,
        compliance=compliance,
        crank_angle=_along(m, side) if schedule.crank_angle is None else schedule.crank_angle,
        signals=dict(side.signals),
        flags={str(i): why for i, why in sorted(side.flags.items())},
        order_difference=dict(side.order_difference),
        warnings=(*warned, *side.remarks, *crossing),
        assumed=assumed(m),
        **optional,
    )
    kept = {} if question.limits is None else {"limits": limits_of(result, question.limits)}
    return result.model_copy(update=kept)


def _side(assembly: Assembly, schedule: Schedule, question: AnalyseQuestion) -> Reference:
    """The model that a question asks for."""
    m = assembly.mechanism
    more = on_request(question.signals, m, question.motion)
    side = reference(assembly, schedule, question.model, m.clearances, more=more, alone=True)
    return with_flexible_links(side, assembly, schedule) if question.compliance else side


def _signals_of(question: AnalyseQuestion, schedule: Schedule) -> Callable[[Mechanism], Mapping[str, np.ndarray]]:
    """What answers a question with the signals of another linkage, at the same crank angles or times."""
    crank = schedule.crank_angle
    asked = replace(question, angles=crank) if crank is not None else replace(question, times=schedule.time)

    def signals(m: Mechanism) -> Mapping[str, np.ndarray]:
        assembly = Assembly(m)
        return _side(assembly, scheduled(assembly, asked), asked).signals

    return signals


def _of_outputs(
    assembly: Assembly, schedule: Schedule, motion: Motion, limits: object
) -> tuple[dict[str, Any], list[str]]:
    """The transmission angle at a crank's angles, and what clearance does to each body there, joint by joint, with
    where pins cross their bearings, in words; of what several drives move, the errors alone.
    """
    m, theta = assembly.mechanism, schedule.crank_angle
    outputs = [Output(body.name, axis) for body in m.bodies for axis in ("x", "y", "angle")] + points_in(limits, m)
    if theta is None:
        told = m.clearances and not m.loose_guides and not assembly.structure.free
        return {"errors": _of_poses(assembly, schedule, motion, outputs)} if told else {}, []
    if not m.clearances:
        return {"transmission": transmission(condition(along(assembly, schedule)))}, []
    stiff = m.rigid().replace(joints=[j.model_copy(update={"elasticity": None}) for j in m.joints])
    cycle = cycle_accuracy(Assembly(stiff), theta, outputs, m.clearances, m.speed or 1.0, motion == "driven")
    return {
        "transmission": transmission(cycle.condition),
        "errors": {
            d.name: OutputError(
                unit=d.unit,
                equilibrium=cycle.equilibrium(d),
                worst_case=cycle.worst_case(d),
                by_joint={joint: part for joint, part in cycle.by_joint(d).items() if m.clearances.get(joint)},
            )
            for d in outputs
        },
    }, list(_crossings(cycle.side_changes, motion))


def _of_poses(
    assembly: Assembly, schedule: Schedule, motion: Motion, outputs: Sequence[Output]
) -> dict[str, OutputError]:
    """What clearance does to each body over time, all of whose freedoms are driven."""
    inputs, m = assembly.inputs_along(schedule), assembly.mechanism
    gaps = displaced(
        assembly,
        inputs.theta,
        inputs.omega,
        alpha=inputs.alpha,
        inertia=motion == "driven",
        near=assembly.walk(schedule),
    )
    errors = platform(gaps.ideal, outputs, m.clearances, {})
    return {
        d.name: OutputError(
            unit=d.unit, equilibrium=gaps.moved(d), worst_case=errors.worst_clearance(d), by_joint=errors.by_joint(d)
        )
        for d in outputs
    }


def _crossings(changes: Sequence[ContactSideChange], motion: Motion) -> Iterator[str]:
    """Where pins cross their bearings: a sentence for all joints that do so at about the same angles."""
    there: dict[float, dict[str, float]] = {}
    for change in changes:
        at = degrees(change.crank_angle) % 360
        place = next((place for place in there if abs(at - place) < SAME_PLACE), at)
        there.setdefault(place, {})[change.joint] = abs(degrees(change.turned))
    places: dict[tuple[str, ...], list[float]] = {}
    for place, turned in there.items():
        places.setdefault(tuple(sorted(turned)), []).append(place)
    strikes = ", and strikes it" if motion == "driven" else ""
    for joints, angles in places.items():
        turn, pin = ("reactions at {} turn", "each pin") if len(joints) > 1 else ("reaction at {} turns", "the pin")
        by = max(there[place][joint] for place in angles for joint in joints)
        at_all = ", ".join(plain(place, 4) for place in angles)
        said = f"the {turn.format(', '.join(joints))} by {'up to ' * (len(joints) > 1)}{by:.0f} deg at {at_all} deg"
        yield f"{said}: there {pin} crosses its bearing{strikes}"


def _without_use(m: Mechanism, side: Reference, time: np.ndarray) -> Iterator[str]:
    """Loads that vary and act nowhere in this motion, or whose tables end before it does, each in a sentence."""
    for load in (load for load in m.loads if load.over):
        values = m.load_values(load, side.signals, time)
        if values is None or not np.isfinite(values).any():
            continue
        angular = m.load_quantities[load.over].kind == "angle"
        low, high = (float(f(values)) for f in (np.nanmin, np.nanmax))
        unit, factor = shown(m.load_quantities[load.over].unit)
        span = f"{plain(factor * low, 4)} to {plain(factor * high, 4)} {unit}"
        if not np.any(np.nan_to_num(load.share(values, angular))):
            yield f"{m.name}: the load on {load.body} acts nowhere: {load.over} goes from {span}"
        elif load.table and not angular:
            first, last = load.table[0][0], load.table[-1][0]
            if max(first - low, high - last) > ROUNDING * (last - first):
                known = f"{plain(factor * first, 4)} to {plain(factor * last, 4)} {unit}"
                yield (
                    f"{m.name}: the load on {load.body} is told for {load.over} from {known}, and that goes from"
                    f" {span}: beyond its table a load stays as it is at the end"
                )


def _extremes(
    assembly: Assembly, schedule: Schedule, question: AnalyseQuestion, known: Mapping[str, np.ndarray]
) -> dict[str, Extremes]:
    """The highest and lowest value of each signal over the stretch of the crank angles or times, or over the whole turn
    that the angles make; nothing where there are too few or too many, or where the linkage cannot be followed closely.

    Between looks a signal is the parabola through three of them, where it bends evenly; around a peak where it does not
    it is looked at again, more closely; and once more where it may jump, as loads begin and end, or friction turns.
    What is ``known`` at the samples (N,) is an end, too, where no look is beyond it.
    """
    m, theta = assembly.mechanism, schedule.crank_angle
    x = schedule.time if theta is None else theta
    whole = theta is not None and m.timed_load is None and whole_turn(theta)
    low, high = (float(x.min()), float(x.min()) + tau if whole else float(x.max())) if x.size else (0.0, 0.0)
    count = max(LOOKS, x.size - 1) if theta is None else ceil((high - low) / PEAK_STEP - ROUNDING)
    if x.size < FEWEST or count > MOST_LOOKS:
        return {}
    close = np.linspace(low, high, count + 1)

    def look(at: np.ndarray) -> dict[str, np.ndarray]:
        moved = replace(schedule, time=at) if theta is None else schedule.turned_to(m, at)
        signals = dict(_side(assembly, moved, question).signals)
        if theta is not None:
            ideal = along(assembly, moved)
            signals[TRANSMISSION] = np.arcsin(np.minimum(transmission(condition(ideal)), 1.0))
            slides = {j.name: ideal.relative(j) for j in m.joints if j.prismatic}
            turns = {body.name: ideal.angle(body.name) for body in m.bodies if body.name != m.driven}
            signals |= {f"{STROKE}{what}": values for what, values in (slides | turns).items()}
        return signals

    try:
        signals = {name: values for name, values in look(close).items() if np.isfinite(values).any()}
        step, peaks = close[1] - close[0], {name: _peaks(values, close, whole) for name, values in signals.items()}
        here = (x >= low) & (x <= high)
        looks, asked = [(close, signals)], [(x[here], {name: values[here] for name, values in known.items()})]
        for _ in range(ROUNDS if any(load.varies for load in m.loads) or any(j.rubs for j in m.joints) else 1):
            rough = [_utmost(peaks[n], n, looks + asked)[k][1] for n in peaks for k in (0, 1) if peaks[n][k][0] is None]
            around = np.unique(np.add.outer(rough, step * np.arange(-CLOSER, CLOSER + 1) / CLOSER))
            around = around[(around >= low) & (around <= high)]
            looks += [(around, look(around))] if around.size else []
            step /= CLOSER
    except AssemblyError:
        return {}
    return {name: _extreme(_utmost(found, name, looks + asked), name, looks) for name, found in peaks.items()}


Peak = tuple[float | None, float]  # value, None where it is not known well enough, and angle (rad)
Ends = tuple[tuple[float, float], tuple[float, float]]  # the highest value and its angle (rad), and the lowest
Looks = Sequence[tuple[np.ndarray, Mapping[str, np.ndarray]]]  # angles (N,) rad, and values of signals at them


def _peaks(values: np.ndarray, theta: np.ndarray, whole: bool) -> tuple[Peak, Peak]:
    """The highest and the lowest value (N,) at angles evenly apart, of which the last is the first where they make a
    whole turn.
    """
    wrapped = (values[-2:-1], values[1:2]) if whole else (np.full(1, np.nan), np.full(1, np.nan))
    around = np.concatenate([np.full(1, np.nan), wrapped[0], values, wrapped[1], np.full(1, np.nan)])
    share, value, way = vertices(around)

    def peak(sign: float) -> Peak:
        k = int(np.nanargmax(sign * values))
        if way[k] == sign:
            at = float(theta[k] + share[k] * (theta[1] - theta[0]))
            return float(value[k]), at + tau if at < theta[0] else at
        flat = np.nanmax(values) - np.nanmin(values) <= ROUNDING * np.nanmax(np.abs(values))
        end = not whole and k in (0, values.size - 1)
        return (float(values[k]) if flat or end else None), float(theta[k])

    return peak(1.0), peak(-1.0)


def _in_order(name: str, looks: Looks) -> tuple[np.ndarray, np.ndarray]:
    """The angles (N,) rad of all looks, in their order, and the values of a signal there."""
    angles = np.concatenate([at for at, _ in looks])
    values = np.concatenate([signals.get(name, np.full(at.size, np.nan)) for at, signals in looks])
    order = np.argsort(angles, kind="stable")
    order = order[np.diff(angles[order], prepend=-np.inf) > ROUNDING]  # each once
    return angles[order], values[order]


def _utmost(peaks: tuple[Peak, Peak], name: str, looks: Looks) -> Ends:
    """The highest and the lowest value of a signal and where: its peaks, or what is beyond them in any look."""
    angles, values = _in_order(name, looks)
    at = int(np.nanargmax(values)), int(np.nanargmin(values))
    high, low = ((float(values[k]), float(angles[k])) for k in at)
    (top, top_at), (bottom, bottom_at) = peaks
    highest = high if top is None or high[0] > top else (top, top_at)
    return highest, low if bottom is None or low[0] < bottom else (bottom, bottom_at)


def _extreme(ends: Ends, name: str, looks: Looks) -> Extremes:
    """The ends of a signal, and its mean and rms over all looks, close ones where it jumps; none where it is missing
    over more than two steps of the first ones.
    """
    (highest, highest_at), (lowest, lowest_at) = ends
    x, values = _in_order(name, looks)
    x, values = x[np.isfinite(values)], values[np.isfinite(values)]
    first = looks[0][0]
    edges = np.concatenate([first[:1], x, first[-1:]])
    k = int(np.argmax(np.diff(edges)))
    missing = edges[k + 1] - edges[k] > (2 + ROUNDING) * (first[1] - first[0])
    mean, square = (np.nan if missing else integral(values**n, x) / np.ptp(x) for n in (1, 2))
    return Extremes(
        highest=highest,
        highest_at=highest_at,
        lowest=lowest,
        lowest_at=lowest_at,
        mean=float(mean),
        rms=float(np.sqrt(square)),
        gap=(float(edges[k]), float(edges[k + 1])) if missing else None,
    )


def _along(m: Mechanism, side: Reference) -> np.ndarray:
    """The crank's angle (N,) rad over time; without a crank the first input's position, or 0 where nothing drives."""
    first = f"{m.driven}_angle" if m.cranked else position(m.motors[0]).name if m.motors else ""
    zero = np.zeros(next(iter(side.signals.values())).shape)
    return np.nan_to_num(side.signals.get(first, zero))


@answers(SimulateQuestion)
def simulate(question: SimulateQuestion) -> Simulation:
    """One run of one engine: the signals of a linkage over its crank angle (N,) rad, or over time if it swings freely.

    The run is the one that a cross-check makes.  Raises MechanismError, ArgumentError, AssemblyError, Unsupported,
    SimulatorMissing or SimulationError.
    """
    joint_model, motion = question.joint_model, question.motion
    with noted() as warned:
        m = rigidly_and_evenly_driven(linkage(question.mechanism, question.clearance, large=question.large))
        warned += omitted(m, Asked.of_engines("simulate", m, motion, joint_model))
        name = one_engine(question.simulator)
        warn_of_friction(m, joint_model, motion)
        asked = on_request(question.signals, m, motion)
        trace = answered(name, request(m, question), engine(name).simulate)
        signals = only(with_rates(m, trace, asked), m, asked)
        warned += untold(name, asked, signals)
    simulation = Simulation(
        case=m.name,
        mechanism=m,
        motion=motion,
        clearance=dict(trace.clearance),
        simulator=Simulator(name=trace.simulator, version=trace.version),
        joint_model=joint_model,
        settings=dict(trace.settings),
        crank_angle=trace.crank_angle,
        signals=with_derived(signals, m),
        journal={name: PinPath(x=path[:, 0], y=path[:, 1]) for name, path in trace.journal.items()},
        free_share=dict(trace.free_share),
        warnings=tuple(warned),
        assumed=(*assumed(m), *assumed_of_contact(m, trace.clearance, trace.settings)),
    )
    simulation = simulation.model_copy(
        update={
            "warnings": (
                *simulation.warnings,
                *rigid_walls(m, name, joint_model, trace.settings),
                *too_soft(simulation),
            )
        }
    )
    return simulation if trace.time is None else simulation.model_copy(update={"time": trace.time})


def request(m: Mechanism, question: RunQuestion) -> Request:
    """The run of a linkage that a cross-check makes of this joint model.  Raises what
    :func:`compare.schedules.scheduled` does.
    """
    joint_model, motion = question.joint_model, question.motion
    loose(m, joint_model)
    assembly = Assembly(m)
    schedule = scheduled(assembly, question)
    if assembly.left_free(schedule):
        assembly.check_springs(assembly.home)
    else:
        assembly.check_springs(along(assembly, schedule).coordinates)
    turns_on = schedule.turns_evenly and motion == "driven" and joint_model != "ideal" and turns_fully(assembly)
    return Request(m, joint_model, schedule, lead_in=tau if turns_on else 0.0)

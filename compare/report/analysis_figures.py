"""The figures of a linkage by itself: reactions over the turn and as vectors, drive, motion, errors, transmission."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.motion import Motion, kinematics
from analytic.mechanism import GROUND
from analytic.mechanism.signals import AXES
from compare.quantities import drive_signals, number, quantities, shown
from compare.report.figure import Axis, Figure, Numbers, Series, scaled
from compare.report.peaks import (
    GOOD,
    NOTHING,
    Acting,
    End,
    Erring,
    Of,
    acting,
    on_request,
    over,
    parts_of,
    peak,
    peaks,
    power_ends,
    powers,
    together,
    transmission_angle,
)
from compare.results.analysis import Analysis, Simulation

ROLES = ("massless-link", "spring-damper", "contact", "ideal", "force-1", "analytic")  # six, apart in the dark too
ASKED = {  # by unit the name and title of a figure
    "m/s": ("asked_velocity", "Velocity, by component"),
    "rad/s": ("asked_joint_velocity", "Velocity of joints"),
    "m/s^2": ("asked_acceleration", "Acceleration, by component"),
    "rad/s^2": ("asked_angular_acceleration", "Acceleration of angles"),
}
MOST_CURVES = len(ROLES)  # curves of a figure
Band = tuple[str, np.ndarray, np.ndarray]  # its name, lower and upper edge (N,)


def figures(result: Analysis | Simulation) -> list[Figure]:
    """All of them, those first that are looked at first."""
    found = [*_reactions(result), *_drive(result), *_loads(result), *vectors(result)]
    if isinstance(result, Analysis):
        found += [*error_figures(result), *transmission_figure(result)]
    return [*found, *_positions(result), *_rates(result), *_asked(result)]


def curves(
    result: Of,
    name: str,
    title: str,
    axis: Axis,
    lines: Mapping[str, np.ndarray],
    ends: Mapping[str, Sequence[End]] | None = None,
    more: Sequence[Series] = (),
) -> Figure:
    """Values (N,) in the axis' unit over the crank angle or time, with a label at the ``ends`` of each; where none are
    given at its largest sample, unless it is constant.
    """
    x = over(result)
    series, marks, said = list[Series](), list[Series](), list[str]()
    for k, (label, values) in enumerate(lines.items()):
        role = ROLES[k % MOST_CURVES]
        series.append(Series(label, *_closed(result, values), role))
        for end in _largest(values, x.values) if ends is None else ends.get(label, ()):
            marks.append(_labelled(end, label if len(lines) > 1 else "", x.unit, role))
            said += marks[-1].labels
    text = f"{title} over {x.label}. Largest: {'; '.join(said)}." if said else f"{title} over {x.label}."
    marks.sort(key=lambda mark: -(mark.y[0] or 0.0))  # labels that make room for each other keep their order
    return Figure(name, title, text, Axis(x.label, x.unit), axis, (*series, *more, *marks))


def _largest(values: np.ndarray, x: Sequence[float]) -> list[End]:
    """The sample that is largest in size, if the values vary."""
    size = np.abs(values)
    if not np.isfinite(size).any() or np.nanmax(values) - np.nanmin(values) <= NOTHING * np.nanmax(size):
        return []
    at = int(np.nanargmax(size))
    return [End(float(values[at]), float(x[at]))]


def _closed(result: Of, values: np.ndarray) -> tuple[Numbers, Numbers]:
    """A curve's x and y, with its first sample once more behind its last where the samples make a whole turn and it is
    where it began.
    """
    x = over(result)
    if not over(result).around or abs(values[-1] - values[0]) > 3 * np.nanmax(np.abs(np.diff(values)), initial=0.0):
        return scaled(x.values), scaled(values)
    turn = 360.0 if x.values[-1] > x.values[0] else -360.0
    return scaled([*x.values, x.values[0] + turn]), scaled([*values, values[0]])


def _round(result: Analysis | Simulation, path: np.ndarray) -> np.ndarray:
    """A path (N,) x + iy, closed where the samples make a whole turn."""
    return np.append(path, path[:1]) if over(result).around else path


def _in_sixes(
    result: Analysis | Simulation,
    name: str,
    title: str,
    axis: Axis,
    lines: Mapping[str, np.ndarray],
    ends: Mapping[str, Sequence[End]] | None = None,
) -> Iterator[Figure]:
    """One figure of these curves, or several of six."""
    named = list(lines.items())
    each = math.ceil(len(named) / max(math.ceil(len(named) / MOST_CURVES), 1)) or 1
    chunks = [named[k : k + each] for k in range(0, len(named), each)]
    for k, chunk in enumerate(chunks):
        part = f" ({k + 1} of {len(chunks)})" if len(chunks) > 1 else ""
        yield curves(result, name if k == 0 else f"{name}_{k + 1}", title + part, axis, dict(chunk), ends)


def _lines(
    result: Analysis | Simulation, names: Mapping[str, str]
) -> tuple[dict[str, np.ndarray], dict[str, Sequence[End]]]:
    """Signals by label in a reader's unit, those that are not zero throughout, and their ends."""
    known, listed = quantities(result.mechanism), {each.quantity.signal: each for each in peaks(result)}
    there = {label: name for label, name in names.items() if name in listed}
    lines = {label: known[name].factor * result.signals[name] for label, name in there.items()}
    return lines, {label: listed[name].ends for label, name in there.items()}


def _reactions(result: Analysis | Simulation) -> Iterator[Figure]:
    joints = {joint.name: f"reaction_{joint.name}_magnitude" for joint in result.mechanism.joints}
    yield from _in_sixes(
        result, "reactions", "Reaction force of each joint", Axis("force", "N"), *_lines(result, joints)
    )
    slides = {joint.name: f"reaction_{joint.name}_moment" for joint in result.mechanism.joints if joint.prismatic}
    yield from _in_sixes(
        result, "moments", "Reaction moment of each slide", Axis("moment", "N·m"), *_lines(result, slides)
    )


def _drive(result: Analysis | Simulation) -> Iterator[Figure]:
    known = quantities(result.mechanism)
    for unit, what in (("N·m", "torque"), ("N", "force")):
        names = {known[s].place or "drive": s for s in drive_signals(result.mechanism) if known[s].unit == unit}
        yield from _in_sixes(result, f"drive_{what}", f"Drive {what}", Axis(what, unit), *_lines(result, names))
    watts, ends = powers(result), power_ends(result)
    if watts:
        largest = max(float(np.nanmax(np.abs(each))) for each in watts.values())
        ends = {name: [end for end in both if abs(end.value) > NOTHING * largest] for name, both in ends.items()}
        yield from _in_sixes(result, "drive_power", "Drive power", Axis("power", "W"), watts, ends)


def _loads(result: Analysis | Simulation) -> Iterator[Figure]:
    """What loads that vary do, where some of them do anything; those at one place together."""
    for unit, what in (("N", "force"), ("N·m", "torque")):
        at_place: dict[str, list[Acting]] = {}
        for each in acting(result):
            if each.unit == unit and (each.load.over or (each.load.opposes and unit != "N")):  # a size that stays
                at_place.setdefault(each.label, []).append(each)
        lines = {label: together(loads) for label, loads in at_place.items()}
        yield from _in_sixes(result, f"load_{what}", f"Loads that vary: {what}", Axis(what, unit), lines, {})


def vectors(result: Analysis | Simulation) -> Iterator[Figure]:
    """The force on the second body of each joint as a vector, in the ground's frame and in that body's own."""
    signals, known, unit = result.signals, quantities(result.mechanism), over(result).unit
    for joint in result.mechanism.joints:
        x, y = (signals.get(f"reaction_{joint.name}_{axis}") for axis in "xy")
        if x is None or y is None or not np.nanmax(np.hypot(x, y), initial=0.0) > 0:
            continue
        force, body = x + 1j * y, joint.bodies[1] if joint.bodies[1] != GROUND else joint.bodies[0]
        seen = {"in the ground's frame": force}
        if f"{body}_angle" in signals:
            seen[f"in the frame of {body}"] = force * np.exp(-1j * signals[f"{body}_angle"])
        rounds = {name: _round(result, f) for name, f in seen.items()}
        series = [Series(n, scaled(f.real), scaled(f.imag), ROLES[k]) for k, (n, f) in enumerate(rounds.items())]
        marks, at = list[Series](), int(np.nanargmax(np.abs(force)))
        largest = peak(result, known[f"reaction_{joint.name}_magnitude"]).highest  # beside that sample
        for k, f in enumerate(seen.values()):
            tip, role = f[at], ROLES[k]
            tip *= largest.value / abs(tip)
            label = f"{number(largest.value, 4)} N at {number(largest.at, 4)}"
            label += "°" if unit == "deg" else " s"
            marks.append(Series("", (0.0, float(tip.real)), (0.0, float(tip.imag)), role, "dashed"))
            marks.append(
                Series("", (float(tip.real),), (float(tip.imag),), role, "marker", labels=(label,) if not k else ())
            )
        origin = Series("", (0.0,), (0.0,), "ideal", "marker")
        title = f"Reaction at {joint.name} as a vector: on {joint.bodies[1]}"
        text = f"{title}, over the motion; largest {number(largest.value, 4)} N at {number(largest.at, 4)} {unit}."
        axes = Axis("force x", "N"), Axis("force y", "N")
        yield Figure(f"vector_{joint.name}", title, text, *axes, (*series, *marks, origin), "plane")


def error_figures(
    result: Erring, more: Mapping[str, Mapping[str, np.ndarray]] | None = None, bands: Mapping[str, Band] | None = None
) -> Iterator[Figure]:
    """What clearance does to each output: in equilibrium, by each joint, and at most; with ``more`` curves (N,) of an
    output and a named band from its lower to its upper edge, all in SI units.
    """
    for name, error in result.errors.items():
        unit, factor = shown(error.unit)
        worst, lines = factor * error.worst_case, dict[str, np.ndarray]()
        loose = np.nanmax(worst, initial=0.0) > NOTHING
        if loose:
            parts = {f"by {joint} alone": factor * part for joint, part in parts_of(error).items()}
            lines = {"equilibrium": factor * error.equilibrium} | (parts if 1 < len(parts) < MOST_CURVES else {})
        lines |= {label: factor * values for label, values in (more or {}).get(name, {}).items()}
        if not lines:
            continue
        bounds = _bounds(result, worst) if loose else []
        if loose and bands:
            bounds.append(_band(result, bands[name], factor))
        ends = {label: _largest(values, over(result).values) for label, values in list(lines.items())[:1]}
        title = f"Error of {name} by clearance" if loose else f"Error of {name}"
        yield curves(result, f"error_{name}", title, Axis("displacement", unit), lines, ends, bounds)


def _bounds(result: Of, worst: np.ndarray) -> list[Series]:
    """The worst case (N,) to either side, with its peak."""
    ends = [_labelled(end, "worst case", over(result).unit, "frame") for end in _largest(worst, over(result).values)]
    sides = {"worst case to first order": worst, "": -worst}
    return [*(Series(name, *_closed(result, v), "frame", "dashed") for name, v in sides.items()), *ends]


def _band(result: Of, band: Band, factor: float) -> Series:
    """A band, along its upper edge and back along its lower one."""
    name, low, high = band
    (x, lower), (_, upper) = (_closed(result, factor * edge) for edge in (low, high))
    x, upper = x[: min(len(x), len(upper))], upper[: len(x)]  # closed both or none
    return Series(name, (*x, *x[::-1]), (*upper, *lower[: len(x)][::-1]), "free", "band")


def _labelled(end: End, label: str, unit: str, role: str) -> Series:
    """A mark that says how large a curve is there."""
    text = f"{label} {number(end.value, 4)} at {number(end.at, 4)}{'°' if unit == 'deg' else ' s'}"
    return Series("", scaled([end.at]), scaled([end.value]), role, "marker", labels=(text.strip(),))


def transmission_figure(result: Erring) -> Iterator[Figure]:
    """The transmission angle over the crank angle, where it is not square throughout."""
    angle = transmission_angle(result)
    if angle is None or np.nanmin(angle) > 89.9:
        return
    x = over(result)
    limit = Series("40 deg: poor below", (x.values[0], x.values[-1]), (GOOD, GOOD), "frame", "dashed")
    at = int(np.nanargmin(angle))
    least = Series(
        "",
        (x.values[at],),
        (float(angle[at]),),
        ROLES[0],
        "marker",
        labels=(f"{number(float(angle[at]), 3)}° at {number(x.values[at], 4)}°",),
    )
    title = "Transmission angle, the worst loop's"
    yield curves(
        result,
        "transmission",
        title,
        Axis("transmission angle", "deg"),
        {"transmission angle": angle},
        {},
        (limit, least),
    )


def _positions(result: Analysis | Simulation) -> Iterator[Figure]:
    mechanism = result.mechanism
    angles, _ = _lines(result, {body.name: f"{body.name}_angle" for body in mechanism.bodies})
    yield from _in_sixes(result, "angles", "Angles of the bodies", Axis("angle", "deg"), angles, {})
    slides = _lines(result, {j.name: f"position_{j.name}" for j in mechanism.joints if j.prismatic})
    yield from _in_sixes(result, "travel", "Travel of the slides", Axis("position", "mm"), *slides)
    paths = []
    for k, body in enumerate(mechanism.bodies):
        x, y = (result.signals.get(f"{body.name}_{axis}") for axis in "xy")
        if x is not None and y is not None and k < MOST_CURVES:
            path = _round(result, x + 1j * y)
            paths.append(Series(body.name, scaled(path.real, 1e3), scaled(path.imag, 1e3), ROLES[k % MOST_CURVES]))
    if paths:
        title = "Paths of the centres of mass"
        yield Figure("paths", title, f"{title}.", Axis("x", "mm"), Axis("y", "mm"), tuple(paths), "plane")


def _rates(result: Analysis | Simulation) -> Iterator[Figure]:
    """Velocities and accelerations of the ideal linkage that an even crank moves."""
    motion = _moved(result)
    if motion is None:
        return
    bodies = [body.name for body in result.mechanism.bodies]
    kinds = (
        ("angular_velocity", "Angular velocity", Axis("angular velocity", "rad/s"), motion.angular_velocity),
        (
            "angular_acceleration",
            "Angular acceleration",
            Axis("angular acceleration", "rad/s²"),
            motion.angular_acceleration,
        ),
        ("speed", "Speed of the centres of mass", Axis("speed", "m/s"), lambda b: np.abs(motion.velocity(b))),
        (
            "acceleration",
            "Acceleration of the centres of mass",
            Axis("acceleration", "m/s²"),
            lambda b: np.abs(motion.acceleration(b)),
        ),
    )
    for name, title, axis, of in kinds:
        lines = {body: np.asarray(of(body)) for body in bodies}
        largest = max((float(np.max(np.abs(v))) for v in lines.values()), default=0.0)
        lines = {body: v for body, v in lines.items() if np.max(np.abs(v)) > NOTHING * largest}
        yield from _in_sixes(result, name, title, axis, lines)


def _asked(result: Analysis | Simulation) -> Iterator[Figure]:
    """The velocities and accelerations that were asked for, each unit by itself; power has its figure."""
    names = on_request(result)
    for unit, (name, title) in ASKED.items():
        kinds = {s: result.kinds[s] for s in names if result.kinds[s].unit == unit}
        of = {f"{k.place} {k.component}" if k.component in AXES else k.place: s for s, k in kinds.items()}
        yield from _in_sixes(result, name, title, Axis(title.split()[0].lower(), unit), *_lines(result, of))


def _moved(result: Analysis | Simulation) -> Motion | None:
    """The ideal linkage at the samples, its crank or its drives at constant speed."""
    m = result.mechanism
    speeds = [drive.speed for drive in m.drives if isinstance(drive.speed, float)]
    if result.motion != "driven" or not isinstance(result, Analysis) or len(speeds) < len(m.drives) or not speeds:
        return None
    crank = m.cranked and result.time is None
    inputs = [result.crank_angle] if crank else [result.signals[f"position_{drive.joint}"] for drive in m.drives]
    if crank is not m.cranked or not np.isfinite(inputs).all():
        return None
    at = np.array(inputs)
    theta, omega = (at[0], speeds[0]) if crank else (at, np.outer(speeds, np.ones(at.shape[1])))
    try:
        return kinematics(Assembly(m.with_clearances({})), theta, omega)
    except AssemblyError:  # at a change point on the grid; the figures then do without
        return None

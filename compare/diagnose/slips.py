"""Data that are not what they say: signs, units, swapped, copied and silent columns, zeros and speeds.

A slip of this kind is certain or it is none: it is told where one change of what a file says brings readings that are
far from the nominal model onto it, and no sensor speaks against it, or where a sensor reads nothing at all.  An
encoder's zero that is a little off, a gain, a bias or a load cell mounted upside down are effects, and stay so.
Nothing is diagnosed from data with a slip: what would be named from them is not there.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, groupby

import numpy as np
from scipy.optimize import minimize_scalar

from analytic.beyond_paper.drive import Motor
from analytic.kinematics.schedule import Steady
from analytic.mechanism import Mechanism
from analytic.mechanism.signals import AXES, turned_near
from analytic.mechanism.units import OFFERED, dimension, factor
from compare.diagnose.courses import course
from compare.diagnose.data.measured import ASTRAY
from compare.diagnose.data.recording import Channel, Fault, Measured, MeasuredError, MeasuredRun, same_numbers
from compare.diagnose.effects.effect import Rig
from compare.diagnose.effects.sensors import EncoderOffset
from compare.diagnose.noise import CLOSED, correlation_time
from compare.diagnose.predict import Hypothesis, Model, Motors, Term, commanded
from compare.recorded.alternatives import REVERSED, less, line, looks, mended, otherwise, swapped
from compare.recorded.frames import frame_name
from compare.recorded.headings import TIME, Column
from compare.recorded.text import MIN_ROWS

# times, by which a slip must bring readings nearer to the model, and by which they must be off in noise without it.  A
# genuine effect that happens to look like one would have to be what the slip makes of the readings to a fifth of it,
# over all that a turn shows: of some ten independent numbers, once in 5^10, ten million.
TELLING = 5.0
FAULT_SIGMAS = 5.0  # sigmas: by chance once in two million times, of some hundred sensors and runs that are looked at
UNLIKELY = math.log(1000)  # of a slip, log odds against it: there is one among some thousand columns
STARTS = 36  # zeros over a turn, 10 degrees apart, that are tried: a linkage's signals have few waves a turn
SCANNED = 60  # samples for that, of a turn at most: what turns too often takes long to follow
# rad: zeros of two runs that differ by less are one; what is between them is as an encoder's offset is (prior.py)
SAME_ZERO = 0.03
SEVERAL = 2.0  # turns of the crank, from which on what is alike in each is no matter of speed
WAVES = 8  # of a turn, of what a linkage lacks
STEPS = 4  # of Gauss and Newton for a rate: the problem is nearly linear
NUDGE = 1e-4  # rad, by which a motion is off at most for a difference: the square of it is below any noise
LARGEST = 1e300  # squares: of a motion that there is none of
Said = Mapping[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class Slip:
    """What one sensor, or two, of a run are not, ``off`` times their noise without it and ``left`` with it.

    ``columns`` are lines of [columns] that mend it, ``field`` one of the run itself.  A ``column`` whose ``zero`` (rad)
    is off, too, gets its line, and its text the zero, where all runs are known.
    """

    run: MeasuredRun
    signal: str
    kind: str
    text: str
    off: float
    left: float
    columns: tuple[str, ...] = ()
    field: str = ""
    column: Column | None = None
    zero: float = 0.0

    @property
    def told(self) -> float:
        """Sum of squares, in noise, that it takes away."""
        return self.run.time.size * (self.off**2 - self.left**2)


def refuse(measured: Measured, mechanism: Mechanism) -> None:
    """Refuse driven runs whose data are not what they say.  Raises MeasuredError, a sentence for each slip."""
    told(driven(measured, mechanism), measured.runs)


def told(slips: Sequence[Slip], runs: Sequence[MeasuredRun]) -> None:
    """Raise MeasuredError if there are any slips in these runs."""
    if slips:
        raise MeasuredError(*(f"{fault.run}: {fault.text}" for fault in as_faults(slips, runs, lambda run: run.file)))


def as_faults(
    slips: Sequence[Slip], runs: Sequence[MeasuredRun], called: Callable[[MeasuredRun], str] = lambda run: run.name
) -> list[Fault]:
    """The slips as faults of the data, each with the line that mends it: of all runs that have the sensor together."""
    faults = []
    for _, each in groupby(sorted(slips, key=_alike), _alike):
        alike = list(each)
        first, samples = alike[0], sum(slip.run.time.size for slip in alike)
        having = [run.name for run in runs if first.signal in (*run.channels, TIME.name)]
        everywhere = len(having) > 1 and [slip.run.name for slip in alike] == having
        names = " and ".join(repr(slip.run.name) for slip in alike)
        where = "every run" if everywhere else f"run{'s' * (len(alike) > 1)} {names}"
        off, left = max(slip.off for slip in alike), max(slip.left for slip in alike)
        text = (
            f"{first.text.format(where)}: as read it is {off:.3g} times the noise off the nominal model"
            f"{f', so mended {left:.3g} times' if left else ''}; "
        )
        mending = _mending_frames if all(run.file == frame_name(run.name) for run in runs) else _mending
        text += mending(alike, everywhere or len(runs) == 1)
        faults.append(Fault(called(first.run), first.signal, first.kind, samples, text))
    return faults


def _mending(alike: Sequence[Slip], everywhere: bool) -> str:
    """The lines of measured.toml that mend slips that are alike."""
    columns = alike[0].columns
    if columns and everywhere:
        return f"say {' and '.join(columns)} under [columns]"
    if columns:
        return f"say columns = {{ {', '.join(columns)} }} in {_of_runs(alike)}"
    return "; ".join(f"say {slip.field} in {_of_runs([slip])}" for slip in alike)


def _mending_frames(alike: Sequence[Slip], everywhere: bool) -> str:
    """The argument of ``lc.measured`` that does."""
    columns = {"columns": tomllib.loads("\n".join(alike[0].columns))}
    if alike[0].columns and everywhere:
        return f"say columns={columns['columns']}"
    return f"say runs={ {slip.run.name: columns if slip.columns else tomllib.loads(slip.field) for slip in alike} }"


def _of_runs(slips: Sequence[Slip]) -> str:
    return f"[[run]] {' and '.join(repr(slip.run.name) for slip in slips)}"


def _alike(slip: Slip) -> tuple[str, str, str, tuple[str, ...]]:
    return slip.kind, slip.signal, slip.text, slip.columns


# ---------------------------------------------------------------- runs


def driven(measured: Measured, mechanism: Mechanism) -> list[Slip]:
    """The slips of driven runs."""
    nominal = _Nominal(measured, mechanism)
    runs = [run for run in measured.runs if run.drive != "free"]
    return _without_effects(_with_zeros([slip for run in runs for slip in _of_run(nominal, run)]), runs)


def free(runs: Sequence[MeasuredRun], predicted: Sequence[Said]) -> list[Slip]:
    """The slips of free runs beside the model's readings (N,) by signal, of where each was let go."""
    each = [(run, said) for run, said in zip(runs, predicted, strict=True) if run.drive == "free"]
    found = [slip for run, said in each for slip in (_copies(run, said) or _of_channels(run, said, run.channels))]
    return _without_effects(found, [run for run, _ in each])


def _of_run(nominal: _Nominal, run: MeasuredRun) -> list[Slip]:
    """The slips of a driven run: the one of its drive that tells its readings, or those of its sensors."""
    judged = nominal.judged(run)
    (said,) = nominal.says(run)
    if said is None:
        return [whole[1]] if (whole := _of_drive(nominal, run, math.inf)) else []
    if useless := _copies(run, said) or _silent(nominal, run, said):
        return useless
    before, found = _cost(run, said, judged), _of_channels(run, said, judged)
    samples = sum(np.isfinite(run.channels[s].values).sum() for s in judged)
    if before <= TELLING**2 * samples:
        return found or _of_rate(nominal, run)
    after = before - sum(slip.told for slip in found)
    if len(found) == 1 and after < CLOSED**2 * samples:
        return found
    whole = _of_drive(nominal, run, before)
    # one that tells as much is as many times likelier as there are fewer of them
    if whole and whole[0] < after + 2 * UNLIKELY * (len(found) - 1):
        return [whole[1]]
    return found or _of_rate(nominal, run)


class _Nominal:
    """What the nominal linkage says of single driven runs."""

    def __init__(self, measured: Measured, mechanism: Mechanism) -> None:
        self.measured, self.mechanism = measured, mechanism
        self.encoders = [encoder.name for encoder in mechanism.encoders]

    def judged(self, run: MeasuredRun) -> list[str]:
        """The sensors that a run does not follow."""
        return [name for name in run.channels if run.drive != "measured" or name not in self.encoders]

    def says(
        self,
        run: MeasuredRun,
        hypotheses: Sequence[Hypothesis] = ((),),
        courses: Mapping[str, Motor | Motors] | None = None,
    ) -> list[Said | None]:
        """The readings (N,) by signal under each hypothesis; None where the linkage cannot make the run."""
        follows = (run.name,) if run.drive == "measured" else ()
        rig = Rig(self.mechanism, tuple(run.channels), (run.name,), (run.name,), follows)
        courses = self.courses(run) if courses is None else courses
        model = Model(replace(self.measured, runs=(run,)), rig, self.mechanism, courses)
        return [None if found is None else found[0] for found in model(hypotheses)]

    def drives(self, run: MeasuredRun, courses: Mapping[str, Motor | Motors]) -> np.ndarray:
        """Where the drives are (k, N) in a run."""
        motor = courses.get(run.name) or commanded(run, self.mechanism)
        return np.atleast_2d(motor.at(run.time).theta)

    def courses(self, run: MeasuredRun) -> dict[str, Motor | Motors]:
        """The course of a run that follows its encoders."""
        if run.drive != "measured":
            return {}
        each = tuple(course(run, encoder) for encoder in self.encoders)
        return {run.name: Motors(each) if self.mechanism.several else each[0]}


# ---------------------------------------------------------------- readings beside a prediction


@dataclass(frozen=True)
class _Match:
    """How far readings are off a prediction (rms), how they scatter about it, and what it spans (rms about its mean),
    all in noise; ``mean`` in SI.
    """

    off: float
    scatter: float
    span: float
    mean: float
    samples: int

    @property
    def alike(self) -> bool:
        """Whether the readings have the prediction's shape, as far as their noise tells."""
        chance = math.sqrt(8 / max(self.samples, 1))  # two sigmas of a mean square
        return self.span > TELLING * math.sqrt(max(self.scatter**2 - 1, chance))


def _match(channel: Channel, read: np.ndarray, predicted: np.ndarray) -> _Match:
    """Readings (N,) beside a prediction (N,) of a sensor, angles modulo whole turns."""
    here = np.isfinite(read) & np.isfinite(predicted)
    if not here.any():
        return _Match(0.0, 0.0, 0.0, 0.0, 0)
    off = read[here] - predicted[here]
    if channel.signal.wraps:
        off = off - turned_near(np.zeros(()), np.mean(off))
    sizes = np.array([np.sqrt(np.mean(off**2)), np.std(off), np.std(predicted[here])]) / channel.noise
    return _Match(float(sizes[0]), float(sizes[1]), float(sizes[2]), float(np.mean(off)), int(here.sum()))


def _cost(run: MeasuredRun, said: Said | None, judged: Iterable[str]) -> float:
    """Sum of squares, in noise, of all that a run's sensors are off; of a motion that is none, of all they vary."""
    total = 0.0
    for name in judged:
        channel = run.channels[name]
        flat = np.full(channel.values.shape, np.nanmean(channel.values))
        match = _match(channel, channel.values, flat if said is None else said[name])
        total += match.samples * match.off**2
    return total


def _column(channel: Channel) -> Column:
    """A sensor's column; of data that are of no file as a file would have it."""
    signal, unit = channel.signal, channel.unit
    heading = f"{signal.name} [{unit}]"
    return channel.column or Column(signal, unit, factor(unit, dimension(signal)), heading=heading)


# ---------------------------------------------------------------- single sensors, and two of them


def _copies(run: MeasuredRun, said: Said) -> list[Slip]:
    """Pairs of columns with the same numbers, of which the model says that they are not: noise is never the same."""
    found = []
    for a, b in combinations(run.channels, 2):
        one, other = run.channels[a], run.channels[b]
        if not same_numbers(one, other):
            continue
        factors = _column(one).factor, _column(other).factor
        noise = max(one.noise / factors[0], other.noise / factors[1])
        if not np.any(np.abs(said[a] / factors[0] - said[b] / factors[1]) > TELLING * noise):
            continue
        off = {s: _match(c, c.values, said[s]).off for s, c in ((a, one), (b, other))}
        of, copy = sorted(off, key=lambda s: off[s])
        heading = line(_column(run.channels[copy])).partition(" = ")[0]
        text = f"{copy} and {of} of {{}} are the same numbers: one column is there twice, and {copy} does not fit"
        found.append(Slip(run, copy, "copy", text, off[copy], off[of], (f'{heading} = "ignore"',)))
    return found


def _silent(nominal: _Nominal, run: MeasuredRun, said: Said) -> list[Slip]:
    """Sensors that read nothing of their prediction, nor of what is left of it in a rig that lies flat."""
    silent = [s for s in nominal.judged(run) if s in said and _reads_nothing(run.channels[s], said[s])]
    if not silent:
        return []
    (flat,) = _Nominal(nominal.measured, nominal.mechanism.replace(gravity=(0.0, 0.0))).says(run)
    found = []
    for s in silent:
        channel = run.channels[s]
        if flat is None or not _reads_nothing(channel, flat[s]):
            continue
        text = f"{s} of {{}} reads nothing but noise: it is not connected, or measures something else"
        heading = line(_column(channel)).partition(" = ")[0]
        off = _match(channel, channel.values, said[s]).off
        found.append(Slip(run, s, "silent", text, off, 0.0, (f'{heading} = "ignore"',)))
    return found


def _reads_nothing(channel: Channel, predicted: np.ndarray) -> bool:
    """Whether readings (N,) stay where they are, or vary far less than their prediction (N,), not with it, and from
    line to line as much as altogether: half the mean square of their steps over their variance is 1, give or take
    1 / root N, for white noise (von Neumann), and next to nothing for a motion.
    """
    here = np.isfinite(channel.values) & np.isfinite(predicted)
    if not here.any():
        return False
    read, said = (v[here] - v[here].mean() for v in (channel.values, predicted))
    if np.std(said) <= TELLING**2 * max(np.std(read), channel.noise):
        return False
    if not np.ptp(channel.values[here]):
        return True
    alone = abs(read @ said) < FAULT_SIGMAS * np.linalg.norm(said) * np.std(read)
    white = np.mean(np.diff(read) ** 2) / 2 > np.var(read) * (1 - FAULT_SIGMAS / math.sqrt(read.size))
    return bool(alone and white)


def _of_channels(run: MeasuredRun, said: Said, judged: Iterable[str]) -> list[Slip]:
    """The slips of single sensors, and those that are in each other's place."""
    off = {s: _match(run.channels[s], run.channels[s].values, said[s]) for s in judged if s in said}
    off = {s: match for s, match in off.items() if match.off > TELLING}
    found: dict[str, Slip] = {}
    for a, b in combinations(off, 2):
        slip = _swapped(run, said, a, b, off)
        if slip is not None and all(s not in found or slip.left < found[s].left for s in (a, b)):
            found = {s: each for s, each in found.items() if each not in [found.get(a), found.get(b)]}
            found |= {a: slip, b: slip}
    for s, match in off.items():
        alone = _converted(run, s, said[s], match) or _zero(run, s, match)
        if alone is not None and (s not in found or alone.left * TELLING < found[s].left):
            found = {name: each for name, each in found.items() if each is not found.get(s)} | {s: alone}
    return list(dict.fromkeys(found.values()))


def _swapped(run: MeasuredRun, said: Said, a: str, b: str, off: Mapping[str, _Match]) -> Slip | None:
    """Two sensors each of which is the other's prediction, as its column's numbers are in the other's unit."""
    one, other = run.channels[a], run.channels[b]
    units = _column(one).factor / _column(other).factor
    noises = [c.noise * k for c, k in ((one, 1 / units), (other, units))]  # where they are estimated, they go along
    pairs = zip((one, other), (other, one), noises, strict=True)
    meant = [d if c.noise_given else replace(d, noise=noise) for c, d, noise in pairs]
    there = _match(meant[0], one.values / units, said[b]), _match(meant[1], other.values * units, said[a])
    before, after = (math.hypot(*(m.off for m in each)) for each in ((off[a], off[b]), there))
    if not all(match.alike for match in there) or before <= TELLING * after:
        return None
    text = f"{a} and {b} of {{}} look swapped: each is the other's prediction and not its own"
    return Slip(run, a, "swapped", text, before, after, swapped(_column(one), _column(other)))


def _converted(run: MeasuredRun, name: str, predicted: np.ndarray, off: _Match) -> Slip | None:
    """A sensor that is its prediction in another unit, converted twice, or of the other sign."""
    channel = run.channels[name]
    here = np.isfinite(channel.values) & np.isfinite(predicted)
    read = dimension(channel.signal), channel.unit, predicted[here], channel.values[here]
    found = looks(*read, channel.noise) or looks(*read)  # what is stated of its noise may be of other units
    if found is None:
        return None
    slope, what = found
    meant, unit = mended(_column(channel), what), "" if what == REVERSED else f", but its column says {channel.unit}"
    readings = _column(channel).readings(channel.values)
    share = abs(meant.step / _column(channel).step)
    there = _match(replace(channel, noise=channel.noise * share), meant.si(readings), predicted)
    if off.scatter <= TELLING * max(there.scatter * share, 1.0) and what != REVERSED:
        return None
    text = f"{name} of {{}} is {slope:.4g} times its prediction: it looks {what}{unit}"
    left = there.off * (share if channel.noise_given else 1.0)  # a stated noise stays as it is
    return Slip(run, name, "sign" if what == REVERSED else "unit", text, off.off, left, (line(meant),))


def _zero(run: MeasuredRun, name: str, off: _Match) -> Slip | None:
    """An angle that is its prediction but for a constant that no zero is off by."""
    channel = run.channels[name]
    if not channel.signal.wraps or abs(off.mean) < ASTRAY or not off.alike or off.off <= TELLING * off.scatter:
        return None
    text = f"{name} of {{}} reads {math.degrees(off.mean):.4g} deg too much throughout: its zero is elsewhere"
    return Slip(run, name, "zero", text, off.off, off.scatter, (less(_column(channel), off.mean),))


def _without_effects(slips: Sequence[Slip], runs: Sequence[MeasuredRun]) -> list[Slip]:
    """The slips but for signs that are effects: both axes of a load cell in all of its runs, mounted upside down, and
    all forces and torques of a run, whose load is another.
    """
    turned = {(s.run.name, s.signal) for s in slips if s.kind == "sign"}
    out: set[tuple[str, str]] = set()
    for run in runs:
        forces = {(run.name, s) for s, c in run.channels.items() if c.signal.kind in ("reaction", "drive")}
        out |= forces if len({run.channels[s].signal.place for _, s in forces}) > 1 and forces <= turned else set()
        for channel in run.channels.values():
            signal = channel.signal
            cell = [signal.sibling(axis).name for axis in AXES] if signal.kind == "reaction" else []
            all_runs = {(each.name, s) for each in runs for s in cell if s in each.channels}
            both = all(len({s for _, s in all_runs if _ == name}) in (0, 2) for name in {n for n, _ in all_runs})
            out |= all_runs if cell and both and all_runs <= turned else set()
    return [s for s in slips if s.kind != "sign" or (s.run.name, s.signal) not in out]


# ---------------------------------------------------------------- the drive of a run


def _of_drive(nominal: _Nominal, run: MeasuredRun, before: float) -> tuple[float, Slip] | None:
    """The one change of what a run's drive is said to do that tells all of its sensors, with the squares it leaves:
    the zero, sign or unit of an encoder that it follows, or another in its place; of a commanded run without an
    encoder its angle.
    """
    judged = nominal.judged(run)
    before = min(before, _cost(run, None, judged))
    samples = sum(np.isfinite(run.channels[s].values).sum() for s in judged)
    best: tuple[float, Slip] | None = None
    for after, slip in _drives(nominal, run, before):
        if before > TELLING**2 * after and (best is None or after < best[0]):
            off, left = (math.sqrt(total / samples) for total in (before, after))
            best = after, replace(slip, off=off, left=left)
            if left < CLOSED:  # nothing could tell more
                break
    return best


def _drives(nominal: _Nominal, run: MeasuredRun, before: float) -> Iterator[tuple[float, Slip]]:
    """Each change of what is said of a run's drive, with the squares that it leaves."""
    for encoder in nominal.encoders if run.drive == "measured" else ():
        yield from _encoders(nominal, run, encoder, before)
    clock = run.clock or Column(TIME, "s", 1.0, heading="time [s]")
    for unit in OFFERED["time"]:
        meant = otherwise(clock, unit)
        if meant.factor != clock.factor:
            there = replace(run, time=meant.si(clock.readings(run.time)))
            (said,) = nominal.says(there)
            text = f"time of {{}} looks in {unit}, but its column says {clock.unit}"
            yield _cost(run, said, nominal.judged(run)), Slip(run, TIME.name, "unit", text, 0, 0, (line(meant),))
    if run.drive == "speed" and nominal.encoders[0] not in run.channels and nominal.mechanism.cranked:
        after, zero = _best_zero(nominal, run, nominal.encoders[0], before)
        if abs(zero) > ASTRAY:
            text = f"{{}} is {math.degrees(zero):.4g} deg ahead of its command throughout, as all sensors have it"
            angle = (run.angle or 0.0) + zero
            yield after, Slip(run, TIME.name, "zero", text, 0, 0, (), f"drive_angle = {angle:.6g}")


def _encoders(nominal: _Nominal, run: MeasuredRun, encoder: str, before: float) -> Iterator[tuple[float, Slip]]:
    """What the encoder that a run follows may be instead."""
    channel, judged = run.channels[encoder], nominal.judged(run)
    kind, column = dimension(channel.signal), _column(channel)
    readings = column.readings(channel.values)
    units = {f"in {unit}": otherwise(column, unit) for unit in OFFERED[kind] if factor(unit, kind) != column.factor}
    if column.factor == 1:
        twice = {f"converted from {unit} twice": 1 / factor(unit, kind) for unit in OFFERED[kind]}
        units |= {what: otherwise(column, column.unit, scale=k) for what, k in twice.items() if k != 1}
    for what, meant in ({"": column, REVERSED: otherwise(column, column.unit, -1)} | units).items():
        after, zero = _best_zero(nominal, run, encoder, before, *_line(readings, channel.values, meant))
        if what or abs(zero) > ASTRAY:
            text = f"{encoder} of {{}}, which its drive follows, {f'is {what}' if what else ''}"
            kind_of = "zero" if not what else "sign" if what == REVERSED else "unit"
            zero = zero if abs(zero) > ASTRAY else 0.0
            yield after, Slip(run, encoder, kind_of, text, 0, 0, column=meant, zero=zero)
    for name in judged:
        other = run.channels[name]
        ratio = column.factor / _column(other).factor
        pair = replace(channel, values=other.values * ratio), replace(other, values=channel.values / ratio)
        there = replace(run, channels={**run.channels, encoder: pair[0], name: pair[1]})
        few = _first_turn(there, nominal.drives(there, nominal.courses(there)))
        (said,) = nominal.says(few, courses=nominal.courses(there))
        if TELLING**2 * _cost(few, said, judged) * run.time.size < before * few.time.size:
            (said,) = nominal.says(there)
            text = f"{encoder} and {name} of {{}} look swapped: all sensors fit the other way round"
            lines = swapped(column, _column(other))
            yield _cost(there, said, judged), Slip(run, encoder, "swapped", text, 0, 0, lines)


def _line(readings: np.ndarray, values: np.ndarray, meant: Column) -> tuple[float, float]:
    """Factor and constant by which values (N,), SI, become those of their readings (N,) in another column."""
    here = np.isfinite(values)
    factor, constant = np.polyfit(values[here], meant.si(readings[here]), 1)
    return float(factor), float(constant)


@dataclass(frozen=True)
class _Scaled:
    """A course times a factor and with a constant: that of an encoder's readings in another unit, as a smooth course
    is the same in any.
    """

    motor: Motor
    factor: float
    constant: float

    def __call__(self, time: np.ndarray, order: int = 0, /) -> np.ndarray:
        assert not isinstance(self.motor.command, Steady)
        return self.factor * self.motor.command(time, order) + (self.constant if order == 0 else 0.0)


def _best_zero(
    nominal: _Nominal, run: MeasuredRun, encoder: str, before: float, factor: float = 1.0, constant: float = 0.0
) -> tuple[float, float]:
    """By how much (rad) the encoder that a run follows reads too much, or its command says too little, within half a
    turn, and the squares that this leaves of those ``before``, infinite where they are as many; of a travel nothing.
    Its readings are times a factor, and a constant.
    """
    judged, signal = nominal.judged(run), nominal.mechanism.encoders[nominal.encoders.index(encoder)]
    courses = nominal.courses(run)
    if (factor, constant) != (1.0, 0.0):
        of, followed = nominal.encoders.index(encoder), courses[run.name]
        each = list(followed.each if isinstance(followed, Motors) else (followed,))
        each[of] = Motor(_Scaled(each[of], factor, constant))
        courses = {run.name: Motors(tuple(each)) if isinstance(followed, Motors) else each[0]}

    few = _first_turn(run, nominal.drives(run, courses))
    samples = [sum(np.isfinite(each.channels[s].values).sum() for s in judged) for each in (few, run)]

    def left(zeros: np.ndarray, of: MeasuredRun) -> list[float]:
        if run.drive == "measured":
            term = Term(EncoderOffset(), encoder)
            said = nominal.says(of, [[(term, {"offset": float(zero)})] for zero in zeros], courses)
        else:
            said = [nominal.says(replace(of, angle=(of.angle or 0.0) + float(zero)))[0] for zero in zeros]
        return [_cost(of, each, judged) if each is not None else math.inf for each in said]

    if not signal.wraps:
        return left(np.zeros(1), run)[0], 0.0
    step = 2 * math.pi / STARTS
    zeros = step * np.arange(-STARTS // 2, STARTS // 2)
    zero = float(zeros[int(np.argmin(left(zeros, few)))])

    def cost(at: float) -> float:
        return min(left(np.array([at]), few)[0], LARGEST)

    best = minimize_scalar(cost, bounds=(zero - step, zero + step), method="bounded", options={"xatol": 1e-6})
    zero = float(best.x)
    if TELLING**2 * best.fun * samples[1] > before * samples[0]:
        return math.inf, 0.0
    return left(np.array([zero]), run)[0], float(turned_near(zero, 0.0))


def _first_turn(run: MeasuredRun, theta: np.ndarray) -> MeasuredRun:
    """The first turn of a run whose drive is at theta (k, N), or so much of it as there is, of a few samples."""
    gone = np.abs(theta - theta[:, :1]).max(axis=0)
    rows = np.arange(max(MIN_ROWS, int(np.argmax(gone > 2 * math.pi)) or run.time.size))[: run.time.size]
    rows = rows[:: max(1, rows.size // SCANNED)]
    return replace(run, time=run.time[rows], channels={s: c.at(rows) for s, c in run.channels.items()})


def _with_zeros(slips: Sequence[Slip]) -> list[Slip]:
    """The slips, those of encoders whose zeros are to be said with their texts and lines: one zero for all runs in
    which it is the same, but for what an encoder's offset may be.
    """
    found, zeros = [], dict[tuple[str, str], list[float]]()
    for slip in slips:
        if slip.column is None:
            found.append(slip)
            continue
        known = zeros.setdefault((slip.signal, slip.text), [])
        near = (z for z in known if abs(slip.zero - z - turned_near(0.0, slip.zero - z)) < SAME_ZERO)
        zero = next(near, slip.zero)
        known.append(zero)
        words = [slip.text.rstrip(), f"reads {math.degrees(zero):.4g} deg too much throughout"][: 1 + bool(zero)]
        joint = " " if slip.kind == "zero" else " and "
        columns = (less(slip.column, zero) if zero else line(slip.column),)
        found.append(replace(slip, text=f"{joint.join(words)}, as all other sensors have it", columns=columns))
    return found


# ---------------------------------------------------------------- speed


def _of_rate(nominal: _Nominal, run: MeasuredRun) -> list[Slip]:
    """A commanded run whose sensors all say that it turns at another constant speed than its command."""
    if run.drive != "speed" or not run.speed or not nominal.mechanism.cranked:
        return []
    off = _Rates(nominal, run).found()
    beside = "" if off else ", whatever else they are off in every turn alike"
    off = off or _Rates(nominal, run, lacking=True).found()
    if off is None:
        return []
    rate, error, before, after = off
    how = "faster" if rate > 0 else "slower"
    said = f"{100 * abs(rate):.2g} % {how} than its drive_speed, as all of its sensors have it{beside}"
    text = f"the drive of {{}} is {said}"
    said = f"drive_speed = {run.speed * (1 + rate):.{max(3, math.ceil(-math.log10(error)))}g}"
    return [Slip(run, TIME.name, "speed", text, before, after, (), said)]


class _Rates:
    """A commanded run at speeds near its command, with its angle and its encoder's zero left open: neither is a matter
    of speed.  Nor is what a linkage is ``lacking``, whose readings are then off in every turn alike: over several turns
    that is left open, too, sensor by sensor.
    """

    def __init__(self, nominal: _Nominal, run: MeasuredRun, lacking: bool = False) -> None:
        self.nominal, self.run, self.speed = nominal, run, run.speed or 1.0
        self.parts = [np.isfinite(channel.values) for channel in run.channels.values()]
        sizes = np.cumsum([0, *(part.sum() for part in self.parts)]).tolist()
        self.places = {s: slice(*sizes[k : k + 2]) for k, s in enumerate(run.channels)}
        self.lacking = lacking and abs(self.speed) * float(np.ptp(run.time)) >= SEVERAL * math.tau
        self.nudges = NUDGE / (abs(self.speed) * float(np.abs(run.time).max())), NUDGE

    def residual(self, rate: float, angle: float) -> np.ndarray | None:
        """All that the sensors are off (n,), in noise."""
        run = self.run
        (said,) = self.nominal.says(replace(run, speed=self.speed * (1 + rate), angle=(run.angle or 0.0) + angle))
        if said is None:
            return None
        off = []
        for part, (name, channel) in zip(self.parts, run.channels.items(), strict=True):
            each = channel.values[part] - said[name][part]
            turns = turned_near(np.zeros(()), np.mean(each)) if channel.signal.wraps else 0.0
            off.append((each - turns) / channel.noise)
        found = np.concatenate(off)
        return found if np.isfinite(found).all() else None

    def columns(self, rate: float, angle: float, here: np.ndarray) -> np.ndarray | None:
        """What the residual (n,) answers to the rate, the angle, and the encoder's zero or what is alike in every turn
        (n, k).
        """
        shifted = (rate + self.nudges[0], angle), (rate, angle + self.nudges[1])
        there = [self.residual(*each) for each in shifted]
        if any(each is None for each in there):
            return None
        found = [(each - here) / nudge for each, nudge in zip(there, self.nudges, strict=True) if each is not None]
        encoder = self.nominal.encoders[0]
        if encoder in self.places and not self.lacking:
            zero = np.zeros(here.size)
            zero[self.places[encoder]] = -1 / self.run.channels[encoder].noise
            found.append(zero)
        return np.column_stack([*found, self._waves(rate)] if self.lacking else found)

    def _waves(self, rate: float) -> np.ndarray:
        """Waves of a turn (n, k) of each sensor alone."""
        run, turned = self.run, self.speed * (1 + rate) * self.run.time
        size = sum(int(part.sum()) for part in self.parts)
        waves = np.exp(1j * np.outer(turned, np.arange(WAVES + 1)))
        of_turn = np.hstack([waves.real, waves.imag[:, 1:]])
        blocks = [of_turn[part] for part in self.parts]
        every = np.zeros((size, of_turn.shape[1] * len(blocks)))
        for k, (name, block) in enumerate(zip(run.channels, blocks, strict=True)):
            every[self.places[name], k * of_turn.shape[1] : (k + 1) * of_turn.shape[1]] = block
        return every

    def found(self) -> tuple[float, float, float, float] | None:
        """By how much (relative) the speed is off, its one sigma, and the rms without and with that; None if it is not,
        for sure.
        """
        rate, angle = 0.0, 0.0
        here, columns = self.beside(rate, angle)
        before = _left(here, columns[:, 1:])
        if before - _left(here, columns) < FAULT_SIGMAS**2:  # no rate would show
            return None
        for _ in range(STEPS):
            change = np.linalg.lstsq(columns, -here, rcond=None)[0]
            rate, angle = rate + float(change[0]), angle + float(change[1])
            here, columns = self.beside(rate, angle)
        after = _left(here, columns)
        spread, error = math.sqrt(after / here.size), _error(columns)
        sure, clear = abs(rate) > FAULT_SIGMAS * error * max(spread, 1.0), before > TELLING**2 * max(after, here.size)
        if not (sure and clear and self._agreed(rate, here, columns)):
            return None
        return rate, error, math.sqrt(before / here.size), spread

    def beside(self, rate: float, angle: float) -> tuple[np.ndarray, np.ndarray]:
        """The residual (n,) and its columns there; a residual of nothing where the linkage cannot be moved so."""
        here = self.residual(rate, angle)
        columns = None if here is None else self.columns(rate, angle, here)
        return (np.zeros(1), np.zeros((1, 2))) if here is None or columns is None else (here, columns)

    def _agreed(self, rate: float, residual: np.ndarray, columns: np.ndarray) -> bool:
        """Whether some sensor tells a speed so much off, and none that could tell it another."""
        telling = False
        for place in self.places.values():
            own, rest = columns[place], residual[place]
            own = own[:, [0, 1, *(2 + np.flatnonzero(own[:, 2:].any(axis=0)))]] if self.lacking else own[:, :2]
            if rest.size <= own.shape[1]:
                continue
            other = np.linalg.lstsq(own, -rest, rcond=None)[0]
            gap = rest + own @ other  # what the rig lacks is alike over samples
            unsure = FAULT_SIGMAS * _error(own) * max(1.0, math.sqrt(np.mean(gap**2) * correlation_time(gap)))
            if unsure < abs(rate):
                telling = True
                if abs(float(other[0])) > unsure:
                    return False
        return telling


def _left(residual: np.ndarray, columns: np.ndarray) -> float:
    """The squares of a residual (n,) that columns (n, k) leave."""
    return float(np.sum((residual - columns @ np.linalg.lstsq(columns, residual, rcond=None)[0]) ** 2))


def _error(columns: np.ndarray) -> float:
    """One sigma of the first coefficient of columns (n, k)."""
    others = columns[:, 1:]
    left = _left(columns[:, 0], others)
    return 1 / math.sqrt(left) if left > 0 else math.inf

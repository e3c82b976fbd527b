"""What contact did, as a reader takes it in: averages over revolutions with their intervals; engines held together."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence, Set
from dataclasses import dataclass, replace

from analytic.mechanism.one_line import count
from compare.quantities import number, plain
from compare.results.contact import (
    STATISTICS,
    Compared,
    Contact,
    JointContact,
    StatisticName,
)
from compare.results.crosscheck import CrossCheck

WEAR = "integral of normal force times sliding over a revolution, to which Archard's law has wear in proportion"
RUBS = "at the rim of a pin of pin_radius, 10 mm where the mechanism gives none"
FRICTION = f"energy that friction in the contact takes in a revolution, {RUBS}"
RESTITUTION = "energy that the normal force takes in a revolution, less what the wall gives back"
PEAK_RATIO = "largest force of the run over the ideal linkage's largest"
LARGER = {"N": "kN", "mN·s": "N·s", "mm/s": "m/s", "mJ": "J", "N·mm": "N·m", "µm": "mm"}  # units of a thousand each
PEAKS_APART = 1.3  # times another run's peak force, beyond which one asks which of them to quote
PEAKS = (
    "peak forces of impacts are those of each engine's law, stiffness and step of contact: quote the RMS force and the"
    " impulse of impacts, or name one contact_law and contact_stiffness for all"
)
LEAST_TO_REPEAT = 5  # revolutions, below which nothing tells whether a motion repeats itself
ASCII_UNITS = str.maketrans({"·": ".", "µ": "u", "\u2212": "-"})  # of units
BALANCED = 0.001  # per cent of an energy: what is missing below is nothing
LOSSES = ("restitution_loss", "friction_loss")  # contact gives no energy: what is below 0 is 0, known that well
ENGINE_ROUNDING = 1e-6  # of the energy lost in contact: a smaller loss is an engine's rounding, and read as 0


@dataclass(frozen=True)
class Measure:
    """A statistic as people read it: ``factor`` times the SI value is in ``unit``; ``meaning`` says what it is."""

    key: str
    name: str
    unit: str
    factor: float
    meaning: str

    def fitting(self, *values: float | None) -> Measure:
        """The measure in the unit in which the largest of some values (SI) is below a thousand, where there is one."""
        largest = max((abs(self.factor * v) for v in values if v is not None), default=0.0)
        if largest < 1e3 or self.unit not in LARGER:
            return self
        return replace(self, unit=LARGER[self.unit], factor=1e-3 * self.factor)

    def read(self, value: float | None) -> float | None:
        """An SI value in the unit."""
        return None if value is None else self.factor * value

    @property
    def title(self) -> str:
        """Its name as a row begins with it, and its unit."""
        return f"{self.name[:1].upper()}{self.name[1:]}" + (f" ({self.unit})" if self.unit else "")


MEASURES = {
    measure.key: measure
    for measure in (
        Measure("free_share", "free share", "%", 1e2, "share of the time that the pin is off its wall, by distance"),
        Measure("impacts", "impacts per revolution", "", 1.0, "times that a free pin strikes its wall in a revolution"),
        Measure("impulse", "impulse of impacts", "mN·s", 1e3, "normal impulse of these impacts in a revolution"),
        Measure("approach_speed", "approach speed", "mm/s", 1e3, "fastest approach of an impact in a revolution"),
        Measure("rms_force", "RMS force", "N", 1.0, "root mean square of the contact force"),
        Measure("peak_force", "peak force", "N", 1.0, "largest contact force in a revolution"),
        Measure("high_peak", "peak force, 9 of 10 below", "N", 1.0, "what nine in ten of these peaks stay below"),
        Measure("restitution_loss", "restitution loss", "mJ", 1e3, RESTITUTION),
        Measure("friction_loss", "friction loss", "mJ", 1e3, FRICTION),
        Measure("wear", "load times sliding distance", "N·mm", 1e3, f"{WEAR}, {RUBS}"),
        Measure("penetration", "penetration", "µm", 1e6, "deepest penetration in a revolution"),
        Measure("peak_ratio", "peak over ideal reaction", "", 1.0, PEAK_RATIO),
    )
}
MEANING_OF_BLOCKS = {  # where it is another
    "free_share": "share of the time that no corner of the block is at its wall, by distance",
    "impacts": "times that a free corner of the block strikes its wall in a revolution",
    "rms_force": "root mean square of the force on the corner that is pressed most",
    "peak_force": "largest force on a corner in a revolution",
    "friction_loss": "energy that friction at the corners takes in a revolution",
    "wear": f"{WEAR}, all corners together",
    "peak_ratio": "largest force on a corner over the largest that the ideal linkage's reaction and moment put on one",
}
OF_BLOCKS = MEASURES | {key: replace(MEASURES[key], meaning=meaning) for key, meaning in MEANING_OF_BLOCKS.items()}
OF_BLOCKS["peak_ratio"] = replace(OF_BLOCKS["peak_ratio"], name="peak over ideal corner force")


@dataclass(frozen=True)
class Value:
    """A statistic of a run, in its measure's unit, with the ends of its 95 % interval; None where there is none."""

    value: float | None
    low: float | None = None
    high: float | None = None

    @property
    def known(self) -> bool:
        """Whether it has an interval."""
        return self.low is not None and self.high is not None

    def said(self, say: Callable[..., str] = number) -> str:
        """Value and interval: ``10.5 (9.27 to 11.8)``."""
        return say(self.value) + (f" ({say(self.low)} to {say(self.high)})" if self.known else "")


@dataclass(frozen=True)
class RunContact:
    """What contact did in a run, in words."""

    run: str
    contact: Contact

    @property
    def repeats(self) -> str:
        """Whether the motion repeats itself; empty where nothing strikes."""
        period = self.contact.period
        if not self.contact.struck:
            return ""
        if period is not None:
            return f"the motion repeats itself every {count(period, 'revolution') if period > 1 else 'revolution'}"
        if self.contact.revolutions < LEAST_TO_REPEAT:
            return "too few revolutions to tell whether the motion repeats itself"
        return "the motion does not repeat itself"

    @property
    def energy(self) -> str:
        """How well the energy of the run is balanced; empty where nothing strikes."""
        balance = self.contact.energy
        if not self.contact.struck:
            return ""
        if balance is None:
            return "energy is not balanced, as friction of a joint grows with its load"
        if balance.share is None:
            return ""
        percent = 100 * balance.share
        known = f"to {plain(percent, 2)}" if percent >= BALANCED else f"within {BALANCED}"
        return f"energy is balanced {known} % of what the motor turns over"

    @property
    def sentence(self) -> str:
        """How well its averages are known, whether it repeats itself, and what its energy misses."""
        return "; ".join(filter(None, (self.contact.words, self.repeats, self.energy)))


@dataclass(frozen=True)
class StatisticsTable:
    """Every statistic of one joint, a column of values for each run in which it was watched."""

    joint: str
    runs: tuple[str, ...]
    rows: tuple[tuple[Measure, tuple[Value, ...]], ...]

    @property
    def lost(self) -> bool:
        """Whether contact was lost in any run."""
        return any(value.value for name in ("free_share", "impacts") for value in self.of(name)[1])

    def of(self, name: StatisticName) -> tuple[Measure, tuple[Value, ...]]:
        """One statistic's values, run by run."""
        return next(row for row in self.rows if row[0].key == name)


@dataclass(frozen=True)
class ShownComparison:
    """A statistic of two runs, held against each other, in its measure's unit."""

    measure: Measure
    joint: str
    values: tuple[float | None, float | None]
    difference: float | None
    allowed: float | None
    verdict: str
    reason: str

    def sentence(self, say: Callable[..., str] = plain) -> str:
        """The row in words: ``free share of B: 10.5 and 8.94 %, may differ by 2.1``."""
        one, other = map(say, self.values)
        unit = f" {self.measure.unit}" if self.measure.unit else ""
        return f"{self.measure.name} of {self.joint}: {one} and {other}{unit}, may differ by {say(self.allowed)}"


@dataclass(frozen=True)
class EnginePair:
    """Two engines with one joint model: their statistics that were judged, and once why others were not."""

    between: tuple[str, str]
    joint_model: str
    rows: tuple[ShownComparison, ...]  # every one of them
    unjudged: tuple[str, ...]  # reasons

    @property
    def title(self) -> str:
        """Names of the two engines, and their joint model."""
        return f"{' and '.join(self.between)}, {self.joint_model}"

    @property
    def judged(self) -> list[ShownComparison]:
        """Rows with a verdict."""
        return [row for row in self.rows if row.verdict != "unjudged"]

    @property
    def wrong(self) -> list[ShownComparison]:
        """Rows that disagree."""
        return [row for row in self.rows if row.verdict == "disagrees"]

    @property
    def verdict(self) -> str:
        """The verdict on all its rows together."""
        return "disagrees" if self.wrong else "agrees" if self.judged else "unjudged"

    @property
    def sentence(self) -> str:
        """How many of its statistics agree, and why others are not judged."""
        agree = f"{len(self.judged) - len(self.wrong)} of {count(len(self.judged), 'statistic')} agree"
        others = [f"not judged: {reason}" for reason in self.unjudged]
        return "; ".join([agree] * bool(self.judged) + others)


@dataclass(frozen=True)
class ContactShown:
    """What contact did in all runs of a result."""

    runs: tuple[RunContact, ...] = ()
    tables: tuple[StatisticsTable, ...] = ()
    pairs: tuple[EnginePair, ...] = ()

    @property
    def by_sentence(self) -> list[tuple[str, bool, list[str]]]:
        """What contact did, whether averages are known well, and the runs of which that is said."""
        titles: dict[tuple[str, bool], list[str]] = {}
        for run in self.runs:
            titles.setdefault((run.sentence, run.contact.converged), []).append(run.run)
        return [(*said, runs) for said, runs in titles.items()]

    @property
    def measures(self) -> list[Measure]:
        """What the tables tell, in order; twice what means another thing of pins than of blocks."""
        by_meaning: dict[str, Measure] = {}
        for measure, _ in (row for table in self.tables for row in table.rows):
            by_meaning.setdefault(measure.meaning, measure)
        return list(by_meaning.values())

    @property
    def caution(self) -> str:
        """What to quote where the peaks of impacts are far apart; empty where they are not."""
        struck = {run.run for run in self.runs if run.contact.struck}
        for table in self.tables:
            shown = zip(table.runs, table.of("peak_force")[1], strict=True)
            peaks = [peak.value for title, peak in shown if title in struck and peak.value]
            if peaks and max(peaks) > PEAKS_APART * min(peaks):
                return PEAKS
        return ""

    def headline(self, say: Callable[..., str] = number) -> str:
        """What two engines' statistics say of each other, in a sentence; empty where nothing was held together."""
        judged = [(pair, row) for pair in self.pairs for row in pair.judged]
        wrong = [(pair, row) for pair, row in judged if row.verdict == "disagrees"]
        if not self.pairs:
            return ""
        if not judged:
            return "No statistics of contact were judged between engines."
        if not wrong:
            return f"All {len(judged)} judged statistics of contact agree between engines."
        pair, row = max(wrong, key=lambda one: abs(one[1].difference or 0.0) / (one[1].allowed or 1e-300))
        some = f"{len(wrong)} of {count(len(judged), 'statistic')} of contact"
        verb = "disagrees" if len(wrong) == 1 else "disagree"
        return f"{some} {verb} between engines, worst {row.sentence(say)} ({pair.title})."


@dataclass(frozen=True)
class Steadiness:
    """Whether the statistics of a run of so many ``turns`` have converged: all are known ``within`` a share over its
    ``whole`` revolutions, or one of a joint, the ``worst``, is not.  Where nothing left its wall, all are ``touching``.
    """

    converged: bool
    turns: float
    whole: int = 0
    worst: tuple[str, StatisticName] | None = None
    within: float = 0.0
    touching: bool = False


def steadiness(steady: Steadiness, loose: Sequence[str]) -> str:
    """How well the averages of a run are known; what is ``loose`` in it: pins, blocks."""
    revolutions = count(steady.whole, "revolution")
    if steady.touching:
        return f"no {' and no '.join(loose)} leaves its wall in {count(f'{steady.turns:.3g}', 'revolution')}"
    if not steady.whole:
        return "the crank makes no whole revolution, so that there are no averages"
    if steady.converged:
        return f"averages over {revolutions} are known to {100 * steady.within:g} %"
    if steady.worst is None:
        return f"{revolutions} {'is' if steady.whole == 1 else 'are'} too few for averages"
    joint, statistic = steady.worst
    return (
        f"after {revolutions} the {statistic.replace('_', ' ')} of {joint} is known to {100 * steady.within:.2g} % only"
    )


def no_longer_run(words: str, why: str) -> str:
    """How well the averages are known of a run that could not be made longer."""
    return f"{words}; a longer run failed ({why})"


def describe(result: CrossCheck) -> ContactShown:
    """What contact did in all runs of a result."""
    watched = [RunContact(run.title, run.contact) for run in result.runs if run.contact is not None]
    joints = dict.fromkeys(joint for run in watched for joint in run.contact.joints)
    blocks = {joint.name for joint in result.mechanism.joints if joint.prismatic}
    tables = tuple(_table(joint, watched, joint in blocks) for joint in joints)
    return ContactShown(tuple(watched), tables, tuple(_pairs(result.statistics, blocks)))


def _table(joint: str, runs: Sequence[RunContact], block: bool) -> StatisticsTable:
    watched = [run for run in runs if joint in run.contact.joints]
    contacts = [run.contact.joints[joint] for run in watched]
    rows = [_row(name, contacts, block) for name in STATISTICS]
    rows.append((_measure("peak_ratio", block), tuple(Value(contact.peak_ratio) for contact in contacts)))
    return StatisticsTable(joint, tuple(run.run for run in watched), tuple(rows))


def _measure(name: str, block: bool) -> Measure:
    return OF_BLOCKS[name] if block else MEASURES[name]


def _row(name: StatisticName, joints: Sequence[JointContact], block: bool) -> tuple[Measure, tuple[Value, ...]]:
    """One statistic of a joint in several runs."""
    ends = [_ends(joint, name) for joint in joints]
    measure = _measure(name, block).fitting(*(v for each in ends for v in each))
    return measure, tuple(Value(*map(measure.read, each)) for each in ends)


def _ends(joint: JointContact, name: StatisticName) -> tuple[float | None, ...]:
    """Value and interval, SI."""
    statistic, loss = joint.statistics[name], joint.statistics["restitution_loss"].value
    if name == "friction_loss" and abs(statistic.value or 0.0) < ENGINE_ROUNDING * abs(loss or 0.0):
        return (0.0,)
    if name in LOSSES and (statistic.value or 0.0) < 0 and (statistic.high is None or statistic.high < 0):
        missed = max(abs(end) for end in (statistic.value, statistic.low) if end is not None)
        return 0.0, -missed, missed
    return statistic.value, statistic.low, statistic.high


def _pairs(statistics: Sequence[Compared], blocks: Set[str]) -> Iterator[EnginePair]:
    by_pair: dict[tuple[tuple[str, str], str], list[Compared]] = {}
    for statistic in statistics:
        by_pair.setdefault((statistic.between, statistic.joint_model), []).append(statistic)
    for (between, joint_model), of_pair in by_pair.items():
        reasons = dict.fromkeys(one.reason for one in of_pair if one.verdict == "unjudged")
        rows = (_compared(one, _lost(of_pair, one.joint), one.joint in blocks) for one in of_pair)
        yield EnginePair(between, joint_model, tuple(rows), tuple(reasons))


def _lost(statistics: Iterable[Compared], joint: str) -> float:
    """The largest loss (J) of two runs in a joint."""
    losses = (one.values for one in statistics if one.joint == joint and one.unit == "J")
    return max((abs(loss or 0.0) for values in losses for loss in values), default=0.0)


def _compared(one: Compared, lost: float, block: bool) -> ShownComparison:
    values: Sequence[float | None] = one.values
    measure = _measure(one.statistic, block).fitting(*one.values, one.allowed)
    if one.statistic == "friction_loss" and all(abs(v or 0.0) < ENGINE_ROUNDING * lost for v in values):
        values = 0.0, 0.0
    if one.statistic in LOSSES:
        values = [None if value is None else max(value, 0.0) for value in values]
    a, b, allowed = map(measure.read, (*values, one.allowed))
    difference = None if a is None or b is None else a - b
    return ShownComparison(measure, one.joint, (a, b), difference, allowed, one.verdict, one.reason)

"""Where the analytic model holds, in words: what a map comes to, what its cells say, and what its assumptions mean."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

from analytic.mechanism import Mechanism
from analytic.mechanism.one_line import count
from compare.quantities import plain, quantities
from compare.results.validity import Between, Boundary, Cell, Costing, Failed, Validity, Worst, foretold

Cells = Mapping[tuple[float, float], Cell | Failed]
RPM = math.pi / 30  # rad/s
TESTED: tuple[Costing, ...] = ("first-order", "quasi-static", "rigid")
MEANS = {
    "contact": "the pin never leaves its bearing",
    "first-order": "the ideal linkage's reactions give the displacement and are the forces (Eq. 8)",
    "quasi-static": "the pin follows the reaction; its own motion in the gap costs nothing",
    "rigid": "the contact does not yield",
    "superposition": "clearance and compliance add up; not examined, the links are rigid",
}
MEANS_OF_BLOCKS = MEANS | {
    "contact": "one of the block's corners at least is at its wall at all times",
    "quasi-static": "the block is at rest on its corners; it takes no time to pass to others",
    "rigid": "the walls do not yield under its corners",
}


def come_to(
    simulators: Sequence[str], cells: Sequence[Cell | Failed], between: Between | None, inertia_only: bool
) -> Iterator[str]:
    """What a map comes to, engine by engine and together; ``inertia_only``: nothing else loads the linkage."""
    yield from (_tally(name, [cell for cell in cells if cell.simulator == name]) for name in simulators)
    if between:
        yield (
            f"{' and '.join(simulators)} give the same verdict in {between.same_verdict} of {between.cells}"
            f" cells and the same cause in {between.same_cause}; their shares without contact differ by at most"
            f" {100 * between.free_share_spread:.2g} % of the cycle"
        )
    if inertia_only:
        yield (
            "nothing but inertia loads this linkage: every force grows with the square of the speed, so that between"
            " rigid parts the speed would change nothing; what does change with it is how far the contact yields"
        )


def contact_lost(cells: Sequence[Cell | Failed], blocks: Sequence[str]) -> Iterator[str]:
    """In how many cells contact is kept or lost as the analytic model predicts; of ``blocks``, that it does not."""
    if blocks and any(isinstance(cell, Cell) and cell.watched is not None for cell in cells):
        yield (
            f"where contact is first lost is not predicted, as {' and '.join(blocks)} has a block, which turns on one"
            " corner before it leaves: the boundary is that of the simulations"
        )
        return
    prediction = foretold(cells)
    if prediction.cells:
        yield (
            f"contact is kept or lost as the reaction's turning predicts in {prediction.yielding} of"
            f" {count(prediction.cells, 'cell')} with the walls' give, and in {prediction.rigid} with rigid walls"
        )


def too_soft(simulator: str, cells: Sequence[Cell], stiff_enough: float | None) -> str:
    """A warning of an engine in whose cells the contact gives so much that the clearance is hidden; the stiffness (N/m)
    that would not, where it is known.
    """
    cell = max(cells, key=lambda cell: cell.give / cell.clearance)
    remedy = "" if stiff_enough is None else f" = {stiff_enough:.1e} (N/m) or more"
    return (
        f"{simulator}: the contact gives by more than half of the clearance in {count(len(cells), 'cell')}, at most by"
        f" {1e3 * cell.give:.2g} mm, {cell.give / cell.clearance:.1f} times it, at {rpm(cell.speed)} rpm and"
        f" {millimetres(cell.clearance)} mm: too soft to see this clearance; give contact_stiffness{remedy}"
    )


def _tally(simulator: str, of_engine: Sequence[Cell | Failed]) -> str:
    judged = [cell for cell in of_engine if isinstance(cell, Cell)]
    agreeing, enough = sum(c.agrees for c in judged), sum(c.first_order_is_enough for c in judged)
    cells = count(len(of_engine), "cell")
    text = f"{simulator}: the equilibrium agrees in {agreeing} of {cells}, and Eq. 8 is enough in {enough}"
    if judged and not agreeing:
        best = max(judged, key=lambda c: c.agreeing_share)
        where = f"{rpm(best.speed)} rpm, {millimetres(best.clearance)} mm"
        text += f", at best at {100 * best.agreeing_share:.0f} % of the crank angles ({where})"
    causes = Counter(c.cause or "none that was examined" for c in judged if not c.agrees)
    if causes:
        text += (
            "; where it does not agree, the cause is"
            f" {', '.join(f'{cause} ({n})' for cause, n in causes.most_common())}"
        )
    failed = len(of_engine) - len(judged)
    return text + (f"; {failed} could not be simulated" if failed else "")


def rpm(speed: float) -> str:
    """A speed (rad/s) in rpm."""
    return f"{speed / RPM:.5g}"


def millimetres(clearance: float) -> str:
    """A clearance (m) in mm."""
    return f"{clearance * 1e3:.4g}"


def percent(value: float) -> str:
    """A share, never rounded to none or all: 0.4 % of a cycle without contact is not 0 %."""
    near = min(max(100 * value, 0.1 if value > 0 else 0.0), 99.9 if value < 1 else 100.0)
    return f"{near:.1f}" if 0 < near < 1 or 99 < near < 100 else f"{near:.0f}"


def failing(cell: Cell | Failed) -> tuple[str, ...]:
    """The assumptions that fail, by name."""
    return () if isinstance(cell, Failed) else cell.fails


def lost(cell: Cell | Failed) -> float:
    """The largest share of the cycle that a cell's pin or block was without contact; 0 for a cell that failed."""
    return 0.0 if isinstance(cell, Failed) else cell.free


def brief(cell: Cell | Failed) -> str:
    """A cell in a table: ``agrees``, or the share of the cycle at which it does, and which assumptions fail."""
    if isinstance(cell, Failed):
        return "failed"
    agreement = "agrees" if cell.agrees else f"{percent(cell.agreeing_share)} %"
    return ", ".join([agreement, *failing(cell)])


def sentence(cell: Cell | Failed, mechanism: Mechanism) -> str:
    """A cell in words."""
    if isinstance(cell, Failed):
        return f"failed: {cell.failure}"
    over = [f"{name} {plain(cell.cost[name], 2)} x" for name in TESTED if cell.cost[name] > 1]
    costs = f"costs over tolerance: {', '.join(over)}" if over else "every other assumption within tolerance"
    if cell.agrees:
        return f"agrees; {costs.replace('other ', '')}"
    lost = [
        f"{joint} is without contact for {percent(share)} % of the turn that is compared"
        for joint, share in cell.free_share.items()
        if share > 0
    ]
    struck = [_struck(cell)] if cell.watched is not None and cell.watched.impacts else []
    block = any(mechanism.joint(name).prismatic for name in cell.free_share)
    moves = "the block stays in contact and rocks" if block else "the pin stays in contact and swings along the rim"
    another = cell.watched is not None and cell.watched.free > 0
    swing = [f"{'in the turn that is compared ' * another}{moves}"] if cell.swings else []
    silent = sum(cell.flagged_share.values())
    flags = [f"no answer from the model at {percent(silent)} %"] if silent else []
    worst = [f"worst {_worst(cell.worst, mechanism)}"] if cell.worst else []
    return "; ".join(
        [f"agrees at {percent(cell.agreeing_share)} % of the angles", *lost, *struck, *swing, *flags, *worst, costs]
    )


def _struck(cell: Cell) -> str:
    """Impacts, peak and loss of a cell whose pins or corners strike."""
    assert cell.watched is not None
    struck = f"{count(round(cell.watched.impacts), 'impact')} a turn"
    return f"{struck}, peak force {_figure(cell.watched.peak_ratio)} x the ideal one, {cell.watched.lost:.2g} J lost"


def _worst(worst: Worst, mechanism: Mechanism) -> str:
    quantity = quantities(mechanism)[worst.signal]
    at = f"at {math.degrees(worst.at_crank_angle):.4g} deg"
    if worst.max is None or worst.over_tolerance is None:
        return f"{quantity.label} {at}"
    return (
        f"{quantity.label} {plain(worst.max * quantity.factor, 3, True)} {quantity.unit}"
        f" ({plain(worst.over_tolerance, 2)} x) {at}"
    )


JOULES = ((1.0, "J"), (1e-3, "mJ"), (1e-6, "uJ"), (1e-9, "nJ"))


@dataclass(frozen=True)
class CellMeasure:
    """One figure of a cell's contact: what it is, how it is told, and the values from which each shade is darker."""

    name: str
    title: str
    value: Callable[[Cell], float | None]
    text: Callable[[float], str]
    shades: tuple[float, float, float, float]

    def of(self, cell: Cell | Failed) -> float | None:
        """The figure of a cell; None where there is none."""
        return None if isinstance(cell, Failed) else self.value(cell)

    def words(self, cell: Cell | Failed) -> str:
        """The figure of a cell in words, a dash where there is none."""
        value = self.of(cell)
        return "-" if value is None else self.text(value)


def measures(result: Validity) -> tuple[CellMeasure, ...]:
    """The figures of contact that a map has; none where it was not watched."""
    watched = [cell.watched for cell in result.cells if isinstance(cell, Cell) and cell.watched is not None]
    if not watched:
        return ()
    most = max(abs(one.lost) for one in watched)
    factor, unit = next((pair for pair in JOULES if most >= pair[0]), JOULES[-1])
    return (
        CellMeasure(
            "peak",
            "peak force over the ideal peak",
            lambda cell: cell.watched.peak_ratio if cell.watched else None,
            _figure,
            (1.1, 1.5, 3.0, 10.0),
        ),
        CellMeasure(
            "free",
            "share of the time without contact (%)",
            lambda cell: cell.watched.free if cell.watched else None,
            lambda value: percent(value) if value else "-",
            (1e-9, 0.02, 0.1, 0.3),
        ),
        CellMeasure(
            "lost",
            f"energy lost in contact in a turn ({unit})",
            lambda cell: cell.watched.lost if cell.watched else None,
            lambda value: _figure(value / factor) if abs(value) > 1e-4 * most else "-",
            (1e-4 * most, 0.01 * most, 0.1 * most, 0.5 * most),
        ),
    )


def _figure(value: float) -> str:
    """Two figures, and no exponent."""
    return f"{value:.0f}" if abs(value) >= 10 else f"{value:.2g}" if abs(value) >= 1e-3 else f"{value:.1g}"


def panel_title(result: Validity, simulator: str, restitution: float | None) -> str:
    """Engine, its version and the restitution."""
    engine = f"{simulator} {result.versions.get(simulator, '')}".strip()
    return engine if restitution is None else f"{engine}, restitution {restitution:g}"


def edges(result: Validity, restitution: float | None) -> tuple[Boundary, ...]:
    """The predicted boundary of a layer, by speed."""
    return tuple(one for one in result.boundary or () if one.restitution == restitution)


def edge_rows(result: Validity) -> list[list[str]]:
    """At which clearance (mm) contact is first lost, by restitution and speed: head, then a row each; none where
    nothing is known of it, and without prediction where there is none, as of a block.
    """
    measured_only = result.boundary is None and result.of_blocks and bool(measures(result))
    predicted = {(edge.restitution, edge.speed): edge for edge in result.boundary or ()}
    head = [*["restitution"] * bool(result.restitutions), "rpm", *result.simulators]
    rows = [head if measured_only else [*head, "predicted", "predicted, rigid walls"]]
    for restitution, speed in product(result.layers, result.speeds):
        edge = predicted.get((restitution, speed))
        if edge is None and not measured_only:
            continue
        layer = [] if restitution is None else [f"{restitution:g}"]
        lost_at = (measured_edge(result.of(name, restitution), speed, result.clearances) for name in result.simulators)
        limits = [predicted_edge(limit, result.clearances) for limit in (edge.yielding, edge.rigid)] if edge else []
        rows.append([*layer, rpm(speed), *lost_at, *limits])
    return rows


def measured_edge(cells: Cells, speed: float, clearances: Sequence[float]) -> str:
    """Between which clearances (mm) contact is first lost in the simulations at a speed (rad/s)."""
    kept: float | None = None
    for gap in clearances:
        cell = cells[speed, gap]
        if isinstance(cell, Cell) and cell.left:
            return f"below {millimetres(gap)}" if kept is None else f"{millimetres(kept)} to {millimetres(gap)}"
        kept = gap if isinstance(cell, Cell) else kept
    return "kept"


def predicted_edge(edge: float | None, clearances: Sequence[float]) -> str:
    """The clearance (mm) at which contact is first lost by the analytic model."""
    if edge is None:
        return "kept"
    return f"below {millimetres(edge)}" if edge <= clearances[0] else millimetres(float(f"{edge:.3g}"))


def legend(result: Validity) -> list[str]:
    """What the assumptions say."""
    return [f"{name}: {assumption.means}" for name, assumption in result.assumptions.items()]


def about(result: Validity) -> str:
    """What the map is of, in one line."""
    laws = {
        f"{f'{law.law} of ' * bool(law.law)}{law.stiffness:.3g} N/m"
        + (f" and {law.damping:.3g} N.s/m" if law.damping is not None else "")
        for law in result.contact.values()
    }
    contact = f", contact {' or '.join(sorted(laws))}{_harder(result)}" if laws else ""
    where = f"clearance in {', '.join(result.joints)} ({result.joints_are})"
    return (
        f"{result.case}: {where}, {result.joint_model} joints{contact}, {count(len(result.crank_angle), 'crank angle')}"
    )


def _harder(result: Validity) -> str:
    """How stiff walls are at the speeds at which they are stiffer than at the slowest."""
    cells = [cell for cell in result.cells if isinstance(cell, Cell)]
    given = [value for cell in cells if isinstance(value := cell.settings.get("contact_stiffness"), float)]
    stiffest, slowest = max(given, default=0.0), max(law.stiffness for law in result.contact.values())
    if stiffest <= slowest:
        return ""
    return f" at {rpm(min(result.speeds))} rpm, up to {stiffest:.3g} N/m at higher speeds"

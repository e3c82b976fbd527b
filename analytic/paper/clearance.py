"""What joint clearance and soft bearings do to a linkage: Eq. 8, and its self-consistent completion.

A pin with radial clearance moves within its bearing along the reaction until the two touch.  Both answers put every
such pin on the rim of its clearance circle and close the linkage again with those gaps:

``first_order``   the paper's: the rim in the direction of the *ideal* linkage's reaction (Eq. 8);
``equilibrium``   the rim in the direction of the reaction of the *displaced* linkage itself.

A bearing of radial stiffness k lets its pin give by reaction over k beside: gap = (c / |F| + 1 / k) F.  It does so as
fast as the reaction changes, for its own vibration is left out.

A pin that rubs lies beside its reaction by the angle of friction (:mod:`analytic.paper.friction`).

Both presume contact at all times.  Where a reaction passes near zero it has no direction: such angles are flagged.
"Near" is relative to the joint's largest reaction at the linkage's usual crank angles, without the friction that grows
with it and may lock the linkage there: whether an angle is flagged does not depend on the other angles asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, reduce
from types import MappingProxyType
from typing import Literal, get_args

import numpy as np

from analytic.compiled import run
from analytic.kinematics.assembly import Assembly, AssemblyError, CrankTable, Walk
from analytic.kinematics.motion import Gap, kinematics
from analytic.kinematics.output import Output
from analytic.kinematics.reach import usual_angles
from analytic.mechanism import Mechanism
from analytic.mechanism.one_line import angles, clearances, one_line
from analytic.mechanism.parts import TINY
from analytic.mechanism.signals import Signal, wrapped
from analytic.paper.friction import Rubbing, lean
from analytic.paper.guide import GuidedBlock, placed
from analytic.paper.kinetostatics import Reactions, kinetostatics, pieced

Model = Literal["first_order", "equilibrium"]
Reasons = Iterator[tuple[int, str]]  # by the index of an angle: why the model has no answer there
MODELS: tuple[Model, ...] = get_args(Model)
FAINT_SHARE = 0.01  # of a joint's peak reaction, below which it is flagged
REACTION_ROUNDING = 1e-12  # of the linkage's largest reaction: a smaller reaction is the rounding error of zero
GAP_STENCIL = 2e-3  # rad of crank angle, to either neighbour of the two that give the gaps' rates
UNSTEADY_TURN = 0.02  # rad by which a gap's own motion may turn it
LARGEST_SWAY = 0.05  # of a bearing's largest gap, by which the second term of that gap's own motion may change it
STEADY_GAP = 3e-4  # of a gap, by which its own motion changes it: the next term of the series is the square of that
STILL_GAP = STEADY_GAP / 3  # of a gap, by which its own motion changes it in parts of a turn that need no second term
PARTS_OF_TURN = 24  # of the crank, that take the second term of a gap's own motion or not
CONTACT_SETTLED = 1e-12  # rad, by which a contact's direction may miss its own reaction's
CONTACT_PASSES = 40  # of Broyden's method
SOLUTIONS_AN_ANGLE = 10  # times, about, that a linkage is solved at each angle until its pins have settled
STABILITY_NUDGE = 1e-4  # rad, of the difference that tells whether an equilibrium is stable
ON_ITS_WAY = "is on its way from one rest to another"  # of a block, in a flag
UNSTABLE = "the equilibrium found is not stable: the pins would leave it"
REST_TRIES = 6  # of ways in which blocks may rest
LANDING_TIME = 1.5  # times as long as a block is on its way, until it rests
NO_BLOCKS: Mapping[str, GuidedBlock] = MappingProxyType({})
MOST_HALVINGS = 6  # times that a step of the search is halved at most


@dataclass(frozen=True)
class Displaced:
    """A linkage displaced by its joints' clearance and soft bearings, at N crank angles.

    ``reactions`` are the model's: the ideal linkage's for ``first_order``, the displaced one's for ``equilibrium``;
    ``configuration`` is the displaced linkage, ``ideal`` the one without either.  ``flags`` maps the index of an
    angle at which the model has no answer to the reason; values there mean nothing.
    """

    model: Model
    gaps: Mapping[str, np.ndarray]  # m, complex (N,): first pin centre minus second
    reactions: Reactions
    configuration: Reactions
    ideal: Reactions
    flags: Mapping[int, str]
    faint: Mapping[str, float]  # N, of every revolute joint: a reaction no larger has no direction; with clearance only
    # of prismatic joints with clearance: the angle (N,) rad of the guide less the block's, and how the block rests
    # (see analytic.paper.guide)
    tilts: Mapping[str, np.ndarray] = field(default_factory=dict)
    rests: Mapping[str, np.ndarray] = field(default_factory=dict)

    def __repr__(self) -> str:
        motion = self.ideal.motion
        sizes = {name: float(np.abs(gap).max()) for name, gap in self.gaps.items()}
        flagged = f"{len(self.flags)} flagged" if self.flags else ""
        name = motion.structure.mechanism.name
        return one_line(self, name, self.model, angles(motion.theta), clearances(sizes), flagged)

    def signals(self) -> dict[str, np.ndarray]:
        """Contract signals, ``<body>_rotation`` (rad, psi) included; NaN at flagged angles."""
        out = self.configuration.signals() | self.reactions.loads()
        for joint, tilt in self.tilts.items():
            gap = self.gaps[joint]
            for component, values in (("x", gap.real), ("y", gap.imag), ("angle", tilt)):
                out[Signal.of("clearance", joint, component).name] = values
        for body in self.ideal.motion.structure.bodies[1:]:
            turned = self.configuration.motion.angle(body) - self.ideal.motion.angle(body)
            out[Signal.of("rotation", body, "angle").name] = turned
        return self._blank(out)

    def moved(self, d: Output) -> np.ndarray:
        """Displacement (N,) of an output; NaN at flagged angles."""
        return _blank(d.value(self.configuration.motion) - d.value(self.ideal.motion), list(self.flags))

    def rates(self) -> dict[str, np.ndarray]:
        """Velocities, accelerations and power of the displaced linkage (:meth:`Reactions.rates`), its pins' own motion
        in their bearings with them; NaN at flagged angles.
        """
        return self._blank(replace(self.configuration, drive_loads=self.reactions.drive_loads).rates())

    def _blank(self, signals: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        flagged = list(self.flags)
        return {name: _blank(values, flagged) for name, values in signals.items()}


def displaced(  # noqa: PLR0913 - a motion, and what may replace the linkage's own
    assembly: Assembly,
    theta: np.ndarray,
    omega: np.ndarray | float = 0.0,
    *,
    alpha: np.ndarray | float = 0.0,
    model: Model = "equilibrium",
    inertia: bool = True,
    clearances: Mapping[str, float] | None = None,
    near: Walk | None = None,
    motions: Sequence[int] = (),
    time: np.ndarray | None = None,
) -> Displaced:
    """The linkage with its clearances taken up along the reactions, and its soft bearings giving, at crank angles theta
    (N,) rad; with several inputs at (n_inputs, N), and so are ``omega`` and ``alpha``, of samples that follow one
    another.

    ``omega`` and ``alpha`` are the crank's angular velocity (rad/s) and acceleration (rad/s^2) there; the acceleration
    must change slowly.  Without ``inertia`` the equilibrium is static and omega only gives friction its direction.
    ``clearances`` (m) replace the mechanism's own.  With several inputs ``near`` are the samples' coordinates, where
    they are known already.  ``motions`` are how many samples there are of each of several motions of a crank, one after
    the other: which reactions are too faint for a direction depends on each by itself.  ``time`` (N,) s is for loads
    that vary over it.  Raises AssemblyError where the ideal or the displaced linkage cannot be assembled.
    """
    drive = np.concatenate(np.broadcast_arrays(np.atleast_2d(np.asarray(theta, float)), omega, alpha)).astype(float)
    m, k = assembly.mechanism, len(assembly.structure.inputs)
    loose = {name: c for name, c in (m.clearances if clearances is None else clearances).items() if c > 0}
    blocks = {name: GuidedBlock.of(m, name, c) for name, c in loose.items() if m.joint(name).prismatic}
    sizes = {name: c for name, c in loose.items() if name not in blocks}
    give = {name: 1 / k for name, k in m.soft_bearings.items()}
    turning = bool(inertia and np.any(drive[k:]))
    reach = (2 * GAP_STENCIL if give else GAP_STENCIL) if turning and (loose or give) else 0.0
    path: CrankTable | None = None
    if assembly.structure.by_crank:
        path = assembly.path(drive[0].min() - reach, drive[0].max() + reach)
    else:  # with each sample goes where the linkage is near it
        drive = np.concatenate([drive, (near or assembly.follow(drive[:k])).coordinates])
    timed = time is not None and m.timed_load is not None
    if timed:
        drive = np.concatenate([drive, [time]])

    if loose or give:
        run.foresee(assembly, SOLUTIONS_AN_ANGLE * drive.shape[1])
    solve = _Solve(assembly, inertia, path, sizes, blocks, model == "equilibrium", len(drive), timed)
    ideal = solve(drive)
    if not (loose or give):
        return Displaced(model, {}, ideal, ideal, ideal, {}, {})
    check_determined(ideal, (*loose, *give))
    counts = list(motions) if path and motions else [drive.shape[1]]
    faint = [
        faint_reactions(assembly, part[1], part[2], inertia)
        if path and not timed
        else _faint(ideal, np.max if path else np.median)
        for part in (np.split(drive, np.cumsum(counts)[:-1], axis=1) if sizes else ())
    ]
    flags = _add({}, _without_direction(ideal, sizes, faint, counts, "peak" if path else "median"))
    longest = max(b.length for b in m.bodies) or 1.0
    pace = np.array([1.0 if assembly.structure.unit(i) == "rad" else longest for i in assembly.structure.inputs])
    pins = _Pins(sizes, give, longest, solve, model, pace)
    largest = {name: max(part[name] for part in faint) for name in faint[0]} if faint else {}
    state = Displaced(model, {}, ideal, ideal, ideal, flags, largest)
    return (_with_blocks if blocks else _taken_up)(pins, drive, state, turning)


@dataclass(frozen=True)
class _Solve:
    """Reactions of the linkage for drive (rows, N): its inputs, their rates and accelerations, what else goes with each
    sample, and below those ``rows`` how each block rests in its guide; they may be left out, and are centred then.
    """

    assembly: Assembly
    inertia: bool
    path: CrankTable | None
    sizes: Mapping[str, float]  # m, radial clearance of pins
    blocks: Mapping[str, GuidedBlock]
    finite: bool  # whether a tilted block touches with its finite clearance, or to first order
    rows: int
    timed: bool  # whether the last of the rows is the time (s)

    def __call__(self, drive: np.ndarray, gaps: Mapping[str, Gap] | None = None) -> Reactions:
        """Reactions of the linkage with these gaps of its pins."""
        if len(drive) == self.rows:
            return self.part(self.assembly, drive, gaps)
        ways, which = np.unique(drive[self.rows :], axis=1, return_inverse=True)
        linkages = [self.assembly.resting(placed(self.blocks, way, self.finite)) for way in ways.T]
        if len(linkages) == 1:
            return self.part(linkages[0], drive, gaps, ways[:, 0])
        pieces = []
        for way, linkage in enumerate(linkages):
            at = np.flatnonzero(which == way)
            gaps_there = {name: gap.part(at) for name, gap in (gaps or {}).items()}
            pieces.append((at, self.part(linkage, drive[:, at], gaps_there, ways[:, way])))
        return pieced(self.assembly, pieces)

    def part(
        self, linkage: Assembly, drive: np.ndarray, gaps: Mapping[str, Gap] | None, how: np.ndarray | None = None
    ) -> Reactions:
        """Reactions of samples in which all blocks rest in one way: ``how`` (blocks,), None where they are centred."""
        k = len(self.assembly.structure.inputs)
        theta, omega, alpha, here = np.split(drive[: self.rows], (k, 2 * k, 3 * k))
        here, time = (here[:-1], here[-1]) if self.timed else (here, None)
        motion = kinematics(linkage, theta, omega, alpha, gaps, self.path or Walk(here), time)
        ways = how if self.finite else None
        loose = loose_friction(self.assembly.mechanism, self.sizes, self.blocks, ways)
        return kinetostatics(motion, self.inertia, loose=loose)


def _with_blocks(pins: _Pins, drive: np.ndarray, state: Displaced, turning: bool) -> Displaced:
    """``state`` with blocks and pins where they come to rest."""
    blocks, ideal = pins.solve.blocks, state.ideal
    border = _add({}, _on_the_border(pins.solve, ideal, drive))
    if turning:
        border = {**_add({}, _on_their_way(pins, ideal, drive)), **border}
    state = replace(state, flags={**border, **state.flags})
    how = np.array([block.rests(ideal) for block in blocks.values()])
    flagged = np.isin(np.arange(how.shape[1]), list(border))
    for _ in range(REST_TRIES):
        moved = _taken_up(pins, np.vstack([drive, how]), state, turning)
        stay = np.array([block.stays(h, moved.configuration) for block, h in zip(blocks.values(), how, strict=True)])
        if state.model == "first_order" or np.all(stay | flagged):
            break
        there = np.array([block.rests(moved.configuration) for block in blocks.values()])
        how, before = np.where(stay, how, there), how
    else:
        how, flags = before, dict(moved.flags)
        for name, steady in zip(blocks, stay, strict=True):
            for i in np.flatnonzero(~steady):
                flags.setdefault(int(i), f"no rest was found of the block of {name}: it would stand on one corner")
        moved = replace(moved, flags=flags)
    play = {name: moved.configuration.motion.play(block.joint) for name, block in blocks.items()}
    return replace(
        moved,
        gaps={**moved.gaps, **{name: gap for name, (gap, _) in play.items()}},
        tilts={name: tilt for name, (_, tilt) in play.items()},
        rests=dict(zip(blocks, how, strict=True)),
    )


def _taken_up(pins: _Pins, drive: np.ndarray, state: Displaced, turning: bool) -> Displaced:
    """``state`` with its pins where they come to rest, and so its reactions and flags."""
    model, ideal, flags, solve = state.model, state.ideal, dict(state.flags), pins.solve
    if not (pins.sizes or pins.give):
        configuration = solve(drive, None)
        return replace(state, configuration=configuration, reactions=ideal if model == "first_order" else configuration)
    toward = pins.unknowns(ideal)
    rates = None
    x, learnt = pins.settled(drive, toward)
    if turning:
        rates = _rates(pins, drive, x, toward, learnt)
        _add(flags, _across(pins, drive, rates))
        steady, (x, _) = x, pins.settled(drive, x, rates, learnt)
        _add(flags, _unsteady(pins, steady, x))
        if (at := _further(pins, drive, _sways(pins, steady, x).max(axis=0, initial=0.0), list(flags))).size:
            steady, x = x, x.copy()
            rates[:, at] = _rates(pins, drive[:, at], x[at], toward[at], learnt[at], order=1)
            x[at], _ = pins.settled(drive[:, at], x[at], rates[:, at], learnt[at])
            _add(flags, _swaying(pins, steady, x))
    gaps = pins.gaps(x, rates)
    configuration = solve(drive, gaps)
    reactions = ideal if model == "first_order" else configuration
    if model == "equilibrium":
        _add(flags, _unsettled(pins, configuration, x))
        if not solve.inertia:
            _add(flags, ((i, UNSTABLE) for i in np.flatnonzero(pins.leave(drive, x)).tolist()))
    places = {name: g.value for name, g in gaps.items()}
    return replace(state, gaps=places, reactions=reactions, configuration=configuration, flags=flags)


def _add(flags: dict[int, str], reasons: Reasons) -> dict[int, str]:
    """``flags``, to which each angle without one has got the first of its reasons."""
    for i, why in reasons:
        flags.setdefault(i, why)
    return flags


def check_determined(reactions: Reactions, joints: Iterable[str]) -> None:
    """Raise AssemblyError for a joint whose pin leaves its bearing's centre along a reaction that statics does not
    determine.
    """
    loose = sorted(reactions.undetermined & set(joints))
    if loose:
        raise AssemblyError(
            f"{reactions.motion.structure.mechanism.name}: statics does not determine the reaction of joint"
            f" {loose[0]!r}, so that its clearance, or its soft bearing, has no direction",
            remedy="leave that out, or a joint that is not needed",
        )


def loose_friction(
    mechanism: Mechanism,
    sizes: Mapping[str, float],
    blocks: Mapping[str, GuidedBlock] = NO_BLOCKS,
    how: np.ndarray | None = None,
) -> list[Rubbing]:
    """What rubs in the contacts of pins with these clearances (m), and of blocks, which rest ``how`` (blocks,), or as
    their reactions ask them to.
    """
    ways = [None] * len(blocks) if how is None else how.tolist()
    pins = [Rubbing(mechanism.joint(name), clearance=c) for name, c in sizes.items() if c > 0]
    rubbing = [*pins, *(Rubbing(b.joint, b, way) for b, way in zip(blocks.values(), ways, strict=True))]
    return [each for each in rubbing if each.joint.friction]


def faint_reactions(assembly: Assembly, omega: np.ndarray, alpha: np.ndarray, inertia: bool) -> dict[str, float]:
    """By revolute joint the reaction (N) up to which it has no direction, at the fastest of these speeds (rad/s) and
    accelerations (rad/s^2).

    It is a share of the joint's largest at the linkage's usual crank angles.
    """
    return _faint(_usually(assembly, omega, alpha, inertia), np.max)


def _usually(assembly: Assembly, omega: np.ndarray, alpha: np.ndarray, inertia: bool) -> Reactions:
    """Reactions at the linkage's usual crank angles at the fastest of these speeds (rad/s) and accelerations (rad/s^2);
    without the friction that grows with them, which may lock it at some, and is beyond measure beside those.
    """
    fastest, hardest = (float(x[np.argmax(np.abs(x))]) for x in (omega, alpha))
    return kinetostatics(kinematics(assembly, usual_angles(assembly), fastest, hardest), inertia, rubs=False)


def _on_the_border(solve: _Solve, ideal: Reactions, drive: np.ndarray) -> Reasons:
    """Angles at which a block passes from one rest to another: the work on the way to both is nearly the same, or next
    to none.
    """
    usual = ideal
    if solve.path is not None and not solve.timed:
        usual = _usually(solve.assembly, drive[1], drive[2], solve.inertia)
    largest = max(float(np.abs(force).max()) for force in usual.forces.values())
    for name, block in solve.blocks.items():
        work = np.maximum(*block.work(usual))
        peak = float(np.median(work) if solve.path is None else work.max())
        apart = np.abs(np.subtract(*block.work(ideal)))
        for i in np.flatnonzero(apart <= max(FAINT_SHARE * peak, REACTION_ROUNDING * largest * block.clearance)):
            yield int(i), f"the block of {name} passes from one rest to another: what presses it is too little to tell"


def _on_their_way(pins: _Pins, ideal: Reactions, drive: np.ndarray) -> Reasons:
    """Angles at which a block has not had the time to come to its new rest since what presses it changed over.

    What moves it grows with that time t: after t^3 = 6 m s / rate it has gone s, twice the clearance, with its own mass
    and moment of inertia alone; then it has to come to rest.
    """
    beside, moment = _beside(pins, drive)
    around = pins.solve(beside)
    for name, block in pins.solve.blocks.items():
        body = ideal.motion.structure.mechanism.moving.get(block.joint.bodies[1])
        if body is None:  # the ground is the block
            continue
        mass = body.mass + 4 * body.moment_of_inertia / block.length**2
        before, after = np.split(np.subtract(*block.work(around)) / block.clearance, 2)
        apart, rate = np.subtract(*block.work(ideal)) / block.clearance, (after - before) / (2 * moment)
        away, rate = apart * rate > 0, np.maximum(np.abs(rate), TINY)
        since, needed = np.abs(apart) / rate, LANDING_TIME * np.cbrt(12 * mass * block.clearance / rate)
        for i in np.flatnonzero(away & (since < needed)):
            yield int(i), f"the block of {name} {ON_ITS_WAY}"


def _faint(reactions: Reactions, usual: Callable[[np.ndarray], np.floating]) -> dict[str, float]:
    """By revolute joint the reaction (N) up to which it has no direction, a share of its ``usual`` size.

    With several inputs that is the median: poses near a singular one have reactions beyond measure.
    """
    peaks = {name: float(usual(np.abs(force))) for name, force in reactions.forces.items()}
    largest = max(peaks.values())
    return {
        name: max(FAINT_SHARE * peaks[name], REACTION_ROUNDING * largest) for name in reactions.motion.structure.pins
    }


@dataclass(frozen=True)
class _Pins:
    """The pins that leave their bearings' centres; ``pace`` (inputs,) is what of each input is as much as a radian of
    crank.

    What is sought of them is x (N, K): the direction (rad) of each with clearance, how far each of those gives whose
    bearing is soft, and then the gap's two components of each without clearance, both over ``length`` (m).
    """

    sizes: Mapping[str, float]  # m, radial clearance
    give: Mapping[str, float]  # m/N, of soft bearings
    length: float
    solve: _Solve
    model: Model
    pace: np.ndarray

    @cached_property
    def both(self) -> list[str]:
        """The pins with clearance in a soft bearing."""
        return [name for name in self.sizes if name in self.give]

    @cached_property
    def tight(self) -> list[str]:
        """The pins without clearance in a soft bearing."""
        return [name for name in self.give if name not in self.sizes]

    def unknowns(self, reactions: Reactions) -> np.ndarray:
        """x (N, K) where the pins lie as these reactions ask."""
        forces, scaled = reactions.forces, {name: give / self.length for name, give in self.give.items()}
        columns = [np.angle(push) for push in self.pushes(reactions).values()]
        columns += [np.abs(forces[name]) * scaled[name] for name in self.both]
        for name in self.tight:
            columns += [forces[name].real * scaled[name], forces[name].imag * scaled[name]]
        return np.stack(columns, axis=-1)

    def pushes(self, reactions: Reactions) -> dict[str, np.ndarray]:
        """The reactions (N,) N of pins with clearance, turned to where they are in contact: by the angle of friction
        if they rub.
        """
        m = reactions.motion.structure.mechanism
        forces, motion = reactions.forces, reactions.motion
        return {name: forces[name] * np.exp(1j * lean(motion, m.joint(name))) for name in self.sizes}

    def places(self, x: np.ndarray) -> dict[str, np.ndarray]:
        """Gaps (N,) m, complex."""
        n, out = len(self.sizes), dict[str, np.ndarray]()
        for k, (name, c) in enumerate(self.sizes.items()):
            far = c + self.length * x[:, n + self.both.index(name)] if name in self.give else c
            out[name] = far * np.exp(1j * x[:, k])
        for k, name in enumerate(self.tight):
            at = n + len(self.both) + 2 * k
            out[name] = self.length * (x[:, at] + 1j * x[:, at + 1])
        return out

    def gaps(self, x: np.ndarray, rates: np.ndarray | None = None) -> dict[str, Gap]:
        """Gaps at x (N, K), with ``rates`` (2, N, pins) complex: their first and second derivatives in time."""
        places = self.places(x)
        moving = np.zeros((2, len(x), len(places)), complex) if rates is None else rates
        return {name: Gap(gap, *moving[:, :, k]) for k, (name, gap) in enumerate(places.items())}

    def settled(
        self, drive: np.ndarray, x: np.ndarray, rates: np.ndarray | None = None, inverse: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """What x (N, K) is of the displaced linkage's own reactions, from x near by; for ``first_order`` x itself.

        Broyden's method at all angles at once, until each has settled.  ``inverse`` (N, K, K) is its estimate of the
        inverse of minus the derivative of the miss by x, which it returns improved; left out, it is the identity: a
        pin that turns does not turn its reaction.
        """
        x, todo = x.copy(), np.arange(len(x))
        inverse = np.tile(np.eye(x.shape[1]), (len(x), 1, 1)) if inverse is None else inverse.copy()
        if self.model == "first_order":
            return x, inverse
        miss = self.miss(drive, x, rates)
        gain = np.ones(len(x))  # by which the last step shrank the miss; the next one is expected to do as well
        for _ in range(CONTACT_PASSES):
            step = np.einsum("nij,nj->ni", inverse[todo], miss)
            step *= np.minimum(1.0, 0.5 / np.maximum(_largest(step), TINY))[:, None]  # at most half a radian at a time
            x[todo] += step
            size = _largest(miss)
            far = (size >= CONTACT_SETTLED) & (size * gain >= 1e-3 * CONTACT_SETTLED)
            todo, step, before, size = todo[far], step[far], miss[far], size[far]
            if not todo.size:
                break
            x[todo] -= step
            miss, step = self.onward(drive[:, todo], x[todo], step, None if rates is None else rates[:, todo])
            x[todo] += step
            gain = np.minimum(1.0, _largest(miss) / size)
            known = inverse[todo]
            change = np.einsum("nij,nj->ni", known, miss - before)
            along = np.einsum("ni,ni->n", step, change)[:, None]
            weight = np.einsum("ni,nij->nj", step, known) / np.where(
                along, along, np.inf
            )  # no update where the miss has not changed
            inverse[todo] -= (step + change)[..., None] * weight[:, None]
        return x, inverse

    def onward(
        self, drive: np.ndarray, x: np.ndarray, step: np.ndarray, rates: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """The miss (N, K) rad at x + step, and the step; it is halved while the linkage does not close there."""
        for _ in range(MOST_HALVINGS):
            try:
                return self.miss(drive, x + step, rates), step
            except AssemblyError:
                step = step / 2
        return self.miss(drive, x + step, rates), step

    def leave(self, drive: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Whether (N,) pins that rest at x (N, K) would leave: their energy is no minimum.

        The derivative of the energy by x is minus the miss times a weight: of a direction gap times force, of what a
        bearing gives its stiffness (times the square of ``length``).
        """
        forces, places = self.solve(drive, self.gaps(x)).forces, self.places(x)
        weights = [np.abs(places[name]) * np.abs(forces[name]) for name in self.sizes]
        for name in (*self.both, *(each for each in self.tight for _ in range(2))):
            weights.append(np.full(len(x), self.length**2 / self.give[name]))
        root = np.sqrt(np.maximum(np.stack(weights, axis=-1), TINY))
        here, nudges = self.miss(drive, x, None), STABILITY_NUDGE * np.eye(x.shape[1])
        slopes = np.stack([here - self.miss(drive, x + nudge, None) for nudge in nudges], axis=-1) / STABILITY_NUDGE
        bend = slopes * root[:, :, None] / root[:, None, :]
        return np.asarray(np.linalg.eigvalsh((bend + bend.transpose(0, 2, 1)) / 2)[:, 0] <= 0)

    def miss(self, drive: np.ndarray, x: np.ndarray, rates: np.ndarray | None) -> np.ndarray:
        """From x (N, K) to what it is by the reactions there."""
        reactions, n = self.solve(drive, self.gaps(x, rates)), len(self.sizes)
        forces = reactions.forces
        along = {name: push * np.exp(-1j * x[:, k]) for k, (name, push) in enumerate(self.pushes(reactions).items())}
        columns = [np.angle(along[name]) for name in self.sizes]
        columns += [along[name].real * self.give[name] / self.length - x[:, n + k] for k, name in enumerate(self.both)]
        for k, name in enumerate(self.tight):
            given, at = forces[name] * self.give[name] / self.length, n + len(self.both) + 2 * k
            columns += [given.real - x[:, at], given.imag - x[:, at + 1]]
        return np.stack(columns, axis=-1)


def _largest(x: np.ndarray) -> np.ndarray:
    """The largest size (N,) in each row of x (N, K), column by column: rows are short."""
    return np.asarray(reduce(np.maximum, np.abs(x).T))


def _rates(
    pins: _Pins, drive: np.ndarray, x: np.ndarray, toward: np.ndarray, learnt: np.ndarray, order: int = 0
) -> np.ndarray:
    """First and second derivatives in time (2, N, pins) of the gaps at x, where the ideal linkage's reactions are
    ``toward``.

    They are differences between equilibria just before and after, in which the gaps do not move, at the same
    acceleration of the crank.  This is the first term of a series in (gap's inertia force / reaction); on the paper's
    case the next is 1e-6 deg.  Of order 1 the gaps move there as those of order 0, at x too: the next term.
    """
    beside, moment = _beside(pins, drive)
    learnt = np.tile(learnt, (2, 1, 1))
    there = pins.unknowns(pins.solve(beside[: pins.solve.rows], None))
    around, _ = pins.settled(beside, there + np.tile(x - toward, (2, 1)), inverse=learnt)
    if order:
        around, _ = pins.settled(beside, around, _rates(pins, beside, around, there, learnt, order - 1), learnt)
    here, near = (np.stack(list(pins.places(at).values()), axis=-1) for at in (x, around))
    before, after = np.split(near, 2)
    return np.array([(after - before) / (2 * moment[:, None]), (after - 2 * here + before) / moment[:, None] ** 2])


def _across(pins: _Pins, drive: np.ndarray, rates: np.ndarray) -> Reasons:
    """Samples just before which a pin lies a right angle or more from where it lies just after: a load, or friction,
    turns round in between, and its gap has no derivatives.
    """
    moment = _beside(pins, drive)[1]
    for k, (name, c) in enumerate(pins.sizes.items()):
        for i in np.flatnonzero(np.abs(rates[0, :, k]) * moment >= c / np.sqrt(2)):
            yield int(i), f"the reaction at {name} turns round: its pin crosses its bearing"


def _beside(pins: _Pins, drive: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Drive (rows, 2 N) just before and just after each sample, and how long (N,) s that is."""
    k, unit = pins.pace.size, pins.pace[:, None]
    angle, speed, acceleration, near = np.split(drive, (k, 2 * k, 3 * k))
    turns, pushes = speed / unit, acceleration / unit
    pace = ((np.abs(turns) + np.sqrt(turns**2 + 2 * np.abs(pushes) * GAP_STENCIL)) / 2).max(axis=0)
    moment = GAP_STENCIL / np.where(pace > 0, pace, 1.0)  # s, in which the crank turns by the stencil
    later = np.zeros((len(near), 1))  # the rest stays, but for the time
    if pins.solve.timed:
        later[pins.solve.rows - 3 * k - 1] = 1.0
    sides = [
        np.concatenate(
            [angle + speed * t + acceleration * t**2 / 2, speed + acceleration * t, acceleration, near + later * t]
        )
        for t in (-moment, moment)
    ]
    return np.hstack(sides), moment


def _without_direction(
    ideal: Reactions, sizes: Mapping[str, float], faint: Sequence[Mapping[str, float]], counts: Sequence[int], what: str
) -> Reasons:
    """Samples whose reaction at a pin is too faint, in each of some motions of so many samples."""
    for name in sizes:
        size, least = np.abs(ideal.forces[name]), np.repeat([part[name] for part in faint], counts)
        for i in np.flatnonzero(size <= least):
            why = f"({size[i]:.3g} N, {what} {least[i] / FAINT_SHARE:.3g} N): no direction, contact may be lost"
            yield int(i), f"the reaction at {name} passes near zero {why}"


def _unsteady(pins: _Pins, steady: np.ndarray, moved: np.ndarray) -> Reasons:
    """Angles at which a gap's own motion turns it, from x (N, K) without to with it, too far for a small correction."""
    for name, turn in zip(pins.sizes, np.abs(wrapped(moved - steady)).T, strict=False):
        for i in np.flatnonzero(~(turn < UNSTEADY_TURN)):
            yield (
                int(i),
                f"the reaction at {name} turns too fast for its pin to follow (off by {np.degrees(turn[i]):.2g} deg)",
            )


def _swaying(pins: _Pins, moved: np.ndarray, further: np.ndarray) -> Reasons:
    """Angles at which the second term of a gap's own motion in a soft bearing is not small, from x (N, K) with the
    first to with both.
    """
    for name, sway in zip(pins.give, _sways(pins, moved, further), strict=True):
        for i in np.flatnonzero(~(sway < LARGEST_SWAY)):
            yield int(i), f"the bearing of {name} is so soft that the linkage sways in it"


def _sways(pins: _Pins, moved: np.ndarray, further: np.ndarray) -> np.ndarray:
    """By how much of its largest gap (soft bearings, N) each of them gives more at one x (N, K) than at another."""
    before, after = pins.places(moved), pins.places(further)
    sways = [np.abs(after[name] - before[name]) / max(float(np.abs(before[name]).max()), TINY) for name in pins.give]
    return np.array(sways).reshape(len(pins.give), len(moved))


def _further(pins: _Pins, drive: np.ndarray, sways: np.ndarray, flagged: Sequence[int]) -> np.ndarray:
    """Samples, the flagged ones left out, that take the second term of their gaps' own motion where the first is not
    small everywhere: of a crank those in or beside a part of its turn in which it is not very small, else all.
    """
    chosen = np.ones(sways.size, bool)
    chosen[flagged] = False
    if sways[chosen].max(initial=0.0) < STEADY_GAP:
        return np.zeros(0, int)
    if pins.solve.path is not None:
        part = (drive[0] * (PARTS_OF_TURN / (2 * np.pi)) % PARTS_OF_TURN).astype(int) % PARTS_OF_TURN
        hit = np.bincount(part[chosen & (sways >= STILL_GAP)], minlength=PARTS_OF_TURN) > 0
        chosen &= (hit | np.roll(hit, 1) | np.roll(hit, -1))[part]
    return np.flatnonzero(chosen)


def _unsettled(pins: _Pins, reactions: Reactions, x: np.ndarray) -> Reasons:
    places = pins.places(x)
    for name, push in pins.pushes(reactions).items():
        miss = np.abs(np.angle(push / places[name]))
        for i in np.flatnonzero(~(miss < 1e-6)):
            yield int(i), f"no steady contact direction was found at {name}"
    for name, give in pins.give.items():
        gap, force = places[name], reactions.forces[name]
        given = np.abs(gap * (1 - pins.sizes.get(name, 0.0) / np.abs(gap)) if name in pins.sizes else gap)
        off = np.abs(given - give * np.abs(force)) / max(float(np.abs(gap).max()), TINY)
        for i in np.flatnonzero(~(off < 1e-6)):
            yield int(i), f"no steady place of the pin was found in the soft bearing of {name}"


def _blank(values: np.ndarray, flagged: list[int]) -> np.ndarray:
    values = np.array(values, float)
    values[flagged] = np.nan
    return values

"""Linkages with several drives or freedoms that somebody else has solved, or measured: how far this project is off."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from analytic.beyond_paper.free_motion import free_motion
from analytic.beyond_paper.released import released
from analytic.kinematics.assembly import Assembly
from analytic.kinematics.schedule import Schedule
from analytic.paper.kinetostatics import Reactions
from compare.diagnose.workflow import diagnose
from sim_models.engine import Feature, JointModel, Request, Trace, declared, engine
from tests.evidence.published import flying_block as block
from tests.evidence.published import parallel_robot as robot
from tests.evidence.published import squeezer as andrews
from tests.evidence.results.validation import Apart, Held, Published

AXIS = "emps"
FOLDERS = (robot.FOLDER, AXIS, block.FOLDER)
DAMPING, FRICTION, OFFSET = 203.5, 20.39, -3.16  # N.s/m, N, N: of the axis
ALLOWED = {"damping": 0.02, "friction_torque": 0.05, "bias": 0.05}  # shares


def published(names: Sequence[str], data: Path | None, slow: bool) -> tuple[Published, ...]:
    """Every source that is at hand: ``data`` is the folder of those that are not kept here; ``slow`` for the one that
    takes a diagnosis.
    """

    def able(feature: Feature) -> list[str]:
        return [n for n in names if (feature, ("ideal", "driven")) in declared(n).capabilities.rigid.features]

    found = [_squeezer(able("point_spring"))]
    if data is not None and (data / robot.FOLDER).is_dir():
        found.append(_robot(able("several_drives"), data))
    if data is not None and (data / block.FOLDER).is_dir():
        found.append(_block(names, data))
    if slow and data is not None and (data / AXIS).is_dir():
        found.append(_axis(data))
    return tuple(found)


# ---------------------------------------------------------------- Andrews' squeezer


def _squeezer(names: Sequence[str]) -> Published:
    m, times = andrews.squeezer(), np.linspace(0.0, andrews.END, 4)
    sides = {"analytic, by its crank": released(Assembly(m), times).reactions}
    sides["analytic, by its inputs"] = free_motion(Assembly(m), times, {})
    angles, rates, forces = [], [], []
    for side, found in sides.items():
        moved = found.motion
        angles.append(Apart(side=side, off=_relative(moved.angle, andrews.ANGLES), allowed=1e-6))
        rates.append(Apart(side=side, off=_relative(moved.angular_velocity, andrews.RATES), allowed=1e-6))
        forces.append(Apart(side=side, off=_multipliers(found), allowed=2e-6))
    turned = andrews.ANGLES["beta"]
    in_engines = []
    for name in names:
        trace = engine(name).simulate(Request(m, "ideal", Schedule.released(m, times), step=andrews.STEP))
        here = andrews.relative(partial(_read, trace))
        off = max(abs(here[angle] - value) for angle, value in andrews.ANGLES.items()) / turned
        in_engines.append(Apart(side=name, off=_digits(off), allowed=andrews.STATED[name]))
    return Published(
        name="Andrews' squeezer",
        says="Seven bodies (Schiehlen, Multibody Systems Handbook, 1990; IFToMM benchmark A03), the crank released"
        f" under 0.033 N.m: angles and rates at {andrews.END:g} s, and multipliers that are joint forces, as shares of"
        f" each; angles in engines at steps of {1e6 * andrews.STEP:g} us, as shares of the crank's {turned:.1f} rad.",
        figures=(
            Held(figure="seven angles", unit="", published=1.0, apart=tuple(angles)),
            Held(figure="seven rates", unit="", published=1.0, apart=tuple(rates)),
            Held(figure="six multipliers", unit="", published=1.0, apart=tuple(forces)),
            Held(figure="seven angles, in engines", unit="", published=1.0, apart=tuple(in_engines)),
        ),
    )


def _relative(of: Callable[[str], np.ndarray], wanted: Mapping[str, float]) -> float:
    """The largest relative error at the end of what is told of each body over time."""
    found = andrews.relative(lambda body: float(of(body)[-1]))
    return _digits(max(abs(found[name] / value - 1) for name, value in wanted.items()))


def _read(trace: Trace, body: str) -> float:
    return float(trace.signals[f"{body}_angle"][-1])


def _multipliers(found: Reactions) -> float:
    forces = [part for pin in andrews.PINS for part in (found.forces[pin][-1].real, found.forces[pin][-1].imag)]
    return _digits(float(np.abs(np.array(forces) / andrews.MULTIPLIERS - 1).max()))


# ---------------------------------------------------------------- the parallel robot


def _robot(names: Sequence[str], data: Path) -> Published:
    told = robot.recorded(data)
    start, motion = told.at_the_start(), told.in_motion()
    resting = {"analytic": start.drive_loads}
    moving = {"analytic": {n: motion.drive_loads[n][told.clear] for n in told.torque}}
    for name in names:
        trace = engine(name).simulate(told.request_at_the_start())
        resting[name] = {n: trace.signals[f"drive_torque_{n}"] for n in told.torque}
        trace = engine(name).simulate(told.request())
        moving[name] = {n: trace.signals[f"drive_torque_{n}"] for n in told.torque}
    allowed = _digits(0.01 * told.peak, 3)
    return Published(
        name="A parallel robot of two motors",
        says="It has more constraints than it needs; its torques are by MSC Adams. At rest, and in motion from"
        f" {robot.END_OF_SPLINE:g} s on, {robot.BESIDE:g} s on either side of two corners of its course left out;"
        f" engines at every {robot.EVERY}th time. The recorded angles have seven decimals, from which"
        " torques follow to some 2 N.m only.",
        figures=(
            Held(
                figure=f"torques in the first {robot.SMOOTH:g} s, from rest", unit="N.m", published=robot.AT_REST,
                apart=tuple(
                    Apart(side=side, off=_digits(_largest(found, told, told.early)), allowed=0.1)
                    for side, found in resting.items()
                ),
            ),
            Held(
                figure="largest torque in motion", unit="N.m", published=_digits(told.peak, 4),
                apart=tuple(
                    Apart(side=side, off=_digits(_largest(found, told, told.clear, side in names)), allowed=allowed)
                    for side, found in moving.items()
                ),
            ),
        ),
    )  # fmt: skip


def _largest(found: Mapping[str, np.ndarray], told: robot.Recorded, when: np.ndarray, thin: bool = False) -> float:
    """The largest difference (N.m) from the recorded torques at some of the times, or one in EVERY of those."""
    every = robot.EVERY if thin else 1
    return max(float(np.abs(found[n] - torque[when][::every]).max()) for n, torque in told.torque.items())


# ---------------------------------------------------------------- a block in its guide


def _block(names: Sequence[str], data: Path) -> Published:
    told = block.recorded(data)
    turned, lifted = [], []
    for name in names:
        features = declared(name).capabilities.rigid.features
        models: tuple[JointModel, ...] = ("contact", "spring-damper")
        able = [model for model in models if ("guide_clearance", (model, "driven")) in features]
        if not able:
            continue
        seen = engine(name).simulate(block.request(able[0], told["time"])).signals
        angle = max(float(np.abs(seen[f"{body}_angle"] - told[body]).max()) for body in ("crank", "rod"))
        height = float(np.abs(seen["slider_y"] - told["height"]).max())
        turned.append(Apart(side=name, off=_digits(angle), allowed=1e-3))
        lifted.append(Apart(side=name, off=_digits(height / block.PLAY), allowed=0.02))
    return Published(
        name="A block with play in its guide",
        says="Flores, Leine and Glocker's slider-crank by Siconos, with steps of 0.1 ms in which it gains 1 % of the"
        " energy: up to its first impact, at 2.7 ms. What it says after that rests on those steps, as is shown below.",
        figures=(
            Held(
                figure="angle of the crank at 2.6 ms; it and the rod's off by", unit="rad",
                published=_digits(told["crank"][-1], 4), apart=tuple(turned),
            ),
            Held(
                figure="height of the block then, over its play", unit="",
                published=_digits(told["height"][-1] / block.PLAY, 4), apart=tuple(lifted),
            ),
        ),
    )  # fmt: skip


# ---------------------------------------------------------------- a ball-screw axis


def _axis(data: Path) -> Published:
    found = diagnose(data / AXIS / "measured.toml", "mujoco", others=False, workers=1)
    named = {name: p.value for e in found.effects for name, p in e.parameters.items()}
    closed = ", ".join(f"{100 * (e.share or 0.0):.2g} % by {e.name.replace('_', ' ')}" for e in found.effects)
    return Published(
        name="A ball-screw axis (EMPS)",
        says="Its diagnosis from the nominal mass alone: friction, damping and an offset of the force that nobody told"
        f" it of. Of the squared gap it closes {closed}; verdict: {found.verdict}.",
        figures=tuple(_sizes(named)),
    )


def _sizes(named: dict[str, float]) -> Iterator[Held]:
    """Raises nothing where an effect is not named: it is off by all of its size then."""
    rows: tuple[tuple[str, str, str, float], ...] = (
        ("viscous friction", "damping", "N.s/m", DAMPING),
        ("dry friction", "friction_torque", "N", FRICTION),
        ("offset of the force", "bias", "N", OFFSET),
    )
    for figure, name, unit, wanted in rows:
        off = abs(named.get(name, 0.0) - wanted)
        apart: dict[str, Any] = {"off": _digits(off), "allowed": _digits(abs(ALLOWED[name] * wanted), 3)}
        yield Held(figure=figure, unit=unit, published=wanted, apart=(Apart(side="diagnosis", **apart),))


def _digits(value: float, digits: int = 2) -> float:
    return float(f"{value:.{digits - 1}e}")

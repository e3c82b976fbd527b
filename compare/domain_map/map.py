"""The cells of a validity map as plain runs, and what their results come to."""

from __future__ import annotations

import math
import platform
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from analytic.kinematics.assembly import Assembly
from analytic.mechanism import GROUND, Mechanism
from compare.cli.options import listed_once
from compare.domain_map.cell import ASSUMPTIONS
from compare.faults import OptionError
from compare.judge.grid import default_angles, turns_fully
from compare.judge.tolerances import SCALARS
from sim_models.common.contact_laws import contact_parameters
from sim_models.engine import JointModel, declared, installed_version

SCHEMA = 1
RPM = math.pi / 30  # rad/s
MEANS = {
    "contact": "the pin never leaves its bearing",
    "first-order": "the ideal linkage's reactions give the displacement and are the forces (Eq. 8)",
    "quasi-static": "the pin follows the reaction; its own motion in the gap costs nothing",
    "rigid": "the contact does not yield",
    "superposition": "clearance and compliance add up; not examined, the links are rigid",
}


@dataclass(frozen=True)
class Grid:
    """What a map is over.  Every joint in ``joints`` has the cell's clearance, the others have none."""

    mechanism: Mechanism
    joints: tuple[str, ...]
    speeds: tuple[float, ...]  # rad/s
    clearances: tuple[float, ...]  # m
    simulators: tuple[str, ...]
    joint_model: JointModel
    tolerances: Mapping[str, Any]

    def linkage(self, speed: float, clearance: float) -> Mechanism:
        """The mechanism of a cell: driven the way that it is, and its contact as stiff and as damped in every
        engine.
        """
        assert self.mechanism.drive is not None
        assert self.mechanism.speed is not None
        turning = {"speed": math.copysign(speed, self.mechanism.speed)}
        found = self.mechanism.replace(drive=self.mechanism.drive.model_copy(update=turning))
        found = found.with_clearances(dict.fromkeys(self.joints, clearance))
        for name in self.joints if self.joint_model != "massless-link" else ():
            law = contact_parameters(found, found.joint(name), "driven")
            found = found.with_joint(name, contact_stiffness=law.stiffness, contact_damping=law.damping)
        return found


def clearance_joints(mechanism: Mechanism, at: str | None) -> tuple[tuple[str, ...], str]:
    """The joints that carry the clearance, and why these.  Raises OptionError."""
    pins = [joint.name for joint in mechanism.joints if not joint.prismatic]
    if at is not None:
        joints = listed_once(at, "--at")
        for name in joints:
            if name not in pins:
                raise OptionError(
                    f"--at {at}: {name!r} is not a revolute joint of {mechanism.name}; they are {', '.join(pins)}"
                )
        return tuple(joints), "as asked"
    if mechanism.clearances:
        return tuple(mechanism.clearances), "the case's own"
    away = _distances(mechanism)
    far = max(
        pins,
        key=lambda name: (
            sum(away[body] for body in mechanism.joint(name).bodies),
            mechanism.driven not in mechanism.joint(name).bodies,
        ),
    )
    return (far,), "the joint farthest from the ground and the drive"


def _distances(mechanism: Mechanism) -> dict[str, int]:
    """How many joints are between each body and the ground."""
    far = len(mechanism.parts)
    away = dict.fromkeys(mechanism.parts, far) | {GROUND: 0}
    for _ in range(far):
        for joint in mechanism.joints:
            for here, there in (joint.bodies, joint.bodies[::-1]):
                away[there] = min(away[there], away[here] + 1)
    return away


def cells(grid: Grid) -> list[dict[str, Any]]:
    """The runs of a map, engine by engine: everything that a cell's result depends on, as plain data."""
    assembly = Assembly(grid.mechanism)
    theta, skip = _angles(assembly)
    lines = {name: grid.tolerances[name] for name in SCALARS} | {
        "driven": {grid.joint_model: grid.tolerances["driven"][grid.joint_model]}
    }
    linkages = {(w, c): _plain(grid.linkage(w, c)) for w in grid.speeds for c in grid.clearances}
    return [
        {
            "simulator": simulator,
            "joint_model": grid.joint_model,
            "speed": speed,
            "clearance": clearance,
            "mechanism": linkages[speed, clearance],
            "crank_angle": theta.tolist(),
            "skip": skip,
            "tolerances": lines,
            "versions": versions(simulator),
        }
        for simulator in grid.simulators
        for speed in grid.speeds
        for clearance in grid.clearances
    ]


def _angles(assembly: Assembly) -> tuple[np.ndarray, int]:
    """Crank angles (N,) rad of every run, and how many of the first are not judged.

    A crank that turns fully has made a revolution before its first angle.  For another the first angle is the start
    itself, at which the engine was told where to be.
    """
    theta = default_angles(assembly)
    return theta, 0 if turns_fully(assembly) or theta.size == 1 else 1


def _plain(mechanism: Mechanism) -> dict[str, Any]:
    return mechanism.model_dump(by_alias=True, exclude_none=True, exclude_unset=True, mode="json")


def versions(*simulators: str) -> dict[str, str]:
    """Versions of what a result comes from."""
    packages = {name: name for name in ("linkage-crosscheck", "numpy")} | {
        name: declared(name).package for name in simulators
    }
    return {name: installed_version(package) or "not installed" for name, package in packages.items()}


# ---------------------------------------------------------------- what they come to


def summarised(
    grid: Grid, chosen: str, runs: Sequence[Mapping[str, Any]], found: Sequence[Mapping[str, Any]]
) -> dict[str, Any]:
    """The content of validity.json, but for the command; ``found`` are the results of ``runs``, in their order."""
    each = [
        {name: run[name] for name in ("simulator", "speed", "clearance")} | dict(result)
        for run, result in zip(runs, found, strict=True)
    ]
    between = _between(grid, each)
    return {
        "schema": SCHEMA,
        "case": grid.mechanism.name,
        "mechanism": _plain(grid.mechanism),
        "versions": {"python": platform.python_version(), **versions(*grid.simulators)},
        "simulators": list(grid.simulators),
        "joint_model": grid.joint_model,
        "motion": "driven",
        "analytic_model": "equilibrium",
        "joints": list(grid.joints),
        "joints_are": chosen,
        "speeds": list(grid.speeds),
        "clearances": list(grid.clearances),
        "crank_angle": runs[0]["crank_angle"][runs[0]["skip"] :],
        "contact": _contact(grid),
        "assumptions": {name: {"means": MEANS[name], "examined": name in ASSUMPTIONS} for name in MEANS},
        "cells": each,
        "holds_up_to": {
            name: _holds(grid, [cell for cell in each if cell["simulator"] == name]) for name in grid.simulators
        },
        **({"between_simulators": between} if between else {}),
        "words": _words(grid, each, between),
    }


def _contact(grid: Grid) -> dict[str, dict[str, float]]:
    linkage = grid.linkage(grid.speeds[0], grid.clearances[0])
    laws = {name: linkage.joint(name) for name in grid.joints}
    return {
        name: {"stiffness": j.contact_stiffness, "damping": j.contact_damping or 0.0}
        for name, j in laws.items()
        if j.contact_stiffness
    }


def equation_8_is_enough(cell: Mapping[str, Any]) -> bool:
    """Whether the paper's formula itself is within tolerance of a simulation that agrees."""
    return cell.get("verdict") == "agrees" and "first-order" not in cell["fails"]


def _holds(grid: Grid, each: Sequence[Mapping[str, Any]]) -> dict[str, list[float | None]]:
    """By clearance the highest speed (rad/s) up to which the equilibrium, and Eq. 8, hold at every speed of the map;
    None if at none.
    """

    def highest(test: Any) -> list[float | None]:
        out: list[float | None] = []
        for clearance in grid.clearances:
            holding: float | None = None
            for cell in sorted((c for c in each if c["clearance"] == clearance), key=lambda c: c["speed"]):
                if not test(cell):
                    break
                holding = cell["speed"]
            out.append(holding)
        return out

    return {
        "equilibrium": highest(lambda cell: cell.get("verdict") == "agrees"),
        "first_order": highest(equation_8_is_enough),
    }


def _between(grid: Grid, each: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """How far the engines are from one another; empty for one engine."""
    groups = [
        [c for c in each if (c["speed"], c["clearance"]) == (w, x) and "verdict" in c]
        for w in grid.speeds
        for x in grid.clearances
    ]
    groups = [group for group in groups if len(group) > 1]
    if not groups:
        return {}
    return {
        "cells": len(groups),
        "same_verdict": sum(len({cell["verdict"] for cell in group}) == 1 for group in groups),
        "same_cause": sum(len({(cell["verdict"], cell["cause"]) for cell in group}) == 1 for group in groups),
        "free_share_spread": max(float(np.ptp([free(cell) for cell in group])) for group in groups),
        "agreeing_share_spread": max(float(np.ptp([cell["agreeing_share"] for cell in group])) for group in groups),
    }


def free(cell: Mapping[str, Any]) -> float:
    """The largest share of the cycle that one of the cell's pins flew free."""
    return max(cell["free_share"].values(), default=0.0)


def _words(grid: Grid, each: Sequence[Mapping[str, Any]], between: Mapping[str, Any]) -> list[str]:
    out = [_tally(name, [cell for cell in each if cell["simulator"] == name]) for name in grid.simulators]
    if between:
        out.append(
            f"{' and '.join(grid.simulators)} give the same verdict in {between['same_verdict']} of {between['cells']}"
            f" cells and the same cause in {between['same_cause']}; their shares without contact differ by at most"
            f" {100 * between['free_share_spread']:.2g} % of the cycle"
        )
    if _inertia_only(grid.mechanism):
        out.append(
            "nothing but inertia loads this linkage: every force grows with the square of the speed, so that between"
            " rigid parts the speed would change nothing; what does change with it is how far the contact yields"
        )
    return out


def _tally(simulator: str, mine: Sequence[Mapping[str, Any]]) -> str:
    agreeing, enough = sum(c.get("verdict") == "agrees" for c in mine), sum(map(equation_8_is_enough, mine))
    text = f"{simulator}: the equilibrium agrees in {agreeing} of {len(mine)} cells, and Eq. 8 is enough in {enough}"
    judged = [c for c in mine if "verdict" in c]
    if judged and not agreeing:
        best = max(judged, key=lambda c: c["agreeing_share"])
        where = f"{best['speed'] / RPM:.5g} rpm, {best['clearance'] * 1e3:.4g} mm"
        text += f", at best at {100 * best['agreeing_share']:.0f} % of the crank angles ({where})"
    causes = Counter(c["cause"] or "none that was examined" for c in judged if c["verdict"] == "disagrees")
    if causes:
        text += (
            "; where it does not agree, the cause is"
            f" {', '.join(f'{cause} ({n})' for cause, n in causes.most_common())}"
        )
    failed = sum("failure" in c for c in mine)
    return text + (f"; {failed} could not be simulated" if failed else "")


def _inertia_only(mechanism: Mechanism) -> bool:
    loaded = any(mechanism.gravity) or any(load.torque or any(load.force) for load in mechanism.loads)
    return not loaded and not any(j.stiffness or j.damping or j.coulomb or j.friction for j in mechanism.joints)

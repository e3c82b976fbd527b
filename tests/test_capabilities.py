"""What engines declare is true: whatever they declare they run, and it shows; whatever they do not, they refuse.

The table is made from the declarations: every engine, with rigid links, with links that bend, and its export; every
pair of joint model and motion; and each feature that makes sense with it.
"""

from __future__ import annotations

import csv
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from analytic.mechanism import Mechanism
from analytic.mechanism.file import load
from asked import request_of
from marks import slow
from sim_models.engine import (
    ENGINES,
    FEATURES,
    IN_WORDS,
    JOINT_MODELS,
    MOTIONS,
    Capabilities,
    Feature,
    JointModel,
    Pair,
    Request,
    Scope,
    Start,
    Unsupported,
    declared,
    engine,
    needed,
    sensible,
)

What = Literal["rigid", "beams", "export"]
PAIRS: tuple[Pair, ...] = tuple((model, motion) for model in JOINT_MODELS for motion in MOTIONS)
STEEL = 2e11  # Pa
SPEED = 6.0  # rad/s
FIRST = 1.2  # rad
TIMES = np.array([0.012, 0.02, 0.025])  # s
KNOTS = np.linspace(0.0, 0.03, 7)  # s
COURSE = FIRST + 5.0 * KNOTS + 60.0 * KNOTS**2  # rad
COMPLIANCE = 400.0  # N.m/rad
HALF_GAP = 2e-3  # rad
LIMIT = {"joint": "E", "to": 0.5, "stiffness": 10.0, "damping": 0.1}
RISING = [[0.0, 0.0], [3.0, 2.0]]  # rad, times a load
SPRING = {"stiffness": 300.0, "length": 0.2, "damping": 2.0}  # N/m, m, N.s/m


def loaded(case: str) -> Mechanism:
    m = load(case)
    return m.replace(gravity=(0.0, -9.81), drive=m.drive.model_dump(exclude_unset=True) | {"speed": SPEED})


def mechanism(model: JointModel, feature: Feature | None) -> Mechanism:
    """A linkage with this feature, and clearance in joint B unless all joints are ideal."""
    if feature == "several_drives":
        return load("five-bar").with_clearances({} if model == "ideal" else {"P": 5e-4})
    m = loaded("slider-crank" if feature in ("prismatic", "guide_clearance", "guide_friction") else "paper")
    m = m.with_clearances({} if model == "ideal" else {"S" if feature == "guide_clearance" else "B": 5e-4})
    if feature == "guide_clearance":
        m = m.replace(bodies=(*m.bodies[:-1], m.bodies[-1].model_copy(update={"inertia": 1e-4})))
    if feature == "contact_friction":
        return m.with_joint("B", friction=0.15, pin_radius=0.02)
    if feature == "contact_law":
        return m.with_joint("B", contact_law="flores", restitution=0.8)
    laws = {"coulomb_friction": {"friction_torque": 0.2}, "viscous_friction": {"damping": 0.05}}
    laws["load_friction"] = {"friction_radius": 5e-3}
    laws["joint_spring"] = {"stiffness": 3.0, "rest_angle": 0.2}
    laws["nonlinear_spring"] = {"cubic": 3.0, "rest_angle": 0.2}
    laws["stribeck_friction"] = {"friction_torque": 0.1, "static_torque": 0.3, "stribeck_speed": SPEED}
    laws["drag"] = {"drag": 0.01}
    laws["soft_bearing"] = {"radial_stiffness": 1e5}
    parts = {
        "point_spring": {"springs": [{"bodies": ("crank", "follower"), "points": ("A", "E"), **SPRING}]},
        "stop": {"stops": [LIMIT]},
        "varying_load": {"loads": [{"body": "follower", "torque": -0.5, "over": "crank_angle", "table": RISING}]},
    }
    if feature in parts:
        return m.replace(**parts[feature])
    laws["guide_friction"] = {"friction": 0.3}
    if feature in laws:
        return m.with_joint("S" if feature == "guide_friction" else "A", **laws[feature])
    drive = m.drive.model_dump(exclude_unset=True)
    drives = {
        "periodic_torque": {"periodic_torque": {"amplitude": 0.2, "harmonic": 7, "phase": 0.4}},
        "drive_compliance": {"stiffness": COMPLIANCE},
        "backlash": {"half_gap": HALF_GAP},
        "released": {"speed": "free"},
        "course": {"speed": "measured"},
    }
    return m.replace(drive=drive | drives[feature]) if feature in drives else m


def request(pair: Pair, feature: Feature | None) -> Request:
    """A short run of this joint model and motion with this feature."""
    model, motion = pair
    m = mechanism(model, feature)
    if feature == "course":
        return request_of(m, model, motion, time=TIMES, course=(KNOTS, COURSE))
    if feature == "released":
        return request_of(m, model, motion, time=TIMES)
    if feature == "several_drives":
        courses = {"D": (KNOTS, COURSE + np.radians(120.0) - FIRST), "E": (KNOTS, np.radians(60.0) - 3.0 * KNOTS)}
        return request_of(m, model, motion, time=TIMES, courses=courses)
    start = "centred" if feature == "contact_law" else "steady"  # it shows where pins strike
    return request_of(m, model, motion, FIRST + np.array([0.0, 0.06, 0.1]), start=start)


def bending(asked: Request) -> Request:
    """The same with its bars of steel."""
    m = asked.mechanism
    for body in m.bodies:
        if body.length > 0:
            m = m.with_body(body.name, youngs_modulus=STEEL, section=(0.01, 0.01))
    return replace(asked, mechanism=m)


def scopes(capabilities: Capabilities) -> dict[What, Scope]:
    none = Scope.of(())
    return {
        "rigid": capabilities.rigid,
        "beams": capabilities.beams or none,
        "export": capabilities.export or none,
    }


def has(scope: Scope, pair: Pair, feature: Feature | None) -> bool:
    return pair in scope.runs if feature is None else (feature, pair) in scope.features


EVERY: list[tuple[str, What, Pair, Feature | None]] = [
    (name, what, pair, feature)
    for name in ENGINES
    for what in ("rigid", "beams", "export")
    for pair in PAIRS
    for feature in (None, *FEATURES)
    if feature is None or (sensible(feature, pair) and pair in scopes(declared(name).capabilities)[what].runs)
]
DECLARED = [row for row in EVERY if has(scopes(declared(row[0]).capabilities)[row[1]], *row[2:])]
REFUSED = [row for row in EVERY if row not in DECLARED]
# Of the features the short part of the suite has those with ideal joints, and friction in contact; none is exported.
LONG = [
    row
    for row in DECLARED
    if (row[3] not in (None, "contact_friction") and row[2][0] != "ideal")
    or (row[3] is not None and row[1] == "export")
]
SHORT = [row for row in DECLARED if row not in LONG]


def title(value: object) -> str:
    return "-".join(value) if isinstance(value, tuple) else str(value)


def answer(name: str, what: What, asked: Request, folder: Path) -> dict[str, np.ndarray]:
    """Signals (N,) of a request; of an export, those that it expects."""
    chosen = engine(name)
    if what == "rigid":
        return dict(chosen.simulate(asked).signals)
    if what == "beams":
        return dict(chosen.simulate_flexible(bending(asked)).signals)
    folder.mkdir()
    written = {path.name: path for path in chosen.export(asked, folder)}
    assert "run.py" in written
    with written["expected.csv"].open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return {heading.split(" [")[0]: np.array([float(row[heading]) for row in rows]) for heading in rows[0]}


@cache
def plainly(name: str, what: What, pair: Pair, prismatic: bool, start: Start, folder: Path) -> dict[str, np.ndarray]:
    """What an engine answers without a feature."""
    asked = replace(request(pair, "prismatic" if prismatic else None), start=start)
    return answer(name, what, asked, folder / f"{name}-{'-'.join(pair)}-{prismatic}-{start}")


def lags(feature: Feature, lag: np.ndarray, torque: np.ndarray) -> bool:
    """Whether a crank lags (rad) behind its motor as its drive yields, or as it lies on a flank of its backlash."""
    if feature == "backlash":
        return bool(np.allclose(lag, HALF_GAP * np.sign(torque), atol=1e-5))
    return bool(np.abs(lag).max() > 1e-4 and np.allclose(lag, torque / COMPLIANCE, atol=1e-6))


def shows(feature: Feature, pair: Pair, seen: dict[str, np.ndarray], without: dict[str, np.ndarray]) -> bool:
    """Whether a feature is seen in the signals of a run, beside those of the same run without it."""
    crank = seen.get("crank_angle", np.zeros(0))
    if feature in ("prismatic", "guide_clearance"):
        off = np.hypot(seen.get("clearance_S_x", 5e-4), seen.get("clearance_S_y", 0.0))
        return "reaction_S_moment" in seen and bool(np.abs(off / 5e-4 - 1).max() < 0.01)
    if feature == "course":
        from scipy.interpolate import CubicSpline

        return bool(np.abs(crank - CubicSpline(KNOTS, COURSE)(TIMES)).max() < 1e-6)
    if feature == "several_drives":
        return bool(np.abs(seen["position_E"] - (np.radians(60.0) - 3.0 * TIMES)).max() < 1e-6)
    if feature == "released":
        return bool(np.all(seen["drive_torque"] == 0) and np.ptp(crank) > 1e-4)
    if feature in ("drive_compliance", "backlash"):
        return lags(feature, request(pair, feature).schedule.crank_angle - crank, seen["drive_torque"])
    changed = [name for name in without if name.startswith("reaction_") or name == "drive_torque"]
    return max(float(np.abs(seen[name] - without[name]).max()) for name in changed) > 1e-3


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """For exports without a feature."""
    return tmp_path_factory.mktemp("without")


@pytest.mark.long_rows(
    "mujoco-rigid-contact-static-contact_friction", "mujoco-rigid-spring-damper-static-None",
    "mujoco-rigid-contact-static-None", "mujoco-export-contact-static-None", "mujoco-rigid-massless-link-static-None",
    "exudyn-rigid-contact-driven-contact_friction", "mujoco-export-spring-damper-static-None",
    "mujoco-export-massless-link-static-None", "dart-rigid-ideal-driven-several_drives",
    "pybullet-rigid-ideal-driven-several_drives",
)  # fmt: skip
@pytest.mark.parametrize(("name", "what", "pair", "feature"), [*SHORT, *slow(*LONG)], ids=title)
def test_what_is_declared_runs_and_shows(
    name: str, what: What, pair: Pair, feature: Feature | None, tmp_path: Path, folder: Path
) -> None:
    asked = request(pair, feature)
    assert feature is None or feature in needed(asked)
    seen = answer(name, what, asked, tmp_path / "with")
    assert all(np.all(np.isfinite(values)) for values in seen.values())
    if feature is not None:
        alters = feature not in (
            "prismatic",
            "guide_clearance",
            "course",
            "released",
            "several_drives",
            "drive_compliance",
            "backlash",
        )
        plain = name, what, pair, feature == "guide_friction", asked.start, folder
        without = plainly(*plain) if alters else {}
        assert shows(feature, pair, seen, without)


@pytest.mark.parametrize(("name", "what", "pair", "feature"), REFUSED, ids=title)
def test_what_is_not_declared_is_refused(
    name: str, what: What, pair: Pair, feature: Feature | None, tmp_path: Path
) -> None:
    with pytest.raises(Unsupported) as refusal:
        answer(name, what, request(pair, feature), tmp_path / "with")
    said = str(refusal.value)
    assert name in said
    if feature is not None:
        assert IN_WORDS[feature] in said
        assert needed(request(pair, feature))[feature] in said

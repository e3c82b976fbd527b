"""Links that bend in linkages of several drives, at rest on their courses: Exudyn's beams, the paper's superposition,
and beam theory by hand.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import linkage_crosscheck as lc
from analytic.kinematics.assembly import Assembly
from analytic.mechanism import Load, Mechanism
from analytic.mechanism.file import dumps, load
from analytic.paper.superposition import total_displacement
from commands import compare
from compare.crosscheck import Job, crosscheck_job
from compare.faults import ArgumentError
from compare.judge.courses import Courses
from compare.judge.discrepancy import load_tolerances
from compare.judge.flexible import Beams
from compare.judge.reference import timed_reference, timed_with_flexible_links
from several_linkages import SHIPPED, TIMES, waved
from sim_models.engine import Request, Trace, Unsupported, engine
from sim_models.exudyn.beam_model import Element
from sim_models.exudyn.beams import flexible

pytestmark = pytest.mark.exudyn

STEEL = {"youngs_modulus": 2e11, "shear_modulus": 0.8e11, "section": (0.01, 0.01)}
EA, EI = 2e11 * 1e-4, 2e11 * 1e-8 / 12  # N, N.m^2
BENT = {"five-bar": (), "3-rrr": (), "3-rpr": ("platform",), "2r-arm": ("upper-arm", "forearm")}  # beside their own
PUSHED = {
    "five-bar": ("left-arm", "P"),
    "3-rrr": ("platform", "C3"),
    "3-rpr": ("platform", "C3"),
    "2r-arm": ("forearm", "T"),
}
LOOSE: Mapping[str, Mapping[str, float]] = {
    "five-bar": {"A": 1e-4, "P": 5e-5},
    "3-rrr": {"C1": 1e-4, "B2": 5e-5},
    "3-rpr": {"C1": 1e-4},
    "2r-arm": {"K": 1e-4},
}  # m
SMALL, FULL = 0.5, 50.0  # N
Signals = Mapping[str, np.ndarray]


def steel(name: str) -> Mechanism:
    """A shipped case whose bars, or platform, are of steel."""
    m = load(name)
    for body in BENT[name]:
        m = m.with_body(body, **STEEL)
    return m


def pushed(name: str, size: float) -> Mechanism:
    """The same without weight, under one force (N)."""
    body, point = PUSHED[name]
    force = Load(body=body, point=point, force=(0.6 * size, -0.8 * size))
    return steel(name).replace(gravity=(0.0, 0.0), loads=(force,))


def analysed(m: Mechanism, elastic: bool = True) -> Signals:
    """The superposition, or what clearance makes of rigid links."""
    courses = Courses(waved(m))
    side = timed_reference(Assembly(m), TIMES, courses, "static", "equilibrium", m.clearances)
    return (timed_with_flexible_links(side, Assembly(m), TIMES, courses) if elastic else side).signals


def beams(m: Mechanism, element: Element = "euler-bernoulli") -> Signals:
    model = "contact" if m.clearances else "ideal"
    return flexible(Request(m, model, "static", time=TIMES, courses=waved(m)), element).signals


def places(m: Mechanism, signals: Signals) -> np.ndarray:
    """Where the bodies are (m), (bodies, N) complex."""
    return np.array([signals[f"{body.name}_x"] + 1j * signals[f"{body.name}_y"] for body in m.bodies])


def angles(m: Mechanism, signals: Signals) -> np.ndarray:
    return np.array([signals[f"{body.name}_angle"] for body in m.bodies])


def positions(m: Mechanism, signals: Signals) -> np.ndarray:
    """Where the revolute joints are (rad), (joints, N)."""
    return np.array([signals[f"position_{j.name}"] for j in m.joints if not j.prismatic])


def efforts(m: Mechanism, signals: Signals) -> np.ndarray:
    kinds = ["force" if m.joint(drive.joint).prismatic else "torque" for drive in m.drives]
    return np.array([signals[f"drive_{kind}_{drive.joint}"] for kind, drive in zip(kinds, m.drives, strict=True)])


# ---------------------------------------------------------------- without clearance


# What is left is of second order: the elastic displacement over the links' length, a fiftieth more of a slender arm
@pytest.mark.parametrize(("name", "within"), [("five-bar", 1e-5), ("3-rrr", 3e-5), ("3-rpr", 1e-5), ("2r-arm", 4e-4)])
def test_small_loads_displace_beams_as_the_matrix_says(name: str, within: float) -> None:
    m = pushed(name, SMALL)
    seen, ours, rigid = beams(m), analysed(m), analysed(m, elastic=False)
    for read in (places, angles):
        elastic = read(m, ours) - read(m, rigid)
        assert np.abs(read(m, seen) - read(m, ours)).max() < within * np.abs(elastic).max()
    turned = np.abs(positions(m, ours) - positions(m, rigid)).max()
    assert np.abs(positions(m, seen) - positions(m, ours)).max() <= within * turned + 1e-14
    assert np.abs(efforts(m, seen) - efforts(m, ours)).max() < within * np.abs(efforts(m, ours)).max()


@pytest.mark.parametrize("name", SHIPPED)
def test_what_the_matrix_misses_at_full_load_is_of_second_order(name: str) -> None:
    """A hundred times the load, ten thousand times the difference: geometry, not discretisation."""
    full, small = (places(m, beams(m)) - places(m, analysed(m)) for m in (pushed(name, FULL), pushed(name, SMALL)))
    assert np.abs(full - 1e4 * small).max() < 0.03 * np.abs(full).max()


def test_drives_hold_both_joints_of_an_arm_whose_links_are_cantilevers() -> None:
    """By beam theory: the forearm bends on the elbow's section, the upper arm by the force and moment it hands on."""
    m, force = pushed("2r-arm", SMALL), SMALL * (0.6 - 0.8j)
    seen, rigid = beams(m), analysed(m, elastic=False)
    upper, fore = (np.exp(1j * rigid[f"{name}_angle"]) for name in ("upper-arm", "forearm"))
    along, across = (force * upper.conj()).real, (force * upper.conj()).imag
    moment = ((0.25 * fore).conj() * force).imag
    elbow = (0.3 * along / EA + 1j * (0.3**3 * across / 3 + 0.3**2 * moment / 2) / EI) * upper
    turned = (0.3**2 * across / 2 + 0.3 * moment) / EI
    com, rest = 0.19, 0.06  # m, of the forearm from the elbow, and beyond
    along, across = (force * fore.conj()).real, (force * fore.conj()).imag
    bent = com * along / EA + 1j * (com**3 * across / 3 + com**2 * rest * across / 2) / EI
    moved = elbow + (bent + 1j * com * turned) * fore
    ours = seen["forearm_x"] + 1j * seen["forearm_y"] - rigid["forearm_x"] - 1j * rigid["forearm_y"]
    assert np.abs(ours - moved).max() < 4e-4 * np.abs(moved).max()
    lever = seen["upper-arm_x"] * 0.0 + ((0.3 * upper + 0.25 * fore).conj() * force).imag
    assert np.abs(seen["drive_torque_O"] + lever).max() < 4e-4 * np.abs(lever).max()
    assert np.abs(seen["drive_torque_K"] + moment).max() < 4e-4 * np.abs(moment).max()


@pytest.mark.parametrize("name", SHIPPED)
def test_drives_stay_where_their_courses_have_them(name: str) -> None:
    m = pushed(name, FULL)
    seen = beams(m)
    for joint, at in Courses(waved(m)).at(TIMES).items():
        np.testing.assert_allclose(seen[f"position_{joint}"], at, atol=1e-12)


def test_forces_balance_on_the_bent_linkage() -> None:
    """Whatever bends: the ground's reactions and the drives' torques hold weights and loads where they now are."""
    m = steel("five-bar")
    seen = beams(m)
    total = sum((seen[f"reaction_{j}_x"] + 1j * seen[f"reaction_{j}_y"] for j in "DE"), np.zeros(TIMES.size, complex))
    weight = -9.81j * sum(body.mass for body in m.bodies)
    assert np.abs(total + weight - 20j).max() < 1e-6


# ---------------------------------------------------------------- with clearance


@pytest.mark.parametrize(("name", "within"), [("five-bar", 1e-4), ("3-rrr", 1e-4), ("3-rpr", 1e-5), ("2r-arm", 3e-4)])
def test_clearance_and_small_loads_add_up(name: str, within: float) -> None:
    m = pushed(name, SMALL).with_clearances(LOOSE[name])
    seen, ours = beams(m), analysed(m)
    ideal = places(m, analysed(m.with_clearances({}), elastic=False))
    moved = np.abs(places(m, ours) - ideal).max()
    assert np.abs(places(m, seen) - places(m, ours)).max() < within * moved
    alone = [places(m, analysed(m, elastic=False)), places(m, analysed(m.with_clearances({})))]
    for part in alone:  # neither alone would do
        assert np.abs(places(m, seen) - part).max() > 20 * np.abs(places(m, seen) - places(m, ours)).max()


@pytest.mark.parametrize("name", SHIPPED)
def test_a_total_displacement_of_several_drives_is_the_same_sum(name: str) -> None:
    m = pushed(name, SMALL).with_clearances(LOOSE[name])
    assembly = Assembly(m)
    inputs = assembly.inputs_at(Courses(waved(m)).at(TIMES))
    total = total_displacement(assembly, inputs, model="equilibrium", near=assembly.follow(inputs)).signals()
    ours = analysed(m)
    for body in m.bodies:
        for part in ("x", "y", "angle"):
            np.testing.assert_allclose(total[f"{body.name}_{part}"], ours[f"{body.name}_{part}"], atol=1e-12)


# ---------------------------------------------------------------- cross-checks


def checked(m: Mechanism, joint_model: Any, resolve: Any = None) -> Any:
    """A cross-check with flexible links."""
    job = Job(
        m, ("exudyn",), load_tolerances(None), "static",
        time=TIMES, courses=Courses(waved(m)), joint_model=joint_model, flexible=True,
    )  # fmt: skip
    (run,) = crosscheck_job(job, resolve=resolve).runs
    return run


def outside(run: Any) -> set[str]:
    return {d.signal for d in run.discrepancies if d.verdict != "agrees"}


@pytest.mark.parametrize("joint_model", ["ideal", "contact"])
@pytest.mark.parametrize("name", SHIPPED)
def test_beams_and_superposition_agree_under_the_cases_own_loads(name: str, joint_model: str) -> None:
    m = steel(name).with_clearances(LOOSE[name])
    run = checked(m, joint_model)
    assert not outside(run)
    assert {f"{body.name}_{axis}" for body in m.bodies for axis in "xy"} <= {d.signal for d in run.discrepancies}
    np.testing.assert_array_equal(run.time, TIMES)


class Softer:
    """An engine whose links are a tenth softer than it is told."""

    def __init__(self, name: str) -> None:
        self.beams = Beams.of(name)
        self.name, self.package, self.capabilities = self.beams.name, self.beams.package, self.beams.capabilities

    def simulate(self, request: Request) -> Trace:
        m = request.mechanism
        for body in m.bodies:
            if body.youngs_modulus is not None:
                m = m.with_body(body.name, youngs_modulus=0.9 * body.youngs_modulus)
        return self.beams.simulate(
            Request(m, request.joint_model, "static", time=request.time, courses=request.courses)
        )


@pytest.mark.parametrize("name", ["five-bar", "3-rrr", "2r-arm"])
def test_links_a_tenth_softer_on_one_side_are_noticed(name: str) -> None:
    found = outside(checked(steel(name), "ideal", Softer))
    assert {signal for signal in found if signal.endswith(("_x", "_y")) and not signal.startswith("reaction")}


def test_the_command_and_the_analysis_take_times(tmp_path: Path) -> None:
    times = ["--motion", "static", "--times", "0:0.8:0.2"]
    arguments = ["--flexible", "--simulator", "exudyn", "--clearance", "P=1e-4,A=5e-5", *times, "--out", "out"]
    done = compare("--case", "five-bar", *arguments, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "2 runs" in done.stdout
    done = compare("analyse", "--case", "five-bar", "--compliance", *times, "--out", "yields", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "yields" / "analysis.json").read_text(encoding="utf-8"))
    ours = lc.analyse("five-bar", motion="static", times=np.linspace(0, 0.8, 5), compliance=True)
    rigid = lc.analyse("five-bar", motion="static", times=np.linspace(0, 0.8, 5))
    assert found["compliance"] is ours.compliance is True
    np.testing.assert_allclose(found["signals"]["left-arm_y"], ours.signals["left-arm_y"], rtol=1e-12)
    assert 1e-5 < np.abs(ours.signals["left-arm_y"] - rigid.signals["left-arm_y"]).max() < 1e-4  # m


def test_a_crank_over_time_bends_as_it_does_over_its_angle() -> None:
    m = load("paper")
    time = np.linspace(0.1, 0.5, 5)
    courses = {"D": (np.linspace(0, 1, 5), 0.4 + np.linspace(0, 1, 5))}
    over = flexible(Request(m, "contact", "static", time=time, courses=courses)).signals
    at = flexible(Request(m, "contact", "static", 0.4 + time)).signals
    for name, values in at.items():
        np.testing.assert_allclose(over[name], values, atol=1e-7 * max(1.0, np.abs(values).max()), err_msg=name)


# ---------------------------------------------------------------- what is refused


def test_what_does_not_bend_over_time_is_refused_in_words() -> None:
    with pytest.raises(ArgumentError, match="flexible links are compared at rest, not in driven motion"):
        lc.crosscheck("five-bar", "exudyn", flexible=True)
    with pytest.raises(ArgumentError, match="elastic displacement is found at rest; ask for static motion"):
        lc.analyse("five-bar", compliance=True)
    with pytest.raises(ArgumentError, match="no body of 3-rpr has a youngs_modulus"):
        lc.crosscheck("3-rpr", "exudyn", flexible=True, motion="static")
    m = load("five-bar")
    with pytest.raises(Unsupported, match=r"motions of several freedoms.* among links that bend"):
        engine("exudyn").simulate_flexible(Request(m, "ideal", "driven", time=TIMES, courses=waved(m)))
    slides = load("3-rpr").with_body("rod1", points={"S1": (0.0, 0.0), "C1": (0.1, 0.0)}, **STEEL)
    with pytest.raises(Unsupported, match="joint 'S1' of 'rod1' is prismatic"):
        engine("exudyn").simulate_flexible(Request(slides, "ideal", "static", time=TIMES, courses=waved(slides)))


def test_a_free_drive_is_refused(tmp_path: Path) -> None:
    m = load("five-bar")
    loose = m.replace(drive=(m.drives[0], m.drives[1].model_copy(update={"speed": "free"})))
    (tmp_path / "loose.toml").write_text(dumps(loose), encoding="utf-8")
    done = compare("--case", "loose.toml", "--flexible", "--motion", "static", "--simulator", "exudyn", cwd=tmp_path)
    assert done.returncode == 2
    assert "no drive of five-bar holds joint" in done.stderr

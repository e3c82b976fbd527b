"""Equilibria of linkages that several drives hold, or one that turns no crank: against the multipliers of the referee
in maximal coordinates, against virtual work, and against slow motion.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import linkage_crosscheck as lc
from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.schedule import Schedule
from analytic.mechanism import MASS_CENTRE, Mechanism
from analytic.mechanism.file import load
from asked import request_of
from compare.analyse import request
from compare.faults import ArgumentError
from compare.judge.reference import Reference, reference
from compare.questions.analyse import SimulateQuestion
from compare.results.crosscheck import CrossCheck
from engine_checks import vector
from engines_here import present
from marks import slow, slow_but
from maximal import Maximal, Posed
from several_linkages import CASES, KNOTS, SHIPPED, TIMES, Knots, splines, waved
from several_truths import agrees, close, forces_agree
from sim_models.engine import ENGINES, Cause, JointModel, SimulationError, Trace, Unsupported, engine

EACH = [pytest.param(name, marks=getattr(pytest.mark, name)) for name in ENGINES]
NEAR = {"within": 1e-6, "motors": 1e-6, "rates": 1e-6}  # PyBullet's pins let a rounding of its rates through
SHORT, LATER = ("five-bar", "3-rrr", "3-rpr with springs"), ("3-rrr with springs", "3-rpr", "2r-arm", "parallelogram")
LOOSE: Mapping[str, Mapping[str, float]] = {
    "five-bar": {"A": 1e-4},
    "3-rrr": {"C1": 1e-4, "B2": 5e-5},
    "3-rpr": {"C1": 1e-4},
    "2r-arm": {"K": 1e-4},
}  # m
TORQUE, FORCE = 0.05, 2.0  # N.m, N: dry friction


class Rubbing(Maximal):
    """The referee with dry friction in every pin, against the rates ``way`` (3 bodies,)."""

    way: np.ndarray | None = None

    def forces(self, q: np.ndarray, rates: np.ndarray) -> np.ndarray:
        out = super().forces(q, rates)
        for joint in self.m.joints if self.way is not None else ():
            slip = np.sign(self.spin(self.way, joint.bodies[1]) - self.spin(self.way, joint.bodies[0]))
            for body, sign in zip(joint.bodies, (1.0, -1.0), strict=True):
                if body != "ground":
                    out[self.index[body] + 2] += sign * joint.friction_torque * slip
        return out


def held(judge: Maximal, courses: Knots, times: np.ndarray, near: np.ndarray | None = None) -> list[Posed]:
    """What a referee says of the drives at rest where their courses have them at times (N,) s."""
    found, motors = [], splines(courses)
    q = judge.home(Assembly(judge.m).positions) if near is None else near
    for t in times:
        posed = judge.driven_at(q, {name: (float(spline(t)), 0.0, 0.0) for name, spline in motors.items()})
        q = posed.q
        found.append(posed)
    return found


def analysed(m: Mechanism, courses: Knots, times: np.ndarray = TIMES) -> Reference:
    return reference(Assembly(m), Schedule.along(courses, times, at_rest=True), "equilibrium", m.clearances)


def rest(name: str, m: Mechanism, courses: Knots, times: np.ndarray = TIMES, model: JointModel = "ideal") -> Trace:
    return engine(name).simulate(request_of(m, model, "static", time=times, courses=courses))


def efforts(signals: Mapping[str, np.ndarray], m: Mechanism) -> dict[str, np.ndarray]:
    """What each drive gives (N,) N.m, N, by joint."""
    kinds = {drive.joint: "force" if m.joint(drive.joint).prismatic else "torque" for drive in m.drives}
    return {name: signals[f"drive_{kind}_{name}"] for name, kind in kinds.items()}


# ---------------------------------------------------------------- ideal joints


@pytest.mark.long_rows("3-rpr with springs", "3-rpr", "3-rrr", "3-rrr with springs")
@pytest.mark.parametrize("name", CASES)
def test_reactions_and_drives_are_the_multipliers_of_the_referee(name: str) -> None:
    m = CASES[name].with_clearances({})
    found, posed = analysed(m, waved(m)).signals, held(Maximal(m, tuple(waved(m))), waved(m), TIMES)
    forces_agree(m, found, posed, within=1e-10, motors=1e-10)
    for joint in posed[0].undetermined:
        assert np.all(np.isnan(vector(found, f"reaction_{joint}")))
    for body in m.bodies:
        assert not found[f"{body.name}_angular_velocity"].any()


@pytest.mark.parametrize("case", ["five-bar", "3-rrr", "3-rpr"])
def test_what_a_drive_gives_is_what_a_small_step_of_it_lifts(case: str) -> None:
    """Virtual work: the energy of weights and loads after a step of one drive, over the step."""
    m, courses, step = load(case), waved(load(case)), 1e-5
    judge, found = Maximal(m, tuple(courses)), efforts(analysed(m, courses).signals, m)
    q = judge.home(Assembly(m).positions)
    for k, t in enumerate(TIMES):
        at = {name: float(spline(t)) for name, spline in splines(courses).items()}
        q = judge.closed(q, at)
        for name in at:
            low, high = (lifted(judge, judge.closed(q, at | {name: at[name] + side})) for side in (-step, step))
            assert abs(found[name][k] - (high - low) / (2 * step)) < 1e-7 * np.abs(found[name]).max()


def lifted(judge: Maximal, q: np.ndarray) -> float:
    """Energy (J) of weights and dead loads."""
    m = judge.m
    total = sum(body.mass * np.conj(complex(*m.gravity)) * judge.point(q, body.name, MASS_CENTRE) for body in m.bodies)
    total += sum(np.conj(complex(*dead.force)) * judge.point(q, dead.body, dead.point) for dead in m.loads)
    return -float(np.real(total))


@pytest.mark.long_rows(
    "3-rpr with springs-dart", "3-rpr with springs-mujoco", "3-rrr-dart", "3-rrr-mujoco", "3-rpr with springs-pybullet",
    "3-rrr-pybullet", "3-rrr-exudyn",
)  # fmt: skip
@pytest.mark.parametrize("name", EACH)
@pytest.mark.parametrize("case", [*SHORT, *slow(*LATER)])
def test_an_engine_at_rest_has_the_forces_of_the_referee_and_no_rates(name: str, case: str) -> None:
    m = CASES[case].with_clearances({})
    judge = Maximal(m, tuple(waved(m)))
    trace = rest(name, m, waved(m))
    agrees(m, trace, judge, held(judge, waved(m), TIMES), **NEAR)
    assert trace.motion == "static"
    np.testing.assert_array_equal(trace.time, TIMES)
    first = m.drives[0].joint
    close(trace.crank_angle, splines(waved(m))[first](TIMES), 1e-9)


@pytest.mark.parametrize("name", slow_but(["mujoco"], ENGINES))
def test_times_may_be_in_any_order_and_few(name: str) -> None:
    m = load("3-rrr")
    trace, backwards = (rest(name, m, waved(m), times) for times in (TIMES, TIMES[::-1]))
    for signal, values in trace.signals.items():
        close(backwards.signals[signal][::-1], values, 1e-7 * max(1.0, np.abs(values).max()))
    alone = rest(name, m, waved(m), TIMES[-1:])
    close(vector(alone, "reaction_C1"), vector(trace, "reaction_C1")[-1:], 1e-7 * 20.0)


@pytest.mark.parametrize("name", EACH)
def test_how_fast_the_courses_are_does_not_matter(name: str) -> None:
    m = CASES["five-bar with springs"]
    quick, late = (
        rest(name, m, {joint: (pace * t, x) for joint, (t, x) in waved(m).items()}, pace * TIMES)
        for pace in (1e-3, 1e4)
    )
    for signal, values in quick.signals.items():
        close(late.signals[signal], values, 1e-7 * max(1.0, np.abs(values).max()))


@pytest.mark.parametrize("name", EACH)
def test_few_times_are_reached_along_the_courses_not_across_a_change_point(name: str) -> None:
    """Straight from the first pose to the last the arms of the five-bar would fall in line."""
    m, knots = load("five-bar"), np.linspace(0.0, 2.0, 41)
    ease = [x**2 * (3 - 2 * x) for x in (np.clip(knots - late, 0.0, 1.0) for late in (0.0, 1.0))]
    courses = {"D": (knots, np.radians(120.0 + 120.0 * ease[0])), "E": (knots, np.radians(60.0 - 120.0 * ease[1]))}
    fine = analysed(m, courses, np.linspace(0.0, 2.0, 21)).signals
    late = analysed(m, courses, np.array([2.0])).signals
    trace = rest(name, m, courses, np.array([2.0]))
    for signal in ("left-arm_angle", "right-arm_angle", "drive_torque_D", "drive_torque_E", "reaction_P_x"):
        close(late[signal], fine[signal][-1:], 1e-9)
        close(trace.signals[signal], fine[signal][-1:], 1e-6)
    straight = {joint: (knots, np.interp(knots, [0.0, 2.0], where[[0, -1]])) for joint, (_, where) in courses.items()}
    with pytest.raises(AssemblyError, match="change point at D = 180 deg"):
        analysed(m, straight, np.array([0.0, 2.0]))


# ---------------------------------------------------------------- slow motion


@pytest.mark.parametrize(
    ("name", "slowed", "within"),
    [
        pytest.param("mujoco", 1000.0, 1e-7, marks=[pytest.mark.mujoco, pytest.mark.slow]),
        pytest.param("exudyn", 1000.0, 1e-7, marks=[pytest.mark.exudyn, pytest.mark.slow]),
    ],
)
def test_it_is_what_slow_drives_come_to(name: str, slowed: float, within: float) -> None:
    """Inertia forces fall with the square of the speed: at a thousandth nothing is left of them."""
    m, times = load("3-rrr"), TIMES[:2]
    still, off = rest(name, m, waved(m), times), {}
    for pace in (1.0, 10.0, slowed):
        courses = {joint: (pace * t, x) for joint, (t, x) in waved(m).items()}
        driven = engine(name).simulate(request_of(m, "ideal", "driven", time=pace * times, courses=courses))
        apart = [driven.signals[f"drive_torque_{j}"] - still.signals[f"drive_torque_{j}"] for j in courses]
        off[pace] = float(np.abs(apart).max()) / max(np.abs(x).max() for x in efforts(still.signals, m).values())
    assert off[1.0] > 1e-3
    assert 99 < off[1.0] / off[10.0] < 101
    assert off[slowed] < within


# ---------------------------------------------------------------- friction


def rough(m: Mechanism, slides: float = FORCE) -> Mechanism:
    for joint in m.joints:
        m = m.with_joint(joint.name, friction_torque=slides if joint.prismatic else TORQUE)
    return m


@pytest.mark.parametrize("name", EACH)
@pytest.mark.parametrize("case", ["five-bar", *slow("3-rrr", "2r-arm")])
def test_friction_acts_against_the_way_that_the_courses_go(name: str, case: str) -> None:
    m = rough(load(case))
    courses = waved(m)
    judge = Rubbing(m, tuple(courses))
    posed = []
    for before in held(Maximal(m, tuple(courses)), courses, TIMES):
        judge.way = None
        at = {n: (float(f(t)), float(f(t, 1)), 0.0) for n, f in splines(courses).items() for t in [TIMES[len(posed)]]}
        judge.way = judge.driven_at(before.q, at).rates
        posed.append(judge.driven_at(before.q, {n: (x, 0.0, 0.0) for n, (x, _, _) in at.items()}))
    agrees(m, rest(name, m, courses), judge, posed, **NEAR)
    close(analysed(m, courses).signals["drive_torque_" + m.drives[0].joint],
          np.array([p.motors[m.drives[0].joint] for p in posed]), 1e-9)  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", EACH)
def test_what_friction_takes_the_drives_give_more_than_without_it(name: str) -> None:
    """Power along the courses, slides among the joints; back along them the other way round."""
    m, courses = load("3-rpr"), waved(load("3-rpr"))
    back = {joint: (t, x[::-1]) for joint, (t, x) in courses.items()}
    smooth, there, again = (
        rest(name, one, way, times)
        for one, way, times in (
            (m, courses, TIMES),
            (rough(m), courses, TIMES),
            (rough(m), back, KNOTS[-1] - TIMES),
        )
    )
    judge, spent = Maximal(m, tuple(courses)), []
    for posed, t in zip(held(judge, courses, TIMES), TIMES, strict=True):
        motors = {n: (float(f(t)), float(f(t, 1)), 0.0) for n, f in splines(courses).items()}
        moved = judge.driven_at(posed.q, motors).rates
        turns = sum(
            abs(judge.spin(moved, j.bodies[1]) - judge.spin(moved, j.bodies[0])) for j in m.joints if not j.prismatic
        )
        spent.append(TORQUE * turns + FORCE * sum(abs(rate) for _, rate, _ in motors.values()))
    given = [
        sum(effort * splines(courses)[joint](TIMES, 1) for joint, effort in efforts(trace.signals, m).items())
        for trace in (smooth, there, again)
    ]
    close(given[1] - given[0], np.array(spent), 1e-6 * max(spent))
    close(given[2] - given[0], -np.array(spent), 1e-6 * max(spent))


@pytest.mark.parametrize("name", EACH)
def test_a_drive_that_stands_has_no_friction_and_others_have_theirs(name: str) -> None:
    m, at = rough(load("five-bar")), Assembly(load("five-bar")).positions
    courses = {"D": (KNOTS, at["D"] + 0.0 * KNOTS), "E": (KNOTS, at["E"] - 0.5 * KNOTS)}
    side, trace = analysed(m, courses), rest(name, m, courses)
    assert not side.flags
    for signal in ("drive_torque_D", "drive_torque_E", "reaction_P_x", "reaction_P_y"):
        close(trace.signals[signal], side.signals[signal], 1e-6)
    without = analysed(m.with_joint("D", friction_torque=0.0), courses).signals["drive_torque_D"]
    close(trace.signals["drive_torque_D"], without, 1e-6)
    apart = trace.signals["drive_torque_E"] - analysed(load("five-bar"), courses).signals["drive_torque_E"]
    assert np.abs(apart).min() > TORQUE  # its own joint's, and what the others add


def test_where_all_drives_turn_back_at_once_friction_has_no_direction_and_is_not_compared() -> None:
    m, at = rough(load("five-bar")), Assembly(load("five-bar")).positions
    swing = np.sin(np.pi * KNOTS / KNOTS[-1])
    courses = {"D": (KNOTS, at["D"] + 0.5 * swing), "E": (KNOTS, at["E"] - 0.3 * swing)}
    side = analysed(m, courses, np.array([0.1, 0.3, 0.5]))
    assert set(side.flags) == {1}
    assert np.isnan(side.signals["drive_torque_D"][1])


# ---------------------------------------------------------------- clearance


@pytest.mark.long_rows("five-bar-mujoco")
@pytest.mark.parametrize("name", EACH)
@pytest.mark.parametrize("case", [*SHIPPED[:1], *slow(*SHIPPED[1:])])
def test_pins_lie_on_their_rims_where_the_referee_has_their_reactions_point(name: str, case: str) -> None:
    """Of a massless link, or of rigid contact: its gap is along the multipliers of the linkage that it displaces."""
    m = load(case).with_clearances(dict(LOOSE[case]))
    model: JointModel = "massless-link" if ("massless-link", "static") in engine(name).capabilities.runs else "contact"
    trace, judge = rest(name, m, waved(m), model=model), Maximal(m, tuple(waved(m)))
    near, posed = judge.home(Assembly(m).positions), []
    for k, t in enumerate(TIMES):
        judge.gaps = {joint: complex(vector(trace, f"clearance_{joint}")[k]) for joint in LOOSE[case]}
        posed += held(judge, waved(m), np.array([t]), near)
        near = posed[-1].q
        for joint, gap in judge.gaps.items():
            assert abs(abs(gap) / m.joint(joint).clearance - 1) < 1e-3  # rods of 1e10 N/m give
            across = (posed[-1].forces[joint] * np.conj(gap)).imag / abs(gap)
            assert (posed[-1].forces[joint] * np.conj(gap)).real > 0
            assert abs(across) < 1e-6 * max(abs(force) for force in posed[-1].forces.values())
    forces_agree(m, trace.signals, posed, within=1e-5, motors=1e-5)


@pytest.mark.long_rows("first_order")
@pytest.mark.parametrize("model", ["first_order", "equilibrium"])
def test_the_analytic_pin_is_where_the_referees_reaction_presses_it(model: str) -> None:
    m = load("3-rrr").with_clearances({"C1": 1e-4})
    side = reference(Assembly(m), Schedule.along(waved(m), TIMES, at_rest=True), model, m.clearances).signals
    gaps = side["clearance_C1_x"] + 1j * side["clearance_C1_y"]
    judge = Maximal(m, tuple(waved(m)))
    near = judge.home(Assembly(m).positions)
    for t, gap in zip(TIMES, gaps, strict=True):
        judge.gaps = {} if model == "first_order" else {"C1": complex(gap)}
        posed = held(judge, waved(m), np.array([t]), near)[0]
        near = posed.q
        assert abs(abs(gap) - 1e-4) < 1e-12
        assert abs(np.angle(posed.forces["C1"] / gap)) < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("case", SHIPPED)
def test_every_engine_and_joint_model_agrees_with_the_analytic_model(case: str) -> None:
    engines = [*present()]
    result = lc.crosscheck(case, engines, motion="static", clearance=LOOSE[case], times=np.linspace(0.0, 0.4, 6))
    assert result.verdict == "agrees"
    asked = {
        (name, model) for name in engines for model, motion in engine(name).capabilities.runs if motion == "static"
    }
    assert {(run.simulator.name, run.joint_model) for run in result.runs} == asked


# ---------------------------------------------------------------- asked for, told and refused


@pytest.mark.mujoco
def test_a_cross_check_at_rest_tells_its_samples_by_time(tmp_path: Path) -> None:
    result = lc.crosscheck("five-bar", "mujoco", motion="static", joint_model="contact", clearance={"A": 1e-4},
                           times=np.linspace(0.0, 0.5, 3))  # fmt: skip
    assert result.verdict == "agrees"
    assert result.over_time
    result.write(tmp_path)
    told = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))["runs"][0]
    assert told["motion"] == "static"
    assert told["time"] == [0.0, 0.25, 0.5]
    assert CrossCheck.read(tmp_path / "result.json").to_json() == result.to_json()
    suite = ElementTree.parse(tmp_path / "junit.xml").getroot()[0]
    assert suite.attrib["name"] == "mujoco, contact, static"
    page = (tmp_path / "report.md").read_text(encoding="utf-8")
    assert "motion: static over time" in page
    assert "3 instants" in page


def table(path: Path, columns: Mapping[str, np.ndarray]) -> Path:
    """A CSV file of columns (N,)."""
    head, numbers = ",".join(columns), np.column_stack(list(columns.values()))
    np.savetxt(path, numbers, "%.17g", delimiter=",", header=head, comments="")
    return path


@pytest.mark.mujoco
def test_one_side_by_itself_takes_courses_and_paths_at_rest(tmp_path: Path) -> None:
    m, time = load("3-rrr"), np.linspace(0.0, 0.4, 9)
    own = {f"position_{name} [rad]": spline(time) for name, spline in splines(waved(m)).items()}
    found = lc.analyse(m, motion="static", course=table(tmp_path / "course.csv", {"time [s]": time, **own}))
    assert found.motion == "static"
    axes = {"x [m]": "x", "y [m]": "y", "angle [rad]": "angle"}
    poses = {f"platform_{head}": found.signals[f"platform_{axis}"] for head, axis in axes.items()}
    path = table(tmp_path / "path.csv", {"time [s]": time, **poses})
    for side in (lc.analyse(m, motion="static", path=path), lc.simulate(m, "mujoco", motion="static", path=path)):
        for name, torque in efforts(found.signals, m).items():
            close(efforts(side.signals, m)[name], torque, 1e-6 * np.abs(torque).max())


@pytest.mark.mujoco
@pytest.mark.exudyn
@pytest.mark.parametrize("case", ["five-bar", *slow("3-rpr")])
def test_another_programs_equilibria_are_checked_by_their_positions(case: str, tmp_path: Path) -> None:
    found = lc.simulate(case, "exudyn", times=np.linspace(0.0, 0.5, 11), motion="static")
    text = found.files()["signals.csv"]
    assert text.startswith("time [s],")
    (tmp_path / "theirs.csv").write_text(text, encoding="utf-8")
    checked = lc.check(tmp_path / "theirs.csv", case, motion="static", joint_model="ideal")
    assert checked.verdict == "agrees"
    assert lc.check(tmp_path / "theirs.csv", case, joint_model="ideal").verdict == "disagrees"


@pytest.mark.slow
@pytest.mark.exudyn
def test_positions_of_a_checked_file_are_as_exact_as_they_are_written(tmp_path: Path) -> None:
    """Though its times have three decimals, and a body is off by a hundredth of a millimetre."""
    found = lc.simulate("five-bar", "exudyn", times=np.round(np.linspace(0.0, 0.5, 101), 3))
    lines = found.files()["signals.csv"].splitlines()
    place = lines[0].split(",").index("left-arm_x [m]")
    rows = [line.split(",") for line in lines[1:]]
    assert all(len(row[0]) <= 5 for row in rows)
    for off, verdict in ((0.0, "agrees"), (1e-5, "disagrees")):
        wrong = [
            [*row[:place], repr(float(row[place]) + off * (k == 50)), *row[place + 1 :]] for k, row in enumerate(rows)
        ]
        (tmp_path / "theirs.csv").write_text("\n".join([lines[0], *map(",".join, wrong)]) + "\n", encoding="utf-8")
        assert lc.check(tmp_path / "theirs.csv", "five-bar", joint_model="ideal").verdict == verdict


@pytest.mark.exudyn
def test_a_driven_position_of_the_other_sign_is_told_with_the_line_that_mends_it(tmp_path: Path) -> None:
    found = lc.simulate("five-bar", "exudyn", times=np.linspace(0.0, 0.5, 21))
    lines = found.files()["signals.csv"].splitlines()
    place = lines[0].split(",").index("position_D [rad]")
    rows = [line.split(",") for line in lines[1:]]
    wrong = [[*row[:place], repr(-float(row[place])), *row[place + 1 :]] for row in rows]
    (tmp_path / "theirs.csv").write_text("\n".join([lines[0], *map(",".join, wrong)]) + "\n", encoding="utf-8")
    said = lc.check(tmp_path / "theirs.csv", "five-bar", joint_model="ideal").warnings
    assert any("agree with position_D of the other sign" in each for each in said)
    assert any('say "position_D [rad]" = { signal = "position_D", unit = "rad", sign = -1 }' in each for each in said)
    assert not any("times the analytic side's" in each for each in said)


def test_a_linkage_that_no_drive_holds_has_no_static_motion() -> None:
    m = load("2r-arm").replace(drives=[{"joint": "O", "speed": 2.0}, {"joint": "K", "speed": "free"}])
    words = r"motion: no drive of 2r-arm holds joint 'K'.*; leave motion out, or give that joint a \[\[drive\]\]"
    for ask in (lc.analyse, lc.simulate, lc.crosscheck):
        with pytest.raises(ArgumentError, match=words):
            ask(m, motion="static", times=[0.0, 0.1])
    with pytest.raises(ArgumentError, match="no drive of 2r-arm holds joint 'O'"):
        lc.analyse(load("2r-arm").replace(drives=()), motion="static", times=[0.0, 0.1])
    courses = {"O": waved(load("2r-arm"))["O"]}
    with pytest.raises(Unsupported, match="2r-arm: no drive holds joint 'K' at rest; use motion 'driven'"):
        engine("mujoco").simulate(request_of(m, "ideal", "static", time=TIMES, courses=courses))


def test_what_is_asked_of_a_crank_is_refused_at_rest_too() -> None:
    with pytest.raises(ArgumentError, match="angles: five-bar is looked at over time"):
        lc.analyse("five-bar", motion="static", angles=[0.1])


def test_a_request_of_the_command_is_static_with_its_courses() -> None:
    m = load("five-bar")
    asked = request(m, SimulateQuestion(m, motion="static", times=np.linspace(0.0, 0.2, 5)))
    assert asked.motion == "static"
    assert set(asked.schedule.courses) == {"D", "E"}


@pytest.mark.parametrize("name", EACH)
def test_a_pin_that_nothing_presses_is_named_with_its_time(name: str) -> None:
    m = load("five-bar").replace(gravity=(0.0, 0.0), loads=()).with_clearances({"A": 1e-4})
    with pytest.raises(SimulationError) as error:
        rest(name, m, waved(m), TIMES[:2], "spring-damper")
    assert error.value.cause is Cause.UNPRESSED
    assert "joint" in str(error.value)
    assert f"at {TIMES[0]:.4g} s" in str(error.value)


@pytest.mark.parametrize("name", EACH)
def test_courses_that_cannot_be_followed_are_refused(name: str) -> None:
    m, at = load("five-bar"), Assembly(load("five-bar")).positions
    apart = {"D": (KNOTS, at["D"] + 4.0 * KNOTS), "E": (KNOTS, at["E"] - 4.0 * KNOTS)}
    with pytest.raises(AssemblyError, match="five-bar"):
        rest(name, m, apart)


@pytest.mark.parametrize("name", EACH)
def test_a_crank_held_along_its_course_rests_as_at_its_angles(name: str) -> None:
    m = load("crank-rocker")
    angle = Assembly(m).start + np.linspace(0.0, 1.0, 5)
    times = np.linspace(0.0, 0.5, 5)
    courses = {m.drive_joint.name: (times, angle)}
    by_time = rest(name, m, courses, times)
    by_angle = engine(name).simulate(request_of(m, "ideal", "static", angle))
    for signal, values in by_angle.signals.items():
        close(by_time.signals[signal], values, 1e-6 * max(1.0, np.abs(values).max()))


@pytest.mark.exudyn
def test_stiff_contact_in_every_pin_does_not_throw_exudyn_to_another_equilibrium() -> None:
    """Its first try, with the largest step of its difference quotients, lands where bodies have turned twice."""
    m = load("3-rpr").with_clearances({joint.name: 1e-5 for joint in load("3-rpr").joints if not joint.prismatic})
    for joint in m.clearances:
        m = m.with_joint(joint, contact_stiffness=1.6e9)
    trace, side = rest("exudyn", m, waved(m), TIMES[4:5], "spring-damper"), analysed(m, waved(m), TIMES[4:5]).signals
    for joint, given in efforts(side, m).items():
        close(efforts(trace.signals, m)[joint], given, 1e-4 * np.abs(given).max())

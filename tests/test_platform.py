"""What clearance, drives and compliance make of a platform's pose, against other roads: velocities, energy, circles."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq, minimize

import linkage_crosscheck as lc
from analytic.beyond_paper.platform import platform
from analytic.kinematics.assembly import Assembly, AssemblyError, Walk
from analytic.kinematics.inverse import FOLLOWS, inverse, splined
from analytic.kinematics.motion import Gap, kinematics
from analytic.kinematics.output import Output
from analytic.kinematics.workspace import workspace
from analytic.mechanism import MASS_CENTRE, Load, Mechanism
from analytic.mechanism.file import load, loads
from analytic.paper.clearance import displaced
from analytic.paper.compliance import compliance
from analytic.paper.kinetostatics import kinetostatics, reactions_to
from commands import assert_refused, compare
from compare.faults import ArgumentError
from marks import slow
from several_linkages import GANTRY, TIMES, splines, waved
from test_compliance import referee

POSE = {
    "five-bar": [Output("left-arm", axis, "P") for axis in ("x", "y")],
    "3-rrr": [Output("platform", axis) for axis in ("x", "y", "angle")],
    "3-rpr": [Output("platform", axis) for axis in ("x", "y", "angle")],
    "2r-arm": [Output("forearm", axis, "T") for axis in ("x", "y")],
}


STEEL = {"youngs_modulus": 2e11, "shear_modulus": 0.8e11, "section": (0.01, 0.01)}
EA, EI = 2e11 * 1e-4, 2e11 * 1e-8 / 12  # N, N.m^2
UNIT = {"x": (1.0, 0.0), "y": (1j, 0.0), "angle": (0.0, 1.0)}  # force, torque


def inputs_of(assembly: Assembly) -> np.ndarray:
    return assembly.inputs_at({name: spline(TIMES) for name, spline in splines(waved(assembly.mechanism)).items()})


@pytest.mark.parametrize("name", POSE)
def test_a_gap_displaces_the_platform_as_fast_as_it_opens_and_a_drive_as_fast_as_it_moves(name: str) -> None:
    """The other half of the duality: unit reactions are velocities, of the platform while a gap opens at unit rate."""
    assembly = Assembly(load(name))
    s, inputs = assembly.structure, inputs_of(assembly)
    near = assembly.follow(inputs)
    motion = kinematics(assembly, inputs, path=near)
    found = platform(kinetostatics(motion, inertia=False), POSE[name], {}, {})
    closed = np.zeros(TIMES.size, complex)
    for d in POSE[name]:
        for k, pin in enumerate(s.pins):
            for along in (1.0, 1j):
                rate = d.rate(kinematics(assembly, inputs, gaps={pin: Gap(closed, closed + along)}, path=near))
                ours = (np.conj(found.gaps[d][k]) * along).real
                assert np.abs(ours - rate).max() < 1e-9 * max(1.0, np.abs(rate).max()), (d.name, pin)
        for k, i in enumerate(s.inputs):
            speeds = np.zeros((len(s.inputs), 1))
            speeds[k] = s.signs[i]  # a unit rate of the joint's position
            rate = d.rate(kinematics(assembly, inputs, speeds, path=near))
            assert np.abs(found.drives[d][k] - rate).max() < 1e-9 * max(1.0, np.abs(rate).max()), (d.name, i)


@pytest.mark.parametrize("name", POSE)
def test_the_inverse_finds_the_drives_that_made_a_path(name: str) -> None:
    assembly = Assembly(load(name))
    inputs = inputs_of(assembly)
    motion = kinematics(assembly, inputs)
    found = inverse(assembly, POSE[name], np.array([c.value(motion) for c in POSE[name]]))
    assert np.abs(found.coordinates[list(assembly.structure.inputs)] - inputs).max() < 1e-10


def test_a_pose_that_is_out_of_reach_or_singular_is_named() -> None:
    assembly = Assembly(load("2r-arm"))
    wanted = POSE["2r-arm"]
    with pytest.raises(AssemblyError, match=r"2r-arm: forearm.T_x = .*, forearm.T_y = .* (is singular|cannot be)"):
        inverse(assembly, wanted, np.array([[0.3, 0.4, 0.5], [0.3, 0.4, 0.5]]))
    with pytest.raises(AssemblyError, match=r"1 wanted coordinates \(forearm.T_x\) and 2 inputs \(O, K\)"):
        inverse(assembly, wanted[:1], np.array([[0.3]]))


def hand(upper: np.ndarray, elbow: np.ndarray) -> np.ndarray:
    """Where the hand of the 2R arm is (2, N), m, at these joint angles (N,) rad."""
    place = 0.3 * np.exp(1j * upper) + 0.25 * np.exp(1j * (upper + elbow))
    return np.array([place.real, place.imag])


@pytest.mark.parametrize("rows", [8, 41, *slow(10, 42, 300)])
@pytest.mark.parametrize("swing", ["even", "faster and faster"])
def test_a_path_through_a_straight_arm_is_refused_at_its_singular_pose(rows: int, swing: str) -> None:
    """The elbow goes from 1.1 to -1.1 rad or so; it is straight within rows, or at one of them."""
    time = np.linspace(0.0, 1.0, rows)
    elbow = 1.1 - 2.2 * time if swing == "even" else 1.1 - 1.7 * time - 0.5 * time**3
    upper = 0.5 + 0.3 * time
    straight = float(np.interp(0.0, -elbow, time))
    with pytest.raises(AssemblyError, match=r"forearm.T_x = .* is singular") as refused:
        inverse(Assembly(load("2r-arm")), POSE["2r-arm"], hand(upper, elbow), time)
    named = float(str(refused.value).partition(" at ")[2].split()[0])  # s
    assert abs(named - straight) < 0.6 * time[1]


@pytest.mark.parametrize("rows", [12, 42, 300])
@pytest.mark.parametrize("nearest", [0.05, -0.05], ids=["as assembled", "folded"])
def test_a_path_that_turns_back_before_the_arm_is_straight_or_folded_is_followed(rows: int, nearest: float) -> None:
    time = np.linspace(0.0, 1.0, rows)
    upper, away = 0.5 + 0.3 * time, 4.2 * (time - 0.5) ** 2
    elbow = nearest + away if nearest > 0 else np.pi + nearest - away
    found = inverse(Assembly(load("2r-arm")), POSE["2r-arm"], hand(upper, elbow), time)
    assert np.abs(found.coordinates - [upper, elbow]).max() < 1e-9


FIVE_BAR = {"left": (0.0, 1.0), "right": (0.12, -1.0)}  # m: a pivot; to which side of its leg the crank is
STRETCHED = 0.26  # m


def to_and_fro(leg: str, short: float, time: np.ndarray) -> np.ndarray:
    """A path (N,) of the five-bar's point P that comes to ``short`` (m) of a leg's end of reach at 0.5 s and turns; of
    both legs at once.
    """
    far = STRETCHED - short - 0.2 * (time - 0.5) ** 2
    if leg == "both":
        return 0.06 + 1j * np.sqrt(far**2 - 0.06**2)
    pivot, side = FIVE_BAR[leg]
    turned = np.pi / 2 - side * (0.3 + 0.1 * (time - 0.5))
    return np.asarray(pivot + far * np.exp(1j * turned))


OTHER_LEGS = [(leg, n) for leg in ("left", "right", "both") for n in (10, 41, 42)
              if (leg, n) not in (("left", 10), ("right", 42), ("both", 41))]  # fmt: skip


@pytest.mark.parametrize(("leg", "rows"), [("left", 10), *slow(("right", 42), ("both", 41), *OTHER_LEGS)])
def test_a_five_bars_path_that_stretches_a_leg_is_refused_and_one_beside_it_is_followed(leg: str, rows: int) -> None:
    assembly, time = Assembly(load("five-bar")), np.linspace(0.0, 1.0, rows)
    through = to_and_fro(leg, 0.0, time)
    with pytest.raises(AssemblyError, match=r"P_x = .* at 0\.[45]\d* s is singular"):
        inverse(assembly, POSE["five-bar"], np.array([through.real, through.imag]), time)
    beside = to_and_fro(leg, 0.002, time)
    found = inverse(assembly, POSE["five-bar"], np.array([beside.real, beside.imag]), time)
    for k, (pivot, side) in enumerate(FIVE_BAR.values()):
        far = np.abs(beside - pivot)
        crank = np.angle(beside - pivot) + side * np.arccos((far**2 + 0.10**2 - 0.16**2) / (2 * far * 0.10))
        assert np.abs(found.coordinates[assembly.structure.inputs[k]] - crank).max() < 1e-9


def wide_five_bar() -> Mechanism:
    """Cranks of 0.1 m at x = 0 and 0.2 m, arms of 0.12 m; the point P between them, above, with the cranks outside."""
    m, point = load("five-bar"), 0.1 + 0.16j
    points = {"left-arm": {"A": (0.0, 0.0), "P": (0.12, 0.0)}, "right-arm": {"B": (0.0, 0.0), "P": (0.12, 0.0)}}
    start = {}
    for name, pivot, side in (("left", 0.0, 1.0), ("right", 0.2, -1.0)):
        far = abs(point - pivot)
        crank = np.angle(point - pivot) + side * np.arccos((far**2 + 0.1**2 - 0.12**2) / (2 * far * 0.1))
        arm = np.angle(point - pivot - 0.1 * np.exp(1j * crank))
        start |= {f"{name}-crank": float(crank), f"{name}-arm": float(arm)}
    bodies = [b.model_copy(update={"points": points.get(b.name, b.points)}) for b in m.bodies]
    ground = m.ground.model_copy(update={"points": {"D": (0.0, 0.0), "E": (0.2, 0.0)}})
    return m.replace(ground=ground, bodies=bodies, assembly=start)


def refused(m: Mechanism, path: list[np.ndarray], time: np.ndarray) -> tuple[str, float]:
    """What is said of a path of its platform that is refused, and the time (s) that it names."""
    wanted = POSE["3-rpr"] if len(path) == 3 else POSE["five-bar"]
    with pytest.raises(AssemblyError) as found:
        inverse(Assembly(m), wanted, np.array(path), time)
    told = str(found.value)
    assert told.count(f"{m.name}: ") == 1
    return told, float(told.partition(" at ")[2].split()[0])


@pytest.mark.parametrize("rows", [11, *slow(42, 43)])
def test_a_path_on_which_a_five_bars_arms_fall_in_line_is_singular_and_not_out_of_reach(rows: int) -> None:
    """P comes down between the cranks: 0.14 m from either pivot, well within the legs' 0.22 m, the arms are in line,
    and the ends of the cranks 0.24 m apart.
    """
    time = np.linspace(0.0, 1.0, rows)
    told, at = refused(wide_five_bar(), [np.full(rows, 0.1), 0.16 - 0.1 * time], time)
    assert "left-arm.P_x = 100 mm, left-arm.P_y = 97.979" in told
    assert "is singular: left-arm and right-arm fall in line, and the drives do not hold it there" in told
    assert "reach" not in told
    assert at == pytest.approx((0.16 - np.sqrt(0.1**2 - 0.02**2)) / 0.1, abs=1e-4)


def test_a_path_that_turns_back_before_the_arms_fall_in_line_is_followed() -> None:
    time = np.linspace(0.0, 1.0, 42)
    place = 0.1 + 1j * (0.0985 + 0.2 * (time - 0.5) ** 2)
    assembly = Assembly(wide_five_bar())
    found = inverse(assembly, POSE["five-bar"], np.array([place.real, place.imag]), time).coordinates
    far = np.abs(place)
    crank = np.angle(place) + np.arccos((far**2 + 0.1**2 - 0.12**2) / (2 * far * 0.1))
    assert np.abs(found[assembly.structure.inputs[0]] - crank).max() < 1e-9


@pytest.mark.parametrize("rows", [11, 42])
def test_a_five_bars_path_beyond_its_legs_cannot_be_reached_and_that_is_said_once(rows: int) -> None:
    """At x = 0.1 m both legs, 0.22 m, end at y = sqrt(0.22^2 - 0.1^2) = 195.96 mm."""
    time = np.linspace(0.0, 1.0, rows)
    told, at = refused(wide_five_bar(), [np.full(rows, 0.1), 0.16 + 0.05 * time], time)
    assert told.count("cannot be reached") == 1
    assert "singular" not in told
    end = (np.sqrt(0.22**2 - 0.1**2) - 0.16) / 0.05
    assert end < at < end + time[1]


@pytest.mark.parametrize("rows", [11, *slow(42)])
def test_a_platform_that_turns_parallel_to_the_triangle_of_its_pivots_is_singular(rows: int) -> None:
    """Both triangles of the 3-RPR are equilateral: parallel, its legs' lines meet where one is the other's picture."""
    m, time = load("3-rpr"), np.linspace(0.0, 1.0, rows)
    told, at = refused(m, [np.full(rows, 0.02), np.full(rows, 0.01), 0.5 - 0.8 * time], time)
    assert "is singular: the loops through " in told
    assert at == pytest.approx(0.5 / 0.8, abs=1e-4)


@pytest.mark.parametrize(("rows", "beside", "over"), [(20, 0.35, 3e-4), (20, 0.65, 3e-4), (40, 0.42, 1e-4)])
def test_a_path_that_leaves_reach_between_two_rows_alone_is_refused_where_it_does(
    rows: int, beside: float, over: float
) -> None:
    """The hand comes out beyond the arm's 0.55 m by ``over`` and goes back, ``beside`` a row of 20 or 40."""
    time = np.linspace(0.0, 1.0, rows)
    swell = np.exp(-(((time - (rows // 2 + beside) / (rows - 1)) / 0.3) ** 2))
    swell = (swell - swell[0]) / (1 - swell[0])
    home = complex(*hand(np.array([0.5]), np.array([1.1]))[:, 0])
    place = (abs(home) + (0.55 + over - abs(home)) * swell) * np.exp(1j * (np.angle(home) + 0.3 * time))
    assert np.abs(place).max() < 0.55 - 1e-6
    spline = CubicSpline(time, place)
    out = brentq(lambda t: abs(spline(t)) - 0.55, time[rows // 2], time[rows // 2] + 0.5 * time[1])
    with pytest.raises(AssemblyError, match=r"forearm.T_x = .* is singular: the platform cannot move on") as refused:
        inverse(Assembly(load("2r-arm")), POSE["2r-arm"], np.array([place.real, place.imag]), time)
    assert float(str(refused.value).partition(" at ")[2].split()[0]) == pytest.approx(out, abs=1e-5)


@pytest.mark.parametrize(("rows", "dip"), [(10, 1e-4), (11, 3e-4), (20, 1e-4)])
def test_a_path_on_which_arms_fall_in_line_twice_between_two_rows_is_refused_at_the_first(
    rows: int, dip: float
) -> None:
    """P comes down below y = 97.98 mm by ``dip`` and goes up again."""
    time = np.linspace(0.0, 1.0, rows)
    line, lowest = np.sqrt(0.1**2 - 0.02**2), (rows // 2 - 0.5) / (rows - 1)
    height = line - dip + 0.3 * (time - lowest) ** 2
    assert np.all(height > line)
    told, at = refused(wide_five_bar(), [np.full(rows, 0.1), height], time)
    assert "is singular: left-arm and right-arm fall in line" in told
    assert at == pytest.approx(lowest - np.sqrt(dip / 0.3), abs=1e-5)


@pytest.mark.long_rows("3-rpr", "3-rrr")
@pytest.mark.parametrize("name", POSE)
def test_drives_move_a_platform_along_the_spline_through_eight_rows(name: str) -> None:
    """Its place and velocity, and its acceleration to a thousandth, between the rows too: by the drives' own spline."""
    assembly, time, wanted = Assembly(load(name)), np.linspace(0.0, 1.0, 8), POSE[name]
    home = kinematics(assembly, assembly.inputs[:, None])
    ways = {"x": 0.03 * np.sin(4 * time), "y": 0.03 * (np.cos(5 * time) - 1), "angle": 0.2 * np.sin(3 * time)}
    poses = np.array([c.value(home)[0] + ways[c.axis] for c in wanted])
    instants, followed = splined(assembly, wanted, poses, time)
    assert np.all(np.isin(time, instants))
    drives = CubicSpline(instants, followed.coordinates[list(assembly.structure.inputs)], axis=1)
    fine = np.linspace(0.0, 1.0, 201)
    motion = kinematics(assembly, drives(fine), drives(fine, 1), drives(fine, 2))
    size = max(body.length for body in assembly.mechanism.bodies)
    for c, row in zip(wanted, poses, strict=True):
        spline, turns = CubicSpline(time, row), c.axis == "angle"
        part = np.real if c.axis == "x" else np.imag
        speed = motion.angular_velocity(c.body) if turns else part(motion.velocity(c.body, c.point))
        push = motion.angular_acceleration(c.body) if turns else part(motion.acceleration(c.body, c.point))
        assert np.abs(c.value(motion) - spline(fine)).max() < 3 * FOLLOWS * (1.0 if turns else size)
        assert np.abs(speed - spline(fine, 1)).max() < 3e-5 * np.abs(spline(fine, 1)).max()
        assert np.abs(push - spline(fine, 2)).max() < 1e-3 * np.abs(spline(fine, 2)).max()


def test_what_a_path_cannot_say_at_a_straight_arm_a_course_does(tmp_path: Path) -> None:
    time = np.linspace(0.0, 1.0, 42)
    upper, elbow = 0.5 + 0.3 * time, 1.1 - 2.2 * time
    wrist = 0.3 * np.exp(1j * upper) + 0.19 * np.exp(1j * (upper + elbow))  # the forearm's centre of mass
    path, course = tmp_path / "path.csv", tmp_path / "course.csv"
    for file, header, columns in (
        (path, "time [s],forearm_x [m],forearm_y [m]", (time, wrist.real, wrist.imag)),
        (course, "time [s],position_O [rad],position_K [rad]", (time, upper, elbow)),
    ):
        np.savetxt(file, np.column_stack(columns), "%.17g", ",", header=header, comments="")
    with pytest.raises(lc.Error, match=r"path.csv: .*forearm_x = 390.0\d* mm, .* at 0.5 s is singular.* a course"):
        lc.analyse("2r-arm", path=path)
    found = lc.analyse("2r-arm", course=course)
    assert found.signals["position_K"][[0, -1]] == pytest.approx([1.1, -1.1])
    np.testing.assert_allclose(found.signals["forearm_x"], wrist.real, atol=1e-9)


def heavy(m: Mechanism) -> Mechanism:
    """The linkage with all that has a potential: weights and constant forces."""
    return m.with_clearances({"A": 4e-4, "P": 6e-4})


def test_pins_of_a_five_bar_settle_where_the_potential_energy_is_least() -> None:
    """Needs no reactions: over the places of both pins on their rims the energy of weights and loads has a minimum."""
    m = heavy(load("five-bar"))
    assembly = Assembly(m)
    for inputs in inputs_of(assembly).T[::3]:
        at = inputs[:, None]
        near = assembly.follow(at)

        def energy(angles: np.ndarray, at: np.ndarray = at, near: Walk = near) -> float:
            gaps = {
                pin: Gap(np.array([m.clearances[pin] * np.exp(1j * a)]))
                for pin, a in zip(("A", "P"), angles, strict=True)
            }
            motion = kinematics(assembly, at, gaps=gaps, path=near)
            weight = sum(b.mass * 9.81 * motion.position(b.name, MASS_CENTRE).imag[0] for b in m.bodies)
            return float(weight + 20.0 * motion.position("left-arm", "P").imag[0])

        found = displaced(assembly, at, inertia=False, near=near)
        angles = np.array([np.angle(found.gaps[pin][0]) for pin in ("A", "P")])
        least = minimize(
            lambda a: 1e3 * energy(a), angles + 0.3, method="Nelder-Mead", options={"xatol": 1e-8, "fatol": 1e-13}
        )
        assert np.abs(np.angle(np.exp(1j * (least.x - angles)))).max() < 1e-4


def test_first_order_is_off_by_the_square_of_the_gap() -> None:
    off = []
    for size in (2e-4, 1e-4):
        found = lc.platform_accuracy("five-bar", clearance={"P": size}, outputs="left-arm.P", times=TIMES)
        output = found.outputs["left-arm.P_x"]
        off.append(float(np.abs(output.nominal - output.equilibrium).max()))
    assert off[0] / off[1] == pytest.approx(4.0, rel=0.03)


# ---------------------------------------------------------------- compliance


def test_links_of_a_five_bar_bend_as_pynites_do() -> None:
    m = load("five-bar").replace(gravity=(0.0, 0.0))
    for body in m.bodies:
        m = m.with_body(body.name, **STEEL)
    assembly = Assembly(m)
    inputs = inputs_of(assembly)
    motion = kinematics(assembly, inputs, path=assembly.follow(inputs))
    found = compliance(motion)
    chains = [
        [(body, p) for p in (a, "com", b)]
        for body, a, b in (
            ("left-crank", "D", "A"), ("left-arm", "A", "P"), ("right-crank", "E", "B"), ("right-arm", "B", "P"),
        )
    ]  # fmt: skip
    held = {("left-crank", "D"): "clamp", ("right-crank", "E"): "clamp"}
    for k in range(0, TIMES.size, 3):
        part = motion.part(np.array([k]))
        there = referee(part, chains, held, {("left-arm", "P"): -20j})
        size = max(abs(value) for value in there.values())
        for (body, point), value in there.items():
            assert abs(found.displacement(body, point)[k] - value) < 1e-8 * size, (body, point)


@pytest.mark.parametrize("axis", ["x", "y", "angle"])
def test_a_platform_on_three_legs_gives_by_castiglianos_theorem(axis: str) -> None:
    """Cranks are clamped by their motors and bend, rods are pulled along, the platform is rigid."""
    m = load("3-rrr").replace(gravity=(0.0, 0.0), loads=(Load(body="platform", point="com", force=(30.0, -40.0)),))
    assembly = Assembly(m)
    inputs = inputs_of(assembly)
    motion = kinematics(assembly, inputs, path=assembly.follow(inputs))
    d = Output("platform", axis)
    real, unit = (
        kinetostatics(motion, inertia=False).forces,
        reactions_to(motion, "platform", MASS_CENTRE, *UNIT[axis])[0],
    )
    given = np.zeros(TIMES.size)
    for leg in "123":
        along = np.exp(1j * motion.angle(f"crank{leg}"))
        crank, virtual = (-forces[f"B{leg}"] * along.conj() for forces in (real, unit))  # rod on crank
        given += 0.14 * crank.real * virtual.real / EA + 0.14**3 / 3 * crank.imag * virtual.imag / EI
        along = np.exp(1j * motion.angle(f"rod{leg}"))
        rod, virtual = ((forces[f"C{leg}"] * along.conj()).real for forces in (real, unit))
        given += 0.2 * rod * virtual / EA
    assert np.abs(compliance(motion).output(d) - given).max() < 1e-9 * np.abs(given).max()


def test_a_platform_on_slides_alone_is_as_accurate_as_their_encoders() -> None:
    m = loads(GANTRY)
    grid = ((0.0, 0.2, 5), (0.0, 0.1, 3))
    for where in ({}, {"workspace": grid}):
        found = lc.platform_accuracy(m, outputs=["tool"], encoder_step={"X": 1e-4}, **where)
        assert found.outputs["tool_x"].resolution.max() == pytest.approx(5e-5)
        assert not found.outputs["tool_y"].resolution.any()
        assert not found.outputs["tool_x"].worst_case.any()


@pytest.mark.parametrize("motion", [{"times": [0.0, 0.1]}, {"course": "none.csv"}, {"path": "none.csv"}])
def test_a_motion_is_refused_beside_a_workspace(motion: dict[str, object]) -> None:
    with pytest.raises(ArgumentError, match=f"{next(iter(motion))}: is of a motion, and a workspace is of poses"):
        lc.platform_accuracy("five-bar", outputs=["left-arm.P"], workspace=((0, 0.1, 3), (0.1, 0.2, 3)), **motion)


def test_a_five_bars_workspace_is_within_its_circles_and_its_drives_are_the_circles_angles() -> None:
    assembly = Assembly(load("five-bar"))
    axis = np.linspace(-0.15, 0.25, 41), np.linspace(-0.05, 0.27, 33)
    found = workspace(assembly, POSE["five-bar"], *axis)
    x, y = np.meshgrid(*axis)
    place = (x + 1j * y)[found.reached]
    for pivot, k, side in ((0.0, 0, 1.0), (0.12, 1, -1.0)):
        far = np.abs(place - pivot)
        assert np.all((far > 0.06 - 1e-9) & (far < 0.26 + 1e-9))
        elbow = np.arccos((far**2 + 0.10**2 - 0.16**2) / (2 * far * 0.10))
        crank = np.angle(place - pivot) + side * elbow
        ours = found.coordinates[assembly.structure.inputs[k]]
        clear = (far > 0.061) & (far < 0.259)  # at the rim an elbow is stretched or folded
        off = np.abs(np.angle(np.exp(1j * (ours - crank))))
        assert off[clear].max() < 1e-9  # both elbows stay out, as assembled
        assert off.max() < 1e-6
    assert 500 < found.reached.sum() < found.reached.size


def test_a_workspace_ends_where_a_singular_pose_lies_between() -> None:
    """The arm's elbow stays on its side: all of the ring that it sweeps is reached, nothing beyond its outer circle."""
    assembly = Assembly(load("2r-arm"))
    axis = np.linspace(-0.6, 0.6, 61)
    found = workspace(assembly, POSE["2r-arm"], axis, axis)
    x, y = np.meshgrid(axis, axis)
    far = np.hypot(x, y)
    assert np.array_equal(found.reached, (far > 0.05) & (far < 0.55) & ~((far > 0.5499) | (far < 0.0501)))
    elbow = found.coordinates[assembly.structure.inputs[1]]
    assert np.all(np.sin(elbow) > 0)


def test_a_map_says_where_each_error_is_and_the_errors_add_up() -> None:
    found = lc.platform_accuracy(
        "3-rrr", clearance={"B1": 1e-4, "C2": 2e-4}, encoder_step={"A1": 2e-4}, outputs="platform",
        workspace=((-0.1, 0.1, 11), (-0.1, 0.1, 9)),
    )  # fmt: skip
    assert found.workspace.x.size * found.workspace.y.size == found.holding.size == 99
    assert 40 < found.reached.sum() < 99
    for name, output in found.outputs.items():
        known = np.isfinite(output.total)
        assert np.array_equal(known, found.reached & np.isfinite(output.compliance)), name
        by_joint = 1e-4 * output.sensitivity["B1"] + 2e-4 * output.sensitivity["C2"]
        assert np.allclose(output.worst_case[known], by_joint[known], rtol=1e-12)
        added = output.worst_case + output.resolution + np.abs(output.compliance)
        assert np.allclose(output.total[known], added[known], rtol=1e-12)
        settled = known & np.isfinite(output.equilibrium)
        assert np.all(np.abs(output.equilibrium[settled]) < 1.1 * output.worst_case[settled])
    assert np.allclose(found.outputs["platform_angle"].value[found.reached], -0.3, atol=1e-9)
    assert all(1e-3 < share < 0.05 for share in found.first_order_off.values())


def test_clearance_whose_reaction_nobody_knows_is_refused() -> None:
    from several_linkages import third_bar

    with pytest.raises(AssemblyError, match="statics does not determine the reaction of joint 'B'"):
        lc.platform_accuracy(third_bar(), clearance={"B": 1e-4}, outputs="coupler", times=[0.0, 0.1])


def test_the_command_writes_numbers_a_table_and_a_page(tmp_path: Path) -> None:
    options = ["--output", "left-arm.P", "--clearance", "P=1e-4", "--encoder-step", "D=1e-4,E=1e-4"]
    grid = "--workspace=-0.1:0.2:7,0.05:0.25:5"
    done = compare("accuracy", "--case", "five-bar", *options, grid, "--out", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    written = json.loads((tmp_path / "out" / "accuracy.json").read_text())
    assert written["workspace"]["output"] == "left-arm.P"
    assert len(written["outputs"]["left-arm.P_x"]["total"]) == 35
    page = (tmp_path / "out" / "accuracy.html").read_text()
    assert "left-arm.P_x: error of first order" in page
    assert (tmp_path / "out" / "accuracy.csv").read_text().startswith("output,unit,position_D")


def test_a_workspace_is_the_same_on_a_coarser_grid_and_a_turn_on() -> None:
    assembly = Assembly(load("five-bar"))
    fine, coarse = (
        workspace(assembly, POSE["five-bar"], np.linspace(-0.1, 0.25, n), np.linspace(0.0, 0.3, n)) for n in (81, 11)
    )
    assert np.array_equal(fine.reached[::8, ::8], coarse.reached)
    platform, line = Assembly(load("3-rrr")), np.linspace(-0.1, 0.1, 9)
    here, turned = (workspace(platform, POSE["3-rrr"], line, line, angle) for angle in (-0.3, -0.3 + 4 * np.pi))
    assert np.array_equal(here.reached, turned.reached)
    assert np.allclose(here.coordinates, turned.coordinates)


@pytest.mark.parametrize(
    "given",
    [
        {"angle": np.nan, "workspace": ((-0.1, 0.1, 3), (-0.1, 0.1, 3))},
        {"workspace": "-0.1:0.1:3,-0.1:0.1:3"},
        {"workspace": ((np.nan, 0.1, 3), (-0.1, 0.1, 3))},
        {"workspace": ((-0.1, 0.1, 2.5), (-0.1, 0.1, 3))},
        {"workspace": ((-0.1, 0.1, 3),)},
        {"workspace": (np.zeros(4), np.zeros(4))},
    ],
    ids=["no angle", "a command's words", "no number", "half a place", "one axis", "places"],
)
def test_a_workspace_that_is_none_is_refused(given: dict[str, object]) -> None:
    with pytest.raises(lc.Error, match="cannot be used; give"):
        lc.platform_accuracy("3-rrr", outputs="platform", **given)  # type: ignore[arg-type]


REFUSED = {
    "no grid": (["--workspace", "0:1:5"], "--workspace 0:1:5: give x0:x1:nx,y0:y1:ny in metres"),
    "an empty grid": (["--workspace", "0:0:5,0:1:5"], "each axis needs a higher end"),
    "out of reach": (["--workspace", "5:6:5,5:6:5"], "no place of the grid"),
    "a step of nothing": (["--encoder-step", "A=1e-4"], "'A' is no driven joint; they are D, E"),
    "of a crank": (["--angles", "0:10:5"], "--angles is of linkages that one crank moves"),
    "angle of two drives": (["--workspace", "0:0.1:3,0.1:0.2:3", "--angle", "20"], "is set by three drives"),
}


@pytest.mark.parametrize("fault", REFUSED)
def test_what_cannot_be_used_is_refused_in_one_sentence(fault: str, tmp_path: Path) -> None:
    options, words = REFUSED[fault]
    done = compare("accuracy", "--case", "five-bar", *options, "--out", "out", cwd=tmp_path)
    assert_refused(done, words)
    assert not (tmp_path / "out").exists() or not list((tmp_path / "out").iterdir())

"""Linkages that are not moved by one crank, held against a referee in maximal coordinates with multipliers."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

import linkage_crosscheck as lc
from analytic.beyond_paper.free_motion import free_motion
from analytic.beyond_paper.released import released
from analytic.compiled.run import followed
from analytic.kinematics.assembly import Assembly, AssemblyError, Walk
from analytic.kinematics.motion import along, kinematics
from analytic.kinematics.schedule import Knots, Schedule
from analytic.kinematics.structure import StructureError
from analytic.mechanism import Mechanism, MechanismError
from analytic.mechanism.file import dumps, load, loads
from analytic.paper.clearance import displaced
from analytic.paper.kinetostatics import Reactions, kinetostatics
from compare.judge.signals import compared
from maximal import Maximal
from several_linkages import CASES, PISTON_PIN, SHIPPED, TIMES, referee, splines, sprung, third_bar, waved
from sim_models.engine import ENGINES, MOTIONS, Motion

POSE = (("x", "m"), ("y", "m"), ("angle", "rad"))
ROUNDING = 1e-10  # of the largest of a signal's kind


def driven(m: Mechanism, courses: Mapping[str, Knots], times: np.ndarray) -> Reactions:
    return kinetostatics(along(Assembly(m), Schedule.along(courses, times)))


def moved(m: Mechanism, times: np.ndarray = TIMES) -> Reactions:
    return driven(m, waved(m), times)


@pytest.mark.long_rows("3-rpr", "3-rrr", "3-rpr with springs", "3-rrr with springs")
@pytest.mark.parametrize("name", CASES)
def test_positions_rates_and_all_that_is_determined_of_the_forces_are_the_referees(name: str) -> None:
    m = CASES[name]
    found = moved(m)
    judge, posed = referee(m, waved(m), TIMES)
    motion = found.motion
    for body in m.bodies:
        k = judge.index[body.name]
        for q, places in (("q", motion.position), ("rates", motion.velocity), ("accelerations", motion.acceleration)):
            theirs = np.array([complex(*getattr(p, q)[k : k + 2]) for p in posed])
            assert np.abs(places(body.name, "centre of mass") - theirs).max() < ROUNDING * max(
                1.0, np.abs(theirs).max()
            )
        turned = np.array([p.q[k + 2] for p in posed])
        assert np.abs(motion.angle(body.name) - turned).max() < ROUNDING
    largest = max(abs(force) for p in posed for force in p.forces.values())
    for joint in m.joints:
        theirs = np.array([p.forces[joint.name] for p in posed])
        if joint.name in found.undetermined:
            assert np.all(np.isnan(found.forces[joint.name]))
        else:
            assert np.abs(found.forces[joint.name] - theirs).max() < ROUNDING * largest
        if joint.prismatic:
            moments = np.array([p.moments[joint.name] for p in posed])
            assert np.abs(found.moments[joint.name] - moments).max() < ROUNDING * largest
    for drive in m.drives:
        motors = np.array([p.motors[drive.joint] for p in posed])
        assert np.abs(found.drive_loads[drive.joint] - motors).max() < ROUNDING * max(1.0, np.abs(motors).max())
    assert found.undetermined == posed[0].undetermined


@pytest.mark.long_rows("2001")
@pytest.mark.parametrize("instants", [3, 2001])
def test_a_pin_that_is_driven_on_a_passive_slide_has_the_torque_of_its_energies(instants: int) -> None:
    """By hand: the arm's angle a of the rod's b is asin(-3 sin b), and at an even rate w the torque is M' w^2 / 2 + V'
    of the masses' M w^2 / 2 and of weights.  At first -4.4006 N.m, the arm at 17.19 deg, the piston at 394.07 mm.
    """
    found = lc.analyse(loads(PISTON_PIN), times=np.linspace(0.0, 0.2, instants)).signals

    def energies(b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        a = np.arcsin(-3.0 * np.sin(b))
        turned = -3.0 * np.cos(b) / np.cos(a)  # of the arm, by the rod's angle
        place = (0.1 * np.cos(a) + 0.15 * np.cos(b), 0.1 * np.sin(a) + 0.15 * np.sin(b))  # of the rod's middle
        speed = (-0.1 * np.sin(a) * turned - 0.15 * np.sin(b), 0.1 * np.cos(a) * turned + 0.15 * np.cos(b))
        piston = -0.1 * np.sin(a) * turned - 0.3 * np.sin(b)
        mass = 0.1**2 / 3 * turned**2 + 2.0 * (speed[0] ** 2 + speed[1] ** 2 + 0.3**2 / 12) + 3.0 * piston**2
        return mass, 9.81 * (0.05 * np.sin(a) + 2.0 * place[1])

    rod = -0.098666 + 0.1 * np.linspace(0.0, 0.2, instants)
    mass, weight = (value.imag / 1e-30 for value in energies(rod + 1e-30j))
    torque = mass * 0.1**2 / 2 + weight
    assert torque[0] == pytest.approx(-4.4006, abs=5e-5)
    np.testing.assert_allclose(found["drive_torque"], torque, rtol=1e-9)
    arm = np.arcsin(-3.0 * np.sin(rod))
    np.testing.assert_allclose(found["arm_angle"], arm, rtol=1e-12)
    np.testing.assert_allclose(found["piston_x"], 0.1 * np.cos(arm) + 0.3 * np.cos(rod), rtol=1e-12)


def test_a_third_bar_leaves_the_torque_determined_and_the_reactions_not() -> None:
    """What the bars share is up to their lengths, to a micrometre; what the crank needs is not."""
    found = moved(third_bar())
    assert found.undetermined == {"D", "A", "B", "E", "c2", "f2"}
    assert np.all(np.isfinite(found.drive_loads["D"]))
    assert np.all(np.isnan(found.forces["B"]))


def test_a_third_bar_that_does_not_fit_is_refused_with_its_joint() -> None:
    with pytest.raises(StructureError, match=r"joint 'f2' closes a loop that is rigid already.*make its lengths agree"):
        Assembly(third_bar(beside=2e-3))


def test_a_structure_that_cannot_move_is_refused() -> None:
    """The coupler pinned to the ground in its middle: the loops close where it is assembled, and nowhere else."""
    m = load("paper").with_clearances({})
    at = 0.2 * np.exp(1j * m.assembly["crank"]) + 0.2
    coupler = m.moving["coupler"].model_copy(update={"points": {**m.moving["coupler"].points, "F": (0.2, 0.0)}})
    ground = m.ground.model_copy(update={"points": {**m.ground.points, "F": (at.real, at.imag)}})
    pin = m.joint("E").model_copy(update={"name": "F", "bodies": ("ground", "coupler")})
    bodies = tuple(coupler if b.name == "coupler" else b for b in m.bodies)
    with pytest.raises(StructureError, match=r"'F' closes a loop that is rigid already, .*\(mobility -1.*; remove it$"):
        Assembly(m.replace(ground=ground, bodies=bodies, joints=(*m.joints, pin)))


def double_pendulum() -> Mechanism:
    return load("2r-arm").replace(name="double pendulum", drives=(), assembly={"upper-arm": 0.2, "forearm": -0.6})


def swinging_forearm() -> Mechanism:
    drives = [{"joint": "O", "speed": 2.0}, {"joint": "K", "speed": "free"}]
    return load("2r-arm").replace(name="forearm let go", drives=drives)


@pytest.mark.long_rows("double pendulum")
@pytest.mark.parametrize("m", [double_pendulum(), swinging_forearm()], ids=lambda m: m.name)
def test_what_no_motor_moves_swings_as_the_referee_says(m: Mechanism) -> None:
    times = np.linspace(0.0, 0.5, 6)
    start, courses = Assembly(m).positions, {}
    if m.drives:
        knots = np.linspace(0.0, 0.6, 9)
        courses = {"O": (knots, start["O"] + 2.0 * knots)}
    motors = splines(courses)
    found = free_motion(Assembly(m), times, motors)
    everything = Maximal(m, ("O", "K"))
    q = everything.home(start)
    rates = everything.driven_at(q, {"O": (start["O"], 2.0 * bool(courses), 0.0), "K": (start["K"], 0.0, 0.0)}).rates
    judge = Maximal(m, tuple(courses))
    posed = judge.released(q, rates, times, {n: lambda t, order, f=f: float(f(t, order)) for n, f in motors.items()})
    for body in m.bodies:
        theirs = np.array([p.q[judge.index[body.name] + 2] for p in posed])
        assert np.abs(found.motion.angle(body.name) - theirs).max() < 1e-8
    for joint in m.joints:
        theirs = np.array([p.forces[joint.name] for p in posed])
        assert np.abs(found.forces[joint.name] - theirs).max() < 1e-7 * np.abs(theirs).max()
    assert np.ptp(found.motion.angle("forearm")) > 0.3  # it does swing


@pytest.mark.slow
def test_a_spring_with_a_damper_slows_a_released_crank_as_the_referee_says() -> None:
    m = sprung(load("crank-rocker").with_clearances({})).replace(drive={"joint": "D", "speed": "free"})
    times = np.linspace(0.0, 0.2, 5)
    found = released(Assembly(m), times).reactions.motion
    judge = Maximal(m, ())
    q = judge.home({})
    for body in m.bodies:
        theirs = np.array([p.q[judge.index[body.name] + 2] for p in judge.released(q, np.zeros(q.size), times, {})])
        assert np.abs(found.angle(body.name) - theirs).max() < 1e-7
    assert np.ptp(found.angle("crank")) > 0.2


def test_free_freedoms_with_dry_friction_are_refused() -> None:
    with pytest.raises(AssemblyError, match=r"free motion .* with dry friction \(friction_torque of joint 'K'\)"):
        free_motion(Assembly(double_pendulum().with_joint("K", friction_torque=0.1)), TIMES, {})


@pytest.mark.parametrize("name", ["five-bar", "3-rrr", "3-rpr"])
def test_pins_of_a_platform_rest_where_their_own_reactions_point(name: str) -> None:
    """The equilibrium of finite gaps, found once more: with its gaps the linkage has reactions along them."""
    m = load(name)
    pin = [j.name for j in m.joints if not j.prismatic][-1]
    assembly, gap = Assembly(m.with_clearances({pin: 2e-4})), 2e-4
    motors = splines(waved(m))
    inputs, rates, pushes = (assembly.inputs_at({n: f(TIMES, k) for n, f in motors.items()}) for k in range(3))
    found = displaced(assembly, inputs, rates, alpha=pushes)
    assert not found.flags
    assert np.allclose(np.abs(found.gaps[pin]), gap)
    assert np.abs(np.angle(found.gaps[pin] / found.reactions.forces[pin])).max() < 1e-9
    paper = displaced(assembly, inputs, rates, alpha=pushes, model="first_order")
    turned = np.abs(np.angle(found.gaps[pin] / paper.gaps[pin])).max()
    assert 1e-5 < turned < 0.02  # the two differ, by about gap over length
    still = displaced(assembly, inputs, 0.0, inertia=False)
    assert not still.flags
    opened = {pin: still.gaps[pin]}
    pressed = displaced(assembly, inputs, 0.0, inertia=False).configuration
    assert np.abs(pressed.motion.columns[assembly.structure.gap_column(pin)] - opened[pin]).max() < 1e-15


def test_a_singular_pose_is_named_and_gives_no_number() -> None:
    """The cranks fall apart until the arms between them are stretched, 0.32 m: at D = 180 and E = 0 deg, between two
    samples.
    """
    assembly = Assembly(load("five-bar"))
    apart = np.linspace(0.0, 1.0, 40)
    at = assembly.positions
    stretched = {"D": at["D"] + 1.2 * apart, "E": at["E"] - 1.2 * apart}
    with pytest.raises(AssemblyError, match=r"change point at D = 180 deg, E = .*deg, where left-arm and right-arm"):
        kinematics(assembly, assembly.inputs_at(stretched))
    assert np.all(np.isfinite(kinematics(assembly, assembly.inputs_at({n: q[:5] for n, q in stretched.items()})).theta))


def test_a_free_redundant_linkage_that_swings_into_its_change_point_is_told_so() -> None:
    start = dict.fromkeys(("crank", "follower"), 0.4) | dict.fromkeys(("coupler", "bar"), 0.0)
    m = third_bar().replace(drives=(), loads=(), gravity=(-2.0, -9.81), assembly=start)
    with pytest.raises(AssemblyError, match=r"change point at crank angle .*, where coupler and follower fall in line"):
        lc.analyse(m, times=np.linspace(0.0, 2.0, 21))


def test_a_crank_that_is_its_joints_first_body_turns_as_its_drive_says_and_has_its_torque() -> None:
    m, times = load("crank-rocker"), np.linspace(0.0, 0.1, 6)
    turned = m.with_joint("D", bodies=m.joint("D").bodies[::-1])
    found, wanted = (lc.analyse(one, times=times).signals for one in (turned, m))
    for name, values in wanted.items():
        sign = -1.0 if name in ("position_D", "reaction_D_x", "reaction_D_y") else 1.0
        if name != "reaction_D_angle":
            np.testing.assert_allclose(found[name], sign * values, atol=1e-9, err_msg=name)


def test_a_speed_is_a_cranks_own_alone_and_its_joints_beside_another_drive() -> None:
    """Of a joint from an arm to the ground: the arm turns at +1.5 rad/s alone, at -1.5 beside a second drive."""
    m = load("2r-arm")
    both = m.with_joint("O", bodies=m.joint("O").bodies[::-1])
    alone = both.replace(
        bodies=both.bodies[:1],
        joints=both.joints[:1],
        drives=both.drives[:1],
        loads=(),
        assembly={"upper-arm": m.assembly["upper-arm"]},
    )
    for one, speed in ((alone, 1.5), (both, -1.5)):
        turned = lc.analyse(one, times=[0.0, 0.1]).signals
        np.testing.assert_allclose(np.diff(turned["upper-arm_angle"]), 0.1 * speed, rtol=1e-9)
        np.testing.assert_allclose(turned["upper-arm_angular_velocity"], speed, rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", [pytest.param(n, marks=getattr(pytest.mark, n)) for n in ENGINES])
@pytest.mark.parametrize("motion", MOTIONS)
def test_so_does_it_in_every_engine(name: str, motion: Motion) -> None:
    m = load("crank-rocker")
    turned = m.with_joint("D", bodies=m.joint("D").bodies[::-1])
    found = lc.crosscheck(turned, simulator=name, times=np.linspace(0.0, 0.1, 6), motion=motion)
    assert found.verdict == "agrees"
    assert "drive_torque" in {d.signal for d in found.runs[0].discrepancies}


def test_the_crank_of_a_free_linkage_is_told_by_its_own_angle() -> None:
    found = lc.analyse(third_bar().replace(drives=()), times=np.linspace(0.0, 0.3, 4))
    np.testing.assert_array_equal(found.crank_angle, found.signals["crank_angle"])
    assert np.ptp(found.crank_angle) > 0.01


def test_motion_of_one_crank_is_the_same_by_time_and_by_angle() -> None:
    m = load("crank-rocker")
    times = np.linspace(0.0, 0.15, 7)
    angle = Assembly(m).start + m.speed * times
    by_angle = kinetostatics(kinematics(Assembly(m), angle, m.speed))
    knots = np.linspace(0.0, 0.2, 5)
    by_time = driven(m, {"D": (knots, Assembly(m).start + m.speed * knots)}, times)
    for name, values in by_angle.signals().items():
        assert np.abs(by_time.signals()[name] - values).max() < 1e-9 * max(1.0, np.abs(values).max()), name


@pytest.mark.parametrize("name", SHIPPED)
def test_a_file_of_several_drives_is_written_and_read_again(name: str) -> None:
    assert loads(dumps(load(name))) == load(name)


CART = """
name = "a cart on a spring"
gravity = [0.0, -9.81]
ground = { points = { X = [0.0, 0.0], W = [0.5, 0.0] } }
body = [{ name = "cart", points = { X = [0.0, 0.0] }, mass = 1.0, inertia = 1e-3 }]
joint = [{ name = "X", type = "prismatic", bodies = ["ground", "cart"], axis = [1.0, 0.0] }]
spring = [{ bodies = ["cart", "ground"], points = ["X", "W"], stiffness = 50.0, length = 0.4 }]
assembly = { cart = 0.0 }
"""
FAULTS = {
    "twice": ('joint = "E"', 'joint = "D"', "drive[D].joint = 'D' has two drives"),
    "no such joint": ('joint = "E"', 'joint = "F"', "drive[F].joint = 'F' is not a joint; the joints are D, E"),
    "a crank's ripple": (
        "speed = -1.0", "speed = -1.0\nripple = { amplitude = 1e-3, harmonic = 2 }", "drive[E].ripple is given",
    ),
    "a word": ("speed = -1.0", 'speed = "fast"', "drive[E].speed = 'fast'"),
    "a spring to nowhere": (
        "[assembly]", '[[spring]]\nbodies = ["ground", "left-arm"]\npoints = ["D", "Q"]\nstiffness = 1.0\n\n[assembly]',
        "spring.points names 'Q', no point of 'left-arm'",
    ),
    "a spring within a body": (
        "[assembly]",
        '[[spring]]\nbodies = ["left-arm", "left-arm"]\npoints = ["A", "P"]\nstiffness = 1.0\n\n[assembly]',
        "spring.bodies are both 'left-arm'",
    ),
    "a spring across a pin": (
        "[assembly]",
        '[[spring]]\nbodies = ["left-arm", "right-arm"]\npoints = ["P", "P"]\nstiffness = 1.0\n\n[assembly]',
        "spring.points are both at joint 'P', where its force has no direction",
    ),
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_of_several_drives_is_named_with_field_and_value(fault: str) -> None:
    from importlib import resources

    text = resources.files("analytic.mechanism").joinpath("cases", "five-bar.toml").read_text(encoding="utf-8")
    old, new, words = FAULTS[fault]
    with pytest.raises(MechanismError) as error:
        loads(text.replace(old, new, 1))
    assert words in str(error.value)


def table(path: Path, columns: Mapping[str, np.ndarray]) -> Path:
    """A CSV file of columns (N,)."""
    numbers = np.column_stack(list(columns.values()))
    np.savetxt(path, numbers, "%.17g", delimiter=",", header=",".join(columns), comments="")
    return path


def test_angles_of_a_course_a_path_and_recorded_results_may_be_told_in_any_turn(tmp_path: Path) -> None:
    m, time = load("3-rrr"), np.linspace(0.0, 0.6, 31)
    own = {name: spline(time) for name, spline in splines(waved(m)).items()}
    turns = {"A1": 2 * np.pi, "A2": -4 * np.pi, "A3": 0.0}
    elsewhere = {f"position_{name} [rad]": own[name] + turn for name, turn in turns.items()}
    middle = own["A3"][15]
    elsewhere["position_A3 [rad]"] = np.mod(own["A3"] - middle, 2 * np.pi) + middle  # starts again on its way
    plain = {f"position_{name} [rad]": values for name, values in own.items()}
    found = [
        lc.analyse(m, course=table(tmp_path / f"{name}.csv", {"time [s]": time, **columns}))
        for name, columns in (("plain", plain), ("turned", elsewhere))
    ]
    for signal, values in found[0].signals.items():
        assert np.abs(found[1].signals[signal] - values).max() < 1e-7 * max(1.0, np.abs(values).max()), signal
    poses = {f"platform_{axis} [{unit}]": found[0].signals[f"platform_{axis}"] for axis, unit in POSE}
    poses["platform_angle [rad]"] = poses["platform_angle [rad]"] - 2 * np.pi
    along = lc.analyse(m, path=table(tmp_path / "path.csv", {"time [s]": time, **poses}))
    for name in own:
        told = along.signals[f"drive_torque_{name}"] - found[0].signals[f"drive_torque_{name}"]
        assert np.abs(told[3:-3]).max() < 1e-3 * np.abs(found[0].signals[f"drive_torque_{name}"]).max(), name
    given = {f"drive_torque_{name} [N.m]": found[0].signals[f"drive_torque_{name}"] for name in own}
    result = lc.check(table(tmp_path / "results.csv", {"time [s]": time, **elsewhere, **given}), m)
    assert result.verdict == "agrees"


def test_columns_of_a_course_or_a_path_that_nobody_uses_are_named(tmp_path: Path) -> None:
    """A motor's torque, and a hinge that the drives turn, do not steer: they change nothing, and that is said."""
    m, time = load("five-bar"), np.linspace(0.0, 0.6, 31)
    own = {f"position_{name} [rad]": spline(time) for name, spline in splines(waved(m)).items()}
    plain = lc.analyse(m, course=table(tmp_path / "plain.csv", {"time [s]": time, **own}))
    poses = {f"{axis} [mm]": 1e3 * plain.signals[axis] for axis in ("left-arm_x", "left-arm_y")}
    others = {name: np.full(time.size, 3.0) for name in ("foo", "drive_torque_D [N.m]", "position_A [rad]")}
    steered = {"course": (own, "no position of a driven joint"), "path": (poses, "no x, y or angle of a body")}
    for way, (columns, role) in steered.items():
        file = table(tmp_path / f"{way}.csv", {"time [s]": time, **columns, **others})
        bare = lc.analyse(m, **{way: table(tmp_path / "bare.csv", {"time [s]": time, **columns})})
        with pytest.warns(UserWarning, match="and ignored"):
            told = lc.analyse(m, **{way: file})
        assert told.warnings == (
            *bare.warnings,
            f"{way}.csv: 'foo' is no signal of the linkage, and ignored",
            f"{way}.csv: 'drive_torque_D [N.m]', 'position_A [rad]' are {role}, and ignored",
        )
        for signal, values in bare.signals.items():
            np.testing.assert_array_equal(told.signals[signal], values, signal)


def test_one_of_several_drives_may_be_held() -> None:
    m = load("five-bar")
    held = m.replace(drives=(m.drives[0], m.drives[1].model_copy(update={"speed": 0.0})))
    courses = {d.joint: (TIMES, Assembly(m).positions[d.joint] + float(d.speed) * TIMES) for d in held.drives}
    found, (_, truth) = driven(held, courses, TIMES), referee(held, courses, TIMES)
    for name, torque in found.drive_loads.items():
        assert np.abs(torque - [posed.motors[name] for posed in truth]).max() < 1e-9, name


def test_driven_slides_start_where_rough_angles_bring_pins_closest_whatever_the_order_of_bodies() -> None:
    """A leg's two pins share what is left open between them, so that only the platform's place and the travels are
    sought; with angles that are 0.02 rad off the travels of two orders were 5 mm apart.
    """
    m, rng = load("3-rpr"), np.random.default_rng(3)
    m = m.replace(assembly={body: angle + rng.uniform(-0.02, 0.02) for body, angle in m.assembly.items()})
    platform, ground = m.body("platform"), m.ground
    rows, open_by = [], []
    for k, leg in enumerate("123"):
        along = np.exp(1j * np.mean([m.assembly[f"{part}{leg}"] for part in ("cylinder", "rod")]))
        pin = np.exp(1j * m.assembly["platform"]) * complex(*platform.points[f"C{leg}"])
        rows.append([along * (i == k) for i in range(3)] + [-1.0, -1j])
        open_by.append(pin - complex(*ground.points[f"A{leg}"]))
    sides = [np.array(each) for each in (rows, open_by)]
    best = np.linalg.lstsq(*(np.concatenate([side.real, side.imag]) for side in sides), rcond=None)[0]
    for _ in range(12):
        shuffled = {"bodies": rng.permutation(len(m.bodies)), "joints": rng.permutation(len(m.joints))}
        other = m.replace(**{what: [getattr(m, what)[i] for i in order] for what, order in shuffled.items()})
        found = Assembly(other).positions
        np.testing.assert_allclose([found[f"S{leg}"] for leg in "123"], best[:3], rtol=0, atol=1e-14)


def test_what_slides_freely_is_judged_by_its_travel() -> None:
    m = loads(CART)
    assert {"cart_x", "cart_y"} <= {signal.name for signal in compared(m, [])}
    assert not {"cart_x", "cart_y"} & {signal.name for signal in compared(load("3-rpr"), [])}
    result = lc.crosscheck(m, "mujoco", times=np.linspace(0.0, 0.5, 11))
    assert result.verdict == "agrees"
    assert np.ptp(result.runs[0].analytic["cart_x"]) > 0.01  # m


SLIDE_ON_A_SPRING = """
name = "slide on a spring"
ground.points = { S = [0.0, 0.0], T = [0.0, 0.0] }
body = [{ name = "car", points = { S = [0.0, 0.0], T = [0.0, 0.0], R = [0.1, 0.0] }, mass = 1.0 }]
joint = [{ name = "S", type = "prismatic", bodies = ["ground", "car"], axis = [1.0, 0.0] }]
drive = { joint = "S", speed = 0.1 }
spring = [{ bodies = ["ground", "car"], points = ["T", "T"], stiffness = 100.0, length = 0.2 }]
assembly = { car = 0.0 }
"""
ASKED: dict[str, Callable[[Mechanism, np.ndarray], object]] = {
    "analyse": lambda m, times: lc.analyse(m, times=times),
    "crosscheck": lambda m, times: lc.crosscheck(m, "all", times=times),
    "simulate": lambda m, times: lc.simulate(m, "pybullet", times=times),
    "export": lambda m, times: lc.export(m, "mujoco", times=times, folder="never made"),
}


@pytest.mark.parametrize("ask", ASKED)
def test_a_spring_whose_ends_meet_has_no_direction_and_no_engine_is_asked_for_one(ask: str) -> None:
    """Engines know nothing of this fault: what says it is what comes before them."""
    m = loads(SLIDE_ON_A_SPRING)
    with pytest.raises(AssemblyError, match=r"S = 0 mm both ends of the spring between ground.T and car.T are at one"):
        ASKED[ask](m, np.array([0.0, 0.005]))


def test_a_spring_pulls_as_its_length_says_up_to_where_its_ends_meet() -> None:
    """Its 20 N push the car away from just beside that place; one of no length pulls nothing there."""
    m, times = loads(SLIDE_ON_A_SPRING), np.array([1e-6, 0.005])
    away = lc.analyse(m, times=times).signals["drive_force_S"]
    assert away == pytest.approx(100.0 * (0.1 * times - 0.2), rel=1e-12)
    none = m.replace(springs=(m.springs[0].model_copy(update={"length": 0.0}),))
    assert lc.analyse(none, times=np.array([0.0, 0.005])).signals["drive_force_S"] == pytest.approx([0.0, 0.05])
    free = m.replace(drive={"joint": "S", "speed": "free"})
    with pytest.raises(AssemblyError, match="at one place"):
        lc.analyse(free, times=times)


def test_a_drive_too_many_is_what_is_left_out() -> None:
    m = load("five-bar")
    with pytest.raises(StructureError, match=r"3 drives need 3\); leave a drive out"):
        Assembly(m.replace(drives=(*m.drives, m.drives[0].model_copy(update={"joint": "A"}))))


def test_where_friction_locks_several_drives_is_told_by_their_positions() -> None:
    """There is no crank whose angle would say it: the drives are where the file assembles them."""
    m = load("five-bar")
    for joint in "ABP":
        m = m.with_joint(joint, friction_radius=0.2)
    with pytest.raises(AssemblyError, match="locks the linkage at D = 120 deg, E = 60 deg; make friction_radius of"):
        lc.analyse(m, times=[0.0, 0.1])


def test_a_reader_is_told_why_there_is_no_answer() -> None:
    """Drives that stand leave the dry friction of a pin without a direction."""
    m = load("five-bar").with_joint("A", friction_torque=1.0)
    still = m.replace(drives=tuple(drive.model_copy(update={"speed": 0.0}) for drive in m.drives))
    found, page = lc.analyse(still, times=[0.0, 0.1, 0.2]), io.StringIO()
    found.print_to(Console(file=page, width=110))
    why = "no answer at 3 samples of 3, first 0 s: the sliding at A stands or reverses here, and its friction has no"
    why += " direction; peaks are of the others"
    assert why in page.getvalue().splitlines()
    assert why in found._repr_html_()


@pytest.mark.parametrize("name", ["five-bar", "crank-rocker"])
def test_a_way_that_no_memory_holds_is_refused_with_its_samples(name: str) -> None:
    """One a degree: of a crank at 1e8 s as of several drives, by the fastest of them."""
    fastest = max(abs(float(drive.speed)) for drive in load(name).drives)
    samples = f"the way there takes {np.degrees(fastest * 1e8):.3g} samples"
    with pytest.raises(AssemblyError, match=re.escape(samples)):
        lc.analyse(name, times=[0.0, 1e8])


@pytest.mark.parametrize("follow", [Assembly.follow, followed], ids=["numpy", "compiled"])
def test_what_closes_no_loop_is_there_at_once_however_far(follow: Callable[..., np.ndarray | Walk]) -> None:
    """An arm, or an axis, has no change point to look for on the way; a five-bar's way is refused."""
    far = np.array([[0.0, 1e9], [0.5, -1e9]])
    assembly = Assembly(load("2r-arm"))
    there = follow(assembly, far)
    coordinates = there.coordinates if isinstance(there, Walk) else there
    np.testing.assert_array_equal(coordinates[list(assembly.structure.inputs)], far)
    with pytest.raises(AssemblyError, match=re.escape("the way there takes 5.73e+10 samples")):
        follow(Assembly(load("five-bar")), far)


def test_what_is_asked_of_a_crank_is_refused_of_several_drives() -> None:
    m = load("five-bar")
    with pytest.raises(MechanismError, match=r"five-bar: drive is given 2 times \(D, E\)"):
        _ = m.drive_joint
    assert m.speed is None
    assert not m.cranked

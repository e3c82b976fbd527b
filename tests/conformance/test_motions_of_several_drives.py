"""Every engine with several drives, with freedoms that nothing drives, and with springs between points: against a
referee in maximal coordinates, against equations of motion written here, and against the balance of energy.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.mechanism import Drive, Load, Mechanism, Spring
from analytic.mechanism.file import load, loads
from asked import request_of
from engine_checks import LOOSE, declared_runs, vector
from marks import slow, slow_but
from maximal import Maximal, Posed
from several_linkages import CASES, KNOTS, SLIDES, Knots, referee, splines, sprung, third_bar, waved
from several_truths import (
    ARM,
    HANGING,
    SWINGING,
    G,
    agrees,
    close,
    double_pendulum,
    energy,
    gains_what_motors_give,
    on_the_rims,
    pendulum_on_a_spring,
    rattled,
    resting,
    swung_on_its_spring,
    turned_round,
)
from sim_models.engine import (
    ENGINES,
    MOTIONS,
    Cause,
    JointModel,
    Motion,
    SimulationError,
    Trace,
    Unsupported,
    engine,
)

FIVE_BAR = load("five-bar")
TIMES = np.linspace(0.023, 0.203, 5)  # s; between knots: at one, a leapfrog's mean acceleration is not the course's
LONG = np.linspace(0.023, 0.563, 10)
GAP = 2e-4  # m
PINS = declared_runs("driven", LOOSE, "several_drives")
# Of the largest: forces, what motors do, rates.
NEAR: dict[str, dict[str, float]] = {
    "mujoco": {"within": 1e-5, "motors": 1e-5, "rates": 1e-5},
    "exudyn": {"within": 1e-6, "motors": 3e-6, "rates": 3e-6},
    "pybullet": {"within": 1e-5, "motors": 1e-5, "rates": 1e-5},
    "dart": {"within": 1e-5, "motors": 1e-5, "rates": 1e-5},
}


def moved(
    name: str, m: Mechanism, courses: Knots, times: np.ndarray = TIMES, model: JointModel = "ideal", **fields: object
) -> Trace:
    return engine(name).simulate(request_of(m, model, "driven", time=times, courses=courses, **fields))


def driven_at(m: Mechanism, **speeds: float) -> Mechanism:
    """The mechanism with these drives in place of its own."""
    return m.replace(drives=tuple(Drive(joint=joint, speed=speed) for joint, speed in speeds.items()))


# ---------------------------------------------------------------- ideal joints along courses

LINKAGES: dict[str, Mechanism] = {name: m.with_clearances({}) for name, m in CASES.items()} | {
    "gantry": loads(SLIDES),
    "five-bar, a motor between moving bodies": turned_round(driven_at(FIVE_BAR, D=1.0, A=-0.7), "A"),
    "five-bar, told from the other side": turned_round(FIVE_BAR, "D", "A"),
    "five-bar, motors that turn what floats": driven_at(FIVE_BAR, A=1.0, P=-0.7),
    "2r-arm, told from the other side": turned_round(ARM, "O", "K"),
    "3-rpr, told from the other side": turned_round(load("3-rpr"), "S1", "A2"),
    "3-rpr, motors of both kinds": driven_at(load("3-rpr"), S1=0.03, A2=0.1, C3=0.2),
    "3-rrr, motors on one leg": driven_at(load("3-rrr"), A1=0.5, B1=0.3, C1=0.2),
}
FOLLOWED = [(name, case, "soon") for name in ENGINES for case in LINKAGES]
FOLLOWED += [(name, case, "long") for name in ENGINES for case in ("3-rpr", "five-bar with springs")]
SHORT = {
    "mujoco": [*(case for case in CASES if case not in ("3-rrr with springs", "five-bar with springs")), "gantry",
               "five-bar, told from the other side", "3-rpr, told from the other side"],
    "exudyn": [*(case for case in CASES if "springs" not in case), "gantry", "2r-arm, told from the other side"],
    "dart": ["3-rrr", "gantry"],
    "pybullet": ["3-rpr with springs", "2r-arm", "parallelogram"],
}  # fmt: skip
SOON = [(name, case, "soon") for name, cases in SHORT.items() for case in cases]


@cache
def right(case: str, until: str) -> tuple[Maximal, list[Posed]]:
    """What the referee says of a linkage along its courses."""
    return referee(LINKAGES[case], waved(LINKAGES[case]), LONG if until == "long" else TIMES)


@pytest.mark.long_rows(
    "dart-gantry-soon", "dart-3-rrr-soon", "mujoco-3-rpr, told from the other side-soon",
    "pybullet-3-rpr with springs-soon", "mujoco-3-rpr with springs-soon", "pybullet-parallelogram-soon",
    "exudyn-3-rpr-soon", "mujoco-3-rrr-soon", "mujoco-3-rpr-soon", "exudyn-3-rrr-soon",
    "mujoco-five-bar, told from the other side-soon", "mujoco-gantry-soon", "pybullet-2r-arm-soon",
    "mujoco-parallelogram-soon", "mujoco-2r-arm with springs-soon", "mujoco-five-bar-soon", "exudyn-gantry-soon",
    "exudyn-five-bar-soon",
)  # fmt: skip
@pytest.mark.parametrize(("name", "case", "until"), slow_but(SOON, FOLLOWED))
def test_every_drive_follows_its_course_with_the_forces_of_the_referee(name: str, case: str, until: str) -> None:
    """Whichever joint a motor is in, and whichever of its bodies is its first."""
    m = LINKAGES[case]
    courses, times = waved(m), LONG if until == "long" else TIMES
    trace, near = moved(name, m, courses, times), NEAR[name]
    if case not in CASES:  # near postures that it cannot pass
        near = {kind: 3 * allowed for kind, allowed in near.items()} | {"places": 2e-6}
    agrees(m, trace, *right(case, until), **near)
    first = splines(courses)[m.drives[0].joint](times)
    close(trace.crank_angle, first, 1e-7 if name == "exudyn" else 1e-9)
    np.testing.assert_array_equal(trace.time, times)


@pytest.mark.long_rows("dart-eccentric", "pybullet-eccentric")
@pytest.mark.parametrize("off", [0.05, *slow(2.0**-54, 0.0)], ids=["eccentric", "nearly balanced", "balanced"])
@pytest.mark.parametrize("name", ENGINES)
def test_rotors_of_one_point_turn_on_their_pins(name: str, off: float) -> None:
    """Bodies without a length, whose pins are off by rounding: a reaction carries weight and centripetal force, a motor
    the moment of the weight.
    """
    pins, speeds, begins = {"D": 0.1 + 0.2j, "E": 0.37 + 0.011j}, {"D": 1.0, "E": -0.7}, {"D": 0.3, "E": 1.1}
    bodies = [
        {"name": body, "points": {joint: at}, "mass": 1.0, "com": (at[0] + off, at[1]), "inertia": 3e-3}
        for body, joint, at in (("a", "D", (0.03, 0.07)), ("b", "E", (0.013, 0.17)))
    ]
    m = Mechanism.model_validate(
        {
            "name": "rotors", "gravity": (0.0, -G), "body": bodies, "assembly": {"a": 0.3, "b": 1.1},
            "ground": {"points": {joint: (at.real, at.imag) for joint, at in pins.items()}},
            "joint": [{"name": j, "type": "revolute", "bodies": ("ground", b)} for j, b in (("D", "a"), ("E", "b"))],
            "drive": [{"joint": joint, "speed": speed} for joint, speed in speeds.items()],
        }
    )  # fmt: skip
    trace = moved(name, m, {joint: (KNOTS, begins[joint] + speed * KNOTS) for joint, speed in speeds.items()})
    for joint, speed in speeds.items():
        arm = off * np.exp(1j * (begins[joint] + speed * TIMES))
        close(vector(trace, f"reaction_{joint}"), 1j * G - speed**2 * arm, 3e-6 * G)
        close(trace.signals[f"drive_torque_{joint}"], G * arm.real, 1e-6)


@pytest.mark.long_rows("dart")
@pytest.mark.parametrize("name", slow_but(["mujoco", "dart"], ENGINES))
def test_what_motors_give_is_what_the_linkage_gains_in_energy_and_loses_in_dampers(name: str) -> None:
    m, times = CASES["3-rpr with springs"], np.linspace(0.0, 0.1, 51)
    gains_what_motors_give(m, moved(name, m, waved(m), times), waved(m), times)


@pytest.mark.slow
@pytest.mark.parametrize("name", ENGINES)
def test_friction_takes_what_the_motors_give_beside_the_energy(name: str) -> None:
    """Power of motors less that of dry friction is the growth of the energy."""
    m, friction = FIVE_BAR, 0.05
    for joint in ("A", "P"):
        m = m.with_joint(joint, friction_torque=friction)
    times = np.linspace(0.0, 0.2, 81)
    trace = moved(name, m, waved(m), times)
    power = sum(trace.signals[f"drive_torque_{n}"] * course(times, 1) for n, course in splines(waved(m)).items())
    spin = {j: np.gradient(trace.signals[f"position_{j}"], times, edge_order=2) for j in ("A", "P")}
    given = power - friction * sum(np.abs(rate) for rate in spin.values())
    gained = np.concatenate([[0.0], np.cumsum((given[1:] + given[:-1]) / 2 * np.diff(times))])
    held = energy(m, trace)
    assert friction * np.abs(spin["P"]).min() > 0.01 * np.abs(power).max()
    close(held - held[0], gained, 1e-4 * np.ptp(held))


@pytest.mark.long_rows("dart", "pybullet", "mujoco")
@pytest.mark.parametrize("name", ENGINES)
def test_reports_come_in_the_order_asked_for_on_the_clock_of_the_courses(name: str) -> None:
    """The courses begin late, and one has knots of its own."""
    knots = np.linspace(0.013, 0.6, 47)
    courses = waved(FIVE_BAR)
    later = {
        "D": (courses["D"][0] + 5.0, courses["D"][1]), "E": (knots + 5.0, CubicSpline(*courses["E"])(knots))
    }  # fmt: skip
    times = np.array([0.1, 0.0231, 0.13, 0.0331, 0.1])
    trace, posed = moved(name, FIVE_BAR, later, times + 5.0), referee(FIVE_BAR, courses, np.sort(times))[1]
    np.testing.assert_array_equal(trace.time, times + 5.0)
    torque = np.array([p.motors["E"] for p in posed])[np.argsort(np.argsort(times, kind="stable"))]
    close(trace.signals["drive_torque_E"], torque, 3e-5 * np.abs(torque).max())
    close(trace.signals["position_D"], splines(courses)["D"](times), 1e-7 if name == "exudyn" else 1e-8)


@pytest.mark.parametrize("name", slow_but(["mujoco"], ENGINES))
def test_a_linkage_a_thousand_times_smaller_and_a_million_times_lighter_runs_as_well(name: str) -> None:
    def shrunk(points: Mapping[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
        return {point: (x / 1e3, y / 1e3) for point, (x, y) in points.items()}

    small = FIVE_BAR.replace(
        ground=FIVE_BAR.ground.model_copy(update={"points": shrunk(FIVE_BAR.ground.points)}),
        bodies=tuple(
            b.model_copy(update={"points": shrunk(b.points), "mass": b.mass / 1e6, "section": (1e-5, 1e-5)})
            for b in FIVE_BAR.bodies
        ),
        loads=(Load(body="left-arm", point="P", force=(0.0, -2e-5)),),
    )
    soon = LONG / 20  # its gravity is as fast as that of a linkage that is thirty times slower
    trace = moved(name, small, waved(small), soon)
    agrees(small, trace, *referee(small, waved(small), soon), **NEAR[name])


@pytest.mark.slow
@pytest.mark.parametrize("name", ENGINES)
def test_a_crank_on_a_course_is_the_same_by_either_way(name: str) -> None:
    """Where the fastest body, not the crank, says how long a step is."""
    m = load("paper").with_clearances({}).replace(drives=(Drive(joint="D", speed="measured"),))
    angle = np.radians(30.0) + 1.5 * KNOTS + 4.0 * KNOTS**2
    one = engine(name).simulate(request_of(m, "ideal", "driven", time=TIMES, course=(KNOTS, angle)))
    other = moved(name, m, {"D": (KNOTS, angle)})
    assert set(one.signals) == set(other.signals)
    for signal, values in one.signals.items():
        close(other.signals[signal], values, 1e-5 * max(1.0, np.abs(values).max()), signal)


# ---------------------------------------------------------------- nothing drives all of it


@pytest.mark.parametrize("name", slow_but(["mujoco", "exudyn"], ENGINES))
def test_a_double_pendulum_swings_as_lagrange_says_and_keeps_its_energy(name: str) -> None:
    m, times = SWINGING, np.linspace(0.0, 0.4, 5)
    trace = moved(name, m, {}, times)
    for body, angle in zip(("upper-arm", "forearm"), double_pendulum(m, times), strict=True):
        close(trace.signals[f"{body}_angle"], angle, 2e-6 if name == "exudyn" else 1e-6)
    assert np.ptp(energy(m, trace)) < {"mujoco": 1e-8, "exudyn": 5e-6}.get(name, 1e-6)
    assert not [signal for signal in trace.signals if signal.startswith("drive")]
    np.testing.assert_array_equal(trace.crank_angle, trace.signals["upper-arm_angle"])


@pytest.mark.parametrize("name", slow_but(["mujoco", "exudyn"], ENGINES))
def test_a_forearm_hangs_freely_on_a_driven_arm(name: str) -> None:
    m, times = HANGING, np.linspace(0.0, 0.3, 16)
    trace = moved(name, m, {"O": (KNOTS, -1.2 + 2.0 * KNOTS)}, times)
    for body, angle in zip(("upper-arm", "forearm"), double_pendulum(m, times, 2.0), strict=True):
        close(trace.signals[f"{body}_angle"], angle, 1e-6)
    gained = CubicSpline(times, 2.0 * trace.signals["drive_torque"]).antiderivative()(times)
    held = energy(m, trace)
    close(held - held[0], gained - gained[0], 1e-3 * np.ptp(held))


@pytest.mark.long_rows("pybullet", "dart", "exudyn")
@pytest.mark.parametrize("name", ENGINES)
def test_a_loop_with_one_drive_too_few_moves_as_the_referee_says(name: str) -> None:
    m = FIVE_BAR.replace(drives=(Drive(joint="D", speed=2.0), Drive(joint="E", speed="free")))
    at, times = Assembly(m).positions, np.linspace(0.0, 0.04, 5)
    course = {"D": (KNOTS, at["D"] + 2.0 * KNOTS)}
    motor, held, judge = splines(course)["D"], Maximal(m, ("D", "E")), Maximal(m, ("D",))
    start = held.driven_at(held.home(at), {"D": (at["D"], 2.0, 0.0), "E": (at["E"], 0.0, 0.0)})
    posed = judge.released(start.q, start.rates, times, {"D": lambda t, order: float(motor(t, order))})
    near = {"exudyn": (3e-6, 9e-6, 3e-6), "mujoco": (3e-5, 3e-5, 1e-5)}.get(name, (2e-5, 2e-5, 1e-5))
    agrees(m, moved(name, m, course, times), judge, posed, within=near[0], motors=near[1], rates=near[2])


# ---------------------------------------------------------------- clearance

LOOSE_PINS: dict[str, tuple[Mechanism, tuple[str, ...]]] = {
    "five-bar": (FIVE_BAR, ("P",)),
    "five-bar, two pins": (FIVE_BAR, ("A", "P")),
    "five-bar, driven": (FIVE_BAR, ("D",)),
    "five-bar, driven pins": (turned_round(driven_at(FIVE_BAR, D=1.0, A=-0.4), "A"), ("D", "A")),
    "3-rrr": (load("3-rrr"), ("C1", "B2")),
    "3-rpr": (load("3-rpr"), ("C1", "A2")),
    "2r-arm": (ARM, ("K",)),
    "2r-arm, both": (ARM, ("O", "K")),
    "2r-arm with springs": (sprung(ARM), ("K",)),
}
RIMS = [  # of each engine and joint model every other linkage; the next one has the others
    (*row, case) for k, row in enumerate(PINS) for i, case in enumerate(LOOSE_PINS) if (i + k) % 2 == 0
]
PRESSED = [
    ("mujoco", "contact", "five-bar"), ("mujoco", "massless-link", "2r-arm, both"),
    ("exudyn", "contact", "2r-arm with springs"), ("exudyn", "massless-link", "2r-arm, both"),
    ("exudyn", "spring-damper", "five-bar, driven"), ("dart", "contact", "five-bar, driven pins"),
    ("dart", "spring-damper", "2r-arm, both"), ("pybullet", "spring-damper", "2r-arm"),
]  # fmt: skip


@pytest.mark.long_rows(
    "dart-contact-five-bar, driven pins", "exudyn-spring-damper-five-bar, driven", "mujoco-massless-link-2r-arm, both",
    "dart-spring-damper-2r-arm, both",
)  # fmt: skip
@pytest.mark.parametrize(
    ("name", "model", "case"), slow_but(PRESSED, [*RIMS, *(row for row in PRESSED if row not in RIMS)])
)
def test_loose_pins_begin_pressed_and_stay_so(name: str, model: JointModel, case: str) -> None:
    """On their rims, which contact of K = 1e6 N/m lets them press into; rigid contact, and a massless link, do not."""
    m, pins = LOOSE_PINS[case]
    m, times = m.with_clearances(dict.fromkeys(pins, GAP)), np.linspace(0.0, 0.12, 5)
    for joint in pins:
        m = m.with_joint(joint, contact_stiffness=1e6)
    courses = waved(m)
    trace = moved(name, m, courses, times, model)
    assert trace.free_share == dict.fromkeys(pins, 0.0)
    if name == "mujoco":
        assert trace.settings["start"] == "equilibrium"
    stiff = np.inf if model == "massless-link" or (name, model) == ("dart", "contact") else 1e6
    # A damper in a joint feels its pin turn, and Exudyn's springs have a first instant that is off by as much.
    near = 1e-3 if "springs" in case or (name == "exudyn" and "2r-arm" in case) else 5e-4
    found = on_the_rims(m, courses, dict.fromkeys(pins, stiff), times, 0.24)
    truth, largest = found.signals(), max(np.abs(force).max() for force in found.forces.values())
    most = max(np.abs(values).max() for signal, values in truth.items() if signal.startswith("drive"))
    for signal, values in truth.items():
        if signal.endswith("_angle") and not signal.startswith(("reaction", "clearance")):
            close(trace.signals[signal], values, 5e-6, signal)
        elif signal.startswith("reaction") and signal.endswith(("_x", "_y")):
            close(trace.signals[signal], values, near * largest, signal)
        elif signal.startswith("drive"):
            close(trace.signals[signal], values, near * most, signal)
        elif signal.startswith("clearance") and signal.split("_")[1] in pins and signal.endswith(("_x", "_y")):
            close(trace.signals[signal], values, 2e-3 * GAP, signal)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "model"), [row for row in PINS if row[1] == "spring-damper"] + [("mujoco", "contact")]
)
def test_a_pin_that_starts_centred_falls_and_bounces_as_its_equation_says(name: str, model: JointModel) -> None:
    m = FIVE_BAR.with_joint("P", clearance=1e-4, contact_stiffness=1e6, contact_damping=60.0)
    courses, times = waved(m), np.linspace(0.0, 3e-3, 16)
    trace = moved(name, m, courses, times, model, start="centred", step=2e-6)
    gap, force, posed = rattled(m, courses, times)
    most = np.abs(force).max()
    close(vector(trace, "clearance_P"), gap, 3e-7)  # a step in which contact begins or ends is of the first order
    close(vector(trace, "reaction_P"), force, 5e-3 * most)
    close(trace.signals["drive_torque_D"], np.array([p.motors["D"] for p in posed]), 5e-4 * most)


@pytest.mark.long_rows("dart-contact", "mujoco-contact")
@pytest.mark.parametrize(
    ("name", "model"), slow_but([("mujoco", "contact"), ("exudyn", "massless-link"), ("dart", "contact")], PINS)
)
def test_pins_of_what_moves_freely_begin_pressed(name: str, model: JointModel) -> None:
    m, times, course = HANGING, np.linspace(0.0, 0.15, 4), {"O": (KNOTS, -1.2 + 2.0 * KNOTS)}
    ideal, loose = moved(name, m, course, times), moved(name, m.with_clearances({"K": 1e-5}), course, times, model)
    assert loose.free_share == {"K": 0.0}
    close(loose.signals["forearm_angle"], double_pendulum(m, times, 2.0)[1], 1e-4)
    force, gap = vector(ideal, "reaction_K"), vector(loose, "clearance_K")
    assert abs(np.angle(gap[0] / force[0])) < (1e-6 if name in ("mujoco", "exudyn") else 1e-3)
    first, near = (0, 2e-3) if name == "exudyn" else (1, 1e-2)  # others are up to 11 % off at their very first instant
    close(vector(loose, "reaction_K")[first:], force[first:], near * np.abs(force).max())


HELD = [row for row in PINS if row[0] in ("mujoco", "exudyn")]


@pytest.mark.parametrize(("name", "model"), slow_but([("mujoco", "contact")], HELD))
def test_loops_that_hold_too_much_are_started_centred(name: str, model: JointModel) -> None:
    m = third_bar().with_clearances({"f2": 1e-3})
    courses = waved(m)
    with pytest.raises(SimulationError, match="start it centred") as failure:
        moved(name, m, courses, TIMES, model)
    assert failure.value.cause is Cause.NO_START
    trace, ideal = moved(name, m, courses, TIMES, "contact", start="centred"), moved(name, m, courses)
    torque = ideal.signals["drive_torque"]
    close(trace.signals["drive_torque"], torque, 0.02 * np.abs(torque).max())


@pytest.mark.long_rows("pybullet-driven", "mujoco-driven", "exudyn-driven")
@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("name", [name for name in ENGINES if name != "dart"])  # whose run is implausible there
def test_a_third_bar_leaves_the_torque_of_a_crank_as_the_energy_says(name: str, motion: Motion) -> None:
    """The bars go round in circles alike: coupler and third bar without turning, at a constant speed without power."""
    m, theta = third_bar().with_clearances({}), np.radians([30.0, 45.0, 60.0])
    trace = engine(name).simulate(request_of(m, "ideal", motion, theta))
    slope = []
    for angle in theta:
        near = request_of(m, "ideal", "static", angle + 1e-3 * np.array([-2.0, -1.0, 1.0, 2.0]))
        held = resting(m, engine(name).simulate(near))
        slope.append((held[0] - 8 * held[1] + 8 * held[2] - held[3]) / 12e-3)
    close(trace.signals["drive_torque"], np.array(slope), 1e-5 * np.abs(slope).max())


# ---------------------------------------------------------------- springs between points


def on_springs(m: Mechanism) -> Mechanism:
    """The paper's four-bar with a spring between two moving bodies, and one on the ground."""
    springs = (
        Spring(bodies=("crank", "follower"), points=("A", "E"), stiffness=300.0, length=0.2, damping=30.0),
        Spring(bodies=("ground", "coupler"), points=("E", "com"), stiffness=60.0, length=0.1, damping=40.0),
    )
    return m.replace(springs=springs)


@pytest.mark.long_rows("dart-driven", "pybullet-driven")
@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("name", ENGINES)
def test_springs_pull_a_cranks_linkage_as_the_referee_says(name: str, motion: Motion) -> None:
    m, theta = on_springs(load("paper").with_clearances({})), np.radians([30.0, 40.0, 50.0])
    trace, judge = engine(name).simulate(request_of(m, "ideal", motion, theta)), Maximal(m, ("D",))
    speed = 0.0 if motion == "static" else float(m.speed or 0.0)
    q = judge.home({"D": m.assembly["crank"]})
    posed = [judge.driven_at(q, {"D": (float(angle), speed, 0.0)}) for angle in theta]
    lagging = name in ("pybullet", "dart") and motion == "driven"  # a leapfrog's dampers do, by half a step
    late = 5e-5 if lagging else 2e-6
    agrees(m, trace, judge, posed, within=late, motors=late, rates=late)


SPRUNG: list[tuple[str, JointModel, Motion]] = [
    (name, model, motion) for motion in MOTIONS for name, model in declared_runs(motion, LOOSE, "point_spring")
]
FEW: list[tuple[str, JointModel, Motion]] = [
    ("mujoco", "contact", "static"), ("mujoco", "massless-link", "driven"), ("exudyn", "contact", "static"),
    ("exudyn", "spring-damper", "static"), ("exudyn", "massless-link", "static"), ("pybullet", "contact", "static"),
]  # fmt: skip


@pytest.mark.long_rows("mujoco-contact-static")
@pytest.mark.parametrize(("name", "model", "motion"), slow_but(FEW, SPRUNG))
def test_springs_pull_loose_linkages_as_tight_ones(name: str, model: JointModel, motion: Motion) -> None:
    m, theta = on_springs(load("paper")), np.radians([30.0, 32.0, 34.0])
    rods = (name, model) == ("exudyn", "massless-link")  # which give, by more than 1e-6 m allows
    torque, gap = {}, 1e-5 if rods else 1e-6
    for which, asked, gaps, joint_model in (
        ("tight", m, {}, "ideal"), ("loose", m, {"B": gap}, model), ("bare", m.replace(springs=()), {}, "ideal"),
    ):  # fmt: skip
        found = engine(name).simulate(request_of(asked.with_clearances(gaps), joint_model, motion, theta))
        torque[which] = found.signals["drive_torque"]
    assert np.abs(torque["tight"] - torque["bare"]).min() > 1.0
    near = 1e-3 if name == "exudyn" and motion == "driven" else 4e-4 if rods else 2e-4  # it begins less steadily
    close(torque["loose"], torque["tight"], near * np.abs(torque["tight"]).max())


@pytest.mark.parametrize("name", slow_but(["mujoco", "exudyn"], ENGINES))
def test_a_pendulum_that_is_let_go_on_a_spring_swings_as_its_equation_says(name: str) -> None:
    m, times = pendulum_on_a_spring(), np.linspace(0.0, 0.3, 4)
    angle, swung = f"{m.bodies[0].name}_angle", swung_on_its_spring(m, times)
    released = engine(name).simulate(request_of(m, time=times)).signals[angle]
    close(released, swung, {"mujoco": 1e-7, "exudyn": 1e-6}.get(name, 2e-5))  # a leapfrog's is of first order
    close(moved(name, m, {}, times).signals[angle], swung, 1e-6)


# ---------------------------------------------------------------- what is refused


@pytest.mark.parametrize("name", ENGINES)
def test_what_cannot_be_followed_is_refused(name: str) -> None:
    m = load("3-rrr")
    courses = waved(m)
    knots, at = courses["A1"]
    with pytest.raises(AssemblyError, match=r"A1 = .*(cannot be reached|change point)|change point at A1"):
        moved(name, m, {**courses, "A1": (knots, at + 6 * knots)}, LONG)
    with pytest.raises(Unsupported, match="give each drive its course"):
        moved(name, m, {"A1": courses["A1"]})
    crank = load("crank-rocker")
    soft = crank.replace(drives=(crank.drives[0].model_copy(update={"stiffness": 50.0}),))
    with pytest.raises(Unsupported, match=r"stiffness|rigidly"):
        moved(name, soft, waved(soft))

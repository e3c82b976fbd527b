"""Every check that a run is held to, with a run that fails it; and good runs, which keep well clear of them all."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from analytic.kinematics.schedule import Schedule
from analytic.mechanism import Mechanism
from analytic.mechanism.file import load, shipped_cases
from asked import job_of, request_of
from compare.baseline.runs import setups
from compare.crosscheck import crosscheck_job
from compare.judge.reruns import too_soft
from compare.judge.tolerances import load_tolerances
from linkages import inverted_slider, jansen_leg
from marks import slow
from sim_models.common.free_share import free_share
from sim_models.common.health import CHECK_LIMITS, Implausible, check, misses
from sim_models.engine import ENGINES, Request, SimulationError, Trace, engine

TURN = np.radians(np.arange(10.0, 360.0, 25.0))
KEPT = 0.5  # of what a check allows: good runs leave at least the other half


def scaled(m: Mechanism, by: float, **drive: float) -> Mechanism:
    """The same linkage of another size, of the same material, in the drawing's proportions."""

    def sized(point: tuple[float, float]) -> tuple[float, float]:
        return point[0] * by, point[1] * by

    ground = m.ground.model_copy(update={"points": {name: sized(p) for name, p in m.ground.points.items()}})
    bodies = tuple(
        b.model_copy(
            update={
                "points": {name: sized(p) for name, p in b.points.items()},
                "mass": b.mass * by**3,
                "section": sized(b.section),
            }
        )
        for b in m.bodies
    )
    assert all(b.com is None and b.inertia is None for b in m.bodies)
    return m.replace(ground=ground, bodies=bodies, drive=m.drive.model_dump(exclude_unset=True) | drive)


def shares(request: Request, trace: Trace) -> dict[str, float]:
    """The largest share of each check's scale that a run misses."""
    found: dict[str, float] = {}
    for miss in misses(request, trace):
        found[miss.check] = max(found.get(miss.check, 0.0), miss.share)
    return found


def over(request: Request, trace: Trace, kept: float = 1.0) -> dict[str, float]:
    """Those of them that are more than this part of what the check allows."""
    return {
        name: share
        for name, share in shares(request, trace).items()
        if not share <= kept * CHECK_LIMITS[name].of(trace)
    }


# ------------------------------------------------------------------ good runs


ALIKE = ("crank-rocker", "five-bar", "3-rrr")  # in other engines than the first another of their kind is enough
CASES = [row for row in product(ENGINES, shipped_cases()) if row[0] == ENGINES[0] or row[1] not in ALIKE]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "case"), CASES)
def test_shipped_cases_keep_well_clear_of_every_limit(name: str, case: str) -> None:
    chosen = engine(name)
    for setup in setups(load(case)):
        request = setup.request
        if (request.joint_model, request.motion) in chosen.capabilities.runs and not setup.impacting:
            assert not over(request, chosen.simulate(request), KEPT), setup.name


@pytest.mark.slow
@pytest.mark.parametrize("name", ["mujoco", "exudyn", "dart"])
def test_pins_that_fly_and_hit_keep_clear_of_them_too(name: str) -> None:
    chosen = engine(name)
    for setup in setups(load("crank-rocker")):
        if setup.impacting and (setup.request.joint_model, "driven") in chosen.capabilities.runs:
            m = setup.request.mechanism
            request = replace(setup.request, schedule=Schedule.at_angles(m, setup.request.schedule.crank_angle[:720]))
            assert not over(request, chosen.simulate(request), KEPT), setup.name


# ------------------------------------------------------------------ runs that are wrong


def test_a_run_of_heavier_inertia_than_the_linkage_has_is_found() -> None:
    """As MuJoCo's own was, silently: at 1:20 the crank-rocker's inertias are 3e-12 kg.m2 and more, and it computed with
    1e-10.
    """
    small = scaled(load("crank-rocker").with_clearances({}), 0.05, speed=60.0)
    assert min(b.moment_of_inertia for b in small.bodies) < 5e-12
    raised = small.replace(
        bodies=tuple(b.model_copy(update={"inertia": max(b.moment_of_inertia, 1e-10)}) for b in small.bodies)
    )
    trace = engine("mujoco").simulate(request_of(raised, "ideal", "driven", TURN))
    request = request_of(small, "ideal", "driven", TURN)
    assert set(over(request, trace)) == {"moment", "power"}
    assert shares(request, trace)["moment"] > 0.1
    with pytest.raises(
        Implausible, match=r"crank-rocker.*body '\w+' does not make up its moment of inertia.*use another simulator"
    ):
        check(request, trace)


@pytest.mark.slow
@pytest.mark.pybullet
def test_bullet_in_a_micrograms_linkage_is_found() -> None:
    """At 1:1000, in SI units, it answers 3e11 N where 4e-11 N are right."""
    from sim_models.pybullet.run import BulletRun

    request = request_of(scaled(load("crank-rocker").with_clearances({}), 1e-3, speed=60.0), "ideal", "driven", TURN)
    trace = BulletRun(request).trace()
    assert max(np.abs(values).max() for name, values in trace.signals.items() if name.startswith("reaction")) > 1e3
    with pytest.raises(Implausible):
        check(request, trace)


def test_mujocos_solver_is_not_content_with_little_because_of_the_motors_armature() -> None:
    """It stopped 0.6 % short of the force of a light contact: its tolerance is measured by the inertia of model and
    motor.
    """
    trace = engine("mujoco").simulate(REQUESTS["loose"])
    assert 0.05 < np.hypot(trace.signals["reaction_B_x"], trace.signals["reaction_B_y"])[1] < 0.5
    assert shares(REQUESTS["loose"], trace)["moment"] < 1e-6


# ------------------------------------------------------------------ one falsehood each

Falsified = Callable[[Trace], Trace]


def signal(name: str, change: Callable[[np.ndarray], np.ndarray]) -> Falsified:
    return lambda trace: replace(trace, signals={**trace.signals, name: change(trace.signals[name])})


def turned(joint: str, degrees: float) -> Falsified:
    def falsify(trace: Trace) -> Trace:
        x, y = (f"reaction_{joint}_{axis}" for axis in "xy")
        force = (trace.signals[x] + 1j * trace.signals[y]) * np.exp(1j * np.radians(degrees))
        return replace(trace, signals={**trace.signals, x: force.real, y: force.imag})

    return falsify


def rate(body: str, **factor: float) -> Falsified:
    def falsify(trace: Trace) -> Trace:
        changed = {name: by * getattr(trace.rates[body], name) for name, by in factor.items()}
        return replace(trace, rates={**trace.rates, body: replace(trace.rates[body], **changed)})

    return falsify


def uneven(trace: Trace) -> Trace:
    crank = trace.rates["crank"]
    turning = crank.angular_acceleration + 2e-5 * trace.signals["crank_angular_velocity"] ** 2
    return replace(trace, rates={**trace.rates, "crank": replace(crank, angular_acceleration=turning)})


def path(stretch: float) -> Falsified:
    return lambda trace: replace(trace, journal={name: stretch * seen for name, seen in trace.journal.items()})


ROCKER = load("crank-rocker").with_clearances({})
PRESSED = load("paper").with_clearances({"B": 1e-3})
LOOSE = load("paper").replace(loads=()).with_clearances({"B": 1e-3})
DEGREES = np.radians([40.0, 60.0, 80.0])
REQUESTS = {
    "rocker": request_of(ROCKER, "ideal", "driven", TURN),
    "rocker at rest": request_of(ROCKER.replace(gravity=(0.0, -9.81)), "ideal", "static", TURN),
    "slider": request_of(inverted_slider(), "ideal", "driven", TURN),
    "soft": request_of(PRESSED.with_clearances({}).with_joint("B", radial_stiffness=1e5), "ideal", "driven", DEGREES),
    "rod": request_of(PRESSED, "massless-link", "driven", DEGREES),
    "contact": request_of(PRESSED, "contact", "driven", DEGREES),
    "loose": request_of(LOOSE, "contact", "driven", DEGREES, start="centred"),
}
FALSIFIED = [
    ("pins", "rocker", signal("coupler_x", lambda x: x + 2e-5 * 0.12)),
    ("pins", "slider", signal("block_y", lambda y: y + 2e-5 * 0.3)),
    ("closure", "rocker", signal("follower_angle", lambda a: a + 7e-6)),
    ("closure", "rocker at rest", signal("follower_angle", lambda a: a + 2e-6)),
    ("turned", "slider", signal("block_angle", lambda a: a + 2e-6)),
    ("signal", "contact", signal("clearance_B_x", lambda x: x + 2e-6 * 1e-3)),
    ("crank", "rocker", signal("crank_angle", lambda a: a + 2e-6)),
    ("speed", "rocker", signal("crank_angular_velocity", lambda w: w * (1 + 1.2e-5))),
    ("evenness", "rocker", uneven),
    ("parting", "rocker", rate("coupler", velocity=1 + 1e-4)),
    ("parting", "slider", rate("block", velocity=1 + 1e-4)),
    ("jolt", "rocker", rate("coupler", acceleration=1 + 1e-2)),
    ("jolt", "slider", rate("block", acceleration=1 + 1e-2)),
    ("rod", "rod", path(1.02)),
    ("bearing", "contact", path(30.0)),
    ("line", "contact", turned("B", 0.1)),
    ("give", "soft", turned("B", 0.1)),
    ("signal", "soft", signal("clearance_B_x", lambda x: x * (1 + 1e-5))),
    ("loose", "loose", signal("reaction_B_x", lambda x: x + 1e-2)),
    ("force", "rocker", turned("B", 0.1)),
    ("force", "rocker", rate("follower", acceleration=1 + 1e-2)),
    ("force", "rocker at rest", turned("B", 0.01)),
    ("force", "slider", signal("reaction_S_x", lambda f: 1.002 * f)),
    ("moment", "rocker", signal("drive_torque", lambda t: 1.002 * t)),
    ("moment", "rocker", rate("coupler", angular_acceleration=1 + 2e-2)),
    ("moment", "slider", signal("reaction_S_moment", lambda t: 1.02 * t)),
    ("power", "rocker", signal("drive_torque", lambda t: 1.002 * t)),
    ("power", "slider", rate("arm", velocity=1 + 1e-2)),
]  # fmt: skip


@pytest.fixture(scope="module")
def runs() -> dict[str, Trace]:
    return {name: engine("mujoco").simulate(request) for name, request in REQUESTS.items()}


@pytest.mark.parametrize(
    ("name", "of", "falsify"), FALSIFIED, ids=[f"{name}-{of}-{k}" for k, (name, of, _) in enumerate(FALSIFIED)]
)
def test_a_small_falsehood_fails_its_check(name: str, of: str, falsify: Falsified, runs: dict[str, Trace]) -> None:
    request, trace = REQUESTS[of], runs[of]
    check(request, trace)
    false = falsify(trace)
    assert name in over(request, false)
    with pytest.raises(Implausible):
        check(request, false)


def test_no_check_is_without_a_run_that_fails_it() -> None:
    assert {name for name, _, _ in FALSIFIED} == set(CHECK_LIMITS)


@pytest.mark.parametrize("body", [b.name for b in ROCKER.bodies if b.name != "crank"])
def test_a_run_of_one_per_cent_less_mass_is_found(body: str, runs: dict[str, Trace]) -> None:
    heavier = ROCKER.with_body(body, mass=1.01 * ROCKER.moving[body].mass)
    assert "force" in over(replace(REQUESTS["rocker"], mechanism=heavier), runs["rocker"])


def test_what_failed_is_said_where_how_far_and_what_was_allowed(runs: dict[str, Trace]) -> None:
    with pytest.raises(Implausible) as said:
        check(REQUESTS["rocker"], turned("B", 0.1)(runs["rocker"]))
    for words in (
        "mujoco ideal driven (crank-rocker)",
        "body 'coupler'",
        "mass times its acceleration",
        "deg",
        "N are missed",
        "in order",
        "use a",
    ):
        assert words in str(said.value)


def test_a_trace_without_rates_is_held_to_its_positions(runs: dict[str, Trace]) -> None:
    recorded = replace(runs["rocker"], rates={})
    assert set(shares(REQUESTS["rocker"], recorded)) == {"pins", "closure", "crank", "speed"}
    check(REQUESTS["rocker"], recorded)
    with pytest.raises(Implausible, match="come apart"):
        check(REQUESTS["rocker"], signal("coupler_y", lambda y: y + 1e-5)(recorded))
    few = {name: values for name, values in recorded.signals.items() if not name.startswith("coupler")}
    check(REQUESTS["rocker"], replace(recorded, signals=few))  # says nothing of where the coupler is


# ------------------------------------------------------------------ what rigid rows give, contact that is lost, contact
# that is soft


@pytest.mark.mujoco
@pytest.mark.parametrize("push", [0.0, *slow(20.0)])
def test_mujoco_takes_the_steps_that_jansens_leg_asks_for(push: float) -> None:
    """Its foot was 2e-5 rad off with steps of 0.5 ms and a push of 20 N, and the model was blamed for it."""
    theta = np.radians(np.arange(0.0, 360.0, 10.0))
    result = crosscheck_job(
        job_of(jansen_leg(push), ("mujoco",), load_tolerances(), "driven", theta, joint_model="ideal")
    )
    assert result.verdict == "agrees", result.failures
    assert result.runs[0].settings["step"] < 5e-4
    off = [
        abs(d.max)
        for d in result.runs[0].discrepancies
        if d.signal.endswith("_angle") and not d.signal.startswith("reaction")
    ]
    assert max(off) < 3e-6


def test_mujoco_says_how_far_a_body_is_off_where_a_step_is_too_long() -> None:
    request = request_of(jansen_leg(1e4), "ideal", "driven", np.radians(np.arange(180.0, 200.0, 5.0)), step=1e-3)
    with pytest.raises(SimulationError, match=r"came apart by|is [\d.e-]+ rad off, 2e-06 rad is in order"):
        engine("mujoco").simulate(request)


def test_contact_is_lost_where_the_pin_is_off_the_wall() -> None:
    gaps = 1e-3 * np.array([1.02, 1.0, 0.9995, 0.9, 0.2j, -0.99, -1.0])
    assert free_share(gaps, 1e-3) == pytest.approx(3 / 7)
    time = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 9.0])
    assert free_share(gaps, 1e-3, time) == pytest.approx((0.5 + 1.0 + 1.0 + 2.0) / 9.0)
    assert free_share(gaps[:0], 1e-3) == 0.0


@pytest.mark.slow
@pytest.mark.mujoco
def test_a_pin_seen_far_beyond_its_rim_is_warned_of_whatever_its_settings_say() -> None:
    """A hard contact has no stiffness in its settings: the path that was seen says how deep its pin went."""
    m = load("slider-crank").with_clearances({"B": 5e-4})
    theta = np.radians(np.arange(0.0, 360.0, 10.0))
    for stiffness in (
        1e7,
        None,
    ):  # N/m: at 5000 rpm the first lets the pin 0.8 mm into the wall, and what suits the linkage does not
        soft = m if stiffness is None else m.with_joint("B", contact_stiffness=stiffness)
        result = crosscheck_job(job_of(soft, ("mujoco",), load_tolerances(), theta=theta, joint_model="contact"))
        for settings in (result.runs[0].settings, {}):
            warned = [
                w
                for w in too_soft(result.runs[0].model_copy(update={"settings": settings}))
                if "beyond its rim" in w and "joint B" in w
            ]
            assert len(warned) == (stiffness is not None)

"""What contact did, counted in motions that are known beforehand; averages, their intervals, and when they will do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from analytic.mechanism import GROUND
from analytic.mechanism.file import load
from compare.crosscheck import crosscheck_job, job_of
from compare.judge.contact import contact_in, more_revolutions, revolutions
from compare.judge.contact_motion import WatchedRun, integral
from compare.judge.statistics import statistic
from compare.questions.crosscheck import CrosscheckQuestion
from sim_models.engine import Request, SimulationError, Trace, Watched

CLEARANCE, STIFFNESS, SPEED = 1e-3, 1e6, 20.0
BOUNCES = 5  # of the pin in a turn of the crank
ROCKER = load("crank-rocker").with_clearances({"B": CLEARANCE})


def prescribed(turns: float, gap, push, samples: int = 40_001) -> Watched:
    """A crank that turns evenly, a follower at rest, and a coupler that is carried so that B has this gap (m) over the
    phase (rad), and is pushed along it by so much (N).
    """
    m = ROCKER.replace(drive={"joint": "D", "speed": SPEED}) if ROCKER.drive.joint == "D" else ROCKER
    period = 2 * np.pi / SPEED
    time = np.linspace(0.0, turns * period, samples)
    phase = SPEED * time
    crank, coupler, follower = (m.moving[name] for name in ("crank", "coupler", "follower"))
    where = gap(phase)
    pivot = next(j for j in m.joints if set(j.bodies) == {GROUND, "follower"}).name
    rocker = m.ground.point(pivot) - follower.point(pivot)  # the follower's origin, its angle being 0
    pin = rocker + follower.point("B")
    flip = 1.0 if m.joint("B").bodies[0] == "coupler" else -1.0
    com = pin + flip * where - coupler.point("B") + coupler.centre
    velocity = np.gradient(com, time)
    force = push(phase) * where / np.abs(where)
    still = np.zeros(time.size)
    hinge = m.drive_joint.name
    turned = (crank.centre - crank.point(hinge)) * np.exp(1j * phase)
    return Watched(
        time=time,
        place={"crank": m.ground.point(hinge) + turned, "coupler": com, "follower": still + rocker + follower.centre},
        velocity={"crank": 1j * SPEED * turned, "coupler": velocity, "follower": still + 0j},
        angle={"crank": phase, "coupler": still, "follower": still},
        angular_velocity={"crank": still + SPEED, "coupler": still, "follower": still},
        force={"B": force},
        torque=still,
    )


def told(watched: Watched, settings: dict | None = None, m=ROCKER):
    trace = Trace(
        simulator="prescribed", version="1", joint_model="contact", motion="driven", crank_angle=np.zeros(1),
        time=np.zeros(1), signals={}, clearance={"B": CLEARANCE}, settings=settings or {}, watched=watched,
    )  # fmt: skip
    return contact_in(trace, m, {"B": 40.0})


def bouncing(phase: np.ndarray) -> np.ndarray:
    """A pin that goes from wall to wall along x, half a clearance deep in them at most (a spring's own motion)."""
    return 1.1 * CLEARANCE * np.sin(BOUNCES / 2 * phase) + 1e-9j


def springs(phase: np.ndarray) -> np.ndarray:
    return STIFFNESS * np.maximum(np.abs(bouncing(phase)) - CLEARANCE, 0.0)


def test_a_pin_that_goes_from_wall_to_wall_is_counted_as_it_does() -> None:
    found = told(prescribed(12.0, bouncing, springs, 60_001))
    joint = found.joints["B"]
    edge = np.arcsin(1 / 1.1)
    free = np.arcsin((1 - 1e-3) / 1.1) / (np.pi / 2)
    value = {name: one.value for name, one in joint.statistics.items()}
    assert value["free_share"] == pytest.approx(free, abs=1e-3)
    assert value["impacts"] == pytest.approx(BOUNCES, abs=0.26)  # of the first quarter the pin is not yet off its wall
    speed = 1.1 * CLEARANCE * BOUNCES / 2 * SPEED * np.cos(edge)
    assert value["approach_speed"] == pytest.approx(speed, rel=1e-3)
    assert value["peak_force"] == pytest.approx(STIFFNESS * 0.1 * CLEARANCE, rel=1e-3)
    assert value["penetration"] == pytest.approx(0.1 * CLEARANCE, rel=1e-3)
    assert joint.peak_ratio == pytest.approx(STIFFNESS * 0.1 * CLEARANCE / 40.0, rel=1e-3)
    # impulse of a blow: integral of K (a sin - c) over the time beyond the wall
    rate = BOUNCES / 2 * SPEED
    impulse = STIFFNESS * (2 * 1.1 * CLEARANCE * np.cos(edge) - CLEARANCE * (np.pi - 2 * edge)) / rate
    np.testing.assert_allclose(joint.impacts.impulse[:-1], impulse, rtol=5e-3)
    assert abs(value["restitution_loss"]) < 1e-3 * STIFFNESS * (0.1 * CLEARANCE) ** 2  # a spring takes nothing
    assert found.period == 2  # five bounces of half a wave
    assert found.converged


def test_a_pressed_pin_that_slides_is_never_free_and_wears() -> None:
    push = 30.0

    def around(phase: np.ndarray) -> np.ndarray:
        return (CLEARANCE + push / STIFFNESS) * np.exp(1j * phase)

    found = told(prescribed(3.0, around, lambda phase: push + 0 * phase))
    value = {name: one.value for name, one in found.joints["B"].statistics.items()}
    assert value["free_share"] == 0.0
    assert value["impacts"] == 0
    assert found.joints["B"].first_impact is None
    assert value["rms_force"] == pytest.approx(push, rel=1e-6)
    # the coupler does not turn: its material slides around the pin as fast as the gap turns
    assert value["wear"] == pytest.approx(push * 2 * np.pi * (CLEARANCE + push / STIFFNESS), rel=1e-3)
    assert "no pin leaves its wall" in found.words
    assert found.converged


def test_a_spring_that_is_pressed_harder_and_harder_takes_nothing() -> None:
    def deeper(phase: np.ndarray) -> np.ndarray:
        return 1e-5 * phase

    watched = prescribed(
        0.4,
        lambda phase: (CLEARANCE + deeper(phase)) * np.exp(1j * phase),
        lambda phase: STIFFNESS * deeper(phase),
    )
    stiff = ROCKER.with_joint("B", contact_stiffness=STIFFNESS)
    kept = STIFFNESS * (1e-5 * 0.8 * np.pi) ** 2 / 2
    loss = {
        yields: told(watched, {"contact_stiffness": STIFFNESS} if yields else {}, stiff)
        .joints["B"]
        .statistics["restitution_loss"]
        .value
        for yields in (True, False)
    }
    assert abs(loss[True]) < 1e-3 * kept
    assert loss[False] == pytest.approx(kept, rel=1e-3)


def test_friction_takes_what_it_rubs_times_the_way() -> None:
    push, rub = 30.0, 3.0
    watched = prescribed(2.0, lambda phase: CLEARANCE * np.exp(1j * phase), lambda phase: push + 0 * phase)
    run = WatchedRun(ROCKER, watched)
    (pin,) = run.course(ROCKER.joint("B")).contacts
    rubbing = watched.force["B"] - np.sign(pin.slip) * rub * 1j * watched.force["B"] / push
    found = told(replace(watched, force={"B": rubbing}))
    assert found.joints["B"].statistics["friction_loss"].value == pytest.approx(rub * 2 * np.pi * CLEARANCE, rel=1e-3)
    assert found.joints["B"].statistics["rms_force"].value == pytest.approx(np.hypot(push, rub), rel=1e-4)


def test_a_damper_in_the_wall_takes_energy_and_the_balance_says_so() -> None:
    def damped(phase: np.ndarray) -> np.ndarray:
        rate = (
            1.1 * CLEARANCE * BOUNCES / 2 * SPEED * np.cos(BOUNCES / 2 * phase) * np.sign(np.sin(BOUNCES / 2 * phase))
        )
        return np.maximum(springs(phase) + 20.0 * rate * (springs(phase) > 0), 0.0)

    watched = prescribed(4.0, bouncing, damped)
    found = told(watched)
    (pin,) = WatchedRun(ROCKER, watched).course(ROCKER.joint("B")).contacts
    total = integral(pin.push * pin.rate, watched.time)[-1]
    loss = found.joints["B"].statistics["restitution_loss"]
    assert loss.by_revolution.sum() == pytest.approx(total, rel=1e-9)
    assert loss.value > 0
    assert found.energy is not None
    assert found.energy.lost_in_contact == pytest.approx(total, rel=1e-9)
    # nothing drives this coupler but a hand that the balance does not know: it misses just that
    assert found.energy.missing == pytest.approx(found.energy.put_in - total - found.energy.kept, rel=1e-9)


def test_a_hard_wall_is_where_the_engine_begins_to_push() -> None:
    margin = 0.05 * CLEARANCE

    def around(phase: np.ndarray) -> np.ndarray:
        return (CLEARANCE - 0.5 * margin) * np.exp(1j * phase)

    watched = prescribed(2.0, around, lambda phase: 10.0 + 0 * phase)
    assert told(watched).joints["B"].statistics["free_share"].value == 1.0
    found = told(watched, {"contact_margin": {"B": margin}})
    assert found.joints["B"].statistics["free_share"].value == 0.0


def test_revolutions_begin_and_end_where_the_crank_comes_round() -> None:
    turned = np.linspace(0.0, 2.5 * 2 * np.pi, 1001)
    marks = revolutions(turned)
    assert marks.size == 3
    np.testing.assert_allclose(turned[marks], [0.0, 2 * np.pi, 4 * np.pi], atol=0.01)
    assert revolutions(np.linspace(0, 1.0, 11)).tolist() == [0, 10]


def test_intervals_hold_the_mean_as_often_as_they_say() -> None:
    rng = np.random.default_rng(5)
    held = []
    for _ in range(300):
        found = statistic(rng.exponential(2.0, 24))
        held.append(found.low <= 2.0 <= found.high)
    assert 0.90 <= np.mean(held) <= 0.99
    assert statistic(np.array([1.0, 2.0])).low is None
    same = statistic(np.full(9, 3.0))
    assert (same.low, same.value, same.high) == (3.0, 3.0, 3.0)


def test_a_noisy_average_asks_for_as_many_revolutions_as_its_interval_needs() -> None:
    rng = np.random.default_rng(7)
    heights = rng.uniform(1.0, 1.6, 200)

    def wild(phase: np.ndarray) -> np.ndarray:
        return heights[(phase * BOUNCES / (2 * np.pi)).astype(int)] * springs(phase)

    short, longer = (told(prescribed(n, bouncing, wild, 4_000 * n)) for n in (3, 30))
    assert not short.converged
    assert more_revolutions(short) >= 6
    half = [found.joints["B"].statistics["peak_force"].half_width for found in (short, longer)]
    assert half[1] < half[0] / 2


@pytest.mark.mujoco
def test_a_longer_run_that_fails_leaves_the_shorter_one_which_says_so() -> None:
    from sim_models.mujoco.engine import MujocoEngine

    class Tires(MujocoEngine):
        def simulate(self, request: Request) -> Trace:
            if request.beyond > 2 * np.pi:
                raise SimulationError("it is tired")
            return super().simulate(request)

    fast = ROCKER.replace(drive={"joint": ROCKER.drive_joint.name, "speed": 60.0})
    job = job_of(CrosscheckQuestion(fast, joint_model="contact", angles=np.radians(np.arange(0.0, 360.0, 30.0))))
    found = crosscheck_job(job, resolve=lambda name: Tires())
    (run,) = found.runs
    assert not found.failures
    assert run.contact.revolutions == pytest.approx(1.0)
    assert "1 revolution is too few for averages; a longer run failed (it is tired)" in run.contact.words

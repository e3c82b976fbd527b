"""Released runs: the freedom that is integrated, runs in pieces, and the turn of an encoder."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from time import process_time

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from analytic.beyond_paper.freedom import TABLE_POINTS, Freedom, swing
from analytic.beyond_paper.freedom import swings as swings_of
from analytic.kinematics.assembly import Assembly
from analytic.mechanism import Mechanism
from analytic.mechanism.file import dumps, load
from analytic.mechanism.signals import wrapped
from compare.diagnose.data.measured import load_measured
from compare.diagnose.data.recording import Channel, Measured, MeasuredRun
from compare.diagnose.fit import Space
from compare.diagnose.foretold import ENDS
from compare.diagnose.predict import StartOfRun, Term, pieces
from compare.diagnose.prepare import on_one_turn
from compare.diagnose.problem import Options, Problem
from compare.diagnose.released import in_pieces
from diagnosis_rigs import diagnosed
from measured_files import RunTable, write_measured
from tests.evidence.scoreboard.bench.pendulum import Pendulum
from tests.evidence.scoreboard.sizes import Planted

PENDULUM = load("pendulum")
MASS, ARM = PENDULUM.bodies[0].mass, 0.15
INERTIA = PENDULUM.bodies[0].moment_of_inertia + MASS * ARM**2
WEIGHT = MASS * 9.81 * ARM  # N.m
SPRING, REST, DAMPER = 40 * WEIGHT, 0.4, 0.02
NONE = (0.0, 0.0)  # no gravity
TIME = np.arange(240) / 120.0
STARTS = ((0.9, 0.0), (-0.5, 1.0))
NOISE = {"pendulum_angle": 2e-4, "pendulum_angular_velocity": 2e-2}


def swung(stiffness: float, rest: float, damper: float, start: Sequence[float], time: np.ndarray) -> np.ndarray:
    """Angle and rate (2, N) by scipy, of J q'' = - m g a cos q - k (q - rest) - d q'."""

    def slope(_: float, state: np.ndarray) -> tuple[float, float]:
        q, w = state
        return w, (-WEIGHT * math.cos(q) - stiffness * (q - rest) - damper * w) / INERTIA

    found = solve_ivp(slope, (time[0], time[-1]), start, "DOP853", time, rtol=1e-11, atol=1e-11)
    return np.asarray(found.y)


def let_go(folder: Path, seed: int, **fields: object) -> MeasuredRun:
    """A swing that begins at -0.2 rad and 3 rad/s, of which an encoder alone tells, with noise of 1 mrad."""
    angle, _ = swung(0.0, 0.0, DAMPER, (-0.2, 3.0), TIME)
    read = {"pendulum_angle [rad]": angle + 1e-3 * np.random.default_rng(seed).standard_normal(TIME.size)}
    runs = [RunTable("swing", TIME, read, {"drive": "free", **fields})]
    return load_measured(write_measured(folder, dumps(PENDULUM), runs)).runs[0]


def test_how_far_off_a_rate_may_be_that_only_an_angle_tells_is_known(tmp_path: Path) -> None:
    """Of twenty draws of noise, in the standard deviation that predictions give to it."""
    runs, rate = [let_go(tmp_path / str(seed), seed) for seed in range(20)], "pendulum_angular_velocity"
    off = [(run.start[rate] - 3.0) / (ENDS * run.unsure[rate]) for run in runs]
    assert 0.4 < np.sqrt(np.mean(np.square(off))) < 1.6
    assert np.abs(off).max() < 3.5


def test_a_rate_that_is_given_is_taken_as_it_is(tmp_path: Path) -> None:
    run = let_go(tmp_path, 1, start={"pendulum_angular_velocity": 3.0})
    assert run.start["pendulum_angular_velocity"] == 3.0
    assert not run.unsure


# ---------------------------------------------------------------- the freedom


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stiffness", "start"),
    [
        (0.05, (-0.5, 15.0)),  # over zero and on over a whole turn, where the spring is wound up
        (0.05, (0.5, -15.0)),  # the same backward
        (0.05, (2 * math.pi + 0.3, -15.0)),
        (5.0, (1.5, 0.0)),  # to and fro over zero
    ],
)
def test_a_spring_winds_up_with_every_turn(stiffness: float, start: tuple[float, float]) -> None:
    sprung = PENDULUM.with_joint("O", stiffness=stiffness, rest_angle=REST, damping=1e-3)
    time = np.linspace(0.0, 1.5, 151)
    theta, omega, alpha = swing([Freedom.of(Assembly(sprung))], np.array([start]), time)
    q, w = swung(stiffness, REST, 1e-3, start, time)
    assert q.min() < 0 < q.max() or np.ptp(q) > 2 * math.pi
    np.testing.assert_allclose(theta[0], q, atol=2e-6)
    np.testing.assert_allclose(omega[0], w, atol=1e-4)
    expected = (-WEIGHT * np.cos(q) - stiffness * (q - REST) - 1e-3 * w) / INERTIA
    np.testing.assert_allclose(alpha[0], expected, atol=1e-3 * np.abs(expected).max())


def test_the_swings_of_the_springs_do_reach_another_turn() -> None:
    time = np.linspace(0.0, 1.5, 151)
    assert np.ptp(swung(0.05, REST, 1e-3, (-0.5, 15.0), time)[0]) > 2 * math.pi


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("inertia", [0.0, -1e-3])
def test_a_linkage_without_positive_inertia_has_no_motion(inertia: float) -> None:
    table = np.zeros((9, TABLE_POINTS))
    table[0], table[4] = inertia, 1.0
    freedom = Freedom(table)
    assert np.isnan(freedom.acceleration(np.array([0.0, 1.0]), np.array([1.0, 0.0]))).all()
    theta, omega, _ = swing([freedom, Freedom.of(Assembly(PENDULUM))], np.array([[0.0, 1.0], [0.0, 1.0]]), TIME)
    assert np.isnan(theta[0, 1:]).all()
    assert np.isnan(omega[0, 1:]).all()
    assert np.isfinite(theta[1]).all(), "the others of the batch go on"


@pytest.mark.long_rows("20")
@pytest.mark.parametrize("samples", [20, 4001])  # many steps to a sample, and many samples to a step
def test_a_spring_and_dry_friction_swing_in_half_cosines_until_they_hold(samples: int) -> None:
    """Each half swing is about a place that friction shifts against it, and ends where the next begins: closed form."""
    stiffness, friction, time = 0.5, 0.03, np.linspace(0.0, 4.0, samples)
    rubs = PENDULUM.with_joint("O", stiffness=stiffness, rest_angle=0.0, friction_torque=friction).replace(gravity=NONE)
    (theta,), (omega,), (alpha,) = swing([Freedom.of(Assembly(rubs))], np.array([[1.0, 0.0]]), time)
    pace, shift = math.sqrt(stiffness / INERTIA), friction / stiffness
    angle, rate = np.empty((2, samples))
    place, begin = 1.0, 0.0
    while abs(place) > shift:
        about, here = math.copysign(shift, place), time >= begin
        angle[here] = about + (place - about) * np.cos(pace * (time[here] - begin))
        rate[here] = (about - place) * pace * np.sin(pace * (time[here] - begin))
        place, begin = 2 * about - place, begin + math.pi / pace
    assert begin < 3.9, "it comes to rest within the record"
    angle[time >= begin], rate[time >= begin] = place, 0.0
    np.testing.assert_allclose(theta, angle, atol=2e-10)
    np.testing.assert_allclose(omega, rate, atol=2e-9)
    assert (alpha[time > begin] == 0).all()


@pytest.mark.parametrize("start", [0.5, -0.5, 2 * math.pi + 0.5, -2 * math.pi + 0.5])
def test_a_stiffening_spring_pulls_back_to_its_rest_from_whichever_turn(start: float) -> None:
    """k s + c s^3 of the angle s from its rest, in which no turn of the crank is like the one before; by its energy."""
    stiffness, cubic, time = 0.05, 0.02, np.linspace(0.0, 2.0, 201)
    sprung = PENDULUM.with_joint("O", stiffness=stiffness, cubic=cubic, rest_angle=REST).replace(gravity=NONE)
    (q,), (w,), (a,) = swing([Freedom.of(Assembly(sprung))], np.array([[start, 0.0]]), time)
    s = q - REST
    np.testing.assert_allclose(INERTIA * a, -stiffness * s - cubic * s**3, atol=1e-9)
    energy = INERTIA * w**2 / 2 + stiffness * s**2 / 2 + cubic * s**4 / 4
    np.testing.assert_allclose(energy, energy[0], rtol=1e-8)
    assert s.min() < -0.9 * abs(start - REST)
    assert s.max() > 0.9 * abs(start - REST)


def test_a_push_that_grows_frees_a_crank_when_friction_can_hold_it_no_longer() -> None:
    """From then on it grows beyond friction along a line, and the angle with the cube of the time: in between samples
    that are half a second apart.
    """
    friction, growth, time = 0.05, 0.03, np.arange(0.0, 4.1, 0.5)
    rubs = PENDULUM.with_joint("O", friction_torque=friction).replace(gravity=NONE)
    for way in (1.0, -1.0):
        (moved,) = swings_of([Freedom.of(Assembly(rubs))], np.zeros((1, 2)), [time], [way * growth * time])
        late = np.maximum(time - friction / growth, 0.0)
        np.testing.assert_allclose(moved[0], way * growth * late**3 / (6 * INERTIA), rtol=1e-9, atol=1e-11)
        np.testing.assert_allclose(moved[2], way * growth * late / INERTIA, rtol=1e-9, atol=1e-11)


def test_a_crank_that_nearly_stops_on_top_goes_over_or_back_as_its_energy_says() -> None:
    """A step that begins and ends in one direction may have come to rest in between.  It is slowest just beyond the
    top, where its weight takes over from friction.
    """
    friction, time = 1e-3, np.linspace(0.0, 3.0, 4)
    slowest = math.pi / 2 + math.asin(friction / WEIGHT)
    lost = WEIGHT * (1 + math.sin(slowest)) + friction * (slowest + math.pi / 2)
    rubs = PENDULUM.with_joint("O", friction_torque=friction)
    for spare, over in ((1e-8, True), (-1e-8, False)):
        start = np.array([[-math.pi / 2, math.sqrt(2 * (lost + spare) / INERTIA)]])
        (theta,), *_ = swing([Freedom.of(Assembly(rubs))], start, time)
        assert bool(theta.max() > math.pi / 2 + 0.1) == over


@pytest.mark.long_rows("start0", "start1")
@pytest.mark.parametrize("start", [(0.0, 1e6), (0.0, 2e3), (1e-3, 0.0)])
def test_a_motion_that_runs_away_ends(start: tuple[float, float]) -> None:
    """Too fast to begin with, too far for a path, and faster and faster: within a second of the processor's time, where
    each step of it would be followed for minutes.
    """
    table = np.zeros((9, TABLE_POINTS))
    table[0] = 1.0
    table[2] = -20.0 if start[1] == 0 else 0.0
    table[4] = -1e-3
    spent = process_time()
    theta, *_ = swing([Freedom(table)], np.array([start]), np.linspace(0.0, 120.0, 500))
    assert process_time() - spent < 2.0
    assert np.isnan(theta[0, -1])
    assert np.isfinite(theta[0, 0])


# ---------------------------------------------------------------- released runs in pieces


def swings(turns: Sequence[int] = (0, 0)) -> Measured:
    """Two runs of a pendulum with a stiff spring and a damper, each recorded so many turns higher; neither is in the
    nominal model.
    """
    rng, runs = np.random.default_rng(1), []
    known = Measured(PENDULUM, (), {}, (), "").signals
    for k, (start, turn) in enumerate(zip(STARTS, turns, strict=True)):
        clean = dict(zip(NOISE, swung(SPRING, REST, DAMPER, start, TIME), strict=True))
        seen = {s: clean[s] + sigma * rng.standard_normal(TIME.size) for s, sigma in NOISE.items()}
        seen["pendulum_angle"] += 2 * math.pi * turn
        channels = {s: Channel(known[s], seen[s], sigma, True, known[s].unit) for s, sigma in NOISE.items()}
        first = {s: float(values[0]) for s, values in seen.items()}
        runs.append(MeasuredRun(f"swing-{k}", TIME, channels, "free", None, None, first, None, False, "swing.csv"))
    return Measured(PENDULUM, tuple(runs), {}, (), "rig")


def problem_of(measured: Measured, *only: str) -> Problem:
    return Problem.of(on_one_turn(measured), PENDULUM, Options("mujoco", only=only, others=False, workers=1))


def in_parts(problem: Problem) -> dict[Term, np.ndarray]:
    """The starts of the pieces that a diagnosis begins with."""
    return dict(in_pieces(problem.fitter, dict(zip(problem.base.terms, problem.base.x, strict=True))))


def test_pieces_that_start_on_a_motion_are_that_motion() -> None:
    """A pendulum with a spring and a damper, by SciPy, in one, four and thirty pieces."""
    real = PENDULUM.with_joint("O", stiffness=SPRING, rest_angle=REST, damping=DAMPER)
    model = Problem.of(swings(), real, Options("mujoco", others=False, workers=1)).model
    (run, _), (q, w) = model.measured.runs, swung(SPRING, REST, DAMPER, STARTS[0], TIME)
    for count in (1, 4, 30):
        begin = [piece.start for piece in pieces(TIME.size, count)]
        term = Term(StartOfRun(), run.name, float(count))
        values = term.effect.values(model.rig, run.name, np.column_stack([q[begin], w[begin]]).ravel(), term.variant)
        (found,) = model.released(run, [[(term, values)]])
        assert found is not None
        np.testing.assert_allclose(found["pendulum_angle"], q, atol=1e-6)
        np.testing.assert_allclose(found["pendulum_angular_velocity"], w, atol=1e-4)


def test_a_start_that_no_encoder_could_have_read_has_no_motion() -> None:
    """Its path would be walked degree by degree, a few hundred bytes each."""
    model = problem_of(swings()).model
    (run, _), found = model.measured.runs, []
    for rate in (3.0, 1500.0):
        values = StartOfRun().values(model.rig, run.name, np.array([0.0, rate]))
        found += model.released(run, [[(Term(StartOfRun(), run.name), values)]])
    assert found[0] is not None
    assert found[1] is None


def test_a_run_goes_in_pieces_that_the_nominal_mechanism_nearly_follows() -> None:
    """With a spring of forty times its weight a pendulum does otherwise at once; without, in one piece."""
    parted = in_parts(problem_of(swings(), "joint_spring"))
    assert all(term.variant > 8 for term in parted)
    time, runs = swings().runs[0].time, []
    for run, start in zip(swings().runs, STARTS, strict=True):
        clean = dict(zip(NOISE, swung(0.0, 0.0, 1e-6, start, time), strict=True))
        runs.append(replace(run, channels={s: replace(c, values=clean[s]) for s, c in run.channels.items()}))
    whole = in_parts(problem_of(replace(swings(), runs=tuple(runs)), "viscous_friction"))
    assert [(term.where, term.variant) for term in whole] == [("swing-0", 0.0), ("swing-1", 0.0)]


def test_starts_of_all_pieces_are_probed_at_once_as_one_by_one() -> None:
    fitter, starts = (problem := problem_of(swings(), "joint_spring")).fitter, in_parts(problem)
    space, point = Space(list(starts), problem.rig, fitter.bounds), np.concatenate(list(starts.values()))
    together = fitter._begun(space, point, space.scale)
    (here,) = fitter.residuals(space.terms, [space.parted(point)])
    assert here is not None
    for k in (0, 1, 2 * int(space.terms[0].variant) - 1, point.size - 2):
        (there,) = fitter.residuals(space.terms, [space.parted(point + space.scale * (np.arange(point.size) == k))])
        assert there is not None
        np.testing.assert_allclose(together[:, k], (there - here) / space.scale[k], rtol=1e-6, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("turns", [(0, 0), (0, 1), (1, 0), (-1, 1)])
def test_a_stiff_spring_and_a_damper_are_found_among_the_whole_vocabulary(turns: tuple[int, int]) -> None:
    """Whichever turn each run's encoder counts from; a larger moment of inertia with a stiffer spring and a stronger
    damper moves the same way but for gravity's part.
    """
    problem = problem_of(swings(turns))
    found = {n.term.effect.name: n.parameters for n in problem.explanation().named}
    assert set(found) == {"joint_spring", "viscous_friction"}
    assert found["joint_spring"]["stiffness"].value == pytest.approx(SPRING, rel=2e-3)
    assert wrapped(np.array(found["joint_spring"]["rest_angle"].value - REST)) == pytest.approx(0.0, abs=2e-3)
    assert found["viscous_friction"]["damping"].value == pytest.approx(DAMPER, rel=1e-2)


# ---------------------------------------------------------------- a heavy payload, with and without a load cell

HEAVY = Planted("payload", "pendulum", {"mass": 1.5 * MASS, "along": 0.13, "normal": 0.02})
CELL = {"reaction_O_x": 0.1, "reaction_O_y": 0.1}


def laden(cell: bool = True, time: np.ndarray = TIME) -> Measured:
    """Two swings with a payload of one and a half times the pendulum's mass, which the nominal model lacks."""
    rng, runs, noise = np.random.default_rng(2), [], NOISE | (CELL if cell else {})
    known, pendulum = Measured(PENDULUM, (), {}, (), "").signals, Pendulum.of(PENDULUM).with_things([HEAVY])
    for k, start in enumerate(STARTS):
        q, w = pendulum.swing(*start, time)
        push = pendulum.push(q, w)
        clean = dict(zip(NOISE | CELL, (q, w, push.real, push.imag), strict=True))
        seen = {s: clean[s] + sigma * rng.standard_normal(time.size) for s, sigma in noise.items()}
        channels = {s: Channel(known[s], seen[s], sigma, True, known[s].unit) for s, sigma in noise.items()}
        first = {s: float(seen[s][0]) for s in NOISE}
        runs.append(MeasuredRun(f"swing-{k}", time, channels, "free", None, None, first, None, False, "swing.csv"))
    return Measured(PENDULUM, tuple(runs), {}, (), "rig")


@pytest.mark.slow
@pytest.mark.parametrize("missing", [0, 6])
def test_a_load_cell_tells_a_payload_whatever_the_encoder_misses(missing: int) -> None:
    measured = laden()
    measured.runs[0].channels["pendulum_angle"].values[:missing] = np.nan
    (found,) = problem_of(measured, "payload", "gravity", "com_offset").explanation().named
    assert found.term.effect.name == "payload"
    for parameter, value in HEAVY.values.items():
        assert found.parameters[parameter].value == pytest.approx(value, rel=0.02), parameter


@pytest.mark.slow
def test_a_run_in_which_the_encoder_rests_on_a_count_tells_of_a_spring_too() -> None:
    measured = swings()
    run = measured.runs[0]
    still = {s: replace(c, values=np.full(TIME.size, REST), noise_given=False) for s, c in run.channels.items()}
    resting = replace(run, name="resting", channels={"pendulum_angle": still["pendulum_angle"]})
    problem = problem_of(replace(measured, runs=(*measured.runs, resting)), "joint_spring", "viscous_friction")
    assert {n.term.effect.name for n in problem.explanation().named} == {"joint_spring", "viscous_friction"}


@pytest.mark.slow
def test_the_fit_of_a_long_swing_ends_in_its_minimum_and_knows_how_sure_it_is() -> None:
    """A free motion answers to a hundredth of the mass by hundreds of sigmas, and not linearly."""
    measured = laden(time=np.arange(700) / 120.0)
    problem = Problem.of(measured, PENDULUM, Options("mujoco", only=["payload"], others=False, workers=1))
    (payload,) = (t for t in problem.terms if t.effect.name == "payload")
    x = payload.effect.natural(problem.rig, "pendulum", HEAVY.values)
    start = dict(zip(problem.base.terms, problem.base.x, strict=True))
    fit = problem.fitter.fit([*problem.base.terms, payload], start | {payload: x})
    assert fit is not None
    edges = np.cumsum([v.size for v in fit.x])[:-1]

    def residual(point: np.ndarray) -> np.ndarray:
        (found,) = problem.fitter.residuals(fit.terms, [np.split(point, edges)])
        assert found is not None
        return found

    begin = np.concatenate(fit.x)
    best = least_squares(residual, begin, x_scale=np.full(begin.size, 1e-4), xtol=1e-14, ftol=1e-14)
    assert fit.chi2 < 2 * best.cost + 0.1
    fine = least_squares(residual, best.x, x_scale=np.full(begin.size, 1e-6), jac="3-point", max_nfev=2).jac
    sure = np.sqrt(np.diag(np.linalg.inv(fine.T @ fine)))
    np.testing.assert_allclose(np.sqrt(np.diag(np.linalg.inv(fit.jacobian.T @ fit.jacobian))), sure, rtol=0.02)


@pytest.mark.slow
def test_what_a_swing_does_not_show_of_a_payload_is_not_known() -> None:
    """Angle and rate alone show two of its three numbers; its fit begins in spite of that, and its mass stays open."""
    result = diagnosed(laden(cell=False), only=["payload"])
    (effect,) = result["effects"]
    assert result["verdict"] == "explained"
    assert effect["parameters"]["mass"]["low"] is None
    assert effect["parameters"]["normal"]["low"] is not None or effect["parameters"]["along"]["low"] is None


def test_a_start_that_is_not_given_is_read_from_the_sensor_that_tells_it_better(tmp_path: Path) -> None:
    """An angle to 2 mrad, of which eight readings say little of the rate, and a rate to 5 mrad/s."""
    rng, start = np.random.default_rng(5), (0.9, 0.7)
    q, w = Pendulum.of(PENDULUM).swing(*start, TIME)
    q, w = q + 2e-3 * rng.standard_normal(TIME.size), w + 5e-3 * rng.standard_normal(TIME.size)
    rows = "\n".join(f"{t:.9g},{a:.9g},{b:.9g}" for t, a, b in zip(TIME, q, w, strict=True))
    head = "time [s],pendulum_angle [rad],pendulum_angular_velocity [rad/s]"
    (tmp_path / "swing.csv").write_text(f"{head}\n{rows}\n")
    (tmp_path / "measured.toml").write_text(
        'mechanism = "pendulum"\n[[run]]\nname = "swing"\nfile = "swing.csv"\ndrive = "free"\n'
    )
    (run,) = load_measured(tmp_path / "measured.toml").runs
    assert run.start["pendulum_angle"] == pytest.approx(start[0], abs=4e-3)
    assert run.start["pendulum_angular_velocity"] == pytest.approx(start[1], abs=1e-2)


def test_runs_are_brought_to_one_turn_unless_the_model_has_a_spring() -> None:
    measured = swings((0, 3))
    moved = on_one_turn(measured)
    for before, after, turns in zip(measured.runs, moved.runs, (0, 3), strict=True):
        shift = before.channels["pendulum_angle"].values - after.channels["pendulum_angle"].values
        np.testing.assert_allclose(shift, 2 * math.pi * turns, atol=1e-12)
        assert before.start["pendulum_angle"] - after.start["pendulum_angle"] == pytest.approx(2 * math.pi * turns)
        assert after.start["pendulum_angular_velocity"] == before.start["pendulum_angular_velocity"]
    sprung: Mechanism = PENDULUM.with_joint("O", stiffness=1.0)
    known = replace(measured, mechanism=sprung)
    assert on_one_turn(known) is known, "there its angle has a meaning"


def test_a_validation_run_does_not_say_in_which_turn_the_fitted_ones_are() -> None:
    one, other = swings((0, 1)).runs
    kept = replace(one, name="kept", role="validation", channels=_turned(one, 2))
    alone = on_one_turn(replace(swings(), runs=(one, other)))
    among = on_one_turn(replace(swings(), runs=(one, kept, other)))
    assert [run.name for run in among.runs] == ["swing-0", "kept", "swing-1"]
    for before, after in zip(alone.runs, (among.runs[0], among.runs[2]), strict=True):
        np.testing.assert_array_equal(before.channels["pendulum_angle"].values, after.channels["pendulum_angle"].values)
    np.testing.assert_allclose(
        among.runs[1].channels["pendulum_angle"].values, among.runs[0].channels["pendulum_angle"].values, atol=1e-12
    )


def _turned(run: MeasuredRun, turns: int) -> dict[str, Channel]:
    angle = run.channels["pendulum_angle"]
    return {**run.channels, "pendulum_angle": replace(angle, values=angle.values + 2 * math.pi * turns)}

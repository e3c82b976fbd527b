"""Accuracy with clearance: Fig. 7c, and what first order says beyond Eq. 8, each number against another road to it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize

from analytic.beyond_paper.monte_carlo import Population, draw
from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import Gap, kinematics
from analytic.kinematics.output import Output
from analytic.mechanism import Load, Mechanism
from analytic.mechanism.file import load
from analytic.paper.envelope import transmission, unit_reactions
from analytic.paper.kinetostatics import kinetostatics
from analytic.paper.superposition import AccuracyAnalysis, accuracy, total_displacement
from asked import request_of
from linkages import inverted_slider, scotch_yoke, six_bar_driven_from_the_rocker
from sim_models.engine import ENGINES, declared

CYCLE = np.radians(np.arange(30.0, 151.0, 10.0))
C = 1e-4  # m
LOADED = {
    "paper": load("paper"),
    "crank-rocker": (
        load("crank-rocker").replace(
            loads=[{"body": "follower", "torque": 2.0}, {"body": "coupler", "force": (0.0, -20.0)}]
        )
    ),
    "slider-crank": (
        load("slider-crank").replace(
            loads=[{"body": "slider", "force": (-100.0, -30.0)}, {"body": "rod", "force": (5.0, 10.0)}]
        )
    ),
    "six-bar": load("six-bar"),
}


def everything(m: Mechanism) -> list[Output]:
    axes: Sequence = ("x", "y", "angle")
    return [Output(body.name, axis) for body in m.bodies for axis in axes]


def at_rest(m: Mechanism, c: float = C, theta: np.ndarray = CYCLE) -> AccuracyAnalysis:
    """Every revolute joint with the same clearance, static."""
    assembly = Assembly(m)
    return accuracy(assembly, theta, everything(m), dict.fromkeys(assembly.structure.pins, c))


def moved(m: Mechanism, values: dict[Output, np.ndarray]) -> np.ndarray:
    """Displacement (bodies, N) x + iy of each body's com."""
    return np.array([values[Output(b.name, "x")] + 1j * values[Output(b.name, "y")] for b in m.bodies])


def reassembled(found: AccuracyAnalysis, gaps: np.ndarray, outputs: Sequence[Output]) -> dict[Output, np.ndarray]:
    """Displacements by gaps (pins, N), closing the linkage again."""
    theta = np.broadcast_to(found.theta, gaps.shape[1:])
    ideal, displaced = (
        kinematics(found.assembly, theta, gaps=loose)
        for loose in (None, {p: Gap(g) for p, g in zip(found.pins, gaps, strict=True)})
    )
    return {d: d.value(displaced) - d.value(ideal) for d in outputs}


# ---------------------------------------------------------------- Fig. 7c


def test_the_papers_total_is_the_sum_of_figs_7a_and_7b() -> None:
    found = total_displacement(Assembly(load("paper")), np.radians([30.0]))
    apart = found.by_clearance("coupler", "B")[0] - found.by_clearance("follower", "B")[0]
    np.testing.assert_allclose(
        apart, 0.01 * np.exp(1j * np.radians(30.0)), atol=1e-12
    )  # Eq. 8, at the clearance itself
    elastic = found.compliance.displacement("coupler", "B")[0]
    np.testing.assert_allclose(elastic, complex(-0.347493e-3, 0.602877e-3), atol=1e-9)
    np.testing.assert_allclose(
        found.displacement("coupler", "B")[0], found.by_clearance("coupler", "B")[0] + elastic, atol=1e-15
    )


def test_without_clearance_the_total_is_the_compliance() -> None:
    found = total_displacement(Assembly(load("paper")), np.radians([30.0, 90.0]), clearances={})
    np.testing.assert_array_equal(found.displacement("coupler"), found.compliance.displacement("coupler"))


def test_a_body_that_bends_turns_as_its_sensor_has_it() -> None:
    found = accuracy(Assembly(load("paper")), np.radians([30.0, 90.0]), [Output("crank", "angle")], {}, 1.0, False)
    turned = found.total.signals()["crank_angle"] - found.total.clearance.signals()["crank_angle"]
    np.testing.assert_allclose(found.compliance(Output("crank", "angle")), turned, rtol=1e-9, atol=1e-12)
    assert not np.allclose(turned, found.total.compliance.rotation("crank"), rtol=1e-3)  # of its com


# ---------------------------------------------------------------- sensitivities


@pytest.mark.long_rows("six-bar1")
@pytest.mark.parametrize(
    "m",
    [*LOADED.values(), load("pendulum"), scotch_yoke(), inverted_slider(), six_bar_driven_from_the_rocker()],
    ids=lambda m: m.name,
)
def test_sensitivities_are_the_reactions_to_a_unit_load(m: Mechanism) -> None:
    lawless = [
        j.model_copy(update={"friction_torque": 0.0, "friction": 0.0, "damping": 0.0, "stiffness": 0.0})
        for j in m.joints
    ]
    theta = m.assembly[m.driven] + np.linspace(-0.2, 0.3, 7)
    outputs = [*everything(m), *(Output(b.name, "y", next(iter(b.points))) for b in m.bodies)]
    found = unit_reactions(Assembly(m), theta, outputs)
    for d in outputs:
        one = {"x": {"force": (1.0, 0.0)}, "y": {"force": (0.0, 1.0)}, "angle": {"torque": 1.0}}[d.axis]
        unit = m.replace(loads=[Load(body=d.body, point=d.point, **one)], gravity=(0.0, 0.0), joints=lawless)
        forces = kinetostatics(kinematics(Assembly(unit), theta), inertia=False).forces
        expected = np.array([forces[j.name] for j in m.joints if not j.prismatic])
        np.testing.assert_allclose(found[d], expected, atol=1e-11 * max(1.0, np.abs(expected).max()))


def test_sensitivities_of_the_papers_parallelogram() -> None:
    found = at_rest(load("paper"))
    angle = found.sensitivity(Output("follower", "angle"))
    for joint in "DABE":  # the follower turns as if the loop's length along the coupler had changed
        np.testing.assert_allclose(angle[joint], 1 / (0.2 * np.sin(CYCLE)), rtol=1e-12)
    np.testing.assert_allclose(found.sensitivity(Output("crank", "angle"))["D"], 0, atol=1e-15)  # held by the drive


# ---------------------------------------------------------------- nominal displacement


def potential_energy(m: Mechanism, assembly: Assembly, theta: float, gaps: np.ndarray) -> np.ndarray:
    """Potential (K,) of gravity and the loads with gaps (pins, K): positions only, no reactions."""
    loose = dict(zip(assembly.structure.pins, gaps, strict=True))
    columns = assembly.columns(assembly.coordinates(np.full(gaps.shape[1], theta), loose), loose)
    form, phasor = assembly.structure.form, lambda body: columns[assembly.structure.body_column(body)]
    work = sum(b.mass * (np.conj(complex(*m.gravity)) * (form(b.name) @ columns)).real for b in m.bodies)
    for one in m.loads:
        work = (
            work
            + (np.conj(complex(*one.force)) * (form(one.body, one.point) @ columns)).real
            + one.torque * np.angle(phasor(one.body))
        )
    return -work


def of_least_energy(m: Mechanism, assembly: Assembly, theta: float, c: float) -> np.ndarray:
    """Gaps (pins,) of least potential energy among all with |gap| <= c, sought as c sin(u) exp(iv) from a point
    inside.
    """
    pins = len(assembly.structure.pins)
    step = 1e-4 * np.vstack([np.zeros(2 * pins), np.eye(2 * pins), -np.eye(2 * pins)])

    def gaps(x: np.ndarray) -> np.ndarray:
        return c * np.sin(x[:pins]) * np.exp(1j * x[pins:])

    centre = potential_energy(m, assembly, theta, np.zeros((pins, 1)))

    def energy(x: np.ndarray) -> tuple[float, np.ndarray]:
        v = (potential_energy(m, assembly, theta, gaps((x + step).T)) - centre) / c  # N
        return float(v[0]), (v[1 : 2 * pins + 1] - v[2 * pins + 1 :]) / 2e-4

    start = np.repeat([0.3, 1.0], pins)
    least = minimize(energy, start, jac=True, method="BFGS", options={"gtol": 1e-5 * np.abs(energy(start)[1]).max()})
    assert least.success, least.message
    return gaps(least.x)


@pytest.mark.long_rows("six-bar", "paper")
@pytest.mark.parametrize("m", LOADED.values(), ids=LOADED)
def test_displacements_meet_energy_minimisation_which_needs_no_reactions(m: Mechanism) -> None:
    found = at_rest(m)
    assert not found.flags
    gaps = np.array([of_least_energy(m, found.assembly, theta, C) for theta in CYCLE]).T
    energy = moved(m, reassembled(found, gaps, everything(m)))
    for answer, tolerance in ((found.nominal, 0.01), (found.equilibrium, 1e-4)):
        mine = moved(m, {d: answer(d) for d in everything(m)})
        assert np.max(np.abs(mine - energy) / np.abs(energy)) < tolerance


@pytest.mark.parametrize("m", LOADED.values(), ids=LOADED)
def test_the_nominal_displacement_is_the_limit_of_small_gaps(m: Mechanism) -> None:
    errors = []
    for c in (1e-4, 1e-5):
        found = at_rest(m, c)
        nominal, equilibrium = (
            moved(m, {d: answer(d) for d in everything(m)}) for answer in (found.nominal, found.equilibrium)
        )
        errors.append(np.max(np.abs(nominal - equilibrium)) / c)
    assert errors[0] / errors[1] == pytest.approx(10.0, rel=0.05)


def test_inertia_presses_the_pins_too() -> None:
    m = load("crank-rocker")
    assembly, theta = Assembly(m), np.radians([30.0, 120.0])
    d = Output("coupler", "x")
    driven, static = (accuracy(assembly, theta, [d], {"B": C}, m.speed or 0.0, inertia) for inertia in (True, False))
    ideal = kinetostatics(kinematics(assembly, theta, m.speed or 0.0)).forces["B"]
    r = unit_reactions(assembly, theta, [d])[d][assembly.structure.pins.index("B")]
    np.testing.assert_allclose(driven.nominal(d), C * (np.conj(r) * ideal / np.abs(ideal)).real, rtol=1e-12)
    assert np.isnan(static.nominal(d)).all()  # no load, no reaction, no direction
    assert set(static.flags) == {0, 1}
    np.testing.assert_array_equal(static.worst_case(d), driven.worst_case(d))


def at_rest_in_engines() -> Iterator[Any]:
    """Engine, joint model and linkage; PyBullet and DART balance the contacts of several loops in seconds."""
    for case, simulator, joint_model in product(LOADED, ENGINES, ("massless-link", "contact")):
        if (joint_model, "static") in declared(simulator).capabilities.runs:
            long = simulator in ("pybullet", "dart")
            row = (LOADED[case], joint_model, simulator)
            yield pytest.param(*row, id=f"{case}-{joint_model}-{simulator}", marks=[pytest.mark.slow] if long else [])


@pytest.mark.slow
@pytest.mark.parametrize(("m", "joint_model", "simulator"), list(at_rest_in_engines()))
def test_a_simulation_with_clearance_in_every_joint_agrees(m: Mechanism, joint_model: str, simulator: str) -> None:
    engine = declared(simulator)
    theta = CYCLE[::3]
    found = at_rest(m, C, theta)
    trace = engine.simulate(request_of(m.with_clearances(dict.fromkeys(found.pins, C)), joint_model, "static", theta))
    ideal = found.total.clearance.ideal
    simulated = moved(m, {d: trace.signals[d.name] - d.value(ideal.motion) for d in everything(m)})
    stiffness = trace.settings.get("contact_stiffness") or np.inf
    dent = np.array([ideal.forces[pin] for pin in found.pins]) / stiffness  # the contact gives way along the reaction
    soft = {d: found.equilibrium(d) + np.sum((np.conj(r) * dent).real, axis=0) for d, r in found.unit_reactions.items()}
    assert np.max(np.abs(simulated - moved(m, soft)) / np.abs(simulated)) < 1e-3
    first_order = moved(m, {d: found.nominal(d) for d in everything(m)})
    assert np.max(np.abs(simulated - first_order) / np.abs(simulated)) < 0.02


# ---------------------------------------------------------------- envelope


@pytest.mark.parametrize("m", LOADED.values(), ids=LOADED)
def test_the_worst_case_is_reached_and_never_passed(m: Mechanism) -> None:
    found = at_rest(m, 1e-6)
    rng = np.random.default_rng(1)
    for d, r in found.unit_reactions.items():
        worst = found.worst_case(d)
        toward = 1e-6 * r / np.maximum(np.abs(r), 1e-300)
        np.testing.assert_allclose(reassembled(found, toward, [d])[d], worst, rtol=1e-3, atol=1e-10)
        np.testing.assert_allclose(reassembled(found, -toward, [d])[d], -worst, rtol=1e-3, atol=1e-10)
    for _ in range(50):
        anywhere = (
            1e-6 * np.sqrt(rng.random((len(found.pins), 1))) * np.exp(2j * np.pi * rng.random((len(found.pins), 1)))
        )
        for d, displacement in reassembled(found, anywhere * np.ones(CYCLE.size), list(found.unit_reactions)).items():
            assert np.all(np.abs(displacement) <= found.worst_case(d) * 1.001 + 1e-10)


@pytest.mark.parametrize("m", LOADED.values(), ids=LOADED)
def test_the_farthest_point_is_the_maximum_over_every_direction(m: Mechanism) -> None:
    found = at_rest(m)
    psi = np.linspace(0, np.pi, 3601)[:, None]
    for b in m.bodies:
        x, y = Output(b.name, "x"), Output(b.name, "y")
        rx, ry = (found.unit_reactions[d][:, None] for d in (x, y))
        support = C * np.abs(rx * np.cos(psi) + ry * np.sin(psi)).sum(axis=0)
        far = found.farthest(x, y)
        np.testing.assert_allclose(np.abs(far), support.max(axis=0), rtol=1e-6)
        assert np.all(np.abs(far) >= support.max(axis=0) * (1 - 1e-12))
        along = rx[:, 0] * np.cos(np.angle(far)) + ry[:, 0] * np.sin(np.angle(far))
        reached = reassembled(found, C * along / np.maximum(np.abs(along), 1e-300), [x, y])
        np.testing.assert_allclose(
            np.abs(reached[x] + 1j * reached[y]), np.abs(far), rtol=0.02
        )  # first order, at 0.1 mm


# ---------------------------------------------------------------- Monte Carlo


def population(found: AccuracyAnalysis) -> Population:
    return Population(
        found.assembly, found.total.clearance.ideal.motion, found.path, found.unit_reactions, found.directions
    )


@pytest.mark.long_rows("first order-free-six-bar")
@pytest.mark.parametrize("m", LOADED.values(), ids=LOADED)
@pytest.mark.parametrize("contacts", ["free", "along reactions"])
@pytest.mark.parametrize("nonlinear", [False, True], ids=["first order", "closed again"])
def test_monte_carlo_meets_its_formula_to_2_percent(m: Mechanism, contacts: str, nonlinear: bool) -> None:
    c = C if contacts == "free" else 1e-5  # along the reactions second order adds up, and is no sampling error
    found = at_rest(m, c, CYCLE[::6])
    tolerance = np.linspace(0.2, 0.8, len(found.pins)) * c
    drawn = draw(found.clearances, tolerance, 20_000, seed=7)
    spreads = population(found).distribution(drawn, contacts, nonlinear).spreads
    for d, spread in spreads.items():
        moves = spread.formula > 0.01 * spread.formula.max()
        if spread.formula.max() > 1e-5 * c:
            assert moves.any()
            np.testing.assert_allclose(spread.sigma[moves], spread.formula[moves], rtol=0.02, err_msg=d.name)
            assert np.all(spread.high - spread.low > 2.5 * spread.sigma)
            assert np.all(np.abs(spread.high) <= 1.02 * (found.worst_case(d) * 1.8))
    r = found.unit_reactions[Output(m.bodies[1].name, "x")]
    if contacts == "free":  # E[c^2] of a uniform clearance, written out
        square = ((found.clearances + tolerance) ** 3 - (found.clearances - tolerance) ** 3) / (6 * tolerance)
        np.testing.assert_allclose(
            spreads[Output(m.bodies[1].name, "x")].formula, np.sqrt(0.5 * square @ np.abs(r) ** 2), rtol=1e-12
        )


def test_percentiles_leave_the_right_shares_outside() -> None:
    found = at_rest(load("paper"), C, CYCLE[:2])
    d, x, y = Output("follower", "angle"), Output("coupler", "x"), Output("coupler", "y")
    one, fresh = (draw(found.clearances, 0 * found.clearances, 100_000, seed) for seed in (1, 2))
    expected = population(found).distribution(one, "free")
    gaps = fresh.sizes * fresh.directions
    along = {o: np.conj(found.unit_reactions[o]).T @ gaps for o in (d, x, y)}
    for k in range(2):
        assert np.mean(along[d].real[k] < expected.spreads[d].low[k]) == pytest.approx(0.025, abs=0.005)
        assert np.mean(along[d].real[k] > expected.spreads[d].high[k]) == pytest.approx(0.025, abs=0.005)
        assert np.mean(np.hypot(along[x].real[k], along[y].real[k]) < expected.radius["coupler"][k]) == pytest.approx(
            0.95, abs=0.005
        )


def test_samples_come_from_the_seed_alone() -> None:
    found = at_rest(load("paper"), C, CYCLE[:3])
    d = Output("coupler", "y")

    def sigma(seed: int) -> np.ndarray:
        return (
            population(found)
            .distribution(draw(found.clearances, 0.1 * found.clearances, 500, seed), "free")
            .spreads[d]
            .sigma
        )

    np.testing.assert_array_equal(sigma(3), sigma(3))
    assert np.all(sigma(3) != sigma(4))


def test_blocks_of_crank_angles_do_not_change_the_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    found = at_rest(load("paper"), C, CYCLE)
    d = Output("coupler", "y")
    drawn = draw(found.clearances, 0 * found.clearances, 1000, seed=0)
    for nonlinear in (False, True):
        whole = population(found).distribution(drawn, "free", nonlinear).spreads[d]
        with monkeypatch.context() as patch:
            patch.setattr("analytic.beyond_paper.monte_carlo.SAMPLES_AT_ONCE", 2000)
            parts = population(found).distribution(drawn, "free", nonlinear).spreads[d]
        np.testing.assert_allclose(parts.sigma, whole.sigma, rtol=1e-12)
        np.testing.assert_allclose(parts.low, whole.low, rtol=1e-9)


@pytest.mark.parametrize("nonlinear", [False, True], ids=["first order", "closed again"])
def test_along_reactions_there_is_no_distribution_where_a_reaction_has_no_direction(nonlinear: bool) -> None:
    m = load("paper").replace(loads=[{"body": "follower", "force": (0.0, 50.0)}])  # B is unloaded at 90 deg, E never is
    d, theta = Output("follower", "angle"), np.radians([70.0, 90.0, 110.0])
    for joint, lost in (("B", [False, True, False]), ("E", [False, False, False])):
        found = accuracy(Assembly(m), theta, [d], {joint: C})
        spread = (
            population(found)
            .distribution(draw(found.clearances, 0.5 * found.clearances, 100, seed=0), "along reactions", nonlinear)
            .spreads[d]
        )
        assert (
            np.isnan(found.nominal(d)).tolist()
            == np.isnan(spread.sigma).tolist()
            == np.isnan(spread.low).tolist()
            == lost
        )


# ---------------------------------------------------------------- where it does not hold


def test_the_contact_changes_side_where_a_two_force_coupler_is_unloaded() -> None:
    m = load("paper").replace(loads=[{"body": "follower", "force": (0.0, 50.0)}])  # no moment about E at 90 deg
    theta = np.radians(np.arange(80.0, 101.0, 4.0))
    found = at_rest(m, C, theta)
    assert sorted(change.joint for change in found.side_changes) == ["A", "B", "D"]
    for change in found.side_changes:
        assert change.crank_angle == pytest.approx(np.pi / 2, abs=1e-6)
        assert change.reaction == pytest.approx(0, abs=1e-3)
        assert abs(change.turned) == pytest.approx(np.pi, abs=0.1)
    d = Output("follower", "angle")
    np.testing.assert_allclose(
        found.jumps[d], 2 * C / 0.2 * np.sign(found.jumps[d][0]), rtol=1e-3
    )  # each joint: from one side to the other
    beside = at_rest(m, C, np.radians([88.0, 92.0])).equilibrium(d)
    assert beside[1] - beside[0] == pytest.approx(found.jumps[d].sum(), rel=0.01)


def test_no_side_changes_where_the_load_never_reverses() -> None:
    assert at_rest(load("paper"), C, np.radians(np.arange(20.0, 161.0, 5.0))).side_changes == []


@pytest.mark.parametrize("start", [60.0, 57.5])
def test_a_whole_turn_has_no_gap_between_its_last_and_first_crank_angle(start: float) -> None:
    sliding = load("slider-crank")
    rest = float(kinematics(Assembly(sliding), np.radians([57.5])).relative(sliding.joint("S"))[0])
    m = sliding.with_joint("S", stiffness=1e4, rest_angle=rest)  # the spring lets go of the rod at 57.5 and 302.5 deg
    whole = at_rest(m, C, np.radians(start + np.arange(0.0, 356.0, 5.0)))
    assert np.degrees([c.crank_angle for c in whole.side_changes if c.joint == "B"]) == pytest.approx(
        [302.5, 417.5], abs=0.01
    )
    part = at_rest(m, C, np.radians(np.arange(60.0, 401.0, 5.0)))
    assert np.degrees([c.crank_angle for c in part.side_changes if c.joint == "B"]) == pytest.approx([302.5], abs=0.01)


def test_transmission_is_the_sine_of_the_transmission_angle() -> None:
    theta = np.radians(np.arange(0.0, 360.0, 15.0))
    diagonal = 0.05**2 + 0.12**2 - 2 * 0.05 * 0.12 * np.cos(theta)  # D-A-E by the law of cosines
    mu = np.arccos((0.12**2 + 0.10**2 - diagonal) / (2 * 0.12 * 0.10))
    found = at_rest(LOADED["crank-rocker"], C, theta)
    np.testing.assert_allclose(transmission(found.condition), np.sin(mu), rtol=1e-12)


def test_crank_angles_near_a_change_point_are_cautioned() -> None:
    found = at_rest(load("paper"), 1e-7, np.radians([8.0, 14.0, 90.0]))
    assert set(found.cautions) == {0}
    assert "near a singularity" in found.cautions[0]


def test_gaps_too_large_for_first_order_are_cautioned() -> None:
    m = load("paper")
    theta, outputs = np.radians([20.0, 90.0, 160.0]), everything(m)
    large, small = (accuracy(Assembly(m), theta, outputs, {"B": c}) for c in (0.01, 1e-4))
    assert 0 in large.cautions
    assert 2 in large.cautions
    assert 1 not in large.cautions
    assert "first order is" in large.cautions[0]
    assert small.cautions == {}

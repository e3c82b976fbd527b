"""A block with clearance in its guide: where it rests, and what that does to the linkage, each by another road."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import minimize

from analytic.beyond_paper.monte_carlo import draw
from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import kinematics
from analytic.kinematics.output import Output
from analytic.kinematics.structure import BlockRest
from analytic.mechanism import Load, Mechanism, MechanismError
from analytic.mechanism.file import dumps, load, loads
from analytic.paper.clearance import displaced
from analytic.paper.guide import GuidedBlock
from analytic.paper.kinetostatics import kinetostatics
from analytic.paper.superposition import accuracy
from compare.accuracy import accuracy as compare_accuracy
from compare.domain_map.validity import validity
from compare.faults import ArgumentError
from linkages import inverted_slider
from marks import slow

ANGLES = np.radians([25.0, 70.0, 130.0, 200.0, 250.0, 310.0])
LOADS = {
    "gravity": Load(body="slider"),
    "flat on the lower wall": Load(body="slider", force=(-60.0, -20.0)),
    "flat on the upper wall": Load(body="slider", force=(5.0, 30.0)),
    "tilted": Load(body="slider", force=(-60.0, 10.0), torque=2.5),
    "tilted back": Load(body="slider", force=(20.0, -10.0), torque=-1.5),
    "either, by the angle": Load(body="slider", force=(-60.0, 0.0), torque=0.35),
}


def slider_crank(load_on: Load, clearance: float = 0.0) -> Mechanism:
    """The shipped slider-crank under gravity, its pin B off the middle of the block: tilting moves the rod."""
    m = load("slider-crank").replace(gravity=(0.0, -9.81), loads=(load_on,))
    slider = m.body("slider")
    return m.replace(
        bodies=(
            *m.bodies[:2],
            slider.model_copy(update={"points": {"B": (0.01, 0.02), "S": (0.0, 0.0)}, "com": (0, 0)}),
        )
    ).with_joint("S", clearance=clearance)


class Linkage:
    """That slider-crank by hand: its potential energy with the block at a height y (m), turned by phi (rad)."""

    def __init__(self, m: Mechanism, crank: float) -> None:
        self.m, self.pin, self.crank = m, 0.05 * np.exp(1j * crank), crank
        self.ahead = 1.0

    def pose(self, y: float, phi: float) -> tuple[complex, complex]:
        """The block's point, and where B is."""
        arm = complex(0.01, 0.02) * np.exp(1j * phi)
        height = y + arm.imag - self.pin.imag
        b = self.pin.real + math.sqrt(0.12**2 - height**2) + 1j * (y + arm.imag)
        return b - arm, b

    def energy(self, y: float, phi: float) -> float:
        at, b = self.pose(y, phi)
        load_on = self.m.loads[0]
        weights = 0.14 * at.imag + 0.21 * (self.pin + b).imag / 2
        return 9.81 * weights - load_on.force[0] * at.real - load_on.force[1] * at.imag - load_on.torque * phi

    def rest(self, clearance: float) -> tuple[float, float]:
        """Where the energy is least while no corner is inside a wall."""
        length, height = self.m.joint("S").guide or (0.0, 0.0)
        corners = [complex(x, y) for x in (-length / 2, length / 2) for y in (-height / 2, height / 2)]
        scale = np.array([clearance, 2 * clearance / length])

        def room(x: np.ndarray) -> np.ndarray:
            y, phi = x * scale
            high = np.array([y + (corner * np.exp(1j * phi)).imag for corner in corners])
            return (height / 2 + clearance - np.abs(high)) / clearance

        zero = self.energy(0.0, 0.0)
        size = max(abs(self.energy(*(scale * way)) - zero) for way in ((1.0, 0.0), (0.0, 1.0)))
        starts = [(0.1, 0.1), (-0.1, 0.1), (0.1, -0.1), (-0.1, -0.1), (0.0, 0.0)]
        found = [
            minimize(
                lambda x: (self.energy(*(x * scale)) - zero) / size, start, method="SLSQP", bounds=[(-1.5, 1.5)] * 2,
                constraints={"type": "ineq", "fun": room}, options={"ftol": 1e-14, "maxiter": 500},
            )
            for start in starts
        ]  # fmt: skip
        best = min((f for f in found if room(f.x).min() > -1e-7), key=lambda f: float(f.fun))
        return float(best.x[0] * scale[0]), float(best.x[1] * scale[1])


@pytest.mark.long_rows("0.0001-flat on the lower wall")
@pytest.mark.parametrize("name", LOADS)
@pytest.mark.parametrize("clearance", [1e-4, *slow(1e-3, 1e-5)])
def test_a_block_rests_where_the_potential_energy_is_least(name: str, clearance: float) -> None:
    m = slider_crank(LOADS[name], clearance)
    found = displaced(Assembly(m), ANGLES, 1.0, inertia=False)
    assert not found.flags
    for k, angle in enumerate(ANGLES):
        by_hand = Linkage(m, angle)
        y, phi = by_hand.rest(clearance)
        assert -found.gaps["S"][k] == pytest.approx(1j * y, abs=1e-5 * clearance)
        assert -found.tilts["S"][k] == pytest.approx(phi, abs=1e-4 * clearance / 0.1)
        at, _ = by_hand.pose(y, phi)
        assert found.signals()["slider_x"][k] == pytest.approx(at.real, abs=1e-5 * clearance)


def test_every_way_to_rest_occurs() -> None:
    ways = set()
    for each in LOADS.values():
        ways |= set(displaced(Assembly(slider_crank(each, 1e-4)), ANGLES, 1.0, inertia=False).rests["S"])
    assert ways == {-2.0, -1.0, 1.0, 2.0}


@pytest.mark.parametrize("name", ["tilted", "flat on the lower wall", "either, by the angle"])
def test_first_order_is_off_by_the_square_of_the_clearance(name: str) -> None:
    """Against the equilibrium, in where the block is and how the rod has turned."""
    off = []
    for clearance in (1e-3, 1e-4):
        assembly = Assembly(slider_crank(LOADS[name], clearance))
        one, other = (
            displaced(assembly, ANGLES, 1.0, inertia=False, model=model).signals()
            for model in ("first_order", "equilibrium")  # type: ignore[arg-type]
        )
        assert not np.isnan(one["slider_x"]).any()
        ideal = displaced(assembly, ANGLES, 1.0, inertia=False, clearances={}).signals()
        moved = np.abs(other["slider_x"] - ideal["slider_x"]).max()
        assert moved > 0.1 * clearance
        off.append([np.abs(one[s] - other[s]).max() for s in ("clearance_S_angle", "slider_x", "rod_angle")])
    large, small = np.array(off)
    assert np.all(small <= 0.011 * large + 1e-15)


def test_the_height_of_the_block_decides_how_far_it_tilts() -> None:
    low, high = (GuidedBlock.of(load("slider-crank").with_joint("S", guide=(0.1, h)), "S", 1e-3) for h in (1e-6, 0.05))
    assert math.sin(low.tilt) == pytest.approx(0.02, rel=1e-5)
    for block in (low, high):
        corner = complex(block.length, block.height) / 2 * np.exp(1j * block.tilt)
        assert corner.imag == pytest.approx(block.height / 2 + block.clearance, rel=1e-12)
        assert corner.real == pytest.approx(block.lever, rel=1e-12)


@pytest.mark.parametrize("case", ["slider-crank", "inverted slider"])
def test_force_and_moment_are_the_slope_of_the_energy(case: str) -> None:
    """The reaction of a slide between any two bodies does work on its block's offset and tilt as a drive's torque does
    on the crank: both are the slopes of one potential energy.
    """
    m = inverted_slider() if case == "inverted slider" else slider_crank(LOADS["tilted"])
    m = m.replace(
        joints=tuple(j.model_copy(update={"friction_torque": 0.0, "stiffness": 0.0, "damping": 0.0}) for j in m.joints)
    )
    assembly, theta = Assembly(m), np.array([0.4])

    def energy(rest: BlockRest) -> float:
        motion = kinematics(assembly.resting({"S": rest}), theta)
        total = 0.0
        for body in m.bodies:
            total -= body.mass * float((motion.position(body.name) * np.conj(complex(*m.gravity))).real[0])
        for each in m.loads:
            total -= float((motion.position(each.body, each.point) * np.conj(complex(*each.force))).real[0])
            total -= each.torque * float(motion.angle(each.body)[0])
        return total

    found = kinetostatics(kinematics(assembly, theta, 1.0), inertia=False)
    first = m.joint("S").bodies[0]
    normal = 1j * m.joint("S").direction * np.exp(1j * found.motion.angle(first))
    across, step = float((found.forces["S"] * np.conj(normal)).real[0]), 1e-6
    slope = (energy(BlockRest(step, 0.0)) - energy(BlockRest(-step, 0.0))) / (2 * step)
    turning = (energy(BlockRest(0.0, step)) - energy(BlockRest(0.0, -step))) / (2 * step)
    assert [slope, turning] == pytest.approx([across, float(found.moments["S"][0])], rel=1e-7)


@pytest.mark.parametrize("case", ["slider-crank", "inverted slider"])
def test_a_linkage_closes_with_its_block_off_its_place(case: str) -> None:
    m = inverted_slider() if case == "inverted slider" else slider_crank(LOADS["tilted"])
    motion = kinematics(Assembly(m).resting({"S": BlockRest(2e-3, -0.03)}), np.linspace(0.1, 0.9, 5), 3.0)
    for joint in m.joints:
        first, second = joint.bodies
        apart = motion.position(first, joint.name) - motion.position(second, joint.name)
        if not joint.prismatic:
            np.testing.assert_allclose(apart, 0.0, atol=1e-14)
            continue
        along = joint.direction * np.exp(1j * motion.angle(first))
        np.testing.assert_allclose(-apart, (motion.relative(joint) + 2e-3j) * along, atol=1e-14)
        np.testing.assert_allclose(motion.angle(second) - motion.angle(first), joint.angle - 0.03, atol=1e-14)
        np.testing.assert_allclose(motion.play(joint)[0], -2e-3j * along, atol=1e-14)


def test_in_motion_the_displaced_linkage_is_in_balance_with_its_inertia() -> None:
    """Against the same linkage built with its block where it rests, and ideal joints."""
    m = slider_crank(Load(body="slider", force=(0.0, -200.0)), 1e-4)
    found = displaced(Assembly(m), ANGLES, 20.0)
    assert set(found.rests["S"]) == {1.0}
    ground = m.ground.model_copy(update={"points": {**m.ground.points, "S": (0.0, -1e-4)}})
    built = m.ideal().replace(ground=ground)
    same = kinetostatics(kinematics(Assembly(built), ANGLES, 20.0))
    for name, force in same.forces.items():
        np.testing.assert_allclose(found.reactions.forces[name], force, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(found.reactions.drive_torque, same.drive_torque, rtol=1e-12)


def test_pins_and_a_block_together() -> None:
    """Clearance in B and S at once: the pin follows the reaction of the linkage that both displace."""
    m = slider_crank(LOADS["tilted"]).with_clearances({"B": 1e-4, "S": 1e-4})
    found = displaced(Assembly(m), ANGLES, 1.0, inertia=False)
    force = found.reactions.forces["B"]
    np.testing.assert_allclose(found.gaps["B"], 1e-4 * force / np.abs(force), atol=1e-15)
    assert set(found.rests["S"]) == {-1.0, -2.0}
    alone = displaced(Assembly(m), ANGLES, 1.0, inertia=False, clearances={"S": 1e-4})
    assert np.abs(alone.signals()["slider_x"] - found.signals()["slider_x"]).max() > 2e-5


def test_an_angle_is_flagged_where_the_block_changes_over() -> None:
    m = slider_crank(LOADS["either, by the angle"], 1e-4)
    sweep = np.radians(np.arange(0.0, 360.0, 0.25))
    found = displaced(Assembly(m), sweep, 1.0, inertia=False)
    changes = np.flatnonzero(np.diff(found.rests["S"]))
    assert changes.size
    assert all({k, k + 1} & set(found.flags) for k in changes.tolist())
    assert len(found.flags) < 0.1 * sweep.size
    assert all("the block of S" in why for why in found.flags.values())


def test_files_keep_a_guide() -> None:
    m = slider_crank(LOADS["tilted"], 1e-4)
    assert loads(dumps(m)) == m
    assert m.clearances == {"S": 1e-4} == m.loose_guides


@pytest.mark.parametrize(
    ("joint", "fields", "words"),
    [
        ("S", {"guide": None, "clearance": 1e-4}, ["joint 'S'", "clearance = 0.0001", "guide = [length, height]"]),
        ("B", {"guide": (0.1, 0.05)}, ["joint 'B'", "guide", "prismatic"]),
        ("S", {"guide": (0.1, 0.0)}, ["guide", "greater than 0"]),
        ("S", {"guide": (0.1, 0.05), "clearance": 0.04}, ["joint 'S'", "turns over", "0.04"]),
    ],
)
def test_what_makes_no_guide_is_refused(joint: str, fields: dict[str, object], words: list[str]) -> None:
    with pytest.raises(MechanismError) as caught:
        load("slider-crank").with_joint(joint, **fields)
    assert all(word in str(caught.value) for word in words), str(caught.value)


OUTPUTS = (Output("slider", "x"), Output("rod", "x"), Output("rod", "y"), Output("rod", "angle"))


@pytest.mark.parametrize("name", ["tilted", "flat on the upper wall", "either, by the angle"])
def test_an_output_moves_by_unit_reactions_times_where_the_block_rests(name: str) -> None:
    """Superposition, force by height and moment by tilt, against closing the linkage with a tiny clearance."""
    m = slider_crank(LOADS[name], 1e-7)
    found = accuracy(Assembly(m), ANGLES, OUTPUTS, m.clearances)
    for d in OUTPUTS:
        np.testing.assert_allclose(found.nominal(d), found.equilibrium(d), atol=2e-5 * found.worst_case(d).max())
        assert np.all(np.abs(found.nominal(d)) <= found.worst_case(d) * (1 + 1e-12))


def test_the_worst_case_is_the_farthest_of_the_four_corners() -> None:
    m = slider_crank(LOADS["tilted"]).with_clearances({"S": 1e-7, "B": 1e-7})
    found = accuracy(Assembly(m), ANGLES, OUTPUTS, m.clearances)
    rows = {d: found.unit_reactions[d][list(found.pins).index("S")] for d in OUTPUTS}
    ideal = kinematics(Assembly(m), ANGLES)
    moved = []
    for rest in (BlockRest(-1e-7, 0.0), BlockRest(1e-7, 0.0), BlockRest(0.0, -2e-6), BlockRest(0.0, 2e-6)):
        motion = kinematics(Assembly(m).resting({"S": rest}), ANGLES)
        moved.append([d.value(motion) - d.value(ideal) for d in OUTPUTS])
    for d, ways in zip(OUTPUTS, np.array(moved).transpose(1, 0, 2), strict=True):
        by_block = np.abs(ways).max(axis=0)
        by_pin = 1e-7 * np.abs(found.unit_reactions[d][list(found.pins).index("B")])
        np.testing.assert_allclose(found.worst_case(d), by_block + by_pin, rtol=1e-4, atol=1e-13)
        np.testing.assert_allclose(found.sensitivity(d)["S"], by_block / 1e-7, rtol=1e-4, atol=1e-6)
        np.testing.assert_allclose(1e-7 * rows[d].real, ways[0], rtol=1e-4, atol=1e-13)
    x, y = OUTPUTS[1:3]
    far = np.abs(found.farthest(x, y))
    assert np.all(far >= np.maximum(found.worst_case(x), found.worst_case(y)) * (1 - 1e-9))
    assert np.all(far <= np.hypot(found.worst_case(x), found.worst_case(y)) * (1 + 1e-9))


def test_samples_of_a_block_lie_in_its_four_corners() -> None:
    drawn = draw(np.array([1e-4, 1e-4]), np.zeros(2), 40_000, seed=3, blocks=1)
    corners, counts = np.unique(np.round(drawn.directions[1], 9), return_counts=True)
    assert corners.size == 4
    assert counts.min() > 9_700
    assert np.unique(drawn.directions[0]).size > 30_000


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        (lambda m: compare_accuracy(m, nonlinear=True), "joint S is a block"),
        (
            lambda m: validity(m, speeds=[10.0], clearances=[1e-4], joints=["S", "B"]),
            "give each a map of its own",
        ),
        (lambda m: compare_accuracy(m, clearance={"X": 1e-4}), "not a joint that may have clearance"),
        (lambda m: compare_accuracy(m.with_joint("S", guide=None, clearance=0.0), clearance={"S": 1e-4}), "guide ="),
    ],
)
def test_what_is_not_worked_out_of_blocks_is_refused_in_a_sentence(asked: Callable[..., object], says: str) -> None:
    with pytest.raises(ArgumentError, match=says):
        asked(slider_crank(LOADS["tilted"], 1e-4))

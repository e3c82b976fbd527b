"""Matrix structural analysis (Eqs. 1-7) against published numbers, hand calculation, energy theorems and PyNiteFEA."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
import pytest

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import Motion, kinematics
from analytic.mechanism import Drive, Load, Mechanism
from analytic.mechanism.file import load, loads
from analytic.paper.compliance import Compliance, _carry, compliance
from analytic.paper.frame import ComplianceError, ElasticBar, beam_stiffness, frame
from analytic.paper.kinetostatics import kinetostatics

FLAT = ElasticBar(length=0.37, height=0.012, depth=0.03, youngs_modulus=2.1e11, shear_modulus=0.81e11)
STEEL = {"youngs_modulus": 2e11, "section": (0.01, 0.01)}


def at(mechanism: Mechanism, degrees: float | np.ndarray, speed: float = 0.0) -> Motion:
    return kinematics(Assembly(mechanism), np.radians(np.atleast_1d(degrees)), speed)


def flexible_slider_crank() -> Mechanism:
    m = load("slider-crank").with_body("crank", **STEEL).with_body("rod", **STEEL)
    return m.replace(loads=(Load(body="slider", force=(-2000.0, 0.0)),), gravity=(0.0, -9.81))


def quick_return() -> Mechanism:
    """A crank whose pin slides along an oscillating lever: a prismatic joint with a moving guide."""
    return loads("""
        name = "quick-return"
        gravity = [0.0, -9.81]
        ground = { points = { O = [0.0, 0.0], P = [0.0, -0.2] } }
        drive = { joint = "O", speed = 6.0, stiffness = 40.0 }
        body = [
            { name = "crank", points = { O = [0.0, 0.0], A = [0.08, 0.0] }, mass = 0.4 },
            { name = "block", points = { A = [0.0, 0.0], S = [0.01, 0.02] }, mass = 0.1 },
            { name = "lever", points = { P = [0.0, 0.0], S = [0.02, 0.01], tip = [0.35, 0.0] }, mass = 0.8 }
        ]
        joint = [
            { name = "O", type = "revolute", bodies = ["ground", "crank"] },
            { name = "A", type = "revolute", bodies = ["crank", "block"] },
            { name = "P", type = "revolute", bodies = ["ground", "lever"], stiffness = 3.0, rest_angle = 1.0 },
            { name = "S", type = "prismatic", bodies = ["lever", "block"], axis = [1.0, 0.1], angle = 0.3, \
stiffness = 50.0, rest_angle = 0.1 }
        ]
        load = [{ body = "lever", point = "tip", force = [30.0, 5.0] }]
        assembly = { crank = 0.4, lever = 1.1, block = 1.4 }
    """)


# ---------------------------------------------------------------- the element


def test_beam_has_rank_six_and_no_force_in_its_six_rigid_motions() -> None:
    k = beam_stiffness(FLAT)
    origin = np.eye(6)
    end = np.eye(6)  # motion of the second end when the first moves by a unit
    end[1, 5], end[2, 4] = FLAT.length, -FLAT.length
    rigid = np.vstack([origin, end])
    assert np.linalg.matrix_rank(k, tol=1e-9 * np.abs(k).max()) == 6
    assert np.abs(k @ rigid).max() < 1e-15 * np.abs(k).max()
    assert np.array_equal(k, k.T)


def test_beam_is_the_element_matrix_of_pynite() -> None:
    pynite = pytest.importorskip("Pynite")
    model = pynite.FEModel3D()
    model.add_material("steel", FLAT.youngs_modulus, FLAT.shear_modulus, 0.3, 0.0)
    model.add_section("flat", FLAT.area, FLAT.i_y, FLAT.i_z, FLAT.torsion_constant)
    model.add_node("i", 0, 0, 0)
    model.add_node("j", FLAT.length, 0, 0)
    model.add_member("bar", "i", "j", "steel", "flat")
    np.testing.assert_allclose(beam_stiffness(FLAT), model.members["bar"].ke(), rtol=1e-14, atol=0)


@pytest.mark.parametrize(("ratio", "factor"), [(1.0, 0.1406), (1.5, 0.196), (2.0, 0.229), (4.0, 0.281), (10.0, 0.312)])
def test_torsion_constant_is_that_of_timoshenko_goodier_table_of_article_109(ratio: float, factor: float) -> None:
    for height, depth in ((0.01, 0.01 * ratio), (0.01 * ratio, 0.01)):
        bar = ElasticBar(1.0, height, depth, 1.0, 1.0)
        assert bar.torsion_constant == pytest.approx(factor * 0.01**4 * ratio, rel=2e-3)


# ---------------------------------------------------------------- the paper's linkage


def test_paper_notes_displacements_at_30_degrees() -> None:
    found = compliance(at(load("paper"), 30.0))
    expected = {
        "A": -0.346627 + 0.599875j,
        "com": -0.347060 + 1.001376j,
        "B": -0.347493 + 0.602877j,
    }  # mm, three nodes of the coupler
    for point, value in expected.items():
        assert abs(found.displacement("coupler", point)[0] * 1e3 - value) < 1e-6
    assert abs(found.displacement("crank", "A") - found.displacement("coupler", "A"))[0] == pytest.approx(
        abs(43.3013 - 25j) / 2e11, rel=1e-3
    )


def by_hand(theta: np.ndarray, direction: complex, force: float = 50.0) -> np.ndarray:
    """Displacement (m) along ``direction`` of the paper's coupler com, by virtual forces on a statically determinate
    linkage.

    The follower is a two-force member, so the coupler's balance gives all forces; then sum N n L/EA + integral M m/EI +
    R r/k.
    """
    e, area, moment, k, crank, coupler = 2e11, 1e-4, 1e-8 / 12, 2e11, 0.2, 0.4
    along = np.exp(1j * theta)

    def internal(load: complex) -> tuple[np.ndarray, ...]:
        at_b = load.imag / 2 / np.sin(theta) * along  # coupler on follower
        at_a = at_b - load  # crank on coupler
        return at_b, at_a, (-at_a * along.conj()).real, (-at_a * along.conj()).imag, (at_b * along.conj()).real

    (b, a, n2, t2, n4), (b1, a1, n21, t21, n41) = internal(1j * force), internal(direction)
    axial = (n2 * n21 + n4 * n41) * crank + (a.real * a1.real + b.real * b1.real) * coupler / 2
    bending = t2 * t21 * crank**3 / 3 + (a.imag * a1.imag + b.imag * b1.imag) * (coupler / 2) ** 3 / 3
    springs = 2 * ((a * a1.conj()).real + (b * b1.conj()).real)  # D carries what A does, E what B does
    return axial / (e * area) + bending / (e * moment) + springs / k


def test_whole_four_bar_is_castiglianos_over_the_sweep() -> None:
    motion = at(load("paper"), np.arange(20.0, 161.0, 5.0))
    found = compliance(motion).displacement("coupler")
    np.testing.assert_allclose(found.real, by_hand(motion.theta, 1 + 0j), rtol=1e-7, atol=1e-12)
    np.testing.assert_allclose(found.imag, by_hand(motion.theta, 1j), rtol=1e-7)


def test_blocks_of_a_long_sweep_join_without_a_seam() -> None:
    motion = at(load("paper"), np.linspace(20.0, 160.0, 600))
    found = compliance(motion).displacement("coupler")
    np.testing.assert_allclose(found.imag, by_hand(motion.theta, 1j), rtol=1e-7)


def test_planar_loads_leave_the_plane_alone() -> None:
    for name in ("paper", "six-bar"):
        found = compliance(at(load(name), 40.0))
        out_of_plane, in_plane = (
            max(np.abs(motion[:, i]).max() for motion in found.motions.values()) for i in ([2, 3, 4], [0, 1, 5])
        )
        assert out_of_plane < 1e-9 * in_plane


def test_springs_of_the_paper_differ_from_rigid_joints_by_what_they_give() -> None:
    rigid = load("paper")
    for joint in "DABE":
        rigid = rigid.with_joint(joint, elasticity=None)
    stiff, springy = (compliance(at(m, 70.0)).displacement("coupler")[0] for m in (rigid, load("paper")))
    assert 0 < abs(springy - stiff) < 1e-9


# ---------------------------------------------------------------- energy theorems


@pytest.mark.parametrize("name", ["paper", "six-bar"])
def test_work_of_the_loads_is_twice_the_strain_energy(name: str) -> None:
    mechanism = load(name).replace(gravity=(3.0, -9.81))
    found = compliance(at(mechanism, np.array([25.0, 80.0, 150.0])))
    work = sum(
        (np.conj(b.mass * complex(*mechanism.gravity)) * found.displacement(b.name)).real for b in mechanism.bodies
    )
    for given in mechanism.loads:
        force = np.conj(complex(*given.force)) * found.displacement(given.body, given.point)
        work = work + force.real + given.torque * found.rotation(given.body, given.point)
    np.testing.assert_allclose(work, 2 * found.energy, rtol=1e-7)


def test_maxwells_reciprocity_between_any_two_points() -> None:
    bare = load("six-bar").replace(gravity=(0.0, 0.0))
    places = [
        ("crank", "A", 1 + 0j),
        ("coupler", "C", 1j),
        ("link", "com", 0.6 + 0.8j),
        ("rocker", "F", -1j),
        ("follower", "com", 1 + 0j),
    ]
    results = [
        compliance(at(bare.replace(loads=(Load(body=b, point=p, force=(d.real, d.imag)),)), 65.0)) for b, p, d in places
    ]
    flexibility = np.array([[(np.conj(d) * r.displacement(b, p)[0]).real for b, p, d in places] for r in results])
    np.testing.assert_allclose(flexibility, flexibility.T, rtol=0, atol=1e-9 * np.abs(flexibility).max())
    assert np.linalg.eigvalsh((flexibility + flexibility.T) / 2).min() > 0


def test_rigid_linkage_does_not_move_at_all() -> None:
    paper = load("paper")
    for part in ("crank", "coupler", "follower"):
        paper = paper.with_body(part, youngs_modulus=None)
    for joint in "DABE":
        paper = paper.with_joint(joint, elasticity=None)
    slider = load("slider-crank").replace(loads=(Load(body="slider", force=(-500.0, 20.0)),), gravity=(0.0, -9.81))
    for mechanism in (paper, slider, load("pendulum")):
        found = compliance(at(mechanism, np.array([40.0, 110.0])))
        assert all(np.array_equal(motion, np.zeros((2, 6))) for motion in found.motions.values())


# ---------------------------------------------------------------- rigid bodies on springs


def test_a_drive_that_is_free_has_no_stiffness() -> None:
    """The crank whose angle is asked for stays there, as in every engine."""
    m = load("paper")
    soft = m.replace(drive=Drive(joint=m.drive_joint.name, speed="free", stiffness=300.0))
    held = compliance(at(m, np.array([30.0])), inertia=False).displacement("coupler", "B")
    np.testing.assert_array_equal(
        compliance(at(soft, np.array([30.0])), inertia=False).displacement("coupler", "B"), held
    )


@pytest.mark.parametrize("mechanism", [load("six-bar"), flexible_slider_crank(), quick_return()], ids=lambda m: m.name)
def test_elastic_drive_moves_a_rigid_linkage_along_its_own_kinematics(mechanism: Mechanism) -> None:
    for body in mechanism.bodies:
        mechanism = mechanism.with_body(body.name, youngs_modulus=None)
    stiffness = 300.0
    mechanism = mechanism.replace(drive=Drive(joint=mechanism.drive_joint.name, speed=1.0, stiffness=stiffness))
    degrees = np.array([35.0, 100.0, 170.0])
    unit = at(mechanism, degrees, 1.0)
    for joint in mechanism.joints:  # joint springs resist too, by the square of how fast they wind up
        if joint.prismatic:
            stiffness = stiffness + joint.stiffness * unit.slip(joint) ** 2
        else:
            first, second = (unit.angular_velocity(b) for b in joint.bodies)
            stiffness = stiffness + joint.stiffness * (second - first) ** 2
    turn = -kinetostatics(at(mechanism, degrees), inertia=False).drive_torque / stiffness
    found = compliance(at(mechanism, degrees))
    for body, point in found.motions:
        np.testing.assert_allclose(
            found.displacement(body, point), turn * unit.velocity(body, point), rtol=0, atol=1e-13
        )
        np.testing.assert_allclose(found.rotation(body, point), turn * unit.angular_velocity(body), rtol=0, atol=1e-12)
    assert np.abs(turn).min() > 1e-6


def test_slider_on_an_elastic_guide_gives_way_as_the_wall_force_demands() -> None:
    k, force = 1e7, -800.0
    m = load("slider-crank").replace(loads=(Load(body="slider", force=(force, 0.0)),))
    motion = at(m.with_joint("S", elasticity={"translation": k, "rotation": 1e5}), np.array([40.0, 75.0]))
    slope = np.tan(-motion.angle("rod"))  # force on the guide = slope times force along it
    slider = compliance(motion).displacement("slider")
    np.testing.assert_allclose(slider.imag, force * slope / k, rtol=1e-12)
    np.testing.assert_allclose(slider.real, force * slope**2 / k, rtol=1e-12)


def test_rigid_arm_carries_a_motion_as_omega_cross_r() -> None:
    rng = np.random.default_rng(3)
    translation, rotation, arm = rng.normal(size=3), rng.normal(size=3), 0.3 - 0.7j
    carried = _carry(np.array([arm]))[0] @ np.concatenate([translation, rotation])
    expected = translation + np.cross(rotation, [arm.real, arm.imag, 0.0])
    np.testing.assert_allclose(carried, np.concatenate([expected, rotation]), rtol=1e-14)


# ---------------------------------------------------------------- bars of a body


def test_com_beside_its_bar_loads_it_with_its_moment() -> None:
    height, depth, e = 0.012, 0.03, 2e11  # bending in the plane goes with the height's cube
    bar = load("pendulum").with_body("pendulum", youngs_modulus=e, section=(height, depth), com=(0.15, 0.02))
    found = compliance(at(bar.replace(loads=(Load(body="pendulum", force=(100.0, 0.0)),), gravity=(0.0, 0.0)), 0.0))
    turn = -100.0 * 0.02 * 0.15 / (e * depth * height**3 / 12)  # of the foot at 0.15 m: M L / EI
    assert found.rotation("pendulum", "tip")[0] == pytest.approx(turn, rel=1e-9)
    assert found.displacement("pendulum", "tip")[0].imag == pytest.approx(turn * (0.15 / 2 + 0.15), rel=1e-9)
    assert found.displacement("pendulum")[0].real == pytest.approx(
        100 * 0.15 / (e * height * depth) - turn * 0.02, rel=1e-9
    )


def test_ternary_link_is_a_star_and_points_within_the_bar_a_chain() -> None:
    star = frame(next(b for b in load("six-bar").bodies if b.name == "coupler"))
    assert [bar[:2] for bar in star.bars] == [(0, 1), (0, 2), (0, 3)]
    assert all(arm == 0 for _, arm in star.places.values())
    near = load("six-bar").with_body(
        "coupler", points={"A": (0.0, 0.0), "B": (0.12, 0.0), "C": (0.03, 0.004)}, com=(0.06, 0.0)
    )
    chain = frame(next(b for b in near.bodies if b.name == "coupler"))
    assert chain.nodes == pytest.approx((0, 0.03, 0.06, 0.12))
    assert chain.places["C"] == (1, pytest.approx(0.004j))
    assert sum(bar.length for *_, bar in chain.bars) == pytest.approx(0.12)


def test_inertia_is_what_kinetostatics_calls_it() -> None:
    m = load("crank-rocker")
    motion = at(m, np.arange(0.0, 360.0, 30.0), 31.4)
    built_in = compliance(motion, inertia=True)
    assert np.abs(built_in.displacement("coupler")).max() > 1e-7
    for k in range(motion.theta.size):
        loads = [
            Load(body=b.name, force=(force.real, force.imag), torque=-b.moment_of_inertia * spin_up)
            for b in m.bodies
            for force in [-b.mass * motion.acceleration(b.name)[k]]
            for spin_up in [float(motion.angular_acceleration(b.name)[k])]
        ]
        given = compliance(at(m.replace(loads=(*m.loads, *loads)), np.arange(0.0, 360.0, 30.0)[k : k + 1], 31.4))
        for key, moved in built_in.motions.items():
            np.testing.assert_allclose(given.motions[key][0], moved[k], rtol=0, atol=1e-18)


# ---------------------------------------------------------------- PyNiteFEA


def referee(
    motion: Motion,
    chains: list[list[tuple[str, str]]],
    supports: Mapping[tuple[str, str], str],
    forces: Mapping[tuple[str, str], complex],
) -> dict[tuple[str, str], complex]:
    """Displacements by PyNiteFEA of bars along ``chains`` of (body, point), first crank angle.

    The first body that comes to a joint's place owns the node there; later ones are pinned to it by a release.
    """
    pynite = pytest.importorskip("Pynite")
    model = pynite.FEModel3D()
    model.add_material("steel", 2e11, 0.8e11, 0.25, 0.0)
    model.add_section("square", 1e-4, 1e-8 / 12, 1e-8 / 12, 0.1406e-8)
    owner: dict[str, str] = {}

    def node(body: str, point: str) -> str:
        return f"{body}.com" if point == "com" else point

    for chain in chains:
        for body, point in chain:
            if node(body, point) not in owner:
                place = complex(motion.position(body, point)[0])
                owner[model.add_node(node(body, point), place.real, place.imag, 0.0)] = body
        for (body, p), (_, q) in pairwise(chain):
            i, j = node(body, p), node(body, q)
            model.add_member(f"{body}:{i}-{j}", i, j, "steel", "square")
            model.def_releases(f"{body}:{i}-{j}", Rzi=owner[i] != body, Rzj=owner[j] != body)
    for (body, point), held in supports.items():
        model.def_support(node(body, point), held != "roller", True, True, True, True, held == "clamp")
    for (body, point), value in forces.items():
        model.add_node_load(node(body, point), "FX", value.real)
        model.add_node_load(node(body, point), "FY", value.imag)
    model.analyze_linear()
    places = {place for chain in chains for place in chain}
    return {
        (b, p): model.nodes[node(b, p)].DX["Combo 1"] + 1j * model.nodes[node(b, p)].DY["Combo 1"] for b, p in places
    }


@pytest.mark.parametrize("degrees", [35.0, 140.0, 260.0])
def test_six_bar_is_pynites(degrees: float) -> None:
    mechanism = load("six-bar").replace(loads=(Load(body="rocker", point="com", force=(40.0, -15.0)),))
    motion = at(mechanism, degrees)
    chains = [
        [(body, p) for p in (a, "com", b)]
        for body, a, b in (("crank", "D", "A"), ("follower", "E", "B"), ("link", "C", "F"), ("rocker", "G", "F"))
    ]
    star = [[("coupler", "com"), ("coupler", p)] for p in "ABC"]
    forces = {(b.name, "com"): b.mass * complex(*mechanism.gravity) for b in mechanism.bodies}
    forces["rocker", "com"] += 40.0 - 15.0j
    supports = {("crank", "D"): "clamp", ("follower", "E"): "pin", ("rocker", "G"): "pin"}
    _compare(compliance(motion), referee(motion, [*chains, *star], supports, forces), points=16)


@pytest.mark.parametrize("degrees", [35.0, 140.0, 260.0])
def test_slider_crank_is_pynites(degrees: float) -> None:
    mechanism = flexible_slider_crank()
    motion = at(mechanism, degrees)
    chains = [[("crank", p) for p in ("O", "com", "A")], [("rod", p) for p in ("A", "com", "B")]]
    forces = {(name, "com"): m * -9.81j for name, m in (("crank", 0.30), ("rod", 0.21))} | {
        ("rod", "B"): -2000.0 - 0.14 * 9.81j
    }
    supports = {("crank", "O"): "clamp", ("rod", "B"): "roller"}
    _compare(compliance(motion), referee(motion, chains, supports, forces), points=6)


def _compare(found: Compliance, expected: Mapping[tuple[str, str], complex], points: int) -> None:
    assert len(expected) == points
    size = max(abs(value) for value in expected.values())
    for (body, point), value in expected.items():
        assert abs(found.displacement(body, point)[0] - value) < 1e-8 * size, (body, point)


# ---------------------------------------------------------------- errors


def test_flexible_body_without_a_section_is_named() -> None:
    with pytest.raises(ComplianceError, match=r"body\[rod\]\.section = \[0, 0\] m.*youngs_modulus"):
        compliance(at(load("slider-crank").with_body("rod", youngs_modulus=2e11), 30.0))


def test_point_mass_needs_no_section() -> None:
    mechanism = flexible_slider_crank()
    same = compliance(at(mechanism, 30.0)).displacement("rod")
    assert compliance(at(mechanism.with_body("slider", youngs_modulus=2e11), 30.0)).displacement(
        "rod"
    ) == pytest.approx(same, rel=1e-9)


def test_linkage_too_soft_for_its_loads_is_refused() -> None:
    with pytest.raises(
        ComplianceError, match=r"paper: its loads displace it by more than its own size \(0.4 m\).*30 deg"
    ):
        compliance(at(load("paper").with_body("coupler", youngs_modulus=2e5), 30.0))


def test_shear_modulus_left_out_is_that_of_a_metal() -> None:
    body = load("paper").with_body("crank", shear_modulus=None).bodies[0]
    assert frame(body).bars[0][2].shear_modulus == pytest.approx(2e11 / 2.6)

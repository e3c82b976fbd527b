"""The compiled code held against numpy, which is its referee: the same numbers to rounding, and the same refusals."""

from __future__ import annotations

import subprocess
import sys
import tracemalloc
import warnings

import numpy as np
import pytest

from analytic.compiled import kernels, run
from analytic.kinematics.assembly import CHANGE_POINT, Assembly, AssemblyError, Walk
from analytic.kinematics.closure import AGREE
from analytic.kinematics.motion import DEAD_CENTRE, Gap, Motion, kinematics, kinematics_by_numpy
from analytic.mechanism import Mechanism
from analytic.mechanism.file import load
from analytic.mechanism.parts import SMALLEST_NUMBER
from analytic.paper.kinetostatics import Reactions, compiled_reactions, kinetostatics, kinetostatics_by_numpy
from linkages import curved_slider, jansen_leg
from random_linkages import WIDE, Ranges, seeded
from several_linkages import CASES, sprung, third_bar, waved
from test_kinematics import FULL_TURN, LINKAGES

ROUNDING = 1e-12  # of a signal's size
CONDITION = 50  # times what a change of the inputs by rounding changes in numpy's own numbers

LINKAGES = LINKAGES | {
    "pendulum": (load("pendulum"), FULL_TURN),
    "curved slider": (curved_slider(), FULL_TURN),
    "Jansen's leg": (jansen_leg(3.0), FULL_TURN),
    "crank-rocker with springs": (sprung(load("crank-rocker")), FULL_TURN),
    "slider-crank with springs": (sprung(load("slider-crank")), FULL_TURN),
    "third bar": (third_bar(), np.radians(np.arange(20.0, 161.0, 3.0))),
}


@pytest.fixture
def always(monkeypatch: pytest.MonkeyPatch) -> None:
    """The compiled code serves at the first call."""
    monkeypatch.setattr(run, "BATCH", 0)
    monkeypatch.setattr(run, "POSES", 0)


def arrays(found: Reactions) -> dict[str, np.ndarray]:
    """All that a motion and its reactions say."""
    motion = found.motion
    told = {
        name: getattr(motion, name)
        for name in ("coordinates", "rates", "accelerations", "columns", "column_rates", "column_accelerations")
    }
    told |= {f"Jacobian {k}": motion.jacobians[group] for k, group in enumerate(motion.structure.groups)}
    told |= {f"force {name}": force for name, force in found.forces.items()}
    told |= {f"moment {name}": moment for name, moment in found.moments.items()}
    return told | {f"drive {k}": effort for k, effort in enumerate(found.efforts)}


def agree(found: Reactions, numpy: Reactions, shaken: Reactions) -> None:
    """Raise AssertionError where two differ by more than rounding; ``shaken`` is what rounded inputs give."""
    assert found.motion.compiled
    assert not numpy.motion.compiled
    assert found.undetermined == numpy.undetermined
    ours, theirs, noise = arrays(found), arrays(numpy), arrays(shaken)
    assert ours.keys() == theirs.keys()
    longest = max(body.length for body in numpy.motion.structure.mechanism.bodies)
    largest = max((np.nanmax(np.abs(f), initial=0.0) for f in numpy.forces.values()), default=0.0)
    for name, values in theirs.items():
        assert ours[name].shape == values.shape
        assert np.array_equal(np.isnan(ours[name]), np.isnan(values)), name
        known = ~np.isnan(values)
        size = np.abs(values[known]).max(initial=0.0)
        if name.startswith(("moment", "drive")):  # many are zero but for the forces that make them
            size = max(size, largest * longest)
        rounding = np.abs((noise[name] - values)[known]).max(initial=0.0)
        assert np.abs((ours[name] - values)[known]).max(initial=0.0) <= ROUNDING * size + CONDITION * rounding, name


def held_against_numpy(
    mechanism: Mechanism, inputs: np.ndarray, omega: np.ndarray | float, alpha: np.ndarray | float,
    gaps: dict[str, Gap] | None = None, inertia: bool = True, grip: np.ndarray | None = None,
) -> None:  # fmt: skip
    def by_numpy(at: np.ndarray) -> Reactions:
        return kinetostatics_by_numpy(
            kinematics_by_numpy(Assembly(mechanism), at, omega, alpha, gaps), inertia, grip
        )  # fmt: skip

    motion = kinematics(Assembly(mechanism), inputs, omega, alpha, gaps)
    assert compiled_reactions(motion, inertia, grip) is not None
    agree(kinetostatics(motion, inertia, grip), by_numpy(inputs), by_numpy(inputs * (1 + 3e-16)))


@pytest.mark.usefixtures("always")
@pytest.mark.parametrize("inertia", [True, False])
@pytest.mark.parametrize("name", LINKAGES)
def test_a_linkage_with_one_crank_gets_the_same_numbers(name: str, inertia: bool) -> None:
    mechanism, theta = LINKAGES[name]
    held_against_numpy(mechanism, theta, 3.0, -7.0, inertia=inertia)


@pytest.mark.long_rows("six-bar driven from the rocker")
@pytest.mark.usefixtures("always")
@pytest.mark.parametrize("name", ["crank-rocker", "inverted slider", "six-bar", "six-bar driven from the rocker"])
def test_so_do_joints_with_gaps_that_move_and_friction_of_which_a_share_acts(name: str) -> None:
    mechanism, theta = LINKAGES[name]
    turning, grip = np.exp(1j * (theta + 0.3)), np.linspace(-1.0, 1.0, theta.size)
    pins = [j.name for j in mechanism.joints if not j.prismatic][:3]
    gaps = {pin: Gap(1e-3 * turning, 5e-3j * turning, -25e-3 * turning + 1e-3) for pin in pins}
    held_against_numpy(mechanism, theta, 3.0, -7.0, gaps, grip=grip)
    held_against_numpy(mechanism, theta, 3.0, -7.0, {pins[0]: Gap(1e-3 * turning)})


@pytest.mark.usefixtures("always")
@pytest.mark.parametrize("name", CASES)
def test_so_does_a_linkage_of_several_drives(name: str) -> None:
    mechanism, courses = CASES[name], waved(CASES[name])
    inputs = Assembly(mechanism).inputs_at({joint: course[1] for joint, course in courses.items()})
    if mechanism.cranked:
        inputs = inputs[0]
    slope = np.gradient(inputs, 0.01, axis=-1)
    held_against_numpy(mechanism, inputs, slope, np.gradient(slope, 0.01, axis=-1))
    held_against_numpy(mechanism, inputs, slope, 0 * slope, inertia=False)


def random_linkage(seed: int) -> Mechanism | None:
    """The linkage of a seed, without friction that grows with reactions; None where it cannot be assembled."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        ranges = Ranges(**{**WIDE.__dict__, "curved": True})
        try:
            m = seeded(seed, ranges)
            m = m.replace(joints=[j.model_copy(update={"friction_radius": 0.0}) for j in m.joints])
            kinematics_by_numpy(Assembly(m), m.assembly[m.driven] + np.linspace(-0.02, 0.02, 21))
        except ValueError:
            return None
    return m


@pytest.mark.usefixtures("always")
@pytest.mark.parametrize("seeds", [range(k, k + 15) for k in range(0, 90, 15)], ids=str)
def test_so_do_random_linkages(seeds: range) -> None:
    made = [m for seed in seeds if (m := random_linkage(seed)) is not None]
    assert len(made) >= 5
    for m in made:
        speed = m.speed or 0.0
        held_against_numpy(m, m.assembly[m.driven] + np.linspace(-0.02, 0.02, 21), speed, 0.3 * speed**2)


@pytest.mark.usefixtures("always")
@pytest.mark.parametrize("count", [1, 2, 503, 504, 505, 1025])
def test_a_batch_of_any_size_gives_each_configuration_the_same_bits(count: int) -> None:
    mechanism, turn = load("six-bar"), np.linspace(-4.0, 9.0, 1025)
    whole = kinetostatics(kinematics(Assembly(mechanism), turn, 3.0, 1.0))
    part = kinetostatics(kinematics(Assembly(mechanism), turn[:count], 3.0, 1.0))
    for name, values in arrays(part).items():
        np.testing.assert_array_equal(values, arrays(whole)[name][..., :count])


@pytest.mark.usefixtures("always")
@pytest.mark.parametrize("scale", [1e5, -3e6, 1e9])
def test_angles_of_many_turns_keep_their_digits(scale: float) -> None:
    theta = scale + np.linspace(0.0, 6.0, 100)
    m, path = load("crank-rocker"), None
    turns = 2 * np.pi * round(scale / (2 * np.pi))
    near = Assembly(m).path(-1.0, 7.5)
    path = type(near)(near.theta + turns, near.coordinates + turns * np.array([[1.0], [0.0], [0.0]]))
    ours = kinematics(Assembly(m), theta, 3.0, path=path)
    theirs = kinematics_by_numpy(Assembly(m), theta, 3.0, path=path)
    assert ours.compiled
    np.testing.assert_allclose(ours.columns, theirs.columns, atol=1e-14)
    np.testing.assert_allclose(ours.coordinates, theirs.coordinates, rtol=1e-14, atol=1e-14)


# ---------------------------------------------------------------- what cannot be done


REFUSED = {
    "a change point": (load("paper"), np.radians([20.0, 181.0])),
    "a change point between two angles": (load("paper"), np.radians(np.arange(20.0, 341.0, 7.0))),
    "not a number": (load("crank-rocker"), np.array([0.5, np.nan])),
    "not a number, of a lone crank": (load("pendulum"), np.array([0.5, np.inf])),
    "out of a larger group's reach": (LINKAGES["six-bar driven from the rocker"][0], np.linspace(1.7, 9.0, 30)),
}


def refusal(call, *arguments, **named) -> AssemblyError:
    with pytest.raises(AssemblyError) as caught:
        call(*arguments, **named)
    return caught.value


@pytest.mark.usefixtures("always")
@pytest.mark.parametrize("what", REFUSED)
def test_what_cannot_be_closed_is_refused_with_the_same_sentence(what: str) -> None:
    mechanism, theta = REFUSED[what]
    ours = refusal(kinematics, Assembly(mechanism), theta, 1.0)
    theirs = refusal(kinematics_by_numpy, Assembly(mechanism), theta, 1.0)
    assert str(ours) == str(theirs)
    np.testing.assert_equal(ours.at, theirs.at)


@pytest.mark.usefixtures("always")
def test_gaps_that_a_linkage_cannot_take_up_are_refused_with_the_same_sentence() -> None:
    mechanism, theta = load("crank-rocker"), np.linspace(0.0, 6.0, 50)
    gaps = {"B": Gap(np.full(50, 0.1 + 0.1j))}
    sentences = [
        str(refusal(call, Assembly(mechanism), theta, gaps=gaps)) for call in (kinematics, kinematics_by_numpy)
    ]
    assert "clearance" in sentences[0]
    assert sentences[0] == sentences[1]


@pytest.mark.usefixtures("always")
@pytest.mark.parametrize("name", ["five-bar", "3-rrr"])
def test_a_way_that_ends_in_a_change_point_is_refused_with_the_same_sentence(name: str) -> None:
    mechanism, t = load(name), np.linspace(0.0, 1.0, 60)
    places = Assembly(mechanism).positions
    inputs = Assembly(mechanism).inputs_at(
        {joint: at + (-1) ** k * 4 * t for k, (joint, at) in enumerate(places.items())}
    )
    sentences = [str(refusal(call, Assembly(mechanism), inputs)) for call in (kinematics, kinematics_by_numpy)]
    assert sentences[0] == sentences[1]


# ---------------------------------------------------------------- following inputs


def wandering(mechanism: Mechanism, samples: int) -> np.ndarray:
    """Inputs (n_inputs, samples) that wander around the assembly, from somewhere beside it."""
    assembly, t = Assembly(mechanism), np.linspace(0.5, 20.0, samples)
    size = {joint: 0.004 if mechanism.joint(joint).prismatic else 0.3 for joint in assembly.positions}
    return assembly.inputs_at(
        {
            joint: at + size[joint] * np.sin(t * (1 + 0.3 * k))
            for k, (joint, at) in enumerate(assembly.positions.items())
        }
    )


@pytest.mark.long_rows("3-rrr-300")
@pytest.mark.parametrize("samples", [1, 7, 300])
@pytest.mark.parametrize("name", ["five-bar", "3-rrr", "3-rpr", "2r-arm"])
def test_inputs_are_followed_as_by_numpy(name: str, samples: int) -> None:
    mechanism = load(name)
    inputs = wandering(mechanism, samples)
    ours = run.followed(Assembly(mechanism), inputs)
    assert ours is not None
    np.testing.assert_allclose(ours, Assembly(mechanism).follow(inputs).coordinates, atol=1e-12)


def beside_the_singular_pose(miss: float) -> np.ndarray:
    """Inputs of the five-bar on whose way, between two of them, its arms come so near (rad) to being stretched."""
    assembly, apart = Assembly(load("five-bar")), np.linspace(0.0, 1.0, 40)
    at = assembly.positions
    return assembly.inputs_at({"D": at["D"] + 1.2 * apart, "E": at["E"] - (1.2 + miss) * apart})


@pytest.mark.usefixtures("always")
@pytest.mark.parametrize("miss", [0.0, 1e-6])
def test_a_change_point_between_two_samples_is_not_stepped_over(miss: float) -> None:
    inputs = beside_the_singular_pose(miss)
    assert run.followed(Assembly(load("five-bar")), inputs) is None
    sentences = [str(refusal(call, Assembly(load("five-bar")), inputs)) for call in (kinematics, kinematics_by_numpy)]
    assert "change point at D = " in sentences[0]
    assert sentences[0] == sentences[1]


def test_a_pose_beside_a_singular_one_is_passed() -> None:
    inputs = beside_the_singular_pose(1e-2)
    ours = run.followed(Assembly(load("five-bar")), inputs)
    assert ours is not None
    np.testing.assert_allclose(ours, Assembly(load("five-bar")).follow(inputs).coordinates, atol=1e-12)


@pytest.mark.usefixtures("always")
def test_a_path_that_is_given_is_used(monkeypatch: pytest.MonkeyPatch) -> None:
    mechanism = load("3-rrr")
    inputs = wandering(mechanism, 50)
    assembly = Assembly(mechanism)
    known = assembly.follow(inputs)
    monkeypatch.setattr(Assembly, "follow", None)
    monkeypatch.setattr(run, "followed", None)
    again = kinematics(assembly, inputs[:, ::-1], path=Walk(known.coordinates[:, ::-1]))
    assert again.compiled
    np.testing.assert_allclose(again.coordinates, known.coordinates[:, ::-1], atol=1e-12)


@pytest.mark.usefixtures("always")
def test_one_row_of_inputs_is_for_all_drives_and_a_path_of_another_length_for_none() -> None:
    assembly, same = Assembly(load("2r-arm")), np.linspace(0.3, 0.4, 30)
    ours, theirs = (call(assembly, same) for call in (kinematics, kinematics_by_numpy))
    assert ours.compiled
    np.testing.assert_allclose(ours.columns, theirs.columns, atol=1e-14)
    short = Walk(ours.coordinates[:, :7])
    for call in (kinematics, kinematics_by_numpy):
        with pytest.raises(ValueError, match="broadcast"):
            call(assembly, same, path=short)


# ---------------------------------------------------------------- when it serves


def test_it_serves_large_batches_and_many_calls() -> None:
    assembly, theta = Assembly(load("crank-rocker")), np.linspace(0.0, 6.0, run.BATCH)
    assert not kinematics(assembly, theta[:-1]).compiled
    assert kinematics(assembly, theta).compiled
    served = [kinematics(assembly, theta[:1]).compiled for _ in range(run.CALLS)]
    assert served == [False] * (run.CALLS - 2) + [True] * 2
    assert not kinematics(Assembly(load("crank-rocker")), theta[:1]).compiled


def test_it_serves_smaller_batches_of_many_linkages() -> None:
    theta = np.linspace(0.0, 6.0, run.BULK)
    with run.in_bulk():
        assert kinematics(Assembly(load("crank-rocker")), theta).compiled
        assert not kinematics(Assembly(load("crank-rocker")), theta[:-1]).compiled
    assert not kinematics(Assembly(load("crank-rocker")), theta).compiled


def test_it_serves_fewer_poses_of_several_drives() -> None:
    assembly = Assembly(load("five-bar"))
    inputs = np.repeat(assembly.inputs[:, None], run.POSES, axis=1)
    assert not kinematics(assembly, inputs[:, 1:]).compiled
    assert kinematics(assembly, inputs).compiled


def test_small_batches_do_not_load_it() -> None:
    program = (
        "import sys, numpy as np\n"
        "from analytic.kinematics.assembly import Assembly\n"
        "from analytic.kinematics.motion import kinematics\n"
        "from analytic.mechanism.file import load\n"
        "from analytic.paper.kinetostatics import kinetostatics\n"
        "kinetostatics(kinematics(Assembly(load('crank-rocker')), np.linspace(0.0, 6.0, 721)))\n"
        "print('numba' in sys.modules)"
    )
    out = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    assert out == "False\n"


@pytest.mark.usefixtures("always")
def test_without_numba_numpy_does_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "analytic.compiled.kernels", None)  # as if its import failed
    run._kernel.cache_clear()
    try:
        found = kinetostatics(kinematics(Assembly(load("crank-rocker")), np.linspace(0.0, 6.0, 20)))
    finally:
        run._kernel.cache_clear()
    assert not found.motion.compiled
    assert np.all(np.isfinite(found.drive_torque))


@pytest.mark.usefixtures("always")
def test_friction_that_grows_with_reactions_is_laid_over_what_compiled_code_balances() -> None:
    held_against_numpy(load("crank-rocker").with_joint("B", friction_radius=2e-3), np.linspace(0.0, 6.0, 20), 3.0, 1.0)
    rough = load("slider-crank").with_joint("S", friction=0.2).with_joint("B", friction=0.1, pin_radius=0.01)
    held_against_numpy(rough, np.linspace(0.0, 6.0, 20), 3.0, 1.0)


def test_a_large_batch_needs_no_memory_beyond_its_results() -> None:
    assembly, theta = Assembly(load("crank-rocker")), np.linspace(0.0, 6.0, 100_000)
    kinetostatics(kinematics(assembly, theta))
    tracemalloc.start()
    found = kinetostatics(kinematics(assembly, theta))
    kept, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert found.motion.compiled
    assert peak - kept < 1e5  # bytes, of 50 MB


@pytest.mark.usefixtures("always")
def test_a_motion_that_may_not_be_written_is_balanced_and_one_without_its_gaps_is_left_to_numpy() -> None:
    motion = kinematics(Assembly(load("crank-rocker")), np.linspace(0.0, 6.0, 30), 3.0)
    torque = kinetostatics(motion).drive_torque
    motion.columns.flags.writeable = False
    np.testing.assert_array_equal(kinetostatics(motion).drive_torque, torque)
    live = motion.part(slice(None), len(motion.structure.bodies))
    assert compiled_reactions(live, True, None) is None


@pytest.mark.usefixtures("always")
def test_part_of_a_motion_is_balanced_as_the_whole() -> None:
    motion: Motion = kinematics(Assembly(load("crank-rocker")), np.linspace(0.0, 6.0, 90), 3.0)
    whole, part = kinetostatics(motion), kinetostatics(motion.part(slice(10, 80, 7)))
    assert part.motion.compiled
    np.testing.assert_array_equal(part.drive_torque, whole.drive_torque[10:80:7])
    group = motion.structure.groups[0]
    np.testing.assert_array_equal(part.motion.jacobians[group], motion.jacobians[group][..., 10:80:7])


def test_the_limits_of_the_compiled_code_are_those_of_numpy() -> None:
    assert kernels.AGREE == AGREE
    assert kernels.DEAD_CENTRE == DEAD_CENTRE
    assert kernels.SMALLEST_NUMBER == SMALLEST_NUMBER
    assert kernels.CHANGE_POINT_SINE**2 == pytest.approx(CHANGE_POINT, rel=1e-15)

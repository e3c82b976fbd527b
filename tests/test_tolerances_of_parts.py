"""Tolerances of a linkage's parts: ISO 286, what they do to outputs and signals, and how many linkages are good."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

import linkage_crosscheck as lc
from analytic.beyond_paper.tolerances import Made, OutputErrors, toleranced_errors
from analytic.kinematics.assembly import Assembly
from analytic.kinematics.closure import AssemblyError
from analytic.kinematics.motion import kinematics
from analytic.kinematics.output import Output
from analytic.mechanism import Mechanism, MechanismError, Tolerance
from analytic.mechanism.file import dumps, load, loads
from analytic.mechanism.fits import DEVIATIONS, FINE, GRADES, SIZES, play
from analytic.mechanism.tolerances import Source, as_made, changed, sources, value
from analytic.paper.superposition import accuracy as accuracy_of
from commands import compare
from compare.faults import ArgumentError

CRANK_ROCKER, SLIDER_CRANK = (
    (Path(__file__).parents[1] / "analytic" / "mechanism" / "cases" / f"{name}.toml").read_text(encoding="utf-8")
    for name in ("crank-rocker", "slider-crank")
)
ROCKER = Output("follower", "angle")
SLIDE = Output("slider", "x")
SAMPLES = 100_000


def stated(text: str, tolerances: str) -> Mechanism:
    """The mechanism of a file with these lines under [tolerances]."""
    return loads(f"{text}\n[tolerances]\n{tolerances}", "file.toml")


def made(m: Mechanism, outputs: list[Output], theta: np.ndarray) -> Made:
    return Made(accuracy_of(Assembly(m), theta, outputs, m.clearances, m.speed or 1.0, True), sources(m))


def errors(
    m: Mechanism, output: Output, theta: list[float], limit: float = math.inf, samples: int = SAMPLES
) -> tuple[OutputErrors, float, float]:
    """What tolerances do to an output, the share of linkages that assemble, and that is within a limit."""
    cycle = accuracy_of(Assembly(m), np.array(theta), [output], m.clearances, m.speed or 1.0, True)
    found = toleranced_errors(cycle, sources(m), samples, 3, {output: limit})
    return found.outputs[output], found.assembled, found.within[output]


def normal(x: float) -> float:
    """Share of a normal distribution below x standard deviations."""
    return (1 + math.erf(x / math.sqrt(2))) / 2


# ---------------------------------------------------------------- ISO 286


ANSI_B4_2 = {  # American National Standard preferred hole basis metric clearance fits, ANSI B4.2-1978, table 2 (um)
    ("H11/c11", 1): (60, 180), ("H9/d9", 1): (20, 70), ("H8/f7", 1): (6, 30), ("H7/g6", 1): (2, 18),
    ("H11/c11", 10): (80, 260), ("H9/d9", 10): (40, 112), ("H8/f7", 10): (13, 50), ("H7/g6", 10): (5, 29),
    ("H11/c11", 25): (110, 370), ("H9/d9", 25): (65, 169), ("H8/f7", 25): (20, 74), ("H7/g6", 25): (7, 41),
    ("H11/c11", 50): (130, 450), ("H9/d9", 50): (80, 204), ("H8/f7", 50): (25, 89), ("H7/h6", 50): (0, 41),
    ("H11/c11", 100): (170, 610), ("H9/d9", 100): (120, 294), ("H8/f7", 100): (36, 125), ("H7/g6", 100): (12, 69),
    ("H11/c11", 200): (240, 820), ("H7/g6", 200): (15, 90),
    ("H11/c11", 500): (480, 1280), ("H9/d9", 500): (230, 540), ("H8/f7", 500): (68, 228), ("H7/g6", 500): (20, 123),
}  # fmt: skip


@pytest.mark.parametrize(("fit", "size"), ANSI_B4_2)
def test_a_fit_leaves_the_clearance_of_ansi_b4_2(fit: str, size: int) -> None:
    least, most = ANSI_B4_2[fit, size]
    assert play(fit, 1e-3 * size) == pytest.approx((1e-6 * least, 1e-6 * most), abs=1e-12)


def test_a_fit_of_the_shaft_basis_leaves_what_the_same_letters_of_the_hole_basis_leave() -> None:
    assert play("G7/h6", 0.01) == play("H7/g6", 0.01)
    assert play("F8/h7", 0.025) == play("H8/f7", 0.025)
    assert play("F8/js6", 0.02) == pytest.approx((13.5e-6, 59.5e-6), abs=1e-12)  # 20 to 53 um less -6.5 to 6.5 um


UNITS = {5: 7, 6: 10, 7: 16, 8: 25, 9: 40, 10: 64, 11: 100, 12: 160, 13: 250}  # of i, ISO 286-1:2010, table A.1
LAWS = {  # um of mm, ISO 286-1:1988, annex A
    "a": lambda d: 265 + 1.3 * d if d <= 120 else 3.5 * d, "b": lambda d: 140 + 0.85 * d if d <= 160 else 1.8 * d,
    "c": lambda d: 52 * d**0.2 if d <= 40 else 95 + 0.8 * d, "d": lambda d: 16 * d**0.44,
    "e": lambda d: 11 * d**0.41, "f": lambda d: 5.5 * d**0.41, "g": lambda d: 2.5 * d**0.34,
}  # fmt: skip


def test_the_tables_are_the_rounded_formulas_of_the_standard() -> None:
    """Each number is within a tenth of its formula at the geometric mean of its step, and grows along its row."""
    for grade, row in GRADES.items():
        assert np.all(np.diff(row) >= 0)
        assert len(row) == len(SIZES)
        for low, high, width in zip(SIZES, SIZES[1:], row[1:], strict=False):
            d = math.sqrt(low * high)
            unit = UNITS.get(grade, math.nan) * (0.45 * np.cbrt(d) + 0.001 * d)
            assert width == pytest.approx(unit, rel=0.1, nan_ok=True) or grade not in UNITS
    for letter, law in LAWS.items():
        row = DEVIATIONS[letter]
        steps = SIZES if len(row) == len(SIZES) else FINE
        assert np.all(np.diff(row) >= 0)
        assert len(row) == len(steps)
        for low, high, deviation in zip(steps, steps[1:], row[1:], strict=False):
            near = 0.15 if letter == "c" else 0.1  # c from 10 to 40 mm is rounded up by an eighth
            assert deviation == pytest.approx(law(math.sqrt(low * high)), rel=near), (letter, high)


def fitted(fit: str, radius: str = "'5 mm'", more: str = "") -> Mechanism:
    begin = 'name = "B"\ntype = "revolute"\n'
    assert begin in CRANK_ROCKER
    return loads(CRANK_ROCKER.replace(begin, f"{begin}pin_radius = {radius}\nfit = {fit!r}\n{more}\n"), "file.toml")


def test_a_fit_gives_a_joint_its_clearance_and_that_its_limits() -> None:
    m = fitted("H7/g6")
    assert m.joint("B").clearance == pytest.approx(8.5e-6, abs=1e-15)  # radial: half of 5 to 29 um
    (source,) = sources(m)
    assert (source.field, source.tolerance.shape) == ("joint.B.clearance", "triangular")
    assert source.ends == pytest.approx((2.5e-6, 14.5e-6), abs=1e-15)
    assert [each.field for each in lc.analyse(m, angles=[1.0]).assumed if "clearance" in each.field] == [
        "joint[B].clearance"
    ]
    assert loads(dumps(m)) == m
    loose = fitted("H8/f7")
    assert m.with_joint("B", fit="H8/f7") == loose
    assert m.with_joint("B", fit=None).joint("B").clearance == m.joint("B").clearance
    tight, swept = lc.sweep(m, {"joint.B.fit": ["H7/g6", "H8/f7"]}, "accuracy", workers=1).points
    alone = lc.sweep(loose, {"joint.B.pin_radius": [5e-3]}, "accuracy", workers=1).points[0]
    assert swept.numbers == alone.numbers
    assert swept.numbers["worst_follower_angle"] > 1.5 * tight.numbers["worst_follower_angle"]
    assert m.tight().clearances == {}
    assert m.with_clearances({"B": 1e-4}).clearances == {"B": 1e-4}
    bore, pin = np.random.default_rng(1).random((2, 200_000))  # um, uniform between their limits each
    assert source.sd == pytest.approx(1e-6 * np.std(15 * bore + 9 * pin) / 2, rel=0.04)


@pytest.mark.parametrize(
    ("fit", "radius", "more", "why"),
    [
        ("H7/p6", "5e-3", "", "joint[B].fit = 'H7/p6': it is a transition or interference fit"),
        ("JS7/h6", "5e-3", "", "at 10 mm it leaves -7.5 to 16.5 um"),
        ("H7g6", "5e-3", "", "give the bore's class and the pin's"),
        ("H7/q6", "5e-3", "", "there is no letter 'q'"),
        ("H19/g6", "5e-3", "", "there is no grade 19"),
        ("H7/g6", "0.3", "", "fits are of pins from 1 to 500 mm across, and this one has 600 mm"),
        ("H7/g6", "5e-3", "clearance = 1e-4", "limits 2.5e-06 to 1.45e-05 m, but the file says 0.0001"),
        ("H7/g6", "5e-3\n#", "", ""),
    ],
)
def test_a_fit_that_cannot_be_is_refused_in_a_sentence(fit: str, radius: str, more: str, why: str) -> None:
    if not why:
        assert fitted(fit, radius).joint("B").fit == fit  # the row above all others differ from in one thing
        return
    with pytest.raises(MechanismError) as refused:
        fitted(fit, radius, more)
    assert why in str(refused.value)
    assert str(refused.value).startswith("file.toml: ")
    assert "\n" not in str(refused.value)


@pytest.mark.mujoco
def test_an_engine_in_units_of_its_own_has_the_clearance_of_a_fit() -> None:
    """Of a linkage a hundred times as small, whose units are, too: the same as with that clearance in the file."""
    text = re.sub(r"(?<=[\[ ])0\.(\d+)(?=[,\]])", r"0.00\1", CRANK_ROCKER)
    text += '\n[[load]]\nbody = "follower"\nforce = [-5.0, -3.0]\n'
    begin = 'name = "B"\ntype = "revolute"\n'
    m = loads(text.replace(begin, f'{begin}pin_radius = "1 mm"\nfit = "H7/g6"\n'))
    plain = loads(text.replace(begin, f"{begin}clearance = 4e-6\n"))
    assert m.joint("B").clearance == pytest.approx(5e-6)
    one, other = (
        lc.simulate(
            each.with_clearances({"B": 4e-6}) if each is m else each,
            joint_model="contact",
            motion="static",
            angles=[1.0],
        )
        for each in (m, plain)
    )
    assert one["clearance_B_x"] == pytest.approx(other["clearance_B_x"], rel=1e-9)
    fitted_gap = lc.simulate(m, joint_model="contact", motion="static", angles=[1.0])
    sizes = [float(np.hypot(each["clearance_B_x"], each["clearance_B_y"])[0]) for each in (one, fitted_gap)]
    assert sizes[1] - sizes[0] == pytest.approx(1e-6, rel=1e-3)


def test_a_fit_needs_a_pin() -> None:
    text = CRANK_ROCKER.replace('name = "B"\ntype = "revolute"\n', 'name = "B"\ntype = "revolute"\nfit = "H7/g6"\n')
    with pytest.raises(MechanismError, match="a fit is of a diameter; give the joint's pin_radius"):
        loads(text)
    with pytest.raises(MechanismError, match="a fit is of a pin in its bore"):
        loads(SLIDER_CRANK.replace('type = "prismatic"', 'type = "prismatic"\nfit = "H7/g6"'))


# ---------------------------------------------------------------- what a file may say


MALFORMED = {
    '"body.crank.mas" = { sd = 0.001 }': "[body.crank.mas] is of no number of this mechanism; did you mean 'mass'",
    '"body.kurbel.mass" = { sd = 0.001 }': "there are crank, coupler, follower",
    '"crank.mass" = { sd = 0.001 }': "[crank.mass] is of no number of this mechanism; did you mean 'body.crank.mass'?",
    "body.crank.mass = { sd = 0.001 }": "write each field whole and in quotes",
    '"body.crank.mass" = 0.001': "tolerances.body.crank.mass = 0.001: give a table with the fields sd, limits",
    '"body.crank.mass" = { sd = -0.001 }': "tolerances.body.crank.mass.sd = -0.001: input should be greater than 0",
    '"body.crank.mass" = { sd = "1 mm" }': "tolerances[body.crank.mass].sd = '1 mm' has unit 'mm', which is of another",
    '"body.crank.mass" = { sd = 0.1 }': "the file's 0.03925 less or more 3 sd, which cannot be",
    '"body.crank.mass" = { limits = [-0.001, 0.05] }': "may be -0.001, a limit, which cannot be",
    '"body.crank.mass" = { limits = [0.04, 0.05] }': "limits are the smallest and the largest value, not deviations",
    '"body.crank.mass" = { limits = [0.05, 0.03] }': "are not in order",
    '"body.crank.mass" = { limits = [0.03, 0.05], sd = 0.01 }': "give a tolerance either sd or limits",
    '"body.crank.mass" = { sd = 0.001, distribution = "cauchy" }': "input should be 'uniform', 'triangular' or",
    '"body.crank.mass" = { sd = 0.001, group = "" }': "group is empty",
    '"body.crank.inertia" = { sd = 1e-7 }': "the file gives no inertia there; give it, then its tolerance",
    '"body.coupler.points.B" = { sd = 1e-5 }': "end it with .x or .y",
    '"body.coupler.points.Q.x" = { sd = 1e-5 }': "name a point, one of A, B",
    '"joint.B.clearance" = { sd = 1e-6 }': "the file gives no clearance there",
    '"load.1.torque" = { sd = 1e-6 }': "there are none",
}


@pytest.mark.parametrize("line", MALFORMED)
def test_a_tolerance_that_cannot_be_is_refused_in_a_sentence(line: str) -> None:
    with pytest.raises(MechanismError) as refused:
        stated(CRANK_ROCKER, line)
    assert MALFORMED[line] in str(refused.value)
    assert str(refused.value).startswith("file.toml: ")
    assert "\n" not in str(refused.value)


def test_every_number_that_may_vary_is_read_and_written() -> None:
    m = load("slider-crank").replace(gravity=(0.0, -9.81))
    fields = [
        *("body.crank.mass", "body.crank.inertia", "body.crank.com.y", "body.rod.points.B.x", "body.rod.length"),
        *("joint.B.pin_radius", "joint.O.damping", "ground.points.S.y", "drive.speed", "drive.O.speed", "gravity.y"),
    ]
    for field in fields:
        assert value(changed(m, {field: value(m, field) + 0.25}), field) == pytest.approx(value(m, field) + 0.25)
    assert changed(m, {"body.rod.length": 0.1}).moving["rod"].points["B"] == (0.1, 0.0)


def test_strings_with_units_are_what_numbers_are() -> None:
    written = '"body.crank.length" = { limits = ["49.9 mm", "50.1 mm"] }\n"drive.speed" = { sd = "2 rpm" }'
    plain = f'"body.crank.length" = {{ limits = [0.0499, 0.0501] }}\n"drive.speed" = {{ sd = {2 * math.pi / 30!r} }}'
    for one, other in zip(sources(stated(CRANK_ROCKER, written)), sources(stated(CRANK_ROCKER, plain)), strict=True):
        assert one.ends == pytest.approx(other.ends, rel=1e-12)


@pytest.mark.parametrize(
    "tolerance",
    [
        Tolerance(sd=2e-4),
        Tolerance(sd=2e-4, distribution="uniform"),
        *(Tolerance(limits=(0.049, 0.0505), distribution=shape) for shape in ("uniform", "triangular", "normal")),
    ],
)
def test_a_distribution_has_the_moments_that_it_says(tolerance: Tolerance) -> None:
    source = Source("body.crank.length", 0.05, "m", tolerance)
    shares = (np.arange(400_000) + 0.5) / 400_000
    drawn = source.at(shares)
    assert np.all(np.diff(drawn) >= 0)
    assert drawn.mean() == pytest.approx(source.mean, rel=1e-9)
    assert drawn.std() == pytest.approx(source.sd, rel=1e-4)
    if tolerance.limits is not None:
        assert tolerance.limits[0] <= drawn[0] < drawn[-1] <= tolerance.limits[1]


# ---------------------------------------------------------------- a stack-up in closed form


STACK = '"body.crank.length" = { sd = "0.03 mm" }\n"body.rod.length" = { limits = ["119.9 mm", "120.1 mm"] }'


def test_a_slider_crank_in_line_is_a_stack_of_its_two_lengths() -> None:
    """At crank angle 0 the slider is at r + l, whatever the lengths: a sum of a normal and a uniform number."""
    r, half, limit = 3e-5, 1e-4, 8e-5
    found, assembled, within = errors(stated(SLIDER_CRANK, STACK), SLIDE, [0.0], limit)
    sigma = math.hypot(r, half / math.sqrt(3))
    assert found.slope["body.crank.length"] == pytest.approx([1.0], abs=1e-12)
    assert found.sd == pytest.approx([sigma], rel=1e-9)
    assert found.sigma == pytest.approx([sigma], rel=4 / math.sqrt(2 * SAMPLES))
    assert found.mean == pytest.approx([0.0], abs=4 * sigma / math.sqrt(SAMPLES))
    at = np.linspace(-half, half, 20_001)  # the uniform part
    good = float(np.mean([normal((limit - x) / r) - normal((-limit - x) / r) for x in at.tolist()]))
    assert within == pytest.approx(good, abs=4 * math.sqrt(good * (1 - good) / SAMPLES))
    assert assembled == 1.0
    shares = np.array([r**2, half**2 / 3]) / sigma**2
    for index in (found.first, found.total):
        assert list(index.values()) == pytest.approx(shares, abs=0.03)


def test_what_varies_together_adds_up_and_what_varies_alone_adds_squared() -> None:
    alone = '"body.crank.length" = { sd = 3e-5 }\n"body.rod.length" = { sd = 4e-5 }'
    together = alone.replace("-5 }", '-5, group = "lot" }')
    for text, sigma in ((alone, 5e-5), (together, 7e-5)):
        found, _, _ = errors(stated(SLIDER_CRANK, text), SLIDE, [0.0])
        assert found.sd == pytest.approx([sigma], rel=1e-9)
        assert found.sigma == pytest.approx([sigma], rel=4 / math.sqrt(2 * SAMPLES))
    assert list(found.by_group) == ["lot"]


def test_what_varies_together_may_cancel() -> None:
    """At crank angle pi the slider is at l - r: a lot of equally long errors leaves it where it is."""
    text = '"body.crank.length" = { sd = 3e-5, group = "lot" }\n"body.rod.length" = { sd = 3e-5, group = "lot" }'
    m = stated(SLIDER_CRANK, text)
    slope = made(m, [SLIDE], np.array([math.pi])).slopes(SLIDE)
    assert slope["body.crank.length"] == pytest.approx([-1.0], abs=1e-12)
    found, _, _ = errors(m, SLIDE, [math.pi])
    assert abs(found.sigma[0]) < 1e-15
    assert found.sd[0] < 1e-15


# ---------------------------------------------------------------- every linkage against the model built anew


def varied(case: str) -> Mechanism:
    """A case in which every coordinate of every point varies by 10 um."""
    m = load(case).tight()
    fields = [f"ground.points.{p}.{axis}" for p in m.ground.points for axis in "xy"]
    fields += [f"body.{b.name}.points.{p}.{axis}" for b in m.bodies for p in b.points for axis in "xy"]
    return m.replace(tolerances={field: Tolerance(sd=1e-5) for field in fields})


CASES = ("crank-rocker", "paper", "six-bar", "slider-crank", "pendulum")
USUAL = np.radians([35.0, 60.0, 110.0])


def every_output(m: Mechanism) -> list[Output]:
    return [Output(b.name, axis) for b in m.bodies for axis in ("x", "y", "angle")]


def moved(m: Mechanism, values: Mapping[str, float], outputs: list[Output], theta: np.ndarray) -> np.ndarray:
    """Outputs (outputs, N) of the linkage built anew with other numbers."""
    motion = kinematics(Assembly(changed(m, values)), theta)
    return np.array([d.value(motion) for d in outputs])


@pytest.mark.long_rows("six-bar", "slider-crank", "paper")
@pytest.mark.parametrize("case", CASES)
def test_exact_derivatives_are_those_of_the_linkage_built_anew(case: str) -> None:
    m = varied(case)
    outputs, step = every_output(m), 1e-5
    linkages = made(m, outputs, USUAL)
    for source in sources(m):
        high, low = (moved(m, {source.field: source.nominal + way * step}, outputs, USUAL) for way in (1, -1))
        for d, slope in zip(outputs, (high - low) / (2 * step), strict=True):
            exact = linkages.slopes(d).get(source.field, np.zeros(USUAL.size))
            assert exact == pytest.approx(slope, abs=2e-6 * (1 + np.abs(slope).max())), (source.field, d)


@pytest.mark.long_rows("six-bar", "paper")
@pytest.mark.parametrize("case", CASES)
def test_a_sample_is_the_linkage_built_anew(case: str) -> None:
    """By tolerances of a millimetre, hundreds of times what first order bears."""
    m = varied(case)
    m = m.replace(tolerances={field: Tolerance(sd=3e-4) for field in m.tolerances})
    outputs = every_output(m)
    linkages = made(m, outputs, USUAL)
    numbers = linkages.values(np.random.default_rng(5).random((len(linkages.groups), 4)))
    nominal = moved(m, {}, outputs, USUAL)
    for k in range(USUAL.size):
        found = linkages.errors(k, numbers)
        for sample in range(4):
            values = {field: float(number[sample]) for field, number in numbers.items()}
            expected = moved(m, values, outputs, USUAL[k : k + 1])[:, 0] - nominal[:, k]
            assert [found[d][sample] for d in outputs] == pytest.approx(expected, abs=1e-12)


def test_a_larger_group_is_closed_as_the_linkage_built_anew() -> None:
    """A crank that drives a triad, which no dyad closes: four bodies between three pins that are known."""
    m = loads(TRIAD)
    assert not Assembly(m).structure.groups[0].dyad
    outputs, theta = every_output(m), np.array([1.0, 1.2])
    linkages = made(m, outputs, theta)
    numbers = linkages.values(np.random.default_rng(6).random((len(linkages.groups), 3)))
    nominal = moved(m, {}, outputs, theta)
    for k in range(theta.size):
        found = linkages.errors(k, numbers)
        for sample in range(3):
            values = {field: float(number[sample]) for field, number in numbers.items()}
            expected = moved(m, values, outputs, theta[k : k + 1])[:, 0] - nominal[:, k]
            assert [found[d][sample] for d in outputs] == pytest.approx(expected, abs=1e-11)
    for field in m.tolerances:
        high, low = (moved(m, {field: value(m, field) + way * 1e-5}, outputs, theta) for way in (1, -1))
        for d, slope in zip(outputs, (high - low) / 2e-5, strict=True):
            assert linkages.slopes(d).get(field, np.zeros(2)) == pytest.approx(slope, rel=1e-5, abs=1e-5)


TRIAD = """
name = "triad"
ground = { points = { O = [0.0, 0.0], P = [0.5, 0.0], Q = [0.2, 0.6] } }
joint = [
  { name = "O", type = "revolute", bodies = ["ground", "crank"] },
  { name = "D", type = "revolute", bodies = ["crank", "rod"] },
  { name = "A", type = "revolute", bodies = ["rod", "plate"] },
  { name = "B", type = "revolute", bodies = ["plate", "right"] },
  { name = "C", type = "revolute", bodies = ["plate", "left"] },
  { name = "P", type = "revolute", bodies = ["ground", "right"] },
  { name = "Q", type = "revolute", bodies = ["ground", "left"] },
]
drive = { joint = "O", speed = 1.0 }
assembly = { crank = 1.0, rod = 0.7, plate = 0.2, right = 2.0, left = -1.0 }
[[body]]
name = "crank"
points = { O = [0.0, 0.0], D = [0.05, 0.0] }
mass = 1.0
[[body]]
name = "rod"
points = { D = [0.0, 0.0], A = [0.15, 0.0] }
mass = 1.0
[[body]]
name = "plate"
points = { A = [0.0, 0.0], B = [0.3, 0.05], C = [0.1, 0.2] }
mass = 1.0
[[body]]
name = "right"
points = { P = [0.0, 0.0], B = [0.2, 0.0] }
mass = 1.0
[[body]]
name = "left"
points = { Q = [0.0, 0.0], C = [0.25, 0.0] }
mass = 1.0
[tolerances]
"body.plate.points.C.x" = { sd = 2e-4 }
"body.plate.points.B.y" = { sd = 2e-4 }
"ground.points.Q.y" = { sd = 2e-4 }
"body.right.length" = { sd = 2e-4 }
"""


# ---------------------------------------------------------------- first order, and where it fails


LENGTHS = '"body.{}.length" = {{ sd = {:g} }}\n'


def test_first_order_is_the_monte_carlo_where_tolerances_are_small() -> None:
    m = stated(CRANK_ROCKER, "".join(LENGTHS.format(name, 2e-5) for name in ("crank", "coupler", "follower")))
    found, assembled, _ = errors(m, ROCKER, USUAL.tolist())
    assert assembled == 1.0
    np.testing.assert_allclose(found.sigma, found.sd, rtol=4 / math.sqrt(2 * SAMPLES))
    assert np.all(np.abs(found.mean) < 4 * found.sd / math.sqrt(SAMPLES))
    assert np.allclose(found.high - found.low, 2 * 1.959964 * found.sd, rtol=0.02)


def stretched() -> tuple[Mechanism, float]:
    """A four-bar whose crank takes coupler and follower to 0.3 mm short of a straight line, and the crank's angle."""
    m = stated(CRANK_ROCKER, LENGTHS.format("coupler", 2e-4))
    m = m.replace(ground=m.ground.model_copy(update={"points": {"D": (0.0, 0.0), "E": (0.1697, 0.0)}}))
    return m.replace(assembly={"crank": math.pi / 2, "coupler": 0.3, "follower": 2.0}), math.pi


def test_first_order_fails_near_a_dead_centre_and_the_monte_carlo_is_the_closed_form() -> None:
    """The follower's angle by the law of cosines, of a triangle with sides l, 0.10 m and 0.2197 m that is nearly
    flat: over the coupler's length l the angle goes as a root, and below 0.1197 m there is no triangle.
    """
    m, theta = stretched()
    found, assembled, within = errors(m, ROCKER, [theta], 0.05)
    drawn = 0.12 + 2e-4 * np.random.default_rng(11).standard_normal(1_000_000)
    apart, b = 0.2197, 0.10

    def at_e(length: np.ndarray | float) -> np.ndarray:
        return np.arccos((apart**2 + b**2 - np.square(length)) / (2 * apart * b))

    closed = drawn[drawn > apart - b]
    error = at_e(closed) - at_e(0.12)
    assert closed.size / drawn.size == pytest.approx(normal(1.5), abs=2e-3)
    assert assembled == pytest.approx(normal(1.5), abs=4 * math.sqrt(0.933 * 0.067 / SAMPLES))
    assert within == pytest.approx(np.sum(np.abs(error) <= 0.05) / drawn.size, abs=8e-3)
    assert found.sigma == pytest.approx([error.std()], rel=0.02)
    for end, share in ((found.low, 2.5), (found.high, 97.5)):
        assert min(abs(end[0] - x) for x in (np.percentile(error, share), -np.percentile(error, 100 - share))) < 1e-3
    step = 1e-8
    slope = float(at_e(0.12 + step) - at_e(0.12 - step)) / (2 * step)
    assert found.sd == pytest.approx([2e-4 * abs(slope)], rel=1e-5)
    assert abs(found.sigma[0] / found.sd[0] - 1) > 0.05  # which is why there is a Monte Carlo
    assert not found.first  # of what does not assemble there is no variance


def test_sobol_indices_of_a_product_are_its_closed_form() -> None:
    """A pendulum's tip, turned by pi/2 - a little: what its point's y does is nearly all; of a sum first is total."""
    m = load("crank-rocker").replace(
        tolerances={"body.crank.length": Tolerance(sd=1e-4), "ground.points.E.x": Tolerance(sd=2e-4)}
    )
    found, _, _ = errors(m, ROCKER, [1.0])
    parts = {
        name: (found.slope[name][0] * sd) ** 2
        for name, sd in (("body.crank.length", 1e-4), ("ground.points.E.x", 2e-4))
    }
    for name, part in parts.items():
        assert found.first[name] == pytest.approx(part / sum(parts.values()), abs=0.03)
        assert found.total[name] == pytest.approx(found.first[name], abs=0.03)
    # brute force, of the linkage near its dead centre: variance of the mean over all else
    m, theta = stretched()
    m = m.replace(
        tolerances={
            f: Tolerance(limits=(x - 1e-4, x + 1e-4))
            for f, x in (("body.coupler.length", 0.12), ("body.follower.length", 0.1))
        }
    )
    found, assembled, _ = errors(m, ROCKER, [theta])
    assert assembled == 1.0
    linkages = made(m, [ROCKER], np.array([theta]))
    grid = (np.arange(200) + 0.5) / 200
    one, other = (each.ravel() for each in np.meshgrid(grid, grid, indexing="ij"))
    table = linkages.errors(0, linkages.values(np.array([one, other])))[ROCKER].reshape(200, 200)
    first = [table.mean(axis=1).var() / table.var(), table.mean(axis=0).var() / table.var()]
    total = [table.var(axis=0).mean() / table.var(), table.var(axis=1).mean() / table.var()]
    assert list(found.first.values()) == pytest.approx(first, abs=0.03)
    assert list(found.total.values()) == pytest.approx(total, abs=0.03)


def test_samples_come_again_by_their_seed_and_their_number_is_no_matter() -> None:
    m = stated(CRANK_ROCKER, LENGTHS.format("crank", 2e-5) + LENGTHS.format("coupler", 2e-5))
    one, other = (lc.accuracy(m, angles=USUAL, samples=5000, seed=7, outputs="follower.angle") for _ in range(2))
    assert one.tolerances is not None
    assert one.to_json() == other.to_json()
    third = lc.accuracy(m, angles=USUAL, samples=5000, seed=8, outputs="follower.angle")
    assert third.to_json() != one.to_json()


# ---------------------------------------------------------------- clearance as one source


def test_clearance_goes_along_its_reaction() -> None:
    """To first order it is what Eq. 8 has for the clearance's mean, and its spread in proportion."""
    m = fitted("H7/g6")
    found = lc.accuracy(m, angles=USUAL, outputs="follower.angle", samples=SAMPLES)
    assert found.tolerances is not None
    nominal = found.outputs["follower_angle"].nominal
    by = found.tolerances.outputs["follower_angle"]
    sd = sources(m)[0].sd
    np.testing.assert_allclose(by.sd, np.abs(nominal) * sd / 8.5e-6, rtol=1e-9)
    np.testing.assert_allclose(by.monte_carlo.mean, nominal, rtol=5e-3)
    assert list(by.by_source) == ["joint.B.clearance"]


def test_other_clearances_leave_those_tolerances_out_and_say_so() -> None:
    m = fitted("H7/g6")
    found = lc.accuracy(m, angles=USUAL, clearance={"E": 1e-4}, samples=100)
    assert found.tolerances is None
    assert any("left out: tolerances of joint.B.clearance" in each for each in found.warnings)


# ---------------------------------------------------------------- what commands say


def test_signals_vary_as_outputs_do_and_by_what_loads_them() -> None:
    """Of a crank with gravity and a tip mass: torque = m g r cos(angle), in closed form."""
    text = """
name = "lever"
gravity = [0.0, -9.81]
ground = { points = { O = [0.0, 0.0] } }
body = [ { name = "lever", points = { O = [0.0, 0.0], T = [0.4, 0.0] }, mass = 3.0, com = [0.3, 0.0], inertia = 0.1 } ]
joint = [ { name = "O", type = "revolute", bodies = ["ground", "lever"] } ]
load = [ { body = "lever", point = "T", force = [0.0, -20.0] } ]
drive = { joint = "O", speed = 1.0 }
assembly = { lever = 0.0 }
[tolerances]
"body.lever.mass" = { sd = 0.02 }
"body.lever.com.x" = { sd = "2 mm" }
"load.1.force.y" = { limits = [-21.0, -19.0] }
"gravity.y" = { sd = 0.01 }
"""
    theta = np.array([0.0, 0.5, 1.2])
    found = lc.analyse(loads(text), motion="static", angles=theta)
    assert found.tolerances is not None
    torque = found.tolerances.signals["drive_torque"]
    parts = {
        "body.lever.mass": 9.81 * 0.3 * 0.02,
        "body.lever.com.x": 3.0 * 9.81 * 2e-3,
        "load.1.force.y": 0.4 / math.sqrt(3),
        "gravity.y": 3.0 * 0.3 * 0.01,
    }
    assert torque.by_source.keys() == parts.keys()
    for source, part in parts.items():
        np.testing.assert_allclose(torque.by_source[source], part * np.cos(theta), rtol=1e-9)
    np.testing.assert_allclose(torque.sd, math.hypot(*parts.values()) * np.cos(theta), rtol=1e-9)


@pytest.mark.slow
def test_signals_of_linkages_as_made_are_a_product_s_closed_form() -> None:
    """A weight's moment m g r at rest: of two independent numbers, var = r^2 sm^2 + m^2 sr^2 + sm^2 sr^2."""
    text = """
name = "lever"
gravity = [0.0, -10.0]
ground = { points = { O = [0.0, 0.0] } }
body = [ { name = "lever", points = { O = [0.0, 0.0], T = [0.4, 0.0] }, mass = 3.0, com = [0.3, 0.0] } ]
joint = [ { name = "O", type = "revolute", bodies = ["ground", "lever"] } ]
drive = { joint = "O", speed = 1.0 }
assembly = { lever = 0.0 }
[tolerances]
"body.lever.mass" = { sd = 0.4 }
"body.lever.com.x" = { sd = 0.05 }
"""
    found = lc.analyse(loads(text), motion="static", angles=[0.0], samples=4000, seed=2)
    assert found.tolerances is not None
    torque = found.tolerances.signals["drive_torque"]
    assert torque.monte_carlo is not None
    first = (10 * 0.3 * 0.4) ** 2 + (10 * 3.0 * 0.05) ** 2
    np.testing.assert_allclose(torque.sd, [math.sqrt(first)], rtol=1e-9)
    exact = math.sqrt(first + (10 * 0.4 * 0.05) ** 2)
    np.testing.assert_allclose(torque.monte_carlo.sigma, [exact], rtol=4 / math.sqrt(2 * 4000))
    np.testing.assert_allclose(torque.monte_carlo.mean, [0.0], atol=4 * exact / math.sqrt(4000))
    assert found.tolerances.assembled == 1.0


def test_signals_are_asked_at_the_same_angles_of_every_linkage() -> None:
    """A longer ground lets the paper's linkage turn farther, and its own angles are others."""
    m = load("paper").replace(tolerances={"ground.points.E.x": Tolerance(sd=1e-4)})
    found = lc.analyse(m, motion="static", samples=3)
    assert found.tolerances is not None
    by = found.tolerances.signals["coupler_angle"]
    assert by.monte_carlo is not None
    assert by.sd.shape == by.monte_carlo.mean.shape == found.crank_angle.shape


def test_several_drives_signals_vary_over_time() -> None:
    """A mass at rest in a five-bar's arm moves the drives' torques in proportion: sd/m of what the mass alone does."""
    m = load("five-bar").replace(gravity=(0.0, -9.81))
    heavy = m.with_body("left-arm", mass=2 * m.moving["left-arm"].mass)
    times = [0.0, 0.05, 0.1]
    one, other = (lc.analyse(each, motion="static", times=times) for each in (m, heavy))
    sd = 0.01 * m.moving["left-arm"].mass
    stated = lc.analyse(m.replace(tolerances={"body.left-arm.mass": Tolerance(sd=sd)}), motion="static", times=times)
    assert stated.tolerances is not None
    for name in ("drive_torque_D", "drive_torque_E"):
        slope = np.abs(other[name] - one[name]) / m.moving["left-arm"].mass
        np.testing.assert_allclose(stated.tolerances.signals[name].sd, sd * slope, rtol=1e-6)


def test_samples_without_tolerances_are_refused() -> None:
    with pytest.raises(ArgumentError, match="samples: crank-rocker has no tolerances to draw from"):
        lc.analyse("crank-rocker", samples=9)


def test_signals_and_outputs_vary_alike() -> None:
    m = stated(CRANK_ROCKER, LENGTHS.format("crank", 1e-5) + LENGTHS.format("follower", 2e-5))
    signals, outputs = lc.analyse(m, angles=USUAL).tolerances, lc.accuracy(m, angles=USUAL, samples=50).tolerances
    assert signals is not None
    assert outputs is not None
    for name, output in outputs.outputs.items():
        if name in signals.signals:
            np.testing.assert_allclose(signals.signals[name].sd, output.sd, rtol=1e-5, atol=1e-15)
    assert {"follower_angle", "coupler_x"} <= signals.signals.keys() & outputs.outputs.keys()


def test_the_command_says_how_many_linkages_are_good(tmp_path: Path) -> None:
    (tmp_path / "slide.toml").write_text(f"{SLIDER_CRANK}\n[tolerances]\n{STACK}", encoding="utf-8")
    asked = ("accuracy", "--case", "slide.toml", "--output", "slider", "--angles", "0:0:1", "--out", "out")
    done = compare(*asked, "--limit", "slider_x=0.08mm", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "out" / "accuracy.json").read_text(encoding="utf-8"))["tolerances"]
    assert found["outputs"]["slider_x"]["limit"] == pytest.approx(8e-5)
    assert 0.7 < found["outputs"]["slider_x"]["within"] == found["within"] < 0.8
    assert f"{100 * found['within']:.4g} % of the linkages are within the limits" in " ".join(done.stdout.split())
    assert "rod.length" in done.stdout
    page = (tmp_path / "out" / "accuracy.html").read_text(encoding="utf-8")
    told = page[page.index('<section id="tolerances"') :]
    assert f"{100 * found['within']:.4g} % of the linkages are within the limits" in told
    assert "body.rod.length" in told
    limits: tuple[dict[str, float | str], str] = ({"slider_x": 8e-5}, "slider_x=0.08mm")
    for given in limits:
        again = lc.accuracy(tmp_path / "slide.toml", outputs="slider", angles=[0.0], limits=given)
        assert again.tolerances is not None
        assert again.tolerances.within == found["within"]


@pytest.mark.parametrize(("least", "status"), [("70%", 0), ("0.99", 1)])
def test_a_yield_below_the_least_is_status_1_also_in_a_sweep(least: str, status: int, tmp_path: Path) -> None:
    (tmp_path / "slide.toml").write_text(f"{SLIDER_CRANK}\n[tolerances]\n{STACK}", encoding="utf-8")
    asked = ("accuracy", "--case", "slide.toml", "--output", "slider", "--angles", "0:0:1", "--out", "out")
    done = compare(*asked, "--limit", "slider_x=0.08mm", "--min-yield", least, cwd=tmp_path)
    assert done.returncode == status, done.stderr
    assert f"{'no less than the 70' if status == 0 else 'LESS than the 99'} % asked for" in done.stdout
    varied = ("--limit", "slider_x=0.08mm", "--min-yield", least, "--set", "body.slider.mass=1,2", "--overwrite")
    swept = compare(*asked, *varied, cwd=tmp_path)
    assert swept.returncode == status, swept.stderr
    assert "linkages within the limits (%)" in " ".join(swept.stdout.split())
    assert ("2 outside the limits" in swept.stdout) == (status == 1)


def test_a_least_yield_of_no_limit_is_refused(tmp_path: Path) -> None:
    (tmp_path / "slide.toml").write_text(f"{SLIDER_CRANK}\n[tolerances]\n{STACK}", encoding="utf-8")
    done = compare("accuracy", "--case", "slide.toml", "--min-yield", "99%", cwd=tmp_path)
    assert (done.returncode, "give them by --limit" in done.stderr) == (2, True)


@pytest.mark.parametrize(
    ("limit", "why"),
    [
        ("follower_angle=0.5", "follower_angle = 0.5 has no unit; write 0.5deg, or 0.5rad if meant"),
        ("follower_angle=0.1mm", "follower_angle = '0.1mm' has unit 'mm', which is of another dimension"),
        ("follower_angle", "give OUTPUT=VALUE"),
        ("rocker_angle=1deg", "rocker_angle is no output that is looked at; did you mean follower_angle?"),
        ("follower_angle=-1deg", "above 0"),
        ("follower_angle=1deg,follower_angle=2deg", "follower_angle is there twice"),
    ],
)
def test_a_limit_that_cannot_be_is_refused(limit: str, why: str, tmp_path: Path) -> None:
    (tmp_path / "m.toml").write_text(f"{CRANK_ROCKER}\n[tolerances]\n{LENGTHS.format('crank', 1e-5)}", encoding="utf-8")
    done = compare("accuracy", "--case", "m.toml", "--output", "follower.angle", "--limit", limit, cwd=tmp_path)
    assert done.returncode == 2
    assert why in done.stderr
    assert "\n" not in done.stderr.strip()
    assert not (tmp_path / "reports").exists()


def test_a_yield_without_tolerances_is_refused() -> None:
    with pytest.raises(ArgumentError, match="states no tolerance"):
        lc.accuracy("crank-rocker", limits={"follower_angle": 0.1}, min_yield=0.9, samples=9)


def test_lengths_of_what_joints_hold_too_often_cannot_vary() -> None:
    text = """
name = "parallelogram"
ground = { points = { A = [0.0, 0.0], B = [0.2, 0.0], C = [0.4, 0.0] } }
body = [
  { name = "a", points = { A = [0.0, 0.0], D = [0.1, 0.0] }, mass = 1.0 },
  { name = "b", points = { B = [0.0, 0.0], E = [0.1, 0.0] }, mass = 1.0 },
  { name = "c", points = { C = [0.0, 0.0], F = [0.1, 0.0] }, mass = 1.0 },
  { name = "bar", points = { D = [0.0, 0.0], E = [0.2, 0.0], F = [0.4, 0.0] }, mass = 1.0 },
]
joint = [
  { name = "A", type = "revolute", bodies = ["ground", "a"] },
  { name = "B", type = "revolute", bodies = ["ground", "b"] },
  { name = "C", type = "revolute", bodies = ["ground", "c"] },
  { name = "D", type = "revolute", bodies = ["a", "bar"] },
  { name = "E", type = "revolute", bodies = ["b", "bar"] },
  { name = "F", type = "revolute", bodies = ["c", "bar"] },
]
drive = { joint = "A", speed = 1.0 }
assembly = { a = 1.0, b = 1.0, c = 1.0, bar = 0.0 }
[tolerances]
"body.b.length" = { sd = 1e-5 }
"""
    with pytest.raises((AssemblyError, MechanismError), match="joints hold it more often than it needs"):
        lc.accuracy(loads(text), angles=[1.0], samples=9)


def test_a_mechanism_that_states_no_tolerance_is_asked_nothing_of_them() -> None:
    assert lc.accuracy("crank-rocker", clearance={"B": 1e-4}, angles=USUAL, samples=9).tolerances is None
    assert lc.analyse("crank-rocker", angles=USUAL).tolerances is None


def test_one_linkage_as_it_was_made_has_no_tolerances_and_no_fit_that_it_is_beyond() -> None:
    m = fitted("H7/g6").replace(tolerances={"body.crank.mass": Tolerance(sd=1e-3)})
    assert as_made(m) == m.replace(tolerances={})
    worn = as_made(m.with_clearances({"B": 1e-4}))
    assert (worn.joint("B").fit, worn.clearances, worn.tolerances) == (None, {"B": 1e-4}, {})
    assert loads(dumps(worn)).clearances == {"B": 1e-4}
    assert "tolerances" not in dumps(worn)
    plain = load("crank-rocker")
    assert as_made(plain) is plain


@pytest.mark.slow
@pytest.mark.mujoco
def test_what_a_diagnosis_explains_can_be_read_again_whatever_the_drawing_allowed(tmp_path: Path) -> None:
    """The example rig's bearing B is worn far beyond its fit."""
    rig = Path(__file__).parents[1] / "docs" / "example-rig"
    for file in rig.glob("*.*"):
        (tmp_path / file.name).write_bytes(file.read_bytes())
    begin = 'name = "B"\ntype = "revolute"\n'
    text = (rig / "nominal.toml").read_text(encoding="utf-8")
    text = text.replace(begin, f'{begin}pin_radius = "5 mm"\nfit = "H7/g6"\n')
    text += '\n[tolerances]\n"body.coupler.mass" = { sd = "1 g" }\n'
    (tmp_path / "nominal.toml").write_text(text, encoding="utf-8")
    done = compare("diagnose", "measured.toml", "--others", "none", "--out", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "left out: tolerances of example-rig" in (tmp_path / "out" / "diagnosis.json").read_text(encoding="utf-8")
    assert load(tmp_path / "out" / "explained.toml").clearances["B"] == pytest.approx(1.5e-4, rel=0.01)

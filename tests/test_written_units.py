"""Numbers with their units in a mechanism file: each field in its own dimension, and what does not fit named."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast, get_args

import numpy as np
import pint
import pytest

import linkage_crosscheck as lc
from analytic.kinematics.assembly import Assembly
from analytic.mechanism import MechanismError
from analytic.mechanism.file import dumps, load, loads
from analytic.mechanism.parts import Body, Drive, Elasticity, Joint, Load, MechanismPart, Sensor, Spring, Stop
from analytic.mechanism.units import COMMON, SI, UnitError, factor_to_si, powers
from analytic.mechanism.written import (
    BODY,
    DRIVE,
    ELASTICITY,
    JOINT,
    LOAD,
    PRISMATIC,
    REVOLUTE,
    SENSOR,
    SPRING,
    STOP,
    STOPS,
    in_si,
    quantity,
    runs_in_si,
)
from compare.diagnose.data.measured import load_measured
from compare.diagnose.data.measured_file import QUANTITIES, read_file, tolerance_in_si
from compare.diagnose.plan.bench import read_bench
from compare.faults import ArgumentError
from compare.judge.signals import LINE_OF, ToleranceKind
from compare.judge.tolerances import UNITS_OF, ToleranceError, checked_known, load_tolerances
from compare.questions.option import (
    Angle,
    Angles,
    ArgumentKind,
    ByJoint,
    Clearances,
    Part,
    Places,
    Seconds,
    Speeds,
    StepByJoint,
    Times,
)

FILE = """
name = "mine"
gravity = ["0 m/s^2", "-981 cm/s^2"]

[ground]
points = { D = [0.0, 0.0], S = ["0 mm", "1 cm"] }

[[body]]
name = "crank"
points = { D = [0.0, 0.0], A = ["50 mm", 0.0] }
mass = "300 g"
inertia = "1 kg.cm^2"
youngs_modulus = "210 GPa"

[[body]]
name = "rod"
points = { A = [0.0, 0.0], B = ["12 cm", 0.0] }
mass = 0.21

[[body]]
name = "slider"
points = { B = [0.0, 0.0], S = [0.0, 0.0] }
mass = "0.3086471668 lb"

[[joint]]
name = "D"
type = "revolute"
bodies = ["ground", "crank"]
friction_torque = "20 N.mm"
damping = "3 mN.m.s/rad"

[[joint]]
name = "A"
type = "revolute"
bodies = ["crank", "rod"]
clearance = "0.05 mm"

[[joint]]
name = "B"
type = "revolute"
bodies = ["rod", "slider"]
stiffness = "2 N.m/deg"

[[joint]]
name = "S"
type = "prismatic"
bodies = ["ground", "slider"]
axis = [1.0, 0.0]
angle = "0 deg"
damping = "25 N.s/m"
friction_torque = "3 lbf"

[drive]
joint = "D"
speed = "300 rpm"

[[load]]
body = "slider"
force = ["-1 kN", 0.0]
over = "position_S"
table = [["70 mm", 0.9], ["17 cm", 0.0]]

[[load]]
body = "crank"
torque = "2 N.m"
over = "crank_angle"
from = "200 deg"
to = "340 deg"

[assembly]
crank = "30 deg"
rod = "-12 deg"
slider = 0.0
"""


@pytest.mark.parametrize(
    ("file", "typed", "said"),
    [
        ("coupler = 0.98", "coupler = 10 #", 'assembly.coupler says 10.0000; correct it, or is "10 deg" meant?'),
        ('name = "B"', 'name = "B"\nclearance = 0.2', 'radial clearance in m, or with its unit, such as "0.2 mm"'),
        ('name = "B"', 'name = "B"\nclearance = "0,2 mm"', "a valid number, with a point in place of the comma"),
    ],
)
def test_a_number_in_another_unit_or_with_a_comma_is_told_how_to_write_it(file: str, typed: str, said: str) -> None:
    text = (Path(__file__).parents[1] / "analytic/mechanism/cases/crank-rocker.toml").read_text(encoding="utf-8")
    with pytest.raises(ValueError, match=re.escape(said)):
        Assembly(loads(text.replace(file, typed)))


def test_a_file_may_say_its_units() -> None:
    m = loads(FILE)
    crank, _, slider = m.bodies
    assert m.gravity == (0.0, pytest.approx(-9.81))
    assert m.ground.points["S"] == (0.0, pytest.approx(0.01))
    assert crank.points["A"] == (pytest.approx(0.05), 0.0)
    assert (crank.mass, crank.inertia, crank.youngs_modulus) == (0.3, pytest.approx(1e-4), pytest.approx(2.1e11))
    assert slider.mass == pytest.approx(0.14, rel=1e-8)
    assert (m.joint("D").friction_torque, m.joint("D").damping) == (pytest.approx(0.02), pytest.approx(3e-3))
    assert m.joint("A").clearance == pytest.approx(5e-5)
    assert m.joint("B").stiffness == pytest.approx(2 * 180 / math.pi)
    assert (m.joint("S").damping, m.joint("S").friction_torque) == (25.0, pytest.approx(3 * 4.4482216152605))
    assert m.drives[0].speed == pytest.approx(10 * math.pi)
    gas, tool = m.loads
    assert gas.force == (-1000.0, 0.0)
    assert gas.table == ((pytest.approx(0.07), 0.9), (pytest.approx(0.17), 0.0))
    assert (tool.start, tool.end) == (pytest.approx(math.radians(200)), pytest.approx(math.radians(340)))
    assert m.assembly["crank"] == pytest.approx(math.radians(30))
    assert '"' not in dumps(m).split("[drive]")[1].split("speed")[1].split("\n")[0]  # written back in SI
    np.testing.assert_allclose(
        lc.analyse(loads(dumps(m))).signals["drive_torque"], lc.analyse(m).signals["drive_torque"]
    )


def test_bare_numbers_are_si_and_words_stay_words() -> None:
    fields = {"drive": {"joint": "D", "speed": "free"}, "body": [{"name": "12 m", "mass": 1.5}]}
    assert in_si(fields) == fields


WRONG = {
    ('speed = "300 rpm"', 'speed = "300 rmp"'): "drive.speed = '300 rmp' has unit 'rmp', which is unknown; give",
    ('speed = "300 rpm"', 'speed = "5 Hz"'): "'Hz', which is of another dimension; give it in rad/s, deg/s or rpm",
    (
        'mass = "300 g"',
        'mass = "300 mm"',
    ): r"body\[crank\]\.mass = '300 mm' has unit 'mm', which .* give it in kg",
    ('["50 mm", 0.0]', '["50 N", 0.0]'): r"body\[crank\]\.points\.A = '50 N' has unit 'N'",
    ('damping = "25 N.s/m"', 'damping = "25 N.m.s/rad"'): r"joint\[S\]\.damping .* give it in N.s/m",
    ('from = "200 deg"', 'from = "2 mm"'): r"load\[crank\]\.from = '2 mm'",
    ('["70 mm", 0.9]', '["70 deg", 0.9]'): r"load\[slider\]\.table = '70 deg'",
    ('crank = "30 deg"', 'crank = "30 km"'): r"assembly\.crank = '30 km'",
    ('mass = "300 g"', 'mass = "heavy"'): "mass = 'heavy'",
}


@pytest.mark.parametrize("change", WRONG)
def test_a_unit_that_does_not_fit_is_named_with_its_field_and_what_would(change: tuple[str, str]) -> None:
    assert change[0] in FILE
    with pytest.raises(MechanismError, match=WRONG[change]):
        loads(FILE.replace(*change))


def test_the_powers_by_which_engines_scale_units_are_those_of_a_library() -> None:
    registry: pint.UnitRegistry[float] = pint.UnitRegistry()
    tables = (BODY, JOINT, REVOLUTE, PRISMATIC, ELASTICITY, SPRING, DRIVE, LOAD, *STOPS.values(), SI)
    for unit in {unit for table in tables for unit in table.values() if unit}:
        dimension = registry.parse_units(unit.replace(".", "*")).dimensionality
        assert tuple(int(dimension.get(f"[{d}]", 0)) for d in ("length", "mass", "time")) == powers(unit), unit


PARTS: Mapping[type[MechanismPart], set[str]] = {
    Body: set(BODY),
    Joint: {*JOINT, *REVOLUTE, *PRISMATIC},
    Elasticity: set(ELASTICITY),
    Spring: set(SPRING),
    Sensor: set(SENSOR),
    Drive: {*DRIVE, "speed"},
    Load: {*LOAD, "start", "end", "table"},
    Stop: set(STOP),
}
WITHOUT_UNIT = {
    "name", "type", "bodies", "body", "joint", "point", "axis", "restitution", "contact_law", "elasticity",
    "ripple", "periodic_torque", "over", "opposes", "fit", "kind", "to", "frame",
}  # fmt: skip
PLACES = {Spring: {"points"}}  # names of points


@pytest.mark.parametrize("part", PARTS)
def test_every_field_with_a_dimension_may_be_written_with_its_unit(part: type[MechanismPart]) -> None:
    fields = set(part.model_fields) - WITHOUT_UNIT - PLACES.get(part, set())
    assert fields - PARTS[part] == set()


STOPPED = """
[[stop]]
joint = "S"
from = "40 mm"
stiffness = "2 N/mm"

[tolerances]
"body.crank.mass" = { sd = "3 g" }
"body.crank.length" = { sd = "10 um" }
"joint.A.clearance" = { limits = ["0.04 mm", "6e-5 m"] }
"stop.S.from" = { sd = "0.1 mm" }
"load.crank.torque" = { sd = "100 N.mm" }
"drive.speed" = { sd = "3 rpm" }
"gravity.y" = { sd = "1 cm/s^2" }
"ground.points.S.y" = { sd = "1 mm" }
"""


def test_tolerances_and_stops_are_in_the_unit_of_what_they_are_of() -> None:
    m = loads(FILE + STOPPED)
    assert (m.stops[0].start, m.stops[0].stiffness) == (pytest.approx(0.04), pytest.approx(2000.0))
    made = {name: each.sd or each.limits for name, each in m.tolerances.items()}
    expected = [3e-3, 1e-5, (4e-5, 6e-5), 1e-4, 0.1, math.pi / 10, 0.01, 1e-3]
    assert list(made.values()) == [pytest.approx(each) for each in expected]
    with pytest.raises(MechanismError, match=r"tolerances\[stop.S.from\].sd = '3 deg' has unit 'deg', which is of"):
        loads(FILE + STOPPED.replace('{ sd = "0.1 mm"', '{ sd = "3 deg"'))


def test_a_linkage_that_is_changed_in_python_takes_the_same_texts() -> None:
    m = loads(FILE)
    loose = m.replace(tolerances={"body.crank.mass": {"sd": "3 g"}, "joint.S.damping": {"sd": "1 N.s/m"}})
    assert [each.sd for each in loose.tolerances.values()] == [pytest.approx(3e-3), 1.0]
    stops = ({"joint": "S", "from": "40 mm", "stiffness": "2 N/mm"}, {"joint": "B", "end": "170 deg", "stiffness": 1.0})
    slide, pin = m.replace(stops=stops).stops
    assert (slide.start, slide.stiffness, pin.end) == (pytest.approx(0.04), 2000.0, pytest.approx(math.radians(170)))
    free = m.replace(drives=({"joint": "D", "speed": "free"},), initial={"velocity_D": "60 rpm"})
    assert free.initial["velocity_D"] == pytest.approx(2 * math.pi)
    stretch: dict[str, Any] = {"torque": "2 N.m", "start": "200 deg", "end": "340 deg"}
    tool = Load(body="crank", over="crank_angle", **stretch)
    assert m.replace(loads=(tool,)).loads == (m.loads[1],)
    with pytest.raises(MechanismError, match=r"stop\[S\].from = '40 deg' has unit 'deg'.*give it in m, mm"):
        m.replace(stops=({"joint": "S", "from": "40 deg", "stiffness": 1.0},))


def _recorded(folder: Path, run: str = "", top: str = "") -> Path:
    swing = "".join(f"{t / 100},{1.6 + 0.01 * math.sin(t / 4)}\n" for t in range(40))
    (folder / "a.csv").write_text(f"time [s],follower_angle [rad]\n{swing}", encoding="utf-8")
    (folder / "m.toml").write_text(dumps(load("crank-rocker")), encoding="utf-8")
    file = f'mechanism = "m.toml"\n{top}\n[[run]]\nname = "a"\nfile = "a.csv"\n{run}\n'
    (folder / "measured.toml").write_text(file, encoding="utf-8")
    return folder / "measured.toml"


def test_noise_start_and_tolerance_of_measured_data_may_say_their_units(tmp_path: Path) -> None:
    run = 'drive = "free"\nnoise = { follower_angle = "0.05 deg" }\nstart = { crank_angular_velocity = "30 rpm" }'
    top = 'tolerance = { mass = "5 g", joint_spring = { stiffness = "2 N.m/deg" } }'
    read = load_measured(_recorded(tmp_path, run, top))
    assert read.runs[0].channels["follower_angle"].noise == pytest.approx(math.radians(0.05))
    assert read.runs[0].start["crank_angular_velocity"] == pytest.approx(math.pi)
    assert read.tolerance == {"mass": 5e-3, "joint_spring.stiffness": pytest.approx(2 * 180 / math.pi)}
    for wrong, said in {
        ('noise = { follower_angle = "0.05 mm" }', ""): r"run\[a\].noise.follower_angle = '0.05 mm' has unit 'mm'.*deg",
        ('noise = { follower_angle = "much" }', ""): "noise.follower_angle = 'much': input should be a valid number",
        ("", 'tolerance = { mass = "5 mm" }'): "measured.toml: tolerance.mass = '5 mm' has unit 'mm'.*give it in kg",
        ("", 'tolerance = { mass = "light" }'): "tolerance.mass = 'light' has no number; give kg, or a number with its",
        ("", 'tolerance = { mas = "5 g" }'): "tolerance.mas = '5 g'",
    }.items():
        with pytest.raises(ValueError, match=said):
            load_measured(_recorded(tmp_path, *wrong))


def test_every_quantity_of_a_tolerance_of_measured_data_has_a_unit() -> None:
    units = {"mass": "g", "length": "mm", "inertia": "kg.mm^2", "force": "kN", "torque": "N.mm", "angle": "deg",
             "time": "ms", "damping": "mN.m.s/rad", "stiffness": "N/mm", "clearance": "um", "modulus": "GPa",
             "gain": "1", "gravity": "mm/s^2"}  # fmt: skip
    assert set(units) == set(QUANTITIES)
    for name, unit in units.items():
        read = cast(Mapping[str, float], tolerance_in_si({name: f"2 {unit}" if unit != "1" else "2"}))
        assert isinstance(read[name], float), name


def test_a_plan_takes_units_with_or_without_a_space(tmp_path: Path) -> None:
    (tmp_path / "plan.toml").write_text(
        'mechanism = "crank-rocker"\ntolerance = { mass = "5 g" }\n[rig]\nspeeds = ["60rpm"]\nrate = "0.25kHz"\n'
        'sensors = { follower_angle = "0.05deg" }\n',
        encoding="utf-8",
    )
    rig = read_bench(tmp_path / "plan.toml", None, None, 3.0)
    assert rig.speeds == (pytest.approx(2 * math.pi),)
    assert rig.sensors[0].noise == pytest.approx(math.radians(0.05))
    assert rig.tolerance == {"mass": 5e-3}
    assert rig.rate == pytest.approx(250.0)


def test_a_tolerance_file_takes_units_and_knows_one_for_each_of_its_lines(tmp_path: Path) -> None:
    assert set(UNITS_OF) >= set(get_args(ToleranceKind)) - set(LINE_OF)
    known = '[[known]]\ncase = "paper"\nsignal = "reaction_B_angle"\nreason = "Eq. 8"\nbound = "7 deg"\n'
    file = tmp_path / "t.toml"
    text = (
        'rest = "1 cm/s^2"\n[driven.contact]\nangle = { absolute = "2 deg", window = "0.1 deg" }\n'
        'torque = { absolute = "3 N.mm" }\nvelocity = { absolute = "2 mm/s" }\n'
        f'[statistics]\npeak_force = {{ absolute = "2 kN" }}\n{known}'
    )
    file.write_text(text, encoding="utf-8")
    read = checked_known(load_tolerances(file), load("paper"))
    line = read.line("driven", "contact", "angle")
    assert (line.absolute, line.window) == (pytest.approx(math.radians(2)), pytest.approx(math.radians(0.1)))
    assert read.line("driven", "contact", "torque").absolute == pytest.approx(3e-3)
    assert read.line("driven", "contact", "velocity").absolute == pytest.approx(2e-3)
    assert (read.rest, read.statistics["peak_force"].absolute) == (0.01, 2000.0)
    assert read.known[-1].largest == pytest.approx(math.radians(7))
    for good, bad, said in [
        ('absolute = "2 deg"', 'absolute = "2 mm"', "driven.contact.angle.absolute = '2 mm' has unit 'mm'.*rad"),
        ('"7 deg"', '"7 mm"', r"known\[\d\].bound = '7 mm' has unit 'mm', which is of another dimension"),
        ('"7 deg"', '"0 deg"', "give more than 0"),
    ]:
        file.write_text(text.replace(good, bad), encoding="utf-8")
        with pytest.raises(ToleranceError, match=said):
            checked_known(load_tolerances(file), load("paper"))


def test_runs_of_measured_data_may_say_their_units_too() -> None:
    push = {"body": "coupler", "force": ["3 lbf", 0.0], "torque": "2 N.mm"}
    given = {"name": "slow", "drive_speed": "-30 rpm", "drive_angle": "45 deg", "load": [push]}
    (run,) = cast(list[dict[str, Any]], runs_in_si([given]))
    assert (run["drive_speed"], run["drive_angle"]) == (pytest.approx(-math.pi), pytest.approx(math.pi / 4))
    assert run["load"][0]["force"][0] == pytest.approx(3 * 4.4482216152605)
    assert run["load"][0]["torque"] == pytest.approx(2e-3)
    with pytest.raises(UnitError, match=r"run\[slow\]\.drive_speed = '30 mm' has unit 'mm', which is of another"):
        runs_in_si([{"name": "slow", "drive_speed": "30 mm"}])
    assert runs_in_si("nothing") == "nothing"


def test_a_diagnosis_reads_a_speed_in_rpm(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("time [s],drive_torque [N.m]\n0,0\n0.1,1\n0.2,0\n0.3,1\n", encoding="utf-8")
    (tmp_path / "m.toml").write_text(dumps(load("crank-rocker")), encoding="utf-8")
    file = 'mechanism = "m.toml"\n[[run]]\nname = "a"\nfile = "a.csv"\ndrive_speed = "60 rpm"\n'
    (tmp_path / "measured.toml").write_text(file, encoding="utf-8")
    assert read_file(tmp_path / "measured.toml").runs[0].drive_speed == pytest.approx(2 * math.pi)


def test_a_power_may_be_written_as_results_print_it() -> None:
    assert quantity("2 kg.m2", "kg.m^2") == quantity("2 kg.m^2", "kg.m^2") == 2.0
    assert quantity("3 kg.mm2", "kg.m^2") == pytest.approx(3e-6)
    assert quantity("981 cm/s2", "m/s^2") == pytest.approx(9.81)


@pytest.mark.long_rows("MPa-Pa", "deg-rad")
@pytest.mark.parametrize(("unit", "si"), COMMON)
def test_what_is_written_most_is_as_pint_has_it(unit: str, si: str) -> None:
    registry: pint.UnitRegistry[float] = pint.UnitRegistry()
    wanted, given = ((1.0 * registry.parse_units(each.replace(".", "*"))).to_base_units() for each in (si, unit))
    assert given.units == wanted.units
    assert COMMON[unit, si] == pytest.approx(given.magnitude / wanted.magnitude, rel=1e-14)


def test_an_exponent_is_no_unit_and_nothing_is_lost_in_si() -> None:
    assert quantity("5e-5", "m") is None
    assert quantity("5e-5 m", "m") == 5e-5
    assert quantity("1e3mm", "m") == pytest.approx(1.0)
    assert factor_to_si("N.m/rad", "N.m/rad") == 1.0


def test_a_clearance_may_be_typed_with_its_unit_and_once_for_every_pin() -> None:
    kind = ByJoint()
    assert kind.parse("B=0.1mm,E=5e-5", "clearance") == {"B": pytest.approx(1e-4), "E": 5e-5}
    assert kind.parse("0.1 mm,B=0", "clearance") == {"*": pytest.approx(1e-4), "B": 0.0}
    for wrong, said in {
        "B=1kg": "another dimension",
        "B=x": "is not a number",
        "1mm,2mm": "or each by name",
    }.items():
        with pytest.raises(ArgumentError, match=said):
            kind.parse(wrong, "clearance")


def test_one_clearance_is_every_pins_and_no_slides() -> None:
    angles = np.radians([100.0, 110.0])
    every = lc.analyse("slider-crank", clearance=1e-4, angles=angles)
    assert every.clearance == {"O": 1e-4, "A": 1e-4, "B": 1e-4}
    some = lc.analyse("slider-crank", clearance={"*": 1e-4, "B": 2e-4}, angles=angles)
    assert some.clearance == {"O": 1e-4, "A": 1e-4, "B": 2e-4}
    written = lc.analyse("slider-crank", clearance={"*": "0.1 mm", "B": "0.2mm"}, angles=angles)
    assert written.clearance == {"O": pytest.approx(1e-4), "A": pytest.approx(1e-4), "B": pytest.approx(2e-4)}
    assert lc.analyse("slider-crank", clearance="0.1 mm", angles=angles).clearance["A"] == pytest.approx(1e-4)
    with pytest.raises(ArgumentError, match=r"'0.1 kg' has unit 'kg'"):
        lc.analyse("slider-crank", clearance={"B": "0.1 kg"}, angles=angles)
    assert Clearances().parse("0.05mm,1e-4", "clearances") == [pytest.approx(5e-5), 1e-4]
    assert load("slider-crank").clearances == {}


@pytest.mark.parametrize(
    ("kind", "word", "bare"),
    [
        (Angles(), "0 deg:1.5 rad:0.25 rad", f"0:{math.degrees(1.5)!r}:{math.degrees(0.25)!r}"),
        (Angles(), "0:1.5:0.25 rad", f"0:{math.degrees(1.5)!r}:{math.degrees(0.25)!r}"),
        (Times(), "0 ms:500 ms:50 ms", "0:0.5:0.05"),
        (Times(), "0:500:50ms", "0:0.5:0.05"),
        (Part(), "99 %", "0.99"),
        (Places(), "-10 cm:100 mm:5,0:0.2 m:3", "-0.1:0.1:5,0:0.2:3"),
        (Angle(), "0.5 rad", repr(math.degrees(0.5))),
        (Seconds(), "2 min", "120"),
        (Speeds(), "2 rad/s,60 rpm", f"{2 * 30 / math.pi!r},60"),
    ],
)
def test_ranges_and_lists_of_a_command_are_typed_with_units_too(kind: ArgumentKind[str], word: str, bare: str) -> None:
    np.testing.assert_allclose(np.asarray(kind.parse(word, "it")), np.asarray(kind.parse(bare, "it")), rtol=1e-12)


@pytest.mark.parametrize(("kind", "word"), [(Angles(), "0 mm:5 mm:1 mm"), (Times(), "0 deg:5 deg:1 deg")])
def test_a_range_of_another_dimension_is_refused_with_what_is_wrong(kind: ArgumentKind[str], word: str) -> None:
    with pytest.raises(ArgumentError, match=r"give start:stop:step in .*; it has unit .* give it in"):
        kind.parse(word, "it")


def test_what_begins_or_goes_on_without_its_unit_is_not_guessed() -> None:
    with pytest.raises(ArgumentError, match="several units, deg and rad, and a number without one; give each its own"):
        Angles().parse("0:1.5 rad:10 deg", "it")
    with pytest.raises(ArgumentError, match="give more than 0% and no more than 100%"):
        Part().parse("99% or so", "it")


def test_an_encoder_s_step_is_an_angle_or_a_length_as_its_joint_turns_or_slides() -> None:
    steps = StepByJoint().parse("D=0.01deg,E=1e-4", "encoder_step")
    assert steps == {"D": "0.01deg", "E": 1e-4}
    result = lc.platform_accuracy("five-bar", encoder_step=steps)
    assert result.encoder_step == {"D": pytest.approx(math.radians(0.01)), "E": 1e-4}
    with pytest.raises(ArgumentError, match="'1mm' has unit 'mm'"):
        lc.platform_accuracy("five-bar", encoder_step={"D": "1mm"})

"""An FMU of a linkage with two drives, a hinge and a slide: a polar arm in closed form agrees, and faults are told."""

from __future__ import annotations

import platform
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

import linkage_crosscheck as lc
from analytic.mechanism import Mechanism
from analytic.mechanism.file import loads
from sim_models.engine import Unsupported

pytest.importorskip("fmpy", exc_type=ImportError)
pytest.importorskip("pythonfmu", exc_type=ImportError)

pytestmark = pytest.mark.skipif(
    (sys.platform, platform.machine()) != ("linux", "x86_64"), reason="the FMU that pythonfmu builds is read on Linux"
)
POLAR = '''"""A polar arm in closed form: it turns about O, and a hand slides along it."""

import math

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

M1, C1, J1, M2, J2, G = 0.8, 0.1, 7e-3, 0.5, 1e-3, 9.81


class Polar(Fmi2Slave):
    def __init__(self, **given):
        super().__init__(**given)
        self.phi = self.omega = self.alpha = self.r = self.v = self.a = self.r_0 = 0.0
        self.by_speed = 0.0
        for name in ("phi", "omega", "alpha", "r", "v", "a"):
            self.register_variable(Real(name, causality=Fmi2Causality.input))
        for name in ("r_0", "by_speed"):
            self.register_variable(Real(name, causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable))
        for name in ("torque", "force", "hand_x", "hand_y", "turned", "R_x", "R_y"):
            setattr(self, name, 0.0)
            self.register_variable(Real(name, causality=Fmi2Causality.output))

    def exit_initialization_mode(self):
        if self.by_speed:
            self.r = self.r_0
        self.solve()

    def do_step(self, now, step):
        if self.by_speed:
            self.r += self.v * step
        self.solve()
        return True

    def solve(self):
        r, c, s = self.r / 1000.0, math.cos(self.phi), math.sin(self.phi)
        v, a, w, e = self.v / 1000.0, self.a / 1000.0, self.omega, self.alpha
        along, across = a - r * w * w, r * e + 2 * v * w
        self.hand_x, self.hand_y, self.turned = 1000.0 * r * c, 1000.0 * r * s, math.degrees(self.phi)
        self.force = M2 * (along + G * s)
        self.torque = (J1 + M1 * C1**2 + J2) * e + M2 * r * across + (M1 * C1 + M2 * r) * G * c
        radial, tangential = M2 * along - M1 * C1 * w * w, M2 * across + M1 * C1 * e
        self.R_x = radial * c - tangential * s
        self.R_y = radial * s + tangential * c + (M1 + M2) * G
'''
MAP = """
[drives.O]
position = "phi"
speed = "omega"
acceleration = "alpha"
[drives.S]
position = { variable = "r", unit = "mm", offset = -200.0 }
speed = { variable = "v", unit = "mm/s" }
acceleration = { variable = "a", unit = "mm/s2" }
[columns]
torque = { signal = "drive_torque_O" }
force = { signal = "drive_force_S" }
hand_x = { signal = "hand_x", unit = "mm" }
hand_y = { signal = "hand_y", unit = "mm" }
turned = { signal = "position_O", unit = "deg" }
R_x = { signal = "reaction_O_x" }
R_y = { signal = "reaction_O_y" }
"""
ARM = """
name = "polar arm"
gravity = [0.0, -9.81]
ground = { points = { O = [0.0, 0.0] } }
joint = [
  { name = "O", type = "revolute", bodies = ["ground", "arm"] },
  { name = "S", type = "prismatic", bodies = ["arm", "hand"], axis = [1.0, 0.0] },
]
drive = [
  { joint = "O", speed = 1.5 },
  { joint = "S", speed = 0.08 },
]
assembly = { arm = 0.3, hand = 0.3 }
[[body]]
name = "arm"
points = { O = [0.0, 0.0], S = [0.2, 0.0], end = [0.4, 0.0] }
mass = 0.8
com = [0.1, 0.0]
inertia = 7e-3
[[body]]
name = "hand"
points = { S = [0.0, 0.0], tip = [0.05, 0.0] }
mass = 0.5
com = [0.0, 0.0]
inertia = 1e-3
"""
TIMES = np.linspace(0.0, 0.8, 9)


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from pythonfmu import FmuBuilder

    folder = tmp_path_factory.mktemp("polar")
    source = folder / "polar.py"
    source.write_text(POLAR, encoding="utf-8")
    path = list(sys.path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = Path(FmuBuilder.build_FMU(source, dest=folder))
    sys.path[:] = path
    return found


@pytest.fixture(scope="module")
def arm() -> Mechanism:
    return loads(ARM)


def named(fmu: Path, folder: Path, *edits: tuple[str, str]) -> str:
    text = MAP
    for old, new in edits:
        assert old in text, old
        text = text.replace(old, new)
    path = folder / "polar.map.toml"
    path.write_text(text, encoding="utf-8")
    return f"fmu:{fmu}::{path}"


def test_an_arm_of_somebody_else_s_with_two_drives_agrees_to_rounding(
    fmu: Path, arm: Mechanism, tmp_path: Path
) -> None:
    found = lc.crosscheck(arm, simulator=named(fmu, tmp_path), times=TIMES)
    assert found.verdict == "agrees"
    (run,) = found.runs
    assert {"drive_torque_O", "drive_force_S", "reaction_O_magnitude"} <= {d.signal for d in run.discrepancies}
    assert max(d.share or 0.0 for d in run.discrepancies) < 1e-6


@pytest.mark.slow
def test_it_follows_a_course_with_the_accelerations_that_it_has(fmu: Path, arm: Mechanism, tmp_path: Path) -> None:
    t = np.linspace(0.0, 0.8, 41)
    course = tmp_path / "course.csv"
    rows = "".join(f"{x},{0.3 + 0.5 * x * x},{0.03 * np.sin(5 * x)}\n" for x in t)
    course.write_text(f"time [s],position_O [rad],position_S [m]\n{rows}", encoding="utf-8")
    found = lc.crosscheck(arm, simulator=named(fmu, tmp_path), times=TIMES, course=course)
    assert found.verdict == "agrees"
    assert max(d.share or 0.0 for d in found.runs[0].discrepancies) < 1e-3


@pytest.mark.slow
def test_a_wrong_mass_is_found(fmu: Path, arm: Mechanism, tmp_path: Path) -> None:
    hand = arm.moving["hand"].model_copy(update={"mass": 0.51})
    heavier = arm.replace(bodies=(arm.moving["arm"], hand))
    found = lc.crosscheck(heavier, simulator=named(fmu, tmp_path), times=TIMES)
    assert found.verdict == "disagrees"
    assert "drive_force_S" in {d.signal for d in found.runs[0].discrepancies if (d.share or 0.0) > 1}


def test_a_slide_that_is_told_its_speed_goes_from_where_it_starts(fmu: Path, arm: Mechanism, tmp_path: Path) -> None:
    speed_alone = 'start_position = { variable = "r_0", unit = "mm", offset = -200.0 }'
    name = named(
        fmu,
        tmp_path,
        ('position = { variable = "r", unit = "mm", offset = -200.0 }', speed_alone),
        ("[columns]", "[parameters]\nby_speed = 1.0\n[columns]"),
    )
    assert lc.crosscheck(arm, simulator=name, times=TIMES).verdict == "agrees"


FAULTS = {
    "a drive that is not told": (
        ("[drives.S]", "[drives.T]"),
        "drives.'T': polar arm has no such joint; they are O, S",
    ),
    "no position": (('position = "phi"\n', ""), "the FMU is not told where it is; give position, or speed"),
    "one variable twice": (('speed = "omega"', 'speed = "phi"'), "drives.O.speed: 'phi' is that of drives.O.position"),
    "an output": (('speed = "omega"', 'speed = "torque"'), "drives.O.speed: 'torque' is no input"),
    "a unit of a hinge": (('unit = "mm/s" ', 'unit = "rad/s" '), "it has unit 'rad/s'; it is given in m/s or mm/s"),
    "both kinds": (("[drives.O]", '[inputs]\nangle = "phi"\n[drives.O]'), "leave one of them out"),
    "a field of a crank": (('position = "phi"', 'angle = "phi"'), "drives.O.angle is not a field"),
}


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS)
def test_a_map_of_several_drives_that_is_none_is_a_sentence(
    fault: str, fmu: Path, arm: Mechanism, tmp_path: Path
) -> None:
    edit, words = FAULTS[fault]
    with pytest.raises(lc.Error) as told:
        lc.crosscheck(arm, simulator=named(fmu, tmp_path, edit), times=TIMES)
    assert words in str(told.value)
    assert len(str(told.value).splitlines()) == 1


@pytest.mark.slow
def test_a_drive_that_the_linkage_has_not_is_told(fmu: Path, arm: Mechanism, tmp_path: Path) -> None:
    text = "[drives.S]"
    more = (text, f'[drives.T]\nposition = "a"\n{text}')
    with pytest.raises(Unsupported, match=r"drives.'T': polar arm has no such joint; they are O, S"):
        lc.crosscheck(
            arm,
            simulator=named(fmu, tmp_path, ('acceleration = { variable = "a", unit = "mm/s2" }\n', ""), more),
            times=TIMES,
        )


def test_what_swings_freely_is_refused(fmu: Path, arm: Mechanism, tmp_path: Path) -> None:
    with pytest.raises(Unsupported, match="has no drive, and an FMU is driven"):
        lc.crosscheck(arm.replace(drives=()), simulator=named(fmu, tmp_path), times=TIMES)

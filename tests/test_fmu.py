"""An FMU as a simulator: a slider-crank of the tests' own agrees, faults are found, and bad files told."""

from __future__ import annotations

import math
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import fmu_in_c
import linkage_crosscheck as lc
from analytic.mechanism.columns import MapError
from analytic.mechanism.file import load
from asked import request_of
from commands import ROOT
from compare.cli.app import app
from fmu_files import MAP, build, members, packed, redescribed
from marks import slow
from sim_models import engine as seam
from sim_models.engine import SimulationError, Trace, Unsupported, engine
from sim_models.fmu import run as runs
from sim_models.fmu.description import FmuError

pytest.importorskip("fmpy", exc_type=ImportError)
pytest.importorskip("pythonfmu", exc_type=ImportError)

pytestmark = pytest.mark.skipif(
    (sys.platform, platform.machine()) != ("linux", "x86_64"), reason="the FMU that pythonfmu builds is read on Linux"
)
CASE = load("slider-crank")
ANGLES = np.radians([300.0, 20.0, 100.0, 21.5, 20.0])


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(tmp_path_factory.mktemp("fmu"))


@pytest.fixture
def mapped(fmu: Path, tmp_path: Path) -> Callable[..., str]:
    """The FMU's name with a map that is the good one after some replacements, and with more text at its ends."""

    def name(*edits: tuple[str, str], before: str = "", after: str = "") -> str:
        text = MAP
        for old, new in edits:
            assert old in text, old
            text = text.replace(old, new)
        path = tmp_path / "changed.map.toml"
        path.write_text(f"{before}\n{text}\n{after}\n", encoding="utf-8")
        return f"fmu:{fmu}::{path}"

    return name


def trace(name: str, theta: np.ndarray = ANGLES, **request: object) -> Trace:
    return engine(name).simulate(request_of(CASE, crank_angle=theta, **request))


def apart(one: Trace, other: Trace) -> float:
    """The largest difference of any two signals, of the largest value of the signal (or one)."""
    assert set(one.signals) == set(other.signals)
    pairs = [(one.signals[name], other.signals[name]) for name in one.signals]
    return max(float(np.abs(a - b).max()) / max(1.0, float(np.abs(b).max())) for a, b in pairs)


# ---------------------------------------------------------------- what it finds


def test_a_linkage_of_somebody_else_s_agrees_to_rounding(fmu: Path) -> None:
    result = lc.crosscheck("slider-crank", f"fmu:{fmu}")
    assert result.verdict == "agrees"
    (run,) = result.runs
    assert run.simulator.name == f"fmu:{fmu}"
    assert run.simulator.version.startswith("PythonFMU ")
    assert run.settings["step"] == pytest.approx(1e-4, rel=0.2)
    shares = [abs(d.max) / d.tolerance for d in run.discrepancies]
    assert len(shares) == 13
    assert max(shares) < 1e-9


@pytest.mark.slow
def test_the_command_takes_a_map_and_finds_a_wrong_mass(
    fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "heavy.toml").write_text(f"{MAP}\n[parameters]\nm_rod = 0.22\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    words = ["--case", "slider-crank", "--simulator", f"fmu:{fmu}", "--angles", "0:330:30", "--out", "out"]
    done = CliRunner().invoke(app, [*words, "--map", "heavy.toml"])
    assert done.exit_code == 1, done.output
    assert "DISAGREES" in done.output
    shown = CliRunner().invoke(app, ["show", "out/result.json", "--signal", "reaction_A_x", "--at", "30"])
    assert shown.exit_code == 0, shown.output
    assert CliRunner().invoke(app, [*words, "--overwrite"]).exit_code == 0


@pytest.mark.slow
@pytest.mark.mujoco
@pytest.mark.parametrize(
    ("columns", "judged"),
    [
        (("B_x", "B_y", "torque"), {"reaction_B_angle", "reaction_B_magnitude", "drive_torque"}),
        *slow((("B_x",), {"reaction_B_x"})),
        (("crank_deg", "O_y"), {"crank_angle", "reaction_O_y"}),
    ],
)
def test_what_it_does_not_give_is_not_judged(
    columns: tuple[str, ...], judged: set[str], fmu: Path, tmp_path: Path
) -> None:
    head, _, table = MAP.partition("[columns]\n")
    lines = [line for line in table.splitlines() if line.split(" ")[0] in columns]
    path = tmp_path / "few.toml"
    for heavy in (False, True):
        text = "\n".join([head, "[columns]", *lines, "[parameters]", f"m_slider = {0.15 if heavy else 0.14}"])
        path.write_text(text, encoding="utf-8")
        names, angles = ["mujoco", f"fmu:{fmu}"], np.radians(np.arange(5, 360, 25))
        result = lc.crosscheck("slider-crank", names[1:] if heavy else names, map=path, angles=angles, workers=1)
        run = result.run(f"fmu:{fmu}")
        assert {d.signal for d in run.discrepancies} == judged
        assert run.verdict == ("disagrees" if heavy else "agrees")
        assert {"report.html", "junit.xml"} <= set(result.files())


@pytest.mark.slow
@pytest.mark.mujoco
def test_it_stands_beside_another_engine_in_other_processes(fmu: Path) -> None:
    heavy = "m_rod = 0.25"
    path = fmu.with_name("heavy.toml")
    path.write_text(f"{MAP}\n[parameters]\n{heavy}\n", encoding="utf-8")
    angles = np.radians(np.arange(0.0, 360.0, 40.0))
    result = lc.crosscheck("slider-crank", ["mujoco", f"fmu:{fmu}"], angles=angles, map=path, workers=2)
    assert {run.simulator.name: run.verdict for run in result.runs} == {"mujoco": "agrees", f"fmu:{fmu}": "disagrees"}
    assert result.odd_one_out == f"fmu:{fmu}"


def test_any_order_of_angles_is_answered_at_the_same_instant(fmu: Path) -> None:
    found, sorted_ = trace(f"fmu:{fmu}"), trace(f"fmu:{fmu}", np.sort(ANGLES))
    order = np.argsort(ANGLES, kind="stable")
    assert found.signals["crank_angle"] == pytest.approx(ANGLES, abs=1e-12)
    assert found.signals["crank_angle"][order] == pytest.approx(sorted_.signals["crank_angle"], abs=1e-12)
    assert found.time == pytest.approx((ANGLES - ANGLES.min()) / CASE.speed)
    assert not found.signals["drive_torque"].flags.writeable


def test_the_speed_alone_turns_it_from_where_it_starts(fmu: Path, mapped: Callable[..., str]) -> None:
    by_speed = mapped(('angle = "phi"\n', 'start_angle = "phi_0"\n'), after="[parameters]\nby_speed = true\nafter = 5")
    assert apart(trace(by_speed), trace(f"fmu:{fmu}")) < 1e-9


@pytest.mark.mujoco
def test_a_course_is_followed_with_the_acceleration_that_it_has(fmu: Path, mapped: Callable[..., str]) -> None:
    knots = np.linspace(0.0, 0.02, 9)
    course = knots, 0.3 + 100.0 * knots + 0.4 * np.sin(300.0 * knots)
    times = np.array([0.0, 0.004, 0.011, 0.02])
    found = trace(f"fmu:{fmu}", np.zeros(0), time=times, course=course)
    mujoco = engine("mujoco").simulate(request_of(CASE, time=times, course=course))
    for name in ("drive_torque", "reaction_B_x", "rod_angle", "crank_angular_velocity"):
        assert found.signals[name] == pytest.approx(
            mujoco.signals[name], rel=1e-4, abs=1e-4 * np.ptp(mujoco.signals[name])
        )
    by_speed = mapped(('angle = "phi"\n', 'start_angle = "phi_0"\n'), after="[parameters]\nby_speed = true")
    turned = trace(by_speed, np.zeros(0), time=times, course=course)
    assert turned.signals["crank_angle"] == pytest.approx(found.signals["crank_angle"], abs=1e-12)


def test_a_crank_that_is_looked_at_over_time_is_told_its_angle(fmu: Path) -> None:
    joint = CASE.drive_joint
    turned = CASE.with_joint(joint.name, bodies=joint.bodies[::-1])  # its reaction is then the other body's
    for m, other in ((CASE, set()), (turned, {f"reaction_{joint.name}_angle"})):
        found = lc.crosscheck(m, simulator=f"fmu:{fmu}", times=np.linspace(0.0, 0.02, 5))
        (run,) = found.runs
        assert {d.signal for d in run.discrepancies if d.verdict == "disagrees"} == other
        assert "drive_torque" in {d.signal for d in run.discrepancies}


@pytest.mark.slow
def test_a_finer_run_is_finer(fmu: Path, mapped: Callable[..., str]) -> None:
    assert trace(f"fmu:{fmu}").step == pytest.approx(1e-4, rel=0.1)
    assert trace(f"fmu:{fmu}", step=1e-5).step == pytest.approx(1e-5, rel=0.1)
    assert trace(mapped(before="step = 1e-3")).step == pytest.approx(1e-3, rel=0.9)


def test_it_turns_backward_and_leads_in(mapped: Callable[..., str]) -> None:
    back = CASE.replace(drive=CASE.drive.model_copy(update={"speed": -CASE.speed}))
    found = engine(mapped(before="lead_in = 1.0")).simulate(request_of(back, crank_angle=ANGLES))
    assert found.signals["crank_angle"] == pytest.approx(ANGLES, abs=1e-12)
    assert np.all(found.signals["crank_angular_velocity"] == -CASE.speed)
    assert found.time[ANGLES.argmax()] == 0.0


def test_a_course_has_nothing_to_lead_in(mapped: Callable[..., str]) -> None:
    times = np.linspace(0.0, 0.02, 5)
    with pytest.raises(Unsupported, match=r"lead_in = 1 rad is of a crank that turns evenly, and this motion is"):
        trace(mapped(before="lead_in = 1.0"), np.zeros(0), time=times, course=(times, 100.0 * times))


def test_signs_units_scales_and_offsets_of_inputs_are_undone(fmu: Path, mapped: Callable[..., str]) -> None:
    other = mapped(
        ('angle = "phi"', 'angle = { variable = "phi", unit = "rad", sign = -1, scale = 2.0, offset = 0.5 }'),
        ("crank_deg = { signal", "crank_deg = { scale = -2.0, offset = 28.64788975654116, signal"),
    )
    assert trace(other).signals["crank_angle"] == pytest.approx(ANGLES, abs=1e-12)


def test_nothing_is_left_behind(fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    trace(f"fmu:{fmu}")
    assert list(tmp_path.iterdir()) == []


def test_equal_steps_are_taken_by_an_fmu_that_takes_no_others(fmu: Path, tmp_path: Path) -> None:
    content = members(fmu)
    redescribed('canHandleVariableCommunicationStepSize="true"', "")(content)
    even = packed(content, tmp_path / "even.fmu")
    (tmp_path / "even.map.toml").write_text(MAP, encoding="utf-8")
    assert trace(f"fmu:{even}", np.radians([0.0, 30.0, 90.0])).signals["crank_angle"][1] == pytest.approx(np.pi / 6)
    with pytest.raises(FmuError, match="takes equal steps only"):
        trace(f"fmu:{even}", np.radians([0.0, 30.0, 30.0 * math.sqrt(2)]))


def test_instants_that_differ_in_rounding_are_one_and_too_many_steps_are_refused(
    fmu: Path, mapped: Callable[..., str]
) -> None:
    angles = np.array([0.5, np.nextafter(0.5, 1.0), 0.5, 0.7])
    assert trace(f"fmu:{fmu}", angles).signals["crank_angle"] == pytest.approx(angles, abs=1e-12)
    assert trace(f"fmu:{fmu}", angles[:1]).signals["crank_angle"] == pytest.approx(angles[:1])
    with pytest.raises(FmuError, match=r"step = 1e-200 s: .* steps would be taken, and at most 1500000 are; give"):
        trace(mapped(before="step = 1e-200"))


def test_what_it_does_not_do_is_refused(fmu: Path) -> None:
    with pytest.raises(Unsupported, match="does not simulate ideal joints in static motion"):
        engine(f"fmu:{fmu}").simulate(request_of(CASE, motion="static", crank_angle=ANGLES))


# ---------------------------------------------------------------- runs that fail: exit status 3


def test_a_crash_after_the_result_is_none(fmu: Path, mapped: Callable[..., str]) -> None:
    assert apart(trace(mapped(after='[parameters]\ntrouble = "crash at the end"')), trace(f"fmu:{fmu}")) == 0.0


TROUBLES = {
    "crash": r"its code crashed \(SIGSEGV\) while it was stepped",
    "leave": r"its code crashed \(exit status 7\) while it was stepped: I am gone;",
    "raise": r"it failed while it was stepped at 0\.00\d+ s: .*the solver gave up",
    "refuse": r"it failed while it was stepped at 0\.00\d+ s",
    "nan": r"'B_x' is nan at 0",
}


@pytest.mark.parametrize("trouble", TROUBLES)
def test_a_run_that_fails_is_an_error_of_its_own(trouble: str, mapped: Callable[..., str]) -> None:
    with pytest.raises(SimulationError, match=TROUBLES[trouble]) as said:
        trace(mapped(after=f'[parameters]\ntrouble = "{trouble}"'))
    assert "\n" not in str(said.value)


def test_a_run_that_does_not_end_is_ended(mapped: Callable[..., str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runs, "LONGEST_RUN", 0.6)
    with pytest.raises(
        SimulationError, match=r"it was not done after 0\.6 s, while it was (started|loaded|instantiated|stepped)"
    ):
        trace(mapped(after='[parameters]\ntrouble = "sleep"'))


@pytest.mark.slow
def test_a_command_that_is_ended_leaves_no_fmu_running_and_nothing_unpacked(
    mapped: Callable[..., str], tmp_path: Path
) -> None:
    """As a CI system ends a job: the FMU's process sees that nobody waits for it."""
    words = ["--case", "slider-crank", "--simulator", mapped(after='[parameters]\ntrouble = "sleep"'), "--out", "out"]
    elsewhere = tmp_path / "temporary"
    elsewhere.mkdir()
    command = [sys.executable, "-m", "compare", *words]
    environment = os.environ | {"TMPDIR": str(elsewhere), "PYTHONPATH": str(ROOT)}
    job = subprocess.Popen(command, cwd=tmp_path, env=environment)
    try:
        wait_until(lambda: any(elsewhere.rglob("stage.txt")))
    finally:
        job.terminate()
    assert job.wait(20) != 0
    wait_until(lambda: not any(elsewhere.iterdir()))


def wait_until(true: Callable[[], bool], seconds: float = 30.0) -> None:
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end
        time.sleep(0.05)


def test_the_command_ends_with_status_3(mapped: Callable[..., str], tmp_path: Path) -> None:
    name = mapped(after='[parameters]\ntrouble = "crash"')
    words = ["--case", "slider-crank", "--simulator", name, "--angles", "0:90:30", "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 3
    assert "its code crashed (SIGSEGV)" in done.output


def test_without_fmpy_it_says_what_to_install(fmu: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = seam.importlib.util.find_spec
    monkeypatch.setattr(seam.importlib.util, "find_spec", lambda name: None if name == "fmpy" else found(name))
    done = CliRunner().invoke(app, ["--case", "slider-crank", "--simulator", f"fmu:{fmu}"])
    assert done.exit_code == 3
    assert "run: pip install 'linkage-crosscheck[fmu]'" in " ".join(done.output.split())


# ---------------------------------------------------------------- files that are none: exit status 2


def without(name: str) -> Callable[[dict[str, bytes]], None]:
    return lambda content: [content.pop(each) for each in list(content) if each.startswith(name)] and None


def holding(name: str, data: bytes) -> Callable[[dict[str, bytes]], None]:
    return lambda content: content.update({name: data})


BILLION = '<?xml version="1.0"?><!DOCTYPE z [<!ENTITY a "aaaaaaaaaa">' + "".join(
    f'<!ENTITY {chr(98 + k)} "{f"&{chr(97 + k)};" * 10}">' for k in range(12)
)
FMUS: dict[str, tuple[Callable[[dict[str, bytes]], None], str]] = {
    "no description": (without("modelDescription.xml"), "it has no modelDescription.xml"),
    "a broken description": (redescribed("</fmiModelDescription>", ""), "its modelDescription.xml cannot be read"),
    "a bomb of entities": (
        holding("modelDescription.xml", f"{BILLION}]><z>&m;</z>".encode()),
        "has a <!DOCTYPE>, whose entities are not read",
    ),
    "another description": (holding("modelDescription.xml", b"<project/>"), "is of the element project"),
    "FMI 1.0": (redescribed('fmiVersion="2.0"', 'fmiVersion="1.0"'), "is of FMI 1.0; export it as FMI 2.0 or 3.0"),
    "model exchange only": (redescribed("<CoSimulation", "<ModelExchange"), "not for co-simulation (ModelExchange)"),
    "no identifier": (redescribed('modelIdentifier="SliderCrank"', ""), "lacks a modelIdentifier; export it anew"),
    "another platform": (without("binaries/linux64"), "it has those of win64; export it for this platform"),
    "no code": (holding("binaries/linux64/SliderCrank.so", b"#!/bin/sh"), "its code cannot be loaded here"),
    "a step in words": (redescribed('stepSize="0.0001"', 'stepSize="fast"'), "DefaultExperiment.stepSize = 'fast'"),
    "a reference in words": (redescribed('valueReference="3"', 'valueReference="-3"'), "and valueReference '-3'"),
    "a way out": (holding("../owned.txt", b"x"), "'../owned.txt' would be written elsewhere"),
    "a way to the root": (holding("/tmp/owned.txt", b"x"), "'/tmp/owned.txt' would be written elsewhere"),
    "a bomb": (holding("resources/zeros", bytes(2**25)), "is 32 MB out of 31 kB; it is not unpacked"),
}


def refused(name: str, tmp_path: Path, *more: str) -> str:
    """What the command says of an FMU or a map that it refuses, in one line."""
    words = [
        "--case",
        "slider-crank",
        "--simulator",
        name,
        "--angles",
        "0:90:30",
        "--out",
        str(tmp_path / "out"),
        *more,
    ]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 2, done.output
    (line,) = done.stderr.splitlines()
    assert "Traceback" not in line
    return line


@pytest.mark.parametrize("fault", FMUS)
def test_an_fmu_that_is_none_is_a_sentence(fault: str, fmu: Path, tmp_path: Path) -> None:
    edit, words = FMUS[fault]
    content = members(fmu)
    edit(content)
    bad = packed(content, tmp_path / "bad.fmu")
    (tmp_path / "bad.map.toml").write_text(MAP, encoding="utf-8")
    said = refused(f"fmu:{bad}", tmp_path)
    assert str(bad) in said
    assert words in said
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bad.fmu", "bad.map.toml"]


def test_a_file_that_is_no_fmu_is_a_sentence(fmu: Path, tmp_path: Path) -> None:
    half = tmp_path / "half.fmu"
    half.write_bytes(fmu.read_bytes()[:5000])
    (tmp_path / "text.fmu").write_text("hello", encoding="utf-8")
    for name, words in {
        "half.fmu": "it is no FMU, or a damaged one",
        "text.fmu": "it is no FMU, or a damaged one",
        "none.fmu": "there is no such file",
        "": "it is no file",
    }.items():
        assert words in refused(f"fmu:{tmp_path / name}", tmp_path)


def test_a_damaged_member_is_a_sentence(fmu: Path, tmp_path: Path) -> None:
    data = bytearray(fmu.read_bytes())
    at = data.find(b"binaries/linux64/SliderCrank.so") + 2000
    data[at : at + 4] = b"oops"
    (tmp_path / "bad.fmu").write_bytes(data)
    (tmp_path / "bad.map.toml").write_text(MAP, encoding="utf-8")
    said = refused(f"fmu:{tmp_path / 'bad.fmu'}", tmp_path)
    assert "export it anew" in said


def test_without_a_map_it_says_what_to_write(fmu: Path, tmp_path: Path) -> None:
    alone = packed(members(fmu), tmp_path / "alone.fmu")
    said = refused(f"fmu:{alone}", tmp_path)
    assert f"{tmp_path / 'alone.map.toml'}: there is no such map; write one with [inputs]" in said
    assert "its inputs" not in said
    assert "inputs of alone.fmu are phi, omega, alpha; its outputs O_x, O_y," in said


MAPS: dict[str, tuple[tuple[str, str], str]] = {
    "no TOML": (('angle = "phi"', "angle = phi"), "cannot be read as TOML"),
    "no inputs": (("[inputs]", "[input]"), "input is not a field"),
    "another field": (('angle = "phi"', 'position = "phi"'), "inputs.position is not a field"),
    "no angle": (('angle = "phi"\n', ""), "the FMU is not told where its crank is"),
    "no such input": (('angle = "phi"', 'angle = "phy"'), "has no variable 'phy'; did you mean 'phi'"),
    "an output as input": (('angle = "phi"', 'angle = "rod_angle"'), "'rod_angle' is no input of SliderCrank.fmu"),
    "an input's unit": (('unit = "rad/s"', 'unit = "mm"'), "inputs.speed: it has unit 'mm', which is of another"),
    "an acceleration's unit": (
        ('acceleration = "alpha"', 'acceleration = { variable = "alpha", unit = "g" }'),
        "it is given in rad/s2 or deg/s2",
    ),
    "no such column": (("B_x = {", "B_X = {"), "has no variable 'B_X'; did you mean 'B_x'"),
    "text as a column": (("B_x = {", "trouble = {"), "is of kind String; give one that is Real or Float64"),
    "no such signal": (('"reaction_B_x"', '"reaction_C_x"'), "none of slider-crank; did you mean 'reaction_"),
    "a column's unit": (('unit = "N.mm"', 'unit = "N"'), "torque': it has unit 'N', which is of another dimension"),
    "no such unit": (('unit = "N.mm"', 'unit = "furlong2"'), "which is"),
    "no scale": (('{ signal = "reaction_B_x"', '{ scale = 0.0, signal = "reaction_B_x"'), "a scale of 0 leaves"),
    "two columns": (('"reaction_B_x"', '"reaction_B_y"'), "signal reaction_B_y has two columns"),
    "a sign": (("sign = -1", "sign = 2"), "sign = 2: input should be 1 or -1"),
    "one variable, two inputs": (
        ('speed = { variable = "omega", unit = "rad/s" }', 'speed = "phi"'),
        "inputs.speed: 'phi' is that of inputs.angle already",
    ),
    "a step that never ends": (("[inputs]", "step = 1e-12\n[inputs]"), "step = 1e-12 s: "),
    "a step": (("[inputs]", "step = -1\n[inputs]"), "step = -1"),
    "a parameter's kind": (("[columns]", "[parameters]\nafter = 1.5\n[columns]"), "parameters.'after' = '1.5': it is"),
    "no such parameter": (("[columns]", "[parameters]\nm_rot = 1\n[columns]"), "did you mean 'm_rod'"),
}


@pytest.mark.parametrize("fault", MAPS)
def test_a_map_that_is_none_is_a_sentence(fault: str, fmu: Path, tmp_path: Path) -> None:
    edit, words = MAPS[fault]
    assert edit[0] in MAP
    bad = tmp_path / "bad.toml"
    bad.write_text(MAP.replace(*edit), encoding="utf-8")
    said = refused(f"fmu:{fmu}", tmp_path, "--map", str(bad))
    assert str(bad) in said
    assert words in said


@pytest.mark.slow
def test_a_unit_that_is_not_the_fmu_s_own_is_refused_and_its_own_is_taken(fmu: Path, tmp_path: Path) -> None:
    content = members(fmu)
    text = content["modelDescription.xml"].decode("utf-8")
    head, found, tail = text.partition('<ScalarVariable name="torque"')
    assert found
    for unit, given, words in (
        ("N.m", 'unit = "N.mm"', "but the FMU gives torque in 'N.m'; leave unit out"),
        ("N", 'unit = "N.mm"', "but the FMU gives torque in 'N'; leave unit out"),
        ("N.mm", "scale = 1.0", ""),
        ("zorgs", 'unit = "N.mm"', ""),
    ):
        content["modelDescription.xml"] = (head + found + tail.replace("<Real", f'<Real unit="{unit}"', 1)).encode()
        odd = packed(content, tmp_path / "odd.fmu")
        (tmp_path / "odd.map.toml").write_text(MAP.replace('unit = "N.mm"', given), encoding="utf-8")
        if words:
            assert words in refused(f"fmu:{odd}", tmp_path)
        else:
            assert trace(f"fmu:{odd}").signals["drive_torque"] == pytest.approx(
                trace(f"fmu:{fmu}").signals["drive_torque"]
            )


def test_an_fmu_without_its_scheme_is_recognised(fmu: Path, tmp_path: Path) -> None:
    assert f"did you mean 'fmu:{fmu}'" in refused(str(fmu), tmp_path)


def test_a_map_without_an_fmu_is_refused(tmp_path: Path) -> None:
    assert "belongs to no simulator" in refused("mujoco", tmp_path, "--map", "some.toml")


# ---------------------------------------------------------------- FMI 3.0

CRANK = """
[inputs]
angle = "phi"
speed = "omega"
[columns]
angle = { signal = "crank_angle" }
speed = { signal = "crank_angular_velocity" }
"""


def test_fmi_3_is_run_in_the_units_that_it_declares(tmp_path: Path) -> None:
    crank = fmu_in_c.build(tmp_path)
    text = tmp_path / "crank.map.toml"
    text.write_text(CRANK, encoding="utf-8")
    found = trace(f"fmu:{crank}")
    assert found.version == "the tests"
    assert found.signals["crank_angle"] == pytest.approx(ANGLES, abs=1e-12)
    assert found.signals["crank_angular_velocity"] == pytest.approx(CASE.speed)
    text.write_text(f"{CRANK}[parameters]\ngain = 2.0\n", encoding="utf-8")
    assert trace(f"fmu:{crank}").signals["crank_angle"] == pytest.approx(2 * ANGLES, abs=1e-12)
    for parameter, words in {"gain = 1e9": "the gain is too large", "ends = true": "ended the simulation"}.items():
        text.write_text(f"{CRANK}[parameters]\n{parameter}\n", encoding="utf-8")
        with pytest.raises(SimulationError, match=words):
            trace(f"fmu:{crank}")
    text.write_text(CRANK.replace("speed =", "many ="), encoding="utf-8")
    with pytest.raises(MapError, match=r"inputs\.many is not a field"):
        engine(f"fmu:{crank}")
    text.write_text(CRANK.replace("speed = {", "many = {"), encoding="utf-8")
    with pytest.raises(FmuError, match=r"crank\.fmu has no variable 'many'"):  # an array is no signal
        engine(f"fmu:{crank}")
    content = members(crank)
    redescribed('"token"', '"another"')(content)
    text.write_text(CRANK, encoding="utf-8")
    with pytest.raises(SimulationError, match="it failed while it was instantiated"):
        trace(f"fmu:{packed(content, crank)}")

"""No field of a mechanism file is without effect unless somebody is told.

Every field is changed on a linkage on which it must matter, and every command is asked before and after.  Its result
moves, of a comparison on both sides alike and by more than they may differ by; or a sentence of the result names the
field as left out; or the command refuses, and names it.  Nothing else passes.
"""

from __future__ import annotations

import json
import re
import tempfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import linkage_crosscheck as lc
from analytic.errors import Error
from analytic.mechanism import Body, Drive, Elasticity, Joint, Load, Mechanism, Sensor, Spring, Stop
from compare.cli.app import app
from compare.crosscheck import crosscheck_job, job_of
from compare.export import exported
from compare.omissions import OMISSIONS, Asked, omitted
from compare.platform import platform_accuracy
from compare.questions.analyse import ExportQuestion
from compare.questions.crosscheck import CrosscheckQuestion
from matrix_cases import CHANGES, COGGING, FOUR_BAR, IDLE, SLIDER_CRANK, Change, fields, mechanism
from sim_models.engine import ENGINES, JOINT_MODELS, MOTIONS, declared, engine

pytestmark = [
    pytest.mark.filterwarnings("ignore::UserWarning"),  # a result has them among its sentences
    pytest.mark.filterwarnings("ignore::numpy.exceptions.RankWarning"),  # of columns that stand still
]

ANGLES, TIMES, SWINGING = np.array([1.9, 2.1]), np.array([0.0, 0.01, 0.025, 0.03]), np.linspace(0.0, 0.012, 4)
ROWS = np.linspace(1.9, 2.1, 12)  # rad, of a file to be checked: the motion of a crank takes some
ROUNDING = 1e-8  # of a signal's peak: an equilibrium is found to 1e-9 of it
Numbers = Mapping[str, np.ndarray | str]


@dataclass(frozen=True)
class Cell:
    """One way of asking.  A motion is ``driven``, ``static`` or ``free``; ``timed`` asks by time in place of angle."""

    command: str
    motion: str = "driven"
    joint_model: Any = None
    simulator: str = ""
    timed: bool = False

    @property
    def where(self) -> dict[str, Any]:
        """When it is looked at."""
        return {} if self.motion == "free" else {"times": TIMES} if self.timed else {"angles": ANGLES}

    @property
    def moves(self) -> Any:
        """The motion, as commands call it."""
        return "static" if self.motion == "static" else "driven"

    def __str__(self) -> str:
        words = (self.command, self.motion, "timed" * self.timed, self.joint_model, self.simulator)
        return " ".join(word for word in words if word)


OF_STOPS = tuple(f"Stop.{field}" for field in ("joint", "start", "end", "stiffness", "damping"))  # the same, by stop
OF_VARYING_LOADS = ("Load.over", "Load.start", "Load.end", "Load.table")  # refused as a whole, by over


@dataclass(frozen=True)
class Answer:
    """What a command says: numbers by side and signal, sentences, by how much the sides may differ, or its refusal."""

    sides: Mapping[str, Numbers] = field(default_factory=dict)
    sentences: tuple[str, ...] = ()
    tolerance: Mapping[str, float] = field(default_factory=dict)
    refused: str = ""
    failed: bool = False  # a simulation that has no result, and says why


@cache
def ask(cell: Cell, text: str, file: str) -> Answer:
    """The answer on a mechanism (JSON); of ``check``, to a file that an engine wrote of the other one."""
    mechanism, other = (Mechanism.model_validate_json(each) for each in (text, file))
    try:
        return ASKED[cell.command](cell, mechanism, other)
    except Error as error:
        return Answer(refused=str(error))


def _analyse(cell: Cell, m: Mechanism, other: Mechanism) -> Answer:
    found = lc.analyse(m, motion=cell.moves, compliance=cell.command.endswith("compliance"), **cell.where)
    varied = {} if found.tolerances is None else _flat(found.tolerances.model_dump(), "tolerances")
    return Answer({"analytic": {**found.signals, **dict(varied), "case": found.case}}, found.warnings)


def _accuracy(cell: Cell, m: Mechanism, other: Mechanism) -> Answer:
    several = platform_accuracy(m, **cell.where) if cell.timed else None
    found = several or lc.accuracy(m, motion=cell.moves, samples=50, **cell.where)
    return Answer({"analytic": numbers(found)}, found.warnings)


def _simulate(cell: Cell, m: Mechanism, other: Mechanism) -> Answer:
    found = lc.simulate(m, cell.simulator, joint_model=cell.joint_model, motion=cell.moves, **cell.where)
    return Answer({"simulated": {**found.signals, "case": found.case}}, found.warnings)


def _compare(cell: Cell, m: Mechanism, other: Mechanism) -> Answer:
    how = {"joint_model": cell.joint_model, "flexible": cell.command.endswith("flexible"), "revolutions": 0}
    job = job_of(CrosscheckQuestion(m, cell.simulator, motion=cell.moves, workers=1, **how, **cell.where))
    if cell.motion == "free":
        job = replace(job, schedule=replace(job.schedule, time=SWINGING))
    found = crosscheck_job(job)
    if found.failures:
        return Answer(refused=found.failures[0].why, failed=True)
    (run,) = found.runs
    sides = {"analytic": run.analytic, "simulated": run.simulated}
    tolerance = {one.signal: one.tolerance for one in run.discrepancies}
    return Answer({side: {**told, "case": found.case} for side, told in sides.items()}, found.warnings, tolerance)


def _check(cell: Cell, m: Mechanism, other: Mechanism) -> Answer:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "signals.csv"
        file.write_text(recorded(cell, other.model_dump_json(exclude_unset=True, by_alias=True)), encoding="utf-8")
        found = lc.check(file, m, joint_model=cell.joint_model, motion=cell.moves)
    return Answer({"analytic": {**found.runs[0].analytic, "case": found.case}}, found.warnings)


@cache
def recorded(cell: Cell, text: str) -> str:
    """What an engine writes of a mechanism (JSON), which is the same whatever is then held against it."""
    where = {"angles": ROWS if cell.motion == "driven" else ANGLES}
    how = {"joint_model": cell.joint_model, "motion": cell.moves}
    return lc.simulate(Mechanism.model_validate_json(text), cell.simulator, **how, **where).files()["signals.csv"]


def _validity(cell: Cell, m: Mechanism, other: Mechanism) -> Answer:
    grid = {"speeds": [4.0], "clearances": [1e-4], "revolutions": 0}
    found = lc.validity(m, simulator=cell.simulator, joint_model=cell.joint_model, workers=1, **grid)
    return Answer({"simulated": numbers(found)}, found.warnings)


def _export(cell: Cell, m: Mechanism, other: Mechanism) -> Answer:
    how = {"joint_model": cell.joint_model, "motion": cell.moves}
    texts = exported(ExportQuestion(m, cell.simulator, folder=".", **how, **cell.where))
    heading, *rows = texts["expected.csv"].splitlines()
    table = np.array([[float(each) for each in row.split(",")] for row in rows])
    sentences = tuple(line for line in texts["run.py"].splitlines() if line.startswith("# "))
    model = texts.get("model.xml") or texts["run.py"]
    named = {"case": m.name if m.name in model + "".join(texts.values()) else "unnamed"}
    return Answer({"simulated": {**dict(zip(heading.split(","), table.T, strict=True)), **named}}, sentences)


ASKED = {
    "analyse": _analyse,
    "analyse --compliance": _analyse,
    "accuracy": _accuracy,
    "simulate": _simulate,
    "compare": _compare,
    "compare --flexible": _compare,
    "check": _check,
    "validity": _validity,
    "export": _export,
}


def numbers(document: Any) -> Numbers:
    """All numbers of a document by their place, but for settings and what it repeats of the question."""
    asked = {"mechanism", "versions", "command", "warnings", "assumed", "settings", "samples", "seed"}
    return dict(_flat(document.model_dump(exclude=asked), ""))


def _flat(value: Any, place: str) -> Iterable[tuple[str, np.ndarray | str]]:
    if isinstance(value, Mapping):
        for name, inner in value.items():
            yield from _flat(inner, f"{place}/{name}")
    elif isinstance(value, tuple | list):
        for k, inner in enumerate(value):
            yield from _flat(inner, f"{place}/{k}")
    elif isinstance(value, str):
        yield place, value
    else:
        yield place, np.atleast_1d(np.asarray(np.nan if value is None else value, float))


# ---------------------------------------------------------------- judging


def unexplained(cell: Cell, name: str, change: Change) -> str:
    """What is wrong with a cell; empty where its result moves, says so, or is refused for what it is."""
    first, second = asked_twice(cell, change)
    if first.refused or second.failed or first is second:
        return ""  # the question is refused as such, has no result, or is the same: what is let go has no drive's speed
    if second.refused:
        misfit = cell.command == "check" and "is not a signal of" in second.refused  # its file is of the other linkage
        return "" if misfit or names_it(second.refused, name) else f"refused for {second.refused}"
    if any("left out" in sentence and names_it(sentence, name) for sentence in second.sentences):
        return ""
    return judged(first, second)


def asked_twice(cell: Cell, change: Change) -> tuple[Answer, Answer]:
    """The answers before and after a change; of ``check`` to a file of what it was before."""
    texts = [m.model_dump_json(exclude_unset=True, by_alias=True) for m in change.mechanisms(cell.motion == "free")]
    first, second = (ask(cell, text, texts[0] if cell.command == "check" else text) for text in texts)
    return first, second


def names_it(sentence: str, name: str) -> bool:
    """Whether a sentence names a field, or that of which it is a part."""
    part, word = name.split(".")
    within = {
        "Ripple": "ripple",
        "PeriodicTorque": "periodic_torque",
        "Elasticity": "elasticity",
        "Tolerance": "tolerances",
        "Sensor": "sensor",
    }.get(part, word)
    within = "over" if name in OF_VARYING_LOADS else "stop" if name in OF_STOPS else within
    return re.search(rf"\b({word}|{within})\b", sentence) is not None


def judged(first: Answer, second: Answer) -> str:
    """Why two answers do not show that something was changed between them; empty where they do."""
    still = [side for side in first.sides if not moved(first.sides[side], second.sides[side])]
    if still:
        return f"nothing moves: {', '.join(still)}"
    if not first.tolerance or first.sides["analytic"].keys() != second.sides["analytic"].keys():
        return ""
    if first.sides["analytic"]["case"] != second.sides["analytic"]["case"]:
        return ""
    apart, most = 0.0, 0.0
    for signal in first.tolerance.keys() & second.tolerance.keys():
        allowed = first.tolerance[signal] + second.tolerance[signal]
        ours, theirs = (_change(signal, first.sides[s], second.sides[s]) for s in ("analytic", "simulated"))
        apart = max(apart, float(np.nanmax(np.abs(_wrapped(signal, theirs - ours)), initial=0.0)) / allowed)
        most = max(most, float(np.nanmax(np.abs(ours), initial=0.0)) / allowed)
    if apart > 1:
        return f"the sides move apart, by {apart:.3g} times what they may differ by"
    return "" if most > 1 else f"the case is too weak: the sides move by {most:.2g} of what they may differ by"


def moved(one: Numbers, other: Numbers) -> bool:
    """Whether numbers differ by more than rounding."""
    if one.keys() != other.keys():
        return True
    return any(_apart(one[name], other[name]) for name in one)


def _apart(one: np.ndarray | str, other: np.ndarray | str) -> bool:
    if isinstance(one, str) or isinstance(other, str) or one.shape != other.shape:
        return bool(np.any(one != other))
    peak = max(float(np.nanmax(np.abs(each), initial=1e-6)) for each in (one, other))
    return not np.allclose(one, other, rtol=0.0, atol=ROUNDING * peak, equal_nan=True)


def _change(signal: str, one: Numbers, other: Numbers) -> np.ndarray:
    return _wrapped(signal, np.asarray(other[signal], float) - np.asarray(one[signal], float))


def _wrapped(signal: str, values: np.ndarray) -> np.ndarray:
    return (values + np.pi) % (2 * np.pi) - np.pi if signal.endswith(("_angle", "_rotation")) else values


# ---------------------------------------------------------------- the matrix

ANALYTIC = [
    *(Cell(command, motion) for command in ("analyse", "accuracy") for motion in ("driven", "static")),
    Cell("analyse --compliance", "static"),
]
TIMED = [replace(cell, timed=True) for cell in ANALYTIC if cell != Cell("accuracy", "static")]
LOOSE = ("clearance", "fit", "guide", "contact_stiffness", "contact_damping", "contact_law", "restitution")
FIRST = tuple(f"Joint.{field}" for field in ("clearance", "guide", "contact_stiffness", "friction"))  # seen quickly
SOON = list(CHANGES)[::4]  # fields of the fast suite, and of maps
TOUCHING = tuple(f"Joint.{field}" for field in (*LOOSE, "friction", "pin_radius"))


def quick(name: str) -> list[Cell]:
    """Cells of the fast suite: the analytic side and MuJoCo; contact where the field is one of contact."""
    found = [Cell("analyse", motion) for motion in MOTIONS]
    found += [Cell("compare", "driven", "ideal", "mujoco")]
    if name in TOUCHING:
        return found + [Cell("compare", "static", "contact", "mujoco")] * (name in FIRST)
    return [*found, Cell("check", "static", "ideal", "mujoco")]


def every(simulator: str, name: str) -> list[Cell]:
    """Cells of an engine: of its joint models all where the field is one of contact.  The first engine has those that
    no engine makes different as well.
    """
    able, models = engine(simulator).capabilities, JOINT_MODELS[1:] if name in TOUCHING else ("contact",)
    quickly = [("driven", True), ("static", False)]  # what has clearance: by time no turn leads in, which is quick
    first = simulator == ENGINES[0]
    ideal = [(motion, timed) for motion in MOTIONS for timed in (False, True)] if first else quickly
    found = [Cell("compare", motion, "ideal", simulator, timed) for motion, timed in ideal]
    found += [Cell("compare", "free", "ideal", simulator)]
    found += [Cell("compare", motion, model, simulator, timed) for model in models for motion, timed in quickly]
    moving = "contact" if ("contact", "driven") in able.runs else "ideal"
    for command in ["simulate"] * first + ["export"] * (able.export is not None):  # the same runs
        found += [Cell(command, "driven", moving, simulator, True), Cell(command, "static", "ideal", simulator)]
    if first:  # a map is over whole turns, and asks every engine as a comparison does
        found += [Cell("check", m, model, simulator) for m, model in (("driven", "ideal"), ("static", "contact"))]
        found += [*ANALYTIC, *TIMED]
        found += [Cell("validity", joint_model="contact", simulator=simulator)] * (name in (*TOUCHING, *SOON))
    return found + [Cell("compare --flexible", "static", "ideal", simulator)] * (able.beams is not None)


def held(name: str, cells: list[Cell], change: Change | None = None) -> None:
    """Every cell of a field is explained, and some have a result."""
    change = change or CHANGES[name]
    assert not all(asked_twice(cell, change)[0].refused for cell in cells)
    wrong = {str(cell): unexplained(cell, name, change) for cell in cells}
    wrong = {cell: why for cell, why in wrong.items() if why}
    assert not wrong, "\n".join(f"{name}: {cell}: {why}" for cell, why in wrong.items())


def test_every_field_of_a_mechanism_file_has_a_case() -> None:
    """A field that is new must be asked of all commands."""
    assert fields() == CHANGES.keys()


@pytest.mark.long_rows(
    "Joint.contact_stiffness", "Tolerance.sd", "Stop.joint", "Load.end", "Joint.bodies", "Joint.fit",
    "PeriodicTorque.harmonic", "Ripple.amplitude", "Sensor.axis", "Joint.rest_angle", "Mechanism.name", "Sensor.name",
    "Body.youngs_modulus", "Drive.joint", "Body.com",
)  # fmt: skip
@pytest.mark.mujoco
@pytest.mark.parametrize("name", SOON)
def test_a_field_moves_the_result_or_is_named_by_the_analytic_side_and_mujoco(name: str) -> None:
    """By a command of each kind: one side alone, both, and somebody's numbers; all others, and all fields, are slow."""
    held(name, quick(name))


@pytest.mark.long_rows("PeriodicTorque.amplitude", "Spring.bodies", "Load.body", "Spring.length", "Body.section")
@pytest.mark.mujoco
@pytest.mark.parametrize("name", IDLE)
def test_a_field_that_can_do_nothing_in_this_linkage_is_named(name: str) -> None:
    """A load or spring without force, an inertia of what never turns, and cogging of a stiff drive for accuracy."""
    told = []
    for cell in (Cell("analyse"), Cell("accuracy"), Cell("simulate", "driven", "ideal", "mujoco")):
        first, second = asked_twice(cell, IDLE[name])
        told.append(any(names_it(sentence, name) for sentence in second.sentences))
        assert told[-1] == all(not moved(first.sides[side], second.sides[side]) for side in first.sides), str(cell)
    assert any(told)


@pytest.mark.slow
@pytest.mark.parametrize("name", CHANGES)
@pytest.mark.parametrize("simulator", [pytest.param(name, marks=getattr(pytest.mark, name)) for name in ENGINES])
def test_a_field_moves_the_result_or_is_named_by_every_engine(simulator: str, name: str) -> None:
    """In every command, motion and joint model that the engine has."""
    change, able = CHANGES[name], {feature for feature, _ in declared(simulator).capabilities.rigid.features}
    if name in OF_VARYING_LOADS and "varying_load" not in able and not isinstance(change.after, tuple):
        change = Change({**change.before, **change.after}, base=change.base)  # from a load that is constant
    held(name, every(simulator, name), change)


def test_what_nobody_uses_is_not_taken_for_explained() -> None:
    """Answers that are alike, a side that stands still, sides that move apart, or hardly, are each a fault."""
    still, up, down = ({"case": "", "reaction_B_x": np.array([1.0 + step])} for step in (0.0, 0.5, -0.5))
    slightly = {"case": "", "reaction_B_x": np.array([1.001])}
    before = Answer({"analytic": still, "simulated": still}, tolerance={"reaction_B_x": 0.01})
    for ours, theirs, fault in (
        (still, still, "nothing moves: analytic, simulated"),
        (up, still, "nothing moves: simulated"),
        (up, down, "the sides move apart, by 50 times what they may differ by"),
        (slightly, slightly, "the case is too weak: the sides move by 0.05 of what they may differ by"),
        (up, up, ""),
    ):
        assert judged(before, replace(before, sides={"analytic": ours, "simulated": theirs})) == fault
    assert names_it("left out: damping of joint D, as nothing moves at rest", "Joint.damping")
    assert not names_it("left out: contact_damping of joint D, as nothing moves at rest", "Joint.damping")


def test_the_table_of_what_is_left_out_has_fields_that_there_are() -> None:
    parts = {"body": Body, "joint": Joint, "spring": Spring, "load": Load, "drive": Drive}
    parts |= {"stop": Stop, "sensor": Sensor, "mechanism": Mechanism}
    for one in OMISSIONS:
        for kind, name, *within in (each.split(".") for each in one.fields):
            assert name in parts[kind].model_fields, one.fields
            assert set(within) <= Elasticity.model_fields.keys(), one.fields


@pytest.mark.mujoco
def test_a_console_a_result_and_an_export_say_what_is_left_out(tmp_path: Path) -> None:
    """A shipped case has moduli of elasticity; a rigid link has no use for them."""
    says = "left out: youngs_modulus and shear_modulus of crank, coupler and follower"
    for command in ("analyse", "simulate", "export --simulator mujoco"):
        out = str(tmp_path / command.split()[0])
        asked = [*command.split(), "--case", "crank-rocker", "--angles", "30:60:30", "--out", out]
        run = CliRunner().invoke(app, [*asked, "--json"])
        assert run.exit_code == 0, run.output
        assert says in run.stderr
        assert says in json.loads(run.stdout)["warnings"][0]
    assert (tmp_path / "export" / "run.py").read_text(encoding="utf-8").startswith(f"# {says}")


@pytest.mark.parametrize("where", [{"angles": ANGLES}, {"times": TIMES}])
def test_a_result_has_its_warnings_whatever_python_is_told_to_show(where: dict[str, Any]) -> None:
    """Somebody who ignores warnings in a notebook still has them in the result; so has an analysis over time."""
    uneven, _ = CHANGES["Ripple.phase"].mechanisms()
    assert any("drive.ripple is left out" in text for text in lc.analyse(uneven, **where).warnings)


def test_a_soft_drive_gives_the_same_to_a_platform_as_to_an_analysis_at_rest() -> None:
    """The crank lags by its torque over the drive's stiffness, links rigid or not."""
    soft = mechanism(FOUR_BAR, {"drive.stiffness": 2000.0})
    by_time = platform_accuracy(soft, times=TIMES)
    stiff, lagging = (lc.analyse(soft, motion="static", compliance=c, times=TIMES).signals for c in (False, True))
    for name in ("crank_angle", "rocker_x"):
        lag = lagging[name] - stiff[name]
        np.testing.assert_allclose(by_time.outputs[name].compliance, lag, rtol=1e-9, atol=1e-15)
    assert lag.max() < -1e-4  # m
    torque = lc.analyse(soft.ideal(), motion="static", times=TIMES).signals["drive_torque"]
    np.testing.assert_allclose(by_time.outputs["crank_angle"].compliance, -torque / 2000.0, rtol=0.02)


def test_a_zero_that_is_given_is_told_and_a_default_is_not() -> None:
    """A restitution of 0 is one; clearance 0 is none.  A map gives its own joints the clearance that they lack."""
    m = mechanism(FOUR_BAR, {"joint.B.restitution": 0.0, "joint.B.clearance": 0.0, "joint.D.rest_angle": 0.0})
    contact = (Asked("simulate", "static", ("contact",)), Asked("validity", mapped=("B",)))
    at_rest, mapped = (omitted(m, asked) for asked in contact)
    assert any("restitution of joint B" in text and text.endswith("nothing moves at rest") for text in at_rest)
    assert not any("clearance" in text or "rest_angle" in text for text in at_rest)
    assert not any("nothing touches" in text for text in mapped)
    (elsewhere,) = (text for text in omitted(m, Asked("validity", mapped=("C",))) if "nothing touches" in text)
    assert elsewhere == "left out: restitution of joint B, as nothing touches without clearance"


@pytest.mark.parametrize(
    ("text", "joint", "name", "tight"),
    [
        (FOUR_BAR, "D", "friction_torque", {}),
        (SLIDER_CRANK, "S", "friction_torque", {"joint.S.clearance": None}),
        (SLIDER_CRANK, "S", "friction", {"joint.S.clearance": None, "joint.S.guide": None}),
    ],
)
def test_friction_of_slip_is_told_where_static_friction_holds_at_rest(
    text: str, joint: str, name: str, tight: dict[str, Any]
) -> None:
    """It does nothing at rest, where static_torque is all, and is told; in motion it acts, and is not."""
    given = {**tight, f"joint.{joint}.static_torque": 15.0, f"joint.{joint}.stribeck_speed": 0.05}
    light, heavy = (mechanism(text, {**given, f"joint.{joint}.{name}": size}) for size in (0.3, 12.0))
    for motion, acts in (("static", False), ("driven", True)):
        found = [lc.analyse(m, motion=motion, times=TIMES) for m in (light, heavy)]
        torque, other = (one.signals["drive_torque"] for one in found)
        assert (float(np.abs(torque - other).max()) > 0.01) is acts
        said = f"left out: {name} of joint {joint}, as dry friction at rest is static_torque"
        assert (said in found[1].warnings) is not acts


def test_what_acts_is_not_told_with_what_does_not() -> None:
    """Of two loads at one point the one without force is told; a damper has no length; a block that leans, turns."""
    m = mechanism(FOUR_BAR, {"load.1": {"body": "coupler", "torque": 0.0}, "spring.0.stiffness": 0.0})
    assert omitted(m, Asked("analyse")) == [
        "left out: body of the load coupler.com, as it has neither force nor torque",
        "left out: length of the spring ground.P to coupler.P, as it has no stiffness",
    ]
    loose = mechanism(SLIDER_CRANK, {})
    for joint_models, slides in ((("ideal",), True), (("ideal", "contact"), False)):
        told = omitted(loose, Asked("simulate", joint_models=joint_models))
        assert ("left out: inertia of block, as it only slides" in told) is slides
    assert not any("it only slides" in text for text in omitted(loose, Asked("analyse")))
    cogged = mechanism(FOUR_BAR, COGGING)
    assert not any("periodic_torque" in text for text in omitted(cogged, Asked("accuracy", bends=True)))

"""Malformed and hostile inputs: exit status 2, one sentence that names file, field and value, no traceback, and nothing
written.

One table, in groups:

MECHANISM_FIELDS  each number of a mechanism file as what it cannot be: no number, no finite one, out of its range
MECHANISM_PARTS   what the parts say of each other: names twice or unknown, joints missing, bodies without length,
                  drives that drive nothing
LINKAGES          files that are right by themselves and make no linkage: loops that do not close, change points,
                  too many or too few joints
TEXTS             files that are not what they are called: other encodings, null and control characters, nesting and
                  digits without end
PLACES            no files at all: folders, pipes, devices, loops of links, names without end
TOLERANCES        tolerance files
BASELINES         baseline files
RESULTS           results for ``show``
REPORTS           stored reports for ``validation`` and ``scoreboard``
ARGUMENTS         options: angles, clearances, lists, engines, joints, speeds, folders

A row is what the command is given and the words that its sentence must have.
"""

from __future__ import annotations

import copy
import json
import os
import signal
import sys
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import tomli_w

from analytic.mechanism.file import dumps, load
from compare.cli.app import main
from compare.files import to_json
from linkages import INVERTED_SLIDER, SCOTCH_YOKE, chain
from sample_result import sample_result
from tests.evidence import __main__ as evidence

TEXT = dumps(load("paper"))
PAPER = tomllib.loads(TEXT)
DEEP = "[" * 5000 + "]" * 5000
DIGITS = "9" * 5001
CHECK = ["--simulator", "mujoco", "--out", "out"]
MINE = [*CHECK, "--case", "mine.toml"]
PATIENCE = 100  # s; all of these take less than one, and a pipe or an endless file would take for ever


Content = str | bytes | dict[str, Any] | Callable[[Path], object]


@dataclass(frozen=True)
class Row:
    """A command line, the words of its sentence, and what lies in the folder before: texts, bytes, fields of a TOML
    file, or what makes them.
    """

    arguments: list[str]
    words: list[str]
    files: dict[str, Content] = field(default_factory=dict)
    main: Callable[[], None] = main


def with_field(path: tuple[Any, ...], value: Any, base: dict[str, Any] = PAPER) -> dict[str, Any]:
    """The mechanism's fields with one of them, wherever it is, set to a value; ``...`` takes it away."""
    found = copy.deepcopy(base)
    here: Any = found
    for step in path[:-1]:
        here = here.setdefault(step, {}) if isinstance(here, dict) else here[step]
    if value is ...:
        del here[path[-1]]
    else:
        here[path[-1]] = value
    return found


def mine(fields: dict[str, Any] | str | bytes, *words: str) -> Row:
    """A cross-check of a mechanism file."""
    return Row(MINE, ["mine.toml: ", *words], {"mine.toml": fields})


# ---------------------------------------------------------------- mechanism files

NUMBERS: dict[
    str, tuple[tuple[Any, ...], float | None]
] = {  # where, and the least that it may be (but for 0 and less: None)
    "ground.points.E[0]": (("ground", "points", "E", 0), None),
    "gravity[1]": (("gravity", 1), None),
    "body[coupler].points.B[0]": (("body", 1, "points", "B", 0), None),
    "body[coupler].mass": (("body", 1, "mass"), 1e-9),
    "body[coupler].com[1]": (("body", 1, "com", 1), None),
    "body[coupler].section[0]": (("body", 1, "section", 0), 0.0),
    "body[coupler].inertia": (("body", 1, "inertia"), 0.0),
    "body[coupler].youngs_modulus": (("body", 1, "youngs_modulus"), 1.0),
    "body[coupler].shear_modulus": (("body", 1, "shear_modulus"), 1.0),
    "joint[B].clearance": (("joint", 2, "clearance"), 0.0),
    "joint[B].pin_radius": (("joint", 2, "pin_radius"), 1e-9),
    "joint[B].friction": (("joint", 2, "friction"), 0.0),
    "joint[B].contact_stiffness": (("joint", 2, "contact_stiffness"), 1.0),
    "joint[B].contact_damping": (("joint", 2, "contact_damping"), 0.0),
    "joint[B].restitution": (("joint", 2, "restitution"), 0.0),
    "joint[B].friction_torque": (("joint", 2, "friction_torque"), 0.0),
    "joint[B].damping": (("joint", 2, "damping"), 0.0),
    "joint[B].stiffness": (("joint", 2, "stiffness"), 0.0),
    "joint[B].rest_angle": (("joint", 2, "rest_angle"), None),
    "joint[B].elasticity.translation": (("joint", 2, "elasticity", "translation"), 1.0),
    "drive.speed": (("drive", "speed"), None),
    "drive.stiffness": (("drive", "stiffness"), 1.0),
    "drive.ripple.amplitude": (("drive", "ripple", "amplitude"), None),
    "load[0].force[1]": (("load", 0, "force", 1), None),
    "load[0].torque": (("load", 0, "torque"), None),
    "assembly.crank": (("assembly", "crank"), None),
}
WHOLE = with_field(
    ("body", 1, "com"),
    [0.2, 0.0],
    with_field(("gravity",), [0.0, -9.81], with_field(("drive", "ripple", "harmonic"), 1)),
)
WHOLE["drive"]["ripple"]["amplitude"] = 0.01


def fields_of_numbers() -> Iterator[tuple[str, Row]]:
    for where, (path, least) in NUMBERS.items():
        values: list[tuple[Any, str]] = [
            ("0.1", "'0.1': input should be a valid number"),
            (float("nan"), "nan: input should be a finite number"),
        ]
        values += [(1e308, "1e+308: input should be less than or equal to")]
        if least is not None:
            values.append((-0.1, "-0.1: input should be greater than"))
        if least:
            mass = where.endswith(".mass")
            values.append((0.0, "0.0: a moving body has mass" if mass else "0.0: input should be greater than 0"))
        for value, words in values:
            yield f"{where} = {value}", mine(with_field(path, value, WHOLE), f"{where} = {words}")


MECHANISM_FIELDS = dict(fields_of_numbers()) | {
    "a subnormal mass": mine(
        with_field(("body", 1, "mass"), 5e-324), "body[coupler].mass = 5e-324", "give at least 1e-100"
    ),
    "a subnormal clearance": mine(with_field(("joint", 2, "clearance"), 5e-324), "joint[B].clearance = 5e-324", "or 0"),
    "a subnormal stiffness": mine(
        with_field(("joint", 2, "contact_stiffness"), 1e-310), "joint[B].contact_stiffness = 1e-310"
    ),
    "true as a mass": mine(with_field(("body", 1, "mass"), True), "body[coupler].mass = True", "valid number"),
    "a date as a mass": mine(
        TEXT.replace("mass = 0.314", "mass = 1979-05-27"), "body[coupler].mass = datetime.date", "valid number"
    ),
    "a list as a mass": mine(with_field(("body", 1, "mass"), [0.3]), "body[coupler].mass = [0.3]", "valid number"),
    "-inf as a point": mine(
        with_field(("body", 1, "points", "B", 0), float("-inf")), "body[coupler].points.B[0] = -inf", "finite"
    ),
    "a point of one number": mine(
        with_field(("body", 1, "points", "B"), [0.4]), "body[coupler].points.B[1] is missing"
    ),
    "a point of three numbers": mine(
        with_field(("body", 1, "points", "B"), [0.4, 0.0, 0.0]), "body[coupler].points.B = (0.4, 0.0, 0.0)", "2 values"
    ),
    "points as a list": mine(with_field(("body", 1, "points"), [[0.0, 0.0]]), "body[coupler].points = [[0.0, 0.0]]"),
    "a number as a name": mine(with_field(("name",), 7), "name = 7", "string"),
    "bodies as a table": mine(with_field(("body",), {"name": "crank"}), "body = {'name': 'crank'}"),
    "no bodies": mine(with_field(("body",), []), "body = []", "at least 1 item"),
    "a speed in words": mine(
        with_field(("drive", "speed"), "fast"),
        "drive.speed = 'fast'",
        "valid number or 'free' or 'measured'",
    ),
    "a harmonic that is none": mine(
        with_field(("drive", "ripple"), {"amplitude": 0.1, "harmonic": 0}), "drive.ripple.harmonic = 0"
    ),
    "a harmonic between two": mine(
        with_field(("drive", "ripple"), {"amplitude": 0.1, "harmonic": 1.5}), "drive.ripple.harmonic = 1.5"
    ),
    "an assembly angle of a million turns": mine(
        with_field(("assembly", "crank"), 6.3e6), "assembly.crank = 6300000.0", "less than or equal to 10000"
    ),
    "a restitution above one": mine(
        with_field(("joint", 2, "restitution"), 1.1), "joint[B].restitution = 1.1", "less than or equal to 1"
    ),
    "a kind of joint that there is not": mine(
        with_field(("joint", 2, "type"), "spherical"), "joint[B].type = 'spherical'", "revolute"
    ),
    "an unknown field of a body": mine(
        with_field(("body", 1, "weight"), 3.0), "body[coupler].weight is not a field", "mass"
    ),
    "an unknown field of a load": mine(
        with_field(("load", 0, "moment"), 3.0), "load[0].moment is not a field", "torque"
    ),
    "an unknown table": mine(with_field(("bodies",), []), "bodies is not a field; did you mean 'body'"),
    "five thousand faulty bodies": mine(TEXT + '[[body]]\nname = "x"\nmass = -1.0\n' * 5000, "and 9995 faults more"),
}

MECHANISM_PARTS = {
    "no name": mine(with_field(("name",), ...), "name is missing"),
    "no ground": mine(with_field(("ground",), ...), "ground is missing"),
    "no joints": mine(with_field(("joint",), ...), "joint is missing"),
    "no assembly angles": mine(with_field(("assembly",), ...), "assembly.crank is missing"),
    "no assembly angle of the coupler": mine(with_field(("assembly", "coupler"), ...), "assembly.coupler is missing"),
    "a body without a name": mine(with_field(("body", 1, "name"), ...), "body[1].name is missing"),
    "a body without points": mine(with_field(("body", 1, "points"), {}), "joint 'A'", "'coupler' has no point"),
    "two bodies of one name": mine(with_field(("body", 1, "name"), "crank"), "body 'crank' is defined twice"),
    "two joints of one name": mine(with_field(("joint", 1, "name"), "D"), "joint 'D' is defined twice"),
    "a body called ground": mine(with_field(("body", 1, "name"), "ground"), "body 'ground' is defined twice"),
    "a body called world": mine(TEXT.replace("coupler", "world"), "body 'world'"),
    "a name with a blank": mine(
        with_field(("body", 1, "name"), "the coupler"), "body[the coupler].name = 'the coupler'"
    ),
    "a name that is empty": mine(with_field(("body", 1, "name"), ""), "body[].name = ''"),
    "a name that climbs out of the folder": mine(
        with_field(("joint", 1, "name"), "../../A"), "joint[../../A].name = '../../A'"
    ),
    "a title without end": mine(with_field(("name",), "a" * 100_000), "name = 'aaa", "at most 100 characters"),
    "a body of a name without end": mine(
        with_field(("body", 1, "name"), "a" * 100_000), "aaa", "at most 100 characters"
    ),
    "a joint with three bodies": mine(
        with_field(("joint", 2, "bodies"), ["crank", "coupler", "follower"]), "joint[B].bodies", "2 values, not 3"
    ),
    "a joint with one body": mine(with_field(("joint", 2, "bodies"), ["crank"]), "joint[B].bodies[1] is missing"),
    "a joint of a body with itself": mine(
        with_field(("joint", 2, "bodies"), ["coupler", "coupler"]), "joint 'B'", "both 'coupler'"
    ),
    "a joint of a body that there is not": mine(
        with_field(("joint", 2, "bodies"), ["coupler", "rocker"]), "joint 'B'", "'rocker'"
    ),
    "a joint without a point": mine(with_field(("joint", 2, "name"), "Q"), "joint 'Q'", "no point 'Q'"),
    "a revolute joint with an axis": mine(with_field(("joint", 2, "axis"), [1.0, 0.0]), "joint 'B'", "axis"),
    "a prismatic joint without an axis": mine(
        with_field(("joint", 2, "type"), "prismatic"), "joint 'B'", "axis is missing"
    ),
    "a body without length": mine(with_field(("body", 1, "points", "B"), [0.0, 0.0]) | {}, "'coupler' has no length"),
    "a clearance larger than a link": mine(
        with_field(("joint", 2, "clearance"), 0.3), "joint 'B'", "clearance = 0.3", "'follower'"
    ),
    "a drive that stands still": mine(with_field(("drive", "speed"), 0.0), "drive.speed = 0"),
    "a drive without a joint": mine(with_field(("drive", "joint"), ...), "drive.joint is missing"),
    "a drive in a joint that there is not": mine(with_field(("drive", "joint"), "Q"), "drive.joint = 'Q'"),
    "a load on the ground": mine(with_field(("load", 0, "body"), "ground"), "load.body = 'ground'"),
    "a load in a point that there is not": mine(with_field(("load", 0, "point"), "Q"), "load.point = 'Q'"),
    "an angle of a body that there is not": mine(with_field(("assembly", "rocker"), 0.0), "assembly.rocker"),
    "a body that is in no joint": mine(
        TEXT + '\n[[body]]\nname = "loose"\npoints = { Z = [0.0, 0.0] }\nmass = 1.0\n', "'loose' sits in no joint"
    ),
}


def without_joint(name: str) -> dict[str, Any]:
    return with_field(("joint",), [j for j in PAPER["joint"] if j["name"] != name])


def twice_held() -> dict[str, Any]:
    """The paper's parallelogram with a second coupler, whose length is not the first's."""
    m = load("paper")
    second = m.moving["coupler"].model_copy(update={"name": "second", "points": {"c": (0.0, 0.0), "f": (0.41, 0.0)}})
    fields = with_field(("body", 0, "points", "c"), [0.1, 0.0], with_field(("body", 2, "points", "f"), [0.1, 0.0]))
    fields["assembly"] = {**fields["assembly"], "second": 0.0}
    fields["body"].append(second.model_dump(exclude_unset=True, mode="json"))
    fields["joint"] += [
        {"name": n, "type": "revolute", "bodies": b}
        for n, b in (("c", ["crank", "second"]), ("f", ["second", "follower"]))
    ]
    return with_field(("joint", 2, "clearance"), 0.0, fields)


SLIDES = SCOTCH_YOKE.replace(
    'type = "revolute", bodies = ["crank", "block"]',
    'type = "prismatic", axis = [1.0, 1.0], bodies = ["crank", "block"]',
)
SHORT = with_field(("joint", 2, "clearance"), 0.0, with_field(("body", 1, "points", "B"), [0.03, 0.0]))

LINKAGES = {
    "a loop that does not close": mine(SHORT, "crank angle 30 deg cannot be reached", "coupler, follower"),
    "a coupler of a subnormal length": mine(
        with_field(("body", 1, "points", "B"), [5e-324, 0.0], with_field(("joint", 2, "clearance"), 0.0)),
        "'coupler' has no length",
    ),
    "a coupler of 1e39 m": mine(with_field(("body", 1, "points", "B"), [1e39, 0.0]), "cannot be reached"),
    "assembly angles of another mode": mine(
        with_field(("assembly", "follower"), 2.0), "does not close near the assembly angles"
    ),
    "assembled flat": mine(
        with_field(("assembly",), {"crank": 0.0, "coupler": 0.0, "follower": 0.0}), "change point at crank angle 0 deg"
    ),
    "assembled almost flat": mine(
        with_field(("assembly",), {"crank": 1e-9, "coupler": 0.0, "follower": 1e-9}), "change point at crank angle"
    ),
    "a joint missing": mine(without_joint("E"), "does not determine coupler, follower", "mobility 3"),
    "a joint missing in the middle": mine(without_joint("B"), "does not determine coupler, follower"),
    "the drive's joint missing": mine(without_joint("D"), "drive.joint = 'D' is not a joint"),
    "a second coupler": mine(twice_held(), "joint 'f' closes a loop that is rigid already", "second", "mobility 0"),
    "a loop of slides": mine(SLIDES, "prismatic"),
    "a chain of 200 links": mine(chain(200, closed=True), "does not determine b1, b2", "and 191 more"),
    "an open chain of 200 links": mine(chain(200, closed=False), "does not determine b1, b2", "and 191 more"),
    "an arm that its slide lets turn": mine(
        INVERTED_SLIDER.replace("axis = [3.0, 1.0]", "axis = [0.0, 0.0]"), "joint 'S'", "axis"
    ),
    "a slide with clearance": mine(
        INVERTED_SLIDER.replace("angle = 0.4", "angle = 0.4\nclearance = 1e-4"),
        "joint 'S'",
        "clearance = 0.0001",
        "give guide =",
    ),
}

TEXTS = {
    "an empty file": mine("", "name is missing"),
    "blanks": mine(" \n\t\n", "name is missing"),
    "no TOML": mine("name = paper\n", "cannot be read as TOML", "line 1"),
    "JSON": mine('{"name": "paper"}', "cannot be read as TOML"),
    "XML": mine("<mujoco/>", "cannot be read as TOML"),
    "an array that does not end": mine("gravity = [0.0, 0.0", "cannot be read as TOML"),
    "a key twice": mine('name = "a"\n' + TEXT, "cannot be read as TOML", "line 2"),
    "a table twice": mine(TEXT + "\n[ground.points]\n", "cannot be read as TOML"),
    "nested too deep": mine(f"x = {DEEP}\n{TEXT}", "nested too deep"),
    "tables nested too deep": mine("x = " + "{a = " * 3000 + "1" + "}" * 3000, "nested too deep"),
    "a key of 3000 parts": mine(".".join("a" * 3000) + " = 1\n" + TEXT, "a is not a field"),
    "a number of 5001 digits": mine(f"x = {DIGITS}\n{TEXT}", "too many digits"),
    "a mass of 5001 digits": mine(TEXT.replace("mass = 0.314", f"mass = {DIGITS}"), "too many digits"),
    "a mass of 400 digits": mine(TEXT.replace("mass = 0.314", f"mass = {'9' * 400}"), "body[coupler].mass = 999"),
    "a mass of 5001 hexadecimal digits": mine(
        TEXT.replace("mass = 0.314", "mass = 0x" + "f" * 5001), "body[coupler].mass = a number of too many digits"
    ),
    "a mass of 1e400": mine(TEXT.replace("mass = 0.314", "mass = 1e400"), "body[coupler].mass = inf"),
    "a key without end": mine("a" * 100_000 + " = 1\n" + TEXT, "aaa... is not a field"),
    "a value without end": mine(TEXT.replace("mass = 0.314", f'mass = "{"a" * 100_000}"'), "body[coupler].mass = 'aaa"),
    "control characters in a key": mine('"a\\u001b[31m\\nb" = 1\n' + TEXT, r"a\x1b[31m\nb is not a field"),
    "control characters in a name": mine(TEXT.replace('"coupler"', '"cou\\u0000pler"'), r"'cou\x00pler'"),
    "text that runs backwards in a name": mine(TEXT.replace('"coupler"', '"cou\u202epler"'), r"cou\u202epler"),
    "control characters in the title": mine(
        TEXT.replace('"paper"', '"pa\\u0007per"'), r"'pa\x07per'", "can be printed"
    ),
    "a line break in the title": mine(TEXT.replace('"paper"', '"pa\\nper"'), r"'pa\nper'", "can be printed"),
    "a null character": mine(TEXT.replace('"paper"', '"pa\0per"'), "cannot be read as TOML", r"\x00"),
    "null characters only": mine(b"\0" * 10_000, "cannot be read as TOML"),
    "all bytes": mine(bytes(range(256)), "not UTF-8 text"),
    "UTF-16": mine(TEXT.encode("utf-16"), "not UTF-8 text"),
    "UTF-16 without a mark": mine(TEXT.encode("utf-16-le"), "cannot be read as TOML"),
    "UTF-32": mine(TEXT.encode("utf-32"), "not UTF-8 text"),
    "Latin-1": mine(TEXT.replace("paper", "pap\xe9r").encode("latin-1"), "not UTF-8 text"),
    "half a surrogate pair": mine(TEXT.encode() + b"\n# \xed\xa0\x80", "not UTF-8 text"),
    "a mark and a fault": mine(
        b"\xef\xbb\xbf" + TEXT.replace("mass = 0.314", "mass = -1.0").encode(), "body[coupler].mass = -1.0"
    ),
    "two marks": mine(b"\xef\xbb\xbf" * 2 + TEXT.encode(), "cannot be read as TOML"),
}


def sparse(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(2**33)


def link(target: str) -> Callable[[Path], object]:
    return lambda path: path.symlink_to(target)


PLACES = {
    "no such file": Row(MINE, ["mine.toml: no such mechanism file or case", "paper"]),
    "a case that is nearly there": Row(
        [*CHECK, "--case", "papr"], ["papr: no such mechanism file or case", "did you mean 'paper'"]
    ),
    "a case alone that is misspelt": Row(
        ["six-barr"], ["six-barr: no such mechanism file or case; did you mean 'six-bar'"]
    ),
    "no case at all": Row([*CHECK, "--case", ""], ["no such mechanism file or case"]),
    "a folder": Row(MINE, ["mine.toml: cannot be read: it is a folder"], {"mine.toml": Path.mkdir}),
    "a pipe": Row(MINE, ["mine.toml: cannot be read: it is a pipe or a device"], {"mine.toml": os.mkfifo}),
    "an endless device": Row(
        MINE, ["mine.toml: cannot be read: it is a pipe or a device"], {"mine.toml": link("/dev/zero")}
    ),
    "a loop of links": Row(
        MINE, ["mine.toml: cannot be read: Too many levels of symbolic links"], {"mine.toml": link("mine.toml")}
    ),
    "a link to nothing": Row(
        MINE, ["mine.toml: cannot be read: there is no such file"], {"mine.toml": link("nowhere")}
    ),
    "a file of 8 GB": Row(MINE, ["mine.toml: cannot be read: it is larger than 16 MB"], {"mine.toml": sparse}),
    "a path through a file": Row([*CHECK, "--case", "file/mine.toml"], ["no such mechanism file"], {"file": ""}),
    "a name of 5000 letters": Row([*CHECK, "--case", "a" * 5000], ["aaa...: no such mechanism file or case"]),
    "a name in two lines": Row([*CHECK, "--case", "a\nb.toml"], ["a b.toml: no such mechanism file or case"]),
    "a name that colours the terminal": Row(
        [*CHECK, "--case", "\x1b[31m.toml"], [r"\x1b[31m.toml: no such mechanism file or case"]
    ),
    "a folder for tolerances": Row(
        [*CHECK, "--tolerance", "t"], ["--tolerance t: cannot be read: it is a folder"], {"t": Path.mkdir}
    ),
    "a pipe for tolerances": Row(
        [*CHECK, "--tolerance", "t"], ["--tolerance t: cannot be read: it is a pipe"], {"t": os.mkfifo}
    ),
    "a folder for a result": Row(
        ["show", "r", "--signal", "x", "--at", "1"], ["r: cannot be read: it is a folder"], {"r": Path.mkdir}
    ),
    "a pipe for a result": Row(
        ["show", "r", "--signal", "x", "--at", "1"], ["r: cannot be read: it is a pipe"], {"r": os.mkfifo}
    ),
    "an endless result": Row(
        ["show", "r", "--signal", "x", "--at", "1"], ["r: cannot be read: it is a pipe"], {"r": link("/dev/zero")}
    ),
    "a result of 8 GB": Row(
        ["show", "r", "--signal", "x", "--at", "1"], ["r: cannot be read: it is larger than 256 MB"], {"r": sparse}
    ),
    "a result that is a pipe, in the way": Row(
        CHECK, ["--out out", "does not say which command made it"], {"out/result.json": os.mkfifo}
    ),
    "a result nested too deep, in the way": Row(
        CHECK, ["--out out", "does not say which command made it"], {"out/result.json": DEEP}
    ),
    "a result of another command, in the way": Row(
        CHECK, ["--out out", "another command"], {"out/result.json": '{"command": "compare cases"}'}
    ),
    "measured data of 5000 letters": Row(
        ["diagnose", "a" * 5000, "--out", "out"], ["cannot be read: File name too long"]
    ),
    "a mechanism of measured data, nested too deep": Row(
        ["diagnose", "m.toml", "--out", "out"],
        ["m.toml: mechanism = 'mine.toml': mine.toml: cannot be read as TOML: its values are nested too deep"],
        {"m.toml": 'mechanism = "mine.toml"\n[[run]]\nname = "a"\nfile = "a.csv"\n', "mine.toml": f"x = {DEEP}"},
    ),
    "no measured data": Row(["diagnose", "m.toml", "--out", "out"], ["m.toml: cannot be read: there is no such file"]),
    "a folder for measured data": Row(
        ["diagnose", "m.toml", "--out", "out"],
        ["m.toml/measured.toml: cannot be read: there is no such file"],
        {"m.toml": Path.mkdir},
    ),
    "a pipe for measured data": Row(
        ["diagnose", "m.toml", "--out", "out"], ["m.toml: cannot be read: it is a pipe"], {"m.toml": os.mkfifo}
    ),
    "measured data nested too deep": Row(
        ["diagnose", "m.toml", "--out", "out"], ["m.toml: cannot be read as TOML"], {"m.toml": f"x = {DEEP}"}
    ),
    "measured data of 5001 digits": Row(
        ["diagnose", "m.toml", "--out", "out"], ["m.toml: cannot be read as TOML"], {"m.toml": f"x = {DIGITS}"}
    ),
}


# ---------------------------------------------------------------- other files


def tolerances(text: str | bytes, *words: str) -> Row:
    return Row([*CHECK, "--tolerance", "mine.toml"], ["--tolerance mine.toml: ", *words], {"mine.toml": text})


KNOWN = '[[known]]\ncase = "paper"\nsignal = "reaction_B_angle"\nbound = 0.1\nreason = "so"\n'
TOLERANCES = {
    "no TOML": tolerances("floor = ", "cannot be read as TOML"),
    "nested too deep": tolerances(f"floor = {DEEP}", "nested too deep"),
    "too many digits": tolerances(f"floor = {DIGITS}", "too many digits"),
    "UTF-16": tolerances("floor = 0.1".encode("utf-16"), "not UTF-8 text"),
    "a floor in words": tolerances('floor = "low"', "floor = 'low'"),
    "a floor of one": tolerances("floor = 1.0", "floor = 1.0"),
    "a floor that is no number": tolerances("floor = nan", "floor = nan"),
    "a noise below zero": tolerances("noise = -1e-8", "noise = -1e-08"),
    "an endless rest": tolerances("rest = inf", "rest = inf"),
    "an unknown field": tolerances("celing = 0.1", "celing is not a field"),
    "an unknown motion": tolerances("[swinging.ideal]\nangle = { absolute = 1.0 }", "swinging is not a field"),
    "an unknown joint model": tolerances("[static.rubber]\nangle = { absolute = 1.0 }", "static.rubber is not a field"),
    "an unknown kind": tolerances(
        "[static.ideal]\nangel = { absolute = 1.0 }", "static.ideal.angel is not a field", "angle"
    ),
    "a line that says nothing": tolerances("[static.ideal]\nangle = {}", "static.ideal.angle"),
    "a line that is a number": tolerances("[static.ideal]\nangle = 0.1", "static.ideal.angle = 0.1"),
    "an absolute below zero": tolerances(
        "[static.ideal]\nangle = { absolute = -1.0 }", "static.ideal.angle.absolute = -1.0"
    ),
    "a relative that is no number": tolerances(
        "[static.ideal]\nangle = { relative = nan }", "static.ideal.angle.relative = nan"
    ),
    "a window of a radian": tolerances(
        "[static.ideal]\nangle = { absolute = 0.1, window = 1.0 }", "static.ideal.angle.window = 1.0"
    ),
    "a known difference without a bound": tolerances(KNOWN.replace("bound = 0.1\n", ""), "known[0].bound is missing"),
    "a known difference without a reason": tolerances(KNOWN.replace('"so"', '""'), "known[0].reason = ''"),
    "a known difference in an engine that there is not": tolerances(
        KNOWN + 'simulator = "adams"', "known[0].simulator = 'adams'", "mujoco"
    ),
    "a known difference in a joint model that there is not": tolerances(
        KNOWN + 'joint_model = "rubber"', "known[0].joint_model[0] = 'rubber'"
    ),
    "a known difference of nothing": Row(
        [*CHECK, "--tolerance", "mine.toml"],
        ["known.signal = 'force_B'", "not compared"],
        {"mine.toml": KNOWN.replace("reaction_B_angle", "force_B")},
    ),
}

BASELINE = """schema = 1
case = "paper"
simulator = "mujoco"
version = "0"
[tolerance]
angle = 0.005
[[run]]
name = "ideal, driven"
columns = ["crank_angle [deg]", "reaction_B_angle [deg]"]
rows = [[20.0, 1.0]]
"""


def baseline(text: str | bytes | Callable[[Path], object], *words: str) -> Row:
    arguments = ["baseline", "check", "--case", "paper", "--simulator", "mujoco", "--baselines", "."]
    return Row(arguments, ["paper-mujoco.toml", *words], {"paper-mujoco.toml": text})


BASELINES = {
    "none": Row(
        ["baseline", "check", "--case", "paper", "--simulator", "mujoco", "--baselines", "."],
        ["no such baseline", "compare baseline update"],
    ),
    "a folder": baseline(Path.mkdir, "it is a folder"),
    "a pipe": baseline(os.mkfifo, "it is a pipe"),
    "in a folder of 300 letters": Row(
        ["baseline", "check", "--case", "paper", "--simulator", "mujoco", "--baselines", "a" * 300],
        ["no such baseline", "compare baseline update"],
    ),
    "no TOML": baseline(BASELINE.rpartition(",")[0], "cannot be read as TOML"),
    "nested too deep": baseline(f"x = {DEEP}", "nested too deep"),
    "too many digits": baseline(BASELINE.replace("20.0", DIGITS), "too many digits"),
    "UTF-16": baseline(BASELINE.encode("utf-16"), "not UTF-8 text"),
    "another schema": baseline(BASELINE.replace("schema = 1", "schema = 9"), "schema = 9"),
    "another case": baseline(BASELINE.replace('"paper"', '"crank-rocker"'), "'crank-rocker'"),
    "another engine": baseline(BASELINE.replace('"mujoco"', '"exudyn"'), "of 'paper' in exudyn"),
    "no runs": baseline(BASELINE.partition("[[run]]")[0], "run is missing"),
    "a tolerance of zero": baseline(BASELINE.replace("0.005", "0.0"), "tolerance.angle = 0.0"),
    "a tolerance that is no number": baseline(BASELINE.replace("0.005", "nan"), "tolerance.angle = nan"),
    "a word in a row": baseline(BASELINE.replace("20.0", '"20"'), "run[ideal, driven].rows[0][0] = '20'"),
    "an endless number in a row": baseline(BASELINE.replace("20.0", "inf"), "crank_angle [deg] = inf"),
    "a row too short": baseline(BASELINE.replace("20.0, ", ""), "1 numbers for 2 columns"),
    "a mapping for rows": baseline(BASELINE.replace("[[20.0, 1.0]]", "{}"), "run[ideal, driven].rows = {}"),
    "other runs": baseline(BASELINE, "compare baseline update"),
}


def shown(text: Content, *words: str, signal_name: str = "reaction_B_angle", at: str = "30") -> Row:
    return Row(["show", "r.json", "--signal", signal_name, "--at", at], list(words), {"r.json": text})


@cache
def good() -> dict[str, Any]:
    """The fields of a result."""
    return json.loads(to_json(sample_result()))


def result(path: tuple[Any, ...] = (), value: Any = None) -> Callable[[Path], object]:
    """What writes a result, with one of its fields set to a value."""
    return lambda place: place.write_text(json.dumps(with_field(path, value, good()) if path else good()))


RESULTS = {
    "none": Row(["show", "r.json", "--signal", "x", "--at", "30"], ["r.json: cannot be read: there is no such file"]),
    "no JSON": shown("{", "r.json: cannot be read as JSON"),
    "nothing": shown("", "r.json: cannot be read as JSON"),
    "TOML": shown(TEXT, "r.json: cannot be read as JSON"),
    "a list": shown("[]", "r.json: holds a list"),
    "null": shown("null", "r.json: holds a NoneType"),
    "nested too deep": shown(
        '{"x": ' + "[" * 200_000 + "]" * 200_000 + "}", "r.json: cannot be read as JSON", "nested too deep"
    ),
    "too many digits": shown('{"schema": ' + DIGITS + "}", "r.json: cannot be read as JSON", "too many digits"),
    "UTF-16": shown(TEXT.encode("utf-16"), "r.json: cannot be read: it is not UTF-8 text"),
    "half a surrogate pair": shown(b'{"a": "\xed\xa0\x80"}', "r.json: cannot be read: it is not UTF-8 text"),
    "another schema": shown(result(("schema",), 2), "r.json: schema = 2"),
    "no schema": shown(result(("schema",), ...), "r.json: schema is missing"),
    "no runs": shown(result(("runs",), ...), "r.json: runs is missing"),
    "runs of numbers": shown(result(("runs",), [1, 2]), "r.json: runs[0] = 1"),
    "no mechanism": shown(result(("mechanism",), ...), "r.json: mechanism is missing"),
    "a mechanism that is none": shown(
        result(("mechanism", "body", 1, "mass"), -1.0), "r.json: mechanism.body[coupler].mass = -1.0"
    ),
    "a mechanism without its joint": shown(
        result(("mechanism", "joint", 2, "bodies"), ["coupler", "Q"]), "r.json: ", "'Q'"
    ),
    "a crank angle in words": shown(
        result(("runs", 0, "crank_angle", 0), "thirty"), "r.json: runs[0].crank_angle[0] = 'thirty'"
    ),
    "a verdict that there is not": shown(
        result(("runs", 0, "discrepancies", 0, "verdict"), "perhaps"), "r.json: runs[0].discrepancies[0].verdict"
    ),
    "too few samples": shown(result(("runs", 0, "crank_angle"), [0.5]), "r.json: runs[0]", "values for 1 sample"),
    "a sample too many": shown(result(("runs", 0, "crank_angle"), [0.5] * 999), "r.json: runs[0]", "for 999 samples"),
    "a unit that there is not": shown(
        result(("runs", 0, "discrepancies", 0, "unit"), "parsec"), "r.json: runs[0].discrepancies[0].unit = 'parsec'"
    ),
    "flags of numbers": shown(result(("runs", 0, "flags"), {"0": 7}), "r.json: runs[0].flags.0 = 7"),
    "a crank angle that is no number": shown(
        result(("runs", 0, "crank_angle", 0), float("nan")), "r.json: runs[0].crank_angle[0] = nan"
    ),
    "an unknown signal": shown(result(), "--signal force_B: no force_B in mujoco, ideal", signal_name="force_B"),
    "a signal in two lines": shown(result(), r"--signal a\nb: no ", signal_name="a\nb"),
    "an angle in words": shown(result(), "'--at'", "valid number", at="thirty"),
    "an angle that is no number": shown(result(), "--at nan", at="nan"),
    "an endless angle": shown(result(), "--at inf", at="inf"),
    "an angle that it has not": shown(result(), "--at 355", at="355"),
}


def report(command: list[str], name: str, text: str | bytes | Callable[[Path], object], *words: str) -> Row:
    return Row([*command, "--reports", "."], ["--reports: ", name, *words], {name: text}, evidence.main)


STORED = (["validation", "check", "--simulator", "mujoco"], "validation.json")
BOARD = (["scoreboard", "check"], "scoreboard.json")
REPORTS = {
    f"{name}: {what}": report(command, name, text, *words)
    for command, name in (STORED, BOARD)
    for what, text, words in (
        ("a folder", Path.mkdir, ["it is a folder"]),
        ("a pipe", os.mkfifo, ["it is a pipe"]),
        ("no JSON", "{", ["cannot be read as JSON"]),
        ("a list", "[]", ["holds a list"]),
        ("nested too deep", "[" * 200_000, ["nested too deep"]),
        ("too many digits", '{"schema": ' + DIGITS + "}", ["too many digits"]),
        ("another schema", '{"schema": 9, "results": []}', ["schema"]),
        ("UTF-16", "{}".encode("utf-16"), ["not UTF-8 text"]),
    )
}


# ---------------------------------------------------------------- arguments


def option(*arguments: str, words: list[str] | None = None) -> Row:
    """An option of the cross-check, called by its own words unless others are given."""
    return Row([*CHECK, *arguments], words or [" ".join(arguments)])


VALIDITY = ["validity", "--case", "crank-rocker", "--out", "out"]
ACCURACY = ["accuracy", "--case", "paper", "--samples", "10", "--out", "out"]
ARGUMENTS = {
    **{
        f"--angles {text!r}": option("--angles", text, words=[f"--angles {text}", *words])
        for text, words in {
            "": ["start:stop:step"],
            "20": ["start:stop:step"],
            "20:160": ["start:stop:step"],
            "20:160:5:5": ["start:stop:step"],
            "a:b:c": ["start:stop:step"],
            "20-160": ["start:stop:step"],
            "20:160:0": ["step must be positive"],
            "20:160:-5": ["step must be positive"],
            "160:20:5": ["stop must not be below start"],
            "nan:160:5": ["stop must not"],
            "20:nan:5": ["stop must not"],
            "20:160:nan": ["stop must not"],
            "20:inf:5": ["stop must not"],
            "20:160:1e-9": ["more than 1000000 angles"],
            "20:160:5e-324": ["more than 1000000 angles"],
            "1e300:1e300:1": ["1e+06"],
            "0x10:20:1": ["start:stop:step"],
            "20:200:5": ["change point at crank angle 180 deg"],
            "-20:20:5": ["change point at crank angle"],
            "180:180:1": ["change point at crank angle 180 deg"],
        }.items()
    },
    **{
        f"--clearance {text!r}": option("--clearance", text, words=[f"--clearance {text}"[:60].rstrip(), *words])
        for text, words in {
            "": ["JOINT=metres"],
            "B": ["JOINT=metres"],
            "B=": ["JOINT=metres"],
            "=1e-4": ["not a revolute joint"],
            "B=x": ["JOINT=metres"],
            "B=nan": ["0 or more"],
            "B=inf": ["0 or more"],
            "B=-1e-4": ["0 or more"],
            "B=1e400": ["0 or more"],
            "Q=1e-4": ["D, A, B, E"],
            "B=1e-4,B=2e-4": ["B is there twice"],
            "B=1e-4,A=1e-4,B=1e-4": ["B is there twice"],
            "B=0.5": ["joint 'B'", "not smaller than body"],
            "B=1e-4;A=1e-4": ["JOINT=metres"],
        }.items()
    },
    "a clearance in a list that ends in a comma": option(
        "--clearance", "B=1e-4,", words=["--clearance", "JOINT=metres"]
    ),
    "no engine": Row(["--simulator", "", "--out", "out"], ["''", "mujoco"]),
    "an engine that there is not": Row(["--simulator", "adams", "--out", "out"], ["'adams'", "mujoco"]),
    "an engine's name in two lines": Row(["--simulator", "mu\njoco", "--out", "out"], ["mujoco, exudyn"]),
    "a joint model that there is not": option("--joint", "rubber", words=["'--joint'", "'rubber'"]),
    "a joint model without clearance": Row(
        [*CHECK, "--case", "crank-rocker", "--joint", "contact"],
        ["--joint contact: ", "give --clearance (m by joint)"],
    ),
    "a motion that there is not": option("--motion", "flying", words=["'--motion'", "'flying'"]),
    "an analytic model that there is not": option(
        "--analytic", "second_order", words=["'--analytic'", "'second_order'"]
    ),
    "an option that there is not": option("--spead", "3", words=["--spead"]),
    "an argument that there is not": option("papers", words=["papers"]),
    "angles of a pendulum": Row(
        [*CHECK, "--case", "pendulum", "--angles", "0:9:1"], ["--angles 0:9:1", "swings freely"]
    ),
    "contact in a pendulum": Row(
        [*CHECK, "--case", "pendulum", "--clearance", "O=1e-4", "--joint", "contact"],
        ["--joint contact", "swings freely"],
    ),
    "links that bend in motion": option("--flexible", words=["--flexible: ", "ask for static motion"]),
    "a folder under a file": Row(
        ["--simulator", "mujoco", "--out", "file/out"], ["--out file/out", "another folder"], {"file": ""}
    ),
    "a file for a folder": Row(
        ["--simulator", "mujoco", "--out", "file"], ["--out file", "another folder"], {"file": ""}
    ),
    "a loop of links for a folder": Row(
        ["--simulator", "mujoco", "--out", "link"], ["--out link", "another folder"], {"link": link("link")}
    ),
    "a folder's name of 5000 letters": Row(
        ["--simulator", "mujoco", "--out", "a" * 5000], ["--out aaa", "another folder"]
    ),
    "a tolerance that is missing": option(
        "--tolerance", "none.toml", words=["--tolerance none.toml: cannot be read: there is no such file"]
    ),
    **{
        f"validity --speeds {text!r}": Row(
            [*VALIDITY, "--speeds", text, "--clearances", "1e-4"], [f"--speeds {text}".rstrip(), *words]
        )
        for text, words in {
            "": ["not a number"],
            "fast": ["not a number"],
            "60,": ["not a number"],
            "0": ["above 0"],
            "-60": ["above 0"],
            "nan": ["above 0"],
            "inf": ["above 0"],
            "60,60": ["60 is there twice"],
            "60,60.0": ["60 is there twice"],
            "60,600,60": ["60 is there twice"],
        }.items()
    },
    **{
        f"validity --clearances {text!r}": Row(
            [*VALIDITY, "--speeds", "60", "--clearances", text], [f"--clearances {text}", *words]
        )
        for text, words in {
            "0": ["above 0"],
            "1e-4,1e-4": ["is there twice"],
            "1e-4,0.0001": ["is there twice"],
            "1e-4 2e-4": ["not a number"],
        }.items()
    },
    "validity --simulator twice": Row(
        [*VALIDITY, "--speeds", "60", "--clearances", "1e-4", "--simulator", "mujoco,mujoco"],
        ["--simulator mujoco,mujoco: mujoco is there twice"],
    ),
    "validity --simulator unknown": Row(
        [*VALIDITY, "--speeds", "60", "--clearances", "1e-4", "--simulator", "mujoco,adams"], ["'adams'"]
    ),
    "validity --at twice": Row(
        [*VALIDITY, "--speeds", "60", "--clearances", "1e-4", "--at", "B,B"], ["--joints B,B: B is there twice"]
    ),
    "validity --at unknown": Row(
        [*VALIDITY, "--speeds", "60", "--clearances", "1e-4", "--joints", "Q"], ["--joints Q", "D, A, B, E"]
    ),
    "validity --joint ideal": Row(
        [*VALIDITY, "--speeds", "60", "--clearances", "1e-4", "--joint", "ideal"], ["--joint ideal", "contact"]
    ),
    "validity --workers 0": Row(
        [*VALIDITY, "--speeds", "60", "--clearances", "1e-4", "--workers", "0"],
        ["'--workers'", "greater than or equal to 1"],
    ),
    "validity of a pendulum": Row(
        ["validity", "--case", "pendulum", "--speeds", "60", "--clearances", "1e-4"],
        ["--case pendulum", "constant speed"],
    ),
    "validity of a loop that does not close": Row(
        ["validity", "--case", "mine.toml", "--speeds", "60", "--clearances", "1e-4"],
        ["mine.toml: ", "reached"],
        {"mine.toml": SHORT},
    ),
    "accuracy of a loop that does not close": Row(
        ["accuracy", "--case", "mine.toml"], ["mine.toml: ", "reached"], {"mine.toml": SHORT}
    ),
    "accuracy --clearance twice": Row(
        [*ACCURACY, "--clearance", "B=1e-4,B=1e-4"], ["--clearance B=1e-4,B=1e-4: joint B is there twice"]
    ),
    "accuracy --clearance-tolerance twice": Row(
        [*ACCURACY, "--clearance", "B=1e-4", "--clearance-tolerance", "B=1e-5,B=1e-5"],
        ["--clearance-tolerance B=1e-5,B=1e-5: joint B is there twice"],
    ),
    "accuracy --clearance-tolerance too large": Row(
        [*ACCURACY, "--clearance", "B=1e-4", "--clearance-tolerance", "B=2e-4"],
        ["--clearance-tolerance", "B=0.0002 is more than"],
    ),
    "accuracy --output twice": Row(
        [*ACCURACY, "--output", "coupler,coupler"], ["--output coupler,coupler: coupler is there twice"]
    ),
    "accuracy --output given twice": Row(
        [*ACCURACY, "--output", "coupler", "--output", "coupler"], ["coupler is there twice"]
    ),
    "a list given in two": Row(
        ["paper", "--simulator", "mujoco", "--simulator=dart"],
        ["--simulator is given twice, mujoco and dart", "--simulator mujoco,dart"],
    ),
    "another list given in two": Row(
        [*ACCURACY, "--clearance", "B=1e-4", "--clearance", "E=1e-4"], ["given twice", "--clearance B=1e-4,E=1e-4"]
    ),
    "two values of one option": Row(
        ["baseline", "check", "--case", "paper", "--case", "crank-rocker"], ["--case is given twice", "keep one"]
    ),
    "accuracy --output nothing": Row([*ACCURACY, "--output", ""], ["--output", "is no body"]),
    "accuracy --samples 1": Row(["accuracy", "--samples", "1"], ["'--samples'", "greater than or equal to 2"]),
    "accuracy --seed -1": Row([*ACCURACY, "--seed", "-1"], ["'--seed'", "greater than or equal to 0"]),
    "accuracy out of reach": Row(
        [*ACCURACY, "--angles", "20:200:5"], ["--angles 20:200:5", "change point at crank angle 180 deg"]
    ),
    "export of contact without clearance": Row(
        ["export", "--simulator", "mujoco", "--case", "crank-rocker", "--joint", "contact", "--out", "out"],
        ["--joint contact", "give --clearance (m by joint)"],
    ),
    "export to nowhere": Row(["export", "--simulator", "mujoco"], ["'--out'"]),
    "export out of reach": Row(
        ["export", "--simulator", "mujoco", "--angles", "0:90:5", "--out", "out"], ["--angles 0:90:5", "change point"]
    ),
    "export --clearance twice": Row(
        ["export", "--simulator", "mujoco", "--clearance", "B=1e-4,B=2e-4", "--out", "out"],
        ["--clearance B=1e-4,B=2e-4: joint B is there twice"],
    ),
    "baseline of a loop that does not close": Row(
        ["baseline", "check", "--case", "mine.toml", "--simulator", "mujoco"],
        ["mine.toml: ", "reached"],
        {"mine.toml": SHORT},
    ),
    "baselines in a file": Row(["baseline", "update", "--baselines", "file"], ["--baselines file"], {"file": ""}),
    "show without a file": Row(["show", "r.json"], ["r.json", "give a result.json or diagnosis.json"]),
}

GROUPS = {
    "field": MECHANISM_FIELDS,
    "parts": MECHANISM_PARTS,
    "linkage": LINKAGES,
    "text": TEXTS,
    "place": PLACES,
    "tolerance": TOLERANCES,
    "baseline": BASELINES,
    "result": RESULTS,
    "report": REPORTS,
    "argument": ARGUMENTS,
}
TABLE = {f"{group}: {name}": row for group, rows in GROUPS.items() for name, row in rows.items()}


@pytest.fixture(autouse=True)
def patience() -> Iterator[None]:
    """A command that reads for ever fails."""

    def enough(*_: object) -> None:
        raise TimeoutError(f"not done after {PATIENCE} s")

    before = signal.signal(signal.SIGALRM, enough)
    signal.alarm(PATIENCE)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


def listing(folder: Path) -> set[str]:
    """All that lies in a folder, links not followed; the folder for the report may have been made, and is empty
    then.
    """
    return {os.path.join(here, name) for here, folders, files in os.walk(folder) for name in folders + files} - {
        str(folder / "out")
    }


ROWS = [  # every fifth is in the short part
    pytest.param(row, id=name.encode("unicode_escape").decode()[:80], marks=[pytest.mark.slow] * (k % 5 > 0))
    for k, (name, row) in enumerate(TABLE.items())
]


@pytest.mark.mujoco
@pytest.mark.filterwarnings("default")  # as in the command, which tells them
@pytest.mark.parametrize("row", ROWS)
def test_a_hostile_input_is_one_sentence_and_status_2_and_nothing_is_written(
    row: Row, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for name, content in row.files.items():
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        if callable(content):
            content(path)
        else:
            text = tomli_w.dumps(content) if isinstance(content, dict) else content
            path.write_bytes(text.encode() if isinstance(text, str) else text)
    before = listing(tmp_path)
    monkeypatch.setattr(sys, "argv", ["compare", *row.arguments])
    with pytest.raises(SystemExit) as left:
        row.main()
    out, err = capsys.readouterr()
    assert left.value.code == 2, err
    assert out == ""
    assert "Traceback" not in err
    assert "encountered" not in err  # numpy's warnings are not for those who wrote the file
    said = [line for line in err.splitlines() if line.startswith(("compare: ", "Error: "))]
    others = [
        line
        for line in err.splitlines()
        if line and line not in said and not line.startswith(("warning: ", "Usage: ", "Try "))
    ]
    assert (len(said), others) == (1, []), err
    assert said[0].isprintable()
    assert len(said[0]) < 1500
    for word in row.words:
        assert word in said[0]
    assert listing(tmp_path) == before


def test_there_are_two_hundred_rows_and_more() -> None:
    assert len(TABLE) > 200

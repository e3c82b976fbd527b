"""What an FMU says of itself, and its content in a folder; nothing of it is run here.

An FMU is a zip file with a ``modelDescription.xml``: its variables, and which interfaces it has.  The file may be
anybody's, so that its size and the names of its members are looked at before anything is unpacked.
"""

from __future__ import annotations

import functools
import platform
import shutil
import sys
import tempfile
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from xml.etree import ElementTree

from analytic.mechanism.one_line import shown
from sim_models.engine import Unsupported

DESCRIPTION = "modelDescription.xml"
LARGEST_DESCRIPTION = 2**26  # bytes
LARGEST_ARCHIVE = 2**31  # bytes of all members, unpacked
MOST_MEMBERS = 10_000  # members
TIGHTEST = 200  # how many times as large as in the zip file a large member may be
LARGE = 2**24  # bytes of a member that is not compressed tighter than that by chance
SYSTEMS = {"linux": ("linux", ".so"), "win32": ("windows", ".dll"), "darwin": ("darwin", ".dylib")}
OF_FMI2 = {"linux": "linux64", "windows": "win64", "darwin": "darwin64"}
REAL_KINDS = ("Real", "Float64")  # kinds of variables that a signal or an input can be
VARIABLE_KINDS = {  # of FMI 2 and 3, as they are set
    "Real": "Real", "Integer": "Integer", "Enumeration": "Integer", "Boolean": "Boolean", "String": "String",
    "Float64": "Float64", "Float32": "Float32", "Int64": "Int64", "Int32": "Int32", "Int16": "Int16", "Int8": "Int8",
    "UInt64": "UInt64", "UInt32": "UInt32", "UInt16": "UInt16", "UInt8": "UInt8",
}  # fmt: skip


class FmuError(Unsupported):
    """An FMU or its map cannot be used; the message says why: file, field, value, remedy."""


@dataclass(frozen=True)
class Variable:
    """A variable of an FMU: its reference, kind (``Real``, ``Float64``, ``Boolean``, ...), causality and unit."""

    name: str
    reference: int
    kind: str
    causality: str
    unit: str


@dataclass(frozen=True)
class Fmu:
    """What an FMU says of itself.  ``step`` (s) is that of its default experiment; ``even`` says that it takes equal
    steps only.
    """

    path: Path
    fmi: str
    guid: str
    identifier: str
    made_by: str
    step: float | None
    even: bool
    variables: Mapping[str, Variable]
    library: str

    def named(self, *causalities: str) -> list[str]:
        """Names of the variables of these causalities."""
        return [name for name, variable in self.variables.items() if variable.causality in causalities]


def described(path: Path) -> Fmu:
    """What an FMU says of itself.  Raises FmuError."""
    try:
        about = path.stat()
    except (OSError, ValueError):  # a name with a null character is a ValueError
        raise FmuError(f"{path}: there is no such file; give fmu:FILE with the path of an FMU") from None
    return _described(path, about.st_mtime_ns, about.st_size)


@functools.lru_cache(maxsize=8)
def _described(path: Path, changed: int, size: int) -> Fmu:
    """The same, read again where the file has changed: a large model says 20 MB of itself."""
    with _opened(path) as archive:
        members = {each.filename: each for each in archive.infolist()}
        if DESCRIPTION not in members:
            raise FmuError(f"{path}: it has no {DESCRIPTION}; give an FMU, as a simulation tool exports it")
        if members[DESCRIPTION].file_size > LARGEST_DESCRIPTION:
            raise FmuError(f"{path}: its {DESCRIPTION} is larger than {LARGEST_DESCRIPTION >> 20} MB; export it anew")
        with _readable(path):
            text = archive.read(DESCRIPTION)
    if b"<!DOCTYPE" in text.replace(b"\0", b""):  # in two bytes a character too
        raise FmuError(f"{path}: its {DESCRIPTION} has a <!DOCTYPE>, whose entities are not read; export it anew")
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, LookupError) as error:  # an encoding that Python does not have
        raise FmuError(f"{path}: its {DESCRIPTION} cannot be read ({error}); export it anew") from None
    return _fmu(path, root, set(members))


@contextmanager
def unpacked(path: Path) -> Iterator[Path]:
    """A temporary folder with the content of an FMU, removed at the end.  Raises FmuError."""
    folder = Path(tempfile.mkdtemp(prefix="linkage-fmu-"))
    try:
        with _opened(path) as archive:
            _check_members(path, archive.infolist())
            with _readable(path):
                archive.extractall(folder)
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


@contextmanager
def _opened(path: Path) -> Iterator[zipfile.ZipFile]:
    if not path.is_file():
        raise FmuError(f"{path}: it is no file; give fmu:FILE with the path of an FMU")
    with _readable(path):
        archive = zipfile.ZipFile(path)
    with archive:
        yield archive


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    """What goes wrong with a zip file, in a sentence."""
    try:
        yield
    except zipfile.BadZipFile as error:
        raise FmuError(f"{path}: it is no FMU, or a damaged one ({error}); export it anew") from None
    except (OSError, EOFError, ValueError, RuntimeError, NotImplementedError, zlib.error) as error:
        raise FmuError(f"{path}: it cannot be unpacked ({error}); export it anew") from None


def _check_members(path: Path, members: list[zipfile.ZipInfo]) -> None:
    """Refuse members that would leave the folder, and content that would fill the disk.  Raises FmuError."""
    if len(members) > MOST_MEMBERS or sum(each.file_size for each in members) > LARGEST_ARCHIVE:
        raise FmuError(
            f"{path}: unpacked it has {len(members)} files and {sum(m.file_size for m in members) >> 20} MB; at most"
            f" {MOST_MEMBERS} files and {LARGEST_ARCHIVE >> 20} MB are unpacked"
        )
    for each in members:
        parts = PurePosixPath(each.filename).parts
        if "\\" in each.filename or ":" in each.filename or each.filename.startswith("/") or ".." in parts:
            raise FmuError(f"{path}: its member {shown(each.filename)} would be written elsewhere; do not use this FMU")
        if each.file_size > LARGE and each.file_size > TIGHTEST * max(each.compress_size, 1):
            raise FmuError(
                f"{path}: its member {shown(each.filename)} is {each.file_size >> 20} MB out of"
                f" {each.compress_size >> 10} kB; it is not unpacked"
            )


# ---------------------------------------------------------------- modelDescription.xml


def _fmu(path: Path, root: ElementTree.Element, members: set[str]) -> Fmu:
    version = root.get("fmiVersion", "")
    if root.tag != "fmiModelDescription" or version.split(".")[0] not in ("2", "3"):
        has = (
            f"FMI {version or '1.0, or says none'}" if root.tag == "fmiModelDescription" else f"the element {root.tag}"
        )
        raise FmuError(f"{path}: its {DESCRIPTION} is of {has[:60]}; export it as FMI 2.0 or 3.0 for co-simulation")
    interface = root.find("CoSimulation")
    if interface is None:
        has = ", ".join(name for name in ("ModelExchange", "ScheduledExecution") if root.find(name) is not None)
        raise FmuError(
            f"{path}: it is not for co-simulation ({has or 'no interface'}); export it as FMI 2.0 or 3.0 for"
            " co-simulation, with its solver"
        )
    identifier = interface.get("modelIdentifier", "")
    guid = root.get("guid" if version.startswith("2") else "instantiationToken")
    if not identifier or guid is None:
        what = "a guid or instantiationToken" if identifier else "a modelIdentifier"
        raise FmuError(f"{path}: its {DESCRIPTION} lacks {what}; export it anew")
    if PurePosixPath(identifier).name != identifier:
        raise FmuError(f"{path}: its modelIdentifier {shown(identifier)} is no name of a file; do not use this FMU")
    return Fmu(
        path=path,
        fmi=version,
        guid=guid,
        identifier=identifier,
        made_by=", ".join(filter(None, (root.get("version"), root.get("generationTool")))),
        step=_step(path, root),
        even=interface.get("canHandleVariableCommunicationStepSize", "false") not in ("true", "1"),
        variables={each.name: each for each in _variables(path, root)},
        library=_library(path, identifier, members),
    )


def _step(path: Path, root: ElementTree.Element) -> float | None:
    experiment = root.find("DefaultExperiment")
    text = None if experiment is None else experiment.get("stepSize")
    if text is None:
        return None
    try:
        step = float(text)
    except ValueError:
        step = 0.0
    if not 0 < step < float("inf"):
        raise FmuError(
            f"{path}: DefaultExperiment.stepSize = {shown(text)} is no time (s) above 0; give step in the map"
        )
    return step


def _variables(path: Path, root: ElementTree.Element) -> Iterator[Variable]:
    """The scalar variables, FMI 2 or 3."""
    units = {}
    for declared in root.iterfind("TypeDefinitions/*"):
        real = declared.find("Real")
        units[declared.get("name")] = (declared if real is None else real).get("unit", "")
    for element in root.iterfind("ModelVariables/*"):
        typed = element
        if element.tag == "ScalarVariable":
            typed = next((child for child in element if child.tag in VARIABLE_KINDS), element)
        if typed.tag not in VARIABLE_KINDS or element.find("Dimension") is not None:
            continue
        name, reference = element.get("name", ""), element.get("valueReference", "")
        if not name or not reference.isascii() or not reference.isdecimal() or int(reference) >= 2**32:
            raise FmuError(
                f"{path}: a variable of its {DESCRIPTION} has name {shown(name)} and valueReference"
                f" {shown(reference)}; export it anew"
            )
        unit = typed.get("unit") or units.get(typed.get("declaredType"), "")
        yield Variable(name, int(reference), VARIABLE_KINDS[typed.tag], element.get("causality", "local"), unit)


def _library(path: Path, identifier: str, members: set[str]) -> str:
    """The member that is the FMU's code for this machine.  Raises FmuError."""
    system, ending = SYSTEMS.get(sys.platform, (sys.platform, ".so"))
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(platform.machine().lower(), platform.machine().lower())
    places = [f"{machine}-{system}", OF_FMI2.get(system, system)]
    for place in places:
        if f"binaries/{place}/{identifier}{ending}" in members:
            return f"binaries/{place}/{identifier}{ending}"
    there = sorted({name.split("/")[1] for name in members if name.startswith("binaries/") and name.count("/") > 1})
    has = f"it has those of {', '.join(there[:8])}" if there else "it has none at all"
    code = f"binaries/{' or '.join(places)} with {identifier}{ending}"
    raise FmuError(f"{path}: it has no {code}; {has}; export it for this platform")

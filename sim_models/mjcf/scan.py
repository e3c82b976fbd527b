"""An MJCF file, looked through before MuJoCo sees it: what it would open, and how much it would make.

MuJoCo opens every file that a model names, wherever it lies, and makes as many bodies, pixels and bytes as it is told
to.  Here only files of the model's own folder are let pass, and only as much as a linkage needs.
"""

from __future__ import annotations

import re
import stat
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from analytic.mechanism.errors import brief, quoted
from analytic.mechanism.reading import ReadingError, read_text
from sim_models.mjcf.errors import MjcfError

LARGEST_FILE = 2**24  # bytes of one XML file
LARGEST_ASSET = 2**26  # bytes of a mesh, a texture or a height field
MOST_BODIES = 500
MOST_FILES = 100
DEEPEST_NESTING = 90  # elements within each other; MuJoCo's own reader takes 100
# What no planar linkage of rigid links has, and what brings code or other models with it
REFUSED = {
    "plugin": "it loads code",
    "extension": "it loads code",
    "attach": "it reads another model",
    "model": "it reads another model",
    "composite": "it is no rigid link",
    "flexcomp": "it is no rigid link",
    "flex": "it is no rigid link",
    "skin": "it is no rigid link",
}
FOLDERS = ("meshdir", "texturedir", "assetdir")
MOST_OF_ANYTHING = 4096  # of any number that says how much there is to make; replicates are counted as bodies besides
COUNT_ATTRIBUTES = {
    "replicate": ("count",),
    "texture": ("width", "height"),
    "hfield": ("nrow", "ncol"),
    "numeric": ("size",),
    "option": ("iterations", "ls_iterations", "noslip_iterations", "ccd_iterations", "sdf_iterations"),
}
MEMORY = 2**30  # bytes that a model may ask for
NO_NUMBER = re.compile(r"(?<![\w.])[+-]?(nan|inf|infinity)(?![\w.])", re.IGNORECASE)
NAME_ATTRIBUTES = {
    "name",
    "class",
    "childclass",
    "data",
    "model",
    "joint",
    "body",
    "body1",
    "body2",
    "site",
    "site1",
    "site2",
}


@dataclass
class Scan:
    """What has been seen of a model: its folder, the files on the way to the present one, and how much there is."""

    folder: Path
    within: list[Path] = field(default_factory=list)
    files: int = 0
    bodies: int = 0
    places: list[Path] = field(default_factory=list)  # folders that files may be named from
    assets: list[tuple[str, str]] = field(default_factory=list)  # files that are named, and where

    def read(self, path: Path, said: str) -> None:
        """Look through one file and those that it includes; ``said`` is its name in messages.  Raises MjcfError."""
        self.files += 1
        if path in self.within:
            raise MjcfError(f"{said}: includes itself; take that include out")
        if self.files > MOST_FILES:
            raise MjcfError(f"{said}: is one of more than {MOST_FILES} included files; put the model into fewer")
        try:
            text = read_text(path, LARGEST_FILE)
        except ReadingError as error:
            raise MjcfError(f"{said}: {error}; give an MJCF file") from None
        self.within.append(path)
        self.places += [self.folder, path.parent]
        _File(self, path.parent, said).parse(text)
        self.within.pop()

    def check_assets(self) -> None:
        """Raise MjcfError for a file that is not to be opened, from whatever folder it may be named."""
        for value, said in self.assets:
            self.there(value, self.places, said)

    def there(self, value: str, bases: Iterable[Path], said: str) -> list[Path]:
        """The files that are there of those that a name may mean, all of them in the folder of the model."""
        found = [self.inside(value, base, said) for base in dict.fromkeys(bases)]
        there = [path for path in found if path.exists()]
        for path in there:
            _check_asset(path, f"{said} = {quoted(value)}")
        return there

    def inside(self, name: str, base: Path, said: str) -> Path:
        """The path that a name means from a folder.  Raises MjcfError where it leads out of the model's."""
        name = name.replace("\\", "/")
        path = base / name
        remedy = "copy what is needed into the folder of the model and name it from there"
        if "\0" in name or Path(name).is_absolute() or ":" in name:
            raise MjcfError(f"{said} = {quoted(name)} does not name a file of the model's own folder; {remedy}")
        try:
            found = path.resolve()
        except (OSError, RuntimeError):  # links in a circle
            raise MjcfError(f"{said} = {quoted(name)} cannot be followed; {remedy}") from None
        if not found.is_relative_to(self.folder):
            raise MjcfError(f"{said} = {quoted(name)} leads out of the folder of the model; {remedy}")
        return found


class _File:
    """The events of one file's XML."""

    def __init__(self, scan: Scan, folder: Path, said: str) -> None:
        self.scan, self.folder, self.said = scan, folder, said
        self.times = [1]  # how often each open element is made
        self.parser = expat.ParserCreate()
        self.parser.StartElementHandler = self.start
        self.parser.EndElementHandler = self.end
        self.parser.StartDoctypeDeclHandler = self.doctype

    def parse(self, text: str) -> None:
        try:
            self.parser.Parse(text, True)
        except expat.ExpatError as error:
            what = expat.ErrorString(error.code)
            raise MjcfError(
                f"{self.said}: line {error.lineno}: it is not XML ({what}); give an MJCF file, as text"
            ) from None

    @property
    def at(self) -> str:
        return f"{self.said}: line {self.parser.CurrentLineNumber}"

    def doctype(self, name: str, *_: object) -> None:
        raise MjcfError(f"{self.at}: has a <!DOCTYPE {brief(name)}>, whose entities are not read; take it out")

    def end(self, element: str) -> None:
        self.times.pop()

    def start(self, element: str, given: dict[str, str]) -> None:
        roots = ("mujoco",) if len(self.scan.within) == 1 else ("mujoco", "mujocoinclude")
        if len(self.times) == 1 and element not in roots:
            raise MjcfError(f"{self.at}: its root is <{brief(element)}>; an MJCF file has <mujoco> there")
        if len(self.times) > DEEPEST_NESTING:
            raise MjcfError(
                f"{self.at}: <{brief(element)}> lies in {DEEPEST_NESTING} other elements; a linkage of fewer links is"
                " read"
            )
        if element in REFUSED:
            raise MjcfError(f"{self.at}: <{element}> is not read, as {REFUSED[element]}; take it out")
        self.counted(element, given)
        self.numbers(element, given)
        self.opened(element, given)

    def counted(self, element: str, given: dict[str, str]) -> None:
        """Raise MjcfError for more of anything than a linkage needs."""
        times = self.times[-1]
        every = [name for name in given if name != "memory"] if element == "size" else COUNT_ATTRIBUTES.get(element, ())
        for name in every:
            number = _number(given.get(name, "0"))
            if not number <= MOST_OF_ANYTHING:
                raise MjcfError(f"{self.at}: {element}.{name} = {quoted(given[name])}; give at most {MOST_OF_ANYTHING}")
            if element == "replicate":
                times *= max(1, int(number))
        if element == "mesh" and "builtin" in given:
            raise MjcfError(
                f"{self.at}: mesh.builtin = {quoted(given['builtin'])} is not read; use a geom of that shape"
            )
        if element == "size" and _bytes(given.get("memory", "")) > MEMORY:
            raise MjcfError(f"{self.at}: size.memory = {quoted(given['memory'])}; give at most 1G, or leave it out")
        self.times.append(times)
        self.scan.bodies += times * (element == "body")
        if self.scan.bodies > MOST_BODIES:
            raise MjcfError(
                f"{self.at}: this is body number {self.scan.bodies}; give the linkage alone, at most {MOST_BODIES}"
                " bodies"
            )

    def numbers(self, element: str, given: dict[str, str]) -> None:
        """Raise MjcfError for a number that is none."""
        for name, value in given.items():
            if name not in NAME_ATTRIBUTES and element != "text" and NO_NUMBER.search(value):
                raise MjcfError(f"{self.at}: {element}.{name} = {quoted(value)}; give finite numbers")

    def opened(self, element: str, given: dict[str, str]) -> None:
        """Note which files are named, and from which folders; look through those that are included.  Raises MjcfError
        for one out of the model's folder.
        """
        places = (self.scan.folder, self.folder)
        for name in FOLDERS:
            if element == "compiler" and given.get(name):
                said = f"{self.at}: compiler.{name}"
                self.scan.places += [self.scan.inside(given[name], place, said) for place in places]
        for name, value in given.items():
            if not name.startswith("file") or not value:
                continue
            said = f"{self.at}: {element}.{name}"
            if element != "include":
                self.scan.assets.append((value, said))
                continue
            there = self.scan.there(value, places, said)
            if not there:
                raise MjcfError(
                    f"{said} = {quoted(value)}: there is no such file in the folder of the model; put it there"
                )
            for path in there:  # MuJoCo takes one of them
                self.scan.read(path, f"{self.said}, its include {brief(value)}")


def scan(path: Path) -> Path:
    """The file itself, links followed, after it was looked through.  Raises MjcfError."""
    try:
        real = path.resolve()
    except (OSError, RuntimeError, ValueError):
        raise MjcfError(f"{path}: cannot be followed to a file; give an MJCF file") from None
    seen = Scan(real.parent)
    seen.read(real, str(path))
    seen.check_assets()
    return real


def _check_asset(path: Path, said: str) -> None:
    """Raise MjcfError for what is no file, or one too large."""
    found = path.stat()
    if not stat.S_ISREG(found.st_mode):
        raise MjcfError(f"{said} is no file; give one")
    if found.st_size > LARGEST_ASSET:
        raise MjcfError(f"{said} has {found.st_size / 2**20:.0f} MB; give at most {LARGEST_ASSET / 2**20:.0f}")


def _number(text: str) -> float:
    try:
        return max((float(each) for each in text.split()), default=0.0)
    except ValueError:
        return 0.0  # MuJoCo says what is wrong with it


def _bytes(text: str) -> float:
    """A size of memory (bytes) as MJCF writes it: 100, 20M, 1G."""
    scale = {"K": 2**10, "M": 2**20, "G": 2**30, "T": 2**40, "P": 2**50, "E": 2**60}.get(text.strip()[-1:].upper(), 1)
    return _number(text.strip().rstrip("KMGTPEkmgtpe")) * scale

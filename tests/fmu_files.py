"""FMUs and their maps for tests: built by pythonfmu, so that their Python is the one that runs the tests."""

from __future__ import annotations

import sys
import warnings
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path

EXAMPLE = Path(__file__).parent.parent / "docs" / "example-fmu"
MAP = (EXAMPLE / "SliderCrank.map.toml").read_text(encoding="utf-8")
TROUBLED = '''

import os
import signal
import time

from pythonfmu import Integer, String


class Troubled(SliderCrank):
    """The same; ``trouble`` comes ``after`` some steps."""

    def __init__(self, **given: object) -> None:
        super().__init__(**given)
        self.modelName = "SliderCrank"
        self.trouble, self.after, self.steps = "none", 3, 0
        for kind, name in ((String, "trouble"), (Integer, "after")):
            variability = Fmi2Variability.tunable
            self.register_variable(kind(name, causality=Fmi2Causality.parameter, variability=variability))

    def terminate(self) -> None:
        if self.trouble == "crash at the end":
            os.kill(os.getpid(), signal.SIGSEGV)

    def do_step(self, now: float, step: float) -> bool:
        super().do_step(now, step)
        self.steps += 1
        if self.steps < self.after or self.trouble == "none":
            return True
        if self.trouble == "crash":
            os.kill(os.getpid(), signal.SIGSEGV)
        if self.trouble == "leave":
            os.write(2, b"going\\nI am gone\\n")
            os._exit(7)
        if self.trouble == "sleep":
            time.sleep(60.0)
        if self.trouble == "raise":
            raise ValueError("the solver gave up")
        if self.trouble == "nan":
            self.B_x = math.nan
        return self.trouble != "refuse"
'''
Members = Mapping[str, bytes]
Edit = Callable[[dict[str, bytes]], None]


def build(folder: Path) -> Path:
    """The example's slider-crank, with troubles, as an FMU in a folder, with its map beside it."""
    from pythonfmu import FmuBuilder

    source = folder / "troubled_slider_crank.py"
    source.write_text((EXAMPLE / "slider_crank.py").read_text(encoding="utf-8") + TROUBLED, encoding="utf-8")
    path = list(sys.path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        fmu = Path(FmuBuilder.build_FMU(source, dest=folder))
    sys.path[:] = path
    fmu.with_name("SliderCrank.map.toml").write_text(MAP, encoding="utf-8")
    return fmu


def members(fmu: Path) -> dict[str, bytes]:
    """The members of an FMU by name."""
    with zipfile.ZipFile(fmu) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def packed(content: Members, fmu: Path) -> Path:
    """An FMU of these members."""
    with zipfile.ZipFile(fmu, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in content.items():
            archive.writestr(name, data)
    return fmu


def redescribed(old: str, new: str) -> Edit:
    """Another text in the model description."""

    def edit(content: dict[str, bytes]) -> None:
        text = content["modelDescription.xml"].decode("utf-8")
        assert old in text, old
        content["modelDescription.xml"] = text.replace(old, new).encode("utf-8")

    return edit

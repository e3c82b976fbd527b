"""What an export wrote: the files of an engine's own model, and the command that runs it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar

from pydantic import Field

from analytic.mechanism.one_line import count
from compare.results.document import Document, Filled, Row
from sim_models.engine import JointModel, Motion, SettingValue


class Exported(Document):
    """An engine's own model of a linkage, as files."""

    file: ClassVar[str] = "export.json"
    remedy: ClassVar[str] = "give what compare export --json prints"

    case: str
    simulator: str
    joint_model: JointModel
    motion: Motion
    paths: Annotated[tuple[str, ...], Field(min_length=1, description="Every file that was written.")]
    needs: Annotated[tuple[str, ...], Field(description="Python packages that the script imports.")]
    run: Annotated[str, Field(min_length=1, description="The command that runs the model without this project.")]
    settings: Annotated[Mapping[str, SettingValue], Field(description="The numbers that the engine used.")] = {}
    assumed: Filled = ()
    warnings: Annotated[tuple[str, ...], Field(description="What of the linkage is left out, a sentence each.")] = ()

    def rows(self) -> list[Row]:
        """A row for each file."""
        return [{"path": path} for path in self.paths]

    def __repr__(self) -> str:
        files = count(len(self.paths), "file")
        return f"Exported({self.case}, {self.simulator}, {self.joint_model}, {self.motion}: {files})"

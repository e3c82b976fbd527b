"""What there is: shipped cases, engines and effects, as documents."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from compare.results.document import Document, Part, Row
from sim_models.engine import JointModel, Motion


class Listing(Document):
    """A list of things, each with a row."""

    def __len__(self) -> int:
        return len(self.rows())


class Case(Part):
    """A mechanism that ships with the package."""

    name: str
    bodies: Annotated[tuple[str, ...], Field(description="Names of the moving bodies.")]
    joints: tuple[str, ...]
    clearance: Annotated[dict[str, float], Field(description="Radial clearance (m) by joint.")]
    speed: Annotated[float | None, Field(description="Speed of the drive (rad/s); null where there is none.")]


class Cases(Listing):
    """The mechanisms that ship with the package."""

    file: ClassVar[str] = "cases.json"
    remedy: ClassVar[str] = "give what compare cases --json prints"

    cases: tuple[Case, ...]

    def rows(self) -> list[Row]:
        """A row for each case."""
        return [
            {"name": c.name, "bodies": len(c.bodies), "joints": len(c.joints), "speed": c.speed} for c in self.cases
        ]

    def __repr__(self) -> str:
        return f"Cases({', '.join(case.name for case in self.cases)})"


class Capability(Part):
    """A joint model that an engine has, and the motions in which it has it."""

    joint_model: JointModel
    motions: tuple[Motion, ...]


class KnownEngine(Part):
    """An engine: whether it is installed, and what it does."""

    name: str
    package: str
    status: Literal["installed", "not installed", "broken"]
    version: str | None
    fault: Annotated[str, Field(description="Why it cannot be imported, where it is broken.")] = ""
    supports: tuple[Capability, ...]
    effects: Annotated[tuple[str, ...], Field(description="Effects of the vocabulary that it simulates.")]

    def __repr__(self) -> str:
        return f"KnownEngine({self.name} {self.version or self.status})"


class Simulators(Listing):
    """The engines, installed or not."""

    file: ClassVar[str] = "simulators.json"
    remedy: ClassVar[str] = "give what compare simulators --json prints"

    simulators: tuple[KnownEngine, ...]

    def rows(self) -> list[Row]:
        """A row for each engine."""
        return [
            {"name": e.name, "package": e.package, "status": e.status, "version": e.version}
            | {c.joint_model: " ".join(c.motions) for c in e.supports}
            for e in self.simulators
        ]

    def __repr__(self) -> str:
        return f"Simulators({', '.join(f'{e.name} {e.version or e.status}' for e in self.simulators)})"


class Parameter(Part):
    """A parameter of an effect."""

    name: str
    unit: str


class KnownEffect(Part):
    """An effect that a diagnosis can name."""

    name: str
    where: Annotated[str, Field(description="Kind of place where it can be: linkage, body, joint, signal, run, ...")]
    says: Annotated[str, Field(description="The effect in words.")]
    parameters: tuple[Parameter, ...]
    simulators: Annotated[tuple[str, ...], Field(description="Engines that simulate it.")]
    asked_for: Annotated[bool, Field(description="Whether it is tried only where --only names it.")] = False


class Effects(Listing):
    """The vocabulary of effects."""

    file: ClassVar[str] = "effects.json"
    remedy: ClassVar[str] = "give what compare effects --json prints"

    effects: tuple[KnownEffect, ...]

    def rows(self) -> list[Row]:
        """A row for each effect."""
        return [
            {"name": e.name, "says": e.says, "parameters": ", ".join(f"{p.name} [{p.unit}]" for p in e.parameters)}
            for e in self.effects
        ]

    def __repr__(self) -> str:
        return f"Effects({len(self.effects)}: {', '.join(e.name for e in self.effects[:4])}, ...)"


class KnownField(Part):
    """A field of a mechanism file."""

    table: Annotated[str, Field(description="Where it stands: body, joint, ...; mechanism is the top level.")]
    name: str
    default: Annotated[str, Field(description="What stands for it where it is left out; required, or empty.")]
    means: Annotated[str, Field(description="Unit and meaning.")]


class Fields(Listing):
    """What a mechanism file may hold."""

    file: ClassVar[str] = "fields.json"
    remedy: ClassVar[str] = "give what compare fields --json prints"

    fields: tuple[KnownField, ...]

    def rows(self) -> list[Row]:
        """A row for each field."""
        return [{"table": f.table, "field": f.name, "default": f.default, "means": f.means} for f in self.fields]

    def __repr__(self) -> str:
        return f"Fields({len(self.fields)} of {', '.join(dict.fromkeys(f.table for f in self.fields))})"

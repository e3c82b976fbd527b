"""The catalogue of shipped cases, engines and effects."""

from __future__ import annotations

from analytic.mechanism.file import load, shipped_cases
from compare.results.catalogue import Capability, Case, Cases, Effects, KnownEffect, KnownEngine, Parameter, Simulators
from sim_models.engine import JOINT_MODELS, MOTIONS, SimulatorMissing, broken, declared, engine_names, installed_version


def cases() -> Cases:
    """The mechanisms that ship with the package."""
    shipped = []
    for name in shipped_cases():
        m = load(name)
        bodies, joints = (tuple(part.name for part in parts) for parts in (m.bodies, m.joints))
        shipped.append(Case(name=name, bodies=bodies, joints=joints, clearance=dict(m.clearances), speed=m.speed))
    return Cases(cases=tuple(shipped))


def simulators() -> Simulators:
    """The engines: installed or not, and what each does."""
    return Simulators(simulators=tuple(_engine(name) for name in engine_names()))


def _simulated(name: str) -> tuple[str, ...]:
    """Names of the effects that an engine declares to simulate, none of its package imported."""
    from compare.diagnose.effects.vocabulary import VOCABULARY

    try:
        chosen = declared(name)
    except SimulatorMissing:
        return ()
    return tuple(effect.name for effect in VOCABULARY.values() if effect.simulated_by(chosen))


def _engine(name: str) -> KnownEngine:
    try:
        chosen = declared(name)
    except SimulatorMissing as why:
        return KnownEngine(
            name=name, package="", status="broken", version=None, fault=str(why), supports=(), effects=()
        )
    version = installed_version(chosen.package)
    fault = broken(chosen.package) if version else ""
    supports = []
    for model in JOINT_MODELS:
        motions = tuple(motion for motion in MOTIONS if (model, motion) in chosen.capabilities.runs)
        supports.append(Capability(joint_model=model, motions=motions))
    return KnownEngine(
        name=name,
        package=chosen.package,
        status="broken" if fault else "installed" if version else "not installed",
        version=version,
        fault=fault,
        supports=tuple(supports),
        effects=_simulated(name),
    )


def effects() -> Effects:
    """The vocabulary of effects: places, parameters, units, and which engines simulate each."""
    from compare.diagnose.effects.vocabulary import VOCABULARY

    able = {name: _simulated(name) for name in engine_names()}
    return Effects(
        effects=tuple(
            KnownEffect(
                name=effect.name,
                where=effect.place,
                says=effect.says("<where>"),
                parameters=tuple(Parameter(name=p.name, unit=p.unit or "of the signal") for p in effect.parameters),
                simulators=tuple(name for name, names in able.items() if effect.name in names),
                asked_for=effect.asked_for,
            )
            for effect in VOCABULARY.values()
        )
    )

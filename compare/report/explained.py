"""explained.toml: the mechanism with the effects, and in comments what was changed, from what, by which diagnosis."""

from __future__ import annotations

import json
import re
import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from analytic.mechanism import Mechanism
from analytic.mechanism.file import dumps
from analytic.mechanism.model import as_written
from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.faults import printable
from compare.quantities import DASH
from compare.results.diagnosis import Diagnosis, Effect, Estimate

KEY = re.compile(r'("(?:[^"\\]|\\.)*"|[\w-]+) = ')
TABLE = re.compile(r"(\[\[?)(.+?)\]\]?")


def explained_toml(result: Diagnosis) -> str:
    """The mechanism with the effects as its file, with comments at its head and at each field that was changed."""
    head = "".join(f"# {printable(line)}\n" for line in _head(result))
    return head + commented(dumps(result.explained), _notes(result))


def changes(result: Diagnosis) -> list[tuple[str, str, str]]:
    """Each field in which the explained mechanism differs from the nominal one, and its two values in SI units."""
    return differences(result.mechanism, result.explained)


def differences(nominal: Mechanism, explained: Mechanism) -> list[tuple[str, str, str]]:
    """Each field in which two mechanisms differ, such as ``joint[B].clearance``, and its two values in SI units.

    What a mechanism leaves out is zero or nothing, so that a field written out as that is no difference.
    """
    one, other = (dict(_fields(as_written(m), "")) for m in (nominal, explained))
    fields = [name for name in other | one if _set(one.get(name)) != _set(other.get(name))]

    def said(side: Mapping[str, object], name: str) -> str:
        return json.dumps(side[name], ensure_ascii=False) if name in side else DASH

    return [(name, said(one, name), said(other, name)) for name in fields]


def commented(text: str, notes: Mapping[str, str]) -> str:
    """TOML text with a note on the line above each field that has one; fields are named as in :func:`differences`."""
    tables: Counter[str] = Counter()
    data, lines, here = tomllib.loads(text), [], ""
    for line in text.splitlines():
        table, key = TABLE.fullmatch(line), KEY.match(line)
        if table is not None and table[1] == "[[":
            here = _entry(data, table[2], tables[table[2]])
            tables[table[2]] += 1
        elif table is not None:
            first, _, rest = table[2].partition(".")
            here = f"{_entry(data, first, tables[first] - 1)}.{rest}" if first in tables else table[2]
        elif key is not None:
            name = next(iter(tomllib.loads(f"{key[1]} = 0")))
            note = notes.get(f"{here}.{name}" if here else name)
            lines += [f"# {printable(note)}"] if note else []
        lines.append(line)
    return "\n".join(lines) + "\n"


def _head(result: Diagnosis) -> Iterator[str]:
    yield f"{result.case} with what a diagnosis added to it ({result.verdict})."
    makers = ("linkage-crosscheck", result.simulator.name)
    packages = ", ".join(f"{name} {version}" for name, version in result.versions.items() if name in makers)
    before, after = result.gap.before, result.gap.after
    yield f"Diagnosed by {packages}; the gap is {before:.4g} times the noise before, {after:.4g} after."
    yield f"Data: {', '.join(f'{run.name} ({run.file})' if run.file else run.name for run in result.runs)}."
    for sensors, title in ((False, "Added"), (True, "Found too, but not of the mechanism and so not in this file")):
        effects = [effect for effect in result.effects if _of_sensor(effect) == sensors]
        if effects:
            yield f"{title} (95 % intervals in brackets):"
            yield from (f"    {effect.key}: {_values(effect)}" for effect in effects)
    changed = changes(result)
    if changed:
        yield "Changed:"
        yield from (f"    {field} = {now}, was {_was(before)}" for field, before, now in changed)
    if result.command:
        yield f"Made by: {result.command}"


def _notes(result: Diagnosis) -> dict[str, str]:
    """What is said at each field that was changed: by which effects, and what it was."""
    causes = {effect.key: _touched(result.mechanism, effect) for effect in result.effects if not _of_sensor(effect)}
    notes = {}
    for field, before, _ in changes(result):
        by = [effect for effect in result.effects if field in causes.get(effect.key, ())]
        said = "; ".join(f"{effect.key}: {_values(effect)}" for effect in by) or "changed by the diagnosis"
        notes[field] = f"{said}; was {_was(before)}"
    return notes


def _touched(nominal: Mechanism, effect: Effect) -> set[str]:
    """Fields that an effect of the vocabulary changes by itself."""
    known = VOCABULARY.get(effect.name)
    if known is None:
        return set()
    values = {name: parameter.value for name, parameter in effect.parameters.items()}
    return {
        field for field, *_ in differences(nominal, known.on_mechanism(nominal, effect.where, known.in_run(values)))
    }


def _of_sensor(effect: Effect) -> bool:
    known = VOCABULARY.get(effect.name)
    return known is not None and known.sensor


def _values(effect: Effect) -> str:
    values = ", ".join(f"{name} {_value(parameter)}" for name, parameter in effect.parameters.items())
    return values + (" (their mean is written)" if effect.repeats else "")


def _value(p: Estimate) -> str:
    """An SI value with its interval: ``0.00015 [0.000148, 0.000152] m``; an open end is not known."""
    low, high = ("?" if end is None else f"{end:.6g}" for end in (p.low, p.high))
    return f"{p.value:.6g} [{low}, {high}]" + ("" if p.unit == "1" else f" {p.unit}")


def _was(nominal: str) -> str:
    return "left out" if nominal == DASH else nominal


def _entry(data: Mapping[str, Any], table: str, index: int) -> str:
    return f"{table}[{data[table][index].get('name', index)}]"


def _fields(value: object, path: str) -> Iterator[tuple[str, object]]:
    """``joint[B].clearance`` and its value for every field of a mechanism."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _fields(inner, f"{path}.{key}" if path else str(key))
    elif isinstance(value, list) and value and all(isinstance(item, Mapping) for item in value):
        for i, item in enumerate(value):
            yield from _fields(item, f"{path}[{item.get('name', i)}]")
    else:
        yield path, value


def _set(value: object) -> object:
    return value if np.any(np.asarray(value)) else None

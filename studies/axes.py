"""The dimensions of a study: what is swept, and which fields each value sets."""

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from math import prod
from typing import Any

import numpy as np

from engine.units import in_si

from .fields import Field, catalogue, nearest, of_that_name, resolve
from .messages import cut, shown, table_rule

MOST_CASES = 1_000_000

OF_THE_RESULTS = ("output.sections",)
"""Fields that decide the shape of the results, so that all cases share them."""

TAKEN = ("frequency",)
"""Names of variables of the dataset that are also the last parts of fields: an axis is then called by the whole name."""


@dataclass(frozen=True)
class Along:
    """A further coordinate along an axis."""

    values: tuple[Any, ...]
    unit: str
    meaning: str


@dataclass(frozen=True)
class Axis:
    """One dimension of a study.

    origin : where the study file says it, for messages; values : as its coordinate holds them, in `unit`
    settings : for each value the fields it sets, dotted name -> value in SI
    """

    origin: str
    name: str
    unit: str
    meaning: str
    values: tuple[Any, ...]
    settings: tuple[Mapping[str, Any], ...]
    along: Mapping[str, Along] = field(default_factory=dict)

    @classmethod
    def of_field(cls, key: str, swept: Field, values: list[Any]) -> "Axis":
        """The axis along which the field that a `key` of [sweep] names takes `values`."""
        settings = tuple({swept.name: value} for value in values)
        name = (swept.name if key in TAKEN else key).replace(".", "_")
        return cls(f"sweep.{key}", name, swept.unit, swept.meaning, tuple(values), settings)


def swept_axes(sweep: Any, mistakes: list[str]) -> list[Axis]:
    """One axis for every key of [sweep]."""
    if not isinstance(sweep, dict):
        mistakes.append(f"sweep = {shown(sweep)}: {table_rule('sweep', sweep)}")
        return []
    axes: dict[str, Axis] = {}
    for name, written in _flat(sweep).items():
        field = resolve(name)
        if field is None:
            mistakes.append(f"sweep.{cut(name)}: {_no_field(name)}")
        elif not field.single:
            mistakes.append(f"sweep.{name}: holds several values and cannot be swept; write a study for each")
        elif field.name in OF_THE_RESULTS:
            mistakes.append(f"sweep.{name}: decides what the results hold and cannot be swept; write a study for each")
        elif field.name in axes:
            mistakes.append(f"sweep.{name}: {field.name} is swept already")
        else:
            values = _values(f"sweep.{name}", written, field, mistakes)
            axes[field.name] = Axis.of_field(name, field, values)
    if (count := prod(len(axis.values) for axis in axes.values())) > MOST_CASES:
        mistakes.append(f"sweep: makes {count:,} cases; must be at most {MOST_CASES:,}")
        return []
    return list(axes.values())


def _no_field(name: str) -> str:
    """Why a key of [sweep] names no field."""
    if len(several := of_that_name(name)) > 1:
        return f"is the name of several fields; write {' or '.join(several).replace('.N.', '.1.')}"
    known = [field.name for field in catalogue()]
    table = re.sub(r"^layer[._][0-9N]+$", "layer", name)
    if of_table := [other for other in known if other.startswith(f"{table}.")]:
        return f"is a table; name one of its fields, as in {of_table[0].replace('.N.', '.1.')}"
    return f"is not a field{nearest(name, known)}"


_RANGE = ("from", "to", "num", "spacing")


def _flat(sweep: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    """Dotted keys of nested tables; a table with keys of a range, or under the name of a field, is a value."""
    flat: dict[str, Any] = {}
    for key, value in sweep.items():
        name = prefix + key
        if isinstance(value, dict) and value and value.keys().isdisjoint(_RANGE) and resolve(name) is None:
            flat |= _flat(value, f"{name}.")
        else:
            flat[name] = value
    return flat


def _values(name: str, written: Any, field: Field, mistakes: list[str]) -> list[Any]:
    """Values of an axis in SI: a list of values and ranges, or one range."""
    entries = written if isinstance(written, list) else [written]
    if not isinstance(written, (list, dict)) or not entries:
        mistakes.append(f"{name} = {shown(written)}: must be a list of at least one value, or {{ from, to, num, spacing }}")
        return []
    values: list[Any] = []
    for entry in entries:
        values += _range(name, entry, field, mistakes) if isinstance(entry, dict) else _single(name, entry, field, mistakes)
    twice = [value for value, count in Counter(values).items() if count > 1]
    mistakes += [f"{name}: holds {shown(value)} {field.unit} twice".replace("  ", " ") for value in twice[:1]]
    return list(dict.fromkeys(values))


def _single(name: str, entry: Any, field: Field, mistakes: list[str]) -> list[Any]:
    if isinstance(entry, (list, dict)):
        mistakes.append(f"{name} = {shown(entry)}: must be a value or a range")
        return []
    if not field.unit:
        return [entry]
    try:
        return [in_si(entry, field.unit, unit_required=True)]
    except ValueError as error:
        mistakes.append(f"{name} = {shown(entry)}: {error}")
        return []


def _two_values(field: Field) -> str:
    """Two values of a field of words, as a study file writes them."""
    first, second = field.rule.split(" | ")[:2] if field.rule else ("a", "b")
    return f"{first}, {second}" if first == "true" else f'"{first}", "{second}"'


def _range(name: str, entry: dict[str, Any], field: Field, mistakes: list[str]) -> list[float]:
    """{ from, to, num, spacing = "linear" or "log" } as values."""
    if not field.numeric:
        mistakes.append(f"{name} = {shown(entry)}: a range is of numbers; list the values, as in [{_two_values(field)}]")
        return []
    if entry.keys().isdisjoint(_RANGE):
        mistakes.append(f"{name} = {shown(entry)}: must be {{ from, to, num }}, with spacing where wanted, or a list of values")
        return []
    before = len(mistakes)
    for key in sorted(entry.keys() - set(_RANGE)):
        mistakes.append(f"{name}.{cut(key)}: is not part of a range; must be from, to, num or spacing")
    ends = []
    for key in ("from", "to"):
        if key not in entry:
            mistakes.append(f"{name}.{key}: is missing")
            continue
        try:
            ends.append(in_si(entry[key], field.unit or "1", unit_required=True))
        except ValueError as error:
            mistakes.append(f"{name}.{key} = {shown(entry[key])}: {error}")
    num: Any = entry.get("num")
    spacing = entry.get("spacing", "linear")
    if "num" not in entry:
        mistakes.append(f"{name}.num: is missing")
    elif isinstance(num, bool) or not isinstance(num, int) or not 2 <= num <= MOST_CASES:
        given = repr(num) if isinstance(num, float) and num < 1e6 else shown(num)
        mistakes.append(f"{name}.num = {given}: must be a whole number from 2 to {MOST_CASES:,}")
    if spacing not in ("linear", "log"):
        mistakes.append(f'{name}.spacing = {shown(spacing)}: must be "linear" or "log"')
    elif spacing == "log" and len(ends) == 2 and not (ends[0] > 0 and ends[1] > 0):
        mistakes.append(f"{name}: a logarithmic range must lie above zero; put the zero beside it, as in [0, {{ from, … }}]")
    if len(mistakes) > before:
        return []
    make = np.geomspace if spacing == "log" else np.linspace
    return [float(value) for value in make(ends[0], ends[1], num)]

"""The fields of a study file: their names, units, rules and meanings, read off the engine's descriptions."""

import difflib
import re
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

from engine.spec import Layer, Section, Spec


@dataclass(frozen=True)
class Field:
    """One field: dotted name, unit ("" where it has none), rule, default as text, meaning.

    single : whether it holds one value; numeric : whether that is a number
    """

    name: str
    unit: str
    rule: str
    default: str
    meaning: str
    single: bool = True
    numeric: bool = True

    @property
    def path(self) -> tuple[str, ...]:
        """Parts of the dotted name."""
        return tuple(self.name.split("."))

    @property
    def label(self) -> str:
        """Last part of the name."""
        return self.path[-1]


@cache
def catalogue() -> tuple[Field, ...]:
    """All fields in the order of the study file; those of a layer as layer.N.field."""
    found: list[Field] = []
    for table, info in Spec.model_fields.items():
        if table == "layer":
            found += _fields("layer.N", Layer, None)
        elif isinstance(info.default, Section):
            found += _fields(table, type(info.default), info.default)
    return tuple(found)


def _fields(prefix: str, section: type[Section], defaults: Section | None) -> list[Field]:
    properties = section.model_json_schema()["properties"]
    return [_field(f"{prefix}.{name}", schema, getattr(defaults, name, None)) for name, schema in properties.items()]


def _field(name: str, schema: dict[str, Any], default: Any) -> Field:
    facts = {**schema, **{key: value for part in schema.get("anyOf", []) for key, value in part.items()}}
    unit = facts.get("unit", "")
    types = {part.get("type") for part in (schema, *schema.get("anyOf", []))}
    return Field(
        name,
        "" if unit == "1" else unit,
        _rule(facts),
        _text(default, unit),
        facts.get("description", ""),
        single=not {"array", "object"} & types,
        numeric=bool({"number", "integer"} & types),
    )


_LIMITS = {
    "exclusiveMinimum": ">",
    "minimum": "≥",
    "exclusiveMaximum": "<",
    "maximum": "≤",
    "gt": ">",
    "ge": "≥",
    "lt": "<",
    "le": "≤",
}


def _rule(facts: dict[str, Any]) -> str:
    if "enum" in facts:
        return " | ".join(facts["enum"])
    if facts.get("type") == "boolean":
        return "true | false"
    whole = facts.get("type") == "integer"
    limits = [f"{sign} {facts[key]:{',' if whole else 'g'}}" for key, sign in _LIMITS.items() if key in facts]
    return ", ".join(limits + (["even"] if facts.get("multipleOf") == 2 else []))


def _text(default: Any, unit: str) -> str:
    if default is None or default == {}:
        return "–"
    if isinstance(default, bool):
        return str(default).lower()
    if isinstance(default, float):
        return f"{default:g}" + (f" {unit}" if unit not in ("", "1") else "")
    return str(default)


def nearest(name: str, known: list[str]) -> str:
    """'; did you mean x?' where a known name is like this one, otherwise nothing. Names of layers hold their number."""
    general, number = _without_number(name)
    if general in known and number is None and "layer" not in name:
        return f"; write {name} without quotes"
    found = _like(general, known)
    return f"; did you mean {found.replace('.N.', f'.{number or 1}.')}?" if found else ""


def _without_number(name: str) -> tuple[str, str | None]:
    """layer.2.E and layer_2_E as layer.N.E, and the number."""
    match = re.fullmatch(r"layer([._])([0-9]{1,50})\1(.+)", name)
    return (f"layer.N.{match[3]}", match[2]) if match else (name, None)


def _like(name: str, known: list[str]) -> str | None:
    """The known name that `name` stands for: of the same table where it names one, else by all of it, else by its last part."""
    table, _, leaf = name.rpartition(".")
    leaves = {other.rpartition(".")[2]: other for other in reversed(known)}
    within = {other.rpartition(".")[2]: other for other in known if table and other.startswith(f"{table}.")}
    if within:
        return _close(leaf, within) or leaves.get(leaf)
    whole = {other.replace(".", "_"): other for other in known}
    return leaves.get(leaf) or _close(name.replace(".", "_"), whole) or _close(leaf, leaves)


LEAST_LIKE = 0.7
"""Of two names, for one to be proposed in place of the other; "studies" is like "sides" by 0.67."""


def _close(word: str, names: dict[str, str]) -> str | None:
    """What stands behind the name that is most like `word`, capitals left aside, or that it begins."""
    lower = {name.lower(): other for name, other in names.items()}
    like = difflib.get_close_matches(word.lower(), lower, n=1, cutoff=LEAST_LIKE)
    like += [name for name in lower if len(word) > 2 and name.startswith(word.lower())]
    return lower[like[0]] if like else None


def of_that_name(name: str) -> list[str]:
    """Dotted names of all fields whose last part is `name`."""
    return [field.name for field in catalogue() if field.label == name]


def resolve(name: str) -> Field | None:
    """The field that a key of [sweep] names: dotted (layer.2.E), with underscores (damping_ratio), or its last part if unique."""
    if match := re.fullmatch(r"layer([._])([0-9]{1,50})\1(\w+)", name):
        general = next((field for field in catalogue() if field.name == f"layer.N.{match[3]}"), None)
        return None if general is None else replace(general, name=f"layer.{match[2]}.{match[3]}")
    same_leaf = []
    for field in catalogue():
        if field.path[0] != "layer" and name in (field.name, field.name.replace(".", "_")):
            return field
        if field.label == name:
            same_leaf.append(field)
    return same_leaf[0] if len(same_leaf) == 1 and same_leaf[0].path[0] != "layer" else None

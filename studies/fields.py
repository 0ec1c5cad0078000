"""The fields of a study file: their names, units, rules and meanings, read off the engine's descriptions."""

import difflib
import re
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

from engine.spec import Layer, Section, Spec


@dataclass(frozen=True)
class Field:
    """One field: dotted name, unit ("" where it has none), rule, default as text, meaning; whether it holds a single value."""

    name: str
    unit: str
    rule: str
    default: str
    meaning: str
    single: bool = True

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
    single = not {"array", "object"} & {part.get("type") for part in (schema, *schema.get("anyOf", []))}
    return Field(name, "" if unit == "1" else unit, _rule(facts), _text(default, unit), facts.get("description", ""), single)


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
    limits = [f"{sign} {facts[key]:g}" for key, sign in _LIMITS.items() if key in facts]
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
    """' Did you mean x?' where a known name is like this one, otherwise nothing."""
    leaf = name.rsplit(".", 1)[-1]
    by_leaf = {other.rsplit(".", 1)[-1]: other for other in reversed(known)}
    close = [by_leaf[leaf]] if leaf in by_leaf else difflib.get_close_matches(name, known, n=1, cutoff=0.6)
    if not close:
        close = [by_leaf[other] for other in difflib.get_close_matches(leaf, list(by_leaf), n=1, cutoff=0.6)]
    return f"; did you mean {close[0]}?" if close else ""


def of_that_name(name: str) -> list[str]:
    """Dotted names of all fields whose last part is `name`."""
    return [field.name for field in catalogue() if field.label == name]


def resolve(name: str) -> Field | None:
    """The field that a key of [sweep] names: dotted (layer.2.E), with underscores (damping_ratio), or its last part if unique."""
    if match := re.fullmatch(r"layer([._])([0-9]+)\1(\w+)", name):
        general = next((field for field in catalogue() if field.name == f"layer.N.{match[3]}"), None)
        return None if general is None else replace(general, name=f"layer.{match[2]}.{match[3]}")
    same_leaf = []
    for field in catalogue():
        if field.path[0] != "layer" and name in (field.name, field.name.replace(".", "_")):
            return field
        if field.label == name:
            same_leaf.append(field)
    return same_leaf[0] if len(same_leaf) == 1 and same_leaf[0].path[0] != "layer" else None

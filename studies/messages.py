"""Words for a user: mistakes in a study file, one line each (file, field, value, rule), and values with their units."""

import math
import re
from collections.abc import Callable
from datetime import date, time
from typing import Any

import numpy as np
from pydantic import ValidationError

from .fields import catalogue, nearest, resolve

MOST_ALIKE = 3
"""Of the values of an axis that break the same rule, how many are told one by one."""


BACKSLASH = "\\"

MOST_BITS = 10_000
"""Of a whole number that is written in decimals; of more than 4300 of them Python makes an error."""


class StudyError(Exception):
    """The study cannot be run; `mistakes` holds one line for each reason."""

    def __init__(self, mistakes: list[str]) -> None:
        told = _thinned([one_line(mistake) for mistake in mistakes])
        super().__init__("\n".join(told))
        self.mistakes = told


_OF_AN_AXIS = re.compile(r"[^:]*: (sweep|domain_size)\b")
_VALUE = re.compile(r"(?<![\w.])[-+]?\d[\w.+,-]*")


def _thinned(mistakes: list[str]) -> list[str]:
    """The mistakes; where values of an axis differ in nothing but their numbers the first ones, and how many more there are."""
    alike: dict[str, list[str]] = {}
    for line in mistakes:
        alike.setdefault(_VALUE.sub("#", line) if _OF_AN_AXIS.match(line) else line, []).append(line)
    told = []
    for lines in alike.values():
        told += lines[:MOST_ALIKE]
        if (more := len(lines) - MOST_ALIKE) > 0:
            told.append(f"{lines[0].split(' = ')[0]}: {more:,} more like this")
    return told


def one_line(text: str) -> str:
    """The text with what is not printed (line ends, what moves the cursor of a terminal or colours it) written as escapes."""
    return "".join(map(_printed, text))


def _printed(character: str) -> str:
    return character if character.isprintable() else character.encode("unicode_escape").decode()


def cut(text: str) -> str:
    """The text, or its beginning where it is long."""
    return text if len(text) <= 60 else text[:57] + "..."


def shown(value: Any) -> str:
    """A value as a study file writes it, cut where it is long."""
    return cut(_written(value))


def _written(value: Any) -> str:
    if isinstance(value, str):
        return f'"{one_line(value.replace(BACKSLASH, 2 * BACKSLASH))}"'
    if isinstance(value, int) and value.bit_length() > MOST_BITS:
        return hex(value)
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float) and math.isfinite(value):
        return f"{value:g}"
    if isinstance(value, (date, time)):
        return value.isoformat()
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_written, value))}]"
    if isinstance(value, dict):
        inside = ", ".join(f"{key} = {_written(inner)}" for key, inner in value.items())
        return f"{{ {inside} }}" if inside else "{}"
    return repr(value)


def _nearest_field(name: str) -> str:
    return nearest(name, [field.name for field in catalogue()])


_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"))


def in_words(value: object, unit: str) -> str:
    """A value with its unit, as a reader would write it: 2 MPa, 0.05."""
    if isinstance(value, (bool, np.bool_)):
        return str(bool(value)).lower()
    if isinstance(value, str):
        return str(value)
    number = float(value)  # type: ignore[arg-type]
    if number == 0.0:
        return "0"
    unit = unit.replace("**", "")
    if unit in ("Pa", "Hz"):
        for factor, prefix in _PREFIXES:
            if abs(number) >= 0.01 * factor and abs(number) >= 1e3:
                return f"{number / factor:.3g} {prefix}{unit}"
    digits = 4 if unit == "m" else 3  # 31.25 m
    text = f"{number:.0f}" if 1e3 <= abs(number) < 1e5 and number == round(number) else f"{number:.{digits}g}"
    return text if unit in ("", "1") else f"{text} {unit}"


def explain(error: ValidationError, hint: Callable[[str], str] = _nearest_field) -> list[str]:
    """One line a mistake, 'field = value: rule', in the order of the file; `hint` says what an unknown name may mean."""
    found = error.errors()
    inner = {e["loc"][0] for e in found if len(e["loc"]) > 1}
    short = {e["loc"][:-1]: e["loc"][-1] + 1 for e in found if e["type"] == "missing" and isinstance(e["loc"][-1], int)}
    lines = []
    for e in found:
        if e["type"] == "too_short" and e["loc"] and e["loc"][0] in inner:
            continue  # pydantic's echo of broken entries
        if e["type"] == "missing" and (of := e["loc"][:-1]) in short:
            lines.append(f"{_name(of)} = {shown(e['input'])}: must have {short[of]} entries")
        else:
            lines += _lines(e, hint)
    return list(dict.fromkeys(lines))


def _name(loc: tuple[Any, ...]) -> str:
    return ".".join(str(part + 1) if isinstance(part, int) else cut(str(part)) for part in loc)


def _lines(e: Any, hint: Callable[[str], str]) -> list[str]:
    name = _name(e["loc"])
    if e["type"] == "value_error":
        text = str(e["ctx"]["error"])
        return text.split("\n") if not name else [f"{name}{_given(e, name)}: {text}{_several(e, name)}"]
    if e["type"] == "extra_forbidden":
        return [f"{name}{_given(e, name)}: is not a field{hint(name)}"]
    if e["type"] == "missing":
        return [f"{name}: is missing"]
    return [f"{name}{_given(e, name)}: {_rule(e, name)}{_several(e, name)}"]


def _given(e: Any, name: str) -> str:
    """' = value': with its unit where it is in SI already, with all its figures where a rule is about them."""
    value = e["input"]
    if isinstance(value, dict):
        return ""
    if not isinstance(value, float) or not math.isfinite(value):
        return f" = {shown(value)}"
    if e["type"].startswith("int_"):
        return f" = {value!r}"  # 3.0 is no whole number
    text = f"{value:g}" if math.isclose(float(f"{value:g}"), value, rel_tol=1e-9) else f"{value:.9g}"
    field = resolve(name)
    bare = e["type"] == "value_error" or field is None or not field.unit
    return f" = {text}" if bare or field is None else f" = {text} {field.unit}"


def _several(e: Any, name: str) -> str:
    """What to do with several values where one is asked for."""
    field = resolve(name)
    wanted = isinstance(e["input"], (list, dict)) and field is not None and field.single
    return "; several values belong in [sweep]" if wanted else ""


def table_rule(name: str, value: Any) -> str:
    """How to write the table that `value` should have been."""
    if isinstance(value, list) and any(isinstance(entry, dict) for entry in value):
        return f"must be one table; write [{name}] in single brackets"
    return f"must be a table: [{name}], and its fields below it"


_RULES = {
    "greater_than": "must be greater than {gt}",
    "greater_than_equal": "must be {ge} or more",
    "less_than": "must be less than {lt}",
    "less_than_equal": "must be {le} or less",
    "literal_error": "must be {expected}",
    "string_type": "must be text in quotes",
    "bool_type": "must be true or false",
    "bool_parsing": "must be true or false",
    "int_type": "must be a whole number",
    "int_parsing": "must be a whole number",
    "int_from_float": "must be a whole number",
    "multiple_of": "must be even",
    "too_short": "must have at least one entry",
    "too_long": "must have at most {max_length} entries",
}


def _rule(e: Any, name: str) -> str:
    if e["type"] in ("model_type", "model_attributes_type", "dict_type"):
        of_a_layer = any(isinstance(part, int) for part in e["loc"])
        return "must be a table" if of_a_layer else table_rule(name, e["input"])
    if e["type"] == "tuple_type":
        return "must be a list of tables, each headed [[layer]]" if name == "layer" else "must be a list"
    if e["type"] not in _RULES:
        return e["msg"][0].lower() + e["msg"][1:]
    limits = {key: f"{limit:,}" if isinstance(limit, int) else limit for key, limit in e.get("ctx", {}).items()}
    return _RULES[e["type"]].format(**limits)

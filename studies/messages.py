"""Mistakes in a study file, one line each: file, field, value, rule."""

import math
from typing import Any

from pydantic import ValidationError

from .fields import catalogue, nearest


class StudyError(Exception):
    """The study cannot be run; `mistakes` holds one line for each reason."""

    def __init__(self, mistakes: list[str]) -> None:
        super().__init__("\n".join(mistakes))
        self.mistakes = mistakes


def shown(value: Any) -> str:
    """A value as a message shows it, cut where it is long."""
    if isinstance(value, str):
        text = '"' + value.encode("unicode_escape").decode("ascii") + '"'
    elif isinstance(value, bool):
        text = str(value).lower()
    elif isinstance(value, float) and math.isfinite(value):
        text = f"{value:g}"
    else:
        text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def explain(error: ValidationError) -> list[str]:
    """One line a mistake, 'field = value: rule', in the order of the file."""
    found = error.errors()
    inner = {e["loc"][0] for e in found if len(e["loc"]) > 1}
    lines = []
    for e in found:
        if e["type"] == "too_short" and e["loc"] and e["loc"][0] in inner:
            continue  # pydantic's echo of broken entries
        lines += _lines(e)
    return lines


def _lines(e: Any) -> list[str]:
    name = ".".join(str(part + 1) if isinstance(part, int) else str(part) for part in e["loc"])
    if e["type"] == "value_error":
        text = str(e["ctx"]["error"])
        return text.split("\n") if not name else [f"{name}{_given(e['input'])}: {text}"]
    if e["type"] == "extra_forbidden":
        known = [field.name for field in catalogue()]
        return [f"{name}{_given(e['input'])}: is not a field{nearest(name, known)}"]
    if e["type"] == "missing":
        return [f"{name}: is missing"]
    return [f"{name}{_given(e['input'])}: {_rule(e)}"]


def _given(value: Any) -> str:
    return "" if isinstance(value, dict) else f" = {shown(value)}"


def _rule(e: Any) -> str:
    context = e.get("ctx", {})
    rules = {
        "greater_than": "must be greater than {gt:g}",
        "greater_than_equal": "must be {ge:g} or more",
        "less_than": "must be less than {lt:g}",
        "less_than_equal": "must be {le:g} or less",
        "multiple_of": "must be a multiple of {multiple_of:g}",
        "literal_error": "must be {expected}",
        "string_type": "must be text in quotes",
        "bool_type": "must be true or false",
        "bool_parsing": "must be true or false",
        "int_type": "must be a whole number",
        "int_parsing": "must be a whole number",
        "int_from_float": "must be a whole number",
        "model_type": "must be a table",
        "model_attributes_type": "must be a table",
        "dict_type": "must be a table",
        "tuple_type": "must be a list",
        "too_short": "must have at least {min_length} entries",
        "too_long": "must have at most {max_length} entries",
    }
    return rules[e["type"]].format(**context) if e["type"] in rules else e["msg"][0].lower() + e["msg"][1:]

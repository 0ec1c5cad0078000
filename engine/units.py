"""Quantities with units: what a study file writes ("20 m", "200 N/cm**2") becomes a float in SI."""

import math
import re
from functools import cache
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, ValidationInfo

_NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(\S.*?)?\s*")

_NO_UNIT = re.compile(r"[\d)]\s*(\*\*|\^)|\d{3}")
"""Powers of numbers and of brackets, long numbers: sums to be worked out, not units."""

SIZES = (1e-30, 1e30)
"""What a number but zero may be in SI: their squares and their products with others stay far from where floats end."""

_MEANT = {
    ("g", "m/s**2"): " (the gram); the standard gravity is g_0",
    ("gal", "m/s**2"): " (the gallon); the unit of gravimetry is Gal",
}
"""What to say where a unit of another kind has the name of the one that is meant."""


@cache
def _registry() -> Any:
    import pint  # slow to import, and needed only where a study file carries units

    return pint.UnitRegistry()


_COMMON = {
    "m": {"cm": 1e-2, "mm": 1e-3},
    "s": {"ms": 1e-3},
    "Pa": {"kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "kN/m**2": 1e3, "N/cm**2": 1e4, "N/mm**2": 1e6},
    "m/s**2": {"cm/s**2": 1e-2, "g_0": 9.80665},
    "kg/m**3": {"t/m**3": 1e3},
    "N/m**3": {"kN/m**3": 1e3},
}
"""What pint says of the units that most studies are written in: to start it takes longer than to read a study."""


def _factor(written: str, wanted: str) -> float:
    """What one `written` unit is in `wanted` units; ValueError where it is no such unit."""
    if written == wanted:
        return 1.0
    return _COMMON.get(wanted, {}).get(written) or _by_pint(written, wanted)


@cache
def _by_pint(written: str, wanted: str) -> float:
    """`_factor` of any unit that there is."""
    import pint

    if re.match(r",\d", written):
        raise ValueError("has a decimal comma; write a decimal point")
    if re.match(r"\d{3}\b", written):
        raise ValueError("holds two numbers; write one number without spaces, and a unit")
    if _NO_UNIT.search(written):
        raise ValueError(f"unit {written!r} is not known; must be a unit like {wanted}")
    try:
        unit = _registry().parse_units(written)
        factor = float(_registry().Quantity(1.0, unit).to(wanted).magnitude)
        angular = wanted == "Hz" and "radian" in str(_registry().get_base_units(unit)[1])
    except pint.DimensionalityError:
        if wanted == "dimensionless":
            raise ValueError(f"must be a number without a unit (dimensionless), not one in {written}") from None
        hint = _MEANT.get((written, wanted), "")
        raise ValueError(f"must be a quantity in {wanted} or a unit like it, {written} is not{hint}") from None
    except Exception:  # pint passes on whatever its parser met
        raise ValueError(f"unit {written!r} is not known; must be a unit like {wanted}") from None
    if angular:
        raise ValueError(f"must be a frequency in Hz, {written} is an angular one; divide by 2 pi")
    return factor


def in_si(value: Any, unit: str, unit_required: bool) -> float:
    """`value` as a float in `unit` (an SI unit, or "1"). A bare number but zero is refused where `unit_required`."""
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise ValueError(
            'must be a number with a unit in quotes, as in "2.5 ' + unit + '"' if unit != "1" else "must be a number"
        )
    if isinstance(value, str):
        match = _NUMBER.fullmatch(value) if len(value) < 80 else None
        if match is None:
            raise ValueError(f'must be a number and a unit, as in "2.5 {unit}"' if unit != "1" else "must be a number")
        number, written = float(match[1]), (match[2] or "")
    else:
        number, written = float(value) if abs(value) < 1e300 else math.inf, ""
    if written and math.isfinite(number):
        number *= _factor(written, "dimensionless" if unit == "1" else unit)
    if not math.isfinite(number):
        raise ValueError("must be finite")
    if number != 0.0 and not SIZES[0] <= abs(number) <= SIZES[1]:
        raise ValueError(f"must be zero or of a size from {SIZES[0]:g} to {SIZES[1]:g}{'' if unit == '1' else ' ' + unit}")
    if written:
        return number
    if unit_required and unit != "1" and number != 0.0:
        raise ValueError(f'needs a unit, as in "{number:g} {unit}"')
    return number


def Quantity(unit: str, meaning: str, **rules: Any) -> Any:
    """Type of a field: a float in `unit`, with its meaning and pydantic's rules (gt, ge, lt, le)."""

    def convert(value: Any, info: ValidationInfo) -> Any:
        if value is None:
            return None
        return in_si(value, unit, bool(info.context and info.context.get("from_file")))

    return Annotated[float, BeforeValidator(convert), Field(description=meaning, json_schema_extra={"unit": unit}, **rules)]

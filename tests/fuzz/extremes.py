"""Every field that holds a number, set to what no one would write but a script might: the ends of what a float can hold."""

from collections.abc import Iterator

from studies.fields import catalogue
from tests.fuzz.models import Table

SMALL: Table = {
    "motion": {"record": "ricker", "peak": "1 m/s**2", "vertical_record": "ricker", "vertical_peak": "0.5 m/s**2"},
    "ricker": {"frequency": "5 Hz", "arrival": "0.05 s"},
    "time": {"dt": "0.01 s", "duration": "0.1 s"},
    "domain": {"width": "14 m"},
    "mesh": {
        "order": 1,
        "wall_elements": 1,
        "roof_elements": 2,
        "side_elements": 2,
        "corner_levels": 0,
        "first": "3 m",
        "growth": 2.0,
        "largest_width": "5 m",
        "largest_height": "5 m",
    },
    "output": {"sections": 3, "every": 1},
}
"""A hundred degrees of freedom and ten steps."""

VALUES = (0.0, 5e-324, 1e-160, 1e-30, 1e9, 1e30, 1.7e308)
LAYER = {"bottom": "14 m", "E": "1e9 Pa", "nu": 0.2, "density": "2000 kg/m**3", "friction": 0.4}


def extreme_tables() -> Iterator[tuple[str, Table]]:
    """(name of field = value, table) of every field at every value, with both signs where it may have both."""
    for field in catalogue():
        if not field.numeric or not field.single or not field.default:
            continue
        for value in (sign * size for size in VALUES for sign in ((1, -1) if size else (1,))):
            written = f"{value!r} {field.unit}" if field.unit else value
            yield f"{field.name} = {written}", with_field(field.path, written)


def with_field(path: tuple[str, ...], value: object) -> Table:
    """The small table with one field set."""
    table, last = {**SMALL}, path[-1]
    if path[0] == "layer":
        others = {"G": {"E"}, "Vs": {"E"}, "unit_weight": {"density"}}.get(last, set())
        table["layer"] = [{key: kept for key, kept in LAYER.items() if key not in others} | {last: value}]
    else:
        table[path[0]] = {**table.get(path[0], {}), last: value}
    return table

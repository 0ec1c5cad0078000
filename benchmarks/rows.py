"""Rows of a table, told one by one as they come."""

from collections.abc import Callable, Iterable
from typing import TypeVar

Row = TypeVar("Row")


def told(rows: Iterable[Row], seen: Callable[[Row], None] | None) -> list[Row]:
    """All rows; `seen` is called with each as soon as it is there."""
    found = []
    for row in rows:
        found.append(row)
        if seen is not None:
            seen(row)
    return found

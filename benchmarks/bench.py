"""results/bench.json: what the benchmarks found, on what, and when."""

import json
import math
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

from .machine import machine, versions
from .process import ROOT

BENCH = ROOT / "results" / "bench.json"
PACKAGES = ("coralquake", "numpy", "scipy", "numba")


def merged(before: Mapping[str, Any], found: Mapping[str, Any], tables: list[str]) -> dict[str, Any]:
    """What was there with what the named tables found in its place, this machine, and the day each table was measured."""
    today = datetime.now(UTC).date().isoformat()
    measured = before.get("measured", {}) | dict.fromkeys(tables, today)
    return {**before, **found, "measured": measured, "machine": machine(), "versions": versions(*PACKAGES)}


def read() -> dict[str, Any]:
    """What the file holds; nothing where there is none."""
    return json.loads(BENCH.read_text(encoding="utf-8")) if BENCH.exists() else {}


def write(content: Mapping[str, Any]) -> None:
    """The file; what is not a number is null."""
    BENCH.parent.mkdir(exist_ok=True)
    BENCH.write_text(json.dumps(_plain(content), indent=1, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8")


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value

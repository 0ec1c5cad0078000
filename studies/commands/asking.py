"""check, list, schema: what would run, what is shipped, what a study file may say; without xarray, for nothing runs."""

import os
from collections.abc import Iterator

from rich.text import Text

from engine.spec import PRESETS

from ..advice import advise
from ..fields import catalogue
from ..messages import one_line
from ..plan import load_study, shipped_studies
from ..sizes import MEASURES
from . import console
from .console import load_all, say


def check(study: str, workers: int | None) -> None:
    """Validate a study and say what would run, its size and warnings."""
    (loaded,) = load_all([study])
    advice = advise(loaded, workers or os.cpu_count() or 1)
    console.out.print(Text(one_line(loaded.title), style="bold"))
    width = max(len(name) for name, _ in advice.facts)
    for name, value in advice.facts:
        say(f"{name:<{width}}  {value}")
    if said := loaded.scaling.sentence:
        say(said)
    for warning in advice.warnings:
        say(f"warning: {warning}")


def list_studies() -> None:
    """Name the shipped studies."""
    for name in shipped_studies():
        study = load_study(name)
        say(f"{name:<12}  {len(study.cases):>5} {'case ' if len(study.cases) == 1 else 'cases'}  {study.title}")


def schema() -> None:
    """List every field of a study file: unit, default, rule, meaning."""
    for line in _schema_lines():
        say(line)


def _schema_lines() -> Iterator[str]:
    """The fields as a study file would hold them, with rule and meaning behind."""
    yield 'title = "…"'
    yield f"model = {' | '.join(PRESETS)}"
    table = ""
    for field in catalogue():
        *path, last = field.path
        if (head := ".".join(path)) != table:
            table = head
            yield ""
            yield ("[[layer]]                      # once for every layer, from the top" if table == "layer.N" else f"[{table}]")
        plain = field.default in ("true", "false", "–") or field.default.lstrip("-")[:1].isdigit()
        value = field.default if plain and not (field.unit and field.default != "–") else f'"{field.default}"'
        if field.default == "–" and field.unit:
            value = f'"… {field.unit}"'
        yield f"{last:<16} = {value:<16} # {'; '.join(part for part in (field.meaning, field.rule) if part)}"
    yield ""
    yield "[sweep]                        # a grid of any of these"
    yield 'p0 = [0, "1 MPa", { from = "2 MPa", to = "4 MPa", num = 3, spacing = "linear" }]    # or "log"'
    yield "# a key is the dotted name (pressure.p0), with underscores (damping_ratio), or its last part where unique (p0)"
    yield ""
    yield "[domain_size]                  # or this instead of [sweep]: the iterative boundary method"
    yield 'width = { from = "12.8 m", factor = 1.25, num = 6 }    # factor ≥ 1.25, num from 3 to 50'
    yield 'depth = { from = "14 m", factor = 1.25, num = 5 }      # at the last width; the record stays at the depth of [domain]'
    yield "tolerance = 0.0216             # change at which the method stops; > 0, < 1"
    yield f'measure = "{MEASURES[0]}"           # {" | ".join(MEASURES)}'

"""Attack the engine: `python -m tests.fuzz --number N --seed S [--only K]`; `make fuzz N=10000 SEED=1`.

Every finding leaves a study file in results/fuzz that reproduces it with `coralquake run`; so does a model that ends the process
or takes too long. Exit code 1 where there is one, or where a thousandth of the cases or more did not converge.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy is imported: its threads cost more here than they save

import argparse
import faulthandler
import sys
from collections import Counter
from contextlib import suppress
from pathlib import Path
from time import perf_counter

from rich.console import Console
from rich.progress import track
from rich.table import Table

from engine import compile_kernels
from tests.fuzz.examine import FIGURES, LOST, Depth, Examined, examine, largest, summed
from tests.fuzz.models import Drawn, as_toml, draw

FOLDER = Path("results/fuzz")

REFERENCE_EVERY, READING_EVERY, RELATIONS_EVERY, REORDERED_EVERY, WORKERS_EVERY = 20, 20, 40, 40, 200
"""Models between two that are asked this, too."""

EVERYTHING = Depth(reference=True, reading=True, relations=True, reordered=True, workers=True)

MOST_SECONDS = 300
"""Of one model; then the process ends itself and says where it was."""

MOST_UNCONVERGED = 1e-3
"""Of all cases."""


def depth_of(number: int) -> Depth:
    """What model `number` is asked beyond its own results."""
    return Depth(
        reference=number % REFERENCE_EVERY == 0,
        reading=number % READING_EVERY == 10,
        relations=number % RELATIONS_EVERY == 1,
        reordered=number % REORDERED_EVERY == 2,
        workers=number % WORKERS_EVERY == 3,
    )


def main() -> int:
    """Run, and tell."""
    arguments = _arguments()
    console, only = Console(), arguments.only
    faulthandler.enable()
    compile_kernels()
    start, examined = perf_counter(), []
    numbers = range(arguments.number) if only is None else [only]
    with suppress(KeyboardInterrupt):  # then what was done until then is told
        for number in track(numbers, "models", console=Console(stderr=True)):
            faulthandler.dump_traceback_later(MOST_SECONDS, exit=True)
            drawn = draw(arguments.seed, number)
            if only is not None:
                print(as_toml(drawn.table))
            path = _written(drawn)  # stays where the process is lost
            examined.append(examine(drawn, depth_of(number) if only is None else EVERYTHING))
            for line in examined[-1].findings:
                console.print(f"model {number}: {line}; coralquake run {path}", markup=False, soft_wrap=True)
            if not examined[-1].findings:
                path.unlink()
    faulthandler.cancel_dump_traceback_later()
    return _tell(console, examined, perf_counter() - start)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz")
    parser.add_argument("--number", type=int, default=1000, help="models")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=int, help="this model alone, asked everything")
    return parser.parse_args()


def _written(drawn: Drawn) -> Path:
    """The study file of a model."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    path = FOLDER / f"{drawn.seed}-{drawn.number}.toml"
    path.write_text(as_toml(drawn.table))
    return path


def _tell(console: Console, examined: list[Examined], seconds: float) -> int:
    table = summed(examined)
    ways = sorted(table["all"], key=lambda way: -table["all"][way])
    shown = Table("feature", *ways)
    for name in ("all", *sorted(table.keys() - {"all"})):
        shown.add_row(name, *(f"{table[name][way]:,}" for way in ways))
    console.print(shown)
    for way, count in sorted(sum((each.told for each in examined), Counter()).items()):
        console.print(f"{count:>7,}  {way}")
    for name in FIGURES:
        value, number = largest(examined, name)
        console.print(f"largest {name}: {value:.2g}, model {number}")
    slowest = max(examined, key=lambda each: each.seconds)
    console.print(f"slowest: model {slowest.drawn.number}, {slowest.seconds:.1f} s")
    findings = sum(len(each.findings) for each in examined)
    cases = table["all"].total()
    unconverged = table["all"]["not_converged"] + table["all"][LOST]
    console.print(f"{len(examined):,} models, {cases:,} cases, {seconds:.0f} s; {unconverged} not converged, {findings} findings")
    return int(findings > 0 or unconverged >= max(1, MOST_UNCONVERGED * cases))


if __name__ == "__main__":
    sys.exit(main())

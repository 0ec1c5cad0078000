"""`make bench-large`: benchmarks/large.toml by two workers: seconds, memory, size of the file, how the cases ended."""

import argparse
import subprocess
import sys
import time
import tomllib
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import xarray as xr

from engine import Status
from studies import Study, make_study
from studies.batch import Progress
from studies.runner import Run, run_into

from . import bench
from .process import ROOT, peak_gib, peak_of_children_gib

FILE = Path(__file__).with_suffix(".toml")
RESULT = ROOT / "results" / "large.nc"
FRICTIONS = 20
WORKERS = 2
GOALS = {"seconds": 300, "gib": 2}


@dataclass(frozen=True)
class Large:
    """What the study took.

    seconds_reading, seconds_computing, seconds_writing : wall time, with every kernel compiled before; batches are written while
    others are computed, so that writing is their merging to one file
    parent_gib, child_gib : largest resident memory of the process that asked and of any worker
    file_mib : size of the dataset; statuses : number of cases by how they ended
    """

    cases: int
    solved: int
    steps: int
    workers: int
    seconds_reading: float
    seconds_computing: float
    seconds_writing: float
    parent_gib: float
    child_gib: float
    file_mib: float
    statuses: dict[str, int]

    @property
    def seconds(self) -> float:
        """From the study file to the dataset's."""
        return self.seconds_reading + self.seconds_computing + self.seconds_writing

    @property
    def gib(self) -> float:
        """At most so much resident memory at once: all peaks together."""
        return self.parent_gib + self.workers * self.child_gib

    def in_words(self) -> list[str]:
        """One line a fact."""
        ended = ", ".join(f"{n:,} {name}" for name, n in self.statuses.items())
        return [
            f"{self.cases:,} cases, {self.solved:,} solved, {self.steps:,} steps each, {self.workers} workers: {ended}",
            f"{self.seconds:.0f} s (goal {GOALS['seconds']} s for 10,000 cases): reading the study {self.seconds_reading:.0f} s, "
            f"computing {self.seconds_computing:.0f} s, writing {self.seconds_writing:.0f} s",
            f"{self.gib:.2f} GiB resident at most (goal {GOALS['gib']} GiB): {self.parent_gib:.2f} GiB here "
            f"and up to {self.child_gib:.2f} GiB in each worker",
            f"{RESULT.name}: {self.file_mib:.0f} MiB; peaks, extremes and states of every step, histories of the first and last",
        ]


def study_of(frictions: int = FRICTIONS) -> Study:
    """The study with so many values of the friction, 500 cases each."""
    return make_study(table_of(frictions), FILE.stem, FILE.read_text(encoding="utf-8"), FILE.parent, FILE.name)


def table_of(frictions: int) -> dict[str, Any]:
    """The study file with so many values of the friction."""
    table = tomllib.loads(FILE.read_text(encoding="utf-8"))
    table["sweep"]["layer.3.friction"]["num"] = frictions
    return table


def measured(frictions: int) -> Large:
    """Run the study anew into its results file; all after the last step is merging and writing."""
    subprocess.run([sys.executable, "-c", "import engine; engine.compile_kernels()"], cwd=ROOT, check=True)  # memory of its own
    began = time.perf_counter()
    study = study_of(frictions)
    solved = len(study.scaling.solved)
    read = time.perf_counter()
    computed = read

    def watch(run: Run) -> Progress:
        def tell(steps: int) -> None:
            nonlocal computed
            computed = time.perf_counter()

        return tell

    run_into(RESULT, study, WORKERS, watch, fresh=True)
    written = time.perf_counter()
    with xr.open_dataset(RESULT, engine="netcdf4") as ds:
        statuses = by_status(ds["status"].values.ravel().tolist())
    return Large(
        cases=len(study.cases),
        solved=solved,
        steps=study.steps(0),
        workers=WORKERS,
        seconds_reading=read - began,
        seconds_computing=computed - read,
        seconds_writing=written - computed,
        parent_gib=peak_gib(),
        child_gib=peak_of_children_gib(),
        file_mib=RESULT.stat().st_size / 2**20,
        statuses=statuses,
    )


def by_status(statuses: Sequence[int]) -> dict[str, int]:
    """How many cases ended how, in words."""
    return {Status(status).name.lower().replace("_", " "): n for status, n in sorted(Counter(statuses).items())}


def main(arguments: Sequence[str] | None = None) -> None:
    """Run, say what it took, and add it to results/bench.json where that is."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.large", description=__doc__)
    parser.add_argument("--frictions", type=int, default=FRICTIONS, help="values of the friction, from 2, 500 cases each")
    found = measured(parser.parse_args(arguments).frictions)
    print(*found.in_words(), sep="\n")
    if before := bench.read():
        entry = asdict(found) | {"seconds": found.seconds, "gib": found.gib}
        bench.write(bench.merged(before, {"large": entry}, ["large"]))


if __name__ == "__main__":
    main()

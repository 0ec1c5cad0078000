"""How much faster two workers are than one: equal batches, the whole study by the clock on the wall, nothing subtracted.

One worker computes in the process that asked; two are processes of their own, so starting them, importing and handing
results over count against them. Not pinned.
"""

import time
from dataclasses import dataclass
from statistics import median

from engine import LANES
from studies import Study, make_study, run_study

from .models import MESHES

MESH = "T3 0.5 m"
BATCHES = 16
STEPS = 5_000
DT = 0.02
GOAL = 1.9


@dataclass(frozen=True)
class Speedup:
    """Wall seconds of one and of two workers by turns."""

    one: tuple[float, ...]
    two: tuple[float, ...]

    @property
    def speedup(self) -> float:
        """Median of the ratios of neighbours."""
        return median(one / two for one, two in zip(self.one, self.two, strict=True))


def equal_batches(batches: int = BATCHES, steps: int = STEPS) -> Study:
    """Full batches that differ in the strength of the shaking alone, each lane by less than a percent: equal work for all."""
    mesh = MESHES[MESH].model_dump(exclude_defaults=True)
    lengths = {name: f"{mesh[name]} m" for name in ("first", "largest_width", "largest_height")}
    table = {
        "title": "Equal batches",
        "mesh": mesh | lengths,
        "pressure": {"p0": 0},
        "motion": {"record": "synthetic", "peak": "0.5 m/s**2"},
        "time": {"dt": f"{DT} s", "duration": f"{steps * DT} s"},
        "output": {"every": steps},
        "sweep": {"scale": {"from": 0.995, "to": 1.005, "num": batches * LANES}},
    }
    return make_study(table, "workers")


def two_workers(runs: int = 3) -> Speedup:
    """Measure by turns; the first study compiles."""
    study = equal_batches()
    run_study(equal_batches(2, 100), 2)
    one, two = zip(*((_seconds(study, 1), _seconds(study, 2)) for _ in range(runs)), strict=True)
    return Speedup(one, two)


def _seconds(study: Study, workers: int) -> float:
    start = time.perf_counter()
    ds = run_study(study, workers)
    seconds = time.perf_counter() - start
    if (ds.status > 1).any():
        raise RuntimeError("a case of the study failed")
    return seconds

"""What a dask cluster takes longer than the pool: a thousand cases with histories by two processes of either, on the wall.

The cluster is started within its seconds, as the pool is, and sends histories through its scheduler; not pinned.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from statistics import median

from engine import compile_kernels
from studies import Study, make_study, run_study

from . import large

WORKERS = 2
EVERY = 10
GOAL = 0.10
HEADINGS = ("pool s", "cluster s", "overhead")


@dataclass(frozen=True)
class Pair:
    """Wall seconds of the pool and, right after it or before it, of the cluster."""

    pool: float
    cluster: float

    @property
    def overhead(self) -> float:
        """Of the cluster, as a fraction of the pool's seconds."""
        return self.cluster / self.pool - 1


def thousand() -> Study:
    """The large study with two frictions and every tenth step kept."""
    table = large.table_of(frictions=2)
    table["output"]["every"] = EVERY
    return make_study(table, "thousand")


def is_installed() -> bool:
    """Whether dask.distributed is."""
    return find_spec("distributed") is not None


def pairs(study: Study, n: int, seen: Callable[[Pair], None]) -> list[Pair]:
    """Measure by turns, the one first and then the other."""
    compile_kernels()
    found = []
    for k in range(n):
        seconds = {where: where(study) for where in ((_pool, _cluster) if k % 2 == 0 else (_cluster, _pool))}
        found.append(Pair(seconds[_pool], seconds[_cluster]))
        seen(found[-1])
    return found


def overhead(found: list[Pair]) -> float:
    """Median of the pairs."""
    return median(pair.overhead for pair in found)


def _pool(study: Study) -> float:
    start = time.perf_counter()
    run_study(study, WORKERS)
    return time.perf_counter() - start


def _cluster(study: Study) -> float:
    from distributed import LocalCluster

    start = time.perf_counter()
    with LocalCluster(n_workers=WORKERS, threads_per_worker=1, dashboard_address=":0") as workers:
        run_study(study, workers.scheduler_address)
        return time.perf_counter() - start

"""The lane solve beside the core's dgemm: forward and backward sweep of all lanes, in one process, by turns.

nnz(L) counts the strictly lower triangle of the factor in our order, without the zeros that its dense panels store; a solve of a
case takes two operations for each in either sweep. What the smallest mesh takes is in part the call from Python.
"""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from statistics import median
from typing import Any

import numpy as np

from engine import LANES, build_model, newmark_of
from engine.condensed import factorise, solve
from engine.kernels.panels import Factor
from engine.mesh import Floats

from .clock import Stopwatch, pinned
from .models import MESHES, STICKING, spec_of
from .process import apart
from .rows import told

SECONDS = 0.1
"""Of solves between two of dgemm."""

DGEMM = 1000
"""Rows and columns of the matrices."""

COPIED = 2**24
"""Numbers in the array that is copied: 128 MiB, more than caches hold."""

GOAL = 0.4


@dataclass(frozen=True)
class LaneRow:
    """Medians over the runs, of one core.

    nnz, stored : of L, without and with the zeros in the panels; us : of a case
    gflops, dgemm_gflops, fraction : the solve's rate, dgemm's, and the one over the other
    flops_us, memory_us : what a case would take at dgemm's rate; at the rate of a copy if the factor came from memory twice
    """

    mesh: str
    dof: int
    nnz: int
    stored: int
    us: float
    gflops: float
    dgemm_gflops: float
    fraction: float
    flops_us: float
    memory_us: float


def lane_table(runs: int = 7, seen: Callable[[LaneRow], None] | None = None) -> list[LaneRow]:
    """Every mesh in a process of its own; `seen` is called with every row as soon as it is there."""
    return told((LaneRow(**apart(measured, mesh, str(runs))) for mesh in MESHES), seen)


def fraction_of_dgemm(rows: list[LaneRow]) -> dict[int, float]:
    """By number of degrees of freedom."""
    return {row.dof: row.fraction for row in rows}


def measured(mesh: str, runs: str) -> dict[str, Any]:
    """The fields of a row: matrix K̂ of the mesh as its time loop has it."""
    spec = spec_of(MESHES[mesh], STICKING, 1.0)
    model = build_model(spec)
    rates, system = newmark_of(spec).rates(model.rayleigh), model.system
    matrix = (rates.a0 + rates.a1 * rates.alpha) * system.M + (1 + rates.a1 * rates.beta) * system.K
    factor = factorise(matrix, system.n_interior)
    with pinned():
        times = _by_turns(factor, int(runs))
        copied = copy_rate()
    return asdict(row_of(mesh, factor, times, copied))


def row_of(mesh: str, factor: Factor, times: Floats, copied: float) -> LaneRow:
    """The row of seconds a solve of all lanes and dgemm's rate [flop/s] by turns (n, 2), and a copy's rate [byte/s]."""
    nnz, solves, dgemm = int(np.count_nonzero(factor.values)), times[:, 0], times[:, 1]
    flops = 4 * nnz * LANES
    return LaneRow(
        mesh=mesh,
        dof=len(factor.inverse_pivots),
        nnz=nnz,
        stored=len(factor.values),
        us=1e6 * median(solves) / LANES,
        gflops=flops / median(solves) / 1e9,
        dgemm_gflops=median(dgemm) / 1e9,
        fraction=median(flops / solves / dgemm),
        flops_us=1e6 * 4 * nnz / median(dgemm),
        memory_us=1e6 * 2 * (factor.values.nbytes + factor.rows.nbytes) / copied / LANES,
    )


def _by_turns(factor: Factor, runs: int) -> Floats:
    """(runs, 2): seconds of a solve of all lanes, and dgemm's rate [flop/s]."""
    start = np.random.default_rng(1).standard_normal((len(factor.inverse_pivots), LANES))
    x, a = start.copy(), start[:1, :1] + np.ones((DGEMM, DGEMM))
    solve(factor, x)  # compiles
    times = []
    for _ in range(runs):
        stopwatch, n = Stopwatch(), 0
        while stopwatch.seconds < SECONDS:
            x[:] = start  # solved again and again it would run into the numbers too small to be quick
            with stopwatch:
                solve(factor, x)
            n += 1
        times.append((stopwatch.seconds / n, dgemm_rate(a)))
    return np.array(times)


def dgemm_rate(a: Floats) -> float:
    """[flop/s] of a product of square matrices."""
    with Stopwatch() as stopwatch:
        a @ a
    return 2 * len(a) ** 3 / stopwatch.seconds


def copy_rate() -> float:
    """Bytes read and written a second, of a copy in memory; median of five."""
    source, target = np.ones(COPIED), np.zeros(COPIED)
    rates = []
    for _ in range(5):
        with Stopwatch() as stopwatch:
            np.copyto(target, source)
        rates.append(2 * source.nbytes / stopwatch.seconds)
    return median(rates)


HEADINGS = ("mesh", "dof", "nnz(L)", "stored", "µs a case", "GFLOP/s", "dgemm", "share", "flop bound µs", "memory bound µs")


def cells(row: LaneRow) -> tuple[str, ...]:
    """A row in text."""
    sizes = (f"{row.dof:,}", f"{row.nnz:,}", f"{row.stored:,}")
    rates = (f"{row.us:.1f}", f"{row.gflops:.1f}", f"{row.dgemm_gflops:.1f}", f"{row.fraction:.0%}")
    return row.mesh, *sizes, *rates, f"{row.flops_us:.1f}", f"{row.memory_us:.1f}"

"""`make bench`: all tables, or those named, as they come; each is put into results/bench.json when it is done."""

import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from time import perf_counter
from typing import Any

from rich.console import Console
from rich.live import Live
from rich.table import Table

from . import bench, cluster, growth, lanes, phases, ratio, startup, workers
from .clock import pinned
from .peer import SOLVERS, opensees, opensees_version

Add = Callable[..., None]
Found = dict[str, Any]

WIDTH = 150
"""Columns of text where the output is no terminal, wide enough for every table."""


@contextmanager
def growing(console: Console, title: str, headings: Sequence[str], goal: str) -> Iterator[Add]:
    """A table that is shown anew with every row added; numbers to the right."""
    table = Table(title=title, title_justify="left", caption=goal, caption_justify="left")
    for k, heading in enumerate(headings):
        table.add_column(heading, justify="right" if k else "left", overflow="fold")
    with Live(table, console=console, auto_refresh=False) as live:  # a thread that refreshes would be timed, too

        def add(*texts: str) -> None:
            table.add_row(*texts)
            live.refresh()

        yield add


def ratios(console: Console, quick: bool) -> Found:
    """Beside OpenSees."""
    goal = "goal: 300 times quicker on the paper mesh, 1 000 at about 2 400 dof, 2 000 at about 9 000; difference below 1e-6"
    title = "OpenSeesPy and coralquake: milliseconds a step, microseconds a case-step, one core"
    with growing(console, title, ratio.HEADINGS, goal) as add:
        rows = ratio.ratio_table(1 if quick else 3, lambda row: add(*ratio.cells(row)))
    peer = opensees_version() if opensees() is not None else ratio.NOT_INSTALLED
    return {
        "ratio_to_opensees": ratio.ratio_to_opensees(rows),
        "ratio": [asdict(row) for row in rows],
        "openseespy": peer,
        "solvers": SOLVERS,
    }


def lane_solve(console: Console, quick: bool) -> Found:
    """Beside dgemm."""
    goal = f"goal: {lanes.GOAL:.0%} from 2 242 to 34 702 dof"
    with growing(console, f"Lane solve of {lanes.LANES} lanes beside dgemm, one core", lanes.HEADINGS, goal) as add:
        rows = lanes.lane_table(3 if quick else 7, lambda row: add(*lanes.cells(row)))
    return {"lane_solve_fraction_of_dgemm": lanes.fraction_of_dgemm(rows), "lane_solve": [asdict(row) for row in rows]}


def of_phases(console: Console, quick: bool) -> Found:
    """Where the time goes."""
    goal = f"goal: rest / lane solve at most {phases.GOAL:g}"
    with growing(console, "Microseconds a case-step by phase, one core", phases.HEADINGS, goal) as add:
        rows = phases.phase_table(1 if quick else 3, lambda row: add(*phases.cells(row)))
    return {"phases": phases.in_bench(rows)}


def of_growth(console: Console, quick: bool) -> Found:
    """From small to large; one run whether quick or not, for the largest mesh takes a minute."""
    goal = f"goal: cost grows like nnz(L); the largest mesh within {growth.GOAL_GIB:g} GiB"
    with growing(console, "A whole step from small to large, joints sticking, one core", growth.HEADINGS, goal) as add:
        rows = growth.growth_table(lambda row: add(*growth.cells(row)))
    found = growth.in_bench(rows)
    console.print(f"\ncost grows like nnz(L) to the power {found['slope']:.2f}")
    return found


def of_workers(console: Console, quick: bool) -> Found:
    """Two beside one."""
    title, goal = (
        f"{workers.BATCHES} equal batches of {workers.STEPS:,} steps, wall time, start included",
        f"goal: {workers.GOAL}",
    )
    with growing(console, title, ("one worker s", "two workers s", "speed-up"), goal) as add:
        found = workers.two_workers(1 if quick else 3)
        for one, two in zip(found.one, found.two, strict=True):
            add(f"{one:.1f}", f"{two:.1f}", f"{one / two:.2f}")
    return {"two_workers_speedup": found.speedup, "two_workers": asdict(found)}


def of_cluster(console: Console, quick: bool) -> Found:
    """Beside the pool."""
    if not cluster.is_installed():
        console.print("cluster: dask.distributed is not installed")
        return {"cluster_overhead": None, "cluster": []}
    title = f"1,000 cases by {cluster.WORKERS} processes, start included"
    with growing(console, title, cluster.HEADINGS, f"goal: at most {cluster.GOAL:.0%}, median") as add:
        found = cluster.pairs(
            cluster.thousand(),
            1 if quick else 5,
            lambda pair: add(f"{pair.pool:.1f}", f"{pair.cluster:.1f}", f"{pair.overhead:+.1%}"),
        )
    console.print(f"\nmedian {cluster.overhead(found):+.1%}")
    return {"cluster_overhead": cluster.overhead(found), "cluster": [asdict(pair) for pair in found]}


def of_startup(console: Console, quick: bool) -> Found:
    """From the shell."""
    with growing(console, "Seconds to start", ("what", "seconds", "goal"), "") as add:
        repeats = 3 if quick else 5
        with pinned():
            found = {
                "seconds_import": startup.seconds_import(repeats),
                "seconds_warm": startup.seconds_warm(repeats),
                "seconds_cold": startup.seconds_cold(),
            }
        add("import engine, beyond numba and scipy.sparse.linalg", f"{found['seconds_import']:.2f}", "0.15")
        add("coralquake run paper, kernels compiled before", f"{found['seconds_warm']:.2f}", "2")
        add("compiling every kernel", f"{found['seconds_cold']:.1f}", "40")
    return found


TABLES: dict[str, Callable[[Console, bool], Found]] = {
    "lanes": lane_solve,
    "phases": of_phases,
    "ratio": ratios,
    "growth": of_growth,
    "workers": of_workers,
    "cluster": of_cluster,
    "startup": of_startup,
}


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, show and keep; what other tables found before stays in the file."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("tables", nargs="*", metavar="TABLE", help=f"which to measure; all by default: {', '.join(TABLES)}")
    parser.add_argument("--quick", action="store_true", help="fewer runs")
    chosen = parser.parse_args(arguments)
    if unknown := [name for name in chosen.tables if name not in TABLES]:
        parser.error(f"{', '.join(unknown)}: no such table; there are {', '.join(TABLES)}")
    console = Console(highlight=False)
    if not console.is_terminal:
        console.width = WIDTH
    for name in chosen.tables or list(TABLES):
        start = perf_counter()
        found = TABLES[name](console, chosen.quick)
        bench.write(bench.merged(bench.read(), found, [name]))
        console.print(f"\n{name}: {perf_counter() - start:.0f} s\n")
    console.print(f"{bench.BENCH} is written.", soft_wrap=True)


if __name__ == "__main__":
    main()

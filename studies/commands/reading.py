"""plot, show, table: what a results file holds."""

from contextlib import nullcontext
from pathlib import Path

import xarray as xr
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from ..files import whole
from ..messages import StudyError, one_line
from ..results import read_results
from ..show import show_lines
from ..tables import axes_of, table
from . import console
from .console import refuse, say

WIDEST_COLUMN = 30
"""Characters that a column of results may need; the table is as wide as its content, narrower terminals wrap its lines."""


def _open(path: Path) -> xr.Dataset:
    """All of a results file, in memory; what is none is refused."""
    try:
        return read_results(path)
    except StudyError as error:
        raise refuse(error.mistakes) from None


def draw(ds: xr.Dataset, path: Path) -> None:
    """Draw the figures of a dataset beside its file."""
    from ..plots import draw_all  # matplotlib is slow to import, and most commands draw nothing

    try:
        for figure in draw_all(ds, path):
            say(f"figure  {figure}")
    except OSError as error:
        raise refuse([f"{path.parent}: figures cannot be written: {error.strerror or error}"]) from None
    except (ArithmeticError, LookupError, TypeError, ValueError) as error:  # matplotlib, of values that were forged
        raise refuse([f"{path}: holds what cannot be drawn: {error}"]) from None


def plot(path: Path) -> None:
    """Draw the figures of a results file beside it."""
    draw(_open(path), path)


def show(path: Path) -> None:
    """Say what a results file is."""
    for line in show_lines(_open(path)):
        say(line)


def tabulate(path: Path, csv: Path | None) -> None:
    """Print one row a case, or write them to a CSV file."""
    ds = _open(path)
    frame = table(ds)
    if csv is not None:
        try:
            with nullcontext(csv) if csv.exists() and not csv.is_file() else whole(csv) as target:  # a device stays one
                frame.to_csv(target, index=False)
        except OSError as error:
            raise refuse([f"{csv}: cannot be written: {error.strerror or error}"]) from None
        return
    grid = Table(box=None, padding=(0, 2, 0, 0), pad_edge=False)
    for name in frame.columns:
        head, factor = (str(name), 1.0) if str(name).startswith(tuple(axes_of(ds))) else _readable(str(name))
        grid.add_column(escape(one_line(head)), justify="right")
        if frame[name].dtype.kind == "f":
            frame[name] = [f"{factor * value:.3g}" for value in frame[name]]
    for row in frame.itertuples(index=False):
        grid.add_row(*(escape(one_line(str(entry))) for entry in row))
    Console(width=max(console.out.width, WIDEST_COLUMN * len(frame.columns)), highlight=False).print(grid)


def _readable(column: str) -> tuple[str, float]:
    """Head of a column in units that make short numbers, and the factor to them."""
    for si, unit, factor in (("[m]", "[mm]", 1e3), ("[Pa]", "[MPa]", 1e-6), (" [1]", "", 1.0)):
        if column.endswith(si):
            return column.removesuffix(si) + unit, factor
    return column, 1.0

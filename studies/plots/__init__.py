"""Figures of a dataset, 180 mm wide, legible in grey."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from engine import Status

from ..domain_size import is_domain_size
from ..messages import in_words
from ..tables import axes_of, cases_of
from .box import deformed_figure, mesh_figure
from .contact import contact_figure, joint_figure
from .convergence import convergence_figure
from .motion import history_figure, record_figure
from .racking import racking_figure
from .sections import interaction_figure, sections_figure
from .style import LABEL_WIDTH, STYLE, in_lines, only_axis_of_numbers, symbol
from .sweeps import GRID_QUANTITIES, grid_figure, peaks_figure

__all__ = ["draw_all"]


def draw_all(ds: xr.Dataset, path: Path) -> list[Path]:
    """Draw every figure that the dataset allows beside `path`; the files drawn are returned."""
    done = cases_of(ds)
    done = done.isel(case=np.flatnonzero(done["status"].values <= Status.SUBSTEPS))
    drawings: dict[str, Callable[[], Figure]] = {"mesh": lambda: mesh_figure(cases_of(ds).isel(case=0))}
    if done.sizes["case"]:
        axes = axes_of(ds)
        shown = _shown(done, axes)
        marched = ds.sizes["time"] > 1
        if marched:
            drawings["record"] = lambda: record_figure(done)
            drawings["history"] = lambda: history_figure(done, shown)
        drawings["deformed"] = lambda: deformed_figure(done, shown)
        if marched and ds.sizes["joint"]:
            drawings["contact"] = lambda: contact_figure(done, shown)
            drawings["joint"] = lambda: joint_figure(done, shown)
        if ds.sizes["section"]:
            drawings["sections"] = lambda: sections_figure(done, shown)
            drawings["interaction"] = lambda: interaction_figure(done, shown)
        if marched and np.isfinite(done["racking_ratio"]).any():
            drawings["racking"] = lambda: racking_figure(done, axes)
        if len(axes) > 1 and all(ds[axis].dtype.kind in "fi" for axis in axes):
            for quantity in GRID_QUANTITIES:
                drawings[f"sweep-{quantity}"] = partial(grid_figure, ds, quantity)
        if axis := only_axis_of_numbers(done, axes):
            drawings["peaks"] = partial(peaks_figure, done, axis)
        if is_domain_size(ds):
            drawings["convergence"] = lambda: convergence_figure(ds)
    files = []
    with mpl.rc_context(STYLE):  # type: ignore[arg-type]
        for name, draw in drawings.items():
            file = path.with_name(f"{path.stem}-{name}.png")
            draw().savefig(file)
            files.append(file)
    return files


def _shown(cases: xr.Dataset, axes: list[str]) -> dict[int, str]:
    """Up to three cases to show side by side (first, middle, last), with their labels."""
    n = cases.sizes["case"]
    chosen = sorted({0, n // 2, n - 1})
    return {i: in_lines([part for axis in axes for part in _label(cases, axis, i)], LABEL_WIDTH) for i in chosen}


def _label(cases: xr.Dataset, axis: str, i: int) -> list[str]:
    """What a case is along one axis: 'p0 = 2 MPa'; the sizes of a domain speak for themselves."""
    value = in_words(cases[axis].values[i], cases[axis].attrs["units"])
    return value.split(", ") if axis == "domain" else [f"{symbol(axis)} = {value}"]
